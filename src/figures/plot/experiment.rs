//! The figure of an experiment: columns of its table against each other, as its summary says.

use super::PlotError;
use super::symbols::label;
use crate::data::io::FileError;
use crate::data::io::csv::Columns;
use crate::figures::drawing::{Errors, Figure, ScatterPanel, Series, scatter};
use crate::runs::experiments::files::{SUMMARY, SummaryFile, TABLE};
use crate::runs::experiments::report::{self, Panel};
use crate::runs::origin;
use std::path::Path;

/// The file by which the folder is known.
pub(super) const FILE: &str = TABLE;

/// The figure of the experiment in `folder`; none if its table is not for the eye.
pub(super) fn figures(folder: &Path) -> Result<Vec<Figure>, PlotError> {
    let summary: SummaryFile = origin::read(folder, SUMMARY)?;
    let table = Columns::read(&folder.join(TABLE))?;
    let mut panels: Vec<ScatterPanel> =
        summary.figure.iter().map(|panel| drawn(panel, &table)).collect::<Result<_, _>>()?;
    // one legend serves all panels of the same series
    let labels = |panel: &ScatterPanel| panel.series.iter().map(|s| s.label.clone()).collect::<Vec<_>>();
    let mut explained: Vec<Vec<String>> = Vec::new();
    for panel in &mut panels {
        let these = labels(panel);
        if explained.contains(&these) {
            panel.series.iter_mut().for_each(|series| series.label.clear());
        } else {
            explained.push(these);
        }
    }
    if panels.is_empty() {
        return Ok(Vec::new());
    }
    Ok(vec![scatter(&summary.row, &panels, panels.len().min(3))])
}

fn drawn(panel: &Panel, table: &Columns) -> Result<ScatterPanel, FileError> {
    let shown: Vec<bool> = match &panel.only {
        Some((name, number)) => table.column(name)?.iter().map(|x| x == number).collect(),
        None => vec![true; table.column(&panel.x)?.len()],
    };
    let column = |name: &str| -> Result<Vec<f64>, FileError> {
        Ok(table.column(name)?.iter().zip(&shown).filter(|(_, shown)| **shown).map(|(x, _)| *x).collect())
    };
    let x = column(&panel.x)?;
    // what lies in the same place is moved apart by a hundredth of the axis
    let reach = x.iter().copied().fold(f64::NEG_INFINITY, f64::max) - x.iter().copied().fold(f64::INFINITY, f64::min);
    let aside = if panel.joined { 0.0 } else { 0.012 * reach };
    let middle = 0.5 * (panel.series.len() as f64 - 1.0);
    let mut series: Vec<Series> = Vec::new();
    for (k, one) in panel.series.iter().enumerate() {
        let y = column(&one.y)?;
        series.push(Series {
            label: one.name.clone(),
            x: x.iter().map(|x| x + aside * (k as f64 - middle)).collect(),
            y_errors: errors(one, &y, &column)?,
            y,
            joined: panel.joined,
            ..Series::default()
        });
    }
    if let Some(truth) = &panel.truth {
        let mut line: Vec<(f64, f64)> = x.iter().copied().zip(column(truth)?).collect();
        line.sort_by(|a, b| a.0.total_cmp(&b.0));
        let (x, y) = line.into_iter().unzip();
        series.push(Series { label: "injected".into(), x, y, joined: true, bare: true, ..Series::default() });
    }
    Ok(ScatterPanel { x_label: label(&panel.x), y_label: label(&panel.label), series, ..ScatterPanel::default() })
}

fn errors(
    series: &report::Series,
    y: &[f64],
    column: &dyn Fn(&str) -> Result<Vec<f64>, FileError>,
) -> Result<Errors, FileError> {
    let Some([low, high]) = &series.interval else { return Ok(Errors::None) };
    let ends = column(low)?.into_iter().zip(column(high)?);
    Ok(Errors::Asymmetric(y.iter().zip(ends).map(|(y, (low, high))| [y - low, high - y]).collect()))
}
