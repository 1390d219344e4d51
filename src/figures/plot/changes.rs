//! Spot evolution: residuals of a static map in the profiles, in the order of their time, and those of an evolving map.

use super::dynamic::edges;
use super::profiles::{Line, extent};
use super::times::stretches;
use crate::figures::drawing::colour::{BLACK, ColourMap, GREY};
use crate::figures::drawing::panel::{Shade, Tile};
use crate::figures::drawing::{Align, Axis, Figure, Font, PAGE_MM, Paint, Panel, Point, Rect, Stroke, open, width_pt};

/// Profiles further apart than this (d) belong to different nights.
const NIGHT_GAP_D: f64 = 0.5;

/// Smallest and largest range of the colour scale (standard errors).
const REACH: [f64; 2] = [4.0, 20.0];

/// Height of a profile (pt), and largest total height.
const ROW: f64 = 5.0;
const HIGHEST: f64 = 560.0;

/// Smallest distance of time labels (pt).
const LABELS: f64 = 8.0;

/// The figure of profiles with both models; `None` where there is only one.
pub(super) fn figure(lines: &[Line]) -> Option<Figure> {
    if lines.iter().any(|line| line.unchanging.is_empty()) {
        return None;
    }
    let mut lines: Vec<&Line> = lines.iter().collect();
    lines.sort_by(|a, b| a.time_d.total_cmp(&b.time_d));
    let places = places(&lines.iter().map(|line| line.time_d).collect::<Vec<_>>());
    let rows = places.last().map_or(1.0, |last| last + 1.0);
    let height = (ROW * rows).clamp(100.0, HIGHEST);
    let mut figure = Figure::new("changes", PAGE_MM, 1.0);
    figure.height = height + 44.0;
    figure.caption = "Spot evolution. Left: observed profiles minus those of a static map. Right: minus those of the \
    evolving maps. In units of the uncertainty; rows are profiles in the order of time, numbers the time of the first \
    of a night."
        .into();
    type Value = fn(&Line, usize) -> f64;
    let panels: [(&str, Value); 2] = [
        ("observed − static map", |line, k| (line.observed[k] - line.unchanging[k]) / line.sigma[k]),
        ("observed − evolving maps", |line, k| (line.observed[k] - line.model[k]) / line.sigma[k]),
    ];
    let reach = reach(lines.iter().flat_map(|line| (0..line.observed.len()).map(|k| panels[0].1(line, k).abs())));
    let shade = Shade { map: ColourMap::Diverging, low: -reach, high: reach };
    let all: Vec<Line> = lines.iter().map(|line| (*line).clone()).collect();
    let velocities = extent(&all, |line| &line.velocity_kms);
    let widest = lines.iter().map(|line| width_pt(&time(line), Font::SMALL.size)).fold(0.0, f64::max);
    let (left, gap, bar) = (widest + 22.0, 14.0, 52.0);
    let width = 0.5 * (figure.width - left - gap - bar);
    for (k, (title, value)) in panels.into_iter().enumerate() {
        let frame = Rect { left: left + k as f64 * (width + gap), top: 16.0, width, height };
        let y = Axis::linear("", [rows, 0.0]);
        let panel = Panel { frame, x: Axis::linear("velocity (km/s)", velocities), y };
        let tiles = lines.iter().zip(&places).flat_map(|(line, &row)| {
            let edges = edges(&line.velocity_kms);
            (0..line.observed.len()).map(move |k| Tile {
                x: [edges[k], edges[k + 1]],
                y: [row, row + 1.0],
                value: value(line, k),
            })
        });
        figure.rect("not-observed", frame, Paint::fill(GREY.opacity(0.35)));
        panel.tiles(&mut figure, tiles, shade);
        nights(&mut figure, &panel, (&lines, &places), k == 0);
        panel.bare_y_frame(&mut figure);
        figure.text(title, [frame.centre()[0], 10.0], Font::LABEL, Align::Centre, 0.0);
        match k {
            0 => figure.text("time (d)", [10.0, frame.centre()[1]], Font::LABEL, Align::Centre, 90.0),
            _ => shade.upright_bar(&mut figure, frame, "uncertainties (σ)"),
        }
    }
    Some(figure)
}

/// Rows between seasons.
const BETWEEN_SEASONS: f64 = 3.0;

/// The row of each profile, by its time (d): consecutive, with a gap between seasons.
fn places(times_d: &[f64]) -> Vec<f64> {
    let parts = stretches(times_d.iter().copied(), 0.0, 1.0);
    let season = |time: f64| parts.iter().position(|part| part.holds(time)).unwrap_or(0);
    times_d.iter().enumerate().map(|(row, time)| row as f64 + BETWEEN_SEASONS * season(*time) as f64).collect()
}

fn time(line: &Line) -> String {
    format!("{:.2}", line.time_d)
}

/// A value that very few of these numbers exceed, within [`REACH`].
fn reach(numbers: impl Iterator<Item = f64>) -> f64 {
    let mut numbers: Vec<f64> = numbers.filter(|x| x.is_finite()).collect();
    numbers.sort_by(f64::total_cmp);
    let high = numbers.get(numbers.len() * 99 / 100).copied().unwrap_or(0.0);
    high.ceil().clamp(REACH[0], REACH[1])
}

/// Lines between nights, and their times.
fn nights(figure: &mut Figure, panel: &Panel, (lines, places): (&[&Line], &[f64]), labelled: bool) {
    let mut last: Option<Point> = None;
    for (row, line) in lines.iter().enumerate() {
        if row > 0 && line.time_d - lines[row - 1].time_d <= NIGHT_GAP_D {
            continue;
        }
        let [x, y] = panel.place(panel.x.range[0], places[row]);
        if row > 0 {
            let border = open(&[[x, y], [panel.frame.right(), y]]);
            figure.path("night", border, Paint::stroke(Stroke::new(BLACK, 0.3)));
        }
        if labelled && last.is_none_or(|[_, above]| y - above >= LABELS) {
            figure.text(&time(line), [x - 3.0, y + 5.5], Font::SMALL, Align::Right, 0.0);
            last = Some([x, y]);
        }
    }
}
