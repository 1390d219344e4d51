//! Star and data: the [`Imager`] of every surface model; for maximum entropy, the misfit of a map to observed profiles,
//! and the Doppler image.
//!
//! A map holds spot filling factors s, which give the brightness `B = 1 - (1 - c) s`, or B itself; the model is `D =
//! line(B) / continuum(B)` (`docs/method.md` section 1). Its second derivative is included, so that the solver's Newton
//! steps are exact.

mod data;
mod drift;
mod problem;
mod profile;

use crate::maxent::entropy::Entropy;
use crate::planets::periodogram::offset::Common;
use crate::star::observation::{NIGHT_GAP_D, Observations, nights};
use crate::star::{
    Brightness, Nearby, OwnMap, Quadrature, Response, Sampling, Seen, StarSettings, StarState, SurfaceGrid,
};
use crate::surface::indicator::Indicator;
use crate::surface::nuisances::{LineAndContinuum, Nuisances};
use crate::surface::photometry::LightCurve;

use nalgebra::DVector;

pub use data::Data;
pub use drift::Drift;
pub use problem::ImagingProblem;

/// Gaussian prior of the RV offset of a data set, around the value at which it is held.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ZeroPointPrior {
    /// The data set.
    pub set: usize,
    /// Mean (km/s).
    pub mean_kms: f64,
    /// Standard deviation (km/s).
    pub sd_kms: f64,
}

impl ZeroPointPrior {
    /// The value at which the offset is held (km/s): its prior is centred on 0.
    pub fn held_kms(&self) -> f64 {
        -self.mean_kms
    }
}

/// All that is fixed while parameters are varied: the star's surface and settings, times, and data.
#[derive(Clone, Debug)]
pub struct Imager {
    /// Pixels of a map.
    pub grid: SurfaceGrid,
    /// Area of each pixel of all static maps, season by season, as a fraction of them; usually there is one season, and
    /// this is `grid.area`. Evolving maps have no seasons.
    pub areas: Vec<f64>,
    /// The star, except for the parameters.
    pub star: StarSettings,
    /// The data sets, whose profiles follow each other: times and velocity bins, and stellar properties specific to
    /// each.
    pub sets: Vec<Seen>,
    /// Observed depths and their weights.
    pub data: Data,
    /// Entropy of a map.
    pub entropy: Entropy,
    /// The data sets whose RV offsets are marginalised over; usually none.
    pub zero_points: Vec<ZeroPointPrior>,
    /// Light curves beside the profiles, used only by evolving maps; usually none.
    pub light_curves: Vec<LightCurve>,
    /// Activity indicators that depend on the spots, used only by evolving maps; usually none.
    pub indicators: Vec<Indicator>,
    /// Standard deviation of the error common to all profiles of a data set (continuum 1), used only by evolving maps;
    /// 0 for none.
    pub mean_profile: f64,
    /// RV jitter of each data set over that of the star; empty where all have the same. Used only by evolving maps.
    pub jitter_shares: Vec<f64>,
    /// Standard deviation of the RV offset that profiles of one night share (km/s), of each data set; empty where there
    /// is none. Used only by evolving maps.
    pub night_jitters_kms: Vec<Option<f64>>,
    /// Drifts of the velocities that are marginalised over, used only by evolving maps; usually none.
    pub drifts: Vec<Drift>,
}

impl Imager {
    /// For `observations` of `star`, on about `pixels` pixels, with maps of the given `entropy`.
    pub fn new(star: StarSettings, observations: &Observations, pixels: usize, entropy: Entropy) -> Self {
        let grid = SurfaceGrid::equal_area(pixels, Quadrature::Gauss2x2);
        Imager {
            areas: grid.area.clone(),
            grid,
            star,
            sets: vec![Sampling::of(observations).into()],
            data: Data::of(observations),
            entropy,
            zero_points: Vec::new(),
            light_curves: Vec::new(),
            indicators: Vec::new(),
            mean_profile: 0.0,
            jitter_shares: Vec::new(),
            night_jitters_kms: Vec::new(),
            drifts: Vec::new(),
        }
    }

    /// The same for several data sets, whose profiles follow each other in `observations`; the first one has the
    /// properties of `star`.
    pub fn of_sets(
        star: StarSettings,
        sets: Vec<Seen>,
        observations: &Observations,
        pixels: usize,
        entropy: Entropy,
    ) -> Self {
        Imager { sets, ..Imager::new(star, observations, pixels, entropy) }
    }

    /// The same with as many `maps`, one per season; `own_map` gives the map of each profile by its time (d).
    pub fn with_maps(mut self, maps: usize, own_map: impl Fn(f64) -> OwnMap) -> Self {
        let share = |area: &f64| area / maps as f64;
        self.areas = std::iter::repeat_n(&self.grid.area, maps).flatten().map(share).collect();
        for set in &mut self.sets {
            set.own_maps = set.sampling.profiles.iter().map(|profile| own_map(profile.0)).collect();
        }
        self
    }

    /// The same with one map of all seasons.
    pub fn with_one_map(mut self) -> Self {
        self.areas = self.grid.area.clone();
        self.sets.iter_mut().for_each(|set| set.own_maps.clear());
        self
    }

    /// Number of maps of the star, one per season.
    pub fn maps(&self) -> usize {
        self.areas.len() / self.grid.len()
    }

    /// Number of data for weights of the entropy: with several maps, whose entropy is a mean, that of the best observed
    /// season times the number of seasons. So no map gets more weight than it would alone.
    pub fn data_as_of_one_map(&self) -> f64 {
        let mut data = vec![0; self.maps()];
        for set in &self.sets {
            for (k, profile) in set.sampling.profiles.iter().enumerate() {
                data[set.own_maps.get(k).map_or(0, |own| own.number)] += profile.2;
            }
        }
        (data.len() * data.iter().max().copied().unwrap_or(0)) as f64
    }

    /// The index of each profile's map, from 0; empty where there is only one.
    pub fn map_of_each(&self) -> Vec<usize> {
        match self.maps() {
            1 => Vec::new(),
            _ => self.sets.iter().flat_map(|set| set.own_maps.iter().map(|own| own.number)).collect(),
        }
    }

    /// The same, marginalised over nuisances of every profile of `observations`, within priors of these standard
    /// deviations.
    pub fn with_nuisances(mut self, priors: LineAndContinuum, observations: &Observations) -> Self {
        self.data.nuisances = Nuisances::new(priors, observations);
        self
    }

    /// The same for several data sets, each with its own priors.
    pub fn with_nuisances_of(mut self, sets: &[(LineAndContinuum, &Observations)]) -> Self {
        self.data.nuisances = Nuisances::of_sets(sets);
        self
    }

    /// Shifts the expected velocities of the profiles of a data set by `kms` to the red.
    pub fn move_set(&mut self, set: usize, kms: f64) {
        self.sets[set].sampling.profiles.iter_mut().for_each(|profile| profile.1 -= kms);
    }

    /// Shifts the expected velocity of one profile by `kms` to the red.
    fn move_profile(&mut self, mut k: usize, kms: f64) {
        for set in &mut self.sets {
            let profiles = &mut set.sampling.profiles;
            if let Some(profile) = profiles.get_mut(k) {
                profile.1 -= kms;
                return;
            }
            k -= profiles.len();
        }
    }

    /// Holds an RV offset that is marginalised over farther to the red, by `kms`.
    pub fn move_zero_point(&mut self, z: usize, kms: f64) {
        self.move_set(self.zero_points[z].set, kms);
        self.zero_points[z].mean_kms -= kms;
    }

    /// The velocities to marginalise over beside those of profiles: RV offsets of data sets, and then the drift; for so
    /// many coordinates of an expansion, of which the velocities of all profiles come first.
    pub fn common_velocities(&self, coordinates: usize) -> Vec<Common> {
        let offset = |prior: &ZeroPointPrior| {
            let mut of_each = DVector::zeros(coordinates);
            self.profiles_of(prior.set).for_each(|k| of_each[k] = 1.0);
            Common { of_each, mean_kms: prior.mean_kms, sd_kms: prior.sd_kms }
        };
        let mut all: Vec<Common> = self.zero_points.iter().map(offset).collect();
        let times_d = self.times_d();
        for (drift, profiles) in self.drifts.iter().map(|drift| (drift, self.drifting(drift))) {
            let terms = (0..drift.terms()).map(|term| {
                let mut of_each = DVector::zeros(coordinates);
                profiles.iter().for_each(|k| of_each[*k] = drift.at(times_d[*k])[term]);
                Common { of_each, mean_kms: drift.mean_kms(term), sd_kms: drift.sd_kms() }
            });
            all.extend(terms);
        }
        all
    }

    /// Brightness of a spot relative to the photosphere in a data set.
    pub fn contrast_of(&self, set: usize) -> f64 {
        self.sets[set].contrast.unwrap_or(self.star.contrast)
    }

    /// RV jitter of each profile over that of the star.
    pub fn jitter_share_of_each(&self) -> Vec<f64> {
        let share = |set: usize| self.jitter_shares.get(set).copied().unwrap_or(1.0);
        self.sets.iter().enumerate().flat_map(|(s, set)| vec![share(s); set.sampling.profiles.len()]).collect()
    }

    /// The RV offsets of nights, of each data set whose profiles share some: of the size that is given for the set, or
    /// else of this one (km/s). For so many coordinates of an expansion, of which the velocities of all profiles come
    /// first.
    pub fn night_offsets(&self, coordinates: usize, unknown_kms: f64) -> Vec<Common> {
        let of_set = |(set, sd_kms): (usize, f64)| {
            self.nights_of(set).into_iter().map(move |night| {
                let mut of_each = DVector::zeros(coordinates);
                night.iter().for_each(|k| of_each[*k] = 1.0);
                Common { of_each, mean_kms: 0.0, sd_kms }
            })
        };
        self.offset_sets(unknown_kms).flat_map(of_set).collect()
    }

    /// The data sets with RV offsets of nights, and their size (km/s).
    fn offset_sets(&self, unknown_kms: f64) -> impl Iterator<Item = (usize, f64)> {
        let sizes = (0..self.sets.len()).map(move |set| (set, self.night_jitter_kms(set).unwrap_or(unknown_kms)));
        sizes.filter(|(_, sd_kms)| *sd_kms > 0.0)
    }

    /// The size of the RV offsets of nights (km/s) that is given for a data set.
    fn night_jitter_kms(&self, set: usize) -> Option<f64> {
        self.night_jitters_kms.get(set).copied().flatten()
    }

    /// The nights of a data set, by the indices of their profiles.
    fn nights_of(&self, set: usize) -> Vec<Vec<usize>> {
        let (times_d, profiles) = (self.times_d(), self.profiles_of(set));
        let first = profiles.start;
        let mut all = nights(&times_d[profiles], NIGHT_GAP_D);
        all.iter_mut().flatten().for_each(|k| *k += first);
        all
    }

    /// Nights of the data sets whose night offsets have an unknown size, by the indices of their profiles.
    pub fn nights_of_sets(&self) -> Vec<Vec<usize>> {
        (0..self.sets.len())
            .filter(|set| self.night_jitter_kms(*set).is_none())
            .flat_map(|set| self.nights_of(set))
            .collect()
    }

    /// The same with drifts of the velocities: one of all profiles whose offsets are known, and one of each data set
    /// whose offset is fitted, which cannot be distinguished from a drift of the star between sets.
    pub fn with_drifts(mut self, curved: bool) -> Self {
        let is_fitted = |set: &usize| self.zero_points.iter().any(|prior| prior.set == *set);
        let fitted = (0..self.sets.len()).filter(is_fitted).map(Some);
        let times_d = self.times_d();
        let of = |set: Option<usize>| {
            let profiles = self.profiles_with_offset(set);
            Drift::over(profiles.iter().map(|k| times_d[*k]), curved).map(|drift| Drift { set, ..drift })
        };
        self.drifts = std::iter::once(None).chain(fitted).filter_map(of).collect();
        self
    }

    /// Holds each drift at a slope (km/s/d): the expected velocities of profiles include it.
    pub fn hold_drifts(&mut self, kms_d: &[f64]) {
        let times_d = self.times_d();
        for (d, kms_d) in kms_d.iter().enumerate() {
            let (before, held) = (self.drifts[d], Drift { held_kms_d: *kms_d, ..self.drifts[d] });
            for k in self.drifting(&held) {
                self.move_profile(k, held.held_kms(times_d[k]) - before.held_kms(times_d[k]));
            }
            self.drifts[d] = held;
        }
    }

    /// The profiles of a drift.
    fn drifting(&self, drift: &Drift) -> Vec<usize> {
        self.profiles_with_offset(drift.set)
    }

    /// The profiles of the data set with this fitted offset; without one, all profiles whose offsets are known.
    fn profiles_with_offset(&self, set: Option<usize>) -> Vec<usize> {
        let is_known = |set: &usize| self.zero_points.iter().all(|prior| prior.set != *set);
        match set {
            Some(set) => self.profiles_of(set).collect(),
            None => (0..self.sets.len()).filter(is_known).flat_map(|set| self.profiles_of(set)).collect(),
        }
    }

    /// Whether there are such velocities.
    pub fn has_common_velocities(&self) -> bool {
        !self.zero_points.is_empty() || !self.drifts.is_empty()
    }

    /// Whether any velocities are marginalised over beside those of single profiles, with night offsets as there.
    pub fn has_shared_velocities(&self, unknown_kms: f64) -> bool {
        self.has_common_velocities() || self.offset_sets(unknown_kms).next().is_some()
    }

    /// Times (d) of all profiles, and then of all bins of light curves.
    pub fn times_of_all_d(&self) -> Vec<f64> {
        let of_bins = self.light_curves.iter().flat_map(|curve| &curve.bins).map(|bin| bin.time_d);
        self.times_d().into_iter().chain(of_bins).collect()
    }

    /// Number of each profile's data set, from 1; empty where there is only one.
    pub fn set_of_each(&self) -> Vec<usize> {
        let of_set = |(s, set): (usize, &Seen)| vec![s + 1; set.sampling.profiles.len()];
        match self.sets.len() {
            1 => Vec::new(),
            _ => self.sets.iter().enumerate().flat_map(of_set).collect(),
        }
    }

    /// The profiles of a data set.
    pub fn profiles_of(&self, set: usize) -> std::ops::Range<usize> {
        let count = |sets: &[Seen]| sets.iter().map(|set| set.sampling.profiles.len()).sum::<usize>();
        count(&self.sets[..set])..count(&self.sets[..=set])
    }

    /// The same of each data set.
    pub fn profiles_of_sets(&self) -> Vec<std::ops::Range<usize>> {
        (0..self.sets.len()).map(|set| self.profiles_of(set)).collect()
    }

    /// The same, marginalised over an RV jitter of every profile with this standard deviation (km/s), where the depths
    /// change with velocity by `slopes`; it replaces the previous jitter.
    pub fn with_zero_points(mut self, sd_kms: f64, slopes: &[f64]) -> Self {
        let sigma: Vec<f64> = self.data.inverse_variance.iter().map(|w| w.sqrt().recip()).collect();
        let nuisances = std::mem::take(&mut self.data.nuisances);
        self.data.nuisances = nuisances.with_zero_points(sd_kms, slopes, &self.bins(), &sigma);
        self
    }

    /// The same without some of the profiles.
    pub fn without(&self, profiles: &[usize]) -> Self {
        let mut first = 0;
        let mut sets = self.sets.clone();
        for set in &mut sets {
            let all = &mut set.sampling.profiles;
            let before = first;
            first += all.len();
            let mut k = before..first;
            all.retain(|_| k.next().is_some_and(|k| !profiles.contains(&k)));
            let mut k = before..first;
            set.own_maps.retain(|_| k.next().is_some_and(|k| !profiles.contains(&k)));
            let mut k = before..first;
            set.exposures.retain(|_| k.next().is_some_and(|k| !profiles.contains(&k)));
        }
        // a data set without profiles is dropped
        let mut zero_points = self.zero_points.clone();
        let is_left = |set: &Seen| !set.sampling.profiles.is_empty();
        zero_points.retain(|prior| is_left(&sets[prior.set]));
        let place = |set: usize| sets[..set].iter().filter(|set| is_left(set)).count();
        zero_points.iter_mut().for_each(|prior| prior.set = place(prior.set));
        let mut drifts = self.drifts.clone();
        drifts.retain(|drift| drift.set.is_none_or(|set| is_left(&sets[set])));
        drifts.iter_mut().for_each(|drift| drift.set = drift.set.map(place));
        fn of_left<T: Copy>(numbers: &[T], sets: &[Seen], is_left: impl Fn(&Seen) -> bool) -> Vec<T> {
            let kept = numbers.iter().zip(sets).filter(|(_, set)| is_left(set));
            kept.map(|(number, _)| *number).collect()
        }
        let jitter_shares = of_left(&self.jitter_shares, &sets, is_left);
        let night_jitters_kms = of_left(&self.night_jitters_kms, &sets, is_left);
        sets.retain(is_left);
        let kept = self.bins().into_iter().enumerate().filter(|(k, _)| !profiles.contains(k)).map(|(_, bins)| bins);
        Imager {
            sets,
            zero_points,
            jitter_shares,
            night_jitters_kms,
            drifts,
            data: self.data.of_profiles(&kept.collect::<Vec<_>>()),
            ..self.clone()
        }
    }

    /// The same with the uncertainties of each profile times its factor.
    pub fn with_larger_errors(&self, factors: &[f64]) -> Self {
        Imager { data: self.data.with_larger_errors(&self.bins(), factors), ..self.clone() }
    }

    /// The same for each season by itself.
    pub fn seasons(&self) -> Vec<Self> {
        let map_of = self.map_of_each();
        let of_season = |map: usize| {
            let others: Vec<usize> = (0..map_of.len()).filter(|k| map_of[*k] != map).collect();
            self.without(&others).with_one_map()
        };
        match self.maps() {
            1 => vec![self.clone()],
            maps => (0..maps).map(of_season).filter(|season| season.profiles().next().is_some()).collect(),
        }
    }

    /// For each profile: time (d), velocity of its first bin (km/s), number of bins.
    pub fn profiles(&self) -> impl Iterator<Item = (f64, f64, usize)> {
        self.sets.iter().flat_map(|set| set.sampling.profiles.iter().copied())
    }

    /// Number of times at which the star is observed.
    pub fn epochs(&self) -> usize {
        self.times_of_epochs().count()
    }

    /// Times (d) at which the star is observed: of profiles, bins of light curves, and readings of indicators.
    pub fn times_of_epochs(&self) -> impl Iterator<Item = f64> {
        let bins = self.light_curves.iter().flat_map(|curve| &curve.bins).map(|bin| bin.time_d);
        let readings = self.indicators.iter().flat_map(|indicator| &indicator.readings).map(|reading| reading.time_d);
        self.profiles().map(|profile| profile.0).chain(bins).chain(readings)
    }

    /// Times of all profiles (d).
    pub fn times_d(&self) -> Vec<f64> {
        self.profiles().map(|profile| profile.0).collect()
    }

    /// Bins of every profile within the data.
    fn bins(&self) -> Vec<std::ops::Range<usize>> {
        let mut end = 0;
        let next = |profile: (f64, f64, usize)| {
            end += profile.2;
            end - profile.2..end
        };
        self.profiles().map(next).collect()
    }

    /// The response at one state of star and planet.
    pub fn response(&self, state: &StarState) -> Response {
        Response::of_sets(&self.grid, &self.star, state, &self.sets)
    }

    /// What responses close to a state have in common.
    pub fn nearby(&self, state: &StarState) -> Nearby {
        Nearby::new(&self.grid, &self.star, state, &self.sets)
    }

    /// The response at a state, in half the time if it is close to another.
    pub fn response_near(&self, nearby: &Nearby, state: &StarState) -> Response {
        nearby.response(&self.grid, &self.star, state, &self.sets).unwrap_or_else(|| self.response(state))
    }

    /// `response` at a state that differs from its state by orbit and systemic velocity alone.
    pub fn with_velocities(&self, response: &Response, state: &StarState) -> Response {
        response.with_velocities(&self.star, state, &self.sets)
    }

    /// The misfit of maps seen through `response`.
    pub fn problem(&self, response: Response) -> ImagingProblem<'_> {
        let brightness = |k: usize| match self.entropy {
            Entropy::Spots { .. } => Brightness::of_spots(response.contrast(k)),
            Entropy::BrightAndDark => Brightness::ITSELF,
        };
        let brightness = (0..response.profiles()).map(brightness).collect();
        ImagingProblem::of_brightness(&self.areas, &self.data, response, brightness)
    }

    /// Rotation cycle of each profile.
    pub fn cycles(&self) -> Vec<f64> {
        self.profiles().map(|profile| self.star.cycle(profile.0)).collect()
    }

    /// Middle of the time base in rotation cycles.
    pub fn mid_cycle(&self) -> f64 {
        let (first, last) = self.span();
        0.5 * (first + last)
    }

    /// Length of the time base in rotation cycles.
    pub fn time_base_cycles(&self) -> f64 {
        let (first, last) = self.span();
        last - first
    }

    /// Length of the longest season in rotation cycles: the span over which rotation is constrained by one map.
    pub fn longest_season_cycles(&self) -> f64 {
        match self.maps() {
            1 => self.time_base_cycles(),
            _ => self.seasons().iter().map(Imager::time_base_cycles).fold(0.0, f64::max),
        }
    }

    /// First and last rotation cycle.
    fn span(&self) -> (f64, f64) {
        self.cycles().into_iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(lo, hi), e| (lo.min(e), hi.max(e)))
    }
}
