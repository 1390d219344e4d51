//! Gaussian fields on the sphere and in time, integrated out of data that are linear, or nearly so, in them.
//!
//! A field `x(p, t) = sum_h c_h(t) Y_h(p)`: real spherical harmonics ([`harmonics`]) whose coefficients are independent
//! Gaussian processes, `<c_h(t) c_h(t')> = S_h k(t - t')`, with a [`spectrum`] S over degrees and a [`kernel`] k in
//! time. In come epochs ([`Epoch`]): at a time, data `r = J c + noise` with J made linear around some coefficients,
//! noise with nuisances, and slopes `D'` of numbers whose gradient is asked for. Out come ln Z with all fields
//! integrated out, the most probable field at any time with its standard deviation, and gradient and information of
//! those numbers.
//!
//! Steps, in this order:
//! 1. [`settle`]: where data are not linear, Gauss-Newton to the most probable coefficients, which
//!    linearises at each step and asks
//! 2. [`compress`] for the few combinations of an epoch's data that say something of the field, of which
//! 3. [`evidence`] makes covariance, ln Z and all that follows from it, with the means of `dense`.
//!
//! Units of the field and of the data are the caller's; times are
//! days.

pub mod compress;
mod dense;
pub mod derivatives;
pub mod epoch;
pub mod evidence;
pub mod harmonics;
pub mod kernel;
mod maps;
pub mod quadratic;
pub mod settle;
pub mod spectrum;

pub use compress::Compression;
pub use derivatives::Derivatives;
pub use epoch::Epoch;
pub use evidence::Evidence;
pub use harmonics::Harmonics;
pub use kernel::{Kernel, Lifetime};
pub use quadratic::Quadratic;
pub use settle::{Settled, Settling, Sought, settle};
pub use spectrum::Spectrum;

use serde::{Deserialize, Serialize};

/// What is assumed of a field before any data: its hyperparameters.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Field {
    /// How rough it is.
    pub spectrum: Spectrum,
    /// How long it lives.
    pub kernel: Kernel,
}

/// Why there is no evidence.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum FieldError {
    /// Hyperparameters that no field has.
    #[error(
        "no field has amplitude {amplitude}, slope {slope}, lifetime {lifetime_d} d and persistent share \
    {persistent}"
    )]
    NoSuchField {
        /// Standard deviation of the field.
        amplitude: f64,
        /// Slope of its spectrum.
        slope: f64,
        /// Lifetime (d), infinite for a static field.
        lifetime_d: f64,
        /// Share that does not change.
        persistent: f64,
    },
    /// Data, derivatives or noise are not finite, or a variance of the noise is not positive.
    #[error("model, data or noise of epoch {epoch} are not finite, or its noise is not positive")]
    NotFinite {
        /// Number of the epoch, from 0.
        epoch: usize,
    },
    /// The covariance of the data is not positive definite in double precision: the field is too large for the noise.
    #[error("the covariance of the data is not positive definite: the field is too large for their noise")]
    NotPositive,
    /// Gauss-Newton has come to no end.
    #[error("the most probable field was not found in {steps} steps: the last changes it by {change:.2e}")]
    NotSettled {
        /// Steps that were made.
        steps: usize,
        /// Largest change of the field that the last step asked for.
        change: f64,
    },
}

impl Field {
    /// Whether there can be such a field.
    ///
    /// # Errors
    /// [`FieldError::NoSuchField`] for a number that is not finite, a negative amplitude, a lifetime that is not
    /// positive or a share outside [0, 1].
    pub fn check(&self) -> Result<(), FieldError> {
        let (Spectrum { amplitude, slope }, Kernel { lifetime, persistent }) = (self.spectrum, self.kernel);
        let lifetime_d = match lifetime {
            Lifetime::Static => f64::INFINITY,
            Lifetime::Days(days) => days,
        };
        let lives = lifetime == Lifetime::Static || (lifetime_d > 0.0 && lifetime_d.is_finite());
        let good = amplitude >= 0.0 && amplitude.is_finite() && slope.is_finite();
        match good && lives && (0.0..=1.0).contains(&persistent) {
            true => Ok(()),
            false => Err(FieldError::NoSuchField { amplitude, slope, lifetime_d, persistent }),
        }
    }
}
