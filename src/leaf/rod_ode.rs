//! The equilibrium equations along the rods of a leaf as functions of sigma = s/L,
//!
//! x' = L R v,   q' = L/2 (R u) q,   n' = -f,   m' = n x x'          eqs (1) (2)
//!
//! with v = v0 + c R^T n and u = u0 + R^T m / A by eqs (5) and (6), n and m along the lab axes
//! and f the force per unit of sigma; and the potential energy up to sigma,
//!
//! E' = L/2 (n.c n + m.m/A) + potential of the loads,
//!
//! integrated by the explicit Runge-Kutta method of order 8 of Dormand and Prince, in equal steps.

use crate::leaf::block_tridiagonal::{RodLane, lane_rods, rod_lane};
use crate::leaf::discrete::{
    DiscreteLeaf, GroupLoads, LaneNodeForces, LaneRodLoads, NodeWeights, group_loads,
};
use crate::natural::{Natural, Pose, RESULT_WEIGHTS, STAGE_NODES, STAGE_WEIGHTS, STAGES};
use crate::rod::{NodePair, Section, StripLoads, TissueStrip};
use crate::rotation::{Quaternions, directors};
use crate::scenario::RodPlace;
use crate::simd::{
    GROUP, GroupKernel, Lanes, NumberGroup, Vectors, group_components, run, widest_arch,
};
use glam::{DQuat, DVec3};
use pulp::{Arch, Simd};

/// The fields of one rod at one sigma, along the lab axes.
#[derive(Clone, Copy, Debug)]
pub struct RodFields {
    /// Position of the centerline.
    pub x: DVec3,
    /// Rotation of the directors.
    pub q: DQuat,
    /// Force exerted by the part beyond.
    pub n: DVec3,
    /// Moment exerted by the part beyond.
    pub m: DVec3,
}

/// A change of the [`RodFields`] of a point, to first order, or a jump of them.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FieldChange {
    pub position: DVec3,
    /// Spatial rotation vector.
    pub rotation: DVec3,
    pub force: DVec3,
    pub moment: DVec3,
}

/// The fields of all rods at one sigma, in groups of four.
#[derive(Clone, Debug, Default)]
pub struct StationFields(Vec<GroupFields>);

impl StationFields {
    /// The fields of rod `j`.
    pub fn rod(&self, j: usize) -> RodFields {
        unpack_rod_fields(&self.0, j)
    }
}

/// The fields of rod `j` in its group.
fn unpack_rod_fields(groups: &[GroupFields], j: usize) -> RodFields {
    let RodLane { group, lane } = rod_lane(j);
    let vector =
        |first: usize| DVec3::from_array([0, 1, 2].map(|c| groups[group][first + c].0[lane]));
    let [x, y, z] = vector(QUATERNION).to_array();
    RodFields {
        x: vector(POSITION),
        q: DQuat::from_xyzw(x, y, z, groups[group][QUATERNION_W].0[lane]).normalize(),
        n: vector(FORCE),
        m: vector(MOMENT),
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
    /// The stress-free leaf, if there is tissue.
    natural: Option<Natural<'a>>,
}

/// The fields of a Runge-Kutta stage.
struct RungeKuttaStage {
    fields: Vec<GroupFields>,
    /// Positions again, contiguous for each axis, with padding before the first rod and after
    /// the last, so that those of neighbors are adjacent.
    x: [Vec<f64>; 3],
}

impl<'a> RodIntegrator<'a> {
    /// An integrator for the rods of `leaf`; its grid does not matter.
    pub fn new(leaf: &'a DiscreteLeaf) -> Self {
        let load = |j: usize| {
            let mut load = leaf.rod_load(j);
            if leaf.leaf.is_halved_midrib(j) {
                // The image of the neighbor pulls the midrib back into the plane.
                load.previous.y = 0.0;
            }
            load
        };
        let groups = leaf.rods().div_ceil(GROUP);
        let fields = vec![[NumberGroup::default(); FIELDS_PER_ROD]; groups];
        let mut integrator = RodIntegrator {
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
        integrator.look_up_laws_at(0.0.into());
        integrator
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
                let imaginary = DVec3::new(q.x, q.y, q.z);
                let vectors = [
                    (POSITION, x),
                    (QUATERNION, imaginary),
                    (FORCE, n),
                    (MOMENT, m),
                ];
                for (first, vector) in vectors {
                    for c in 0..3 {
                        group[first + c].0[lane] = vector[c];
                    }
                }
                group[QUATERNION_W].0[lane] = q.w;
                group[ENERGY].0[lane] = 0.0;
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
        let energy = |j: usize| {
            let at = rod_lane(j);
            self.fields[at.group][ENERGY].0[at.lane]
        };
        (0..self.leaf.rods()).map(energy).sum()
    }

    fn step(&mut self, sigma: f64, h: f64) {
        for i in 0..STAGES {
            self.set_stage(h, STAGE_WEIGHTS[i]);
            let place = RodPlace::within(sigma + STAGE_NODES[i] * h, [sigma, sigma + h]);
            if !self.uniform {
                self.look_up_laws_at(place);
            }
            let mut kernel = SlopeKernel {
                stage: &self.stage,
                loads: &self.loads,
                laws: &self.laws,
                out: &mut self.slopes[i],
            };
            run(self.arch, &mut kernel);
            self.add_tissue(place.sigma, i);
            self.add_own_loads(place, i);
            self.add_followers(place, i);
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
            let pose = natural.vein_pose(j, sigma);
            Pose {
                position: pose.position / leaf.scale.length,
                ..pose
            }
        };
        let here = |j: usize| {
            let RodFields { x, q, .. } = unpack_rod_fields(fields, j);
            Pose {
                position: x,
                rotation: q,
            }
        };
        let ends = |a: Pose, b: Pose| NodePair {
            x: [a.position, b.position],
            q: [a.rotation, b.rotation],
        };
        let mut left = (at_rest(0), here(0));
        for g in 0..leaf.rods() - 1 {
            let right = (at_rest(g + 1), here(g + 1));
            let stiffness = leaf.tissue_stiffness(g, sigma);
            let strip = TissueStrip::stress_free_between(
                stiffness.displacement,
                stiffness.fold,
                DVec3::ZERO,
                &ends(left.0, right.0),
            );
            let loads = strip.loads(&ends(left.1, right.1), DVec3::ZERO);
            let StripLoads { energy, on_nodes } = loads;
            let at = rod_lane(g);
            slopes[at.group][ENERGY].0[at.lane] += energy;
            for (j, mut load) in [g, g + 1].into_iter().zip(on_nodes) {
                if leaf.is_halved_midrib(j) {
                    // The image of the neighbor pulls the midrib back into the plane.
                    (load.moment.x, load.moment.z, load.force.y) = (0.0, 0.0, 0.0);
                }
                let at = rod_lane(j);
                let slopes = &mut slopes[at.group];
                for c in 0..3 {
                    slopes[FORCE + c].0[at.lane] -= load.force[c];
                    slopes[MOMENT + c].0[at.lane] -= load.moment[c];
                }
            }
            left = right;
        }
    }

    /// Adds the loads along veins that turn with their sections, and moments along them, to the slopes of a
    /// stage, at a place.
    fn add_followers(&mut self, place: RodPlace, stage: usize) {
        if !self.leaf.has_followers() {
            return;
        }
        for j in 0..self.leaf.rods() {
            let q = unpack_rod_fields(&self.stage.fields, j).q.normalize();
            let load = self.leaf.follower_along(j, place).wrench(q);
            let RodLane { group, lane } = rod_lane(j);
            let slopes = &mut self.slopes[stage][group];
            for c in 0..3 {
                slopes[FORCE + c].0[lane] -= load.force[c];
                slopes[MOMENT + c].0[lane] -= load.moment[c];
            }
        }
    }

    /// Adds the loads of single veins to the slopes of a stage, at a place.
    fn add_own_loads(&mut self, place: RodPlace, stage: usize) {
        if self.leaf.loads.rod_load_factor == 0.0 {
            return;
        }
        for j in 0..self.leaf.rods() {
            let force = self.leaf.rod_load_factor() * self.leaf.leaf.own_load_density(j, place);
            let RodLane { group, lane } = rod_lane(j);
            let slopes = &mut self.slopes[stage][group];
            for c in 0..3 {
                slopes[FORCE + c].0[lane] -= force[c];
            }
            let x = unpack_rod_fields(&self.stage.fields, j).x;
            slopes[ENERGY].0[lane] -= force.dot(x);
        }
    }

    /// Adds `sign` times the loads on points at `sigma` to the forces and moments of the rods.
    fn add_point_loads(&mut self, sigma: f64, sign: f64) {
        for j in 0..self.leaf.rods() {
            let q = unpack_rod_fields(&self.fields, j).q.normalize();
            let follower = self.leaf.point_follower_at(j, sigma).wrench(q);
            let force = sign * (self.leaf.point_force_at(j, sigma) + follower.force);
            let mut moment = sign * (self.leaf.dead_moment_at(sigma) + follower.moment);
            if self.leaf.has_levers() {
                moment += sign * self.leaf.lever_moment_at(j, sigma, q);
            }
            let RodLane { group, lane } = rod_lane(j);
            let fields = &mut self.fields[group];
            for c in 0..3 {
                fields[FORCE + c].0[lane] += force[c];
                fields[MOMENT + c].0[lane] += moment[c];
            }
        }
    }

    /// Sets the stage to the fields plus h times the weighted sum of slopes.
    fn set_stage(&mut self, h: f64, weights: &[f64]) {
        let mut kernel = StageKernel {
            fields: &self.fields,
            slopes: &self.slopes,
            step: h,
            weights,
            out: &mut self.stage,
        };
        run(self.arch, &mut kernel);
    }

    /// Looks up the constitutive laws of all rods at one place.
    fn look_up_laws_at(&mut self, place: RodPlace) {
        let (leaf, rods) = (&self.leaf.leaf, self.leaf.rods());
        let group = |g: usize| {
            let sections = lane_rods(g, rods).map(|j| leaf.section(j, place, 1.0));
            group_laws(sections.each_ref())
        };
        self.laws.clear();
        self.laws.extend((0..rods.div_ceil(GROUP)).map(group));
    }
}

/// Writes the slopes of all groups at a stage.
struct SlopeKernel<'a> {
    stage: &'a RungeKuttaStage,
    loads: &'a [GroupLoads],
    laws: &'a [GroupLaws],
    out: &'a mut [GroupFields],
}

impl GroupKernel for SlopeKernel<'_> {
    #[inline(always)]
    fn run<S: Simd>(&mut self, simd: S, part: usize) {
        // Per unit of sigma.
        let weights = NodeWeights {
            load: 1.0,
            coupling: 1.0,
        };
        for (g, out) in self.out.iter_mut().enumerate() {
            let fields = LaneFields::load_group(simd, &self.stage.fields[g], part);
            let first = GROUP * g + part;
            let [previous, next] =
                [first, first + 2].map(|at| Vectors::load(simd, &self.stage.x, at));
            let loads = LaneRodLoads::load_group(simd, &self.loads[g], part);
            let load = loads.node_forces([previous, fields.x, next], weights, false);
            fields
                .slopes(&self.laws[g], load, part)
                .store_group(out, part);
        }
    }
}

/// Writes a stage: the fields plus the step times the weighted sum of slopes.
struct StageKernel<'a> {
    fields: &'a [GroupFields],
    slopes: &'a [Vec<GroupFields>],
    step: f64,
    weights: &'a [f64],
    out: &'a mut RungeKuttaStage,
}

impl GroupKernel for StageKernel<'_> {
    #[inline(always)]
    fn run<S: Simd>(&mut self, simd: S, part: usize) {
        let h = Lanes::splat(simd, self.step);
        for (g, out) in self.out.fields.iter_mut().enumerate() {
            let mut sums = [Lanes::splat(simd, 0.0); FIELDS_PER_ROD];
            for (weight, slopes) in self.weights.iter().zip(self.slopes) {
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
const FIELDS_PER_ROD: usize = 14;

/// Indices of the first component of each field in [`GroupFields`].
const POSITION: usize = 0;
const QUATERNION: usize = 3;
const QUATERNION_W: usize = 6;
const FORCE: usize = 7;
const MOMENT: usize = 10;
const ENERGY: usize = 13;

/// The fields of the rods of a group at one sigma: positions, quaternions, forces and moments
/// along the lab axes, energies. An array, since every step of the integration is a sum of all.
type GroupFields = [NumberGroup; FIELDS_PER_ROD];

/// The fields of several rods at one sigma, as vectors.
#[derive(Clone, Copy)]
struct LaneFields<S: Simd> {
    x: Vectors<S>,
    /// Quaternions of any length.
    q: Quaternions<S>,
    n: Vectors<S>,
    m: Vectors<S>,
    energy: Lanes<S>,
}

/// The constitutive laws of the rods of a group at one sigma.
struct GroupLaws {
    length: NumberGroup,
    /// v0
    rest_strain: [NumberGroup; 3],
    /// u0
    rest_curvature: [NumberGroup; 3],
    /// c
    compliance: [NumberGroup; 3],
    /// 1/A
    couple_compliance: [NumberGroup; 3],
}

/// The laws of sections whose `ds` is the length of the rod.
fn group_laws(sections: [&Section; GROUP]) -> GroupLaws {
    let vectors = |of: fn(&Section) -> DVec3| group_components(sections.map(of));
    GroupLaws {
        length: NumberGroup(sections.map(|section| section.ds)),
        rest_strain: vectors(|section| section.rest_strain),
        rest_curvature: vectors(|section| section.rest_curvature),
        compliance: vectors(|section| section.compliance),
        couple_compliance: vectors(|section| 1.0 / section.couple_stiffness),
    }
}

impl<S: Simd> LaneFields<S> {
    /// The fields of the lanes from `part` on.
    #[inline(always)]
    fn load_group(simd: S, group: &GroupFields, part: usize) -> Self {
        let number = |k: usize| Lanes::load_group(simd, &group[k], part);
        let vector = |k: usize| Vectors::new(number(k), number(k + 1), number(k + 2));
        LaneFields {
            x: vector(POSITION),
            q: Quaternions {
                vector: vector(QUATERNION),
                scalar: number(QUATERNION_W),
            },
            n: vector(FORCE),
            m: vector(MOMENT),
            energy: number(ENERGY),
        }
    }

    /// Writes the fields of the lanes from `part` on.
    #[inline(always)]
    fn store_group(self, group: &mut GroupFields, part: usize) {
        let vectors = [
            (POSITION, self.x),
            (QUATERNION, self.q.vector),
            (FORCE, self.n),
            (MOMENT, self.m),
        ];
        for (first, vector) in vectors {
            for (k, component) in vector.array().into_iter().enumerate() {
                component.store_group(&mut group[first + k], part);
            }
        }
        self.q.scalar.store_group(&mut group[QUATERNION_W], part);
        self.energy.store_group(&mut group[ENERGY], part);
    }

    /// The derivatives of the fields with respect to sigma under a load, of the lanes from `part` on.
    #[inline(always)]
    fn slopes(&self, laws: &GroupLaws, load: LaneNodeForces<S>, part: usize) -> Self {
        let (q, w) = (self.q.vector, self.q.scalar);
        let vector = |group: &[NumberGroup; 3]| Vectors::load_group(w.simd, group, part);
        let [half, two] = [0.5, 2.0].map(|number| Lanes::splat(w.simd, number));
        let frame = directors(self.q, two / w.mul_add(w, q.dot(q)));
        let (n, m) = (
            self.n.director_components(frame),
            self.m.director_components(frame),
        );
        let length = Lanes::load_group(w.simd, &laws.length, part);
        let strain = vector(&laws.compliance) * n;
        let bend = vector(&laws.couple_compliance) * m;
        let v = vector(&laws.rest_strain) + strain;
        let u = vector(&laws.rest_curvature) + bend;
        let tangent = v.from_director_components(frame).scale(length);
        let turn = u.from_director_components(frame).scale(length * half);
        LaneFields {
            x: tangent,
            q: Quaternions {
                vector: turn.scale(w) + turn.cross(q),
                scalar: -turn.dot(q),
            },
            n: -load.force,
            m: self.n.cross(tangent),
            energy: half * length * (n.dot(strain) + m.dot(bend)) + load.energy,
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
