//! A smooth curve through given points that turns no more often than they do.
//!
//! It is the natural quintic spline through the points and others between them. Of all curves W(x) through points this
//! spline has the least integral of W'''^2 (I. J. Schoenberg, On interpolation by spline functions and its minimal
//! properties, 1964): between two points it is a polynomial of degree 5, with four continuous derivatives, so that
//! the curvature of a margin has no corners, which would cost grids their order. Through the given points alone
//! it overshoots where their distances or slopes change much. The points between are those of a curve that
//! does not ([`limited_derivatives`]).

use glam::{DMat2, DVec2};

/// Equal parts of an interval between given points; at their ends the spline meets the limited curve.
const PARTS: usize = 3;

/// A curve through points, of which the first is at 0 and the last at 1.
#[derive(Clone, Debug, PartialEq)]
pub struct Spline {
    given_at: Vec<f64>,
    given_value: Vec<f64>,
    at: Vec<f64>,
    value: Vec<f64>,
    /// The first and second derivatives at `at`.
    slopes: Vec<DVec2>,
}

impl Spline {
    /// The curve through two points or more; two give a line.
    pub fn through_points(given_at: Vec<f64>, given_value: Vec<f64>) -> Spline {
        let (mut at, mut value) = (given_at.clone(), given_value.clone());
        if at.len() > 2 {
            (at, value) = points_between(&given_at, &given_value);
        }
        let slopes = match at.len() {
            2 => vec![DVec2::new(value[1] - value[0], 0.0); 2],
            _ => spline_derivatives(&at, &value),
        };
        Spline {
            given_at,
            given_value,
            at,
            value,
            slopes,
        }
    }

    /// The places of the given points.
    pub fn knots(&self) -> &[f64] {
        &self.given_at
    }

    /// The values at the given points.
    pub fn values(&self) -> &[f64] {
        &self.given_value
    }

    /// The ends of its polynomials.
    pub fn seams(&self) -> &[f64] {
        &self.at
    }

    /// The value, and the first and second derivative at `x` in [0, 1].
    pub fn value_and_derivatives(&self, x: f64) -> [f64; 3] {
        let right = self.at.partition_point(|&knot| knot < x);
        let k = right.clamp(1, self.at.len() - 1) - 1;
        let width = self.at[k + 1] - self.at[k];
        let end = |k: usize| {
            let DVec2 { x, y } = self.slopes[k];
            [self.value[k], width * x, width * width * y]
        };
        let t = (x - self.at[k]) / width;
        let [value, slope, second] = quintic_hermite(t, end(k), end(k + 1));
        [value, slope / width, second / (width * width)]
    }

    /// The integral of the values from 0 to 1.
    pub fn integral(&self) -> f64 {
        let intervals = self.at.windows(2).enumerate();
        let each = intervals.map(|(k, at)| {
            let width = at[1] - at[0];
            let difference = self.slopes[k] - self.slopes[k + 1];
            let sum = self.slopes[k] + self.slopes[k + 1];
            // Of the polynomial of degree 5.
            let ends = 0.5 * (self.value[k] + self.value[k + 1]);
            width * (ends + width * (difference.x / 10.0 + width * sum.y / 120.0))
        });
        each.sum()
    }
}

/// Points on the limited curve through three points or more: these, and the ends of equal parts between them.
fn points_between(at: &[f64], value: &[f64]) -> (Vec<f64>, Vec<f64>) {
    let derivatives = limited_derivatives(at, value);
    let (mut places, mut values) = (vec![at[0]], vec![value[0]]);
    for k in 0..at.len() - 1 {
        let width = at[k + 1] - at[k];
        let end = |k: usize| {
            let [slope, second] = derivatives[k];
            [value[k], width * slope, width * width * second]
        };
        for part in 1..PARTS {
            let t = part as f64 / PARTS as f64;
            let [between, ..] = quintic_hermite(t, end(k), end(k + 1));
            places.push(at[k] + t * width);
            values.push(between);
        }
        places.push(at[k + 1]);
        values.push(value[k + 1]);
    }
    (places, values)
}

/// The polynomial of degree 5 with these values, first and second derivatives at 0 and at 1: its
/// value and derivatives at `t`.
pub(super) fn quintic_hermite(t: f64, [f0, d0, c0]: [f64; 3], [f1, d1, c1]: [f64; 3]) -> [f64; 3] {
    if t == 1.0 {
        // The sums below would lose a small value next to large ones, or a zero.
        return [f1, d1, c1];
    }
    let rise = f1 - f0;
    let a3 = 10.0 * rise - 6.0 * d0 - 4.0 * d1 - 1.5 * c0 + 0.5 * c1;
    let a4 = -15.0 * rise + 8.0 * d0 + 7.0 * d1 + 1.5 * c0 - c1;
    let a5 = 6.0 * rise - 3.0 * (d0 + d1) - 0.5 * (c0 - c1);
    [
        f0 + t * (d0 + t * (0.5 * c0 + t * (a3 + t * (a4 + t * a5)))),
        d0 + t * (c0 + t * (3.0 * a3 + t * (4.0 * a4 + t * 5.0 * a5))),
        c0 + t * (6.0 * a3 + t * (12.0 * a4 + t * 20.0 * a5)),
    ]
}

/// Of two numbers of one sign the smaller one, of others zero.
fn min_mod(a: f64, b: f64) -> f64 {
    match a * b > 0.0 {
        true => a.signum() * a.abs().min(b.abs()),
        false => 0.0,
    }
}

/// The slope and the second derivative at each of three points or more of a curve that turns where the points do: those
/// of the parabola through a point and its neighbors, so that points on a parabola lie on it. Slopes are limited as in the
/// monotone interpolants of H. T. Huynh (Accurate monotone cubic interpolation, SIAM J. Numer. Anal. 30, 1993,
/// 57-100), second derivatives such that the slope beside a point is not below those at both ends.
fn limited_derivatives(at: &[f64], value: &[f64]) -> Vec<[f64; 2]> {
    let last = at.len() - 1;
    let width: Vec<f64> = at.windows(2).map(|pair| pair[1] - pair[0]).collect();
    let rise: Vec<f64> = (0..last)
        .map(|k| (value[k + 1] - value[k]) / width[k])
        .collect();
    // Half the second derivative of the parabola through a point and its neighbors; at an end that of
    // the point beside it.
    let bend = |k: usize| {
        let k = k.clamp(1, last - 1);
        (rise[k] - rise[k - 1]) / (width[k - 1] + width[k])
    };
    let slope = |k: usize| {
        if k == 0 {
            return rise[0] - bend(0) * width[0];
        }
        if k == last {
            return rise[last - 1] + bend(last) * width[last - 1];
        }
        let parabola = rise[k - 1] + bend(k) * width[k - 1];
        // The slopes here of the less curved parabolas over the intervals on both sides.
        let before = rise[k - 1] + min_mod(bend(k - 1), bend(k)) * width[k - 1];
        let behind = rise[k] - min_mod(bend(k), bend(k + 1)) * width[k];
        let monotone = 2.0 * min_mod(rise[k - 1], rise[k]).abs();
        let most = monotone.max(1.5 * min_mod(before, behind).abs());
        parabola.clamp(-most, most)
    };
    let slopes: Vec<f64> = (0..=last).map(slope).collect();
    let second = |k: usize| {
        let mut second = 2.0 * bend(k);
        // In Bernstein's form the slope next to point k is d + h c/4, at a distance h that has a sign.
        let sides = [(k > 0).then(|| k - 1), (k < last).then_some(k)];
        for interval in sides.into_iter().flatten() {
            let h = match interval == k {
                true => width[interval],
                false => -width[interval],
            };
            let upwards = rise[interval].signum();
            let [own, other] = [k, 2 * interval + 1 - k].map(|end| upwards * slopes[end]);
            let least = own.min(other).min(0.0);
            // upwards (d + h c/4) >= least.
            let bound = 4.0 * upwards * (least - own) / h;
            second = match upwards * h > 0.0 {
                true => second.max(bound),
                false => second.min(bound),
            };
        }
        second
    };
    (0..=last).map(|k| [slopes[k], second(k)]).collect()
}

/// The derivatives at three points or more. Of the polynomial of degree 5 between two points with
/// the values f, slopes d and second derivatives c, at a distance h and with rise F,
///
/// h^3 f''' = 60 F - 36 h d0 - 24 h d1 - 9 h^2 c0 + 3 h^2 c1,
/// h^4 f'''' = -360 F + 192 h d0 + 168 h d1 + 36 h^2 c0 - 24 h^2 c1
///
/// at the first point, and likewise at the second; both are continuous, and zero at the ends. These
/// equations for (d, c) are block tridiagonal.
fn spline_derivatives(at: &[f64], value: &[f64]) -> Vec<DVec2> {
    let last = at.len() - 1;
    // What the interval from point k adds to the equations of its ends: the rows are f''' and f''''.
    let first_end = |k: usize| {
        let h = at[k + 1] - at[k];
        let (h2, h3, h4) = (h * h, h.powi(3), h.powi(4));
        let own = DMat2::from_cols_array(&[-36.0 / h2, 192.0 / h3, -9.0 / h, 36.0 / h2]);
        let next = DMat2::from_cols_array(&[-24.0 / h2, 168.0 / h3, 3.0 / h, -24.0 / h2]);
        let rise = value[k + 1] - value[k];
        (own, next, rise * DVec2::new(60.0 / h3, -360.0 / h4))
    };
    let second_end = |k: usize| {
        let h = at[k + 1] - at[k];
        let (h2, h3, h4) = (h * h, h.powi(3), h.powi(4));
        let before = DMat2::from_cols_array(&[-24.0 / h2, -168.0 / h3, -3.0 / h, -24.0 / h2]);
        let own = DMat2::from_cols_array(&[-36.0 / h2, -192.0 / h3, 9.0 / h, 36.0 / h2]);
        let rise = value[k + 1] - value[k];
        (before, own, rise * DVec2::new(60.0 / h3, 360.0 / h4))
    };
    // Elimination from the first point on: unknowns[k] = shift[k] - step[k] unknowns[k + 1].
    let mut eliminated: Vec<(DMat2, DVec2)> = Vec::with_capacity(last);
    let mut unknowns = vec![DVec2::ZERO; last + 1];
    for k in 0..=last {
        let (mut own, mut right) = (DMat2::ZERO, DVec2::ZERO);
        if let Some((step, shift)) = eliminated.last() {
            let (before, here, known) = second_end(k - 1);
            own += here - before * *step;
            right -= known + before * *shift;
        }
        if k == last {
            unknowns[k] = own.inverse() * right;
            break;
        }
        let (here, next, known) = first_end(k);
        own -= here;
        right += known;
        let inverse = own.inverse();
        eliminated.push((inverse * -next, inverse * right));
    }
    for (k, (step, shift)) in eliminated.into_iter().enumerate().rev() {
        unknowns[k] = shift - step * unknowns[k + 1];
    }
    unknowns
}

#[cfg(test)]
mod tests {
    use super::*;

    #[track_caller]
    fn close(found: f64, wanted: f64, within: f64) {
        assert!((found - wanted).abs() < within, "{found} {wanted}");
    }

    #[test]
    fn lines_and_parabolas_are_what_they_are() {
        let line = Spline::through_points(vec![0.0, 1.0], vec![2.0, -1.0]);
        assert_eq!(line.value_and_derivatives(0.25), [1.25, -3.0, 0.0]);
        close(line.integral(), 0.5, 1e-15);
        let parabola = |x: f64| 1.2 + x * (4.0 - 5.0 * x);
        for at in [
            vec![0.0, 0.3, 1.0],
            vec![0.0, 0.1, 0.2, 0.7, 0.9, 1.0],
            vec![0.0, 0.4, 0.41, 1.0],
            vec![0.0, 0.1, 0.39, 0.42, 1.0],
        ] {
            let value = at.iter().map(|&x| parabola(x)).collect();
            let spline = Spline::through_points(at, value);
            close(spline.integral(), 1.2 + 2.0 - 5.0 / 3.0, 1e-13);
            for x in [0.0, 0.05, 0.3, 0.65, 1.0] {
                let [value, slope, second] = spline.value_and_derivatives(x);
                close(value, parabola(x), 1e-13);
                close(slope, 4.0 - 10.0 * x, 1e-11);
                close(second, -10.0, 1e-10);
            }
        }
    }

    /// Four derivatives are continuous, the integral is that of the values.
    #[test]
    fn four_derivatives_are_continuous() {
        let at = vec![0.0, 0.15, 0.4, 0.5, 0.8, 1.0];
        let spline = Spline::through_points(at.clone(), vec![1.0, 1.7, 2.0, 2.3, 1.1, 0.0]);
        // From the polynomial on one side of a knot.
        let third_and_fourth = |knot: f64, side: f64| {
            let h = 1e-3 * side;
            let [_, _, c0] = spline.value_and_derivatives(knot + 1e-14 * side);
            let [c1, c2, c3] =
                [1.0, 2.0, 3.0].map(|k| spline.value_and_derivatives(knot + k * h)[2]);
            let third = (-11.0 * c0 + 18.0 * c1 - 9.0 * c2 + 2.0 * c3) / (6.0 * h);
            [third, (2.0 * c0 - 5.0 * c1 + 4.0 * c2 - c3) / (h * h)]
        };
        let scale = third_and_fourth(0.45, 1.0)[1].abs();
        for &knot in &at[1..5] {
            let [left, right] = [-1.0, 1.0].map(|side| third_and_fourth(knot, side));
            close(left[0], right[0], 1e-5 * scale);
            close(left[1], right[1], 1e-3 * scale);
        }
        let h = 1e-4;
        for x in [0.07, 0.31, 0.77] {
            let [before, here, behind] = [-h, 0.0, h].map(|h| spline.value_and_derivatives(x + h));
            close((behind[0] - before[0]) / (2.0 * h), here[1], 1e-5);
            close((behind[1] - before[1]) / (2.0 * h), here[2], 1e-4);
        }
        let steps = 20_000;
        let place = |k: usize| (k as f64 + 0.5) / steps as f64;
        let sum: f64 = (0..steps)
            .map(|k| spline.value_and_derivatives(place(k))[0])
            .sum();
        close(spline.integral(), sum / steps as f64, 1e-8);
    }

    /// Where values rise or fall through four points, the curve does between the two in the middle; beyond a value it
    /// goes by no more than a fifth of the rises beside it.
    #[test]
    fn the_curve_turns_where_the_points_do() {
        for value in [
            vec![0.8, 1.5, 1.7, 0.0],
            vec![1.0, 1.0, 1.0, 0.2, 0.1],
            vec![0.1, 0.11, 1.9, 2.0, 2.01, 1.99, 0.0],
            vec![0.0, 1.0, 1.0, 1.0, 0.0],
            vec![0.2, 2.0, 2.1, 2.05, 0.3, 0.25],
            vec![1.0, 0.3, 0.32, 0.9, 1.5],
        ] {
            let last = value.len() - 1;
            let at: Vec<f64> = (0..=last)
                .map(|k| (k as f64 / last as f64).powf(1.3))
                .collect();
            let spline = Spline::through_points(at.clone(), value.clone());
            let turns = |k: usize| {
                k > 0 && k < last && (value[k] - value[k - 1]) * (value[k + 1] - value[k]) <= 0.0
            };
            for k in 0..last {
                let rise = value[k + 1] - value[k];
                let beside = [k.checked_sub(1), Some(k), Some(k + 1)];
                let steps = beside.into_iter().flatten().filter(|&k| k < last);
                let steepest = steps
                    .map(|k| (value[k + 1] - value[k]).abs())
                    .fold(0.0, f64::max);
                let (low, high) = (value[k].min(value[k + 1]), value[k].max(value[k + 1]));
                let mut slopes = Vec::new();
                for step in 0..=100 {
                    let x = at[k] + f64::from(step) / 100.0 * (at[k + 1] - at[k]);
                    let [found, slope, _] = spline.value_and_derivatives(x);
                    slopes.push(slope * rise.signum());
                    let within = 0.2 * steepest + 1e-4;
                    assert!(
                        found > low - within && found < high + within,
                        "{value:?} {x}: {found}"
                    );
                }
                if rise != 0.0 && !turns(k) && !turns(k + 1) {
                    let least = slopes.iter().copied().fold(f64::INFINITY, f64::min);
                    let ends = slopes[0].min(slopes[100]).min(0.0);
                    assert!(
                        least > ends - 0.05 * rise.abs() - 1e-12,
                        "{value:?} {k}: {least}"
                    );
                }
            }
        }
    }

    /// A smooth change of a value changes the curve smoothly.
    #[test]
    fn the_curve_follows_its_points_smoothly() {
        let curve = |width: f64| {
            let spline = Spline::through_points(
                vec![0.0, 0.15, 0.4, 0.7, 1.0],
                vec![0.9, 1.4, width, 1.0, 0.0],
            );
            [0.1, 0.3, 0.5, 0.9].map(|x| spline.value_and_derivatives(x)[0])
        };
        let slopes = |h: f64| {
            let [a, b] = [curve(1.6 - h), curve(1.6 + h)];
            [0, 1, 2, 3].map(|k| (b[k] - a[k]) / (2.0 * h))
        };
        let [coarse, fine] = [1e-2, 1e-4].map(slopes);
        for (a, b) in coarse.into_iter().zip(fine) {
            close(a, b, 1e-6);
        }
    }
}
