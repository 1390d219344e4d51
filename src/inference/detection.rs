//! The blind search for a planet: from the image of the star without one to the periodogram, and from its best orbit to
//! the orbit that stays the best when the star is imaged with it.
//!
//! The periodogram and its false-alarm probability belong to the expansion around the planet-free image: a statistic
//! that knows nothing of the planet. That expansion is exact for small velocities only, so the best orbit is found
//! again in an expansion around the image that it implies, and so on until K stays. A second planet is searched for in
//! the last expansion, where the first is small.

mod remarks;
mod robustness;

pub use remarks::Evidence;
pub use robustness::{AtTarget, Robustness, WithoutNight, nights, robustness};

use crate::field::{FieldError, Lifetime};
use crate::maxent::Termination;
use crate::model::{Parameter, ParameterValues};
use crate::planets::periodogram::eccentric::keplerian;
use crate::planets::periodogram::offset::{Offset, offset};
use crate::planets::periodogram::orbits;
use crate::planets::periodogram::peaks::refined;
use crate::planets::periodogram::two_planets::{both, without};
use crate::planets::periodogram::{
    CircularOrbit, Frequencies, Jitters, KeplerianOrbit, Peak, Search, SearchSettings, TwoOrbits, Unbounded,
    co_rotation_penalty,
};
use crate::planets::velocities::VelocityQuadratic;
use crate::planets::verdict::CANDIDATE_FAP;
use crate::star::Orbit;
use crate::surface::evolving_map::{Basis, Change, Fitted, Known, NoFit, fit};
use crate::surface::expansion::{Expansion, Nuisance, STELLAR};
use crate::surface::imaging::Imager;
use crate::surface::static_map::{Reference, ReferenceError};
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
    /// What becomes of the spots.
    pub spots: Spots,
}

/// What becomes of the spots.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum Spots {
    /// They are those of the map of maximum entropy, and do not change. Whether they do is looked into first, with
    /// what is known of the field, if anything is given.
    OneMap(Option<Known>),
    /// All maps are integrated over: the marginal likelihood.
    Integrated(Known),
}

impl Spots {
    /// What is known of the field in a comparison with a star that changes; `None` where there is none.
    pub fn compared(&self) -> Option<Known> {
        match self {
            Spots::OneMap(known) => *known,
            Spots::Integrated(known) => Some(*known).filter(|known| known.lifetime == Some(Lifetime::Static)),
        }
    }
}

/// The spots of a star as the profiles show them.
#[derive(Clone, Debug)]
pub enum Seen {
    /// The map of maximum entropy.
    OneMap(Box<Image>),
    /// The field that was integrated over.
    Integrated(Box<Fitted>),
}

/// A map of maximum entropy.
#[derive(Clone, Debug)]
pub struct Image {
    /// The map.
    pub reference: Reference,
    /// How many times larger than the entropy expects the unresolved spots are, in variance.
    pub unresolved_spots: f64,
    /// Whether it reaches the target chi2.
    pub on_target: bool,
}

/// A star with its spots, and the quadratic in its profiles' velocities around it.
#[derive(Clone, Debug)]
pub struct View {
    /// The spots.
    pub seen: Seen,
    /// ln L around it.
    pub expansion: Expansion,
    /// ln L of the orbit's velocities, counted from 0 whatever the orbit of the image; spots that the map leaves over
    /// count as noise.
    pub quadratic: VelocityQuadratic,
    /// The same with those zero points of data sets held that are otherwise integrated out, for tables of velocities;
    /// `None` where there are none.
    pub zero_points_held: Option<VelocityQuadratic>,
    /// The same with spots as the entropy sees them: the regularised likelihood itself.
    pub regularised: VelocityQuadratic,
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
    /// Without a planet; its quadratic is the one that `search` is of.
    pub planet_free: View,
    /// The blind search there, by which a planet is found or not. The planet itself counts among the unresolved spots,
    /// which makes the false-alarm probability a cautious one.
    pub blind: Search,
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
    /// No field.
    #[error(transparent)]
    Field(#[from] NoFit),
}

impl From<FieldError> for DetectionError {
    fn from(error: FieldError) -> Self {
        DetectionError::Field(error.into())
    }
}

/// What is under way.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stage {
    /// The planet-free image and its expansion.
    PlanetFree,
    /// Whether the star changes.
    Change,
    /// Periods, draws.
    Search,
    /// The image at the best orbit, for that many times.
    BestOrbit(usize),
    /// The second planet.
    SecondPlanet,
}

impl DetectionSettings {
    /// The usual search: circular orbits, one planet.
    pub fn of(chi2_target: f64, nuisances: Vec<Nuisance>) -> Self {
        let search = SearchSettings::default();
        DetectionSettings {
            chi2_target,
            nuisances,
            search,
            eccentric: false,
            second_planet: false,
            spots: Spots::OneMap(None),
        }
    }
}

impl View {
    /// The star imaged at `values`. Where the target chi2 takes more than three times the entropy's weight over the
    /// number of data, the image stops short of it: beyond, noise is turned into spots. Where maps are integrated over
    /// there is no image, and the field is fitted from that of a view `near` by, if there is one.
    ///
    /// # Errors
    /// [`DetectionError`].
    pub fn new(
        imager: &Imager,
        values: ParameterValues,
        settings: &DetectionSettings,
        near: Option<&View>,
    ) -> Result<Self, DetectionError> {
        let nuisances = &settings.nuisances;
        let stellar: Vec<Parameter> = nuisances.iter().map(|n| n.parameter).filter(|p| STELLAR.contains(p)).collect();
        if let Spots::Integrated(known) = settings.spots {
            let basis = Basis::new(&imager.grid);
            let fitted = fit(imager, &basis, values, known, near.and_then(View::field))?;
            let expansion = fitted.marginal.expansion(imager, &basis, &stellar)?;
            let quadratic = expansion.velocities(nuisances);
            let held = || fitted.marginal.known_zero_points(imager, &basis, &stellar);
            let held = (!imager.zero_points.is_empty()).then(held).transpose()?;
            let zero_points_held = held.map(|held| held.velocities(nuisances));
            let (regularised, seen) = (quadratic.clone(), Seen::Integrated(Box::new(fitted)));
            return Ok(View { seen, expansion, quadratic, zero_points_held, regularised });
        }
        let reference = Reference::provisional(imager, values, settings.chi2_target)?;
        let on_target = reference.solution.termination == Termination::Converged;
        let expansion = Expansion::of(imager, &reference, &stellar);
        let regularised = expansion.velocities(nuisances);
        let unresolved_spots = expansion.unresolved_spots(nuisances).ok_or(Unbounded)?;
        let quadratic = expansion.with_unresolved_spots(unresolved_spots).ok_or(Unbounded)?.velocities(nuisances);
        let seen = Seen::OneMap(Box::new(Image { reference, unresolved_spots, on_target }));
        Ok(View { seen, expansion, quadratic, zero_points_held: None, regularised })
    }

    /// The likelihood of the velocities beside jitters of several sizes, where the profiles say how large it is.
    fn jitters(&self, imager: &Imager, settings: &DetectionSettings) -> Result<Jitters, DetectionError> {
        match (&self.seen, settings.spots) {
            (Seen::Integrated(fitted), Spots::Integrated(Known { jitter_kms: None, .. }))
                if fitted.marginal.assumed.jitter_kms > 0.0 =>
            {
                let basis = Basis::new(&imager.grid);
                let expansion = fitted.marginal.without_jitter(imager, &basis)?;
                let expansion = expansion.expansion(imager, &basis, &self.expansion.stellar)?;
                let without = expansion.velocities(&settings.nuisances);
                Ok(Jitters::new(&without, fitted.marginal.assumed.jitter_kms))
            }
            _ => Ok(Jitters::none(&self.quadratic)),
        }
    }

    /// A search with the periods at which these spots imitate orbits.
    fn imitated_by(&self, search: Search) -> Search {
        match &self.seen {
            Seen::OneMap(_) => search,
            Seen::Integrated(_) => search.without_multiples(),
        }
    }

    /// The map of maximum entropy, where there is one.
    pub fn image(&self) -> Option<&Image> {
        match &self.seen {
            Seen::OneMap(image) => Some(image),
            Seen::Integrated(_) => None,
        }
    }

    /// The field that was integrated over.
    pub fn field(&self) -> Option<&Fitted> {
        match &self.seen {
            Seen::OneMap(_) => None,
            Seen::Integrated(fitted) => Some(fitted),
        }
    }
}

/// Delta ln L of the best orbit at the trial periods.
fn highest(quadratic: &VelocityQuadratic, frequencies: &Frequencies) -> f64 {
    let trials = orbits::scan(quadratic, &frequencies.per_cycle);
    trials.iter().filter_map(|trial| Some(trial.orbit?.delta_ln_l)).fold(0.0, f64::max)
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
        alone.set(Parameter::K, 0.0);
        let planet_free = View::new(imager, alone, settings, None)?;
        report(Stage::Search);
        let jitters = planet_free.jitters(imager, settings)?;
        let blind = Search::with_jitter(&jitters, &frequencies, settings.search)?;
        let blind = planet_free.imitated_by(blind);
        let best = match jitters.is_none() {
            true => blind.best().orbit.delta_ln_l,
            false => highest(&planet_free.quadratic, &frequencies),
        };
        let offset = offset(&planet_free.quadratic, &frequencies.per_cycle, best);
        report(Stage::Change);
        let change =
            settings.spots.compared().map(|known| Change::of(imager, values, &frequencies, &settings.nuisances, known));
        let mut found = Detection {
            best: *blind.best(),
            planet_free,
            blind,
            frequencies,
            change,
            at_best: None,
            rounds: 0,
            closed: false,
            keplerian: Vec::new(),
            second: None,
            offset,
            co_rotation_penalty: None,
        };
        found.close(imager, values, settings, report)?;
        found.co_rotation_penalty = co_rotation_penalty(&found.planet_free.quadratic, &found.frequencies);
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

    /// What is to be said where the star changes and is taken for one that does not.
    pub fn changes(&self) -> Option<String> {
        let Some(Ok(change)) = &self.change else { return None };
        change.is_changing().then(|| change.sentence())
    }

    /// The number that verdicts rest on: how often stars without a planet show as high a peak in the blind search.
    pub fn false_alarm_probability(&self) -> f64 {
        self.blind.false_alarm.probability(self.blind.best().orbit.delta_ln_l).value()
    }

    /// Whether that is rare enough for a candidate.
    pub fn is_candidate(&self) -> bool {
        self.false_alarm_probability() < CANDIDATE_FAP
    }

    /// Images the star with the best orbit until that orbit stays.
    fn close(
        &mut self,
        imager: &Imager,
        mut values: ParameterValues,
        settings: &DetectionSettings,
        report: &dyn Fn(Stage),
    ) -> Result<(), DetectionError> {
        let mut settings = settings.clone();
        // of a field that is held, those of its fit
        let mut at_bounds = None;
        while self.rounds < MOST_ROUNDS && !self.closed && !self.best.on_edge {
            self.rounds += 1;
            report(Stage::BestOrbit(self.rounds));
            values.set(Parameter::K, self.best.orbit.k_kms);
            values.set(Parameter::PorbOverProt, self.best.porb_over_prot);
            values.set(Parameter::Phi, self.best.orbit.phi);
            let mut view = View::new(imager, values, &settings, Some(self.last()))?;
            if let (Seen::Integrated(field), Some(before)) = (&mut view.seen, at_bounds.take()) {
                field.at_bounds = before;
            }
            let mut next = refined(&view.quadratic, &self.frequencies, &self.best);
            next.imitation = self.blind.rotation.imitated(next.porb_over_prot, next.sigma_porb_over_prot);
            let moved = (next.orbit.k_kms - self.best.orbit.k_kms).abs();
            self.closed = moved < STAYS * next.orbit.sigma_k_kms;
            self.best = next;
            // the field with a planet in the model is another one; what moves after that is too little to matter
            if let Some(field) = view.field() {
                settings.spots = Spots::Integrated(Known::of(&field.marginal));
                at_bounds = Some(field.at_bounds.clone());
            }
            self.at_best = Some(view);
        }
        Ok(())
    }

    /// The Keplerian orbits of all peaks.
    fn eccentric(&self) -> Vec<Option<KeplerianOrbit>> {
        let others = self.blind.peaks[1..].iter().map(|peak| (&self.planet_free, peak));
        let all = std::iter::once((self.last(), &self.best)).chain(others);
        all.map(|(view, peak)| keplerian(&view.quadratic, &self.frequencies, peak)).collect()
    }

    /// A search with the best orbit taken out; `None` where that leaves nothing.
    fn second_planet(&self, settings: SearchSettings) -> Result<Option<SecondPlanet>, Unbounded> {
        let quadratic = &self.last().quadratic;
        let Some(rest) = without(quadratic, 1.0 / self.best.porb_over_prot) else { return Ok(None) };
        let search = self.last().imitated_by(Search::new(&rest, &self.frequencies, settings)?);
        let both = both(quadratic, &self.frequencies, &self.best, search.best());
        Ok(Some(SecondPlanet { search, both }))
    }
}
