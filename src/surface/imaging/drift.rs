//! A drift of the velocities: a polynomial in time with Gaussian priors, around the slope at which it is held.

/// Standard deviation of the prior: of the velocity (km/s) at the end of the data relative to the middle, and of the
/// slope (km/s/d) where that is less. No spectrograph and no companion on a long orbit drifts faster, and a drift
/// should not absorb a planet within one or two nights.
const PRIOR: (f64, f64) = (0.5, 0.1);

/// A drift of some of the profiles; time is relative to their middle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Drift {
    /// The data set, where its offset is fitted; otherwise it applies to all profiles whose offsets are known.
    pub set: Option<usize>,
    /// Whether there is a curvature beside the slope.
    pub(super) curved: bool,
    /// Middle of the times (d).
    pub(super) mid_d: f64,
    /// Half of their span (d).
    pub half_span_d: f64,
    /// The slope with which profiles are imaged (km/s/d); its prior is centred on 0.
    pub held_kms_d: f64,
}

impl Drift {
    /// A drift of profiles at these times (d), held at 0; `None` where they have no span.
    pub(super) fn over(times_d: impl Iterator<Item = f64>, curved: bool) -> Option<Self> {
        let ends = times_d.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), t| (a.min(t), b.max(t)));
        let (mid_d, half_span_d) = (0.5 * (ends.0 + ends.1), 0.5 * (ends.1 - ends.0));
        let has_span = half_span_d > 0.0 && half_span_d.is_finite();
        has_span.then_some(Drift { set: None, curved, mid_d, half_span_d, held_kms_d: 0.0 })
    }

    /// Number of its terms: slope, curvature.
    pub fn terms(&self) -> usize {
        if self.curved { 2 } else { 1 }
    }

    /// Mean of the prior of a term, relative to where it is held (km/s).
    pub(super) fn mean_kms(&self, term: usize) -> f64 {
        if term == 0 { -self.held_kms_d * self.half_span_d } else { 0.0 }
    }

    /// Standard deviation of the prior of each term (km/s).
    pub(super) fn sd_kms(&self) -> f64 {
        let (kms, kms_d) = PRIOR;
        kms.min(kms_d * self.half_span_d)
    }

    /// Velocities at a time (d) by one km/s of each term.
    pub(super) fn at(&self, time_d: f64) -> [f64; 2] {
        let x = (time_d - self.mid_d) / self.half_span_d;
        [x, x * x - 1.0 / 3.0]
    }

    /// The velocity at a time (d) by the slope at which it is held (km/s).
    pub(super) fn held_kms(&self, time_d: f64) -> f64 {
        self.held_kms_d * (time_d - self.mid_d)
    }
}
