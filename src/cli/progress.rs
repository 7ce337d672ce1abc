//! One line on standard error that says how far a long run has come.

use std::io::{self, IsTerminal};
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

use crate::relax::Progress;

/// Shorter runs show no line: it would only flicker.
const LONG_RUN: Duration = Duration::from_millis(500);

/// Redraws of the line per second at most.
const REDRAWS_PER_SECOND: u8 = 10;

/// The progress line; it vanishes when dropped.
pub struct ProgressLine {
    scenario: String,
    start: Instant,
    terminal: bool,
    bar: Option<ProgressBar>,
}

impl ProgressLine {
    pub fn new(scenario: &str) -> Self {
        let terminal = io::stderr().is_terminal();
        ProgressLine {
            scenario: scenario.into(),
            start: Instant::now(),
            terminal,
            bar: None,
        }
    }

    /// One that is never shown.
    pub fn hidden() -> Self {
        ProgressLine {
            scenario: String::new(),
            start: Instant::now(),
            terminal: false,
            bar: None,
        }
    }

    /// How far a relaxation has come.
    pub fn update(&mut self, progress: &Progress) {
        self.say(|elapsed| {
            format!(
                "{} segments a vein, step {}, residual {:.1e}, {:.0} s",
                progress.grid,
                progress.step,
                progress.residual,
                elapsed.as_secs_f64(),
            )
        });
    }

    /// Shows a message, which is told how long the run has taken.
    pub fn say(&mut self, message: impl FnOnce(Duration) -> String) {
        let elapsed = self.start.elapsed();
        if !self.terminal || elapsed < LONG_RUN {
            return;
        }
        let bar = self.bar.get_or_insert_with(|| {
            let target = ProgressDrawTarget::stderr_with_hz(REDRAWS_PER_SECOND);
            let style = ProgressStyle::with_template("{prefix}: {wide_msg}");
            ProgressBar::with_draw_target(None, target)
                .with_style(style.unwrap_or_else(|_| ProgressStyle::default_spinner()))
                .with_prefix(self.scenario.clone())
        });
        bar.set_message(message(elapsed));
    }
}

/// How long a run has taken after `done` of `all` equal parts, and about how long it
/// will still take.
pub fn time_left(elapsed: Duration, done: usize, all: usize) -> String {
    let taken = elapsed.as_secs_f64();
    let left = taken * (all as f64 / done.max(1) as f64 - 1.0);
    format!("{taken:.0} s, {} left", duration(left))
}

/// A time for people.
pub fn duration(seconds: f64) -> String {
    let seconds = seconds.ceil();
    match seconds as u64 {
        _ if !seconds.is_finite() => "?".into(),
        seconds @ 0..120 => format!("{seconds} s"),
        seconds @ 120..7200 => format!("{} min", seconds.div_ceil(60)),
        seconds => format!("{} h", seconds.div_ceil(3600)),
    }
}

impl Drop for ProgressLine {
    fn drop(&mut self) {
        if let Some(bar) = &self.bar {
            bar.finish_and_clear();
        }
    }
}
