//! The figures of a row: columns of its table against each other, and those of its raw results.

use crate::cases::Failure;
use crate::report::{Panel, Report, Series};
use dimcmc::internals::data::io::atomic;
use dimcmc::internals::figures::drawing::{self, Errors, Figure, ScatterPanel, scatter};
use dimcmc::internals::figures::plot::symbols::label;
use dimcmc::internals::figures::plot::{self, DPI};
use std::path::Path;

/// Draws the figures of a row into `folder`, as PNG; their names.
pub fn write(report: &Report, row: &str, folder: &Path) -> Result<Vec<String>, Failure> {
    let mut figures: Vec<Figure> = figure(report, row).into_iter().collect();
    for drawn in &report.drawn {
        for mut figure in plot::figures(&drawn.folder, drawn.chain.as_deref())? {
            // traces and autocorrelations require the chain
            if figure.name == "corner" || figure.name == "landscape" {
                figure.name = format!("{}_{}", drawn.name, figure.name);
                figures.push(figure);
            }
        }
    }
    let write = |figure: &Figure| {
        let [_, name] = plot::names(figure);
        atomic::write(&folder.join(&name), &figure.png(DPI))?;
        Ok(name)
    };
    figures.iter().map(write).collect()
}

/// The figure of its table; none if that is not meant for plotting.
pub fn figure(report: &Report, row: &str) -> Option<Figure> {
    let mut panels: Vec<ScatterPanel> = report.figure.iter().map(|panel| drawn(panel, report)).collect();
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
    (!panels.is_empty()).then(|| scatter(row, &panels, panels.len().min(3)))
}

fn drawn(panel: &Panel, report: &Report) -> ScatterPanel {
    let index = |name: &str| report.columns.iter().position(|one| one == name).expect("a column of the table");
    let only = panel.only.as_ref().map(|(name, number)| (index(name), *number));
    let shown = || report.rows.iter().filter(move |row| only.is_none_or(|(k, number)| row[k] == number));
    let column = |name: &str| -> Vec<f64> {
        let k = index(name);
        shown().map(|row| row[k]).collect()
    };
    let x = column(&panel.x);
    // coinciding points are separated by a hundredth of the axis
    let reach = x.iter().copied().fold(f64::NEG_INFINITY, f64::max) - x.iter().copied().fold(f64::INFINITY, f64::min);
    let aside = if panel.joined { 0.0 } else { 0.012 * reach };
    let middle = 0.5 * (panel.series.len() as f64 - 1.0);
    let errors = |one: &Series, y: &[f64]| match &one.interval {
        None => Errors::None,
        Some([low, high]) => {
            let ends = column(low).into_iter().zip(column(high));
            Errors::Asymmetric(y.iter().zip(ends).map(|(y, (low, high))| [y - low, high - y]).collect())
        }
    };
    let series = |(k, one): (usize, &Series)| {
        let y = column(&one.y);
        drawing::Series {
            label: one.name.clone(),
            x: x.iter().map(|x| x + aside * (k as f64 - middle)).collect(),
            y_errors: errors(one, &y),
            y,
            joined: panel.joined,
            ..drawing::Series::default()
        }
    };
    let mut series: Vec<drawing::Series> = panel.series.iter().enumerate().map(series).collect();
    if let Some(truth) = &panel.truth {
        let mut line: Vec<(f64, f64)> = x.iter().copied().zip(column(truth)).collect();
        line.sort_by(|a, b| a.0.total_cmp(&b.0));
        let (x, y) = line.into_iter().unzip();
        let injected = drawing::Series { label: "injected".into(), x, y, ..drawing::Series::default() };
        series.push(drawing::Series { joined: true, bare: true, ..injected });
    }
    let x_label = if panel.x == "assumed_deg" { "assumed *i* (°)".into() } else { label(&panel.x) };
    ScatterPanel { x_label, y_label: label(&panel.label), series, ..ScatterPanel::default() }
}
