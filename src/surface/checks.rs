//! Whether the residuals of a map look like noise: posterior predictive checks, with data replicated from the model
//! with noise of the given uncertainties.
//!
//! The total chi2 is not informative, because it is the requested target. Its distribution is: among the profiles,
//! between the core of the line and the rest, and in the correlation of neighbouring bins. In replicated data every
//! profile of a data set has the same chi2 per datum, within the scatter of a chi2 distribution, and neighbours are
//! independent; noise that is correlated over several bins counts as correspondingly fewer bins. The degrees of freedom
//! of the map are spread evenly here.

use crate::numerics::json::number_or_null;
use crate::numerics::normal::cumulative;
use serde::{Deserialize, Serialize};
use std::ops::Range;

/// A profile is reported when chance makes one this bad among all of them as rarely as this.
const RARE: f64 = 0.01;

/// Neighbouring bins, and core against wings, are reported beyond that many standard deviations.
const FAR: f64 = 5.0;

/// Largest number of profiles that are listed one by one.
const NAMED: usize = 5;

/// The residual of one bin.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Residual {
    /// Depth of the model.
    pub depth: f64,
    /// Observed minus modelled intensity.
    pub difference: f64,
    /// The same over its standard error.
    pub scaled: f64,
}

/// The distribution of the misfit.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Checks {
    /// Profile by profile.
    pub profiles: Vec<ProfileCheck>,
    /// chi2 per datum in the core of the line: where the model is deeper than half its greatest depth.
    #[serde(deserialize_with = "number_or_null")]
    pub chi2_per_datum_core: f64,
    /// chi2 per datum outside of the core.
    #[serde(deserialize_with = "number_or_null")]
    pub chi2_per_datum_outside: f64,
    /// Significance of their difference in standard deviations of replicated data.
    #[serde(deserialize_with = "number_or_null")]
    pub core_excess_sigma: f64,
    /// Correlation of the residuals of neighbouring bins.
    #[serde(deserialize_with = "number_or_null")]
    pub neighbour_correlation: f64,
    /// Its standard deviation in replicated data.
    #[serde(deserialize_with = "number_or_null")]
    pub sigma_neighbour_correlation: f64,
    /// Deviations from noise.
    pub warnings: Vec<String>,
}

/// The misfit of one profile.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ProfileCheck {
    /// Time (d).
    pub time_d: f64,
    /// chi2.
    pub chi2: f64,
    /// Number of bins.
    pub data: usize,
    /// Probability that replicated data have a larger fraction of chi2 in this profile.
    #[serde(deserialize_with = "number_or_null")]
    pub p_value: f64,
}

impl Checks {
    /// Checks of the `residuals` of every profile at its time, with noise correlated over so many bins, which count as
    /// one. Profiles are compared with those of the same set of `sets`.
    pub(super) fn of(profiles: &[(f64, Vec<Residual>)], sets: &[Range<usize>], correlated_bins: f64) -> Self {
        Checks::with(profiles, sets, correlated_bins, false)
    }

    /// The same for maps, one per profile, that absorb much of the noise in the core of the line: their residuals are
    /// smaller there, and neighbours have opposite signs. Only the reverse is reported.
    pub(super) fn of_flexible(profiles: &[(f64, Vec<Residual>)], sets: &[Range<usize>], correlated_bins: f64) -> Self {
        Checks::with(profiles, sets, correlated_bins, true)
    }

    fn with(profiles: &[(f64, Vec<Residual>)], sets: &[Range<usize>], correlated_bins: f64, flexible: bool) -> Self {
        fn in_all(profiles: &[(f64, Vec<Residual>)]) -> impl Iterator<Item = &Residual> {
            profiles.iter().flat_map(|(_, residuals)| residuals)
        }
        let all = || in_all(profiles);
        let of = |profiles| mean(in_all(profiles).map(|r| r.scaled * r.scaled));
        let per_datum = of(profiles);
        let in_set: Vec<f64> =
            sets.iter().flat_map(|set| std::iter::repeat_n(of(&profiles[set.clone()]), set.len())).collect();
        let profile = |((time_d, residuals), per_datum): (&(f64, Vec<Residual>), f64)| {
            let chi2: f64 = residuals.iter().map(|r| r.scaled * r.scaled).sum();
            let data = residuals.len();
            ProfileCheck {
                time_d: *time_d,
                chi2,
                data,
                p_value: chi2_exceeds(chi2 / per_datum / correlated_bins, data as f64 / correlated_bins),
            }
        };
        let deepest = all().map(|r| r.depth).fold(0.0, f64::max);
        let share = |core: bool| {
            let part = || all().filter(move |r| (r.depth > 0.5 * deepest) == core);
            (mean(part().map(|r| r.scaled * r.scaled)), part().count() as f64 / correlated_bins)
        };
        let ((core, inside), (outside, beyond)) = (share(true), share(false));
        let pairs = || profiles.iter().flat_map(|(_, residuals)| residuals.windows(2));
        let mut checks = Checks {
            profiles: profiles.iter().zip(in_set).map(profile).collect(),
            chi2_per_datum_core: core,
            chi2_per_datum_outside: outside,
            core_excess_sigma: (core - outside) / (per_datum * (2.0 / inside + 2.0 / beyond).sqrt()),
            neighbour_correlation: mean(pairs().map(|pair| pair[0].scaled * pair[1].scaled)) / per_datum,
            sigma_neighbour_correlation: (pairs().count() as f64).sqrt().recip(),
            warnings: Vec::new(),
        };
        checks.warnings = checks.doubts(correlated_bins > 1.0, flexible);
        checks
    }

    fn doubts(&self, neighbours_go_together: bool, flexible: bool) -> Vec<String> {
        let size = |x: f64| if flexible { x } else { x.abs() };
        let mut doubts = Vec::new();
        doubts.extend(self.of_profiles());
        if size(self.core_excess_sigma) > FAR {
            doubts.push(format!(
                "χ²/N = {:.2} in the line core, {:.2} outside: check star.line, the uncertainties and the continuum",
                self.chi2_per_datum_core, self.chi2_per_datum_outside
            ));
        }
        let correlated = size(self.neighbour_correlation) > FAR * self.sigma_neighbour_correlation;
        if correlated && !neighbours_go_together {
            doubts.push(format!(
                "residuals of neighbouring bins correlate by {:.2}: not white noise",
                self.neighbour_correlation
            ));
        }
        doubts
    }

    /// Profiles that fit worse than the others: each, or for more than [`NAMED`] their number and the worst.
    fn of_profiles(&self) -> Vec<String> {
        let rare = RARE / self.profiles.len() as f64;
        let numbered = self.profiles.iter().enumerate();
        let mut worse: Vec<(usize, &ProfileCheck)> = numbered.filter(|(_, profile)| profile.p_value < rare).collect();
        let of = |(k, profile): &(usize, &ProfileCheck)| {
            let (chi2, chance) = (profile.chi2 / profile.data as f64, 1.0 / profile.p_value.max(1e-300));
            let profile = format!("profile {} ({:.4} d)", k + 1, profile.time_d);
            (profile, format!("chi2 {chi2:.2} per datum, by chance once in {chance:.0e}"))
        };
        if worse.len() <= NAMED {
            let one = |(profile, size): (String, String)| format!("{profile} fits worse than the others: {size}");
            return worse.iter().map(of).map(one).collect();
        }
        let many = worse.len();
        // probabilities of the worst may be 0
        let excess = |profile: &ProfileCheck| profile.chi2 / profile.data as f64;
        worse.sort_by(|(_, a), (_, b)| a.p_value.total_cmp(&b.p_value).then(excess(b).total_cmp(&excess(a))));
        let (profile, size) = of(&worse[0]);
        vec![format!("{many} profiles fit worse than the others (all in fit.json of a map), worst {profile}: {size}")]
    }
}

/// Mean of some values; NaN for none.
fn mean(x: impl Iterator<Item = f64>) -> f64 {
    let (n, sum) = x.fold((0.0, 0.0), |(n, sum), x| (n + 1.0, sum + x));
    sum / n
}

/// Probability that a chi2 with that many degrees of freedom is larger: its cube root is nearly normal (Wilson &
/// Hilferty 1931).
pub(super) fn chi2_exceeds(chi2: f64, freedom: f64) -> f64 {
    let spread = 2.0 / (9.0 * freedom);
    cumulative((1.0 - spread - (chi2 / freedom).cbrt()) / spread.sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{Rng, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use rand_distr::StandardNormal;

    /// Table values of the chi2 distribution.
    #[test]
    fn known_quantiles() {
        for (chi2, freedom, p) in
            [(18.307, 10.0, 0.05), (43.773, 30.0, 0.05), (50.892, 30.0, 0.01), (124.342, 100.0, 0.05)]
        {
            assert!((chi2_exceeds(chi2, freedom) / p - 1.0_f64).abs() < 0.01, "{chi2} {freedom}");
        }
    }

    fn one_set() -> Vec<Range<usize>> {
        std::iter::once(0..40).collect()
    }

    fn noise(change: impl Fn(usize, usize, f64) -> f64) -> Checks {
        noise_of(&one_set(), change)
    }

    fn noise_of(sets: &[Range<usize>], change: impl Fn(usize, usize, f64) -> f64) -> Checks {
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        let mut profile = |k: usize| {
            let residual = |j: usize, noise: f64| {
                let depth = if (20..40).contains(&j) { 0.3 } else { 0.01 };
                Residual { depth, difference: 0.0, scaled: change(k, j, noise) }
            };
            let residuals = (0..60).map(|j| residual(j, rng.sample(StandardNormal))).collect();
            (k as f64, residuals)
        };
        Checks::of(&(0..40).map(&mut profile).collect::<Vec<_>>(), sets, 1.0)
    }

    #[test]
    fn what_flexible_maps_take_up_is_no_misfit() {
        let residual = |j: usize, scaled: f64| Residual {
            depth: if (20..40).contains(&j) { 0.3 } else { 0.01 },
            difference: 0.0,
            scaled,
        };
        let profiles = |scaled: fn(usize) -> f64| -> Vec<(f64, Vec<Residual>)> {
            (0..40).map(|k| (f64::from(k), (0..60).map(|j| residual(j, scaled(j))).collect())).collect()
        };
        let taken_up = profiles(|j| (-1.0_f64).powi(j as i32) * if (20..40).contains(&j) { 0.5 } else { 1.0 });
        assert_eq!(Checks::of(&taken_up, &one_set(), 1.0).warnings.len(), 2);
        assert!(Checks::of_flexible(&taken_up, &one_set(), 1.0).warnings.is_empty());
        let left_over = profiles(|j| if (20..40).contains(&j) { 2.0 } else { 1.0 });
        assert_eq!(Checks::of_flexible(&left_over, &one_set(), 1.0).warnings.len(), 2);
    }

    #[test]
    fn noise_passes_and_what_is_wrong_is_named() {
        let fair = noise(|_, _, noise| 0.8 * noise);
        assert!(fair.warnings.is_empty(), "{:?}", fair.warnings);
        // p-values of noise are uniform: their mean is 1/2, with an error of 0.29 / sqrt(40)
        let p = mean(fair.profiles.iter().map(|profile| profile.p_value));
        assert!((p - 0.5).abs() < 0.15, "{p}");
        let one = noise(|k, _, noise| if k == 7 { 2.0 * noise } else { noise });
        assert!(one.warnings.len() == 1 && one.warnings[0].starts_with("profile 8 (7.0000 d)"), "{:?}", one.warnings);
        let core = noise(|_, j, noise| if (20..40).contains(&j) { 1.5 * noise } else { noise });
        assert!(core.warnings.iter().any(|w| w.contains("line core")), "{:?}", core.warnings);
        let wave = noise(|_, j, noise| noise + (0.5 * j as f64).sin());
        assert!(wave.warnings.iter().any(|w| w.contains("neighbouring bins")), "{:?}", wave.warnings);
    }

    /// Too large uncertainties of one set make no profile of another look bad.
    #[test]
    fn sets_are_held_against_themselves() {
        let errors = |k: usize, _: usize, noise: f64| if k < 30 { 0.6 * noise } else { noise };
        let pooled = noise(errors);
        // many are one warning
        let [many] = &pooled.warnings[..] else { panic!("{:?}", pooled.warnings) };
        assert!(many.contains(" profiles fit worse than the others") && many.contains("worst profile "), "{many}");
        let apart = noise_of(&[0..30, 30..40], errors);
        assert!(apart.warnings.is_empty(), "{:?}", apart.warnings);
    }
}
