//! The truth of simulated observations: maps and parameters to compare with results.

use super::Scene;
use crate::data::io::provenance::Season;
use crate::data::io::truth::Truth;
use crate::data::simulate::Simulation;
use crate::model::Parameter;
use crate::star::{BrightnessModel, Quadrature, Spot, SurfaceGrid};
use std::collections::BTreeMap;
use std::f64::consts::TAU;

impl Scene {
    /// The true spot map on the pixels of the image, if the observations are simulated; for evolving spots in the
    /// middle of the data.
    #[doc(hidden)]
    pub fn true_spot_filling(&self) -> Option<Vec<f64>> {
        self.simulation().map(|simulation| simulation.spot_filling(&self.imager.grid))
    }

    /// The true values of the pixels of the image, if the observations are simulated; for evolving spots in the middle
    /// of the data. The maps of several seasons, each in its middle, follow one another.
    #[doc(hidden)]
    pub fn true_map(&self) -> Option<Vec<f64>> {
        let of_season = |season: &Season| {
            let map = self.true_map_at(0.5 * (season.first_d + season.last_d))?;
            Some(self.turned(&map, season.epoch_d - self.imager.star.epoch_d))
        };
        match &self.measured.seasons[..] {
            [] => self.true_map_at(self.simulation()?.mid_time_d()),
            seasons => Some(seasons.iter().map(of_season).collect::<Option<Vec<_>>>()?.concat()),
        }
    }

    /// A map with the origin of longitudes shifted by this many days, interpolated linearly between pixels.
    fn turned(&self, map: &[f64], days: f64) -> Vec<f64> {
        let rotation = self.truth.unwrap_or(self.settings.values).state().rotation;
        let SurfaceGrid { rings, latitude, .. } = &self.imager.grid;
        let mut turned = vec![0.0; map.len()];
        for pixels in rings.iter().map(|ring| ring.pixels.clone()) {
            let (ring, n) = (&map[pixels.clone()], pixels.len());
            let angle = rotation.angular_velocity(latitude[pixels.start].sin()) * days;
            let behind = angle.rem_euclid(TAU) / TAU * n as f64;
            let (whole, share) = (behind.floor() as usize, behind.fract());
            for (j, pixel) in turned[pixels].iter_mut().enumerate() {
                let there = j + 2 * n - whole;
                *pixel = (1.0 - share) * ring[there % n] + share * ring[(there - 1) % n];
            }
        }
        turned
    }

    /// The same at a time (d).
    #[doc(hidden)]
    pub fn true_map_at(&self, time_d: f64) -> Option<Vec<f64>> {
        let (simulation, grid) = (self.simulation()?, &self.imager.grid);
        Some(match self.settings.imaging.brightness() {
            BrightnessModel::Spots => simulation.spot_filling_at(grid, time_d),
            BrightnessModel::BrightAndDark => {
                simulation.brightness_at(grid, simulation.contrast(&self.imager.star), time_d)
            }
        })
    }

    fn simulation(&self) -> Option<&Simulation> {
        self.settings.sets[0].simulation()
    }

    /// The truth of the scene's `simulation`.
    #[doc(hidden)]
    pub fn truth_of(&self, simulation: &Simulation) -> Truth {
        let grid = SurfaceGrid::equal_area(simulation.pixels, Quadrature::Gauss2x2);
        let coverage = match simulation.is_changing() {
            true => simulation.coverage(&grid),
            false => Vec::new(),
        };
        let spottedness = match coverage.len() {
            0 => simulation.spot_filling(&grid).iter().zip(&grid.area).map(|(s, a)| s * a).sum(),
            profiles => coverage.iter().sum::<f64>() / profiles as f64,
        };
        let state = simulation.truth.state();
        let velocity = |time: &f64| state.vsys_kms + state.motion.velocity_kms(self.imager.star.cycle(*time));
        Truth {
            parameters: simulation.truth,
            spots: simulation.spots.iter().map(Spot::written).collect(),
            faculae: self.settings.faculae_as_written(),
            contrast: (!simulation.faculae.is_empty()).then(|| simulation.contrast(&self.imager.star)),
            continuum: simulation.nuisances(),
            zero_points_kms: simulation.zero_points_kms(),
            zero_point_kms: Some(simulation.zero_point_kms).filter(|kms| *kms != 0.0),
            correlated_bins: Some(simulation.correlated_bins).filter(|bins| *bins != 1.0),
            spottedness,
            coverage,
            snr: simulation.snr,
            sigma: simulation.sigma(),
            seed: simulation.seed,
            pixels: grid.len(),
            orbit_kms: simulation.times_d.iter().map(velocity).collect(),
            times_d: simulation.times_d.clone(),
            provenance: self.provenance(),
        }
    }

    /// The simulated values by name, with ephemerides where the config gives them.
    #[doc(hidden)]
    pub fn named_truth(&self) -> Option<BTreeMap<String, f64>> {
        let truth = self.truth?;
        let own = Parameter::ALL.into_iter().filter_map(|p| Some((p, truth.get(p)?)));
        let named = self.space.free().iter().filter(|f| f.parameter.is_ephemeris());
        let named = named.filter_map(|f| Some((f.parameter, self.space.value_among(f, &truth)?)));
        Some(own.chain(named).map(|(p, value)| (p.name().to_owned(), value)).collect())
    }
}
