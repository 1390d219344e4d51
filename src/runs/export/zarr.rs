//! A Zarr store (version 3) with the groups of ArviZ's InferenceData: `posterior`, `sample_stats`, and the same for the
//! warm-up.
//!
//! Dimensions are `chain` and `draw`: an ensemble is a chain, draws are in the order of `draws`, which explains it;
//! `step` and `walker` are coordinates along `draw`, so that the ensemble can be restored. `sample_stats` has the
//! values of a draw that are not parameters: `lp` (ln of the posterior density), the other values of the evaluation,
//! and the origin of the draw, words as codes with CF's `flag_values` and `flag_meanings`. Attributes are numbers and
//! text, JSON for structured ones, so that xarray can also write them to netCDF. A periodic parameter is unwrapped
//! around its mode. Derived quantities are in `posterior` too, with the attribute `derived`.
//!
//! Layout: <https://python.arviz.org/projects/base/en/latest/explanation/schema.html>.

use super::draws::Draws;
use super::{Contents, DerivedQuantity, Quantity};
use crate::data::io::atomic::WriteError;
use crate::data::io::zarr::{self, Array, Attributes, Group, Values};
use crate::sampling::chain::{MoveKind, Record};
use crate::sampling::log_density::Status;
use crate::surface::{CHI2, SPOTTEDNESS};
use serde_json::{Value, json};
use std::path::Path;

/// Name of the program in the attributes.
const PROGRAM: &str = "dimcmc";

/// Key of that attribute in ArviZ.
const LIBRARY: &str = "inference_library";

/// How evaluations end, in the order of their codes.
const STATUS: [(Status, &str); 5] = [
    (Status::Converged, "converged"),
    (Status::Unreachable, "unreachable"),
    (Status::OutsidePrior, "outside-prior"),
    (Status::StoppedShort, "stopped-short"),
    (Status::NonFinite, "non-finite"),
];

/// Writes the store, replacing an earlier one.
///
/// # Errors
/// A folder that cannot be written.
pub fn write(contents: &Contents, folder: &Path) -> Result<(), WriteError> {
    let warmup = contents.summary.discarded_steps;
    let kept = Draws::of(&contents.chain, warmup..contents.chain.steps());
    let mut groups = vec![
        ("posterior".to_owned(), posterior(contents, &kept)),
        ("sample_stats".to_owned(), sample_stats(contents, &kept)),
    ];
    if warmup > 0 {
        let early = Draws::of(&contents.chain, 0..warmup);
        groups.push(("warmup_posterior".to_owned(), posterior(contents, &early)));
        groups.push(("warmup_sample_stats".to_owned(), sample_stats(contents, &early)));
    }
    zarr::write(folder, &Group { attributes: attributes(contents), groups, arrays: Vec::new() })
}

/// Whether the folder is such a store.
pub fn is_own(folder: &Path) -> bool {
    zarr::attributes(folder).is_some_and(|attributes| attributes.get(LIBRARY) == Some(&json!(PROGRAM)))
}

/// Attributes of the run.
fn attributes(contents: &Contents) -> Attributes {
    let mut attributes = some_attributes([
        (LIBRARY, json!(PROGRAM)),
        ("inference_library_version", json!(contents.version)),
        ("creation_library", json!(PROGRAM)),
        ("creation_library_version", json!(env!("CARGO_PKG_VERSION"))),
        ("creation_library_language", json!("Rust")),
        ("walkers", json!(contents.chain.shape().walkers)),
        ("discarded_steps", json!(contents.summary.discarded_steps)),
        ("converged", json!(u8::from(contents.summary.converged))),
        ("seed", json!(contents.seed.to_string())),
        ("priors", json!(contents.priors())),
        ("data_sha256", json!(contents.data_sha256)),
        ("config_sha256", json!(contents.config_sha256)),
        ("config", json!(contents.config.to_string())),
    ]);
    if let Some(injected) = contents.injected() {
        attributes.insert("injected".to_owned(), json!(injected));
    }
    attributes
}

fn posterior(contents: &Contents, draws: &Draws) -> Group {
    let parameter = |(p, one): (usize, &Quantity)| {
        let values = draws.records(&contents.chain).map(|record| one.unwrapped(record.theta[p]));
        let mut attributes = some_attributes([
            ("units", json!(one.unit)),
            ("long_name", json!(format!("${}$", one.latex))),
            ("prior", json!(one.prior.to_string())),
        ]);
        if let Some(injected) = one.injected {
            attributes.insert("injected".to_owned(), json!(injected));
        }
        if let Some(factor) = one.sigma_factor {
            attributes.insert("sigma_factor".to_owned(), json!(factor));
        }
        if let Some(centre) = one.centre {
            attributes.insert("period".to_owned(), json!(1.0));
            attributes.insert("unwrapped_around".to_owned(), json!(centre));
        }
        variable(&one.name, draws, Values::Floats(values.collect()), attributes)
    };
    let derived = |one: &DerivedQuantity| {
        let values = draws.records(&contents.chain).map(|record| one.settled.value(&record.theta));
        let mut attributes = some_attributes([
            ("units", json!(one.unit)),
            ("long_name", json!(format!("${}$", one.latex))),
            ("derived", json!(1)),
        ]);
        if let Some(definition) = &one.settled.quantity.definition {
            attributes.insert("definition".to_owned(), json!(definition));
        }
        if let Some(injected) = one.injected {
            attributes.insert("injected".to_owned(), json!(injected));
        }
        variable(one.name(), draws, Values::Floats(values.collect()), attributes)
    };
    let parameters = contents.parameters.iter().enumerate().map(parameter);
    let arrays = parameters.chain(contents.derived.iter().map(derived)).collect();
    group(contents, draws, arrays)
}

fn sample_stats(contents: &Contents, draws: &Draws) -> Group {
    let records = || draws.records(&contents.chain);
    let floats = |name: &str, about: &str, value: &dyn Fn(&Record) -> f64| {
        let attributes = some_attributes([("long_name", json!(about)), ("units", json!("1"))]);
        variable(name, draws, Values::Floats(records().map(value).collect()), attributes)
    };
    let codes = |name: &str, about: &str, words: Vec<&str>, code: fn(&Record) -> usize| {
        let values: Vec<usize> = (0..words.len()).collect();
        let attributes = some_attributes([
            ("long_name", json!(about)),
            ("flag_values", json!(values)),
            ("flag_meanings", json!(words.join(" "))),
        ]);
        variable(name, draws, Values::Codes(records().map(|record| code(record) as u8).collect()), attributes)
    };
    let about = |text: &str| some_attributes([("long_name", json!(text))]);
    let accepted = Values::Booleans(records().map(|record| record.accepted).collect());
    let applications = Values::Integers(records().map(|record| i64::from(record.model_applications)).collect());
    let status_words = || STATUS.iter().map(|(_, word)| *word).collect();
    let move_words = std::iter::once("start").chain(MoveKind::ALL.map(MoveKind::name)).collect();
    let mut arrays = vec![floats("lp", "ln of the posterior density", &|record| record.log_prob)];
    let numbers = contents.numbers().enumerate();
    arrays.extend(numbers.map(|(i, name)| floats(name, meaning(name), &|record| record.numbers[i])));
    arrays.extend([
        codes("status", "how the evaluation of the draw ended", status_words(), |record| status(record.status)),
        variable("accepted", draws, accepted, about("whether the draw is new at its step")),
        codes("move", "how the step's proposal was made", move_words, |record| made_by(record.by)),
        codes("proposed", "how the evaluation of the proposal ended", status_words(), |record| status(record.proposed)),
        variable("model_applications", draws, applications, about("model applications that the proposal took")),
    ]);
    group(contents, draws, arrays)
}

/// Description of another value of a draw.
fn meaning(name: &str) -> &str {
    match name {
        SPOTTEDNESS => "spottedness of the image",
        CHI2 => "chi2 of the reconstruction",
        other => other,
    }
}

/// The code of a status.
fn status(status: Status) -> usize {
    STATUS.iter().position(|(one, _)| *one == status).unwrap_or(STATUS.len())
}

/// The code of a move; 0 for none.
fn made_by(by: Option<MoveKind>) -> usize {
    MoveKind::ALL.iter().position(|one| Some(*one) == by).map_or(0, |code| code + 1)
}

/// A variable over chains and draws.
fn variable(name: &str, draws: &Draws, values: Values, mut attributes: Attributes) -> Array {
    let [chains, length] = draws.shape();
    attributes.insert("coordinates".to_owned(), json!("step walker"));
    Array { name: name.to_owned(), dimensions: vec![("chain", chains), ("draw", length)], values, attributes }
}

/// A group of variables with their coordinates.
fn group(contents: &Contents, draws: &Draws, mut arrays: Vec<Array>) -> Group {
    let [chains, length] = draws.shape();
    let coordinate = |name: &'static str, dimension, values: Vec<i64>, about: &str| Array {
        name: name.to_owned(),
        dimensions: vec![(dimension, values.len())],
        values: Values::Integers(values),
        attributes: some_attributes([("long_name", json!(about))]),
    };
    let of_first = |value: fn(&Record) -> usize| draws.ensemble(&contents.chain, 0).map(|r| value(r) as i64).collect();
    arrays.push(coordinate("chain", "chain", (0..chains as i64).collect(), "ensemble"));
    arrays.push(coordinate("draw", "draw", (0..length as i64).collect(), "draw of the ensemble"));
    arrays.push(coordinate("step", "draw", of_first(|record| record.step), "step of the draw"));
    arrays.push(coordinate("walker", "draw", of_first(|record| record.walker), "walker of the draw"));
    let attributes =
        some_attributes([(LIBRARY, json!(PROGRAM)), ("inference_library_version", json!(contents.version))]);
    Group { attributes, groups: Vec::new(), arrays }
}

fn some_attributes<const N: usize>(pairs: [(&str, Value); N]) -> Attributes {
    pairs.into_iter().map(|(key, value)| (key.to_owned(), value)).collect()
}
