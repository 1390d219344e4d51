//! What to search for, and how: one set of options for all commands.

use crate::data::ephemeris::ephemerides;
use crate::data::scene::Scene;
use crate::inference::detection::DetectionSettings;
use crate::planets::periodogram::{Frequencies, FrequencyError, FrequencySettings, SearchSettings};
use crate::surface::SurfaceError;
use crate::surface::expansion::nuisances;

/// What to search for, and how. The default is that of `dimcmc periodogram`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BlindSearchOptions {
    /// Trial periods.
    pub periods: FrequencySettings,
    /// Whether eccentric orbits are fitted around the peaks as well.
    pub eccentric: bool,
    /// Whether a second planet is searched for.
    pub second_planet: bool,
    /// Whether systemic velocity and stellar parameters that are free in the config are held at its values, instead of
    /// marginalised over within their priors.
    pub fixed: bool,
    /// Number of planet-free Monte Carlo realisations for the FAP.
    pub draws: usize,
    /// Seed of these realisations.
    pub seed: u64,
    /// The orbits whose dependence on the target chi2 and on single nights is tested.
    pub robustness: RobustnessOf,
    /// Whether a static map is compared with an evolving one, with no verdict where the spots evolve.
    pub static_check: bool,
}

/// The orbits whose robustness is tested.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RobustnessOf {
    /// The best orbit, whatever it is.
    Any,
    /// A candidate.
    Candidates,
    /// None.
    None,
}

/// Why there is no search.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum BlindSearchError {
    /// No trial periods.
    #[error(transparent)]
    Frequencies(#[from] FrequencyError),
    /// No star, or no orbit at all.
    #[error(transparent)]
    Detection(#[from] SurfaceError),
}

impl Default for BlindSearchOptions {
    fn default() -> Self {
        let SearchSettings { draws, seed } = SearchSettings::default();
        BlindSearchOptions {
            periods: FrequencySettings::default(),
            eccentric: false,
            second_planet: false,
            fixed: false,
            draws,
            seed,
            robustness: RobustnessOf::Any,
            static_check: true,
        }
    }
}

impl BlindSearchOptions {
    /// For commands that continue from the best orbit: `optimise`, `sample`, `batch`.
    pub(super) fn before_a_chain() -> Self {
        BlindSearchOptions { robustness: RobustnessOf::Candidates, ..Default::default() }
    }

    /// The trial periods for the star in `scene`.
    ///
    /// # Errors
    /// Invalid periods, too few profiles.
    #[doc(hidden)]
    pub fn frequencies(&self, scene: &Scene) -> Result<Frequencies, FrequencyError> {
        Frequencies::new(&scene.imager.cycles(), scene.imager.star.rotation_period_d, self.periods)
    }

    /// The settings of the search of the star in `scene`.
    #[doc(hidden)]
    pub fn detection(&self, scene: &Scene) -> DetectionSettings {
        let surface = scene.surface();
        DetectionSettings {
            surface: if self.static_check { surface } else { surface.without_comparison() },
            nuisances: if self.fixed { Vec::new() } else { nuisances(&scene.settings.free) },
            search: SearchSettings { draws: self.draws, seed: self.seed },
            eccentric: self.eccentric,
            second_planet: self.second_planet,
            known: ephemerides(&scene.settings),
            other_rotation: scene.measured.other_rotation,
        }
    }
}
