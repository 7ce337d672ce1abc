//! The directors along a posture: at the base those of the scenario's format, with d2 level unless the blade's normal
//! was measured; from there they do not turn about the tangent, or follow the normals.

use crate::posture::line::{Directors, Elements};
use crate::posture::points::{PostureError, PosturePoints};
use crate::posture::rod::HangingRod;
use crate::posture::smoothing::{SmoothedCurve, local_basis, smooth_at};
use crate::scenario::RodPlace;
use glam::{DMat3, DQuat, DVec3};

/// Points whose distance from a plane is below this fraction of their length lie in it.
const IN_PLANE: f64 = 1e-9;

/// Points of an anisotropic section may be off an upright plane by this fraction of their length, on average, and are
/// then projected onto it: that is what a digitiser's noise and a slight sweep amount to.
const NEARLY_IN_PLANE: f64 = 0.02;

/// A unit vector with a component below this is level, or upright.
const LEVEL: f64 = 1e-6;

/// A unit normal whose part across the curve is no longer than this is along it.
const LEAST_ACROSS: f64 = 0.1;

/// Whether a plane with this normal is upright.
pub fn vertical_plane(normal: DVec3) -> bool {
    normal.z.abs() < LEVEL
}

/// The directors at the base by the angles of the scenario's format.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BaseFrame {
    /// Angle of d1 in the x-y plane.
    pub angle: f64,
    /// Angle of d1 above it.
    pub elevation: f64,
    /// Turn of the section about d1.
    pub roll: f64,
}

impl BaseFrame {
    /// The frame of a curve that leaves its base in the direction `first`, with `across` from base to tip.
    pub fn new(first: DVec3, across: DVec3, plane: Option<DVec3>, rule: &FrameRule) -> BaseFrame {
        let tangent = first.normalize_or_zero();
        let level = |v: DVec3| DVec3::new(v.x, v.y, 0.0);
        let mut ahead = match plane {
            Some(normal) if vertical_plane(normal) => normal.cross(DVec3::Z),
            _ if level(tangent).length() > LEVEL => level(tangent),
            _ if level(across).length() > LEVEL * across.length() => level(across),
            _ => DVec3::X,
        };
        let towards = match level(tangent).length() > 1e-3 {
            true => tangent,
            false => across,
        };
        if ahead.dot(towards) < 0.0 {
            ahead = -ahead;
        }
        let ahead = ahead.normalize_or_zero();
        // No -0.0: it is written to files.
        let angle = ahead.y.atan2(ahead.x) + 0.0;
        let elevation = tangent.z.atan2(tangent.dot(ahead));
        let mut frame = BaseFrame {
            angle,
            elevation,
            roll: 0.0,
        };
        if let FrameRule::Measured(normals) = rule {
            let own = frame.rotation();
            let wanted = normals.at(0.0).position;
            let [y, z] = [DVec3::Y, DVec3::Z].map(|axis| wanted.dot(own * axis));
            frame.roll = (-y).atan2(z);
        }
        frame
    }

    /// The rotation of the directors.
    pub fn rotation(&self) -> DQuat {
        DQuat::from_rotation_z(self.angle)
            * DQuat::from_rotation_y(-self.elevation)
            * DQuat::from_rotation_x(self.roll)
    }
}

/// How the directors follow along the leaf.
#[derive(Clone, Debug)]
pub enum FrameRule {
    /// They do not turn about the tangent.
    Transported,
    /// d3 is the measured normal, smoothed.
    Measured(Box<crate::posture::smoothing::SplineCurve>),
}

impl FrameRule {
    /// Directors that follow measured normals.
    ///
    /// # Errors
    /// Normals along the curve.
    pub fn measured(
        smoothed: &SmoothedCurve,
        normals: &[DVec3],
    ) -> Result<FrameRule, PostureError> {
        let mut across = Vec::with_capacity(normals.len());
        for (k, (normal, &t)) in normals.iter().zip(&smoothed.at).enumerate() {
            let tangent = smoothed.curve.at(t).first.normalize_or_zero();
            let normal = normal.normalize_or_zero();
            let own = normal - normal.dot(tangent) * tangent;
            if own.length().is_nan() || own.length() <= LEAST_ACROSS {
                return Err(PostureError::NormalAlong { point: k + 1 });
            }
            across.push(own.normalize());
        }
        let smooth = smooth_at(&across, &smoothed.at, None, 1.0, 2, false);
        let smooth = smooth.ok_or(PostureError::Coincident)?;
        Ok(FrameRule::Measured(Box::new(smooth.curve)))
    }

    /// The directors at Gauss points, if they were measured.
    pub fn directors(&self, elements: &Elements) -> Option<Directors> {
        let FrameRule::Measured(normals) = self else {
            return None;
        };
        let each = elements.at.iter().map(|&t| {
            let point = normals.point(&local_basis(normals.intervals(), t));
            [point.position, point.first]
        });
        Some(Directors::Measured(each.collect()))
    }

    /// The directors at parameters, given the points and the tangents there, from those at the base.
    pub fn along(
        &self,
        base: DQuat,
        at: &[f64],
        points: &[DVec3],
        tangents: &[DVec3],
    ) -> Vec<DMat3> {
        match self {
            FrameRule::Measured(normals) => at
                .iter()
                .zip(tangents)
                .map(|(&t, &tangent)| {
                    let normal = normals.at(t).position;
                    let third = (normal - normal.dot(tangent) * tangent).normalize_or_zero();
                    DMat3::from_cols(tangent, third.cross(tangent), third)
                })
                .collect(),
            FrameRule::Transported => {
                let mut third = base * DVec3::Z;
                let mut frames = Vec::with_capacity(at.len());
                for k in 0..at.len() {
                    if k > 0 {
                        third = transport(
                            third,
                            [points[k - 1], points[k]],
                            [tangents[k - 1], tangents[k]],
                        );
                    }
                    let tangent = tangents[k];
                    third = (third - third.dot(tangent) * tangent).normalize_or_zero();
                    frames.push(DMat3::from_cols(tangent, third.cross(tangent), third));
                }
                frames
            }
        }
    }
}

/// A director carried on without turning about the tangent, by two reflections (W. Wang et al., ACM Trans. Graph. 27
/// (2008), 2): of fourth order.
fn transport(director: DVec3, points: [DVec3; 2], tangents: [DVec3; 2]) -> DVec3 {
    let reflect = |v: DVec3, by: DVec3| match by.length_squared() > 0.0 {
        true => v - 2.0 * v.dot(by) / by.length_squared() * by,
        false => v,
    };
    let step = points[1] - points[0];
    let [carried, tangent] = [director, tangents[0]].map(|v| reflect(v, step));
    reflect(carried, tangents[1] - tangent)
}

/// The plane of a posture, and the points in it where they were off it.
pub struct ChosenPlane {
    /// Its unit normal; `None` in space.
    pub plane: Option<DVec3>,
    /// The points projected onto it.
    pub positions: Option<Vec<DVec3>>,
    /// The largest distance of a point that was projected.
    pub off: Option<f64>,
}

/// Chooses the plane in which a posture lies.
///
/// # Errors
/// A spatial curve of an anisotropic section without normals.
pub fn choose(rod: &HangingRod, points: &PosturePoints) -> Result<ChosenPlane, PostureError> {
    let positions = &points.positions;
    let length: f64 = positions
        .windows(2)
        .map(|pair| pair[0].distance(pair[1]))
        .sum();
    let round = rod.is_round();
    let space = ChosenPlane {
        plane: None,
        positions: None,
        off: None,
    };
    if points.normals.is_some() && !round {
        return Ok(space);
    }
    let loaded = |normal: DVec3| is_loaded_within(rod, normal, length);
    let usable = |normal: DVec3| {
        loaded(normal) && (round || vertical_plane(normal) || normal.z.abs() > 1.0 - LEVEL)
    };
    let exact = points
        .plane
        .or_else(|| plane_through(positions, rod, length));
    if let Some(normal) = exact.filter(|normal| usable(*normal)) {
        return Ok(ChosenPlane {
            plane: Some(normal),
            ..space
        });
    }
    if round {
        return Ok(space);
    }
    let normal = upright_plane(positions);
    let middle = positions.iter().sum::<DVec3>() / positions.len() as f64;
    let off: Vec<f64> = positions
        .iter()
        .map(|p| (*p - middle).dot(normal))
        .collect();
    let mean = (off.iter().map(|one| one * one).sum::<f64>() / off.len() as f64).sqrt();
    let largest = off.iter().fold(0.0_f64, |most, one| most.max(one.abs()));
    if mean > NEARLY_IN_PLANE * length || !loaded(normal) {
        return Err(PostureError::UnknownFrame {
            off: largest,
            length,
        });
    }
    let onto = positions
        .iter()
        .zip(&off)
        .map(|(p, off)| *p - *off * normal);
    Ok(ChosenPlane {
        plane: Some(normal),
        positions: Some(onto.collect()),
        off: Some(largest),
    })
}

/// Whether no load of a rod leads out of the plane with this normal.
fn is_loaded_within(rod: &HangingRod, normal: DVec3, length: f64) -> bool {
    let places = [0.0, 0.25, 0.5, 0.75, 1.0].into_iter().chain(rod.kinks());
    let along = places
        .flat_map(RodPlace::both_sides)
        .map(|place| length * rod.load(place));
    let points = rod.points.iter().map(|point| point.force);
    let all: Vec<DVec3> = along.chain(points).chain([rod.tip_force]).collect();
    let most = all
        .iter()
        .fold(0.0_f64, |most, force| most.max(force.length()));
    all.iter()
        .all(|force| force.dot(normal).abs() <= IN_PLANE * most)
}

/// The unit normal of the plane in which all points lie, if there is one; of points on a line that in which the loads
/// lie as well.
fn plane_through(positions: &[DVec3], rod: &HangingRod, length: f64) -> Option<DVec3> {
    let base = positions[0];
    let far = positions.iter().map(|p| *p - base);
    let far = far
        .max_by(|a, b| a.length().total_cmp(&b.length()))?
        .normalize_or_zero();
    let beside = |p: &DVec3| (*p - base) - (*p - base).dot(far) * far;
    let widest = positions.iter().map(beside);
    let widest = widest.max_by(|a, b| a.length().total_cmp(&b.length()))?;
    let normal = if widest.length() > IN_PLANE * length {
        far.cross(widest).normalize_or_zero()
    } else {
        let pull = rod.total_load(length);
        let beside = pull - pull.dot(far) * far;
        match beside.length() > LEVEL * pull.length() {
            true => far.cross(beside).normalize_or_zero(),
            // A column under a load along it: any plane through both.
            false => far.any_orthonormal_vector(),
        }
    };
    let normal = match normal {
        // A column along e3 stands in the x-z plane.
        _ if far.z.abs() > 1.0 - LEVEL && widest.length() <= IN_PLANE * length => DVec3::Y,
        normal => normal,
    };
    let normal = if normal.y < 0.0 || normal.y == 0.0 && (normal.x < 0.0 || normal.z < 0.0) {
        -normal
    } else {
        normal
    };
    let all = positions
        .iter()
        .all(|p| (*p - base).dot(normal).abs() <= IN_PLANE * length);
    all.then_some(normal)
}

/// The normal of the upright plane that is nearest to the points.
fn upright_plane(positions: &[DVec3]) -> DVec3 {
    let middle = positions.iter().sum::<DVec3>() / positions.len() as f64;
    let (mut xx, mut xy, mut yy) = (0.0, 0.0, 0.0);
    for point in positions {
        let p = *point - middle;
        (xx, xy, yy) = (xx + p.x * p.x, xy + p.x * p.y, yy + p.y * p.y);
    }
    // The direction of the larger spread.
    let along = 0.5 * (2.0 * xy).atan2(xx - yy);
    DVec3::new(-along.sin(), along.cos(), 0.0)
}
