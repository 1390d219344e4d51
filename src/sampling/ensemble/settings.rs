//! Settings of the sampler: the `sampler` section of the config.
//!
//! Defaults are written here and nowhere else.

use crate::sampling::ensemble::{EnsembleError, MoveWeights};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// How the chain is sampled and when it ends.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct SamplerSettings {
    /// Number of independent ensembles. Convergence is judged between them, so at least 2, better 4.
    pub ensembles: usize,
    /// Walkers of each ensemble: even, at least 4 and at least twice the number of sampled parameters. Default: 32, or
    /// 16 with objective "marginal-likelihood" (some 0.1 s per evaluation); twice the number of sampled parameters, if
    /// that is more.
    pub walkers: Option<usize>,
    /// Step limit. The chain ends earlier once every parameter has reached both goals, `rhat` and `ess`.
    pub steps: usize,
    /// Seed of the random numbers. The same seed gives the same chain, on any number of threads.
    pub seed: u64,
    /// Goal for R-hat, the disagreement between ensembles: above 1; 1.01 is customary.
    pub rhat: f64,
    /// Goal for the effective sample size of every parameter.
    pub ess: f64,
    /// Relative weights of the moves.
    pub moves: MoveWeights,
}

impl Default for SamplerSettings {
    fn default() -> Self {
        SamplerSettings {
            ensembles: 4,
            walkers: None,
            steps: 2000,
            seed: 1,
            rhat: 1.01,
            ess: 1000.0,
            moves: MoveWeights::default(),
        }
    }
}

impl SamplerSettings {
    /// Walkers of each ensemble.
    pub fn walkers(&self) -> usize {
        self.walkers.unwrap_or(WALKERS)
    }

    /// Checks the settings for a density of `dimension` parameters.
    ///
    /// # Errors
    /// [`EnsembleError::Setting`], naming the first key at fault.
    pub fn validate(&self, dimension: usize) -> Result<(), EnsembleError> {
        let refuse = |key, problem| Err(EnsembleError::Setting { key, problem });
        let (walkers, least) = (self.walkers(), 4.max(2 * dimension));
        if dimension == 0 {
            return refuse("parameters", "nothing to sample: at least one parameter is needed".to_owned());
        }
        if self.ensembles == 0 {
            return refuse("sampler.ensembles", "must be at least 1, not 0".to_owned());
        }
        if self.ensembles > MOST_ENSEMBLES {
            return refuse("sampler.ensembles", format!("must be at most {MOST_ENSEMBLES}, not {}", self.ensembles));
        }
        if !walkers.is_multiple_of(2) {
            return refuse("sampler.walkers", format!("must be even, not {walkers}"));
        }
        if walkers < least {
            let why = format!("must be at least {least} for {dimension} sampled parameters, not {walkers}");
            return refuse("sampler.walkers", why);
        }
        let all = self.ensembles.saturating_mul(walkers);
        if all > MOST_WALKERS {
            let whole = format!("in all ensembles must be at most {MOST_WALKERS}, not {all}");
            return refuse("sampler.walkers", whole);
        }
        if self.steps == 0 {
            return refuse("sampler.steps", "must be at least 1, not 0".to_owned());
        }
        if self.steps > MOST_STEPS {
            return refuse("sampler.steps", format!("must be at most {MOST_STEPS}, not {}", self.steps));
        }
        if !(self.rhat.is_finite() && self.rhat > 1.0) {
            return refuse("sampler.rhat", format!("must be a finite number above 1, not {}", self.rhat));
        }
        if !(self.ess.is_finite() && self.ess > 0.0) {
            return refuse("sampler.ess", format!("must be a finite number above 0, not {}", self.ess));
        }
        self.moves.validate()
    }
}

/// Walkers of each ensemble, usually.
const WALKERS: usize = 32;

/// Bound on ensembles: far beyond use.
const MOST_ENSEMBLES: usize = 1000;

/// Bound on the walkers of all ensembles: several for each core of the largest cluster, and a step of them fits the
/// memory.
const MOST_WALKERS: usize = 100_000;

/// Bound on steps: far beyond use, and small enough that counts never overflow.
pub const MOST_STEPS: usize = 1_000_000_000;

#[cfg(test)]
mod tests {
    use super::*;

    fn refused(change: impl FnOnce(&mut SamplerSettings)) -> String {
        let mut settings = SamplerSettings::default();
        change(&mut settings);
        settings.validate(8).unwrap_err().to_string()
    }

    #[test]
    fn errors_name_the_key() {
        assert_eq!(SamplerSettings::default().validate(8), Ok(()));
        assert!(refused(|s| s.walkers = Some(33)).starts_with("sampler.walkers: must be even"));
        assert!(refused(|s| s.walkers = Some(14)).starts_with("sampler.walkers: must be at least 16"));
        assert!(refused(|s| s.ensembles = 0).starts_with("sampler.ensembles"));
        assert!(refused(|s| s.steps = 0).starts_with("sampler.steps"));
        assert!(refused(|s| s.steps = usize::MAX).starts_with("sampler.steps: must be at most"));
        assert!(refused(|s| s.ensembles = 100_000).starts_with("sampler.ensembles: must be at most 1000"));
        assert!(
            refused(|s| s.walkers = Some(1_000_000)).starts_with("sampler.walkers: in all ensembles must be at most")
        );
        assert!(refused(|s| (s.ensembles, s.walkers) = (500, Some(1000))).contains("not 500000"));
        for rhat in [1.0, f64::NAN, f64::INFINITY] {
            assert!(refused(|s| s.rhat = rhat).starts_with("sampler.rhat"));
        }
        for ess in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            assert!(refused(|s| s.ess = ess).starts_with("sampler.ess"));
        }
        assert!(refused(|s| s.moves.stretch = -1.0).starts_with("sampler.moves"));
        let alone = MoveWeights { stretch: 0.0, differential_evolution: 0.0, surrogate: 1.0 };
        assert!(refused(|s| s.moves = alone.clone()).contains("both be zero"));
    }

    #[test]
    fn partial_settings_take_defaults_and_unknown_keys_are_refused() {
        let text = r#"{ "ensembles": 2, "moves": { "stretch": 0.2 } }"#;
        let settings: SamplerSettings = serde_json::from_str(text).unwrap();
        assert_eq!((settings.ensembles, settings.walkers(), settings.ess), (2, 32, 1000.0));
        assert_eq!(settings.moves, MoveWeights { stretch: 0.2, ..MoveWeights::default() });
        assert!(serde_json::from_str::<SamplerSettings>(r#"{ "walker": 2 }"#).is_err());
        let back: SamplerSettings = serde_json::from_str(&serde_json::to_string(&settings).unwrap()).unwrap();
        assert_eq!(back, settings);
    }
}
