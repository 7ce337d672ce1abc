//! The path of equilibria on which a leaf is loaded slowly, from the natural leaf to the leaf as it is:
//! a predictor through the last states, Newton's method as corrector, and the Morse index watched; and
//! a bound on the second variation by which veins cannot buckle on it.

pub(super) mod arrival;
pub(super) mod snap;

use crate::homotopy::{PathStep, StepEnd, StepSizes};
use crate::leaf::{DiscreteLeaf, State, System};
use crate::newton::{
    DefiniteSolver, EquilibriumFailure, NewtonEquations, NewtonIteration, SolverCounts,
};
use crate::relax::path::{Event, StabilityLoss, Stage};
use crate::relax::saddle;
use crate::rod::Section;
use crate::rotation;
use crate::run::Limit;
use glam::DVec3;

/// Steps of a stage. Where an index changes is known to the shortest.
const STEPS: StepSizes = StepSizes {
    first: 0.125,
    shortest: 1.0 / 512.0,
    longest: 0.5,
    growth: 2.5,
    failure: 0.25,
};

/// How states on the path of slow loading are predicted and corrected; lengths and radians.
struct LoadStepCorrection {
    /// The distance of a state from its prediction that steps are made for. Half of it makes steps
    /// shorter by a third.
    wanted_drift: f64,
    /// The largest distance accepted: farther away is another equilibrium.
    largest_drift: f64,
    /// Largest increment of Newton's method: the first after the natural leaf may be large.
    largest_increment: f64,
    /// Accuracy of states on the way.
    intermediate_accuracy: f64,
    /// Accuracy of the state at the end of a stage.
    final_accuracy: f64,
    /// Accuracy of a state whose index is in doubt.
    index_accuracy: f64,
    /// Newton iterations of a step.
    iterations: usize,
    /// Newton iterations towards an equilibrium of any index that are made at a time.
    iterations_per_batch: usize,
    /// The part of its motion in the iterations before by which the leaf moves in a batch, or no
    /// equilibrium is near.
    batch_contraction: f64,
    /// Relative accuracy of the first solutions with conjugate gradients.
    cg_tolerance: f64,
}

const CORRECTION: LoadStepCorrection = LoadStepCorrection {
    wanted_drift: 0.1,
    largest_drift: 0.3,
    largest_increment: 2.0,
    intermediate_accuracy: 1e-3,
    final_accuracy: 1e-4,
    index_accuracy: 1e-10,
    iterations: 8,
    iterations_per_batch: 4,
    batch_contraction: 0.25,
    cg_tolerance: 1e-3,
};

/// Number of states through which the next is predicted.
const PREDICTED_THROUGH: usize = 3;

/// A leaf at rest on the path.
struct PathState {
    /// The part of the stage, from 0 to 1.
    lambda: f64,
    state: State,
}

/// An equilibrium that Newton's method found from a prediction.
struct CorrectedState {
    /// Negative eigenvalues of the energy's Hessian.
    index: usize,
    /// Distance from the prediction, lengths or radians.
    drift: f64,
}

/// Slow loading of a leaf on one grid.
pub struct LoadPath<'w> {
    pub loading: LoadedLeaf<'w>,
    pub system: System,
    pub work: &'w mut SolverCounts,
    pub limit: &'w Limit,
    pub progress: &'w mut dyn FnMut(usize, f64),
    /// Count of force evaluations at which the loading ends without success.
    pub most_evaluations: usize,
    pub solver: DefiniteSolver,
    /// The last states at rest, through which the next is predicted.
    previous_states: Vec<PathState>,
    /// The state that is predicted and corrected.
    pub next: State,
    pub events: Vec<Event>,
    /// The stage in which the leaf is, and the part of that.
    pub stage: Stage,
    pub lambda: f64,
    /// Towards which a leaf turns aside that may turn to either side: a force on all nodes.
    pub bias_direction: DVec3,
}

/// Where a step of slow loading led.
enum LoadStepOutcome {
    /// A stable equilibrium so far from its prediction.
    Stable(f64),
    /// An equilibrium with negative eigenvalues.
    Unstable,
    /// Newton's method fails, or leads far away.
    Lost(EquilibriumFailure),
}

impl<'w> LoadPath<'w> {
    /// Begins with the natural leaf.
    pub fn new(
        whole: &'w DiscreteLeaf,
        work: &'w mut SolverCounts,
        progress: &'w mut dyn FnMut(usize, f64),
        limit: &'w Limit,
        most_evaluations: usize,
    ) -> Self {
        let (loading, state) = (LoadedLeaf::new(whole), whole.stress_free_state());
        LoadPath {
            system: System::new(&loading.leaf),
            work,
            limit,
            progress,
            most_evaluations,
            solver: DefiniteSolver::default(),
            next: state.clone(),
            previous_states: vec![PathState { lambda: 0.0, state }],
            events: Vec::new(),
            stage: Stage::Loading,
            lambda: 0.0,
            loading,
            bias_direction: DVec3::ZERO,
        }
    }

    /// Loads the leaf to the end of a stage, as far as it can; the last state and what happened on the way are kept.
    pub fn run(&mut self, last: Stage) -> Result<(), EquilibriumFailure> {
        for stage in self.loading.stages() {
            if stage == Stage::Joining && last == Stage::Loading {
                break;
            }
            let PathState { state, .. } = self.previous_states.pop().expect("the last state");
            self.loading.begin(stage, &state);
            if stage == Stage::Joining {
                // Its tips move together, and its veins will be coupled.
                self.system = System::new(self.loading.whole);
                self.solver = DefiniteSolver::default();
            }
            self.previous_states.clear();
            self.previous_states.push(PathState { lambda: 0.0, state });
            (self.stage, self.lambda) = (stage, 0.0);
            self.follow_stage()?;
        }
        Ok(())
    }

    /// The state in which it ended.
    pub fn last(self) -> State {
        let last = self.previous_states.into_iter().next_back();
        last.map_or(self.next, |last| last.state)
    }

    fn follow_stage(&mut self) -> Result<(), EquilibriumFailure> {
        let sizes = match self.loading.is_short_way() {
            true => StepSizes {
                first: 1.0,
                longest: 1.0,
                ..STEPS
            },
            false => STEPS,
        };
        sizes.follow(|step| {
            if self.work.force_evaluations > self.most_evaluations || self.limit.reached() {
                return StepEnd::Ended(EquilibriumFailure::StepLimit);
            }
            match self.step_to(step.to, step.is_shortest) {
                LoadStepOutcome::Stable(drift) => {
                    self.accept(step.to);
                    let growth = (CORRECTION.wanted_drift / drift).sqrt().min(STEPS.growth);
                    StepEnd::Made { growth }
                }
                LoadStepOutcome::Lost(EquilibriumFailure::Unresolved) => {
                    StepEnd::Ended(EquilibriumFailure::Unresolved)
                }
                LoadStepOutcome::Lost(stop) if !step.is_shortest => StepEnd::TooLong(stop),
                LoadStepOutcome::Unstable if !step.is_shortest => {
                    StepEnd::TooLong(EquilibriumFailure::Saddle)
                }
                lost => self.leave_branch(&lost, step),
            }
        })
    }

    /// Goes on from where the path lost its stability: to one side, or to where the leaf snaps.
    fn leave_branch(
        &mut self,
        lost: &LoadStepOutcome,
        step: &PathStep,
    ) -> StepEnd<EquilibriumFailure> {
        let left = match lost {
            LoadStepOutcome::Unstable => self.branch_aside(step.to),
            _ => self.snap_through(step.to),
        };
        match left {
            Ok(()) => {
                self.previous_states.clear();
                self.accept(step.to);
                StepEnd::Restarted
            }
            Err(stop) => StepEnd::Ended(stop),
        }
    }

    /// Takes the next state as known.
    fn accept(&mut self, part: f64) {
        self.lambda = part;
        if self.previous_states.len() == PREDICTED_THROUGH {
            self.previous_states.rotate_left(1);
            let last = self.previous_states.last_mut().expect("states");
            last.lambda = part;
            last.state.clone_from(&self.next);
        } else {
            let state = self.next.clone();
            self.previous_states.push(PathState {
                lambda: part,
                state,
            });
        }
    }

    /// Carries the last state at rest to another part.
    pub fn carry_last(&mut self, part: f64) {
        let last = self.previous_states.last().expect("states");
        self.next.clone_from(&last.state);
        (self.loading).carry_to_lambda([last.lambda, part], &mut self.next);
        self.system.set_coupling(&self.loading.leaf);
    }

    /// Predicts the state at another part.
    fn predict(&mut self, part: f64) {
        self.carry_last(part);
        if self.previous_states.len() < 2 {
            return;
        }
        let count = self.previous_states.len();
        let weight = |k: usize| {
            let others = (0..count).filter(|other| *other != k);
            let part = others.map(|other| {
                let [own, other] = [k, other].map(|k| self.previous_states[k].lambda);
                (part - other) / (own - other)
            });
            part.product()
        };
        // The last one, which the others change, has the rest of the weight.
        let mut weights = [0.0; PREDICTED_THROUGH];
        (0..count - 1).for_each(|k| weights[k] = weight(k));
        let last = &self.previous_states[count - 1].state;
        let others = || self.previous_states[..count - 1].iter().zip(weights);
        for k in 0..last.x.len() {
            let mut shift = DVec3::ZERO;
            let mut turn = DVec3::ZERO;
            for (PathState { state, .. }, weight) in others() {
                shift += weight * (state.x[k] - last.x[k]);
                turn += weight * rotation::log(state.q[k] * last.q[k].conjugate());
            }
            self.next.x[k] = last.x[k] + shift;
            self.next.q[k] = (rotation::exp(turn) * last.q[k]).normalize();
        }
        for k in 0..last.n.len() {
            let change: DVec3 = others()
                .map(|(before, weight)| weight * (before.state.n[k] - last.n[k]))
                .sum();
            self.next.n[k] = last.n[k] + change;
        }
        let tied = others().all(|(before, _)| before.state.tissue.len() == last.tissue.len());
        self.next.tissue.clone_from(&last.tissue);
        for (k, force) in self.next.tissue.iter_mut().enumerate().filter(|_| tied) {
            for (PathState { state, .. }, weight) in others() {
                *force += weight * (state.tissue[k] - last.tissue[k]);
            }
        }
        for j in 0..last.rods() {
            let base = last.base(j);
            self.next.x[base] = last.x[base];
            if !self.loading.leaf.leaf.base_turns(j) {
                self.next.q[base] = last.q[base];
            }
        }
        self.loading.place_tips(&mut self.next);
    }

    /// Predicts and corrects the equilibrium at another part. Where none is found that is surely
    /// stable, one of any index is looked for if `any_sign` (more expensive), and converged to
    /// rounding: a neutral mode, as that of a buckled round column, is not unstable.
    fn step_to(&mut self, part: f64, any_sign: bool) -> LoadStepOutcome {
        self.predict(part);
        let predicted = self.next.clone();
        let accuracy = if part < 1.0 {
            CORRECTION.intermediate_accuracy
        } else {
            CORRECTION.final_accuracy
        };
        let stable = (self.correct(accuracy, CORRECTION.iterations, positive_definite_equations))
            .and_then(|_| self.index_and_drift(&predicted));
        match stable {
            Ok(CorrectedState { index: 0, drift }) => return LoadStepOutcome::Stable(drift),
            Err(stop) if !any_sign => return LoadStepOutcome::Lost(stop),
            Err(_) => {}
            Ok(_) => {
                // Forces of stiff rods that are not converged may be compressive.
                let again = self.correct(
                    CORRECTION.index_accuracy,
                    CORRECTION.iterations,
                    positive_definite_equations,
                );
                match again.and_then(|_| self.index_and_drift(&predicted)) {
                    Ok(CorrectedState { index: 0, drift }) => {
                        return LoadStepOutcome::Stable(drift);
                    }
                    _ if !any_sign => return LoadStepOutcome::Unstable,
                    _ => {}
                }
            }
        }
        self.next.clone_from(&predicted);
        match (self.correct_to_any_index(&predicted)).and_then(|_| self.index_and_drift(&predicted))
        {
            Ok(CorrectedState { index: 0, drift }) => LoadStepOutcome::Stable(drift),
            Ok(_) => LoadStepOutcome::Unstable,
            Err(stop) => LoadStepOutcome::Lost(stop),
        }
    }

    /// Counts the negative eigenvalues of the next state, if it is near the predicted one.
    fn index_and_drift(&mut self, predicted: &State) -> Result<CorrectedState, EquilibriumFailure> {
        let drift = self.next.distance(predicted);
        if self.previous_states.len() > 1 && drift > CORRECTION.largest_drift {
            return Err(EquilibriumFailure::NoDescent);
        }
        let leaf = &self.loading.leaf;
        let shift = leaf.neutral_shift();
        let index = saddle::index(leaf, &self.next, &mut self.system, shift, self.work);
        let index = index.ok_or(EquilibriumFailure::NoDescent)?;
        Ok(CorrectedState { index, drift })
    }

    /// Newton's method from the predicted state to an equilibrium of any index nearby: beyond a fold
    /// there is none, and the iteration would wander.
    fn correct_to_any_index(&mut self, predicted: &State) -> Result<f64, EquilibriumFailure> {
        let mut moved = f64::INFINITY;
        for _ in 0..2 * CORRECTION.iterations / CORRECTION.iterations_per_batch {
            let from = self.next.clone();
            match self.correct(
                CORRECTION.index_accuracy,
                CORRECTION.iterations_per_batch,
                |_| saddle::INDEFINITE_NEWTON_EQUATIONS,
            ) {
                Err(EquilibriumFailure::StepLimit) => {}
                end => return end,
            }
            let moves = from.distance(&self.next);
            let approaches = moves <= CORRECTION.batch_contraction * moved;
            if !approaches || self.next.distance(predicted) > CORRECTION.largest_drift {
                return Err(EquilibriumFailure::NoDescent);
            }
            moved = moves;
        }
        Err(EquilibriumFailure::StepLimit)
    }

    /// Newton's method from the next state.
    fn correct<'s>(
        &'s mut self,
        accuracy: f64,
        iterations: usize,
        equations: impl FnOnce(&'s mut DefiniteSolver) -> NewtonEquations<'s>,
    ) -> Result<f64, EquilibriumFailure> {
        let newton = NewtonIteration {
            accuracy,
            iterations,
            work: self.work,
            progress: self.progress,
        };
        let equations = equations(&mut self.solver);
        newton.solve(
            &self.loading.leaf,
            &mut self.next,
            &mut self.system,
            equations,
        )
    }

    /// Notes what happened at a part of the loading.
    pub fn record_event(&mut self, part: f64, happening: StabilityLoss) {
        let stage = self.stage;
        self.events.push(Event {
            stage,
            part,
            happening,
        });
    }
}

/// Newton's equations in a convex valley.
fn positive_definite_equations(solver: &mut DefiniteSolver) -> NewtonEquations<'_> {
    NewtonEquations::Definite {
        solver,
        largest: CORRECTION.largest_increment,
        shifted: false,
        cg_tolerance: CORRECTION.cg_tolerance,
    }
}

/// A leaf on its path. The natural leaf has every vein in its rest shape, apart and unloaded.
/// First the loads are put on the veins apart, then the tips are moved together and the coupling of
/// the veins is put on; in both stages in proportion to a part from 0 to 1.
pub struct LoadedLeaf<'a> {
    /// The leaf at the end of the path.
    pub whole: &'a DiscreteLeaf,
    /// The leaf at the present part: its veins are apart in the first stage.
    pub leaf: DiscreteLeaf,
    tips: TipMotion,
    stage: Stage,
    lambda: f64,
}

/// How the tips are moved while veins are joined.
enum TipMotion {
    /// They are free, or a single one.
    Free,
    /// From apart to one point, each on its path.
    Joining(Vec<TipJoiningPath>),
}

/// What a tip is apart from the common one: on its way its line from the base turns into the
/// direction of that, for a fan the mean direction of all, uniformly, while its distance changes to the mean of all quadratically.
/// So does that of a bent vein: a straight one that was compressed in proportion would buckle
/// at once, to either side.
struct TipJoiningPath {
    base: DVec3,
    from: DVec3,
    /// Rotation vector that turns the chord of the vein into the common direction.
    turn: DVec3,
    /// The common end.
    to: DVec3,
}

impl TipJoiningPath {
    /// The paths on which all tips move to one point.
    fn joining_paths(bases: &[DVec3], tips: &[DVec3]) -> Vec<TipJoiningPath> {
        let mean = |value: &dyn Fn(DVec3) -> DVec3| {
            tips.iter().map(|tip| value(*tip)).sum::<DVec3>() / tips.len() as f64
        };
        let distance = mean(&|tip| DVec3::splat(tip.length())).x;
        let direction = mean(&|tip| tip.normalize_or_zero()).normalize_or_zero();
        let fan = bases.iter().all(|base| *base == DVec3::ZERO);
        let common = match fan {
            true => distance * direction,
            false => mean(&|tip| tip),
        };
        let of = |(base, tip): (&DVec3, &DVec3)| {
            let (from, to) = (*tip - *base, common - *base);
            let direction = if fan {
                direction
            } else {
                to.normalize_or_zero()
            };
            let axis = from.normalize_or_zero().cross(direction);
            let angle = axis.length().atan2(from.normalize_or_zero().dot(direction));
            TipJoiningPath {
                base: *base,
                from,
                turn: angle * axis.normalize_or_zero(),
                to,
            }
        };
        bases.iter().zip(tips).map(of).collect()
    }

    fn tip_offset(&self, part: f64) -> DVec3 {
        let turned = |part: f64| rotation::exp(part * self.turn) * self.from;
        self.base + turned(part) + part * part * (self.to - turned(1.0))
    }
}

impl<'a> LoadedLeaf<'a> {
    /// The leaf before it is loaded.
    fn new(whole: &'a DiscreteLeaf) -> Self {
        let tips = match whole.tips_move_together() {
            true => TipMotion::Joining(Vec::new()),
            false => TipMotion::Free,
        };
        let mut leaf = whole.decoupled_leaf();
        leaf.load_factor = 0.0;
        LoadedLeaf {
            whole,
            leaf,
            tips,
            stage: Stage::Loading,
            lambda: 0.0,
        }
    }

    /// The stages in which anything happens.
    pub fn stages(&self) -> impl Iterator<Item = Stage> + use<> {
        let loads = &self.whole.leaf.loads;
        let loaded =
            [loads.gravity, loads.tip_force] != [DVec3::ZERO; 2] || loads.rod_load_factor != 0.0;
        let joined = !matches!(self.tips, TipMotion::Free) || self.whole.coupled();
        let stages = [(loaded, Stage::Loading), (joined, Stage::Joining)];
        stages
            .into_iter()
            .filter(|(any, _)| *any)
            .map(|(_, stage)| stage)
    }

    /// Begins a stage in a state.
    pub fn begin(&mut self, stage: Stage, state: &State) {
        (self.stage, self.lambda) = (stage, 0.0);
        if stage == Stage::Loading {
            return;
        }
        self.leaf = self.whole.clone();
        self.leaf.set_load_factors(self.whole, 1.0, 0.0);
        if let TipMotion::Joining(offsets) = &mut self.tips {
            let tips: Vec<DVec3> = state.tips().collect();
            let bases: Vec<DVec3> = (0..state.rods()).map(|j| state.x[state.base(j)]).collect();
            *offsets = TipJoiningPath::joining_paths(&bases, &tips);
        }
    }

    /// Goes to a part of the stage, with the tips of a `state` that is in equilibrium at the part
    /// `from`.
    pub fn carry_to_lambda(&mut self, [from, part]: [f64; 2], state: &mut State) {
        let (loads, coupling) = match self.stage {
            Stage::Loading => (part, 0.0),
            Stage::Joining | Stage::Moving => (1.0, part),
        };
        self.leaf.set_load_factors(self.whole, loads, coupling);
        self.lambda = part;
        if let (TipMotion::Joining(offsets), Stage::Joining) = (&self.tips, self.stage) {
            for (j, offset) in offsets.iter().enumerate() {
                let tip = state.base(j) + state.segments();
                state.x[tip] += offset.tip_offset(part) - offset.tip_offset(from);
            }
        }
    }

    /// Whether all that the present stage does is to move tips by less than steps are made for.
    fn is_short_way(&self) -> bool {
        let TipMotion::Joining(paths) = &self.tips else {
            return false;
        };
        self.stage == Stage::Joining
            && !self.whole.coupled()
            && (paths.iter()).all(|path| path.from.distance(path.to) <= CORRECTION.wanted_drift)
    }

    /// Puts the tips of a state predicted for the present part where they are exactly.
    fn place_tips(&self, state: &mut State) {
        if let (TipMotion::Joining(offsets), Stage::Joining) = (&self.tips, self.stage) {
            let common = |j: usize| state.tip(j) - offsets[j].tip_offset(self.lambda);
            let mean = (0..offsets.len()).map(common).sum::<DVec3>() / offsets.len() as f64;
            for (j, offset) in offsets.iter().enumerate() {
                let tip = state.base(j) + state.segments();
                state.x[tip] = mean + offset.tip_offset(self.lambda);
            }
        }
    }
}

/// The bound by which veins cannot buckle.
struct BucklingBound {
    /// The part of its bending energy that is set against the moments of a vein: about the best where
    /// the bound decides.
    moment_energy_fraction: f64,
    /// Safety factor on the loads of a vein.
    safety: f64,
    /// The largest strain of stretch or shear by the loads: the bound is that of rods that neither
    /// stretch nor shear.
    largest_strain: f64,
}

const BUCKLING: BucklingBound = BucklingBound {
    moment_energy_fraction: 0.3,
    safety: 1.2,
    largest_strain: 0.05,
};

/// A segment in the bound by which its vein cannot buckle.
struct BucklingSegment {
    length: f64,
    /// The part of the bending stiffness that is not set against the moments.
    stiffness: f64,
    /// What makes the vein buckle: the force along the segment and the moment, as a force.
    compression: f64,
}

/// Whether no vein, apart from the others, can lose its stability under any part of its loads, by
/// a bound that asks for no equilibrium.
///
/// For rotations theta about the axes of the sections the second variation of a vein's energy is
/// the integral of B |D theta|^2 - m (theta x D theta) - N (theta x (theta x d1)), with its smallest
/// stiffness B, the moment m and the force N that it carries. The force is that of the dead loads
/// beyond, whatever the shape, and |m| is at most its integral up to the tip. With y = |theta|, whose
/// slope is at most |D theta|, the second variation is thus positive where
/// (1 - a) B y'^2 - (|N| + m^2/(4 a B)) y^2 is, for any a between 0 and 1: as long as the solution of
/// ((1 - a) B y')' + (|N| + m^2/(4 a B)) y = 0 that leaves the clamp does not turn back before the
/// tip (Jacobi).
pub fn veins_cannot_buckle(leaf: &DiscreteLeaf) -> bool {
    let stands = |j: usize| {
        let mut moment = 0.0;
        let mut segments: Vec<BucklingSegment> = Vec::with_capacity(leaf.segments());
        for (section, carried) in carried_forces(leaf, j) {
            let force = BUCKLING.safety * carried;
            if force * section.compliance.max_element() > BUCKLING.largest_strain {
                return false;
            }
            let length = section.ds * section.rest_strain.length();
            moment += force * length;
            let stiffness = section.couple_stiffness.min_element();
            let compression =
                force + moment * moment / (4.0 * BUCKLING.moment_energy_fraction * stiffness);
            segments.push(BucklingSegment {
                length,
                stiffness: (1.0 - BUCKLING.moment_energy_fraction) * stiffness,
                compression,
            });
        }
        // y and (1 - a) B y', half of a segment each in turn.
        let (mut y, mut z) = (0.0, 1.0);
        for it in segments.into_iter().rev() {
            y += 0.5 * it.length * z / it.stiffness;
            z -= it.length * it.compression * y;
            y += 0.5 * it.length * z / it.stiffness;
            if z <= 0.0 {
                return false;
            }
        }
        true
    };
    !leaf.leaf.hinged() && (0..leaf.rods()).all(stands)
}

/// The largest P ds^2 / B of a segment with the stiffness B that carries the force P, as a vein
/// bends within sqrt(B/P): where it is larger, critical loads are wrong by several per cent.
const RESOLVED_FORCE_RATIO: f64 = 0.5;

/// Whether the segments of a leaf are short enough for the forces of the veins apart.
pub fn resolves_loads(leaf: &DiscreteLeaf) -> bool {
    let short = |(section, carried): (&Section, f64)| {
        carried * section.ds * section.ds
            <= RESOLVED_FORCE_RATIO * section.couple_stiffness.min_element()
    };
    (0..leaf.rods()).all(|j| carried_forces(leaf, j).all(short))
}

/// The sections of a vein apart, from the tip to the base, with the forces that they carry: whatever
/// its shape, those of the dead loads beyond.
fn carried_forces(leaf: &DiscreteLeaf, j: usize) -> impl Iterator<Item = (&Section, f64)> {
    let (n, share) = (leaf.segments(), leaf.leaf.share(j));
    let tips = match leaf.leaf.joined() {
        true => leaf.leaf.scenario().rods.len() as f64,
        false => 1.0,
    };
    let weight = leaf.leaf.length(j) * share * leaf.loads.gravity;
    let mut carried = leaf.loads.tip_force * (share / tips);
    (0..n).rev().map(move |i| {
        carried += leaf.grid.node_weight(i + 1) * weight + leaf.own_load_on_node(j, i + 1);
        (leaf.section(j, i), carried.length())
    })
}
