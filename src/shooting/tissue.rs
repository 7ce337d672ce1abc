//! Tissue between neighbouring veins: its energy per unit of sigma, written once for numbers with
//! derivatives, from which forces, moments and their linearisation follow. It shares only the
//! natural leaf with the element of the relaxation.

use crate::natural::Natural;
use crate::scenario::{Profile, Scenario};
use crate::shooting::state::RodState;
use glam::{DQuat, DVec3};
use nalgebra::{SMatrix, SVector};
use num_dual::{DualNum, gradient, hessian};

/// Numbers that perturb the two rods at a gap: displacement and spatial rotation of either.
const BOTH: usize = 12;

/// A rod's force and moment by the tissue of a gap.
pub type Load = [DVec3; 2];

/// The linearised loads of a gap: minus the derivatives of forces and moments on both rods (rows)
/// with respect to displacements and spatial rotations of both.
#[derive(Clone, Copy, Debug)]
pub struct Tangent(pub SMatrix<f64, BOTH, BOTH>);

/// The tissue of a leaf, dimensionless.
#[derive(Clone, Debug)]
pub struct Tissue<'a> {
    gaps: &'a [crate::scenario::Tissue],
    natural: Natural<'a>,
    /// Unit of length.
    length: f64,
    /// Of every gap the factors that make k and c_1 those per unit of sigma.
    factors: Vec<[f64; 4]>,
}

/// A number with its derivatives.
trait Number: DualNum<Primitive = f64> + Copy {}

impl<D: DualNum<Primitive = f64> + Copy> Number for D {}

impl<'a> Tissue<'a> {
    /// Of a scenario with these units of length and force; `None` if it has none.
    pub fn new(scenario: &'a Scenario, length: f64, force: f64) -> Option<Self> {
        let gaps = scenario.tissue.as_ref()?;
        let factors = scenario.rods.windows(2).map(|rods| {
            let mean = 0.5 * (rods[0].length + rods[1].length) / length;
            let k = mean * length * length / force;
            [k, k, k, mean / force]
        });
        Some(Tissue {
            natural: Natural::new(scenario, scenario.tissue_grown),
            length,
            gaps,
            factors: factors.collect(),
        })
    }

    /// k and c_1 of gap `g` at `sigma`, per unit of sigma.
    fn stiffness(&self, g: usize, sigma: f64) -> [f64; 4] {
        let (of, factors) = (self.gaps[g].profiles(), self.factors[g]);
        [0, 1, 2, 3].map(|which| of[which].at(sigma) * factors[which])
    }

    /// The largest stiffness of gap `g`.
    pub fn largest(&self, g: usize) -> f64 {
        let [along, across, normal, _] = self.gaps[g].profiles();
        let most = [along, across, normal].map(Profile::max_abs);
        most.into_iter().fold(0.0, f64::max) * self.factors[g][0]
    }

    /// The strains of the natural leaf in gap `g` at `sigma`.
    fn at_rest(&self, g: usize, sigma: f64) -> [f64; 4] {
        let [a, b] = [g, g + 1].map(|j| self.natural.at(j, sigma));
        let rods = [a, b].map(|(x, q)| (x / self.length, q));
        strains::<f64>(&SVector::zeros(), &rods)
    }

    /// The energy of gap `g` and its loads on both rods.
    pub fn loads(&self, g: usize, sigma: f64, rods: [&RodState; 2]) -> (f64, [Load; 2]) {
        let (rest, rods) = (self.at_rest(g, sigma), rods.map(|rod| (rod.r, rod.q)));
        let k = self.stiffness(g, sigma);
        let energy = |z| energy(&k, &rest, &z, &rods);
        let (energy, slopes) = gradient(energy, &SVector::<f64, BOTH>::zeros());
        let vector = |k: usize| -DVec3::from_slice(&slopes.as_slice()[k..k + 3]);
        (energy, [0, 6].map(|k| [vector(k), vector(k + 3)]))
    }

    /// The linearised loads of gap `g`.
    pub fn tangent(&self, g: usize, sigma: f64, rods: [&RodState; 2]) -> Tangent {
        let (rest, rods) = (self.at_rest(g, sigma), rods.map(|rod| (rod.r, rod.q)));
        let k = self.stiffness(g, sigma);
        let energy = |z| energy(&k, &rest, &z, &rods);
        let (_, slopes, mut second) = hessian(energy, &SVector::<f64, BOTH>::zeros());
        // A rotation by theta and then by a is one by a + theta + a x theta/2.
        for first in [3, 9] {
            let m = &slopes.as_slice()[first..first + 3];
            for (r, c, value) in [(0, 1, -m[2]), (0, 2, m[1]), (1, 2, -m[0])] {
                second[(first + r, first + c)] -= 0.5 * value;
                second[(first + c, first + r)] += 0.5 * value;
            }
        }
        Tangent(second)
    }
}

/// The energy of a gap with the stiffnesses `k`, whose strains at rest are `rest`.
fn energy<D: Number>(
    k: &[f64; 4],
    rest: &[f64; 4],
    z: &SVector<D, BOTH>,
    rods: &[(DVec3, DQuat); 2],
) -> D {
    let strains = strains(z, rods);
    (0..4).fold(D::zero(), |sum, i| {
        let strain = strains[i] - rest[i];
        sum + strain * strain * (0.5 * k[i])
    })
}

/// R^T (r_1 - r_0), R being the mean rotation, and the rotation between both about its first axis.
fn strains<D: Number>(z: &SVector<D, BOTH>, rods: &[(DVec3, DQuat); 2]) -> [D; 4] {
    let one = D::one();
    let rotated = |first: usize, q: DQuat| -> [D; 4] {
        let t = [z[first], z[first + 1], z[first + 2]];
        let square = t[0] * t[0] + t[1] * t[1] + t[2] * t[2];
        let increment = [t[0] * 0.5, t[1] * 0.5, t[2] * 0.5, one - square * 0.125];
        product(increment, q.to_array().map(|c| one * c))
    };
    let (p, mut q) = (rotated(3, rods[0].1), rotated(9, rods[1].1));
    if rods[0].1.dot(rods[1].1) < 0.0 {
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
    let apart = rods[1].0 - rods[0].0;
    let d = [0, 1, 2].map(|c| z[6 + c] - z[c] + apart[c]);
    let mut mean = [p[0] + q[0], p[1] + q[1], p[2] + q[2], p[3] + q[3]];
    let length = mean.iter().fold(D::zero(), |sum, c| sum + *c * *c).sqrt();
    mean = mean.map(|c| c / length);
    let [x, y, z, _] = product(
        product(conjugate(mean), [d[0], d[1], d[2], D::zero()]),
        mean,
    );
    [x, y, z, between[0] * ratio * 2.0]
}

/// The product of quaternions (x, y, z, w).
fn product<D: Number>(a: [D; 4], b: [D; 4]) -> [D; 4] {
    [
        a[3] * b[0] + a[0] * b[3] + a[1] * b[2] - a[2] * b[1],
        a[3] * b[1] + a[1] * b[3] + a[2] * b[0] - a[0] * b[2],
        a[3] * b[2] + a[2] * b[3] + a[0] * b[1] - a[1] * b[0],
        a[3] * b[3] - a[0] * b[0] - a[1] * b[1] - a[2] * b[2],
    ]
}
