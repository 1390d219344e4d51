//! The record of the reference that every evaluation starts from, from which it is rebuilt to the same bits.

use super::static_map::ReferenceError;
use crate::field::FieldError;
use crate::model::{Parameter, ParameterValues};
use crate::numerics::json::is_zero;
use serde::de::Error as _;
use serde::{Deserialize, Deserializer, Serialize};
use std::collections::BTreeMap;

/// The record of a reference.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(transparent)]
pub struct SurfaceRecord(Reference);

#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(untagged)]
enum Reference {
    Image(ImageRecord),
    Field(FieldRecord),
}

/// The reference solution.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ImageRecord {
    /// All parameters.
    pub parameters: BTreeMap<String, f64>,
    /// Target of chi2.
    pub chi2_target: f64,
    /// chi2 of the image.
    pub chi2: f64,
    /// Lagrange multiplier.
    pub lambda: f64,
    /// Entropy.
    pub entropy: f64,
    /// Spottedness.
    pub spottedness: f64,
    /// chi2 at the end of the trade-off curve, where lambda is three times as large.
    pub chi2_reach: f64,
    /// Number of data.
    pub data: usize,
}

impl ImageRecord {
    /// Warning for a target that may be unreachable in another noise realisation, which moves the attainable chi2 by
    /// sqrt(2/N): there spottedness increases steeply, and the result depends on the target (`docs/method.md` section
    /// 3).
    fn warning(&self) -> Option<String> {
        let noise = (2.0 / self.data as f64).sqrt() * self.chi2_target;
        (self.chi2_target - self.chi2_reach < noise).then(|| {
            let per_datum = |chi2: f64| chi2 / self.data as f64;
            format!(
                "the target χ²/N of {:.3} is close to the floor (three times its lambda reaches {:.3}): check that the \
                 result stays when imaging.chi2_target is raised by {:.3}",
                per_datum(self.chi2_target),
                per_datum(self.chi2_reach),
                per_datum(noise)
            )
        })
    }
}

/// The most probable maps, one per profile.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FieldRecord {
    /// All parameters, including those of the field; without a lifetime spots are static.
    pub parameters: BTreeMap<String, f64>,
    /// Degree below which the spectrum of the spots is flat.
    #[serde(default)]
    pub spot_break_degree: f64,
    /// RV jitter of the profiles (km/s).
    pub velocity_jitter_kms: f64,
    /// RV offsets of nights, where they are fitted and needed: their standard deviation (km/s).
    #[serde(default, skip_serializing_if = "is_zero")]
    pub night_offsets_kms: f64,
    /// ln of the evidence.
    pub ln_evidence: f64,
    /// Number of data.
    pub data: usize,
}

/// Above this vsini (km/s) evolving maps underestimate the uncertainties of some parameters, by a factor.
const FAST_KMS: f64 = 45.0;
const TOO_SURE: [Parameter; 3] = [Parameter::OmegaEq, Parameter::DOmega, Parameter::Inclination];
const WIDENING: f64 = 1.6;

impl FieldRecord {
    /// Parameters of the field that lie on a bound of its search, and free ones whose uncertainties are inflated.
    fn warnings(&self, free: &[String]) -> Vec<String> {
        /// A bound is reached within this fraction.
        const REACHED: f64 = 0.01;
        let on_bound = |p: &Parameter| {
            let (value, (low, high)) = (*self.parameters.get(p.name())?, p.widest());
            let near = |bound: f64| (value / bound - 1.0).abs() < REACHED;
            let bound = [low, high].into_iter().find(|bound| near(*bound))?;
            Some(match (p, bound == high) {
                (Parameter::SpotLifetime, true) => "no spot evolution detected".to_owned(),
                _ => {
                    format!("{} is at its search bound, {bound}: unconstrained, or the model is misspecified", p.name())
                }
            })
        };
        Parameter::FIELD.iter().filter_map(on_bound).chain(self.widened(free)).collect()
    }

    /// The factor on the uncertainty of a parameter (`results/calibration-stellar.md`).
    fn widening(&self, p: Parameter) -> Option<f64> {
        let is_fast = *self.parameters.get(Parameter::Vsini.name())? > FAST_KMS;
        (is_fast && TOO_SURE.contains(&p)).then_some(WIDENING)
    }

    /// The list of inflated uncertainties.
    fn widened(&self, free: &[String]) -> Option<String> {
        let of = TOO_SURE.into_iter().filter(|p| free.iter().any(|free| free == p.name()));
        let of: Vec<&str> = of.filter(|p| self.widening(*p).is_some()).map(Parameter::name).collect();
        (!of.is_empty()).then(|| {
            format!(
                "vsini is above {FAST_KMS:.0} km/s: uncertainties of {} are multiplied by {WIDENING}, by which they \
                were too small on simulated stars with spots like discs; draws of a chain are as sampled",
                of.join(", ")
            )
        })
    }
}

/// Distinguished by a key that only one of them has, so that an error refers to that one.
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

/// Errors of a rebuilt reference.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum RebuildError {
    /// No image at the recorded parameters.
    #[error(transparent)]
    Reference(#[from] ReferenceError),
    /// No maps there.
    #[error(transparent)]
    Field(#[from] FieldError),
    /// The result differs.
    #[error("the reference differs on this machine ({what} {now:e} instead of {then:e})")]
    Differs {
        /// Name of the differing value.
        what: &'static str,
        /// The recorded value.
        then: f64,
        /// The new value.
        now: f64,
    },
    /// It belongs to another objective.
    #[error("the reference is that of another objective than the config's")]
    OtherObjective,
}

impl RebuildError {
    /// Checks that a value is unchanged, to the bit.
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

    /// Warnings on it, and on the free parameters.
    pub fn warnings(&self, free: &[String]) -> Vec<String> {
        match &self.0 {
            Reference::Image(record) => record.warning().into_iter().collect(),
            Reference::Field(record) => record.warnings(free),
        }
    }

    /// The factor on the uncertainty of a parameter, where it is underestimated.
    pub fn widening(&self, p: Parameter) -> Option<f64> {
        match &self.0 {
            Reference::Image(_) => None,
            Reference::Field(record) => record.widening(p),
        }
    }

    /// All parameters; those missing in the record are taken from `others`, except a lifetime: without one spots are
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

/// The given values, by name.
pub fn by_name(values: &ParameterValues) -> BTreeMap<String, f64> {
    Parameter::ALL.iter().filter_map(|&p| Some((p.name().to_string(), values.get(p)?))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn uncertainties_of_fast_stars_are_widened() {
        let of = |vsini_kms: f64, free: &[&str]| {
            let parameters = BTreeMap::from([("vsini_kms".to_owned(), vsini_kms)]);
            let (spot_break_degree, velocity_jitter_kms, ln_evidence, data) = (7.0, 0.0, 0.0, 1);
            let night_offsets_kms = 0.0;
            let record = FieldRecord {
                parameters,
                spot_break_degree,
                velocity_jitter_kms,
                night_offsets_kms,
                ln_evidence,
                data,
            };
            let record = SurfaceRecord::from(record);
            assert_eq!(record.widening(Parameter::DOmega).is_some(), vsini_kms > FAST_KMS);
            assert_eq!(record.widening(Parameter::K), None);
            record.warnings(&free.iter().map(|name| (*name).to_owned()).collect::<Vec<_>>())
        };
        let [warning] = &of(60.0, &["k_kms", "domega_rad_d", "inclination_deg"])[..] else { panic!("one warning") };
        assert!(warning.contains("uncertainties of domega_rad_d, inclination_deg are multiplied"), "{warning}");
        assert!(of(40.0, &["domega_rad_d"]).is_empty());
        assert!(of(60.0, &["k_kms", "vsini_kms"]).is_empty());
    }
}
