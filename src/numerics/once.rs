//! Values computed on first use.

use std::sync::OnceLock;

/// The value of a cell, computed now if it is empty. The cell is not locked meanwhile: a thread that waits for its
/// sub-jobs may take up a job that needs the same value, and would wait for itself. Two threads may both compute it,
/// with the same result.
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

    /// Jobs that need the same cell while sub-jobs compute it.
    #[test]
    fn who_finds_it_may_ask_for_it() {
        let cell = OnceLock::new();
        let find = || (0..64u64).into_par_iter().map(|k| (0..k).into_par_iter().sum::<u64>()).sum::<u64>();
        let all: Vec<u64> = (0..256).into_par_iter().map(|_| *found(&cell, find)).collect();
        assert!(all.iter().all(|one| *one == find()));
        // used within
        let inner = OnceLock::new();
        assert_eq!(*found(&inner, || *found(&inner, || 1)), 1);
    }
}
