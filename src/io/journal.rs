//! The journal: `chain.jsonl`, one line per step, ensemble and walker, appended by whole steps.
//!
//! What a crash can leave is recovered: a torn last line and an incomplete last step are dropped. Anything else that is
//! wrong is refused with file and line number; a bad line that any complete line follows is corruption, not a torn tail.
//! While a process writes a journal it holds a lock on the file. Left out: what the numbers mean.

use crate::chain::{Chain, ChainError, Record, Shape};
use crate::log_density::Status;
use serde::de::{DeserializeSeed, Error as _, IgnoredAny, MapAccess, Visitor};
use serde::ser::SerializeMap;
use serde::{Deserialize, Serialize, Serializer};
use std::fs::{File, OpenOptions, TryLockError};
use std::io::{BufRead, BufReader, BufWriter, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

/// Keys of a line that are not parameters.
const KEYS: [&str; 10] =
    ["ensemble", "step", "walker", "accepted", "log_prob", "spottedness", "chi2", "status", "proposed", "passes"];

/// What can be wrong with a journal.
#[derive(Debug, thiserror::Error)]
pub enum JournalError {
    /// The file cannot be opened, read or written.
    #[error("{}: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// Another process is writing the file.
    #[error("{}: another process is writing this run", path.display())]
    Locked {
        /// The file.
        path: PathBuf,
    },
    /// A line is wrong, and not because writing it was interrupted.
    #[error("{}, line {line}: {problem}", path.display())]
    Line {
        /// The file.
        path: PathBuf,
        /// The line, from 1.
        line: usize,
        /// What is wrong.
        problem: String,
    },
    /// A step that is no next step was to be written.
    #[error("{}: {source}", path.display())]
    Step {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        source: ChainError,
    },
    /// A parameter has the name of another key of a line, or of another parameter.
    #[error("`{name}` cannot be the name of a parameter in a chain: it is taken")]
    Name {
        /// The name.
        name: String,
    },
}

/// A journal open for appending, locked against other processes until it is dropped.
#[derive(Debug)]
pub struct Journal {
    writer: BufWriter<File>,
    path: PathBuf,
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
        let mut options = OpenOptions::new();
        options.read(true).write(true);
        if replace {
            options.create(true)
        } else {
            options.create_new(true)
        };
        let file = options.open(path).map_err(at(path))?;
        lock(&file, path)?;
        file.set_len(0).map_err(at(path))?;
        Ok(Journal { writer: BufWriter::new(file), path: path.to_owned(), shape, lines: 0 })
    }

    /// Opens a journal to go on with it: reads the complete steps, and cuts the file after them.
    ///
    /// # Errors
    /// Those of [`read`], and [`JournalError::Locked`]. The file is only cut when it can be read without error.
    pub fn recover(path: &Path, shape: Shape) -> Result<(Self, Chain), JournalError> {
        check_names(&shape)?;
        let mut file = OpenOptions::new().read(true).write(true).open(path).map_err(at(path))?;
        lock(&file, path)?;
        let (chain, end) = parse(&mut BufReader::new(&file), path, &shape)?;
        file.set_len(end).map_err(at(path))?;
        file.seek(SeekFrom::Start(end)).map_err(at(path))?;
        let lines = chain.records().len();
        Ok((Journal { writer: BufWriter::new(file), path: path.to_owned(), shape, lines }, chain))
    }

    /// Appends one whole step and hands it to the operating system.
    ///
    /// # Errors
    /// [`JournalError::Step`] when it is not the next step, whole and finite (nothing is written then);
    /// [`JournalError::Io`].
    pub fn append(&mut self, step: &[Record]) -> Result<(), JournalError> {
        let refuse = |source| JournalError::Step { path: self.path.clone(), source };
        if step.len() != self.shape.size() {
            return Err(refuse(ChainError::StepSize { expected: self.shape.size(), found: step.len() }));
        }
        for (index, record) in step.iter().enumerate() {
            self.shape.check(self.lines + index, record).map_err(refuse)?;
        }
        for record in step {
            let line = Line { names: &self.shape.names, record };
            serde_json::to_writer(&mut self.writer, &line).map_err(|e| at(&self.path)(e.into()))?;
            self.writer.write_all(b"\n").map_err(at(&self.path))?;
        }
        self.lines += step.len();
        self.writer.flush().map_err(at(&self.path))
    }
}

/// Reads the complete steps of a journal and leaves the file alone; it may be being written meanwhile.
///
/// # Errors
/// [`JournalError::Io`]; [`JournalError::Line`] for anything wrong but a torn tail.
pub fn read(path: &Path, shape: &Shape) -> Result<Chain, JournalError> {
    check_names(shape)?;
    let file = File::open(path).map_err(at(path))?;
    Ok(parse(&mut BufReader::new(file), path, shape)?.0)
}

/// The complete steps, and the byte after the last of them.
fn parse(reader: &mut dyn BufRead, path: &Path, shape: &Shape) -> Result<(Chain, u64), JournalError> {
    let mut chain = Chain::new(shape.clone());
    let mut step: Vec<Record> = Vec::with_capacity(shape.size());
    let (mut end, mut complete, mut line) = (0u64, 0u64, 0usize);
    let mut bytes = Vec::new();
    loop {
        bytes.clear();
        end += reader.read_until(b'\n', &mut bytes).map_err(at(path))? as u64;
        line += 1;
        let refuse = |problem: String| JournalError::Line { path: path.to_owned(), line, problem };
        // No newline: the end of the file, or of what was written of its last line.
        let Some(text) = bytes.strip_suffix(b"\n") else { return Ok((chain, complete)) };
        let record = match parse_line(text, &shape.names) {
            Ok(record) => record,
            Err(error) if error.is_data() => return Err(refuse(without_place(&error))),
            Err(error) => {
                let mut rest = Vec::new();
                reader.read_until(b'\n', &mut rest).map_err(at(path))?;
                let followed = rest.ends_with(b"\n");
                return if followed { Err(refuse(without_place(&error))) } else { Ok((chain, complete)) };
            }
        };
        shape.check(line - 1, &record).map_err(|error| refuse(error.to_string()))?;
        step.push(record);
        if step.len() == shape.size() {
            chain.push_step(&step).map_err(|error| refuse(error.to_string()))?;
            step.clear();
            complete = end;
        }
    }
}

fn parse_line(text: &[u8], names: &[String]) -> Result<Record, serde_json::Error> {
    let mut deserializer = serde_json::Deserializer::from_slice(text);
    let record = LineSeed { names }.deserialize(&mut deserializer)?;
    deserializer.end()?;
    Ok(record)
}

/// The message of a JSON error; its "line 1" would be misleading.
fn without_place(error: &serde_json::Error) -> String {
    let text = error.to_string();
    let message = text.rfind(" at line ").map_or(text.as_str(), |end| &text[..end]);
    format!("{message} (column {})", error.column())
}

fn at(path: &Path) -> impl Fn(std::io::Error) -> JournalError {
    move |source| JournalError::Io { path: path.to_owned(), source }
}

fn lock(file: &File, path: &Path) -> Result<(), JournalError> {
    match file.try_lock() {
        Ok(()) => Ok(()),
        Err(TryLockError::WouldBlock) => Err(JournalError::Locked { path: path.to_owned() }),
        // A file system without locks: then nobody else can hold one either.
        Err(TryLockError::Error(error)) if error.kind() == std::io::ErrorKind::Unsupported => Ok(()),
        Err(TryLockError::Error(error)) => Err(at(path)(error)),
    }
}

fn check_names(shape: &Shape) -> Result<(), JournalError> {
    let taken = |(i, name): &(usize, &String)| KEYS.contains(&name.as_str()) || shape.names[..*i].contains(name);
    match shape.names.iter().enumerate().find(taken) {
        Some((_, name)) => Err(JournalError::Name { name: name.clone() }),
        None => Ok(()),
    }
}

/// A record on its way to text.
struct Line<'a> {
    names: &'a [String],
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
        for (name, value) in self.names.iter().zip(&record.theta) {
            map.serialize_entry(name, value)?;
        }
        map.serialize_entry("spottedness", &record.spottedness)?;
        map.serialize_entry("chi2", &record.chi2)?;
        map.serialize_entry("status", &record.status)?;
        map.serialize_entry("proposed", &record.proposed)?;
        map.serialize_entry("passes", &record.passes)?;
        map.end()
    }
}

/// Reads a line whose parameters have these names: each key once, none missing, none unknown.
#[derive(Clone, Copy)]
struct LineSeed<'a> {
    names: &'a [String],
}

impl<'de> DeserializeSeed<'de> for LineSeed<'_> {
    type Value = Record;
    fn deserialize<D: serde::Deserializer<'de>>(self, deserializer: D) -> Result<Record, D::Error> {
        deserializer.deserialize_map(self)
    }
}

/// A line, as far as it is read.
#[derive(Default)]
struct Slots {
    counts: [Option<usize>; 3],
    accepted: Option<bool>,
    numbers: [Option<f64>; 3],
    status: [Option<Status>; 2],
    passes: Option<u32>,
    theta: Vec<Option<f64>>,
}

impl<'de> Visitor<'de> for LineSeed<'_> {
    type Value = Record;

    fn expecting(&self, formatter: &mut std::fmt::Formatter) -> std::fmt::Result {
        formatter.write_str("a line of a chain")
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Record, A::Error> {
        let mut slots = Slots { theta: vec![None; self.names.len()], ..Slots::default() };
        while let Some(key) = map.next_key::<String>()? {
            match key.as_str() {
                "ensemble" => fill(&mut slots.counts[0], &key, &mut map)?,
                "step" => fill(&mut slots.counts[1], &key, &mut map)?,
                "walker" => fill(&mut slots.counts[2], &key, &mut map)?,
                "accepted" => fill(&mut slots.accepted, &key, &mut map)?,
                "log_prob" => fill(&mut slots.numbers[0], &key, &mut map)?,
                "spottedness" => fill(&mut slots.numbers[1], &key, &mut map)?,
                "chi2" => fill(&mut slots.numbers[2], &key, &mut map)?,
                "status" => fill(&mut slots.status[0], &key, &mut map)?,
                "proposed" => fill(&mut slots.status[1], &key, &mut map)?,
                "passes" => fill(&mut slots.passes, &key, &mut map)?,
                name => match self.names.iter().position(|known| known == name) {
                    Some(index) => fill(&mut slots.theta[index], &key, &mut map)?,
                    None => {
                        map.next_value::<IgnoredAny>()?;
                        return Err(A::Error::custom(format!("unknown key `{key}`")));
                    }
                },
            }
        }
        slots.record(self.names).map_err(|name| A::Error::custom(format!("missing key `{name}`")))
    }
}

impl Slots {
    /// The record, or the key that is missing.
    fn record(self, names: &[String]) -> Result<Record, &str> {
        let theta: Result<Vec<f64>, &str> =
            self.theta.iter().zip(names).map(|(value, name)| value.ok_or(name.as_str())).collect();
        Ok(Record {
            ensemble: self.counts[0].ok_or("ensemble")?,
            step: self.counts[1].ok_or("step")?,
            walker: self.counts[2].ok_or("walker")?,
            accepted: self.accepted.ok_or("accepted")?,
            log_prob: self.numbers[0].ok_or("log_prob")?,
            theta: theta?,
            spottedness: self.numbers[1].ok_or("spottedness")?,
            chi2: self.numbers[2].ok_or("chi2")?,
            status: self.status[0].ok_or("status")?,
            proposed: self.status[1].ok_or("proposed")?,
            passes: self.passes.ok_or("passes")?,
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
