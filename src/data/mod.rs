//! What comes from files, and a first config.
//!
//! The path of a profile: [`config`] names its file and says how it is used, [`io`] reads it, [`scene`] joins both with
//! what is measured from the profiles themselves.
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
