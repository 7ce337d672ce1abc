//! Two roads to the same equilibrium, compared.

use std::time::Instant;

use crate::bvp::{self, Failure, Solution, Start};
use crate::leaf::{Grid, Leaf};
use crate::relax::{self, Equilibrium, Options, Outcome, Progress, RelaxError, index_near};
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
    /// Time of the solution alone, in seconds.
    pub wall_seconds: f64,
}

/// Both roads, and how far apart they end.
#[derive(Clone, Debug)]
pub struct Check {
    /// The relaxed leaf.
    pub relaxed: Equilibrium,
    /// The boundary-value solution that starts from it; `None` if it is not
    /// at rest.
    pub shot: Option<Result<Shot, Failure>>,
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
        let estimate = self.relaxed.error_estimate? + self.solution()?.solution.error.position;
        Some(self.difference?.position <= estimate)
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
        keep_unstable: options.keep_unstable,
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
            along: Vec::new(),
            difference: None,
            verdict: Verdict::NotCompared(why),
        });
    }
    let stations = Grid::new(relaxed.stations.len() - 1, Leaf::new(scenario).kinks());
    let mut fine = stations.clone();
    while fine.segments() < SEGMENTS {
        fine = fine.refined();
    }
    let clock = Instant::now();
    let start = Start::Leaf {
        stations: &relaxed.stations,
        rods: &relaxed.rods,
    };
    let found = bvp::solve_within(
        scenario,
        start,
        relaxed.tolerance,
        options.intervals,
        fine.sigma(),
    );
    let wall_seconds = clock.elapsed().as_secs_f64();
    let shot = found.map(|solution| Shot {
        negative_eigenvalues: index_near(scenario, fine.clone(), &solution.rods),
        solution,
        wall_seconds,
    });
    let stride = fine.segments() / stations.segments();
    let along = match &shot {
        Ok(shot) => differences(&relaxed.rods, &shot.solution.rods, stride),
        Err(_) => Vec::new(),
    };
    let difference = along.iter().copied().reduce(Difference::max);
    Ok(Check {
        verdict: judge(scenario, &relaxed, &shot, difference),
        relaxed,
        shot: Some(shot),
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

fn judge(
    scenario: &Scenario,
    relaxed: &Equilibrium,
    shot: &Result<Shot, Failure>,
    difference: Option<Difference>,
) -> Verdict {
    let longest = scenario
        .rods
        .iter()
        .map(|rod| rod.length)
        .fold(0.0, f64::max);
    let wanted = relaxed.tolerance * longest;
    match (shot, difference) {
        (Err(failure), _) => Verdict::NotCompared(failure.reason.to_string()),
        (Ok(shot), _) if shot.solution.error.position > wanted => Verdict::NotCompared(format!(
            "the boundary-value solution is only known within {:.1e}: ask for a larger tolerance",
            shot.solution.error.position
        )),
        (_, Some(found))
            if found.position <= wanted && found.rotation <= ROTATION_PART * relaxed.tolerance =>
        {
            Verdict::Agree
        }
        _ => Verdict::Differ,
    }
}
