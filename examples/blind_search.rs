//! `dimcmc periodogram` for many stars: the same search and the same files, at half the time.
//!
//!     cargo run --release --example blind_search -- periodogram star/config.json --out star/found
//!
//! Nights are left out one by one only where the marginal likelihood detects a planet, other targets are not tested,
//! and static objectives are not tested for spot evolution (verdicts are those of version 0.1.0). This changes no
//! number of the search. `calibration_changing.py` runs it.

use dimcmc::{BlindSearch, BlindSearchOptions, RobustnessOf, Scene};
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
    let changes = scene.surface().objective.properties().map_changes;
    let robustness = if changes { RobustnessOf::Candidates } else { RobustnessOf::None };
    let options = BlindSearchOptions { fixed: true, robustness, static_check: false, ..Default::default() };
    let found = BlindSearch::of(&scene, &options, &|_| ())?;
    std::fs::create_dir_all(folder)?;
    found.write(Path::new(folder))?;
    Ok(())
}
