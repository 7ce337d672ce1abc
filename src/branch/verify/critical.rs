//! Critical points of a branch on finer and finer grids.

use crate::branch::events::critical::{Critical, Kind};
use crate::branch::problem::equations::{Equations, Stuck};
use crate::branch::problem::family::{Family, STIFFEST};
use crate::branch::problem::field::prolong_field;
use crate::branch::problem::states::{eigenvalue_rounding, stiffest_condensed};
use crate::branch::verify::refined::{Doubt, Refined, Table, Values};
use crate::branch::verify::regular::{FINEST, GRIDS, STILL};
use crate::largest::larger;
use crate::leaf::Grid;
use crate::relax::transfer::prolong::prolong;
use rayon::prelude::*;

/// Critical parameters with errors below this part of the range are exact.
const EXACT: f64 = 1e-12;

/// Compliances by which the matrices of nearly rigid leaves are softened, in units of
/// L^2/A, used one to four times: smaller ones increase rounding errors, larger ones the error
/// of extrapolation to zero. And the stiffness above which matrices are softened.
pub const SOFTENINGS: [f64; 5] = [1e-4, 3e-5, 1e-5, 3e-6, 1e-6];
pub const NEARLY_RIGID: f64 = 1.01 * STIFFEST;

/// Weights of the values at softenings of 1, 2, 3, 4 for extrapolation to zero: by the cubic
/// through all of them, and by the parabola through the first three.
pub const CUBIC: [f64; 4] = [4.0, -6.0, 4.0, -1.0];
pub const PARABOLA: [f64; 4] = [3.0, -3.0, 1.0, 0.0];

/// Refinement of the finest grid of a critical point over the one it was found on.
pub const FINER: f64 = 4.0;

/// Spacings (in arclength) of the points from which a branch is interpolated across a branch
/// point, in this order, until the error of the tips is below `ENOUGH` times their accuracy.
const APART: [f64; 6] = [0.03, 0.01, 0.003, 0.001, 3e-4, 1e-4];
const ENOUGH: f64 = 0.1;

/// From one spacing to the next, a third, errors of fourth order fall to 1/81; if they fall to
/// less than this, rounding does not matter yet.
const CONVERGES: f64 = 1.0 / 30.0;

/// A critical point with the given accuracy of its tips, on at least so many `grids`.
pub fn refine_critical(
    family: &Family,
    grid: &Grid,
    found: &Critical,
    accuracy: f64,
    grids: usize,
) -> Result<Refined, Doubt> {
    let mut table = Table::default();
    let mut equations = Equations::new(family, grid.clone());
    let mut critical = found.clone();
    let mut softening = Softening(SOFTENINGS[0]);
    let mut moved = f64::INFINITY;
    for level in 0..GRIDS {
        if level > 0 {
            let leaf = equations.leaves.at([critical.fraction])?;
            let state = prolong(leaf, &critical.state);
            equations = equations.refined();
            let first = equations.first_node();
            let soft = critical.soft.iter();
            let finer = Critical {
                state,
                tangent: equations.prolonged(&critical.tangent),
                soft: soft.map(|field| prolong_field(field, first)).collect(),
                ..critical.clone()
            };
            critical = finer.relocated(&mut equations)?;
            let shift = finer.state.shift_to(&critical.state);
            if shift > moved.max(STILL) {
                return Err(Doubt::OtherBranch);
            }
            moved = shift;
        }
        let (mut values, growth) = softening.on(family, &mut equations, &critical, &mut table)?;
        if critical.kind == Kind::Branching {
            let across = interpolate_across(&mut equations, &critical, values.fraction, accuracy);
            if let Some(across) = across {
                table.common = larger(table.common, across.error);
                table.slope = Some(across.slope);
                values = across.values;
            }
        }
        table.push(equations.grid().segments(), values);
        // If so, a finer grid would only add rounding errors.
        let exact = table.fraction_error() < (table.rounding / growth).max(EXACT);
        let noisy = FINER * table.noise > ENOUGH * accuracy;
        let enough = exact || noisy || level + 1 >= grids;
        if enough && table.error() <= accuracy {
            let leaf = equations.leaves.at([critical.fraction])?;
            let state = leaf.leaning(&critical.state).into_owned();
            return Ok(table.refined(state, equations.grid().clone()));
        }
        if 2 * equations.grid().segments() > FINEST {
            break;
        }
    }
    Err(Doubt::Inaccurate)
}

/// The compliance by which matrices are softened.
struct Softening(f64);

/// A critical point extrapolated to zero softening.
struct Unsoftened {
    values: Values,
    /// Error of the extrapolation, for the points and for the fraction.
    error: f64,
    fraction_error: f64,
}

impl Softening {
    /// A critical point on a grid, and the factor by which extrapolation amplifies rounding;
    /// records both errors in the table.
    fn on(
        &mut self,
        family: &Family,
        equations: &mut Equations,
        critical: &Critical,
        table: &mut Table,
    ) -> Result<(Values, f64), Stuck> {
        let leaf = equations.leaves.at([critical.fraction])?;
        let rigid = leaf.least_compliance() * NEARLY_RIGID < 1.0;
        let mut stiffest = stiffest_condensed(leaf);
        let segments = leaf.segments();
        let fold = critical.kind == Kind::Fold;
        let mut growth = 1.0;
        let values = match rigid {
            false => Values::of(equations, &critical.state, critical.fraction)?,
            true => {
                let slope = critical.slope.abs() / (FINER * segments as f64).powi(2);
                let found = self.unsoftened(family, equations, critical, slope)?;
                table.softening = larger(table.softening, found.fraction_error);
                if fold {
                    table.common = larger(table.common, found.error);
                }
                stiffest = stiffest.min(1.0 / self.0);
                growth = CUBIC.iter().map(|weight| weight.abs()).sum();
                found.values
            }
        };
        let rounding = eigenvalue_rounding(stiffest, segments);
        let along = rounding / critical.slope.abs();
        if fold {
            table.noise = larger(table.noise, along);
        }
        // Near a fold the parameter depends quadratically on arclength.
        let of_value = larger(rounding / critical.steepness(), growth * along * along);
        table.rounding = larger(table.rounding, growth * (of_value + critical.rounding));
        Ok((values, growth))
    }

    /// A critical point of a nearly rigid leaf, from softened matrices, extrapolated to zero.
    /// The softening is reduced until the rounding error, that of the stiffness over the
    /// derivative of the eigenvalue, exceeds the error of the extrapolation: at a fold also that of
    /// its shape, but not at a branch point, which a singular matrix leaves undetermined along the
    /// neutral mode, and where the shape is interpolated.
    fn unsoftened(
        &mut self,
        family: &Family,
        equations: &Equations,
        critical: &Critical,
        slope: f64,
    ) -> Result<Unsoftened, Stuck> {
        loop {
            let found = extrapolated(family, equations.grid(), critical, self.0)?;
            let rounding = f64::EPSILON / self.0 / slope;
            let error = match critical.kind {
                Kind::Fold => larger(found.error, found.fraction_error),
                Kind::Branching => found.fraction_error,
            };
            let less = SOFTENINGS.into_iter().find(|less| *less < self.0);
            match less {
                Some(less) if error > rounding => self.0 = less,
                _ => return Ok(found),
            }
        }
    }
}

/// A critical point from four softened matrices.
fn extrapolated(
    family: &Family,
    grid: &Grid,
    critical: &Critical,
    softening: f64,
) -> Result<Unsoftened, Stuck> {
    let softened = |k: usize| {
        let mut equations = Equations::new(family, grid.clone());
        equations.soften(softening * (k + 1) as f64);
        let near = critical.relocated(&mut equations)?;
        Values::of(&mut equations, &near.state, near.fraction)
    };
    let found: Result<Vec<Values>, Stuck> =
        (0..CUBIC.len()).into_par_iter().map(softened).collect();
    let found = found?;
    let by = |weights: [f64; 4]| {
        let parts: Vec<_> = weights.into_iter().zip(found.iter().cloned()).collect();
        Values::sum(&parts)
    };
    let (values, parabola) = (by(CUBIC), by(PARABOLA));
    Ok(Unsoftened {
        error: values.distance(&parabola),
        fraction_error: (values.fraction - parabola.fraction).abs(),
        values,
    })
}

/// A branch at a branch point.
struct Interpolated {
    values: Values,
    /// A bound on the error of the tips.
    error: f64,
    /// Derivatives of the values with respect to the fraction.
    slope: Values,
}

/// Interpolates a branch across a branch point at this fraction. There the singular matrix
/// leaves the component along the neutral mode undetermined to rounding; but the branch is
/// smooth, and points on both sides are well determined. None if there is no point on one side:
/// at an end of the range.
fn interpolate_across(
    equations: &mut Equations,
    critical: &Critical,
    fraction: f64,
    accuracy: f64,
) -> Option<Interpolated> {
    let mut best: Option<Interpolated> = None;
    let mut last: Option<(Values, f64)> = None;
    for apart in APART {
        let Some(mut now) = interpolated(equations, critical, fraction, apart) else {
            continue;
        };
        let fourth = now.error;
        if let Some((values, before)) = last {
            // Then those of sixth order fall at least as much.
            let fall = fourth / before;
            if fall < CONVERGES {
                now.error = fourth.min(fall * now.values.distance(&values));
            }
        }
        last = Some((now.values.clone(), fourth));
        if best.as_ref().is_none_or(|best| now.error < best.error) {
            best = Some(now);
        }
        if best
            .as_ref()
            .is_some_and(|best| best.error < ENOUGH * accuracy)
        {
            break;
        }
    }
    best
}

/// The same from points `apart`, in planes across the tangent: next to a fold the branch is not
/// smooth over the parameter. The error is that of the fourth order, the values are of the sixth.
fn interpolated(
    equations: &mut Equations,
    critical: &Critical,
    fraction: f64,
    apart: f64,
) -> Option<Interpolated> {
    // Weights of values at -3, -2, -1, 1, 2, 3: for the value at 0 and the slope to sixth
    // order, and, from four of them, for the value at 0 to fourth order.
    const SIXTH: [f64; 3] = [0.75, -0.3, 0.05];
    const FOURTH: [f64; 3] = [2.0 / 3.0, -1.0 / 6.0, 0.0];
    const SLOPE: [f64; 3] = [0.75, -0.15, 1.0 / 60.0];
    let tangent = &critical.tangent;
    let mut values_at = |side: f64| {
        let point = critical.beside(equations, tangent, side * apart).ok()?;
        Values::of(equations, &point.state, point.fraction).ok()
    };
    let pairs = [1.0, 2.0, 3.0].into_iter();
    let pairs: Option<Vec<[Values; 2]>> = pairs
        .map(|k| Some([values_at(-k)?, values_at(k)?]))
        .collect();
    let pairs = pairs?;
    let sum = |weights: [f64; 3], sign: f64| {
        let parts = pairs.iter().zip(weights);
        let parts = parts.flat_map(|([before, after], weight)| {
            [(sign * weight, before.clone()), (weight, after.clone())]
        });
        Values::sum(&parts.collect::<Vec<_>>())
    };
    let along = sum(SLOPE, -1.0);
    let slope = Values::sum(&[(1.0 / along.fraction, along)]);
    let at_fraction = |weights: [f64; 3]| {
        let across = sum(weights, 1.0);
        let shift = fraction - across.fraction;
        Values::sum(&[(1.0, across), (shift, slope.clone())])
    };
    let values = at_fraction(SIXTH);
    Some(Interpolated {
        error: values.distance(&at_fraction(FOURTH)),
        values,
        slope,
    })
}
