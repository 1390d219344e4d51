//! The modes of a posterior in the period: how many orbits it holds, and how much weight each has.
//!
//! A time base T resolves frequencies that differ by some 1/T, and a posterior of periods consists of a few such peaks.
//! Draws are smoothed in frequency by a part of that width, and the axis is cut wherever the density falls below half
//! of the lower adjacent peak.

use crate::numerics::quantile::quantile;
use crate::planets::periodogram::RotationPeriods;
use crate::planets::verdict::{PeriodShare, Remark, UNAMBIGUOUS};
use serde::{Deserialize, Serialize};

/// Smoothing, in inverse time bases.
const SMOOTHING: f64 = 0.1;

/// Bins per width of the smoothing.
const FINENESS: f64 = 4.0;

/// A valley separates two peaks where it is below this fraction of the lower one.
const VALLEY: f64 = 0.5;

/// Modes of less weight are not reported.
const LEAST: f64 = 0.02;

/// More bins than this are never needed.
const MOST_BINS: f64 = 1e6;

/// A mode that is wider than this (inverse time bases) does not count: the data do not distinguish its periods.
const BROAD: f64 = 1.0;

/// A period is constrained if at most this many modes hold at least that share of the draws.
const FEW: (usize, f64) = (3, 0.68);

/// A mode of the period.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PeriodMode {
    /// Share of the draws.
    pub weight: f64,
    /// Median of `Porb/Prot` within it.
    pub porb_over_prot: f64,
    /// 16 % and 84 % quantiles within it.
    pub ci68: [f64; 2],
    /// Median semi-amplitude (km/s) within it.
    pub k_kms: f64,
    /// The period of the star, or alias of one, from which it is not distinguished.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rotation: Option<String>,
}

/// The modes of draws (`Porb/Prot`, K), largest weight first, with the periods of the star that they are close to.
pub fn period_modes(draws: &[(f64, f64)], rotation: &RotationPeriods, rotation_period_d: f64) -> Vec<PeriodMode> {
    let mut modes = parted(draws, rotation.time_base_cycles);
    for mode in modes.iter_mut().filter(|mode| !mode.is_broad(rotation)) {
        let sigma = 0.5 * (mode.ci68[1] - mode.ci68[0]);
        let imitation = rotation.imitated(mode.porb_over_prot, Some(sigma));
        mode.rotation = imitation.map(|imitation| imitation.words(rotation_period_d));
    }
    modes
}

/// Whether a few narrow modes hold most of the draws.
pub fn are_few(modes: &[PeriodMode], rotation: &RotationPeriods) -> bool {
    let narrow = modes.iter().filter(|mode| !mode.is_broad(rotation));
    // a single mode as wide as the prior does not count
    modes.len() > 1 && narrow.take(FEW.0).map(|mode| mode.weight).sum::<f64>() >= FEW.1
}

/// Caveats of a planet of that period: the period is ambiguous, or is one of the star's.
pub fn doubts(modes: &[PeriodMode]) -> Vec<Remark> {
    let Some(heaviest) = modes.first() else { return Vec::new() };
    let of_the_star = heaviest.rotation.as_ref().map(|words| {
        let text = format!("The period {words}: degenerate with spot modulation.");
        Remark::against(format!("P {words}"), text)
    });
    let share = 100.0 * heaviest.weight;
    let rivals = (heaviest.weight < UNAMBIGUOUS).then(|| {
        let text = format!("Period ambiguous: the main mode holds {share:.0} % of the posterior.");
        Remark::note(text)
    });
    of_the_star.into_iter().chain(rivals).collect()
}

/// The modes as shares of the posterior.
pub fn shares(modes: &[PeriodMode], rotation_period_d: f64) -> Vec<PeriodShare> {
    let of = |mode: &PeriodMode| PeriodShare { period_d: rotation_period_d * mode.porb_over_prot, share: mode.weight };
    modes.iter().map(of).collect()
}

impl PeriodMode {
    fn is_broad(&self, rotation: &RotationPeriods) -> bool {
        let [low, high] = self.ci68;
        (1.0 / low - 1.0 / high) * rotation.time_base_cycles > BROAD
    }
}

/// The modes over a time base in rotations.
fn parted(draws: &[(f64, f64)], time_base_cycles: f64) -> Vec<PeriodMode> {
    let mut draws: Vec<(f64, f64)> = draws.iter().map(|(ratio, k)| (1.0 / ratio, *k)).collect();
    draws.retain(|draw| draw.0.is_finite());
    draws.sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
    let (Some(first), Some(last)) = (draws.first(), draws.last()) else { return Vec::new() };
    let width = SMOOTHING / time_base_cycles;
    let bin = (width / FINENESS).max((last.0 - first.0) / MOST_BINS);
    let place = |frequency: f64| ((frequency - first.0) / bin) as usize;
    let mut density = vec![0.0; place(last.0) + 1];
    draws.iter().for_each(|draw| density[place(draw.0)] += 1.0);
    let edges = cuts(&smoothed(&density, width / bin));
    let of = |(low, high): (usize, usize)| {
        let inside: Vec<(f64, f64)> = draws.iter().filter(|d| (low..high).contains(&place(d.0))).copied().collect();
        let weight = inside.len() as f64 / draws.len() as f64;
        (weight >= LEAST).then(|| mode(weight, &inside))
    };
    let mut modes: Vec<PeriodMode> = edges.windows(2).filter_map(|pair| of((pair[0], pair[1]))).collect();
    modes.sort_by(|a, b| b.weight.total_cmp(&a.weight));
    modes
}

fn mode(weight: f64, inside: &[(f64, f64)]) -> PeriodMode {
    let sorted = |of: &dyn Fn(&(f64, f64)) -> f64| {
        let mut values: Vec<f64> = inside.iter().map(of).collect();
        values.sort_unstable_by(f64::total_cmp);
        values
    };
    let ratios = sorted(&|draw| 1.0 / draw.0);
    let [low, middle, high] = [0.16, 0.5, 0.84].map(|p| quantile(&ratios, p));
    let k_kms = quantile(&sorted(&|draw| draw.1), 0.5);
    PeriodMode { weight, porb_over_prot: middle, ci68: [low, high], k_kms, rotation: None }
}

/// Convolved with a Gaussian of that many bins.
fn smoothed(density: &[f64], bandwidth: f64) -> Vec<f64> {
    let reach = (4.0 * bandwidth).ceil() as usize;
    let kernel: Vec<f64> = (0..=reach).map(|i| (-0.5 * (i as f64 / bandwidth).powi(2)).exp()).collect();
    let mut smooth = vec![0.0; density.len()];
    for (i, height) in density.iter().enumerate().filter(|(_, height)| **height > 0.0) {
        for (j, smooth) in smooth.iter_mut().enumerate().take(i + reach + 1).skip(i.saturating_sub(reach)) {
            *smooth += height * kernel[i.abs_diff(j)];
        }
    }
    smooth
}

/// Where one mode ends and the next begins, with both ends of all.
fn cuts(density: &[f64]) -> Vec<usize> {
    let mut cuts = vec![0];
    let (mut peak, mut valley) = (0.0f64, (0, f64::INFINITY));
    for (i, height) in density.iter().enumerate() {
        if *height < valley.1 {
            valley = (i, *height);
        }
        if *height > peak && valley.1 >= VALLEY * peak {
            // still the same mode, growing
            (peak, valley) = (*height, (i, *height));
        } else if valley.1 < VALLEY * peak.min(*height) {
            cuts.push(valley.0);
            (peak, valley) = (*height, (i, *height));
        }
    }
    cuts.push(density.len());
    cuts
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Draws evenly over a narrow peak of frequency.
    fn peak(frequency: f64, width: f64, count: usize, k_kms: f64) -> impl Iterator<Item = (f64, f64)> {
        let at = move |i: usize| frequency + width * ((i as f64 + 0.5) / count as f64 - 0.5);
        (0..count).map(move |i| (1.0 / at(i), k_kms))
    }

    #[test]
    fn modes_come_with_their_weight() {
        let draws: Vec<(f64, f64)> =
            peak(0.5, 0.005, 700, 0.2).chain(peak(1.37, 0.01, 290, 0.1)).chain(peak(3.0, 0.001, 10, 1.0)).collect();
        let modes = parted(&draws, 36.0);
        assert_eq!(modes.len(), 2, "{modes:?}");
        assert!((modes[0].weight - 0.7).abs() < 1e-12 && (modes[1].weight - 0.29).abs() < 1e-12, "{modes:?}");
        assert!((modes[0].porb_over_prot - 2.0).abs() < 1e-3 && modes[0].k_kms == 0.2, "{modes:?}");
        assert!(modes[0].ci68[0] < 2.0 && modes[0].ci68[1] > 2.0 && modes[0].ci68[1] < 2.02, "{modes:?}");
    }

    #[test]
    fn one_broad_peak_is_one_mode() {
        let draws: Vec<(f64, f64)> = peak(0.6, 0.1, 5000, 0.1).collect();
        assert_eq!(parted(&draws, 3.0).len(), 1);
        assert!(parted(&[], 3.0).is_empty());
    }
}
