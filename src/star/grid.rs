//! The stellar surface in pixels of equal area, and the evaluation points inside a pixel.
//!
//! Rings of constant latitude hold a number of pixels proportional to the cosine of the latitude; the latitudes of
//! their borders are then set so that every pixel has the same area. A pixel is evaluated at its centre or, to match
//! moments (`docs/method.md` section 1), at 2 x 2 Gauss points in longitude and sin(latitude).

use super::moments::CHUNK;
use std::f64::consts::{FRAC_PI_2, FRAC_PI_4, PI, TAU};
use std::ops::Range;

/// Where a pixel is evaluated.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Quadrature {
    /// At its centre: errors of order (pixel size)^2.
    Centre,
    /// At 2 x 2 Gauss points, whose moments represent the whole pixel.
    Gauss2x2,
}

/// One evaluation point of every pixel of a ring.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RingPoint {
    /// Sine of its latitude.
    pub sin_latitude: f64,
    /// Cosine of its latitude.
    pub cos_latitude: f64,
    /// Its longitude minus that of the pixel's centre (rad).
    pub longitude_offset: f64,
    /// Area fraction of the star that it represents.
    pub area: f64,
}

/// Pixels of one latitude.
#[derive(Clone, Debug, PartialEq)]
pub struct Ring {
    /// Their indices.
    pub pixels: Range<usize>,
    /// Evaluation points of each of them.
    pub points: Vec<RingPoint>,
}

/// A pixelised sphere.
#[derive(Clone, Debug, PartialEq)]
pub struct SurfaceGrid {
    /// Longitude of each pixel's centre (rad).
    pub longitude: Vec<f64>,
    /// Latitude of each pixel's centre (rad).
    pub latitude: Vec<f64>,
    /// Area of each pixel as a fraction of the star; they sum to 1.
    pub area: Vec<f64>,
    /// Cosine and sine of each pixel's longitude.
    pub(super) directions: Directions,
    /// The pixels in rings of constant latitude, south to north.
    pub(crate) rings: Vec<Ring>,
}

/// Cosines and sines of longitudes, with zeros behind them for loops over several pixels at a time.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Directions {
    cos: Vec<f32>,
    sin: Vec<f32>,
}

impl Directions {
    fn of(longitude: &[f64]) -> Self {
        let behind = std::iter::repeat_n((0.0, 0.0), CHUNK - 1);
        let (cos, sin) = longitude.iter().map(|l| (l.cos() as f32, l.sin() as f32)).chain(behind).unzip();
        Directions { cos, sin }
    }

    /// Cosines and sines of a chunk of pixels.
    #[inline(always)]
    pub fn chunk(&self, first: usize) -> [&[f32; CHUNK]; 2] {
        [&self.cos, &self.sin].map(|all| all[first..].first_chunk().expect("zeros behind the last"))
    }
}

impl SurfaceGrid {
    /// About `pixels` pixels of equal area.
    pub fn equal_area(pixels: usize, quadrature: Quadrature) -> Self {
        let n_rings = ((FRAC_PI_4 * pixels as f64).sqrt().round() as usize).max(2);
        let counts: Vec<usize> = (0..n_rings)
            .map(|i| {
                let latitude = PI * ((i as f64 + 0.5) / n_rings as f64) - FRAC_PI_2;
                ((2 * n_rings) as f64 * latitude.cos()).round().max(3.0) as usize
            })
            .collect();
        let total: usize = counts.iter().sum();
        let area = 1.0 / total as f64;
        let mut grid = SurfaceGrid {
            longitude: Vec::with_capacity(total),
            latitude: Vec::with_capacity(total),
            area: vec![area; total],
            directions: Directions::default(),
            rings: Vec::with_capacity(n_rings),
        };
        for &count in &counts {
            grid.push_ring(count, area, quadrature);
        }
        grid.directions = Directions::of(&grid.longitude);
        grid
    }

    fn push_ring(&mut self, count: usize, area: f64, quadrature: Quadrature) {
        let first = self.longitude.len();
        let sin_border = |n: usize| -1.0 + 2.0 * n as f64 * area;
        let (south, north) = (sin_border(first), sin_border(first + count));
        let middle = 0.5 * (south + north);
        let width = TAU / count as f64;
        for j in 0..count {
            self.longitude.push((j as f64 + 0.5) * width);
            self.latitude.push(middle.asin());
        }
        let points = match quadrature {
            Quadrature::Centre => vec![RingPoint::new(middle, 0.0, area)],
            Quadrature::Gauss2x2 => {
                let gauss = 0.5 / 3.0_f64.sqrt();
                let (dz, dl) = (gauss * (north - south), gauss * width);
                [(-dz, -dl), (-dz, dl), (dz, -dl), (dz, dl)]
                    .map(|(z, l)| RingPoint::new(middle + z, l, 0.25 * area))
                    .to_vec()
            }
        };
        self.rings.push(Ring { pixels: first..first + count, points });
    }

    /// A grid from a table of pixel centres (rad) and area fractions, evaluated at the centres.
    pub fn from_table(longitude: Vec<f64>, latitude: Vec<f64>, area: Vec<f64>) -> Self {
        let rings = (0..longitude.len())
            .map(|p| Ring { pixels: p..p + 1, points: vec![RingPoint::new(latitude[p].sin(), 0.0, area[p])] })
            .collect();
        let directions = Directions::of(&longitude);
        SurfaceGrid { longitude, latitude, area, directions, rings }
    }

    /// Number of pixels.
    pub fn len(&self) -> usize {
        self.area.len()
    }

    /// Number of evaluation points of a pixel.
    pub(super) fn points(&self) -> usize {
        self.rings.first().map_or(1, |ring| ring.points.len())
    }

    /// Whether it has no pixel.
    pub fn is_empty(&self) -> bool {
        self.area.is_empty()
    }

    /// Mean over each pixel of a function of (longitude, latitude), by `n` x `n` midpoints in longitude and
    /// sin(latitude): the covered fraction of a pixel at the edge of a spot.
    pub fn pixel_means(&self, n: usize, f: impl Fn(f64, f64) -> f64) -> Vec<f64> {
        let of_ring = |ring: &Ring| ring.pixels.clone().map(|p| self.pixel_mean(ring, p, n, &f)).collect::<Vec<f64>>();
        self.rings.iter().flat_map(of_ring).collect()
    }

    /// The same of pixel `p` of a ring.
    pub(crate) fn pixel_mean(&self, ring: &Ring, p: usize, n: usize, f: impl Fn(f64, f64) -> f64) -> f64 {
        let ring_area: f64 = self.area[ring.pixels.clone()].iter().sum();
        let (sin_centre, width) = (self.latitude[p].sin(), TAU / ring.pixels.len() as f64);
        let offset = |i: usize| (i as f64 + 0.5) / n as f64 - 0.5;
        let mut sum = 0.0;
        for i in 0..n {
            let latitude = (sin_centre + offset(i) * 2.0 * ring_area).clamp(-1.0, 1.0).asin();
            for j in 0..n {
                sum += f(self.longitude[p] + offset(j) * width, latitude);
            }
        }
        sum / (n * n) as f64
    }

    /// Angular distance (rad) from the centres of a ring's pixels to their farthest corners.
    pub(crate) fn reach(&self, ring: &Ring) -> f64 {
        let centre = self.latitude[ring.pixels.start];
        let ring_area: f64 = self.area[ring.pixels.clone()].iter().sum();
        let half_width = PI / ring.pixels.len() as f64;
        let to_corner = |sin_border: f64| {
            let border = sin_border.clamp(-1.0, 1.0).asin();
            let cos = centre.sin() * border.sin() + centre.cos() * border.cos() * half_width.cos();
            cos.clamp(-1.0, 1.0).acos()
        };
        to_corner(centre.sin() - ring_area).max(to_corner(centre.sin() + ring_area))
    }
}

impl RingPoint {
    fn new(sin_latitude: f64, longitude_offset: f64, area: f64) -> Self {
        let cos_latitude = (1.0 - sin_latitude * sin_latitude).max(0.0).sqrt();
        RingPoint { sin_latitude, cos_latitude, longitude_offset, area }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn areas_are_equal_and_sum_to_one() {
        let grid = SurfaceGrid::equal_area(5000, Quadrature::Gauss2x2);
        assert!((grid.len() as f64 / 5000.0 - 1.0).abs() < 0.03);
        assert!((grid.area.iter().sum::<f64>() - 1.0).abs() < 1e-12);
        for ring in &grid.rings {
            let area: f64 = ring.points.iter().map(|q| q.area).sum();
            assert!((area - grid.area[ring.pixels.start]).abs() < 1e-16);
        }
    }

    #[test]
    fn pixel_means_integrate_the_sphere() {
        let grid = SurfaceGrid::equal_area(2000, Quadrature::Centre);
        // mean of sin^2 b over the sphere is 1/3; of cos l cos b it is 0
        let mean =
            |f: fn(f64, f64) -> f64| grid.pixel_means(4, f).iter().zip(&grid.area).map(|(m, a)| m * a).sum::<f64>();
        assert!((mean(|_, b| b.sin().powi(2)) - 1.0 / 3.0).abs() < 1e-4);
        assert!(mean(|l, b| l.cos() * b.cos()).abs() < 1e-12);
    }
}
