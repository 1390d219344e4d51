//! What comes from files, and a first config.
//!
//! The way of a profile: [`config`] names its file and says how it is used; [`dataset`] holds it as it is in the file,
//! which [`io`] reads once; [`calibrated`] makes of it what enters the model; [`scene`] joins all of that. Settings and
//! data set do not change once they are there.
//!
//! [`init`] and [`import`] write a first config, [`diagnosis`] tries out why a model does not fit. `io` also holds the
//! formats of what is written, a file each.

pub mod calibrated;
pub mod config;
pub mod dataset;
pub mod diagnosis;
pub mod ephemeris;
pub mod import;
pub mod init;
pub mod io;
pub mod scene;
pub mod simulate;
