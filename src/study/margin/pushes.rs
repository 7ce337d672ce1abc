//! The force at the tip at which a leaf loses its stability.

use glam::DVec3;

use super::{Stable, StartPoint};
use crate::branch::{
    Critical, End, Family, Followed, Grids, Kind, NEARLY_RIGID, Point, Refined, Stuck, Walk,
    refine_at, switch, times,
};
use crate::numbers::power_of_ten;
use crate::relax::settle::settle_from::settle_from;
use crate::relax::{Direction, Fate, Loss, Neighbour, Push};
use crate::scenario::Scenario;

/// Longest step along the branch, and largest number of points.
const LONGEST: f64 = 0.1;
const MOST_POINTS: usize = 400;

/// Points after the loss of stability that are needed to confirm it.
const CONFIRMING: usize = 2;

/// Grids of a critical point: for a leaf of few nodes, and for others.
const CRITICAL_GRIDS: [usize; 2] = [4, 3];
const FEW_NODES: usize = 500;

/// Rounding error of a force, relative to itself, and for a nearly rigid leaf relative to the
/// total force on its tip: in eight runs of a buckled column it was at most 9e-10.
const ROUNDING: f64 = 1e-14;
const OF_RIGID: f64 = 3e-9;

/// Pushes a leaf in one direction until it loses its stability, or to the largest push;
/// also returns start points for saddle searches there.
pub(super) fn push(stable: &Stable, direction: Direction, weight: f64) -> (Push, Vec<StartPoint>) {
    let make = |[force]: [f64; 1]| -> Result<Scenario, String> {
        let mut scenario = stable.scenario.clone();
        scenario.tip_force[direction.axis] += direction.sign() * force;
        Ok(scenario)
    };
    let unknown = Push {
        direction,
        ..Push::default()
    };
    let failed = |why: String| Push {
        more_than: Some(0.0),
        remark: Some(why),
        ..unknown.clone()
    };
    let family = match Family::new(&make, [0.0, stable.largest], false) {
        Ok(family) => family,
        Err(out) => return (failed(out.to_string()), Vec::new()),
    };
    let mut grids = Grids::new(&family, stable.grid.clone());
    let followed = match follow(stable, direction, &mut grids) {
        Ok(followed) => followed,
        Err(stuck) => return (failed(stuck.to_string()), Vec::new()),
    };
    let critical = followed.branch.critical.iter().zip(&followed.critical);
    let lost = |critical: &Critical| critical.indices[0] == 0 && critical.indices[1] > 0;
    let Some(((_, critical), refined)) = critical.into_iter().find(|((_, it), _)| lost(it)) else {
        return (not_lost(stable, &followed, unknown), Vec::new());
    };
    let force = refined.fraction * stable.largest;
    let then = fate(stable, &mut grids, critical);
    let starts = starts(&mut grids, critical);
    let error = refined.fraction_error * stable.largest + rounding(stable, force, weight);
    if 2.0 * error >= force {
        let below = power_of_ten(force + error);
        let unknown = failed(format!("its loss, below {below}, cannot be told from zero"));
        return (unknown, starts);
    }
    let push = Push {
        kind: match critical.kind {
            Kind::Fold => Loss::Fold,
            Kind::Branching => Loss::BranchPoint,
        },
        force: Some(force),
        error: Some(error),
        per_weight: (weight > 0.0).then(|| force / weight),
        then: Some(then),
        neighbour: rest_after_fold(stable, &mut grids, (critical, refined), &starts),
        tips: family.tips(&refined.tips),
        ..unknown
    };
    (push, starts)
}

fn rounding(stable: &Stable, force: f64, weight: f64) -> f64 {
    let rods = stable.scenario.rods.iter();
    let stiffness = rods.flat_map(|rod| &rod.force_stiffness);
    let stiffest = stiffness.fold(0.0, |most: f64, it| most.max(it.max_abs()));
    let rigid = stiffest > NEARLY_RIGID * stable.scenario.scale().force();
    let borne = force + weight + DVec3::from_array(stable.scenario.tip_force).length();
    ROUNDING * force + if rigid { OF_RIGID * borne } else { 0.0 }
}

/// The branch of a push, until it is known to have lost its stability.
fn follow(stable: &Stable, direction: Direction, grids: &mut Grids) -> Result<Followed, Stuck> {
    let mut first = (grids.of(&stable.state)).correct(&stable.state, 0.0, None)?;
    first.tangent = first.tangent.growing();
    let enough = |points: &[Point]| {
        let behind = points.len().checked_sub(CONFIRMING);
        behind.is_some_and(|behind| points[behind].index > 0) || stable.limit.reached()
    };
    let nodes = stable.state.rods() * stable.grid.segments();
    let walk = Walk {
        longest: LONGEST,
        most: MOST_POINTS,
        critical_grids: CRITICAL_GRIDS[usize::from(nodes > FEW_NODES)],
        enough: Some(&enough),
    };
    let mut report = |_, fraction: f64| {
        let push = (direction, fraction * stable.largest);
        stable.searches.report(Some(push));
    };
    Ok(grids.follow(first, &walk, stable.accuracy, &mut report))
}

/// The result of a push under which the leaf was stable as far as it was followed.
fn not_lost(stable: &Stable, followed: &Followed, unknown: Push) -> Push {
    let points = followed.branch.points.iter().zip(&followed.points);
    let stably = points.take_while(|(point, _)| point.index == 0);
    let furthest = stably.fold(0.0, |most: f64, (_, refined)| most.max(refined.fraction));
    let reached = matches!(followed.end, End::Reached);
    Push {
        kind: match reached {
            true => Loss::NoneUpTo,
            false => Loss::Unknown,
        },
        more_than: Some(furthest * stable.largest),
        remark: match &followed.end {
            End::Reached => None,
            _ if stable.limit.reached() => Some("the time allowed was over".into()),
            End::Stuck(stuck) => Some(stuck.to_string()),
            End::Unverified(doubt) => Some(doubt.to_string()),
            End::Closed
            | End::Returned
            | End::Met
            | End::MostPoints
            | End::Enough
            | End::Unstable
            | End::Stopped => Some("the branch could not be followed further".into()),
        },
        ..unknown
    }
}

/// What the leaf does at a critical point: if a stable branch crosses, it continues
/// along that.
fn fate(stable: &Stable, grids: &mut Grids, critical: &Critical) -> Fate {
    if critical.kind == Kind::Fold {
        return Fate::Snaps;
    }
    let branches = switch(grids.of(&critical.state), critical, stable.accuracy);
    match branches.iter().any(|point| point.index == 0) {
        true => Fate::BendsAside,
        false => Fate::Snaps,
    }
}

/// The equilibrium to which the leaf falls from a fold, under the force there.
fn rest_after_fold(
    stable: &Stable,
    grids: &mut Grids,
    (critical, fold): (&Critical, &Refined),
    starts: &[StartPoint],
) -> Option<Neighbour> {
    let start = starts.first().filter(|_| critical.kind == Kind::Fold)?;
    let equations = grids.of(&critical.state);
    let stop = || stable.limit.reached();
    let fallen = equations.descend(&critical.state, critical.fraction, &start.direction, &stop);
    let family = equations.leaves.family;
    let state = match fallen {
        Ok(point) => point.state,
        // Not reached by the descent: relax from its last state.
        Err(state) => {
            let leaf = family.leaf([fold.fraction]).ok()?;
            settle_from(&leaf, &start.grid, state, stable.limit)?
        }
    };
    let point = equations.correct(&state, fold.fraction, None);
    let point = point.ok().filter(|point| point.index == 0)?;
    let rest = refine_at(family, &start.grid, &point, stable.accuracy).ok()?;
    let scale = family.scale();
    Some(Neighbour {
        energy: rest.energy * scale.moment(),
        tip: *rest.tips.first()? * scale.length,
    })
}

/// Start points for saddles at a critical point, along its neutral modes: at a fold
/// onwards, at a branch point on both sides.
fn starts(grids: &mut Grids, critical: &Critical) -> Vec<StartPoint> {
    let equations = grids.of(&critical.state);
    let along = |mode| equations.product(mode, &critical.tangent.increments);
    let mut signs = vec![1.0, -1.0];
    if critical.kind == Kind::Fold {
        signs = vec![along(&critical.modes[0]).signum()];
    }
    let start = |sign| StartPoint {
        grid: equations.grid().clone(),
        state: critical.state.clone(),
        direction: times(&critical.modes[0], sign),
    };
    signs.into_iter().map(start).collect()
}
