//! The leaf under a part of its loading, from the natural leaf to the leaf as it is.

use crate::leaf::{DiscreteLeaf, State};
use crate::relax::path::Stage;
use crate::rotation;
use glam::DVec3;

/// A leaf on its path. The natural leaf has every vein in its rest shape, apart and unloaded.
/// First the loads are put on, then the tips are moved together and the tissue between the veins
/// is put on; in both stages in proportion to a part from 0 to 1.
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
        if let (Stage::Joining, Tips::Joining(offsets)) = (stage, &mut self.tips) {
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
            Stage::Joining => [1.0, part],
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
