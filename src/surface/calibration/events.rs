//! Profiles that all others do not predict, with their own factors on the uncertainties.

use crate::model::ParameterValues;
use crate::surface::Known;
use crate::surface::evolving_map::events::events;
use crate::surface::evolving_map::{Assumed, NoFit};
use crate::surface::imaging::Imager;
use serde::{Deserialize, Serialize};

pub use crate::surface::evolving_map::events::{ByHand, Event};

/// More than this fraction of the profiles are not events: the model or the uncertainties are wrong.
const MOST: f64 = 1.0 / 3.0;

/// Largest number of events that are listed one by one.
const NAMED: usize = 5;

/// The events among some profiles.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Events {
    /// Those with larger uncertainties; none are rescaled where there are too many.
    pub profiles: Vec<Event>,
    /// Number of profiles that the others do not predict, and of all profiles, where that is more than a third of them.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub too_many: Option<[usize; 2]>,
}

impl Events {
    /// The events among the profiles of `imager`, the star at `values` with a field like `near`, without a planet.
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
        Ok(Events::among(found, by_hand))
    }

    /// The events `found` among profiles, given what the user states of each `by_hand`.
    fn among(found: Vec<Event>, by_hand: &[ByHand]) -> Self {
        let all = by_hand.len();
        let unforeseen = found.iter().filter(|event| by_hand[event.profile - 1] != ByHand::Event).count();
        match unforeseen as f64 > MOST * all as f64 {
            true => Events { profiles: Vec::new(), too_many: Some([unforeseen, all]) },
            false => Events { profiles: found, too_many: None },
        }
    }

    /// Factors on the uncertainties of so many profiles.
    pub fn factors(&self, profiles: usize) -> Vec<f64> {
        let mut factors = vec![1.0; profiles];
        self.profiles.iter().for_each(|event| factors[event.profile - 1] = event.sigma_factor);
        factors
    }

    /// The message that there are too many, with its status.
    pub fn too_many(&self) -> Option<String> {
        self.too_many.map(|[events, all]| {
            format!(
                "{events} of {all} profiles are outliers (too-many-events): the model or observations.sigma_scale is \
                wrong; to change no uncertainties set observations.events to \"none\""
            )
        })
    }

    /// One line of text, with the largest of many events; `None` where there is none.
    pub fn line(&self) -> Option<String> {
        let of = |event: &&Event| {
            let Event { profile, time_d, sigma_factor, .. } = event;
            format!("{profile} ({time_d:.4} d, uncertainties × {sigma_factor:.1})")
        };
        let mut named: Vec<&Event> = self.profiles.iter().collect();
        if named.len() > NAMED {
            named.sort_by(|a, b| b.sigma_factor.total_cmp(&a.sigma_factor));
            named.truncate(NAMED);
        }
        let all = named.iter().map(of).collect::<Vec<_>>().join(", ");
        let line = || match self.profiles.len() {
            1 => format!("not predicted by the others: profile {all}"),
            many if many > NAMED => {
                format!("not predicted by the others: {many} profiles (all in measured.events); largest: {all}")
            }
            _ => format!("not predicted by the others: profiles {all}"),
        };
        self.too_many().or((!self.profiles.is_empty()).then(line))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_third_of_the_profiles_are_no_events() {
        let event = |profile: usize| Event { profile, time_d: 0.1, sigma_factor: 2.5, excess: 6.0, p_value: 1e-9 };
        let mut by_hand = vec![ByHand::Open; 12];
        let few = Events::among((1..=4).map(event).collect(), &by_hand);
        assert_eq!((few.factors(12)[3], few.factors(12)[4], few.too_many()), (2.5, 1.0, None));
        let many = Events::among((1..=5).map(event).collect(), &by_hand);
        assert_eq!(many.factors(12), vec![1.0; 12]);
        assert!(many.too_many().unwrap().starts_with("5 of 12 profiles are outliers (too-many-events)"));
        assert_eq!(many.line(), many.too_many());
        // events named by the user do not count
        by_hand[0] = ByHand::Event;
        assert_eq!(Events::among((1..=5).map(event).collect(), &by_hand).profiles.len(), 5);
        let one = Events::among(vec![event(3)], &by_hand).line().unwrap();
        assert_eq!(one, "not predicted by the others: profile 3 (0.1000 d, uncertainties × 2.5)");
        let larger = |k: usize| Event { sigma_factor: k as f64, ..event(k) };
        let seven = Events::among((1..=7).map(larger).collect(), &[ByHand::Event; 24]).line().unwrap();
        assert!(
            seven.starts_with("not predicted by the others: 7 profiles (all in measured.events); largest: 7 (0.1000 d"),
            "{seven}"
        );
        assert!(seven.ends_with(", 3 (0.1000 d, uncertainties × 3.0)"), "{seven}");
    }
}
