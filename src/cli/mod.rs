//! The command line: one file per verb. What is computed is in the library.

mod chart;
mod check;
mod fit;
mod help;
mod job;
mod map;
mod new;
mod progress;
mod relax;
mod request;
mod simulate;
mod trace;

use std::env;
use std::error::Error;
use std::ffi::OsString;
use std::io::{self, IsTerminal, Write};
use std::process::{self, ExitCode};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};

use clap::{Parser, Subcommand};

use crate::files;
use crate::files::Checkpointer;
use crate::report::{FileError, Refused, json};
use crate::scenario::printable;

/// How a leaf of coupled elastic veins comes to rest, with an error bar and a statement of stability, and how it moves.
#[derive(Debug, Parser)]
#[command(name = "leafdyn", version, about, arg_required_else_help = true)]
struct Cli {
    #[command(subcommand)]
    verb: Verb,
}

#[derive(Debug, Subcommand)]
enum Verb {
    Relax(relax::Relax),
    Check(check::Check),
    Fit(fit::Fit),
    Chart(chart::Chart),
    Map(map::Map),
    Simulate(simulate::Simulate),
    Trace(trace::Trace),
    New(new::New),
    Schema(help::Schema),
    Completions(help::Completions),
    Man(help::Man),
}

impl Cli {
    /// Does what was asked for.
    fn run(self) -> Result<Status, Refusal> {
        let done = match self.verb {
            Verb::Relax(relax) => relax.run(),
            Verb::Check(check) => check.run(),
            Verb::Fit(fit) => fit.run(),
            Verb::Chart(chart) => chart.run(),
            Verb::Map(map) => map.run(),
            Verb::Simulate(simulate) => simulate.run(),
            Verb::Trace(trace) => trace.run(),
            Verb::New(new) => new.run(),
            Verb::Schema(schema) => schema.run(),
            Verb::Completions(completions) => completions.run(),
            Verb::Man(man) => man.run(),
        };
        done.map_err(as_typed)
    }
}

/// A message of the library about an option as it is typed: `segments = 2: ...` is
/// about `--segments 2`.
fn as_typed(refusal: Refusal) -> Refusal {
    const OPTIONS: [&str; 7] = [
        "cell-seconds",
        "intervals",
        "method",
        "modes",
        "seconds",
        "segments",
        "step",
    ];
    let text = refusal.to_string();
    if let Some(text) = text.strip_suffix("raise the limit on memory") {
        return format!("{text}raise the limit with --memory").into();
    }
    match text.split_once(' ') {
        Some((option, rest)) if OPTIONS.contains(&option) => {
            format!("--{option} {}", rest.trim_start_matches("= ")).into()
        }
        _ => refusal,
    }
}

/// The program: does what the process was asked for, and returns its exit status.
pub fn main() -> ExitCode {
    main_with(env::args_os().collect()).into()
}

/// The same with these arguments, the first of which is the program's name: returns the
/// exit status.
pub fn main_with(arguments: Vec<OsString>) -> u8 {
    // Also of a request that cannot be understood.
    let json = arguments.iter().any(|argument| argument == "--json");
    JSON.store(json, Ordering::Relaxed);
    let command_line = match Cli::try_parse_from(arguments) {
        Ok(command_line) => command_line,
        Err(error) if error.use_stderr() => {
            let message = error.render().to_string() + offer(&error);
            let message = message.trim_start_matches("error: ").trim_end();
            return fail(message, Status::Refused, json) as u8;
        }
        // Help, or the version.
        Err(told) => told.exit(),
    };
    let interrupted = stop_at_once_on_interrupt();
    let status = interrupted.and_then(|()| command_line.run());
    status.unwrap_or_else(|refusal| fail(&refusal.to_string(), Status::Refused, json)) as u8
}

/// Whether standard output is for JSON.
static JSON: AtomicBool = AtomicBool::new(false);

/// Says why something was not done: to people, and as JSON if that is still to come.
fn fail(error: &str, status: Status, json: bool) -> Status {
    note(&format!("error: {error}"));
    if json {
        show_refused(error, status as i32);
    }
    status
}

fn show_refused(error: &str, exit_status: i32) {
    let mut bytes = Vec::new();
    let refused = Refused {
        exit_status,
        ..Refused::new(error)
    };
    if json::write(&refused, &mut bytes).is_ok() {
        // There is nobody left to tell.
        let _ = show(&bytes);
    }
}

/// Where a scenario can be had, if none is named.
fn offer(error: &clap::Error) -> &'static str {
    let missing = error.kind() == clap::error::ErrorKind::MissingRequiredArgument;
    match missing && error.to_string().contains("<SCENARIO>") {
        false => "",
        true => {
            "\nA scenario says what the leaf is made of. To begin with one of your own:\n  \
             leafdyn new leaf        writes leaf.toml; leafdyn new --help: what else there is\n  \
             leafdyn relax leaf.toml"
        }
    }
}

/// Why something was not done: a message that says what to change.
type Refusal = Box<dyn Error + Send + Sync>;

/// What the process tells its caller.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Status {
    /// At rest within the tolerance; of a check: both methods agree; of a
    /// simulation: followed to its end; of a chart: its reference is confirmed.
    Success = 0,
    /// The run ended otherwise: not at rest within the tolerance; of a check:
    /// the methods differ or could not be compared; of a simulation: it ended
    /// early; of a chart: its reference is not confirmed. What was found is
    /// written all the same.
    Failure = 1,
    /// The request was refused, or its result could not be written.
    Refused = 2,
}

impl Status {
    fn of(success: bool) -> Self {
        match success {
            true => Status::Success,
            false => Status::Failure,
        }
    }
}

/// Status of a run ended by Ctrl-C: 128 and the number of the signal.
const INTERRUPTED: i32 = 130;

/// What writes a checkpoint of a simulation when the process is stopped, if there is one.
static CHECKPOINTER: Mutex<Option<Checkpointer>> = Mutex::new(None);

/// Lets Ctrl-C end the process at once, with no file half written, and a
/// simulation kept.
fn stop_at_once_on_interrupt() -> Result<(), Refusal> {
    ctrlc::set_handler(|| {
        let kept = checkpointer()
            .as_ref()
            .and_then(Checkpointer::write_and_stop);
        files::abandon_unfinished();
        if io::stderr().is_terminal() {
            // The progress line may be there.
            let _ = write!(io::stderr(), "\r\x1b[2K");
        }
        let status = match kept.map(|kept| show_checkpoint(&kept)) {
            Some(Status::Refused) => Status::Refused as i32,
            _ => INTERRUPTED,
        };
        if JSON.load(Ordering::Relaxed) {
            show_refused("stopped by Ctrl-C", status);
        }
        process::exit(status);
    })?;
    Ok(())
}

/// Lets Ctrl-C write a checkpoint, from now on.
fn checkpoint_on_interrupt(checkpointer: Checkpointer) {
    *self::checkpointer() = Some(checkpointer);
}

fn checkpointer() -> MutexGuard<'static, Option<Checkpointer>> {
    // It is replaced as a whole: whatever its last user did, it is sound.
    CHECKPOINTER.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Says where a simulation that was kept can go on, or why it cannot.
fn show_checkpoint(kept: &Result<f64, FileError>) -> Status {
    match kept {
        Ok(time) => {
            let time = crate::report::numbers::brief(*time);
            note(&format!("stopped at t = {time}; go on with --resume"));
            Status::Success
        }
        Err(error) => {
            note(&format!("error: {error}"));
            Status::Refused
        }
    }
}

/// A line on standard error; if nobody can read it, nothing is lost.
fn note(line: &str) {
    let _ = writeln!(io::stderr(), "{}", printable(line));
}

/// A report on standard output.
fn show_report(report: &str) -> Result<(), Refusal> {
    show(printable(report).as_bytes())
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
