//! What every command begins with: a config file, the observations it names or simulates, and what they are imaged
//! with.

mod imaging;
mod light_curves;
mod measuring;
mod reading;
mod seasons;
mod truth;

use crate::data::config::{
    Automatic, Config, ConfigError, DataSetSettings, LightCurveSettings, LightSource, ObservationSource, Settings,
    VelocityJitter,
};
use crate::data::ephemeris::Ephemeris;
use crate::data::io::FileError;
use crate::data::io::lsd::{self, Label, LsdError};
use crate::data::io::provenance::{Measured, MeasuredSet, Provenance};
use crate::inference::evidence::EvidenceRecord;
use crate::inference::search;
use crate::inference::search::{Found, Progress, SearchError};
use crate::model::{FreeParameter, ParameterSpace, ParameterValues};
use crate::planets::velocities::VelocityQuadratic;
use crate::star::Orbit;
use crate::star::injection::inject;
use crate::star::observation::Observations;
use crate::surface::ReferenceError;
use crate::surface::calibration::noise::{ErrorSettings, MeasuredErrors};
use crate::surface::calibration::target;
use crate::surface::imaging::Imager;
use crate::surface::photometry::Flux;
use crate::surface::{Known, NoMaps, SurfaceMaps, SurfaceSettings};
use imaging::hold_zero_points;
use measuring::{measured_errors, zero_points};
use reading::{Part, one_day_count};
use sha2::{Digest, Sha256};
use std::path::{Path, PathBuf};

pub use imaging::imager;

/// What stands for the list of profiles in the config of profiles that are in no file.
const IN_MEMORY: &str = "profiles in memory";

/// A config with its observations.
#[derive(Clone, Debug)]
pub struct Scene {
    /// The config, resolved.
    #[doc(hidden)]
    pub settings: Settings,
    /// The line profiles, read or simulated; of several data sets one after the other.
    pub observations: Observations,
    /// SHA-256 (hex) of the observations: of the bytes of their files, or of the numbers simulated.
    #[doc(hidden)]
    pub data_sha256: String,
    /// The parameters that were simulated; `None` for observations from files.
    #[doc(hidden)]
    pub truth: Option<ParameterValues>,
    /// What the config leaves to the observations: errors, velocity jitter, target chi2. In `settings` the last two are
    /// numbers.
    #[doc(hidden)]
    pub measured: Measured,
    /// What the observations are imaged with.
    #[doc(hidden)]
    pub imager: Imager,
    /// The free parameters, starting at the config's values; its dimension may be 0.
    #[doc(hidden)]
    pub space: ParameterSpace,
}

/// Why there is no scene: one line that names file, and line or key.
#[derive(Debug, thiserror::Error)]
pub enum SceneError {
    /// The config is at fault.
    #[error(transparent)]
    Config(#[from] ConfigError),
    /// The observations are.
    #[error(transparent)]
    Observations(#[from] LsdError),
    /// A light curve is.
    #[error(transparent)]
    LightCurve(#[from] FileError),
}

impl Scene {
    /// Reads the config at `path` and reads or simulates its observations.
    ///
    /// # Errors
    /// A config or observations that cannot be read or make no sense.
    pub fn load(path: &Path) -> Result<Self, SceneError> {
        Scene::new(&Config::load(path)?)
    }

    /// Reads or simulates the observations of `config`.
    ///
    /// # Errors
    /// A config or observations that make no sense.
    pub fn new(config: &Config) -> Result<Self, SceneError> {
        Scene::read(config.settings()?)
    }

    /// The scene of `config` with these profiles in place of its own: cut, scaled and judged as profiles from files
    /// would be.
    ///
    /// # Errors
    /// A config or profiles that make no sense.
    pub fn with_profiles(config: &Config, profiles: Observations) -> Result<Self, SceneError> {
        let config = match config.get("observations.path") {
            Some(_) => config.clone(),
            None => config.clone().with("observations.path", IN_MEMORY),
        };
        let mut settings = config.settings()?;
        light_curves::read(&mut settings)?;
        let fault = |problem: String| settings.fault("observations", &problem);
        profiles.check().map_err(fault)?;
        let [set] = &settings.sets[..] else {
            return Err(fault("profiles at hand are one data set: give one".into()).into());
        };
        let ObservationSource::Files { options, continuum_level, .. } = &set.source else {
            return Err(fault("profiles are given and simulated: leave out `simulate`".into()).into());
        };
        let whole = profiles.over_continuum(*continuum_level);
        let cut = match options.velocity_range_kms {
            Some(range) => {
                whole.within(range).map_err(|problem| settings.fault("observations.velocity_range_kms", &problem))?
            }
            None => whole.clone(),
        };
        Ok(Scene::of_whole(settings, &whole, &cut)?)
    }

    /// Reads or simulates the observations of `settings`.
    fn read(mut settings: Settings) -> Result<Self, SceneError> {
        light_curves::read(&mut settings)?;
        let mut parts = settings.sets.iter().map(|set| Part::read(&settings, set)).collect::<Result<Vec<_>, _>>()?;
        one_day_count(&settings, &parts)?;
        // errors are what maps leave over, and a map is of a season of all sets
        let mut in_seasons = settings.clone();
        in_seasons.imaging.seasons = seasons::windows(&settings, parts.iter().map(|part| &part.observations))?;
        for (set, part) in settings.sets.iter().zip(&mut parts) {
            part.measure_errors(&in_seasons, set)?;
        }
        let several = parts.len() > 1;
        let mut remarks = Vec::new();
        for (set, part) in settings.sets.iter().zip(&parts) {
            let of = |remark: &String| if several { format!("{}: {remark}", set.name) } else { remark.clone() };
            remarks.extend(part.remarks.iter().map(of));
        }
        let truth = settings.sets.iter().find_map(|set| match &set.source {
            ObservationSource::Simulate(simulation) => Some(simulation.truth),
            ObservationSource::Files { .. } => None,
        });
        let data_sha256 = match &parts[..] {
            [one] => one.sha256.clone(),
            several => {
                let all: String = several.iter().map(|part| part.sha256.as_str()).collect();
                format!("{:x}", Sha256::digest(all))
            }
        };
        let data_sha256 = light_curves::fingerprint(data_sha256, &settings);
        let (observations, errors) = parts.into_iter().map(|part| (part.observations, part.errors)).unzip();
        let mut scene = Scene::with_noise(settings, observations, errors)?;
        scene.measured.profiles = remarks;
        Ok(Scene { data_sha256, truth, ..scene })
    }

    /// The scene of observations at hand, of one data set, whatever `settings` say of where they come from. A target
    /// chi2 that is left to them is chosen.
    ///
    /// # Errors
    /// Settings that make no sense with these observations.
    #[doc(hidden)]
    pub fn of(settings: Settings, observations: Observations) -> Result<Self, ConfigError> {
        Scene::with_noise(settings, vec![observations], vec![None])
    }

    /// The same of profiles in their `whole` width and `cut` to the config's velocity range, both in units of their
    /// continuum and with errors as quoted. Errors that `settings` leave to them are measured.
    ///
    /// # Errors
    /// Settings that make no sense with these observations, and errors that cannot be measured.
    #[doc(hidden)]
    pub fn of_whole(settings: Settings, whole: &Observations, cut: &Observations) -> Result<Self, ConfigError> {
        let ObservationSource::Files { options, errors: wanted, .. } = &settings.sets[0].source else {
            return Scene::of(settings, cut.clone());
        };
        let (scale, wanted) = (options.sigma_scale, *wanted);
        let mut observations = cut.clone();
        observations.profiles.iter_mut().flat_map(|p| &mut p.sigma).for_each(|sigma| *sigma *= scale);
        if wanted == ErrorSettings::default() {
            return Scene::of(settings, observations);
        }
        let measured = measured_errors(&settings, &settings.sets[0], wanted, whole, &observations)?;
        measured.apply(&mut observations);
        Scene::with_noise(settings, vec![observations], vec![Some(measured)])
    }

    /// The same of the data sets of `parts` where their errors were measured: a target chi2 is then that of independent
    /// data.
    fn with_noise(
        mut settings: Settings,
        parts: Vec<Observations>,
        errors: Vec<Option<MeasuredErrors>>,
    ) -> Result<Self, ConfigError> {
        let times = || parts.iter().flat_map(|part| part.times_d());
        if let Some(first) = times().reduce(f64::min).zip(times().reduce(f64::max)) {
            Ephemeris::check(&settings, [first.0, first.1])?;
        }
        let mut imager = imager(&settings, &parts)?;
        let correlated_bins = correlated_bins(&parts, &errors);
        imager.data.correlated_bins = correlated_bins;
        let mut measured = Measured { light_curves: light_curves::remarks(&settings), ..Measured::default() };
        measured.seasons = seasons::measured(&settings, &parts)?;
        settings.imaging.chi2_target = match settings.imaging.chi2_target {
            Automatic::Fixed(target) => Automatic::Fixed(target / correlated_bins),
            Automatic::Auto => {
                let fault = |e: ReferenceError| settings.fault("imaging.chi2_target", &e.to_string());
                let chosen = target::choose(&imager, settings.values, correlated_bins).map_err(fault)?;
                measured.chi2_target = Some(chosen);
                Automatic::Fixed(chosen.value)
            }
        };
        let (zero_points, jitter) = zero_points(&settings, &imager, settings.imaging.chi2_target.value())?;
        if let Some(zero_points) = zero_points {
            settings.velocity_jitter = VelocityJitter::Known(zero_points.sd_kms);
            imager = zero_points.counted_in(imager);
        }
        measured.velocity_jitter = jitter;
        hold_zero_points(&mut settings, &mut imager)?;
        match settings.sets.len() {
            1 => measured.errors = errors.into_iter().next().flatten(),
            _ => {
                let of_set = |((set, part), errors): ((&DataSetSettings, &Observations), _)| MeasuredSet {
                    name: set.name.clone(),
                    profiles: part.profiles.len(),
                    errors,
                    zero_point: set.held,
                };
                measured.sets = settings.sets.iter().zip(&parts).zip(errors).map(of_set).collect();
            }
        }
        let observations = Observations { profiles: parts.into_iter().flat_map(|part| part.profiles).collect() };
        let space = space(&settings.free, &settings, &imager);
        let data_sha256 = light_curves::fingerprint(fingerprint(&observations), &settings);
        Ok(Scene { settings, observations, data_sha256, truth: None, measured, imager, space })
    }

    /// The config file, or what stands for it: what errors name.
    pub fn path(&self) -> &Path {
        &self.settings.path
    }

    /// That the config leaves a parameter free, as searches and chains need.
    ///
    /// # Errors
    /// A config that does not.
    pub fn require_free(&self) -> Result<(), ConfigError> {
        self.settings.require_free().map(drop)
    }

    /// What is assumed of the spots.
    #[doc(hidden)]
    pub fn surface(&self) -> SurfaceSettings {
        SurfaceSettings { field: Some(self.known()), ..self.settings.surface() }
    }

    /// What is known of the field of spots.
    fn known(&self) -> Known {
        let known = self.settings.known_field();
        match self.measured.velocity_jitter {
            // a map that does not change would have said how large it is
            Some(_) => Known { jitter_kms: None, ..known },
            None => known,
        }
    }

    /// The maps of the star at the config's values, and whether they fit: one, one a season, or, where maps evolve, one
    /// at each of `times_d`, by default of each night.
    ///
    /// # Errors
    /// [`NoMaps`]: a target chi2 that no map reaches, a field that cannot be fitted, times that make no sense.
    pub fn maps(&self, times_d: Option<&[f64]>) -> Result<SurfaceMaps, NoMaps> {
        self.surface().model().maps(&self.imager, &self.observations, self.settings.values, times_d)
    }

    /// The best parameters, and the posterior with its reference there.
    ///
    /// # Errors
    /// No map, or no start that leads anywhere.
    pub fn optimise(&self) -> Result<Found, SearchError> {
        self.optimise_with(&|_| ())
    }

    /// The same; `report` is told at every evaluation how far the search has come, from any thread.
    ///
    /// # Errors
    /// As [`Scene::optimise`].
    pub fn optimise_with(&self, report: &(dyn Fn(Progress) + Sync)) -> Result<Found, SearchError> {
        search::find(&self.imager, &self.space, self.settings.search(), report)
    }

    /// The profiles in their whole width, as they are in their files, with what the list says of each: what is injected
    /// into.
    ///
    /// # Errors
    /// Files that are no longer what they were.
    #[doc(hidden)]
    pub fn whole(&self) -> Result<(Observations, Vec<Label>), LsdError> {
        let mut all = (Observations { profiles: Vec::new() }, Vec::new());
        for set in &self.settings.sets {
            let (whole, labels) = reading::whole(&self.settings, set)?;
            all.0.profiles.extend(whole.profiles);
            all.1.extend(labels);
        }
        Ok(all)
    }

    /// The measurements of a light curve of the config, errors as quoted.
    ///
    /// # Errors
    /// A table that is no longer what it was.
    #[doc(hidden)]
    pub fn light_curve(&self, curve: &LightCurveSettings) -> Result<Vec<Flux>, SceneError> {
        light_curves::measured(&self.settings, curve)
    }

    /// The files that it was read from: config, list, profiles.
    #[doc(hidden)]
    pub fn files(&self) -> Vec<PathBuf> {
        let mut files = vec![self.settings.path.clone()];
        for set in &self.settings.sets {
            if let ObservationSource::Files { path, .. } = &set.source {
                files.extend(lsd::files(path));
            }
        }
        for curve in &self.settings.light_curves {
            if let LightSource::File(path) = &curve.source {
                files.push(path.clone());
            }
        }
        files
    }

    /// The profiles in their whole width and in units of their continuum, errors as quoted; `None` if they are no
    /// longer there.
    #[doc(hidden)]
    pub fn whole_over_continuum(&self) -> Option<Observations> {
        self.whole().ok().map(|(whole, _)| self.over_continua(whole))
    }

    /// The same star with `orbits` put into its profiles: those of its `whole` ones, resampled and cut again. Errors
    /// stay.
    ///
    /// # Errors
    /// Profiles that no longer make sense.
    #[doc(hidden)]
    pub fn injected(&self, whole: &Observations, orbits: &[Orbit]) -> Result<Self, ConfigError> {
        let mut observations = self.observations.clone();
        let injected = self.over_continua(inject(whole, &self.imager.star, orbits));
        for (cut, whole) in observations.profiles.iter_mut().zip(&injected.profiles) {
            let first = ((cut.first_velocity_kms - whole.first_velocity_kms) / cut.step_kms).round() as usize;
            for (intensity, shifted) in cut.intensity.iter_mut().zip(whole.intensity.iter().skip(first)) {
                *intensity = *shifted;
            }
        }
        let of_set = |s: usize| Observations { profiles: observations.profiles[self.imager.profiles_of(s)].to_vec() };
        let parts: Vec<Observations> = (0..self.settings.sets.len()).map(of_set).collect();
        let errors = vec![None; parts.len()];
        Scene::with_noise(self.settings.clone(), parts, errors)
    }

    /// Whole profiles of all data sets in units of their continua.
    fn over_continua(&self, whole: Observations) -> Observations {
        let of_set = |(s, set): (usize, &DataSetSettings)| {
            let part = Observations { profiles: whole.profiles[self.imager.profiles_of(s)].to_vec() };
            part.over_continuum(set.continuum_level()).profiles
        };
        Observations { profiles: self.settings.sets.iter().enumerate().flat_map(of_set).collect() }
    }

    /// The space of the parameters in `free`, starting at the config's values, all others fixed there.
    #[doc(hidden)]
    pub fn space_of(&self, free: &[FreeParameter]) -> ParameterSpace {
        space(free, &self.settings, &self.imager)
    }

    /// Bayes factors of planets under the priors of the config, from the star's quadratic without a planet.
    #[doc(hidden)]
    pub fn evidence(&self, quadratic: &VelocityQuadratic) -> Option<EvidenceRecord> {
        EvidenceRecord::of(&self.settings.free, self.space.clock(), self.settings.sampler.seed, quadratic)
    }

    /// What results say of where they came from.
    #[doc(hidden)]
    pub fn provenance(&self) -> Provenance {
        Provenance {
            version: env!("CARGO_PKG_VERSION").into(),
            data_sha256: self.data_sha256.clone(),
            config_sha256: self.settings.sha256.clone(),
            config: self.settings.resolved.clone(),
            measured: self.measured.clone(),
        }
    }
}

/// Bins of which noise is correlated: number of data over that of independent ones.
fn correlated_bins(parts: &[Observations], errors: &[Option<MeasuredErrors>]) -> f64 {
    let of_each: Vec<f64> = errors.iter().map(|e| e.as_ref().map_or(1.0, |e| e.correlated_bins)).collect();
    match &of_each[..] {
        [one] => *one,
        several => {
            let data = |part: &Observations| part.len() as f64;
            let independent: f64 = parts.iter().zip(several).map(|(part, bins)| data(part) / bins).sum();
            parts.iter().map(data).sum::<f64>() / independent
        }
    }
}

fn space(free: &[FreeParameter], settings: &Settings, imager: &Imager) -> ParameterSpace {
    let (mid, base) = (imager.mid_cycle(), imager.time_base_cycles());
    let star = &imager.star;
    ParameterSpace::new(free.to_vec(), settings.values, mid, base, star.rotation_period_d)
        .of_star(star.epoch_d, settings.mass_msun)
        .of_seasons(imager.longest_season_cycles())
}

/// SHA-256 (hex) of the numbers of `observations`, little-endian: the first step, then for each profile time, number of
/// bins, and velocity, intensity and sigma of each bin.
pub fn fingerprint(observations: &Observations) -> String {
    let step = observations.step_kms();
    let mut hash = Sha256::new();
    hash.update(step.to_le_bytes());
    for profile in &observations.profiles {
        hash.update(profile.time_d.to_le_bytes());
        hash.update((profile.intensity.len() as u64).to_le_bytes());
        for (j, (intensity, sigma)) in profile.intensity.iter().zip(&profile.sigma).enumerate() {
            for number in [profile.velocity_kms(j), *intensity, *sigma] {
                hash.update(number.to_le_bytes());
            }
        }
    }
    format!("{:x}", hash.finalize())
}
