//! Random fields from the prior and from the posterior.

use super::epoch::in_common;
use super::{Compression, Degrees, Epoch, Evidence, Field, FieldError};
use nalgebra::{DMatrix, DVector};
use rand::Rng;
use rand_distr::StandardNormal;

/// Ratio to the largest variance below which variances are rounding errors.
const ROUNDING: f64 = 1e-13;

impl Field {
    /// Coefficients (H, times) of a field of harmonics of these `degrees` (H) at some times (d), from the prior.
    pub fn drawn(&self, degrees: &Degrees, times_d: &[f64], rng: &mut impl Rng) -> DMatrix<f64> {
        let correlation =
            DMatrix::from_fn(times_d.len(), times_d.len(), |j, k| self.kernel.at(times_d[j] - times_d[k]));
        // the symmetric root does not depend on the signs of eigenvectors
        let mut eigen = correlation.symmetric_eigen();
        let least = ROUNDING * eigen.eigenvalues.amax();
        eigen.eigenvalues.apply(|variance| *variance = if *variance > least { variance.sqrt() } else { 0.0 });
        let deviates = DMatrix::from_fn(degrees.len(), times_d.len(), |_, _| rng.sample::<f64, _>(StandardNormal));
        let mut coefficients: DMatrix<f64> = deviates * eigen.recompose();
        for (mut row, variance) in coefficients.row_iter_mut().zip(self.spectrum.variances(degrees)) {
            row *= variance.sqrt();
        }
        coefficients
    }
}

impl Evidence {
    /// Coefficients (H, times) at some times (d) drawn from the posterior, `epochs` being those of this evidence: a
    /// prior field, plus the most probable field of the data minus that of data simulated with the prior field
    /// (Matheron's rule).
    ///
    /// # Errors
    /// Those of [`Evidence::new`].
    pub fn drawn(
        &self,
        epochs: &[Epoch],
        how: Compression,
        times_d: &[f64],
        rng: &mut impl Rng,
    ) -> Result<DMatrix<f64>, FieldError> {
        let all: Vec<f64> = self.numbers.times_d.iter().chain(times_d).copied().collect();
        let before = self.field.drawn(&self.degrees, &all, rng);
        let common = DVector::from_fn(in_common(epochs), |_, _| rng.sample::<f64, _>(StandardNormal));
        let simulated = |(k, epoch): (usize, &Epoch)| {
            let mut normal = |n: usize| DVector::from_fn(n, |_, _| rng.sample::<f64, _>(StandardNormal));
            let noise = normal(epoch.len()).component_mul(&epoch.variance.map(f64::sqrt));
            let mut misfit =
                epoch.jacobian.times(before.column(k)) + noise + &epoch.nuisances * normal(epoch.nuisances.ncols());
            if epoch.common.ncols() > 0 {
                misfit += &epoch.common * &common;
            }
            // these data are linear in the field
            Epoch { misfit, slopes: DMatrix::zeros(epoch.len(), 0), divisor: DVector::zeros(0), ..epoch.clone() }
        };
        let simulated: Vec<Epoch> = epochs.iter().enumerate().map(simulated).collect();
        let around = DMatrix::zeros(self.degrees.len(), epochs.len());
        let of_simulated = Evidence::new(self.field, &self.degrees, &simulated, &around, how)?;
        let there = before.columns(epochs.len(), times_d.len());
        Ok(self.coefficients_at(times_d) + there - of_simulated.coefficients_at(times_d))
    }
}

#[cfg(test)]
mod tests {
    use super::super::{Kernel, Lifetime, Spectrum};
    use super::*;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    fn field() -> Field {
        let spectrum = Spectrum { amplitude: 0.5, slope: 0.9, break_degree: 0.0 };
        Field { spectrum, kernel: Kernel::of(Lifetime::Days(4.0)) }
    }

    #[test]
    fn draws_before_the_data_have_the_covariance_of_the_field() {
        let (field, degrees, times) = (field(), Degrees::from(vec![1, 1, 2]), [0.0, 1.5, 9.0]);
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let n = 20_000;
        let mut sum = DMatrix::zeros(3, 3);
        for _ in 0..n {
            let c = field.drawn(&degrees, &times, &mut rng);
            sum += c.row(0).transpose() * c.row(0) / f64::from(n);
        }
        let variance = field.spectrum.variances(&degrees)[0];
        let expected = DMatrix::from_fn(3, 3, |j, k| variance * field.kernel.at(times[j] - times[k]));
        // the standard error of a variance from 20,000 draws is 1 %
        assert!((sum - expected).amax() < 0.04 * variance);
    }

    /// Mean and standard deviation are those that the evidence has in closed form.
    #[test]
    fn draws_after_the_data_have_their_mean_and_scatter() {
        let (field, degrees) = (field(), Degrees::from(vec![1, 1, 2]));
        let mut rng = ChaCha8Rng::seed_from_u64(2);
        let mut normal = |r: usize, c: usize| DMatrix::from_fn(r, c, |_, _| rng.sample::<f64, _>(StandardNormal));
        let epoch = |(k, numbers): (usize, DMatrix<f64>)| Epoch {
            time_d: k as f64,
            jacobian: numbers.columns(0, 3).into_owned().into(),
            misfit: numbers.column(3).into_owned(),
            variance: DVector::repeat(2, 0.2),
            nuisances: numbers.columns(4, 1).into_owned(),
            beside: 0.0,
            slopes: DMatrix::zeros(2, 0),
            common: numbers.columns(5, 1).into_owned(),
            divisor: DVector::zeros(0),
        };
        let epochs: Vec<Epoch> =
            [normal(2, 6), normal(2, 6), normal(2, 6)].into_iter().enumerate().map(epoch).collect();
        let how = Compression { left_out: 0.0 };
        let evidence = Evidence::new(field, &degrees, &epochs, &DMatrix::zeros(3, 3), how).unwrap();
        let times = [1.0, 4.0];
        let n = 4_000;
        let (mut sum, mut squares) = (DMatrix::zeros(3, 2), DMatrix::zeros(3, 2));
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        for _ in 0..n {
            let c = evidence.drawn(&epochs, how, &times, &mut rng).unwrap();
            squares += c.component_mul(&c) / f64::from(n);
            sum += c / f64::from(n);
        }
        let mean = evidence.coefficients_at(&times);
        let sd = evidence.standard_deviations(&DMatrix::identity(3, 3), &times);
        let scatter = (squares - sum.component_mul(&sum)).map(f64::sqrt);
        for i in 0..6 {
            assert!((sum[i] - mean[i]).abs() < 4.0 * sd[i] / f64::from(n).sqrt(), "{sum} {mean}");
            // a standard deviation of 4,000 draws has an error of 1.1 %
            assert!((scatter[i] / sd[i] - 1.0).abs() < 0.05, "{scatter} {sd}");
        }
    }
}
