//! The command line: parse, call, print the error, exit code.

// a stream that is gone makes the macros of the standard library panic: see `cli::console`
#![deny(clippy::print_stdout, clippy::print_stderr)]

mod cli;

use std::process::ExitCode;

fn main() -> ExitCode {
    cli::end(cli::run(&cli::parse()))
}
