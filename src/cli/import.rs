//! `dimcmc import`: a config from another program's input files.

use super::init::{KnownArgs, next_commands};
use super::output::ConfigFile;
use super::signals::{RESULT, Signals};
use super::{Failure, Global, console, progress};
use crate::data::import::Import;
use crate::data::init::{List, Place, propose};
use crate::data::io::atomic::{self, folder_of};
use crate::data::io::zdipy::{Input, LINE_FILE, LocalLineFile};
use crate::numerics::text::shown;
use std::path::{Path, PathBuf};

/// Write a config from ZDIpy's input files
///
/// Reads inzdi.dat, model-voigt-line.dat beside it, and the profiles that it lists. Writes the config and the list of
/// profiles beside it (star.json, star_observations.txt). Epoch, angles, signs and units are the same in both programs.
/// Keys without counterpart are listed; values unknown to ZDIpy, such as priors, are set as by `init`.
#[derive(Debug, clap::Args)]
#[command(after_help = "Example:\n  dimcmc import inzdi.dat --out star.json")]
pub struct Args {
    /// ZDIpy's inzdi.dat
    input: PathBuf,
    /// Local-line model of ZDIpy; by default model-voigt-line.dat beside the input
    #[arg(long, value_name = "FILE")]
    line: Option<PathBuf>,
    #[command(flatten)]
    output: ConfigFile,
    #[command(flatten)]
    known: KnownArgs,
}

/// Runs the command.
pub fn run(args: &Args, global: &Global) -> Result<(), Failure> {
    let signals = Signals::catch(RESULT)?;
    let config = args.output.path();
    let list = list_beside(config);
    args.output.check(Some(&list))?;
    let input = Input::read(&args.input)?;
    let line = line_file(args).map(|path| LocalLineFile::read(&path)).transpose()?;
    args.output.spare(&files(args, &input), Some(&list))?;
    let folder = args.output.relative(folder_of(&args.input))?;
    let import = Import::zdipy(&input, line.as_ref(), &folder).map_err(Failure::of)?;
    args.known.check_single()?;
    let own = List {
        list: &list,
        list_bytes: import.list.as_bytes(),
        list_in_config: PathBuf::from(list.file_name().unwrap_or_default()),
        name: None,
        resolving_power: None,
        wavelength_nm: None,
    };
    let (light_curves, indicators) = (Vec::new(), Vec::new());
    let place = Place { config, lists: vec![own], light_curves, indicators, schema: args.output.schema() };
    let known = args.known.over(import.known.clone())?;
    let spinner = progress::bar(global, None, "first look, test fit");
    let proposal = propose(&place, &known, &|note| spinner.println(format!("note: {note}")));
    spinner.finish_and_clear();
    let proposal = proposal.map_err(|error| args.known.failure(error, &args.input))?;
    let _claimed = args.output.claim(Some(&list))?;
    signals.defer();
    // the list first, so that an existing config has its observations
    atomic::write(&list, import.list.as_bytes())?;
    atomic::write(config, proposal.json.as_bytes())?;
    let (table, left_out) = (proposal.table(), import.table());
    let written = format!("written: {}, {}", shown(config), shown(&list));
    console::print(format_args!("{table}\n{left_out}{}{written}\n", if left_out.is_empty() { "" } else { "\n" }));
    next_commands(&proposal, config);
    Ok(())
}

/// The files that are read.
fn files(args: &Args, input: &Input) -> Vec<PathBuf> {
    let profiles = input.profiles.iter().map(|profile| folder_of(&args.input).join(&profile.file));
    std::iter::once(args.input.clone()).chain(line_file(args)).chain(profiles).collect()
}

fn line_file(args: &Args) -> Option<PathBuf> {
    let beside = folder_of(&args.input).join(LINE_FILE);
    args.line.clone().or(beside.is_file().then_some(beside))
}

fn list_beside(config: &Path) -> PathBuf {
    let mut name = config.file_stem().unwrap_or_default().to_owned();
    name.push("_observations.txt");
    config.with_file_name(name)
}
