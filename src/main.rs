//! `leafdyn`: a scenario is read, becomes a leaf, comes to rest, and the
//! result is judged and shown.

use std::process::ExitCode;

use clap::Parser;

mod cli;

fn main() -> ExitCode {
    let command_line = cli::Cli::parse();
    let interrupted = cli::stop_at_once_on_interrupt();
    match interrupted.and_then(|()| command_line.run()) {
        Ok(status) => status.into(),
        Err(refusal) => {
            cli::note(&format!("error: {refusal}"));
            cli::Status::Refused.into()
        }
    }
}
