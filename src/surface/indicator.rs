//! Activity indicators: readings of quantities that follow the spots of the visible disc (H alpha, S, a colour, a
//! longitudinal field), in units of the scatter of each indicator (`docs/method.md` section 9).

use super::photometry::Flux;

/// A reading in units of the scatter of all readings of its indicator.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reading {
    /// Time (d).
    pub time_d: f64,
    /// The value minus the mean.
    pub value: f64,
    /// Its standard error.
    pub sigma: f64,
    /// Its time, scaled: -1 for the first, 1 for the last.
    pub place: f64,
}

/// Origin and unit of the values of an indicator.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scale {
    /// Their mean.
    pub mean: f64,
    /// Their standard deviation.
    pub rms: f64,
}

/// An indicator that depends on the spots.
#[derive(Clone, Debug, PartialEq)]
pub struct Indicator {
    /// Its name.
    pub name: String,
    /// Its number among all that were given, from 0.
    pub number: usize,
    /// Origin and unit of its readings.
    pub scale: Scale,
    /// Its readings, in the order of time, with a jitter in their uncertainties.
    pub readings: Vec<Reading>,
    /// Change of a reading for a filling factor of the visible disc of 1.
    pub gain: f64,
}

impl Indicator {
    /// From measurements in the order of time, with a gain and a jitter in their units; the indicator with that
    /// `number`.
    pub fn new((number, name): (usize, &str), measured: &[Flux], gain: f64, jitter: f64) -> Self {
        let (scale, mut readings) = scaled(measured);
        readings.iter_mut().for_each(|reading| reading.sigma = reading.sigma.hypot(jitter / scale.rms));
        Indicator { name: name.to_owned(), number, scale, readings, gain: gain / scale.rms }
    }
}

/// Measurements in the order of time in units of their scatter; in units of their uncertainties if all values are
/// equal.
pub fn scaled(measured: &[Flux]) -> (Scale, Vec<Reading>) {
    let n = measured.len() as f64;
    let mean = measured.iter().map(|one| one.flux).sum::<f64>() / n;
    let rms = (measured.iter().map(|one| (one.flux - mean).powi(2)).sum::<f64>() / n).sqrt();
    let error = (measured.iter().map(|one| one.sigma.powi(2)).sum::<f64>() / n).sqrt();
    let scale = Scale { mean, rms: rms.max(1e-3 * error) };
    let (first, last) = (measured[0].time_d, measured[measured.len() - 1].time_d);
    let half = 0.5 * (last - first);
    let reading = |one: &Flux| Reading {
        time_d: one.time_d,
        value: (one.flux - mean) / scale.rms,
        sigma: one.sigma / scale.rms,
        place: if half > 0.0 { (one.time_d - first) / half - 1.0 } else { 0.0 },
    };
    (scale, measured.iter().map(reading).collect())
}
