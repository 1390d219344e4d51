//! Evaluations of the log-probability over the bulk of the paper's posterior: their rate, passes per evaluation, cost
//! beyond passes, and deviation from solutions to rounding error.

mod common;

use common::paper::{Bulk, Free, Passes, Size, scene};
use common::stopwatch::{quantile, seconds};
use common::table::{Table, Target, thousands};
use dimcmc::internals::maxent::SolverSettings;
use dimcmc::internals::sampling::log_density::{LogDensity, Status};
use dimcmc::internals::surface::static_map::Posterior;

/// An evaluation over its passes.
const OVER_PASSES: Target = Target::AtMost(1.5);

/// Error of the log-probability, in units of 1e-3.
const ERROR: Target = Target::AtMost(1.0);

/// Number of repetitions; the fastest counts.
const ROUNDS: usize = 5;

/// Model applications per evaluation: median and 95 %.
fn most_passes(free: Free) -> [Target; 2] {
    match free {
        Free::Three => [Target::AtMost(30.0), Target::AtMost(80.0)],
        Free::Seven => [Target::AtMost(45.0), Target::AtMost(120.0)],
    }
}

fn main() {
    if !common::wanted() {
        return;
    }
    let over = format!("evaluation / its passes ({OVER_PASSES})");
    let error = format!("largest error / 1e-3 ({ERROR})");
    let columns = [
        "free",
        "pixels",
        "evaluations / s and core",
        "passes: median",
        "95 %",
        &over,
        "/ as many in double precision",
        &error,
        "mean error / 1e-3",
    ];
    let mut table = Table::new("Evaluations over the bulk of the posterior", &columns);
    for free in [Free::Three, Free::Seven] {
        for (pixels, points) in [(5000, 200), (20_000, 60)] {
            let bulk = Bulk::new(&scene(free, Size::pixels(pixels)), points);
            measure(&bulk, free, pixels, &mut table);
        }
    }
    let [three, seven] = [Free::Three, Free::Seven].map(|free| most_passes(free).map(|target| target.to_string()));
    table.print(&format!(
        "Objective spottedness; points drawn from a Gaussian around the maximum with the covariance found there: 200 \
        of them, 60 on \
         20,000 pixels; the fastest of {ROUNDS} evaluations each. Targets of passes: {} and {} in 3-D, {} and {} in \
         7-D. An evaluation \
         over its passes is the median over points of its time over that of as many passes at the same point: as many \
         in double \
         precision, forward and transpose in turn, and as many there and back in single precision as it made; then \
         over as \
         many passes all of which are in double precision. Errors are differences to the log-probability with the \
         solver taken to rounding error.",
        three[0], three[1], seven[0], seven[1]
    ));
}

fn measure(bulk: &Bulk, free: Free, pixels: usize, table: &mut Table) {
    let (mut times, mut passes, mut errors) = (Vec::new(), Vec::new(), Vec::new());
    let (mut over_own, mut over_double) = (Vec::new(), Vec::new());
    let exact = bulk.posterior.clone().with_settings(SolverSettings::exact());
    for theta in &bulk.points {
        let evaluation = bulk.target.evaluate(theta);
        assert_eq!(evaluation.status, Status::Converged, "{theta:?}");
        let [mut time, mut double, mut own] = [f64::INFINITY; 3];
        for _ in 0..ROUNDS {
            time = time.min(seconds(|| bulk.target.evaluate(theta)));
            // a response in the memory used by the evaluation: two of them would evict each other from the cache
            let problem = Posterior::behind(&**bulk.target.posterior()).expect("a static map").reconstruct(theta).1;
            let (response, single) = (problem.response(), problem.single_applications());
            let mut only_passes = Passes::new(response);
            double = double.min(seconds(|| only_passes.run(response, evaluation.model_applications)));
            own = own.min(seconds(|| {
                only_passes.run(response, evaluation.model_applications - single);
                only_passes.run_single(response, single);
            }));
        }
        errors.push(1e3 * (evaluation.log_prob - exact.evaluate(theta).log_prob));
        times.push(time);
        over_own.push(time / own);
        over_double.push(time / double);
        passes.push(f64::from(evaluation.model_applications));
    }
    let [at_median, at_95] = most_passes(free);
    table.row([
        free.name().to_owned(),
        thousands(pixels),
        format!("{:.1}", times.len() as f64 / times.iter().sum::<f64>()),
        at_median.judge(quantile(&passes, 0.5), 0),
        at_95.judge(quantile(&passes, 0.95), 0),
        OVER_PASSES.judge(quantile(&over_own, 0.5), 2),
        format!("{:.2}", quantile(&over_double, 0.5)),
        ERROR.judge(errors.iter().fold(0.0, |most, error: &f64| most.max(error.abs())), 2),
        format!("{:.3}", errors.iter().sum::<f64>() / errors.len() as f64),
    ]);
}
