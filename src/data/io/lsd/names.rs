//! Which columns of a profile are velocity, intensity and sigma, by their names.

use crate::data::io::table::Name;

/// Positions of the used numbers in a row.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Columns {
    /// Number of columns.
    pub count: usize,
    pub velocity: usize,
    pub intensity: usize,
    pub sigma: usize,
    /// The column that says which bins are bad, where there is one.
    pub flag: Option<usize>,
}

impl Columns {
    /// Velocity, I, sigma, and others after them; of four the last is a flag.
    pub fn usual(count: usize) -> Self {
        Columns { count, velocity: 0, intensity: 1, sigma: 2, flag: (count == 4).then_some(3) }
    }
}

/// A column with its accepted names, bare. The first is preferred.
type Names = (&'static str, &'static [&'static str]);

/// In order of preference: `V` may be Stokes V.
const VELOCITY: Names = (
    "velocity",
    &[
        "velocity",
        "vel",
        "velocities",
        "radialvelocity",
        "vrad",
        "vgrid",
        "velgrid",
        "velaxis",
        "rvgrid",
        "vhelio",
        "vbary",
        "rv",
        "v",
    ],
);
const INTENSITY: Names = (
    "intensity",
    &[
        "i/ic",
        "stokesi/ic",
        "stokesi",
        "i",
        "ic",
        "intensity",
        "int",
        "speci",
        "lsdi",
        "ilsd",
        "1i",
        "i1",
        "normflux",
        "fluxnorm",
        "normalisedflux",
        "normalizedflux",
        "normalisedintensity",
        "normalizedintensity",
        "flux",
        "profile",
        "lsd",
        "prof",
        "ccf",
    ],
);
const SIGMA: Names = (
    "sigma",
    &[
        "specsigi",
        "uncertaintyi",
        "sigma",
        "sig",
        "error",
        "errors",
        "err",
        "e",
        "uncertainty",
        "unc",
        "std",
        "sd",
        "stddev",
        "stderr",
        "noise",
    ],
);

/// Words before or behind the name of an intensity that make it the name of its sigma: `sigma_I`, `flux_err`.
const SIGMA_OF: [&str; 12] =
    ["sigma", "sig", "error", "err", "uncertainty", "unc", "stddev", "std", "sd", "noise", "e", "d"];
const FLAGS: [&str; 7] = ["flag", "flags", "quality", "mask", "bad", "badpix", "good"];

/// Units of a velocity in km/s, bare.
const KMS: [&str; 6] = ["km/s", "kms", "kms1", "km/s1", "kmpers", "kmsec"];

/// Units that are written behind the name of a velocity, bare; longer ones first.
const BEHIND: [&str; 6] = ["kms1", "km/s", "kms", "ms1", "m/s", "ms"];

/// The columns of a line of names.
///
/// # Errors
/// Names that do not include velocity, intensity and sigma, once each; a velocity in another unit.
pub(super) fn columns(names: &[Name]) -> Result<Columns, String> {
    let read: Vec<(String, String)> = names.iter().map(name_and_unit).collect();
    let places = |known: Names| -> Vec<usize> {
        (0..read.len()).filter(|place| known.1.contains(&read[*place].0.as_str())).collect()
    };
    let (velocities, intensities) = (places(VELOCITY), places(INTENSITY));
    let of_intensity: Vec<usize> = (0..read.len()).filter(|place| is_sigma_of_intensity(&read[*place].0)).collect();
    let sigmas = places(SIGMA);
    let one = |known: Names, places: &[usize]| match best(&read, known, places)[..] {
        [place] => Ok(place),
        [first, second, ..] => {
            Err(format!("columns {} and {} are both named as the {}", first + 1, second + 1, known.0))
        }
        [] => Err(format!(
            "names no column as the {}: velocity (or v, vel), intensity (or I, I/Ic, flux) and sigma (or error, err) \
             are due, in any order",
            known.0
        )),
    };
    // of two that differ in case alone, V is Stokes V
    let lower: Vec<usize> = velocities.iter().copied().filter(|place| names[*place].written != "V").collect();
    let velocity = one(VELOCITY, if lower.is_empty() { &velocities } else { &lower })?;
    let intensity = one(INTENSITY, &intensities)?;
    // where each quantity has its sigma beside it, that of I comes right after it
    let sigma = match of_intensity[..] {
        [only] => only,
        _ if of_intensity.contains(&(intensity + 1)) => intensity + 1,
        _ if best(&read, SIGMA, &sigmas).len() > 1 && sigmas.contains(&(intensity + 1)) => intensity + 1,
        _ => one(SIGMA, &sigmas)?,
    };
    let flag = read.iter().position(|(name, _)| FLAGS.contains(&name.as_str()));
    let unit = &read[velocity].1;
    match unit.is_empty() || KMS.contains(&unit.as_str()) {
        true => Ok(Columns { count: names.len(), velocity, intensity, sigma, flag }),
        false => Err(format!("the velocity is in {unit}, km/s is due")),
    }
}

/// Whether a name is that of the sigma of the intensity.
fn is_sigma_of_intensity(name: &str) -> bool {
    let rest = |word: &&str| [name.strip_prefix(*word), name.strip_suffix(*word)];
    SIGMA_OF.iter().flat_map(rest).flatten().any(|rest| INTENSITY.1.contains(&rest))
}

/// The positions with the first of the known names that occurs.
fn best(read: &[(String, String)], (_, known): Names, places: &[usize]) -> Vec<usize> {
    let with = |name: &&str| -> Vec<usize> { places.iter().copied().filter(|place| read[*place].0 == *name).collect() };
    known.iter().map(with).find(|places| !places.is_empty()).unwrap_or_default()
}

/// A name, and the unit in brackets or after the name of a velocity.
fn name_and_unit(name: &Name) -> (String, String) {
    for unit in BEHIND {
        let stem = name.bare.strip_suffix(unit).filter(|stem| VELOCITY.1.contains(stem));
        if let Some(stem) = stem {
            return (stem.to_owned(), unit.to_owned());
        }
    }
    (name.bare.clone(), name.unit.clone())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::io::table::readings;

    #[test]
    fn the_intensity_is_found_among_other_quantities() {
        let places = |line: &str, count: usize| {
            let Columns { velocity, intensity, sigma, .. } = columns(&readings(line, count).remove(0)).unwrap();
            [velocity, intensity, sigma]
        };
        assert_eq!(places("velocity,I,sigma_I,V,sigma_V,N,sigma_N", 7), [0, 1, 2]);
        assert_eq!(places("v,I,sigma,V,sigma,N,sigma", 7), [0, 1, 2]);
        assert_eq!(places("V,sigV,I,sigI,RV", 5), [4, 2, 3]);
        assert_eq!(places("vel_km_s I/Ic err_I/Ic", 3), [0, 1, 2]);
        assert_eq!(places("Velocity (km/s),Stokes I,Stokes I error", 3), [0, 1, 2]);
        assert_eq!(places("v,flux,flux_err", 3), [0, 1, 2]);
        assert_eq!(places("N;Velocity (km/s);Stokes I;error", 4), [1, 2, 3]);
        let two = columns(&readings("v,I,I,sigma", 4).remove(0)).unwrap_err();
        assert_eq!(two, "columns 2 and 3 are both named as the intensity");
    }
}
