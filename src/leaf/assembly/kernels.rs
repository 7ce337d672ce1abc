//! The loops over the segments of a group of rods.

use crate::lanes::{Four, GROUP, Kernel, Lanes, Vectors};
use crate::largest::larger;
use crate::leaf::chain::{Increments, TURNS, lanes_of};
use crate::leaf::discrete::DiscreteLeaf;
use crate::leaf::loads::{GroupLoads, RodLoads, group_loads};
use crate::leaf::state::State;
use crate::leaf::system::{Group, Sums, rods_of};
use crate::rod::{Element, Nodes, Section, Sections, UNKNOWNS, on_nodes};
use crate::rotation::{Quaternions, exp_each, multiply_each};
use glam::{DQuat, DVec3};
use pulp::Simd;
use std::ops::Range;

/// The rods of a group in a state; lanes without a rod repeat the last.
pub struct Rods<'a> {
    leaf: &'a DiscreteLeaf,
    group: usize,
    sections: [&'a [Section]; GROUP],
    x: [&'a [DVec3]; GROUP],
    q: [&'a [DQuat]; GROUP],
    n: [&'a [DVec3]; GROUP],
    /// Positions of the previous and the next rods, or their own if there is none.
    beside: [[&'a [DVec3]; GROUP]; 2],
    loads: GroupLoads,
}

impl<'a> Rods<'a> {
    pub fn new(leaf: &'a DiscreteLeaf, state: &'a State, group: usize) -> Self {
        let (n, last) = (leaf.segments(), leaf.rods() - 1);
        let rods = lanes_of(group, leaf.rods());
        let x = |j: usize| &state.x[state.base(j)..][..=n];
        Rods {
            leaf,
            group,
            sections: rods.map(|j| &leaf.sections[j * n..][..n]),
            x: rods.map(x),
            q: rods.map(|j| &state.q[state.base(j)..][..=n]),
            n: rods.map(|j| &state.n[j * n..][..n]),
            beside: [
                rods.map(|j| x(j.saturating_sub(1))),
                rods.map(|j| x((j + 1).min(last))),
            ],
            loads: group_loads(rods.map(|j| leaf.rod_load(j))),
        }
    }

    #[inline(always)]
    fn q<S: Simd>(&self, simd: S, i: usize, part: usize) -> Quaternions<S> {
        let [a, b, c, d] = self.q;
        let (a, b, c, d) = (a[i], b[i], c[i], d[i]);
        let vector = |q: DQuat| DVec3::new(q.x, q.y, q.z);
        let v = Vectors::gather(simd, [vector(a), vector(b), vector(c), vector(d)], part);
        (v, Lanes::of(simd, &Four([a.w, b.w, c.w, d.w]), part))
    }

    #[inline(always)]
    fn sections<S: Simd>(&self, simd: S, i: usize, part: usize) -> Sections<S> {
        let [a, b, c, d] = self.sections;
        Sections::gather(simd, [&a[i], &b[i], &c[i], &d[i]], part)
    }

    /// Segment `i` of every rod, and its sections.
    #[inline(always)]
    fn element<S: Simd>(&self, simd: S, i: usize, part: usize) -> (Element<S>, Sections<S>) {
        let nodes = Nodes {
            x: [
                gather(simd, self.x, i, part),
                gather(simd, self.x, i + 1, part),
            ],
            q: [self.q(simd, i, part), self.q(simd, i + 1, part)],
        };
        let sections = self.sections(simd, i, part);
        let n = gather(simd, self.n, i, part);
        (Element::new(&sections, &nodes, n), sections)
    }
}

/// Number `i` of the vectors of each lane.
#[inline(always)]
fn gather<S: Simd>(simd: S, of: [&[DVec3]; GROUP], i: usize, part: usize) -> Vectors<S> {
    let [a, b, c, d] = of;
    Vectors::gather(simd, [a[i], b[i], c[i], d[i]], part)
}

/// Right-hand side and energy, and the matrix if requested.
pub struct Assemble<'a, const MATRIX: bool> {
    pub rods: Rods<'a>,
    pub group: &'a mut Group,
}

impl<const MATRIX: bool> Kernel for Assemble<'_, MATRIX> {
    #[inline(always)]
    fn run<S: Simd>(&mut self, simd: S, part: usize) {
        let Group {
            matrix,
            rhs,
            active,
            sums,
            ..
        } = &mut *self.group;
        let (rods, active) = (&self.rods, Lanes::of(simd, active, part));
        let zero = Lanes::splat(simd, 0.0);
        let loads = RodLoads::of(simd, &rods.loads, part);
        let stiffness = loads.stiffness().array();
        let (mut energy, mut squared_turn) = (zero, zero);
        let (mut own, mut force) = ([[zero; UNKNOWNS]; UNKNOWNS], [zero; UNKNOWNS]);
        let (n, first) = (rods.leaf.segments(), rods.leaf.first_node());
        for i in 0..n {
            let (element, sections) = rods.element(simd, i, part);
            energy = energy + element.strain_energy(&sections);
            squared_turn = squared_turn.larger(element.squared_turn());
            let gradient = on_nodes(element.condensed(&sections));
            if i >= first {
                for r in 0..UNKNOWNS {
                    let force = active * (force[r] - gradient[0][r]);
                    force.put(&mut rhs[i - first][r], part);
                }
            }
            if MATRIX {
                let hessian = element.hessian(&sections);
                if i >= first {
                    for r in 0..UNKNOWNS {
                        for c in r..UNKNOWNS {
                            own[r][c] = own[r][c] + hessian.own[0][r][c];
                        }
                    }
                    matrix.put(i - first, &own, Some(&hessian.across), active, part);
                }
                own = hessian.own[1];
            }
            let tip = i + 1 == n;
            let weights = [
                rods.leaf.grid.weight(i + 1),
                rods.leaf.coupling_weight(i + 1),
            ];
            let [previous, next] = rods.beside;
            let x = [
                gather(simd, previous, i + 1, part),
                gather(simd, rods.x, i + 1, part),
                gather(simd, next, i + 1, part),
            ];
            let (load, potential) = loads.at(x, weights, tip);
            energy = energy + potential;
            let load = load.array();
            let coupling_weight = Lanes::splat(simd, weights[1]);
            for r in 0..UNKNOWNS {
                force[r] = -gradient[1][r];
                if r >= TURNS {
                    let c = r - TURNS;
                    force[r] = force[r] + load[c];
                    own[r][r] = stiffness[c].mul_add(coupling_weight, own[r][r]);
                }
            }
        }
        for r in 0..UNKNOWNS {
            (active * force[r]).put(&mut rhs[n - first][r], part);
        }
        if MATRIX {
            matrix.put(n - first, &own, None, active, part);
        }
        if part == 0 {
            *sums = Sums::default();
        }
        sums.energy += energy.where_positive(active, zero).sum();
        sums.turn = larger(sums.turn, squared_turn.largest().sqrt());
    }
}

/// The right-hand side of [`DiscreteLeaf::assemble_stiffening`].
pub struct Stiffen<'a> {
    pub rods: Rods<'a>,
    pub dropped: DVec3,
    pub group: &'a mut Group,
}

impl Kernel for Stiffen<'_> {
    #[inline(always)]
    fn run<S: Simd>(&mut self, simd: S, part: usize) {
        let Group { rhs, active, .. } = &mut *self.group;
        let active = Lanes::of(simd, active, part);
        let dropped = Vectors::splat(simd, self.dropped.to_array());
        let none = [Lanes::splat(simd, 0.0); UNKNOWNS];
        let (n, first) = (self.rods.leaf.segments(), self.rods.leaf.first_node());
        let mut force = none;
        for i in 0..=n {
            let gradient = match i < n {
                true => {
                    let (element, sections) = self.rods.element(simd, i, part);
                    on_nodes(element.stiffening(&sections, dropped))
                }
                false => [none; 2],
            };
            for r in 0..UNKNOWNS {
                if i >= first {
                    let force = active * (force[r] - gradient[0][r]);
                    force.put(&mut rhs[i - first][r], part);
                }
                force[r] = -gradient[1][r];
            }
        }
    }
}

/// The next state of a group, without clamped bases, which stay.
pub struct Advance<'a> {
    pub rods: Rods<'a>,
    pub solution: &'a [Increments],
    pub step: f64,
    pub x: &'a mut [DVec3],
    pub q: &'a mut [DQuat],
    pub n: &'a mut [DVec3],
}

impl Kernel for Advance<'_> {
    #[inline(always)]
    fn run<S: Simd>(&mut self, simd: S, part: usize) {
        let step = Lanes::splat(simd, self.step);
        let lanes = rods_of(self.rods.group, self.rods.leaf.rods()).len();
        let lanes = part..lanes.min(part + S::F64_LANES);
        let none = Vectors::splat(simd, [0.0; 3]);
        let (mut turn, mut shift) = (none, none);
        let segments = self.rods.leaf.segments();
        let ahead = self.solution.len() - segments;
        if ahead > 0 {
            turn = vectors(simd, &self.solution[0], 0, part);
            self.turn_bases(turn.scale(step), lanes.clone(), part);
        }
        for (i, increment) in self.solution[ahead..].iter().enumerate() {
            let of = |c: usize| vectors(simd, increment, c, part);
            let (turn_after, shift_after) = (of(0), of(3));
            let rods = &self.rods;
            let (element, sections) = rods.element(simd, i, part);
            let turns = [turn, turn_after];
            let change = element.force_increment(&sections, shift_after - shift, turns);
            let n = change.mul_add(step, gather(simd, rods.n, i, part));
            let x = shift_after.mul_add(step, gather(simd, rods.x, i + 1, part));
            let turned = exp_each(turn_after.scale(step));
            let (q, qw) = multiply_each(turned, rods.q(simd, i + 1, part));
            let mut numbers = [Four::default(); 10];
            let [n, x, q] = [n, x, q].map(Vectors::array);
            for c in 0..3 {
                n[c].put(&mut numbers[c], part);
                x[c].put(&mut numbers[3 + c], part);
                q[c].put(&mut numbers[6 + c], part);
            }
            qw.put(&mut numbers[9], part);
            for lane in lanes.clone() {
                let [n1, n2, n3, x1, x2, x3, q1, q2, q3, qw] = numbers.map(|four| four.0[lane]);
                let node = lane * (segments + 1) + i + 1;
                self.n[lane * segments + i] = DVec3::new(n1, n2, n3);
                self.x[node] = DVec3::new(x1, x2, x3);
                self.q[node] = DQuat::from_xyzw(q1, q2, q3, qw);
            }
            (turn, shift) = (turn_after, shift_after);
        }
    }
}

impl Advance<'_> {
    /// Turns the bases, which hinges hold in their places.
    #[inline(always)]
    fn turn_bases<S: Simd>(&mut self, turn: Vectors<S>, lanes: Range<usize>, part: usize) {
        let simd = turn.x.simd;
        let (q, qw) = multiply_each(exp_each(turn), self.rods.q(simd, 0, part));
        let mut numbers = [Four::default(); 4];
        let [x, y, z] = q.array();
        for (number, four) in [x, y, z, qw].into_iter().zip(&mut numbers) {
            number.put(four, part);
        }
        let nodes = self.rods.leaf.segments() + 1;
        for lane in lanes {
            self.q[lane * nodes] = DQuat::from_array(numbers.map(|four| four.0[lane]));
        }
    }
}

/// The components of increments from `c` on.
#[inline(always)]
fn vectors<S: Simd>(simd: S, of: &Increments, c: usize, part: usize) -> Vectors<S> {
    let [x, y, z] = [&of[c], &of[c + 1], &of[c + 2]];
    Vectors::new(
        Lanes::of(simd, x, part),
        Lanes::of(simd, y, part),
        Lanes::of(simd, z, part),
    )
}
