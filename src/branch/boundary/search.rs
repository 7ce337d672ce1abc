//! The search for a point of a boundary: the zero of an eigenvalue across it.

use super::sheet::{Direction, Sample, Sheet, Spot};
use crate::branch::equations::{ITERATIONS, LARGEST, Stuck};
use crate::branch::field::{add, combined, dot, is_finite, largest, times};
use crate::leaf::Field;
use crate::newton::{Contraction, converged};

/// Evaluations in the search for a zero.
const EVALUATIONS: usize = 30;

/// A slope from points nearer than this is rounding.
const LOCAL: f64 = 1e-6;

/// Newton's method for state and boundary together knows the change of the eigenvalue to
/// this part; increments below the other that do not shrink are rounding.
const SLOPES: f64 = 1e-3;
const ROUNDED: f64 = 1e-9;

/// What one evaluation says of the modes that become neutral.
pub struct Eigen {
    /// The mean of their eigenvalues, and how far these are apart.
    pub value: f64,
    pub spread: f64,
    /// Eigenvectors of H: first theirs, then the others with their eigenvalues.
    pub vectors: Vec<Vec<f64>>,
    pub others: Vec<f64>,
}

/// Why no point of a boundary is there.
#[derive(Clone, Debug)]
pub enum Lost {
    /// No solution was found.
    Stuck(Stuck),
    /// The modes do not become neutral together.
    Parted,
    /// The mode feels the number, so that branches do not cross.
    Unfolded,
}

impl<E: Into<Stuck>> From<E> for Lost {
    fn from(stuck: E) -> Self {
        Lost::Stuck(stuck.into())
    }
}

/// How a point of a boundary is sought from a spot.
pub struct Search<'s> {
    /// From here,
    pub spot: &'s Spot,
    /// this way, along which the eigenvalue changes so much,
    pub across: &'s Direction,
    pub slope: f64,
    /// in the plane normal to this,
    pub along: &'s Direction,
    /// with these modes in the border, of which so many, the first, become neutral,
    pub held: &'s [Field],
    pub neutral: usize,
    /// to this accuracy, and not further.
    pub accuracy: f64,
    pub furthest: f64,
}

/// A point without directions.
pub struct Found {
    pub sample: Sample,
    pub eigen: Eigen,
    /// How far from the start of the search.
    pub distance: f64,
}

impl Found {
    /// Where it is.
    pub fn spot(&self) -> &Spot {
        &self.sample.spot
    }
}

/// The eigenvalues of H, of which so many modes of the border, its first, become neutral.
pub fn eigen(sample: &Sample, neutral: usize) -> Eigen {
    let all = sample.solved.h.clone().symmetric_eigen();
    let count = all.eigenvalues.len();
    // The neutral modes are the first of the border.
    let weight = |k: usize| -> f64 {
        let own = (0..neutral).map(|i| all.eigenvectors[(i, k)].powi(2));
        own.sum()
    };
    let mut order: Vec<usize> = (0..count).collect();
    order.sort_by(|&a, &b| weight(b).total_cmp(&weight(a)));
    let values: Vec<f64> = order.iter().map(|&k| all.eigenvalues[k]).collect();
    let (own, others) = values.split_at(neutral.min(count));
    let most = own.iter().fold(f64::NEG_INFINITY, |m, v| m.max(*v));
    let least = own.iter().fold(f64::INFINITY, |m, v| m.min(*v));
    let vector = |&k: &usize| all.eigenvectors.column(k).iter().copied().collect();
    Eigen {
        value: own.iter().sum::<f64>() / neutral as f64,
        spread: most - least,
        vectors: order.iter().map(vector).collect(),
        others: others.to_vec(),
    }
}

impl Search<'_> {
    /// The same point by Newton's method for the state and the zero of the eigenvalue
    /// together, from near it, and what it leaves. Where branches cross, the modes are
    /// `frozen`: the sheet is that of a symmetric branch, whose forces do not excite them.
    /// Of one that crosses askew this does not find the point: with the matrix singular,
    /// nothing tells how much of the mode it has.
    pub fn near(
        &self,
        sheet: &mut Sheet,
        frozen: bool,
        contraction: &mut Contraction,
    ) -> Result<(Found, f64), Lost> {
        let border: Vec<Field> = (self.held.iter())
            .map(|mode| sheet.equations.momentum(mode))
            .collect();
        let along = sheet.equations.momentum(&self.along.increments);
        let mut spot = sheet.with_forces(self.spot)?;
        let mut previous = f64::INFINITY;
        for _ in 0..ITERATIONS {
            let rates = sheet.rates(&spot)?;
            let (mut sample, noise) = sheet.sample(spot, &border, rates, false)?;
            let eigen = eigen(&sample, self.neutral);
            let forces = &sample.solved.forces.multipliers;
            let excited = |mode: &Vec<f64>| {
                let force: f64 = mode.iter().zip(forces).map(|(part, f)| part * f).sum();
                force.abs() > noise
            };
            if frozen && eigen.vectors[..self.neutral].iter().any(excited) {
                break;
            }
            let (slope, numbers) = self.change(sheet, &sample, &eigen, &border, frozen)?;
            let value = eigen.value / self.slope;
            let functions = [
                (&along, self.along.place.as_slice(), 0.0),
                (&slope, numbers.as_slice(), value),
            ];
            let (increments, changes) = sample.solved.step(&functions, noise)?;
            let size = largest(&increments)
                .max(changes[0].abs())
                .max(changes[1].abs());
            if !is_finite(&increments) || !size.is_finite() || size > LARGEST {
                break;
            }
            let place = [0, 1].map(|i| sample.spot.place[i] + changes[i]);
            let state = sheet.advanced(&sample.spot.state, place, &increments, 1.0)?;
            spot = Spot { state, place };
            contraction.learn(size, previous);
            let first = contraction.after_first(size, 0.0);
            let accuracy = (self.accuracy, ROUNDED);
            // Where slopes are known worse, increments shrink no faster than these are known.
            let slopes = SLOPES.max(size / previous);
            if let Some(left) = converged(size, previous, [slopes; 2], accuracy, first) {
                let distance = sheet.along(&sheet.way(self.spot, &spot), self.across);
                sample.spot = spot;
                let found = Found {
                    sample,
                    eigen,
                    distance,
                };
                return Ok((found, left));
            }
            previous = size;
        }
        Err(Lost::Stuck(Stuck::NotConverged))
    }

    /// The change of the eigenvalue with increments and numbers, in units of that across.
    fn change(
        &self,
        sheet: &mut Sheet,
        sample: &Sample,
        eigen: &Eigen,
        border: &[Field],
        frozen: bool,
    ) -> Result<(Field, [f64; 2]), Lost> {
        let own = &eigen.vectors[..self.neutral];
        let modes = own.iter().map(|it| combined(it, &sample.solved.modes));
        let modes: Vec<Field> = modes.collect();
        let part = 1.0 / (self.slope * self.neutral as f64);
        let mut all = times(&modes[0], 0.0);
        let mut numbers = [0.0; 2];
        for mode in &modes {
            let (change, rates) = sheet.curvature_change(&sample.spot, mode)?;
            add(&mut all, part, &change);
            for (number, rate) in numbers.iter_mut().zip(rates) {
                *number += part * rate;
            }
        }
        if frozen {
            for (vector, mode) in own.iter().zip(&modes) {
                let along = dot(&all, mode);
                add(&mut all, -along, &combined(vector, border));
            }
        }
        Ok((all, numbers))
    }

    /// The zero of the eigenvalue by the secant method.
    pub fn run(&self, sheet: &mut Sheet) -> Result<Found, Lost> {
        let border: Vec<Field> = (self.held.iter())
            .map(|mode| sheet.equations.momentum(mode))
            .collect();
        let rates = sheet.rates(self.spot)?;
        // From the last spot, which the next is near.
        let mut at = |from: &Spot, step: f64, distance: f64| -> Result<Found, Lost> {
            let spot = sheet.moved(from, self.across, step)?;
            let sample = sheet.settle(&spot, [self.along, self.across], &border, &rates)?;
            let eigen = eigen(&sample, self.neutral);
            Ok(Found {
                sample,
                eigen,
                distance,
            })
        };
        let (mut distance, mut slope) = (0.0, self.slope);
        let mut best = at(self.spot, 0.0, distance)?;
        let (mut value, mut last) = (best.eigen.value, best.spot().clone());
        let mut worse = 0;
        for _ in 0..EVALUATIONS {
            let step = -value / slope;
            if !step.is_finite() || (distance + step).abs() > self.furthest {
                return Err(Lost::Stuck(Stuck::NotConverged));
            }
            if step.abs() < self.accuracy {
                return Ok(best);
            }
            let next = at(&last, step, distance + step)?;
            let after = next.eigen.value;
            last.clone_from(next.spot());
            if step.abs() > LOCAL {
                slope = (after - value) / step;
            }
            (distance, value) = (distance + step, after);
            match after.abs() < best.eigen.value.abs() {
                true => best = next,
                false => worse += 1,
            }
            if worse > 1 {
                return Ok(best);
            }
        }
        Err(Lost::Stuck(Stuck::NotConverged))
    }
}
