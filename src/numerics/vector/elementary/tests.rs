//! Tests of the elementary functions.

use super::*;
use crate::numerics::vector::{self, Portable, Task};

struct Both(f64);

impl Task for Both {
    type Output = [f64; 3];

    #[inline(always)]
    fn run<I: Instructions>(self, i: I) -> [f64; 3] {
        let (logarithm, inverse) = ln_1p_and_inverse(i, self.0);
        [exp_minus(i, self.0), logarithm, inverse]
    }
}

struct Circular(f64);

impl Task for Circular {
    type Output = (f64, f64);

    #[inline(always)]
    fn run<I: Instructions>(self, i: I) -> Self::Output {
        sin_cos(i, self.0)
    }
}

fn assert_close(x: f64, got: f64, wanted: f64, units: f64) {
    let ulp = f64::from_bits(wanted.abs().to_bits() + 1) - wanted.abs();
    assert!((got - wanted).abs() <= units * ulp, "{x:e}: {got:e} instead of {wanted:e}");
}

#[test]
fn exponential_logarithm_and_inverse_are_those_of_the_standard_library_to_a_few_units_in_the_last_place() {
    // every decade, and densely where exponentials and logarithms are taken
    let decades = (-3000..3000).map(|k| 10_f64.powf(0.1 * f64::from(k) + 0.037));
    let dense = (0..400_000).map(|k| 1e-4 * f64::from(k));
    for x in decades.chain(dense).filter(|x| *x < 1e300) {
        for [exponential, ..] in vector::by_each(|| Both(x)) {
            assert_close(x, exponential, (-x.min(LARGEST_EXPONENT)).exp(), 2.0);
        }
        for [_, logarithm, inverse] in vector::by_each(|| Both(x)).into_iter().filter(|_| x <= 1.0) {
            assert_close(x, logarithm, x.ln_1p(), 4.0);
            assert_close(x, inverse, 1.0 / (1.0 + x), 4.0);
        }
    }
    assert_eq!(vector::run(Both(0.0)), [1.0, 0.0, 1.0]);
    assert!(vector::run(Both(f64::NAN)).iter().all(|x| x.is_nan()));
}

struct Single(f32);

impl Task for Single {
    type Output = f32;

    #[inline(always)]
    fn run<I: Instructions>(self, i: I) -> f32 {
        ln_1p_single(i, self.0)
    }
}

#[test]
fn the_logarithm_in_single_precision_is_that_of_the_standard_library_to_two_units_in_the_last_place() {
    let decades = (-300..300).map(|k| 10_f32.powf(0.1 * k as f32 + 0.037));
    let near_minus_one = (1..24).map(|k| 0.5_f32.powi(k) - 1.0).chain((1..1000).map(|k| -1e-3 * k as f32));
    for x in decades.chain((0..400_000).map(|k| 1e-4 * k as f32)).chain(near_minus_one) {
        for got in vector::by_each(|| Single(x)) {
            let wanted = f64::from(x).ln_1p();
            let ulp = f64::from(f32::EPSILON) * wanted.abs().max(f64::from(f32::MIN_POSITIVE));
            assert!((f64::from(got) - wanted).abs() <= 2.0 * ulp, "{x:e}: {got:e} instead of {wanted:e}");
        }
    }
    assert!(vector::run(Single(f32::NAN)).is_nan() && vector::run(Single(0.0)) == 0.0);
}

#[test]
fn the_nearest_integer_is_that_of_the_standard_library() {
    for x in (-4_000_000..4_000_000).step_by(997).map(|k| k as f32 + 0.37).chain([0.5, 1.5, -0.5, 32_767.5, 0.0]) {
        assert_eq!(nearest_integer(x), x.round_ties_even(), "{x}");
    }
}

#[test]
fn sine_and_cosine_are_those_of_the_standard_library_to_two_units_in_the_last_place() {
    let decades = (-300..60).map(|k| 10_f64.powf(0.1 * f64::from(k) + 0.037));
    let dense = (0..400_000).map(|k| 1e-3 * f64::from(k));
    for x in decades.chain(dense).flat_map(|x| [x, -x]) {
        for (sine, cosine) in [vector::run(Circular(x)), Circular(x).run(Portable)] {
            // near a zero of either, as precise as the reduced angle
            let close = |got: f64, wanted: f64| (got - wanted).abs() <= 4.5e-16 * wanted.abs() + 1e-22 * x.abs();
            assert!(close(sine, x.sin()) && close(cosine, x.cos()), "{x:e}: {sine:e} {cosine:e}");
        }
    }
    // a century of rotations, by two sets of instructions
    for x in (0..1000).map(|k| 3.7e7 * (1.0 + 1e-3 * f64::from(k))) {
        for (sine, cosine) in [vector::run(Circular(x)), Circular(x).run(Portable)] {
            assert!((sine - x.sin()).abs() < f64::EPSILON * x && (cosine - x.cos()).abs() < f64::EPSILON * x, "{x}");
        }
    }
    assert_eq!(vector::run(Circular(0.0)), (0.0, 1.0));
    assert!(vector::run(Circular(f64::NAN)).0.is_nan());
}
