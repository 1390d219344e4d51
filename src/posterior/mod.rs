//! What the profiles say of the parameters of star and orbit: the method itself.
//!
//! The path of a vector of parameters: [`objective`] resolves it into values of star and orbit, [`imaging`] joins the
//! star's response with the profiles, the maximum-entropy solver makes the image, and `objective` its
//! log-probability. [`nuisances`] are what profiles have beside the star, [`photometry`] are light curves. Where stars
//! change, [`marginal`] takes the place of the image: all maps are integrated over.
//!
//! Around one image: [`fit`] is the map with its checks, [`expansion`] the quadratic in the velocities of the profiles
//! and [`detection`] the search of it, [`surrogate`] the posterior that follows from it. Before any: [`first_look`] at
//! the profiles alone, their errors ([`noise`]) and [`zero_points`]. [`simulate`] makes profiles.
//!
//! A new parameter is a variant of `Parameter` in `objective/parameters.rs`, which puts it into the star's state; the
//! compiler then asks for its step (`objective/coordinates.rs`), and for its key and range in `data::config`.

pub mod density;
pub mod detection;
pub mod expansion;
pub mod first_look;
pub mod fit;
pub mod imaging;
pub mod marginal;
pub mod noise;
pub mod nuisances;
pub mod objective;
pub mod photometry;
pub mod simulate;
pub mod surrogate;
pub mod zero_points;
