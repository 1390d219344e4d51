//! The paraboloid: the estimate of the parameters and of their error bars by Petit et al. (2015; `docs/method.md`
//! section 6).
//!
//! Least squares of a second-order polynomial to chi2 = -2 ln L at the nodes around the highest one (`region`). Its
//! vertex is the estimate, the inverse of half its Hessian the covariance, and the projection of the surface one above
//! the minimum on an axis the error bar: the square root of the diagonal. Without a well-defined minimum the reason is
//! returned instead.

use super::region::{Member, Rule, region};
use super::{Axis, Grid, Landscape, Node};
use crate::sampling::log_density::Status;
use nalgebra::{DMatrix, DVector};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::ops::RangeInclusive;

/// Fewest nodes per coefficient.
const LEAST: f64 = 1.5;

/// Default number of nodes per coefficient to which the region grows.
const ENOUGH: f64 = 2.0;

/// Smallest singular value of the polynomial's terms at the nodes, relative to the largest: below it they are not
/// independent.
const INDEPENDENT: f64 = 1e-6;

/// chi2 is accurate to 2e-3: a surface that rises by less towards the ends of the region has no curvature.
const FLAT: f64 = 4e-3;

/// The paraboloid around the highest node.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Paraboloid {
    /// Estimate and error bar of each parameter.
    pub parameters: BTreeMap<String, Estimate>,
    /// Covariance, in the order of the axes.
    pub covariance: Vec<Vec<f64>>,
    /// ln L at the vertex.
    pub log_likelihood: f64,
    /// Root mean square of the residuals (chi2).
    pub rms_chi2: f64,
    /// Number of nodes that it was fitted to.
    pub nodes: usize,
    /// Their largest chi2 above that of the highest one.
    pub delta_chi2: f64,
    /// Nodes among them that were left out because the target chi2 was out of reach.
    pub unreachable: usize,
    /// Nodes among them that were left out because the reconstruction failed.
    pub failed: usize,
}

/// One parameter.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Estimate {
    /// The vertex; in [0, 1) if periodic.
    pub vertex: f64,
    /// Half width of the surface of Delta chi2 = 1.
    pub error: f64,
    /// The range of the nodes around the vertex: a periodic parameter may leave [0, 1).
    pub reach: [f64; 2],
}

/// Why there is no paraboloid.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum Undefined {
    /// No node has a value.
    #[error("no well-defined minimum: no reconstruction converged")]
    Nothing,
    /// Nodes that miss the target chi2 are higher than all others.
    #[error("no well-defined minimum: the highest node, {0}, is beyond the reach of the target chi2")]
    Unreachable(usize),
    /// The minimum may be outside.
    #[error("no well-defined minimum: the highest node lies on the edge of {}", axes.join(", "))]
    Edge {
        /// The axes.
        axes: Vec<String>,
    },
    /// Too few nodes.
    #[error("no well-defined minimum: {found} nodes around the highest one, a paraboloid needs {needed}")]
    TooFew {
        /// Nodes in the region.
        found: usize,
        /// Nodes needed.
        needed: usize,
    },
    /// The positions of the nodes leave a coefficient undetermined.
    #[error(
        "no well-defined minimum: the {found} nodes around the highest one do not determine all terms of a paraboloid"
    )]
    Undetermined {
        /// Nodes in the region.
        found: usize,
    },
    /// A saddle or a plateau.
    #[error("no well-defined minimum: chi2 {} along {axis}, the form is not positive \
    definite", if *falls { "falls" } else { "stays flat" })]
    NotPositive {
        /// The axis that the direction of the least curvature is nearest to.
        axis: String,
        /// Whether it curves downwards.
        falls: bool,
    },
    /// The vertex is outside of the fitted region.
    #[error("no well-defined minimum: the vertex lies outside the nodes of the fit, at {axis} {vertex:.6}")]
    Outside {
        /// The axis along which it is outside.
        axis: String,
        /// Its coordinate there.
        vertex: f64,
    },
}

/// The paraboloid of a likelihood grid, through the nodes that `rule` chooses.
///
/// # Errors
/// [`Undefined`]: no well-defined minimum.
pub fn paraboloid(landscape: &Landscape, rule: Rule) -> Result<Paraboloid, Undefined> {
    let grid = landscape.grid();
    let top = landscape.best().ok_or(Undefined::Nothing)?;
    let edges = grid.edges(top.index);
    if !edges.is_empty() {
        return Err(Undefined::Edge { axes: edges.iter().map(|axis| axis.name.clone()).collect() });
    }
    if top.evaluation.status != Status::Converged {
        return Err(Undefined::Unreachable(top.index));
    }
    let coefficients = terms(&vec![0.0; grid.axes.len()]).len();
    let times = |factor: f64| (factor * coefficients as f64).ceil() as usize;
    let members = region(landscape, top.index, rule, |members| members.len() >= times(ENOUGH) && determined(members));
    if members.len() < times(LEAST) {
        return Err(Undefined::TooFew { found: members.len(), needed: times(LEAST) });
    }
    if !determined(&members) {
        return Err(Undefined::Undetermined { found: members.len() });
    }

    let scale = scale(&members);
    let rows = design(&members, &scale);
    let chi2 = DVector::from_iterator(members.len(), members.iter().map(|member| member.delta_chi2));
    let undetermined = Undefined::Undetermined { found: members.len() };
    let solved = rows.clone().svd(true, true).solve(&chi2, 0.0).map_err(|_| undetermined.clone())?;
    let (constant, gradient, hessian) = polynomial(&solved, grid.axes.len());
    check_curvature(&hessian, &grid.axes)?;
    let inverse = hessian.clone().cholesky().ok_or(undetermined)?.inverse();
    let vertex = -&inverse * &gradient;
    let residuals = rows * &solved - chi2;

    // from offsets in units of the region's size to the units of the parameters
    let unit: Vec<f64> = grid.axes.iter().zip(&scale).map(|(axis, scale)| axis.spacing() * scale).collect();
    let covariance = |i: usize, j: usize| 2.0 * inverse[(i, j)] * unit[i] * unit[j];
    let reach = reach(&members);
    let mut parameters = BTreeMap::new();
    for (i, axis) in grid.axes.iter().enumerate() {
        let place = |offset: f64| top.theta[i] + offset * axis.spacing();
        let (first, last) = (*reach[i].start() as f64, *reach[i].end() as f64);
        let at = vertex[i] * scale[i];
        if !(first..=last).contains(&at) {
            return Err(Undefined::Outside { axis: axis.name.clone(), vertex: place(at) });
        }
        let wrapped = if axis.periodic { place(at).rem_euclid(1.0) % 1.0 } else { place(at) };
        let turn = wrapped - place(at);
        let estimate =
            Estimate { vertex: wrapped, error: covariance(i, i).sqrt(), reach: [first, last].map(|o| place(o) + turn) };
        parameters.insert(axis.name.clone(), estimate);
    }
    let among = |node: &&Node| is_within(&reach, grid, node.index, top.index);
    let within: Vec<&Node> = landscape.nodes().iter().filter(among).collect();
    let count = |is: fn(Status) -> bool| within.iter().filter(|node| is(node.evaluation.status)).count();
    Ok(Paraboloid {
        parameters,
        covariance: (0..unit.len()).map(|i| (0..unit.len()).map(|j| covariance(i, j)).collect()).collect(),
        log_likelihood: top.evaluation.log_prob - 0.5 * (constant + 0.5 * gradient.dot(&vertex)),
        rms_chi2: (residuals.norm_squared() / members.len() as f64).sqrt(),
        nodes: members.len(),
        delta_chi2: members.iter().map(|member| member.delta_chi2).fold(0.0, f64::max),
        unreachable: count(|status| status == Status::Unreachable),
        failed: count(Status::is_failure),
    })
}

/// The terms of the polynomial at `u`: 1, u_i, u_i^2 / 2 and u_i u_j, so that the coefficients are value, gradient and
/// Hessian.
fn terms(u: &[f64]) -> Vec<f64> {
    let products =
        (0..u.len()).flat_map(|i| (i..u.len()).map(move |j| if i == j { 0.5 * u[i] * u[i] } else { u[i] * u[j] }));
    std::iter::once(1.0).chain(u.iter().copied()).chain(products).collect()
}

/// Value, gradient and Hessian from the coefficients of [`terms`].
fn polynomial(coefficients: &DVector<f64>, axes: usize) -> (f64, DVector<f64>, DMatrix<f64>) {
    let gradient = DVector::from_fn(axes, |i, _| coefficients[1 + i]);
    let mut hessian = DMatrix::zeros(axes, axes);
    let pairs = (0..axes).flat_map(|i| (i..axes).map(move |j| (i, j)));
    for ((i, j), value) in pairs.zip(coefficients.iter().skip(1 + axes)) {
        (hessian[(i, j)], hessian[(j, i)]) = (*value, *value);
    }
    (coefficients[0], gradient, hessian)
}

/// Extent of the nodes along each axis (in nodes).
fn scale(members: &[Member]) -> Vec<f64> {
    reach(members).iter().map(|reach| (-reach.start()).max(*reach.end()).max(1) as f64).collect()
}

/// The terms at every node, one row each.
fn design(members: &[Member], scale: &[f64]) -> DMatrix<f64> {
    let row = |member: &Member| terms(&member.offset.iter().zip(scale).map(|(o, s)| *o as f64 / s).collect::<Vec<_>>());
    let rows: Vec<Vec<f64>> = members.iter().map(row).collect();
    DMatrix::from_fn(rows.len(), rows[0].len(), |i, j| rows[i][j])
}

/// Whether the terms are independent at the nodes.
fn determined(members: &[Member]) -> bool {
    let rows = design(members, &scale(members));
    let values = (rows.nrows() >= rows.ncols()).then(|| rows.singular_values());
    values.is_some_and(|values| values.min() > INDEPENDENT * values.max())
}

/// Whether chi2 rises in all directions; `hessian` is in coordinates in which the region reaches to 1.
fn check_curvature(hessian: &DMatrix<f64>, axes: &[Axis]) -> Result<(), Undefined> {
    let eigen = hessian.clone().symmetric_eigen();
    let (least, curvature) = eigen.eigenvalues.argmin();
    if 0.5 * curvature > FLAT {
        return Ok(());
    }
    let nearest = eigen.eigenvectors.column(least).iamax();
    Err(Undefined::NotPositive { axis: axes[nearest].name.clone(), falls: 0.5 * curvature < -FLAT })
}

/// The offsets between which the nodes lie, on each axis.
fn reach(members: &[Member]) -> Vec<RangeInclusive<isize>> {
    let axes = members.first().map_or(0, |member| member.offset.len());
    let ends = |i: usize| {
        members.iter().fold((0, 0), |(first, last), member| (member.offset[i].min(first), member.offset[i].max(last)))
    };
    (0..axes).map(ends).map(|(first, last)| first..=last).collect()
}

/// Whether node `index` lies in the box of the offsets `reach` around node `centre`.
fn is_within(reach: &[RangeInclusive<isize>], grid: &Grid, index: usize, centre: usize) -> bool {
    let positions = grid.position(index).into_iter().zip(grid.position(centre));
    grid.axes.iter().zip(positions).zip(reach).all(|((axis, (k, centre)), reach)| {
        let apart = k as isize - centre as isize;
        let turn = if axis.is_circle() { axis.nodes as isize } else { 0 };
        [apart - turn, apart, apart + turn].iter().any(|offset| reach.contains(offset))
    })
}
