use dimcmc::Config;
use dimcmc::Scene;
use dimcmc::internals::model::Parameter;
use dimcmc::internals::surface::evolving_map::{Basis, fit, star::*};
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
    let prior = |parameter, mean, sd, start, bounds| StarPrior { parameter, mean, sd, start, bounds };
    let priors = [
        prior(Parameter::RegionLineWidth, 1.2, 0.2, 1.24, (0.5, 2.0)),
        prior(Parameter::RegionEquivalentWidth, 1.05, 0.2, 1.07, (0.3, 3.0)),
        prior(Parameter::RegionShift, 0.2, 0.3, 0.2, (-3.0, 3.0)),
        prior(Parameter::RegionArea, 0.0, 3.0, 1.0, (0.0, 20.0)),
        prior(Parameter::RegionAreaLimb, 0.0, 2.0, 0.0, (-20.0, 20.0)),
        prior(Parameter::RegionDimmingLimb, 0.0, 1.0, 0.0, (-3.0, 3.0)),
    ];
    let t = Instant::now();
    let found = fit_star(imager, &plain, &known, &priors).unwrap();
    println!("coarse fitted {:.1} prior {:.1} {:.1?}", found.ln_evidence, found.ln_prior, t.elapsed());
    for (p, sd) in priors.iter().zip(&found.sd) {
        println!("  {} {:.3} +- {:.3}", p.parameter.name(), found.values.get(p.parameter).unwrap(), sd);
    }
    if args.len() > 2 {
        let basis = Basis::new(&imager.grid);
        for v in [values, found.values] {
            let t = Instant::now();
            let f = fit(imager, &basis, v, known, None).unwrap();
            println!("full {:.1} {:?} {:.1?}", f.ln_evidence, f.marginal.assumed, t.elapsed());
        }
    }
}
