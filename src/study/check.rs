//! Two independent methods for the same equilibrium, compared: relaxation, and the boundary-value problem
//! by shooting.

use crate::numbers::{larger, largest};
use crate::relax::{
    Equilibrium, EquilibriumRemark, Options, Progress, RelaxError, SemiImplicit, serialize_index,
    serialize_remark,
};
use crate::run::Limit;
use crate::scenario::{Scenario, Tissue};
use crate::shape::{Difference, serialize_tips};
use crate::shooting::{ShootingFailure, ShootingFailureReason, ShootingSolution, ShootingStart};
use crate::study::judge::{
    Timed, common_stations, eigenvalue_grid, grid_nodes_and_others, morse_index_near,
    rod_differences, run_timed,
};
use crate::study::remark::CheckReason;
use crate::{relax, shooting, words};
use glam::DVec3;
use serde::{Serialize, Serializer};

/// Rotations may differ by this many times the tolerance (in radians) before
/// the shapes count as different: they are less accurate than the positions, to which
/// the tolerance applies, but a vein with another twist is another equilibrium.
const ROTATION_TOLERANCE_FACTOR: f64 = 100.0;

/// Forces and moments may differ by this many times the tolerance, as a part of the largest in the
/// leaf, beside what the boundary-value solution knows of them.
const FORCE_TOLERANCE_FACTOR: f64 = 100.0;

/// Options of a check.
#[derive(Clone, Debug, Default)]
pub struct CheckOptions {
    /// Replaces the scenario's tolerance.
    pub tolerance: Option<f64>,
    /// Whether to compare at a saddle instead of leaving it.
    pub keep_unstable: bool,
    /// Intervals of the shooting; `None`: as many as the growth of
    /// perturbations needs.
    pub intervals: Option<usize>,
    /// Time limit: beyond it the leaf is not at rest, or there is no second solution.
    pub limit: Limit,
}

/// Verdict of a check.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(tag = "verdict", content = "reason", rename_all = "kebab-case")]
pub enum CheckVerdict {
    /// Both find the same shape within the tolerance and, where both know it, the same number of
    /// negative eigenvalues.
    Agree,
    /// They do not.
    Differ,
    /// There are not two solutions to compare, with the reason.
    NotCompared(CheckReason),
    /// Shooting finds no solution of its own, only that nothing it can resolve contradicts the relaxed
    /// leaf, with the reason.
    NotIndependent(CheckReason),
}

words! {
    /// The quantities compared.
    pub enum ComparedQuantity {
        /// Positions of the centerlines.
        Position = "position",
        /// Rotations of the directors.
        Rotation = "rotation",
        /// Stress resultants n.
        Force = "force",
        /// Stress couples m.
        Moment = "moment",
    }
}

impl ComparedQuantity {
    /// Its component of a difference.
    pub fn component(self, difference: &Difference) -> f64 {
        match self {
            ComparedQuantity::Position => difference.position,
            ComparedQuantity::Rotation => difference.rotation,
            ComparedQuantity::Force => difference.force,
            ComparedQuantity::Moment => difference.moment,
        }
    }
}

/// The place of the largest difference of two shapes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DifferenceLocation {
    /// The rod, counted from 0.
    pub rod: usize,
    /// Fraction of its length.
    pub sigma: f64,
}

/// Both methods, and the distance of their results: `check.json`.
#[derive(Clone, Debug, Serialize)]
pub struct Check {
    /// Name of the scenario.
    pub scenario: String,
    /// The verdict.
    #[serde(flatten)]
    pub verdict: CheckVerdict,
    /// Number of veins.
    pub rods: usize,
    /// Required accuracy, relative to the longest rod.
    pub tolerance: f64,
    /// Largest differences anywhere.
    pub difference: Option<Difference>,
    /// Whether the positions differ by no more than the sum of both error estimates.
    pub within_estimates: Option<bool>,
    /// The relaxed leaf.
    #[serde(rename = "relaxation", serialize_with = "serialize_relaxation")]
    pub relaxed: Equilibrium,
    /// The boundary-value problem solved from there; `None` if it is not at rest.
    #[serde(rename = "shooting")]
    pub shot: Option<ShootingResult>,
    /// Stations of the relaxed leaf: fractions of the length.
    pub stations: Vec<f64>,
    /// Largest differences over all veins at each of them; empty without a solution.
    #[serde(rename = "differences")]
    pub along: Vec<Difference>,
    /// Whether forces and moments count for the verdict.
    #[serde(skip)]
    compares_forces: bool,
}

impl Check {
    /// From a relaxed leaf and the shooting solution started from it.
    pub fn new(relaxed: Equilibrium, shot: Option<ShootingResult>) -> Self {
        let mut check = Check {
            scenario: relaxed.scenario.clone(),
            verdict: CheckVerdict::Differ,
            rods: relaxed.rod_count,
            tolerance: relaxed.accuracy.tolerance,
            difference: None,
            within_estimates: None,
            stations: relaxed.shape.stations.clone(),
            along: Vec::new(),
            compares_forces: true,
            relaxed,
            shot,
        };
        check.compute_differences();
        check
    }

    fn compute_differences(&mut self) {
        let rods = self.differences_by_rod();
        let stations = 0..rods.first().map_or(0, Vec::len);
        let largest = |i| {
            let rods = rods.iter().map(|along: &Vec<Difference>| along[i]);
            rods.fold(Difference::default(), Difference::max)
        };
        self.along = stations.map(largest).collect();
        self.difference = self.along.iter().copied().reduce(Difference::max);
        self.within_estimates = self.differs_within_estimates();
        self.verdict = self.reach_verdict();
    }

    /// The check of a leaf with rigid tissue, whose verdict is that of the shapes alone: what each vein bears
    /// of the tissue's forces follows from layers as thin as the gaps, which shapes hardly depend on.
    fn of_shapes_alone(mut self) -> Self {
        self.compares_forces = false;
        self.verdict = self.reach_verdict();
        self
    }

    fn differs_within_estimates(&self) -> Option<bool> {
        let estimate = self.relaxed.accuracy.error_estimate? + self.solution()?.error.position;
        Some(self.difference?.position <= estimate)
    }

    fn reach_verdict(&self) -> CheckVerdict {
        let solution = match self.shot.as_ref().map(|shot| &shot.found) {
            None => {
                let remark = self.relaxed.remark.clone();
                return CheckVerdict::NotCompared(CheckReason::NotAtRest { remark });
            }
            Some(Err(failure)) => {
                let why = CheckReason::ShootingFailed(failure.reason.clone());
                return match failure.reason {
                    ShootingFailureReason::Rounding { .. }
                    | ShootingFailureReason::TooMuchWork { .. }
                    | ShootingFailureReason::Unbounded { fixed: false, .. } => {
                        CheckVerdict::NotIndependent(why)
                    }
                    _ => CheckVerdict::NotCompared(why),
                };
            }
            Some(Ok(solution)) => solution,
        };
        if solution.error.position > self.allowed() {
            let error = solution.error.position;
            return CheckVerdict::NotCompared(CheckReason::Inaccurate { error });
        }
        let [force, moment] = self.allowed_resultants();
        let same = |found: Difference| {
            found.position <= self.allowed()
                && found.rotation <= self.allowed_rotation()
                && (!self.compares_forces
                    || found.force <= force + solution.error.force
                        && found.moment <= moment + solution.error.moment)
        };
        let contradict = self
            .indices()
            .is_some_and(|[relaxed, shot]| relaxed != shot);
        match self.difference.is_some_and(same) && !contradict {
            true => CheckVerdict::Agree,
            false => CheckVerdict::Differ,
        }
    }

    /// The numbers of negative eigenvalues of the relaxed leaf and of the boundary-value solution,
    /// if both are known.
    pub fn indices(&self) -> Option<[usize; 2]> {
        let relaxed = self.relaxed.stability.negative_eigenvalues;
        Some([relaxed?, self.shot.as_ref()?.negative_eigenvalues?])
    }

    /// The boundary-value solution, if there is one.
    pub fn solution(&self) -> Option<&ShootingSolution> {
        self.shot.as_ref()?.found.as_ref().ok()
    }

    /// The place at which a quantity differs most.
    pub fn largest_difference_location(
        &self,
        quantity: ComparedQuantity,
    ) -> Option<DifferenceLocation> {
        let rods = self.differences_by_rod().into_iter().enumerate();
        let found = rods.flat_map(|(rod, along)| {
            let along = along.into_iter().zip(&self.stations);
            along.map(move |(found, &sigma)| {
                (
                    quantity.component(&found),
                    DifferenceLocation { rod, sigma },
                )
            })
        });
        let farther = |a: (f64, DifferenceLocation), b: (f64, DifferenceLocation)| {
            if b.0 > a.0 { b } else { a }
        };
        found.reduce(farther).map(|(_, place)| place)
    }

    /// Differences of each rod at each station of the relaxed leaf, which are among those of the
    /// solution: matched by station, since another grid with as many segments may divide the
    /// panels between knots differently. Empty without a solution.
    fn differences_by_rod(&self) -> Vec<Vec<Difference>> {
        let Some(solution) = self.solution() else {
            return Vec::new();
        };
        let both = common_stations(&self.stations, &solution.stations);
        let rods = rod_differences(&both, &self.relaxed.shape.rods, &solution.rods);
        rods.map(Iterator::collect).collect()
    }

    /// Distance of positions up to which the shapes count as the same, in
    /// units of length.
    pub fn allowed(&self) -> f64 {
        self.tolerance * self.relaxed.shape.longest()
    }

    /// Angle between directors up to which the shapes count as the same.
    pub fn allowed_rotation(&self) -> f64 {
        ROTATION_TOLERANCE_FACTOR * self.tolerance
    }

    /// Differences of forces and of moments up to which the leaves count as the same, in units of
    /// these.
    pub fn allowed_resultants(&self) -> [f64; 2] {
        let longest = self.relaxed.shape.longest();
        let nodes = (self.relaxed.shape.rods.iter()).flat_map(|rod| &rod.nodes);
        let sizes = nodes.map(|node| larger(node.n.length(), node.m.length() / longest));
        // The energy of a leaf that is bent in itself is that of forces, too.
        let energy = self.relaxed.energy.unwrap_or(0.0).abs() / longest;
        let force = FORCE_TOLERANCE_FACTOR * self.tolerance * larger(largest(sizes), energy);
        [force, force * longest]
    }
}

/// Relaxes a leaf, solves its boundary-value problem from there, and compares.
pub fn check(
    scenario: &Scenario,
    options: &CheckOptions,
    progress: &mut dyn FnMut(&Progress),
) -> Result<Check, RelaxError> {
    relax::check_intervals(scenario.rods.len(), options.intervals)?;
    shooting::check_models(scenario, true)?;
    let asked = Options {
        tolerance: options.tolerance,
        method: SemiImplicit {
            keep_unstable: options.keep_unstable,
            ..SemiImplicit::default()
        }
        .into(),
        limit: options.limit.clone(),
        ..Options::default()
    };
    // Forces are compared as well: not the shape alone.
    let relaxed = relax::relax_on_grids(scenario, &asked, false, progress)?.result;
    let shot = (relaxed.outcome.is_at_rest())
        .then(|| solve_by_shooting(scenario, &relaxed, options, progress));
    let check = Check::new(relaxed, shot);
    let rigid = scenario.tissue.iter().flatten().any(Tissue::is_rigid);
    Ok(if rigid {
        check.of_shapes_alone()
    } else {
        check
    })
}

/// Solves the boundary-value problem from a relaxed leaf, to the same accuracy.
fn solve_by_shooting(
    scenario: &Scenario,
    relaxed: &Equilibrium,
    asked: &CheckOptions,
    progress: &mut dyn FnMut(&Progress),
) -> ShootingResult {
    let grid = eigenvalue_grid(scenario, relaxed.shape.stations.len() - 1);
    let start = ShootingStart::Leaf {
        stations: &relaxed.shape.stations,
        rods: &relaxed.shape.rods,
    };
    let precision = shooting::RequiredPrecision::EstimatedError(relaxed.accuracy.tolerance);
    let stations = grid_nodes_and_others(grid.sigma(), &relaxed.shape.stations);
    let options = shooting::ShootingOptions {
        intervals: asked.intervals,
        limit: asked.limit.clone(),
        gives_up: true,
        ..shooting::ShootingOptions::new(start, &stations, precision)
    };
    let Timed {
        result: found,
        seconds: wall_seconds,
    } = run_timed(|| {
        shooting::solve(scenario, &options, &mut |step| {
            progress(&Progress::Shooting(*step))
        })
    });
    let rods = found.as_ref().map_or(&[][..], |solution| &solution.rods);
    let ends = rods.iter().take(relaxed.tips.len());
    ShootingResult {
        tips: (ends.filter_map(|rod| rod.nodes.last()))
            .map(|node| node.position)
            .collect(),
        negative_eigenvalues: match &found {
            // There is no index without a potential.
            Ok(_) if scenario.has_followers() || scenario.wind.is_some() => None,
            Ok(solution) => morse_index_near(
                scenario,
                grid,
                &solution.stations,
                &solution.rods,
                solution.error.position,
            ),
            Err(_) => None,
        },
        found,
        wall_seconds,
    }
}

/// The boundary-value solution with its verdict, or why there is none.
#[derive(Clone, Debug)]
pub struct ShootingResult {
    /// What the shooting found.
    pub found: Result<ShootingSolution, ShootingFailure>,
    /// The shared tip alone, or one tip per rod; empty without a solution.
    pub tips: Vec<DVec3>,
    /// Its Morse index, counted on the energy's Hessian at this shape.
    pub negative_eigenvalues: Option<usize>,
    /// Time of the shooting alone, in seconds.
    pub wall_seconds: f64,
}

/// The part of `check.json` on the relaxed leaf.
pub fn serialize_relaxation<S: Serializer>(
    leaf: &Equilibrium,
    serializer: S,
) -> Result<S::Ok, S::Error> {
    #[derive(Serialize)]
    struct Keys<'a> {
        outcome: &'static str,
        #[serde(flatten, serialize_with = "serialize_remark")]
        remark: &'a Option<EquilibriumRemark>,
        segments: &'a [usize],
        error_estimate: Option<f64>,
        residual: Option<f64>,
        energy: Option<f64>,
        #[serde(flatten, serialize_with = "serialize_tips")]
        tips: &'a [DVec3],
        #[serde(flatten, serialize_with = "serialize_index")]
        index: Option<usize>,
        wall_seconds: f64,
    }
    Keys {
        outcome: leaf.outcome.word(),
        remark: &leaf.remark,
        segments: &leaf.accuracy.segments,
        error_estimate: leaf.accuracy.error_estimate,
        residual: leaf.accuracy.residual,
        energy: leaf.energy,
        tips: &leaf.tips,
        index: leaf.stability.negative_eigenvalues,
        wall_seconds: leaf.wall_seconds,
    }
    .serialize(serializer)
}

/// All keys; those of a solution are null if there is none.
impl Serialize for ShootingResult {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        #[derive(Serialize)]
        struct Keys<'a> {
            outcome: &'static str,
            intervals: Option<usize>,
            growth_log10: Option<f64>,
            defect: Option<f64>,
            condition: Option<f64>,
            error_estimate: Option<Difference>,
            energy: Option<f64>,
            #[serde(flatten, serialize_with = "serialize_tips")]
            tips: &'a [DVec3],
            #[serde(flatten, serialize_with = "serialize_index")]
            index: Option<usize>,
            neutral: Option<NeutralKeys<'a>>,
            work: shooting::ShootingCounts,
            wall_seconds: f64,
        }
        #[derive(Serialize)]
        struct NeutralKeys<'a> {
            ratio: f64,
            meaning: String,
            displacement: &'a [Vec<DVec3>],
        }
        let solution = self.found.as_ref().ok();
        let (outcome, neutral, work) = match &self.found {
            Ok(solution) => ("converged", solution.neutral.as_ref(), solution.work),
            Err(ShootingFailure { reason, work, .. }) => match reason {
                ShootingFailureReason::Singular(neutral) => ("singular", Some(neutral), *work),
                ShootingFailureReason::NoConvergence { .. } => ("no-convergence", None, *work),
                ShootingFailureReason::Rounding { .. } => ("rounding", None, *work),
                ShootingFailureReason::Unbounded { .. } => ("unbounded", None, *work),
                ShootingFailureReason::TooMuchWork { .. } => ("too-much-work", None, *work),
                ShootingFailureReason::TooMuchMemory(_) => ("too-much-memory", None, *work),
                ShootingFailureReason::OutOfTime => ("out-of-time", None, *work),
                ShootingFailureReason::Unmodelled(_) => ("not-modelled", None, *work),
            },
        };
        Keys {
            outcome,
            intervals: solution.map(|solution| solution.intervals.len() - 1),
            growth_log10: solution.map(|solution| solution.growth),
            defect: solution.map(|solution| solution.defect),
            condition: solution.map(|solution| solution.condition),
            error_estimate: solution.map(|solution| solution.error),
            energy: solution.map(|solution| solution.energy),
            tips: &self.tips,
            index: self.negative_eigenvalues,
            neutral: neutral.map(|neutral| NeutralKeys {
                ratio: neutral.ratio,
                meaning: neutral.to_string(),
                displacement: &neutral.displacement,
            }),
            work,
            wall_seconds: self.wall_seconds,
        }
        .serialize(serializer)
    }
}

#[cfg(test)]
mod tests {
    use glam::{DQuat, DVec3};

    use super::*;

    fn fan() -> Check {
        let fan = r#"
            name = "fan"
            leaf = { rods = 3, length = 2.0, fan = "symmetric" }
            stiffness = { torsion = 1, bending_2 = 1, bending_3 = 1, axial = 100, shear_2 = 100, shear_3 = 100 }
            load = { gravity = [0.0, 0.0, -0.1] }
        "#;
        let scenario = Scenario::from_toml(fan).unwrap();
        check(&scenario, &CheckOptions::default(), &mut |_| {}).unwrap()
    }

    /// The check with the boundary-value solution changed after the fact.
    fn check_with_changed_solution(
        mut check: Check,
        change: impl Fn(&mut ShootingSolution),
    ) -> Check {
        if let Some(Ok(solution)) = check.shot.as_mut().map(|shot| shot.found.as_mut()) {
            change(solution);
        }
        check.compute_differences();
        check
    }

    #[test]
    fn a_vein_elsewhere_or_twisted_is_a_difference() {
        let middle = |solution: &ShootingSolution| solution.stations.len() / 2;
        let moved = check_with_changed_solution(fan(), |solution| {
            let middle = middle(solution);
            solution.rods[1].nodes[middle].position += 3e-6 * DVec3::Z;
        });
        assert_eq!(moved.verdict, CheckVerdict::Differ);
        assert_eq!(moved.within_estimates, Some(false));
        let place = DifferenceLocation { rod: 1, sigma: 0.5 };
        assert_eq!(
            moved.largest_difference_location(ComparedQuantity::Position),
            Some(place)
        );

        let twisted = check_with_changed_solution(fan(), |solution| {
            let middle = middle(solution);
            let node = &mut solution.rods[2].nodes[middle];
            node.rotation *= DQuat::from_rotation_x(3e-4);
        });
        assert_eq!(twisted.verdict, CheckVerdict::Differ);
        let place = DifferenceLocation { rod: 2, sigma: 0.5 };
        assert_eq!(
            twisted.largest_difference_location(ComparedQuantity::Rotation),
            Some(place)
        );
    }

    /// Forces of the relaxed leaf that are wrong by one in a thousand are seen, the shape being right.
    #[test]
    fn other_forces_are_a_difference() {
        let weaker = check_with_changed_solution(fan(), |solution| {
            for node in solution.rods.iter_mut().flat_map(|rod| &mut rod.nodes) {
                node.n *= 1.001;
            }
        });
        assert_eq!(weaker.verdict, CheckVerdict::Differ);
        assert_eq!(weaker.difference.map(|it| it.position < 1e-7), Some(true));
    }

    /// Both are stable: an index of one of them that is another contradicts that, one that is not
    /// known does not.
    #[test]
    fn another_index_is_a_difference() {
        let with_index = |index: Option<usize>| {
            let mut check = fan();
            assert_eq!(check.indices(), Some([0, 0]));
            if let Some(shot) = &mut check.shot {
                shot.negative_eigenvalues = index;
            }
            check.compute_differences();
            check.verdict
        };
        assert_eq!(with_index(Some(2)), CheckVerdict::Differ);
        assert_eq!(with_index(None), CheckVerdict::Agree);
    }

    #[test]
    fn a_solution_that_is_not_known_well_enough_decides_nothing() {
        let vague = check_with_changed_solution(fan(), |solution| solution.error.position = 3e-6);
        assert!(matches!(vague.verdict, CheckVerdict::NotCompared(_)));
    }
}
