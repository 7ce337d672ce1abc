//! What closed forms take: roots, differential equations, elliptic integrals.

use std::f64::consts::PI;

/// Where a function changes its sign between two numbers, to the last digit.
pub fn bisect(mut low: f64, mut high: f64, f: impl Fn(f64) -> f64) -> f64 {
    let sign = f(low).signum();
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        match f(middle) * sign > 0.0 {
            true => low = middle,
            false => high = middle,
        }
    }
    0.5 * (low + high)
}

/// The state at s = `end` of y' = slope(s, y), by the classic rule of Runge and Kutta.
pub fn runge_kutta<const N: usize>(
    slope: impl Fn(f64, [f64; N]) -> [f64; N],
    mut y: [f64; N],
    end: f64,
    steps: u32,
) -> [f64; N] {
    let h = end / f64::from(steps);
    let ahead = |y: [f64; N], k: [f64; N], by: f64| std::array::from_fn(|c| y[c] + by * k[c]);
    for step in 0..steps {
        let s = h * f64::from(step);
        let a = slope(s, y);
        let b = slope(s + 0.5 * h, ahead(y, a, 0.5 * h));
        let c = slope(s + 0.5 * h, ahead(y, b, 0.5 * h));
        let d = slope(s + h, ahead(y, c, h));
        y = std::array::from_fn(|k| y[k] + h / 6.0 * (a[k] + 2.0 * (b[k] + c[k]) + d[k]));
    }
    y
}

/// Complete elliptic integrals K and E of the modulus k, by the arithmetic-geometric mean.
pub fn elliptic(k: f64) -> [f64; 2] {
    let (mut a, mut b, mut c) = (1.0, (1.0 - k * k).sqrt(), k);
    let (mut sum, mut power) = (0.5 * c * c, 1.0);
    while c > 1e-16 {
        (a, b, c) = (0.5 * (a + b), (a * b).sqrt(), 0.5 * (a - b));
        sum += power * c * c;
        power *= 2.0;
    }
    let first = 0.5 * PI / a;
    [first, first * (1.0 - sum)]
}

/// The sine k of half of the angle at the tip of a column with EI = L = 1 that has buckled
/// under a load P: K(k) = sqrt(P) (Love 1927, article 263).
pub fn elastica_modulus(load: f64) -> f64 {
    bisect(0.0, 0.99, |k| elliptic(k)[0] - load.sqrt())
}
