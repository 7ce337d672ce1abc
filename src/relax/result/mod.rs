//! The result of a relaxation in the units of the scenario: the shape, its accuracy, its stability with
//! the margin, and what follows from the outline and the material of a blade.

pub(super) mod forces;
pub(super) mod report;

use crate::newton::SolverCounts;
use crate::relax::accuracy::StrainEffects;
use crate::relax::log::Attempt;
use crate::relax::path::Path;
use crate::relax::remark::{
    CriticalTipForceRemark, EquilibriumDoubt, EquilibriumRemark, MarginRemark, VeinsRemark,
    serialize_remark,
};
use crate::relax::request::Method;
use crate::relax::result::forces::{BaseReaction, GripReaction, Reaction, Stresses};
use crate::relax::saddle::Saddle;
use crate::relax::small_motions::SmallMotions;
use crate::scenario::{Blade, Scenario};
use crate::shape::{RodShape, Undulation, serialize_tips};
use crate::{shape, words};
use glam::DVec3;
use serde::ser::SerializeMap;
use serde::{Serialize, Serializer};
use std::fmt;

words! {
    /// How a run ended.
    pub enum Outcome {
        /// At rest in a stable equilibrium, within the tolerance.
        Converged = "converged",
        /// As `Converged`, but a saddle was reached before: the leaf was pushed off along the
        /// unstable mode and came to rest elsewhere.
        ConvergedAfterSaddle = "converged-after-saddle",
        /// At rest within the tolerance in an unstable equilibrium, as allowed by the options.
        Saddle = "saddle",
        /// At rest, but the finest grid allowed does not reach the tolerance.
        ToleranceNotReached = "tolerance-not-reached",
        /// The step limit was reached before rest.
        NotAtRest = "not-at-rest",
        /// The time limit was reached before rest, or the run was cancelled.
        OutOfTime = "out-of-time",
        /// The equations are singular: at a bifurcation, or where the leaf can move
        /// without resistance.
        Singular = "singular",
        /// Energy grew beyond what the method allows, or a value was not finite.
        Diverged = "diverged",
    }
}

impl Outcome {
    /// Whether the leaf is at rest, to the tolerance or not.
    pub fn is_at_rest(self) -> bool {
        self.is_success() || self == Outcome::ToleranceNotReached
    }

    /// Whether the leaf is at rest within the tolerance (exit status 0).
    pub fn is_success(self) -> bool {
        matches!(
            self,
            Outcome::Converged | Outcome::ConvergedAfterSaddle | Outcome::Saddle
        )
    }
}

/// The model that was solved, and the effects of shear and stretch.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Model {
    /// Rods solved for; the others are their mirror images.
    #[serde(skip)]
    pub rods: usize,
    /// Whether nothing acts out of the leaf's plane, which it does not leave.
    #[serde(skip)]
    pub planar: bool,
    /// A description of the model, with the grids.
    #[serde(rename = "model")]
    pub description: String,
    /// Largest displacement, in units of length, that would follow from
    /// neglecting shear, to first order, on the coarsest grid.
    pub shear_effect: Option<f64>,
    /// Largest displacement, in units of length, that would follow from neglecting stretch.
    pub stretch_effect: Option<f64>,
}

impl Model {
    /// The model of a leaf of `veins` rods, solved for `rods` of them, in a plane or not, on grids
    /// of these `segments`.
    pub(in crate::relax) fn new(
        veins: usize,
        rods: usize,
        planar: bool,
        segments: &[usize],
        strain_effects: StrainEffects,
    ) -> Self {
        let mirrored = rods < veins;
        let mut phrases = vec![match mirrored {
            true => format!("{rods} of {veins} veins, the others are their mirror images"),
            false if veins == 1 => "1 vein".into(),
            false => format!("all {veins} veins"),
        }];
        if planar {
            phrases.push("planar".into());
        }
        if !segments.is_empty() {
            let grids: Vec<String> = segments.iter().map(usize::to_string).collect();
            phrases.push(format!("{} segments", grids.join("+")));
        }
        if mirrored {
            phrases.push("stable against breaking the mirror".into());
        }
        if planar {
            phrases.push("stable out of the plane".into());
        }
        Model {
            rods,
            planar,
            description: phrases.join("; "),
            shear_effect: strain_effects.shear,
            stretch_effect: strain_effects.stretch,
        }
    }
}

/// A mode of small free vibration without damping: sin(omega t) times its shape, or exp(gamma
/// t) where the equilibrium is unstable.
#[derive(Clone, Debug, PartialEq)]
pub struct Mode {
    /// omega^2, or -gamma^2 if negative: the eigenvalue of the energy's Hessian with respect
    /// to the masses, per time squared.
    pub eigenvalue: f64,
    /// Bound on its error; `None` on a single grid.
    pub error: Option<f64>,
    /// The effective masses along the lab axes, on the finest grid: how much of the leaf's mass a base that is shaken
    /// along an axis moves in this mode. `None` unless shapes were requested.
    pub effective_masses: Option<[f64; 3]>,
    /// Displacement of the nodes of [`Shape::curves`], one list per rod. The largest is as
    /// long as the longest rod; for a mode that rotates the rods without displacing them, the
    /// largest rotation is 1. Empty unless shapes were requested.
    pub displacement: Vec<Vec<DVec3>>,
    /// Rotation vector of these nodes, along the lab axes, radians.
    pub rotation: Vec<Vec<DVec3>>,
}

impl Mode {
    /// Angular frequency omega, radians per time: zero if the mode is neutral, `None` if it is
    /// unstable.
    pub fn frequency(&self) -> Option<f64> {
        match self.is_neutral() {
            true => Some(0.0),
            false => (self.eigenvalue >= 0.0).then(|| self.eigenvalue.sqrt()),
        }
    }

    /// Rate gamma at which the leaf leaves an unstable equilibrium, per time.
    pub fn growth(&self) -> Option<f64> {
        let unstable = self.eigenvalue < 0.0 && !self.is_neutral();
        unstable.then(|| (-self.eigenvalue).sqrt())
    }

    /// Whether the eigenvalue is zero within its error.
    pub fn is_neutral(&self) -> bool {
        (self.error).is_some_and(|error| self.eigenvalue.abs() <= error)
    }
}

/// The accuracy of a result, and that requested.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Accuracy {
    /// Segments per rod of each grid used, coarse to fine; none for shooting.
    pub segments: Vec<usize>,
    /// Intervals of the shooting.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub intervals: Option<usize>,
    /// Requested accuracy, relative to the largest rod length.
    pub tolerance: f64,
    /// Largest unbalanced nodal force or moment, in units of A/L^2 and A/L (A: the leaf's mean
    /// bending stiffness, L: largest rod length). For shooting: the largest defect
    /// ([`crate::shooting::ShootingSolution::defect`]), if it found a solution.
    pub residual: Option<f64>,
    /// Bound on the error of the positions, in units of length; `None` on a single grid.
    pub error_estimate: Option<f64>,
    /// Bound on the error of the energy; `None` on a single grid that was not integrated along its
    /// rods, in wind, and after shooting.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub energy_error: Option<f64>,
}

/// Whether an equilibrium is stable, as far as that is known.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Stability {
    /// Morse index: negative eigenvalues of the energy's Hessian. `None` if
    /// the leaf is not at rest, or forces without a potential act on it.
    pub negative_eigenvalues: Option<usize>,
    /// Number of directions in which the leaf can move without resistance, as round veins
    /// clamped in line can, and veins on hinges: eigenvalues that are exactly zero, at no bifurcation.
    pub neutral_directions: usize,
    /// The lowest modes, ascending, without omissions. `None` if they were not requested or
    /// not found, if the leaf is not at rest, or for shooting.
    pub modes: Option<Vec<Mode>>,
    /// Whether the shapes of the modes were requested.
    pub mode_shapes: bool,
    /// The linearised motion, where forces without a potential act.
    pub small_motions: Option<SmallMotions>,
    /// A saddle that was reached and left.
    pub saddle: Option<Saddle>,
}

impl Stability {
    /// Whether the equilibrium is stable: no negative eigenvalue or, without a potential, no small motion that
    /// grows.
    pub fn stable(&self) -> Option<bool> {
        match &self.small_motions {
            Some(motions) => motions.stable,
            None => self.negative_eigenvalues.map(|count| count == 0),
        }
    }
}

impl Serialize for Stability {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut map = serializer.serialize_map(None)?;
        map.serialize_entry("stable", &self.stable())?;
        map.serialize_entry("negative_eigenvalues", &self.negative_eigenvalues)?;
        map.serialize_entry("neutral_directions", &self.neutral_directions)?;
        let modes = self.modes.as_deref();
        let eigenvalues: Option<Vec<f64>> =
            modes.map(|modes| modes.iter().map(|mode| mode.eigenvalue).collect());
        // Errors are given only if all are known.
        let errors: Option<Vec<f64>> =
            modes.and_then(|modes| modes.iter().map(|mode| mode.error).collect());
        map.serialize_entry("lowest_eigenvalues", &eigenvalues)?;
        map.serialize_entry("eigenvalue_errors", &errors)?;
        let masses =
            modes.and_then(|modes| modes.iter().map(|mode| mode.effective_masses).collect());
        if let Some(masses) = masses.filter(|masses: &Vec<[f64; 3]>| !masses.is_empty()) {
            map.serialize_entry("effective_masses", &masses)?;
        }
        SmallMotions::serialize_keys(self.small_motions.as_ref(), &mut map)?;
        if let Some(saddle) = &self.saddle {
            map.serialize_entry("saddle", saddle)?;
        }
        map.end()
    }
}

/// Derivatives of the results of a leaf at rest with respect to a number of its scenario, in
/// the scenario's units.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Sensitivity {
    /// Key of the number in the scenario.
    pub key: String,
    /// Value of the number in the scenario.
    pub value: f64,
    /// Derivative of the joint tip alone, or one per rod.
    #[serde(flatten, serialize_with = "shape::serialize_tips")]
    pub tips: Vec<DVec3>,
    /// Bound on its error; `None` on a single grid.
    pub tip_error: Option<f64>,
    /// Derivative of the potential energy.
    pub energy: f64,
    /// Bound on the error of the derivative of the energy.
    pub energy_error: Option<f64>,
    /// Derivative of the lowest eigenvalue (the squared frequency), if it is known.
    pub lowest_eigenvalue: Option<f64>,
    /// Bound on the error of the derivative of the lowest eigenvalue.
    pub lowest_eigenvalue_error: Option<f64>,
    /// Derivatives of the frequencies of the requested modes, in cycles per time; none for an
    /// unstable mode, and for a nearly rigid leaf only the lowest.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub frequencies: Vec<Option<f64>>,
    /// Derivative of the reaction at the tip, if it is held.
    #[serde(flatten)]
    pub reaction: Option<Reaction>,
    /// Bound on the error of its force.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub tip_reaction_error: Option<f64>,
    /// Derivatives of what the grips feel.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub grip_reactions: Vec<GripReaction>,
    /// Bound on the error of their forces.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub grip_reactions_error: Option<f64>,
    /// Fractions of the length that the nodes of all grids have in common.
    #[serde(skip)]
    pub stations: Vec<f64>,
    /// Derivatives of the positions there, rod after rod; none if too many numbers are
    /// requested to solve the equations for each.
    #[serde(skip)]
    pub positions: Vec<Vec<DVec3>>,
    /// Bound on the error of the derivatives of positions.
    #[serde(skip)]
    pub positions_error: Option<f64>,
}

/// The shape of a leaf.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Shape {
    /// Fractions of the length at which `rods` are given, base to tip.
    pub stations: Vec<f64>,
    /// Nodes at the stations, extrapolated if several grids were used.
    #[serde(rename = "positions", serialize_with = "shape::serialize_positions")]
    pub rods: Vec<RodShape>,
    /// Whether the tips share one point.
    #[serde(skip)]
    pub joined: bool,
    /// Centerlines on the finest grid, one per rod, for drawing.
    #[serde(skip)]
    pub curves: Vec<Vec<DVec3>>,
    /// Fractions of the length at which these are given.
    #[serde(skip)]
    pub curve_stations: Vec<f64>,
}

impl Shape {
    /// Length of the longest rod.
    pub fn longest(&self) -> f64 {
        self.rods.iter().map(|rod| rod.length).fold(0.0, f64::max)
    }
}

/// A leaf at rest (or in its last state), in the units of its scenario. As JSON it is
/// `summary.json`.
#[derive(Clone, Debug, Serialize)]
pub struct Equilibrium {
    /// Name of the scenario.
    pub scenario: String,
    /// How the leaf was brought to rest.
    pub method: Method,
    /// How the run ended.
    pub outcome: Outcome,
    /// Why the run did not succeed and what would help, or what else is to be said of its end.
    #[serde(flatten, serialize_with = "serialize_remark")]
    pub remark: Option<EquilibriumRemark>,
    /// Implausible properties: a leaf that is stretched far, inverted, or too long for its
    /// weight and stiffness; and an uncertain stability.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub doubts: Vec<EquilibriumDoubt>,
    /// Number of rods.
    #[serde(rename = "rods")]
    pub rod_count: usize,
    /// How accurate it is.
    #[serde(flatten)]
    pub accuracy: Accuracy,
    /// Total potential energy; `None` where shooting found no solution.
    pub energy: Option<f64>,
    /// The joint tip alone, or one tip per rod.
    #[serde(flatten, serialize_with = "shape::serialize_tips")]
    pub tips: Vec<DVec3>,
    /// Sum over the rods of the force each passes to its tip.
    pub tip_force_sum: DVec3,
    /// The reaction at the tip, if it is held.
    #[serde(flatten)]
    pub reaction: Option<Reaction>,
    /// What it exerts on every grip.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub grip_reactions: Vec<GripReaction>,
    /// What it exerts on the support of every base; empty where shooting found no solution.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub base_reactions: Vec<BaseReaction>,
    /// What it exerts on the supports of all bases; `None` where shooting found no solution.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub base_reaction: Option<BaseReaction>,
    /// Whether it is stable.
    #[serde(flatten)]
    pub stability: Stability,
    /// How the leaf came to this equilibrium: `None` for shooting, under a dead moment, and where
    /// an unstable one was looked for.
    #[serde(flatten)]
    pub path: Option<Path>,
    /// Derivatives of the results with respect to the requested numbers of the scenario.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sensitivities: Option<Vec<Sensitivity>>,
    /// The stability margin, if it was requested.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub margin: Option<Margin>,
    /// What follows from its outline, if it is a blade.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub blade: Option<BladeReport>,
    /// The largest stresses in its sections, if these are given.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub stress: Option<Stresses>,
    /// Waves and twist of the veins on the finest grid.
    pub undulation: Undulation,
    /// The model that was solved.
    #[serde(flatten)]
    pub model: Model,
    /// The attempts to bring the leaf to rest, in their order; empty for shooting.
    #[serde(skip)]
    pub attempts: Vec<Attempt>,
    /// Steps, factorizations and evaluations on all grids.
    pub work: SolverCounts,
    /// Time of the solve alone, in seconds.
    pub wall_seconds: f64,
    /// The shape.
    #[serde(flatten)]
    pub shape: Shape,
}

impl Equilibrium {
    /// Whether the equilibrium is stable: no negative eigenvalue or, without a potential, no small motion that
    /// grows.
    pub fn stable(&self) -> Option<bool> {
        self.stability.stable()
    }
}

/// A Morse index as the keys `stable` and `negative_eigenvalues`.
pub fn serialize_index<S: Serializer>(
    index: &Option<usize>,
    serializer: S,
) -> Result<S::Ok, S::Error> {
    #[derive(Serialize)]
    struct Keys {
        stable: Option<bool>,
        negative_eigenvalues: Option<usize>,
    }
    Keys {
        stable: index.map(|count| count == 0),
        negative_eigenvalues: *index,
    }
    .serialize(serializer)
}

/// How far a stable leaf is from losing its stability: the critical forces at its tip, and the
/// energy barrier to another equilibrium. As JSON it is `margin` in `summary.json`.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Margin {
    /// Weight of the leaf: a force.
    pub weight: f64,
    /// Whether forces act at every tip, as the tips are not joined.
    #[serde(skip)]
    pub every_tip: bool,
    /// The largest push that was tried.
    pub largest_push: Option<f64>,
    /// Pushes at the tip, along the axes and against them, the least first; none for a held
    /// tip.
    pub pushes: Vec<CriticalTipForce>,
    /// The lowest energy barrier to another equilibrium, of those found.
    pub barrier: Option<Barrier>,
    /// Number of starting points of the search for saddles.
    pub climbs: usize,
    /// Why a part of it is missing.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub remark: Option<MarginRemark>,
    /// Time of all that is not the solve itself, in seconds.
    pub wall_seconds: f64,
}

impl Margin {
    /// No margin, with the reason.
    pub fn none(remark: MarginRemark) -> Self {
        Margin {
            remark: Some(remark),
            ..Margin::default()
        }
    }
}

/// A direction along a lab axis, or against it. As text: `-z`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct AxisDirection {
    /// 0, 1, 2 for x, y, z.
    pub axis: usize,
    /// Whether the direction is against the axis.
    pub negative: bool,
}

impl AxisDirection {
    /// The directions along and against all axes.
    pub fn all() -> impl Iterator<Item = AxisDirection> {
        (0..3).flat_map(|axis| [false, true].map(|negative| AxisDirection { axis, negative }))
    }

    /// The component along its axis of a unit vector in this direction.
    pub fn sign(self) -> f64 {
        if self.negative { -1.0 } else { 1.0 }
    }

    /// The opposite direction.
    pub fn opposite(self) -> AxisDirection {
        AxisDirection {
            negative: !self.negative,
            ..self
        }
    }
}

impl fmt::Display for AxisDirection {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let sign = if self.negative { '-' } else { '+' };
        write!(f, "{sign}{}", ['x', 'y', 'z'][self.axis])
    }
}

impl Serialize for AxisDirection {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

/// The effect of a dead force at the tip that grows from zero in one direction.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct CriticalTipForce {
    /// Direction of the force.
    #[serde(rename = "axis")]
    pub direction: AxisDirection,
    /// How the stability ends as the force grows.
    pub kind: InstabilityKind,
    /// The force at which stability is lost.
    pub force: Option<f64>,
    /// Bound on the error of that force.
    pub error: Option<f64>,
    /// The force at which stability is lost, in weights of the leaf, if it has any.
    pub per_weight: Option<f64>,
    /// If no loss was found, the force up to which the leaf is stable.
    pub more_than: Option<f64>,
    /// What the leaf does when stability is lost.
    pub then: Option<PostcriticalBehavior>,
    /// The equilibrium it reaches under this force, if it snaps at a fold.
    pub neighbour: Option<Neighbour>,
    /// Positions of the tips when stability is lost.
    #[serde(flatten, serialize_with = "serialize_tips")]
    pub tips: Vec<DVec3>,
    /// Whether this was obtained as the mirror image of the opposite push.
    pub mirrored: bool,
    /// Why it is not known, if that is so.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub remark: Option<CriticalTipForceRemark>,
}

/// How stability is lost.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum InstabilityKind {
    /// The equilibrium meets an unstable one, and both end.
    Fold,
    /// Other branches cross.
    BranchPoint,
    /// Stability is not lost up to the largest push that was tried.
    NoneUpTo,
    /// Unknown beyond some push.
    #[default]
    Unknown,
}

/// The behaviour of a leaf that has lost its stability.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum PostcriticalBehavior {
    /// It jumps to another equilibrium.
    Snaps,
    /// It bends aside continuously as the force grows, to a stable shape close to the unstable
    /// one.
    BendsAside,
}

/// The energy barrier between a stable leaf and another equilibrium: a saddle of index one
/// from which the leaf falls to one of them on either side.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Barrier {
    /// Energy of the saddle above that of the leaf.
    pub energy: f64,
    /// Bound on the error, if it is known on more than one grid.
    pub error: Option<f64>,
    /// Height by which the whole leaf would have to be lifted for that energy: energy over weight.
    pub height: Option<f64>,
    /// The height over the longest rod's length.
    pub relative: Option<f64>,
    /// The saddle over which the leaf would pass.
    pub saddle: Saddle,
    /// The equilibrium on its other side.
    pub neighbour: Neighbour,
}

/// The equilibrium beyond a barrier, or beyond a fold.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Neighbour {
    /// Potential energy there.
    pub energy: f64,
    /// Position of the joint tip, or of the first rod's.
    pub tip: DVec3,
}

/// A blade: the stiffnesses that follow from it at its widest place, and what its division into veins
/// matters. As JSON it is `blade` in `summary.json`.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct BladeReport {
    /// Width of the blade where it is widest.
    pub width: f64,
    /// The area within its outline.
    pub area: f64,
    /// Width of the strip of the vein in the middle there.
    pub strip_width: f64,
    /// A1, A2 and A3 there of the vein in the middle.
    pub couple_stiffness: [f64; 3],
    /// Stiffnesses H1, H2 and H3 there of the vein in the middle.
    pub force_stiffness: [f64; 3],
    /// The tissue beside it there; none of a single vein.
    pub tissue: Option<BladeTissue>,
    /// Stiffness of the whole blade there against bending out of its surface: the sum of A2.
    pub bending: f64,
    /// And against twisting: the sum of A1.
    pub torsion: f64,
    /// The mass, if the material has one.
    pub mass: Option<f64>,
    /// The width below which it is as stiff as there; none if it is wider everywhere.
    pub least_width: Option<f64>,
    /// By how much centerlines move if that is half as much, if it is known.
    pub least_width_effect: Option<f64>,
    /// What the blade does with half as many veins, if that was asked for and is known.
    pub half_as_many: Option<FewerVeins>,
    /// Estimate of the largest error of a position that more veins would not have, in units of length:
    /// 1.5 times the difference to half as many. No bound; of fewer than 5 veins there is none.
    pub error_in_veins: Option<f64>,
    /// Why it was asked for and is not known, or how uncertain it is.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub error_in_veins_remark: Option<VeinsRemark>,
    /// The numbers of veins up to this one, where it was refined.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub veins_tried: Vec<TriedVeins>,
}

/// The tissue of a blade in a gap. Along and normal to the veins it is rigid.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct BladeTissue {
    /// k2, against a change of the width.
    pub across: f64,
    /// c1, against a fold along the veins.
    pub fold: f64,
    /// The contraction: Poisson's ratio times the width of the gap.
    pub contraction: f64,
}

/// A blade with fewer veins.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct FewerVeins {
    /// The number of veins.
    pub rods: usize,
    /// The largest distance of their centerlines from equal places of the blade with all veins.
    pub difference: f64,
}

/// A number of veins with which a blade was relaxed.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct TriedVeins {
    /// The number of veins.
    pub rods: usize,
    /// Its error in veins, if that is known.
    pub error_in_veins: Option<f64>,
}

impl BladeReport {
    /// What follows from the blade of a scenario, without what other relaxations tell; `None` if it has
    /// no blade.
    pub fn of(scenario: &Scenario) -> Option<Self> {
        let blade: &Blade = scenario.blade.as_ref()?;
        let (rods, middle) = (&scenario.rods, scenario.rods.len() / 2);
        let sigma = blade.widest();
        let at =
            |profiles: &[crate::scenario::Profile; 3]| profiles.each_ref().map(|of| of.at(sigma));
        let tissue = |all: &Vec<crate::scenario::Tissue>| {
            let gap = &all[middle.min(all.len() - 1)];
            BladeTissue {
                across: gap.stiffness[1].at(sigma),
                fold: gap.fold.at(sigma),
                contraction: gap.contraction.at(sigma),
            }
        };
        let sum = |axis: usize| {
            rods.iter()
                .map(|rod| rod.couple_stiffness[axis].at(sigma))
                .sum()
        };
        let masses = rods.iter().zip(&scenario.dynamics.density);
        let mass = masses.map(|(rod, density)| rod.length * density.integral(1.0));
        let width = blade.bearing_width(sigma);
        let (young, thickness) = (blade.young(middle, sigma), blade.thickness(middle, sigma));
        Some(BladeReport {
            width,
            area: blade.area(),
            strip_width: rods[middle].force_stiffness[0].at(sigma) / (young * thickness),
            couple_stiffness: at(&rods[middle].couple_stiffness),
            force_stiffness: at(&rods[middle].force_stiffness),
            tissue: scenario.tissue.as_ref().map(tissue),
            bending: sum(1),
            torsion: sum(0),
            mass: blade.has_mass().then(|| mass.sum()),
            least_width: blade.least_width(),
            least_width_effect: None,
            half_as_many: None,
            error_in_veins: None,
            error_in_veins_remark: None,
            veins_tried: Vec::new(),
        })
    }
}
