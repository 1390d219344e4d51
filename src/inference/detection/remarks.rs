//! The results of a blind search in words: caveats, other remarks, and the verdict.

use super::{Detection, DetectionSettings, KnownPlanet, Robustness, WithoutNight};
use crate::model::Parameter;
use crate::planets::periodogram::Peak;
use crate::planets::periodogram::nights::NightOffsets;
use crate::planets::periodogram::offset::Offset;
use crate::planets::periodogram::peaks::posterior_shares;
use crate::planets::speeds::{Speeds, with_unit};
use crate::planets::verdict::{CANDIDATE_FAP, LEAST_SHARE, PeriodShare, Remark, UNAMBIGUOUS, Verdict, decimals};
use crate::surface::imaging::Imager;

/// Fewer profiles than this hardly constrain the unresolved-spot noise.
const FEW: usize = 12;

/// The systemic velocity may be wrong when another one raises ln L by this much: 5 standard deviations.
const OFFSET_GAIN: f64 = 12.5;

/// Delta ln L of a known planet whose false-alarm probability is 1 %: 2.33 standard errors, one-sided.
const KNOWN_LEVEL: f64 = 2.706;

/// A K of a known planet that is this many standard errors below zero is reported.
const NEGATIVE: f64 = 2.0;

/// Largest number of other possibly true peaks that are named.
const RIVALS_NAMED: usize = 3;

/// Largest number of nights that are named as driving a signal.
const NIGHTS_NAMED: usize = 3;

/// Other inputs of a verdict.
#[derive(Clone, Copy, Debug)]
pub struct Evidence<'a> {
    /// The surface model of the images.
    pub imager: &'a Imager,
    /// The settings of the search.
    pub settings: &'a DetectionSettings,
    /// Whether the best orbit depends on target or nights, where that was tested.
    pub robustness: Option<&'a Robustness>,
    /// Effect of nightly RV offsets on the best orbit.
    pub night_offsets: Option<NightOffsets>,
    /// Deviations from noise in the residuals of the last image.
    pub misfit: &'a [String],
}

impl Detection {
    /// The verdict on the highest peak, given the [`Detection::remarks`].
    pub fn verdict(&self, remarks: &[Remark]) -> Verdict {
        let signal = self.highest().signal(self.frequencies.rotation_period_d);
        match self.not_judged() {
            Some(sentence) => Verdict::not_judged(sentence),
            None => Verdict::new(self.false_alarm_probability(), self.blind.false_alarm.maxima.len(), signal, remarks)
                .with_periods(self.shares(&|_| true)),
        }
    }

    /// The degeneracy with spots at the rotation period.
    pub fn co_rotation(&self) -> String {
        match self.co_rotation_penalty {
            Some(ratio) if ratio > 1.1 => {
                format!("At P = P_rot σ_K is {ratio:.1} times its median (spot modulation).")
            }
            Some(ratio) => format!("At P = P_rot σ_K is {ratio:.2} times its median."),
            None => "At P = P_rot an orbit is degenerate with spot modulation, and K is unbounded there.".to_owned(),
        }
    }

    /// All remarks, caveats included.
    pub fn remarks(&self, evidence: &Evidence) -> Vec<Remark> {
        [self.of_the_star(evidence), self.of_the_best_orbit(evidence), self.of_the_search()].concat()
    }

    /// Remarks on the star, whatever its planets.
    pub fn of_the_star(&self, evidence: &Evidence) -> Vec<Remark> {
        let mut remarks = evidence.settings.surface.model().remarks(evidence.imager, self.last());
        let misfit = |text: &String| Remark::against("residuals inconsistent with noise", text);
        remarks.extend(evidence.misfit.iter().map(misfit));
        remarks.extend(self.of_the_data(evidence));
        remarks.extend(self.of_the_change());
        let near = self.other_rotation.as_ref().filter(|other| !other.is_far());
        remarks.extend(near.map(|other| Remark::note(other.sentence())));
        remarks
    }

    /// Remarks on the highest peak: its period, its dependence on tested choices, and the effect of nightly RV offsets.
    pub fn of_the_peak(&self, robustness: Option<&Robustness>, night_offsets: Option<NightOffsets>) -> Vec<Remark> {
        let mut remarks = if self.is_candidate() { self.of_the_period() } else { Vec::new() };
        let level = self.blind.false_alarm.level(CANDIDATE_FAP);
        remarks.extend(of_choices(robustness, self.blind.best().orbit.delta_ln_l, level));
        remarks.extend(night_offsets.and_then(of_night_offsets));
        remarks.extend(self.of_offsets());
        if self.highest().on_edge {
            remarks.push(Remark::against(
                "P at the edge of the search",
                "The best period lies at the edge of the search: extend it (--min-period-d, --max-period-d).",
            ));
        }
        remarks
    }

    /// The most likely RV offsets of nights without the planet and with it, where there are any.
    fn of_offsets(&self) -> Option<Remark> {
        let without_kms = self.blind.false_alarm.night_kms;
        let with_kms = self.at_best.as_ref()?.field.as_ref()?.night_offsets_kms;
        (self.is_candidate() && (without_kms > 0.0 || with_kms > 0.0)).then(|| {
            Remark::note(format!(
                "Most likely RV offsets of nights: {} without the planet (counted in the FAP), {} with it (counted in \
                K ± σ_K).",
                with_unit(without_kms),
                with_unit(with_kms)
            ))
        })
    }

    /// Remarks on the best orbit.
    fn of_the_best_orbit(&self, evidence: &Evidence) -> Vec<Remark> {
        if let Some(planet) = self.known.first() {
            let mut remarks = of_choices(evidence.robustness, planet.orbit().delta_ln_l, KNOWN_LEVEL);
            remarks.extend(evidence.night_offsets.and_then(of_night_offsets));
            remarks.extend(self.of_negative(planet));
            return remarks;
        }
        let mut remarks = self.of_the_peak(evidence.robustness, evidence.night_offsets);
        if !self.best.on_edge && !self.closed {
            let rounds = self.rounds;
            remarks.push(Remark::against(
                "K not converged",
                format!("K has not converged after {rounds} re-linearisations."),
            ));
        }
        remarks
    }

    /// The remark on a negative K.
    fn of_negative(&self, planet: &KnownPlanet) -> Option<Remark> {
        let [k_kms, sigma_k_kms] = planet.alone;
        let sigmas = -k_kms / sigma_k_kms;
        (sigmas > NEGATIVE).then(|| {
            Remark::note(format!(
                "K of the known planet is negative at {sigmas:.1}σ: is its time that of the conjunction with the \
                planet in front?"
            ))
        })
    }

    /// Other remarks on the search.
    fn of_the_search(&self) -> Vec<Remark> {
        let mut remarks = Vec::new();
        let shortest = self.frequencies.rotation_period_d / self.frequencies.range().1;
        if shortest > self.frequencies.rotation_period_d {
            remarks.push(Remark::note(format!(
                "The search starts at {shortest:.3} d, above P_rot = {:.3} d: spot signals at P_rot and its \
                harmonics appear only as aliases; use --min-period-d.",
                self.frequencies.rotation_period_d
            )));
        }
        if self.last().quadratic.radial_velocities().is_err() {
            remarks.push(Remark::note(
                "The RVs are not all constrained by the data: rv.csv and covariance.csv contain no values.",
            ));
        }
        remarks
    }

    /// Remarks on limitations of the profiles.
    fn of_the_data(&self, evidence: &Evidence) -> Vec<Remark> {
        let Evidence { imager, settings, .. } = *evidence;
        let mut remarks = Vec::new();
        let fixed = settings.nuisances.iter().all(|nuisance| nuisance.parameter != Parameter::Vsys);
        if let Some(offset) = self.offset.filter(|offset| fixed && offset.gain > OFFSET_GAIN) {
            let Offset { velocity_kms, sigma_kms, gain } = offset;
            remarks.push(Remark::against(
                "systemic velocity may be wrong",
                format!(
                    "An RV offset of {velocity_kms:+.3} ± {sigma_kms:.3} km/s raises ln L by {gain:.0}: \
                    star.vsys_kms may be wrong, which produces spurious peaks; free vsys_kms under parameters."
                ),
            ));
        }
        let turns = imager.time_base_cycles();
        if turns < 1.0 {
            remarks.push(Remark::note(format!(
                "The data span only {turns:.2} rotations: parts of the surface are unseen, or \
                star.rotation_period_d (days) is wrong."
            )));
        }
        let profiles = imager.profiles().count();
        if profiles < FEW {
            remarks.push(Remark::against(
                "few profiles",
                format!(
                    "Only {profiles} profiles: the unresolved-spot noise is poorly constrained; expect reduced \
                    sensitivity and approximate uncertainties."
                ),
            ));
        }
        remarks
    }

    /// Whether the spots evolve although a static map is assumed.
    fn of_the_change(&self) -> Option<Remark> {
        match self.change.as_ref()? {
            Ok(change) => change.is_changing().then(|| Remark::against("spot evolution", change.sentence())),
            Err(error) => Some(Remark::against(
                "spot evolution not tested",
                format!("Spot evolution could not be tested: {error}."),
            )),
        }
    }

    /// Remarks on ambiguities of the best period.
    pub fn of_the_period(&self) -> Vec<Remark> {
        let mut remarks = Vec::new();
        if let Some(imitation) = self.highest().imitation {
            let words = imitation.words(self.frequencies.rotation_period_d);
            let what = match imitation.alias {
                None => format!("The best period is consistent with {}", imitation.period()),
                Some(_) => {
                    format!("With this sampling the best period is consistent with {} ({words})", imitation.period())
                }
            };
            let text = format!("{what} (rotational harmonic): inspect the other peaks.");
            remarks.push(match imitation.is_likely() {
                true => Remark::against(format!("P {words}"), text),
                false => Remark::note(text),
            });
        }
        let rivals = self.rivals();
        if !rivals.is_empty() {
            let mut named: Vec<String> =
                rivals.iter().take(RIVALS_NAMED).map(|(peak, share)| self.rival(peak, *share)).collect();
            if rivals.len() > RIVALS_NAMED {
                named.push(format!("and {} more", rivals.len() - RIVALS_NAMED));
            }
            remarks.push(Remark::note(format!("Period ambiguous: {}.", named.join("; "))));
        }
        remarks
    }

    /// Posterior shares of the peaks whose `Porb/Prot` is allowed.
    pub fn shares(&self, is_allowed: &dyn Fn(f64) -> bool) -> Vec<PeriodShare> {
        let peaks: Vec<&Peak> = self.blind.peaks.iter().filter(|peak| is_allowed(peak.porb_over_prot)).collect();
        let shares = posterior_shares(&peaks);
        let of = |(peak, share): (&&Peak, f64)| PeriodShare {
            period_d: self.frequencies.rotation_period_d * peak.porb_over_prot,
            share,
        };
        peaks.iter().zip(shares).map(of).collect()
    }

    /// Other possibly true peaks, the most probable first, where the share of the highest is small enough.
    fn rivals(&self) -> Vec<(&Peak, f64)> {
        let peaks: Vec<&Peak> = self.blind.peaks.iter().collect();
        let shares = posterior_shares(&peaks);
        if shares.iter().any(|share| *share > UNAMBIGUOUS) {
            return Vec::new();
        }
        let mut rivals: Vec<(&Peak, f64)> = peaks.into_iter().zip(shares).skip(1).collect();
        rivals.retain(|(_, share)| *share >= LEAST_SHARE);
        rivals.sort_by(|a, b| b.1.total_cmp(&a.1));
        rivals
    }

    fn rival(&self, peak: &Peak, share: f64) -> String {
        let period_d = self.frequencies.rotation_period_d * peak.porb_over_prot;
        let sigma = peak.sigma_porb_over_prot.map(|sigma| self.frequencies.rotation_period_d * sigma);
        let digits = decimals(sigma.unwrap_or(f64::NAN));
        let below = self.blind.best().orbit.delta_ln_l - peak.orbit.delta_ln_l;
        let alias = if peak.alias.is_some() { " (sampling alias)" } else { "" };
        let percent = 100.0 * share;
        format!("P = {period_d:.digits$} d{alias} has {percent:.0} % of the posterior (Δln L = -{below:.1})")
    }
}

/// Whether an orbit of that `height` depends on a tested choice; that of a candidate is at least `level`.
fn of_choices(robustness: Option<&Robustness>, height: f64, level: f64) -> Vec<Remark> {
    let Some(robustness) = robustness else { return Vec::new() };
    let mut remarks = Vec::new();
    if let Some(errors) = robustness.target_matters() {
        remarks.push(Remark::against(
            "K depends on the target χ²",
            format!("K shifts by {errors:.1}σ when imaging.chi2_target changes by 3 %: quote the range."),
        ));
    }
    if let Some(held) = robustness.held_out().filter(|held| height > level && held.delta_ln_p < 0.0) {
        remarks.push(Remark::against(
            "held-out nights not predicted better",
            format!(
                "The planet does not improve the prediction of held-out nights: Δln p = {:.1} ± {:.1} ({} nights).",
                held.delta_ln_p, held.sigma_delta_ln_p, held.nights
            ),
        ));
    }
    let [moving, losing] = robustness.decisive_nights(level);
    remarks.extend(decided(&moving));
    remarks.extend(match losing.len() > NIGHTS_NAMED {
        true => marginal(robustness, &losing, level),
        false => decided(&losing),
    });
    remarks
}

/// That a signal is not significant without whichever of many nights, though its K stays.
fn marginal(robustness: &Robustness, nights: &[&WithoutNight], level: f64) -> Option<Remark> {
    let orbits = || robustness.nights.iter().filter_map(|night| night.orbit);
    let lowest = nights.iter().filter_map(|night| night.orbit).map(|orbit| orbit.delta_ln_l).reduce(f64::min)?;
    let [low, high] = [f64::min, f64::max].map(|which| orbits().map(|orbit| orbit.k_kms).reduce(which));
    let (low, high) = low.zip(high)?;
    let unit = Speeds::of(&[low, high]);
    Some(Remark::against(
        "FAP > 1 % without single nights",
        format!(
            "Leaving out any one of {} nights lowers Δln L below the 1 % threshold, {level:.1} (lowest: {lowest:.1}); \
            K stays {} to {} {}: more nights are needed.",
            nights.len(),
            unit.cell(Some(low)),
            unit.cell(Some(high)),
            unit.name
        ),
    ))
}

/// That a signal is not significant beside such offsets.
pub fn of_night_offsets(NightOffsets { sigma_kms, false_alarm_probability, .. }: NightOffsets) -> Option<Remark> {
    (false_alarm_probability > CANDIDATE_FAP).then(|| {
        Remark::against(
            "not significant beside RV offsets of nights",
            format!(
                "Beside RV offsets of {:.0} m/s from night to night the signal is not significant: FAP = {:.1} %. If \
                the spectrograph's are known, set observations.night_jitter_kms.",
                1000.0 * sigma_kms,
                100.0 * false_alarm_probability
            ),
        )
    })
}

/// That a signal depends on each of these nights.
fn decided(nights: &[&WithoutNight]) -> Option<Remark> {
    let name = |night: &&WithoutNight| {
        let profiles = if night.profiles == 1 { "profile" } else { "profiles" };
        format!("{:.2} ({} {profiles})", night.span_d.0, night.profiles)
    };
    let named: Vec<String> = nights.iter().take(NIGHTS_NAMED).map(name).collect();
    let (short, which) = match nights.len() {
        0 => return None,
        1 => ("driven by a single night", format!("the night of {}", named[0])),
        all if all > NIGHTS_NAMED => ("driven by single nights", format!("each of {all} nights")),
        _ => ("driven by single nights", format!("each of the nights of {}", named.join(", "))),
    };
    Some(Remark::against(short, format!("The signal depends on {which}: see the leave-one-night-out K.")))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::planets::periodogram::CircularOrbit;

    /// A robustness whose nights have these K and heights; that of all is 0.1 ± 0.02 km/s, 12.
    fn robustness(nights: &[(f64, f64)]) -> Robustness {
        let orbit = |(k_kms, delta_ln_l): (f64, f64)| {
            Some(CircularOrbit { k_kms, sigma_k_kms: 0.021, phi: 0.0, sigma_phi: 0.1, delta_ln_l })
        };
        let night = |(k, of): (usize, &(f64, f64))| WithoutNight {
            span_d: (k as f64, k as f64 + 0.2),
            profiles: 2,
            orbit: orbit(*of),
            delta_ln_p: Some(1.0),
        };
        let all = orbit((0.1, 12.0)).map(|all| CircularOrbit { sigma_k_kms: 0.02, ..all });
        Robustness { all, targets: Vec::new(), nights: nights.iter().enumerate().map(night).collect() }
    }

    #[test]
    fn nights_that_a_signal_needs_are_named_or_counted() {
        let short = |nights: &[(f64, f64)]| {
            let remarks = of_choices(Some(&robustness(nights)), 12.0, 10.0);
            remarks.into_iter().map(|remark| (remark.against.unwrap(), remark.text)).collect::<Vec<_>>()
        };
        let (steady, losing, moving) = ((0.1, 11.0), (0.098, 8.5), (0.2, 11.0));
        assert!(short(&[steady; 6]).is_empty());
        let one = short(&[steady, losing, steady]);
        assert_eq!(one[0].0, "driven by a single night");
        assert_eq!(short(&[losing, losing, losing, steady])[0].0, "driven by single nights");
        let many = short(&[losing, losing, losing, losing, steady]);
        assert_eq!(many.len(), 1);
        assert_eq!(many[0].0, "FAP > 1 % without single nights");
        assert!(many[0].1.contains("any one of 4 nights") && many[0].1.contains("98 to 100 m/s"), "{}", many[0].1);
        let both = short(&[moving, losing, losing, losing, losing]);
        assert_eq!((both.len(), both[0].0.as_str()), (2, "driven by a single night"));
    }
}
