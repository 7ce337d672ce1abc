//! The program `leafdyn`.

use std::process::ExitCode;

fn main() -> ExitCode {
    leafdyn::cli::main()
}
