//! The smoothest curve through given points: the natural quintic spline.
//!
//! Of all curves W(x) through the points it has the least integral of W'''^2 (I. J. Schoenberg, On
//! interpolation by spline functions and its minimal properties, 1964): its third and fourth
//! derivatives vanish at both ends, and between the points it is a polynomial of degree 5 with
//! four continuous derivatives. So the curvature of a margin has no corners, and three points lie on
//! a parabola.

use glam::{DMat2, DVec2};

/// A natural quintic spline through points, of which the first is at 0 and the last at 1.
#[derive(Clone, Debug, PartialEq)]
pub struct Spline {
    at: Vec<f64>,
    value: Vec<f64>,
    /// The first and second derivatives at the points.
    slopes: Vec<DVec2>,
}

impl Spline {
    /// The spline through two points or more; two give a line.
    pub fn through_points(at: Vec<f64>, value: Vec<f64>) -> Spline {
        let slopes = match at.len() {
            2 => vec![DVec2::new(value[1] - value[0], 0.0); 2],
            _ => spline_derivatives(&at, &value),
        };
        Spline { at, value, slopes }
    }

    /// The places of the points.
    pub fn knots(&self) -> &[f64] {
        &self.at
    }

    /// The values at the points.
    pub fn values(&self) -> &[f64] {
        &self.value
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
        let parabola = |x: f64| 1.2 + x * (4.0 - 5.0 * x);
        for at in [vec![0.0, 0.3, 1.0], vec![0.0, 0.1, 0.2, 0.7, 0.9, 1.0]] {
            let value = at.iter().map(|&x| parabola(x)).collect();
            let spline = Spline::through_points(at, value);
            for x in [0.0, 0.05, 0.3, 0.65, 1.0] {
                let [value, slope, second] = spline.value_and_derivatives(x);
                close(value, parabola(x), 1e-13);
                close(slope, 4.0 - 10.0 * x, 1e-11);
                close(second, -10.0, 1e-10);
            }
        }
    }

    /// All derivatives up to the fourth are continuous, the last two vanish at the ends, and every
    /// other curve through the points has a larger integral of W'''^2.
    #[test]
    fn it_is_the_natural_quintic_spline() {
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
            close(left[0], right[0], 1e-6 * scale);
            close(left[1], right[1], 1e-4 * scale);
        }
        for [third, fourth] in [third_and_fourth(0.0, 1.0), third_and_fourth(1.0, -1.0)] {
            close(third, 0.0, 1e-6 * scale);
            close(fourth, 0.0, 1e-4 * scale);
        }
    }
}
