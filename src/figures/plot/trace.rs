//! A chain: its samples for figures, its walkers as functions of step, and its autocorrelation.

use super::PlotError;
use super::ephemeris::ephemeris;
use super::symbols::{Shown, nearest_turn, symbol};
use crate::figures::drawing::colour::{BLACK, GREY, SERIES, VERMILION};
use crate::figures::drawing::panel::Sides;
use crate::figures::drawing::{Align, Axis, Figure, Key, Legend, PAGE_MM, Paint, Panel, Rect, Scale, Stroke, range_of};
use crate::model::Prior;
use crate::numerics::quantile::quantile;
use crate::runs::manifest::{Manifest, RunSummary, kinds_and_goals};
use crate::runs::run::{CHAIN, read_chain};
use crate::sampling::chain::autocorrelation::{autocorrelation_function, autocorrelation_time};
use crate::sampling::chain::statistics::unwrap_around;
use crate::sampling::chain::{Chain, Goals, ParameterKind, Series};
use std::collections::BTreeMap;
use std::path::Path;

/// A chain with its summary.
#[derive(Debug)]
pub struct Sampled {
    /// The manifest of the run.
    pub manifest: Manifest,
    /// All its steps.
    pub chain: Chain,
    /// The prior of each parameter.
    pub priors: Vec<Prior>,
    /// The kind of each parameter.
    pub kinds: Vec<ParameterKind>,
    /// Goals for every parameter.
    pub goals: Goals,
    /// The summary of the chain.
    pub summary: RunSummary,
    /// Injected values of the parameters and of derived quantities.
    pub truth: Option<BTreeMap<String, f64>>,
}

impl Sampled {
    /// Reads the run in `folder`.
    ///
    /// # Errors
    /// [`PlotError`]: no run there, or one that cannot be read.
    pub fn read(folder: &Path) -> Result<Self, PlotError> {
        let manifest = Manifest::read(folder)?;
        let chain = read_chain(folder, &manifest)?;
        let settings = manifest.settings(folder)?;
        let (kinds, goals) = kinds_and_goals(&settings);
        let priors = settings.free.iter().map(|f| f.prior).collect();
        let wrong = |problem: String| PlotError::Content { path: folder.join(CHAIN), problem };
        let (summary, _) = manifest.summarise(&settings, &chain).map_err(|e| wrong(e.to_string()))?;
        let truth = manifest.truth(&settings, &summary);
        Ok(Sampled { manifest, chain, priors, kinds, goals, summary, truth })
    }

    /// The representation of parameter `i` in figures.
    pub(super) fn shown(&self, i: usize) -> Shown {
        let name = &self.summary.names[i];
        let rotation_period_d = ephemeris(&self.manifest.origin.config).map(|(period_d, _)| period_d);
        Shown::of(name, rotation_period_d, self.summary.parameters[name].ci95[1])
    }

    /// Draws of parameter `i` after the burn-in; a periodic one within half a cycle of its mode.
    pub(super) fn draws(&self, i: usize) -> Vec<f64> {
        let series = self.chain.series(i, self.summary.discarded_steps);
        let mut draws: Vec<f64> = series.into_iter().flatten().flatten().collect();
        if let Some(mode) = self.mode(i) {
            unwrap_around(&mut draws, mode);
        }
        draws
    }

    /// Mode of a periodic parameter, in the cycle of its median: the axis around it shows the values of tables.
    fn mode(&self, i: usize) -> Option<f64> {
        let one = &self.summary.parameters[&self.summary.names[i]];
        (self.kinds[i] == ParameterKind::Periodic).then(|| nearest_turn(one.mode, one.median))
    }

    /// The scale of a parameter: logarithmic where the prior is uniform in the logarithm.
    pub(super) fn scale(&self, i: usize) -> Scale {
        if matches!(self.priors[i], Prior::LogUniform { .. }) { Scale::Log } else { Scale::Linear }
    }

    /// Series of all steps, unwrapped like the draws.
    fn series(&self, i: usize, discard: usize) -> Series {
        let mut series = self.chain.series(i, discard);
        if let Some(mode) = self.mode(i) {
            series.iter_mut().flatten().for_each(|walker| unwrap_around(walker, mode));
        }
        series
    }

    /// The injected value, in the cycle of the draws.
    pub(super) fn truth(&self, i: usize) -> Option<f64> {
        let truth = *self.manifest.origin.truth.as_ref()?.get(&self.summary.names[i])?;
        Some(self.mode(i).map_or(truth, |mode| nearest_turn(truth, mode)))
    }

    /// The same unless it is so far from the draws that they would be compressed.
    pub(super) fn near_truth(&self, i: usize) -> Option<f64> {
        let one = &self.summary.parameters[&self.summary.names[i]];
        let median = self.mode(i).map_or(one.median, |mode| nearest_turn(one.median, mode));
        self.truth(i).filter(|truth| (truth - median).abs() < NEAR * one.sd)
    }

    /// Effective draws of the parameter with the fewest.
    pub(super) fn effective(&self) -> f64 {
        let least = self.summary.parameters.values().filter_map(|one| one.ess).fold(f64::INFINITY, f64::min);
        if least.is_finite() { least } else { 100.0 }
    }

    /// The range of a parameter's prior.
    pub(super) fn bounds(&self, i: usize) -> [f64; 2] {
        self.mode(i).map_or(self.priors[i].bounds().into(), |mode| [mode - 0.5, mode + 0.5])
    }
}

/// Standard deviations from the median within which an injected value widens an axis.
const NEAR: f64 = 8.0;

/// Number of walkers of each ensemble that are drawn.
const WALKERS: usize = 4;
/// Approximate number of steps that are drawn.
const STEPS: usize = 500;

/// The walkers as functions of step.
pub(super) fn traces(sampled: &Sampled) -> Figure {
    let names = &sampled.summary.names;
    let rows = names.len() as f64;
    let row_mm = if names.len() > 4 { 22.0 } else { 28.0 };
    let mut figure = Figure::new("traces", PAGE_MM, 22.0 + row_mm * rows);
    let (left, top, gap) = (46.0, 20.0, 8.0);
    let height = (figure.height - top - 28.0 - gap * (rows - 1.0)) / rows;
    let steps = sampled.chain.steps();
    let stride = steps.div_ceil(STEPS).max(1);
    let shape = sampled.chain.shape();
    for i in 0..names.len() {
        let frame = Rect { left, top: top + i as f64 * (height + gap), width: figure.width - left - 8.0, height };
        let shown = sampled.shown(i);
        let mut series = sampled.series(i, 0);
        series.iter_mut().flatten().flatten().for_each(|x| *x *= shown.factor);
        let truth = |value: Option<f64>| value.map(|x| shown.factor * x);
        let drawn = series.iter().flat_map(|ensemble| ensemble.iter().take(WALKERS));
        let values: Vec<f64> = drawn.flatten().copied().chain(truth(sampled.near_truth(i))).collect();
        let scale = sampled.scale(i);
        let y = Axis { label: shown.short_label(), range: range_of(values.into_iter(), scale, 0.05), scale };
        let panel = Panel { frame, x: Axis::linear("step", [0.0, (steps - 1).max(1) as f64]), y };
        let kept = sampled.summary.discarded_steps as f64;
        let [low, high] = panel.y.range;
        let burn_in = [[0.0, low], [kept, low], [kept, high], [0.0, high]];
        panel.area(&mut figure, "burn-in", &burn_in, Paint::fill(GREY.opacity(0.2)));
        for (e, ensemble) in series.iter().enumerate() {
            let pen = Stroke::new(SERIES[e % SERIES.len()].opacity(0.55), 0.45);
            for walker in ensemble.iter().take(WALKERS) {
                let points: Vec<[f64; 2]> =
                    walker.iter().enumerate().step_by(stride).map(|(step, x)| [step as f64, *x]).collect();
                panel.line(&mut figure, "walker", &points, pen);
            }
        }
        if let Some(truth) = truth(sampled.truth(i)) {
            panel.horizontal(&mut figure, "truth", truth, INJECTED);
        }
        panel.frame(&mut figure, Sides { below: i + 1 == names.len(), left: true });
    }
    let mut legend = Legend::default();
    // the names of many would be wider than the figure
    let short = shape.ensembles > 4;
    for (e, colour) in SERIES.into_iter().enumerate().take(shape.ensembles) {
        let name = if short && e > 0 { (e + 1).to_string() } else { format!("ensemble {}", e + 1) };
        legend.add(Key::Line(Stroke::new(colour, 1.0)), &name);
    }
    legend.add(Key::Area(GREY.opacity(0.2)), "burn-in");
    if sampled.manifest.origin.truth.is_some() {
        legend.add(Key::Line(INJECTED), "injected");
    }
    let middle = 0.5 * (left + figure.width);
    legend.row(&mut figure, [middle, 9.0]);
    let drawn = if shape.walkers > WALKERS { format!("{WALKERS} of the {}", shape.walkers) } else { "the".to_owned() };
    let every = if stride > 1 { format!(", every {stride} steps") } else { String::new() };
    figure.caption =
        format!("Traces of {drawn} walkers of each ensemble{every}; the grey steps are left out as burn-in.");
    figure
}

pub(super) const TRUTH: Stroke = Stroke::new(VERMILION, 1.0).dashed();

/// The pen of injected values over traces, where an ensemble has that colour.
const INJECTED: Stroke = Stroke::new(BLACK, 1.0).dashed();

/// Autocorrelation functions, and autocorrelation times over the length of the chain.
pub(super) fn autocorrelation(sampled: &Sampled) -> Figure {
    let mut figure = Figure::new("autocorrelation", PAGE_MM, 70.0);
    figure.caption = format!(
        "Left: autocorrelation of the walkers around the mean of their ensemble, after the burn-in. Right: the \
        integrated \
         autocorrelation time as the chain grows. Convergence is judged between independent ensembles, not by the \
         number of \
         autocorrelation times. {}",
        criterion(sampled)
    );
    let names = &sampled.summary.names;
    let discarded = sampled.summary.discarded_steps;
    let kept = sampled.chain.steps() - discarded;
    let all: Vec<Series> = (0..names.len()).map(|i| sampled.series(i, discarded)).collect();
    let time = |series: &Series| autocorrelation_time(series).map(|time| time.tau);
    let longest = all.iter().filter_map(time).fold(1.0, f64::max);
    let lags = ((8.0 * longest).ceil() as usize).max(10).min((kept / 2).max(1));
    let (top, left, gap) = (20.0, 40.0, 52.0);
    let width = 0.5 * (figure.width - left - gap - 8.0);
    let frame = |k: f64| Rect { left: left + k * (width + gap), top, width, height: figure.height - top - 28.0 };
    let function = Panel {
        frame: frame(0.0),
        x: Axis::linear("lag (steps)", [0.0, lags as f64]),
        y: Axis::linear("autocorrelation", [-0.25, 1.05]),
    };
    let growth: Vec<Vec<[f64; 2]>> = all.iter().map(|series| growth(series, kept)).collect();
    let largest = growth.iter().flatten().map(|p| p[1]).fold(1.0, f64::max);
    let smallest = growth.iter().flatten().map(|p| p[1]).filter(|tau| *tau > 0.0).fold(1.0, f64::min);
    let time = Panel {
        frame: frame(1.0),
        x: Axis::log("steps after the burn-in", [10.0, (kept as f64).max(20.0)]),
        y: Axis::log("autocorrelation time *τ* (steps)", [0.5 * smallest, 2.0 * largest]),
    };
    function.horizontal(&mut figure, "zero", 0.0, Stroke::new(GREY, 0.6));
    let mut legend = Legend::default();
    for (i, series) in all.iter().enumerate() {
        let pen = Stroke { dash: DASHES[i / SERIES.len() % 2], ..Stroke::new(SERIES[i % SERIES.len()], 1.0) };
        let points: Vec<[f64; 2]> =
            autocorrelation_function(series, lags).into_iter().enumerate().map(|(lag, r)| [lag as f64, r]).collect();
        function.line(&mut figure, "autocorrelation", &points, pen);
        time.line(&mut figure, "time", &growth[i], pen);
        legend.add(Key::Line(pen), symbol(&names[i]).0);
    }
    function.frame(&mut figure, Sides::BOTH);
    time.frame(&mut figure, Sides::BOTH);
    let Goals { rhat, ess } = sampled.goals;
    let said = if sampled.summary.converged { "converged" } else { "not converged" };
    time.note(&mut figure, &format!("{said}: R-hat ≤ {rhat}, ESS ≥ {ess}"), [0.03, 0.07], Align::Left);
    let middle = 0.5 * figure.width;
    legend.row(&mut figure, [middle, 9.0]);
    figure
}

/// The criterion of convergence, and whether the chain meets it.
fn criterion(sampled: &Sampled) -> String {
    let Goals { rhat, ess } = sampled.goals;
    let verdict = if sampled.summary.converged { "Converged" } else { "Not converged" };
    format!("{verdict}; criterion: R-hat of at most {rhat} and effective sample size of at least {ess}.")
}

const DASHES: [&[f64]; 2] = [&[], &[1.0, 1.6]];

/// The autocorrelation time of the first steps, for an increasing number of them.
fn growth(series: &Series, kept: usize) -> Vec<[f64; 2]> {
    let count = 12;
    let lengths = (0..=count).map(|k| (10.0 * (kept as f64 / 10.0).powf(k as f64 / count as f64)).round() as usize);
    let first = |steps: usize| -> Series {
        series.iter().map(|e| e.iter().map(|walker| walker[..steps.min(walker.len())].to_vec()).collect()).collect()
    };
    lengths
        .filter(|steps| (4..=kept).contains(steps))
        .filter_map(|steps| Some([steps as f64, autocorrelation_time(&first(steps))?.tau]))
        .collect()
}

/// Range of draws without a thousandth at either side, with a margin, within the bounds of the prior.
pub(super) fn shown_range(draws: &[f64], bounds: [f64; 2], also: Option<f64>, scale: Scale) -> [f64; 2] {
    let mut sorted = draws.to_vec();
    sorted.sort_unstable_by(f64::total_cmp);
    let ends = [quantile(&sorted, 0.001), quantile(&sorted, 0.999)];
    let [low, high] = range_of(ends.into_iter().chain(also), scale, 0.08);
    let (low, high) = (low.max(bounds[0]), high.min(bounds[1]));
    match scale {
        _ if high > low => [low, high],
        Scale::Linear => [ends[0] - 1.0, ends[1] + 1.0],
        Scale::Log => [0.5 * ends[0], 2.0 * ends[1]],
    }
}
