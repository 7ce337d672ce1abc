//! Curvatures and moments along a posture, the curvature at rest at a modulus with its bands, and the leaf without
//! its loads.

use crate::numbers::GAUSS_LEGENDRE_RULE;
use crate::posture::frame::FrameRule;
use crate::posture::line::{Elements, POINTS};
use crate::posture::smoothing::local_basis;
use crate::posture::{Centreline, Posture};
use crate::shape::{NodeState, RodShape};
use glam::{DMat3, DQuat, DVec3};
use nalgebra::DVector;

/// Equal parts of the length at whose ends a posture is told.
pub const PARTS: usize = 64;

/// A place along a posture. Components are along the directors d1, d2, d3.
#[derive(Clone, Copy, Debug, Default)]
pub struct Station {
    /// Fraction of the length.
    pub sigma: f64,
    /// Centreline.
    pub position: DVec3,
    /// Directors.
    pub directors: DMat3,
    /// Curvature u: twist, and bends about d2 and d3.
    pub curvature: DVec3,
    /// Force n; where a force acts on the point, that towards the tip.
    pub force: DVec3,
    /// Moment m; where a force acts off the axis, that towards the tip, at the tip itself that before it.
    pub moment: DVec3,
    /// A^-1 m at the modulus 1: at the modulus E the curvature at rest is u less this divided by E.
    pub compliance: DVec3,
    /// Standard deviations of the curvature by the noise of the points, to first order.
    pub curvature_deviation: DVec3,
    /// Standard deviations of the moment.
    pub moment_deviation: DVec3,
    /// Covariance of each component of the curvature with that of A^-1 m, and variance of the latter.
    covariance: [DVec3; 2],
}

impl Station {
    /// The curvature at rest at a modulus.
    pub fn rest_curvature(&self, young: f64) -> DVec3 {
        self.curvature - self.compliance / young
    }

    /// Its standard deviations.
    pub fn rest_deviation(&self, young: f64) -> DVec3 {
        let [mixed, squared] = self.covariance;
        let variance = self.curvature_deviation * self.curvature_deviation - 2.0 * mixed / young
            + squared / (young * young);
        variance.max(DVec3::ZERO).map(f64::sqrt)
    }
}

/// A posture at equal parts of its length, and between them.
#[derive(Clone, Debug)]
pub struct Stations {
    /// The ends of the parts, base and tip among them, and the rod's kinks.
    pub ends: Vec<Station>,
    /// Gauss points between them, five for each part.
    between: Vec<Station>,
    /// The length.
    pub length: f64,
    /// Fractions of the length where A^-1 m jumps, and with it the curvature at rest.
    jumps: Vec<f64>,
}

impl Posture {
    /// The posture at the ends of equal parts of its length, with bands if `bands`.
    pub fn stations(&self, bands: bool) -> Stations {
        let curve = |t: f64| self.centreline.at(t);
        let mut elements = Elements::at_equal_parts(&self.rod, PARTS, &curve);
        let (at, is_end) = elements.ends_and_points();
        let points: Vec<_> = at.iter().map(|&t| curve(t)).collect();
        let first: Vec<DVec3> = points.iter().map(|point| point.first).collect();
        let positions: Vec<DVec3> = points.iter().map(|point| point.position).collect();
        let tangents: Vec<DVec3> = first.iter().map(|d| d.normalize_or_zero()).collect();
        let frames = self
            .frame_rule
            .along(self.base.rotation(), &at, &positions, &tangents);
        elements.add_levers(&self.rod, &first, &frames);
        let found = elements.moments_everywhere(&first);
        let sigma = elements.sigma_everywhere();
        let station = |k: usize| {
            let directors = frames[k];
            let moment = directors.transpose() * found.moments[k];
            let stiffness = DVec3::from_array(elements.stiffness_everywhere(&self.rod, k));
            Station {
                sigma: sigma[k],
                position: positions[k],
                directors,
                curvature: self.curvature(at[k], first[k], points[k].second, directors),
                force: directors.transpose() * found.forces[k],
                moment,
                compliance: moment / stiffness,
                ..Station::default()
            }
        };
        let mut all: Vec<Station> = (0..at.len()).map(station).collect();
        if bands {
            self.add_bands(&elements, &at, &mut all);
        }
        let (mut ends, mut between) = (Vec::new(), Vec::new());
        for (station, is_end) in all.into_iter().zip(is_end) {
            if is_end {
                ends.push(station)
            } else {
                between.push(station)
            }
        }
        Stations {
            ends,
            between,
            length: found.length,
            jumps: self.rod.compliance_jumps(),
        }
    }

    /// The curvature along the directors.
    fn curvature(&self, t: f64, first: DVec3, second: DVec3, directors: DMat3) -> DVec3 {
        let speed = first.length();
        let bend = first.cross(second) / speed.powi(3);
        let [_, d2, d3] = [directors.x_axis, directors.y_axis, directors.z_axis];
        let [second, third] = [bend.dot(d2), bend.dot(d3)];
        let twist = match &self.frame_rule {
            FrameRule::Transported => 0.0,
            FrameRule::Measured(normals) => {
                let normal = normals.at(t);
                let along = normal.position.dot(directors.x_axis);
                let across = (normal.position - along * directors.x_axis).length();
                -(normal.first.dot(d2) / speed - along * third) / across
            }
        };
        DVec3::new(twist, second, third)
    }

    /// Adds what the noise of the points makes of curvatures and moments.
    fn add_bands(&self, elements: &Elements, at: &[f64], stations: &mut [Station]) {
        let Centreline::Smoothed(smoothed) = &self.centreline else {
            return;
        };
        let size = smoothed.curve.count();
        let rows: Vec<_> = at
            .iter()
            .map(|&t| local_basis(smoothed.curve.intervals(), t))
            .collect();
        let points: Vec<_> = rows
            .iter()
            .map(|basis| smoothed.curve.point(basis))
            .collect();
        let step = 1e-6 * self.length();
        for axis in self.noisy_axes() {
            // Rows: coefficients; columns: three curvatures and three moments of each station.
            let mut gradients = vec![DVector::<f64>::zeros(size); 6 * at.len()];
            for j in 0..size {
                let changed = |by: f64| -> Vec<[DVec3; 2]> {
                    let first: Vec<[DVec3; 2]> = (rows.iter().zip(&points))
                        .map(|(basis, point)| {
                            let rate = |order: usize| {
                                let local =
                                    basis.derivatives[order].get(j.wrapping_sub(basis.first));
                                by * local.copied().unwrap_or(0.0) * axis
                            };
                            [point.first + rate(1), point.second + rate(2)]
                        })
                        .collect();
                    let derivatives: Vec<DVec3> = first.iter().map(|[d, _]| *d).collect();
                    let moments = elements.moments_everywhere(&derivatives).moments;
                    let own = first.iter().zip(moments).zip(stations.iter()).zip(at);
                    own.map(|((([d, dd], moment), station), &t)| {
                        [
                            self.curvature(t, *d, *dd, station.directors),
                            station.directors.transpose() * moment,
                        ]
                    })
                    .collect()
                };
                let [above, below] = [changed(step), changed(-step)];
                for k in 0..at.len() {
                    for part in 0..2 {
                        let rate = (above[k][part] - below[k][part]) / (2.0 * step);
                        for component in 0..3 {
                            gradients[6 * k + 3 * part + component][j] = rate[component];
                        }
                    }
                }
            }
            for (k, station) in stations.iter_mut().enumerate() {
                for component in 0..3 {
                    let [u, m] = [0, 3].map(|part| &gradients[6 * k + part + component]);
                    let [by_u, by_m] = [u, m].map(|gradient| &smoothed.covariance * gradient);
                    let factor = match station.moment[component] {
                        moment if moment != 0.0 => station.compliance[component] / moment,
                        _ => 0.0,
                    };
                    station.curvature_deviation[component] += u.dot(&by_u);
                    station.moment_deviation[component] += m.dot(&by_m);
                    station.covariance[0][component] += factor * u.dot(&by_m);
                    station.covariance[1][component] += factor * factor * m.dot(&by_m);
                }
            }
        }
        for station in stations {
            station.curvature_deviation =
                station.curvature_deviation.max(DVec3::ZERO).map(f64::sqrt);
            station.moment_deviation = station.moment_deviation.max(DVec3::ZERO).map(f64::sqrt);
        }
    }
}

/// A place and the tangent of a curve.
#[derive(Clone, Copy, Debug)]
pub struct LinePoint {
    /// The place.
    pub position: DVec3,
    /// The unit tangent.
    pub tangent: DVec3,
}

/// The curve of a curvature that is linear between fractions of its length, by the series of W. Magnus (Commun. Pure
/// Appl. Math. 7 (1954), 649) to fourth order and Simpson's rule.
pub fn integrate_curvature(
    sigma: &[f64],
    curvature: &[DVec3],
    length: f64,
    origin: DVec3,
    base: DQuat,
) -> Vec<LinePoint> {
    let (mut position, mut rotation) = (origin, base);
    let mut found = vec![LinePoint {
        position,
        tangent: rotation * DVec3::X,
    }];
    for e in 0..sigma.len() - 1 {
        let ds = (sigma[e + 1] - sigma[e]) * length;
        let (from, to) = (curvature[e], curvature[e + 1]);
        let turned = |part: f64| {
            let end = from.lerp(to, part);
            let h = part * ds;
            let turn = 0.5 * h * (from + end) + h * h / 12.0 * from.cross(end);
            rotation * DQuat::from_scaled_axis(turn)
        };
        let tangents = [0.0, 0.5, 1.0].map(|part| turned(part) * DVec3::X);
        position += ds / 6.0 * (tangents[0] + 4.0 * tangents[1] + tangents[2]);
        rotation = turned(1.0).normalize();
        found.push(LinePoint {
            position,
            tangent: rotation * DVec3::X,
        });
    }
    found
}

impl Stations {
    /// The posture as a shape from which a relaxation begins: fractions of the length, and the vein there.
    pub fn to_shape(&self) -> (Vec<f64>, Vec<RodShape>) {
        let node = |station: &Station| NodeState {
            position: station.position,
            rotation: DQuat::from_mat3(&station.directors).normalize(),
            v: DVec3::X,
            u: station.curvature,
            n: station.force,
            m: station.moment,
        };
        let rod = RodShape {
            length: self.length,
            nodes: self.ends.iter().map(node).collect(),
        };
        let at = self.ends.iter().map(|station| station.sigma).collect();
        (at, vec![rod])
    }

    /// The numbers of the first and the last end of each stretch without a jump.
    fn smooth_stretches(&self) -> Vec<[usize; 2]> {
        let is_jump = |station: &Station| {
            let mut jumps = self.jumps.iter();
            jumps.any(|at| (at - station.sigma).abs() < 1e-9)
        };
        let mut stretches = Vec::new();
        let mut from = 0;
        for k in 1..self.ends.len() {
            if k + 1 == self.ends.len() || is_jump(&self.ends[k]) {
                stretches.push([from, k]);
                from = k;
            }
        }
        stretches
    }

    /// The fractions of the length between which projections are linear: those of the ends of the parts, twice where
    /// the curvature at rest jumps.
    pub fn knots(&self) -> Vec<f64> {
        let stretches = self.smooth_stretches().into_iter();
        let each = stretches.flat_map(|[from, to]| &self.ends[from..=to]);
        each.map(|station| station.sigma).collect()
    }

    /// The curvature at rest at a modulus as a function that is linear between its [knots](Stations::knots).
    pub fn linear_rest_curvature(&self, young: f64) -> Vec<DVec3> {
        self.project(&|station| station.rest_curvature(young))
    }

    /// A quantity as a function that is linear between its [knots](Stations::knots), and continuous but where the
    /// curvature at rest jumps: that with the least integral of the squared difference, so that the angles of a curve
    /// with this curvature are right to fourth order.
    pub fn project(&self, of: &dyn Fn(&Station) -> DVec3) -> Vec<DVec3> {
        let stretches = self.smooth_stretches().into_iter();
        let each = stretches.flat_map(|[from, to]| self.project_stretch(from, to, of));
        each.collect()
    }

    /// The projection on the parts between the ends of these numbers.
    fn project_stretch(
        &self,
        from: usize,
        to: usize,
        of: &dyn Fn(&Station) -> DVec3,
    ) -> Vec<DVec3> {
        let ends = &self.ends[from..=to];
        let count = ends.len();
        let (mut diagonal, mut beside) = (vec![0.0; count], vec![0.0; count]);
        let mut right = vec![DVec3::ZERO; count];
        for e in 0..count - 1 {
            let width = ends[e + 1].sigma - ends[e].sigma;
            diagonal[e] += width / 3.0;
            diagonal[e + 1] += width / 3.0;
            beside[e] = width / 6.0;
            let between = &self.between[(from + e) * POINTS..];
            for (point, station) in GAUSS_LEGENDRE_RULE.iter().zip(between) {
                let part = (station.sigma - ends[e].sigma) / width;
                let value = width * point.weight * of(station);
                right[e] += (1.0 - part) * value;
                right[e + 1] += part * value;
            }
        }
        for k in 1..count {
            let factor = beside[k - 1] / diagonal[k - 1];
            diagonal[k] -= factor * beside[k - 1];
            let before = right[k - 1];
            right[k] -= factor * before;
        }
        for k in (0..count).rev() {
            let behind = if k + 1 < count {
                beside[k] * right[k + 1]
            } else {
                DVec3::ZERO
            };
            right[k] = (right[k] - behind) / diagonal[k];
        }
        right
    }

    /// The centreline without loads at a modulus, at the ends of the parts: its curvature is the one at rest.
    pub fn unloaded(&self, young: f64, base: DQuat) -> Vec<DVec3> {
        let curvature = self.linear_rest_curvature(young);
        let knots = self.knots();
        let origin = self.ends[0].position;
        let line = integrate_curvature(&knots, &curvature, self.length, origin, base);
        // Where the curvature jumps two knots are one end.
        let is_first = |k: &usize| *k == 0 || knots[*k] > knots[*k - 1];
        let ends = (0..knots.len()).filter(is_first);
        ends.map(|k| line[k].position).collect()
    }
}
