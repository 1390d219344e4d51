//! `dimcmc schema`: the JSON Schema of the config.

use super::{Failure, console};
use crate::data::config;

/// Print the JSON Schema of the config
///
/// It documents every key. Editors use it to complete keys and mark mistakes if the config names it under "$schema";
/// `init` does so if dimcmc.schema.json lies beside the config.
#[derive(Debug, clap::Args)]
#[command(after_help = "Example:\n  dimcmc schema > dimcmc.schema.json")]
pub struct Args {}

/// Runs the command.
pub fn run(_args: &Args) -> Result<(), Failure> {
    console::print_bytes(config::schema().as_bytes());
    Ok(())
}
