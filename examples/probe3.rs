//! probe
#[path = "../tests/common/mod.rs"]
mod common;
use dimcmc::imaging::*;
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
    eprintln!("GO");
    let mut w = v;
    w[Parameter::Vsini] -= 2.0;
    let none = Preconditioner::identity();
    for w in [
        w,
        {
            let mut w = v;
            w[Parameter::Vsini] -= 0.5;
            w
        },
        {
            let mut w = v;
            w[Parameter::Vsini] += 4.0;
            w
        },
    ] {
        for (goal, blank) in
            [(Goal::Lambda(r.solution.image.lambda), false), (Goal::Lambda(r.solution.image.lambda), true)]
        {
            let mut p = imager.problem(imager.response(&w.state()));
            let solver = Solver {
                entropy: imager.entropy,
                preconditioner: if blank { &none } else { &r.preconditioner },
                settings: SolverSettings::default(),
            };
            let s = solver.solve(&mut p, goal, &if blank { solver.blank(imager.grid.len()) } else { r.start() });
            println!(
                "{goal:?} blank {blank} {:?} {} {} chi2 {} S {}",
                s.termination,
                s.newton_steps,
                p.passes(),
                s.chi2,
                s.entropy
            );
        }
    }
}
