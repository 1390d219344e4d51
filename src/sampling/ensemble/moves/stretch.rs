//! The stretch move: along the line through a walker of the other half.
//!
//! Source: Goodman & Weare 2010, equations 7, 9 and 10: `Y = X_j + Z (X - X_j)` with `g(z) ~ 1/sqrt(z)` on [1/a, a];
//! accepted with `Z^(d-1)` in the factor.

use crate::sampling::chain::MoveKind;
use crate::sampling::ensemble::moves::{Move, Proposal};
use rand::{Rng, RngCore};

/// The stretch move.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stretch {
    /// The scale a > 1.
    pub scale: f64,
}

impl Default for Stretch {
    fn default() -> Self {
        Stretch { scale: 2.0 }
    }
}

impl Move for Stretch {
    fn propose(&self, current: &[f64], complement: &[Vec<f64>], rng: &mut dyn RngCore) -> Proposal {
        let anchor = &complement[rng.random_range(0..complement.len())];
        let root = (self.scale - 1.0) * rng.random::<f64>() + 1.0;
        let z = root * root / self.scale;
        let position = current.iter().zip(anchor).map(|(x, a)| a + z * (x - a)).collect();
        let log_factor = (current.len() as f64 - 1.0) * z.ln();
        Proposal { position, log_factor, by: MoveKind::Stretch, translation: false }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sampling::ensemble::moves::{Mix, harness};

    #[test]
    fn recovers_its_targets() {
        harness::check(|| Mix::default().with(1.0, Box::new(Stretch::default()))).unwrap();
    }
}
