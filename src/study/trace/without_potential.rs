//! `trace` where loads turn with the section, or wind acts: there is no index to follow, and what ends
//! stability are flutter and divergence of the linearised motion.

use crate::branch::{
    LeafFamily, MotionBranch, MotionBranchPoint, MotionContinuation, ParameterRange,
};
use crate::relax::balanced::told_with_small_motions;
use crate::relax::{
    AssumedMotion, DominantMotion, MotionInstability, Options, RelaxError, check_segments,
    relax_on_grids,
};
use crate::run::{Instant, UnmodelledFeature};
use crate::scenario::Scenario;
use crate::study::remark::{BranchRemark, TraceRemark};
use crate::study::trace::result::{PointKind, PointMotion, Trace, TraceBranch, TracePoint};
use crate::study::trace::{
    LONGEST_BRANCH_STEP, TraceError, TraceRequest, TraceUntil, force_displacement_line,
};

/// Segments of the grid on which a branch is followed, at least, if none are requested.
const LEAST_SEGMENTS: usize = 4;

impl TraceRequest {
    /// Whether forces without a potential act at the ends of the range, or in the scenario itself.
    pub(super) fn lacks_potential(&self) -> bool {
        let acts = |scenario: &Scenario| scenario.wind.is_some() || scenario.has_followers();
        let at = |value: f64| {
            let there = self.base.scenario_with_values(&[(&self.vary.keys, value)]);
            there.is_ok_and(|it| acts(&it.scenario))
        };
        acts(self.base.scenario()) || self.vary.ends().into_iter().any(at)
    }

    /// Refuses what is told of branches with a potential alone.
    pub(super) fn validate_without_potential(&self) -> Result<(), TraceError> {
        let what = match (self.switch, self.keep_unstable) {
            (true, _) => "following branches that cross",
            (_, true) => "a start at an equilibrium of any index",
            _ => return Ok(()),
        };
        Err(match self.base.scenario().wind {
            Some(_) => RelaxError::from(UnmodelledFeature::Wind { what }).into(),
            None => RelaxError::from(UnmodelledFeature::Followers { what }).into(),
        })
    }
}

/// Follows the equilibrium of a scenario under loads without a potential through one of its numbers.
pub(super) fn trace_without_potential(
    request: &TraceRequest,
    progress: &mut dyn FnMut(usize, usize, f64),
) -> Result<Trace, TraceError> {
    let clock = Instant::now();
    let (keys, vary) = (&request.vary.keys, &request.vary);
    let ends = vary.ends();
    request.check_ends()?;
    let make = |[value]: [f64; 1]| -> Result<Scenario, String> {
        let at = request.base.scenario_with_values(&[(keys, value)]);
        Ok(at.map_err(|refused| refused.to_string())?.scenario)
    };
    let family = LeafFamily::new(&make, ends, vary.log);
    let family = family.map_err(|out| TraceError::Vary(format!("{keys}: {out}")))?;
    let family = family.with_limit(request.limit.clone());
    let scenario = request
        .base
        .scenario_with_values(&[(keys, ends[0])])?
        .scenario;
    let tolerance = request.tolerance.unwrap_or(scenario.tolerance);
    let options = Options {
        limit: request.limit.clone(),
        tolerance: Some(tolerance),
        ..Options::default()
    };
    let segments = request
        .segments
        .map(|wanted| check_segments(family.first_leaf(), Some(wanted), LEAST_SEGMENTS))
        .transpose()?;
    let relaxed = relax_on_grids(&scenario, &options, false, &mut |_| {})?;
    let rests = relaxed.result.outcome.is_at_rest();
    let remark = (!rests).then(|| TraceRemark::NoEquilibrium {
        keys: keys.clone(),
        value: ends[0],
        remark: relaxed.result.remark.clone(),
    });
    let mut trace = Trace {
        segments: segments.unwrap_or(0),
        until: request.until,
        remark,
        assumed: Some(AssumedMotion {
            uniform_density: false,
            no_rotary_inertia: false,
            no_damping: false,
        }),
        ..Trace::before_first_point(&scenario, vary, tolerance)
    };
    if rests {
        let first = told_with_small_motions(family.first_leaf(), &options, tolerance, relaxed);
        let motions = &first.result.stability.small_motions;
        if let Some(motions) = motions {
            trace.assumed = Some(motions.assumed);
        }
        let continuation = MotionContinuation {
            options: &options,
            tolerance,
            longest: (1.0 / (vary.values.len() - 1) as f64).min(LONGEST_BRANCH_STEP),
            most_points: request.most_points,
            until_unstable: request.until == Some(TraceUntil::Unstable),
            segments,
        };
        let first = MotionBranchPoint::regular(0.0, first);
        let branch = continuation.follow(&family, first, &mut |points, fraction| {
            progress(0, points, family.value(fraction));
        });
        let finest = (branch.points.iter()).map(MotionBranchPoint::finest_segments);
        trace.segments = finest.fold(0, usize::max);
        trace.factorizations = (branch.points.iter())
            .map(|point| point.leaf.work.factorizations)
            .sum();
        trace
            .branches
            .push(branch_in_scenario_units(request, &family, &branch));
        if branch.end == crate::branch::BranchEnd::RunLimitReached {
            trace.remark = Some(TraceRemark::Stopped);
        }
    }
    let branches = &trace.branches;
    trace.complete =
        trace.remark.is_none() && branches.iter().all(|branch| branch.end.is_complete());
    trace.law = branches
        .first()
        .and_then(|branch| force_displacement_line(request, branch));
    trace.wall_seconds = clock.elapsed().as_secs_f64();
    Ok(trace)
}

/// A branch in the scenario's units.
fn branch_in_scenario_units(
    request: &TraceRequest,
    family: &LeafFamily,
    branch: &MotionBranch,
) -> TraceBranch {
    let mut points: Vec<TracePoint> = Vec::new();
    for point in &branch.points {
        let before = points.last().map_or(0, |it| it.index);
        let number = points.len() + 1;
        points.push(trace_point(request, family, point, number, before));
    }
    let unlocated = branch.unlocated.map(|after| {
        let near = family.value(branch.points[after].fraction);
        BranchRemark::CriticalPointNotLocated {
            value: request.vary.keys.text(near),
        }
    });
    TraceBranch {
        from: None,
        points,
        end: branch.end.clone(),
        remarks: unlocated
            .into_iter()
            .chain(branch.end.failure_remark())
            .collect(),
    }
}

/// A point in the scenario's units; `before` is the number of roots with growth at the one before it.
fn trace_point(
    request: &TraceRequest,
    family: &LeafFamily,
    point: &MotionBranchPoint,
    number: usize,
    before: usize,
) -> TracePoint {
    let range = ParameterRange {
        ends: request.vary.ends(),
        log: request.vary.log,
    };
    let value = family.value(point.fraction);
    let leaf = &point.leaf;
    let motions = &leaf.stability.small_motions;
    let unstable_roots = point.unstable_roots();
    let dominant = match &point.critical {
        Some(critical) => Some(DominantMotion {
            growth_rate: 0.0,
            frequency: critical.frequency,
            error: critical.frequency_error,
        }),
        None => motions.as_ref().and_then(|it| it.dominant),
    };
    TracePoint {
        point: number,
        kind: match &point.critical {
            None => PointKind::Regular,
            Some(critical) => match critical.kind {
                MotionInstability::Flutter => PointKind::Flutter,
                MotionInstability::Divergence => PointKind::Divergence,
            },
        },
        value,
        value_error: point.critical.and_then(|critical| {
            let error = critical.fraction_error?;
            let above = critical.fraction + error;
            Some((crate::branch::value_at_fraction(range.ends, range.log, above) - value).abs())
        }),
        tips: leaf.tips.clone(),
        reaction: leaf.reaction.as_ref().map(|it| it.force),
        grip_reactions: leaf.grip_reactions.iter().map(|it| it.force).collect(),
        error: leaf.accuracy.error_estimate,
        energy: leaf.energy.unwrap_or(f64::NAN),
        index: unstable_roots.unwrap_or(before),
        critical_mode_axis: None,
        critical_mode: None,
        branching: None,
        motion: Some(PointMotion {
            unstable_roots,
            dominant,
        }),
        undulation: leaf.undulation.clone(),
        stations: leaf.shape.stations.clone(),
        curves: (leaf.shape.rods.iter())
            .map(|rod| rod.nodes.iter().map(|node| node.position).collect())
            .collect(),
    }
}
