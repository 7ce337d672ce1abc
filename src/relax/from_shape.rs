//! A relaxation that begins where another leaf is.

use glam::DVec3;

use crate::clock::Instant;
use crate::leaf::{DiscreteLeaf, Grid, Leaf};
use crate::refusal::RefusedOption;
use crate::relax::grids;
use crate::relax::nested::NestedEquilibrium;
use crate::relax::request::method::Method;
use crate::relax::request::options::{
    Options, Progress, RelaxError, check_tolerance, points_somewhere, rests_in_wind,
};
use crate::relax::request::problem::Problem;
use crate::relax::rest::{decided, relax_on_grids};
use crate::relax::result::equilibrium::Equilibrium;
use crate::relax::settle::effort::Effort;
use crate::relax::settle::segments::{check_segments, least};
use crate::relax::stability::index::project;
use crate::scenario::Scenario;
use crate::shape::{NodeState, RodShape};

/// Remark on a leaf that did not come to rest from the given shape.
const ANEW: &str =
    "from the given start the leaf does not come to rest: it was relaxed as without one";

/// Brings a scenario's leaf to rest from a shape with as many rods, given at `stations` from 0 to 1:
/// in the valley in which that lies, where a relaxation may find another. Where that leads nowhere it
/// relaxes as without, and one of the doubts says so.
///
/// # Errors
/// Requests that cannot be met, as of [`relax`](crate::relax::relax); other methods than the
/// semi-implicit one, and shapes of other leaves.
pub fn relax_from(
    scenario: &Scenario,
    (stations, rods): (&[f64], &[RodShape]),
    options: &Options,
    progress: &mut dyn FnMut(&Progress),
) -> Result<Equilibrium, RelaxError> {
    let tolerance = options.tolerance.unwrap_or(scenario.tolerance);
    check_tolerance(tolerance)?;
    rests_in_wind(scenario, options)?;
    points_somewhere(scenario)?;
    check_start(scenario, stations, rods)?;
    let method = options.method;
    let Method::SemiImplicit(how) = method else {
        let why = "only the method semi-implicit begins from a given shape";
        return Err(RefusedOption::new("method", method.word(), why).into());
    };
    let clock = Instant::now();
    let leaf = Leaf::new(scenario);
    let problem = Problem::new(&leaf, options, tolerance);
    let segments = check_segments(&leaf, method.segments(), least(method, tolerance, false))?;
    let grid = Grid::new(segments, leaf.kinks());
    let discrete = DiscreteLeaf::new(&leaf, grid.clone());
    let there = (rods.iter())
        .map(|rod| interpolated(stations, rod, grid.sigma()))
        .collect::<Vec<_>>();
    let mut state = project(&leaf, &discrete, &there);
    for j in 0..leaf.rods() {
        let base = state.base(j);
        (state.x[base], state.q[base]) = leaf.base(j);
    }
    leaf.hold_tips(&mut state);
    let mut effort = Effort::new(progress);
    let begun = NestedEquilibrium::begun(&problem);
    let found = grids::follow(&problem, begun, vec![(grid, state)], &mut effort);
    let settled = match &found {
        Ok(found) => found.is_stable() || how.keep_unstable,
        Err(_) => problem.out_of_time(),
    };
    if settled {
        return Ok(decided(&problem, found, clock, &mut effort).0);
    }
    drop(effort);
    let (mut leaf, _) = relax_on_grids(scenario, options, false, progress)?;
    leaf.doubts.push(ANEW.to_owned());
    Ok(leaf)
}

/// Refuses the shape of another leaf, and one that is no shape.
fn check_start(
    scenario: &Scenario,
    stations: &[f64],
    rods: &[RodShape],
) -> Result<(), RefusedOption> {
    let refuse = |value: String, why: String| Err(RefusedOption::new("start", value, why));
    let (own, given) = (scenario.rods.len(), rods.len());
    if own != given {
        let why = format!("must have as many rods as the scenario, {own}");
        return refuse(format!("a leaf of {given} rods"), why);
    }
    let ascending = stations.windows(2).all(|pair| pair[0] < pair[1]);
    let whole = stations.first() == Some(&0.0) && stations.last() == Some(&1.0);
    let finite = |node: &NodeState| {
        node.position.is_finite() && node.n.is_finite() && node.rotation.is_normalized()
    };
    let complete =
        |rod: &RodShape| rod.nodes.len() == stations.len() && rod.nodes.iter().all(finite);
    if !ascending || !whole || !rods.iter().all(complete) {
        let why = "must be at rest, with numbers at all of its stations from 0 to 1";
        return refuse("a leaf".into(), why.into());
    }
    Ok(())
}

/// A rod at other stations: on chords, with the directors turned evenly from node to node.
fn interpolated(stations: &[f64], rod: &RodShape, to: &[f64]) -> RodShape {
    let node = |&sigma: &f64| {
        let next = stations.partition_point(|&at| at < sigma);
        let next = next.clamp(1, stations.len() - 1);
        let (a, b) = (&rod.nodes[next - 1], &rod.nodes[next]);
        let weight = (sigma - stations[next - 1]) / (stations[next] - stations[next - 1]);
        let mean = |of: fn(&NodeState) -> DVec3| of(a).lerp(of(b), weight);
        NodeState {
            position: mean(|node| node.position),
            rotation: a.rotation.slerp(b.rotation, weight),
            v: mean(|node| node.v),
            u: mean(|node| node.u),
            n: mean(|node| node.n),
            m: mean(|node| node.m),
        }
    };
    RodShape {
        length: rod.length,
        nodes: to.iter().map(node).collect(),
    }
}
