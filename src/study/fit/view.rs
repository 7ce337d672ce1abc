//! What a traced point tells of the place where it is: coordinates in space, or in a photograph.

use glam::DVec3;

use crate::scenario::{Photo, PhotoRate};

/// The coordinates that a point may have, by the names of their columns.
pub(super) const COORDINATES: [&str; 5] = ["x", "y", "z", "pixel_x", "pixel_y"];

/// The first of those in a photograph.
pub(super) const IN_PHOTO: usize = 3;

/// The coordinates of a traced point, as far as they were seen.
pub(super) type Seen = [Option<f64>; COORDINATES.len()];

/// How coordinates follow from positions: each is a . x + b.
pub(super) struct View<'p> {
    photo: Option<&'p Photo>,
    rows: [(DVec3, f64); COORDINATES.len()],
}

impl<'p> View<'p> {
    pub fn new(photo: Option<&'p Photo>) -> Self {
        let nowhere = [(DVec3::ZERO, f64::NAN); 2];
        let [x, y] = photo.map_or(nowhere, Photo::projection);
        let rows = [(DVec3::X, 0.0), (DVec3::Y, 0.0), (DVec3::Z, 0.0), x, y];
        View { photo, rows }
    }

    /// A coordinate of a point.
    pub fn of(&self, coordinate: usize, point: DVec3) -> f64 {
        let (row, offset) = self.rows[coordinate];
        row.dot(point) + offset
    }

    /// The change of a coordinate as the point moves.
    pub fn along(&self, coordinate: usize, change: DVec3) -> f64 {
        self.rows[coordinate].0.dot(change)
    }

    /// The change of a coordinate of a point as its photograph changes.
    pub fn rate(&self, coordinate: usize, point: DVec3, by: &PhotoRate) -> f64 {
        match (self.photo, coordinate.checked_sub(IN_PHOTO)) {
            (Some(photo), Some(axis)) => photo.rate(point, by)[axis],
            _ => 0.0,
        }
    }

    /// Where a traced point is in space, as far as that is known.
    pub fn place(&self, seen: &Seen) -> [Option<f64>; 3] {
        match (self.photo, seen[IN_PHOTO], seen[IN_PHOTO + 1]) {
            (Some(photo), Some(x), Some(y)) => photo.place([x, y]),
            _ => [seen[0], seen[1], seen[2]],
        }
    }
}
