//! The verdict where the priors of a config do not allow the best orbit.

use crate::data::scene::Scene;
use crate::inference::detection::Detection;
use crate::model::{Elements, Parameter, Prior, period_prior};
use crate::planets::periodogram::window::is_same_frequency;
use crate::planets::periodogram::{CircularOrbit, Imitation, Row};
use crate::planets::verdict::{Finding, Remark, Signal, Verdict, decimals, speed};

/// The verdict on orbits that the priors of `scene` allow; remarks on other orbits are removed, and one on disallowed
/// orbits is added.
pub fn within_priors(scene: &Scene, found: &Detection, mut verdict: Verdict, remarks: &mut Vec<Remark>) -> Verdict {
    let periods = Periods::of(scene, found);
    if !periods.contain(found.best.porb_over_prot) {
        let of_the_period = found.of_the_period();
        remarks.retain(|remark| !of_the_period.contains(remark));
        let prot = found.frequencies.rotation_period_d;
        let digits = decimals(found.best.sigma_porb_over_prot.map_or(f64::NAN, |sigma| prot * sigma));
        let period_d = prot * found.best.porb_over_prot;
        remarks.push(Remark::against(
            "highest peak outside the period prior",
            format!(
                "The highest peak, P = {period_d:.digits$} d, lies outside the period prior and may alias into it: \
                widen the prior."
            ),
        ));
        if verdict.finding != Finding::NotJudged {
            verdict = highest(&periods, found, remarks);
        }
    }
    verdict = verdict.with_periods(found.shares(&|ratio| periods.contain(ratio)));
    let prior = scene.settings.free.iter().find(|f| f.parameter == Parameter::K).map(|f| f.prior);
    if let Some((Signal { k_kms, sigma_k_kms, .. }, prior)) =
        verdict.signal.zip(prior).filter(|(s, prior)| !prior.contains(s.k_kms))
    {
        let (low, high) = prior.bounds();
        let outside = Remark::against(
            "K outside its prior",
            format!(
                "K = {} of the blind search lies outside the prior of k_kms ({low} to {high} km/s).",
                speed(k_kms, sigma_k_kms)
            ),
        );
        verdict = verdict.with(std::slice::from_ref(&outside));
        remarks.push(outside);
    }
    verdict
}

/// The periods that a config allows.
enum Periods {
    /// Within a prior.
    Prior(Prior),
    /// This one, within half the inverse time base.
    At { porb_over_prot: f64, time_base_cycles: f64 },
}

impl Periods {
    fn of(scene: &Scene, found: &Detection) -> Self {
        let time_base_cycles = found.frequencies.time_base_cycles;
        let porb_over_prot = scene.settings.values[Parameter::PorbOverProt];
        let prior = period_prior(&scene.settings.free, &Elements::PLANETS[0], scene.space.clock());
        prior.map_or(Periods::At { porb_over_prot, time_base_cycles }, Periods::Prior)
    }

    fn contain(&self, ratio: f64) -> bool {
        match self {
            Periods::Prior(prior) => prior.contains(ratio),
            Periods::At { porb_over_prot, time_base_cycles } => {
                is_same_frequency(1.0 / ratio, 1.0 / porb_over_prot, *time_base_cycles)
            }
        }
    }
}

/// The verdict on the highest peak at `periods`, or else on the highest point there, by the probability of one as high
/// at any period.
fn highest(periods: &Periods, found: &Detection, remarks: &[Remark]) -> Verdict {
    let rotation_period_d = found.frequencies.rotation_period_d;
    let peak = found.blind.peaks.iter().find(|peak| periods.contain(peak.porb_over_prot));
    let place = |row: &Row| Some((1.0 / row.trial.frequency, row.trial.orbit?));
    let places = found.blind.rows.iter().filter_map(place).filter(|(ratio, _)| periods.contain(*ratio));
    let highest = || places.max_by(|a, b| a.1.delta_ln_l.total_cmp(&b.1.delta_ln_l));
    let sigma_period_d = peak.and_then(|peak| peak.sigma_porb_over_prot).map(|sigma| rotation_period_d * sigma);
    let Some((porb_over_prot, orbit)) = peak.map(|peak| (peak.porb_over_prot, peak.orbit)).or_else(highest) else {
        return Verdict::not_judged("the blind search covers none of the periods that the prior allows");
    };
    let imitation = peak.and_then(|peak| peak.imitation).filter(Imitation::is_likely);
    let words = imitation.map(|imitation| format!("P {}", imitation.words(rotation_period_d)));
    let remarks: Vec<Remark> = remarks.iter().cloned().chain(words.map(|words| Remark::against(words, ""))).collect();
    let CircularOrbit { k_kms, sigma_k_kms, delta_ln_l, .. } = orbit;
    let signal = Signal { period_d: rotation_period_d * porb_over_prot, sigma_period_d, k_kms, sigma_k_kms };
    let alarm = &found.blind.false_alarm;
    Verdict::new(alarm.probability(delta_ln_l).value(), alarm.maxima.len(), signal, &remarks)
}
