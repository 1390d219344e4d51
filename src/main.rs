//! The command line: parse, call, print the error, exit code.

fn main() {}
