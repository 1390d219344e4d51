//! The detection map: the fraction of the orbits of each period and semi-amplitude that a blind search recovers.

use super::{POSITIVE, PlotError};
use crate::data::io::csv::Columns;
use crate::figures::drawing::colour::{BLUE, ColourMap, GREY, SKY, VERMILION, WHITE};
use crate::figures::drawing::panel::{Marker, Shade, Sides, Tile};
use crate::figures::drawing::{Align, Axis, Figure, Font, Key, Legend, PAGE_MM, Paint, Panel, Rect, Stroke, width_pt};
use crate::planets::speeds::Speeds;
use crate::planets::verdict::speed;
use crate::runs::limits::{Comparison, JSON, Limit, LimitsFile};
use crate::runs::origin;
use std::path::Path;

/// The table with the fractions.
const TABLE: &str = "limits.csv";

/// The figures.
pub(super) fn figures(folder: &Path) -> Result<Vec<Figure>, PlotError> {
    let file: LimitsFile = origin::read(folder, JSON)?;
    let table = Columns::read(&folder.join(TABLE))?;
    let tried = file.limits.len() * file.k_kms.len();
    table.check_rows(tried, &format!("periods times semi-amplitudes, by {JSON}"))?;
    Ok(vec![figure(&file, &table)?])
}

fn figure(file: &LimitsFile, table: &Columns) -> Result<Figure, PlotError> {
    let (period, k) = (table.column_within("period_d", POSITIVE)?, table.column_within("k_kms", POSITIVE)?);
    let (phases, recovered) = (table.column("phases")?, table.column("recovered")?);
    let mut figure = Figure::new("limits", PAGE_MM, 92.0);
    figure.caption = CAPTION.into();
    let (left, top) = (40.0, 24.0);
    let frame = Rect { left, top, width: figure.width - left - 56.0, height: figure.height - top - 46.0 };
    // the range includes a detected planet
    let found = found(file);
    let edges = |values: &[f64], also: Option<f64>| {
        let also = also.filter(|x| *x > 0.0);
        [below(values).min(also.map_or(f64::INFINITY, |x| x / 1.3)), above(values).max(also.map_or(0.0, |x| 1.3 * x))]
    };
    let unit = Speeds::of(k);
    let k: Vec<f64> = k.iter().map(|k| unit.factor * k).collect();
    let place = found.map(|found| [found.period_d, unit.factor * found.k_kms.unwrap_or(f64::NAN)]);
    let panel = Panel {
        frame,
        x: Axis::log("period (d)", edges(period, place.map(|place| place[0]))),
        y: Axis::log(&format!("*K* ({})", unit.name), edges(&k, place.map(|place| place[1]))),
    };
    let shade = Shade { map: ColourMap::Cividis, low: 0.0, high: 100.0 };
    let (across, up) = (half_step(period), half_step(&k));
    let tile = |j: usize| Tile {
        x: [period[j] / across, period[j] * across],
        y: [k[j] / up, k[j] * up],
        value: 100.0 * recovered[j] / phases[j],
    };
    panel.tiles(&mut figure, (0..period.len()).map(tile), shade);
    let curve = |of: fn(&Limit) -> Option<f64>| -> Vec<[f64; 2]> {
        file.limits.iter().map(|limit| [limit.period_d, unit.factor * of(limit).unwrap_or(f64::NAN)]).collect()
    };
    let (half, nearly_all) = (Stroke::new(WHITE, 1.2).dashed(), Stroke::new(VERMILION, 1.2));
    panel.line(&mut figure, "k50", &curve(|limit| limit.k50_kms), half);
    panel.line(&mut figure, "k95", &curve(|limit| limit.k95_kms), nearly_all);
    let rotation = file.limits.first().map_or(f64::NAN, |limit| limit.period_d / limit.porb_over_prot);
    for (n, text) in [(1.0, "*P*_{rot}"), (2.0, "*P*_{rot}/2"), (3.0, "*P*_{rot}/3"), (4.0, "*P*_{rot}/4")] {
        let period = rotation / n;
        if (0.0..=1.0).contains(&panel.x.share(period)) {
            panel.vertical(&mut figure, "rotation", period, Stroke::new(GREY, 0.7).dotted());
            let at = [panel.place(period, 1.0)[0], frame.top - 4.0];
            figure.text(text, at, Font::SMALL, Align::Centre, 0.0);
        }
    }
    let whole = |found: bool| -> Vec<[f64; 2]> {
        let of = |c: &&Comparison| c.full.as_ref().is_some_and(|full| full.recovered) == found;
        file.comparisons
            .iter()
            .filter(of)
            .map(|c| [c.orbit.porb_over_prot * rotation, unit.factor * c.orbit.k_kms])
            .collect()
    };
    panel.points(&mut figure, "recovered", &whole(true), (Marker::Disc, 4.0, VERMILION));
    panel.points(&mut figure, "missed", &whole(false), (Marker::Cross, 4.5, VERMILION));
    if let (Some(found), Some([x, y])) = (found, place) {
        let pen = Stroke::new(SKY, 1.0).dashed();
        panel.vertical(&mut figure, "planet", x, pen);
        for (size, colour) in [(8.5, WHITE), (6.5, BLUE)] {
            panel.points(&mut figure, "planet", &[[x, y]], (Marker::Diamond, size, colour));
        }
        let text = format!("{}: {}", if found.was_removed { "removed" } else { "highest peak" }, found.words());
        let [x, y] = [panel.place(x, 1.0)[0], frame.top + 9.0];
        let width = width_pt(&text, Font::SMALL.size);
        // on the side with more space
        let left = if x > frame.centre()[0] { x - 5.0 - width } else { x + 5.0 };
        let ground = Rect { left: left - 2.0, top: y - 7.5, width: width + 4.0, height: 10.0 };
        figure.rect("label-ground", ground, Paint::fill(WHITE.opacity(0.85)));
        figure.text(&text, [left, y], Font::SMALL.coloured(BLUE), Align::Left, 0.0);
    }
    panel.frame(&mut figure, Sides::BOTH);
    shade.upright_bar(&mut figure, frame, "recovered (% of the phases)");
    let mut legend = Legend::default();
    legend.add(Key::Line(Stroke { colour: GREY, ..half }), "50 %");
    legend.add(Key::Line(nearly_all), "95 %");
    if !file.comparisons.is_empty() {
        legend.add(Key::Point(Marker::Disc, VERMILION), "full pipeline: recovered");
        legend.add(Key::Point(Marker::Cross, VERMILION), "missed");
    }
    legend.row(&mut figure, [frame.centre()[0], frame.bottom() + 36.0]);
    Ok(figure)
}

/// The planet in the original profiles.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Found {
    period_d: f64,
    /// Semi-amplitude (km/s), if the file contains it.
    k_kms: Option<f64>,
    /// Whether it was removed before orbits were injected.
    was_removed: bool,
}

impl Found {
    fn words(&self) -> String {
        let k = self.k_kms.map_or(String::new(), |k| format!(", *K* = {}", speed(k, 0.1 * k)));
        format!("*P* = {:.2} d{k}", self.period_d)
    }
}

/// The removed orbit, or the peak of the original profiles if it is significant.
fn found(file: &LimitsFile) -> Option<Found> {
    match &file.removed {
        Some(orbit) => {
            let period_d = orbit.porb_over_prot * file.rotation_period_d();
            Some(Found { period_d, k_kms: Some(orbit.k_kms.abs()), was_removed: true })
        }
        None => (file.before.false_alarm_probability < file.false_alarm_probability).then_some(Found {
            period_d: file.before.period_d,
            k_kms: None,
            was_removed: false,
        }),
    }
}

/// Half the distance of neighbours on a logarithmic axis, as a factor; for one value alone some per cent.
fn half_step(values: &[f64]) -> f64 {
    let mut sorted: Vec<f64> = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    sorted.dedup();
    let (first, last) = (sorted.first().copied().unwrap_or(1.0), sorted.last().copied().unwrap_or(1.0));
    if sorted.len() < 2 { 1.05 } else { (last / first).powf(0.5 / (sorted.len() - 1) as f64) }
}

fn below(values: &[f64]) -> f64 {
    values.iter().copied().fold(f64::INFINITY, f64::min) / half_step(values)
}

fn above(values: &[f64]) -> f64 {
    values.iter().copied().fold(f64::NEG_INFINITY, f64::max) * half_step(values)
}

const CAPTION: &str = "Detection limits. Colour: share of the phases at which an orbit of that period and \
semi-amplitude K, injected into the profiles, is recovered: the blind search finds its period with FAP < 1 %. Lines: K \
recovered at 50 and 95 % of the phases. Diamond: detected signal, subtracted before the injections. Points: orbits \
recovered or missed by the full pipeline, with resampled profiles. Dotted: the rotation period and its fractions.";
