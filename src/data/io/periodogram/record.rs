//! The content of `periodogram.json`.

use super::super::provenance::Provenance;
use super::PeriodogramResult;
use super::alarm::{FalseAlarmRecord, false_alarm};
use super::quantities::QuantitiesRecord;
use super::robustness::RobustnessRecord;
use crate::planets::periodogram::offset::Offset;
use crate::planets::periodogram::peaks::Peak;
use crate::planets::periodogram::{KeplerianOrbit, Search};
use crate::planets::verdict::Verdict;
use crate::posterior::detection::View;
use crate::posterior::objective::ParameterValues;
use serde::Serialize;
use std::collections::BTreeMap;

#[derive(Serialize)]
pub(super) struct Record<'a> {
    /// What is said of the best orbit.
    pub verdict: &'a Verdict,
    /// In the expansion around its own image; its errors count the period's.
    pub best: OrbitRecord,
    pub truth: Option<ParameterValues>,
    /// The same of what is usually quoted of the orbit, times nearest to those found.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub derived_truth: BTreeMap<&'static str, f64>,
    /// Of the highest peak without a planet.
    pub false_alarm: FalseAlarmRecord,
    /// Around the planet-free image, from high to low.
    pub peaks: Vec<PeakRecord>,
    /// Around the best orbit first, then around the other peaks.
    pub keplerian: Option<Vec<Option<KeplerianRecord>>>,
    pub second: Option<SecondRecord>,
    pub search: SearchRecord,
    pub expansion: ExpansionRecord,
    /// A constant velocity left free beside the orbit.
    pub offset: Option<Offset>,
    pub co_rotation: CoRotationRecord,
    /// Whether the best orbit hangs on a choice.
    pub robustness: RobustnessRecord,
    pub warnings: Vec<&'a str>,
    #[serde(flatten)]
    pub provenance: &'a Provenance,
}

#[derive(Serialize)]
pub(super) struct OrbitRecord {
    pub k_kms: f64,
    pub sigma_k_kms: f64,
    pub period_d: f64,
    pub sigma_period_d: Option<f64>,
    pub porb_over_prot: f64,
    pub sigma_porb_over_prot: Option<f64>,
    pub phi: f64,
    pub sigma_phi: f64,
    pub delta_ln_l: f64,
    pub on_edge: bool,
    #[serde(flatten)]
    pub quantities: QuantitiesRecord,
}

#[derive(Serialize)]
pub(super) struct PeakRecord {
    #[serde(flatten)]
    pub orbit: OrbitRecord,
    /// How often a star without a planet shows one as high.
    pub false_alarm_probability: f64,
    /// How it is an alias of the highest peak.
    pub alias: Option<AliasRecord>,
    /// The period of the star, or alias of one, that it is not told from: spots imitate orbits there.
    pub rotation: Option<String>,
}

#[derive(Serialize)]
pub(super) struct AliasRecord {
    pub window_frequency_per_d: f64,
    pub window: f64,
    pub relation: &'static str,
}

#[derive(Serialize)]
pub(super) struct KeplerianRecord {
    pub k_kms: f64,
    pub sigma_k_kms: f64,
    pub period_d: f64,
    pub sigma_period_d: f64,
    pub eccentricity: f64,
    pub sigma_eccentricity: f64,
    pub omega_deg: f64,
    pub sigma_omega_deg: f64,
    pub periastron_d: f64,
    pub sigma_periastron_d: f64,
    pub delta_ln_l: f64,
    pub gain_over_circle: f64,
    #[serde(flatten)]
    pub quantities: QuantitiesRecord,
}

#[derive(Serialize)]
pub(super) struct SecondRecord {
    /// Gain in ln L over the first orbit alone, its period kept.
    pub false_alarm: FalseAlarmRecord,
    pub peaks: Vec<PeakRecord>,
    /// Both orbits refined together.
    pub orbits: Option<[OrbitRecord; 2]>,
    pub gain: Option<f64>,
}

#[derive(Serialize)]
pub(super) struct SearchRecord {
    pub periods: usize,
    pub min_period_d: f64,
    pub max_period_d: f64,
    pub time_base_d: f64,
    pub seed: u64,
}

#[derive(Serialize)]
pub(super) struct ExpansionRecord {
    pub marginalised: Vec<&'static str>,
    /// How many times larger than the entropy expects unresolved spots are, in variance: without a planet, at the best
    /// orbit.
    pub unresolved_spots: [f64; 2],
    /// Delta ln L of the best orbit with spots as the entropy sees them.
    pub regularised_delta_ln_l: f64,
    pub rounds: usize,
    pub closed: bool,
    pub data: usize,
    pub chi2_target: f64,
    pub chi2_per_datum_planet_free: f64,
    pub chi2_per_datum: f64,
}

#[derive(Serialize)]
pub(super) struct CoRotationRecord {
    pub sigma_k_over_median: Option<f64>,
    pub statement: String,
}

impl PeriodogramResult<'_> {
    pub(super) fn record(&self) -> Record<'_> {
        let found = self.detection;
        let prot = self.imager.star.rotation_period_d;
        let (lo, hi) = found.frequencies.range();
        let keplerian = |orbit: &Option<KeplerianOrbit>| orbit.as_ref().map(|orbit| self.keplerian(orbit));
        let second = found.second.as_ref().map(|second| SecondRecord {
            false_alarm: false_alarm(&second.search),
            peaks: self.peaks(&second.search),
            orbits: second.both.map(|both| both.orbits.map(|peak| self.orbit(&peak))),
            gain: second.both.map(|both| both.gain),
        });
        Record {
            verdict: self.verdict,
            best: self.orbit(&found.best),
            truth: self.truth,
            derived_truth: self.derived_truth(),
            false_alarm: false_alarm(&found.blind),
            peaks: self.peaks(&found.blind),
            keplerian: self.settings.eccentric.then(|| found.keplerian.iter().map(keplerian).collect()),
            second,
            search: SearchRecord {
                periods: found.blind.rows.len(),
                min_period_d: prot / hi,
                max_period_d: prot / lo,
                time_base_d: found.frequencies.time_base_cycles * prot,
                seed: self.settings.search.seed,
            },
            expansion: ExpansionRecord {
                marginalised: self.settings.nuisances.iter().map(|n| n.parameter.name()).collect(),
                unresolved_spots: [found.planet_free.unresolved_spots, found.last().unresolved_spots],
                regularised_delta_ln_l: found.regularised_delta_ln_l(),
                rounds: found.rounds,
                closed: found.closed,
                data: self.imager.data.depth.len(),
                chi2_target: self.settings.chi2_target,
                chi2_per_datum_planet_free: self.per_datum(&found.planet_free),
                chi2_per_datum: self.per_datum(found.last()),
            },
            offset: found.offset,
            co_rotation: CoRotationRecord {
                sigma_k_over_median: found.co_rotation_penalty,
                statement: found.co_rotation(),
            },
            robustness: self.robustness_record(),
            warnings: self.remarks.iter().map(|remark| remark.text.as_str()).collect(),
            provenance: self.provenance,
        }
    }

    pub(super) fn per_datum(&self, view: &View) -> f64 {
        view.reference.solution.chi2 / self.imager.data.depth.len() as f64
    }

    pub(super) fn orbit(&self, peak: &Peak) -> OrbitRecord {
        let prot = self.imager.star.rotation_period_d;
        let orbit = &peak.orbit;
        OrbitRecord {
            k_kms: orbit.k_kms,
            sigma_k_kms: orbit.sigma_k_kms,
            period_d: prot * peak.porb_over_prot,
            sigma_period_d: peak.sigma_porb_over_prot.map(|sigma| prot * sigma),
            porb_over_prot: peak.porb_over_prot,
            sigma_porb_over_prot: peak.sigma_porb_over_prot,
            phi: orbit.phi,
            sigma_phi: orbit.sigma_phi,
            delta_ln_l: orbit.delta_ln_l,
            on_edge: peak.on_edge,
            quantities: self.quantities(peak),
        }
    }

    pub(super) fn peaks(&self, search: &Search) -> Vec<PeakRecord> {
        let prot = self.imager.star.rotation_period_d;
        let record = |peak: &Peak| PeakRecord {
            orbit: self.orbit(peak),
            false_alarm_probability: search.false_alarm.probability(peak.orbit.delta_ln_l).value(),
            alias: peak.alias.map(|alias| AliasRecord {
                window_frequency_per_d: alias.window.frequency / prot,
                window: alias.window.height,
                relation: if alias.mirrored { "sum of frequencies" } else { "difference of frequencies" },
            }),
            rotation: peak.imitation.map(|imitation| imitation.words(prot)),
        };
        search.peaks.iter().map(record).collect()
    }

    pub(super) fn keplerian(&self, orbit: &KeplerianOrbit) -> KeplerianRecord {
        let star = &self.imager.star;
        let prot = star.rotation_period_d;
        KeplerianRecord {
            k_kms: orbit.k_kms,
            sigma_k_kms: orbit.sigma_k_kms,
            period_d: prot * orbit.porb_over_prot,
            sigma_period_d: prot * orbit.sigma_porb_over_prot,
            eccentricity: orbit.eccentricity,
            sigma_eccentricity: orbit.sigma_eccentricity,
            omega_deg: orbit.omega.to_degrees(),
            sigma_omega_deg: orbit.sigma_omega.to_degrees(),
            periastron_d: star.epoch_d + prot * orbit.periastron_cycle,
            sigma_periastron_d: prot * orbit.sigma_periastron_cycle,
            delta_ln_l: orbit.delta_ln_l,
            gain_over_circle: orbit.gain_over_circle,
            quantities: self.eccentric_quantities(orbit),
        }
    }
}
