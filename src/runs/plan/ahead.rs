//! Planned profiles and light curves, night by night.

use super::CampaignError;
use crate::data::config::{Config, DataSetSettings, PlannedLight, PlannedProfiles, SEGMENT_GAP_D, Settings};
use crate::data::dataset::{Dataset, ProfileSet, at_cadence};
use crate::data::scene::Scene;
use crate::data::simulate::Site;
use crate::numerics::quantile::middle;
use crate::star::observation::{Profile, nights};
use crate::surface::photometry::{Flux, LightCurve, bin_width_d};
use serde_json::Value;
use std::path::Path;

/// Planned profiles that are farther apart (d) belong to two nights: those of one night may be hours apart.
const NIGHT_GAP_D: f64 = 0.5;

/// The plan for a data set.
pub struct Ahead {
    /// Its number.
    pub set: usize,
    /// In the order of the list.
    pub profiles: Vec<Profile>,
    /// Their indices by night.
    pub nights: Vec<Vec<usize>>,
    /// The light curve measured meanwhile.
    pub light: Option<LightCurve>,
}

impl Ahead {
    /// From these profiles of a data set, with the site if it is known.
    fn new(set: usize, profiles: Vec<Profile>, site: Option<&Site>) -> Self {
        let times_d: Vec<f64> = profiles.iter().map(|profile| profile.time_d).collect();
        let nights = match site {
            None => nights(&times_d, NIGHT_GAP_D),
            // from local noon to noon
            Some(site) => {
                let mut order: Vec<usize> = (0..times_d.len()).collect();
                order.sort_by(|a, b| times_d[*a].total_cmp(&times_d[*b]));
                let is_one = |a: &usize, b: &usize| site.night(times_d[*a]) == site.night(times_d[*b]);
                order.chunk_by(is_one).map(<[usize]>::to_vec).collect()
            }
        };
        Ahead { set, profiles, nights, light: None }
    }

    /// Keeps only the first nights; `key` is that of the full list.
    fn truncate(&mut self, nights: usize, path: &Path, key: String) -> Result<(), CampaignError> {
        if nights > self.nights.len() {
            let (wanted, listed) = (nights, self.nights.len());
            return Err(CampaignError::Nights { path: path.into(), key, wanted, listed });
        }
        let kept = self.nights[..nights].iter().flatten().map(|k| self.profiles[*k].clone());
        *self = Ahead::new(self.set, kept.collect(), None);
        Ok(())
    }
}

/// The profiles of each data set of a star that is not yet observed; for times that the config lists, those of so many
/// nights if `wanted`.
pub fn simulated(
    config: &Config,
    settings: &Settings,
    data: &Dataset,
    wanted: Option<usize>,
) -> Result<Vec<Ahead>, CampaignError> {
    let of_set = |(set, (of, profiles)): (usize, (&DataSetSettings, &ProfileSet))| {
        let inflation = of.simulation().map_or(1.0, |simulation| simulation.correlated_bins.sqrt());
        let mut profiles = profiles.observations.profiles.clone();
        profiles.iter_mut().flat_map(|p| &mut p.sigma).for_each(|sigma| *sigma *= inflation);
        Ahead::new(set, profiles, None)
    };
    let mut all: Vec<Ahead> = settings.sets.iter().zip(&data.sets).enumerate().map(of_set).collect();
    if let Some(wanted) = wanted {
        for (ahead, _) in all.iter_mut().zip(listed(config)).filter(|(_, is_listed)| *is_listed) {
            let key = format!("{}.simulate.cycles", settings.sets[ahead.set].key);
            ahead.truncate(wanted, &settings.path, key)?;
        }
    }
    Ok(all)
}

/// The plan in an observed star's config, for so many nights if `wanted`.
pub fn planned(
    scene: &Scene,
    settings: &Settings,
    own: &Settings,
    wanted: Option<usize>,
) -> Result<Vec<Ahead>, CampaignError> {
    settings.plan.iter().map(|plan| next(plan, scene, own, wanted)).collect()
}

/// The part of the config with the times of profiles, and its section.
fn place(config: &Config) -> (&'static str, &'static str) {
    match config.get("plan").is_some_and(|plan| !plan.is_null()) {
        true => ("plan", ""),
        false => ("observations", "/simulate"),
    }
}

/// Those sections, one for each data set.
fn sections<'a>(part: &'a mut Value, inner: &str) -> Vec<&'a mut Value> {
    let all = match part {
        Value::Array(all) => all.iter_mut().collect(),
        one => vec![one],
    };
    all.into_iter().filter_map(|section| section.pointer_mut(inner)).collect()
}

/// Whether a section lists times, instead of having a schedule.
fn lists_times(section: &Value) -> bool {
    ["times_d", "cycles"].iter().any(|key| section.get(key).is_some_and(|times| !times.is_null()))
}

/// Which data sets list times.
fn listed(config: &Config) -> Vec<bool> {
    let (key, inner) = place(config);
    let mut part = config.get(key).cloned().unwrap_or_default();
    sections(&mut part, inner).iter().map(|section| lists_times(section)).collect()
}

/// The config with that many nights in its schedules.
pub fn with_nights(config: &Config, wanted: Option<usize>) -> Result<Config, CampaignError> {
    let Some(wanted) = wanted else { return Ok(config.clone()) };
    let (key, inner) = place(config);
    let mut part = config.get(key).cloned().unwrap_or_default();
    let several = part.is_array();
    for (s, section) in sections(&mut part, inner).into_iter().enumerate() {
        if lists_times(section) {
            continue;
        }
        match section.pointer("/schedule/on_nights").and_then(Value::as_array) {
            None => section["schedule"]["nights"] = wanted.into(),
            Some(numbers) if wanted <= numbers.len() => {
                section["schedule"]["on_nights"] = numbers[..wanted].to_vec().into();
            }
            Some(numbers) => {
                let path = config.settings()?.path;
                let number = if several { format!("[{s}]") } else { String::new() };
                let key = format!("{key}{number}{}.schedule.on_nights", inner.replace('/', "."));
                return Err(CampaignError::Nights { path, key, wanted, listed: numbers.len() });
            }
        }
    }
    Ok(config.clone().with(key, part))
}

/// Planned profiles like the existing ones of their data set: with the bins of the last of these, and a median
/// uncertainty where no signal-to-noise ratio is planned.
fn next(plan: &PlannedProfiles, scene: &Scene, own: &Settings, wanted: Option<usize>) -> Result<Ahead, CampaignError> {
    let PlannedProfiles { key, set, band, section } = plan;
    let taken = &scene.observations.profiles[scene.imager.profiles_of(*set)];
    let last_d = scene.observations.times_d().into_iter().fold(f64::NEG_INFINITY, f64::max);
    // nights of a site are not those of the time scale
    let usual_d = if section.site.is_some() { last_d + 1.0 } else { last_d.floor() + 1.0 };
    let first_d = section.first_d.unwrap_or(usual_d);
    let usual = middle(taken.iter().flat_map(|profile| profile.sigma.clone()).collect());
    let sigma = section.snr.map_or(usual, f64::recip);
    let like = &taken[taken.len() - 1];
    let profile = |time_d: f64| Profile { time_d, sigma: vec![sigma; like.sigma.len()], ..like.clone() };
    let times_d = match (&section.times_d, &section.site) {
        (Some(listed), _) => listed.clone(),
        (None, None) => section.schedule.times_d(first_d),
        (None, Some(site)) if !site.has_date(first_d) => {
            let problem = format!(
                "time {first_d} is no Julian date from 1900 to 2100: give the Julian date of time 0, as 2400000.5 for \
                MJD or 2457000 for BTJD"
            );
            return Err(own.fault(&format!("{key}.site.time_zero_jd"), &problem).into());
        }
        (None, Some(site)) => section.schedule.times_within(first_d, &|begin_d| {
            let [from, to] = site.window_d(begin_d)?;
            Some((from, to - from))
        }),
    };
    let before = times_d.iter().copied().find(|time_d| *time_d <= last_d);
    if let Some(time_d) = before.filter(|_| section.times_d.is_some()) {
        let problem = format!("{time_d} is not after the last profile ({last_d}): give coming nights");
        return Err(own.fault(&format!("{key}.times_d"), &problem).into());
    }
    if times_d.is_empty() {
        let problem = "in none of the nights is the star high enough while it is dark: another first_d, or a lower \
            min_altitude_deg";
        return Err(own.fault(&format!("{key}.site"), problem).into());
    }
    let site = section.site.as_ref().filter(|_| section.times_d.is_none());
    let mut ahead = Ahead::new(*set, times_d.into_iter().map(profile).collect(), site);
    if let (Some(wanted), Some(_)) = (wanted, &section.times_d) {
        ahead.truncate(wanted, &own.path, format!("{key}.times_d"))?;
    }
    if let Some(PlannedLight { cadence_d, sigma, .. }) = section.photometry {
        let ends = |[a, b]: [f64; 2], profile: &Profile| [a.min(profile.time_d), b.max(profile.time_d)];
        let ends = ahead.profiles.iter().fold([f64::INFINITY, f64::NEG_INFINITY], ends);
        let key = format!("{key}.photometry");
        let times_d = at_cadence(own, &key, cadence_d, ends)?;
        let width_d = bin_width_d(std::slice::from_ref(&times_d), scene.imager.star.rotation_period_d);
        let fluxes: Vec<Flux> = times_d.iter().map(|time_d| Flux { time_d: *time_d, flux: 1.0, sigma }).collect();
        // a longer interval between measurements does not separate segments
        let gap_d = SEGMENT_GAP_D.max(1.5 * cadence_d);
        ahead.light = Some(LightCurve::new(&key, *band, &fluxes, width_d, gap_d));
    }
    Ok(ahead)
}
