//! Fair timing: all settings take turns, so that a varying load of the machine affects
//! them equally.

use serde::{Serialize, Serializer};

use super::plan::Contender;
use super::run::Runs;

/// Runs that take longer, in seconds, are slow: they are not repeated.
const SLOW: f64 = 1.0;

/// Shorter runs, in seconds, follow one that is not measured: those of the others have
/// displaced their code and data from the processor's caches.
const SHORT: f64 = 0.01;

/// Least and largest number of runs of the others.
const FEWEST: usize = 3;
const MOST: usize = 101;

/// Progress of the measurement.
#[derive(Clone, Copy, Debug)]
pub struct Turn {
    /// Veins of the leaf that is run next.
    pub rods: usize,
    /// The contender.
    pub contender: Contender,
    /// Its setting.
    pub knob: super::Setting,
    /// Present round.
    pub round: usize,
    /// Number of rounds, as far as known.
    pub rounds: usize,
}

/// The spread of repeated measurements, in seconds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Spread {
    /// Median.
    #[serde(rename = "seconds")]
    pub median: f64,
    /// Shortest.
    #[serde(rename = "seconds_min")]
    pub min: f64,
    /// First quartile.
    #[serde(rename = "seconds_q1")]
    pub q1: f64,
    /// Third quartile.
    #[serde(rename = "seconds_q3")]
    pub q3: f64,
    /// Number of measurements.
    pub runs: usize,
}

impl Spread {
    /// Of measurements in ascending order; `None` without any.
    pub fn of(sorted: &[f64]) -> Option<Self> {
        let last = sorted.len().checked_sub(1)?;
        let at = |part: f64| {
            let position = part * last as f64;
            let below = position.floor() as usize;
            let above = (below + 1).min(last);
            let rest = position - below as f64;
            (1.0 - rest) * sorted[below] + rest * sorted[above]
        };
        Some(Spread {
            min: sorted[0],
            q1: at(0.25),
            median: at(0.5),
            q3: at(0.75),
            runs: sorted.len(),
        })
    }
}

/// The same keys without a measurement: all null, and no run.
pub fn serialize_spread<S: Serializer>(
    spread: &Option<Spread>,
    serializer: S,
) -> Result<S::Ok, S::Error> {
    #[derive(Default, Serialize)]
    struct Nothing {
        seconds: (),
        seconds_min: (),
        seconds_q1: (),
        seconds_q3: (),
        runs: usize,
    }
    match spread {
        Some(spread) => spread.serialize(serializer),
        None => Nothing::default().serialize(serializer),
    }
}

/// Runs all settings once, in order, and those that are not slow [`FEWEST`] times;
/// then repeatedly for about `budget` seconds in all, each for about the same time.
/// Settings of one contender are ordered by cost: if one takes longer than
/// the budget (or [`SLOW`]), those after it are not run. Returns the number of rounds.
pub fn measure(all: &mut [Runs], budget: f64, progress: &mut (dyn FnMut(&Turn) + Send)) -> usize {
    let mut run = |runs: &Runs, round: usize, rounds: usize| {
        progress(&Turn {
            rods: runs.scenario.rods.len(),
            contender: runs.contender,
            knob: runs.knob,
            round,
            rounds,
        });
        runs.once()
    };
    let longest = budget.max(SLOW);
    let mut too_slow = Vec::new();
    for runs in all.iter_mut() {
        if too_slow.contains(&runs.contender) {
            continue;
        }
        runs.found = Some(run(runs, 1, FEWEST).map(|(answer, time)| {
            runs.seconds.push(time);
            if time > longest {
                too_slow.push(runs.contender);
            }
            answer
        }));
    }
    let mut run_again = |runs: &mut Runs, round: usize, rounds: usize| {
        if runs.seconds[0] < SHORT {
            let _ = run(runs, round, rounds);
        }
        // It succeeded before, and does so again.
        if let Ok((_, time)) = run(runs, round, rounds) {
            runs.seconds.push(time);
        }
    };
    let is_fast = |runs: &Runs| runs.seconds.first().is_some_and(|&time| time < SLOW);
    for round in 1..FEWEST {
        for runs in all.iter_mut().filter(|runs| is_fast(runs)) {
            run_again(runs, round + 1, FEWEST);
        }
    }
    let share = budget / all.iter().filter(|runs| is_fast(runs)).count().max(1) as f64;
    let repeats: Vec<usize> = (all.iter())
        .map(|runs| repeats(&runs.seconds, share))
        .collect();
    let rest = repeats.iter().copied().max().unwrap_or(0);
    for round in 0..rest {
        for (runs, repeats) in all.iter_mut().zip(&repeats) {
            if runs_in(round, *repeats, rest) {
                run_again(runs, FEWEST + round + 1, FEWEST + rest);
            }
        }
    }
    for runs in all {
        runs.seconds.sort_by(f64::total_cmp);
    }
    FEWEST + rest
}

/// Number of further runs after the first few, within a `share` of the time: none for a slow
/// one. The first run may be disturbed; the fastest one is used.
fn repeats(seconds: &[f64], share: f64) -> usize {
    let shortest = seconds.iter().copied().reduce(f64::min);
    match shortest {
        Some(time) if seconds.len() >= FEWEST => {
            let all = if time < SHORT { 2.0 * time } else { time };
            ((share / all) as usize).clamp(FEWEST, MOST) - FEWEST
        }
        _ => 0,
    }
}

/// Whether a setting with so many `repeats` runs in this round: they are spread evenly over all
/// `rounds`.
fn runs_in(round: usize, repeats: usize, rounds: usize) -> bool {
    (round + 1) * repeats / rounds > round * repeats / rounds
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn repeats_are_as_many_as_wanted_and_spread() {
        for repeats in [0, 1, 2, 7, 100] {
            let rounds: Vec<usize> = (0..100).filter(|&r| runs_in(r, repeats, 100)).collect();
            assert_eq!(rounds.len(), repeats);
            let gaps = rounds.windows(2).map(|pair| pair[1] - pair[0]);
            assert!(gaps.max().unwrap_or(0) <= 100_usize.div_ceil(repeats.max(1)));
        }
    }

    #[test]
    fn fast_runs_are_repeated_often_and_slow_ones_not() {
        assert_eq!(repeats(&[1e-6; 3], 0.1), MOST - FEWEST);
        assert_eq!(repeats(&[0.3, 0.01, 0.02], 0.1), 10 - FEWEST);
        assert_eq!(repeats(&[2.0], 0.1), 0);
    }

    #[test]
    fn quartiles() {
        let spread = Spread::of(&[1.0, 2.0, 3.0, 4.0, 10.0]).unwrap();
        let found = [spread.min, spread.q1, spread.median, spread.q3];
        assert_eq!(found, [1.0, 2.0, 3.0, 4.0]);
        let spread = Spread::of(&[1.0, 2.0]).unwrap();
        assert_eq!((spread.q1, spread.median), (1.25, 1.5));
        assert_eq!(Spread::of(&[]), None);
    }
}
