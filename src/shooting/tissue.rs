//! Tissue between neighboring veins: its energy per unit of sigma, written once for numbers with
//! derivatives, from which forces, moments and their linearization follow. It shares only the
//! natural leaf with the element of the relaxation.

use crate::natural::Natural;
use crate::rod::Wrench;
use crate::rotation::Pose;
use crate::scenario::{Profile, Scenario, Tissue};
use glam::{DQuat, DVec3};
use nalgebra::{SMatrix, SVector};
use num_dual::{DualNum, gradient, hessian};

/// Numbers that perturb the two rods at a gap: displacement and spatial rotation of either.
const PAIR_PERTURBATION_SIZE: usize = 12;

/// Numbers that turn both rods at a gap.
const TURNS: usize = 6;

/// Potential energy of a gap's tissue per unit of sigma, and what it exerts on both rods.
#[derive(Clone, Copy, Debug)]
pub struct GapLoads {
    pub energy: f64,
    pub on_rods: [Wrench; 2],
}

/// The linearized loads of a gap: minus the derivatives of forces and moments on both rods (rows)
/// with respect to displacements and spatial rotations of both.
#[derive(Clone, Copy, Debug)]
pub struct TissueTangent(pub SMatrix<f64, PAIR_PERTURBATION_SIZE, PAIR_PERTURBATION_SIZE>);

/// The tissue of a leaf, dimensionless.
#[derive(Clone, Debug)]
pub struct TissueEnergy<'a> {
    gaps: &'a [Tissue],
    stress_free: Natural<'a>,
    /// Unit of length.
    length: f64,
    /// Factors of the scenario's k (three) and c_1 that make them dimensionless and per unit of sigma,
    /// gap by gap.
    factors: Vec<[f64; 4]>,
}

/// A number with its derivatives.
trait DifferentiableNumber: DualNum<Primitive = f64> + Copy {}

impl<D: DualNum<Primitive = f64> + Copy> DifferentiableNumber for D {}

impl<'a> TissueEnergy<'a> {
    /// The tissue of a scenario with these units of length and force; `None` if it has none.
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
        let rods = [a, b].map(|pose| Pose {
            position: pose.position / self.length,
            ..pose
        });
        strains::<f64>(&SVector::zeros(), &rods)
    }

    /// The energy of gap `g` between `rods`, and its loads on both.
    pub fn loads(&self, g: usize, sigma: f64, rods: [Pose; 2]) -> GapLoads {
        let rest = self.rest_strains(g, sigma);
        let k = self.stiffness(g, sigma);
        let energy = |z| energy(&k, &rest, &z, &rods);
        let (energy, slopes) = gradient(energy, &SVector::<f64, PAIR_PERTURBATION_SIZE>::zeros());
        let vector = |k: usize| -DVec3::from_slice(&slopes.as_slice()[k..k + 3]);
        GapLoads {
            energy,
            on_rods: [0, 6].map(|k| Wrench {
                force: vector(k),
                moment: vector(k + 3),
            }),
        }
    }

    /// The linearized loads of gap `g` between `rods`: strains are linear in displacements, so that only rotations
    /// need second derivatives.
    pub fn tangent(&self, g: usize, sigma: f64, rods: [Pose; 2]) -> TissueTangent {
        let rest = self.rest_strains(g, sigma);
        let k = self.stiffness(g, sigma);
        let apart = rods[1].position - rods[0].position;
        let turned = |z: SVector<_, TURNS>| {
            let GapFrame { axes, fold } = turned_frame(&z, rods.map(|rod| rod.rotation));
            (axes, fold)
        };
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
    rods: &[Pose; 2],
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
    rods: &[Pose; 2],
) -> [D; 4] {
    let turns = SVector::from_fn(|k, _| z[3 + k + k / 3 * 3]);
    let GapFrame { axes, fold } = turned_frame(&turns, rods.map(|rod| rod.rotation));
    let apart = rods[1].position - rods[0].position;
    let d = [0, 1, 2].map(|c| z[6 + c] - z[c] + apart[c]);
    let along = |i: usize| axes[i][0] * d[0] + axes[i][1] * d[1] + axes[i][2] * d[2];
    [along(0), along(1), along(2), fold]
}

/// The mean of the rotations of two rods at a gap.
struct GapFrame<D> {
    /// The columns of the mean rotation R.
    axes: [[D; 3]; 3],
    /// The rotation between the rods about the first of these axes.
    fold: D,
}

/// The frame of a gap between rods with these rotations, both of which are turned further by `z`.
fn turned_frame<D: DifferentiableNumber>(z: &SVector<D, TURNS>, rods: [DQuat; 2]) -> GapFrame<D> {
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
    let axes = [
        [one - yy - zz, xy + wz, xz - wy],
        [xy - wz, one - xx - zz, yz + wx],
        [xz + wy, yz - wx, one - xx - yy],
    ];
    GapFrame {
        axes,
        fold: between[0] * ratio * 2.0,
    }
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
