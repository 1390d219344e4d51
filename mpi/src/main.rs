//! The program on the ranks of a cluster: the commands of `dimcmc`, started by `mpirun`.

use std::process::ExitCode;

fn main() -> ExitCode {
    dimcmc::internals::cli::main(std::env::args_os(), dimcmc_mpi::join).into()
}
