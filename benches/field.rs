//! Line profiles marginalised over the field: the cost of a new design, of a new orbit with the design unchanged, and
//! of less frequent operations.

mod common;

use common::stopwatch::{fastest, seconds};
use common::table::{Table, Target, thousands};
use dimcmc::internals::field::{Compression, Epoch, Evidence, Field, Harmonics, Kernel, Lifetime, Spectrum};
use nalgebra::{DMatrix, DVector};
use std::f64::consts::{FRAC_PI_2, PI, TAU};

/// Milliseconds of 40 profiles on one core.
const NEW_DESIGN: Target = Target::AtMost(200.0);
const NEW_ORBIT: Target = Target::AtMost(2.0);

/// Number of repetitions; the fastest counts.
const ROUNDS: usize = 5;

/// Data per profile, and their half range (km/s).
const NUMBERS: usize = 28;
const REACH_KMS: f64 = 50.0;

const VSINI_KMS: f64 = 40.0;
const SIGMA_KMS: f64 = 4.5;
const RINGS: usize = 60;

fn main() {
    if !common::wanted() {
        return;
    }
    let (design, orbit) = (format!("new design / ms ({NEW_DESIGN})"), format!("new orbit / ms ({NEW_ORBIT})"));
    let columns =
        ["profiles", "numbers", "compressed", "Gflop", &design, &orbit, "derivatives / ms", "errors of a map / ms"];
    let mut table = Table::new("Fields integrated out", &columns);
    for profiles in [40, 100, 200, 400] {
        measure(profiles, &mut table);
    }
    table.print(&format!(
        "Profiles of {NUMBERS} numbers, vsini {VSINI_KMS} km/s, lines of {SIGMA_KMS} km/s, S/N 1000, over as many \
        nights as there are profiles; harmonics up to degree 36; a field of 0.25 that lives 20 d; one thread. New \
        design: ln Z with gradient and information in the velocities; the targets are for 40 profiles. New orbit: the \
        same for other misfits and slopes. Derivatives: of ln Z, with respect to all hyperparameters. Errors of a map: \
        at 1,000 points and one time. Gflop: of products with the design and of the Cholesky factor. The fastest of \
        {ROUNDS}, 2 from 200 profiles on."
    ));
}

fn measure(profiles: usize, table: &mut Table) {
    let harmonics = Harmonics::new(36);
    let degrees = harmonics.degrees();
    let epochs = epochs(&harmonics, profiles);
    let spectrum = Spectrum { amplitude: 0.25, slope: 0.75, break_degree: 0.0 };
    let field = Field { spectrum, kernel: Kernel::of(Lifetime::Days(20.0)) };
    let around = DMatrix::zeros(degrees.len(), profiles);
    let new = || Evidence::new(field, &degrees, &epochs, &around, Compression::default()).unwrap();
    let evidence = new();
    let misfits: Vec<_> = epochs.iter().map(|epoch| epoch.misfit.map(|x| 1.1 * x)).collect();
    let slopes: Vec<_> = epochs.iter().map(|epoch| epoch.slopes.map(|x| 0.9 * x)).collect();
    let points = harmonics.at(&vec![1.0; 1000], &(0..1000).map(|p| 1.5 - 0.003 * p as f64).collect::<Vec<_>>());
    let rounds = if profiles < 200 { ROUNDS } else { 2 };
    let ms = |f: &dyn Fn()| 1e3 * fastest(&(0..rounds).map(|_| seconds(f)).collect::<Vec<_>>());
    let judged = |target: Target, ms: f64| if profiles == 40 { target.judge(ms, 1) } else { format!("{ms:.1}") };
    let n = evidence.compressed_len() as f64;
    table.row([
        profiles.to_string(),
        thousands(profiles * NUMBERS),
        thousands(evidence.compressed_len()),
        format!("{:.1}", (n * n * degrees.len() as f64 + n * n * n / 3.0) / 1e9),
        judged(NEW_DESIGN, ms(&|| drop(new()))),
        judged(NEW_ORBIT, ms(&|| drop(evidence.with(&misfits, &slopes)))),
        format!("{:.0}", ms(&|| drop(vec![evidence.derivatives()]))),
        format!("{:.0}", ms(&|| drop(evidence.standard_deviations(&points, &[3.3])))),
    ]);
}

/// Profiles of a star that rotates in 3.1 d, one per night.
fn epochs(harmonics: &Harmonics, profiles: usize) -> Vec<Epoch> {
    let (longitudes, latitudes): (Vec<f64>, Vec<f64>) = (0..RINGS)
        .flat_map(|ring| {
            let latitude = (ring as f64 + 0.5) * PI / RINGS as f64 - FRAC_PI_2;
            let count = (2.0 * RINGS as f64 * latitude.cos()).round().max(3.0);
            (0..count as usize).map(move |j| (j as f64 / count * TAU, latitude))
        })
        .unzip();
    let basis = harmonics.at(&longitudes, &latitudes);
    let area = 1.0 / longitudes.len() as f64;
    (0..profiles)
        .map(|k| {
            let time_d = k as f64 * 0.997;
            let (mut seen, mut lines) = (Vec::new(), Vec::new());
            for (p, (longitude, latitude)) in longitudes.iter().zip(&latitudes).enumerate() {
                let (sin, cos) = (longitude + TAU * time_d / 3.1).sin_cos();
                let mu = 0.5 * latitude.sin() + 0.75_f64.sqrt() * latitude.cos() * cos;
                if mu > 0.0 {
                    let velocity = VSINI_KMS * latitude.cos() * sin;
                    seen.push(p);
                    lines.extend((0..NUMBERS).map(|j| area * mu * (0.4 + 0.6 * mu) * line(j, velocity)));
                }
            }
            let lines = DMatrix::from_vec(NUMBERS, seen.len(), lines);
            let rows = DMatrix::from_fn(seen.len(), harmonics.len(), |i, h| basis[(h, seen[i])]);
            Epoch {
                time_d,
                jacobian: (lines * rows).into(),
                misfit: DVector::from_fn(NUMBERS, |j, _| 1e-3 * ((j * j + 7 * k) as f64).sin()),
                variance: DVector::from_element(NUMBERS, 1e-6),
                beside: 0.0,
                nuisances: DMatrix::zeros(NUMBERS, 0),
                common: DMatrix::zeros(NUMBERS, 0),
                divisor: DVector::zeros(0),
                slopes: DMatrix::from_fn(NUMBERS, 1, |j, _| 1e-2 * (TAU * j as f64 / NUMBERS as f64).sin()),
            }
        })
        .collect()
}

/// Change of number j of the profile by a spot at this velocity (km/s), in a continuum of 0.2.
fn line(j: usize, velocity_kms: f64) -> f64 {
    let at = 2.0 * REACH_KMS * (j as f64 / (NUMBERS - 1) as f64 - 0.5);
    -0.8 * 0.4 / 0.2 * (-0.5 * ((at - velocity_kms) / SIGMA_KMS).powi(2)).exp()
}
