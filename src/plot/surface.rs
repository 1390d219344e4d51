//! A map of the surface and how it is painted: rings of pixels of equal area, neighbours of one colour as one patch.

use super::projection::{Projection, SOUTHERNMOST_DEG};
use crate::figure::colour::{BLACK, GREY};
use crate::figure::panel::Shade;
use crate::figure::{Figure, Paint, Segment, Stroke, closed, ellipse, open};
use crate::star::spots::{Spot, filling_at};
use crate::star::{Quadrature, SurfaceGrid};

/// Spot filling factors of pixels of equal area in rings of constant latitude, south to north.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Surface {
    pub ring_pixels: Vec<usize>,
    pub spot_filling: Vec<f64>,
}

/// Pixels of a map that is drawn from a list of spots.
const FINE: usize = 20_000;

impl Surface {
    /// The map of a list of spots.
    pub fn of_spots(spots: &[Spot]) -> Self {
        let grid = SurfaceGrid::equal_area(FINE, Quadrature::Centre);
        let spot_filling = grid.pixel_means(2, |longitude, latitude| filling_at(spots, longitude, latitude));
        let ring_pixels = grid.rings.iter().map(|ring| ring.pixels.len()).collect();
        Surface { ring_pixels, spot_filling }
    }

    /// Share of the surface that is covered.
    pub fn coverage(&self) -> f64 {
        self.spot_filling.iter().sum::<f64>() / self.spot_filling.len() as f64
    }

    /// Whether the rings hold all pixels.
    pub fn is_whole(&self) -> bool {
        !self.spot_filling.is_empty() && self.ring_pixels.iter().sum::<usize>() == self.spot_filling.len()
    }

    /// Paints the map.
    pub fn paint(&self, figure: &mut Figure, projection: Projection, shade: Shade) {
        let outline = match projection {
            Projection::Polar { centre, radius } => ellipse(centre, [radius, radius]),
            Projection::Mollweide { centre, radius } => ellipse(centre, [2.0 * radius, radius]),
        };
        let photosphere = shade.map.at(0.0);
        figure.path("star", outline, Paint::cell(photosphere));
        let total = self.spot_filling.len() as f64;
        let latitude = |below: usize| (2.0 * below as f64 / total - 1.0).clamp(-1.0, 1.0).asin().to_degrees();
        let mut below = 0;
        for &count in &self.ring_pixels {
            let latitudes = [latitude(below), latitude(below + count)];
            let ring = &self.spot_filling[below..below + count];
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
                    figure.polygon("pixel", &projection.patch(longitudes, latitudes), Paint::cell(colour(first)));
                }
                first = j;
            }
        }
    }
}

/// Outlines of spots.
pub(super) fn outlines(figure: &mut Figure, projection: Projection, spots: &[Spot], stroke: Stroke) {
    for spot in spots {
        let around: Vec<[f64; 2]> = (0..=120).map(|k| rim(spot, f64::from(k) * 3.0)).collect();
        let mut pieces: Vec<Vec<[f64; 2]>> = vec![Vec::new()];
        for [longitude, latitude] in around {
            let last = pieces.len() - 1;
            let shown = projection.shows(latitude);
            let jumps = matches!(projection, Projection::Mollweide { .. })
                && pieces[last].last().is_some_and(|before: &[f64; 2]| (before[0] - longitude).abs() > 180.0);
            if !shown || jumps {
                pieces.push(Vec::new());
            }
            if shown {
                pieces.last_mut().expect("one more").push([longitude, latitude]);
            }
        }
        let path: Vec<Segment> = pieces
            .iter()
            .flat_map(|piece| open(&piece.iter().map(|p| projection.place(p[0], p[1])).collect::<Vec<_>>()))
            .collect();
        figure.path("injected-spot", path, Paint::stroke(stroke));
    }
}

/// The point of a spot's rim in a direction from its centre: longitude in [0, 360) and latitude (degrees).
fn rim(spot: &Spot, direction_deg: f64) -> [f64; 2] {
    let (sin_d, cos_d) = direction_deg.to_radians().sin_cos();
    let (sin_r, cos_r) = spot.radius.sin_cos();
    let (sin_b, cos_b) = spot.latitude.sin_cos();
    let sin_latitude = (sin_b * cos_r + cos_b * sin_r * cos_d).clamp(-1.0, 1.0);
    let turn = (sin_d * sin_r * cos_b).atan2(cos_r - sin_b * sin_latitude);
    [(spot.longitude + turn).to_degrees().rem_euclid(360.0), sin_latitude.asin().to_degrees()]
}

/// Meridians and parallels: the equator bold, others dashed.
pub(super) fn graticule(figure: &mut Figure, projection: Projection) {
    let thin = Paint::stroke(Stroke { dash: &[2.0, 2.0], ..Stroke::new(GREY, 0.4) });
    let bold = Paint::stroke(Stroke::new(BLACK, 0.9));
    let line = |points: Vec<[f64; 2]>| points.iter().map(|p| projection.place(p[0], p[1])).collect::<Vec<_>>();
    let parallel = |latitude: f64| line((0..=180).map(|k| [2.0 * f64::from(k), latitude]).collect());
    match projection {
        Projection::Polar { centre, radius } => {
            for latitude in [60.0, 30.0] {
                figure.path("parallel", closed(&parallel(latitude)), thin);
            }
            for longitude in [0.0, 90.0, 180.0, 270.0] {
                let from = projection.place(longitude, 90.0);
                figure.path("meridian", open(&[from, projection.place(longitude, SOUTHERNMOST_DEG)]), thin);
            }
            figure.path("equator", closed(&parallel(0.0)), bold);
            figure.ellipse("edge", centre, [radius, radius], Paint::stroke(Stroke::new(BLACK, 0.6)));
        }
        Projection::Mollweide { centre, radius } => {
            for latitude in [-60.0, -30.0, 30.0, 60.0] {
                figure.path("parallel", open(&parallel(latitude)), thin);
            }
            for longitude in [60.0, 120.0, 180.0, 240.0, 300.0] {
                let meridian = line((-45..=45).map(|k| [longitude, 2.0 * f64::from(k)]).collect());
                figure.path("meridian", open(&meridian), thin);
            }
            figure.path("equator", open(&parallel(0.0)), bold);
            figure.ellipse("edge", centre, [2.0 * radius, radius], Paint::stroke(Stroke::new(BLACK, 0.6)));
        }
    }
}
