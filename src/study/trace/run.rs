//! Computation of a trace.

use crate::clock::Instant;
use std::collections::VecDeque;

use super::law::Law;
use super::result::{PointKind, Trace, TraceBranch, TracePoint};
use super::{MOST_BRANCHES, TraceError, TraceRequest, TraceUntil};
use crate::branch::{
    Critical, End, Family, Followed, Grids, Kind, Point, Range, Refined, Walk, begin, switch,
};
use crate::leaf::Grid;
use crate::memory;
use crate::relax::{Equilibrium, Options, RelaxError, SemiImplicit, check_segments, relax};
use crate::scenario::{Key, Part, Scenario, slips};
use crate::study::Target;
use crate::undulation::Undulation;
use glam::DVec3;

/// Longest step along a branch if few values are asked for.
const LONGEST: f64 = 0.1;

/// Points closer than this (fractions of the range, lengths) are the same.
const SAME: f64 = 1e-5;

/// Follows the equilibrium of a scenario through one of its numbers. `progress` is
/// called for each point: with the branch, the number of points, and the value.
///
/// # Errors
/// Requests that cannot be met; failures during the run are part of the result.
pub fn trace(
    request: &TraceRequest,
    progress: &mut dyn FnMut(usize, usize, f64),
) -> Result<Trace, TraceError> {
    Ok(traced(request, progress)?.trace)
}

/// The same from a leaf at rest, which the scenario has at this `value` of its number: through that
/// leaf towards both ends of the range, as two branches, of which the first goes to larger fractions.
///
/// # Errors
/// Requests that cannot be met; failures during the run are part of the result.
pub fn trace_through(
    request: &TraceRequest,
    leaf: (&Equilibrium, f64),
    progress: &mut dyn FnMut(usize, usize, f64),
) -> Result<Trace, TraceError> {
    Ok(traced_from(request, Some(leaf), progress)?.trace)
}

/// A trace, with its first point and its critical points.
pub struct Traced {
    pub trace: Trace,
    /// The first point, and a grid that refines its own; none if there is no first point.
    pub first: Option<(Point, Grid)>,
    pub critical: Vec<(Critical, Refined)>,
}

/// The same as [`trace`], with those points.
pub fn traced(
    request: &TraceRequest,
    progress: &mut dyn FnMut(usize, usize, f64),
) -> Result<Traced, TraceError> {
    traced_from(request, None, progress)
}

/// Both: from a relaxation at the start of the range, or both ways from a given leaf.
fn traced_from(
    request: &TraceRequest,
    given: Option<(&Equilibrium, f64)>,
    progress: &mut dyn FnMut(usize, usize, f64),
) -> Result<Traced, TraceError> {
    request.check()?;
    let clock = Instant::now();
    let (keys, vary) = (&request.vary.keys, &request.vary);
    let ends = vary.ends();
    let make = |[value]: [f64; 1]| -> Result<Scenario, String> {
        let at = request.base.at(&[(keys, value)]);
        Ok(at.map_err(|refused| refused.to_string())?.scenario)
    };
    for value in ends {
        request.base.at(&[(keys, value)])?;
    }
    let family = Family::new(&make, ends, vary.log);
    let family = family.map_err(|out| TraceError::Vary(format!("{keys}: {out}")))?;
    let family = family.with_limit(request.limit.clone());
    let value = given.map_or(ends[0], |(_, value)| value);
    let scenario = request.base.at(&[(keys, value)])?.scenario;
    let tolerance = request.tolerance.unwrap_or(scenario.tolerance);
    let last = request.base.at(&[(keys, ends[1])])?.scenario;
    let leaning = total_load(&last) - total_load(&scenario);
    let (rest, options) = match given {
        Some((leaf, _)) => {
            let options = options(request, (tolerance, leaning), request.keep_unstable);
            (leaf.clone(), options)
        }
        None => first_equilibrium(request, &scenario, (tolerance, leaning))?,
    };
    let fraction = Range {
        ends,
        log: vary.log,
    }
    .fraction(value);
    let check = |least| check_grid(&family, request.segments, least);
    let wanted = request.segments.map(check).transpose()?;
    let mut trace = Trace {
        scenario: scenario.name.clone(),
        keys: keys.clone(),
        range: ends,
        log: vary.log,
        show: Vec::new(),
        units: scenario.units.clone(),
        rods: scenario.rods.len(),
        held: scenario.held_tip.is_some(),
        grips: scenario.grips.len(),
        joined: scenario.joined,
        segments: wanted.unwrap_or(2 * (rest.shape.stations.len() - 1)),
        tolerance,
        switch: request.switch,
        until: request.until,
        complete: false,
        remark: None,
        doubts: slips(&scenario),
        branches: Vec::new(),
        law: None,
        factorizations: 0,
        wall_seconds: 0.0,
    };
    let began = match rest.stability.negative_eigenvalues {
        Some(_) => {
            begin(&family, (&rest, fraction), &options, wanted).map_err(|stuck| stuck.to_string())
        }
        None => Err(rest.remark.unwrap_or("the leaf is not at rest".into())),
    };
    let (mut first, mut critical) = (None, Vec::new());
    match began {
        Ok((grids, point)) => {
            let mut run = Run {
                family: &family,
                request,
                grids,
                tolerance,
                first: None,
                critical: Vec::new(),
                untried: false,
                progress,
            };
            run.follow_all(point, given.is_some(), &mut trace);
            (first, critical) = (run.first, run.critical);
        }
        Err(why) => {
            let at = keys.text(value);
            let remark = format!("no equilibrium to begin with at {keys} = {at}: {why}");
            trace.remark = Some(remark);
        }
    }
    let branches = &trace.branches;
    trace.complete = trace.remark.is_none() && branches.iter().all(|branch| branch.end.complete());
    trace.law = branches.first().and_then(|branch| law(request, branch));
    trace.wall_seconds = clock.elapsed().as_secs_f64();
    Ok(Traced {
        trace,
        first,
        critical,
    })
}

/// The force of all loads of a leaf.
fn total_load(scenario: &Scenario) -> DVec3 {
    scenario.total_load() + DVec3::from_array(scenario.tip_force)
}

/// The equilibrium at the start of the range, from Newton's method if it may be unstable, and how
/// it was found. Where it may turn to either side it turns to that to which the range pushes.
fn first_equilibrium(
    request: &TraceRequest,
    scenario: &Scenario,
    (tolerance, leaning): (f64, DVec3),
) -> Result<(Equilibrium, Options), RelaxError> {
    let wanted = options(request, (tolerance, leaning), request.keep_unstable);
    let mut rest = relax(scenario, &wanted, &mut |_| {})?;
    if request.keep_unstable && !rest.outcome.is_at_rest() {
        // Newton's method leads nowhere from this start.
        let stable = options(request, (tolerance, leaning), false);
        rest = relax(scenario, &stable, &mut |_| {})?;
    }
    Ok((rest, wanted))
}

fn options(
    request: &TraceRequest,
    (tolerance, leaning): (f64, DVec3),
    keep_unstable: bool,
) -> Options {
    Options {
        limit: request.limit.clone(),
        tolerance: Some(tolerance),
        leaning,
        method: SemiImplicit {
            keep_unstable,
            ..SemiImplicit::default()
        }
        .into(),
        ..Options::default()
    }
}

/// Segments of the requested grid, or as many as the leaf needs, if memory allows.
fn check_grid(family: &Family, wanted: Option<usize>, least: usize) -> Result<usize, RelaxError> {
    let segments = check_segments(family.first(), wanted, least)?;
    memory::branches(family.first().rods(), segments)?;
    Ok(segments)
}

/// Force against displacement, if what varies is one component of the force on the shared
/// tip, or of the position at which it is held.
fn law(request: &TraceRequest, branch: &TraceBranch) -> Option<Law> {
    let [
        Target::Entry(Part {
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
        [tip] => Some((point.force_on_tip(*axis), tip)),
        _ => None,
    });
    let points: Option<Vec<(f64, DVec3)>> = points.collect();
    Law::of(*axis, &points?)
}

/// Data common to all branches.
struct Run<'r, 'p> {
    family: &'r Family<'r>,
    request: &'r TraceRequest,
    /// The grids on which branches are followed.
    grids: Grids<'r>,
    tolerance: f64,
    /// As in [`Traced`], so far.
    first: Option<(Point, Grid)>,
    critical: Vec<(Critical, Refined)>,
    /// Whether the run was stopped before branches that cross were sought.
    untried: bool,
    progress: &'p mut dyn FnMut(usize, usize, f64),
}

impl Run<'_, '_> {
    /// Follows the branch of the first point, `both_ways` or to larger fractions, and, if requested,
    /// those that cross it, breadth first.
    fn follow_all(&mut self, mut first: Point, both_ways: bool, trace: &mut Trace) {
        trace.segments = first.state.segments();
        first.tangent = first.tangent.growing();
        let values = self.request.vary.values.len();
        let longest = (1.0 / (values - 1) as f64).min(LONGEST);
        let grows = |points: &[Point]| match points {
            [.., before, last] => last.index > before.index,
            _ => false,
        };
        let how = Walk {
            enough: match self.request.until {
                Some(TraceUntil::Unstable) => Some(&grows),
                None => None,
            },
            ..Walk::new(longest, self.request.most_points)
        };
        let back = both_ways.then(|| Point {
            tangent: first.tangent.reversed(),
            ..first.clone()
        });
        let mut entrances: VecDeque<_> = [first]
            .into_iter()
            .chain(back)
            .map(|it| (it, None))
            .collect();
        while let Some((first, from)) = entrances.pop_front() {
            let number = trace.branches.len();
            if number == MOST_BRANCHES {
                trace.remark = Some(format!("there are more than {MOST_BRANCHES} branches"));
                break;
            }
            let (family, progress) = (self.family, &mut *self.progress);
            let mut report = |points, at| progress(number, points, family.value(at));
            let mut followed = (self.grids).follow(first, &how, self.tolerance, &mut report);
            if followed.end == End::Enough {
                end_at_growth(&mut followed);
            }
            let last = followed.branch.points.last();
            let segments = last.map_or(0, |point| point.state.segments());
            trace.segments = trace.segments.max(segments);
            trace.branches.push(self.in_units(&followed, from));
            let begun = followed.branch.points.first().zip(followed.points.first());
            let begun = begun.map(|(point, refined)| (point.clone(), refined.grid.clone()));
            self.first = self.first.take().or(begun);
            let missing = self.enter_crossings(&followed, number, &mut entrances);
            trace.branches[number].add_remarks(missing);
            let left = followed.end == End::Stopped || !entrances.is_empty() || self.untried;
            if left && self.family.limit.reached() {
                trace.remark = Some(match self.untried || !entrances.is_empty() {
                    true => "the run was stopped: branches that cross are not all followed".into(),
                    false => "the run was stopped".into(),
                });
                break;
            }
        }
        trace.factorizations = self.grids.factorizations();
    }

    /// Records the critical points of a branch; if requested, adds the first points of crossing
    /// branches, each with the indices of the branch and the point at which it was entered, if that
    /// is new. Returns where no crossing branch begins within the range.
    fn enter_crossings(
        &mut self,
        followed: &Followed,
        number: usize,
        entrances: &mut VecDeque<(Point, Option<[usize; 2]>)>,
    ) -> Vec<String> {
        let mut missing = Vec::new();
        let critical = followed.branch.critical.iter().zip(&followed.critical);
        for (which, ((after, critical), refined)) in critical.enumerate() {
            let mut crossings = (self.critical.iter()).filter(|(it, _)| it.kind == Kind::Branching);
            let known = crossings.any(|(_, other)| near(other, refined));
            self.critical.push((critical.clone(), refined.clone()));
            if critical.kind != Kind::Branching || known || !self.request.switch {
                continue;
            }
            // If several modes become neutral at once due to symmetry, the branches
            // of all their combinations are rotated copies of each other.
            let new = switch(self.grids.of(&critical.state), critical, self.tolerance);
            if new.is_empty() && !self.family.limit.reached() {
                let value = self.family.value(refined.fraction);
                // As many digits as tell one crossing from the next.
                let value = format!("{value:.8e}").parse().unwrap_or(value);
                missing.push(format!(
                    "the branches that cross at {} are not followed: none was found within the range",
                    self.request.vary.keys.text(value)
                ));
            }
            self.untried |= self.family.limit.reached();
            let from = Some([number, after + 1 + which]);
            entrances.extend(new.into_iter().map(|point| (point, from)));
        }
        missing
    }

    /// A branch in the scenario's units.
    fn in_units(&self, followed: &Followed, from: Option<[usize; 2]>) -> TraceBranch {
        let branch = &followed.branch;
        let mut points = Vec::new();
        let mut critical = branch.critical.iter().zip(&followed.critical).peekable();
        for (i, (point, refined)) in branch.points.iter().zip(&followed.points).enumerate() {
            let number = points.len() + 1;
            points.push(self.point(number, PointKind::Regular, point.index, refined));
            while let Some(((_, point), refined)) = critical.next_if(|((after, _), _)| *after == i)
            {
                let kind = match point.kind {
                    Kind::Fold => PointKind::Fold,
                    Kind::Branching => PointKind::Branching(point.modes.len()),
                };
                let number = points.len() + 1;
                points.push(self.point(number, kind, point.indices[1], refined));
            }
        }
        TraceBranch {
            from,
            points,
            end: followed.end.clone(),
            remark: self.remark(followed),
        }
    }

    /// Why a branch ended, and where it met no branch that must cross it.
    fn remark(&self, followed: &Followed) -> Option<String> {
        let near = |after: &usize| {
            let near = &followed.points[*after];
            let keys = &self.request.vary.keys;
            let value = keys.text(self.family.value(near.fraction));
            format!(
                "it turns back beyond {value} where another branch must cross it, which was not found"
            )
        };
        let mut remarks: Vec<String> = followed.branch.unmet.iter().map(near).collect();
        remarks.extend(followed.end.remark());
        (!remarks.is_empty()).then(|| remarks.join("; "))
    }

    /// Waves and twist of the leaf at a point, on its finest grid.
    fn undulation(&self, refined: &Refined) -> Option<Undulation> {
        let scenario = self.family.scenario([refined.fraction]).ok()?;
        let rods = refined.shapes(self.family).ok()?;
        let error = Some(refined.error * self.family.scale().length);
        Some(Undulation::at_stations(
            &scenario,
            refined.grid.sigma(),
            &rods,
            error,
        ))
    }

    fn point(&self, point: usize, kind: PointKind, index: usize, refined: &Refined) -> TracePoint {
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
            error: Some(refined.error * scale.length),
            energy: refined.energy * scale.moment(),
            index,
            undulation: self.undulation(refined).unwrap_or_default(),
            stations: refined.grid.sigma().to_vec(),
            curves: self.family.curves(&refined.state),
        }
    }
}

/// Ends a branch, whose last step its Morse index grew in, at the first critical point at which it
/// grows.
fn end_at_growth(followed: &mut Followed) {
    followed.end = End::Unstable;
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

fn near(a: &Refined, b: &Refined) -> bool {
    (a.fraction - b.fraction).abs() < SAME && a.state.shift_to(&b.state) < SAME.sqrt()
}
