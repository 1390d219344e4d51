//! Moment-matched pixels: the star's parameters do not depend on how many there are.

use crate::common::{imager, oracle, values};
use dimcmc::internals::model::{FreeParameter, Parameter, ParameterSpace, Prior};
use dimcmc::internals::sampling::optimise::climb;
use dimcmc::internals::star::{Quadrature, SurfaceGrid};
use dimcmc::internals::surface::ObjectiveKind;
use dimcmc::internals::surface::static_map::{Posterior, Reference};

/// Best vsini and its standard deviation, the rest fixed at the injected values.
fn vsini(pixels: usize) -> (f64, f64) {
    let oracle = oracle();
    let imager = imager(&oracle, SurfaceGrid::equal_area(pixels, Quadrature::Gauss2x2));
    let truth = values(&oracle.json["results"]["fixed_lambda"][0]["theta"], 3.0);
    let prior = Prior::Uniform { min: 35.0, max: 45.0 };
    let free = vec![FreeParameter { parameter: Parameter::Vsini, prior }];
    let space = ParameterSpace::new(free, truth, imager.mid_cycle(), imager.time_base_cycles(), 3.0);
    let reference = Reference::build(&imager, truth, 0.97).unwrap();
    let posterior = Posterior::new(imager, space, ObjectiveKind::Spottedness, reference);
    let optimum = climb(&posterior, &posterior.space().start(), &|| ()).unwrap();
    assert!(optimum.converged && optimum.well_defined);
    (optimum.theta[0], optimum.covariance[(0, 0)].sqrt())
}

#[test]
#[ignore = "long: .ci/run has it run"]
fn vsini_on_2000_pixels_is_that_of_20000() {
    let ((coarse, _), (fine, sigma)) = (vsini(2000), vsini(20_000));
    println!("vsini {coarse:.4} on 2,000 pixels, {fine:.4} +- {sigma:.4} on 20,000");
    assert!((coarse - fine).abs() < 0.2 * sigma);
    peak_memory_is_below_one_gibibyte();
}

/// Of this process, which has just worked on 20,000 pixels; where the system says (Linux).
fn peak_memory_is_below_one_gibibyte() {
    let Ok(status) = std::fs::read_to_string("/proc/self/status") else { return };
    let peak =
        status.lines().find_map(|line| line.strip_prefix("VmHWM:")?.trim().strip_suffix("kB")?.trim().parse().ok());
    let peak: f64 = peak.expect("a number of kB");
    println!("peak memory {:.0} MiB", peak / 1024.0);
    assert!(peak < 1024.0 * 1024.0, "{peak} kB");
}
