//! Planets of known ephemeris: the only unknown of each is K.
//!
//! No other period is searched for them, so that the false-alarm probability of each is that of one period and one
//! sign: how often a star without it, but with the other known planets, has a K as many standard errors above zero at
//! the given ephemeris. Errors of the ephemeris make planets harder to detect, not false ones more frequent. K and its
//! limit, with the planets in the model, are marginalised over all ephemerides within their uncertainties
//! (`docs/method.md` section 4): a tenth of an orbit off, K would be a fifth too small.
//!
//! The blind search leaves their amplitudes free, and the effect of ephemeris errors where an ephemeris is uncertain.

use crate::model::{Ephemeris, ParameterValues};
use crate::planets::mixture::{Mixture, Part};
use crate::planets::periodogram::orbits::SIGMA_OF_UNKNOWN_PHASE;
use crate::planets::periodogram::two_planets::without;
use crate::planets::periodogram::{CircularOrbit, Jitters, Peak};
use crate::planets::velocities::VelocityQuadratic;
use crate::planets::verdict::{CANDIDATE_FAP, one_sided};
use crate::surface::{Linearised, WithoutJitter};
use nalgebra::{DMatrix, DVector, Matrix3};
use std::borrow::Cow;

/// Ephemerides are tried within this many standard errors.
const REACH: f64 = 3.5;

/// Number of trial periods and of trial conjunctions: a step is at most a hundredth of an orbit.
const NODES: usize = 71;

/// An ephemeris that is wrong by this fraction of an orbit adds less than a twentieth of K to the velocities.
const SMALL_ERROR: f64 = 0.01;

/// K of a planet of known ephemeris.
#[derive(Clone, Debug, PartialEq)]
pub struct KnownPlanet {
    /// Its ephemeris.
    pub ephemeris: Ephemeris,
    /// K and its standard error (km/s) from the star without it, where K may have either sign.
    pub alone: [f64; 2],
    /// With the planet in the model; `None` where K is unbounded.
    pub k: Option<KnownAmplitude>,
}

/// K over all ephemerides within their uncertainties.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct KnownAmplitude {
    /// Mean and standard deviation (km/s).
    pub moments: [f64; 2],
    /// 95 % upper limit (km/s), for K of 0 or more.
    pub upper95: f64,
}

/// All planets of known ephemeris of a star.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct KnownPlanets {
    /// The planets.
    pub planets: Vec<KnownPlanet>,
    /// Frequency (orbits a rotation cycle) of another planet that was detected in addition, whose orbit is free where K
    /// is measured.
    pub companion: Option<f64>,
    /// Velocities of the star without each of the planets.
    absent: Vec<VelocityQuadratic>,
}

impl KnownPlanets {
    /// From the star `here` without them: K of each with the others' free; where a jitter is fitted, with that of a
    /// star that has the others.
    pub fn absent(ephemerides: &[Ephemeris], here: &Linearised, without_jitter: Option<&WithoutJitter>) -> Self {
        KnownPlanets::of(ephemerides, |ephemeris| match (ephemerides, without_jitter) {
            // with a single planet, the star itself
            ([_, _, ..], Some(without)) => {
                let rest = beside(others(ephemerides, ephemeris), &without.here.quadratic);
                without.beside_found(&rest).as_found().quadratic.clone()
            }
            _ => beside(others(ephemerides, ephemeris), &here.quadratic).into_owned(),
        })
    }

    /// K of each by velocities of a star without it.
    fn of(ephemerides: &[Ephemeris], rest: impl Fn(&Ephemeris) -> VelocityQuadratic) -> Self {
        let absent: Vec<VelocityQuadratic> = ephemerides.iter().map(rest).collect();
        let planet = |(ephemeris, rest): (&Ephemeris, &VelocityQuadratic)| KnownPlanet {
            ephemeris: *ephemeris,
            alone: rest.amplitude(&ephemeris.unit_velocities(&rest.cycles)),
            k: None,
        };
        KnownPlanets { planets: ephemerides.iter().zip(&absent).map(planet).collect(), companion: None, absent }
    }

    /// The same where another planet was detected at that frequency (orbits a rotation cycle): K of each, alone, with
    /// its orbit free.
    #[must_use]
    pub fn with_companion(mut self, frequency: f64) -> Self {
        self.companion = Some(frequency);
        for (planet, rest) in self.planets.iter_mut().zip(&self.absent) {
            let rest = without(rest, frequency).unwrap_or_else(|| rest.clone());
            planet.alone = rest.amplitude(&planet.ephemeris.unit_velocities(&rest.cycles));
        }
        self
    }

    /// Velocities of the star `here` with them, with the RV offsets of nights that are the most likely beside them, if
    /// any are needed; both stars with their full velocities ([`KnownPlanets::whole`]).
    pub fn noisy<'a>(
        &self,
        here: &'a Linearised,
        without_jitter: Option<&WithoutJitter>,
    ) -> Cow<'a, VelocityQuadratic> {
        let noisy = without_jitter.filter(|star| star.nights.is_some()).and_then(|star| {
            let velocities = &star.here.quadratic;
            let rest = self.beside(velocities);
            let beside_companion = self.companion.and_then(|at| without(&rest, at));
            let noise = star.noise(beside_companion.as_ref().unwrap_or(&rest))?;
            star.with_noise(velocities, noise).filter(|_| noise.night_kms > 0.0)
        });
        noisy.map_or(Cow::Borrowed(&here.quadratic), Cow::Owned)
    }

    /// Writes their orbits into `values`, with K measured on a star without them.
    pub fn write(&self, values: &mut ParameterValues) {
        self.planets.iter().for_each(|planet| planet.ephemeris.write(planet.alone[0].max(0.0), values));
    }

    /// The star `here`, at `values`, with its full velocities: a second planet in the model had been subtracted.
    pub fn whole(&self, mut here: Linearised, values: &ParameterValues) -> Linearised {
        let second = values.second.filter(|_| self.planets.iter().any(|planet| planet.ephemeris.planet == 1));
        if let Some(second) = second.map(|second| second.eccentric()) {
            for quadratic in [&mut here.quadratic, &mut here.held, &mut here.regularised] {
                quadratic.count_in(|cycle| second.velocity_kms(cycle));
            }
        }
        here
    }

    /// The same with K from the star that has them in the model.
    #[must_use]
    pub fn present(mut self, quadratic: &VelocityQuadratic) -> Self {
        let amplitude = |planet: &KnownPlanet| {
            let k = over_errors(&self.beside_others(planet, quadratic), &planet.ephemeris)?;
            Some(KnownAmplitude { moments: k.moments(), upper95: k.upper95() })
        };
        let all: Vec<Option<KnownAmplitude>> = self.planets.iter().map(amplitude).collect();
        self.planets.iter_mut().zip(all).for_each(|(planet, k)| planet.k = k);
        self
    }

    /// The first planet of the config, where it is one of them.
    pub fn first(&self) -> Option<&KnownPlanet> {
        self.planets.first().filter(|planet| planet.ephemeris.planet == 0)
    }

    /// Velocities with the orbits of all free; unchanged where those are unbounded.
    pub fn beside<'a>(&self, quadratic: &'a VelocityQuadratic) -> Cow<'a, VelocityQuadratic> {
        beside(self.ephemerides(), quadratic)
    }

    /// The same with the orbits of all but that planet free, including that of another detected planet.
    pub fn beside_others<'a>(
        &self,
        planet: &KnownPlanet,
        quadratic: &'a VelocityQuadratic,
    ) -> Cow<'a, VelocityQuadratic> {
        let all: Vec<Ephemeris> = self.ephemerides().collect();
        let rest = beside(others(&all, &planet.ephemeris), quadratic);
        self.companion.and_then(|at| without(&rest, at)).map_or(rest, Cow::Owned)
    }

    /// The likelihood of the velocities of the star `here` with the orbits of all free, with the jitter and nightly
    /// offsets where these are fitted.
    pub fn jitters(&self, here: &Linearised, without_jitter: Option<&WithoutJitter>) -> Jitters {
        match without_jitter {
            Some(without) => without.beside(&self.beside(&without.here.quadratic)),
            None => Jitters::none(&self.beside(&here.quadratic)),
        }
    }

    /// The free columns, profiles x amplitudes; `None` where there is no such planet.
    pub fn columns(&self, cycles: &[f64]) -> Option<DMatrix<f64>> {
        columns(self.ephemerides(), cycles)
    }

    fn ephemerides(&self) -> impl Iterator<Item = Ephemeris> + '_ {
        self.planets.iter().map(|planet| planet.ephemeris)
    }

    /// The orbit of a `planet` at its ephemeris, the others' K free, with the jitters that `of` gives for velocities: K
    /// may have either sign.
    pub fn orbit_of(
        &self,
        planet: &KnownPlanet,
        quadratic: &VelocityQuadratic,
        jitters: &dyn Fn(&VelocityQuadratic) -> Jitters,
    ) -> Option<CircularOrbit> {
        let rest = self.beside_others(planet, quadratic);
        let [k_kms, sigma_k_kms, delta_ln_l] =
            jitters(&rest).amplitude(&planet.ephemeris.unit_velocities(&rest.cycles));
        let CircularOrbit { phi, sigma_phi, .. } = planet.orbit();
        let delta_ln_l = if k_kms > 0.0 { delta_ln_l } else { delta_ln_l.min(0.0) };
        delta_ln_l.is_finite().then_some(CircularOrbit { k_kms, sigma_k_kms, phi, sigma_phi, delta_ln_l })
    }
}

impl KnownPlanet {
    /// Whether the false-alarm probability of K is low.
    pub fn is_candidate(&self) -> bool {
        one_sided(self.alone[0] / self.alone[1]) < CANDIDATE_FAP
    }

    /// The orbit, with K from the star that has it in the model where that is bounded.
    pub fn orbit(&self) -> CircularOrbit {
        let mut values = ParameterValues::of_eight([0.0; 8]);
        self.ephemeris.write(0.0, &mut values);
        let [k_kms, sigma_k_kms] = self.k.map_or(self.alone, |k| k.moments);
        CircularOrbit {
            k_kms,
            sigma_k_kms,
            phi: values[self.ephemeris.of().phi],
            sigma_phi: self.ephemeris.phase_error(self.ephemeris.clock.epoch_d).min(SIGMA_OF_UNKNOWN_PHASE),
            delta_ln_l: 0.5 * (self.alone[0] / self.alone[1]).max(0.0).powi(2),
        }
    }

    /// The same in the form of a peak of a search.
    pub fn peak(&self) -> Peak {
        let [period_d, sigma_d] = self.ephemeris.period_d;
        let (prot, orbit) = (self.ephemeris.clock.rotation_period_d, self.orbit());
        // phi is counted from the epoch, over as many orbits as lie between it and the conjunction
        let orbits = (self.ephemeris.conjunction_d[0] - self.ephemeris.clock.epoch_d) / period_d;
        let [of_period, of_phi] =
            [(sigma_d / prot).powi(2), self.ephemeris.phase_error(self.ephemeris.clock.epoch_d).powi(2)];
        let across = -orbits * prot / period_d * of_period;
        let covariance = Matrix3::new(orbit.sigma_k_kms.powi(2), 0.0, 0.0, 0.0, of_period, across, 0.0, across, of_phi);
        Peak {
            porb_over_prot: period_d / prot,
            sigma_porb_over_prot: (sigma_d > 0.0).then_some(sigma_d / prot),
            orbit,
            covariance: Some(covariance),
            on_edge: false,
            alias: None,
            imitation: None,
        }
    }
}

fn others<'a>(all: &'a [Ephemeris], but: &'a Ephemeris) -> impl Iterator<Item = Ephemeris> + 'a {
    all.iter().filter(|of| of.planet != but.planet).copied()
}

fn beside(ephemerides: impl Iterator<Item = Ephemeris>, quadratic: &VelocityQuadratic) -> Cow<'_, VelocityQuadratic> {
    let rest = columns(ephemerides, &quadratic.cycles).and_then(|columns| quadratic.beside(&columns));
    rest.map_or(Cow::Borrowed(quadratic), Cow::Owned)
}

/// Velocities at each ephemeris, and their change by a step in period and conjunction where they are uncertain.
fn columns(ephemerides: impl Iterator<Item = Ephemeris>, cycles: &[f64]) -> Option<DMatrix<f64>> {
    let mut columns: Vec<DVector<f64>> = Vec::new();
    for ephemeris in ephemerides {
        let Ephemeris { period_d: [period, period_sd], conjunction_d: [conjunction, conjunction_sd], clock, .. } =
            ephemeris;
        let at = |of_period: f64, of_conjunction: f64| {
            let (period, conjunction) = (period + of_period, conjunction + of_conjunction);
            ephemeris.unit_velocities_at(period, conjunction, cycles)
        };
        columns.push(at(0.0, 0.0));
        if conjunction_sd > SMALL_ERROR * period {
            columns.push(at(0.0, conjunction_sd) - at(0.0, -conjunction_sd));
        }
        let drift = |cycle: &f64| (clock.epoch_d + clock.rotation_period_d * cycle - conjunction).abs() * period_sd;
        if cycles.iter().map(drift).fold(0.0, f64::max) > SMALL_ERROR * period * period {
            columns.push(at(period_sd, 0.0) - at(-period_sd, 0.0));
        }
    }
    (!columns.is_empty()).then(|| DMatrix::from_columns(&columns))
}

/// K marginalised over all ephemerides within their uncertainties, each weighted by its prior and likelihood. `None`
/// where K is unbounded.
fn over_errors(quadratic: &VelocityQuadratic, ephemeris: &Ephemeris) -> Option<Mixture> {
    let mut parts = Vec::new();
    for (period_d, of_period) in within(ephemeris.period_d) {
        for (conjunction_d, of_conjunction) in within(ephemeris.conjunction_d) {
            let unit = ephemeris.unit_velocities_at(period_d, conjunction_d, &quadratic.cycles);
            let [mean, sd] = quadratic.amplitude(&unit);
            // the likelihood marginalised over K
            parts.push(Part { ln_weight: of_period + of_conjunction + 0.5 * (mean / sd).powi(2) + sd.ln(), mean, sd });
        }
    }
    Mixture::new(parts)
}

/// Values within the uncertainties, [`REACH`] standard errors to both sides, each with ln of its prior; one where there
/// is no uncertainty.
fn within([mean, sd]: [f64; 2]) -> Vec<(f64, f64)> {
    if sd == 0.0 {
        return vec![(mean, 0.0)];
    }
    let deviate = |j: usize| REACH * (2.0 * j as f64 / (NODES - 1) as f64 - 1.0);
    (0..NODES).map(deviate).map(|z| (mean + sd * z, -0.5 * z * z)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::Clock;

    const CLOCK: Clock = Clock { rotation_period_d: 2.0, epoch_d: 0.0 };

    fn ephemeris(planet: usize, period_d: f64, conjunction_d: [f64; 2]) -> Ephemeris {
        Ephemeris { planet, conjunction_d, period_d: [period_d, 0.0], shape: None, clock: CLOCK }
    }

    /// 30 velocities with uncertainties of 0.05 km/s of these orbits: ephemeris and K.
    fn quadratic(orbits: &[(Ephemeris, f64)]) -> VelocityQuadratic {
        let cycles: Vec<f64> = (0..30).map(|k| 0.37 * f64::from(k)).collect();
        let information = DMatrix::identity(30, 30) / 0.05f64.powi(2);
        let mut velocities = DVector::zeros(30);
        for (ephemeris, k_kms) in orbits {
            velocities += *k_kms * ephemeris.unit_velocities(&cycles);
        }
        VelocityQuadratic { gradient: &information * velocities, cycles, information }
    }

    /// A planet of 0.1 km/s whose conjunction is two standard errors, 0.16 orbits, after the given one: at the given
    /// one K is half the true value.
    #[test]
    fn an_ephemeris_that_is_off_leaves_k_as_it_is() {
        let quadratic = quadratic(&[(ephemeris(0, 5.0, [7.8, 0.0]), 0.1)]);
        let given = ephemeris(0, 5.0, [7.0, 0.4]);
        let [there, _] = quadratic.amplitude(&given.unit_velocities(&quadratic.cycles));
        let k = over_errors(&quadratic, &given).unwrap();
        let [mean, sd] = k.moments();
        assert!((there / 0.1 - 0.54).abs() < 0.03, "{there}");
        assert!((mean - 0.1).abs() < sd && sd < 0.02, "{mean} +- {sd}");
        let known = ephemeris(0, 5.0, [7.0, 0.0]);
        let [alone, _] = over_errors(&quadratic, &known).unwrap().moments();
        assert!((alone - there).abs() < 1e-12);
        assert!(k.upper95() > 0.11 && k.upper95() < 0.14, "{}", k.upper95());
        // the effect of the error is free: no orbit remains
        let known = KnownPlanets::of(&[given], |_| quadratic.clone());
        let rest = known.beside(&quadratic);
        let left = rest.gradient.norm() / quadratic.gradient.norm();
        assert!(left < 0.15, "{left}");
    }

    /// Errors of the phase at any time are those of the ephemeris, however far away its conjunction is.
    #[test]
    fn a_distant_conjunction_leaves_phases_uncertain() {
        let given = Ephemeris { period_d: [5.0, 0.008], ..ephemeris(0, 5.0, [-190.0, 0.01]) };
        let planet = KnownPlanet { ephemeris: given, alone: [0.1, 0.01], k: None };
        let covariance = planet.peak().covariance.unwrap();
        assert!((planet.orbit().sigma_phi - 0.0608).abs() < 1e-3, "{}", planet.orbit().sigma_phi);
        for time_d in [-190.0, 0.0, 12.0] {
            // phase = t / P - phi, P in rotations of 2 d
            let slope = -time_d * CLOCK.rotation_period_d / 25.0;
            let variance = slope.powi(2) * covariance[(1, 1)] + covariance[(2, 2)] - 2.0 * slope * covariance[(1, 2)];
            assert!((variance.sqrt() - given.phase_error(time_d)).abs() < 1e-12, "{time_d}");
        }
    }

    /// A negative K has height 0.
    #[test]
    fn a_negative_k_is_no_planet() {
        let planet = ephemeris(0, 5.0, [7.0, 0.0]);
        let quadratic = quadratic(&[(planet, -0.1)]);
        let known = KnownPlanets::of(&[planet], |_| quadratic.clone()).present(&quadratic);
        let orbit = known.orbit_of(&known.planets[0], &quadratic, &Jitters::none).unwrap();
        assert!((orbit.k_kms + 0.1).abs() < 1e-12 && orbit.delta_ln_l == 0.0);
        assert_eq!(known.planets[0].orbit().delta_ln_l, 0.0);
    }

    /// K is unbiased with another, unknown planet.
    #[test]
    fn k_is_measured_beside_a_companion() {
        let (b, c) = (ephemeris(0, 5.0, [7.0, 0.0]), ephemeris(1, 9.1, [3.0, 0.0]));
        let quadratic = quadratic(&[(b, 0.06), (c, 0.3)]);
        let known = KnownPlanets::of(&[b], |_| quadratic.clone()).present(&quadratic);
        let off = |known: &KnownPlanets| (known.planets[0].k.unwrap().moments[0] - 0.06).abs();
        let beside = known.clone().with_companion(2.0 / 9.1).present(&quadratic);
        assert!(off(&known) > 1e-3 && off(&beside) < 1e-9, "{} {}", off(&known), off(&beside));
        assert!((beside.planets[0].alone[0] - 0.06).abs() < 1e-9);
    }

    /// Two planets at once: K of each is unbiased, and nothing remains; alone, each absorbs a part of the other.
    #[test]
    fn two_known_planets_do_not_take_from_each_other() {
        let (b, c) = (ephemeris(0, 5.0, [7.0, 0.0]), ephemeris(1, 9.1, [3.0, 0.0]));
        let quadratic = quadratic(&[(b, 0.06), (c, 0.04)]);
        let both = [b, c];
        let rest = |of: &Ephemeris| beside(others(&both, of), &quadratic).into_owned();
        let known = KnownPlanets::of(&both, rest).present(&quadratic);
        for (planet, k) in known.planets.iter().zip([0.06, 0.04]) {
            let [mean, sd] = planet.k.unwrap().moments;
            assert!((planet.alone[0] - k).abs() < 1e-12 && (mean - k).abs() < 1e-9 && sd > 0.012, "{planet:?}");
            let orbit = known.orbit_of(planet, &quadratic, &Jitters::none).unwrap();
            assert!((orbit.k_kms - k).abs() < 1e-12 && orbit.delta_ln_l > 1.0, "{orbit:?}");
        }
        assert!(known.beside(&quadratic).gradient.norm() < 1e-9 * quadratic.gradient.norm());
        let [alone, _] = quadratic.amplitude(&b.unit_velocities(&quadratic.cycles));
        assert!((alone - 0.06).abs() > 1e-4, "{alone}");
    }
}
