//! Conjugate gradients for the Newton system in the entropy's metric, `(1 + lambda M) z = b` (Hestenes & Stiefel 1952;
//! truncated Newton as in Steihaug 1983: a direction of negative curvature ends it).

use crate::numerics::vector::Number;
use crate::numerics::vector::linear::{axpy, combine, dot};

/// Stopping criteria.
#[derive(Clone, Copy, Debug)]
pub(super) struct CgLimits {
    /// Residual over right-hand side, in the norm of the inverse, before the last step.
    pub tolerance: f64,
    /// Largest number of iterations.
    pub iterations: usize,
}

/// Solves `A z = b` from the start `z`; returns the number of iterations. Once the residual is small enough one more
/// step is taken, which costs no application of A, because its length is estimated, not computed.
///
/// The residual is measured against `b A^-1 b`: about `b z` where the start is good, about `b P b` where there is none.
pub(super) fn solve<N: Number>(
    mut apply: impl FnMut(&[N], &mut [N]),
    precondition: impl Fn(&[N], &mut [N]),
    b: &[N],
    z: &mut [N],
    limits: CgLimits,
) -> usize {
    let n = b.len();
    let (mut residual, mut applied, mut preconditioned) = (b.to_vec(), vec![N::default(); n], vec![N::default(); n]);
    let is_start = z.iter().any(|&z| z != N::default());
    if is_start {
        apply(z, &mut applied);
        axpy(-1.0, &applied, &mut residual);
    }
    precondition(&residual, &mut preconditioned);
    let mut rho = dot(&residual, &preconditioned);
    let mut scale = if is_start { dot(b, z) } else { rho };
    if is_start && scale <= 0.0 {
        precondition(b, &mut applied);
        scale = dot(b, &applied);
    }
    let goal = limits.tolerance * limits.tolerance * scale;
    let mut direction = preconditioned.clone();
    // not longer than for an exact preconditioner
    let mut shortest = 1.0_f64;
    for iteration in 0..limits.iterations {
        if rho <= goal {
            if iteration > 0 && rho > 0.0 {
                // a last step at no cost: its direction is known, and the shortest length so far is hardly ever too
                // long
                axpy(shortest, &direction, z);
            }
            return iteration;
        }
        apply(&direction, &mut applied);
        let curvature = dot(&direction, &applied);
        if curvature.is_nan() {
            z.fill(N::of(f64::NAN));
            return iteration + 1;
        }
        if curvature <= 0.0 {
            if iteration == 0 && !is_start {
                z.copy_from_slice(&direction);
            }
            return iteration + 1;
        }
        let length = rho / curvature;
        shortest = shortest.min(length);
        axpy(length, &direction, z);
        axpy(-length, &applied, &mut residual);
        precondition(&residual, &mut preconditioned);
        let next = dot(&residual, &preconditioned);
        let beta = N::of(next / rho);
        rho = next;
        combine(&mut direction, &preconditioned, |d, p| p + beta * d);
    }
    limits.iterations
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_last_step_for_nothing_is_worth_more_than_the_tolerance() {
        // like a preconditioned system: eigenvalues from 1 to 2
        let eigenvalues: Vec<f64> = (0..100).map(|k| 1.0 + 0.01 * f64::from(k)).collect();
        let b: Vec<f64> = (0..100).map(|k| (0.7 * f64::from(k * k)).sin()).collect();
        let mut applications = 0;
        let apply = |v: &[f64], out: &mut [f64]| {
            applications += 1;
            out.iter_mut().zip(v).zip(&eigenvalues).for_each(|((out, v), e)| *out = e * v);
        };
        let precondition = |r: &[f64], out: &mut [f64]| out.copy_from_slice(r);
        let mut z = vec![0.0; b.len()];
        let limits = CgLimits { tolerance: 0.08, iterations: 40 };
        assert_eq!(solve(apply, precondition, &b, &mut z, limits), applications);
        let errors = z.iter().zip(&b).zip(&eigenvalues).map(|((z, b), e)| e * (z - b / e).powi(2));
        let norm = b.iter().zip(&eigenvalues).map(|(b, e)| b * b / e);
        let error = (errors.sum::<f64>() / norm.sum::<f64>()).sqrt();
        assert!(applications == 2 && error < 0.02, "{error} after {applications}");
    }
}
