//! The blind search that every statement on a planet rests on: what `periodogram` does without options, for the
//! commands that go on from there (`optimise`, `sample`, `batch`).
//!
//! An optimum or a chain takes a planet for granted and says which one; whether there is one is told by how often stars
//! without a planet show as much. So their results hold the search beside them, and its verdict heads them.

use super::known_planet::{KnownPlanet, known_planets};
use crate::data::scene::Scene;
use crate::inference::detection::{Detection, DetectionError, DetectionSettings, Evidence, Robustness, robustness};
use crate::inference::evidence::EvidenceRecord;
use crate::model::{Elements, Parameter, ParameterValues, Prior, for_blind_search, period_prior};
use crate::planets::periodogram::{
    CircularOrbit, Frequencies, FrequencyError, FrequencySettings, Imitation, RotationPeriods, Row,
};
use crate::planets::verdict::{Finding, Remark, Signal, Verdict};
use crate::surface::expansion::nuisances;
use crate::surface::fit::Explained;
use serde::{Deserialize, Serialize};

/// Frequencies closer than this many inverse time bases are the same.
const SAME_PERIOD: f64 = 0.5;

/// What the search found.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct BlindSearch {
    /// What is said of the best orbit.
    pub verdict: Verdict,
    /// What has to be known beside the verdict.
    pub remarks: Vec<Remark>,
    /// The star's own periods under this sampling; null where there was no search.
    #[doc(hidden)]
    pub rotation: Option<RotationPeriods>,
    /// Bayes factors of no, one and two planets; absent where the config has no priors for them.
    #[doc(hidden)]
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub evidence: Option<EvidenceRecord>,
}

#[derive(Debug, thiserror::Error)]
enum SearchError {
    #[error("{0}")]
    Frequencies(#[from] FrequencyError),
    #[error("{0}")]
    Detection(#[from] DetectionError),
}

impl BlindSearch {
    /// Searches the star of `scene`, what its config leaves free integrated out; the search `before` is taken where
    /// there is one. `None` where no orbit is asked for, K being fixed. Where the search fails the verdict says why.
    pub fn of(scene: &Scene, before: Option<&Detection>) -> Option<Self> {
        let asked = scene.settings.free.iter().any(|f| f.parameter == Parameter::K);
        asked.then(|| BlindSearch::tried(scene, before).unwrap_or_else(|error| BlindSearch::failed(&error)))
    }

    fn tried(scene: &Scene, before: Option<&Detection>) -> Result<Self, SearchError> {
        let rotation_period_d = scene.imager.star.rotation_period_d;
        let frequencies = Frequencies::new(&scene.imager.cycles(), rotation_period_d, FrequencySettings::default())?;
        let settings = DetectionSettings {
            spots: scene.spots(),
            ..DetectionSettings::of(scene.chi2_target, nuisances(&scene.settings.free))
        };
        let values = for_blind_search(scene.settings.values, &scene.settings.free);
        let anew;
        let found = match before {
            Some(found) => found,
            None => {
                anew = Detection::find(&scene.imager, values, frequencies, &settings, &|_| ())?;
                &anew
            }
        };
        // of what is no candidate it would say nothing
        let choices = found.is_candidate().then(|| robustness(&scene.imager, values, &settings, found));
        let Judged { mut remarks, of_the_star, .. } = Judged::of(scene, &settings, found, choices.as_ref());
        let mut verdict = found.verdict(&remarks);
        let prior = |p: Parameter| scene.settings.free.iter().find(|f| f.parameter == p).map(|f| f.prior);
        let [planet, _] = &Elements::PLANETS;
        let of_period = period_prior(&scene.settings.free, planet, scene.space.clock());
        let periods = Periods::of(of_period, &scene.settings.values, found);
        if !periods.contain(found.best.porb_over_prot) {
            remarks.retain(|remark| !found.of_the_period().contains(remark));
            remarks.push(Remark::against(
                "the highest peak lies at a period that the config does not allow",
                format!(
                    "the highest peak of the blind search, {:.4} d, lies at a period that the config does not allow: \
                    it may look \
                     like an orbit of another one",
                    rotation_period_d * found.best.porb_over_prot
                ),
            ));
            if verdict.finding != Finding::NotJudged {
                verdict = within(&periods, found, &remarks);
            }
        }
        let k_kms = verdict.signal.map(|signal| signal.k_kms);
        if let Some((k_kms, prior)) = k_kms.zip(prior(Parameter::K)).filter(|(k_kms, prior)| !prior.contains(*k_kms)) {
            let (low, high) = prior.bounds();
            let outside = Remark::against(
                "its K lies outside of the prior",
                format!("K of the blind search, {k_kms:.3} km/s, lies outside of the prior of k_kms, {low} to {high}"),
            );
            verdict = verdict.with(std::slice::from_ref(&outside));
            remarks.push(outside);
        }
        let planets = scene.evidence(&found.planet_free.quadratic);
        let (verdict, mut remarks) =
            with_known(known_planets(scene, &settings, found, &of_the_star), verdict, remarks, of_the_star);
        remarks.extend(planets.iter().map(|planets| Remark::note(planets.sentence.clone())));
        Ok(BlindSearch { verdict, rotation: Some(found.blind.rotation.clone()), remarks, evidence: planets })
    }

    fn failed(error: &SearchError) -> Self {
        let verdict = Verdict::not_judged(format!("the blind search failed ({error})"));
        BlindSearch { verdict, remarks: Vec::new(), rotation: None, evidence: None }
    }
}

/// What is to be said of a search beside its numbers.
pub(super) struct Judged {
    /// The profiles as the spots beside the best orbit explain them.
    pub at_best: Explained,
    /// All of it.
    pub remarks: Vec<Remark>,
    /// What does not concern the best period.
    pub of_the_star: Vec<Remark>,
}

impl Judged {
    /// Of what was found in `scene`, and whether it depends on `choices`, where these were tried.
    pub fn of(scene: &Scene, settings: &DetectionSettings, found: &Detection, choices: Option<&Robustness>) -> Self {
        let imager = &scene.imager;
        let at_best = Explained::new(imager, &scene.observations, found.last());
        let misfit: Vec<String> = at_best.misfit.iter().cloned().chain(scene.measured.misfit_text()).collect();
        let remarks = found.remarks(&Evidence { imager, settings, robustness: choices, misfit: &misfit });
        let of_the_period = found.of_the_period();
        let of_the_star = remarks.iter().filter(|remark| !of_the_period.contains(remark)).cloned().collect();
        Judged { at_best, remarks, of_the_star }
    }
}

/// The verdict is that on a planet of known ephemeris where the config looks for one first; what else is found is said
/// beside it.
pub fn with_known(
    known: Vec<KnownPlanet>,
    verdict: Verdict,
    mut remarks: Vec<Remark>,
    of_the_star: Vec<Remark>,
) -> (Verdict, Vec<Remark>) {
    let mut head = verdict.clone();
    for KnownPlanet { is_first, verdict: known } in known {
        if is_first {
            remarks = of_the_star.clone();
            remarks.push(Remark::note(format!("the blind search, beside the known planet: {}", verdict.sentence)));
            head = known;
        } else {
            remarks.push(Remark::note(format!("the planet of known ephemeris: {}", known.sentence)));
        }
    }
    (head, remarks)
}

/// The periods that a config allows.
enum Periods {
    /// Within a prior.
    Prior(Prior),
    /// This one, to half the inverse time base.
    At { porb_over_prot: f64, time_base_cycles: f64 },
}

impl Periods {
    fn of(prior: Option<Prior>, values: &ParameterValues, found: &Detection) -> Self {
        let time_base_cycles = found.frequencies.time_base_cycles;
        let fixed = Periods::At { porb_over_prot: values[Parameter::PorbOverProt], time_base_cycles };
        prior.map_or(fixed, Periods::Prior)
    }

    fn contain(&self, porb_over_prot: f64) -> bool {
        match self {
            Periods::Prior(prior) => prior.contains(porb_over_prot),
            Periods::At { porb_over_prot: at, time_base_cycles } => {
                is_same_period(porb_over_prot, *at, *time_base_cycles)
            }
        }
    }
}

/// The verdict where the best period is not allowed: that of the highest peak, or else place, that is, by the chance of
/// one as high at any period.
fn within(periods: &Periods, found: &Detection, remarks: &[Remark]) -> Verdict {
    let rotation_period_d = found.frequencies.rotation_period_d;
    let peak = found.blind.peaks.iter().find(|peak| periods.contain(peak.porb_over_prot));
    let place = |row: &Row| Some((1.0 / row.trial.frequency, row.trial.orbit?));
    let places = found.blind.rows.iter().filter_map(place).filter(|(ratio, _)| periods.contain(*ratio));
    let highest = || places.max_by(|a, b| a.1.delta_ln_l.total_cmp(&b.1.delta_ln_l));
    let Some((porb_over_prot, orbit)) = peak.map(|peak| (peak.porb_over_prot, peak.orbit)).or_else(highest) else {
        return Verdict::not_judged("the blind search has none of the periods that the config allows");
    };
    let imitation = peak.and_then(|peak| peak.imitation).filter(Imitation::is_likely);
    let words = imitation.map(|imitation| format!("the period is {}", imitation.words(rotation_period_d)));
    let remarks: Vec<Remark> = remarks.iter().cloned().chain(words.map(|words| Remark::against(words, ""))).collect();
    let CircularOrbit { k_kms, sigma_k_kms, delta_ln_l, .. } = orbit;
    let signal = Signal { period_d: rotation_period_d * porb_over_prot, k_kms, sigma_k_kms };
    Verdict::new(found.blind.false_alarm.probability(delta_ln_l).value(), signal, &remarks)
}

/// Whether a time base does not tell two periods apart.
fn is_same_period(one: f64, other: f64, time_base_cycles: f64) -> bool {
    (1.0 / one - 1.0 / other).abs() * time_base_cycles < SAME_PERIOD
}

impl BlindSearch {
    /// The same beside an orbit that was found, of this `Porb/Prot`.
    #[doc(hidden)]
    pub fn beside(mut self, porb_over_prot: f64, rotation_period_d: f64) -> Self {
        let is_found = matches!(self.verdict.finding, Finding::Candidate | Finding::Detection);
        if let Some(another) = self.of_another_orbit(porb_over_prot, rotation_period_d).filter(|_| is_found) {
            self.verdict = self.verdict.with(std::slice::from_ref(&another));
            self.remarks.push(another);
        }
        self
    }

    /// What speaks against a planet where the orbit that was found, of this `Porb/Prot`, is not the one that the
    /// verdict is on.
    #[doc(hidden)]
    pub fn of_another_orbit(&self, porb_over_prot: f64, rotation_period_d: f64) -> Option<Remark> {
        let (signal, rotation) = (self.verdict.signal?, self.rotation.as_ref()?);
        let judged = signal.period_d / rotation_period_d;
        (!is_same_period(porb_over_prot, judged, rotation.time_base_cycles)).then(|| {
            let found = rotation_period_d * porb_over_prot;
            let judged = signal.period_d;
            Remark::against(
                format!("the orbit found here is another one ({found:.4} d)"),
                format!("the blind search judges an orbit of {judged:.4} d, and the one found here has {found:.4} d"),
            )
        })
    }
}
