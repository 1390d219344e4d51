//! The rate of planets in a sample of stars, each searched with a completeness that was measured by injections.
//!
//! A star has at most one planet in a box of period and semi-amplitude (or minimum mass), with the probability f. The
//! search recovers it with the probability c, the mean completeness over the box. Where no planet is recovered, the
//! highest peak is a false alarm in the box with the probability `alpha`. With q = f c the likelihood of a star is
//!
//! - without a signal in the box: `(1 - q) (1 - alpha)`;
//! - with one of false-alarm probability p: `q g + (1 - q) alpha h`, where g and h are the densities of Delta ln L
//!   above its threshold: `h = p / p_threshold` by definition, and `g = 1 / (2 Delta ln L c ln(K2/K1))` for planets
//!   evenly in ln K, whose Delta ln L grows with K^2.
//!
//! Factors without f are left out. The log-likelihood is a sum of logarithms of linear functions of f, hence concave,
//! and regions of highest likelihood are intervals. Left out: several planets around one star, planets found at an
//! alias of their period, and spurious peaks that are not due to chance (the search flags those of rotation).

use serde::{Deserialize, Serialize};

/// Fraction of the injected planets that a search recovers, by period and semi-amplitude.
#[derive(Clone, Debug, PartialEq)]
pub struct Completeness {
    ln_periods: Vec<f64>,
    ln_k: Vec<f64>,
    /// Period after period, with K rising.
    recovered: Vec<f64>,
}

impl Completeness {
    /// Completeness from fractions `recovered` at rising `periods_d` and `k_kms`, period after period. `None` unless
    /// there are at least two of each, positive and rising, with one fraction between 0 and 1 for each pair.
    pub fn new(periods_d: &[f64], k_kms: &[f64], recovered: Vec<f64>) -> Option<Self> {
        let rises = |x: &[f64]| {
            x.len() > 1 && x[0] > 0.0 && x.windows(2).all(|two| two[0] < two[1]) && x[x.len() - 1].is_finite()
        };
        let is_whole = recovered.len() == periods_d.len() * k_kms.len();
        let are_fractions = recovered.iter().all(|fraction| (0.0..=1.0).contains(fraction));
        let logarithms = |x: &[f64]| x.iter().map(|x| x.ln()).collect();
        (rises(periods_d) && rises(k_kms) && is_whole && are_fractions).then(|| Completeness {
            ln_periods: logarithms(periods_d),
            ln_k: logarithms(k_kms),
            recovered,
        })
    }

    /// At a period and semi-amplitude, between those injected linear in their logarithms: 0 at other periods than were
    /// searched and below the smallest K injected; above the largest K that of the largest.
    pub fn at(&self, period_d: f64, k_kms: f64) -> f64 {
        let (x, y) = (period_d.ln(), k_kms.ln());
        // a period from a file is that of the search to its last digits only
        const EDGE: f64 = 1e-9;
        let [first, last] = [self.ln_periods[0], self.ln_periods[self.ln_periods.len() - 1]];
        if !(first - EDGE..=last + EDGE).contains(&x) || y < self.ln_k[0] {
            return 0.0;
        }
        let ((i, u), (j, v)) = (between(&self.ln_periods, x), between(&self.ln_k, y));
        let of = |i: usize, j: usize| self.recovered[i * self.ln_k.len() + j];
        let along = |i: usize| of(i, j) + v * (of(i, j + 1) - of(i, j));
        along(i) + u * (along(i + 1) - along(i))
    }

    /// Mean of the fractions at the smallest K: above 0 what lies below is underestimated.
    pub fn at_smallest_k(&self) -> f64 {
        self.recovered.iter().step_by(self.ln_k.len()).sum::<f64>() / self.ln_periods.len() as f64
    }

    /// Mean over a box, planets evenly in the logarithms of period and size; `k_kms` of a period (d) and size.
    pub fn mean(&self, planets: &Span, k_kms: impl Fn(f64, f64) -> f64) -> f64 {
        const STEPS: usize = 100;
        let along = |range: [f64; 2]| (0..STEPS).map(move |k| even(range, (k as f64 + 0.5) / STEPS as f64));
        let at = |period: f64| along(planets.sizes).map(|size| self.at(period, k_kms(period, size))).sum::<f64>();
        along(planets.periods_d).map(at).sum::<f64>() / (STEPS * STEPS) as f64
    }
}

/// The interval of `rising` that `x` is in, or the nearest, and how far along it `x` is, from 0 to 1.
fn between(rising: &[f64], x: f64) -> (usize, f64) {
    let above = rising.partition_point(|one| *one <= x).clamp(1, rising.len() - 1);
    let (low, high) = (rising[above - 1], rising[above]);
    (above - 1, ((x - low) / (high - low)).clamp(0.0, 1.0))
}

/// The value at a share of the way through a range, evenly in the logarithm.
fn even([low, high]: [f64; 2], share: f64) -> f64 {
    low * (high / low).powf(share)
}

/// Ranges of period (d) and of size: semi-amplitude or minimum mass.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Span {
    /// Shortest and longest period (d).
    pub periods_d: [f64; 2],
    /// Smallest and largest size.
    pub sizes: [f64; 2],
}

/// Fraction of the spurious peaks of a search that fall in a box: uniform in frequency over the `searched` periods (d),
/// with the smallest detectable K (km/s) at their period, `None` where there is none.
pub fn share_of_false_alarms(
    planets: &Span,
    searched: [f64; 2],
    just_detected: impl Fn(f64) -> Option<f64>,
    k_kms: impl Fn(f64, f64) -> f64,
) -> f64 {
    const STEPS: usize = 1000;
    let [low, high] = [1.0 / searched[1], 1.0 / searched[0]];
    let is_in = |k: &usize| {
        let period = 1.0 / (low + (high - low) * (*k as f64 + 0.5) / STEPS as f64);
        let [shortest, longest] = planets.periods_d;
        let is_of = |k: f64| (k_kms(period, planets.sizes[0])..=k_kms(period, planets.sizes[1])).contains(&k);
        (shortest..=longest).contains(&period) && just_detected(period).is_some_and(is_of)
    };
    (0..STEPS).filter(is_in).count() as f64 / STEPS as f64
}

/// What is assumed of a rate before the sample is seen.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum RatePrior {
    /// Every rate from 0 to 1 alike.
    #[default]
    Uniform,
    /// Beta(1/2, 1/2), by the Fisher information of a binomial.
    Jeffreys,
}

/// A star of a sample, as far as one box is concerned.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Member {
    /// Mean completeness over the box.
    pub completeness: f64,
    /// Probability that a star without a planet shows one in the box.
    pub false_alarm: f64,
    /// What the search found in the box.
    pub signal: Option<InBox>,
}

/// A signal in a box.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct InBox {
    /// Probability that it is a planet's, if not chance, and that its period and size are in the box.
    pub share: f64,
    /// Density of spurious peaks over that of detected planets, `alpha h / g`.
    pub chance: f64,
}

impl InBox {
    /// Of a signal with a false-alarm probability, in a search where `threshold` is that of Delta ln L = `level`;
    /// `sizes` are those of the box.
    pub fn new(share: f64, probability: f64, (threshold, level): (f64, f64), of: &Member, sizes: [f64; 2]) -> Self {
        // the chance of peaks falls with exp(-Delta ln L)
        let beyond = (threshold / probability.max(1e-300)).ln().max(0.0);
        let planets = 1.0 / (2.0 * (level + beyond) * of.completeness * (sizes[1] / sizes[0]).ln());
        InBox { share, chance: of.false_alarm * (-beyond).exp() / planets }
    }
}

impl Member {
    /// Log-likelihood of a rate, but for what does not depend on it.
    fn ln_likelihood(&self, rate: f64) -> f64 {
        let q = rate * self.completeness;
        if self.completeness <= 0.0 {
            return 0.0;
        }
        let without = (-q).ln_1p();
        match self.signal {
            None => without,
            // a share of 1/2 counts as half a signal in the box, and half a star without one
            Some(InBox { share, chance }) => {
                let part = |share: f64, ln: f64| if share > 0.0 { share * ln } else { 0.0 };
                part(share, (q + (1.0 - q) * chance).ln()) + part(1.0 - share, without)
            }
        }
    }

    /// Probability that its signal is a planet, of a rate.
    fn reliability(&self, rate: f64) -> f64 {
        let q = rate * self.completeness;
        self.signal.map_or(0.0, |signal| match q + (1.0 - q) * signal.chance {
            whole if whole > 0.0 => q / whole,
            _ => 0.0,
        })
    }
}

/// Nodes of a posterior, evenly in `asin sqrt f`.
const NODES: usize = 4001;

/// The posterior of a rate.
#[derive(Clone, Debug, PartialEq)]
pub struct RatePosterior {
    /// Rates, from 0 to 1.
    rates: Vec<f64>,
    /// Log-likelihood at them, 0 at its highest.
    ln_likelihood: Vec<f64>,
    /// Posterior mass of them; sums to 1.
    mass: Vec<f64>,
}

impl RatePosterior {
    /// Of the rate of planets among some stars.
    pub fn of(members: &[Member], prior: RatePrior) -> Self {
        let step = std::f64::consts::FRAC_PI_2 / (NODES - 1) as f64;
        let rates: Vec<f64> = (0..NODES).map(|k| (step * k as f64).sin().powi(2)).collect();
        let ln = |rate: &f64| members.iter().map(|member| member.ln_likelihood(*rate)).sum::<f64>();
        let mut ln_likelihood: Vec<f64> = rates.iter().map(ln).collect();
        let highest = ln_likelihood.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        ln_likelihood.iter_mut().for_each(|ln| *ln -= highest);
        // df = sin(2 theta) d theta; Jeffreys' prior is flat in theta
        let weight = |k: usize| {
            let end = if k == 0 || k == NODES - 1 { 0.5 } else { 1.0 };
            match prior {
                RatePrior::Uniform => end * (2.0 * step * k as f64).sin(),
                RatePrior::Jeffreys => end,
            }
        };
        let mut mass: Vec<f64> = (0..NODES).map(|k| weight(k) * ln_likelihood[k].exp()).collect();
        let total: f64 = mass.iter().sum();
        mass.iter_mut().for_each(|mass| *mass /= total);
        RatePosterior { rates, ln_likelihood, mass }
    }

    /// The rate of highest likelihood.
    pub fn most_likely(&self) -> f64 {
        self.rates[self.highest()]
    }

    fn highest(&self) -> usize {
        (0..NODES).max_by(|a, b| self.ln_likelihood[*a].total_cmp(&self.ln_likelihood[*b])).unwrap_or(0)
    }

    /// Mean of the posterior.
    pub fn mean(&self) -> f64 {
        self.rates.iter().zip(&self.mass).map(|(rate, mass)| rate * mass).sum()
    }

    /// The rate below which there is so much of the posterior.
    pub fn quantile(&self, share: f64) -> f64 {
        let mut below = 0.0;
        for k in 1..NODES {
            // half of a node's mass is on either side of it
            let next = below + 0.5 * (self.mass[k - 1] + self.mass[k]);
            if next >= share {
                let along = ((share - below) / (next - below)).clamp(0.0, 1.0);
                return self.rates[k - 1] + along * (self.rates[k] - self.rates[k - 1]);
            }
            below = next;
        }
        1.0
    }

    /// The interval of highest likelihood that holds so much of the posterior: it begins at 0 where nothing is found.
    pub fn interval(&self, share: f64) -> [f64; 2] {
        let (mut low, mut high) = (self.highest(), self.highest());
        let mut held = self.mass[low];
        while held < share && (low > 0 || high < NODES - 1) {
            let below = low.checked_sub(1).map_or(f64::NEG_INFINITY, |k| self.ln_likelihood[k]);
            let above = self.ln_likelihood.get(high + 1).copied().unwrap_or(f64::NEG_INFINITY);
            if below > above {
                low -= 1;
                held += self.mass[low];
            } else {
                high += 1;
                held += self.mass[high];
            }
        }
        [self.rates[low], self.rates[high]]
    }

    /// Mean over the posterior of the probability that the signal of a star is a planet.
    pub fn reliability(&self, member: &Member) -> f64 {
        self.rates.iter().zip(&self.mass).map(|(rate, mass)| mass * member.reliability(*rate)).sum()
    }

    /// Rates from 0 to 1, with the density of the posterior: evenly spaced in `asin sqrt f`, the ends left out, where
    /// Jeffreys' prior has none.
    pub fn density(&self, prior: RatePrior) -> (Vec<f64>, Vec<f64>) {
        const EVERY: usize = 10;
        let width = std::f64::consts::FRAC_PI_2 / (NODES - 1) as f64;
        let at = |k: usize| {
            let by_theta = self.mass[k] / width;
            by_theta / (2.0 * (self.rates[k] * (1.0 - self.rates[k])).sqrt())
        };
        let inner = (EVERY..NODES - 1).step_by(EVERY);
        let first = match prior {
            // the density goes on evenly to a rate of 0
            RatePrior::Uniform => vec![(0.0, at(1))],
            RatePrior::Jeffreys => Vec::new(),
        };
        first.into_iter().chain(inner.map(|k| (self.rates[k], at(k)))).unzip()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn members(stars: usize, found: usize, completeness: f64) -> Vec<Member> {
        let signal = |k: usize| (k < found).then_some(InBox { share: 1.0, chance: 0.0 });
        (0..stars).map(|k| Member { completeness, false_alarm: 0.0, signal: signal(k) }).collect()
    }

    /// No detections and completeness 1: Beta(1, N + 1), whose quantile p is `1 - (1 - p)^(1 / (N + 1))`.
    #[test]
    fn nothing_found_is_a_beta_distribution() {
        for stars in [3, 30, 300] {
            let posterior = RatePosterior::of(&members(stars, 0, 1.0), RatePrior::Uniform);
            let quantile = |p: f64| 1.0 - (1.0 - p).powf(1.0 / (stars as f64 + 1.0));
            for p in [0.16, 0.5, 0.95] {
                assert!((posterior.quantile(p) / quantile(p) - 1.0).abs() < 1e-3, "{stars} {p}");
            }
            assert!((posterior.mean() * (stars as f64 + 2.0) - 1.0).abs() < 1e-4, "{stars}");
            let [low, high] = posterior.interval(0.95);
            assert_eq!((posterior.most_likely(), low), (0.0, 0.0));
            // the interval ends at a node
            assert!((high / quantile(0.95) - 1.0).abs() < 5e-3, "{stars}: {high}");
        }
    }

    /// n of N stars: Beta(n + 1, N - n + 1), or Beta(n + 1/2, N - n + 1/2), whose means are known.
    #[test]
    fn certain_detections_are_a_binomial() {
        for (stars, found) in [(10, 1), (30, 4), (30, 30)] {
            let (n, m) = (found as f64, stars as f64);
            let [uniform, jeffreys] = [RatePrior::Uniform, RatePrior::Jeffreys]
                .map(|prior| RatePosterior::of(&members(stars, found, 1.0), prior));
            assert!((uniform.mean() - (n + 1.0) / (m + 2.0)).abs() < 1e-5, "{stars} {found}");
            assert!((jeffreys.mean() - (n + 0.5) / (m + 1.0)).abs() < 1e-5, "{stars} {found}");
            assert!((uniform.most_likely() - n / m).abs() < 5e-4, "{stars} {found}");
            let (rates, density) = uniform.density(RatePrior::Uniform);
            let area = |k: usize| 0.5 * (rates[k + 1] - rates[k]) * (density[k] + density[k + 1]);
            let whole: f64 = (0..rates.len() - 1).map(area).sum();
            assert!((whole - 1.0).abs() < 0.01, "{stars} {found}: {whole}");
        }
        // half the completeness is twice the rate
        let half = RatePosterior::of(&members(40, 5, 0.5), RatePrior::Uniform);
        assert!((half.most_likely() - 0.25).abs() < 5e-4);
        let [low, high] = half.interval(0.68);
        assert!(0.1 < low && low < 0.25 && 0.25 < high && high < 0.45, "{low} {high}");
    }

    #[test]
    fn a_weak_signal_may_be_chance_and_a_strong_one_is_none() {
        let star = Member { completeness: 0.6, false_alarm: 0.003, signal: None };
        let with = |probability: f64| {
            let signal = InBox::new(1.0, probability, (0.01, 8.0), &star, [0.05, 1.0]);
            let found = Member { signal: Some(signal), ..star };
            let sample: Vec<Member> = std::iter::once(found).chain([star; 29]).collect();
            let posterior = RatePosterior::of(&sample, RatePrior::Uniform);
            (posterior.reliability(&found), posterior.interval(0.95)[0])
        };
        let (weak, strong) = (with(0.009), with(1e-10));
        assert!(weak.0 < 0.7 && weak.1 == 0.0, "{weak:?}");
        assert!(strong.0 > 0.9999 && strong.1 > 0.0, "{strong:?}");
        // nothing is learned where nothing could have been found
        let blind = [Member { completeness: 0.0, ..star }; 5];
        assert!((RatePosterior::of(&blind, RatePrior::Uniform).mean() - 0.5).abs() < 1e-9);
    }

    #[test]
    fn completeness_is_linear_between_injections() {
        let measured = Completeness::new(&[1.0, 100.0], &[0.01, 1.0], vec![0.0, 0.5, 0.5, 1.0]).unwrap();
        assert!((measured.at(10.0, 0.1) - 0.5).abs() < 1e-12 && (measured.at(1.0, 0.1) - 0.25).abs() < 1e-12);
        assert_eq!((measured.at(0.9, 0.1), measured.at(10.0, 0.001), measured.at(1.0, 5.0)), (0.0, 0.0, 0.5));
        let all = Span { periods_d: [1.0, 100.0], sizes: [0.01, 1.0] };
        assert!((measured.mean(&all, |_, k| k) - 0.5).abs() < 1e-9);
        // a quarter of the box in ln K is above the largest K, half of it below the shortest period
        let wide = Span { periods_d: [0.01, 100.0], sizes: [0.01, 1.0] };
        assert!((measured.mean(&wide, |_, k| k) - 0.25).abs() < 1e-9);
        assert!(Completeness::new(&[1.0, 1.0], &[0.01, 1.0], vec![0.0; 4]).is_none());
        assert!(Completeness::new(&[1.0, 2.0], &[0.01, 1.0], vec![0.0, 0.0, 2.0, 0.0]).is_none());
    }

    /// Frequencies from 0.1 to 1 per day, of a search from 0.1 to 2.
    #[test]
    fn false_alarms_are_even_in_frequency() {
        let planets = Span { periods_d: [1.0, 10.0], sizes: [0.05, 1.0] };
        let share = |k: f64| share_of_false_alarms(&planets, [0.5, 10.0], |_| Some(k), |_, k| k);
        assert!((share(0.1) - 0.9 / 1.9).abs() < 2e-3);
        assert_eq!(share(0.01), 0.0);
        assert_eq!(share_of_false_alarms(&planets, [0.5, 10.0], |_| None, |_, k| k), 0.0);
    }
}
