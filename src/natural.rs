//! The natural leaf: every vein in its rest shape, each from its base, unloaded and tied to nothing,
//!
//! x' = L R v0,   q' = L/2 (R u0) q,
//!
//! integrated by the explicit Runge-Kutta method of order 8 of Dormand and Prince in equal steps.
//!
//! Coefficients of the explicit Runge-Kutta method of Dormand and Prince of
//! order 8 with embedded error estimates of orders 5 and 3: those of the code
//! DOP853 in Hairer, Norsett, Wanner, Solving Ordinary Differential Equations I,
//! 2nd ed., 1993, section II.10, to double precision.

use crate::scenario::{Profile, Rod, Scenario};
use glam::{DQuat, DVec3};

/// Largest rotation in a step, in radians: its error is rounding.
const MAX_STEP_ROTATION: f64 = 0.1;

/// Longest step, so that profiles that bend little but vary are resolved.
const MAX_STEP: f64 = 1.0 / 16.0;

/// The natural leaf, in the units of the scenario.
#[derive(Clone, Debug)]
pub struct Natural<'a> {
    scenario: &'a Scenario,
    /// Whether the rest lengths have grown.
    grown: bool,
    /// Of every vein the fractions of its length where a step ends, with the states there.
    veins: Vec<Vec<(f64, VeinPose)>>,
}

/// A vein at one sigma.
type VeinPose = (DVec3, DQuat);

impl<'a> Natural<'a> {
    /// Of this scenario, whose veins have `grown`, or not yet.
    pub fn new(scenario: &'a Scenario, grown: bool) -> Self {
        let veins = (0..scenario.rods.len()).map(|j| vein(scenario, j, grown));
        Natural {
            veins: veins.collect(),
            scenario,
            grown,
        }
    }

    /// Position and rotation of vein `j` at `sigma`.
    pub fn vein_pose(&self, j: usize, sigma: f64) -> (DVec3, DQuat) {
        let vein = &self.veins[j];
        let before = vein.partition_point(|(end, _)| *end <= sigma).max(1) - 1;
        let (from, state) = vein[before];
        match sigma == from {
            true => state,
            false => step(
                &self.scenario.rods[j],
                self.grown,
                from,
                sigma - from,
                state,
            ),
        }
    }
}

/// The steps along vein `j`, which end at every kink and seam of its rest shape.
fn vein(scenario: &Scenario, j: usize, grown: bool) -> Vec<(f64, VeinPose)> {
    let rod = &scenario.rods[j];
    let shape = rod.rest_curvature.iter().chain([&rod.rest_stretch]);
    let mut kinks: Vec<f64> = (shape.clone())
        .flat_map(|p| p.kinks().iter().chain(p.seams()))
        .copied()
        .collect();
    kinks.sort_by(f64::total_cmp);
    kinks.dedup();
    let turn: f64 = rod.rest_curvature.iter().map(|p| p.max_abs()).sum();
    let longest = (MAX_STEP_ROTATION / (turn * rod.length)).min(MAX_STEP);
    let mut steps = vec![(0.0, scenario.base(j))];
    for end in kinks.into_iter().chain([1.0]) {
        let (mut from, mut state) = steps[steps.len() - 1];
        let count = ((end - from) / longest).ceil();
        let width = (end - from) / count;
        for k in 0..count as usize {
            state = step(rod, grown, from, width, state);
            from = if k + 1 == count as usize {
                end
            } else {
                from + width
            };
            steps.push((from, state));
        }
    }
    steps
}

/// A step of a vein from `sigma` by `width`.
fn step(rod: &Rod, grown: bool, sigma: f64, width: f64, (x, q): VeinPose) -> VeinPose {
    let mut slopes = [(DVec3::ZERO, DQuat::from_array([0.0; 4])); STAGES];
    let combine = |slopes: &[VeinPose], weights: &[f64]| {
        let mut sum = (x, q);
        for ((dx, dq), weight) in slopes.iter().zip(weights) {
            sum.0 += *dx * (width * weight);
            sum.1 += *dq * (width * weight);
        }
        sum
    };
    for i in 0..STAGES {
        let (_, q) = combine(&slopes, STAGE_WEIGHTS[i]);
        let at = sigma + STAGE_NODES[i] * width;
        let u = DVec3::from_array(Profile::values_of_three(&rod.rest_curvature, at));
        let q = q.normalize();
        let spin = 0.5 * rod.length * u;
        slopes[i] = (
            q * DVec3::X * (rod.length * if grown { rod.rest_stretch.at(at) } else { 1.0 }),
            q * DQuat::from_xyzw(spin.x, spin.y, spin.z, 0.0),
        );
    }
    let (x, q) = combine(&slopes, &RESULT_WEIGHTS);
    (x, q.normalize())
}

/// Number of stages.
pub const STAGES: usize = 12;

/// Nodes of the stages.
#[rustfmt::skip]
pub const STAGE_NODES: [f64; STAGES] = [
    0.0, 0.05260015195876773, 0.0789002279381516, 0.1183503419072274,
    0.2816496580927726, 0.3333333333333333, 0.25, 0.3076923076923077,
    0.6512820512820513, 0.6, 0.8571428571428571, 1.0,
];

/// Weights of earlier slopes in each stage.
#[rustfmt::skip]
pub const STAGE_WEIGHTS: [&[f64]; STAGES] = [
    &[],
    &[0.05260015195876773],
    &[0.0197250569845379, 0.0591751709536137],
    &[0.02958758547680685, 0.0, 0.08876275643042054],
    &[0.2413651341592667, 0.0, -0.8845494793282861, 0.924834003261792],
    &[0.037037037037037035, 0.0, 0.0, 0.17082860872947386, 0.12546768756682242],
    &[0.037109375, 0.0, 0.0, 0.17025221101954405, 0.06021653898045596, -0.017578125],
    &[
        0.03709200011850479, 0.0, 0.0, 0.17038392571223998,
        0.10726203044637328, -0.015319437748624402, 0.008273789163814023,
    ],
    &[
        0.6241109587160757, 0.0, 0.0, -3.3608926294469414,
        -0.868219346841726, 27.59209969944671, 20.154067550477894, -43.48988418106996,
    ],
    &[
        0.47766253643826434, 0.0, 0.0, -2.4881146199716677,
        -0.590290826836843, 21.230051448181193, 15.279233632882423, -33.28821096898486,
        -0.020331201708508627,
    ],
    &[
        -0.9371424300859873, 0.0, 0.0, 5.186372428844064,
        1.0914373489967295, -8.149787010746927, -18.52006565999696, 22.739487099350505,
        2.4936055526796523, -3.0467644718982196,
    ],
    &[
        2.273310147516538, 0.0, 0.0, -10.53449546673725,
        -2.0008720582248625, -17.9589318631188, 27.94888452941996, -2.8589982771350235,
        -8.87285693353063, 12.360567175794303, 0.6433927460157636,
    ],
];

/// Weights of the result, of order 8.
#[rustfmt::skip]
pub const RESULT_WEIGHTS: [f64; STAGES] = [
    0.054293734116568765, 0.0, 0.0,
    0.0, 0.0, 4.450312892752409,
    1.8915178993145003, -5.801203960010585, 0.3111643669578199,
    -0.1521609496625161, 0.20136540080403034, 0.04471061572777259,
];

/// Weights of the error estimate of order 5.
#[rustfmt::skip]
pub const ERROR_WEIGHTS_5: [f64; STAGES] = [
    0.01312004499419488, 0.0, 0.0,
    0.0, 0.0, -1.2251564463762044,
    -0.4957589496572502, 1.6643771824549864, -0.35032884874997366,
    0.3341791187130175, 0.08192320648511571, -0.022355307863886294,
];

/// Weights of the error estimate of order 3.
#[rustfmt::skip]
pub const ERROR_WEIGHTS_3: [f64; STAGES] = [
    -0.18980075407240762, 0.0, 0.0,
    0.0, 0.0, 4.450312892752409,
    1.8915178993145003, -5.801203960010585, -0.42268232132379197,
    -0.1521609496625161, 0.20136540080403034, 0.022651792198360825,
];

#[cfg(test)]
mod tests {
    use super::*;

    /// A vein that is curved and twisted alike all along is a helix; one whose curvature varies is
    /// the same in one step or in many.
    #[test]
    fn the_natural_vein_is_the_helix_and_does_not_depend_on_the_steps() {
        let text = r#"
            name = "veins"
            leaf = { rods = 2, length = [2.0, 1.0], fan = [0.3, -0.2], joined = false }
            stiffness = { torsion = 1.0, bending_2 = 1.0, bending_3 = 1.0, axial = 9.0, shear_2 = 9.0, shear_3 = 9.0 }
            rest = { twist = [1.2, 0.5], bend_2 = { at = [0.0, 0.3, 1.0], value = [[0.7, 0.7, 0.7], [0.0, 4.0, -2.0]] }, bend_3 = -0.4, stretch = 1.1 }
        "#;
        let scenario = Scenario::from_toml(text).unwrap();
        let natural = Natural::new(&scenario, true);
        let (x, q) = natural.vein_pose(0, 0.77);
        let (u, s) = (DVec3::new(1.2, 0.7, -0.4), 0.77 * 2.0);
        let (_, base) = scenario.base(0);
        let turned = base * crate::rotation::exp(s * u);
        assert!(turned.angle_between(q).abs() < 1e-7 && (turned.dot(q).abs() - 1.0).abs() < 1e-14);
        // The integral of exp(s [u]) e1.
        let (k, axis) = (u.length(), u.normalize());
        let across = axis.cross(DVec3::X);
        let along = axis * axis.x;
        let integral =
            along * s + (DVec3::X - along) * (k * s).sin() / k + across * (1.0 - (k * s).cos()) / k;
        assert!((x - base * (1.1 * integral)).length() < 1e-13);

        for (from, to) in [(0.0, 0.1), (0.1, 0.3), (0.3, 0.61)] {
            let (mut state, width) = (natural.vein_pose(1, from), (to - from) / 100.0);
            for k in 0..100 {
                state = step(
                    &scenario.rods[1],
                    true,
                    from + k as f64 * width,
                    width,
                    state,
                );
            }
            let (x, q) = natural.vein_pose(1, to);
            assert!((x - state.0).length() < 1e-13);
            assert!((q.dot(state.1).abs() - 1.0).abs() < 1e-14);
        }
    }
}

#[cfg(test)]
mod tableau_tests {
    use super::*;

    /// Order conditions of nodes, quadrature and trees with one branch.
    #[test]
    fn the_result_is_of_order_8() {
        let zero = |what: &str, off: f64| assert!(off.abs() < 1e-13, "{what}: {off:e}");
        let inner = |i: usize, k: i32| -> f64 {
            (STAGE_WEIGHTS[i].iter().zip(STAGE_NODES))
                .map(|(a, c)| a * c.powi(k))
                .sum()
        };
        for k in 0..8 {
            let sum = |value: &dyn Fn(usize) -> f64| -> f64 {
                (0..STAGES).map(|i| RESULT_WEIGHTS[i] * value(i)).sum()
            };
            zero(
                "b c^k",
                sum(&|i| STAGE_NODES[i].powi(k)) - 1.0 / f64::from(k + 1),
            );
            for l in 0..7 - k {
                let wanted = 1.0 / f64::from((k + 1) * (k + 2 + l));
                zero(
                    "b c^l a c^k",
                    sum(&|i| STAGE_NODES[i].powi(l) * inner(i, k)) - wanted,
                );
            }
        }
        (0..STAGES).for_each(|i| zero("node", inner(i, 0) - STAGE_NODES[i]));
    }

    /// The error estimates vanish for what methods of order 5 and 3 integrate exactly, and not
    /// for the next power.
    #[test]
    fn the_estimates_are_of_orders_5_and_3() {
        let sum = |weights: &[f64; STAGES], k: i32| -> f64 {
            (0..STAGES)
                .map(|i| weights[i] * STAGE_NODES[i].powi(k))
                .sum()
        };
        for (weights, order) in [(&ERROR_WEIGHTS_5, 5), (&ERROR_WEIGHTS_3, 3)] {
            for k in 0..order {
                assert!(sum(weights, k).abs() < 1e-13, "e c^{k}");
            }
            assert!(sum(weights, order).abs() > 1e-4);
        }
    }
}
