//! Exact sensitivities: the propagation of a perturbation of one rod through the
//! leaf. The linearized equations are integrated with the steps of the solution
//! itself.

use crate::natural::{RESULT_WEIGHTS, STAGE_NODES, STAGE_WEIGHTS, STAGES};
use crate::scenario::RodPlace;
use crate::shooting::equations::BoundaryValueProblem;
use crate::shooting::integrate::{InitialValueIntegrator, weighted_slope_sum};
use crate::shooting::rod_state::{
    FreeBaseChanges, JumpDerivatives, PERTURBATION_SIZE, SlopeDerivatives,
};
use crate::shooting::tissue::{GapTangent, PAIR_PERTURBATION_SIZE};
use crate::shooting::tissue_stresses::{LinearStresses, StressChanges, TissueState};
use glam::DMat3;
use nalgebra::SMatrix;
use std::ops::Range;

/// Linearized loads of a gap at given stresses: by the perturbations of both rods.
type GapMatrix = SMatrix<f64, PAIR_PERTURBATION_SIZE, PAIR_PERTURBATION_SIZE>;

/// The linearized equations at the stages of one step.
pub struct LinearStep {
    width: f64,
    /// Stage by stage, rod by rod.
    derivatives: Vec<SlopeDerivatives>,
    /// The linearized loads of the tissue, stage by stage, gap by gap; empty if there is none.
    tissue: Vec<GapMatrix>,
    /// Stage by stage, the linearized stresses that are unknowns; empty if there are none.
    stresses: Vec<LinearStresses>,
    /// Rods with loads on points at the beginning of the step, and the derivatives of the jumps there.
    passed_loads: Vec<(usize, JumpDerivatives)>,
}

impl LinearStep {
    /// The equations linearized at the stages of the integrator's last step.
    pub fn from_last_step(
        equations: &BoundaryValueProblem,
        integrator: &InitialValueIntegrator,
    ) -> Self {
        let (width, begin) = (
            integrator.last_step,
            integrator.sigma - integrator.last_step,
        );
        let rods = equations.rods();
        let mut linear = LinearStep {
            width,
            derivatives: Vec::with_capacity(STAGES * rods),
            tissue: Vec::new(),
            stresses: Vec::new(),
            passed_loads: integrator.passed_loads.clone(),
        };
        let mut state = TissueState::default();
        for (y, node) in integrator.stages.iter().zip(STAGE_NODES) {
            let place = RodPlace::within(begin + node * width, [begin, integrator.sigma]);
            equations.solve_tissue(place, y, &mut state);
            let of_rods = (0..rods).map(|j| equations.derivatives(j, place, y, &state));
            linear.derivatives.extend(of_rods);
            let tangents: Vec<GapTangent> = state.tangents().collect();
            linear.tissue.extend(tangents.iter().map(|gap| gap.by_pose));
            if equations.has_tissue_stresses() {
                linear.stresses.push(state.linearized_stresses(tangents));
            }
        }
        linear
    }
}

/// Perturbations of `W` different kinds of a range of rods, all others being
/// fixed: [`PERTURBATION_SIZE`] rows of `W` numbers per rod.
#[derive(Clone, Debug)]
pub struct Perturbations<const W: usize> {
    pub rods: Range<usize>,
    /// The rows of all rods, one after the other.
    pub entries: Vec<f64>,
    stage: Vec<f64>,
    slopes: Vec<Vec<f64>>,
    changes: StressChanges<W>,
}

impl<const W: usize> Perturbations<W> {
    /// Unit perturbations of the `W` components of rod `j` from the `first` on.
    pub fn unit_perturbations(rods: Range<usize>, j: usize, first: usize) -> Self {
        let mut all = vec![0.0; PERTURBATION_SIZE * rods.len() * W];
        for k in 0..W {
            all[(PERTURBATION_SIZE * (j - rods.start) + first + k) * W + k] = 1.0;
        }
        Perturbations {
            changes: StressChanges::new(rods.len()),
            rods,
            stage: all.clone(),
            slopes: vec![all.clone(); STAGES],
            entries: all,
        }
    }

    /// Sets the first three of the perturbations of rod `j` to these changes of rotation and moment, one a column.
    pub fn set_base_changes(&mut self, j: usize, changes: &FreeBaseChanges) {
        let first = PERTURBATION_SIZE * (j - self.rods.start);
        for (part, matrix) in [(3, changes.rotation), (9, changes.moment)] {
            for k in 0..3 {
                for (c, change) in matrix.col(k).to_array().into_iter().enumerate() {
                    self.entries[(first + part + c) * W + k] = change;
                }
            }
        }
    }

    /// Passes a load on a point that depends on the rotation of the section: by it n and m jump, and their
    /// perturbations by its change.
    fn pass_point_load(&mut self, first: usize, jump: &JumpDerivatives) {
        let (force, moment) = (jump.n_theta, jump.m_theta);
        let rows: &mut [[f64; W]] = self.entries.as_chunks_mut().0;
        for r in 0..3 {
            for c in 0..3 {
                for w in 0..W {
                    let turn = rows[first + 3 + c][w];
                    rows[first + 6 + r][w] += force.col(c)[r] * turn;
                    rows[first + 9 + r][w] += moment.col(c)[r] * turn;
                }
            }
        }
    }

    /// The rows of all rods.
    pub fn rows(&self) -> &[[f64; W]] {
        self.entries.as_chunks().0
    }

    /// Propagates the perturbations through a step.
    pub fn propagate(&mut self, equations: &BoundaryValueProblem, step: &LinearStep) {
        for (j, jump) in &step.passed_loads {
            if self.rods.contains(j) {
                self.pass_point_load(PERTURBATION_SIZE * (j - self.rods.start), jump);
            }
        }
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
            // Stresses that are unknowns depend on all rods.
            let all = self.rods.len() == equations.rods();
            if let Some(stresses) = step.stresses.get(i).filter(|_| all) {
                stresses.add_slopes::<W>(stage, out, &mut self.changes);
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

/// The linearized equations of rods `first..`.
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
        sum_products(&mut out[0..3], [&d.r_theta, &d.r_n], [theta, n]);
        sum_products(&mut out[3..6], [&d.theta_theta, &d.theta_m], [theta, m]);
        sum_products(&mut out[9..12], [&d.m_theta, &d.m_n], [theta, n]);
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
            if d.n_r[k] != 0.0 {
                for w in 0..W {
                    force[w] += d.n_r[k] * rows[at + k][w];
                }
            }
            out[6 + k] = force;
        }
        if let Some(loads) = &d.by_loads {
            add_products(&mut out[6..9], &loads.n_theta, theta);
            add_products(&mut out[6..9], &loads.n_n, n);
            add_products(&mut out[9..12], &loads.m_theta, theta);
        }
    }
}

/// Adds a matrix times rows to `out`.
fn add_products<const W: usize>(out: &mut [[f64; W]], matrix: &DMat3, rows: &[[f64; W]]) {
    for r in 0..3 {
        for c in 0..3 {
            for w in 0..W {
                out[r][w] += matrix.col(c)[r] * rows[c][w];
            }
        }
    }
}

/// Adds what the tissue contributes to the linearized equations of these rods; rods outside are
/// fixed.
fn add_tissue<const W: usize>(
    tissue: &[GapMatrix],
    rods: Range<usize>,
    rows: &[[f64; W]],
    slopes: &mut [[f64; W]],
) {
    for (g, matrix) in tissue.iter().enumerate() {
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

/// Sets `out` to the sum of every matrix times its rows.
#[inline]
fn sum_products<const W: usize>(
    out: &mut [[f64; W]],
    matrices: [&DMat3; 2],
    rows: [&[[f64; W]]; 2],
) {
    for r in 0..3 {
        let mut sum = [0.0; W];
        for (matrix, rows) in matrices.into_iter().zip(rows) {
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

#[cfg(test)]
mod tests {
    use glam::{DQuat, DVec3};

    use super::*;
    use crate::scenario::{BaseSupport, Scenario};
    use crate::shooting::rod_state::{RodState, rotation_difference};

    const END: f64 = 0.8;

    /// Two coupled veins and a third one, all with different properties.
    fn three() -> Scenario {
        Scenario::from_toml(THREE).unwrap()
    }

    const THREE: &str = r#"
            name = "three"
            leaf = { rods = 3, length = [1.0, 1.2, 0.9], fan = [-0.5, 0.4, 1.0] }
            stiffness = { torsion = 0.8, bending_2 = { at = [0.0, 1.0], value = [1.0, 2.0] }, bending_3 = [1.5, 0.7, 1.1], axial = 20.0, shear_2 = inf, shear_3 = 10.0 }
            rest = { twist = 0.5, bend_2 = [1.0, -0.5, 0.3], bend_3 = 0.8 }
            coupling = { x = [1.0, 0.0], y = [3.0, 0.0], z = [2.0, 0.0] }
            load = { gravity = [0.2, -0.3, -2.0] }
        "#;

    /// An arbitrary state of all rods, not at the clamp. Tissue between veins that turn by half a turn
    /// against each other has no derivatives.
    fn begin(equations: &BoundaryValueProblem) -> Vec<f64> {
        let mut y = vec![0.0; equations.state_size()];
        let spread = if equations.has_tissue() { 0.3 } else { 1.0 };
        for j in 0..3 {
            let side = spread * (j as f64 - 0.7);
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
            [
                a.r - b.r,
                rotation_difference(a.q, b.q),
                a.n - b.n,
                a.m - b.m,
            ]
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

    #[test]
    fn sensitivities_are_the_derivatives_of_the_integration() {
        let groups = |j: usize| if j < 2 { 0..2 } else { 2..3 };
        assert_sensitivities_are_differences("none", &three(), groups);
    }

    /// Loads along veins and on points that turn with the section, moments that do and that do not, and wind.
    #[test]
    fn sensitivities_with_followers_are_the_derivatives_of_the_integration() {
        let groups = |j: usize| if j < 2 { 0..2 } else { 2..3 };
        for follows in [true, false] {
            let text = format!(
                r#"
                [load]
                gravity = [0.2, -0.3, -2.0]
                follower = [0.5, -0.3, 1.0]
                couple = [0.4, 0.2, -0.6]
                couple_follows = {follows}
                [[load.point]]
                vein = 1
                at = 0.4
                force = [0.7, -0.2, 0.5]
                moment = [0.1, 0.3, -0.4]
                follows = true
                [wind]
                velocity = [0.5, 0.8, 1.0]
                density = 1.2
                drag = 2.0
                width = 0.3
                "#
            );
            let (head, _) = THREE.split_once("load =").unwrap();
            let scenario = Scenario::from_toml(&format!("{head}{text}")).unwrap();
            assert_sensitivities_are_differences("followers", &scenario, groups);
        }
    }

    /// Finite, rigid and contracting tissue, in a state that is not that of a leaf at rest.
    #[test]
    fn sensitivities_of_tissue_are_the_derivatives_of_the_integration() {
        for tissue in [
            "along = 1.0, across = 2.0, normal = 3.0, fold = 0.5",
            "along = 1.0, across = [2.0, 0.0], normal = 3.0, fold = 0.5, contraction = [0.3, 0.2]",
            "along = inf, across = 2.0, normal = [inf, 1.0], fold = 0.5",
            "along = [inf, 2.0], across = [2.0, 1.0], normal = inf, fold = 0.3, contraction = [0.1, -0.2]",
        ] {
            let mut scenario = three();
            scenario.tissue = with_tissue(tissue).tissue;
            assert_sensitivities_are_differences(tissue, &scenario, |_| 0..3);
        }
    }

    /// Three veins whose gaps have width, with this tissue.
    fn with_tissue(tissue: &str) -> Scenario {
        let text = format!(
            r#"
            name = "tissue"
            leaf = {{ rods = 3, length = 1.0, fan = [0.0, 0.0, 0.0], base = [[0.0, 0.3, 0.0], [0.0, 0.0, 0.0], [0.0, -0.2, 0.0]], joined = false }}
            stiffness = {{ torsion = 1.0, bending_2 = 1.0, bending_3 = 1.0, axial = 20.0, shear_2 = 20.0, shear_3 = 20.0 }}
            tissue = {{ {tissue} }}
            "#
        );
        Scenario::from_toml(&text).unwrap()
    }

    /// Central differences of order 4.
    fn assert_sensitivities_are_differences(
        tissue: &str,
        scenario: &Scenario,
        groups: impl Fn(usize) -> Range<usize>,
    ) {
        let equations = BoundaryValueProblem::new(scenario);
        let begin = begin(&equations);
        for j in 0..3 {
            let linear = linear::<PERTURBATION_SIZE>(&equations, (j, 0));
            assert_eq!(linear.rods, groups(j));
            for k in 0..PERTURBATION_SIZE {
                let central = |h: f64| {
                    let side = |h| integrate_to_end(&equations, perturbed(&begin, j, k, h));
                    differences(&equations, &side(h), &side(-h))
                };
                let (wide, narrow) = (central(1e-3), central(5e-4));
                for (i, (wide, narrow)) in wide.iter().zip(&narrow).enumerate() {
                    let slope = (8.0 * narrow - wide) / 6e-3;
                    let rod = i / PERTURBATION_SIZE;
                    let found = match linear.rods.contains(&rod) {
                        true => linear.rows()[i - PERTURBATION_SIZE * linear.rods.start][k],
                        false => 0.0,
                    };
                    let what = format!("{tissue}: {i} by {k} of rod {j}: {found}, {slope}");
                    // Steps are chosen for the solution, which varies less than its perturbations with tissue.
                    let accuracy = if equations.has_tissue() { 1e-6 } else { 1e-8 };
                    let off = (found - slope).abs();
                    assert!(off < accuracy * (1.0 + slope.abs()), "{what}");
                }
            }
        }
    }

    #[test]
    fn at_the_base_six_components_are_perturbed() {
        let mut scenario = three();
        for (held, free) in [(BaseSupport::Clamped, 6), (BaseSupport::Pinned, 3)] {
            scenario.base_held[1] = held;
            let equations = BoundaryValueProblem::new(&scenario);
            let all = linear::<PERTURBATION_SIZE>(&equations, (1, 0));
            let some = linear::<6>(&equations, (1, equations.first_free_component(1)));
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
