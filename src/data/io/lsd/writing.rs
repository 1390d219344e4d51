//! Observations as files: a list and its profiles, which reading gives back.

use super::error::LsdError;
use super::list::Label;
use crate::data::io::atomic::{self, WriteError};
use crate::star::observation::{Observations, Profile};
use std::fmt::Write as _;
use std::path::Path;

/// Name of the list that is written.
const LIST: &str = "observations.txt";

/// Whether [`write()`] may write a file of this name.
pub fn is_written(name: &str) -> bool {
    let number = name.strip_prefix('p').and_then(|rest| rest.strip_suffix(".prof"));
    name == LIST || number.is_some_and(|number| number.len() >= 3 && number.bytes().all(|b| b.is_ascii_digit()))
}

/// Writes `observations.txt` and `p000.prof`, ... (two columns after the velocity) into `folder`, which must exist. The
/// list is written last, so that its presence implies that of the profiles; files of these names are replaced.
///
/// Times are exact, intensities accurate to 5e-13. Profiles that do not share one velocity axis can be written, but not
/// read back.
///
/// # Errors
/// A file that cannot be written.
pub fn write(folder: &Path, observations: &Observations) -> Result<(), WriteError> {
    let with_exposures = observations.profiles.iter().any(|profile| profile.exposure_s.is_some());
    let mut list =
        String::from(if with_exposures { "# file  time_d  vrad_kms  exposure_s\n" } else { "# file  time_d\n" });
    for (k, profile) in observations.profiles.iter().enumerate() {
        let name = format!("p{k:03}.prof");
        let title = format!("Synthetic Stokes I profile {k}");
        save(&folder.join(&name), &profile_text(&title, profile, 0.0))?;
        // Writing to a String cannot fail.
        let _ = match with_exposures {
            true => writeln!(list, "{name} {} 0{}", profile.time_d, exposure(profile)),
            false => writeln!(list, "{name} {}", profile.time_d),
        };
    }
    save(&folder.join(LIST), &list)
}

/// The same for profiles from memory, of any origin.
///
/// # Errors
/// A file that cannot be written.
pub fn write_numbers(folder: &Path, observations: &Observations) -> Result<(), LsdError> {
    let label = |k: usize| Label { file: format!("profile {k}"), path: None, vrad_kms: 0.0, line: 0 };
    let labels: Vec<Label> = (0..observations.profiles.len()).map(label).collect();
    Ok(write_as(folder, observations, &labels, "from arrays")?)
}

/// The same for modified observed profiles, with one of the `labels` each: VRAD stays in the list and in the velocity
/// axis, and a comment names the original file. `what` describes the modification in the title.
///
/// # Errors
/// A file that cannot be written.
pub fn write_as(folder: &Path, observations: &Observations, labels: &[Label], what: &str) -> Result<(), WriteError> {
    let with_exposures = observations.profiles.iter().any(|profile| profile.exposure_s.is_some());
    let mut list = String::from("# file  time_d  vrad_kms");
    list.push_str(if with_exposures { "  exposure_s\n" } else { "\n" });
    for (k, (profile, Label { file, vrad_kms, .. })) in observations.profiles.iter().zip(labels).enumerate() {
        let name = format!("p{k:03}.prof");
        let title = format!("{file} {what}");
        save(&folder.join(&name), &profile_text(&title, profile, *vrad_kms))?;
        // Writing to a String cannot fail.
        let _ = writeln!(list, "{name} {} {vrad_kms}{}  # {file}", profile.time_d, exposure(profile));
    }
    save(&folder.join(LIST), &list)
}

/// The last column of a line, where the exposure time is known.
fn exposure(profile: &Profile) -> String {
    profile.exposure_s.map_or(String::new(), |exposure_s| format!(" {exposure_s}"))
}

fn profile_text(title: &str, profile: &Profile, vrad_kms: f64) -> String {
    let mut text = format!("*** {title}\n {} 2\n", profile.intensity.len());
    for (j, (intensity, sigma)) in profile.intensity.iter().zip(&profile.sigma).enumerate() {
        let velocity = profile.velocity_kms(j) + vrad_kms;
        let _ = writeln!(text, "{velocity:16.9} {intensity:.12} {sigma:.12e}");
    }
    text
}

fn save(path: &Path, text: &str) -> Result<(), WriteError> {
    atomic::write(path, text.as_bytes())
}
