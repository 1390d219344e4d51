//! The Voigt profile by the Faddeeva function `w(z) = exp(-z^2) erfc(-i z)`: `Re w` at `z = (v + i gamma) / (sqrt(2)
//! sigma)`.
//!
//! Weideman (1994, SIAM J. Numer. Anal. 31, 1497), a rational function accurate to 1e-13 in the upper half plane, with
//! 40 terms; far out the asymptotic series. Derivatives by `w' = -2 z w + 2i/sqrt(pi)`.

use nalgebra::Complex;
use std::f64::consts::{FRAC_2_SQRT_PI, PI, SQRT_2};
use std::sync::LazyLock;

/// Terms of the rational function.
const TERMS: usize = 40;

/// Beyond this `|z|^2` the asymptotic series is accurate to 1e-13.
const FAR: f64 = 100.0;

/// The parameter `2^(-1/4) N^(1/2)` of the rational function, and its coefficients.
static RATIONAL: LazyLock<(f64, [f64; TERMS])> = LazyLock::new(|| {
    let scale = (TERMS as f64 / SQRT_2).sqrt();
    let half = 2 * TERMS as i32;
    let coefficient = |n: usize| {
        let term = |k: i32| {
            let angle = f64::from(k) * PI / f64::from(half);
            let t2 = (scale * (0.5 * angle).tan()).powi(2);
            (-t2).exp() * (scale * scale + t2) * (n as f64 * angle).cos()
        };
        (1 - half..half).map(term).sum::<f64>() / f64::from(2 * half)
    };
    (scale, std::array::from_fn(|n| coefficient(n + 1)))
});

/// The Faddeeva function in the upper half plane.
fn faddeeva(z: Complex<f64>) -> Complex<f64> {
    let i = Complex::i();
    if z.norm_sqr() > FAR {
        // i / (sqrt(pi) z) sum_m (2m - 1)!! / (2 z^2)^m
        let q = 0.5 / (z * z);
        let series = (1..=7).rev().fold(Complex::from(1.0), |sum, m| 1.0 + q * f64::from(2 * m - 1) * sum);
        return i * 0.5 * FRAC_2_SQRT_PI * series / z;
    }
    let (scale, coefficients) = &*RATIONAL;
    let below = scale - i * z;
    let ratio = (scale + i * z) / below;
    let polynomial = coefficients.iter().rev().fold(Complex::from(0.0), |sum, a| sum * ratio + a);
    (2.0 * polynomial / below + 0.5 * FRAC_2_SQRT_PI) / below
}

/// `f`, and its fourth and sixth derivatives with respect to x, of `f(x) = Re w((x + i y) / sqrt(2))`: the Voigt
/// profile of a Gaussian of standard deviation 1 and a Lorentzian of half width y, times `sqrt(2 pi)`. Far out, where
/// both derivatives are below 1e-3, they are left out: they only enter with factors of 1e-5 and less.
pub fn even_derivatives(x: f64, y: f64) -> [f64; 3] {
    let z = Complex::new(x, y) / SQRT_2;
    let mut derivatives = [Complex::from(0.0); 7];
    derivatives[0] = faddeeva(z);
    if z.norm_sqr() > FAR {
        return [derivatives[0].re, 0.0, 0.0];
    }
    derivatives[1] = -2.0 * z * derivatives[0] + Complex::new(0.0, FRAC_2_SQRT_PI);
    for n in 1..6 {
        derivatives[n + 1] = -2.0 * (z * derivatives[n] + derivatives[n - 1] * n as f64);
    }
    [derivatives[0].re, derivatives[4].re / 4.0, derivatives[6].re / 8.0]
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

    /// The integral of a Gaussian of standard deviation 1 times `sqrt(2 pi)` and a Lorentzian of half width y at
    /// distance x, by the trapezoidal rule, which converges faster than any power of its step: in `t = x + y sinh(u)`,
    /// or in t where the peak of the Lorentzian is out of the Gaussian's reach.
    fn by_integration(x: f64, y: f64) -> f64 {
        let step = 0.01;
        if x > 10.0 {
            let at = |k: i32| {
                let t = f64::from(k) * step;
                (-0.5 * t * t).exp() * y / (PI * ((x - t).powi(2) + y * y))
            };
            return (-900..=900).map(at).sum::<f64>() * step;
        }
        let at = |k: i32| {
            let u = f64::from(k) * step;
            (-0.5 * (x + y * u.sinh()).powi(2)).exp() * u.cosh() / (1.0 + u.sinh().powi(2)) / PI
        };
        (-4000..=4000).map(at).sum::<f64>() * step
    }

    #[test]
    fn it_is_the_convolution_of_a_gaussian_and_a_lorentzian() {
        for y in [1e-3, 0.01, 0.1, 0.3, 1.0, 3.0, 10.0, 30.0] {
            for x in (0..60).map(|k| 0.3 * f64::from(k)).chain([25.0, 60.0, 300.0]) {
                let (got, wanted) = (even_derivatives(x, y)[0], by_integration(x, y));
                assert!((got - wanted).abs() < 1e-12, "x {x} y {y}: {got} {wanted}");
            }
        }
    }

    #[test]
    fn without_a_lorentzian_it_is_the_gaussian() {
        for x in (0..80).map(|k| 0.1 * f64::from(k)) {
            let gaussian = (-0.5 * x * x).exp();
            let hermite4 = (x * x - 6.0) * x * x + 3.0;
            let hermite6 = ((x * x - 15.0) * x * x + 45.0) * x * x - 15.0;
            let [f, fourth, sixth] = even_derivatives(x, 0.0);
            assert!((f - gaussian).abs() < 1e-13);
            // the recurrence loses |z|^n digits
            assert!((fourth - hermite4 * gaussian).abs() < 1e-9, "{x}: {fourth}");
            assert!((sixth - hermite6 * gaussian).abs() < 1e-7, "{x}: {sixth}");
        }
    }

    #[test]
    fn derivatives_match_differences() {
        let h = 0.05;
        for y in [0.05, 0.5, 2.0] {
            for x in (0..100).map(|k| 0.13 * f64::from(k)) {
                let f = |k: i32| even_derivatives(x + f64::from(k) * h, y);
                let second = |g: &dyn Fn(i32) -> f64| {
                    (-g(-2) + 16.0 * g(-1) - 30.0 * g(0) + 16.0 * g(1) - g(2)) / (12.0 * h * h)
                };
                let fourth = (-f(-3)[0] + 12.0 * f(-2)[0] - 39.0 * f(-1)[0] + 56.0 * f(0)[0] - 39.0 * f(1)[0]
                    + 12.0 * f(2)[0]
                    - f(3)[0])
                    / (6.0 * h.powi(4));
                // differences of fourth order in h: derivatives of order 8 are up to 105, times h^4 7/240
                assert!((f(0)[1] - fourth).abs() < 3e-4, "x {x} y {y}: {} {fourth}", f(0)[1]);
                let sixth = second(&|k| f(k)[1]);
                assert!((f(0)[2] - sixth).abs() < 3e-4, "x {x} y {y}: {} {sixth}", f(0)[2]);
            }
        }
    }

    #[test]
    fn far_out_it_is_a_lorentzian() {
        for x in [100.0f64, 1e4] {
            let lorentzian = (TAU).sqrt() * 0.5 / (PI * (x * x + 0.25));
            // second order: 3 (sigma/x)^2
            assert!((even_derivatives(x, 0.5)[0] / lorentzian - 1.0 - 3.0 / (x * x)).abs() < 20.0 / x.powi(4) + 1e-12);
        }
    }
}
