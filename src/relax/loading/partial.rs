//! The leaf under a part of its loading, from the natural leaf to the leaf as it is.

use crate::leaf::{DiscreteLeaf, State};
use crate::relax::path::Stage;
use crate::rod::Section;
use crate::rotation;
use glam::DVec3;

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
