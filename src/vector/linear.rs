//! Sums and combinations of rows of numbers, as long as a map.
//!
//! Left out: matrices.

use super::{Instructions, Task};

/// Numbers that are summed side by side, whatever the instructions.
const PARTS: usize = 32;

/// Scalar product of rows of one length.
pub fn dot(a: &[f64], b: &[f64]) -> f64 {
    assert_eq!(a.len(), b.len());
    super::run(Dot { a, b })
}

/// `y += scale x`.
pub fn axpy(scale: f64, x: &[f64], y: &mut [f64]) {
    combine(y, x, |y, x| y + scale * x);
}

/// `y = f(y, x)`, number by number.
pub fn combine(y: &mut [f64], x: &[f64], f: impl Fn(f64, f64) -> f64) {
    assert_eq!(y.len(), x.len());
    super::run(Combine { y, x, f });
}

/// `z = f(z, x, y)`, number by number.
pub fn combine_two(z: &mut [f64], x: &[f64], y: &[f64], f: impl Fn(f64, f64, f64) -> f64) {
    assert!(z.len() == x.len() && z.len() == y.len());
    super::run(CombineTwo { z, x, y, f });
}

struct Dot<'a> {
    a: &'a [f64],
    b: &'a [f64],
}

impl Task for Dot<'_> {
    type Output = f64;

    #[inline(always)]
    fn run<I: Instructions>(self, i: I) -> f64 {
        let mut sums = [0.0; PARTS];
        let ((a, rest_a), (b, rest_b)) = (self.a.as_chunks::<PARTS>(), self.b.as_chunks::<PARTS>());
        for (a, b) in a.iter().zip(b) {
            for k in 0..PARTS {
                sums[k] = i.multiply_add(a[k], b[k], sums[k]);
            }
        }
        sums.iter().sum::<f64>() + rest_a.iter().zip(rest_b).map(|(a, b)| a * b).sum::<f64>()
    }
}

struct Combine<'a, F> {
    y: &'a mut [f64],
    x: &'a [f64],
    f: F,
}

impl<F: Fn(f64, f64) -> f64> Task for Combine<'_, F> {
    type Output = ();

    #[inline(always)]
    fn run<I: Instructions>(self, _: I) {
        self.y.iter_mut().zip(self.x).for_each(|(y, x)| *y = (self.f)(*y, *x));
    }
}

struct CombineTwo<'a, F> {
    z: &'a mut [f64],
    x: &'a [f64],
    y: &'a [f64],
    f: F,
}

impl<F: Fn(f64, f64, f64) -> f64> Task for CombineTwo<'_, F> {
    type Output = ();

    #[inline(always)]
    fn run<I: Instructions>(self, _: I) {
        let others = self.x.iter().zip(self.y);
        self.z.iter_mut().zip(others).for_each(|(z, (x, y))| *z = (self.f)(*z, *x, *y));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scalar_products_and_combinations_of_any_length() {
        for n in [0, 1, 31, 32, 33, 100] {
            let x: Vec<f64> = (0..n).map(f64::from).collect();
            assert_eq!(dot(&x, &vec![2.0; x.len()]), f64::from(n * (n - 1)));
            let mut y = vec![1.0; x.len()];
            axpy(3.0, &x, &mut y);
            assert!(y.iter().zip(&x).all(|(y, x)| *y == 1.0 + 3.0 * x));
            combine_two(&mut y, &x, &x, |y, a, b| y - a - 2.0 * b);
            assert!(y.iter().all(|y| *y == 1.0));
        }
    }
}
