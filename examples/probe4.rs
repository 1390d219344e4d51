//! probe
#[path = "../tests/common/mod.rs"]
mod common;
use dimcmc::imaging::*;
use dimcmc::log_density::*;
use dimcmc::maxent::entropy::Entropy;
use dimcmc::maxent::*;
use dimcmc::objective::*;
use dimcmc::star::*;
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
    let r = Reference::build(&imager, v, 0.97).unwrap();
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
        let q = p.clone().with_settings(SolverSettings::exact());
        let base = space.start();
        let e0 = p.evaluate(&base).log_prob;
        for f in [1.0, 2.0, 3.0] {
            for s in 0..6 {
                let mut th = base.clone();
                let g = |i: usize| f * ((i * 7 + s * 13) as f64).sin();
                th[0] += 0.008 * g(0);
                th[1] -= 0.05 * g(1);
                th[2] += 0.02 * g(2);
                th[5] += 0.3 * g(3);
                th[6] += 0.02 * g(4);
                th[7] += 0.005 * g(5);
                th[3] += 0.0005 * g(6);
                th[4] += 0.002 * g(7);
                let (a, b) = (p.evaluate(&th), q.evaluate(&th));
                println!(
                    "{kind:?} {:.3}  diff {:+.2e} passes {} exact {} dchi2 {:.2e}",
                    b.log_prob - e0,
                    a.log_prob - b.log_prob,
                    a.passes,
                    b.passes,
                    a.chi2 - b.chi2
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
        let (e, g) = q.evaluate_with_gradient(&th);
        println!("  at {} g {:?}", e.log_prob - e0, g);
        let x = p.to_internal(&th);
        let sc = Gradient::scales(&p);
        let num: Vec<f64> = (0..8)
            .map(|i| {
                let f = |h: f64| {
                    let mut y = x.clone();
                    y[i] += h;
                    q.evaluate(&p.to_written(&y)).log_prob
                };
                let h = 0.05 * sc[i];
                (f(h) - f(-h)) / (2.0 * h)
            })
            .collect();
        println!("  numerical {:?}", num);
    }
}
