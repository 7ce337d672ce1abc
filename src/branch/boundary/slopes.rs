//! How the eigenvalue that is zero along a boundary changes with all unknowns.
//!
//! An eigenvalue of H with the mode v (of the border's unit) is h = -v.K v. In a state w
//! further along it changes by -v.dK(w) v, as K v is zero; and since K is the second
//! derivative of the energy, that is -w.dK(v) v: two matrices, of states on both sides
//! along v, give the change in all directions at once.

use super::sheet::{Direction, Sheet, Spot};
use crate::branch::equations::{Stuck, around, assembled, forces_on};
use crate::branch::family::clamp;
use crate::branch::field::{add, dot, plus, times};
use crate::leaf::Field;

/// The distance along a mode, and of a number, over which matrices are differenced.
const DIFFERENCE: f64 = 3e-4;

/// The change of the mean of some eigenvalues of H.
pub struct Slopes {
    /// With the increments of the nodes.
    pub dual: Field,
    /// With the numbers.
    pub numbers: [f64; 2],
}

impl Slopes {
    /// Along a direction.
    pub fn along(&self, to: &Direction) -> f64 {
        let numbers = self.numbers[0] * to.place[0] + self.numbers[1] * to.place[1];
        dot(&self.dual, &to.increments) + numbers
    }

    /// So many times as large.
    pub fn scaled(&self, factor: f64) -> Slopes {
        Slopes {
            dual: times(&self.dual, factor),
            numbers: self.numbers.map(|number| factor * number),
        }
    }
}

impl Sheet<'_> {
    /// The change of the mean eigenvalue of these modes at a spot, and how the forces
    /// change with both numbers.
    pub fn slopes(&mut self, spot: &Spot, modes: &[Field]) -> Result<(Slopes, Vec<Field>), Stuck> {
        let part = -1.0 / modes.len() as f64;
        let mut dual = times(&modes[0], 0.0);
        for mode in modes {
            let [after, before] = [DIFFERENCE, -DIFFERENCE].map(|step| {
                let along = Direction {
                    increments: mode.clone(),
                    place: [0.0; 2],
                };
                let mut moved = self.moved(spot, &along, step)?;
                let system = &mut self.equations.system;
                let grid = &self.equations.leaves.grid;
                let leaf = (self.kept).at(&self.plane, self.plane.family, grid, spot.place)?;
                assembled(leaf, system, &mut moved.state)?;
                Ok::<Field, Stuck>(system.product(mode))
            });
            let change = plus(&after?, -1.0, &before?);
            add(&mut dual, part / (2.0 * DIFFERENCE), &change);
        }
        let none = times(&modes[0], 0.0);
        let (mut numbers, mut rates) = ([0.0; 2], Vec::new());
        for (which, number) in numbers.iter_mut().enumerate() {
            let (kept, plane) = (&mut self.kept, &self.plane);
            let grid = &self.equations.leaves.grid;
            let system = &mut self.equations.system;
            let [after, before] = around(DIFFERENCE, |step| {
                let mut place = spot.place;
                place[which] += step;
                let leaf = kept.at(plane, plane.family, grid, place)?;
                let forces = forces_on(leaf, &spot.state, system);
                // The forces of the segments answer the number, too.
                let mut state = spot.state.clone();
                clamp(leaf, &mut state);
                system.set_solution(&none);
                let clamped = state.clone();
                leaf.advance(&clamped, system, 1.0, &mut state);
                system.set_coupling(leaf);
                leaf.assemble(&state, system);
                let own = modes.iter().map(|mode| dot(&system.product(mode), mode));
                Ok((forces, own.sum::<f64>()))
            })?;
            let distance = after.0 - before.0;
            *number = part * (after.1.1 - before.1.1) / distance;
            let change = plus(&after.1.0, -1.0, &before.1.0);
            rates.push(times(&change, 1.0 / distance));
        }
        Ok((Slopes { dual, numbers }, rates))
    }
}
