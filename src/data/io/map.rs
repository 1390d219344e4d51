//! The files of one reconstruction: `map.json`, `profiles.csv`, `rv.csv` and `fit.json`. Those of a star that may
//! change are in `changing`.

mod changing;

pub use changing::{ChangingFitFile, ChangingMapFile, ChangingMapResult, MapKind, UNCHANGING};

use super::atomic::{WriteError, write, write_json};
use super::csv::Table;
use super::provenance::Provenance;
use crate::maxent::entropy::Entropy;
use crate::posterior::fit::{Checks, Fit, FitSummary};
use crate::posterior::imaging::Imager;
use crate::posterior::nuisances::LineAndContinuum;
use crate::posterior::objective::ParameterValues;
use crate::star::SurfaceGrid;
use crate::star::observation::Observations;
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
    /// The true map on the imager's pixels, of the same kind, for simulated data.
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
        let coverage = |map: &[f64]| map.iter().zip(area).map(|(s, a)| s * a).sum();
        let entropy = self.imager.entropy;
        let (true_spottedness, map) = match entropy {
            Entropy::Spots { .. } => {
                let columns =
                    MapColumns::Spots { spot_filling: map.to_vec(), true_spot_filling: true_map.map(<[f64]>::to_vec) };
                (true_map.map(coverage), columns)
            }
            Entropy::BrightAndDark => {
                let deviation = true_map.map(|map| entropy.spottedness(map, area));
                let true_brightness = true_map.map(<[f64]>::to_vec);
                (deviation, MapColumns::BrightAndDark { brightness: map.to_vec(), true_brightness })
            }
        };
        MapFile {
            conventions: CONVENTIONS.into(),
            rotation_period_d: self.imager.star.rotation_period_d,
            epoch_d: self.imager.star.epoch_d,
            parameters: self.fit.summary.parameters,
            contrast: self.fit.summary.contrast,
            spottedness: self.fit.summary.spottedness,
            true_spottedness,
            pixels: self.imager.grid.len(),
            ring_pixels: rings.iter().map(|ring| ring.pixels.len()).collect(),
            longitude_deg: degrees(longitude),
            latitude_deg: degrees(latitude),
            area_fraction: area.clone(),
            map,
        }
    }

    fn profiles(&self) -> Table {
        let columns = ["profile", "time_d", "cycle", "velocity_kms", "observed", "sigma", "model", "residual"];
        let mut table = Table::new(&columns);
        for (k, (profile, model)) in self.observations.profiles.iter().zip(&self.fit.model).enumerate() {
            let cycle = self.imager.star.cycle(profile.time_d);
            for (j, model) in model.iter().enumerate() {
                let velocity = profile.velocity_kms(j);
                let (observed, sigma) = (profile.intensity[j], profile.sigma[j]);
                let residual = observed - model;
                table.row(&[k as f64, profile.time_d, cycle, velocity, observed, sigma, *model, residual]);
            }
        }
        table
    }

    fn velocities(&self) -> Table {
        let columns = ["time_d", "cycle", "observed_kms", "sigma_kms", "modelled_kms", "orbit_kms", "filtered_kms"];
        let mut table = Table::new(&columns);
        for v in &self.fit.velocities {
            let observed = v.observed;
            let (modelled, filtered) = (v.modelled_kms, v.filtered_kms());
            table.row(&[v.time_d, v.cycle, observed.value_kms, observed.sigma_kms, modelled, v.orbit_kms, filtered]);
        }
        table
    }

    fn fit(&self) -> FitFile {
        let node = |n: &crate::posterior::objective::tradeoff::Node| TradeOffNode {
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
