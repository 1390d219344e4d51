//! A first look at observations, before there is a config: position, width and noise of the line, the implied vsini and
//! systemic velocity, and how much the line moves.
//!
//! Every value is a starting point for later steps, and has an uncertainty.

mod continuum;
mod double;
mod mean;
mod noise;
mod unspotted;

pub use continuum::Continuum;
pub use double::DoubleLines;
pub use mean::{HalfDepth, MeanProfile};
pub use noise::{Noise, Scatter};
pub use unspotted::Unspotted;

use crate::star::LimbDarkening;
use crate::star::observation::Observations;

/// Uncertainty of vsini by spots, as a fraction of it and in km/s: 19 of 20 simulated stars are within, including those
/// with polar caps of 40 degrees (`tests/method/first_look.rs`).
const SPOTS: (f64, f64) = (0.01, 0.3);

/// Uncertainty of the centre by spots, as a fraction of vsini.
const CENTRE: f64 = 0.004;

/// Uncertainty of limb darkening (its linear coefficient) and of the width of a given local line (a fraction of it).
const DOUBT: (f64, f64) = (0.15, 0.2);

/// A continuum outside of these levels has another unit: percent, if within the second ones.
const LEVELS: std::ops::RangeInclusive<f64> = 0.2..=3.0;
const PERCENT: std::ops::RangeInclusive<f64> = 50.0..=200.0;

/// The assumed local line.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LineModel {
    /// Limb darkening: coefficient of the linear law.
    pub limb_darkening: f64,
    /// Standard deviation (km/s), before the spectrograph.
    pub sigma_kms: f64,
    /// Instrumental broadening, added in quadrature (km/s).
    pub instrumental_sigma_kms: f64,
    /// Whether the width is a guess that the profiles refine.
    pub is_guess: bool,
}

/// Results from the profiles alone.
#[derive(Clone, Debug, PartialEq)]
pub struct FirstLook {
    /// Time of the first and the last profile (d).
    pub span_d: (f64, f64),
    /// The unspotted star nearest to the mean profile.
    pub unspotted: Unspotted,
    /// Uncertainty of its vsini (km/s): by spots, limb darkening and the width of the local line.
    pub vsini_error_kms: f64,
    /// Uncertainty of the width of the local line (km/s); `None` where it is given.
    pub line_sigma_error_kms: Option<f64>,
    /// Uncertainty of its centre (km/s), by spots.
    pub centre_error_kms: f64,
    /// Distance (km/s) from the centre at which the line ends.
    pub reach_kms: f64,
    /// First and last velocity (km/s) that all profiles have.
    pub range_kms: (f64, f64),
    /// The continuum beside the line.
    pub continuum: Option<Continuum>,
    /// Level of the continuum and its uncertainty, where it differs from 1.
    pub level: Option<(f64, f64)>,
    /// Uncertainties of a bin.
    pub noise: Noise,
}

/// Errors of a first look.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum LookError {
    /// The velocity ranges of the profiles do not overlap.
    #[error("the velocity ranges of the profiles have fewer than 5 bins in common: is VRAD right?")]
    NothingInCommon,
    /// The data have another unit.
    #[error(
        "the continuum of the profiles is at {level:.4}, and I in units of the continuum is due: {}",
        if *is_percent { "these look like percent, divide I and sigma by 100" }
        else { "divide I and sigma of each profile by its continuum, a straight line through the ends, say" }
    )]
    Unit {
        /// Level of the continuum.
        level: f64,
        /// Whether it is near 100.
        is_percent: bool,
    },
    /// The line shows no rotation.
    #[error(
        "the line is no wider than that of a star that does not rotate (a local line of {sigma_kms:.1} km/s and \
        {instrumental_kms:.1} km/s of the spectrograph, standard deviations): vsini is not resolved. If it is known, \
        give --vsini; if the line is narrower, --line-sigma; if the spectrograph is better, --resolving-power"
    )]
    Unresolved {
        /// Standard deviation of the local line (km/s).
        sigma_kms: f64,
        /// Instrumental broadening (km/s).
        instrumental_kms: f64,
    },
    /// No line rises above the noise.
    #[error("no absorption line in the mean profile: its largest depth is {depth:.5}, with errors of {sigma:.5}")]
    NoLine {
        /// Largest depth of the mean profile.
        depth: f64,
        /// Its standard error per bin.
        sigma: f64,
    },
    /// The data end before the line falls to half its depth.
    #[error("the line runs out of the data, which reach from {from_kms:.1} to {to_kms:.1} km/s after VRAD")]
    LineCut {
        /// First velocity that all profiles have (km/s).
        from_kms: f64,
        /// Last one.
        to_kms: f64,
    },
    /// Too few bins to fit.
    #[error("the deepest line of the mean profile is only {bins} bins wide at half its depth, too few to measure")]
    LineTooNarrow {
        /// Bins above half depth.
        bins: usize,
    },
    /// The assumed line is incompatible with the data.
    #[error(
        "a local line of a standard deviation of {sigma_kms} km/s (with the instrument) is too narrow or too broad \
        for bins of \
         {step_kms:.3} km/s from {from_kms:.1} to {to_kms:.1}"
    )]
    LineModel {
        /// Standard deviation (km/s), instrumental broadening included.
        sigma_kms: f64,
        /// Width of a bin (km/s).
        step_kms: f64,
        /// First velocity that all profiles have (km/s).
        from_kms: f64,
        /// Last one.
        to_kms: f64,
    },
    /// The fit diverged.
    #[error("the mean profile is not like that of a rotating star: the fit for vsini does not converge")]
    NoRotation,
    /// The same where the data may end within the line.
    #[error(
        "the mean profile is not like that of a rotating star (the fit for vsini does not converge): does the line \
        reach beyond the data? They end at {level:.3} of the continuum, at {from_kms:.1} and {to_kms:.1} km/s; use a \
        wider --velocity-range, or give profiles that reach farther"
    )]
    EndsInLine {
        /// Intensity at the ends.
        level: f64,
        /// First velocity that all profiles have (km/s).
        from_kms: f64,
        /// Last one.
        to_kms: f64,
    },
}

impl FirstLook {
    /// A first look at `observations`, whose local line is about `line`.
    ///
    /// # Errors
    /// [`LookError`].
    pub fn at(observations: &Observations, line: LineModel) -> Result<Self, LookError> {
        Self::of(observations, line, true)
    }

    /// The same for profiles whose continuum is at 1, or perhaps `elsewhere`.
    fn of(observations: &Observations, line: LineModel, elsewhere: bool) -> Result<Self, LookError> {
        let mean = MeanProfile::of(observations)?;
        let level = mean.level();
        if !LEVELS.contains(&level) {
            return Err(LookError::Unit { level, is_percent: PERCENT.contains(&level) });
        }
        line.check(&mean)?;
        let half_depth = mean.half_depth()?;
        let fit = |line| Unspotted::fit(&mean, half_depth, line);
        let unspotted = fit(line).map_err(|error| match error {
            LookError::NoRotation if mean.may_end_in_line() => {
                let (from_kms, to_kms) = mean.range_kms();
                LookError::EndsInLine { level, from_kms, to_kms }
            }
            error => error,
        })?;
        let reach_kms = unspotted.reach_kms(line.instrumental_sigma_kms);
        let continuum = Continuum::of(observations, unspotted.centre_kms, reach_kms);
        if elsewhere
            && continuum.is_none()
            && let Some(level) = Self::level_of_ends(&mean, half_depth, line, &unspotted)
        {
            let look = FirstLook::of(&observations.clone().over_continuum(level), line, false)?;
            return Ok(FirstLook { level: Some((level, mean.sigma)), ..look });
        }
        let change = |line| fit(line).map(|other| (other.vsini_kms - unspotted.vsini_kms).abs());
        // towards the middle of the allowed range
        let other_limb = if line.limb_darkening > 0.5 { -DOUBT.0 } else { DOUBT.0 };
        let by_limb = change(LineModel { limb_darkening: line.limb_darkening + other_limb, ..line })?;
        let (width_error, by_guess) = unspotted.line_errors_kms;
        let by_width = match line.is_guess {
            true => by_guess,
            false => change(LineModel { sigma_kms: line.sigma_kms * (1.0 - DOUBT.1), ..line })?,
        };
        let by_spots = SPOTS.0 * unspotted.vsini_kms + SPOTS.1;
        let level = continuum.filter(Continuum::is_off).map(|found| (found.level, found.level_error));
        let times = observations.times_d();
        let extreme = |f: fn(f64, f64) -> f64| times.iter().copied().reduce(f).unwrap_or(f64::NAN);
        Ok(FirstLook {
            span_d: (extreme(f64::min), extreme(f64::max)),
            unspotted,
            vsini_error_kms: by_spots.hypot(by_limb).hypot(by_width),
            centre_error_kms: (CENTRE * unspotted.vsini_kms).hypot(mean.centre_error_kms(half_depth)),
            line_sigma_error_kms: line.is_guess.then_some(width_error),
            reach_kms,
            range_kms: mean.range_kms(),
            continuum,
            level,
            noise: Noise::of(observations, unspotted.centre_kms, reach_kms),
        })
    }

    /// Level of the continuum, by the ends of profiles with very little of it: a level other than 1 with which the mean
    /// profile is more like a star than like the one `at_one`.
    fn level_of_ends(mean: &MeanProfile, half_depth: HalfDepth, line: LineModel, at_one: &Unspotted) -> Option<f64> {
        let star = Unspotted::fit_between_ends(mean, half_depth, line)?;
        (star.residual < at_one.residual && star.is_off(mean)).then_some(1.0 - star.offset)
    }
}

impl LineModel {
    /// Whether the bins of a profile resolve the line and contain it.
    fn check(self, mean: &MeanProfile) -> Result<(), LookError> {
        const NARROWEST: f64 = 0.02;
        let (sigma_kms, step_kms, (from_kms, to_kms)) = (self.total_sigma_kms(), mean.step_kms, mean.range_kms());
        match (NARROWEST * step_kms..=to_kms - from_kms).contains(&sigma_kms) {
            true => Ok(()),
            false => Err(LookError::LineModel { sigma_kms, step_kms, from_kms, to_kms }),
        }
    }

    /// Standard deviation (km/s) including the instrumental broadening.
    pub fn total_sigma_kms(self) -> f64 {
        self.sigma_kms.hypot(self.instrumental_sigma_kms)
    }

    fn law(self) -> LimbDarkening {
        LimbDarkening::Linear(self.limb_darkening)
    }
}
