//! Exact sensitivities: the propagation of a perturbation of one rod through the
//! leaf. The linearised equations are integrated with the steps of the solution
//! itself.
//!
//! Tissue between neighbouring veins: its energy per unit of sigma, written once for numbers with
//! derivatives, from which forces, moments and their linearisation follow. It shares only the
//! natural leaf with the element of the relaxation.

use crate::natural::{Natural, RESULT_WEIGHTS, STAGE_NODES, STAGE_WEIGHTS, STAGES};
use crate::scenario::{Profile, Scenario};
use crate::shooting::equations::{
    BoundaryValueProblem, PERTURBATION_SIZE, RodState, SlopeDerivatives,
};
use crate::shooting::integrate::{InitialValueIntegrator, weighted_slope_sum};
use glam::{DMat3, DQuat, DVec3};
use nalgebra::{SMatrix, SVector};
use num_dual::{DualNum, gradient, hessian};
use std::ops::Range;

/// The linearised equations at the stages of one step.
pub struct LinearStep {
    width: f64,
    /// Stage by stage, rod by rod.
    derivatives: Vec<SlopeDerivatives>,
    /// Of the tissue, stage by stage, gap by gap; empty if there is none.
    tissue: Vec<TissueTangent>,
}

impl LinearStep {
    /// For the last step of the integrator.
    pub fn from_last_step(
        equations: &BoundaryValueProblem,
        integrator: &InitialValueIntegrator,
    ) -> Self {
        let (width, begin) = (
            integrator.last_step,
            integrator.sigma - integrator.last_step,
        );
        let gap = |(i, g): (usize, usize)| {
            let sigma = begin + STAGE_NODES[i] * width;
            equations.tissue_tangent(g, sigma, &integrator.stages[i])
        };
        let gaps = (0..STAGES).flat_map(|i| (1..equations.rods()).map(move |j| (i, j - 1)));
        LinearStep {
            tissue: gaps.map_while(gap).collect(),
            width,
            derivatives: (0..STAGES)
                .flat_map(|i| {
                    let (y, sigma) = (&integrator.stages[i], begin + STAGE_NODES[i] * width);
                    (0..equations.rods()).map(move |j| equations.derivatives(j, sigma, y))
                })
                .collect(),
        }
    }
}

/// Perturbations of `W` different kinds of a range of rods, all others being
/// fixed: [`PERTURBATION_SIZE`] rows of `W` numbers per rod.
#[derive(Clone, Debug)]
pub struct Perturbations<const W: usize> {
    pub rods: Range<usize>,
    /// Row after row.
    pub entries: Vec<f64>,
    stage: Vec<f64>,
    slopes: Vec<Vec<f64>>,
}

impl<const W: usize> Perturbations<W> {
    /// Unit perturbations of the `W` components of rod `j` from the `first` on.
    pub fn unit_perturbations(rods: Range<usize>, j: usize, first: usize) -> Self {
        let mut all = vec![0.0; PERTURBATION_SIZE * rods.len() * W];
        for k in 0..W {
            all[(PERTURBATION_SIZE * (j - rods.start) + first + k) * W + k] = 1.0;
        }
        Perturbations {
            rods,
            stage: all.clone(),
            slopes: vec![all.clone(); STAGES],
            entries: all,
        }
    }

    pub fn rows(&self) -> &[[f64; W]] {
        self.entries.as_chunks().0
    }

    /// Propagates them through a step.
    pub fn propagate(&mut self, equations: &BoundaryValueProblem, step: &LinearStep) {
        for i in 0..STAGES {
            weighted_slope_sum(
                &self.entries,
                step.width,
                STAGE_WEIGHTS[i],
                &self.slopes,
                &mut self.stage,
            );
            let derivatives = &step.derivatives[i * equations.rods()..][self.rods.clone()];
            let (stage, out) = (self.stage.as_chunks().0, self.slopes[i].as_chunks_mut().0);
            linearized_slopes::<W>(equations, derivatives, self.rods.start, stage, out);
            if !step.tissue.is_empty() {
                let gaps = equations.rods() - 1;
                let tissue = &step.tissue[i * gaps..(i + 1) * gaps];
                add_tissue::<W>(tissue, self.rods.clone(), stage, out);
            }
        }
        weighted_slope_sum(
            &self.entries,
            step.width,
            &RESULT_WEIGHTS,
            &self.slopes,
            &mut self.stage,
        );
        std::mem::swap(&mut self.entries, &mut self.stage);
    }
}

/// The linearised equations of rods `first..`.
fn linearized_slopes<const W: usize>(
    equations: &BoundaryValueProblem,
    derivatives: &[SlopeDerivatives],
    first: usize,
    rows: &[[f64; W]],
    slopes: &mut [[f64; W]],
) {
    for (j, d) in derivatives.iter().enumerate() {
        let at = PERTURBATION_SIZE * j;
        let part = |k: usize| &rows[at + 3 * k..at + 3 * k + 3];
        let (theta, n, m) = (part(1), part(2), part(3));
        let out = &mut slopes[at..at + PERTURBATION_SIZE];
        sum_products(&mut out[0..3], [(&d.r_theta, theta), (&d.r_n, n)]);
        sum_products(&mut out[3..6], [(&d.theta_theta, theta), (&d.theta_m, m)]);
        sum_products(&mut out[9..12], [(&d.m_theta, theta), (&d.m_n, n)]);
        for k in 0..3 {
            let mut force = [0.0; W];
            // A rod outside the range is fixed, but its coupling still acts.
            let mut pull = |gap: usize, neighbour: Option<usize>| {
                let kappa = equations.coupling(gap)[k];
                if kappa == 0.0 {
                    return;
                }
                for w in 0..W {
                    let other =
                        neighbour.map_or(0.0, |other| rows[PERTURBATION_SIZE * other + k][w]);
                    force[w] += kappa * (rows[at + k][w] - other);
                }
            };
            if first + j > 0 {
                pull(first + j - 1, j.checked_sub(1));
            }
            if first + j + 1 < equations.rods() {
                let next = Some(j + 1).filter(|next| *next < derivatives.len());
                pull(first + j, next);
            }
            out[6 + k] = force;
        }
    }
}

/// Adds what the tissue contributes to the linearised equations of these rods; rods outside are
/// fixed.
fn add_tissue<const W: usize>(
    tissue: &[TissueTangent],
    rods: Range<usize>,
    rows: &[[f64; W]],
    slopes: &mut [[f64; W]],
) {
    for (g, TissueTangent(matrix)) in tissue.iter().enumerate() {
        // Displacements and rotations of both rods, where the rows of their forces and moments are.
        let place = |k: usize| {
            let j = g + k / 6;
            rods.contains(&j)
                .then(|| PERTURBATION_SIZE * (j - rods.start) + k % 6)
        };
        for r in 0..12 {
            let Some(out) = place(r) else { continue };
            for c in 0..12 {
                let Some(row) = place(c) else { continue };
                for w in 0..W {
                    slopes[out + 6][w] += matrix[(r, c)] * rows[row][w];
                }
            }
        }
    }
}

/// out = sum of matrix times rows.
#[inline]
fn sum_products<const W: usize>(out: &mut [[f64; W]], terms: [(&DMat3, &[[f64; W]]); 2]) {
    for r in 0..3 {
        let mut sum = [0.0; W];
        for (matrix, rows) in terms {
            for c in 0..3 {
                let factor = matrix.col(c)[r];
                for w in 0..W {
                    sum[w] += factor * rows[c][w];
                }
            }
        }
        out[r] = sum;
    }
}

/// The rods coupled with rod `j`, directly or through others.
pub fn coupled_rods(equations: &BoundaryValueProblem, j: usize) -> Range<usize> {
    let mut group = j..j + 1;
    while group.start > 0 && equations.coupled(group.start - 1) {
        group.start -= 1;
    }
    while group.end < equations.rods() && equations.coupled(group.end - 1) {
        group.end += 1;
    }
    group
}

/// Numbers that perturb the two rods at a gap: displacement and spatial rotation of either.
const PAIR_PERTURBATION_SIZE: usize = 12;

/// Numbers that turn both.
const TURNS: usize = 6;

/// A rod's force and moment by the tissue of a gap.
pub type TissueLoad = [DVec3; 2];

/// The linearised loads of a gap: minus the derivatives of forces and moments on both rods (rows)
/// with respect to displacements and spatial rotations of both.
#[derive(Clone, Copy, Debug)]
pub struct TissueTangent(pub SMatrix<f64, PAIR_PERTURBATION_SIZE, PAIR_PERTURBATION_SIZE>);

/// The tissue of a leaf, dimensionless.
#[derive(Clone, Debug)]
pub struct TissueEnergy<'a> {
    gaps: &'a [crate::scenario::Tissue],
    stress_free: Natural<'a>,
    /// Unit of length.
    length: f64,
    /// Of every gap the factors that make k and c_1 those per unit of sigma.
    factors: Vec<[f64; 4]>,
}

/// A number with its derivatives.
trait DifferentiableNumber: DualNum<Primitive = f64> + Copy {}

impl<D: DualNum<Primitive = f64> + Copy> DifferentiableNumber for D {}

impl<'a> TissueEnergy<'a> {
    /// Of a scenario with these units of length and force; `None` if it has none.
    pub fn new(scenario: &'a Scenario, length: f64, force: f64) -> Option<Self> {
        let gaps = scenario.tissue.as_ref()?;
        let factors = scenario.rods.windows(2).map(|rods| {
            let mean = 0.5 * (rods[0].length + rods[1].length) / length;
            let k = mean * length * length / force;
            [k, k, k, mean / force]
        });
        Some(TissueEnergy {
            stress_free: Natural::new(scenario, scenario.tissue_grown),
            length,
            gaps,
            factors: factors.collect(),
        })
    }

    /// k and c_1 of gap `g` at `sigma`, per unit of sigma.
    fn stiffness(&self, g: usize, sigma: f64) -> [f64; 4] {
        let (of, factors) = (self.gaps[g].stiffness_profiles(), self.factors[g]);
        [0, 1, 2, 3].map(|which| of[which].at(sigma) * factors[which])
    }

    /// The largest stiffness of gap `g`.
    pub fn largest(&self, g: usize) -> f64 {
        let [along, across, normal, _] = self.gaps[g].stiffness_profiles();
        let most = [along, across, normal].map(Profile::max_abs);
        most.into_iter().fold(0.0, f64::max) * self.factors[g][0]
    }

    /// The strains of the natural leaf in gap `g` at `sigma`.
    fn rest_strains(&self, g: usize, sigma: f64) -> [f64; 4] {
        let [a, b] = [g, g + 1].map(|j| self.stress_free.vein_pose(j, sigma));
        let rods = [a, b].map(|(x, q)| (x / self.length, q));
        strains::<f64>(&SVector::zeros(), &rods)
    }

    /// The energy of gap `g` and its loads on both rods.
    pub fn energy_and_loads(
        &self,
        g: usize,
        sigma: f64,
        rods: [&RodState; 2],
    ) -> (f64, [TissueLoad; 2]) {
        let (rest, rods) = (self.rest_strains(g, sigma), rods.map(|rod| (rod.r, rod.q)));
        let k = self.stiffness(g, sigma);
        let energy = |z| energy(&k, &rest, &z, &rods);
        let (energy, slopes) = gradient(energy, &SVector::<f64, PAIR_PERTURBATION_SIZE>::zeros());
        let vector = |k: usize| -DVec3::from_slice(&slopes.as_slice()[k..k + 3]);
        (energy, [0, 6].map(|k| [vector(k), vector(k + 3)]))
    }

    /// The linearised loads of gap `g`: strains are linear in displacements, so that only rotations
    /// need second derivatives.
    pub fn tangent(&self, g: usize, sigma: f64, rods: [&RodState; 2]) -> TissueTangent {
        let rest = self.rest_strains(g, sigma);
        let k = self.stiffness(g, sigma);
        let apart = rods[1].r - rods[0].r;
        let turned = |z: SVector<_, TURNS>| turned(&z, rods.map(|rod| rod.q));
        let (frame, (fold, fold_slopes, fold_second)) =
            hessian(turned, &SVector::<f64, TURNS>::zeros());
        let excess = fold - rest[3];
        // Second derivatives of the energy: by the displacement apart, by it and rotations, by rotations.
        let mut apart_apart = SMatrix::<f64, 3, 3>::zeros();
        let mut apart_turns = SMatrix::<f64, 3, TURNS>::zeros();
        let mut turns_turns = (fold_slopes * fold_slopes.transpose() + fold_second * excess) * k[3];
        let mut slopes = fold_slopes * (excess * k[3]);
        for (i, row) in frame.iter().enumerate() {
            let axis = SVector::<f64, 3>::from_fn(|c, _| row[c].0);
            let turning = SMatrix::<f64, 3, TURNS>::from_fn(|c, t| row[c].1[t]);
            let d = SVector::<f64, 3>::from(apart.to_array());
            let strain_slopes = turning.transpose() * d;
            let strain_second = row[0].2 * d[0] + row[1].2 * d[1] + row[2].2 * d[2];
            let excess = axis.dot(&d) - rest[i];
            apart_apart += axis * axis.transpose() * k[i];
            apart_turns += (axis * strain_slopes.transpose() + turning * excess) * k[i];
            turns_turns +=
                (strain_slopes * strain_slopes.transpose() + strain_second * excess) * k[i];
            slopes += strain_slopes * (excess * k[i]);
        }
        // A rotation by theta and then by a is one by a + theta + a x theta/2.
        for first in [0, 3] {
            let m = &slopes.as_slice()[first..first + 3];
            for (r, c, value) in [(0, 1, -m[2]), (0, 2, m[1]), (1, 2, -m[0])] {
                turns_turns[(first + r, first + c)] -= 0.5 * value;
                turns_turns[(first + c, first + r)] += 0.5 * value;
            }
        }
        let mut second = SMatrix::<f64, PAIR_PERTURBATION_SIZE, PAIR_PERTURBATION_SIZE>::zeros();
        for (rod, sign) in [(0, -1.0), (1, 1.0)] {
            for (other, other_sign) in [(0, -1.0), (1, 1.0)] {
                let (at, to) = (6 * rod, 6 * other);
                let shifts = apart_apart * (sign * other_sign);
                second.fixed_view_mut::<3, 3>(at, to).copy_from(&shifts);
                let mixed = apart_turns.fixed_view::<3, 3>(0, 3 * other) * sign;
                second.fixed_view_mut::<3, 3>(at, to + 3).copy_from(&mixed);
                let transposed = mixed.transpose();
                second
                    .fixed_view_mut::<3, 3>(to + 3, at)
                    .copy_from(&transposed);
                let turns = turns_turns.fixed_view::<3, 3>(3 * rod, 3 * other);
                second
                    .fixed_view_mut::<3, 3>(at + 3, to + 3)
                    .copy_from(&turns);
            }
        }
        TissueTangent(second)
    }
}

/// The energy of a gap with the stiffnesses `k`, whose strains at rest are `rest`.
fn energy<D: DifferentiableNumber>(
    k: &[f64; 4],
    rest: &[f64; 4],
    z: &SVector<D, PAIR_PERTURBATION_SIZE>,
    rods: &[(DVec3, DQuat); 2],
) -> D {
    let strains = strains(z, rods);
    (0..4).fold(D::zero(), |sum, i| {
        let strain = strains[i] - rest[i];
        sum + strain * strain * (0.5 * k[i])
    })
}

/// R^T (r_1 - r_0), R being the mean rotation, and the rotation between both about its first axis.
fn strains<D: DifferentiableNumber>(
    z: &SVector<D, PAIR_PERTURBATION_SIZE>,
    rods: &[(DVec3, DQuat); 2],
) -> [D; 4] {
    let turns = SVector::from_fn(|k, _| z[3 + k + k / 3 * 3]);
    let (frame, fold) = turned(&turns, rods.map(|(_, q)| q));
    let apart = rods[1].0 - rods[0].0;
    let d = [0, 1, 2].map(|c| z[6 + c] - z[c] + apart[c]);
    let along = |i: usize| frame[i][0] * d[0] + frame[i][1] * d[1] + frame[i][2] * d[2];
    [along(0), along(1), along(2), fold]
}

/// The columns of R, the mean of two rotations turned by `z`, and the rotation between both about its first
/// axis.
fn turned<D: DifferentiableNumber>(z: &SVector<D, TURNS>, rods: [DQuat; 2]) -> ([[D; 3]; 3], D) {
    let one = D::one();
    let rotated = |first: usize, q: DQuat| -> [D; 4] {
        let t = [z[first], z[first + 1], z[first + 2]];
        let square = t[0] * t[0] + t[1] * t[1] + t[2] * t[2];
        let increment = [t[0] * 0.5, t[1] * 0.5, t[2] * 0.5, one - square * 0.125];
        product(increment, q.to_array().map(|c| one * c))
    };
    let (p, mut q) = (rotated(0, rods[0]), rotated(3, rods[1]));
    if rods[0].dot(rods[1]) < 0.0 {
        q = q.map(|c| -c);
    }
    let conjugate = |q: [D; 4]| [-q[0], -q[1], -q[2], q[3]];
    // The rotation from p to q, of half angle y: its vector is 2 y/sin(y) times its vector part.
    let between = product(conjugate(p), q);
    let squared = between[0] * between[0] + between[1] * between[1] + between[2] * between[2];
    let ratio = match squared.re() > 1e-6 {
        true => {
            let sin = squared.sqrt();
            sin.atan2(between[3]) / sin
        }
        // asin(s)/s as a series in s^2.
        false => {
            squared * (squared * (15.0 / 336.0) + 3.0 / 40.0) * squared
                + squared * (1.0 / 6.0)
                + 1.0
        }
    };
    let [x, y, z, w] = [p[0] + q[0], p[1] + q[1], p[2] + q[2], p[3] + q[3]];
    let twice = (x * x + y * y + z * z + w * w).recip() * 2.0;
    let [wx, wy, wz] = [w * x * twice, w * y * twice, w * z * twice];
    let [xx, yy, zz] = [x * x * twice, y * y * twice, z * z * twice];
    let [xy, xz, yz] = [x * y * twice, x * z * twice, y * z * twice];
    let frame = [
        [one - yy - zz, xy + wz, xz - wy],
        [xy - wz, one - xx - zz, yz + wx],
        [xz + wy, yz - wx, one - xx - yy],
    ];
    (frame, between[0] * ratio * 2.0)
}

/// The product of quaternions (x, y, z, w).
fn product<D: DifferentiableNumber>(a: [D; 4], b: [D; 4]) -> [D; 4] {
    [
        a[3] * b[0] + a[0] * b[3] + a[1] * b[2] - a[2] * b[1],
        a[3] * b[1] + a[1] * b[3] + a[2] * b[0] - a[0] * b[2],
        a[3] * b[2] + a[2] * b[3] + a[0] * b[1] - a[1] * b[0],
        a[3] * b[3] - a[0] * b[0] - a[1] * b[1] - a[2] * b[2],
    ]
}

#[cfg(test)]
mod tests {
    use glam::{DQuat, DVec3};

    use super::*;
    use crate::scenario::{Scenario, SupportKind};
    use crate::shooting::equations::RodState;

    const END: f64 = 0.8;

    /// Two coupled veins and a third one, all with different properties.
    fn three() -> Scenario {
        let text = r#"
            name = "three"
            leaf = { rods = 3, length = [1.0, 1.2, 0.9], fan = [-0.5, 0.4, 1.0] }
            stiffness = { torsion = 0.8, bending_2 = { at = [0.0, 1.0], value = [1.0, 2.0] }, bending_3 = [1.5, 0.7, 1.1], axial = 20.0, shear_2 = inf, shear_3 = 10.0 }
            rest = { twist = 0.5, bend_2 = [1.0, -0.5, 0.3], bend_3 = 0.8 }
            coupling = { x = [1.0, 0.0], y = [3.0, 0.0], z = [2.0, 0.0] }
            load = { gravity = [0.2, -0.3, -2.0] }
        "#;
        Scenario::from_toml(text).unwrap()
    }

    /// An arbitrary state of all rods, not at the clamp.
    fn begin(equations: &BoundaryValueProblem) -> Vec<f64> {
        let mut y = vec![0.0; equations.state_size()];
        for j in 0..3 {
            let side = j as f64 - 0.7;
            RodState {
                r: DVec3::new(0.1 * side, 0.2, -0.1),
                q: DQuat::from_scaled_axis(DVec3::new(0.5, side, -1.0)),
                n: DVec3::new(2.0, side, -1.0),
                m: DVec3::new(0.5, -side, 2.0),
            }
            .write_flat_state(&mut y, j);
        }
        y
    }

    /// The state with the `k`-th component of rod `j` perturbed.
    fn perturbed(y: &[f64], j: usize, k: usize, by: f64) -> Vec<f64> {
        let mut y = y.to_vec();
        let mut rod = RodState::from_flat_state(&y, j);
        let change = by * DVec3::AXES[k % 3];
        match k / 3 {
            0 => rod.r += change,
            1 => rod.q = DQuat::from_scaled_axis(change) * rod.q,
            2 => rod.n += change,
            _ => rod.m += change,
        }
        rod.write_flat_state(&mut y, j);
        y
    }

    fn integrate_to_end(equations: &BoundaryValueProblem, y: Vec<f64>) -> Vec<f64> {
        let mut integrator = InitialValueIntegrator::new(equations, 0.0, y, 1e-13);
        integrator.run(END, |_| ()).unwrap();
        integrator.y
    }

    fn differences(equations: &BoundaryValueProblem, a: &[f64], b: &[f64]) -> Vec<f64> {
        let of_rod = |j: usize| {
            let (a, b) = (
                RodState::from_flat_state(a, j),
                RodState::from_flat_state(b, j),
            );
            let turn = (a.q * b.q.conjugate()).to_scaled_axis();
            [a.r - b.r, turn, a.n - b.n, a.m - b.m]
        };
        let all = (0..equations.rods()).flat_map(of_rod);
        all.flat_map(|v| v.to_array()).collect()
    }

    /// Responses of its group to unit perturbations of rod `j`.
    fn linear<const W: usize>(
        equations: &BoundaryValueProblem,
        (j, first): (usize, usize),
    ) -> Perturbations<W> {
        let mut perturbations =
            Perturbations::<W>::unit_perturbations(coupled_rods(equations, j), j, first);
        let mut integrator = InitialValueIntegrator::new(equations, 0.0, begin(equations), 1e-12);
        let mut advance = |integrator: &InitialValueIntegrator| {
            perturbations.propagate(
                equations,
                &LinearStep::from_last_step(equations, integrator),
            );
        };
        integrator.run(END, &mut advance).unwrap();
        perturbations
    }

    /// Central differences of order 4.
    #[test]
    fn sensitivities_are_the_derivatives_of_the_integration() {
        let scenario = three();
        let equations = BoundaryValueProblem::new(&scenario);
        let begin = begin(&equations);
        for j in 0..3 {
            let linear = linear::<PERTURBATION_SIZE>(&equations, (j, 0));
            assert_eq!(linear.rods, if j < 2 { 0..2 } else { 2..3 });
            for k in 0..PERTURBATION_SIZE {
                let central = |h: f64| {
                    let side = |h| integrate_to_end(&equations, perturbed(&begin, j, k, h));
                    differences(&equations, &side(h), &side(-h))
                };
                let (wide, narrow) = (central(2e-3), central(1e-3));
                for (i, (wide, narrow)) in wide.iter().zip(&narrow).enumerate() {
                    let slope = (8.0 * narrow - wide) / 12e-3;
                    let rod = i / PERTURBATION_SIZE;
                    let found = match linear.rods.contains(&rod) {
                        true => linear.rows()[i - PERTURBATION_SIZE * linear.rods.start][k],
                        false => 0.0,
                    };
                    let what = format!("number {i} by {k} of rod {j}: {found}, {slope}");
                    assert!((found - slope).abs() < 1e-8 * (1.0 + slope.abs()), "{what}");
                }
            }
        }
    }

    #[test]
    fn at_the_base_six_components_are_perturbed() {
        let mut scenario = three();
        for (held, free) in [(SupportKind::Clamped, 6), (SupportKind::Pinned, 3)] {
            scenario.base_held = held;
            let equations = BoundaryValueProblem::new(&scenario);
            let all = linear::<PERTURBATION_SIZE>(&equations, (1, 0));
            let some = linear::<6>(&equations, (1, equations.first_free_component()));
            for (all, some) in all.rows().iter().zip(some.rows()) {
                assert_eq!(all[free..free + 6], some[..]);
            }
        }
    }

    #[test]
    fn coupled_rods_are_a_group() {
        let mut scenario = three();
        assert_eq!(coupled_rods(&BoundaryValueProblem::new(&scenario), 0), 0..2);
        scenario.coupling[1] = [0.0, 1e-9, 0.0];
        for j in 0..3 {
            assert_eq!(coupled_rods(&BoundaryValueProblem::new(&scenario), j), 0..3);
        }
        scenario.coupling[0] = [0.0; 3];
        let groups = [0, 1, 2].map(|j| coupled_rods(&BoundaryValueProblem::new(&scenario), j));
        assert_eq!(groups, [0..1, 1..3, 1..3]);
    }
}
