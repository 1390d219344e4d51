//! The search of a star, its remarks, and the verdict.

use super::options::{BlindSearchError, BlindSearchOptions, RobustnessOf};
use super::priors::within_priors;
use super::summary::SearchSummary;
use crate::data::io::provenance::Measured;
use crate::data::scene::Scene;
use crate::inference::detection::{
    Detection, DetectionSettings, Evidence, KnownPlanet, Robustness, Stage, Tried, of_night_offsets, robustness,
};
use crate::inference::evidence::EvidenceRecord;
use crate::model::{Parameter, for_blind_search};
use crate::planets::periodogram::nights::NightOffsets;
use crate::planets::verdict::{Remark, Signal, UNBOUNDED, Verdict};
use crate::surface::{Constants, Explained, Linearised};
use std::borrow::Cow;

/// A search of the star of a [`Scene`] for planets of every period, its spots marginalised out.
#[derive(Clone, Debug)]
pub struct BlindSearch<'a> {
    pub(super) scene: &'a Scene,
    pub(super) settings: DetectionSettings,
    pub(super) detection: Cow<'a, Detection>,
    /// Dependence of the best orbit on single choices, where that was tested.
    pub(super) robustness: Option<Robustness>,
    /// The effect of night RV offsets on the highest peak.
    pub(super) night_offsets: Option<NightOffsets>,
    /// The same for each planet of known ephemeris, in the order of the config.
    pub(super) known_night_offsets: Vec<Option<NightOffsets>>,
    /// The profiles with the model of the spots of a star without a planet.
    pub(super) planet_free: Explained,
    /// The same with the best orbit.
    pub(super) at_best: Explained,
    /// Systemic velocity and RV offsets of data sets with the best orbit; `None` where they are not bounded.
    pub(super) constants: Option<Constants>,
    /// Bayes factors, where the config has priors for them.
    pub(super) evidence: Option<EvidenceRecord>,
    /// The verdict on the best orbit, or on the first planet where that is one of known ephemeris.
    pub verdict: Verdict,
    /// The verdict on each planet of known ephemeris, in the order of the config.
    pub known: Vec<Verdict>,
    /// The verdict on the highest peak, where the main verdict is on a planet of known ephemeris.
    pub blind: Option<Verdict>,
    /// Remarks beside the verdict.
    pub remarks: Vec<Remark>,
}

impl<'a> BlindSearch<'a> {
    /// Searches; `report` is called with the current stage.
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

    /// The summary for the star before an orbit is optimised or sampled; the search `before` is used where there is
    /// one. `None` where no orbit is searched for, K being fixed. Where the search fails the verdict says why.
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
            RobustnessOf::Candidates => match detection.known.first() {
                Some(planet) => planet.is_candidate(),
                None => detection.is_candidate(),
            },
            RobustnessOf::None => false,
        };
        let try_out = |tried| {
            report("other targets, without each night");
            let values = for_blind_search(scene.settings.values, &scene.settings.free);
            robustness(imager, values, &settings, &detection, tried)
        };
        let first = detection.known.first();
        let robustness = is_tried.then(|| try_out(first.map_or(Tried::Peak(&detection.best), Tried::Known)));
        let compares = options.robustness != RobustnessOf::None;
        let night_offsets = compares.then(|| detection.peak_beside_nights(settings.search)).flatten();
        let of_known = |planet| compares.then(|| detection.known_beside_nights(planet, settings.search));
        let known_night_offsets: Vec<_> = detection.known.planets.iter().map(|of| of_known(of).flatten()).collect();
        let surface = settings.surface.model();
        let explained = |here: &Linearised| surface.explained(imager, &scene.observations, here);
        let (planet_free, at_best) = (explained(&detection.planet_free), explained(detection.last()));
        let misfit: Vec<String> = at_best.misfit.iter().cloned().chain(scene.measured.misfit_text()).collect();
        let evidence = Evidence {
            imager,
            settings: &settings,
            robustness: robustness.as_ref(),
            night_offsets: first.map_or(night_offsets, |_| known_night_offsets[0]),
            misfit: &misfit,
        };
        let mut remarks = detection.remarks(&evidence);
        let of_the_star = detection.of_the_star(&evidence);
        let why_not = scene.measured.problem().or_else(|| detection.not_judged());
        let judged = |verdict: Verdict| why_not.as_ref().map_or(verdict, Verdict::not_judged);
        let mut known = Vec::new();
        for (planet, offsets) in detection.known.planets.iter().zip(&known_night_offsets) {
            let mut against = of_the_star.clone();
            let offsets = offsets.and_then(of_night_offsets);
            // the verdict on the first one is the main verdict
            if planet.ephemeris.planet > 0 {
                let number = planet.ephemeris.planet + 1;
                let said = |remark: &Remark| Remark::note(format!("Known planet {number}: {}", remark.text));
                remarks.extend(offsets.as_ref().map(said));
                against.extend(offsets);
            }
            known.push(judged(verdict_on(planet, detection.known.planets.len(), &against)));
        }
        let mut verdict = detection.verdict(&remarks);
        let mut blind = None;
        if first.is_some() {
            // the verdict on the highest peak in addition
            let is_tried = detection.is_candidate() && compares;
            let tried = is_tried.then(|| try_out(Tried::Peak(detection.highest())));
            let of_the_peak = detection.of_the_peak(tried.as_ref(), night_offsets);
            blind = Some(detection.verdict(&[of_the_star, of_the_peak.clone()].concat()));
            verdict = known[0].clone().with(&remarks);
            known[0] = judged(verdict.clone());
            let said = |remark: Remark| Remark::note(format!("Blind search: {}", remark.text));
            remarks.extend(of_the_peak.into_iter().map(said));
            remarks.extend(of_a_companion(&detection));
        } else if scene.settings.free.iter().any(|f| f.parameter == Parameter::K) {
            // where an orbit is required, among those that are allowed
            verdict = within_priors(scene, &detection, verdict, &mut remarks);
        }
        let (verdict, blind) = (judged(verdict), blind.map(judged));
        let evidence = scene.evidence(&detection.jitters());
        let constants = detection.constants(imager, &settings.nuisances);
        BlindSearch {
            scene,
            settings,
            detection,
            robustness,
            night_offsets,
            known_night_offsets,
            planet_free,
            at_best,
            constants,
            evidence,
            verdict,
            known,
            blind,
            remarks,
        }
    }

    /// Quantities measured from the observations, RV offsets of data sets with the best orbit.
    pub(super) fn measured(&self) -> Measured {
        let offsets = self.constants.as_ref().map_or(&[][..], |constants| &constants.offsets);
        self.scene.measured.clone().with_zero_points(offsets)
    }

    /// The summary, for results that depend on it.
    pub fn summary(self) -> SearchSummary {
        let BlindSearch { detection, verdict, known, blind, mut remarks, evidence, .. } = self;
        let beside = known.into_iter().skip(usize::from(blind.is_some())).map(|verdict| verdict.sentence);
        remarks.extend(beside.map(Remark::note));
        let blind = blind.map(|blind| format!("Blind search beside the known planets: {}", blind.sentence));
        remarks.extend(blind.map(Remark::note));
        remarks.extend(evidence.iter().map(|evidence| Remark::note(evidence.sentence.clone())));
        SearchSummary { verdict, remarks, rotation: Some(detection.blind.rotation.clone()), evidence }
    }
}

/// The remark that another planet was found in addition to the known ones.
fn of_a_companion(detection: &Detection) -> Option<Remark> {
    let frequency = detection.known.companion?;
    let period_d = detection.frequencies.rotation_period_d / frequency;
    Some(Remark::note(format!(
        "K of the known planets is measured beside the candidate at P = {period_d:.2} d; K of the candidate is of the \
        first linearisation."
    )))
}

/// The verdict on a planet of known ephemeris, one of so many, given the remarks on its star.
fn verdict_on(planet: &KnownPlanet, of: usize, remarks: &[Remark]) -> Verdict {
    let Some(k) = planet.k else { return Verdict::not_judged(UNBOUNDED) };
    let [k_kms, sigma_k_kms] = k.moments;
    let signal = Signal { period_d: planet.ephemeris.period_d[0], sigma_period_d: None, k_kms, sigma_k_kms };
    let number = (of > 1).then_some(planet.ephemeris.planet + 1);
    Verdict::of_known(number, planet.alone, signal, k.upper95, remarks)
}

fn message(stage: Stage) -> String {
    match stage {
        Stage::PlanetFree => "planet-free map".to_owned(),
        Stage::Known => "map with the known planets".to_owned(),
        Stage::Change => "testing for spot evolution".to_owned(),
        Stage::Search => "searching, FAP simulations".to_owned(),
        Stage::BestOrbit(round) => format!("map at the best orbit, round {round}"),
        Stage::SecondPlanet => "searching for a second planet".to_owned(),
    }
}
