//! The choice of a surface model for an objective: the only place with all models.

use super::evolving_map::{EvolvingMap, Known};
use super::model::{Properties, SurfaceModel};
use super::objective::ObjectiveKind;
use super::static_map::StaticMap;
use serde::{Deserialize, Serialize};

/// A surface model according to a config.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct SurfaceSettings {
    /// The objective.
    pub objective: ObjectiveKind,
    /// Target of chi2, per datum, where there is one.
    pub chi2_target: f64,
    /// Prior knowledge of an evolving field of spots. For a static model, spot evolution is tested with it, and not
    /// tested without it.
    pub field: Option<Known>,
}

impl ObjectiveKind {
    /// The properties of its model.
    pub fn properties(self) -> &'static Properties {
        match self {
            ObjectiveKind::MarginalLikelihood => &EvolvingMap::PROPERTIES,
            ObjectiveKind::Spottedness | ObjectiveKind::Entropy | ObjectiveKind::RegularisedLikelihood => {
                &StaticMap::PROPERTIES
            }
        }
    }
}

impl SurfaceSettings {
    /// The map of fewest spots at a target chi2 per datum, without a test for spot evolution.
    pub fn spottedness(chi2_target: f64) -> Self {
        SurfaceSettings { objective: ObjectiveKind::Spottedness, chi2_target, field: None }
    }

    /// The same, without testing whether static spots evolve.
    pub fn without_comparison(self) -> Self {
        let field = self.field.filter(|_| self.objective.properties().has_field);
        SurfaceSettings { field, ..self }
    }

    /// The model.
    pub fn model(&self) -> Box<dyn SurfaceModel> {
        match self.objective {
            ObjectiveKind::MarginalLikelihood => Box::new(EvolvingMap::new(self.field.unwrap_or_default())),
            ObjectiveKind::Spottedness | ObjectiveKind::Entropy | ObjectiveKind::RegularisedLikelihood => {
                Box::new(StaticMap {
                    objective: self.objective,
                    chi2_target: self.chi2_target,
                    compared_with: self.field,
                })
            }
        }
    }
}
