//! The search for a point of a boundary: the zero of an eigenvalue across it.

use super::sheet::{Direction, Near, Sample, Sheet, Spot};
use crate::branch::equations::Stuck;
use crate::leaf::Field;

/// Evaluations in the search for a zero.
const EVALUATIONS: usize = 30;

/// A slope from points nearer than this is rounding.
const LOCAL: f64 = 1e-6;

/// A step of the secant method leaves so many times itself times the step that gave its slope.
const LAST: f64 = 100.0;

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
    /// first so far from there,
    pub expected: f64,
    /// to this accuracy, and not further.
    pub accuracy: f64,
    pub furthest: f64,
}

/// A point without directions.
pub struct Found {
    pub sample: Sample,
    pub eigen: Eigen,
    /// How far from the start of the search, and the change of the eigenvalue with that.
    pub distance: f64,
    pub slope: f64,
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
    /// The zero of the eigenvalue by the secant method.
    pub fn run(&self, sheet: &mut Sheet) -> Result<Found, Lost> {
        let border: Vec<Field> = (self.held.iter())
            .map(|mode| sheet.equations.momentum(mode))
            .collect();
        let pattern = sheet.equations.bordered_pattern(border.len())?;
        let mut near = Near {
            pattern: &pattern,
            border: &border,
            rates: sheet.rates(self.spot)?,
            factored: None,
        };
        let normals = [self.along, self.across];
        let (mut distance, mut slope) = (self.expected, self.slope);
        let mut spot = sheet.moved(self.spot, self.across, distance)?;
        let mut best: Option<Found> = None;
        let (mut value, mut step, mut span) = (f64::INFINITY, f64::INFINITY, f64::INFINITY);
        let mut worse = 0;
        for _ in 0..EVALUATIONS {
            let sample = sheet.settle(&spot, normals, &mut near)?;
            // From the last spot, which the next is near.
            spot.clone_from(&sample.spot);
            let eigen = eigen(&sample, self.neutral);
            let (before, way) = (std::mem::replace(&mut value, eigen.value), step);
            if way.is_finite() && way.abs() > LOCAL {
                slope = (value - before) / way;
                span = way;
            }
            match (best.as_ref()).is_none_or(|best| value.abs() < best.eigen.value.abs()) {
                true => {
                    best = Some(Found {
                        sample,
                        eigen,
                        distance,
                        slope,
                    });
                }
                false => worse += 1,
            }
            step = -value / slope;
            if !step.is_finite() || (distance + step).abs() > self.furthest {
                break;
            }
            if step.abs() < self.accuracy || worse > 1 {
                return best.ok_or(Lost::Stuck(Stuck::NotConverged));
            }
            spot = sheet.moved(&spot, self.across, step)?;
            distance += step;
            // The slope is right but for the distance of the points that gave it.
            if worse == 0
                && let Some(found) = &mut best
                && LAST * (step * span).abs() < self.accuracy
            {
                found.sample.spot = sheet.rest(&spot, normals, &mut near)?;
                found.distance = distance;
                found.slope = slope;
                return best.ok_or(Lost::Stuck(Stuck::NotConverged));
            }
        }
        Err(Lost::Stuck(Stuck::NotConverged))
    }
}
