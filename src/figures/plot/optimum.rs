//! The optimum: the Gaussian of its curvature, as a corner plot.

use super::PlotError;
use super::corner::Corner;
use super::ephemeris::ephemeris;
use super::symbols::{Shown, Title, nearest_turn};
use super::trace::TRUTH;
use crate::figures::drawing::colour::BLUE;
use crate::figures::drawing::{Axis, Figure, Key, Legend, Paint, Panel, Rect, Scale, Stroke, panel::gaussian_contour};
use crate::model::Parameter;
use crate::runs::optimum::{FILE, OptimumFile};
use crate::runs::origin;
use std::path::Path;

/// Standard deviations that contain 95 and 68 % of a Gaussian of two parameters.
const RADII: [f64; 2] = [2.448, 1.510];

/// The figure; none where there is no well-defined maximum.
pub(super) fn figures(folder: &Path) -> Result<Vec<Figure>, PlotError> {
    let file: OptimumFile = origin::read(folder, FILE)?;
    let n = file.names.len();
    let whole = file.covariance.len() == n
        && file.covariance.iter().all(|row| row.len() == n)
        && file
            .names
            .iter()
            .all(|name| file.optimum.parameters.contains_key(name) && file.optimum.sd.contains_key(name));
    if !whole {
        return Err(PlotError::Content {
            path: folder.join(FILE),
            problem: "names and values do not belong together".into(),
        });
    }
    let best: Vec<f64> = file.names.iter().map(|name| file.optimum.parameters[name]).collect();
    let sd: Vec<f64> = file.names.iter().map(|name| file.optimum.sd[name]).collect();
    if !file.well_defined || sd.iter().any(|sd| !(*sd > 0.0 && sd.is_finite())) {
        let problem = "no well-defined maximum, so there are no error bars to draw".into();
        return Err(PlotError::Content { path: folder.join(FILE), problem });
    }
    let rotation_period_d = ephemeris(&file.provenance.config).map(|(period_d, _)| period_d);
    let shown = |i: usize| Shown::of(&file.names[i], rotation_period_d, best[i] + 2.0 * sd[i]);
    let shown: Vec<Shown> = (0..n).map(shown).collect();
    let factor = |i: usize| shown[i].factor;
    let truth = |i: usize| {
        let truth = *file.truth.as_ref()?.get(&file.names[i])?;
        let periodic = Parameter::from_name(&file.names[i]).is_some_and(Parameter::is_phase);
        Some(factor(i) * if periodic { nearest_turn(truth, best[i]) } else { truth })
    };
    let title = |i: usize| Title::value(&shown[i], best[i], [sd[i]; 2], sd[i]);
    let corner = Corner {
        shown: &shown,
        ranges: (0..n).map(|i| [best[i] - 3.6 * sd[i], best[i] + 3.6 * sd[i]].map(|x| factor(i) * x)).collect(),
        // an ellipse requires linear axes
        scales: vec![Scale::Linear; n],
        truth: (0..n).map(truth).collect(),
        titles: (0..n).map(title).collect(),
    };
    let diagonal = |figure: &mut Figure, frame: Rect, x: Axis, i: usize| {
        let panel = Panel { frame, y: Axis::linear("", [0.0, 1.12]), x };
        let at = |u: f64| [factor(i) * (best[i] + u * sd[i]), (-0.5 * u * u).exp()];
        let bell: Vec<[f64; 2]> = (-72..=72).map(|k| at(f64::from(k) / 20.0)).collect();
        panel.area(figure, "bell", &bell, Paint::fill(super::corner::area_colours()[0]));
        panel.line(figure, "bell", &bell, Stroke::new(BLUE, 0.8));
    };
    let pair = |figure: &mut Figure, panel: &Panel, i: usize, j: usize| {
        let c = |i: usize, j: usize| factor(i) * factor(j) * file.covariance[i][j];
        let centre = [factor(i) * best[i], factor(j) * best[j]];
        for (radius, colour) in RADII.into_iter().zip(super::corner::area_colours()) {
            let ellipse = gaussian_contour(centre, [[c(i, i), c(i, j)], [c(j, i), c(j, j)]], radius);
            let paint = Paint { fill: Some(colour), stroke: Some(Stroke::new(BLUE, 0.7)), sharp: false };
            panel.area(figure, "ellipse", &ellipse, paint);
        }
    };
    let mut legend = Legend::default();
    legend.add(Key::Area(super::corner::area_colours()[1]), "68 % by the curvature");
    legend.add(Key::Area(super::corner::area_colours()[0]), "95 % by the curvature");
    if file.truth.is_some() {
        legend.add(Key::Line(TRUTH), "injected");
    }
    let mut figure = corner.draw("optimum", diagonal, pair, &legend);
    figure.caption =
        "The best parameters with the Gaussian of the curvature of the log-probability around them: ellipses of 68 \
        and 95 %, values with one standard deviation."
            .into();
    Ok(vec![figure])
}
