//! Maps of a star that changes: a strip of them, below each its standard deviation.

use super::projection::{Projection, SOUTHERNMOST_DEG};
use super::surface::{PixelMap, Scale, graticule, photosphere};
use super::{ANY, PlotError, velocities};
use crate::data::io::csv::Columns;
use crate::data::io::map::{MAP, MapAt, MapColumns, MapFile};
use crate::figures::drawing::colour::{BLACK, ColourMap, GREY};
use crate::figures::drawing::panel::Shade;
use crate::figures::drawing::{Align, Figure, Font, PAGE_MM, Paint, Point, Rect, Stroke, open};
use crate::surface::SpotField;
use std::path::Path;

/// Most maps of a strip.
const MOST: usize = 12;

/// Most maps side by side.
const COLUMNS: usize = 6;

/// Width of the widest map with what is around it (pt).
const WIDEST: f64 = 160.0;

/// Profiles no further from a map's time than this (d) are of the same night.
const SAME_NIGHT_D: f64 = 0.5;

/// Pixels of the whole star in a picture of 1 pt of radius: finer ones are not seen.
const PIXELS_PER_PT2: f64 = 1.0;

/// One of the maps.
struct Strip {
    time_d: f64,
    filling: Vec<f64>,
    sd: Vec<f64>,
}

/// What the pictures have in common.
struct Common {
    filling: Scale,
    sd: Scale,
    radius: f64,
    inclination_deg: f64,
    /// Times (d) and rotation cycles of the profiles.
    observed: Vec<[f64; 2]>,
}

/// The maps in `folder`, which `file` holds.
pub(super) fn figure(folder: &Path, file: &MapFile) -> Result<Figure, PlotError> {
    let pixels: usize = file.ring_pixels.iter().sum();
    let wrong = |problem: &str| PlotError::Content { path: folder.join(MAP), problem: problem.into() };
    let of_time = |map: &MapAt| {
        let (MapColumns::Spots { spot_filling, .. }, Some(sd)) = (&map.pixels, &map.sigma_spot_filling) else {
            return None;
        };
        let is_whole = spot_filling.len() == pixels && sd.len() == pixels && pixels > 0;
        is_whole.then(|| Strip { time_d: map.time_d.unwrap_or(0.0), filling: spot_filling.clone(), sd: sd.clone() })
    };
    let Some(maps) = file.maps.iter().map(of_time).collect::<Option<Vec<Strip>>>() else {
        return Err(wrong("ring_pixels, spot_filling and sigma_spot_filling do not belong together"));
    };
    let (Some(field), false) = (&file.field, maps.is_empty()) else { return Err(wrong("holds no map")) };
    let shown = evenly(maps.len());
    let columns = shown.len().min(COLUMNS);
    let mut figure = Figure::new("maps", PAGE_MM, 100.0);
    let cell = ((figure.width - MARGIN) / columns as f64).min(WIDEST);
    let common = common(folder, (file, field, &maps), &shown, 0.5 * cell - 9.0)?;
    let block = 4.0 * common.radius + 44.0;
    figure.height = block * shown.len().div_ceil(columns) as f64 + 40.0;
    figure.caption = caption(maps.len(), field, shown.len());
    for (k, map) in shown.iter().map(|k| &maps[*k]).enumerate() {
        let (row, column) = (k / columns, k % columns);
        let left = MARGIN + 0.5 * (figure.width - MARGIN - cell * columns as f64);
        let x = left + cell * (column as f64 + 0.5);
        let top = block * row as f64;
        let centres = [1.0, 3.0].map(|n| [x, top + 16.0 + n * common.radius + 5.0 * n]);
        figure.text(&format!("{:.2} d", map.time_d), [x, top + 10.0], Font::LABEL, Align::Centre, 0.0);
        for (values, scale, centre) in [(&map.filling, common.filling, centres[0]), (&map.sd, common.sd, centres[1])] {
            let pixels = PixelMap { ring_pixels: file.ring_pixels.clone(), values: values.clone() };
            common.paint(&mut figure, &pixels, scale, centre);
            common.phases(&mut figure, map.time_d, centre);
        }
        if column == 0 {
            for (text, centre) in ["most probable", "standard dev."].into_iter().zip(centres) {
                figure.text(text, [left - 3.0, centre[1]], Font::SMALL, Align::Centre, 90.0);
            }
        }
    }
    bars(&mut figure, &common);
    Ok(figure)
}

/// Room to the left (pt).
const MARGIN: f64 = 14.0;

/// At most [`MOST`] of `n`, evenly chosen, the first and the last among them.
fn evenly(n: usize) -> Vec<usize> {
    match n <= MOST {
        true => (0..n).collect(),
        false => (0..MOST).map(|k| (k * (n - 1) + (MOST - 1) / 2) / (MOST - 1)).collect(),
    }
}

fn common(
    folder: &Path,
    (file, field, maps): (&MapFile, &SpotField, &[Strip]),
    shown: &[usize],
    radius: f64,
) -> Result<Common, PlotError> {
    let highest = shown.iter().flat_map(|k| &maps[*k].filling).fold(0.0, |high: f64, x| high.max(x.abs()));
    let reach = if highest > 0.5 { 1.0 } else { ((10.0 * highest).ceil() / 10.0).max(0.1) };
    let lowest = shown.iter().flat_map(|k| &maps[*k].sd).fold(f64::MAX, |low, x| low.min(*x));
    let amplitude = field.spot_amplitude;
    let observed = match folder.join(velocities::FILE) {
        table if table.is_file() => {
            let table = Columns::read(&table)?;
            let (times, cycles) = (table.column_within("time_d", ANY)?, table.column_within("cycle", ANY)?);
            times.iter().zip(cycles).map(|(time, cycle)| [*time, *cycle]).collect()
        }
        _ => Vec::new(),
    };
    Ok(Common {
        // spots dark, what is brighter than the photosphere blue
        filling: Scale { shade: Shade { map: ColourMap::Brightness, low: reach, high: -reach }, photosphere: 0.0 },
        sd: Scale {
            // from the next tenth of the amplitude below what is known best
            shade: Shade {
                map: ColourMap::Cividis,
                low: amplitude * (10.0 * lowest / amplitude).floor().clamp(0.0, 9.0) / 10.0,
                high: amplitude,
            },
            photosphere: amplitude,
        },
        radius,
        inclination_deg: file.parameters.state().inclination.to_degrees(),
        observed,
    })
}

fn caption(maps: usize, field: &SpotField, shown: usize) -> String {
    let of = match maps {
        all if all > shown => format!("{shown} of {all} maps, evenly chosen in time"),
        1 => "The map".to_owned(),
        all => format!("{all} maps"),
    };
    let life = match field.spot_lifetime_d {
        Some(days) => format!("whose spots live some {days:.1} d"),
        None => "that does not change".to_owned(),
    };
    format!(
        "{of} of a star {life}. Above: the most probable spot filling factor; below 0 it is brighter than the \
        photosphere. Below: its standard deviation, which is {:.2} where the profiles tell nothing. Flattened polar \
        projection down to -30 degrees, longitude 0 at the bottom, longitudes grow anticlockwise; parallels at +60, \
        +30 and 0 (bold). Ticks outside are the rotation phases observed within half a day. What is always below the \
        horizon is grey.",
        field.spot_amplitude
    )
}

impl Common {
    fn paint(&self, figure: &mut Figure, pixels: &PixelMap, scale: Scale, centre: Point) {
        let projection = Projection::Polar { centre, radius: self.radius };
        photosphere(figure, projection, scale);
        pixels.coarser((PIXELS_PER_PT2 * self.radius * self.radius) as usize).paint(figure, projection, scale);
        let unseen = [SOUTHERNMOST_DEG, -self.inclination_deg];
        if unseen[1] > unseen[0] {
            figure.polygon("unseen", &projection.patch([0.0, 360.0], unseen), Paint::fill(GREY));
        }
        graticule(figure, projection);
    }

    /// Ticks at the rotation phases that were observed in the night of a time (d).
    fn phases(&self, figure: &mut Figure, time_d: f64, centre: Point) {
        for [_, cycle] in self.observed.iter().filter(|[time, _]| (time - time_d).abs() <= SAME_NIGHT_D) {
            let (sin, cos) = (-360.0 * cycle).to_radians().sin_cos();
            let at = |distance: f64| [centre[0] + distance * sin, centre[1] + distance * cos];
            let tick = [at(self.radius + 0.8), at(self.radius + 4.5)];
            figure.path("observed-phase", open(&tick), Paint::stroke(Stroke::new(BLACK, 0.7)));
        }
    }
}

fn bars(figure: &mut Figure, common: &Common) {
    let (half, top) = (0.5 * figure.width, figure.height - 30.0);
    for (middle, scale, label) in [
        (0.5 * half, common.filling, "spot filling factor"),
        (1.5 * half, common.sd, "standard deviation of the filling factor"),
    ] {
        let bar = Rect { left: middle - 70.0, top, width: 140.0, height: 6.0 };
        scale.shade.lying_bar(figure, bar, label);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_strip_has_the_first_and_the_last_map_and_no_more_than_twelve() {
        assert_eq!(evenly(3), [0, 1, 2]);
        for n in [12, 13, 14, 40, 1000] {
            let shown = evenly(n);
            assert_eq!((shown.len(), shown[0], shown[11]), (12, 0, n - 1));
            let steps: Vec<usize> = shown.windows(2).map(|pair| pair[1] - pair[0]).collect();
            assert!(steps.iter().max().unwrap() - steps.iter().min().unwrap() <= 1, "{n}: {shown:?}");
        }
    }
}
