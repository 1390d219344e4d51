//! Radial velocities: first moments including the spots, and the residuals after subtracting them; as functions of time
//! and folded with the orbit.

use super::ephemeris::ephemeris;
use super::symbols::decimals;
use super::times::{Clock, Stretch, stretches};
use super::{ANY, PlotError};
use crate::data::io::csv::Columns;
use crate::data::io::map::{FIT, FitFile};
use crate::data::io::provenance::Provenance;
use crate::figures::drawing::colour::{BLACK, BLUE, GREY, PURPLE, VERMILION};
use crate::figures::drawing::panel::Sides;
use crate::figures::drawing::{Align, Axis, Figure, Font, Key, Legend, Marker, PAGE_MM, Panel, Rect, Stroke, range_of};
use crate::planets::speeds::Speeds;
use crate::planets::verdict::speed;
use crate::runs::blind_search::{KnownPlanetRecord, OrbitRecord, PeriodogramFile};
use crate::runs::origin;
use crate::star::{Eccentric, Motion, Orbit};
use std::path::Path;

/// The table of velocities by `map` and `periodogram`.
pub(super) const FILE: &str = "rv.csv";

/// The covariance of those by `periodogram`, one row per profile.
const COVARIANCE: &str = "covariance.csv";

/// Velocities (km/s) with their error bars, or without where these are missing.
struct Series<'a> {
    class: &'static str,
    label: &'a str,
    y: Vec<f64>,
    sigma: Vec<f64>,
    marker: (Marker, f64, crate::figures::drawing::Colour),
}

/// Velocities over time in panels above each other, and those without spots folded with an orbit.
struct Curves<'a> {
    time_d: &'a [f64],
    cycle: &'a [f64],
    /// First moments, including the spots.
    moments: Vec<Series<'a>>,
    /// Without spots.
    clean: Series<'a>,
    /// Also without the orbit.
    residual: Series<'a>,
    motion: Motion,
    vsys_kms: f64,
    /// Rotation period of the star (d).
    rotation_period_d: f64,
    /// Uncertainties of K (km/s) and of the period over that of rotation, where they are known.
    sigma: [Option<f64>; 2],
    /// Description of the orbit.
    orbit_is: &'static str,
    /// Profiles with enlarged uncertainties, from 0.
    events: Vec<usize>,
}

/// The velocities of maps: marginalised over maps, or with the model's spots subtracted.
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
        time_d: table.column_within("time_d", ANY)?,
        cycle: table.column_within("cycle", ANY)?,
        moments: vec![series(column("observed_kms")?, sigma, "first moment"), model],
        clean: series(clean, errors.clone(), ""),
        residual: series(residual, errors, ""),
        motion: state.motion,
        vsys_kms: state.vsys_kms,
        rotation_period_d: ephemeris(&fit.provenance.config).map_or(f64::NAN, |(period_d, _)| period_d),
        sigma: [None; 2],
        orbit_is: "assumed orbit",
        events: events(&fit.provenance, fit.summary.profiles),
    };
    let mut figure = curves.draw();
    let spots = match fit.field.is_some() {
        true => {
            "marginalised over spots; uncertainties are correlated, and include the RV jitter, with a planet's signal"
        }
        false => "spots of the model taken out",
    };
    let folded = match curves.folds() {
        true => " Bottom: residuals. Right: the same folded with the orbital period; phase 0 is the largest velocity.",
        false => "",
    };
    figure.caption = format!(
        "Radial velocities. Top: first moments of the observed profiles and of the model. Below: {spots}{}.{folded}{}",
        if curves.folds() { ", and the assumed orbit" } else { "" },
        curves.of_events(),
    );
    Ok(figure)
}

/// The velocities of a blind search, with its orbit.
pub(super) fn of_search(folder: &Path, file: &PeriodogramFile) -> Result<Figure, PlotError> {
    let OrbitRecord { k_kms, sigma_k_kms, porb_over_prot, sigma_porb_over_prot, phi, period_d, .. } = file.best;
    // planets of known ephemeris, or the best orbit
    let best = Motion::from(Orbit { k_kms, porb_over_prot, phi });
    let first = file.first_known().map_or(best.first, KnownPlanetRecord::eccentric);
    let motion = Motion { first, second: file.other_known().first().map(KnownPlanetRecord::eccentric) };
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
    let orbit: Vec<f64> = cycle.iter().map(|cycle| motion.velocity_kms(*cycle)).collect();
    // velocities are relative to a fitted systemic velocity; with a given one, all may have a common offset
    let offset_kms = match (file.systemic_velocity, &file.offset) {
        (None, Some(_)) => clean.less(&orbit).mean(),
        _ => 0.0,
    };
    let residual = clean.less(&orbit.iter().map(|kms| offset_kms + kms).collect::<Vec<_>>());
    let curves = Curves {
        time_d: table.column_within("time_d", ANY)?,
        cycle,
        moments: vec![series("observed", "", "first_moment_kms", "first_moment_sigma_kms", POINT)?],
        clean,
        residual,
        motion,
        vsys_kms: offset_kms,
        rotation_period_d: period_d / porb_over_prot,
        sigma: [Some(sigma_k_kms), sigma_porb_over_prot],
        orbit_is: match (file.first_known(), motion.second) {
            (None, None) => "best orbit",
            (None, Some(_)) => "best orbit and known planet",
            (Some(_), None) => "known planet",
            (Some(_), Some(_)) => "known planets",
        },
        events: events(&file.provenance, cycle.len()),
    };
    let mut figure = curves.draw();
    figure.caption = format!(
        "Radial velocities. Top: first moments of the profiles. Middle: spots marginalised out, and the {}; \
        uncertainties are correlated, bars are the diagonal of the covariance (covariance.csv), without the \
        uncertainty of systemic velocity and RV offsets, which shifts all profiles of a data set alike. Bottom: \
        residuals. Right: the same folded with the orbital period{}; phase 0 is the largest velocity.{}",
        match (file.first_known(), motion.second) {
            (None, None) => "best orbit",
            (None, Some(_)) => "best orbit and that of the known planet",
            (Some(_), None) => "orbit of the known planet",
            (Some(_), Some(_)) => "orbits of the known planets",
        },
        if motion.second.is_some() { " of the first orbit, the second taken out" } else { "" },
        curves.of_events(),
    );
    Ok(figure)
}

/// The profiles with enlarged uncertainties among so many, from 0.
fn events(provenance: &Provenance, profiles: usize) -> Vec<usize> {
    let events = provenance.measured.events.iter().flat_map(|events| &events.profiles);
    (0..profiles).filter(|k| events.clone().any(|event| event.profile == k + 1)).collect()
}

const POINT: (Marker, f64, crate::figures::drawing::Colour) = (Marker::Disc, 3.2, BLACK);
const MODEL: (Marker, f64, crate::figures::drawing::Colour) = (Marker::Diamond, 2.6, VERMILION);
const EVENT: (Marker, f64, crate::figures::drawing::Colour) = (Marker::Ring, 6.5, PURPLE);
const ORBIT: Stroke = Stroke::new(BLUE, 1.0);

/// Panels on the left: heights of first moments, velocities without spots, and residuals, as fractions.
const ROWS: [f64; 3] = [1.0, 1.3, 0.8];

impl Curves<'_> {
    /// Whether there is an orbit for folding.
    fn folds(&self) -> bool {
        let Orbit { k_kms, porb_over_prot, .. } = self.motion.first.orbit;
        k_kms > 0.0 && porb_over_prot > 0.0
    }

    fn draw(&self) -> Figure {
        let rows = if self.folds() { &ROWS[..] } else { &ROWS[..2] };
        let mut figure = Figure::new("rv", PAGE_MM, 30.0 + 26.0 * rows.len() as f64);
        let (left, top, gap) = (38.0, 38.0, 7.0);
        let width = if self.folds() { 0.56 * figure.width - left } else { figure.width - left - 8.0 };
        let room = figure.height - top - 28.0 - gap * (rows.len() as f64 - 1.0);
        let total: f64 = rows.iter().sum();
        let clock = Clock::of(self.time_d.iter().copied());
        let parts = stretches(self.time_d.iter().copied(), left, width);
        let unit = Speeds::of(&[&self.clean.y[..], &self.residual.y].concat());
        let moments: Vec<&Series> = self.moments.iter().collect();
        let mut at = top;
        let mut frames = Vec::new();
        for (k, share) in rows.iter().enumerate() {
            let whole = Rect { left, top: at, width, height: room * share / total };
            let (series, label, unit) = match k {
                0 => (moments.clone(), "RV", Speeds::KMS),
                1 => (vec![&self.clean], "spot-corrected RV", unit),
                _ => (vec![&self.residual], "residual", unit),
            };
            let y = unit.axis(label, range(&series, if k > 1 { 0.0 } else { self.vsys_kms }));
            for (n, part) in parts.iter().enumerate() {
                let frame = Rect { left: part.left, width: part.width, ..whole };
                let panel = Panel { frame, x: part.axis(&clock), y: y.clone() };
                self.draw_part(&mut figure, (&panel, part, &clock), k, (&series, unit));
                let sides = Sides { below: k + 1 == rows.len(), left: n == 0 };
                panel.two_axes_frame(&mut figure, sides, &self.cycles(part), k == 0);
            }
            frames.push(whole);
            at += whole.height + gap;
        }
        let middle = left + 0.5 * width;
        let below = frames[frames.len() - 1].bottom();
        figure.text("rotation cycle", [middle, top - 13.0], Font::LABEL, Align::Centre, 0.0);
        figure.text(&clock.label, [middle, below + 19.0], Font::LABEL, Align::Centre, 0.0);
        let mut legend = legend(&self.moments);
        if !self.events.is_empty() {
            legend.add(Key::Point(EVENT.0, EVENT.2), "outlier");
        }
        if self.folds() {
            legend.add(Key::Line(ORBIT), self.orbit_is);
            let beside =
                |frame: Rect| Rect { left: left + width + 44.0, width: figure.width - left - width - 52.0, ..frame };
            let above = beside(Rect { top: frames[0].top, height: frames[1].bottom() - frames[0].top, ..frames[0] });
            let below = beside(frames[2]);
            self.fold(&mut figure, [above, below], unit);
        }
        legend.row(&mut figure, [middle, 7.0]);
        figure
    }

    /// The velocities of row `k` in one stretch of time.
    fn draw_part(
        &self,
        figure: &mut Figure,
        (panel, part, clock): (&Panel, &Stretch, &Clock),
        k: usize,
        (series, unit): (&[&Series], Speeds),
    ) {
        match k {
            1 if self.folds() => {
                let steps = 600;
                let [first, last] = part.range_d;
                let time = |i: i32| first + (last - first) * f64::from(i) / f64::from(steps);
                let rv = |time: f64| self.vsys_kms + self.motion.velocity_kms(self.cycle_at(time));
                let curve: Vec<[f64; 2]> =
                    (0..=steps).map(time).map(|time| [time - clock.zero_d, unit.factor * rv(time)]).collect();
                panel.line(figure, "orbit", &curve, ORBIT);
            }
            1 => panel.horizontal(figure, "zero", unit.factor * self.vsys_kms, Stroke::new(GREY, 0.6).dashed()),
            k if k > 1 => panel.horizontal(figure, "zero", 0.0, Stroke::new(GREY, 0.6).dashed()),
            _ => {}
        }
        let inside: Vec<usize> = (0..self.time_d.len()).filter(|k| part.holds(self.time_d[*k])).collect();
        let times: Vec<f64> = inside.iter().map(|k| self.time_d[*k] - clock.zero_d).collect();
        series.iter().for_each(|one| one.only(&inside).draw(figure, panel, &times, unit));
        let here: Vec<usize> = self.events.iter().copied().filter(|event| inside.contains(event)).collect();
        let times: Vec<f64> = here.iter().map(|k| self.time_d[*k] - clock.zero_d).collect();
        series[0].only(&here).ring(figure, panel, &times, unit);
    }

    /// The description of the rings in the caption.
    fn of_events(&self) -> &'static str {
        match self.events.is_empty() {
            true => "",
            false => {
                " Rings: profiles that the others do not predict (flares, cosmic rays); their errors are enlarged."
            }
        }
    }

    /// Rotation cycle at a time (d).
    fn cycle_at(&self, time_d: f64) -> f64 {
        let (first_d, first) = (self.time_d.first().copied(), self.cycle.first().copied());
        first.unwrap_or(0.0) + (time_d - first_d.unwrap_or(0.0)) / self.rotation_period_d
    }

    /// The axis of rotation cycles over a stretch of time.
    fn cycles(&self, part: &Stretch) -> Axis {
        Axis::linear("", part.range_d.map(|time| self.cycle_at(time)))
    }

    /// Velocities without spots, and their residuals from the orbit, as functions of orbital phase.
    fn fold(&self, figure: &mut Figure, [above, below]: [Rect; 2], unit: Speeds) {
        let Motion { first, second } = self.motion;
        let Orbit { k_kms, porb_over_prot, phi } = first.orbit;
        let phase = |cycle: &f64| (cycle / porb_over_prot - phi).rem_euclid(1.0);
        let phases: Vec<f64> = self.cycle.iter().map(phase).collect();
        let others = |cycle: &f64| second.map_or(0.0, |second| second.velocity_kms(*cycle));
        let others: Vec<f64> = self.cycle.iter().map(others).collect();
        let x = Axis::linear("orbital phase (0: maximal RV)", [0.0, 1.0]);
        let alone = self.clean.less(&others);
        let panel =
            Panel { frame: above, x: x.clone(), y: unit.axis("spot-corrected RV", range(&[&alone], self.vsys_kms)) };
        // relative to the largest velocity
        let orbit = Eccentric { orbit: Orbit { porb_over_prot: 1.0, phi: 0.0, ..first.orbit }, ..first };
        let rv = |phase: f64| unit.factor * (self.vsys_kms + orbit.velocity_kms(phase));
        let curve: Vec<[f64; 2]> = (0..=200).map(|i| f64::from(i) / 200.0).map(|t| [t, rv(t)]).collect();
        panel.line(figure, "orbit", &curve, ORBIT);
        alone.draw(figure, &panel, &phases, unit);
        let at_events: Vec<f64> = self.events.iter().map(|k| phases[*k]).collect();
        alone.only(&self.events).ring(figure, &panel, &at_events, unit);
        panel.frame(figure, Sides { below: false, left: true });
        let residuals = Panel { frame: below, x, y: unit.axis("residual", range(&[&self.residual], 0.0)) };
        residuals.horizontal(figure, "zero", 0.0, Stroke::new(GREY, 0.6).dashed());
        self.residual.draw(figure, &residuals, &phases, unit);
        self.residual.only(&self.events).ring(figure, &residuals, &at_events, unit);
        residuals.frame(figure, Sides::BOTH);
        let digits = |sigma: Option<f64>| decimals(sigma.unwrap_or(f64::NAN));
        let [k, ratio] = [speed(k_kms, self.sigma[0].unwrap_or(0.1 * k_kms)), {
            let digits = digits(self.sigma[1]);
            format!("{porb_over_prot:.digits$}")
        }];
        let days = digits(self.sigma[1].map(|sigma| sigma * self.rotation_period_d));
        let period_d = porb_over_prot * self.rotation_period_d;
        let text = format!("*K* = {k}, *P* = {period_d:.days$} d = {ratio} *P*_{{rot}}");
        let mut legend = Legend::default();
        legend.add(Key::Line(ORBIT), &text);
        legend.row(figure, [above.centre()[0], above.top - 8.0]);
    }
}

/// Margin above the highest end of an error bar and below the lowest, as a fraction of half the range: space for a
/// legend.
const MARGIN: f64 = 0.25;

/// All error bars, with the same range above and below `middle`, so that a panel shows offsets from it; above and below
/// their mean where they are all to one side of it.
fn range(series: &[&Series], middle: f64) -> [f64; 2] {
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

    /// Mean (km/s) weighted by the uncertainties, 0 if there is none.
    fn mean(&self) -> f64 {
        let weighted = self.y.iter().zip(&self.sigma).filter(|(y, sigma)| y.is_finite() && **sigma > 0.0);
        let [sum, weight] = weighted.fold([0.0, 0.0], |[sum, weight], (y, sigma)| {
            let of = sigma.powi(2).recip();
            [sum + of * y, weight + of]
        });
        if weight > 0.0 { sum / weight } else { 0.0 }
    }

    /// A subset of them.
    fn only(&self, these: &[usize]) -> Series<'a> {
        let of = |all: &[f64]| these.iter().filter_map(|k| all.get(*k).copied()).collect();
        Series { y: of(&self.y), sigma: of(&self.sigma), ..*self }
    }

    /// Rings around them.
    fn ring(&self, figure: &mut Figure, panel: &Panel, x: &[f64], unit: Speeds) {
        let points: Vec<[f64; 2]> = x.iter().zip(&self.y).map(|(x, y)| [*x, unit.factor * y]).collect();
        panel.points(figure, "event", &points, EVENT);
    }

    fn draw(&self, figure: &mut Figure, panel: &Panel, x: &[f64], unit: Speeds) {
        let y: Vec<f64> = self.y.iter().map(|y| unit.factor * y).collect();
        for ((x, y), sigma) in x.iter().zip(&y).zip(&self.sigma) {
            let sigma = unit.factor * sigma;
            panel.bar(figure, "error-bar", [[*x, y - sigma], [*x, y + sigma]], 0.0, Stroke::new(GREY, 0.6));
        }
        let points: Vec<[f64; 2]> = x.iter().zip(&y).map(|(x, y)| [*x, *y]).collect();
        panel.points(figure, self.class, &points, self.marker);
    }
}
