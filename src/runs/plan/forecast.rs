//! A whole plan: the schedules of several configs, compared.

use super::{Campaign, CampaignError, Outlook, PlanError, PlanFile, PlanSettings, compared_d, outlook, range_d};
use crate::data::config::Config;
use crate::data::io::atomic::WriteError;
use crate::numerics::text::shown;
use crate::planets::periodogram::{FrequencyError, FrequencySettings};
use std::path::Path;

/// What schedules will show, each with its outlooks.
pub struct Forecast {
    campaigns: Vec<(Campaign, Vec<Outlook>)>,
    file: PlanFile,
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
        /// How few.
        source: FrequencyError,
    },
    /// A schedule cannot be looked at.
    #[error(transparent)]
    Plan(#[from] PlanError),
}

impl Forecast {
    /// Of the schedules in `configs`, one at least; of each as many as there are numbers of `nights`, if any are given.
    /// `report` is told what is under way.
    ///
    /// # Errors
    /// [`ForecastError`].
    pub fn of(
        configs: &[Config],
        nights: &[usize],
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
            campaigns.extend(Campaign::of(config, nights)?);
        }
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
        let file = PlanFile::new(&looked(&campaigns), range, &compared, settings);
        Ok(Forecast { campaigns, file })
    }

    /// Writes `plan.json` and `plan.csv` into `folder`, which must exist.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn write(&self, folder: &Path) -> Result<(), WriteError> {
        self.file.write(&looked(&self.campaigns), folder)
    }

    /// What is printed.
    pub fn table(&self) -> String {
        self.file.table()
    }
}

fn looked(campaigns: &[(Campaign, Vec<Outlook>)]) -> Vec<(&Campaign, &[Outlook])> {
    campaigns.iter().map(|(campaign, outlooks)| (campaign, outlooks.as_slice())).collect()
}
