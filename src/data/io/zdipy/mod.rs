//! Input files of ZDIpy (Folsom et al. 2018, MNRAS 474, 4956; <https://github.com/folsomcp/ZDIpy>): `inzdi.dat`, and
//! the model of the local line beside it (`line`).
//!
//! Lines that begin with `#` and blank ones are comments; values are in a fixed order, one group per line, and text
//! after them on a line is ignored. Older versions have no line for mass and radius. Units and signs are those of this
//! program: degrees, km/s, days, rad/d (equator minus pole); velocities are subtracted from the observed axis;
//! longitudes increase in the sense of rotation, so that those smaller than 0 come into view as cycles grow.

mod line;
mod rows;

pub use line::{LINE_FILE, LocalLineFile};

use crate::data::io::FileError;
use rows::{Row, Rows};
use std::path::{Path, PathBuf};

/// A value and the line (from 1) of the file.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Field<T> {
    /// The value.
    pub value: T,
    /// Its line.
    pub line: usize,
}

/// The target of the fit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Target {
    /// A chi2 per datum.
    Chi2(f64),
    /// An entropy.
    Entropy(f64),
}

/// The allowed brightness of a surface element.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BrightnessEntropy {
    /// Brighter or darker than the photosphere.
    Image,
    /// Up to a limit: dark spots alone.
    FillingFactor,
}

/// One profile.
#[derive(Clone, Debug, PartialEq)]
pub struct ListedProfile {
    /// Its line (from 1).
    pub line: usize,
    /// Its file, relative to the folder that ZDIpy is run in.
    pub file: String,
    /// Julian date.
    pub time_d: f64,
    /// Velocity (km/s) of the line's centre.
    pub vrad_kms: f64,
}

/// The content of `inzdi.dat`.
#[derive(Clone, Debug, PartialEq)]
pub struct Input {
    /// The file.
    pub path: PathBuf,
    /// Inclination (degrees).
    pub inclination_deg: Field<f64>,
    /// Projected equatorial velocity (km/s).
    pub vsini_kms: Field<f64>,
    /// Rotation period of the equator (d).
    pub period_d: Field<f64>,
    /// Equator minus pole (rad/d).
    pub domega_rad_d: Field<f64>,
    /// Mass and radius (solar), both above 0 for an oblate star.
    pub mass_radius: Option<Field<(f64, f64)>>,
    /// Rings of surface elements.
    pub rings: Field<usize>,
    /// The target of the fit.
    pub target: Field<Target>,
    /// Whether the magnetic field is fitted.
    pub magnetic: Field<bool>,
    /// Whether it starts from a file.
    pub magnetic_start: Field<bool>,
    /// Whether the brightness is fitted.
    pub brightness: Field<bool>,
    /// Factor on chi2 of Stokes I.
    pub chi2_scale: f64,
    /// Factor on the entropy of the brightness.
    pub entropy_scale: f64,
    /// Entropy of the brightness.
    pub entropy: Field<BrightnessEntropy>,
    /// Whether the brightness starts from a file.
    pub brightness_start: Field<bool>,
    /// Whether the strength of the line is measured on the profiles.
    pub measured_strength: Field<bool>,
    /// Resolving power.
    pub resolving_power: Field<f64>,
    /// First and last velocity (km/s) that are fitted, from the line's centre.
    pub velocity_range_kms: Field<(f64, f64)>,
    /// Julian date of rotation cycle 0.
    pub epoch_d: Field<f64>,
    /// The profiles.
    pub profiles: Vec<ListedProfile>,
}

impl Input {
    /// Reads the file at `path`.
    ///
    /// # Errors
    /// A file that cannot be read or ends too early, or a line that is invalid or names a profile that is not there.
    pub fn read(path: &Path) -> Result<Self, FileError> {
        let text = read_text(path)?;
        let mut rows = Rows::new(path, &text);
        let star = rows.next("inclination, vsini, period and dOmega")?;
        let mut row = rows.next("mass and radius, or the number of rings")?;
        let mass_radius = match row.columns() {
            1 => None,
            _ => Some(row.field((row.number(0, "mass")?, row.number(1, "radius")?))),
        };
        if mass_radius.is_some() {
            row = rows.next("the number of rings")?;
        }
        let rings = row.field(row.count(0, "number of rings")?);
        let target = target(&rows.next("the target of the fit (C or E)")?)?;
        rows.next("test_aim")?.number(0, "test_aim")?;
        let magnetic = flag(&rows.next("whether to fit the magnetic field")?, "fit magnetic")?;
        let magnetic_start = flag(&rows.next("whether the magnetic field starts from a file")?, "start from a file")?;
        let bright = rows.next("whether to fit the brightness")?;
        let entropy = entropy(&rows.next("the brightness entropy")?)?;
        let brightness_start = flag(&rows.next("whether the brightness starts from a file")?, "start from a file")?;
        let measured = rows.next("whether to measure the strength of the line")?;
        let resolution = rows.next("the resolution")?;
        let range = rows.next("the velocity range")?;
        let epoch = rows.next("the Julian date of rotation cycle 0")?;
        Ok(Input {
            path: path.into(),
            inclination_deg: star.field(star.within(0, "inclination", 0.0, 90.0)?),
            vsini_kms: star.field(star.positive(1, "vsini")?),
            period_d: star.field(star.positive(2, "period")?),
            domega_rad_d: star.field(star.number(3, "dOmega")?),
            mass_radius,
            rings,
            target,
            magnetic,
            magnetic_start,
            brightness: flag(&bright, "fit bright")?,
            chi2_scale: bright.positive(1, "chi^2 scaling")?,
            entropy_scale: bright.number(2, "entropy scaling")?,
            entropy,
            brightness_start,
            measured_strength: flag(&measured, "estimate line strength")?,
            resolving_power: resolution.field(resolution.positive(0, "resolution")?),
            velocity_range_kms: velocity_range(&range)?,
            epoch_d: epoch.field(epoch.number(0, "Julian date")?),
            profiles: profiles(rows, path)?,
        })
    }
}

fn read_text(path: &Path) -> Result<String, FileError> {
    let bytes = std::fs::read(path).map_err(|source| FileError::Read { path: path.into(), source })?;
    Ok(String::from_utf8_lossy(&bytes).into_owned())
}

fn flag(row: &Row, name: &str) -> Result<Field<bool>, FileError> {
    match row.text(0, name)? {
        "0" => Ok(row.field(false)),
        "1" => Ok(row.field(true)),
        other => Err(row.fault(format!("{name} is {other:?}, it must be 0 or 1"))),
    }
}

fn target(row: &Row) -> Result<Field<Target>, FileError> {
    match row.text(0, "kind of target")? {
        "C" => Ok(row.field(Target::Chi2(row.positive(1, "target chi^2")?))),
        "E" => Ok(row.field(Target::Entropy(row.number(1, "target entropy")?))),
        other => Err(row.fault(format!("the target is {other:?}, it must be C (chi^2) or E (entropy)"))),
    }
}

fn entropy(row: &Row) -> Result<Field<BrightnessEntropy>, FileError> {
    match row.text(0, "brightness entropy")? {
        "1" => Ok(row.field(BrightnessEntropy::Image)),
        "2" => Ok(row.field(BrightnessEntropy::FillingFactor)),
        other => Err(row.fault(format!("the brightness entropy is {other:?}, it must be 1 or 2"))),
    }
}

fn velocity_range(row: &Row) -> Result<Field<(f64, f64)>, FileError> {
    let (start, end) = (row.number(0, "vel_start")?, row.number(1, "vel_end")?);
    match start < end {
        true => Ok(row.field((start, end))),
        false => Err(row.fault(format!("vel_start {start} must be below vel_end, which is {end}"))),
    }
}

fn profiles(mut rows: Rows, path: &Path) -> Result<Vec<ListedProfile>, FileError> {
    let mut profiles = Vec::new();
    let folder = path.parent().unwrap_or(Path::new(""));
    while let Some(row) = rows.another() {
        let profile = folder.join(row.text(0, "file name")?);
        if let Err(problem) = std::fs::File::open(&profile) {
            return Err(row.fault(format!("cannot read profile {}: {problem}", profile.display())));
        }
        profiles.push(ListedProfile {
            line: row.line,
            file: row.text(0, "file name")?.to_owned(),
            time_d: row.number(1, "Julian date")?,
            vrad_kms: row.number(2, "centre velocity")?,
        });
    }
    match profiles.is_empty() {
        true => Err(FileError::of(path, "ends before the list of profiles")),
        false => Ok(profiles),
    }
}
