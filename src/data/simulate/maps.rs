//! Maps of a simulated star: the mean over each pixel of spots and faculae. With evolving spots, pixels are recomputed
//! only where a spot appears or disappears.

use super::Simulation;
use crate::star::grid::Ring;
use crate::star::spots::{excess_at, filling_at, spots_at};
use crate::star::{Brightness, Disc, Facula, Spot, SurfaceGrid};
use nalgebra::DMatrix;
use rayon::prelude::*;

/// Sampling points along each side of a pixel.
const COVERAGE_POINTS: usize = 8;

/// The content of a map.
#[derive(Clone, Copy)]
pub(super) enum Content {
    /// Spot filling factors.
    Filling,
    /// Brightness over that of the photosphere; with the given brightness of spots.
    Brightness(Brightness),
}

/// The features on the star.
#[derive(Clone, Default)]
struct Features {
    spots: Vec<Spot>,
    faculae: Vec<Facula>,
}

impl Features {
    /// Those that may overlap something at (longitude, latitude) that extends to `reach` (all rad).
    fn near(&self, longitude: f64, latitude: f64, reach: f64) -> Self {
        let spots = self.spots.iter().filter(|spot| spot.may_touch(longitude, latitude, reach));
        let faculae = self.faculae.iter().filter(|facula| facula.disc.may_touch(longitude, latitude, reach));
        Features { spots: spots.copied().collect(), faculae: faculae.copied().collect() }
    }

    /// Those that may overlap something at that latitude.
    fn beside(&self, latitude: f64, reach: f64) -> Self {
        let is_beside = |disc: Disc| disc.may_touch(disc.longitude, latitude, reach);
        let spots = self.spots.iter().filter(|spot| is_beside(spot.disc()));
        let faculae = self.faculae.iter().filter(|facula| is_beside(facula.disc));
        Features { spots: spots.copied().collect(), faculae: faculae.copied().collect() }
    }

    fn is_empty(&self) -> bool {
        self.spots.is_empty() && self.faculae.is_empty()
    }

    /// Whether there are any of these.
    fn may_touch(&self, longitude: f64, latitude: f64, reach: f64) -> bool {
        self.spots.iter().any(|spot| spot.may_touch(longitude, latitude, reach))
            || self.faculae.iter().any(|facula| facula.disc.may_touch(longitude, latitude, reach))
    }

    /// The mean over a pixel.
    fn of_pixel(&self, content: Content, grid: &SurfaceGrid, ring: &Ring, p: usize) -> f64 {
        let mean = |f: &dyn Fn(f64, f64) -> f64| grid.pixel_mean(ring, p, COVERAGE_POINTS, f);
        let filling = mean(&|longitude, latitude| filling_at(&self.spots, longitude, latitude));
        match content {
            Content::Filling => filling,
            Content::Brightness(of_spots) if self.faculae.is_empty() => of_spots.at(filling),
            Content::Brightness(of_spots) => {
                let excess = |longitude, latitude| excess_at(&self.faculae, &self.spots, longitude, latitude);
                of_spots.at(filling) + mean(&excess)
            }
        }
    }

    /// Updates a map in all pixels that one of the `changed` may overlap.
    fn onto(&self, map: &mut [f64], content: Content, grid: &SurfaceGrid, changed: &Features) {
        for ring in &grid.rings {
            let (latitude, reach) = (grid.latitude[ring.pixels.start], grid.reach(ring));
            let changed = changed.beside(latitude, reach);
            if changed.is_empty() {
                continue;
            }
            let all = self.beside(latitude, reach);
            for p in ring.pixels.clone() {
                let longitude = grid.longitude[p];
                if changed.may_touch(longitude, latitude, reach) {
                    map[p] = all.near(longitude, latitude, reach).of_pixel(content, grid, ring, p);
                }
            }
        }
    }
}

impl Simulation {
    /// Whether spots evolve.
    pub fn is_changing(&self) -> bool {
        self.spots.iter().any(|spot| spot.life.is_some())
    }

    /// A map for each of `times_d` (pixels, times).
    pub(super) fn maps(&self, content: Content, grid: &SurfaceGrid, times_d: &[f64]) -> DMatrix<f64> {
        let (for_ever, changing): (Vec<Spot>, Vec<Spot>) = self.spots.iter().partition(|spot| spot.life.is_none());
        let unchanging = Features { spots: for_ever, faculae: self.faculae.clone() };
        let empty = match content {
            Content::Filling => 0.0,
            Content::Brightness(_) => 1.0,
        };
        let mut still = vec![empty; grid.len()];
        unchanging.onto(&mut still, content, grid, &unchanging);
        let at = |time_d: &f64| {
            let changed = Features { spots: spots_at(&changing, *time_d), faculae: Vec::new() };
            let spots = unchanging.spots.iter().chain(&changed.spots).copied().collect();
            let mut map = still.clone();
            Features { spots, faculae: self.faculae.clone() }.onto(&mut map, content, grid, &changed);
            map
        };
        let maps: Vec<Vec<f64>> = times_d.par_iter().map(at).collect();
        DMatrix::from_iterator(grid.len(), times_d.len(), maps.into_iter().flatten())
    }

    /// The middle of the data (d).
    pub fn mid_time_d(&self) -> f64 {
        let first = self.times_d.iter().copied().fold(f64::INFINITY, f64::min);
        let last = self.times_d.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        0.5 * (first + last)
    }

    /// The true map at a time (d): spot filling factor of each pixel of `grid`, the fraction that spots cover times
    /// their own filling.
    pub fn spot_filling_at(&self, grid: &SurfaceGrid, time_d: f64) -> Vec<f64> {
        self.maps(Content::Filling, grid, &[time_d]).as_slice().to_vec()
    }

    /// The same in the middle of the data.
    pub fn spot_filling(&self, grid: &SurfaceGrid) -> Vec<f64> {
        self.spot_filling_at(grid, self.mid_time_d())
    }

    /// The true brightness of each pixel of `grid` at a time (d), that of the photosphere being 1 and that of spots
    /// `contrast`.
    pub fn brightness_at(&self, grid: &SurfaceGrid, contrast: f64, time_d: f64) -> Vec<f64> {
        self.maps(Content::Brightness(Brightness::of_spots(contrast)), grid, &[time_d]).as_slice().to_vec()
    }

    /// The same in the middle of the data.
    pub fn brightness(&self, grid: &SurfaceGrid, contrast: f64) -> Vec<f64> {
        self.brightness_at(grid, contrast, self.mid_time_d())
    }

    /// Fractional spot coverage at the time of each profile.
    pub fn coverage(&self, grid: &SurfaceGrid) -> Vec<f64> {
        let maps = self.maps(Content::Filling, grid, &self.times_d);
        maps.column_iter().map(|map| map.iter().zip(&grid.area).map(|(s, a)| s * a).sum()).collect()
    }
}
