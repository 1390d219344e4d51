//! Observations on disk: `observations.txt`, one line `FILE TIME_DAYS [VRAD_KMS]` per profile (`#` starts a comment;
//! columns that are named may hold exposure times, too), and the LSD profiles it names, relative to its folder
//! (`layout` has their formats).
//!
//! Times are days in one time system (`times`). VRAD is subtracted from the velocity axis; profiles are read over their
//! full width with quoted uncertainties; bad bins are allowed outside the velocities that are used. All are on the bins
//! of the first, before or after VRAD is subtracted; they may begin and end elsewhere. Stokes V and nulls are not used.

mod axis;
mod error;
mod layout;
mod level;
mod list;
mod names;
mod row;
mod text;
mod times;
mod wild;
mod writing;

pub use error::LsdError;
pub use list::{Label, files};
pub use times::LONGEST_D;
pub use writing::{is_written, write, write_as, write_numbers};

use crate::data::io::FileError;
use crate::data::io::table::{self, NotText};
use crate::star::observation::{Observations, Profile};
use axis::Axis;
use level::Given;
use list::{Entry, list_bytes, parse_list};
use row::{Fault, shown};
use sha2::{Digest, Sha256};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};
use text::{MIN_BINS, RawProfile};

/// The profiles of a data set as in their files, with the entry of each in the list.
#[derive(Clone, Debug, PartialEq)]
pub struct ProfileSet {
    /// The profiles over their full width after subtraction of VRAD, with quoted uncertainties.
    pub observations: Observations,
    /// The entry of each in the list.
    pub labels: Vec<Label>,
    /// SHA-256 (hex) of the bytes of the list and of every profile, in the order of the list; `None` for profiles from
    /// memory.
    pub sha256: Option<String>,
    /// Remarks on the files for readers of results, one line each.
    pub remarks: Vec<String>,
}

impl ProfileSet {
    /// The profiles between first and last velocity (km/s), all bins if `None`, with uncertainties times a factor.
    ///
    /// # Errors
    /// Fewer than five bins of a profile, and scaled uncertainties out of range.
    pub fn within(&self, range_kms: Option<(f64, f64)>, sigma_scale: f64) -> Result<Observations, LsdError> {
        let cut = |(profile, label): (&Profile, &Label)| {
            let path = || label.path.clone().unwrap_or_else(|| label.file.clone().into());
            cut(profile, range_kms, sigma_scale).map_err(|problem| LsdError::from(FileError::of(&path(), problem)))
        };
        let profiles = self.observations.profiles.iter().zip(&self.labels).map(cut).collect::<Result<_, _>>()?;
        Ok(Observations { profiles })
    }
}

/// First and last velocity (km/s, after VRAD) that are used.
type Range = (f64, f64);

/// Reads the list at `list` and all profiles it names.
///
/// # Errors
/// A file that cannot be read, an invalid line, a list of one profile, or profiles on different velocity axes.
pub fn read(list: &Path) -> Result<ProfileSet, LsdError> {
    read_around(list, None)
}

/// The profiles that a list names, each in its whole width.
///
/// # Errors
/// A file that cannot be read, an invalid line, a list of one profile, or profiles on different velocity axes.
pub fn read_observations(list: &Path) -> Result<Observations, LsdError> {
    Ok(read(list)?.observations)
}

/// As [`read`], for a velocity range (km/s, after VRAD): bad bins outside are allowed.
///
/// # Errors
/// As [`read`].
pub fn read_around(list: &Path, range_kms: Option<Range>) -> Result<ProfileSet, LsdError> {
    read_listed(list, &list_bytes(list)?, range_kms, FEWEST)
}

/// The same of one of several data sets, which may be a single profile.
///
/// # Errors
/// As [`read`].
pub fn read_one_of_several(list: &Path, range_kms: Option<Range>) -> Result<ProfileSet, LsdError> {
    read_listed(list, &list_bytes(list)?, range_kms, 1)
}

/// Fewest profiles of a star.
pub const FEWEST: usize = 2;

/// Reads all profiles that a list of the content `bytes` names, `fewest` at least, which is or will be at `list`.
///
/// # Errors
/// As [`read`].
pub fn read_listed(list: &Path, bytes: &[u8], range_kms: Option<Range>, fewest: usize) -> Result<ProfileSet, LsdError> {
    let entries = parse_list(list, bytes)?;
    // errors of a file that is not a list, such as a profile, name its entries
    entries.iter().filter(|entry| !entry.path.exists()).try_for_each(|entry| read_profile(list, entry).map(drop))?;
    times::check(&entries, fewest).map_err(|(line, problem)| FileError::Line { path: list.into(), line, problem })?;
    read_entries(list, bytes, entries, range_kms)
}

/// Reads the list at `list`, which [`write()`] wrote, and all profiles it names: of a simulation, with any times.
///
/// # Errors
/// As [`read`], but for the times.
pub fn read_written(list: &Path) -> Result<ProfileSet, LsdError> {
    let bytes = list_bytes(list)?;
    read_entries(list, &bytes, parse_list(list, &bytes)?, None)
}

fn read_entries(
    list: &Path,
    bytes: &[u8],
    entries: Vec<Entry>,
    range_kms: Option<Range>,
) -> Result<ProfileSet, LsdError> {
    let mut hash = Sha256::new();
    hash.update(bytes);
    let mut first: Option<(&Entry, Axis)> = None;
    let mut profiles = Vec::with_capacity(entries.len());
    let mut found = Found::default();
    for entry in &entries {
        let bytes = read_profile(list, entry)?;
        hash.update(&bytes);
        let fail = |fault: Fault| match fault.line {
            0 => FileError::of(&entry.path, fault.problem),
            line => FileError::Line { path: entry.path.clone(), line, problem: fault.problem },
        };
        let text = table::text(&bytes).map_err(|what| FileError::of(&entry.path, no_text(what, entry)))?;
        let raw = text::parse(&text).map_err(fail)?;
        let (first, axis) = *first.get_or_insert((entry, raw.axis));
        // a range within rounding of a bin is kept
        let slack = 1e-6 * axis.step;
        let in_file = |(from, to): Range| (from + entry.vrad_kms - slack, to + entry.vrad_kms + slack);
        let used = raw.usable(range_kms.map(in_file)).map_err(fail)?;
        found.note(entry, &raw, range_kms.is_none() && used.len() < raw.axis.bins);
        profiles.push(Profile {
            time_d: entry.time_d,
            first_velocity_kms: begins((first, axis), (entry, raw.axis), used.start)?,
            step_kms: axis.step,
            intensity: raw.intensity[used.clone()].to_vec(),
            sigma: raw.sigma[used].to_vec(),
            exposure_s: entry.exposure_s,
        });
    }
    match profiles.is_empty() {
        true => Err(FileError::of(list, "lists no profile").into()),
        false => Ok(ProfileSet {
            remarks: [found.remarks(entries.len()), wild(&entries, &profiles)].concat(),
            observations: Observations { profiles },
            sha256: Some(format!("{:x}", hash.finalize())),
            labels: entries.into_iter().map(Label::from).collect(),
        }),
    }
}

/// Velocity (km/s, after VRAD) of bin `start` of a profile, on the bins of the first one: as the files have them, or
/// after VRAD.
fn begins((first, axis): (&Entry, Axis), (entry, own): (&Entry, Axis), start: usize) -> Result<f64, LsdError> {
    let star = axis.moved(-first.vrad_kms);
    let at = |first: f64, bin: i64| first + (bin + start as i64) as f64 * axis.step;
    match (axis.bin_of(&own), star.bin_of(&own.moved(-entry.vrad_kms))) {
        // one of them agrees by chance: the other is nearer by more than rounding
        (Some((_, off)), Some((bin, least))) if off > least + 1e-6 * axis.step => return Ok(at(star.first, bin)),
        (Some((bin, _)), _) => return Ok(at(axis.first, bin) - entry.vrad_kms),
        (None, Some((bin, _))) => return Ok(at(star.first, bin)),
        (None, None) => {}
    }
    let cure = match axis.place(&own) {
        Some(place) => {
            let part = place - place.round();
            format!(
                ", by {:.2} of a bin: resample the profiles onto one axis; where each was shifted together with its \
                 line, its velocity ({:.4} km/s here) in the third column of the list brings them together",
                part.abs(),
                part * axis.step
            )
        }
        None => ", in the width of the bins: resample the profiles onto one axis".to_owned(),
    };
    Err(LsdError::Axis {
        path: entry.path.clone(),
        axis: own.to_string(),
        first: first.path.clone(),
        expected: axis.to_string(),
        cure,
    })
}

/// Advice on a profile that is not text.
fn no_text(what: NotText, Entry { path, .. }: &Entry) -> String {
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    let cure = match what {
        NotText::Fits => format!(
            "; in Python `from astropy.table import Table` and `Table.read({name:?}).write(\"profile.csv\")` make text \
             of its table; name the columns velocity, I and sigma"
        ),
        NotText::Compressed => "; unpack it".to_owned(),
        _ => String::new(),
    };
    format!("is {what}; a profile is text, rows of velocity (km/s), I and sigma{cure}")
}

/// The text of a remark on an outlying bin.
const WILD: &str = "σ off its neighbours";

/// Whether a remark is on an outlying bin, which may explain a bad fit.
pub fn tells_of_wild_bin(remark: &str) -> bool {
    remark.contains(WILD)
}

/// The profiles with an outlying bin, one line each.
fn wild(entries: &[Entry], profiles: &[Profile]) -> Vec<String> {
    let remark = |wild: wild::Wild| {
        let (entry, profile) = (&entries[wild.profile], &profiles[wild.profile]);
        format!(
            "profile {} ({}, {:.4} d): the bin at {:.2} km/s is {:.0}{WILD} (cosmic ray?): repair it, or leave the \
             profile out",
            wild.profile + 1,
            shown(&entry.file),
            entry.time_d,
            profile.velocity_kms(wild.bin),
            wild.errors
        )
    };
    wild::bins(profiles).into_iter().map(remark).collect()
}

/// Profiles by the remark on them.
#[derive(Default)]
struct Found(BTreeMap<Finding, Vec<String>>);

#[derive(PartialEq, Eq, PartialOrd, Ord)]
enum Finding {
    Given(Given),
    FirstOf(usize),
    BadEnds,
    Flags,
}

impl Found {
    fn note(&mut self, Entry { file, .. }: &Entry, raw: &RawProfile, is_cut: bool) {
        let given = Some(Finding::Given(raw.given)).filter(|_| raw.given != Given::Intensity);
        let several = Some(Finding::FirstOf(raw.profiles)).filter(|_| raw.profiles > 1);
        let ends = is_cut.then_some(Finding::BadEnds);
        let flags = raw.is_flagged.then_some(Finding::Flags);
        for finding in given.into_iter().chain(several).chain(ends).chain(flags) {
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
                Finding::BadEnds => {
                    format!("{which}: bins without data (no number, no or a huge sigma, zeros) at the ends left out")
                }
                Finding::Flags => format!("{which}: flags of bins are not used, their errors are"),
            }
        };
        self.0.iter().map(remark).collect()
    }
}

/// How often the profile at each path was opened by this process. A profile is read once in a command: tests count.
static OPENED: Mutex<BTreeMap<PathBuf, usize>> = Mutex::new(BTreeMap::new());

/// How often this process opened the profile at `path`.
pub fn times_opened(path: &Path) -> usize {
    OPENED.lock().unwrap_or_else(PoisonError::into_inner).get(path).copied().unwrap_or(0)
}

fn read_profile(list: &Path, entry: &Entry) -> Result<Vec<u8>, LsdError> {
    *OPENED.lock().unwrap_or_else(PoisonError::into_inner).entry(entry.path.clone()).or_default() += 1;
    std::fs::read(&entry.path).map_err(|source| LsdError::Profile {
        list: list.into(),
        line: entry.line,
        profile: entry.path.clone(),
        source,
    })
}

/// The part of a profile within the velocity range, uncertainties scaled.
fn cut(profile: &Profile, range_kms: Option<(f64, f64)>, sigma_scale: f64) -> Result<Profile, String> {
    let bins = profile.intensity.len();
    let (lo, hi) = range_kms.unwrap_or((f64::NEG_INFINITY, f64::INFINITY));
    // a bin on the edge of the range belongs to it, whatever the rounding of VRAD and step
    let slack = 1e-6 * profile.step_kms;
    let kept: Vec<usize> =
        (0..bins).filter(|j| (lo - slack..=hi + slack).contains(&profile.velocity_kms(*j))).collect();
    if kept.len() < MIN_BINS {
        let (from, to) = (profile.velocity_kms(0), profile.velocity_kms(bins - 1));
        let what = match kept.len() {
            0 if hi < from || lo > to => "lies outside the data".to_string(),
            0 => "holds no bin".to_string(),
            n => format!("holds {n} bins, at least {MIN_BINS} are needed"),
        };
        return Err(format!(
            "velocity range [{lo}, {hi}] km/s {what}; the data reach from {from:.3} to {to:.3} km/s after VRAD"
        ));
    }
    let kept = kept[0]..kept[kept.len() - 1] + 1;
    let sigma: Vec<f64> = profile.sigma[kept.clone()].iter().map(|sigma| sigma * sigma_scale).collect();
    if let Some(sigma) = sigma.iter().find(|sigma| !(sigma.is_finite() && **sigma > 0.0)) {
        return Err(format!("sigma becomes {sigma} when scaled by {sigma_scale}"));
    }
    Ok(Profile {
        first_velocity_kms: profile.velocity_kms(kept.start),
        intensity: profile.intensity[kept].to_vec(),
        sigma,
        ..*profile
    })
}
