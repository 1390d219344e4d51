//! The search of a star, what is to be said of it, and the verdict.

use super::known_planet::{KnownPlanet, known_planets};
use super::options::{BlindSearchError, BlindSearchOptions, RobustnessOf};
use super::priors::within_priors;
use super::summary::SearchSummary;
use crate::data::io::provenance::Measured;
use crate::data::scene::Scene;
use crate::inference::detection::{Detection, DetectionSettings, Evidence, Robustness, Stage, robustness};
use crate::inference::evidence::EvidenceRecord;
use crate::model::{Parameter, for_blind_search};
use crate::planets::verdict::{Remark, Verdict};
use crate::surface::{Constants, Explained, Linearised};
use std::borrow::Cow;

/// A search of the star of a [`Scene`] for planets of every period, its spots marginalised out.
#[derive(Clone, Debug)]
pub struct BlindSearch<'a> {
    pub(super) scene: &'a Scene,
    pub(super) settings: DetectionSettings,
    pub(super) detection: Cow<'a, Detection>,
    /// Whether the best orbit depends on a choice, where that was tried.
    pub(super) robustness: Option<Robustness>,
    /// The profiles as the spots of a star without a planet explain them.
    pub(super) planet_free: Explained,
    /// The same beside the best orbit.
    pub(super) at_best: Explained,
    /// Systemic velocity and RV offsets of data sets beside the best orbit; `None` where they are not bounded.
    pub(super) constants: Option<Constants>,
    /// Bayes factors, where the config has priors for them.
    pub(super) evidence: Option<EvidenceRecord>,
    /// What is said of the best orbit, or of a planet of known ephemeris.
    pub verdict: Verdict,
    /// What has to be known beside the verdict.
    pub remarks: Vec<Remark>,
}

impl<'a> BlindSearch<'a> {
    /// Searches; `report` is told what is under way.
    ///
    /// # Errors
    /// [`BlindSearchError`].
    pub fn of(scene: &'a Scene, options: &BlindSearchOptions, report: &dyn Fn(&str)) -> Result<Self, BlindSearchError> {
        let frequencies = options.frequencies(scene)?;
        let values = for_blind_search(scene.settings.values, &scene.settings.free);
        let at = |stage| report(&message(stage));
        let found = Detection::find(&scene.imager, values, frequencies, &options.detection(scene), &at)?;
        Ok(BlindSearch::judged(scene, options, Cow::Owned(found), report))
    }

    /// What is said of the star before an orbit is climbed to or sampled; the search `before` is taken where there is
    /// one. `None` where no orbit is asked for, K being fixed. Where the search fails the verdict says why.
    #[doc(hidden)]
    pub fn summary_of(scene: &'a Scene, before: Option<&'a Detection>) -> Option<SearchSummary> {
        scene.settings.free.iter().find(|f| f.parameter == Parameter::K)?;
        let options = BlindSearchOptions::before_a_chain();
        let found = match before {
            Some(found) => Ok(BlindSearch::judged(scene, &options, Cow::Borrowed(found), &|_| ())),
            None => BlindSearch::of(scene, &options, &|_| ()),
        };
        Some(found.map_or_else(|error| SearchSummary::failed(&error), BlindSearch::summary))
    }

    fn judged(
        scene: &'a Scene,
        options: &BlindSearchOptions,
        detection: Cow<'a, Detection>,
        report: &dyn Fn(&str),
    ) -> Self {
        let (imager, settings) = (&scene.imager, options.detection(scene));
        let is_tried = match options.robustness {
            RobustnessOf::Any => true,
            RobustnessOf::Candidates => detection.is_candidate(),
            RobustnessOf::None => false,
        };
        let robustness = is_tried.then(|| {
            report("other targets, without each night");
            let values = for_blind_search(scene.settings.values, &scene.settings.free);
            robustness(imager, values, &settings, &detection)
        });
        let surface = settings.surface.model();
        let explained = |here: &Linearised| surface.explained(imager, &scene.observations, here);
        let (planet_free, at_best) = (explained(&detection.planet_free), explained(detection.last()));
        let misfit: Vec<String> = at_best.misfit.iter().cloned().chain(scene.measured.misfit_text()).collect();
        let evidence = Evidence { imager, settings: &settings, robustness: robustness.as_ref(), misfit: &misfit };
        let mut remarks = detection.remarks(&evidence);
        let of_the_period = detection.of_the_period();
        let of_the_star: Vec<Remark> = remarks.iter().filter(|r| !of_the_period.contains(r)).cloned().collect();
        let mut verdict = detection.verdict(&remarks);
        // where an orbit is asked for, of those that are allowed
        if scene.settings.free.iter().any(|f| f.parameter == Parameter::K) {
            verdict = within_priors(scene, &detection, verdict, &mut remarks);
        }
        // on a planet of known ephemeris where the config looks for one first; what else is found is said beside it
        let blind = verdict.sentence.clone();
        for KnownPlanet { is_first, verdict: known } in known_planets(scene, &settings, &detection, &of_the_star) {
            if is_first {
                remarks = of_the_star.clone();
                remarks.push(Remark::note(format!("Blind search, with the known planet in the model: {blind}")));
                verdict = known;
            } else {
                remarks.push(Remark::note(known.sentence.clone()));
            }
        }
        if let Some(text) = scene.measured.problem() {
            verdict = Verdict::not_judged(text);
        }
        let evidence = scene.evidence(&detection.jitters());
        let constants = detection.constants(imager, &settings.nuisances);
        BlindSearch {
            scene,
            settings,
            detection,
            robustness,
            planet_free,
            at_best,
            constants,
            evidence,
            verdict,
            remarks,
        }
    }

    /// What the config leaves to the observations, RV offsets of data sets beside the best orbit.
    pub(super) fn measured(&self) -> Measured {
        let offsets = self.constants.as_ref().map_or(&[][..], |constants| &constants.offsets);
        self.scene.measured.clone().with_zero_points(offsets)
    }

    /// The head of it, for results that rest on it.
    pub fn summary(self) -> SearchSummary {
        let BlindSearch { detection, verdict, mut remarks, evidence, .. } = self;
        remarks.extend(evidence.iter().map(|evidence| Remark::note(evidence.sentence.clone())));
        SearchSummary { verdict, remarks, rotation: Some(detection.blind.rotation.clone()), evidence }
    }
}

fn message(stage: Stage) -> String {
    match stage {
        Stage::PlanetFree => "planet-free map".to_owned(),
        Stage::Change => "testing for spot evolution".to_owned(),
        Stage::Search => "searching, FAP simulations".to_owned(),
        Stage::BestOrbit(round) => format!("map at the best orbit, round {round}"),
        Stage::SecondPlanet => "searching for a second planet".to_owned(),
    }
}
