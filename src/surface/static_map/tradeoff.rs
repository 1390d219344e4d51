//! The trade-off curve of the reference: chi2 as a function of spottedness (or entropy) (`docs/method.md` section 3,
//! step 2).
//!
//! Nodes along the path of maximum-entropy images, from the reference to larger and smaller lambda; between them chi2
//! is a cubic in spottedness with the exact slopes of the path. Beyond its ends the curve continues along its tangent,
//! so that it is monotone everywhere.

/// One image on the path.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Node {
    /// chi2.
    pub chi2: f64,
    /// Spottedness of the image.
    pub spottedness: f64,
    /// Entropy of the image.
    pub entropy: f64,
    /// Lagrange multiplier.
    pub lambda: f64,
    /// `d chi2 / d spottedness` along the path (negative).
    pub chi2_per_spottedness: f64,
}

/// The measure of an image that is traded for chi2.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Measure {
    /// Spottedness: grows as chi2 falls.
    Spottedness,
    /// Minus the entropy: grows as chi2 falls.
    NegativeEntropy,
}

/// The curve.
#[derive(Clone, Debug, PartialEq)]
pub struct TradeOff {
    /// Nodes with spottedness growing, chi2 falling.
    nodes: Vec<Node>,
}

impl TradeOff {
    /// From nodes of falling chi2. Only the stretch around node `reference` along which spottedness grows is kept:
    /// beyond, it does not determine chi2.
    pub fn new(nodes: Vec<Node>, reference: usize) -> Self {
        let good = |a: &Node, b: &Node| {
            a.spottedness < b.spottedness && a.entropy > b.entropy && b.chi2 < a.chi2 && b.chi2_per_spottedness < 0.0
        };
        let last = (reference + 1..nodes.len()).take_while(|&i| good(&nodes[i - 1], &nodes[i])).count() + reference;
        let before =
            (0..reference).rev().take_while(|&i| good(&nodes[i], &nodes[i + 1]) && nodes[i].chi2_per_spottedness < 0.0);
        let first = reference - before.count();
        TradeOff { nodes: nodes[first..=last].to_vec() }
    }

    /// The nodes, in order of falling chi2.
    pub fn nodes(&self) -> &[Node] {
        &self.nodes
    }

    /// chi2 on the curve where the measure has the value `x`, and its derivative.
    pub fn chi2_at(&self, measure: Measure, x: f64) -> (f64, f64) {
        let nodes = &self.nodes;
        let after = nodes.partition_point(|node| node.measure(measure) < x);
        if after == 0 || after == nodes.len() {
            let end = nodes[after.min(nodes.len() - 1)];
            let slope = end.slope(measure);
            return (end.chi2 + slope * (x - end.measure(measure)), slope);
        }
        hermite(&nodes[after - 1], &nodes[after], measure, x)
    }
}

impl Node {
    fn measure(&self, measure: Measure) -> f64 {
        match measure {
            Measure::Spottedness => self.spottedness,
            Measure::NegativeEntropy => -self.entropy,
        }
    }

    /// `d chi2 / d measure`; for the entropy it follows from `dS = (lambda/2) d chi2` on the path.
    fn slope(&self, measure: Measure) -> f64 {
        match measure {
            Measure::Spottedness => self.chi2_per_spottedness,
            Measure::NegativeEntropy => -2.0 / self.lambda,
        }
    }
}

/// Cubic with the nodes' values and slopes; value and derivative at `x`.
fn hermite(a: &Node, b: &Node, measure: Measure, x: f64) -> (f64, f64) {
    let h = b.measure(measure) - a.measure(measure);
    let t = (x - a.measure(measure)) / h;
    let rise = b.chi2 - a.chi2;
    let (p, q) = (a.slope(measure) * h - rise, b.slope(measure) * h - rise);
    let value = a.chi2 + t * rise + t * (1.0 - t) * (p * (1.0 - t) - q * t);
    let derivative = rise + (1.0 - 2.0 * t) * (p * (1.0 - t) - q * t) - t * (1.0 - t) * (p + q);
    (value, derivative / h)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A path with spottedness `exp(-chi2)` and entropy `-1 / chi2`, so that lambda = 2 dS/dchi2 = 2 / chi2^2.
    fn node(chi2: f64) -> Node {
        let spottedness = (-chi2).exp();
        Node {
            chi2,
            spottedness,
            entropy: -1.0 / chi2,
            lambda: 2.0 / (chi2 * chi2),
            chi2_per_spottedness: -1.0 / spottedness,
        }
    }

    #[test]
    fn inverts_its_own_path_and_goes_on_monotonically() {
        let curve = TradeOff::new((0..21).map(|i| node(3.0 - 0.1 * i as f64)).collect(), 10);
        for i in 0..100 {
            let chi2 = 1.01 + 0.0198 * i as f64;
            for (measure, x) in [(Measure::Spottedness, (-chi2).exp()), (Measure::NegativeEntropy, 1.0 / chi2)] {
                let (value, slope) = curve.chi2_at(measure, x);
                // error of a cubic: h^4 / 384 times a fourth derivative, 24 / x^5 for chi2 = 1/x: 1.1e-5 at the end
                assert!((value - chi2).abs() < 1.2e-5, "{measure:?} {chi2} {value}");
                let numerical =
                    (curve.chi2_at(measure, x * 1.0001).0 - curve.chi2_at(measure, x * 0.9999).0) / (2e-4 * x);
                assert!((slope / numerical - 1.0).abs() < 1e-4);
            }
        }
        let far = [0.8, 1.5, 5.0].map(|a| curve.chi2_at(Measure::Spottedness, a).0);
        assert!(far[0] < 1.0 && far[1] < far[0] && far[2] < far[1]);
    }

    #[test]
    fn a_path_that_turns_back_is_cut() {
        let mut nodes: Vec<Node> = (0..11).map(|i| node(3.0 - 0.2 * i as f64)).collect();
        nodes[9].spottedness = 0.0;
        assert_eq!(TradeOff::new(nodes, 5).nodes().len(), 9);
    }
}
