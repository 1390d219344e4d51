//! Arithmetic on logarithms of numbers beyond the range of doubles.

/// ln of the sum of the exponentials; minus infinity for an empty sum.
pub fn ln_sum(terms: &[f64]) -> f64 {
    let highest = terms.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    if highest == f64::NEG_INFINITY {
        return highest;
    }
    highest + terms.iter().map(|x| (x - highest).exp()).sum::<f64>().ln()
}
