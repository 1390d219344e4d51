//! Profiles that all others do not predict, with larger errors of their own.

use crate::model::ParameterValues;
use crate::surface::Known;
use crate::surface::evolving_map::events::{Unpredicted, events};
use crate::surface::evolving_map::{Assumed, NoFit};
use crate::surface::imaging::Imager;
use serde::{Deserialize, Serialize};

pub use crate::surface::evolving_map::events::ByHand;

/// More than this share of the profiles are not events: the model is wrong, or the errors are.
const MOST: f64 = 1.0 / 3.0;

/// A profile that all others do not predict.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Event {
    /// Which profile, from 1.
    pub profile: usize,
    /// Its time (d).
    pub time_d: f64,
    /// Factor on its errors.
    pub sigma_factor: f64,
    /// chi2 per datum given all others, over that of the usual profile.
    pub excess: f64,
    /// Probability that chance alone makes a profile so bad; 1 where a config names it.
    pub p_value: f64,
}

/// The events among some profiles.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Events {
    /// Those whose errors are larger; all profiles keep theirs where there are too many.
    pub profiles: Vec<Event>,
    /// Number of profiles that the others do not predict, where that is more than a third of them.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub too_many: Option<usize>,
}

impl Events {
    /// Of the profiles of `imager`, the star at `values` with a field like `near`, without a planet.
    ///
    /// # Errors
    /// [`NoFit`].
    pub fn of(
        imager: &Imager,
        values: ParameterValues,
        known: &Known,
        near: Assumed,
        by_hand: &[ByHand],
    ) -> Result<Self, NoFit> {
        let found = events(imager, values, known, near, by_hand)?;
        let times_d: Vec<f64> = imager.profiles().map(|(time_d, ..)| time_d).collect();
        let unforeseen = found.iter().filter(|event| by_hand[event.profile] != ByHand::Event).count();
        if unforeseen as f64 > MOST * times_d.len() as f64 {
            return Ok(Events { profiles: Vec::new(), too_many: Some(unforeseen) });
        }
        let event = |Unpredicted { profile, factor, excess, chance }: &Unpredicted| Event {
            profile: profile + 1,
            time_d: times_d[*profile],
            sigma_factor: *factor,
            excess: *excess,
            p_value: *chance,
        };
        Ok(Events { profiles: found.iter().map(event).collect(), too_many: None })
    }

    /// Factors on the errors of so many profiles.
    pub fn factors(&self, profiles: usize) -> Vec<f64> {
        let mut factors = vec![1.0; profiles];
        self.profiles.iter().for_each(|event| factors[event.profile - 1] = event.sigma_factor);
        factors
    }

    /// That there are too many, with a name for it.
    pub fn too_many(&self) -> Option<String> {
        self.too_many.map(|count| {
            format!(
                "too-many-events: {count} profiles are not predicted by the others, more than a third: the model or \
                observations.sigma_scale is wrong, or observations.events is to be \"none\""
            )
        })
    }

    /// It in words; `None` where there is none.
    pub fn line(&self) -> Option<String> {
        let of = |event: &Event| {
            let Event { profile, time_d, sigma_factor, .. } = event;
            format!("{profile} ({time_d:.4} d, errors × {sigma_factor:.1})")
        };
        let all: Vec<String> = self.profiles.iter().map(of).collect();
        self.too_many().or((!all.is_empty()).then(|| format!("profiles {}", all.join(", "))))
    }
}
