//! The painted surface of the star: a map of pixels, or discs.

use super::projection::{Projection, SOUTHERNMOST_DEG};
use crate::figures::drawing::colour::{BLACK, GREY};
use crate::figures::drawing::panel::Shade;
use crate::figures::drawing::{Colour, Figure, Paint, Point, Segment, Stroke, closed, ellipse, open};
use crate::star::{Disc, Quadrature, SurfaceGrid};
use std::collections::BTreeMap;

/// Colours of the values of a map, and the value of the photosphere.
#[derive(Clone, Copy, Debug)]
pub(super) struct Scale {
    pub shade: Shade,
    pub photosphere: f64,
}

impl Scale {
    fn ground(&self) -> Colour {
        self.shade.colour(self.photosphere).expect("a number")
    }
}

/// Values of pixels of equal area, in rings of constant latitude, south to north.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct PixelMap {
    pub ring_pixels: Vec<usize>,
    pub values: Vec<f64>,
}

/// Latitude (degrees) by which rings overlap on the page, so that the background does not show between them.
const OVERLAP_DEG: f64 = 0.15;

impl PixelMap {
    /// Whether the rings contain all pixels.
    pub fn is_whole(&self) -> bool {
        !self.values.is_empty() && self.ring_pixels.iter().sum::<usize>() == self.values.len()
    }

    /// The same on some `pixels`, if it has more: each with the map's value at its centre.
    pub fn coarser(&self, pixels: usize) -> PixelMap {
        if pixels >= self.values.len() {
            return self.clone();
        }
        let grid = SurfaceGrid::equal_area(pixels, Quadrature::Gauss2x2);
        let at = |(longitude, latitude): (&f64, &f64)| self.at(longitude.to_degrees(), *latitude);
        let values = grid.longitude.iter().zip(&grid.latitude).map(at).collect();
        PixelMap { ring_pixels: grid.rings.iter().map(|ring| ring.pixels.len()).collect(), values }
    }

    /// The map's value at a longitude (degrees) and latitude (rad).
    fn at(&self, longitude_deg: f64, latitude: f64) -> f64 {
        let share = 0.5 * (latitude.sin() + 1.0) * self.values.len() as f64;
        let mut below = 0;
        for &count in &self.ring_pixels {
            if share < (below + count) as f64 || below + count == self.values.len() {
                let pixel = (longitude_deg.rem_euclid(360.0) / 360.0 * count as f64) as usize;
                return self.values[below + pixel.min(count - 1)];
            }
            below += count;
        }
        f64::NAN
    }

    /// Paints the map; neighbours of one colour are one patch, and the colour of the photosphere is the background.
    pub fn paint(&self, figure: &mut Figure, projection: Projection, scale: Scale) {
        let (shade, photosphere) = (scale.shade, scale.ground());
        let total = self.values.len() as f64;
        let latitude = |below: usize| (2.0 * below as f64 / total - 1.0).clamp(-1.0, 1.0).asin().to_degrees();
        let mut of_colour: BTreeMap<[u8; 4], Vec<Segment>> = BTreeMap::new();
        let mut below = 0;
        for &count in &self.ring_pixels {
            let latitudes = [latitude(below), (latitude(below + count) + OVERLAP_DEG).min(90.0)];
            let ring = &self.values[below..below + count];
            below += count;
            if !projection.shows(latitudes[1]) {
                continue;
            }
            let colour = |j: usize| shade.colour(ring[j]).unwrap_or(photosphere);
            let mut first = 0;
            for j in 1..=count {
                if j < count && colour(j) == colour(first) {
                    continue;
                }
                if colour(first) != photosphere {
                    let longitudes = [first, j].map(|k| 360.0 * k as f64 / count as f64);
                    let patch = closed(&projection.patch(longitudes, latitudes));
                    of_colour.entry(colour(first).0).or_default().extend(patch);
                }
                first = j;
            }
        }
        for (colour, path) in of_colour {
            figure.path("pixels", path, Paint::cell(Colour(colour)));
        }
    }
}

/// Paints discs with the map's value inside them, one over the other.
pub(super) fn paint_discs(figure: &mut Figure, projection: Projection, discs: &[(Disc, f64)], scale: Scale) {
    for (disc, value) in discs {
        let paint = Paint::fill(scale.shade.colour(*value).unwrap_or(scale.ground()));
        rims(figure, "spot", projection, disc, paint);
    }
}

/// Draws the rim of an injected disc.
pub(super) fn outline(figure: &mut Figure, class: &'static str, projection: Projection, disc: &Disc, stroke: Stroke) {
    rims(figure, class, projection, disc, Paint::stroke(stroke));
}

/// A disc as closed lines: in Mollweide's projection repeated to either side, for parts beyond the edge.
fn rims(figure: &mut Figure, class: &'static str, projection: Projection, disc: &Disc, paint: Paint) {
    let around: Vec<[f64; 2]> = (0..=120).map(|k| rim(disc, 3.0 * f64::from(k))).collect();
    let places = |turn: f64, around: &[[f64; 2]]| -> Vec<Point> {
        around.iter().map(|[longitude, latitude]| projection.place(longitude + turn, *latitude)).collect()
    };
    match projection {
        Projection::Polar { .. } => {
            figure.clipped(edge(projection), |figure| figure.polygon(class, &places(0.0, &around), paint));
        }
        Projection::Mollweide { .. } => {
            let mut whole = unrolled(&around);
            let turned = whole[whole.len() - 1][0] - whole[0][0];
            if turned.abs() > 180.0 {
                // around a pole: the area extends up to it
                let pole = 90.0_f64.copysign(disc.latitude);
                whole.extend([[whole[whole.len() - 1][0], pole], [whole[0][0], pole]]);
            }
            figure.clipped(edge(projection), |figure| {
                for turn in [-360.0, 0.0, 360.0] {
                    figure.polygon(class, &places(turn, &whole), paint);
                }
            });
        }
    }
}

/// Longitudes without jumps.
fn unrolled(around: &[[f64; 2]]) -> Vec<[f64; 2]> {
    let mut whole: Vec<[f64; 2]> = Vec::with_capacity(around.len());
    for [longitude, latitude] in around {
        let before = whole.last().map_or(*longitude, |last| last[0]);
        whole.push([longitude - 360.0 * ((longitude - before) / 360.0).round(), *latitude]);
    }
    whole
}

/// The point of a disc's rim in a direction from its centre: longitude and latitude (degrees).
fn rim(disc: &Disc, direction_deg: f64) -> [f64; 2] {
    let (sin_d, cos_d) = direction_deg.to_radians().sin_cos();
    let (sin_r, cos_r) = disc.radius.sin_cos();
    let (sin_b, cos_b) = disc.latitude.sin_cos();
    let sin_latitude = (sin_b * cos_r + cos_b * sin_r * cos_d).clamp(-1.0, 1.0);
    let turn = (sin_d * sin_r * cos_b).atan2(cos_r - sin_b * sin_latitude);
    [(disc.longitude + turn).to_degrees().rem_euclid(360.0), sin_latitude.asin().to_degrees()]
}

/// The edge of the picture.
fn edge(projection: Projection) -> Vec<Segment> {
    match projection {
        Projection::Polar { centre, radius } => ellipse(centre, [radius, radius]),
        Projection::Mollweide { centre, radius } => ellipse(centre, [2.0 * radius, radius]),
    }
}

/// A star without spots.
pub(super) fn photosphere(figure: &mut Figure, projection: Projection, scale: Scale) {
    figure.path("star", edge(projection), Paint::fill(scale.ground()));
}

/// Meridians, parallels and the edge: the equator bold, others dashed.
pub(super) fn graticule(figure: &mut Figure, projection: Projection) {
    let thin = Paint::stroke(Stroke { dash: &[2.0, 2.0], ..Stroke::new(GREY, 0.4) });
    let line = |points: Vec<[f64; 2]>| points.iter().map(|p| projection.place(p[0], p[1])).collect::<Vec<_>>();
    let parallel = |latitude: f64| line((0..=180).map(|k| [2.0 * f64::from(k), latitude]).collect());
    let flat = matches!(projection, Projection::Mollweide { .. });
    let (latitudes, longitudes): (&[f64], &[f64]) = match flat {
        false => (&[30.0, 60.0], &[0.0, 90.0, 180.0, 270.0]),
        true => (&[-60.0, -30.0, 30.0, 60.0], &[60.0, 120.0, 180.0, 240.0, 300.0]),
    };
    let southernmost = if flat { -90.0 } else { SOUTHERNMOST_DEG };
    for latitude in latitudes {
        figure.path("parallel", open(&parallel(*latitude)), thin);
    }
    for longitude in longitudes {
        let latitude = |k: i32| southernmost + (90.0 - southernmost) * f64::from(k) / 60.0;
        figure.path("meridian", open(&line((0..=60).map(|k| [*longitude, latitude(k)]).collect())), thin);
    }
    let equator = if flat { open(&parallel(0.0)) } else { closed(&parallel(0.0)) };
    figure.path("equator", equator, Paint::stroke(Stroke::new(BLACK, 0.9)));
    figure.path("edge", edge(projection), Paint::stroke(Stroke::new(BLACK, 0.6)));
}
