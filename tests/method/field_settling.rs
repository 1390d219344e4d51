//! The field of models that are not linear in it, on problems small enough for other methods: its position, and ln Z
//! there.

use super::field_algebra::{EXACT, Problem, field, some};
use dimcmc::internals::field::{Degrees, Epoch, FieldError, Lifetime, Settling, Sought, settle};
use nalgebra::{DMatrix, DVector};
use std::f64::consts::TAU;

/// A model that is not linear in the field.
fn bent(problem: &Problem, coefficients: &DMatrix<f64>) -> Vec<Epoch> {
    let bent = |(k, epoch): (usize, &Epoch)| {
        let c = coefficients.column(k);
        let mut jacobian = epoch.jacobian.whole();
        let straight = &jacobian * c;
        let mut epoch = epoch.clone();
        for (j, value) in straight.iter().enumerate() {
            epoch.misfit[j] -= value + 0.2 * value * value;
            jacobian.row_mut(j).scale_mut(1.0 + 0.4 * value);
        }
        Epoch { jacobian: jacobian.into(), ..epoch }
    };
    problem.epochs.iter().enumerate().map(bent).collect()
}

#[test]
fn the_most_probable_field_is_where_its_gradient_vanishes() {
    check_settled(&Problem::of_degree_3(field(0.3, 0.8, Lifetime::Days(4.0), 0.1)));
    check_settled(&Problem::of_degree_3(field(0.3, 0.8, Lifetime::Days(4.0), 0.1)).with_common(2));
}

fn check_settled(problem: &Problem) {
    let watched = some(7, 20, 15);
    let sought = Sought { field: problem.field, degrees: &problem.degrees, watched: &watched };
    let start = DMatrix::zeros(15, 5);
    let settings = Settling { tolerance: 1e-11, ..Settling::default() };
    let found = settle(|c| bent(problem, c), sought, start.clone(), None, &settings).unwrap();
    // c = K J^T N^-1 misfit
    let mut there = Problem::of_degree_3(problem.field);
    (there.epochs, there.around) = (bent(problem, &found.coefficients), found.coefficients.clone());
    let misfit: Vec<f64> = there.epochs.iter().flat_map(|epoch| epoch.misfit.data.as_vec().clone()).collect();
    let pulled = there.design().tr_mul(&there.noise().cholesky().unwrap().solve(&DVector::from_vec(misfit)));
    let c = there.prior(&there.times(), &there.times()) * pulled;
    assert!((c - DVector::from_column_slice(found.coefficients.as_slice())).amax() < 1e-9);
    // from another field's maps and covariance
    let other = Sought { field: field(0.35, 0.7, Lifetime::Days(3.0), 0.0), ..sought };
    let other = settle(|c| bent(problem, c), other, start.clone(), None, &settings).unwrap();
    let nearby = settle(|c| bent(problem, c), sought, other.coefficients, Some(&other.evidence), &settings).unwrap();
    assert!((nearby.coefficients - &found.coefficients).amax() < 1e-9);
    assert!((nearby.evidence.ln_evidence() - found.evidence.ln_evidence()).abs() < 1e-9);
    let again = settle(|c| bent(problem, c), sought, found.coefficients, Some(&found.evidence), &settings).unwrap();
    assert_eq!(again.steps, [1, 0]);
    let few = settle(|c| bent(problem, c), sought, start, None, &Settling { steps: 1, ..settings });
    assert!(matches!(few, Err(FieldError::NotSettled { steps: 1, change }) if change > 0.0));
}

/// Two epochs of a field of two coefficients, of which the model is a quotient, as a profile is of line and continuum.
#[test]
fn ln_z_of_a_model_that_is_not_linear_is_the_integral() {
    let (lines, continua, sigma) = ([some(1, 6, 2), some(2, 6, 2)], [some(3, 2, 1), some(4, 2, 1)], 0.05);
    let model = |k: usize, c: &DVector<f64>| {
        let continuum = 1.0 + 0.4 * continua[k].column(0).dot(c);
        ((&lines[k] * c).add_scalar(0.3) / continuum, continuum)
    };
    let truth = DVector::from_vec(vec![0.35, -0.2]);
    let data: Vec<DVector<f64>> =
        (0..2).map(|k| model(k, &truth).0 + some(5 + k, 6, 1).column(0) * (3.0 * sigma)).collect();
    let field = field(0.4, 0.5, Lifetime::Static, 0.0);
    let degrees = Degrees::from(vec![1, 2]);
    let linearise = |maps: &DMatrix<f64>| {
        let epoch = |k: usize| {
            let c = maps.column(k).into_owned();
            let (depth, continuum) = model(k, &c);
            let jacobian = ((&lines[k] - &depth * continua[k].column(0).transpose() * 0.4) / continuum).into();
            let (misfit, n) = (&data[k] - depth, 6);
            let variance = DVector::repeat(n, sigma * sigma);
            let [nuisances, slopes, common] = [0; 3].map(|columns| DMatrix::zeros(n, columns));
            let divisor = continua[k].column(0) * (0.4 / continuum);
            Epoch { time_d: k as f64, jacobian, misfit, variance, nuisances, beside: 0.0, slopes, common, divisor }
        };
        (0..2).map(epoch).collect()
    };
    let watched = DMatrix::identity(2, 2);
    let sought = Sought { field, degrees: &degrees, watched: &watched };
    let settled = settle(linearise, sought, DMatrix::zeros(2, 2), None, &Settling::default()).unwrap();
    // the midpoint rule over all coefficients
    let sd: Vec<f64> = field.spectrum.variances(&degrees).into_iter().map(f64::sqrt).collect();
    let (cells, reach) = (600, 6.0);
    let place = |i: usize, sd: f64| sd * reach * (2.0 * (i as f64 + 0.5) / cells as f64 - 1.0);
    let normal = |x: f64, sd: f64| (-0.5 * (x / sd).powi(2)).exp() / (sd * TAU.sqrt());
    let mut integral = 0.0;
    for (i, j) in (0..cells).flat_map(|i| (0..cells).map(move |j| (i, j))) {
        let c = DVector::from_vec(vec![place(i, sd[0]), place(j, sd[1])]);
        let prior = normal(c[0], sd[0]) * normal(c[1], sd[1]);
        let chance = |k: usize| (&data[k] - model(k, &c).0).iter().map(|r| normal(*r, sigma)).product::<f64>();
        integral += prior * chance(0) * chance(1);
    }
    let cell = (2.0 * reach / cells as f64).powi(2) * sd[0] * sd[1];
    let (found, wanted) = (settled.evidence.ln_evidence(), (integral * cell).ln());
    // what the second order of the model does within the width of the integrand
    assert!((found - wanted).abs() < 0.02, "{found}, not {wanted}");
}

/// One epoch of many coefficients: the first is the continuum's, the others those of the line. Given the first all is
/// linear, so that the integral is one over a line. The volume of the others is in proportion to the continuum.
#[test]
fn ln_z_counts_how_the_volume_of_maps_grows_with_the_continuum() {
    let (lines, n, sigma) = (some(1, 30, 30), 30, 0.003);
    let continuum = |c: &DVector<f64>| 1.0 + 0.4 * c[0];
    let depth = |c: &DVector<f64>| (&lines * c.rows(1, n)).add_scalar(0.3) / continuum(c);
    let degrees = Degrees::from(std::iter::once(1).chain(std::iter::repeat_n(2, n)).collect::<Vec<_>>());
    let field = field(0.6, 0.5, Lifetime::Static, 0.0);
    let sd: Vec<f64> = field.spectrum.variances(&degrees).into_iter().map(f64::sqrt).collect();
    let truth = DVector::from_fn(n + 1, |h, _| sd[h] * 2.0 * some(2, n + 1, 1)[h]);
    let data = depth(&truth) + some(3, n, 1).column(0) * (2.0 * sigma);
    let found = |with_divisor: bool| {
        let linearise = |maps: &DMatrix<f64>| {
            let c = maps.column(0).into_owned();
            let model = depth(&c);
            let mut jacobian = DMatrix::zeros(n, n + 1);
            jacobian.column_mut(0).copy_from(&(&model * (-0.4 / continuum(&c))));
            jacobian.columns_mut(1, n).copy_from(&(&lines / continuum(&c)));
            let mut divisor = DVector::zeros(n + 1);
            divisor[0] = 0.4 / continuum(&c);
            vec![Epoch {
                time_d: 0.0,
                jacobian: jacobian.into(),
                misfit: &data - model,
                variance: DVector::repeat(n, sigma * sigma),
                nuisances: DMatrix::zeros(n, 0),
                beside: 0.0,
                slopes: DMatrix::zeros(n, 0),
                common: DMatrix::zeros(n, 0),
                divisor: if with_divisor { divisor } else { DVector::zeros(0) },
            }]
        };
        let watched = DMatrix::identity(n + 1, n + 1);
        let sought = Sought { field, degrees: &degrees, watched: &watched };
        let settling = Settling { compression: EXACT, ..Settling::default() };
        let settled = settle(linearise, sought, DMatrix::zeros(n + 1, 1), None, &settling).unwrap();
        // where the search ended is where the field is
        assert!((settled.evidence.coefficients() - &settled.coefficients).amax() < 1e-4);
        settled.evidence.ln_evidence()
    };
    let spots = &lines * lines.transpose() * sd[1].powi(2);
    let at = |first: f64| {
        let level = 1.0 + 0.4 * first;
        let covariance = &spots + DMatrix::identity(n, n) * (level * sigma).powi(2);
        let factor = covariance.cholesky().unwrap();
        let residual = (&data * level).add_scalar(-0.3);
        let ln_normal = -0.5 * (residual.dot(&factor.solve(&residual)) + factor.ln_determinant() + n as f64 * TAU.ln());
        let prior = -0.5 * ((first / sd[0]).powi(2) + TAU.ln()) - sd[0].ln();
        (ln_normal + n as f64 * level.ln() + prior).exp()
    };
    let (cells, reach) = (4000, 7.0 * sd[0]);
    let width = 2.0 * reach / f64::from(cells);
    let wanted = ((0..cells).map(|i| at((f64::from(i) + 0.5) * width - reach) * width).sum::<f64>()).ln();
    let (with, without) = (found(true) - wanted, found(false) - wanted);
    assert!(with.abs() < 0.005 && without < -0.25, "{with}, {without} beside {wanted}");
}
