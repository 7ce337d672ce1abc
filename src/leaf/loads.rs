//! Loads on the nodes of several rods: dead loads, and the coupling with their neighbours.

use crate::lanes::{Four, GROUP, Lanes, Vectors};
use glam::DVec3;
use pulp::Simd;

/// Loads on a rod per weight of its nodes, except the force on its tip.
#[derive(Clone, Copy)]
pub struct RodLoad {
    /// Dead load.
    pub dead: DVec3,
    /// Force on the tip.
    pub tip: DVec3,
    /// Coupling with the previous rod, with the next, and with its own mirror image.
    pub previous: DVec3,
    pub next: DVec3,
    pub image: DVec3,
}

/// Moment, force and energy of what acts on a node besides its segments; the energy of a gap belongs
/// to the lower rod.
#[derive(Clone, Copy, Debug, Default)]
pub struct NodeLoad {
    /// Moment.
    pub moment: DVec3,
    /// Force.
    pub force: DVec3,
    /// Potential energy.
    pub energy: f64,
}

/// Loads on a group of rods, component by component, in the order of the fields of [`RodLoad`].
pub type GroupLoads = [[Four; 3]; 5];

/// The loads on the rods of a group.
#[inline(always)]
pub fn group_loads(of: [RodLoad; GROUP]) -> GroupLoads {
    let vectors = |of_load: fn(&RodLoad) -> DVec3| {
        let [a, b, c, d] = of.each_ref().map(of_load);
        [
            Four([a.x, b.x, c.x, d.x]),
            Four([a.y, b.y, c.y, d.y]),
            Four([a.z, b.z, c.z, d.z]),
        ]
    };
    [
        vectors(|load| load.dead),
        vectors(|load| load.tip),
        vectors(|load| load.previous),
        vectors(|load| load.next),
        vectors(|load| load.image),
    ]
}

/// The loads on several rods.
#[derive(Clone, Copy)]
pub struct RodLoads<S: Simd> {
    dead: Vectors<S>,
    tip: Vectors<S>,
    previous: Vectors<S>,
    next: Vectors<S>,
    image: Vectors<S>,
}

impl<S: Simd> RodLoads<S> {
    /// The loads on the lanes from `part` on.
    #[inline(always)]
    pub fn of(simd: S, group: &GroupLoads, part: usize) -> Self {
        let vectors = |k: usize| {
            let [x, y, z] = [0, 1, 2].map(|c| Lanes::of(simd, &group[k][c], part));
            Vectors::new(x, y, z)
        };
        RodLoads {
            dead: vectors(0),
            tip: vectors(1),
            previous: vectors(2),
            next: vectors(3),
            image: vectors(4),
        }
    }

    /// Forces on nodes, and their share of the potential energy (that of a gap belongs to its
    /// lower rod), from the positions of the nodes on the previous rods, of these, and on the
    /// next rods, and from their weights in dead loads and in the coupling.
    #[inline(always)]
    pub fn at(
        &self,
        [previous, x, next]: [Vectors<S>; 3],
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
        let stretch = next - x;
        let pull = (self.next * stretch).scale(coupling_weight);
        let energy = half * (pull.dot(stretch) + to_image.dot(x)) - force.dot(x);
        let push = (self.previous * (x - previous)).scale(coupling_weight);
        (force + pull - push - to_image, energy)
    }

    /// The contribution of the coupling to the diagonal of nodes, per weight.
    #[inline(always)]
    pub fn stiffness(&self) -> Vectors<S> {
        self.previous + self.next + self.image
    }
}
