//! Residual unresolved spots of the map, counted as noise.
//!
//! The information counts spots with the prior of the entropy: many small and independent ones. Real spots have edges,
//! and the part of them that a map of the highest entropy misses is larger (25 times in variance for discs at a
//! signal-to-noise ratio of 1000) and rotates with the star: most of it looks like an orbit at the rotation period or
//! its fractions. Its covariance has the shape of the contribution of spots to the noise, `information - noise`; its
//! size is one parameter, fitted to the gradient itself, like a jitter. Without it, half of all stars without a planet
//! show one (`results/calibration.md`).

use crate::surface::expansion::{Expansion, Nuisance};
use nalgebra::{DMatrix, DVector, SymmetricEigen};

/// Range of the factor on the variance by spots.
pub const UNRESOLVED_SPOTS: (f64, f64) = (1.0, 1e6);

impl Expansion {
    /// Size of the unresolved spots relative to the entropy's expectation, in variance: the factor with which the
    /// gradient at the centre is most probable, with free `nuisances` within their priors. `None` where none is
    /// possible.
    pub fn unresolved_spots(&self, nuisances: &[Nuisance]) -> Option<f64> {
        let moved = &self.information * self.columns(nuisances);
        let (sd, offset) = self.priors(nuisances);
        let scaled = &moved * DMatrix::from_diagonal(&sd);
        let anywhere = &scaled * scaled.transpose();
        let left = &self.gradient - &moved * offset;
        let spots = self.spots();
        // -2 ln of the probability density of the gradient
        let misfit = |ln_factor: f64| {
            let covariance = &self.noise + ln_factor.exp() * &spots + &anywhere;
            covariance.cholesky().map_or(f64::INFINITY, |factor| {
                let log_determinant = 2.0 * factor.l_dirty().diagonal().iter().map(|l| l.ln()).sum::<f64>();
                log_determinant + left.dot(&factor.solve(&left))
            })
        };
        let best = minimum(misfit, (UNRESOLVED_SPOTS.0.ln(), UNRESOLVED_SPOTS.1.ln()));
        misfit(best).is_finite().then(|| best.exp())
    }

    /// The same expansion with unresolved spots, `factor` times as large as the entropy expects in variance, counted as
    /// noise. `None` where the information is singular.
    ///
    /// With `S = noise + factor (information - noise)` the covariance of the gradient, the best coordinates `centre +
    /// I^-1 g` stay, and their covariance is `I^-1 S I^-1`: the new information is `I S^-1 I`, the new gradient `I S^-1
    /// g`.
    pub fn with_unresolved_spots(&self, factor: f64) -> Option<Self> {
        let answer = self.covariance_with_unresolved_spots(factor).cholesky()?.solve(&self.information);
        let information = symmetric(self.information.tr_mul(&answer));
        let gradient = answer.tr_mul(&self.gradient);
        Some(Expansion { gradient, noise: information.clone(), information, ..self.clone() })
    }

    /// Covariance of the gradient with unresolved spots, `factor` times as large as the entropy expects in variance.
    pub(super) fn covariance_with_unresolved_spots(&self, factor: f64) -> DMatrix<f64> {
        &self.noise + factor * self.spots()
    }

    /// Covariance of the most likely coordinates, `I^-1 (noise + factor (I - noise)) I^-1`, with unresolved spots
    /// `factor` times as large as the entropy expects in variance; `None` where the information is singular.
    pub fn covariance_of_best(&self, factor: f64) -> Option<DMatrix<f64>> {
        let inverse = self.information.clone().cholesky()?.inverse();
        Some(symmetric(&inverse * self.covariance_with_unresolved_spots(factor) * &inverse))
    }

    /// Contribution of spots to the covariance of the gradient according to the entropy: positive, despite rounding and
    /// the curvature of the model in the difference.
    fn spots(&self) -> DMatrix<f64> {
        let scale = self.information.diagonal().map(|i| i.max(f64::MIN_POSITIVE).sqrt());
        let (scale, back) = (DMatrix::from_diagonal(&scale), DMatrix::from_diagonal(&scale.map(f64::recip)));
        let mut eigen = SymmetricEigen::new(symmetric(&back * (&self.information - &self.noise) * &back));
        eigen.eigenvalues.apply(|e| *e = e.max(0.0));
        symmetric(&scale * eigen.recompose() * &scale)
    }

    /// Standard deviations of the nuisances' priors, and how far their means are from the centre. A prior wider than a
    /// thousand standard errors is effectively flat.
    pub(in crate::surface) fn priors(&self, nuisances: &[Nuisance]) -> (DVector<f64>, DVector<f64>) {
        const FLAT: f64 = 1e3;
        let columns = self.columns(nuisances);
        let known = (columns.tr_mul(&(&self.information * &columns))).diagonal();
        let sd = |i: usize| nuisances[i].sd.min(FLAT / known[i].max(f64::MIN_POSITIVE).sqrt());
        let offset = |i: usize| nuisances[i].mean - self.values[nuisances[i].parameter];
        (DVector::from_fn(nuisances.len(), |i, _| sd(i)), DVector::from_fn(nuisances.len(), |i, _| offset(i)))
    }
}

fn symmetric(matrix: DMatrix<f64>) -> DMatrix<f64> {
    0.5 * (&matrix + matrix.transpose())
}

/// The minimum of a function with one valley or more: the lowest of many points, refined by a golden-section search.
fn minimum(f: impl Fn(f64) -> f64, (low, high): (f64, f64)) -> f64 {
    const PLACES: usize = 40;
    let step = (high - low) / PLACES as f64;
    let place = |i: usize| low + i as f64 * step;
    let lowest = (0..=PLACES).min_by(|&a, &b| f(place(a)).total_cmp(&f(place(b)))).expect("there are places");
    let (mut a, mut b) = ((place(lowest) - step).max(low), (place(lowest) + step).min(high));
    let section = 0.5 * (5f64.sqrt() - 1.0);
    while b - a > 1e-3 {
        let (left, right) = (b - section * (b - a), a + section * (b - a));
        if f(left) < f(right) { b = right } else { a = left }
    }
    0.5 * (a + b)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::{Parameter, ParameterValues};
    use rand::{Rng, SeedableRng};
    use rand_distr::StandardNormal;

    /// Gradients drawn with spots 30 times the information's, and a systemic velocity within its prior: the factor is
    /// recovered, the velocities stay, their covariance is correct, and the prior is unchanged.
    #[test]
    fn the_size_of_unresolved_spots_is_found() {
        let n = 60;
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(5);
        let mut normal =
            |rows: usize, columns: usize| DMatrix::from_fn(rows, columns, |_, _| rng.sample::<f64, _>(StandardNormal));
        let waves = normal(n, 12);
        let spots = 0.05 * &waves * waves.transpose();
        let noise = DMatrix::identity(n, n) * 4.0;
        let vsys = Nuisance { parameter: Parameter::Vsys, mean: 0.0, sd: 0.3 };
        let (mut factors, mut scatter, mut claimed) = (Vec::new(), 0.0, 0.0);
        for _ in 0..40 {
            let information = &noise + &spots;
            let shift = &information * DMatrix::from_element(n, 1, 0.3) * normal(1, 1);
            let gradient = 2.0 * normal(n, 1) + (30.0f64 * 0.05).sqrt() * &waves * normal(12, 1) + shift;
            let expansion = Expansion {
                values: ParameterValues::of_eight([0.0, 1.7, 0.0, 2.0, 0.0, 40.0, 40.0, 0.0]),
                cycles: (0..n).map(|k| k as f64).collect(),
                stellar: Vec::new(),
                log_likelihood: 0.0,
                centre: DVector::zeros(n),
                gradient: gradient.column(0).into_owned(),
                information,
                noise: noise.clone(),
            };
            let factor = expansion.unresolved_spots(&[vsys]).unwrap();
            let honest = expansion.with_unresolved_spots(factor).unwrap();
            let (before, _) = expansion.velocities(&[]).radial_velocities().unwrap();
            let (after, alone) = honest.velocities(&[]).radial_velocities().unwrap();
            assert!((&before - &after).amax() < 1e-9);
            let (_, covariance) = honest.velocities(&[vsys]).radial_velocities().unwrap();
            let added = covariance - &alone;
            assert!(added.iter().all(|x| (x - 0.09).abs() < 1e-6), "the prior's variance, on all velocities alike");
            factors.push(factor.ln());
            scatter += after.norm_squared();
            claimed += alone.trace() + 0.09 * n as f64;
        }
        let mean = factors.iter().sum::<f64>() / factors.len() as f64;
        // each factor comes from 12 waves, with an error of sqrt(2/12) in its logarithm
        assert!((mean - 30f64.ln()).abs() < 0.25, "{}", mean.exp());
        assert!((scatter / claimed - 1.0).abs() < 0.15, "{}", scatter / claimed);
    }

    #[test]
    fn a_minimum_is_found() {
        assert!((minimum(|x| (x - 1.234).powi(2), (-3.0, 9.0)) - 1.234).abs() < 1e-3);
        assert!((minimum(|x| x, (2.0, 3.0)) - 2.0).abs() < 1e-3);
    }
}
