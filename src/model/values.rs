//! A star, its planets and its spots at one point of parameter space, in the units of the parameters' names; by
//! parameter see `access`.

use crate::star::{Eccentric, Motion, Orbit, Rotation, Shape, StarState, Surface};

/// Values of all parameters, free or not. Periods in days and times of conjunctions are stored as the parameters that
/// they replace.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ParameterValues {
    /// Rotation, geometry and velocity of the star.
    pub star: StarValues,
    /// The surface, where it differs from the star's settings.
    pub surface: Surface,
    /// Orbit of the planet.
    pub first: OrbitValues,
    /// That of a second planet, if there is one.
    pub second: Option<OrbitValues>,
    /// The field of spots, where it is marginalised over.
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
    /// The orbit without its shape.
    pub orbit: Orbit,
    /// Its shape; circular if not given.
    pub shape: Option<Shape>,
}

/// One of the elements of an orbit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Element {
    /// Semi-amplitude (km/s).
    Amplitude,
    /// Period over rotation period.
    Ratio,
    /// Period (d) in its place.
    Period,
    /// Phase (cycles).
    Phase,
    /// Time of an inferior conjunction (d) in its place.
    Conjunction,
    /// `sqrt(e) cos(omega)`.
    ShapeCos,
    /// `sqrt(e) sin(omega)`.
    ShapeSin,
}

/// A Gaussian field of spots.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FieldValues {
    /// Prior standard deviation of the filling factor.
    pub amplitude: f64,
    /// Power-law index of the spectrum.
    pub slope: f64,
    /// Lifetime of spots (d); static spots where not given.
    pub lifetime_d: Option<f64>,
}

/// An orbit without any element set: no valid orbit, as it has no period.
const NO_ORBIT: OrbitValues = OrbitValues { orbit: Orbit { k_kms: 0.0, porb_over_prot: 0.0, phi: 0.0 }, shape: None };

impl OrbitValues {
    /// With its shape.
    pub fn eccentric(&self) -> Eccentric {
        Eccentric { orbit: self.orbit, shape: self.shape.unwrap_or_default() }
    }

    /// One of its elements, if set; a period in days or a conjunction never is.
    pub fn get(&self, element: Element) -> Option<&f64> {
        match element {
            Element::Amplitude => Some(&self.orbit.k_kms),
            Element::Ratio => Some(&self.orbit.porb_over_prot),
            Element::Phase => Some(&self.orbit.phi),
            Element::ShapeCos => self.shape.as_ref().map(|shape| &shape.sqrt_e_cos_omega),
            Element::ShapeSin => self.shape.as_ref().map(|shape| &shape.sqrt_e_sin_omega),
            Element::Period | Element::Conjunction => None,
        }
    }

    /// Writes it.
    ///
    /// # Panics
    /// If it is a period in days or the time of a conjunction.
    pub fn set(&mut self, element: Element, value: f64) {
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

impl ParameterValues {
    /// The same without the first planet, whatever its orbit.
    #[must_use]
    pub fn without_planet(mut self) -> Self {
        self.first = OrbitValues { orbit: Orbit { k_kms: 0.0, porb_over_prot: 1.0, phi: 0.0 }, shape: None };
        self
    }

    /// From the eight parameters of a circular orbit, rotation and systemic velocity; the surface is that of the star's
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

    /// The orbit of planet 0 or 1, if there is one.
    pub fn orbit(&self, planet: usize) -> Option<&OrbitValues> {
        if planet == 0 { Some(&self.first) } else { self.second.as_ref() }
    }

    /// The orbit of planet 0 or 1, created if missing.
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

    /// The physical state of star and planet.
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
