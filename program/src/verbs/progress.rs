//! A progress line on standard error for long runs; off a terminal, where a line cannot be replaced, notes that
//! become rarer.

use crate::verbs::exit::print_note;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use leafdyn::relax::{CorrectionProgress, Progress};
use std::io;
use std::io::IsTerminal;
use std::time::{Duration, Instant};

/// Runs that take less time show no progress line, which would only flicker.
const LONG_RUN: Duration = Duration::from_millis(500);

/// Off a terminal a first note is printed after this time, and others whenever it has doubled.
const FIRST_NOTE: Duration = Duration::from_secs(10);

/// Most redraws of the line per second.
const REDRAWS_PER_SECOND: u8 = 10;

/// No estimate is made from a smaller fraction.
const LEAST_FRACTION_FOR_ESTIMATE: f64 = 1e-3;

/// The progress line; it vanishes when dropped.
pub struct ProgressLine {
    scenario: String,
    start: Instant,
    shown: bool,
    on_terminal: bool,
    next_note: Duration,
    bar: Option<ProgressBar>,
    grids: GridProgress,
    shooting: Option<ShootingProgress>,
    /// When the current phase of the run began.
    phase_start: Duration,
}

impl ProgressLine {
    pub fn new(scenario: &str, shown: bool) -> Self {
        ProgressLine {
            scenario: scenario.into(),
            start: Instant::now(),
            shown,
            on_terminal: io::stderr().is_terminal(),
            next_note: FIRST_NOTE,
            bar: None,
            grids: GridProgress::default(),
            shooting: None,
            phase_start: Duration::ZERO,
        }
    }

    /// Shows the progress of a solver that runs to this tolerance. Steps are counted over all grids.
    pub fn update_solver(&mut self, progress: &Progress, tolerance: f64) {
        let fraction = match progress {
            &Progress::Relaxing {
                grid,
                step,
                residual,
            } => self
                .grids
                .completed_fraction(grid, step, residual, tolerance),
            Progress::Shooting(now) => {
                if self.shooting.is_none() {
                    self.next_phase();
                }
                self.shooting
                    .get_or_insert_default()
                    .completed_fraction(now)
            }
        };
        let steps = self.grids.steps();
        self.update(fraction, || match *progress {
            Progress::Relaxing { grid, residual, .. } => {
                format!("{steps} steps, now {grid} segments a vein, residual {residual:.1e}")
            }
            Progress::Shooting(_) => progress.to_string(),
        });
    }

    /// Shows a message with the elapsed time and, if the completed fraction of the phase is
    /// known, the remaining time.
    pub fn update(&mut self, fraction: Option<f64>, message: impl FnOnce() -> String) {
        let elapsed = self.start.elapsed();
        let first = if self.on_terminal {
            LONG_RUN
        } else {
            self.next_note
        };
        if !self.shown || elapsed < first {
            return;
        }
        let left = remaining_time_text(elapsed.saturating_sub(self.phase_start), fraction);
        let message = format!("{}, {:.0} s{left}", message(), elapsed.as_secs_f64());
        if !self.on_terminal {
            self.next_note = 2 * elapsed;
            print_note(&format!("{}: {message}", self.scenario));
            return;
        }
        let bar = self.bar.get_or_insert_with(|| {
            let target = ProgressDrawTarget::stderr_with_hz(REDRAWS_PER_SECOND);
            let style = ProgressStyle::with_template("{prefix}: {wide_msg}");
            ProgressBar::with_draw_target(None, target)
                .with_style(style.unwrap_or_else(|_| ProgressStyle::default_spinner()))
                .with_prefix(self.scenario.clone())
        });
        bar.set_message(message);
    }

    /// Begins another phase: fractions refer to it from now on.
    pub fn next_phase(&mut self) {
        self.phase_start = self.start.elapsed();
    }
}

/// An estimate of the remaining time, to follow the elapsed time; empty if unknown.
fn remaining_time_text(elapsed: Duration, fraction: Option<f64>) -> String {
    let known = fraction.filter(|fraction| (LEAST_FRACTION_FOR_ESTIMATE..=1.0).contains(fraction));
    let left = |fraction: f64| format_duration(elapsed.as_secs_f64() * (1.0 / fraction - 1.0));
    known.map_or(String::new(), |fraction| {
        format!(", {} left", left(fraction))
    })
}

/// The completed fraction of `all` equal parts.
pub fn completed_fraction(done: usize, all: usize) -> Option<f64> {
    Some(done as f64 / all.max(1) as f64)
}

/// Where a number is between two others, from 0 to 1, linearly or by logarithms.
pub fn range_fraction(from: f64, at: f64, to: f64, log: bool) -> Option<f64> {
    let place = |value: f64| if log { value.abs().ln() } else { value };
    let fraction = (place(at) - place(from)) / (place(to) - place(from));
    fraction.is_finite().then_some(fraction)
}

/// The grids of a relaxation, each twice as fine as the one before.
#[derive(Default)]
struct GridProgress {
    /// The grids so far, the current one last.
    segments_so_far: Vec<usize>,
    /// Steps on the grids before the current one.
    steps_before: usize,
    /// The step on the current grid, from 0.
    step: usize,
    /// The largest fraction of the work that was told.
    farthest: f64,
}

impl GridProgress {
    /// The steps on all grids so far.
    fn steps(&self) -> usize {
        self.steps_before + self.step + 1
    }

    /// Estimates the completed fraction of the work: the first grid, on which the leaf
    /// moves, counts as six Newton steps there, every other grid as two. Every grid reduces
    /// the error by about three digits. The fraction never falls: where more grids are needed than
    /// was thought, it is unknown until it is larger than what was told.
    fn completed_fraction(
        &mut self,
        grid: usize,
        step: usize,
        residual: f64,
        tolerance: f64,
    ) -> Option<f64> {
        const FIRST_GRID_WORK: f64 = 6.0;
        const LATER_GRID_WORK: f64 = 2.0;
        const DIGITS: f64 = 3.0;
        /// Digits by which the residual falls until the leaf is at rest.
        const REST_DIGITS: f64 = 12.0;
        let other = self
            .segments_so_far
            .last()
            .is_some_and(|last| *last != grid);
        if other || step < self.step {
            self.steps_before += self.step + 1;
        }
        if other || self.segments_so_far.is_empty() {
            self.segments_so_far.push(grid);
        }
        self.step = step;
        let current = self.segments_so_far.len() - 1;
        let wanted = (-tolerance.log10() / DIGITS).ceil().clamp(0.0, 16.0) as usize;
        let last = current.max(wanted);
        let size = |grid: usize| (1_u64 << grid.min(32)) as f64;
        let work = |grid: usize| {
            if grid == 0 {
                FIRST_GRID_WORK
            } else {
                LATER_GRID_WORK * size(grid)
            }
        };
        let here = match current {
            0 => (-residual.log10() / REST_DIGITS).clamp(0.0, 1.0),
            _ => (step as f64 / LATER_GRID_WORK).min(1.0),
        };
        let before: f64 = (0..current).map(work).sum();
        let all: f64 = (0..=last).map(work).sum();
        let fraction = (before + here * work(current)) / all;
        let known = fraction >= self.farthest;
        self.farthest = fraction.max(self.farthest);
        known.then_some(fraction)
    }
}

/// Fraction of the remaining work that a linearisation takes.
const LINEARIZATION_WORK_FRACTION: f64 = 0.9;

/// The corrections of a shooting method.
#[derive(Default)]
struct ShootingProgress {
    /// Size of the first correction of the final problem.
    first: Option<f64>,
}

impl ShootingProgress {
    /// Estimates the completed fraction of the work: that of the continuation or, after it,
    /// of the wanted digits and the linearisation for the next ones.
    fn completed_fraction(&mut self, now: &CorrectionProgress) -> Option<f64> {
        if now.lambda < 1.0 {
            return Some(now.lambda);
        }
        let digits = match now.size.is_finite() {
            true => {
                let first = *self.first.get_or_insert(now.size);
                range_fraction(first, now.size, now.convergence_size, true)?.clamp(0.0, 1.0)
            }
            false => 0.0,
        };
        Some(digits + (1.0 - digits) * LINEARIZATION_WORK_FRACTION * now.linearized)
    }
}

/// Formats a duration for people.
pub fn format_duration(seconds: f64) -> String {
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

#[cfg(test)]
mod tests {
    use super::*;

    fn after_10_s(fraction: Option<f64>) -> String {
        remaining_time_text(Duration::from_secs(10), fraction)
    }

    #[test]
    fn the_remaining_time_is_shown_where_it_is_known() {
        assert_eq!(after_10_s(Some(0.25)), ", 30 s left");
        assert_eq!(after_10_s(Some(1.0)), ", 0 s left");
        assert_eq!(after_10_s(Some(0.001)), ", 3 h left");
        for unknown in [None, Some(0.0), Some(-0.1), Some(1.5), Some(f64::NAN)] {
            assert_eq!(after_10_s(unknown), "");
        }
        assert_eq!(after_10_s(completed_fraction(3, 4)), ", 4 s left");
        assert_eq!(after_10_s(completed_fraction(0, 0)), "");
    }

    #[test]
    fn ranges_may_decrease_and_be_logarithmic() {
        let close = |part: Option<f64>, wanted: f64| (part.unwrap() - wanted).abs() < 1e-12;
        assert!(close(range_fraction(2.0, 1.0, -2.0, false), 0.25));
        assert!(close(range_fraction(-0.1, -1.0, -100.0, true), 1.0 / 3.0));
        assert_eq!(range_fraction(1.0, 1.0, 1.0, false), None);
    }

    #[test]
    fn a_shooting_follows_its_continuation_and_then_adds_digits() {
        let mut corrections = ShootingProgress::default();
        let mut part = |way: f64, linearized: f64, size: f64| {
            let now = CorrectionProgress {
                lambda: way,
                iteration: 0,
                linearized,
                size,
                convergence_size: 1e-10,
            };
            corrections.completed_fraction(&now).unwrap()
        };
        assert_eq!(part(0.25, 0.5, 1e-3), 0.25);
        let parts = [
            part(1.0, 0.0, f64::INFINITY),
            part(1.0, 0.5, f64::INFINITY),
            part(1.0, 1.0, 1e-2),
            part(1.0, 0.0, 1e-6),
            part(1.0, 1.0, 1e-6),
            part(1.0, 1.0, 1e-12),
        ];
        let wanted = [0.0, 0.45, 0.9, 0.5, 0.95, 1.0];
        for (part, wanted) in parts.into_iter().zip(wanted) {
            assert!((part - wanted).abs() < 1e-12, "{parts:?}");
        }
    }

    #[test]
    fn a_relaxation_goes_on_from_grid_to_grid() {
        let mut grids = GridProgress::default();
        let mut part = |grid: usize, step: usize, residual: f64| {
            grids
                .completed_fraction(grid, step, residual, 1e-6)
                .unwrap()
        };
        let parts = [
            part(8, 1, 1.0),
            part(8, 7, 1e-6),
            part(8, 9, 1e-13),
            part(16, 1, 1e-4),
            part(32, 1, 1e-6),
            part(32, 2, 1e-13),
        ];
        assert!(parts.windows(2).all(|pair| pair[0] < pair[1]), "{parts:?}");
        assert_eq!((parts[0], parts[5]), (0.0, 1.0));
        assert_eq!(grids.steps(), 10 + 2 + 3);
        // One more grid than was thought needed.
        assert_eq!(grids.completed_fraction(64, 1, 1e-6, 1e-6), None);
        assert_eq!(grids.completed_fraction(64, 3, 1e-6, 1e-6), Some(1.0));
        assert_eq!(grids.steps(), 15 + 4);
    }
}
