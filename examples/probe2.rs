#[path = "../tests/common/mod.rs"]
mod common;
use dimcmc::imaging::*;
use dimcmc::log_density::*;
use dimcmc::maxent::entropy::Entropy;
use dimcmc::objective::*;
use dimcmc::star::*;
use std::time::Instant;
fn main() {
    let o = common::oracle();
    let grid = SurfaceGrid::equal_area(2000, Quadrature::Gauss2x2);
    let imager = Imager {
        grid,
        star: o.star.clone(),
        sampling: o.sampling.clone(),
        data: o.data.clone(),
        entropy: Entropy::new(1e-4),
    };
    let mut v = common::values(&o.json["results"]["fixed_lambda"][0]["theta"], 3.0);
    v[Parameter::K] = 0.09;
    v[Parameter::PorbOverProt] = 1.76;
    v[Parameter::Phi] = 0.486;
    let t = Instant::now();
    let r = Reference::build(&imager, v, 0.97).unwrap();
    println!(
        "reference {:?} lam {} A {} largest {} rank {} nodes {}",
        t.elapsed(),
        r.solution.image.lambda,
        r.solution.spottedness,
        r.largest_lambda,
        r.preconditioner.rank(),
        r.tradeoff.nodes().len()
    );
    for n in r.tradeoff.nodes() {
        println!(
            "   chi2 {:.2} A {:.6} S {:.5} lam {:.3e} slope {:.1}",
            n.chi2, n.spottedness, n.entropy, n.lambda, n.chi2_per_spottedness
        );
    }
    let u = |parameter, min, max| FreeParameter { parameter, prior: Prior::Uniform { min, max } };
    let free = vec![
        u(Parameter::K, 0.0, 0.3),
        u(Parameter::PorbOverProt, 0.5, 4.0),
        FreeParameter { parameter: Parameter::Phi, prior: Prior::Periodic },
        u(Parameter::OmegaEq, 1.5, 2.5),
        u(Parameter::DOmega, -0.5, 0.5),
        u(Parameter::Inclination, 10., 80.),
        u(Parameter::Vsini, 35., 45.),
        u(Parameter::Vsys, -1., 1.),
    ];
    let space = ParameterSpace::new(free, v, imager.mid_cycle(), imager.time_base_cycles(), 3.0);
    for kind in [ObjectiveKind::Spottedness, ObjectiveKind::Entropy, ObjectiveKind::RegularisedLikelihood] {
        let p = Posterior::new(imager.clone(), space.clone(), kind, r.clone());
        let base = space.start();
        let e0 = p.evaluate(&base).log_prob;
        println!("{kind:?} {e0}");
        for (i, ds) in [
            (0, vec![-0.09, -0.06, -0.03, 0.03, 0.06, 0.1, 0.2]),
            (1, vec![-1.0, -0.3, -0.1, 0.1, 0.3, 1.0]),
            (5, vec![-5., -1.0, 1.0, 5.]),
            (6, vec![-2.0, -0.5, -0.1, 0.02, 0.1, 0.5, 2.0, 4.0]),
            (7, vec![-0.5, -0.02, 0.02, 0.5]),
            (3, vec![-0.01, 0.002, 0.1]),
        ] {
            for d in ds {
                let mut th = base.clone();
                th[i] += d;
                let t = Instant::now();
                let e = p.evaluate(&th);
                println!(
                    "  {} {:+.3}: {:?} lnL {:.3} chi2 {:.2} A {:.5} passes {} {:?}",
                    space.names()[i],
                    d,
                    e.status,
                    e.log_prob - e0,
                    e.chi2,
                    e.spottedness,
                    e.passes,
                    t.elapsed()
                );
            }
        }
        let mut th = base.clone();
        th[0] += 0.008;
        th[1] -= 0.05;
        th[2] += 0.02;
        th[5] += 0.3;
        th[6] += 0.02;
        th[7] += 0.005;
        th[3] += 0.0005;
        th[4] += 0.002;
        let (e, g) = p.evaluate_with_gradient(&th);
        println!("  at {} g {:?}", e.log_prob - e0, g);
        let x = p.to_internal(&th);
        let sc = Gradient::scales(&p);
        let num: Vec<f64> = (0..8)
            .map(|i| {
                let f = |h: f64| {
                    let mut y = x.clone();
                    y[i] += h;
                    p.evaluate(&p.to_written(&y)).log_prob
                };
                let h = 0.1 * sc[i];
                (f(h) - f(-h)) / (2.0 * h)
            })
            .collect();
        println!("  numerical {:?}", num);
    }
}
