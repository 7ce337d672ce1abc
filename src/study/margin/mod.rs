//! How far a stable leaf is from losing its stability.
//!
//! A force on the tip is increased along each axis, both ways, and the leaf followed until it becomes
//! unstable; saddles are sought from there and along the softest modes, and the lowest is the barrier to
//! another equilibrium.

pub(super) mod barrier;

use crate::branch::{
    BranchEnd, BranchEquations, ContinuationOptions, CorrectorFailure, CriticalKind, CriticalPoint,
    EquilibriumPoint, ExtrapolatedPoint, LeafFamily, NEARLY_RIGID, NestedBranchEquations,
    VerifiedBranch, on_finer, scale_field, switch_branches, verify_at_parameter,
};
use crate::leaf::{Grid, are_mirror_symmetric, is_mirrored};
use crate::memory;
use crate::relax::solve_on_grid::relax_from_state;
use crate::relax::{
    AxisDirection, CriticalTipForce, CriticalTipForceRemark, Equilibrium, GridLevel,
    InstabilityKind, Margin, MarginRemark, Neighbour, Options, PostcriticalBehavior, RelaxError,
    RelaxedLeaf, relax_on_grids, without_wind_or_followers,
};
use crate::run::Instant;
use crate::scenario::Scenario;
use crate::study::margin::barrier::{
    MarginProgress, SaddleSearchStart, SearchProgress, StableLeaf,
};
use glam::DVec3;
use rayon::prelude::*;
use std::f64::consts::PI;
use std::sync::Mutex;
use std::sync::atomic::AtomicUsize;

/// The largest push: the sum of the first two loads, but no more than the third.
struct LargestPush {
    /// In A/L^2: the load under which the veins buckle as columns pinned at both ends (Euler).
    bending: f64,
    /// In weights of the leaf.
    weight: f64,
    /// A part of the axial stiffness of the veins.
    axial_strain: f64,
}

const LARGEST_PUSH: LargestPush = LargestPush {
    bending: PI * PI,
    weight: 10.0,
    axial_strain: 0.2,
};

/// How the branch of a push is followed until the leaf has lost its stability.
struct PushBranch {
    /// Accuracy of points on it (of the tips, relative to the leaf); a critical one has its own
    /// error.
    accuracy: f64,
    /// Longest step, as a part of the largest push.
    longest_step: f64,
    /// Largest number of points.
    most_points: usize,
    /// Points after the loss of stability that are needed to confirm it.
    confirming_points: usize,
    /// Of so many points in a row under which the leaf stays stable one is verified on finer grids.
    points_per_verification: usize,
    /// Grids of a critical point: for a leaf of few nodes, and for others.
    critical_grids: [usize; 2],
    /// Largest number of nodes of a leaf of few nodes.
    few_nodes: usize,
}

const PUSH_BRANCH: PushBranch = PushBranch {
    accuracy: 1e-4,
    longest_step: 0.1,
    most_points: 400,
    confirming_points: 2,
    points_per_verification: 4,
    critical_grids: [4, 3],
    few_nodes: 500,
};

/// Why a margin cannot be found.
#[derive(Debug, thiserror::Error)]
pub enum MarginError {
    /// A relaxation that cannot be run.
    #[error(transparent)]
    Relax(#[from] RelaxError),
    /// Shooting has no grids on which branches are followed.
    #[error("a margin is that of a relaxed leaf: use the method semi-implicit")]
    Method,
    /// Without energy there is neither an index nor a barrier.
    #[error(
        "a dead moment (load.tip_moment, load.point.moment) has no potential, hence no barrier; use loads that have"
    )]
    Moment,
}

/// Largest relative difference of the softest eigenvalue between two successive grids, or of that
/// extrapolated over them.
const EIGENVALUE_AGREEMENT: f64 = 0.25;

/// Nodes of the finest grid in that search.
const MOST_CONTINUATION_NODES: usize = 5_000;

/// Relaxes a leaf and finds how far it is from losing its stability, as
/// [`Equilibrium::margin`].
pub fn relax_with_margin(
    scenario: &Scenario,
    options: &Options,
    progress: &mut (dyn FnMut(&MarginProgress) + Send),
) -> Result<Equilibrium, MarginError> {
    if options.method.is_shooting() {
        return Err(MarginError::Method);
    }
    if scenario.has_moments() {
        return Err(MarginError::Moment);
    }
    without_wind_or_followers(scenario, "the margin")?;
    let RelaxedLeaf {
        result: mut leaf,
        on_grids: found,
    } = relax_on_grids(scenario, options, false, &mut |step| {
        progress(&MarginProgress::Relaxing(*step));
    })?;
    leaf.margin = Some(match (leaf.outcome.is_at_rest(), leaf.stable()) {
        (true, Some(true)) => stability_margin(scenario, &leaf, &found.levels, options, progress)?,
        (true, Some(false)) => Margin::none(MarginRemark::Unstable),
        _ => Margin::none(MarginRemark::StabilityUnknown),
    });
    Ok(leaf)
}

fn stability_margin(
    scenario: &Scenario,
    rest: &Equilibrium,
    levels: &[GridLevel],
    options: &Options,
    progress: &mut (dyn FnMut(&MarginProgress) + Send),
) -> Result<Margin, MarginError> {
    let clock = Instant::now();
    let make = |_: [f64; 1]| Ok(scenario.clone());
    let Ok(family) = LeafFamily::new(&make, [0.0, 1.0], false) else {
        return Ok(Margin::none(MarginRemark::UnresolvedEigenvalue));
    };
    let LeafOnGrid { grid, point, .. } = match continuation_grid(&family, levels) {
        Ok(found) => found,
        Err(why) => return Ok(Margin::none(why)),
    };
    let rods = scenario.rods.len();
    memory::check_branch_memory(rods, grid.segments()).map_err(RelaxError::Memory)?;
    let weight = total_weight(scenario);
    let directions = tip_force_directions(scenario, rest);
    let tolerance = options.tolerance.unwrap_or(scenario.tolerance);
    let stable = StableLeaf {
        scenario,
        family: &family,
        rest,
        grid,
        state: point.state,
        accuracy: tolerance.max(PUSH_BRANCH.accuracy),
        largest_force: largest_tip_force(scenario, weight),
        limit: &options.limit,
        searches: SearchProgress {
            finished_count: AtomicUsize::new(0),
            total_count: AtomicUsize::new(directions.len() + barrier::MODE_SADDLE_SEARCHES),
            progress: Mutex::new(progress),
        },
    };
    let pushed: Vec<_> = directions
        .into_par_iter()
        .map(|direction| {
            let pushed = find_critical_tip_force(&stable, direction, weight);
            stable.searches.finish_one();
            pushed
        })
        .collect();
    let (mut pushes, mut starts) = (Vec::new(), Vec::new());
    for push in pushed {
        starts.extend(push.starts);
        pushes.push(push.force);
    }
    add_mirrored_forces(&mut pushes, rods);
    pushes.sort_by(|a, b| {
        let [a, b] = [a, b].map(|push| push.force.unwrap_or(f64::INFINITY));
        a.total_cmp(&b)
    });
    let barrier::LowestBarrier { barrier, searches } =
        barrier::lowest_energy_barrier(&stable, starts, weight);
    let held = scenario.holds_all_tips();
    let remark = match options.limit.reached() {
        true => Some(MarginRemark::OutOfTime),
        false if held => Some(MarginRemark::TipHeld),
        false => {
            (rest.stability.neutral_directions > 0).then_some(MarginRemark::ZeroEnergyRotation)
        }
    };
    Ok(Margin {
        weight,
        every_tip: !scenario.joined && rods > 1,
        largest_push: (!held).then_some(stable.largest_force),
        pushes,
        barrier,
        climbs: searches,
        remark,
        wall_seconds: clock.elapsed().as_secs_f64(),
    })
}

/// The leaf on a grid, with its softest eigenvalue there.
struct LeafOnGrid {
    grid: Grid,
    point: EquilibriumPoint,
    softest_eigenvalue: f64,
}

impl LeafOnGrid {
    fn from_point(
        equations: &mut BranchEquations,
        point: &EquilibriumPoint,
    ) -> Result<Self, CorrectorFailure> {
        Ok(LeafOnGrid {
            grid: equations.grid().clone(),
            softest_eigenvalue: equations.softest_eigenvalue(point)?,
            point: point.clone(),
        })
    }
}

/// Whether the softest eigenvalue is that of the leaf on the first of these grids: it agrees with
/// that on the next; or, near a bifurcation, where that of a coarse grid differs, the values
/// extrapolated from the first two and from the last two agree, and the differences fall with the
/// square of the segments' length.
fn is_softest_eigenvalue_resolved(grids: &[LeafOnGrid]) -> bool {
    let alike = |a: f64, b: f64| (a - b).abs() < EIGENVALUE_AGREEMENT * b;
    let stable = grids.iter().all(|it| it.point.index == 0);
    let softest: Vec<f64> = grids.iter().map(|it| it.softest_eigenvalue).collect();
    stable
        && match softest[..] {
            [a, b] => alike(a, b),
            [a, b, c] => {
                let [coarser, finer] = [[a, b], [b, c]].map(|[a, b]| b + (b - a) / 3.0);
                alike(coarser, finer) && alike((a - b) / (b - c), 4.0)
            }
            _ => false,
        }
}

/// The leaf on the coarsest grid on which its softest eigenvalue is known, or why there is none.
fn continuation_grid(
    family: &LeafFamily,
    levels: &[GridLevel],
) -> Result<LeafOnGrid, MarginRemark> {
    let first = levels[0].leaf.segments();
    let mut nested = levels.iter().filter(|level| {
        let segments = level.leaf.segments();
        segments.is_multiple_of(first) && (segments / first).is_power_of_two()
    });
    let on_level = |level: &GridLevel| {
        let mut equations = BranchEquations::new(family, level.leaf.grid.clone());
        let point = equations.correct(&level.state, 0.0, None)?;
        Ok::<_, CorrectorFailure>((equations, point))
    };
    let (mut equations, mut point) =
        on_level(&levels[0]).map_err(|_| MarginRemark::UnresolvedEigenvalue)?;
    nested.next();
    let mut grids: Vec<LeafOnGrid> = Vec::new();
    loop {
        grids.push(
            LeafOnGrid::from_point(&mut equations, &point)
                .map_err(|_| MarginRemark::UnresolvedEigenvalue)?,
        );
        for first in [2, 3]
            .into_iter()
            .filter_map(|count| grids.len().checked_sub(count))
        {
            if is_softest_eigenvalue_resolved(&grids[first..]) {
                return Ok(grids.swap_remove(first));
            }
        }
        if grids.len() > 1 && point.state.rods() * point.state.segments() > MOST_CONTINUATION_NODES
        {
            return Err(match point.index {
                0 => MarginRemark::UnresolvedEigenvalue,
                _ => MarginRemark::UnstableOnFinerGrids,
            });
        }
        let finer = match nested.next() {
            Some(level) => on_level(level),
            None => on_finer(&mut equations, &point),
        };
        (equations, point) = finer.map_err(|_| MarginRemark::UnresolvedEigenvalue)?;
    }
}

fn total_weight(scenario: &Scenario) -> f64 {
    scenario.total_load().length()
}

fn largest_tip_force(scenario: &Scenario, weight: f64) -> f64 {
    let rods = scenario.rods.iter();
    let axial: f64 = rods.map(|rod| rod.force_stiffness[0].min()).sum();
    let together = if scenario.joined {
        scenario.rods.len()
    } else {
        1
    } as f64;
    let stiff = LARGEST_PUSH.bending * together * scenario.scale().force();
    (stiff + LARGEST_PUSH.weight * weight)
        .min(LARGEST_PUSH.axial_strain * axial * together / scenario.rods.len() as f64)
}

/// Veins at rest are each other's mirror images within this part of the leaf's length, and within
/// this angle (radians), or the error of the leaf: the rounding of the softest of leaves.
const MIRROR_IMAGE_TOLERANCE: f64 = 1e-9;

/// Whether the leaf at rest is its own mirror image in the plane y = 0.
fn is_mirror_symmetric(scenario: &Scenario, rest: &Equilibrium) -> bool {
    let error = rest.accuracy.error_estimate.unwrap_or_default();
    let angle = MIRROR_IMAGE_TOLERANCE.max(error / rest.shape.longest());
    let distance = angle * rest.shape.longest();
    is_mirrored(scenario) && are_mirror_symmetric(&rest.shape.rods, distance, angle)
}

/// The directions of the pushes: none if all tips are held; for a mirror-symmetric leaf only the
/// first of two that are mirror images.
fn tip_force_directions(scenario: &Scenario, rest: &Equilibrium) -> Vec<AxisDirection> {
    if scenario.holds_all_tips() {
        return Vec::new();
    }
    // Veins that turn without resistance turn towards any push across their axis.
    let turnings = match rest.stability.neutral_directions {
        0 => Vec::new(),
        _ => scenario.zero_energy_rotations(),
    };
    let along = |direction: &AxisDirection| {
        // What only spins turns towards nothing.
        let axes = turnings.iter().map(|it| it.axis.to_array());
        let mut axes = axes.filter(|axis| *axis != [0.0; 3]);
        axes.all(|axis| (axis[direction.axis].abs() - 1.0).abs() < MIRROR_IMAGE_TOLERANCE)
    };
    let mirrored = [
        false,
        is_mirror_symmetric(scenario, rest),
        rest.model.planar,
    ];
    let own = |direction: &AxisDirection| !(direction.negative && mirrored[direction.axis]);
    AxisDirection::all().filter(own).filter(along).collect()
}

/// Adds the mirror images of pushes whose mirror image was not computed.
fn add_mirrored_forces(pushes: &mut Vec<CriticalTipForce>, rods: usize) {
    let has = |other: AxisDirection| pushes.iter().any(|push| push.direction == other);
    let alone = pushes.iter().filter(|push| !has(push.direction.opposite()));
    let images: Vec<CriticalTipForce> = alone
        .map(|push| {
            let axis = push.direction.axis;
            let mut image = push.clone();
            image.direction = push.direction.opposite();
            image.mirrored = true;
            let behind = image.neighbour.iter_mut().map(|it| &mut it.tip);
            let tips = image.tips.iter_mut().chain(behind);
            tips.for_each(|tip| tip[axis] = -tip[axis]);
            if axis == 1 && image.tips.len() == rods {
                image.tips.reverse();
            }
            image
        })
        .collect();
    pushes.extend(images);
}

/// Rounding error of a critical force.
struct ForceRounding {
    /// Relative to the force itself.
    relative: f64,
    /// Of a nearly rigid leaf, relative to the total force on its tip: in eight runs of a buckled
    /// column it was at most 9e-10.
    nearly_rigid: f64,
}

const FORCE_ROUNDING_ERROR: ForceRounding = ForceRounding {
    relative: 1e-14,
    nearly_rigid: 3e-9,
};

/// The force at which a leaf loses its stability, with start points for saddle searches there.
struct PushedLeaf {
    force: CriticalTipForce,
    starts: Vec<SaddleSearchStart>,
}

/// Pushes a leaf in one direction until it loses its stability, or to the largest push.
fn find_critical_tip_force(
    stable: &StableLeaf,
    direction: AxisDirection,
    weight: f64,
) -> PushedLeaf {
    let make = |[force]: [f64; 1]| -> Result<Scenario, String> {
        let mut scenario = stable.scenario.clone();
        scenario.tip_force[direction.axis] += direction.sign() * force;
        Ok(scenario)
    };
    let unknown = CriticalTipForce {
        direction,
        ..CriticalTipForce::default()
    };
    let failed = |why: CriticalTipForceRemark| PushedLeaf {
        force: CriticalTipForce {
            more_than: Some(0.0),
            remark: Some(why),
            ..unknown.clone()
        },
        starts: Vec::new(),
    };
    let family = match LeafFamily::new(&make, [0.0, stable.largest_force], false) {
        Ok(family) => family,
        Err(out) => return failed(branch_lost(&out)),
    };
    let mut grids = NestedBranchEquations::new(&family, stable.grid.clone());
    let followed = match continue_to_stability_loss(stable, direction, &mut grids) {
        Ok(followed) => followed,
        Err(stuck) => return failed(branch_lost(&stuck)),
    };
    let critical = followed.branch.critical.iter().zip(&followed.critical);
    let lost = |critical: &CriticalPoint| critical.indices[0] == 0 && critical.indices[1] > 0;
    let Some(((_, critical), refined)) = critical.into_iter().find(|((_, it), _)| lost(it)) else {
        return PushedLeaf {
            force: force_without_stability_loss(stable, &followed, unknown),
            starts: Vec::new(),
        };
    };
    let force = refined.fraction * stable.largest_force;
    let then = postcritical_behavior(stable, &mut grids, critical);
    let starts = saddle_search_starts(&mut grids, critical);
    let error =
        refined.fraction_error * stable.largest_force + force_rounding_error(stable, force, weight);
    if 2.0 * error >= force {
        let below = force + error;
        return PushedLeaf {
            starts,
            ..failed(CriticalTipForceRemark::NearZero { below })
        };
    }
    let force = CriticalTipForce {
        kind: match critical.kind {
            CriticalKind::Fold => InstabilityKind::Fold,
            CriticalKind::Branching => InstabilityKind::BranchPoint,
        },
        force: Some(force),
        error: Some(error),
        per_weight: (weight > 0.0).then(|| force / weight),
        then: Some(then),
        neighbour: equilibrium_beyond_fold(stable, &mut grids, critical, refined, &starts),
        tips: family.tips(&refined.tips),
        ..unknown
    };
    PushedLeaf { force, starts }
}

fn force_rounding_error(stable: &StableLeaf, force: f64, weight: f64) -> f64 {
    let rods = stable.scenario.rods.iter();
    let stiffness = rods.flat_map(|rod| &rod.force_stiffness);
    let stiffest = stiffness.fold(0.0, |most: f64, it| most.max(it.max_abs()));
    let rigid = stiffest > NEARLY_RIGID * stable.scenario.scale().force();
    let borne = force + weight + DVec3::from_array(stable.scenario.tip_force).length();
    FORCE_ROUNDING_ERROR.relative * force
        + if rigid {
            FORCE_ROUNDING_ERROR.nearly_rigid * borne
        } else {
            0.0
        }
}

/// The branch of a push, until it is known to have lost its stability.
fn continue_to_stability_loss(
    stable: &StableLeaf,
    direction: AxisDirection,
    grids: &mut NestedBranchEquations,
) -> Result<VerifiedBranch, CorrectorFailure> {
    let mut first = (grids.on_grid_of(&stable.state)).correct(&stable.state, 0.0, None)?;
    first.tangent = first.tangent.towards_larger_parameter();
    let enough = |points: &[EquilibriumPoint]| {
        let behind = points.len().checked_sub(PUSH_BRANCH.confirming_points);
        behind.is_some_and(|behind| points[behind].index > 0) || stable.limit.reached()
    };
    let nodes = stable.state.rods() * stable.grid.segments();
    let walk = ContinuationOptions {
        longest_step: PUSH_BRANCH.longest_step,
        max_points: PUSH_BRANCH.most_points,
        critical_grids: PUSH_BRANCH.critical_grids[usize::from(nodes > PUSH_BRANCH.few_nodes)],
        stop_criterion: Some(&enough),
        points_per_verification: PUSH_BRANCH.points_per_verification,
    };
    let mut report = |_, fraction: f64| {
        let push = (direction, fraction * stable.largest_force);
        stable.searches.report(Some(push));
    };
    Ok(grids.follow(first, &walk, stable.accuracy, &mut report))
}

/// The result of a push under which the leaf was stable as far as it was followed.
fn force_without_stability_loss(
    stable: &StableLeaf,
    followed: &VerifiedBranch,
    unknown: CriticalTipForce,
) -> CriticalTipForce {
    let points = followed.branch.points.iter().zip(&followed.points);
    let stably = points.take_while(|(point, _)| point.index == 0);
    let furthest = stably.fold(0.0, |most: f64, (_, refined)| most.max(refined.fraction));
    let reached = matches!(followed.end, BranchEnd::RangeEndReached);
    CriticalTipForce {
        kind: match reached {
            true => InstabilityKind::NoneUpTo,
            false => InstabilityKind::Unknown,
        },
        more_than: Some(furthest * stable.largest_force),
        remark: match &followed.end {
            BranchEnd::RangeEndReached => None,
            _ if stable.limit.reached() => Some(CriticalTipForceRemark::OutOfTime),
            BranchEnd::StepFailed(stuck) => Some(branch_lost(stuck)),
            BranchEnd::PointUnverified(doubt) => Some(branch_lost(doubt)),
            BranchEnd::LoopClosed
            | BranchEnd::RangeStartReached
            | BranchEnd::KnownBoundaryMet
            | BranchEnd::PointLimitReached
            | BranchEnd::StopCriterionMet
            | BranchEnd::StabilityLost
            | BranchEnd::RunLimitReached => Some(CriticalTipForceRemark::NotFollowed),
        },
        ..unknown
    }
}

fn branch_lost(why: &impl ToString) -> CriticalTipForceRemark {
    CriticalTipForceRemark::BranchLost(why.to_string())
}

/// What the leaf does at a critical point: if a stable branch crosses, it continues
/// along that.
fn postcritical_behavior(
    stable: &StableLeaf,
    grids: &mut NestedBranchEquations,
    critical: &CriticalPoint,
) -> PostcriticalBehavior {
    if critical.kind == CriticalKind::Fold {
        return PostcriticalBehavior::Snaps;
    }
    let branches = switch_branches(grids.on_grid_of(&critical.state), critical, stable.accuracy);
    match branches.iter().any(|point| point.index == 0) {
        true => PostcriticalBehavior::BendsAside,
        false => PostcriticalBehavior::Snaps,
    }
}

/// The equilibrium to which the leaf falls from a fold, under the force there.
fn equilibrium_beyond_fold(
    stable: &StableLeaf,
    grids: &mut NestedBranchEquations,
    critical: &CriticalPoint,
    fold: &ExtrapolatedPoint,
    starts: &[SaddleSearchStart],
) -> Option<Neighbour> {
    let start = starts
        .first()
        .filter(|_| critical.kind == CriticalKind::Fold)?;
    let equations = grids.on_grid_of(&critical.state);
    let stop = || stable.limit.reached();
    let fallen = equations.descend(&critical.state, critical.fraction, &start.direction, &stop);
    let family = equations.leaves.family;
    let state = match fallen {
        Ok(point) => point.state,
        // Not reached by the descent: relax from its last state.
        Err(state) => {
            let leaf = family.leaf([fold.fraction]).ok()?;
            relax_from_state(&leaf, &start.grid, state, stable.limit)?
        }
    };
    let point = equations.correct(&state, fold.fraction, None);
    let point = point.ok().filter(|point| point.index == 0)?;
    let rest = verify_at_parameter(family, &start.grid, &point, stable.accuracy).ok()?;
    let scale = family.scale();
    Some(Neighbour {
        energy: rest.energy * scale.moment(),
        tip: *rest.tips.first()? * scale.length,
    })
}

/// Start points for saddles at a critical point, along its neutral modes: at a fold
/// onwards, at a branch point on both sides.
fn saddle_search_starts(
    grids: &mut NestedBranchEquations,
    critical: &CriticalPoint,
) -> Vec<SaddleSearchStart> {
    let equations = grids.on_grid_of(&critical.state);
    let along = |mode| equations.mass_product(mode, &critical.tangent.increments);
    let mut signs = vec![1.0, -1.0];
    if critical.kind == CriticalKind::Fold {
        signs = vec![along(&critical.modes[0]).signum()];
    }
    let start = |sign| SaddleSearchStart {
        grid: equations.grid().clone(),
        state: critical.state.clone(),
        direction: scale_field(&critical.modes[0], sign),
    };
    signs.into_iter().map(start).collect()
}
