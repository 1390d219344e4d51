//! The Cholesky factor of the covariance of all epochs by a Kalman filter: time in proportion to their number
//! (`docs/method.md` section 9).
//!
//! Matern 3/2 is a state space of two numbers, value v and rate w (over `sqrt(3) / lifetime`), which are independent of
//! each other and of unit variance at any one time; `a = sqrt(3) delay / lifetime` later they are `e^-a [(1 + a) v + a
//! w]` and `e^-a [(1 - a) w - a v]`, and independent noise (Hartikainen & Sarkka 2010). The static part is a separate
//! number, and so is each number common to epochs. Innovations over their standard deviations are `L^-1` times the
//! data, for the L with `L L^T = C`, epochs in the order of time.
//!
//! States are the few directions of the coefficients that all profiles together constrain: all coefficients in units of
//! their standard deviations have the same correlation in time, so that any orthonormal directions have.

use super::Kernel;
use super::compress::with_directions;
use super::dense::{self, Factor};
use super::numbers::Numbers;
use nalgebra::{DMatrix, DMatrixView, DMatrixViewMut};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;
use rayon::prelude::*;
use std::ops::Range;

/// Largest variance, over that of the noise, of all numbers of all epochs together along directions that are left out.
const LEFT_OUT: f64 = 1e-3;

/// Directions sought at once.
const AT_ONCE: usize = 64;

/// Columns of the states' covariance that are updated at once, to stay in the cache.
const COLUMNS: usize = 32;

/// Columns that are solved for at once, whose states stay in the cache.
const SOLVED: usize = 64;

/// The factor L, an epoch at a time.
#[derive(Clone, Debug)]
pub struct Filter {
    /// In the order of time.
    steps: Vec<Step>,
    /// Elements of a state: rates, which no profile observes; then values, static numbers, common numbers.
    states: usize,
    /// Number of rates.
    rates: usize,
    /// Orthonormal directions of the coefficients that epochs constrain (H, directions).
    pub directions: DMatrix<f64>,
}

/// An epoch.
#[derive(Clone, Debug)]
struct Step {
    /// The range of its numbers.
    part: Range<usize>,
    /// Time since the previous epoch, in units of the lifetime: a.
    passed: f64,
    /// Design with respect to the state without its rates (numbers, states - rates).
    seen: DMatrix<f64>,
    /// Gain: change of the state per whitened innovation (states, numbers).
    gain: DMatrix<f64>,
    /// L of the innovation's covariance, and its inverse.
    lower: DMatrix<f64>,
    inverse: DMatrix<f64>,
}

/// Values and rates from one epoch to the next: factors of value and rate in either, and the covariance of the noise.
struct Passage {
    value: [f64; 2],
    rate: [f64; 2],
    noise: [f64; 3],
}

impl Passage {
    fn after(a: f64) -> Self {
        let e = (-a).exp();
        let (value, rate) = ([e * (1.0 + a), e * a], [-e * a, e * (1.0 - a)]);
        let dot = |x: [f64; 2], y: [f64; 2]| x[0] * y[0] + x[1] * y[1];
        Passage { value, rate, noise: [1.0 - dot(value, value), -dot(value, rate), 1.0 - dot(rate, rate)] }
    }

    /// The columns of a rate and its value in the covariance, rows and then columns: of state number `rate`, among so
    /// many rates.
    fn pair(&self, [of_rate, of_value]: [&mut [f64]; 2], rate: usize, rates: usize) {
        let value = rates + rate;
        for column in [&mut *of_rate, &mut *of_value] {
            self.column(column, rates);
        }
        mix(of_rate, of_value, self.factors());
        let [own, across, of_rates] = self.noise;
        of_rate[rate] += of_rates;
        of_rate[value] += across;
        of_value[rate] += across;
        of_value[value] += own;
    }

    /// A column of states.
    fn column(&self, column: &mut [f64], rates: usize) {
        let (rate, value) = column.split_at_mut(rates);
        mix(rate, value, self.factors());
    }

    fn factors(&self) -> [f64; 4] {
        [self.value[0], self.value[1], self.rate[0], self.rate[1]]
    }

    /// States (states, columns) an epoch later.
    fn forward(&self, states: &mut DMatrixViewMut<f64>, rates: usize) {
        mix_all(states, rates, self.factors());
    }

    /// The transpose of that.
    fn backward(&self, states: &mut DMatrixViewMut<f64>, rates: usize) {
        mix_all(states, rates, [self.value[0], self.rate[0], self.value[1], self.rate[1]]);
    }
}

/// Rates and values in place of themselves: factors of value and rate in a value, then in a rate.
fn mix(rates: &mut [f64], values: &mut [f64], [vv, vw, wv, ww]: [f64; 4]) {
    for (v, w) in values.iter_mut().zip(rates) {
        (*v, *w) = (vv * *v + vw * *w, wv * *v + ww * *w);
    }
}

/// The same of all columns of states (states, columns), rates first.
fn mix_all(states: &mut DMatrixViewMut<f64>, rates: usize, factors: [f64; 4]) {
    for mut column in states.column_iter_mut() {
        let (rates, values) = column.as_mut_slice().split_at_mut(rates);
        mix(rates, values, factors);
    }
}

/// The covariance of the states (states, states), updated in one pass per epoch.
struct Spread {
    covariance: DMatrix<f64>,
    rates: usize,
    /// Update by the previous epoch: minus `gain gain^T`.
    told: Option<DMatrix<f64>>,
}

impl Spread {
    fn new(states: usize, rates: usize) -> Self {
        Spread { covariance: DMatrix::identity(states, states), rates, told: None }
    }

    /// Goes on to the next epoch, whose design without rates is `seen` (numbers, states - rates): the covariance of the
    /// states and these numbers (states, numbers).
    fn go_on(&mut self, passage: Option<Passage>, seen: &DMatrix<f64>) -> DMatrix<f64> {
        let (states, rates) = (self.covariance.nrows(), self.rates);
        let (told, passage) = (self.told.take(), passage.filter(|_| rates > 0));
        let (told, passage) = (told.as_ref(), passage.as_ref());
        // columns of rates, of their values, and of numbers without a rate, one block of each at a time
        let block = (COLUMNS * states).max(1);
        let (of_rates, of_values) = self.covariance.as_mut_slice().split_at_mut(rates * states);
        let (of_values, alone) = of_values.split_at_mut(rates * states);
        let pairs = of_rates.chunks_mut(block).zip(of_values.chunks_mut(block)).enumerate();
        let pairs = pairs.map(|(k, (of_rates, of_values))| (k * COLUMNS, of_rates, of_values));
        let alone = alone.chunks_mut(block).enumerate().map(|(k, columns)| (rates + k * COLUMNS, &mut [][..], columns));
        let blocks: Vec<(usize, &mut [f64], &mut [f64])> = pairs.chain(alone).collect();
        let parts = blocks.into_par_iter().map(|(first, of_rates, of_values)| {
            let width = of_values.len() / states;
            if let Some(told) = told {
                for (first, columns) in [(rates + first, &mut *of_values), (first, &mut *of_rates)] {
                    if !columns.is_empty() {
                        let own = told.rows(first, width).transpose();
                        DMatrixViewMut::from_slice(columns, states, width).gemm(-1.0, told, &own, 1.0);
                    }
                }
            }
            if let Some(passage) = passage {
                for (k, value) in of_values.chunks_mut(states).enumerate() {
                    match of_rates.is_empty() {
                        true => passage.column(value, rates),
                        false => {
                            let rate = &mut of_rates[k * states..][..states];
                            passage.pair([rate, value], first + k, rates);
                        }
                    }
                }
            }
            let turned = seen.columns(first, width).transpose();
            DMatrixView::from_slice(of_values, states, width) * turned
        });
        // in the order of the blocks, whichever thread made them
        let parts: Vec<DMatrix<f64>> = parts.collect();
        parts.iter().fold(DMatrix::zeros(states, seen.nrows()), |along, part| along + part)
    }
}

impl Filter {
    /// With the directions that epochs constrain, as far as known from a nearby factor (H, directions). `None` where
    /// the covariance is not positive definite or not finite.
    pub fn new(
        Numbers { times_d, parts, rows, common }: &Numbers,
        kernel: &Kernel,
        near: Option<&DMatrix<f64>>,
    ) -> Option<Self> {
        let (directions, seen) = match near.and_then(|near| all_seen_along(rows, near)) {
            Some(found) => found,
            None => {
                let directions = seen_directions(rows)?;
                let seen = dense::product(rows, &directions);
                (directions, seen)
            }
        };
        let share = if kernel.is_static() { 1.0 } else { kernel.persistent };
        // of the evolving and the static part
        let shares: Vec<f64> = [1.0 - share, share].into_iter().filter(|share| *share > 0.0).map(f64::sqrt).collect();
        let rates = if kernel.is_static() { 0 } else { directions.ncols() };
        let width = shares.len() * directions.ncols() + common.ncols();
        let mut order: Vec<usize> = (0..parts.len()).collect();
        order.sort_by(|a, b| times_d[*a].total_cmp(&times_d[*b]));
        let mut spread = Spread::new(rates + width, rates);
        let mut steps = Vec::with_capacity(order.len());
        let mut before = None;
        for k in order {
            let part = parts[k].clone();
            let passed = before.map_or(0.0, |before| kernel.scaled(times_d[k] - before).unwrap_or(0.0));
            before = Some(times_d[k]);
            let mut sees = DMatrix::zeros(part.len(), width);
            let own = seen.rows_range(part.clone());
            for (block, share) in shares.iter().enumerate() {
                sees.columns_mut(block * own.ncols(), own.ncols()).copy_from(&(own * *share));
            }
            sees.columns_mut(width - common.ncols(), common.ncols()).copy_from(&common.rows_range(part.clone()));
            let along = spread.go_on((passed > 0.0).then(|| Passage::after(passed)), &sees);
            let mut innovation = &sees * along.rows_range(rates..);
            innovation.iter_mut().step_by(part.len() + 1).for_each(|variance| *variance += 1.0);
            let lower = innovation.cholesky()?.unpack();
            let inverse = lower.solve_lower_triangular(&DMatrix::identity(part.len(), part.len()))?;
            let gain = along * inverse.transpose();
            if !lower.diagonal().iter().all(|x| x.is_finite()) {
                return None;
            }
            spread.told = Some(gain.clone());
            steps.push(Step { part, passed, seen: sees, gain, lower, inverse });
        }
        Some(Filter { steps, states: rates + width, rates, directions })
    }

    /// Logarithm of the determinant of the covariance.
    pub fn ln_determinant(&self) -> f64 {
        self.steps.iter().map(|step| 2.0 * step.lower.diagonal().iter().map(|x| x.ln()).sum::<f64>()).sum()
    }

    /// `L^-1 B` in place of B (n, columns), where each column of B is known to be zero in its rows before `starts`,
    /// which are in ascending order.
    pub fn forward_from(&self, b: &mut DMatrix<f64>, starts: &[usize]) {
        // the first epoch in the order of time in which a column is not zero
        let first = |start: &usize| self.steps.iter().position(|step| step.part.end > *start).unwrap_or(0);
        let first: Vec<usize> = starts.iter().map(first).collect();
        let n = b.nrows();
        let blocks = b.as_mut_slice().par_chunks_mut((SOLVED * n).max(1)).zip(first.par_chunks(SOLVED));
        blocks.for_each(|(b, first)| self.forward_of(DMatrixViewMut::from_slice(b, n, first.len()), first));
    }

    /// The same for a few columns, zero before these epochs in the order of time.
    fn forward_of(&self, mut b: DMatrixViewMut<f64>, first: &[usize]) {
        let mut states = DMatrix::zeros(self.states, b.ncols());
        for (number, step) in self.steps.iter().enumerate() {
            let columns = first.partition_point(|first| *first <= number);
            let mut active = states.columns_mut(0, columns);
            if step.passed > 0.0 {
                Passage::after(step.passed).forward(&mut active, self.rates);
            }
            let mut rows = b.view_mut((step.part.start, 0), (step.part.len(), columns));
            rows.gemm(-1.0, &step.seen, &active.rows_range(self.rates..), 1.0);
            let whitened = &step.inverse * rows.clone_owned();
            rows.copy_from(&whitened);
            active.gemm(1.0, &step.gain, &whitened, 1.0);
        }
    }

    /// `L^-T B` in place of B (n, columns).
    pub fn backward(&self, b: &mut DMatrix<f64>) {
        let n = b.nrows();
        let blocks = b.as_mut_slice().par_chunks_mut((SOLVED * n).max(1));
        blocks.for_each(|b| self.backward_of(DMatrixViewMut::from_slice(b, n, b.len() / n)));
    }

    /// The same for a few columns.
    fn backward_of(&self, mut b: DMatrixViewMut<f64>) {
        let mut states = DMatrix::zeros(self.states, b.ncols());
        for step in self.steps.iter().rev() {
            let mut rows = b.rows_range_mut(step.part.clone());
            rows.gemm_tr(1.0, &step.gain, &states, 1.0);
            let whitened = step.inverse.tr_mul(&rows);
            rows.copy_from(&whitened);
            states.rows_range_mut(self.rates..).gemm_tr(-1.0, &step.seen, &whitened, 1.0);
            if step.passed > 0.0 {
                Passage::after(step.passed).backward(&mut states.as_view_mut(), self.rates);
            }
        }
    }
}

/// The directions `near` (H, directions) made orthonormal, and the projection of `rows` (n, H) on them (n, directions);
/// `None` where `rows` has more directions.
fn all_seen_along(rows: &DMatrix<f64>, near: &DMatrix<f64>) -> Option<(DMatrix<f64>, DMatrix<f64>)> {
    let mut directions = near.transpose();
    // twice, as the first pass leaves errors of the square of the condition
    for _ in 0..2 {
        let factor = Factor::new(dense::gram(&directions))?;
        factor.forward_from(&mut directions, &vec![0; near.nrows()]);
    }
    let directions = directions.transpose();
    let seen = dense::product(rows, &directions);
    (rows.norm_squared() - seen.norm_squared() <= LEFT_OUT).then_some((directions, seen))
}

/// Orthonormal directions (H, few) that contain all of `rows` (n, H) but the tolerated loss: blocks of random ones,
/// turned towards the largest by two products with `rows^T rows` (Halko, Martinsson & Tropp 2011). `None` where that is
/// not finite.
fn seen_directions(rows: &DMatrix<f64>) -> Option<DMatrix<f64>> {
    let mut products = dense::gram_of_columns(rows.as_view());
    products.fill_upper_triangle_with_lower_triangle();
    let all = products.trace();
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let coefficients = rows.ncols();
    let mut directions = DMatrix::zeros(coefficients, 0);
    let mut held = 0.0;
    while all - held > LEFT_OUT && directions.ncols() < coefficients {
        let many = AT_ONCE.min(coefficients - directions.ncols());
        let mut block = DMatrix::from_fn(coefficients, many, |_, _| rng.sample::<f64, _>(StandardNormal));
        for _ in 0..2 {
            block = &products * block;
            block = apart(&directions, block)?;
        }
        if block.ncols() == 0 {
            break;
        }
        held += block.dot(&(&products * &block));
        directions = joined(directions, &block);
    }
    all.is_finite().then_some(directions)
}

/// Orthonormal columns of the part of `block` orthogonal to `directions`; `None` where it is not finite.
fn apart(directions: &DMatrix<f64>, mut block: DMatrix<f64>) -> Option<DMatrix<f64>> {
    // twice, as the first pass leaves rounding errors of the size of the block
    for _ in 0..2 {
        let along = directions.transpose() * &block;
        block -= directions * along;
        block = with_directions(DMatrix::zeros(block.nrows(), 0), &block);
    }
    block.iter().all(|x| x.is_finite()).then_some(block)
}

fn joined(directions: DMatrix<f64>, more: &DMatrix<f64>) -> DMatrix<f64> {
    let before = directions.ncols();
    let mut all = directions.resize_horizontally(before + more.ncols(), 0.0);
    all.columns_mut(before, more.ncols()).copy_from(more);
    all
}

#[cfg(test)]
mod tests {
    use super::super::Lifetime;
    use super::*;

    /// Pseudo-random numbers, (n, m).
    fn some(n: usize, m: usize) -> DMatrix<f64> {
        DMatrix::from_fn(n, m, |i, j| ((i * 7919 + j * 104_729 + i * j * 31) % 1009) as f64 / 1009.0 - 0.5)
    }

    /// Epochs that are not in the order of time, two of them at the same time, of 3 to 5 numbers; they constrain some
    /// 20 of 100 coefficients, with falling strength.
    fn numbers() -> Numbers {
        let times_d = vec![0.0, 2.5, 1.0, 9.0, 30.0, 2.5, 31.0, 30.5];
        let of = |k: usize| {
            let fading = DMatrix::from_diagonal(&nalgebra::DVector::from_fn(20, |i, _| 100.0 * 0.5f64.powi(i as i32)));
            some(3 + k % 3, 20 + k).columns(k, 20) * fading * some(20, 100)
        };
        let rows: Vec<_> = (0..times_d.len()).map(of).collect();
        let common: Vec<_> = rows.iter().map(|rows| some(rows.nrows(), 2)).collect();
        Numbers::new(times_d, &rows, &common, 100)
    }

    fn dense_and_filter(kernel: &Kernel) -> (Factor, Filter, usize) {
        let numbers = numbers();
        let n = numbers.rows.nrows();
        (numbers.dense(numbers.spatial(), kernel).unwrap(), Filter::new(&numbers, kernel, None).unwrap(), n)
    }

    #[test]
    fn it_does_what_dense_algebra_does() {
        let changing = |persistent| Kernel { lifetime: Lifetime::Days(6.0), persistent };
        for kernel in [changing(0.0), changing(0.3), Kernel::of(Lifetime::Static), Kernel::of(Lifetime::Days(1e7))] {
            let (dense, filter, n) = dense_and_filter(&kernel);
            let (known, got) = (dense.ln_determinant(), filter.ln_determinant());
            assert!((got - known).abs() < 1e-5, "{kernel:?}: {got}, not {known}");
            // a column that begins at each number, as slopes of later and later epochs do
            let starts: Vec<usize> = (0..n).collect();
            let late = some(n, n).lower_triangle();
            let whitened = |factor: &dyn Fn(&mut DMatrix<f64>)| {
                let mut b = late.clone();
                factor(&mut b);
                b
            };
            let known = whitened(&|b| dense.forward_from(b, &starts));
            let got = whitened(&|b| filter.forward_from(b, &starts));
            // rows stand in another order of elimination, squares do not depend on it
            let (known, got) = (known.tr_mul(&known), got.tr_mul(&got));
            assert!((&got - &known).amax() < 1e-6 * known.amax(), "{kernel:?}");
            let mut b = late.clone();
            filter.forward_from(&mut b, &starts);
            filter.backward(&mut b);
            let mut plain = late.clone();
            dense.forward_from(&mut plain, &starts);
            dense.backward(&mut plain);
            assert!((&b - &plain).amax() < 1e-6 * plain.amax(), "{kernel:?}");
        }
    }

    #[test]
    fn directions_nearby_are_enough_if_they_hold_all_that_is_seen() {
        let rows = numbers().rows;
        let known = seen_directions(&rows).unwrap();
        let fewer = known.columns(0, known.ncols() / 2).into_owned();
        assert!(all_seen_along(&rows, &fewer).is_none());
        // of coefficients in other units
        let units = DMatrix::from_diagonal(&nalgebra::DVector::from_fn(100, |i, _| 1.0 + 0.05 * i as f64));
        let (directions, seen) = all_seen_along(&(&rows * &units), &(&units * known)).unwrap();
        let orthonormal = directions.tr_mul(&directions) - DMatrix::identity(directions.ncols(), directions.ncols());
        assert!(orthonormal.amax() < 1e-12);
        assert!((seen - &rows * &units * directions).amax() < 1e-9);
    }

    #[test]
    fn of_what_epochs_see_little_is_left_out() {
        let numbers = numbers();
        let directions = seen_directions(&numbers.rows).unwrap();
        let orthonormal = directions.tr_mul(&directions) - DMatrix::identity(directions.ncols(), directions.ncols());
        assert!(orthonormal.amax() < 1e-12);
        let left = &numbers.rows - &numbers.rows * &directions * directions.transpose();
        assert!(left.norm_squared() <= LEFT_OUT && directions.ncols() <= AT_ONCE, "{}", directions.ncols());
    }

    #[test]
    fn what_is_not_finite_has_no_factor() {
        let mut numbers = numbers();
        numbers.rows[(7, 3)] = f64::NAN;
        assert!(Filter::new(&numbers, &Kernel::of(Lifetime::Days(6.0)), None).is_none());
    }
}
