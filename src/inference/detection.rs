//! The blind search for a planet: from the image of the star without one to the periodogram, and from its best orbit to
//! the orbit that stays the best when the star is imaged with it.
//!
//! The periodogram and its false-alarm probability belong to the expansion around the planet-free image: a statistic
//! that knows nothing of the planet. That expansion is exact for small velocities only, so the best orbit is found
//! again in an expansion around the image that it implies, and so on until K stays. A second planet is searched for in
//! the last expansion, where the first is small.
//!
//! Planets of known ephemeris belong to the star: all is searched beside them, their K left free. Where the first
//! planet of a config is one of them, the best orbit is its own.

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

/// Expansions around the best orbit at most.
const MOST_ROUNDS: usize = 6;

/// K stays when it moves by less than this part of its error.
const STAYS: f64 = 0.01;

/// What to search for, and how.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct DetectionSettings {
    /// What is assumed of the spots.
    pub surface: SurfaceSettings,
    /// Parameters that are integrated out within their priors; the others are fixed.
    pub nuisances: Vec<Nuisance>,
    /// Planets whose periods and conjunctions are known.
    pub known: Vec<Ephemeris>,
    /// How peaks are judged.
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
    /// Whether the star changes, where that was looked into: of spots that are taken for unchanging.
    pub change: Option<Result<Change, NoFit>>,
    /// Another rotation period with which the profiles are far more probable.
    pub other_rotation: Option<OtherRotation>,
    /// Planets of known ephemeris.
    pub known: KnownPlanets,
    /// The likelihood of the velocities of the star without these; `None` where there are none.
    alone: Option<Alone>,
    /// Without a planet but those.
    pub planet_free: Linearised,
    /// The same without its jitter, where the profiles say how large that is: what `blind` is of.
    pub without_jitter: Option<WithoutJitter>,
    /// The blind search there, by which a planet is found or not. The planet itself counts among the unresolved spots,
    /// which makes the false-alarm probability a cautious one.
    pub blind: Search,
    /// At the best orbit; `None` if it was not imaged, because its period lies on the edge of the search.
    pub at_best: Option<Linearised>,
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

/// What is under way.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stage {
    /// The planet-free image and its expansion.
    PlanetFree,
    /// The same with the planets of known ephemeris.
    Known,
    /// Whether the star changes.
    Change,
    /// Periods, draws.
    Search,
    /// The image at the best orbit, for that many times.
    BestOrbit(usize),
    /// The second planet.
    SecondPlanet,
}

/// A search with the periods at which these spots imitate orbits.
fn imitated(surface: &dyn SurfaceModel, search: Search) -> Search {
    if surface.imitates_at_fractions() { search } else { search.without_multiples() }
}

/// Delta ln L of the best orbit at the trial periods.
fn highest(quadratic: &VelocityQuadratic, frequencies: &Frequencies) -> f64 {
    let trials = orbits::scan(quadratic, &frequencies.per_cycle);
    trials.iter().filter_map(|trial| Some(trial.orbit?.delta_ln_l)).fold(0.0, f64::max)
}

/// The star as it is without the planets of known ephemeris.
#[derive(Clone, Debug)]
pub struct Alone {
    /// The likelihood of its velocities.
    jitters: Jitters,
    /// The star without its jitter, where the profiles say how large that is.
    without_jitter: Option<WithoutJitter>,
}

/// A star without a planet, and the blind search for one there.
#[derive(Clone, Debug)]
pub struct PlanetFree {
    /// Planets of known ephemeris, which it has.
    pub known: KnownPlanets,
    /// The likelihood of the velocities of the star without these; `None` where there are none.
    pub alone: Option<Alone>,
    /// The star.
    pub here: Linearised,
    /// The same without its jitter, where the profiles say how large that is.
    pub without_jitter: Option<WithoutJitter>,
    /// The search.
    pub blind: Search,
}

impl PlanetFree {
    /// Of the star in `at`, whatever the orbit there.
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
        let here = known.whole(surface.linearise(at, Some(&here))?, &at.values);
        let known = known.present(&here.quadratic);
        let found = PlanetFree::of(surface, at, (here, known), frequencies, settings.search, report)?;
        Ok(PlanetFree { alone: Some(Alone { jitters, without_jitter }), ..found })
    }

    /// Of the star in `at`, without an orbit but those of `known` planets, that is linearised `here`.
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
        let without_jitter = surface.without_jitter(at, &here)?;
        let jitters = known.jitters(&here, without_jitter.as_ref());
        let blind = imitated(surface, Search::with_jitter(&jitters, frequencies, settings)?);
        Ok(PlanetFree { known, alone: None, here, without_jitter, blind })
    }
}

impl Detection {
    /// Searches the star in `imager`, all but the orbit as in `values`, at the given periods.
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
        let has_scatter = |without: &WithoutJitter| without.found_kms > 0.0 || blind.false_alarm.night_kms > 0.0;
        let best = match without_jitter.as_ref().is_some_and(has_scatter) {
            false => blind.best().orbit.delta_ln_l,
            true => highest(&known.beside(&planet_free.quadratic), &frequencies),
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
        // K of the known planets beside another that was found
        if !found.known.planets.is_empty() && found.is_candidate() && found.known.companion.is_none() {
            let frequency = 1.0 / found.blind.best().porb_over_prot;
            found.known = found.known.with_companion(frequency, &found.planet_free.quadratic);
        }
        match found.known.first().map(KnownPlanet::peak) {
            // the star without another planet is imaged with its orbit
            Some(peak) => (found.best, found.closed) = (peak, true),
            None => found.close(&*surface, at, report)?,
        }
        found.co_rotation_penalty = co_rotation_penalty(&found.blind.rows, &found.frequencies);
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

    /// The velocities that profiles have in common, beside the best orbit and those of known planets; `None` where they
    /// are not bounded.
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

    /// What is to be said where the star changes and is taken for one that does not.
    pub fn changes(&self) -> Option<String> {
        let Some(Ok(change)) = &self.change else { return None };
        change.is_changing().then(|| change.sentence())
    }

    /// Why no planet can be judged, whatever the search shows: the star is not as it is taken to be.
    pub fn not_judged(&self) -> Option<String> {
        let of_bound = self.planet_free.field.as_ref().and_then(SpotField::absorbs);
        let other = self.other_rotation.as_ref().filter(|other| other.is_far());
        self.changes().or(other.map(OtherRotation::sentence)).or(of_bound)
    }

    /// The number that verdicts rest on: how often stars without a planet show as high a peak in the blind search.
    pub fn false_alarm_probability(&self) -> f64 {
        self.blind.false_alarm.probability(self.blind.best().orbit.delta_ln_l).value()
    }

    /// Whether that is rare enough for a candidate.
    pub fn is_candidate(&self) -> bool {
        self.false_alarm_probability() < CANDIDATE_FAP
    }

    /// Linearises the star with the best orbit until that orbit stays.
    fn close(&mut self, surface: &dyn SurfaceModel, mut at: At, report: &dyn Fn(Stage)) -> Result<(), SurfaceError> {
        let mut held = None;
        while self.rounds < MOST_ROUNDS && !self.closed && !self.best.on_edge {
            self.rounds += 1;
            report(Stage::BestOrbit(self.rounds));
            at.values.set(Parameter::K, self.best.orbit.k_kms);
            at.values.set(Parameter::PorbOverProt, self.best.porb_over_prot);
            at.values.set(Parameter::Phi, self.best.orbit.phi);
            // beside offsets between data sets, held where it is wrong, it would be taken for jitter
            let constants = (!at.imager.zero_points.is_empty()).then(|| self.constants(at.imager, at.nuisances));
            if let Some(vsys) = constants.flatten().and_then(|constants| constants.systemic) {
                at.values.set(Parameter::Vsys, vsys.value_kms);
            }
            let here = held.as_deref().unwrap_or(surface).linearise(at, Some(self.last()))?;
            let here = self.known.whole(here, &at.values);
            let mut next = refined(&self.known.beside(&here.quadratic), &self.frequencies, &self.best);
            next.imitation = self.blind.rotation.imitated(next.porb_over_prot, next.sigma_porb_over_prot);
            let moved = (next.orbit.k_kms - self.best.orbit.k_kms).abs();
            self.closed = moved < STAYS * next.orbit.sigma_k_kms;
            self.best = next;
            // the spots with a planet in the model are others; what moves after that is too little to matter
            held = Some(surface.holding(&here));
            self.at_best = Some(here);
        }
        // whatever the spots beside it, one height: that which is held against stars without a planet
        self.best.orbit.delta_ln_l = self.blind.best().orbit.delta_ln_l;
        Ok(())
    }

    /// The Keplerian orbits of all peaks.
    fn eccentric(&self) -> Vec<Option<KeplerianOrbit>> {
        let others = self.blind.peaks[1..].iter().map(|peak| (&self.planet_free, peak));
        let all = std::iter::once((self.last(), self.highest())).chain(others);
        all.map(|(there, peak)| keplerian(&self.known.beside(&there.quadratic), &self.frequencies, peak)).collect()
    }

    /// A search with the highest peak taken out, beside the jitter found with it and RV offsets of nights as the search
    /// for the first planet is; `None` where that leaves nothing.
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
        let both = both(&self.known.beside(&here.quadratic), &self.frequencies, first, search.best());
        Ok(Some(SecondPlanet { search, both }))
    }
}
