//! The periodogram: the improvement of the fit by an orbit of each period, the false-alarm levels, the window function,
//! and the uncertainty of K.

use super::symbols::{PERIOD_DIGITS, decimals};
use super::{POSITIVE, PlotError, velocities};
use crate::data::io::csv::Columns;
use crate::figures::drawing::colour::{BLACK, BLUE, GREEN, GREY, PURPLE, VERMILION, WHITE};
use crate::figures::drawing::panel::Sides;
use crate::figures::drawing::{
    Align, Axis, Colour, Figure, Font, Key, Legend, Marker, PAGE_MM, Paint, Panel, Rect, Scale, Stroke, range_of,
    width_pt,
};
use crate::model::Parameter;
use crate::planets::speeds::Speeds;
use crate::runs::blind_search::{FILE, LevelRecord, OrbitRecord, PeakRecord, PeriodogramFile};
use crate::runs::origin;
use std::path::Path;

/// The marks in a periodogram.
struct Marks<'a> {
    levels: &'a [LevelRecord],
    /// From high to low.
    peaks: &'a [PeakRecord],
    /// Injected period over rotation period.
    truth: Option<f64>,
}

/// Tables of a first and a second planet, with the names of their figures.
const TABLES: [(&str, &str); 2] = [("periodogram.csv", "periodogram"), ("periodogram_2.csv", "periodogram_2")];

/// The figures.
pub(super) fn figures(folder: &Path) -> Result<Vec<Figure>, PlotError> {
    let file: PeriodogramFile = origin::read(folder, FILE)?;
    let mut figures = Vec::new();
    let injected = file.truth.filter(|truth| truth[Parameter::K] > 0.0);
    let first = Marks {
        levels: &file.false_alarm.levels,
        peaks: &file.peaks,
        truth: injected.map(|truth| truth[Parameter::PorbOverProt]),
    };
    figures.push(figure(TABLES[0].1, &table(folder, TABLES[0].0, &file)?, &first)?);
    if let Some(second) = &file.second {
        let marks = Marks { levels: &second.false_alarm.levels, peaks: &second.peaks, truth: None };
        let mut beside = figure(TABLES[1].1, &table(folder, TABLES[1].0, &file)?, &marks)?;
        beside.caption.insert_str(0, "A second planet beside the best orbit. ");
        figures.push(beside);
    }
    if folder.join(velocities::FILE).is_file() {
        figures.push(velocities::of_search(folder, &file)?);
    }
    Ok(figures)
}

/// A table of the searched periods.
fn table(folder: &Path, name: &str, file: &PeriodogramFile) -> Result<Columns, PlotError> {
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
    let (left, right, top, gap, bottom) = (40.0, 58.0, 28.0, 8.0, 28.0);
    let width = figure.width - left - right;
    let room = figure.height - top - bottom - 2.0 * gap;
    let range = range_of(period.iter().copied(), Scale::Log, 0.0);
    let frame =
        |above: f64, share: f64, k: f64| Rect { left, top: top + above * room + k * gap, width, height: share * room };
    let frames = [frame(0.0, 0.5, 0.0), frame(0.5, 0.17, 1.0), frame(0.67, 0.33, 2.0)];
    let curve = |column: &str| -> Result<Vec<[f64; 2]>, PlotError> {
        Ok(period.iter().zip(table.column(column)?).map(|(p, y)| [*p, *y]).collect())
    };

    let likelihood = with_peaks(curve("delta_ln_l")?, found.peaks);
    let levels = found.levels;
    let highest = likelihood.iter().map(|p| p[1]).chain(levels.iter().map(|l| l.delta_ln_l)).fold(1.0, f64::max);
    let x = Axis::log("period (d)", range);
    let above = Panel { frame: frames[0], x: x.clone(), y: Axis::linear("Δ ln *L*", [0.0, 1.15 * highest]) };
    let rotation = period.first().zip(ratio.first()).map(|(p, r)| p / r).unwrap_or(f64::NAN);
    false_alarms(&mut figure, &above, levels);
    above.smooth_line(&mut figure, "delta-ln-l", &likelihood, Stroke::new(BLACK, 0.9));

    let window = Panel { frame: frames[1], x: x.clone(), y: Axis::linear("window", [0.0, 1.05]) };
    window.smooth_line(&mut figure, "window", &curve("window")?, Stroke::new(BLACK, 0.9));

    let unit = Speeds::of(table.column("k_upper95_kms")?);
    let speeds = |column: &str| -> Result<Vec<[f64; 2]>, PlotError> {
        Ok(curve(column)?.into_iter().map(|[period, kms]| [period, unit.factor * kms]).collect())
    };
    let (sigma, upper, fitted) = (speeds("sigma_k_kms")?, speeds("k_upper95_kms")?, speeds("k_kms")?);
    let all = sigma.iter().chain(&upper).map(|p| p[1]);
    let label = format!("*K* ({})", unit.name);
    let amplitude = Panel { frame: frames[2], x, y: Axis::log(&label, range_of(all, Scale::Log, 0.08)) };
    let [sigma_pen, upper_pen] = [Stroke::new(BLUE, 1.0), Stroke::new(BLACK, 0.9).dashed()];
    let fitted_pen = Stroke::new(GREEN, 0.8).dotted();
    amplitude.smooth_line(&mut figure, "k", &fitted, fitted_pen);
    amplitude.smooth_line(&mut figure, "sigma-k", &sigma, sigma_pen);
    amplitude.smooth_line(&mut figure, "k-upper", &upper, upper_pen);

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

/// The curve through its trial periods and, between them, the peaks, which are known more precisely.
fn with_peaks(mut curve: Vec<[f64; 2]>, peaks: &[PeakRecord]) -> Vec<[f64; 2]> {
    for peak in peaks {
        let at = [peak.orbit.period_d, peak.orbit.delta_ln_l];
        let inside = |pair: &[[f64; 2]]| (at[0] - pair[0][0]) * (at[0] - pair[1][0]) < 0.0;
        if let Some(k) = curve.windows(2).position(inside) {
            // a point below the curve is none of its peaks
            if curve[k][1] <= at[1] && curve[k + 1][1] <= at[1] {
                curve.insert(k + 1, at);
            }
        }
    }
    curve
}

/// Lines of false-alarm probabilities, with their values beside the panel, without overlap.
fn false_alarms(figure: &mut Figure, panel: &Panel, levels: &[LevelRecord]) {
    let right = panel.frame.right() + 4.0;
    let mut lowest = f64::NEG_INFINITY;
    let mut falling: Vec<&LevelRecord> = levels.iter().collect();
    falling.sort_by(|a, b| b.delta_ln_l.total_cmp(&a.delta_ln_l));
    for level in falling {
        panel.horizontal(figure, "false-alarm", level.delta_ln_l, Stroke::new(GREY, 0.7).dashed());
        lowest = (panel.place(1.0, level.delta_ln_l)[1] + 2.5).max(lowest + 8.0);
        let text = format!("{} %", 100.0 * level.false_alarm_probability);
        figure.text(&text, [right, lowest], Font::SMALL, Align::Left, 0.0);
    }
    if !levels.is_empty() {
        figure.text("FAP", [right, lowest + 8.5], Font { size: 6.0, ..Font::SMALL }, Align::Left, 0.0);
    }
}

/// A period that is marked through all panels.
struct Mark {
    class: &'static str,
    text: &'static str,
    period_d: f64,
    pen: Stroke,
    colour: Colour,
}

/// The marked periods: the day, the rotation period and its fractions, the injected period.
fn marked(rotation: f64, truth: Option<f64>) -> Vec<Mark> {
    let fractions = [(1.0, "*P*_{rot}"), (2.0, "*P*_{rot}/2"), (3.0, "*P*_{rot}/3"), (4.0, "*P*_{rot}/4")];
    let grey = Stroke::new(GREY, 0.7).dotted();
    let rotation = |(n, text)| Mark { class: "rotation", text, period_d: rotation / n, pen: grey, colour: BLACK };
    let day = Mark { class: "day", text: "1 d", period_d: 1.0, pen: Stroke::new(PURPLE, 0.9).dotted(), colour: PURPLE };
    let injected = truth.map(|period_d| Mark {
        class: "truth",
        text: "injected",
        period_d,
        pen: Stroke::new(VERMILION, 0.8).dashed(),
        colour: VERMILION,
    });
    fractions.map(rotation).into_iter().chain([day]).chain(injected).collect()
}

/// Marked periods, their texts above the panels in the lowest line with space, and the highest peak.
fn marks(figure: &mut Figure, panels: [&Panel; 3], rotation: f64, found: &Marks) {
    let above = panels[0];
    // occupied ranges of each line
    let mut lines: Vec<Vec<[f64; 2]>> = Vec::new();
    for mark in marked(rotation, found.truth.map(|truth| truth * rotation)) {
        if !(0.0..=1.0).contains(&above.x.share(mark.period_d)) {
            continue;
        }
        for panel in panels {
            panel.vertical(figure, mark.class, mark.period_d, mark.pen);
        }
        let x = above.place(mark.period_d, 0.0)[0];
        let half = 0.5 * width_pt(mark.text, Font::SMALL.size) + 1.5;
        let is_free = |line: &Vec<[f64; 2]>| line.iter().all(|[from, to]| x + half <= *from || x - half >= *to);
        let line = lines.iter().position(is_free).unwrap_or(lines.len());
        lines.resize(lines.len().max(line + 1), Vec::new());
        lines[line].push([x - half, x + half]);
        let at = [x, above.frame.top - 4.0 - 8.0 * line as f64];
        figure.text(mark.text, at, Font::SMALL.coloured(mark.colour), Align::Centre, 0.0);
    }
    if let Some(peak) = found.peaks.first() {
        highest(figure, above, &peak.orbit);
    }
}

/// A marker on the highest peak, with its period beside it.
fn highest(figure: &mut Figure, panel: &Panel, peak: &OrbitRecord) {
    let digits = peak.sigma_period_d.map_or(PERIOD_DIGITS, decimals);
    let text = format!("highest: {:.digits$} d", peak.period_d);
    let [x, y] = panel.place(peak.period_d, peak.delta_ln_l);
    panel.points(figure, "highest", &[[peak.period_d, peak.delta_ln_l]], (Marker::Disc, 3.6, BLUE));
    let width = width_pt(&text, Font::SMALL.size);
    // beside the peak, where the panel has space
    let left = if x > panel.frame.centre()[0] { x - 6.0 - width } else { x + 6.0 };
    let ground = Rect { left: left - 1.0, top: y - 10.5, width: width + 2.0, height: 9.0 };
    figure.rect("label-ground", ground, Paint::fill(WHITE));
    figure.text(&text, [left, y - 3.5], Font::SMALL.coloured(BLUE), Align::Left, 0.0);
}

const CAPTION: &str = "Periodogram. Top: gain in ln L by a circular orbit of each period, spots marginalised out; \
dashed: thresholds at which planet-free simulations reach the given FAP. Middle: window function of the times. Bottom: \
best K, its uncertainty and its 95 % upper limit. Dotted lines: the rotation period and its fractions, and one day.";
