//! Planned observations.

use super::checks::{check_size, most, positive};
use super::observations::DataSetSettings;
use super::photometry::{LightCurveSettings, check_light};
use super::simulation::{check_schedule, scheduled};
use crate::data::config::error::Fault;
use crate::data::config::written::{Config, PlanSection, PlannedLight};
use crate::data::simulate::Site;
use crate::star::Band;

/// Profiles that are planned for a data set.
#[derive(Clone, Debug)]
pub struct PlannedProfiles {
    /// Their key in the config.
    pub key: String,
    /// Number of their data set, from 0.
    pub set: usize,
    /// The band of their photometry.
    pub band: Band,
    /// As written.
    pub section: PlanSection,
}

/// The planned observations, checked.
pub(super) fn resolve_plan(
    written: &Config,
    sets: &[DataSetSettings],
    curves: &[LightCurveSettings],
) -> Result<Vec<PlannedProfiles>, Fault> {
    let Some(plans) = &written.plan else { return Ok(Vec::new()) };
    let of = |(p, plan): (usize, &PlanSection)| {
        let key = plans.key(p);
        check_plan(plan, &key)?;
        let names: Vec<&str> = sets.iter().map(|set| &*set.name).collect();
        let set = named(plan.set.as_deref(), &names, &format!("{key}.set"))?.unwrap_or(0);
        let is_same = |other: &PlanSection| named(other.set.as_deref(), &names, &key).is_ok_and(|of| of == Some(set));
        if let Some(other) = plans.sections[..p].iter().position(is_same) {
            let problem =
                format!("{} is planned in {} already: one section for each data set", names[set], plans.key(other));
            return Err(Fault::new(format!("{key}.set"), problem));
        }
        let names: Vec<&str> = curves.iter().map(|curve| &*curve.name).collect();
        let name = plan.photometry.as_ref().and_then(|light| light.name.as_deref());
        let curve = named(name, &names, &format!("{key}.photometry.name"))?;
        let band = curve.map_or(Band::default(), |c| curves[c].band);
        Ok(PlannedProfiles { key, set, band, section: plan.clone() })
    };
    plans.sections.iter().enumerate().map(of).collect()
}

/// Which of these `names` it is, by default the last.
fn named(name: Option<&str>, names: &[&str], key: &str) -> Result<Option<usize>, Fault> {
    match name {
        None => Ok(names.len().checked_sub(1)),
        Some(name) => names.iter().position(|one| *one == name).map(Some).ok_or_else(|| {
            let cure = if names.is_empty() { "leave it out, there is none".into() } else { names.join(", ") };
            Fault::new(key, format!("{name:?} is not there: {cure}"))
        }),
    }
}

fn check_plan(plan: &PlanSection, key: &str) -> Result<(), Fault> {
    let at = |field: &str| format!("{key}.{field}");
    check_schedule(&plan.schedule, &at("schedule"))?;
    scheduled(&plan.schedule, &at("schedule"), 0.0)?;
    if let Some(first_d) = plan.first_d {
        check_size(&at("first_d"), first_d, most::TIME)?;
    }
    if let Some(times_d) = &plan.times_d {
        if times_d.is_empty() {
            return Err(Fault::new(at("times_d"), "is empty, give one time at least"));
        }
        times_d.iter().try_for_each(|time_d| check_size(&at("times_d"), *time_d, most::TIME))?;
    }
    if let Some((field, problem)) = plan.site.as_ref().and_then(Site::fault) {
        return Err(Fault::new(at(&format!("site.{field}")), problem));
    }
    if let Some(PlannedLight { cadence_d, sigma, .. }) = plan.photometry {
        check_light(&at("photometry"), cadence_d, sigma)?;
    }
    plan.snr.map_or(Ok(()), |snr| positive(&at("snr"), snr))
}
