//! From a scenario and options to the leaf at rest.

use crate::leaf::{Grid, Leaf};
use crate::memory;
use crate::newton::Stop;
use crate::refusal::RefusedOption;
use crate::relax::path::Path;
use crate::relax::request::method::Method;
use crate::relax::request::options::{
    MOST_MODES, Options, Progress, RelaxError, SMALLEST_TOLERANCE, check_tolerance,
};
use crate::relax::result::equilibrium::{Equilibrium, Outcome};
use crate::relax::result::plausible;
use crate::relax::result::report;
use crate::relax::settle::methods::explicit;
use crate::relax::settle::run::Run;
use crate::relax::settle::segments::{check_segments, least, reducible};
use crate::relax::shooting;
use crate::relax::stability::decide::{Decision, Verdict, decide};
use crate::relax::stability::eigenvalues;
use crate::relax::stability::eigenvalues::List;
use crate::relax::transfer::level::Level;
use crate::scenario::Scenario;
use crate::shooting::Start;
use std::time::Instant;

/// Factor on the tolerance of a leaf that does not keep it between the stations of its
/// solution, in layers thinner than the distance of these.
const FOR_STATIONS: f64 = 1e-2;

/// Brings a scenario's leaf to rest.
///
/// # Errors
/// Requests that cannot be met; everything that happens while solving is an
/// [`Outcome`] instead.
pub fn relax(
    scenario: &Scenario,
    options: &Options,
    progress: &mut dyn FnMut(&Progress),
) -> Result<Equilibrium, RelaxError> {
    if let Some(stations) = options.stations {
        memory::stations(scenario.rods.len(), stations)?;
    }
    let found = relax_once(scenario, options, progress)?;
    let Some(parts) = options.stations else {
        return Ok(found);
    };
    if found.keeps_tolerance_at(scenario, parts) {
        return Ok(found);
    }
    let tolerance = found.accuracy.tolerance;
    let sharper = Options {
        tolerance: Some((FOR_STATIONS * tolerance).max(SMALLEST_TOLERANCE)),
        ..options.clone()
    };
    let mut sharp = relax_once(scenario, &sharper, progress)?;
    sharp.accuracy.tolerance = tolerance;
    let mut tips = sharp.tips.iter().zip(&found.tips);
    let apart = 2.0 * tolerance * found.shape.longest();
    let same = sharp.stability.negative_eigenvalues == found.stability.negative_eigenvalues
        && tips.all(|(one, other)| one.distance(*other) <= apart);
    if !same || !sharp.keeps_tolerance() || !sharp.keeps_tolerance_at(scenario, parts) {
        return Ok(found);
    }
    sharp.wall_seconds += found.wall_seconds;
    Ok(Equilibrium {
        outcome: found.outcome,
        remark: found.remark,
        work: found.work + sharp.work,
        ..sharp
    })
}

/// Relaxes once, whatever the stations.
fn relax_once(
    scenario: &Scenario,
    options: &Options,
    progress: &mut dyn FnMut(&Progress),
) -> Result<Equilibrium, RelaxError> {
    let tolerance = options.tolerance.unwrap_or(scenario.tolerance);
    check_tolerance(tolerance)?;
    if options.modes > MOST_MODES {
        let allowed = format!("allowed are 0 to {MOST_MODES}");
        return Err(RefusedOption::new("modes", options.modes, allowed).into());
    }
    if options.mode_shapes && options.method.is_shooting() {
        // Shooting has no grids on which eigenvalues are computed.
        let why = "modes are those of a relaxed leaf: use the method semi-implicit";
        return Err(RefusedOption::new("modes", options.modes, why).into());
    }
    let intervals = match options.method {
        Method::SemiImplicit(_) | Method::Explicit { .. } => {
            let shape_alone = options.modes == 0;
            let found = relax_on_grids(scenario, options, shape_alone, progress);
            return found.map(|(found, _)| found);
        }
        Method::SingleShooting => Some(1),
        Method::Shooting { intervals } | Method::ShootingFromRest { intervals } => intervals,
    };
    shooting::check_intervals(scenario.rods.len(), intervals)?;
    if !matches!(options.method, Method::ShootingFromRest { .. }) {
        if scenario.held_tip.is_some() {
            // Shooting from arcs has no continuation to a held tip.
            let why = "a tip that is held (tip.held) is led there by the relaxation; use shooting-from-rest";
            return Err(RefusedOption::new("method", options.method.word(), why).into());
        }
        let arcs = Start::Arcs;
        let mut found = shooting::shoot(scenario, options, intervals, tolerance, arcs, progress);
        found.doubts = plausible::doubts(scenario, &found);
        return Ok(found);
    }
    let rest = Options {
        method: Method::default(),
        tolerance: Some(shooting::START),
        modes: 0,
        stations: None,
        ..options.clone()
    };
    let rest = relax(scenario, &rest, progress)?;
    let mut found = shooting::from_rest(scenario, options, intervals, tolerance, rest, progress);
    found.doubts = plausible::doubts(scenario, &found);
    Ok(found)
}

/// Relaxes on nested grids, fine enough for forces and eigenvalues too or for the `shape_alone`;
/// also returns the leaf on each grid that was extrapolated, from coarse to fine.
pub(crate) fn relax_on_grids(
    scenario: &Scenario,
    options: &Options,
    shape_alone: bool,
    progress: &mut dyn FnMut(&Progress),
) -> Result<(Equilibrium, Vec<Level>), RelaxError> {
    let tolerance = options.tolerance.unwrap_or(scenario.tolerance);
    check_tolerance(tolerance)?;
    let clock = Instant::now();
    let leaf = Leaf::new(scenario);
    if let Method::Explicit { .. } = options.method {
        explicit::check(&leaf)?;
    }
    let method = options.method;
    // Four segments are too few to be divided among panels.
    let least = least(method, tolerance, shape_alone && leaf.kinks().is_empty());
    let first = check_segments(&leaf, method.segments(), least)?;
    let half = reducible(method).then(|| leaf.half()).flatten();
    let planar = reducible(method) && leaf.is_planar();
    let grid = Grid::new(first, leaf.kinks());
    let mut run = Run::new(&leaf, options, tolerance, progress);
    run.planar = planar;
    run.shape_alone = shape_alone;
    let slowly = run.loads_slowly();
    run.path = slowly.then_some(Path::STABLE).or_else(|| run.released());
    if slowly && run.may_settle_at_once() {
        // Where Newton's method alone leads from arcs to rest nearby, through convex states only,
        // the path need not be walked.
        run = run.of(half.as_ref().unwrap_or(&leaf), half.as_ref().map(|_| &leaf));
        run.stays_in_valley = true;
        let end = run.solve(grid.clone());
        run.stays_in_valley = false;
        if run.is_answer(&end) && run.is_in_first_valley() {
            let run = match half.is_some() {
                true => run.completed(&leaf),
                false => run,
            };
            return Ok(finished(run, end, clock));
        }
        run = run.of(&leaf, None);
    }
    if slowly {
        let (run, end) = run.load_slowly(half.as_ref());
        return Ok(finished(run, end, clock));
    }
    if let Some(half) = &half {
        run = run.of(half, Some(&leaf));
        let end = run.solve(grid.clone());
        if run.is_answer(&end) {
            return Ok(finished(run.completed(&leaf), end, clock));
        }
        // The reduced model fails, as the leaf leaves its valley or breaks the mirror symmetry:
        // solve the full leaf.
        run = run.of(&leaf, None);
    }
    let end = run.solve(grid);
    if end.is_ok() || !run.may_be_loaded_instead() {
        return Ok(finished(run, end, clock));
    }
    let (run, end) = run.of(&leaf, None).load_slowly(None);
    Ok(finished(run, end, clock))
}

/// Rest from the start, on this grid and finer ones.
fn rest_from(run: &mut Run, grid: Grid) -> Result<bool, Stop> {
    if !run.loads_slowly() {
        let end = run.solve(grid.clone());
        if end.is_ok() || !run.may_be_loaded_instead() {
            return end;
        }
        run.restart();
    }
    let arrived = run.arrive(grid)?;
    let guess = run.guess(arrived);
    run.follow(vec![guess])
}

/// The result of a run, with the modes of a leaf at rest: requested modes are not counted in
/// the time of the solution, unless stability depends on them.
fn finished(
    mut run: Run,
    mut end: Result<bool, Stop>,
    clock: Instant,
) -> (Equilibrium, Vec<Level>) {
    let requested = run.options.modes;
    let before = clock.elapsed().as_secs_f64();
    let Decision {
        verdict,
        modes,
        needed,
    } = decide(&mut run, &mut end, &mut rest_from);
    let wall = match needed || requested == 0 {
        true => clock.elapsed().as_secs_f64(),
        false => before,
    };
    let (outcome, remark) = report::outcome(&run, end);
    let mut found = report::equilibrium(&run, outcome, remark, wall);
    found.doubts = plausible::doubts(run.leaf.scenario(), &found);
    let doubt = found
        .path
        .as_ref()
        .and_then(|path| path.doubt(run.options.route));
    let unconfirmed = doubt.is_none() && run.unconfirmed && found.outcome.is_at_rest();
    found.doubts.extend(doubt);
    found
        .doubts
        .extend(unconfirmed.then(|| UNCONFIRMED.to_owned()));
    found.decide(verdict);
    let modes = modes.or_else(|| {
        let list = List::requested(&run);
        end.ok().and_then(|_| eigenvalues::lowest(&run, list))
    });
    found.stability.modes = modes.map(|it| it.modes);
    (found, run.levels)
}

impl Equilibrium {
    /// Takes the Morse index by extrapolated eigenvalues, if it is known, where those of single
    /// grids may have other signs.
    fn decide(&mut self, verdict: Verdict) {
        let index = match verdict {
            Verdict::AsCounted => return,
            Verdict::Undecided(certain)
                if certain > self.stability.negative_eigenvalues.unwrap_or(0) =>
            {
                self.doubts.push(AT_LEAST.to_owned());
                certain
            }
            Verdict::Undecided(_) => {
                self.doubts.push(UNDECIDED.to_owned());
                return;
            }
            Verdict::Unknown => {
                self.doubts.push(UNDECIDED.to_owned());
                self.stability.negative_eigenvalues = None;
                return;
            }
            Verdict::Index(index) => index,
        };
        let unknown = (self.stability.negative_eigenvalues.replace(index)).is_none();
        if !self.outcome.is_success() {
            return;
        }
        if index > 0 {
            self.outcome = Outcome::Saddle;
            self.remark = Some(BESIDE_BIFURCATION.to_owned());
        } else if unknown {
            // It said so.
            self.remark = None;
        }
    }
}

/// Remark on a leaf that two grids never bring to the same equilibrium.
const UNCONFIRMED: &str = "from its start the leaf moves to different equilibria on different grids: \
     this is one in which it can rest; relax with --all looks for the others";

/// Remark on a leaf with an eigenvalue that may have either sign.
const UNDECIDED: &str = "an eigenvalue may be negative or positive for all that these grids tell: \
     whether the leaf is stable is not certain";

/// Remark on a leaf with an eigenvalue that may have either sign beside others that are negative.
const AT_LEAST: &str = "an eigenvalue may be negative or positive for all that these grids tell: \
     the index is the number of those that are certainly negative, or larger";

/// Remark on a leaf at rest on all grids that is at a saddle.
const BESIDE_BIFURCATION: &str = "just beyond a bifurcation: unstable, by eigenvalues extrapolated over grids on which it is \
     still stable; a load that is a little larger, or a small disturbance, shows where it goes";
