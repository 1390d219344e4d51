//! Cost of a pass and of an evaluation as a function of pixels, profiles and velocity bins.

mod common;

use common::paper::{Free, Passes, Size, scene, truth};
use common::stopwatch::{Candidate, exponent, fastest, in_turn};
use common::table::{Table, Target, thousands};
use dimcmc::internals::data::scene::Scene;
use dimcmc::internals::maxent::Problem;
use dimcmc::internals::sampling::log_density::{Evaluation, LogDensity, Status};
use dimcmc::internals::star::Response;
use dimcmc::internals::surface::ObjectiveKind;
use dimcmc::internals::surface::static_map::{Posterior, Reference};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;

/// Exponent of the cost as a power of the size.
const EXPONENT: Target = Target::AtMost(1.1);

/// Pixels where another size is varied.
const PIXELS: usize = 2000;

/// Passes timed together.
const PASSES: u32 = 10;

/// Parameter vectors evaluated at each size.
const POINTS: usize = 24;

/// Target chi2 below that of the true map. A fixed chi2 per datum would require a different fit at every size, down to
/// impossible ones: noise moves chi2 by the square root of twice the number of data.
const FIT: f64 = 100.0;

/// Standard deviations of K, period and phase in the paper's setup.
const SPREAD: [f64; 3] = [0.01, 0.055, 0.03];

fn main() {
    if !common::wanted() {
        return;
    }
    let (pass, evaluation) = (format!("pass, ms ({EXPONENT})"), format!("evaluation, ms ({EXPONENT})"));
    let mut table = Table::new("Growth", &["", "size", &pass, &evaluation, "model applications each"]);
    let pixels = [1250, 5000, 20_000, 80_000];
    family("pixels", &pixels, Size::pixels, &mut table);
    let profiles = [25, 50, 100, 200, 400];
    family("profiles", &profiles, |profiles| Size { profiles, ..Size::pixels(PIXELS) }, &mut table);
    let bins = [57, 113, 225];
    // the velocities stay those of 57 bins of 1.8 km/s
    let finer = |bins| Size { step_kms: 1.8 * 56.0 / (bins - 1) as f64, ..Size::pixels(PIXELS) };
    family("bins", &bins, finer, &mut table);
    table.print(&format!(
        "One thread; the fastest of several rounds in which all sizes of a family take turns. 50 profiles, 57 bins \
        and {} pixels where they \
         are not what grows. 3-D, objective spottedness, {POINTS} points as far apart as the posterior is wide, chi2 \
         {FIT} below \
         that of the true map. Exponents by least squares in the logarithms.",
        thousands(PIXELS)
    ));
}

/// One size of a family.
struct Case {
    response: Response,
    posterior: Posterior,
    points: Vec<Vec<f64>>,
}

impl Case {
    fn new(size: Size) -> Self {
        let scene = scene(Free::Three, size);
        let data = scene.imager.data.depth.len() as f64;
        let target = (chi2_of_truth(&scene) - FIT) / data;
        // the omitted trade-off curve does not affect the cost of evaluations
        let reference = Reference::provisional(&scene.imager, scene.settings.values, target).unwrap();
        let response = reference.response.clone();
        let start = scene.space.start();
        let narrower = (2850.0 / data).sqrt();
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let mut point = || -> Vec<f64> {
            start.iter().zip(SPREAD).map(|(x, sd)| x + narrower * sd * rng.sample::<f64, _>(StandardNormal)).collect()
        };
        let points = (0..POINTS).map(|_| point()).collect();
        let posterior = Posterior::new(scene.imager, scene.space, ObjectiveKind::Spottedness, reference);
        Case { response, posterior, points }
    }

    fn pass(&self) -> Candidate<'_> {
        let mut passes = Passes::new(&self.response);
        Candidate::new("pass", move || passes.run(&self.response, PASSES))
    }

    fn evaluate(&self) -> Vec<Evaluation> {
        self.points.iter().map(|x| self.posterior.evaluate(x)).collect()
    }

    /// Model applications per evaluation in the mean, all of which reach their target.
    fn passes(&self) -> f64 {
        let evaluations = self.evaluate();
        assert!(evaluations.iter().all(|evaluation| evaluation.status == Status::Converged), "{evaluations:?}");
        evaluations.iter().map(|evaluation| f64::from(evaluation.model_applications)).sum::<f64>()
            / evaluations.len() as f64
    }
}

fn chi2_of_truth(scene: &Scene) -> f64 {
    let filling = scene.true_spot_filling().expect("a simulation");
    scene.imager.problem(scene.imager.response(&truth(scene))).linearise(&filling)
}

/// Rows for all sizes and the exponents.
fn family(name: &str, sizes: &[usize], size: impl Fn(usize) -> Size, table: &mut Table) {
    let cases: Vec<Case> = sizes.iter().map(|n| Case::new(size(*n))).collect();
    let mut passes: Vec<Candidate> = cases.iter().map(Case::pass).collect();
    let pass_times = times_of(&mut passes, 15, f64::from(PASSES));
    let mut evaluations: Vec<Candidate> =
        cases.iter().map(|case| Candidate::new("evaluation", move || case.evaluate())).collect();
    let evaluation_times = times_of(&mut evaluations, 3, POINTS as f64);
    for (k, case) in cases.iter().enumerate() {
        let (pass, evaluation) = (1e3 * pass_times[k], 1e3 * evaluation_times[k]);
        table.row([
            name.to_owned(),
            thousands(sizes[k]),
            format!("{pass:.3}"),
            format!("{evaluation:.1}"),
            format!("{:.0}", case.passes()),
        ]);
    }
    let sizes: Vec<f64> = sizes.iter().map(|n| *n as f64).collect();
    let judged = |times: &[f64]| EXPONENT.judge(exponent(&sizes, times), 2);
    table.row([name.to_owned(), "exponent".to_owned(), judged(&pass_times), judged(&evaluation_times), String::new()]);
}

/// Time of one of `parts` equal parts of every candidate, in its fastest round.
fn times_of(candidates: &mut [Candidate], rounds: usize, parts: f64) -> Vec<f64> {
    in_turn(candidates, rounds, 1).iter().map(|times| fastest(times) / parts).collect()
}
