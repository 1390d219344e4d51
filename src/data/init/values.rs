//! The values of a proposal: measured, given, or assumed.

use super::digits::{rounded, significant};
use super::known::{Given, Known};
use super::ledger::{Ledger, Source, origin};
use super::line;
use crate::data::config::{
    Automatic, Beside, Draft, EquivalentWidth, FITTED, ImagingSettings, Instrument, LimbDarkeningSection, LimbLaw,
    Line, LineShape, ObservationsSection, Sought, Spectrograph, Star, VelocityJitter,
};
use crate::model::Parameter;
use crate::numerics::units::instrumental_sigma_kms;
use crate::planets::periodogram::{Frequencies, FrequencySettings, USUAL_STABILITY_KMS, most_offset_kms};
use crate::planets::speeds::with_unit;
use crate::star::observation::Observations;
use crate::star::{BrightnessModel, Size};
use crate::surface::calibration::first_look::{FirstLook, LineModel, LookError, Noise};
use crate::surface::calibration::noise;
use crate::surface::calibration::noise::MeasuredErrors;
use crate::surface::nuisances::LineAndContinuum;

/// Default assumptions.
mod assumed {
    /// Inclination (degrees): the median of random orientations.
    pub const INCLINATION_DEG: f64 = 60.0;
    /// Temperatures (K) of a young K dwarf and its spots.
    pub const PHOTOSPHERE_K: f64 = 5000.0;
    pub const SPOT_K: f64 = 3500.0;
    /// Wavelength (nm), and coefficient of linear limb darkening of a cool dwarf at it.
    pub use crate::data::config::{USUAL_LIMB_DARKENING as LIMB_DARKENING, USUAL_WAVELENGTH_NM as WAVELENGTH_NM};
    /// Standard deviation (km/s) of the lines of a dwarf that does not rotate.
    pub const LINE_SIGMA_KMS: f64 = 2.5;
    /// Resolving power of ESPaDOnS and NARVAL.
    pub const RESOLVING_POWER: f64 = 65_000.0;
    /// Periods over the rotation period, where the latter is unknown.
    pub const PORB_OVER_PROT: (f64, f64) = (0.5, 5.0);
}

/// The prior of the systemic velocity reaches this many standard errors, and at least this far (km/s).
const VSYS_REACH: (f64, f64) = (6.0, 0.5);

/// A difference of given and measured vsini by more than this many standard errors is reported.
const DISAGREEMENT: f64 = 3.0;

/// Beyond this many, no orbit can compensate for it.
const ANOTHER_STAR: f64 = 5.0;

/// Differential rotation of the Sun (rad/d), and the angle (rad) between equator and pole from which a map shows it.
const SOLAR_DOMEGA_RAD_D: f64 = 0.055;
const SHEAR_RAD: f64 = 0.2;

/// A vsini below this (km/s) rounds to 0.
const NARROWEST_KMS: f64 = 0.05;

/// Profiles that show an orbit.
const FEWEST_FOR_AN_ORBIT: usize = 3;

/// Inputs needed before the velocity range is cut.
pub(super) struct Values {
    pub look: FirstLook,
    pub velocity_range_kms: (f64, f64),
    /// Level of the continuum that the profiles were divided by, if they were.
    pub continuum_level: Option<f64>,
    line_sigma_kms: f64,
    resolving_power: f64,
    limb_darkening: f64,
}

impl Values {
    /// A first look at all observations, with the position of the line. Profiles whose continuum is not at 1 are
    /// divided by its level.
    pub fn measure(whole: &mut Observations, known: &Known, ledger: &mut Ledger) -> Result<Self, LookError> {
        let assume = |value: f64, remark: &'static str| (value, Source::Assumed, remark);
        let resolving_power = ledger.settle(
            ("instrument.resolving_power", ""),
            &known.resolving_power,
            assume(assumed::RESOLVING_POWER, "--instrument, or --resolving-power"),
        );
        let limb_darkening = ledger.settle(
            ("star.limb_darkening", ""),
            &known.limb_darkening,
            assume(assumed::LIMB_DARKENING, "coefficient of the linear law; --limb-darkening"),
        );
        if let Some(given) = &known.line_gamma_kms {
            ledger.note("star.line.gamma_kms", given.value, "km/s", Source::Given, given.by.as_str());
        }
        let sigma_kms = known.line_sigma_kms.as_ref().map_or(assumed::LINE_SIGMA_KMS, |given| given.value);
        let model = LineModel {
            limb_darkening,
            sigma_kms: known.line_width_kms(sigma_kms),
            instrumental_sigma_kms: instrumental_sigma_kms(resolving_power),
            is_guess: known.line_sigma_kms.is_none(),
        };
        let mut look = FirstLook::at(whole, model)?;
        if known.vsini_kms.is_none() && look.unspotted.vsini_kms < NARROWEST_KMS {
            let (sigma_kms, instrumental_kms) = (look.unspotted.line_sigma_kms, model.instrumental_sigma_kms);
            return Err(LookError::Unresolved { sigma_kms, instrumental_kms });
        }
        let mut continuum_level = None;
        if let Some((measured, error)) = look.level {
            let level = rounded(measured, 4);
            *whole = whole.clone().over_continuum(level);
            look = FirstLook::at(whole, model)?;
            continuum_level = Some(level);
            line::note_continuum(level, error, ledger);
        }
        let line_sigma_kms = line::sigma_kms(&look, model, known, ledger);
        let velocity_range_kms = line::velocity_range(&look, model, whole.step_kms(), known, ledger);
        Ok(Values { look, velocity_range_kms, continuum_level, line_sigma_kms, resolving_power, limb_darkening })
    }

    /// Combines the measurements of other data sets: vsini and local line become the means of all, weighted by their
    /// uncertainties, and the time base is that of all.
    pub fn join(&mut self, others: &[&Values], known: &Known, ledger: &mut Ledger) {
        if others.is_empty() {
            return;
        }
        let looks = || others.iter().map(|other| &other.look).chain([&self.look]);
        let vsini = looks().map(|look| (look.unspotted.vsini_kms, look.vsini_error_kms));
        let (vsini_kms, vsini_error_kms) = weighted_mean(vsini);
        let line = looks().filter_map(|look| Some((look.unspotted.line_sigma_kms, look.line_sigma_error_kms?)));
        let (sigma_kms, sigma_error_kms) = weighted_mean(line);
        let first = looks().map(|look| look.span_d.0).fold(f64::INFINITY, f64::min);
        let last = looks().map(|look| look.span_d.1).fold(f64::NEG_INFINITY, f64::max);
        self.look.span_d = (first, last);
        (self.look.unspotted.vsini_kms, self.look.vsini_error_kms) = (vsini_kms, vsini_error_kms);
        if known.line_sigma_kms.is_none() && sigma_error_kms > 0.0 {
            self.line_sigma_kms = rounded(sigma_kms, 1);
            let remark = format!("± {sigma_error_kms:.1}, local line, mean of all data sets; --line-sigma");
            ledger.replace("star.line.sigma_kms", self.line_sigma_kms, &remark);
        }
    }

    /// The config's values, from the profiles of each data set within the velocity range.
    pub fn draft(&self, cuts: &[&Observations], beside: Beside, known: &Known, ledger: &mut Ledger) -> Draft {
        let look = &self.look;
        let assume = |value: f64, remark: &'static str| (value, Source::Assumed, remark);
        let rotation_period_d = self.rotation_period(known, ledger);
        let mid_d = rounded(0.5 * (look.span_d.0 + look.span_d.1), 3);
        let epoch = (mid_d, Source::Data, "middle of the observations; --epoch");
        let inclination = assume(assumed::INCLINATION_DEG, "the median of random orientations; --inclination");
        let by_fit = format!("± {:.1}, flanks of the mean profile; --vsini", look.vsini_error_kms);
        let vsini = (rounded(look.unspotted.vsini_kms, 1), Source::Data, by_fit.as_str());
        let by_centre = format!("± {:.2}, centre of the mean profile", look.centre_error_kms);
        let vsys = (rounded(look.unspotted.centre_kms, 2), Source::Data, by_centre.as_str());
        let vsys_kms = ledger.settle(("star.vsys_kms", "km/s"), &known.vsys_kms, vsys);
        let (porb_over_prot, porb_over_prot_range) = self.periods(cuts, rotation_period_d, ledger);
        let epoch_d = ledger.settle(("star.epoch_d", "d"), &known.epoch_d, epoch);
        let inclination_deg = ledger.settle(("star.inclination_deg", "deg"), &known.inclination_deg, inclination);
        let vsini_kms = ledger.settle(("star.vsini_kms", "km/s"), &known.vsini_kms, vsini);
        let gamma_kms = known.line_gamma_kms.as_ref().map(|given| given.value);
        let name = known.name.as_ref().map(|given| {
            ledger.note("star.name", &given.value, "", Source::Given, given.by.as_str());
            given.value.clone()
        });
        let star = Star {
            name,
            rotation_period_d,
            epoch_d,
            inclination_deg,
            vsini_kms,
            vsys_kms,
            omega_eq_rad_d: None,
            domega_rad_d: ledger.settle(
                ("star.domega_rad_d", "rad/d"),
                &known.domega_rad_d,
                assume(0.0, "no differential rotation; --domega"),
            ),
            mass_msun: None,
            limb_darkening: LimbDarkeningSection { law: LimbLaw::Linear, coefficients: vec![self.limb_darkening] },
            photosphere_k: Some(ledger.settle(
                ("star.photosphere_k", "K"),
                &known.photosphere_k,
                assume(assumed::PHOTOSPHERE_K, "--photosphere"),
            )),
            spot_k: Some(ledger.settle(("star.spot_k", "K"), &known.spot_k, assume(assumed::SPOT_K, "--spot"))),
            wavelength_nm: ledger.settle(
                ("star.wavelength_nm", "nm"),
                &known.wavelength_nm,
                assume(assumed::WAVELENGTH_NM, "of the LSD profiles; --instrument, or --wavelength"),
            ),
            contrast: None,
            line: Line {
                shape: gamma_kms.map_or(LineShape::Gaussian, |_| LineShape::Voigt),
                sigma_kms: self.line_sigma_kms,
                gamma_kms,
                equivalent_width_kms: equivalent_width(cuts, known, ledger),
            },
            fitted: fitted(cuts.len(), known, ledger),
            velocity_drift: None,
            regions: None,
        };
        let imaging = imaging(known, ledger);
        let sought = Sought {
            k_kms: (0.0, k_max(cuts, ledger)),
            porb_over_prot: porb_over_prot_range,
            vsys_kms: self.vsys_range(vsys_kms, ledger),
        };
        let name = known.instrument_name.as_ref().map(|given| {
            ledger.note("instrument.name", given.value, "", Source::Given, given.by.as_str());
            given.value.to_owned()
        });
        let instrument = Instrument { name, resolving_power: Some(self.resolving_power), stability_ms: None };
        Draft::new(star, instrument, beside, imaging, sought, porb_over_prot)
    }

    /// The profiles as a data set; with its own nuisances where it is one of several.
    pub fn section(&self, known: &Known, ledger: &mut Ledger, several: bool) -> ObservationsSection {
        let sigma_scale = known.sigma_scale.as_ref().map_or(Automatic::AUTO, |given| Automatic::Number(given.value));
        ObservationsSection {
            velocity_range_kms: Some(self.velocity_range_kms.into()),
            sigma_scale: Some(sigma_scale),
            continuum_level: self.continuum_level,
            velocity_jitter_kms: Some(VelocityJitter::FITTED),
            nuisances: if several { self.nuisances(ledger) } else { None },
            ..ObservationsSection::default()
        }
    }

    fn rotation_period(&self, known: &Known, ledger: &mut Ledger) -> Option<f64> {
        const KEY: &str = "star.rotation_period_d";
        match &known.rotation_period_d {
            Some(given) => ledger.note(KEY, given.value, "d", Source::Given, given.by.as_str()),
            None => ledger.note(KEY, "null", "d", Source::Missing, "--rotation-period, or by hand in the config"),
        }
        known.rotation_period_d.as_ref().map(|given| given.value)
    }

    /// Start and prior of `Porb/Prot`: the periods that `periodogram` searches, up to one orbit in the whole time base.
    fn periods(&self, cuts: &[&Observations], rotation: Option<f64>, ledger: &mut Ledger) -> (f64, (f64, f64)) {
        const KEY: &str = "parameters.porb_over_prot";
        let searched = rotation.filter(|period| *period > 0.0).and_then(|period| {
            let times_d = cuts.iter().flat_map(|cut| cut.times_d());
            let cycles: Vec<f64> = times_d.map(|time| time / period).collect();
            let frequencies = Frequencies::new(&cycles, period, FrequencySettings::default()).ok()?;
            let shortest = 1.0 / frequencies.per_cycle.last()?;
            Some((significant(shortest, f64::ceil), significant(frequencies.time_base_cycles, f64::floor)))
        });
        let usable = searched.filter(|(min, max)| min < max);
        let (min, max) = usable.unwrap_or(assumed::PORB_OVER_PROT);
        let shown = format!("{min} to {max}");
        match (usable, rotation) {
            (Some(_), Some(period)) => {
                let days = format!("log-uniform; {:.3} to {:.3} d, from the times", min * period, max * period);
                ledger.note(KEY, shown, "", Source::Data, days);
            }
            _ => ledger.note(KEY, shown, "", Source::Assumed, "log-uniform; give what the times can show"),
        }
        let start = if (min..=max).contains(&2.0) { 2.0 } else { significant((min * max).sqrt(), f64::round) };
        (start.clamp(min, max), (min, max))
    }

    /// Levels and slopes of single continua, where their rms exceeds the noise.
    pub fn nuisances(&self, ledger: &mut Ledger) -> Option<LineAndContinuum> {
        let continuum = self.look.continuum?;
        let mut nuisances = LineAndContinuum::default();
        if let Some(wandering) = continuum.wandering {
            nuisances.continuum_offset = significant(wandering, f64::ceil);
            let remark = format!("the continuum varies between profiles by {wandering:.1e}, above the noise");
            let level = nuisances.continuum_offset;
            ledger.note("imaging.nuisances.continuum_offset", level, "", Source::Data, remark);
        }
        if let Some(tilting) = continuum.tilting {
            let (from, to) = self.velocity_range_kms;
            nuisances.continuum_slope = significant(0.5 * (to - from) * tilting, f64::ceil);
            let remark = "continua are tilted by this from the middle to the ends, above the noise";
            ledger.note("imaging.nuisances.continuum_slope", nuisances.continuum_slope, "", Source::Data, remark);
        }
        (nuisances != LineAndContinuum::default()).then_some(nuisances)
    }

    /// The factor on the uncertainties with its reason; `measured` is the result of "auto".
    pub fn note_errors(&self, known: &Known, measured: Option<&MeasuredErrors>, ledger: &mut Ledger) {
        let noise = &self.look.noise;
        let auto = match (measured, noise.scatter) {
            (Some(measured), _) if measured.sigma_scale.is_none() => measured.line(),
            (Some(measured), _) => format!("measured by every command: {}", measured.line()),
            (None, Some(scatter)) => {
                format!(
                    "estimate; measured by every command: quoted uncertainty {:.1e}, continuum rms {scatter:.1e}",
                    noise.quoted
                )
            }
            (None, None) if known.objective().properties().map_changes => {
                format!("as quoted, {:.1e}: {}", noise.quoted, noise::NO_CONTINUUM)
            }
            (None, None) => {
                format!("measured by every command, by a map alone: quoted uncertainty {:.1e}", noise.quoted)
            }
        };
        let given =
            known.sigma_scale.as_ref().map(|given| Given { value: given.value.to_string(), by: given.by.clone() });
        ledger.settle(("observations.sigma_scale", ""), &given, ("auto".to_owned(), Source::Data, &auto));
    }

    /// The RV jitter with its reason.
    pub fn note_jitter(draft: &Draft, ledger: &mut Ledger) {
        const KEY: &str = "observations.velocity_jitter_kms";
        match draft.observations.sections[0].velocity_jitter_kms.unwrap_or_default() {
            VelocityJitter::Word(_) => {
                let remark = "measured by every command: RV jitter of single profiles, counted as noise";
                ledger.note(KEY, "fitted", "km/s", Source::Data, remark);
                // of static maps none are fitted
                if draft.imaging.objective.properties().has_field {
                    let of_name = |name: &String| Some(Spectrograph::named(name)?.stability_ms / 1e3);
                    let stability_kms = draft.instrument.name.as_ref().and_then(of_name).unwrap_or(USUAL_STABILITY_KMS);
                    let most = with_unit(most_offset_kms(stability_kms));
                    let remark = match draft.instrument.name {
                        Some(_) => {
                            format!("RV offsets of nights, up to {most}, twice the stability of the spectrograph")
                        }
                        None => format!(
                            "RV offsets of nights, up to {most} as no spectrograph is named (assumed stability: {}): \
                            they hide small planets; --instrument",
                            with_unit(stability_kms)
                        ),
                    };
                    ledger.note("observations.night_jitter_kms", "fitted", "km/s", Source::Assumed, remark);
                }
            }
            VelocityJitter::Number(kms) => {
                let remark = "too few profiles to measure the RV jitter";
                ledger.note(KEY, kms, "km/s", Source::Assumed, remark);
            }
        }
    }

    fn vsys_range(&self, vsys_kms: f64, ledger: &mut Ledger) -> (f64, f64) {
        let (errors, least) = VSYS_REACH;
        let (centre, reach) = (self.look.unspotted.centre_kms, (errors * self.look.centre_error_kms).max(least));
        let min = rounded(vsys_kms.min(centre) - reach, 1);
        let max = rounded(vsys_kms.max(centre) + reach, 1);
        ledger.note(
            "parameters.vsys_kms",
            format!("{min} to {max}"),
            "km/s",
            Source::Data,
            "uniform; around the centre",
        );
        (min, max)
    }

    /// What was observed.
    pub fn observed(&self, whole: &Observations) -> String {
        let (first, last) = self.look.span_d;
        let bins = whole.len() / whole.profiles.len().max(1);
        format!(
            "{} profiles of {bins} bins of {:.3} km/s, from {first:.3} to {last:.3} ({:.3} d); quoted S/N {:.0} per \
            bin",
            whole.profiles.len(),
            whole.step_kms(),
            last - first,
            1.0 / self.look.noise.quoted
        )
    }

    /// Difference of given and measured vsini in standard errors; 0 if none is given.
    fn disagreement(&self, known: &Known) -> f64 {
        let (measured, error) = (self.look.unspotted.vsini_kms, self.look.vsini_error_kms);
        known.vsini_kms.as_ref().map_or(0.0, |given| (given.value - measured).abs() / error)
    }

    /// Whether the given vsini is so wrong that a search for an orbit is useless.
    pub fn is_another_star(&self, known: &Known) -> bool {
        self.disagreement(known) > ANOTHER_STAR
    }

    /// Given values that are inconsistent with the profiles, and important assumptions.
    pub fn notes(&self, known: &Known, profiles: usize) -> Vec<String> {
        let (measured, error) = (self.look.unspotted.vsini_kms, self.look.vsini_error_kms);
        let disagrees = self.disagreement(known) > DISAGREEMENT;
        let vsini = known.vsini_kms.as_ref().filter(|_| disagrees).map(|given| {
            format!("the given vsini is {} km/s, the mean profile suggests {measured:.1} ± {error:.1}", given.value)
        });
        let days = self.look.span_d.1 - self.look.span_d.0;
        let given = |value: &Option<Given<f64>>| value.as_ref().map(|given| given.value);
        let vsini_kms = given(&known.vsini_kms).unwrap_or(measured);
        let size = given(&known.rotation_period_d).map(|period_d| {
            let Size { radius_sin_i, equator_kms, break_up_kms, .. } =
                Size::of(period_d, vsini_kms, given(&known.inclination_deg).unwrap_or(assumed::INCLINATION_DEG));
            let turns = days / period_d;
            let few = if turns < 1.0 { ": the data span less than a rotation" } else { "" };
            format!(
                "R sin i = {radius_sin_i:.2} solar radii, equatorial velocity {equator_kms:.0} km/s (break-up \
                {break_up_kms:.0} km/s at 1 M_sun), {turns:.1} rotations observed{few}"
            )
        });
        let shear = SOLAR_DOMEGA_RAD_D * days;
        let rigid = known.domega_rad_d.is_none() && shear > SHEAR_RAD;
        let domega = rigid.then(|| {
            format!(
                "Solar-like differential rotation would shear the surface by {:.0}° over {days:.1} d: set --domega or \
                free domega_rad_d.",
                shear.to_degrees()
            )
        });
        let few = (profiles < FEWEST_FOR_AN_ORBIT).then(|| {
            format!(
                "{profiles} profiles suffice for a map, not for an orbit: `periodogram` and `sample` take \
                {FEWEST_FOR_AN_ORBIT} or more"
            )
        });
        size.into_iter().chain(vsini).chain(domega).chain(few).collect()
    }
}

/// The remark on uncertainties that look like variances.
pub(super) fn variances(whole: &Observations, noise: &Noise) -> Option<String> {
    let by_continuum = noise.ratio().map(|ratio| (noise.quoted, ratio));
    let (quoted, factor) = by_continuum.or_else(|| noise::by_neighbours(whole))?;
    noise::variances(quoted, factor)
}

/// Weighted mean of values with standard errors, and its standard error.
fn weighted_mean(values: impl Iterator<Item = (f64, f64)>) -> (f64, f64) {
    let (sum, weights) = values.fold((0.0, 0.0), |(sum, weights), (x, error)| {
        let weight = error.powi(-2);
        (sum + weight * x, weights + weight)
    });
    (sum / weights, weights.sqrt().recip())
}

/// Parameters of the star that every command fits under priors around the values here; none with static maps. Each of
/// several data sets has its own equivalent width and limb darkening.
fn fitted(data_sets: usize, known: &Known, ledger: &mut Ledger) -> Vec<String> {
    if !known.objective().properties().has_field {
        return Vec::new();
    }
    let common = |parameter: &&Parameter| matches!(parameter, Parameter::LineSigma | Parameter::Vsini);
    let names = FITTED.iter().filter(|parameter| data_sets == 1 || common(parameter));
    let names: Vec<String> = names.map(|parameter| parameter.name().to_owned()).collect();
    let remark = format!("{}; prior means as listed", names.join(", "));
    ledger.note("star.fitted", format!("{} parameters", names.len()), "", Source::Assumed, remark);
    names
}

fn equivalent_width(cuts: &[&Observations], known: &Known, ledger: &mut Ledger) -> EquivalentWidth {
    let widths: Vec<String> = cuts.iter().map(|cut| format!("{:.3}", cut.mean_equivalent_width_kms())).collect();
    let auto = format!("{} km/s in this range", widths.join(" and "));
    let value = known.equivalent_width.as_ref().map_or(EquivalentWidth::AUTO, |given| given.value);
    let (source, by) = origin(&known.equivalent_width, "");
    let (shown, unit, remark) = match value {
        EquivalentWidth::Word(_) => {
            ("auto".to_owned(), "", [by, auto].join(if source == Source::Given { "; " } else { "" }))
        }
        EquivalentWidth::Number(width) => (width.to_string(), "km/s", format!("{by}; the profiles have {auto}")),
    };
    ledger.note("star.line.equivalent_width_kms", shown, unit, source, remark);
    value
}

fn imaging(known: &Known, ledger: &mut Ledger) -> ImagingSettings {
    let mut imaging = ImagingSettings { objective: known.objective(), ..ImagingSettings::default() };
    // a field of spots is brighter and darker than the photosphere
    if !known.objective().properties().has_field {
        let brightness = known.brightness.as_ref().map_or(BrightnessModel::BrightAndDark, |given| given.value);
        let (source, remark) = match &known.brightness {
            Some(given) => (Source::Given, given.by.as_str()),
            None => (Source::Assumed, "a spots-only map cannot represent faculae; the misfit would mimic an orbit"),
        };
        ledger.note("imaging.brightness", brightness.name(), "", source, remark);
        imaging.brightness = Some(brightness);
    }
    if let Some(given) = &known.pixels {
        imaging.pixels = given.value;
        ledger.note("imaging.pixels", given.value, "", Source::Given, given.by.as_str());
    }
    if let Some(given) = &known.chi2_target {
        imaging.chi2_target = Automatic::Number(given.value);
        ledger.note("imaging.chi2_target", given.value, "", Source::Given, given.by.as_str());
    }
    imaging
}

/// The objective of a reconstruction, with its reason.
pub(super) fn note_objective(draft: &Draft, known: &Known, ledger: &mut Ledger) {
    let (source, remark) = match &known.objective {
        Some(given) => (Source::Given, given.by.as_str()),
        None => (Source::Assumed, "spots of most stars evolve within the observations, which mimics an orbit"),
    };
    ledger.note("imaging.objective", draft.imaging.objective.name(), "", source, remark);
}

/// Upper bound of K: the peak-to-peak range of the lines' velocities, twice the K of a planet that would cause it.
fn k_max(cuts: &[&Observations], ledger: &mut Ledger) -> f64 {
    const PHOTON_ERRORS: f64 = 5.0;
    // velocities of each data set about their mean: an offset between data sets is not an orbit
    let moments: Vec<(f64, f64)> = cuts
        .iter()
        .flat_map(|cut| {
            let moments = cut.first_moments();
            let mean = moments.iter().map(|m| m.value_kms).sum::<f64>() / moments.len() as f64;
            moments.into_iter().map(move |m| (m.value_kms - mean, m.sigma_kms))
        })
        .collect();
    let count = moments.len() as f64;
    let extreme = |f: fn(f64, f64) -> f64| moments.iter().map(|(value, _)| *value).reduce(f).unwrap_or(f64::NAN);
    let photons = PHOTON_ERRORS * moments.iter().map(|(_, sigma)| sigma).sum::<f64>() / count;
    let max = significant((extreme(f64::max) - extreme(f64::min)).max(photons), f64::ceil);
    let rms = (moments.iter().map(|(value, _)| value * value).sum::<f64>() / count).sqrt();
    let remark = format!("uniform; peak-to-peak range of the first moments (rms {rms:.3})");
    ledger.note("parameters.k_kms", format!("0 to {max}"), "km/s", Source::Data, remark);
    max
}

/// The orbit that the config starts from, and the systemic velocity that comes with it.
pub(super) fn note_orbit(draft: &Draft, found: bool, ledger: &mut Ledger) {
    let (k, period, phi) = draft.orbit();
    match found {
        true => {
            let shown = format!("{k}, {period}, {phi}");
            ledger.note(
                "planet.k_kms, ...",
                shown,
                "",
                Source::Data,
                "start: K (km/s), Porb/Prot, phi of the best orbit",
            );
            ledger.replace("star.vsys_kms", draft.star.vsys_kms, "start: with the best orbit");
        }
        false => ledger.note("planet.k_kms", k, "km/s", Source::Assumed, "start: no planet"),
    }
}
