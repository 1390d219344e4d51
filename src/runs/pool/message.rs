//! Questions and answers as bytes: numbers, little-endian, bit for bit.

use crate::runs::limits::Outcome;
use crate::sampling::log_density::{Evaluation, Likelihood, Reconstruction, Status};
use crate::star::Orbit;

/// What is asked, as bytes.
pub trait Question: Sync {
    /// As bytes.
    fn to_bytes(&self) -> Vec<u8>;
}

/// A parameter vector.
impl Question for Vec<f64> {
    fn to_bytes(&self) -> Vec<u8> {
        numbers_to_bytes(self)
    }
}

/// What is answered, as bytes and back.
pub trait Answer: Send + Sized {
    /// As bytes.
    fn to_bytes(&self) -> Vec<u8>;

    /// Back; `None` if they are not what `to_bytes` makes.
    fn from_bytes(bytes: &[u8]) -> Option<Self>;
}

/// An orbit to be put into profiles.
impl Question for Orbit {
    fn to_bytes(&self) -> Vec<u8> {
        numbers_to_bytes(&[self.k_kms, self.porb_over_prot, self.phi])
    }
}

/// The orbit of a question; `None` if it is none.
#[cfg(feature = "mpi")]
pub fn orbit_from_bytes(bytes: &[u8]) -> Option<Orbit> {
    let [k_kms, porb_over_prot, phi] = *numbers_from_bytes(bytes).first_chunk()?;
    Some(Orbit { k_kms, porb_over_prot, phi })
}

/// What became of it; nothing where it could not be searched for.
impl Answer for Option<Outcome> {
    fn to_bytes(&self) -> Vec<u8> {
        let truth = |is: bool| f64::from(u8::from(is));
        self.map_or_else(Vec::new, |one| {
            let Outcome { delta_ln_l, porb_over_prot, k_kms, detected, recovered } = one;
            numbers_to_bytes(&[delta_ln_l, porb_over_prot, k_kms, truth(detected), truth(recovered)])
        })
    }

    fn from_bytes(bytes: &[u8]) -> Option<Self> {
        let numbers = numbers_from_bytes(bytes);
        if numbers.is_empty() {
            return Some(None);
        }
        let [delta_ln_l, porb_over_prot, k_kms, detected, recovered] = *numbers.first_chunk()?;
        let (detected, recovered) = (detected == 1.0, recovered == 1.0);
        Some(Some(Outcome { delta_ln_l, porb_over_prot, k_kms, detected, recovered }))
    }
}

/// All of them; the place is the number on the way.
const STATUS: [Status; 5] =
    [Status::Converged, Status::Unreachable, Status::OutsidePrior, Status::StoppedShort, Status::NonFinite];

/// Passes and status as numbers, which are exact.
fn ended(passes: u32, status: Status) -> [f64; 2] {
    let place = STATUS.iter().position(|one| *one == status).expect("all of them are listed");
    [f64::from(passes), place as f64]
}

fn end_of(passes: f64, place: f64) -> Option<(u32, Status)> {
    Some((passes as u32, *STATUS.get(place as usize)?))
}

impl Answer for Evaluation {
    fn to_bytes(&self) -> Vec<u8> {
        let [passes, status] = ended(self.passes, self.status);
        numbers_to_bytes(&[self.log_prob, self.spottedness, self.chi2, passes, status])
    }

    fn from_bytes(bytes: &[u8]) -> Option<Self> {
        let [log_prob, spottedness, chi2, passes, status] = *numbers_from_bytes(bytes).first_chunk()?;
        let (passes, status) = end_of(passes, status)?;
        Some(Evaluation { log_prob, spottedness, chi2, passes, status })
    }
}

impl Answer for Reconstruction {
    fn to_bytes(&self) -> Vec<u8> {
        let mut numbers = ended(self.passes, self.status).to_vec();
        if let Some(Likelihood { log_likelihood, spottedness, entropy, chi2, lambda }) = self.likelihood {
            numbers.extend([log_likelihood, spottedness, entropy, chi2, lambda]);
        }
        numbers_to_bytes(&numbers)
    }

    fn from_bytes(bytes: &[u8]) -> Option<Self> {
        let numbers = numbers_from_bytes(bytes);
        let ([passes, status], rest) = numbers.split_first_chunk()?;
        let (passes, status) = end_of(*passes, *status)?;
        let likelihood = rest.first_chunk().map(|&[log_likelihood, spottedness, entropy, chi2, lambda]| Likelihood {
            log_likelihood,
            spottedness,
            entropy,
            chi2,
            lambda,
        });
        Some(Reconstruction { likelihood, passes, status })
    }
}

/// Numbers, little-endian.
fn numbers_to_bytes(numbers: &[f64]) -> Vec<u8> {
    numbers.iter().flat_map(|x| x.to_le_bytes()).collect()
}

/// Back; what is left over of a broken end is dropped.
pub(super) fn numbers_from_bytes(bytes: &[u8]) -> Vec<f64> {
    bytes.as_chunks().0.iter().map(|chunk| f64::from_le_bytes(*chunk)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// By their bits: -0, the smallest numbers, infinities.
    #[test]
    fn answers_survive_exactly() {
        for status in STATUS {
            for log_prob in [-0.0, 5e-324, f64::NEG_INFINITY, -1.0 / 3.0] {
                let one = Evaluation { log_prob, spottedness: 0.1, chi2: 1e300, passes: u32::MAX, status };
                let back = Evaluation::from_bytes(&one.to_bytes()).unwrap();
                assert_eq!((back.log_prob.to_bits(), &back), (log_prob.to_bits(), &one));
                let values =
                    Likelihood { log_likelihood: log_prob, spottedness: 0.1, entropy: -2.0, chi2: 3.0, lambda: 0.2 };
                for likelihood in [None, Some(values)] {
                    let one = Reconstruction { likelihood, passes: 7, status };
                    assert_eq!(Reconstruction::from_bytes(&one.to_bytes()), Some(one));
                }
            }
        }
        let found =
            Outcome { delta_ln_l: 7.0, porb_over_prot: 2.0 / 3.0, k_kms: 0.1, detected: true, recovered: false };
        for outcome in [None, Some(found)] {
            assert_eq!(Option::<Outcome>::from_bytes(&outcome.to_bytes()), Some(outcome));
        }
        assert_eq!(Evaluation::from_bytes(&numbers_to_bytes(&[1.0, 2.0, 3.0, 4.0])), None);
        assert_eq!(Reconstruction::from_bytes(&numbers_to_bytes(&[1.0, 9.0])), None);
    }
}
