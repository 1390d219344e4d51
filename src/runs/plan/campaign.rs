//! A star with the planned times of observation.

use super::CampaignError;
use super::ahead::{self, Ahead};
use crate::data::calibrated::{fingerprint, imager, light_curves, of_sets, with_light_curves};
use crate::data::config::{Config, DataSetSettings, LightCurveSettings, LightSource, ObservationSource, Settings};
use crate::data::dataset::Dataset;
use crate::data::io::provenance::{Measured, Provenance};
use crate::data::scene::Scene;
use crate::field::{Field, Kernel, Lifetime, Spectrum};
use crate::numerics::quantile::middle;
use crate::planets::periodogram::{Frequencies, FrequencyError, FrequencySettings};
use crate::runs::fitted::fitted;
use crate::star::observation::Observations;
use crate::surface::Known;
use crate::surface::expansion::Nuisance;
use crate::surface::imaging::Imager;
use crate::surface::photometry::LightCurve;
use crate::surface::planned::{Assumed, Basis, Marginal, Planned, fit};
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};
use std::ops::Range;
use std::sync::Arc;

/// Usual spots: medians of the fields that were fitted to simulated stars of nine kinds, hard-edged spots with
/// lifetimes from 7 d to infinity (`results/calibration-changing.md`), with a break of the spectrum. Those of LO Peg
/// have 0.25, 0.94 and 106 d, without one.
const USUAL: (f64, f64, f64) = (0.22, 1.6, 28.0);

/// A star, and its times of observation.
#[derive(Clone, Debug)]
pub struct Campaign {
    /// Its name.
    pub name: String,
    /// The config, resolved.
    pub settings: Settings,
    /// Star, times, bins and noise: for each data set profiles that have been taken, then planned ones; light curves
    /// likewise.
    pub imager: Imager,
    /// The data taken, marginalised over spots.
    pub taken: Option<Arc<Marginal>>,
    /// Indices of the epochs before the first night: profiles, and then bins of light curves, which are counted after
    /// all profiles.
    pub known: Vec<usize>,
    /// Spots before the data, jitter.
    pub assumed: Assumed,
    /// The origin of the spots.
    pub source: SpotsSource,
    /// Planned profiles night by night; a night with two data sets counts for each.
    pub nights: Vec<Vec<usize>>,
    /// The data sets, if there are several.
    pub sets: Vec<SetRecord>,
    /// Median standard error of a planned bin.
    pub sigma: f64,
    /// Config, times and program.
    pub provenance: Provenance,
}

/// A data set among several.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SetRecord {
    /// Its name.
    pub name: String,
    /// Profiles taken before.
    pub taken: usize,
    /// Planned profiles.
    pub planned: usize,
    /// Number of planned nights.
    pub nights: usize,
    /// Signal-to-noise ratio of a planned bin; null where none is planned.
    pub snr: Option<f64>,
}

/// A light curve.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct LightRecord {
    /// Its name; the key of one that is planned with profiles.
    pub name: String,
    /// Its bins.
    pub bins: usize,
    /// Whether it is still to be taken.
    pub planned: bool,
}

/// The origin of the spots that are marginalised over.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum SpotsSource {
    /// They were fitted to the existing profiles.
    Fitted,
    /// The config gives amplitude, slope and lifetime.
    Given,
    /// Usual values replace those missing in the config.
    Usual,
}

impl SpotsSource {
    /// As text.
    pub fn words(self) -> &'static str {
        match self {
            SpotsSource::Fitted => "fitted to the profiles there are",
            SpotsSource::Given => "of the config",
            SpotsSource::Usual => "default where imaging.spot_amplitude, spot_slope or spot_lifetime_d is not given",
        }
    }
}

/// The data taken.
struct Taken {
    scene: Scene,
    marginal: Arc<Marginal>,
}

/// The star of a campaign: one with existing profiles, or a simulated one.
enum Star<'a> {
    Observed(&'a Taken),
    Simulated(Dataset),
}

impl Campaign {
    /// The campaign of `config`, or one for each of these numbers of `nights` (per season).
    ///
    /// `report` is called with the current stage.
    ///
    /// # Errors
    /// [`CampaignError`].
    pub fn of(config: &Config, nights: &[usize], report: &dyn Fn(&str)) -> Result<Vec<Self>, CampaignError> {
        let own = config.settings()?;
        // whatever the config's objective: a plan marginalises over maps
        let config = &config
            .clone()
            .with("imaging.objective", "marginal-likelihood")
            .with("imaging.season_gap_d", Value::Null)
            .with("imaging.seasons", json!([]));
        let settings = config.settings()?;
        if let Some(indicator) = settings.indicators.first() {
            return Err(own.fault(&indicator.key, "activity indicators are not planned: delete it").into());
        }
        let simulated = matches!(settings.sets[0].source, ObservationSource::Simulate(_));
        let taken = match (settings.plan.is_empty(), simulated) {
            (true, true) => None,
            (true, false) => return Err(own.fault("plan", "missing: when is the star to be observed next?").into()),
            (false, _) => Some(taken(config, report)?),
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
        let settings = ahead::with_nights(config, wanted)?.settings()?;
        let star = match taken {
            Some(taken) => Star::Observed(taken),
            None => Star::Simulated(Dataset::read(&settings)?),
        };
        let mut ahead = match &star {
            Star::Observed(Taken { scene, .. }) => ahead::planned(scene, &settings, own, wanted)?,
            Star::Simulated(data) => ahead::simulated(config, &settings, data, wanted)?,
        };
        let mut parts = match &star {
            Star::Observed(Taken { scene, .. }) => of_sets(&scene.imager, &scene.observations),
            Star::Simulated(_) => vec![Observations { profiles: Vec::new() }; settings.sets.len()],
        };
        let before: Vec<usize> = parts.iter().map(|part| part.profiles.len()).collect();
        ahead.iter().for_each(|ahead| parts[ahead.set].profiles.extend(ahead.profiles.iter().cloned()));
        let (mut imager, settings) = match &star {
            Star::Observed(Taken { scene, .. }) => {
                let scene = scene.with_parts(parts.clone())?;
                (scene.imager, scene.settings)
            }
            Star::Simulated(data) => {
                let mut imager = imager(&settings, &settings.sets, &parts, &[])?;
                imager.light_curves = light_curves(&settings, data, &parts)?;
                (imager, settings)
            }
        };
        // a simulated one beside planned profiles is planned, too
        let is_known = |of: &LightCurveSettings| taken.is_some() || matches!(of.source, LightSource::File(_));
        let known_light: Vec<bool> = settings.light_curves.iter().map(is_known).collect();
        let (known, nights) = numbers(&imager, &before, &known_light, &ahead);
        imager.light_curves.extend(ahead.iter_mut().filter_map(|ahead| ahead.light.take()));
        let sigma = |of: &mut dyn Iterator<Item = &Ahead>| {
            let sigmas: Vec<f64> = of.flat_map(|ahead| &ahead.profiles).flat_map(|p| p.sigma.clone()).collect();
            (!sigmas.is_empty()).then(|| middle(sigmas))
        };
        let record = |(set, of): (usize, &DataSetSettings)| SetRecord {
            name: of.name.clone(),
            taken: before[set],
            planned: parts[set].profiles.len() - before[set],
            nights: nights.iter().filter(|(of, _)| *of == set).count(),
            snr: sigma(&mut ahead.iter().filter(|ahead| ahead.set == set)).map(f64::recip),
        };
        let sets = settings.sets.iter().enumerate().filter(|_| settings.sets.len() > 1).map(record).collect();
        let stem = own.path.file_stem().map_or("plan".into(), |stem| stem.to_string_lossy().into_owned());
        let known_field = settings.known_field();
        let source = match (taken, known_field.amplitude, known_field.slope, known_field.lifetime) {
            (Some(_), ..) => SpotsSource::Fitted,
            (None, Some(_), Some(_), Some(_)) => SpotsSource::Given,
            _ => SpotsSource::Usual,
        };
        let data_sha256 = with_light_curves(fingerprint(&Observations::joined(parts)), &imager.light_curves);
        Ok(Campaign {
            name: wanted.map_or(stem.clone(), |nights| format!("{stem}, {nights} nights")),
            taken: taken.map(|taken| Arc::clone(&taken.marginal)),
            assumed: taken.map_or_else(|| usual(known_field), |taken| taken.marginal.assumed),
            known,
            source,
            sigma: sigma(&mut ahead.iter()).unwrap_or(f64::NAN),
            sets,
            nights: nights.into_iter().map(|(_, night)| night).collect(),
            provenance: Provenance {
                version: env!("CARGO_PKG_VERSION").into(),
                data_sha256,
                config_sha256: own.sha256.clone(),
                config: own.resolved.clone(),
                measured: taken.map_or_else(Measured::default, |taken| taken.scene.measured.clone()),
            },
            imager,
            settings,
        })
    }

    /// The expected constraints of profiles and light curves on velocities, marginalised over these nuisances.
    pub(super) fn planned<'a>(&'a self, nuisances: &'a [Nuisance]) -> Planned<'a> {
        let taken = self.taken.as_deref().map(|taken| (taken, &self.known[..]));
        Planned::new(&self.imager, self.settings.values, self.assumed, nuisances, taken)
    }

    /// The profiles among some epochs.
    pub(super) fn profiles_of(&self, part: &[usize]) -> Vec<usize> {
        let count = self.imager.profiles().count();
        part.iter().copied().filter(|k| *k < count).collect()
    }

    /// The epochs after some nights, with light curves up to a time (d) that may be later.
    pub(super) fn after(&self, nights: &[usize], light_until_d: f64) -> Vec<usize> {
        let times_d = self.imager.times_of_all_d();
        let taken = self.profiles_of(&self.known);
        let bins = self.imager.profiles().count()..times_d.len();
        let is_there = |k: &usize| self.known.contains(k) || times_d[*k] <= light_until_d;
        let of_nights = nights.iter().flat_map(|night| &self.nights[*night]).copied();
        taken.into_iter().chain(of_nights).chain(bins.filter(is_there)).collect()
    }

    /// Name of the data set of a night, if there are several.
    pub(super) fn set_of(&self, night: usize) -> Option<&str> {
        let is_its = |of: &Range<usize>| of.contains(&self.nights[night][0]);
        Some(&self.sets.get(self.imager.profiles_of_sets().iter().position(is_its)?)?.name)
    }

    /// The light curves.
    pub fn light_curves(&self) -> Vec<LightRecord> {
        let mut first = self.imager.profiles().count();
        let record = |curve: &LightCurve| {
            let (place, bins) = (first, curve.bins.len());
            first += bins;
            LightRecord { name: curve.name.clone(), bins, planned: !self.known.contains(&place) }
        };
        self.imager.light_curves.iter().map(record).collect()
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

    /// The epochs after some of the nights, `looks` times during the campaign; before the first night too, if there are
    /// profiles. Planned light curves grow with it.
    pub(super) fn looks(&self, looks: usize) -> Vec<(usize, Vec<usize>)> {
        let mut nights: Vec<usize> = (1..=looks).map(|k| (k * self.nights.len()).div_ceil(looks)).collect();
        if self.taken.is_some() {
            nights.insert(0, 0);
        }
        nights.dedup();
        let times_d = self.imager.times_d();
        let last_d =
            |n: usize| self.nights[..n].iter().flatten().map(|k| times_d[*k]).fold(f64::NEG_INFINITY, f64::max);
        let part = |n: usize| self.after(&(0..n).collect::<Vec<_>>(), last_d(n));
        nights.into_iter().map(|n| (n, part(n))).collect()
    }

    /// The trial periods of a search in some of the profiles.
    ///
    /// # Errors
    /// [`FrequencyError`].
    pub(super) fn frequencies(&self, part: &[usize], wanted: FrequencySettings) -> Result<Frequencies, FrequencyError> {
        let all = self.imager.cycles();
        let cycles: Vec<f64> = self.profiles_of(part).iter().map(|k| all[*k]).collect();
        Frequencies::new(&cycles, self.imager.star.rotation_period_d, wanted)
    }
}

/// The config's observations with the field that fits them, without a planet.
fn taken(config: &Config, report: &dyn Fn(&str)) -> Result<Taken, CampaignError> {
    let scene = fitted(Scene::new(config)?, report);
    let known = scene.surface().field.unwrap_or_default();
    let values = scene.settings.values.without_planet();
    let found = fit(&scene.imager, &Arc::new(Basis::new(&scene.imager.grid)), values, known, None);
    let found = found.map_err(|source| CampaignError::Field { path: scene.settings.path.clone(), source })?;
    Ok(Taken { scene, marginal: Arc::new(found.marginal) })
}

/// Indices of the epochs before the first night, so many profiles of each data set and the known bins of light curves;
/// and those of planned nights, in the order of time, with their data sets.
fn numbers(
    imager: &Imager,
    before: &[usize],
    known_light: &[bool],
    ahead: &[Ahead],
) -> (Vec<usize>, Vec<(usize, Vec<usize>)>) {
    let places = imager.profiles_of_sets();
    let mut known: Vec<usize> = places.iter().zip(before).flat_map(|(of, n)| of.start..of.start + n).collect();
    let mut next: Vec<usize> = places.iter().zip(before).map(|(of, n)| of.start + n).collect();
    let mut nights: Vec<(usize, Vec<usize>)> = Vec::new();
    for ahead in ahead {
        let first = &mut next[ahead.set];
        nights.extend(ahead.nights.iter().map(|night| (ahead.set, night.iter().map(|k| *first + k).collect())));
        *first += ahead.profiles.len();
    }
    let times_d = imager.times_d();
    nights.sort_by(|(_, a), (_, b)| times_d[a[0]].total_cmp(&times_d[b[0]]));
    let mut bins = times_d.len()..usize::MAX;
    for (curve, is_known) in imager.light_curves.iter().zip(known_light) {
        let own = bins.by_ref().take(curve.bins.len());
        known.extend(own.filter(|_| *is_known));
    }
    (known, nights)
}

/// A usual field, except for what is known.
fn usual(known: Known) -> Assumed {
    let (amplitude, slope, lifetime_d) = USUAL;
    let spectrum = Spectrum {
        amplitude: known.amplitude.unwrap_or(amplitude),
        slope: known.slope.unwrap_or(slope),
        break_degree: known.break_degree(),
    };
    let lifetime = known.lifetime.unwrap_or(Lifetime::Days(lifetime_d));
    let field = Field { spectrum, kernel: Kernel::of(lifetime) };
    Assumed { field, jitter_kms: known.jitter_kms.unwrap_or(0.0), night_kms: known.night_kms }
}
