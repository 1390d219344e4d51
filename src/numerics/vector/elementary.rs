//! Exponential, logarithm, sine and cosine for loops that are compiled into vector instructions: without branches, to
//! two units in the last place unless noted; and rounding.
//!
//! Reduction and polynomials are those of fdlibm (Sun Microsystems 1993) for sine, cosine and the logarithm in single
//! precision, and the series to r^13 over |r| < ln(2)/2 for the exponential.

use super::Instructions;

/// ln 2 in two parts: the first is exact times any exponent.
const LN_2: [f64; 2] = [6.931_471_803_691_238e-1, 1.908_214_929_270_587_7e-10];

/// The same for single precision.
const SINGLE_LN_2: [f32; 2] = [6.931_381e-1, 9.058_001e-6];

/// 2^52: from here on neighbouring numbers are integers, which are in their last bits.
pub const INTEGERS: f64 = 4_503_599_627_370_496.0;

/// 2^23: the same in single precision.
pub const SINGLE_INTEGERS: f32 = 8_388_608.0;

/// 2^52 and half as much: the sum with a number below 2^51 ends in that number, rounded to an integer.
const ROUND: f64 = 6_755_399_441_055_744.0;

/// The same in single precision, for numbers below 2^22.
const SINGLE_ROUND: f32 = 12_582_912.0;

/// Beyond it e^-x is not a normal number.
const LARGEST_EXPONENT: f64 = 708.0;

/// pi / 2 in three parts: the first two are exact times any integer below 2^20.
const HALF_PI: [f64; 3] = [1.570_796_326_734_125_6, 6.077_100_506_303_966e-11, 2.022_266_248_795_950_6e-21];

/// Coefficients of `(sin r - r) / r^3` in r^2, over |r| < pi/4.
const SINE: [f64; 6] = [
    -1.666_666_666_666_663_2e-1,
    8.333_333_333_322_49e-3,
    -1.984_126_982_985_795e-4,
    2.755_731_370_707_006_8e-6,
    -2.505_076_025_340_686_3e-8,
    1.589_690_995_211_55e-10,
];

/// Coefficients of `(cos r - 1 + r^2/2) / r^4` in r^2.
const COSINE: [f64; 6] = [
    4.166_666_666_666_66e-2,
    -1.388_888_888_887_411e-3,
    2.480_158_728_947_673e-5,
    -2.755_731_435_139_066_3e-7,
    2.087_572_321_298_175e-9,
    -1.135_964_755_778_819_5e-11,
];

/// Coefficients of `(ln((1 + s) / (1 - s)) / (2 s) - 1) / s^2` in s^2, over 0 < s < 1/3: the interpolation at
/// Chebyshev's points, which is off by 5e-17.
const LOGARITHM: [f64; 10] = [
    0.333_333_333_333_333_3,
    0.200_000_000_000_072_92,
    0.142_857_142_835_543_8,
    0.111_111_113_587_139_32,
    0.090_908_947_180_664_29,
    0.076_927_850_324_793_12,
    0.066_570_721_048_274_68,
    0.060_005_364_047_953_56,
    0.044_003_692_430_723_37,
    0.080_820_228_059_717_66,
];

/// Coefficients of `(ln((1 + s) / (1 - s)) - 2 s) / s` in s^2, for single precision.
const SINGLE_LOGARITHM: [f32; 4] = [6.666_666e-1, 4.000_097e-1, 2.849_879e-1, 2.427_908e-1];

/// 1/2!, 1/3!, ... 1/13!.
const EXPONENTIAL: [f64; 12] = {
    let mut coefficients = [0.5; 12];
    let mut n = 1;
    while n < 12 {
        coefficients[n] = coefficients[n - 1] / (n + 2) as f64;
        n += 1;
    }
    coefficients
};

/// `c_0 + c_1 x + ...`
#[inline(always)]
fn polynomial<const N: usize>(i: impl Instructions, coefficients: &[f64; N], x: f64) -> f64 {
    let mut sum = coefficients[N - 1];
    for c in coefficients[..N - 1].iter().rev() {
        sum = i.multiply_add(sum, x, *c);
    }
    sum
}

/// The nearest integer of a number between -2^22 and 2^22, the even one of two.
#[inline(always)]
pub fn nearest_integer(x: f32) -> f32 {
    (x + SINGLE_ROUND) - SINGLE_ROUND
}

/// `e^-x` for x >= 0; that of 708 beyond it.
#[inline(always)]
pub fn exp_minus(i: impl Instructions, x: f64) -> f64 {
    let x = if x > LARGEST_EXPONENT { LARGEST_EXPONENT } else { x };
    let rounded = i.multiply_add(-x, std::f64::consts::LOG2_E, ROUND);
    let exponent = rounded - ROUND;
    let r = i.multiply_add(-exponent, LN_2[1], i.multiply_add(-exponent, LN_2[0], -x));
    let more = i.multiply_add(r * r, polynomial(i, &EXPONENTIAL, r), r);
    // the exponent is in the last bits of the rounded sum
    (1.0 + more) * f64::from_bits((rounded.to_bits() << 52).wrapping_add(1.0_f64.to_bits()))
}

/// `ln(1 + x)` and `1 / (1 + x)` for x from 0 to 1, to four units in the last place, with one division.
#[inline(always)]
pub fn ln_1p_and_inverse(i: impl Instructions, x: f64) -> (f64, f64) {
    let (y, z) = (1.0 + x, 2.0 + x);
    let per_both = 1.0 / (y * z);
    // (1 + s) / (1 - s) is 1 + x
    let s = x * (y * per_both);
    let (twice, square) = (s + s, s * s);
    (i.multiply_add(twice * square, polynomial(i, &LOGARITHM, square), twice), z * per_both)
}

/// `ln(1 + x)` in single precision, for x > -1.
#[inline(always)]
pub fn ln_1p_single(i: impl Instructions, x: f32) -> f32 {
    const HALF_ROOT: u32 = std::f32::consts::FRAC_1_SQRT_2.to_bits();
    const MANTISSA: u32 = (1 << 23) - 1;
    let y = 1.0 + x;
    let bits = y.to_bits().wrapping_add(1.0_f32.to_bits() - HALF_ROOT);
    let exponent = f32::from_bits((bits >> 23) | SINGLE_INTEGERS.to_bits()) - (SINGLE_INTEGERS + 127.0);
    let mantissa = f32::from_bits((bits & MANTISSA) + HALF_ROOT);
    let lost = if x > 1.0 { 1.0 - (y - x) } else { x - (y - 1.0) };
    let (f, lost) = if exponent == 0.0 { (x, 0.0) } else { (mantissa - 1.0, lost) };
    let per_both = 1.0 / (y * (2.0 + f));
    let s = f * (y * per_both);
    let (square, half) = (s * s, 0.5 * f * f);
    let mut sum = SINGLE_LOGARITHM[SINGLE_LOGARITHM.len() - 1];
    for c in SINGLE_LOGARITHM[..SINGLE_LOGARITHM.len() - 1].iter().rev() {
        sum = i.multiply_add_single(sum, square, *c);
    }
    let rest = s * (half + square * sum) + (exponent * SINGLE_LN_2[1] + lost * ((2.0 + f) * per_both));
    exponent * SINGLE_LN_2[0] - ((half - rest) - f)
}

/// Sine and cosine of x (rad); beyond some 10^6, as precise as x, and beyond 10^15 meaningless.
#[inline(always)]
pub fn sin_cos(i: impl Instructions, x: f64) -> (f64, f64) {
    let rounded = i.multiply_add(x, std::f64::consts::FRAC_2_PI, ROUND);
    let quarters = rounded - ROUND;
    let r = HALF_PI.iter().fold(x, |r, part| i.multiply_add(-quarters, *part, r));
    let square = r * r;
    let sine = i.multiply_add(r * square, polynomial(i, &SINE, square), r);
    let cosine = i.multiply_add(square * square, polynomial(i, &COSINE, square), i.multiply_add(-0.5, square, 1.0));
    // the quarter turns are in the last bits of the rounded sum
    let quarter = rounded.to_bits();
    let (s, c) = if quarter & 1 == 0 { (sine, cosine) } else { (cosine, sine) };
    let sign = |negative: u64| negative << 63;
    (f64::from_bits(s.to_bits() ^ sign(quarter >> 1)), f64::from_bits(c.to_bits() ^ sign((quarter >> 1) ^ quarter)))
}

#[cfg(test)]
mod tests;
