//! A quantity whose posterior is a mixture of Gaussians, such as K at all ephemerides within their uncertainties.

use crate::numerics::{logarithms::ln_sum, normal};

/// One of the Gaussians.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Part {
    /// ln of its weight, up to a constant.
    pub ln_weight: f64,
    /// Mean.
    pub mean: f64,
    /// Standard deviation.
    pub sd: f64,
}

/// The mixture.
#[derive(Clone, Debug)]
pub struct Mixture {
    parts: Vec<Part>,
}

impl Mixture {
    /// A mixture of these; `None` where a number is not finite or there are none.
    pub fn new(parts: Vec<Part>) -> Option<Self> {
        let finite = |part: &Part| part.ln_weight.is_finite() && part.mean.is_finite() && part.sd.is_finite();
        (!parts.is_empty() && parts.iter().all(finite)).then_some(Mixture { parts })
    }

    /// Mean and standard deviation.
    pub fn moments(&self) -> [f64; 2] {
        let mean = self.mean_of(|part| part.mean);
        let variance = self.mean_of(|part| part.sd.powi(2) + (part.mean - mean).powi(2));
        [mean, variance.sqrt()]
    }

    /// 95 % upper limit on a quantity that is 0 or more.
    pub fn upper95(&self) -> f64 {
        const HALVINGS: usize = 100;
        let above = |x: f64| self.ln_sum(|part| part.ln_weight + normal::ln_cumulative((part.mean - x) / part.sd));
        // a twentieth of the probability above zero lies above the limit
        let wanted = above(0.0) + 0.05f64.ln();
        let (mut low, mut high) = (0.0, self.parts.iter().map(|part| part.sd).fold(0.0, f64::max));
        while above(high) > wanted {
            (low, high) = (high, 2.0 * high);
        }
        for _ in 0..HALVINGS {
            let middle = 0.5 * (low + high);
            if above(middle) > wanted { low = middle } else { high = middle }
        }
        high
    }

    fn mean_of(&self, number: impl Fn(&Part) -> f64) -> f64 {
        let ln_sum = self.ln_sum(|part| part.ln_weight);
        self.parts.iter().map(|part| (part.ln_weight - ln_sum).exp() * number(part)).sum()
    }

    fn ln_sum(&self, ln: impl Fn(&Part) -> f64) -> f64 {
        ln_sum(&self.parts.iter().map(ln).collect::<Vec<_>>())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn upper95(mean: f64, sd: f64) -> f64 {
        Mixture::new(vec![Part { ln_weight: 3.0, mean, sd }]).unwrap().upper95()
    }

    #[test]
    fn a_limit_is_that_of_what_lies_above_zero() {
        // 1.6449 sigma one-sided is 5 %; 1.96 sigma is the limit of a quantity far from its bound at zero
        assert!((upper95(1.0, 0.01) - (1.0 + 0.016449)).abs() < 1e-6);
        assert!((upper95(0.0, 1.0) - 1.95996).abs() < 1e-4);
        // that far below zero the remaining tail is exponential
        assert!((upper95(-60.0, 1.0) * 60.0 - 20.0f64.ln()).abs() < 0.01);
        assert!((upper95(-36.0, 1.0) * 36.0 - 3.0).abs() < 0.02);
    }

    #[test]
    fn parts_count_by_their_weights() {
        let part = |weight: f64, mean| Part { ln_weight: weight.ln() - 900.0, mean, sd: 0.3 };
        let mixture = Mixture::new(vec![part(1.0, 2.0), part(3.0, 4.0)]).unwrap();
        let [mean, sd] = mixture.moments();
        assert!((mean - 3.5).abs() < 1e-12 && (sd - (0.09f64 + 0.75).sqrt()).abs() < 1e-12);
        // 0.05 = 0.75 Q(z): z = 1.5011 of the second
        assert!((mixture.upper95() - (4.0 + 0.3 * 1.5011)).abs() < 1e-4, "{}", mixture.upper95());
        assert!(Mixture::new(vec![part(1.0, f64::NAN)]).is_none() && Mixture::new(Vec::new()).is_none());
    }
}
