//! R3: the likelihood grid in three dimensions and in slices, and the chain of the same data.

use crate::cases::{Failure, Laboratory, case, paper, with};
use crate::report::{Drawn, Report};
use dimcmc::Parameter;
use dimcmc::internals::inference::search;
use dimcmc::internals::runs::comparison::{Comparison, Pair};
use dimcmc::internals::runs::grid_scan::GridScan;
use dimcmc::internals::sampling::landscape::{Axis, Grid, Node, Rule};
use dimcmc::internals::surface::{CHI2, SPOTTEDNESS};
use serde_json::{Value, json};

/// Ends of the axes: K (km/s), Porb/Prot, phi.
const AXES: [(&str, f64, f64); 3] = [("k_kms", 0.0, 0.2), ("porb_over_prot", 1.2, 2.2), ("phi", 0.3, 0.7)];

/// R3.
pub fn landscape(laboratory: &Laboratory) -> Result<Report, Failure> {
    let changes = [
        ("/imaging/pixels", json!(laboratory.full_or_quick(20_000, 1000))),
        ("/sampler/walkers", json!(6)),
        // median to a twelfth of its error bar, width to six per cent
        ("/sampler/ess", json!(laboratory.full_or_quick(250, 200))),
        ("/sampler/rhat", json!(laboratory.full_or_quick(1.02, 1.05))),
    ];
    let config = with(paper(), &changes);
    let folder = laboratory.folder("R3")?;
    (laboratory.report)("R3: search");
    let (scene, found) = case::search(&config, &folder.join("config.json"), laboratory.pool)?;
    let [along, along_slice] = laboratory.full_or_quick([15, 50], [6, 9]);
    let axis = |&(name, min, max): &(&str, f64, f64), nodes: usize| Axis {
        name: name.to_owned(),
        min,
        max,
        nodes,
        periodic: Parameter::from_name(name).is_some_and(Parameter::is_phase),
    };
    (laboratory.report)("R3: likelihood grid in three dimensions");
    let whole = Grid { axes: AXES.iter().map(|a| axis(a, along)).collect() };
    let (grid, survey) = case::landscape(&scene, found.clone(), whole, &folder.join("grid"), laboratory.pool)?;
    let mut report = Report::new(["k_kms", "porb_over_prot", "phi", "spottedness", "chi2", "ln_l"]);
    for node in survey.landscape.valued() {
        let numbers = [SPOTTEDNESS, CHI2].map(|name| survey.landscape.number(node, name).unwrap_or(f64::NAN));
        report.row([&node.theta[..], &numbers, &[node.evaluation.log_prob]].concat());
    }
    let highest = |survey: &GridScan| survey.landscape.best().map(|node| node.theta.clone());
    report.number("highest_node", json!(highest(&survey)));
    let mut slices = 0;
    for (k, &(fixed, ..)) in AXES.iter().enumerate() {
        (laboratory.report)(&format!("R3: slice at the injected {fixed}"));
        let others = AXES.iter().enumerate().filter(|(i, _)| *i != k).map(|(_, a)| axis(a, along_slice));
        let free: Vec<_> = scene.settings.free.iter().filter(|f| f.parameter.name() != fixed).copied().collect();
        let settings = scene.search_settings();
        let found = search::find(&scene.imager, &scene.space_of(&free), settings, &|_| ())?;
        let grid = Grid { axes: others.collect() };
        let (route, survey) =
            case::landscape(&scene, found, grid, &folder.join(format!("slice_{fixed}")), laboratory.pool)?;
        slices += route.reconstructions;
        let spottedness = |node: &Node| survey.landscape.number(node, SPOTTEDNESS).unwrap_or(f64::NAN);
        let lowest = survey.landscape.valued().min_by(|a, b| spottedness(a).total_cmp(&spottedness(b)));
        report.number(
            &format!("slice_at_{fixed}"),
            json!({
                "axes": survey.header.grid.names().collect::<Vec<_>>(),
                "highest_node": highest(&survey),
                "least_spots": lowest.map(|node| node.theta.clone()),
                "nodes": route.reconstructions,
                "seconds": route.seconds,
                "paraboloid": route.parameters,
                "refused": route.note,
            }),
        );
    }
    (laboratory.report)("R3: chain");
    let (chain, _) = case::chain(&scene, found, &folder.join("chain"), laboratory.pool)?;
    let comparison = Comparison::of(&Pair::read(&folder.join("chain"), &folder.join("grid"))?, Rule::default())?;
    let chain_folder = Some(folder.join("chain"));
    let slices_drawn = AXES.iter().map(|(fixed, ..)| format!("slice_{fixed}"));
    for name in std::iter::once("grid".to_owned()).chain(slices_drawn) {
        // a chain over all parameters does not apply to a slice at one of them
        let chain = chain_folder.clone().filter(|_| name == "grid");
        report.drawn.push(Drawn { folder: folder.join(&name), name, chain });
    }
    report.number("grid_seconds", grid.seconds);
    report.number("grid_reconstructions", grid.reconstructions);
    report.number("slices_reconstructions", slices);
    report.number("chain_seconds", chain.seconds);
    report.number("chain_reconstructions", chain.reconstructions);
    report.number("chain_over_grid", chain.reconstructions as f64 / grid.reconstructions as f64);
    report.number("comparison", serde_json::to_value(&comparison).unwrap_or(Value::Null));
    Ok(report)
}
