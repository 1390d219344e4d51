//! Light curves and activity indicators: measurements, their model by the most probable maps, and the residuals.

use super::times::{Clock, Stretch, stretches};
use super::{ANY, PlotError};
use crate::data::io::csv::Columns;
use crate::data::io::map::{FIT, FitFile, INDICATORS, LIGHT_CURVES};
use crate::figures::drawing::colour::{BLACK, Colour, GREY, VERMILION};
use crate::figures::drawing::panel::Sides;
use crate::figures::drawing::{
    Align, Axis, Figure, Font, Key, Legend, Marker, PAGE_MM, Panel, Rect, Scale, Stroke, range_of,
};
use crate::runs::origin;
use std::path::Path;

const POINT: (Marker, f64, Colour) = (Marker::Disc, 2.0, BLACK);
const MODEL: Stroke = Stroke::new(VERMILION, 0.9);
const BAR: Stroke = Stroke::new(GREY, 0.6);

/// A row of the table.
struct Datum {
    time_d: f64,
    value: f64,
    sigma: f64,
    model: f64,
    residual: f64,
    /// Number of the series, and of its segment.
    part: [f64; 2],
}

/// The light curves, two panels each.
pub(super) fn light_curves(folder: &Path) -> Result<Figure, PlotError> {
    let table = Columns::read(&folder.join(LIGHT_CURVES))?;
    let data = data(&table, "flux", ["band", "segment"])?;
    let caption = "Light curves, binned, in units of the mean flux of a segment. Above: measurements, and the flux of \
        the most probable maps with the level and slope of each segment. Below: the difference.";
    Ok(figure(("lightcurve", caption), &data, ("flux", &|_| "relative flux".into())))
}

/// The activity indicators in use, two panels each.
pub(super) fn indicators(folder: &Path) -> Result<Figure, PlotError> {
    let table = Columns::read(&folder.join(INDICATORS))?;
    let data = data(&table, "value", ["indicator", "indicator"])?;
    let fit: FitFile = origin::read(folder, FIT)?;
    let known = fit.provenance.measured.indicators;
    let name = |number: f64| {
        let found = known.iter().enumerate().find(|(k, _)| (k + 1) as f64 == number);
        found.map_or_else(|| format!("indicator {number}"), |(_, found)| found.name.clone())
    };
    let caption = "Activity indicators with a significant gain. Above: measurements with their jitter, and the value \
        by the filling factor of the visible disc of the most probable maps, with the indicator's level and slope. \
        Below: the difference.";
    Ok(figure(("indicators", caption), &data, ("value", &name)))
}

/// The rows of a table.
fn data(table: &Columns, value: &str, part: [&str; 2]) -> Result<Vec<Datum>, PlotError> {
    let of = |name: &str| table.column_within(name, ANY);
    let (time_d, value, sigma, model) = (of("time_d")?, of(value)?, of("sigma")?, of("model")?);
    let (residual, part) = (of("residual")?, [of(part[0])?, of(part[1])?]);
    let datum = |k: usize| Datum {
        time_d: time_d[k],
        value: value[k],
        sigma: sigma[k],
        model: model[k],
        residual: residual[k],
        part: part.map(|of| of[k]),
    };
    Ok((0..time_d.len()).map(datum).collect())
}

/// The figure of all series; `measured` is the name of a measurement, and the label of the axis of each series.
fn figure((name, caption): (&str, &str), data: &[Datum], (measured, label): (&str, &dyn Fn(f64) -> String)) -> Figure {
    let all: Vec<&[Datum]> = data.chunk_by(|a, b| a.part[0] == b.part[0]).collect();
    let mut figure = Figure::new(name, PAGE_MM, 20.0 + 52.0 * all.len() as f64);
    figure.caption = caption.into();
    let (left, top, gap) = (46.0, 16.0, 8.0);
    let width = figure.width - left - 10.0;
    let height = (figure.height - top - 28.0) / all.len() as f64 - gap;
    let clock = Clock::of(data.iter().map(|datum| datum.time_d));
    let parts = stretches(data.iter().map(|datum| datum.time_d), left, width);
    let last = all.len() - 1;
    for (b, data) in all.into_iter().enumerate() {
        let above = Rect { left, top: top + b as f64 * (height + gap), width, height: 0.64 * (height - gap) };
        let below = Rect { top: above.bottom() + gap, height: 0.36 * (height - gap), ..above };
        let label = label(data[0].part[0]);
        draw(&mut figure, (data, &label), (&parts, &clock), [above, below], b == last);
        if b == last {
            let at = [left + 0.5 * width, below.bottom() + 19.0];
            figure.text(&clock.label, at, Font::LABEL, Align::Centre, 0.0);
        }
    }
    let mut legend = Legend::default();
    legend.add(Key::Point(POINT.0, POINT.2), measured);
    legend.add(Key::Line(MODEL), "most probable maps");
    let middle = left + 0.5 * width;
    legend.row(&mut figure, [middle, 8.0]);
    figure
}

/// A series: measurements above, residuals below, in stretches of time.
fn draw(
    figure: &mut Figure,
    (data, label): (&[Datum], &str),
    (parts, clock): (&[Stretch], &Clock),
    [above, below]: [Rect; 2],
    is_last: bool,
) {
    let ends =
        |y: fn(&Datum) -> f64| data.iter().flat_map(move |datum| [y(datum) - datum.sigma, y(datum) + datum.sigma]);
    let values = range_of(ends(|datum| datum.value).chain(data.iter().map(|datum| datum.model)), Scale::Linear, 0.06);
    let residuals = range_of(ends(|datum| datum.residual), Scale::Linear, 0.1);
    for (n, part) in parts.iter().enumerate() {
        let inside = |frame: Rect| Rect { left: part.left, width: part.width, ..frame };
        let inside_part = || data.iter().filter(|datum| part.holds(datum.time_d));
        let panel = Panel { frame: inside(above), x: part.axis(clock), y: Axis::linear(label, values) };
        bars(figure, &panel, inside_part(), clock, |datum| datum.value);
        for segment in inside_part().collect::<Vec<_>>().chunk_by(|a, b| a.part == b.part) {
            let line: Vec<[f64; 2]> = segment.iter().map(|datum| [datum.time_d - clock.zero_d, datum.model]).collect();
            panel.line(figure, "model", &line, MODEL);
        }
        panel.narrow_frame(figure, Sides { below: false, left: n == 0 });
        let panel = Panel { frame: inside(below), x: part.axis(clock), y: Axis::linear("residual", residuals) };
        panel.horizontal(figure, "zero", 0.0, BAR.dashed());
        bars(figure, &panel, inside_part(), clock, |datum| datum.residual);
        panel.narrow_frame(figure, Sides { below: is_last, left: n == 0 });
    }
}

fn bars<'a>(
    figure: &mut Figure,
    panel: &Panel,
    data: impl Iterator<Item = &'a Datum>,
    clock: &Clock,
    y: fn(&Datum) -> f64,
) {
    let mut points = Vec::new();
    for datum in data {
        let time = datum.time_d - clock.zero_d;
        panel.bar(figure, "error-bar", [[time, y(datum) - datum.sigma], [time, y(datum) + datum.sigma]], 0.0, BAR);
        points.push([time, y(datum)]);
    }
    panel.points(figure, "observed", &points, POINT);
}
