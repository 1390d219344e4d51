//! The program: see `dimcmc::command_line`.

use std::process::ExitCode;

fn main() -> ExitCode {
    dimcmc::command_line(std::env::args_os()).into()
}
