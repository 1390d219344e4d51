//! A simulated star's spots and the times at which it is observed: listed, or drawn at random.

use super::checks::{
    check_jitter, check_nuisances, check_pixels, check_size, check_zero_point, most, positive, within,
};
use super::parameters::check_value;
use crate::data::config::error::Fault;
use crate::data::config::written::{SimulateSection, VelocitySection};
use crate::data::simulate::{RandomSpots, Schedule, Simulation};
use crate::model::{Clock, Elements, Parameter, ParameterValues};
use crate::star::{Disc, Facula, Life, Spot, StarSettings};
use crate::surface::nuisances::LineAndContinuum;

/// Largest numbers drawn at random: nights times profiles, and spots.
const MOST_PROFILES: usize = 10_000;
const MOST_SPOTS: f64 = 10_000.0;

/// The path of a key of the simulation of a data set.
fn at(set: &str, field: &str) -> String {
    format!("{set}.simulate.{field}")
}

/// The simulation of the data set at the key `set`, of a `star` whose parameters have these `values`, in exposures of
/// that length (s) if one is given.
pub(super) fn simulation(
    section: &SimulateSection,
    star: &StarSettings,
    values: &ParameterValues,
    (set, exposure_s): (&str, Option<f64>),
) -> Result<Simulation, Fault> {
    let at = |field: &str| at(set, field);
    let faculae = section.faculae.iter().enumerate().map(|(k, f)| facula(f, &at(&format!("faculae[{k}]"))));
    let times_d = times_d(section, star, set)?;
    if let Some(snr) = section.snr {
        positive(&at("snr"), snr)?;
    }
    check_pixels(&at("pixels"), section.pixels)?;
    let continuum = section
        .continuum
        .map_or(LineAndContinuum::default(), |c| LineAndContinuum::of_numbers([c.offset, c.slope, c.equivalent_width]));
    check_nuisances(&at("continuum"), ["offset", "slope", "equivalent_width"], &continuum)?;
    check_jitter(&at("velocity_jitter_kms"), section.velocity_jitter_kms)?;
    check_zero_point(&at("zero_point_kms"), section.zero_point_kms)?;
    if !(section.correlated_bins >= 1.0 && section.correlated_bins <= MOST_CORRELATED_BINS) {
        let problem = format!("{} must be from 1 (white noise) to {MOST_CORRELATED_BINS}", section.correlated_bins);
        return Err(Fault::new(at("correlated_bins"), problem));
    }
    let mut truth = *values;
    for (parameter, value) in section.truth.entries() {
        check_value(parameter, *value, &at(&format!("truth.{}", parameter.name())))?;
    }
    let no_orbit = || Fault::new(at("truth"), "is no orbit: each planet needs a period, and an eccentricity below 1");
    let given = |p: Parameter| section.truth.has(p);
    let has_period = |of: &Elements| truth.get(of.ratio).is_some() || given(of.ratio) || given(of.period);
    if Elements::PLANETS.iter().any(|of| given(of.conjunction) && !has_period(of)) {
        return Err(no_orbit());
    }
    let clock = Clock { rotation_period_d: star.rotation_period_d, epoch_d: star.epoch_d };
    Elements::write(&mut truth, section.truth.entries().map(|(parameter, value)| (parameter, *value)), clock);
    if truth.motion().orbits().any(|planet| !(planet.shape.eccentricity() < 1.0 && planet.orbit.porb_over_prot > 0.0)) {
        return Err(no_orbit());
    }
    Ok(Simulation {
        spots: spots(section, star, &truth, &times_d, set)?,
        faculae: faculae.collect::<Result<_, _>>()?,
        truth,
        times_d,
        first_velocity_kms: section.velocity_kms.min,
        step_kms: section.velocity_kms.step,
        bins: bins(&section.velocity_kms, &at("velocity_kms"))?,
        snr: section.snr,
        seed: section.seed,
        pixels: section.pixels,
        continuum,
        velocity_jitter_kms: section.velocity_jitter_kms,
        zero_point_kms: section.zero_point_kms,
        correlated_bins: section.correlated_bins,
        exposure_s,
    })
}

/// Largest correlation length of the noise in bins.
const MOST_CORRELATED_BINS: f64 = 1000.0;

/// Number of velocity bins; the last lies at or below `max`.
fn bins(axis: &VelocitySection, key: &str) -> Result<usize, Fault> {
    const LEAST: f64 = 5.0;
    const MOST: f64 = 100_000.0;
    positive(&format!("{key}.step"), axis.step)?;
    check_size(&format!("{key}.min"), axis.min, most::VELOCITY_KMS)?;
    check_size(&format!("{key}.max"), axis.max, most::VELOCITY_KMS)?;
    if axis.min >= axis.max {
        return Err(Fault::new(format!("{key}.min"), format!("{} must be below max, which is {}", axis.min, axis.max)));
    }
    // Where max is meant to be a bin, rounding must not lose it.
    let bins = ((axis.max - axis.min) / axis.step + 1e-6).floor() + 1.0;
    if !(LEAST..=MOST).contains(&bins) {
        return Err(Fault::new(format!("{key}.step"), format!("makes {bins} bins, they must be {LEAST} to {MOST}")));
    }
    Ok(bins as usize)
}

/// Times of the profiles (d).
pub(super) fn times_d(section: &SimulateSection, star: &StarSettings, set: &str) -> Result<Vec<f64>, Fault> {
    let at = |field: &str| at(set, field);
    let cycles = match (&section.cycles, &section.schedule) {
        (Some(cycles), None) => cycles,
        (None, Some(schedule)) => {
            check_schedule(schedule, &at("schedule"))?;
            check_size("star.epoch_d", star.epoch_d, most::TIME)?;
            return scheduled(schedule, &at("schedule"), star.epoch_d);
        }
        (Some(_), Some(_)) => return Err(Fault::new(at("schedule"), "give either cycles or schedule, not both")),
        (None, None) => return Err(Fault::new(at("cycles"), "missing, give cycles or schedule")),
    };
    if cycles.is_empty() {
        return Err(Fault::new(at("cycles"), "is empty, at least one profile is needed"));
    }
    let times_d: Vec<f64> = cycles.iter().map(|c| star.epoch_d + c * star.rotation_period_d).collect();
    for (k, (cycle, time_d)) in cycles.iter().zip(&times_d).enumerate() {
        let key = at(&format!("cycles[{k}]"));
        check_size(&key, *cycle, most::TIME)?;
        check_size(&format!("{key}: its time (d)"), *time_d, most::TIME)?;
    }
    Ok(times_d)
}

/// Whether the schedule at `key` is valid.
pub(super) fn check_schedule(schedule: &Schedule, key: &str) -> Result<(), Fault> {
    let Schedule { nights, seasons, season_spacing_d, per_night: [fewest, largest], night_hours, clouds, .. } =
        *schedule;
    let key = |field: &str| format!("{key}.{field}");
    within(&key("nights"), nights as f64, [1.0, 1000.0])?;
    within(&key("seasons"), seasons as f64, [1.0, 100.0])?;
    check_size(&key("season_spacing_d"), season_spacing_d, most::TIME)?;
    let of_season = schedule.of_season();
    if let Some(numbers) = &schedule.on_nights {
        if numbers.is_empty() || numbers.windows(2).any(|pair| pair[0] >= pair[1]) {
            return Err(Fault::new(key("on_nights"), "must be rising numbers of nights, one at least"));
        }
        within(&key("on_nights"), of_season[of_season.len() - 1] as f64, [0.0, MOST_PROFILES as f64])?;
    }
    let length = of_season.last().map_or(0, |last| last + 1);
    if seasons > 1 && season_spacing_d < length as f64 {
        let problem = format!("{season_spacing_d} must be {length} (the nights of a season) or more");
        return Err(Fault::new(key("season_spacing_d"), problem));
    }
    for number in [fewest, largest] {
        within(&key("per_night"), number as f64, [1.0, 100.0])?;
    }
    if fewest > largest {
        return Err(Fault::new(key("per_night"), format!("{fewest} must not be above {largest}")));
    }
    if of_season.len() * seasons * largest > MOST_PROFILES {
        let problem = format!("{seasons} seasons may have more than {MOST_PROFILES} profiles: take fewer");
        return Err(Fault::new(key("nights"), problem));
    }
    if !(night_hours > 0.0 && night_hours <= 24.0) {
        return Err(Fault::new(key("night_hours"), format!("{night_hours} must be above 0 and up to 24")));
    }
    if !(0.0..1.0).contains(&clouds) {
        return Err(Fault::new(key("clouds"), format!("{clouds} must be from 0 and below 1")));
    }
    Ok(())
}

/// Its times (d) from `first_d` on.
pub(super) fn scheduled(schedule: &Schedule, key: &str, first_d: f64) -> Result<Vec<f64>, Fault> {
    let times_d = schedule.times_d(first_d);
    match times_d.is_empty() {
        true => {
            let problem = format!("{} leaves no night: take less, or another seed", schedule.clouds);
            Err(Fault::new(format!("{key}.clouds"), problem))
        }
        false => Ok(times_d),
    }
}

/// The spots, listed ones first.
pub(super) fn spots(
    section: &SimulateSection,
    star: &StarSettings,
    truth: &ParameterValues,
    times_d: &[f64],
    set: &str,
) -> Result<Vec<Spot>, Fault> {
    let at = |field: &str| at(set, field);
    let drawn = match &section.random_spots {
        Some(random) => random_spots(random, truth, times_d, set)?,
        None => Vec::new(),
    };
    let listed = section.spots.iter().enumerate().map(|(k, spot)| (spot, at(&format!("spots[{k}]"))));
    let all = listed.chain(drawn.iter().map(|spot| (spot, at("random_spots"))));
    all.map(|(numbers, key)| spot(numbers, star, truth, &key)).collect()
}

fn random_spots(
    random: &RandomSpots,
    truth: &ParameterValues,
    times_d: &[f64],
    set: &str,
) -> Result<Vec<Vec<f64>>, Fault> {
    let key = |field: &str| at(set, &format!("random_spots.{field}"));
    within(&key("number"), random.number as f64, [1.0, MOST_SPOTS])?;
    if let Some(lifetime_d) = random.lifetime_d {
        positive(&key("lifetime_d"), lifetime_d)?;
        check_size(&key("lifetime_d"), lifetime_d, most::TIME)?;
    }
    let bounds = [
        ("radius_deg", Some(random.radius_deg), [0.0, 180.0]),
        ("filling", Some(random.filling), [0.0, 1.0]),
        ("latitude_deg", random.latitude_deg, [-90.0, 90.0]),
    ];
    for (name, bounds, range) in bounds {
        let Some([low, high]) = bounds else { continue };
        within(&key(name), low, range)?;
        within(&key(name), high, range)?;
        if low > high {
            return Err(Fault::new(key(name), format!("{low} must not be above {high}")));
        }
    }
    if random.radius_deg[0] < SMALLEST_DEG {
        let problem = format!("{} must be {SMALLEST_DEG} or more", random.radius_deg[0]);
        return Err(Fault::new(key("radius_deg"), problem));
    }
    let first = times_d.iter().copied().fold(f64::INFINITY, f64::min);
    let last = times_d.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let count = random.count(last - first);
    if count > MOST_SPOTS {
        let problem = format!("makes {count} spots over the data, {MOST_SPOTS} at most: longer, or fewer at a time");
        return Err(Fault::new(key("lifetime_d"), problem));
    }
    Ok(random.drawn(truth[Parameter::Inclination], [first, last]))
}

/// Spots drawn at random are not smaller than this (degrees): they would be lost between pixels.
const SMALLEST_DEG: f64 = 0.01;

/// Most brightness that a facula may add, in units of the photosphere's.
const LARGEST_EXCESS: f64 = 10.0;

fn spot(numbers: &[f64], star: &StarSettings, truth: &ParameterValues, key: &str) -> Result<Spot, Fault> {
    let (place, filling, when) = match *numbers {
        [longitude, latitude, radius, filling] => ([longitude, latitude, radius], filling, None),
        [longitude, latitude, radius, filling, peak_d, lifetime_d] => {
            ([longitude, latitude, radius], filling, Some((peak_d, lifetime_d)))
        }
        _ => {
            let problem = format!(
                "{} numbers must be 4, [longitude, latitude, radius, filling], or 6, with the time of the largest area \
                and the lifetime",
                numbers.len()
            );
            return Err(Fault::new(key, problem));
        }
    };
    let Disc { longitude, latitude, radius } = disc(place, key)?;
    if !(0.0..=1.0).contains(&filling) {
        return Err(Fault::new(key, format!("filling {filling} must be from 0 to 1")));
    }
    let life = when.map(|(peak_d, lifetime_d)| {
        check_size(&format!("{key}: time of the largest area (d)"), peak_d, most::TIME)?;
        positive(&format!("{key}: lifetime (d)"), lifetime_d)?;
        check_size(&format!("{key}: lifetime (d)"), lifetime_d, most::TIME)?;
        Ok(Life { peak_d, lifetime_d, winding: truth[Parameter::DOmega] * (peak_d - star.epoch_d) })
    });
    Ok(Spot { longitude, latitude, radius, filling, life: life.transpose()? })
}

fn facula(&[longitude, latitude, radius, excess]: &[f64; 4], key: &str) -> Result<Facula, Fault> {
    let disc = disc([longitude, latitude, radius], key)?;
    match excess > 0.0 && excess <= LARGEST_EXCESS {
        true => Ok(Facula { disc, excess }),
        false => Err(Fault::new(key, format!("excess {excess} must be above 0 and up to {LARGEST_EXCESS}"))),
    }
}

/// A circle given in degrees.
fn disc([longitude, latitude, radius]: [f64; 3], key: &str) -> Result<Disc, Fault> {
    let problem = match () {
        _ if latitude.abs() > 90.0 => format!("latitude {latitude} must be from -90 to 90"),
        _ if !(radius > 0.0 && radius <= 180.0) => format!("radius {radius} must be above 0 and up to 180"),
        _ => {
            let [longitude, latitude, radius] = [longitude, latitude, radius].map(f64::to_radians);
            return Ok(Disc { longitude, latitude, radius });
        }
    };
    Err(Fault::new(key, problem))
}
