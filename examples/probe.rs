//! probe
#[path = "../tests/common/mod.rs"]
mod common;
use dimcmc::star::*;
use std::time::Instant;
fn main() {
    let o = common::oracle();
    for n in [2000, 5000, 20000] {
        let grid = SurfaceGrid::equal_area(n, Quadrature::Gauss2x2);
        let th = &o.json["results"]["fixed_lambda"][0]["theta"];
        let st = common::values(th, 3.0).state();
        let mut tb = 1e9f64;
        let mut tf = 1e9f64;
        let mut tt = 1e9f64;
        let r = Response::new(&grid, &o.star, &st, &o.sampling);
        let x = vec![1.0; grid.len()];
        let mut l = vec![0.0; r.data_len()];
        let mut c = vec![0.0; r.profiles()];
        let mut out = x.clone();
        for _ in 0..30 {
            let t = Instant::now();
            let _r = Response::new(&grid, &o.star, &st, &o.sampling);
            tb = tb.min(t.elapsed().as_secs_f64());
            let t = Instant::now();
            r.apply(&x, &mut l, &mut c);
            tf = tf.min(t.elapsed().as_secs_f64());
            let t = Instant::now();
            r.apply_transpose(&l, &c, &mut out);
            tt = tt.min(t.elapsed().as_secs_f64());
        }
        let p = r.pairs() as f64 / 1e9;
        println!(
            "n {} pairs {} build {:.2} ms {:.1} ns/pair fwd {:.3} ms {:.2} ns/pair  T {:.3} ms {:.2}",
            grid.len(),
            r.pairs(),
            tb * 1e3,
            tb / p,
            tf * 1e3,
            tf / p,
            tt * 1e3,
            tt / p
        );
    }
}
