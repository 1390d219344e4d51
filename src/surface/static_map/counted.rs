//! The posterior where residual unresolved spots are counted as noise of unknown size.
//!
//! With x the coordinates of an expansion relative to its centre, its gradient g there scatters around `I x` with the
//! covariance `S = noise + f (I - noise)`, f the size of unresolved spots in variance (`spots`). Close to the rotation
//! period, an orbit can mimic unresolved spots and they an orbit: the most probable size with one or the other does not
//! distinguish them, so that the posterior is marginalised over the size, uniform in its logarithm: `p(x) = sum_f
//! |S_f|^-1/2 exp(-(g - I x) S_f^-1 (g - I x) / 2)`.
//!
//! ln L by the objective exceeds the quadratic q, increasingly with the distance from the reference. A map responds to
//! a large change of the velocities as q predicts for a smaller (or larger) one in the same direction: x is replaced by
//! `c x` with `q(c x) = ln L`, on the same side of the maximum of q in that direction. Near that maximum, where c would
//! jump, it is softened, and every term gets the fraction `rho_f = x I S_f^-1 I x / x I x`, at most 1, of the rest: the
//! part of the effect of q along x that unresolved spots leave. So nothing exceeds the likelihood of explaining all
//! velocities apart from the rest, and with spots of the entropy's size ln L is unchanged.

use super::spots::UNRESOLVED_SPOTS;
use crate::model::{Parameter, ParameterSpace, ParameterValues};
use crate::numerics::logarithms::ln_sum;
use crate::sampling::log_density::{Evaluation, Status};
use crate::surface::expansion::{Expansion, free_stellar, nuisances};
use crate::surface::static_map::Posterior;
use nalgebra::{DMatrix, DVector};

/// Differences of ln L below this are negligible.
const SOFT: f64 = 1.0;

/// Sizes in the marginalisation, per factor of ten.
const SIZES_PER_DECADE: f64 = 4.0;

/// The posterior with unresolved spots counted as noise.
#[derive(Clone, Debug)]
pub struct SpotsCounted {
    /// ln L by the objective at the reference, and ln of the density of the gradient there.
    at_reference: f64,
    density_at_reference: f64,
    entropy: Expansion,
    cautious: Expansion,
    sizes: Vec<Size>,
}

/// The density of the gradient for one size of the unresolved spots: with `S = L L^t`, `L^-1 I`, `L^-1 g` and `ln
/// |S|^-1/2`.
#[derive(Clone, Debug)]
struct Size {
    information: DMatrix<f64>,
    gradient: DVector<f64>,
    ln_norm: f64,
}

impl SpotsCounted {
    /// For `posterior`, to second order around its reference; `None` where there is no such size.
    pub fn new(posterior: &Posterior) -> Option<Self> {
        let free = posterior.space().free();
        let reference = posterior.reference();
        let entropy = Expansion::of(posterior.imager(), reference, &free_stellar(free));
        let mut without_planet = reference.values;
        without_planet.set(Parameter::K, 0.0);
        // an orbit that mimics unresolved spots makes them look small
        let size = [reference.values, without_planet]
            .iter()
            .filter_map(|values| entropy.recentred(values).unresolved_spots(&nuisances(free)))
            .reduce(f64::max)?;
        let cautious = entropy.with_unresolved_spots(size)?;
        let places = (SIZES_PER_DECADE * (UNRESOLVED_SPOTS.1 / UNRESOLVED_SPOTS.0).log10()).ceil() as i32;
        let factor = |place: i32| UNRESOLVED_SPOTS.0 * 10f64.powf(f64::from(place) / SIZES_PER_DECADE);
        let sizes = (0..=places).filter_map(|place| Size::new(&entropy, factor(place))).collect();
        let theta = posterior.space().theta_of(&reference.values);
        let at_reference = Some(posterior.likelihood(&theta).log_prob).filter(|ln_l| ln_l.is_finite())?;
        let counted = SpotsCounted::of(at_reference, entropy, cautious, sizes);
        counted.density_at_reference.is_finite().then_some(counted)
    }

    fn of(at_reference: f64, entropy: Expansion, cautious: Expansion, sizes: Vec<Size>) -> Self {
        let nowhere = DVector::zeros(entropy.centre.len());
        let counted = SpotsCounted { at_reference, density_at_reference: 0.0, entropy, cautious, sizes };
        SpotsCounted { density_at_reference: counted.ln_density(&nowhere, 1.0, 0.0), ..counted }
    }

    /// ln L at the reference to second order, with unresolved spots of the larger of the sizes that are most probable
    /// with the reference's orbit and without a planet: the basis of a surrogate.
    pub fn expansion(&self) -> &Expansion {
        &self.cautious
    }

    /// ln L with unresolved spots counted, where it is `log_likelihood` with spots of the entropy's size.
    pub fn log_likelihood(&self, values: &ParameterValues, log_likelihood: f64) -> f64 {
        let step = self.entropy.coordinates(values) - &self.entropy.centre;
        let (answer, rest) = self.answer(&step, log_likelihood - self.at_reference);
        self.at_reference + self.ln_density(&step, answer, rest) - self.density_at_reference
    }

    /// The multiple of `step` to which the map responds where ln L changes by `change`, and the rest of the change.
    fn answer(&self, step: &DVector<f64>, change: f64) -> (f64, f64) {
        let whole = step.dot(&(&self.entropy.information * step));
        let along = self.entropy.gradient.dot(step);
        let quadratic = |times: f64| times * (along - 0.5 * times * whole);
        if whole <= 0.0 {
            return (1.0, change - quadratic(1.0));
        }
        // where the quadratic is highest along the step, and how far it and ln L are below that maximum
        let top = along / whole;
        let height = 0.5 * along * top;
        let (of_quadratic, of_change) = (0.5 * whole * (1.0 - top).powi(2), (height - change).max(0.0));
        let shrink = ((SOFT + of_change) / (SOFT + of_quadratic)).sqrt();
        let times = 1.0 + (shrink - 1.0) * (1.0 - top);
        (times, change - quadratic(times))
    }

    /// ln of the density of the gradient, marginalised over the size, at so many `times` the step, and the `rest`.
    fn ln_density(&self, step: &DVector<f64>, times: f64, rest: f64) -> f64 {
        let whole = step.dot(&(&self.entropy.information * step));
        let terms: Vec<f64> = self.sizes.iter().map(|size| size.ln_density(step, times, whole, rest)).collect();
        ln_sum(&terms)
    }

    /// The posterior's `evaluation` at `theta`, unresolved spots counted.
    pub fn recount(&self, space: &ParameterSpace, theta: &[f64], evaluation: Evaluation) -> Evaluation {
        if !evaluation.log_prob.is_finite() {
            return evaluation;
        }
        let log_prior = space.log_prior(theta);
        let log_likelihood = self.log_likelihood(&space.values_at(theta), evaluation.log_prob - log_prior);
        if log_likelihood.is_nan() {
            let Evaluation { model_applications, .. } = evaluation;
            return Evaluation { model_applications, ..Evaluation::rejected(Status::NonFinite) };
        }
        Evaluation { log_prob: log_prior + log_likelihood, ..evaluation }
    }
}

impl Size {
    /// For unresolved spots `factor` times as large in variance as the entropy expects; `None` where that is no
    /// covariance.
    fn new(expansion: &Expansion, factor: f64) -> Option<Self> {
        let lower = expansion.covariance_with_unresolved_spots(factor).cholesky()?.unpack();
        Some(Size {
            information: lower.solve_lower_triangular(&expansion.information)?,
            gradient: lower.solve_lower_triangular(&expansion.gradient)?,
            ln_norm: -lower.diagonal().iter().map(|l| l.ln()).sum::<f64>(),
        })
    }

    /// `whole` is the step weighted by the entropy's information.
    fn ln_density(&self, step: &DVector<f64>, times: f64, whole: f64, rest: f64) -> f64 {
        let moved = &self.information * step;
        let left = moved.norm_squared();
        // rounding may make it too large
        let share = if left < whole { left / whole } else { 1.0 };
        self.ln_norm - 0.5 * (&self.gradient - times * moved).norm_squared() + share * rest
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{Rng, SeedableRng};
    use rand_distr::StandardNormal;

    /// Sixteen profiles whose velocities scatter far more than the entropy expects.
    fn spotted() -> SpotsCounted {
        let n = 16;
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(3);
        let waves = DMatrix::from_fn(n, 5, |_, _| rng.sample::<f64, _>(StandardNormal));
        let noise = DMatrix::identity(n, n) * 4.0;
        let entropy = Expansion {
            values: ParameterValues::of_eight([0.0, 1.7, 0.0, 2.0, 0.0, 40.0, 40.0, 0.0]),
            cycles: (0..n).map(|k| 0.37 * k as f64).collect(),
            stellar: Vec::new(),
            log_likelihood: -3.0,
            centre: DVector::zeros(n),
            gradient: 20.0 * &waves * DVector::from_fn(5, |_, _| rng.sample::<f64, _>(StandardNormal)),
            information: &noise + &waves * waves.transpose(),
            noise,
        };
        let sizes = (0..=24).filter_map(|k| Size::new(&entropy, 10f64.powf(0.25 * f64::from(k)))).collect();
        SpotsCounted::of(7.0, entropy.clone(), entropy, sizes)
    }

    fn orbits() -> impl Iterator<Item = ParameterValues> {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(4);
        (0..1000).map(move |_| {
            let orbit = [10f64.powf(rng.random_range(-2.0..2.0)), rng.random_range(0.5..4.0), rng.random()];
            ParameterValues::of_eight([orbit[0], orbit[1], orbit[2], 2.0, 0.0, 40.0, 40.0, 0.0])
        })
    }

    /// Where a map responds as to a step of that many times the length, spots counted or not.
    #[test]
    fn a_map_that_answers_less_is_a_smaller_step() {
        let counted = spotted();
        let mut compared = 0;
        for values in orbits() {
            let step = counted.entropy.coordinates(&values);
            for times in [0.2, 0.6, 0.95, 1.0, 1.3] {
                let smaller = times * &step;
                let change = counted.entropy.gradient.dot(&smaller)
                    - 0.5 * smaller.dot(&(&counted.entropy.information * &smaller));
                let top = counted.entropy.gradient.dot(&step) / step.dot(&(&counted.entropy.information * &step));
                // beyond the maximum in its direction on one side only, and by much more than SOFT
                if (times - top) * (1.0 - top) <= 0.0 || 0.5 * (times - top).powi(2) * step.norm_squared() < 50.0 {
                    continue;
                }
                let wanted = 7.0 + counted.ln_density(&smaller, 1.0, 0.0) - counted.density_at_reference;
                let got = counted.log_likelihood(&values, 7.0 + change);
                assert!((got - wanted).abs() < SOFT, "{values:?} {times}: {got} for {wanted}");
                compared += 1;
            }
        }
        assert!(compared > 500, "{compared}");
    }

    /// ln L that falls no further than to 50 below the reference: no orbit, however large, is better than one that
    /// explains all velocities.
    #[test]
    fn a_map_that_answers_little_is_no_better_than_a_perfect_fit() {
        let counted = spotted();
        let perfect = counted.sizes.iter().map(|size| size.ln_norm.exp()).sum::<f64>().ln();
        let most = 7.0 + perfect - counted.density_at_reference;
        for values in orbits() {
            let quadratic = counted.entropy.log_likelihood_at(&values) + 3.0;
            let at = counted.log_likelihood(&values, 7.0 + quadratic.max(-50.0));
            assert!(at <= most + SOFT, "{values:?}: {at} of {most}");
        }
    }

    /// Where ln L differs slightly from the quadratic, the density changes slightly: also where the quadratic is
    /// highest along the step.
    #[test]
    fn nothing_is_magnified() {
        let counted = spotted();
        for mut values in orbits() {
            let step = counted.entropy.coordinates(&values);
            let top = counted.entropy.gradient.dot(&step) / step.dot(&(&counted.entropy.information * &step));
            // at the maximum, and slightly before and beyond it
            for part in [0.98, 1.0, 1.02] {
                if top > 0.0 {
                    values.set(Parameter::K, values[Parameter::K] * (part * top));
                }
                let quadratic = counted.entropy.log_likelihood_at(&values) + 3.0;
                let at = |beyond: f64| counted.log_likelihood(&values, 7.0 + quadratic + beyond);
                let change = (at(0.05) - at(-0.05)).abs();
                assert!(change < 1.0, "{values:?}: {change}");
            }
        }
    }
}
