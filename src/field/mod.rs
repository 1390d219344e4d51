//! Gaussian fields on the sphere and in time, marginalised over for data that are linear, or nearly so, in them.
//!
//! A field `x(p, t) = sum_h c_h(t) Y_h(p)`: real spherical harmonics ([`Harmonics`]) whose coefficients are independent
//! Gaussian processes, `<c_h(t) c_h(t')> = S_h k(t - t')`, with a [`Spectrum`] S over degrees and a [`Kernel`] k in
//! time. Units of the field and of the data are the caller's; times are days.
//!
//! Steps to a likelihood:
//! 1. Choose the prior: a [`Field`] (amplitude, power-law index, lifetime or static, persistent share), and the degree
//!    of each coefficient ([`Harmonics::degrees`]).
//! 2. Write a closure from coefficients (H, epochs) to one [`Epoch`] per profile, linearised there: time, design J,
//!    misfit, variance of the noise, columns of nuisances, slopes D' in the velocity, and the divisor of the model, if
//!    it depends on the field. Correlated noise of neighbouring bins enters as larger variances; an RV jitter that the
//!    fit of the field includes is [`Epoch::jittered`].
//! 3. [`settle()`] finds the most probable coefficients, from zeros once and from those of a reference afterwards, and
//!    gives the [`Evidence`] there (`tilt`: where exactly). For linear data, [`Evidence::new`] is enough.
//! 4. [`Evidence::quadratic`]: ln Z, and its gradient and information in the velocities; other numbers, a jitter for
//!    example, are marginalised over by [`Quadratic::integrated`]. [`Evidence::with`]: the same for another orbit,
//!    design unchanged, by new misfits and slopes.
//! 5. [`Evidence::derivatives`]: of ln Z, with respect to the hyperparameters.
//! 6. [`Evidence::coefficients_at`], [`Evidence::means`] and [`Evidence::standard_deviations`]: the posterior of the
//!    field at any time. [`Field::drawn`] and [`Evidence::drawn`]: draws from prior and posterior.
//!
//! Internally, `compress` finds the few numbers of an epoch that depend on the field. `covariance` is that of all
//! numbers, factored: `dense`, or by a Kalman `filter` for many profiles. Nearly all of the time goes there.

mod compress;
mod covariance;
mod dense;
mod derivatives;
mod draws;
mod epoch;
mod evidence;
mod filter;
mod harmonics;
mod jacobian;
mod kernel;
mod maps;
mod numbers;
mod quadratic;
mod settle;
mod spectrum;
mod tilt;

pub use compress::{Compression, leading_directions, with_directions};
pub use derivatives::Derivatives;
pub use epoch::Epoch;
pub use evidence::Evidence;
pub use harmonics::Harmonics;
pub use jacobian::Jacobian;
pub use kernel::{Kernel, Lifetime};
pub use quadratic::Quadratic;
pub(crate) use settle::approach;
pub use settle::{Settled, Settling, Sought, settle};
pub use spectrum::{Degrees, Spectrum};

use serde::{Deserialize, Serialize};

/// The prior of a field: its hyperparameters.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Field {
    /// Its angular power spectrum.
    pub spectrum: Spectrum,
    /// Its correlation in time.
    pub kernel: Kernel,
}

/// Why there is no evidence.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum FieldError {
    /// Invalid hyperparameters.
    #[error(
        "no field has amplitude {amplitude}, slope {slope}, lifetime {lifetime_d} d and persistent share \
    {persistent}"
    )]
    NoSuchField {
        /// Standard deviation of the field.
        amplitude: f64,
        /// Power-law index of its spectrum.
        slope: f64,
        /// Lifetime (d), infinite for a static field.
        lifetime_d: f64,
        /// Static share.
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
    /// Gauss-Newton has not converged.
    #[error("the most probable field was not found in {steps} steps: the last changes it by {change:.2e}")]
    NotSettled {
        /// Steps that were made.
        steps: usize,
        /// Largest change of the field in the last step.
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
        let Field { spectrum: Spectrum { amplitude, slope, break_degree }, kernel: Kernel { lifetime, persistent } } =
            *self;
        let lifetime_d = match lifetime {
            Lifetime::Static => f64::INFINITY,
            Lifetime::Days(days) => days,
        };
        let lives = lifetime == Lifetime::Static || (lifetime_d > 0.0 && lifetime_d.is_finite());
        let good = amplitude >= 0.0 && amplitude.is_finite() && slope.is_finite() && break_degree >= 0.0;
        match good && lives && (0.0..=1.0).contains(&persistent) {
            true => Ok(()),
            false => Err(FieldError::NoSuchField { amplitude, slope, lifetime_d, persistent }),
        }
    }
}
