//! The map of the star: flattened polar projection and Mollweide's, with the injected map if it is known.

use super::content::Content;
use super::ephemeris::ephemeris;
use super::injected::Injected;
use super::projection::Projection;
use super::surface::{PixelMap, Scale, graticule, outline, paint_discs, photosphere};
use super::{PlotError, velocities};
use crate::data::io::csv::Columns;
use crate::data::io::map::{MAP, MapAt, MapColumns, MapFile, OneMap, SEASON};
use crate::data::io::provenance::Season;
use crate::data::io::truth::{self, TruthFile};
use crate::figures::drawing::colour::{BLACK, BLUE, VERMILION, WHITE};
use crate::figures::drawing::{Align, Figure, Font, PAGE_MM, Paint, Point, Rect, Stroke, open, width_pt};
use crate::runs::origin;
use crate::star::{Brightness, Disc};
use std::path::Path;

/// One star on the page.
struct Star {
    title: String,
    /// Its pixels, or the discs on it.
    surface: Surface,
    /// The injected surface: its rims are drawn over pixels.
    rims: Injected,
}

enum Surface {
    Pixels(PixelMap),
    /// Each with the map's value inside it.
    Discs(Vec<(Disc, f64)>),
}

/// The map in `folder`, from `file`; one map per season for several.
pub(super) fn figures(folder: &Path, file: &MapFile) -> Result<Vec<Figure>, PlotError> {
    let of_season = |(k, map): (usize, &MapAt)| {
        let (season, spottedness) = (map.season?, map.spottedness?);
        let own = OneMap { spottedness, true_spottedness: map.true_spottedness, pixels: map.pixels.clone() };
        Some((k + 1, season, own))
    };
    let seasons: Vec<(usize, Season, OneMap)> = file.maps.iter().enumerate().filter_map(of_season).collect();
    if seasons.is_empty() {
        let problem = "holds no map: spottedness, spot_filling or brightness is missing, or none of numbers";
        let one = file.mean.clone();
        let one = one.ok_or_else(|| PlotError::Content { path: folder.join(MAP), problem: problem.into() })?;
        return Ok(vec![figure(folder, file, one, None)?]);
    }
    let count = seasons.len();
    let of_season = |(number, season, own): (usize, Season, OneMap)| {
        let Season { first_d, last_d, epoch_d, .. } = season;
        let text = format!("in season {number} of {count}, {first_d:.2} to {last_d:.2} d, at {epoch_d:.2} d");
        figure(folder, file, own, Some((number, text)))
    };
    seasons.into_iter().map(of_season).collect()
}

/// One map of a `file`; for a season with its number and description.
fn figure(folder: &Path, file: &MapFile, map: OneMap, season: Option<(usize, String)>) -> Result<Figure, PlotError> {
    let (content, values) = match map.pixels {
        MapColumns::BrightAndDark { brightness, .. } => {
            (Content::Brightness(Brightness::of_spots(file.contrast)), brightness)
        }
        MapColumns::Spots { spot_filling, .. } => (Content::Spots, spot_filling),
    };
    let pixels = PixelMap { ring_pixels: file.ring_pixels.clone(), values };
    if !pixels.is_whole() {
        let what = if content == Content::Spots { "spot_filling" } else { "brightness" };
        let problem = format!("ring_pixels and {what} do not belong together");
        return Err(PlotError::Content { path: folder.join(MAP), problem });
    }
    // the injected surface is known at cycle 0 only, or in the middle of all data
    let known = Injected::of(folder)?.filter(|_| season.is_none());
    let cycles = match folder.join(velocities::FILE) {
        table if table.is_file() => {
            let table = Columns::read(&table)?;
            let cycles = table.column("cycle")?;
            match &season {
                None => cycles.to_vec(),
                Some((number, _)) => {
                    let of_season = |(_, season): &(&f64, &f64)| **season == *number as f64;
                    cycles.iter().zip(table.column(SEASON)?).filter(of_season).map(|(cycle, _)| *cycle).collect()
                }
            }
        }
        _ => Vec::new(),
    };
    let title = content.title("reconstructed", Some(map.spottedness));
    let mut stars = vec![Star { title, surface: Surface::Pixels(pixels), rims: Injected::default() }];
    let mut compared = "";
    if let Some(injected) = known {
        compared = match injected.faculae.is_empty() {
            true => "; rims of injected spots are outlined",
            false => "; rims of injected spots are outlined in blue, those of faculae in red",
        };
        let spottedness = match content {
            Content::Spots => injected.coverage.or(map.true_spottedness),
            Content::Brightness(_) => map.true_spottedness,
        };
        stars.push(Star::injected(content, spottedness, &injected));
        stars[0].rims = injected;
    }
    let what = if content == Content::Spots { "spots" } else { "brightness" };
    let (name, when) = season.map_or(("map".into(), "at cycle 0".into()), |(k, text)| (format!("map_{k}"), text));
    let caption = format!("Map of the {what} {when}{compared}. {HOW_TO_READ}");
    let mut figure = draw(&stars, content, &cycles, caption);
    figure.name = name;
    Ok(figure)
}

/// The injected map of the simulation in `folder`.
///
/// `None` for observed profiles with an injected orbit.
pub(super) fn injected(folder: &Path) -> Result<Option<Figure>, PlotError> {
    let file: TruthFile = origin::read(folder, truth::FILE)?;
    let Some(injected) = Injected::of_truth(&file) else { return Ok(None) };
    let TruthFile::Simulated(truth) = file else { return Ok(None) };
    let (period, epoch) = ephemeris(&truth.provenance.config).unwrap_or((f64::NAN, 0.0));
    let cycles: Vec<f64> = truth.times_d.iter().map(|t| (t - epoch) / period).filter(|c| c.is_finite()).collect();
    let (content, what) = match (injected.faculae.is_empty(), truth.contrast) {
        (false, Some(contrast)) => (Content::Brightness(Brightness::of_spots(contrast)), "spots and faculae"),
        _ => (Content::Spots, "spots"),
    };
    let mut star = Star::injected(content, None, &injected);
    star.title = Content::Spots.title("injected", injected.coverage);
    let when = if injected.is_changing { ", at their size in the middle of the data" } else { "" };
    let text = format!("Map of the injected {what} at cycle 0{when}. {HOW_TO_READ}");
    Ok(Some(draw(&[star], content, &cycles, text)))
}

/// Explanation of phases and longitudes.
const HOW_TO_READ: &str = "Discs: flattened polar projection, seen from above the visible pole: parallels at +60, \
+30, 0 \
                           (bold) and -30 degrees, the star turns anticlockwise, numbers outside are the rotation \
                           phases at which \
                           a meridian faces the observer, ticks the observed phases. Ellipses: Mollweide projection; \
                           longitude = 360 (1 - phase) degrees.";

/// Radius of the polar projection (pt).
const RADIUS: f64 = 84.0;
/// Half the height of Mollweide's.
const HALF_HEIGHT: f64 = 56.0;

impl Star {
    fn injected(content: Content, spottedness: Option<f64>, injected: &Injected) -> Self {
        let title = content.title("injected", spottedness);
        Star { title, surface: Surface::Discs(content.discs(injected)), rims: Injected::default() }
    }

    fn values(&self) -> Vec<f64> {
        match &self.surface {
            Surface::Pixels(map) => map.values.clone(),
            Surface::Discs(discs) => discs.iter().map(|(_, value)| *value).collect(),
        }
    }

    fn paint(&self, figure: &mut Figure, projection: Projection, scale: Scale) {
        photosphere(figure, projection, scale);
        match &self.surface {
            Surface::Pixels(map) => map.paint(figure, projection, scale),
            Surface::Discs(discs) => paint_discs(figure, projection, discs, scale),
        }
        graticule(figure, projection);
        for facula in &self.rims.faculae {
            outline(figure, "injected-facula", projection, &facula.disc, Stroke::new(VERMILION, 0.6));
        }
        for spot in &self.rims.spots {
            outline(figure, "injected-spot", projection, &spot.disc(), Stroke::new(BLUE, 0.6));
        }
    }
}

/// One star: the projections side by side; two stars: one column each.
fn draw(stars: &[Star], content: Content, cycles: &[f64], caption: String) -> Figure {
    let two = stars.len() > 1;
    let mut figure = Figure::new("map", PAGE_MM, if two { 136.0 } else { 92.0 });
    figure.caption = caption;
    let scale = content.scale(stars.iter().flat_map(Star::values));
    let half = 0.5 * figure.width;
    let middle = 28.0 + RADIUS + 8.0;
    for (k, star) in stars.iter().enumerate() {
        let x = half * (0.5 + k as f64);
        let mollweide =
            if two { [x + 6.0, middle + RADIUS + 26.0 + HALF_HEIGHT] } else { [1.5 * half - 4.0, middle - 8.0] };
        polar(&mut figure, star, [x, middle], cycles, scale);
        flat(&mut figure, star, mollweide, HALF_HEIGHT, scale);
        figure.text(&star.title, [if two { x } else { half }, 10.0], Font::LABEL, Align::Centre, 0.0);
    }
    let bar = Rect { left: half - 70.0, top: figure.height - 30.0, width: 140.0, height: 6.0 };
    scale.shade.lying_bar(&mut figure, bar, content.label());
    figure
}

const TINY: Font = Font { size: 6.0, colour: BLACK };

fn polar(figure: &mut Figure, star: &Star, centre: Point, cycles: &[f64], scale: Scale) {
    let projection = Projection::Polar { centre, radius: RADIUS };
    star.paint(figure, projection, scale);
    // the meridian that faces the observer at a phase
    let toward = |phase: f64, distance: f64| {
        let (sin, cos) = (-360.0 * phase).to_radians().sin_cos();
        [centre[0] + distance * sin, centre[1] + distance * cos]
    };
    for cycle in cycles {
        let tick = [toward(*cycle, RADIUS + 1.5), toward(*cycle, RADIUS + 7.0)];
        figure.path("observed-phase", open(&tick), Paint::stroke(Stroke::new(BLACK, 0.6)));
    }
    for (phase, text, align, down) in [
        (0.0, "phase 0", Align::Centre, 6.5),
        (0.25, "0.25", Align::Right, 2.5),
        (0.5, "0.5", Align::Centre, -1.5),
        (0.75, "0.75", Align::Left, 2.5),
    ] {
        let at = toward(phase, RADIUS + 9.5);
        figure.text(text, [at[0], at[1] + down], Font::SMALL, align, 0.0);
    }
    parallels(figure, projection, &[60.0, 30.0, 0.0, -30.0], TINY);
    if !cycles.is_empty() {
        let [x, y] = [centre[0] - RADIUS + 2.0, centre[1] + RADIUS + 2.0];
        figure.path("phase-key", open(&[[x, y - 11.0], [x, y - 5.5]]), Paint::stroke(Stroke::new(BLACK, 0.6)));
        figure.text("observed phases", [x, y + 2.0], TINY, Align::Centre, 0.0);
    }
    rotation_arrow(figure, [centre[0] + RADIUS + 2.0, centre[1] + RADIUS - 6.0], 7.0, "rotation");
}

/// Labels of parallels in polar projection.
pub(super) fn parallels(figure: &mut Figure, projection: Projection, latitudes: &[f64], font: Font) {
    for latitude in latitudes {
        let [x, y] = projection.place(207.0, *latitude);
        let text = degrees(*latitude);
        let (width, half) = (width_pt(&text, font.size), 0.53 * font.size);
        let ground = Rect { left: x - 0.5 * width - 1.0, top: y - half, width: width + 2.0, height: 2.0 * half };
        figure.rect("label-ground", ground, Paint::fill(WHITE.opacity(0.75)));
        figure.text(&text, [x, y + 0.35 * font.size], font, Align::Centre, 0.0);
    }
}

/// A latitude with its sign.
pub(super) fn degrees(latitude: f64) -> String {
    if latitude == 0.0 { "0°".to_owned() } else { format!("{latitude:+}°") }
}

/// An arrow on an arc in the direction of rotation, anticlockwise, and a text below it.
pub(super) fn rotation_arrow(figure: &mut Figure, at: Point, radius: f64, text: &str) {
    let on = |degrees: f64, radius: f64| {
        let (sin, cos) = degrees.to_radians().sin_cos();
        [at[0] + radius * cos, at[1] - radius * sin]
    };
    let (pen, head) = (0.07 * radius + 0.4, 0.28 * radius + 1.0);
    let arc: Vec<Point> = (0..=30).map(|k| on(-60.0 + 8.6 * f64::from(k), radius)).collect();
    figure.polyline("rotation", &arc, Stroke::new(BLACK, pen));
    let head = [on(232.0, radius), on(190.0, radius - head), on(190.0, radius + head)];
    figure.polygon("rotation", &head, Paint::fill(BLACK));
    if !text.is_empty() {
        figure.text(text, [at[0], at[1] + radius + 1.0 + TINY.size], TINY, Align::Centre, 0.0);
    }
}

fn flat(figure: &mut Figure, star: &Star, centre: Point, radius: f64, scale: Scale) {
    let projection = Projection::Mollweide { centre, radius };
    star.paint(figure, projection, scale);
    for latitude in [-60.0, -30.0, 0.0, 30.0, 60.0_f64] {
        let at = projection.place(0.0, latitude);
        // away from the edge, which is inclined far from the equator
        let text = [at[0] - 3.0 - latitude.abs() / 14.0, at[1] + 2.5];
        figure.text(&degrees(latitude), text, Font::SMALL, Align::Right, 0.0);
    }
    // in the corner outside the ellipse
    let corner = [projection.place(0.0, 0.0)[0] - 14.0, centre[1] - radius + 3.0];
    figure.text("latitude", corner, Font::LABEL, Align::Left, 0.0);
    let below = centre[1] + radius + 9.0;
    for longitude in [0.0, 60.0, 120.0, 180.0, 240.0, 300.0, 360.0] {
        let at = projection.place(longitude, 0.0);
        figure.text(&format!("{longitude}°"), [at[0], below], Font::SMALL, Align::Centre, 0.0);
    }
    figure.text("longitude", [centre[0], below + 10.0], Font::LABEL, Align::Centre, 0.0);
}
