//! Skilling & Bryan's (1984, eq. 38) TEST of a maximum-entropy image: how far the gradients of entropy and chi2 are
//! from parallel.

use super::entropy::Entropy;
use super::problem::Problem;

/// `1/2 |grad S / |grad S| - grad C / |grad C||^2` at the image of the given coordinates, lengths by the entropy's
/// metric: 0 where the gradients are parallel, as at every maximum-entropy image, 1 where they are perpendicular; NaN
/// where one of them vanishes.
///
/// Moves `problem` to the image.
pub fn parallelism(problem: &mut impl Problem, entropy: Entropy, coordinates: &[f64]) -> f64 {
    let n = coordinates.len();
    let image = entropy.image(coordinates);
    let scale = entropy.metric(&image, problem.area());
    let towards_default = entropy.gradient(coordinates, problem.area());
    let mut misfit = vec![0.0; n];
    problem.linearise(&image);
    problem.gradient(&mut misfit);
    // the gradient of -S, so that the sum vanishes
    let product = |a: &[f64], b: &[f64]| -> f64 { (0..n).map(|p| a[p] * b[p] * f64::from(scale[p]).powi(2)).sum() };
    let (s, c) = (product(&towards_default, &towards_default).sqrt(), product(&misfit, &misfit).sqrt());
    (0..n).map(|p| (f64::from(scale[p]) * (towards_default[p] / s + misfit[p] / c)).powi(2)).sum::<f64>() / 2.0
}
