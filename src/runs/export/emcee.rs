//! An HDF5 file as the backend of emcee 3 writes it (Foreman-Mackey et al. 2013; `emcee.backends.HDFBackend`): group
//! `mcmc` with `chain [step, walker, parameter]`, `log_prob [step, walker]`, `blobs [step, walker, blob]` and `accepted
//! [walker]`.
//!
//! All walkers of all ensembles are side by side, those of the first ensemble first: emcee's autocorrelation time
//! averages over walkers, and is correct for this order. It does not support ensembles; `chain.reshape(steps,
//! ensembles, walkers, parameters)` restores them, and R-hat between walkers, which ArviZ computes from such a file, is
//! not that between ensembles. The start (step 0) is not a step in emcee and is omitted, so that `accepted / iteration`
//! is the acceptance fraction; the warm-up is included, and the attribute `discard` is the argument for
//! `get_chain(discard=...)`. A periodic parameter is unwrapped around its mode.
//!
//! In addition to emcee's attributes there are names, units, priors and injected values.

use super::place::begins_with;
use super::{Contents, DerivedQuantity, ExportError};
use crate::data::io::atomic::{self, WriteError};
use crate::sampling::chain::Record;
use hdf5_writer::{AttributeBuilder, DatasetBuilder, Hdf5Builder, WriteOptions};
use std::path::Path;

/// The group, named as the backend expects it.
const GROUP: &str = "mcmc";

/// Version of emcee with this layout.
const EMCEE: &str = "3.1.6";

/// Whether there is anything to write.
///
/// # Errors
/// [`ExportError::OnlyStart`].
pub fn check(contents: &Contents) -> Result<(), ExportError> {
    match contents.chain.steps() {
        0 | 1 => Err(ExportError::OnlyStart { path: contents.path.clone() }),
        _ => Ok(()),
    }
}

/// Whether the file may be an earlier export: whether it is HDF5.
pub fn is_own(file: &Path) -> bool {
    begins_with(file, b"\x89HDF\r\n\x1a\n")
}

/// Writes the file, for a chain of two steps or more.
///
/// # Errors
/// A file that cannot be written.
pub fn write(contents: &Contents, file: &Path) -> Result<(), WriteError> {
    let bytes = encode(contents)
        .map_err(|error| WriteError { path: file.into(), source: std::io::Error::other(error.to_string()) })?;
    atomic::write(file, &bytes)
}

/// The bytes of the file.
fn encode(contents: &Contents) -> hdf5_writer::Result<Vec<u8>> {
    let chain = &contents.chain;
    let (walkers, iteration) = (chain.shape().size(), chain.steps() - 1);
    let records = &chain.records()[walkers..];
    let (mut positions, mut accepted) = (Vec::new(), vec![0.0; walkers]);
    for (index, record) in records.iter().enumerate() {
        positions.extend(contents.parameters.iter().zip(&record.theta).map(|(one, x)| one.unwrapped(*x)));
        accepted[index % walkers] += f64::from(u8::from(record.accepted));
    }
    let log_prob: Vec<f64> = records.iter().map(|record| record.log_prob).collect();
    let derived = |record: &Record| contents.derived.iter().map(|one| one.settled.value(&record.theta)).collect();
    let blobs_of = |record: &Record| [record.numbers.clone(), derived(record)].concat();
    let blobs: Vec<f64> = records.iter().flat_map(blobs_of).collect();
    let dataset = |name: &str, shape: &[usize], values: &[f64]| {
        let shape: Vec<u64> = shape.iter().map(|&length| length as u64).collect();
        DatasetBuilder::typed_data(format!("{GROUP}/{name}"), shape, values)
    };
    let names: Vec<&str> = contents.names().collect();
    let mut file = Hdf5Builder::new()
        .dataset(dataset("chain", &[iteration, walkers, names.len()], &positions)?)
        .dataset(dataset("log_prob", &[iteration, walkers], &log_prob)?)
        .dataset(dataset("blobs", &[iteration, walkers, blob_names(contents).len()], &blobs)?)
        .dataset(dataset("accepted", &[walkers], &accepted)?);
    for attribute in attributes(contents)? {
        file = file.group_attribute(GROUP, attribute);
    }
    file.into_plan()?.encode(WriteOptions::default())
}

/// The other values of a draw, then derived quantities.
fn blob_names(contents: &Contents) -> Vec<&str> {
    contents.numbers().chain(contents.derived.iter().map(DerivedQuantity::name)).collect()
}

fn attributes(contents: &Contents) -> hdf5_writer::Result<Vec<AttributeBuilder>> {
    let chain = &contents.chain;
    let names: Vec<&str> = contents.names().collect();
    let units: Vec<&str> = contents.parameters.iter().map(|one| one.unit).collect();
    // step s of the chain has index s - 1 here
    let discard = contents.summary.discarded_steps.saturating_sub(1);
    let counts = [
        ("nwalkers", chain.shape().size()),
        ("ndim", names.len()),
        ("iteration", chain.steps() - 1),
        ("has_blobs", 1),
        ("ensembles", chain.shape().ensembles),
        ("discard", discard),
    ];
    let counts = counts.into_iter().map(|(name, count)| AttributeBuilder::scalar(name, count as i64));
    let mut attributes = counts.collect::<hdf5_writer::Result<Vec<_>>>()?;
    attributes.push(AttributeBuilder::vlen_strings("parameter_names", &names)?);
    attributes.push(AttributeBuilder::vlen_strings("parameter_units", &units)?);
    attributes.push(AttributeBuilder::vlen_strings("blob_names", &blob_names(contents))?);
    let blob_units: Vec<&str> =
        contents.numbers().map(|_| "1").chain(contents.derived.iter().map(|one| one.unit)).collect();
    attributes.push(AttributeBuilder::vlen_strings("blob_units", &blob_units)?);
    let texts = [
        ("version", EMCEE.to_owned()),
        ("dimcmc_version", contents.version.clone()),
        ("priors", contents.priors()),
        ("data_sha256", contents.data_sha256.clone()),
        ("config_sha256", contents.config_sha256.clone()),
    ];
    let injected = contents.injected().map(|text| ("injected", text));
    let factors = contents.sigma_factors().map(|text| ("sigma_factors", text));
    let texts = texts.into_iter().chain(injected).chain(factors);
    attributes.extend(texts.map(|(name, text)| AttributeBuilder::fixed_string(name, text)));
    Ok(attributes)
}
