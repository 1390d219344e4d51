//! The blind search for a planet: from the image of the star without one to the periodogram, and from its best orbit to the
//! orbit that stays the best when the star is imaged with it.
//!
//! The periodogram and its false-alarm probability belong to the expansion around the planet-free image: a statistic that knows
//! nothing of the planet. That expansion is exact for small velocities only, so the best orbit is found again in an expansion
//! around the image that it implies, and so on until K stays. A second planet is searched for in the last expansion, where the
//! first is small. Left out: what is written (`io::periodogram`).

mod robustness;

pub use robustness::{AtTarget, Robustness, WithoutNight, robustness};

use crate::expansion::{Expansion, Nuisance, STELLAR};
use crate::imaging::Imager;
use crate::maxent::Termination;
use crate::objective::{Parameter, ParameterValues, Reference, ReferenceError};
use crate::periodogram::eccentric::keplerian;
use crate::periodogram::offset::{Offset, offset};
use crate::periodogram::peaks::refined;
use crate::periodogram::two_planets::{both, without};
use crate::periodogram::window::{Alias, alias, window_peaks};
use crate::periodogram::{
    CircularOrbit, DETECTION_FAP, Frequencies, KeplerianOrbit, Peak, Search, SearchSettings, TwoOrbits, Unbounded,
    co_rotation_penalty,
};
use crate::star::Orbit;
use crate::velocities::VelocityQuadratic;
use nalgebra::DVector;
use serde::{Deserialize, Serialize};

/// Expansions around the best orbit at most.
const MOST_ROUNDS: usize = 6;

/// K stays when it moves by less than this part of its error.
const STAYS: f64 = 0.01;

/// What to search for, and how.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct DetectionSettings {
    /// Target of chi2, per datum.
    pub chi2_target: f64,
    /// Parameters that are integrated out within their priors; the others are fixed.
    pub nuisances: Vec<Nuisance>,
    /// How peaks are judged.
    pub search: SearchSettings,
    /// Whether eccentric orbits are fitted.
    pub eccentric: bool,
    /// Whether a second planet is searched for.
    pub second_planet: bool,
}

/// A star's image and the quadratic in its profiles' velocities around it.
#[derive(Clone, Debug)]
pub struct View {
    /// The image.
    pub reference: Reference,
    /// ln L around it.
    pub expansion: Expansion,
    /// ln L of the orbit's velocities, counted from 0 whatever the orbit of the image; spots that the map leaves over count as
    /// noise.
    pub quadratic: VelocityQuadratic,
    /// The same with spots as the entropy sees them: the regularised likelihood itself.
    pub regularised: VelocityQuadratic,
    /// How many times larger than the entropy expects the spots left over are, in variance.
    pub spots_left: f64,
    /// Whether the image reaches the target chi2.
    pub on_target: bool,
}

/// The second planet.
#[derive(Clone, Debug)]
pub struct SecondPlanet {
    /// The search with the first orbit left free at its period.
    pub search: Search,
    /// Both orbits together; `None` where they have no maximum.
    pub both: Option<TwoOrbits>,
}

/// What a blind search found.
#[derive(Clone, Debug)]
pub struct Detection {
    /// The trial periods.
    pub frequencies: Frequencies,
    /// Without a planet; its quadratic is the one that `search` is of.
    pub planet_free: View,
    /// The blind search there, by which a planet is found or not. The planet itself counts among the spots left over, which
    /// makes the false-alarm probability a cautious one.
    pub blind: Search,
    /// The same search, where a planet is found, with spots left over as large as they are beside it.
    pub beside: Option<Search>,
    /// At the best orbit; `None` if it was not imaged, because its period lies on the edge of the search.
    pub at_best: Option<View>,
    /// Expansions that it took to get there.
    pub rounds: usize,
    /// Whether K stays.
    pub closed: bool,
    /// The best orbit, in the last expansion.
    pub best: Peak,
    /// Keplerian orbits around each peak of the search, if asked for: the first in the last expansion.
    pub keplerian: Vec<Option<KeplerianOrbit>>,
    /// The second planet, if asked for.
    pub second: Option<SecondPlanet>,
    /// A constant velocity left free beside the orbit, without a planet in the image.
    pub offset: Option<Offset>,
    /// sigma_K at Porb = Prot over its median away from it, without a planet.
    pub co_rotation_penalty: Option<f64>,
}

/// Why there is no detection, nor a limit.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum DetectionError {
    /// No image.
    #[error(transparent)]
    Reference(#[from] ReferenceError),
    /// No orbit at all.
    #[error(transparent)]
    Unbounded(#[from] Unbounded),
}

/// What is under way.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stage {
    /// The planet-free image and its expansion.
    PlanetFree,
    /// Periods, draws.
    Search,
    /// The image at the best orbit, for that many times.
    BestOrbit(usize),
    /// The second planet.
    SecondPlanet,
}

impl View {
    /// The star imaged at `values`. Where the target chi2 takes more than three times the entropy's weight over the number of data, the
    /// image stops short of it: beyond, noise is turned into spots.
    ///
    /// # Errors
    /// [`DetectionError`].
    pub fn new(imager: &Imager, values: ParameterValues, settings: &DetectionSettings) -> Result<Self, DetectionError> {
        let reference = Reference::provisional(imager, values, settings.chi2_target)?;
        let on_target = reference.solution.termination == Termination::Converged;
        let nuisances = &settings.nuisances;
        let stellar: Vec<Parameter> = nuisances.iter().map(|n| n.parameter).filter(|p| STELLAR.contains(p)).collect();
        let expansion = Expansion::of(imager, &reference, &stellar);
        let regularised = expansion.velocities(nuisances);
        let spots_left = expansion.spots_left(nuisances).ok_or(Unbounded)?;
        let quadratic = expansion.with_spots_left(spots_left).ok_or(Unbounded)?.velocities(nuisances);
        Ok(View { reference, expansion, quadratic, regularised, spots_left, on_target })
    }
}

impl Detection {
    /// Searches the star in `imager`, all but the orbit as in `values`, at the given periods.
    ///
    /// # Errors
    /// [`DetectionError`].
    pub fn find(
        imager: &Imager,
        values: ParameterValues,
        frequencies: Frequencies,
        settings: &DetectionSettings,
        report: &dyn Fn(Stage),
    ) -> Result<Self, DetectionError> {
        report(Stage::PlanetFree);
        let mut alone = values;
        alone[Parameter::K] = 0.0;
        let planet_free = View::new(imager, alone, settings)?;
        report(Stage::Search);
        let blind = Search::new(&planet_free.quadratic, &frequencies, settings.search)?;
        let best = blind.best().orbit.delta_ln_l;
        let offset = offset(&planet_free.quadratic, &frequencies.per_cycle, best);
        let mut found = Detection {
            best: *blind.best(),
            planet_free,
            blind,
            beside: None,
            frequencies,
            at_best: None,
            rounds: 0,
            closed: false,
            keplerian: Vec::new(),
            second: None,
            offset,
            co_rotation_penalty: None,
        };
        found.close(imager, values, settings, report)?;
        found.look_beside(settings)?;
        if settings.eccentric {
            found.keplerian = found.eccentric();
        }
        if settings.second_planet {
            report(Stage::SecondPlanet);
            found.second = found.second_planet(settings.search)?;
        }
        Ok(found)
    }

    /// The last expansion.
    pub fn last(&self) -> &View {
        self.at_best.as_ref().unwrap_or(&self.planet_free)
    }

    /// Delta ln L of the best orbit in the regularised likelihood.
    pub fn regularised_delta_ln_l(&self) -> f64 {
        let CircularOrbit { k_kms, phi, .. } = self.best.orbit;
        let orbit = Orbit { k_kms, porb_over_prot: self.best.porb_over_prot, phi };
        let regularised = &self.last().regularised;
        let velocities = DVector::from_iterator(regularised.len(), orbit.velocities_kms(&regularised.cycles));
        regularised.log_likelihood(&velocities)
    }

    /// Whether the blind search found a planet.
    pub fn is_planet(&self) -> bool {
        self.blind.false_alarm.probability(self.blind.best().orbit.delta_ln_l).value() < DETECTION_FAP
    }

    /// n, if the time base does not tell the best period from `Prot/n`, n up to 4.
    pub fn fraction_of_rotation(&self) -> Option<u32> {
        let frequency = 1.0 / self.best.porb_over_prot;
        (1..=4).find(|&n| (frequency - f64::from(n)).abs() * self.frequencies.time_base_cycles < 0.5)
    }

    /// n and the peak of the window function by which the best period is an alias of `Prot/n`, n up to 4: there spots imitate
    /// orbits as they do at the rotation period.
    pub fn alias_of_rotation(&self) -> Option<(u32, Alias)> {
        let window = window_peaks(&self.planet_free.quadratic.cycles, &self.frequencies);
        let base = self.frequencies.time_base_cycles;
        let alias = |n: u32| Some((n, alias(1.0 / self.best.porb_over_prot, f64::from(n), &window, base)?));
        (1..=4).find_map(alias)
    }

    /// The search that periods are judged by.
    pub fn search(&self) -> &Search {
        self.beside.as_ref().unwrap_or(&self.blind)
    }

    /// Where a planet is found: the search with spots left over as large as they are beside it. And what is said of co-rotation.
    fn look_beside(&mut self, settings: &DetectionSettings) -> Result<(), Unbounded> {
        if let Some(at_best) = self.at_best.as_ref().filter(|_| self.is_planet()) {
            let factor = at_best.spots_left.min(self.planet_free.spots_left);
            let expansion = self.planet_free.expansion.with_spots_left(factor).ok_or(Unbounded)?;
            self.planet_free.quadratic = expansion.velocities(&settings.nuisances);
            self.beside = Some(Search::new(&self.planet_free.quadratic, &self.frequencies, settings.search)?);
        }
        let rows = &self.search().rows;
        self.co_rotation_penalty = co_rotation_penalty(&self.planet_free.quadratic, &self.frequencies, rows);
        Ok(())
    }

    /// Images the star with the best orbit until that orbit stays.
    fn close(
        &mut self,
        imager: &Imager,
        mut values: ParameterValues,
        settings: &DetectionSettings,
        report: &dyn Fn(Stage),
    ) -> Result<(), DetectionError> {
        while self.rounds < MOST_ROUNDS && !self.closed && !self.best.on_edge {
            self.rounds += 1;
            report(Stage::BestOrbit(self.rounds));
            values[Parameter::K] = self.best.orbit.k_kms;
            values[Parameter::PorbOverProt] = self.best.porb_over_prot;
            values[Parameter::Phi] = self.best.orbit.phi;
            let view = View::new(imager, values, settings)?;
            let next = refined(&view.quadratic, &self.frequencies, &self.best);
            let moved = (next.orbit.k_kms - self.best.orbit.k_kms).abs();
            self.closed = moved < STAYS * next.orbit.sigma_k_kms;
            self.best = next;
            self.at_best = Some(view);
        }
        Ok(())
    }

    /// The Keplerian orbits of all peaks.
    fn eccentric(&self) -> Vec<Option<KeplerianOrbit>> {
        let others = self.search().peaks[1..].iter().map(|peak| (&self.planet_free, peak));
        let all = std::iter::once((self.last(), &self.best)).chain(others);
        all.map(|(view, peak)| keplerian(&view.quadratic, &self.frequencies, peak)).collect()
    }

    /// A search with the best orbit taken out; `None` where that leaves nothing.
    fn second_planet(&self, settings: SearchSettings) -> Result<Option<SecondPlanet>, Unbounded> {
        let quadratic = &self.last().quadratic;
        let Some(rest) = without(quadratic, 1.0 / self.best.porb_over_prot) else { return Ok(None) };
        let search = Search::new(&rest, &self.frequencies, settings)?;
        let both = both(quadratic, &self.frequencies, &self.best, search.best());
        Ok(Some(SecondPlanet { search, both }))
    }
}
