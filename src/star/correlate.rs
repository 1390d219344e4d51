//! Short filters along a row of numbers, a chunk of results at a time in registers.

use crate::numerics::vector::Instructions;

/// Results that are kept in registers together.
pub const CHUNK: usize = 32;

/// `sums[j] += sum_q taps[q] source[q + j]`; the source must reach [`CHUNK`] - 1 entries beyond the last tap.
#[inline(always)]
pub fn correlate(i: impl Instructions, taps: &[f64], source: &[f64], sums: &mut [f64; CHUNK]) {
    assert!(source.len() + 1 >= taps.len() + CHUNK);
    let mut windows = source.windows(CHUNK);
    for tap in taps {
        let Some(window) = windows.next() else { break };
        for j in 0..CHUNK {
            sums[j] = i.multiply_add(*tap, window[j], sums[j]);
        }
    }
}

/// Stores the results of a chunk; the last chunk may be shorter.
#[inline(always)]
pub fn put(sums: &[f64; CHUNK], chunk: &mut [f64]) {
    match <&mut [f64; CHUNK]>::try_from(&mut *chunk) {
        Ok(whole) => *whole = *sums,
        Err(_) => chunk.copy_from_slice(&sums[..chunk.len()]),
    }
}
