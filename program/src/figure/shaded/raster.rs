//! Triangles on a raster of samples, seen in a parallel projection: which samples each covers, which triangle is
//! nearest to the viewer there, and how near the nearest one is.

use glam::DVec3;
use std::ops::Range;

/// A triangle in samples: x to the right, y down, z toward the viewer.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ProjectedTriangle {
    pub corners: [DVec3; 3],
}

/// The weights of the corners of a triangle at a point of the raster, which sum to one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CornerWeights(pub [f64; 3]);

impl ProjectedTriangle {
    /// Twice its area on the raster, with a sign: negative if its corners turn counterclockwise as it is seen.
    fn signed_area(&self) -> f64 {
        let [a, b, c] = self.corners.map(DVec3::truncate);
        (b - a).perp_dot(c - a)
    }

    /// Whether its corners turn counterclockwise as it is seen.
    pub fn faces_viewer(&self) -> bool {
        self.signed_area() < 0.0
    }

    /// The weights of its corners at the middle of the sample in a column of a row; of a triangle seen edge-on,
    /// those of its centroid.
    pub fn corner_weights(&self, column: usize, row: usize) -> CornerWeights {
        let [a, b, c] = self.corners.map(DVec3::truncate);
        let at = glam::DVec2::new(column as f64 + 0.5, row as f64 + 0.5);
        let area = self.signed_area();
        if area == 0.0 {
            return CornerWeights([1.0 / 3.0; 3]);
        }
        let second = (at - a).perp_dot(c - a) / area;
        let third = (b - a).perp_dot(at - a) / area;
        CornerWeights([1.0 - second - third, second, third])
    }

    /// Visits the column, the row and the depth of every sample in these rows whose middle is covered. A sample on
    /// an edge between two triangles is visited for one of them.
    fn for_each_covered_sample(
        &self,
        width: usize,
        rows: Range<usize>,
        mut visit: impl FnMut(usize, usize, f64),
    ) {
        let area = self.signed_area();
        if area == 0.0 || !area.is_finite() {
            return;
        }
        let [a, b, c] = self.corners;
        // The plane of the triangle: the depth as a linear function of the place.
        let (u, v) = (b - a, c - a);
        let slope_x = (u.z * v.y - v.z * u.y) / area;
        let slope_y = (v.z * u.x - u.z * v.x) / area;
        let low = a.y.min(b.y).min(c.y);
        let high = a.y.max(b.y).max(c.y);
        let row_from = |y: f64| (y - 0.5).ceil().max(0.0) as usize;
        let visited = row_from(low).max(rows.start)..row_from(high).min(rows.end);
        for row in visited {
            let y = row as f64 + 0.5;
            let (mut left, mut right) = (f64::INFINITY, f64::NEG_INFINITY);
            for [from, to] in [[a, b], [b, c], [c, a]] {
                // Both triangles of an edge find the same crossing.
                let (from, to) = if from.y <= to.y {
                    (from, to)
                } else {
                    (to, from)
                };
                if from.y <= y && y < to.y {
                    let x = from.x + (to.x - from.x) * ((y - from.y) / (to.y - from.y));
                    left = left.min(x);
                    right = right.max(x);
                }
            }
            let column = |x: f64| ((x - 0.5).ceil().max(0.0) as usize).min(width);
            if left >= right {
                continue;
            }
            for column in column(left)..column(right) {
                let (dx, dy) = (column as f64 + 0.5 - a.x, y - a.y);
                visit(column, row, a.z + slope_x * dx + slope_y * dy);
            }
        }
    }
}

/// No triangle covers the sample.
const UNCOVERED: u32 = u32::MAX;

/// Rows of samples, each with the triangle that is nearest to the viewer.
pub struct NearestTriangles {
    width: usize,
    rows: Range<usize>,
    depths: Vec<f64>,
    nearest: Vec<u32>,
}

impl NearestTriangles {
    pub fn render(triangles: &[ProjectedTriangle], width: usize, rows: Range<usize>) -> Self {
        let count = width * rows.len();
        let mut found = NearestTriangles {
            width,
            rows: rows.clone(),
            depths: vec![f64::NEG_INFINITY; count],
            nearest: vec![UNCOVERED; count],
        };
        for (number, triangle) in triangles.iter().enumerate() {
            triangle.for_each_covered_sample(width, rows.clone(), |column, row, depth| {
                let at = (row - rows.start) * width + column;
                if depth > found.depths[at] {
                    found.depths[at] = depth;
                    found.nearest[at] = number as u32;
                }
            });
        }
        found
    }

    /// Whether no triangle covers a sample, nor one within so many columns and rows.
    pub fn is_free(&self, [column, row]: [usize; 2], around: usize) -> bool {
        let columns = column - around..=column + around;
        (row - around..=row + around).all(|row| {
            let first = (row - self.rows.start) * self.width;
            let samples = &self.nearest[first + columns.start()..=first + columns.end()];
            samples.iter().all(|nearest| *nearest == UNCOVERED)
        })
    }

    /// The number of the nearest triangle at a sample, if one covers it.
    pub fn triangle(&self, column: usize, row: usize) -> Option<usize> {
        let at = (row - self.rows.start) * self.width + column;
        Some(self.nearest[at] as usize).filter(|_| self.nearest[at] != UNCOVERED)
    }
}

/// How near to the viewer the nearest triangle is, on a square raster.
pub struct DepthMap {
    side: usize,
    depths: Vec<f32>,
}

impl DepthMap {
    pub fn render(triangles: impl Iterator<Item = ProjectedTriangle>, side: usize) -> Self {
        let mut depths = vec![f32::NEG_INFINITY; side * side];
        for triangle in triangles {
            triangle.for_each_covered_sample(side, 0..side, |column, row, depth| {
                let nearest = &mut depths[row * side + column];
                *nearest = nearest.max(depth as f32);
            });
        }
        DepthMap { side, depths }
    }

    /// Whether no triangle is nearer to the viewer than a point, in samples.
    pub fn is_visible(&self, point: DVec3) -> bool {
        let side = self.side as f64;
        if !(point.x >= 0.0 && point.y >= 0.0 && point.x < side && point.y < side) {
            return true;
        }
        let nearest = self.depths[point.y as usize * self.side + point.x as usize];
        point.z >= f64::from(nearest)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn triangle(corners: [[f64; 3]; 3]) -> ProjectedTriangle {
        ProjectedTriangle {
            corners: corners.map(DVec3::from_array),
        }
    }

    /// Triangles around a common vertex that is no corner of a sample.
    fn fan(count: usize) -> Vec<ProjectedTriangle> {
        let middle = DVec3::new(31.3, 29.7, 1.0);
        let rim = |k: usize| {
            let angle = 0.1 + std::f64::consts::TAU * k as f64 / count as f64;
            middle + 25.0 * DVec3::new(angle.cos(), angle.sin(), 0.02 * angle.cos())
        };
        (0..count)
            .map(|k| ProjectedTriangle {
                corners: [middle, rim(k), rim((k + 1) % count)],
            })
            .collect()
    }

    #[test]
    fn every_sample_of_a_fan_belongs_to_one_triangle() {
        for count in [3, 7, 40] {
            let mut visits = vec![0; 64 * 64];
            for triangle in fan(count) {
                triangle.for_each_covered_sample(64, 0..64, |column, row, _| {
                    visits[row * 64 + column] += 1;
                });
            }
            assert!(visits.iter().all(|&visits| visits <= 1), "{count}");
            let covered: usize = visits.iter().sum();
            let sector = std::f64::consts::TAU / count as f64;
            let area = 0.5 * count as f64 * 625.0 * sector.sin();
            assert!((covered as f64 - area).abs() < 0.01 * area, "{count}");
        }
    }

    #[test]
    fn depth_and_weights_are_linear() {
        let it = triangle([[3.0, 2.0, 1.0], [40.0, 9.0, -2.0], [11.0, 50.0, 7.0]]);
        let mut seen = 0;
        it.for_each_covered_sample(64, 0..64, |column, row, depth| {
            let CornerWeights(weights) = it.corner_weights(column, row);
            assert!(weights.iter().all(|weight| *weight > -1e-12));
            let pairs = weights.iter().zip(it.corners);
            let at: DVec3 = pairs.map(|(weight, corner)| *weight * corner).sum();
            let middle = DVec3::new(column as f64 + 0.5, row as f64 + 0.5, depth);
            assert!(at.distance(middle) < 1e-12, "{at} {middle}");
            seen += 1;
        });
        assert!(seen > 500);
    }

    #[test]
    fn the_nearest_triangle_is_seen_in_any_order_and_in_any_rows() {
        let far = triangle([[0.0, 0.0, 0.0], [60.0, 0.0, 0.0], [0.0, 60.0, 0.0]]);
        let near = triangle([[5.0, 5.0, 1.0], [5.0, 20.0, 1.0], [20.0, 5.0, 1.0]]);
        assert!(near.faces_viewer() && !far.faces_viewer());
        for (order, number) in [([far, near], 1), ([near, far], 0)] {
            for rows in [0..64, 8..9] {
                let seen = NearestTriangles::render(&order, 64, rows);
                assert_eq!(seen.triangle(8, 8), Some(number));
                assert_eq!(seen.triangle(30, 8), Some(1 - number));
                assert_eq!(seen.triangle(63, 8), None);
            }
        }
        let depths = DepthMap::render([far, near].into_iter(), 64);
        for (z, visible) in [(1.5, true), (0.5, false)] {
            assert_eq!(depths.is_visible(DVec3::new(8.5, 8.5, z)), visible);
        }
        assert!(depths.is_visible(DVec3::new(-1.0, 8.0, -9.0)));
    }

    #[test]
    fn what_is_no_triangle_covers_nothing() {
        for corners in [
            [[1.0, 1.0, 0.0], [9.0, 9.0, 0.0], [5.0, 5.0, 0.0]],
            [[f64::NAN, 1.0, 0.0], [9.0, 9.0, 0.0], [5.0, 7.0, 0.0]],
            [[1e200, 1.0, 0.0], [9.0, 1e200, 0.0], [5.0, 7.0, 0.0]],
        ] {
            let none = NearestTriangles::render(&[triangle(corners)], 16, 0..16);
            assert!((0..16).all(|k| none.triangle(k, k).is_none()));
        }
    }
}
