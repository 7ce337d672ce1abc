//! `trace`: an equilibrium followed through a parameter of its scenario.
//!
//! Branches that cross at critical points are followed as well, breadth first, if that is requested.
//! Where the parameter is a force on the tip, or a coordinate of a held one, the trace tells the stiffness
//! that a tensile test would measure ([`ForceDisplacementLine`]).

pub(super) mod result;
mod without_potential;

use crate::branch::{
    BranchEnd, BranchingKind, ContinuationOptions, CriticalKind, CriticalPoint, EquilibriumPoint,
    ExtrapolatedPoint, LeafFamily, NestedBranchEquations, ParameterRange, VerifiedBranch,
    begin_branch, switch_branches,
};
use crate::leaf::{BucklingMode, Grid, Leaf, NodalField, displacement_part};
use crate::memory;
use crate::relax::{
    Equilibrium, Event, Options, RelaxError, SemiImplicit, StabilityLoss, check_natural_tips,
    check_segments, relax, without_wind_or_followers,
};
use crate::run::{Instant, Limit, RefusedOption};
use crate::scenario::{EntryPath, Key, Scenario};
use crate::shape::Undulation;
use crate::study::remark::{BranchRemark, TraceRemark};
use crate::study::trace::result::{ForceDisplacementLine, LoadedTip, TraceUntil};
pub use crate::study::trace::result::{PointKind, Trace, TraceBranch, TracePoint};
use crate::study::trace::without_potential::trace_without_potential;
use crate::study::vary::{BaseScenario, ParameterKeys, ParameterSweep};
use crate::study::{VariableTarget, VaryError};
use glam::DVec3;
use serde::Serializer;
use std::collections::VecDeque;

/// Largest number of branches of a trace.
pub const MOST_BRANCHES: usize = 24;

/// Default for the largest number of points of a branch.
pub const MOST_POINTS: usize = 2000;

/// A request for a trace.
#[derive(Clone, Debug)]
pub struct TraceRequest {
    /// The scenario.
    pub base: BaseScenario,
    /// The number that varies, with its range; a leaf that does not change would be followed
    /// in as many steps as it has values.
    pub vary: ParameterSweep,
    /// Whether to follow crossing branches as well.
    pub switch: bool,
    /// What ends a branch before the end of the range, if anything.
    pub until: Option<TraceUntil>,
    /// Whether to take the first equilibrium from Newton's method, stable or not.
    pub keep_unstable: bool,
    /// The grid on which the branch is followed; default: twice as fine as the
    /// coarsest on which the first equilibrium was found.
    pub segments: Option<usize>,
    /// Required accuracy of the tips, relative to the longest rod; default: the scenario's.
    pub tolerance: Option<f64>,
    /// Largest number of points of a branch.
    pub most_points: usize,
    /// When the run ends; what is known of the branches then is its result.
    pub limit: Limit,
}

/// Why a trace cannot be made.
#[derive(Debug, thiserror::Error)]
pub enum TraceError {
    /// The number cannot be followed.
    #[error("{0}")]
    Vary(String),
    /// An option has a value it cannot have.
    #[error("{0}")]
    Option(#[from] RefusedOption),
    /// The scenario at the start of the range is invalid.
    #[error(transparent)]
    Scenario(#[from] VaryError),
    /// The request for the first equilibrium cannot be met.
    #[error(transparent)]
    Relax(#[from] RelaxError),
    /// No leaf at an end of the range can come to rest.
    #[error("{keys} = {value}: {why}")]
    End {
        /// What varies.
        keys: ParameterKeys,
        /// The value at that end, as it is written.
        value: String,
        /// Why.
        why: RelaxError,
    },
}

impl TraceRequest {
    /// Refuses a range at an end of which there is no scenario, or none whose leaf can come to rest: what the
    /// branch would meet there is known before it is followed.
    fn check_ends(&self) -> Result<(), TraceError> {
        let keys = &self.vary.keys;
        for value in self.vary.ends() {
            let there = self.base.scenario_with_values(&[(keys, value)])?;
            check_natural_tips(&there.scenario).map_err(|why| TraceError::End {
                keys: keys.clone(),
                value: keys.text(value),
                why,
            })?;
        }
        Ok(())
    }

    /// Validates the request before it is run.
    pub(super) fn validate(&self) -> Result<(), TraceError> {
        let keys = &self.vary.keys;
        let lacks_potential = self.lacks_potential();
        let refuse = |why: &str| TraceError::Vary(format!("{keys}: {why}"));
        if keys.is_whole() {
            return Err(refuse(
                "a whole number has nothing between its values to follow",
            ));
        }
        for target in keys.targets() {
            let why = match target {
                VariableTarget::Knob(_) => "is a setting of a method, not of the leaf",
                VariableTarget::Entry(part) => match part.key {
                    Key::TipMoment => DEAD_MOMENT_REFUSAL,
                    Key::Tolerance => "changes no leaf",
                    Key::Density if self.base.scenario().g != [0.0; 3] => continue,
                    key if lacks_potential && changes_small_motions(key) => continue,
                    key if ["dynamics.", "wind."]
                        .iter()
                        .any(|it| key.path().starts_with(it)) =>
                    {
                        "changes a motion, but no equilibrium"
                    }
                    _ => continue,
                },
            };
            return Err(refuse(why));
        }
        if self.vary.values.len() < 2 {
            return Err(refuse("FROM and TO are the same"));
        }
        if self.base.scenario().has_moments() {
            return Err(refuse(DEAD_MOMENT_REFUSAL));
        }
        if lacks_potential {
            self.validate_without_potential()?;
        }
        if self.most_points < 2 {
            return Err(RefusedOption::new("points", self.most_points, "must be 2 or more").into());
        }
        Ok(())
    }
}

/// Whether a number of a motion decides on the stability of an equilibrium without a potential, or on the
/// equilibrium itself.
fn changes_small_motions(key: Key) -> bool {
    key.path().starts_with("wind.")
        || matches!(
            key,
            Key::Density
                | Key::RotaryInertia
                | Key::RotaryInertia3
                | Key::ExternalDamping
                | Key::InternalDamping
        )
}

const DEAD_MOMENT_REFUSAL: &str = "a dead moment (load.tip_moment, load.point.moment) has no potential: there is no index to follow; use loads that have";

/// Longest step along a branch, or along a curve of a boundary, if few values are asked for, as a part
/// of the range.
pub(super) const LONGEST_BRANCH_STEP: f64 = 0.1;

/// Points closer than this (fractions of the range, lengths) are the same.
const SAME_POINT_DISTANCE: f64 = 1e-5;

/// Follows the equilibrium of a scenario through one of its numbers. `progress` is
/// called for each point: with the branch, the number of points, and the value.
///
/// # Errors
/// Requests that cannot be met; failures during the run are part of the result.
pub fn trace(
    request: &TraceRequest,
    progress: &mut dyn FnMut(usize, usize, f64),
) -> Result<Trace, TraceError> {
    Ok(trace_with_points(request, progress)?.trace)
}

/// Follows the equilibrium through a given leaf at rest, which the scenario has at this value of its
/// number, towards both ends of the range, as two branches, of which the first goes to larger fractions.
///
/// # Errors
/// Requests that cannot be met; failures during the run are part of the result.
pub fn trace_through(
    request: &TraceRequest,
    leaf: (&Equilibrium, f64),
    progress: &mut dyn FnMut(usize, usize, f64),
) -> Result<Trace, TraceError> {
    Ok(trace_with_points_from(request, Some(leaf), progress)?.trace)
}

/// A point of a branch, and a grid that refines its own.
pub struct PointOnGrid {
    pub point: EquilibriumPoint,
    pub grid: Grid,
}

/// A critical point on the grid on which it was found, and extrapolated over grids.
pub struct RefinedCriticalPoint {
    pub critical: CriticalPoint,
    pub refined: ExtrapolatedPoint,
}

/// A trace, with its first point and its critical points.
pub struct TraceWithPoints {
    pub trace: Trace,
    /// None if there is no first equilibrium.
    pub first_point: Option<PointOnGrid>,
    pub critical_points: Vec<RefinedCriticalPoint>,
}

/// As [`trace`], with the first point and the critical points.
pub fn trace_with_points(
    request: &TraceRequest,
    progress: &mut dyn FnMut(usize, usize, f64),
) -> Result<TraceWithPoints, TraceError> {
    trace_with_points_from(request, None, progress)
}

/// The trace from a relaxation at the start of the range, or both ways from a given leaf.
fn trace_with_points_from(
    request: &TraceRequest,
    given: Option<(&Equilibrium, f64)>,
    progress: &mut dyn FnMut(usize, usize, f64),
) -> Result<TraceWithPoints, TraceError> {
    request.validate()?;
    if request.lacks_potential() {
        if given.is_some() {
            without_wind_or_followers(request.base.scenario(), "following a branch both ways")?;
        }
        return Ok(TraceWithPoints {
            trace: trace_without_potential(request, progress)?,
            first_point: None,
            critical_points: Vec::new(),
        });
    }
    let clock = Instant::now();
    let (keys, vary) = (&request.vary.keys, &request.vary);
    let ends = vary.ends();
    let make = |[value]: [f64; 1]| -> Result<Scenario, String> {
        let at = request.base.scenario_with_values(&[(keys, value)]);
        Ok(at.map_err(|refused| refused.to_string())?.scenario)
    };
    request.check_ends()?;
    let family = LeafFamily::new(&make, ends, vary.log);
    let family = family.map_err(|out| TraceError::Vary(format!("{keys}: {out}")))?;
    let family = family.with_limit(request.limit.clone());
    let value = given.map_or(ends[0], |(_, value)| value);
    let scenario = request
        .base
        .scenario_with_values(&[(keys, value)])?
        .scenario;
    let tolerance = request.tolerance.unwrap_or(scenario.tolerance);
    let last = request
        .base
        .scenario_with_values(&[(keys, ends[1])])?
        .scenario;
    let bias_direction = total_load(&last) - total_load(&scenario);
    let options = Options {
        limit: request.limit.clone(),
        tolerance: Some(tolerance),
        bias_direction,
        method: SemiImplicit {
            keep_unstable: request.keep_unstable,
            ..SemiImplicit::default()
        }
        .into(),
        ..Options::default()
    };
    let rest = match given {
        Some((leaf, _)) => leaf.clone(),
        None => on_side_of_range(
            &scenario,
            first_equilibrium(&scenario, &options, request.keep_unstable)?,
            bias_direction,
        ),
    };
    let fraction = ParameterRange {
        ends,
        log: vary.log,
    }
    .fraction(value);
    let check = |least| checked_segments(&family, request.segments, least);
    let wanted = request.segments.map(check).transpose()?;
    let mut trace = Trace {
        segments: wanted.unwrap_or(2 * (rest.shape.stations.len() - 1)),
        switch: request.switch,
        until: request.until,
        ..Trace::before_first_point(&scenario, vary, tolerance)
    };
    let began = match rest.stability.negative_eigenvalues {
        Some(_) => begin_branch(&family, (&rest, fraction), &options, wanted).map_err(|why| {
            TraceRemark::NoFirstPoint {
                keys: keys.clone(),
                value,
                why,
            }
        }),
        None => Err(TraceRemark::NoEquilibrium {
            keys: keys.clone(),
            value,
            remark: rest.remark,
        }),
    };
    let (mut first, mut critical) = (None, Vec::new());
    match began {
        Ok((grids, point)) => {
            let mut run = BranchTracer {
                family: &family,
                request,
                grids,
                tolerance,
                first: None,
                critical: Vec::new(),
                stopped_before_crossings: false,
                progress,
            };
            run.trace_all_branches(point, given.is_some(), &mut trace);
            (first, critical) = (run.first, run.critical);
        }
        Err(remark) => trace.remark = Some(remark),
    }
    let snapped = |event: &Event| event.happening == StabilityLoss::Snapped;
    let path = rest.path.as_ref().filter(|_| given.is_none());
    if let (Some(path), Some(first)) = (path, trace.branches.first_mut())
        && path.events().iter().any(snapped)
    {
        first.remarks.push(BranchRemark::BeginsBeyondSnap);
    }
    let branches = &trace.branches;
    trace.complete =
        trace.remark.is_none() && branches.iter().all(|branch| branch.end.is_complete());
    trace.law = branches
        .first()
        .and_then(|branch| force_displacement_line(request, branch));
    trace.wall_seconds = clock.elapsed().as_secs_f64();
    Ok(TraceWithPoints {
        trace,
        first_point: first,
        critical_points: critical,
    })
}

/// The force of all loads of a leaf.
fn total_load(scenario: &Scenario) -> DVec3 {
    scenario.total_load() + DVec3::from_array(scenario.tip_force)
}

/// The equilibrium at the start of the range, from Newton's method if it may be unstable. Where it
/// may turn to either side it turns to that to which the range pushes.
fn first_equilibrium(
    scenario: &Scenario,
    options: &Options,
    keep_unstable: bool,
) -> Result<Equilibrium, RelaxError> {
    let rest = relax(scenario, options, &mut |_| {})?;
    if !keep_unstable || rest.outcome.is_at_rest() {
        return Ok(rest);
    }
    // Newton's method leads nowhere from this start.
    let stable = Options {
        method: SemiImplicit::default().into(),
        ..options.clone()
    };
    relax(scenario, &stable, &mut |_| {})
}

/// The leaf at rest or, if nothing leads it out of the plane z = 0, its mirror image in that plane, which is at rest
/// as well: the one to whose side the range pushes. From the other side the leaf would snap to it. Where a flat leaf
/// twists before it rises, the push with which it leaves the plane does not decide on the side.
fn on_side_of_range(scenario: &Scenario, mut rest: Equilibrium, push: DVec3) -> Equilibrium {
    let height: f64 = rest.tips.iter().map(|tip| tip.z).sum();
    if push.z * height >= 0.0 || !Leaf::new(scenario).is_planar() {
        return rest;
    }
    for node in rest.shape.rods.iter_mut().flat_map(|rod| &mut rod.nodes) {
        *node = node.mirrored_in_base_plane();
    }
    rest.tips.iter_mut().for_each(|tip| tip.z = -tip.z);
    rest
}

/// Segments of the requested grid, or as many as the leaf needs, if memory allows.
fn checked_segments(
    family: &LeafFamily,
    wanted: Option<usize>,
    least: usize,
) -> Result<usize, RelaxError> {
    let segments = check_segments(family.first_leaf(), wanted, least)?;
    memory::check_branch_memory(family.first_leaf().rods(), segments)?;
    Ok(segments)
}

/// Force against displacement, if what varies is one component of the force on the shared
/// tip, or of the position at which it is held.
fn force_displacement_line(
    request: &TraceRequest,
    branch: &TraceBranch,
) -> Option<ForceDisplacementLine> {
    let [
        VariableTarget::Entry(EntryPath {
            key: Key::TipForce | Key::TipPosition,
            indices: [Some(axis), None, ..],
            scale: false,
            ..
        }),
    ] = request.vary.keys.targets()
    else {
        return None;
    };
    let points = branch.points.iter().map(|point| match point.tips[..] {
        [tip] => Some(LoadedTip {
            force: point.force_on_tip(*axis),
            tip,
        }),
        _ => None,
    });
    let points: Option<Vec<LoadedTip>> = points.collect();
    ForceDisplacementLine::fit(*axis, &points?)
}

/// What is known of the critical points of a branch.
#[derive(Default)]
struct RecordedCrossings {
    /// Where no crossing branch begins within the range, and where others cross besides those that are followed.
    remarks: Vec<BranchRemark>,
    /// On which side the branches lie that cross at points of the branch.
    kinds: Vec<(usize, BranchingKind)>,
}

struct BranchEntrance {
    point: EquilibriumPoint,
    /// The indices of the branch and the point from which it was entered; none for the first.
    from: Option<[usize; 2]>,
}

struct BranchTracer<'r, 'p> {
    family: &'r LeafFamily<'r>,
    request: &'r TraceRequest,
    /// The grids on which branches are followed.
    grids: NestedBranchEquations<'r>,
    tolerance: f64,
    /// The first point of the first branch, and the critical points so far.
    first: Option<PointOnGrid>,
    critical: Vec<RefinedCriticalPoint>,
    /// Whether the run was stopped before branches that cross were sought.
    stopped_before_crossings: bool,
    progress: &'p mut dyn FnMut(usize, usize, f64),
}

impl BranchTracer<'_, '_> {
    /// Follows the branch of the first point, `both_ways` or to larger fractions, and, if requested,
    /// those that cross it, breadth first.
    fn trace_all_branches(
        &mut self,
        mut first: EquilibriumPoint,
        both_ways: bool,
        trace: &mut Trace,
    ) {
        trace.segments = first.state.segments();
        first.tangent = first.tangent.towards_larger_parameter();
        let values = self.request.vary.values.len();
        let longest = (1.0 / (values - 1) as f64).min(LONGEST_BRANCH_STEP);
        let grows = |points: &[EquilibriumPoint]| match points {
            [.., before, last] => last.index > before.index,
            _ => false,
        };
        let how = ContinuationOptions {
            stop_criterion: match self.request.until {
                Some(TraceUntil::Unstable) => Some(&grows),
                None => None,
            },
            ..ContinuationOptions::new(longest, self.request.most_points)
        };
        let back = both_ways.then(|| EquilibriumPoint {
            tangent: first.tangent.reversed(),
            ..first.clone()
        });
        let mut entrances: VecDeque<_> = [first]
            .into_iter()
            .chain(back)
            .map(|point| BranchEntrance { point, from: None })
            .collect();
        while let Some(BranchEntrance { point, from }) = entrances.pop_front() {
            let number = trace.branches.len();
            if number == MOST_BRANCHES {
                let most = MOST_BRANCHES;
                trace.remark = Some(TraceRemark::TooManyBranches { most });
                break;
            }
            let (family, progress) = (self.family, &mut *self.progress);
            let mut report = |points, at| progress(number, points, family.value(at));
            let mut followed = (self.grids).follow(point, &how, self.tolerance, &mut report);
            if followed.end == BranchEnd::StopCriterionMet {
                truncate_at_destabilization(&mut followed);
            }
            let last = followed.branch.points.last();
            let segments = last.map_or(0, |point| point.state.segments());
            trace.segments = trace.segments.max(segments);
            trace
                .branches
                .push(self.branch_in_scenario_units(&followed, from));
            let begun = followed.branch.points.first().zip(followed.points.first());
            let begun = begun.map(|(point, refined)| PointOnGrid {
                point: point.clone(),
                grid: refined.grid.clone(),
            });
            self.first = self.first.take().or(begun);
            let crossings = self.record_crossings(&followed, number, &mut entrances);
            let branch = &mut trace.branches[number];
            branch.remarks.extend(crossings.remarks);
            for (point, kind) in crossings.kinds {
                branch.points[point].branching = Some(kind);
            }
            let left = followed.end == BranchEnd::RunLimitReached
                || !entrances.is_empty()
                || self.stopped_before_crossings;
            if left && self.family.limit.reached() {
                trace.remark = Some(
                    match self.stopped_before_crossings || !entrances.is_empty() {
                        true => TraceRemark::StoppedBeforeCrossings,
                        false => TraceRemark::Stopped,
                    },
                );
                break;
            }
        }
        trace.factorizations = self.grids.factorizations();
    }

    /// Records the critical points of a branch; if requested, adds the first points of crossing
    /// branches, each with the indices of the branch and the point at which it was entered, if that
    /// is new.
    fn record_crossings(
        &mut self,
        followed: &VerifiedBranch,
        number: usize,
        entrances: &mut VecDeque<BranchEntrance>,
    ) -> RecordedCrossings {
        let mut found = RecordedCrossings::default();
        let critical = followed.branch.critical.iter().zip(&followed.critical);
        for (which, ((after, critical), refined)) in critical.enumerate() {
            let mut crossings =
                (self.critical.iter()).filter(|it| it.critical.kind == CriticalKind::Branching);
            let known = crossings.any(|other| is_same_point(&other.refined, refined));
            self.critical.push(RefinedCriticalPoint {
                critical: critical.clone(),
                refined: refined.clone(),
            });
            let at_stability = critical.indices.contains(&0) && !critical.is_vertex();
            if at_stability && !self.family.limit.reached() {
                let equations = self.grids.on_grid_of(&critical.state);
                let kind = critical.branching_kind(equations);
                found
                    .kinds
                    .extend(kind.map(|kind| (after + 1 + which, kind)));
            }
            if critical.kind != CriticalKind::Branching || known || !self.request.switch {
                continue;
            }
            let value = self.family.value(refined.fraction);
            // As many digits as tell one crossing from the next.
            let value = format!("{value:.8e}").parse().unwrap_or(value);
            let value = self.request.vary.keys.text(value);
            // If several modes become neutral at once due to symmetry, the branches
            // of all their combinations are rotated copies of each other.
            let new = switch_branches(
                self.grids.on_grid_of(&critical.state),
                critical,
                self.tolerance,
            );
            let directions = critical.modes.len();
            if new.is_empty() && !self.family.limit.reached() {
                found
                    .remarks
                    .push(BranchRemark::CrossingNotFollowed { value });
            } else if directions > 1 {
                let remark = BranchRemark::OneDirectionFollowed { value, directions };
                found.remarks.push(remark);
            }
            self.stopped_before_crossings |= self.family.limit.reached();
            let from = Some([number, after + 1 + which]);
            entrances.extend(new.into_iter().map(|point| BranchEntrance { point, from }));
        }
        found
    }

    /// A branch in the scenario's units.
    fn branch_in_scenario_units(
        &self,
        followed: &VerifiedBranch,
        from: Option<[usize; 2]>,
    ) -> TraceBranch {
        let branch = &followed.branch;
        let mut points = Vec::new();
        let mut critical = branch.critical.iter().zip(&followed.critical).peekable();
        for (i, (point, refined)) in branch.points.iter().zip(&followed.points).enumerate() {
            let number = points.len() + 1;
            points.push(self.trace_point(number, PointKind::Regular, point.index, refined));
            while let Some(((_, point), refined)) = critical.next_if(|((after, _), _)| *after == i)
            {
                let kind = match point.kind {
                    CriticalKind::Fold => PointKind::Fold,
                    CriticalKind::Branching => PointKind::Branching(point.modes.len()),
                };
                let number = points.len() + 1;
                points.push(TracePoint {
                    critical_mode_axis: point.modes.first().map(axis_of_largest_displacement),
                    critical_mode: (point.modes.first())
                        .and_then(|mode| BucklingMode::of_increments(&point.state, mode)),
                    ..self.trace_point(number, kind, point.indices[1], refined)
                });
            }
        }
        TraceBranch {
            from,
            points,
            end: followed.end.clone(),
            remarks: self.branch_remarks(followed),
        }
    }

    /// Why a branch ended, and where it met no branch that must cross it.
    fn branch_remarks(&self, followed: &VerifiedBranch) -> Vec<BranchRemark> {
        let near = |after: &usize| {
            let near = &followed.points[*after];
            let keys = &self.request.vary.keys;
            let value = keys.text(self.family.value(near.fraction));
            BranchRemark::CrossingNotFound { value }
        };
        let vertices = followed.branch.unmatched_vertices.iter();
        vertices
            .map(near)
            .chain(followed.end.failure_remark())
            .collect()
    }

    /// Waves and twist of the leaf at a point, on its finest grid.
    fn undulation_at(&self, refined: &ExtrapolatedPoint) -> Option<Undulation> {
        let leaf = self.family.leaf([refined.fraction]).ok()?;
        let rods = refined.shapes(self.family).ok()?;
        let error = Some(refined.position_error * self.family.scale().length);
        Some(Undulation::at_stations(
            leaf.scenario(),
            refined.grid.sigma(),
            &rods,
            error,
        ))
    }

    fn trace_point(
        &self,
        point: usize,
        kind: PointKind,
        index: usize,
        refined: &ExtrapolatedPoint,
    ) -> TracePoint {
        let scale = self.family.scale();
        let value = self.family.value(refined.fraction);
        let held = self.request.base.scenario().held_tip.is_some();
        let forces = refined.reactions.iter().map(|force| *force * scale.force());
        TracePoint {
            point,
            kind,
            value,
            value_error: match kind {
                PointKind::Regular => None,
                _ => {
                    let above = refined.fraction + refined.fraction_error;
                    Some((self.family.value(above) - value).abs())
                }
            },
            tips: self.family.tips(&refined.tips),
            reaction: forces.clone().next().filter(|_| held),
            grip_reactions: forces.skip(usize::from(held)).collect(),
            error: Some(refined.position_error * scale.length),
            energy: refined.energy * scale.moment(),
            index,
            critical_mode_axis: None,
            critical_mode: None,
            branching: None,
            motion: None,
            undulation: self.undulation_at(refined).unwrap_or_default(),
            stations: refined.grid.sigma().to_vec(),
            curves: self.family.curves(&refined.state),
        }
    }
}

/// Ends a branch, whose last step its Morse index grew in, at the first critical point at which it
/// grows.
fn truncate_at_destabilization(followed: &mut VerifiedBranch) {
    followed.end = BranchEnd::StabilityLost;
    let mut critical = followed.branch.critical.iter();
    let grows = critical.position(|(_, critical)| critical.indices[1] > critical.indices[0]);
    if let Some(last) = grows {
        let (after, _) = followed.branch.critical[last];
        followed.branch.critical.truncate(last + 1);
        followed.critical.truncate(last + 1);
        followed.branch.points.truncate(after + 1);
        followed.points.truncate(after + 1);
    }
}

fn is_same_point(a: &ExtrapolatedPoint, b: &ExtrapolatedPoint) -> bool {
    (a.fraction - b.fraction).abs() < SAME_POINT_DISTANCE
        && a.state.largest_displacement_to(&b.state) < SAME_POINT_DISTANCE.sqrt()
}

fn serialize_axis<S: Serializer>(axis: &usize, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.serialize_char(['x', 'y', 'z'][*axis])
}

/// The axis along which a mode displaces the nodes most, by the sum of squares.
fn axis_of_largest_displacement(mode: &NodalField) -> usize {
    let squares = mode
        .iter()
        .flatten()
        .map(displacement_part)
        .map(|by| by * by);
    let DVec3 { x, y, z } = squares.sum();
    if z >= x.max(y) {
        2
    } else if y >= x {
        1
    } else {
        0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn law(tip: impl Fn(f64) -> f64) -> Option<ForceDisplacementLine> {
        let forces = (0..=10).map(|k| 0.1 * f64::from(k));
        let point = |force: f64| LoadedTip {
            force,
            tip: DVec3::new(tip(force), 0.0, 0.0),
        };
        let points: Vec<_> = forces.map(point).collect();
        ForceDisplacementLine::fit(0, &points)
    }

    #[test]
    fn a_spring_is_a_spring() {
        let law = law(|f| 2.0 + f / 3.0).unwrap();
        assert!((law.slope - 3.0).abs() < 1e-12 && (law.r_squared - 1.0).abs() < 1e-12);
        assert!(law.deviation < 1e-12);
    }

    #[test]
    fn of_a_tip_that_does_not_move_there_is_none() {
        let point = |k: i32| LoadedTip {
            force: f64::from(k),
            tip: DVec3::new(2.0 + 1e-15 * f64::from(k % 3), 0.0, 0.0),
        };
        let points: Vec<_> = (0..=10).map(point).collect();
        assert_eq!(ForceDisplacementLine::fit(0, &points), None);
    }

    /// Displacements that deviate from a line by 0.6 % of their range, and by 6 %.
    #[test]
    fn what_bends_away_from_the_line_has_no_law() {
        let bent = |part: f64| law(|f| 2.0 + f + part * f * f);
        assert!(bent(0.05).is_some_and(|law| law.deviation > 0.005));
        assert_eq!(bent(0.5), None);
    }
}
