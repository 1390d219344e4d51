//! Observations on disk: `observations.txt`, one line `FILE TIME_DAYS [VRAD_KMS]` a profile (`#` starts a comment), and
//! the LSD profiles it names, relative to its folder (`layout` has their formats).
//!
//! Times are days of one count (`times`). VRAD is subtracted from the velocity axis first; the velocity range is cut in
//! that frame. Stokes V and nulls are not used.

mod axis;
mod error;
mod layout;
mod level;
mod names;
mod text;
mod times;
mod writing;

pub use error::LsdError;
pub use times::LONGEST_D;
pub use writing::{is_written, write, write_as, write_numbers};

use crate::star::observation::{Observations, Profile};
use axis::Axis;
use level::Given;
use sha2::{Digest, Sha256};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use text::{MIN_BINS, RawProfile, shown};

/// What to do with the profiles on reading.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ReadOptions {
    /// First and last velocity to keep (km/s, after subtraction of VRAD); all bins if `None`.
    pub velocity_range_kms: Option<(f64, f64)>,
    /// Factor on every sigma.
    pub sigma_scale: f64,
}

impl Default for ReadOptions {
    fn default() -> Self {
        ReadOptions { velocity_range_kms: None, sigma_scale: 1.0 }
    }
}

/// Observations together with the fingerprint of the files they came from.
#[derive(Clone, Debug, PartialEq)]
pub struct DataSet {
    /// The profiles after subtraction of VRAD, cut and scaling.
    pub observations: Observations,
    /// SHA-256 (hex) of the bytes of the list and of every profile, in the order of the list.
    pub sha256: String,
    /// What was made of the files that a reader of results must know, one line each.
    pub remarks: Vec<String>,
}

/// What a list says of a profile beside its time.
#[derive(Clone, Debug, PartialEq)]
pub struct Label {
    /// Its file, as the list names it.
    pub file: String,
    /// Velocity that is subtracted from its axis (km/s).
    pub vrad_kms: f64,
}

/// One line of the list.
struct Entry {
    line: usize,
    file: String,
    path: PathBuf,
    time_d: f64,
    vrad_kms: f64,
}

/// Reads the list at `list` and all profiles it names.
///
/// # Errors
/// A file that cannot be read, a line that makes no sense, a list of one profile, profiles on different velocity axes,
/// or a velocity range that leaves fewer than five bins of a profile.
pub fn read(list: &Path, options: &ReadOptions) -> Result<DataSet, LsdError> {
    let bytes = std::fs::read(list).map_err(|source| LsdError::Read { path: list.into(), source })?;
    read_listed(list, &bytes, options)
}

/// Reads all profiles that a list of the content `bytes` names, which is or will be at `list`.
///
/// # Errors
/// As [`read`].
pub fn read_listed(list: &Path, bytes: &[u8], options: &ReadOptions) -> Result<DataSet, LsdError> {
    let entries = parse_list(list, &String::from_utf8_lossy(bytes))?;
    // a list that is none, a profile for one, is told of by what it names
    entries.iter().filter(|entry| !entry.path.exists()).try_for_each(|entry| read_profile(list, entry).map(drop))?;
    times::check(&entries).map_err(|(line, problem)| LsdError::Line { path: list.into(), line, problem })?;
    read_entries(list, bytes, &entries, options)
}

/// Reads the list at `list`, which [`write()`] wrote, and all profiles it names: of a simulation, whatever its times
/// are.
///
/// # Errors
/// As [`read`], but for the times.
pub fn read_written(list: &Path, options: &ReadOptions) -> Result<DataSet, LsdError> {
    let bytes = std::fs::read(list).map_err(|source| LsdError::Read { path: list.into(), source })?;
    let entries = parse_list(list, &String::from_utf8_lossy(&bytes))?;
    read_entries(list, &bytes, &entries, options)
}

fn read_entries(list: &Path, bytes: &[u8], entries: &[Entry], options: &ReadOptions) -> Result<DataSet, LsdError> {
    let mut hash = Sha256::new();
    hash.update(bytes);
    let mut first: Option<(&Path, Axis)> = None;
    let mut profiles = Vec::with_capacity(entries.len());
    let mut found = Found::default();
    for entry in entries {
        let bytes = read_profile(list, entry)?;
        hash.update(&bytes);
        let raw = text::parse(&String::from_utf8_lossy(&bytes)).map_err(|fault| match fault.line {
            0 => LsdError::File { path: entry.path.clone(), problem: fault.problem },
            line => LsdError::Line { path: entry.path.clone(), line, problem: fault.problem },
        })?;
        let (first_path, axis) = *first.get_or_insert((&entry.path, raw.axis));
        if !axis.agrees_with(&raw.axis) {
            return Err(LsdError::Axis {
                path: entry.path.clone(),
                axis: raw.axis.to_string(),
                first: first_path.into(),
                expected: axis.to_string(),
            });
        }
        found.note(entry, &raw);
        profiles.push(in_star_frame(entry, RawProfile { axis, ..raw }, options)?);
    }
    match first {
        Some(_) => Ok(DataSet {
            observations: Observations { profiles },
            sha256: format!("{:x}", hash.finalize()),
            remarks: found.remarks(entries.len()),
        }),
        None => Err(LsdError::File { path: list.into(), problem: "lists no profile".into() }),
    }
}

/// Profiles by what is to be said of them.
#[derive(Default)]
struct Found(BTreeMap<Finding, Vec<String>>);

#[derive(PartialEq, Eq, PartialOrd, Ord)]
enum Finding {
    Given(Given),
    FirstOf(usize),
}

impl Found {
    fn note(&mut self, Entry { file, .. }: &Entry, raw: &RawProfile) {
        let given = Some(Finding::Given(raw.given)).filter(|_| raw.given != Given::Intensity);
        let several = Some(Finding::FirstOf(raw.profiles)).filter(|_| raw.profiles > 1);
        for finding in given.into_iter().chain(several) {
            self.0.entry(finding).or_default().push(file.clone());
        }
    }

    fn remarks(&self, all: usize) -> Vec<String> {
        let remark = |(finding, files): (&Finding, &Vec<String>)| {
            let which = match files.len() {
                count if count == all => "all of them".to_owned(),
                1 => shown(&files[0]),
                count => format!("{count} of {all}, {} the first", shown(&files[0])),
            };
            match finding {
                Finding::Given(given) => format!("{which}: {}", given.remark()),
                Finding::FirstOf(profiles) => {
                    format!("{which}: the first of {profiles} mean profiles in the file is used")
                }
            }
        };
        self.0.iter().map(remark).collect()
    }
}

/// What the list at `list` says of its profiles, in its order.
///
/// # Errors
/// A list that cannot be read or makes no sense.
pub fn labels(list: &Path) -> Result<Vec<Label>, LsdError> {
    let bytes = std::fs::read(list).map_err(|source| LsdError::Read { path: list.into(), source })?;
    let entries = parse_list(list, &String::from_utf8_lossy(&bytes))?;
    Ok(entries.into_iter().map(|Entry { file, vrad_kms, .. }| Label { file, vrad_kms }).collect())
}

/// The list at `list` and the profiles that it names, as far as it can be read.
pub fn files(list: &Path) -> Vec<PathBuf> {
    let folder = list.parent().unwrap_or(Path::new(""));
    let profiles = labels(list).unwrap_or_default();
    std::iter::once(list.to_owned()).chain(profiles.into_iter().map(|profile| folder.join(profile.file))).collect()
}

fn read_profile(list: &Path, entry: &Entry) -> Result<Vec<u8>, LsdError> {
    std::fs::read(&entry.path).map_err(|source| LsdError::Profile {
        list: list.into(),
        line: entry.line,
        profile: entry.path.clone(),
        source,
    })
}

fn parse_list(list: &Path, text: &str) -> Result<Vec<Entry>, LsdError> {
    let folder = list.parent().unwrap_or(Path::new(""));
    let mut entries = Vec::new();
    for (line, text) in text.lines().enumerate().map(|(k, text)| (k + 1, text)) {
        let fields: Vec<&str> = text.split_whitespace().take_while(|f| !f.starts_with('#')).collect();
        let fail = |problem| LsdError::Line { path: list.into(), line, problem };
        let number = |name: &str, field: &str| match field.parse::<f64>() {
            Ok(value) if value.is_finite() => Ok(value),
            _ => Err(fail(format!("{name} {} is not a finite number", shown(field)))),
        };
        let (file, time_d, vrad_kms) = match fields[..] {
            [] => continue,
            [file, time] => (file, number("time", time)?, 0.0),
            [file, time, vrad] => (file, number("time", time)?, number("radial velocity", vrad)?),
            _ => return Err(fail(format!("{} columns where FILE TIME_DAYS [VRAD_KMS] is due", fields.len()))),
        };
        entries.push(Entry { line, file: file.to_owned(), path: folder.join(file), time_d, vrad_kms });
    }
    Ok(entries)
}

/// Subtracts VRAD, cuts the velocity range, scales sigma.
fn in_star_frame(entry: &Entry, raw: RawProfile, options: &ReadOptions) -> Result<Profile, LsdError> {
    let axis = Axis { first: raw.axis.first - entry.vrad_kms, ..raw.axis };
    let (lo, hi) = options.velocity_range_kms.unwrap_or((f64::NEG_INFINITY, f64::INFINITY));
    // A bin on the edge of the range belongs to it, whatever the rounding of VRAD and step.
    let slack = 1e-6 * axis.step;
    let kept: Vec<usize> = (0..axis.bins).filter(|j| (lo - slack..=hi + slack).contains(&axis.at(*j))).collect();
    let (Some(&begin), Some(&last)) = (kept.first(), kept.last()) else {
        return Err(too_few(entry, &axis, (lo, hi), 0));
    };
    if kept.len() < MIN_BINS {
        return Err(too_few(entry, &axis, (lo, hi), kept.len()));
    }
    let sigma: Vec<f64> = raw.sigma[begin..=last].iter().map(|s| s * options.sigma_scale).collect();
    if let Some(sigma) = sigma.iter().find(|s| !(s.is_finite() && **s > 0.0)) {
        let problem = format!("sigma becomes {sigma} when scaled by {}", options.sigma_scale);
        return Err(LsdError::File { path: entry.path.clone(), problem });
    }
    Ok(Profile {
        time_d: entry.time_d,
        first_velocity_kms: axis.at(begin),
        step_kms: axis.step,
        intensity: raw.intensity[begin..=last].to_vec(),
        sigma,
    })
}

fn too_few(entry: &Entry, axis: &Axis, (lo, hi): (f64, f64), bins: usize) -> LsdError {
    let (from, to) = (axis.at(0), axis.at(axis.bins - 1));
    let what = match bins {
        0 if hi < from || lo > to => "lies outside the data".to_string(),
        0 => "holds no bin".to_string(),
        n => format!("holds {n} bins, at least {MIN_BINS} are needed"),
    };
    let problem =
        format!("velocity range [{lo}, {hi}] km/s {what}; the data reach from {from:.3} to {to:.3} km/s after VRAD");
    LsdError::File { path: entry.path.clone(), problem }
}
