//! Observed (or simulated) line profiles: times, velocity bins, intensities and their errors.
//!
//! Left out: where they came from (see `io::lsd` and `simulate`), and what they are compared with.

/// One line profile on a uniform velocity axis.
#[derive(Clone, Debug, PartialEq)]
pub struct Profile {
    /// Time (d), on the same scale as the star's epoch.
    pub time_d: f64,
    /// Velocity of the centre of the first bin (km/s), after subtraction of the profile's own `VRAD`.
    pub first_velocity_kms: f64,
    /// Intensity in units of the continuum, one number a bin.
    pub intensity: Vec<f64>,
    /// Standard error of each intensity (positive).
    pub sigma: Vec<f64>,
}

/// A set of line profiles that share the width of their velocity bins.
#[derive(Clone, Debug, PartialEq)]
pub struct Observations {
    /// Width of a velocity bin (km/s).
    pub step_kms: f64,
    /// The profiles in the order of the list.
    pub profiles: Vec<Profile>,
}

impl Observations {
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

    /// The middle of the time base (d), half way between the first and the last profile.
    pub fn mid_time_d(&self) -> f64 {
        let (lo, hi) = self
            .profiles
            .iter()
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(lo, hi), p| (lo.min(p.time_d), hi.max(p.time_d)));
        0.5 * (lo + hi)
    }

    /// Mean area of the line `sum (1 - I) dv` over all profiles (km/s): the equivalent width of a line that the velocity
    /// range holds whole, whatever the spots, because every pixel's line has the same one (method section 1).
    pub fn mean_equivalent_width_kms(&self) -> f64 {
        let area = |p: &Profile| p.intensity.iter().map(|i| 1.0 - i).sum::<f64>() * self.step_kms;
        self.profiles.iter().map(area).sum::<f64>() / self.profiles.len() as f64
    }
}

impl Profile {
    /// Velocity of bin `j` (km/s).
    pub fn velocity_kms(&self, j: usize, step_kms: f64) -> f64 {
        self.first_velocity_kms + j as f64 * step_kms
    }
}
