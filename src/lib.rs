//! Orbits of planets around spotted stars: maximum-entropy Doppler imaging inside an ensemble sampler.
//!
//! The idea is that of Petit et al. 2015 (*A maximum entropy approach to detect close-in giant planets around active stars*,
//! A&A 584, A84): a wrong orbit shifts the line profiles against each other, and the map that fits them needs more spots. Here
//! the spots are marginalised and the orbit is sampled, instead of being read off a grid.
//!
//! # From the paper to the modules
//!
//! | in the paper | here |
//! |---|---|
//! | the stellar model: geometry, limb darkening, local line, spots (section 2) | [`star`]: pixels to line profiles |
//! | synthetic data (section 2) | [`simulate`] |
//! | Doppler imaging by maximum entropy (section 3; Skilling & Bryan 1984) | [`maxent`], which knows no stars; [`imaging`] joins the two |
//! | the map at an assumed orbit, and radial velocities without the spots | [`fit`] |
//! | "the orbit that needs the fewest spots" (section 3) | [`objective`]: spottedness, entropy or regularised likelihood as a log-probability |
//! | the landscape of spottedness on a grid of orbits | [`landscape`], computed by [`survey`] |
//! | orbital parameters and error bars from a grid and a paraboloid | [`landscape::paraboloid()`]; in its place [`search`] and [`optimise`] for the optimum, [`ensemble`] for the posterior, and [`comparison`] of the two |
//! | beyond the paper: a blind search for orbits, radial velocities free of spots | [`detection`]: [`expansion`] makes a quadratic in the [`velocities`] of the profiles, [`periodogram`] searches it |
//! | convergence and credible intervals | [`chain`] |
//!
//! # Around them
//!
//! [`first_look`] measures what profiles say by themselves, [`proposal`] makes a first config of it, also of another program's
//! files ([`import`]). [`config`] turns a JSON file into settings, [`io`] reads profiles and writes results, [`scene`] is a config with its
//! observations, [`run`] a chain and [`survey`] a landscape on disk that can be stopped and resumed, [`manifest`] and [`origin`]
//! what they were begun with; [`merge`] and [`batch`] are runs of one star joined and runs of many; [`export`] writes a chain for other programs. [`plot`] draws what a folder holds, with the means of [`mod@figure`], and [`mod@report`] makes a page
//! of it.
//! [`log_density`] is the seam in the middle: the sampler sees parameters go in and log-probabilities come out, and nothing
//! of the star. [`pool`] is behind it: threads, or the ranks of a cluster (`cluster`, feature `mpi`).
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

pub mod batch;
pub mod blind_search;
pub mod chain;
#[cfg(feature = "mpi")]
pub mod cluster;
pub mod comparison;
pub mod config;
pub mod detection;
pub mod ensemble;
pub mod expansion;
pub mod experiments;
pub mod export;
pub mod figure;
pub mod first_look;
pub mod fit;
pub mod imaging;
pub mod import;
pub mod injection;
pub mod io;
pub mod landscape;
pub mod limits;
pub mod log_density;
pub mod manifest;
pub mod maxent;
pub mod merge;
pub mod noise;
pub mod nuisances;
pub mod objective;
pub mod observation;
pub mod optimise;
pub mod optimum;
pub mod origin;
pub mod periodogram;
pub mod plot;
pub mod pool;
pub mod proposal;
pub mod report;
pub mod run;
pub mod scene;
pub mod search;
pub mod simulate;
pub mod star;
pub mod surrogate;
pub mod survey;
pub mod text;
pub mod units;
pub mod vector;
pub mod velocities;
pub mod verdict;
pub mod zero_points;

pub use fit::Fit;
pub use log_density::LogDensity;
pub use objective::{Posterior, Reference};
pub use run::Run;
pub use scene::Scene;
