//! A sampling run: search, start, chain, in memory or on disk; begun or resumed to the same bytes.
//!
//! Its files: `manifest.json`, `chain.jsonl` (each step, by `data::io::journal`) and `summary.json`. `start` is the
//! start of the walkers, `pace` the progress, `conclusion` the summary at the end.

mod conclusion;
mod error;
mod pace;
mod start;

pub use conclusion::Conclusion;
pub use error::RunError;
pub use pace::{Cost, Meter, Pace};

use crate::data::config::Settings;
use crate::data::io::atomic::clear_abandoned;
use crate::data::io::effort::Effort;
use crate::data::io::journal::{self, Journal, JournalError};
use crate::data::io::lines::{self, Claim};
use crate::data::scene::Scene;
use crate::inference::search::Found;
use crate::runs::blind_search::{BlindSearch, SearchSummary};
use crate::runs::manifest::{self, Manifest, RunSummary, kinds_and_goals};
use crate::runs::origin::Origin;
use crate::runs::pool::{Asked, Evaluations, Pool, Target, Task};
use crate::sampling::chain::{Chain, Convergence, Goals, ParameterKind, Record};
use crate::sampling::ensemble::{
    self, EnsembleError, Positions, RunError as StepError, Sampler, StopPolicy, StopReason,
};
use crate::sampling::log_density::LogDensity as _;
use crate::surface::surrogate::{Surrogate, SurrogateMove};
use std::path::Path;
use std::time::{Duration, Instant};

/// Name of the chain in a run's folder.
pub const CHAIN: &str = "chain.jsonl";

/// Name of its summary.
pub const SUMMARY: &str = "summary.json";

/// Whether `folder` contains only an empty chain, and the manifest if `manifest` is set: such a run may begin again.
pub fn is_false_start(folder: &Path, manifest: bool) -> bool {
    lines::is_false_start(folder, manifest.then_some(manifest::FILE), CHAIN)
}

/// Reads the chain of the run in `folder`, which may still be growing, and checks it as a whole.
///
/// # Errors
/// Those of [`journal::read`]; draws that the priors exclude; a chain that became shorter.
pub fn read_chain(folder: &Path, manifest: &Manifest) -> Result<Chain, JournalError> {
    let path = folder.join(CHAIN);
    let (chain, is_whole) = journal::read_to_end(&path, &manifest.shape())?;
    within_priors(&path, manifest, &chain)?;
    let cut = |problem: String| {
        let line = chain.records().len() + 1;
        Err(JournalError::Line { path: path.clone(), line, problem })
    };
    if !manifest.merged_seeds.is_empty() && !is_whole {
        return cut("ends within a step, and a merged run does not grow: merge the runs again".into());
    }
    #[derive(serde::Deserialize)]
    struct Before {
        steps: usize,
    }
    let before = std::fs::read(folder.join(SUMMARY)).ok().and_then(|text| serde_json::from_slice(&text).ok());
    match (before, chain.steps().checked_sub(1)) {
        (Some(Before { steps }), Some(last)) if last < steps => cut(format!(
            "the chain ends with step {last}, {SUMMARY} is of {steps}: the end is missing. Copy it again, or delete \
            {SUMMARY}"
        )),
        _ => Ok(chain),
    }
}

fn within_priors(path: &Path, manifest: &Manifest, chain: &Chain) -> Result<(), JournalError> {
    match manifest.outside(chain) {
        None => Ok(()),
        Some((line, problem)) => Err(JournalError::Line { path: path.into(), line, problem }),
    }
}

/// The start of the walkers.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum StartFrom {
    /// From the quadratic posterior around the optimum, widened: all its peaks get walkers in proportion. Where there
    /// is no such quadratic, around the maxima that the search found.
    #[default]
    Optimum,
    /// All over the prior.
    Prior,
}

/// A chain of the posterior of a [`Scene`], with its manifest.
pub struct Run {
    /// Its manifest.
    #[doc(hidden)]
    pub manifest: Manifest,
    /// The chain so far.
    pub chain: Chain,
    /// Reconstructions before its first step: for fitting and testing the surrogate, and for the start.
    #[doc(hidden)]
    pub preparation: usize,
    /// Duration of the first step: the same as of others.
    first_step: Duration,
    target: Target,
    task: Task,
    kinds: Vec<ParameterKind>,
    policy: StopPolicy,
    settings: Settings,
    /// With the fraction of its proposals accepted in a test.
    surrogate: Option<(Surrogate, f64)>,
    /// Every step is written to it before the next begins; `None` in memory.
    journal: Option<Journal>,
}

impl Run {
    /// Searches for the best parameters of `scene` and draws the start around them; the run is kept in memory.
    ///
    /// # Errors
    /// [`RunError`]: no free parameter, a failed search, wrong settings of the sampler.
    pub fn new(scene: &Scene) -> Result<Self, RunError> {
        scene.settings.require_free()?;
        Run::in_memory(scene, scene.optimise()?, StartFrom::Optimum, &Pool::default())
    }

    /// The same, kept in `folder`: `manifest.json` and `chain.jsonl`, one line per walker and step.
    ///
    /// # Errors
    /// As [`Run::new`], and a folder that contains a run already or cannot be written.
    pub fn new_in(folder: &Path, scene: &Scene) -> Result<Self, RunError> {
        Run::new(scene)?.kept_in(folder, false)
    }

    /// Steps until the goals of the config, or its step limit, are reached, on all threads.
    ///
    /// # Errors
    /// A chain that cannot be written.
    pub fn finish(&mut self) -> Result<StopReason, RunError> {
        self.go(&Pool::default(), |_, _| ())
    }

    /// Adds this session to `effort.json` in the run's `folder`; `afresh` where the run began in it.
    ///
    /// # Errors
    /// A file that cannot be written.
    #[doc(hidden)]
    pub fn note_effort(folder: &Path, afresh: bool, seconds: f64, threads: usize) -> Result<(), RunError> {
        Ok(Effort::add(folder, afresh, seconds, threads)?)
    }

    /// The summary of each parameter, the convergence, and the verdict on a planet.
    ///
    /// # Errors
    /// A chain that does not match its manifest: a bug.
    pub fn summary(&self) -> Result<RunSummary, RunError> {
        Ok(self.manifest.summarise(&self.settings, &self.chain)?.0)
    }

    /// Reads the chain and the summary of the run in `folder`, whether or not it is finished.
    ///
    /// # Errors
    /// No run there, or one that is broken.
    pub fn read(folder: &Path) -> Result<(Chain, RunSummary), RunError> {
        let manifest = Manifest::read(folder)?;
        let chain = read_chain(folder, &manifest)?;
        let (summary, _) = manifest.summarise(&manifest.settings(folder)?, &chain)?;
        Ok((chain, summary))
    }

    /// Whether `folder` contains only a run that ended before its first step: another one may replace it.
    pub fn is_false_start(folder: &Path) -> bool {
        is_false_start(folder, true)
    }

    /// Begins a run at the result `found` of a search: draws the start and evaluates it.
    ///
    /// # Errors
    /// [`RunError`], where there is no start.
    #[doc(hidden)]
    pub fn in_memory(scene: &Scene, found: Found, from: StartFrom, pool: &Pool) -> Result<Self, RunError> {
        scene.settings.sampler.validate(scene.space.dimension())?;
        let needed = from == StartFrom::Optimum || scene.settings.sampler.moves.surrogate > 0.0;
        let target = Target::new(found.posterior.clone(), scene.settings.imaging.unresolved_spots)?;
        let origin = Origin::of(scene, &found);
        let task = Task::new(scene, &origin, scene.space.names(), Asked::LogProbability);
        let evaluator = Evaluations::new(pool, &target, &task);
        let surrogate = if needed { target.surrogate(&evaluator) } else { None };
        let start = match from {
            StartFrom::Optimum => {
                let drawn = surrogate.as_ref().and_then(|(s, _)| start::from_surrogate(s, &target, &evaluator, scene));
                drawn.map_or_else(|| start::around_maxima(&found, &target, &evaluator, scene), Ok)
            }
            StartFrom::Prior => start::over_prior(&evaluator, scene),
        };
        let preparation = evaluator.count();
        let began = Instant::now();
        let begun = start.and_then(|start| Ok((first_step(scene, &target, &evaluator, &start)?, start)));
        let took = began.elapsed();
        // points without an evaluation would look like an invalid start
        let (first, start) = if pool.stopped() { Err(RunError::Interrupted) } else { begun }?;
        let blind_search = BlindSearch::summary_of(scene, found.detection.as_deref());
        let manifest = new_manifest(scene, origin, &target, blind_search, start);
        let mut chain = Chain::new(manifest.shape());
        chain.push_step(&first)?;
        let run = Run::of(scene, manifest, (target, task), surrogate, (None, chain));
        Ok(Run { preparation, first_step: took, ..run })
    }

    /// The same in `folder`, which is created: its steps so far are written with the manifest. An existing run is
    /// replaced if `replace`, and refused otherwise.
    ///
    /// # Errors
    /// A folder that contains a run already or cannot be written.
    #[doc(hidden)]
    pub fn kept_in(self, folder: &Path, replace: bool) -> Result<Self, RunError> {
        self.kept_by(Run::claim(folder, replace)?, folder)
    }

    /// Creates and claims `folder` for a run whose search has not ended yet: from now on others are refused.
    ///
    /// # Errors
    /// A folder that contains a run already (unless `replace`), in which another process begins one, or that cannot be
    /// written.
    #[doc(hidden)]
    pub fn claim(folder: &Path, replace: bool) -> Result<Claim, RunError> {
        Ok(Claim::of(&folder.join(CHAIN), replace)?)
    }

    /// As [`Run::kept_in`], in the folder of a claim.
    ///
    /// # Errors
    /// A folder that cannot be written.
    #[doc(hidden)]
    pub fn kept_by(self, claim: Claim, folder: &Path) -> Result<Self, RunError> {
        // the chain first: a lock on it is required for writing the manifest
        let mut journal = Journal::begin(claim, self.manifest.shape())?;
        match std::fs::remove_file(folder.join(SUMMARY)) {
            Err(source) if source.kind() != std::io::ErrorKind::NotFound => {
                return Err(RunError::Folder { path: folder.join(SUMMARY), source });
            }
            _ => self.manifest.write(folder)?,
        }
        for step in (0..self.chain.steps()).filter_map(|step| self.chain.step(step)) {
            journal.append(step)?;
        }
        Ok(Run { journal: Some(journal), ..self })
    }

    /// Resumes the run in `folder`, `extend` steps beyond its last one if given.
    ///
    /// # Errors
    /// [`RunError`]: no run there, changed config or data, a broken chain.
    #[doc(hidden)]
    pub fn resume(scene: &Scene, folder: &Path, extend: Option<usize>, pool: &Pool) -> Result<Self, RunError> {
        let mut manifest = Manifest::read(folder)?;
        if !manifest.merged_seeds.is_empty() {
            return Err(RunError::Merged(folder.into()));
        }
        manifest.origin.check(scene, folder)?;
        clear_abandoned(folder);
        let path = folder.join(CHAIN);
        let (mut journal, mut chain) = Journal::recover(&path, manifest.shape())?;
        within_priors(&path, &manifest, &chain)?;
        let posterior = manifest.origin.posterior(scene, scene.space.clone(), folder)?;
        let target = Target::new(posterior, scene.settings.imaging.unresolved_spots)?;
        let task = Task::new(scene, &manifest.origin, scene.space.names(), Asked::LogProbability);
        let evaluator = Evaluations::new(pool, &target, &task);
        if chain.steps() == 0 {
            let first = first_step(scene, &target, &evaluator, &manifest.start)?;
            journal.append(&first)?;
            chain.push_step(&first)?;
        }
        let last_step = chain.steps() - 1;
        if manifest.update(&scene.settings, extend.map(|steps| last_step + steps)) {
            manifest.write(folder)?;
        }
        let wanted = scene.settings.sampler.moves.surrogate > 0.0;
        let surrogate = if wanted { target.surrogate(&evaluator) } else { None };
        let preparation = evaluator.count();
        let run = Run::of(scene, manifest, (target, task), surrogate, (Some(journal), chain));
        Ok(Run { preparation, ..run })
    }

    /// The run with its chain so far.
    fn of(
        scene: &Scene,
        manifest: Manifest,
        (target, task): (Target, Task),
        surrogate: Option<(Surrogate, f64)>,
        (journal, chain): (Option<Journal>, Chain),
    ) -> Self {
        let settings = scene.settings.clone();
        let (kinds, _) = kinds_and_goals(&settings);
        let policy = StopPolicy::new(&settings.sampler);
        let policy = match manifest.extend_to {
            Some(step) => StopPolicy { steps: step, least: step, ..policy },
            None => policy,
        };
        Run {
            policy,
            manifest,
            target,
            task,
            chain,
            preparation: 0,
            first_step: Duration::ZERO,
            kinds,
            settings,
            surrogate,
            journal,
        }
    }

    /// The step at which the run ends if its goals are not reached before.
    #[doc(hidden)]
    pub fn last_step(&self) -> usize {
        self.policy.steps
    }

    /// Goals for every parameter.
    #[doc(hidden)]
    pub fn goals(&self) -> &Goals {
        &self.policy.goals
    }

    /// Steps until the goals are reached, the step limit, or `pool` is told to stop; every step of a run in a folder is
    /// on disk before the next begins.
    ///
    /// # Errors
    /// A chain that cannot be written.
    #[doc(hidden)]
    pub fn go(
        &mut self,
        pool: &Pool,
        mut on_step: impl FnMut(&[Record], Option<&Convergence>),
    ) -> Result<StopReason, RunError> {
        let Run { target, task, chain, kinds, policy, settings, surrogate, journal, .. } = self;
        let evaluator = Evaluations::new(pool, target, task);
        let mut sampler = Sampler::new(&*target, &evaluator, &settings.sampler)?;
        if let Some((surrogate, acceptance)) = surrogate {
            let weight = settings.sampler.moves.surrogate * acceptance.powi(2);
            sampler = sampler.with_move(weight, Box::new(SurrogateMove(surrogate.clone())));
        }
        let result = ensemble::run(&sampler, chain, kinds, policy, pool.stop(), &mut |records, convergence| {
            if let Some(journal) = journal {
                journal.append(records)?;
            }
            on_step(records, convergence);
            Ok::<(), JournalError>(())
        });
        result.map_err(|error| match error {
            StepError::Ensemble(error) => error.into(),
            StepError::Chain(error) => error.into(),
            StepError::Callback(error) => error.into(),
        })
    }
}

fn new_manifest(
    scene: &Scene,
    origin: Origin,
    target: &Target,
    blind_search: Option<SearchSummary>,
    start: Positions,
) -> Manifest {
    let prior = |f: &crate::model::FreeParameter| {
        (f.parameter.name().to_string(), serde_json::to_value(f.prior).expect("a prior is plain data"))
    };
    Manifest {
        origin,
        names: scene.space.names().to_vec(),
        numbers: target.number_names().iter().map(|name| (*name).to_owned()).collect(),
        priors: scene.space.free().iter().map(prior).collect(),
        ensembles: scene.settings.sampler.ensembles,
        walkers: scene.settings.sampler.walkers(),
        seed: scene.settings.sampler.seed,
        extend_to: None,
        merged_seeds: Vec::new(),
        blind_search,
        start,
    }
}

/// The walkers at step 0, evaluated; an invalid start is refused here, before anything is written.
fn first_step(
    scene: &Scene,
    target: &Target,
    evaluator: &Evaluations,
    start: &Positions,
) -> Result<Vec<Record>, RunError> {
    let first = Sampler::new(target, evaluator, &scene.settings.sampler)?.start(start);
    first.map(|(_, records)| records).map_err(|error| match error {
        EnsembleError::Stopped => RunError::Interrupted,
        error => error.into(),
    })
}
