//! Common basis of all comparisons of methods: the answer of a method, its time, the distance of two
//! answers, and whether they confirm each other.

use crate::leaf::{Grid, Leaf};
use crate::relax;
use crate::relax::{
    Equilibrium, Options, Outcome, RelaxError, SemiImplicit, SolverCounts, index_near,
};
use crate::run::{Instant, Limit};
use crate::scenario::{Scenario, longest};
use crate::shape::{Difference, RodShape, Undulation};
use crate::shooting::{ShootingSolution, ShootingStart};
use crate::study::remark::SolutionRemark;

/// Stations closer than this are the same.
pub const SAME_STATION_DISTANCE: f64 = 1e-9;

/// Least number of segments of a grid on which negative eigenvalues are counted.
pub const LEAST_EIGENVALUE_SEGMENTS: usize = 32;

/// Leaves farther apart than this, in lengths, are not the same leaf on two grids.
pub const SAME_LEAF_DISTANCE: f64 = 0.05;

/// The answer of a method, in the units of the scenario.
#[derive(Clone, Debug)]
pub struct MethodSolution {
    /// How the run ended.
    pub outcome: Outcome,
    /// Why it did not succeed, or another remark of the method.
    pub remark: Option<SolutionRemark>,
    /// Fractions of the length at which the shape is known, ascending.
    pub stations: Vec<f64>,
    /// The shape there, one per rod.
    pub rods: Vec<RodShape>,
    pub energy: f64,
    /// Number of negative eigenvalues.
    pub index: Option<usize>,
    /// The method's own bound on the error of the positions, in units of length.
    pub error_estimate: Option<f64>,
    /// Waves and twist of the veins.
    pub undulation: Undulation,
    /// Work done.
    pub work: SolverCounts,
}

impl From<Equilibrium> for MethodSolution {
    fn from(leaf: Equilibrium) -> Self {
        MethodSolution {
            outcome: leaf.outcome,
            remark: leaf.remark.map(SolutionRemark::Equilibrium),
            stations: leaf.shape.stations,
            rods: leaf.shape.rods,
            energy: leaf.energy.unwrap_or(f64::NAN),
            index: leaf.stability.negative_eigenvalues,
            error_estimate: leaf.accuracy.error_estimate,
            undulation: leaf.undulation,
            work: leaf.work,
        }
    }
}

impl MethodSolution {
    pub fn from_relaxation(scenario: &Scenario, options: &Options) -> Result<Self, RelaxError> {
        relax::relax(scenario, options, &mut |_| {}).map(MethodSolution::from)
    }

    /// The answer given by a solution of the boundary-value problem with this `accuracy`,
    /// relative to the longest rod. Eigenvalues are not counted.
    pub fn from_shooting(scenario: &Scenario, solution: ShootingSolution, accuracy: f64) -> Self {
        let error = solution.error.position;
        MethodSolution {
            outcome: match error > accuracy * longest(&scenario.rods) {
                true => Outcome::ToleranceNotReached,
                false => Outcome::Converged,
            },
            remark: None,
            energy: solution.energy,
            index: None,
            error_estimate: Some(error),
            undulation: Undulation::at_stations(
                scenario,
                &solution.stations,
                &solution.rods,
                Some(error),
            ),
            work: solution.work.into(),
            stations: solution.stations,
            rods: solution.rods,
        }
    }

    /// Whether the leaf is at rest, whatever its stability and accuracy.
    pub fn is_at_rest(&self) -> bool {
        self.outcome.is_success() || self.outcome == Outcome::ToleranceNotReached
    }

    /// The answer as the start of a boundary-value problem.
    pub fn shooting_start(&self) -> ShootingStart<'_> {
        ShootingStart::Leaf {
            stations: &self.stations,
            rods: &self.rods,
        }
    }

    /// Largest distance from another answer at the stations common to both;
    /// nothing is interpolated. `None` if the only common station is the clamped
    /// base. NaN counts as infinite.
    pub fn largest_distance(&self, other: &MethodSolution) -> Option<f64> {
        let common = common_stations(&self.stations, &other.stations);
        if common.iter().all(|&(i, _)| self.stations[i] == 0.0) {
            return None;
        }
        let pairs = rod_differences(&common, &self.rods, &other.rods).flatten();
        let largest = pairs.fold(Difference::default(), Difference::max);
        Some(largest.position)
    }

    /// Whether this distance is no more than the sum of both error estimates.
    pub fn agrees_within_errors(&self, other: &MethodSolution, distance: f64) -> bool {
        distance <= self.error_bound() + other.error_bound()
    }

    /// The bound on its error; infinite if there is none.
    pub fn error_bound(&self) -> f64 {
        self.error_estimate.unwrap_or(f64::INFINITY)
    }
}

/// A result, and the seconds it took.
#[derive(Clone, Debug)]
pub struct Timed<T> {
    pub result: T,
    pub seconds: f64,
}

impl<T, E> Timed<Result<T, E>> {
    pub fn transpose(self) -> Result<Timed<T>, E> {
        Ok(Timed {
            result: self.result?,
            seconds: self.seconds,
        })
    }
}

pub fn run_timed<T>(run: impl FnOnce() -> T) -> Timed<T> {
    let clock = Instant::now();
    let result = run();
    Timed {
        result,
        seconds: clock.elapsed().as_secs_f64(),
    }
}

/// A grid of at least so many segments on which eigenvalues can be counted.
pub fn eigenvalue_grid(scenario: &Scenario, segments: usize) -> Grid {
    let leaf = Leaf::new(scenario);
    let mut grid = Grid::new(segments.max(leaf.kinks().len() + 1), leaf.kinks());
    while grid.segments() < LEAST_EIGENVALUE_SEGMENTS {
        grid = grid.refined();
    }
    grid
}

/// Number of negative eigenvalues of the equilibrium near a shape given at the
/// nodes of `grid` and possibly at other stations, within `error`.
pub fn morse_index_near(
    scenario: &Scenario,
    grid: Grid,
    stations: &[f64],
    rods: &[RodShape],
    error: f64,
) -> Option<usize> {
    let kept: Vec<usize> = (common_stations(stations, grid.sigma()).into_iter())
        .map(|(i, _)| i)
        .collect();
    let at_nodes = |rod: &RodShape| RodShape {
        length: rod.length,
        nodes: kept.iter().map(|&i| rod.nodes[i]).collect(),
    };
    let rods: Vec<RodShape> = rods.iter().map(at_nodes).collect();
    index_near(scenario, grid, &rods, error)
}

/// Error estimate of a leaf on one grid, in units of length: from the
/// distance to the leaf on a grid twice as fine, which is three quarters of the error
/// in the asymptotic range. `None` if one of them is not at rest within the tolerance.
pub fn single_grid_error(
    scenario: &Scenario,
    segments: usize,
    tolerance: f64,
    limit: &Limit,
) -> Option<f64> {
    const SAFETY: f64 = 2.0;
    let on = |segments: usize| {
        let options = Options {
            method: SemiImplicit::on_grid(Some(segments)).into(),
            tolerance: Some(tolerance),
            limit: limit.clone(),
            ..Options::default()
        };
        let leaf = MethodSolution::from_relaxation(scenario, &options).ok()?;
        leaf.outcome.is_success().then_some(leaf)
    };
    let apart = on(segments)?.largest_distance(&on(2 * segments)?)?;
    Some((SAFETY * apart).min(SAME_LEAF_DISTANCE * longest(&scenario.rods)))
}

/// Index pairs of the stations that are in both ascending lists.
pub fn common_stations(a: &[f64], b: &[f64]) -> Vec<(usize, usize)> {
    let (mut i, mut j) = (0, 0);
    let mut common = Vec::new();
    while i < a.len() && j < b.len() {
        if (a[i] - b[j]).abs() <= SAME_STATION_DISTANCE {
            common.push((i, j));
            (i, j) = (i + 1, j + 1);
        } else if a[i] < b[j] {
            i += 1;
        } else {
            j += 1;
        }
    }
    common
}

/// Differences of each rod at these pairs of stations.
pub fn rod_differences<'a>(
    common: &'a [(usize, usize)],
    a: &'a [RodShape],
    b: &'a [RodShape],
) -> impl Iterator<Item = impl Iterator<Item = Difference>> {
    a.iter().zip(b).map(move |(a, b)| {
        let common = common.iter();
        common.map(|&(i, j)| Difference::of(&a.nodes[i], &b.nodes[j]))
    })
}

/// The nodes of a grid and those of `others` that are not among them.
pub fn grid_nodes_and_others(grid: &[f64], others: &[f64]) -> Vec<f64> {
    let shared: Vec<usize> = common_stations(others, grid)
        .into_iter()
        .map(|(i, _)| i)
        .collect();
    let own = (0..others.len()).filter(|i| shared.binary_search(i).is_err());
    let mut all: Vec<f64> = grid.iter().copied().chain(own.map(|i| others[i])).collect();
    all.sort_by(f64::total_cmp);
    all
}

/// All stations in one ascending list without duplicates.
pub fn union_of_stations(mut stations: Vec<f64>) -> Vec<f64> {
    stations.sort_by(f64::total_cmp);
    stations.dedup_by(|b, a| *b - *a <= SAME_STATION_DISTANCE);
    stations
}

#[cfg(test)]
pub(super) mod tests {
    use glam::{DQuat, DVec3};

    use super::*;
    use crate::shape::NodeState;

    /// One rod with its nodes here and without rotation.
    pub fn rod(stations: &[f64], length: f64, position: impl Fn(f64) -> DVec3) -> MethodSolution {
        let node = |&sigma: &f64| NodeState {
            position: position(sigma),
            rotation: DQuat::IDENTITY,
            v: DVec3::X,
            u: DVec3::ZERO,
            n: DVec3::ZERO,
            m: DVec3::ZERO,
        };
        MethodSolution {
            outcome: Outcome::Converged,
            remark: None,
            stations: stations.to_vec(),
            rods: vec![RodShape {
                length,
                nodes: stations.iter().map(node).collect(),
            }],
            energy: 0.0,
            index: None,
            error_estimate: Some(0.06),
            undulation: Undulation::default(),
            work: SolverCounts::default(),
        }
    }

    fn straight_rod_solution(stations: &[f64], x: impl Fn(f64) -> f64) -> MethodSolution {
        rod(stations, 1.0, |sigma| x(sigma) * DVec3::X)
    }

    #[test]
    fn answers_are_compared_where_both_are_known() {
        let coarse = straight_rod_solution(&[0.0, 0.5, 1.0], |sigma| sigma);
        let fine = straight_rod_solution(&[0.0, 0.25, 0.5, 0.75, 1.0], |sigma| {
            if sigma == 0.25 { 9.0 } else { 1.1 * sigma }
        });
        let distance = coarse.largest_distance(&fine).unwrap();
        assert!((distance - 0.1).abs() < 1e-15);
        assert_eq!(fine.largest_distance(&coarse), Some(distance));
        assert!(
            coarse.agrees_within_errors(&fine, distance)
                && !coarse.agrees_within_errors(&fine, 0.13)
        );

        let third = straight_rod_solution(&[0.0, 1.0 / 3.0], |_| 0.0);
        assert_eq!(
            coarse.largest_distance(&third),
            None,
            "only the base is common"
        );
        let wild = straight_rod_solution(&[0.0, 1.0], |_| f64::NAN);
        assert_eq!(coarse.largest_distance(&wild), Some(f64::INFINITY));
    }

    #[test]
    fn stations_are_united() {
        let stations = union_of_stations(vec![0.0, 0.5, 1.0, 0.0, 0.3, 0.5 + 1e-16, 1.0]);
        assert_eq!(stations, [0.0, 0.3, 0.5, 1.0]);
        assert_eq!(
            common_stations(&stations, &[0.0, 0.5, 0.7]),
            [(0, 0), (2, 1)]
        );
        let others = [0.0, 0.2, 0.5 + 1e-16, 1.0];
        let all = grid_nodes_and_others(&stations, &others);
        assert_eq!(all, [0.0, 0.2, 0.3, 0.5, 1.0]);
    }
}
