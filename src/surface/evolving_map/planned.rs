//! What profiles will say of velocities, before there are any: the information `D'^T C^-1 D'` (`docs/method.md`
//! section 9) holds star, field, times and noise, but no data. What it depends on beside is the map that model and
//! slopes are made linear at: one that is drawn from the field, given the data that there are.

use super::expand::{summed, with_integrated};
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

/// Stream of the random numbers of maps.
const STREAM: u64 = 5;

/// Profiles that are planned, after those that have been taken, of one star.
#[derive(Debug)]
pub struct Planned<'a> {
    /// Times, bins and noise of all profiles, those that have been taken first.
    imager: &'a Imager,
    /// Spots before the data, jitter.
    assumed: Assumed,
    /// What is integrated out.
    nuisances: &'a [Nuisance],
    /// Those that have been taken.
    taken: Option<&'a Marginal>,
    values: ParameterValues,
    basis: Basis,
    design: Design,
}

impl<'a> Planned<'a> {
    /// Of a star at `values`, without a planet, with the profiles of `imager`, of which those of `taken` come first.
    pub fn new(
        imager: &'a Imager,
        mut values: ParameterValues,
        assumed: Assumed,
        nuisances: &'a [Nuisance],
        taken: Option<&'a Marginal>,
    ) -> Self {
        values.set(Parameter::K, 0.0);
        let basis = Basis::new(&imager.grid);
        let design = Design::new(imager, &basis, &values.state());
        Planned { imager, assumed, nuisances, taken, values, basis, design }
    }

    /// Coefficients (H, profiles) of unspotted stars: the mean of the field.
    pub fn mean_maps(&self) -> DMatrix<f64> {
        DMatrix::zeros(self.basis.len(), self.imager.profiles().count())
    }

    /// Coefficients (H, profiles) of a map drawn for the time of each profile: the most probable ones where profiles
    /// have been taken.
    ///
    /// # Errors
    /// [`FieldError`].
    pub fn drawn_maps(&self, seed: u64) -> Result<DMatrix<f64>, FieldError> {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        rng.set_stream(STREAM);
        let times_d: Vec<f64> = self.imager.times_d();
        let Some(taken) = self.taken else {
            return Ok(self.assumed.field.drawn(&self.basis.degrees, &times_d, &mut rng));
        };
        let known = &taken.settled.coefficients;
        let mut maps = known.clone().resize_horizontally(times_d.len(), 0.0);
        let epochs = self.epochs(&maps, 0..known.ncols());
        let how = self.basis.settling.compression;
        let drawn = taken.settled.evidence.drawn(&epochs, how, &times_d[known.ncols()..], &mut rng)?;
        maps.columns_mut(known.ncols(), drawn.ncols()).copy_from(&drawn);
        Ok(maps)
    }

    /// The quadratic in the orbit's velocities, without a gradient, of each of some `parts` (numbers of profiles) for
    /// maps with these coefficients (H, profiles).
    ///
    /// # Errors
    /// [`FieldError`].
    pub fn velocities(&self, maps: &DMatrix<f64>, parts: &[Vec<usize>]) -> Result<Vec<VelocityQuadratic>, FieldError> {
        let epochs = self.epochs(maps, 0..maps.ncols());
        parts.iter().map(|part| self.of_part(maps, &epochs, part)).collect()
    }

    /// Those of some profiles, linear around maps of these coefficients, with slopes and without misfits.
    fn epochs(&self, maps: &DMatrix<f64>, profiles: std::ops::Range<usize>) -> Vec<Epoch> {
        let brightness = self.design.brightness(&self.basis, maps);
        let slopes = self.design.slopes(self.imager, &self.values, &brightness, &self.stellar());
        let slopes = self.design.condensed(&slopes);
        let shares = self.imager.jitter_share_of_each().into_iter().chain(std::iter::repeat(1.0));
        let noisy = |((epoch, slopes), share): ((Epoch, DMatrix<f64>), f64)| {
            let misfit = DVector::zeros(epoch.len());
            let mut epoch = Epoch { slopes: slopes.columns(0, 1).into_owned(), misfit, ..epoch };
            if self.assumed.jitter_kms > 0.0 {
                epoch = epoch.jittered(&[share * self.assumed.jitter_kms]);
            }
            // where ln Z would be expanded says nothing of information
            Epoch { slopes, divisor: DVector::zeros(0), ..epoch }
        };
        let all = self.design.epochs(self.imager, maps).into_iter().zip(slopes).zip(shares);
        all.skip(profiles.start).take(profiles.len()).map(noisy).collect()
    }

    fn of_part(&self, maps: &DMatrix<f64>, epochs: &[Epoch], part: &[usize]) -> Result<VelocityQuadratic, FieldError> {
        let some: Vec<Epoch> = part.iter().map(|k| epochs[*k].clone()).collect();
        let around = maps.select_columns(part);
        let (field, degrees) = (self.assumed.field, &self.basis.degrees);
        let evidence = Evidence::new(field, degrees, &some, &around, self.basis.settling.compression)?;
        let stellar = self.stellar();
        let quadratic = summed(evidence.quadratic(), some.len(), some.len(), stellar.len());
        let offsets = self.imager.night_offsets(maps.ncols()).into_iter().map(|offset| Common {
            of_each: DVector::from_fn(quadratic.gradient.len(), |i, _| part.get(i).map_or(0.0, |k| offset.of_each[*k])),
            ..offset
        });
        let information = with_integrated(quadratic.clone(), &offsets.collect::<Vec<_>>())?.information;
        let all = self.imager.cycles();
        let cycles: Vec<f64> = part.iter().map(|k| all[*k]).collect();
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

    /// The star's own parameters among the nuisances.
    fn stellar(&self) -> Vec<Parameter> {
        self.nuisances.iter().map(|n| n.parameter).filter(|p| STELLAR.contains(p)).collect()
    }
}
