//! Names of the columns of a CSV file.

/// Where in a row the numbers that are used stand.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Columns {
    /// How many there are.
    pub count: usize,
    pub velocity: usize,
    pub intensity: usize,
    pub sigma: usize,
}

impl Columns {
    /// Velocity, I, sigma, and others after them.
    pub fn usual(count: usize) -> Self {
        Columns { count, velocity: 0, intensity: 1, sigma: 2 }
    }
}

/// A column with the names that it goes by, lower case and letters, digits and `/` alone. The first is the one to use.
type Names = (&'static str, &'static [&'static str]);

const VELOCITY: Names = ("velocity", &["v", "vel", "velocity", "rv", "vrad", "radialvelocity", "velocities"]);
const INTENSITY: Names = (
    "intensity",
    &["i", "i/ic", "ic", "int", "intensity", "stokesi", "speci", "flux", "profile", "lsd", "prof", "1i", "i1"],
);
const SIGMA: Names = (
    "sigma",
    &[
        "sigma",
        "sig",
        "error",
        "err",
        "e",
        "uncertainty",
        "unc",
        "std",
        "sd",
        "stddev",
        "sigmai",
        "sigi",
        "isigma",
        "isig",
        "errori",
        "erri",
        "ierror",
        "ierr",
        "ei",
        "di",
        "uncertaintyi",
        "specsigi",
        "intensityerror",
        "intensityerr",
        "fluxerror",
        "fluxerr",
        "profileerror",
        "eflux",
    ],
);

/// Units of a velocity in km/s, written in the same way.
const KMS: [&str; 6] = ["km/s", "kms", "kms1", "km/s1", "kmpers", "kmsec"];

/// The columns of a line of names.
///
/// # Errors
/// Names that are not those of velocity, intensity and sigma, once each; a velocity in another unit.
pub(super) fn columns(fields: &[&str]) -> Result<Columns, String> {
    let read: Vec<(String, String)> = fields.iter().map(|field| name_and_unit(field)).collect();
    let column = |(name, known): Names| {
        let mut places = read.iter().enumerate().filter(|(_, (found, _))| known.contains(&found.as_str()));
        match (places.next(), places.next()) {
            (Some((place, _)), None) => Ok(place),
            (Some((first, _)), Some((second, _))) => {
                Err(format!("columns {} and {} are both named as the {name}", first + 1, second + 1))
            }
            (None, _) => Err(format!(
                "names no column as the {name}: velocity (or v, vel), intensity (or I, I/Ic, flux) and sigma (or \
                error, \
                 err) are due, in any order"
            )),
        }
    };
    let (velocity, intensity, sigma) = (column(VELOCITY)?, column(INTENSITY)?, column(SIGMA)?);
    let unit = &read[velocity].1;
    match unit.is_empty() || KMS.contains(&unit.as_str()) {
        true => Ok(Columns { count: fields.len(), velocity, intensity, sigma }),
        false => Err(format!("the velocity is in {unit}, km/s is due")),
    }
}

/// A name without blanks, quotes and signs, and the unit in brackets or after the name of a velocity.
fn name_and_unit(field: &str) -> (String, String) {
    let bare = |text: &str| -> String {
        text.chars().filter(|c| c.is_alphanumeric() || *c == '/').flat_map(char::to_lowercase).collect()
    };
    let (name, unit) = match field.split_once(['(', '[']) {
        Some((name, unit)) => (bare(name), bare(unit)),
        None => (bare(field), String::new()),
    };
    for unit in ["kms", "km/s", "ms", "m/s"] {
        let stem = name.strip_suffix(unit).filter(|stem| VELOCITY.1.contains(stem));
        if let Some(stem) = stem {
            return (stem.to_owned(), unit.to_owned());
        }
    }
    (name, unit)
}
