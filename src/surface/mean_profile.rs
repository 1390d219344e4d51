//! The error common to all profiles of a data set: a line or a continuum that differs slightly from the star's. Smooth
//! in velocity, of an unknown size, and marginalised over, so that no spots mimic it (`docs/method.md` section 9).
//!
//! It is a Gaussian process with squared-exponential covariance in the observer's velocities, represented by weights of
//! adjacent Gaussians. Data sets with one local line and limb darkening share most of it: it is the error of the model
//! of the star.

use super::imaging::Imager;
use crate::star::{Seen, StarSettings};
use nalgebra::DMatrix;

/// Correlation length (km/s); there are at most so many of them in the velocity range.
const LENGTH_KMS: f64 = 4.0;
const MOST: f64 = 24.0;

/// Height of the Gaussians for which the sum of their squares is 1: their spacing and width are a correlation length.
const HEIGHT: f64 = 0.8932;

/// Size of a data set's own error over that of all, where several have one local line and limb darkening. Assumed:
/// spectrographs differ by less than the model from the star. The size of all is fitted, so that sets that differ by
/// more make it larger; what they share then costs nothing but the velocity common to them. `results/newcomer.md` has
/// offsets of ten simulated stars.
const OWN: f64 = 0.3;

/// Widths of one line differ by less (km/s), by rounding.
const SAME_KMS: f64 = 1e-3;

/// Unit changes of the depths of each profile (bins, columns): for each group of data sets with one local line those
/// that they share, then those of each data set; for a data set alone only the latter.
pub fn columns(imager: &Imager) -> Vec<DMatrix<f64>> {
    of_sets(&imager.star, &imager.sets)
}

fn of_sets(star: &StarSettings, sets: &[Seen]) -> Vec<DMatrix<f64>> {
    let mut numbers = 0;
    let mut places: Vec<Option<Place>> = vec![None; sets.len()];
    for group in groups(star, sets) {
        let basis = Basis::of(group.iter().map(|&i| &sets[i]));
        let shared = (group.len() > 1).then_some(numbers);
        numbers += shared.map_or(0, |_| basis.count);
        for i in group {
            let blocks = match shared {
                Some(shared) => vec![(shared, (1.0 - OWN * OWN).sqrt()), (numbers, OWN)],
                None => vec![(numbers, 1.0)],
            };
            places[i] = Some(Place { basis, blocks });
            numbers += basis.count;
        }
    }
    let of_set = |(set, Place { basis, blocks }): (&Seen, Place)| {
        let of_profile = |&(_, velocity, bins): &(f64, f64, usize)| {
            let mut columns = DMatrix::zeros(bins, numbers);
            for j in 0..bins {
                let v = velocity + j as f64 * set.sampling.step_kms;
                for c in 0..basis.count {
                    blocks.iter().for_each(|(first, size)| columns[(j, first + c)] = size * basis.at(c, v));
                }
            }
            columns
        };
        set.sampling.profiles.iter().map(of_profile).collect::<Vec<_>>()
    };
    sets.iter().zip(places.into_iter().flatten()).flat_map(of_set).collect()
}

/// The columns of a data set.
#[derive(Clone)]
struct Place {
    basis: Basis,
    /// The first columns and sizes of the shared and of the separate error.
    blocks: Vec<(usize, f64)>,
}

/// Adjacent Gaussians.
#[derive(Clone, Copy)]
struct Basis {
    from_kms: f64,
    length_kms: f64,
    count: usize,
}

impl Basis {
    /// Over all velocities of these data sets.
    fn of<'a>(sets: impl Iterator<Item = &'a Seen>) -> Self {
        let ends = |range: (f64, f64), (step, (_, first, bins)): (f64, (f64, f64, usize))| {
            (range.0.min(first), range.1.max(first + bins as f64 * step))
        };
        let (from, to) = sets
            .flat_map(|set| set.sampling.profiles.iter().map(|profile| (set.sampling.step_kms, *profile)))
            .fold((f64::INFINITY, f64::NEG_INFINITY), ends);
        let length = LENGTH_KMS.max((to - from) / MOST);
        Basis { from_kms: from, length_kms: length, count: ((to - from) / length).ceil().max(1.0) as usize }
    }

    /// The one of this number at a velocity.
    fn at(&self, number: usize, velocity_kms: f64) -> f64 {
        let off = (velocity_kms - self.from_kms) / self.length_kms - (number as f64 + 0.5);
        HEIGHT * (-off * off).exp()
    }
}

/// The data sets that have one local line (but for the spectrograph) and limb darkening, group by group.
fn groups(star: &StarSettings, sets: &[Seen]) -> Vec<Vec<usize>> {
    let seen = |set: &Seen| {
        let line = set.line.unwrap_or(star.line);
        (set.limb_darkening.unwrap_or(star.limb_darkening), line.own_sigma_kms(), line.gamma_kms)
    };
    let alike = |a: &Seen, b: &Seen| {
        let (a, b) = (seen(a), seen(b));
        a.0 == b.0 && (a.1 - b.1).abs() < SAME_KMS && (a.2 - b.2).abs() < SAME_KMS
    };
    let mut groups: Vec<Vec<usize>> = Vec::new();
    for (i, set) in sets.iter().enumerate() {
        match groups.iter_mut().find(|group| alike(&sets[group[0]], set)) {
            Some(group) => group.push(i),
            None => groups.push(vec![i]),
        }
    }
    groups
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::star::{LimbDarkening, LocalLine, Regions, Sampling};

    fn star() -> StarSettings {
        StarSettings {
            rotation_period_d: 3.0,
            epoch_d: 0.0,
            limb_darkening: LimbDarkening::Linear(0.65),
            contrast: 0.1,
            line: LocalLine { instrumental_sigma_kms: 2.0, ..LocalLine::gaussian(3.5f64.hypot(2.0), 6.0) },
            regions: Regions::default(),
        }
    }

    /// Two profiles of 61 bins of 1 km/s.
    fn set(line: Option<LocalLine>) -> Seen {
        let sampling = Sampling { step_kms: 1.0, profiles: vec![(0.0, -30.0, 61), (1.0, -30.0, 61)] };
        Seen { line, ..sampling.into() }
    }

    /// The sum of the squares of adjacent Gaussians is 1 but for this.
    const RIPPLE: f64 = 0.02;

    /// Covariance of two profiles in the middle of the range.
    fn covariance(all: &[DMatrix<f64>], one: usize, other: usize) -> f64 {
        all[one].row(30).dot(&all[other].row(30))
    }

    #[test]
    fn a_set_alone_has_an_error_of_its_own() {
        let all = of_sets(&star(), &[set(None)]);
        assert_eq!((all.len(), all[0].shape()), (2, (61, 16)));
        assert_eq!(all[0], all[1]);
        assert!((covariance(&all, 0, 0) - 1.0).abs() < RIPPLE);
    }

    #[test]
    fn sets_share_the_error_of_one_line_and_no_other() {
        let other_spectrograph =
            LocalLine { instrumental_sigma_kms: 4.0, ..LocalLine::gaussian(3.5f64.hypot(4.0), 5.0) };
        let all = of_sets(&star(), &[set(None), set(Some(other_spectrograph))]);
        assert_eq!(all[0].ncols(), 3 * 16);
        let within = covariance(&all, 2, 3);
        assert!((within - 1.0).abs() < RIPPLE, "{within}");
        assert!((covariance(&all, 0, 2) - (1.0 - OWN * OWN) * within).abs() < 1e-12);

        let wider = LocalLine { instrumental_sigma_kms: 2.0, ..LocalLine::gaussian(4.0f64.hypot(2.0), 6.0) };
        let infrared = Seen { limb_darkening: Some(LimbDarkening::Linear(0.3)), ..set(None) };
        for apart in [set(Some(wider)), infrared] {
            let all = of_sets(&star(), &[set(None), apart]);
            assert_eq!(all[0].ncols(), 2 * 16);
            assert_eq!(covariance(&all, 0, 2), 0.0);
        }
    }
}
