//! Expected constraints of planned profiles on planets.
//!
//! In: configs, each a star with a schedule ([`Campaign`]): `observations.simulate` for a star that is not yet
//! observed, or observed profiles with a `plan`. Out: for each the uncertainty of K, and the K that is detected, at
//! every period, after every few nights ([`Outlook`]); and which of the schedules is best ([`PlanFile`]). The order:
//! 1. Maps are drawn from the field of spots, given the existing profiles, and the profiles are linearised at them.
//! 2. Their information on the orbit's velocities is marginalised over spots (`surface::evolving_map`).
//! 3. Uncertainties, false-alarm probabilities and limits follow from it as for observed profiles
//!    (`planets::periodogram`), with medians over the maps.
//! 4. On request the nights with the most information on one planet are [chosen](Choice).

mod ahead;
mod campaign;
mod choice;
mod file;
mod forecast;
mod outlook;

pub use campaign::{Campaign, LightRecord, SetRecord, SpotsSource};
pub use choice::{Aim, Choice, ChosenNight, Merit};
pub use file::{AfterRecord, CSV, ExpectedRecord, JSON, PlanFile, ScheduleRecord, SpotsRecord, WindowRecord};
pub use forecast::{Forecast, ForecastError, Next};
pub use outlook::{Expected, Outlook};

use crate::data::config::ConfigError;
use crate::data::scene::SceneError;
use crate::field::FieldError;
use crate::planets::periodogram::{Frequencies, FrequencyError, FrequencySettings};
use crate::surface::NoFit;
use crate::surface::expansion::nuisances;
use serde::{Deserialize, Serialize};
use std::path::PathBuf;
use std::time::Instant;

/// Number of periods at which schedules are compared, evenly spaced in their logarithm.
const COMPARED: usize = 60;

/// Profiles and bins of light curves of the largest campaign: some minutes, and 1 GB.
const MOST_PROFILES: usize = 1000;

/// Number of evaluations during the campaign.
const LOOKS: usize = 6;

/// Settings of the computation of a plan.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct PlanSettings {
    /// Number of drawn maps; 0 for an unspotted star instead.
    pub maps: usize,
    /// Number of planet-free Monte Carlo realisations for the FAP.
    pub draws: usize,
    /// Seed of both.
    pub seed: u64,
    /// Whether systemic velocity and stellar parameters are fixed at the config's values, instead of marginalised over.
    pub fixed: bool,
}

/// Why there is no campaign.
#[derive(Debug, thiserror::Error)]
pub enum CampaignError {
    /// The config or its observations are wrong.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// The spots of the observed profiles cannot be marginalised over.
    #[error("{}: no field of spots fits the observed profiles: {source}", path.display())]
    Field {
        /// The config.
        path: PathBuf,
        /// The error.
        source: NoFit,
    },
    /// More nights are requested than there are.
    #[error("--nights {wanted}: {}: {key} lists {listed} nights", path.display())]
    Nights {
        /// The config.
        path: PathBuf,
        /// The key of its nights.
        key: String,
        /// Requested nights.
        wanted: usize,
        /// Nights of the config.
        listed: usize,
    },
}

impl From<ConfigError> for CampaignError {
    fn from(error: ConfigError) -> Self {
        CampaignError::Scene(error.into())
    }
}

/// Why there is no plan.
#[derive(Debug, thiserror::Error)]
pub enum PlanError {
    /// The field cannot be marginalised over.
    #[error("{name}: {source}")]
    Field {
        /// The schedule.
        name: String,
        /// The error.
        source: FieldError,
    },
    /// More profiles than can be evaluated in reasonable time and memory.
    #[error(
        "{name}: {profiles} profiles and bins of light curves; time and memory of a plan grow with their square, and \
        {MOST_PROFILES} are the most: fewer --nights, fewer exposures per_night, or no photometry over so long a time"
    )]
    TooLong {
        /// The schedule.
        name: String,
        /// Their number.
        profiles: usize,
    },
    /// Invalid periods, or too few profiles.
    #[error(transparent)]
    Frequencies(#[from] FrequencyError),
}

/// Shortest and longest period (d) at which all of the campaigns are evaluated.
///
/// # Errors
/// [`FrequencyError`].
pub fn range_d(campaigns: &[Campaign], wanted: FrequencySettings) -> Result<[f64; 2], FrequencyError> {
    let mut range = [0.0_f64; 2];
    for campaign in campaigns {
        let (low, high) = campaign.frequencies(&campaign.all(), wanted)?.range();
        let prot = campaign.imager.star.rotation_period_d;
        range = [range[0].max(prot / high), range[1].max(prot / low)];
    }
    Ok(range)
}

/// The outlooks of a campaign, searched from the shortest to the longest period of `range_d`. `report` is called with
/// the progress.
///
/// # Errors
/// [`PlanError`].
pub fn outlook(
    campaign: &Campaign,
    range_d: [f64; 2],
    settings: &PlanSettings,
    report: &dyn Fn(&str),
) -> Result<Vec<Outlook>, PlanError> {
    let profiles = campaign.imager.times_of_all_d().len();
    if profiles > MOST_PROFILES {
        return Err(PlanError::TooLong { name: campaign.name.clone(), profiles });
    }
    let began = Instant::now();
    let field = |source| PlanError::Field { name: campaign.name.clone(), source };
    let nuisances = if settings.fixed { Vec::new() } else { nuisances(&campaign.settings.free) };
    let planned = campaign.planned(&nuisances);
    let wanted =
        FrequencySettings { min_period_d: Some(range_d[0]), max_period_d: Some(range_d[1]), oversampling: None };
    let looks: Vec<(usize, Vec<usize>, Frequencies)> = campaign
        .looks(LOOKS)
        .into_iter()
        .filter_map(|(nights, part)| {
            // too few times for an orbit
            let frequencies = campaign.frequencies(&part, wanted).ok()?;
            Some((nights, part, frequencies))
        })
        .collect();
    let parts: Vec<Vec<usize>> = looks.iter().map(|(_, part, _)| part.clone()).collect();
    let mut quadratics: Vec<Vec<_>> = vec![Vec::new(); parts.len()];
    for k in 0..settings.maps.max(1) {
        let maps = match settings.maps {
            0 => planned.mean_maps(),
            _ => planned.drawn_maps(settings.seed.wrapping_add(k as u64)).map_err(field)?,
        };
        for (all, one) in quadratics.iter_mut().zip(planned.velocities(&maps, &parts).map_err(field)?) {
            all.push(one);
        }
        let (done, all) = (k + 1, settings.maps.max(1));
        let left = began.elapsed().as_secs_f64() * (all - done) as f64 / done as f64;
        report(&format!("{}: {profiles} profiles, map {done} of {all}, some {left:.0} s left", campaign.name));
    }
    let outlook = |((nights, part, frequencies), quadratics): ((usize, Vec<usize>, Frequencies), Vec<_>)| {
        Outlook::new(nights, campaign.profiles_of(&part).len(), quadratics, frequencies, settings)
    };
    Ok(looks.into_iter().zip(quadratics).map(outlook).collect())
}

/// The periods (d) at which schedules are compared.
pub fn compared_d(campaigns: &[Campaign], range_d: [f64; 2]) -> Vec<f64> {
    let longest = campaigns.iter().map(Campaign::time_base_d).fold(0.0, f64::max);
    let [low, high] = [range_d[0], range_d[1].min(longest.max(range_d[0] * 1.1))];
    crate::runs::limits::even_in_logarithm(low, high, COMPARED)
}
