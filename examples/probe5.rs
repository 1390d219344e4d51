//! probe
#[path = "../tests/common/mod.rs"]
mod common;
use dimcmc::imaging::*;
use dimcmc::maxent::entropy::Entropy;
use dimcmc::objective::*;
use dimcmc::search::*;
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
    let u = |parameter, min, max| FreeParameter { parameter, prior: Prior::Uniform { min, max } };
    let mut free = vec![
        u(Parameter::K, 0.0, 0.3),
        u(Parameter::PorbOverProt, 0.5, 4.0),
        FreeParameter { parameter: Parameter::Phi, prior: Prior::Periodic },
    ];
    for seven in [false, true] {
        if seven {
            free.extend([
                u(Parameter::OmegaEq, 2.05, 2.15),
                u(Parameter::DOmega, -0.05, 0.05),
                u(Parameter::Inclination, 30., 46.),
                u(Parameter::Vsini, 39., 41.),
            ]);
            v[Parameter::K] = 0.13;
            v[Parameter::PorbOverProt] = 1.9;
            v[Parameter::Phi] = 0.6;
            v[Parameter::OmegaEq] *= 1.00114;
            v[Parameter::DOmega] = 0.0058;
            v[Parameter::Inclination] = 39.4;
            v[Parameter::Vsini] = 40.066;
        }
        let space = ParameterSpace::new(free.clone(), v, imager.mid_cycle(), imager.time_base_cycles(), 3.0);
        for n in [0, 6] {
            let t = Instant::now();
            let f = find(
                &imager,
                &space,
                SearchSettings { chi2_target: 0.97, objective: ObjectiveKind::Spottedness, prior_starts: n, seed: 1 },
                |s| eprintln!("{s:?} {:?}", t.elapsed()),
            );
            match f {
                Ok(f) => {
                    println!(
                        "{:?} best {:?} lnL {} conv {} well {} evals {}",
                        t.elapsed(),
                        f.optimum.theta,
                        f.optimum.evaluation.log_prob,
                        f.optimum.converged,
                        f.optimum.well_defined,
                        f.optimum.evaluations
                    );
                    println!(
                        "  sd {:?}",
                        (0..space.dimension()).map(|i| f.optimum.written_covariance[(i, i)].sqrt()).collect::<Vec<_>>()
                    );
                    for a in &f.attempts {
                        match &a.end {
                            Ok(o) => println!(
                                "   {:.3?} -> {:.4?} {:.2} conv {} its {} ev {}",
                                a.start, o.theta, o.evaluation.log_prob, o.converged, o.iterations, o.evaluations
                            ),
                            Err(e) => println!("   {:?} {e}", a.start),
                        }
                    }
                }
                Err(e) => println!("{e}"),
            }
        }
    }
}
