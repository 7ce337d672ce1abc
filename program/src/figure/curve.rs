//! Points of curves: which of them can be drawn, and where fractions of the length are.

use glam::DVec3;

/// Points farther away than this many lengths are diverged and not drawn.
const FARTHEST: f64 = 1e4;

/// Whether a point, in lengths, is finite and not too far away to be drawn.
pub fn is_drawable(point: DVec3) -> bool {
    point.is_finite() && point.abs().max_element() < FARTHEST
}

/// The points of a curve through nodes at these stations from one fraction of its length to another,
/// or at one.
pub fn stretch(stations: &[f64], curve: &[DVec3], [from, to]: [f64; 2]) -> Vec<DVec3> {
    let nodes = || stations.iter().copied().zip(curve.iter().copied());
    let at = |sigma: f64| {
        let before = nodes().take_while(|(at, _)| *at <= sigma).last();
        let after = nodes().find(|(at, _)| *at >= sigma);
        match (before, after) {
            (Some((a, x)), Some((b, y))) if b > a => Some(x.lerp(y, (sigma - a) / (b - a))),
            (one, other) => one.or(other).map(|(_, x)| x),
        }
    };
    let inside = nodes().filter(|(at, _)| from < *at && *at < to);
    let end = if to > from { at(to) } else { None };
    at(from)
        .into_iter()
        .chain(inside.map(|(_, x)| x))
        .chain(end)
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_stretch_ends_between_nodes() {
        let (stations, curve) = ([0.0, 0.5, 1.0], [0.0, 1.0, 3.0].map(|x| x * DVec3::X));
        let of = |at| -> Vec<f64> {
            let points = stretch(&stations, &curve, at).into_iter();
            points.map(|point| point.x).collect()
        };
        assert_eq!(of([0.25, 0.75]), [0.5, 1.0, 2.0]);
        assert_eq!(of([0.5, 1.0]), [1.0, 3.0]);
        assert_eq!(of([0.75, 0.75]), [2.0]);
        assert_eq!(of([1.0, 1.0]), [3.0]);
        assert!(stretch(&[], &[], [0.5, 1.0]).is_empty());
    }
}
