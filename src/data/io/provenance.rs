//! The provenance in every result.

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

/// Config, data and program of a result.
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
    /// Quantities that the config leaves to the observations.
    #[serde(default, skip_serializing_if = "Measured::is_empty")]
    pub measured: Measured,
}

/// Settings measured on the observations first, and remarks on their preparation.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Measured {
    /// Remarks on the reading of the profiles.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub profiles: Vec<String>,
    /// `observations.sigma_scale` and `.weights`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub errors: Option<MeasuredErrors>,
    /// `observations.velocity_jitter_kms`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub velocity_jitter: Option<MeasuredJitter>,
    /// One entry per data set, if several, in the order of the profiles.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub sets: Vec<MeasuredSet>,
    /// One entry per season, if several, in the order of time.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub seasons: Vec<Season>,
    /// The preparation of the light curves, in words.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub light_curves: Vec<String>,
    /// Exclusions and conversions of the light curves, in words.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub light_curve_notes: Vec<String>,
    /// `indicators`: gains and jitters.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub indicators: Vec<FittedIndicator>,
    /// The preparation of the indicators, in words.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub indicator_notes: Vec<String>,
    /// `star.regions`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub star: Option<MeasuredStar>,
    /// `observations.events`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub events: Option<Events>,
    /// `star.velocity_drift`: fitted slopes of the RVs (km/s per day), used for imaging.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub drift_kms_d: Vec<f64>,
    /// The field of spots fitted together with star and events, the start of a fit with finer maps.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub field_start: Option<FieldStart>,
    /// Another rotation period with which the profiles are far more probable.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub other_rotation: Option<OtherRotation>,
    /// `imaging.chi2_target`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub chi2_target: Option<ChosenTarget>,
}

/// A season, with one static map.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Season {
    /// Time of its first profile (d).
    pub first_d: f64,
    /// Time of its last one (d).
    pub last_d: f64,
    /// Number of them.
    pub profiles: usize,
    /// Origin of longitudes of its map (d), in place of the star's `epoch_d`: whole cycles later.
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
    /// The data set in words.
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
    /// Why the fitted contrast of its spots is implausible, with a name for it.
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

    /// The same with the RV offsets `found` by the fit, in the order of the sets.
    pub fn with_zero_points(mut self, found: &[ConstantVelocity]) -> Self {
        let fitted = self.sets.iter_mut().filter_map(|set| set.zero_point.as_mut());
        fitted.zip(found).for_each(|(of_set, found)| of_set.found = Some(*found));
        self
    }

    /// Why no verdict is possible with the fitted star and events, with a name for it.
    pub fn problem(&self) -> Option<String> {
        let of_events = self.events.as_ref().and_then(Events::too_many);
        let of_contrasts = || self.sets.iter().find_map(MeasuredSet::problem);
        of_events.or_else(|| self.star.as_ref().and_then(MeasuredStar::problem)).or_else(of_contrasts)
    }

    /// The remark that the uncertainty of a free inclination excludes that of active regions
    /// (`results/calibration-stellar.md`).
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

    /// The remark that residuals exceed the continuum noise, where uncertainties show it.
    pub fn misfit_text(&self) -> Option<String> {
        let of_set = |set: &MeasuredSet| Some(format!("{}: {}", set.name, set.errors.as_ref()?.misfit_text()?));
        match &self.errors {
            Some(errors) => Some(format!("{}; `dimcmc map` diagnoses why", errors.misfit_text()?)),
            None => self.sets.iter().find_map(of_set),
        }
    }

    /// In words, one label and text per line.
    pub fn lines(&self) -> Vec<(&'static str, String)> {
        let profiles = self.profiles.iter().map(|remark| ("profiles", remark.clone()));
        let errors = self.errors.as_ref().map(|errors| ("errors", errors.line()));
        let target = self.chi2_target.as_ref().map(|target| ("target chi2", target.line()));
        let jitter = self.velocity_jitter.as_ref().map(|jitter| ("RV jitter", jitter.line()));
        let star = self.star.as_ref().map(|star| ("star", star.line()));
        let events = self.events.as_ref().and_then(Events::line).map(|line| ("outliers", line));
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
