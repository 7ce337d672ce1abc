//! How a run ends: its exit status, why it was refused, signals that stop it, and what is written to
//! standard output and standard error.

use crate::report::RefusalDocument;
use crate::{files, report};
use leafdyn::memory::TooMuch;
use leafdyn::relax::{Limit, RefusedOption, UnmodelledFeature};
use leafdyn::scenario::{ScenarioError, printable};
use std::error::Error;
use std::io::{IsTerminal, Write};
use std::iter::successors;
use std::sync::atomic::{AtomicBool, AtomicI32, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;
use std::{io, process, thread};

/// The first error of this kind among the causes of a refusal, itself included.
pub fn find_cause<E: Error + 'static>(refusal: &Refusal) -> Option<&E> {
    let first: &(dyn Error + 'static) = &**refusal;
    let mut causes = successors(Some(first), |&error| error.source());
    causes.find_map(|error| error.downcast_ref())
}

/// A refusal with what it is about as the user types it: options, overrides, and the limit on
/// memory.
pub fn refusal_with_option_names(refusal: Refusal) -> Refusal {
    if let Some(RefusedOption {
        option,
        value,
        reason,
    }) = find_cause(&refusal)
    {
        return format!("--{} {value}: {reason}", option.replace('_', "-")).into();
    }
    if let Some(error) = find_cause::<ScenarioError>(&refusal) {
        return error.message_with_option("--set").into();
    }
    if let Some(wind @ UnmodelledFeature::Wind { what }) = find_cause(&refusal) {
        let with_options = format!(
            "[wind]: {what} does not take wind into account: simulate does, and relax, trace, check and fit in a steady one; leave it out"
        );
        let message = refusal.to_string();
        return message.replace(&wind.to_string(), &with_options).into();
    }
    match find_cause::<TooMuch>(&refusal) {
        Some(too_much) => format!("{too_much}, or raise the limit with --memory").into(),
        None => refusal,
    }
}

/// Whether standard output is JSON.
static IS_JSON_OUTPUT: AtomicBool = AtomicBool::new(false);

/// Notes whether standard output is JSON, of which half is of no use.
pub fn note_json_output(json: bool) {
    IS_JSON_OUTPUT.store(json, Ordering::Relaxed);
}

/// Reports an error on standard error and, with `json`, as JSON on standard output.
pub fn report_refusal(error: &str, json: bool) -> ExitStatus {
    print_note(&format!("error: {error}"));
    if json {
        print_refusal_json(error, ExitStatus::Refused as i32);
    }
    ExitStatus::Refused
}

pub fn print_refusal_json(error: &str, exit_status: i32) {
    let mut bytes = Vec::new();
    if report::write_json(&RefusalDocument::new(error, exit_status), &mut bytes).is_ok() {
        // A failure to report the error cannot be reported.
        let _ = write_standard_output(&bytes);
    }
}

/// Why a request was refused or failed: a message that says what to change.
pub type Refusal = Box<dyn Error + Send + Sync>;

/// Exit status of the process.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[repr(i32)]
pub enum ExitStatus {
    /// At rest within the tolerance; of a check: both methods agree; of a
    /// simulation: followed to its end; of a chart: its reference is confirmed.
    Success = 0,
    /// The run ended otherwise: not at rest within the tolerance; of a check:
    /// the methods differ or could not be compared; of a simulation: it ended
    /// early; of a chart: its reference is not confirmed. The results are written
    /// in any case.
    Failure = 1,
    /// The request was refused, or its result could not be written.
    Refused = 2,
    /// Ctrl-C ended the run, or another signal. What was found until then is written, if it is of
    /// use.
    Interrupted = 128 + SIGINT,
}

impl ExitStatus {
    pub fn from_success(success: bool) -> Self {
        match success {
            true => ExitStatus::Success,
            false => ExitStatus::Failure,
        }
    }

    /// The status of a table one of whose leaves has this status.
    pub fn of_leaf(status: i32) -> Self {
        match status {
            0 => ExitStatus::Success,
            1 => ExitStatus::Failure,
            _ => ExitStatus::Refused,
        }
    }

    /// The number that the process ends with: of a signal 128 and its number.
    pub fn exit_code(self) -> i32 {
        match self {
            ExitStatus::Interrupted => 128 + FIRST_SIGNAL.load(Ordering::Relaxed),
            _ => self as i32,
        }
    }

    /// The status of a run that ended with this refusal.
    pub fn from_refusal(refusal: &Refusal) -> Self {
        match find_cause::<InterruptedRun>(refusal) {
            Some(_) => ExitStatus::Interrupted,
            None => ExitStatus::Refused,
        }
    }
}

/// A signal ended a run that has found nothing of use.
#[derive(Debug, thiserror::Error)]
#[error("{}: {}", signal_phrase(), .0)]
pub struct InterruptedRun(pub &'static str);

/// The signals that end a run: a closed terminal, Ctrl-C, and a request to end.
#[cfg(unix)]
const SIGHUP: i32 = 1;

const SIGINT: i32 = 2;

#[cfg(unix)]
const SIGTERM: i32 = 15;

/// The first signal that asked the process to end.
static FIRST_SIGNAL: AtomicI32 = AtomicI32::new(SIGINT);

/// What is told of a run that a signal ended.
pub fn signal_phrase() -> &'static str {
    match FIRST_SIGNAL.load(Ordering::Relaxed) {
        #[cfg(unix)]
        SIGHUP => "stopped by SIGHUP",
        #[cfg(unix)]
        SIGTERM => "stopped by SIGTERM",
        _ => "stopped by Ctrl-C",
    }
}

/// Time after a signal in which a run ends by itself, with what it has found.
const GRACE_AFTER_SIGNAL: Duration = Duration::from_secs(10);

/// A run that ends with what it has found, once this is `true`; without one the process ends at
/// once.
static CANCEL: Mutex<Option<Arc<AtomicBool>>> = Mutex::new(None);

/// Makes Ctrl-C and other signals that ask the process to end do so at once, without half-written
/// files; or, where a part of a result is of use, with that.
#[cfg(unix)]
pub fn stop_at_once_on_interrupt() -> Result<(), Refusal> {
    let hangup = (!ignores_hangup()).then_some(SIGHUP);
    let signals = [SIGINT, SIGTERM].into_iter().chain(hangup);
    let mut signals = signal_hook::iterator::Signals::new(signals)?;
    thread::spawn(move || signals.forever().for_each(handle_signal));
    Ok(())
}

/// Makes Ctrl-C end the process at once, without half-written files; or, where a part of a result
/// is of use, with that.
#[cfg(windows)]
pub fn stop_at_once_on_interrupt() -> Result<(), Refusal> {
    ctrlc::set_handler(|| handle_signal(SIGINT))?;
    Ok(())
}

/// Whether whoever started the process made it survive the end of its terminal, as `nohup` does; where
/// that cannot be told, a hangup ends the process as if it were not handled.
#[cfg(unix)]
fn ignores_hangup() -> bool {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let ignored = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    let ignored = ignored.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok());
    ignored.is_none_or(|mask| mask & (1 << (SIGHUP - 1)) != 0)
}

/// Ends the process after a signal: at once, or with what it has found.
fn handle_signal(signal: i32) {
    if let Some(cancel) = lock_cancel_flag().as_ref()
        && !cancel.load(Ordering::Relaxed)
    {
        FIRST_SIGNAL.store(signal, Ordering::Relaxed);
        cancel.store(true, Ordering::Relaxed);
        clear_progress_line();
        print_note("stopping with what was found so far; Ctrl-C again: at once, without it");
        thread::spawn(|| {
            thread::sleep(GRACE_AFTER_SIGNAL);
            exit_after_signal();
        });
        return;
    }
    FIRST_SIGNAL.store(signal, Ordering::Relaxed);
    exit_after_signal();
}

/// Ends the process after a signal.
fn exit_after_signal() -> ! {
    files::remove_unfinished_files();
    clear_progress_line();
    let stopped = signal_phrase();
    print_note(&format!(
        "{stopped}: nothing of an unfinished result is kept"
    ));
    let status = ExitStatus::Interrupted.exit_code();
    if IS_JSON_OUTPUT.load(Ordering::Relaxed) {
        print_refusal_json(stopped, status);
    }
    process::exit(status);
}

fn clear_progress_line() {
    if io::stderr().is_terminal() {
        let _ = write!(io::stderr(), "\r\x1b[2K");
    }
}

/// The limit of a run that ends with what it has found when the process is stopped.
pub fn limit_until_interrupt() -> Limit {
    let cancel = Arc::new(AtomicBool::new(false));
    *lock_cancel_flag() = Some(cancel.clone());
    Limit {
        cancel: Some(cancel),
        ..Limit::default()
    }
}

/// The run that a signal cancels, if one does.
fn lock_cancel_flag() -> MutexGuard<'static, Option<Arc<AtomicBool>>> {
    // It is only replaced as a whole, so it is valid even if the lock is poisoned.
    CANCEL.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Prints a line to standard error; failures are ignored.
pub fn print_note(line: &str) {
    let _ = writeln!(io::stderr(), "{}", printable(line));
}

/// Prints a report to standard output.
pub fn show_report(report: &str) -> Result<(), Refusal> {
    write_standard_output(printable(report).as_bytes())
}

/// Writes to standard output. Whoever reads a report may close it when he has seen enough
/// (`| head`); of JSON half is of no use.
pub fn write_standard_output(bytes: &[u8]) -> Result<(), Refusal> {
    let mut stdout = io::stdout().lock();
    match stdout.write_all(bytes).and_then(|()| stdout.flush()) {
        Err(error)
            if error.kind() == io::ErrorKind::BrokenPipe
                && !IS_JSON_OUTPUT.load(Ordering::Relaxed) =>
        {
            Ok(())
        }
        Err(error) => Err(format!("cannot write to standard output: {error}").into()),
        Ok(()) => Ok(()),
    }
}
