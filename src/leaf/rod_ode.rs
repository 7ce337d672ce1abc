//! Integration of the equilibrium equations along the rods of a leaf, by the explicit
//! Runge-Kutta method of order 8 of Dormand and Prince, in equal steps.
//!
//! The equilibrium equations along rods, as functions of sigma = s/L:
//!
//! x' = L R v,   q' = L/2 (R u) q,   n' = -f,   m' = n x x'          eqs (1) (2)
//!
//! with v = v0 + c R^T n and u = u0 + R^T m / A by eqs (5) and (6), n and m along the lab axes
//! and f the force per unit of sigma; and the potential energy up to sigma,
//!
//! E' = L/2 (n.c n + m.m/A) + potential of the loads.

use crate::leaf::block_tridiagonal::lane_rods;
use crate::leaf::discrete::{DiscreteLeaf, GroupLoads, LaneRodLoads, group_loads};
use crate::natural::{Natural, RESULT_WEIGHTS, STAGE_NODES, STAGE_WEIGHTS, STAGES};
use crate::rod::{NodePair, Section, TissueStrip};
use crate::rotation::{Quaternions, directors};
use crate::simd::{GROUP, GroupKernel, Lanes, NumberGroup, Vectors, run, widest_arch};
use glam::{DQuat, DVec3};
use pulp::{Arch, Simd};

/// The fields of one rod at one sigma, along the lab axes.
#[derive(Clone, Copy, Debug)]
pub struct RodFields {
    /// Position.
    pub x: DVec3,
    /// Rotation.
    pub q: DQuat,
    /// Force exerted by the part beyond.
    pub n: DVec3,
    /// Moment exerted by the part beyond.
    pub m: DVec3,
}

/// The fields of all rods at one sigma, in groups of four.
#[derive(Clone, Debug, Default)]
pub struct StationFields(Vec<GroupFields>);

impl StationFields {
    /// Rod `j`.
    pub fn rod(&self, j: usize) -> RodFields {
        rod_of(&self.0, j)
    }
}

/// The fields of rod `j`.
fn rod_of(groups: &[GroupFields], j: usize) -> RodFields {
    let number = |k: usize| groups[j / GROUP][k].0[j % GROUP];
    let vector = |k: usize| DVec3::new(number(k), number(k + 1), number(k + 2));
    RodFields {
        x: vector(0),
        q: DQuat::from_xyzw(number(3), number(4), number(5), number(6)).normalize(),
        n: vector(7),
        m: vector(10),
    }
}

/// Integrates the equations of all rods of a leaf.
pub struct RodIntegrator<'a> {
    leaf: &'a DiscreteLeaf,
    arch: Arch,
    loads: Vec<GroupLoads>,
    fields: Vec<GroupFields>,
    stage: RungeKuttaStage,
    /// Slopes of each stage and group.
    slopes: Vec<Vec<GroupFields>>,
    /// Constitutive laws at the present stage; constant if the rods are uniform.
    laws: Vec<GroupLaws>,
    uniform: bool,
    /// Where tissue has no force, if there is any.
    natural: Option<Natural<'a>>,
}

/// The fields of a Runge-Kutta stage.
struct RungeKuttaStage {
    fields: Vec<GroupFields>,
    /// Positions again, contiguous for each axis, with padding before the first rod and after
    /// the last, so that those of neighbours are adjacent.
    x: [Vec<f64>; 3],
}

impl<'a> RodIntegrator<'a> {
    /// For the rods of `leaf`, on any grid.
    pub fn new(leaf: &'a DiscreteLeaf) -> Self {
        let load = |j: usize| {
            let mut load = leaf.rod_load(j);
            if leaf.leaf.is_halved_midrib(j) {
                // The image of its neighbour pulls it back into the plane.
                load.previous.y = 0.0;
            }
            load
        };
        let groups = leaf.rods().div_ceil(GROUP);
        let fields = vec![[NumberGroup::default(); FIELDS_PER_ROD]; groups];
        let mut flow = RodIntegrator {
            leaf,
            arch: widest_arch(),
            loads: (0..groups)
                .map(|group| group_loads(lane_rods(group, leaf.rods()).map(load)))
                .collect(),
            stage: RungeKuttaStage {
                fields: fields.clone(),
                x: std::array::from_fn(|_| vec![0.0; GROUP * groups + 2]),
            },
            slopes: vec![fields.clone(); STAGES],
            laws: Vec::with_capacity(groups),
            uniform: leaf.leaf.has_uniform_sections(),
            natural: leaf.has_tissue().then(|| {
                let scenario = leaf.leaf.scenario();
                Natural::new(scenario, scenario.tissue_grown)
            }),
            fields,
        };
        flow.look_up_laws(0.0);
        flow
    }

    /// Integrates all rods from the fields `begin` at sigma = `from` to `to` in equal steps,
    /// one per slice of `after`, and writes the fields after every step. Where a load acts on a
    /// point, the fields are those just before it, seen from the base.
    pub fn integrate(
        &mut self,
        begin: impl Fn(usize) -> RodFields,
        [from, to]: [f64; 2],
        after: &mut [StationFields],
    ) {
        let rods = self.leaf.rods();
        for (g, group) in self.fields.iter_mut().enumerate() {
            for (lane, j) in lane_rods(g, rods).into_iter().enumerate() {
                let RodFields { x, q, n, m } = begin(j);
                let vectors = [(0, x), (3, DVec3::new(q.x, q.y, q.z)), (7, n), (10, m)];
                for (first, vector) in vectors {
                    for c in 0..3 {
                        group[first + c].0[lane] = vector[c];
                    }
                }
                group[6].0[lane] = q.w;
                group[13].0[lane] = 0.0;
            }
        }
        let (h, last) = ((to - from) / after.len() as f64, after.len() - 1);
        let points = !self.leaf.leaf.scenario().points.is_empty();
        if points && h > 0.0 {
            self.add_point_loads(from, -1.0);
        }
        for (step, StationFields(after)) in after.iter_mut().enumerate() {
            self.step(from + h * step as f64, h);
            if points && h < 0.0 && step == last {
                self.add_point_loads(to, 1.0);
            }
            after.clone_from(&self.fields);
        }
    }

    /// The potential energy of all rods over the interval of the last integration, without
    /// that of loads on the tips.
    pub fn energy(&self) -> f64 {
        let energy = |j: usize| self.fields[j / GROUP][13].0[j % GROUP];
        (0..self.leaf.rods()).map(energy).sum()
    }

    fn step(&mut self, sigma: f64, h: f64) {
        for i in 0..STAGES {
            self.set_stage(h, STAGE_WEIGHTS[i]);
            if !self.uniform {
                self.look_up_laws(sigma + STAGE_NODES[i] * h);
            }
            let mut kernel = SlopeKernel {
                stage: &self.stage,
                loads: &self.loads,
                laws: &self.laws,
                out: &mut self.slopes[i],
            };
            run(self.arch, &mut kernel);
            self.add_tissue(sigma + STAGE_NODES[i] * h, i);
            self.add_own_loads(sigma + STAGE_NODES[i] * h, i);
        }
        self.set_stage(h, &RESULT_WEIGHTS);
        std::mem::swap(&mut self.fields, &mut self.stage.fields);
    }

    /// Adds the forces and moments of the tissue to the slopes of a stage, at `sigma`.
    fn add_tissue(&mut self, sigma: f64, stage: usize) {
        let Some(natural) = &self.natural else {
            return;
        };
        let (leaf, fields, slopes) = (&self.leaf.leaf, &self.stage.fields, &mut self.slopes[stage]);
        let at_rest = |j: usize| {
            let (x, q) = natural.vein_pose(j, sigma);
            (x / leaf.scale.length, q)
        };
        let here = |j: usize| {
            let RodFields { x, q, .. } = rod_of(fields, j);
            (x, q)
        };
        let ends = |a: (DVec3, DQuat), b: (DVec3, DQuat)| NodePair {
            x: [a.0, b.0],
            q: [a.1, b.1],
        };
        let mut left = (at_rest(0), here(0));
        for g in 0..leaf.rods() - 1 {
            let right = (at_rest(g + 1), here(g + 1));
            let [stiffness, fold] = leaf.tissue_stiffness(g, sigma);
            let strip = TissueStrip::stress_free_between(stiffness, fold.x, &ends(left.0, right.0));
            let ends = ends(left.1, right.1);
            let (energy, loads) = strip.energy_and_loads(&ends);
            slopes[g / GROUP][13].0[g % GROUP] += energy;
            for (j, [mut moment, mut force]) in [g, g + 1].into_iter().zip(loads) {
                if leaf.is_halved_midrib(j) {
                    // The image of its neighbour pulls it back into the plane.
                    (moment.x, moment.z, force.y) = (0.0, 0.0, 0.0);
                }
                let (slopes, lane) = (&mut slopes[j / GROUP], j % GROUP);
                for c in 0..3 {
                    slopes[7 + c].0[lane] -= force[c];
                    slopes[10 + c].0[lane] -= moment[c];
                }
            }
            left = right;
        }
    }

    /// Adds the loads that veins have of their own to the slopes of a stage, at `sigma`.
    fn add_own_loads(&mut self, sigma: f64, stage: usize) {
        if self.leaf.loads.rod_load_factor == 0.0 {
            return;
        }
        for j in 0..self.leaf.rods() {
            let force = self.leaf.rod_load_factor() * self.leaf.leaf.own_load_density(j, sigma);
            let slopes = &mut self.slopes[stage][j / GROUP];
            for c in 0..3 {
                slopes[7 + c].0[j % GROUP] -= force[c];
            }
            let x = rod_of(&self.stage.fields, j).x;
            slopes[13].0[j % GROUP] -= force.dot(x);
        }
    }

    /// Adds `sign` times the forces and moments on points at `sigma` to those of the fields.
    fn add_point_loads(&mut self, sigma: f64, sign: f64) {
        for j in 0..self.leaf.rods() {
            let force = sign * self.leaf.point_force_at(j, sigma);
            let moment = sign * self.leaf.dead_moment_at(sigma);
            let fields = &mut self.fields[j / GROUP];
            for c in 0..3 {
                fields[7 + c].0[j % GROUP] += force[c];
                fields[10 + c].0[j % GROUP] += moment[c];
            }
        }
    }

    /// Sets the stage to the fields plus h times the weighted sum of slopes.
    fn set_stage(&mut self, h: f64, weights: &[f64]) {
        let mut kernel = StageKernel {
            fields: &self.fields,
            slopes: &self.slopes,
            weights: (h, weights),
            out: &mut self.stage,
        };
        run(self.arch, &mut kernel);
    }

    /// Looks up the constitutive laws of all rods at one sigma.
    fn look_up_laws(&mut self, sigma: f64) {
        let (leaf, rods) = (&self.leaf.leaf, self.leaf.rods());
        let group = |g: usize| {
            let sections = lane_rods(g, rods).map(|j| leaf.section(j, sigma, 1.0));
            laws(sections.each_ref())
        };
        self.laws.clear();
        self.laws.extend((0..rods.div_ceil(GROUP)).map(group));
    }
}

struct SlopeKernel<'a> {
    stage: &'a RungeKuttaStage,
    loads: &'a [GroupLoads],
    laws: &'a [GroupLaws],
    out: &'a mut [GroupFields],
}

impl GroupKernel for SlopeKernel<'_> {
    #[inline(always)]
    fn run<S: Simd>(&mut self, simd: S, part: usize) {
        for (g, out) in self.out.iter_mut().enumerate() {
            let fields = LaneFields::load_group(simd, &self.stage.fields[g], part);
            let first = GROUP * g + part;
            let [previous, next] =
                [first, first + 2].map(|at| Vectors::load(simd, &self.stage.x, at));
            let loads = LaneRodLoads::load_group(simd, &self.loads[g], part);
            let load = loads.node_forces([previous, fields.x, next], [1.0; 2], false);
            fields
                .slopes(&self.laws[g], load, part)
                .store_group(out, part);
        }
    }
}

struct StageKernel<'a> {
    fields: &'a [GroupFields],
    slopes: &'a [Vec<GroupFields>],
    weights: (f64, &'a [f64]),
    out: &'a mut RungeKuttaStage,
}

impl GroupKernel for StageKernel<'_> {
    #[inline(always)]
    fn run<S: Simd>(&mut self, simd: S, part: usize) {
        let (h, weights) = self.weights;
        let h = Lanes::splat(simd, h);
        for (g, out) in self.out.fields.iter_mut().enumerate() {
            let mut sums = [Lanes::splat(simd, 0.0); FIELDS_PER_ROD];
            for (weight, slopes) in weights.iter().zip(self.slopes) {
                if *weight != 0.0 {
                    let weight = Lanes::splat(simd, *weight);
                    for (sum, slope) in sums.iter_mut().zip(&slopes[g]) {
                        *sum = Lanes::load_group(simd, slope, part).mul_add(weight, *sum);
                    }
                }
            }
            for ((out, sum), field) in out.iter_mut().zip(&mut sums).zip(&self.fields[g]) {
                let field = Lanes::load_group(simd, field, part);
                *sum = sum.mul_add(h, field);
                sum.store_group(out, part);
            }
            for (x, sum) in self.out.x.iter_mut().zip(sums) {
                sum.store(x, GROUP * g + part + 1);
            }
        }
    }
}

/// Number of fields of a rod at one sigma.
pub const FIELDS_PER_ROD: usize = 14;

/// The fields of the rods of a group at one sigma: positions, quaternions, forces and moments
/// along the lab axes, energies.
pub type GroupFields = [NumberGroup; FIELDS_PER_ROD];

/// The fields of several rods at one sigma, as vectors.
#[derive(Clone, Copy)]
pub struct LaneFields<S: Simd> {
    /// Positions.
    pub x: Vectors<S>,
    /// Rotations; quaternions of any length.
    pub q: Quaternions<S>,
    /// Forces.
    pub n: Vectors<S>,
    /// Moments.
    pub m: Vectors<S>,
    /// Energies.
    pub energy: Lanes<S>,
}

/// The coefficients of the equations for a group of rods: lengths, v0, u0, c, 1/A.
pub type GroupLaws = [NumberGroup; 13];

/// The coefficients from sections whose `ds` is the length of the rod.
pub fn laws(sections: [&Section; GROUP]) -> GroupLaws {
    let number = |k: usize| {
        let of = |section: &Section| match k {
            0 => section.ds,
            1..4 => section.rest_strain[k - 1],
            4..7 => section.rest_curvature[k - 4],
            7..10 => section.compliance[k - 7],
            _ => 1.0 / section.couple_stiffness[k - 10],
        };
        NumberGroup(sections.map(of))
    };
    std::array::from_fn(number)
}

impl<S: Simd> LaneFields<S> {
    /// The fields of the lanes from `part` on.
    #[inline(always)]
    pub fn load_group(simd: S, group: &GroupFields, part: usize) -> Self {
        let number = |k: usize| Lanes::load_group(simd, &group[k], part);
        let vector = |k: usize| Vectors::new(number(k), number(k + 1), number(k + 2));
        LaneFields {
            x: vector(0),
            q: (vector(3), number(6)),
            n: vector(7),
            m: vector(10),
            energy: number(13),
        }
    }

    /// Writes them.
    #[inline(always)]
    pub fn store_group(self, group: &mut GroupFields, part: usize) {
        for (first, vector) in [(0, self.x), (3, self.q.0), (7, self.n), (10, self.m)] {
            for (k, component) in vector.array().into_iter().enumerate() {
                component.store_group(&mut group[first + k], part);
            }
        }
        self.q.1.store_group(&mut group[6], part);
        self.energy.store_group(&mut group[13], part);
    }

    /// Their derivatives with respect to sigma under a force with its potential, of the lanes
    /// from `part` on.
    #[inline(always)]
    pub fn slopes(
        &self,
        laws: &GroupLaws,
        (force, potential): (Vectors<S>, Lanes<S>),
        part: usize,
    ) -> Self {
        let (q, w) = self.q;
        let law = |k: usize| Lanes::load_group(w.simd, &laws[k], part);
        let laws = |k: usize| Vectors::new(law(k), law(k + 1), law(k + 2));
        let [half, two] = [0.5, 2.0].map(|number| Lanes::splat(w.simd, number));
        let frame = directors(self.q, two / w.mul_add(w, q.dot(q)));
        let (n, m) = (
            self.n.director_components(frame),
            self.m.director_components(frame),
        );
        let (length, strain, bend) = (law(0), laws(7) * n, laws(10) * m);
        let (v, u) = (laws(1) + strain, laws(4) + bend);
        let tangent = v.from_director_components(frame).scale(length);
        let turn = u.from_director_components(frame).scale(length * half);
        LaneFields {
            x: tangent,
            q: (turn.scale(w) + turn.cross(q), -turn.dot(q)),
            n: -force,
            m: self.n.cross(tangent),
            energy: half * length * (n.dot(strain) + m.dot(bend)) + potential,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::leaf::{Grid, Leaf};
    use crate::scenario::Scenario;

    const ROD: &str = r#"
        name = "rod"
        leaf = { rods = 1, length = 1.0, fan = [0.0] }
        stiffness = { torsion = 1.0, bending_2 = 1.0, bending_3 = 1.0, axial = inf, shear_2 = inf, shear_3 = inf }
    "#;

    /// Largest distance from the exact circle of a rod bent by a moment of 3 A/L, integrated
    /// in `steps` steps.
    fn off_circle(steps: usize) -> f64 {
        const CURVATURE: f64 = 3.0;
        let rod = Scenario::from_toml(ROD).unwrap();
        let leaf = DiscreteLeaf::new(&Leaf::new(&rod), Grid::new(1, &[]));
        let begin = |_: usize| RodFields {
            x: DVec3::ZERO,
            q: DQuat::IDENTITY,
            n: DVec3::ZERO,
            m: CURVATURE * DVec3::Z,
        };
        let mut after = vec![StationFields::default(); steps];
        RodIntegrator::new(&leaf).integrate(begin, [0.0, 1.0], &mut after);
        let off = |(k, slice): (usize, &StationFields)| {
            let angle = CURVATURE * (k + 1) as f64 / steps as f64;
            let circle = DVec3::new(angle.sin(), 1.0 - angle.cos(), 0.0) / CURVATURE;
            (slice.rod(0).x - circle).length()
        };
        after.iter().enumerate().map(off).fold(0.0, f64::max)
    }

    #[test]
    fn a_moment_bends_a_rod_to_a_circle_with_order_8() {
        let errors = [1, 2, 4].map(off_circle);
        for pair in errors.windows(2) {
            let order = (pair[0] / pair[1]).log2();
            assert!((7.5..9.5).contains(&order), "{errors:?}: {order}");
        }
    }
}
