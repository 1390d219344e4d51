//! The files of the maps of a star that may change, under the names of those of one that does not: `map.json`,
//! `profiles.csv`, `rv.csv` and `fit.json`; where there are light curves `lightcurve.csv`, too.

use super::light::{LIGHT_CURVES, table};
use super::{CONVENTIONS, FILES, beside};
use crate::data::io::atomic::{WriteError, write, write_json};
use crate::data::io::csv::Table;
use crate::data::io::field::FieldRecord;
use crate::data::io::provenance::{MeasuredSet, Provenance};
use crate::model::ParameterValues;
use crate::star::SurfaceGrid;
use crate::star::observation::Observations;
use crate::surface::evolving_map::MEAN_FILLING;
use crate::surface::fit::{ChangingFit, ChangingSummary, Checks, MapAt};
use crate::surface::imaging::Imager;
use crate::surface::nuisances::LineAndContinuum;
use serde::de::IgnoredAny;
use serde::{Deserialize, Serialize};
use std::path::Path;

/// The column of `profiles.csv` with the model of a star that does not change.
pub const UNCHANGING: &str = "unchanging_model";

/// Maps with all that their files say of them.
#[derive(Clone, Debug)]
pub struct ChangingMapResult<'a> {
    /// What the data were imaged with.
    pub imager: &'a Imager,
    /// The data.
    pub observations: &'a Observations,
    /// The maps.
    pub fit: &'a ChangingFit,
    /// The true parameters, for simulated data.
    pub truth: Option<ParameterValues>,
    /// Config, data and program.
    pub provenance: &'a Provenance,
}

/// What tells `map.json` and `fit.json` of a star that may change from those of one that does not.
#[derive(Clone, Copy, Debug, Deserialize)]
pub struct MapKind {
    #[serde(default)]
    field: Option<IgnoredAny>,
}

impl MapKind {
    /// Whether the star may change: [`ChangingMapFile`] and [`ChangingFitFile`].
    pub fn is_changing(&self) -> bool {
        self.field.is_some()
    }
}

/// The content of `map.json` of a star that may change.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ChangingMapFile {
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
    /// The field of spots that was integrated over.
    pub field: FieldRecord,
    /// Mean filling factor that is assumed: profiles do not tell it.
    pub mean_filling: f64,
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
    /// The maps, in the order of their times.
    pub maps: Vec<MapAt>,
}

/// The content of `fit.json` of a star that may change.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ChangingFitFile {
    /// How good the fit is.
    #[serde(flatten)]
    pub summary: ChangingSummary,
    /// The field of spots that was integrated over.
    pub field: FieldRecord,
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
    /// What has to be known of field and times.
    pub warnings: Vec<String>,
    /// Config, data and program.
    #[serde(flatten)]
    pub provenance: Provenance,
}

impl ChangingMapResult<'_> {
    /// Writes all files into `folder`, which must exist.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn write(&self, folder: &Path) -> Result<(), WriteError> {
        let [map, profiles, rv, fit] = FILES.map(|name| folder.join(name));
        write_json(&map, &self.map())?;
        write(&profiles, &self.profiles().into_bytes())?;
        write(&rv, &self.velocities().into_bytes())?;
        write_json(&fit, &self.fit())?;
        match self.fit.light.is_empty() {
            true => Ok(()),
            false => write(&folder.join(LIGHT_CURVES), &table(&self.fit.light).into_bytes()),
        }
    }

    fn map(&self) -> ChangingMapFile {
        let SurfaceGrid { longitude, latitude, area, rings, .. } = &self.imager.grid;
        let degrees = |angles: &[f64]| angles.iter().map(|x| x.to_degrees()).collect();
        ChangingMapFile {
            conventions: CONVENTIONS.into(),
            rotation_period_d: self.imager.star.rotation_period_d,
            epoch_d: self.imager.star.epoch_d,
            parameters: self.fit.summary.parameters,
            contrast: self.fit.summary.contrast,
            field: FieldRecord::of(&self.fit.fitted),
            mean_filling: MEAN_FILLING,
            pixels: self.imager.grid.len(),
            ring_pixels: rings.iter().map(|ring| ring.pixels.len()).collect(),
            longitude_deg: degrees(longitude),
            latitude_deg: degrees(latitude),
            area_fraction: area.clone(),
            maps: self.fit.maps.clone(),
            data_sets: self.provenance.measured.sets.clone(),
        }
    }

    fn profiles(&self) -> Table {
        let columns = ["profile", "time_d", "cycle", "velocity_kms", "observed", "sigma", "model", "residual"];
        let unchanging = self.fit.unchanging_model.as_ref();
        let beside = beside(self.imager);
        let more = unchanging.map(|_| UNCHANGING).into_iter().chain(beside.iter().map(|(name, _)| *name));
        let mut table = Table::new(&columns.into_iter().chain(more).collect::<Vec<_>>());
        for (k, (profile, model)) in self.observations.profiles.iter().zip(&self.fit.model).enumerate() {
            let cycle = self.imager.star.cycle(profile.time_d);
            for (j, model) in model.iter().enumerate() {
                let velocity = profile.velocity_kms(j);
                let (observed, sigma) = (profile.intensity[j], profile.sigma[j]);
                let mut row =
                    vec![k as f64, profile.time_d, cycle, velocity, observed, sigma, *model, observed - model];
                row.extend(unchanging.map(|unchanging| unchanging[k][j]));
                row.extend(beside.iter().map(|(_, of)| of[k] as f64));
                table.row(&row);
            }
        }
        table
    }

    fn velocities(&self) -> Table {
        let columns =
            ["time_d", "cycle", "observed_kms", "sigma_kms", "modelled_kms", "orbit_kms", "rv_kms", "rv_sigma_kms"];
        let beside = beside(self.imager);
        let names = columns.into_iter().chain(beside.iter().map(|(name, _)| *name));
        let mut table = Table::new(&names.collect::<Vec<_>>());
        for (k, v) in self.fit.velocities.iter().enumerate() {
            let (value_kms, sigma_kms) = (v.observed.value_kms, v.observed.sigma_kms);
            let free = [v.modelled_kms, v.orbit_kms, v.rv_kms, v.rv_sigma_kms];
            let own: Vec<f64> = beside.iter().map(|(_, of)| of[k] as f64).collect();
            table.row(&[&[v.time_d, v.cycle, value_kms, sigma_kms][..], &free, &own].concat());
        }
        table
    }

    fn fit(&self) -> ChangingFitFile {
        ChangingFitFile {
            summary: self.fit.summary.clone(),
            field: FieldRecord::of(&self.fit.fitted),
            nuisances: self.fit.nuisances.clone(),
            zero_points_kms: self.fit.zero_points_kms.clone(),
            truth: self.truth,
            checks: self.fit.checks.clone(),
            warnings: self.fit.warnings.clone(),
            provenance: self.provenance.clone(),
        }
    }
}
