//! Sums and combinations of rows of numbers of the length of a map.

use super::{Instructions, Number, Task};

/// Number of parallel sums, whatever the instructions.
const PARTS: usize = 32;

/// The same for rows of some hundred numbers.
const FEW_PARTS: usize = 8;

/// Scalar product of rows of one length.
pub fn dot<N: Number>(a: &[N], b: &[N]) -> f64 {
    assert_eq!(a.len(), b.len());
    super::run(Dot { a, b })
}

/// Euclidean norm, summed in double precision.
pub fn norm<N: Number>(x: &[N]) -> f64 {
    super::run(Norm { x })
}

/// Scalar products of `x`, its numbers times `weights`, with rows of its length, in double precision.
pub fn weighted_dots<N: Number, const ROWS: usize>(x: &[f32], weights: &[f32], rows: [&[N]; ROWS]) -> [f64; ROWS] {
    assert!(x.len() == weights.len() && rows.iter().all(|row| row.len() == x.len()));
    super::run(WeightedDots { x, weights, rows })
}

/// `unit x` in single precision.
pub fn rounded(x: &[f64], unit: f64) -> Vec<f32> {
    let mut single = vec![0.0; x.len()];
    combine(&mut single, x, |_, x| (unit * x) as f32);
    single
}

/// `x` in double precision.
pub fn widened(x: &[f32]) -> Vec<f64> {
    let mut double = vec![0.0; x.len()];
    combine(&mut double, x, |_, x| f64::from(x));
    double
}

/// `x = factor x`.
pub fn scale_by<N: Number>(factor: f64, x: &mut [N]) {
    super::run(Scale { factor: N::of(factor), x });
}

/// `y += scale x`.
pub fn axpy<N: Number>(scale: f64, x: &[N], y: &mut [N]) {
    let scale = N::of(scale);
    combine(y, x, |y, x| y + scale * x);
}

/// `y = f(y, x)`, number by number.
pub fn combine<N: Number, M: Number>(y: &mut [N], x: &[M], f: impl Fn(N, M) -> N) {
    assert_eq!(y.len(), x.len());
    super::run(Combine { y, x, f });
}

/// `f(x, y)`, number by number.
pub fn combined<N: Number>(x: &[N], y: &[N], f: impl Fn(N, N) -> N) -> Vec<N> {
    let mut z = x.to_vec();
    combine(&mut z, y, f);
    z
}

/// `z = f(z, x, y)`, number by number.
pub fn combine_two<N: Number, M: Number>(z: &mut [N], x: &[M], y: &[M], f: impl Fn(N, M, M) -> N) {
    assert!(z.len() == x.len() && z.len() == y.len());
    super::run(CombineTwo { z, x, y, f });
}

struct Dot<'a, N> {
    a: &'a [N],
    b: &'a [N],
}

impl<N: Number> Task for Dot<'_, N> {
    type Output = f64;

    #[inline(always)]
    fn run<I: Instructions>(self, i: I) -> f64 {
        in_parts::<N, PARTS>(i, self.a, self.b)
    }
}

/// Scalar product of short rows within a task.
#[inline(always)]
pub fn short_dot(i: impl Instructions, a: &[f64], b: &[f64]) -> f64 {
    in_parts::<f64, FEW_PARTS>(i, a, b)
}

#[inline(always)]
fn in_parts<N: Number, const PARTS: usize>(i: impl Instructions, a: &[N], b: &[N]) -> f64 {
    let mut sums = [N::default(); PARTS];
    let ((a, rest_a), (b, rest_b)) = (a.as_chunks::<PARTS>(), b.as_chunks::<PARTS>());
    for (n, a) in a.iter().enumerate() {
        let b = &b[n];
        for k in 0..PARTS {
            sums[k] = N::multiply_add(i, a[k], b[k], sums[k]);
        }
    }
    let rest = rest_a.iter().zip(rest_b).map(|(a, b)| *a * *b);
    sums.into_iter().map(Into::into).sum::<f64>() + rest.map(Into::into).sum::<f64>()
}

struct Norm<'a, N> {
    x: &'a [N],
}

impl<N: Number> Task for Norm<'_, N> {
    type Output = f64;

    #[inline(always)]
    fn run<I: Instructions>(self, i: I) -> f64 {
        let (mut sums, (x, rest)) = ([0.0; PARTS], self.x.as_chunks::<PARTS>());
        for x in x {
            for k in 0..PARTS {
                let x: f64 = x[k].into();
                sums[k] = i.multiply_add(x, x, sums[k]);
            }
        }
        let rest = rest.iter().map(|&x| Into::<f64>::into(x).powi(2));
        (sums.into_iter().sum::<f64>() + rest.sum::<f64>()).sqrt()
    }
}

struct WeightedDots<'a, N, const ROWS: usize> {
    x: &'a [f32],
    weights: &'a [f32],
    rows: [&'a [N]; ROWS],
}

impl<N: Number, const ROWS: usize> Task for WeightedDots<'_, N, ROWS> {
    type Output = [f64; ROWS];

    #[inline(always)]
    fn run<I: Instructions>(self, i: I) -> Self::Output {
        let WeightedDots { x, weights, rows } = self;
        let ((chunks, rest), (chunk_weights, rest_weights)) = (x.as_chunks::<PARTS>(), weights.as_chunks::<PARTS>());
        let (chunk_rows, rest_rows) =
            (rows.map(|row| row.as_chunks::<PARTS>().0), rows.map(|row| row.as_chunks::<PARTS>().1));
        let mut sums = [[0.0; PARTS]; ROWS];
        for (c, (x, weights)) in chunks.iter().zip(chunk_weights).enumerate() {
            for (sums, row) in sums.iter_mut().zip(chunk_rows) {
                let row = &row[c];
                for k in 0..PARTS {
                    sums[k] = i.multiply_add(f64::from(x[k]) * f64::from(weights[k]), row[k].into(), sums[k]);
                }
            }
        }
        let mut totals = [0.0; ROWS];
        for ((total, sums), row) in totals.iter_mut().zip(sums).zip(rest_rows) {
            let rest = rest.iter().zip(rest_weights).zip(row);
            let rest = rest.map(|((x, weight), row)| f64::from(*x) * f64::from(*weight) * (*row).into());
            *total = sums.into_iter().sum::<f64>() + rest.sum::<f64>();
        }
        totals
    }
}

struct Scale<'a, N> {
    factor: N,
    x: &'a mut [N],
}

impl<N: Number> Task for Scale<'_, N> {
    type Output = ();

    #[inline(always)]
    fn run<I: Instructions>(self, _: I) {
        self.x.iter_mut().for_each(|x| *x = self.factor * *x);
    }
}

struct Combine<'a, N, M, F> {
    y: &'a mut [N],
    x: &'a [M],
    f: F,
}

impl<N: Number, M: Number, F: Fn(N, M) -> N> Task for Combine<'_, N, M, F> {
    type Output = ();

    #[inline(always)]
    fn run<I: Instructions>(self, _: I) {
        let x = &self.x[..self.y.len()];
        for (n, y) in self.y.iter_mut().enumerate() {
            *y = (self.f)(*y, x[n]);
        }
    }
}

struct CombineTwo<'a, N, M, F> {
    z: &'a mut [N],
    x: &'a [M],
    y: &'a [M],
    f: F,
}

impl<N: Number, M: Number, F: Fn(N, M, M) -> N> Task for CombineTwo<'_, N, M, F> {
    type Output = ();

    #[inline(always)]
    fn run<I: Instructions>(self, _: I) {
        let (x, y) = (&self.x[..self.z.len()], &self.y[..self.z.len()]);
        for (n, z) in self.z.iter_mut().enumerate() {
            *z = (self.f)(*z, x[n], y[n]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scalar_products_and_combinations_of_any_length() {
        of_any_length::<f64>();
        of_any_length::<f32>();
    }

    #[test]
    fn weighted_scalar_products_of_any_length() {
        for n in [0, 1, 31, 32, 33, 100] {
            let x: Vec<f32> = (0..n).map(|k| k as f32).collect();
            let (twos, rows) = (vec![2.0; n], [vec![1.0; n], (0..n).map(|k| 0.1 * k as f64).collect::<Vec<f64>>()]);
            let [sum, of_squares] = weighted_dots(&x, &twos, [&rows[0], &rows[1]]);
            let squares: f64 = (0..n).map(|k| (k * k) as f64).sum();
            assert!(
                sum == (n * n.saturating_sub(1)) as f64
                    && (of_squares - 0.2 * squares).abs() < 1e-12 * squares.max(1.0)
            );
        }
    }

    #[test]
    fn from_one_precision_to_the_other() {
        let x: Vec<f64> = (0..33).map(|k| 0.1 * f64::from(k)).collect();
        let mut single = rounded(&x, 3.0);
        assert!(single.iter().zip(&x).all(|(single, x)| *single == (3.0 * x) as f32));
        scale_by(0.5, &mut single);
        assert!(widened(&single).iter().zip(&x).all(|(wide, x)| *wide == f64::from(0.5 * (3.0 * x) as f32)));
    }

    fn of_any_length<N: Number>() {
        for n in [0, 1, 31, 32, 33, 100] {
            let x: Vec<N> = (0..n).map(|i| N::of(f64::from(i))).collect();
            assert_eq!(dot(&x, &vec![N::of(2.0); x.len()]), f64::from(n * (n - 1)));
            // squares beyond the range of single precision
            let large: Vec<N> = x.iter().map(|x| N::of(1e30) * *x).collect();
            let squares: f64 = x.iter().map(|&x| Into::<f64>::into(x).powi(2)).sum();
            assert!((norm(&large) - 1e30 * squares.sqrt()).abs() <= 1e-6 * norm(&large));
            let mut y = vec![N::of(1.0); x.len()];
            axpy(3.0, &x, &mut y);
            assert!(y.iter().zip(&x).all(|(y, x)| (*y).into() == 1.0 + 3.0 * (*x).into()));
            combine_two(&mut y, &x, &x, |y, a, b| y - a - N::of(2.0) * b);
            assert!(y.iter().all(|y| *y == N::of(1.0)));
            assert!(combined(&x, &y, |x, y| x - y).iter().zip(&x).all(|(z, x)| *z == *x - N::of(1.0)));
        }
    }
}
