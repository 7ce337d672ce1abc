//! One run of one cell.

use std::time::Instant;

use glam::DVec3;

use super::plan::{Cell, Contender, Setting};
use crate::bvp::{self, Failure, Reason, Solution, Start};
use crate::relax::{self, Equilibrium, Method, Options, Outcome, RelaxError, Work};
use crate::scenario::Scenario;
use crate::shape::RodShape;

/// What a run found.
#[derive(Clone, Debug)]
pub struct Run {
    pub outcome: Outcome,
    pub remark: Option<String>,
    /// Where it knows the leaf.
    pub shape: Shape,
    /// Its own estimate of its error, relative to the longest rod.
    pub estimate: Option<f64>,
    pub work: Work,
}

impl Run {
    /// Whether the leaf is at rest, stable or not, accurate or not.
    pub fn at_rest(&self) -> bool {
        self.outcome.is_success() || self.outcome == Outcome::ToleranceNotReached
    }
}

/// Positions of all rods at stations.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Shape {
    /// Fractions of the length, ascending.
    pub stations: Vec<f64>,
    /// One list per rod.
    pub positions: Vec<Vec<DVec3>>,
}

/// Tolerance to which a leaf is relaxed that shooting starts from: the coarsest
/// grids do, and Newton's method does the rest faster than finer ones.
const START: f64 = 1e-3;

/// Stations closer than this are the same.
const SAME_STATION: f64 = 1e-9;

impl Shape {
    pub fn new(stations: Vec<f64>, rods: &[RodShape]) -> Self {
        let positions = rods.iter().map(|rod| &rod.nodes);
        let positions =
            positions.map(|nodes| nodes.iter().map(|node| node.position).collect::<Vec<_>>());
        Shape {
            positions: positions.collect(),
            stations,
        }
    }

    /// Largest distance from another shape at the stations common to both;
    /// nothing is interpolated. `None` if there are none but the base, which
    /// is clamped.
    pub fn distance(&self, other: &Shape) -> Option<f64> {
        let mut common = Vec::new();
        let mut j = 0;
        for (i, &sigma) in self.stations.iter().enumerate() {
            while j < other.stations.len() && other.stations[j] < sigma - SAME_STATION {
                j += 1;
            }
            if other
                .stations
                .get(j)
                .is_some_and(|at| (at - sigma).abs() <= SAME_STATION)
            {
                common.push((i, j));
            }
        }
        if common.iter().all(|&(i, _)| self.stations[i] == 0.0) {
            return None;
        }
        let rods = self.positions.iter().zip(&other.positions);
        let distances = rods.flat_map(|(a, b)| {
            let common = common.iter();
            common.map(|&(i, j)| (a[i] - b[j]).length())
        });
        // What is not a number is no small distance.
        let larger = |m: f64, d: f64| if d.is_nan() { f64::INFINITY } else { m.max(d) };
        Some(distances.fold(0.0, larger))
    }

    /// Whether all stations of `other` are among its own.
    pub fn covers(&self, other: &[f64]) -> bool {
        other.iter().all(|sigma| {
            let near = self.stations.iter();
            near.into_iter()
                .any(|at| (at - sigma).abs() <= SAME_STATION)
        })
    }
}

/// All stations in one ascending list.
pub fn union(mut stations: Vec<f64>) -> Vec<f64> {
    stations.sort_by(f64::total_cmp);
    stations.dedup_by(|b, a| *b - *a <= SAME_STATION);
    stations
}

/// The unit of all errors: length of the longest rod.
pub fn longest(scenario: &Scenario) -> f64 {
    let lengths = scenario.rods.iter().map(|rod| rod.length);
    lengths.fold(0.0, f64::max)
}

/// Runs a cell; returns also the time from the checked scenario to the result,
/// in seconds.
///
/// # Errors
/// If the contender cannot be asked this.
pub fn run(cell: &Cell) -> Result<(Run, f64), RelaxError> {
    let Cell {
        scenario,
        contender,
        knob,
    } = *cell;
    let (tolerance, segments) = match knob {
        Setting::Tolerance(tolerance) => (Some(tolerance), None),
        Setting::Segments(segments) => (None, Some(segments)),
    };
    let method = match contender {
        Contender::SemiImplicit | Contender::SemiImplicitGrid => {
            Method::default().on_grid(segments)
        }
        Contender::Explicit | Contender::ExplicitGrid => Method::Explicit { segments },
        Contender::SingleShooting => Method::SingleShooting,
        Contender::MultipleShooting => Method::Shooting { intervals: None },
        Contender::RelaxedShooting => {
            let accuracy = tolerance.unwrap_or(scenario.tolerance);
            let clock = Instant::now();
            let (relaxed, shot) = shoot_from_relaxed(scenario, accuracy)?;
            let seconds = clock.elapsed().as_secs_f64();
            return Ok((shot_run(scenario, relaxed, shot, accuracy), seconds));
        }
    };
    let options = Options {
        method,
        tolerance,
        ..Options::default()
    };
    let clock = Instant::now();
    let leaf = relax::relax(scenario, &options, &mut |_| {})?;
    let seconds = clock.elapsed().as_secs_f64();
    Ok((relaxed_run(scenario, leaf), seconds))
}

fn relaxed_run(scenario: &Scenario, leaf: Equilibrium) -> Run {
    Run {
        outcome: leaf.outcome,
        remark: leaf.remark,
        estimate: leaf
            .accuracy
            .error_estimate
            .map(|error| error / longest(scenario)),
        work: leaf.work,
        shape: Shape::new(leaf.shape.stations, &leaf.shape.rods),
    }
}

type Shot = Option<Result<Solution, Failure>>;

fn shoot_from_relaxed(
    scenario: &Scenario,
    accuracy: f64,
) -> Result<(Equilibrium, Shot), RelaxError> {
    let options = Options {
        tolerance: Some(START),
        ..Options::default()
    };
    let relaxed = relax::relax(scenario, &options, &mut |_| {})?;
    let at_rest = relaxed.outcome.is_success() || relaxed.outcome == Outcome::ToleranceNotReached;
    let shot = at_rest.then(|| {
        let start = Start::Leaf {
            stations: &relaxed.shape.stations,
            rods: &relaxed.shape.rods,
        };
        bvp::solve_within(scenario, start, accuracy, None, &relaxed.shape.stations)
    });
    Ok((relaxed, shot))
}

/// Both together; what they did is added up: corrections are steps,
/// linearisations factorisations, evaluations of all slopes those of all forces.
fn shot_run(scenario: &Scenario, relaxed: Equilibrium, shot: Shot, accuracy: f64) -> Run {
    let run = relaxed_run(scenario, relaxed);
    let Some(shot) = shot else { return run };
    let work = match &shot {
        Ok(solution) => solution.work,
        Err(failure) => failure.work,
    };
    let work = Work {
        steps: run.work.steps + work.iterations,
        factorizations: run.work.factorizations + work.linearizations,
        force_evaluations: run.work.force_evaluations + work.slopes,
        cg_iterations: run.work.cg_iterations,
    };
    match shot {
        Ok(solution) => {
            let estimate = solution.error.position / longest(scenario);
            let outcome = match run.outcome {
                _ if estimate > accuracy => Outcome::ToleranceNotReached,
                // A coarse relaxation is to start from, no more.
                Outcome::ToleranceNotReached => Outcome::Converged,
                outcome => outcome,
            };
            Run {
                outcome,
                remark: None,
                shape: Shape::new(solution.stations, &solution.rods),
                estimate: Some(estimate),
                work,
            }
        }
        Err(failure) => Run {
            outcome: match failure.reason {
                Reason::Singular(_) => Outcome::Singular,
                _ => Outcome::NotAtRest,
            },
            remark: Some(failure.reason.to_string()),
            estimate: None,
            work,
            ..run
        },
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn shape(stations: &[f64], x: impl Fn(f64) -> f64) -> Shape {
        let at = stations.iter().map(|&sigma| x(sigma) * DVec3::X);
        Shape {
            positions: vec![at.collect()],
            stations: stations.to_vec(),
        }
    }

    #[test]
    fn shapes_are_compared_where_both_are_known() {
        let coarse = shape(&[0.0, 0.5, 1.0], |sigma| sigma);
        let fine = shape(&[0.0, 0.25, 0.5, 0.75, 1.0], |sigma| {
            if sigma == 0.25 { 9.0 } else { 1.1 * sigma }
        });
        let distance = coarse.distance(&fine).unwrap();
        assert!((distance - 0.1).abs() < 1e-15);
        assert_eq!(fine.distance(&coarse), Some(distance));
        assert!(fine.covers(&coarse.stations) && !coarse.covers(&fine.stations));

        let thirds = shape(&[0.0, 1.0 / 3.0], |_| 0.0);
        assert_eq!(coarse.distance(&thirds), None, "only the base is common");
    }

    #[test]
    fn what_is_not_a_number_is_far() {
        let a = shape(&[0.0, 1.0], |sigma| sigma);
        let b = shape(&[0.0, 1.0], |_| f64::NAN);
        assert_eq!(a.distance(&b), Some(f64::INFINITY));
    }

    #[test]
    fn stations_are_united() {
        let stations = union(vec![0.0, 0.5, 1.0, 0.0, 0.3, 0.5 + 1e-16, 1.0]);
        assert_eq!(stations, [0.0, 0.3, 0.5, 1.0]);
    }
}
