//! Measured points of a centreline, from base to tip, and what is wrong with them.

use glam::DVec3;

/// Points of a centreline from base to tip.
#[derive(Clone, Debug, Default)]
pub struct PosturePoints {
    /// Where they are.
    pub positions: Vec<DVec3>,
    /// The blade's normal, d3, at each, if measured; of any length but zero.
    pub normals: Option<Vec<DVec3>>,
    /// The standard deviation of a coordinate of each, if known.
    pub sd: Option<Vec<f64>>,
    /// The unit normal of the plane in which the points were measured, if they have two coordinates.
    pub plane: Option<DVec3>,
}

/// Why a posture cannot be used, and what to change.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum PostureError {
    /// There are too few points.
    #[error("{found} points: a posture needs at least {least}, from base to tip")]
    TooFew {
        /// Number of points.
        found: usize,
        /// Number needed.
        least: usize,
    },
    /// Points coincide.
    #[error(
        "the points are all in one place, or in two: give points along the whole leaf, from base to tip"
    )]
    Coincident,
    /// A number is not finite.
    #[error("point {point}: its coordinates must be finite numbers")]
    NotFinite {
        /// The point, counted from 1.
        point: usize,
    },
    /// The points do not follow each other along a curve.
    #[error(
        "the points do not follow each other along the leaf: point {point} is {times:.0} times as far from the one \
         before as the points lie apart; sort them from base to tip"
    )]
    OutOfOrder {
        /// The point, counted from 1.
        point: usize,
        /// Its distance from the one before, in median distances of the nearest.
        times: f64,
    },
    /// The points run from tip to base.
    #[error(
        "the points run from tip to base: the last one is where the scenario has its base (leaf.base), the first one \
         is not; turn their order around"
    )]
    Reversed,
    /// The frame of an anisotropic section is not known.
    #[error(
        "the section bends more easily about one axis than about the other, and the points lie in no plane of these \
         axes (they are off the best upright plane by {off:.3}, of a length of {length:.3}): give the blade's normal \
         (columns normal_x, normal_y, normal_z), or a round section"
    )]
    UnknownFrame {
        /// Largest distance from the plane.
        off: f64,
        /// Length of the leaf.
        length: f64,
    },
    /// A normal is along the curve.
    #[error(
        "point {point}: the blade's normal is along the leaf, or zero: it must point out of the blade"
    )]
    NormalAlong {
        /// The point, counted from 1.
        point: usize,
    },
    /// Points that are many times as long or as short as the leaf.
    #[error("the points are {length:.4} long and leaf.length is {given:.4}: {}", unit_advice(*.unit))]
    OtherUnit {
        /// Of the points.
        length: f64,
        /// Of the leaf.
        given: f64,
        /// The unit in which they would have about that length, if the scenario names its own.
        unit: Option<&'static str>,
    },
    /// A shape whose length is not that of the leaf.
    #[error(
        "the shape is {length:.4} long and the leaf {given:.4}: give points in the unit of the scenario, from its base to \
         its tip"
    )]
    OtherLength {
        /// Of the shape.
        length: f64,
        /// Of the leaf.
        given: f64,
    },
    /// A shape that begins elsewhere than the leaf.
    #[error(
        "the shape begins {off:.2} of its length from the base of the leaf: move its points, or leaf.base, there"
    )]
    OffBase {
        /// The distance, in lengths.
        off: f64,
    },
    /// A shape without an equilibrium near it.
    #[error(
        "no equilibrium is near the shape: from there the leaf comes to rest {away:.2} of its length away; relax it \
         without a start, or look for all equilibria"
    )]
    NoEquilibriumNear {
        /// The distance, in lengths.
        away: f64,
    },
    /// The scenario has something that the forces of a posture do not follow from.
    #[error("{key}: {why}")]
    Scenario {
        /// The key.
        key: &'static str,
        /// Why, and what to change.
        why: &'static str,
    },
}

/// What to do with points in another unit.
fn unit_advice(unit: Option<&str>) -> String {
    let guess = unit.map_or("another unit".into(), |unit| unit.to_string());
    format!(
        "are they in {guess}? Give them in the unit of the scenario, or a factor for each of their columns (as in \
         x=x:0.1), or mend leaf.length"
    )
}

/// Points this many times as long or as short as the leaf are those of another unit.
const OTHER_UNIT: f64 = 8.0;

/// Points farther apart than this many times the length of the shortest tree that joins all of them, if followed in
/// their order, are not in order: noise alone makes it 1.5 at most where it is as large as their distances.
const MOST_DETOUR: f64 = 1.8;

/// The last point is at the scenario's base if it is nearer than this fraction of the length, and the first is not if
/// it is farther than four times that.
const AT_BASE: f64 = 0.03;

/// Logarithm of the ratio up to which a leaf may be longer or shorter than in a unit in which its points are guessed.
const NEAR_UNIT: f64 = 1.1;

/// Units in which points may be, and their meters.
const LENGTH_UNITS: [(&str, f64); 4] = [("m", 1.0), ("cm", 0.01), ("mm", 1e-3), ("in", 0.0254)];

/// A step follows a direction if the cosine of the angle between them is larger.
const FOLLOWS_DIRECTION: f64 = 0.7;

impl PosturePoints {
    /// Points in space.
    pub fn in_space(positions: Vec<DVec3>) -> PosturePoints {
        PosturePoints {
            positions,
            ..PosturePoints::default()
        }
    }

    /// Points in a plane with this normal.
    pub fn in_plane(positions: Vec<DVec3>, normal: DVec3) -> PosturePoints {
        PosturePoints {
            positions,
            plane: Some(normal),
            ..PosturePoints::default()
        }
    }

    /// Whether the points may run from tip to base: they begin away from it and against its direction, but their end
    /// read backwards follows that direction.
    pub fn lead_backwards(&self, base: DVec3, direction: DVec3) -> bool {
        let points = &self.positions;
        let ([first, second, ..], [.., before, last]) = (&points[..], &points[..]) else {
            return false;
        };
        let length: f64 = points
            .windows(2)
            .map(|pair| pair[0].distance(pair[1]))
            .sum();
        let along = |from: &DVec3, to: &DVec3| (*to - *from).normalize_or_zero().dot(direction);
        first.distance(base) > 4.0 * AT_BASE * length
            && along(first, second) < 0.0
            && along(last, before) > FOLLOWS_DIRECTION
    }

    /// The length of the polygon through the points.
    fn polygon_length(&self) -> f64 {
        let pairs = self.positions.windows(2);
        pairs.map(|pair| pair[0].distance(pair[1])).sum()
    }

    /// Checks that the points are about as long as the leaf, whose unit of length is so many meters, if that is known.
    ///
    /// # Errors
    /// Points that are probably in another unit.
    pub fn check_unit(&self, given: f64, meters: Option<f64>) -> Result<(), PostureError> {
        let length = self.polygon_length();
        let times = length / given;
        if !(times >= OTHER_UNIT || times <= 1.0 / OTHER_UNIT) {
            return Ok(());
        }
        let off = |of_unit: f64| {
            let own = meters.unwrap_or(1.0) / times;
            (of_unit / own).ln().abs()
        };
        let units = LENGTH_UNITS.iter().filter(|_| meters.is_some());
        let nearest = units.min_by(|a, b| off(a.1).total_cmp(&off(b.1)));
        let nearest = nearest.filter(|(_, of_unit)| off(*of_unit) < NEAR_UNIT);
        Err(PostureError::OtherUnit {
            length,
            given,
            unit: nearest.map(|(name, _)| *name),
        })
    }

    /// Checks the points themselves.
    ///
    /// # Errors
    /// Too few, coincident ones, or a wrong order.
    pub fn check(&self, least: usize, base: Option<DVec3>) -> Result<(), PostureError> {
        let points = &self.positions;
        if let Some(k) = points.iter().position(|point| !point.is_finite()) {
            return Err(PostureError::NotFinite { point: k + 1 });
        }
        if points.len() < least {
            return Err(PostureError::TooFew {
                found: points.len(),
                least,
            });
        }
        let steps: Vec<f64> = points
            .windows(2)
            .map(|pair| pair[0].distance(pair[1]))
            .collect();
        let length: f64 = steps.iter().sum();
        let distinct = steps.iter().filter(|step| **step > 1e-9 * length).count();
        if !(length > 0.0 && length.is_finite() && distinct + 1 >= least) {
            return Err(PostureError::Coincident);
        }
        let tree = shortest_tree(points);
        let joined: f64 = tree.iter().sum();
        if length > MOST_DETOUR * joined {
            let mut sorted = tree;
            sorted.sort_by(f64::total_cmp);
            let median = sorted[sorted.len() / 2].max(1e-9 * length);
            let far = (0..steps.len()).max_by(|&a, &b| steps[a].total_cmp(&steps[b]));
            let far = far.unwrap_or(0);
            return Err(PostureError::OutOfOrder {
                point: far + 2,
                times: steps[far] / median,
            });
        }
        if let (Some(base), Some(first), Some(last)) = (base, points.first(), points.last()) {
            let near = AT_BASE * length;
            if last.distance(base) < near && first.distance(base) > 4.0 * near {
                return Err(PostureError::Reversed);
            }
        }
        Ok(())
    }
}

/// The lengths of the edges of the shortest tree that joins all points (Prim's method).
fn shortest_tree(points: &[DVec3]) -> Vec<f64> {
    let mut nearest = vec![f64::INFINITY; points.len()];
    let mut joined = vec![false; points.len()];
    let mut edges = Vec::with_capacity(points.len());
    let mut newest = 0;
    for _ in 1..points.len() {
        joined[newest] = true;
        let mut next = (0, f64::INFINITY);
        for k in (0..points.len()).filter(|&k| !joined[k]) {
            nearest[k] = nearest[k].min(points[k].distance(points[newest]));
            if nearest[k] < next.1 {
                next = (k, nearest[k]);
            }
        }
        edges.push(next.1);
        newest = next.0;
    }
    edges
}
