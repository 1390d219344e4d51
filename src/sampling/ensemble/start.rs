//! Starts: an over-dispersed draw around a centre, and the checks of any start.
//!
//! A start in a plane stays there under affine-invariant moves (Goodman & Weare 2010, section 2), hence the checks.
//! R-hat asks for starts wider than the posterior (Gelman & Rubin 1992), hence the scale.

use crate::sampling::ensemble::streams::{Purpose, random_numbers, stream};
use crate::sampling::ensemble::{EnsembleError, describe};
use crate::sampling::log_density::LogDensity;
use nalgebra::{DMatrix, DVector};
use rand::Rng;
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;

/// Draws tried for a walker before giving up.
const TRIES: usize = 2000;

/// Positions of walkers in physical coordinates, `[ensemble][walker][parameter]`.
pub type Positions = Vec<Vec<Vec<f64>>>;

/// The distribution of a start.
#[derive(Clone, Debug, PartialEq)]
pub struct StartDraw<'a> {
    /// The centre, in physical coordinates.
    pub centre: &'a [f64],
    /// Covariance in sampling coordinates.
    pub covariance: &'a DMatrix<f64>,
    /// Factor on the standard deviations; 1.5 or so makes the start over-dispersed.
    pub scale: f64,
    /// Number of ensembles.
    pub ensembles: usize,
    /// Walkers of each.
    pub walkers: usize,
    /// Seed of the draw.
    pub seed: u64,
}

/// The random numbers that the start of a walker is drawn with.
pub fn start_numbers(seed: u64, ensemble: usize, walker: usize) -> ChaCha8Rng {
    random_numbers(seed, stream(Purpose::Start, ensemble, walker), 0)
}

/// Draws start positions, `[ensemble][walker]`, in physical coordinates.
///
/// Gaussian in sampling coordinates; a position for which `allowed` (a finite log-prior, say) is false is drawn again.
/// The same arguments give the same positions.
///
/// # Errors
/// [`EnsembleError::StartCovariance`], [`EnsembleError::Shape`] (the centre), or [`EnsembleError::StartOutside`] when a
/// walker finds no allowed position.
pub fn draw_start(
    density: &dyn LogDensity,
    draw: &StartDraw,
    allowed: &dyn Fn(&[f64]) -> bool,
) -> Result<Positions, EnsembleError> {
    let dimension = density.names().len();
    if draw.centre.len() != dimension {
        let what = "parameters of the centre of the start".to_owned();
        return Err(EnsembleError::Shape { what, expected: dimension, found: draw.centre.len() });
    }
    let factor = (draw.covariance.shape() == (dimension, dimension))
        .then(|| (draw.covariance * (draw.scale * draw.scale)).cholesky())
        .flatten()
        .ok_or(EnsembleError::StartCovariance { dimension })?
        .unpack();
    let centre = DVector::from_vec(density.to_sampling(draw.centre));
    let walker = |ensemble: usize, walker: usize| {
        let mut rng = start_numbers(draw.seed, ensemble, walker);
        let mut position = || {
            let normal = DVector::from_fn(dimension, |_, _| rng.sample::<f64, _>(StandardNormal));
            density.to_physical((&centre + &factor * normal).as_slice())
        };
        (0..TRIES).map(|_| position()).find(|theta| theta.iter().all(|x| x.is_finite()) && allowed(theta)).ok_or_else(
            || EnsembleError::StartOutside {
                ensemble,
                walker,
                tries: TRIES,
                centre: describe(density.names(), draw.centre),
            },
        )
    };
    (0..draw.ensembles).map(|e| (0..draw.walkers).map(|w| walker(e, w)).collect()).collect()
}

/// Checks that positions are `[ensembles, walkers, dimension]` in shape.
pub(super) fn check_shape(positions: &[Vec<Vec<f64>>], shape: [usize; 3]) -> Result<(), EnsembleError> {
    let equal = |what: &dyn Fn() -> String, expected: usize, found: usize| {
        if expected == found { Ok(()) } else { Err(EnsembleError::Shape { what: what(), expected, found }) }
    };
    let [ensembles, walkers, dimension] = shape;
    equal(&|| "ensembles of the start".to_owned(), ensembles, positions.len())?;
    for (e, ensemble) in positions.iter().enumerate() {
        equal(&|| format!("walkers of the start of ensemble {e}"), walkers, ensemble.len())?;
        for (w, theta) in ensemble.iter().enumerate() {
            equal(&|| format!("parameters of the start of ensemble {e}, walker {w}"), dimension, theta.len())?;
        }
    }
    Ok(())
}

/// Checks that the positions are finite and that the walkers of each ensemble span the sampling coordinates.
pub(super) fn check_spread(density: &dyn LogDensity, positions: &[Vec<Vec<f64>>]) -> Result<(), EnsembleError> {
    let names = density.names();
    for (ensemble, walkers) in positions.iter().enumerate() {
        let mut columns = vec![Vec::with_capacity(walkers.len()); names.len()];
        for (walker, theta) in walkers.iter().enumerate() {
            let internal = density.to_sampling(theta);
            if let Some(i) = (0..names.len()).find(|&i| !(theta[i].is_finite() && internal[i].is_finite())) {
                let (name, value) = (names[i].clone(), theta[i]);
                return Err(EnsembleError::StartNotFinite { ensemble, walker, name, value });
            }
            columns.iter_mut().zip(internal).for_each(|(column, x)| column.push(x));
        }
        check_columns(names, ensemble, columns)?;
    }
    Ok(())
}

/// Gram-Schmidt over the columns (one per coordinate, each scaled by its spread): the first that depends on those
/// before it is named.
fn check_columns(names: &[String], ensemble: usize, columns: Vec<Vec<f64>>) -> Result<(), EnsembleError> {
    let mut basis: Vec<DVector<f64>> = Vec::new();
    for (i, column) in columns.into_iter().enumerate() {
        let values = DVector::from_vec(column);
        let centred = values.add_scalar(-values.mean());
        // Rounding alone gives a spread of some 1e-16 of the values.
        if centred.norm() <= 1e-12 * values.norm() {
            return Err(EnsembleError::StartNoSpread { ensemble, name: names[i].clone() });
        }
        let mut rest = centred.normalize();
        // Twice, so that rounding errors of the first pass do not look like independence.
        for _ in 0..2 {
            for unit in &basis {
                let along = unit.dot(&rest);
                rest.axpy(-along, unit, 1.0);
            }
        }
        if rest.norm() < 1e-7 {
            let (name, others) = (names[i].clone(), names[..i].to_vec());
            return Err(EnsembleError::StartDependent { ensemble, name, others });
        }
        basis.push(rest.normalize());
    }
    Ok(())
}
