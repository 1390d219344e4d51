//! A complete plan: the schedules of several configs, compared.

use super::choice::{choose, is_same};
use super::{Aim, Campaign, CampaignError, Outlook, PlanError, PlanFile, PlanSettings, compared_d, outlook, range_d};
use crate::data::config::{Config, ConfigError};
use crate::data::ephemeris::ephemerides;
use crate::data::io::atomic::WriteError;
use crate::model::{Ephemeris, Parameter};
use crate::numerics::text::shown;
use crate::planets::periodogram::{FrequencyError, FrequencySettings};
use std::path::Path;

/// Forecasts of schedules, each with its outlooks.
pub struct Forecast {
    campaigns: Vec<(Campaign, Vec<Outlook>)>,
    file: PlanFile,
}

/// The request for a choice of nights.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Next {
    /// Their number.
    pub nights: usize,
    /// Period of the planet (d); that of the config, if it is not given.
    pub period_d: Option<f64>,
    /// Another period (d) from which it is to be distinguished.
    pub other_d: Option<f64>,
}

impl Next {
    /// The aim of the choice of nights for a campaign.
    fn aim(&self, campaign: &Campaign) -> Result<Aim, ConfigError> {
        let settings = &campaign.settings;
        let is_wanted = |known: &Ephemeris| self.period_d.is_none_or(|wanted_d| is_same(wanted_d, known.period_d[0]));
        let known = ephemerides(settings).into_iter().find(is_wanted);
        let prot = settings.star.rotation_period_d;
        let of_config = || {
            let own = settings.values[Parameter::K] > 0.0;
            known.map(|known| known.period_d[0]).or(own.then_some(prot * settings.values[Parameter::PorbOverProt]))
        };
        let Some(period_d) = self.period_d.or_else(of_config) else {
            let problem = "no planet there, and --next chooses nights for one: give its period by --period-d";
            return Err(settings.fault("planet", problem));
        };
        match self.other_d {
            Some(other_d) if is_same(period_d, other_d) => {
                let problem = format!("the planet has the period of --alias-d itself, {other_d} d: give another one");
                Err(settings.fault("planet", &problem))
            }
            Some(other_d) => Ok(Aim::Alias { period_d, other_d }),
            None => {
                // at the ephemeris itself
                let period_d = known.map_or(period_d, |known| known.period_d[0]);
                Ok(Aim::Amplitude { period_d, ephemeris: known })
            }
        }
    }
}

/// Why there is no forecast.
#[derive(Debug, thiserror::Error)]
pub enum ForecastError {
    /// A config is no schedule.
    #[error(transparent)]
    Campaign(#[from] CampaignError),
    /// A schedule has too few times.
    #[error("{configs}: {source}")]
    TooFewTimes {
        /// The configs.
        configs: String,
        /// The error in their number.
        source: FrequencyError,
    },
    /// A schedule cannot be evaluated.
    #[error(transparent)]
    Plan(#[from] PlanError),
}

impl Forecast {
    /// For the schedules in `configs`, at least one; for each as many as there are numbers of `nights`, if any are
    /// given; for each the `next` nights, where requested. `report` is called with the current stage.
    ///
    /// # Errors
    /// [`ForecastError`].
    pub fn of(
        configs: &[Config],
        (nights, next): (&[usize], Option<Next>),
        periods: FrequencySettings,
        settings: &PlanSettings,
        report: &dyn Fn(&str),
    ) -> Result<Self, ForecastError> {
        let frequencies = |error: FrequencyError| match error {
            FrequencyError::TooFewTimes(_) => {
                let names: Vec<String> = configs.iter().map(|config| shown(config.path())).collect();
                ForecastError::TooFewTimes { configs: names.join(", "), source: error }
            }
            error => PlanError::from(error).into(),
        };
        let mut campaigns = Vec::new();
        for config in configs {
            report(&format!("reading {}", shown(config.path())));
            campaigns.extend(Campaign::of(config, nights, report)?);
        }
        let aims = next.map(|next| campaigns.iter().map(|campaign| next.aim(campaign)).collect::<Result<Vec<_>, _>>());
        let aims = aims.transpose().map_err(CampaignError::from)?;
        let range = range_d(&campaigns, periods).map_err(frequencies)?;
        let compared = compared_d(&campaigns, range);
        let one = |campaign: Campaign| {
            report(&campaign.name);
            let outlooks = outlook(&campaign, range, settings, report).map_err(|error| match error {
                PlanError::Frequencies(error) => frequencies(error),
                error => error.into(),
            })?;
            Ok::<_, ForecastError>((campaign, outlooks))
        };
        let campaigns = campaigns.into_iter().map(one).collect::<Result<Vec<_>, _>>()?;
        let mut file = PlanFile::new(&looked(&campaigns), range, &compared, settings);
        if let Some((next, aims)) = next.zip(aims) {
            for (((campaign, _), aim), schedule) in campaigns.iter().zip(&aims).zip(&mut file.schedules) {
                schedule.next = Some(choose(campaign, next.nights, aim, settings, report)?);
            }
        }
        Ok(Forecast { campaigns, file })
    }

    /// Writes `plan.json` and `plan.csv` into `folder`, which must exist.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn write(&self, folder: &Path) -> Result<(), WriteError> {
        self.file.write(&looked(&self.campaigns), folder)
    }

    /// The printed output.
    pub fn table(&self) -> String {
        self.file.table()
    }
}

fn looked(campaigns: &[(Campaign, Vec<Outlook>)]) -> Vec<(&Campaign, &[Outlook])> {
    campaigns.iter().map(|(campaign, outlooks)| (campaign, outlooks.as_slice())).collect()
}
