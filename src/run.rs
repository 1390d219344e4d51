//! A sampling run: start, chain on disk; begun afresh or resumed to the same bytes.
//!
//! Left out: the search before it (`search`), how progress is shown, and the analysis of the chain (`chain`).

use crate::chain::{Chain, Convergence, Goals, ParameterKind, Record};
use crate::ensemble::{
    self, EnsembleError, Positions, RunError as StepError, Sampler, StartDraw, StopPolicy, StopReason, draw_start,
    start_numbers,
};
use crate::io::atomic::WriteError;
use crate::io::journal::{Journal, JournalError};
use crate::log_density::{Evaluation, LogDensity, Threads};
use crate::manifest::{Manifest, kinds_and_goals};
use crate::objective::Posterior;
use crate::optimise::Optimum;
use crate::origin::{Origin, OriginError};
use crate::scene::Scene;
use crate::search::Found;
use crate::surrogate::{Surrogate, SurrogateMove};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering::Relaxed};

/// Name of the chain in a run's folder.
pub const CHAIN: &str = "chain.jsonl";

/// Name of its analysis.
pub const SUMMARY: &str = "summary.json";

/// Where the walkers start.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum StartFrom {
    /// From the quadratic posterior around the optimum, widened: all its peaks get walkers in proportion. Where there is no such
    /// quadratic, around the maxima that the search found.
    #[default]
    Optimum,
    /// All over the prior.
    Prior,
}

/// Starts are wider than the curvature by this factor, so that R-hat can tell whether the chain has forgotten them.
const OVERDISPERSION: f64 = 1.5;

/// Draws from the surrogate tried for one walker.
const DRAW_TRIES: usize = 3;

/// Draws from the prior tried for one walker.
const PRIOR_TRIES: usize = 100;

/// A run with its chain so far.
pub struct Run {
    /// Where it is kept.
    pub folder: PathBuf,
    /// What it was begun with.
    pub manifest: Manifest,
    /// The posterior that is sampled.
    pub posterior: Posterior,
    /// The chain so far.
    pub chain: Chain,
    /// Reconstructions before its first step: to fit and try the surrogate, and for the start.
    pub preparation: usize,
    kinds: Vec<ParameterKind>,
    policy: StopPolicy,
    settings: ensemble::SamplerSettings,
    /// With the share of its proposals accepted on trial.
    surrogate: Option<(Surrogate, f64)>,
    journal: Journal,
}

/// Why a run cannot begin, or go on.
#[derive(Debug, thiserror::Error)]
pub enum RunError {
    /// The start is no start, or the sampler's settings are wrong.
    #[error(transparent)]
    Ensemble(#[from] EnsembleError),
    /// A walker found no place in the prior where a reconstruction succeeds.
    #[error(
        "start from the prior: no reconstruction succeeds at {PRIOR_TRIES} draws; narrow the priors under `parameters`"
    )]
    PriorStart,
    /// What the run was begun with is missing, wrong, or not what is there now.
    #[error(transparent)]
    Origin(#[from] OriginError),
    /// The chain on disk is wrong or locked.
    #[error(transparent)]
    Journal(#[from] JournalError),
    /// A file cannot be written.
    #[error(transparent)]
    Write(#[from] WriteError),
    /// The folder cannot be made, or not cleared.
    #[error("{}: {source}", path.display())]
    Folder {
        /// The folder.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// The chain refused a step: a fault of the program.
    #[error(transparent)]
    Chain(#[from] crate::chain::ChainError),
}

impl Run {
    /// Begins a run at what a search `found`: draws the start, makes the folder with chain, manifest and step 0. A run that is
    /// in the folder already is replaced if `replace`, and refused otherwise.
    ///
    /// # Errors
    /// [`RunError`]; nothing is written where there is no start.
    pub fn begin(scene: &Scene, folder: &Path, found: Found, from: StartFrom, replace: bool) -> Result<Self, RunError> {
        scene.settings.sampler.validate(scene.space.dimension())?;
        let needed = from == StartFrom::Optimum || scene.settings.sampler.moves.surrogate > 0.0;
        let counted = Counted::new(&found.posterior);
        let surrogate = if needed { surrogate(&counted) } else { None };
        let start = match from {
            StartFrom::Optimum => {
                let drawn = surrogate.as_ref().and_then(|(s, _)| from_surrogate(s, &counted, scene));
                drawn.map_or_else(|| around_maxima(&found, scene), Ok)?
            }
            StartFrom::Prior => over_prior(&counted, scene)?,
        };
        let preparation = counted.evaluations.into_inner();
        let first = first_step(scene, &found.posterior, &start)?;
        let manifest = manifest(scene, &found, start);
        std::fs::create_dir_all(folder).map_err(|source| RunError::Folder { path: folder.into(), source })?;
        // the chain first: whoever holds it may write the manifest
        let mut journal = Journal::create(&folder.join(CHAIN), manifest.shape(), replace)?;
        match std::fs::remove_file(folder.join(SUMMARY)) {
            Err(source) if source.kind() != std::io::ErrorKind::NotFound => {
                return Err(RunError::Folder { path: folder.join(SUMMARY), source });
            }
            _ => manifest.write(folder)?,
        }
        let mut chain = Chain::new(manifest.shape());
        journal.append(&first)?;
        chain.push_step(&first)?;
        let run = Run::new(scene, folder, manifest, found.posterior, surrogate, (journal, chain));
        Ok(Run { preparation, ..run })
    }

    /// Goes on with the run in `folder`, `extend` steps beyond its last one if given.
    ///
    /// # Errors
    /// [`RunError`]: no run there, changed config or data, a broken chain.
    pub fn resume(scene: &Scene, folder: &Path, extend: Option<usize>) -> Result<Self, RunError> {
        let mut manifest = Manifest::read(folder)?;
        manifest.origin.check(scene, folder)?;
        let (mut journal, mut chain) = Journal::recover(&folder.join(CHAIN), manifest.shape())?;
        let posterior = manifest.origin.posterior(scene, scene.space.clone(), folder)?;
        if chain.steps() == 0 {
            let first = first_step(scene, &posterior, &manifest.start)?;
            journal.append(&first)?;
            chain.push_step(&first)?;
        }
        let last_step = chain.steps() - 1;
        if manifest.update(&scene.settings, extend.map(|steps| last_step + steps)) {
            manifest.write(folder)?;
        }
        let counted = Counted::new(&posterior);
        let surrogate = if scene.settings.sampler.moves.surrogate > 0.0 { surrogate(&counted) } else { None };
        let preparation = counted.evaluations.into_inner();
        let run = Run::new(scene, folder, manifest, posterior, surrogate, (journal, chain));
        Ok(Run { preparation, ..run })
    }

    /// The run with its chain so far.
    fn new(
        scene: &Scene,
        folder: &Path,
        manifest: Manifest,
        posterior: Posterior,
        surrogate: Option<(Surrogate, f64)>,
        (journal, chain): (Journal, Chain),
    ) -> Self {
        let settings = scene.settings.sampler.clone();
        let (kinds, _) = kinds_and_goals(&scene.settings);
        let policy = StopPolicy::new(&settings);
        let policy = match manifest.extend_to {
            Some(step) => StopPolicy { steps: step, least: step, ..policy },
            None => policy,
        };
        Run { folder: folder.into(), policy, manifest, posterior, chain, preparation: 0, kinds, settings, surrogate, journal }
    }

    /// The step at which the run ends if its goals are not reached before.
    pub fn last_step(&self) -> usize {
        self.policy.steps
    }

    /// What every parameter must reach.
    pub fn goals(&self) -> &Goals {
        &self.policy.goals
    }

    /// Steps until the goals are reached, the step limit, or `stop`; every step is on disk before the next begins.
    ///
    /// # Errors
    /// A chain that cannot be written.
    pub fn go(
        &mut self,
        stop: &AtomicBool,
        mut on_step: impl FnMut(&[Record], Option<&Convergence>),
    ) -> Result<StopReason, RunError> {
        let Run { posterior, chain, kinds, policy, settings, surrogate, journal, .. } = self;
        let evaluator = Threads(&*posterior);
        let mut sampler = Sampler::new(&*posterior, &evaluator, settings)?;
        if let Some((surrogate, acceptance)) = surrogate {
            let weight = settings.moves.surrogate * acceptance.powi(2);
            sampler = sampler.with_move(weight, Box::new(SurrogateMove(surrogate.clone())));
        }
        let result = ensemble::run(&sampler, chain, kinds, policy, stop, &mut |records, convergence| {
            journal.append(records)?;
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

/// The surrogate of the posterior, if there is one, and the share of its proposals accepted on trial: a function of the
/// posterior alone, so that a resumed run has the same.
fn surrogate(counted: &Counted) -> Option<(Surrogate, f64)> {
    let posterior = counted.posterior;
    let expansion = Surrogate::new(posterior.imager(), posterior.space(), posterior.reference())?;
    Some(expansion.fitted(counted, &Threads(counted)))
}

/// The posterior with a count of its evaluations.
struct Counted<'a> {
    posterior: &'a Posterior,
    evaluations: AtomicUsize,
}

impl<'a> Counted<'a> {
    fn new(posterior: &'a Posterior) -> Self {
        Counted { posterior, evaluations: AtomicUsize::new(0) }
    }
}

impl LogDensity for Counted<'_> {
    fn names(&self) -> &[String] {
        self.posterior.names()
    }

    fn evaluate(&self, theta: &[f64]) -> Evaluation {
        self.evaluations.fetch_add(1, Relaxed);
        self.posterior.evaluate(theta)
    }

    fn to_internal(&self, theta: &[f64]) -> Vec<f64> {
        self.posterior.to_internal(theta)
    }

    fn to_written(&self, internal: &[f64]) -> Vec<f64> {
        self.posterior.to_written(internal)
    }

    fn log_jacobian(&self, theta: &[f64]) -> f64 {
        self.posterior.log_jacobian(theta)
    }
}

fn manifest(scene: &Scene, found: &Found, start: Positions) -> Manifest {
    let prior = |f: &crate::objective::FreeParameter| {
        (f.parameter.name().to_string(), serde_json::to_value(f.prior).expect("a prior is plain data"))
    };
    Manifest {
        origin: Origin::of(scene, found),
        names: scene.space.names().to_vec(),
        priors: scene.space.free().iter().map(prior).collect(),
        ensembles: scene.settings.sampler.ensembles,
        walkers: scene.settings.sampler.walkers,
        seed: scene.settings.sampler.seed,
        extend_to: None,
        start,
    }
}

/// The walkers at step 0, evaluated; refused here, before anything is written, if they are no start.
fn first_step(scene: &Scene, posterior: &Posterior, start: &Positions) -> Result<Vec<Record>, RunError> {
    let evaluator = Threads(posterior);
    Ok(Sampler::new(posterior, &evaluator, &scene.settings.sampler)?.start(start)?.1)
}

/// Walkers drawn from the surrogate, wider than the posterior and with more of them around minor peaks than these deserve;
/// `None` where the priors leave hardly anything of it, or nothing can be reconstructed at a draw.
fn from_surrogate(surrogate: &Surrogate, posterior: &Counted, scene: &Scene) -> Option<Positions> {
    let wide = surrogate.tempered(OVERDISPERSION.powi(2))?;
    let draw = |rng: &mut ChaCha8Rng| Some(posterior.to_written(&wide.draw(rng)?));
    reconstructed(posterior, scene, DRAW_TRIES, draw)
}

/// Walkers around the optimum and its rivals. Where there are several maxima, half of an ensemble starts around one of them
/// and half around all in turn, another one for each ensemble: that walkers can hop between them, and that R-hat tells if
/// they do not.
fn around_maxima(found: &Found, scene: &Scene) -> Result<Positions, RunError> {
    let sampler = &scene.settings.sampler;
    let maxima: Vec<&Optimum> = std::iter::once(&found.optimum).chain(found.rivals()).collect();
    let draw = |(m, maximum): (usize, &&Optimum)| {
        let draw = StartDraw {
            centre: &maximum.theta,
            covariance: &maximum.covariance,
            scale: OVERDISPERSION,
            ensembles: sampler.ensembles,
            walkers: sampler.walkers,
            seed: sampler.seed.wrapping_add(m as u64),
        };
        draw_start(&found.posterior, &draw, &|theta| scene.space.log_prior(theta).is_finite())
    };
    let around: Result<Vec<Positions>, _> = maxima.iter().enumerate().map(draw).collect();
    let around = match around {
        // data so weak that the curvature is wider than the prior
        Err(EnsembleError::StartOutside { .. }) => return over_prior(&Counted::new(&found.posterior), scene),
        around => around?,
    };
    let choose = |e: usize, w: usize| if w.is_multiple_of(2) { e % maxima.len() } else { (w / 2) % maxima.len() };
    let walker = |e: usize, w: usize| around[choose(e, w)][e][w].clone();
    Ok((0..sampler.ensembles).map(|e| (0..sampler.walkers).map(|w| walker(e, w)).collect()).collect())
}

/// Draws from the prior at which the reconstruction succeeds.
fn over_prior(posterior: &Counted, scene: &Scene) -> Result<Positions, RunError> {
    let draw = |rng: &mut ChaCha8Rng| Some(scene.space.sample_prior(rng));
    reconstructed(posterior, scene, PRIOR_TRIES, draw).ok_or(RunError::PriorStart)
}

/// The first of so many draws, for each walker, at which the reconstruction succeeds; `None` if a walker finds none.
fn reconstructed(
    posterior: &Counted,
    scene: &Scene,
    tries: usize,
    draw: impl Fn(&mut ChaCha8Rng) -> Option<Vec<f64>> + Sync,
) -> Option<Positions> {
    let sampler = &scene.settings.sampler;
    let walker = |index: usize| {
        let mut rng = start_numbers(sampler.seed, index / sampler.walkers, index % sampler.walkers);
        let mut draws = (0..tries).filter_map(|_| draw(&mut rng));
        draws.find(|theta| posterior.evaluate(theta).log_prob.is_finite())
    };
    let walkers = 0..sampler.ensembles * sampler.walkers;
    let positions: Vec<Vec<f64>> = walkers.into_par_iter().with_max_len(1).map(walker).collect::<Option<_>>()?;
    Some(positions.chunks(sampler.walkers).map(<[_]>::to_vec).collect())
}
