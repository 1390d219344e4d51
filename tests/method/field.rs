//! The field's evidence against an independent implementation: `ln_evidence`, `gradient` and `information` of stars
//! with evolving spots (`../shared/oracle/evolving`, where it is).
//!
//! The star is implemented here again and plainly, on the pixels of the reference: rings, a Gaussian line, linear limb
//! darkening, rigid or sheared rotation, spots that are dark by a contrast; depths of neighbouring bins are averaged
//! two by two.

use dimcmc::internals::field::{
    Compression, Degrees, Epoch, Evidence, Field, Harmonics, Kernel, Lifetime, Settled, Settling, Sought, Spectrum,
    settle,
};
use nalgebra::{DMatrix, DVector};
use serde_json::Value;
use std::f64::consts::{FRAC_PI_2, PI, TAU};
use std::path::{Path, PathBuf};

/// Largest degree of the reference, number of its rings, and its mean filling.
const DEGREE: usize = 36;
const RINGS: usize = 84;
const MEAN_FILLING: f64 = 0.06;

/// One observed profile: time (d), velocities (km/s), depths and variances.
struct Observed {
    time_d: f64,
    velocity_kms: Vec<f64>,
    depth: Vec<f64>,
    variance: Vec<f64>,
}

/// Depth of the line, before it is divided by the continuum, and continuum: of the unspotted star, and by each
/// coefficient.
struct View {
    line: DVector<f64>,
    continuum: f64,
    line_by: DMatrix<f64>,
    continuum_by: DVector<f64>,
}

struct Star {
    contrast: f64,
    profiles: Vec<Observed>,
    views: Vec<View>,
    degrees: Degrees,
    /// Harmonics (points, H) at which changes are watched.
    watched: DMatrix<f64>,
}

fn number(value: &Value, keys: &[&str]) -> f64 {
    keys.iter().fold(value, |value, key| &value[key]).as_f64().unwrap_or(0.0)
}

fn json(path: &Path) -> Value {
    // Python writes evidences that it could not compute in a way that is not JSON
    let text = std::fs::read_to_string(path).unwrap().replace("-Infinity", "null").replace("Infinity", "null");
    serde_json::from_str(&text).unwrap()
}

fn observed(folder: &Path, line: &str) -> Observed {
    let words: Vec<&str> = line.split_whitespace().collect();
    let text = std::fs::read_to_string(folder.join(words[0])).unwrap();
    let vrad: f64 = words[2].parse().unwrap();
    let rows = text.lines().skip(2).map(|line| {
        let row: Vec<f64> = line.split_whitespace().map(|word| word.parse().unwrap()).collect();
        (row[0] - vrad, 1.0 - row[1], row[2] * row[2])
    });
    let mut profile =
        Observed { time_d: words[1].parse().unwrap(), velocity_kms: vec![], depth: vec![], variance: vec![] };
    for (velocity, depth, variance) in rows {
        profile.velocity_kms.push(velocity);
        profile.depth.push(depth);
        profile.variance.push(variance);
    }
    profile
}

/// Centres (longitude, latitude; rad) and areas (fractions of the star) of the pixels of rings of equal width.
fn pixels() -> Vec<(f64, f64, f64)> {
    let mut pixels = Vec::new();
    let width = PI / RINGS as f64;
    for ring in 0..RINGS {
        let south = ring as f64 * width - FRAC_PI_2;
        let middle = south + 0.5 * width;
        let count = (2.0 * RINGS as f64 * middle.cos()).round_ties_even().max(3.0);
        let area = 0.5 * ((south + width).sin() - south.sin()) / count;
        pixels.extend((0..count as usize).map(|j| ((j as f64 + 0.5) / count * TAU, middle, area)));
    }
    pixels
}

/// Brightness per wavelength of a black body, up to a factor.
fn planck(temperature_k: f64, wavelength_nm: f64) -> f64 {
    1.0 / (1.438777e7 / (wavelength_nm * temperature_k)).exp_m1()
}

impl Star {
    fn load(folder: &Path) -> Self {
        let config = json(&folder.join("config.json"));
        let star = &config["star"];
        let list = std::fs::read_to_string(folder.join("observations.txt")).unwrap();
        let lines = list.lines().filter(|line| !line.trim().is_empty() && !line.starts_with('#'));
        let profiles: Vec<Observed> = lines.map(|line| observed(folder, line)).collect();
        let harmonics = Harmonics::new(DEGREE);
        let pixels = pixels();
        let (longitudes, latitudes): (Vec<f64>, Vec<f64>) = pixels.iter().map(|p| (p.0, p.1)).unzip();
        let basis = harmonics.at(&longitudes, &latitudes);
        let views = profiles.iter().map(|profile| view(&config, profile, &pixels, &basis)).collect();
        let wavelength = number(star, &["wavelength_nm"]);
        let of = |key| planck(number(star, &[key]), wavelength);
        Star {
            contrast: 1.0 - of("spot_k") / of("photosphere_k"),
            profiles,
            views,
            degrees: harmonics.degrees(),
            watched: basis.columns_with_step(0, pixels.len().div_ceil(37), 36).transpose(),
        }
    }

    /// The profile as an epoch that is linear around coefficients.
    fn epoch(&self, k: usize, coefficients: &DVector<f64>) -> Epoch {
        let (profile, view, q) = (&self.profiles[k], &self.views[k], self.contrast);
        let bright = 1.0 - q * MEAN_FILLING;
        let continuum = bright * view.continuum - q * view.continuum_by.dot(coefficients);
        let depth = (bright * &view.line - q * &view.line_by * coefficients) / continuum;
        let jacobian = -(q / continuum) * (&view.line_by - &depth * view.continuum_by.transpose());
        let observed = DVector::from_column_slice(&profile.depth);
        let halved = DVector::from_column_slice(&halved(&profile.variance)) / 2.0;
        Epoch {
            time_d: profile.time_d,
            jacobian: of_pairs(&jacobian).into(),
            misfit: of_pairs(&(&observed - &depth)).column(0).into_owned(),
            beside: 0.0,
            nuisances: DMatrix::zeros(halved.len(), 0),
            common: DMatrix::zeros(halved.len(), 0),
            divisor: DVector::zeros(0),
            variance: halved,
            slopes: of_pairs(&slope(&depth, profile.velocity_kms[1] - profile.velocity_kms[0])),
        }
    }

    /// All profiles.
    fn linearise(&self, coefficients: &DMatrix<f64>) -> Vec<Epoch> {
        (0..self.profiles.len()).map(|k| self.epoch(k, &coefficients.column(k).into_owned())).collect()
    }
}

/// The view of the star in one profile.
fn view(config: &Value, profile: &Observed, pixels: &[(f64, f64, f64)], basis: &DMatrix<f64>) -> View {
    let star = &config["star"];
    let inclination = number(star, &["inclination_deg"]).to_radians();
    let vsini = number(star, &["vsini_kms"]);
    let instrument = 299_792.458 / number(config, &["instrument", "resolving_power"]) / 2.3548;
    let sigma = number(star, &["line", "sigma_kms"]).hypot(instrument);
    let deepest = number(star, &["line", "equivalent_width_kms"]) / (sigma * TAU.sqrt());
    let limb = star["limb_darkening"]["coefficients"][0].as_f64().unwrap();
    let spin = TAU / number(star, &["rotation_period_d"]);
    let shear = number(star, &["domega_rad_d"]);
    let time = profile.time_d - number(star, &["epoch_d"]);
    let mut seen = Vec::new();
    for (p, (longitude, latitude, area)) in pixels.iter().enumerate() {
        let omega = spin - shear * latitude.sin().powi(2);
        let (sin, cos) = (longitude + omega * time).sin_cos();
        let mu = latitude.sin() * inclination.cos() + latitude.cos() * inclination.sin() * cos;
        if mu > 0.0 {
            seen.push((p, area * mu * (1.0 - limb + limb * mu), vsini * omega / spin * latitude.cos() * sin));
        }
    }
    let gaussian = |v: f64| deepest * (-0.5 * (v / sigma).powi(2)).exp();
    let lines = DMatrix::from_fn(profile.velocity_kms.len(), seen.len(), |j, i| {
        seen[i].1 * gaussian(profile.velocity_kms[j] - seen[i].2)
    });
    let rows = DMatrix::from_fn(seen.len(), basis.nrows(), |i, h| basis[(h, seen[i].0)]);
    let weights = DVector::from_iterator(seen.len(), seen.iter().map(|pixel| pixel.1));
    View {
        line: lines.column_sum(),
        continuum: weights.sum(),
        line_by: &lines * &rows,
        continuum_by: rows.tr_mul(&weights),
    }
}

/// Derivative of depths with the velocity of the profile: central differences, one-sided at the ends.
fn slope(depth: &DVector<f64>, step_kms: f64) -> DMatrix<f64> {
    let last = depth.len() - 1;
    DMatrix::from_fn(depth.len(), 1, |j, _| {
        let (below, above) = (j.saturating_sub(1), (j + 1).min(last));
        -(depth[above] - depth[below]) / ((above - below) as f64 * step_kms)
    })
}

/// Means of neighbouring rows; an odd one at the end is left out.
fn of_pairs<C: nalgebra::Dim, S: nalgebra::RawStorage<f64, nalgebra::Dyn, C>>(
    rows: &nalgebra::Matrix<f64, nalgebra::Dyn, C, S>,
) -> DMatrix<f64> {
    DMatrix::from_fn(rows.nrows() / 2, rows.ncols(), |j, c| 0.5 * (rows[(2 * j, c)] + rows[(2 * j + 1, c)]))
}

fn halved(values: &[f64]) -> Vec<f64> {
    values.chunks_exact(2).map(|pair| 0.5 * (pair[0] + pair[1])).collect()
}

fn field(oracle: &Value) -> Field {
    let of = |key| number(oracle, &["hyper", key]);
    let spectrum = Spectrum { amplitude: of("amplitude"), slope: of("slope"), break_degree: 0.0 };
    Field { spectrum, kernel: Kernel::of(Lifetime::Days(of("lifetime_d"))) }
}

/// The most probable field and its evidence, to rounding error.
fn settled(star: &Star, field: Field, compression: Compression) -> Settled {
    let settings = Settling { tolerance: 1e-9, compression, ..Settling::default() };
    let sought = Sought { field, degrees: &star.degrees, watched: &star.watched };
    let start = DMatrix::zeros(star.degrees.len(), star.profiles.len());
    settle(|coefficients| star.linearise(coefficients), sought, start, None, &settings).unwrap()
}

fn largest_error(got: impl Iterator<Item = f64>, wanted: &[f64]) -> f64 {
    let scale = wanted.iter().fold(0.0_f64, |most, x| most.max(x.abs()));
    got.zip(wanted).map(|(got, wanted)| (got - wanted).abs() / scale).fold(0.0, f64::max)
}

/// Relative errors of ln Z, gradient and information (of the largest of each).
fn errors(evidence: &Evidence, oracle: &Value, data: usize) -> [f64; 3] {
    // the reference leaves out the factors 2 pi
    let ln_z = evidence.ln_evidence() + 0.5 * data as f64 * TAU.ln();
    let wanted = number(oracle, &["ln_evidence"]);
    let (gradient, information) = (&evidence.quadratic().gradient, &evidence.quadratic().information);
    let numbers = |value: &Value| value.as_array().unwrap().iter().map(|x| x.as_f64().unwrap()).collect::<Vec<_>>();
    let rows: Vec<f64> = oracle["information"].as_array().unwrap().iter().flat_map(numbers).collect();
    [
        (ln_z / wanted - 1.0).abs(),
        largest_error(gradient.iter().copied(), &numbers(&oracle["gradient"])),
        largest_error(information.iter().copied(), &rows),
    ]
}

fn check(folder: &Path) {
    let oracle = json(&folder.join("oracle.json"));
    let star = Star::load(folder);
    let data = star.profiles.iter().map(|p| p.depth.len() / 2).sum();
    let ln_z = number(&oracle, &["ln_evidence"]).abs();
    // all data, as the reference has them: rounding errors. Compressed: the gradient as exactly, ln Z within what is
    // promised, the information as well as an error of a velocity could ever need it
    let promised = 0.5 * Compression::default().left_out * star.profiles.len() as f64 / ln_z;
    for (compression, most) in
        [(Compression { left_out: 0.0 }, [1e-10; 3]), (Compression::default(), [promised, 1e-10, 1e-6])]
    {
        let settled = settled(&star, field(&oracle), compression);
        let errors = errors(&settled.evidence, &oracle, data);
        println!(
            "{} left out {:.0e}: {data} data as {}, steps {:?}; relative errors of ln Z {:.1e}, gradient {:.1e}, \
            information {:.1e}",
            folder.file_name().unwrap().display(),
            compression.left_out,
            settled.evidence.compressed_len(),
            settled.steps,
            errors[0],
            errors[1],
            errors[2]
        );
        let good = errors.iter().zip(most).all(|(error, most)| *error < most);
        assert!(good, "{}: {errors:?} {most:?}", folder.display());
    }
}

fn folders(parent: PathBuf) -> Vec<PathBuf> {
    let Ok(entries) = std::fs::read_dir(parent) else { return vec![] };
    let mut folders: Vec<PathBuf> = entries.map(|e| e.unwrap().path()).filter(|p| p.is_dir()).collect();
    folders.sort();
    folders
}

/// The folders of the reference, with a message where they are missing.
fn stars() -> Vec<PathBuf> {
    let found = folders(Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/oracle/evolving"));
    if found.is_empty() {
        println!("skipped: no ../shared/oracle/evolving");
    }
    found
}

#[test]
#[ignore = "long: .ci/run has it run"]
fn stars_that_change_have_the_evidence_of_the_reference() {
    stars().iter().for_each(|folder| check(folder));
}
