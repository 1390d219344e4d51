//! Tests of the uncertainties of the field.

use super::*;
use nalgebra::DVector;

fn bend() -> DMatrix<f64> {
    DMatrix::from_row_slice(3, 3, &[2.0, 0.7, -0.3, 0.7, 1.5, 0.2, -0.3, 0.2, 3.0])
}

#[test]
fn second_derivatives_are_those_of_a_paraboloid() {
    let height = |moves: &[f64]| {
        let x = DVector::from_column_slice(moves);
        // with a slope, which second derivatives ignore
        Some(5.0 + 0.4 * x[0] - 0.5 * x.dot(&(bend() * &x)))
    };
    assert!((information(3, height, false).unwrap() - DMatrix::from_diagonal(&bend().diagonal())).amax() < 1e-12);
    assert!((information(3, height, true).unwrap() - bend()).amax() < 1e-12);
    assert!(information(3, |moves| (moves[1] == 0.0).then_some(1.0), true).is_none());
}

#[test]
fn errors_are_those_of_the_inverse_and_an_open_number_has_none() {
    let top = Vector4::new(0.2_f64.ln(), 1.4, 30.0_f64.ln(), 0.0);
    let steps = vec![(0, 0.1), (1, 0.5), (2, 0.3)];
    let inverse = bend().try_inverse().unwrap();
    let errors = of(&steps, &bend(), &top);
    let [amplitude, slope, lifetime] = [0.2 * 0.1, 0.5, 30.0 * 0.3];
    let near = |found: Option<f64>, expected: f64| assert!((found.unwrap() - expected).abs() < 1e-12, "{errors:?}");
    near(errors.sigma_spot_amplitude, amplitude * inverse[(0, 0)].sqrt());
    near(errors.sigma_spot_slope, slope * inverse[(1, 1)].sqrt());
    near(errors.sigma_spot_lifetime_d, lifetime * inverse[(2, 2)].sqrt());
    // the slope given, the lifetime unconstrained
    let errors = of(&vec![(0, 0.1), (2, 0.3)], &DMatrix::from_row_slice(2, 2, &[4.0, 0.2, 0.2, 0.1]), &top);
    let near = |found: Option<f64>, expected: f64| assert!((found.unwrap() - expected).abs() < 1e-12, "{errors:?}");
    near(errors.sigma_spot_amplitude, amplitude * 0.5);
    assert_eq!((errors.sigma_spot_slope, errors.sigma_spot_lifetime_d), (None, None));
    assert_eq!(errors.unconstrained, ["spot_lifetime_d"]);
    // no uncertainties without a maximum, or for NaN
    for bad in [-1.0, f64::NAN] {
        let errors = of(&vec![(0, 0.1)], &DMatrix::from_element(1, 1, bad), &top);
        let unconstrained = vec!["spot_amplitude".to_owned()];
        assert_eq!(errors, FieldErrors { unconstrained, ..FieldErrors::default() });
    }
    let saddle = DMatrix::from_row_slice(2, 2, &[1.0, 2.0, 2.0, 1.0]);
    assert_eq!(of(&vec![(0, 0.1), (1, 0.3)], &saddle, &top), FieldErrors::default());
}
