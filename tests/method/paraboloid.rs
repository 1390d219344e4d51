//! The paraboloid and the marginals of likelihood grids with known results.

use dimcmc::internals::sampling::landscape::{
    Axis, Grid, Landscape, Marginal, Node, Paraboloid, Rule, Undefined, paraboloid, paraboloid_table,
};
use dimcmc::internals::sampling::log_density::{Evaluation, Status};
use nalgebra::{DMatrix, DVector};

fn axis(name: &str, min: f64, max: f64, nodes: usize) -> Axis {
    Axis { name: name.into(), min, max, nodes, periodic: name == "phi" }
}

/// The likelihood grid of `log_likelihood`; where that is NaN the reconstruction failed.
fn landscape(axes: &[Axis], log_likelihood: impl Fn(&[f64]) -> f64) -> Landscape {
    with_status(axes, |theta| (log_likelihood(theta), Status::Converged))
}

fn with_status(axes: &[Axis], node: impl Fn(&[f64]) -> (f64, Status)) -> Landscape {
    let grid = Grid { axes: axes.to_vec() };
    let mut landscape = Landscape::new(grid.clone(), Vec::new());
    for index in 0..grid.len() {
        let theta = grid.theta(index);
        let (log_likelihood, status) = node(&theta);
        let evaluation = match log_likelihood.is_nan() {
            true => Evaluation::rejected(Status::StoppedShort),
            false => Evaluation { status, ..Evaluation::of(log_likelihood) },
        };
        landscape.push(Node { index, theta, evaluation }).unwrap();
    }
    landscape
}

/// A Gaussian; phi counts the shorter way round.
struct Gaussian {
    axes: Vec<Axis>,
    mean: Vec<f64>,
    covariance: DMatrix<f64>,
}

impl Gaussian {
    /// From the given error bars and correlations (upper triangle).
    fn new(axes: &[Axis], mean: &[f64], errors: &[f64], correlations: &[f64]) -> Self {
        let n = axes.len();
        let mut covariance = DMatrix::from_fn(n, n, |i, j| if i == j { errors[i] * errors[i] } else { 0.0 });
        let pairs = (0..n).flat_map(|i| (i + 1..n).map(move |j| (i, j)));
        for ((i, j), correlation) in pairs.zip(correlations) {
            covariance[(i, j)] = correlation * errors[i] * errors[j];
            covariance[(j, i)] = covariance[(i, j)];
        }
        Gaussian { axes: axes.to_vec(), mean: mean.to_vec(), covariance }
    }

    fn offset(&self, theta: &[f64]) -> DVector<f64> {
        DVector::from_fn(theta.len(), |i, _| {
            let x = theta[i] - self.mean[i];
            if self.axes[i].periodic { x - x.round() } else { x }
        })
    }

    fn log_likelihood(&self, theta: &[f64]) -> f64 {
        let x = self.offset(theta);
        -0.5 * x.dot(&(self.covariance.clone().try_inverse().unwrap() * &x)) - 7.25
    }

    fn landscape(&self) -> Landscape {
        landscape(&self.axes, |theta| self.log_likelihood(theta))
    }
}

fn fit(landscape: &Landscape) -> Paraboloid {
    paraboloid(landscape, Rule::default()).unwrap()
}

fn refusal(landscape: &Landscape) -> String {
    let refused: Undefined = paraboloid(landscape, Rule::default()).unwrap_err();
    let text = refused.to_string();
    assert_eq!(paraboloid_table(&Err(refused), landscape.grid(), None), format!("{text}\n"));
    text.strip_prefix("no well-defined minimum: ").unwrap().to_owned()
}

/// One to three axes of quite different scales, correlated, phi across 0: nothing that comes out could be taken for
/// another.
fn examples() -> Vec<Gaussian> {
    let k = axis("k_kms", 0.0, 0.2, 15);
    let period = axis("porb_over_prot", 1.2, 2.2, 15);
    let across = axis("phi", 0.8, 1.2, 17);
    let circle = axis("phi", 0.0, 1.0, 25);
    vec![
        Gaussian::new(std::slice::from_ref(&k), &[0.103], &[0.0106], &[]),
        Gaussian::new(std::slice::from_ref(&circle), &[0.993], &[0.041], &[]),
        Gaussian::new(&[k.clone(), period.clone()], &[0.103, 1.71], &[0.0106, 0.073], &[0.5]),
        Gaussian::new(&[period.clone(), across.clone()], &[1.71, 0.004], &[0.073, 0.041], &[-0.85]),
        Gaussian::new(
            &[k.clone(), period.clone(), across],
            &[0.103, 1.71, 0.996],
            &[0.0106, 0.073, 0.041],
            &[0.3, -0.2, -0.8],
        ),
        Gaussian::new(&[k, period, circle], &[0.103, 1.71, 0.004], &[0.0106, 0.073, 0.041], &[-0.4, 0.6, 0.1]),
    ]
}

#[test]
fn a_quadratic_gives_back_vertex_covariance_and_errors() {
    for gaussian in examples() {
        let landscape = gaussian.landscape();
        let rules = [(None, None), (Some(40), None), (None, Some(2)), (Some(16), Some(3))];
        for (nodes, radius) in rules.into_iter().take(if gaussian.axes.len() == 1 { 1 } else { 4 }) {
            let found = paraboloid(&landscape, Rule { nodes, radius }).unwrap();
            for (i, axis) in gaussian.axes.iter().enumerate() {
                let one = found.parameters[&axis.name];
                let error = gaussian.covariance[(i, i)].sqrt();
                // rounding: chi2 of some tens, in double precision
                assert!((one.vertex - gaussian.mean[i]).abs() < 1e-10 * error, "{}: {one:?}", axis.name);
                assert!((one.error / error - 1.0).abs() < 1e-10, "{}: {one:?} {error}", axis.name);
                assert!(one.reach[0] < one.vertex && one.vertex < one.reach[1] && one.reach[1] - one.reach[0] < 1.0);
                for j in 0..gaussian.axes.len() {
                    let scale = error * gaussian.covariance[(j, j)].sqrt();
                    assert!((found.covariance[i][j] - gaussian.covariance[(i, j)]).abs() < 1e-10 * scale);
                }
            }
            assert!((found.log_likelihood + 7.25).abs() < 1e-10 && found.rms_chi2 < 1e-10);
            assert!(nodes.is_none_or(|nodes| found.nodes == nodes), "{}", found.nodes);
            assert_eq!((found.unreachable, found.failed), (0, 0));
        }
    }
}

/// chi2 = -2 ln L: with chi2 = -ln L error bars would be larger by the root of 2, with -4 ln L smaller.
#[test]
fn the_error_bar_is_where_ln_l_has_fallen_by_a_half() {
    let gaussian = Gaussian::new(&[axis("k_kms", 0.0, 0.2, 41)], &[0.1], &[0.02], &[]);
    let one = fit(&gaussian.landscape()).parameters["k_kms"];
    let fall = gaussian.log_likelihood(&[one.vertex]) - gaussian.log_likelihood(&[one.vertex + one.error]);
    assert!((fall - 0.5).abs() < 1e-9, "{fall}");
    assert!((one.error - 0.02).abs() < 1e-10);
}

/// The surface of Delta chi2 = 1 reaches as far as its error bar on every axis, the others free.
#[test]
fn error_bars_are_projections_and_no_sections() {
    for gaussian in examples().iter().filter(|gaussian| gaussian.axes.len() > 1) {
        let found = fit(&gaussian.landscape());
        for (i, axis) in gaussian.axes.iter().enumerate() {
            // the point of the surface that is farthest along the axis
            let column = gaussian.covariance.column(i) / gaussian.covariance[(i, i)].sqrt();
            let farthest: Vec<f64> = gaussian.mean.iter().zip(column.iter()).map(|(m, x)| m + x).collect();
            let delta_chi2 = -2.0 * (gaussian.log_likelihood(&farthest) + 7.25);
            assert!((delta_chi2 - 1.0).abs() < 1e-9);
            assert!((farthest[i] - gaussian.mean[i] - found.parameters[&axis.name].error).abs() < 1e-9);
        }
    }
}

/// By default the nodes are those up to 4 above the lowest chi2: few tens of them on the paper's grid.
#[test]
fn the_region_is_that_around_the_minimum() {
    let gaussian = &examples()[4];
    let found = fit(&gaussian.landscape());
    assert!((20..60).contains(&found.nodes), "{}", found.nodes);
    assert!(found.delta_chi2 < 8.0, "{}", found.delta_chi2);
    // on a fine grid, all of them and no more
    let fine = Gaussian::new(&[axis("k_kms", 0.0, 0.2, 401)], &[0.1], &[0.01], &[]);
    let found = fit(&fine.landscape());
    assert_eq!(found.nodes, 81);
    assert!((found.delta_chi2 - 4.0).abs() < 1e-6);
    // another maximum, 0.1 lower, is not fitted along
    let rival = landscape(&fine.axes, |x| {
        let peak = |mean: f64| -0.5 * ((x[0] - mean) / 0.005f64).powi(2);
        peak(0.06).max(peak(0.15) - 0.1)
    });
    let one = fit(&rival).parameters["k_kms"];
    assert!((one.vertex - 0.06).abs() < 1e-9 && (one.error - 0.005).abs() < 1e-9, "{one:?}");
}

/// A cubic term, as sigma grows with the period, biases vertex and error bar by little.
#[test]
fn a_skewed_minimum_biases_little() {
    // as fine in the period that its region shows the cubic
    let axes = [axis("k_kms", 0.0, 0.2, 15), axis("porb_over_prot", 1.2, 2.2, 41)];
    let gaussian = Gaussian::new(&axes, &[0.103, 1.71], &[0.0106, 0.073], &[0.5]);
    for skew in [-0.05, 0.05] {
        let skewed = landscape(&gaussian.axes, |theta| {
            let z = gaussian.offset(theta)[1] / 0.073;
            gaussian.log_likelihood(theta) + skew * z.powi(3) / 2.0
        });
        let found = fit(&skewed);
        for (i, axis) in gaussian.axes.iter().enumerate() {
            let (one, error) = (found.parameters[&axis.name], gaussian.covariance[(i, i)].sqrt());
            let apart = one.vertex - gaussian.mean[i];
            // the cubic term is 0.05 at one sigma and 0.4 at two, a third of it linear within the region
            assert!((apart - apart.round()).abs() < 0.2 * error, "{}: {one:?}", axis.name);
            assert!((one.error / error - 1.0).abs() < 0.05, "{}: {one:?}", axis.name);
        }
        assert!((0.01..0.5).contains(&found.rms_chi2), "{}", found.rms_chi2);
    }
}

#[test]
fn nodes_without_a_reconstruction_are_left_out() {
    let gaussian = &examples()[3];
    let hole = |theta: &[f64]| (theta[0] - 1.77).abs() < 0.04 && gaussian.offset(theta)[1].abs() < 0.02;
    let good = fit(&gaussian.landscape());
    let failed =
        fit(&landscape(&gaussian.axes, |theta| if hole(theta) { f64::NAN } else { gaussian.log_likelihood(theta) }));
    // the continuation beyond the reach of the target is no parabola
    let reached = |theta: &[f64]| match hole(theta) {
        true => (-30.0, Status::Unreachable),
        false => (gaussian.log_likelihood(theta), Status::Converged),
    };
    let unreachable = fit(&with_status(&gaussian.axes, reached));
    assert!(failed.failed > 0 && failed.unreachable == 0 && unreachable.unreachable == failed.failed);
    for found in [&failed, &unreachable] {
        assert!(found.nodes < good.nodes + found.failed + found.unreachable);
        for (name, one) in &found.parameters {
            assert!((one.error / good.parameters[name].error - 1.0).abs() < 1e-9);
        }
    }
    let text = paraboloid_table(&Ok(failed), &Grid { axes: gaussian.axes.clone() }, None);
    assert!(text.contains("left out among them: 0 beyond the reach of the target chi2, "), "{text}");
}

#[test]
fn what_has_no_minimum_is_refused_with_the_reason() {
    let axes = [axis("k_kms", 0.0, 0.2, 15), axis("porb_over_prot", 1.2, 2.2, 15)];
    let peak = |theta: &[f64]| -0.5 * ((theta[0] - 0.1) / 0.01).powi(2);

    let edge = Gaussian::new(&axes, &[-0.05, 1.7], &[0.01, 0.1], &[0.0]);
    assert_eq!(refusal(&edge.landscape()), "the highest node lies on the edge of k_kms");
    let corner = Gaussian::new(&axes, &[-0.05, 3.0], &[0.01, 0.1], &[0.0]);
    assert_eq!(refusal(&corner.landscape()), "the highest node lies on the edge of k_kms, porb_over_prot");
    // two values are two edges
    let two = [axes[0].clone(), axis("vsys_kms", -0.1, 0.1, 2)];
    assert_eq!(refusal(&landscape(&two, peak)), "the highest node lies on the edge of vsys_kms");

    let plateau = landscape(&axes, |theta| if theta[0] == 0.1 && (theta[1] - 1.7).abs() < 0.03 { 1e-9 } else { 0.0 });
    assert!(refusal(&plateau).starts_with("chi2 stays flat along "), "{}", refusal(&plateau));
    let ridge = landscape(&axes, |theta| peak(theta) + 1e-9 * if (theta[1] - 1.7).abs() < 0.03 { 1.0 } else { 0.0 });
    assert_eq!(refusal(&ridge), "chi2 stays flat along porb_over_prot, the form is not positive definite");
    // the highest node stands on a saddle by itself
    let saddle = landscape(&axes, |theta| {
        let x = (theta[1] - 1.7) / axes[1].spacing();
        0.1 * peak(theta) + 0.02 * x * x - 0.0004 * x.powi(4) + if theta[0] == 0.1 && x.abs() < 0.3 { 0.5 } else { 0.0 }
    });
    assert_eq!(refusal(&saddle), "chi2 falls along porb_over_prot, the form is not positive definite");

    // a cliff: the parabola of one side has its vertex beyond the last node
    let cliff =
        landscape(
            &axes[..1],
            |theta| if theta[0] > 0.107 { f64::NAN } else { -0.5 * ((theta[0] - 0.17) / 0.1).powi(2) },
        );
    let text = refusal(&cliff);
    assert!(text.starts_with("the vertex lies outside the nodes of the fit, at k_kms 0.17"), "{text}");

    let lonely = landscape(&axes, |theta| if (theta[1] - 1.7).abs() < 0.03 { peak(theta) } else { f64::NAN });
    assert!(refusal(&lonely).contains("do not determine all terms"), "{}", refusal(&lonely));
    let few = landscape(
        &axes,
        |theta| if peak(theta) > -0.5 && (theta[1] - 1.7).abs() < 0.1 { peak(theta) } else { f64::NAN },
    );
    assert!(refusal(&few).starts_with("3 nodes around the highest one, a paraboloid needs 9"), "{}", refusal(&few));
    assert_eq!(refusal(&landscape(&axes, |_| f64::NAN)), "no reconstruction converged");
    let round = |theta: &[f64]| peak(theta) - 0.5 * ((theta[1] - 1.7) / 0.1).powi(2);
    let beyond = with_status(&axes, |theta| (round(theta), Status::Unreachable));
    assert!(refusal(&beyond).ends_with("is beyond the reach of the target chi2"));
    let asked = paraboloid(&examples()[4].landscape(), Rule { nodes: Some(5), radius: None });
    assert_eq!(asked.unwrap_err(), Undefined::TooFew { found: 5, needed: 15 });
}

fn density(axes: &[Axis]) -> impl Fn(usize, f64) -> f64 {
    let flat: Vec<f64> = axes.iter().map(|axis| 1.0 / (axis.max - axis.min)).collect();
    move |i, _| flat[i]
}

#[test]
fn marginals_of_a_gaussian_are_gaussian() {
    for gaussian in examples() {
        let landscape = gaussian.landscape();
        for (i, axis) in gaussian.axes.iter().enumerate() {
            let marginal = Marginal::of(&landscape, i, &density(&gaussian.axes)).unwrap();
            let error = gaussian.covariance[(i, i)].sqrt();
            let mean = marginal.place(gaussian.mean[i]).unwrap();
            // nodes are an error bar apart; the normal distribution has 0.84134 below one of them
            for (p, sigmas) in [(0.5, 0.0), (0.158655, -1.0), (0.841345, 1.0), (0.977250, 2.0)] {
                let apart = (marginal.quantile(p) - mean) / error - sigmas;
                assert!(apart.abs() < 5e-3, "{} of {}: {p} {apart}", axis.name, gaussian.axes.len());
                assert!((marginal.cumulative(mean + sigmas * error) - p).abs() < 2e-3);
            }
            assert_eq!(marginal.nodes().len(), axis.nodes + usize::from(axis.is_circle()));
        }
    }
}

#[test]
fn the_prior_counts() {
    let axes = [axis("k_kms", 0.0, 0.2, 41), axis("vsys_kms", -1.0, 1.0, 21)];
    let flat = landscape(&axes, |_| -400.0);
    // cut off within a cell, and rising
    let prior = |i: usize, x: f64| match i {
        0 => f64::from(u8::from((0.033..=0.101).contains(&x))),
        _ => 1.0 + x,
    };
    let k = Marginal::of(&flat, 0, &prior).unwrap();
    let vsys = Marginal::of(&flat, 1, &prior).unwrap();
    // 64 steps to a cell
    for p in [0.16, 0.5, 0.84] {
        assert!((k.quantile(p) - (0.033 + p * 0.068)).abs() < 1e-4, "{}", k.quantile(p));
        assert!((vsys.quantile(p) - (2.0 * p.sqrt() - 1.0)).abs() < 1e-3, "{}", vsys.quantile(p));
    }
    // a Gaussian prior on one axis, through a correlated likelihood, moves the other
    let gaussian = Gaussian::new(&axes, &[0.1, 0.0], &[0.01, 0.2], &[0.9]);
    let narrow = |i: usize, x: f64| if i == 0 { 1.0 } else { (-0.5 * ((x - 0.2) / 0.2f64).powi(2)).exp() };
    let moved = Marginal::of(&gaussian.landscape(), 0, &narrow).unwrap();
    // vsys comes to 0.1 +- 0.2/sqrt(2), and K follows by 0.9 * 0.01/0.2 of it
    assert!((moved.quantile(0.5) - 0.1045).abs() < 2e-5, "{}", moved.quantile(0.5));
    let width = 0.01 * (1.0 - 0.81 + 0.81 / 2.0f64).sqrt();
    assert!(((moved.quantile(0.841345) - 0.1045) / width - 1.0).abs() < 5e-3);
    assert!(Marginal::of(&flat, 0, &|_, _| 0.0).is_none());
}

#[test]
fn places_on_an_axis() {
    let flat = |axis: Axis| {
        let axes = [axis];
        Marginal::of(&landscape(&axes, |x| -x[0]), 0, &density(&axes)).unwrap()
    };
    let across = flat(axis("phi", 0.8, 1.2, 9));
    for (x, place) in
        [(0.8, Some(0.8)), (0.9, Some(0.9)), (0.1, Some(1.1)), (1.2, Some(1.2)), (0.2, Some(1.2)), (0.5, None)]
    {
        assert_eq!(across.place(x).map(|x| (x * 1e9).round()), place.map(|x| x * 1e9), "{x}");
    }
    let circle = flat(axis("phi", 0.0, 1.0, 8));
    assert!((0..10).all(|k| circle.place(0.1 * f64::from(k)).is_some()));
    let k = flat(axis("k_kms", 0.0, 0.2, 5));
    assert_eq!((k.place(-0.01), k.place(0.0), k.place(0.2), k.place(0.21)), (None, Some(0.0), Some(0.2), None));
}
