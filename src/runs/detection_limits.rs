//! Detection limits of a scene: the planet-free star, injected orbits of every period, semi-amplitude and phase, some
//! of them through the full pipeline, and the files of [`limits`](super::limits).

use super::blind_search::{BlindSearchError, BlindSearchOptions};
use super::limits::{
    self, BestOrbit, Cell, Comparison, LimitSettings, LimitsFile, Orbits, Searches, Shortcut, WholeWay,
};
use super::pool::{Brief, Pool};
use crate::data::io::atomic::WriteError;
use crate::data::scene::Scene;
use crate::model::for_blind_search;
use crate::planets::periodogram::{FrequencySettings, SearchSettings, Unbounded};
use crate::star::Orbit;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering::Relaxed};

/// What is injected, and how it is searched for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LimitsOptions {
    /// Shortest and longest period.
    pub range: FrequencySettings,
    /// Number of periods, 2 or more.
    pub periods: usize,
    /// Smallest K (km/s); by default a third of the lowest detectable K.
    pub min_k_kms: Option<f64>,
    /// Largest K (km/s); by default four times the K that is recovered at all phases for nine of ten periods.
    pub max_k_kms: Option<f64>,
    /// Number of semi-amplitudes, 2 or more.
    pub amplitudes: usize,
    /// Number of phases.
    pub phases: usize,
    /// Number of orbits near the limit to pass through the full pipeline.
    pub full: usize,
    /// The treatment of the best orbit of the observed profiles.
    pub best: BestOrbit,
    /// Whether free parameters are fixed at the config's values.
    pub fixed: bool,
    /// Number of planet-free Monte Carlo realisations.
    pub draws: usize,
    /// Their seed.
    pub seed: u64,
}

impl Default for LimitsOptions {
    fn default() -> Self {
        LimitsOptions {
            range: FrequencySettings::default(),
            periods: 40,
            min_k_kms: None,
            max_k_kms: None,
            amplitudes: 20,
            phases: 12,
            full: 0,
            best: BestOrbit::OutIfCandidate,
            fixed: false,
            draws: SearchSettings::DRAWS,
            seed: 1,
        }
    }
}

/// The current stage.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LimitsProgress {
    /// The planet-free map, and its search.
    Map,
    /// Linearised injections.
    Injections {
        /// Orbits tried so far.
        done: usize,
        /// All of them.
        total: usize,
    },
    /// Injections through the full pipeline.
    Full {
        /// Orbits tried so far.
        done: usize,
        /// All of them.
        total: usize,
    },
}

/// Why there are no limits.
#[derive(Debug, thiserror::Error)]
pub enum LimitsError {
    /// No search of the profiles.
    #[error(transparent)]
    Search(#[from] BlindSearchError),
    /// No semi-amplitude is detectable.
    #[error("{}: {Unbounded}", .0.display())]
    Unbounded(PathBuf),
    /// Semi-amplitudes that are not a range.
    #[error(
        "--min-k-kms, --max-k-kms: {min} to {max} km/s is no range, both must be above 0, the first below the second"
    )]
    Range {
        /// The smallest one.
        min: f64,
        /// The largest one.
        max: f64,
    },
    /// Told to stop.
    #[error("interrupted")]
    Interrupted,
}

/// Limits with the underlying injected orbits.
#[derive(Clone, Debug)]
pub struct DetectionLimits {
    cells: Vec<Cell>,
    file: LimitsFile,
    rotation_period_d: f64,
}

impl DetectionLimits {
    /// The limits of the profiles in `scene`. `report` is called with the current stage, from any thread; orbits of the
    /// full pipeline are not begun once `pool` is told to stop.
    ///
    /// # Errors
    /// [`LimitsError`].
    pub fn of(
        scene: &Scene,
        options: &LimitsOptions,
        pool: &Pool,
        report: &(dyn Fn(LimitsProgress) + Sync),
    ) -> Result<Self, LimitsError> {
        let settings = settings(scene, options)?;
        report(LimitsProgress::Map);
        let values = for_blind_search(scene.settings.values, &scene.settings.free);
        let shortcut = Shortcut::new(&scene.imager, values, &settings).map_err(BlindSearchError::from)?;
        let orbits = orbits(scene, options, &shortcut)?;
        let (done, total) = (AtomicUsize::new(0), orbits.count());
        let injected = |some| {
            let done = done.fetch_add(some, Relaxed) + some;
            report(LimitsProgress::Injections { done, total });
        };
        injected(0);
        let searches = shortcut.searches(orbits.k_kms.last().copied().unwrap_or_default());
        let cells = limits::recovered(&searches, &orbits, &injected);
        let rotation_period_d = scene.imager.star.rotation_period_d;
        let found = limits::limits(&cells, rotation_period_d);
        let drawn = limits::drawn(&shortcut, &found, options.full);
        let comparisons = through_the_full_pipeline(scene, (&shortcut, &searches), &drawn, pool, report)?;
        let file = LimitsFile::new(&shortcut, &orbits, found, comparisons, rotation_period_d, scene.provenance());
        Ok(DetectionLimits { cells, file, rotation_period_d })
    }

    /// Writes `limits.csv` and `limits.json` into `folder`, which must exist.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn write(&self, folder: &Path) -> Result<(), WriteError> {
        self.file.write(&self.cells, self.rotation_period_d, folder)
    }

    /// The printed output.
    pub fn table(&self) -> String {
        self.file.table()
    }
}

/// The settings of the search for orbits.
fn settings(scene: &Scene, options: &LimitsOptions) -> Result<LimitSettings, LimitsError> {
    let LimitsOptions { range, best, fixed, draws, seed, .. } = *options;
    let search = BlindSearchOptions { periods: range, fixed, draws, seed, ..BlindSearchOptions::default() };
    let frequencies = search.frequencies(scene).map_err(BlindSearchError::from)?;
    Ok(LimitSettings { detection: search.detection(scene), frequencies, best })
}

/// The injected orbits.
fn orbits(scene: &Scene, options: &LimitsOptions, shortcut: &Shortcut) -> Result<Orbits, LimitsError> {
    let unbounded = || LimitsError::Unbounded(scene.settings.path.clone());
    let (least, most) = shortcut.k_range_kms().ok_or_else(unbounded)?;
    let (min, max) = (options.min_k_kms.unwrap_or(least), options.max_k_kms.unwrap_or(most));
    if !(min > 0.0 && min < max && max.is_finite()) {
        return Err(LimitsError::Range { min, max });
    }
    let (low, high) = shortcut.settings.frequencies.range();
    Ok(Orbits {
        porb_over_prot: limits::even_in_logarithm(1.0 / high, 1.0 / low, options.periods),
        k_kms: limits::even_in_logarithm(min, max, options.amplitudes),
        phases: options.phases,
    })
}

/// The `orbits` linearised and through the full pipeline.
fn through_the_full_pipeline(
    scene: &Scene,
    (shortcut, searches): (&Shortcut, &Searches),
    orbits: &[Orbit],
    pool: &Pool,
    report: &dyn Fn(LimitsProgress),
) -> Result<Vec<Comparison>, LimitsError> {
    if orbits.is_empty() {
        return Ok(Vec::new());
    }
    let way = WholeWay::new(scene, shortcut);
    let search = way.searcher(scene.clone());
    let brief = Brief::Injections(Box::new(way)).to_bytes();
    let mut comparisons = Vec::with_capacity(orbits.len());
    let full = |done| report(LimitsProgress::Full { done, total: orbits.len() });
    full(0);
    for some in orbits.chunks(pool.size().max(1)) {
        let found = pool.answers(&brief, some, &search);
        if found.len() < some.len() {
            return Err(LimitsError::Interrupted);
        }
        let both = |(orbit, full): (&Orbit, _)| Comparison { orbit: *orbit, shortcut: searches.of(orbit), full };
        comparisons.extend(some.iter().zip(found).map(both));
        full(comparisons.len());
    }
    Ok(comparisons)
}
