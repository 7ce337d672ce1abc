//! Smooth curves through points on the page.

use glam::DVec2;

/// Length in pixels of the straight pieces of which a curve is drawn, and the most pieces between
/// two of its points.
const PIECE: f64 = 5.0;
const MOST_PIECES: usize = 24;

/// A curve through these points as straight pieces: for every point but the last those that lead
/// from it to the next. Between two points it is a cubic with the tangents of parabolas through
/// three points each, over the lengths of the chords. Where the chords turn back the curve has a
/// corner.
pub fn smooth(points: &[DVec2]) -> Vec<Vec<DVec2>> {
    let chords: Vec<DVec2> = points.windows(2).map(|pair| pair[1] - pair[0]).collect();
    let slope = |k: usize| chords[k].normalize_or_zero();
    let length = |k: usize| chords[k].length();
    // At both ends of chord `k`.
    let inner = |before: usize, after: usize| {
        let (a, b) = (length(before), length(after));
        if a == 0.0 || b == 0.0 || slope(before).dot(slope(after)) <= 0.0 {
            return None;
        }
        Some((b * slope(before) + a * slope(after)) / (a + b))
    };
    let tangents = |k: usize| {
        let start = k.checked_sub(1).and_then(|before| inner(before, k));
        let end = (k + 1 < chords.len()).then(|| inner(k, k + 1)).flatten();
        // Of a parabola, at whose other end the tangent is known.
        let other = |known: Option<DVec2>| known.map_or(slope(k), |it| 2.0 * slope(k) - it);
        [start.unwrap_or(other(end)), end.unwrap_or(other(start))]
    };
    (0..chords.len())
        .map(|k| {
            let [from, to] = tangents(k).map(|tangent| length(k) * tangent);
            let (a, b) = (points[k], points[k + 1]);
            let count = ((length(k) / PIECE).ceil() as usize).clamp(1, MOST_PIECES);
            let at = |i: usize| {
                let t = i as f64 / count as f64;
                let s = 1.0 - t;
                // Hermite's cubics.
                a * (s * s * (1.0 + 2.0 * t)) + b * (t * t * (1.0 + 2.0 * s)) + from * (t * s * s)
                    - to * (t * t * s)
            };
            let inside = (1..count).map(at);
            [a].into_iter().chain(inside).chain([b]).collect()
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Deviations of the curve through points of a circle are of the third order in their distance.
    #[test]
    fn a_circle_is_drawn_round() {
        let worst = |count: usize| {
            let angle = |k: usize| std::f64::consts::PI * k as f64 / count as f64;
            let points: Vec<DVec2> = (0..=count)
                .map(|k| 200.0 * DVec2::from_angle(angle(k)))
                .collect();
            let drawn = smooth(&points);
            let off = drawn.iter().flatten().map(|it| (it.length() - 200.0).abs());
            off.fold(0.0, f64::max)
        };
        let off = [8, 16, 32].map(worst);
        assert!(
            off[0] < 1.5 && off[1] < off[0] / 7.0 && off[2] < off[1] / 7.0,
            "{off:?}"
        );
    }

    #[test]
    fn corners_and_repeated_points_stay() {
        let back = [[0.0, 0.0], [10.0, 0.0], [0.0, 1.0]].map(DVec2::from_array);
        let drawn = smooth(&back);
        assert_eq!(drawn.len(), 2);
        assert!(drawn[0].iter().all(|it| it.y == 0.0 && it.x <= 10.0));
        let twice = [DVec2::X, DVec2::X, 2.0 * DVec2::X];
        assert!(
            smooth(&twice)
                .iter()
                .flatten()
                .all(|it| it.is_finite() && it.y == 0.0)
        );
        assert!(smooth(&[]).is_empty() && smooth(&[DVec2::X]).is_empty());
    }
}
