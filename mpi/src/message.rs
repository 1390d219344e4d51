//! Messages between ranks: a tag, and bytes.

use mpi::Tag;

/// From a worker, once: the number of questions that it answers at once (8 bytes).
pub(super) const HELLO: Tag = 1;

/// To a worker: an [`Order`].
pub(super) const ORDER: Tag = 2;

/// From a worker: an answer.
pub(super) const ANSWER: Tag = 3;

/// To a worker: a question on the brief of that number. Each brief has its own tag, so that threads that still work on
/// the previous brief leave them alone.
pub(super) fn question(brief: usize) -> Tag {
    const FIRST: usize = 4;
    const TAGS: usize = 1000;
    (FIRST + brief % TAGS) as Tag
}

/// An order to a worker.
#[derive(Clone, Copy)]
pub(super) enum Order {
    /// The subject of the next questions follows as a broadcast of so many bytes.
    Brief(usize),
    /// Current evaluations should end soon.
    Stop,
    /// The end of all questions.
    Dismissed,
}

impl Order {
    /// Encoded as two numbers.
    pub(super) fn to_bytes(self) -> Vec<u8> {
        let (kind, length) = match self {
            Order::Brief(length) => (0, length),
            Order::Stop => (1, 0),
            Order::Dismissed => (2, 0),
        };
        numbered(kind, &number(length))
    }

    pub(super) fn from_bytes(bytes: &[u8]) -> Self {
        let (kind, rest) = split(bytes);
        match kind {
            0 => Order::Brief(split(rest).0),
            1 => Order::Stop,
            2 => Order::Dismissed,
            kind => unreachable!("rank 0 gives no order {kind}"),
        }
    }
}

/// Length of a number.
const NUMBER: usize = 8;

/// A number alone.
pub(super) fn number(number: usize) -> [u8; NUMBER] {
    (number as u64).to_le_bytes()
}

/// The first number of a message, and the rest.
pub(super) fn split(message: &[u8]) -> (usize, &[u8]) {
    let (number, rest) = message.split_first_chunk().expect("a message of this program begins with its number");
    (u64::from_le_bytes(*number) as usize, rest)
}

/// Question or answer number `place`.
pub(super) fn numbered(place: usize, bytes: &[u8]) -> Vec<u8> {
    [&number(place)[..], bytes].concat()
}
