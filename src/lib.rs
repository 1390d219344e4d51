//! Orbits of planets around spotted stars: maximum-entropy Doppler imaging inside an ensemble sampler.
//!
//! The idea is that of Petit et al. 2015 (*A maximum entropy approach to detect close-in giant planets around active
//! stars*, A&A 584, A84): a wrong orbit shifts the line profiles against each other, and the map that fits them needs
//! more spots. Here the spots are marginalised over and the orbit is sampled, instead of being read off a grid. All
//! formulas are in `docs/method.md`.
//!
//! # The rooms
//!
//! Each knows only rooms above it. `mod.rs` of each says what comes in, what goes out and what happens between.
//!
//! | room | holds |
//! |---|---|
//! | `numerics` | vector instructions, units, text in columns |
//! | `star` | geometry, rotation, local line, spots, orbit, and the response: a brightness map to line profiles |
//! | `maxent` | entropies and the maximum-entropy solver (Skilling & Bryan 1984) |
//! | `field` | Gaussian fields on the sphere and in time, marginalised over |
//! | `planets` | planets in the velocities of the profiles: periodograms, false-alarm probabilities, limits, verdicts |
//! | `sampling` | log-densities, the affine-invariant ensemble, chains, optimiser, likelihood grids |
//! | `model` | the parameters: their table, priors, sampling coordinates |
//! | `surface` | what spots do to profiles: static and evolving maps behind one interface |
//! | `inference` | the blind search, the best parameters, Bayes factors |
//! | `data` | configs, file formats, calibration, a config with its observations, a first config |
//! | `runs` | chains, grids and searches on disk, threads and ranks, merging, batches, exports |
//! | `figures` | figures of a folder, a page of them |
//! | `cli` | the commands |
//!
//! # A star in code
//!
//! A config has the keys of `docs/reference/config.md`, read from a file ([`Config::load`]) or built here.
//! A [`Scene`] is a config with its observations, a [`Run`] the chain of its posterior.
//!
//! ```
//! use dimcmc::{Config, Parameter, Prior, Run, Scene};
//! use serde_json::json;
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let cycles: Vec<f64> = (0..12).map(|k| 0.27 * k as f64).collect();
//! let config = Config::default()
//!     .with("star.rotation_period_d", 3.0)
//!     .with("star.inclination_deg", 60.0)
//!     .with("star.vsini_kms", 25.0)
//!     .with("star.line", json!({ "sigma_kms": 4.0, "equivalent_width_kms": 6.0 }))
//!     .with("star.contrast", 0.3)
//!     .with("planet", json!({ "k_kms": 0.3, "porb_over_prot": 1.7, "phi": 0.5 }))
//!     .with("observations.simulate.spots", json!([[40.0, 30.0, 15.0, 0.9], [200.0, 60.0, 12.0, 0.8]]))
//!     .with("observations.simulate.cycles", cycles)
//!     .with("observations.simulate.velocity_kms", json!({ "min": -40.0, "max": 40.0, "step": 2.0 }))
//!     .with("observations.simulate.snr", 1000.0)
//!     .with("imaging", json!({ "objective": "spottedness", "pixels": 500 }))
//!     .with("sampler", json!({ "ensembles": 2, "walkers": 8, "steps": 50, "ess": 100.0, "rhat": 1.1 }))
//!     .free(Parameter::K, Prior::Uniform { min: 0.0, max: 1.0 })
//!     .free(Parameter::Phi, Prior::Periodic);
//! let scene = Scene::new(&config)?;
//! println!("chi2 of the maps: {:.3} per datum", scene.maps(None)?.summary.chi2_per_datum);
//!
//! let mut run = Run::new(&scene)?;
//! run.finish()?;
//! let summary = run.summary()?;
//! println!("{summary}");
//! let k = &summary.parameters["k_kms"];
//! assert!(k.ci95[0] < 0.3 && 0.3 < k.ci95[1]);
//! # Ok(())
//! # }
//! ```
//!
//! Profiles in memory replace files by [`Scene::with_profiles`]; [`Run::new_in`] keeps the chain in a folder, where
//! `dimcmc` can resume it.
//!
//! # Any density
//!
//! The sampler is independent of stars: it samples any [`LogDensity`].
//!
//! ```
//! use dimcmc::{Evaluation, LogDensity, SamplerSettings, sample};
//!
//! /// A Gaussian of two parameters, correlated by 0.8.
//! struct Gaussian([String; 2]);
//!
//! impl LogDensity for Gaussian {
//!     fn names(&self) -> &[String] {
//!         &self.0
//!     }
//!     fn evaluate(&self, x: &[f64]) -> Evaluation {
//!         Evaluation::of(-0.5 * (x[0].powi(2) - 1.6 * x[0] * x[1] + x[1].powi(2)) / 0.36)
//!     }
//! }
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let usual = SamplerSettings::default();
//! let settings = SamplerSettings { ensembles: 2, walkers: Some(10), rhat: 1.05, ess: 500.0, ..usual };
//! let walker = |k: usize| vec![(1.7 * k as f64).sin(), (2.3 * k as f64).cos()];
//! let start: Vec<Vec<Vec<f64>>> = (0..2).map(|e| (10 * e..10 * e + 10).map(walker).collect()).collect();
//! let (chain, summary) = sample(&Gaussian(["x".into(), "y".into()]), &settings, &start)?;
//! assert!(summary.converged && chain.steps() > 20);
//! assert!((summary.parameters["y"].sd - 1.0).abs() < 0.2);
//! # Ok(())
//! # }
//! ```

// a closed stream makes the macros of the standard library panic: see `cli::console`
#![deny(clippy::print_stdout, clippy::print_stderr)]

mod cli;
mod data;
mod field;
mod figures;
mod inference;
mod maxent;
mod model;
mod numerics;
mod planets;
mod runs;
mod sampling;
mod star;
mod surface;

/// All rooms, for tests and benchmarks. Not part of the public interface: anything here may change without notice.
#[doc(hidden)]
pub mod internals {
    #![allow(missing_docs)]
    // what another program needs to behave like the commands
    pub mod cli {
        pub use crate::cli::{Global, cluster, console, main, progress, signals};
    }
    pub mod data {
        pub use crate::data::*;
    }
    pub mod field {
        pub use crate::field::*;
    }
    pub mod figures {
        pub use crate::figures::*;
    }
    pub mod maxent {
        pub use crate::maxent::*;
    }
    pub mod numerics {
        pub use crate::numerics::*;
    }
    pub mod planets {
        pub use crate::planets::*;
    }
    pub mod model {
        pub use crate::model::*;
    }
    pub mod inference {
        pub use crate::inference::*;
    }
    pub mod surface {
        pub use crate::surface::*;
    }
    pub mod runs {
        pub use crate::runs::*;
    }
    pub mod sampling {
        pub use crate::sampling::*;
    }
    pub mod star {
        pub use crate::star::*;
    }
}

pub use cli::{Failure, command_line, first_config};
pub use data::config::{Config, ConfigError};
pub use data::io::lsd::{LsdError, read_observations, write_numbers as write_observations};
pub use data::scene::{Scene, SceneError};
pub use figures::drawing::Figure;
pub use figures::plot::{PlotError, figures};
pub use figures::printed::printed;
pub use figures::report::{is_page as is_report, report};
pub use inference::search::{Found, Progress};
pub use model::{Parameter, Prior};
pub use numerics::text::broken as broken_lines;
pub use planets::occurrence::RatePrior;
pub use planets::periodogram::FrequencySettings;
pub use planets::verdict::{Finding, Remark, Signal, Verdict};
pub use runs::blind_search::{BlindSearch, BlindSearchError, BlindSearchOptions, RobustnessOf, SearchSummary};
pub use runs::detection_limits::{DetectionLimits, LimitsError, LimitsOptions, LimitsProgress};
pub use runs::export::{ExportError, Format, export};
pub use runs::grid_scan::{GridScan, GridScanError};
pub use runs::injected::{InjectError, Injected};
pub use runs::limits::BestOrbit;
pub use runs::log_posterior::LogPosterior;
pub use runs::manifest::RunSummary;
pub use runs::maps::{MapError, Maps};
pub use runs::optimum::OptimumFile;
pub use runs::plan::{Forecast, ForecastError, Next, PlanSettings};
pub use runs::pool::Pool;
pub use runs::run::{Conclusion, Meter, Pace, Run, RunError, StartFrom};
pub use runs::simulated::{SimulateError, Simulated};
pub use runs::survey::{PlanetBox, Size, StarTable, Survey, SurveyError, SurveySettings};
pub use sampling::chain::{Chain, ParameterSummary, Record, Summary};
pub use sampling::ensemble::{EnsembleError, SamplerSettings, StopReason, sample};
pub use sampling::landscape::Rule as ParaboloidRule;
pub use sampling::log_density::{Evaluation, LogDensity, Status};
pub use sampling::optimise::Optimum;
pub use star::Orbit;
pub use star::observation::{Observations, Profile};
pub use surface::{MapSummary, NoMaps, SurfaceMap, SurfaceMaps, VelocityWithoutSpots};
