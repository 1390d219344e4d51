//! The map of the star: flattened polar projection and Mollweide's, beside it the injected map where it is known.

use super::projection::Projection;
use super::surface::{Surface, graticule, outlines};
use super::{PlotError, velocities};
use crate::figure::colour::{BLACK, BLUE, ColourMap};
use crate::figure::panel::Shade;
use crate::figure::{Align, Figure, Font, PAGE_MM, Paint, Point, Rect, Stroke, open};
use crate::io::csv::Columns;
use crate::origin;
use crate::star::spots::Spot;
use serde::Deserialize;
use serde_json::Value;
use std::path::Path;

/// The file of a map.
pub(super) const FILE: &str = "map.json";

/// The file of a simulation.
pub(super) const TRUTH: &str = "truth.json";

/// What is used of `map.json`.
#[derive(Deserialize)]
struct MapFile {
    ring_pixels: Vec<usize>,
    spot_filling: Vec<f64>,
    true_spot_filling: Option<Vec<f64>>,
}

/// What is used of `truth.json`.
#[derive(Deserialize)]
struct TruthFile {
    spots: Value,
    times_d: Vec<f64>,
    config: Value,
}

/// One star on the page.
struct Star {
    surface: Surface,
    title: String,
    /// Spots whose outlines are drawn over it.
    spots: Vec<Spot>,
}

/// The map in `folder`.
pub(super) fn figure(folder: &Path) -> Result<Figure, PlotError> {
    let MapFile { ring_pixels, spot_filling, true_spot_filling } = origin::read(folder, FILE)?;
    let surface = Surface { ring_pixels, spot_filling };
    check(&surface, folder)?;
    let spots = known_spots(folder)?;
    let injected = match (&spots, true_spot_filling) {
        (Some(spots), _) => Some(Surface::of_spots(spots)),
        (None, Some(spot_filling)) => Some(Surface { spot_filling, ring_pixels: surface.ring_pixels.clone() }),
        (None, None) => None,
    };
    if let Some(injected) = &injected {
        check(injected, folder)?;
    }
    let cycles = match folder.join(velocities::FILE) {
        table if table.is_file() => Columns::read(&table)?.column("cycle")?.to_vec(),
        _ => Vec::new(),
    };
    let mut stars = vec![Star::new("reconstructed", surface, spots.unwrap_or_default())];
    stars.extend(injected.map(|injected| Star::new("injected", injected, Vec::new())));
    let compared = if stars.len() > 1 { "; the rims of injected spots are outlined" } else { "" };
    let caption = format!("Map of the spots at cycle 0{compared}. {HOW_TO_READ}");
    Ok(draw(&stars, &cycles, caption))
}

/// The injected map of the simulation in `folder`.
pub(super) fn injected(folder: &Path) -> Result<Figure, PlotError> {
    let truth: TruthFile = origin::read(folder, TRUTH)?;
    let number = |key: &str| truth.config.pointer(&format!("/star/{key}")).and_then(Value::as_f64);
    let (period, epoch) = (number("rotation_period_d").unwrap_or(f64::NAN), number("epoch_d").unwrap_or(0.0));
    let cycles: Vec<f64> = truth.times_d.iter().map(|t| (t - epoch) / period).filter(|c| c.is_finite()).collect();
    let star = Star::new("injected", Surface::of_spots(&spots(&truth.spots)), Vec::new());
    Ok(draw(&[star], &cycles, format!("Map of the injected spots at cycle 0. {HOW_TO_READ}")))
}

/// How phases and longitudes are to be read.
const HOW_TO_READ: &str = "Upper panels: flattened polar projection, seen from above the visible pole: parallels at +60, +30, 0 \
                           (bold) and -30 degrees, the star turns anticlockwise, numbers outside are the rotation phases at which \
                           a meridian faces the observer, ticks the observed phases. Lower panels: Mollweide projection; \
                           longitude = 360 (1 - phase) degrees.";

fn check(surface: &Surface, folder: &Path) -> Result<(), PlotError> {
    let problem = "ring_pixels and the filling factors do not belong together".to_owned();
    surface.is_whole().then_some(()).ok_or_else(|| PlotError::Content { path: folder.join(FILE), problem })
}

/// The injected spots, where the folder knows them: of `truth.json`, or of the config that made the map.
fn known_spots(folder: &Path) -> Result<Option<Vec<Spot>>, PlotError> {
    if folder.join(TRUTH).is_file() {
        let truth: TruthFile = origin::read(folder, TRUTH)?;
        return Ok(Some(spots(&truth.spots)));
    }
    if !folder.join(velocities::FIT).is_file() {
        return Ok(None);
    }
    let fit: Value = origin::read(folder, velocities::FIT)?;
    Ok(fit.pointer("/config/observations/simulate/spots").map(spots))
}

/// Spots as they are written, `[longitude, latitude, radius, filling]` in degrees; others are left out.
fn spots(written: &Value) -> Vec<Spot> {
    let spot = |value: &Value| {
        let number = |k: usize| value.get(k).and_then(Value::as_f64);
        let [longitude, latitude, radius] = [number(0)?, number(1)?, number(2)?].map(f64::to_radians);
        Some(Spot { longitude, latitude, radius, filling: number(3)? })
    };
    written.as_array().map(|spots| spots.iter().filter_map(spot).collect()).unwrap_or_default()
}

impl Star {
    fn new(what: &str, surface: Surface, spots: Vec<Spot>) -> Self {
        Star { title: format!("{what}, {:.1} % spotted", 100.0 * surface.coverage()), surface, spots }
    }
}

/// Radius of the polar projection (pt).
const RADIUS: f64 = 84.0;
/// Half the height of Mollweide's.
const HALF_HEIGHT: f64 = 56.0;

/// One star: the projections side by side; two stars: a column each.
fn draw(stars: &[Star], cycles: &[f64], caption: String) -> Figure {
    let two = stars.len() > 1;
    let mut figure = Figure::new("map", PAGE_MM, if two { 140.0 } else { 92.0 });
    figure.caption = caption;
    let highest = stars.iter().flat_map(|star| &star.surface.spot_filling).fold(0.0_f64, |a, b| a.max(*b));
    // a map of faint spots has a scale of its own
    let high = if highest > 0.5 { 1.0 } else { ((10.0 * highest).ceil() / 10.0).max(0.1) };
    let shade = Shade { map: ColourMap::Spots, low: 0.0, high };
    let half = 0.5 * figure.width;
    let top = 20.0 + RADIUS + 22.0;
    for (k, star) in stars.iter().enumerate() {
        let x = half * (0.5 + k as f64);
        let mollweide = if two { [x, top + RADIUS + 28.0 + HALF_HEIGHT] } else { [1.5 * half - 6.0, top - 8.0] };
        let spread = if two { HALF_HEIGHT } else { 1.05 * HALF_HEIGHT };
        polar(&mut figure, star, [x, top], cycles, shade);
        flat(&mut figure, star, mollweide, spread, shade);
        let middle = if two { x } else { half };
        figure.text(&star.title, [middle, 12.0], Font::LABEL, Align::Centre, 0.0);
    }
    let bar = Rect { left: half - 70.0, top: figure.height - 32.0, width: 140.0, height: 6.0 };
    shade.lying_bar(&mut figure, bar, "spot filling factor");
    figure
}

const OUTLINE: Stroke = Stroke::new(BLUE, 0.6);

fn polar(figure: &mut Figure, star: &Star, centre: Point, cycles: &[f64], shade: Shade) {
    let projection = Projection::Polar { centre, radius: RADIUS };
    star.surface.paint(figure, projection, shade);
    graticule(figure, projection);
    outlines(figure, projection, &star.spots, OUTLINE);
    let toward = |phase: f64, distance: f64| {
        let (sin, cos) = (-360.0 * phase).to_radians().sin_cos();
        [centre[0] + distance * sin, centre[1] + distance * cos]
    };
    for cycle in cycles {
        let tick = [toward(*cycle, RADIUS + 1.5), toward(*cycle, RADIUS + 7.0)];
        figure.path("observed-phase", open(&tick), Paint::stroke(Stroke::new(BLACK, 0.6)));
    }
    for (phase, text, align) in [
        (0.0, "phase 0", Align::Centre),
        (0.25, "0.25", Align::Right),
        (0.5, "0.5", Align::Centre),
        (0.75, "0.75", Align::Left),
    ] {
        let at = toward(phase, RADIUS + 9.5);
        let down = match phase {
            0.0 => 6.5,
            0.5 => -1.5,
            _ => 2.5,
        };
        figure.text(text, [at[0], at[1] + down], Font::SMALL, align, 0.0);
    }
    for latitude in [60.0, 30.0, 0.0] {
        let at = projection.place(205.0, latitude);
        figure.text(
            &format!("{latitude:+}°").replace("+0°", "0°"),
            [at[0], at[1] - 1.0],
            Font { size: 6.0, ..Font::SMALL },
            Align::Right,
            0.0,
        );
    }
    rotation_arrow(figure, [centre[0] + RADIUS + 4.0, centre[1] + RADIUS - 6.0]);
}

/// An arrow on an arc with the way the star turns: anticlockwise.
fn rotation_arrow(figure: &mut Figure, at: Point) {
    let radius = 7.0;
    let on = |degrees: f64| {
        let (sin, cos) = degrees.to_radians().sin_cos();
        [at[0] + radius * cos, at[1] - radius * sin]
    };
    let arc: Vec<Point> = (0..=30).map(|k| on(-60.0 + 9.0 * f64::from(k))).collect();
    figure.polyline("rotation", &arc, Stroke::new(BLACK, 0.8));
    let tip = on(222.0);
    let back = on(200.0);
    let along = [tip[0] - back[0], tip[1] - back[1]];
    let across = [0.6 * along[1], -0.6 * along[0]];
    let corners = [tip, [back[0] + across[0], back[1] + across[1]], [back[0] - across[0], back[1] - across[1]]];
    figure.polygon("rotation", &corners, Paint::fill(BLACK));
    figure.text("rotation", [at[0], at[1] + radius + 9.0], Font { size: 6.0, ..Font::SMALL }, Align::Centre, 0.0);
}

fn flat(figure: &mut Figure, star: &Star, centre: Point, radius: f64, shade: Shade) {
    let projection = Projection::Mollweide { centre, radius };
    star.surface.paint(figure, projection, shade);
    graticule(figure, projection);
    outlines(figure, projection, &star.spots, OUTLINE);
    for latitude in [-60.0, -30.0, 0.0, 30.0, 60.0] {
        let at = projection.place(0.0, latitude);
        let text = if latitude == 0.0 { "0°".to_owned() } else { format!("{latitude:+}°") };
        figure.text(&text, [at[0] - 3.0, at[1] + 2.5], Font::SMALL, Align::Right, 0.0);
    }
    for longitude in [0.0, 90.0, 180.0, 270.0, 360.0] {
        let at = projection.place(longitude, 0.0);
        figure.text(&format!("{longitude}°"), [at[0], centre[1] + radius + 9.0], Font::SMALL, Align::Centre, 0.0);
    }
    figure.text("longitude", [centre[0], centre[1] + radius + 19.0], Font::LABEL, Align::Centre, 0.0);
}
