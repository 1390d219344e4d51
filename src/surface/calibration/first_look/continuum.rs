//! The level of the continuum beside the line, on average and in each profile: no map fits profiles whose continuum is
//! not at 1, is tilted, or varies from one to the next.

use super::noise::Scatter;
use crate::star::observation::{Observations, Profile};

/// The continuum extends beyond the end of the line by as much again, as for the noise.
const OUTER: f64 = 2.0;

/// Fewest bins on either side of the line for a level.
const FEWEST_BINS: usize = 4;

/// Levels vary where their scatter exceeds chance by this many standard deviations of chi2.
const WANDERING: f64 = 4.0;

/// A level differs from 1 where it is this many standard errors away, and by more than the second number.
const ANOTHER_LEVEL: (f64, f64) = (4.0, 5e-4);

/// The continuum on both sides of the line.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Continuum {
    /// Its mean level, 1 for normalised profiles.
    pub level: f64,
    /// Its standard error, from the scatter of the profiles' levels and of their bins.
    pub level_error: f64,
    /// Standard deviation of the levels of single profiles about the mean, their noise subtracted; `None` where the
    /// noise explains it all.
    pub wandering: Option<f64>,
    /// Root mean square of the slopes of single profiles (per km/s), their noise subtracted; `None` where the noise
    /// explains it all, or all slopes are negligible.
    pub tilting: Option<f64>,
}

/// A slope is significant where levels of the two sides differ by twice this.
const LEAST_SLOPE: f64 = 5e-4;

/// Levels of the two sides of one profile, and the variance of each.
struct Sides {
    blue: (f64, f64),
    red: (f64, f64),
    /// Distance between the middles of the two (km/s).
    apart_kms: f64,
}

impl Continuum {
    /// The continuum of profiles whose line extends `reach_kms` to either side of `centre_kms`; `None` where there is
    /// too little of it.
    pub fn of(observations: &Observations, centre_kms: f64, reach_kms: f64) -> Option<Self> {
        let scatter: Scatter = observations.profiles.iter().map(|p| Scatter::of(p, centre_kms, reach_kms)).sum();
        // correlated bins count as fewer independent ones, and quoted uncertainties may be wrong
        let larger = scatter.ratio(1).unwrap_or(1.0).powi(2) * scatter.correlated_bins(f64::INFINITY);
        let sides = |profile| sides(profile, centre_kms, reach_kms, larger);
        let sides = observations.profiles.iter().map(sides).collect::<Option<Vec<Sides>>>()?;
        let half = |sign: f64| -> Vec<(f64, f64)> {
            let of = |s: &Sides| (0.5 * (s.red.0 + sign * s.blue.0), 0.25 * (s.red.1 + s.blue.1));
            sides.iter().map(of).collect()
        };
        let (levels, slopes) = (half(1.0), half(-1.0));
        let (level, variance) = mean(&levels);
        let (slope, scatter) = (mean(&slopes), excess(&slopes));
        let common = (slope.0.abs() > ANOTHER_LEVEL.0 * slope.1.sqrt()).then_some(slope.0.abs());
        let steep = (common.is_some() || scatter.is_some())
            .then(|| common.unwrap_or(0.0).hypot(scatter.unwrap_or(0.0)))
            .filter(|steep| *steep > LEAST_SLOPE);
        let apart = sides.iter().map(|sides| sides.apart_kms).sum::<f64>() / sides.len() as f64;
        let tilting = steep.map(|steep| 2.0 * steep / apart);
        Some(Continuum { level, level_error: variance.sqrt(), wandering: excess(&levels), tilting })
    }

    /// Whether the level differs from 1 significantly and by more than is negligible.
    pub fn is_off(&self) -> bool {
        let off = (self.level - 1.0).abs();
        off > ANOTHER_LEVEL.0 * self.level_error && off > ANOTHER_LEVEL.1
    }
}

/// Mean levels on either side of the line, with variances `larger` than by the quoted uncertainties.
fn sides(profile: &Profile, centre_kms: f64, reach_kms: f64, larger: f64) -> Option<Sides> {
    let side = |sign: f64| {
        let distance = |j: usize| sign * (profile.velocity_kms(j) - centre_kms);
        let beside = |j: &usize| (reach_kms..=OUTER * reach_kms).contains(&distance(*j));
        let bins: Vec<usize> = (0..profile.intensity.len()).filter(beside).collect();
        let count = bins.len() as f64;
        let level = bins.iter().map(|&j| profile.intensity[j]).sum::<f64>() / count;
        let variance = larger * bins.iter().map(|&j| profile.sigma[j].powi(2)).sum::<f64>() / count.powi(2);
        let away = bins.iter().map(|&j| distance(j)).sum::<f64>() / count;
        (bins.len() >= FEWEST_BINS).then_some(((level, variance), away))
    };
    let ((blue, blue_kms), (red, red_kms)) = (side(-1.0)?, side(1.0)?);
    Some(Sides { blue, red, apart_kms: blue_kms + red_kms })
}

/// Mean of values with their variances, and its variance, by their scatter where that is larger.
fn mean(values: &[(f64, f64)]) -> (f64, f64) {
    let n = values.len() as f64;
    let mean = values.iter().map(|(x, _)| x).sum::<f64>() / n;
    let chance = values.iter().map(|(_, variance)| variance).sum::<f64>() / n;
    (mean, scatter(values, mean).max(chance) / n)
}

/// Variance of values about their mean; 0 for one value.
fn scatter(values: &[(f64, f64)], mean: f64) -> f64 {
    values.iter().map(|(x, _)| (x - mean).powi(2)).sum::<f64>() / (values.len() as f64 - 1.0).max(1.0)
}

/// Standard deviation in excess of the variances, where it is significant.
fn excess(values: &[(f64, f64)]) -> Option<f64> {
    let freedom = values.len() as f64 - 1.0;
    let mean = values.iter().map(|(x, _)| x).sum::<f64>() / values.len() as f64;
    let chance = values.iter().map(|(_, variance)| variance).sum::<f64>() / values.len() as f64;
    let scatter = scatter(values, mean);
    let most = 1.0 + WANDERING * (2.0 / freedom).sqrt();
    (freedom >= 1.0 && scatter > most * chance).then(|| (scatter - chance).sqrt())
}
