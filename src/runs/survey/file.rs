//! The files of a survey: `survey.csv`, one line per star; `completeness.csv`, star by star and summed; and
//! `survey.json`; and the printed output.

use super::SurveySettings;
use super::boxes::{PlanetBox, Size};
use super::rates::{RateRecord, rates};
use super::star::Star;
use crate::data::io::atomic::{WriteError, write, write_json, write_set};
use crate::data::io::csv::{Table, quoted};
use crate::data::io::saved::Saved;
use crate::numerics::text::{Align, columns, escaped};
use crate::planets::occurrence::RatePrior;
use crate::planets::verdict::{Finding, probability};
use crate::runs::limits::even_in_logarithm;
use crate::star::planet::minimum_mass;
use serde::{Deserialize, Serialize};
use std::path::Path;

/// Names of the files.
pub const CSV: &str = "survey.csv";
/// See [`CSV`].
pub const COMPLETENESS: &str = "completeness.csv";
/// See [`CSV`].
pub const JSON: &str = "survey.json";

/// Periods (d) at which limits are quoted, with the names of their columns in `survey.csv`.
const QUOTED: [(f64, &str); 3] = [(1.0, "k95_kms_1d"), (3.0, "k95_kms_3d"), (10.0, "k95_kms_10d")];

/// Why completeness is lower than it could be.
const NOT_SEARCHED: &str = "not all periods were searched; completeness is 0 at the others";
const NOT_INJECTED: &str = "planets smaller than those injected would be found, and count as missed; repeat \
                            `dimcmc limits` with a smaller --min-k-kms";

/// Periods, and semi-amplitudes or masses, of `completeness.csv`.
const PERIODS: usize = 40;
const SIZES: usize = 30;

/// The content of `survey.json`.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct SurveyFile {
    /// Prior of each rate.
    pub prior: RatePrior,
    /// FAP below which a signal counts.
    pub false_alarm_probability: f64,
    /// Boxes of planets.
    pub boxes: Vec<BoxRecord>,
    /// The stars.
    pub stars: Vec<StarRecord>,
    /// Rates of each box, for all stars and for groups.
    pub rates: Vec<RateRecord>,
    /// Warnings.
    pub warnings: Vec<String>,
    /// Version of the program.
    pub version: String,
}

impl Saved for SurveyFile {
    fn check(&self) -> Result<(), String> {
        let boxes = self.boxes.len();
        let is_box =
            |of: &BoxRecord| of.period_d[0] < of.period_d[1] && (of.k_kms.is_some() != of.msini_mjup.is_some());
        let is_whole = |star: &StarRecord| star.completeness.len() == boxes && star.false_alarms.len() == boxes;
        match () {
            () if boxes == 0 => Err("boxes: empty, one at least is due".into()),
            () if !self.boxes.iter().all(is_box) => Err("boxes: period_d must rise, with k_kms or msini_mjup".into()),
            () if !self.stars.iter().all(is_whole) => {
                Err(format!("stars: completeness and false_alarms must have {boxes} numbers each, one for each box"))
            }
            () if !self.rates.iter().all(|of| (1..=boxes).contains(&of.planets)) => {
                Err(format!("rates: box must be from 1 to {boxes}"))
            }
            () if !self.rates.iter().all(|of| of.rate.len() == of.density.len() && !of.rate.is_empty()) => {
                Err("rates: rate and density must have the same number of values, one at least".into())
            }
            () => Ok(()),
        }
    }
}

/// A box of planets.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct BoxRecord {
    /// Shortest and longest period (d).
    pub period_d: [f64; 2],
    /// Smallest and largest semi-amplitude (km/s); null for a box of masses.
    pub k_kms: Option<[f64; 2]>,
    /// Smallest and largest minimum mass (Jupiter masses); null for a box of semi-amplitudes.
    pub msini_mjup: Option<[f64; 2]>,
}

/// A star.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct StarRecord {
    /// Its name.
    pub name: String,
    /// Its group, where the table has one.
    pub group: Option<String>,
    /// Whether it counts in rates.
    pub counted: bool,
    /// The result of the search.
    pub finding: Finding,
    /// Its FAP.
    pub false_alarm_probability: Option<f64>,
    /// The best orbit.
    pub period_d: Option<f64>,
    /// Its semi-amplitude (km/s).
    pub k_kms: Option<f64>,
    /// Its uncertainty (km/s).
    pub sigma_k_kms: Option<f64>,
    /// Its minimum mass (Jupiter masses), where the star's mass is known.
    pub msini_mjup: Option<f64>,
    /// Mass of the star (solar masses).
    pub mass_msun: Option<f64>,
    /// K recovered at 95 % of the phases (km/s) at the periods 1, 3 and 10 d.
    pub k95_kms: Vec<Option<f64>>,
    /// Mean completeness over each box.
    pub completeness: Vec<f64>,
    /// Probability of a false alarm in each box.
    pub false_alarms: Vec<f64>,
}

impl BoxRecord {
    fn of(planets: &PlanetBox) -> Self {
        let sizes = |size: Size| (planets.size == size).then_some(planets.sizes);
        BoxRecord { period_d: planets.periods_d, k_kms: sizes(Size::Amplitude), msini_mjup: sizes(Size::Mass) }
    }

    /// The box; its sizes are 0 where the record has none.
    pub fn planets(&self) -> PlanetBox {
        let (sizes, size) = match (self.k_kms, self.msini_mjup) {
            (Some(sizes), _) => (sizes, Size::Amplitude),
            (None, sizes) => (sizes.unwrap_or_default(), Size::Mass),
        };
        PlanetBox { periods_d: self.period_d, sizes, size }
    }
}

impl StarRecord {
    fn of(star: &Star, boxes: &[PlanetBox]) -> Self {
        let signal = star.verdict.signal;
        let members: Vec<_> = boxes.iter().map(|planets| star.member(planets)).collect();
        StarRecord {
            name: star.name.clone(),
            group: star.group.clone(),
            counted: star.left_out().is_none(),
            finding: star.verdict.finding,
            false_alarm_probability: star.verdict.false_alarm_probability,
            period_d: signal.map(|signal| signal.period_d),
            k_kms: signal.map(|signal| signal.k_kms),
            sigma_k_kms: signal.map(|signal| signal.sigma_k_kms),
            msini_mjup: signal.and_then(|signal| star.msini_mjup(signal.period_d, signal.k_kms)),
            mass_msun: star.mass_msun,
            k95_kms: QUOTED.iter().map(|(period, _)| star.limit_kms(*period, |limit| limit.k95_kms)).collect(),
            completeness: members.iter().map(|member| member.completeness).collect(),
            false_alarms: members.iter().map(|member| member.false_alarm).collect(),
        }
    }
}

impl SurveyFile {
    /// For some stars.
    pub(super) fn new(stars: &[Star], settings: &SurveySettings) -> Self {
        let SurveySettings { boxes, prior, .. } = settings;
        let mut warnings = Vec::new();
        for star in stars {
            let own = star.left_out().map(str::to_owned).into_iter().chain(star.warnings.iter().cloned());
            warnings.extend(own.map(|warning| format!("{}: {warning}", star.name)));
        }
        for (k, planets) in boxes.iter().enumerate() {
            let of = |is: &dyn Fn(&Star) -> bool, problem: &str| {
                let counted = stars.iter().filter(|star| star.left_out().is_none());
                let names: Vec<&str> = counted.filter(|star| is(star)).map(|star| star.name.as_str()).collect();
                (!names.is_empty()).then(|| format!("box {}: {problem}: {}", k + 1, names.join(", ")))
            };
            warnings.extend(of(&|star| !star.covers_periods(planets), NOT_SEARCHED));
            warnings.extend(of(&|star| star.finds_smaller(planets), NOT_INJECTED));
        }
        SurveyFile {
            prior: *prior,
            false_alarm_probability: stars.first().map_or(f64::NAN, |star| star.limits.false_alarm_probability),
            boxes: boxes.iter().map(BoxRecord::of).collect(),
            stars: stars.iter().map(|star| StarRecord::of(star, boxes)).collect(),
            rates: rates(stars, boxes, *prior),
            warnings,
            version: env!("CARGO_PKG_VERSION").to_owned(),
        }
    }

    /// Writes the files into `folder`, which must exist.
    pub(super) fn write(&self, stars: &[Star], folder: &Path) -> Result<(), WriteError> {
        let (of_stars, completeness) = (self.of_stars().into_bytes(), completeness(stars).into_bytes());
        write_set(folder, &|stage| {
            write(&stage.join(CSV), &of_stars)?;
            write(&stage.join(COMPLETENESS), &completeness)?;
            write_json(&stage.join(JSON), self)
        })
    }

    /// `survey.csv`.
    fn of_stars(&self) -> Table {
        let first = ["name", "group", "counted", "finding", "false_alarm_probability", "period_d", "k_kms"];
        let then = ["sigma_k_kms", "msini_mjup", "mass_msun"];
        let names: Vec<&str> = first.into_iter().chain(then).chain(QUOTED.map(|(_, name)| name)).collect();
        let mut table = Table::new(&[&names[..], &["completeness"]].concat());
        // tiny FAPs with an exponent
        let number = |x: Option<f64>| x.map_or_else(String::new, |x| format!("{x:?}"));
        for star in &self.stars {
            let words = [
                quoted(&star.name),
                quoted(star.group.as_deref().unwrap_or_default()),
                u8::from(star.counted).to_string(),
                finding(star.finding).to_owned(),
            ];
            let signal = [star.period_d, star.k_kms, star.sigma_k_kms, star.msini_mjup, star.mass_msun];
            let numbers =
                std::iter::once(star.false_alarm_probability).chain(signal).chain(star.k95_kms.iter().copied());
            let numbers = numbers.chain([star.completeness.first().copied()]).map(number);
            table.cells(words.into_iter().chain(numbers));
        }
        table
    }

    /// The printed output.
    pub fn table(&self) -> String {
        let mut text = self.table_of_stars();
        let prior = match self.prior {
            RatePrior::Uniform => "uniform",
            RatePrior::Jeffreys => "Jeffreys",
        };
        for (k, planets) in self.boxes.iter().enumerate() {
            text += &format!(
                "\nbox {}: {}; rate of stars with such a planet, {prior} prior\n",
                k + 1,
                planets.planets().words()
            );
            let head = [
                "stars of",
                "number",
                "effective",
                "detections",
                "by chance",
                "rate (%)",
                "68 % interval",
                "95 % interval",
            ];
            let mut rows = vec![head.map(str::to_owned).to_vec()];
            rows.extend(self.rates.iter().filter(|rate| rate.planets == k + 1).map(RateRecord::row));
            let aligns: Vec<Align> = (0..head.len()).map(|k| if k == 0 { Align::Left } else { Align::Right }).collect();
            text += &columns(&rows, &aligns);
        }
        for warning in &self.warnings {
            text += &format!("warning: {}\n", escaped(warning));
        }
        text
    }

    fn table_of_stars(&self) -> String {
        let mut head = ["star", "verdict", "FAP", "P (d)", "K (km/s)"].map(str::to_owned).to_vec();
        head.extend(QUOTED.iter().map(|(period, _)| format!("K95 {period} d")));
        head.push("completeness".into());
        let or_none = |x: Option<f64>, digits: usize| x.map_or_else(|| "-".to_owned(), |x| format!("{x:.digits$}"));
        let row = |star: &StarRecord| {
            let verdict = match star.finding {
                Finding::NoPlanetNeeded => "no signal",
                Finding::Candidate => "candidate",
                Finding::Detection => "detection",
                Finding::NotJudged => "no verdict",
            };
            let mut cells = vec![escaped(&star.name).into_owned(), verdict.to_owned()];
            cells.push(star.false_alarm_probability.map_or_else(|| "-".to_owned(), probability));
            cells.extend([or_none(star.period_d, 3), or_none(star.k_kms, 3)]);
            cells.extend(star.k95_kms.iter().map(|k| or_none(*k, 3)));
            cells.push(or_none(star.completeness.first().copied(), 2));
            cells
        };
        let aligns: Vec<Align> = (0..head.len()).map(|k| if k < 2 { Align::Left } else { Align::Right }).collect();
        columns(&std::iter::once(head).chain(self.stars.iter().map(row)).collect::<Vec<_>>(), &aligns)
    }
}

impl RateRecord {
    fn row(&self) -> Vec<String> {
        let percent = |[low, high]: [f64; 2]| format!("{:.1} to {:.1}", 100.0 * low, 100.0 * high);
        let rate = match self.upper95 {
            Some(upper) => format!("< {:.1} (95 %)", 100.0 * upper),
            None => format!("{:.1}", 100.0 * self.most_likely),
        };
        vec![
            self.group.as_deref().map_or_else(|| "all".to_owned(), |group| escaped(group).into_owned()),
            self.stars.to_string(),
            format!("{:.1}", self.effective_stars),
            format!("{:.1}", self.detections),
            format!("{:.2}", self.false_alarms),
            rate,
            percent(self.ci68),
            percent(self.ci95),
        ]
    }
}

/// A finding in the notation of files.
fn finding(finding: Finding) -> &'static str {
    match finding {
        Finding::NoPlanetNeeded => "no-planet-needed",
        Finding::Candidate => "candidate",
        Finding::Detection => "detection",
        Finding::NotJudged => "not-judged",
    }
}

/// `completeness.csv`: every counted star by its number in `survey.csv`, from 1, on periods and semi-amplitudes common
/// to all; and as star 0 the sum over them, by semi-amplitude and, where all masses are known, by minimum mass.
fn completeness(stars: &[Star]) -> Table {
    let mut table = Table::new(&["star", "period_d", "k_kms", "msini_mjup", "completeness"]);
    let counted: Vec<(usize, &Star)> =
        stars.iter().enumerate().filter(|(_, star)| star.left_out().is_none()).map(|(k, star)| (k + 1, star)).collect();
    if counted.is_empty() {
        return table;
    }
    let range = |numbers: &mut dyn Iterator<Item = f64>| {
        numbers.fold([f64::INFINITY, 0.0], |[low, high], x| [f64::min(low, x), f64::max(high, x)])
    };
    let [shortest, longest] = range(&mut counted.iter().flat_map(|(_, star)| star.searched_d()));
    let [smallest, largest] = range(&mut counted.iter().flat_map(|(_, star)| star.limits.k_kms.iter().copied()));
    let periods = even_in_logarithm(shortest, longest, PERIODS);
    let amplitudes = even_in_logarithm(smallest, largest, SIZES);
    let unknown = f64::NAN;
    for (number, star) in &counted {
        for (period, k) in pairs(&periods, &amplitudes) {
            let mass = star.msini_mjup(period, k).unwrap_or(unknown);
            table.row(&[*number as f64, period, k, mass, star.completeness.at(period, k)]);
        }
    }
    for (period, k) in pairs(&periods, &amplitudes) {
        let sum = counted.iter().map(|(_, star)| star.completeness.at(period, k)).sum();
        table.row(&[0.0, period, k, unknown, sum]);
    }
    let masses: Option<Vec<f64>> = counted.iter().map(|(_, star)| star.mass_msun).collect();
    if let Some(masses) = masses {
        let [lightest, heaviest] = range(&mut masses.iter().copied());
        let least = minimum_mass(smallest, shortest, lightest).mjup;
        let most = minimum_mass(largest, longest, heaviest).mjup;
        let planets = PlanetBox { size: Size::Mass, ..PlanetBox::HOT_JUPITERS };
        for (period, mass) in pairs(&periods, &even_in_logarithm(least, most, SIZES)) {
            let of = |star: &Star| star.completeness.at(period, planets.k_kms(period, mass, star.mass_msun));
            table.row(&[0.0, period, unknown, mass, counted.iter().map(|(_, star)| of(star)).sum()]);
        }
    }
    table
}

fn pairs<'a>(first: &'a [f64], second: &'a [f64]) -> impl Iterator<Item = (f64, f64)> + 'a {
    first.iter().flat_map(move |a| second.iter().map(move |b| (*a, *b)))
}
