//! The velocity axis of a profile: uniform, in km/s, and on the bins of the first profile of a star, though it may
//! begin and end elsewhere.

use super::row::{Digits, Fault, Row, fault};
use crate::numerics::quantile::middle;

/// A uniform velocity axis (km/s).
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Axis {
    pub first: f64,
    pub step: f64,
    pub bins: usize,
    /// How far velocities may be off it because they were rounded in print (km/s); 0 where they are on it.
    pub rounding: f64,
}

/// How far a point may be off the uniform axis, in steps.
const UNIFORMITY: f64 = 0.01;

/// Velocities rounded by more than this, in steps, do not determine their axis.
const COARSEST: f64 = 0.5;

/// Part of the last digit by which an axis through rounded velocities may miss them: half, and the error of the fit.
const HALF_A_DIGIT: f64 = 0.7;

/// Velocities of this size (km/s) are in another unit.
const BEYOND_SENSE_KMS: f64 = 1e4;

/// So are steps below this (km/s).
const FINEST_KMS: f64 = 1e-4;

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
        let step = (rows[rows.len() - 1].velocity - first) / (rows.len() - 1) as f64;
        if step < FINEST_KMS {
            return fault(rows[0].line, format!("velocities are {step:e} km/s apart; are they in km/s?"));
        }
        let axis = Axis { first, step, bins: rows.len(), rounding: 0.0 };
        match (0..rows.len()).all(|j| axis.deviation(rows, j) <= UNIFORMITY) {
            true => Ok(axis),
            false => Axis::through_rounded(rows).ok_or_else(|| axis.culprit(rows)),
        }
    }

    /// The axis that fits all rows best, if each is as near to it as the digits allow that it is printed with.
    fn through_rounded(rows: &[Row]) -> Option<Self> {
        let most = |digits: fn(Digits) -> i32| rows.iter().map(|row| digits(row.digits)).max();
        let (decimals, significant) = (most(|d| d.decimals)?, most(|d| d.significant)?);
        let unit = |velocity: f64| {
            let leading = if velocity == 0.0 { i32::MIN / 2 } else { velocity.abs().log10().floor() as i32 };
            10f64.powi(-decimals).max(10f64.powi(leading.saturating_add(1 - significant)))
        };
        let sum = |of: &dyn Fn(f64, f64) -> f64| -> f64 {
            let row = |(j, row): (usize, &Row)| of(j as f64, row.velocity) / unit(row.velocity).powi(2);
            rows.iter().enumerate().map(row).sum()
        };
        let weight = sum(&|_, _| 1.0);
        let (middle, mean) = (sum(&|x, _| x) / weight, sum(&|_, v| v) / weight);
        let step = sum(&|x, v| (x - middle) * (v - mean)) / sum(&|x, _| (x - middle).powi(2));
        let rounding = rows.iter().map(|row| HALF_A_DIGIT * unit(row.velocity)).fold(0.0, f64::max);
        let axis = Axis { first: mean - middle * step, step, bins: rows.len(), rounding };
        let near = |(j, row): (usize, &Row)| (row.velocity - axis.at(j)).abs() <= HALF_A_DIGIT * unit(row.velocity);
        (rounding < COARSEST * step && rows.iter().enumerate().all(near)).then_some(axis)
    }

    /// By how many steps row `j` is off the axis.
    fn deviation(&self, rows: &[Row], j: usize) -> f64 {
        (rows[j].velocity - self.at(j)).abs() / self.step
    }

    /// The first point that breaks the usual step; where none does, the axis drifts and its worst point is named.
    fn culprit(&self, rows: &[Row]) -> Fault {
        let steps: Vec<f64> = rows.windows(2).map(|p| p[1].velocity - p[0].velocity).collect();
        let usual = middle(steps.clone());
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

    /// Moved by a velocity (km/s).
    pub fn moved(self, by: f64) -> Self {
        Axis { first: self.first + by, ..self }
    }

    /// At which of its bins another axis begins, as a number with a fraction where it lies between two; `None` where
    /// the steps of the two are not the same.
    pub fn place(&self, other: &Axis) -> Option<f64> {
        let (tolerance, place) = (self.tolerance(other), (other.first - self.first) / self.step);
        let due = other.first + (other.bins - 1) as f64 * self.step;
        ((other.at(other.bins - 1) - due).abs() <= 2.0 * tolerance).then_some(place)
    }

    /// At which of its bins another axis on the same bins begins, and by how much it is off them (km/s); `None` where
    /// its bins are others: both ends must agree within 1 % of a step.
    pub fn bin_of(&self, other: &Axis) -> Option<(i64, f64)> {
        let begins = ((other.first - self.first) / self.step).round();
        let last = self.first + (begins + (other.bins - 1) as f64) * self.step;
        let off = (self.first + begins * self.step - other.first).abs().max((last - other.at(other.bins - 1)).abs());
        (off <= self.tolerance(other)).then_some((begins as i64, off))
    }

    fn tolerance(&self, other: &Axis) -> f64 {
        UNIFORMITY * self.step + self.rounding + other.rounding
    }
}

impl std::fmt::Display for Axis {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{} bins from {:.3} km/s in steps of {:.4}", self.bins, self.first, self.step)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rows(print: impl Fn(f64) -> String) -> Vec<Row> {
        let row = |j: usize| {
            let text = print(-40.0 + 0.823 * j as f64);
            let (velocity, digits) = (text.parse().unwrap(), Digits::of(&text));
            Row { line: j + 1, velocity, intensity: 1.0, sigma: 1e-3, digits, flag: None, bad: None }
        };
        (0..100).map(row).collect()
    }

    #[test]
    fn rounded_velocities_lie_on_their_axis() {
        let exact = Axis::through(&rows(|v| format!("{v:.6}"))).unwrap();
        assert_eq!(exact.rounding, 0.0);
        for print in [|v: f64| format!("{v:.1}"), |v: f64| format!("{v:.2e}"), |v: f64| format!("{v:.0}")] {
            // whole numbers are too coarse
            match Axis::through(&rows(print)) {
                Ok(axis) => assert!(
                    (axis.step - 0.823).abs() < 1e-3 && exact.bin_of(&axis).is_some_and(|at| at.0 == 0),
                    "{axis:?}"
                ),
                Err(fault) => assert!(print(0.5) == "0" && fault.problem.contains("does not increase"), "{fault:?}"),
            }
        }
        // off by more than a digit
        let moved = rows(|v| if v > 0.0 { format!("{:.1}", v + 0.2) } else { format!("{v:.1}") });
        assert!(Axis::through(&moved).unwrap_err().problem.contains("not uniform"));
    }

    #[test]
    fn axes_on_the_same_bins_may_begin_elsewhere() {
        let axis = Axis { first: -10.0, step: 2.0, bins: 11, rounding: 0.0 };
        assert_eq!(axis.bin_of(&Axis { bins: 12, ..axis }), Some((0, 0.0)));
        assert_eq!(axis.bin_of(&axis.moved(-4.0)), Some((-2, 0.0)));
        assert_eq!(axis.bin_of(&axis.moved(0.7)), None);
        assert!((axis.place(&axis.moved(0.7)).unwrap() - 0.35).abs() < 1e-12);
        assert_eq!(axis.place(&Axis { step: 1.9, ..axis }), None);
    }
}
