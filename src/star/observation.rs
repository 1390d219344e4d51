//! Observed (or simulated) line profiles: times, velocity bins, intensities and their uncertainties.
//!
//! Also their areas and first-moment velocities.

/// One line profile on a uniform velocity axis.
#[derive(Clone, Debug, PartialEq)]
pub struct Profile {
    /// Time (d), on the same scale as the star's epoch.
    pub time_d: f64,
    /// Velocity of the centre of the first bin (km/s), after subtraction of the profile's own `VRAD`.
    pub first_velocity_kms: f64,
    /// Width of a velocity bin (km/s).
    pub step_kms: f64,
    /// Intensity in units of the continuum, one number per bin.
    pub intensity: Vec<f64>,
    /// Standard error of each intensity (positive).
    pub sigma: Vec<f64>,
    /// Length of the exposure (s), if known.
    pub exposure_s: Option<f64>,
}

/// A radial velocity with its standard error.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RadialVelocity {
    /// Velocity (km/s, positive receding).
    pub value_kms: f64,
    /// Standard error (km/s).
    pub sigma_kms: f64,
}

/// Line profiles.
#[derive(Clone, Debug, PartialEq)]
pub struct Observations {
    /// The profiles in the order of the list; those of several data sets one set after the other.
    pub profiles: Vec<Profile>,
}

impl Observations {
    /// Whether these are valid profiles of a star: at least two, in bins of one positive width, with as many
    /// uncertainties as intensities, all finite and the uncertainties positive.
    ///
    /// # Errors
    /// The first fault, in words.
    pub fn check(&self) -> Result<(), String> {
        if self.profiles.len() < 2 {
            return Err(format!(
                "{} profile: at least two are needed to separate spots from a planet",
                self.profiles.len()
            ));
        }
        let step = self.step_kms();
        if !(step > 0.0 && step.is_finite()) {
            return Err(format!("velocity bins of {step} km/s: must be above 0"));
        }
        for (k, profile) in self.profiles.iter().enumerate() {
            let Profile { time_d, first_velocity_kms, step_kms, intensity, sigma, exposure_s } = profile;
            let problem = match (intensity.len(), sigma.len()) {
                (0, _) => "has no bin".to_owned(),
                _ if *step_kms != step => format!("has bins of {step_kms} km/s, and the first profile of {step}"),
                (bins, errors) if bins != errors => format!("has {bins} intensities and {errors} errors"),
                _ if !(time_d.is_finite() && first_velocity_kms.is_finite()) => {
                    format!("is at {time_d} d and begins at {first_velocity_kms} km/s: must be finite")
                }
                _ if exposure_s.is_some_and(|s| !(s >= 0.0 && s.is_finite())) => {
                    format!("has an exposure of {} s: must be 0 or more", exposure_s.unwrap_or_default())
                }
                _ => match intensity.iter().zip(sigma).position(|(i, s)| !(i.is_finite() && s.is_finite() && *s > 0.0))
                {
                    Some(j) => format!("bin {j}: {} +- {}: must be finite, the error above 0", intensity[j], sigma[j]),
                    None => continue,
                },
            };
            return Err(format!("profile {k} {problem}"));
        }
        Ok(())
    }

    /// Those of several data sets, one after the other.
    pub fn joined(parts: Vec<Observations>) -> Self {
        Observations { profiles: parts.into_iter().flat_map(|part| part.profiles).collect() }
    }

    /// Width of the bins of the first profile (km/s), which all profiles of a data set share; NaN where there is none.
    pub fn step_kms(&self) -> f64 {
        self.profiles.first().map_or(f64::NAN, |profile| profile.step_kms)
    }

    /// Number of data (bins of all profiles together).
    pub fn len(&self) -> usize {
        self.profiles.iter().map(|p| p.intensity.len()).sum()
    }

    /// Whether there is no datum at all.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Times of all profiles (d).
    pub fn times_d(&self) -> Vec<f64> {
        self.profiles.iter().map(|p| p.time_d).collect()
    }

    /// First and last time (d); `None` where there is no profile.
    pub fn time_span_d(&self) -> Option<[f64; 2]> {
        let span = |span: Option<[f64; 2]>, profile: &Profile| {
            let [first, last] = span.unwrap_or([profile.time_d; 2]);
            Some([first.min(profile.time_d), last.max(profile.time_d)])
        };
        self.profiles.iter().fold(None, span)
    }

    /// Radial velocity of every profile by its first moment, see [`Profile::first_moment`].
    pub fn first_moments(&self) -> Vec<RadialVelocity> {
        self.profiles.iter().map(|p| p.first_moment()).collect()
    }

    /// The same divided by a continuum of `level`.
    pub fn over_continuum(mut self, level: f64) -> Self {
        for profile in &mut self.profiles {
            profile.intensity.iter_mut().chain(&mut profile.sigma).for_each(|x| *x /= level);
        }
        self
    }

    /// Mean area of the line `sum (1 - I) dv` over all profiles (km/s): the equivalent width of a line that is entirely
    /// within the velocity range, whatever the spots, because every pixel's line has the same one (`docs/method.md`
    /// section 1).
    pub fn mean_equivalent_width_kms(&self) -> f64 {
        let area = |p: &Profile| p.intensity.iter().map(|i| 1.0 - i).sum::<f64>() * p.step_kms;
        self.profiles.iter().map(area).sum::<f64>() / self.profiles.len() as f64
    }
}

impl Profile {
    /// Velocity of bin `j` (km/s).
    pub fn velocity_kms(&self, j: usize) -> f64 {
        self.first_velocity_kms + j as f64 * self.step_kms
    }

    /// Intensity (linear between bins) at a velocity (km/s) within the profile, which has at least two bins.
    pub fn intensity_at(&self, velocity_kms: f64) -> f64 {
        let position = (velocity_kms - self.first_velocity_kms) / self.step_kms;
        let below = (position.floor().max(0.0) as usize).min(self.intensity.len() - 2);
        let part = (position - below as f64).clamp(0.0, 1.0);
        // rounding of VRAD does not mix neighbours
        let part = if part < 1e-6 { 0.0 } else { part };
        self.intensity[below] + part * (self.intensity[below + 1] - self.intensity[below])
    }

    /// Radial velocity `sum v (1-I) / sum (1-I)` over all bins, and its uncertainty from those of the bins, `sqrt(sum
    /// sigma^2 (v - RV)^2) / |sum (1-I)|`. Not finite where the profile has no area.
    pub fn first_moment(&self) -> RadialVelocity {
        let depth: Vec<f64> = self.intensity.iter().map(|i| 1.0 - i).collect();
        let value_kms = self.first_moment_of(&depth);
        let arm = |(j, sigma): (usize, &f64)| (sigma * (self.velocity_kms(j) - value_kms)).powi(2);
        let variance: f64 = self.sigma.iter().enumerate().map(arm).sum();
        RadialVelocity { value_kms, sigma_kms: variance.sqrt() / depth.iter().sum::<f64>().abs() }
    }

    /// First moment (km/s) of other depths `1 - I`, such as a model's, in the bins of this profile.
    pub fn first_moment_of(&self, depth: &[f64]) -> f64 {
        let moment = |(j, depth): (usize, &f64)| self.velocity_kms(j) * depth;
        depth.iter().enumerate().map(moment).sum::<f64>() / depth.iter().sum::<f64>()
    }
}

/// Profiles further apart than this (d) belong to different nights.
pub const NIGHT_GAP_D: f64 = 0.3;

/// Profiles night by night, in order of time; nights are more than `gap_d` apart.
pub fn nights(times_d: &[f64], gap_d: f64) -> Vec<Vec<usize>> {
    let mut order: Vec<usize> = (0..times_d.len()).collect();
    order.sort_by(|a, b| times_d[*a].total_cmp(&times_d[*b]));
    order.chunk_by(|a, b| times_d[*b] - times_d[*a] <= gap_d).map(<[usize]>::to_vec).collect()
}
