//! The activity-free velocities of a blind search for RV packages: a folder with a table for each of them, the full
//! covariance, a likelihood for it in Python, and the loss without it.
//!
//! Most packages assume independent velocities. Those of a spotted star are not: errors in the spots persist from one
//! night to the next, and all profiles share the systemic velocity.

mod loss;

use super::ExportError;
use super::place::{begins_with, check_folder, check_name, claim_parent};
use crate::data::io::FileError;
use crate::data::io::atomic::{self, WriteError, write_set};
use crate::data::io::csv::{Columns, DATA_SET};
use crate::runs::blind_search::{FILE, PeriodogramFile};
use crate::runs::origin;
use crate::surface::{ConstantVelocity, FoundDrift};
use loss::Loss;
use nalgebra::{DMatrix, DVector};
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

/// Metres in a kilometre.
const M: f64 = 1000.0;

/// The instrument in tables that name one, for one data set.
const INSTRUMENT: &str = "dimcmc";

const README: &str = "README.txt";
const COVARIANCE: &str = "covariance_m2s2.csv";
const LIKELIHOOD: &str = "rv_likelihood.py";

/// The beginning of [`README`].
const TITLE: &str = "Radial velocities free of spots, by dimcmc";

/// The velocities of a search.
struct Velocities {
    times_d: Vec<f64>,
    /// km/s.
    kms: DVector<f64>,
    /// km^2/s^2.
    covariance: DMatrix<f64>,
    /// Name of the data set of each; empty where there is only one.
    sets: Vec<String>,
}

/// Writes the velocities of the search in `folder` to the folder `out`; an earlier export there is replaced if
/// `replace`. Returns the files.
///
/// # Errors
/// [`ExportError`]: no search there, files that are wrong, a folder that cannot be written.
pub fn write(folder: &Path, out: &Path, replace: bool) -> Result<Vec<PathBuf>, ExportError> {
    let search: PeriodogramFile = origin::read(folder, FILE)?;
    let velocities = Velocities::read(folder, &search)?;
    check_name(out)?;
    let check = || check_folder(out, replace, &|folder| begins_with(&folder.join(README), TITLE.as_bytes()));
    let _claimed = claim_parent(out, check)?;
    std::fs::create_dir_all(out).map_err(|source| WriteError { path: out.into(), source })?;
    let loss = Loss::new(&velocities.times_d, &velocities.covariance, search.best.period_d);
    let files = [
        (README, readme(&search, &velocities, loss.as_ref())),
        ("radvel.csv", velocities.table("time,mnvel,errvel,tel\n", ",", M, true)),
        ("juliet.dat", velocities.table("", " ", M, true)),
        ("kima.txt", velocities.table("time vrad svrad\n", " ", M, false)),
        ("pyaneti.dat", velocities.table("# time rv err telescope\n", " ", 1.0, true)),
        (COVARIANCE, velocities.covariance_m2s2()),
        (LIKELIHOOD, include_str!("rv_likelihood.py").to_owned()),
    ];
    write_set(out, &|stage| {
        files.iter().try_for_each(|(name, text)| atomic::write(&stage.join(name), text.as_bytes()))
    })?;
    Ok(files.iter().map(|(name, _)| out.join(name)).collect())
}

impl Velocities {
    fn read(folder: &Path, search: &PeriodogramFile) -> Result<Self, ExportError> {
        let path = folder.join("rv.csv");
        let table = Columns::read(&path)?;
        let (times_d, kms) = (table.column("time_d")?.to_vec(), table.column("rv_kms")?.to_vec());
        let path_of_matrix = folder.join("covariance.csv");
        let covariance = matrix(&path_of_matrix, times_d.len())?;
        if !kms.iter().chain(covariance.as_slice()).all(|x| x.is_finite()) {
            let problem = "the profiles do not bound all velocities: there is nothing to pass on";
            return Err(FileError::of(&path, problem).into());
        }
        positive(&covariance).map_err(|(line, problem)| FileError::Line { path: path_of_matrix, line, problem })?;
        let names: Vec<&String> = search.provenance.measured.sets.iter().map(|set| &set.name).collect();
        let name = |number: &f64| names.get((*number as usize).saturating_sub(1)).map(|name| (*name).clone());
        let sets = table.column(DATA_SET).ok().and_then(|column| column.iter().map(name).collect());
        Ok(Velocities { times_d, kms: DVector::from_vec(kms), covariance, sets: sets.unwrap_or_default() })
    }

    /// Time, velocity and uncertainty in units of the km/s over `unit`, and optionally the instrument.
    fn table(&self, head: &str, between: &str, unit: f64, instrument: bool) -> String {
        let mut text = head.to_owned();
        for (k, time_d) in self.times_d.iter().enumerate() {
            let (velocity, error) = (self.kms[k] * unit, self.covariance[(k, k)].sqrt() * unit);
            let _ = write!(text, "{time_d}{between}{velocity}{between}{error}");
            if instrument {
                let name = self.sets.get(k).map_or(INSTRUMENT, |name| name);
                let _ = write!(text, "{between}{name}");
            }
            text.push('\n');
        }
        text
    }

    fn covariance_m2s2(&self) -> String {
        let row = |k: usize| {
            let numbers: Vec<String> = self.covariance.row(k).iter().map(|c| (c * M * M).to_string()).collect();
            numbers.join(",") + "\n"
        };
        (0..self.times_d.len()).map(row).collect()
    }

    /// chi2 without a planet, by the full covariance (if it has an inverse) and by its diagonal alone.
    fn chi2(&self) -> [Option<f64>; 2] {
        let full = self.covariance.clone().cholesky().map(|factor| self.kms.dot(&factor.solve(&self.kms)));
        let alone = self.kms.iter().zip(self.covariance.diagonal().iter()).map(|(v, c)| v * v / c).sum();
        [full, Some(alone)]
    }
}

/// `n` lines of `n` numbers, without a head.
fn matrix(path: &Path, n: usize) -> Result<DMatrix<f64>, FileError> {
    let text = std::fs::read_to_string(path).map_err(|source| FileError::Read { path: path.into(), source })?;
    let mut numbers = Vec::with_capacity(n * n);
    for (k, line) in text.lines().enumerate() {
        let wrong = |problem: String| FileError::Line { path: path.into(), line: k + 1, problem };
        let before = numbers.len();
        for cell in line.split(',') {
            let number: f64 = cell.trim().parse().map_err(|_| wrong(format!("{cell:?} is not a number")))?;
            numbers.push(number);
        }
        if numbers.len() - before != n {
            return Err(wrong(format!("{} numbers instead of {n}, one for each velocity", numbers.len() - before)));
        }
    }
    match numbers.len() == n * n {
        true => Ok(DMatrix::from_row_slice(n, n, &numbers)),
        false => Err(FileError::of(path, format!("{} lines instead of {n}, one for each velocity", numbers.len() / n))),
    }
}

/// Rounding of a covariance, relative to its largest numbers.
const ROUNDING: f64 = 1e-9;

/// Checks that a covariance is valid: positive variances, symmetric, no direction of negative variance. An error has
/// its line.
fn positive(covariance: &DMatrix<f64>) -> Result<(), (usize, String)> {
    let variance = |k: usize| covariance[(k, k)];
    let cure = "is this file as `dimcmc periodogram` wrote it? Run the search again";
    for k in 0..covariance.nrows() {
        if variance(k) <= 0.0 {
            return Err((
                k + 1,
                format!("the variance of velocity {} is {:e}, not above 0: {cure}", k + 1, variance(k)),
            ));
        }
        let far = |j: &usize| {
            let scale = (variance(k) * variance(*j)).sqrt();
            (covariance[(k, *j)] - covariance[(*j, k)]).abs() > ROUNDING * scale
        };
        if let Some(j) = (0..k).find(far) {
            let problem = format!("number {} differs from number {} of line {}: {cure}", j + 1, k + 1, j + 1);
            return Err((k + 1, problem));
        }
    }
    // for correlations, so that all directions count equally
    let correlation = DMatrix::from_fn(covariance.nrows(), covariance.ncols(), |j, k| {
        covariance[(j, k)] / (variance(j) * variance(k)).sqrt()
    });
    let lowest = correlation.symmetric_eigenvalues().min();
    match lowest < -1e3 * ROUNDING {
        true => Err((1, format!("no covariance: a direction has a variance below 0 ({lowest:.1e}): {cure}"))),
        false => Ok(()),
    }
}

fn readme(search: &PeriodogramFile, velocities: &Velocities, loss: Option<&Loss>) -> String {
    let from = match search.systemic_velocity {
        Some(ConstantVelocity { value_kms, sigma_kms }) => format!("{value_kms:.4} ± {sigma_kms:.4} km/s."),
        None => "of the config.".to_owned(),
    };
    let slope = search.drift.map_or_else(String::new, |FoundDrift { kms_d, .. }| {
        format!(", and a slope: that of the drift,\n{:.2} m/s/d, is subtracted", 1000.0 * kms_d)
    });
    let mut text = format!(
        "{TITLE} {}\n\n\
        {} velocities and their covariance, spots marginalised out. Times are days, as in the list of profiles.\n\
        Velocities are relative to the systemic velocity {}\n\
        Uncertainties and covariance exclude the common RV offset of each data set: leave a constant velocity free in\n\
        every fit, for each data set{slope}.\n\n\
        radvel.csv           m/s   radvel: time, mnvel, errvel, tel\n\
        juliet.dat           m/s   juliet: time, velocity, error, instrument; no header\n\
        kima.txt             m/s   kima: time, velocity, error; RVData('kima.txt', skip=1)\n\
        pyaneti.dat          km/s  pyaneti: time, velocity, error, telescope\n\
        {COVARIANCE}  m2/s2 the full covariance, in the order of the tables; no header\n\
        {LIKELIHOOD}           it as a likelihood of radvel, and as the noise of tinygp\n\n",
        search.provenance.version,
        velocities.times_d.len(),
        from
    );
    text += "Without the covariance\n\n\
        Uncertainties in the tables are the square roots of its diagonal. Velocities of a spotted star are not\n\
        independent. A package that assumes independence is off by this much:\n\n";
    if let Some(loss) = loss {
        let Loss { quoted, achieved, reduced_chi2 } = *loss;
        let _ = writeln!(
            text,
            "sigma_K at {:.4} d (circular orbit, constant velocity free), over that with the full covariance:\n  \
            as quoted by such a package: {quoted:.2}\n  true uncertainty: {achieved:.2}\n\
            mean reduced chi2 of its best orbit: {reduced_chi2:.3} instead of 1",
            search.best.period_d
        );
    }
    if let [Some(full), Some(alone)] = velocities.chi2() {
        let _ = writeln!(
            text,
            "chi2 of these {} velocities without a planet: {full:.1}, by the diagonal alone {alone:.1}",
            velocities.times_d.len()
        );
    }
    text += "\nA fitted jitter does not correct this: it is independent from profile to profile.\n";
    text
}
