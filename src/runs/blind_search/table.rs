//! The result of a blind search as text: the best orbit, its false-alarm probability, the peaks, and possible problems.

use super::quantities::QuantitiesRecord;
use super::record::{
    FalseAlarmRecord, KeplerianRecord, NightRecord, OrbitRecord, PeakRecord, PeriodogramFile, QuickRecord,
    RobustnessRecord, SearchRecord,
};
use crate::inference::detection::HeldOut;
use crate::model::{OrbitQuantity, Parameter, definition, in_earths};
use crate::numerics::text::{Align, aligned, columns, plural};
use crate::planets::periodogram::nights::{self, NightOffsets};
use crate::planets::speeds::with_unit;
use crate::planets::verdict::{CANDIDATE_FAP, decimals, extrapolated, false_alarm, probability, speed};
use crate::surface::ConstantVelocity;

/// Peaks shown; the file has the others.
const SHOWN: usize = 6;

impl PeriodogramFile {
    /// The printed output of the search: the table, and the quantities measured from the observations.
    pub fn printed(&self) -> String {
        let OrbitRecord { period_d, porb_over_prot, .. } = self.best;
        let measured = self.provenance.measured.lines();
        let measured: String = measured.iter().map(|(label, text)| format!("{label}: {text}\n")).collect();
        self.table(period_d / porb_over_prot) + &measured
    }

    /// The text, one line or table after the other.
    fn table(&self, rotation_period_d: f64) -> String {
        let mut text = self.verdicts() + "\n";
        // the best orbit, or the first known planet, with the other known ones
        let known = self.other_known();
        let orbits: Vec<OrbitRecord> =
            std::iter::once(&self.best).chain(known.iter().map(|planet| &planet.orbit)).cloned().collect();
        let names: Vec<String> = std::iter::once(match self.first_known() {
            Some(first) if !known.is_empty() => format!("planet {}", first.planet),
            _ => "best".to_owned(),
        })
        .chain(known.iter().map(|planet| format!("planet {}", planet.planet)))
        .collect();
        text += &self.orbits(&orbits, &names, rotation_period_d);
        text += &meanings(&self.best.quantities);
        if let Some(field) = &self.field {
            text += &field.line();
        }
        if let Some(ConstantVelocity { value_kms, sigma_kms }) = self.systemic_velocity {
            let digits = decimals(sigma_kms);
            text += &format!(
                "systemic velocity: {value_kms:.digits$} ± {sigma_kms:.digits$} km/s, subtracted from rv_kms (its \
                uncertainty is not in rv_sigma_kms)\n"
            );
        }
        if let Some(drift) = &self.drift {
            text += &format!("{}\n", drift.line());
        }
        if !self.known_planets.is_empty() {
            text += &format!("blind search beside the known planet{}:\n", plural(self.known_planets.len()));
        }
        text += &format!("{}\n{}\n", chance(&self.false_alarm), self.searched());
        if let Some(evidence) = &self.evidence {
            text += &format!("evidence: {}\n", evidence.sentence);
        }
        text += &peaks(&self.peaks, self.false_alarm.draws);
        if let Some(Some(orbit)) = self.keplerian.as_ref().and_then(|orbits| orbits.first()) {
            text += &eccentric(orbit);
        }
        if let Some(second) = &self.second {
            text += &format!("second planet: {}\n", chance(&second.false_alarm));
            match &second.orbits {
                Some(both) => text += &self.orbits(both, &["first", "second"].map(str::to_owned), rotation_period_d),
                None => text += &peaks(&second.peaks, second.false_alarm.draws),
            }
        }
        text += &robustness(&self.robustness, self.blind_draws());
        text += &format!("{}\n", self.co_rotation.statement);
        for warning in &self.warnings {
            text += &format!("warning: {warning}\n");
        }
        text
    }

    /// The period range.
    fn searched(&self) -> String {
        let SearchRecord { periods, min_period_d, max_period_d, .. } = self.search;
        format!("Searched: {min_period_d:.3} to {max_period_d:.1} d ({periods} periods)")
    }

    /// Simulations of the search where it decides the verdict: known planets are judged without them.
    fn blind_draws(&self) -> Option<usize> {
        self.known_planets.is_empty().then_some(self.false_alarm.draws)
    }

    /// The significance of the highest peak, the period range, and the weight of single nights.
    pub fn significance(&self) -> Vec<String> {
        let nights = of_nights(&self.robustness, self.blind_draws());
        let text = format!("{}\n{}\n{nights}", chance(&self.false_alarm), self.searched());
        text.lines().map(|line| format!("{line}.")).collect()
    }

    /// The verdicts on the planets, one line each.
    fn verdicts(&self) -> String {
        let mut lines = vec![self.verdict.sentence.clone()];
        lines.extend(self.other_known().iter().map(|planet| planet.verdict.sentence.clone()));
        lines.extend(self.blind.iter().map(|blind| format!("Blind search: {}", blind.sentence)));
        lines.iter().map(|line| format!("{line}\n")).collect()
    }

    /// Parameters of one orbit or several with these names, one line each, beside the true ones of a single one.
    fn orbits(&self, orbits: &[OrbitRecord], names: &[String], prot: f64) -> String {
        let truth = self.truth.filter(|_| orbits.len() == 1);
        let head = if truth.is_some() { &["parameter", "truth"][..] } else { &["parameter"] };
        let mut head: Vec<String> = head.iter().map(|s| (*s).to_owned()).collect();
        head.extend(names.iter().flat_map(|name| [name.clone(), "sigma".to_owned()]));
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

    /// Rows of commonly quoted quantities of the same orbits.
    fn quantity_rows(&self, orbits: &[OrbitRecord], with_truth: bool) -> Vec<Vec<String>> {
        let row = |quantity: OrbitQuantity| {
            let all: Option<Vec<_>> = orbits.iter().map(|orbit| orbit.quantities.of(quantity)).collect();
            let all = all?;
            let digits = |sigma: Option<f64>| decimals(sigma.unwrap_or(f64::NAN));
            let mut row = vec![quantity.name().to_owned()];
            if let Some((_, sigma)) = all.first().filter(|_| with_truth) {
                let injected = self.derived_truth.get(quantity.name());
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

/// Descriptions of the names in the table of orbits, one line each.
fn meanings(found: &QuantitiesRecord) -> String {
    let given = OrbitQuantity::ALL.into_iter().filter(|quantity| found.of(*quantity).is_some());
    let meanings = given.map(|quantity| (quantity.name(), quantity.definition()));
    let meanings = [("phi", definition("phi"))].into_iter().chain(meanings);
    let lines = meanings.filter_map(|(name, meaning)| Some(format!("{name}: {}\n", meaning?)));
    let earths = found.msini_mjup.and_then(in_earths).map(|earths| format!("{earths}\n"));
    lines.chain(earths).collect()
}

fn eccentric(orbit: &KeplerianRecord) -> String {
    let error = |x: Option<f64>, digits: usize| x.map_or_else(String::new, |x| format!(" ± {x:.digits$}"));
    let mut text = format!(
        "eccentric orbit: e = {:.3}{}, omega = {:.0}{} deg, ln L {:+.2} over the circular orbit\n",
        orbit.eccentricity,
        error(orbit.sigma_eccentricity, 3),
        orbit.omega_deg,
        error(orbit.sigma_omega_deg, 0),
        orbit.gain_over_circle
    );
    for quantity in OrbitQuantity::ALL {
        if let Some((value, Some(sigma))) = orbit.quantities.of(quantity) {
            text += &format!("  its {}: {value:.1$} ± {sigma:.1$}\n", quantity.name(), decimals(sigma));
        }
    }
    text
}

/// K at the best period under other choices, one line each.
fn robustness(found: &RobustnessRecord, draws: Option<usize>) -> String {
    let shown = |x: Option<f64>, digits: usize| x.map_or_else(|| "-".to_owned(), |x| format!("{x:.digits$}"));
    let row = |what: String, orbit: &QuickRecord| {
        vec![what, shown(orbit.k_kms, 4), shown(orbit.sigma_k_kms, 4), shown(orbit.delta_ln_l, 2)]
    };
    let mut rows = vec![["K at the best period", "k_kms", "sigma", "delta_ln_l"].map(str::to_owned).to_vec()];
    rows.extend(found.targets.iter().map(|at| {
        let short = if at.reached { "" } else { " (not reached)" };
        row(format!("target chi2 {:.4}{short}", at.chi2_target), &at.orbit)
    }));
    let targets = if found.targets.is_empty() { String::new() } else { aligned(&rows) };
    targets + &of_nights(found, draws)
}

/// What single nights and their RV offsets mean for the signal, one line each; `draws` are those of a search that
/// decides the verdict.
fn of_nights(found: &RobustnessRecord, draws: Option<usize>) -> String {
    without_nights(&found.without_night) + &held_out(found) + &beside_offsets(found, draws)
}

/// False-alarm probability beside RV offsets of nights of any size, where these do not exclude a planet: above 1 % a
/// caveat gives it.
fn beside_offsets(found: &RobustnessRecord, draws: Option<usize>) -> String {
    let told = found.night_offsets.filter(|offsets| offsets.false_alarm_probability <= CANDIDATE_FAP).zip(draws);
    told.map_or_else(String::new, |(NightOffsets { sigma_kms, false_alarm_probability, .. }, draws)| {
        format!(
            "If RV offsets of nights may be of any size: {} ({} fits best without a planet)\n",
            false_alarm(false_alarm_probability, nights::DRAWS.min(draws)),
            with_unit(sigma_kms)
        )
    })
}

/// Whether held-out nights are predicted better with the planet.
fn held_out(found: &RobustnessRecord) -> String {
    found.held_out_nights.map_or_else(String::new, |held| {
        let HeldOut { delta_ln_p, sigma_delta_ln_p, nights } = held;
        let gain = format!("{delta_ln_p:.1} ± {sigma_delta_ln_p:.1}");
        format!(
            "Held-out nights, predicted from the others: Δln p = {gain} (planet minus no planet, {nights} nights)\n"
        )
    })
}

/// Dependence of K and the height of the peak on a single night.
fn without_nights(nights: &[NightRecord]) -> String {
    let least = |of: fn(&QuickRecord) -> Option<f64>, sign: f64| {
        let all = nights.iter().filter_map(|night| Some((sign * of(&night.orbit)?, night.first_time_d)));
        all.min_by(|a, b| a.0.total_cmp(&b.0)).map(|(value, time_d)| (sign * value, time_d))
    };
    let ends = [1.0, -1.0].map(|sign| least(|orbit| orbit.k_kms, sign));
    let (Some((low, _)), Some((high, _)), Some((lowest, time_d))) =
        (ends[0], ends[1], least(|orbit| orbit.delta_ln_l, 1.0))
    else {
        return String::new();
    };
    let k = |kms: f64| speed(kms, 0.1 * high.abs());
    format!(
        "Leaving out one of {} nights at a time: K = {} to {}, Δln L ≥ {lowest:.1} (lowest without {time_d:.2})\n",
        nights.len(),
        k(low),
        k(high)
    )
}

fn chance(alarm: &FalseAlarmRecord) -> String {
    let FalseAlarmRecord { delta_ln_l, probability: p, used, draws, .. } = alarm;
    let levels: Vec<String> = alarm.levels.iter().map(|level| format!("{:.1}", level.delta_ln_l)).collect();
    let offsets = match alarm.night_offsets_kms {
        kms if kms > 0.0 => format!(" with RV offsets of nights of {:.0} m/s", 1000.0 * kms),
        _ => String::new(),
    };
    let tail = if used == "draws" { "" } else { ", an extreme-value tail fitted to these" };
    format!(
        "Δln L = {delta_ln_l:.2}, {}; {draws} simulations{offsets}{tail}\n\
        Thresholds of Δln L at FAP = 10, 1, 0.1 %: {}",
        false_alarm(*p, *draws),
        levels.join(", ")
    )
}

/// A false-alarm probability in a table: an upper limit below the resolution of the simulations.
fn short(p: f64, draws: usize) -> String {
    extrapolated(p, draws).map_or_else(|| probability(p), |limit| format!("< {limit}"))
}

fn peaks(peaks: &[PeakRecord], draws: usize) -> String {
    let head = ["peak", "period_d", "porb_over_prot", "k_kms", "sigma", "delta_ln_l", "FAP", ""];
    let mut rows = vec![head.map(str::to_owned).to_vec()];
    for (k, peak) in peaks.iter().enumerate().take(SHOWN) {
        let OrbitRecord { period_d, porb_over_prot, k_kms, sigma_k_kms, delta_ln_l, on_edge, .. } = peak.orbit;
        let digits = decimals(sigma_k_kms);
        let of_period = decimals(peak.orbit.sigma_period_d.unwrap_or(f64::NAN));
        let of_ratio = decimals(peak.orbit.sigma_porb_over_prot.unwrap_or(f64::NAN));
        let note = match &peak.alias {
            Some(alias) => Some(format!("alias of peak 1 by sampling at {:.3}/d", alias.window_frequency_per_d)),
            None if on_edge => Some("at the edge".to_owned()),
            None => None,
        };
        let notes: Vec<String> = note.into_iter().chain(peak.rotation.clone()).collect();
        rows.push(vec![
            (k + 1).to_string(),
            format!("{period_d:.of_period$}"),
            format!("{porb_over_prot:.of_ratio$}"),
            format!("{k_kms:.digits$}"),
            format!("{sigma_k_kms:.digits$}"),
            format!("{delta_ln_l:.2}"),
            short(peak.false_alarm_probability, draws),
            notes.join(", "),
        ]);
    }
    let mut aligns = [Align::Right; 8];
    (aligns[0], aligns[7]) = (Align::Left, Align::Left);
    columns(&rows, &aligns)
}
