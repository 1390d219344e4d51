//! `dimcmc periodogram` for many stars: the same search and the same files, at half the time.
//!
//!     cargo run --release --example blind_search -- periodogram star/config.json --out star/found
//!
//! Nights are left out one by one only where a planet is found by the marginal likelihood, other targets are not tried,
//! and objectives for which stars do not change are not asked whether they do (verdicts are those of version 0.1.0).
//! No number of the search changes by that. `calibration_changing.py` runs it.

use dimcmc::internals::data::io::periodogram::PeriodogramResult;
use dimcmc::internals::data::scene::Scene;
use dimcmc::internals::inference::detection::{
    Detection, DetectionSettings, Evidence, Robustness, Spots, View, robustness,
};
use dimcmc::internals::planets::periodogram::{Frequencies, FrequencySettings, SearchSettings};
use dimcmc::internals::surface::fit::Explained;
use std::path::Path;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let [command, config, out, folder] = args.iter().map(String::as_str).collect::<Vec<_>>()[..] else {
        return Err("usage: blind_search periodogram CONFIG --out FOLDER".into());
    };
    if (command, out) != ("periodogram", "--out") {
        return Err("usage: blind_search periodogram CONFIG --out FOLDER".into());
    }
    let scene = Scene::load(config.as_ref())?;
    let imager = &scene.imager;
    let spots = match scene.spots() {
        Spots::OneMap(_) => Spots::OneMap(None),
        integrated @ Spots::Integrated(_) => integrated,
    };
    let settings = DetectionSettings {
        search: SearchSettings { draws: 10_000, seed: 1 },
        spots,
        ..DetectionSettings::of(scene.chi2_target, Vec::new())
    };
    let frequencies = Frequencies::new(&imager.cycles(), imager.star.rotation_period_d, FrequencySettings::default())?;
    let values = scene.settings.values;
    let detection = Detection::find(imager, values, frequencies, &settings, &|_| ())?;
    let choices = match spots {
        Spots::Integrated(_) if detection.is_candidate() => robustness(imager, values, &settings, &detection),
        _ => Robustness { all: None, targets: Vec::new(), nights: Vec::new() },
    };
    let explained = |view: &View| Explained::new(imager, &scene.observations, view);
    let at_best = explained(detection.last());
    let misfit = &at_best.misfit;
    let remarks = detection.remarks(&Evidence { imager, settings: &settings, robustness: Some(&choices), misfit });
    std::fs::create_dir_all(folder)?;
    PeriodogramResult {
        imager,
        detection: &detection,
        verdict: &detection.verdict(&remarks),
        remarks: &remarks,
        evidence: scene.evidence(&detection.planet_free.quadratic).as_ref(),
        robustness: &choices,
        settings: &settings,
        planet_free: &explained(&detection.planet_free),
        at_best: &at_best,
        truth: scene.truth,
        mass_msun: scene.settings.mass_msun,
        provenance: &scene.provenance(),
    }
    .write(Path::new(folder))?;
    Ok(())
}
