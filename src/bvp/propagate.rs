//! Exact sensitivities: how a perturbation of one rod travels through the
//! leaf. The linearised equations are integrated by the steps the solution
//! itself was integrated by.

use std::ops::Range;

use super::dop853::Integrator;
use super::equations::{Derivatives, Equations, TANGENT};
use super::tableau::{A, B, C, STAGES};
use glam::DMat3;

/// The linearised equations at the stages of one step.
pub struct LinearStep {
    width: f64,
    /// Stage after stage, rod after rod.
    derivatives: Vec<Derivatives>,
}

impl LinearStep {
    /// Of the step the integrator has just made.
    pub fn of(equations: &Equations, integrator: &Integrator) -> Self {
        let (width, begin) = (integrator.width, integrator.sigma - integrator.width);
        LinearStep {
            width,
            derivatives: (0..STAGES)
                .flat_map(|i| {
                    let (y, sigma) = (&integrator.stages[i], begin + C[i] * width);
                    (0..equations.rods()).map(move |j| equations.derivatives(j, sigma, y))
                })
                .collect(),
        }
    }
}

/// Perturbations of `W` different kinds of a range of rods, all others being
/// held: [`TANGENT`] rows of `W` numbers per rod.
#[derive(Clone, Debug)]
pub struct Perturbations<const W: usize> {
    /// The rods perturbed.
    pub rods: Range<usize>,
    /// Rows.
    pub rows: Vec<[f64; W]>,
    stage: Vec<[f64; W]>,
    slopes: Vec<Vec<[f64; W]>>,
}

impl<const W: usize> Perturbations<W> {
    /// Unit perturbations of the last `W` numbers of rod `j`.
    pub fn unit(rods: Range<usize>, j: usize) -> Self {
        let mut rows = vec![[0.0; W]; TANGENT * rods.len()];
        for k in 0..W {
            rows[TANGENT * (j - rods.start) + TANGENT - W + k][k] = 1.0;
        }
        Perturbations {
            rods,
            stage: rows.clone(),
            slopes: vec![rows.clone(); STAGES],
            rows,
        }
    }

    /// Carries them through a step.
    pub fn advance(&mut self, equations: &Equations, step: &LinearStep) {
        for i in 0..STAGES {
            combine(
                &self.rows,
                step.width,
                &A[i][..i],
                &self.slopes,
                &mut self.stage,
            );
            let derivatives = &step.derivatives[i * equations.rods()..];
            slopes(
                equations,
                &derivatives[self.rods.clone()],
                self.rods.start,
                &self.stage,
                &mut self.slopes[i],
            );
        }
        combine(&self.rows, step.width, &B, &self.slopes, &mut self.stage);
        std::mem::swap(&mut self.rows, &mut self.stage);
    }
}

/// The linearised equations of rods `first..`.
fn slopes<const W: usize>(
    equations: &Equations,
    derivatives: &[Derivatives],
    first: usize,
    rows: &[[f64; W]],
    slopes: &mut [[f64; W]],
) {
    for (j, d) in derivatives.iter().enumerate() {
        let at = TANGENT * j;
        let part = |k: usize| &rows[at + 3 * k..at + 3 * k + 3];
        let (theta, n, m) = (part(1), part(2), part(3));
        let out = &mut slopes[at..at + TANGENT];
        products(&mut out[0..3], [(&d.r_theta, theta), (&d.r_n, n)]);
        products(&mut out[3..6], [(&d.theta_theta, theta), (&d.theta_m, m)]);
        products(&mut out[9..12], [(&d.m_theta, theta), (&d.m_n, n)]);
        for k in 0..3 {
            let mut force = [0.0; W];
            // A rod outside the range is held, but pulls all the same.
            let mut pull = |gap: usize, neighbour: Option<usize>| {
                let kappa = equations.coupling(gap)[k];
                if kappa == 0.0 {
                    return;
                }
                for w in 0..W {
                    let other = neighbour.map_or(0.0, |other| rows[TANGENT * other + k][w]);
                    force[w] += kappa * (rows[at + k][w] - other);
                }
            };
            if first + j > 0 {
                pull(first + j - 1, j.checked_sub(1));
            }
            if first + j + 1 < equations.rods() {
                pull(
                    first + j,
                    Some(j + 1).filter(|next| *next < derivatives.len()),
                );
            }
            out[6 + k] = force;
        }
    }
}

/// out = sum of matrix times rows.
#[inline]
fn products<const W: usize>(out: &mut [[f64; W]], terms: [(&DMat3, &[[f64; W]]); 2]) {
    for r in 0..3 {
        let mut sum = [0.0; W];
        for (matrix, rows) in terms {
            for c in 0..3 {
                let factor = matrix.col(c)[r];
                for w in 0..W {
                    sum[w] += factor * rows[c][w];
                }
            }
        }
        out[r] = sum;
    }
}

/// rows + h sum of weights times slopes.
fn combine<const W: usize>(
    rows: &[[f64; W]],
    h: f64,
    weights: &[f64],
    slopes: &[Vec<[f64; W]>],
    result: &mut [[f64; W]],
) {
    for (i, (result, row)) in result.iter_mut().zip(rows).enumerate() {
        let mut sum = *row;
        for (weight, slopes) in weights.iter().zip(slopes) {
            if *weight != 0.0 {
                for w in 0..W {
                    sum[w] += h * weight * slopes[i][w];
                }
            }
        }
        *result = sum;
    }
}

/// The rods that rod `j` is coupled with, directly or through others.
pub fn group(equations: &Equations, j: usize) -> Range<usize> {
    let mut group = j..j + 1;
    while group.start > 0 && equations.coupled(group.start - 1) {
        group.start -= 1;
    }
    while group.end < equations.rods() && equations.coupled(group.end - 1) {
        group.end += 1;
    }
    group
}
