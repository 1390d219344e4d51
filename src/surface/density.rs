//! What is searched, scanned and sampled: a posterior by one map of maximum entropy at each parameter vector, or one by
//! all maps, integrated over.

use super::evolving_map::MarginalPosterior;
use super::imaging::Imager;
use super::static_map::{LIKELIHOOD_NUMBERS, Posterior};
use crate::model::ParameterSpace;
use crate::sampling::log_density::{Evaluation, LogDensity};

/// A posterior, by how it treats maps.
#[derive(Clone, Debug)]
pub enum Density {
    /// The best map counts.
    Mapped(Box<Posterior>),
    /// All maps count.
    Integrated(Box<MarginalPosterior>),
}

impl Density {
    /// The parameter space.
    pub fn space(&self) -> &ParameterSpace {
        match self {
            Density::Mapped(posterior) => posterior.space(),
            Density::Integrated(posterior) => posterior.space(),
        }
    }

    /// What the data are imaged with.
    pub fn imager(&self) -> &Imager {
        match self {
            Density::Mapped(posterior) => posterior.imager(),
            Density::Integrated(posterior) => posterior.imager(),
        }
    }

    /// The posterior of maximum entropy; `None` where maps are integrated over.
    pub fn mapped(&self) -> Option<&Posterior> {
        match self {
            Density::Mapped(posterior) => Some(posterior),
            Density::Integrated(_) => None,
        }
    }

    /// ln L at `theta` (physical coordinates) without the prior, with the numbers of [`Density::likelihood_numbers`].
    pub fn likelihood(&self, theta: &[f64]) -> Evaluation {
        match self {
            Density::Mapped(posterior) => posterior.likelihood(theta),
            Density::Integrated(posterior) => posterior.likelihood(theta),
        }
    }

    /// Names of the numbers beside ln L.
    pub fn likelihood_numbers(&self) -> Vec<String> {
        let names: &[&str] = match self {
            Density::Mapped(_) => &LIKELIHOOD_NUMBERS,
            Density::Integrated(posterior) => posterior.number_names(),
        };
        names.iter().map(|name| (*name).to_owned()).collect()
    }

    /// The same with the warm starts that so many evaluations, spread like `thetas`, are worth.
    #[must_use]
    pub fn with_warm_starts_for(self, thetas: &[Vec<f64>], evaluations: usize) -> Self {
        match self {
            Density::Mapped(posterior) => {
                Density::Mapped(Box::new(posterior.with_warm_starts_for(thetas, evaluations)))
            }
            integrated => integrated,
        }
    }

    /// The same with warm starts at `thetas` (physical coordinates) besides the reference, and no others.
    #[must_use]
    pub fn with_warm_starts(self, thetas: &[Vec<f64>]) -> Self {
        match self {
            Density::Mapped(posterior) => Density::Mapped(Box::new(posterior.with_warm_starts(thetas))),
            integrated => integrated,
        }
    }

    /// Where its warm starts are, but for the reference.
    pub fn warm_starts(&self) -> Vec<Vec<f64>> {
        self.mapped().map_or_else(Vec::new, |posterior| posterior.warm_starts().map(<[f64]>::to_vec).collect())
    }

    fn any(&self) -> &dyn LogDensity {
        match self {
            Density::Mapped(posterior) => posterior.as_ref(),
            Density::Integrated(posterior) => posterior.as_ref(),
        }
    }
}

impl LogDensity for Density {
    fn names(&self) -> &[String] {
        self.any().names()
    }

    fn number_names(&self) -> &[&str] {
        self.any().number_names()
    }

    fn evaluate(&self, theta: &[f64]) -> Evaluation {
        self.any().evaluate(theta)
    }

    fn to_sampling(&self, theta: &[f64]) -> Vec<f64> {
        self.any().to_sampling(theta)
    }

    fn to_physical(&self, internal: &[f64]) -> Vec<f64> {
        self.any().to_physical(internal)
    }

    fn log_jacobian(&self, theta: &[f64]) -> f64 {
        self.any().log_jacobian(theta)
    }
}
