//! `leafdyn`: a scenario is read, becomes a leaf, comes to rest, and the
//! result is judged and shown.

use std::process::ExitCode;

fn main() -> ExitCode {
    leafdyn::cli::main()
}
