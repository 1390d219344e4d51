//! The rates of a sample: for each box, among all stars and among those of each group.

use super::boxes::PlanetBox;
use super::star::Star;
use crate::planets::occurrence::{Member, RatePosterior, RatePrior};
use serde::{Deserialize, Serialize};

/// The rate of planets in a box.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct RateRecord {
    /// Number of the box, from 1.
    #[serde(rename = "box")]
    pub planets: usize,
    /// The group; null for all stars.
    pub group: Option<String>,
    /// Number of stars.
    pub stars: usize,
    /// Sum of their completeness.
    pub effective_stars: f64,
    /// Signals in the box, each with its probability of being there.
    pub detections: f64,
    /// Expected false detections there, if no star has a planet.
    pub false_alarms: f64,
    /// Those signals.
    pub signals: Vec<SignalRecord>,
    /// The rate of highest likelihood.
    pub most_likely: f64,
    /// Median of the posterior.
    pub median: f64,
    /// Mean of the posterior.
    pub mean: f64,
    /// Credible interval of highest likelihood.
    pub ci68: [f64; 2],
    /// The same at 95 %.
    pub ci95: [f64; 2],
    /// 95 % upper limit, where the likelihood is highest at 0.
    pub upper95: Option<f64>,
    /// Rates.
    pub rate: Vec<f64>,
    /// Density of the posterior at them.
    pub density: Vec<f64>,
}

/// A signal in a box.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SignalRecord {
    /// Name of the star.
    pub name: String,
    /// Probability that its orbit is in the box.
    pub share: f64,
    /// Probability that it is a planet of the box, by the rate and by chance.
    pub reliability: f64,
}

/// For all stars first, then for the groups in the order of appearance, box after box.
pub fn rates(stars: &[Star], boxes: &[PlanetBox], prior: RatePrior) -> Vec<RateRecord> {
    let mut groups: Vec<Option<&str>> = vec![None];
    for group in stars.iter().filter_map(|star| star.group.as_deref()) {
        if !groups.contains(&Some(group)) {
            groups.push(Some(group));
        }
    }
    let mut records = Vec::new();
    for (number, planets) in boxes.iter().enumerate() {
        for group in &groups {
            let counted = stars.iter().filter(|star| star.left_out().is_none());
            let of_group = counted.filter(|star| group.is_none_or(|group| star.group.as_deref() == Some(group)));
            let members: Vec<(&Star, Member)> = of_group.map(|star| (star, star.member(planets))).collect();
            records.push(rate((number + 1, *group), &members, prior));
        }
    }
    records
}

fn rate((number, group): (usize, Option<&str>), stars: &[(&Star, Member)], prior: RatePrior) -> RateRecord {
    let members: Vec<Member> = stars.iter().map(|(_, member)| *member).collect();
    let posterior = RatePosterior::of(&members, prior);
    let signal = |(star, member): &(&Star, Member)| {
        let share = member.signal?.share;
        Some(SignalRecord { name: star.name.clone(), share, reliability: share * posterior.reliability(member) })
    };
    let (rate, density) = posterior.density(prior);
    let most_likely = posterior.most_likely();
    RateRecord {
        planets: number,
        group: group.map(str::to_owned),
        stars: members.len(),
        effective_stars: total(members.iter().map(|member| member.completeness)),
        detections: total(members.iter().filter_map(|member| member.signal).map(|signal| signal.share)),
        false_alarms: total(members.iter().map(|member| member.false_alarm)),
        signals: stars.iter().filter_map(signal).collect(),
        most_likely,
        median: posterior.quantile(0.5),
        mean: posterior.mean(),
        ci68: posterior.interval(0.68),
        ci95: posterior.interval(0.95),
        upper95: (most_likely == 0.0).then(|| posterior.quantile(0.95)),
        rate,
        density,
    }
}

/// Their sum; 0 for none, where that of the standard library is -0.
fn total(numbers: impl Iterator<Item = f64>) -> f64 {
    numbers.fold(0.0, |sum, x| sum + x)
}
