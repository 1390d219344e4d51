//! ln Z to second order in numbers of the epochs, velocities for example (`docs/method.md` section 9).

use nalgebra::{DMatrix, DVector};

/// `ln Z(v) = ln Z + g^T v - 1/2 v^T I v` of numbers v that change the models of the epochs by slopes `D' v`: exactly
/// so as long as the design and the slopes are those at v = 0. The numbers of one epoch are contiguous.
#[derive(Clone, Debug, PartialEq)]
pub struct Quadratic {
    /// ln Z at v = 0, all constants included.
    pub ln_evidence: f64,
    /// g = `D'^T C^-1 r`.
    pub gradient: DVector<f64>,
    /// I = `D'^T C^-1 D'`, symmetric.
    pub information: DMatrix<f64>,
}

impl Quadratic {
    /// `ln Z(v)`.
    pub fn at(&self, v: &DVector<f64>) -> f64 {
        self.ln_evidence + self.gradient.dot(v) - 0.5 * (&self.information * v).dot(v)
    }

    /// The same where numbers x of a Gaussian of this `mean` and standard deviations `sd` are added, `v + columns x`,
    /// and marginalised over. `None` where the information is not finite. An independent jitter of each number has one
    /// column each.
    pub fn integrated(&self, columns: &DMatrix<f64>, mean: &DVector<f64>, sd: &DVector<f64>) -> Option<Self> {
        let shift = columns * mean;
        let pulled_by = &self.information * &shift;
        let ln_evidence = self.ln_evidence + self.gradient.dot(&shift) - 0.5 * shift.dot(&pulled_by);
        let gradient = &self.gradient - pulled_by;
        let mut scaled = columns.clone();
        scaled.column_iter_mut().zip(sd.iter()).for_each(|(mut column, sd)| column *= *sd);
        let across = scaled.tr_mul(&self.information);
        let a = &across * &scaled + DMatrix::identity(sd.len(), sd.len());
        let factor = a.cholesky()?;
        let pulled = scaled.tr_mul(&gradient);
        let answer = factor.solve(&pulled);
        Some(Quadratic {
            ln_evidence: ln_evidence + 0.5 * pulled.dot(&answer) - 0.5 * factor.ln_determinant(),
            gradient: gradient - across.tr_mul(&answer),
            information: &self.information - across.tr_mul(&factor.solve(&across)),
        })
    }
}
