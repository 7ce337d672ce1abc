//! From a free start to held tips: the grips are moved quasi-statically.
//!
//! A leaf with a held tip may have many equilibria, and the one it reaches depends on the
//! loading path. The path here is that of a testing machine: the leaf is gripped where a free
//! start has its tips, and the grips move and rotate uniformly to their final positions, with
//! the leaf at rest at every step. Where a grip is a spring, its other end moves. A step after which it is not near is shortened: where the
//! shortest does not help, the leaf has lost its stability.

use crate::homotopy::{StepEnd, StepSizes};
use crate::leaf::{BucklingMode, DiscreteLeaf, GrippedNode, SpringEnd, State, System};
use crate::newton::{DefiniteSolver, EquilibriumFailure, NewtonEquations, NewtonIteration};
use crate::relax::log::WorkLog;
use crate::relax::path::{Event, StabilityLoss, Stage};
use crate::relax::plan::{RelaxationProblem, WORK};
use crate::relax::saddle;
use crate::relax::solve_on_grid::start::{FAR_FROM_REST, GridRelaxation};
use crate::rotation;
use glam::{DQuat, DVec3};
use std::f64::consts::{PI, TAU};

/// How far holders and the leaf may move in a step. Half of the first two double the number of steps.
struct GripStepLimits {
    /// Largest displacement of a holder, in lengths of the leaf.
    displacement: f64,
    /// Largest rotation of a holder, radians.
    rotation: f64,
    /// The largest change of the leaf beside that of its holders (radians, lengths), in the valley of its
    /// energy: one that moves farther may have left its equilibrium.
    drift: f64,
    /// The largest such change of a leaf that left the valley of its energy.
    drift_outside_valley: f64,
}

const LIMITS: GripStepLimits = GripStepLimits {
    displacement: 0.1,
    rotation: 0.4,
    drift: 0.5,
    drift_outside_valley: 0.05,
};

/// Steps along the path, of which the first and the longest are those in which the grips move by that.
const STEPS: StepSizes = StepSizes {
    first: 1.0,
    shortest: 1.0 / 32.0,
    longest: 1.0,
    growth: 2.0,
    failure: 0.25,
};

/// Accuracy of the equilibria along the path, lengths and radians.
const ACCURACY: f64 = 1e-2;

/// Newton iterations of a step.
const ITERATIONS: usize = 8;

/// Largest increment of these, radians and lengths.
const LARGEST_INCREMENT: f64 = 1.0;

/// Saddles that are left in a step.
const MAX_SADDLE_ESCAPES: i32 = 3;

/// How a leaf came to where it is held.
pub struct HeldState {
    pub state: State,
    /// Whether the leaf is at rest where it is held.
    pub near_rest: bool,
    /// Whether its energy was not convex along the path.
    pub left_convex_valley: bool,
    /// Where the path lost its stability.
    pub events: Vec<Event>,
}

/// Moves tips and other nodes from their positions in `state` to those where they are held.
pub fn move_grips(
    problem: &RelaxationProblem,
    leaf: &DiscreteLeaf,
    state: State,
    effort: &mut WorkLog,
) -> HeldState {
    let holders = SupportPaths {
        tips: tip_paths(leaf, &state).unwrap_or_default(),
        grips: (0..leaf.rods())
            .flat_map(|j| {
                leaf.rod_grips(j)
                    .map(|held| GripPath::from_start(*held, &state))
            })
            .collect(),
    };
    let spring_starts = leaf.grip_spring_ends(&state);
    let [way, turn] = leaf.grip_spring_way(&spring_starts);
    let spring_steps = (way / LIMITS.displacement).max(turn / LIMITS.rotation);
    let longest = 1.0 / holders.steps().max(spring_steps.ceil());
    let steps = StepSizes {
        first: longest,
        shortest: STEPS.shortest * longest,
        longest,
        ..STEPS
    };
    let (limit, begun) = (&problem.options.limit, effort.work.force_evaluations);
    let ignored: &mut dyn FnMut(usize, f64) = &mut |_, _| {};
    let mut continuation = SupportContinuation {
        on_path: leaf.clone(),
        leaf,
        spring_starts,
        system: System::new(leaf),
        held: GridRelaxation::new(state, ACCURACY, &mut effort.work, ignored, limit),
        keeps_unstable: problem.keeps_unstable(),
        events: Vec::new(),
    };
    continuation.relax_held_leaf(&holders);
    // Out of time, the leaf is placed where it is held from where it came to.
    let _ = steps.follow(|step| {
        if limit.reached() {
            return StepEnd::Ended(());
        }
        match continuation.step(&holders, step.to, step.is_shortest) {
            true => StepEnd::Made {
                growth: STEPS.growth,
            },
            false => StepEnd::TooLong(()),
        }
    });
    let SupportContinuation { held, events, .. } = continuation;
    let (mut state, near_rest, moved) = (held.state, held.near_rest, held.left_convex_valley);
    effort.node_evaluations += WORK.nodes(leaf) * (effort.work.force_evaluations - begun);
    leaf.place_held_nodes(&mut state);
    HeldState {
        state,
        near_rest,
        left_convex_valley: moved || !events.is_empty(),
        events,
    }
}

/// A leaf at rest while its holders are moved.
struct SupportContinuation<'a> {
    /// The leaf with its holders in their places.
    leaf: &'a DiscreteLeaf,
    /// The leaf with the springs of its grips where they are on the path.
    on_path: DiscreteLeaf,
    /// Where the springs of grips begin on the path.
    spring_starts: Vec<SpringEnd>,
    system: System,
    held: GridRelaxation<'a>,
    keeps_unstable: bool,
    events: Vec<Event>,
}

impl SupportContinuation<'_> {
    /// Brings the leaf to rest where its holders take it.
    fn relax_held_leaf(&mut self, holders: &SupportPaths) {
        self.carry_to_lambda(holders, 0.0);
        let rest = self.relax_roughly();
        self.held.near_rest = match rest {
            Err(EquilibriumFailure::Saddle) if !self.keeps_unstable => {
                self.branch_aside(0.0).is_ok()
            }
            _ => rest.is_ok(),
        };
    }

    /// Carries what is held, and the springs of grips, to a part of their paths.
    fn carry_to_lambda(&mut self, holders: &SupportPaths, part: f64) {
        (self.on_path).place_grip_springs(self.leaf, &self.spring_starts, part);
        holders.carry_to_lambda(self.leaf, part, &mut self.held.state);
    }

    /// Makes a step to a part of the path. False, with the leaf as it was, if it should be shorter, as
    /// no equilibrium near the last one was found; the `shortest` is made in any case.
    fn step(&mut self, holders: &SupportPaths, part: f64, shortest: bool) -> bool {
        let (before, moved, near_rest) = (
            self.held.state.clone(),
            self.held.left_convex_valley,
            self.held.near_rest,
        );
        self.carry_to_lambda(holders, part);
        let carried = self.held.state.clone();
        self.held.left_convex_valley = false;
        let rest = match shortest || !near_rest {
            true => self.relax_roughly(),
            false => self.correct(),
        };
        let drift = carried.distance(&self.held.state);
        let jumped = drift > LIMITS.drift
            || self.held.left_convex_valley && drift > LIMITS.drift_outside_valley;
        if !shortest && near_rest && (rest.is_err() || jumped) {
            (self.held.state, self.held.left_convex_valley) = (before, moved);
            return false;
        }
        self.held.left_convex_valley |= moved;
        let rest = match rest {
            Err(EquilibriumFailure::Saddle) if !self.keeps_unstable => self.branch_aside(part),
            rest => {
                if jumped && near_rest {
                    self.record_event(part, StabilityLoss::Snapped);
                }
                rest.map(|_| ())
            }
        };
        self.held.near_rest = rest.is_ok();
        true
    }

    /// From the saddle to which the leaf came it turns to one of its sides.
    fn branch_aside(&mut self, part: f64) -> Result<(), EquilibriumFailure> {
        let (leaf, saddle) = (&self.on_path, self.held.state.clone());
        let system = &mut self.system;
        if !saddle::find_unstable_mode(leaf, &saddle, system, DVec3::ZERO, self.held.work) {
            return Err(EquilibriumFailure::Saddle);
        }
        let mode = self.system.solution();
        let sides = [1.0, -1.0].map(|sign| {
            self.held.state.clone_from(&saddle);
            self.system.set_solution(&mode);
            saddle::displace(&self.on_path, &mut self.held.state, &self.system, sign);
            self.leave_saddles().ok()?;
            Some(saddle::SideOfSaddle::new(
                &self.on_path,
                self.held.state.clone(),
            ))
        });
        let side = saddle::lower_energy_side(sides).ok_or(EquilibriumFailure::Saddle)?;
        self.held.state = side.state;
        let equally_open = side.equally_open;
        let mode = BucklingMode::of_increments(&saddle, &mode);
        self.record_event(part, StabilityLoss::Branched { equally_open, mode });
        Ok(())
    }

    /// Brings a leaf that was pushed off a saddle to rest, off others, too.
    fn leave_saddles(&mut self) -> Result<f64, EquilibriumFailure> {
        for pushes in 1..MAX_SADDLE_ESCAPES {
            self.held.saddle_escapes = pushes;
            let rest = self.relax_roughly();
            self.held.saddle_escapes = 0;
            if rest != Err(EquilibriumFailure::Saddle) {
                return rest;
            }
            let (system, state) = (&mut self.system, &mut self.held.state);
            saddle::escape_saddle(&self.on_path, state, system, DVec3::ZERO, self.held.work);
        }
        Err(EquilibriumFailure::Saddle)
    }

    /// Newton's method from where the leaf was carried to the equilibrium nearby, through convex states
    /// only.
    fn correct(&mut self) -> Result<f64, EquilibriumFailure> {
        let newton = NewtonIteration {
            accuracy: ACCURACY,
            iterations: ITERATIONS,
            work: self.held.work,
            progress: self.held.progress,
        };
        self.held.solver = DefiniteSolver::default();
        let equations = NewtonEquations::Definite {
            solver: &mut self.held.solver,
            largest: LARGEST_INCREMENT,
            shifted: false,
            cg_tolerance: FAR_FROM_REST,
        };
        let (leaf, state, system) = (&self.on_path, &mut self.held.state, &mut self.system);
        let rest = newton.solve(leaf, state, system, equations)?;
        // The last matrix was that of the state before.
        let shift = leaf.neutral_shift();
        match saddle::index(leaf, state, system, shift, self.held.work) {
            Some(0) => Ok(rest),
            _ => Err(EquilibriumFailure::Saddle),
        }
    }

    /// Brings the leaf roughly to rest with its holders fixed.
    fn relax_roughly(&mut self) -> Result<f64, EquilibriumFailure> {
        self.held.solver = DefiniteSolver::default();
        self.held
            .relax_semi_implicitly(&self.on_path, &mut self.system)
    }

    fn record_event(&mut self, part: f64, happening: StabilityLoss) {
        self.events.push(Event {
            stage: Stage::Moving,
            part,
            happening,
        });
    }
}

/// The paths of all that is held.
struct SupportPaths {
    tips: Vec<TipPath>,
    grips: Vec<GripPath>,
}

impl SupportPaths {
    /// The number of the longest steps along the path, at least one.
    fn steps(&self) -> f64 {
        let tips = self.tips.iter().map(TipPath::steps);
        tips.chain(self.grips.iter().map(GripPath::steps))
            .fold(1.0, f64::max)
    }

    /// Carries what is held to a part of the path, and the nodes between in proportion.
    fn carry_to_lambda(&self, leaf: &DiscreteLeaf, part: f64, state: &mut State) {
        for (j, path) in self.tips.iter().enumerate() {
            path.move_tip(leaf, j, part, state);
        }
        carry_gripped_nodes(leaf, &self.grips, part, state);
    }
}

/// The path of the tip of a rod from a free start to its holder.
struct TipPath {
    from: DVec3,
    to: DVec3,
    clamp: Option<ClampTurn>,
}

/// How the tip of a rod turns on its way from a free start to a clamp.
#[derive(Clone, Copy)]
struct ClampTurn {
    /// The angle of d1 about e3 at the start and in the clamp, radians.
    headings: [f64; 2],
    /// The twist about d1 in the clamp, radians.
    twist: f64,
    /// The rest of the start's rotation, which is removed along the path.
    other: DVec3,
}

/// The paths of all tips; `None` if they are free.
fn tip_paths(leaf: &DiscreteLeaf, start: &State) -> Option<Vec<TipPath>> {
    let held = leaf.leaf.tip_support.as_ref()?;
    let path = |j: usize| TipPath {
        from: start.tip(j),
        to: held.position,
        clamp: held.clamps.as_ref().map(|clamps| {
            let rod = &start.q[start.base(j)..=start.base(j) + leaf.segments()];
            let tip = rod[leaf.segments()];
            let heading = heading(rod);
            let other = DQuat::from_rotation_z(heading).conjugate() * tip;
            ClampTurn {
                headings: [heading, clamps[j].angle],
                twist: clamps[j].twist,
                other: rotation::log(other),
            }
        }),
    };
    Some((0..leaf.rods()).map(path).collect())
}

/// The angle of d1 about e3 at the last of these nodes, continued from the first: full turns
/// count.
fn heading(rod: &[DQuat]) -> f64 {
    let angle = |q: &DQuat| {
        let d1 = *q * DVec3::X;
        d1.y.atan2(d1.x)
    };
    let turns = rod.windows(2).map(|ends| {
        let turn = angle(&ends[1]) - angle(&ends[0]);
        (turn + PI).rem_euclid(TAU) - PI
    });
    angle(&rod[0]) + turns.sum::<f64>()
}

impl TipPath {
    /// The number of steps along the path.
    fn steps(&self) -> f64 {
        let turn = self.clamp.map_or(0.0, |clamp| {
            let [from, to] = clamp.headings;
            (to - from).abs() + clamp.twist.abs() + clamp.other.length()
        });
        (self.from.distance(self.to) / LIMITS.displacement)
            .max(turn / LIMITS.rotation)
            .ceil()
    }

    /// Moves the tip of rod `j` to the fraction `part` of the path, and every node with it in
    /// proportion to its distance from the base.
    fn move_tip(&self, leaf: &DiscreteLeaf, j: usize, part: f64, state: &mut State) {
        let base = state.base(j);
        let tip = base + leaf.segments();
        let shift = self.from.lerp(self.to, part) - state.x[tip];
        let turn = self.clamp.map(|clamp| {
            let [from, to] = clamp.headings;
            let heading = DQuat::from_rotation_z(from + part * (to - from));
            let rotation = heading
                * DQuat::from_rotation_x(part * clamp.twist)
                * rotation::exp((1.0 - part) * clamp.other);
            rotation::log(rotation * state.q[tip].conjugate())
        });
        for (i, &sigma) in leaf.grid.sigma().iter().enumerate().skip(1) {
            state.x[base + i] += sigma * shift;
            if let Some(turn) = turn {
                state.q[base + i] = (rotation::exp(sigma * turn) * state.q[base + i]).normalize();
            }
        }
    }
}

/// The path of a node from where it is to where a grip holds it.
struct GripPath {
    held: GrippedNode,
    from: DVec3,
    turn: DVec3,
}

impl GripPath {
    fn from_start(held: GrippedNode, start: &State) -> Self {
        let k = start.base(held.rod) + held.node;
        let turn = |to: DQuat| rotation::log(to * start.q[k].conjugate());
        GripPath {
            held,
            from: start.x[k],
            turn: held.rotation.map_or(DVec3::ZERO, turn),
        }
    }

    /// The number of steps along the path.
    fn steps(&self) -> f64 {
        let way = self.held.position - self.from;
        let distance = DVec3::select(self.held.held_axes, way, DVec3::ZERO).length();
        (distance / LIMITS.displacement)
            .max(self.turn.length() / LIMITS.rotation)
            .ceil()
    }
}

/// Carries gripped nodes to the fraction `part` of their paths. The nodes between two of them, or
/// one and the end of the vein, are displaced in proportion to their distances.
fn carry_gripped_nodes(leaf: &DiscreteLeaf, paths: &[GripPath], part: f64, state: &mut State) {
    let (n, sigma) = (leaf.segments(), leaf.grid.sigma());
    for j in 0..leaf.rods() {
        let base = state.base(j);
        let mut before = NodeDisplacement {
            node: 0,
            shift: DVec3::ZERO,
        };
        let fixed_tip = leaf.leaf.tip_support.is_some() || leaf.tips_move_together();
        let of_rod: Vec<&GripPath> = paths.iter().filter(|path| path.held.rod == j).collect();
        for path in &of_rod {
            let node = path.held.node;
            let shift = path.from.lerp(path.held.position, part) - state.x[base + node];
            let shift = DVec3::select(path.held.held_axes, shift, DVec3::ZERO);
            let here = NodeDisplacement { node, shift };
            interpolate_displacements(sigma, [before, here], |i, shift| state.x[base + i] += shift);
            state.x[base + node] += shift;
            if let Some(rotation) = path.held.rotation {
                let left = rotation::exp((part - 1.0) * path.turn);
                state.q[base + node] = (left * rotation).normalize();
            }
            before = here;
        }
        if !of_rod.is_empty() && before.node < n {
            let shift = if fixed_tip { DVec3::ZERO } else { before.shift };
            let end = NodeDisplacement { node: n, shift };
            interpolate_displacements(sigma, [before, end], |i, shift| state.x[base + i] += shift);
            if !fixed_tip {
                state.x[base + n] += shift;
            }
        }
    }
}

/// The displacement of a node of a rod.
#[derive(Clone, Copy)]
struct NodeDisplacement {
    node: usize,
    shift: DVec3,
}

/// Passes the nodes between two nodes, with their displacements interpolated.
fn interpolate_displacements(
    sigma: &[f64],
    [from, to]: [NodeDisplacement; 2],
    mut each: impl FnMut(usize, DVec3),
) {
    for i in from.node + 1..to.node {
        let part = (sigma[i] - sigma[from.node]) / (sigma[to.node] - sigma[from.node]);
        each(i, from.shift.lerp(to.shift, part));
    }
}
