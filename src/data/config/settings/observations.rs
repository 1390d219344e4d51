//! The data sets: the settings of each, and those allowed for one only.

use super::checks::{
    NUISANCES, automatic, check_jitter, check_nuisances, check_size, check_windows, check_zero_point, most, names,
};
use super::simulation::{simulation, spots, times_d};
use super::star::resolve_star;
use crate::data::config::error::Fault;
use crate::data::config::written::{
    Automatic, Config, EventWindows, EventsKey, EventsWord, Instrument, ObservationsSection, VelocityJitter, ZeroPoint,
};
use crate::data::simulate::Simulation;
use crate::model::{Parameter, ParameterValues};
use crate::numerics::units::SECONDS_PER_DAY;
use crate::star::exposure::LONGEST_ROTATIONS;
use crate::star::{BrightnessModel, LimbDarkening, Regions, StarSettings};
use crate::surface::calibration::noise::ErrorSettings;
use crate::surface::nuisances::LineAndContinuum;
use std::path::{Path, PathBuf};

/// Range of continuum levels that profiles may be divided by: outside, they are in other units.
const CONTINUUM_LEVELS: std::ops::RangeInclusive<f64> = 0.5..=2.0;

/// A data set.
#[derive(Clone, Debug)]
pub struct DataSetSettings {
    /// Its key in the config.
    pub key: String,
    /// Its name.
    pub name: String,
    /// The star with the overrides of this set; where the equivalent width of its line is left to the profiles,
    /// [`star_for`](crate::data::calibrated::star_for) measures it.
    pub star: StarSettings,
    /// Overrides of active regions for this set.
    pub regions: Option<Regions>,
    /// Override of the limb darkening for this set.
    pub limb_darkening: Option<LimbDarkening>,
    /// Whether the contrast of spots is fitted to its profiles.
    pub fits_contrast: bool,
    /// Where the profiles come from.
    pub source: ObservationSource,
    /// Line and continuum of each profile.
    pub nuisances: Option<LineAndContinuum>,
    /// Its RV jitter in units of the largest of all sets.
    pub jitter_share: f64,
    /// Standard deviation of nightly RV offsets (km/s).
    pub night_jitter_kms: Option<f64>,
    /// RV offset of all its profiles.
    pub zero_point: ZeroPoint,
    /// Exposure time (s) of profiles whose own is not known.
    pub exposure_s: Option<f64>,
    /// Windows of time (d) whose profiles are left out.
    pub exclude: Vec<[f64; 2]>,
    /// Prior of events, profiles that the others do not predict; `None` where events are not sought.
    pub events: Option<EventWindows>,
}

impl DataSetSettings {
    /// The simulation.
    pub fn simulation(&self) -> Option<&Simulation> {
        match &self.source {
            ObservationSource::Simulate(simulation) => Some(simulation),
            ObservationSource::Files { .. } => None,
        }
    }

    /// Level of the continuum in its files.
    pub fn continuum_level(&self) -> f64 {
        match self.source {
            ObservationSource::Files { continuum_level, .. } => continuum_level,
            ObservationSource::Simulate(_) => 1.0,
        }
    }
}

/// Where the profiles come from.
// there is one of them in a config
#[allow(clippy::large_enum_variant)]
#[derive(Clone, Debug, PartialEq)]
pub enum ObservationSource {
    /// Files.
    Files {
        /// The list, relative to the working directory.
        path: PathBuf,
        /// First and last velocity to use (km/s, after subtraction of VRAD); all bins if `None`.
        velocity_range_kms: Option<(f64, f64)>,
        /// Factor on every sigma, 1 where that is left to the observations.
        sigma_scale: f64,
        /// Level of the continuum in the files: profiles read are divided by it.
        continuum_level: f64,
        /// Measurement of uncertainties from the observations.
        errors: ErrorSettings,
    },
    /// A simulation.
    Simulate(Simulation),
}

/// Resolves all data sets of `written`, the star's own settings being `star`. `config` is the config's path, whose
/// folder paths start from.
pub(super) fn resolve_sets(
    written: &mut Config,
    star: &StarSettings,
    values: &ParameterValues,
    config: &Path,
) -> Result<Vec<DataSetSettings>, Fault> {
    check_several(written)?;
    let mut sets = Vec::new();
    let has_field = written.imaging.objective.properties().has_field;
    let largest_kms = largest_jitter_kms(&written.observations.sections);
    for s in 0..written.observations.sections.len() {
        let key = written.observations.key(s);
        let star = star_of(written, s, &key, star, values)?;
        let section = &mut written.observations.sections[s];
        check_windows(&section.exclude, &format!("{key}.exclude"))?;
        if let Some(problem) = section.exposure_s.and_then(|exposure_s| too_long(exposure_s, &star)) {
            return Err(Fault::new(format!("{key}.exposure_s"), problem));
        }
        let source = source(section, &key, &star, values, config)?;
        if let Some(priors) = &section.nuisances {
            check_nuisances(&format!("{key}.nuisances"), NUISANCES, priors)?;
        }
        if let ZeroPoint::Number(kms) = section.zero_point_kms {
            check_zero_point(&format!("{key}.zero_point_kms"), kms)?;
        }
        let fits_contrast = section.contrast.is_some_and(|contrast| contrast.is_word());
        if fits_contrast && (s == 0 || !has_field) {
            let problem = match has_field {
                true => "a number: contrasts of other data sets are fitted relative to that of the first",
                false => "a number: fitted with imaging.objective \"marginal-likelihood\" only",
            };
            return Err(Fault::new(format!("{key}.contrast"), problem));
        }
        let night_jitter_kms = section.night_jitter_kms;
        check_jitter(&format!("{key}.night_jitter_kms"), night_jitter_kms.unwrap_or(0.0))?;
        if night_jitter_kms.is_some_and(|kms| kms > 0.0) && !has_field {
            let problem = "no effect but with imaging.objective \"marginal-likelihood\"";
            return Err(Fault::new(format!("{key}.night_jitter_kms"), problem));
        }
        let own_kms = section.velocity_jitter_kms.and_then(|jitter| jitter.number());
        sets.push(DataSetSettings {
            jitter_share: own_kms.filter(|_| largest_kms > 0.0).map_or(1.0, |kms| kms / largest_kms),
            night_jitter_kms,
            regions: section.regions.map(|_| star.regions),
            limb_darkening: section.limb_darkening.as_ref().map(|_| star.limb_darkening),
            fits_contrast,
            name: section.name.clone().unwrap_or_else(|| format!("set{}", s + 1)),
            star,
            source,
            nuisances: section.nuisances.or(written.imaging.nuisances),
            zero_point: section.zero_point_kms,
            exposure_s: section.exposure_s,
            exclude: section.exclude.clone(),
            events: events(section.events.as_ref(), has_field, &key)?,
            key,
        });
    }
    names(&sets.iter().map(|set| (&*set.key, &*set.name)).collect::<Vec<_>>())?;
    of_one_star(written, &mut sets)?;
    Ok(sets)
}

/// The error of an exposure of this length (s), if any: within an exposure the model averages over, the star must show
/// nearly the same side.
pub fn too_long(exposure_s: f64, star: &StarSettings) -> Option<String> {
    if !(exposure_s >= 0.0 && exposure_s.is_finite()) {
        return Some(format!("{exposure_s} s must be 0 or more"));
    }
    let period_d = star.rotation_period_d;
    let rotations = exposure_s / SECONDS_PER_DAY / period_d;
    (rotations > LONGEST_ROTATIONS).then(|| {
        format!(
            "{exposure_s} s is {rotations:.4} of a rotation (star.rotation_period_d {period_d} d), at most \
            {LONGEST_ROTATIONS} is modelled: give each exposure as one profile"
        )
    })
}

/// The prior of events, checked; they are sought where maps evolve.
fn events(written: Option<&EventsKey>, has_field: bool, key: &str) -> Result<Option<EventWindows>, Fault> {
    let key = format!("{key}.events");
    match written {
        Some(EventsKey::Word(EventsWord::None)) => Ok(None),
        Some(_) if !has_field => Err(Fault::new(&key, "no effect but with imaging.objective \"marginal-likelihood\"")),
        Some(EventsKey::Windows(windows)) => {
            check_windows(&windows.include, &format!("{key}.include"))?;
            check_windows(&windows.exclude, &format!("{key}.exclude"))?;
            Ok(Some(windows.clone()))
        }
        Some(EventsKey::Word(EventsWord::Fitted)) | None => Ok(has_field.then(EventWindows::default)),
    }
}

/// Whether each data set has its own jitter.
pub(super) fn has_own_jitters(written: &Config) -> bool {
    let sections = &written.observations.sections;
    let is_number = |section: &ObservationsSection| section.velocity_jitter_kms.is_some_and(|jitter| !jitter.is_word());
    written.imaging.objective.properties().has_field && sections.iter().all(is_number)
}

/// The largest number among the jitters of data sets (km/s).
pub(super) fn largest_jitter_kms(sections: &[ObservationsSection]) -> f64 {
    let numbers = sections.iter().filter_map(|section| section.velocity_jitter_kms?.number());
    numbers.fold(0.0, f64::max)
}

/// Keys required for several sets, or useless for one.
fn check_several(written: &Config) -> Result<(), Fault> {
    let sections = &written.observations.sections;
    let objective = written.imaging.objective;
    for (s, section) in sections.iter().enumerate() {
        let key = written.observations.key(s);
        if sections.len() == 1 && section.zero_point_kms.is_word() {
            let problem = "the RV offset of a single data set is the systemic velocity: see star.vsys_kms";
            return Err(Fault::new(format!("{key}.zero_point_kms"), problem));
        }
        if section.zero_point_kms.is_word() && !objective.properties().marginalises {
            let problem = format!(
                "with {:?} a map would absorb a wrong RV offset: give a number (km/s), or set imaging.objective \
                \"marginal-likelihood\", which marginalises over it",
                objective.name()
            );
            return Err(Fault::new(format!("{key}.zero_point_kms"), problem));
        }
        if section.nuisances.is_some() && written.imaging.chi2_target.is_word() && objective.properties().has_target {
            let problem = format!("auto uses RVs, which {key}.nuisances absorb: give a number, such as 0.97");
            return Err(Fault::new("imaging.chi2_target", problem));
        }
        let spots = written.imaging.brightness() != BrightnessModel::BrightAndDark;
        let own = [("contrast", section.contrast.is_some()), ("wavelength_nm", section.wavelength_nm.is_some())];
        if let Some((name, _)) = own.into_iter().find(|(_, given)| *given && sections.len() > 1 && !spots) {
            let problem = "an image of bright and dark pixels is as bright in every data set";
            return Err(Fault::new(format!("{key}.{name}"), problem));
        }
        if section.velocity_jitter_kms != sections[0].velocity_jitter_kms && !has_own_jitters(written) {
            let first = written.observations.key(0);
            let problem = match objective.properties().has_field {
                true => format!("must be as in {first}, or a number in every data set"),
                false => format!("must be as in {first}: all data sets share one jitter"),
            };
            return Err(Fault::new(format!("{key}.velocity_jitter_kms"), problem));
        }
        if section.simulate.is_some() != sections[0].simulate.is_some() {
            return Err(Fault::new(key, "either all data sets are simulated, or none is"));
        }
    }
    Ok(())
}

/// Where the profiles of the data set at `key` come from; fills the default of its `sigma_scale`.
fn source(
    section: &mut ObservationsSection,
    key: &str,
    star: &StarSettings,
    values: &ParameterValues,
    config: &Path,
) -> Result<ObservationSource, Fault> {
    let at = |field: &str| format!("{key}.{field}");
    if let Some(VelocityJitter::Number(kms)) = section.velocity_jitter_kms {
        check_jitter(&at("velocity_jitter_kms"), kms)?;
    }
    let path = match (&section.path, &section.simulate) {
        (Some(path), None) => path,
        (None, Some(simulate)) => {
            let file_only = [
                ("velocity_range_kms", section.velocity_range_kms.is_some()),
                ("sigma_scale", section.sigma_scale.is_some()),
                ("continuum_level", section.continuum_level.is_some()),
                ("weights", !section.weights.is_default()),
                ("exclude", !section.exclude.is_empty()),
            ];
            if let Some((name, _)) = file_only.iter().find(|(_, given)| *given) {
                return Err(Fault::new(at(name), "for observations from files only"));
            }
            if star.line.equivalent_width_kms.is_none() {
                return Err(Fault::new("star.line.equivalent_width_kms", "auto is for observations from files only"));
            }
            let exposure_s = section.exposure_s;
            return Ok(ObservationSource::Simulate(simulation(simulate, star, values, (key, exposure_s))?));
        }
        (Some(_), Some(_)) => return Err(Fault::new(key, "give either path or simulate, not both")),
        (None, None) => return Err(Fault::new(key, "give path (of the list of profiles) or simulate")),
    };
    if path.as_os_str().is_empty() {
        return Err(Fault::new(at("path"), "is empty"));
    }
    let sigma_scale = *section.sigma_scale.get_or_insert(Automatic::Number(1.0));
    automatic(&at("sigma_scale"), sigma_scale)?;
    let errors = ErrorSettings { measured: sigma_scale.is_word(), weights: section.weights };
    let sigma_scale = sigma_scale.number().unwrap_or(1.0);
    for end in section.velocity_range_kms.into_iter().flatten() {
        check_size(&at("velocity_range_kms"), end, most::VELOCITY_KMS)?;
    }
    let continuum_level = section.continuum_level.unwrap_or(1.0);
    if !CONTINUUM_LEVELS.contains(&continuum_level) {
        let (min, max) = (CONTINUUM_LEVELS.start(), CONTINUUM_LEVELS.end());
        let problem = format!("{continuum_level} must be from {min} to {max}");
        return Err(Fault::new(at("continuum_level"), problem));
    }
    if let Some([min, max]) = section.velocity_range_kms
        && min >= max
    {
        let problem = format!("first velocity {min} must be below last velocity {max}");
        return Err(Fault::new(at("velocity_range_kms"), problem));
    }
    let velocity_range_kms = section.velocity_range_kms.map(Into::into);
    let path = config.parent().unwrap_or(Path::new("")).join(path);
    Ok(ObservationSource::Files { path, velocity_range_kms, sigma_scale, continuum_level, errors })
}

/// The star for a set: with the line, spot contrast and resolving power of the set, where it has any.
fn star_of(
    written: &Config,
    s: usize,
    key: &str,
    star: &StarSettings,
    values: &ParameterValues,
) -> Result<StarSettings, Fault> {
    let section = &written.observations.sections[s];
    let ObservationsSection { line, wavelength_nm, contrast, resolving_power, limb_darkening, regions, .. } = section;
    let mut own = written.star.clone();
    let held = |parameter: Parameter, name: &str| match values.get(parameter) {
        Some(_) if parameter.is_surface() => {
            let problem = format!("parameters.{} is free, and is that of all data sets", parameter.name());
            Err(Fault::new(format!("{key}.{name}"), problem))
        }
        _ => Ok(()),
    };
    if let Some(line) = line {
        held(Parameter::LineSigma, "line")?;
        held(Parameter::EquivalentWidth, "line")?;
        own.line = line.clone();
    }
    if let Some(wavelength_nm) = wavelength_nm {
        held(Parameter::Contrast, "wavelength_nm")?;
        if contrast.is_some() || own.contrast.is_some() {
            let problem = "star.contrast does not depend on wavelength: give star.photosphere_k and .spot_k instead";
            return Err(Fault::new(format!("{key}.wavelength_nm"), problem));
        }
        own.wavelength_nm = *wavelength_nm;
    }
    if let Some(contrast) = contrast {
        held(Parameter::Contrast, "contrast")?;
        if let Some(number) = contrast.number() {
            (own.contrast, own.photosphere_k, own.spot_k) = (Some(number), None, None);
        }
    }
    if let Some(limb_darkening) = limb_darkening {
        held(Parameter::LimbDarkening, "limb_darkening")?;
        own.limb_darkening = limb_darkening.clone();
    }
    if let Some(regions) = regions {
        Parameter::REGIONS.into_iter().try_for_each(|parameter| held(parameter, "regions"))?;
        own.regions = Some(*regions);
    }
    let resolution = resolving_power.or(written.instrument.resolving_power);
    let instrument = Instrument { resolving_power: resolution, ..Instrument::default() };
    let is_as_the_star = line.is_none() && wavelength_nm.is_none() && contrast.is_none() && resolving_power.is_none();
    if is_as_the_star && limb_darkening.is_none() && regions.is_none() {
        return Ok(star.clone());
    }
    resolve_star(&mut own, &instrument).map_err(|fault| {
        // values of star and instrument are already checked
        let name = fault.key.trim_start_matches("star.").trim_start_matches("instrument.");
        Fault::new(format!("{key}.{name}"), fault.problem)
    })
}

/// Of several simulated sets the first defines the star: its spots are shared by all.
fn of_one_star(written: &Config, sets: &mut [DataSetSettings]) -> Result<(), Fault> {
    let Some(first) = written.observations.sections[0].simulate.as_ref().filter(|_| sets.len() > 1) else {
        return Ok(());
    };
    let mut times = Vec::new();
    let mut seeds: Vec<u64> = Vec::new();
    for (s, (section, set)) in written.observations.sections.iter().zip(&*sets).enumerate() {
        let Some(own) = &section.simulate else { continue };
        let given = [
            ("spots", !own.spots.is_empty()),
            ("random_spots", own.random_spots.is_some()),
            ("faculae", !own.faculae.is_empty()),
            ("truth", !own.truth.is_empty()),
        ];
        if let Some((name, _)) = given.iter().find(|(_, given)| *given && s > 0) {
            let problem = format!("all data sets see one star: that is for {}.simulate", sets[0].key);
            return Err(Fault::new(format!("{}.simulate.{name}", set.key), problem));
        }
        if seeds.contains(&own.seed) {
            let problem = format!("{} is the seed of another data set, whose noise would be the same", own.seed);
            return Err(Fault::new(format!("{}.simulate.seed", set.key), problem));
        }
        seeds.push(own.seed);
        times.extend(times_d(own, &set.star, &set.key)?);
    }
    let key = sets[0].key.clone();
    let ObservationSource::Simulate(simulation) = &sets[0].source else { return Ok(()) };
    let (truth, faculae) = (simulation.truth, simulation.faculae.clone());
    let spots = spots(first, &sets[0].star, &truth, &times, &key)?;
    for set in sets {
        if let ObservationSource::Simulate(simulation) = &mut set.source {
            (simulation.truth, simulation.spots, simulation.faculae) = (truth, spots.clone(), faculae.clone());
        }
    }
    Ok(())
}
