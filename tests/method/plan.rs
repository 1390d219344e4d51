//! The information of planned profiles against dense algebra with numerical derivatives.

use dimcmc::internals::field::{Field, Kernel, Lifetime, Spectrum};
use dimcmc::internals::model::Parameter;
use dimcmc::internals::surface::MEAN_FILLING;
use dimcmc::internals::surface::evolving_map::{Assumed, Basis, Planned};
use dimcmc::{Config, Scene};
use nalgebra::{DMatrix, DVector};
use serde_json::json;

const SIGMA: f64 = 1.0 / 300.0;

fn scene() -> Scene {
    let config = Config::default()
        .with("star.rotation_period_d", 3.0)
        .with("star.inclination_deg", 50.0)
        .with("star.vsini_kms", 20.0)
        .with("star.line", json!({ "sigma_kms": 4.0, "equivalent_width_kms": 6.0 }))
        .with("star.contrast", 0.2)
        .with("observations.simulate.cycles", json!([0.0, 0.31, 0.9, 1.4]))
        .with("observations.simulate.velocity_kms", json!({ "min": -30.0, "max": 30.0, "step": 4.0 }))
        .with("observations.simulate.snr", 1.0 / SIGMA)
        .with("observations.simulate.pixels", 500)
        .with("imaging", json!({ "objective": "spottedness", "pixels": 150 }));
    Scene::new(&config).unwrap()
}

#[test]
fn planned_information_is_that_of_dense_algebra() {
    let scene = scene();
    let (imager, mut values) = (&scene.imager, scene.settings.values);
    values.set(Parameter::K, 0.0);
    let field = Field {
        spectrum: Spectrum { amplitude: 0.15, slope: 0.9, break_degree: 0.0 },
        kernel: Kernel::of(Lifetime::Days(5.0)),
    };
    for jitter_kms in [0.0, 0.05] {
        let planned = Planned::new(imager, values, Assumed { field, jitter_kms }, &[], None);
        for maps in [planned.mean_maps(), planned.drawn_maps(4).unwrap()] {
            let part = vec![0, 1, 3];
            let found = planned.velocities(&maps, std::slice::from_ref(&part)).unwrap().remove(0);
            let expected = dense(&scene, &field, jitter_kms, &maps, &part);
            assert_eq!(found.cycles, part.iter().map(|k| imager.cycles()[*k]).collect::<Vec<_>>());
            let off = (&found.information - &expected).amax() / expected.amax();
            // what is left out of few numbers, and rounding of differences
            assert!(off < 5e-3, "{off}: {} {expected}", found.information);
            assert_eq!(found.gradient.amax(), 0.0);
        }
    }
}

/// `D'^T C^-1 D'` with all derivatives by differences of the model's depths.
fn dense(scene: &Scene, field: &Field, jitter_kms: f64, maps: &DMatrix<f64>, part: &[usize]) -> DMatrix<f64> {
    let imager = &scene.imager;
    let basis = Basis::new(&imager.grid);
    let mut values = scene.settings.values;
    values.set(Parameter::K, 0.0);
    let contrast = imager.star.contrast;
    let depths = |vsys: f64, maps: &DMatrix<f64>| {
        let mut values = values;
        values.set(Parameter::Vsys, values[Parameter::Vsys] + vsys);
        let filling = (&basis.on_pixels * maps).add_scalar(MEAN_FILLING);
        let brightness = filling.map(|filling| 1.0 - (1.0 - contrast) * filling);
        DVector::from_vec(imager.response(&values.state()).depths_of_each(&brightness))
    };
    let h = 1e-3;
    let slopes = (depths(h, maps) - depths(-h, maps)) / (2.0 * h);
    let bins = slopes.len() / imager.profiles().count();
    let mut jacobian = DMatrix::zeros(slopes.len(), basis.len());
    for harmonic in 0..basis.len() {
        let moved = |h: f64| {
            let mut maps = maps.clone();
            maps.row_mut(harmonic).add_scalar_mut(h);
            depths(0.0, &maps)
        };
        jacobian.set_column(harmonic, &((moved(h) - moved(-h)) / (2.0 * h)));
    }
    let variances = field.spectrum.variances(&basis.degrees);
    let scaled = DMatrix::from_fn(jacobian.nrows(), jacobian.ncols(), |j, c| jacobian[(j, c)] * variances[c].sqrt());
    let spatial = &scaled * scaled.transpose();
    let rows: Vec<usize> = part.iter().flat_map(|k| k * bins..(k + 1) * bins).collect();
    let times_d = imager.times_d();
    let time_d = |row: usize| times_d[row / bins];
    let covariance = DMatrix::from_fn(rows.len(), rows.len(), |a, b| {
        let (j, k) = (rows[a], rows[b]);
        let noise = if j == k { SIGMA * SIGMA } else { 0.0 };
        let jitter = if j / bins == k / bins { jitter_kms * jitter_kms * slopes[j] * slopes[k] } else { 0.0 };
        spatial[(j, k)] * field.kernel.at(time_d(j) - time_d(k)) + noise + jitter
    });
    let columns =
        DMatrix::from_fn(
            rows.len(),
            part.len(),
            |a, epoch| {
                if rows[a] / bins == part[epoch] { slopes[rows[a]] } else { 0.0 }
            },
        );
    columns.tr_mul(&covariance.cholesky().unwrap().solve(&columns))
}
