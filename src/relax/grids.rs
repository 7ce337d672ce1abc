//! Nested grids: as fine as the tolerance needs, with an error estimate.

use crate::leaf::{DiscreteLeaf, Grid, Leaf, Solved, State, System, half_of, whole_of};
use crate::relax::equilibrium::{Equilibrium, Saddle, Work};
use crate::relax::explicit;
use crate::relax::modes;
use crate::relax::moment;
use crate::relax::options::{
    MAX_NODES, MOST_MODES, Method, Options, Progress, RelaxError, check_tolerance, past,
};
use crate::relax::prolong::{predict, prolong};
use crate::relax::report;
use crate::relax::richardson::Richardson;
use crate::relax::saddle;
use crate::relax::semi_implicit::{Relaxation, Settled};
use crate::relax::shooting;
use crate::relax::start::{disturb, start};
use crate::scenario::Scenario;
use glam::DVec3;
use std::time::Instant;

/// Segments of the coarsest grid, in two panels or more if profiles have kinks.
const COARSEST: usize = 8;

/// Rotation per segment (radians) that the coarsest grid must resolve where
/// rest curvature and tip moment alone tell it.
const COARSEST_TURN: f64 = 0.8;

/// Segments of the finest grid.
const FINEST: usize = 16_384;

/// Two grids on which the leaf moved far are said to land in the same place
/// if no station differs by more than this, in lengths.
const SAME_PLACE: f64 = 0.05;

/// The finest grid on which landing places are compared.
const FINEST_LANDING: usize = 256;

/// The finest grid that is tried when coarser ones do not resolve the bending.
const FINEST_RESOLVING: usize = 2048;

/// Iteration error allowed on each grid, as a part of the tolerance.
const ITERATION_PART: f64 = 1e-3;

/// Iteration error allowed on a fixed grid, which is there to be compared.
const FIXED_ACCURACY: f64 = 1e-12;

/// Growth of errors of single grids by extrapolation, sum of the weights at most.
const EXTRAPOLATED: f64 = 2.0;

/// Part of the rounding error that grows with the number of segments.
const ROUNDING: f64 = 4e-15;

/// Nodes times force evaluations after which a leaf that has not come to rest
/// is given up: some seconds. But a large one is granted so many evaluations
/// on every grid.
const BUDGET: usize = 3_000_000;
const LEAST_EVALUATIONS: usize = 600;

/// Accuracy, in the energy norm, of the effects of shear and stretch: most of
/// that norm is stretch itself, and displacements are a small part of it.
const EFFECT_ACCURACY: f64 = 1e-5;

/// A leaf whose lowest eigenvalue (over the masses; that of a clamped rod is 12)
/// is larger than this one step before rest is stable at rest.
const CLEARLY: f64 = 1e-2;

/// Saddles that are left before the run is given up.
const MAX_SADDLES: i32 = 10;

/// A leaf settled on one grid.
pub(super) struct Level<'a> {
    pub leaf: DiscreteLeaf<'a>,
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
    if options.method == Method::Shooting {
        return shooting::relax(scenario, options, tolerance);
    }
    if let Some(found) = options.intervals {
        return Err(RelaxError::NoIntervals { found });
    }
    let clock = Instant::now();
    let leaf = Leaf::new(scenario);
    if options.method == Method::Explicit {
        explicit::check(&leaf, options)?;
    }
    let first = check_segments(&leaf, options.segments, COARSEST)?;
    let half = match reducible(options) {
        true => leaf.half(),
        false => None,
    };
    let grid = Grid::new(first, leaf.kinks());
    let mut work = Work::default();
    if let Some(half) = &half {
        let mut run = Run::new(half, options, tolerance, progress);
        run.whole = Some(&leaf);
        let end = run.solve(grid.clone());
        if matches!(end, End::Rest | End::NotAccurate) && run.index == Some(0) {
            let run = run.completed(&leaf);
            return Ok(finished(run, end, clock));
        }
        // The whole leaf has something to say: it moves out of its valley, or
        // breaks the mirror.
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
    Equilibrium {
        modes,
        ..report::equilibrium(run, outcome, remark, seconds)
    }
}

/// Whether half of a leaf may be solved for the whole: where the way to rest
/// is Newton's, which knows no other way than the shape it starts from.
fn reducible(options: &Options) -> bool {
    options.method == Method::SemiImplicit
        && !options.keep_unstable
        && !options.full_model
        && options.disturbance.is_none()
}

/// Segments of a grid: so many as asked for, or at least `least`, as many as
/// the kinks of the profiles, the rest shape and the tip moment need.
///
/// # Errors
/// If that is too few or too many.
pub fn check_segments(
    leaf: &Leaf,
    asked: Option<usize>,
    least: usize,
) -> Result<usize, RelaxError> {
    let panels = leaf.kinks().len() + 1;
    let segments = match asked {
        Some(found) if found < panels => {
            return Err(RelaxError::TooFewSegments {
                found,
                least: panels,
            });
        }
        Some(segments) => segments,
        None => coarsest(leaf, least).max(panels),
    };
    let nodes = leaf.rods().saturating_mul(segments);
    if nodes > MAX_NODES {
        return Err(RelaxError::TooManyNodes {
            rods: leaf.rods(),
            segments,
            nodes,
        });
    }
    Ok(segments)
}

/// Segments of the coarsest grid.
pub(super) fn coarsest(leaf: &Leaf, least: usize) -> usize {
    let moment = leaf.tip_moment.length();
    let turn = (0..leaf.rods())
        .map(|j| {
            let section = leaf.section(j, 0.5, 1.0);
            (section.rest_curvature.length() + moment / section.couple_stiffness.min_element())
                * leaf.length(j)
        })
        .fold(0.0, f64::max);
    let mut segments = least;
    while (segments as f64) * COARSEST_TURN < turn && segments < FINEST {
        segments *= 2;
    }
    segments
}

/// Where settling on a grid begins.
enum From {
    Start,
    /// The equilibrium of the next coarser grid, prolonged.
    Coarser(State),
    /// A saddle the leaf was pushed off.
    Pushed(State),
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
    pub leaf: &'a Leaf<'a>,
    /// The whole leaf, if `leaf` is half of it.
    whole: Option<&'a Leaf<'a>>,
    /// Rods solved for.
    pub solved: usize,
    /// What neglecting shear, and stretch, would change.
    pub effects: [Option<f64>; 2],
    pub options: &'o Options,
    pub tolerance: f64,
    progress: &'o mut dyn FnMut(&Progress),
    pub work: Work,
    pub saddle: Option<Saddle>,
    pub levels: Vec<Level<'a>>,
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
        leaf: &'a Leaf<'a>,
        options: &'o Options,
        tolerance: f64,
        progress: &'o mut dyn FnMut(&Progress),
    ) -> Self {
        Run {
            leaf,
            whole: None,
            solved: leaf.rods(),
            effects: [None; 2],
            options,
            tolerance,
            progress,
            work: Work::default(),
            saddle: None,
            levels: Vec::new(),
            table: Richardson::default(),
            index: None,
            remaining: 0.0,
            spent: 0,
            pushes: 0,
            last: None,
        }
    }

    /// The run as if it had been one of the whole leaf.
    fn completed(mut self, whole: &'a Leaf<'a>) -> Self {
        self.table = Richardson::default();
        for level in std::mem::take(&mut self.levels) {
            self.push(complete(self.leaf, whole, &level));
        }
        self.leaf = whole;
        self
    }

    fn solve(&mut self, grid: Grid) -> End {
        if let Err(settled) = self.land(grid) {
            return End::Failed(settled);
        }
        loop {
            if self.accurate() {
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
            if self.options.segments.is_some()
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

    /// Whether the time allowed is over.
    pub fn late(&self) -> bool {
        past(self.options.deadline)
    }

    /// Whether the tolerance is reached; a fixed grid always is.
    fn accurate(&self) -> bool {
        self.options.segments.is_some() || self.error().is_some_and(|error| error <= self.tolerance)
    }

    /// Estimate of the error of the best values, relative to the leaf's length:
    /// of the extrapolation, of unfinished iterations, and of rounding.
    pub fn error(&self) -> Option<f64> {
        let segments = self.levels.last()?.leaf.segments();
        let best = self.table.best()?;
        Some(best.error + EXTRAPOLATED * self.remaining + ROUNDING * segments as f64)
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
            let fixed = self.options.segments.is_some();
            let last = fixed || finer.segments() > FINEST_LANDING || self.late();
            match settled {
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

    fn push(&mut self, level: Level<'a>) {
        let stride = match self.levels.first() {
            Some(first) => level.leaf.segments() / first.leaf.segments(),
            None => 1,
        };
        self.table.push(report::positions(&level, stride));
        self.levels.push(level);
    }

    /// Settles on one grid; leaves saddles
    /// unless they are wanted. Tells whether the leaf had to move, not only to
    /// settle in the valley it was in.
    fn settle(&mut self, grid: Grid, from: From) -> (Level<'a>, Settled, bool) {
        self.last = None;
        let leaf = DiscreteLeaf::new(self.leaf, grid);
        let mut near_rest = matches!(from, From::Coarser(_));
        let mut state = match from {
            From::Start => match self.whole {
                None => {
                    let mut state = start(&leaf);
                    if let Some(number) = self.options.disturbance {
                        disturb(&leaf, number, &mut state);
                    }
                    state
                }
                Some(whole) => {
                    let whole = DiscreteLeaf::new(whole, leaf.grid.clone());
                    half_of(self.leaf, &start(&whole))
                }
            },
            From::Coarser(state) | From::Pushed(state) => state,
        };
        let mut system = System::new(&leaf);
        let accuracy = match self.options.segments {
            Some(_) => FIXED_ACCURACY,
            None => ITERATION_PART * self.tolerance,
        };
        let segments = leaf.segments();
        let progress = &mut *self.progress;
        let mut tell = |step: usize, residual: f64| {
            progress(&Progress {
                grid: segments,
                step,
                residual,
            });
        };
        if self.options.method == Method::Explicit {
            let mut request = explicit::Request {
                accuracy,
                near_rest,
                work: &mut self.work,
                progress: &mut tell,
                moved: false,
                deadline: self.options.deadline,
            };
            let settled = explicit::settle(&leaf, &mut state, &mut system, &mut request);
            if let Settled::Rest(remaining) = settled {
                self.remaining = self.remaining.max(remaining);
            }
            return (Level { leaf, state }, settled, request.moved);
        }
        if leaf.tip_moment() != DVec3::ZERO {
            let mut leaf = leaf;
            let settled = moment::settle(
                &mut leaf,
                &mut state,
                &mut system,
                accuracy,
                near_rest,
                &mut self.work,
                &mut tell,
            );
            return (Level { leaf, state }, settled, false);
        }
        if self.options.keep_unstable {
            let settled = saddle::newton(
                &leaf,
                &mut state,
                &mut system,
                accuracy,
                saddle::MAX_ITERATIONS,
                &mut self.work,
                &mut tell,
            );
            return (Level { leaf, state }, settled, false);
        }
        let nodes = leaf.rods() * segments;
        let allowed = (BUDGET.saturating_sub(self.spent) / nodes).max(LEAST_EVALUATIONS);
        let begun = self.work.force_evaluations;
        let mut moved = false;
        for pushes in 0..MAX_SADDLES {
            let mut relaxation = Relaxation {
                state,
                accuracy,
                work: &mut self.work,
                progress: &mut tell,
                near_rest,
                pushes,
                direct: None,
                most_evaluations: begun + allowed,
                deadline: self.options.deadline,
                convex_only: self.whole.is_some(),
                moved: false,
            };
            let before = relaxation.work.force_evaluations;
            let settled = relaxation.settle(&leaf, &mut system);
            self.spent += nodes * (relaxation.work.force_evaluations - before);
            moved |= relaxation.moved;
            let direct = relaxation.direct.is_some();
            state = relaxation.state;
            if let Settled::Rest(remaining) = settled {
                self.remaining = self.remaining.max(remaining);
                if self.levels.is_empty() && !direct {
                    self.effects = effects(&leaf, &state, &mut system);
                }
            }
            if self.whole.is_some() && !matches!(settled, Settled::Rest(_)) {
                return (Level { leaf, state }, settled, moved);
            }
            if settled != Settled::Saddle {
                self.last = (!direct && matches!(settled, Settled::Rest(_))).then_some(system);
                return (Level { leaf, state }, settled, moved);
            }
            match saddle::polish(&leaf, &mut state, &mut system, &mut self.work) {
                Some(Some(0)) => {
                    return (Level { leaf, state }, Settled::Rest(accuracy), moved);
                }
                Some(Some(index)) => self.saddle = Some(saddle_of(&leaf, &state, index)),
                _ => {}
            }
            saddle::push_off(&leaf, &mut state, &mut system, &mut self.work);
            near_rest = false;
        }
        (Level { leaf, state }, Settled::StepLimit, moved)
    }

    /// Counts the negative eigenvalues on the finest grid. At a wanted saddle
    /// they must be as many as on the grid before. At one that is not wanted,
    /// the leaf is pushed off and the grids begin anew from where it lands.
    /// `Err(None)`: go on refining.
    fn judge_stability(&mut self) -> Result<(), Option<Settled>> {
        let level = self.levels.last().expect("the leaf has landed");
        if level.leaf.tip_moment() != DVec3::ZERO {
            return Ok(());
        }
        if let Some(whole) = self.whole {
            let Level { leaf, state } = complete(self.leaf, whole, level);
            let mut system = System::new(&leaf);
            self.index = saddle::index(&leaf, &state, &mut system, 0.0, &mut self.work);
            return match self.index {
                Some(0) => Ok(()),
                _ => Err(Some(Settled::Saddle)),
            };
        }
        let before = self.index;
        if let Some(mut system) = self.last.take() {
            // It is that of the leaf at rest, or before a last small step.
            self.work.factorizations += 1;
            if system.stable_without_coupling(-CLEARLY) {
                self.index = Some(0);
                return Ok(());
            }
        }
        let mut system = System::new(&level.leaf);
        self.index = saddle::index(&level.leaf, &level.state, &mut system, 0.0, &mut self.work);
        if !matches!(self.index, Some(1..)) {
            return Ok(());
        }
        if self.options.keep_unstable {
            return if before == self.index || self.options.segments.is_some() {
                Ok(())
            } else {
                Err(None)
            };
        }
        let mut level = self.levels.pop().expect("the leaf has landed");
        let exact = saddle::polish(&level.leaf, &mut level.state, &mut system, &mut self.work);
        self.index = exact.flatten().or(self.index);
        let Some(index @ 1..) = self.index else {
            self.levels.push(level);
            return Ok(());
        };
        self.saddle = Some(saddle_of(&level.leaf, &level.state, index));
        self.pushes += 1;
        if self.pushes > MAX_SADDLES {
            self.levels.push(level);
            return Err(Some(Settled::StepLimit));
        }
        let mut state = level.state;
        saddle::push_off(&level.leaf, &mut state, &mut system, &mut self.work);
        let (level, settled, _) = self.settle(level.leaf.grid.clone(), From::Pushed(state));
        self.levels.clear();
        self.table = Richardson::default();
        self.push(level);
        match settled {
            Settled::Rest(_) if self.options.segments.is_some() => self.judge_stability(),
            Settled::Rest(_) => Err(None),
            _ => Err(Some(settled)),
        }
    }
}

/// The whole leaf of which half is settled.
fn complete<'a>(half: &Leaf, whole: &'a Leaf<'a>, level: &Level) -> Level<'a> {
    Level {
        leaf: DiscreteLeaf::new(whole, level.leaf.grid.clone()),
        state: whole_of(half, &level.state),
    }
}

/// Largest displacements if the leaf neither sheared, or did not stretch, to
/// first order; with the factorisation that the last iteration left.
fn effects(leaf: &DiscreteLeaf, state: &State, system: &mut System) -> [Option<f64>; 2] {
    [DVec3::new(0.0, 1.0, 1.0), DVec3::X].map(|dropped| {
        leaf.assemble_stiffening(state, dropped, system);
        match system.solve(None, EFFECT_ACCURACY) {
            Solved::Yes(_) => Some(system.largest().1),
            _ => None,
        }
    })
}

/// What is said of a saddle.
fn saddle_of(leaf: &DiscreteLeaf, state: &State, index: usize) -> Saddle {
    let scale = leaf.leaf.scale;
    Saddle {
        energy: leaf.energy(state) * scale.moment(),
        negative_eigenvalues: index,
        tip: state.tip(0) * scale.length,
    }
}

/// Largest distance between a level and the next finer one at common stations.
fn distance(coarse: &Level, fine: &Level) -> f64 {
    let (a, b) = (report::positions(coarse, 1), report::positions(fine, 2));
    a.iter().zip(&b).fold(0.0, |m, (a, b)| m.max((a - b).abs()))
}
