//! What a method answers, whichever it is: an equilibrium, or why there is none.

use std::time::{Duration, Instant};

use crate::bvp::{self, Reason, Start};
use crate::leaf::{Grid, Leaf};
use crate::relax::{self, Options, Outcome, index_near};
use crate::scenario::Scenario;
use crate::shape::{Difference, RodShape};
use crate::undulation::Undulation;

use super::row::MapOutcome;

/// An equilibrium as a method found it, in the scenario's units.
#[derive(Clone, Debug)]
pub struct Answer {
    /// Fractions of the length.
    pub stations: Vec<f64>,
    /// The shape there.
    pub rods: Vec<RodShape>,
    /// Waves and twist of its veins.
    pub undulation: Undulation,
    /// Energy.
    pub energy: f64,
    /// Negative eigenvalues.
    pub index: Option<usize>,
    /// Bound on the error of the positions, in units of length.
    pub estimate: f64,
    /// What else there is to say.
    pub note: String,
}

impl Answer {
    /// Largest distance from another one at the stations that both have.
    pub fn distance(&self, other: &Answer) -> f64 {
        distance((&self.stations, &self.rods), (&other.stations, &other.rods))
    }
}

/// An answer, or why there is none.
#[derive(Clone, Debug)]
pub enum Found {
    /// At rest.
    Rest(Box<Answer>),
    /// Not: an outcome and a sentence.
    Failed(MapOutcome, String),
}

/// An answer and the seconds it took.
#[derive(Clone, Debug)]
pub struct Timed {
    /// The answer.
    pub found: Found,
    /// The time.
    pub seconds: f64,
}

/// Lets a method run, told when to give up. What takes longer than it may is
/// out of time, whatever it found.
pub fn timed(limit: Duration, run: impl FnOnce(Instant) -> Found) -> Timed {
    let clock = Instant::now();
    let found = run(clock + limit);
    let elapsed = clock.elapsed();
    Timed {
        found: match elapsed > limit {
            true => {
                let seconds = limit.as_secs_f64();
                Found::Failed(
                    MapOutcome::OutOfTime,
                    format!("no answer within {seconds} s"),
                )
            }
            false => found,
        },
        seconds: elapsed.as_secs_f64(),
    }
}

/// The longest rod.
pub fn longest(scenario: &Scenario) -> f64 {
    let lengths = scenario.rods.iter().map(|rod| rod.length);
    lengths.fold(0.0, f64::max)
}

/// A grid as that of these stations and finer, on which eigenvalues are counted.
pub fn fine_grid(scenario: &Scenario, stations: usize) -> Grid {
    /// Segments at least.
    const SEGMENTS: usize = 32;
    let leaf = Leaf::new(scenario);
    let segments = stations.max(leaf.kinks().len() + 1);
    let mut grid = Grid::new(segments, leaf.kinks());
    while grid.segments() < SEGMENTS {
        grid = grid.refined();
    }
    grid
}

/// Relaxes. On a fixed grid, which tells no error, `grid_error` does.
pub fn relaxed(scenario: &Scenario, options: &Options) -> Found {
    let leaf = match relax::relax(scenario, options, &mut |_| {}) {
        Ok(leaf) => leaf,
        Err(refused) => return Found::Failed(MapOutcome::Refused, refused.to_string()),
    };
    let remark = leaf.remark.clone().unwrap_or_default();
    let outcome = match leaf.outcome {
        Outcome::Converged | Outcome::ConvergedAfterSaddle | Outcome::Saddle => None,
        Outcome::Diverged => Some(MapOutcome::Diverged),
        Outcome::ToleranceNotReached | Outcome::NotAtRest | Outcome::Singular => {
            Some(MapOutcome::NotConverged)
        }
    };
    if let Some(outcome) = outcome {
        return Found::Failed(outcome, remark);
    }
    let estimate = match leaf.accuracy.error_estimate {
        Some(estimate) => Some(estimate),
        None => grid_error(scenario, options).map(|error| error + leaf.accuracy.tolerance),
    };
    let Some(estimate) = estimate else {
        let why = "the error of the grid cannot be told: a finer one finds no rest";
        return Found::Failed(MapOutcome::NotConverged, why.into());
    };
    Found::Rest(Box::new(Answer {
        undulation: leaf.undulation,
        stations: leaf.shape.stations,
        rods: leaf.shape.rods,
        energy: leaf.energy.unwrap_or(f64::NAN),
        index: leaf.stability.negative_eigenvalues,
        estimate,
        note: match leaf.stability.saddle {
            Some(saddle) => format!("left a saddle of index {}", saddle.negative_eigenvalues),
            None => remark,
        },
    }))
}

/// Two leaves this far apart, in lengths, are not two grids' versions of one.
pub const SAME_PLACE: f64 = 0.05;

/// Bound on the error of a fixed grid, in units of length: from the distance to
/// the leaf on a grid twice as fine, which is three quarters of it where the
/// grids are fine enough for their series.
pub fn grid_error(scenario: &Scenario, options: &Options) -> Option<f64> {
    const SAFETY: f64 = 2.0;
    let segments = options.method.segments()?;
    let on = |segments: usize| {
        let options = Options {
            method: relax::Method::default().on_grid(Some(segments)),
            ..options.clone()
        };
        let leaf = relax::relax(scenario, &options, &mut |_| {}).ok()?;
        leaf.outcome.is_success().then_some(leaf)
    };
    let (coarse, fine) = (on(segments)?, on(2 * segments)?);
    let apart = distance(
        (&coarse.shape.stations, &coarse.shape.rods),
        (&fine.shape.stations, &fine.shape.rods),
    );
    Some((SAFETY * apart).min(SAME_PLACE * longest(scenario)))
}

/// How a boundary-value problem is to be solved.
pub struct Shooting<'a> {
    /// The leaf.
    pub scenario: &'a Scenario,
    /// Relative to the longest rod.
    pub accuracy: f64,
    /// `None`: as many as it needs.
    pub intervals: Option<usize>,
    /// Where the solution is wanted: the nodes of this grid,
    pub grid: &'a Grid,
    /// and these, ascending from 0 to 1.
    pub more: &'a [f64],
    /// When to give up.
    pub deadline: Instant,
}

impl Shooting<'_> {
    /// Solves.
    pub fn from(&self, start: Start) -> Found {
        let stations = union(self.grid.sigma(), self.more);
        let solved = bvp::solve_before(
            self.scenario,
            start,
            self.accuracy,
            self.intervals,
            &stations,
            Some(self.deadline),
        );
        let solution = match solved {
            Ok(solution) => solution,
            Err(failure) => {
                let outcome = match failure.reason {
                    Reason::Unbounded { .. } => MapOutcome::Diverged,
                    _ => MapOutcome::NotConverged,
                };
                let way = match failure.part {
                    part if part < 1.0 => format!(" (at {part:.4} of the way from arcs)"),
                    _ => String::new(),
                };
                return Found::Failed(outcome, format!("{}{way}", failure.reason));
            }
        };
        if solution.error.position > self.accuracy * longest(self.scenario) {
            let known = format!(
                "the solution is only known within {:.1e}",
                solution.error.position
            );
            return Found::Failed(MapOutcome::NotConverged, known);
        }
        let rods = picked(&stations, &solution.rods, self.grid.sigma());
        let intervals = match solution.intervals.len() - 1 {
            1 => "1 interval".into(),
            count => format!("{count} intervals"),
        };
        let neutral = solution.neutral.map(|neutral| format!("; {neutral}"));
        let error = Some(solution.error.position);
        let undulation = Undulation::at_stations(self.scenario, &stations, &solution.rods, error);
        Found::Rest(Box::new(Answer {
            undulation,
            index: index_near(self.scenario, self.grid.clone(), &rods),
            rods: solution.rods,
            stations,
            energy: solution.energy,
            estimate: solution.error.position,
            note: format!(
                "over {intervals}, growth 10^{:.1}{}",
                solution.growth,
                neutral.unwrap_or_default()
            ),
        }))
    }
}

/// Stations closer than this are one.
const SAME_STATION: f64 = 1e-9;

fn same(a: f64, b: f64) -> bool {
    (a - b).abs() < SAME_STATION
}

/// All stations of both, ascending.
fn union(a: &[f64], b: &[f64]) -> Vec<f64> {
    let mut all: Vec<f64> = a.to_vec();
    all.extend(b.iter().filter(|&&b| !a.iter().any(|&a| same(a, b))));
    all.sort_by(f64::total_cmp);
    all
}

/// The shape at some of its stations.
fn picked(stations: &[f64], rods: &[RodShape], wanted: &[f64]) -> Vec<RodShape> {
    let kept = |sigma: f64| wanted.iter().any(|&wanted| same(wanted, sigma));
    rods.iter()
        .map(|rod| RodShape {
            length: rod.length,
            nodes: (stations.iter().zip(&rod.nodes))
                .filter(|(sigma, _)| kept(**sigma))
                .map(|(_, node)| *node)
                .collect(),
        })
        .collect()
}

type Shape<'a> = (&'a [f64], &'a [RodShape]);

/// Largest distance of positions at common stations; the base and the tip are.
pub fn distance((a, a_rods): Shape, (b, b_rods): Shape) -> f64 {
    let (mut i, mut k) = (0, 0);
    let mut largest = Difference::default();
    while i < a.len() && k < b.len() {
        if same(a[i], b[k]) {
            for (one, other) in a_rods.iter().zip(b_rods) {
                largest = largest.max(Difference::of(&one.nodes[i], &other.nodes[k]));
            }
            (i, k) = (i + 1, k + 1);
        } else if a[i] < b[k] {
            i += 1;
        } else {
            k += 1;
        }
    }
    largest.position
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stations_are_joined_and_picked() {
        let all = union(&[0.0, 0.5, 1.0], &[0.0, 0.25, 0.5 + 1e-15, 1.0]);
        assert_eq!(all, [0.0, 0.25, 0.5, 1.0]);
        let node = |x: f64| crate::shape::NodeState {
            position: glam::DVec3::X * x,
            rotation: glam::DQuat::IDENTITY,
            v: glam::DVec3::X,
            u: glam::DVec3::ZERO,
            n: glam::DVec3::ZERO,
            m: glam::DVec3::ZERO,
        };
        let rod = |stations: &[f64], shift: f64| {
            vec![RodShape {
                length: 1.0,
                nodes: stations.iter().map(|x| node(x + shift)).collect(),
            }]
        };
        let shape = rod(&all, 0.0);
        let some = picked(&all, &shape, &[0.0, 0.5, 1.0]);
        assert_eq!(some[0].nodes.len(), 3);
        let thirds = [0.0, 1.0 / 3.0, 2.0 / 3.0, 1.0];
        let apart = distance((&all, &shape), (&thirds, &rod(&thirds, 0.25)));
        assert_eq!(apart, 0.25);
    }
}
