//! The equilibrium equations of the paper as a system of ordinary differential
//! equations in sigma = s/L, for all rods at once.
//!
//! With the orientation as a unit quaternion q instead of nine director
//! components there are 13 N unknown functions where the paper has 18 N. Force
//! and moment are carried by their components along the lab axes, in which
//! eqs (1) and (2) have no derivatives of directors:
//!
//! ```text
//! r' = L R v,   q' = L/2 (R u) q,   n' = -L f,   m' = n x r'
//! v = v0 + H^-1 R^T n,   u = u0 + A^-1 R^T m                      eqs (5) (6)
//! ```
//!
//! Conditions hold at the bases, which clamps or hinges hold, and at the tips. Besides common loads
//! veins have their own: weights, loads along them, and loads on points, by which n and m jump.
//!
//! The equations contain a path of leaves from one whose solution is known, stretched circular arcs
//! from the fan at the base to a common tip without loads, to the scenario's.

#[cfg(test)]
mod tests;

use crate::natural::Natural;
use crate::rod::Wrench;
use crate::rotation::{self, HeldSpin, Pose, outer};
use crate::run::Limit;
use crate::scenario::{
    BaseSupport, PointLoad, Profile, RodPlace, Scenario, ZeroEnergyRotation, longest,
};
use crate::shape::NodeState;
use crate::shooting::follower_loads::FollowerLoads;
use crate::shooting::rod_state::{
    FreeBaseChanges, JumpDerivatives, RodState, STATE_SIZE, SlopeDerivatives, cross_matrix,
    rotation_difference,
};
use crate::shooting::tissue::{FrameRates, TissueEnergy};
use crate::shooting::tissue_stresses::{RodSection, TissueState};
use glam::{DMat3, DQuat, DVec3};
use std::f64::consts::PI;

/// The boundary-value problem of a leaf, dimensionless.
///
/// A flat state holds [`STATE_SIZE`] numbers per rod and, last, the potential
/// energy of everything from the base up to sigma.
#[derive(Clone, Debug)]
pub struct BoundaryValueProblem<'a> {
    scenario: &'a Scenario,
    /// Unit of length: the longest rod.
    pub length_unit: f64,
    /// Unit of force, A/L^2, with A the geometric mean of A2 and A3 mid-rod.
    pub force_unit: f64,
    pub lengths: Vec<f64>,
    coupling: Vec<DVec3>,
    tissue: Option<TissueEnergy<'a>>,
    /// The natural leaf, in which a foundation has no force; `None` without a foundation.
    foundation: Option<Natural<'a>>,
    /// Whether veins have loads of their own.
    own_loads: bool,
    /// Whether dead forces act on points off the axis.
    levers: bool,
    /// Loads without a potential, if there are such.
    followers: Option<FollowerLoads<'a>>,
    gravity: DVec3,
    tip_force: DVec3,
    tip_moment: DVec3,
    /// Where the tips of the rods are held; empty if they are not.
    held_tips: Vec<Pose>,
    /// The smallest couple stiffness along each rod.
    pub softest_couple_stiffness: Vec<f64>,
    /// Growth rate per sigma of perturbations of each rod due to coupling.
    coupling_growth_rate: Vec<f64>,
    /// The veins that can turn without resistance.
    turnings: Vec<ZeroEnergyRotation>,
    arcs: Vec<RestArc>,
    /// Fractions of the length where a profile has a kink, ascending.
    kinks: Vec<f64>,
    /// Homotopy parameter between 0, a leaf without loads that rests in the shape of arcs with a
    /// common tip, and 1, the leaf of the scenario.
    pub load_lambda: f64,
    /// Homotopy parameter between 0, rods with their largest stiffness in every direction, and 1,
    /// the rods of the scenario.
    pub softening_lambda: f64,
    /// Time limit of the solution.
    pub limit: Limit,
}

/// Fractions of the length that are closer to each other than this are the same station.
pub(super) const FRACTION_TOLERANCE: f64 = 1e-11;

/// What holds the tips of all rods.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TipConstraint {
    /// Nothing.
    Free,
    /// A common position.
    Joint,
    /// A given position.
    Pinned,
    /// A given position and given directors.
    Clamped,
}

/// Material of a rod at one sigma.
struct SectionLaw {
    compliance: DVec3,
    flexibility: DVec3,
    rest_strain: DVec3,
    rest_curvature: DVec3,
}

impl<'a> BoundaryValueProblem<'a> {
    pub fn new(scenario: &'a Scenario) -> Self {
        let rods = &scenario.rods;
        let length = longest(rods);
        let bending = rods.iter().flat_map(|rod| &rod.couple_stiffness[1..]);
        let logs: f64 = bending.map(|stiffness| stiffness.at(0.5).ln()).sum();
        let stiffness = (logs / (2 * rods.len()) as f64).exp();
        let force = stiffness / (length * length);
        let lengths: Vec<f64> = rods.iter().map(|rod| rod.length / length).collect();
        let coupling: Vec<DVec3> = (lengths.windows(2).zip(&scenario.coupling))
            .map(|(gap, kappa)| {
                DVec3::from_array(*kappa) * (0.5 * (gap[0] + gap[1]) * length * length / force)
            })
            .collect();
        let least = |profiles: &[Profile; 3]| {
            let each = profiles.iter().map(Profile::min);
            each.fold(f64::INFINITY, f64::min)
        };
        let softest: Vec<f64> = (rods.iter())
            .map(|rod| least(&rod.couple_stiffness) / (force * length * length))
            .collect();
        let tissue = TissueEnergy::new(scenario, length, force);
        let of_tissue = |gap: usize| {
            let tissue = tissue.as_ref();
            tissue.map_or([0.0; 2], |tissue| tissue.largest_stiffnesses(gap))
        };
        let coupled_rate = (0..rods.len())
            .map(|j| {
                let gaps = [j.checked_sub(1), Some(j)].into_iter().flatten();
                let gaps = gaps.filter(|gap| *gap < coupling.len());
                // Where tissue keeps veins level they twist as they rise, against which they bend.
                let width = |gap: usize| tissue.as_ref().and_then(|it| it.rigid_width(gap));
                let twisting = gaps.clone().filter_map(width).map(|width| {
                    let [torsion, bending, _] = &rods[j].couple_stiffness;
                    let shear = rods[j].force_stiffness[2].max_abs().recip();
                    let rise = 0.25 * width * width / torsion.max_abs() * (length * length);
                    let pull = 2.0 / (shear + rise);
                    rods[j].length * (pull / bending.min()).sqrt()
                });
                let twisting = twisting.fold(0.0, f64::max);
                let fold: f64 = gaps.clone().map(|gap| of_tissue(gap)[1]).sum();
                let pull: DVec3 = gaps.map(|gap| coupling[gap] + of_tissue(gap)[0]).sum();
                let ground = scenario.foundation.as_ref().map_or(DVec3::ZERO, |ground| {
                    let most = ground[j].each_ref().map(Profile::max_abs);
                    DVec3::from_array(most) * (lengths[j] * length * length / force)
                });
                let pull = pull + 0.5 * ground;
                // Neighbors that move in the opposite direction double the pull; against
                // it a rod bends, r'''' = -pull r, or stretches, r'' = pull r.
                let pull = 2.0 * lengths[j] * pull.max_element();
                let stiffness = least(&rods[j].force_stiffness) / force;
                let bend = (pull * lengths[j] * lengths[j] / softest[j]).sqrt().sqrt();
                // In a vein that has grown, forces have longer arms.
                let grown = rods[j].rest_stretch.max_abs().sqrt();
                // Against a fold it twists, theta'' = fold theta.
                let twist = (2.0 * lengths[j] * fold / softest[j]).sqrt();
                (grown * bend)
                    .max((pull / stiffness).sqrt())
                    .max(twist)
                    .max(twisting)
            })
            .collect();
        BoundaryValueProblem {
            scenario,
            length_unit: length,
            force_unit: force,
            coupling_growth_rate: coupled_rate,
            coupling,
            tissue,
            foundation: (scenario.foundation.is_some()).then(|| Natural::new(scenario, true)),
            own_loads: scenario.has_own_loads(),
            levers: scenario.points.iter().any(PointLoad::is_off_axis),
            followers: FollowerLoads::new(scenario, length, force),
            gravity: DVec3::from_array(scenario.gravity) * (length / force),
            tip_force: DVec3::from_array(scenario.tip_force) / force,
            tip_moment: DVec3::from_array(scenario.tip_moment) / (force * length),
            held_tips: (0..rods.len())
                .filter_map(|j| {
                    let held = scenario.held_tip.as_ref()?;
                    let clamp = held.clamps.as_ref().map(|clamps| clamps[j].rotation());
                    Some(Pose {
                        position: DVec3::from_array(held.position) / length,
                        rotation: clamp.unwrap_or_default(),
                    })
                })
                .collect(),
            softest_couple_stiffness: softest,
            turnings: scenario.zero_energy_rotations(),
            arcs: rest_arcs(scenario, &lengths),
            kinks: scenario.kinks(),
            lengths,
            load_lambda: 1.0,
            softening_lambda: 1.0,
            limit: Limit::default(),
        }
    }

    pub fn rods(&self) -> usize {
        self.lengths.len()
    }

    /// Length of a flat state.
    pub fn state_size(&self) -> usize {
        STATE_SIZE * self.rods() + 1
    }

    /// Rate per sigma at which perturbations of rod `j` grow or turn: a rod
    /// under the axial force T bends with the wavenumber sqrt(T/A).
    pub fn perturbation_rate(&self, j: usize, force: f64) -> f64 {
        let grown = self.scenario.rods[j].rest_stretch.max_abs();
        let tension = self.lengths[j] * (grown * force / self.softest_couple_stiffness[j]).sqrt();
        tension.max(self.coupling_growth_rate[j])
    }

    /// Rest length of rod `j` from the base up to `sigma`, with its growth.
    pub fn grown(&self, j: usize, sigma: f64) -> f64 {
        self.lengths[j] * self.scenario.rods[j].rest_stretch.integral(sigma)
    }

    /// Coupling of gap `g`: force per unit displacement and unit of sigma.
    #[inline]
    pub fn coupling(&self, g: usize) -> DVec3 {
        self.load_lambda * self.coupling[g]
    }

    pub fn coupled(&self, g: usize) -> bool {
        self.coupling[g] != DVec3::ZERO || self.tissue.is_some()
    }

    /// Whether tissue ties neighboring rods.
    pub fn has_tissue(&self) -> bool {
        self.tissue.is_some()
    }

    /// Whether stresses of the tissue are unknowns, by which all rods depend on each other.
    pub fn has_tissue_stresses(&self) -> bool {
        (self.tissue.as_ref()).is_some_and(TissueEnergy::has_stresses)
    }

    /// How many conditions at the tip the rigid tissue satisfies already: where tips are held in one point
    /// gaps are closed.
    pub fn redundant_tip_conditions(&self) -> usize {
        match (&self.tissue, self.tip_constraint()) {
            (Some(tissue), constraint) if constraint != TipConstraint::Free => {
                tissue.rigid_strain_count()
            }
            _ => 0,
        }
    }

    /// Solves for the tissue of the leaf in the flat state `y` at a place; without tissue `state` remains
    /// empty.
    pub fn solve_tissue(&self, place: RodPlace, y: &[f64], state: &mut TissueState) {
        if let Some(tissue) = &self.tissue {
            let section = |j| self.section(j, place, &RodState::from_flat_state(y, j));
            let sections = (0..self.rods()).map(section);
            state.solve(tissue, place, self.load_lambda, sections);
        }
    }

    /// The law of rod `j` at a place, in this state.
    fn section(&self, j: usize, place: RodPlace, rod: &RodState) -> RodSection {
        let (law, length) = (self.material(j, place), self.lengths[j]);
        let directors = rod.q.conjugate();
        RodSection {
            pose: rod.pose(),
            resultants: Wrench {
                force: directors * rod.n,
                moment: directors * rod.m,
            },
            unstrained: FrameRates {
                position: length * law.rest_strain,
                rotation: length * law.rest_curvature,
            },
            compliance: FrameRates {
                position: length * law.compliance,
                rotation: length * law.flexibility,
            },
        }
    }

    /// Where an integration step from `from` towards `to` must end: at a kink before it, or there. A
    /// station beside a kink is this kink: a load there would be passed at both.
    pub fn step_end(&self, from: f64, to: f64) -> f64 {
        let next = self
            .kinks
            .partition_point(|kink| *kink <= from + FRACTION_TOLERANCE);
        let before = self
            .kinks
            .get(next)
            .filter(|kink| **kink < to - FRACTION_TOLERANCE);
        before.copied().unwrap_or(to)
    }

    /// Whether a profile may jump at a fraction of the length.
    pub fn has_kink_at(&self, sigma: f64) -> bool {
        let mut kinks = self.kinks.iter();
        kinks.any(|kink| (kink - sigma).abs() < FRACTION_TOLERANCE)
    }

    /// The veins that can turn without resistance, if the leaf has its own shape at rest.
    pub fn turnings(&self) -> &[ZeroEnergyRotation] {
        match self.load_lambda == 1.0 && self.softening_lambda == 1.0 {
            true => &self.turnings,
            false => &[],
        }
    }

    fn material(&self, j: usize, place: RodPlace) -> SectionLaw {
        let rod = &self.scenario.rods[j];
        let at = |p: &[Profile; 3]| DVec3::new(p[0].at(place), p[1].at(place), p[2].at(place));
        let mut stiffness = at(&rod.couple_stiffness);
        if self.softening_lambda < 1.0 {
            let stiffest = stiffness.max_element();
            stiffness = stiffest * (stiffness / stiffest).powf(self.softening_lambda);
        }
        let (arc, part) = (self.arcs.get(j), self.load_lambda);
        let stretch = rod.rest_stretch.at(place);
        // The scenario's own law without rounding errors.
        let (rest_strain, rest_curvature) = match part == 1.0 {
            true => (
                DVec3::X * stretch,
                at(&rod.rest_curvature) * self.length_unit,
            ),
            false => {
                let own = at(&rod.rest_curvature);
                let first = arc.map_or(stretch, |arc| arc.stretch);
                let bend = arc.map_or(self.length_unit * own, |arc| arc.bend * DVec3::Z);
                (
                    DVec3::X * (part * stretch + (1.0 - part) * first),
                    own * (part * self.length_unit) + bend * (1.0 - part),
                )
            }
        };
        SectionLaw {
            compliance: self.force_unit * at(&rod.force_stiffness).recip(),
            flexibility: self.force_unit * self.length_unit * self.length_unit * stiffness.recip(),
            rest_strain,
            rest_curvature,
        }
    }

    /// All rods at `sigma` in the units of the scenario, from a flat state; strains that jump there are
    /// those towards the base.
    pub fn node_states(&self, sigma: f64, y: &[f64]) -> Vec<NodeState> {
        let place = RodPlace::from(sigma);
        let mut tissue = TissueState::default();
        self.solve_tissue(place, y, &mut tissue);
        let node = |j: usize| {
            let rod = RodState::from_flat_state(y, j);
            let section = self.section(j, place, &rod);
            let all = tissue
                .rods
                .get(j)
                .map_or_else(Wrench::default, |rod| rod.carried);
            let by_constraints = tissue.carried_by_constraints(j);
            let rates = section.rates(&all);
            let length = self.lengths[j];
            let Wrench { force, moment } = section.resultants;
            NodeState {
                position: rod.r * self.length_unit,
                rotation: rod.q,
                v: rates.position / length,
                u: rates.rotation / (length * self.length_unit),
                n: (force - by_constraints.force) * self.force_unit,
                m: (moment - by_constraints.moment) * (self.force_unit * self.length_unit),
            }
        };
        (0..self.rods()).map(node).collect()
    }

    /// Slopes of the flat state `y` at a place; `tissue` becomes that of the leaf there.
    pub fn write_slopes(
        &self,
        place: RodPlace,
        y: &[f64],
        tissue: &mut TissueState,
        slopes: &mut [f64],
    ) {
        self.solve_tissue(place, y, tissue);
        let mut energy = tissue.energy;
        let mut pull = DVec3::ZERO;
        for j in 0..self.rods() {
            let (rod, length) = (RodState::from_flat_state(y, j), self.lengths[j]);
            let (section, carried, by_tissue) = match tissue.rods.get(j) {
                Some(rod) => (rod.section, rod.carried, rod.by_pose),
                None => {
                    let none = Wrench::default();
                    (self.section(j, place, &rod), none, none)
                }
            };
            let rates = section.rates(&carried);
            let (tangent, bend) = (rod.q * rates.position, rod.q * rates.rotation);
            let n = section.resultants.force - carried.force;
            let m = section.resultants.moment - carried.moment;
            energy += 0.5
                * (n.dot(section.compliance.position * n) + m.dot(section.compliance.rotation * m));
            let gravity = self.gravity + self.own_load(j, place);
            energy -= self.load_lambda * length * gravity.dot(rod.r);
            let mut load = self.load_lambda * length * gravity - pull;
            pull = DVec3::ZERO;
            if j + 1 < self.rods() {
                let gap = DVec3::from_slice(&y[STATE_SIZE * (j + 1)..]) - rod.r;
                pull = self.coupling(j) * gap;
                energy += 0.5 * gap.dot(pull);
                load += pull;
            }
            if let Some(natural) = &self.foundation {
                let stretch = natural.vein_pose(j, place.sigma).position / self.length_unit - rod.r;
                let held = self.foundation_stiffness(j, place) * stretch;
                energy += 0.5 * stretch.dot(held);
                load += held;
            }
            let mut couple = by_tissue.moment;
            if let Some(followers) = &self.followers {
                let all = followers.along(j, length, place, rod.q, tangent);
                load += self.load_lambda * all.force;
                couple -= self.load_lambda * all.moment;
            }
            let q = DQuat::from_xyzw(0.5 * bend.x, 0.5 * bend.y, 0.5 * bend.z, 0.0) * rod.q;
            RodState {
                r: tangent,
                q,
                n: by_tissue.force - load,
                m: rod.n.cross(tangent) + couple,
            }
            .write_flat_state(slopes, j);
        }
        slopes[STATE_SIZE * self.rods()] = energy;
    }

    /// Derivatives of the slopes of rod `j` with respect to its own state, what the `tissue` carries being
    /// given: with the frame turned by theta, R^T n changes by R^T (dn - theta x n).
    pub fn derivatives(
        &self,
        j: usize,
        place: RodPlace,
        y: &[f64],
        tissue: &TissueState,
    ) -> SlopeDerivatives {
        let rod = RodState::from_flat_state(y, j);
        let (section, rates) = match tissue.rods.get(j) {
            Some(rod) => (rod.section, rod.rates()),
            None => {
                let section = self.section(j, place, &rod);
                (section, section.rates(&Wrench::default()))
            }
        };
        let frame = DMat3::from_quat(rod.q);
        let spatial = |c: DVec3| frame * DMat3::from_diagonal(c) * frame.transpose();
        let r_n = spatial(section.compliance.position);
        let theta_m = spatial(section.compliance.rotation);
        let tangent = cross_matrix(frame * rates.position);
        let r_theta = r_n * cross_matrix(rod.n) - tangent;
        SlopeDerivatives {
            r_theta,
            r_n,
            theta_theta: theta_m * cross_matrix(rod.m),
            theta_m,
            n_r: self.foundation_stiffness(j, place),
            m_theta: cross_matrix(rod.n) * r_theta,
            m_n: cross_matrix(rod.n) * r_n - tangent,
            by_loads: self.followers.as_ref().map(|followers| {
                let slope = (frame * rates.position, [r_theta, r_n]);
                followers.derivatives(j, self.lengths[j], place, rod.q, slope)
            }),
        }
    }

    /// Residuals of conditions (b), (d) and (e) in the state at the tip: six
    /// numbers per rod. Joined tips: the distance of tip j from tip 0, for rod 0
    /// the force; free tips: the force; held tips: the distance from
    /// their given position. Then the moment, or for a clamped tip the rotation.
    pub fn tip_conditions(&self, y: &[f64]) -> Vec<f64> {
        let rods: Vec<RodState> = (0..self.rods())
            .map(|j| RodState::from_flat_state(y, j))
            .collect();
        let followers = self.tip_followers(y);
        let forces = rods
            .iter()
            .enumerate()
            .map(|(j, rod)| rod.n - self.tip_point_load(j, rod.q, &followers).force);
        let force: DVec3 = forces.sum();
        (rods.iter().enumerate())
            .flat_map(|(j, rod)| {
                let first = match (self.tip_constraint(), j) {
                    (TipConstraint::Joint, 0) => force - self.load_lambda * self.tip_force,
                    (TipConstraint::Joint, _) => rod.r - rods[0].r,
                    (TipConstraint::Free, _) => {
                        rod.n
                            - self.load_lambda * self.tip_force
                            - self.tip_point_load(j, rod.q, &followers).force
                    }
                    (TipConstraint::Pinned | TipConstraint::Clamped, _) => {
                        rod.r - self.held_tips[j].position
                    }
                };
                let second = match self.tip_constraint() {
                    TipConstraint::Clamped => {
                        rotation_difference(rod.q, self.held_tips[j].rotation)
                    }
                    _ => {
                        rod.m
                            - self.load_lambda * self.tip_moment
                            - self.tip_point_load(j, rod.q, &followers).moment
                    }
                };
                [first.to_array(), second.to_array()].concat()
            })
            .collect()
    }

    pub fn tip_constraint(&self) -> TipConstraint {
        match &self.scenario.held_tip {
            Some(held) if held.clamps.is_some() => TipConstraint::Clamped,
            Some(_) => TipConstraint::Pinned,
            None if self.scenario.joined => TipConstraint::Joint,
            None => TipConstraint::Free,
        }
    }

    /// Potential of the dead tip force at the tip.
    pub fn tip_potential(&self, y: &[f64]) -> f64 {
        let tips = if self.scenario.joined { 1 } else { self.rods() };
        let work: f64 = (0..tips)
            .map(|j| self.tip_force.dot(RodState::from_flat_state(y, j).r))
            .sum();
        let points = self
            .point_loads_at(1.0)
            .map(|load| load.energy(&RodState::from_flat_state(y, load.rod)));
        -self.load_lambda * work + points.sum::<f64>()
    }
}

impl BoundaryValueProblem<'_> {
    /// The first of the six components of the perturbation of rod `j` that are free at its base: of the
    /// force and the moment at a clamp, of the rotation and the force at a hinge.
    pub fn first_free_component(&self, j: usize) -> usize {
        match self.base_turns(j) {
            true => 3,
            false => 6,
        }
    }

    /// Whether the base of rod `j` turns, freely or against a spring.
    pub fn base_turns(&self, j: usize) -> bool {
        self.scenario.base_held[j] != BaseSupport::Clamped
    }

    /// Whether the base of rod `j` turns freely on a hinge.
    pub fn base_turns_freely(&self, j: usize) -> bool {
        self.scenario.base_held[j] == BaseSupport::Pinned
    }

    /// The stiffness of the spring at the base of rod `j`; zero without one.
    fn base_turn_stiffness(&self, j: usize) -> f64 {
        self.scenario.base_spring_stiffness(j) / self.scenario.scale().moment()
    }

    /// The moment of the rod at a base with the rotation `q`: none at a hinge, that of its spring at an
    /// elastic one.
    fn base_moment(&self, j: usize, q: DQuat) -> DVec3 {
        self.base_turn_stiffness(j) * self.base_turn(j, q)
    }

    /// The energy of the springs at the bases in the state there.
    pub fn base_potential(&self, y: &[f64]) -> f64 {
        let energy = |j: usize| {
            let turn = self.base_turn(j, RodState::from_flat_state(y, j).q);
            0.5 * self.base_turn_stiffness(j) * turn.length_squared()
        };
        (0..self.rods()).map(energy).sum()
    }

    /// The rotation vector from the natural direction of the base of rod `j` to `q`.
    fn base_turn(&self, j: usize, q: DQuat) -> DVec3 {
        rotation::log(q * self.scenario.base(j).1.conjugate())
    }

    /// The derivative of the [moment at the base](Self::constrained_base) of rod `j` by the rotation of that.
    fn base_moment_rate(&self, j: usize, q: DQuat) -> DMat3 {
        self.base_turn_stiffness(j) * rotation::log_rate(self.base_turn(j, q))
    }

    /// Whether the base of rod `j` turns on a hinge that holds its spin.
    pub fn holds_base_spin(&self, j: usize) -> bool {
        self.scenario.holds_base_spin(j)
    }

    /// The joint at the base of rod `j`, if a hinge holds its spin.
    fn base_joint(&self, j: usize) -> Option<HeldSpin> {
        let natural = self.scenario.base(j).1;
        self.holds_base_spin(j).then_some(HeldSpin { natural })
    }

    /// How the rotation and the moment of the base of rod `j` change with the three numbers that are free there beside
    /// the force: with the rotation of a base that turns, by which the moment of its spring changes, too. Where a hinge
    /// holds the spin, the numbers are the rotation across the axis a of the hinge and the change of the moment along
    /// it, in the softest stiffness: with P = 1 - a a^T the rotation is P, and the moment mu a changes by
    /// a a^T + mu a' P, a' being the derivative of a.
    pub fn free_base_changes(&self, j: usize, base: &RodState) -> FreeBaseChanges {
        match self.base_joint(j) {
            None => FreeBaseChanges {
                rotation: DMat3::IDENTITY,
                moment: self.base_moment_rate(j, base.q),
            },
            Some(joint) => {
                let axis = joint.axis(base.q);
                let along = outer(axis, axis);
                let across = DMat3::IDENTITY - along;
                let turned = base.m.dot(axis) * joint.axis_rate(base.q) * across;
                FreeBaseChanges {
                    rotation: across,
                    moment: self.softest_couple_stiffness[j] * along + turned,
                }
            }
        }
    }

    /// The state at the base nearest to a given one: a hinge carries no moment but, if it holds the spin, that about its
    /// axis, or that of its spring.
    pub fn constrained_base(&self, j: usize, rod: &RodState) -> RodState {
        let clamped = self.base(j, rod.n, rod.m);
        if let Some(joint) = self.base_joint(j) {
            let q = joint.settled(rod.q);
            let axis = joint.axis(q);
            let m = rod.m.dot(axis) * axis;
            return RodState { q, m, ..clamped };
        }
        match self.base_turns(j) {
            true => RodState {
                q: rod.q,
                m: self.base_moment(j, rod.q),
                ..clamped
            },
            false => clamped,
        }
    }

    /// Puts the bases of all rods in a flat state where the conditions there hold.
    pub fn constrain_bases(&self, y: &mut [f64]) {
        for j in 0..self.rods() {
            let rod = RodState::from_flat_state(y, j);
            self.constrained_base(j, &rod).write_flat_state(y, j);
        }
    }

    /// The state at the base for given forces and moments: conditions (a) and (c).
    pub fn base(&self, j: usize, n: DVec3, m: DVec3) -> RodState {
        let (position, q) = self.scenario.base(j);
        RodState {
            r: position / self.length_unit,
            q,
            n,
            m,
        }
    }

    /// A flat state at the base without stress.
    pub fn unstressed_base_state(&self) -> Vec<f64> {
        let mut y = vec![0.0; self.state_size()];
        for j in 0..self.rods() {
            self.base(j, DVec3::ZERO, DVec3::ZERO)
                .write_flat_state(&mut y, j);
        }
        y
    }
}

impl BoundaryValueProblem<'_> {
    /// Stiffness of the foundation of rod `j` at a place: force per displacement and unit of sigma.
    fn foundation_stiffness(&self, j: usize, place: RodPlace) -> DVec3 {
        let Some(foundation) = &self.scenario.foundation else {
            return DVec3::ZERO;
        };
        let along = DVec3::from_array(foundation[j].each_ref().map(|of| of.at(place)));
        along * (self.lengths[j] * self.length_unit.powi(2) / self.force_unit)
    }

    /// Load of rod `j` alone, per length: its weight besides the common one, and what is
    /// distributed along it.
    fn own_load(&self, j: usize, place: RodPlace) -> DVec3 {
        if !self.own_loads {
            return DVec3::ZERO;
        }
        let s = self.scenario;
        let weight = DVec3::from_array(s.weight(j).at(place)) - DVec3::from_array(s.gravity);
        let along = s.distributed.as_ref().map_or(DVec3::ZERO, |loads| {
            DVec3::from_array(loads[j].each_ref().map(|load| load.at(place)))
        });
        (weight + along) * (self.length_unit / self.force_unit)
    }

    /// Changes a state by the loads on points at `sigma`, which the way to the tip passes there; false
    /// if there are none.
    pub fn apply_point_loads(&self, sigma: f64, y: &mut [f64]) -> bool {
        let mut any = false;
        for (j, load) in self.follower_points_at(sigma, y) {
            let mut rod = RodState::from_flat_state(y, j);
            rod.n -= load.force;
            rod.m -= load.moment;
            rod.write_flat_state(y, j);
            any = true;
        }
        for load in self.point_loads_at(sigma) {
            let j = load.rod;
            let mut rod = RodState::from_flat_state(y, j);
            rod.n -= load.force;
            rod.m -= load.moment_on(rod.q);
            y[STATE_SIZE * self.rods()] += load.energy(&rod);
            rod.write_flat_state(y, j);
            any = true;
        }
        any
    }

    /// The derivatives of the jumps by loads on points at `sigma` in this state, each with its rod, of those
    /// that depend on the rotation of the section.
    pub fn jump_derivatives_at(&self, sigma: f64, y: &[f64]) -> Vec<(usize, JumpDerivatives)> {
        let followers = self.follower_points_at(sigma, y);
        let mut jumps: Vec<_> = followers
            .iter()
            .map(|(j, load)| (*j, JumpDerivatives::of_follower(load)))
            .collect();
        if self.levers {
            let off_axis = self
                .point_loads_at(sigma)
                .filter(DeadPointLoad::is_off_axis);
            jumps.extend(off_axis.map(|load| {
                let arm = RodState::from_flat_state(y, load.rod).q * load.arm;
                (load.rod, JumpDerivatives::of_lever(arm, load.force))
            }));
        }
        jumps
    }

    /// The sums of these derivatives at the tips, rod by rod; empty without any.
    pub fn tip_jump_derivatives(&self, y: &[f64]) -> Vec<JumpDerivatives> {
        if self.followers.is_none() && !self.levers {
            return Vec::new();
        }
        let mut all = vec![JumpDerivatives::ZERO; self.rods()];
        for (j, jump) in self.jump_derivatives_at(1.0, y) {
            all[j] += jump;
        }
        all
    }

    /// What loads on points at `sigma` that turn with the section exert in this state, each with its rod.
    pub fn follower_points_at(&self, sigma: f64, y: &[f64]) -> Vec<(usize, Wrench)> {
        let Some(followers) = &self.followers else {
            return Vec::new();
        };
        let points = self.scenario.points.iter().filter(|it| it.follows);
        let here = points.filter(|point| (point.at - sigma).abs() < FRACTION_TOLERANCE);
        let load = |point: &PointLoad| {
            let rod = RodState::from_flat_state(y, point.vein);
            (
                point.vein,
                followers.on_point(point, &rod, self.load_lambda),
            )
        };
        here.map(load).collect()
    }

    /// What loads that turn with the section exert on the tip of every rod in this state; empty without any.
    pub fn tip_followers(&self, y: &[f64]) -> Vec<Wrench> {
        if self.followers.is_none() {
            return Vec::new();
        }
        let mut all = vec![Wrench::default(); self.rods()];
        for (j, load) in self.follower_points_at(1.0, y) {
            all[j].force += load.force;
            all[j].moment += load.moment;
        }
        all
    }

    /// The dead loads on points at `sigma`, each with its rod.
    fn point_loads_at(&self, sigma: f64) -> impl Iterator<Item = DeadPointLoad> {
        let points = self
            .scenario
            .points
            .iter()
            .filter(move |point| (point.at - sigma).abs() < FRACTION_TOLERANCE);
        let unit = self.load_lambda / self.force_unit;
        let moment_unit = unit / self.length_unit;
        points.map(move |point| {
            let dead_moment = match point.follows {
                true => DVec3::ZERO,
                false => moment_unit * DVec3::from_array(point.moment),
            };
            DeadPointLoad {
                rod: point.vein,
                force: unit * DVec3::from_array(self.scenario.force_on(point)),
                moment: dead_moment,
                arm: point.arm() / self.length_unit,
            }
        })
    }

    /// What loads on points exert on the tip of rod `j` with the rotation `q`, those that turn with it in this
    /// state.
    fn tip_point_load(&self, j: usize, q: DQuat, followers: &[Wrench]) -> Wrench {
        let here = self.point_loads_at(1.0).filter(|load| load.rod == j);
        let own = followers.get(j).copied().unwrap_or_default();
        here.fold(own, |sum, load| Wrench {
            force: sum.force + load.force,
            moment: sum.moment + load.moment_on(q),
        })
    }
}

/// A dead load on a point of a rod.
struct DeadPointLoad {
    rod: usize,
    force: DVec3,
    moment: DVec3,
    /// Where the force acts off the axis, along the directors.
    arm: DVec3,
}

impl DeadPointLoad {
    /// Whether the force acts off the axis.
    fn is_off_axis(&self) -> bool {
        self.arm != DVec3::ZERO && self.force != DVec3::ZERO
    }

    /// The moment on a section with the rotation `q`.
    fn moment_on(&self, q: DQuat) -> DVec3 {
        match self.is_off_axis() {
            true => self.moment + (q * self.arm).cross(self.force),
            false => self.moment,
        }
    }

    /// The potential energy of the force on a rod in this state.
    fn energy(&self, rod: &RodState) -> f64 {
        match self.is_off_axis() {
            true => -self.force.dot(rod.r + rod.q * self.arm),
            false => -self.force.dot(rod.r),
        }
    }
}

/// Lower bound on the ratio of chord to arc length, which vanishes for arcs that turn by
/// nearly a full circle.
const SHORTEST_CHORD: f64 = 0.05;

/// Rest shape of one rod of the leaf of arcs: stretch v1, and bend about d3.
#[derive(Clone, Copy, Debug)]
struct RestArc {
    stretch: f64,
    bend: f64,
}

/// The leaf of arcs with a common tip: one arc per rod, for these dimensionless lengths without
/// growth; none for free rods, which keep their own rest shapes.
fn rest_arcs(scenario: &Scenario, lengths: &[f64]) -> Vec<RestArc> {
    if !scenario.joined || lengths.len() == 1 {
        return Vec::new();
    }
    let angles = scenario.rods.iter().map(|rod| rod.angle.sin_cos());
    let (sin, cos) = angles.fold((0.0, 0.0), |(s, c), (sin, cos)| (s + sin, c + cos));
    let mean = if sin.hypot(cos) > 1e-9 * lengths.len() as f64 {
        sin.atan2(cos)
    } else {
        scenario.rods[0].angle
    };
    let openings: Vec<f64> = (scenario.rods.iter())
        .map(|rod| (rod.angle - mean + PI).rem_euclid(2.0 * PI) - PI)
        .collect();
    // Chord over length of an arc that turns by twice the opening.
    let chord = |opening: f64| match opening.abs() {
        small if small < 1e-8 => 1.0,
        _ => (opening.sin() / opening).max(SHORTEST_CHORD),
    };
    let grown = (scenario.rods.iter().zip(lengths))
        .map(|(rod, length)| length * rod.rest_stretch.integral(1.0));
    let chords = (openings.iter().zip(grown)).map(|(&opening, length)| length * chord(opening));
    let tip = chords.sum::<f64>() / lengths.len() as f64;
    (openings.iter().zip(lengths))
        .map(|(&opening, length)| RestArc {
            stretch: tip / (length * chord(opening)),
            bend: -2.0 * opening / length,
        })
        .collect()
}
