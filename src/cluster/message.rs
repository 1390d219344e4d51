//! What is sent between ranks: a tag, and bytes.
//!
//! Left out: when (`queue`, `worker`).

use mpi::Tag;

/// From a worker, once: how many questions it answers at once (8 bytes).
pub(super) const HELLO: Tag = 1;

/// To a worker: what the next questions are about follows as a broadcast of so many bytes (8 bytes).
pub(super) const BRIEF: Tag = 2;

/// To a worker: a question.
pub(super) const QUESTION: Tag = 3;

/// From a worker: an answer.
pub(super) const ANSWER: Tag = 4;

/// To a worker: what is under way is wanted soon.
pub(super) const STOP: Tag = 5;

/// To a worker: nothing more is asked.
pub(super) const DISMISS: Tag = 6;

/// Length of a number.
const NUMBER: usize = 8;

/// A number alone.
pub(super) fn number(number: usize) -> [u8; NUMBER] {
    (number as u64).to_le_bytes()
}

/// The number that a message begins with, and the rest.
pub(super) fn split(message: &[u8]) -> (usize, &[u8]) {
    let (number, rest) = message.split_first_chunk().expect("a message of this program begins with its number");
    (u64::from_le_bytes(*number) as usize, rest)
}

/// Question or answer number `place`.
pub(super) fn numbered(place: usize, bytes: &[u8]) -> Vec<u8> {
    [&number(place)[..], bytes].concat()
}
