//! Radial velocities: first moments with the spots in them, and what is left when these are taken out; over time and
//! folded with the orbit.

use super::ephemeris::ephemeris;
use super::symbols::decimals;
use super::{ANY, PlotError};
use crate::data::io::csv::Columns;
use crate::data::io::map::{FIT, FitFile};
use crate::figures::drawing::colour::{BLACK, BLUE, GREY, VERMILION};
use crate::figures::drawing::panel::Sides;
use crate::figures::drawing::{Axis, COLUMN_MM, Figure, Key, Legend, Marker, PAGE_MM, Panel, Rect, Stroke, range_of};
use crate::runs::blind_search::{OrbitRecord, PeriodogramFile};
use crate::runs::origin;
use crate::star::{Eccentric, Motion, Orbit};
use std::path::Path;

/// The table of velocities that `map` and `periodogram` write.
pub(super) const FILE: &str = "rv.csv";

/// The covariance of those of `periodogram`, a row a profile.
const COVARIANCE: &str = "covariance.csv";

/// A velocity with its error bar, or without where that is 0.
struct Series<'a> {
    class: &'static str,
    label: &'a str,
    y: Vec<f64>,
    sigma: Vec<f64>,
    marker: (Marker, f64, crate::figures::drawing::Colour),
}

/// Velocities over time in panels above each other, and one of them folded with an orbit.
struct Curves<'a> {
    cycle: &'a [f64],
    panels: Vec<(&'a str, Vec<Series<'a>>)>,
    motion: Motion,
    vsys_kms: f64,
    /// Rotation period of the star (d).
    rotation_period_d: f64,
    /// Errors of K (km/s) and of the period over that of rotation, where they are known.
    sigma: [Option<f64>; 2],
    /// What the orbit is called.
    orbit_is: &'static str,
    /// The panel of velocities without spots, where the orbit is drawn and which is folded.
    orbital: usize,
}

/// The velocities of maps: marginalised over maps, or with the model's spots taken out.
pub(super) fn of_map(folder: &Path) -> Result<Figure, PlotError> {
    let table = Columns::read(&folder.join(FILE))?;
    let fit: FitFile = origin::read(folder, FIT)?;
    table.check_rows(fit.summary.profiles, &format!("the profiles, by {FIT}"))?;
    let state = fit.summary.parameters.state();
    let column = |name: &str| Ok::<_, PlotError>(table.column(name)?.to_vec());
    let (orbit_kms, sigma) = (column("orbit_kms")?, column("sigma_kms")?);
    let (clean, residual, errors): (Vec<f64>, Vec<f64>, Vec<f64>) = match fit.field.is_some() {
        true => {
            let rv: Vec<f64> = column("rv_kms")?.iter().map(|rv| rv + state.vsys_kms).collect();
            let residual = rv.iter().zip(&orbit_kms).map(|(rv, orbit)| rv - orbit).collect();
            (rv, residual, column("rv_sigma_kms")?)
        }
        false => {
            let filtered = column("filtered_kms")?;
            (filtered.iter().zip(&orbit_kms).map(|(f, o)| f + o).collect(), filtered, sigma.clone())
        }
    };
    let series = |y, sigma, label| Series { class: "observed", label, y, sigma, marker: POINT };
    let modelled = column("modelled_kms")?;
    let model = Series { class: "model", label: "model", y: modelled, sigma: Vec::new(), marker: MODEL };
    let curves = Curves {
        cycle: table.column_within("cycle", ANY)?,
        panels: vec![
            ("RV (km/s)", vec![series(column("observed_kms")?, sigma, "first moment"), model]),
            ("RV − spots (km/s)", vec![series(clean, errors.clone(), "")]),
            ("residual (km/s)", vec![series(residual, errors, "")]),
        ],
        motion: state.motion,
        vsys_kms: state.vsys_kms,
        rotation_period_d: ephemeris(&fit.provenance.config).map_or(f64::NAN, |(period_d, _)| period_d),
        sigma: [None; 2],
        orbit_is: "assumed orbit",
        orbital: 1,
    };
    let mut figure = curves.draw();
    figure.caption = match fit.field.is_some() {
        true => {
            "Radial velocities. Above: first moments of the observed profiles and of the model. Middle: with all maps \
            integrated out, and the assumed orbit; their errors are correlated. Below: the assumed orbit taken out. To \
            the right, if an orbit is assumed: the middle folded with the orbital period; phase 0 is the largest \
            velocity."
        }
        false => {
            "Radial velocities. Above: first moments of the observed profiles and of the model. Middle: the model's \
            spots taken out, with the assumed orbit. Below: the model taken out. To the right: the middle folded with \
            the orbital period; phase 0 is the largest velocity."
        }
    }
    .into();
    Ok(figure)
}

/// The velocities of a blind search, with the orbit that it found.
pub(super) fn of_search(folder: &Path, file: &PeriodogramFile) -> Result<Figure, PlotError> {
    let OrbitRecord { k_kms, sigma_k_kms, porb_over_prot, sigma_porb_over_prot, phi, period_d, .. } = file.best;
    let motion = Motion::from(Orbit { k_kms, porb_over_prot, phi });
    // velocities count from a systemic velocity that is found
    let offset_kms = match file.systemic_velocity {
        Some(_) => 0.0,
        None => file.offset.as_ref().map_or(0.0, |offset| offset.velocity_kms),
    };
    let table = Columns::read(&folder.join(FILE))?;
    if let Ok(covariance) = std::fs::read_to_string(folder.join(COVARIANCE)) {
        table.check_rows(covariance.lines().count(), &format!("those of {COVARIANCE}"))?;
    }
    let series = |class, label, y: &str, sigma: &str, marker| {
        Ok::<_, PlotError>(Series {
            class,
            label,
            y: table.column(y)?.to_vec(),
            sigma: table.column(sigma)?.to_vec(),
            marker,
        })
    };
    let cycle = table.column_within("cycle", ANY)?;
    let clean = series("observed", "", "rv_kms", "rv_sigma_kms", POINT)?;
    let orbit: Vec<f64> = cycle.iter().map(|cycle| offset_kms + motion.velocity_kms(*cycle)).collect();
    let residual = clean.less(&orbit);
    let curves = Curves {
        cycle,
        panels: vec![
            ("RV (km/s)", vec![series("observed", "", "first_moment_kms", "first_moment_sigma_kms", POINT)?]),
            ("RV − spots (km/s)", vec![clean]),
            ("residual (km/s)", vec![residual]),
        ],
        motion,
        vsys_kms: offset_kms,
        rotation_period_d: period_d / porb_over_prot,
        sigma: [Some(sigma_k_kms), sigma_porb_over_prot],
        orbit_is: "best orbit",
        orbital: 1,
    };
    let mut figure = curves.draw();
    figure.caption =
        "Radial velocities. Above: first moments of the profiles. Middle: with the spots marginalised out, and the \
        best orbit; their errors are correlated, bars are the diagonal of the covariance (covariance.csv), without the \
        error of systemic velocity and RV offsets, which shifts all profiles of a data set alike. Below: the best \
        orbit taken out. To the right: the middle folded with the orbital period; phase 0 is the largest velocity."
            .into();
    Ok(figure)
}

const POINT: (Marker, f64, crate::figures::drawing::Colour) = (Marker::Disc, 3.2, BLACK);
const MODEL: (Marker, f64, crate::figures::drawing::Colour) = (Marker::Diamond, 2.6, VERMILION);
const ORBIT: Stroke = Stroke::new(BLUE, 1.0);

impl Curves<'_> {
    fn draw(&self) -> Figure {
        let Orbit { k_kms, porb_over_prot, .. } = self.motion.first.orbit;
        let folds = k_kms > 0.0 && porb_over_prot > 0.0;
        let rows = self.panels.len() as f64;
        let mut figure = Figure::new("rv", if folds { PAGE_MM } else { COLUMN_MM }, 24.0 + 26.0 * rows);
        let mut legend = legend(&self.panels[0].1);
        legend.add(Key::Line(ORBIT), self.orbit_is);
        let (left, top, gap) = (38.0, 16.0, 8.0);
        let width = if folds { 0.56 * figure.width - left } else { figure.width - left - 8.0 };
        let height = (figure.height - top - 28.0 - gap * (rows - 1.0)) / rows;
        let span = range_of(self.cycle.iter().copied(), crate::figures::drawing::Scale::Linear, 0.03);
        for (k, (label, series)) in self.panels.iter().enumerate() {
            let frame = Rect { left, top: top + k as f64 * (height + gap), width, height };
            let middle = if k > self.orbital { 0.0 } else { self.vsys_kms };
            let y = Axis::linear(label, range(series, middle));
            let panel = Panel { frame, x: Axis::linear("rotation cycle", span), y };
            match k {
                k if k == self.orbital => {
                    let steps = 600;
                    let curve: Vec<[f64; 2]> = (0..=steps)
                        .map(|i| span[0] + (span[1] - span[0]) * f64::from(i) / f64::from(steps))
                        .map(|cycle| [cycle, self.vsys_kms + self.motion.velocity_kms(cycle)])
                        .collect();
                    panel.line(&mut figure, "orbit", &curve, ORBIT);
                }
                k if k > self.orbital => panel.horizontal(&mut figure, "zero", 0.0, Stroke::new(GREY, 0.6).dashed()),
                _ => {}
            }
            series.iter().for_each(|one| one.draw(&mut figure, &panel, self.cycle));
            let below = k + 1 == self.panels.len();
            panel.frame(&mut figure, Sides { below, left: true });
        }
        let middle = left + 0.5 * width;
        legend.row(&mut figure, [middle, 8.0]);
        if folds {
            let frame = Rect {
                left: left + width + 48.0,
                top,
                width: figure.width - left - width - 56.0,
                height: figure.height - top - 28.0,
            };
            self.fold(&mut figure, frame);
        }
        figure
    }

    fn fold(&self, figure: &mut Figure, frame: Rect) {
        let (label, series) = &self.panels[self.orbital];
        let y = Axis::linear(label, range(series, self.vsys_kms));
        let panel = Panel { frame, x: Axis::linear("orbital phase (0: maximal RV)", [0.0, 1.0]), y };
        let Motion { first, second } = self.motion;
        let Orbit { k_kms, porb_over_prot, phi } = first.orbit;
        let phase = |cycle: &f64| (cycle / porb_over_prot - phi).rem_euclid(1.0);
        // counted from the largest velocity
        let alone = Eccentric { orbit: Orbit { porb_over_prot: 1.0, phi: 0.0, ..first.orbit }, ..first };
        let curve: Vec<[f64; 2]> =
            (0..=200).map(|i| f64::from(i) / 200.0).map(|t| [t, self.vsys_kms + alone.velocity_kms(t)]).collect();
        panel.line(figure, "orbit", &curve, ORBIT);
        let phases: Vec<f64> = self.cycle.iter().map(phase).collect();
        let others = |cycle: &f64| second.map_or(0.0, |second| second.velocity_kms(*cycle));
        let others: Vec<f64> = self.cycle.iter().map(others).collect();
        series.iter().for_each(|one| one.less(&others).draw(figure, &panel, &phases));
        panel.frame(figure, Sides::BOTH);
        let mut legend = Legend::default();
        let period_d = porb_over_prot * self.rotation_period_d;
        let digits = |sigma: Option<f64>| decimals(sigma.unwrap_or(f64::NAN));
        let [k, ratio] = self.sigma.map(digits);
        let days = digits(self.sigma[1].map(|sigma| sigma * self.rotation_period_d));
        let text = format!("*K* = {k_kms:.k$} km/s, *P* = {period_d:.days$} d = {porb_over_prot:.ratio$} *P*_{{rot}}");
        legend.add(Key::Line(ORBIT), &text);
        legend.draw(figure, frame, [0.5, 0.0]);
    }
}

/// Room above the highest end of an error bar and below the lowest, as a share of half the range: that of a legend.
const MARGIN: f64 = 0.25;

/// All error bars, with as much above `middle` as below it, so that a panel shows what is not centred there; above and
/// below their own mean where they are all to one side of it.
fn range(series: &[Series], middle: f64) -> [f64; 2] {
    let ends = series.iter().flat_map(|one| {
        let sigma = |k: usize| one.sigma.get(k).copied().unwrap_or(0.0);
        one.y.iter().enumerate().flat_map(move |(k, y)| [y - sigma(k), y + sigma(k)])
    });
    let [low, high] = range_of(ends, crate::figures::drawing::Scale::Linear, 0.0);
    let all = || series.iter().flat_map(|one| &one.y).filter(|y| y.is_finite());
    let mean = || all().sum::<f64>() / all().count() as f64;
    let middle = if (low..=high).contains(&middle) { middle } else { mean() };
    let half = (1.0 + MARGIN) * (high - middle).max(middle - low);
    if half.is_finite() { [middle - half, middle + half] } else { [low, high] }
}

fn legend(series: &[Series]) -> Legend {
    let mut legend = Legend::default();
    series.iter().for_each(|one| legend.add(Key::Point(one.marker.0, one.marker.2), one.label));
    legend
}

impl<'a> Series<'a> {
    fn less(&self, y_kms: &[f64]) -> Series<'a> {
        let y = self.y.iter().zip(y_kms).map(|(y, less)| y - less).collect();
        Series { y, sigma: self.sigma.clone(), ..*self }
    }

    fn draw(&self, figure: &mut Figure, panel: &Panel, x: &[f64]) {
        for ((x, y), sigma) in x.iter().zip(&self.y).zip(&self.sigma) {
            panel.bar(figure, "error-bar", [[*x, y - sigma], [*x, y + sigma]], 0.0, Stroke::new(GREY, 0.6));
        }
        let points: Vec<[f64; 2]> = x.iter().zip(&self.y).map(|(x, y)| [*x, *y]).collect();
        panel.points(figure, self.class, &points, self.marker);
    }
}
