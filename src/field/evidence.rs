//! The evidence of data that are linear in a Gaussian field, and what follows from it (`docs/method.md` section 9).
//!
//! With `C = J K J^T + N` over all epochs, `K = S_h k(t - t')`, and residual `r = misfit + J c0`: `ln Z = -1/2 r^T C^-1
//! r - 1/2 ln |C| - n/2 ln 2 pi` (n data), the density of the data with all fields and nuisances integrated out. The
//! most probable coefficients are `c(t) = sum_k S k(t - t_k) J_k^T (C^-1 r)_k`; gradient and information of numbers
//! that change the model by D' are `D'^T C^-1 r` and `D'^T C^-1 D'`. All of it in units of the noise and compressed,
//! where N is 1.

use super::compress::{Compressed, Compression};
use super::dense::{self, Factor};
use super::{Epoch, Field, FieldError};
use nalgebra::{DMatrix, DVector};
use std::f64::consts::TAU;
use std::ops::Range;

/// Data with the field integrated out.
#[derive(Clone, Debug)]
pub struct Evidence {
    field: Field,
    degrees: Vec<usize>,
    /// Prior standard deviation of each coefficient (H).
    sd: Vec<f64>,
    /// Times (d) of the epochs, and where the numbers of each stand.
    times_d: Vec<f64>,
    parts: Vec<Range<usize>>,
    /// J S^(1/2) in units of the noise (n', H).
    rows: DMatrix<f64>,
    /// r (n'), and D' (n', epochs x columns).
    residual: DVector<f64>,
    slopes: DMatrix<f64>,
    /// J S J^T (n', n'), lower triangle.
    spatial: DMatrix<f64>,
    factor: Factor,
    /// C^-1 r.
    dual: DVector<f64>,
    /// Of the directions without a field: ln Z, gradient and blocks of the information.
    beside: f64,
    beside_gradient: DVector<f64>,
    beside_information: Vec<DMatrix<f64>>,
}

/// Derivatives of ln Z with respect to the hyperparameters, model and residuals held as they are linearised.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Derivatives {
    /// By ln amplitude.
    pub ln_amplitude: f64,
    /// By the slope of the spectrum.
    pub slope: f64,
    /// By ln lifetime; 0 for a static field.
    pub ln_lifetime: f64,
    /// By the persistent share.
    pub persistent: f64,
}

impl Evidence {
    /// Of epochs that are linear around the coefficients `around` (H, epochs), for a field of harmonics of these
    /// `degrees` (H).
    ///
    /// # Errors
    /// [`FieldError::NoSuchField`], [`FieldError::NotFinite`] and [`FieldError::NotPositive`]. Shapes that do not go
    /// together panic.
    pub fn new(
        field: Field,
        degrees: &[usize],
        epochs: &[Epoch],
        around: &DMatrix<f64>,
        how: Compression,
    ) -> Result<Self, FieldError> {
        field.check()?;
        assert_eq!(around.shape(), (degrees.len(), epochs.len()), "coefficients of all epochs");
        let sd: Vec<f64> = field.spectrum.variances(degrees).into_iter().map(f64::sqrt).collect();
        let compressed = epochs.iter().enumerate().map(|(k, epoch)| {
            epoch.check_shapes(degrees.len());
            let of_epoch = || Compressed::new(epoch, around.column(k), &sd, how);
            epoch.is_sound().then(of_epoch).flatten().ok_or(FieldError::NotFinite { epoch: k })
        });
        let compressed: Vec<Compressed> = compressed.collect::<Result<_, _>>()?;
        let times_d = epochs.iter().map(|epoch| epoch.time_d).collect();
        Self::of_compressed(field, degrees.to_vec(), sd, times_d, compressed)
    }

    fn of_compressed(
        field: Field,
        degrees: Vec<usize>,
        sd: Vec<f64>,
        times_d: Vec<f64>,
        epochs: Vec<Compressed>,
    ) -> Result<Self, FieldError> {
        let parts = parts(&epochs);
        let rows = stacked(&epochs, &parts, sd.len());
        let spatial = dense::gram(&rows);
        let mut covariance = spatial.clone();
        in_time(&mut covariance, &parts, &times_d, |delay| field.kernel.at(delay));
        covariance.iter_mut().step_by(rows.nrows() + 1).for_each(|variance| *variance += 1.0);
        let factor = Factor::new(covariance).ok_or(FieldError::NotPositive)?;
        let residual = DVector::from_iterator(rows.nrows(), epochs.iter().flat_map(|e| e.residual.iter().copied()));
        let dual = factor.solve(&residual);
        let of_one = |e: &Compressed| e.beside.chi2 + e.beside.ln_noise + e.beside.data as f64 * TAU.ln();
        Ok(Evidence {
            slopes: slopes(&epochs, &parts),
            beside: -0.5 * epochs.iter().map(of_one).sum::<f64>(),
            beside_gradient: stacked_gradients(&epochs),
            beside_information: epochs.into_iter().map(|e| e.beside.information).collect(),
            field,
            degrees,
            sd,
            times_d,
            parts,
            rows,
            residual,
            spatial,
            factor,
            dual,
        })
    }

    /// The field that is assumed.
    pub fn field(&self) -> &Field {
        &self.field
    }

    /// Numbers that the data of all epochs were compressed to.
    pub fn compressed_len(&self) -> usize {
        self.rows.nrows()
    }

    /// ln Z, all constants included.
    pub fn ln_evidence(&self) -> f64 {
        self.beside - 0.5 * self.residual.dot(&self.dual) - 0.5 * self.factor.ln_determinant()
    }

    /// Most probable coefficients (H, epochs) at the times of the epochs.
    pub fn coefficients(&self) -> DMatrix<f64> {
        self.coefficients_at(&self.times_d)
    }

    /// Most probable coefficients (H, times) at any times (d).
    pub fn coefficients_at(&self, times_d: &[f64]) -> DMatrix<f64> {
        let mut pulls = DMatrix::zeros(self.sd.len(), self.times_d.len());
        for (part, mut pull) in self.parts.iter().zip(pulls.column_iter_mut()) {
            pull.gemv_tr(1.0, &self.rows.rows_range(part.clone()), &self.dual.rows_range(part.clone()), 0.0);
            pull.iter_mut().zip(&self.sd).for_each(|(x, sd)| *x *= sd);
        }
        let delays = DMatrix::from_fn(self.times_d.len(), times_d.len(), |k, t| self.times_d[k] - times_d[t]);
        pulls * delays.map(|delay| self.field.kernel.at(delay))
    }

    /// Gradient `g = D'^T C^-1 r` and information `I = D'^T C^-1 D'` of ln Z in the numbers whose slopes the epochs
    /// have; those of one epoch stand together.
    pub fn gradient_and_information(&self) -> (DVector<f64>, DMatrix<f64>) {
        let gradient = self.slopes.tr_mul(&self.dual) + &self.beside_gradient;
        let mut forward = self.slopes.clone();
        self.factor.forward(&mut forward);
        let mut information = forward.transpose() * &forward;
        for (k, block) in self.beside_information.iter().enumerate() {
            let n = block.nrows();
            let mut at = information.view_mut((k * n, k * n), (n, n));
            at += block;
        }
        (gradient, information)
    }

    /// Derivatives of ln Z with respect to the hyperparameters: `1/2 a^T dC a - 1/2 tr(C^-1 dC)`, a = C^-1 r.
    pub fn derivatives(&self) -> Derivatives {
        // 1/2 (a a^T - C^-1), of which the lower triangle is used twice
        let mut pull = -self.factor.inverse();
        pull.ger(1.0, &self.dual, &self.dual, 1.0);
        pull.fill_upper_triangle(0.0, 1);
        pull.iter_mut().step_by(self.rows.nrows() + 1).for_each(|x| *x *= 0.5);
        let kernel = &self.field.kernel;
        let along = |spatial: &DMatrix<f64>, k: &dyn Fn(f64) -> f64| {
            let mut change = spatial.clone();
            in_time(&mut change, &self.parts, &self.times_d, k);
            pull.dot(&change)
        };
        let by_slope = self.field.spectrum.log_variances_by_slope(&self.degrees);
        let mut weighted = self.rows.clone();
        weighted.column_iter_mut().zip(by_slope).for_each(|(mut column, weight)| column *= weight);
        let by_slope = dense::product_with_transpose(&weighted, &self.rows);
        Derivatives {
            ln_amplitude: 2.0 * along(&self.spatial, &|delay| kernel.at(delay)),
            slope: along(&by_slope, &|delay| kernel.at(delay)),
            ln_lifetime: along(&self.spatial, &|delay| kernel.by_log_lifetime(delay)),
            persistent: along(&self.spatial, &|delay| kernel.by_persistent(delay)),
        }
    }

    /// Standard deviation of the field at points, given their harmonics (H, points), at a time (d), after the data.
    pub fn standard_deviations(&self, harmonics: &DMatrix<f64>, time_d: f64) -> Vec<f64> {
        let mut scaled = harmonics.clone();
        scaled.row_iter_mut().zip(&self.sd).for_each(|(mut row, sd)| row *= *sd);
        let mut known = &self.rows * &scaled;
        for (part, epoch_d) in self.parts.iter().zip(&self.times_d) {
            let mut rows = known.rows_range_mut(part.clone());
            rows *= self.field.kernel.at(time_d - epoch_d);
        }
        self.factor.forward(&mut known);
        let variance = scaled.column_iter().zip(known.column_iter()).map(|(before, known)| {
            // rounding may take more than there was
            (before.norm_squared() - known.norm_squared()).max(0.0)
        });
        variance.map(f64::sqrt).collect()
    }
}

/// Where the compressed numbers of each epoch stand.
fn parts(epochs: &[Compressed]) -> Vec<Range<usize>> {
    let mut end = 0;
    let part = |epoch: &Compressed| {
        end += epoch.residual.len();
        end - epoch.residual.len()..end
    };
    epochs.iter().map(part).collect()
}

/// Rows of all epochs.
fn stacked(epochs: &[Compressed], parts: &[Range<usize>], coefficients: usize) -> DMatrix<f64> {
    let mut rows = DMatrix::zeros(parts.last().map_or(0, |part| part.end), coefficients);
    for (epoch, part) in epochs.iter().zip(parts) {
        rows.rows_range_mut(part.clone()).copy_from(&epoch.rows);
    }
    rows
}

/// Slopes of all epochs, each in columns of its own.
fn slopes(epochs: &[Compressed], parts: &[Range<usize>]) -> DMatrix<f64> {
    let columns = epochs.first().map_or(0, |epoch| epoch.slopes.ncols());
    let mut slopes = DMatrix::zeros(parts.last().map_or(0, |part| part.end), columns * epochs.len());
    for (k, (epoch, part)) in epochs.iter().zip(parts).enumerate() {
        slopes.view_mut((part.start, k * columns), (part.len(), columns)).copy_from(&epoch.slopes);
    }
    slopes
}

/// Gradients beside the field, those of one epoch together.
fn stacked_gradients(epochs: &[Compressed]) -> DVector<f64> {
    DVector::from_vec(epochs.iter().flat_map(|epoch| epoch.beside.gradient.iter().copied()).collect())
}

/// Multiplies the blocks of the lower triangle of a matrix over all epochs by a function of their delay.
fn in_time(matrix: &mut DMatrix<f64>, parts: &[Range<usize>], times_d: &[f64], k: impl Fn(f64) -> f64) {
    for (column, later) in parts.iter().zip(times_d) {
        for (row, earlier) in parts.iter().zip(times_d).filter(|(row, _)| row.start >= column.start) {
            let mut block = matrix.view_range_mut(row.clone(), column.clone());
            block *= k(later - earlier);
        }
    }
}
