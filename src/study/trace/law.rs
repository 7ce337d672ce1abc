//! Force against displacement, as a tensile test measures it.

use crate::largest::largest;
use glam::DVec3;
use serde::{Serialize, Serializer};

/// The largest deviation of forces from a straight line, as a part of their range, for which that
/// is their law: what a testing machine of class 1 measures differs as much (ISO 7500-1).
const LINEAR: f64 = 0.01;

/// Smaller displacements, in lengths, are due to rounding.
const ROUNDING: f64 = 1e-11;

/// The straight line fitted to the forces on a tip as a function of its displacements
/// along them: Hooke's law, and how well it holds.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Law {
    /// Axis of the force: 0, 1, 2 for x, y, z.
    #[serde(serialize_with = "serialize_axis")]
    pub axis: usize,
    /// Stiffness: slope of the least-squares line, force per length.
    pub slope: f64,
    /// Coefficient of determination of that line: 1 for an exact one.
    pub r_squared: f64,
    /// The largest deviation from the line, as a part of the range of the forces.
    pub deviation: f64,
    /// Distance of base and tip at the start of the range.
    pub length: f64,
}

impl Law {
    /// From forces along an axis and the tips under them; `None` with fewer than three, if the
    /// tip moves by no more than rounding, or if the forces are not [`LINEAR`].
    pub(super) fn of(axis: usize, points: &[(f64, DVec3)]) -> Option<Law> {
        let (_, tip) = *points.first()?;
        let points: Vec<(f64, f64)> = (points.iter())
            .map(|(force, moved)| (moved[axis] - tip[axis], *force))
            .collect();
        let count = points.len() as f64;
        if points.len() < 3 {
            return None;
        }
        let mean = |of: &dyn Fn(&(f64, f64)) -> f64| points.iter().map(of).sum::<f64>() / count;
        let (x, y) = (mean(&|p| p.0), mean(&|p| p.1));
        let xx = mean(&|p| (p.0 - x) * (p.0 - x));
        let xy = mean(&|p| (p.0 - x) * (p.1 - y));
        let yy = mean(&|p| (p.1 - y) * (p.1 - y));
        let length = tip.length();
        if xx.sqrt() <= ROUNDING * length {
            return None;
        }
        let slope = xy / xx;
        let off = |p: &(f64, f64)| (p.1 - y - slope * (p.0 - x)).abs();
        let forces = points.iter().map(|p| p.1);
        let range =
            forces.clone().fold(f64::NEG_INFINITY, f64::max) - forces.fold(f64::INFINITY, f64::min);
        Some(Law {
            axis,
            slope,
            r_squared: xy * xy / (xx * yy),
            deviation: largest(points.iter().map(off)) / range,
            length,
        })
        .filter(|law| law.slope.is_finite() && law.deviation <= LINEAR)
    }
}

fn serialize_axis<S: Serializer>(axis: &usize, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.serialize_char(['x', 'y', 'z'][*axis])
}

#[cfg(test)]
mod tests {
    use super::*;

    fn law(tip: impl Fn(f64) -> f64) -> Option<Law> {
        let forces = (0..=10).map(|k| 0.1 * f64::from(k));
        let points: Vec<_> = forces.map(|f| (f, DVec3::new(tip(f), 0.0, 0.0))).collect();
        Law::of(0, &points)
    }

    #[test]
    fn a_spring_is_a_spring() {
        let law = law(|f| 2.0 + f / 3.0).unwrap();
        assert!((law.slope - 3.0).abs() < 1e-12 && (law.r_squared - 1.0).abs() < 1e-12);
        assert!(law.deviation < 1e-12);
    }

    #[test]
    fn of_a_tip_that_does_not_move_there_is_none() {
        let rounding = |k: i32| DVec3::new(2.0 + 1e-15 * f64::from(k % 3), 0.0, 0.0);
        let points: Vec<_> = (0..=10).map(|k| (f64::from(k), rounding(k))).collect();
        assert_eq!(Law::of(0, &points), None);
    }

    /// Displacements that deviate from a line by 0.6 % of their range, and by 6 %.
    #[test]
    fn what_bends_away_from_the_line_has_no_law() {
        let bent = |part: f64| law(|f| 2.0 + f + part * f * f);
        assert!(bent(0.05).is_some_and(|law| law.deviation > 0.005));
        assert_eq!(bent(0.5), None);
    }
}
