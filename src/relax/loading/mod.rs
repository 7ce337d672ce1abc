//! The path of equilibria on which a leaf is slowly loaded.
//!
//! The walk along the path of equilibria: a predictor through the last states, Newton's method
//! as corrector, and the Morse index watched.
//!
//! The leaf under a part of its loading, from the natural leaf to the leaf as it is.

pub(super) mod arrival;

use crate::homotopy::Homotopy;
use crate::leaf::{DiscreteLeaf, State, System};
use crate::newton::{Definite, Equations, Newton, Stop, Work};
use crate::relax::path::{Event, Happening, Stage};
use crate::relax::saddle;
use crate::rod::Section;
use crate::rotation;
use crate::run::Limit;
use glam::DVec3;

/// First, shortest and longest steps of lambda. Where an index changes, or where the path ends,
/// is known to the shortest.
const FIRST_STEP: f64 = 0.125;

const SHORTEST_STEP: f64 = 1.0 / 512.0;

const LONGEST_STEP: f64 = 0.5;

/// Largest factor on a step after a successful one.
const GROWTH: f64 = 2.5;

/// Factor on a step that failed.
const SHORTENED: f64 = 0.25;

/// The distance of a state from its prediction (lengths, radians) that steps are made for, and
/// the largest accepted.
const WANTED_DRIFT: f64 = 0.1;

const LARGEST_DRIFT: f64 = 0.3;

/// Largest increment of Newton's method, lengths or radians: the first after the natural leaf
/// may be large.
const LARGEST_INCREMENT: f64 = 2.0;

/// Accuracy of states on the way, at its end, and where the index is in doubt.
const ON_THE_WAY: f64 = 1e-3;

const AT_THE_END: f64 = 1e-4;

const EXACT: f64 = 1e-10;

/// Newton iterations of a step.
const ITERATIONS: usize = 8;

/// Towards an equilibrium of any index so many iterations at a time are made, in which the leaf moves
/// by less than this part of what it moved in those before, or none is near.
const ITERATIONS_AT_A_TIME: usize = 4;

const APPROACHING: f64 = 0.25;

/// Relative accuracy of the first solutions with conjugate gradients.
const CG_TOLERANCE: f64 = 1e-3;

/// States through which the next is predicted.
const PREDICTED_THROUGH: usize = 3;

/// A walk on one grid.
pub struct Walk<'w> {
    pub loading: Loading<'w>,
    pub system: System,
    pub work: &'w mut Work,
    pub limit: &'w Limit,
    pub progress: &'w mut dyn FnMut(usize, f64),
    /// Count of force evaluations at which it ends without success.
    pub most_evaluations: usize,
    pub solver: Definite,
    /// The last states at rest, with their parts of the loading.
    known: Vec<(f64, State)>,
    /// The next one.
    pub next: State,
    pub events: Vec<Event>,
    /// Where it is.
    pub stage: Stage,
    pub part: f64,
    /// Towards which a leaf turns aside that may turn to either side: a force on all nodes.
    pub leaning: DVec3,
}

/// What a step came to.
enum Step {
    /// A stable equilibrium so far from its prediction.
    Stable(f64),
    /// An equilibrium with negative eigenvalues.
    Unstable,
    /// Newton's method fails, or leads far away.
    Lost(Stop),
}

impl<'w> Walk<'w> {
    /// At the natural leaf.
    pub fn new(
        whole: &'w DiscreteLeaf,
        (work, progress): (&'w mut Work, &'w mut dyn FnMut(usize, f64)),
        (limit, most_evaluations): (&'w Limit, usize),
    ) -> Self {
        let (loading, natural) = Loading::new(whole);
        Walk {
            system: System::new(&loading.leaf),
            work,
            limit,
            progress,
            most_evaluations,
            solver: Definite::default(),
            next: natural.clone(),
            known: vec![(0.0, natural)],
            events: Vec::new(),
            stage: Stage::Loading,
            part: 0.0,
            loading,
            leaning: DVec3::ZERO,
        }
    }

    /// Walks to the end of a stage, if it can; the last state and what happened on the way are kept.
    pub fn run(&mut self, last: Stage) -> Result<(), Stop> {
        for stage in self.loading.stages() {
            if stage == Stage::Joining && last == Stage::Loading {
                break;
            }
            let (_, state) = self.known.pop().expect("the last state");
            self.loading.begin(stage, &state);
            if stage == Stage::Joining {
                // Its tips move together, and its veins will be coupled.
                self.system = System::new(self.loading.whole);
                self.solver = Definite::default();
            }
            self.known.clear();
            self.known.push((0.0, state));
            (self.stage, self.part) = (stage, 0.0);
            self.walk_stage()?;
        }
        Ok(())
    }

    /// The state in which it ended.
    pub fn last(self) -> State {
        let last = self.known.into_iter().next_back();
        last.map_or(self.next, |(_, state)| state)
    }

    fn walk_stage(&mut self) -> Result<(), Stop> {
        let mut path = Homotopy::new(FIRST_STEP, [SHORTEST_STEP, LONGEST_STEP]);
        while self.part < 1.0 {
            if self.work.force_evaluations > self.most_evaluations || self.limit.reached() {
                return Err(Stop::StepLimit);
            }
            let part = path.next();
            match self.step_to(part, path.is_shortest()) {
                Step::Stable(drift) => {
                    self.accept(part);
                    path.advance(path.length() * (WANTED_DRIFT / drift).sqrt().min(GROWTH));
                    continue;
                }
                Step::Lost(Stop::Unresolved) => return Err(Stop::Unresolved),
                Step::Unstable | Step::Lost(_) if path.shorten(SHORTENED) => continue,
                Step::Unstable => self.turn_aside(part)?,
                Step::Lost(_) => self.snap(part)?,
            }
            self.known.clear();
            self.accept(part);
            path.advance(FIRST_STEP);
        }
        Ok(())
    }

    /// Takes the next state as known.
    fn accept(&mut self, part: f64) {
        self.part = part;
        if self.known.len() == PREDICTED_THROUGH {
            self.known.rotate_left(1);
            let last = self.known.last_mut().expect("states");
            last.0 = part;
            last.1.clone_from(&self.next);
        } else {
            self.known.push((part, self.next.clone()));
        }
    }

    /// Carries the last state at rest to another part.
    pub fn carry_last(&mut self, part: f64) {
        let (at, last) = self.known.last().expect("states");
        self.next.clone_from(last);
        self.loading.carry([*at, part], &mut self.next);
        self.system.set_coupling(&self.loading.leaf);
    }

    /// Predicts the state at another part.
    fn predict(&mut self, part: f64) {
        self.carry_last(part);
        if self.known.len() < 2 {
            return;
        }
        let count = self.known.len();
        let weight = |k: usize| {
            let others = (0..count).filter(|other| *other != k);
            let part = others.map(|other| {
                let [own, other] = [k, other].map(|k| self.known[k].0);
                (part - other) / (own - other)
            });
            part.product()
        };
        // The last one, which the others change, has the rest of the weight.
        let mut weights = [0.0; PREDICTED_THROUGH];
        (0..count - 1).for_each(|k| weights[k] = weight(k));
        let (_, last) = &self.known[count - 1];
        let others = || self.known[..count - 1].iter().zip(weights);
        for k in 0..last.x.len() {
            let mut shift = DVec3::ZERO;
            let mut turn = DVec3::ZERO;
            for ((_, state), weight) in others() {
                shift += weight * (state.x[k] - last.x[k]);
                turn += weight * rotation::log(state.q[k] * last.q[k].conjugate());
            }
            self.next.x[k] = last.x[k] + shift;
            self.next.q[k] = (rotation::exp(turn) * last.q[k]).normalize();
        }
        for k in 0..last.n.len() {
            let change: DVec3 = others()
                .map(|((_, state), weight)| weight * (state.n[k] - last.n[k]))
                .sum();
            self.next.n[k] = last.n[k] + change;
        }
        let tied = others().all(|((_, state), _)| state.tissue.len() == last.tissue.len());
        self.next.tissue.clone_from(&last.tissue);
        for (k, force) in self.next.tissue.iter_mut().enumerate().filter(|_| tied) {
            for ((_, state), weight) in others() {
                *force += weight * (state.tissue[k] - last.tissue[k]);
            }
        }
        for j in 0..last.rods() {
            let base = last.base(j);
            (self.next.x[base], self.next.q[base]) = (last.x[base], last.q[base]);
        }
        self.loading.place_tips(&mut self.next);
    }

    /// Predicts and corrects the equilibrium at another part. Where none is found that is surely
    /// stable, one of any index is looked for if `any_sign` (more expensive), and converged to
    /// rounding: a neutral mode, as that of a buckled round column, is not unstable.
    fn step_to(&mut self, part: f64, any_sign: bool) -> Step {
        self.predict(part);
        let predicted = self.next.clone();
        let accuracy = if part < 1.0 { ON_THE_WAY } else { AT_THE_END };
        let stable =
            (self.correct(accuracy, ITERATIONS, definite)).and_then(|_| self.check(&predicted));
        match stable {
            Ok((0, drift)) => return Step::Stable(drift),
            Err(stop) if !any_sign => return Step::Lost(stop),
            Err(_) => {}
            Ok(_) => {
                // Forces of stiff rods that are not converged may be compressive.
                let again = self.correct(EXACT, ITERATIONS, definite);
                match again.and_then(|_| self.check(&predicted)) {
                    Ok((0, drift)) => return Step::Stable(drift),
                    _ if !any_sign => return Step::Unstable,
                    _ => {}
                }
            }
        }
        self.next.clone_from(&predicted);
        match (self.correct_to_any(&predicted)).and_then(|_| self.check(&predicted)) {
            Ok((0, drift)) => Step::Stable(drift),
            Ok(_) => Step::Unstable,
            Err(stop) => Step::Lost(stop),
        }
    }

    /// The Morse index of the next state, and its distance from the one predicted, if it is
    /// near that.
    fn check(&mut self, predicted: &State) -> Result<(usize, f64), Stop> {
        let drift = self.next.distance(predicted);
        if self.known.len() > 1 && drift > LARGEST_DRIFT {
            return Err(Stop::Stuck);
        }
        let leaf = &self.loading.leaf;
        let shift = leaf.neutral_shift();
        let index = saddle::index(leaf, &self.next, &mut self.system, shift, self.work);
        Ok((index.ok_or(Stop::Stuck)?, drift))
    }

    /// Newton's method from the predicted state to an equilibrium of any index nearby: beyond a fold
    /// there is none, and the iteration would wander.
    fn correct_to_any(&mut self, predicted: &State) -> Result<f64, Stop> {
        let mut moved = f64::INFINITY;
        for _ in 0..2 * ITERATIONS / ITERATIONS_AT_A_TIME {
            let from = self.next.clone();
            match self.correct(EXACT, ITERATIONS_AT_A_TIME, |_| saddle::ANY_SIGN) {
                Err(Stop::StepLimit) => {}
                end => return end,
            }
            let moves = from.distance(&self.next);
            let approaches = moves <= APPROACHING * moved;
            if !approaches || self.next.distance(predicted) > LARGEST_DRIFT {
                return Err(Stop::Stuck);
            }
            moved = moves;
        }
        Err(Stop::StepLimit)
    }

    /// Newton's method from the next state.
    fn correct<'s>(
        &'s mut self,
        accuracy: f64,
        iterations: usize,
        equations: impl FnOnce(&'s mut Definite) -> Equations<'s>,
    ) -> Result<f64, Stop> {
        let newton = Newton {
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
    pub fn note(&mut self, part: f64, happening: Happening) {
        let stage = self.stage;
        self.events.push(Event {
            stage,
            part,
            happening,
        });
    }
}

/// Newton's equations in a convex valley.
fn definite(solver: &mut Definite) -> Equations<'_> {
    Equations::Definite {
        solver,
        largest: LARGEST_INCREMENT,
        shifted: false,
        cg_tolerance: CG_TOLERANCE,
    }
}

/// A leaf on its path. The natural leaf has every vein in its rest shape, apart and unloaded.
/// First the loads are put on the veins apart, then the tips are moved together and the coupling of
/// the veins is put on; in both stages in proportion to a part from 0 to 1.
pub struct Loading<'a> {
    /// The leaf at the end of the path.
    pub whole: &'a DiscreteLeaf,
    /// The leaf at the present part: its veins are apart in the first stage.
    pub leaf: DiscreteLeaf,
    tips: Tips,
    stage: Stage,
    part: f64,
}

/// How tips are moved.
enum Tips {
    /// They are free, or a single one.
    Free,
    /// Together.
    Joining(Vec<Offset>),
}

/// What a tip is apart from the common one: on its way its line from the base turns into the
/// direction of that, for a fan the mean direction of all, uniformly, while its distance changes to the mean of all quadratically.
/// So does that of a bent vein: a straight one that was compressed in proportion would buckle
/// at once, to either side.
struct Offset {
    base: DVec3,
    from: DVec3,
    /// Rotation into the common direction.
    turn: DVec3,
    /// The common end.
    to: DVec3,
}

impl Offset {
    /// Of all tips.
    fn all(bases: &[DVec3], tips: &[DVec3]) -> Vec<Offset> {
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
            Offset {
                base: *base,
                from,
                turn: angle * axis.normalize_or_zero(),
                to,
            }
        };
        bases.iter().zip(tips).map(of).collect()
    }

    fn at(&self, part: f64) -> DVec3 {
        let turned = |part: f64| rotation::exp(part * self.turn) * self.from;
        self.base + turned(part) + part * part * (self.to - turned(1.0))
    }
}

impl<'a> Loading<'a> {
    /// The natural leaf, and its state.
    pub fn new(whole: &'a DiscreteLeaf) -> (Self, State) {
        let natural = whole.natural();
        let tips = match whole.tips_move_together() {
            true => Tips::Joining(Vec::new()),
            false => Tips::Free,
        };
        let mut leaf = whole.apart();
        leaf.load_factor = 0.0;
        let loading = Loading {
            whole,
            leaf,
            tips,
            stage: Stage::Loading,
            part: 0.0,
        };
        (loading, natural)
    }

    /// The stages in which anything happens.
    pub fn stages(&self) -> impl Iterator<Item = Stage> + use<> {
        let loads = &self.whole.leaf.loads;
        let loaded = [loads.gravity, loads.tip_force] != [DVec3::ZERO; 2] || loads.own != 0.0;
        let joined = !matches!(self.tips, Tips::Free) || self.whole.coupled();
        let stages = [(loaded, Stage::Loading), (joined, Stage::Joining)];
        stages
            .into_iter()
            .filter(|(any, _)| *any)
            .map(|(_, stage)| stage)
    }

    /// Begins a stage in a state.
    pub fn begin(&mut self, stage: Stage, state: &State) {
        (self.stage, self.part) = (stage, 0.0);
        if stage == Stage::Loading {
            return;
        }
        self.leaf = self.whole.clone();
        self.leaf.load_in_part(self.whole, [1.0, 0.0]);
        if let Tips::Joining(offsets) = &mut self.tips {
            let tips: Vec<DVec3> = state.tips().collect();
            let bases: Vec<DVec3> = (0..state.rods()).map(|j| state.x[state.base(j)]).collect();
            *offsets = Offset::all(&bases, &tips);
        }
    }

    /// Goes to a part of the stage, with the tips of a `state` that is in equilibrium at the part
    /// `from`.
    pub fn carry(&mut self, [from, part]: [f64; 2], state: &mut State) {
        let shares = match self.stage {
            Stage::Loading => [part, 0.0],
            Stage::Joining | Stage::Moving => [1.0, part],
        };
        self.leaf.load_in_part(self.whole, shares);
        self.part = part;
        if let (Tips::Joining(offsets), Stage::Joining) = (&self.tips, self.stage) {
            for (j, offset) in offsets.iter().enumerate() {
                let tip = state.base(j) + state.segments();
                state.x[tip] += offset.at(part) - offset.at(from);
            }
        }
    }

    /// Puts the tips of a state predicted for the present part where they are exactly.
    pub fn place_tips(&self, state: &mut State) {
        if let (Tips::Joining(offsets), Stage::Joining) = (&self.tips, self.stage) {
            let common = |j: usize| state.tip(j) - offsets[j].at(self.part);
            let mean = (0..offsets.len()).map(common).sum::<DVec3>() / offsets.len() as f64;
            for (j, offset) in offsets.iter().enumerate() {
                let tip = state.base(j) + state.segments();
                state.x[tip] = mean + offset.at(self.part);
            }
        }
    }
}

/// The part of its bending energy that is set against the moments of a vein in
/// [`veins_cannot_buckle`]: about the best where the bound decides.
const AGAINST_MOMENTS: f64 = 0.3;

/// Factor on the loads there, and the largest strain of stretch or shear by these: the bound is that
/// of rods that neither stretch nor shear.
const SAFETY: f64 = 1.2;

const LARGEST_STRAIN: f64 = 0.05;

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
        let mut segments: Vec<[f64; 3]> = Vec::with_capacity(leaf.segments());
        for (section, carried) in carried_forces(leaf, j) {
            let force = SAFETY * carried;
            if force * section.compliance.max_element() > LARGEST_STRAIN {
                return false;
            }
            let length = section.ds * section.rest_strain.length();
            moment += force * length;
            let stiffness = section.couple_stiffness.min_element();
            let against = force + moment * moment / (4.0 * AGAINST_MOMENTS * stiffness);
            segments.push([length, (1.0 - AGAINST_MOMENTS) * stiffness, against]);
        }
        // y and (1 - a) B y', half of a segment each in turn.
        let (mut y, mut z) = (0.0, 1.0);
        for [length, stiffness, against] in segments.into_iter().rev() {
            y += 0.5 * length * z / stiffness;
            z -= length * against * y;
            y += 0.5 * length * z / stiffness;
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
const RESOLVED: f64 = 0.5;

/// Whether the segments of a leaf are short enough for the forces of the veins apart.
pub fn resolves_loads(leaf: &DiscreteLeaf) -> bool {
    let short = |(section, carried): (&Section, f64)| {
        carried * section.ds * section.ds <= RESOLVED * section.couple_stiffness.min_element()
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
        carried += leaf.grid.weight(i + 1) * weight + leaf.own_load(j, i + 1);
        (leaf.section(j, i), carried.length())
    })
}
