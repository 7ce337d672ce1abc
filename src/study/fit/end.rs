//! Ends of intervals of numbers of which the sum of squares does not follow its curvature:
//! by a few points around the minimum, and derivatives at few of them.

use nalgebra::DVector;

use super::around::{Around, Least, Slopes};
use super::judge::OPEN;
use super::model::Point;

/// The sum of squares at the ends of an interval may be off by this part before the
/// interval is taken from the profile of the sum.
pub(super) const STRAIGHT: f64 = 0.15;

/// Points by which an end is looked for before the whole profile is, what part of the sum
/// a correction may still take off there, and how exactly it is found.
const FEW: usize = 14;
const SETTLED: f64 = 0.1;
const NEAR_ENOUGH: f64 = 0.03;

/// A correction that leaves more than this part of what it was to gain did not help, and
/// what part of it is then taken where it went too far.
const STAGNATES: f64 = 0.5;
const SHORTER: f64 = 0.5;

/// How often leaves may be lost on the way to them.
const FEW_LOST: usize = 3;

/// A sum that is off by no more than this part of what may be needs no other look.
const CLEARLY: f64 = 0.5;

/// A sum of squares so far below the minimum, in variances, belongs to a better one.
pub(super) const BETTER: f64 = 0.1;

/// Where a profile ends.
pub(super) enum Side {
    /// So far from the minimum.
    At(f64),
    /// Not within a factor of ten, nor before a bound.
    Open,
    /// Leaves cannot be followed there.
    Lost,
}

/// What a few points around a minimum tell of the ends of an interval.
pub(super) enum Ends {
    /// They are where the curvature has them,
    Straight,
    /// or elsewhere, below and above; or about so far where the points do not tell.
    Apart([Result<Side, f64>; 2]),
}

/// Residuals at a point near a minimum.
type Known = (DVector<f64>, Point);

/// The ends of an interval by a few points around the minimum; `None` where there are none.
pub(super) fn ends(around: &Around, k: usize, first: f64, half: f64) -> Option<Ends> {
    let judge = around.judge;
    let slopes = around.slopes();
    let along = judge.conditional(k, OPEN);
    let mut known: Option<Known> = None;
    if half <= OPEN {
        let expected = judge.quantile.powi(2);
        let off = |above: f64| (above / expected - 1.0).abs();
        let change = &along * first;
        let up = around.residuals(judge.point, &around.moved(&change)).ok()?;
        // To second order the other side is its mirror image.
        let linear = &judge.jacobian * change;
        let down = &up.0 - &linear - &linear;
        let sides =
            [&up.0, &down].map(|residuals| around.least(&slopes, k, residuals, f64::INFINITY));
        let clear = |least: &Option<Least>| {
            (least.as_ref()).is_some_and(|least| off(least.above) < CLEARLY * STRAIGHT)
        };
        if sides.iter().all(clear) {
            return Some(Ends::Straight);
        }
        known = Some(up);
    }
    let [low, high] = judge.model.coordinates[k].bounds;
    let theta = judge.point.theta[k];
    let reach = |sign: f64, room: f64, known: Option<Known>| {
        let most = (OPEN + 0.1).min(room);
        let search = Search {
            around,
            k,
            at_minimum: &slopes,
            along: &along,
            sign,
            most,
            reach: first.min(most),
            bend: DVector::zeros(along.len()),
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
    let down = reach(-1.0, theta - low, None);
    let up = reach(1.0, high - theta, known);
    let same = |side: &Result<Side, f64>| matches!(side, Ok(Side::At(reach)) if *reach == first);
    Some(match same(&down) && same(&up) && half <= OPEN {
        true => Ends::Straight,
        false => Ends::Apart([down, up]),
    })
}

/// A search for the end of a profile on one side: along a parabola from the minimum, which
/// is bent to where the sum is least. Derivatives are those of the minimum until an end
/// is near, and then of where they were last found to mislead.
struct Search<'s, 'j, 'm, 'a> {
    around: &'s Around<'j, 'm, 'a>,
    k: usize,
    at_minimum: &'s Slopes,
    along: &'s DVector<f64>,
    sign: f64,
    /// Not beyond this.
    most: f64,
    /// How far the end is supposed to be.
    reach: f64,
    bend: DVector<f64>,
    /// Reach and root of the sum of the point before.
    before: (f64, f64),
    /// Where derivatives are known, if not only at the minimum.
    there: Option<(Point, Slopes)>,
    /// The longest correction.
    longest: f64,
    last: Correction,
}

/// How the others were moved to where the sum is least.
struct Correction {
    length: f64,
    /// From which sum, and what it was to gain.
    from: f64,
    gain: f64,
}

/// What follows a point.
enum Next {
    /// Another one.
    Point,
    /// It is the end.
    End(Side),
    /// The search leads nowhere.
    Nothing,
}

impl Search<'_, '_, '_, '_> {
    /// The end; `known` is what is found at the first guess.
    ///
    /// # Errors
    /// With how far the end may be, where that does not settle.
    fn run(mut self, mut known: Option<Known>) -> Result<Side, f64> {
        if self.most <= 0.0 {
            return Ok(Side::Open);
        }
        let mut lost = 0;
        for step in 0..FEW {
            let Some(found) = known.take().or_else(|| self.point()) else {
                lost += 1;
                if lost > FEW_LOST {
                    break;
                }
                self.reach = 0.5 * (self.before.0 + self.reach);
                continue;
            };
            match self.judged(step == 0, found) {
                Next::Point => {}
                Next::End(side) => return Ok(side),
                Next::Nothing => break,
            }
        }
        Err(self.reach)
    }

    /// The leaves where the end is supposed to be.
    fn point(&self) -> Option<Known> {
        let change = self.along * (self.sign * self.reach) + &self.bend * self.reach.powi(2);
        let from = match &self.there {
            Some((point, _)) => point,
            None => self.around.judge.point,
        };
        let found = self.around.residuals(from, &self.around.moved(&change));
        found.ok()
    }

    fn least(&self, residuals: &DVector<f64>) -> Option<Least> {
        let slopes = match &self.there {
            Some((_, slopes)) => slopes,
            None => self.at_minimum,
        };
        self.around.least(slopes, self.k, residuals, self.longest)
    }

    /// Whether the sum is least there, and that of an end.
    fn settled(&self, least: &Least) -> bool {
        let corrected = least.straight - least.above < SETTLED * least.above;
        corrected && (self.root(least) - 1.0).abs() < NEAR_ENOUGH
    }

    /// The root of the sum, one at an end.
    fn root(&self, least: &Least) -> f64 {
        least.above.max(0.0).sqrt() / self.around.judge.quantile
    }

    fn judged(&mut self, first: bool, (residuals, point): Known) -> Next {
        let wanted = self.around.judge.quantile.powi(2);
        let Some(mut least) = self.least(&residuals) else {
            return Next::Nothing;
        };
        if least.straight < -BETTER {
            return Next::Nothing;
        }
        if self.reach >= self.most && least.straight < wanted {
            return Next::End(Side::Open);
        }
        if first && (least.above / wanted - 1.0).abs() < STRAIGHT {
            return Next::End(Side::At(self.reach));
        }
        let gain = least.straight - least.above;
        let stagnates = self.there.is_some() && gain > STAGNATES * self.last.gain;
        if stagnates || self.settled(&least) {
            // By the derivatives there it may be lower still.
            self.there = self.around.slopes_at(point).ok();
            let anew = self.there.as_ref().and_then(|_| self.least(&residuals));
            let Some(anew) = anew else {
                return Next::Nothing;
            };
            least = anew;
            if self.settled(&least) {
                return Next::End(Side::At(self.reach));
            }
        }
        if stagnates {
            // The last correction went too far, or not far enough.
            self.longest = match least.straight > self.last.from {
                true => SHORTER * self.last.length,
                false => 2.0 * self.longest,
            };
            let Some(other) = self.least(&residuals) else {
                return Next::Nothing;
            };
            least = other;
        }
        self.go_on(&least)
    }

    fn go_on(&mut self, least: &Least) -> Next {
        self.last = Correction {
            length: least.correction.norm(),
            from: least.straight,
            gain: least.straight - least.above,
        };
        self.bend += &least.correction / self.reach.powi(2);
        // The root of the sum is nearly linear.
        let root = self.root(least);
        let secant = (root - self.before.1) / (self.reach - self.before.0);
        let wanted = self.around.judge.quantile.powi(2);
        let next = match &self.there {
            None if secant > 0.0 => self.reach + (1.0 - root) / secant,
            _ => self.reach + self.sign * least.step(wanted, self.sign),
        };
        if !next.is_finite() {
            return Next::Nothing;
        }
        self.before = (self.reach, root);
        self.reach = next
            .clamp(0.5 * self.reach, 2.0 * self.reach)
            .min(self.most);
        Next::Point
    }
}
