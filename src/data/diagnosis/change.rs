//! A change of one property of a star or its profiles that may be wrong.

use super::Reason;
use crate::data::calibrated;
use crate::data::config::{ConfigError, Settings};
use crate::data::io::provenance::Season;
use crate::model::Parameter;
use crate::star::BrightnessModel;
use crate::star::observation::{Observations, Profile};
use crate::surface::imaging::Imager;
use crate::surface::nuisances::LineAndContinuum;
use std::sync::Arc;

/// Factors on vsini, the width of the local line and the rotation period.
const VSINI: [f64; 8] = [0.7, 0.8, 0.9, 0.97, 1.03, 1.1, 1.25, 1.4];
const LINE_WIDTH: [f64; 5] = [0.35, 0.5, 0.7, 1.4, 2.0];
/// Lorentzian width over the width of the local line, and the remaining Gaussian width over it.
const WINGS: [(f64, f64); 3] = [(0.3, 0.85), (0.6, 0.7), (1.0, 0.5)];
const PERIOD: [f64; 6] = [0.5, 0.9, 0.95, 1.05, 1.1, 2.0];

/// Standard deviation of the offset, or of the slope, that continua of single profiles may have.
const OFFSET: f64 = 0.03;

/// The line ends that many standard deviations of the local line beyond vsini.
const REACH_SIGMAS: f64 = 3.0;

/// Settings with the observations that they are compared with.
#[derive(Clone)]
pub(super) struct Patient {
    pub settings: Settings,
    pub observations: Observations,
    /// The profiles over their full width.
    pub whole: Arc<Observations>,
    /// The seasons, each with its own map.
    pub seasons: Vec<Season>,
    pub correlated_bins: f64,
}

/// A change.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Change {
    /// vsini times this.
    Vsini(f64),
    /// The local line this many times as wide, as observed through the spectrograph.
    LineWidth(f64),
    /// A Lorentzian of the first, and a Gaussian of the second, times the width of the local line.
    Wings(f64, f64),
    /// The rotation period times this.
    Period(f64),
    /// The equivalent width measured on the profiles.
    MeasuredStrength,
    /// The continuum at this level.
    Level(f64),
    /// A level of the continuum for each profile.
    Offsets,
    /// A slope of the continuum for each profile.
    Slopes,
    /// A map of brightnesses, bright ones too.
    BrightAndDark,
    /// Velocities (km/s) used, from and to.
    Range(f64, f64),
}

impl Patient {
    /// The imager of these observations at the subject's times.
    pub fn imager(&self, observations: Observations) -> Result<Imager, ConfigError> {
        calibrated::imager(&self.settings, &self.settings.sets, &[observations], &self.seasons)
    }
}

impl Change {
    /// All first-round changes.
    pub fn all(patient: &Patient) -> Vec<Change> {
        let Patient { settings, .. } = patient;
        let mut all: Vec<Change> = VSINI.map(Change::Vsini).into();
        all.extend(LINE_WIDTH.map(Change::LineWidth));
        if settings.sets[0].star.line.gamma_kms == 0.0 && settings.values.get(Parameter::LineSigma).is_none() {
            all.extend(WINGS.map(|(gamma, sigma)| Change::Wings(gamma, sigma)));
        }
        if settings.imaging.brightness() == BrightnessModel::Spots {
            all.push(Change::BrightAndDark);
        }
        all.extend(PERIOD.map(Change::Period));
        let given = settings.sets[0].star.line.equivalent_width_kms;
        if given.is_some() && settings.values.get(Parameter::EquivalentWidth).is_none() {
            all.push(Change::MeasuredStrength);
        }
        all.extend(level(patient).map(Change::Level));
        if settings.sets[0].nuisances.is_none() {
            all.extend([Change::Offsets, Change::Slopes]);
        }
        all.extend(range(patient).map(|(from, to)| Change::Range(from, to)));
        all
    }

    /// The property it changes.
    pub fn reason(&self) -> Reason {
        match self {
            Change::Vsini(_) => Reason::Vsini,
            Change::LineWidth(_) => Reason::LineWidth,
            Change::Wings(..) => Reason::LineWings,
            Change::BrightAndDark => Reason::Brightness,
            Change::Period(_) => Reason::RotationPeriod,
            Change::MeasuredStrength => Reason::EquivalentWidth,
            Change::Level(_) | Change::Offsets | Change::Slopes => Reason::Continuum,
            Change::Range(..) => Reason::VelocityRange,
        }
    }

    /// The property in words.
    pub fn name(&self) -> &'static str {
        match self.reason() {
            Reason::Vsini => "vsini",
            Reason::LineWidth => "the width of the local line",
            Reason::LineWings => "the shape of the local line",
            Reason::Brightness => "a map without bright pixels",
            Reason::RotationPeriod => "the rotation period",
            Reason::EquivalentWidth => "the equivalent width of the line",
            Reason::Continuum => "the continuum",
            Reason::VelocityRange => "the velocity range",
            Reason::DoubleLines => "the line of a second star",
            Reason::Variances | Reason::Errors => "the errors",
        }
    }

    /// The change in words, with the keys to set.
    pub fn words(&self, patient: &Patient) -> String {
        let settings = &patient.settings;
        let Settings { values, star, .. } = settings;
        match self {
            Change::Vsini(factor) => {
                let vsini = values[Parameter::Vsini];
                format!("star.vsini_kms = {:.1} instead of {vsini}", factor * vsini)
            }
            Change::LineWidth(factor) => {
                let instrument = star.line.instrumental_sigma_kms;
                let local = local_sigma(patient);
                let wanted = (factor * local.hypot(instrument)).powi(2) - instrument.powi(2);
                match wanted > 0.0 {
                    true => format!("star.line.sigma_kms = {:.1} instead of {local}", wanted.sqrt()),
                    false => "a higher instrument.resolving_power and a narrower line".to_owned(),
                }
            }
            Change::Wings(gamma, sigma) => {
                let total = star.line.sigma_kms;
                let local = before_spectrograph(sigma * total, star.line.instrumental_sigma_kms);
                format!("star.line.shape = \"voigt\", sigma_kms = {local:.1} and gamma_kms = {:.1}", gamma * total)
            }
            Change::BrightAndDark => "imaging.brightness = \"bright-and-dark\"".to_owned(),
            Change::Period(factor) => {
                let period = star.rotation_period_d;
                format!("star.rotation_period_d = {:.4} instead of {period}", factor * period)
            }
            Change::MeasuredStrength => {
                format!(
                    "star.line.equivalent_width_kms = \"auto\" instead of {}",
                    settings.sets[0].star.line.strength_kms()
                )
            }
            Change::Level(level) => {
                format!("observations.continuum_level = {level:.4} (times the present one, if there is one)")
            }
            Change::Offsets => format!("imaging.nuisances.continuum_offset = {OFFSET}"),
            Change::Slopes => format!("imaging.nuisances.continuum_slope = {OFFSET}"),
            Change::Range(from, to) => format!("observations.velocity_range_kms = [{from:.1}, {to:.1}]"),
        }
    }

    /// The subject with the change; `None` where that is invalid.
    pub fn applied(&self, patient: &Patient) -> Option<Patient> {
        let mut changed = patient.clone();
        let settings = &mut changed.settings;
        match self {
            Change::Vsini(factor) => settings.values.star.vsini_kms *= factor,
            Change::LineWidth(factor) => {
                settings.sets[0].star.line.sigma_kms *= factor;
                if settings.values.get(Parameter::LineSigma).is_some() {
                    settings.values.set(Parameter::LineSigma, settings.values[Parameter::LineSigma] * factor);
                }
            }
            Change::Wings(gamma, sigma) => {
                let line = &mut settings.sets[0].star.line;
                let (total, instrument) = (line.sigma_kms, line.instrumental_sigma_kms);
                line.gamma_kms = gamma * total;
                line.sigma_kms = before_spectrograph(sigma * total, instrument).hypot(instrument);
            }
            Change::BrightAndDark => settings.imaging.brightness = Some(BrightnessModel::BrightAndDark),
            // the orbit, if there is one, keeps its period in days
            Change::Period(factor) => settings.values.star.omega_eq_rad_d /= factor,
            Change::MeasuredStrength => settings.sets[0].star.line.equivalent_width_kms = None,
            Change::Level(level) => changed.observations = changed.observations.over_continuum(*level),
            Change::Offsets => {
                let offsets = LineAndContinuum { continuum_offset: OFFSET, ..Default::default() };
                settings.sets[0].nuisances = Some(offsets);
            }
            Change::Slopes => {
                let slopes = LineAndContinuum { continuum_slope: OFFSET, ..Default::default() };
                settings.sets[0].nuisances = Some(slopes);
            }
            Change::Range(from, to) => changed.observations = within(patient, *from, *to)?,
        }
        Some(changed)
    }

    /// Values half way to those `tried` on either side.
    pub fn between(&self, tried: &[Change]) -> Vec<Change> {
        let (make, at): (fn(f64) -> Change, f64) = match self {
            Change::Vsini(factor) => (Change::Vsini, *factor),
            Change::LineWidth(factor) => (Change::LineWidth, *factor),
            Change::Period(factor) => (Change::Period, *factor),
            _ => return Vec::new(),
        };
        let others = tried.iter().filter(|other| other.reason() == self.reason()).filter_map(Change::factor);
        // the unchanged value is one of those tried
        let others: Vec<f64> = others.chain([1.0]).collect();
        let below = others.iter().copied().filter(|x| *x < at).reduce(f64::max);
        let above = others.iter().copied().filter(|x| *x > at).reduce(f64::min);
        [below, above].into_iter().flatten().map(|other| make((at * other).sqrt())).collect()
    }

    fn factor(&self) -> Option<f64> {
        match self {
            Change::Vsini(factor) | Change::LineWidth(factor) | Change::Period(factor) => Some(*factor),
            _ => None,
        }
    }
}

/// Width (km/s) of a line that is `total_kms` wide behind the spectrograph, before it; a narrow one at least.
fn before_spectrograph(total_kms: f64, instrument_kms: f64) -> f64 {
    const NARROWEST_KMS: f64 = 0.5;
    (total_kms.powi(2) - instrument_kms.powi(2)).max(NARROWEST_KMS.powi(2)).sqrt()
}

/// Width of the local line (km/s) before the spectrograph, to two decimals.
fn local_sigma(patient: &Patient) -> f64 {
    let line = &patient.settings.sets[0].star.line;
    let local = (line.sigma_kms.powi(2) - line.instrumental_sigma_kms.powi(2)).max(0.0).sqrt();
    let sigma = patient.settings.values.get(Parameter::LineSigma).unwrap_or(local);
    (100.0 * sigma).round() / 100.0
}

/// Centre and half width of the line (km/s).
fn line(patient: &Patient) -> (f64, f64) {
    let Settings { values, star, .. } = &patient.settings;
    (values[Parameter::Vsys], values[Parameter::Vsini] + REACH_SIGMAS * star.line.sigma_kms)
}

/// Level of the continuum on both sides of the line, where it differs from 1.
fn level(patient: &Patient) -> Option<f64> {
    const FEWEST: usize = 2;
    const OFF: f64 = 1e-3;
    let profiles = &*patient.whole;
    let (centre, reach) = line(patient);
    let side = |sign: f64| {
        let beside = |profile: &Profile| -> Vec<f64> {
            let distance = |j: usize| sign * (profile.velocity_kms(j) - centre);
            let bins = profile.intensity.iter().enumerate();
            bins.filter(|(j, _)| (reach..=2.0 * reach).contains(&distance(*j))).map(|(_, i)| *i).collect()
        };
        let bins: Vec<f64> = profiles.profiles.iter().flat_map(beside).collect();
        (bins.len() >= FEWEST * profiles.profiles.len()).then(|| bins.iter().sum::<f64>() / bins.len() as f64)
    };
    let level = 0.5 * (side(-1.0)? + side(1.0)?);
    (level > 0.0 && (level - 1.0).abs() > OFF).then_some(level)
}

/// The range that contains the whole line, where the one used is narrower, or wider by more than half as much.
fn range(patient: &Patient) -> Option<(f64, f64)> {
    const WIDE: f64 = 1.5;
    let (centre, reach) = line(patient);
    let step = patient.observations.step_kms();
    let first = |p: &Profile| p.first_velocity_kms;
    let last = |p: &Profile| p.velocity_kms(p.intensity.len() - 1);
    let profiles = &patient.observations.profiles;
    let from = profiles.iter().map(first).fold(f64::NEG_INFINITY, f64::max);
    let to = profiles.iter().map(last).fold(f64::INFINITY, f64::min);
    let narrow = from > centre - reach + step || to < centre + reach - step;
    let wide = from < centre - WIDE * reach || to > centre + WIDE * reach;
    (narrow || wide).then_some((centre - reach, centre + reach))
}

/// The observations within another velocity range, uncertainties scaled like those in use.
fn within(patient: &Patient, from: f64, to: f64) -> Option<Observations> {
    const FEWEST: usize = 5;
    let step = patient.observations.step_kms();
    let source = &*patient.whole;
    let cut = |(profile, used): (&Profile, &Profile)| {
        let inside = |j: &usize| (from..=to).contains(&profile.velocity_kms(*j));
        let bins: Vec<usize> = (0..profile.intensity.len()).filter(inside).collect();
        let first = *bins.first().filter(|_| bins.len() >= FEWEST)?;
        // the factor on the errors of a profile is that of its first bin in use
        let same = ((used.first_velocity_kms - profile.first_velocity_kms) / step).round() as usize;
        let scale = used.sigma.first()? / profile.sigma.get(same)?;
        Some(Profile {
            time_d: profile.time_d,
            first_velocity_kms: profile.velocity_kms(first),
            step_kms: step,
            intensity: bins.iter().map(|&j| profile.intensity[j]).collect(),
            sigma: bins.iter().map(|&j| scale * profile.sigma[j]).collect(),
            exposure_s: used.exposure_s,
        })
    };
    let profiles = source.profiles.iter().zip(&patient.observations.profiles).map(cut).collect::<Option<Vec<_>>>()?;
    Some(Observations { profiles })
}
