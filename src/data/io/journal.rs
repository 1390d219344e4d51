//! The journal: `chain.jsonl`, one line per step, ensemble and walker, appended by whole steps.

use super::lines::{self, Claim, LineFile, Refusal};
use crate::sampling::chain::{Chain, ChainError, MoveKind, Record, Shape};
use crate::sampling::log_density::Status;
use serde::de::{DeserializeSeed, Error as _, IgnoredAny, MapAccess, Visitor};
use serde::ser::SerializeMap;
use serde::{Deserialize, Serialize, Serializer};
use std::path::Path;

pub use super::lines::JournalError;

/// Keys of every line, whatever is sampled; the last is the former name of `model_applications`.
const KEYS: [&str; 10] = [
    "ensemble",
    "step",
    "walker",
    "accepted",
    "log_prob",
    "status",
    "proposed",
    "model_applications",
    "move",
    "passes",
];

/// A journal open for appending, locked against other processes until it is dropped.
#[derive(Debug)]
pub struct Journal {
    file: LineFile,
    shape: Shape,
    lines: usize,
}

impl Journal {
    /// Makes a new, empty journal; one that is there already is emptied if `replace`, and refused otherwise.
    ///
    /// # Errors
    /// [`JournalError::Io`] (the file is there already, for one), [`JournalError::Locked`], [`JournalError::Name`].
    pub fn create(path: &Path, shape: Shape, replace: bool) -> Result<Self, JournalError> {
        check_names(&shape)?;
        Ok(Journal { file: LineFile::create(path, replace)?, shape, lines: 0 })
    }

    /// The same where its place was claimed before.
    ///
    /// # Errors
    /// [`JournalError::Io`], [`JournalError::Name`].
    pub fn begin(claim: Claim, shape: Shape) -> Result<Self, JournalError> {
        check_names(&shape)?;
        Ok(Journal { file: claim.begin()?, shape, lines: 0 })
    }

    /// Opens a journal to resume it: reads the complete steps, and cuts the file after them.
    ///
    /// # Errors
    /// Those of [`read`], and [`JournalError::Locked`]. The file is only cut when it can be read without error.
    pub fn recover(path: &Path, shape: Shape) -> Result<(Self, Chain), JournalError> {
        check_names(&shape)?;
        let mut reader = StepReader::new(&shape);
        let file = LineFile::recover(path, &mut |line| reader.take(line))?;
        let chain = reader.chain;
        let lines = chain.records().len();
        Ok((Journal { file, shape, lines }, chain))
    }

    /// Appends one whole step and hands it to the operating system.
    ///
    /// # Errors
    /// [`JournalError::Next`] when it is not the next step, whole and finite (nothing is written then);
    /// [`JournalError::Io`].
    pub fn append(&mut self, step: &[Record]) -> Result<(), JournalError> {
        let refuse =
            |error: ChainError| JournalError::Next { path: self.file.path().into(), problem: error.to_string() };
        if step.len() != self.shape.size() {
            return Err(refuse(ChainError::StepSize { expected: self.shape.size(), found: step.len() }));
        }
        for (index, record) in step.iter().enumerate() {
            self.shape.check(self.lines + index, record).map_err(refuse)?;
        }
        self.file.append(step.iter().map(|record| Line { shape: &self.shape, record }))?;
        self.lines += step.len();
        Ok(())
    }
}

/// Reads the complete steps of a journal without changing the file, which may be written at the same time.
///
/// # Errors
/// [`JournalError::Io`]; [`JournalError::Line`] for anything wrong but a torn tail.
pub fn read(path: &Path, shape: &Shape) -> Result<Chain, JournalError> {
    Ok(read_to_end(path, shape)?.0)
}

/// The same, and whether the file ends with a whole step.
///
/// # Errors
/// As [`read`].
pub fn read_to_end(path: &Path, shape: &Shape) -> Result<(Chain, bool), JournalError> {
    check_names(shape)?;
    let mut reader = StepReader::new(shape);
    let is_whole = lines::read(path, &mut |line| reader.take(line))?;
    Ok((reader.chain, is_whole))
}

/// Collects lines into complete steps.
struct StepReader {
    chain: Chain,
    step: Vec<Record>,
}

impl StepReader {
    fn new(shape: &Shape) -> Self {
        StepReader { chain: Chain::new(shape.clone()), step: Vec::with_capacity(shape.size()) }
    }

    /// Takes the next line; whether it completes a step.
    fn take(&mut self, line: &[u8]) -> Result<bool, Refusal> {
        let shape = self.chain.shape();
        let record = parse_line(line, shape)?;
        let index = self.chain.records().len() + self.step.len();
        shape.check(index, &record).map_err(|error| error.to_string())?;
        self.step.push(record);
        if self.step.len() < shape.size() {
            return Ok(false);
        }
        self.chain.push_step(&self.step).map_err(|error| error.to_string())?;
        self.step.clear();
        Ok(true)
    }
}

fn parse_line(text: &[u8], shape: &Shape) -> Result<Record, serde_json::Error> {
    let mut deserializer = serde_json::Deserializer::from_slice(text);
    let record = LineSeed { shape }.deserialize(&mut deserializer)?;
    deserializer.end()?;
    Ok(record)
}

fn check_names(shape: &Shape) -> Result<(), JournalError> {
    let taken =
        |(i, name): &(usize, &String)| KEYS.contains(&name.as_str()) || named(shape).take(*i).any(|n| n == *name);
    match named(shape).enumerate().find(taken) {
        Some((_, name)) => Err(JournalError::Name { name: name.clone() }),
        None => Ok(()),
    }
}

/// Names of the parameters, then those of the other values of an evaluation.
fn named(shape: &Shape) -> impl Iterator<Item = &String> {
    shape.names.iter().chain(&shape.numbers)
}

/// A record on its way to text.
struct Line<'a> {
    shape: &'a Shape,
    record: &'a Record,
}

impl Serialize for Line<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let record = self.record;
        let mut map = serializer.serialize_map(None)?;
        map.serialize_entry("ensemble", &record.ensemble)?;
        map.serialize_entry("step", &record.step)?;
        map.serialize_entry("walker", &record.walker)?;
        map.serialize_entry("accepted", &record.accepted)?;
        map.serialize_entry("log_prob", &record.log_prob)?;
        for (name, value) in named(self.shape).zip(record.theta.iter().chain(&record.numbers)) {
            map.serialize_entry(name, value)?;
        }
        map.serialize_entry("status", &record.status)?;
        map.serialize_entry("proposed", &record.proposed)?;
        map.serialize_entry("model_applications", &record.model_applications)?;
        if let Some(by) = record.by {
            map.serialize_entry("move", &by)?;
        }
        map.end()
    }
}

/// Reads a line with the names of a shape: each key once, none missing, none unknown.
#[derive(Clone, Copy)]
struct LineSeed<'a> {
    shape: &'a Shape,
}

impl<'de> DeserializeSeed<'de> for LineSeed<'_> {
    type Value = Record;
    fn deserialize<D: serde::Deserializer<'de>>(self, deserializer: D) -> Result<Record, D::Error> {
        deserializer.deserialize_map(self)
    }
}

/// A partially read line.
#[derive(Default)]
struct Slots {
    counts: [Option<usize>; 3],
    accepted: Option<bool>,
    log_prob: Option<f64>,
    status: [Option<Status>; 2],
    model_applications: Option<u32>,
    by: Option<MoveKind>,
    /// In the order of [`named`].
    values: Vec<Option<f64>>,
}

impl<'de> Visitor<'de> for LineSeed<'_> {
    type Value = Record;

    fn expecting(&self, formatter: &mut std::fmt::Formatter) -> std::fmt::Result {
        formatter.write_str("a line of a chain")
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Record, A::Error> {
        let mut slots = Slots { values: vec![None; named(self.shape).count()], ..Slots::default() };
        while let Some(key) = map.next_key::<String>()? {
            match key.as_str() {
                "ensemble" => fill(&mut slots.counts[0], &key, &mut map)?,
                "step" => fill(&mut slots.counts[1], &key, &mut map)?,
                "walker" => fill(&mut slots.counts[2], &key, &mut map)?,
                "accepted" => fill(&mut slots.accepted, &key, &mut map)?,
                "log_prob" => fill(&mut slots.log_prob, &key, &mut map)?,
                "status" => fill(&mut slots.status[0], &key, &mut map)?,
                "proposed" => fill(&mut slots.status[1], &key, &mut map)?,
                "model_applications" | "passes" => fill(&mut slots.model_applications, &key, &mut map)?,
                "move" => fill(&mut slots.by, &key, &mut map)?,
                name => match named(self.shape).position(|known| known == name) {
                    Some(index) => fill(&mut slots.values[index], &key, &mut map)?,
                    None => {
                        map.next_value::<IgnoredAny>()?;
                        return Err(A::Error::custom(format!("unknown key `{key}`")));
                    }
                },
            }
        }
        slots.record(self.shape).map_err(|name| A::Error::custom(format!("missing key `{name}`")))
    }
}

impl Slots {
    /// The record, or the key that is missing.
    fn record(self, shape: &Shape) -> Result<Record, &str> {
        let (ensemble, step) = (self.counts[0].ok_or("ensemble")?, self.counts[1].ok_or("step")?);
        let (walker, accepted) = (self.counts[2].ok_or("walker")?, self.accepted.ok_or("accepted")?);
        let log_prob = self.log_prob.ok_or("log_prob")?;
        let values = self.values.iter().zip(named(shape)).map(|(value, name)| value.ok_or(name.as_str()));
        let mut theta = values.collect::<Result<Vec<f64>, &str>>()?;
        Ok(Record {
            ensemble,
            step,
            walker,
            accepted,
            log_prob,
            numbers: theta.split_off(shape.names.len()),
            theta,
            status: self.status[0].ok_or("status")?,
            proposed: self.status[1].ok_or("proposed")?,
            model_applications: self.model_applications.ok_or("model_applications")?,
            by: self.by,
        })
    }
}

/// Puts the next value into its slot, once.
fn fill<'de, T: Deserialize<'de>, A: MapAccess<'de>>(
    slot: &mut Option<T>,
    key: &str,
    map: &mut A,
) -> Result<(), A::Error> {
    let value = map.next_value().map_err(|error| A::Error::custom(format!("`{key}`: {error}")))?;
    match slot.replace(value) {
        Some(_) => Err(A::Error::custom(format!("key `{key}` twice"))),
        None => Ok(()),
    }
}
