//! The likelihood grid: its axes, and the priors of the search for its reference.

use super::orbits::without_planet;
use super::parameters::check_value;
use crate::data::config::error::Fault;
use crate::data::config::written::Grid as GridSection;
use crate::model::{FreeParameter, Parameter, ParameterValues, Prior};
use crate::sampling::landscape::{Axis, Grid};

/// Largest number of nodes of a likelihood grid: about a day of reconstructions.
pub const MOST_NODES: usize = 1_000_000;

/// Values closer than this, relative to their size, are lost in rounding.
const SMALLEST_SPACING: f64 = 1e-12;

/// The likelihood grid.
#[derive(Clone, Debug, PartialEq)]
pub struct GridSettings {
    /// Its nodes, the axes in the order of [`Parameter::ALL`].
    pub grid: Grid,
    /// The parameters on its axes, in the same order, with the priors of the search for the reference: those under
    /// `parameters`, or uniform along the axis. All other parameters are fixed at their values in the config. The
    /// priors do not enter the likelihood grid.
    pub free: Vec<FreeParameter>,
}

/// Resolves `grid`, where `free` are the parameters with a prior and `values` those of the config.
pub(super) fn resolve_grid(
    section: &GridSection,
    free: &[FreeParameter],
    values: &ParameterValues,
) -> Result<GridSettings, Fault> {
    let axes = section.axes.entries();
    if !(1..=3).contains(&axes.clone().count()) {
        return Err(Fault::new("grid.axes", format!("{} axes must be 1 to 3", axes.count())));
    }
    let total = axes.clone().fold(1usize, |product, (_, (_, _, nodes))| product.saturating_mul(*nodes));
    if total > MOST_NODES {
        return Err(Fault::new("grid.axes", format!("{total} nodes exceed {MOST_NODES}")));
    }
    let mut settings = GridSettings { grid: Grid { axes: Vec::new() }, free: Vec::new() };
    for (parameter, &(min, max, nodes)) in axes {
        let name = parameter.name().to_string();
        let axis = Axis { name, min, max, nodes, periodic: parameter.is_phase() };
        if parameter.is_ephemeris() {
            let problem = "takes no axis: give porb_over_prot or phi one in its place";
            return Err(Fault::new(format!("grid.axes.{}", parameter.name()), problem));
        }
        check_axis(parameter, &axis)?;
        let with_prior = free.iter().find(|f| f.parameter == parameter);
        settings.free.push(with_prior.copied().unwrap_or_else(|| along_the_axis(parameter, &axis, values)));
        settings.grid.axes.push(axis);
    }
    match without_planet(&settings.free, values) {
        Some((parameter, of)) => {
            let k = of.k.name();
            let problem =
                format!("has no effect while planet.{k} is fixed at 0: give {k} an axis or planet.{k} a value");
            Err(Fault::new(format!("grid.axes.{}", parameter.name()), problem))
        }
        None => Ok(settings),
    }
}

fn check_axis(parameter: Parameter, axis: &Axis) -> Result<(), Fault> {
    let key = format!("grid.axes.{}", axis.name);
    let &Axis { min, max, nodes, .. } = axis;
    check_value(parameter, min, &key)?;
    check_value(parameter, max, &key)?;
    let problem = match () {
        _ if nodes < 2 => format!("{nodes} nodes must be 2 or more; a parameter without an axis is fixed"),
        _ if min >= max => format!("min {min} must be below max {max}"),
        _ if !(max - min).is_finite() => format!("max {max} is too far from min {min}"),
        _ if axis.overlaps() => format!("from {min} to {max} is more than the period, which is 1"),
        _ if axis.spacing() < (SMALLEST_SPACING * min.abs().max(max.abs())).max(f64::MIN_POSITIVE) => {
            format!("{nodes} nodes from {min} to {max} are too close for double precision")
        }
        _ => return Ok(()),
    };
    Err(Fault::new(key, problem))
}

/// Range of the search for a parameter with an axis and no prior: the axis, extended to the config's value, where the
/// search starts.
fn along_the_axis(parameter: Parameter, axis: &Axis, values: &ParameterValues) -> FreeParameter {
    let start = values[parameter];
    let prior = match axis.periodic {
        true => Prior::Periodic,
        false => Prior::Uniform { min: axis.min.min(start), max: axis.max.max(start) },
    };
    FreeParameter { parameter, prior }
}
