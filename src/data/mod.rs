//! What comes from files, and a first config.
//!
//! The way of a profile: [`config`] names its file and says how it is used; [`io`] reads the file once; [`dataset`]
//! holds the profile as in the file; [`calibrated`] makes of it what enters the model; [`scene`] joins all of these in
//! what a surface model takes, an `Imager`.
//! Neither the settings nor the data set change afterwards.
//!
//! [`simulate`] makes profiles in place of files. [`init`] and [`import`] write a first config, [`diagnosis`] finds out
//! why a model does not fit. [`io`] also has the formats of results, a file each.

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
