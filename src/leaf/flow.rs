//! The fields of a leaf carried along its rods by the equilibrium equations: by the
//! explicit Runge-Kutta method of order 8 of Dormand and Prince, in equal steps.

use super::discrete::DiscreteLeaf;
use super::loads::{RodLoad, RodLoads};
use crate::lanes::{Four, GROUP, Kernel, Lanes, Vectors, arch, run};
use crate::rod::{FIELDS, Fields, GroupFields, Section, Sections};
use crate::tableau::{A, B, C, STAGES};
use glam::{DQuat, DVec3};
use pulp::{Arch, Simd};

/// One rod at one sigma, along the lab axes.
#[derive(Clone, Copy, Debug)]
pub struct RodFields {
    /// Position.
    pub x: DVec3,
    /// Rotation.
    pub q: DQuat,
    /// Force that the part beyond exerts.
    pub n: DVec3,
    /// Moment that it exerts.
    pub m: DVec3,
}

/// Integrates the equations of all rods of a leaf.
pub struct Flow<'a> {
    leaf: &'a DiscreteLeaf,
    arch: Arch,
    loads: Vec<[RodLoad; GROUP]>,
    fields: Vec<GroupFields>,
    stage: Vec<GroupFields>,
    /// Of each stage, and group.
    slopes: Vec<Vec<GroupFields>>,
    /// Where the slopes are taken, which is at all sigma alike where nothing changes along
    /// the rods.
    sections: Vec<Section>,
    uniform: bool,
}

impl<'a> Flow<'a> {
    /// Of the rods of `leaf`, on any grid.
    pub fn new(leaf: &'a DiscreteLeaf) -> Self {
        let load = |j: usize| {
            let mut load = leaf.rod_load(j);
            if leaf.leaf.in_plane(j) {
                // The image of its neighbour pulls it back into the plane.
                load.before.y = 0.0;
            }
            load
        };
        let groups = leaf.rods().div_ceil(GROUP);
        let fields = vec![[Four::default(); FIELDS]; groups];
        Flow {
            leaf,
            arch: arch(),
            loads: (0..groups)
                .map(|group| rods_of(group, leaf.rods()).map(load))
                .collect(),
            stage: fields.clone(),
            slopes: vec![fields.clone(); STAGES],
            sections: sections(leaf, 0.0).collect(),
            uniform: leaf.leaf.uniform(),
            fields,
        }
    }

    /// Writes down what each rod, which is as `begin` says at sigma = `from`, is after every
    /// one of so many equal `steps` to `to`.
    pub fn carry(
        &mut self,
        begin: impl Fn(usize) -> RodFields,
        [from, to]: [f64; 2],
        steps: usize,
        after: &mut [Vec<RodFields>],
    ) {
        let rods = self.leaf.rods();
        for (g, group) in self.fields.iter_mut().enumerate() {
            for (lane, j) in rods_of(g, rods).into_iter().enumerate() {
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
        let h = (to - from) / steps as f64;
        after.iter_mut().for_each(Vec::clear);
        for step in 0..steps {
            self.step(from + h * step as f64, h);
            for (j, after) in after.iter_mut().enumerate() {
                after.push(self.rod(j));
            }
        }
    }

    /// The potential energy of all rods between where they were carried from last and to,
    /// without that of loads on the tips.
    pub fn energy(&self) -> f64 {
        let energy = |j: usize| self.fields[j / GROUP][13].0[j % GROUP];
        (0..self.leaf.rods()).map(energy).sum()
    }

    fn rod(&self, j: usize) -> RodFields {
        let number = |k: usize| self.fields[j / GROUP][k].0[j % GROUP];
        let vector = |k: usize| DVec3::new(number(k), number(k + 1), number(k + 2));
        RodFields {
            x: vector(0),
            q: DQuat::from_xyzw(number(3), number(4), number(5), number(6)).normalize(),
            n: vector(7),
            m: vector(10),
        }
    }

    fn step(&mut self, sigma: f64, h: f64) {
        for i in 0..STAGES {
            self.combine(h, A[i]);
            if !self.uniform {
                self.sections.clear();
                (self.sections).extend(sections(self.leaf, sigma + C[i] * h));
            }
            let mut kernel = Slopes {
                stage: &self.stage,
                loads: &self.loads,
                sections: &self.sections,
                out: &mut self.slopes[i],
            };
            run(self.arch, &mut kernel);
        }
        self.combine(h, &B);
        std::mem::swap(&mut self.fields, &mut self.stage);
    }

    /// Makes the stage the fields plus h times the sum of weights times slopes.
    fn combine(&mut self, h: f64, weights: &[f64]) {
        let mut kernel = Combine {
            fields: &self.fields,
            slopes: &self.slopes,
            weights: (h, weights),
            out: &mut self.stage,
        };
        run(self.arch, &mut kernel);
    }
}

/// All rods at one sigma.
fn sections(leaf: &DiscreteLeaf, sigma: f64) -> impl Iterator<Item = Section> {
    let leaf = &leaf.leaf;
    (0..leaf.rods()).map(move |j| leaf.section(j, sigma, 1.0))
}

/// The rods of a group; lanes without a rod repeat the last.
#[inline(always)]
fn rods_of(group: usize, rods: usize) -> [usize; GROUP] {
    std::array::from_fn(|lane| (GROUP * group + lane).min(rods - 1))
}

/// Positions of the rods before and behind, or their own where there is none.
#[inline(always)]
fn beside(stage: &[GroupFields], of: [usize; GROUP], rods: usize) -> [[DVec3; GROUP]; 2] {
    let x = |j: usize| DVec3::from_array([0, 1, 2].map(|c| stage[j / GROUP][c].0[j % GROUP]));
    [
        of.map(|j| x(j.saturating_sub(1))),
        of.map(|j| x((j + 1).min(rods - 1))),
    ]
}

struct Slopes<'a> {
    stage: &'a [GroupFields],
    loads: &'a [[RodLoad; GROUP]],
    sections: &'a [Section],
    out: &'a mut [GroupFields],
}

impl Kernel for Slopes<'_> {
    #[inline(always)]
    fn run<S: Simd>(&mut self, simd: S, part: usize) {
        let count = self.sections.len();
        for (g, out) in self.out.iter_mut().enumerate() {
            let rods = rods_of(g, count);
            let fields = Fields::of(simd, &self.stage[g], part);
            let [before, behind] =
                beside(self.stage, rods, count).map(|x| Vectors::gather(simd, x, part));
            let loads = RodLoads::gather(simd, self.loads[g], part);
            let load = loads.at([before, fields.x, behind], [1.0; 2], false);
            let sections = rods.map(|j| &self.sections[j]);
            let sections = Sections::gather(simd, sections, part);
            fields.slopes(&sections, load).put(out, part);
        }
    }
}

struct Combine<'a> {
    fields: &'a [GroupFields],
    slopes: &'a [Vec<GroupFields>],
    weights: (f64, &'a [f64]),
    out: &'a mut [GroupFields],
}

impl Kernel for Combine<'_> {
    #[inline(always)]
    fn run<S: Simd>(&mut self, simd: S, part: usize) {
        let (h, weights) = self.weights;
        let h = Lanes::splat(simd, h);
        for (g, out) in self.out.iter_mut().enumerate() {
            let mut sums = [Lanes::splat(simd, 0.0); FIELDS];
            for (weight, slopes) in weights.iter().zip(self.slopes) {
                if *weight != 0.0 {
                    let weight = Lanes::splat(simd, *weight);
                    for (sum, slope) in sums.iter_mut().zip(&slopes[g]) {
                        *sum = Lanes::of(simd, slope, part).times(weight, *sum);
                    }
                }
            }
            for ((out, sum), field) in out.iter_mut().zip(sums).zip(&self.fields[g]) {
                let field = Lanes::of(simd, field, part);
                sum.times(h, field).put(out, part);
            }
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

    /// How far a rod that a moment of 3 A/L bends is from its circle after so many steps.
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
        let mut after = [Vec::new()];
        Flow::new(&leaf).carry(begin, [0.0, 1.0], steps, &mut after);
        assert_eq!(after[0].len(), steps);
        let off = |(k, rod): (usize, &RodFields)| {
            let angle = CURVATURE * (k + 1) as f64 / steps as f64;
            let circle = DVec3::new(angle.sin(), 1.0 - angle.cos(), 0.0) / CURVATURE;
            (rod.x - circle).length()
        };
        after[0].iter().enumerate().map(off).fold(0.0, f64::max)
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
