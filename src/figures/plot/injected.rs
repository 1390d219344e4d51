//! What was injected on the star: spots and faculae of `truth.json`, or of the config that made a map.

use super::PlotError;
use crate::data::io::map::{FIT, FitFile};
use crate::data::io::truth::{self, TruthFile};
use crate::runs::origin;
use crate::star::{Disc, Facula, Spot};
use serde_json::Value;
use std::path::Path;

/// What was injected.
#[derive(Clone, Debug, Default)]
pub(super) struct Injected {
    pub spots: Vec<Spot>,
    pub faculae: Vec<Facula>,
    /// Share of the surface that is spotted, where the file says so.
    pub coverage: Option<f64>,
}

impl Injected {
    /// Of the folder, if it knows.
    pub fn of(folder: &Path) -> Result<Option<Self>, PlotError> {
        if folder.join(truth::FILE).is_file() {
            return Ok(Injected::of_truth(&origin::read(folder, truth::FILE)?));
        }
        if !folder.join(FIT).is_file() {
            return Ok(None);
        }
        let fit: FitFile = origin::read(folder, FIT)?;
        let written = fit.provenance.config.pointer("/observations/simulate");
        Ok(written.filter(|simulate| simulate.get("spots").is_some()).map(|simulate| Injected {
            spots: spots(&simulate["spots"]),
            faculae: faculae(&simulate["faculae"]),
            coverage: None,
        }))
    }

    /// Of a simulation; `None` of observed profiles that an orbit was put into.
    pub fn of_truth(truth: &TruthFile) -> Option<Self> {
        let TruthFile::Simulated(truth) = truth else { return None };
        let faculae = truth.faculae.as_ref().map(faculae).unwrap_or_default();
        Some(Injected { spots: spots(&truth.spots), faculae, coverage: Some(truth.spottedness) })
    }
}

/// Spots as they are written, `[longitude, latitude, radius, filling]` in degrees; others are left out.
fn spots(written: &Value) -> Vec<Spot> {
    let spot = |(Disc { longitude, latitude, radius }, filling)| Spot { longitude, latitude, radius, filling };
    discs(written).map(spot).collect()
}

/// Faculae as they are written, `[longitude, latitude, radius, excess]` in degrees; others are left out.
fn faculae(written: &Value) -> Vec<Facula> {
    discs(written).map(|(disc, excess)| Facula { disc, excess }).collect()
}

/// Discs and the number that follows each.
fn discs(written: &Value) -> impl Iterator<Item = (Disc, f64)> {
    let disc = |value: &Value| {
        let number = |k: usize| value.get(k).and_then(Value::as_f64);
        let [longitude, latitude, radius] = [number(0)?, number(1)?, number(2)?].map(f64::to_radians);
        Some((Disc { longitude, latitude, radius }, number(3)?))
    };
    written.as_array().into_iter().flatten().filter_map(disc)
}
