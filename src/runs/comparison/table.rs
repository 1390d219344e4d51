//! The comparison as text: for each parameter one line per estimate, then the costs, and notes.

use super::{Compared, Comparison, Cost, Interval};
use crate::numerics::text::aligned;

impl Comparison {
    /// The table.
    pub fn table(&self) -> String {
        let head = ["parameter", "by", "value", "- 68%", "+ 68%", "difference", "width", "cdf", "by chance"];
        let mut rows = vec![head.map(str::to_owned).to_vec()];
        for name in &self.names {
            rows.extend(self.rows(name, &self.parameters[name]));
        }
        let mut text = aligned(&rows);
        text +=
            "difference, width: in error bars of the chain; cdf: largest difference of the cumulative distributions\n";
        if let Some(refused) = &self.paraboloid_refused {
            text += &format!("paraboloid: {refused}\n");
        }
        text += &cost(&self.cost);
        if let Some(nodes) = self.nodes_needed {
            text += &format!(
                "as fine a grid over all {} sampled parameters would take {} nodes\n",
                self.names.len(),
                rounded(nodes)
            );
        }
        self.notes.iter().for_each(|note| text += &format!("note: {note}\n"));
        text
    }

    fn rows(&self, name: &str, one: &Compared) -> Vec<Vec<String>> {
        let decimals = decimals(&one.chain);
        let number = |x: f64| format!("{x:.decimals$}");
        let line = |by: &str, value: f64, ci68: Option<[f64; 2]>, against: [Option<String>; 4]| {
            let sides = ci68.map(|[low, high]| [number(value - low), number(high - value)]);
            let [minus, plus] = sides.map_or([None, None], |sides| sides.map(Some));
            let [difference, width, cdf, chance] = against;
            let cells = [minus, plus, difference, width, cdf, chance].map(|cell| cell.unwrap_or_else(|| "-".into()));
            [vec![name.to_owned(), by.to_owned(), number(value)], cells.to_vec()].concat()
        };
        let apart = |value: f64| Some(format!("{:+.2}", one.chain.difference(value, one.periodic)));
        let mut rows = vec![line("chain", one.chain.value, Some(one.chain.ci68), [const { None }; 4])];
        let others = [("paraboloid", one.paraboloid, None), ("landscape", one.landscape, one.distribution)];
        for (by, estimate, distance) in others {
            let Some(estimate) = estimate else { continue };
            let width = Some(format!("{:.2}", estimate.width_ratio));
            let cdf = distance.map(|distance| format!("{:.3}", distance.largest));
            let chance = distance.and_then(|distance| distance.by_chance95).map(|chance| format!("{chance:.3}"));
            let interval = estimate.interval;
            rows.push(line(by, interval.value, Some(interval.ci68), [apart(interval.value), width, cdf, chance]));
        }
        for (by, value) in [("fixed at", one.fixed_at), ("truth", one.truth)] {
            rows.extend(value.map(|value| line(by, value, None, [apart(value), None, None, None])));
        }
        rows
    }
}

fn cost(cost: &Cost) -> String {
    let (chain, landscape) = (&cost.chain, &cost.landscape);
    let draws = chain.effective_draws.map_or_else(String::new, |draws| format!(", {draws:.0} effective draws"));
    let used =
        landscape.paraboloid_nodes.map_or_else(String::new, |nodes| format!(", {nodes} of them in the paraboloid"));
    let seconds = |seconds: Option<f64>| seconds.map_or_else(String::new, |seconds| format!(" in {seconds:.1} s"));
    format!(
        "chain: {} reconstructions{}, {:.0} model applications each in the median, {} in all{draws}\n\
         likelihood grid: {} reconstructions{}, {} model applications each in the median, {} in all{used}\n",
        chain.reconstructions,
        seconds(chain.seconds),
        chain.model_applications_median,
        chain.model_applications,
        landscape.reconstructions,
        seconds(landscape.seconds),
        landscape.model_applications_median,
        landscape.model_applications,
    )
}

/// Decimals for two digits of the error bar.
fn decimals(interval: &Interval) -> usize {
    let width = interval.half_width();
    if width > 0.0 && width.is_finite() { (1.0 - width.log10().floor()).clamp(0.0, 12.0) as usize } else { 6 }
}

/// A large number rounded to two digits.
fn rounded(x: f64) -> String {
    if x < 1e5 { format!("{x:.0}") } else { format!("{x:.1e}") }
}
