//! A config to be written: the keys of a first config of an observed star, in the order and layout for people. Other
//! defaults are left to the program.

use super::document::compact;
use super::written::{
    ImagingSettings, IndicatorSection, Instrument, Listed, ObservationsSection, PerParameter, PhotometrySection,
    Planet, PriorSection, Star, VelocityJitter,
};
use crate::model::{Parameter, PriorKind};
use serde::Serialize;

/// A config of observations from files with the orbit and the systemic velocity free: its sections in their order.
#[derive(Clone, Debug, Serialize)]
pub struct Draft {
    /// Where the JSON Schema is, relative to the config.
    #[serde(rename = "$schema", skip_serializing_if = "Option::is_none")]
    pub schema: Option<String>,
    /// The star. A rotation period that is not known is written as null, which every command refuses.
    pub star: Star<Option<f64>>,
    /// The spectrograph.
    pub instrument: Instrument,
    planet: Planet,
    /// The profiles: one data set or several.
    pub observations: Listed<ObservationsSection>,
    /// The light curves.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub photometry: Option<Listed<PhotometrySection>>,
    /// The activity indicators.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub indicators: Option<Listed<IndicatorSection>>,
    /// The image.
    pub imaging: ImagingSettings,
    parameters: PerParameter<PriorSection>,
}

/// Data other than the profiles.
#[derive(Clone, Debug, Default)]
pub struct Beside {
    /// The light curves.
    pub photometry: Vec<PhotometrySection>,
    /// The activity indicators.
    pub indicators: Vec<IndicatorSection>,
}

/// Prior ranges of the orbit and the systemic velocity: from the first of each to the last, uniformly but for the
/// period, which is uniform in its logarithm.
#[derive(Clone, Copy, Debug)]
pub struct Sought {
    /// Semi-amplitude (km/s).
    pub k_kms: (f64, f64),
    /// Period over the rotation period.
    pub porb_over_prot: (f64, f64),
    /// Systemic velocity (km/s).
    pub vsys_kms: (f64, f64),
}

impl Draft {
    /// A draft of these sections, still without data sets; it starts without a planet, except for the period
    /// `porb_over_prot`.
    pub fn new(
        star: Star<Option<f64>>,
        instrument: Instrument,
        Beside { photometry, indicators }: Beside,
        imaging: ImagingSettings,
        sought: Sought,
        porb_over_prot: f64,
    ) -> Self {
        let periodic = PriorSection { prior: PriorKind::Periodic, min: None, max: None, mean: None, sd: None };
        let parameters = PerParameter::from_iter([
            (Parameter::K, PriorSection::even(PriorKind::Uniform, sought.k_kms)),
            (Parameter::PorbOverProt, PriorSection::even(PriorKind::LogUniform, sought.porb_over_prot)),
            (Parameter::Phi, periodic),
            (Parameter::Vsys, PriorSection::even(PriorKind::Uniform, sought.vsys_kms)),
        ]);
        let draft = Draft {
            schema: None,
            star,
            instrument,
            planet: Planet::default(),
            observations: Listed::of(Vec::new()),
            photometry: (!photometry.is_empty()).then(|| Listed::of(photometry)),
            indicators: (!indicators.is_empty()).then(|| Listed::of(indicators)),
            imaging,
            parameters,
        };
        draft.with_orbit((0.0, porb_over_prot, 0.0))
    }

    /// The same with another orbit as its start: semi-amplitude (km/s), 0 for no planet; period over the rotation
    /// period; phase.
    pub fn with_orbit(mut self, (k_kms, porb_over_prot, phi): (f64, f64, f64)) -> Self {
        self.planet =
            Planet::of([(Parameter::K, k_kms), (Parameter::PorbOverProt, porb_over_prot), (Parameter::Phi, phi)]);
        self
    }

    /// That orbit.
    pub fn orbit(&self) -> (f64, f64, f64) {
        let value = |parameter: Parameter| self.planet.get(parameter).unwrap_or_else(|| parameter.usual());
        (value(Parameter::K), value(Parameter::PorbOverProt), value(Parameter::Phi))
    }

    /// The same with this RV jitter.
    pub fn with_jitter(mut self, jitter: VelocityJitter) -> Self {
        self.observations.sections.iter_mut().for_each(|set| set.velocity_jitter_kms = Some(jitter));
        self
    }

    /// The config as text.
    ///
    /// # Errors
    /// If the path of the observations is not Unicode, as JSON must be.
    pub fn to_json(&self) -> Result<String, serde_json::Error> {
        let mut draft = self.clone();
        for set in &mut draft.observations.sections {
            set.velocity_jitter_kms =
                set.velocity_jitter_kms.and_then(|jitter| jitter.mentioned(self.imaging.objective));
        }
        Ok(compact(&serde_json::to_string_pretty(&draft)?))
    }
}
