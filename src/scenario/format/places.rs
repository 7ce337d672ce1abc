//! Places along the veins that are meant to be one and were written as two: a third as 0.3333333 in one
//! table and as 0.33333 333 33 in another.
//!
//! A grid has a node at every place where something begins, ends or acts. Two places closer than
//! [`SAME_PLACE_DISTANCE`] would leave a segment between them whose stiffness, the inverse of its length, takes the
//! digits that the equilibrium needs. So all places are compared before a scenario is read, and those that
//! close are read as one.

/// Largest difference of fractions of the length that are one place.
///
/// A knot that moves by it moves a leaf by a few tenths of it: 1.2e-7 to 1.7e-7 of the length where stiffnesses, rest
/// curvatures and weights change severalfold within a third of the length. Segments of this length are
/// the shortest that still leave 1e-10 of the length to the equilibrium; at a tenth of it, the rounding of
/// the equations is at 1e-9.
pub(crate) const SAME_PLACE_DISTANCE: f64 = 1e-6;

/// The place of what acts on the base: so near to it that a grid has no node of its own there.
pub(super) const ON_BASE: f64 = 1e-13;

/// The places along the veins that a scenario names, where some of them are so close that they are one.
#[derive(Clone, Debug)]
pub(in crate::scenario) struct CommonPlaces {
    /// One place of each group, ascending: the first, or the tip.
    places: Vec<f64>,
    /// Largest distance of a place of a group from it.
    largest_shift: f64,
}

impl CommonPlaces {
    /// The common places of all these. `None` if no two are close and yet different: then all are read as they are
    /// written.
    pub(super) fn of_places(mut all: Vec<f64>) -> Option<CommonPlaces> {
        all.retain(|at| (0.0..=1.0).contains(at));
        all.sort_by(f64::total_cmp);
        all.dedup();
        let mut places: Vec<f64> = Vec::new();
        for &at in &all {
            match places.last_mut() {
                Some(first) if at - *first <= SAME_PLACE_DISTANCE => {
                    if at == 1.0 {
                        *first = at;
                    }
                }
                _ => places.push(at),
            }
        }
        if places.len() == all.len() {
            return None;
        }
        let mut common = CommonPlaces {
            places,
            largest_shift: 0.0,
        };
        let shifts = all.iter().map(|&at| (common.common_place(at) - at).abs());
        common.largest_shift = shifts.fold(0.0, f64::max);
        Some(common)
    }

    /// The largest distance of a place from its common place.
    pub fn largest_shift(&self) -> f64 {
        self.largest_shift
    }

    /// The common place of a place that the entries name.
    pub fn common_place(&self, at: f64) -> f64 {
        let after = self.places.partition_point(|&place| place < at);
        let beside = self.places[after.saturating_sub(1)..].iter().take(2);
        let close = beside.filter(|&&place| (place - at).abs() <= SAME_PLACE_DISTANCE);
        let nearest = |a: &&f64, b: &&f64| (**a - at).abs().total_cmp(&(**b - at).abs());
        close.min_by(nearest).copied().unwrap_or(at)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A group begins with its first place, ends within the distance of it, and takes the name of an end of
    /// the vein that it reaches.
    #[test]
    fn close_places_are_one() {
        let third = [0.0, 0.3333333, 1.0 / 3.0, 0.7, 0.9999999, 1.0];
        let common = CommonPlaces::of_places(third.to_vec()).unwrap();
        let found = third.map(|at| common.common_place(at));
        assert_eq!(found, [0.0, 0.3333333, 0.3333333, 0.7, 1.0, 1.0]);
        assert_eq!(common.common_place(0.5), 0.5);
        assert!((common.largest_shift() - 1e-7).abs() < 1e-15);
        let chain = [0.0, 0.5, 0.5 + 0.7e-6, 0.5 + 1.4e-6, 1.0];
        let common = CommonPlaces::of_places(chain.to_vec()).unwrap();
        assert_eq!(common.places, [0.0, 0.5, 0.5 + 1.4e-6, 1.0]);
        assert!(CommonPlaces::of_places(vec![0.0, 0.3, 0.30001, 1.0, 1.0]).is_none());
    }
}
