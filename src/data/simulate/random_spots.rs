//! Spots drawn at random: static, or emerging and decaying.

use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Stream of the random numbers, apart from those of times and noise.
const STREAM: u64 = 4;

/// Spots drawn at random, beside those that are listed. Their places are even over the part of the star that is ever
/// seen.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct RandomSpots {
    /// Mean number of spots on the star at a time, 1 to 10,000; exact for static spots.
    pub number: usize,
    /// Lifetime (d), above 0: full width at half maximum of the area of a spot, which grows linearly and falls again
    /// over twice as long. Spots emerge evenly in time. Null for static spots.
    pub lifetime_d: Option<f64>,
    /// Smallest and largest radius (degrees), at the time of the largest area.
    pub radius_deg: [f64; 2],
    /// Smallest and largest filling factor.
    pub filling: [f64; 2],
    /// Lowest and highest latitude; all that are ever seen, if null.
    pub latitude_deg: Option<[f64; 2]>,
    /// Seed of all this.
    pub seed: u64,
}

impl Default for RandomSpots {
    fn default() -> Self {
        RandomSpots {
            number: 12,
            lifetime_d: None,
            radius_deg: [5.0, 17.0],
            filling: [0.5, 0.92],
            latitude_deg: None,
            seed: 1,
        }
    }
}

impl RandomSpots {
    /// The number drawn for data that cover `time_base_d`: the emergence rate gives `number` at a time, from a lifetime
    /// before the data to one after them.
    pub fn count(&self, time_base_d: f64) -> f64 {
        let number = self.number as f64;
        self.lifetime_d.map_or(number, |lifetime| (number * (0.5 * time_base_d / lifetime + 1.0)).round())
    }

    /// The spots as a config lists them, on a star of that inclination (degrees) and for data that begin and end at
    /// these times (d). Numbers are rounded, so that listing them gives the same star.
    pub fn drawn(&self, inclination_deg: f64, [first_d, last_d]: [f64; 2]) -> Vec<Vec<f64>> {
        let mut rng = ChaCha8Rng::seed_from_u64(self.seed);
        rng.set_stream(STREAM);
        let [lowest, highest] = self.latitude_deg.unwrap_or([-inclination_deg, 90.0]).map(|b| b.to_radians().sin());
        let mut between = |low: f64, high: f64| low + (high - low) * rng.random::<f64>();
        let rounded = |x: f64| (1e4 * x).round() / 1e4;
        let mut spot = || {
            let longitude = between(0.0, 360.0);
            let latitude = between(lowest, highest).clamp(-1.0, 1.0).asin().to_degrees();
            let [radius, filling] = [self.radius_deg, self.filling].map(|[low, high]| between(low, high));
            // drawn in any case: the lifetime does not change the rest
            let when = between(0.0, 1.0);
            let mut numbers = [longitude, latitude, radius, filling].map(rounded).to_vec();
            if let Some(lifetime) = self.lifetime_d {
                let (begin, end) = (first_d - lifetime, last_d + lifetime);
                numbers.extend([rounded(begin + when * (end - begin)), lifetime]);
            }
            numbers
        };
        (0..self.count(last_d - first_d) as usize).map(|_| spot()).collect()
    }
}
