//! Wind: the drag of the air on the segments of a leaf.
//!
//! The force per length of a rod is c |u_n| u_n with c = rho_a C_D w L/(2 rho), u_n being the part of
//! the air's velocity relative to the rod that is normal to its tangent. It is taken in the middle of
//! every segment, where the tangent is that of its chord and the velocity the mean of its ends', to
//! each of which half of it is applied: of second order in the length of the segments, and its power
//! is that of the mean velocity.

use super::physics::Physics;
use crate::leaf::{DiscreteLeaf, State};
use crate::rotation::outer;
use glam::{DMat3, DVec3};

/// Ratio of the speed of the air relative to a leaf to that of the wind, for stable steps: a leaf may
/// move against the wind as fast as that blows.
const RELATIVE: f64 = 2.0;

/// Wind on a leaf of a grid. Dimensionless.
#[derive(Clone, Debug)]
pub struct Wind {
    /// c times the length, of all segments, rod after rod.
    factors: Vec<f64>,
    segments: usize,
}

/// The drag on a segment.
#[derive(Clone, Copy, Debug)]
pub struct Drag {
    factor: f64,
    /// Length and unit tangent t of the chord.
    chord: f64,
    tangent: DVec3,
    /// t . u, u_n and |u_n|.
    along: f64,
    normal: DVec3,
    speed: f64,
}

impl Drag {
    fn new(factor: f64, chord: DVec3, u: DVec3) -> Self {
        let tangent = chord.normalize_or_zero();
        let along = tangent.dot(u);
        let normal = u - along * tangent;
        Drag {
            factor,
            chord: chord.length(),
            tangent,
            along,
            normal,
            speed: normal.length(),
        }
    }

    /// The force.
    pub fn force(&self) -> DVec3 {
        self.factor * self.speed * self.normal
    }

    /// The derivative of the force with respect to the air's velocity: c (|u_n| P + u_n u_n/|u_n|),
    /// P being the projection normal to the tangent.
    pub fn by_velocity(&self) -> DMat3 {
        let normal = DMat3::IDENTITY - outer(self.tangent, self.tangent);
        let direction = self.normal.normalize_or_zero();
        self.factor * self.speed * (normal + outer(direction, direction))
    }

    /// The derivative of the force with respect to the vector from one end to the other, as the
    /// tangent turns with it.
    pub fn by_chord(&self) -> DMat3 {
        let turned = self.factor * self.speed * outer(self.tangent, self.normal);
        (self.along * self.by_velocity() + turned) * (-self.chord.max(f64::MIN_POSITIVE).recip())
    }
}

impl Wind {
    /// On this leaf; `None` if its scenario has no wind.
    pub fn new(leaf: &DiscreteLeaf, physics: &Physics) -> Option<Self> {
        let segments = leaf.segments();
        let drag = |(j, i)| physics.drag(leaf, j, i);
        physics.is_windy().then(|| Wind {
            factors: leaf.each(0..segments).map(drag).collect(),
            segments,
        })
    }

    /// Rod and number of every segment, and the drag on it, in `air` of this velocity, from the
    /// positions and the velocities of all nodes.
    pub fn drags<'a>(
        &'a self,
        state: &'a State,
        air: DVec3,
        velocity: impl Fn(usize) -> DVec3 + 'a,
    ) -> impl Iterator<Item = ((usize, usize), Drag)> + 'a {
        let segments = self.factors.iter().enumerate();
        segments.map(move |(k, &factor)| {
            let (j, i) = (k / self.segments, k % self.segments);
            let node = state.base(j) + i;
            let moving = 0.5 * (velocity(node) + velocity(node + 1));
            let chord = state.x[node + 1] - state.x[node];
            ((j, i), Drag::new(factor, chord, air - moving))
        })
    }

    /// Sets the forces on all nodes.
    pub fn set_forces(
        &self,
        state: &State,
        air: DVec3,
        velocity: impl Fn(usize) -> DVec3,
        forces: &mut [DVec3],
    ) {
        forces.fill(DVec3::ZERO);
        for ((j, i), drag) in self.drags(state, air, velocity) {
            let (node, half) = (state.base(j) + i, 0.5 * drag.force());
            forces[node] += half;
            forces[node + 1] += half;
        }
    }

    /// Upper bound on the rate at which the drag of the strongest wind makes velocities decay: of all
    /// nodes the largest sum of the absolute values of a row of the matrix of these rates.
    pub fn fastest_decay(&self, leaf: &DiscreteLeaf, physics: &Physics) -> f64 {
        let n = self.segments;
        let mut nodes = vec![[0.0; 2]; leaf.rods() * (n + 1)];
        for (k, factor) in self.factors.iter().enumerate() {
            let node = k / n * (n + 1) + k % n;
            nodes[node][0] += factor;
            nodes[node + 1][0] += factor;
        }
        for (j, i) in leaf.each(0..=n) {
            nodes[j * (n + 1) + i][1] = physics.inertia(leaf, j, i).mass;
        }
        if leaf.tips_move_together() {
            let tips = (0..leaf.rods()).map(|j| nodes[j * (n + 1) + n]);
            let tip = tips.fold([0.0; 2], |[a, b], [c, d]| [a + c, b + d]);
            (0..leaf.rods()).for_each(|j| nodes[j * (n + 1) + n] = tip);
        }
        let rates = nodes.into_iter().map(|[factor, mass]| factor / mass);
        RELATIVE * physics.strongest_wind() * rates.fold(0.0, f64::max)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn derivatives_are_those_of_the_force() {
        let (chord, u) = (DVec3::new(0.3, -0.2, 0.1), DVec3::new(1.1, 0.7, -0.4));
        let drag = |chord, u| Drag::new(0.7, chord, u);
        let (here, h) = (drag(chord, u), 1e-6);
        for axis in DVec3::AXES {
            let of = |to: f64, air: f64| drag(chord + to * axis, u + air * axis).force();
            let by_chord = (of(h, 0.0) - of(-h, 0.0)) / (2.0 * h);
            let by_velocity = (of(0.0, h) - of(0.0, -h)) / (2.0 * h);
            assert!((here.by_chord() * axis).distance(by_chord) < 1e-8);
            assert!((here.by_velocity() * axis).distance(by_velocity) < 1e-8);
        }
    }
}
