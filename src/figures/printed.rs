//! The printed output of a command, from the files of its folder alone.

use super::plot::PlotError;
use crate::runs::grid_scan::{self, GridScanError};
use crate::runs::{blind_search, comparison, limits, optimum, origin, plan, survey};
use std::path::Path;

/// The output when `file` was written into `folder`; `None` where the file does not contain all of it.
///
/// # Errors
/// [`PlotError`]: files that are missing or wrong.
pub fn printed(folder: &Path, file: &str) -> Result<Option<String>, PlotError> {
    Ok(Some(match file {
        blind_search::FILE => origin::read::<blind_search::PeriodogramFile>(folder, blind_search::FILE)?.printed(),
        limits::JSON => origin::read::<limits::LimitsFile>(folder, limits::JSON)?.table(),
        plan::JSON => origin::read::<plan::PlanFile>(folder, plan::JSON)?.table(),
        optimum::FILE => origin::read::<optimum::OptimumFile>(folder, optimum::FILE)?.table(),
        survey::JSON => origin::read::<survey::SurveyFile>(folder, survey::JSON)?.table(),
        comparison::FILE => origin::read::<comparison::Comparison>(folder, comparison::FILE)?.table(),
        grid_scan::HEADER => grid_scan::printed(folder).map_err(|error| match error {
            GridScanError::Origin(error) => PlotError::Origin(error),
            GridScanError::Journal(error) => PlotError::Journal(error),
            error => PlotError::Content { path: folder.join(grid_scan::NODES), problem: error.to_string() },
        })?,
        _ => return Ok(None),
    }))
}
