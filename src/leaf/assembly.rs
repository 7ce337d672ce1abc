//! The discretised leaf: its unbalanced forces, its matrix, its energy.

use super::chain::{Block, Chain, RodMatrix, SPATIAL, turns};
use super::dimensionless::Leaf;
use super::grid::Grid;
use super::state::{Increment, State, shift, turn};
use super::system::{System, each_rod};
use crate::rod::{Blocks, Ends, Section, Segment};
use glam::{DMat3, DVec3};

/// Radius of gyration of a vein with the tissue it carries, in units of the
/// leaf's length: its rotary inertia per unit length and mass is the square.
/// A thin rod's own is smaller, but a vein turns with its strip of blade.
const RADIUS_OF_GYRATION: f64 = 0.1;

/// A leaf on a grid.
#[derive(Clone, Debug)]
pub struct DiscreteLeaf<'a> {
    /// The leaf.
    pub leaf: &'a Leaf<'a>,
    /// Its grid.
    pub grid: Grid,
    /// Sections of all segments, rod after rod.
    pub sections: Vec<Section>,
    /// Coupling of each gap, per unit of sigma; the last may be the one between
    /// a rod and its image.
    coupling: Vec<DVec3>,
    /// Trapezoidal weights of the nodes as fractions of the length.
    weights: Vec<f64>,
    /// Part of the loads that acts: one, but on the way to a dead moment.
    pub load_factor: f64,
    /// The loads.
    pub loads: Loads,
    /// Whether this is half of a leaf that is its own mirror image.
    pub(super) mirrored: bool,
    /// Whether it is solved in its plane.
    pub(super) planar: bool,
}

/// Dead loads.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Loads {
    /// Gravity per unit length.
    pub gravity: DVec3,
    /// Force on the joint tip, or on every free one.
    pub tip_force: DVec3,
    /// Moment on the tip of a single rod.
    pub tip_moment: DVec3,
}

/// What an assembly sums up over all rods.
#[derive(Clone, Copy, Debug, Default)]
pub struct Sums {
    /// Potential energy: of the strains, the coupling and the loads.
    pub energy: f64,
    /// Largest rotation between the ends of a segment.
    pub turn: f64,
}

impl<'a> DiscreteLeaf<'a> {
    /// Discretises `leaf` on `grid`.
    pub fn new(leaf: &'a Leaf<'a>, grid: Grid) -> Self {
        let n = grid.segments();
        let sections = (0..leaf.rods())
            .flat_map(|j| (0..n).map(move |i| (j, i)))
            .map(|(j, i)| leaf.section(j, grid.middle(i), grid.width(i)))
            .collect();
        let gaps = leaf.rods() - usize::from(!leaf.beside_image(leaf.rods() - 1));
        let coupling = (0..gaps).map(|g| leaf.coupling(g)).collect();
        let weights = (0..=n).map(|i| grid.weight(i)).collect();
        DiscreteLeaf {
            leaf,
            grid,
            sections,
            coupling,
            weights,
            load_factor: 1.0,
            loads: Loads {
                gravity: leaf.gravity,
                tip_force: leaf.tip_force,
                tip_moment: leaf.tip_moment,
            },
            mirrored: leaf.mirrored,
            planar: leaf.planar,
        }
    }

    /// The same rods, all of them, seen as those of `leaf`.
    pub fn seen_as(&self, leaf: &'a Leaf<'a>) -> Self {
        DiscreteLeaf {
            leaf,
            planar: leaf.planar,
            ..self.clone()
        }
    }

    /// The same, in space if it was in its plane.
    pub fn in_space(&self) -> Self {
        DiscreteLeaf {
            planar: false,
            ..self.clone()
        }
    }

    /// The smallest compliance of any segment, in units of L^2/A.
    pub fn stiffest(&self) -> f64 {
        self.sections
            .iter()
            .fold(f64::INFINITY, |m, s| m.min(s.compliance.min_element()))
    }

    /// The same leaf with no compliance below `floor`.
    pub fn softened(&self, floor: f64) -> Self {
        let mut soft = self.clone();
        let n = self.segments();
        for (k, section) in soft.sections.iter_mut().enumerate() {
            let floor = floor / self.leaf.share(k / n);
            section.compliance = section.compliance.max(DVec3::splat(floor));
            section.condensing = section.condensing.min(DVec3::splat(1.0 / floor));
        }
        soft
    }

    /// A shift of the matrix (times the mass matrix) that is far below the
    /// squared frequency of any bending mode, and above what rounding and
    /// unfinished iterations make of a neutral mode's zero.
    pub fn neutral_shift(&self) -> f64 {
        let stiffest = self
            .sections
            .iter()
            .fold(0.0_f64, |m, s| m.max(s.condensing.max_element()));
        let rounding = f64::EPSILON * stiffest * (self.segments() * self.segments()) as f64;
        1e-7 + 4.0 * rounding
    }

    /// Segments per rod.
    pub fn segments(&self) -> usize {
        self.grid.segments()
    }

    /// Number of rods.
    pub fn rods(&self) -> usize {
        self.leaf.rods()
    }

    /// Whether the rods feel each other other than through the tip.
    pub fn coupled(&self) -> bool {
        let between = self.coupling.iter().take(self.rods() - 1);
        between.into_iter().any(|&k| k != DVec3::ZERO)
    }

    /// Coupling of gap `g` at node `i`, force per displacement; none at a
    /// joint tip, which all rods share.
    pub(crate) fn spring(&self, g: usize, i: usize) -> DVec3 {
        if self.leaf.joined() && i == self.segments() {
            DVec3::ZERO
        } else {
            self.coupling[g] * self.weights[i]
        }
    }

    /// Dead moment on the tip of a single rod.
    pub fn tip_moment(&self) -> DVec3 {
        if self.rods() == 1 {
            self.loads.tip_moment * self.load_factor
        } else {
            DVec3::ZERO
        }
    }

    /// Mass of node `i` of rod `j` at unit density: rotary, translational.
    pub(super) fn mass(&self, j: usize, i: usize) -> [f64; 2] {
        let mass = self.weights[i] * self.leaf.length(j) * self.leaf.share(j);
        [RADIUS_OF_GYRATION * RADIUS_OF_GYRATION * mass, mass]
    }

    /// Segment `i` of rod `j` in `state`, carrying the force `n`.
    pub fn segment(&self, state: &State, j: usize, i: usize, n: DVec3) -> Segment {
        let k = state.base(j) + i;
        let ends = Ends {
            x: [state.x[k], state.x[k + 1]],
            q: [state.q[k], state.q[k + 1]],
        };
        Segment::new(self.section(j, i), &ends, n)
    }

    /// Section of segment `i` of rod `j`.
    #[inline]
    pub fn section(&self, j: usize, i: usize) -> &Section {
        &self.sections[j * self.segments() + i]
    }

    /// Dead load and coupling on node `i` of rod `j`, and its share of the
    /// potential energy (a gap's belongs to its lower rod). The tip force acts
    /// on every free tip, and once on a joint one, through the first rod.
    #[inline]
    pub fn load(&self, state: &State, j: usize, i: usize) -> (DVec3, f64) {
        let k = state.base(j) + i;
        let x = state.x[k];
        let share = self.leaf.share(j);
        let weight = self.load_factor * self.weights[i] * self.leaf.length(j) * share;
        let mut force = self.loads.gravity * weight;
        if i == self.segments() && (j == 0 || !self.leaf.joined()) {
            let share = match self.leaf.joined() && self.mirrored {
                true => 0.5,
                false => share,
            };
            force += share * self.load_factor * self.loads.tip_force;
        }
        let mut energy = -force.dot(x);
        if self.leaf.beside_image(j) {
            let pull = -2.0 * self.spring(j, i).y * x.y;
            force.y += pull;
            energy -= 0.5 * pull * x.y;
        }
        if j > 0 {
            force += self.spring(j - 1, i) * (state.x[k - self.segments() - 1] - x);
        }
        if j + 1 < self.rods() {
            let stretch = state.x[k + self.segments() + 1] - x;
            let pull = self.spring(j, i) * stretch;
            force += pull;
            energy += 0.5 * pull.dot(stretch);
        }
        (force, energy)
    }

    /// Potential energy of the dead loads in a state.
    pub fn potential(&self, state: &State) -> f64 {
        let nodes = (0..self.rods()).flat_map(|j| (0..=self.segments()).map(move |i| (j, i)));
        nodes
            .map(|(j, i)| self.load(state, j, i).1 - self.coupling_energy(state, j, i))
            .sum()
    }

    /// Energy of the coupling of node `i` of rod `j` to the next rod.
    pub fn coupling_energy(&self, state: &State, j: usize, i: usize) -> f64 {
        if j + 1 == self.rods() {
            return 0.0;
        }
        let k = state.base(j) + i;
        let stretch = state.x[k + self.segments() + 1] - state.x[k];
        0.5 * stretch.dot(self.spring(j, i) * stretch)
    }

    /// Sets all rest curvatures to the leaf's times `factor`.
    pub fn set_rest(&mut self, factor: f64) {
        let n = self.segments();
        for (k, section) in self.sections.iter_mut().enumerate() {
            let (j, i) = (k / n, k % n);
            let own = (self.leaf).section(j, self.grid.middle(i), self.grid.width(i));
            section.rest_curvature = factor * own.rest_curvature;
        }
    }

    /// Assembles matrix and right-hand side of Newton's equations into
    /// `system`.
    pub fn assemble(&self, state: &State, system: &mut System) -> Sums {
        let parallel = system.parallel();
        system.moment = self.tip_moment();
        each_rod(parallel, &mut system.rods, |j, rod| {
            let rhs = &mut rod.rhs;
            rod.sums = match &mut rod.matrix {
                RodMatrix::Spatial(chain, _) => {
                    let sums = self.assemble_spatial(j, state, chain, rhs);
                    self.confine(j, chain, rhs);
                    sums
                }
                RodMatrix::Planar(chain, _) => {
                    let sums = self.assemble_planar(j, state, chain, rhs);
                    self.confine(j, chain, rhs);
                    sums
                }
            };
        });
        let mut total = Sums::default();
        for rod in &system.rods {
            total.energy += rod.sums.energy;
            total.turn = total.turn.max(rod.sums.turn);
        }
        total
    }

    /// Assembles rod `j` of a leaf in space.
    fn assemble_spatial(
        &self,
        j: usize,
        state: &State,
        chain: &mut Chain<SPATIAL>,
        rhs: &mut [Increment],
    ) -> Sums {
        let n = self.segments();
        let mut sums = Sums::default();
        for i in 0..n {
            let force = state.n[j * n + i];
            let section = self.section(j, i);
            let segment = self.segment(state, j, i, force);
            sums.energy += section.strain_energy(&segment);
            sums.turn = sums.turn.max(segment.turn());
            let (g_x, g_a, g_b) = segment.condensed_gradient(section);
            let blocks = segment.hessian(section);
            if i > 0 {
                add_left(&mut chain.diagonal[i - 1], &blocks);
                couple(&mut chain.off[i - 1], &blocks);
                add(&mut rhs[i - 1], -g_a, g_x);
            }
            set_right(&mut chain.diagonal[i], &blocks);
            let (load, potential) = self.bear(state, j, i + 1, &mut chain.diagonal[i]);
            sums.energy += potential;
            rhs[i] = [0.0; 6];
            add(&mut rhs[i], -g_b, load - g_x);
        }
        add(&mut rhs[n - 1], self.tip_moment(), DVec3::ZERO);
        sums
    }

    /// Adds the stiffness of the coupling of node `i` of rod `j` to its block;
    /// tells [`DiscreteLeaf::load`].
    #[inline]
    pub(super) fn bear<const B: usize>(
        &self,
        state: &State,
        j: usize,
        i: usize,
        block: &mut Block<B>,
    ) -> (DVec3, f64) {
        let turns = turns(B);
        for g in [j.wrapping_sub(1), j] {
            if g < self.rods() - 1 {
                let spring = self.spring(g, i);
                for c in 0..B - turns {
                    block[turns + c][turns + c] += spring[c];
                }
            }
        }
        if self.leaf.beside_image(j) {
            let across = turns + 1;
            block[across][across] += 2.0 * self.spring(j, i).y;
        }
        self.load(state, j, i)
    }

    /// Writes the right-hand side of the change, to first order, if the rods
    /// had no compliance in the components `dropped` (ones and zeros).
    pub fn assemble_stiffening(&self, state: &State, dropped: DVec3, system: &mut System) {
        for (j, rod) in system.rods.iter_mut().enumerate() {
            rod.rhs.fill([0.0; 6]);
            match self.planar {
                false => self.stiffen_spatial(j, state, dropped, &mut rod.rhs),
                true => self.stiffen_planar(j, state, dropped, &mut rod.rhs),
            }
            if self.mirrored {
                for i in 0..self.segments() {
                    for &c in self.forbidden(j, i + 1) {
                        rod.rhs[i][c] = 0.0;
                    }
                }
            }
        }
    }

    fn stiffen_spatial(&self, j: usize, state: &State, dropped: DVec3, rhs: &mut [Increment]) {
        let n = self.segments();
        for i in 0..n {
            let segment = self.segment(state, j, i, state.n[j * n + i]);
            let (g_x, g_a, g_b) = segment.stiffening_gradient(self.section(j, i), dropped);
            if i > 0 {
                add(&mut rhs[i - 1], -g_a, g_x);
            }
            add(&mut rhs[i], -g_b, -g_x);
        }
    }

    /// The state after `step` times the increments in `solution` (rod after
    /// rod, nodes 1 to n), written over `next`.
    pub fn advance(&self, state: &State, solution: &System, step: f64, next: &mut State) {
        let n = self.segments();
        next.clone_from(state);
        if self.planar {
            return self.advance_planar(state, solution, step, next);
        }
        for (j, rod) in solution.rods.iter().enumerate() {
            let base = state.base(j);
            let (mut a, mut dx0) = (DVec3::ZERO, DVec3::ZERO);
            for i in 0..n {
                let increment = &rod.solution[i];
                let (b, dx1) = (turn(increment), shift(increment));
                let force = state.n[j * n + i];
                let segment = self.segment(state, j, i, force);
                next.n[j * n + i] =
                    force + step * segment.force_increment(self.section(j, i), dx1 - dx0, a, b);
                next.advance(base + i + 1, increment, step);
                (a, dx0) = (b, dx1);
            }
        }
    }

    /// Largest unbalanced nodal force or moment, or violation of the
    /// constitutive law (as length), of a state.
    pub fn residual(&self, state: &State) -> f64 {
        let n = self.segments();
        let mut largest = 0.0_f64;
        let mut tip = DVec3::ZERO;
        for j in 0..self.rods() {
            let (mut force, mut moment) = (DVec3::ZERO, DVec3::ZERO);
            for i in 0..n {
                let segment = self.segment(state, j, i, state.n[j * n + i]);
                let (g_x, g_a, g_b) = segment.gradient(self.section(j, i));
                if i > 0 {
                    let (forces, moments) = self.felt(j, force + g_x, moment - g_a);
                    largest = largest.max(forces).max(moments);
                }
                force = self.load(state, j, i + 1).0 - g_x;
                moment = -g_b;
                largest = largest.max(segment.gap.abs().max_element());
            }
            moment += self.tip_moment();
            let (force_felt, moment_felt) = self.felt(j, force, moment);
            largest = largest.max(moment_felt);
            tip += force;
            if !self.leaf.joined() {
                largest = largest.max(force_felt);
            }
        }
        if self.leaf.joined() {
            if self.mirrored {
                tip.y = 0.0;
            }
            largest.max(tip.abs().max_element())
        } else {
            largest
        }
    }

    /// Potential energy of a state: elastic, of the coupling, and of the loads.
    /// The dead moment on a rod's tip has no potential and is left out.
    pub fn energy(&self, state: &State) -> f64 {
        let n = self.segments();
        let mut energy = 0.0;
        for j in 0..self.rods() {
            for i in 0..n {
                let segment = self.segment(state, j, i, state.n[j * n + i]);
                energy +=
                    self.section(j, i).elastic_energy(&segment) + self.load(state, j, i + 1).1;
            }
        }
        energy
    }
}

#[inline]
fn add(increment: &mut [f64; 6], moment: DVec3, force: DVec3) {
    for c in 0..3 {
        increment[c] += moment[c];
        increment[3 + c] += force[c];
    }
}

#[inline]
fn place(block: &mut Block<SPATIAL>, row: usize, column: usize, k: &DMat3, sign: f64) {
    for c in 0..3 {
        let values = k.col(c);
        for r in 0..3 {
            block[row + r][column + c] = sign * values[r];
        }
    }
}

/// The block of a segment's right node.
#[inline]
fn set_right(block: &mut Block<SPATIAL>, k: &Blocks) {
    place(block, 0, 0, &k.bb, 1.0);
    place(block, 0, 3, &k.xb.transpose(), 1.0);
    place(block, 3, 0, &k.xb, 1.0);
    place(block, 3, 3, &k.xx, 1.0);
}

/// Adds the block of a segment's left node.
#[inline]
fn add_left(block: &mut Block<SPATIAL>, k: &Blocks) {
    let mut left = [[0.0; 6]; 6];
    place(&mut left, 0, 0, &k.aa, 1.0);
    place(&mut left, 0, 3, &k.xa.transpose(), -1.0);
    place(&mut left, 3, 0, &k.xa, -1.0);
    place(&mut left, 3, 3, &k.xx, 1.0);
    for r in 0..6 {
        for c in 0..6 {
            block[r][c] += left[r][c];
        }
    }
}

/// The block between a segment's left and right node.
#[inline]
fn couple(block: &mut Block<SPATIAL>, k: &Blocks) {
    place(block, 0, 0, &k.ab, 1.0);
    place(block, 0, 3, &k.xa.transpose(), 1.0);
    place(block, 3, 0, &k.xb, -1.0);
    place(block, 3, 3, &k.xx, -1.0);
}
