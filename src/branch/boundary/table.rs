//! A point of a boundary, extrapolated over finer and finer grids.

use glam::DVec3;

use super::manifold::{Direction, Manifold};
use super::singular_point::SingularPoint;
use super::special::Special;
use crate::branch::events::critical::Kind;
use crate::branch::problem::equations::Stuck;
use crate::branch::problem::states::stiffest_condensed;
use crate::largest::larger;
use crate::leaf::State;
use crate::relax::accuracy::richardson::Richardson;

/// Amplification of rounding errors by extrapolation to zero softening: the root of the sum of
/// the squares of its weights.
const AMPLIFIED: f64 = 8.3;

/// Largest amplification of iteration errors by extrapolation.
const KEPT: f64 = 2.0;

/// A point of a boundary extrapolated to zero segment length.
#[derive(Clone, Debug)]
pub struct Verified {
    /// Both parameters, as fractions of their ranges, and bounds on their errors.
    pub params: [f64; 2],
    pub errors: [f64; 2],
    /// Tips of all rods, in the family's units, and a bound on their error.
    pub tips: Vec<DVec3>,
    pub error: f64,
    /// The state on the finest grid.
    pub state: State,
    /// The direction across the boundary on the manifold, to where more eigenvalues are negative.
    pub across: Direction,
    /// The nodes as fractions of the length.
    pub stations: Vec<f64>,
    pub kind: Kind,
    pub special: Option<Special>,
    /// Morse indices where the first parameter is smaller and where it is larger; at a fold,
    /// of the two branches that meet there.
    pub indices: [usize; 2],
    /// Matrices factorised for it, without those of softened leaves.
    pub factorizations: usize,
}

/// Both parameters at a point on a grid.
#[derive(Default)]
pub struct Parameters {
    pub values: [f64; 2],
    /// Compliance by which the matrix was softened, in units of L^2/A, and the error of the
    /// extrapolation to zero.
    pub softening: f64,
    pub errors: [f64; 2],
}

impl Parameters {
    /// Without softening.
    pub fn of(values: [f64; 2]) -> Self {
        Parameters {
            values,
            ..Parameters::default()
        }
    }
}

/// The values to be extrapolated.
#[derive(Default)]
pub struct Table {
    pub tips: Richardson,
    numbers: [Richardson; 2],
    /// The parameter that is fixed on all grids, if there is one, and its value.
    given: Option<(usize, f64)>,
    /// Errors of the parameters due to rounding of the matrix on a grid, and their amplification
    /// by extrapolation to zero softening.
    rounded: [f64; 2],
    amplified: f64,
    /// Errors of the parameters due to softening.
    softened: [f64; 2],
    /// Largest iteration error of Newton's method.
    pub iteration_error: f64,
}

impl Table {
    pub fn new(given: Option<(usize, f64)>) -> Self {
        Table {
            given,
            amplified: 1.0,
            ..Table::default()
        }
    }

    /// Errors of the parameters due to rounding of a matrix with so much softening, on so many
    /// segments; `along` is the derivative of the vanishing function along the boundary.
    pub fn rounding(
        &self,
        manifold: &mut Manifold,
        (point, along): (&SingularPoint, Option<f64>),
        softening: f64,
        segments: f64,
    ) -> Result<[f64; 2], Stuck> {
        let (across, slope) = match self.given {
            Some((which, _)) => point.across_at(manifold, which),
            None => (point.normal.clone(), point.slope),
        };
        let leaf = manifold.leaves.at(point.solution.params)?;
        let stiffest = stiffest_condensed(leaf).min(1.0 / softening);
        let rounding = f64::EPSILON * stiffest * segments * segments;
        Ok([0, 1].map(|i| {
            let own = (rounding / slope * across.params[i]).abs();
            let along = along.map_or(0.0, |slope| rounding / slope * point.tangent.params[i]);
            own + along.abs()
        }))
    }

    pub fn push(
        &mut self,
        manifold: &mut Manifold,
        (point, along): (&SingularPoint, Option<f64>),
        numbers: &Parameters,
    ) -> Result<(), Stuck> {
        let state = &point.solution.state;
        let segments = state.segments() as f64;
        let rounding = self.rounding(manifold, (point, along), numbers.softening, segments)?;
        if numbers.softening > 0.0 {
            self.amplified = AMPLIFIED;
        }
        for i in 0..2 {
            self.rounded[i] = larger(self.rounded[i], rounding[i]);
            self.softened[i] = larger(self.softened[i], numbers.errors[i]);
        }
        let tips = state.tips().flat_map(|tip| tip.to_array());
        self.tips.push(state.segments(), tips.collect());
        for (table, number) in self.numbers.iter_mut().zip(numbers.values) {
            table.push(state.segments(), vec![number]);
        }
        Ok(())
    }

    pub fn errors(&self) -> [f64; 2] {
        [0, 1].map(|i| match self.given_value(i) {
            Some(_) => 0.0,
            None => (self.numbers[i].best()).map_or(f64::INFINITY, |best| best.error),
        })
    }

    /// The value of a parameter, if it is fixed.
    fn given_value(&self, i: usize) -> Option<f64> {
        let given = self.given.filter(|(which, _)| *which == i);
        given.map(|(_, value)| value)
    }

    /// Whether the errors of both parameters are below this, or below rounding.
    pub fn is_exact(&self, enough: f64) -> bool {
        let mut errors = self.errors().into_iter().zip(self.rounded);
        errors.all(|(error, rounded)| error <= enough.max(rounded))
    }

    pub fn verified(
        &self,
        manifold: &Manifold,
        point: &SingularPoint,
        special: Option<Special>,
    ) -> Verified {
        let tips = self.tips.extrapolated();
        let errors = self.errors();
        let number =
            |i: usize| (self.given_value(i)).unwrap_or_else(|| self.numbers[i].extrapolated()[0]);
        let (beyond, below) = (point.index, point.index.saturating_sub(point.neutral));
        let forward = match point.kind {
            Kind::Branching => {
                let (across, slope) = point.across_at(manifold, 1);
                slope * across.params[0] > 0.0
            }
            Kind::Fold => true,
        };
        Verified {
            params: [number(0), number(1)],
            errors: [0, 1].map(|i| match self.given_value(i) {
                Some(_) => 0.0,
                None => {
                    let rounded = self.amplified * self.rounded[i];
                    errors[i] + self.softened[i] + rounded + KEPT * self.iteration_error
                }
            }),
            tips: tips.chunks(3).map(DVec3::from_slice).collect(),
            // No tip is more accurate than machine precision.
            error: (self.tips.best()).map_or(f64::INFINITY, |best| {
                best.error + KEPT * self.iteration_error + f64::EPSILON
            }),
            state: point.solution.state.clone(),
            across: point.normal.clone(),
            stations: manifold.grid().sigma().to_vec(),
            kind: point.kind,
            special,
            indices: match forward {
                true => [below, beyond],
                false => [beyond, below],
            },
            factorizations: 0,
        }
    }
}
