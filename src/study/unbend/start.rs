//! The equilibrium nearest to a measured shape.

use crate::posture::frame::FrameRule;
use crate::posture::points::{PostureError, PosturePoints};
use crate::posture::smoothing::{LEAST_POINTS, smooth};
use crate::relax::{self, Equilibrium, EquilibriumDoubt, NodeState, Options, Progress, RodShape};
use crate::scenario::Scenario;
use crate::study::unbend::request::UnbendError;
use glam::{DQuat, DVec3};

/// Equal parts of the curve's parameter at whose ends a shape is told.
const PARTS: usize = 64;

/// An equilibrium is near if the leaf is nowhere farther from the shape than this fraction of its length; likewise the
/// begin of the points from the base.
const NEAR: f64 = 0.1;

/// How far from the shape, in lengths, a leaf rests that did not come to rest from there, and that is this shape all the
/// same.
const SAME_SHAPE: f64 = 0.01;

/// The part by which lengths may differ.
const LENGTHS: f64 = 0.1;

/// The equilibrium nearest to the shape that points from base to tip show; with
/// [`keep_unstable`](relax::SemiImplicit::keep_unstable) of any index.
///
/// # Errors
/// Points that are no shape of this leaf, and shapes with no equilibrium near them.
pub fn relax_from_points(
    scenario: &Scenario,
    points: &PosturePoints,
    options: &Options,
    progress: &mut dyn FnMut(&Progress),
) -> Result<Equilibrium, UnbendError> {
    if scenario.rods.len() != 1 {
        return Err(PostureError::Scenario {
            key: "leaf.rods",
            why: "points of one curve are the shape of one vein: only leaf.rods = 1 begins from them",
        }
        .into());
    }
    let (base, rotation) = scenario.base(0);
    points.check(LEAST_POINTS, Some(base))?;
    let coordinates = if points.plane.is_some() { 2 } else { 3 };
    let smoothed = smooth(&points.positions, points.sd.as_deref(), coordinates);
    let smoothed = smoothed.ok_or(PostureError::Coincident)?;
    let at: Vec<f64> = (0..=PARTS).map(|k| k as f64 / PARTS as f64).collect();
    let curve: Vec<_> = at.iter().map(|&t| smoothed.curve.at(t)).collect();
    let positions: Vec<DVec3> = curve.iter().map(|point| point.position).collect();
    let tangents: Vec<DVec3> = curve
        .iter()
        .map(|it| it.first.normalize_or_zero())
        .collect();
    let mut along = vec![0.0];
    for pair in positions.windows(2) {
        along.push(along[along.len() - 1] + pair[0].distance(pair[1]));
    }
    let length = along[PARTS];
    let given = scenario.rods[0].length * scenario.rods[0].rest_stretch.integral(1.0);
    if (length / given - 1.0).abs() > LENGTHS {
        return Err(PostureError::OtherLength { length, given }.into());
    }
    let off = positions[0].distance(base) / length;
    if off > NEAR {
        return Err(PostureError::OffBase { off }.into());
    }
    // The clamp turns to the curve the shortest way.
    let turned = DQuat::from_rotation_arc(rotation * DVec3::X, tangents[0]) * rotation;
    let frames = FrameRule::Transported.along(turned, &at, &positions, &tangents);
    let nodes = positions
        .iter()
        .zip(&frames)
        .map(|(position, directors)| NodeState {
            position: *position,
            rotation: DQuat::from_mat3(directors).normalize(),
            v: DVec3::X,
            u: DVec3::ZERO,
            n: DVec3::ZERO,
            m: DVec3::ZERO,
        });
    let rods = vec![RodShape {
        length,
        nodes: nodes.collect(),
    }];
    let mut stations: Vec<f64> = along.iter().map(|one| one / length).collect();
    stations[PARTS] = 1.0;
    let leaf = relax::relax_from(scenario, (&stations, &rods), options, progress)?;
    let away = largest_distance(&leaf, &stations, &positions) / length;
    let farthest = match leaf.doubts.contains(&EquilibriumDoubt::RelaxedAnew) {
        true => SAME_SHAPE,
        false => NEAR,
    };
    if away > farthest {
        return Err(PostureError::NoEquilibriumNear { away }.into());
    }
    Ok(leaf)
}

/// The largest distance of the leaf from the shape at equal fractions of the length.
fn largest_distance(leaf: &Equilibrium, stations: &[f64], positions: &[DVec3]) -> f64 {
    let Some(rod) = leaf.shape.rods.first() else {
        return f64::INFINITY;
    };
    let each = leaf
        .shape
        .stations
        .iter()
        .zip(&rod.nodes)
        .map(|(&sigma, node)| {
            let next = stations
                .partition_point(|&at| at < sigma)
                .clamp(1, stations.len() - 1);
            let part = (sigma - stations[next - 1]) / (stations[next] - stations[next - 1]);
            positions[next - 1]
                .lerp(positions[next], part)
                .distance(node.position)
        });
    crate::numbers::largest(each)
}
