//! The files of the maps of a star: `map.json`, `profiles.csv`, `rv.csv` and `fit.json`; where there are light curves
//! also `lightcurve.csv`, and where indicators are used `indicators.csv`.

mod beside;

pub use beside::{INDICATORS, LIGHT_CURVES};

use super::atomic::{WriteError, write, write_json, write_set};
use super::csv::{DATA_SET, Table};
use super::provenance::{MeasuredSet, Provenance, Season};
use super::saved::{Saved, as_many};
use crate::maxent::entropy::Entropy;
use crate::model::ParameterValues;
use crate::numerics::json::{Part, part};
use crate::star::SurfaceGrid;
use crate::star::observation::Observations;
use crate::surface::checks::Checks;
use crate::surface::imaging::Imager;
use crate::surface::maps::TradeOffNode;
use crate::surface::nuisances::LineAndContinuum;
use crate::surface::{MEAN_FILLING, MapSummary, SpotField, SurfaceMap, SurfaceMaps};
use serde::{Deserialize, Serialize};
use std::path::Path;

/// Maps with all contents of their files.
#[derive(Clone, Debug)]
pub struct MapResult<'a> {
    /// The imager of the data.
    pub imager: &'a Imager,
    /// The data.
    pub observations: &'a Observations,
    /// The maps.
    pub maps: &'a SurfaceMaps,
    /// The true map on the imager's pixels, of the same kind, for simulated data; for several seasons in sequence.
    pub true_map: Option<&'a [f64]>,
    /// The true parameters, for simulated data.
    pub truth: Option<ParameterValues>,
    /// Why the model does not fit within the uncertainties, if it does not.
    pub diagnosis: Option<serde_json::Value>,
    /// Config, data and program.
    pub provenance: &'a Provenance,
}

/// Names of the files of these maps, in the order in which they are written.
pub fn files(maps: &SurfaceMaps) -> Vec<&'static str> {
    FILES.into_iter().chain(beside::tables(maps).into_iter().map(|(name, _)| name)).collect()
}

/// Whether a file of that name may be one of maps.
pub fn is_file(name: &str) -> bool {
    FILES.contains(&name) || [LIGHT_CURVES, INDICATORS].contains(&name)
}

/// Name of the map.
pub const MAP: &str = "map.json";

/// Name of the file with the quality of the fit.
pub const FIT: &str = "fit.json";

/// The column of `profiles.csv` and `rv.csv` with the number of the season, from 1, where there are several.
pub const SEASON: &str = "season";

/// The column of `profiles.csv` with the model of static spots, where maps evolve.
pub const UNCHANGING: &str = "unchanging_model";

/// Names of the files, in the order in which they are written.
pub const FILES: [&str; 4] = [MAP, "profiles.csv", "rv.csv", FIT];

/// The origin of longitudes, for readers without the manual.
const CONVENTIONS: &str = "psi = longitude + Omega(latitude) (t - epoch_d) is the angle from the central meridian, \
     growing towards the receding limb; Omega(latitude) = omega_eq_rad_d - domega_rad_d sin^2(latitude). Pixels of \
     equal area lie in rings from south to north; ring_pixels are their numbers, and sin(latitude) of a ring's \
     borders grows by 2 ring_pixels / pixels from -1. In a ring of n pixels, pixel j reaches from longitude 360 j / n \
     to 360 (j + 1) / n degrees.";

/// The content of `map.json`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct MapFile {
    /// The origin of longitudes, in words.
    pub conventions: String,
    /// Rotation period (d).
    pub rotation_period_d: f64,
    /// Time of rotation cycle 0 (d).
    pub epoch_d: f64,
    /// The parameters at which the star was reconstructed.
    pub parameters: ParameterValues,
    /// Brightness of a spot over that of the photosphere.
    pub contrast: f64,
    /// One entry per data set, if several, in the order of the profiles.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub data_sets: Vec<MeasuredSet>,
    /// The spots as a field, where they are modelled as one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub field: Option<SpotField>,
    /// Its mean filling factor, which is assumed: profiles do not constrain it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub mean_filling: Option<f64>,
    /// Number of pixels.
    pub pixels: usize,
    /// Number of pixels in each ring, from south to north.
    pub ring_pixels: Vec<usize>,
    /// Of the middle of each pixel.
    pub longitude_deg: Vec<f64>,
    /// Of the middle of each pixel.
    pub latitude_deg: Vec<f64>,
    /// Share of the surface of each pixel.
    pub area_fraction: Vec<f64>,
    /// The map of all times, where there is one: for several seasons their mean.
    #[serde(flatten, deserialize_with = "part", skip_serializing_if = "Option::is_none")]
    pub mean: Option<OneMap>,
    /// The maps in the order of time: one, one per season, or one at each requested time. Earlier versions wrote none.
    #[serde(default)]
    pub maps: Vec<MapAt>,
}

/// A map, and how spotted it is.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct OneMap {
    /// Fractional spot coverage; of an image of bright and dark pixels, root mean square of brightness minus 1.
    pub spottedness: f64,
    /// The same for the simulated star.
    pub true_spottedness: Option<f64>,
    /// The values of the pixels.
    #[serde(flatten)]
    pub pixels: MapColumns,
}

impl Part for OneMap {
    const KEYS: &'static [&'static str] =
        &["spottedness", "true_spottedness", "spot_filling", "true_spot_filling", "brightness", "true_brightness"];
}

/// One of the maps.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct MapAt {
    /// Its time (d), where maps evolve.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub time_d: Option<f64>,
    /// The rotation cycle.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub cycle: Option<f64>,
    /// Its season with the number of profiles, where there are several.
    #[serde(flatten, deserialize_with = "part", skip_serializing_if = "Option::is_none")]
    pub season: Option<Season>,
    /// As [`OneMap::spottedness`], for one of several seasons.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub spottedness: Option<f64>,
    /// The same for the simulated star.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub true_spottedness: Option<f64>,
    /// The values of the pixels; below 0 a spot filling factor is brighter than the photosphere.
    #[serde(flatten)]
    pub pixels: MapColumns,
    /// Standard deviation of the filling factors, for fixed hyperparameters of the field.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sigma_spot_filling: Option<Vec<f64>>,
}

/// The values of the pixels, and those of the simulated star.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(untagged)]
pub enum MapColumns {
    /// Spot filling factors.
    Spots {
        /// Of the map.
        spot_filling: Vec<f64>,
        /// Of the simulated star.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        true_spot_filling: Option<Vec<f64>>,
    },
    /// Brightness relative to the photosphere. Profiles do not constrain the scale; the entropy keeps it near 1.
    BrightAndDark {
        /// Of the map.
        brightness: Vec<f64>,
        /// Of the simulated star.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        true_brightness: Option<Vec<f64>>,
    },
}

/// The content of `fit.json`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FitFile {
    /// Quality of the fit.
    #[serde(flatten)]
    pub summary: MapSummary,
    /// The spots as a field, where they are modelled as one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub field: Option<SpotField>,
    /// One entry per profile, in the order of the list.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub nuisances: Vec<LineAndContinuum>,
    /// The same for the RV offset of each profile due to jitter.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub zero_points_kms: Vec<f64>,
    /// The true parameters, for simulated data.
    pub truth: Option<ParameterValues>,
    /// Whether the residuals look like noise.
    pub checks: Checks,
    /// Why the model does not fit within the uncertainties, if it does not.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub diagnosis: Option<serde_json::Value>,
    /// Images at other chi2, where there is a target.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub trade_off: Vec<TradeOffNode>,
    /// Remarks on maps and times.
    #[serde(default)]
    pub warnings: Vec<String>,
    /// Config, data and program.
    #[serde(flatten)]
    pub provenance: Provenance,
}

impl Saved for FitFile {}

impl Saved for MapFile {
    fn check(&self) -> Result<(), String> {
        let n = self.pixels;
        let columns = [
            ("longitude_deg", &self.longitude_deg),
            ("latitude_deg", &self.latitude_deg),
            ("area_fraction", &self.area_fraction),
        ];
        columns.into_iter().try_for_each(|(key, column)| as_many(key, column.len(), n, "pixels"))?;
        let in_rings = self.ring_pixels.iter().try_fold(0usize, |sum, ring| sum.checked_add(*ring)).unwrap_or(0);
        as_many("ring_pixels", in_rings, n, "pixels")?;
        if self.ring_pixels.contains(&0) || n == 0 {
            return Err("ring_pixels: a ring without a pixel".into());
        }
        let maps = self.maps.iter().flat_map(|map| map.pixels.columns().into_iter().chain(&map.sigma_spot_filling));
        let of_mean = self.mean.iter().flat_map(|mean| mean.pixels.columns());
        maps.chain(of_mean).try_for_each(|column| as_many("maps", column.len(), n, "pixels"))
    }
}

/// Additional columns of profiles where there are several seasons or data sets, each with the number of each profile,
/// from 1.
fn beside(imager: &Imager) -> Vec<(&'static str, Vec<usize>)> {
    let seasons = imager.map_of_each().into_iter().map(|map| map + 1).collect();
    let columns: [(_, Vec<usize>); 2] = [(SEASON, seasons), (DATA_SET, imager.set_of_each())];
    columns.into_iter().filter(|(_, numbers)| !numbers.is_empty()).collect()
}

impl MapColumns {
    /// The existing ones.
    fn columns(&self) -> Vec<&Vec<f64>> {
        let (MapColumns::Spots { spot_filling: own, true_spot_filling: truth }
        | MapColumns::BrightAndDark { brightness: own, true_brightness: truth }) = self;
        std::iter::once(own).chain(truth).collect()
    }

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
        write_set(folder, &|stage| self.fill(stage))?;
        // files of earlier maps that these do not have
        let files = files(self.maps);
        for name in [LIGHT_CURVES, INDICATORS].into_iter().filter(|name| !files.contains(name)) {
            let path = folder.join(name);
            match std::fs::remove_file(&path) {
                Err(source) if source.kind() != std::io::ErrorKind::NotFound => {
                    return Err(WriteError { path, source });
                }
                _ => {}
            }
        }
        Ok(())
    }

    fn fill(&self, folder: &Path) -> Result<(), WriteError> {
        let [map, profiles, rv, fit] = FILES.map(|name| folder.join(name));
        write_json(&map, &self.map())?;
        write(&profiles, &self.profiles().into_bytes())?;
        write(&rv, &self.velocities().into_bytes())?;
        write_json(&fit, &self.fit())?;
        beside::tables(self.maps)
            .into_iter()
            .try_for_each(|(name, table)| write(&folder.join(name), &table.into_bytes()))
    }

    fn map(&self) -> MapFile {
        let MapResult { imager, maps: SurfaceMaps { maps, summary, field, .. }, true_map, .. } = *self;
        let SurfaceGrid { longitude, latitude, area, rings, .. } = &imager.grid;
        let degrees = |angles: &[f64]| angles.iter().map(|x| x.to_degrees()).collect();
        let (n, entropy) = (imager.grid.len(), imager.entropy);
        let mean = |maps: &[&[f64]]| -> Vec<f64> {
            (0..n).map(|p| maps.iter().map(|map| map[p]).sum::<f64>() / maps.len() as f64).collect()
        };
        let all: Vec<&[f64]> = maps.iter().map(|map| &map.pixels[..]).collect();
        let one_map = summary.image.as_ref().map(|image| OneMap {
            spottedness: image.spottedness,
            true_spottedness: true_map.map(|map| entropy.spottedness(map, &imager.areas)),
            pixels: MapColumns::of(entropy, mean(&all), true_map.map(|map| mean(&map.chunks(n).collect::<Vec<_>>()))),
        });
        let seasons = &self.provenance.measured.seasons;
        let map_at = |(k, SurfaceMap { time_d, pixels, sigma }): (usize, &SurfaceMap)| {
            let season = seasons.get(k).filter(|_| time_d.is_none()).copied();
            let truth = true_map.filter(|_| season.is_some()).map(|map| map[k * n..(k + 1) * n].to_vec());
            MapAt {
                time_d: *time_d,
                cycle: time_d.map(|time_d| imager.star.cycle(time_d)),
                season,
                spottedness: season.map(|_| entropy.spottedness(pixels, area)),
                true_spottedness: truth.as_ref().map(|map| entropy.spottedness(map, area)),
                // a map with a standard deviation has filling factors, whatever the brightness of pixels may be
                pixels: match sigma {
                    Some(_) => MapColumns::Spots { spot_filling: pixels.clone(), true_spot_filling: None },
                    None => MapColumns::of(entropy, pixels.clone(), truth),
                },
                sigma_spot_filling: sigma.clone(),
            }
        };
        MapFile {
            conventions: CONVENTIONS.into(),
            rotation_period_d: imager.star.rotation_period_d,
            epoch_d: imager.star.epoch_d,
            parameters: summary.parameters,
            contrast: summary.contrast,
            data_sets: self.provenance.measured.sets.clone(),
            field: field.clone(),
            mean_filling: field.as_ref().map(|_| MEAN_FILLING),
            pixels: n,
            ring_pixels: rings.iter().map(|ring| ring.pixels.len()).collect(),
            longitude_deg: degrees(longitude),
            latitude_deg: degrees(latitude),
            area_fraction: area.clone(),
            mean: one_map,
            maps: maps.iter().enumerate().map(map_at).collect(),
        }
    }

    fn profiles(&self) -> Table {
        let columns = ["profile", "time_d", "cycle", "velocity_kms", "observed", "sigma", "model", "residual"];
        let of_static = self.maps.static_model.as_ref();
        let beside = beside(self.imager);
        let more = of_static.map(|_| UNCHANGING).into_iter().chain(beside.iter().map(|(name, _)| *name));
        let mut table = Table::new(&columns.into_iter().chain(more).collect::<Vec<_>>());
        for (k, (profile, model)) in self.observations.profiles.iter().zip(&self.maps.model).enumerate() {
            let cycle = self.imager.star.cycle(profile.time_d);
            for (j, model) in model.iter().enumerate() {
                let velocity = profile.velocity_kms(j);
                let (observed, sigma) = (profile.intensity[j], profile.sigma[j]);
                let mut row =
                    vec![k as f64, profile.time_d, cycle, velocity, observed, sigma, *model, observed - model];
                row.extend(of_static.map(|of_static| of_static[k][j]));
                row.extend(beside.iter().map(|(_, of)| of[k] as f64));
                table.row(&row);
            }
        }
        table
    }

    fn velocities(&self) -> Table {
        let marginalised = self.maps.velocities.iter().any(|v| v.marginalised_kms.is_some());
        let free: &[&str] = if marginalised { &["rv_kms", "rv_sigma_kms"] } else { &["filtered_kms"] };
        let columns = ["time_d", "cycle", "observed_kms", "sigma_kms", "modelled_kms", "orbit_kms"];
        let beside = beside(self.imager);
        let names = columns.iter().chain(free).copied().chain(beside.iter().map(|(name, _)| *name));
        let mut table = Table::new(&names.collect::<Vec<_>>());
        for (k, v) in self.maps.velocities.iter().enumerate() {
            let m = &v.moments;
            let (value_kms, sigma_kms) = (m.observed.value_kms, m.observed.sigma_kms);
            let mut row = vec![m.time_d, m.cycle, value_kms, sigma_kms, m.modelled_kms, m.orbit_kms];
            row.extend(v.marginalised_kms.map_or(vec![m.filtered_kms()], |rv| rv.to_vec()));
            row.extend(beside.iter().map(|(_, of)| of[k] as f64));
            table.row(&row);
        }
        table
    }

    fn fit(&self) -> FitFile {
        let SurfaceMaps { summary, field, nuisances, zero_points_kms, checks, trade_off, warnings, .. } = self.maps;
        FitFile {
            summary: summary.clone(),
            field: field.clone(),
            nuisances: nuisances.clone(),
            zero_points_kms: zero_points_kms.clone(),
            truth: self.truth,
            checks: checks.clone(),
            diagnosis: self.diagnosis.clone(),
            trade_off: trade_off.clone(),
            warnings: warnings.clone(),
            provenance: self.provenance.clone(),
        }
    }
}
