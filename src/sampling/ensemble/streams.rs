//! Random numbers by counter: the stream is given by purpose, ensemble and walker, the position in it by the step; no
//! generator state is stored.

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

/// The purpose of random numbers; no two purposes share a stream.
#[derive(Clone, Copy)]
pub(super) enum Purpose {
    Walker = 0,
    Split = 1,
    Start = 2,
}

/// The stream of an ensemble and walker (both under 2^20, see the settings).
pub(super) fn stream(purpose: Purpose, ensemble: usize, walker: usize) -> u64 {
    (purpose as u64) << 60 | (ensemble as u64) << 30 | walker as u64
}

/// The random numbers of a stream at a step: 2^16 words are reserved for each.
pub(super) fn random_numbers(seed: u64, stream: u64, step: usize) -> ChaCha8Rng {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    rng.set_stream(stream);
    rng.set_word_pos((step as u128) << 16);
    rng
}
