//! One line on standard error that says how far a long run has come.

use std::io::{self, IsTerminal};
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

use crate::relax::{Correction, Progress};

/// Shorter runs show no line: it would only flicker.
const LONG_RUN: Duration = Duration::from_millis(500);

/// Redraws of the line per second at most.
const REDRAWS_PER_SECOND: u8 = 10;

/// Of less nothing can be said.
const LEAST_PART: f64 = 1e-3;

/// The progress line; it vanishes when dropped.
pub struct ProgressLine {
    scenario: String,
    start: Instant,
    terminal: bool,
    bar: Option<ProgressBar>,
    grids: Grids,
    shooting: Option<Corrections>,
    /// Since when parts of the run are told: before that it did something else.
    since: Duration,
}

impl ProgressLine {
    pub fn new(scenario: &str) -> Self {
        let terminal = io::stderr().is_terminal();
        ProgressLine {
            scenario: scenario.into(),
            start: Instant::now(),
            terminal,
            bar: None,
            grids: Grids::default(),
            shooting: None,
            since: Duration::ZERO,
        }
    }

    /// One that is never shown.
    pub fn hidden() -> Self {
        ProgressLine {
            scenario: String::new(),
            start: Instant::now(),
            terminal: false,
            bar: None,
            grids: Grids::default(),
            shooting: None,
            since: Duration::ZERO,
        }
    }

    /// How far a run to this tolerance has come.
    pub fn solving(&mut self, progress: &Progress, tolerance: f64) {
        let part = match progress {
            &Progress::Relaxing {
                grid,
                step,
                residual,
            } => self.grids.part(grid, (step, residual), tolerance),
            Progress::Shooting(now) => {
                if self.shooting.is_none() {
                    self.next();
                }
                self.shooting.get_or_insert_default().part(now)
            }
        };
        self.tell(part, || progress.to_string());
    }

    /// Shows a message with the time taken and, where it is known which part of the
    /// run is done, the time left.
    pub fn tell(&mut self, part: Option<f64>, message: impl FnOnce() -> String) {
        let since = self.since;
        self.say(|elapsed| {
            let left = left(elapsed.saturating_sub(since), part);
            format!("{}, {:.0} s{left}", message(), elapsed.as_secs_f64())
        });
    }

    /// From now on the part that is told is that of what comes next.
    pub fn next(&mut self) {
        self.since = self.start.elapsed();
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

/// How long a run has taken, and about how long it will still take if this part of it,
/// from 0 to 1, is done.
pub fn time_left(elapsed: Duration, part: Option<f64>) -> String {
    format!("{:.0} s{}", elapsed.as_secs_f64(), left(elapsed, part))
}

/// What is to be added to the time taken: nothing where nothing is known.
fn left(elapsed: Duration, part: Option<f64>) -> String {
    let known = part.filter(|part| (LEAST_PART..=1.0).contains(part));
    let left = |part: f64| duration(elapsed.as_secs_f64() * (1.0 / part - 1.0));
    known.map_or(String::new(), |part| format!(", {} left", left(part)))
}

/// The part of so many equal ones that is done.
pub fn part_of(done: usize, all: usize) -> Option<f64> {
    Some(done as f64 / all.max(1) as f64)
}

/// The part of the way from one number to another, or of that of their logarithms.
pub fn part_of_way(from: f64, at: f64, to: f64, log: bool) -> Option<f64> {
    let place = |value: f64| if log { value.abs().ln() } else { value };
    let part = (place(at) - place(from)) / (place(to) - place(from));
    part.is_finite().then_some(part)
}

/// The grids of a relaxation, each twice as fine as the one before.
#[derive(Default)]
struct Grids {
    /// The first, and the present one.
    seen: Vec<usize>,
}

impl Grids {
    /// About which part of the work is done: that of the first grid, on which the leaf
    /// moves, as of six Newton steps there; of the others two each. Every grid removes
    /// some three digits of the error.
    fn part(&mut self, grid: usize, (step, residual): (usize, f64), tolerance: f64) -> Option<f64> {
        const FIRST: f64 = 6.0;
        const LATER: f64 = 2.0;
        const DIGITS: f64 = 3.0;
        /// Of the residual, on the way to rest.
        const REST: f64 = 12.0;
        if self.seen.last() != Some(&grid) {
            self.seen.push(grid);
        }
        let present = self.seen.len() - 1;
        let wanted = (-tolerance.log10() / DIGITS).ceil().clamp(0.0, 16.0) as usize;
        let last = present.max(wanted);
        let size = |grid: usize| (1_u64 << grid.min(32)) as f64;
        let work = |grid: usize| if grid == 0 { FIRST } else { LATER * size(grid) };
        let here = match present {
            0 => (-residual.log10() / REST).clamp(0.0, 1.0),
            _ => (step as f64 / LATER).min(1.0),
        };
        let before: f64 = (0..present).map(work).sum();
        let all: f64 = (0..=last).map(work).sum();
        Some((before + here * work(present)) / all)
    }
}

/// Part of the work left that a linearisation is.
const LINEARISATION: f64 = 0.9;

/// The corrections of a shooting.
#[derive(Default)]
struct Corrections {
    /// The size of the first near the leaf.
    first: Option<f64>,
}

impl Corrections {
    /// About which part of the work is done: of the way there, or of the digits wanted
    /// and the linearisation for the next ones.
    fn part(&mut self, now: &Correction) -> Option<f64> {
        if now.way < 1.0 {
            return Some(now.way);
        }
        let digits = match now.size.is_finite() {
            true => {
                let first = *self.first.get_or_insert(now.size);
                part_of_way(first, now.size, now.wanted, true)?.clamp(0.0, 1.0)
            }
            false => 0.0,
        };
        Some(digits + (1.0 - digits) * LINEARISATION * now.linearized)
    }
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

#[cfg(test)]
mod tests {
    use super::*;

    fn told(part: Option<f64>) -> String {
        time_left(Duration::from_secs(10), part)
    }

    #[test]
    fn the_time_left_is_told_where_it_is_known() {
        assert_eq!(told(Some(0.25)), "10 s, 30 s left");
        assert_eq!(told(Some(1.0)), "10 s, 0 s left");
        assert_eq!(told(Some(0.001)), "10 s, 3 h left");
        for unknown in [None, Some(0.0), Some(-0.1), Some(1.5), Some(f64::NAN)] {
            assert_eq!(told(unknown), "10 s");
        }
        assert_eq!(told(part_of(3, 4)), "10 s, 4 s left");
        assert_eq!(told(part_of(0, 0)), "10 s");
    }

    #[test]
    fn ways_may_fall_and_be_logarithmic() {
        let close = |part: Option<f64>, wanted: f64| (part.unwrap() - wanted).abs() < 1e-12;
        assert!(close(part_of_way(2.0, 1.0, -2.0, false), 0.25));
        assert!(close(part_of_way(-0.1, -1.0, -100.0, true), 1.0 / 3.0));
        assert_eq!(part_of_way(1.0, 1.0, 1.0, false), None);
    }

    #[test]
    fn a_shooting_goes_its_way_and_then_adds_digits() {
        let mut corrections = Corrections::default();
        let mut part = |way: f64, linearized: f64, size: f64| {
            let now = Correction {
                way,
                iteration: 0,
                linearized,
                size,
                wanted: 1e-10,
            };
            corrections.part(&now).unwrap()
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
        let mut grids = Grids::default();
        let mut part = |grid: usize, step: usize, residual: f64| {
            grids.part(grid, (step, residual), 1e-6).unwrap()
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
        // One more grid than was thought needed.
        assert!((0.3..0.9).contains(&part(64, 1, 1e-6)));
    }
}
