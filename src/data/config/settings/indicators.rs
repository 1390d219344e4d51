//! The activity indicators.

use super::checks::{check_windows, names};
use crate::data::config::error::Fault;
use crate::data::config::written::Config;
use std::path::{Path, PathBuf};

/// An activity indicator.
#[derive(Clone, Debug)]
pub struct IndicatorSettings {
    /// Its key in the config.
    pub key: String,
    /// Its name.
    pub name: String,
    /// Its table, relative to the working directory.
    pub path: PathBuf,
    /// Windows `[start, end]` (d) whose values are left out.
    pub exclude: Vec<[f64; 2]>,
}

/// Resolves the indicators of `written`. `config` is the config's path, whose folder paths start from.
pub(super) fn resolve_indicators(written: &Config, config: &Path) -> Result<Vec<IndicatorSettings>, Fault> {
    let Some(indicators) = &written.indicators else { return Ok(Vec::new()) };
    if !written.imaging.objective.properties().has_field {
        let problem = format!(
            "imaging.objective {:?} has no model of activity indicators: set \"marginal-likelihood\"",
            written.imaging.objective.name()
        );
        return Err(Fault::new("indicators", problem));
    }
    let sections = &indicators.sections;
    let mut all = Vec::new();
    for (s, section) in sections.iter().enumerate() {
        let key = indicators.key(s);
        if section.path.as_os_str().is_empty() {
            return Err(Fault::new(format!("{key}.path"), "is empty"));
        }
        check_windows(&section.exclude, &format!("{key}.exclude"))?;
        let usual_name = if sections.len() == 1 { "indicator".to_owned() } else { format!("indicator{}", s + 1) };
        all.push(IndicatorSettings {
            name: section.name.clone().unwrap_or(usual_name),
            path: config.parent().unwrap_or(Path::new("")).join(&section.path),
            exclude: section.exclude.clone(),
            key,
        });
    }
    names(&all.iter().map(|indicator| (&*indicator.key, &*indicator.name)).collect::<Vec<_>>())?;
    Ok(all)
}
