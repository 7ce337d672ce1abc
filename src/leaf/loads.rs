//! What acts on the nodes of several rods: dead loads, and the coupling with their
//! neighbours.

use crate::lanes::{GROUP, Lanes, Vectors};
use glam::DVec3;
use pulp::Simd;

/// What acts on a rod, per weight of its nodes but for the force on its tip.
#[derive(Clone, Copy)]
pub struct RodLoad {
    /// Dead load.
    pub dead: DVec3,
    /// Force on the tip.
    pub tip: DVec3,
    /// Coupling with the rod before, with the one behind, and with its own image.
    pub before: DVec3,
    pub behind: DVec3,
    pub image: DVec3,
}

/// The same of several rods.
#[derive(Clone, Copy)]
pub struct RodLoads<S: Simd> {
    dead: Vectors<S>,
    tip: Vectors<S>,
    before: Vectors<S>,
    behind: Vectors<S>,
    image: Vectors<S>,
}

impl<S: Simd> RodLoads<S> {
    /// Those of the lanes from `part` on.
    #[inline(always)]
    pub fn gather(simd: S, of: [RodLoad; GROUP], part: usize) -> Self {
        let [a, b, c, d] = of;
        let vectors = |of: fn(&RodLoad) -> DVec3| {
            Vectors::gather(simd, [of(&a), of(&b), of(&c), of(&d)], part)
        };
        RodLoads {
            dead: vectors(|load| load.dead),
            tip: vectors(|load| load.tip),
            before: vectors(|load| load.before),
            behind: vectors(|load| load.behind),
            image: vectors(|load| load.image),
        }
    }

    /// Forces on nodes, and their share of the potential energy (that of a gap
    /// belongs to its lower rod): positions of the nodes before, of these and of
    /// those behind; their weights in dead loads and in the coupling.
    #[inline(always)]
    pub fn at(
        &self,
        [before, x, behind]: [Vectors<S>; 3],
        [weight, coupling_weight]: [f64; 2],
        tip: bool,
    ) -> (Vectors<S>, Lanes<S>) {
        let simd = x.x.simd;
        let (weight, half) = (Lanes::splat(simd, weight), Lanes::splat(simd, 0.5));
        let coupling_weight = Lanes::splat(simd, coupling_weight);
        let mut force = self.dead.scale(weight);
        if tip {
            force = force + self.tip;
        }
        let to_image = (self.image * x).scale(coupling_weight);
        let stretch = behind - x;
        let pull = (self.behind * stretch).scale(coupling_weight);
        let energy = half * (pull.dot(stretch) + to_image.dot(x)) - force.dot(x);
        let push = (self.before * (x - before)).scale(coupling_weight);
        (force + pull - push - to_image, energy)
    }

    /// What the coupling adds to the diagonal of nodes, per weight.
    #[inline(always)]
    pub fn stiffness(&self) -> Vectors<S> {
        self.before + self.behind + self.image
    }
}
