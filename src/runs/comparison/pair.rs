//! A run and a likelihood grid that match: the same data and star, the same image for one objective, and axes that the
//! chain samples.

use crate::data::config::{self, Config, Difference, Settings};
use crate::data::io::effort::Effort;
use crate::data::io::landscape;
use crate::data::io::lines::JournalError;
use crate::model::Parameter;
use crate::runs::grid_scan::{HEADER, Header, NODES};
use crate::runs::manifest::Manifest;
use crate::runs::origin::{Origin, OriginError};
use crate::runs::run::read_chain;
use crate::sampling::chain::Chain;
use crate::sampling::landscape::Landscape;
use crate::surface::ObjectiveKind;
use std::path::{Path, PathBuf};

/// A run and a likelihood grid, read and checked to match.
#[derive(Debug)]
pub struct Pair {
    /// Manifest of the run.
    pub manifest: Manifest,
    /// Its settings.
    pub settings: Settings,
    /// Its chain so far.
    pub chain: Chain,
    /// Header of the likelihood grid.
    pub header: Header,
    /// The objective of the likelihood grid.
    pub grid_objective: ObjectiveKind,
    /// All its nodes.
    pub landscape: Landscape,
    /// Durations of the run and of the likelihood grid, where recorded.
    pub efforts: [Option<Effort>; 2],
}

/// Why they cannot be compared.
#[derive(Debug, thiserror::Error)]
pub enum PairError {
    /// One of them is missing, or cannot be read.
    #[error(transparent)]
    Origin(#[from] OriginError),
    /// Chain or nodes cannot be read.
    #[error(transparent)]
    Journal(#[from] JournalError),
    /// The likelihood grid is incomplete.
    #[error("{}: {found} of {total} nodes: finish the grid first, with --resume", folder.display())]
    Unfinished {
        /// Folder of the likelihood grid.
        folder: PathBuf,
        /// Available nodes.
        found: usize,
        /// Nodes of the grid.
        total: usize,
    },
    /// They do not match.
    #[error("{} and {} do not belong together: {what}", run.display(), grid.display())]
    Different {
        /// Folder of the run.
        run: PathBuf,
        /// Folder of the likelihood grid.
        grid: PathBuf,
        /// The difference.
        what: String,
    },
}

impl Pair {
    /// Reads the run in folder `run` and the likelihood grid in folder `grid`.
    ///
    /// # Errors
    /// [`PairError`]: missing or wrong files, an incomplete likelihood grid, or one that does not match.
    pub fn read(run: &Path, grid: &Path) -> Result<Self, PairError> {
        let manifest = Manifest::read(run)?;
        let header = Header::read(grid)?;
        let settings = manifest.settings(run)?;
        let source = grid.join(HEADER);
        let grid_settings = Config::at(header.origin.config.clone(), &source).settings();
        let grid_settings = grid_settings.map_err(OriginError::Config)?;
        if let Some(what) = what_differs(&manifest, &settings, &header, &grid_settings) {
            return Err(PairError::Different { run: run.into(), grid: grid.into(), what });
        }
        let landscape = landscape::read(&grid.join(NODES), header.grid.clone(), &header.numbers)?;
        if !landscape.is_whole() {
            let (found, total) = (landscape.nodes().len(), header.grid.len());
            return Err(PairError::Unfinished { folder: grid.into(), found, total });
        }
        let chain = read_chain(run, &manifest)?;
        let efforts = [run, grid].map(Effort::read);
        let grid_objective = grid_settings.imaging.objective;
        Ok(Pair { manifest, settings, chain, header, grid_objective, landscape, efforts })
    }

    /// Index of a sampled parameter among the axes.
    pub fn axis(&self, name: &str) -> Option<usize> {
        self.header.grid.names().position(|axis| axis == name)
    }

    /// Density of the run's prior for the parameter on axis `axis`.
    pub fn prior(&self, axis: usize, x: f64) -> f64 {
        let axis = &self.header.grid.axes[axis];
        let free = self.settings.free.iter().find(|f| f.parameter.name() == axis.name);
        free.map_or(0.0, |f| match axis.periodic {
            // the interval of a prior of phi may be in any cycle
            true => (-TURNS..=TURNS).map(|turn| f.prior.log_density(x + f64::from(turn)).exp()).sum::<f64>(),
            false => f.prior.log_density(x).exp(),
        })
    }
}

/// Most cycles of a periodic parameter from its prior to [0, 1).
const TURNS: i32 = 10;

/// The first reason why a run and a likelihood grid have different posteriors.
fn what_differs(manifest: &Manifest, settings: &Settings, header: &Header, grid_settings: &Settings) -> Option<String> {
    let (run, grid) = (&manifest.origin, &header.origin);
    let both = |d: Difference| format!("{} ({} in the run, {} in the grid)", d.key, d.first, d.second);
    let model = |settings: &Settings| settings.imaging.objective.properties().name;
    let same_method = model(settings) == model(grid_settings);
    // images, jitters and spots differ between the two models: they are the subject of the comparison
    let sections = if same_method { &["star", "instrument", "imaging"][..] } else { &["star", "instrument"] };
    let model = sections.iter().find_map(|name| config::section_difference(name, &run.config, &grid.config));
    // a difference in the RV jitter does not change the data
    let jitter = || config::jitter_difference(&run.config, &grid.config).filter(|_| same_method);
    if let Some(key) = model.or_else(jitter) {
        return Some(both(key));
    }
    if let Some(name) = header.grid.names().find(|name| !manifest.names.iter().any(|sampled| sampled == name)) {
        return Some(format!("{name} is an axis of the grid and not sampled in the run"));
    }
    let of_both = |p: &Parameter| same_method || !p.is_of_field();
    let fixed = |p: &Parameter| of_both(p) && !manifest.names.iter().any(|name| name == p.name());
    let differ = |p: &Parameter| settings.values.get(*p) != grid_settings.values.get(*p);
    if let Some(p) = Parameter::ALL.into_iter().filter(fixed).find(differ) {
        let number = |of: &Settings| of.values.get(p).map_or("nothing".to_owned(), |value| value.to_string());
        let (first, second) = (number(settings), number(grid_settings));
        return Some(format!("{} is fixed at {first} in the run and at {second} in the grid", p.name()));
    }
    if run.data_sha256 != grid.data_sha256 {
        let key = config::section_difference("observations", &run.config, &grid.config).map(both);
        let why = key.or_else(|| injected(run, grid)).map_or_else(String::new, |why| format!(": {why}"));
        return Some(format!("the observations are not the same{why}"));
    }
    let maps = [run, grid].map(|origin| origin.measured.seasons.len().max(1));
    (same_method && maps[0] != maps[1]).then(|| {
        let [first, second] = maps;
        format!("maps of the star: {first} in the run, {second} in the grid (one is by an older program: repeat it)")
    })
}

/// The first parameter whose value differs between two simulations.
fn injected(run: &Origin, grid: &Origin) -> Option<String> {
    let (first, second) = (run.truth.as_ref()?, grid.truth.as_ref()?);
    let differs = |(name, value): &(&String, &f64)| second.get(*name) != Some(*value);
    let (name, value) = first.iter().find(differs)?;
    Some(format!("injected {name} {value} in the run and {} in the grid", second.get(name)?))
}
