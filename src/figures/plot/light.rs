//! Light curves: measurements and what the most probable maps make of them, and what is left over.

use super::times::{Clock, Stretch, stretches};
use super::{ANY, PlotError};
use crate::data::io::csv::Columns;
use crate::data::io::map::LIGHT_CURVES;
use crate::figures::drawing::colour::{BLACK, Colour, GREY, VERMILION};
use crate::figures::drawing::panel::Sides;
use crate::figures::drawing::{
    Align, Axis, Figure, Font, Key, Legend, Marker, PAGE_MM, Panel, Rect, Scale, Stroke, range_of,
};
use std::path::Path;

const POINT: (Marker, f64, Colour) = (Marker::Disc, 2.0, BLACK);
const MODEL: Stroke = Stroke::new(VERMILION, 0.9);
const BAR: Stroke = Stroke::new(GREY, 0.6);

/// A bin of the table.
struct Bin {
    time_d: f64,
    flux: f64,
    sigma: f64,
    model: f64,
    residual: f64,
    /// Band and segment.
    part: [f64; 2],
}

/// The figure of all bands, two panels each.
pub(super) fn figure(folder: &Path) -> Result<Figure, PlotError> {
    let table = Columns::read(&folder.join(LIGHT_CURVES))?;
    let of = |name: &str| table.column_within(name, ANY);
    let (time_d, flux, sigma, model) = (of("time_d")?, of("flux")?, of("sigma")?, of("model")?);
    let (residual, segment, band) = (of("residual")?, of("segment")?, of("band")?);
    let bin = |k: usize| Bin {
        time_d: time_d[k],
        flux: flux[k],
        sigma: sigma[k],
        model: model[k],
        residual: residual[k],
        part: [band[k], segment[k]],
    };
    let bins: Vec<Bin> = (0..time_d.len()).map(bin).collect();
    let bands: Vec<&[Bin]> = bins.chunk_by(|a, b| a.part[0] == b.part[0]).collect();
    let mut figure = Figure::new("lightcurve", PAGE_MM, 20.0 + 52.0 * bands.len() as f64);
    figure.caption = "Light curves, binned, in units of the mean flux of a segment. Above: measurements, and the flux \
    of the most probable maps with the level and slope of each segment. Below: the difference."
        .into();
    let (left, top, gap) = (46.0, 16.0, 8.0);
    let width = figure.width - left - 10.0;
    let height = (figure.height - top - 28.0) / bands.len() as f64 - gap;
    let clock = Clock::of(bins.iter().map(|bin| bin.time_d));
    let parts = stretches(bins.iter().map(|bin| bin.time_d), left, width);
    let last = bands.len() - 1;
    for (b, bins) in bands.into_iter().enumerate() {
        let above = Rect { left, top: top + b as f64 * (height + gap), width, height: 0.64 * (height - gap) };
        let below = Rect { top: above.bottom() + gap, height: 0.36 * (height - gap), ..above };
        draw(&mut figure, bins, (&parts, &clock), [above, below], b == last);
        if b == last {
            let at = [left + 0.5 * width, below.bottom() + 19.0];
            figure.text(&clock.label, at, Font::LABEL, Align::Centre, 0.0);
        }
    }
    let mut legend = Legend::default();
    legend.add(Key::Point(POINT.0, POINT.2), "flux");
    legend.add(Key::Line(MODEL), "most probable maps");
    let middle = left + 0.5 * width;
    legend.row(&mut figure, [middle, 8.0]);
    Ok(figure)
}

/// A band: fluxes above, residuals below, in stretches of time.
fn draw(
    figure: &mut Figure,
    bins: &[Bin],
    (parts, clock): (&[Stretch], &Clock),
    [above, below]: [Rect; 2],
    is_last: bool,
) {
    let ends = |y: fn(&Bin) -> f64| bins.iter().flat_map(move |bin| [y(bin) - bin.sigma, y(bin) + bin.sigma]);
    let fluxes = range_of(ends(|bin| bin.flux).chain(bins.iter().map(|bin| bin.model)), Scale::Linear, 0.06);
    let left_over = range_of(ends(|bin| bin.residual), Scale::Linear, 0.1);
    for (n, part) in parts.iter().enumerate() {
        let inside = |frame: Rect| Rect { left: part.left, width: part.width, ..frame };
        let bins = || bins.iter().filter(|bin| part.holds(bin.time_d));
        let panel = Panel { frame: inside(above), x: part.axis(clock), y: Axis::linear("relative flux", fluxes) };
        bars(figure, &panel, bins(), clock, |bin| bin.flux);
        for segment in bins().collect::<Vec<_>>().chunk_by(|a, b| a.part == b.part) {
            let line: Vec<[f64; 2]> = segment.iter().map(|bin| [bin.time_d - clock.zero_d, bin.model]).collect();
            panel.line(figure, "model", &line, MODEL);
        }
        panel.narrow_frame(figure, Sides { below: false, left: n == 0 });
        let panel = Panel { frame: inside(below), x: part.axis(clock), y: Axis::linear("residual", left_over) };
        panel.horizontal(figure, "zero", 0.0, BAR.dashed());
        bars(figure, &panel, bins(), clock, |bin| bin.residual);
        panel.narrow_frame(figure, Sides { below: is_last, left: n == 0 });
    }
}

fn bars<'a>(
    figure: &mut Figure,
    panel: &Panel,
    bins: impl Iterator<Item = &'a Bin>,
    clock: &Clock,
    y: fn(&Bin) -> f64,
) {
    let mut points = Vec::new();
    for bin in bins {
        let time = bin.time_d - clock.zero_d;
        panel.bar(figure, "error-bar", [[time, y(bin) - bin.sigma], [time, y(bin) + bin.sigma]], 0.0, BAR);
        points.push([time, y(bin)]);
    }
    panel.points(figure, "observed", &points, POINT);
}
