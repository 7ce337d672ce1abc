//! The rate at which strains change, for internal friction.

/// A step shorter than this part of the next one makes the rate inaccurate.
const SHORTEST_PART: f64 = 0.25;

/// Weights of a value and the two before it for its present rate of change, the
/// last step being `last` long and the one before `before`: the backward
/// difference of second order; of first order if that step was too short
/// or missing (zero); all zero if there was no step.
pub fn rates(last: f64, before: f64) -> [f64; 3] {
    if last == 0.0 {
        return [0.0; 3];
    }
    if before < SHORTEST_PART * last {
        return [1.0 / last, -1.0 / last, 0.0];
    }
    let r = last / before;
    [(1.0 + 2.0 * r) / (1.0 + r), -(1.0 + r), r * r / (1.0 + r)].map(|weight| weight / last)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parabolas_are_differentiated_exactly() {
        let value = |t: f64| 0.3 - 1.7 * t + 2.9 * t * t;
        let rate = |t: f64| -1.7 + 5.8 * t;
        for (last, before) in [(0.1, 0.1), (0.1, 0.3), (0.3, 0.1), (1e-3, 1.0)] {
            let t = 0.7;
            let values = [value(t), value(t - last), value(t - last - before)];
            let weights = rates(last, before);
            let found: f64 = values.iter().zip(weights).map(|(v, w)| v * w).sum();
            assert!((found - rate(t)).abs() < 1e-11, "{last}, {before}: {found}");
        }
    }

    #[test]
    fn straight_lines_where_less_is_known() {
        for before in [0.0, 1e-9, 0.024] {
            assert_eq!(rates(0.1, before), [10.0, -10.0, 0.0]);
        }
        assert_eq!(rates(0.0, 0.0), [0.0; 3]);
    }
}
