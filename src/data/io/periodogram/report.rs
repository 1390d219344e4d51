//! The result of a blind search as text: the best orbit, how often chance does as well, the peaks, and what may be
//! wrong.

use super::PeriodogramResult;
use super::alarm::{FalseAlarmRecord, false_alarm};
use super::record::{OrbitRecord, PeakRecord};
use crate::model::{OrbitQuantity, Parameter};
use crate::numerics::text::{Align, aligned, columns};
use crate::planets::verdict::probability;

/// Peaks shown; the file has the others.
const SHOWN: usize = 6;

impl PeriodogramResult<'_> {
    /// The text, a line or a table after the other.
    pub fn table(&self) -> String {
        let found = self.detection;
        let best = self.orbit(&found.best);
        let meanings = self.meanings(&best.quantities);
        let mut text = format!("{}\n\n", self.verdict.sentence) + &self.orbits(&[best]) + &meanings;
        if let Some(field) = &found.last().field {
            text += &field.line();
        }
        text += &format!("{}\n", chance(&false_alarm(&found.blind)));
        if let Some(evidence) = self.evidence {
            text += &format!("evidence: {}\n", evidence.sentence);
        }
        text += &peaks(&self.peaks(&found.blind));
        for orbit in found.keplerian.iter().take(1).flatten() {
            let orbit = self.keplerian(orbit);
            let error = |x: Option<f64>, digits: usize| x.map_or_else(String::new, |x| format!(" +- {x:.digits$}"));
            text += &format!(
                "eccentric orbit: e = {:.3}{}, omega = {:.0}{} deg, ln L {:+.2} over the circle\n",
                orbit.eccentricity,
                error(orbit.sigma_eccentricity, 3),
                orbit.omega_deg,
                error(orbit.sigma_omega_deg, 0),
                orbit.gain_over_circle
            );
            for quantity in OrbitQuantity::ALL {
                if let Some((value, Some(sigma))) = orbit.quantities.of(quantity) {
                    text += &format!("  its {}: {value:.1$} +- {sigma:.1$}\n", quantity.name(), decimals(sigma));
                }
            }
        }
        if let Some(second) = &found.second {
            text += &format!("second planet: {}\n", chance(&false_alarm(&second.search)));
            match second.both {
                Some(both) => text += &self.orbits(&both.orbits.map(|peak| self.orbit(&peak))),
                None => text += &peaks(&self.peaks(&second.search)),
            }
        }
        text += &self.robustness_table();
        text += &format!("{}\n", found.co_rotation());
        for remark in self.remarks {
            text += &format!("warning: {}\n", remark.text);
        }
        text
    }

    /// Parameters of one orbit or several, a line each, beside the true ones of the first.
    fn orbits(&self, orbits: &[OrbitRecord]) -> String {
        let prot = self.imager.star.rotation_period_d;
        let truth = self.truth.filter(|_| orbits.len() == 1);
        let head = if truth.is_some() { &["parameter", "truth"][..] } else { &["parameter"] };
        let mut head: Vec<String> = head.iter().map(|s| (*s).to_owned()).collect();
        head.extend(orbits.iter().flat_map(|_| ["best".to_owned(), "sigma".to_owned()]));
        let mut rows = vec![head];
        for name in ["k_kms", "period_d", "porb_over_prot", "phi"] {
            let value = |o: &OrbitRecord| match name {
                "k_kms" => (o.k_kms, Some(o.sigma_k_kms)),
                "period_d" => (o.period_d, o.sigma_period_d),
                "porb_over_prot" => (o.porb_over_prot, o.sigma_porb_over_prot),
                _ => (o.phi, o.sigma_phi),
            };
            let digits = |o: &OrbitRecord| decimals(value(o).1.unwrap_or(f64::NAN));
            let mut row = vec![name.to_owned()];
            if let Some(truth) = truth {
                let true_value = match name {
                    "k_kms" => truth[Parameter::K],
                    "period_d" => prot * truth[Parameter::PorbOverProt],
                    "porb_over_prot" => truth[Parameter::PorbOverProt],
                    _ => truth[Parameter::Phi],
                };
                row.push(format!("{true_value:.*}", digits(&orbits[0])));
            }
            for orbit in orbits {
                let (value, sigma) = value(orbit);
                row.push(format!("{value:.*}", digits(orbit)));
                row.push(sigma.map_or("-".into(), |sigma| format!("{sigma:.*}", digits(orbit))));
            }
            rows.push(row);
        }
        rows.extend(self.quantity_rows(orbits, truth.is_some()));
        aligned(&rows)
    }

    /// Rows of what is usually quoted of the same orbits.
    fn quantity_rows(&self, orbits: &[OrbitRecord], with_truth: bool) -> Vec<Vec<String>> {
        let row = |quantity: OrbitQuantity| {
            let all: Option<Vec<_>> = orbits.iter().map(|orbit| orbit.quantities.of(quantity)).collect();
            let all = all?;
            let digits = |sigma: Option<f64>| decimals(sigma.unwrap_or(f64::NAN));
            let mut row = vec![quantity.name().to_owned()];
            if let Some((found, sigma)) = all.first().filter(|_| with_truth) {
                let injected = self.true_quantity(quantity, *found);
                row.push(injected.map_or("-".into(), |value| format!("{value:.*}", digits(*sigma))));
            }
            for (value, sigma) in all {
                row.push(format!("{value:.*}", digits(sigma)));
                row.push(sigma.map_or("-".into(), |error| format!("{error:.*}", digits(sigma))));
            }
            Some(row)
        };
        OrbitQuantity::ALL.into_iter().filter_map(row).collect()
    }
}

/// Decimals that show two digits of a standard error.
fn decimals(sigma: f64) -> usize {
    if sigma > 0.0 && sigma.is_finite() { (1.0 - sigma.log10().floor()).clamp(0.0, 12.0) as usize } else { 4 }
}

fn chance(alarm: &FalseAlarmRecord) -> String {
    let FalseAlarmRecord { delta_ln_l, probability: p, used, draws, independent_periods, .. } = alarm;
    let levels: Vec<String> = alarm.levels.iter().map(|level| format!("{:.1}", level.delta_ln_l)).collect();
    format!(
        "Delta ln L {delta_ln_l:.2}, false-alarm probability {} by {used} ({draws} draws, some \
         {independent_periods:.0} independent periods)\nDelta ln L of 10, 1, 0.1 % false alarms: {}",
        probability(*p),
        levels.join(", ")
    )
}

fn peaks(peaks: &[PeakRecord]) -> String {
    let head = ["peak", "period_d", "porb_over_prot", "k_kms", "sigma", "delta_ln_l", "false alarm", ""];
    let mut rows = vec![head.map(str::to_owned).to_vec()];
    for (k, peak) in peaks.iter().enumerate().take(SHOWN) {
        let OrbitRecord { period_d, porb_over_prot, k_kms, sigma_k_kms, delta_ln_l, on_edge, .. } = peak.orbit;
        let digits = decimals(sigma_k_kms);
        let note = match &peak.alias {
            Some(alias) => Some(format!("alias of 1 at {:.3}/d", alias.window_frequency_per_d)),
            None if on_edge => Some("on the edge".to_owned()),
            None => None,
        };
        let notes: Vec<String> = note.into_iter().chain(peak.rotation.clone()).collect();
        rows.push(vec![
            (k + 1).to_string(),
            format!("{period_d:.4}"),
            format!("{porb_over_prot:.4}"),
            format!("{k_kms:.digits$}"),
            format!("{sigma_k_kms:.digits$}"),
            format!("{delta_ln_l:.2}"),
            probability(peak.false_alarm_probability),
            notes.join(", "),
        ]);
    }
    let mut aligns = [Align::Right; 8];
    (aligns[0], aligns[7]) = (Align::Left, Align::Left);
    columns(&rows, &aligns)
}
