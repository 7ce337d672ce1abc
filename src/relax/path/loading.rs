//! The leaf under a part of its loading, from the natural leaf to the leaf as it is.

use super::Stage;
use crate::leaf::{DiscreteLeaf, State};
use crate::relax::start::rest_shapes;
use crate::rotation;
use glam::{DQuat, DVec3};
use std::f64::consts::{PI, TAU};

/// A leaf on its path. The natural leaf has every vein in its rest shape, apart and unloaded.
/// First the loads are put on, then the tips are moved together, or to their holder, and the
/// tissue between the veins is put on; in both stages in proportion to a part from 0 to 1.
pub struct Loading<'a> {
    /// The leaf at the end of the path.
    whole: &'a DiscreteLeaf,
    /// The leaf at the present part.
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
    /// From their natural places to their holder.
    Held(Holders),
}

/// What a tip is apart from the common one: on its way its line from the base turns into the
/// mean direction of all, uniformly, while its distance changes to the mean of all quadratically.
/// So does that of a bent vein: a straight one that was compressed in proportion would buckle
/// at once, to either side.
struct Offset {
    from: DVec3,
    /// Rotation into the common direction.
    turn: DVec3,
    /// The common end.
    to: DVec3,
}

impl Offset {
    /// Of all tips.
    fn all(tips: &[DVec3]) -> Vec<Offset> {
        let mean = |value: &dyn Fn(DVec3) -> DVec3| {
            tips.iter().map(|tip| value(*tip)).sum::<DVec3>() / tips.len() as f64
        };
        let distance = mean(&|tip| DVec3::splat(tip.length())).x;
        let direction = mean(&|tip| tip.normalize_or_zero()).normalize_or_zero();
        let of = |from: &DVec3| {
            let axis = from.normalize_or_zero().cross(direction);
            let angle = axis.length().atan2(from.normalize_or_zero().dot(direction));
            Offset {
                from: *from,
                turn: angle * axis.normalize_or_zero(),
                to: distance * direction,
            }
        };
        tips.iter().map(of).collect()
    }

    fn at(&self, part: f64) -> DVec3 {
        let turned = |part: f64| rotation::exp(part * self.turn) * self.from;
        turned(part) + part * part * (self.to - turned(1.0))
    }
}

/// The path of the tip of a rod to its holder.
struct Holder {
    from: DVec3,
    to: DVec3,
    clamp: Option<Clamping>,
}

/// The rotation of a clamped tip along its path: the angle of d1 about e3 at both ends, the
/// final twist about d1, and the rest of the first rotation, which is removed.
struct Clamping {
    heading: [f64; 2],
    twist: f64,
    other: DVec3,
}

/// The paths of held tips from where they are in a state to their holders; none if tips are free.
pub struct Holders(Vec<Holder>);

impl Holders {
    /// For the tips of `from`.
    pub fn new(leaf: &DiscreteLeaf, from: &State) -> Option<Holders> {
        let held = leaf.leaf.held.as_ref()?;
        let holder = |j: usize| {
            let rod = &from.q[from.base(j)..=from.base(j) + leaf.segments()];
            let clamp = held.clamps.as_ref().map(|clamps| {
                let angle = heading(rod);
                let untwisted = DQuat::from_rotation_z(angle).conjugate();
                Clamping {
                    heading: [angle, clamps[j].angle],
                    twist: clamps[j].twist,
                    other: rotation::log(untwisted * rod[leaf.segments()]),
                }
            });
            Holder {
                from: from.tip(j),
                to: held.position,
                clamp,
            }
        };
        Some(Holders((0..leaf.rods()).map(holder).collect()))
    }

    /// The largest rotation of a holder along its path.
    pub fn turn(&self) -> f64 {
        let turn = |clamp: &Clamping| {
            let [from, to] = clamp.heading;
            (to - from).abs() + clamp.twist.abs() + clamp.other.length()
        };
        let clamps = self.0.iter().filter_map(|it| it.clamp.as_ref());
        clamps.map(turn).fold(0.0, f64::max)
    }

    /// The longest way of a holder.
    pub fn way(&self) -> f64 {
        let ways = self.0.iter().map(|it| it.from.distance(it.to));
        ways.fold(0.0, f64::max)
    }

    /// Moves all tips to the part of their paths, and every node with its tip in proportion to
    /// its distance from the base.
    pub fn move_tips(&self, leaf: &DiscreteLeaf, part: f64, state: &mut State) {
        for (j, holder) in self.0.iter().enumerate() {
            holder.move_tip(leaf, j, part, state);
        }
    }

    /// Moves the tips alone.
    fn place(&self, part: f64, state: &mut State) {
        for (j, holder) in self.0.iter().enumerate() {
            holder.place(j, part, state);
        }
    }
}

impl<'a> Loading<'a> {
    /// The natural leaf, and its state.
    pub fn new(whole: &'a DiscreteLeaf) -> (Self, State) {
        let natural = rest_shapes(whole);
        let tips = match Holders::new(whole, &natural) {
            Some(holders) => Tips::Held(holders),
            None if whole.tips_move_together() => Tips::Joining(Vec::new()),
            None => Tips::Free,
        };
        let mut leaf = whole.clone();
        leaf.load_in_part(whole, [0.0; 2]);
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
        let loaded = [loads.gravity, loads.tip_force] != [DVec3::ZERO; 2];
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
        if let (Stage::Joining, Tips::Joining(offsets)) = (stage, &mut self.tips) {
            let tips: Vec<DVec3> = state.tips().collect();
            *offsets = Offset::all(&tips);
        }
    }

    /// The largest rotation of a holder in this stage.
    pub fn turn(&self) -> f64 {
        match (&self.tips, self.stage) {
            (Tips::Held(holders), Stage::Joining) => holders.turn(),
            _ => 0.0,
        }
    }

    /// Goes to a part of the stage, with the tips of a `state` that is in equilibrium at the part
    /// `from`.
    pub fn carry(&mut self, [from, part]: [f64; 2], state: &mut State) {
        let shares = match self.stage {
            Stage::Loading => [part, 0.0],
            Stage::Joining => [1.0, part],
        };
        self.leaf.load_in_part(self.whole, shares);
        self.part = part;
        match (&self.tips, self.stage) {
            (Tips::Joining(offsets), Stage::Joining) => {
                for (j, offset) in offsets.iter().enumerate() {
                    let tip = state.base(j) + state.segments();
                    state.x[tip] += offset.at(part) - offset.at(from);
                }
            }
            (Tips::Held(holders), Stage::Joining) => holders.move_tips(&self.leaf, part, state),
            _ => {}
        }
    }

    /// Puts the tips of a state predicted for the present part where they are exactly: common
    /// to rounding, or held.
    pub fn place_tips(&self, state: &mut State) {
        match (&self.tips, self.stage) {
            (Tips::Joining(offsets), Stage::Joining) => {
                let common = |j: usize| state.tip(j) - offsets[j].at(self.part);
                let mean = (0..offsets.len()).map(common).sum::<DVec3>() / offsets.len() as f64;
                for (j, offset) in offsets.iter().enumerate() {
                    let tip = state.base(j) + state.segments();
                    state.x[tip] = mean + offset.at(self.part);
                }
            }
            (Tips::Held(holders), Stage::Joining) => holders.place(self.part, state),
            _ => {}
        }
    }
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

impl Holder {
    /// Position and, of a clamp, rotation.
    fn at(&self, part: f64) -> (DVec3, Option<DQuat>) {
        let rotation = self.clamp.as_ref().map(|clamp| {
            let [from, to] = clamp.heading;
            DQuat::from_rotation_z(from + part * (to - from))
                * DQuat::from_rotation_x(part * clamp.twist)
                * rotation::exp((1.0 - part) * clamp.other)
        });
        (self.from.lerp(self.to, part), rotation)
    }

    /// Puts the tip of rod `j` at the part of its path.
    fn place(&self, j: usize, part: f64, state: &mut State) {
        let tip = state.base(j) + state.segments();
        let (position, rotation) = self.at(part);
        state.x[tip] = position;
        if let Some(rotation) = rotation {
            state.q[tip] = rotation;
        }
    }

    /// Moves the tip of rod `j` to the part of its path, and every node with it in proportion to
    /// its distance from the base.
    fn move_tip(&self, leaf: &DiscreteLeaf, j: usize, part: f64, state: &mut State) {
        let (base, n) = (state.base(j), state.segments());
        let (position, rotation) = self.at(part);
        let shift = position - state.x[base + n];
        let turn = rotation.map(|to| rotation::log(to * state.q[base + n].conjugate()));
        for (i, &sigma) in leaf.grid.sigma().iter().enumerate().skip(1) {
            state.x[base + i] += sigma * shift;
            if let Some(turn) = turn {
                state.q[base + i] = (rotation::exp(sigma * turn) * state.q[base + i]).normalize();
            }
        }
        self.place(j, part, state);
    }
}
