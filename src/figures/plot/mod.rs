//! Figures of the results in a folder, from its files alone; nothing is recomputed.
//!
//! The files determine the figures: those of `simulate`, `inject`, `map`, `periodogram`, `limits`, `plan`, `optimise`,
//! `grid`, `sample`, `compare` and `survey`.

mod changes;
mod comparison;
mod content;
mod corner;
mod density;
mod dynamic;
mod ephemeris;
mod injected;
mod landscape;
mod limits;
mod maps;
mod optimum;
mod paraboloid;
mod periodogram;
mod plan;
mod profiles;
mod projection;
mod series;
mod star_map;
mod surface;
mod survey;
pub mod symbols;
mod times;
mod trace;
mod turning;
mod velocities;

pub use density::Density;
pub use projection::Projection;
pub use trace::Sampled;
pub use turning::turning;

use crate::data::io::atomic::{self, WriteError};
use crate::data::io::journal::JournalError;
use crate::data::io::lsd::LsdError;
use crate::data::io::map::{INDICATORS, LIGHT_CURVES, MAP, MapFile};
use crate::data::io::{FileError, truth};
use crate::figures::drawing::Figure;
use crate::runs::origin::OriginError;
use crate::runs::run::CHAIN;
use crate::runs::{self, blind_search, grid_scan, manifest, origin};
use std::path::{Path, PathBuf};

/// Default resolution of PNG files in pixels per inch.
pub const DPI: f64 = 200.0;

/// Why there is no figure: one line that names file or folder.
#[derive(Debug, thiserror::Error)]
pub enum PlotError {
    /// The folder does not exist.
    #[error("{}: no such folder", .0.display())]
    NoFolder(PathBuf),
    /// It contains nothing to draw.
    #[error("{}: nothing to draw: it holds none of {}", folder.display(), known_files().join(", "))]
    Nothing {
        /// The folder.
        folder: PathBuf,
    },
    /// A JSON file is missing or wrong.
    #[error(transparent)]
    Origin(#[from] OriginError),
    /// A table is wrong.
    #[error(transparent)]
    Csv(#[from] FileError),
    /// A chain or a likelihood grid is wrong.
    #[error(transparent)]
    Journal(#[from] JournalError),
    /// Profiles are wrong.
    #[error(transparent)]
    Profiles(#[from] LsdError),
    /// A file can be read, but its content is wrong.
    #[error("{}: {problem}", path.display())]
    Content {
        /// The file.
        path: PathBuf,
        /// The problem.
        problem: String,
    },
}

/// Periods (d), periods over that of the rotation, and semi-amplitudes (km/s) that a logarithmic axis may show.
const POSITIVE: [f64; 2] = [1e-12, 1e12];

/// Times (d), rotation cycles and velocities (km/s).
const ANY: [f64; 2] = [-1e12, 1e12];

/// Draws the figures of one kind of folder.
type Draw = fn(&Path, Option<&Path>) -> Result<Vec<Figure>, PlotError>;

/// The files that identify a folder, with the function that draws it.
const KINDS: [(&str, Draw); 10] = [
    (MAP, star_map_figures),
    (blind_search::FILE, |folder, _| periodogram::figures(folder)),
    (runs::limits::JSON, |folder, _| limits::figures(folder)),
    (runs::plan::JSON, |folder, _| plan::figures(folder)),
    (runs::survey::JSON, |folder, _| survey::figures(folder)),
    (manifest::FILE, |folder, _| chain_figures(folder)),
    (grid_scan::HEADER, landscape::figures),
    (runs::optimum::FILE, |folder, _| optimum::figures(folder)),
    (runs::comparison::FILE, |folder, _| comparison::figures(folder)),
    (truth::FILE, |folder, _| simulation_figures(folder)),
];

fn known_files() -> Vec<&'static str> {
    KINDS.map(|(file, _)| file).to_vec()
}

/// The identifying files in a folder.
pub fn kinds(folder: &Path) -> Vec<&'static str> {
    known_files().into_iter().filter(|file| folder.join(file).is_file()).collect()
}

/// All figures of the results in `folder`; for a likelihood grid also the contours of the run in folder `run`.
///
/// # Errors
/// [`PlotError`]: a folder that does not exist or has no known results, files that are wrong.
pub fn figures(folder: &Path, run: Option<&Path>) -> Result<Vec<Figure>, PlotError> {
    if !folder.is_dir() {
        return Err(PlotError::NoFolder(folder.into()));
    }
    let here = kinds(folder);
    // a simulation with a map of it is drawn beside the map
    let drawn = |file: &str| here.contains(&file) && (file != truth::FILE || !here.contains(&MAP));
    let mut figures: Vec<Figure> = Vec::new();
    for (_, draw) in KINDS.into_iter().filter(|(file, _)| drawn(file)) {
        for mut figure in draw(folder, run)? {
            // two kinds in one folder
            while figures.iter().any(|other| other.name == figure.name) {
                figure.name.push_str("_2");
            }
            figures.push(figure);
        }
    }
    if figures.is_empty() {
        return Err(PlotError::Nothing { folder: folder.into() });
    }
    Ok(figures)
}

fn star_map_figures(folder: &Path, _: Option<&Path>) -> Result<Vec<Figure>, PlotError> {
    let file: MapFile = origin::read(folder, MAP)?;
    if file.maps.is_empty() {
        let problem = "maps: missing: an earlier version wrote this file; repeat `dimcmc map`".to_owned();
        return Err(OriginError::Content { path: folder.join(MAP), problem }.into());
    }
    // maps of several times, with their uncertainties, are small and many
    let mut figures = match file.field {
        Some(_) => maps::Nights::read(folder, &file)?.figures(),
        None => star_map::figures(folder, &file)?,
    };
    if folder.join(profiles::FILE).is_file() {
        let profiles = profiles::read(folder)?;
        figures.extend(changes::figure(&profiles));
        figures.extend([profiles::figure(&profiles), dynamic::figure(&profiles)]);
    }
    if folder.join(velocities::FILE).is_file() {
        figures.push(velocities::of_map(folder)?);
    }
    if folder.join(LIGHT_CURVES).is_file() {
        figures.push(series::light_curves(folder)?);
    }
    if folder.join(INDICATORS).is_file() {
        figures.push(series::indicators(folder)?);
    }
    Ok(figures)
}

fn simulation_figures(folder: &Path) -> Result<Vec<Figure>, PlotError> {
    let mut figures: Vec<Figure> = star_map::injected(folder)?.into_iter().collect();
    figures.push(profiles::figure(&profiles::simulated(folder)?));
    Ok(figures)
}

fn chain_figures(folder: &Path) -> Result<Vec<Figure>, PlotError> {
    if !folder.join(CHAIN).is_file() {
        return Err(OriginError::Missing { folder: folder.into(), file: CHAIN }.into());
    }
    let sampled = trace::Sampled::read(folder)?;
    Ok(vec![corner::figure(&sampled), trace::traces(&sampled), trace::autocorrelation(&sampled)])
}

/// Writes figures into `folder`, each as SVG and PNG; returns the names of the files.
///
/// # Errors
/// A file that cannot be written.
pub fn write(figures: &[Figure], folder: &Path, dpi: f64) -> Result<Vec<String>, WriteError> {
    atomic::write_set(folder, &|stage| {
        figures.iter().try_for_each(|figure| {
            let [svg, png] = names(figure).map(|name| stage.join(name));
            atomic::write(&svg, figure.svg().as_bytes())?;
            atomic::write(&png, &figure.png(dpi))
        })
    })?;
    Ok(figures.iter().flat_map(names).collect())
}

/// The names of a figure's files.
pub fn names(figure: &Figure) -> [String; 2] {
    ["svg", "png"].map(|ending| format!("{}.{ending}", figure.name))
}
