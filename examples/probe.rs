#[path = "../tests/common/mod.rs"]
mod common;
use dimcmc::imaging::*;
use dimcmc::maxent::entropy::Entropy;
use dimcmc::maxent::*;
use dimcmc::star::*;
use std::time::Instant;
fn main() {
    let o = common::oracle();
    for n in [2000, 5000, 20000] {
        let grid = SurfaceGrid::equal_area(n, Quadrature::Gauss2x2);
        let th = &o.json["results"]["fixed_lambda"][0]["theta"];
        let st = common::values(th, 3.0).state();
        let t = Instant::now();
        let r = Response::new(&grid, &o.star, &st, &o.sampling);
        let tb = t.elapsed();
        let x = vec![1.0; grid.len()];
        let mut l = vec![0.0; r.data_len()];
        let mut c = vec![0.0; r.profiles()];
        let mut out = x.clone();
        let m = 200;
        let t = Instant::now();
        for _ in 0..m {
            r.apply(&x, &mut l, &mut c);
        }
        let tf = t.elapsed() / m;
        let t = Instant::now();
        for _ in 0..m {
            r.apply_transpose(&l, &c, &mut out);
        }
        let tt = t.elapsed() / m;
        println!(
            "n {} pairs {} build {:?} fwd {:?} {:.2} ns/pair  T {:?} {:.2}",
            grid.len(),
            r.pairs(),
            tb,
            tf,
            tf.as_nanos() as f64 / r.pairs() as f64,
            tt,
            tt.as_nanos() as f64 / r.pairs() as f64
        );
        let none = Preconditioner::identity();
        let mut p = ImagingProblem::new(&grid.area, &o.data, r, o.star.contrast);
        let solver = Solver { entropy: Entropy::new(1e-4), preconditioner: &none, settings: SolverSettings::exact() };
        let t = Instant::now();
        let sol = solver.solve(&mut p, Goal::Chi2 { target: 2764.5, largest_lambda: 1.0 }, &solver.blank(grid.len()));
        println!(
            "cold {:?} {:?} passes {} lam {} spot {} slopes {} {}",
            t.elapsed(),
            sol.termination,
            p.passes(),
            sol.image.lambda,
            sol.spottedness,
            sol.chi2_slope,
            sol.spottedness_slope
        );
        // preconditioner
        let mut s = vec![0.0; grid.len()];
        let mut sc = s.clone();
        solver.entropy.image(&sol.image.logit, &mut s);
        solver.entropy.metric(&s, &grid.area, &mut sc);
        p.linearise(&s);
        let lam = sol.image.lambda;
        for (rank, small) in [(60, 0.0), (120, 0.3), (250, 0.01)] {
            let t = Instant::now();
            let mut tmp = s.clone();
            let pre = Preconditioner::build(grid.len(), rank, small / lam, |v, o2| {
                for i in 0..v.len() {
                    tmp[i] = v[i] * sc[i];
                }
                p.curvature(&tmp, o2);
                for i in 0..v.len() {
                    o2[i] *= sc[i];
                }
            });
            let tp = t.elapsed();
            let t = Instant::now();
            let mut y = s.clone();
            for _ in 0..100 {
                pre.apply(lam, &s, &mut y);
            }
            let ta = t.elapsed() / 100;
            println!(
                "  rank {} active {} build {:?} apply {:?} lam e {:.3?} .. {:.3?}",
                pre.rank(),
                pre.active_pixels(),
                tp,
                ta,
                lam * pre.eigenvalues()[0],
                lam * pre.eigenvalues().last().unwrap()
            );
            for (k, per) in [(0.1, 1.7), (0.11, 1.7), (0.09, 1.8), (0.06, 1.6), (0.0, 1.7)] {
                let mut st2 = st;
                st2.orbit.k_kms = k;
                st2.orbit.porb_over_prot = per;
                let r2 = p.response().with_velocities(&o.star, &st2, &o.sampling);
                let mut p2 = ImagingProblem::new(&grid.area, &o.data, r2, o.star.contrast);
                let mut p3 = ImagingProblem::new(
                    &grid.area,
                    &o.data,
                    p.response().with_velocities(&o.star, &st2, &o.sampling),
                    o.star.contrast,
                );
                let mk = |set| Solver { entropy: Entropy::new(1e-4), preconditioner: &pre, settings: set };
                let start = Start { image: sol.image.clone(), path: sol.path.clone() };
                let t = Instant::now();
                let a = mk(SolverSettings::default()).solve(
                    &mut p2,
                    Goal::Chi2 { target: 2764.5, largest_lambda: 1.0 },
                    &start,
                );
                let ta = t.elapsed();
                let b = mk(SolverSettings::exact()).solve(
                    &mut p3,
                    Goal::Chi2 { target: 2764.5, largest_lambda: 1.0 },
                    &start,
                );
                let aa = a.spottedness + (2764.5 - a.chi2) * a.spottedness_slope / a.chi2_slope;
                println!(
                    "    K {} P {}: {:?} {} passes {} newton {:?}  A {} err lnL {:.2e}; exact {} passes; chi2 {}",
                    k,
                    per,
                    a.termination,
                    p2.passes(),
                    a.newton_steps,
                    ta,
                    a.spottedness,
                    (aa - b.spottedness) * b.chi2_slope / b.spottedness_slope / 2.0,
                    p3.passes(),
                    a.chi2
                );
            }
        }
    }
}
