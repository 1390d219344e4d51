//! Real spherical harmonics of degree 1 to L, of unit mean square over the sphere.
//!
//! `Y_l0 = P_l0(sin b)`, and for m > 0 the pair `P_lm(sin b) cos(m l)`, `P_lm(sin b) sin(m l)` at longitude l and
//! latitude b, with Legendre functions normalised so that the mean of every Y^2 over the sphere is 1 (no
//! Condon-Shortley phase). Order: by degree; within one m = 0, then cosine and sine of m = 1, 2, ... Degree 0 is left
//! out: profiles do not constrain the mean level (`docs/method.md` section 9). The Legendre part is that of a whole
//! ring of points of one latitude.

use super::Degrees;
use nalgebra::DMatrix;

/// The harmonics up to a degree, with the constants of their recurrences.
#[derive(Clone, Debug, PartialEq)]
pub struct Harmonics {
    largest: usize,
    /// For each (l, m < l) in the order of [`Harmonics::legendre`]: factors of sin(b) P_(l-1)m and of P_(l-2)m.
    steps: Vec<[f64; 2]>,
}

impl Harmonics {
    /// Those of degree 1 to `largest`.
    pub fn new(largest: usize) -> Self {
        let pairs = (1..=largest).flat_map(|l| (0..=l).map(move |m| (l as f64, m as f64)));
        let step = |(l, m): (f64, f64)| {
            let over = (l - m) * (l + m);
            // of m = l the diagonal of the recurrence, from P_(l-1)(l-1)
            if over == 0.0 {
                return [if l == 1.0 { 3.0_f64.sqrt() } else { ((2.0 * l + 1.0) / (2.0 * l)).sqrt() }, 0.0];
            }
            let two_below = (2.0 * l + 1.0) * (l + m - 1.0) * (l - m - 1.0) / (over * (2.0 * l - 3.0));
            [((2.0 * l - 1.0) * (2.0 * l + 1.0) / over).sqrt(), two_below.max(0.0).sqrt()]
        };
        Harmonics { largest, steps: pairs.map(step).collect() }
    }

    /// Largest degree L.
    pub fn largest(&self) -> usize {
        self.largest
    }

    /// Number H = L (L + 2) of harmonics.
    pub fn len(&self) -> usize {
        self.largest * (self.largest + 2)
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.largest == 0
    }

    /// Degrees of the H harmonics.
    pub fn degrees(&self) -> Degrees {
        (1..=self.largest).flat_map(|l| std::iter::repeat_n(l, 2 * l + 1)).collect::<Vec<_>>().into()
    }

    /// Legendre functions `P_lm(sin b)` of all points of latitude b (rad), for l from 1 to L and in each m from 0 to l.
    pub fn legendre(&self, latitude: f64) -> Vec<f64> {
        let (sin, cos) = latitude.sin_cos();
        let mut values: Vec<f64> = Vec::with_capacity(self.steps.len());
        for l in 1..=self.largest {
            for m in 0..=l {
                let [factor, below] = self.steps[place(l, m)];
                let of = |l: usize| if l == 0 { 1.0 } else { values[place(l, m)] };
                let value = match l - m {
                    0 if l == 1 => factor * cos,
                    0 => factor * cos * values[place(l - 1, l - 1)],
                    1 => factor * sin * of(l - 1),
                    _ => factor * sin * of(l - 1) - below * of(l - 2),
                };
                values.push(value);
            }
        }
        values
    }

    /// The H harmonics at longitude `longitude` (rad) of a ring with these Legendre functions, into `out`.
    pub fn on_ring(&self, legendre: &[f64], longitude: f64, out: &mut [f64]) {
        let turns: Vec<(f64, f64)> = (0..=self.largest).map(|m| (m as f64 * longitude).sin_cos()).collect();
        let (mut read, mut write) = (0, 0);
        for l in 1..=self.largest {
            out[write] = legendre[read];
            for m in 1..=l {
                let (sin, cos) = turns[m];
                out[write + 2 * m - 1] = legendre[read + m] * cos;
                out[write + 2 * m] = legendre[read + m] * sin;
            }
            read += l + 1;
            write += 2 * l + 1;
        }
    }

    /// The harmonics (rows, H) at points (columns) of these longitudes and latitudes (rad). Neighbours of one latitude
    /// share their Legendre functions.
    pub fn at(&self, longitudes: &[f64], latitudes: &[f64]) -> DMatrix<f64> {
        assert_eq!(longitudes.len(), latitudes.len());
        let mut values = DMatrix::zeros(self.len(), longitudes.len());
        let mut ring: Option<(f64, Vec<f64>)> = None;
        for ((longitude, latitude), mut column) in longitudes.iter().zip(latitudes).zip(values.column_iter_mut()) {
            let legendre = match ring.take() {
                Some((of, legendre)) if of == *latitude => legendre,
                _ => self.legendre(*latitude),
            };
            self.on_ring(&legendre, *longitude, column.as_mut_slice());
            ring = Some((*latitude, legendre));
        }
        values
    }
}

/// Place of degree l and order m among the Legendre functions.
fn place(l: usize, m: usize) -> usize {
    l * (l + 1) / 2 - 1 + m
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::{FRAC_PI_2, PI, TAU};

    /// Points and weights that integrate polynomials with sufficient accuracy: midpoints in longitude, Gauss-Legendre
    /// in latitude.
    fn sphere(n: usize) -> (Vec<f64>, Vec<f64>, Vec<f64>) {
        let (mut longitudes, mut latitudes, mut weights) = (vec![], vec![], vec![]);
        for i in 0..n {
            // a zero of P_n by Newton
            let mut x = ((i as f64 + 0.75) / (n as f64 + 0.5) * PI).cos();
            let mut slope = 1.0;
            for _ in 0..50 {
                let (mut p, mut below) = (x, 1.0);
                for l in 2..=n {
                    (p, below) = (((2 * l - 1) as f64 * x * p - (l - 1) as f64 * below) / l as f64, p);
                }
                slope = n as f64 * (x * p - below) / (x * x - 1.0);
                x -= p / slope;
            }
            for j in 0..2 * n {
                longitudes.push((j as f64 + 0.5) * TAU / (2 * n) as f64);
                latitudes.push(x.asin());
                weights.push(1.0 / ((1.0 - x * x) * slope * slope) / (2 * n) as f64);
            }
        }
        (longitudes, latitudes, weights)
    }

    #[test]
    fn they_are_orthonormal() {
        let harmonics = Harmonics::new(36);
        let (longitudes, latitudes, weights) = sphere(38);
        assert!((weights.iter().sum::<f64>() - 1.0).abs() < 1e-13);
        let y = harmonics.at(&longitudes, &latitudes);
        let weighted = DMatrix::from_fn(weights.len(), y.nrows(), |p, h| y[(h, p)] * weights[p]);
        let error = &y * weighted - DMatrix::identity(y.nrows(), y.nrows());
        // rounding of recurrences through 36 degrees
        assert!(error.amax() < 1e-12, "{}", error.amax());
        assert_eq!((harmonics.len(), harmonics.degrees().len(), y.nrows()), (1368, 1368, 1368));
        assert!(!harmonics.is_empty() && harmonics.largest() == 36);
    }

    #[test]
    fn those_of_low_degree_are_the_known_ones() {
        let (lon, lat) = (0.7_f64, -0.4_f64);
        let y = Harmonics::new(2).at(&[lon], &[lat]);
        let (s, c) = lat.sin_cos();
        let known = [
            3.0_f64.sqrt() * s,
            3.0_f64.sqrt() * c * lon.cos(),
            3.0_f64.sqrt() * c * lon.sin(),
            5.0_f64.sqrt() * (1.5 * s * s - 0.5),
            15.0_f64.sqrt() * s * c * lon.cos(),
            15.0_f64.sqrt() * s * c * lon.sin(),
            15.0_f64.sqrt() * 0.5 * c * c * (2.0 * lon).cos(),
            15.0_f64.sqrt() * 0.5 * c * c * (2.0 * lon).sin(),
        ];
        for (value, known) in y.iter().zip(known) {
            assert!((value - known).abs() < 1e-15, "{value} {known}");
        }
    }

    #[test]
    fn squares_of_one_degree_sum_to_their_number_everywhere() {
        let harmonics = Harmonics::new(60);
        // the addition theorem, at the poles too
        for latitude in [-FRAC_PI_2, -1.5, -0.3, 0.0, 1.1, FRAC_PI_2] {
            let y = harmonics.at(&[2.1], &[latitude]);
            let mut first = 0;
            for l in 1..=60 {
                let sum: f64 = (first..first + 2 * l + 1).map(|h| y[(h, 0)].powi(2)).sum();
                assert!((sum / (2 * l + 1) as f64 - 1.0).abs() < 1e-11, "{l} {latitude}: {sum}");
                first += 2 * l + 1;
            }
        }
    }
}
