//! R12: the paper's outlook: differential rotation, inclination and vsini sampled together with the orbit.
//!
//! The chain starts three standard deviations off in each of them. A likelihood grid over the orbit only, with all
//! other parameters at their injected values, shows how many nodes a grid over all of them would need.

use crate::cases::{ENDS, Estimate, Failure, Laboratory, Nodes, case, paper, with};
use crate::report::{Drawn, Report};
use dimcmc::Parameter;
use dimcmc::internals::runs::comparison::{Comparison, Pair};
use dimcmc::internals::sampling::landscape::Rule;
use serde_json::{Value, json};

/// A parameter of the star: path in the config, injected value, offset of the start, prior.
struct Stellar {
    parameter: Parameter,
    key: &'static str,
    injected: f64,
    offset: f64,
    prior: &'static str,
    bounds: [f64; 2],
}

/// Shear of gamma = 0.01.
const SHEAR_RAD_D: f64 = 0.0209;

/// Angular velocity of the equator (rad/d): one turn in three days.
const OMEGA_EQ_RAD_D: f64 = std::f64::consts::TAU / 3.0;

const STELLAR: [Stellar; 4] = [
    Stellar {
        parameter: Parameter::OmegaEq,
        key: "/star/omega_eq_rad_d",
        injected: OMEGA_EQ_RAD_D,
        offset: 0.0024,
        prior: "uniform",
        bounds: [2.0, 2.2],
    },
    Stellar {
        parameter: Parameter::DOmega,
        key: "/star/domega_rad_d",
        injected: SHEAR_RAD_D,
        offset: 0.0058,
        prior: "uniform",
        bounds: [-0.1, 0.1],
    },
    Stellar {
        parameter: Parameter::Inclination,
        key: "/star/inclination_deg",
        injected: 38.0,
        offset: 1.38,
        prior: "isotropic",
        bounds: [10.0, 80.0],
    },
    Stellar {
        parameter: Parameter::Vsini,
        key: "/star/vsini_kms",
        injected: 40.0,
        offset: 0.066,
        prior: "uniform",
        bounds: [35.0, 45.0],
    },
];

/// First columns of the table: the cost of the chain, and that of an equally fine grid over all parameters.
const COSTS: [&str; 3] = ["dimensions", "chain_reconstructions", "nodes_of_a_grid"];

/// R12.
pub fn stellar(laboratory: &Laboratory) -> Result<Report, Failure> {
    let names: Vec<&str> =
        Parameter::ALL.iter().filter(|&&p| p != Parameter::Vsys && !p.is_surface()).map(|p| p.name()).collect();
    let ends = || ["true"].into_iter().chain(ENDS);
    let of_one = |name: &&str| ends().map(|end| format!("{name}_{end}")).collect::<Vec<_>>();
    let mut report = Report::new(COSTS.map(String::from).into_iter().chain(names.iter().flat_map(of_one)));
    for free in [2, 4] {
        let dimensions = 3 + free;
        let folder = laboratory.folder(&format!("R12/{dimensions}D"))?;
        laboratory.go_on()?;
        (laboratory.report)(&format!("R12, {dimensions} parameters: chain"));
        let (scene, found) =
            case::search(&config(laboratory, &STELLAR[..free], true), &folder.join("config.json"), laboratory.pool)?;
        let (chain, summary) = case::chain(&scene, found, &folder.join("chain"), laboratory.pool)?;
        (laboratory.report)(&format!("R12, {dimensions} parameters: likelihood grid of the orbit"));
        let (conditional, found) =
            case::search(&config(laboratory, &[], false), &folder.join("config.json"), laboratory.pool)?;
        let grid = Nodes::Around(laboratory.full_or_quick(9, 5)).grid(&found.optimum);
        let (grid, _) = case::landscape(&conditional, found, grid, &folder.join("grid"), laboratory.pool)?;
        let comparison = Comparison::of(&Pair::read(&folder.join("chain"), &folder.join("grid"))?, Rule::default())?;
        let truth = &scene.truth.expect("the star is simulated");
        let nodes = comparison.nodes_needed.unwrap_or(f64::NAN);
        let costs = [dimensions as f64, chain.reconstructions as f64, nodes];
        let mut row = costs.to_vec();
        let (mut inside, mut all) = (0, 0);
        for name in &names {
            let injected = truth[Parameter::from_name(name).expect("a parameter's own name")];
            let estimate = chain.parameters.get(*name);
            row.push(injected);
            row.extend(Estimate::numbers(estimate));
            if let Some(one) = estimate {
                inside += usize::from(one.ci95[0] <= injected && injected <= one.ci95[1]);
                all += 1;
            }
        }
        report.row(row);
        report.drawn.push(Drawn { name: format!("{dimensions}D"), folder: folder.join("chain"), chain: None });
        report.number(
            &format!("{dimensions}D"),
            json!({
                "inside_95": inside,
                "parameters": all,
                "converged": summary.converged,
                "reconstructions": chain.reconstructions,
                "seconds": chain.seconds,
                "effective_draws": summary.parameters.values().filter_map(|one| one.ess).reduce(f64::min),
                "nodes_of_a_grid": comparison.nodes_needed,
                "nodes_of_the_grid_over_the_orbit": grid.reconstructions,
                "orbit_alone": grid.parameters,
            }),
        );
    }
    Ok(report)
}

/// The star with shear, and these of its parameters free; the values of the config off by three standard deviations, or
/// not.
fn config(laboratory: &Laboratory, free: &[Stellar], off: bool) -> Value {
    let mut changes = vec![
        ("/imaging/pixels".to_owned(), json!(laboratory.full_or_quick(5000, 1000))),
        ("/sampler/walkers".to_owned(), json!(16)),
        ("/sampler/ess".to_owned(), json!(laboratory.full_or_quick(1000, 200))),
        ("/sampler/rhat".to_owned(), json!(laboratory.full_or_quick(1.01, 1.05))),
    ];
    for one in &STELLAR {
        let name = one.parameter.name();
        let is_free = free.iter().any(|other| other.parameter == one.parameter);
        let start = one.injected + if off && is_free { one.offset } else { 0.0 };
        changes.push((one.key.to_owned(), json!(start)));
        changes.push((format!("/observations/simulate/truth/{name}"), json!(one.injected)));
        if is_free {
            let prior = json!({ "prior": one.prior, "min": one.bounds[0], "max": one.bounds[1] });
            changes.push((format!("/parameters/{name}"), prior));
        }
    }
    if off {
        let orbit = [("k_kms", 0.1, 0.132), ("porb_over_prot", 1.7, 1.919), ("phi", 0.5, 0.623)];
        for (name, injected, start) in orbit {
            changes.push((format!("/observations/simulate/truth/{name}"), json!(injected)));
            changes.push((format!("/planet/{name}"), json!(start)));
        }
    }
    let changes: Vec<(&str, Value)> = changes.iter().map(|(key, value)| (key.as_str(), value.clone())).collect();
    with(paper(), &changes)
}
