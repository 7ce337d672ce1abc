//! The second variation of the energy at a posture, and the moduli at which its index changes.
//!
//! With R -> R exp(w) and the spatial vector omega = R w of the small rotation, where a prime is d/ds,
//!
//! ```text
//!   delta^2 V = E b - g,      b = integral of omega' . A omega'
//!   g = integral of m . (omega x omega') + (n . omega) (t . omega) - (n . t) |omega|^2
//! ```
//!
//! and of every force F that a section holds off the axis, at the lever a from it, g has
//! (F . omega)(a . omega) - (F . a) |omega|^2 besides: the second variation of -F . (R a),
//! with A at the modulus 1, the force n and the moment m, which do not depend on E, and omega = 0 at the base. The
//! curvature at rest does not appear. So the Morse index at E is the number of mu > E with g omega = mu b omega, and a
//! posture that is stable has E of at least the largest mu. (J. H. Maddocks, Arch. Ration. Mech. Anal. 85 (1984), 311,
//! has the second variation of the planar elastica; in space it follows from the energy of
//! S. S. Antman, Nonlinear Problems of Elasticity, 2005, chapter 8.)
//!
//! The unknown is omega' at the Gauss points, a polynomial of degree 4 in each element: omega follows by integration
//! and vanishes at the base, b is diagonal but for blocks of 3 x 3, and what is left is an ordinary symmetric
//! eigenvalue problem. It is that of continuous elements of degree 5, whose eigenvalues converge as the tenth power
//! of the elements' length.

use crate::numbers::GAUSS_LEGENDRE_RULE;
use crate::posture::line::{Directors, Elements, ForceOffAxis, Line, PARTIAL_INTEGRALS, POINTS};
use glam::DVec3;
use nalgebra::{DMatrix, DVector};

/// Elements of a posture where nothing else is asked for.
pub const ELEMENTS: usize = 6;

/// The small rotation at the Gauss points that makes a posture unstable first.
#[derive(Clone, Debug)]
pub struct CriticalMode {
    /// The modulus below which it does.
    pub young: f64,
    /// omega, in the lab.
    pub rotation: Vec<DVec3>,
    /// d omega/dt, by the parameter.
    pub rate: Vec<DVec3>,
    /// omega at the ends of the elements, from the base.
    pub at_ends: Vec<DVec3>,
}

/// Values of both forms for one rotation.
#[derive(Clone, Copy, Debug)]
struct Forms {
    /// b.
    bending: f64,
    /// g.
    loads: f64,
}

/// The eigenvalue problem of the directions about some of the directors.
pub struct SecondVariation<'a> {
    elements: &'a Elements,
    line: &'a Line,
    directors: &'a Directors,
    /// Directors about which it turns: 0, 1, 2 for d1, d2, d3.
    about: Vec<usize>,
    matrix: DMatrix<f64>,
}

impl<'a> SecondVariation<'a> {
    /// The problem of rotations whose derivative has components along these directors alone.
    pub fn new(
        elements: &'a Elements,
        line: &'a Line,
        directors: &'a Directors,
        about: &[usize],
    ) -> SecondVariation<'a> {
        let (count, per) = (elements.count(), about.len());
        let size = count * per;
        let ds = |k: usize| elements.weight(k) * line.speed[k];
        // Columns: omega' at a Gauss point for a unit of an unknown.
        let mut columns = Vec::with_capacity(size);
        for k in 0..count {
            let frame = directors.at(k, line.tangent[k]);
            for &axis in about {
                let unit = (ds(k) * elements.stiffness[k][axis]).sqrt();
                columns.push(frame.col(axis) / unit);
            }
        }
        // omega at Gauss point i for a unit of omega' at Gauss point k.
        let integral = |i: usize, k: usize| -> f64 {
            let (element, own) = (i / POINTS, k / POINTS);
            match own.cmp(&element) {
                std::cmp::Ordering::Less => ds(k),
                std::cmp::Ordering::Equal => {
                    elements.width(k) * line.speed[k] * PARTIAL_INTEGRALS[i % POINTS][k % POINTS]
                }
                std::cmp::Ordering::Greater => 0.0,
            }
        };
        let mut rotations = DMatrix::zeros(3 * count, size);
        let mut loaded = DMatrix::zeros(3 * count, size);
        let mut matrix = DMatrix::zeros(size, size);
        for i in 0..count {
            let (n, t, m) = (line.force[i], line.tangent[i], line.moment[i]);
            let along = n.dot(t);
            for k in 0..(i / POINTS + 1) * POINTS {
                let factor = integral(i, k);
                for c in 0..per {
                    let omega = factor * columns[k * per + c];
                    let turned = 0.5 * (n.dot(omega) * t + t.dot(omega) * n) - along * omega;
                    for axis in 0..3 {
                        rotations[(3 * i + axis, k * per + c)] = omega[axis];
                        loaded[(3 * i + axis, k * per + c)] = ds(i) * turned[axis];
                    }
                    // m . (omega x omega'), symmetric in both.
                    for d in 0..per {
                        let value = 0.5 * ds(i) * m.dot(omega.cross(columns[i * per + d]));
                        matrix[(k * per + c, i * per + d)] += value;
                        matrix[(i * per + d, k * per + c)] += value;
                    }
                }
            }
        }
        matrix += rotations.tr_mul(&loaded);
        for lever in &line.levers {
            let (mut turns, mut loaded) = (DMatrix::zeros(3, size), DMatrix::zeros(3, size));
            for k in 0..lever.end * POINTS {
                for c in 0..per {
                    let omega = ds(k) * columns[k * per + c];
                    let turned = lever.half_gradient(omega);
                    for axis in 0..3 {
                        turns[(axis, k * per + c)] = omega[axis];
                        loaded[(axis, k * per + c)] = turned[axis];
                    }
                }
            }
            matrix += turns.tr_mul(&loaded);
        }
        let matrix = (&matrix + matrix.transpose()) * 0.5;
        SecondVariation {
            elements,
            line,
            directors,
            about: about.to_vec(),
            matrix,
        }
    }

    /// All mu, the largest first.
    pub fn eigenvalues(&self) -> Vec<f64> {
        let mut all: Vec<f64> = self
            .matrix
            .symmetric_eigenvalues()
            .iter()
            .copied()
            .collect();
        all.sort_by(|a, b| b.total_cmp(a));
        all
    }

    /// The mode of the eigenvalue `young`, by inverse iteration.
    pub fn mode(&self, young: f64) -> Option<CriticalMode> {
        let size = self.matrix.nrows();
        let scale = self.matrix.amax();
        let shift = young + 1e-10 * scale;
        let factor = (&self.matrix - DMatrix::identity(size, size) * shift).lu();
        let mut vector = DVector::from_fn(size, |k, _| 1.0 + 0.3 * (k as f64).sin());
        for _ in 0..3 {
            vector = factor.solve(&vector)?;
            let norm = vector.norm();
            if !(norm.is_finite() && norm > 0.0) {
                return None;
            }
            vector /= norm;
        }
        let (count, per) = (self.elements.count(), self.about.len());
        let derivative: Vec<DVec3> = (0..count)
            .map(|k| {
                let frame = self.directors.at(k, self.line.tangent[k]);
                let ds = self.elements.weight(k) * self.line.speed[k];
                let each = self.about.iter().enumerate().map(|(c, &axis)| {
                    let unit = (ds * self.elements.stiffness[k][axis]).sqrt();
                    vector[k * per + c] / unit * frame.col(axis)
                });
                each.sum::<DVec3>() * self.line.speed[k]
            })
            .collect();
        let mut rotation = Vec::with_capacity(count);
        let mut begin = DVec3::ZERO;
        let mut at_ends = vec![begin];
        for element in derivative.chunks(POINTS) {
            let width = self.elements.width(rotation.len());
            for i in 0..POINTS {
                let part: DVec3 = (0..POINTS)
                    .map(|j| PARTIAL_INTEGRALS[i][j] * element[j])
                    .sum();
                rotation.push(begin + width * part);
            }
            let points = element.iter().zip(&GAUSS_LEGENDRE_RULE);
            begin += width
                * points
                    .map(|(rate, point)| point.weight * *rate)
                    .sum::<DVec3>();
            at_ends.push(begin);
        }
        Some(CriticalMode {
            young,
            rotation,
            rate: derivative,
            at_ends,
        })
    }
}

impl ForceOffAxis {
    /// Half of the gradient of (F . omega)(a . omega) - (F . a) |omega|^2.
    fn half_gradient(&self, omega: DVec3) -> DVec3 {
        let (force, arm) = (self.force, self.arm);
        0.5 * (force.dot(omega) * arm + arm.dot(omega) * force) - force.dot(arm) * omega
    }
}

impl CriticalMode {
    /// Both forms of this rotation, a function of the parameter, on a posture that may be another one.
    fn forms(&self, elements: &Elements, line: &Line, directors: &Directors) -> Forms {
        let mut forms = Forms {
            bending: 0.0,
            loads: 0.0,
        };
        for k in 0..elements.count() {
            let (omega, rate) = (self.rotation[k], self.rate[k]);
            let (n, t, m) = (line.force[k], line.tangent[k], line.moment[k]);
            let weight = elements.weight(k);
            let frame = directors.at(k, t);
            let [a1, a2, a3] = elements.stiffness[k];
            let own = frame.transpose() * rate;
            let bent = a1 * own.x * own.x + a2 * own.y * own.y + a3 * own.z * own.z;
            forms.bending += weight * bent / line.speed[k];
            let turned = n.dot(omega) * t.dot(omega) - n.dot(t) * omega.length_squared();
            forms.loads += weight * (m.dot(omega.cross(rate)) + line.speed[k] * turned);
        }
        for lever in &line.levers {
            let omega = self.at_ends[lever.end];
            forms.loads += omega.dot(lever.half_gradient(omega));
        }
        forms
    }

    /// g/b of this rotation on a posture: its modulus to first order in the posture's change, as that of an
    /// eigenvalue is that of its Rayleigh quotient (Hellmann and Feynman).
    pub fn rayleigh_quotient(
        &self,
        elements: &Elements,
        line: &Line,
        directors: &Directors,
    ) -> f64 {
        let forms = self.forms(elements, line, directors);
        forms.loads / forms.bending
    }

    /// The share of each Gauss point in b, per parameter.
    pub fn bending_density(
        &self,
        elements: &Elements,
        line: &Line,
        directors: &Directors,
    ) -> Vec<f64> {
        let density = |k: usize| {
            let own = directors.at(k, line.tangent[k]).transpose() * self.rate[k];
            let [a1, a2, a3] = elements.stiffness[k];
            (a1 * own.x * own.x + a2 * own.y * own.y + a3 * own.z * own.z) / line.speed[k]
        };
        (0..elements.count()).map(density).collect()
    }
}
