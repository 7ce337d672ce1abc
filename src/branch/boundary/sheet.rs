//! The equilibria of leaves that differ in two numbers, a sheet, on one grid.

use super::plane::{Kept, Plane};
use crate::branch::deflation::{STIFF, Solved};
use crate::branch::equations::{Equations, ITERATIONS, LARGEST, Stuck, assembled, at_rest};
use crate::branch::family::{Family, OutOfRange};
use crate::branch::field::{add, between, dot, is_finite, largest, plus, times};
use crate::branch::states::{advanced, forces_on, rate};
use crate::leaf::{DiscreteLeaf, Field, Grid, State, System};

/// The part of a mode of mass one over which the matrix is differenced.
const ALONG_MODE: f64 = 1e-5;

/// An equilibrium, or what comes near one.
#[derive(Clone, Debug)]
pub struct Spot {
    /// The state of the leaf.
    pub state: State,
    /// Both numbers, as fractions of their ranges.
    pub place: [f64; 2],
}

/// A direction on the sheet.
#[derive(Clone, Debug)]
pub struct Direction {
    /// Increments of the nodes.
    pub increments: Field,
    /// Changes of the numbers.
    pub place: [f64; 2],
}

impl Direction {
    /// The sum of two directions, each times its part.
    pub fn mixed(parts: [f64; 2], [a, b]: &[Direction; 2]) -> Direction {
        let scaled = times(&a.increments, parts[0]);
        Direction {
            increments: plus(&scaled, parts[1], &b.increments),
            place: [0, 1].map(|i| parts[0] * a.place[i] + parts[1] * b.place[i]),
        }
    }

    /// The same direction, backwards.
    pub fn reversed(&self) -> Direction {
        Direction {
            increments: times(&self.increments, -1.0),
            place: self.place.map(|part| -part),
        }
    }
}

/// A spot with what the bordered equations say there.
pub struct Sample {
    pub spot: Spot,
    pub solved: Solved,
    /// How the forces change with both numbers.
    pub rates: Vec<Field>,
}

/// The equations of a plane on a grid.
pub struct Sheet<'a> {
    pub plane: Plane<'a>,
    pub equations: Equations<'a>,
    kept: Kept,
    /// The family whose matrices decide what is singular, if that is another.
    softened: Option<(Family<'a>, Kept)>,
}

impl<'a> Sheet<'a> {
    /// Room for the equations of a plane on `grid`.
    pub fn new(plane: Plane<'a>, grid: Grid) -> Result<Self, OutOfRange> {
        let equations = Equations::new(plane.family, grid)?;
        Sheet::of(plane, equations)
    }

    fn of(plane: Plane<'a>, mut equations: Equations<'a>) -> Result<Self, OutOfRange> {
        let mut kept = Kept::default();
        // Veins may be coupled at one end of the second range only.
        for end in [0.0, 1.0] {
            let grid = equations.leaves.grid.clone();
            let leaf = kept.at(&plane, plane.family, &grid, [0.0, end])?;
            if leaf.coupled() && !equations.leaves.at(0.0)?.coupled() {
                equations.system = System::new(leaf);
            }
        }
        Ok(Sheet {
            plane,
            equations,
            kept,
            softened: None,
        })
    }

    /// The same on the grid with all segments halved.
    pub fn refined(&self) -> Result<Self, OutOfRange> {
        Sheet::of(self.plane, self.equations.refined()?)
    }

    /// Lets matrices of leaves with so much more compliance decide what is singular:
    /// see [`Family::softened`].
    pub fn soften(&mut self, softening: f64) {
        let family = self.plane.family.softened(softening);
        self.softened = Some((family, Kept::default()));
    }

    /// The grid.
    pub fn grid(&self) -> &Grid {
        self.equations.grid()
    }

    /// The leaf at fractions of both ranges.
    pub fn leaf(&mut self, place: [f64; 2]) -> Result<&DiscreteLeaf, OutOfRange> {
        let grid = &self.equations.leaves.grid;
        self.kept.at(&self.plane, self.plane.family, grid, place)
    }

    /// Product of two directions.
    pub fn along(&self, a: &Direction, b: &Direction) -> f64 {
        let numbers = a.place[0] * b.place[0] + a.place[1] * b.place[1];
        self.equations.product(&a.increments, &b.increments) + numbers
    }

    /// A direction of length one.
    pub fn normalised(&self, direction: Direction) -> Direction {
        let length = self.along(&direction, &direction).sqrt();
        Direction {
            increments: times(&direction.increments, 1.0 / length),
            place: direction.place.map(|part| part / length),
        }
    }

    /// The direction in which one of the numbers changes alone.
    pub fn number(&self, which: usize) -> Direction {
        let segments = self.grid().segments();
        let mut place = [0.0; 2];
        place[which] = 1.0;
        Direction {
            increments: vec![vec![[0.0; 6]; segments]; self.equations.rods()],
            place,
        }
    }

    /// The straight way from a spot to another.
    pub fn way(&self, a: &Spot, b: &Spot) -> Direction {
        Direction {
            increments: between(&a.state, &b.state),
            place: [0, 1].map(|i| b.place[i] - a.place[i]),
        }
    }

    /// What lies `step` further along a direction.
    pub fn moved(&mut self, spot: &Spot, to: &Direction, step: f64) -> Result<Spot, OutOfRange> {
        let place = [0, 1].map(|i| spot.place[i] + step * to.place[i]);
        let state = self.advanced(&spot.state, place, &to.increments, step)?;
        Ok(Spot { state, place })
    }

    /// The same from a spot at rest: the numbers change first, and forces in the segments
    /// feel all of it, however short the step.
    pub fn beside(&mut self, spot: &Spot, to: &Direction, step: f64) -> Result<Spot, OutOfRange> {
        let place = [0, 1].map(|i| spot.place[i] + step * to.place[i]);
        let state = self.advanced(&spot.state, place, &self.number(0).increments, 1.0)?;
        let state = self.advanced(&state, place, &to.increments, step)?;
        Ok(Spot { state, place })
    }

    /// A state after `step` times these increments, at the place that is then reached.
    pub fn advanced(
        &mut self,
        state: &State,
        place: [f64; 2],
        increments: &Field,
        step: f64,
    ) -> Result<State, OutOfRange> {
        let grid = &self.equations.leaves.grid;
        let family = self.plane.family;
        let leaf = self.kept.at(&self.plane, family, grid, place)?;
        let system = &mut self.equations.system;
        Ok(advanced(leaf, state, system, increments, step))
    }

    /// What the bordered equations say at a spot, at rest or not, with the rates of both
    /// numbers.
    pub fn sample(
        &mut self,
        mut spot: Spot,
        border: &[Field],
        rates: Vec<Field>,
        soft: bool,
    ) -> Result<(Sample, f64), Stuck> {
        let (forces, noise) = self.assemble(&mut spot, soft)?;
        let each: Vec<&Field> = rates.iter().collect();
        let solved = self.equations.solve_bordered(border, &forces, &each)?;
        let sample = Sample {
            spot,
            solved,
            rates,
        };
        Ok((sample, noise))
    }

    /// The forces at a spot and their rounding; the matrix, of the softened leaf if there is
    /// one and it is to decide, is left in the system.
    fn assemble(&mut self, spot: &mut Spot, soft: bool) -> Result<(Field, f64), Stuck> {
        let Sheet {
            plane,
            equations,
            kept,
            softened,
        } = self;
        let grid = &equations.leaves.grid;
        let leaf = match softened {
            Some((family, kept)) if soft => kept.at(plane, family, grid, spot.place)?,
            _ => kept.at(plane, plane.family, grid, spot.place)?,
        };
        assembled(leaf, &mut equations.system, &mut spot.state)
    }

    /// The matrix at a spot times a mode.
    fn product(&mut self, mut spot: Spot, mode: &Field) -> Result<Field, Stuck> {
        self.assemble(&mut spot, true)?;
        let pattern = self.equations.pattern(0)?;
        Ok(pattern.product(&self.equations.system, mode))
    }

    /// The mean curvature of the energy along modes at a spot.
    pub fn curvature(&mut self, mut spot: Spot, modes: &[Field]) -> Result<f64, Stuck> {
        self.assemble(&mut spot, true)?;
        let pattern = self.equations.pattern(0)?;
        let along = |mode: &Field| dot(&pattern.product(&self.equations.system, mode), mode);
        Ok(modes.iter().map(along).sum::<f64>() / modes.len() as f64)
    }

    /// The same at a spot at rest, with its own rates.
    pub fn look(&mut self, spot: Spot, border: &[Field]) -> Result<Sample, Stuck> {
        let rates = self.rates(&spot)?;
        Ok(self.sample(spot, border, rates, true)?.0)
    }

    /// How the forces change with both numbers.
    pub fn rates(&mut self, spot: &Spot) -> Result<Vec<Field>, Stuck> {
        let Sheet {
            plane,
            equations,
            kept,
            ..
        } = self;
        let grid = equations.leaves.grid.clone();
        let mut rates = Vec::new();
        for which in [0, 1] {
            rates.push(rate(|step| {
                let mut place = spot.place;
                place[which] += step;
                let leaf = kept.at(plane, plane.family, &grid, place)?;
                Ok::<_, OutOfRange>(forces_on(leaf, &spot.state, &mut equations.system))
            })?);
        }
        Ok(rates)
    }

    /// How the curvature of the energy along a mode, with the sign of H, changes with all
    /// increments and with both numbers: third derivatives of the energy do not depend on
    /// the order in which they are taken where a mode is neutral.
    pub fn curvature_change(
        &mut self,
        spot: &Spot,
        mode: &Field,
    ) -> Result<(Field, [f64; 2]), Stuck> {
        let way = Direction {
            increments: mode.clone(),
            place: [0.0; 2],
        };
        let mut change = times(mode, 0.0);
        for step in [ALONG_MODE, -ALONG_MODE] {
            let moved = self.moved(spot, &way, step)?;
            add(&mut change, -0.5 / step, &self.product(moved, mode)?);
        }
        let mut numbers = [0.0; 2];
        for (which, number) in numbers.iter_mut().enumerate() {
            let alone = self.number(which);
            let changed = rate(|step| {
                let beside = self.beside(spot, &alone, step)?;
                self.product(beside, mode)
            })?;
            *number = -dot(&changed, mode);
        }
        // The last, so that increments are those of the spot again.
        self.forces(spot)?;
        Ok((change, numbers))
    }

    /// A spot with the forces in the segments that their strains say.
    pub fn with_forces(&mut self, spot: &Spot) -> Result<Spot, OutOfRange> {
        self.forces(spot)?;
        let none = Direction {
            place: [0.0; 2],
            ..self.number(0)
        };
        self.moved(spot, &none, 1.0)
    }

    /// The unbalanced forces at a spot; segments are as there afterwards.
    fn forces(&mut self, spot: &Spot) -> Result<Field, OutOfRange> {
        let grid = &self.equations.leaves.grid;
        let leaf = (self.kept).at(&self.plane, self.plane.family, grid, spot.place)?;
        Ok(forces_on(leaf, &spot.state, &mut self.equations.system))
    }

    /// Newton's method to the sheet within the plane normal to two directions through a
    /// spot; the matrix may be singular: it is bordered by `border`, and what this cannot
    /// decide is left as it is. The rates may be those of a spot nearby: they only decide
    /// how fast the method goes, and leaves at other numbers cost more than an iteration.
    pub fn settle(
        &mut self,
        spot: &Spot,
        normals: [&Direction; 2],
        border: &[Field],
        rates: &[Field],
    ) -> Result<Sample, Stuck> {
        let duals = normals.map(|normal| self.equations.momentum(&normal.increments));
        let normals = [0, 1].map(|k| (&duals[k], normals[k].place.as_slice(), 0.0));
        let mut spot = spot.clone();
        let mut previous = f64::INFINITY;
        let mut finished = false;
        // As of a branch: a leaf with stiff segments that rests is corrected once more.
        let mut corrected = self.leaf(spot.place)?.stiffest() * STIFF > 1.0;
        for _ in 0..=ITERATIONS + 1 {
            let (sample, noise) = self.sample(spot, border, rates.to_vec(), finished)?;
            if finished {
                return Ok(sample);
            }
            let (increments, changes) = sample.solved.step(&normals, noise)?;
            let size = largest(&increments)
                .max(changes[0].abs())
                .max(changes[1].abs());
            if !is_finite(&increments) || !size.is_finite() || size > LARGEST {
                return Err(Stuck::NotConverged);
            }
            let place = [0, 1].map(|i| sample.spot.place[i] + changes[i]);
            let state = self.advanced(&sample.spot.state, place, &increments, 1.0)?;
            spot = Spot { state, place };
            let rests = at_rest(size, previous);
            finished = rests && corrected;
            corrected |= rests;
            previous = size;
        }
        Err(Stuck::NotConverged)
    }
}
