//! `dimcmc completions`: completion scripts of shells for commands and options.

use super::{Failure, console};
use clap_complete::Shell;

/// Print a shell's completions of commands and options
///
/// For bash, put them where bash-completion looks (~/.local/share/bash-completion/completions/dimcmc); for zsh, as
/// _dimcmc in a folder of $fpath; for fish, in ~/.config/fish/completions/dimcmc.fish.
#[derive(Debug, clap::Args)]
#[command(after_help = "Example:\n  dimcmc completions bash > dimcmc.bash")]
pub struct Args {
    /// The shell
    shell: Shell,
}

/// Runs the command.
pub fn run(args: &Args) -> Result<(), Failure> {
    let mut script = Vec::new();
    clap_complete::generate(args.shell, &mut super::command(), "dimcmc", &mut script);
    console::print_bytes(&script);
    Ok(())
}
