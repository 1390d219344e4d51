//! The velocity axis of a profile: uniform, in km/s, and the same for all profiles of a star.

use super::row::{Fault, Row, fault};

/// A uniform velocity axis (km/s).
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Axis {
    pub first: f64,
    pub step: f64,
    pub bins: usize,
}

/// How far a point may be off the uniform axis, in steps.
const UNIFORMITY: f64 = 0.01;

/// Velocities of this size (km/s) are in another unit.
const BEYOND_SENSE_KMS: f64 = 1e4;

impl Axis {
    /// The axis through the first and last row, if every row lies on it.
    pub fn through(rows: &[Row]) -> Result<Self, Fault> {
        if let Some(pair) = rows.windows(2).find(|p| p[1].velocity <= p[0].velocity) {
            let (before, here) = (pair[0].velocity, pair[1].velocity);
            return fault(pair[1].line, format!("velocity {here} km/s does not increase from {before}"));
        }
        if let Some(row) = rows.iter().find(|row| row.velocity.abs() >= BEYOND_SENSE_KMS) {
            return fault(row.line, format!("velocity {} km/s is too large; is it in m/s?", row.velocity));
        }
        let first = rows[0].velocity;
        let axis =
            Axis { first, step: (rows[rows.len() - 1].velocity - first) / (rows.len() - 1) as f64, bins: rows.len() };
        match (0..rows.len()).all(|j| axis.deviation(rows, j) <= UNIFORMITY) {
            true => Ok(axis),
            false => Err(axis.culprit(rows)),
        }
    }

    /// By how many steps row `j` is off the axis.
    fn deviation(&self, rows: &[Row], j: usize) -> f64 {
        (rows[j].velocity - self.at(j)).abs() / self.step
    }

    /// The first point that breaks the usual step; where none does, the axis drifts and its worst point is named.
    fn culprit(&self, rows: &[Row]) -> Fault {
        let steps: Vec<f64> = rows.windows(2).map(|p| p[1].velocity - p[0].velocity).collect();
        let mut sorted = steps.clone();
        sorted.sort_by(f64::total_cmp);
        let usual = sorted[sorted.len() / 2];
        let breaks = steps.iter().position(|s| (s - usual).abs() > UNIFORMITY * usual).map(|j| j + 1);
        let by_deviation = |a: &usize, b: &usize| self.deviation(rows, *a).total_cmp(&self.deviation(rows, *b));
        let j = breaks.or_else(|| (0..rows.len()).max_by(by_deviation)).unwrap_or(0);
        let step = steps[j.max(1) - 1];
        let problem = format!("velocity axis is not uniform: a step of {step:.6} km/s where {usual:.6} is usual");
        Fault { line: rows[j].line, problem }
    }

    /// Velocity of bin `j`.
    pub fn at(&self, j: usize) -> f64 {
        self.first + j as f64 * self.step
    }

    /// Whether both ends agree within 1 % of a step.
    pub fn agrees_with(&self, other: &Axis) -> bool {
        let close = |a: f64, b: f64| (a - b).abs() <= UNIFORMITY * self.step;
        self.bins == other.bins
            && close(self.first, other.first)
            && close(self.at(self.bins - 1), other.at(other.bins - 1))
    }
}

impl std::fmt::Display for Axis {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{} bins from {:.3} km/s in steps of {:.4}", self.bins, self.first, self.step)
    }
}
