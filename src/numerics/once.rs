//! What is found when it is first asked for.

use std::sync::OnceLock;

/// What a cell holds, found now if it holds nothing. It is not held while that is found: a thread that waits for work
/// of its own in there may take up a job that asks for the same, and would wait for itself. Two threads may find it
/// both; it is the same.
pub fn found<T>(cell: &OnceLock<T>, find: impl FnOnce() -> T) -> &T {
    if let Some(known) = cell.get() {
        return known;
    }
    let found = find();
    cell.get_or_init(|| found)
}

#[cfg(test)]
mod tests {
    use super::*;
    use rayon::prelude::*;

    /// Jobs that ask for the same cell while it is found by jobs of their own.
    #[test]
    fn who_finds_it_may_ask_for_it() {
        let cell = OnceLock::new();
        let find = || (0..64u64).into_par_iter().map(|k| (0..k).into_par_iter().sum::<u64>()).sum::<u64>();
        let all: Vec<u64> = (0..256).into_par_iter().map(|_| *found(&cell, find)).collect();
        assert!(all.iter().all(|one| *one == find()));
        // asked for within
        let inner = OnceLock::new();
        assert_eq!(*found(&inner, || *found(&inner, || 1)), 1);
    }
}
