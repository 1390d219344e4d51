//! The choice of planned nights: those with the most information on one planet, or on which of two periods is right.
//!
//! Nights are chosen one by one, each time the one that improves the constraints of the chosen ones most. The
//! constraints of profiles on an orbit are known in advance: the information of their velocities, marginalised over
//! spots (`surface::planned`). Where it depends on the maps, it is averaged over them.

use super::{Campaign, PlanError, PlanSettings};
use crate::data::ephemeris::ephemerides;
use crate::field::FieldError;
use crate::model::Ephemeris;
use crate::numerics::quantile::middle;
use crate::planets::periodogram::orbits::{at, between};
use crate::planets::velocities::VelocityQuadratic;
use crate::surface::expansion::nuisances;
use crate::surface::planned::Planned;
use nalgebra::{DMatrix, DVector, Matrix2};
use rand::SeedableRng;
use rand::seq::SliceRandom;
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// Largest number of maps in the average: the information hardly depends on them.
const MAPS: usize = 3;

/// Random choices that are compared with the best, by their median.
const RANDOM: usize = 5;

/// Random-number stream of the random choices.
const STREAM: u64 = 6;

/// The aim of the choice.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", tag = "for")]
pub enum Aim {
    /// The smallest standard error of K of a planet of this period.
    Amplitude {
        /// Its period (d).
        period_d: f64,
        /// Its ephemeris, where it is known; any phase otherwise.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        ephemeris: Option<Ephemeris>,
    },
    /// Distinguishing a planet of this period from one of another, any phases.
    Alias {
        /// Its period (d).
        period_d: f64,
        /// The other one (d).
        other_d: f64,
    },
}

/// The figure of merit of some nights.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Merit {
    /// Number of chosen nights.
    pub nights: usize,
    /// Standard error of K (km/s); for two periods, of the part of the orbit that the other period does not absorb.
    /// Null where it is not bounded.
    pub sigma_k_kms: Option<f64>,
}

/// A chosen night.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ChosenNight {
    /// Data set, if there are several.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub set: Option<String>,
    /// First and last time (d).
    pub span_d: [f64; 2],
    /// Its profiles.
    pub profiles: usize,
    /// The standard error of K (km/s) with it and those chosen before.
    pub sigma_k_kms: Option<f64>,
}

/// Nights chosen among the candidates.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Choice {
    /// The aim.
    #[serde(flatten)]
    pub aim: Aim,
    /// Number of candidate nights.
    pub candidates: usize,
    /// Without a planned night.
    pub now: Merit,
    /// The nights, the most valuable first.
    pub chosen: Vec<ChosenNight>,
    /// As many nights, evenly spaced.
    pub even: Vec<Merit>,
    /// As many at random: medians.
    pub random: Vec<Merit>,
}

/// The information of the profiles of some nights.
struct Weighed<'a> {
    planned: Planned<'a>,
    maps: Vec<DMatrix<f64>>,
    campaign: &'a Campaign,
    aim: &'a Aim,
    /// Other planets, whose K is free.
    others: Vec<Ephemeris>,
}

/// Standard errors of K (km/s) for some nights: with a wide prior, for comparing nights where too few are chosen to
/// bound an orbit, and without it, infinite where it is not bounded.
#[derive(Clone, Copy, Debug)]
struct Sigma {
    beside_prior: f64,
    alone: f64,
}

/// Information of that prior (s^2/km^2): of 1 km/s.
const PRIOR: f64 = 1.0;

impl Weighed<'_> {
    /// Standard errors of K with these planned nights.
    fn sigma(&self, nights: &[usize]) -> Result<Sigma, FieldError> {
        // planned light curves cover all nights, whichever are chosen
        let light_until_d = if nights.is_empty() { f64::NEG_INFINITY } else { f64::INFINITY };
        let mut part = self.campaign.after(nights, light_until_d);
        part.sort_unstable();
        if self.campaign.profiles_of(&part).is_empty() {
            return Ok(Sigma { beside_prior: PRIOR.sqrt().recip(), alone: f64::INFINITY });
        }
        let mut sums = [0.0; 2];
        for maps in &self.maps {
            let quadratic = &self.planned.velocities(maps, std::slice::from_ref(&part))?[0];
            let unit = |of: &Ephemeris| of.unit_velocities(&quadratic.cycles);
            let columns: Vec<DVector<f64>> = self.others.iter().map(unit).collect();
            let rest = if columns.is_empty() { None } else { quadratic.beside(&DMatrix::from_columns(&columns)) };
            let quadratic = rest.as_ref().unwrap_or(quadratic);
            for (sum, prior) in sums.iter_mut().zip([PRIOR, 0.0]) {
                *sum += self.aim.variance(quadratic, self.campaign.imager.star.rotation_period_d, prior);
            }
        }
        let [beside_prior, alone] = sums.map(|sum| (sum / self.maps.len() as f64).sqrt());
        Ok(Sigma { beside_prior, alone })
    }

    fn sigmas(&self, all: &[Vec<usize>]) -> Result<Vec<Sigma>, FieldError> {
        all.par_iter().map(|nights| self.sigma(nights)).collect()
    }
}

/// Whether two periods (d) are equal.
pub fn is_same(a_d: f64, b_d: f64) -> bool {
    (a_d / b_d - 1.0).abs() < 1e-3
}

impl Aim {
    /// Period of the planet (d).
    fn period_d(&self) -> f64 {
        let (Aim::Amplitude { period_d, .. } | Aim::Alias { period_d, .. }) = self;
        *period_d
    }

    /// Variance of K (km^2/s^2), averaged over phases where these are not known, with a prior of that information
    /// (s^2/km^2); infinite where it is not bounded.
    fn variance(&self, quadratic: &VelocityQuadratic, rotation_period_d: f64, prior: f64) -> f64 {
        let found = match self {
            Aim::Amplitude { ephemeris: Some(known), .. } => {
                let alone = quadratic.amplitude(&known.unit_velocities(&quadratic.cycles))[1].powi(-2);
                Some((alone + prior).recip())
            }
            Aim::Amplitude { period_d, ephemeris: None } => {
                let trial = at(quadratic, rotation_period_d / period_d);
                let information = trial.information + Matrix2::identity() * prior;
                let covariance = information.try_inverse().filter(|_| prior > 0.0 || trial.orbit.is_some());
                covariance.map(|covariance| 0.5 * covariance.trace())
            }
            Aim::Alias { period_d, other_d } => {
                let rest = between(quadratic, rotation_period_d / period_d, rotation_period_d / other_d, prior);
                rest.map(|information| 2.0 / (information.trace() + 2.0 * prior))
            }
        };
        found.filter(|variance| *variance > 0.0).unwrap_or(f64::INFINITY)
    }
}

/// `count` nights of the `campaign`, or all where there are fewer. `report` is called with the progress.
///
/// # Errors
/// [`PlanError::Field`].
pub fn choose(
    campaign: &Campaign,
    count: usize,
    aim: &Aim,
    settings: &PlanSettings,
    report: &dyn Fn(&str),
) -> Result<Choice, PlanError> {
    let field = |source| PlanError::Field { name: campaign.name.clone(), source };
    let nuisances = if settings.fixed { Vec::new() } else { nuisances(&campaign.settings.free) };
    let planned = campaign.planned(&nuisances);
    let maps = match settings.maps {
        0 => vec![planned.mean_maps()],
        many => (0..many.min(MAPS))
            .map(|k| planned.drawn_maps(settings.seed.wrapping_add(k as u64)))
            .collect::<Result<_, _>>()
            .map_err(field)?,
    };
    let is_other = |known: &Ephemeris| !is_same(known.period_d[0], aim.period_d());
    let others = ephemerides(&campaign.settings).into_iter().filter(is_other).collect();
    let weighed = Weighed { planned, maps, campaign, aim, others };
    let candidates = campaign.nights.len();
    let count = count.min(candidates);
    let mut chosen: Vec<usize> = Vec::new();
    let mut nights = Vec::new();
    for k in 0..count {
        report(&format!("{}: night {} of {count}", campaign.name, k + 1));
        let left: Vec<usize> = (0..candidates).filter(|night| !chosen.contains(night)).collect();
        let with = |night: &usize| chosen.iter().copied().chain([*night]).collect::<Vec<_>>();
        let sigmas = weighed.sigmas(&left.iter().map(with).collect::<Vec<_>>()).map_err(field)?;
        let best =
            (0..left.len()).min_by(|a, b| sigmas[*a].beside_prior.total_cmp(&sigmas[*b].beside_prior)).unwrap_or(0);
        chosen.push(left[best]);
        nights.push(campaign.chosen(left[best], bounded(sigmas[best].alone)));
    }
    report(&format!("{}: even and random nights", campaign.name));
    let evenly = |n: usize| (0..n).map(|k| (2 * k + 1) * candidates / (2 * n)).collect::<Vec<_>>();
    let even = weighed.sigmas(&(1..=count).map(evenly).collect::<Vec<_>>()).map_err(field)?;
    let mut rng = ChaCha8Rng::seed_from_u64(settings.seed);
    rng.set_stream(STREAM);
    let mut draws: Vec<Vec<usize>> = Vec::new();
    for _ in 0..RANDOM {
        let mut order: Vec<usize> = (0..candidates).collect();
        order.shuffle(&mut rng);
        draws.extend((1..=count).map(|n| order[..n].to_vec()));
    }
    let at_random = weighed.sigmas(&draws).map_err(field)?;
    let median = |n: usize| middle(at_random.iter().skip(n).step_by(count).map(|sigma| sigma.alone).collect());
    let merits = |sigmas: &[f64]| {
        let merit = |(k, sigma): (usize, &f64)| Merit { nights: k + 1, sigma_k_kms: bounded(*sigma) };
        sigmas.iter().enumerate().map(merit).collect()
    };
    let now = Merit { nights: 0, sigma_k_kms: bounded(weighed.sigma(&[]).map_err(field)?.alone) };
    Ok(Choice {
        aim: aim.clone(),
        candidates,
        now,
        chosen: nights,
        even: merits(&even.iter().map(|sigma| sigma.alone).collect::<Vec<_>>()),
        random: merits(&(0..count).map(median).collect::<Vec<_>>()),
    })
}

fn bounded(sigma: f64) -> Option<f64> {
    sigma.is_finite().then_some(sigma)
}

impl Campaign {
    fn chosen(&self, night: usize, sigma_k_kms: Option<f64>) -> ChosenNight {
        let times = self.imager.times_d();
        let of = self.nights[night].iter().map(|k| times[*k]);
        let [first, last] = of.fold([f64::INFINITY, f64::NEG_INFINITY], |[a, b], t| [a.min(t), b.max(t)]);
        ChosenNight {
            set: self.set_of(night).map(str::to_owned),
            span_d: [first, last],
            profiles: self.nights[night].len(),
            sigma_k_kms,
        }
    }
}
