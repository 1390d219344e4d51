//! Data from files, and a first config.
//!
//! The path of a profile: [`config`] names its file and its use; [`io`] reads the file once; [`dataset`] holds the
//! profile as in the file; [`calibrated`] prepares it for the model; [`scene`] joins all of these in the input of a
//! surface model, an `Imager`. Neither the settings nor the data set change afterwards.
//!
//! [`simulate`] makes profiles in place of files. [`init`] and [`import`] write a first config, [`diagnosis`] finds out
//! why a model does not fit. [`io`] also has the formats of results, one file each.

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
