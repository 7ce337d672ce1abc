//! The leaf of a scenario in dimensionless form, and on a grid.
//!
//! [`Leaf`] has the rods, loads, supports and couplings in units of length and stiffness, as functions
//! of sigma, the fraction of a rod's length. [`DiscreteLeaf`] has them at the nodes and segments of a
//! [`Grid`], and [`State`] the positions, rotations and forces there. [`System`] holds Newton's
//! equations of a state, which are solved rod by rod with conjugate gradients (`solve`) or as a whole
//! (`direct`). `derivative` is how a state responds to a number of the scenario; `rod_ode` integrates
//! the differential equations of the rods, which the grid approximates.

mod assembly;
mod block_tridiagonal;
mod buckling;
mod derivative;
mod direct;
mod discrete;
mod elastic_supports;
mod followers;
mod held_spin;
mod law;
mod levers;
mod loads;
mod mirror;
mod nodal_loads;
#[cfg(test)]
mod not_a_number;
mod rod_ode;
mod solve;
mod springs;
mod state;
mod supports;
mod system;
mod tissue;

pub use crate::leaf::assembly::SegmentTangent;
pub use crate::leaf::buckling::{BucklingMode, BucklingMotion};
pub use crate::leaf::derivative::parameter::{
    DenseParameterForces, LeafParameterDerivative, LinearResponse, ParameterForces, Weighted,
    hessian_at_constant_force,
};
pub use crate::leaf::direct::pattern::DirectError;
pub use crate::leaf::direct::{BorderedSolution, DirectSolver, MatrixFactors};
pub use crate::leaf::discrete::{DiscreteLeaf, Grid, NodeLoad};
pub use crate::leaf::mirror::{
    are_mirror_symmetric, half_state, is_mirrored, whole_leaf_changes, whole_leaf_fields,
    whole_state,
};
pub use crate::leaf::nodal_loads::{FollowerLoad, Lever, NodalMoment};
pub use crate::leaf::rod_ode::{FieldChange, RodFields, RodIntegrator, StationFields};
pub use crate::leaf::solve::{DefiniteFactors, LinearSolveOutcome};
pub use crate::leaf::springs::SpringEnd;
use crate::leaf::state::BaseJoint;
pub use crate::leaf::state::{
    Increment, NodalField, State, add_to_increment, displacement_part, dot, rotation_part,
};
pub use crate::leaf::supports::NodeFreedom;
pub use crate::leaf::system::{
    AssemblyTotals, DiagonalBlocks, EquationWorkspace, MassLoad, System,
};
pub use crate::leaf::tissue::cells::{CellStiffness, ContractionResultants, TissueForces};
pub use crate::leaf::tissue::rigid::ForceCarriers;
pub use crate::leaf::tissue::strips::HalfTurn;
use crate::rod::Section;
use crate::rotation::{self, HeldSpin, Pose};
pub use crate::scenario::Scale;
use crate::scenario::{
    BaseSupport, Clamp, Dynamics, Profile, Rod, RodPlace, Scenario, Tissue, ZeroEnergyRotation,
    distinct_places, longest,
};
use glam::{BVec3, DQuat, DVec3};
use std::sync::Arc;

/// Limits of the stiffness in stretch and shear with which segment forces are condensed out. A
/// larger stiffness loses the soft modes to rounding, a smaller one costs iterations.
const CONDENSING_LIMITS: CondensingLimits = CondensingLimits {
    of_softest: 1e7,
    of_mean: 1e5,
    rounding_with_rigid_tissue: 1e-5,
};

struct CondensingLimits {
    /// Largest stiffness, in units of A/L^2 with the softest A of the leaf.
    of_softest: f64,
    /// Largest stiffness of a leaf with a very soft part, in units of the mean A/L^2.
    of_mean: f64,
    /// Error of an eigenvalue by rounding (A/(rho L^4); the lowest of a clamped rod is 12) up to which any
    /// stiffness is allowed where tissue is rigid: its own forces are condensed out with a larger one, and
    /// it determines the strains of the veins, whose law would be completed with a dozen solutions.
    rounding_with_rigid_tissue: f64,
}

/// A leaf with all quantities dimensionless, before discretization.
#[derive(Clone, Debug)]
pub struct Leaf {
    scenario: Arc<Scenario>,
    /// Whether this is half of a mirror-symmetric leaf.
    mirrored: bool,
    /// Units of length, stiffness and time.
    pub scale: Scale,
    /// Loads of the leaf at rest.
    pub loads: Loads,
    /// Holder of the tips, if there is one.
    pub tip_support: Option<TipSupport>,
    /// Whether some base is not clamped.
    hinged: bool,
    /// Turns of veins without resistance.
    zero_energy_rotations: Vec<ZeroEnergyRotation>,
    /// Fractions of the length where some profile has a kink, ascending.
    kinks: Vec<f64>,
    /// The smallest couple stiffness, mid-rod.
    softest_couple_stiffness: f64,
    /// The error of an eigenvalue by rounding up to which forces are condensed out with any stiffness.
    allowed_rounding: f64,
}

/// The holder of the tips.
#[derive(Clone, Debug)]
pub struct TipSupport {
    /// Where all tips are held.
    pub position: DVec3,
    /// The clamps, one per rod, if rotations are held too.
    pub clamps: Option<Vec<Clamp>>,
}

impl TipSupport {
    /// The rotation in which the tip of rod `j` is held.
    pub fn rotation(&self, j: usize) -> Option<DQuat> {
        Some(self.clamps.as_ref()?[j].rotation())
    }
}

/// A node that a grip holds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GrippedNode {
    /// Number of the grip.
    pub grip: usize,
    /// Number of the rod.
    pub rod: usize,
    /// Number of the node on the rod.
    pub node: usize,
    /// Position in which the node is held.
    pub position: DVec3,
    /// The lab axes along which the position is held rigidly.
    pub held_axes: BVec3,
    /// Rotation in which the node is held rigidly, if it is.
    pub rotation: Option<DQuat>,
}

/// Stiffness of tissue in a gap, per unit of sigma.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct TissueStiffness {
    /// k: force per displacement along the veins, across, and normal to the leaf.
    pub displacement: DVec3,
    /// c_1: moment per radian of a fold along the veins.
    pub fold: f64,
    /// Length by which the gap narrows per stretch of its veins.
    pub contraction: f64,
}

/// Dead loads that all rods share, and the factors of dead loads on single rods.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Loads {
    /// Gravity per unit length.
    pub gravity: DVec3,
    /// Force on the joint tip, or on every free one.
    pub tip_force: DVec3,
    /// Moment on the tip of a single rod.
    pub tip_moment: DVec3,
    /// Factor of the loads of single veins: zero without any.
    pub rod_load_factor: f64,
    /// Factor of the dead moments on points of a single rod: zero without any.
    pub dead_moment_factor: f64,
    /// Factor of the loads that turn with the sections, and of the moments along veins: zero without any.
    pub follower_factor: f64,
}

impl std::ops::Sub for Loads {
    type Output = Loads;

    fn sub(self, other: Loads) -> Loads {
        Loads {
            gravity: self.gravity - other.gravity,
            tip_force: self.tip_force - other.tip_force,
            tip_moment: self.tip_moment - other.tip_moment,
            rod_load_factor: self.rod_load_factor - other.rod_load_factor,
            dead_moment_factor: self.dead_moment_factor - other.dead_moment_factor,
            follower_factor: self.follower_factor - other.follower_factor,
        }
    }
}

impl std::ops::Mul<f64> for Loads {
    type Output = Loads;

    fn mul(self, factor: f64) -> Loads {
        Loads {
            gravity: self.gravity * factor,
            tip_force: self.tip_force * factor,
            tip_moment: self.tip_moment * factor,
            rod_load_factor: self.rod_load_factor * factor,
            dead_moment_factor: self.dead_moment_factor * factor,
            follower_factor: self.follower_factor * factor,
        }
    }
}

/// The layer at a clamped base of a thin plate, which can neither warp nor contract there: rigid tissue and
/// such that contracts have it. It is as long as the base is wide, with parts as thin as a gap.
struct ClampLayer {
    /// First part of the layer, in units of the width of the base: a larger one is resolved only on
    /// finer grids.
    first_part: f64,
    /// Ratio of a part to the one before.
    growth: f64,
    /// Parts up to this length, a fraction of the leaf's, are graded; longer ones are as grids have them.
    largest_part: f64,
    /// Least width of the base, a fraction of the length: a narrower one is resolved by no grid, and
    /// moves nothing.
    least_width: f64,
}

const CLAMP_LAYER: ClampLayer = ClampLayer {
    first_part: 1.0 / 3.0,
    growth: 2.0,
    largest_part: 1.0 / 8.0,
    least_width: 1e-3,
};

/// Fractions of the length between which grids have segments of one length, graded towards a clamped
/// base.
fn clamp_layer_edges(scenario: &Scenario) -> Vec<f64> {
    let mut tissue = scenario.tissue.iter().flatten();
    let has_layer = tissue.any(Tissue::has_unknown_forces);
    let rods = &scenario.rods;
    let length = longest(rods);
    let apart = rods
        .windows(2)
        .map(|pair| pair[0].base_position().distance(pair[1].base_position()));
    let width = apart.sum::<f64>() / length;
    let mut edges = Vec::new();
    let clamped = scenario.base_held.contains(&BaseSupport::Clamped);
    if has_layer && clamped && width > CLAMP_LAYER.least_width {
        let mut part = CLAMP_LAYER.first_part * width;
        let mut edge = 0.0;
        while part < CLAMP_LAYER.largest_part {
            edge += part;
            edges.push(edge);
            part *= CLAMP_LAYER.growth;
        }
    }
    edges
}

impl Leaf {
    /// Scales a checked scenario.
    pub fn new(scenario: &Scenario) -> Self {
        Leaf::with_scale(Arc::new(scenario.clone()), scenario.scale())
    }

    /// A scenario in given units, so that leaves that differ in length or stiffness are
    /// comparable.
    pub fn with_scale(scenario: Arc<Scenario>, scale: Scale) -> Self {
        // The profiles of the masses matter for motions.
        let Dynamics {
            density,
            rotary_inertia,
            ..
        } = &scenario.dynamics;
        let masses = density.iter().chain(rotary_inertia.iter().flatten());
        let masses = masses.flat_map(Profile::kinks).copied();
        let layers = clamp_layer_edges(&scenario);
        let kinks = distinct_places(scenario.kinks().into_iter(), masses.chain(layers));
        let couple = scenario.rods.iter().flat_map(|rod| &rod.couple_stiffness);
        let softest = couple.fold(f64::INFINITY, |m, profile| m.min(profile.at(0.5)));
        let vector = |a: [f64; 3], unit: f64| DVec3::from_array(a) / unit;
        let mut leaf = Leaf {
            mirrored: false,
            scale,
            loads: Loads {
                gravity: vector(scenario.gravity, scale.force() / scale.length),
                tip_force: vector(scenario.tip_force, scale.force()),
                tip_moment: vector(scenario.tip_moment, scale.moment()),
                rod_load_factor: 0.0,
                dead_moment_factor: 0.0,
                follower_factor: 0.0,
            },
            tip_support: scenario.held_tip.as_ref().map(|held| TipSupport {
                position: vector(held.position, scale.length),
                clamps: held.clamps.clone(),
            }),
            hinged: !scenario.all_bases_clamped(),
            zero_energy_rotations: scenario.zero_energy_rotations(),
            kinks,
            softest_couple_stiffness: softest / scale.stiffness,
            allowed_rounding: match scenario.tissue.iter().flatten().any(Tissue::is_rigid) {
                true => CONDENSING_LIMITS.rounding_with_rigid_tissue,
                false => 0.0,
            },
            scenario,
        };
        leaf.loads.rod_load_factor = if leaf.scenario.has_own_loads() {
            1.0
        } else {
            0.0
        };
        if leaf.point_dead_moments().any(|it| it.moment != DVec3::ZERO) {
            leaf.loads.dead_moment_factor = 1.0;
        }
        if leaf.scenario().has_followers() {
            leaf.loads.follower_factor = 1.0;
        }
        leaf
    }

    /// The scenario from which the leaf was made.
    pub fn scenario(&self) -> &Scenario {
        &self.scenario
    }

    /// Whether all loads have a potential: a dead moment has none, nor has wind or a load that turns with
    /// the section. Without a potential an equilibrium is no minimum of an energy.
    pub fn has_potential(&self) -> bool {
        self.has_load_potential() && !self.in_wind()
    }

    /// Whether all loads but wind have a potential.
    pub fn has_load_potential(&self) -> bool {
        !self.loads.has_moments() && !self.loads.has_followers()
    }

    /// The scenario from which the leaf was made, shared.
    fn shared_scenario(&self) -> Arc<Scenario> {
        Arc::clone(&self.scenario)
    }

    /// Whether the leaf was made from this very scenario.
    fn is_from_scenario(&self, scenario: &Arc<Scenario>) -> bool {
        Arc::ptr_eq(&self.scenario, scenario)
    }

    /// Whether wind acts on it.
    pub fn in_wind(&self) -> bool {
        self.scenario.wind.is_some()
    }

    /// Whether a wind blows at the beginning: air that is at rest damps no small motion.
    pub fn in_moving_air(&self) -> bool {
        let wind = self.scenario.wind.as_ref();
        wind.is_some_and(|wind| wind.velocity.at(0.0) != [0.0; 3])
    }

    /// The leaf with its tips apart and without the coupling of its veins; each tip bears an equal
    /// part of the force on the joint one. Tissue, which has no force between veins in their rest
    /// shapes, still ties them.
    pub fn decoupled_leaf(&self) -> Leaf {
        let mut apart = self.clone();
        if self.joined() {
            apart.loads.tip_force /= self.scenario.rods.len() as f64;
        }
        let scenario = Arc::make_mut(&mut apart.scenario);
        scenario.joined = false;
        scenario.coupling.fill([0.0; 3]);
        apart
    }

    /// Number of rods: of the whole leaf, or of the half.
    pub fn rods(&self) -> usize {
        let rods = self.scenario.rods.len();
        rods.div_ceil(if self.mirrored { 2 } else { 1 })
    }

    /// Whether the rods of another leaf are the same in the same units.
    pub fn has_same_rods(&self, other: &Leaf) -> bool {
        (self.mirrored, self.scale) == (other.mirrored, other.scale)
            && self.scenario.rods == other.scenario.rods
    }

    /// Whether the rods of another leaf have the same lengths, bases and rest shapes, in the same units.
    fn has_same_rest_shapes(&self, other: &Leaf) -> bool {
        let [own, others] = [self, other].map(|leaf| &leaf.scenario().rods);
        (self.mirrored, self.scale) == (other.mirrored, other.scale)
            && self.has_tissue() == other.has_tissue()
            && own.len() == others.len()
            && own
                .iter()
                .zip(others)
                .all(|(a, b)| a.has_same_rest_shape(b))
    }

    /// Whether the tissue of another leaf with the same rods is the same, between nodes that are held alike.
    fn has_same_tissue(&self, other: &Leaf) -> bool {
        let [own, others] = [self, other].map(Leaf::scenario);
        own.tissue == others.tissue
            && (own.tissue_grown, own.joined) == (others.tissue_grown, others.joined)
            && (&own.base_held, own.base_spin) == (&others.base_held, others.base_spin)
            && own.grips == others.grips
            && self.tip_support.is_some() == other.tip_support.is_some()
    }

    /// Whether this is half of a leaf that is its own mirror image.
    pub fn is_mirror_half(&self) -> bool {
        self.mirrored
    }

    /// Fraction of rod `j` that belongs to this leaf: one half for the midrib of half a leaf.
    pub fn share(&self, j: usize) -> f64 {
        if self.is_halved_midrib(j) { 0.5 } else { 1.0 }
    }

    /// Whether rod `j` is the midrib of half a leaf.
    pub fn is_halved_midrib(&self, j: usize) -> bool {
        let count = self.scenario.rods.len();
        self.mirrored && count % 2 == 1 && 2 * j + 1 == count
    }

    /// Whether rod `j` of half a leaf is next to its own mirror image.
    pub fn borders_own_image(&self, j: usize) -> bool {
        self.mirrored && 2 * (j + 1) == self.scenario.rods.len()
    }

    /// Whether no load, rest curvature or support acts out of the plane z = 0.
    pub fn is_planar(&self) -> bool {
        let s = self.scenario();
        let curvatures = s.rods.iter().flat_map(|rod| &rod.rest_curvature[..2]);
        s.is_loaded_in_plane()
            && self.tip_support.is_none()
            && curvatures.into_iter().all(|of| of.max_abs() == 0.0)
    }

    /// Whether all tips share one point.
    pub fn joined(&self) -> bool {
        self.scenario.joined
    }

    /// Fractions of the length where some profile has a kink, ascending.
    pub fn kinks(&self) -> &[f64] {
        &self.kinks
    }

    /// Length of rod `j`.
    pub fn length(&self, j: usize) -> f64 {
        self.rod(j).length / self.scale.length
    }

    /// Rest length of rod `j` from the base up to `sigma`, including growth.
    pub fn grown_length(&self, j: usize, sigma: f64) -> f64 {
        self.length(j) * self.rod(j).rest_stretch.integral(sigma)
    }

    /// Where the base of rod `j` is held (paper, section 2.4 (a) and (c)).
    pub fn base_pose(&self, j: usize) -> Pose {
        let (rod, length) = (self.rod(j), self.scale.length);
        let rotation = match rod.elevation == 0.0 && rod.roll == 0.0 {
            true => rotation::exp(rod.angle * DVec3::Z),
            false => rod.base_rotation(),
        };
        Pose {
            position: rod.base_position() / length,
            rotation,
        }
    }

    /// Whether sections are the same all along each rod.
    pub fn has_uniform_sections(&self) -> bool {
        let constant = |profile: &Profile| matches!(profile, Profile::Constant(_));
        self.scenario
            .rods
            .iter()
            .flat_map(Rod::constitutive_profiles)
            .all(constant)
    }

    /// Section of rod `j` at a place, for a segment that is the fraction `width` of the rod.
    pub fn section(&self, j: usize, place: impl Into<RodPlace>, width: f64) -> Section {
        let (rod, place) = (self.rod(j), place.into());
        let at =
            |p: &[Profile; 3]| DVec3::from_array(Profile::values_of_three(p.each_ref(), place));
        let share = self.share(j);
        Section {
            ds: self.length(j) * width,
            couple_stiffness: share * at(&rod.couple_stiffness) / self.scale.stiffness,
            rest_curvature: at(&rod.rest_curvature) * self.scale.length,
            rest_strain: DVec3::X * rod.rest_stretch.at(place),
            compliance: (share * at(&rod.force_stiffness) / self.scale.force()).recip(),
            condensing: DVec3::ZERO,
        }
        .limit_condensing_stiffness(
            share
                * (CONDENSING_LIMITS.of_softest * self.softest_couple_stiffness)
                    .max(CONDENSING_LIMITS.of_mean)
                    .max(self.allowed_rounding / f64::EPSILON * width * width),
        )
    }

    /// Coupling of gap `g` between rods g and g + 1: force per unit
    /// displacement and unit of sigma.
    pub fn coupling(&self, g: usize) -> DVec3 {
        let gap_length = 0.5 * (self.length(g) + self.length(g + 1));
        DVec3::from_array(self.scenario.coupling[g]) * gap_length * self.scale.length.powi(2)
            / self.scale.force()
    }

    /// Whether there are supports that are moved to their places: a holder of the tips, or grips.
    pub fn has_placed_supports(&self) -> bool {
        self.tip_support.is_some() || !self.scenario.grips.is_empty()
    }

    /// The moment per radian of the spring at the base of rod `j`; zero without one.
    pub fn base_turn_stiffness(&self, j: usize) -> f64 {
        self.scenario.base_spring_stiffness(j) / self.scale.moment()
    }

    /// Whether springs hold the directions of some bases.
    pub fn has_base_springs(&self) -> bool {
        self.scenario.base_held.contains(&BaseSupport::Elastic)
    }

    /// Whether some base turns freely on a hinge.
    pub fn turns_freely(&self) -> bool {
        (0..self.rods()).any(|j| self.base_turns_freely(j))
    }

    /// Whether the base of rod `j` turns freely on a hinge, which may hold its spin.
    pub fn base_turns_freely(&self, j: usize) -> bool {
        self.scenario.base_held[j] == BaseSupport::Pinned
    }

    /// Whether the support of the base of rod `j` carries moments: all but a hinge on which it may spin.
    pub fn base_carries_moment(&self, j: usize) -> bool {
        !self.base_turns_freely(j) || self.holds_base_spin(j)
    }

    /// Whether the base of rod `j` stays in its place and turns, freely or against a spring.
    #[inline]
    pub fn base_turns(&self, j: usize) -> bool {
        self.hinged && self.scenario.base_held[j] != BaseSupport::Clamped
    }

    /// Whether some base turns. The bases of all rods then have equations, and what clamps hold of theirs
    /// is zero.
    #[inline]
    pub fn hinged(&self) -> bool {
        self.hinged
    }

    /// Whether all rods begin in the origin, in the plane z = 0.
    pub fn is_fan(&self) -> bool {
        self.scenario.is_fan()
    }

    /// Whether tissue ties the rods.
    pub fn has_tissue(&self) -> bool {
        self.scenario.tissue.is_some()
    }

    /// Whether the strains of the tissue in gap `g` depend on those of its veins.
    fn is_tissue_strained_by_veins(&self, g: usize) -> bool {
        let tissue = self.scenario.tissue.as_ref();
        tissue.is_some_and(|tissue| tissue[g].has_unknown_forces())
    }

    /// Stiffness of the tissue in gap `g` at `sigma`.
    pub fn tissue_stiffness(&self, g: usize, sigma: f64) -> TissueStiffness {
        let Some(tissue) = &self.scenario.tissue else {
            return TissueStiffness::default();
        };
        let gap_length = 0.5 * (self.length(g) + self.length(g + 1));
        let Tissue {
            stiffness: [along, across, normal],
            fold,
            contraction,
        } = &tissue[g];
        let [along, normal] = [along, normal].map(|of| of.at(sigma));
        // What follows from a blade for these three is computed once.
        let [across, fold, contraction] =
            Profile::values_of_three([across, fold, contraction], sigma);
        let k = DVec3::new(along, across, normal) * self.scale.length.powi(2);
        TissueStiffness {
            displacement: k * gap_length / self.scale.force(),
            fold: fold * gap_length / self.scale.force(),
            contraction: contraction / self.scale.length,
        }
    }

    fn rod(&self, j: usize) -> &Rod {
        &self.scenario.rods[j]
    }
}

impl Leaf {
    /// Whether the base of rod `j` turns on a hinge that holds its spin.
    pub fn holds_base_spin(&self, j: usize) -> bool {
        self.scenario().holds_base_spin(j)
    }

    /// Whether hinges hold the spin of some base.
    pub fn holds_spins(&self) -> bool {
        (0..self.rods()).any(|j| self.holds_base_spin(j))
    }

    /// The joint at the base of rod `j`, if its spin is held.
    pub fn base_joint(&self, j: usize) -> Option<HeldSpin> {
        self.holds_base_spin(j).then(|| HeldSpin {
            natural: self.base_pose(j).rotation,
        })
    }

    /// All bases whose spin is held.
    fn base_joints(&self) -> Vec<BaseJoint> {
        let joint = |rod: usize| {
            let spin = self.base_joint(rod)?;
            Some(BaseJoint { rod, spin })
        };
        (0..self.rods()).filter_map(joint).collect()
    }

    /// What a base of rod `j` with the rotation `q` exerts on its joint of this `moment` on it; nothing without one.
    pub fn joint_moment(&self, j: usize, q: DQuat, moment: DVec3) -> DVec3 {
        self.base_joint(j).map_or(DVec3::ZERO, |joint| {
            let axis = joint.axis(q);
            moment.dot(axis) * axis
        })
    }
}
