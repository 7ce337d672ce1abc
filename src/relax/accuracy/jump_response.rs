//! The first-order response of a leaf to jumps of its fields, and its subtraction.

use crate::largest::larger;
use crate::leaf::{
    Factorised, Field, Jump, RodFields, Solved, State, System, Tangent, shift, turn,
};
use crate::relax::transfer::level::Level;
use crate::rotation;
use glam::DVec3;

/// Relative accuracy, in the energy norm, of the response: in a stiff leaf most of that
/// norm is stretch, and displacements are a small part of it.
const ACCURACY: f64 = 1e-6;

/// Changes of position, rotation, force and moment.
pub type Change = [DVec3; 4];

/// The linearised equations of a leaf on a grid that is divided into equal parts of `part`
/// segments; its fields may jump at their midpoints.
pub struct Tangents<'a> {
    level: &'a Level,
    part: usize,
    /// The segments just beyond the midpoints, rod after rod.
    behind: Vec<Vec<Tangent>>,
    /// The first segment and the last of every part; computed on first use.
    at_ends: Vec<Vec<Tangent>>,
}

/// The first-order response to jumps.
pub struct Response {
    /// Displacements and rotations of all nodes from the `first` on.
    solution: Field,
    first: usize,
    /// The largest displacements at the ends of the parts, and on either side of the midpoints.
    pub largest: [f64; 2],
}

impl<'a> Tangents<'a> {
    /// Of the leaf of `level`, divided into `parts` parts.
    pub fn new(level: &'a Level, parts: usize) -> Self {
        let Level { leaf, state } = level;
        let part = leaf.segments() / parts;
        let middles = |j: usize| {
            let segments = (0..parts).map(|k| k * part + part / 2);
            segments.map(|i| leaf.tangent(state, j, i)).collect()
        };
        Tangents {
            level,
            part,
            behind: (0..leaf.rods()).map(middles).collect(),
            at_ends: Vec::new(),
        }
    }

    /// The response to `jumps`; `system` holds the equations and `factors` their factors. `None` where these
    /// cannot be solved.
    pub fn response(
        &self,
        (system, factors): (&mut System, &mut Factorised),
        jumps: &[Vec<Jump>],
    ) -> Option<Response> {
        let leaf = &self.level.leaf;
        leaf.assemble_jumps(&self.behind, jumps, system);
        let Solved::Yes(_) = factors.solve(system, ACCURACY) else {
            return None;
        };
        let (mut at_ends, mut between) = (0.0_f64, 0.0_f64);
        let solution = system.solution();
        for (rod, jumps) in solution.iter().zip(jumps) {
            // The ends of parts, without the bases.
            let nodes = &rod[1 - system.first()..];
            for (nodes, jump) in nodes.chunks(self.part).zip(jumps) {
                let before = shift(&nodes[self.part / 2 - 1]);
                let middle = larger(before.length(), (before + jump[0]).length());
                between = larger(between, middle);
                at_ends = larger(at_ends, shift(&nodes[self.part - 1]).length());
            }
        }
        Some(Response {
            solution,
            first: system.first(),
            largest: [at_ends, between],
        })
    }

    /// The changes of all fields in a response, at the ends of the parts.
    pub fn changes(&mut self, response: &Response, jumps: &[Vec<Jump>]) -> Vec<Vec<Change>> {
        let Level { leaf, state } = self.level;
        if self.at_ends.is_empty() {
            let ends = |j: usize| {
                let segments = (0..=jumps[0].len()).map(|k| (k * self.part).saturating_sub(1));
                segments.map(|i| leaf.tangent(state, j, i)).collect()
            };
            self.at_ends = (0..leaf.rods()).map(ends).collect();
        }
        let moved = moved(state, response);
        let ends = |(j, jumps): (usize, &Vec<Jump>)| {
            let end = |k: usize| self.change(response, &moved, (j, jumps), k);
            (0..=jumps.len()).map(end).collect()
        };
        jumps.iter().enumerate().map(ends).collect()
    }

    /// At the beginning of part `k` of rod `j`, as [`resultants`](crate::relax::transfer::strains::resultants) takes
    /// forces and moments: from the segment before it.
    fn change(
        &self,
        response: &Response,
        moved: &State,
        (j, jumps): (usize, &[Jump]),
        k: usize,
    ) -> Change {
        let Level { leaf, state } = self.level;
        let (n, i) = (leaf.segments(), k * self.part);
        let s = i.saturating_sub(1);
        let ([begin, mut a], [end, b]) = (response.at(j, s), response.at(j, s + 1));
        let mut across = end - begin;
        if s % self.part == self.part / 2 {
            // This segment begins just beyond the jump at the midpoint.
            let [shift, turn, ..] = jumps[s / self.part];
            a += turn;
            across -= shift;
        }
        let tangent = &self.at_ends[j][k];
        let (segment, second, (_, g_a, g_b)) = (&tangent.segment, &tangent.second, tangent.first);
        let (section, zero) = (leaf.section(j, s), DVec3::ZERO);
        // Without the part that closes the segment's remaining gap (residual of its
        // constitutive law).
        let force = segment.force_increment(section, across, a, b)
            - segment.force_increment(section, zero, zero, zero);
        // A moment with fixed lab components does not rotate with its node.
        if i == 0 {
            let moment = second.xa.transpose() * across + second.aa * a + second.ab * b;
            return [
                zero,
                response.at(j, 0)[1],
                force,
                -moment - 0.5 * a.cross(g_a),
            ];
        }
        let moment = second.xb.transpose() * across + second.ab.transpose() * a + second.bb * b;
        let left = leaf.grid.width(i - 1);
        let right = if i < n { leaf.grid.width(i) } else { 0.0 };
        let [before, after] = [state, moved].map(|state| leaf.load(state, j, i));
        let part = left / (left + right);
        [
            end,
            b,
            force - part * (after.force - before.force),
            moment + 0.5 * b.cross(g_b) - part * (after.moment - before.moment),
        ]
    }
}

impl Response {
    /// Displacement and rotation of node `i` of rod `j`.
    fn at(&self, j: usize, i: usize) -> [DVec3; 2] {
        match i < self.first {
            true => [DVec3::ZERO; 2],
            false => [shift, turn].map(|of| of(&self.solution[j][i - self.first])),
        }
    }
}

/// The largest rotation, and the largest change of a force or moment.
pub fn largest_rotation_and_stress(changes: &[Vec<Change>]) -> [f64; 2] {
    let most = |of: fn(&Change) -> f64| changes.iter().flatten().map(of).fold(0.0, larger);
    [
        most(|[_, turn, ..]| turn.length()),
        most(|[.., force, moment]| larger(force.length(), moment.length())),
    ]
}

/// Applies the changes.
pub fn apply(changes: &[Vec<Change>], known: &mut [Vec<RodFields>]) {
    let changes = changes.iter().flatten();
    for (node, [shift, turn, force, moment]) in known.iter_mut().flatten().zip(changes) {
        node.x += shift;
        node.q = (rotation::exp(*turn) * node.q).normalize();
        node.n += force;
        node.m += moment;
    }
}

/// The state with its nodes displaced and rotated.
fn moved(state: &State, response: &Response) -> State {
    let mut moved = state.clone();
    for j in 0..state.rods() {
        for i in 0..=state.segments() {
            let (k, [shift, turn]) = (state.base(j) + i, response.at(j, i));
            moved.x[k] += shift;
            moved.q[k] = (rotation::exp(turn) * moved.q[k]).normalize();
        }
    }
    moved
}
