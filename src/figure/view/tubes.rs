//! Veins as tubes, for programs that do not render curves.

use glam::{DVec3, Vec3};

/// Corners of a tube's section.
const SIDES: usize = 8;

/// Surfaces of tubes around curves with equally many points.
pub struct Tubes {
    pub positions: Vec<Vec3>,
    pub normals: Vec<Vec3>,
}

impl Tubes {
    /// Tubes around `curves`, whose rings are transported along each curve without twist.
    pub fn around(curves: &[Vec<DVec3>], radius: f64) -> Self {
        let (mut positions, mut normals) = (Vec::new(), Vec::new());
        for curve in curves {
            let mut across = DVec3::Z;
            for (i, &point) in curve.iter().enumerate() {
                let (before, after) = (i.saturating_sub(1), (i + 1).min(curve.len() - 1));
                let tangent = (curve[after] - curve[before]).normalize_or(DVec3::X);
                across = across.reject_from_normalized(tangent);
                if across.length() < 0.1 {
                    // Vertical, or a sharp kink: any perpendicular direction will do.
                    across = tangent.any_orthonormal_vector();
                }
                across = across.normalize();
                let binormal = tangent.cross(across);
                for side in 0..SIDES {
                    let angle = std::f64::consts::TAU * side as f64 / SIDES as f64;
                    let normal = angle.cos() * across + angle.sin() * binormal;
                    positions.push((point + radius * normal).as_vec3());
                    normals.push(normal.as_vec3().normalize_or(Vec3::X));
                }
            }
        }
        Tubes { positions, normals }
    }

    /// Corners of the triangles of `tubes` tubes around `points` points each, with open
    /// ends.
    pub fn triangles(tubes: usize, points: usize) -> Vec<u32> {
        let ring = |tube: usize, point: usize| (tube * points + point) * SIDES;
        let mut corners = Vec::new();
        for tube in 0..tubes {
            for point in 0..points.saturating_sub(1) {
                let (here, next) = (ring(tube, point), ring(tube, point + 1));
                for side in 0..SIDES {
                    let other = (side + 1) % SIDES;
                    let quad = [here + side, here + other, next + side, next + other];
                    let [a, b, c, d] = quad.map(|corner| corner as u32);
                    corners.extend([a, b, c, b, d, c]);
                }
            }
        }
        corners
    }

    /// Vertices of a tube around `points` points.
    pub fn vertices(points: usize) -> usize {
        points * SIDES
    }
}
