//! Quoted quantities of the orbits of one planet or two, draw by draw of a chain, and to first order around an optimum.
//!
//! Statistics of draws are in `chain::derived`.

use super::elements::Elements;
use super::orbital::{Estimate, OrbitQuantities, OrbitQuantity, UNKNOWN_PHASE};
use super::{FreeParameter, Parameter, ParameterValues};
use crate::sampling::chain::derived::{Derived, Formula, Rule};
use crate::star::Eccentric;
use nalgebra::DMatrix;
use std::sync::Arc;

/// A quantity of one of the planets.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Quoted {
    /// The quantity.
    pub quantity: OrbitQuantity,
    /// Index of the planet: 0 or 1.
    pub planet: usize,
}

use OrbitQuantity::{Conjunction, Eccentricity, Maximum, MinimumMass, Omega, Period};

/// All quantities, in the order of tables.
const ALL: [OrbitQuantity; 6] = [Period, Maximum, Conjunction, MinimumMass, Eccentricity, Omega];

impl Quoted {
    /// All of them, in the order of tables.
    pub fn all() -> impl Iterator<Item = Quoted> {
        (0..Elements::PLANETS.len()).flat_map(|planet| ALL.map(|quantity| Quoted { quantity, planet }))
    }

    /// The name used in files and tables.
    pub fn name(self) -> &'static str {
        match (self.planet, self.quantity) {
            (0, quantity) => quantity.name(),
            (_, Period) => "period2_d",
            (_, Maximum) => "t_max_rv2_d",
            (_, Conjunction) => "t_conjunction2_d",
            (_, MinimumMass) => "msini2_mjup",
            (_, Eccentricity) => "eccentricity2",
            (_, Omega) => "omega2_deg",
        }
    }

    /// The quantity of that name.
    pub fn from_name(name: &str) -> Option<Quoted> {
        Quoted::all().find(|one| one.name() == name)
    }

    /// Its symbol, in LaTeX without dollars.
    pub fn latex(self) -> &'static str {
        match (self.planet, self.quantity) {
            (0, quantity) => quantity.latex(),
            (_, Period) => r"P_{\mathrm{orb},2}",
            (_, Maximum) => r"T_{\mathrm{max\,RV},2}",
            (_, Conjunction) => r"T_{\mathrm{conj},2}",
            (_, MinimumMass) => r"M_2 \sin i",
            (_, Eccentricity) => "e_2",
            (_, Omega) => r"\omega_2",
        }
    }

    fn elements(self) -> &'static Elements {
        &Elements::PLANETS[self.planet]
    }

    /// Whether it adds information to the free and fixed parameters.
    fn follows(self, star: &OrbitQuantities, is_free: &dyn Fn(&[Parameter]) -> bool) -> bool {
        let Elements { k, ratio, period, phi, conjunction, shape, .. } = *self.elements();
        let eccentric = is_free(&shape);
        match self.quantity {
            Period => is_free(&[ratio]),
            MinimumMass => star.mass_msun.is_some() && (eccentric || is_free(&[k, ratio, period])),
            Maximum => star.time_span_d.is_some() && (eccentric || is_free(&[ratio, period, phi, conjunction])),
            Conjunction => {
                let is_named = is_free(&[conjunction]);
                star.time_span_d.is_some() && !is_named && (eccentric || is_free(&[ratio, period, phi]))
            }
            Eccentricity | Omega => eccentric,
        }
    }
}

impl OrbitQuantities {
    /// Those that follow from free parameters, in order.
    pub fn of_free(&self, free: &[Parameter]) -> Vec<Quoted> {
        let is_free = |wanted: &[Parameter]| wanted.iter().any(|one| free.contains(one));
        Quoted::all().filter(|quoted| quoted.follows(self, &is_free)).collect()
    }

    /// The orbit of a planet at a vector of free parameters; the others stay at `values`.
    fn orbit_at(&self, quoted: Quoted, free: &[FreeParameter], values: &ParameterValues) -> Formula<Eccentric> {
        let parameters: Vec<Parameter> = free.iter().map(|one| one.parameter).collect();
        let (fixed, clock) = (*values, self.clock());
        Arc::new(move |theta: &[f64]| {
            let mut values = fixed;
            Elements::write(&mut values, parameters.iter().copied().zip(theta.iter().copied()), clock);
            quoted.elements().orbit(&values)
        })
    }

    /// Those that follow from free parameters, for draws of these; the others stay at `values`.
    pub fn of_draws(&self, free: &[FreeParameter], values: &ParameterValues) -> Vec<Derived> {
        let parameters: Vec<Parameter> = free.iter().map(|one| one.parameter).collect();
        let derived = |quoted: Quoted| {
            let rule = self.rule(quoted, self.orbit_at(quoted, free, values))?;
            Some(Derived {
                name: quoted.name().to_owned(),
                definition: quoted.quantity.definition().map(str::to_owned),
                rule,
            })
        };
        self.of_free(&parameters).into_iter().filter_map(derived).collect()
    }

    fn rule(&self, quoted: Quoted, orbit: Formula<Eccentric>) -> Option<Rule> {
        let (star, quantity) = (*self, quoted.quantity);
        let value = |orbit: Formula<Eccentric>| -> Formula<f64> {
            Arc::new(move |theta: &[f64]| star.value(quantity, &orbit(theta), None).unwrap_or(f64::NAN))
        };
        Some(match quantity {
            Period | Eccentricity => Rule::Value(value(orbit)),
            MinimumMass => {
                star.mass_msun?;
                Rule::Amplitude(quoted.elements().k.name().to_owned(), value(orbit))
            }
            Maximum | Conjunction => {
                let near = star.middle_d()?;
                let time_and_period = move |theta: &[f64]| {
                    let orbit = orbit(theta);
                    let time = star.value(quantity, &orbit, Some(near)).unwrap_or(near);
                    [time, star.period_d(&orbit.orbit)]
                };
                Rule::Event { near, time_and_period: Arc::new(time_and_period) }
            }
            // an angle is periodic like an event
            Omega => {
                let value = value(orbit);
                Rule::Event { near: 180.0, time_and_period: Arc::new(move |theta| [value(theta), 360.0]) }
            }
        })
    }

    /// The value at `theta` with its standard error to first order, by differences along the parameters, whose
    /// covariance is given. That of an event or angle is at most that of a uniform one.
    pub fn estimate_at(
        &self,
        quoted: Quoted,
        (free, theta): (&[FreeParameter], &[f64]),
        values: &ParameterValues,
        covariance: &DMatrix<f64>,
    ) -> Option<Estimate> {
        /// Step of differences in standard deviations.
        const STEP: f64 = 1e-3;
        let orbit = self.orbit_at(quoted, free, values);
        let here = orbit(theta);
        let value = self.value(quoted.quantity, &here, None)?;
        let near = quoted.quantity.is_event().then_some(value);
        let turn = match quoted.quantity {
            Maximum | Conjunction => self.period_d(&here.orbit),
            Omega => 360.0,
            _ => f64::INFINITY,
        };
        let slope = |i: usize| {
            let h = STEP * covariance[(i, i)].max(0.0).sqrt();
            if h == 0.0 || !h.is_finite() {
                return Some(0.0);
            }
            let at = |h: f64| {
                let mut theta = theta.to_vec();
                theta[i] += h;
                self.value(quoted.quantity, &orbit(&theta), near)
            };
            let difference = at(h)? - at(-h)?;
            let turns = if turn.is_finite() { (difference / turn).round() * turn } else { 0.0 };
            Some((difference - turns) / (2.0 * h))
        };
        let slopes: Vec<f64> = (0..theta.len()).map(slope).collect::<Option<_>>()?;
        let pairs = (0..slopes.len()).flat_map(|i| (0..slopes.len()).map(move |j| (i, j)));
        let variance: f64 = pairs.map(|(i, j)| slopes[i] * covariance[(i, j)] * slopes[j]).sum();
        Some(Estimate { value, sd: variance.max(0.0).sqrt().min(UNKNOWN_PHASE * turn) })
    }
}

/// The description of a derived quantity in one line, where its name is not enough.
pub fn quoted_definition(quantity: &str) -> Option<&'static str> {
    Quoted::from_name(quantity)?.quantity.definition()
}

#[cfg(test)]
mod tests {
    use super::super::Prior;
    use super::*;
    use crate::star::Orbit;

    const STAR: OrbitQuantities = OrbitQuantities {
        rotation_period_d: 3.0,
        epoch_d: 2_459_000.25,
        time_span_d: Some([2_459_310.0, 2_459_330.0]),
        mass_msun: Some(0.9),
    };

    #[test]
    fn nothing_follows_from_what_is_fixed() {
        use Parameter::{K, K2, Phi, PorbOverProt, SqrtECosOmega, SqrtESinOmega, Vsini};
        let names = |star: OrbitQuantities, free: &[Parameter]| -> Vec<&str> {
            star.of_free(free).into_iter().map(Quoted::name).collect()
        };
        assert_eq!(names(STAR, &[K, PorbOverProt, Phi]), ["period_d", "t_max_rv_d", "t_conjunction_d", "msini_mjup"]);
        assert_eq!(names(STAR, &[K, Vsini]), ["msini_mjup"]);
        assert_eq!(names(STAR, &[Phi]), ["t_max_rv_d", "t_conjunction_d"]);
        assert_eq!(names(STAR, &[K, Parameter::Period, Parameter::Conjunction]), ["t_max_rv_d", "msini_mjup"]);
        assert_eq!(names(STAR, &[K2, Parameter::Phi2]), ["t_max_rv2_d", "t_conjunction2_d", "msini2_mjup"]);
        let bare = OrbitQuantities { mass_msun: None, time_span_d: None, ..STAR };
        assert_eq!(names(bare, &[K, PorbOverProt, Phi]), ["period_d"]);
        assert_eq!(names(bare, &[SqrtECosOmega, SqrtESinOmega]), ["eccentricity", "omega_deg"]);
        assert!(names(STAR, &[Vsini]).is_empty());
        assert!(Quoted::all().all(|quoted| Quoted::from_name(quoted.name()) == Some(quoted)));
    }

    /// Uncertainties of a circular orbit agree with its closed formulas.
    #[test]
    fn errors_of_a_circle_are_those_of_its_formulas() {
        let free = [Parameter::K, Parameter::PorbOverProt, Parameter::Phi]
            .map(|parameter| FreeParameter { parameter, prior: Prior::Uniform { min: 0.0, max: 9.0 } });
        let values = ParameterValues::of_eight([0.1, 1.7, 0.3, 2.0, 0.0, 38.0, 40.0, 0.0]);
        let orbit = Orbit { k_kms: 0.1, porb_over_prot: 1.7, phi: 0.3 };
        let covariance = [[1e-4, 0.0, 1e-5], [0.0, 1e-8, -1e-7], [1e-5, -1e-7, 1e-4]];
        let matrix = DMatrix::from_fn(3, 3, |i, j| covariance[i][j]);
        for quantity in OrbitQuantity::ALL {
            let wanted = STAR.estimate(quantity, &orbit, &covariance).unwrap();
            let quoted = Quoted { quantity, planet: 0 };
            let found = STAR.estimate_at(quoted, (&free, &[0.1, 1.7, 0.3]), &values, &matrix).unwrap();
            assert_eq!(found.value, wanted.value);
            assert!((found.sd / wanted.sd - 1.0).abs() < 1e-4, "{quantity:?}: {found:?} {wanted:?}");
        }
    }
}
