//! The fit of star, events and rotation period to the profiles ([`Scene::fitted`]), cached between commands: `map`,
//! `periodogram`, `limits` and `sample` of one config begin with the same fit, which takes longer than a map.
//!
//! It is a file in the user's cache, whose name is a fingerprint of config (but for sampler and first planet),
//! observations, program and kind of processor: results of another program or of other data are never used. Only
//! computing time depends on it: a cache that cannot be read or written is no error.

use crate::data::config::fit_fingerprint;
use crate::data::io::atomic::write_json;
use crate::data::io::provenance::Measured;
use crate::data::scene::Scene;
use crate::numerics::vector;
use sha2::{Digest, Sha256};
use std::path::{Path, PathBuf};
use std::time::{Duration, SystemTime};

/// Environment variable with another folder for it, or [`OFF`].
pub const VARIABLE: &str = "DIMCMC_CACHE";

/// Its value that disables the cache.
pub const OFF: &str = "off";

/// Older files are removed.
const LONGEST: Duration = Duration::from_secs(30 * 24 * 3600);

/// The same scene with stellar parameters that the config leaves to the profiles, fitted or from the cache; `report` is
/// called with the current stage.
#[must_use]
pub fn fitted(scene: Scene, report: &dyn Fn(&str)) -> Scene {
    let Some(path) = folder().and_then(|folder| Some(folder.join(name(&scene)?))) else {
        return scene.fitted(report);
    };
    if let Some(found) = read(&path) {
        return scene.with_found(&found);
    }
    let scene = scene.fitted(report);
    if scene.measured.field_start.is_some() {
        keep(&path, &scene.measured);
    }
    scene
}

/// The folder of the cache.
fn folder() -> Option<PathBuf> {
    let of = |name: &str| std::env::var_os(name).filter(|value| !value.is_empty()).map(PathBuf::from);
    match of(VARIABLE) {
        Some(value) => (value != Path::new(OFF)).then_some(value),
        None => {
            let home = || of("HOME").map(|home| home.join(".cache"));
            let user = of("XDG_CACHE_HOME").or_else(|| of("LOCALAPPDATA")).or_else(home)?;
            Some(user.join("dimcmc"))
        }
    }
}

/// The file of `scene`; `None` where the program cannot be fingerprinted.
fn name(scene: &Scene) -> Option<String> {
    let program = std::fs::metadata(std::env::current_exe().ok()?).ok()?;
    let built = program.modified().ok()?.duration_since(SystemTime::UNIX_EPOCH).ok()?;
    let mut hash = Sha256::new();
    hash.update(concat!(env!("CARGO_PKG_VERSION"), env!("DIMCMC_COMMIT")));
    hash.update(program.len().to_le_bytes());
    hash.update(built.as_nanos().to_le_bytes());
    hash.update([u8::from(vector::is_fused())]);
    hash.update(fit_fingerprint(&scene.settings.resolved));
    hash.update(format!("{:?}", scene.settings.values.without_planet()));
    hash.update(&scene.data_sha256);
    Some(format!("{:x}.json", hash.finalize()))
}

fn read(path: &Path) -> Option<Measured> {
    let found: Measured = serde_json::from_slice(&std::fs::read(path).ok()?).ok()?;
    found.field_start.is_some().then_some(found)
}

fn keep(path: &Path, measured: &Measured) {
    let folder = path.parent().expect("it has a folder");
    if std::fs::create_dir_all(folder).is_ok() && write_json(path, measured).is_ok() {
        remove_old(folder);
    }
}

fn remove_old(folder: &Path) {
    let is_old = |path: &Path| {
        let age = path.metadata().and_then(|of| of.modified()).ok().and_then(|of| of.elapsed().ok());
        path.extension().is_some_and(|of| of == "json") && age.is_some_and(|age| age > LONGEST)
    };
    for entry in std::fs::read_dir(folder).into_iter().flatten().flatten() {
        if is_old(&entry.path()) {
            // another process may have been faster
            let _ = std::fs::remove_file(entry.path());
        }
    }
}
