//! Leaves on either side of the curves of a boundary.

use glam::DVec3;

use super::result::{Boundary, LeafBeside};
use crate::branch::boundary::{self as curves, Neighbour, Plane, Verified, beside};

/// Largest number of curves with leaves on either side.
const MOST: usize = 4;

/// Finds leaves on either side of a few curves: of those that bound stable leaves or, if there
/// are none, of those with the smallest index next to them.
pub fn add_leaves(plane: Plane, known: &[curves::Boundary], boundary: &mut Boundary) {
    let index = |point: &Verified| point.indices[0].min(point.indices[1]);
    let mut order: Vec<(usize, usize)> = Vec::new();
    for (number, curve) in known.iter().enumerate() {
        let least = curve.points.iter().map(index).min();
        order.extend(least.map(|least| (least, number)));
    }
    order.sort_unstable();
    let smallest = order.first().map(|first| first.0);
    order.retain(|curve| Some(curve.0) == smallest);
    let found = order.into_iter().filter_map(|(least, number)| {
        let points = &known[number].points;
        // Midway between ends and special points.
        let special = |&k: &usize| points[k].special.is_some();
        let special: Vec<usize> = (0..points.len()).filter(special).collect();
        let off = |&k: &usize| {
            let off = special.iter().map(|other| other.abs_diff(k));
            off.fold(k.min(points.len() - 1 - k), usize::min)
        };
        let same = (0..points.len()).filter(|&k| index(&points[k]) == least);
        let at = same.max_by_key(off)?;
        let before = &points[at.saturating_sub(1)];
        let after = points.get(at + 1).unwrap_or(&points[at]);
        let along = [0, 1].map(|i| after.params[i] - before.params[i]);
        Some((number, beside(plane, &points[at], along)?))
    });
    for (number, pair) in found.take(MOST) {
        let leaves = pair.map(|leaf| in_units(&plane, leaf));
        boundary.curves[number].beside = leaves.into();
    }
}

fn in_units(plane: &Plane, leaf: Neighbour) -> LeafBeside {
    let (family, state) = (plane.family, &leaf.solution.state);
    let tips: Vec<DVec3> = (0..state.rods()).map(|j| state.tip(j)).collect();
    LeafBeside {
        values: plane.values(leaf.solution.params),
        index: leaf.index,
        tips: family.tips(&tips),
        curves: family.curves(state),
        fallen_from: leaf.fallen_from.as_ref().map(|state| family.curves(state)),
    }
}
