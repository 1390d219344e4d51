//! Orbits of planets around spotted stars: maximum-entropy Doppler imaging inside an ensemble sampler (Petit et al. 2015).

pub mod chain;
pub mod config;
pub mod ensemble;
pub mod fit;
pub mod imaging;
pub mod io;
pub mod log_density;
pub mod manifest;
pub mod maxent;
pub mod objective;
pub mod observation;
pub mod optimise;
pub mod optimum;
pub mod run;
pub mod scene;
pub mod search;
pub mod simulate;
pub mod star;
pub mod units;
