//! Ends of the intervals of numbers for which the sum of squares is not quadratic: from
//! a few points around the minimum, with derivatives at few of them.

use nalgebra::DVector;

use super::model::Point;
use super::neighbourhood::{Least, Neighbourhood, Slopes};
use super::statistics::OPEN;

/// Largest relative deviation of the sum of squares from a quadratic at the ends of an interval;
/// beyond it the interval is taken from the profile of the sum.
pub(super) const QUADRATIC: f64 = 0.15;

/// Largest number of points in the search for an end before the full profile is computed, the
/// relative reduction still possible by a correction there, and the accuracy of the end.
const FEW: usize = 14;
const SETTLED: f64 = 0.1;
const NEAR_ENOUGH: f64 = 0.03;

/// A correction that leaves more than this part of the expected reduction has failed, and
/// the part of it that is taken next if it went too far.
const STAGNATION: f64 = 0.5;
const SHORTER: f64 = 0.5;

/// Largest number of lost leaves in the search.
const FEW_LOST: usize = 3;

/// A sum with a smaller relative error than this needs no further evaluation.
const CLEARLY: f64 = 0.3;

/// Excess below the minimum, in variances, that indicates a better minimum.
pub(super) const BETTER: f64 = 0.1;

/// Where a profile ends on one side of the minimum.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Reach {
    /// At this distance.
    End(f64),
    /// Not within a factor of ten, nor before a bound.
    Open,
    /// Beyond this distance, up to which it does not, the other numbers could not be fitted.
    Lost(f64),
}

/// Residuals at a point near a minimum.
type EvaluatedPoint = (DVector<f64>, Point);

/// The ends of an interval below and above, from a few points around the minimum; as errors,
/// approximate distances that are not confirmed. `None` if they are those of the quadratic
/// approximation.
pub(super) fn ends(
    near: &Neighbourhood,
    k: usize,
    first: f64,
    half: f64,
) -> Option<[Result<Reach, f64>; 2]> {
    let stats = near.stats;
    let slopes = near.slopes();
    let along = stats.conditional(k);
    let mut known: Option<EvaluatedPoint> = None;
    if half <= OPEN {
        let expected = stats.quantile.powi(2);
        let off = |above: f64| (above / expected - 1.0).abs();
        let change = &along * first;
        let Ok(up) = near.residuals(stats.point, &near.moved(&change)) else {
            return Some([Err(half), Err(half)]);
        };
        // By reflection, to second order.
        let linear = &stats.jacobian * change;
        let down = &up.0 - &linear - &linear;
        let sides =
            [&up.0, &down].map(|residuals| near.least(&slopes, k, residuals, f64::INFINITY));
        let clear = |least: &Option<Least>| {
            (least.as_ref()).is_some_and(|least| off(least.above) < CLEARLY * QUADRATIC)
        };
        if sides.iter().all(clear) {
            return None;
        }
        known = Some(up);
    }
    let [low, high] = stats.model.coordinates[k].bounds;
    let theta = stats.point.theta[k];
    let distance = |sign: f64, room: f64, known: Option<EvaluatedPoint>| {
        let most = (OPEN + 0.1).min(room);
        let search = Search {
            near,
            k,
            at_minimum: &slopes,
            along: &along,
            sign,
            most,
            distance: first.min(most),
            curvature: DVector::zeros(along.len()),
            before: (0.0, 0.0),
            there: None,
            longest: f64::INFINITY,
            last: Correction {
                length: 0.0,
                from: f64::INFINITY,
                gain: f64::INFINITY,
            },
        };
        search.run(known.filter(|_| first <= most))
    };
    let down = distance(-1.0, theta - low, None);
    let up = distance(1.0, high - theta, known);
    let quadratic = half <= OPEN && [down, up] == [Ok(Reach::End(first)); 2];
    (!quadratic).then_some([down, up])
}

/// Search for the end of a profile on one side: along a parabola from the minimum, which
/// is corrected towards the least sum. Derivatives are those of the minimum until an end
/// is near, and then those where they last proved inaccurate.
struct Search<'s, 'j, 'm, 'a> {
    near: &'s Neighbourhood<'j, 'm, 'a>,
    k: usize,
    at_minimum: &'s Slopes,
    along: &'s DVector<f64>,
    sign: f64,
    /// Upper limit of the distance.
    most: f64,
    /// Present estimate of the distance of the end.
    distance: f64,
    curvature: DVector<f64>,
    /// Distance and root of the sum at the previous point.
    before: (f64, f64),
    /// Where derivatives are known, if not only at the minimum.
    there: Option<(Point, Slopes)>,
    longest: f64,
    last: Correction,
}

/// A correction of the other numbers towards the least sum.
struct Correction {
    length: f64,
    /// The sum before it, and its expected reduction.
    from: f64,
    gain: f64,
}

/// The search fails.
struct Failed;

/// The result at a point: the end if this is it, or none, if another point follows.
type Next = Result<Option<Reach>, Failed>;

impl Search<'_, '_, '_, '_> {
    /// Finds the end; `known` is the point at the first guess.
    ///
    /// # Errors
    /// The approximate distance of the end, if the search does not converge.
    fn run(mut self, mut known: Option<EvaluatedPoint>) -> Result<Reach, f64> {
        if self.most <= 0.0 {
            return Ok(Reach::Open);
        }
        let mut lost = 0;
        for step in 0..FEW {
            let Some(found) = known.take().or_else(|| self.point()) else {
                lost += 1;
                if lost > FEW_LOST {
                    break;
                }
                self.distance = 0.5 * (self.before.0 + self.distance);
                continue;
            };
            match self.evaluate(step == 0, found) {
                Ok(None) => {}
                Ok(Some(end)) => return Ok(end),
                Err(Failed) => break,
            }
        }
        Err(self.distance)
    }

    /// The leaves at the present estimate of the end.
    fn point(&self) -> Option<EvaluatedPoint> {
        let change =
            self.along * (self.sign * self.distance) + &self.curvature * self.distance.powi(2);
        let from = match &self.there {
            Some((point, _)) => point,
            None => self.near.stats.point,
        };
        let found = self.near.residuals(from, &self.near.moved(&change));
        found.ok()
    }

    fn least(&self, residuals: &DVector<f64>) -> Result<Least, Failed> {
        let slopes = match &self.there {
            Some((_, slopes)) => slopes,
            None => self.at_minimum,
        };
        let least = self.near.least(slopes, self.k, residuals, self.longest);
        least.ok_or(Failed)
    }

    /// Whether the sum is the least one, and that of an end.
    fn settled(&self, least: &Least) -> bool {
        let corrected = least.straight - least.above < SETTLED * least.above;
        corrected && (self.root(least) - 1.0).abs() < NEAR_ENOUGH
    }

    /// The root of the sum, normalised to one at an end.
    fn root(&self, least: &Least) -> f64 {
        least.above.max(0.0).sqrt() / self.near.stats.quantile
    }

    fn evaluate(&mut self, first: bool, (residuals, point): EvaluatedPoint) -> Next {
        let wanted = self.near.stats.quantile.powi(2);
        let mut least = self.least(&residuals)?;
        if least.straight < -BETTER {
            return Err(Failed);
        }
        if self.distance >= self.most && least.straight < wanted {
            return Ok(Some(Reach::Open));
        }
        if first && (least.above / wanted - 1.0).abs() < QUADRATIC {
            return Ok(Some(Reach::End(self.distance)));
        }
        let gain = least.straight - least.above;
        let stagnates = self.there.is_some() && gain > STAGNATION * self.last.gain;
        if stagnates || self.settled(&least) {
            // With the derivatives there it may be reduced further.
            self.there = Some(self.near.slopes_at(point).map_err(|_| Failed)?);
            least = self.least(&residuals)?;
            if self.settled(&least) {
                return Ok(Some(Reach::End(self.distance)));
            }
        }
        if stagnates {
            // The last correction went too far, or not far enough.
            self.longest = match least.straight > self.last.from {
                true => SHORTER * self.last.length,
                false => 2.0 * self.longest,
            };
            least = self.least(&residuals)?;
        }
        self.advance(&least)
    }

    fn advance(&mut self, least: &Least) -> Next {
        self.last = Correction {
            length: least.correction.norm(),
            from: least.straight,
            gain: least.straight - least.above,
        };
        self.curvature += &least.correction / self.distance.powi(2);
        // The root of the sum is nearly linear.
        let root = self.root(least);
        let secant = (root - self.before.1) / (self.distance - self.before.0);
        let wanted = self.near.stats.quantile.powi(2);
        let next = match &self.there {
            None if secant > 0.0 => self.distance + (1.0 - root) / secant,
            _ => self.distance + self.sign * least.step(wanted, self.sign),
        };
        if !next.is_finite() {
            return Err(Failed);
        }
        self.before = (self.distance, root);
        self.distance = next
            .clamp(0.5 * self.distance, 2.0 * self.distance)
            .min(self.most);
        Ok(None)
    }
}
