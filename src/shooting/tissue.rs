//! Tissue between neighboring veins at one sigma, written once for numbers with derivatives. It shares
//! only the natural leaf with the element of the relaxation.
//!
//! **Strains.** With R the mean of the rotations R_a and R_b of both veins and d = r_b - r_a, they are
//! E = R^T d and the fold, first component of log(R_a^T R_b), less those of the natural leaf. The relative
//! rotation enters by the Rodrigues vector g of its half, R^T R_b.
//!
//! **Stresses that are unknowns.** Where the tissue is rigid or contracts across, the stress of E2 acts on the stretch
//! of the veins as well, and that of the fold on their bend: both stresses are unknowns beside n and m,
//! with compliances. Where the tissue is rigid, E1 or E3 keeps its natural value all along. That holds if
//! its rate vanishes and if it holds at the base, so that the rate alone is a condition, on n and m. Its
//! multiplier mu enters the Lagrangian as mu E', which changes n and m into momenta n + (dE/dr) mu, m +
//! (dE/dtheta) mu (C. W. Gear, B. Leimkuhler and G. K. Gupta, J. Comput. Appl. Math. 12, 1985, for
//! constraints of motions): the force of the constraint is -mu' per sigma. At tips and loads on points the
//! momenta satisfy the conditions of n and m without tissue; n and m then have what the tissue exerts at a
//! point.

use crate::natural::Natural;
use crate::rod::Wrench;
use crate::rotation::Pose;
use crate::scenario::{Profile, RodPlace, Scenario, Tissue, longest};
use glam::{DQuat, DVec3};
use nalgebra::{SMatrix, SVector};
use num_dual::{DualNum, jacobian};

/// Numbers that perturb the two rods at a gap: displacement and spatial rotation of either.
pub const PAIR_PERTURBATION_SIZE: usize = 12;

/// Strains of a gap, E1 to E3 and the fold, with a stress each.
pub const GAP_STRAINS: usize = 4;

/// Numbers of a [`GapResponse`].
const RESPONSE_SIZE: usize = 2 * PAIR_PERTURBATION_SIZE + GAP_STRAINS;

/// Square of the tangent of a quarter of the relative rotation below which its angle is a series.
const SERIES_BELOW: f64 = 1e-2;

/// A number with its derivatives.
trait DifferentiableNumber: DualNum<Primitive = f64> + Copy {}

impl<D: DualNum<Primitive = f64> + Copy> DifferentiableNumber for D {}

/// Rates per sigma of a rod's frame, along its own directors.
#[derive(Clone, Copy, Debug, Default)]
pub struct FrameRates {
    /// Rate of the position, L v.
    pub position: DVec3,
    /// Rate of rotation, L u.
    pub rotation: DVec3,
}

/// The tissue of a leaf, dimensionless.
#[derive(Clone, Debug)]
pub struct TissueEnergy<'a> {
    scenario: &'a Scenario,
    gaps: &'a [Tissue],
    stress_free: Natural<'a>,
    /// Unit of length.
    length: f64,
    /// Factors of the scenario's k (three) and c_1 that make them dimensionless and per unit of sigma,
    /// gap by gap.
    factors: Vec<[f64; GAP_STRAINS]>,
    /// Whether the stress of some gap is an unknown.
    has_stresses: bool,
}

/// The tissue of a gap at one sigma, dimensionless and per unit of sigma.
#[derive(Clone, Copy, Debug, Default)]
pub struct GapLaw {
    /// Stiffnesses of the strains from which their stress follows; 0 for the others.
    stiffness: [f64; GAP_STRAINS],
    /// Compliances of the strains whose stress is an unknown, 0 where they are rigid; none for the others.
    compliance: [Option<f64>; GAP_STRAINS],
    /// Strains of the natural leaf.
    natural: [f64; GAP_STRAINS],
    /// Rates of E1 to E3 in the natural leaf, where a strain is rigid.
    natural_rates: [f64; 3],
    /// Half the contraction over the length of either vein.
    contraction: [f64; 2],
    /// Half the natural E1 over the length of either vein, where tissue is strained by its veins.
    offset: [f64; 2],
}

impl GapLaw {
    /// Compliance of a strain whose stress is an unknown.
    pub fn stress_compliance(&self, strain: usize) -> Option<f64> {
        self.compliance[strain]
    }
}

impl Tissue {
    /// Whether E1 to E3 and the fold are rigid.
    pub(super) fn rigid_strains(&self) -> [bool; GAP_STRAINS] {
        self.stiffness_profiles()
            .map(|profile| profile.max_abs() == f64::INFINITY)
    }
}

/// Distance of natural tips, in lengths, up to which they are one.
const JOINT_DISTANCE: f64 = 1e-6;

/// Whether the tissue of some gap is rigid along or normal to its veins.
pub fn has_rigid_tissue(scenario: &Scenario) -> bool {
    let mut gaps = scenario.tissue.iter().flatten();
    gaps.any(|gap| gap.rigid_strains().contains(&true))
}

/// What keeps shooting from solving for rigid tissue; `None` if nothing does. That joint tips meet in the
/// natural leaf is checked with the scenario.
pub fn rigid_tissue_obstacle(scenario: &Scenario) -> Option<&'static str> {
    if !has_rigid_tissue(scenario) {
        return None;
    }
    if !scenario.all_bases_clamped() {
        return Some("bases on hinges (leaf.base_held): clamp them, or give finite stiffnesses");
    }
    let natural = Natural::new(scenario, scenario.tissue_grown);
    let length = longest(&scenario.rods);
    for (g, gap) in scenario.tissue.iter().flatten().enumerate() {
        let strains = gap.rigid_strains();
        for end in [0.0, 1.0] {
            let poses = [g, g + 1].map(|j| natural.vein_pose(j, end));
            let apart = GapKinematics::<f64>::between(&SVector::zeros(), &poses).strains();
            let near = |i: usize| apart[i].abs() <= JOINT_DISTANCE * length;
            let one_tip = end == 1.0 && (scenario.joined || scenario.held_tip.is_some());
            let closed = one_tip || (0..3).all(near);
            let rods = &scenario.rods[g..g + 2];
            let stiff = |i: usize| {
                strains[i]
                    && rods
                        .iter()
                        .all(|rod| rod.force_stiffness[i].at(end).is_infinite())
            };
            if closed && (stiff(0) || stiff(2)) {
                return Some(
                    "veins that neither stretch nor shear where they meet: give stiffness.axial and stiffness.shear_3 numbers",
                );
            }
        }
    }
    None
}

impl<'a> TissueEnergy<'a> {
    /// How many strains are rigid.
    pub fn rigid_strain_count(&self) -> usize {
        let gaps = self.gaps.iter().flat_map(Tissue::rigid_strains);
        gaps.filter(|rigid| *rigid).count()
    }

    /// The tissue of a scenario with these units of length and force; `None` if it has none.
    pub fn new(scenario: &'a Scenario, length: f64, force: f64) -> Option<Self> {
        let gaps = scenario.tissue.as_ref()?;
        let factors = scenario.rods.windows(2).map(|rods| {
            let mean = 0.5 * (rods[0].length + rods[1].length) / length;
            let k = mean * length * length / force;
            [k, k, k, mean / force]
        });
        Some(TissueEnergy {
            scenario,
            stress_free: Natural::new(scenario, scenario.tissue_grown),
            length,
            gaps,
            factors: factors.collect(),
            has_stresses: gaps.iter().any(Tissue::has_unknown_forces),
        })
    }

    /// Whether the stress of some gap is an unknown.
    pub fn has_stresses(&self) -> bool {
        self.has_stresses
    }

    /// The largest of k1 to k3 of gap `g`, those that are rigid left out, and c1.
    pub fn largest_stiffnesses(&self, g: usize) -> [f64; 2] {
        let [along, across, normal, fold] = self.gaps[g].stiffness_profiles().map(Profile::max_abs);
        let finite = [along, across, normal]
            .into_iter()
            .filter(|k| k.is_finite());
        let factors = self.factors[g];
        [finite.fold(0.0, f64::max) * factors[0], fold * factors[3]]
    }

    /// Width of gap `g` in the middle of the natural leaf, if it is rigid normal to the veins.
    pub fn rigid_width(&self, g: usize) -> Option<f64> {
        let [.., normal, _] = self.gaps[g].rigid_strains();
        let poses = || [g, g + 1].map(|j| self.stress_free.vein_pose(j, 0.5));
        let strains = || GapKinematics::<f64>::between(&SVector::zeros(), &poses()).strains();
        normal.then(|| strains()[1].abs() / self.length)
    }

    /// The tissue of gap `g` at a place, its finite stiffnesses multiplied by `lambda`.
    pub fn law(&self, g: usize, place: RodPlace, lambda: f64) -> GapLaw {
        let (gap, factors) = (&self.gaps[g], self.factors[g]);
        let mut law = GapLaw::default();
        let strained_by_veins = gap.has_unknown_forces();
        let rigid = gap.rigid_strains();
        for (i, profile) in gap.stiffness_profiles().into_iter().enumerate() {
            if rigid[i] {
                law.compliance[i] = Some(0.0);
                continue;
            }
            let stiffness = lambda * profile.at(place) * factors[i];
            match strained_by_veins && i % 2 == 1 {
                true if stiffness > 0.0 => law.compliance[i] = Some(stiffness.recip()),
                true => (),
                false => law.stiffness[i] = stiffness,
            }
        }
        let rods = [g, g + 1].map(|j| &self.scenario.rods[j]);
        let contraction = 0.5 * gap.contraction.at(place);
        law.contraction = rods.map(|rod| contraction / rod.length);
        let poses = [g, g + 1].map(|j| {
            let pose = self.stress_free.vein_pose(j, place.sigma);
            Pose {
                position: pose.position / self.length,
                ..pose
            }
        });
        let gap = GapKinematics::between(&SVector::zeros(), &poses);
        law.natural = gap.strains();
        if strained_by_veins {
            let offset = 0.5 * law.natural[0] * self.length;
            law.offset = rods.map(|rod| offset / rod.length);
        }
        if rigid.contains(&true) {
            let rates = rods.map(|rod| {
                let stretch = match self.scenario.tissue_grown {
                    true => rod.rest_stretch.at(place),
                    false => 1.0,
                };
                let bend = Profile::values_of_three(rod.rest_curvature.each_ref(), place);
                FrameRates {
                    position: DVec3::X * (stretch * rod.length / self.length),
                    rotation: DVec3::from_array(bend) * rod.length,
                }
            });
            law.natural_rates = gap.strain_rates(&rates);
        }
        law
    }
}

/// The two rods at a gap, and their tissue.
#[derive(Clone, Copy, Debug)]
pub struct StressedGap {
    pub law: GapLaw,
    pub poses: [Pose; 2],
    /// Rates of the frames of both rods.
    pub rates: [FrameRates; 2],
    /// Rates without stress.
    pub unstrained: [FrameRates; 2],
    /// Stresses that are unknowns, 0 where they are not: along, normal: multipliers.
    pub stresses: [f64; GAP_STRAINS],
}

/// Derivatives of the Lagrangian of a gap by the poses of both rods and by the stresses.
#[derive(Clone, Copy, Debug, Default)]
pub struct GapLoads {
    /// By displacement and spatial rotation.
    pub by_pose: [Wrench; 2],
    /// By the stresses, without their compliance.
    pub by_stresses: [f64; GAP_STRAINS],
    /// Potential energy per unit of sigma.
    pub energy: f64,
}

/// Second derivatives of the Lagrangian of a gap: by the perturbations of both rods (displacement and
/// spatial rotation each) in the columns, and in the rows by them, by the rates of both frames, and by the
/// stresses.
#[derive(Clone, Copy, Debug)]
pub struct GapTangent {
    pub by_pose: SMatrix<f64, PAIR_PERTURBATION_SIZE, PAIR_PERTURBATION_SIZE>,
    pub by_rates: SMatrix<f64, PAIR_PERTURBATION_SIZE, PAIR_PERTURBATION_SIZE>,
    pub by_stresses: SMatrix<f64, GAP_STRAINS, PAIR_PERTURBATION_SIZE>,
}

impl StressedGap {
    /// The loads of the gap and its energy.
    pub fn loads(&self) -> GapLoads {
        let gap = GapKinematics::<f64>::between(&SVector::zeros(), &self.poses);
        let GapResponse {
            by_pose,
            by_stresses,
            ..
        } = self.response(&gap);
        let mut energy = 0.0;
        for (i, strain) in gap.strains().into_iter().enumerate() {
            let excess = strain - self.law.natural[i];
            let compliance = self.law.compliance[i].unwrap_or(0.0);
            energy += 0.5 * self.law.stiffness[i] * excess * excess;
            energy += 0.5 * compliance * self.stresses[i] * self.stresses[i];
        }
        GapLoads {
            by_pose: wrenches_on_both(by_pose),
            by_stresses,
            energy,
        }
    }

    /// What the stresses alone contribute to the derivatives by the rates of both frames.
    pub fn rate_derivatives(&self, stresses: &[f64; GAP_STRAINS]) -> [Wrench; 2] {
        let gap = GapKinematics::<f64>::between(&SVector::zeros(), &self.poses);
        wrenches_on_both(gap.rate_derivatives(&self.law, stresses))
    }

    /// The linearized loads.
    pub fn tangent(&self) -> GapTangent {
        let response = |z: SVector<_, PAIR_PERTURBATION_SIZE>| {
            let gap = GapKinematics::between(&z, &self.poses);
            self.response(&gap).numbers()
        };
        let (_, slopes): (_, SMatrix<f64, RESPONSE_SIZE, PAIR_PERTURBATION_SIZE>) =
            jacobian(response, &SVector::zeros());
        GapTangent {
            by_pose: slopes.fixed_rows::<12>(0).into_owned(),
            by_rates: slopes.fixed_rows::<12>(12).into_owned(),
            by_stresses: slopes.fixed_rows::<4>(24).into_owned(),
        }
    }

    /// The derivatives of the Lagrangian
    ///
    /// ```text
    /// sum of 1/2 k_i (E_i - natural)^2 + mu (E' - natural)
    ///     + t2 (E2 + c (e_a + e_b)/2 - a (g_a + g_b)/2) + t4 (fold - c (k_a + k_b)/2 - a (w_a + w_b)/2)
    /// ```
    ///
    /// with the natural E1 = a and the strains e, g, w and k of the veins in stretch, shear, twist and bend, t and mu being the stresses that are
    /// unknowns. E' = Q V_b - P V_a - W x E, with V the rates of positions, Q = R^T R_b, P = R^T R_a and W
    /// the rate of R, which is (P U_a + Q U_b)/2 + g/2 x (P U_a - Q U_b).
    fn response<D: DifferentiableNumber>(&self, gap: &GapKinematics<D>) -> GapResponse<D> {
        let (law, stresses) = (&self.law, &self.stresses);
        let strains = gap.strains();
        let stress = |i: usize| {
            let unknown = if i % 2 == 1 { stresses[i] } else { 0.0 };
            (strains[i] - law.natural[i]) * law.stiffness[i] + unknown
        };
        let (axes, g) = (gap.axes, gap.g);
        let e = [strains[0], strains[1], strains[2]];
        let mu = constant(multiplier(stresses));
        let [va, vb] = [0, 1].map(|k| gap.in_mean_frame(k, self.rates[k].position));
        let [ua, ub] = [0, 1].map(|k| gap.in_mean_frame(k, self.rates[k].rotation));
        let turn = gap.mean_rotation_rate(ua, ub);
        let by_turn = cross(mu, e);
        let half = scaled(g, 0.5);
        let (mean, twist) = (scaled(by_turn, 0.5), cross(by_turn, half));
        let (by_ua, by_ub) = (sum(mean, twist), difference(mean, twist));
        // By E, and by g.
        let by_e = difference([stress(0), stress(1), stress(2)], cross(mu, turn));
        let fold = stress(3);
        let QuarterAngle { ratio, slope } = QuarterAngle::new(dot(g, g));
        let mut by_g = scaled(cross(difference(ua, ub), by_turn), 0.5);
        by_g = sum(by_g, g.map(|g_i| g_i * slope * g[0] * fold * 8.0));
        by_g[0] += fold * ratio * 4.0;
        // Work of the rotations of either frame against the mean frame, and of the mean frame.
        let rodrigues = sum(sum(by_g, cross(g, by_g)), scaled_by(g, dot(g, by_g)));
        let a = difference(cross(ua, by_ua), cross(va, mu));
        let b = sum(sum(cross(vb, mu), cross(ub, by_ub)), scaled(rodrigues, 0.5));
        let rest = difference(cross(by_e, e), sum(a, b));
        let (shared, apart_part) = (scaled(rest, 0.5), cross(rest, half));
        let lab = |v: [D; 3]| {
            [0, 1, 2].map(|c| axes[0][c] * v[0] + axes[1][c] * v[1] + axes[2][c] * v[2])
        };
        let force = lab(by_e);
        let [e1, _, e3] = difference(difference(vb, va), cross(turn, e));
        let strain_of = |factors: [f64; 2], part: fn(&FrameRates) -> f64| {
            let excess = |k: usize| factors[k] * (part(&self.rates[k]) - part(&self.unstrained[k]));
            excess(0) + excess(1)
        };
        let (contraction, offset) = (law.contraction, law.offset);
        let across = strain_of(contraction, |rates| rates.position.x)
            - strain_of(offset, |rates| rates.position.y);
        let folded = strain_of(contraction, |rates| rates.rotation.y)
            + strain_of(offset, |rates| rates.rotation.x);
        GapResponse {
            by_pose: [
                force.map(|f| -f),
                lab(sum(sum(a, shared), apart_part)),
                force,
                lab(difference(sum(b, shared), apart_part)),
            ],
            by_rates: gap.rate_derivatives(law, stresses),
            by_stresses: [
                e1 - law.natural_rates[0],
                e[1] - law.natural[1] + across,
                e3 - law.natural_rates[2],
                strains[3] - law.natural[3] - folded,
            ],
        }
    }
}

/// Force and moment on either rod.
fn wrenches_on_both([a, b, c, d]: [[f64; 3]; 4]) -> [Wrench; 2] {
    [[a, b], [c, d]].map(|[force, moment]| Wrench {
        force: force.into(),
        moment: moment.into(),
    })
}

/// The multipliers of E1 and E3 as a vector.
fn multiplier(stresses: &[f64; GAP_STRAINS]) -> DVec3 {
    DVec3::new(stresses[0], 0.0, stresses[2])
}

/// Derivatives of the Lagrangian of a gap, in the order of the rods.
struct GapResponse<D> {
    /// By displacement and spatial rotation of either rod.
    by_pose: [[D; 3]; 4],
    /// By the rates of either frame.
    by_rates: [[D; 3]; 4],
    by_stresses: [D; GAP_STRAINS],
}

impl<D: DifferentiableNumber> GapResponse<D> {
    fn numbers(&self) -> SVector<D, RESPONSE_SIZE> {
        SVector::from_fn(|i, _| match i {
            0..12 => self.by_pose[i / 3][i % 3],
            12..24 => self.by_rates[i / 3 - 4][i % 3],
            _ => self.by_stresses[i - 24],
        })
    }
}

/// The frames of two rods at a gap.
struct GapKinematics<D> {
    /// The columns of the mean rotation R.
    axes: [[D; 3]; 3],
    /// Rodrigues vector of R^T R_b, half the rotation between the rods.
    g: [D; 3],
    /// r_b - r_a.
    apart: [D; 3],
}

impl<D: DifferentiableNumber> GapKinematics<D> {
    /// The frames of `rods`, displaced and turned further by `z`.
    fn between(z: &SVector<D, PAIR_PERTURBATION_SIZE>, rods: &[Pose; 2]) -> Self {
        let one = D::one();
        let rotated = |first: usize, q: DQuat| -> [D; 4] {
            let t = [z[first], z[first + 1], z[first + 2]];
            let increment = [t[0] * 0.5, t[1] * 0.5, t[2] * 0.5, one - dot(t, t) * 0.125];
            product(increment, q.to_array().map(D::from))
        };
        let (p, mut q) = (rotated(3, rods[0].rotation), rotated(9, rods[1].rotation));
        if rods[0].rotation.dot(rods[1].rotation) < 0.0 {
            q = q.map(|c| -c);
        }
        let between = product([-p[0], -p[1], -p[2], p[3]], q);
        let scale = (between[3] + 1.0).recip();
        let [x, y, z_, w] = [p[0] + q[0], p[1] + q[1], p[2] + q[2], p[3] + q[3]];
        let twice = (x * x + y * y + z_ * z_ + w * w).recip() * 2.0;
        let [wx, wy, wz] = [w * x * twice, w * y * twice, w * z_ * twice];
        let [xx, yy, zz] = [x * x * twice, y * y * twice, z_ * z_ * twice];
        let [xy, xz, yz] = [x * y * twice, x * z_ * twice, y * z_ * twice];
        let apart = rods[1].position - rods[0].position;
        GapKinematics {
            axes: [
                [one - yy - zz, xy + wz, xz - wy],
                [xy - wz, one - xx - zz, yz + wx],
                [xz + wy, yz - wx, one - xx - yy],
            ],
            g: [0, 1, 2].map(|c| between[c] * scale),
            apart: [0, 1, 2].map(|c| z[6 + c] - z[c] + apart[c]),
        }
    }

    /// E1 to E3 and the fold.
    fn strains(&self) -> [D; GAP_STRAINS] {
        let along = |i: usize| dot(self.axes[i], self.apart);
        let angle = QuarterAngle::new(dot(self.g, self.g));
        let fold = angle.ratio * self.g[0] * 4.0;
        [along(0), along(1), along(2), fold]
    }

    /// Components along the mean frame of a vector along the directors of rod `k` of both.
    fn in_mean_frame(&self, k: usize, v: DVec3) -> [D; 3] {
        self.rotated(if k == 0 { -1.0 } else { 1.0 }, constant(v))
    }

    /// `v` rotated by half the rotation between the rods, with this sign.
    fn rotated(&self, sign: f64, v: [D; 3]) -> [D; 3] {
        let g = scaled(self.g, sign);
        let turn = cross(g, v);
        let scale = (dot(g, g) + 1.0).recip() * 2.0;
        sum(v, scaled_by(sum(turn, cross(g, turn)), scale))
    }

    /// Rate of the mean rotation for the rates of both, all along the mean frame.
    fn mean_rotation_rate(&self, a: [D; 3], b: [D; 3]) -> [D; 3] {
        sum(
            scaled(sum(a, b), 0.5),
            cross(scaled(self.g, 0.5), difference(a, b)),
        )
    }

    /// Rates of E1 to E3.
    fn strain_rates(&self, rates: &[FrameRates; 2]) -> [D; 3] {
        let [va, vb] = [0, 1].map(|k| self.in_mean_frame(k, rates[k].position));
        let [ua, ub] = [0, 1].map(|k| self.in_mean_frame(k, rates[k].rotation));
        let [e1, e2, e3, _] = self.strains();
        let turn = self.mean_rotation_rate(ua, ub);
        difference(difference(vb, va), cross(turn, [e1, e2, e3]))
    }

    /// Derivatives of the Lagrangian by the rates of positions and of rotations, rod by rod.
    fn rate_derivatives(&self, law: &GapLaw, stresses: &[f64; GAP_STRAINS]) -> [[D; 3]; 4] {
        let mu = constant(multiplier(stresses));
        let [e1, e2, e3, _] = self.strains();
        let by_turn = cross(mu, [e1, e2, e3]);
        let (mean, twist) = (scaled(by_turn, 0.5), cross(by_turn, scaled(self.g, 0.5)));
        let mut derivatives = [
            self.rotated(1.0, scaled(mu, -1.0)),
            self.rotated(1.0, sum(mean, twist)),
            self.rotated(-1.0, mu),
            self.rotated(-1.0, difference(mean, twist)),
        ];
        for (k, (contraction, offset)) in law.contraction.into_iter().zip(law.offset).enumerate() {
            let [position, rotation] = &mut derivatives[2 * k..2 * k + 2] else {
                continue;
            };
            position[0] += contraction * stresses[1];
            position[1] -= offset * stresses[1];
            rotation[0] -= offset * stresses[3];
            rotation[1] -= contraction * stresses[3];
        }
        derivatives
    }
}

/// atan(y)/y for the tangent y of a quarter angle, and its derivative by y^2.
struct QuarterAngle<D> {
    ratio: D,
    slope: D,
}

impl<D: DifferentiableNumber> QuarterAngle<D> {
    fn new(square: D) -> Self {
        if square.re() > SERIES_BELOW {
            let tangent = square.sqrt();
            let ratio = tangent.atan() / tangent;
            let slope = ((square + 1.0).recip() - ratio) / (square * 2.0);
            return QuarterAngle { ratio, slope };
        }
        let (mut ratio, mut slope) = (D::zero(), D::zero());
        for k in (0..10).rev() {
            let sign = if k % 2 == 0 { 1.0 } else { -1.0 };
            let coefficient = sign / (2 * k + 1) as f64;
            ratio = ratio * square + coefficient;
            if k > 0 {
                slope = slope * square + coefficient * k as f64;
            }
        }
        QuarterAngle { ratio, slope }
    }
}

fn constant<D: DifferentiableNumber>(v: DVec3) -> [D; 3] {
    v.to_array().map(D::from)
}

fn dot<D: DifferentiableNumber>(a: [D; 3], b: [D; 3]) -> D {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn cross<D: DifferentiableNumber>(a: [D; 3], b: [D; 3]) -> [D; 3] {
    [0, 1, 2].map(|i| {
        let (j, k) = ((i + 1) % 3, (i + 2) % 3);
        a[j] * b[k] - a[k] * b[j]
    })
}

fn sum<D: DifferentiableNumber>(a: [D; 3], b: [D; 3]) -> [D; 3] {
    [0, 1, 2].map(|i| a[i] + b[i])
}

fn difference<D: DifferentiableNumber>(a: [D; 3], b: [D; 3]) -> [D; 3] {
    [0, 1, 2].map(|i| a[i] - b[i])
}

fn scaled<D: DifferentiableNumber>(a: [D; 3], factor: f64) -> [D; 3] {
    a.map(|a_i| a_i * factor)
}

fn scaled_by<D: DifferentiableNumber>(a: [D; 3], factor: D) -> [D; 3] {
    a.map(|a_i| a_i * factor)
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
    use super::*;

    /// Two rods far from their natural poses, and large stresses.
    fn gap(compliance: [Option<f64>; GAP_STRAINS], stiffness: [f64; GAP_STRAINS]) -> StressedGap {
        let pose = |position: [f64; 3], turn: [f64; 3]| Pose {
            position: position.into(),
            rotation: DQuat::from_scaled_axis(turn.into()),
        };
        let rates = |position: [f64; 3], rotation: [f64; 3]| FrameRates {
            position: position.into(),
            rotation: rotation.into(),
        };
        StressedGap {
            law: GapLaw {
                stiffness,
                compliance,
                natural: [0.1, 0.4, -0.05, 0.2],
                natural_rates: [0.3, 0.0, 0.1],
                contraction: [0.2, 0.3],
                offset: [0.04, -0.03],
            },
            poses: [
                pose([0.1, 0.4, -0.2], [0.3, -0.8, 0.5]),
                pose([-0.1, 0.9, 0.2], [0.9, -0.2, 1.1]),
            ],
            rates: [
                rates([1.1, 0.2, -0.1], [0.4, -0.7, 0.9]),
                rates([0.8, -0.3, 0.2], [-0.5, 0.6, 0.3]),
            ],
            unstrained: [rates([1.0, 0.0, 0.0], [0.1, 0.2, 0.3]); 2],
            stresses: compliance.map(|of| of.map_or(0.0, |of| 1.3 - of)),
        }
    }

    fn numbers(wrenches: [Wrench; 2]) -> [f64; PAIR_PERTURBATION_SIZE] {
        let all = wrenches.map(|it| [it.force.to_array(), it.moment.to_array()].concat());
        std::array::from_fn(|k| all[k / 6][k % 6])
    }

    /// The gap with component `c` of its poses perturbed.
    fn perturbed(gap: &StressedGap, c: usize, by: f64) -> StressedGap {
        let mut gap = *gap;
        let pose = &mut gap.poses[c / 6];
        let change = by * DVec3::AXES[c % 3];
        match c % 6 / 3 {
            0 => pose.position += change,
            _ => pose.rotation = DQuat::from_scaled_axis(change) * pose.rotation,
        }
        gap
    }

    /// Loads are derivatives of the energy, by differences.
    #[test]
    fn loads_are_derivatives_of_the_energy() {
        let gap = gap([None; GAP_STRAINS], [1.0, 2.0, 3.0, 4.0]);
        let found = numbers(gap.loads().by_pose);
        for (c, found) in found.into_iter().enumerate() {
            let side = |h: f64| perturbed(&gap, c, h).loads().energy;
            let central = |h: f64| (side(h) - side(-h)) / (2.0 * h);
            let wanted = (4.0 * central(1e-3) - central(2e-3)) / 3.0;
            assert!((found - wanted).abs() < 1e-9, "{c}: {found}, {wanted}");
        }
    }

    /// Loads by stresses are their work on the strains, and on the rates of strains that are rigid.
    #[test]
    fn stresses_do_their_work_on_strains() {
        let unknown = [Some(0.0), Some(0.4), Some(0.0), Some(0.2)];
        let gap = gap(unknown, [0.0; GAP_STRAINS]);
        let work = |strains: &[f64; GAP_STRAINS]| -> f64 {
            (strains.iter().zip(&gap.stresses))
                .map(|(strain, stress)| strain * stress)
                .sum()
        };
        let tangent = gap.tangent();
        for (c, found) in numbers(gap.loads().by_pose).into_iter().enumerate() {
            let slopes = [0, 1, 2, 3].map(|i| tangent.by_stresses[(i, c)]);
            assert!((found - work(&slopes)).abs() < 1e-13, "{c}: {found}");
        }
        // Strains are linear in the rates.
        let rates = numbers(gap.rate_derivatives(&gap.stresses));
        for (c, found) in rates.into_iter().enumerate() {
            let mut other = gap;
            let rates = &mut other.rates[c / 6];
            let part = if c % 6 < 3 {
                &mut rates.position
            } else {
                &mut rates.rotation
            };
            part[c % 3] += 1.0;
            let [before, after] = [&gap, &other].map(|gap| work(&gap.loads().by_stresses));
            assert!((after - before - found).abs() < 1e-13, "{c}: {found}");
        }
        // The rates of E1 and E3, by moving both rods with them.
        let moved = |h: f64| {
            let mut gap = gap;
            for (pose, rates) in gap.poses.iter_mut().zip(&gap.rates) {
                pose.position += pose.rotation * rates.position * h;
                let turn = pose.rotation * rates.rotation * h;
                pose.rotation = DQuat::from_scaled_axis(turn) * pose.rotation;
            }
            GapKinematics::<f64>::between(&SVector::zeros(), &gap.poses).strains()
        };
        let (before, after) = (moved(-1e-5), moved(1e-5));
        let found = gap.loads().by_stresses;
        for i in [0, 2] {
            let wanted = (after[i] - before[i]) / 2e-5 - gap.law.natural_rates[i];
            assert!(
                (found[i] - wanted).abs() < 1e-8,
                "{i}: {}, {wanted}",
                found[i]
            );
        }
    }
}
