//! The marginal likelihood of stars that change, against the independent reference (`tests/data/evolving`).

use dimcmc::internals::planets::periodogram::{FrequencySettings, Frequencies, Search, SearchSettings};
use dimcmc::internals::posterior::marginal::{Basis, Change, Known, fit};
use dimcmc::internals::posterior::objective::Parameter;
use dimcmc::Scene;
use std::path::Path;
use std::time::Instant;

#[test]
#[ignore]
fn trial() {
    for name in ["static-planet", "slow-null", "slow-planet", "fast-null", "fast-planet", "seasons-planet", "polar-null"] {
        let folder = Path::new("/work/shared/oracle/evolving").join(name);
        let oracle: serde_json::Value =
            serde_json::from_slice(&std::fs::read(folder.join("oracle.json")).unwrap()).unwrap();
        let scene = Scene::load(&folder.join("config.json")).unwrap();
        let begun = Instant::now();
        let basis = Basis::new(&scene.imager.grid);
        println!("{name}: basis {:?}", begun.elapsed());
        let mut values = scene.settings.values;
        values[Parameter::K] = 0.0;
        let begun = Instant::now();
        let fitted = fit(&scene.imager, &basis, values, Known { jitter_kms: Some(0.0), ..Known::default() }, None).unwrap();
        let m = &fitted.marginal;
        println!("  fit {:?} {:?} ln Z {} steps {:?} bounds {:?}", begun.elapsed(), m.assumed.field, fitted.ln_evidence, m.settled.steps, fitted.at_bounds);
        println!("  oracle {} lnZ {}", oracle["hyper"], oracle["ln_evidence"]);
        let begun = Instant::now();
        let quadratic = m.expansion(&scene.imager, &basis, &[]).unwrap().velocities(&[]);
        let frequencies = Frequencies::new(&scene.imager.cycles(), scene.imager.star.rotation_period_d, FrequencySettings::default()).unwrap();
        let search = Search::new(&quadratic, &frequencies, SearchSettings::default()).unwrap();
        let best = search.best();
        println!("  search {:?} P {} K {} +- {} dlnL {} FAP {}", begun.elapsed(), best.porb_over_prot, best.orbit.k_kms, best.orbit.sigma_k_kms, best.orbit.delta_ln_l, search.false_alarm.probability(best.orbit.delta_ln_l).value());
        println!("  oracle {}", oracle["peak"]);
        let begun = Instant::now();
        let change = Change::of(&scene.imager, values, &frequencies, &[], Known { jitter_kms: Some(0.0), ..Known::default() }).unwrap();
        println!("  change {:?} {:?} oracle {}", begun.elapsed(), change, oracle["ln_evidence_over_static"]);
    }
}
