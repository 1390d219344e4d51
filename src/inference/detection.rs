//! The blind search for a planet: from the image of the star without a planet to the periodogram, and from its best
//! orbit to the self-consistent orbit when the star is imaged with it.
//!
//! The periodogram and its false-alarm probability belong to the expansion around the planet-free image: a statistic
//! independent of the planet. That expansion is exact for small velocities only, so the best orbit is re-determined in
//! an expansion around the image made with it, and so on until K converges. A second planet is searched for in the last
//! expansion, where the first is small.
//!
//! Planets of known ephemeris belong to the star: every search includes them with K free. Where the first planet of a
//! config is one of them, the best orbit is its own.

mod known;
mod remarks;
mod robustness;

pub use known::{KnownPlanet, KnownPlanets};
pub use remarks::{Evidence, of_night_offsets};
pub use robustness::{HeldOut, Robustness, Tried, WithoutNight, robustness};

use crate::model::{Ephemeris, Parameter, ParameterValues};
use crate::planets::periodogram::eccentric::keplerian;
use crate::planets::periodogram::offset::{Offset, offset};
use crate::planets::periodogram::orbits;
use crate::planets::periodogram::peaks::refined;
use crate::planets::periodogram::two_planets::{both, without};
use crate::planets::periodogram::{
    CircularOrbit, Frequencies, Jitters, KeplerianOrbit, Peak, Search, SearchSettings, TwoOrbits, co_rotation_penalty,
};
use crate::planets::velocities::VelocityQuadratic;
use crate::planets::verdict::CANDIDATE_FAP;
use crate::star::Orbit;
use crate::surface::expansion::Nuisance;
use crate::surface::imaging::Imager;
use crate::surface::{
    At, Change, Constants, Linearised, NoFit, OtherRotation, SpotField, SurfaceError, SurfaceModel, SurfaceSettings,
    WithoutJitter,
};
use nalgebra::DVector;
use serde::{Deserialize, Serialize};

/// Largest number of expansions around the best orbit.
const MOST_ROUNDS: usize = 6;

/// K has converged when it moves by less than this fraction of its standard error.
const STAYS: f64 = 0.01;

/// What to search for, and how.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct DetectionSettings {
    /// The prior of the spots.
    pub surface: SurfaceSettings,
    /// Parameters that are marginalised over within their priors; the others are fixed.
    pub nuisances: Vec<Nuisance>,
    /// Planets whose periods and conjunctions are known.
    pub known: Vec<Ephemeris>,
    /// Settings of the false-alarm probability.
    pub search: SearchSettings,
    /// Whether eccentric orbits are fitted.
    pub eccentric: bool,
    /// Whether a second planet is searched for.
    pub second_planet: bool,
    /// Another rotation period with which the profiles are far more probable.
    pub other_rotation: Option<OtherRotation>,
}

impl DetectionSettings {
    /// The usual search: circular orbits, one planet.
    pub fn of(surface: SurfaceSettings, nuisances: Vec<Nuisance>) -> Self {
        DetectionSettings {
            surface,
            nuisances,
            known: Vec::new(),
            search: SearchSettings::default(),
            eccentric: false,
            second_planet: false,
            other_rotation: None,
        }
    }
}

/// The second planet.
#[derive(Clone, Debug)]
pub struct SecondPlanet {
    /// The search with the first orbit free at its period.
    pub search: Search,
    /// Both orbits together; `None` where they have no maximum.
    pub both: Option<TwoOrbits>,
}

/// What a blind search found.
#[derive(Clone, Debug)]
pub struct Detection {
    /// The trial periods.
    pub frequencies: Frequencies,
    /// Whether the spots evolve, where a static map is assumed and this was tested.
    pub change: Option<Result<Change, NoFit>>,
    /// Another rotation period with which the profiles are far more probable.
    pub other_rotation: Option<OtherRotation>,
    /// Planets of known ephemeris.
    pub known: KnownPlanets,
    /// The likelihood of the velocities of the star without these; `None` where there are none.
    alone: Option<Alone>,
    /// The star with only those planets.
    pub planet_free: Linearised,
    /// The same without its jitter, where the jitter is fitted: the star of `blind`.
    pub without_jitter: Option<WithoutJitter>,
    /// The blind search there, on which the verdict is based. The planet itself contributes to the unresolved-spot
    /// noise, which makes the false-alarm probability conservative.
    pub blind: Search,
    /// At the best orbit; `None` if it was not imaged, because its period lies on the edge of the search.
    pub at_best: Option<Linearised>,
    /// Number of expansions.
    pub rounds: usize,
    /// Whether K has converged.
    pub closed: bool,
    /// The best orbit, in the last expansion.
    pub best: Peak,
    /// Keplerian orbits around each peak of the search, if requested: the first in the last expansion.
    pub keplerian: Vec<Option<KeplerianOrbit>>,
    /// The second planet, if requested.
    pub second: Option<SecondPlanet>,
    /// A constant velocity fitted with the orbit, without a planet in the image.
    pub offset: Option<Offset>,
    /// sigma_K at Porb = Prot over its median away from it, without a planet.
    pub co_rotation_penalty: Option<f64>,
}

/// The step in progress.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stage {
    /// The planet-free image and its expansion.
    PlanetFree,
    /// The same with the planets of known ephemeris.
    Known,
    /// Whether the spots evolve.
    Change,
    /// Periods, draws.
    Search,
    /// The image at the best orbit, with the count of images so far.
    BestOrbit(usize),
    /// The second planet.
    SecondPlanet,
}

/// A search with the periods at which these spots mimic orbits.
fn imitated(surface: &dyn SurfaceModel, search: Search) -> Search {
    if surface.imitates_at_fractions() { search } else { search.without_multiples() }
}

/// Delta ln L of the best orbit at the trial periods.
fn highest(quadratic: &VelocityQuadratic, frequencies: &Frequencies) -> f64 {
    let trials = orbits::scan(quadratic, &frequencies.per_cycle);
    trials.iter().filter_map(|trial| Some(trial.orbit?.delta_ln_l)).fold(0.0, f64::max)
}

/// The star without the planets of known ephemeris.
#[derive(Clone, Debug)]
pub struct Alone {
    /// The likelihood of its velocities.
    jitters: Jitters,
    /// The star without its jitter, where the jitter is fitted.
    without_jitter: Option<WithoutJitter>,
}

/// A star without a planet, and the blind search for one there.
#[derive(Clone, Debug)]
pub struct PlanetFree {
    /// Its planets of known ephemeris.
    pub known: KnownPlanets,
    /// The likelihood of the velocities of the star without these; `None` where there are none.
    pub alone: Option<Alone>,
    /// The star.
    pub here: Linearised,
    /// The same without its jitter, where the jitter is fitted.
    pub without_jitter: Option<WithoutJitter>,
    /// The search.
    pub blind: Search,
}

impl PlanetFree {
    /// The state of the star in `at`, ignoring the orbit there.
    ///
    /// # Errors
    /// [`SurfaceError`].
    pub fn find(
        surface: &dyn SurfaceModel,
        mut at: At,
        frequencies: &Frequencies,
        settings: &DetectionSettings,
        report: &dyn Fn(Stage),
    ) -> Result<Self, SurfaceError> {
        report(Stage::PlanetFree);
        at.values.set(Parameter::K, 0.0);
        let here = surface.linearise(at, None)?;
        let none = KnownPlanets::default();
        if settings.known.is_empty() {
            return PlanetFree::of(surface, at, (here, none), frequencies, settings.search, report);
        }
        report(Stage::Known);
        let without_jitter = surface.without_jitter(at, &here)?;
        let jitters = none.jitters(&here, without_jitter.as_ref());
        let known = KnownPlanets::absent(&settings.known, &here, without_jitter.as_ref());
        known.write(&mut at.values);
        let here = surface.linearise(at, Some(&here))?;
        let found = PlanetFree::of(surface, at, (here, known), frequencies, settings.search, report)?;
        let known = found.known.clone().present(&found.known.noisy(&found.here, found.without_jitter.as_ref()));
        Ok(PlanetFree { known, alone: Some(Alone { jitters, without_jitter }), ..found })
    }

    /// The state of the star in `at`, linearised `here` by the surface model, with only the orbits of `known` planets.
    ///
    /// # Errors
    /// [`SurfaceError`].
    pub fn of(
        surface: &dyn SurfaceModel,
        at: At,
        (here, known): (Linearised, KnownPlanets),
        frequencies: &Frequencies,
        settings: SearchSettings,
        report: &dyn Fn(Stage),
    ) -> Result<Self, SurfaceError> {
        report(Stage::Search);
        let whole = |star: WithoutJitter| WithoutJitter { here: known.whole(star.here, &at.values), ..star };
        let without_jitter = surface.without_jitter(at, &here)?.map(whole);
        let here = known.whole(here, &at.values);
        let jitters = known.jitters(&here, without_jitter.as_ref());
        let blind = imitated(surface, Search::with_jitter(&jitters, frequencies, settings)?);
        Ok(PlanetFree { known, alone: None, here, without_jitter, blind })
    }
}

impl Detection {
    /// Searches the star in `imager`, with all parameters but the orbit from `values`, at the given periods.
    ///
    /// # Errors
    /// [`SurfaceError`].
    pub fn find(
        imager: &Imager,
        values: ParameterValues,
        frequencies: Frequencies,
        settings: &DetectionSettings,
        report: &dyn Fn(Stage),
    ) -> Result<Self, SurfaceError> {
        let surface = settings.surface.model();
        let mut at = At { imager, values, nuisances: &settings.nuisances };
        let PlanetFree { known, alone, here: planet_free, without_jitter, blind } =
            PlanetFree::find(&*surface, at, &frequencies, settings, report)?;
        if !known.planets.is_empty() {
            known.write(&mut at.values);
        }
        let best = match &without_jitter {
            None => blind.best().orbit.delta_ln_l,
            Some(_) => highest(&known.beside(&planet_free.quadratic), &frequencies),
        };
        let offset = offset(&known.beside(&planet_free.quadratic), &frequencies.per_cycle, best);
        report(Stage::Change);
        let change = surface.evolution(at, &frequencies);
        let mut found = Detection {
            best: *blind.best(),
            known,
            alone,
            planet_free,
            without_jitter,
            blind,
            frequencies,
            change,
            other_rotation: settings.other_rotation,
            at_best: None,
            rounds: 0,
            closed: false,
            keplerian: Vec::new(),
            second: None,
            offset,
            co_rotation_penalty: None,
        };
        // K of the known planets with the detected planet in the model
        if !found.known.planets.is_empty() && found.is_candidate() && found.known.companion.is_none() {
            let frequency = 1.0 / found.blind.best().porb_over_prot;
            let known = found.known.with_companion(frequency);
            let noisy = known.noisy(&found.planet_free, found.without_jitter.as_ref());
            found.known = known.clone().present(&noisy);
        }
        match found.known.first().map(KnownPlanet::peak) {
            // the star without another planet is imaged with its orbit
            Some(peak) => (found.best, found.closed) = (peak, true),
            None => found.close(&*surface, at, report)?,
        }
        found.co_rotation_penalty = co_rotation_penalty(&found.jitters(), &found.blind.rows, &found.frequencies);
        if settings.eccentric {
            found.keplerian = found.eccentric();
        }
        if settings.second_planet {
            report(Stage::SecondPlanet);
            found.second = found.second_planet(&*surface, at, settings.search)?;
        }
        Ok(found)
    }

    /// The likelihood of the velocities of the star without a planet, known ones included.
    pub fn jitters(&self) -> Jitters {
        let none = KnownPlanets::default();
        match &self.alone {
            Some(alone) => alone.jitters.clone(),
            None => none.jitters(&self.planet_free, self.without_jitter.as_ref()),
        }
    }

    /// The last expansion.
    pub fn last(&self) -> &Linearised {
        self.at_best.as_ref().unwrap_or(&self.planet_free)
    }

    /// The RV offsets common to profiles, fitted with the best orbit and those of known planets; `None` where they are
    /// not bounded.
    pub fn constants(&self, imager: &Imager, nuisances: &[Nuisance]) -> Option<Constants> {
        let here = self.last();
        let best = Some(&self.best).filter(|_| self.known.first().is_none());
        here.constants(imager, nuisances, (best, self.known.columns(&here.held.cycles).as_ref()))
    }

    /// The highest peak of the blind search: the best orbit, unless that is one of a known planet.
    pub fn highest(&self) -> &Peak {
        if self.known.first().is_some() { self.blind.best() } else { &self.best }
    }

    /// Velocities (km/s) of the best orbit.
    fn best_velocities(&self, cycles: &[f64]) -> DVector<f64> {
        let CircularOrbit { k_kms, phi, .. } = self.best.orbit;
        match self.known.first() {
            Some(planet) => k_kms * planet.ephemeris.unit_velocities(cycles),
            None => {
                let orbit = Orbit { k_kms, porb_over_prot: self.best.porb_over_prot, phi };
                DVector::from_iterator(cycles.len(), orbit.velocities_kms(cycles))
            }
        }
    }

    /// Delta ln L of the best orbit in the regularised likelihood.
    pub fn regularised_delta_ln_l(&self) -> f64 {
        let regularised = &self.last().regularised;
        regularised.log_likelihood(&self.best_velocities(&regularised.cycles))
    }

    /// The remark where the spots evolve but a static map is assumed.
    pub fn changes(&self) -> Option<String> {
        let Some(Ok(change)) = &self.change else { return None };
        change.is_changing().then(|| change.sentence())
    }

    /// Why no verdict is possible, whatever the search shows: the stellar model is invalid.
    pub fn not_judged(&self) -> Option<String> {
        let of_bound = self.planet_free.field.as_ref().and_then(SpotField::absorbs);
        let other = self.other_rotation.as_ref().filter(|other| other.is_far());
        self.changes().or(other.map(OtherRotation::sentence)).or(of_bound)
    }

    /// The false-alarm probability of the blind search, on which verdicts are based.
    pub fn false_alarm_probability(&self) -> f64 {
        self.blind.false_alarm.probability(self.blind.best().orbit.delta_ln_l).value()
    }

    /// Whether it is low enough for a candidate.
    pub fn is_candidate(&self) -> bool {
        self.false_alarm_probability() < CANDIDATE_FAP
    }

    /// Linearises the star with the best orbit until that orbit converges.
    fn close(&mut self, surface: &dyn SurfaceModel, mut at: At, report: &dyn Fn(Stage)) -> Result<(), SurfaceError> {
        let mut held: Option<Box<dyn SurfaceModel>> = None;
        while self.rounds < MOST_ROUNDS && !self.closed && !self.best.on_edge {
            self.rounds += 1;
            report(Stage::BestOrbit(self.rounds));
            at.values.set(Parameter::K, self.best.orbit.k_kms);
            at.values.set(Parameter::PorbOverProt, self.best.porb_over_prot);
            at.values.set(Parameter::Phi, self.best.orbit.phi);
            // with offsets between data sets fixed at wrong values, it would be absorbed by the jitter
            let constants = (!at.imager.zero_points.is_empty()).then(|| self.constants(at.imager, at.nuisances));
            if let Some(vsys) = constants.flatten().and_then(|constants| constants.systemic) {
                at.values.set(Parameter::Vsys, vsys.value_kms);
            }
            let here = match &held {
                Some(held) => held.linearise(at, Some(self.last()))?,
                None => self.noisy(surface, at, surface.linearise(at, Some(self.last()))?),
            };
            let here = self.known.whole(here, &at.values);
            let mut next = refined(&self.known.beside(&here.quadratic), &self.frequencies, &self.best);
            next.imitation = self.blind.rotation.imitated(next.porb_over_prot, next.sigma_porb_over_prot);
            let moved = (next.orbit.k_kms - self.best.orbit.k_kms).abs();
            self.closed = moved < STAYS * next.orbit.sigma_k_kms;
            self.best = next;
            // spots differ with a planet in the model; later changes are negligible
            held = Some(surface.holding(&here));
            self.at_best = Some(here);
        }
        // one height whatever the spots: the one compared with stars without a planet
        self.best.orbit.delta_ln_l = self.blind.best().orbit.delta_ln_l;
        Ok(())
    }

    /// The star `here`, with the best orbit, with the most likely RV offsets of nights beside an orbit of that period,
    /// if any are needed: without the planet in the model they would absorb it.
    fn noisy(&self, surface: &dyn SurfaceModel, at: At, here: Linearised) -> Linearised {
        if self.without_jitter.as_ref().is_none_or(|star| star.nights.is_none()) {
            return here;
        }
        let noise = surface.without_jitter(at, &here).ok().flatten().and_then(|star| {
            let velocities = self.known.beside(&star.here.quadratic);
            star.noise(&without(&velocities, 1.0 / self.best.porb_over_prot)?)
        });
        let needed = noise.filter(|noise| noise.night_kms > 0.0);
        let noisy = needed.and_then(|noise| surface.with_noise(at, &here, noise).ok());
        noisy.unwrap_or(here)
    }

    /// The Keplerian orbits of all peaks.
    fn eccentric(&self) -> Vec<Option<KeplerianOrbit>> {
        let others = self.blind.peaks[1..].iter().map(|peak| (&self.planet_free, peak));
        let all = std::iter::once((self.last(), self.highest())).chain(others);
        all.map(|(there, peak)| keplerian(&self.known.beside(&there.quadratic), &self.frequencies, peak)).collect()
    }

    /// A search with the highest peak removed, with the jitter found with it and nightly RV offsets as in the search
    /// for the first planet; `None` where no velocities remain.
    fn second_planet(
        &self,
        surface: &dyn SurfaceModel,
        at: At,
        settings: SearchSettings,
    ) -> Result<Option<SecondPlanet>, SurfaceError> {
        let (here, first) = (self.last(), self.highest());
        let star = surface.without_jitter(at, here)?;
        let quadratic = star.as_ref().map_or(&here.quadratic, |star| &star.here.quadratic);
        let Some(rest) = without(&self.known.beside(quadratic), 1.0 / first.porb_over_prot) else { return Ok(None) };
        let jitters = star.as_ref().map_or_else(|| Jitters::none(&rest), |star| star.beside(&rest));
        let search = imitated(surface, Search::with_jitter(&jitters, &self.frequencies, settings)?);
        // offsets of nights found beside the first orbit alone would absorb the second
        let has_offsets = here.field.as_ref().is_some_and(|field| field.night_offsets_kms > 0.0);
        let noisy = star.as_ref().filter(|_| has_offsets).and_then(|star| {
            let free = without(&rest, 1.0 / search.best().porb_over_prot)?;
            star.with_noise(&star.here.quadratic, star.noise(&free)?)
        });
        let quadratic = noisy.as_ref().unwrap_or(&here.quadratic);
        let both = both(&self.known.beside(quadratic), &self.frequencies, first, search.best());
        Ok(Some(SecondPlanet { search, both }))
    }
}
