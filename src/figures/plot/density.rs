//! The density of draws in two dimensions, and the contours that contain given fractions of it.
//!
//! A histogram convolved with a Gaussian of the draws' correlation, narrowed by the number of effective draws (0.9 of
//! Scott's rule), and divided by the part of the kernel that is inside: a posterior that ends at the edge of a prior
//! keeps its height there. Along each axis its width follows from the densest part of the draws, not from their tails
//! or the distance between their modes. A contour contains its fraction of the draws themselves, because the density is
//! wider than they are.

use crate::figures::drawing::contour::{Line, contour};

/// Cells along each axis.
const CELLS: usize = 96;

/// Bandwidth over that of Scott's rule.
const NARROWED: f64 = 0.9;

/// A density on a grid.
#[derive(Clone, Debug, PartialEq)]
pub struct Density {
    /// Centres of the cells along x.
    pub x: Vec<f64>,
    /// The same along y.
    pub y: Vec<f64>,
    /// Fraction of the draws in cell (i, j), at `j * x.len() + i`; smoothed.
    share: Vec<f64>,
    /// Number of draws in each cell, not smoothed.
    counts: Vec<f64>,
}

/// Mean and covariance.
fn moments(draws: &[[f64; 2]]) -> ([f64; 2], [[f64; 2]; 2]) {
    let n = draws.len() as f64;
    let mean = [0, 1].map(|k| draws.iter().map(|d| d[k]).sum::<f64>() / n);
    let product = |a: usize, b: usize| draws.iter().map(|d| (d[a] - mean[a]) * (d[b] - mean[b])).sum::<f64>() / n;
    (mean, [[product(0, 0), product(0, 1)], [product(0, 1), product(1, 1)]])
}

/// Scale of the draws along an axis, a standard deviation for a Gaussian: the smallest of `sd`, the estimate from the
/// quartiles (tails), and that from the shortest interval with a quarter of the draws (several modes).
fn robust_scale(mut values: Vec<f64>, sd: f64) -> f64 {
    // for a Gaussian of sd 1: distance between the quartiles, and twice the quantile of 0.625
    const QUARTILES: f64 = 1.349;
    const QUARTER: f64 = 0.637;
    values.sort_unstable_by(f64::total_cmp);
    let n = values.len();
    let quartiles = values[(3 * n / 4).min(n - 1)] - values[n / 4];
    let shortest = values.windows(n / 4 + 1).map(|w| w[n / 4] - w[0]).fold(f64::INFINITY, f64::min);
    // where many draws are equal, only sd is positive
    [quartiles / QUARTILES, shortest / QUARTER].into_iter().filter(|scale| *scale > 0.0).fold(sd, f64::min)
}

impl Density {
    /// The density of `draws`, of which `effective` are independent, in the rectangle `range` (from, to; along x and
    /// y). `None` where they do not spread along both axes or the rectangle is empty.
    pub fn of(draws: &[[f64; 2]], effective: f64, range: [[f64; 2]; 2]) -> Option<Self> {
        let (_, covariance) = moments(draws);
        let step = range.map(|[low, high]| (high - low) / CELLS as f64);
        let spreads = (0..2).all(|k| covariance[k][k] > 0.0 && covariance[k][k].is_finite() && step[k] > 0.0);
        if !spreads {
            return None;
        }
        let mut histogram = vec![0.0; CELLS * CELLS];
        for draw in draws {
            let cell = [0, 1].map(|k| ((draw[k] - range[k][0]) / step[k]).floor());
            if cell.iter().all(|c| (0.0..CELLS as f64).contains(c)) {
                histogram[cell[1] as usize * CELLS + cell[0] as usize] += 1.0;
            }
        }
        let narrower = [0, 1].map(|k| {
            let sd = covariance[k][k].sqrt();
            robust_scale(draws.iter().map(|draw| draw[k]).collect(), sd) / sd
        });
        let scaled = |a: usize, b: usize| narrower[a] * narrower[b] * covariance[a][b];
        let kernel = Kernel::new([[scaled(0, 0), scaled(0, 1)], [scaled(1, 0), scaled(1, 1)]], effective, step);
        let (smoothed, inside) = (kernel.applied(&histogram), kernel.applied(&vec![1.0; CELLS * CELLS]));
        let mut share: Vec<f64> = smoothed.iter().zip(&inside).map(|(s, i)| s / i).collect();
        let total: f64 = share.iter().sum();
        share.iter_mut().for_each(|s| *s /= total);
        let centres = |k: usize| (0..CELLS).map(|i| range[k][0] + (i as f64 + 0.5) * step[k]).collect();
        (total > 0.0).then(|| Density { x: centres(0), y: centres(1), share, counts: histogram })
    }

    /// The density at which the cells of higher density contain a fraction of the draws.
    pub fn level(&self, share: f64) -> f64 {
        let mut cells: Vec<(f64, f64)> = self.share.iter().copied().zip(self.counts.iter().copied()).collect();
        cells.sort_unstable_by(|a, b| b.0.total_cmp(&a.0));
        let wanted = share * self.counts.iter().sum::<f64>();
        let mut sum = 0.0;
        let beyond = cells.iter().find(|(_, count)| {
            sum += count;
            sum >= wanted
        });
        beyond.or(cells.last()).map_or(0.0, |(density, _)| *density)
    }

    /// The contours that contain a fraction of the draws.
    pub fn contours(&self, share: f64) -> Vec<Line> {
        contour(&self.x, &self.y, |i, j| self.share[j * self.x.len() + i], self.level(share))
    }

    /// The same as closed lines: around the rectangle the density is set to zero, so that a line follows its border.
    pub fn outlines(&self, share: f64) -> Vec<Line> {
        let framed = |centres: &[f64]| {
            let half = 0.5 * (centres[1] - centres[0]);
            let (first, last) = (centres[0] - half, centres[centres.len() - 1] + half);
            std::iter::once(first).chain(centres.iter().copied()).chain([last]).collect::<Vec<f64>>()
        };
        let (x, y) = (framed(&self.x), framed(&self.y));
        let at = |i: usize, j: usize| {
            let inside = (1..x.len() - 1).contains(&i) && (1..y.len() - 1).contains(&j);
            if inside { self.at(i - 1, j - 1) } else { 0.0 }
        };
        contour(&x, &y, at, self.level(share))
    }

    /// Fraction of the draws in a cell.
    pub fn at(&self, i: usize, j: usize) -> f64 {
        self.share[j * self.x.len() + i]
    }
}

/// A Gaussian on the cells.
struct Kernel {
    reach: [isize; 2],
    weight: Vec<f64>,
}

impl Kernel {
    fn new(covariance: [[f64; 2]; 2], effective: f64, step: [f64; 2]) -> Self {
        let h2 = (NARROWED * effective.max(10.0).powf(-1.0 / 6.0)).powi(2);
        // in cells; not narrower than a cell resolves
        let cells = |a: usize, b: usize| h2 * covariance[a][b] / (step[a] * step[b]);
        let [xx, xy, yy] = [cells(0, 0) + 0.5, cells(0, 1), cells(1, 1) + 0.5];
        let determinant = xx * yy - xy * xy;
        let reach = [xx, yy].map(|variance| ((3.5 * variance.sqrt()).ceil() as isize).min(CELLS as isize));
        let mut weight = Vec::new();
        for j in -reach[1]..=reach[1] {
            for i in -reach[0]..=reach[0] {
                let (u, v) = (i as f64, j as f64);
                weight.push((-0.5 * (yy * u * u - 2.0 * xy * u * v + xx * v * v) / determinant).exp());
            }
        }
        Kernel { reach, weight }
    }

    fn applied(&self, values: &[f64]) -> Vec<f64> {
        let n = CELLS as isize;
        let mut smoothed = vec![0.0; values.len()];
        let width = 2 * self.reach[0] + 1;
        for (cell, value) in values.iter().enumerate().filter(|(_, value)| **value > 0.0) {
            let (i, j) = ((cell % CELLS) as isize, (cell / CELLS) as isize);
            for v in (-self.reach[1]).max(-j)..=self.reach[1].min(n - 1 - j) {
                let row = (v + self.reach[1]) * width + self.reach[0];
                for u in (-self.reach[0]).max(-i)..=self.reach[0].min(n - 1 - i) {
                    smoothed[((j + v) * n + i + u) as usize] += value * self.weight[(row + u) as usize];
                }
            }
        }
        smoothed
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{Rng, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use rand_distr::StandardNormal;

    fn gaussian(count: usize, correlation: f64) -> Vec<[f64; 2]> {
        let mut rng = ChaCha8Rng::seed_from_u64(4);
        let mut draw = || {
            let [a, b]: [f64; 2] = [rng.sample(StandardNormal), rng.sample(StandardNormal)];
            [a, correlation * a + (1.0 - correlation * correlation).sqrt() * b]
        };
        (0..count).map(|_| draw()).collect()
    }

    #[test]
    fn contours_of_a_gaussian_are_its_ellipses() {
        for correlation in [0.0, 0.8] {
            let density = Density::of(&gaussian(40_000, correlation), 40_000.0, [[-5.0, 5.0]; 2]).unwrap();
            for share in [0.68, 0.95] {
                // the radius that contains the fraction: 1.510 and 2.448 standard deviations
                let radius = (-2.0 * (1.0_f64 - share).ln()).sqrt();
                let lines = density.contours(share);
                let longest = lines.iter().max_by_key(|line| line.len()).unwrap();
                let distances: Vec<f64> = longest
                    .iter()
                    .map(|[x, y]| {
                        ((x * x - 2.0 * correlation * x * y + y * y) / (1.0 - correlation * correlation)).sqrt()
                    })
                    .collect();
                let mean = distances.iter().sum::<f64>() / distances.len() as f64;
                // kernel and cells widen by one to three per cent
                assert!((mean / radius - 1.0).abs() < 0.04, "{correlation} {share}: {mean} {radius}");
                // noise of the density along the contour
                assert!(distances.iter().all(|d| (d / radius - 1.0).abs() < 0.25), "{correlation} {share}");
            }
        }
    }

    /// Whether a point is within closed lines: an odd number of sides is crossed on the way out.
    fn is_within([x, y]: [f64; 2], lines: &[Line]) -> bool {
        let sides = lines.iter().flat_map(|line| line.windows(2));
        let crosses = |side: &&[[f64; 2]]| {
            let ([a, b], [c, d]) = (side[0], side[1]);
            (b > y) != (d > y) && x < a + (y - b) / (d - b) * (c - a)
        };
        sides.filter(crosses).count() % 2 == 1
    }

    /// Two narrow modes, and a mode with tails ten times as wide: the contours contain their fraction, and are no wider
    /// than the modes.
    #[test]
    fn contours_of_several_modes_and_of_tails_hold_their_share() {
        let two = |k: usize, [x, y]: [f64; 2]| if k.is_multiple_of(2) { [x, y] } else { [x + 20.0, y + 10.0] };
        let tails = |k: usize, [x, y]: [f64; 2]| if k.is_multiple_of(5) { [10.0 * x, 10.0 * y] } else { [x, y] };
        type Place<'a> = &'a dyn Fn(usize, [f64; 2]) -> [f64; 2];
        let cases: [(Place, [[f64; 2]; 2]); 2] = [(&two, [[-4.0, 24.0], [-4.0, 14.0]]), (&tails, [[-20.0, 20.0]; 2])];
        for (place, range) in cases {
            let draws: Vec<[f64; 2]> = gaussian(6_000, 0.3).into_iter().enumerate().map(|(k, d)| place(k, d)).collect();
            let inside = |d: &&[f64; 2]| (0..2).all(|k| (range[k][0]..range[k][1]).contains(&d[k]));
            let shown = draws.iter().filter(inside).count() as f64;
            let density = Density::of(&draws, 1_000.0, range).unwrap();
            for share in [0.68, 0.95] {
                let lines = density.outlines(share);
                let held = draws.iter().filter(|d| is_within(**d, &lines)).count() as f64 / shown;
                // cells along the line count as wholes
                assert!((held / share - 1.0).abs() < 0.05, "{share}: {held}");
            }
            // 68 % of a mode reach to 1.51 of its sd; the kernel adds less than a half
            let first = density.outlines(0.68);
            let left = first.iter().flatten().map(|p| p[0]).fold(f64::INFINITY, f64::min);
            assert!((-2.6..-1.2).contains(&left), "{left}");
        }
    }

    #[test]
    fn a_density_that_is_cut_off_keeps_its_height() {
        let draws: Vec<[f64; 2]> = gaussian(40_000, 0.0).into_iter().map(|[x, y]| [x.abs(), y]).collect();
        let density = Density::of(&draws, 40_000.0, [[0.0, 5.0], [-5.0, 5.0]]).unwrap();
        let (edge, inside) = (density.at(0, CELLS / 2), density.at(6, CELLS / 2));
        // at 0.026 and 0.34: exp(-0.058) = 0.94 of it
        assert!((inside / edge - 0.94).abs() < 0.1, "{}", inside / edge);
        assert!(Density::of(&[[1.0, 2.0]; 5], 5.0, [[0.0, 2.0]; 2]).is_none());
    }
}
