//! `dimcmc schema`: the JSON Schema of the config.

use super::{Failure, console};
use crate::data::config;

/// Print the JSON Schema of the config
///
/// It explains every key. An editor that finds it by the config's "$schema" completes keys and marks mistakes; `init`
/// names it there if it lies beside the config as dimcmc.schema.json.
#[derive(Debug, clap::Args)]
#[command(after_help = "Example:\n  dimcmc schema > dimcmc.schema.json")]
pub struct Args {}

/// Runs the command.
pub fn run(_args: &Args) -> Result<(), Failure> {
    console::print_bytes(config::schema().as_bytes());
    Ok(())
}
