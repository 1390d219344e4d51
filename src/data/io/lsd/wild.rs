//! Outlying bins: those that deviate from their neighbours more than any line does in bins of this width, and by far
//! more than the same bin of other profiles. Cosmic rays cause them, and no map fits them.

use crate::numerics::quantile::quantile;
use crate::star::observation::Profile;

/// A bin is outlying if it deviates by this many standard errors, and by this many times the deviations of others of
/// its profile and of the same bin in other profiles.
const FAR: f64 = 15.0;

/// Weights of four neighbours in the cubic interpolation at the middle.
const CUBIC: [(isize, f64); 4] = [(-2, -1.0 / 6.0), (-1, 2.0 / 3.0), (1, 2.0 / 3.0), (2, -1.0 / 6.0)];

/// Fewest profiles for the typical deviation.
const FEWEST: usize = 3;

/// The most outlying bin of a profile.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Wild {
    pub profile: usize,
    pub bin: usize,
    /// Its deviation from its neighbours in standard errors.
    pub errors: f64,
}

/// The most outlying bin of each profile that has some.
pub(super) fn bins(profiles: &[Profile]) -> Vec<Wild> {
    let Some(reference) = profiles.first().filter(|_| profiles.len() >= FEWEST) else { return Vec::new() };
    let place = |p: &Profile| ((p.first_velocity_kms - reference.first_velocity_kms) / p.step_kms).round() as isize;
    let places: Vec<isize> = profiles.iter().map(place).collect();
    let away: Vec<Vec<f64>> = profiles.iter().map(away).collect();
    let usual = |at: isize| {
        let there: Vec<f64> = places
            .iter()
            .zip(&away)
            .filter_map(|(place, of)| of.get(usize::try_from(at - place).ok()?).copied())
            .collect();
        let middle = median(there.clone());
        (middle, median(there.into_iter().map(|x| (x - middle).abs()).collect()))
    };
    let mut found = Vec::new();
    for (k, (profile, of)) in profiles.iter().zip(&away).enumerate() {
        let usual: Vec<(f64, f64)> = (0..of.len()).map(|j| usual(places[k] + j as isize)).collect();
        let from_usual: Vec<f64> = of.iter().zip(&usual).map(|(x, (middle, _))| (x - middle).abs()).collect();
        let of_profile = median(from_usual.clone());
        let size = |j: &usize| from_usual[*j] / profile.sigma[*j].max(of_profile).max(usual[*j].1);
        let wild = (0..of.len()).filter(|j| size(j) > FAR);
        // its neighbours deviate as well, by less
        if let Some(bin) = wild.max_by(|a, b| from_usual[*a].total_cmp(&from_usual[*b])) {
            found.push(Wild { profile: k, bin, errors: from_usual[bin] / profile.sigma[bin] });
        }
    }
    found
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    quantile(&values, 0.5)
}

/// Deviation of each bin from the cubic through its neighbours; 0 where there are not enough.
fn away(profile: &Profile) -> Vec<f64> {
    let at = |j: usize, by: isize| Some(*profile.intensity.get(j.checked_add_signed(by)?)?);
    let cubic = |j: usize| CUBIC.iter().map(|(by, weight)| Some(weight * at(j, *by)?)).sum::<Option<f64>>();
    (0..profile.intensity.len()).map(|j| cubic(j).map_or(0.0, |due| profile.intensity[j] - due)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_bin_is_wild_and_no_spot_is() {
        let profile = |k: usize| {
            let spot = move |v: f64| 0.05 * (-((v - 8.0 * k as f64 + 24.0) / 4.0).powi(2)).exp();
            let line = |v: f64| 1.0 - if v.abs() < 30.0 { 0.4 * (1.0 - (v / 30.0).powi(2)).sqrt() } else { 0.0 };
            let noise = |j: usize| 1e-3 * ((j * j * 37 + k * 11) as f64).sin();
            let intensity = (0..61).map(|j| line(2.0 * j as f64 - 60.0) + spot(2.0 * j as f64 - 60.0) + noise(j));
            Profile {
                time_d: k as f64,
                first_velocity_kms: -60.0,
                step_kms: 2.0,
                intensity: intensity.collect(),
                sigma: vec![1e-3; 61],
                exposure_s: None,
            }
        };
        let mut profiles: Vec<Profile> = (0..7).map(profile).collect();
        assert_eq!(bins(&profiles), []);
        profiles[4].intensity[33] += 0.05;
        let [Wild { profile: 4, bin: 33, errors }] = bins(&profiles)[..] else { panic!("{:?}", bins(&profiles)) };
        assert!((errors - 50.0).abs() < 5.0, "{errors}");
    }
}
