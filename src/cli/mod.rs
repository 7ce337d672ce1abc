//! The command line: one file per verb. What is computed is in the library.

mod check;
mod check_report;
mod progress;
mod relax;
mod report;
mod request;
mod text;

use std::error::Error;
use std::io::{self, Write};
use std::process::{self, ExitCode};

use clap::{Parser, Subcommand};

use leafdyn::output;

/// How a leaf of coupled elastic veins comes to rest: its shape, with an error bar and a statement of stability.
#[derive(Debug, Parser)]
#[command(name = "leafdyn", version, about, arg_required_else_help = true)]
pub struct Cli {
    #[command(subcommand)]
    verb: Verb,
}

#[derive(Debug, Subcommand)]
enum Verb {
    Relax(relax::Relax),
    Check(check::Check),
}

impl Cli {
    /// Does what was asked for.
    pub fn run(self) -> Result<Status, Refusal> {
        match self.verb {
            Verb::Relax(relax) => relax.run(),
            Verb::Check(check) => check.run(),
        }
    }
}

/// Why something was not done: a message that says what to change.
pub type Refusal = Box<dyn Error>;

/// What the process tells its caller.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Status {
    /// At rest within the tolerance; of a check: both methods agree.
    Success = 0,
    /// The run ended otherwise: not at rest within the tolerance; of a check:
    /// the methods differ or could not be compared. What was found is written
    /// all the same.
    Failure = 1,
    /// The request was refused, or its result could not be written.
    Refused = 2,
}

/// Status of a run ended by Ctrl-C: 128 and the number of the signal.
const INTERRUPTED: i32 = 130;

impl From<Status> for ExitCode {
    fn from(status: Status) -> Self {
        ExitCode::from(status as u8)
    }
}

/// Lets Ctrl-C end the process at once, with no file half written.
pub fn stop_at_once_on_interrupt() -> Result<(), Refusal> {
    ctrlc::set_handler(|| {
        output::abandon_unfinished();
        process::exit(INTERRUPTED);
    })?;
    Ok(())
}

/// A line on standard error; if nobody can read it, nothing is lost.
pub fn note(line: &str) {
    let _ = writeln!(io::stderr(), "{line}");
}

/// Writes to standard output. A reader that has seen enough (`| head`) is no error.
fn show(bytes: &[u8]) -> Result<(), Refusal> {
    let mut stdout = io::stdout().lock();
    match stdout.write_all(bytes).and_then(|()| stdout.flush()) {
        Err(error) if error.kind() != io::ErrorKind::BrokenPipe => {
            Err(format!("cannot write to standard output: {error}").into())
        }
        _ => Ok(()),
    }
}
