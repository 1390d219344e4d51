//! Orbits of planets around spotted stars: maximum-entropy Doppler imaging inside an ensemble sampler.
//!
//! The idea is that of Petit et al. 2015 (*A maximum entropy approach to detect close-in giant planets around active
//! stars*, A&A 584, A84): a wrong orbit shifts the line profiles against each other, and the map that fits them needs
//! more spots. Here the spots are marginalised and the orbit is sampled, instead of being read off a grid. All formulas
//! are in `docs/method.md`.
//!
//! # The rooms
//!
//! Each knows those above it only, and `mod.rs` of each says what comes in, what goes out and what happens between.
//!
//! | room | holds |
//! |---|---|
//! | `numerics` | vector instructions, units |
//! | `star` | geometry, rotation, local line, spots, orbit, and the response: a brightness map to line profiles |
//! | `maxent` | entropies and the maximum-entropy solver (Skilling & Bryan 1984) |
//! | `field` | Gaussian fields on the sphere and in time, integrated out |
//! | `planets` | periodograms, false alarms, limits, verdicts: planets in the velocities of the profiles |
//! | `sampling` | log-densities, the affine-invariant ensemble, chains, optimiser, landscapes |
//! | `posterior` | parameters and priors, images, objectives, fits, what profiles say by themselves |
//! | `data` | configs, file formats, a config with its observations, a first config |
//! | `runs` | chains and grids on disk, threads and ranks, merging, batches, exports, the paper's rows |
//! | `figures` | figures of a folder, a page of them |
//! | `cli` | the commands |
//!
//! # A map in a few lines
//!
//! ```no_run
//! use dimcmc::{Fit, Reference, Scene};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let scene = Scene::load("configs/demo.json".as_ref())?;
//! let settings = &scene.settings;
//! let reference = Reference::build(&scene.imager, settings.values, settings.imaging.chi2_target.value())?;
//! let fit = Fit::new(&scene.imager, &scene.observations, &reference);
//! println!("spots cover {:.1} %", 100.0 * fit.summary.spottedness);
//! # Ok(())
//! # }
//! ```

// a stream that is gone makes the macros of the standard library panic: see `cli::console`
#![deny(clippy::print_stdout, clippy::print_stderr)]

mod cli;
mod data;
mod field;
mod figures;
mod maxent;
mod numerics;
mod planets;
mod posterior;
mod runs;
mod sampling;
mod star;

/// All rooms, for tests and benchmarks. Not part of the public interface: anything here may change without notice.
#[doc(hidden)]
pub mod internals {
    #![allow(missing_docs)]
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
    pub mod posterior {
        pub use crate::posterior::*;
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

pub use cli::main as command_line;
pub use data::scene::Scene;
pub use posterior::fit::Fit;
pub use posterior::objective::{Posterior, Reference};
pub use runs::run::Run;
pub use sampling::log_density::LogDensity;
