//! The evidence of data that are linear in a Gaussian field (`docs/method.md` section 9).
//!
//! With `C = J K J^T + N` over all epochs, `K = S_h k(t - t')`, and residual `r = misfit + J c0`: `ln Z = -1/2 r^T C^-1
//! r - 1/2 ln |C| - n/2 ln 2 pi` (n data), the density of the data marginalised over all fields and nuisances; gradient
//! and information of numbers that change the model by D' are `D'^T C^-1 r` and `D'^T C^-1 D'`. All of it in units of
//! the noise and compressed, where N is 1, except for the common columns, which add `B B^T` over all.
//!
//! The work is n'^2 H for `J K J^T` and n'^3 / 3 for its factor, n' some 20 numbers per profile, or in proportion to n'
//! by a filter in time (`covariance`; `benches/field.rs`: 0.04 s for 40 profiles, 0.3 for 100, 2.0 for 200, 4.3 for
//! 400; half of that where another field of the same star is known).

use super::compress::{Compressed, Compression, Told};
use super::covariance::Covariance;
use super::dense::{self, Factor, inverses, scale_rows};
use super::numbers::Numbers;
use super::tilt::Tilt;
use super::{Degrees, Epoch, Field, FieldError, Quadratic};
use crate::numerics::once;
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;
use std::ops::Range;
use std::sync::OnceLock;

/// Data marginalised over the field.
#[derive(Clone, Debug)]
pub struct Evidence {
    pub(super) field: Field,
    pub(super) degrees: Degrees,
    /// Prior standard deviation of each coefficient (H).
    pub(super) sd: Vec<f64>,
    /// The data, compressed.
    pub(super) numbers: Numbers,
    pub(super) covariance: Covariance,
    /// C^-1 r.
    pub(super) dual: DVector<f64>,
    /// Where the epochs are expanded; `None` at the most probable field.
    pub(super) tilt: Option<Tilt>,
    epochs: Vec<Compressed>,
    quadratic: Quadratic,
    /// How many numbers of each epoch the field explains here, once it is asked for.
    explained: OnceLock<Vec<f64>>,
}

/// Results for a nearby field and star that are used again.
#[derive(Clone, Debug, Default)]
pub(super) struct Nearby {
    /// How many numbers of each epoch the field explains, if that is not to be computed again.
    pub explained: Option<Vec<f64>>,
    /// Directions of the coefficients that epochs constrain (H, directions), if requested.
    pub seen: Option<DMatrix<f64>>,
}

impl Evidence {
    /// The evidence of epochs that are linear around the coefficients `around` (H, epochs), for a field of harmonics of
    /// these `degrees` (H).
    ///
    /// # Errors
    /// [`FieldError::NoSuchField`], [`FieldError::NotFinite`] and [`FieldError::NotPositive`]. Shapes that do not match
    /// panic.
    pub fn new(
        field: Field,
        degrees: &Degrees,
        epochs: &[Epoch],
        around: &DMatrix<f64>,
        how: Compression,
    ) -> Result<Self, FieldError> {
        Evidence::of(field, degrees, (epochs, around), how, Nearby::default())
    }

    /// The same with known results of the evidence of a field and a star nearby.
    pub(super) fn of(
        field: Field,
        degrees: &Degrees,
        (epochs, around): (&[Epoch], &DMatrix<f64>),
        how: Compression,
        Nearby { explained, mut seen }: Nearby,
    ) -> Result<Self, FieldError> {
        field.check()?;
        assert_eq!(around.shape(), (degrees.len(), epochs.len()), "coefficients of all epochs");
        let sd: Vec<f64> = field.spectrum.variances(degrees).into_iter().map(f64::sqrt).collect();
        let sharing = epochs.iter().filter(|epoch| epoch.common.ncols() > 0).count();
        let compressed = epochs.par_iter().enumerate().map(|(k, epoch)| {
            epoch.check_shapes(degrees.len());
            let sound = epoch.is_sound() && around.column(k).iter().all(|c| c.is_finite());
            sound
                .then(|| Compressed::new(epoch, around.column(k), &sd, (how, sharing)))
                .flatten()
                .ok_or(FieldError::NotFinite { epoch: k })
        });
        // the first error, whoever finds one
        let compressed: Vec<Result<_, FieldError>> = compressed.collect();
        let (mut compressed, rows): (Vec<_>, Vec<_>) =
            compressed.into_iter().collect::<Result<Vec<_>, _>>()?.into_iter().unzip();
        let (rows, common): (Vec<_>, Vec<_>) = rows.into_iter().map(|[rows, common]| (rows, common)).unzip();
        let times_d: Vec<f64> = epochs.iter().map(|epoch| epoch.time_d).collect();
        let mut numbers = Numbers::new(times_d, &rows, &common, sd.len());
        drop((rows, common));
        let mut spatial = numbers.spatial_of_few();
        // in units of these standard deviations
        if let Some(directions) = &mut seen {
            scale_rows(directions, &sd);
        }
        let factored = |numbers: &Numbers, spatial: Option<DMatrix<f64>>| {
            Covariance::new(numbers, spatial, &field.kernel, seen.as_ref()).ok_or(FieldError::NotPositive)
        };
        let (mut tilt, own) = (None, OnceLock::new());
        if Tilt::is_needed(epochs) {
            let explained = match explained {
                Some(explained) => explained,
                None => {
                    let explained = factored(&numbers, spatial.clone())?.explained(&numbers);
                    once::found(&own, || explained).clone()
                }
            };
            let tilt = tilt.insert(Tilt::new(explained, epochs));
            tilt.count((&field, &sd), (epochs, around), &mut compressed, (&mut numbers, spatial.as_mut()));
        }
        let covariance = factored(&numbers, spatial)?;
        let told: Vec<Told> =
            compressed.iter().zip(epochs).map(|(to, epoch)| to.tell(&epoch.misfit, &epoch.slopes)).collect();
        let whitened = covariance.whitened(&told, &numbers.parts);
        let quadratic = quadratic(&covariance, &whitened, &compressed, &told);
        let mut dual = whitened.columns(0, 1).into_owned();
        covariance.backward(&mut dual);
        let dual = dual.column(0).into_owned();
        let (degrees, epochs) = (degrees.clone(), compressed);
        Ok(Evidence { field, degrees, sd, numbers, covariance, dual, tilt, epochs, quadratic, explained: own })
    }

    /// Directions of the coefficients that epochs constrain (H, directions), if requested.
    pub(super) fn seen(&self) -> Option<DMatrix<f64>> {
        let mut directions = self.covariance.directions()?.clone();
        scale_rows(&mut directions, &inverses(&self.sd));
        Some(directions)
    }

    /// The field that is assumed.
    pub fn field(&self) -> &Field {
        &self.field
    }

    /// Numbers that the data of all epochs were compressed to.
    pub fn compressed_len(&self) -> usize {
        self.numbers.rows.nrows()
    }

    /// How many numbers of each epoch the field explains; `None` where no model is divided by a continuum.
    pub(crate) fn explained(&self) -> Option<&[f64]> {
        let tilt = self.tilt.as_ref()?;
        let found = || {
            // without the numbers of the volume
            let mut numbers = self.numbers.clone();
            let places = tilt.places(&numbers);
            numbers.replace(&places, &DMatrix::zeros(places.len(), self.sd.len()), None);
            let covariance =
                Covariance::new(&numbers, numbers.spatial_of_few(), &self.field.kernel, self.covariance.directions());
            covariance.map_or_else(|| tilt.explained.clone(), |covariance| covariance.explained(&numbers))
        };
        Some(once::found(&self.explained, found).as_slice())
    }

    /// ln Z, all constants included.
    pub fn ln_evidence(&self) -> f64 {
        self.quadratic.ln_evidence
    }

    /// ln Z with its gradient and information in the numbers whose slopes the epochs have.
    pub fn quadratic(&self) -> &Quadratic {
        &self.quadratic
    }

    /// The same with other misfits (at the same coefficients) and slopes of all epochs, of another orbit for example,
    /// while design and noise stay: a thousandth of the work. Along the directions that were compressed away the new
    /// misfits count as noise.
    ///
    /// # Errors
    /// [`FieldError::NotFinite`]. Shapes other than those of the epochs panic.
    pub fn with(&self, misfits: &[DVector<f64>], slopes: &[DMatrix<f64>]) -> Result<Quadratic, FieldError> {
        let told = self.told(misfits, slopes)?;
        let whitened = self.covariance.whitened(&told, &self.numbers.parts);
        Ok(quadratic(&self.covariance, &whitened, &self.epochs, &told))
    }

    /// The same without each of these groups of epochs (ascending): `then` applied to the quadratic of all others.
    /// Expansion point and tilt are those of all epochs; otherwise the result does not depend on the epochs left out.
    ///
    /// With `P = C^-1` and B the residual and all slopes, with s the epochs left out: `B^T P B - (P B)_s^T P_ss^-1 (P
    /// B)_s` in place of `B^T P B`.
    ///
    /// # Errors
    /// As there; [`FieldError::NotPositive`] of a group. Groups that are not ascending panic.
    pub fn without_each<T: Send>(
        &self,
        misfits: &[DVector<f64>],
        slopes: &[DMatrix<f64>],
        groups: &[Vec<usize>],
        then: impl Fn(&[usize], Quadratic) -> T + Sync,
    ) -> Result<Vec<Result<T, FieldError>>, FieldError> {
        let told = self.told(misfits, slopes)?;
        let mut solved = self.covariance.whitened(&told, &self.numbers.parts);
        let all = quadratic(&self.covariance, &solved, &self.epochs, &told);
        self.covariance.backward(&mut solved);
        let per_epoch = told.first().map_or(0, |of| of.slopes.ncols());
        let without = |group: &Vec<usize>| {
            assert!(group.is_sorted(), "epochs in order");
            let numbers: Vec<usize> = group.iter().flat_map(|k| self.numbers.parts[*k].clone()).collect();
            let factor = self.precision_of(&numbers)?;
            let left: Vec<usize> = (0..told.len()).filter(|k| group.binary_search(k).is_err()).collect();
            let left: Vec<usize> = left.iter().flat_map(|k| k * per_epoch..(k + 1) * per_epoch).collect();
            let columns: Vec<usize> = std::iter::once(0).chain(left.iter().map(|column| 1 + column)).collect();
            let mut across = solved.select_rows(&numbers).select_columns(&columns);
            factor.forward_from(&mut across, &vec![0; columns.len()]);
            let (residual, slopes) = (across.column(0), across.columns_range(1..));
            let mut ln_evidence = all.ln_evidence + 0.5 * (residual.norm_squared() - factor.ln_determinant());
            ln_evidence -= group.iter().map(|k| self.epochs[*k].constant - 0.5 * told[*k].chi2).sum::<f64>();
            let others = Quadratic {
                ln_evidence,
                gradient: all.gradient.select_rows(&left) - slopes.tr_mul(&residual),
                information: all.information.select_rows(&left).select_columns(&left) - slopes.transpose() * slopes,
            };
            Ok(then(group, others))
        };
        Ok(groups.par_iter().map(without).collect())
    }

    /// chi2 of each epoch as all others predict it, for these misfits: with `a = C^-1 r`, `a_k^T [(C^-1)_kk]^-1 a_k`
    /// (Rasmussen & Williams 2006, equations 5.10 to 5.12, for blocks), plus the part that is compressed away.
    ///
    /// # Errors
    /// As [`Evidence::without_each`].
    pub fn predicted_chi2(&self, misfits: &[DVector<f64>], slopes: &[DMatrix<f64>]) -> Result<Vec<f64>, FieldError> {
        let told = self.told(misfits, slopes)?;
        let mut solved = self.covariance.whitened(&told, &self.numbers.parts).columns(0, 1).into_owned();
        self.covariance.backward(&mut solved);
        let of = |(told, part): (&Told, &Range<usize>)| {
            let factor = self.precision_of(&part.clone().collect::<Vec<_>>())?;
            let mut across = solved.rows(part.start, part.len()).into_owned();
            factor.forward_from(&mut across, &[0]);
            Ok(across.norm_squared() + told.chi2)
        };
        told.par_iter().zip(&self.numbers.parts).map(of).collect()
    }

    /// The block of `C^-1` of some `numbers` (ascending), factored.
    fn precision_of(&self, numbers: &[usize]) -> Result<Factor, FieldError> {
        let mut units = DMatrix::zeros(self.numbers.rows.nrows(), numbers.len());
        numbers.iter().enumerate().for_each(|(column, row)| units[(*row, column)] = 1.0);
        self.covariance.forward_from(&mut units, numbers);
        Factor::new(dense::gram_of_columns(units.as_view())).ok_or(FieldError::NotPositive)
    }

    /// Misfits and slopes of all epochs in the numbers of these.
    fn told(&self, misfits: &[DVector<f64>], slopes: &[DMatrix<f64>]) -> Result<Vec<Told>, FieldError> {
        assert_eq!((misfits.len(), slopes.len()), (self.epochs.len(), self.epochs.len()), "misfits and slopes");
        let finite = |x: &[f64]| x.iter().all(|x| x.is_finite());
        let told = self.epochs.iter().enumerate().map(|(k, to)| {
            let (misfit, slopes) = (&misfits[k], &slopes[k]);
            assert_eq!((misfit.len(), slopes.nrows()), (to.data(), to.data()), "data of an epoch");
            let sound = finite(misfit.as_slice()) && finite(slopes.as_slice());
            sound.then(|| to.tell(misfit, slopes)).ok_or(FieldError::NotFinite { epoch: k })
        });
        told.collect()
    }
}

impl Covariance {
    /// `L^-1` times the residual and then the slopes, each of which is zero outside the rows of its epoch.
    fn whitened(&self, told: &[Told], parts: &[Range<usize>]) -> DMatrix<f64> {
        let per_epoch = told.first().map_or(0, |of| of.slopes.ncols());
        let mut columns = DMatrix::zeros(parts.last().map_or(0, |part| part.end), 1 + per_epoch * told.len());
        for (k, (of, part)) in told.iter().zip(parts).enumerate() {
            assert_eq!(of.slopes.ncols(), per_epoch, "slopes of all epochs");
            columns.view_mut((part.start, 0), (part.len(), 1)).copy_from(&of.residual);
            columns.view_mut((part.start, 1 + k * per_epoch), (part.len(), per_epoch)).copy_from(&of.slopes);
        }
        let starts = parts.iter().flat_map(|part| std::iter::repeat_n(part.start, per_epoch));
        self.forward_from(&mut columns, &std::iter::once(0).chain(starts).collect::<Vec<_>>());
        columns
    }
}

/// ln Z, gradient and information of misfits and slopes as compressed by `epochs`, `whitened`.
fn quadratic(covariance: &Covariance, whitened: &DMatrix<f64>, epochs: &[Compressed], told: &[Told]) -> Quadratic {
    let (residual, slopes) = (whitened.column(0), whitened.columns_range(1..));
    let mut gradient = slopes.tr_mul(&residual);
    let mut information = dense::gram_of_columns(slopes);
    information.fill_upper_triangle_with_lower_triangle();
    let mut ln_evidence = -0.5 * (residual.norm_squared() + covariance.ln_determinant());
    for (k, (of, epoch)) in told.iter().zip(epochs).enumerate() {
        let per_epoch = of.slopes.ncols();
        ln_evidence += epoch.constant - 0.5 * of.chi2;
        let mut part = gradient.rows_mut(k * per_epoch, per_epoch);
        part += &of.gradient;
        let mut block = information.view_mut((k * per_epoch, k * per_epoch), (per_epoch, per_epoch));
        block += &of.information;
    }
    Quadratic { ln_evidence, gradient, information }
}

#[cfg(test)]
mod tests {
    use super::super::{Kernel, Lifetime, Spectrum};
    use super::*;

    fn some(n: usize, m: usize) -> DMatrix<f64> {
        DMatrix::from_fn(n, m, |i, j| ((7 * i + 5 * j + 3 * i * j) % 11) as f64 - 4.5)
    }

    fn epoch(k: usize) -> Epoch {
        Epoch {
            time_d: k as f64,
            jacobian: (some(5, 8) * (1.0 + k as f64)).into(),
            misfit: some(5, 1).column(0).into_owned(),
            variance: DVector::repeat(5, 2.0),
            nuisances: DMatrix::zeros(5, 0),
            beside: 0.0,
            slopes: some(5, 2) * (3.0 - k as f64),
            common: DMatrix::zeros(5, 0),
            divisor: DVector::zeros(0),
        }
    }

    fn degrees() -> Degrees {
        vec![1, 1, 1, 2, 2, 2, 2, 2].into()
    }

    fn field() -> Field {
        let spectrum = Spectrum { amplitude: 0.8, slope: 0.5, break_degree: 0.0 };
        Field { spectrum, kernel: Kernel::of(Lifetime::Days(3.0)) }
    }

    /// The number of explained data does not depend on the start.
    #[test]
    fn how_much_the_field_explains_is_its_own() {
        let of = |explained: Option<Vec<f64>>| {
            let mut epochs = [epoch(0), epoch(1), epoch(2)];
            epochs[0].divisor = DVector::repeat(8, 0.3);
            epochs[2].divisor = DVector::repeat(8, 0.3);
            let around = DMatrix::zeros(8, 3);
            let nearby = Nearby { explained, seen: None };
            Evidence::of(field(), &degrees(), (&epochs, &around), Compression::default(), nearby).unwrap()
        };
        let (own, told) = (of(None), of(Some(vec![0.5; 3])));
        assert_ne!(own.ln_evidence(), told.ln_evidence());
        for (own, told) in own.explained().unwrap().iter().zip(told.explained().unwrap()) {
            assert!(*own > 1.0 && *own < 5.0 && (own - told).abs() < 1e-9, "{own} {told}");
        }
    }

    #[test]
    fn what_is_left_out_might_never_have_been() {
        let mut epochs = [0, 1, 2, 3, 4].map(epoch);
        epochs[1..4].iter_mut().for_each(|epoch| epoch.common = some(5, 1) * 0.2);
        let of = |these: &[usize]| {
            let epochs: Vec<Epoch> = these.iter().map(|k| epochs[*k].clone()).collect();
            let around = some(8, 5).select_columns(these) * 0.1;
            // several numbers are compressed away
            Evidence::new(field(), &degrees(), &epochs, &around, Compression { left_out: 1e-9 }).unwrap()
        };
        let misfits: Vec<DVector<f64>> = epochs.iter().map(|epoch| epoch.misfit.clone()).collect();
        let slopes: Vec<DMatrix<f64>> = epochs.iter().map(|epoch| epoch.slopes.clone()).collect();
        let groups = [vec![1], vec![0, 3], vec![2, 3, 4]];
        let all = of(&[0, 1, 2, 3, 4]).without_each(&misfits, &slopes, &groups, |_, others| others).unwrap();
        for (got, left) in
            all.iter().map(|got| got.as_ref().unwrap()).zip([vec![0, 2, 3, 4], vec![1, 2, 4], vec![0, 1]])
        {
            let known = of(&left).quadratic().clone();
            assert!((got.ln_evidence - known.ln_evidence).abs() < 1e-7, "{left:?}");
            assert!((&got.gradient - &known.gradient).amax() < 1e-7 * known.gradient.amax(), "{left:?}");
            assert!((&got.information - &known.information).amax() < 1e-7 * known.information.amax(), "{left:?}");
        }
    }
}
