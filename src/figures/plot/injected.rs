//! The injected surface: spots and faculae of `truth.json`, or of the config of a map. Evolving spots are drawn at the
//! middle of the data.

use super::PlotError;
use crate::data::io::map::{FIT, FitFile};
use crate::data::io::truth::{self, TruthFile};
use crate::runs::origin;
use crate::star::spots::spots_at;
use crate::star::{Disc, Facula, Life, Spot};
use serde_json::Value;
use std::path::Path;

/// The injected surface.
#[derive(Clone, Debug, Default)]
pub(super) struct Injected {
    pub spots: Vec<Spot>,
    pub faculae: Vec<Facula>,
    /// Spotted fraction of the surface, if the file contains it.
    pub coverage: Option<f64>,
    /// Whether spots evolve.
    pub is_changing: bool,
}

impl Injected {
    /// That of the folder, if known.
    pub fn of(folder: &Path) -> Result<Option<Self>, PlotError> {
        if folder.join(truth::FILE).is_file() {
            return Ok(Injected::of_truth(&origin::read(folder, truth::FILE)?));
        }
        if !folder.join(FIT).is_file() {
            return Ok(None);
        }
        let fit: FitFile = origin::read(folder, FIT)?;
        let Some(simulate) = fit.provenance.config.pointer("/observations/simulate") else { return Ok(None) };
        let written: Vec<Vec<f64>> = serde_json::from_value(simulate["spots"].clone()).unwrap_or_default();
        let spots = spots(&written);
        // the config alone does not determine the spots
        if simulate.get("random_spots").is_some() || spots.iter().any(|spot| spot.life.is_some()) {
            return Ok(None);
        }
        Ok(Some(Injected { spots, faculae: faculae(&simulate["faculae"]), coverage: None, is_changing: false }))
    }

    /// From a simulation; `None` for observed profiles with an injected orbit.
    pub fn of_truth(truth: &TruthFile) -> Option<Self> {
        let TruthFile::Simulated(truth) = truth else { return None };
        let faculae = truth.faculae.as_ref().map(faculae).unwrap_or_default();
        let all = spots(&truth.spots);
        let is_changing = all.iter().any(|spot| spot.life.is_some());
        let first = truth.times_d.iter().copied().fold(f64::INFINITY, f64::min);
        let last = truth.times_d.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let coverage = (!is_changing).then_some(truth.spottedness);
        Some(Injected { spots: spots_at(&all, 0.5 * (first + last)), faculae, coverage, is_changing })
    }
}

/// Spots in the written form: `[longitude, latitude, radius, filling]`, degrees, with the time of the largest area and
/// the lifetime (d) where they evolve; others are omitted.
fn spots(written: &[Vec<f64>]) -> Vec<Spot> {
    let spot = |numbers: &Vec<f64>| {
        let (&[longitude, latitude, radius, filling], rest) = numbers.split_first_chunk()?;
        let [longitude, latitude, radius] = [longitude, latitude, radius].map(f64::to_radians);
        let life = match *rest {
            [] => None,
            [peak_d, lifetime_d] => Some(Life { peak_d, lifetime_d, winding: 0.0 }),
            _ => return None,
        };
        Some(Spot { longitude, latitude, radius, filling, life })
    };
    written.iter().filter_map(spot).collect()
}

/// Faculae in the written form, `[longitude, latitude, radius, excess]` in degrees; others are omitted.
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
