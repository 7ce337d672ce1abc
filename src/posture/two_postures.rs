//! Young's modulus from two postures of one leaf, as hung and turned over.
//!
//! The curvature at rest is the same in both, so that along the leaf
//!
//! ```text
//!   u_a - u_b = c A^-1 (m_a - m_b),      c = 1/E
//! ```
//!
//! Curvatures of noisy points are far less known than their places. So c is that with which the curve of curvature
//! u_a - c A^-1 (m_a - m_b), from a base that may move and turn a little, passes nearest to the points of the second
//! posture, across its tangents.

use crate::posture::frame::{BaseFrame, FrameRule};
use crate::posture::intervals::student_quantile;
use crate::posture::rest::{Stations, integrate_curvature};
use crate::posture::{Centreline, Posture};
use glam::{DQuat, DVec3};
use nalgebra::{DMatrix, DVector};

/// What two postures tell of the modulus.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TwoPostures {
    /// c = 1/E.
    pub compliance: f64,
    /// Its standard deviation by the noise of the points, to first order.
    pub deviation: f64,
    /// The largest angle by which the leaf turns from one posture to the other, besides its base.
    pub turn: f64,
    /// Number of independent residuals that tell the noise.
    pub freedom: f64,
    /// Root of the mean square distance of the points of the second posture from the predicted curve, across it.
    pub misfit: f64,
}

/// Factor on standard deviations of first order, besides the quantile of Student's distribution, with which 95 %
/// intervals of c hold in 93 of 100 twins (`tests/statics/postures`).
const COVERAGE_FACTOR: f64 = 1.3;

/// Most Newton steps; two to five are needed.
const ITERATIONS: usize = 12;

/// Unknowns: c, a turn of the base, and its displacement.
const UNKNOWNS: usize = 7;

/// Singular values below this fraction of the largest are those of turns and displacements out of a plane.
const NEGLIGIBLE: f64 = 1e-8;

impl TwoPostures {
    /// The 95 % interval of c.
    pub fn interval(&self) -> [f64; 2] {
        let half = COVERAGE_FACTOR * student_quantile(self.freedom) * self.deviation;
        [self.compliance - half, self.compliance + half]
    }
}

/// A prediction of the second posture.
struct Prediction<'p> {
    sigma: &'p [f64],
    /// Curvature of the first posture per fraction of the length, at the ends of the parts.
    curvature: Vec<DVec3>,
    /// A^-1 m of both postures, likewise.
    compliance: [Vec<DVec3>; 2],
    /// Whether the directors of the second posture are carried on without a twist, in place of the material's.
    is_transported: bool,
    /// The length, the unit of displacements.
    length: f64,
    base: DQuat,
    origin: DVec3,
    /// Fractions of the length of the points of the second posture.
    at: &'p [f64],
    /// Unit of c.
    unit: f64,
}

impl Prediction<'_> {
    /// The curvature of the second posture at a compliance c. In the second posture the material is twisted against
    /// directors that are carried on without a twist: the angle between them is the integral of its twist.
    fn curvature_of_second(&self, c: f64) -> Vec<DVec3> {
        let (mut angle, mut twist_before) = (0.0, 0.0);
        let mut curvature = Vec::with_capacity(self.sigma.len());
        for k in 0..self.sigma.len() {
            let [first, second] = self.compliance.each_ref().map(|of| of[k]);
            // A torque is about the tangent, whatever the other directors are.
            let twist = self.curvature[k].x - c * (first.x - second.x);
            if self.is_transported && k > 0 {
                let width = self.sigma[k] - self.sigma[k - 1];
                angle += 0.5 * width * (twist_before + twist);
            }
            twist_before = twist;
            let (sin, cos) = angle.sin_cos();
            let turned = DVec3::new(
                second.x,
                cos * second.y + sin * second.z,
                cos * second.z - sin * second.y,
            );
            curvature.push(self.curvature[k] - c * (first - turned));
        }
        curvature
    }

    /// The places of the points.
    fn places(&self, unknowns: &[f64]) -> Vec<DVec3> {
        let curvature = self.curvature_of_second(unknowns[0] * self.unit);
        let turn = DQuat::from_scaled_axis(DVec3::from_slice(&unknowns[1..4]));
        let origin = self.origin + self.length * DVec3::from_slice(&unknowns[4..7]);
        let line = integrate_curvature(
            self.sigma,
            &curvature,
            1.0,
            origin / self.length,
            turn * self.base,
        );
        let mut end = 1;
        let place = |&at: &f64| {
            while end + 1 < self.sigma.len() && self.sigma[end] < at {
                end += 1;
            }
            let width = self.sigma[end] - self.sigma[end - 1];
            let x = (at - self.sigma[end - 1]) / width;
            let (from, to) = (line[end - 1], line[end]);
            // Hermite's cubic through both ends with their tangents.
            let [x2, x3] = [x * x, x * x * x];
            let value = (2.0 * x3 - 3.0 * x2 + 1.0) * from.position
                + (x3 - 2.0 * x2 + x) * width * from.tangent
                + (3.0 * x2 - 2.0 * x3) * to.position
                + (x3 - x2) * width * to.tangent;
            self.length * value
        };
        self.at.iter().map(place).collect()
    }
}

/// Differences across the tangents.
fn across(differences: &[DVec3], tangents: &[DVec3]) -> DVector<f64> {
    let each = differences.iter().zip(tangents);
    let each = each.flat_map(|(d, t)| (*d - d.dot(*t) * *t).to_array());
    DVector::from_iterator(3 * differences.len(), each)
}

/// Whether the directors of a posture were measured.
fn has_measured_directors(posture: &Posture) -> bool {
    matches!(posture.frame_rule, FrameRule::Measured(_))
}

/// The modulus from two postures, the second of which shows the leaf turned by `roll` (radians) about the direction of
/// its base. `None` if the second has no points, or the equations cannot be solved.
pub fn compare(a: &Posture, b: &Posture, roll: f64) -> Option<TwoPostures> {
    let b = &match has_measured_directors(b) {
        true => b.clone(),
        false => Posture {
            base: BaseFrame {
                roll: b.base.roll + roll,
                ..b.base
            },
            ..b.clone()
        },
    };
    let smoothed = b.smoothing()?;
    let at = b.fractions_of(&smoothed.at);
    let points = &smoothed.points;
    let tangents: Vec<DVec3> = smoothed
        .at
        .iter()
        .map(|&t| b.centreline.at(t).first.normalize_or_zero())
        .collect();
    let stations_b = b.stations(false);
    let first = a.stations(false);
    let sigma = first.knots();
    let length = 0.5 * (first.length + stations_b.length);
    let moments_b = stations_b.project(&|station| station.compliance);
    let unit = {
        let bend: f64 = first.ends.iter().map(|it| it.curvature.length()).sum();
        let load: f64 = first.ends.iter().map(|it| it.compliance.length()).sum();
        (bend + 1.0 / length) / load.max(f64::MIN_POSITIVE)
    };
    let prediction = |stations: &Stations| Prediction {
        sigma: &sigma,
        curvature: (stations.project(&|station| station.curvature).iter())
            .map(|u| stations.length * *u)
            .collect(),
        compliance: [&stations.project(&|station| station.compliance), &moments_b]
            .map(|of| of.iter().map(|p| length * *p).collect()),
        is_transported: !has_measured_directors(b),
        length,
        base: b.base.rotation(),
        origin: b.centreline.at(0.0).position,
        at: &at,
        unit,
    };
    let predicted = prediction(&first);
    let mut unknowns = [0.0; UNKNOWNS];
    unknowns[0] = initial_compliance(&first, &stations_b) / unit;
    let residuals = |places: &[DVec3]| {
        let differences: Vec<DVec3> = points.iter().zip(places).map(|(p, q)| *p - *q).collect();
        across(&differences, &tangents)
    };
    let mut gain = None;
    for _ in 0..ITERATIONS {
        let places = predicted.places(&unknowns);
        let columns = (0..UNKNOWNS).map(|k| {
            let step = 1e-6;
            let moved = |by: f64| {
                let mut moved = unknowns;
                moved[k] += by;
                predicted.places(&moved)
            };
            let (above, below) = (moved(step), moved(-step));
            let rates: Vec<DVec3> = above
                .iter()
                .zip(below)
                .map(|(a, b)| (*a - b) / (2.0 * step))
                .collect();
            across(&rates, &tangents)
        });
        let jacobian = DMatrix::from_columns(&columns.collect::<Vec<_>>());
        let largest = jacobian.singular_values().max();
        let inverse = jacobian.pseudo_inverse(NEGLIGIBLE * largest).ok()?;
        let step = &inverse * residuals(&places);
        for (unknown, step) in unknowns.iter_mut().zip(step.iter()) {
            *unknown += step;
        }
        gain = Some(inverse);
        if step.amax() < 1e-10 {
            break;
        }
    }
    let gain = gain?.row(0).transpose() * unit;
    let places = predicted.places(&unknowns);
    let left = residuals(&places);
    let variance_b = gain.norm_squared() * smoothed.deviation * smoothed.deviation;
    let variance_a = variance_by_first(a, &|changed| {
        let moved = prediction(&changed.stations(false)).places(&unknowns);
        let differences: Vec<DVec3> = moved.iter().zip(&places).map(|(p, q)| *p - *q).collect();
        gain.dot(&across(&differences, &tangents))
    });
    let compliance = unknowns[0] * unit;
    Some(TwoPostures {
        compliance,
        deviation: (variance_a + variance_b).sqrt(),
        turn: largest_turn(&first, &stations_b),
        freedom: [Some(smoothed), a.smoothing()]
            .into_iter()
            .flatten()
            .map(|it| it.residual_freedom)
            .sum(),
        misfit: (left.norm_squared() / points.len() as f64).sqrt(),
    })
}

/// c by the curvatures alone, weighted with the moments.
fn initial_compliance(a: &Stations, b: &Stations) -> f64 {
    let (mut mixed, mut squared) = (0.0, 0.0);
    for (one, other) in a.ends.iter().zip(&b.ends) {
        let by = one.compliance - other.compliance;
        mixed += by.dot(one.curvature - other.curvature);
        squared += by.length_squared();
    }
    mixed / squared.max(f64::MIN_POSITIVE)
}

/// The largest angle between both leaves, each as seen from its base.
fn largest_turn(a: &Stations, b: &Stations) -> f64 {
    let own = |stations: &Stations, k: usize| {
        stations.ends[0].directors.transpose() * stations.ends[k].directors
    };
    let angles = (0..a.ends.len().min(b.ends.len())).map(|k| {
        let between = own(a, k).transpose() * own(b, k);
        let trace = between.x_axis.x + between.y_axis.y + between.z_axis.z;
        (0.5 * (trace - 1.0)).clamp(-1.0, 1.0).acos()
    });
    angles.fold(0.0, f64::max)
}

/// The variance of a number that changes with the first posture, by the noise of its points.
fn variance_by_first(a: &Posture, number: &dyn Fn(&Posture) -> f64) -> f64 {
    let Centreline::Smoothed(smoothed) = &a.centreline else {
        return 0.0;
    };
    let step = 1e-5 * a.length();
    let mut variance = 0.0;
    for axis in a.noisy_axes() {
        let gradient = DVector::from_fn(smoothed.curve.count(), |j, _| {
            let mut changed = smoothed.clone();
            changed.curve.shift(j, step * axis);
            let changed = Posture {
                centreline: Centreline::Smoothed(changed),
                ..a.clone()
            };
            number(&changed) / step
        });
        variance += gradient.dot(&(&smoothed.covariance * &gradient));
    }
    variance
}
