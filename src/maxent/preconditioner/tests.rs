//! Tests of the preconditioner.

use super::*;

#[test]
fn inverts_a_low_rank_system() {
    let n = 60;
    // M = sum of two projectors on unit vectors e3 and (e10 + e20)/sqrt 2
    let apply = |v: &[f64], out: &mut [f64]| {
        out.fill(0.0);
        out[3] = 50.0 * v[3];
        let c = 0.5 * (v[10] + v[20]);
        out[10] = 8.0 * c;
        out[20] = 8.0 * c;
    };
    let preconditioner = Preconditioner::build(1, n, 10, 1e-6, apply);
    assert_eq!(preconditioner.maps[0].eigenvalues.len(), 2);
    assert_eq!(active_pixels(&preconditioner.maps[0]), 3);
    let x: Vec<f64> = (0..n).map(|i| (i as f64).sin()).collect();
    let (mut mx, mut back) = (vec![0.0; n], vec![0.0; n]);
    apply(&x, &mut mx);
    let b: Vec<f64> = x.iter().zip(&mx).map(|(x, m)| x + 0.7 * m).collect();
    preconditioner.apply(0.7, &b, &mut back);
    for (x, back) in x.iter().zip(&back) {
        assert!((x - back).abs() < 1e-5);
    }
}

#[test]
fn maps_that_are_not_mixed_are_inverted_each_by_itself() {
    let n = 60;
    // for the second map everything is three times as strong
    let of_map = |v: &[f64], out: &mut [f64], times: f64| {
        out.iter_mut().zip(v).enumerate().for_each(|(p, (out, v))| *out = times * (-0.1 * p as f64).exp() * v);
    };
    let both = |v: &[f64], out: &mut [f64]| {
        for (times, (v, out)) in [1.0, 3.0].into_iter().zip(v.chunks(n).zip(out.chunks_mut(n))) {
            of_map(v, out, times);
        }
    };
    let together = Preconditioner::build(2, n, 40, 1e-3, both);
    let r: Vec<f64> = (0..2 * n).map(|p| (0.4 * p as f64).cos()).collect();
    let (mut out, mut single) = (vec![0.0; 2 * n], vec![0.0; n]);
    together.apply(50.0, &r, &mut out);
    let mut norms = (0.0, 0.0);
    for (k, times) in [1.0, 3.0].into_iter().enumerate() {
        let alone = Preconditioner::build(1, n, 40, 1e-3, |v: &[f64], out: &mut [f64]| of_map(v, out, times));
        alone.apply(50.0, &r[k * n..(k + 1) * n], &mut single);
        assert!(out[k * n..(k + 1) * n].iter().zip(&single).all(|(a, b)| (a - b).abs() < 1e-3));
        let rounded: Vec<f32> = r[k * n..(k + 1) * n].iter().map(|x| *x as f32).collect();
        let (spanned, rest) = alone.norms(50.0, &rounded);
        norms = (norms.0 + spanned, norms.1 + rest);
    }
    let (spanned, rest) = together.norms(50.0, &r.iter().map(|x| *x as f32).collect::<Vec<_>>());
    assert!((spanned + rest - norms.0 - norms.1).abs() < 1e-2 * (norms.0 + norms.1));
}

#[test]
fn the_basis_is_orthonormal_whatever_the_operator() {
    // eigenvalues over many decades, down to the level of rounding errors
    for decades in [1.0, 5.0, 20.0, 60.0] {
        let apply = |v: &[f64], out: &mut [f64]| {
            for (i, (out, v)) in out.iter_mut().zip(v).enumerate() {
                *out = 1e3 * 10f64.powf(-decades * i as f64 / 150.0) * v;
            }
        };
        let Krylov { basis, image } = krylov(1, 150, 130, apply).remove(0);
        assert_eq!((basis.ncols(), image.ncols()), (140, 140));
        let error = (basis.transpose() * &basis - DMatrix::identity(140, 140)).amax();
        assert!(error < 1e-13, "{decades} decades: {error:e}");
    }
}

#[test]
fn it_stays_positive_however_strong_the_data() {
    let (n, rank) = (1000, 120);
    // spots: where vectors are large, and rounded coarsely, on few pixels
    let noise = DMatrix::from_fn(n, rank, |i, k| {
        let falls = 0.03 * ((i + 8 * k) % n) as f64;
        (-falls).exp() * (0.7 + 12.9898 * (i * i + 31 * k) as f64).sin()
    });
    let vectors = noise.qr().q();
    for strongest in [1e3, 1e5, 1e7, 1e12] {
        let eigenvalues: Vec<f64> = (0..rank).map(|k| strongest * 10f64.powf(-0.02 * k as f64)).collect();
        let basis = Basis::on_active_pixels(eigenvalues, &vectors);
        let preconditioner = Preconditioner { maps: vec![basis] };
        let mut applied = DMatrix::zeros(n, n);
        for k in 0..n {
            let unit: Vec<f32> = (0..n).map(|p| f32::from(p == k)).collect();
            let mut column = vec![0.0f32; n];
            preconditioner.apply(1.0, &unit, &mut column);
            applied.column_mut(k).iter_mut().zip(column).for_each(|(x, single)| *x = f64::from(single));
        }
        let smallest = (0.5 * (&applied + applied.transpose())).symmetric_eigenvalues().min();
        assert!(smallest > 0.0, "{strongest:e}: {smallest:e}");
    }
}

#[test]
fn any_rank_on_any_number_of_pixels() {
    for (n, rank) in [(1, 1), (16, 4), (40, 7), (83, 12)] {
        let vectors = orthonormal(n, rank);
        let r: Vec<f64> = (0..n).map(|i| (0.3 * i as f64).cos()).collect();
        let eigenvalues: Vec<f64> = (0..rank).map(|k| 100.0 / (1.0 + k as f64)).collect();
        let (basis, lambda) = (Basis::on_active_pixels(eigenvalues, &vectors), 0.4);
        assert!(active_pixels(&basis) == n && basis.eigenvalues.len() == rank);
        let (wanted, mut out) = (inverse_by_the_rounded(&basis, lambda, &r), vec![0.0; n]);
        Preconditioner { maps: vec![basis] }.apply(lambda, &r, &mut out);
        assert!(out.iter().zip(&wanted).all(|(a, b)| (a - b).abs() < 1e-6), "{n} {rank}: {out:?} {wanted:?}");
    }
}

/// Number of pixels with entries of the eigenvectors.
fn active_pixels(basis: &Basis) -> usize {
    basis.spotted.active + basis.faint.active
}

/// Orthonormal columns with entries on all pixels.
pub(super) fn orthonormal(n: usize, rank: usize) -> DMatrix<f64> {
    DMatrix::from_fn(n, rank, |i, k| (0.7 + 12.9898 * (i * i + 31 * k) as f64).sin()).qr().q()
}

fn inverse_by_the_rounded(basis: &Basis, lambda: f64, r: &[f64]) -> Vec<f64> {
    let Basis { eigenvalues, spotted, faint, .. } = basis;
    let vectors = spotted.on_all(r.len()) + faint.on_all(r.len());
    let mut kept = vectors.transpose() * nalgebra::DVector::from_column_slice(r);
    kept.iter_mut().zip(eigenvalues).for_each(|(c, e)| *c *= lambda * e / (1.0 + lambda * e));
    r.iter().zip(&(vectors * kept)).map(|(r, back)| r - back).collect()
}
