//! The parameters that may be sampled. What is true of each stands in [`super::table`].

use super::table::{Element, PARAMETERS, Role, Scale, Spec};
use serde::{Deserialize, Serialize};

/// One of the parameters that may be free. The order is that of every table and chain.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub enum Parameter {
    /// Semi-amplitude of the planet's orbit (km/s).
    K,
    /// Orbital period over rotation period.
    PorbOverProt,
    /// Orbital period (d), in place of that ratio.
    Period,
    /// Orbital phase (cycles).
    Phi,
    /// Time of an inferior conjunction (d), in place of the phase.
    Conjunction,
    /// Square root of the eccentricity times the cosine of the argument of periastron.
    SqrtECosOmega,
    /// The same with the sine.
    SqrtESinOmega,
    /// Semi-amplitude of a second planet's orbit (km/s).
    K2,
    /// Its orbital period over rotation period.
    PorbOverProt2,
    /// Its orbital period (d), in place of that ratio.
    Period2,
    /// Its orbital phase (cycles).
    Phi2,
    /// Time of one of its inferior conjunctions (d), in place of the phase.
    Conjunction2,
    /// Of its orbit, the square root of the eccentricity times the cosine of the argument of periastron.
    SqrtECosOmega2,
    /// The same with the sine.
    SqrtESinOmega2,
    /// Angular velocity of the equator (rad/d).
    OmegaEq,
    /// Equator-to-pole shear (rad/d).
    DOmega,
    /// Inclination (degrees).
    Inclination,
    /// Projected equatorial velocity (km/s).
    Vsini,
    /// Systemic velocity (km/s).
    Vsys,
    /// First coefficient of the limb darkening.
    LimbDarkening,
    /// Standard deviation of the local line (km/s), before the spectrograph.
    LineSigma,
    /// Equivalent width of the local line (km/s).
    EquivalentWidth,
    /// Brightness of a spot over that of the photosphere.
    Contrast,
    /// Standard deviation of the spots' filling factor before the data, where maps are integrated over.
    SpotAmplitude,
    /// Slope of the spots' spectrum there.
    SpotSlope,
    /// Lifetime of the spots there (d).
    SpotLifetime,
}

impl Parameter {
    /// All of them, in order.
    pub const ALL: [Parameter; PARAMETERS.len()] = {
        let mut all = [Parameter::K; PARAMETERS.len()];
        let mut i = 0;
        while i < all.len() {
            all[i] = PARAMETERS[i].parameter;
            i += 1;
        }
        all
    };

    /// Those of the field of spots that is integrated over.
    pub const FIELD: [Parameter; 3] = [Parameter::SpotAmplitude, Parameter::SpotSlope, Parameter::SpotLifetime];

    /// Its row of the table.
    pub const fn spec(self) -> &'static Spec {
        &PARAMETERS[self as usize]
    }

    /// The name used in config, chain, tables and plots.
    pub fn name(self) -> &'static str {
        self.spec().key
    }

    /// Unit of its values; `1` for a ratio.
    pub fn unit(self) -> &'static str {
        self.spec().unit
    }

    /// Its symbol, in LaTeX without dollars.
    pub fn latex(self) -> &'static str {
        self.spec().latex
    }

    /// Widest bounds of its prior.
    pub const fn widest(self) -> (f64, f64) {
        self.spec().widest
    }

    /// Its value where none is given.
    ///
    /// # Panics
    /// If the table has none.
    pub const fn usual(self) -> f64 {
        self.spec().usual.expect("a usual value")
    }

    /// The number of an orbit that it is.
    fn element(self) -> Option<Element> {
        match self.spec().role {
            Role::Orbit(_, element) => Some(element),
            _ => None,
        }
    }

    /// Whether it belongs to a planet's orbit.
    pub fn is_orbital(self) -> bool {
        self.element().is_some()
    }

    /// Whether it is a phase of an orbit, which has period 1.
    pub fn is_phase(self) -> bool {
        self.element() == Some(Element::Phase)
    }

    /// Whether it is one of the two that say how eccentric an orbit is, and where its periastron.
    pub fn is_shape(self) -> bool {
        matches!(self.element(), Some(Element::ShapeCos | Element::ShapeSin))
    }

    /// Whether it is a semi-amplitude.
    pub fn is_amplitude(self) -> bool {
        self.element() == Some(Element::Amplitude)
    }

    /// Whether it stands in place of another parameter, in other units: it is free in its name alone, and
    /// [`super::ParameterValues`] hold the other.
    pub fn is_ephemeris(self) -> bool {
        matches!(self.element(), Some(Element::Period | Element::Conjunction))
    }

    /// Whether it stands in place of one of the star's settings.
    pub fn is_surface(self) -> bool {
        matches!(self.spec().role, Role::Surface(..))
    }

    /// Whether it says what is assumed of the spots where all maps are integrated over.
    pub fn is_of_field(self) -> bool {
        matches!(self.spec().role, Role::Field(..))
    }

    /// Whether values of all parameters may do without it.
    pub fn is_optional(self) -> bool {
        match self.spec().role {
            Role::Orbit(planet, Element::Amplitude | Element::Ratio | Element::Phase) => planet > 0,
            Role::Star(..) => false,
            Role::Orbit(..) | Role::Surface(..) | Role::Field(..) => true,
        }
    }

    /// Whether samplers move in its logarithm.
    fn is_logarithmic(self) -> bool {
        self.spec().scale == Scale::Logarithmic
    }

    /// The coordinate of its own that samplers move in, of a value; orbits have others
    /// ([`super::ParameterSpace::to_sampling`]).
    pub fn to_sampling(self, value: f64) -> f64 {
        if self.is_logarithmic() { value.ln() } else { value }
    }

    /// The value at that coordinate.
    pub fn to_physical(self, coordinate: f64) -> f64 {
        if self.is_logarithmic() { coordinate.exp() } else { coordinate }
    }

    /// ln of the derivative of the value with respect to that coordinate.
    pub fn log_jacobian(self, value: f64) -> f64 {
        if self.is_logarithmic() { value.ln() } else { 0.0 }
    }

    /// Whether it only shifts whole profiles, so that what a pixel looks like does not depend on it.
    pub fn only_shifts(self) -> bool {
        self.is_orbital() || self == Parameter::Vsys
    }

    /// The parameter of that name.
    pub fn from_name(name: &str) -> Option<Parameter> {
        Parameter::ALL.into_iter().find(|p| p.name() == name)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    #[test]
    fn every_parameter_has_its_row_and_a_name_of_its_own() {
        for (place, row) in PARAMETERS.iter().enumerate() {
            assert_eq!(row.parameter as usize, place, "{}", row.key);
            assert_eq!(Parameter::from_name(row.key), Some(row.parameter));
            assert!(!row.latex.is_empty() && row.about.ends_with('.') && row.config_key.contains('.'), "{}", row.key);
        }
        let symbols: BTreeSet<&str> = PARAMETERS.iter().map(|row| row.latex).collect();
        assert_eq!(symbols.len(), PARAMETERS.len());
        let field: Vec<Parameter> = Parameter::ALL.into_iter().filter(|p| p.is_of_field()).collect();
        assert_eq!(field, Parameter::FIELD);
    }
}
