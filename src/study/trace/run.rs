//! Making a trace.

use std::time::Instant;

use glam::DVec3;
use rayon::prelude::*;

use super::law::Law;
use super::result::{PointKind, Trace, TraceBranch, TraceEnd, TracePoint};
use super::{MOST_BRANCHES, TraceError, TraceRequest};
use crate::branch::{
    self, Branch, Critical, End, Equations, Family, Kind, Point, Refined, Stuck, Walk, refine,
    refine_critical, switch, walk,
};
use crate::leaf::{DiscreteLeaf, Grid, Leaf, State};
use crate::relax::{Equilibrium, Options, SemiImplicit, node_state, project, relax};
use crate::scenario::Scenario;
use crate::shape::RodShape;
use crate::undulation::Undulation;

/// Longest step along a branch where few values are asked for.
const LONGEST: f64 = 0.1;

/// Points in the same place: fractions of the range, and lengths.
const SAME: f64 = 1e-5;

/// Follows the equilibrium of a scenario through a number of it. `progress` is
/// told of each point: the branch, how many points there are, and the value.
///
/// # Errors
/// Requests that cannot be met; all that happens on the way is in the result.
pub fn trace(
    request: &TraceRequest,
    progress: &mut dyn FnMut(usize, usize, f64),
) -> Result<Trace, TraceError> {
    request.check()?;
    let clock = Instant::now();
    let (keys, vary) = (&request.vary.keys, &request.vary);
    let ends = [vary.values[0], vary.values[vary.values.len() - 1]];
    let make = |value: f64| -> Result<Scenario, String> {
        let at = request.base.at(&[(keys, value)]);
        Ok(at.map_err(|refused| refused.to_string())?.scenario)
    };
    for value in ends {
        request.base.at(&[(keys, value)])?;
    }
    let family = Family::new(&make, (ends[0], ends[1]), vary.log);
    let family = family.map_err(|out| TraceError::Vary {
        keys: keys.to_string(),
        why: out.to_string(),
    })?;
    let scenario = request.base.at(&[(keys, ends[0])])?.scenario;
    let tolerance = request.tolerance.unwrap_or(scenario.tolerance);
    let options = Options {
        tolerance: Some(tolerance),
        method: SemiImplicit {
            keep_unstable: request.keep_unstable,
            ..SemiImplicit::default()
        }
        .into(),
        ..Options::default()
    };
    let first = relax(&scenario, &options, &mut |_| {})?;
    let leaf = Leaf::new(&scenario);
    let (grid, state) = beginning(&family, &leaf, &first, request.segments)?;
    let mut trace = Trace {
        scenario: scenario.name.clone(),
        keys: keys.clone(),
        range: ends,
        units: scenario.units.clone(),
        rods: scenario.rods.len(),
        joined: scenario.joined,
        tolerance,
        segments: grid.segments(),
        branches: Vec::new(),
        law: None,
        remark: None,
        factorizations: 0,
        wall_seconds: 0.0,
    };
    if first.stability.negative_eigenvalues.is_none() {
        trace.remark = Some(format!(
            "no equilibrium to begin with at {keys} = {}: {}",
            keys.text(ends[0]),
            first.remark.as_deref().unwrap_or("the leaf is not at rest")
        ));
        trace.wall_seconds = clock.elapsed().as_secs_f64();
        return Ok(trace);
    }
    let mut run = Run {
        family: &family,
        request,
        tolerance,
        known: Vec::new(),
        progress,
    };
    run.all(grid, state, &mut trace);
    trace.law = trace
        .branches
        .first()
        .and_then(|branch| Law::of(keys, branch, request.cross_section));
    trace.wall_seconds = clock.elapsed().as_secs_f64();
    Ok(trace)
}

/// The finest grid on which branches are followed unless told otherwise.
const FINEST: usize = 128;

/// The grid on which branches are followed, and the first equilibrium near it:
/// as asked for, or one on which the index is that of the finest.
fn beginning(
    family: &Family,
    leaf: &Leaf,
    first: &Equilibrium,
    segments: Option<usize>,
) -> Result<(Grid, State), TraceError> {
    let coarse = Grid::new(first.shape.stations.len() - 1, leaf.kinks());
    let discrete = DiscreteLeaf::new(leaf, coarse);
    let mut grid = discrete.grid.clone();
    let mut state = project(leaf, &discrete, &first.shape.rods);
    let wanted = match segments {
        None => 2 * grid.segments(),
        Some(wanted) => crate::relax::check_segments(leaf, Some(wanted), wanted)?,
    };
    while grid.segments() < wanted || segments.is_none() && unsettled(family, &grid, &state, first)
    {
        let discrete = DiscreteLeaf::new(leaf, grid.clone());
        state = branch::prolonged(&discrete, &state);
        grid = grid.refined();
    }
    Ok((grid, state))
}

/// Whether the index on a grid is another than on the finest.
fn unsettled(family: &Family, grid: &Grid, state: &State, first: &Equilibrium) -> bool {
    if grid.segments() >= FINEST {
        return false;
    }
    let found = Equations::new(family, grid.clone())
        .ok()
        .and_then(|mut equations| equations.correct(state, 0.0, None).ok());
    found.is_none_or(|(point, _)| Some(point.index) != first.stability.negative_eigenvalues)
}

/// A place where another branch begins.
struct Entrance {
    point: Point,
    from: [usize; 2],
}

struct Run<'r, 'p> {
    family: &'r Family<'r>,
    request: &'r TraceRequest,
    tolerance: f64,
    /// Points where branches cross that are known.
    known: Vec<(f64, State)>,
    progress: &'p mut dyn FnMut(usize, usize, f64),
}

impl Run<'_, '_> {
    fn all(&mut self, grid: Grid, state: State, trace: &mut Trace) {
        let mut equations = match Equations::new(self.family, grid.clone()) {
            Ok(equations) => equations,
            Err(out) => {
                trace.remark = Some(out.to_string());
                return;
            }
        };
        let mut entrances = match equations.correct(&state, 0.0, None) {
            Ok((mut point, _)) => {
                point.tangent = point.tangent.towards(true);
                vec![(point, None)]
            }
            Err(stuck) => {
                trace.remark = Some(format!("on {} segments: {stuck}", grid.segments()));
                return;
            }
        };
        entrances.reverse();
        while let Some((first, from)) = entrances.pop() {
            if trace.branches.len() == MOST_BRANCHES {
                trace.remark = Some(format!("there are more than {MOST_BRANCHES} branches"));
                break;
            }
            let number = trace.branches.len();
            let how = Walk {
                longest: (1.0 / (self.request.vary.values.len() - 1) as f64).min(LONGEST),
                most: self.request.most_points,
            };
            let (family, progress) = (self.family, &mut *self.progress);
            let mut count = 0;
            let branch = walk(&mut equations, first, &how, &mut |point| {
                count += 1;
                progress(number, count, family.value(point.fraction));
            });
            let told = self.tell(&grid, &branch, from);
            if self.request.switch {
                let mut new = self.entrances(&mut equations, &branch, number);
                new.reverse();
                // In the order in which they were found, after those before.
                let waiting = std::mem::take(&mut entrances);
                entrances = new
                    .into_iter()
                    .map(|entrance| (entrance.point, Some(entrance.from)))
                    .collect();
                entrances.extend(waiting);
            }
            trace.branches.push(told);
        }
        trace.factorizations = equations.factorizations;
    }

    /// First points of the branches that cross, where that is new.
    fn entrances(
        &mut self,
        equations: &mut Equations,
        branch: &Branch,
        number: usize,
    ) -> Vec<Entrance> {
        let mut found = Vec::new();
        for (which, (after, critical)) in branch.critical.iter().enumerate() {
            let known =
                (self.known.iter()).any(|(fraction, state)| near(*fraction, state, critical));
            if critical.kind != Kind::Branching || known {
                continue;
            }
            self.known.push((critical.fraction, critical.state.clone()));
            // Where several modes become neutral at once for reasons of symmetry,
            // branches of any mixture of them are the same, turned.
            let from = [number, after + 1 + which];
            let new = switch(equations, critical, 0).into_iter();
            found.extend(new.map(|point| Entrance { point, from }));
        }
        found
    }

    /// A branch in the scenario's units, without the error of its grid.
    fn tell(&self, grid: &Grid, branch: &Branch, from: Option<[usize; 2]>) -> TraceBranch {
        let (family, tolerance) = (self.family, self.tolerance);
        let points: Vec<(Option<Refined>, &Point)> = (branch.points.par_iter())
            .map(|point| (refine(family, grid, point, tolerance).ok(), point))
            .collect();
        let critical: Vec<(usize, Option<Refined>, &Critical)> = (branch.critical.par_iter())
            .map(|(after, point)| (*after, refine_critical(family, grid, point).ok(), point))
            .collect();
        let mut told = Vec::new();
        for (i, (refined, point)) in points.into_iter().enumerate() {
            let refined =
                refined.unwrap_or_else(|| unrefined(family, grid, &point.state, point.fraction));
            told.push(self.point(PointKind::Regular, point.index, &refined));
            for (_, refined, point) in critical.iter().filter(|(after, ..)| *after == i) {
                let kind = match point.kind {
                    Kind::Fold => PointKind::Fold,
                    Kind::Branching => PointKind::Branching(point.modes.len()),
                };
                let refined = refined
                    .clone()
                    .unwrap_or_else(|| unrefined(family, grid, &point.state, point.fraction));
                told.push(self.point(kind, point.indices[1], &refined));
            }
        }
        let (end, remark) = end(&branch.end);
        let missed = match branch.missed.is_empty() {
            true => None,
            false => Some(format!(
                "the index changes in {} places that could not be located",
                branch.missed.len()
            )),
        };
        TraceBranch {
            from,
            points: told,
            end,
            remark: remark.or(missed),
        }
    }

    /// Waves and twist of a point's leaf, by its finest grid.
    fn undulation(&self, refined: &Refined) -> Option<Undulation> {
        let (family, state, grid) = (self.family, &refined.state, &refined.grid);
        let scenario = family.scenario(refined.fraction).ok()?;
        let scale = family.scale();
        let shapes = |leaf: &DiscreteLeaf| -> Vec<RodShape> {
            let rod = |j: usize| RodShape {
                length: leaf.leaf.length(j) * scale.length,
                nodes: (0..=grid.segments())
                    .map(|i| {
                        let mut node = node_state(leaf, state, j, i);
                        node.position *= scale.length;
                        node.n *= scale.force();
                        node
                    })
                    .collect(),
            };
            (0..leaf.rods()).map(rod).collect()
        };
        let rods = family.with(refined.fraction, grid, shapes).ok()?;
        let error = refined.error.map(|error| error * scale.length);
        Some(Undulation::at_stations(
            &scenario,
            grid.sigma(),
            &rods,
            error,
        ))
    }

    fn point(&self, kind: PointKind, index: usize, refined: &Refined) -> TracePoint {
        let scale = self.family.scale();
        let value = self.family.value(refined.fraction);
        let joined = self.request.base.scenario().joined;
        let tips = refined
            .tips
            .iter()
            .map(|tip| DVec3::from_array(*tip) * scale.length);
        let nodes = refined.grid.segments() + 1;
        TracePoint {
            kind,
            value,
            value_error: match kind {
                PointKind::Regular => None,
                _ => refined.fraction_error.map(|error| {
                    let above = self.family.value(refined.fraction + error);
                    (above - value).abs()
                }),
            },
            tips: tips.take(if joined { 1 } else { usize::MAX }).collect(),
            error: refined.error.map(|error| error * scale.length),
            energy: refined.energy * scale.moment(),
            index,
            undulation: self.undulation(refined).unwrap_or_default(),
            curves: (refined.state.x.chunks(nodes))
                .map(|rod| rod.iter().map(|x| *x * scale.length).collect())
                .collect(),
        }
    }
}

/// What is known of a point on one grid.
fn unrefined(family: &Family, grid: &Grid, state: &State, fraction: f64) -> Refined {
    let energy = family.with(fraction, grid, |leaf| leaf.energy(state));
    Refined {
        fraction,
        energy: energy.unwrap_or(f64::NAN),
        tips: (0..state.rods()).map(|j| state.tip(j).to_array()).collect(),
        error: None,
        fraction_error: None,
        state: state.clone(),
        grid: grid.clone(),
    }
}

fn near(fraction: f64, state: &State, critical: &Critical) -> bool {
    (fraction - critical.fraction).abs() < SAME && state.shift_to(&critical.state) < SAME.sqrt()
}

fn end(end: &End) -> (TraceEnd, Option<String>) {
    match end {
        End::Reached => (TraceEnd::Reached, None),
        End::Returned => (TraceEnd::Returned, None),
        End::Closed => (TraceEnd::Closed, None),
        End::MostPoints => (
            TraceEnd::MostPoints,
            Some("there are more points: allow them by --points".into()),
        ),
        End::Stuck(stuck) => (
            match stuck {
                Stuck::OutOfRange(_) => TraceEnd::OutOfRange,
                Stuck::Unresolved => TraceEnd::Unresolved,
                _ => TraceEnd::Stuck,
            },
            Some(match stuck {
                Stuck::Unresolved => format!("{stuck}: use more --segments"),
                _ => stuck.to_string(),
            }),
        ),
    }
}
