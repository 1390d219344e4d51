//! The blind search as `periodogram` makes it: with its options, how far it depends on choices, and all files.

use crate::data::io::atomic::WriteError;
use crate::data::io::periodogram::PeriodogramResult;
use crate::data::io::provenance::Provenance;
use crate::data::scene::Scene;
use crate::inference::detection::{Detection, DetectionError, DetectionSettings, Robustness, Stage, robustness};
use crate::inference::evidence::EvidenceRecord;
use crate::model::for_blind_search;
use crate::planets::periodogram::{Frequencies, FrequencyError, FrequencySettings, SearchSettings};
use crate::planets::verdict::{Remark, Verdict};
use crate::runs::blind_search::{Judged, with_known};
use crate::runs::known_planet::known_planets;
use crate::surface::expansion::nuisances;
use crate::surface::fit::Explained;
use std::path::{Path, PathBuf};

/// What to search for, and how.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PeriodogramOptions {
    /// Shortest period (d); by default that of 5 average Nyquist frequencies, or twice the median spacing if that is
    /// longer.
    pub min_period_d: Option<f64>,
    /// Longest period (d); by default twice the time base.
    pub max_period_d: Option<f64>,
    /// Trial frequencies to each inverse time base; 10 by default.
    pub oversampling: Option<f64>,
    /// Whether eccentric orbits are fitted around the peaks as well.
    pub eccentric: bool,
    /// Whether a second planet is searched for.
    pub second_planet: bool,
    /// Whether systemic velocity and stellar parameters that are free in the config are held at its values, instead of
    /// integrated out within their priors.
    pub fixed: bool,
    /// Number of stars without a planet that peaks are judged by.
    pub draws: usize,
    /// Seed of these draws.
    pub seed: u64,
}

impl PeriodogramOptions {
    /// Number of stars without a planet where nothing else is asked for.
    pub const DRAWS: usize = 10_000;

    fn settings(&self, scene: &Scene) -> DetectionSettings {
        DetectionSettings {
            chi2_target: scene.chi2_target,
            nuisances: if self.fixed { Vec::new() } else { nuisances(&scene.settings.free) },
            search: SearchSettings { draws: self.draws, seed: self.seed },
            eccentric: self.eccentric,
            second_planet: self.second_planet,
            spots: scene.spots(),
        }
    }
}

impl Default for PeriodogramOptions {
    fn default() -> Self {
        PeriodogramOptions {
            min_period_d: None,
            max_period_d: None,
            oversampling: None,
            eccentric: false,
            second_planet: false,
            fixed: false,
            draws: PeriodogramOptions::DRAWS,
            seed: 1,
        }
    }
}

/// A search of the star of a [`Scene`] for planets of every period, its spots marginalised out.
#[derive(Clone, Debug)]
pub struct Periodogram<'a> {
    scene: &'a Scene,
    settings: DetectionSettings,
    detection: Detection,
    choices: Robustness,
    planet_free: Explained,
    at_best: Explained,
    remarks: Vec<Remark>,
    evidence: Option<EvidenceRecord>,
    provenance: Provenance,
    /// What is said of the best orbit.
    pub verdict: Verdict,
}

/// Why there is no periodogram.
#[derive(Debug, thiserror::Error)]
pub enum PeriodogramError {
    /// No trial periods.
    #[error("{error}")]
    Frequencies {
        /// The config.
        config: PathBuf,
        /// What is wrong with them.
        error: FrequencyError,
    },
    /// No search.
    #[error("{}: {error}", config.display())]
    Detection {
        /// The config.
        config: PathBuf,
        /// What it came to.
        error: DetectionError,
    },
}

impl<'a> Periodogram<'a> {
    /// Searches; `report` is told what is under way.
    ///
    /// # Errors
    /// [`PeriodogramError`].
    pub fn of(scene: &'a Scene, options: &PeriodogramOptions, report: &dyn Fn(&str)) -> Result<Self, PeriodogramError> {
        let config = || scene.settings.path.clone();
        let PeriodogramOptions { min_period_d, max_period_d, oversampling, .. } = *options;
        let asked = FrequencySettings { min_period_d, max_period_d, oversampling };
        let frequencies = Frequencies::new(&scene.imager.cycles(), scene.imager.star.rotation_period_d, asked)
            .map_err(|error| PeriodogramError::Frequencies { config: config(), error })?;
        let settings = options.settings(scene);
        let failed = |error| PeriodogramError::Detection { config: config(), error };
        let imager = &scene.imager;
        let values = for_blind_search(scene.settings.values, &scene.settings.free);
        let at = |stage| report(&message(stage));
        let detection = Detection::find(imager, values, frequencies, &settings, &at).map_err(failed)?;
        report("other targets, without each night");
        let choices = robustness(imager, values, &settings, &detection);
        let planet_free = Explained::new(imager, &scene.observations, &detection.planet_free);
        let Judged { at_best, remarks, of_the_star } = Judged::of(scene, &settings, &detection, Some(&choices));
        let known = known_planets(scene, &settings, &detection, &of_the_star);
        let (verdict, remarks) = with_known(known, detection.verdict(&remarks), remarks, of_the_star);
        Ok(Periodogram {
            evidence: scene.evidence(&detection.planet_free.quadratic),
            provenance: scene.provenance(),
            scene,
            settings,
            detection,
            choices,
            planet_free,
            at_best,
            remarks,
            verdict,
        })
    }

    fn result(&self) -> PeriodogramResult<'_> {
        PeriodogramResult {
            imager: &self.scene.imager,
            detection: &self.detection,
            verdict: &self.verdict,
            remarks: &self.remarks,
            evidence: self.evidence.as_ref(),
            robustness: &self.choices,
            settings: &self.settings,
            planet_free: &self.planet_free,
            at_best: &self.at_best,
            truth: self.scene.truth,
            mass_msun: self.scene.settings.mass_msun,
            provenance: &self.provenance,
        }
    }

    /// Names of the files, in the order in which they are written.
    pub fn files(&self) -> Vec<&'static str> {
        self.result().files()
    }

    /// Writes `rv.csv`, `covariance.csv`, `periodogram.csv` and `periodogram.json` into `folder`, which must exist;
    /// with a second planet `periodogram_2.csv`, too.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn write(&self, folder: &Path) -> Result<(), WriteError> {
        self.result().write(folder)
    }

    /// The table of what was found, and what the config leaves to the observations.
    pub fn table(&self) -> String {
        let measured = self.scene.measured.lines();
        let measured: String = measured.iter().map(|(label, text)| format!("{label}: {text}\n")).collect();
        self.result().table() + &measured
    }
}

fn message(stage: Stage) -> String {
    match stage {
        Stage::PlanetFree => "reconstructing without a planet".to_owned(),
        Stage::Change => "looking whether the star changes".to_owned(),
        Stage::Search => "searching, false alarms".to_owned(),
        Stage::BestOrbit(round) => format!("reconstructing at the best orbit, round {round}"),
        Stage::SecondPlanet => "searching for a second planet".to_owned(),
    }
}
