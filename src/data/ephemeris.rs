//! Whether a known ephemeris predicts the phase at the time of the data.

use crate::data::config::{ConfigError, Settings};
use crate::model::{Clock, Elements, Ephemeris};
use crate::star::observation::Observations;

/// Largest error of the phase at the time of the data (orbital cycles).
pub const LARGEST_PHASE_ERROR: f64 = 0.1;

/// The planets of known ephemeris in a config.
pub fn ephemerides(settings: &Settings) -> Vec<Ephemeris> {
    let clock = Clock { rotation_period_d: settings.star.rotation_period_d, epoch_d: settings.star.epoch_d };
    Ephemeris::all(&settings.free, &settings.values, clock)
}

/// Refuses an ephemeris that does not predict the phase at the time of the data.
///
/// # Errors
/// A config that names the conjunction.
pub fn check(settings: &Settings, parts: &[Observations]) -> Result<(), ConfigError> {
    let times = || parts.iter().flat_map(Observations::times_d);
    let ends = times().reduce(f64::min).zip(times().reduce(f64::max));
    let Some((first, last)) = ends else { return Ok(()) };
    for ephemeris in ephemerides(settings) {
        let worst = if ephemeris.phase_error(first) > ephemeris.phase_error(last) { first } else { last };
        let error = ephemeris.phase_error(worst);
        if error > LARGEST_PHASE_ERROR {
            let Elements { conjunction, phi, .. } = ephemeris.of();
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
