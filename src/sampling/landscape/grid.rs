//! The nodes of a likelihood grid: axes of equally spaced values, and the order of their product.

use serde::{Deserialize, Serialize};

/// Tolerance of a whole period: an axis from 0.1 to 1.1 covers one.
const PERIOD_ROUNDING: f64 = 1e-9;

/// One axis: `nodes` equally spaced values from `min` to `max`, both included.
///
/// A periodic parameter (period 1) has its values in `[0, 1)`: `min` and `max` may lie outside, so that an axis can
/// wrap around 0. Where they are a whole period apart they are the same point, and `max` is left out.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Axis {
    /// Name of the parameter.
    pub name: String,
    /// First value, in the unit of the name.
    pub min: f64,
    /// Last value.
    pub max: f64,
    /// Number of values, at least 2.
    pub nodes: usize,
    /// Whether the parameter has period 1.
    pub periodic: bool,
}

impl Axis {
    /// Whether the axis goes once around a period, and so has no edge.
    pub fn is_circle(&self) -> bool {
        self.periodic && (self.max - self.min - 1.0).abs() < PERIOD_ROUNDING
    }

    /// Whether a periodic parameter would be visited more than once.
    pub fn overlaps(&self) -> bool {
        self.periodic && self.max - self.min > 1.0 && !self.is_circle()
    }

    /// Distance between values.
    pub fn spacing(&self) -> f64 {
        (self.max - self.min) / self.intervals()
    }

    /// Value number `k`.
    pub fn value(&self, k: usize) -> f64 {
        let t = k as f64 / self.intervals();
        // both ends are reproduced exactly
        let value = self.min * (1.0 - t) + self.max * t;
        // a tiny negative number has remainder 1 after rounding
        if self.periodic { value.rem_euclid(1.0) % 1.0 } else { value }
    }

    fn intervals(&self) -> f64 {
        if self.is_circle() { self.nodes as f64 } else { (self.nodes - 1) as f64 }
    }
}

/// The product of one to three axes. Node 0 is at the beginning of all axes, and the last axis runs fastest.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Grid {
    /// The axes, in the order of the coordinates of a node.
    pub axes: Vec<Axis>,
}

impl Grid {
    /// Number of nodes.
    pub fn len(&self) -> usize {
        self.axes.iter().map(|axis| axis.nodes).product()
    }

    /// Whether there is no node.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Names of the parameters, in the order of the coordinates.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.axes.iter().map(|axis| axis.name.as_str())
    }

    /// Number of the value on each axis at node `index`.
    pub fn position(&self, index: usize) -> Vec<usize> {
        let mut rest = index;
        let mut position: Vec<usize> = self
            .axes
            .iter()
            .rev()
            .map(|axis| {
                let k = rest % axis.nodes;
                rest /= axis.nodes;
                k
            })
            .collect();
        position.reverse();
        position
    }

    /// Coordinates of node `index`.
    pub fn theta(&self, index: usize) -> Vec<f64> {
        self.axes.iter().zip(self.position(index)).map(|(axis, k)| axis.value(k)).collect()
    }

    /// The axes on whose edge node `index` lies.
    pub fn edges(&self, index: usize) -> Vec<&Axis> {
        let on_edge = |axis: &Axis, k: usize| !axis.is_circle() && (k == 0 || k + 1 == axis.nodes);
        self.axes.iter().zip(self.position(index)).filter(|(axis, k)| on_edge(axis, *k)).map(|(axis, _)| axis).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn axis(name: &str, min: f64, max: f64, nodes: usize) -> Axis {
        Axis { name: name.into(), min, max, nodes, periodic: name == "phi" }
    }

    fn values(axis: &Axis) -> Vec<f64> {
        (0..axis.nodes).map(|k| axis.value(k)).collect()
    }

    #[test]
    fn both_ends_are_values() {
        assert_eq!(values(&axis("k_kms", 0.0, 0.2, 5)), [0.0, 0.05, 0.1, 0.15000000000000002, 0.2]);
        let long = axis("x", 0.1, 0.7, 1000);
        assert_eq!((long.value(0), long.value(999)), (0.1, 0.7));
        assert_eq!(values(&axis("vsys_kms", -1.5, 3.5, 2)), [-1.5, 3.5]);
    }

    #[test]
    fn a_circle_is_visited_once_and_has_no_edge() {
        for min in [0.0, 0.1, -0.25, 7.3] {
            let circle = axis("phi", min, min + 1.0, 10);
            assert!(circle.is_circle() && !circle.overlaps());
            let mut values = values(&circle);
            assert!((values[0] - min.rem_euclid(1.0)).abs() < 1e-12);
            values.sort_by(f64::total_cmp);
            assert!(values.windows(2).all(|w| (w[1] - w[0] - 0.1).abs() < 1e-12), "{values:?}");
            assert!(values[0] >= 0.0 && values[9] < 1.0);
            let grid = Grid { axes: vec![circle] };
            assert!((0..10).all(|index| grid.edges(index).is_empty()));
        }
        assert!(axis("phi", 0.0, 1.1, 10).overlaps());
        assert!(!axis("k_kms", 0.0, 1.0, 10).is_circle());
    }

    #[test]
    fn an_axis_may_wrap_around_zero() {
        let expected = [0.8, 0.85, 0.9, 0.95, 0.0, 0.05, 0.1, 0.15, 0.2];
        for (found, expected) in values(&axis("phi", 0.8, 1.2, 9)).into_iter().zip(expected) {
            assert!((found - expected).abs() < 1e-12, "{found} {expected}");
        }
        assert_eq!(axis("phi", -1e-300, 0.5, 2).value(0), 0.0);
    }

    #[test]
    fn the_last_axis_runs_fastest() {
        let grid = Grid { axes: vec![axis("a", 0.0, 1.0, 2), axis("b", 0.0, 2.0, 3), axis("c", 0.0, 3.0, 4)] };
        assert_eq!(grid.len(), 24);
        assert_eq!(grid.position(1), [0, 0, 1]);
        assert_eq!(grid.position(23), [1, 2, 3]);
        assert_eq!(grid.theta(12 + 4 + 2), [1.0, 1.0, 2.0]);
        let edges = |index| grid.edges(index).iter().map(|axis| axis.name.clone()).collect::<String>();
        assert_eq!((edges(0), edges(5), edges(8)), ("abc".into(), "a".into(), "abc".into()));
    }
}
