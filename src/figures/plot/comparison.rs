//! A chain compared with a likelihood grid: the estimates of each parameter below each other.

use super::PlotError;
use super::symbols::{label, nearest_turn};
use crate::figures::drawing::colour::{BLACK, BLUE, GREEN, GREY, VERMILION};
use crate::figures::drawing::{
    Align, Axis, Colour, Figure, Font, Marker, PAGE_MM, Panel, Rect, Scale, Stroke, range_of,
};
use crate::runs::comparison::{Compared, Comparison, FILE, Interval};
use crate::runs::origin;
use std::path::Path;

/// One line of a panel: name, value, interval, and its style.
type Entry = (&'static str, f64, Option<[f64; 2]>, Marker, Colour);

/// The figure.
pub(super) fn figures(folder: &Path) -> Result<Vec<Figure>, PlotError> {
    let file: Comparison = origin::read(folder, FILE)?;
    let columns = file.names.len().clamp(1, 3);
    let rows = file.names.len().div_ceil(columns);
    let row_mm = 44.0;
    let mut figure = Figure::new("comparison", PAGE_MM, row_mm * rows as f64);
    figure.caption =
        "Estimates of each parameter with 68 % intervals: median of the chain, vertex of the paraboloid, median of the \
         likelihood grid, and the injected value."
            .into();
    let left = 50.0;
    let cell = (figure.width - left) / columns as f64;
    let height = figure.height / rows as f64;
    for (k, name) in file.names.iter().enumerate() {
        let Some(one) = file.parameters.get(name) else { continue };
        let (row, column) = ((k / columns) as f64, (k % columns) as f64);
        let frame =
            Rect { left: left + column * cell, top: row * height + 8.0, width: cell - 10.0, height: height - 38.0 };
        panel(&mut figure, frame, name, &entries(one), column == 0.0);
    }
    Ok(vec![figure])
}

fn entries(one: &Compared) -> Vec<Entry> {
    let turn = |x: f64| if one.periodic { nearest_turn(x, one.chain.value) } else { x };
    let with = |what, interval: &Interval, marker, colour| -> Entry {
        let value = turn(interval.value);
        (what, value, Some(interval.ci68.map(|end| end + value - interval.value)), marker, colour)
    };
    let mut entries = vec![with("chain", &one.chain, Marker::Disc, BLUE)];
    entries.extend(one.paraboloid.as_ref().map(|p| with("paraboloid", &p.interval, Marker::Square, VERMILION)));
    entries.extend(one.landscape.as_ref().map(|l| with("landscape", &l.interval, Marker::Triangle, GREEN)));
    entries.extend(one.fixed_at.map(|x| ("fixed at", turn(x), None, Marker::Ring, GREEN)));
    entries.extend(one.truth.map(|x| ("injected", turn(x), None, Marker::Diamond, BLACK)));
    entries
}

fn panel(figure: &mut Figure, frame: Rect, name: &str, entries: &[Entry], first: bool) {
    let ends = entries.iter().flat_map(|(_, value, interval, ..)| interval.unwrap_or([*value; 2]));
    let x = Axis::linear(&label(name), range_of(ends, Scale::Linear, 0.15));
    let panel = Panel { frame, x, y: Axis::linear("", [entries.len() as f64 - 0.4, -0.6]) };
    panel.vertical(figure, "median", entries[0].1, Stroke::new(GREY, 0.6).dotted());
    for (row, (what, value, interval, marker, colour)) in entries.iter().enumerate() {
        let y = row as f64;
        if let Some([low, high]) = interval {
            panel.bar(figure, "error-bar", [[*low, y], [*high, y]], 4.0, Stroke::new(*colour, 1.0));
        }
        panel.points(figure, "estimate", &[[*value, y]], (*marker, 5.0, *colour));
        if first {
            let at = [frame.left - 4.0, panel.place(*value, y)[1] + 2.5];
            figure.text(what, at, Font::SMALL, Align::Right, 0.0);
        }
    }
    panel.bare_y_frame(figure);
}
