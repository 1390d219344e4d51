//! A star with evolving spots, and the output of all commands for it: made once per build of the program, stored on
//! disk, and copied for each test that reads results.

use crate::desk::{Desk, PROGRAM, copy, two_spots};
use serde_json::{Value, json};
use std::hash::{DefaultHasher, Hash as _, Hasher as _};
use std::path::{Path, PathBuf};
use std::sync::OnceLock;
use std::time::Duration;

const CONFIG: &str = "config.json";

/// Ensembles of its chains, and walkers of each.
pub const ENSEMBLES: usize = 2;
pub const WALKERS: usize = 8;

/// K, phase and the lifetime of the spots are free; error bars are 0.035 km/s, 0.024 and 0.9 d.
pub fn config() -> Value {
    let sampler = json!({ "ensembles": ENSEMBLES, "walkers": WALKERS, "steps": 60, "ess": 80, "rhat": 1.1, "seed": 3 });
    let mut config = two_spots(sampler);
    config["star"]["name"] = json!("Beta & Co");
    let simulate = config["observations"]["simulate"].as_object_mut().unwrap();
    simulate.remove("spots");
    simulate.insert("random_spots".into(), json!({ "number": 6, "lifetime_d": 8, "seed": 2 }));
    config["observations"]["velocity_jitter_kms"] = json!(0);
    config["imaging"] = json!({
        "objective": "marginal-likelihood", "pixels": 200, "spot_amplitude": 0.2, "spot_slope": 0.5
    });
    config["grid"] = json!({ "axes": { "k_kms": [0.08, 0.34, 7], "phi": [-0.09, 0.08, 7] } });
    config
}

/// A desk with the config and the output of each command in a folder of its name: `simulate`, `map`, `optimise`,
/// `grid`, `sample`, `periodogram` and `compare`; and a chain by another seed in `seed_4`.
pub fn desk() -> Desk {
    static MADE: OnceLock<PathBuf> = OnceLock::new();
    let desk = Desk::new(config());
    copy(MADE.get_or_init(kept), &desk.path(""));
    desk
}

/// The folder that has it all, made if this program has not made it yet.
fn kept() -> PathBuf {
    let program = std::fs::metadata(PROGRAM).unwrap();
    let mut key = DefaultHasher::new();
    (program.len(), program.modified().unwrap(), config().to_string()).hash(&mut key);
    let all = Path::new(env!("CARGO_TARGET_TMPDIR")).join("stars");
    let folder = all.join(format!("{:016x}", key.finish()));
    if folder.exists() {
        return folder;
    }
    std::fs::create_dir_all(&all).unwrap();
    // those of earlier builds; another test program may have begun its own just now
    for old in std::fs::read_dir(&all).unwrap().flatten() {
        let age = old.metadata().and_then(|data| data.modified()).ok().and_then(|then| then.elapsed().ok());
        if age.is_some_and(|age| age > Duration::from_secs(3600)) {
            let _ = std::fs::remove_dir_all(old.path());
        }
    }
    let desk = Desk::new(config());
    for command in ["simulate", "map", "optimise", "grid", "sample"] {
        desk.succeed(&[command, CONFIG, "--out", command]);
    }
    desk.succeed(&["sample", CONFIG, "--out", "seed_4", "--seed", "4"]);
    desk.succeed(&["periodogram", CONFIG, "--out", "periodogram"]);
    desk.succeed(&["compare", "sample", "grid", "--out", "compare"]);
    // complete or not at all; if another process was faster, its result is the same
    let part = tempfile::tempdir_in(&all).unwrap().keep();
    copy(&desk.path(""), &part);
    if std::fs::rename(&part, &folder).is_err() {
        std::fs::remove_dir_all(&part).unwrap();
    }
    folder
}
