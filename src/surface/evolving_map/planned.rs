//! Expected constraints of planned profiles on velocities: the information `D'^T C^-1 D'` (`docs/method.md` section 9)
//! contains star, field, times and noise, but no data. It also depends on the map at which model and slopes are
//! linearised: one that is drawn from the field, given the existing data.

use super::expand::{summed, with_integrated};
use super::light::Light;
use super::{Assumed, Basis, Design, Marginal};
use crate::field::{Epoch, Evidence, FieldError};
use crate::model::{Parameter, ParameterValues};
use crate::planets::periodogram::offset::Common;
use crate::planets::velocities::VelocityQuadratic;
use crate::surface::expansion::{Expansion, Nuisance, STELLAR, coordinates};
use crate::surface::imaging::Imager;
use nalgebra::{DMatrix, DVector};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

/// Random-number stream of the maps.
const STREAM: u64 = 5;

/// Planned profiles and light curves together with those that have been taken, of one star. Epochs are profiles, and
/// then bins of light curves.
#[derive(Debug)]
pub struct Planned<'a> {
    /// Times, bins and noise of all of them.
    imager: &'a Imager,
    /// Spots before the data, jitter.
    assumed: Assumed,
    /// Parameters that are marginalised over.
    nuisances: &'a [Nuisance],
    /// The data taken, and the indices of their epochs among all.
    taken: Option<(&'a Marginal, &'a [usize])>,
    values: ParameterValues,
    basis: Basis,
    design: Design,
}

impl<'a> Planned<'a> {
    /// For a star at `values`, without a planet, with the data of `imager`, among which those of `taken` have these
    /// indices.
    pub fn new(
        imager: &'a Imager,
        mut values: ParameterValues,
        assumed: Assumed,
        nuisances: &'a [Nuisance],
        taken: Option<(&'a Marginal, &'a [usize])>,
    ) -> Self {
        values.set(Parameter::K, 0.0);
        let basis = Basis::new(&imager.grid);
        let design = Design::new(imager, &basis, &values.state());
        Planned { imager, assumed, nuisances, taken, values, basis, design }
    }

    /// Coefficients (H, epochs) of unspotted stars: the mean of the field.
    pub fn mean_maps(&self) -> DMatrix<f64> {
        DMatrix::zeros(self.basis.len(), self.imager.times_of_all_d().len())
    }

    /// Coefficients (H, epochs) of a map drawn at the time of each epoch: the most probable ones where data have been
    /// taken.
    ///
    /// # Errors
    /// [`FieldError`].
    pub fn drawn_maps(&self, seed: u64) -> Result<DMatrix<f64>, FieldError> {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        rng.set_stream(STREAM);
        let times_d = self.imager.times_of_all_d();
        let Some((taken, numbers)) = self.taken else {
            return Ok(self.assumed.field.drawn(&self.basis.degrees, &times_d, &mut rng));
        };
        let mut maps = self.mean_maps();
        let put = |maps: &mut DMatrix<f64>, numbers: &[usize], found: &DMatrix<f64>| {
            numbers.iter().zip(found.column_iter()).for_each(|(k, map)| maps.set_column(*k, &map));
        };
        put(&mut maps, numbers, &taken.settled.coefficients);
        let epochs = self.epochs(&maps);
        let epochs: Vec<Epoch> = numbers.iter().map(|k| epochs[*k].clone()).collect();
        let others: Vec<usize> = (0..times_d.len()).filter(|k| !numbers.contains(k)).collect();
        let of_others: Vec<f64> = others.iter().map(|k| times_d[*k]).collect();
        let how = self.basis.settling.compression;
        put(&mut maps, &others, &taken.settled.evidence.drawn(&epochs, how, &of_others, &mut rng)?);
        Ok(maps)
    }

    /// The quadratic in the orbit's velocities, without a gradient, of each of some `parts` (indices of epochs) for
    /// maps with these coefficients (H, epochs).
    ///
    /// # Errors
    /// [`FieldError`].
    pub fn velocities(&self, maps: &DMatrix<f64>, parts: &[Vec<usize>]) -> Result<Vec<VelocityQuadratic>, FieldError> {
        let epochs = self.epochs(maps);
        parts.iter().map(|part| self.of_part(maps, &epochs, part)).collect()
    }

    /// Linear around maps of these coefficients, with slopes and without misfits.
    fn epochs(&self, maps: &DMatrix<f64>) -> Vec<Epoch> {
        let brightness = self.design.brightness(&self.basis, maps);
        let slopes = self.design.slopes(self.imager, &self.values, &brightness, &self.stellar());
        let mut slopes = self.design.condensed(&slopes);
        let of_light = maps.columns_range(slopes.len()..);
        slopes.extend(Light::slopes((self.imager, &self.basis), &self.values, of_light.as_view(), &self.stellar()));
        let shares = self.imager.jitter_share_of_each().into_iter().chain(std::iter::repeat(1.0));
        let noisy = |((epoch, slopes), share): ((Epoch, DMatrix<f64>), f64)| {
            let misfit = DVector::zeros(epoch.len());
            let mut epoch = Epoch { slopes: slopes.columns(0, 1).into_owned(), misfit, ..epoch };
            if self.assumed.jitter_kms > 0.0 {
                epoch = epoch.jittered(&[share * self.assumed.jitter_kms]);
            }
            // the point around which ln Z would be expanded does not affect the information
            Epoch { slopes, divisor: DVector::zeros(0), ..epoch }
        };
        self.design.epochs(self.imager, maps).into_iter().zip(slopes).zip(shares).map(noisy).collect()
    }

    fn of_part(&self, maps: &DMatrix<f64>, epochs: &[Epoch], part: &[usize]) -> Result<VelocityQuadratic, FieldError> {
        let count = self.imager.profiles().count();
        // profiles first, as in all designs
        let (profiles, bins): (Vec<usize>, Vec<usize>) = part.iter().partition(|k| **k < count);
        let part = &[&profiles[..], &bins].concat();
        let some: Vec<Epoch> = part.iter().map(|k| epochs[*k].clone()).collect();
        let around = maps.select_columns(part);
        let (field, degrees) = (self.assumed.field, &self.basis.degrees);
        let evidence = Evidence::new(field, degrees, &some, &around, self.basis.settling.compression)?;
        let stellar = self.stellar();
        let quadratic = summed(evidence.quadratic(), some.len(), profiles.len(), stellar.len());
        let of_nights = self.imager.night_offsets(count, self.assumed.night_kms);
        let shared = of_nights.into_iter().chain(self.imager.common_velocities(count));
        let of_part = |one: Common| {
            let of = |i: usize| profiles.get(i).map_or(0.0, |k| one.of_each[*k]);
            Common { of_each: DVector::from_fn(quadratic.gradient.len(), |i, _| of(i)), ..one }
        };
        let information = with_integrated(quadratic.clone(), &shared.map(of_part).collect::<Vec<_>>())?.information;
        let all = self.imager.cycles();
        let cycles: Vec<f64> = profiles.iter().map(|k| all[*k]).collect();
        let expansion = Expansion {
            values: self.values,
            centre: coordinates(&self.values, &cycles, &stellar),
            cycles,
            stellar,
            log_likelihood: 0.0,
            gradient: DVector::zeros(information.nrows()),
            noise: information.clone(),
            information,
        };
        let velocities = expansion.velocities(self.nuisances);
        Ok(VelocityQuadratic { gradient: DVector::zeros(velocities.len()), ..velocities })
    }

    /// The stellar parameters among the nuisances.
    fn stellar(&self) -> Vec<Parameter> {
        self.nuisances.iter().map(|n| n.parameter).filter(|p| STELLAR.contains(p)).collect()
    }
}
