//! The map of maximum entropy compared with the data.

use super::Reference;
use crate::maxent::entropy::Entropy;
use crate::maxent::{Problem, Termination, parallelism};
use crate::sampling::log_density::Status;
use crate::star::observation::Observations;
use crate::surface::checks::Checks;
use crate::surface::imaging::Imager;
use crate::surface::maps::{
    Against, Deviation, ImageSummary, MapSummary, SurfaceMap, SurfaceMaps, TradeOffNode, VelocityWithoutSpots, scatter,
};
use crate::surface::nuisances::Estimate;

impl Deviation {
    /// For a map of brightnesses; `None` if maps have other values.
    fn of(imager: &Imager, map: &[f64]) -> Option<Self> {
        let mean = |part: fn(f64) -> f64| map.iter().zip(&imager.areas).map(|(b, a)| a * part(b - 1.0)).sum();
        match imager.entropy {
            Entropy::Spots { .. } => None,
            Entropy::BrightAndDark => {
                Some(Deviation { darkness: mean(|x| (-x).max(0.0)), brightness_excess: mean(|x| x.max(0.0)) })
            }
        }
    }
}

impl SurfaceMaps {
    /// Compares the image of `reference` with the `observations` that `imager` was made for.
    #[doc(hidden)]
    pub fn of_reference(imager: &Imager, observations: &Observations, reference: &Reference) -> Self {
        let solution = &reference.solution;
        let map = imager.entropy.image(&solution.image.coordinates);
        let mut problem = imager.problem(reference.response.clone());
        let test = parallelism(&mut problem, imager.entropy, &solution.image.coordinates);
        problem.linearise(&map);
        let mut depth = problem.model().to_vec();
        let bins = (0..observations.profiles.len()).map(|k| reference.response.bins(k));
        let estimate = |bins| imager.data.nuisances.estimate(bins, problem.weighted_residual(), &mut depth);
        let estimates: Vec<Estimate> = bins.clone().map(estimate).collect();
        let with = |counted: bool| estimates.iter().filter(move |_| counted);
        let nuisances =
            with(imager.data.nuisances.has_line_and_continuum()).map(|found| found.line_and_continuum).collect();
        let zero_points_kms =
            with(imager.data.nuisances.zero_point_kms() > 0.0).map(|found| found.zero_point_kms).collect();
        let depths: Vec<&[f64]> = bins.map(|bins| &depth[bins]).collect();
        let against = Against::new(imager, observations, reference.values, &depths);
        let image = ImageSummary {
            chi2_target: reference.chi2_target,
            lambda: solution.image.lambda,
            alpha: 1.0 / solution.image.lambda,
            entropy: solution.entropy,
            spottedness: solution.spottedness,
            deviation: Deviation::of(imager, &map),
            test,
            model_applications: reference.model_applications,
            newton_steps: solution.newton_steps,
        };
        let filtered = scatter(against.moments.iter().map(|v| v.filtered_kms()));
        let summary = MapSummary {
            image: Some(image),
            filtered_rv_rms_kms: Some(filtered),
            ..against.summary(status(solution.termination), solution.chi2)
        };
        let node = |n: &super::tradeoff::Node| TradeOffNode {
            lambda: n.lambda,
            chi2: n.chi2,
            spottedness: n.spottedness,
            entropy: n.entropy,
        };
        let of_season = |map: &[f64]| SurfaceMap { time_d: None, pixels: map.to_vec(), sigma: None };
        let velocity = |moments| VelocityWithoutSpots { moments, marginalised_kms: None };
        SurfaceMaps {
            maps: map.chunks(imager.grid.len()).map(of_season).collect(),
            model: depths.iter().map(|depth| depth.iter().map(|d| 1.0 - d).collect()).collect(),
            static_model: None,
            velocities: against.moments.iter().copied().map(velocity).collect(),
            nuisances,
            zero_points_kms,
            light: Vec::new(),
            readings: Vec::new(),
            trade_off: reference.tradeoff.nodes().iter().map(node).collect(),
            field: None,
            here: None,
            warnings: Vec::new(),
            summary,
            checks: Checks::of(&against.residuals, &imager.profiles_of_sets(), imager.data.correlated_bins),
        }
    }
}

fn status(termination: Termination) -> Status {
    match termination {
        Termination::Converged => Status::Converged,
        Termination::Unreachable => Status::Unreachable,
        Termination::StepLimit => Status::StoppedShort,
        Termination::NonFinite => Status::NonFinite,
    }
}
