//! Light curves in the marginal likelihood: each bin is an epoch with one datum and no velocity (`docs/method.md`
//! section 9).
//!
//! The flux of a map relative to a star of mean filling factor is linear in the map, `1 + J c`. It is measured times a
//! level and a slope of the segment, to first order `1 + J c + level + slope place`: two parameters common to all bins
//! of a segment, marginalised over.

use super::indicators;
use super::{Basis, MEAN_FILLING, Marginal};
use crate::field::Epoch;
use crate::model::{Parameter, ParameterValues};
use crate::numerics::quantile::middle;
use crate::star::StarState;
use crate::surface::expansion::stellar_step;
use crate::surface::imaging::Imager;
use crate::surface::indicator::{Indicator, Reading};
use crate::surface::photometry::{FluxBin, LightCurve};
use nalgebra::{DMatrix, DMatrixView, DVector};
use rayon::prelude::*;
use std::ops::Range;

/// Standard deviation of the prior of a segment's level, and of the change from its middle to its end by its slope, in
/// units of its mean flux: for spots to which no profile is sensitive, and instrumental drifts.
pub const LEVEL: f64 = 0.1;

/// Light curves of each harmonic, for one star.
#[derive(Clone, Debug)]
pub(super) struct Light {
    /// J (bins, H), those of all light curves one after the other.
    jacobian: DMatrix<f64>,
    /// The same of the readings of indicators (readings, H).
    of_indicators: DMatrix<f64>,
}

/// A bin of a light curve and its model by the most probable maps.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FluxFit {
    /// Number of the light curve, from 0.
    pub curve: usize,
    /// The bin.
    pub bin: FluxBin,
    /// Flux of the most probable map, including level and slope of the segment.
    pub model: f64,
}

/// A reading of an indicator and its model by the most probable maps, in units of the indicator.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ReadingFit {
    /// Number of the indicator among all that were given, from 0.
    pub indicator: usize,
    /// Time (d).
    pub time_d: f64,
    /// The value.
    pub value: f64,
    /// Its standard error, including jitter.
    pub sigma: f64,
    /// The value by the most probable map, including level and slope.
    pub model: f64,
}

impl Light {
    /// The light curves of the star in `imager` at `state`. The star rotates within a bin: the mean of two times that
    /// are a standard deviation before and after its middle is accurate to the third order in the width.
    pub fn new(imager: &Imager, basis: &Basis, state: &StarState) -> Self {
        let bins: Vec<(&LightCurve, &FluxBin)> =
            imager.light_curves.iter().flat_map(|curve| curve.bins.iter().map(move |bin| (curve, bin))).collect();
        let shares = |(curve, bin): &(&LightCurve, &FluxBin)| {
            let times_d = [bin.time_d - bin.spread_d, bin.time_d + bin.spread_d];
            let mut shares = curve.band.shares(&imager.grid, &imager.star, state, &times_d);
            let q = 1.0 - curve.band.contrast(&imager.star, state);
            // with limb darkening the sum exceeds 1
            let scale = -q / (1.0 - q * MEAN_FILLING * shares.iter().sum::<f64>());
            shares.iter_mut().for_each(|share| *share *= scale);
            shares
        };
        let rows: Vec<Vec<f64>> = bins.par_iter().map(shares).collect();
        let rows = DMatrix::from_iterator(imager.grid.len(), bins.len(), rows.into_iter().flatten());
        let of_indicators = indicators::jacobian(imager, basis, state);
        Light { jacobian: rows.transpose() * &basis.on_pixels, of_indicators }
    }

    /// `J^T N^-1 J` of all bins and readings for the harmonics `of` one degree (harmonics, harmonics).
    pub fn information(&self, imager: &Imager, of: Range<usize>) -> DMatrix<f64> {
        let mut rows = self.jacobian.columns_range(of.clone()).into_owned();
        let bins = imager.light_curves.iter().flat_map(|curve| &curve.bins);
        rows.row_iter_mut().zip(bins).for_each(|(mut row, bin)| row /= bin.sigma);
        let information = rows.tr_mul(&rows);
        if imager.indicators.is_empty() {
            return information;
        }
        let mut more = self.of_indicators.columns_range(of).into_owned();
        let readings = imager.indicators.iter().flat_map(|indicator| &indicator.readings);
        more.row_iter_mut().zip(readings).for_each(|(mut row, reading)| row /= reading.sigma);
        information + more.tr_mul(&more)
    }

    /// The bins, then the readings, around maps of these coefficients (H, bins and readings), without slopes.
    pub fn epochs(&self, imager: &Imager, maps: DMatrixView<f64>) -> Vec<Epoch> {
        let of_curves = 2 * imager.light_curves.iter().map(|curve| curve.segments).sum::<usize>();
        let numbers = of_curves + 2 * imager.indicators.len();
        let fluxes = self.fluxes(maps);
        let mut epochs = Vec::with_capacity(fluxes.len());
        let mut first = 0;
        for curve in &imager.light_curves {
            for bin in &curve.bins {
                let k = epochs.len();
                let mut common = DMatrix::zeros(1, numbers);
                common[first + 2 * bin.segment] = LEVEL;
                common[first + 2 * bin.segment + 1] = LEVEL * bin.place;
                let row = self.jacobian.rows(k, 1).into_owned();
                epochs.push(Epoch::of_datum(bin.time_d, row, bin.flux - fluxes[k], bin.sigma, common));
            }
            first += 2 * curve.segments;
        }
        let readings = &fluxes.as_slice()[self.jacobian.nrows()..];
        epochs.extend(indicators::epochs(imager, &self.of_indicators, readings, of_curves));
        epochs
    }

    /// Derivatives of the flux of each bin, and of each reading, with a velocity, which are zero, and with the stellar
    /// parameters at `values`, for maps of these coefficients (H, bins and readings): (1, 1 + parameters) each.
    pub fn slopes(
        (imager, basis): (&Imager, &Basis),
        values: &ParameterValues,
        maps: DMatrixView<f64>,
        stellar: &[Parameter],
    ) -> Vec<DMatrix<f64>> {
        let mut slopes = vec![DMatrix::zeros(1, 1 + stellar.len()); maps.ncols()];
        if slopes.is_empty() {
            return slopes;
        }
        let time_base_d = imager.time_base_cycles() * imager.star.rotation_period_d;
        for (s, parameter) in stellar.iter().enumerate() {
            let h = stellar_step(*parameter, values, time_base_d);
            let [above, below] = [h, -h].map(|h| {
                let mut values = *values;
                values.set(*parameter, values[*parameter] + h);
                Light::new(imager, basis, &values.state()).fluxes(maps)
            });
            slopes.iter_mut().enumerate().for_each(|(k, own)| own[1 + s] = (above[k] - below[k]) / (2.0 * h));
        }
        slopes
    }

    /// Flux of each bin, and then the effect of spots on each reading, before level and slope.
    fn fluxes(&self, maps: DMatrixView<f64>) -> DVector<f64> {
        let bins = self.jacobian.nrows();
        let seen = |rows: &DMatrix<f64>, k: usize, map: usize| rows.row(k).transpose().dot(&maps.column(map));
        DVector::from_fn(bins + self.of_indicators.nrows(), |k, _| match k < bins {
            true => 1.0 + seen(&self.jacobian, k, k),
            false => seen(&self.of_indicators, k - bins, k),
        })
    }
}

/// A bin so many standard deviations from the maps is not noise,
const BEYOND_NOISE: f64 = 5.0;

/// and neither is a light curve of a larger chi2 per bin.
const WORST_CHI2: f64 = 2.0;

/// Largest number of bins that are listed.
const NAMED: usize = 5;

/// Deviations of light curves from noise: chi2 per bin, and single bins.
pub(super) fn misfits(imager: &Imager, fits: &[FluxFit]) -> Vec<String> {
    let mut all = Vec::new();
    for (c, curve) in imager.light_curves.iter().enumerate() {
        let scaled = |fit: &FluxFit| (fit.bin.flux - fit.model) / fit.bin.sigma;
        let of_curve: Vec<(f64, f64)> =
            fits.iter().filter(|fit| fit.curve == c).map(|fit| (fit.bin.time_d, scaled(fit))).collect();
        let chi2 = of_curve.iter().map(|(_, off)| off * off).sum::<f64>() / of_curve.len() as f64;
        let name = &curve.name;
        // a few outliers do not hide each other
        let scatter = (1.4826 * middle(of_curve.iter().map(|(_, off)| off.abs()).collect())).max(1.0);
        let wild: Vec<&(f64, f64)> = of_curve.iter().filter(|(_, off)| off.abs() > BEYOND_NOISE * scatter).collect();
        if !wild.is_empty() {
            let mut named: Vec<String> =
                wild.iter().take(NAMED).map(|(time_d, off)| format!("{time_d:.3} d ({off:+.1} sigma)")).collect();
            if wild.len() > NAMED {
                named.push(format!("and {} more", wild.len() - NAMED));
            }
            all.push(format!(
                "light curve {name}: outliers at {} (flares, transits or bad measurements): exclude their times by \
                 photometry.exclude",
                named.join(", ")
            ));
        } else if chi2 > WORST_CHI2 {
            let factor = chi2.sqrt();
            all.push(format!(
                "light curve {name}: χ² = {chi2:.1} per bin, more than spots and uncertainties explain; \
                 photometry.sigma_scale {factor:.1} brings it to 1"
            ));
        }
    }
    all
}

impl Marginal {
    /// Residuals of the most probable maps in each bin of the light curves and each reading of the indicators, with the
    /// most probable level and slope of each segment and indicator given these maps.
    fn beside_profiles(&self, imager: &Imager) -> Vec<f64> {
        let epochs = self.design.epochs(imager, &self.settled.coefficients);
        let of_light = &epochs[self.design.response().profiles()..];
        let numbers = of_light.first().map_or(0, |epoch| epoch.common.ncols());
        let (mut inner, mut along) = (DMatrix::identity(numbers, numbers), DVector::zeros(numbers));
        for Epoch { common, misfit, variance, .. } in of_light {
            inner += common.tr_mul(common) / variance[0];
            along += common.tr_mul(misfit) / variance[0];
        }
        // a sum of squares plus 1 is positive definite
        let levels = inner.cholesky().map_or(DVector::zeros(numbers), |factor| factor.solve(&along));
        of_light.iter().map(|epoch| epoch.misfit[0] - (&epoch.common * &levels)[0]).collect()
    }

    /// The light curves with the model of the most probable maps.
    pub fn light_curves(&self, imager: &Imager) -> Vec<FluxFit> {
        let curves = imager.light_curves.iter().enumerate();
        let bins = curves.flat_map(|(c, curve)| curve.bins.iter().map(move |bin| (c, *bin)));
        let fit =
            |((curve, bin), residual): ((usize, FluxBin), f64)| FluxFit { curve, bin, model: bin.flux - residual };
        bins.zip(self.beside_profiles(imager)).map(fit).collect()
    }

    /// The readings of the indicators in use with the model of the most probable maps.
    pub fn readings(&self, imager: &Imager) -> Vec<ReadingFit> {
        let bins = imager.light_curves.iter().map(|curve| curve.bins.len()).sum();
        let all = imager.indicators.iter().flat_map(|one| one.readings.iter().map(move |reading| (one, reading)));
        let fit = |((Indicator { number, scale, .. }, reading), residual): ((&Indicator, &Reading), f64)| ReadingFit {
            indicator: *number,
            time_d: reading.time_d,
            value: scale.mean + scale.rms * reading.value,
            sigma: scale.rms * reading.sigma,
            model: scale.mean + scale.rms * (reading.value - residual),
        };
        all.zip(self.beside_profiles(imager).into_iter().skip(bins)).map(fit).collect()
    }
}
