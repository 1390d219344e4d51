//! The start of every command: a config, its observations as read and as prepared for the model, and their imager.

mod truth;

use crate::data::calibrated::{Calibrated, of_sets};
use crate::data::config::{Config, ConfigError, DataSetSettings, Settings};
use crate::data::dataset::{Dataset, in_memory, is_within};
use crate::data::io::provenance::{Measured, MeasuredSet, Provenance};
use crate::inference::evidence::EvidenceRecord;
use crate::inference::search::{self, Found, Progress, SearchError, SearchSettings};
use crate::model::{FreeParameter, Parameter, ParameterSpace, ParameterValues};
use crate::planets::periodogram::Jitters;
use crate::star::Orbit;
use crate::star::injection::inject;
use crate::star::observation::{Observations, Profile};
use crate::surface::calibration::events::{ByHand, Events};
use crate::surface::calibration::star::MeasuredStar;
use crate::surface::calibration::{self, Asked, FoundStar, indicators};
use crate::surface::expansion::nuisances;
use crate::surface::imaging::Imager;
use crate::surface::indicator::Indicator;
use crate::surface::photometry::Flux;
use crate::surface::{At, FittedIndicator, Known, NoMaps, OtherRotation, SurfaceMaps, SurfaceSettings};
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::Arc;

pub use crate::data::dataset::SceneError;

/// Placeholder of the list in the config of profiles from memory.
const IN_MEMORY: &str = "profiles in memory";

/// A config with its observations.
#[derive(Clone, Debug)]
pub struct Scene {
    /// The config, resolved.
    #[doc(hidden)]
    pub settings: Settings,
    /// The observations as in their files, or as simulated.
    #[doc(hidden)]
    pub data: Arc<Dataset>,
    /// The line profiles as they enter the model; of several data sets one after the other.
    pub observations: Observations,
    /// SHA-256 (hex) of the observations: of the bytes of their files, or of the numbers.
    #[doc(hidden)]
    pub data_sha256: String,
    /// The parameters that were simulated; `None` for observations from files.
    #[doc(hidden)]
    pub truth: Option<ParameterValues>,
    /// Quantities that the config leaves to the observations: uncertainties, RV jitter, target chi2.
    #[doc(hidden)]
    pub measured: Measured,
    /// Target chi2 per datum, of the config or measured.
    #[doc(hidden)]
    pub chi2_target: f64,
    /// The imager of the observations.
    #[doc(hidden)]
    pub imager: Imager,
    /// The values of each activity indicator, in the order of time.
    #[doc(hidden)]
    pub indicators: Vec<Vec<Flux>>,
    /// The free parameters, starting at the config's values; its dimension may be 0.
    #[doc(hidden)]
    pub space: ParameterSpace,
}

impl Scene {
    /// Reads the config at `path` and reads or simulates its observations.
    ///
    /// # Errors
    /// A config or observations that cannot be read or are invalid.
    pub fn load(path: &Path) -> Result<Self, SceneError> {
        Scene::new(&Config::load(path)?)
    }

    /// Reads or simulates the observations of `config`.
    ///
    /// # Errors
    /// A config or observations that are invalid.
    pub fn new(config: &Config) -> Result<Self, SceneError> {
        let settings = config.settings()?;
        let data = Arc::new(Dataset::read(&settings)?);
        Scene::of(settings, data)
    }

    /// The scene of `config` with these profiles instead of those in its files: cut, scaled and checked like profiles
    /// from files.
    ///
    /// # Errors
    /// A config or profiles that are invalid.
    pub fn with_profiles(config: &Config, profiles: Observations) -> Result<Self, SceneError> {
        let config = match config.get("observations.path") {
            Some(_) => config.clone(),
            None => config.clone().with("observations.path", IN_MEMORY),
        };
        let settings = config.settings()?;
        let profiles = in_memory(profiles, |k| format!("profile {k}"));
        let data = Arc::new(Dataset::with_profiles(&settings, vec![profiles])?);
        Scene::of(settings, data)
    }

    /// The scene of a config whose observations are already read.
    ///
    /// # Errors
    /// Settings that are invalid for these observations.
    #[doc(hidden)]
    pub fn of(settings: Settings, data: Arc<Dataset>) -> Result<Self, SceneError> {
        let calibrated = Calibrated::of(&settings, &data)?;
        Ok(Scene::calibrated(settings, data, calibrated))
    }

    fn calibrated(settings: Settings, data: Arc<Dataset>, calibrated: Calibrated) -> Self {
        let Calibrated { observations, sha256, measured, chi2_target, imager, indicators } = calibrated;
        let truth = settings.sets[0].simulation().map(|simulation| simulation.truth);
        let space = space(&settings.free, &settings, &imager);
        let data_sha256 = sha256;
        Scene { settings, data, observations, data_sha256, truth, measured, chi2_target, imager, indicators, space }
    }

    /// The same with the parameters of the star that the config leaves to the profiles; `report` receives the progress.
    /// Where there is no fit they keep their values, and results give the reason.
    #[must_use]
    pub fn fitted(self, report: &dyn Fn(&str)) -> Self {
        self.with_fitted_indicators(report).with_fitted_star(report)
    }

    /// The same with indicators, their gains fitted to profiles and values.
    fn with_fitted_indicators(mut self, report: &dyn Fn(&str)) -> Self {
        if self.indicators.is_empty() || !self.measured.indicators.is_empty() {
            return self;
        }
        report("fitting indicators");
        let named = self.settings.indicators.iter().zip(&self.indicators);
        let named: Vec<(&str, &[Flux])> = named.map(|(of, values)| (&*of.name, &values[..])).collect();
        match indicators::fitted(
            &self.imager,
            self.settings.values.without_planet(),
            self.settings.known_field(),
            &named,
        ) {
            Ok(found) => self.with_indicators(&found),
            Err(error) => {
                self.measured.indicator_notes.push(format!("not used: {error}"));
                self
            }
        }
    }

    /// The same with the fitted indicators.
    fn with_indicators(mut self, found: &[FittedIndicator]) -> Self {
        let used = found.iter().zip(&self.indicators).enumerate().filter(|(_, (found, _))| found.is_used());
        let of = |(number, (found, values)): (usize, (&FittedIndicator, &Vec<Flux>))| {
            Indicator::new((number, &found.name), values, found.gain, found.jitter)
        };
        self.imager.indicators = used.map(of).collect();
        self.measured.indicators = found.to_vec();
        self
    }

    /// The same with star and events fitted.
    fn with_fitted_star(mut self, report: &dyn Fn(&str)) -> Self {
        let (fitted, by_hand) = (self.settings.fitted.clone(), self.by_hand());
        let contrasts = self.fitted_contrasts();
        let (known, values) = (self.settings.known_field(), self.settings.values.without_planet());
        let rotation = self.settings.imaging.objective.properties().marginalises && known.lifetime.is_none();
        let is_open = !fitted.is_empty() || by_hand.is_some() || !contrasts.is_empty();
        if !(is_open || rotation) || self.measured.field_start.is_some() {
            return self;
        }
        let (free, slope) = (&self.settings.free[..], self.settings.drift.is_none());
        let nuisances = nuisances(free);
        let events = by_hand.as_deref();
        let contrasts = &contrasts[..];
        let asked = Asked { fitted: &fitted, events, slope, contrasts, free, nuisances: &nuisances, rotation };
        match calibration::found(&self.imager, values, &known, asked, report) {
            Ok(FoundStar { star, events, drift_kms_d, contrasts: of_sets, other_rotation, field, problem }) => {
                let profiles = problem.map(|error| format!("star not fitted: {error}")).into_iter().collect();
                let field_start = Some(field);
                let mut sets = self.measured.sets.clone();
                contrasts.iter().zip(of_sets).for_each(|(set, contrast)| sets[*set].contrast = Some(contrast));
                let kept = Measured {
                    star,
                    events,
                    drift_kms_d,
                    other_rotation,
                    field_start,
                    profiles,
                    ..Measured::default()
                };
                self.with_found(&Measured { sets, ..kept })
            }
            Err(error) => {
                self.measured.profiles.push(format!("star and outliers not fitted: {error}"));
                self
            }
        }
    }

    /// Data sets whose contrast of spots is fitted.
    fn fitted_contrasts(&self) -> Vec<usize> {
        let fits = |(set, settings): (usize, &DataSetSettings)| settings.fits_contrast.then_some(set);
        self.settings.sets.iter().enumerate().filter_map(fits).collect()
    }

    /// The same with the fitted contrasts of spots of these data sets.
    fn with_contrasts(mut self, sets: &[MeasuredSet]) -> Self {
        for (set, found) in sets.iter().enumerate() {
            if let Some(contrast) = found.contrast {
                self.imager.sets[set].contrast = Some(contrast.value);
                self.measured.sets[set].contrast = Some(contrast);
            }
        }
        self
    }

    /// The prior of events among the profiles; `None` where events are not sought.
    fn by_hand(&self) -> Option<Vec<ByHand>> {
        let sets = self.settings.sets.iter().zip(self.imager.profiles_of_sets());
        let of_set = |(set, profiles): (&DataSetSettings, Range<usize>)| {
            let of = |profile: &Profile| match &set.events {
                None => ByHand::Sound,
                Some(windows) if is_within(&windows.exclude, profile.time_d) => ByHand::Sound,
                Some(windows) if is_within(&windows.include, profile.time_d) => ByHand::Event,
                Some(_) => ByHand::Open,
            };
            self.observations.profiles[profiles].iter().map(of).collect::<Vec<_>>()
        };
        self.settings.sets.iter().any(|set| set.events.is_some()).then(|| sets.flat_map(of_set).collect())
    }

    /// The same with the fitted star and events.
    #[must_use]
    #[doc(hidden)]
    pub fn with_found(self, found: &Measured) -> Self {
        let scene = match found.indicators.is_empty() || !self.measured.indicators.is_empty() {
            true => self,
            false => self.with_indicators(&found.indicators),
        };
        let mut scene = match &found.star {
            Some(star) => scene.with_star(star.clone()),
            None => scene,
        };
        let said: Vec<String> =
            found.profiles.iter().filter(|text| !scene.measured.profiles.contains(text)).cloned().collect();
        scene.measured.profiles.extend(said);
        scene.measured.field_start = scene.measured.field_start.or(found.field_start);
        scene.measured.other_rotation = scene.measured.other_rotation.or(found.other_rotation);
        scene = scene.with_contrasts(&found.sets);
        if scene.measured.drift_kms_d.is_empty() {
            scene = scene.with_drift(&found.drift_kms_d);
        }
        match &found.events {
            Some(events) if scene.measured.events.is_none() => scene.with_events(events.clone()),
            _ => scene,
        }
    }

    /// Slopes (km/s/d) of the drifts from those of `before`; a data set of a single profile has none.
    fn slopes_of(&self, before: &Imager, kms_d: &[f64]) -> Vec<f64> {
        if kms_d.is_empty() {
            return Vec::new();
        }
        let with_drifts = |imager: &Imager| match imager.drifts.is_empty() {
            true => imager.clone().with_drifts(false).drifts,
            false => imager.drifts.clone(),
        };
        let known: Vec<_> = with_drifts(before).into_iter().map(|drift| drift.set).zip(kms_d).collect();
        let of = |set| known.iter().find(|(of, _)| *of == set).map_or(0.0, |(_, kms_d)| **kms_d);
        with_drifts(&self.imager).into_iter().map(|drift| of(drift.set)).collect()
    }

    /// The same with drifts fixed at the fitted slopes.
    fn with_drift(mut self, kms_d: &[f64]) -> Self {
        if !kms_d.is_empty() {
            if self.imager.drifts.is_empty() {
                self.imager = self.imager.with_drifts(false);
            }
            self.imager.hold_drifts(kms_d);
            self.measured.drift_kms_d = kms_d.to_vec();
        }
        self
    }

    /// The same with larger uncertainties of profiles that are events.
    fn with_events(mut self, events: Events) -> Self {
        let factors = events.factors(self.observations.profiles.len());
        for (profile, factor) in self.observations.profiles.iter_mut().zip(&factors) {
            profile.sigma.iter_mut().for_each(|sigma| *sigma *= factor);
        }
        self.imager = self.imager.with_larger_errors(&factors);
        self.measured.events = Some(events);
        self
    }

    /// The same with the measured parameters of the star.
    fn with_star(mut self, star: MeasuredStar) -> Self {
        star.put_into(&mut self.imager);
        let in_values = |parameter: Parameter| {
            !parameter.is_surface() || self.settings.free.iter().any(|free| free.parameter == parameter)
        };
        star.set(&mut self.settings.values, in_values);
        self.space = space(&self.settings.free, &self.settings, &self.imager);
        self.measured.star = Some(star);
        self
    }

    /// The same star with `orbits` injected into its profiles over their full width, which are resampled and cut again.
    /// Uncertainties and all measured quantities are kept.
    ///
    /// # Errors
    /// Profiles that become invalid.
    #[doc(hidden)]
    pub fn injected(&self, orbits: &[Orbit]) -> Result<Self, ConfigError> {
        let mut observations = self.observations.clone();
        let injected = self.over_continua(inject(&self.whole(), &self.imager.star, orbits));
        for (cut, whole) in observations.profiles.iter_mut().zip(&injected.profiles) {
            let first = ((cut.first_velocity_kms - whole.first_velocity_kms) / cut.step_kms).round() as usize;
            for (intensity, shifted) in cut.intensity.iter_mut().zip(whole.intensity.iter().skip(first)) {
                *intensity = *shifted;
            }
        }
        self.with_parts(of_sets(&self.imager, &observations))
    }

    /// The same star with these profiles of each data set: all measured quantities are kept.
    ///
    /// # Errors
    /// Profiles that are invalid.
    #[doc(hidden)]
    pub fn with_parts(&self, parts: Vec<Observations>) -> Result<Self, ConfigError> {
        let Scene { settings, data, observations, measured, chi2_target, imager, .. } = self;
        let (observations, measured, imager) = (observations.clone(), measured.clone(), imager.clone());
        let sha256 = self.data_sha256.clone();
        let (chi2_target, indicators) = (*chi2_target, self.indicators.clone());
        let before = Calibrated { observations, sha256, measured, chi2_target, imager, indicators };
        let Measured { star, drift_kms_d, sets, .. } = self.measured.clone();
        let scene = Scene::calibrated(settings.clone(), Arc::clone(data), before.of_others(settings, parts)?);
        let slopes = scene.slopes_of(&self.imager, &drift_kms_d);
        let scene = scene.with_drift(&slopes).with_contrasts(&sets);
        Ok(match star {
            Some(star) => scene.with_star(star),
            None => scene,
        })
    }

    /// The config file, or its placeholder, for errors.
    pub fn path(&self) -> &Path {
        &self.settings.path
    }

    /// Checks that the config has a free parameter, as searches and chains need.
    ///
    /// # Errors
    /// A config without one.
    pub fn require_free(&self) -> Result<(), ConfigError> {
        self.settings.require_free().map(drop)
    }

    /// The prior of the spots.
    #[doc(hidden)]
    pub fn surface(&self) -> SurfaceSettings {
        let objective = self.settings.imaging.objective;
        let field = Known { start: self.measured.field_start, ..self.settings.known_field() };
        SurfaceSettings { objective, chi2_target: self.chi2_target, field: Some(field) }
    }

    /// The search for the best parameters that the config specifies.
    #[doc(hidden)]
    pub fn search_settings(&self) -> SearchSettings {
        let other_rotation = self.measured.other_rotation;
        SearchSettings { other_rotation, ..SearchSettings::of(self.surface(), self.settings.sampler.seed) }
    }

    /// The maps of the star at the config's values, and whether they fit: one per season, or, where maps evolve, one at
    /// each of `times_d`, by default each night.
    ///
    /// # Errors
    /// [`NoMaps`]: a target chi2 that no map reaches, a field that cannot be fitted, invalid times.
    pub fn maps(&self, times_d: Option<&[f64]>) -> Result<SurfaceMaps, NoMaps> {
        let nuisances = nuisances(&self.settings.free);
        let at = At { imager: &self.imager, values: self.settings.values, nuisances: &nuisances };
        let mut maps = self.surface().model().maps(at, &self.observations, times_d)?;
        maps.warnings.extend(self.measured.other_rotation.iter().map(OtherRotation::sentence));
        Ok(maps)
    }

    /// The best parameters, and the posterior with its reference there.
    ///
    /// # Errors
    /// No map, or no start with a finite log-probability.
    pub fn optimise(&self) -> Result<Found, SearchError> {
        self.optimise_with(&|_| ())
    }

    /// The same; `report` receives the progress at every evaluation, from any thread.
    ///
    /// # Errors
    /// As [`Scene::optimise`].
    pub fn optimise_with(&self, report: &(dyn Fn(Progress) + Sync)) -> Result<Found, SearchError> {
        search::find(&self.imager, &self.space, self.search_settings(), report)
    }

    /// The best parameters where those in `free` are free, as on the axes of a grid.
    ///
    /// # Errors
    /// As [`Scene::optimise`].
    #[doc(hidden)]
    pub fn optimise_over(
        &self,
        free: &[FreeParameter],
        report: &(dyn Fn(Progress) + Sync),
    ) -> Result<Found, SearchError> {
        search::find(&self.imager, &self.space_of(free), self.search_settings(), report)
    }

    /// The profiles over their full width, as in their files, for injections.
    #[doc(hidden)]
    pub fn whole(&self) -> Observations {
        Observations::joined(self.data.sets.iter().map(|set| set.observations.clone()).collect())
    }

    /// The same in units of their continuum.
    #[doc(hidden)]
    pub fn whole_over_continuum(&self) -> Observations {
        self.over_continua(self.whole())
    }

    /// Profiles of all data sets over their full width in units of their continua.
    fn over_continua(&self, whole: Observations) -> Observations {
        let parts = of_sets(&self.imager, &whole).into_iter().zip(&self.settings.sets);
        Observations::joined(parts.map(|(part, set)| part.over_continuum(set.continuum_level())).collect())
    }

    /// The files that it was read from: config, list, profiles.
    #[doc(hidden)]
    pub fn files(&self) -> Vec<PathBuf> {
        std::iter::once(&self.settings.path).chain(&self.data.files).cloned().collect()
    }

    /// The space of the parameters in `free`, starting at the config's values, all others fixed there.
    #[doc(hidden)]
    pub fn space_of(&self, free: &[FreeParameter]) -> ParameterSpace {
        space(free, &self.settings, &self.imager)
    }

    /// Bayes factors of planets under the priors of the config, from the velocities of the star without a
    /// planet.
    #[doc(hidden)]
    pub fn evidence(&self, jitters: &Jitters) -> Option<EvidenceRecord> {
        EvidenceRecord::of(&self.settings.free, self.space.clock(), self.settings.sampler.seed, jitters)
    }

    /// The provenance of results.
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

fn space(free: &[FreeParameter], settings: &Settings, imager: &Imager) -> ParameterSpace {
    let (mid, base) = (imager.mid_cycle(), imager.time_base_cycles());
    let star = &imager.star;
    ParameterSpace::new(free.to_vec(), settings.values, mid, base, star.rotation_period_d)
        .of_star(star.epoch_d, settings.mass_msun)
        .of_seasons(imager.longest_season_cycles())
}
