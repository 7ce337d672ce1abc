//! From a stable equilibrium uphill to a saddle, and downhill from there.
//!
//! Along a direction v the energy is maximized, across it minimized:
//! with the matrix bordered by the mass matrix times v (as at a critical point),
//! the solution for the border's unit vector is the direction X of the valley floor, and
//! -H its curvature. While this is positive, steps go along X, by a given length or
//! to the maximum along the floor of a cubic, as near a fold; once it is not, v is set
//! to the mode of the lowest eigenvalue, and steps are Newton's (Crippen and Scheraga,
//! Arch. Biochem. Biophys. 144, 1971; Henkelman and Jonsson, J. Chem. Phys. 111, 1999).
//!
//! The descent follows the same floor, and takes Newton's steps once it is convex. The stiffness
//! of the leaf is not reduced meanwhile, which near a fold would lead elsewhere.

use crate::branch::equations::{
    AssembledForces, BranchEquations, CorrectorFailure, bordered_responses,
};
use crate::branch::points::{
    EquilibriumPoint, ParametrizedState, add_scaled, largest, scale_field, scaled_sum,
};
use crate::leaf::{NodalField, State};

/// Steps uphill to a saddle and downhill from it; lengths are largest increments of any node
/// (radians, lengths).
struct ValleySteps {
    /// Largest number of steps of a climb and of a descent.
    most_climbing: usize,
    most_descending: usize,
    /// The longest step: longer ones leave the valley.
    longest: f64,
    /// The first step of a climb, and the shortest to the maximum of the cubic.
    first_climbing: f64,
    /// The perturbation with which a descent begins, also the length of its first step, and the
    /// growth factor of the next.
    first_descending: f64,
    descent_growth: f64,
    /// A step of Newton's method below this is the last: a correction to the equilibrium follows.
    final_newton: f64,
    /// A climb across which the matrix needs a larger shift (a squared frequency; the third of a clamped rod has 3,800) has
    /// left its valley: it crumples the leaf.
    largest_shift: f64,
}

const STEPS: ValleySteps = ValleySteps {
    most_climbing: 60,
    most_descending: 200,
    longest: 0.2,
    first_climbing: 0.01,
    first_descending: 0.01,
    descent_growth: 1.5,
    final_newton: 1e-2,
    largest_shift: 5e3,
};

/// Shifts (squared frequencies, times the mass matrix) that make the matrix across the path
/// positive definite.
struct MatrixShifts {
    /// The first tried, and the one at which a climb is abandoned.
    first: f64,
    largest: f64,
    /// Factor by which the shift for the lowest mode exceeds the magnitude of its eigenvalue.
    eigenvalue_factor: f64,
}

const SHIFTS: MatrixShifts = MatrixShifts {
    first: 1.0,
    largest: 1e6,
    eigenvalue_factor: 1.05,
};

impl MatrixShifts {
    /// The shifts of which the least with which the matrix across the path is positive definite is taken, from
    /// that of `least` on.
    fn across(&self, least: f64) -> Vec<f64> {
        let next = |shift: &f64| Some((4.0 * shift).max(self.first));
        let all = std::iter::successors(Some(least), next);
        all.take_while(|shift| *shift < self.largest).collect()
    }

    /// The shifts of which the least with which the whole matrix is positive definite is taken.
    fn of_lowest_mode(&self) -> Vec<f64> {
        let all = std::iter::successors(Some(self.first), |shift| Some(2.0 * shift));
        all.take_while(|shift| *shift <= self.largest).collect()
    }
}

/// The numbers of the shifts that the step before took: where the search for those of the next begins. As a
/// matrix that is definite with a shift is so with all larger ones, what is found does not depend on them.
#[derive(Clone, Copy, Default)]
struct ShiftsBefore {
    across: usize,
    lowest_mode: usize,
}

/// The least of ascending shifts that is `enough`, as all larger ones are, and what it gives. The search begins
/// at that with the number `near`, which is set to the number of the one found.
fn least_shift<T>(
    shifts: &[f64],
    near: &mut usize,
    mut enough: impl FnMut(f64) -> Option<T>,
) -> Option<(f64, T)> {
    let from = (*near).min(shifts.len().checked_sub(1)?);
    let found = (from..shifts.len()).find_map(|k| Some((k, enough(shifts[k])?)));
    let (mut number, mut given) = found?;
    while number > 0 && number <= from {
        let Some(lower) = enough(shifts[number - 1]) else {
            break;
        };
        (number, given) = (number - 1, lower);
    }
    *near = number;
    Some((shifts[number], given))
}

/// Steps of inverse iteration for the lowest mode with one shift.
const INVERSE_ITERATIONS: usize = 4;

/// Number of modes in the search for the softest.
const SOFT_MODE_COUNT: usize = 3;

/// A step along the valley floor, in lengths of X, and the curvature where it began.
#[derive(Clone, Copy)]
struct FloorStep {
    curvature: f64,
    length: f64,
}

/// What a search for a saddle led to.
pub struct SaddleSearch {
    /// The saddle of index one, if one was reached.
    pub saddle: Option<EquilibriumPoint>,
    /// Whether the search left the valley in which it began: of 499 searches of 22 scenarios none that did led to a
    /// barrier on a finer grid.
    pub left_valley: bool,
}

/// A step of the descent from a saddle.
struct DescentStep {
    state: State,
    /// Whether it was a step of Newton's method, short enough to end the descent.
    near_equilibrium: bool,
}

/// The valley floor in a direction at a state.
struct ValleyFloor {
    /// X, and the force and the curvature of the energy along it.
    along: NodalField,
    force: f64,
    curvature: f64,
    /// Newton's step across the floor.
    across: NodalField,
    shift: f64,
}

impl ValleyFloor {
    /// Newton's step, along the floor as well as across it.
    fn newton(&self) -> NodalField {
        scaled_sum(&self.across, self.force / self.curvature, &self.along)
    }

    /// Distance to the maximum of the energy along the floor, where its slope is minus the force,
    /// for a cubic, which the energy is near a fold, given the step before. Infinite if there is
    /// none.
    fn distance_to_maximum(&self, before: FloorStep) -> f64 {
        let change = (self.curvature - before.curvature) / before.length;
        let square = self.curvature * self.curvature + 2.0 * change * self.force;
        match change < 0.0 && square >= 0.0 {
            true => -(self.curvature + square.sqrt()) / change,
            false => f64::INFINITY,
        }
    }
}

impl BranchEquations<'_> {
    /// Seeks a saddle of index one from `state` uphill, initially along `direction`, until `stop` returns true or, if it
    /// `stays_in_valley`, the search leaves that.
    pub fn search_saddle(
        &mut self,
        state: &State,
        fraction: f64,
        direction: &NodalField,
        stays_in_valley: bool,
        stop: &dyn Fn() -> bool,
    ) -> SaddleSearch {
        let mut left_valley = false;
        let go_on = &mut |shift: f64| {
            left_valley |= shift > STEPS.largest_shift;
            !(stop() || stays_in_valley && left_valley)
        };
        let saddle = self.climb_to_saddle(state, fraction, direction, go_on);
        SaddleSearch {
            saddle,
            left_valley,
        }
    }

    /// The saddle of index one that is reached from `state` uphill; none if none is reached, or once `go_on`, which is
    /// given the shift across the valley, is false.
    fn climb_to_saddle(
        &mut self,
        state: &State,
        fraction: f64,
        direction: &NodalField,
        go_on: &mut dyn FnMut(f64) -> bool,
    ) -> Option<EquilibriumPoint> {
        let mut direction = self.normalize_by_mass(direction);
        let mut now = ParametrizedState {
            state: state.clone(),
            params: [fraction],
        };
        let mut before: Option<FloorStep> = None;
        let mut shifts = ShiftsBefore::default();
        for _ in 0..STEPS.most_climbing {
            let linear = self.assemble(&mut now, false).ok()?;
            let mut valley = self.valley(&direction, &linear, &mut shifts.across)?;
            if valley.curvature < 0.0 || valley.shift > linear.shift {
                // Beyond the inflection follow the mode of the lowest eigenvalue.
                direction = self.lowest_mode(&direction, &mut shifts.lowest_mode)?;
                valley = self.valley(&direction, &linear, &mut shifts.across)?;
            }
            if !go_on(valley.shift) {
                return None;
            }
            // With exactly one negative eigenvalue the full step is Newton's.
            let newton = valley.curvature < 0.0 && valley.shift == linear.shift;
            let increments = match newton {
                true => valley.newton(),
                false => valley.across.clone(),
            };
            let size = largest(&increments);
            let mut step = scale_field(&increments, (STEPS.longest / size).min(1.0));
            if !newton && largest(&valley.across) < STEPS.longest {
                let [shortest, longest] =
                    [STEPS.first_climbing, STEPS.longest].map(|by| by / largest(&valley.along));
                let length = match before {
                    None => shortest,
                    Some(before) => valley.distance_to_maximum(before).clamp(shortest, longest),
                };
                before = Some(FloorStep {
                    curvature: valley.curvature,
                    length,
                });
                add_scaled(&mut step, length, &valley.along);
                direction = self.normalize_by_mass(&valley.along);
            }
            now.state = self
                .state_after_increments(&now.state, now.params, &step, 1.0)
                .ok()?;
            if newton && size < STEPS.final_newton {
                let point = self.correct(&now.state, fraction, None).ok()?;
                return (point.index == 1).then_some(point);
            }
        }
        None
    }

    /// The eigenvalue nearest to zero at a point, with respect to the mass matrix.
    pub fn softest_eigenvalue(
        &mut self,
        point: &EquilibriumPoint,
    ) -> Result<f64, CorrectorFailure> {
        let modes = self.soft_modes(point, SOFT_MODE_COUNT)?;
        let linear = self.assemble(&mut point.solution(), false)?;
        let border = [self.multiply_by_mass(&modes[0])];
        let solved = self.solve_bordered(&border, &linear.forces, &[], 0.0)?;
        Ok(-solved.responses.h[(0, 0)] / self.mass)
    }

    /// The equilibria to which the leaf descends from a saddle along its unstable mode, on the side
    /// of `direction` and on the other: see [`BranchEquations::descend`].
    pub fn descend_both_sides(
        &mut self,
        saddle: &EquilibriumPoint,
        direction: &NodalField,
        stop: &dyn Fn() -> bool,
    ) -> Result<[Result<EquilibriumPoint, State>; 2], CorrectorFailure> {
        self.assemble(&mut saddle.solution(), false)?;
        let mode = self
            .lowest_mode(direction, &mut 0)
            .ok_or(CorrectorFailure::NotConverged)?;
        Ok([1.0, -1.0].map(|sign| {
            let direction = scale_field(&mode, sign);
            self.descend(&saddle.state, saddle.fraction, &direction, stop)
        }))
    }

    /// The stable equilibrium reached downhill from a state at most marginally in equilibrium,
    /// initially along `direction`; if none is reached, the last state.
    pub fn descend(
        &mut self,
        state: &State,
        fraction: f64,
        direction: &NodalField,
        stop: &dyn Fn() -> bool,
    ) -> Result<EquilibriumPoint, State> {
        let (mut direction, mut length) =
            (self.normalize_by_mass(direction), STEPS.first_descending);
        let push = scale_field(&direction, STEPS.first_descending / largest(&direction));
        let params = [fraction];
        let pushed = self.state_after_increments(state, params, &push, 1.0);
        let state = pushed.map_err(|_| state.clone())?;
        let mut now = ParametrizedState { state, params };
        let mut shift = 0;
        for _ in 0..STEPS.most_descending {
            let next = match stop() {
                true => None,
                false => self.descend_step(&mut now, &mut direction, &mut length, &mut shift),
            };
            let Some(next) = next else {
                return Err(now.state);
            };
            now.state = next.state;
            if next.near_equilibrium {
                let rest = self.correct(&now.state, fraction, None).ok();
                return rest.filter(|point| point.index == 0).ok_or(now.state);
            }
        }
        Err(now.state)
    }

    /// A step down the valley floor from `now`, after which `direction` is that of the floor and
    /// `length` that of the next step; `shift` is the number of the shift across it.
    fn descend_step(
        &mut self,
        now: &mut ParametrizedState,
        direction: &mut NodalField,
        length: &mut f64,
        shift: &mut usize,
    ) -> Option<DescentStep> {
        let linear = self.assemble(now, false).ok()?;
        let valley = self.valley(direction, &linear, shift)?;
        let newton = valley.curvature > 0.0 && valley.shift == linear.shift;
        let increments = if newton {
            valley.newton()
        } else if largest(&valley.across) < STEPS.longest {
            let part = length.copysign(valley.force) / largest(&valley.along);
            *length = (STEPS.descent_growth * *length).min(STEPS.longest);
            scaled_sum(&valley.across, part, &valley.along)
        } else {
            valley.across
        };
        *direction = self.normalize_by_mass(&valley.along);
        let size = largest(&increments);
        let step = scale_field(&increments, (STEPS.longest / size).min(1.0));
        let next = self
            .state_after_increments(&now.state, now.params, &step, 1.0)
            .ok()?;
        Some(DescentStep {
            state: next,
            near_equilibrium: newton && size < STEPS.final_newton,
        })
    }

    /// The valley along `direction`, from the assembled matrix; the search for its shift begins `near` that
    /// with this number.
    fn valley(
        &mut self,
        direction: &NodalField,
        linear: &AssembledForces,
        near: &mut usize,
    ) -> Option<ValleyFloor> {
        let border = [self.multiply_by_mass(direction)];
        // One negative eigenvalue is due to the border.
        let definite = |shift: f64| {
            let factors = self.factorize_bordered(&border, shift).ok();
            factors.filter(|factors| factors.negative_eigenvalue_count() <= 1)
        };
        let (shift, factors) = least_shift(&SHIFTS.across(linear.shift), near, definite)?;
        let mut solved = bordered_responses(factors, 1, &linear.forces, &[]).responses;
        let along = solved.modes.swap_remove(0);
        let mass = self.mass * self.mass_product(&along, &along);
        Some(ValleyFloor {
            along,
            force: solved.forces.multipliers[0],
            curvature: -solved.h[(0, 0)] - shift * mass,
            across: solved.forces.increments,
            shift,
        })
    }

    /// The mode of the lowest eigenvalue of the assembled matrix, oriented along `direction`, by
    /// inverse iteration from `direction`; the second time with a shift near that eigenvalue. The search for
    /// the first shift begins `near` that with this number.
    fn lowest_mode(&mut self, direction: &NodalField, near: &mut usize) -> Option<NodalField> {
        let pattern = self.pattern(0).ok()?;
        let mut mode = direction.clone();
        let definite = |shift: f64| {
            let factors = pattern.factorize_definite(&self.system, shift);
            factors.ok().flatten()
        };
        let (mut shift, mut factor) = least_shift(&SHIFTS.of_lowest_mode(), near, definite)?;
        for again in [true, false] {
            let mut eigenvalue = 0.0;
            for _ in 0..INVERSE_ITERATIONS {
                let next = factor
                    .solve_bordered(&self.multiply_by_mass(&mode), &[])
                    .increments;
                eigenvalue = 1.0 / (self.mass * self.mass_product(&mode, &next)) - shift;
                mode = self.normalize_by_mass(&next);
            }
            if again {
                let nearest = SHIFTS.eigenvalue_factor * eigenvalue.abs();
                let doubled = std::iter::successors(Some(nearest), |shift| Some(2.0 * shift));
                let shifts: Vec<f64> = doubled.take_while(|it| *it <= SHIFTS.largest).collect();
                (shift, factor) = least_shift(&shifts, &mut 0, definite)?;
            }
        }
        let same = self.mass_product(&mode, direction) >= 0.0;
        Some(if same { mode } else { scale_field(&mode, -1.0) })
    }

    /// Scales increments to unit product over the mass matrix, per unit of the leaf's mass.
    fn normalize_by_mass(&self, direction: &NodalField) -> NodalField {
        scale_field(
            direction,
            1.0 / self.mass_product(direction, direction).sqrt(),
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The least shift that is enough is found wherever the search begins: with two trials from the one before it
    /// or from itself, and with one more for every shift in between.
    #[test]
    fn the_least_shift_does_not_depend_on_where_the_search_begins() {
        let shifts = SHIFTS.across(0.0);
        assert_eq!(shifts[..4], [0.0, 1.0, 4.0, 16.0]);
        assert!(shifts.iter().all(|shift| *shift < SHIFTS.largest));
        for (needed, least) in shifts.iter().enumerate() {
            for from in 0..shifts.len() + 3 {
                let (mut near, mut trials) = (from, 0);
                let found = least_shift(&shifts, &mut near, |shift| {
                    trials += 1;
                    (shift >= *least).then_some(2.0 * shift)
                });
                assert_eq!((found, near), (Some((*least, 2.0 * least)), needed));
                let from = from.min(shifts.len() - 1);
                let below = usize::from(needed > 0 && needed <= from);
                assert_eq!(trials, 1 + needed.abs_diff(from) + below);
            }
        }
        assert_eq!(least_shift(&shifts, &mut 3, |_| None::<()>), None);
    }
}
