//! The periodogram: how much better the data fit with an orbit of each period, what chance does, what the times of observation
//! alone do, and how well K is known.

use super::{POSITIVE, PlotError, velocities};
use crate::figure::colour::{BLACK, BLUE, GREEN, GREY, VERMILION, WHITE};
use crate::figure::panel::Sides;
use crate::figure::{Align, Axis, Figure, Font, Key, Legend, PAGE_MM, Paint, Panel, Rect, Scale, Stroke, range_of};
use crate::io::csv::Columns;
use crate::origin;
use crate::star::Orbit;
use serde::Deserialize;
use std::collections::BTreeMap;
use std::path::Path;

/// The file.
pub(super) const FILE: &str = "periodogram.json";

/// What is used of it.
#[derive(Deserialize)]
struct SearchFile {
    best: OrbitFile,
    truth: Option<BTreeMap<String, f64>>,
    false_alarm: FalseAlarm,
    peaks: Vec<OrbitFile>,
    search: SearchedFile,
    offset: Option<Offset>,
    second: Option<Second>,
}

#[derive(Deserialize)]
struct SearchedFile {
    periods: usize,
}

/// A search for a second planet, the first one's period kept.
#[derive(Deserialize)]
struct Second {
    false_alarm: FalseAlarm,
    peaks: Vec<OrbitFile>,
}

/// What is marked in a periodogram.
struct Marks<'a> {
    levels: &'a [Level],
    peak: Option<&'a OrbitFile>,
    /// The period that is written at the peak (d).
    period_d: f64,
    /// Injected period over rotation period.
    truth: Option<f64>,
}

#[derive(Deserialize)]
struct OrbitFile {
    k_kms: f64,
    period_d: f64,
    porb_over_prot: f64,
    phi: f64,
    delta_ln_l: f64,
}

#[derive(Deserialize)]
struct FalseAlarm {
    levels: Vec<Level>,
}

#[derive(Deserialize)]
struct Level {
    false_alarm_probability: f64,
    delta_ln_l: f64,
}

#[derive(Deserialize)]
struct Offset {
    velocity_kms: f64,
}

/// Tables of a first and a second planet, with the names of their figures.
const TABLES: [(&str, &str); 2] = [("periodogram.csv", "periodogram"), ("periodogram_2.csv", "periodogram_2")];

/// The figures.
pub(super) fn figures(folder: &Path) -> Result<Vec<Figure>, PlotError> {
    let file: SearchFile = origin::read(folder, FILE)?;
    let mut figures = Vec::new();
    let injected = file.truth.as_ref().filter(|truth| truth.get("k_kms").is_some_and(|k| *k > 0.0));
    let first = Marks {
        levels: &file.false_alarm.levels,
        peak: file.peaks.first(),
        period_d: file.best.period_d,
        truth: injected.and_then(|truth| truth.get("porb_over_prot")).copied(),
    };
    figures.push(figure(TABLES[0].1, &table(folder, TABLES[0].0, &file)?, &first)?);
    if let Some(second) = &file.second {
        let peak = second.peaks.first();
        let period_d = peak.map_or(f64::NAN, |peak| peak.period_d);
        let marks = Marks { levels: &second.false_alarm.levels, peak, period_d, truth: None };
        let mut beside = figure(TABLES[1].1, &table(folder, TABLES[1].0, &file)?, &marks)?;
        beside.caption.insert_str(0, "A second planet beside the best orbit. ");
        figures.push(beside);
    }
    if folder.join(velocities::FILE).is_file() {
        let OrbitFile { k_kms, porb_over_prot, phi, .. } = file.best;
        let offset = file.offset.as_ref().map_or(0.0, |offset| offset.velocity_kms);
        figures.push(velocities::of_search(folder, Orbit { k_kms, porb_over_prot, phi }, offset)?);
    }
    Ok(figures)
}

/// A table of the periods searched.
fn table(folder: &Path, name: &str, file: &SearchFile) -> Result<Columns, PlotError> {
    let table = Columns::read(&folder.join(name))?;
    table.check_rows(file.search.periods, &format!("the periods searched, by {FILE}"))?;
    Ok(table)
}

/// The figure of a table.
fn figure(name: &str, table: &Columns, found: &Marks) -> Result<Figure, PlotError> {
    let period = table.column_within("period_d", POSITIVE)?;
    let ratio = table.column_within("porb_over_prot", POSITIVE)?;
    let mut figure = Figure::new(name, PAGE_MM, 128.0);
    figure.caption = CAPTION.into();
    let (left, right, top, gap, bottom) = (40.0, 58.0, 24.0, 5.0, 28.0);
    let width = figure.width - left - right;
    let room = figure.height - top - bottom - 2.0 * gap;
    let range = range_of(period.iter().copied(), Scale::Log, 0.0);
    let frame =
        |above: f64, share: f64, k: f64| Rect { left, top: top + above * room + k * gap, width, height: share * room };
    let frames = [frame(0.0, 0.5, 0.0), frame(0.5, 0.17, 1.0), frame(0.67, 0.33, 2.0)];
    let curve = |column: &str| -> Result<Vec<[f64; 2]>, PlotError> {
        Ok(period.iter().zip(table.column(column)?).map(|(p, y)| [*p, *y]).collect())
    };

    let likelihood = curve("delta_ln_l")?;
    let levels = found.levels;
    let highest = likelihood.iter().map(|p| p[1]).chain(levels.iter().map(|l| l.delta_ln_l)).fold(1.0, f64::max);
    let x = Axis::log("period (d)", range);
    let above = Panel { frame: frames[0], x: x.clone(), y: Axis::linear("Δ ln *L*", [0.0, 1.15 * highest]) };
    let rotation = period.first().zip(ratio.first()).map(|(p, r)| p / r).unwrap_or(f64::NAN);
    false_alarms(&mut figure, &above, levels);
    above.line(&mut figure, "delta-ln-l", &likelihood, Stroke::new(BLACK, 0.9));

    let window = Panel { frame: frames[1], x: x.clone(), y: Axis::linear("window", [0.0, 1.05]) };
    window.line(&mut figure, "window", &curve("window")?, Stroke::new(BLACK, 0.9));

    let (sigma, upper, fitted) = (curve("sigma_k_kms")?, curve("k_upper95_kms")?, curve("k_kms")?);
    let all = sigma.iter().chain(&upper).map(|p| p[1]);
    let amplitude = Panel { frame: frames[2], x, y: Axis::log("*K* (km/s)", range_of(all, Scale::Log, 0.08)) };
    let [sigma_pen, upper_pen] = [Stroke::new(BLUE, 1.0), Stroke::new(BLACK, 0.9).dashed()];
    let fitted_pen = Stroke::new(GREEN, 0.8).dotted();
    amplitude.line(&mut figure, "k", &fitted, fitted_pen);
    amplitude.line(&mut figure, "sigma-k", &sigma, sigma_pen);
    amplitude.line(&mut figure, "k-upper", &upper, upper_pen);

    let panels = [&above, &window, &amplitude];
    marks(&mut figure, panels, rotation, found);
    for (k, panel) in panels.into_iter().enumerate() {
        panel.frame(&mut figure, Sides { below: k == 2, left: true });
    }
    let mut legend = Legend::default();
    legend.add(Key::Line(fitted_pen), "best *K*");
    legend.add(Key::Line(sigma_pen), "*σ*_{K}");
    legend.add(Key::Line(upper_pen), "95 % limit");
    let beside = Rect { left: frames[2].right() - 2.0, width: right, ..frames[2] };
    legend.draw(&mut figure, beside, [0.0, 0.0]);
    Ok(figure)
}

/// Lines that chance exceeds once in so many times, with their shares beside the panel, none over another.
fn false_alarms(figure: &mut Figure, panel: &Panel, levels: &[Level]) {
    let right = panel.frame.right() + 4.0;
    let mut lowest = f64::NEG_INFINITY;
    let mut falling: Vec<&Level> = levels.iter().collect();
    falling.sort_by(|a, b| b.delta_ln_l.total_cmp(&a.delta_ln_l));
    for level in falling {
        panel.horizontal(figure, "false-alarm", level.delta_ln_l, Stroke::new(GREY, 0.7).dashed());
        lowest = (panel.place(1.0, level.delta_ln_l)[1] + 2.5).max(lowest + 8.0);
        let text = format!("{} %", 100.0 * level.false_alarm_probability);
        figure.text(&text, [right, lowest], Font::SMALL, Align::Left, 0.0);
    }
    if !levels.is_empty() {
        figure.text("false alarms", [right, lowest + 8.5], Font { size: 6.0, ..Font::SMALL }, Align::Left, 0.0);
    }
}

/// Rotation period and its fractions, the peaks, and the injected period.
fn marks(figure: &mut Figure, panels: [&Panel; 3], rotation: f64, found: &Marks) {
    let above = panels[0];
    let inside = |period: f64| {
        let share = above.x.share(period);
        (0.0..=1.0).contains(&share)
    };
    for (n, text) in [(1.0, "*P*_{rot}"), (2.0, "*P*_{rot}/2"), (3.0, "*P*_{rot}/3"), (4.0, "*P*_{rot}/4")] {
        let period = rotation / n;
        if inside(period) {
            for panel in panels {
                panel.vertical(figure, "rotation", period, Stroke::new(GREY, 0.7).dotted());
            }
            let at = [above.place(period, 0.0)[0], above.frame.top - 4.0];
            figure.text(text, at, Font::SMALL, Align::Centre, 0.0);
        }
    }
    if let Some(best) = found.peak {
        let [x, y] = above.place(best.period_d, best.delta_ln_l);
        // beside the peak, where the panel has room
        let (side, align) = if x > above.frame.centre()[0] { (-1.0, Align::Right) } else { (1.0, Align::Left) };
        figure.polyline("best", &[[x + 3.0 * side, y - 6.0], [x + 13.0 * side, y - 6.0]], Stroke::new(BLUE, 0.8));
        let text = format!("best: {:.3} d", found.period_d);
        let width = crate::figure::width_pt(&text, Font::SMALL.size);
        let left = if side < 0.0 { x - 16.0 - width } else { x + 14.0 };
        let ground = Rect { left, top: y - 10.5, width: width + 2.0, height: 9.0 };
        figure.rect("label-ground", ground, Paint::fill(WHITE));
        figure.text(&text, [x + 15.0 * side, y - 3.5], Font::SMALL.coloured(BLUE), align, 0.0);
    }
    if let Some(truth) = found.truth.filter(|truth| inside(truth * rotation)) {
        for panel in panels {
            panel.vertical(figure, "truth", truth * rotation, Stroke::new(VERMILION, 0.8).dashed());
        }
        let at = [above.place(truth * rotation, 0.0)[0], above.frame.top - 13.0];
        figure.text("injected", at, Font::SMALL.coloured(VERMILION), Align::Centre, 0.0);
    }
}

const CAPTION: &str = "Periodogram. Above: gain in ln L by an orbit of each period, spots marginalised out; dashed: what chance \
                       exceeds in so many searches of stars without a planet. Middle: window function of the times. Below: best \
                       K, its standard error and its upper limit. Dotted lines: the rotation period and its fractions.";
