//! A star with the times at which it is to be observed.

use crate::data::calibrated::{fingerprint, imager};
use crate::data::config::{Config, ConfigError, ObservationSource, PlanSection, Settings};
use crate::data::io::provenance::{Measured, Provenance};
use crate::data::scene::{Scene, SceneError};
use crate::data::simulate::Site;
use crate::field::{Field, Kernel, Lifetime, Spectrum};
use crate::model::{Parameter, ParameterValues};
use crate::planets::periodogram::{Frequencies, FrequencyError, FrequencySettings};
use crate::star::observation::nights;
use crate::star::observation::{Observations, Profile};
use crate::surface::imaging::Imager;
use crate::surface::planned::{Assumed, Basis, Marginal, fit};
use crate::surface::{Known, NoFit};
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};
use std::path::PathBuf;
use std::sync::Arc;

/// Usual spots: medians of the fields that were fitted to simulated stars of nine kinds, hard-edged spots that live
/// from 7 d to for ever (`results/calibration-changing.md`), with a break of the spectrum. Those of LO Peg have 0.25,
/// 0.94 and 106 d, without one.
const USUAL: (f64, f64, f64) = (0.22, 1.6, 28.0);

/// Planned profiles that are farther apart (d) are of two nights: those of one night may be hours apart.
const NIGHT_GAP_D: f64 = 0.5;

/// A star, and when it is observed.
#[derive(Clone, Debug)]
pub struct Campaign {
    /// What it is called.
    pub name: String,
    /// The config, resolved.
    pub settings: Settings,
    /// Star, times, bins and noise: profiles that have been taken, then those that are planned.
    pub imager: Imager,
    /// The profiles that have been taken, spots integrated out.
    pub taken: Option<Arc<Marginal>>,
    /// Spots before the data, jitter.
    pub assumed: Assumed,
    /// Where the spots are from.
    pub source: SpotsSource,
    /// Planned profiles night by night.
    pub nights: Vec<Vec<usize>>,
    /// Median standard error of a planned bin.
    pub sigma: f64,
    /// Config, times and program.
    pub provenance: Provenance,
}

/// Where the spots that are integrated out are from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum SpotsSource {
    /// They were fitted to the profiles that have been taken.
    Fitted,
    /// The config gives amplitude, slope and lifetime.
    Given,
    /// What the config does not give is as usual.
    Usual,
}

impl SpotsSource {
    /// In words.
    pub fn words(self) -> &'static str {
        match self {
            SpotsSource::Fitted => "fitted to the profiles there are",
            SpotsSource::Given => "of the config",
            SpotsSource::Usual => "default where imaging.spot_amplitude, spot_slope or spot_lifetime_d is not given",
        }
    }
}

/// Why there is none.
#[derive(Debug, thiserror::Error)]
pub enum CampaignError {
    /// The config or its observations are at fault.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// The spots of the observed profiles cannot be integrated out.
    #[error("{}: no field of spots fits the observed profiles: {source}", path.display())]
    Field {
        /// The config.
        path: PathBuf,
        /// What is wrong.
        source: NoFit,
    },
    /// More nights are asked for than there are.
    #[error("--nights {wanted}: {} lists {listed} nights", path.display())]
    Nights {
        /// The config.
        path: PathBuf,
        /// Nights asked for.
        wanted: usize,
        /// Nights of the config.
        listed: usize,
    },
}

impl From<ConfigError> for CampaignError {
    fn from(error: ConfigError) -> Self {
        CampaignError::Scene(error.into())
    }
}

/// Profiles that have been taken.
struct Taken {
    observations: Observations,
    marginal: Arc<Marginal>,
}

impl Campaign {
    /// The campaign that `config` asks for, or one for each of these numbers of `nights` (of a season).
    ///
    /// # Errors
    /// [`CampaignError`].
    pub fn of(config: &Config, nights: &[usize]) -> Result<Vec<Self>, CampaignError> {
        let own = config.settings()?;
        // whatever the config's own objective: a plan integrates maps out
        let config = &config
            .clone()
            .with("imaging.objective", "marginal-likelihood")
            .with("imaging.season_gap_d", Value::Null)
            .with("imaging.seasons", json!([]));
        let settings = config.settings()?;
        let [set] = &settings.sets[..] else {
            return Err(own.fault("observations", "a list of data sets: give a single one").into());
        };
        if let Some(curve) = settings.light_curves.first() {
            return Err(own.fault(&curve.key, "light curves are not planned: delete it").into());
        }
        if let Some(indicator) = settings.indicators.first() {
            return Err(own.fault(&indicator.key, "activity indicators are not planned: delete it").into());
        }
        let simulated = matches!(set.source, ObservationSource::Simulate(_));
        let taken = match (&settings.plan, simulated) {
            (None, true) => None,
            (None, false) => return Err(own.fault("plan", "missing: when is the star to be observed next?").into()),
            (Some(_), _) => Some(taken(config)?),
        };
        let wanted: Vec<Option<usize>> = match nights {
            [] => vec![None],
            some => some.iter().copied().map(Some).collect(),
        };
        wanted.into_iter().map(|nights| Campaign::one(config, &own, taken.as_ref(), nights)).collect()
    }

    fn one(
        config: &Config,
        own: &Settings,
        taken: Option<&Taken>,
        wanted: Option<usize>,
    ) -> Result<Self, CampaignError> {
        let settings = with_nights(config, wanted)?.settings()?;
        let mut planned = match (&settings.sets[0].source, &settings.plan, taken) {
            (_, Some(plan), Some(taken)) => next(plan, &taken.observations, own)?,
            (ObservationSource::Simulate(simulation), ..) => {
                let mut observations = simulation.observe(&settings.sets[0].star);
                let inflation = simulation.correlated_bins.sqrt();
                observations.profiles.iter_mut().flat_map(|p| &mut p.sigma).for_each(|sigma| *sigma *= inflation);
                observations
            }
            _ => unreachable!("observed profiles have a plan"),
        };
        let site = settings.plan.as_ref().and_then(|plan| plan.site.filter(|_| plan.times_d.is_none()));
        let mut nights = nights_of(&planned.times_d(), site.as_ref());
        if let Some(wanted) = wanted.filter(|_| schedule_of(config).is_none()) {
            if wanted > nights.len() {
                return Err(CampaignError::Nights { path: own.path.clone(), wanted, listed: nights.len() });
            }
            nights.truncate(wanted);
            let kept: Vec<usize> = nights.iter().flatten().copied().collect();
            planned.profiles = kept.iter().map(|k| planned.profiles[*k].clone()).collect();
            nights = nights_of(&planned.times_d(), site.as_ref());
        }
        let before = taken.map_or(0, |taken| taken.observations.profiles.len());
        nights.iter_mut().flatten().for_each(|k| *k += before);
        let sigma = median(planned.profiles.iter().flat_map(|profile| profile.sigma.clone()).collect());
        let mut all = planned;
        if let Some(taken) = taken {
            all.profiles.splice(0..0, taken.observations.profiles.iter().cloned());
        }
        let stem = own.path.file_stem().map_or("plan".into(), |stem| stem.to_string_lossy().into_owned());
        let known = settings.known_field();
        let source = match (taken, known.amplitude, known.slope, known.lifetime) {
            (Some(_), ..) => SpotsSource::Fitted,
            (None, Some(_), Some(_), Some(_)) => SpotsSource::Given,
            _ => SpotsSource::Usual,
        };
        let assumed = taken.map_or_else(|| usual(known), |taken| taken.marginal.assumed);
        Ok(Campaign {
            name: wanted.map_or(stem.clone(), |nights| format!("{stem}, {nights} nights")),
            imager: imager(&settings, &settings.sets, std::slice::from_ref(&all), &[])?,
            taken: taken.map(|taken| Arc::clone(&taken.marginal)),
            assumed,
            source,
            nights,
            sigma,
            provenance: Provenance {
                version: env!("CARGO_PKG_VERSION").into(),
                data_sha256: fingerprint(&all),
                config_sha256: own.sha256.clone(),
                config: own.resolved.clone(),
                measured: Measured::default(),
            },
            settings,
        })
    }

    /// Number of profiles that have been taken.
    pub fn before(&self) -> usize {
        self.imager.profiles().count() - self.nights.iter().map(Vec::len).sum::<usize>()
    }

    /// All profiles.
    pub fn all(&self) -> Vec<usize> {
        (0..self.imager.profiles().count()).collect()
    }

    /// Time base (d).
    pub fn time_base_d(&self) -> f64 {
        self.imager.time_base_cycles() * self.imager.star.rotation_period_d
    }

    /// First and last time (d).
    pub fn span_d(&self) -> [f64; 2] {
        let span = |[first, last]: [f64; 2], time: (f64, f64, usize)| [first.min(time.0), last.max(time.0)];
        self.imager.profiles().fold([f64::INFINITY, f64::NEG_INFINITY], span)
    }

    /// The profiles there are after some of the nights, `looks` times as the campaign grows; before the first night
    /// too, if profiles have been taken.
    pub(super) fn looks(&self, looks: usize) -> Vec<(usize, Vec<usize>)> {
        let mut nights: Vec<usize> = (1..=looks).map(|k| (k * self.nights.len()).div_ceil(looks)).collect();
        if self.taken.is_some() {
            nights.insert(0, 0);
        }
        nights.dedup();
        let part = |n: usize| (0..self.before()).chain(self.nights[..n].iter().flatten().copied()).collect();
        nights.into_iter().map(|n| (n, part(n))).collect()
    }

    /// The trial periods of a search in some of the profiles.
    ///
    /// # Errors
    /// [`FrequencyError`].
    pub(super) fn frequencies(&self, part: &[usize], wanted: FrequencySettings) -> Result<Frequencies, FrequencyError> {
        let all = self.imager.cycles();
        let cycles: Vec<f64> = part.iter().map(|k| all[*k]).collect();
        Frequencies::new(&cycles, self.imager.star.rotation_period_d, wanted)
    }
}

/// The config's observations with the field that fits them, without a planet.
fn taken(config: &Config) -> Result<Taken, CampaignError> {
    let scene = Scene::new(config)?;
    let known = scene.surface().field.unwrap_or_default();
    let mut values: ParameterValues = scene.settings.values;
    values.set(Parameter::K, 0.0);
    let fitted = fit(&scene.imager, &Arc::new(Basis::new(&scene.imager.grid)), values, known, None);
    let fitted = fitted.map_err(|source| CampaignError::Field { path: scene.settings.path.clone(), source })?;
    Ok(Taken { observations: scene.observations, marginal: Arc::new(fitted.marginal) })
}

/// A usual field, but for what is known.
fn usual(known: Known) -> Assumed {
    let (amplitude, slope, lifetime_d) = USUAL;
    let spectrum = Spectrum {
        amplitude: known.amplitude.unwrap_or(amplitude),
        slope: known.slope.unwrap_or(slope),
        break_degree: known.break_degree(),
    };
    let lifetime = known.lifetime.unwrap_or(Lifetime::Days(lifetime_d));
    Assumed { field: Field { spectrum, kernel: Kernel::of(lifetime) }, jitter_kms: known.jitter_kms.unwrap_or(0.0) }
}

/// Where the schedule is.
fn schedule_of(config: &Config) -> Option<&'static str> {
    const PLACES: [&str; 2] = ["plan.schedule", "observations.simulate.schedule"];
    match config.get("plan") {
        Some(plan) if plan.get("times_d").is_some_and(|times| !times.is_null()) => None,
        Some(_) => Some(PLACES[0]),
        None => config.get(PLACES[1]).map(|_| PLACES[1]),
    }
}

/// The config with that many nights in its schedule, if it has one.
fn with_nights(config: &Config, wanted: Option<usize>) -> Result<Config, CampaignError> {
    let (Some(wanted), Some(schedule)) = (wanted, schedule_of(config)) else { return Ok(config.clone()) };
    let listed = format!("{schedule}.on_nights");
    match config.get(&listed).and_then(|value| value.as_array()) {
        None => Ok(config.clone().with(&format!("{schedule}.nights"), wanted)),
        Some(numbers) if wanted <= numbers.len() => Ok(config.clone().with(&listed, numbers[..wanted].to_vec())),
        Some(numbers) => {
            let path = config.settings()?.path;
            Err(CampaignError::Nights { path, wanted, listed: numbers.len() })
        }
    }
}

/// Numbers of the profiles of each night: from local noon to noon at a place, or else as gaps tell.
fn nights_of(times_d: &[f64], site: Option<&Site>) -> Vec<Vec<usize>> {
    let Some(site) = site else { return nights(times_d, NIGHT_GAP_D) };
    let mut order: Vec<usize> = (0..times_d.len()).collect();
    order.sort_by(|a, b| times_d[*a].total_cmp(&times_d[*b]));
    order.chunk_by(|a, b| site.night(times_d[*a]) == site.night(times_d[*b])).map(<[usize]>::to_vec).collect()
}

/// Planned profiles like those that have been taken: bins of the last of them, and a median error where no
/// signal-to-noise ratio is planned.
fn next(plan: &PlanSection, taken: &Observations, settings: &Settings) -> Result<Observations, ConfigError> {
    let last_d = taken.times_d().into_iter().fold(f64::NEG_INFINITY, f64::max);
    // nights of a place are not those of the time scale
    let usual_d = if plan.site.is_some() { last_d + 1.0 } else { last_d.floor() + 1.0 };
    let first_d = plan.first_d.unwrap_or(usual_d);
    let usual = median(taken.profiles.iter().flat_map(|profile| profile.sigma.clone()).collect());
    let sigma = plan.snr.map_or(usual, f64::recip);
    let like = &taken.profiles[taken.profiles.len() - 1];
    let profile = |time_d: f64| Profile { time_d, sigma: vec![sigma; like.sigma.len()], ..like.clone() };
    let times_d = match (&plan.times_d, &plan.site) {
        (Some(listed), _) => listed.clone(),
        (None, None) => plan.schedule.times_d(first_d),
        (None, Some(site)) if !site.has_date(first_d) => {
            let problem = format!(
                "time {first_d} is no Julian date from 1900 to 2100: give the Julian date of time 0, as 2400000.5 for \
                MJD or 2457000 for BTJD"
            );
            return Err(settings.fault("plan.site.time_zero_jd", &problem));
        }
        (None, Some(site)) => plan.schedule.times_within(first_d, &|begin_d| {
            let [from, to] = site.window_d(begin_d)?;
            Some((from, to - from))
        }),
    };
    let before = times_d.iter().copied().find(|time_d| *time_d <= last_d);
    if let Some(time_d) = before.filter(|_| plan.times_d.is_some()) {
        let problem = format!("{time_d} is not after the last profile ({last_d}): give coming nights");
        return Err(settings.fault("plan.times_d", &problem));
    }
    if times_d.is_empty() {
        let problem = "in none of the nights is the star high enough while it is dark: another first_d, or a lower \
            min_altitude_deg";
        return Err(settings.fault("plan.site", problem));
    }
    Ok(Observations { profiles: times_d.into_iter().map(profile).collect() })
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}
