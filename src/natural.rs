//! The natural leaf: every vein in its rest shape, each from its base, unloaded and tied to nothing,
//!
//! x' = L R v0,   q' = L/2 (R u0) q,
//!
//! integrated by the explicit Runge-Kutta method of order 8 of Dormand and Prince in equal steps.
//! The coefficients, with embedded error estimates of orders 5 and 3, are those of the code DOP853
//! (Hairer, Norsett, Wanner, Solving Ordinary Differential Equations I, 2nd ed., 1993, section
//! II.10) to double precision; integrations with step control elsewhere use them, too.

pub use crate::rotation::Pose;
use crate::scenario::{Profile, Rod, RodPlace, Scenario};
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
    /// The ends of the steps along every vein, base to tip.
    veins: Vec<Vec<StepEnd>>,
}

/// Where a step along a vein ends.
#[derive(Clone, Copy, Debug)]
struct StepEnd {
    /// Fraction of the vein's length.
    sigma: f64,
    pose: Pose,
}

impl<'a> Natural<'a> {
    /// The natural leaf of a scenario, whose veins have `grown`, or not yet: that in which holders and
    /// tissue have their places.
    pub fn new(scenario: &'a Scenario, grown: bool) -> Self {
        let scenario = scenario
            .natural
            .as_ref()
            .map_or(scenario, |it| &*it.scenario);
        let veins = (0..scenario.rods.len()).map(|j| integrate_vein(scenario, j, grown));
        Natural {
            veins: veins.collect(),
            scenario,
            grown,
        }
    }

    /// Position and rotation of vein `j` at `sigma`.
    pub fn vein_pose(&self, j: usize, sigma: f64) -> Pose {
        let vein = &self.veins[j];
        let before = vein.partition_point(|end| end.sigma <= sigma).max(1) - 1;
        let from = vein[before];
        match sigma == from.sigma {
            true => from.pose,
            false => {
                let rod = &self.scenario.rods[j];
                from.pose_after(rod, self.grown, sigma - from.sigma)
            }
        }
    }
}

/// The steps along vein `j`, which end at every kink and seam of its rest shape.
fn integrate_vein(scenario: &Scenario, j: usize, grown: bool) -> Vec<StepEnd> {
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
    let (position, rotation) = scenario.base(j);
    let base = Pose { position, rotation };
    let mut steps = vec![StepEnd {
        sigma: 0.0,
        pose: base,
    }];
    for end in kinks.into_iter().chain([1.0]) {
        let mut last = steps[steps.len() - 1];
        let count = ((end - last.sigma) / longest).ceil();
        let width = (end - last.sigma) / count;
        for k in 0..count as usize {
            last = StepEnd {
                pose: last.pose_after(rod, grown, width),
                sigma: if k + 1 == count as usize {
                    end
                } else {
                    last.sigma + width
                },
            };
            steps.push(last);
        }
    }
    steps
}

impl StepEnd {
    /// The pose after a further step by `width` along a vein.
    fn pose_after(&self, rod: &Rod, grown: bool, width: f64) -> Pose {
        // Slopes of the position and of the quaternion.
        let mut slopes = [Pose {
            position: DVec3::ZERO,
            rotation: DQuat::from_array([0.0; 4]),
        }; STAGES];
        let combine = |slopes: &[Pose], weights: &[f64]| {
            let mut sum = self.pose;
            for (slope, weight) in slopes.iter().zip(weights) {
                sum.position += slope.position * (width * weight);
                sum.rotation += slope.rotation * (width * weight);
            }
            sum
        };
        for i in 0..STAGES {
            let q = combine(&slopes, STAGE_WEIGHTS[i]).rotation.normalize();
            let end = self.sigma + width;
            let at = RodPlace::within(self.sigma + STAGE_NODES[i] * width, [self.sigma, end]);
            let u = DVec3::from_array(Profile::values_of_three(rod.rest_curvature.each_ref(), at));
            let spin = 0.5 * rod.length * u;
            let stretch = if grown { rod.rest_stretch.at(at) } else { 1.0 };
            slopes[i] = Pose {
                position: q * DVec3::X * (rod.length * stretch),
                rotation: q * DQuat::from_xyzw(spin.x, spin.y, spin.z, 0.0),
            };
        }
        let Pose { position, rotation } = combine(&slopes, &RESULT_WEIGHTS);
        Pose {
            position,
            rotation: rotation.normalize(),
        }
    }
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
        let tip = natural.vein_pose(0, 0.77);
        let (x, q) = (tip.position, tip.rotation);
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
            let (mut pose, width) = (natural.vein_pose(1, from), (to - from) / 100.0);
            for k in 0..100 {
                let sigma = from + k as f64 * width;
                pose = StepEnd { sigma, pose }.pose_after(&scenario.rods[1], true, width);
            }
            let end = natural.vein_pose(1, to);
            assert!((end.position - pose.position).length() < 1e-13);
            assert!((end.rotation.dot(pose.rotation).abs() - 1.0).abs() < 1e-14);
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
