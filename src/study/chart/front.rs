//! The Pareto front of speed and accuracy.

/// Which points (seconds, error) are on the Pareto front: no other is at least
/// as fast and as accurate. Errors below `floor` count as equal; of equal points the
/// first is on the front.
pub fn front(points: &[(f64, f64)], floor: f64) -> Vec<bool> {
    let error = |i: usize| points[i].1.max(floor);
    let beats = |j: usize, i: usize| {
        let (a, b) = (points[j].0, points[i].0);
        a <= b && error(j) <= error(i) && (a < b || error(j) < error(i) || j < i)
    };
    (0..points.len())
        .map(|i| (0..points.len()).all(|j| !beats(j, i)))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn of_equal_points_one_is_on_the_front_and_small_errors_are_equal() {
        assert_eq!(front(&[(1.0, 1e-3); 3], 0.0), [true, false, false]);
        let points = [(1.0, 1e-13), (2.0, 1e-15), (3.0, 0.0)];
        assert_eq!(front(&points, 1e-12), [true, false, false]);
        assert_eq!(front(&points, 0.0), [true, true, true]);
    }
}
