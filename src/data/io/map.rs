//! The files of one reconstruction: `map.json`, `profiles.csv`, `rv.csv` and `fit.json`. Those of a star that may
//! change are in `changing`.

mod changing;
mod light;

pub use changing::{ChangingFitFile, ChangingMapFile, ChangingMapResult, MapKind, UNCHANGING};
pub use light::LIGHT_CURVES;

use super::atomic::{WriteError, write, write_json};
use super::csv::{DATA_SET, Table};
use super::provenance::{MeasuredSet, Provenance, Season};
use crate::maxent::entropy::Entropy;
use crate::model::ParameterValues;
use crate::star::SurfaceGrid;
use crate::star::observation::Observations;
use crate::surface::fit::{Checks, Fit, FitSummary};
use crate::surface::imaging::Imager;
use crate::surface::nuisances::LineAndContinuum;
use serde::{Deserialize, Serialize};
use std::path::Path;

/// A reconstruction with all that its files say of it.
#[derive(Clone, Debug)]
pub struct MapResult<'a> {
    /// What the data were imaged with.
    pub imager: &'a Imager,
    /// The data.
    pub observations: &'a Observations,
    /// The reconstruction.
    pub fit: &'a Fit,
    /// The true map on the imager's pixels, of the same kind, for simulated data; of several seasons one after the
    /// other.
    pub true_map: Option<&'a [f64]>,
    /// The true parameters, for simulated data.
    pub truth: Option<ParameterValues>,
    /// Why the model does not fit as well as the errors promise, if it does not.
    pub diagnosis: Option<serde_json::Value>,
    /// Config, data and program.
    pub provenance: &'a Provenance,
}

/// Name of the map.
pub const MAP: &str = "map.json";

/// Name of what says how good it is.
pub const FIT: &str = "fit.json";

/// The column of `profiles.csv` and `rv.csv` with the number of the season, from 1, where there are several.
pub const SEASON: &str = "season";

/// Names of the files, in the order in which they are written.
pub const FILES: [&str; 4] = [MAP, "profiles.csv", "rv.csv", FIT];

/// Where longitudes count from, for those who read the file without the manual.
const CONVENTIONS: &str = "psi = longitude + Omega(latitude) (t - epoch_d) is the angle from the central meridian, \
growing \
                           towards the receding limb; Omega(latitude) = omega_eq_rad_d - domega_rad_d \
                           sin^2(latitude). Pixels of \
                           equal area stand in rings from south to north; ring_pixels are their numbers, and \
                           sin(latitude) of a \
                           ring's borders grows by 2 ring_pixels / pixels from -1. In a ring of n pixels, pixel j \
                           reaches from \
                           longitude 360 j / n to 360 (j + 1) / n degrees.";

/// The content of `map.json`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct MapFile {
    /// Where longitudes count from, in words.
    pub conventions: String,
    /// Rotation period (d).
    pub rotation_period_d: f64,
    /// Time of rotation cycle 0 (d).
    pub epoch_d: f64,
    /// The parameters at which the star was reconstructed.
    pub parameters: ParameterValues,
    /// Brightness of a spot over that of the photosphere.
    pub contrast: f64,
    /// Each of several data sets, in the order of the profiles.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub data_sets: Vec<MeasuredSet>,
    /// As [`FitSummary::spottedness`].
    pub spottedness: f64,
    /// The same of the star that was simulated.
    pub true_spottedness: Option<f64>,
    /// Number of pixels.
    pub pixels: usize,
    /// The same in each ring, from south to north.
    pub ring_pixels: Vec<usize>,
    /// Of the middle of each pixel.
    pub longitude_deg: Vec<f64>,
    /// Of the middle of each pixel.
    pub latitude_deg: Vec<f64>,
    /// Share of the surface of each pixel.
    pub area_fraction: Vec<f64>,
    /// What the pixels hold; of several seasons the mean over them.
    #[serde(flatten)]
    pub map: MapColumns,
    /// The maps of several seasons, in the order of time.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub seasons: Vec<SeasonMap>,
}

/// The map of one of several seasons.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SeasonMap {
    /// When it was, and how often the star was seen.
    #[serde(flatten)]
    pub season: Season,
    /// As [`FitSummary::spottedness`], of this map.
    pub spottedness: f64,
    /// The same of the star that was simulated.
    pub true_spottedness: Option<f64>,
    /// What the pixels hold.
    #[serde(flatten)]
    pub map: MapColumns,
}

/// What the pixels hold, and what those of the star that was simulated do.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(untagged)]
pub enum MapColumns {
    /// Spot filling factors.
    Spots {
        /// Of the map.
        spot_filling: Vec<f64>,
        /// Of the star that was simulated.
        true_spot_filling: Option<Vec<f64>>,
    },
    /// Brightness relative to the photosphere. Profiles say nothing of the scale; the entropy has it near 1.
    BrightAndDark {
        /// Of the map.
        brightness: Vec<f64>,
        /// Of the star that was simulated.
        true_brightness: Option<Vec<f64>>,
    },
}

/// The content of `fit.json`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FitFile {
    /// How good the fit is.
    #[serde(flatten)]
    pub summary: FitSummary,
    /// One entry a profile, in the order of the list.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub nuisances: Vec<LineAndContinuum>,
    /// The same for the zero point of its velocity.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub zero_points_kms: Vec<f64>,
    /// The true parameters, for simulated data.
    pub truth: Option<ParameterValues>,
    /// Whether what is left over looks like noise.
    pub checks: Checks,
    /// Why the model does not fit as well as the errors promise, if it does not.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub diagnosis: Option<serde_json::Value>,
    /// Images of other chi2.
    pub trade_off: Vec<TradeOffNode>,
    /// Config, data and program.
    #[serde(flatten)]
    pub provenance: Provenance,
}

/// One image on the trade-off curve.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct TradeOffNode {
    /// Lagrange multiplier of chi2 / 2.
    pub lambda: f64,
    /// chi2.
    pub chi2: f64,
    /// Spottedness.
    pub spottedness: f64,
    /// Entropy.
    pub entropy: f64,
}

/// Columns that profiles have beside the others where there are several seasons or data sets, each with the number of
/// each profile, from 1.
fn beside(imager: &Imager) -> Vec<(&'static str, Vec<usize>)> {
    let seasons = imager.map_of_each().into_iter().map(|map| map + 1).collect();
    let columns: [(_, Vec<usize>); 2] = [(SEASON, seasons), (DATA_SET, imager.set_of_each())];
    columns.into_iter().filter(|(_, numbers)| !numbers.is_empty()).collect()
}

impl MapColumns {
    fn of(entropy: Entropy, map: Vec<f64>, true_map: Option<Vec<f64>>) -> Self {
        match entropy {
            Entropy::Spots { .. } => MapColumns::Spots { spot_filling: map, true_spot_filling: true_map },
            Entropy::BrightAndDark => MapColumns::BrightAndDark { brightness: map, true_brightness: true_map },
        }
    }
}

impl MapResult<'_> {
    /// Writes all files into `folder`, which must exist.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn write(&self, folder: &Path) -> Result<(), WriteError> {
        let [map, profiles, rv, fit] = FILES.map(|name| folder.join(name));
        write_json(&map, &self.map())?;
        write(&profiles, &self.profiles().into_bytes())?;
        write(&rv, &self.velocities().into_bytes())?;
        write_json(&fit, &self.fit())
    }

    fn map(&self) -> MapFile {
        let SurfaceGrid { longitude, latitude, area, rings, .. } = &self.imager.grid;
        let degrees = |angles: &[f64]| angles.iter().map(|x| x.to_degrees()).collect();
        let (map, true_map) = (&self.fit.map[..], self.true_map);
        let (n, entropy) = (self.imager.grid.len(), self.imager.entropy);
        let of_season = |(k, season): (usize, &Season)| {
            let of = |maps: &[f64]| maps[k * n..(k + 1) * n].to_vec();
            let (map, true_map) = (of(map), true_map.map(of));
            SeasonMap {
                season: *season,
                spottedness: entropy.spottedness(&map, area),
                true_spottedness: true_map.as_ref().map(|map| entropy.spottedness(map, area)),
                map: MapColumns::of(entropy, map, true_map),
            }
        };
        let mean = |maps: &[f64]| {
            let of_pixel = |p: usize| maps[p..].iter().step_by(n).sum::<f64>() / (maps.len() / n) as f64;
            (0..n).map(of_pixel).collect()
        };
        MapFile {
            conventions: CONVENTIONS.into(),
            rotation_period_d: self.imager.star.rotation_period_d,
            epoch_d: self.imager.star.epoch_d,
            parameters: self.fit.summary.parameters,
            contrast: self.fit.summary.contrast,
            data_sets: self.provenance.measured.sets.clone(),
            spottedness: self.fit.summary.spottedness,
            true_spottedness: true_map.map(|map| entropy.spottedness(map, &self.imager.areas)),
            pixels: self.imager.grid.len(),
            ring_pixels: rings.iter().map(|ring| ring.pixels.len()).collect(),
            longitude_deg: degrees(longitude),
            latitude_deg: degrees(latitude),
            area_fraction: area.clone(),
            map: MapColumns::of(entropy, mean(map), true_map.map(mean)),
            seasons: self.provenance.measured.seasons.iter().enumerate().map(of_season).collect(),
        }
    }

    fn profiles(&self) -> Table {
        let columns = ["profile", "time_d", "cycle", "velocity_kms", "observed", "sigma", "model", "residual"];
        let beside = beside(self.imager);
        let names = columns.into_iter().chain(beside.iter().map(|(name, _)| *name));
        let mut table = Table::new(&names.collect::<Vec<_>>());
        for (k, (profile, model)) in self.observations.profiles.iter().zip(&self.fit.model).enumerate() {
            let cycle = self.imager.star.cycle(profile.time_d);
            for (j, model) in model.iter().enumerate() {
                let velocity = profile.velocity_kms(j);
                let (observed, sigma) = (profile.intensity[j], profile.sigma[j]);
                let residual = observed - model;
                let row = [k as f64, profile.time_d, cycle, velocity, observed, sigma, *model, residual];
                table.row(&row.into_iter().chain(beside.iter().map(|(_, of)| of[k] as f64)).collect::<Vec<_>>());
            }
        }
        table
    }

    fn velocities(&self) -> Table {
        let columns = ["time_d", "cycle", "observed_kms", "sigma_kms", "modelled_kms", "orbit_kms", "filtered_kms"];
        let beside = beside(self.imager);
        let names = columns.into_iter().chain(beside.iter().map(|(name, _)| *name));
        let mut table = Table::new(&names.collect::<Vec<_>>());
        for (k, v) in self.fit.velocities.iter().enumerate() {
            let observed = v.observed;
            let (modelled, filtered) = (v.modelled_kms, v.filtered_kms());
            let row = [v.time_d, v.cycle, observed.value_kms, observed.sigma_kms, modelled, v.orbit_kms, filtered];
            table.row(&row.into_iter().chain(beside.iter().map(|(_, of)| of[k] as f64)).collect::<Vec<_>>());
        }
        table
    }

    fn fit(&self) -> FitFile {
        let node = |n: &crate::surface::static_map::tradeoff::Node| TradeOffNode {
            lambda: n.lambda,
            chi2: n.chi2,
            spottedness: n.spottedness,
            entropy: n.entropy,
        };
        FitFile {
            summary: self.fit.summary.clone(),
            nuisances: self.fit.nuisances.clone(),
            zero_points_kms: self.fit.zero_points_kms.clone(),
            truth: self.truth,
            checks: self.fit.checks.clone(),
            diagnosis: self.diagnosis.clone(),
            trade_off: self.fit.tradeoff.iter().map(node).collect(),
            provenance: self.provenance.clone(),
        }
    }
}
