//! False-alarm probability: by simulated stars without a planet, and beyond their reach by extreme-value theory.
//!
//! The number of peaks above z of a sine fit is Poisson with mean `tau(z) = W sqrt(z) exp(-z)`, hence `FAP = 1 -
//! exp(-tau)` (Baluev 2008, MNRAS 385, 1279, eq. 6, for two linear parameters and known variances). W comes from the
//! upper tail of the draws by maximum likelihood, draws below the tail entering as censored. Where a jitter of unknown
//! size is fitted with the orbit, high peaks are more frequent, as in the F-test, or less, where a jitter that chance
//! mimics takes a part of them: z is multiplied by a rate, which is fitted along with W.

use super::draws::maxima;
use super::jitter::Jitters;

/// The tail to which W is fitted: this fraction of the draws.
const TAIL: f64 = 0.1;

/// With fewer draws than this above a peak, the extreme-value form is used.
const ENOUGH: usize = 30;

/// The distribution of the highest Delta ln L without a planet.
#[derive(Clone, Debug, PartialEq)]
pub struct FalseAlarm {
    /// The highest Delta ln L of each draw, from low to high.
    pub maxima: Vec<f64>,
    /// The form of the tail.
    pub tail: Tail,
    /// Standard deviation of the nightly RV offsets of these stars (km/s).
    pub night_kms: f64,
}

/// `1 - exp(-tau)`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tail {
    /// Number of independent frequencies of the search, up to a factor of order 1.
    pub w: f64,
    /// The rate: 1 for known noise.
    pub rate: f64,
}

/// A false-alarm probability by both methods.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Probability {
    /// `(1 + draws as high) / (1 + draws)`.
    pub by_draws: f64,
    /// By the extreme-value form.
    pub by_tail: f64,
    /// Whether enough draws are as high to use the first.
    pub draws_suffice: bool,
}

impl Tail {
    /// Fits W to the upper tail of `maxima`, sorted from low to high.
    fn fit(maxima: &[f64], rate: f64) -> Self {
        let unit = Tail { w: 1.0, rate };
        let below = maxima.len() - (TAIL * maxima.len() as f64).ceil() as usize;
        let above: f64 = maxima[below..].iter().map(|z| unit.peaks(*z)).sum();
        let w = (maxima.len() - below) as f64 / (above + below as f64 * unit.peaks(maxima[below]));
        Tail { w, rate }
    }

    /// The same with the maximum-likelihood rate.
    fn fit_with_rate(maxima: &[f64]) -> Self {
        const RATES: usize = 190;
        let all = (0..=RATES).map(|k| Tail::fit(maxima, 0.1 + 0.01 * k as f64));
        all.max_by(|a, b| a.log_likelihood(maxima).total_cmp(&b.log_likelihood(maxima))).expect("rates")
    }

    /// ln of the density of the draws in the tail, those below it censored: sum of `ln(-d tau / dz) - tau`.
    fn log_likelihood(&self, maxima: &[f64]) -> f64 {
        let below = maxima.len() - (TAIL * maxima.len() as f64).ceil() as usize;
        let of = |z: &f64| {
            let scaled = (self.rate * z).max(0.5);
            let slope = self.rate * (1.0 - 0.5 / scaled).max(1e-12);
            (self.peaks(*z) * slope).ln() - self.peaks(*z)
        };
        maxima[below..].iter().map(of).sum::<f64>() - below as f64 * self.peaks(maxima[below])
    }

    /// tau: mean number of peaks above `delta_ln_l`; it falls beyond 1/2.
    fn peaks(&self, delta_ln_l: f64) -> f64 {
        let z = (self.rate * delta_ln_l).max(0.5);
        self.w * z.sqrt() * (-z).exp()
    }

    /// Probability of a peak of at least `delta_ln_l`; valid where it is small.
    pub fn probability(&self, delta_ln_l: f64) -> f64 {
        -(-self.peaks(delta_ln_l)).exp_m1()
    }

    /// The height that is exceeded with probability `p`.
    fn level(&self, p: f64) -> f64 {
        let mut hi = 1.0;
        while self.probability(hi) > p {
            hi *= 2.0;
        }
        let mut lo = 0.0;
        while hi - lo > 1e-9 * hi {
            let middle = 0.5 * (lo + hi);
            if self.probability(middle) > p { lo = middle } else { hi = middle }
        }
        0.5 * (lo + hi)
    }
}

impl Probability {
    /// The one to use.
    pub fn value(&self) -> f64 {
        if self.draws_suffice { self.by_draws } else { self.by_tail }
    }
}

impl FalseAlarm {
    /// The distribution from `draws` gradients without a planet, for a search at these frequencies.
    pub fn draw(jitters: &Jitters, frequencies: &[f64], draws: usize, seed: u64) -> Self {
        let mut maxima = maxima(jitters, frequencies, draws, seed);
        maxima.sort_by(f64::total_cmp);
        let tail = if jitters.is_none() { Tail::fit(&maxima, 1.0) } else { Tail::fit_with_rate(&maxima) };
        FalseAlarm { maxima, tail, night_kms: jitters.null.map_or(0.0, |null| null.night_kms) }
    }

    /// Probability that a star without a planet shows a peak of at least `z`.
    pub fn probability(&self, z: f64) -> Probability {
        let n = self.maxima.len();
        let above = n - self.maxima.partition_point(|m| *m < z);
        Probability {
            by_draws: (1 + above) as f64 / (1 + n) as f64,
            by_tail: self.tail.probability(z),
            draws_suffice: above >= ENOUGH,
        }
    }

    /// The Delta ln L that such a star exceeds with probability `p`.
    pub fn level(&self, p: f64) -> f64 {
        let n = self.maxima.len();
        let above = (p * (n + 1) as f64).floor() as usize;
        if above > ENOUGH { self.maxima[n - above.min(n)] } else { self.tail.level(p) }
    }

    /// How many independent periods would exceed the 1 % level as often as the search does.
    pub fn independent_periods(&self) -> f64 {
        let p: f64 = 0.01;
        (-p).ln_1p() / (-(-self.level(p)).exp()).ln_1p()
    }
}

#[cfg(test)]
mod tests {
    use super::super::frequencies::{Frequencies, FrequencySettings};
    use super::super::orbits::scan;
    use super::super::sample::{self, STABILITY_KMS, uneven};
    use super::*;
    use crate::planets::velocities::VelocityQuadratic;
    use nalgebra::DVector;

    fn star() -> (VelocityQuadratic, Vec<f64>) {
        let cycles = uneven(30, 3.0);
        let quadratic = sample::correlated(&cycles, &DVector::zeros(30), 5);
        let frequencies = Frequencies::new(&cycles, 1.0, FrequencySettings::default()).unwrap();
        (quadratic, frequencies.per_cycle)
    }

    /// Kolmogorov-Smirnov: independently drawn gradients of the null model have uniform false-alarm probabilities.
    #[test]
    fn the_probability_is_uniform_under_its_own_null() {
        let (quadratic, frequencies) = star();
        let alarm = FalseAlarm::draw(&Jitters::none(&quadratic), &frequencies, 10_000, 1);
        let factor = quadratic.information.clone().cholesky().unwrap().unpack();
        let n = 1000;
        let mut found: Vec<f64> = (0..n)
            .map(|k| {
                let star = VelocityQuadratic { gradient: &factor * sample::normal(30, 1000 + k), ..quadratic.clone() };
                let heights = scan(&star, &frequencies).into_iter().filter_map(|t| t.orbit);
                alarm.probability(heights.map(|o| o.delta_ln_l).fold(0.0, f64::max)).by_draws
            })
            .collect();
        found.sort_by(f64::total_cmp);
        let apart = |(k, p): (usize, &f64)| (p - (k as f64 + 0.5) / n as f64).abs();
        let distance = found.iter().enumerate().map(apart).fold(0.0, f64::max);
        // exceeded once in a thousand by chance: 1.95 / sqrt(n), with both samples counted
        assert!(distance < 1.95 * (1.0 / n as f64 + 1e-4_f64).sqrt(), "{distance}");
    }

    #[test]
    fn the_tail_agrees_with_the_draws() {
        let (quadratic, frequencies) = star();
        let jitters = Jitters::none(&quadratic);
        let few = FalseAlarm::draw(&jitters, &frequencies, 10_000, 1);
        let many = FalseAlarm::draw(&jitters, &frequencies, 200_000, 2);
        for p in [0.05, 0.01, 1e-3] {
            let z = many.level(p);
            let found = few.tail.probability(z);
            // the form is an upper bound in theory; W of a thousand draws in the tail is accurate to 3 %
            assert!((found / p).ln().abs() < 0.3, "{found} for {p} at {z}");
            assert!((few.probability(few.level(p)).value() / p).ln().abs() < 0.1);
        }
        assert!(few.level(0.1) < few.level(0.01) && few.level(0.01) < few.level(0.001));
    }

    #[test]
    fn draws_do_not_depend_on_threads() {
        let (quadratic, frequencies) = star();
        for jitters in [Jitters::none(&quadratic), Jitters::new(&quadratic, 0.1, STABILITY_KMS)] {
            let draw = |threads| {
                let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
                pool.install(|| FalseAlarm::draw(&jitters, &frequencies, 1001, 3))
            };
            assert_eq!(draw(1), draw(3));
        }
    }
}
