//! What every result says of where it came from.

use crate::model::Parameter;
use crate::numerics::json::Part;
use crate::surface::calibration::events::Events;
use crate::surface::calibration::jitter::MeasuredJitter;
use crate::surface::calibration::noise::MeasuredErrors;
use crate::surface::calibration::offsets::HeldZeroPoint;
use crate::surface::calibration::star::MeasuredStar;
use crate::surface::calibration::target::ChosenTarget;
use crate::surface::{ConstantVelocity, FieldStart, FittedContrast, FittedIndicator, OtherRotation};
use serde::{Deserialize, Serialize};

/// Config, data and program that made a result.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Provenance {
    /// Version of the program.
    pub version: String,
    /// SHA-256 (hex) of the observations.
    pub data_sha256: String,
    /// SHA-256 (hex) of the part of the config that decides the posterior and the chain.
    pub config_sha256: String,
    /// The config with all defaults filled in.
    pub config: serde_json::Value,
    /// What the config leaves to the observations.
    #[serde(default, skip_serializing_if = "Measured::is_empty")]
    pub measured: Measured,
}

/// Settings that were taken from the observations before anything else, and what was made of these.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Measured {
    /// What was made of the profiles on reading.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub profiles: Vec<String>,
    /// `observations.sigma_scale` and `.weights`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub errors: Option<MeasuredErrors>,
    /// `observations.velocity_jitter_kms`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub velocity_jitter: Option<MeasuredJitter>,
    /// Each of several data sets, in the order of the profiles.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub sets: Vec<MeasuredSet>,
    /// Each of several seasons, in the order of time.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub seasons: Vec<Season>,
    /// What was made of the light curves, in words.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub light_curves: Vec<String>,
    /// What was left out of the light curves and converted, in words.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub light_curve_notes: Vec<String>,
    /// `indicators`: gains and jitters.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub indicators: Vec<FittedIndicator>,
    /// What was made of the indicators on reading, in words.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub indicator_notes: Vec<String>,
    /// `star.regions`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub star: Option<MeasuredStar>,
    /// `observations.events`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub events: Option<Events>,
    /// `star.velocity_drift`: slopes of the RVs that the profiles show (km/s per day), with which they are imaged.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub drift_kms_d: Vec<f64>,
    /// The field of spots that was fitted on the way to star and events, from which a fit with finer maps begins.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub field_start: Option<FieldStart>,
    /// Another rotation period with which the profiles are far more probable.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub other_rotation: Option<OtherRotation>,
    /// `imaging.chi2_target`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub chi2_target: Option<ChosenTarget>,
}

/// A season of a star that does not change within it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Season {
    /// Time of its first profile (d).
    pub first_d: f64,
    /// Time of its last one (d).
    pub last_d: f64,
    /// Number of them.
    pub profiles: usize,
    /// Where longitudes of its map count from, in place of the star's `epoch_d`: whole cycles later (d).
    pub epoch_d: f64,
}

impl Part for Season {
    const KEYS: &'static [&'static str] = &["first_d", "last_d", "profiles", "epoch_d"];
}

/// One of several data sets.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct MeasuredSet {
    /// Its name.
    pub name: String,
    /// Number of its profiles.
    pub profiles: usize,
    /// Its `sigma_scale` and `weights`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub errors: Option<MeasuredErrors>,
    /// Its `zero_point_kms`, where it is fitted.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub zero_point: Option<HeldZeroPoint>,
    /// Its `contrast`, where it is fitted.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub contrast: Option<FittedContrast>,
}

impl MeasuredSet {
    /// It in words.
    pub fn line(&self) -> String {
        let zero_point = self.zero_point.as_ref().map(|of_set| match of_set.found {
            Some(ConstantVelocity { value_kms, sigma_kms }) => {
                format!(", RV offset {value_kms:.3} ± {sigma_kms:.3} km/s (marginalised)")
            }
            None => ", RV offset marginalised".to_owned(),
        });
        let contrast = self.contrast.as_ref();
        let contrast = contrast.map(|of| format!(", spot contrast {:.3} ± {:.3}", of.value, of.sigma));
        let errors = self.errors.as_ref().map(|errors| format!(", uncertainties {}", errors.line()));
        let own: String = [zero_point, contrast, errors].into_iter().flatten().collect();
        format!("{}: {} profiles{own}", self.name, self.profiles)
    }
}

impl MeasuredSet {
    /// Why the contrast of its spots cannot be what was fitted, with a name for it.
    fn problem(&self) -> Option<String> {
        self.contrast.filter(FittedContrast::is_at_bound)?;
        Some(format!(
            "spots of data set {} would have to be darker than black (contrast-at-bound): lower the contrast of the \
             first data set, or list the data set with the darker spots first",
            self.name
        ))
    }
}

impl Measured {
    /// Whether the config leaves nothing to the observations.
    pub fn is_empty(&self) -> bool {
        *self == Measured::default()
    }

    /// The same with what was `found` of the zero points that are fitted, in the order of the sets.
    pub fn with_zero_points(mut self, found: &[ConstantVelocity]) -> Self {
        let fitted = self.sets.iter_mut().filter_map(|set| set.zero_point.as_mut());
        fitted.zip(found).for_each(|(of_set, found)| of_set.found = Some(*found));
        self
    }

    /// Why nothing can be judged with what was found of star and events, with a name for it.
    pub fn problem(&self) -> Option<String> {
        let of_events = self.events.as_ref().and_then(Events::too_many);
        let of_contrasts = || self.sets.iter().find_map(MeasuredSet::problem);
        of_events.or_else(|| self.star.as_ref().and_then(MeasuredStar::problem)).or_else(of_contrasts)
    }

    /// That the uncertainty of a free inclination lacks that of active regions (`results/calibration-stellar.md`).
    pub fn held_regions(&self, free: &[String]) -> Option<String> {
        let is_region = |name: &str| Parameter::REGIONS.iter().any(|p| p.name() == name);
        let is_free = |name: &str| free.iter().any(|free| free == name);
        let numbers = self.star.iter().flat_map(|star| &star.numbers);
        let is_held = numbers.into_iter().any(|number| is_region(&number.name) && !is_free(&number.name));
        (is_held && is_free(Parameter::Inclination.name())).then(|| {
            "active regions are fitted together with inclination_deg and then held: its uncertainty does not include \
            theirs; compare without regions (area, area_limb and dimming_limb of star.regions 0)"
                .to_owned()
        })
    }

    /// That the model does not fit as well as the continuum promises, where the errors say so.
    pub fn misfit_text(&self) -> Option<String> {
        let of_set = |set: &MeasuredSet| Some(format!("{}: {}", set.name, set.errors.as_ref()?.misfit_text()?));
        match &self.errors {
            Some(errors) => Some(format!("{}; `dimcmc map` diagnoses why", errors.misfit_text()?)),
            None => self.sets.iter().find_map(of_set),
        }
    }

    /// It in words, label and text a line.
    pub fn lines(&self) -> Vec<(&'static str, String)> {
        let profiles = self.profiles.iter().map(|remark| ("profiles", remark.clone()));
        let errors = self.errors.as_ref().map(|errors| ("errors", errors.line()));
        let target = self.chi2_target.as_ref().map(|target| ("target chi2", target.line()));
        let jitter = self.velocity_jitter.as_ref().map(|jitter| ("RV jitter", jitter.line()));
        let star = self.star.as_ref().map(|star| ("fitted star", star.line()));
        let events = self.events.as_ref().and_then(Events::line).map(|line| ("events", line));
        let sets = self.sets.iter().map(|set| ("data set", set.line()));
        let season = |season: &Season| {
            let Season { first_d, last_d, profiles, .. } = season;
            ("season", format!("{first_d:.3} to {last_d:.3} d: {profiles} profiles, own map"))
        };
        let seasons = self.seasons.iter().map(season);
        let light =
            self.light_curves.iter().chain(&self.light_curve_notes).map(|remark| ("light curve", remark.clone()));
        let of_indicators = self.indicators.iter().map(FittedIndicator::line);
        let indicators = self.indicator_notes.iter().cloned().chain(of_indicators).map(|text| ("indicator", text));
        profiles
            .chain(sets)
            .chain(seasons)
            .chain(light)
            .chain(indicators)
            .chain(errors)
            .chain(jitter)
            .chain(star)
            .chain(events)
            .chain(target)
            .collect()
    }
}
