//! Nested grids: as fine as the tolerance needs, with an error estimate.

mod between;
mod request;
mod settle;
mod stability;

use crate::leaf::{DiscreteLeaf, Grid, Leaf, State, System};
use crate::relax::equilibrium::{Equilibrium, Saddle, Work};
use crate::relax::explicit;
use crate::relax::method::Method;
use crate::relax::modes;
use crate::relax::options::{
    MAX_NODES, MOST_MODES, Options, Progress, RelaxError, check_tolerance, past,
};
use crate::relax::prolong::{predict, prolong};
use crate::relax::report;
use crate::relax::richardson::Richardson;
use crate::relax::semi_implicit::Settled;
use crate::relax::shooting;
use crate::scenario::Scenario;
use request::{COARSEST_TURN, least, reducible};
pub use request::{check_segments, coarsest};
use settle::From;
use stability::complete;
use std::time::Instant;

/// Segments of the coarsest grid, in two panels or more if profiles have kinks.
const COARSEST: usize = 8;

/// Segments of the finest grid.
const FINEST: usize = 16_384;

/// Two grids on which the leaf moved far are said to land in the same place
/// if no station differs by more than this, in lengths.
const SAME_PLACE: f64 = 0.05;

/// The finest grid on which landing places are compared.
const FINEST_LANDING: usize = 256;

/// The finest grid that is tried when coarser ones do not resolve the bending.
const FINEST_RESOLVING: usize = 2048;

/// Growth of errors of single grids by extrapolation, sum of the weights at most:
/// over halved grids, and with one between the finest two.
const EXTRAPOLATED: f64 = 2.0;
const EXTRAPOLATED_BETWEEN: f64 = 6.3;

/// Growth of the estimate from two grids of which the coarser is one of a loose
/// tolerance: it may miss layers that the coupling makes.
const TWO_COARSE: f64 = 1.5;

/// Part of the rounding error that grows with the number of segments.
const ROUNDING: f64 = 4e-15;

/// Nodes times force evaluations after which a leaf that has not come to rest
/// is given up: some seconds.
const BUDGET: usize = 3_000_000;

/// Saddles that are left before the run is given up.
const MAX_SADDLES: i32 = 10;

/// A leaf settled on one grid.
pub(super) struct Level {
    pub leaf: DiscreteLeaf,
    pub state: State,
}

/// Brings a scenario's leaf to rest.
///
/// # Errors
/// Requests that cannot be met; everything that happens while solving is an
/// [`Outcome`](crate::relax::Outcome) instead.
pub fn relax(
    scenario: &Scenario,
    options: &Options,
    progress: &mut dyn FnMut(&Progress),
) -> Result<Equilibrium, RelaxError> {
    let tolerance = options.tolerance.unwrap_or(scenario.tolerance);
    check_tolerance(tolerance)?;
    if options.modes > MOST_MODES {
        return Err(RelaxError::Modes {
            found: options.modes,
        });
    }
    match options.method {
        Method::SemiImplicit(_) | Method::Explicit { .. } => {
            relax_on_grids(scenario, options, tolerance, progress)
        }
        Method::SingleShooting => shooting::from_arcs(scenario, options, Some(1), tolerance),
        Method::Shooting { intervals } => {
            shooting::from_arcs(scenario, options, intervals, tolerance)
        }
        Method::ShootingFromRest { intervals } => {
            shooting::check_intervals(intervals)?;
            let rest = Options {
                method: Method::default(),
                tolerance: Some(shooting::START),
                modes: 0,
                ..options.clone()
            };
            let rest = relax(scenario, &rest, progress)?;
            shooting::from_rest(scenario, options, intervals, tolerance, rest)
        }
    }
}

/// Relaxes on nested grids.
fn relax_on_grids(
    scenario: &Scenario,
    options: &Options,
    tolerance: f64,
    progress: &mut dyn FnMut(&Progress),
) -> Result<Equilibrium, RelaxError> {
    let clock = Instant::now();
    let leaf = Leaf::new(scenario);
    if let Method::Explicit { .. } = options.method {
        explicit::check(&leaf)?;
    }
    let (method, segments) = (options.method, options.method.segments());
    let first = check_segments(&leaf, segments, least(method, tolerance))?;
    let reduced = match reducible(method) {
        true => leaf.reduced(),
        false => None,
    };
    let grid = Grid::new(first, leaf.kinks());
    let mut work = Work::default();
    if let Some(reduced) = &reduced {
        let mut run = Run::new(reduced, options, tolerance, progress);
        run.whole = Some(&leaf);
        let end = run.solve(grid.clone());
        if matches!(end, End::Rest | End::NotAccurate) && run.index == Some(0) {
            let run = run.completed(&leaf);
            return Ok(finished(run, end, clock));
        }
        // The whole leaf has something to say: it moves out of its valley,
        // breaks the mirror, or leaves the plane.
        work = run.work;
    }
    let mut run = Run::new(&leaf, options, tolerance, progress);
    run.work = work;
    let end = run.solve(grid);
    Ok(finished(run, end, clock))
}

/// The result of a run, and of a leaf at rest its modes, which are not counted
/// in the time of the solution.
fn finished(run: Run, end: End, clock: Instant) -> Equilibrium {
    let at_rest = matches!(end, End::Rest | End::NotAccurate);
    let (outcome, remark) = report::outcome(&run, end);
    let seconds = clock.elapsed().as_secs_f64();
    let modes = if at_rest { modes::lowest(&run) } else { None };
    let mut found = report::equilibrium(run, outcome, remark, seconds);
    found.stability.modes = modes;
    found
}

/// How a run over the grids ended.
pub(super) enum End {
    /// At rest; the finest grid's last increments were below the accuracy.
    Rest,
    /// At rest, but not to the tolerance on the finest grid allowed.
    NotAccurate,
    /// Not at rest on the finest grid tried.
    Failed(Settled),
}

pub(super) struct Run<'a, 'o> {
    pub leaf: &'a Leaf,
    /// The leaf with all of its unknowns, if `leaf` is half of it or in its plane.
    whole: Option<&'a Leaf>,
    /// Rods solved for.
    pub solved: usize,
    /// Whether in their plane.
    pub planar: bool,
    /// What neglecting shear, and stretch, would change.
    pub effects: [Option<f64>; 2],
    pub options: &'o Options,
    pub tolerance: f64,
    progress: &'o mut dyn FnMut(&Progress),
    pub work: Work,
    pub saddle: Option<Saddle>,
    pub levels: Vec<Level>,
    /// The leaf on a grid between the finest two, if their extrapolation has it too.
    pub between: Option<Level>,
    /// What that changed, times a safety factor: so near to the finest two, it may
    /// have gained nothing where layers are thin, and the last correction does
    /// not tell.
    change: Option<f64>,
    pub table: Richardson,
    pub index: Option<usize>,
    /// Largest iteration error left on any grid.
    pub remaining: f64,
    /// Nodes times force evaluations so far.
    spent: usize,
    /// Saddles left that were only noticed by their index.
    pushes: i32,
    /// The matrix with which the last grid came to rest.
    last: Option<System>,
}

impl<'a, 'o> Run<'a, 'o> {
    fn new(
        leaf: &'a Leaf,
        options: &'o Options,
        tolerance: f64,
        progress: &'o mut dyn FnMut(&Progress),
    ) -> Self {
        Run {
            leaf,
            whole: None,
            solved: leaf.rods(),
            planar: leaf.planar(),
            effects: [None; 2],
            options,
            tolerance,
            progress,
            work: Work::default(),
            saddle: None,
            levels: Vec::new(),
            between: None,
            change: None,
            table: Richardson::default(),
            index: None,
            remaining: 0.0,
            spent: 0,
            pushes: 0,
            last: None,
        }
    }

    /// The run as if it had been one of the whole leaf.
    fn completed(mut self, whole: &'a Leaf) -> Self {
        let reduced = self.leaf;
        let complete = |level: &Level| complete(reduced, whole, level);
        self.levels = self.levels.iter().map(complete).collect();
        self.between = self.between.as_ref().map(complete);
        self.leaf = whole;
        self.tabulate();
        self
    }

    fn solve(&mut self, grid: Grid) -> End {
        if let Err(settled) = self.land(grid) {
            return End::Failed(settled);
        }
        loop {
            if self.accurate() || self.accurate_with_between() {
                match self.judge_stability() {
                    Ok(()) => return End::Rest,
                    Err(None) => {}
                    Err(Some(settled)) => return End::Failed(settled),
                }
            }
            if self.late() {
                return End::Failed(Settled::StepLimit);
            }
            let level = self.levels.last().expect("the leaf has landed");
            let finer = level.leaf.grid.refined();
            let nodes = self.leaf.rods() * finer.segments();
            if self.segments().is_some()
                || finer.segments() > FINEST
                || nodes > MAX_NODES
                || self.beyond_rounding(finer.segments())
            {
                return match self.judge_stability() {
                    Err(Some(settled)) => End::Failed(settled),
                    _ => End::NotAccurate,
                };
            }
            let mut state = prolong(&level.leaf, &level.state);
            if let [.., coarse, middle] = self.levels.as_slice() {
                predict(&coarse.state, &middle.state, &mut state);
            }
            let (level, settled, _) = self.settle(finer, From::Coarser(state));
            self.push(level);
            if !matches!(settled, Settled::Rest(_)) {
                return End::Failed(settled);
            }
        }
    }

    /// Segments of the only grid, if there is to be one.
    fn segments(&self) -> Option<usize> {
        self.options.method.segments()
    }

    /// Whether an unstable equilibrium is wanted as much as a stable one.
    fn keeps_unstable(&self) -> bool {
        matches!(self.options.method, Method::SemiImplicit(how) if how.keep_unstable)
    }

    /// Whether the time allowed is over.
    pub fn late(&self) -> bool {
        past(self.options.deadline)
    }

    /// Whether the tolerance is reached; a fixed grid always is.
    fn accurate(&self) -> bool {
        self.segments().is_some() || self.error().is_some_and(|error| error <= self.tolerance)
    }

    /// Estimate of the error of the best values, relative to the leaf's length:
    /// of the extrapolation, of unfinished iterations, and of rounding.
    pub fn error(&self) -> Option<f64> {
        let segments = self.levels.last()?.leaf.segments();
        let best = self.table.best()?;
        let extrapolation = match self.levels.as_slice() {
            [first, _] if self.too_coarse(first.leaf.segments()) => TWO_COARSE * best.error,
            _ => best.error.max(self.change.unwrap_or(0.0)),
        };
        let growth = match self.between {
            Some(_) => EXTRAPOLATED_BETWEEN,
            None => EXTRAPOLATED,
        };
        Some(extrapolation + growth * self.remaining + ROUNDING * segments as f64)
    }

    /// Whether unfinished iterations and rounding alone are more than the
    /// tolerance on a grid of so many `segments`, and already on the present one
    /// most of the error: no refinement helps then.
    pub fn beyond_rounding(&self, segments: usize) -> bool {
        let floor = EXTRAPOLATED * self.remaining + ROUNDING * segments as f64;
        floor > self.tolerance && self.error().is_some_and(|error| error <= 2.0 * floor)
    }

    /// From the start to rest on the first grid that resolves it. A leaf that
    /// had to move far must land in the same place on two grids.
    fn land(&mut self, mut grid: Grid) -> Result<(), Settled> {
        let mut landed: Option<Level> = None;
        loop {
            let (level, settled, moved) = self.settle(grid.clone(), From::Start);
            let finer = grid.refined();
            let fixed = self.segments().is_some();
            let last = fixed || finer.segments() > FINEST_LANDING || self.late();
            match settled {
                // Where a leaf that moves lands is not for so coarse a grid to say.
                _ if self.too_coarse(level.leaf.segments())
                    && (moved
                        || !matches!(settled, Settled::Rest(_))
                        || largest_turn(&level) > COARSEST_TURN) => {}
                _ if self.whole.is_some() && !matches!(settled, Settled::Rest(_)) => {
                    self.push(level);
                    return Err(settled);
                }
                Settled::Rest(_) if !moved || last => {
                    self.push(level);
                    return Ok(());
                }
                Settled::Rest(_) => {
                    if let Some(coarser) = landed.take()
                        && distance(&coarser, &level) < SAME_PLACE
                    {
                        self.push(coarser);
                        self.push(level);
                        return Ok(());
                    }
                    landed = Some(level);
                }
                Settled::Unresolved
                    if finer.segments() <= FINEST_RESOLVING
                        && !fixed
                        && self.spent <= BUDGET
                        && !self.late() =>
                {
                    landed = None;
                }
                _ if last || self.spent > BUDGET => {
                    self.push(level);
                    return Err(settled);
                }
                _ => landed = None,
            }
            grid = finer;
        }
    }

    /// Whether a grid is one for leaves only that settle where they start.
    fn too_coarse(&self, segments: usize) -> bool {
        self.segments().is_none() && segments < COARSEST
    }

    /// Adds the next finer grid.
    fn push(&mut self, level: Level) {
        self.drop_between();
        let segments = level.leaf.segments();
        let stride = match self.levels.first() {
            Some(first) => segments / first.leaf.segments(),
            None => 1,
        };
        self.table.push(segments, report::positions(&level, stride));
        self.levels.push(level);
    }
}

/// Largest rotation between the ends of a segment.
fn largest_turn(level: &Level) -> f64 {
    let n = level.leaf.segments();
    let rods = level.state.q.chunks_exact(n + 1);
    rods.flat_map(|rod| rod.windows(2))
        .map(|ends| ends[0].angle_between(ends[1]))
        .fold(0.0, f64::max)
}

/// Largest distance between a level and the next finer one at common stations.
fn distance(coarse: &Level, fine: &Level) -> f64 {
    let (a, b) = (report::positions(coarse, 1), report::positions(fine, 2));
    a.iter().zip(&b).fold(0.0, |m, (a, b)| m.max((a - b).abs()))
}
