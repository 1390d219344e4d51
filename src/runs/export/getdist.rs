//! Text files of GetDist (Lewis 2019, arXiv:1910.13970): `ROOT_1.txt`, `ROOT_2.txt`, ... with one row per draw,
//! `ROOT.paramnames`, `ROOT.ranges`.
//!
//! An ensemble is a file, so that GetDist's R-1 (variance of the files' means over mean of their variances) compares
//! independent chains. Rows are weight (always 1), -ln P, the parameters, and as derived parameters the derived
//! quantities and the other values of a draw, in the order of `draws`; the warm-up is omitted, `ignore_rows` should
//! stay 0. `.ranges` has the bounds of the priors, `N` where there is none; a periodic parameter is unwrapped around
//! its mode and its range is one period around that.

use super::draws::Draws;
use super::{Contents, ExportError, Quantity};
use crate::data::io::atomic::{self, WriteError, folder_of, write_set};
use crate::surface::CHI2;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

/// Writes the files.
///
/// # Errors
/// A file that cannot be written.
pub fn write(contents: &Contents, root: &Path) -> Result<(), WriteError> {
    let name = root.file_name().unwrap_or_default();
    write_set(folder_of(root), &|stage| fill(contents, &stage.join(name)))
}

fn fill(contents: &Contents, root: &Path) -> Result<(), WriteError> {
    let draws = Draws::of(&contents.chain, contents.summary.discarded_steps..contents.chain.steps());
    let ensembles = contents.chain.shape().ensembles;
    for ensemble in 0..ensembles {
        let mut text = String::new();
        for record in draws.ensemble(&contents.chain, ensemble) {
            let parameters = contents.parameters.iter().zip(&record.theta).map(|(one, x)| one.unwrapped(*x));
            let numbers = [1.0, -record.log_prob].into_iter().chain(parameters);
            let numbers = numbers.chain(contents.derived.iter().map(|one| one.settled.value(&record.theta)));
            let line: Vec<String> =
                numbers.chain(record.numbers.iter().copied()).map(|number| number.to_string()).collect();
            text += &line.join(" ");
            text.push('\n');
        }
        atomic::write(&chain(root, ensemble), text.as_bytes())?;
    }
    atomic::write(&ending(root, ".paramnames"), paramnames(contents).as_bytes())?;
    atomic::write(&ending(root, ".ranges"), ranges(&contents.parameters).as_bytes())
}

/// All files of an export with so many ensembles.
pub fn files(root: &Path, ensembles: usize) -> Vec<PathBuf> {
    let chains = (0..ensembles).map(|ensemble| chain(root, ensemble));
    chains.chain([".paramnames", ".ranges"].map(|end| ending(root, end))).collect()
}

/// Whether the file, one of [`files`], may be of an earlier export: `ROOT.paramnames` is an export of this program, or
/// the file contains only rows of a chain with the same number of columns (an interrupted export).
pub fn is_own(contents: &Contents, root: &Path, file: &Path) -> bool {
    let read = |path: &Path| std::fs::read_to_string(path).unwrap_or_default();
    // no other program ends the file like this
    let last = number_names(contents);
    if !last.is_empty() && read(&ending(root, ".paramnames")).ends_with(&last) {
        return true;
    }
    // weight and -ln P before the parameters, derived quantities after them
    let columns = 2 + contents.parameters.len() + contents.derived.len() + contents.numbers().count();
    let is_row = |line: &str| {
        let numbers: Option<Vec<f64>> = line.split(' ').map(|cell| cell.parse().ok()).collect();
        numbers.is_some_and(|numbers| numbers.len() == columns && numbers[0] == 1.0)
    };
    let text = read(file);
    !text.is_empty() && text.lines().all(is_row)
}

/// Whether GetDist would read other files along with those of an export, as further chains: `ROOT.txt`, and
/// `ROOT_N.txt` or `ROOT.N.txt` of other numbers.
///
/// # Errors
/// [`ExportError::Place`] with the first such file.
pub fn check_strangers(root: &Path, ensembles: usize) -> Result<(), ExportError> {
    let folder = folder_of(root);
    let Some(name) = root.file_name().and_then(|name| name.to_str()) else { return Ok(()) };
    let own = files(root, ensembles);
    let mut strangers: Vec<PathBuf> = std::fs::read_dir(folder)
        .into_iter()
        .flatten()
        .flatten()
        .map(|entry| entry.file_name())
        .filter(|file| file.to_str().is_some_and(|file| is_chain(file, name)))
        .map(|file| root.with_file_name(file))
        .filter(|path| !own.contains(path))
        .collect();
    strangers.sort();
    strangers.into_iter().next().map_or(Ok(()), |path| {
        let problem = "GetDist would take it for one of the chains: move it, or give another --out".to_owned();
        Err(ExportError::Place { path, problem })
    })
}

/// Whether GetDist reads a file as a chain of the root `name`.
fn is_chain(file: &str, name: &str) -> bool {
    let Some(middle) = file.strip_prefix(name).and_then(|rest| rest.strip_suffix(".txt")) else { return false };
    let number = middle.strip_prefix(['_', '.']);
    middle.is_empty() || number.is_some_and(|n| !n.is_empty() && n.bytes().all(|byte| byte.is_ascii_digit()))
}

fn chain(root: &Path, ensemble: usize) -> PathBuf {
    ending(root, &format!("_{}.txt", ensemble + 1))
}

fn ending(root: &Path, end: &str) -> PathBuf {
    let mut name = root.as_os_str().to_owned();
    name.push(end);
    name.into()
}

/// Names and LaTeX labels; derived quantities have a star.
fn paramnames(contents: &Contents) -> String {
    let mut text = String::new();
    let unit = |unit: &str| if unit == "1" { String::new() } else { format!(r"\;[\mathrm{{{unit}}}]") };
    for one in &contents.parameters {
        // Writing to a String cannot fail.
        let _ = writeln!(text, "{}\t{}{}", one.name, one.latex, unit(one.unit));
    }
    for one in &contents.derived {
        let _ = writeln!(text, "{}*\t{}{}", one.name(), one.latex, unit(one.unit));
    }
    text + &number_names(contents)
}

/// The same for the other values of a draw, which come last.
fn number_names(contents: &Contents) -> String {
    let latex = |name: &str| match name {
        CHI2 => r"\chi^2".to_owned(),
        other => format!(r"\mathrm{{{}}}", other.replace('_', r"\_")),
    };
    contents.numbers().map(|name| format!("{name}*\t{}\n", latex(name))).collect()
}

/// Bounds, `N` for none.
fn ranges(parameters: &[Quantity]) -> String {
    let mut text = String::new();
    for one in parameters {
        let [min, max] = one.unwrapped_bounds().map(|bound| bound.map_or("N".to_owned(), |x| x.to_string()));
        let periodic = if one.centre.is_some() { " periodic" } else { "" };
        let _ = writeln!(text, "{} {min} {max}{periodic}", one.name);
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn chains_as_getdist_sees_them() {
        for yes in ["demo.txt", "demo_1.txt", "demo.12.txt"] {
            assert!(is_chain(yes, "demo"), "{yes}");
        }
        for no in ["demo.paramnames", "demo_.txt", "demo_a.txt", "demo1.txt", "demo_1.csv", "dem_1.txt"] {
            assert!(!is_chain(no, "demo"), "{no}");
        }
    }
}
