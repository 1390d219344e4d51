//! The spot contrast of one data set relative to the others: the contrast for which ln Z is largest, the field and all
//! else held. The profiles constrain it, because the same spots appear in those of the other data sets.

use super::star::DEGREE;
use super::{Basis, Design, Fitted, Marginal};
use crate::field::FieldError;
use crate::surface::imaging::Imager;
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// Standard deviation of the prior of ln(1 - contrast) around the value of the config: optical spots are some three
/// times fainter in the near infrared.
const PRIOR: f64 = 0.7;

/// Smallest and largest `1 - contrast`.
const DARKNESS: (f64, f64) = (0.02, 1.0);

/// A climb of ln(1 - contrast) begins with differences of this step, has steps no longer than the next value, and ends
/// when it moves by less than a fraction of its uncertainty, or after so many steps.
const STEP: f64 = 0.1;
const LONGEST: f64 = 0.7;
const SETTLED: f64 = 0.1;
const STEPS: usize = 8;

/// The contrast of spots in a data set.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct FittedContrast {
    /// Brightness of a spot over that of the photosphere.
    pub value: f64,
    /// Its standard deviation.
    pub sigma: f64,
}

impl FittedContrast {
    /// Whether it would require spots darker than black.
    pub fn is_at_bound(&self) -> bool {
        self.value < 1e-6
    }
}

/// The spot contrast of a data `set` by the field of `near`, its prior around the `given` value.
///
/// # Errors
/// [`FieldError`].
pub fn fit_contrast(imager: &Imager, near: &Fitted, set: usize, given: f64) -> Result<FittedContrast, FieldError> {
    let near = &near.marginal;
    let basis = Arc::new(Basis::coarse(&imager.grid, DEGREE));
    let [centre, here] = [given, imager.contrast_of(set)].map(|contrast| (1.0 - contrast).ln());
    let bounds = (DARKNESS.0.ln(), DARKNESS.1.ln());
    let height = |place: f64| {
        let mut imager = imager.clone();
        imager.sets[set].contrast = Some(1.0 - place.exp());
        let design = Arc::new(Design::new(&imager, &basis, &near.values.state()));
        let marginal = Marginal::new(&imager, &basis, design, near.values, near.assumed, Some(near))?;
        Ok(marginal.ln_evidence() - 0.5 * ((place - centre) / PRIOR).powi(2))
    };
    let (mut place, mut step) = (here.clamp(bounds.0, bounds.1), STEP);
    let mut bend = PRIOR.powi(-2);
    for _ in 0..STEPS {
        // within the bounds, where the middle point may not be the highest: a parabola through three
        let middle = place.clamp(bounds.0 + step, bounds.1 - step);
        let [below, here, above] = [-1.0, 0.0, 1.0].map(|side| height(middle + side * step));
        let (below, here, above) = (below?, here?, above?);
        let slope = (above - below) / (2.0 * step);
        bend = ((2.0 * here - above - below) / (step * step)).max(PRIOR.powi(-2));
        let next = (middle + (slope / bend).clamp(-LONGEST, LONGEST)).clamp(bounds.0, bounds.1);
        let moved = (next - place).abs();
        (place, step) = (next, bend.sqrt().recip().min(STEP));
        if moved < SETTLED * bend.sqrt().recip() {
            break;
        }
    }
    let darkness = place.exp();
    Ok(FittedContrast { value: 1.0 - darkness, sigma: darkness / bend.sqrt() })
}
