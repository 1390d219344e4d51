//! Values by parameter: reading, writing, and files.

use super::parameters::{Parameter, Role};
use super::values::ParameterValues;
use serde::de::Error as _;
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use std::collections::{BTreeMap, BTreeSet};

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

    /// Sets a parameter; this creates a second planet, an eccentric orbit or a field where needed.
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
}

/// An object of names and values of the given ones, in the order of [`Parameter::ALL`].
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

    /// Every parameter has its own place, and is absent or present in files as in memory.
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
