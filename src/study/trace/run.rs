//! Making a trace.

use std::collections::VecDeque;
use std::time::Instant;

use glam::DVec3;
use rayon::prelude::*;

use super::law::Law;
use super::result::{PointKind, Trace, TraceBranch, TracePoint};
use super::{MOST_BRANCHES, TraceError, TraceRequest};
use crate::branch::{
    self, Branch, Critical, Equations, Family, Kind, Point, Refined, Walk, refine, refine_critical,
    switch, walk,
};
use crate::leaf::{DiscreteLeaf, Grid, Leaf, State};
use crate::memory::Request;
use crate::relax::{Equilibrium, Options, RelaxError, SemiImplicit, node_state, project, relax};
use crate::scenario::{Key, Part, Scenario};
use crate::shape::RodShape;
use crate::study::Target;
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
    let family = family.map_err(|out| TraceError::Vary(format!("{keys}: {out}")))?;
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
    let (grid, state) = initial_state(&family, &leaf, &first, request.segments)?;
    let mut trace = Trace {
        scenario: scenario.name.clone(),
        keys: keys.clone(),
        range: ends,
        units: scenario.units.clone(),
        rods: scenario.rods.len(),
        joined: scenario.joined,
        segments: grid.segments(),
        tolerance,
        complete: false,
        remark: None,
        branches: Vec::new(),
        law: None,
        factorizations: 0,
        wall_seconds: 0.0,
    };
    if first.stability.negative_eigenvalues.is_some() {
        let mut run = Run {
            family: &family,
            request,
            grid,
            tolerance,
            crossings: Vec::new(),
            progress,
        };
        run.follow_all(&state, &mut trace);
    } else {
        trace.remark = Some(format!(
            "no equilibrium to begin with at {keys} = {}: {}",
            keys.text(ends[0]),
            first.remark.as_deref().unwrap_or("the leaf is not at rest")
        ));
    }
    let branches = &trace.branches;
    trace.complete = !branches.is_empty() && branches.iter().all(|branch| branch.end.complete());
    trace.law = branches.first().and_then(|branch| law(request, branch));
    trace.wall_seconds = clock.elapsed().as_secs_f64();
    Ok(trace)
}

/// Force against displacement, if it is one component of the force on the joint
/// tip that varies.
fn law(request: &TraceRequest, branch: &TraceBranch) -> Option<Law> {
    let [
        Target::Entry(Part {
            key: Key::TipForce,
            indices: [Some(axis), None],
            scale: false,
            ..
        }),
    ] = request.vary.keys.targets()
    else {
        return None;
    };
    let points = branch.points.iter().map(|point| match point.tips[..] {
        [tip] => Some((point.value, tip)),
        _ => None,
    });
    let points: Option<Vec<(f64, DVec3)>> = points.collect();
    Law::of(*axis, &points?, request.cross_section)
}

/// The finest grid on which branches are followed unless told otherwise.
const FINEST: usize = 128;

/// The grid on which branches are followed, and the first equilibrium near it:
/// as asked for, or one on which the index is that of the finest.
fn initial_state(
    family: &Family,
    leaf: &Leaf,
    first: &Equilibrium,
    segments: Option<usize>,
) -> Result<(Grid, State), TraceError> {
    let coarse = Grid::through(&first.shape.stations, leaf.kinks());
    let discrete = DiscreteLeaf::new(leaf, coarse);
    let mut grid = discrete.grid.clone();
    let mut state = project(leaf, &discrete, &first.shape.rods);
    let wanted = match segments {
        None => 2 * grid.segments(),
        Some(wanted) => {
            let segments = crate::relax::check_segments(leaf, Some(wanted), wanted)?;
            let rods = leaf.rods();
            (Request::Branches { rods, segments }.weigh()).map_err(RelaxError::Memory)?;
            segments
        }
    };
    while grid.segments() < wanted
        || segments.is_none() && index_differs(family, &grid, &state, first)
    {
        let discrete = DiscreteLeaf::new(leaf, grid.clone());
        state = branch::prolonged(&discrete, &state);
        grid = grid.refined();
    }
    Ok((grid, state))
}

/// Whether the index on a grid is another than on the finest.
fn index_differs(family: &Family, grid: &Grid, state: &State, first: &Equilibrium) -> bool {
    if grid.segments() >= FINEST {
        return false;
    }
    let found = Equations::new(family, grid.clone())
        .ok()
        .and_then(|mut equations| equations.correct(state, 0.0, None).ok());
    found.is_none_or(|(point, _)| Some(point.index) != first.stability.negative_eigenvalues)
}

/// What all branches have in common.
struct Run<'r, 'p> {
    family: &'r Family<'r>,
    request: &'r TraceRequest,
    /// On which branches are followed.
    grid: Grid,
    tolerance: f64,
    /// Points where branches cross, found so far.
    crossings: Vec<(f64, State)>,
    progress: &'p mut dyn FnMut(usize, usize, f64),
}

impl Run<'_, '_> {
    /// Follows the branch of the equilibrium near `state` and, if that is asked for,
    /// those that cross it, breadth first.
    fn follow_all(&mut self, state: &State, trace: &mut Trace) {
        let mut equations = match Equations::new(self.family, self.grid.clone()) {
            Ok(equations) => equations,
            Err(out_of_range) => {
                trace.remark = Some(out_of_range.to_string());
                return;
            }
        };
        let mut first = match equations.correct(state, 0.0, None) {
            Ok((point, _)) => point,
            Err(stuck) => {
                trace.remark = Some(format!("on {} segments: {stuck}", self.grid.segments()));
                return;
            }
        };
        first.tangent = first.tangent.towards(true);
        let values = self.request.vary.values.len();
        let how = Walk {
            longest: (1.0 / (values - 1) as f64).min(LONGEST),
            most: self.request.most_points,
        };
        let mut entrances = VecDeque::from([(first, None)]);
        while let Some((first, from)) = entrances.pop_front() {
            let number = trace.branches.len();
            if number == MOST_BRANCHES {
                trace.remark = Some(format!("there are more than {MOST_BRANCHES} branches"));
                break;
            }
            let (family, progress) = (self.family, &mut *self.progress);
            let mut count = 0;
            let branch = walk(&mut equations, first, &how, &mut |point| {
                count += 1;
                progress(number, count, family.value(point.fraction));
            });
            trace.branches.push(self.refined(&branch, from));
            if self.request.switch {
                self.enter_crossing(&mut equations, &branch, number, &mut entrances);
            }
        }
        trace.factorizations = equations.factorizations;
    }

    /// Adds first points of the branches that cross, each with the indices of the
    /// branch and the point it was entered from, where that is new.
    fn enter_crossing(
        &mut self,
        equations: &mut Equations,
        branch: &Branch,
        number: usize,
        entrances: &mut VecDeque<(Point, Option<[usize; 2]>)>,
    ) {
        for (which, (after, critical)) in branch.critical.iter().enumerate() {
            let mut crossings = self.crossings.iter();
            let known = crossings.any(|(fraction, state)| near(*fraction, state, critical));
            if critical.kind != Kind::Branching || known {
                continue;
            }
            let crossing = (critical.fraction, critical.state.clone());
            self.crossings.push(crossing);
            // Where several modes become neutral at once for reasons of symmetry,
            // branches of any mixture of them are the same, turned.
            let new = switch(equations, critical, 0).into_iter();
            let from = Some([number, after + 1 + which]);
            entrances.extend(new.map(|point| (point, from)));
        }
    }

    /// A branch in the scenario's units, without the error of its grid.
    fn refined(&self, branch: &Branch, from: Option<[usize; 2]>) -> TraceBranch {
        let (family, grid, tolerance) = (self.family, &self.grid, self.tolerance);
        let regular: Vec<Option<Refined>> = (branch.points.par_iter())
            .map(|point| refine(family, grid, point, tolerance).ok())
            .collect();
        let critical: Vec<Option<Refined>> = (branch.critical.par_iter())
            .map(|(_, point)| refine_critical(family, grid, point).ok())
            .collect();
        let mut points = Vec::new();
        let mut critical = branch.critical.iter().zip(critical).peekable();
        for (i, (point, refined)) in branch.points.iter().zip(regular).enumerate() {
            let refined = refined.unwrap_or_else(|| self.unrefined(&point.state, point.fraction));
            let number = points.len() + 1;
            points.push(self.point(number, PointKind::Regular, point.index, &refined));
            while let Some(((_, point), refined)) = critical.next_if(|((after, _), _)| *after == i)
            {
                let kind = match point.kind {
                    Kind::Fold => PointKind::Fold,
                    Kind::Branching => PointKind::Branching(point.modes.len()),
                };
                let refined =
                    refined.unwrap_or_else(|| self.unrefined(&point.state, point.fraction));
                let number = points.len() + 1;
                points.push(self.point(number, kind, point.indices[1], &refined));
            }
        }
        let missed = match branch.missed.len() {
            0 => None,
            count => Some(format!(
                "the index changes in {count} places that could not be located"
            )),
        };
        TraceBranch {
            from,
            points,
            end: branch.end.clone(),
            remark: branch.end.remark().or(missed),
        }
    }

    /// What is known of a point on one grid.
    fn unrefined(&self, state: &State, fraction: f64) -> Refined {
        let energy = (self.family).with(fraction, &self.grid, |leaf| leaf.energy(state));
        Refined {
            fraction,
            energy: energy.unwrap_or(f64::NAN),
            tips: (0..state.rods()).map(|j| state.tip(j).to_array()).collect(),
            error: None,
            fraction_error: None,
            state: state.clone(),
            grid: self.grid.clone(),
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

    fn point(&self, point: usize, kind: PointKind, index: usize, refined: &Refined) -> TracePoint {
        let scale = self.family.scale();
        let value = self.family.value(refined.fraction);
        let joined = self.request.base.scenario().joined;
        let tips = refined
            .tips
            .iter()
            .map(|tip| DVec3::from_array(*tip) * scale.length);
        let nodes = refined.grid.segments() + 1;
        TracePoint {
            point,
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

fn near(fraction: f64, state: &State, critical: &Critical) -> bool {
    (fraction - critical.fraction).abs() < SAME && state.shift_to(&critical.state) < SAME.sqrt()
}
