//! Bayes factors of no, one and two planets on circular and Keplerian orbits, and the false inclusion probability over
//! periods (`docs/method.md` section 4).
//!
//! `ln Z` of a model is that of the velocity quadratic, `ln L(V) - ln L(0)`, marginalised over the priors of its orbits
//! and over the RV jitter, which all models share; without a planet it is 0. At each period K and the phase are
//! integrated numerically along rays through K = 0, on which the quadratic is a parabola: so any prior of K is
//! possible. For one circular orbit it is a sum over all periods. Eccentricity and periastron of one Keplerian orbit,
//! and the first of two circular orbits, are importance-sampled from the posterior of one circular orbit, and
//! independent repetitions give the standard error. The second of two circular orbits is integrated like a single one.
//!
//! The false inclusion probability of an interval of frequencies (Hara et al. 2022, A&A 663, A14) is the posterior
//! probability that no planet has its frequency there, with equal prior probabilities of none and one planet.

use super::periodogram::Jitters;
use super::periodogram::orbits::{Trial, mid_cycle, scan};
use super::periodogram::two_planets::without;
use super::velocities::VelocityQuadratic;
use crate::numerics::logarithms::ln_sum;
use crate::numerics::normal::cumulative;
use crate::star::kepler::true_anomaly;
use nalgebra::{DMatrix, Matrix2, Vector2};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::f64::consts::{PI, TAU};

/// ln of a prior's density, between bounds; the density is normalised there.
pub struct Density<'a> {
    /// ln of the density.
    pub ln: &'a (dyn Fn(f64) -> f64 + Sync),
    /// Bounds.
    pub bounds: [f64; 2],
    /// Whether it is uniform between them: its integrals then have a closed form.
    pub uniform: bool,
}

/// Priors of a planet. Phases are uniform.
pub struct PlanetPrior<'a> {
    /// Of K (km/s), 0 or more.
    pub k: Density<'a>,
    /// Of the period over the rotation period, above 0.
    pub period: Density<'a>,
    /// Largest eccentricity: e is uniform up to there.
    pub largest_e: f64,
}

/// ln of a Bayes factor relative to no planet, with the standard deviation of independent repetitions; exact where that
/// is null.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct LnBayes {
    /// ln of the ratio of marginal likelihoods.
    pub ln_bayes: f64,
    /// Standard error from the repetitions; null where no random number enters.
    pub sd: Option<f64>,
}

/// An interval of frequencies, one over the time base wide.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Inclusion {
    /// Its middle, as a period over the rotation period.
    pub porb_over_prot: f64,
    /// Posterior probability that no planet is in it.
    pub false_inclusion_probability: f64,
}

/// The evidence for planets.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Evidence {
    /// Of one planet on a circular orbit.
    pub circle: LnBayes,
    /// Of one planet on a Keplerian orbit.
    pub ellipse: LnBayes,
    /// Of two planets on circular orbits.
    pub two_circles: LnBayes,
    /// The intervals of least false inclusion probability that do not overlap, from low to high.
    pub inclusion: Vec<Inclusion>,
}

/// Frequencies per inverse time base: a peak of 50 in ln L is a tenth of one wide.
const OVERSAMPLING: f64 = 60.0;

/// Most frequencies.
const MOST_FREQUENCIES: usize = 40_000;

/// Draws per repetition: in all, and fewest at one of several jitters in units of these; number of repetitions.
const DRAWS: usize = 4000;
const FEWEST: f64 = 0.1;
const REPETITIONS: usize = 8;

/// Share of the draws of periods that are spread over the prior.
const EVEN: f64 = 0.1;

/// Number of reported intervals of least false inclusion probability.
const TOLD: usize = 5;

/// Marginal likelihoods of the models relative to no planet. Every model, including no planet, is marginalised over the
/// same priors of the RV jitter and of nightly offsets, up to the largest of `jitters`: what these absorb without a
/// planet counts in favour of no planet only. `None` where the velocities do not bound an orbit.
pub fn evidence(jitters: &Jitters, priors: [&PlanetPrior; 2], seed: u64) -> Option<Evidence> {
    let weights = jitters.ln_weights();
    let alone = ln_sum(&weights);
    let quadratics: Vec<&VelocityQuadratic> = jitters.levels().iter().map(|level| &level.quadratic).collect();
    let of_one = |quadratic: &&VelocityQuadratic| Periodogram::new(quadratic, priors[0]);
    let ones: Vec<Periodogram> = quadratics.iter().map(of_one).collect::<Option<_>>()?;
    let circles: Vec<f64> = weights.iter().zip(&ones).map(|(weight, one)| weight + one.ln_z).collect();
    let highest = circles.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let counting: Vec<usize> = (0..ones.len()).filter(|k| circles[*k] > highest - NEGLIGIBLE).collect();
    let of_level = |k: &usize| OfLevel::new(quadratics[*k], &ones[*k], priors);
    let levels: Vec<OfLevel> = counting.iter().map(of_level).collect::<Option<_>>()?;
    let mix = |seed: u64, ln_z: &[f64], estimate: &Estimate| {
        let draws = shared(ln_z);
        let of = |(j, k): (usize, &usize)| {
            (weights[*k] - alone, repeated((seed, *k), |rng| estimate(quadratics[*k], &levels[j], draws[j], rng)))
        };
        mixed(&counting.iter().enumerate().map(of).collect::<Vec<_>>())
    };
    let of_one: Vec<f64> = counting.iter().map(|k| circles[*k]).collect();
    let second = |level: &OfLevel| level.beside.as_ref().map_or(0.0, |beside| beside.ln_z);
    let of_two: Vec<f64> = of_one.iter().zip(&levels).map(|(one, level)| one + second(level)).collect();
    let ellipse = mix(seed, &of_one, &|quadratic, of, draws, rng| ellipse(quadratic, priors[0], (of.one, draws), rng));
    let two_circles = mix(seed.wrapping_add(1), &of_two, &|quadratic, of, draws, rng| {
        two_circles(quadratic, priors, (&of.pairs(), draws), rng)
    });
    let circle = LnBayes { ln_bayes: ln_sum(&circles) - alone, sd: None };
    Some(Evidence { circle, ellipse, two_circles, inclusion: Periodogram::mixed(&weights, &ones).inclusion() })
}

/// An estimate of ln Z at one jitter by so many draws.
type Estimate<'a> = dyn Fn(&VelocityQuadratic, &OfLevel, usize, &mut ChaCha8Rng) -> f64 + Sync + 'a;

/// Jitters whose one-planet evidence is lower than that of the best jitter by more than this (ln) are left out of the
/// Monte Carlo estimates.
const NEGLIGIBLE: f64 = 8.0;

/// Draws per repetition at jitters of that evidence (ln).
fn shared(ln_z: &[f64]) -> Vec<usize> {
    let total = ln_sum(ln_z);
    // an even number: two orbits are drawn by turns from two distributions
    let of = |ln: &f64| 2 * (0.5 * DRAWS as f64 * (ln - total).exp().max(FEWEST)).ceil() as usize;
    ln_z.iter().map(of).collect()
}

/// The mean of Bayes factors with weights given as logarithms.
fn mixed(parts: &[(f64, LnBayes)]) -> LnBayes {
    let ln: Vec<f64> = parts.iter().map(|(weight, bayes)| weight + bayes.ln_bayes).collect();
    let ln_bayes = ln_sum(&ln);
    let part = |(ln, (_, bayes)): (&f64, &(f64, LnBayes))| (ln - ln_bayes).exp() * bayes.sd.unwrap_or_default();
    let variance: f64 = ln.iter().zip(parts).map(part).map(|sd| sd * sd).sum();
    LnBayes { ln_bayes, sd: Some(variance.sqrt()) }
}

/// Proposal distributions at one jitter.
struct OfLevel<'a> {
    /// One planet.
    one: &'a Periodogram,
    /// The second with the first at its best, and vice versa.
    beside: Option<Periodogram>,
    other: Periodogram,
    before: Option<Periodogram>,
}

impl<'a> OfLevel<'a> {
    fn new(quadratic: &VelocityQuadratic, one: &'a Periodogram, priors: [&PlanetPrior; 2]) -> Option<Self> {
        let rest = |best: &Periodogram, prior: &PlanetPrior| {
            without(quadratic, best.frequency(best.best())).and_then(|rest| Periodogram::new(&rest, prior))
        };
        let other = Periodogram::new(quadratic, priors[1])?;
        Some(OfLevel { beside: rest(one, priors[1]), before: rest(&other, priors[0]), one, other })
    }

    fn pairs(&self) -> Vec<[&Periodogram; 2]> {
        let pairs = [(Some(self.one), self.beside.as_ref()), (self.before.as_ref(), Some(&self.other))];
        pairs.into_iter().filter_map(|(a, b)| Some([a?, b?])).collect()
    }
}

/// The mean of independent estimates of a marginal likelihood at that jitter, given as logarithms.
fn repeated((seed, jitter): (u64, usize), estimate: impl Fn(&mut ChaCha8Rng) -> f64 + Sync) -> LnBayes {
    let one = |k: usize| {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        rng.set_stream((REPETITIONS * jitter + k) as u64);
        estimate(&mut rng)
    };
    let all: Vec<f64> = (0..REPETITIONS).into_par_iter().map(one).collect();
    let ln_bayes = ln_sum(&all) - (REPETITIONS as f64).ln();
    let relative: Vec<f64> = all.iter().map(|x| (x - ln_bayes).exp()).collect();
    let variance = relative.iter().map(|x| (x - 1.0).powi(2)).sum::<f64>() / (REPETITIONS - 1) as f64;
    LnBayes { ln_bayes, sd: Some((variance / REPETITIONS as f64).sqrt()) }
}

/// Marginal likelihoods at the frequencies of a prior.
#[derive(Default)]
struct Periodogram {
    lowest: f64,
    width: f64,
    /// ln Z at each frequency, including the prior of the frequency.
    ln_cells: Vec<f64>,
    /// Probability of drawing each frequency, and cumulative probability.
    drawn: Vec<f64>,
    cumulative: Vec<f64>,
    ln_z: f64,
    time_base: f64,
}

impl Periodogram {
    fn new(quadratic: &VelocityQuadratic, prior: &PlanetPrior) -> Option<Self> {
        let [shortest, longest] = prior.period.bounds;
        let (lowest, highest) = (1.0 / longest, 1.0 / shortest);
        let first = quadratic.cycles.iter().copied().fold(f64::INFINITY, f64::min);
        let last = quadratic.cycles.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let time_base = (last - first).max(1e-3);
        let count = (OVERSAMPLING * time_base * (highest - lowest)).ceil().clamp(50.0, MOST_FREQUENCIES as f64);
        let width = (highest - lowest) / count;
        let frequencies: Vec<f64> = (0..count as usize).map(|i| lowest + (i as f64 + 0.5) * width).collect();
        let cell = |trial: &Trial| {
            let period = 1.0 / trial.frequency;
            let prior_of_frequency = (prior.period.ln)(period) + 2.0 * period.ln() + width.ln();
            trial.orbit.map(|_| ln_over_k_and_phase(&trial.information, &trial.gradient, &prior.k) + prior_of_frequency)
        };
        let trials = scan(quadratic, &frequencies);
        let cells: Vec<Option<f64>> = trials.par_iter().map(cell).collect();
        let ln_cells: Vec<f64> = cells.into_iter().map(|cell| cell.unwrap_or(f64::NEG_INFINITY)).collect();
        let ln_z = ln_sum(&ln_cells);
        if !ln_z.is_finite() {
            return None;
        }
        let even = EVEN / ln_cells.len() as f64;
        let drawn: Vec<f64> = ln_cells.iter().map(|x| (1.0 - EVEN) * (x - ln_z).exp() + even).collect();
        let mut sum = 0.0;
        let cumulative = drawn.iter().map(|p| {
            sum += p;
            sum
        });
        let cumulative = cumulative.collect();
        Some(Periodogram { lowest, width, ln_cells, drawn, cumulative, ln_z, time_base })
    }

    /// The posterior of the frequency, marginalised over the jitter: over `levels`, with the logarithms of their
    /// weights.
    fn mixed(weights: &[f64], levels: &[Periodogram]) -> Self {
        let alone = ln_sum(weights);
        let cell = |k: usize| {
            let parts: Vec<f64> = weights.iter().zip(levels).map(|(weight, one)| weight + one.ln_cells[k]).collect();
            ln_sum(&parts) - alone
        };
        let first = &levels[0];
        let ln_cells: Vec<f64> = (0..first.ln_cells.len()).map(cell).collect();
        let ln_z = ln_sum(&ln_cells);
        Periodogram {
            lowest: first.lowest,
            width: first.width,
            time_base: first.time_base,
            ln_cells,
            ln_z,
            ..Periodogram::default()
        }
    }

    fn frequency(&self, cell: usize) -> f64 {
        self.lowest + (cell as f64 + 0.5) * self.width
    }

    fn best(&self) -> usize {
        (0..self.ln_cells.len()).max_by(|a, b| self.ln_cells[*a].total_cmp(&self.ln_cells[*b])).unwrap_or(0)
    }

    /// A frequency.
    fn draw(&self, rng: &mut ChaCha8Rng) -> f64 {
        let target = rng.random::<f64>() * self.cumulative[self.cumulative.len() - 1];
        let cell = self.cumulative.partition_point(|&c| c <= target).min(self.drawn.len() - 1);
        self.lowest + (cell as f64 + rng.random::<f64>()) * self.width
    }

    /// Density with which it is drawn.
    fn density(&self, frequency: f64) -> f64 {
        let cell = ((frequency - self.lowest) / self.width).floor();
        let inside = cell >= 0.0 && cell < self.drawn.len() as f64;
        if inside { self.drawn[cell as usize] / self.width } else { 0.0 }
    }

    /// The intervals that hold most of the posterior of one planet.
    fn inclusion(&self) -> Vec<Inclusion> {
        let half = ((0.5 / self.time_base / self.width).round() as usize).max(1);
        // equal prior probabilities of none and one planet
        let (none, one) = (1.0 / (1.0 + self.ln_z.exp()), 1.0 / (1.0 + (-self.ln_z).exp()));
        let posterior: Vec<f64> = self.ln_cells.iter().map(|x| one * (x - self.ln_z).exp()).collect();
        let mut before = vec![0.0];
        posterior.iter().for_each(|p| before.push(before[before.len() - 1] + p));
        let ends = |cell: usize| (cell.saturating_sub(half), (cell + half + 1).min(posterior.len()));
        let within = |cell: usize| before[ends(cell).1] - before[ends(cell).0];
        // one minus that would be rounding error where the planet is sure
        let outside = |cell: usize| none + before[ends(cell).0] + posterior[ends(cell).1..].iter().sum::<f64>();
        let mut cells: Vec<usize> = (0..posterior.len()).collect();
        cells.sort_by(|a, b| within(*b).total_cmp(&within(*a)));
        let mut told: Vec<usize> = Vec::new();
        for cell in cells {
            // of all intervals that contain a peak, the one centred on it
            let around = cell.saturating_sub(half)..(cell + half + 1).min(posterior.len());
            let cell = around.max_by(|a, b| posterior[*a].total_cmp(&posterior[*b])).unwrap_or(cell);
            if told.len() < TOLD && told.iter().all(|other| other.abs_diff(cell) > 2 * half) {
                told.push(cell);
            }
        }
        told.into_iter()
            .map(|cell| Inclusion {
                porb_over_prot: 1.0 / self.frequency(cell),
                false_inclusion_probability: outside(cell),
            })
            .collect()
    }
}

/// Fewest and most directions over half a turn, directions per standard error of a phase, and times the ratio of the
/// axes of the ellipse of errors: sums over equal steps are then exact to 1e-6.
const LINES: (f64, f64) = (12.0, 2000.0);
const LINES_PER_WIDTH: f64 = 3.5;
const LINES_PER_RATIO: f64 = 8.0;

/// Nodes along a ray: enough for parabolas whose width is known for each ray.
const NODES: usize = 40;

/// A ray is followed for this many standard errors of K beyond its highest point.
const REACH: f64 = 8.0;

/// Distances (standard errors) from the parabola's maximum to the bounds, and between the bounds, up to which
/// differences of the normal distribution function are finite and exact.
const TAILS: f64 = 30.0;
const NARROW: f64 = 1e-3;

/// ln of the integral of `exp(b x - x A x / 2)` over the prior of K and a uniform phase, x = K (cos, sin).
fn ln_over_k_and_phase(a: &Matrix2<f64>, b: &Vector2<f64>, prior: &Density) -> f64 {
    let half_trace = 0.5 * a.trace();
    let apart = (half_trace * half_trace - a.determinant()).max(0.0).sqrt();
    let (most, least) = (half_trace + apart, half_trace - apart);
    let mode = a.try_inverse().map_or(Vector2::zeros(), |inverse| inverse * b);
    // a phase is known to sigma / K
    let lines = (LINES_PER_WIDTH * mode.norm() * most.sqrt()).max(LINES_PER_RATIO * (most / least).sqrt());
    let lines = if lines.is_finite() { lines.clamp(LINES.0, LINES.1) } else { LINES.0 } as usize;
    let line = |i: usize| {
        let (sin, cos) = (PI * i as f64 / lines as f64).sin_cos();
        let direction = Vector2::new(cos, sin);
        (direction.dot(&(a * direction)), b.dot(&direction))
    };
    let is_symmetric = prior.uniform && prior.bounds[0] == 0.0;
    let top = 0.5 * b.dot(&mode);
    let sum = is_symmetric.then(|| ln_over_lines((0..lines).map(line), top, prior)).flatten();
    let of_rays = || {
        let of_both = |(a, g)| [ln_along_ray(a, g, prior), ln_along_ray(a, -g, prior)];
        ln_sum(&(0..lines).map(line).flat_map(of_both).collect::<Vec<_>>())
    };
    sum.unwrap_or_else(of_rays) - (2.0 * lines as f64).ln()
}

/// ln of the sum of the integrals along rays and those opposite to them, for a uniform prior from 0: two rays are one
/// line through K = 0. `top` is the highest value of the quadratic. `None` where the closed form is not exact.
fn ln_over_lines(rays: impl Iterator<Item = (f64, f64)>, top: f64, prior: &Density) -> Option<f64> {
    let mut sum = 0.0;
    for (a, g) in rays {
        let (root, at) = (a.sqrt(), g / a);
        let [low, high] = [-prior.bounds[1], prior.bounds[1]].map(|bound| (bound - at) * root);
        if !(low < TAILS && high > -TAILS && high - low > NARROW) {
            return None;
        }
        sum += (0.5 * g * at - top).exp() / root * share(low, high);
    }
    (sum > f64::MIN_POSITIVE).then(|| top + sum.ln() + 0.5 * TAU.ln() + (prior.ln)(0.0))
}

/// Probability of a normal deviate between two bounds: the difference of the two smaller tails.
fn share(low: f64, high: f64) -> f64 {
    if low > 0.0 { cumulative(-low) - cumulative(-high) } else { cumulative(high) - cumulative(low) }
}

/// ln of the integral of `exp(g K - a K^2 / 2)` over the prior of K.
fn ln_along_ray(a: f64, g: f64, prior: &Density) -> f64 {
    let [low, high] = prior.bounds.map(|bound| (bound - g / a) * a.sqrt());
    // panels over a uniform prior take thirty times as long
    let closed = prior.uniform && low < TAILS && high > -TAILS && high - low > NARROW;
    if !closed {
        return ln_by_panels(a, g, prior);
    }
    0.5 * (g * g / a + (TAU / a).ln()) + share(low, high).ln() + (prior.ln)(prior.bounds[0])
}

/// The same by Gauss-Legendre panels where the integrand is not negligible.
fn ln_by_panels(a: f64, g: f64, prior: &Density) -> f64 {
    const ABSCISSA: f64 = 0.577_350_269_189_625_8;
    let [low, high] = prior.bounds;
    let (top, sigma) = (g / a, a.sqrt().recip());
    let peak = top.clamp(low, high);
    // where the parabola has fallen by so much below its highest point within the bounds
    let reach = (REACH * REACH * sigma * sigma + (peak - top).powi(2)).sqrt();
    let (from, to) = (low.max(top - reach), high.min(top + reach));
    if to.is_nan() || to <= from {
        return f64::NEG_INFINITY;
    }
    let half = 0.5 * (to - from) / NODES as f64;
    let highest = g * peak - 0.5 * a * peak * peak;
    let at = |k: f64| (g * k - 0.5 * a * k * k - highest + (prior.ln)(k)).exp();
    let sum: f64 = (0..NODES)
        .map(|i| {
            let middle = from + (2 * i + 1) as f64 * half;
            at(middle - ABSCISSA * half) + at(middle + ABSCISSA * half)
        })
        .sum();
    highest + (half * sum).ln()
}

/// `X' I X` and `X' g` of columns.
fn projected(quadratic: &VelocityQuadratic, x: &DMatrix<f64>) -> (DMatrix<f64>, nalgebra::DVector<f64>) {
    let a = x.tr_mul(&(&quadratic.information * x));
    (0.5 * (&a + a.transpose()), x.tr_mul(&quadratic.gradient))
}

/// An estimate of ln Z of one Keplerian orbit.
fn ellipse(
    quadratic: &VelocityQuadratic,
    prior: &PlanetPrior,
    (circle, draws): (&Periodogram, usize),
    rng: &mut ChaCha8Rng,
) -> f64 {
    let mid = mid_cycle(&quadratic.cycles);
    let weight = |_: usize| {
        let frequency = circle.draw(rng);
        // uniform in e and in the mean anomaly at mid-time, like the prior; nearly circular orbits more often
        let root: f64 = rng.random();
        let (e, anomaly) = (prior.largest_e * root * root, TAU * rng.random::<f64>());
        let ln_e = (2.0 * root.max(f64::MIN_POSITIVE)).ln();
        let row = |cycle: &f64| {
            let (cos, sin) = true_anomaly(TAU * frequency * (cycle - mid) + anomaly, e.min(1.0 - 1e-9));
            [cos + e, -sin]
        };
        let rows: Vec<f64> = quadratic.cycles.iter().flat_map(row).collect();
        let (a, b) = projected(quadratic, &DMatrix::from_row_slice(quadratic.len(), 2, &rows));
        let (a, b) = (Matrix2::from_iterator(a.iter().copied()), Vector2::new(b[0], b[1]));
        let ln_prior = (prior.period.ln)(1.0 / frequency) - 2.0 * frequency.ln();
        ln_prior - circle.density(frequency).ln() + ln_e + ln_over_k_and_phase(&a, &b, &prior.k)
    };
    let all: Vec<f64> = (0..draws).map(weight).collect();
    ln_sum(&all) - (draws as f64).ln()
}

/// An estimate of ln Z of two circular orbits; frequencies are drawn from the `pairs` with equal probability.
fn two_circles(
    quadratic: &VelocityQuadratic,
    priors: [&PlanetPrior; 2],
    (pairs, draws): (&[[&Periodogram; 2]], usize),
    rng: &mut ChaCha8Rng,
) -> f64 {
    let mid = mid_cycle(&quadratic.cycles);
    if pairs.is_empty() {
        return f64::NEG_INFINITY;
    }
    let weight = |i: usize| {
        let pair = pairs[i % pairs.len()];
        let frequencies = pair.map(|one| one.draw(rng));
        let row = |cycle: &f64| {
            let [one, other] = frequencies.map(|f| (TAU * f * (cycle - mid)).sin_cos());
            [one.1, one.0, other.1, other.0]
        };
        let rows: Vec<f64> = quadratic.cycles.iter().flat_map(row).collect();
        let (a, b) = projected(quadratic, &DMatrix::from_row_slice(quadratic.len(), 4, &rows));
        let block = |r: usize, c: usize| a.fixed_view::<2, 2>(r, c).into_owned();
        let (own, across, other) = (block(0, 0), block(0, 2), block(2, 2));
        let (b1, b2) = (Vector2::new(b[0], b[1]), Vector2::new(b[2], b[3]));
        // the first orbit with the second left free
        let Some(inverse) = other.try_inverse() else { return f64::NEG_INFINITY };
        let alone = own - across * inverse * across.transpose();
        let Some(factor) = alone.cholesky() else { return f64::NEG_INFINITY };
        let mode = factor.solve(&(b1 - across * inverse * b2));
        let first = FirstOrbit::new(mode, factor.l(), priors[0].k.bounds[1]);
        let x = first.draw(rng);
        let k = x.norm();
        let ln_prior_k = (priors[0].k.ln)(k) - (TAU * k).ln();
        if !ln_prior_k.is_finite() {
            return f64::NEG_INFINITY;
        }
        let ln_first = b1.dot(&x) - 0.5 * x.dot(&(own * x));
        let ln_second = ln_over_k_and_phase(&other, &(b2 - across.transpose() * x), &priors[1].k);
        let density = pairs.iter().map(|pair| pair[0].density(frequencies[0]) * pair[1].density(frequencies[1]));
        let density: f64 = density.sum::<f64>() / pairs.len() as f64;
        let ln_periods: f64 =
            (0..2).map(|j| (priors[j].period.ln)(1.0 / frequencies[j]) - 2.0 * frequencies[j].ln()).sum();
        ln_prior_k + ln_first + ln_second + ln_periods - density.ln() - first.density(&x).ln()
    };
    let all: Vec<f64> = (0..draws).map(weight).collect();
    ln_sum(&all) - (draws as f64).ln()
}

/// Proposal distribution of (a, b) of the first of two orbits: a mixture of a Gaussian somewhat wider than its
/// posterior, and a uniform phase and K up to beyond it, which has the density of the prior at K = 0.
struct FirstOrbit {
    mode: Vector2<f64>,
    /// Lower factor of the information.
    lower: Matrix2<f64>,
    largest_k: f64,
}

/// Factor by which the standard errors of that Gaussian are widened.
const WIDER: f64 = 1.3;

impl FirstOrbit {
    fn new(mode: Vector2<f64>, lower: Matrix2<f64>, bound: f64) -> Self {
        let sigma = lower.diagonal().map(|l| 1.0 / l).norm();
        FirstOrbit { mode, lower, largest_k: (mode.norm() + 5.0 * sigma).min(bound) }
    }

    fn draw(&self, rng: &mut ChaCha8Rng) -> Vector2<f64> {
        if rng.random::<bool>() {
            let normal = Vector2::new(rng.sample(StandardNormal), rng.sample(StandardNormal));
            let step = self.lower.tr_solve_lower_triangular(&normal).unwrap_or_else(Vector2::zeros);
            return self.mode + step * WIDER;
        }
        let k = self.largest_k * rng.random::<f64>();
        let (sin, cos) = (TAU * rng.random::<f64>()).sin_cos();
        Vector2::new(k * cos, k * sin)
    }

    fn density(&self, x: &Vector2<f64>) -> f64 {
        let scaled = self.lower.transpose() * (x - self.mode) / WIDER;
        let gaussian = self.lower.determinant() / (TAU * WIDER * WIDER) * (-0.5 * scaled.norm_squared()).exp();
        let k = x.norm();
        let even = if k <= self.largest_k { 1.0 / (TAU * k * self.largest_k) } else { 0.0 };
        0.5 * (gaussian + even)
    }
}

#[cfg(test)]
mod tests;
