//! The content of `periodogram.json`.

use super::quantities::QuantitiesRecord;
use super::search::BlindSearch;
use crate::data::io::provenance::Provenance;
use crate::data::io::saved::Saved;
use crate::inference::detection::{HeldOut, KnownPlanet, Robustness, WithoutNight};
use crate::inference::evidence::EvidenceRecord;
use crate::model::{OrbitQuantities, ParameterValues};
use crate::numerics::json::number_or_null;
use crate::planets::periodogram::nights::NightOffsets;
use crate::planets::periodogram::offset::Offset;
use crate::planets::periodogram::peaks::Peak;
use crate::planets::periodogram::{CircularOrbit, KeplerianOrbit, Search};
use crate::planets::verdict::Verdict;
use crate::star::{Eccentric, Orbit, Shape};
use crate::surface::{AtTarget, Change, ConstantVelocity, FoundDrift, OtherRotation, SpotField};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Name of the file.
pub const FILE: &str = "periodogram.json";

/// False-alarm probabilities for which levels are given.
const LEVELS: [f64; 3] = [0.1, 0.01, 0.001];

/// The content of `periodogram.json`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PeriodogramFile {
    /// The verdict on the best orbit; where the first planet of the config has a known ephemeris, on that planet.
    pub verdict: Verdict,
    /// From the expansion around its own image; its uncertainties include the period's. Where the first planet of the
    /// config has a known ephemeris, its orbit.
    pub best: OrbitRecord,
    /// Planets of known ephemeris, in the order of the config; peaks are of the search with them in the model.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub known_planets: Vec<KnownPlanetRecord>,
    /// The verdict on the highest peak, where the main verdict is on a planet of known ephemeris.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub blind: Option<Verdict>,
    /// The true parameters, for simulated data.
    pub truth: Option<ParameterValues>,
    /// The same for commonly quoted quantities of the orbit, times nearest to those found.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub derived_truth: BTreeMap<String, f64>,
    /// For the highest peak of the planet-free search.
    pub false_alarm: FalseAlarmRecord,
    /// Around the planet-free image, from high to low.
    pub peaks: Vec<PeakRecord>,
    /// Around the best orbit first, then around the other peaks.
    pub keplerian: Option<Vec<Option<KeplerianRecord>>>,
    /// The second planet, if requested.
    pub second: Option<SecondRecord>,
    /// The settings of the search.
    pub search: SearchRecord,
    /// The field of spots, where all maps are marginalised over.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub field: Option<SpotField>,
    /// Whether the spots evolve, where they are assumed static.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub change: Option<Change>,
    /// Another rotation period with which the profiles are far more probable.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub other_rotation: Option<OtherRotation>,
    /// The quadratic of the search.
    pub expansion: ExpansionRecord,
    /// A constant velocity that is free together with the orbit.
    pub offset: Option<Offset>,
    /// Systemic velocity with the best orbit, where it is free: velocities of `rv.csv` are relative to it, and their
    /// uncertainties do not include its uncertainty.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub systemic_velocity: Option<ConstantVelocity>,
    /// Drift of the velocities with the best orbit, where one is marginalised over.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub drift: Option<FoundDrift>,
    /// Loss of sensitivity where the orbit is synchronous with the rotation.
    pub co_rotation: CoRotationRecord,
    /// Dependence of the best orbit on single choices.
    pub robustness: RobustnessRecord,
    /// Bayes factors of no, one and two planets, where the config has priors for them.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub evidence: Option<EvidenceRecord>,
    /// Remarks beside the verdict.
    pub warnings: Vec<String>,
    /// Config, data and program.
    #[serde(flatten)]
    pub provenance: Provenance,
}

impl PeriodogramFile {
    /// The first planet of the config, where its ephemeris is known: the subject of the verdict.
    pub fn first_known(&self) -> Option<&KnownPlanetRecord> {
        self.known_planets.first().filter(|planet| planet.planet == 1)
    }

    /// The other planets of known ephemeris.
    pub fn other_known(&self) -> &[KnownPlanetRecord] {
        &self.known_planets[usize::from(self.first_known().is_some())..]
    }
}

impl Saved for PeriodogramFile {
    fn check(&self) -> Result<(), String> {
        let SearchRecord { min_period_d, max_period_d, .. } = self.search;
        match min_period_d < max_period_d {
            true => Ok(()),
            false => Err("search.max_period_d: must be above min_period_d".into()),
        }
    }
}

/// A circular orbit.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct OrbitRecord {
    /// Semi-amplitude (km/s).
    pub k_kms: f64,
    /// Its uncertainty (km/s).
    pub sigma_k_kms: f64,
    /// Period (d).
    pub period_d: f64,
    /// Its uncertainty (d).
    pub sigma_period_d: Option<f64>,
    /// Period over the rotation period.
    pub porb_over_prot: f64,
    /// Its uncertainty.
    pub sigma_porb_over_prot: Option<f64>,
    /// Phase (cycles).
    pub phi: f64,
    /// Its uncertainty (cycles); null where K is 0.
    pub sigma_phi: Option<f64>,
    /// Gain in ln L.
    pub delta_ln_l: f64,
    /// Whether its period is the first or last of the search.
    pub on_edge: bool,
    /// Its commonly quoted quantities.
    #[serde(flatten)]
    pub quantities: QuantitiesRecord,
}

/// A planet of known ephemeris.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct KnownPlanetRecord {
    /// Its number in the config, from 1.
    pub planet: usize,
    /// The verdict on it.
    pub verdict: Verdict,
    /// Its orbit: K over all ephemerides within their uncertainties, all else as given.
    pub orbit: OrbitRecord,
    /// Its shape, where the config gives one; circular otherwise.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub shape: Option<Shape>,
    /// The effect of night RV offsets on it, where it would be a candidate.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub night_offsets: Option<NightOffsets>,
}

impl KnownPlanetRecord {
    /// The orbit as a motion of the star.
    pub fn eccentric(&self) -> Eccentric {
        let OrbitRecord { k_kms, porb_over_prot, phi, .. } = self.orbit;
        Eccentric { orbit: Orbit { k_kms, porb_over_prot, phi }, shape: self.shape.unwrap_or_default() }
    }
}

/// A peak of the periodogram.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PeakRecord {
    /// Its orbit.
    #[serde(flatten)]
    pub orbit: OrbitRecord,
    /// The false-alarm probability of a peak this high.
    #[serde(deserialize_with = "number_or_null")]
    pub false_alarm_probability: f64,
    /// Its relation as an alias of the highest peak.
    pub alias: Option<AliasRecord>,
    /// The stellar period, or its alias, from which it is not distinguished: spots mimic orbits there.
    pub rotation: Option<String>,
}

/// The relation of a peak to the highest one as its alias.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct AliasRecord {
    /// Frequency of the sampling window (1/d).
    pub window_frequency_per_d: f64,
    /// Height of the window there.
    pub window: f64,
    /// Whether frequencies add or differ.
    pub relation: String,
}

/// An eccentric orbit.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct KeplerianRecord {
    /// Semi-amplitude (km/s).
    pub k_kms: f64,
    /// Its uncertainty (km/s).
    pub sigma_k_kms: Option<f64>,
    /// Period (d).
    pub period_d: f64,
    /// Its uncertainty (d).
    pub sigma_period_d: Option<f64>,
    /// Eccentricity.
    pub eccentricity: f64,
    /// Its uncertainty.
    pub sigma_eccentricity: Option<f64>,
    /// Argument of periastron (degrees).
    pub omega_deg: f64,
    /// Its uncertainty (degrees).
    pub sigma_omega_deg: Option<f64>,
    /// Time of periastron (d).
    pub periastron_d: f64,
    /// Its uncertainty (d).
    pub sigma_periastron_d: Option<f64>,
    /// Gain in ln L.
    pub delta_ln_l: f64,
    /// Its gain over a circular orbit.
    pub gain_over_circle: f64,
    /// Its commonly quoted quantities.
    #[serde(flatten)]
    pub quantities: QuantitiesRecord,
}

/// The search for a second planet.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SecondRecord {
    /// Gain in ln L over the first orbit alone, its period kept.
    pub false_alarm: FalseAlarmRecord,
    /// From high to low.
    pub peaks: Vec<PeakRecord>,
    /// Both orbits refined together.
    pub orbits: Option<[OrbitRecord; 2]>,
    /// Gain in ln L of both over the first alone.
    pub gain: Option<f64>,
}

/// The settings of the search.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SearchRecord {
    /// Number of trial periods.
    pub periods: usize,
    /// Shortest period (d).
    pub min_period_d: f64,
    /// Longest period (d).
    pub max_period_d: f64,
    /// Time base of the data (d).
    pub time_base_d: f64,
    /// Seed of the draws.
    pub seed: u64,
}

/// The quadratic of the search.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ExpansionRecord {
    /// Parameters that are marginalised over.
    pub marginalised: Vec<String>,
    /// Size of unresolved spots relative to the entropy's expectation, in variance: without a planet, at the best
    /// orbit.
    pub unresolved_spots: [f64; 2],
    /// Delta ln L of the best orbit with spots of the entropy's size.
    pub regularised_delta_ln_l: f64,
    /// Number of expansions for the best orbit.
    pub rounds: usize,
    /// Whether K has converged.
    pub closed: bool,
    /// Number of data.
    pub data: usize,
    /// Target of chi2, per datum.
    pub chi2_target: f64,
    /// chi2 per datum without a planet.
    pub chi2_per_datum_planet_free: f64,
    /// The same at the best orbit.
    pub chi2_per_datum: f64,
}

/// Loss of sensitivity where the orbit is synchronous with the rotation.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct CoRotationRecord {
    /// sigma_K at the rotation period over its median elsewhere.
    pub sigma_k_over_median: Option<f64>,
    /// The same as text.
    pub statement: String,
}

/// The false-alarm probability of a peak.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FalseAlarmRecord {
    /// Height of the peak.
    pub delta_ln_l: f64,
    /// The adopted probability, by the method in `used`.
    #[serde(deserialize_with = "number_or_null")]
    pub probability: f64,
    /// The fraction of draws with as high a peak.
    pub by_draws: f64,
    /// From the distribution of highest peaks.
    #[serde(deserialize_with = "number_or_null")]
    pub by_extreme_value: f64,
    /// `draws` or `extreme value`.
    pub used: String,
    /// Number of draws.
    pub draws: usize,
    /// RV offset per night in these draws: its standard deviation (km/s).
    #[serde(default)]
    pub night_offsets_kms: f64,
    /// Effective bandwidth of the search (Baluev 2008).
    #[serde(deserialize_with = "number_or_null")]
    pub w: f64,
    /// Number of independent periods.
    #[serde(deserialize_with = "number_or_null")]
    pub independent_periods: f64,
    /// Heights of usual probabilities.
    pub levels: [LevelRecord; 3],
}

/// A height with its false-alarm probability.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct LevelRecord {
    /// The probability.
    pub false_alarm_probability: f64,
    /// The height.
    pub delta_ln_l: f64,
}

/// Dependence of the best orbit on single choices; empty where that was not tested.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct RobustnessRecord {
    /// K at the best period with other targets.
    pub targets: Vec<TargetRecord>,
    /// K at the best period without each night; empty for profiles of one night.
    pub without_night: Vec<NightRecord>,
    /// The sum over them of the gain by the planet in their prediction; null for less than two nights.
    #[serde(default)]
    pub held_out_nights: Option<HeldOut>,
    /// The effect on the highest peak, if it is a candidate, of night RV offsets larger than those of the search.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub night_offsets: Option<NightOffsets>,
}

/// The orbit at the best period with another target chi2.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct TargetRecord {
    /// Target, per datum.
    pub chi2_target: f64,
    /// Whether the image reaches it.
    pub reached: bool,
    /// The orbit.
    #[serde(flatten)]
    pub orbit: QuickRecord,
}

/// The orbit at the best period without the profiles of a night.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct NightRecord {
    /// First omitted time (d).
    pub first_time_d: f64,
    /// Last omitted time (d).
    pub last_time_d: f64,
    /// Number of omitted profiles.
    pub profiles: usize,
    /// ln p of the omitted profiles given all others, with the orbit of these relative to that without a planet; null
    /// where these bound no orbit.
    #[serde(default)]
    pub delta_ln_p: Option<f64>,
    /// The orbit.
    #[serde(flatten)]
    pub orbit: QuickRecord,
}

/// Null where none is bounded.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct QuickRecord {
    /// Semi-amplitude (km/s).
    pub k_kms: Option<f64>,
    /// Its uncertainty (km/s).
    pub sigma_k_kms: Option<f64>,
    /// Phase (cycles).
    pub phi: Option<f64>,
    /// Gain in ln L.
    pub delta_ln_l: Option<f64>,
}

impl PeriodogramFile {
    /// All results of `search`.
    pub(super) fn of(search: &BlindSearch) -> Self {
        let BlindSearch { scene, settings, detection: found, .. } = search;
        let (star, span) = (&scene.imager.star, scene.observations.time_span_d());
        let quantities = OrbitQuantities::new(star, scene.settings.mass_msun, span);
        let prot = star.rotation_period_d;
        let (lo, hi) = found.frequencies.range();
        let orbit = |peak: &Peak| OrbitRecord::of(peak, &quantities);
        let peaks = |search: &Search| -> Vec<PeakRecord> {
            search.peaks.iter().map(|peak| PeakRecord::of(peak, search, &quantities)).collect()
        };
        let keplerian = |orbit: &Option<KeplerianOrbit>| Some(KeplerianRecord::of(orbit.as_ref()?, &quantities));
        let second = found.second.as_ref().map(|second| SecondRecord {
            false_alarm: FalseAlarmRecord::of(&second.search),
            peaks: peaks(&second.search),
            orbits: second.both.map(|both| both.orbits.map(|peak| orbit(&peak))),
            gain: second.both.map(|both| both.gain),
        });
        let best = orbit(&found.best);
        // the highest one with the spots fitted together with it
        let mut all = peaks(&found.blind);
        if let Some(highest) = all.first_mut() {
            highest.orbit = orbit(found.highest());
        }
        let known_planet = |(k, planet): (usize, &KnownPlanet)| KnownPlanetRecord {
            planet: planet.ephemeris.planet + 1,
            verdict: search.known[k].clone(),
            orbit: orbit(&planet.peak()),
            shape: planet.ephemeris.shape,
            night_offsets: search.known_night_offsets[k],
        };
        PeriodogramFile {
            verdict: search.verdict.clone(),
            known_planets: found.known.planets.iter().enumerate().map(known_planet).collect(),
            blind: search.blind.clone(),
            truth: scene.truth,
            derived_truth: best.quantities.injected(scene.truth, &quantities),
            best,
            false_alarm: FalseAlarmRecord::of(&found.blind),
            peaks: all,
            keplerian: settings.eccentric.then(|| found.keplerian.iter().map(keplerian).collect()),
            second,
            search: SearchRecord {
                periods: found.blind.rows.len(),
                min_period_d: prot / hi,
                max_period_d: prot / lo,
                time_base_d: found.frequencies.time_base_cycles * prot,
                seed: settings.search.seed,
            },
            field: found.last().field.clone(),
            change: found.change.and_then(Result::ok),
            other_rotation: found.other_rotation,
            expansion: ExpansionRecord {
                marginalised: settings.nuisances.iter().map(|n| n.parameter.name().to_owned()).collect(),
                unresolved_spots: [&found.planet_free, found.last()].map(|here| here.unresolved_spots),
                regularised_delta_ln_l: found.regularised_delta_ln_l(),
                rounds: found.rounds,
                closed: found.closed,
                data: scene.imager.data.depth.len(),
                chi2_target: settings.surface.chi2_target,
                chi2_per_datum_planet_free: search.planet_free.chi2_per_datum,
                chi2_per_datum: search.at_best.chi2_per_datum,
            },
            offset: found.offset,
            systemic_velocity: search.constants.as_ref().and_then(|constants| constants.systemic),
            drift: search.constants.as_ref().and_then(|constants| constants.drift),
            co_rotation: CoRotationRecord {
                sigma_k_over_median: found.co_rotation_penalty,
                statement: found.co_rotation(),
            },
            robustness: RobustnessRecord::of(search.robustness.as_ref(), search.night_offsets),
            evidence: search.evidence.clone(),
            warnings: search.remarks.iter().map(|remark| remark.text.clone()).collect(),
            provenance: Provenance { measured: search.measured(), ..scene.provenance() },
        }
    }
}

impl OrbitRecord {
    fn of(peak: &Peak, quantities: &OrbitQuantities) -> Self {
        let (prot, orbit) = (quantities.rotation_period_d, &peak.orbit);
        OrbitRecord {
            k_kms: orbit.k_kms,
            sigma_k_kms: orbit.sigma_k_kms,
            period_d: prot * peak.porb_over_prot,
            sigma_period_d: peak.sigma_porb_over_prot.map(|sigma| prot * sigma),
            porb_over_prot: peak.porb_over_prot,
            sigma_porb_over_prot: peak.sigma_porb_over_prot,
            phi: orbit.phi,
            sigma_phi: known(orbit.sigma_phi),
            delta_ln_l: orbit.delta_ln_l,
            on_edge: peak.on_edge,
            quantities: QuantitiesRecord::of_circle(peak, quantities),
        }
    }
}

impl PeakRecord {
    fn of(peak: &Peak, search: &Search, quantities: &OrbitQuantities) -> Self {
        let prot = quantities.rotation_period_d;
        PeakRecord {
            orbit: OrbitRecord::of(peak, quantities),
            false_alarm_probability: search.false_alarm.probability(peak.orbit.delta_ln_l).value(),
            alias: peak.alias.map(|alias| AliasRecord {
                window_frequency_per_d: alias.window.frequency / prot,
                window: alias.window.height,
                relation: if alias.mirrored { "sum of frequencies" } else { "difference of frequencies" }.into(),
            }),
            rotation: peak.imitation.map(|imitation| imitation.words(prot)),
        }
    }
}

impl KeplerianRecord {
    fn of(orbit: &KeplerianOrbit, quantities: &OrbitQuantities) -> Self {
        let prot = quantities.rotation_period_d;
        KeplerianRecord {
            k_kms: orbit.k_kms,
            sigma_k_kms: known(orbit.sigma_k_kms),
            period_d: prot * orbit.porb_over_prot,
            sigma_period_d: known(prot * orbit.sigma_porb_over_prot),
            eccentricity: orbit.eccentricity,
            sigma_eccentricity: known(orbit.sigma_eccentricity),
            omega_deg: orbit.omega.to_degrees(),
            sigma_omega_deg: known(orbit.sigma_omega.to_degrees()),
            periastron_d: quantities.epoch_d + prot * orbit.periastron_cycle,
            sigma_periastron_d: known(prot * orbit.sigma_periastron_cycle),
            delta_ln_l: orbit.delta_ln_l,
            gain_over_circle: orbit.gain_over_circle,
            quantities: QuantitiesRecord::of_ellipse(orbit, quantities),
        }
    }
}

impl FalseAlarmRecord {
    /// For the highest peak of `search`.
    fn of(search: &Search) -> Self {
        let alarm = &search.false_alarm;
        let delta_ln_l = search.best().orbit.delta_ln_l;
        let found = alarm.probability(delta_ln_l);
        FalseAlarmRecord {
            delta_ln_l,
            probability: found.value(),
            by_draws: found.by_draws,
            by_extreme_value: found.by_tail,
            used: if found.draws_suffice { "draws" } else { "extreme value" }.into(),
            draws: alarm.maxima.len(),
            night_offsets_kms: alarm.night_kms,
            w: alarm.tail.w,
            independent_periods: alarm.independent_periods(),
            levels: LEVELS.map(|p| LevelRecord { false_alarm_probability: p, delta_ln_l: alarm.level(p) }),
        }
    }
}

impl RobustnessRecord {
    fn of(found: Option<&Robustness>, night_offsets: Option<NightOffsets>) -> Self {
        let Some(found) = found else { return RobustnessRecord { night_offsets, ..Default::default() } };
        let target = |at: &AtTarget| TargetRecord {
            chi2_target: at.chi2_target,
            reached: at.on_target,
            orbit: QuickRecord::of(at.orbit),
        };
        let night = |night: &WithoutNight| NightRecord {
            first_time_d: night.span_d.0,
            last_time_d: night.span_d.1,
            profiles: night.profiles,
            orbit: QuickRecord::of(night.orbit),
            delta_ln_p: night.delta_ln_p,
        };
        RobustnessRecord {
            held_out_nights: found.held_out(),
            night_offsets,
            targets: found.targets.iter().map(target).collect(),
            without_night: found.nights.iter().map(night).collect(),
        }
    }
}

impl QuickRecord {
    fn of(orbit: Option<CircularOrbit>) -> Self {
        QuickRecord {
            k_kms: orbit.map(|o| o.k_kms),
            sigma_k_kms: orbit.map(|o| o.sigma_k_kms),
            phi: orbit.map(|o| o.phi),
            delta_ln_l: orbit.map(|o| o.delta_ln_l),
        }
    }
}

/// An uncertainty, if there is one.
fn known(sigma: f64) -> Option<f64> {
    sigma.is_finite().then_some(sigma)
}
