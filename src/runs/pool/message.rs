//! Questions and answers as bytes: numbers, little-endian, bit for bit.

use crate::runs::limits::Outcome;
use crate::sampling::log_density::{Evaluation, Status};
use crate::star::Orbit;

/// A question that can be encoded as bytes.
pub trait Question: Sync {
    /// Encodes it.
    fn to_bytes(&self) -> Vec<u8>;
}

/// A parameter vector.
impl Question for Vec<f64> {
    fn to_bytes(&self) -> Vec<u8> {
        numbers_to_bytes(self)
    }
}

/// An answer that can be encoded as bytes and decoded.
pub trait Answer: Send + Sized {
    /// Encodes it.
    fn to_bytes(&self) -> Vec<u8>;

    /// Decodes it; `None` for bytes that are not from `to_bytes`.
    fn from_bytes(bytes: &[u8]) -> Option<Self>;
}

/// An orbit to be injected into profiles.
impl Question for Orbit {
    fn to_bytes(&self) -> Vec<u8> {
        numbers_to_bytes(&[self.k_kms, self.porb_over_prot, self.phi])
    }
}

/// The orbit of a question; `None` for other bytes.
pub fn orbit_from_bytes(bytes: &[u8]) -> Option<Orbit> {
    let [k_kms, porb_over_prot, phi] = *numbers_from_bytes(bytes).first_chunk()?;
    Some(Orbit { k_kms, porb_over_prot, phi })
}

/// The result of its search; `None` where it could not be searched for.
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

/// All of them; the index is the encoded number, which is exact.
const STATUS: [Status; 5] =
    [Status::Converged, Status::Unreachable, Status::OutsidePrior, Status::StoppedShort, Status::NonFinite];

impl Answer for Evaluation {
    fn to_bytes(&self) -> Vec<u8> {
        let place = STATUS.iter().position(|one| *one == self.status).expect("all of them are listed");
        let ended = [self.log_prob, f64::from(self.model_applications), place as f64];
        numbers_to_bytes(&[&ended[..], &self.numbers].concat())
    }

    fn from_bytes(bytes: &[u8]) -> Option<Self> {
        let all = numbers_from_bytes(bytes);
        let (&[log_prob, model_applications, place], numbers) = all.split_first_chunk()?;
        let status = *STATUS.get(place as usize)?;
        Some(Evaluation { log_prob, numbers: numbers.to_vec(), model_applications: model_applications as u32, status })
    }
}

/// Numbers, little-endian.
fn numbers_to_bytes(numbers: &[f64]) -> Vec<u8> {
    numbers.iter().flat_map(|x| x.to_le_bytes()).collect()
}

/// The inverse; incomplete bytes at the end are dropped.
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
                for numbers in [Vec::new(), vec![0.1, 1e300]] {
                    let one = Evaluation { log_prob, numbers, model_applications: u32::MAX, status };
                    let back = Evaluation::from_bytes(&one.to_bytes()).unwrap();
                    assert_eq!((back.log_prob.to_bits(), &back), (log_prob.to_bits(), &one));
                }
            }
        }
        let found =
            Outcome { delta_ln_l: 7.0, porb_over_prot: 2.0 / 3.0, k_kms: 0.1, detected: true, recovered: false };
        for outcome in [None, Some(found)] {
            assert_eq!(Option::<Outcome>::from_bytes(&outcome.to_bytes()), Some(outcome));
        }
        for broken in [&[1.0, 2.0][..], &[1.0, 2.0, 9.0]] {
            assert_eq!(Evaluation::from_bytes(&numbers_to_bytes(broken)), None);
        }
    }
}
