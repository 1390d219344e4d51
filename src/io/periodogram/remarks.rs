//! What is to be said of a blind search in words: the blind spot at co-rotation, and what may be wrong.

use super::PeriodogramResult;
use crate::expansion::SPOTS_LEFT;
use crate::objective::Parameter;
use crate::periodogram::Peak;
use crate::periodogram::offset::Offset;

/// chi2 per datum that many of its standard deviations from 1 says that something is wrong.
const FAR: f64 = 5.0;

/// Fewer profiles than this hardly tell how large the spots left over are.
const FEW: usize = 12;

/// The systemic velocity may be wrong when another one gains that much ln L: 5 standard deviations.
const OFFSET_GAIN: f64 = 12.5;

/// An alias lower by less than this in ln L is as likely as one in twenty.
const RIVAL: f64 = 3.0;

impl PeriodogramResult<'_> {
    pub(super) fn co_rotation(&self) -> String {
        match self.detection.co_rotation_penalty {
            Some(ratio) if ratio > 1.1 => {
                format!(
                    "at Porb = Prot spots imitate an orbit: sigma_K is {ratio:.1} times its median at other periods"
                )
            }
            Some(ratio) => format!("at Porb = Prot sigma_K is {ratio:.2} times its median at other periods"),
            None => "at Porb = Prot spots imitate an orbit, and the data do not bound K there".to_owned(),
        }
    }

    /// Whether another peak is an alias that is not much lower than the highest.
    fn rivals(&self, peak: &Peak) -> bool {
        let highest = self.detection.search().best().orbit.delta_ln_l;
        peak.alias.is_some() && highest - peak.orbit.delta_ln_l < RIVAL
    }

    /// What may be wrong, a sentence each.
    pub(super) fn warnings(&self) -> Vec<String> {
        let found = self.detection;
        let correlated_bins = self.provenance.measured.errors.as_ref().map_or(1.0, |errors| errors.correlated_bins);
        let data = self.imager.data.depth.len() as f64 / correlated_bins;
        let mut warnings = Vec::new();
        let view = found.last();
        let chi2 = self.per_datum(view);
        let far = (chi2 * correlated_bins - 1.0) / (2.0 / data).sqrt();
        if !view.on_target {
            let target = self.settings.chi2_target;
            warnings.push(format!(
                "no map reaches the target chi2 of {target:.3} per datum without turning noise into spots ({chi2:.3} was \
                 reached): the target may be too low, or the model of the star wrong"
            ));
        } else if far.abs() > FAR {
            warnings.push(format!(
                "chi2 is {chi2:.3} per datum, {far:+.1} standard deviations from 1: the errors of the profiles or the model \
                 of the star may be wrong, and all errors here with them"
            ));
        }
        let fixed = self.settings.nuisances.iter().all(|nuisance| nuisance.parameter != Parameter::Vsys);
        if let Some(offset) = found.offset.filter(|offset| fixed && offset.gain > OFFSET_GAIN) {
            let Offset { velocity_kms, sigma_kms, gain } = offset;
            warnings.push(format!(
                "with a constant velocity of {velocity_kms:+.3} +- {sigma_kms:.3} km/s beside an orbit ln L is {gain:.0} \
                 higher: star.vsys_kms may be wrong, which makes false peaks; make it free and use --marginalise"
            ));
        }
        let profiles = self.imager.sampling.profiles.len();
        if profiles < FEW {
            warnings.push(format!(
                "{profiles} profiles hardly tell how large the spots are that the map leaves over: planets are missed, and \
                 errors are rough"
            ));
        }
        if view.spots_left > 0.5 * SPOTS_LEFT.1 {
            warnings.push(
                "the profiles have nothing to do with the model of the star: what the map leaves over is without bounds".into(),
            );
        }
        if let Some(n) = found.fraction_of_rotation().filter(|_| found.is_planet()) {
            let rotation = if n == 1 { "Prot".to_owned() } else { format!("Prot/{n}") };
            warnings.push(format!(
                "the best period is not told from {rotation}, where spots imitate orbits: look at the other peaks before \
                 believing it"
            ));
        }
        if let Some((n, alias)) = found.alias_of_rotation().filter(|_| found.is_planet()) {
            let rotation = if n == 1 { "Prot".to_owned() } else { format!("Prot/{n}") };
            let per_d = alias.window.frequency / self.imager.star.rotation_period_d;
            warnings.push(format!(
                "with this sampling the best period is not told from {rotation} either (the window function peaks at {per_d:.3}/d): \
                 spots imitate orbits there"
            ));
        }
        if let Some(peak) =
            found.search().peaks[1..].iter().find(|peak| self.rivals(peak)).filter(|_| found.is_planet())
        {
            let period_d = self.imager.star.rotation_period_d * peak.porb_over_prot;
            warnings
                .push(format!("the period is ambiguous: {period_d:.4} d, an alias by the sampling, is nearly as good"));
        }
        warnings.extend(self.robustness_warnings());
        if found.best.on_edge {
            warnings.push("the best period lies on the edge of the search: look beyond it before believing it".into());
        } else if !found.closed {
            let rounds = found.rounds;
            warnings.push(format!("K still moves after {rounds} images at the best orbit: its value is not settled"));
        }
        if found.last().quadratic.radial_velocities().is_err() {
            warnings.push("the data do not bound all velocities: rv.csv and covariance.csv hold no numbers".into());
        }
        warnings
    }
}
