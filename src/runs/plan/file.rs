//! The files of a plan: `plan.csv`, one line per schedule and period, and `plan.json`; and the printed output.

use super::{Aim, Campaign, Choice, Expected, LightRecord, Outlook, PlanSettings, SetRecord, SpotsSource};
use crate::data::io::atomic::{WriteError, write, write_json, write_set};
use crate::data::io::csv::Table;
use crate::data::io::provenance::Provenance;
use crate::data::io::saved::Saved;
use crate::numerics::text::{aligned, escaped};
use crate::planets::speeds::{Speeds, with_unit};
use crate::planets::verdict::{CANDIDATE_FAP, speed};
use serde::{Deserialize, Serialize};
use std::path::Path;

/// Names of the files.
pub const CSV: &str = "plan.csv";
/// See [`CSV`].
pub const JSON: &str = "plan.json";

/// Periods (d) of the table, those within the search.
const ROUND_D: [f64; 14] = [0.3, 0.5, 0.7, 1.5, 2.0, 3.0, 5.0, 7.0, 10.0, 14.0, 20.0, 30.0, 50.0, 100.0];

/// Periods (d) of the sentences.
const SPOKEN_D: [f64; 6] = [0.5, 2.0, 5.0, 10.0, 20.0, 50.0];

/// The content of `plan.json`.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct PlanFile {
    /// False-alarm probability of a detection.
    pub false_alarm_probability: f64,
    /// Shortest and longest period of the search (d).
    pub range_d: [f64; 2],
    /// Settings of the computation.
    pub settings: PlanSettings,
    /// The schedules, in the given order.
    pub schedules: Vec<ScheduleRecord>,
    /// Number of the best of them, from 1: that with the lowest `k95_kms`.
    pub best: usize,
    /// Config of the first, times and program.
    #[serde(flatten)]
    pub provenance: Provenance,
}

impl Saved for PlanFile {
    fn check(&self) -> Result<(), String> {
        let all = self.schedules.len();
        match () {
            () if all == 0 => Err("schedules: empty, a plan has one at least".into()),
            () if !(1..=all).contains(&self.best) => Err(format!("best: {} must be from 1 to {all}", self.best)),
            () if !(self.range_d[0] > 0.0 && self.range_d[0] < self.range_d[1]) => {
                Err("range_d: must rise, and be above 0".into())
            }
            () => Ok(()),
        }
    }
}

/// A schedule.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct ScheduleRecord {
    /// Its name.
    pub name: String,
    /// Profiles taken before.
    pub taken: usize,
    /// First and last time (d), of all profiles.
    pub span_d: [f64; 2],
    /// Rotation period of the star (d).
    pub rotation_period_d: f64,
    /// Signal-to-noise ratio of a planned bin.
    pub snr: f64,
    /// The data sets, if there are several.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub sets: Vec<SetRecord>,
    /// The light curves.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub light_curves: Vec<LightRecord>,
    /// The spots that are marginalised over.
    pub spots: SpotsRecord,
    /// Delta ln L of a detection, after all nights.
    pub level: f64,
    /// After an increasing number of nights, finally all.
    pub after: Vec<AfterRecord>,
    /// After all nights, at some round periods.
    pub periods: Vec<ExpectedRecord>,
    /// Strong peaks of the window function, from high to low: orbits of frequency f are hard to distinguish from those
    /// of f plus or minus one of these.
    pub window: Vec<WindowRecord>,
    /// The nights to be taken, where they were requested.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub next: Option<Choice>,
}

/// The spots that are marginalised over.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct SpotsRecord {
    /// Their origin.
    pub source: SpotsSource,
    /// Standard deviation of the filling factor.
    pub spot_amplitude: f64,
    /// Slope of the spectrum.
    pub spot_slope: f64,
    /// Degree below which the spectrum is flat.
    #[serde(default)]
    pub spot_break_degree: f64,
    /// Lifetime (d); null for static spots.
    pub spot_lifetime_d: Option<f64>,
    /// RV jitter (km/s).
    pub velocity_jitter_kms: f64,
}

/// The expectation after some nights: medians over all compared periods, up to the longest time base.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct AfterRecord {
    /// Planned nights.
    pub nights: usize,
    /// Profiles, including those taken before.
    pub profiles: usize,
    /// Standard error of K (km/s); null where most periods are not bounded.
    pub sigma_k_kms: Option<f64>,
    /// K detected with a probability of 50 % (km/s).
    pub k50_kms: Option<f64>,
    /// The same of 95 %.
    pub k95_kms: Option<f64>,
}

/// The expectation at one period.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ExpectedRecord {
    /// The period (d).
    pub period_d: f64,
    /// The same over the rotation period.
    pub porb_over_prot: f64,
    /// Standard error of K (km/s); null where no orbit is bounded.
    pub sigma_k_kms: Option<f64>,
    /// K detected with a probability of 50 % (km/s).
    pub k50_kms: Option<f64>,
    /// The same of 95 %.
    pub k95_kms: Option<f64>,
    /// The stellar period from which it is not distinguished, as text.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub imitated: Option<String>,
}

/// A peak of the window function.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct WindowRecord {
    /// Frequency (1/d).
    pub frequency_per_d: f64,
    /// Height, 1 at most.
    pub height: f64,
}

/// A campaign with its outlooks, the last of them after all nights.
pub type Looked<'a> = (&'a Campaign, &'a [Outlook]);

impl PlanFile {
    /// From campaigns, at least one, each with its outlooks; periods (d) at which they are compared.
    pub fn new(campaigns: &[Looked], range_d: [f64; 2], compared_d: &[f64], settings: &PlanSettings) -> Self {
        let schedules: Vec<ScheduleRecord> =
            campaigns.iter().map(|looked| ScheduleRecord::new(*looked, range_d, compared_d)).collect();
        let k95 = |k: &usize| schedules[*k].whole().and_then(|whole| whole.k95_kms).unwrap_or(f64::INFINITY);
        let best = (0..schedules.len()).min_by(|a, b| k95(a).total_cmp(&k95(b))).unwrap_or(0) + 1;
        PlanFile {
            false_alarm_probability: CANDIDATE_FAP,
            range_d,
            settings: *settings,
            schedules,
            best,
            provenance: campaigns[0].0.provenance.clone(),
        }
    }

    /// Writes both files into `folder`, which must exist.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn write(&self, campaigns: &[Looked], folder: &Path) -> Result<(), WriteError> {
        let columns = ["schedule", "period_d", "porb_over_prot", "sigma_k_kms", "k50_kms", "k95_kms"];
        let mut table = Table::new(&columns);
        for (k, (campaign, outlooks)) in campaigns.iter().enumerate() {
            let Some(whole) = outlooks.last() else { continue };
            for Expected { porb_over_prot, sigma_k_kms, k50_kms, k95_kms } in whole.everywhere() {
                let period_d = campaign.imager.star.rotation_period_d * porb_over_prot;
                let numbers = [sigma_k_kms, k50_kms, k95_kms].map(|number| number.unwrap_or(f64::NAN));
                table.row(&[&[(k + 1) as f64, period_d, porb_over_prot][..], &numbers].concat());
            }
        }
        let table = table.into_bytes();
        write_set(folder, &|stage| {
            write(&stage.join(CSV), &table)?;
            write_json(&stage.join(JSON), self)
        })
    }

    /// The best schedule.
    pub fn best(&self) -> &ScheduleRecord {
        &self.schedules[self.best - 1]
    }

    /// The printed output.
    pub fn table(&self) -> String {
        let several = self.schedules.len() > 1;
        let mut text = if several { self.comparison() } else { String::new() };
        let best = self.best();
        if several {
            text += &format!("best: {}\n\n", escaped(&best.name));
        }
        if let Some(next) = &best.next {
            text += &next.table();
            text += "\n";
        }
        text += &best.table();
        // for the first config only
        for (label, line) in self.provenance.measured.lines().into_iter().filter(|_| !several) {
            text += &format!("{label}: {line}\n");
        }
        text += "\n";
        for sentence in best.sentences(self.false_alarm_probability) {
            text += &format!("{sentence}\n");
        }
        text
    }

    fn comparison(&self) -> String {
        let unit = unit(self.schedules.iter().filter_map(ScheduleRecord::whole));
        let [sigma, k50, k95] = HEADS.map(|head| format!("{head} ({})", unit.name));
        let head = ["schedule", "nights", "profiles", "time base (d)", &sigma, &k50, &k95];
        let row = |schedule: &ScheduleRecord| {
            let whole = schedule.whole();
            let count = |number: fn(&AfterRecord) -> usize| whole.map_or_else(|| "-".into(), |w| number(w).to_string());
            let k = |number: fn(&AfterRecord) -> Option<f64>| unit.cell(whole.and_then(number));
            vec![
                escaped(&schedule.name).into_owned(),
                count(|w| w.nights),
                count(|w| w.profiles),
                format!("{:.1}", schedule.span_d[1] - schedule.span_d[0]),
                k(|w| w.sigma_k_kms),
                k(|w| w.k50_kms),
                k(|w| w.k95_kms),
            ]
        };
        let rows = std::iter::once(head.map(str::to_owned).to_vec()).chain(self.schedules.iter().map(row));
        aligned(&rows.collect::<Vec<_>>()) + "sigma_K and K: medians over all periods\n"
    }
}

impl ScheduleRecord {
    fn new((campaign, outlooks): Looked, range_d: [f64; 2], compared_d: &[f64]) -> Self {
        let prot = campaign.imager.star.rotation_period_d;
        let compared: Vec<f64> = compared_d.iter().map(|period_d| prot / period_d).collect();
        let after = |outlook: &Outlook| {
            let Expected { sigma_k_kms, k50_kms, k95_kms, .. } = outlook.typical(&compared);
            AfterRecord { nights: outlook.nights, profiles: outlook.profiles, sigma_k_kms, k50_kms, k95_kms }
        };
        let whole = outlooks.last();
        let round: Vec<f64> = ROUND_D.into_iter().filter(|d| (range_d[0]..=range_d[1]).contains(d)).collect();
        let periods = whole.map_or_else(Vec::new, |whole| {
            let expected = whole.at(&round.iter().map(|d| prot / d).collect::<Vec<_>>());
            expected.iter().map(|expected| ExpectedRecord::new(expected, prot, whole)).collect()
        });
        let mut window: Vec<WindowRecord> = whole.map_or_else(Vec::new, |whole| {
            let record = |peak: &crate::planets::periodogram::window::WindowPeak| WindowRecord {
                frequency_per_d: peak.frequency / prot,
                height: peak.height,
            };
            whole.window.iter().map(record).collect()
        });
        window.sort_by(|a, b| b.height.total_cmp(&a.height));
        let spectrum = campaign.assumed.field.spectrum;
        ScheduleRecord {
            name: campaign.name.clone(),
            taken: campaign.before(),
            span_d: campaign.span_d(),
            rotation_period_d: prot,
            snr: 1.0 / campaign.sigma,
            sets: campaign.sets.clone(),
            light_curves: campaign.light_curves(),
            spots: SpotsRecord {
                source: campaign.source,
                spot_amplitude: spectrum.amplitude,
                spot_slope: spectrum.slope,
                spot_break_degree: spectrum.break_degree,
                spot_lifetime_d: campaign.assumed.field.kernel.lifetime.days(),
                velocity_jitter_kms: campaign.assumed.jitter_kms,
            },
            level: whole.map_or(f64::NAN, |whole| whole.level),
            after: outlooks.iter().map(after).collect(),
            periods,
            window,
            next: None,
        }
    }

    /// After all nights.
    pub fn whole(&self) -> Option<&AfterRecord> {
        self.after.last()
    }

    /// Spots, and the expectation after an increasing number of nights and at some periods.
    fn table(&self) -> String {
        let SpotsRecord { source, spot_amplitude, spot_slope, spot_lifetime_d, velocity_jitter_kms, .. } = self.spots;
        let lives = spot_lifetime_d.map_or("static".into(), |d| format!("lifetime {d:.1} d"));
        let mut text = format!(
            "spots {lives}, amplitude {spot_amplitude:.2}, power-law index {spot_slope:.2} ({}); RV jitter \
            {}; S/N {:.0}\n",
            source.words(),
            with_unit(velocity_jitter_kms),
            self.snr
        );
        for SetRecord { name, taken, planned, nights, snr } in &self.sets {
            let snr = snr.map_or_else(String::new, |snr| format!(" of S/N {snr:.0}"));
            text += &format!("{name}: {taken} profiles taken, {planned}{snr} planned in {nights} nights\n");
        }
        for LightRecord { name, bins, planned } in &self.light_curves {
            text += &format!("{name}: {bins} bins{}\n", if *planned { " planned" } else { "" });
        }
        text.push('\n');
        let unit = unit(&self.after);
        let [sigma, k50, k95] = HEADS.map(|head| format!("{head} ({})", unit.name));
        let head = ["nights", "profiles", &sigma, &k50, &k95].map(str::to_owned).to_vec();
        let row = |after: &AfterRecord| {
            let counts = [after.nights, after.profiles].map(|n| n.to_string());
            let numbers = [after.sigma_k_kms, after.k50_kms, after.k95_kms].map(|k| unit.cell(k));
            counts.into_iter().chain(numbers).collect()
        };
        text += &aligned(&std::iter::once(head).chain(self.after.iter().map(row)).collect::<Vec<_>>());
        text += "medians over all periods\n\n";
        let head = ["period_d", &sigma, &k50, &k95].map(str::to_owned).to_vec();
        let row = |at: &ExpectedRecord| {
            let numbers = [at.sigma_k_kms, at.k50_kms, at.k95_kms].map(|k| unit.cell(k));
            std::iter::once(format!("{}", at.period_d)).chain(numbers).collect()
        };
        text + &aligned(&std::iter::once(head).chain(self.periods.iter().map(row)).collect::<Vec<_>>())
    }

    /// Sentences on the results.
    pub fn sentences(&self, false_alarm_probability: f64) -> Vec<String> {
        let mut sentences = Vec::new();
        for at in self.periods.iter().filter(|at| SPOKEN_D.contains(&at.period_d)) {
            if let (Some(k50), Some(k95)) = (at.k50_kms, at.k95_kms) {
                sentences.push(format!(
                    "A planet of K = {} and {} d would be found with 95 % probability, one of {} with 50 %.",
                    speed(k95, 0.1 * k95),
                    at.period_d,
                    speed(k50, 0.1 * k50)
                ));
            }
        }
        let hard: Vec<String> = self
            .periods
            .iter()
            .filter_map(|at| at.imitated.as_ref().map(|words| format!("{} d ({words})", at.period_d)))
            .collect();
        if !hard.is_empty() {
            sentences.push(format!("Degenerate with spot modulation: {}.", hard.join(", ")));
        }
        if !self.window.is_empty() {
            let peak = |peak: &WindowRecord| format!("{:.3}/d ({:.2})", peak.frequency_per_d, peak.height);
            let peaks: Vec<String> = self.window.iter().take(4).map(peak).collect();
            sentences
                .push(format!("Aliases: frequencies shifted by {} (window function in brackets).", peaks.join(", ")));
        }
        if !sentences.is_empty() {
            let percent = 100.0 * false_alarm_probability;
            sentences.push(format!("Detected: FAP < {percent} % in a blind search."));
        }
        sentences
    }
}

impl ExpectedRecord {
    fn new(expected: &Expected, rotation_period_d: f64, outlook: &Outlook) -> Self {
        let Expected { porb_over_prot, sigma_k_kms, k50_kms, k95_kms } = *expected;
        let imitation = outlook.rotation.imitated(porb_over_prot, None).filter(|imitation| imitation.is_likely());
        // division turns 10 d into 10.000000000000002 d
        let period_d = (1e9 * rotation_period_d * porb_over_prot).round() / 1e9;
        let imitated = imitation.map(|imitation| imitation.words(rotation_period_d));
        ExpectedRecord { period_d, porb_over_prot, sigma_k_kms, k50_kms, k95_kms, imitated }
    }
}

impl Choice {
    /// The nights, the gain by each, and the results of other choices.
    fn table(&self) -> String {
        let sigma = |kms: Option<f64>| kms.map_or_else(|| "not bounded".into(), |kms| speed(kms, 0.1 * kms));
        let several = self.chosen.iter().any(|night| night.set.is_some());
        let mut head = ["night", "first time (d)", "profiles", "sigma_K with it"].map(str::to_owned).to_vec();
        head.extend(several.then(|| "data set".to_owned()));
        let row = |(k, night): (usize, &super::ChosenNight)| {
            let first = format!("{:.2}", night.span_d[0]);
            let cells = [(k + 1).to_string(), first, night.profiles.to_string(), sigma(night.sigma_k_kms)];
            cells.into_iter().chain(night.set.clone()).collect()
        };
        let nights = self.chosen.len();
        let last = |of: &[super::Merit]| sigma(of.last().and_then(|merit| merit.sigma_k_kms));
        let now = sigma(self.now.sigma_k_kms);
        let mut text = match &self.aim {
            Aim::Amplitude { period_d, ephemeris } => {
                let at = if ephemeris.is_some() { "at its ephemeris" } else { "mean over phases" };
                format!("next nights, for K of a planet of {period_d} d ({at}): sigma_K is {now} now\n")
            }
            Aim::Alias { period_d, other_d } => format!(
                "next nights, to tell a planet of {period_d} d from one of {other_d} d: sigma_K of what the other \
                period does not take up is {now} now\n"
            ),
        };
        text += &aligned(&std::iter::once(head).chain(self.chosen.iter().enumerate().map(row)).collect::<Vec<_>>());
        text + &format!(
            "{nights} of {} nights: chosen {}, evenly spaced {}, random {} (median)\n",
            self.candidates,
            sigma(self.chosen.last().and_then(|night| night.sigma_k_kms)),
            last(&self.even),
            last(&self.random)
        )
    }
}

/// Heads of tables.
const HEADS: [&str; 3] = ["sigma_K", "K 50 %", "K 95 %"];

/// The unit of K in tables of these.
fn unit<'a>(after: impl IntoIterator<Item = &'a AfterRecord>) -> Speeds {
    let all = after.into_iter().flat_map(|after| [after.sigma_k_kms, after.k50_kms, after.k95_kms]);
    Speeds::of(&all.flatten().collect::<Vec<_>>())
}
