//! How activity indicators depend on the spots in the profiles (`docs/method.md` section 9).

use crate::model::ParameterValues;
use crate::surface::Known;
use crate::surface::evolving_map::star::coarsely;
use crate::surface::evolving_map::{FittedIndicator, NoFit, fit_indicator};
use crate::surface::imaging::Imager;
use crate::surface::indicator::scaled;
use crate::surface::photometry::Flux;

/// Gains and jitters of indicators with these names and values, in the order of time, by a field that is fitted to the
/// profiles alone, with the star at `values` without a planet: a jitter absorbs its orbit, which spots would otherwise
/// mimic.
///
/// # Errors
/// [`NoFit`].
pub fn fitted(
    imager: &Imager,
    values: ParameterValues,
    known: Known,
    indicators: &[(&str, &[Flux])],
) -> Result<Vec<FittedIndicator>, NoFit> {
    let near = coarsely(imager, values, Known { jitter_kms: None, ..known })?;
    let of = |(name, values): &(&str, &[Flux])| {
        let (scale, readings) = scaled(values);
        fit_indicator(imager, &near.marginal, (name, scale, &readings))
    };
    Ok(indicators.iter().map(of).collect())
}
