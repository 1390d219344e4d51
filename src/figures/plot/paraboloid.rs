//! The paraboloid of a likelihood grid: ellipses above its minimum, sections by a plane or projections onto it.

use super::symbols::nearest_turn;
use crate::figures::drawing::colour::VERMILION;
use crate::figures::drawing::panel::gaussian_contour;
use crate::figures::drawing::{Figure, Panel, Stroke};
use crate::sampling::landscape::{self, Axis, Grid};
use nalgebra::DMatrix;

/// The pen of its lines.
pub(super) const PEN: Stroke = Stroke::new(VERMILION, 1.0);

/// A paraboloid, in the order of the axes and in their cycles.
pub(super) struct Paraboloid {
    pub vertex: Vec<f64>,
    pub error: Vec<f64>,
    covariance: DMatrix<f64>,
}

impl Paraboloid {
    pub fn of(found: &landscape::Paraboloid, grid: &Grid, nodes: &[Vec<f64>]) -> Option<Self> {
        let (parameters, rows) = (&found.parameters, &found.covariance);
        let n = grid.axes.len();
        if rows.len() != n || rows.iter().any(|row| row.len() != n) {
            return None;
        }
        let one = |k: usize| parameters.get(&grid.axes[k].name);
        let vertex = (0..n).map(|k| one(k).map(|v| turned(&grid.axes[k], &nodes[k], v.vertex)));
        Some(Paraboloid {
            vertex: vertex.collect::<Option<_>>()?,
            error: (0..n).map(|k| one(k).map(|v| v.error)).collect::<Option<_>>()?,
            covariance: DMatrix::from_fn(n, n, |i, j| rows[i][j]),
        })
    }

    /// The ellipses at a given Delta chi2 above the minimum: projected onto the plane, with error bars (Delta chi2 = 1)
    /// as a cross at the vertex, or cut by the plane through the vertex.
    pub fn draw(&self, figure: &mut Figure, panel: &Panel, [i, j]: [usize; 2], levels: &[f64], projected: bool) {
        let centre = [self.vertex[i], self.vertex[j]];
        let square = |m: &DMatrix<f64>| [[m[(i, i)], m[(i, j)]], [m[(j, i)], m[(j, j)]]];
        let ellipse = match projected {
            true => Some(square(&self.covariance)),
            false => self.covariance.clone().try_inverse().and_then(|inverse| invert(square(&inverse))),
        };
        for (covariance, level) in
            ellipse.iter().flat_map(|covariance| levels.iter().map(move |level| (covariance, level)))
        {
            let line = gaussian_contour(centre, *covariance, level.sqrt());
            panel.line(figure, "paraboloid", &line, PEN);
        }
        if projected {
            let [x, y] = centre;
            let pen = Stroke::new(VERMILION, 0.8);
            panel.bar(figure, "vertex", [[x - self.error[i], y], [x + self.error[i], y]], 0.0, pen);
            panel.bar(figure, "vertex", [[x, y - self.error[j]], [x, y + self.error[j]]], 0.0, pen);
        }
    }
}

fn invert([[a, b], [c, d]]: [[f64; 2]; 2]) -> Option<[[f64; 2]; 2]> {
    let determinant = a * d - b * c;
    (determinant > 0.0).then(|| [[d / determinant, -b / determinant], [-c / determinant, a / determinant]])
}

/// A value in the cycle of the axis.
pub(super) fn turned(axis: &Axis, nodes: &[f64], x: f64) -> f64 {
    if axis.periodic { nearest_turn(x, 0.5 * (nodes[0] + nodes[nodes.len() - 1])) } else { x }
}
