//! Planets whose ephemeris is known: a period and the time of a conjunction, each with its error or fixed.

use crate::data::config::{ConfigError, Settings};
use crate::model::{Clock, Elements, Parameter, Prior, period_prior};
use crate::star::observation::Observations;

/// Largest error of the phase at the time of the data (orbital cycles).
pub const LARGEST_PHASE_ERROR: f64 = 0.1;

/// A known ephemeris.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ephemeris {
    /// Of which planet.
    pub of: &'static Elements,
    /// Time of a conjunction (d) and its standard error.
    pub conjunction_d: [f64; 2],
    /// Period (d) and its standard error.
    pub period_d: [f64; 2],
}

impl Ephemeris {
    /// That of a planet whose conjunction has a normal prior, and whose period has one or is fixed; `None` for any
    /// other.
    pub fn of(settings: &Settings, of: &'static Elements) -> Option<Self> {
        let clock = Clock { rotation_period_d: settings.star.rotation_period_d, epoch_d: settings.star.epoch_d };
        let prior = |p: Parameter| settings.free.iter().find(|f| f.parameter == p).map(|f| f.prior);
        let Some(Prior::Normal { mean, sd, .. }) = prior(of.conjunction) else { return None };
        let unit = clock.rotation_period_d;
        let period_d = match period_prior(&settings.free, of, clock) {
            None => [of.period_d(&settings.values, clock), 0.0],
            Some(Prior::Normal { mean, sd, .. }) => [mean * unit, sd * unit],
            Some(_) => return None,
        };
        Some(Ephemeris { of, conjunction_d: [mean, sd], period_d })
    }

    /// Standard error of the phase at a time (orbital cycles).
    pub fn phase_error(&self, time_d: f64) -> f64 {
        let ([conjunction, conjunction_sd], [period, period_sd]) = (self.conjunction_d, self.period_d);
        conjunction_sd.hypot((time_d - conjunction) / period * period_sd) / period
    }

    /// Refuses one that does not tell the phase at the time of the data.
    ///
    /// # Errors
    /// A config that names the conjunction.
    pub fn check(settings: &Settings, parts: &[Observations]) -> Result<(), ConfigError> {
        let times = || parts.iter().flat_map(Observations::times_d);
        let ends = times().reduce(f64::min).zip(times().reduce(f64::max));
        let Some((first, last)) = ends else { return Ok(()) };
        for ephemeris in Elements::PLANETS.iter().filter_map(|of| Ephemeris::of(settings, of)) {
            let worst = if ephemeris.phase_error(first) > ephemeris.phase_error(last) { first } else { last };
            let error = ephemeris.phase_error(worst);
            if error > LARGEST_PHASE_ERROR {
                let Elements { conjunction, phi, .. } = ephemeris.of;
                let problem = format!(
                    "the phase at {worst:.2} d is uncertain by {error:.2} orbits, above the limit of \
                    {LARGEST_PHASE_ERROR}: give a conjunction nearer to the data, a better period, or {} with a \
                     periodic prior",
                    phi.name()
                );
                return Err(settings.fault(&format!("parameters.{}", conjunction.name()), &problem));
            }
        }
        Ok(())
    }
}
