//! Every reader of the program, by name: hands it a file, and takes whatever it says but a panic.
//!
//! Those of [`INPUTS`] read what a user brings: the bytes are the file. All other names are those of a file of results,
//! such as `map/map.json`: the bytes are edits of it ([`edited`]), and its folder is read as `report`, `export`,
//! `survey` and others do.

use dimcmc::internals::data::config::Config;
use dimcmc::internals::data::import::Import;
use dimcmc::internals::data::io::csv::{Columns, Words};
use dimcmc::internals::data::io::zdipy::{Input, LocalLineFile};
use dimcmc::internals::data::io::{journal, landscape, light_curve, lsd};
use dimcmc::internals::data::scene::Scene;
use dimcmc::internals::runs::comparison::Pair;
use dimcmc::internals::runs::export::{Contents, velocities};
use dimcmc::internals::runs::run::Conclusion;
use dimcmc::internals::runs::survey::{PlanetBox, Size, StarTable, Survey, SurveySettings};
use dimcmc::internals::runs::{batch, merge};
use dimcmc::internals::sampling::chain::Shape;
use dimcmc::internals::sampling::landscape::{Axis, Grid};
use dimcmc::{printed, report};
use serde_json::Value;
use std::path::Path;

/// Readers of what a user brings.
pub const INPUTS: [&str; 14] = [
    "profile",
    "list",
    "light-curve",
    "indicator",
    "config",
    "zdipy",
    "zdipy-line",
    "batch",
    "stars",
    "box",
    "journal",
    "landscape",
    "table",
    "words",
];

/// Reads `bytes` by `reader`; everything is written into `folder`, which holds the results of the program. Edits of one
/// that is not there are passed over.
pub fn read(reader: &str, folder: &Path, bytes: &[u8]) {
    let file = folder.join("input.txt");
    if INPUTS.contains(&reader) {
        std::fs::write(&file, bytes).expect("the folder can be written");
    }
    match reader {
        "profile" => {
            let list = folder.join("list.txt");
            std::fs::write(&list, "input.txt 0.5\nb.prof 0.7 300\nc.prof 1.1\n").expect("the folder can be written");
            ["b.prof", "c.prof"].iter().for_each(|name| drop(std::fs::write(folder.join(name), bytes)));
            for range in [None, Some((-20.0, 20.0))] {
                if let Ok(set) = lsd::read_around(&list, range) {
                    let _ = set.within(Some((-10.0, 10.0)), 2.0);
                }
            }
        }
        "list" => drop(lsd::read_listed(&folder.join("simulate/list.txt"), bytes, Some((-20.0, 20.0)), 2)),
        "light-curve" => drop(light_curve::read(&file).map(|mut read| {
            read.count_as(&[0.5, 1.5]);
            read
        })),
        "indicator" => drop(light_curve::read_indicator(&file)),
        "config" => {
            if let Ok(config) = Config::load(&file) {
                let _ = (config.assumed_objective(), config.settings());
            }
        }
        "zdipy" => {
            for name in ["a.prof", "b.prof"] {
                std::fs::write(folder.join(name), "").expect("the folder can be written");
            }
            let _ = Input::read(&file).map(|input| Import::zdipy(&input, None, Path::new(".")).map(|all| all.table()));
        }
        "zdipy-line" => {
            let _ = LocalLineFile::read(&file)
                .map(|line| (line.sigma_kms(), line.gamma_kms(), line.equivalent_width_kms()));
        }
        "batch" => drop(batch::read_list(&file, folder)),
        "stars" => {
            let [group, reliability] = ["group", "reliability"].map(|name| Some(name.to_owned()));
            let table = Some(StarTable { path: file, group, reliability });
            drop(survey(folder, SurveySettings { table, ..SurveySettings::default() }));
        }
        "box" => {
            let text = String::from_utf8_lossy(bytes);
            for size in [Size::Amplitude, Size::Mass] {
                let _ = PlanetBox::from_text(&text, size).map(|planets| planets.words());
            }
        }
        "journal" => {
            let names = ["k_kms", "phi"].map(str::to_owned).to_vec();
            let shape = Shape { names, numbers: vec!["chi2".into()], ensembles: 1, walkers: 2 };
            let _ = journal::read_to_end(&file, &shape);
            let _ = journal::Journal::recover(&file, shape);
        }
        "landscape" => {
            let axis = |name: &str, periodic, nodes| Axis { name: name.into(), min: 0.0, max: 1.0, nodes, periodic };
            let grid = Grid { axes: vec![axis("k_kms", false, 3), axis("phi", true, 4)] };
            let numbers = ["chi2".to_owned()];
            let _ = landscape::read(&file, grid.clone(), &numbers);
            let _ = landscape::recover(&file, grid, &numbers);
        }
        "table" => {
            if let Ok(table) = Columns::read(&file) {
                let _ = (table.column("a"), table.column_within("b", [0.0, 1.0]), table.check_rows(3, "it says so"));
            }
        }
        "words" => drop(Words::read(&file).map(|table| table.column("name").map(|cells| cells.len()))),
        result => {
            let path = folder.join(result);
            let Ok(before) = std::fs::read(&path) else { return };
            if let Some(after) = edited(result, &before, bytes) {
                std::fs::write(&path, after).expect("the folder can be written");
                read_folder(result, folder);
                std::fs::write(&path, before).expect("the folder can be written");
            }
        }
    }
}

/// Reads the folder that `result` is in as the commands do.
fn read_folder(result: &str, all: &Path) {
    let (name, file) = result.split_once('/').unwrap_or(("", result));
    let folder = all.join(name);
    if name.is_empty() {
        let _ = Scene::load(&all.join(file));
        return;
    }
    let _ = report(std::slice::from_ref(&folder));
    let _ = printed(&folder, file);
    match name {
        "sample" => {
            let _ = (Conclusion::read(&folder).is_ok(), Contents::read(&folder).is_ok());
            let _ = merge::merge(&[folder.clone(), all.join("seed_4")]);
            let _ = Pair::read(&folder, &all.join("grid"));
        }
        "grid" => drop(Pair::read(&all.join("sample"), &folder)),
        "periodogram" | "limits" => {
            let _ = velocities::write(&folder, &all.join("velocities"), true);
            drop(survey(all, SurveySettings::default()));
        }
        _ => {}
    }
}

/// The sample of the search and the limits in the results.
fn survey(all: &Path, settings: SurveySettings) -> Option<String> {
    Some(Survey::of(&["periodogram", "limits"].map(|name| all.join(name)), &settings).ok()?.table())
}

/// A file of results with edits: `text` is a JSON array of `["/pointer", value]`, which sets or appends (`/-`), and
/// `["/pointer"]`, which removes. Lines of a `.jsonl` and cells of a `.csv` have their numbers, from 0, as keys.
pub fn edited(name: &str, before: &[u8], text: &[u8]) -> Option<Vec<u8>> {
    let edits: Vec<Vec<Value>> = serde_json::from_slice(text).ok()?;
    let mut file = taken_apart(name, before)?;
    for edit in &edits {
        let (parent, key) = edit.first()?.as_str()?.rsplit_once('/')?;
        match (file.pointer_mut(parent), edit.get(1).cloned()) {
            (Some(Value::Object(object)), Some(value)) => drop(object.insert(key.to_owned(), value)),
            (Some(Value::Object(object)), None) => drop(object.remove(key)),
            (Some(Value::Array(array)), Some(value)) => match key.parse::<usize>().ok() {
                Some(k) if k < array.len() => array[k] = value,
                _ => array.push(value),
            },
            (Some(Value::Array(array)), None) => {
                if let Some(k) = key.parse::<usize>().ok().filter(|k| *k < array.len()) {
                    array.remove(k);
                }
            }
            _ => {}
        }
    }
    Some(put_together(name, &file))
}

/// A file of results as one value.
pub fn taken_apart(name: &str, bytes: &[u8]) -> Option<Value> {
    let lines = || std::str::from_utf8(bytes).ok().map(str::lines);
    match name.rsplit_once('.')?.1 {
        "jsonl" => {
            lines()?.map(|line| serde_json::from_str(line).ok()).collect::<Option<Vec<Value>>>().map(Value::from)
        }
        "csv" => Some(lines()?.map(|line| Value::from(line.split(',').collect::<Vec<_>>())).collect::<Vec<_>>().into()),
        _ => serde_json::from_slice(bytes).ok(),
    }
}

fn put_together(name: &str, file: &Value) -> Vec<u8> {
    let cell = |cell: &Value| cell.as_str().map_or_else(|| cell.to_string(), str::to_owned);
    let row = |row: &Value| match row {
        Value::Array(cells) => cells.iter().map(cell).collect::<Vec<_>>().join(","),
        other => cell(other),
    };
    let lines = |line: &dyn Fn(&Value) -> String| {
        let lines = file.as_array().into_iter().flatten();
        lines.map(|one| line(one) + "\n").collect::<String>().into_bytes()
    };
    match name.rsplit_once('.') {
        Some((_, "jsonl")) => lines(&Value::to_string),
        Some((_, "csv")) => lines(&row),
        _ => file.to_string().into_bytes(),
    }
}
