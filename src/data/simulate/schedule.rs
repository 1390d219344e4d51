//! When a star is observed: nights, clouds, seasons.

use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

const HOURS_A_DAY: f64 = 24.0;

/// Stream of the random numbers, apart from those of spots and noise.
const STREAM: u64 = 3;

/// Times of the profiles drawn at random: nights of one season or several. The first night begins at `star.epoch_d`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Schedule {
    /// Nights of a season, one a day, 1 to 1000.
    pub nights: usize,
    /// Which nights of a season, by their numbers from 0 on and rising, in place of one a day: `[0, 1, 7, 8]`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub on_nights: Option<Vec<usize>>,
    /// Seasons, 1 to 100.
    pub seasons: usize,
    /// Days from the first night of a season to that of the next.
    pub season_spacing_d: f64,
    /// Fewest and most profiles of a night, all numbers in between as likely, 1 to 100.
    pub per_night: [usize; 2],
    /// Hours of a night over which its profiles are spread at random, above 0 and up to 24.
    pub night_hours: f64,
    /// Probability that a night is lost to clouds, from 0 and below 1.
    pub clouds: f64,
    /// Seed of all this.
    pub seed: u64,
}

impl Default for Schedule {
    fn default() -> Self {
        Schedule {
            nights: 15,
            on_nights: None,
            seasons: 1,
            season_spacing_d: 365.0,
            per_night: [2, 4],
            night_hours: 9.0,
            clouds: 0.0,
            seed: 1,
        }
    }
}

impl Schedule {
    /// Numbers of the nights of a season.
    pub fn of_season(&self) -> Vec<usize> {
        self.on_nights.clone().unwrap_or_else(|| (0..self.nights).collect())
    }

    /// The times (d) from the first night on, in order and to a second. None where clouds take all nights.
    pub fn times_d(&self, first_d: f64) -> Vec<f64> {
        self.times_within(first_d, &|begin_d| Some((begin_d, self.night_hours / HOURS_A_DAY)))
    }

    /// The same, with the profiles of the night that begins at a time (d) spread over its `window`: start (d) and
    /// length (d). No profiles are taken in a night without one.
    pub fn times_within(&self, first_d: f64, window: &dyn Fn(f64) -> Option<(f64, f64)>) -> Vec<f64> {
        let mut rng = ChaCha8Rng::seed_from_u64(self.seed);
        rng.set_stream(STREAM);
        let of_season = self.of_season();
        let nights = (0..self.seasons).flat_map(|season| of_season.iter().map(move |night| (season, *night)));
        let mut times = Vec::new();
        for (season, night) in nights {
            let begin_d = first_d + season as f64 * self.season_spacing_d + night as f64;
            let is_lost = rng.random::<f64>() < self.clouds;
            let profiles = rng.random_range(self.per_night[0]..=self.per_night[1]);
            let shares: Vec<f64> = (0..profiles).map(|_| rng.random::<f64>()).collect();
            // drawn in any case: clouds do not change the other nights
            if let Some((from, length)) = window(begin_d).filter(|_| !is_lost) {
                times.extend(shares.iter().map(|share| (1e5 * (from + length * share)).round() / 1e5));
            }
        }
        times.sort_by(f64::total_cmp);
        times
    }
}
