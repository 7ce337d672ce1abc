//! Two roads to the same equilibrium, compared.

use std::time::Instant;

use crate::bvp::{self, Failure, Solution, Start};
use crate::leaf::{Grid, Leaf};
use crate::relax::{
    self, Equilibrium, Options, Outcome, Progress, RelaxError, SemiImplicit, index_near,
};
use crate::scenario::Scenario;
use crate::shape::{Difference, RodShape};

/// Stations of the boundary-value solution, at least: enough to count its
/// negative eigenvalues from.
const SEGMENTS: usize = 32;

/// Rotations may differ by this many times the tolerance (in radians) before
/// the shapes are called different: they are less accurate than the positions
/// the tolerance is for, but a vein twisted otherwise is another equilibrium.
const ROTATION_PART: f64 = 100.0;

/// What is asked of a check.
#[derive(Clone, Debug, Default)]
pub struct CheckOptions {
    /// Replaces the scenario's tolerance.
    pub tolerance: Option<f64>,
    /// Whether to compare at a saddle instead of leaving it.
    pub keep_unstable: bool,
    /// Intervals of the shooting; `None`: as many as the growth of
    /// perturbations needs.
    pub intervals: Option<usize>,
}

/// What a check says.
#[derive(Clone, Debug, PartialEq)]
pub enum Verdict {
    /// Both find the same shape within the tolerance.
    Agree,
    /// They do not.
    Differ,
    /// There are not two solutions to compare: why.
    NotCompared(String),
}

impl Verdict {
    /// The word used in `check.json`.
    pub fn word(&self) -> &'static str {
        match self {
            Verdict::Agree => "agree",
            Verdict::Differ => "differ",
            Verdict::NotCompared(_) => "not-compared",
        }
    }
}

/// A solution of the boundary-value problem, judged.
#[derive(Clone, Debug)]
pub struct Shot {
    /// The solution.
    pub solution: Solution,
    /// Its Morse index, counted on the energy's Hessian at this shape.
    pub negative_eigenvalues: Option<usize>,
}

impl Shot {
    /// Whether the equilibrium is stable: no negative eigenvalue.
    pub fn stable(&self) -> Option<bool> {
        self.negative_eigenvalues.map(|count| count == 0)
    }
}

/// The quantities that are compared.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Quantity {
    /// Positions of the centerlines.
    Position,
    /// Rotations of the directors.
    Rotation,
    /// Stress resultants n.
    Force,
    /// Stress couples m.
    Moment,
}

impl Quantity {
    /// All of them.
    pub const ALL: [Quantity; 4] = [
        Quantity::Position,
        Quantity::Rotation,
        Quantity::Force,
        Quantity::Moment,
    ];

    /// Its part of a difference.
    pub fn of(self, difference: &Difference) -> f64 {
        match self {
            Quantity::Position => difference.position,
            Quantity::Rotation => difference.rotation,
            Quantity::Force => difference.force,
            Quantity::Moment => difference.moment,
        }
    }

    /// The word used in `check.json`.
    pub fn word(self) -> &'static str {
        match self {
            Quantity::Position => "position",
            Quantity::Rotation => "rotation",
            Quantity::Force => "force",
            Quantity::Moment => "moment",
        }
    }
}

/// Where two shapes differ most.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Place {
    /// The rod, counted from 0.
    pub rod: usize,
    /// Fraction of its length.
    pub sigma: f64,
}

/// Both roads, and how far apart they end.
#[derive(Clone, Debug)]
pub struct Check {
    /// The relaxed leaf.
    pub relaxed: Equilibrium,
    /// The boundary-value solution that starts from it; `None` if it is not
    /// at rest.
    pub shot: Option<Result<Shot, Failure>>,
    /// Time of the shooting alone, in seconds.
    pub shot_seconds: Option<f64>,
    /// Largest differences at each station of the relaxed leaf.
    pub along: Vec<Difference>,
    /// Largest differences of all.
    pub difference: Option<Difference>,
    /// The verdict.
    pub verdict: Verdict,
}

impl Check {
    /// The boundary-value solution, if there is one.
    pub fn solution(&self) -> Option<&Shot> {
        self.shot.as_ref()?.as_ref().ok()
    }

    /// Whether the positions differ by no more than both error estimates
    /// together allow.
    pub fn within_estimates(&self) -> Option<bool> {
        let estimate =
            self.relaxed.accuracy.error_estimate? + self.solution()?.solution.error.position;
        Some(self.difference?.position <= estimate)
    }

    /// Where a quantity differs most.
    pub fn farthest(&self, quantity: Quantity) -> Option<Place> {
        let solution = &self.solution()?.solution;
        let stations = &self.relaxed.shape.stations;
        let stride = (solution.stations.len() - 1) / (stations.len() - 1);
        let rods = self
            .relaxed
            .shape
            .rods
            .iter()
            .zip(&solution.rods)
            .enumerate();
        let found = rods.flat_map(|(rod, (a, b))| {
            let nodes = a.nodes.iter().zip(b.nodes.iter().step_by(stride));
            nodes.zip(stations).map(move |((a, b), &sigma)| {
                let difference = quantity.of(&Difference::of(a, b));
                (difference, Place { rod, sigma })
            })
        });
        let farther = |a: (f64, Place), b: (f64, Place)| if b.0 > a.0 { b } else { a };
        found.reduce(farther).map(|(_, place)| place)
    }

    /// Distance of positions up to which the shapes are called the same, in
    /// units of length.
    pub fn allowed(&self) -> f64 {
        self.relaxed.accuracy.tolerance * longest(&self.relaxed)
    }

    /// Angle between directors up to which the shapes are called the same.
    pub fn allowed_rotation(&self) -> f64 {
        ROTATION_PART * self.relaxed.accuracy.tolerance
    }
}

/// Relaxes a leaf, solves its boundary-value problem from there, and compares.
///
/// # Errors
/// Requests that cannot be met, as in [`relax::relax`].
pub fn check(
    scenario: &Scenario,
    options: &CheckOptions,
    progress: &mut dyn FnMut(&Progress),
) -> Result<Check, RelaxError> {
    relax::check_intervals(options.intervals)?;
    let asked = Options {
        tolerance: options.tolerance,
        method: SemiImplicit {
            keep_unstable: options.keep_unstable,
            ..SemiImplicit::default()
        }
        .into(),
        ..Options::default()
    };
    let relaxed = relax::relax(scenario, &asked, progress)?;
    if matches!(relaxed.outcome, Outcome::NotAtRest | Outcome::Diverged) {
        let why = match &relaxed.remark {
            Some(remark) => format!("the relaxation did not come to rest: {remark}"),
            None => "the relaxation did not come to rest".into(),
        };
        return Ok(Check {
            relaxed,
            shot: None,
            shot_seconds: None,
            along: Vec::new(),
            difference: None,
            verdict: Verdict::NotCompared(why),
        });
    }
    let stations = Grid::new(
        relaxed.shape.stations.len() - 1,
        Leaf::new(scenario).kinks(),
    );
    let mut fine = stations.clone();
    while fine.segments() < SEGMENTS {
        fine = fine.refined();
    }
    let clock = Instant::now();
    let start = Start::Leaf {
        stations: &relaxed.shape.stations,
        rods: &relaxed.shape.rods,
    };
    let found = bvp::solve_within(
        scenario,
        start,
        relaxed.accuracy.tolerance,
        options.intervals,
        fine.sigma(),
    );
    let shot_seconds = Some(clock.elapsed().as_secs_f64());
    let shot = found.map(|solution| Shot {
        negative_eigenvalues: index_near(scenario, fine.clone(), &solution.rods),
        solution,
    });
    let stride = fine.segments() / stations.segments();
    let along = match &shot {
        Ok(shot) => differences(&relaxed.shape.rods, &shot.solution.rods, stride),
        Err(_) => Vec::new(),
    };
    let difference = along.iter().copied().reduce(Difference::max);
    Ok(Check {
        verdict: judge(&relaxed, &shot, difference),
        relaxed,
        shot: Some(shot),
        shot_seconds,
        along,
        difference,
    })
}

/// Largest differences over all rods at each node of `coarse`, of which `fine`
/// has `stride` times as many.
fn differences(coarse: &[RodShape], fine: &[RodShape], stride: usize) -> Vec<Difference> {
    (0..coarse[0].nodes.len())
        .map(|i| {
            coarse
                .iter()
                .zip(fine)
                .map(|(a, b)| Difference::of(&a.nodes[i], &b.nodes[stride * i]))
                .fold(Difference::default(), Difference::max)
        })
        .collect()
}

fn longest(leaf: &Equilibrium) -> f64 {
    leaf.shape
        .rods
        .iter()
        .map(|rod| rod.length)
        .fold(0.0, f64::max)
}

fn judge(
    relaxed: &Equilibrium,
    shot: &Result<Shot, Failure>,
    difference: Option<Difference>,
) -> Verdict {
    let wanted = relaxed.accuracy.tolerance * longest(relaxed);
    match (shot, difference) {
        (Err(failure), _) => Verdict::NotCompared(failure.reason.to_string()),
        (Ok(shot), _) if shot.solution.error.position > wanted => Verdict::NotCompared(format!(
            "the boundary-value solution is only known within {:.1e}: ask for a larger tolerance",
            shot.solution.error.position
        )),
        (_, Some(found))
            if found.position <= wanted
                && found.rotation <= ROTATION_PART * relaxed.accuracy.tolerance =>
        {
            Verdict::Agree
        }
        _ => Verdict::Differ,
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
    fn changed(mut check: Check, change: impl Fn(&mut Solution)) -> Check {
        let mut shot = check.shot.take().unwrap().unwrap();
        change(&mut shot.solution);
        let stride = (shot.solution.stations.len() - 1) / (check.relaxed.shape.stations.len() - 1);
        check.along = differences(&check.relaxed.shape.rods, &shot.solution.rods, stride);
        check.difference = check.along.iter().copied().reduce(Difference::max);
        let shot = Ok(shot);
        check.verdict = judge(&check.relaxed, &shot, check.difference);
        check.shot = Some(shot);
        check
    }

    #[test]
    fn both_roads_end_in_the_same_place() {
        let check = fan();
        assert_eq!(check.verdict, Verdict::Agree);
        assert_eq!(check.within_estimates(), Some(true));
        assert_eq!(check.allowed(), 2.0 * check.relaxed.accuracy.tolerance);
    }

    #[test]
    fn a_vein_elsewhere_or_twisted_is_a_difference() {
        let middle = |solution: &Solution| solution.stations.len() / 2;
        let moved = changed(fan(), |solution| {
            let middle = middle(solution);
            solution.rods[1].nodes[middle].position += 3e-6 * DVec3::Z;
        });
        assert_eq!(moved.verdict, Verdict::Differ);
        assert_eq!(moved.within_estimates(), Some(false));
        let place = Place { rod: 1, sigma: 0.5 };
        assert_eq!(moved.farthest(Quantity::Position), Some(place));

        let twisted = changed(fan(), |solution| {
            let middle = middle(solution);
            let node = &mut solution.rods[2].nodes[middle];
            node.rotation *= DQuat::from_rotation_x(3e-4);
        });
        assert_eq!(twisted.verdict, Verdict::Differ);
        let place = Place { rod: 2, sigma: 0.5 };
        assert_eq!(twisted.farthest(Quantity::Rotation), Some(place));
    }

    #[test]
    fn a_solution_that_is_not_known_well_enough_decides_nothing() {
        let vague = changed(fan(), |solution| solution.error.position = 3e-6);
        assert!(matches!(vague.verdict, Verdict::NotCompared(_)));
    }
}
