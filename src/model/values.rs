//! A star, its planets and its spots at one point of parameter space, in the units of the parameters' names.

use super::Parameter;
use super::table::{Element, Role};
use crate::star::{Eccentric, Motion, Orbit, Rotation, Shape, StarState, Surface};
use serde::de::Error as _;
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use std::collections::{BTreeMap, BTreeSet};

/// Values of all parameters, free or not. Periods in days and times of conjunctions are not among them: what they stand
/// for is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ParameterValues {
    /// Rotation, geometry and velocity of the star.
    pub star: StarValues,
    /// The surface, where it is another one than that of the star's settings.
    pub surface: Surface,
    /// Orbit of the planet.
    pub first: OrbitValues,
    /// That of a second planet, if there is one.
    pub second: Option<OrbitValues>,
    /// The field of spots, where it is marginalised.
    pub field: Option<FieldValues>,
}

/// Rotation, geometry and velocity of a star.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct StarValues {
    /// Angular velocity of the equator (rad/d).
    pub omega_eq_rad_d: f64,
    /// Equator-to-pole shear (rad/d).
    pub domega_rad_d: f64,
    /// Inclination (degrees).
    pub inclination_deg: f64,
    /// Projected equatorial velocity (km/s).
    pub vsini_kms: f64,
    /// Systemic velocity (km/s).
    pub vsys_kms: f64,
}

/// An orbit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OrbitValues {
    /// The orbit, but for its shape.
    pub orbit: Orbit,
    /// Its shape; a circle if it is not given.
    pub shape: Option<Shape>,
}

/// A Gaussian field of spots.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FieldValues {
    /// Standard deviation of the filling factor before the data.
    pub amplitude: f64,
    /// Slope of the spectrum.
    pub slope: f64,
    /// Lifetime of spots (d); spots do not change where it is not given.
    pub lifetime_d: Option<f64>,
}

/// An orbit of which nothing is given yet: no orbit at all, as it has no period.
const NO_ORBIT: OrbitValues = OrbitValues { orbit: Orbit { k_kms: 0.0, porb_over_prot: 0.0, phi: 0.0 }, shape: None };

impl OrbitValues {
    /// With its shape.
    pub fn eccentric(&self) -> Eccentric {
        Eccentric { orbit: self.orbit, shape: self.shape.unwrap_or_default() }
    }

    fn get(&self, element: Element) -> Option<&f64> {
        match element {
            Element::Amplitude => Some(&self.orbit.k_kms),
            Element::Ratio => Some(&self.orbit.porb_over_prot),
            Element::Phase => Some(&self.orbit.phi),
            Element::ShapeCos => self.shape.as_ref().map(|shape| &shape.sqrt_e_cos_omega),
            Element::ShapeSin => self.shape.as_ref().map(|shape| &shape.sqrt_e_sin_omega),
            Element::Period | Element::Conjunction => None,
        }
    }

    fn set(&mut self, element: Element, value: f64) {
        match element {
            Element::Amplitude => self.orbit.k_kms = value,
            Element::Ratio => self.orbit.porb_over_prot = value,
            Element::Phase => self.orbit.phi = value,
            Element::ShapeCos => self.shape.get_or_insert_default().sqrt_e_cos_omega = value,
            Element::ShapeSin => self.shape.get_or_insert_default().sqrt_e_sin_omega = value,
            Element::Period | Element::Conjunction => panic!("days become a ratio or a phase by Elements::write"),
        }
    }
}

impl std::ops::Index<Parameter> for ParameterValues {
    type Output = f64;

    /// The value of a parameter that is given.
    ///
    /// # Panics
    /// If it is not.
    fn index(&self, p: Parameter) -> &f64 {
        self.find(p).unwrap_or_else(|| panic!("{} is not given", p.name()))
    }
}

impl ParameterValues {
    /// Of the eight parameters of a circular orbit, rotation and systemic velocity; the surface is that of the star's
    /// settings.
    pub fn of_eight(eight: [f64; 8]) -> Self {
        let [k_kms, porb_over_prot, phi, omega_eq_rad_d, domega_rad_d, inclination_deg, vsini_kms, vsys_kms] = eight;
        ParameterValues {
            star: StarValues { omega_eq_rad_d, domega_rad_d, inclination_deg, vsini_kms, vsys_kms },
            surface: Surface::default(),
            first: OrbitValues { orbit: Orbit { k_kms, porb_over_prot, phi }, shape: None },
            second: None,
            field: None,
        }
    }

    fn find(&self, p: Parameter) -> Option<&f64> {
        match p.spec().role {
            Role::Orbit(planet, element) => self.orbit(planet)?.get(element),
            Role::Star(get, _) => Some(get(&self.star)),
            Role::Surface(get, _) => get(&self.surface),
            Role::Field(get, _) => get(self.field.as_ref()?),
        }
    }

    /// The value of a parameter, if it is given.
    pub fn get(&self, p: Parameter) -> Option<f64> {
        self.find(p).copied()
    }

    /// Gives a parameter that value; with it a second planet, an eccentric orbit or a field is there.
    ///
    /// # Panics
    /// If it is a period in days or the time of a conjunction.
    pub fn set(&mut self, p: Parameter, value: f64) {
        match p.spec().role {
            Role::Orbit(planet, element) => self.orbit_mut(planet).set(element, value),
            Role::Star(_, set) => set(&mut self.star, value),
            Role::Surface(_, set) => set(&mut self.surface, value),
            Role::Field(_, set) => set(self.field.get_or_insert_default(), value),
        }
    }

    /// The orbit of planet 0 or 1, if it is there.
    pub fn orbit(&self, planet: usize) -> Option<&OrbitValues> {
        if planet == 0 { Some(&self.first) } else { self.second.as_ref() }
    }

    /// The orbit of planet 0 or 1, which is there from now on.
    pub fn orbit_mut(&mut self, planet: usize) -> &mut OrbitValues {
        if planet == 0 { &mut self.first } else { self.second.get_or_insert(NO_ORBIT) }
    }

    /// The same with the orbits of others.
    pub fn with_orbits_of(self, other: &Self) -> Self {
        ParameterValues { first: other.first, second: other.second, ..self }
    }

    /// The orbits.
    pub fn motion(&self) -> Motion {
        Motion { first: self.first.eccentric(), second: self.second.as_ref().map(OrbitValues::eccentric) }
    }

    /// The physical state of star and planet they stand for.
    pub fn state(&self) -> StarState {
        let StarValues { omega_eq_rad_d, domega_rad_d, inclination_deg, vsini_kms, vsys_kms } = self.star;
        StarState {
            rotation: Rotation { omega_eq_rad_d, domega_rad_d },
            inclination: inclination_deg.to_radians(),
            vsini_kms,
            vsys_kms,
            motion: self.motion(),
            surface: self.surface,
        }
    }
}

/// An object of name and value of those that are given, in the order of [`Parameter::ALL`].
impl Serialize for ParameterValues {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_map(Parameter::ALL.iter().filter_map(|&p| Some((p.name(), self.get(p)?))))
    }
}

impl<'de> Deserialize<'de> for ParameterValues {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let mut values = ParameterValues::of_eight([0.0; 8]);
        let mut missing: BTreeSet<Parameter> = Parameter::ALL.into_iter().filter(|p| !p.is_optional()).collect();
        for (name, value) in BTreeMap::<String, f64>::deserialize(deserializer)? {
            let parameter = Parameter::from_name(&name).filter(|p| !p.is_ephemeris());
            let parameter = parameter.ok_or_else(|| D::Error::custom(format!("unknown parameter {name}")))?;
            values.set(parameter, value);
            missing.remove(&parameter);
        }
        missing.first().map_or(Ok(values), |p| Err(D::Error::missing_field(p.name())))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Every parameter has a place of its own, and is absent or given in files as in memory.
    #[test]
    fn what_is_set_is_read_again() {
        let bare = ParameterValues::of_eight([1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0]);
        let mut values = bare;
        for (k, p) in Parameter::ALL.into_iter().filter(|p| !p.is_ephemeris()).enumerate() {
            assert_eq!(bare.get(p).is_none(), p.is_optional(), "{p:?}");
            values.set(p, 0.5 + k as f64);
        }
        for (k, p) in Parameter::ALL.into_iter().filter(|p| !p.is_ephemeris()).enumerate() {
            assert_eq!(values.get(p), Some(0.5 + k as f64), "{p:?}");
            assert_eq!(values[p], 0.5 + k as f64);
        }
        for values in [bare, values] {
            let text = serde_json::to_string(&values).unwrap();
            assert_eq!(serde_json::from_str::<ParameterValues>(&text).unwrap(), values);
        }
        let refused = serde_json::from_str::<ParameterValues>(r#"{ "radius": 1 }"#);
        assert!(refused.is_err());
    }
}
