//! What is written of the reference that every evaluation starts from, and what it is rebuilt from to the same bits.

use super::evolving_map::FieldRecord;
use super::static_map::{ImageRecord, ReferenceError};
use crate::field::FieldError;
use crate::model::{Parameter, ParameterValues};
use serde::de::Error as _;
use serde::{Deserialize, Deserializer, Serialize};
use std::collections::BTreeMap;

/// What every evaluation starts from.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(transparent)]
pub struct SurfaceRecord(Reference);

#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(untagged)]
enum Reference {
    Image(ImageRecord),
    Field(FieldRecord),
}

/// By the key that one of them has, so that an error is about that one.
impl<'de> Deserialize<'de> for SurfaceRecord {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let value = serde_json::Value::deserialize(deserializer)?;
        let read = match value.get("ln_evidence") {
            Some(_) => serde_json::from_value(value).map(Reference::Field),
            None => serde_json::from_value(value).map(Reference::Image),
        };
        read.map(SurfaceRecord).map_err(D::Error::custom)
    }
}

/// A reference that is not what it was.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum RebuildError {
    /// No image at the recorded parameters.
    #[error(transparent)]
    Reference(#[from] ReferenceError),
    /// No maps there.
    #[error(transparent)]
    Field(#[from] FieldError),
    /// It comes out differently.
    #[error("the reference comes out differently here ({what} {now:e} instead of {then:e})")]
    Differs {
        /// Which of its numbers.
        what: &'static str,
        /// That number then.
        then: f64,
        /// And now.
        now: f64,
    },
    /// It is of another objective.
    #[error("the reference is that of another objective than the config's")]
    OtherObjective,
}

impl RebuildError {
    /// That a number is what it was, to the bit.
    pub(super) fn check(what: &'static str, then: f64, now: f64) -> Result<(), Self> {
        match then.to_bits() == now.to_bits() {
            true => Ok(()),
            false => Err(RebuildError::Differs { what, then, now }),
        }
    }
}

impl SurfaceRecord {
    /// The parameters, by name.
    pub fn parameters(&self) -> &BTreeMap<String, f64> {
        match &self.0 {
            Reference::Image(record) => &record.parameters,
            Reference::Field(record) => &record.parameters,
        }
    }

    /// What has to be known of it, and of the parameters that are free.
    pub fn warnings(&self, free: &[String]) -> Vec<String> {
        match &self.0 {
            Reference::Image(record) => record.warning().into_iter().collect(),
            Reference::Field(record) => record.warnings(free),
        }
    }

    /// All parameters; those missing in the record are taken from `others`, but for a lifetime: without one spots are
    /// static.
    pub fn values(&self, others: &ParameterValues) -> ParameterValues {
        let mut values = *others;
        values.field.iter_mut().for_each(|field| field.lifetime_d = None);
        for p in Parameter::ALL.into_iter().filter(|p| !p.is_ephemeris()) {
            self.parameters().get(p.name()).into_iter().for_each(|value| values.set(p, *value));
        }
        values
    }

    pub(super) fn image(&self) -> Result<&ImageRecord, RebuildError> {
        match &self.0 {
            Reference::Image(record) => Ok(record),
            Reference::Field(_) => Err(RebuildError::OtherObjective),
        }
    }

    pub(super) fn field(&self) -> Result<&FieldRecord, RebuildError> {
        match &self.0 {
            Reference::Field(record) => Ok(record),
            Reference::Image(_) => Err(RebuildError::OtherObjective),
        }
    }
}

impl From<ImageRecord> for SurfaceRecord {
    fn from(record: ImageRecord) -> Self {
        SurfaceRecord(Reference::Image(record))
    }
}

impl From<FieldRecord> for SurfaceRecord {
    fn from(record: FieldRecord) -> Self {
        SurfaceRecord(Reference::Field(record))
    }
}

/// The values that are given, by name.
pub fn by_name(values: &ParameterValues) -> BTreeMap<String, f64> {
    Parameter::ALL.iter().filter_map(|&p| Some((p.name().to_string(), values.get(p)?))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fast_stars_are_too_sure_of_their_shear() {
        let of = |vsini_kms: f64, free: &[&str]| {
            let parameters = BTreeMap::from([("vsini_kms".to_owned(), vsini_kms)]);
            let (spot_break_degree, velocity_jitter_kms, ln_evidence, data) = (7.0, 0.0, 0.0, 1);
            let record = FieldRecord { parameters, spot_break_degree, velocity_jitter_kms, ln_evidence, data };
            record.warnings(&free.iter().map(|name| (*name).to_owned()).collect::<Vec<_>>())
        };
        let [warning] = &of(60.0, &["k_kms", "domega_rad_d", "inclination_deg"])[..] else { panic!("one warning") };
        assert!(warning.contains("take domega_rad_d, inclination_deg with twice the errors"), "{warning}");
        assert!(of(40.0, &["domega_rad_d"]).is_empty());
        assert!(of(60.0, &["k_kms", "vsini_kms"]).is_empty());
    }
}
