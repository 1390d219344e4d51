use dimcmc::Config;
use dimcmc::Scene;
use dimcmc::internals::model::Parameter;
use dimcmc::internals::surface::evolving_map::star::coarsely;
use std::time::Instant;
fn main() {
    let args: Vec<String> = std::env::args().collect();
    let config = Config::load(std::path::Path::new(&args[1])).unwrap();
    let scene = Scene::new(&config).unwrap();
    let imager = &scene.imager;
    let mut values = scene.settings.values;
    values.set(Parameter::K, 0.0);
    let known = scene.settings.known_field();
    let t = Instant::now();
    let plain = coarsely(imager, values, known).unwrap();
    println!("coarse plain {:.1} {:?} {:.1?}", plain.ln_evidence, plain.marginal.assumed, t.elapsed());
    let mut names: Vec<Parameter> = Parameter::REGIONS.to_vec();
    if args.len() > 2 && args[2] == "line" { names.extend([Parameter::LineSigma, Parameter::EquivalentWidth, Parameter::Vsini, Parameter::LimbDarkening]); }
    let t = Instant::now();
    match dimcmc::internals::surface::calibration::star::MeasuredStar::of(imager, values, known, &names) {
        Ok(found) => println!("{} {:.1?}", found.line(), t.elapsed()),
        Err(e) => println!("{e}"),
    }
}
