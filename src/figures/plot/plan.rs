//! A plan for a proposal: the uncertainty of K, and the K that is detected, at every period, and the decrease of both
//! from night to night; several schedules side by side in their colours.

use super::{POSITIVE, PlotError};
use crate::data::io::csv::Columns;
use crate::figures::drawing::colour::{GREY, SERIES};
use crate::figures::drawing::panel::{Marker, Sides};
use crate::figures::drawing::{
    Align, Axis, Colour, Figure, Font, Key, Legend, PAGE_MM, Panel, Rect, Scale, Stroke, range_of,
};
use crate::planets::speeds::Speeds;
use crate::runs::origin;
use crate::runs::plan::{AfterRecord, Aim, CSV, Choice, JSON, Merit, PlanFile};
use std::path::Path;

/// The figures.
pub(super) fn figures(folder: &Path) -> Result<Vec<Figure>, PlotError> {
    let file: PlanFile = origin::read(folder, JSON)?;
    let table = Columns::read(&folder.join(CSV))?;
    let next = file.best().next.as_ref().map(next);
    Ok(std::iter::once(figure(&file, &table)?).chain(next).collect())
}

/// The standard error of K as a function of the number of nights: the chosen nights, evenly spaced ones, random ones.
fn next(choice: &Choice) -> Figure {
    let mut figure = Figure::new("plan_next", 0.62 * PAGE_MM, 74.0);
    let now = Some((0.0, choice.now.sigma_k_kms));
    let chosen = choice.chosen.iter().enumerate().map(|(k, night)| ((k + 1) as f64, night.sigma_k_kms));
    let merits = |of: &[Merit]| of.iter().map(|merit| (merit.nights as f64, merit.sigma_k_kms)).collect::<Vec<_>>();
    let curves = [("chosen", chosen.collect()), ("even", merits(&choice.even)), ("random", merits(&choice.random))];
    let points = |curve: &[(f64, Option<f64>)]| -> Vec<[f64; 2]> {
        let bounded = |(nights, sigma): (f64, Option<f64>)| Some([nights, 1000.0 * sigma?]);
        now.into_iter().chain(curve.iter().copied()).filter_map(bounded).collect()
    };
    let curves = curves.map(|(name, curve)| (name, points(&curve)));
    let heights = range_of(curves.iter().flat_map(|(_, points)| points).map(|point| point[1]), Scale::Log, 0.08);
    let nights = choice.chosen.len().max(1) as f64;
    let (left, top) = (44.0, 24.0);
    let panel = Panel {
        frame: Rect { left, top, width: figure.width - left - 12.0, height: figure.height - top - 34.0 },
        x: Axis::linear("nights", [0.0, 1.04 * nights]),
        y: Axis::log("*σ*_{K} (m/s)", heights),
    };
    let mut legend = Legend::default();
    for (k, (name, points)) in curves.iter().enumerate() {
        let stroke = if k == 0 { Stroke::new(colour(k), 1.2) } else { Stroke::new(colour(k), 0.9).dashed() };
        panel.line(&mut figure, name, points, stroke);
        panel.points(&mut figure, name, points, (Marker::Disc, 3.0, colour(k)));
        legend.add(Key::Line(stroke), name);
    }
    panel.frame(&mut figure, Sides::BOTH);
    let middle = 0.5 * figure.width;
    legend.row(&mut figure, [middle, 8.0]);
    let of = match choice.aim {
        Aim::Amplitude { period_d, .. } => format!("K of a planet of {period_d} d"),
        Aim::Alias { period_d, other_d } => {
            format!("what a planet of {period_d} d has beside an orbit of {other_d} d")
        }
    };
    figure.caption = format!(
        "Standard error of {of} against the number of coming nights, of {} that may be taken: those that are chosen, \
        evenly spaced nights, random nights (median).",
        choice.candidates
    );
    figure
}

/// The colours repeat after some number.
fn colour(schedule: usize) -> Colour {
    SERIES[schedule % SERIES.len()]
}

fn figure(file: &PlanFile, table: &Columns) -> Result<Figure, PlotError> {
    let (schedule, period) = (table.column("schedule")?, table.column_within("period_d", POSITIVE)?);
    let (sigma, k95) = (table.column("sigma_k_kms")?, table.column("k95_kms")?);
    let finite: Vec<f64> = sigma.iter().chain(k95).copied().filter(|k| k.is_finite()).collect();
    let unit = Speeds::of(&finite);
    let shown = |k: &[f64]| k.iter().map(|kms| unit.factor * kms).collect::<Vec<_>>();
    let mut figure = Figure::new("plan", PAGE_MM, 92.0);
    figure.caption = CAPTION.into();
    let (left, top, gap) = (40.0, 24.0, 44.0);
    let room = figure.width - left - gap - 12.0;
    let height = figure.height - top - 52.0;
    let periods = Rect { left, top, width: 0.62 * room, height };
    let nights = Rect { left: left + periods.width + gap, top, width: 0.38 * room, height };
    let heights = range_of(shown(&finite).into_iter(), Scale::Log, 0.06);
    let above = Panel {
        frame: periods,
        x: Axis::log("period (d)", range_of(period.iter().copied(), Scale::Log, 0.0)),
        y: Axis::log(&format!("*K* ({})", unit.name), heights),
    };
    let [of_sigma, of_k95] = [|c| Stroke::new(c, 0.9).dashed(), |c| Stroke::new(c, 1.1)];
    for k in 0..file.schedules.len() {
        let of = |y: &[f64]| -> Vec<[f64; 2]> {
            (0..period.len()).filter(|j| schedule[*j] == (k + 1) as f64).map(|j| [period[j], y[j]]).collect()
        };
        above.line(&mut figure, "sigma-k", &of(&shown(sigma)), of_sigma(colour(k)));
        above.line(&mut figure, "k95", &of(&shown(k95)), of_k95(colour(k)));
    }
    rotation(&mut figure, &above, file);
    above.frame(&mut figure, Sides::BOTH);
    let most = file.schedules.iter().flat_map(|s| &s.after).map(|after| after.nights).max().unwrap_or(1);
    let beside = Panel {
        frame: nights,
        x: Axis::linear("nights", [0.0, 1.08 * most.max(1) as f64]),
        y: Axis::log(
            &format!("median *K* ({})", unit.name),
            range_of(medians(file).map(|kms| unit.factor * kms), Scale::Log, 0.08),
        ),
    };
    for (k, schedule) in file.schedules.iter().enumerate() {
        let of = |number: fn(&AfterRecord) -> Option<f64>| -> Vec<[f64; 2]> {
            let after = schedule.after.iter();
            after.map(|after| [after.nights as f64, number(after).map_or(f64::NAN, |kms| unit.factor * kms)]).collect()
        };
        for (class, points, stroke) in [
            ("sigma-k", of(|after| after.sigma_k_kms), of_sigma(colour(k))),
            ("k95", of(|after| after.k95_kms), of_k95(colour(k))),
        ] {
            beside.line(&mut figure, class, &points, stroke);
            beside.points(&mut figure, class, &points, (Marker::Disc, 3.0, colour(k)));
        }
    }
    beside.frame(&mut figure, Sides::BOTH);
    let mut legend = Legend::default();
    if file.schedules.len() == 1 {
        legend.add(Key::Line(of_sigma(colour(0))), "*σ*_{K}");
        legend.add(Key::Line(of_k95(colour(0))), "*K* detected, 95 %");
    } else {
        legend.add(Key::Line(of_sigma(GREY)), "*σ*_{K}");
        legend.add(Key::Line(of_k95(GREY)), "95 %");
        for (k, schedule) in file.schedules.iter().enumerate() {
            legend.add(Key::Line(of_k95(colour(k))), &schedule.name);
        }
    }
    let middle = 0.5 * figure.width;
    legend.row(&mut figure, [middle, periods.bottom() + 42.0]);
    Ok(figure)
}

/// All values that are drawn as functions of nights.
fn medians(file: &PlanFile) -> impl Iterator<Item = f64> {
    file.schedules.iter().flat_map(|s| &s.after).flat_map(|after| [after.sigma_k_kms, after.k95_kms]).flatten()
}

/// The rotation period of the first star and its fractions.
fn rotation(figure: &mut Figure, panel: &Panel, file: &PlanFile) {
    let Some(first) = file.schedules.first() else { return };
    for (n, text) in [(1.0, "*P*_{rot}"), (2.0, "*P*_{rot}/2"), (3.0, "*P*_{rot}/3")] {
        let period = first.rotation_period_d / n;
        if (0.0..=1.0).contains(&panel.x.share(period)) {
            panel.vertical(figure, "rotation", period, Stroke::new(GREY, 0.7).dotted());
            let at = [panel.place(period, 1.0)[0], panel.frame.top - 4.0];
            figure.text(text, at, Font::SMALL, Align::Centre, 0.0);
        }
    }
}

const CAPTION: &str = "Forecast of a campaign, marginalised over spots. Left: σ_K (dashed) and K detected with 95 % \
probability (FAP < 1 %; solid) at every period; dotted: the rotation period and its fractions. Right: medians over all \
periods against the number of nights.";
