//! What grids finer and finer say of a point of a boundary, extrapolated.

use super::place::Place;
use super::search::Lost;
use super::sheet::{Direction, Sheet};
use super::special::Special;
use crate::branch::critical::Kind;
use crate::leaf::State;
use crate::relax::richardson::Richardson;

/// What extrapolation to no softening makes of rounding: the root of the sum of the squares
/// of its weights.
const AMPLIFIED: f64 = 8.3;

/// Extrapolation makes of what Newton's method leaves on a grid at most so much.
const KEPT: f64 = 2.0;

/// A point of a boundary without the error of its grid.
#[derive(Clone, Debug)]
pub struct Verified {
    /// Both numbers, as fractions of their ranges, and bounds on their errors.
    pub place: [f64; 2],
    pub errors: [f64; 2],
    /// Tips of all rods, in the family's units, and a bound on their error.
    pub tips: Vec<[f64; 3]>,
    pub error: f64,
    /// The state on the finest grid.
    pub state: State,
    /// The way across the boundary on the sheet, to where there are more negative eigenvalues.
    pub across: Direction,
    /// Fractions of the length of its nodes.
    pub stations: Vec<f64>,
    /// What it is.
    pub kind: Kind,
    pub special: Option<Special>,
    /// Morse indices where the first number is smaller and where it is larger; of a fold,
    /// of both branches that meet there.
    pub indices: [usize; 2],
    /// Matrices factorised for it, but for those of softened leaves.
    pub factorizations: usize,
}

/// Both numbers at a point on a grid.
#[derive(Default)]
pub struct Numbers {
    pub values: [f64; 2],
    /// Compliance by which the matrix was softened, in units of L^2/A, and what that may have
    /// left in the numbers.
    pub softening: f64,
    pub left: [f64; 2],
}

impl Numbers {
    /// Without softening.
    pub fn of(values: [f64; 2]) -> Self {
        Numbers {
            values,
            ..Numbers::default()
        }
    }
}

/// What is extrapolated.
#[derive(Default)]
pub struct Table {
    pub tips: Richardson,
    numbers: [Richardson; 2],
    /// The number that is the same on every grid, if there is one.
    given: Option<(usize, f64)>,
    /// What rounding of the matrix may have done to the numbers on a grid, and how many
    /// times as much to those of no softening.
    rounded: [f64; 2],
    amplified: f64,
    /// What softening may have left in the numbers on a grid.
    softened: [f64; 2],
    /// What Newton's method may have left on a grid.
    pub left: f64,
}

impl Table {
    /// With nothing in it yet.
    pub fn new(given: Option<(usize, f64)>) -> Self {
        Table {
            given,
            amplified: 1.0,
            ..Table::default()
        }
    }

    /// What rounding of a matrix with so much softening, on so many segments, may do to the
    /// numbers at a point; `along` is the change of what is zero there along the boundary.
    pub fn rounding(
        &self,
        sheet: &mut Sheet,
        (place, along): (&Place, Option<f64>),
        softening: f64,
        segments: f64,
    ) -> Result<[f64; 2], Lost> {
        let (across, slope) = match self.given {
            Some((which, _)) => place.across_at(sheet, which),
            None => (place.normal.clone(), place.slope),
        };
        let leaf = sheet.leaf(place.spot.place)?;
        let limit = 1.0 / softening;
        let condensing = leaf.sections.iter().map(|it| it.condensing.max_element());
        let stiffest = condensing.fold(0.0_f64, |most, it| most.max(it.min(limit)));
        let rounding = f64::EPSILON * stiffest * segments * segments;
        Ok([0, 1].map(|i| {
            let own = (rounding / slope * across.place[i]).abs();
            let along = along.map_or(0.0, |slope| rounding / slope * place.tangent.place[i]);
            own + along.abs()
        }))
    }

    pub fn push(
        &mut self,
        sheet: &mut Sheet,
        (place, along): (&Place, Option<f64>),
        numbers: &Numbers,
    ) -> Result<(), Lost> {
        let state = &place.spot.state;
        let segments = state.segments() as f64;
        let rounding = self.rounding(sheet, (place, along), numbers.softening, segments)?;
        if numbers.softening > 0.0 {
            self.amplified = AMPLIFIED;
        }
        for i in 0..2 {
            self.rounded[i] = self.rounded[i].max(rounding[i]);
            self.softened[i] = self.softened[i].max(numbers.left[i]);
        }
        let tips = (0..state.rods()).flat_map(|j| state.tip(j).to_array());
        self.tips.push(state.segments(), tips.collect());
        for (table, number) in self.numbers.iter_mut().zip(numbers.values) {
            table.push(state.segments(), vec![number]);
        }
        Ok(())
    }

    pub fn errors(&self) -> [f64; 2] {
        let error = |i: usize| {
            self.numbers[i]
                .best()
                .map_or(f64::INFINITY, |best| best.error)
        };
        [0, 1].map(|i| match self.given {
            Some((which, _)) if which == i => 0.0,
            _ => error(i),
        })
    }

    /// Whether both numbers are known as well, or to rounding.
    pub fn is_exact(&self, enough: f64) -> bool {
        let errors = self.errors().into_iter().zip(self.rounded);
        errors
            .into_iter()
            .all(|(error, rounded)| error <= enough.max(rounded))
    }

    pub fn verified(&self, sheet: &Sheet, place: &Place, special: Option<Special>) -> Verified {
        let columns = |table: &Richardson| table.best().map_or(0, |best| best.columns);
        let tips = self.tips.column(columns(&self.tips));
        let errors = self.errors();
        let number = |i: usize| match self.given {
            Some((which, value)) if which == i => value,
            _ => self.numbers[i].column(columns(&self.numbers[i]))[0],
        };
        let free = |i: usize| self.given.is_none_or(|(which, _)| which != i);
        let (beyond, below) = (place.index, place.index.saturating_sub(place.neutral));
        let forward = match place.kind {
            Kind::Branching => {
                let (across, slope) = place.across_at(sheet, 1);
                slope * across.place[0] > 0.0
            }
            Kind::Fold => true,
        };
        Verified {
            place: [number(0), number(1)],
            errors: [0, 1].map(|i| match free(i) {
                true => {
                    let rounded = self.amplified * self.rounded[i];
                    errors[i] + self.softened[i] + rounded + KEPT * self.left
                }
                false => 0.0,
            }),
            tips: tips.chunks(3).map(|tip| [tip[0], tip[1], tip[2]]).collect(),
            // No tip is better than the precision of its numbers.
            error: (self.tips.best()).map_or(f64::INFINITY, |best| {
                best.error + KEPT * self.left + f64::EPSILON
            }),
            state: place.spot.state.clone(),
            across: place.normal.clone(),
            stations: sheet.grid().sigma().to_vec(),
            kind: place.kind,
            special,
            indices: match forward {
                true => [below, beyond],
                false => [beyond, below],
            },
            factorizations: 0,
        }
    }
}
