//! The field on problems small enough for other methods: by integration over a grid, by dense algebra, by differences,
//! in limits.

use dimcmc::internals::field::{
    Compression, Degrees, Epoch, Evidence, Field, FieldError, Kernel, Lifetime, Quadratic, Spectrum,
};
use nalgebra::{DMatrix, DVector};
use std::f64::consts::TAU;

pub const EXACT: Compression = Compression { left_out: 0.0 };

/// Numbers between -0.5 and 0.5 that look random.
pub fn some(seed: usize, n: usize, m: usize) -> DMatrix<f64> {
    DMatrix::from_fn(n, m, |i, j| {
        let x = ((seed * 7919 + i * 104_729 + j * 1_299_709 + 1) as f64 * 0.618_033_988_749_895).fract();
        (x * 12_345.678).fract() - 0.5
    })
}

/// Data that are linear in a field: epochs around some coefficients, with nuisances and slopes.
pub struct Problem {
    pub field: Field,
    pub degrees: Degrees,
    pub epochs: Vec<Epoch>,
    pub around: DMatrix<f64>,
}

pub fn field(amplitude: f64, slope: f64, lifetime: Lifetime, persistent: f64) -> Field {
    Field { spectrum: Spectrum { amplitude, slope, break_degree: 0.0 }, kernel: Kernel { lifetime, persistent } }
}

impl Problem {
    /// At these times (d), some `data` numbers an epoch (one more in every other), `nuisances` and `columns` of slopes.
    fn new(field: Field, degrees: &[usize], times_d: &[f64], data: usize, nuisances: usize, columns: usize) -> Self {
        let around = some(1, degrees.len(), times_d.len()) * 0.3;
        let epoch = |(k, time_d): (usize, &f64)| {
            let n = data + k % 2;
            Epoch {
                time_d: *time_d,
                jacobian: (some(10 + k, n, degrees.len()) * 3.0).into(),
                misfit: some(100 + k, n, 1).column(0).into_owned(),
                variance: some(200 + k, n, 1).column(0).map(|x| 0.05 + 0.04 * x),
                nuisances: some(300 + k, n, nuisances) * 0.4,
                slopes: some(400 + k, n, columns),
                beside: 0.0,
                common: DMatrix::zeros(n, 0),
                divisor: DVector::zeros(0),
            }
        };
        let epochs = times_d.iter().enumerate().map(epoch).collect();
        Problem { field, degrees: degrees.to_vec().into(), epochs, around }
    }

    pub fn of_degree_3(field: Field) -> Self {
        let degrees: Vec<usize> = (1..=3).flat_map(|l| vec![l; 2 * l + 1]).collect();
        Problem::new(field, &degrees, &[0.0, 0.4, 3.0, 3.1, 9.0], 9, 2, 2)
    }

    fn evidence(&self, how: Compression) -> Evidence {
        Evidence::new(self.field, &self.degrees, &self.epochs, &self.around, how).unwrap()
    }

    fn variances(&self) -> Vec<f64> {
        self.field.spectrum.variances(&self.degrees)
    }

    fn data(&self) -> usize {
        self.epochs.iter().map(Epoch::len).sum()
    }

    /// A matrix of every epoch (its data, columns), stacked, each in its own columns.
    fn apart(&self, of: impl Fn(&Epoch) -> DMatrix<f64>) -> DMatrix<f64> {
        let blocks: Vec<DMatrix<f64>> = self.epochs.iter().map(of).collect();
        let mut all = DMatrix::zeros(self.data(), blocks.iter().map(|block| block.ncols()).sum());
        let (mut row, mut column) = (0, 0);
        for block in &blocks {
            all.view_mut((row, column), block.shape()).copy_from(block);
            (row, column) = (row + block.nrows(), column + block.ncols());
        }
        all
    }

    /// Prior covariance of all coefficients at some times with those at others, times outermost.
    pub fn prior(&self, of: &[f64], with: &[f64]) -> DMatrix<f64> {
        let (variances, h) = (self.variances(), self.degrees.len());
        DMatrix::from_fn(of.len() * h, with.len() * h, |i, j| {
            let delay = of[i / h] - with[j / h];
            if i % h == j % h { variances[i % h] * self.field.kernel.at(delay) } else { 0.0 }
        })
    }

    pub fn times(&self) -> Vec<f64> {
        self.epochs.iter().map(|epoch| epoch.time_d).collect()
    }

    /// With numbers that all epochs but the first have in common.
    pub fn with_common(mut self, numbers: usize) -> Self {
        for (k, epoch) in self.epochs.iter_mut().enumerate().skip(1) {
            epoch.common = some(500 + k, epoch.len(), numbers) * 2.0;
        }
        self
    }

    pub fn noise(&self) -> DMatrix<f64> {
        let nuisances = self.apart(|epoch| epoch.nuisances.clone());
        let variances =
            DVector::from_iterator(self.data(), self.epochs.iter().flat_map(|e| e.variance.iter().copied()));
        let numbers = self.epochs.iter().map(|epoch| epoch.common.ncols()).max().unwrap_or(0);
        let mut common = DMatrix::zeros(self.data(), numbers);
        let mut row = 0;
        for epoch in &self.epochs {
            let columns = epoch.common.ncols();
            common.view_mut((row, 0), (epoch.len(), columns)).copy_from(&epoch.common);
            row += epoch.len();
        }
        DMatrix::from_diagonal(&variances) + &nuisances * nuisances.transpose() + &common * common.transpose()
    }

    /// `J K J^T + N`.
    fn covariance(&self) -> DMatrix<f64> {
        let (design, times) = (self.design(), self.times());
        &design * self.prior(&times, &times) * design.transpose() + self.noise()
    }

    pub fn design(&self) -> DMatrix<f64> {
        self.apart(|epoch| epoch.jacobian.whole())
    }

    fn slopes(&self) -> DMatrix<f64> {
        self.apart(|epoch| epoch.slopes.clone())
    }

    fn residual(&self) -> DVector<f64> {
        let of = |(k, epoch): (usize, &Epoch)| &epoch.misfit + epoch.jacobian.times(self.around.column(k));
        let all: Vec<f64> = self.epochs.iter().enumerate().flat_map(|of_k| of(of_k).data.as_vec().clone()).collect();
        DVector::from_vec(all)
    }

    /// ln Z, gradient and information by dense algebra.
    fn dense(&self) -> Quadratic {
        let (factor, residual) = (self.covariance().cholesky().unwrap(), self.residual());
        let (dual, slopes) = (factor.solve(&residual), self.slopes());
        Quadratic {
            ln_evidence: -0.5 * (residual.dot(&dual) + factor.ln_determinant() + self.data() as f64 * TAU.ln()),
            gradient: slopes.tr_mul(&dual),
            information: slopes.tr_mul(&factor.solve(&slopes)),
        }
    }
}

/// Largest difference of ln Z, gradient and information, of the largest of each.
fn difference(a: &Quadratic, b: &Quadratic) -> f64 {
    let gradient = (&a.gradient - &b.gradient).amax() / b.gradient.amax();
    let information = (&a.information - &b.information).amax() / b.information.amax();
    ((a.ln_evidence - b.ln_evidence).abs() / b.ln_evidence.abs()).max(gradient).max(information)
}

/// ln of the integral over unknowns that are normal deviates a priori, of the likelihood of data `B u`, by the
/// trapezoidal rule on a grid: for what falls off like a Gaussian it has as many digits as the grid is fine.
fn integral(b: &DMatrix<f64>, data: &DVector<f64>, variance: &DVector<f64>, half: usize, step: f64) -> f64 {
    let unknowns = b.ncols();
    let side = 2 * half + 1;
    let mut sum = 0.0;
    for point in 0..side.pow(unknowns as u32) {
        let u = DVector::from_fn(unknowns, |d, _| ((point / side.pow(d as u32) % side) as f64 - half as f64) * step);
        let chi2 = (data - b * &u).zip_fold(variance, 0.0, |sum, x, v| sum + x * x / v);
        sum += (-0.5 * (chi2 + u.norm_squared())).exp();
    }
    let constants = variance.iter().map(|v| (TAU * v).ln()).sum::<f64>() + unknowns as f64 * TAU.ln();
    (sum * step.powi(unknowns as i32)).ln() - 0.5 * constants
}

#[test]
fn ln_z_is_the_integral_over_all_fields_and_nuisances() {
    // three coefficients that never change, seen at three times
    let fixed = Problem::new(field(0.3, 0.7, Lifetime::Static, 0.0), &[1, 1, 2], &[0.0, 1.0, 5.0], 2, 0, 0);
    let sd = DMatrix::from_diagonal(&DVector::from_vec(fixed.variances()).map(f64::sqrt));
    let design = fixed.design();
    let stacked = design.columns(0, 3) + design.columns(3, 3) + design.columns(6, 3);
    check_integral(&fixed, &(stacked * sd), 45, 0.2);
    // one coefficient at three times
    let changing = Problem::new(field(0.3, 0.7, Lifetime::Days(2.0), 0.3), &[1], &[0.0, 1.0, 5.0], 2, 0, 0);
    let prior = changing.prior(&changing.times(), &changing.times()).cholesky().unwrap().l();
    check_integral(&changing, &(changing.design() * prior), 45, 0.2);
    // one coefficient and a nuisance at two times
    let nuisances = Problem::new(field(0.2, 0.7, Lifetime::Days(2.0), 0.0), &[1], &[0.0, 1.0], 2, 1, 0);
    let prior = nuisances.prior(&nuisances.times(), &nuisances.times()).cholesky().unwrap().l();
    let (design, columns) = (nuisances.design() * prior, nuisances.apart(|epoch| epoch.nuisances.clone()));
    let both = DMatrix::from_fn(5, 4, |i, j| if j < 2 { design[(i, j)] } else { columns[(i, j - 2)] });
    check_integral(&nuisances, &both, 20, 0.35);
}

fn check_integral(problem: &Problem, b: &DMatrix<f64>, half: usize, step: f64) {
    let variance =
        DVector::from_iterator(problem.data(), problem.epochs.iter().flat_map(|e| e.variance.iter().copied()));
    let by_grid = integral(b, &problem.residual(), &variance, half, step);
    let ln_z = problem.evidence(EXACT).ln_evidence();
    // what the grid's ends and its step leave out
    assert!((ln_z - by_grid).abs() < 1e-8, "{ln_z} {by_grid}");
}

#[test]
fn everything_agrees_with_dense_algebra() {
    for kernel in [(Lifetime::Static, 0.0), (Lifetime::Days(4.0), 0.0), (Lifetime::Days(1.0), 0.4)] {
        let problem = Problem::of_degree_3(field(0.3, 0.8, kernel.0, kernel.1));
        let (evidence, dense) = (problem.evidence(EXACT), problem.dense());
        assert!(difference(evidence.quadratic(), &dense) < 1e-11, "{kernel:?}");
        check_maps(&problem, &evidence);
        // with numbers that epochs have in common, compressed and not
        let shared = problem.with_common(3);
        let evidence = shared.evidence(EXACT);
        assert!(difference(evidence.quadratic(), &shared.dense()) < 1e-11, "{kernel:?}");
        check_maps(&shared, &evidence);
        let compressed = shared.evidence(Compression { left_out: 1e-9 });
        assert!(difference(compressed.quadratic(), &shared.dense()) < 1e-6, "{kernel:?}");
    }
}

/// Mean and standard deviation of the field at epochs, between and outside.
fn check_maps(problem: &Problem, evidence: &Evidence) {
    let (h, times) = (problem.degrees.len(), [0.4, 1.7, -30.0, 12.0]);
    let points = some(7, h, 6);
    let factor = problem.covariance().cholesky().unwrap();
    let known = problem.design() * problem.prior(&problem.times(), &times);
    let mean = known.tr_mul(&factor.solve(&problem.residual()));
    let left = problem.prior(&times, &times) - known.tr_mul(&factor.solve(&known));
    let (means, errors) = (evidence.means(&points, &times), evidence.standard_deviations(&points, &times));
    for t in 0..times.len() {
        let of_time = left.view((t * h, t * h), (h, h));
        for (p, point) in points.column_iter().enumerate() {
            assert!((means[(p, t)] - point.dot(&mean.rows(t * h, h))).abs() < 1e-12);
            assert!((errors[(p, t)].powi(2) - (point.transpose() * of_time * point)[0]).abs() < 1e-12);
        }
    }
    assert!((evidence.coefficients() - evidence.coefficients_at(&problem.times())).amax() == 0.0);
}

#[test]
fn new_misfits_and_slopes_are_those_of_a_new_evidence() {
    let mut problem = Problem::of_degree_3(field(0.3, 0.8, Lifetime::Days(4.0), 0.1));
    let evidence = problem.evidence(EXACT);
    for (k, epoch) in problem.epochs.iter_mut().enumerate() {
        epoch.misfit += some(500 + k, epoch.len(), 1).column(0);
        epoch.slopes += some(600 + k, epoch.len(), 2);
    }
    let misfits: Vec<_> = problem.epochs.iter().map(|epoch| epoch.misfit.clone()).collect();
    let mut slopes: Vec<_> = problem.epochs.iter().map(|epoch| epoch.slopes.clone()).collect();
    assert!(difference(&evidence.with(&misfits, &slopes).unwrap(), &problem.dense()) < 1e-11);
    slopes[3][(1, 0)] = f64::NAN;
    assert_eq!(evidence.with(&misfits, &slopes), Err(FieldError::NotFinite { epoch: 3 }));
}

#[test]
fn ln_z_is_quadratic_in_what_slopes_change() {
    let mut problem = Problem::of_degree_3(field(0.3, 0.8, Lifetime::Days(4.0), 0.1));
    let quadratic = problem.evidence(EXACT).quadratic().clone();
    let v = some(8, 10, 1).column(0).into_owned();
    for (k, epoch) in problem.epochs.iter_mut().enumerate() {
        epoch.misfit -= &epoch.slopes * v.rows(2 * k, 2);
    }
    let moved = problem.evidence(EXACT).ln_evidence();
    assert!((quadratic.at(&v) / moved - 1.0).abs() < 1e-11);
}

#[test]
fn jitter_is_a_nuisance_along_the_slopes() {
    let mut problem = Problem::of_degree_3(field(0.3, 0.8, Lifetime::Days(4.0), 0.1));
    let without = problem.evidence(EXACT);
    let sd = [0.7, 0.2];
    problem.epochs = problem.epochs.into_iter().map(|epoch| epoch.jittered(&sd)).collect();
    assert!(problem.epochs.iter().all(|epoch| epoch.nuisances.ncols() == 4));
    let dense = problem.dense();
    assert!(difference(problem.evidence(EXACT).quadratic(), &dense) < 1e-11);
    let of_all: Vec<f64> = (0..10).map(|k| sd[k % 2]).collect();
    let jittered = |sd: Vec<f64>| {
        let own = DMatrix::identity(10, 10);
        without.quadratic().integrated(&own, &DVector::zeros(10), &DVector::from_vec(sd)).unwrap()
    };
    assert!(difference(&jittered(of_all), &dense) < 1e-11);
    assert!(difference(&jittered(vec![0.0; 10]), without.quadratic()) < 1e-15);
}

#[test]
fn derivatives_by_hyperparameters_are_differences() {
    let with = |a: f64, slope, days: f64, persistent| {
        Problem::of_degree_3(field(a.exp(), slope, Lifetime::Days(days.exp()), persistent)).evidence(EXACT)
    };
    let (at, step) = ([-1.2, 0.8, 1.3, 0.3], 1e-4);
    let got = with(at[0], at[1], at[2], at[3]).derivatives();
    for (k, got) in [got.ln_amplitude, got.slope, got.ln_lifetime, got.persistent].into_iter().enumerate() {
        let beside = |steps: f64| {
            let mut x = at;
            x[k] += steps * step;
            with(x[0], x[1], x[2], x[3]).ln_evidence()
        };
        // to fourth order
        let difference = (8.0 * (beside(1.0) - beside(-1.0)) - (beside(2.0) - beside(-2.0))) / (12.0 * step);
        assert!((got - difference).abs() < 1e-8 * (1.0 + difference.abs()), "{k}: {got} {difference}");
    }
    let fixed = Problem::of_degree_3(field(0.3, 0.8, Lifetime::Static, 0.0)).evidence(EXACT).derivatives();
    assert_eq!((fixed.ln_lifetime, fixed.persistent), (0.0, 0.0));
}

fn ln_z(amplitude: f64, lifetime: Lifetime, persistent: f64) -> f64 {
    Problem::of_degree_3(field(amplitude, 0.8, lifetime, persistent)).evidence(Compression::default()).ln_evidence()
}

#[test]
fn long_lifetimes_and_persistent_fields_are_static() {
    let fixed = ln_z(0.3, Lifetime::Static, 0.0);
    // k = 1 - a^2 / 2
    assert!((ln_z(0.3, Lifetime::Days(1e6), 0.0) - fixed).abs() < 1e-6);
    assert!((ln_z(0.3, Lifetime::Days(4.0), 1.0) - fixed).abs() < 1e-10);
    assert!((ln_z(0.3, Lifetime::Days(4.0), 0.5) - fixed).abs() > 0.1);
}

#[test]
fn without_a_field_there_is_noise_alone() {
    for amplitude in [0.0, 1e-9] {
        let mut problem = Problem::of_degree_3(field(amplitude, 0.8, Lifetime::Days(4.0), 0.0));
        problem.around.fill(0.0);
        let (noise, residual) = (problem.noise().cholesky().unwrap(), problem.residual());
        let alone =
            -0.5 * (residual.dot(&noise.solve(&residual)) + noise.ln_determinant() + problem.data() as f64 * TAU.ln());
        for how in [EXACT, Compression::default()] {
            let evidence = problem.evidence(how);
            assert!((evidence.ln_evidence() - alone).abs() < 1e-10);
            assert!(difference(evidence.quadratic(), &problem.dense()) < 1e-11);
            assert!(evidence.coefficients().amax() < 1e-12);
            assert!(evidence.standard_deviations(&some(7, 15, 3), &[0.4]).amax() < 1e-7);
        }
    }
}

#[test]
fn epochs_of_a_field_that_forgets_at_once_are_apart() {
    let problem = Problem::of_degree_3(field(0.3, 0.8, Lifetime::Days(1e-3), 0.0));
    let alone = (0..5).map(|k| {
        let around = problem.around.columns(k, 1).into_owned();
        let one = std::slice::from_ref(&problem.epochs[k]);
        Evidence::new(problem.field, &problem.degrees, one, &around, EXACT).unwrap().ln_evidence()
    });
    // the nearest two are 0.1 d apart
    assert!((problem.evidence(EXACT).ln_evidence() - alone.sum::<f64>()).abs() < 1e-10);
}

/// Profiles that are wider than their bins, whose design has singular values that fall quickly.
fn smooth(field: Field) -> Problem {
    let mut problem = Problem::new(field, &[1, 1, 1, 2, 2, 2, 2, 2], &[0.0, 1.0, 2.5, 4.0], 30, 1, 1);
    for epoch in &mut problem.epochs {
        let n = epoch.len();
        let width = DMatrix::from_fn(n, n, |i, j| (-0.02 * (i as f64 - j as f64).powi(2)).exp());
        epoch.jacobian = epoch.jacobian.after(&width).into();
    }
    problem
}

#[test]
fn compression_costs_no_more_than_it_says() {
    let mut problem = smooth(field(0.3, 0.8, Lifetime::Days(4.0), 0.0));
    // around the most probable field, where gradients do not depend on what is left out
    let (design, times) = (problem.design(), problem.times());
    for (k, epoch) in problem.epochs.iter_mut().enumerate() {
        epoch.misfit = some(900 + k, epoch.len(), 1).column(0).into_owned();
    }
    let misfit = problem.residual() - &design * DVector::from_column_slice(problem.around.as_slice());
    let pulled = design.tr_mul(&problem.noise().cholesky().unwrap().solve(&misfit));
    let around = problem.prior(&times, &times) * pulled;
    problem.around = DMatrix::from_column_slice(problem.degrees.len(), times.len(), around.as_slice());
    let exact = problem.evidence(EXACT);
    assert!((exact.coefficients() - &problem.around).amax() < 1e-11);
    for left_out in [1e-6, 1e-3, 0.1] {
        let evidence = problem.evidence(Compression { left_out });
        assert!(evidence.compressed_len() < exact.compressed_len());
        let more = evidence.ln_evidence() - exact.ln_evidence();
        assert!(more > -1e-11 && more < 0.5 * left_out * times.len() as f64, "{left_out}: {more}");
        assert!((&evidence.quadratic().gradient - &exact.quadratic().gradient).amax() < 1e-11);
        assert!((evidence.coefficients() - &problem.around).amax() < 1e-11);
        let more = &evidence.quadratic().information - &exact.quadratic().information;
        // a share of what a slope has where the field is left out
        assert!(more.amax() < left_out * exact.quadratic().information.amax(), "{left_out}: {}", more.amax());
    }
}

#[test]
fn new_misfits_are_noise_where_the_field_is_left_out() {
    let problem = smooth(field(0.3, 0.8, Lifetime::Days(4.0), 0.0));
    let new = |seed, columns| problem.epochs.iter().map(move |epoch| some(seed, epoch.len(), columns));
    let misfits: Vec<DVector<f64>> = new(41, 1).map(|misfit| misfit.column(0).into_owned()).collect();
    let slopes: Vec<DMatrix<f64>> = new(42, 1).collect();
    let [exact, told] = [0.0, 1e-8].map(|left_out| {
        let evidence = problem.evidence(Compression { left_out });
        (evidence.compressed_len(), evidence.with(&misfits, &slopes).unwrap())
    });
    assert!(told.0 < exact.0 / 2, "{} {}", told.0, exact.0);
    // the standard deviation of the field there is 1e-4 of that of the noise
    assert!(difference(&told.1, &exact.1) < 1e-4);
}

#[test]
fn what_is_no_field_or_not_finite_is_refused() {
    let mut problem = Problem::of_degree_3(field(0.3, 0.8, Lifetime::Days(4.0), 0.1));
    problem.epochs[2].variance[1] = 0.0;
    let refused = |problem: &Problem| {
        Evidence::new(problem.field, &problem.degrees, &problem.epochs, &problem.around, EXACT).unwrap_err()
    };
    assert_eq!(refused(&problem), FieldError::NotFinite { epoch: 2 });
    for (amplitude, lifetime, persistent) in [(-0.1, 4.0, 0.0), (0.1, 0.0, 0.0), (0.1, 4.0, 1.1), (f64::NAN, 4.0, 0.0)]
    {
        problem.field = field(amplitude, 0.8, Lifetime::Days(lifetime), persistent);
        assert!(matches!(refused(&problem), FieldError::NoSuchField { .. }));
    }
}

#[test]
fn numbers_beyond_sense_come_to_an_end() {
    for (size, how) in [(1e200, EXACT), (1e200, Compression::default()), (f64::MAX, Compression::default())] {
        let mut problem = Problem::of_degree_3(field(0.3, 0.8, Lifetime::Days(4.0), 0.1));
        let (data, coefficients) = problem.epochs[1].jacobian.shape();
        problem.epochs[1].jacobian = DMatrix::repeat(data, coefficients, size).into();
        assert!(Evidence::new(problem.field, &problem.degrees, &problem.epochs, &problem.around, how).is_err());
    }
    let mut problem = Problem::of_degree_3(field(0.3, 0.8, Lifetime::Days(4.0), 0.1));
    problem.around[(3, 1)] = f64::NAN;
    let refused = Evidence::new(problem.field, &problem.degrees, &problem.epochs, &problem.around, EXACT).unwrap_err();
    assert_eq!(refused, FieldError::NotFinite { epoch: 1 });
}

#[test]
fn without_data_the_field_is_as_before() {
    let mut problem = Problem::new(field(0.3, 0.8, Lifetime::Days(4.0), 0.1), &[1, 1, 1], &[0.0, 1.0], 0, 0, 1);
    // the second epoch has one datum, which the field does not touch
    problem.epochs[1].jacobian = DMatrix::zeros(1, 3).into();
    let epoch = &problem.epochs[1];
    let alone = -0.5 * (epoch.misfit[0].powi(2) / epoch.variance[0] + (TAU * epoch.variance[0]).ln());
    for how in [EXACT, Compression::default()] {
        let evidence = problem.evidence(how);
        assert!((evidence.ln_evidence() - alone).abs() < 1e-14);
        let harmonics = DMatrix::identity(3, 3);
        let sd = evidence.standard_deviations(&harmonics, &[0.5]);
        assert!(sd.iter().all(|sd| (sd - 0.3 / 3.0_f64.sqrt()).abs() < 1e-15) && evidence.coefficients().amax() == 0.0);
    }
    let nothing = Evidence::new(problem.field, &problem.degrees, &[], &DMatrix::zeros(3, 0), EXACT).unwrap();
    assert_eq!((nothing.ln_evidence(), nothing.quadratic().gradient.len()), (0.0, 0));
}

#[test]
fn numbers_that_epochs_share_are_integrated_out_as_dense_algebra_does_it() {
    let problem = Problem::of_degree_3(field(0.3, 1.2, Lifetime::Days(4.0), 0.1));
    let quadratic = problem.dense();
    // the first number of the first three epochs moves together, and so does that of the last two
    let mut columns = DMatrix::zeros(10, 2);
    (0..5).for_each(|k| columns[(2 * k, usize::from(k > 2))] = 1.0);
    let (mean, sd) = (DVector::from_vec(vec![0.2, -0.4]), DVector::from_vec(vec![0.7, 1.9]));
    let slopes = problem.slopes();
    let common = &slopes * &columns * DMatrix::from_diagonal(&sd);
    let factor = (problem.covariance() + &common * common.transpose()).cholesky().unwrap();
    let residual = problem.residual() - &slopes * &columns * &mean;
    let dual = factor.solve(&residual);
    let dense = Quadratic {
        ln_evidence: -0.5 * (residual.dot(&dual) + factor.ln_determinant() + problem.data() as f64 * TAU.ln()),
        gradient: slopes.tr_mul(&dual),
        information: slopes.tr_mul(&factor.solve(&slopes)),
    };
    let integrated = quadratic.integrated(&columns, &mean, &sd).unwrap();
    // rounding errors of two ways of the same algebra
    assert!(difference(&integrated, &dense) < 1e-10, "{}", difference(&integrated, &dense));
    // a prior of no width moves, and that is all
    let held = quadratic.integrated(&columns, &mean, &DVector::zeros(2)).unwrap();
    assert!((held.ln_evidence - quadratic.at(&(&columns * &mean))).abs() < 1e-9);
    assert!((&held.information - &quadratic.information).amax() < 1e-9 * quadratic.information.amax());
}
