//! What is said of an equilibrium and of its margin: why a relaxation did not succeed and what would
//! help, what makes its result doubtful, and why a part of a margin is missing.

use crate::leaf::HalfTurn;
use crate::motion::AssumedMotion;
use crate::numbers::{format_error_bound, format_two_digits};
use crate::relax::path::{Path, PathPosition, Route};
use crate::relax::small_motions::{MotionInstability, SmallMotions};
use crate::run::remarks;
use crate::scenario::PlausibilityWarning;
use crate::shooting::{NeutralDirection, ShootingFailureReason};
use serde::{Serialize, Serializer};
use std::fmt;

remarks! {
    /// Why a relaxation did not succeed, with what would help; or what else is to be said of a leaf at
    /// rest. Segments are those per rod of the finest grid.
    pub enum EquilibriumRemark {
        /// A leaf at rest in wind.
        #[error("wind has no potential: {}", verdict_text(*.verdict))]
        WindWithoutPotential {
            /// What its small motions tell, if they are known.
            verdict: Option<MotionVerdict>,
        } = "wind-without-potential",
        /// A leaf at rest under a dead moment.
        #[error("a dead moment has no potential: {}", verdict_text(*.verdict))]
        MomentWithoutPotential {
            /// What its small motions tell, if they are known.
            verdict: Option<MotionVerdict>,
        } = "moment-without-potential",
        /// A leaf at rest under loads that turn with the section, or moments along veins.
        #[error(
            "loads that turn with the section, and moments along veins, have no potential: {}",
            verdict_text(*.verdict)
        )]
        FollowersWithoutPotential {
            /// What its small motions tell, if they are known.
            verdict: Option<MotionVerdict>,
        } = "followers-without-potential",
        /// Negative eigenvalues that cannot be counted.
        #[error(
            "the leaf is too large, or rounding on so many segments too much, to count its negative eigenvalues: \
             its stability is not known"
        )]
        IndexNotCounted = "index-not-counted",
        /// At rest on all grids, at a saddle by eigenvalues extrapolated over them.
        #[error(
            "just beyond a bifurcation: unstable, by eigenvalues extrapolated over grids on which it is \
             still stable; a load that is a little larger, or a small disturbance, shows where it goes"
        )]
        BeyondBifurcation = "beyond-bifurcation",
        /// A tolerance that no grid reaches.
        #[error(
            "rounding and unfinished iterations leave more than the tolerance on any grid: ask for a larger one"
        )]
        ToleranceBelowRounding = "tolerance-below-rounding",
        /// A tolerance that finer grids than are allowed might reach.
        #[error(
            "{segments} segments a rod, the finest grid allowed, do not reach the tolerance: ask for a larger one"
        )]
        ToleranceBeyondFinestGrid {
            /// Segments.
            segments: usize,
        } = "tolerance-beyond-finest-grid",
        /// Interpolated stations that are less accurate than the tolerance.
        #[error(
            "the tolerance is kept where the leaf was solved for, but not at all of the \
             stations between: ask for a smaller tolerance, or for other stations"
        )]
        InaccurateBetweenStations = "inaccurate-between-stations",
        /// A descent that finds no lower energy.
        #[error("no step lowers the energy on {segments} segments{}", obstacle_text(.obstacle))]
        NoDescent {
            /// Segments.
            segments: usize,
            /// What may keep the leaf from coming to rest.
            obstacle: Option<Box<RestObstacle>>,
        } = "no-descent",
        /// Loads without a potential beyond those for which the loaded leaf has an equilibrium.
        #[error("the equilibrium of the slowly loaded leaf ends{} ({segments} segments)", .obstacle)]
        EquilibriumEnds {
            /// Segments.
            segments: usize,
            /// How much of the loads the leaf bears.
            obstacle: Box<RestObstacle>,
        } = "equilibrium-ends",
        /// A vein that bends more than the grid resolves.
        #[error(
            "a vein bends by more than a right angle within one of {segments} segments{}",
            obstacle_text(.obstacle)
        )]
        UnresolvedBend {
            /// Segments.
            segments: usize,
            /// What may keep the leaf from coming to rest.
            obstacle: Option<Box<RestObstacle>>,
        } = "unresolved-bend",
        /// As many steps as are allowed.
        #[error(
            "the step limit came before rest on {segments} segments: the load may admit no stable equilibrium{}",
            obstacle_text(.obstacle)
        )]
        StepLimit {
            /// Segments.
            segments: usize,
            /// What may keep the leaf from coming to rest.
            obstacle: Option<Box<RestObstacle>>,
        } = "step-limit",
        /// As many steps of the explicit method as are allowed.
        #[error(
            "the step limit came before rest on {segments} segments: use fewer, or the semi-implicit method"
        )]
        ExplicitStepLimit {
            /// Segments.
            segments: usize,
        } = "explicit-step-limit",
        /// The end of the time allowed.
        #[error("the time allowed was over before rest on {segments} segments: allow more")]
        OutOfTime {
            /// Segments.
            segments: usize,
        } = "out-of-time",
        /// A matrix that does not fit into memory.
        #[error(
            "the factorised matrix of the leaf on {segments} segments does not fit into the memory that is allowed: \
             use fewer rods or segments, or raise the limit on memory"
        )]
        OutOfMemory {
            /// Segments.
            segments: usize,
        } = "out-of-memory",
        /// Newton's method for an equilibrium, stable or not, that leads to none.
        #[error(
            "Newton's method leads to no equilibrium from this start on {segments} segments: let the leaf relax, \
             which moves it to a stable one"
        )]
        NoEquilibriumFromStart {
            /// Segments.
            segments: usize,
        } = "no-equilibrium-from-start",
        /// An unstable equilibrium found by shooting.
        #[error(
            "shooting finds equilibria, stable or not: the method semi-implicit finds a stable one"
        )]
        ShotSaddle = "shot-saddle",
        /// An equilibrium found by shooting, of unknown index.
        #[error(
            "the number of negative eigenvalues is not known: a dead moment has no energy, the leaf is too fine to \
             count them, or one may have either sign"
        )]
        ShotIndexUnknown = "shot-index-unknown",
        /// An equilibrium found by shooting, near a bifurcation or one of a family.
        #[error("{0}")]
        NeutralDirection(NeutralDirection) = "neutral-direction",
        /// A solution by shooting beside one with smaller local errors that was not found.
        #[error("this is the best solution found; with smaller local errors {0}")]
        NotSharpened(ShootingFailureReason) = "not-sharpened",
        /// A solution by shooting that is less accurate than the tolerance.
        #[error(
            "double precision does not carry more through this leaf: ask for a larger tolerance"
        )]
        DoublePrecision = "double-precision",
        /// No solution by shooting.
        #[error("{reason}{}", way_from_arcs(*.part))]
        ShootingFailed {
            /// Why.
            reason: ShootingFailureReason,
            /// Part of the change from the leaf of arcs to this leaf that was made.
            part: f64,
        } = "shooting-failed",
        /// A refined blade whose error in veins is larger than wanted, or not known.
        #[error(
            "with {rods} veins, the most that are tried, the error in veins is {}, where {} is wanted: allow more",
            .error.map_or("not known".to_owned(), |error| format!("about {}", format_two_digits(error))),
            format_two_digits(*.wanted)
        )]
        ErrorInVeins {
            /// The number of veins.
            rods: usize,
            /// The error, a length, if it is known.
            error: Option<f64>,
            /// The error that was wanted, a length.
            wanted: f64,
        } = "error-in-veins",
    }

    /// What may keep a leaf from coming to rest, with what would help. Its sentence ends that of an
    /// [`EquilibriumRemark`]. Veins are counted from 0.
    pub enum RestObstacle {
        /// What in the scenario is probably not what was intended.
        #[error(": {0}")]
        Implausible(PlausibilityWarning) = inner.code(),
        /// Sections of neighbouring veins turned against each other by half a turn.
        #[error(": {}", .place.sentence())]
        HalfTurn {
            /// Where.
            place: HalfTurn,
        } = "half-turn",
        /// An inextensible vein that is held straight between two holders.
        #[error(
            ": vein {} is inextensible and held straight between {} and {}: no finite force in it bears what pulls it aside, \
             and what it carries along itself is not determined; give stiffness.axial a number, or move one holder towards the other",
            .vein + 1, .between[0], .between[1]
        )]
        TautSpan {
            /// The vein.
            vein: usize,
            /// What holds it, in the order of its length.
            between: [SpanHolder; 2],
        } = "taut-span",
        /// Loads without a potential that grow no farther beside all others.
        #[error(
            " at {part:.4} of {}: beyond, the leaf moves on, to another equilibrium or to none; give less of these loads, or \
             simulate the motion{}",
            loads_text(.loads), spin_text(*.spins)
        )]
        EndOfGrowth {
            /// The part of these loads that the leaf bears.
            part: f64,
            /// Keys of these loads.
            loads: Vec<&'static str>,
            /// The vein that is free to spin on its hinge under them, if one is.
            spins: Option<usize>,
        } = "end-of-growth",
        /// Loads that are large for the stiffness.
        #[error(
            "{}: lower {}, or raise stiffness.{stiffness} of vein {}{}",
            reached_text(*.reached), loads_text(.loads), .vein + 1,
            if *.may_shoot { ", or try the method shooting" } else { "" }
        )]
        Loads {
            /// Up to where the leaf came to rest on its path, if it has one.
            reached: Option<PathPosition>,
            /// Keys of the largest loads, first the growth that strains the tissue; none of a leaf without either.
            loads: Vec<&'static str>,
            /// Key of the softest stiffness, in its table.
            stiffness: &'static str,
            /// The vein that bends most.
            vein: usize,
            /// Whether another method may find an equilibrium.
            may_shoot: bool,
        } = "loads",
    }

    /// Why the error in veins of a blade is not known, or how uncertain it is.
    pub enum VeinsRemark {
        /// A key that says something of each vein, or of some.
        #[error("{key} is that of single veins, and with fewer veins the leaf would be another{}", whole_blade_hint(.key))]
        SingleVeins {
            /// The key, or its table.
            key: &'static str,
        } = "single-veins",
        /// Fewer veins with which the blade is no scenario.
        #[error("there is no such blade with {rods} veins: {why}")]
        NoSuchBlade {
            /// The smaller number of veins.
            rods: usize,
            /// Why.
            why: String,
        } = "no-such-blade",
        /// Veins that are far apart for the length of the blade.
        #[error(
            "the veins are further apart than a quarter of the length of the blade, \
             where no comparison with fewer tells an error: take more veins"
        )]
        ShortAndWide = "short-and-wide",
        /// A blade with fewer veins that is not at rest.
        #[error("with {rods} veins the blade does not come to rest")]
        FewerNotAtRest {
            /// The smaller number of veins.
            rods: usize,
        } = "fewer-not-at-rest",
        /// A blade with fewer veins that rests elsewhere.
        #[error("with {rods} veins the blade rests in another equilibrium, {} away", format_two_digits(*.distance))]
        AnotherEquilibrium {
            /// The smaller number of veins.
            rods: usize,
            /// The largest distance of equal places.
            distance: f64,
        } = "another-equilibrium",
        /// An estimate from very few veins.
        #[error("what more veins would change is estimated from {rods} veins, and may be larger")]
        VeryFew {
            /// The smaller number of veins.
            rods: usize,
        } = "very-few",
    }

    /// What makes the result of a relaxation doubtful. Veins are counted from 0, stations are fractions
    /// of their lengths.
    pub enum EquilibriumDoubt {
        /// What in the scenario is probably not what was intended.
        #[error("{0}")]
        Implausible(PlausibilityWarning) = inner.code(),
        /// A vein that is stretched far.
        #[error(
            "vein {} is stretched by {:.0} % at {station:.2} of its length: few materials follow a linear law so far",
            .vein + 1, 100.0 * .stretch
        )]
        Stretched {
            /// The vein.
            vein: usize,
            /// Where it is stretched most.
            station: f64,
            /// Stretch beyond that at rest.
            stretch: f64,
        } = "stretched",
        /// A vein with inverted elements.
        #[error(
            "vein {} is turned through itself at {station:.2} of its length, which no body can be: raise stiffness.axial",
            .vein + 1
        )]
        Inverted {
            /// The vein.
            vein: usize,
            /// Where its stretch is not positive.
            station: f64,
        } = "inverted",
        /// Flat sections in wind that turn another width to it than that of the drag.
        #[error(
            "the drag has the whole wind.width however the sections are turned: on the leaf at rest they turn {:.0} % of \
             it to the air that flows past, weighted by the drag",
            100.0 * .part
        )]
        TurnedFromWind {
            /// The width that sections turn to the air over that of the drag.
            part: f64,
        } = "turned-from-wind",
        /// A path whose events lead elsewhere on another grid.
        #[error(
            "where the leaf lost its stability while it was loaded, it moves to different equilibria on \
             different grids: this is one in which it can rest"
        )]
        UnconfirmedPath = "unconfirmed-path",
        /// A leaf that two grids never bring to the same equilibrium.
        #[error(
            "from its start the leaf moves to different equilibria on different grids: \
             this is one in which it can rest"
        )]
        UnconfirmedEquilibrium = "unconfirmed-equilibrium",
        /// A path that could not be followed.
        #[error(
            "slow loading could not be followed to its end: the leaf was released from arcs under all of its \
             loads instead, and may rest elsewhere than slow loading leads"
        )]
        ReleasedInstead = "released-instead",
        /// Places along the veins that were moved to others beside them.
        #[error(
            "places along the veins that lie within a millionth of the length were read as one, and moved by up to {}: this \
             may move the leaf by more than the error that is told; write them as equal numbers, or farther apart",
            format_error_bound(*.shift)
        )]
        MovedPlaces {
            /// The largest shift, a length.
            shift: f64,
        } = "moved-places",
        /// Loads without a potential that were put on before the others.
        #[error(
            "beside all other loads the equilibrium of the slowly loaded leaf ends at {part:.4} of {}: these loads were put on \
             first, and the leaf may rest elsewhere than it moves to from there",
            loads_text(.loads)
        )]
        OtherLoadOrder {
            /// The part of these loads that the leaf bears where they are put on last.
            part: f64,
            /// Keys of these loads.
            loads: Vec<&'static str>,
        } = "other-load-order",
        /// Fewer small motions than were asked for.
        #[error(
            "of the {asked} slowest motions asked for {found} are told: more do not converge, or there are no more on the \
             coarsest grid"
        )]
        FewerMotions {
            /// As many as were asked for.
            asked: usize,
            /// As many as are told.
            found: usize,
        } = "fewer-motions",
        /// Modes that the end of the time allowed left out, or made less accurate.
        #[error(
            "the time allowed was over before the lowest modes {}: allow more",
            if *.told { "were as accurate as they would be" } else { "were known" }
        )]
        ModesOutOfTime {
            /// Whether modes are told.
            told: bool,
        } = "modes-out-of-time",
        /// A given shape from which the leaf did not come to rest.
        #[error("from the given start the leaf does not come to rest: it was relaxed as without one")]
        RelaxedAnew = "relaxed-anew",
        /// An eigenvalue that may have either sign.
        #[error(
            "an eigenvalue may be negative or positive for all that these grids tell: \
             whether the leaf is stable is not certain"
        )]
        UndecidedStability = "undecided-stability",
        /// An eigenvalue that may have either sign beside others that are negative.
        #[error(
            "an eigenvalue may be negative or positive for all that these grids tell: \
             the index is the number of those that are certainly negative, or larger"
        )]
        UndecidedIndex = "undecided-index",
        /// A number that decides where a leaf turns to that turns without resistance.
        #[error(
            "{key} has no derivative: the leaf turns about its base without resistance, and the smallest \
             change of this number decides where it turns to"
        )]
        NoDerivative {
            /// The number.
            key: String,
        } = "no-derivative",
    }

    /// Why a margin, or a part of it, is missing.
    pub enum MarginRemark {
        /// An unstable leaf.
        #[error("an unstable leaf has no margin to lose")]
        Unstable = "unstable",
        /// A leaf that is not at rest, or of unknown stability.
        #[error("only a leaf at rest whose stability is known has a margin")]
        StabilityUnknown = "stability-unknown",
        /// A softest eigenvalue that no grid resolves.
        #[error("its softest eigenvalue cannot be told from zero on any grid tried")]
        UnresolvedEigenvalue = "unresolved-eigenvalue",
        /// A leaf that is unstable on finer grids.
        #[error("the leaf is unstable on grids finer than those of its relaxation")]
        UnstableOnFinerGrids = "unstable-on-finer-grids",
        /// The end of the time allowed.
        #[error("the time allowed was over before all was tried")]
        OutOfTime = "out-of-time",
        /// Tips that are all held.
        #[error("the tip is held: a force on it moves nothing")]
        TipHeld = "tip-held",
        /// A leaf that turns without resistance.
        #[error(
            "the leaf turns about its base without resistance, towards any push across that axis: only \
             pushes along it are tried"
        )]
        ZeroEnergyRotation = "zero-energy-rotation",
    }

    /// Why it is not known at which force on its tip a leaf loses its stability.
    pub enum CriticalTipForceRemark {
        /// The end of the time allowed.
        #[error("the time allowed was over")]
        OutOfTime = "out-of-time",
        /// A loss that may be at any force below this one.
        #[error("its loss, below {}, cannot be told from zero", format_error_bound(*.below))]
        NearZero {
            /// The force.
            below: f64,
        } = "near-zero",
        /// A branch that is lost, or not verified, in the words of the continuation.
        #[error("{0}")]
        BranchLost(String) = "branch-lost",
        /// A branch that ended early for another reason.
        #[error("the branch could not be followed further")]
        NotFollowed = "not-followed",
    }
}

impl EquilibriumRemark {
    /// What may have kept the leaf from coming to rest.
    pub fn obstacle(&self) -> Option<&RestObstacle> {
        match self {
            EquilibriumRemark::NoDescent { obstacle, .. }
            | EquilibriumRemark::UnresolvedBend { obstacle, .. }
            | EquilibriumRemark::StepLimit { obstacle, .. } => obstacle.as_deref(),
            EquilibriumRemark::EquilibriumEnds { obstacle, .. } => Some(obstacle),
            _ => None,
        }
    }
}

/// What to do where nothing keeps a vein from spinning.
fn spin_text(vein: Option<usize>) -> String {
    vein.map_or_else(String::new, |vein| {
        format!(
            "; the hinge of vein {} leaves it free to spin about its own tangent, and leaf.base_spin = \"held\" holds it",
            vein + 1
        )
    })
}

impl RestObstacle {
    /// Whether the loads without a potential could not grow to their full size.
    pub(super) fn is_end_of_growth(&self) -> bool {
        matches!(self, RestObstacle::EndOfGrowth { .. })
    }
}

impl EquilibriumDoubt {
    /// The doubt about places that were moved by so much, a length, where that may move the leaf by more than its error.
    pub(super) fn about_places(shift: f64, error: Option<f64>) -> Option<Self> {
        let may_matter = error.is_some_and(|error| shift > error);
        may_matter.then_some(EquilibriumDoubt::MovedPlaces { shift })
    }

    /// What is not certain about a path, where this route was meant.
    pub(super) fn about_path(path: &Path, meant: Route) -> Option<Self> {
        match path {
            Path::Loaded {
                confirmed: false, ..
            } => Some(EquilibriumDoubt::UnconfirmedPath),
            Path::Released if meant == Route::Loading => Some(EquilibriumDoubt::ReleasedInstead),
            _ => None,
        }
    }
}

/// What holds a vein at one end of a span.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum SpanHolder {
    /// Its base.
    Base,
    /// A grip at this fraction of its length.
    Grip(f64),
    /// What holds its tip.
    Tip,
}

impl fmt::Display for SpanHolder {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        match self {
            SpanHolder::Base => f.write_str("its base"),
            SpanHolder::Grip(sigma) => {
                write!(f, "the grip at {} of its length", format_two_digits(*sigma))
            }
            SpanHolder::Tip => f.write_str("its tip"),
        }
    }
}

/// What to give in place of a load of single veins.
fn whole_blade_hint(key: &str) -> &'static str {
    match key {
        "load.gravity" | "dynamics.density" => {
            ": blade.mass_density with load.g is the weight of the whole blade"
        }
        _ => "",
    }
}

fn obstacle_text(obstacle: &Option<Box<RestObstacle>>) -> String {
    obstacle
        .as_ref()
        .map(ToString::to_string)
        .unwrap_or_default()
}

/// What the small motions about an equilibrium tell.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MotionVerdict {
    /// Whether none grows, if that is certain.
    pub stable: Option<bool>,
    /// How the one that grows fastest does.
    pub instability: Option<MotionInstability>,
    /// Whether growing ones were looked for among all of a coarse grid.
    pub complete: bool,
    /// What is assumed of masses and damping.
    pub assumed: AssumedMotion,
}

impl EquilibriumRemark {
    /// Adds what the small motions tell to what is said of forces without a potential.
    pub(crate) fn add_small_motions(&mut self, motions: &SmallMotions) {
        if let EquilibriumRemark::WindWithoutPotential { verdict }
        | EquilibriumRemark::MomentWithoutPotential { verdict }
        | EquilibriumRemark::FollowersWithoutPotential { verdict } = self
        {
            *verdict = Some(MotionVerdict {
                stable: motions.stable,
                instability: motions.instability,
                complete: motions.complete,
                assumed: motions.assumed,
            });
        }
    }
}

fn verdict_text(verdict: Option<MotionVerdict>) -> String {
    let Some(verdict) = verdict else {
        return "no count of eigenvalues decides stability, and the small motions about the equilibrium \
                are not known"
            .into();
    };
    let assumed: Vec<&str> = verdict.assumed.words().collect();
    let given = match assumed.is_empty() {
        true => "with the masses and the damping of the scenario".to_owned(),
        false => format!("with {} where the scenario gives none", assumed.join(", ")),
    };
    let told = match (verdict.stable, verdict.instability) {
        (Some(true), _) => "none grows",
        (_, Some(MotionInstability::Flutter)) => "oscillations grow (flutter)",
        (_, Some(MotionInstability::Divergence)) => "one grows without oscillations (divergence)",
        _ if !verdict.complete => {
            "none of the slowest grows, and whether a faster one does is not known"
        }
        _ => "whether one grows is within the error of its growth rate",
    };
    format!("stability is that of the small motions about the equilibrium, {given}: {told}")
}

fn reached_text(reached: Option<PathPosition>) -> String {
    match reached {
        Some(PathPosition { stage, lambda }) if lambda > 0.0 => {
            let percent = 100.0 * lambda;
            format!(" (it came to rest up to {percent:.2} % of {stage})")
        }
        _ => String::new(),
    }
}

fn loads_text(loads: &[&str]) -> String {
    match loads.is_empty() {
        true => "the curvatures at rest".to_owned(),
        false => loads.join(" or "),
    }
}

fn way_from_arcs(part: f64) -> String {
    match part {
        part if part < 1.0 => format!(" (at {part:.4} of the way from arcs to this leaf)"),
        _ => String::new(),
    }
}

/// A remark as the keys `remark` and `remark_code`, if there is one.
pub(crate) fn serialize_remark<S: Serializer>(
    remark: &Option<EquilibriumRemark>,
    serializer: S,
) -> Result<S::Ok, S::Error> {
    #[derive(Serialize)]
    struct Keys<'a> {
        #[serde(skip_serializing_if = "Option::is_none")]
        remark: Option<&'a EquilibriumRemark>,
        #[serde(skip_serializing_if = "Option::is_none")]
        remark_code: Option<&'static str>,
    }
    let remark = remark.as_ref();
    Keys {
        remark,
        remark_code: remark.map(EquilibriumRemark::code),
    }
    .serialize(serializer)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::relax::path::Stage;

    /// Words that stay, and that the documents explain.
    #[test]
    fn codes_are_documented() {
        let formats = include_str!("../../docs/formats.md");
        let codes = EquilibriumRemark::CODES;
        for (k, code) in codes.iter().enumerate() {
            assert!(formats.contains(&format!("`{code}`")), "{code}");
            assert!(!codes[..k].contains(code), "{code}");
        }
    }

    #[test]
    fn a_remark_ends_with_what_may_keep_the_leaf_from_rest() {
        let mut remark = EquilibriumRemark::StepLimit {
            segments: 8,
            obstacle: Some(Box::new(RestObstacle::Loads {
                reached: Some(PathPosition {
                    stage: Stage::Joining,
                    lambda: 0.5,
                }),
                loads: vec!["load.gravity", "load.tip_force"],
                stiffness: "torsion",
                vein: 2,
                may_shoot: true,
            })),
        };
        let sentence = "the step limit came before rest on 8 segments: the load may admit no stable equilibrium \
                        (it came to rest up to 50.00 % of joining): lower load.gravity or load.tip_force, or raise \
                        stiffness.torsion of vein 3, or try the method shooting";
        assert_eq!(remark.to_string(), sentence);
        if let EquilibriumRemark::StepLimit { obstacle, .. } = &mut remark {
            *obstacle = None;
        }
        assert!(remark.to_string().ends_with("no stable equilibrium"));
        let key = "load.gravity";
        let remark = VeinsRemark::SingleVeins { key };
        let sentence = "load.gravity is that of single veins, and with fewer veins the leaf would be another: \
                        blade.mass_density with load.g is the weight of the whole blade";
        assert_eq!(remark.to_string(), sentence);
        let key = "leaf.fan";
        let slip = PlausibilityWarning::AngleInDegrees { key, angle: -60.0 };
        let doubt = EquilibriumDoubt::Implausible(slip);
        assert_eq!(doubt.code(), "angle-in-degrees");
        let sentence = "leaf.fan is in radians, and -60 is more than a turn";
        assert_eq!(doubt.to_string(), sentence);
    }
}
