//! Tests of the errors of the field.

use super::*;

#[test]
fn second_derivatives_are_those_of_a_paraboloid() {
    let bend = DMatrix::from_row_slice(3, 3, &[2.0, 0.7, -0.3, 0.7, 1.5, 0.2, -0.3, 0.2, 3.0]);
    let height = |moves: &[f64]| {
        let x = nalgebra::DVector::from_column_slice(moves);
        // with a slope, which second derivatives do not see
        Some(5.0 + 0.4 * x[0] - 0.5 * x.dot(&(&bend * &x)))
    };
    let found = information(3, 5.0, height).unwrap();
    assert!((found - &bend).amax() < 1e-12);
    assert!(information(3, 5.0, |moves| (moves[1] == 0.0).then_some(1.0)).is_none());
}
