//! The generalized minimal residual method (GMRES; Y. Saad and M. H. Schultz, SIAM J. Sci. Stat.
//! Comput. 7, 1986) for equations A x = b whose matrix is close to the identity but for few
//! directions, as preconditioned ones are: A is known by its products.

use faer::Mat;

/// When [`solve_minimal_residual`] ends, and which directions it leaves out.
#[derive(Clone, Copy, Debug)]
pub struct KrylovLimits {
    /// Norm of the residual, as a part of that of b.
    pub accuracy: f64,
    /// Largest number of directions.
    pub most: usize,
    /// Directions of a singular value up to this are left out: A is singular in them, up to
    /// rounding. With zero none is.
    pub singular_value_limit: f64,
    /// Where the search ends without progress, if it does.
    pub stagnation: Option<StagnationLimit>,
}

/// The search ends where so many directions in a row leave more than this remainder of the residual.
#[derive(Clone, Copy, Debug)]
pub struct StagnationLimit {
    pub directions: usize,
    pub remainder: f64,
}

/// A solution as a sum over orthonormal directions.
pub struct KrylovSolution {
    /// The directions, in the order in which they were multiplied by A.
    pub directions: Vec<Vec<f64>>,
    /// The coefficient of each.
    pub coefficients: Vec<f64>,
    /// Norm of b - A x as a part of that of b.
    pub residual: f64,
}

/// Solves A x = `b`; `product` makes A times a direction. `None` if a product fails or is not
/// finite. In directions in which A is singular the solution is zero.
pub fn solve_minimal_residual(
    b: &[f64],
    limits: KrylovLimits,
    product: &mut dyn FnMut(&[f64]) -> Option<Vec<f64>>,
) -> Option<KrylovSolution> {
    let length = norm(b);
    let mut found = KrylovSolution {
        directions: Vec::new(),
        coefficients: Vec::new(),
        residual: 0.0,
    };
    if length == 0.0 {
        return Some(found);
    }
    if !length.is_finite() {
        return None;
    }
    let mut next: Vec<f64> = b.iter().map(|value| value / length).collect();
    // The triangular factor of what A makes of the directions, and the rotations that lead to it.
    let (mut triangle, mut rotations): (Vec<Vec<f64>>, Vec<[f64; 2]>) = (Vec::new(), Vec::new());
    let mut remaining = vec![length];
    while found.directions.len() < limits.most {
        let k = triangle.len();
        let stagnates = limits.stagnation.is_some_and(|limit| {
            let before = k.checked_sub(limit.directions);
            before.is_some_and(|before| {
                remaining[k].abs() > limit.remainder * remaining[before].abs()
            })
        });
        if remaining[k].abs() <= limits.accuracy * length || stagnates {
            break;
        }
        let mut image = product(&next)?;
        let size = norm(&image);
        found.directions.push(next);
        let mut column = Vec::with_capacity(k + 2);
        for direction in &found.directions {
            let part = dot(direction, &image);
            add(&mut image, -part, direction);
            column.push(part);
        }
        let left = norm(&image);
        if !left.is_finite() {
            return None;
        }
        for (i, [cos, sin]) in rotations.iter().enumerate() {
            let [a, b] = [column[i], column[i + 1]];
            (column[i], column[i + 1]) = (cos * a + sin * b, cos * b - sin * a);
        }
        let hypotenuse = column[k].hypot(left);
        if hypotenuse <= f64::EPSILON * size.max(1.0) {
            break;
        }
        let [cos, sin] = [column[k] / hypotenuse, left / hypotenuse];
        column[k] = hypotenuse;
        remaining.push(-sin * remaining[k]);
        remaining[k] *= cos;
        rotations.push([cos, sin]);
        triangle.push(column);
        if left <= f64::EPSILON * size {
            break;
        }
        next = image;
        next.iter_mut().for_each(|value| *value /= left);
    }
    let count = triangle.len();
    if count == 0 {
        found.residual = 1.0;
        found.coefficients = vec![0.0; found.directions.len()];
        return Some(found);
    }
    let upper = Mat::from_fn(
        count,
        count,
        |r, c| if r <= c { triangle[c][r] } else { 0.0 },
    );
    let coefficients = solve_triangle(&upper, &remaining[..count], limits.singular_value_limit)?;
    let sums = (0..count).map(|r| {
        (r..count)
            .map(|c| upper[(r, c)] * coefficients[c])
            .sum::<f64>()
    });
    let left_out: Vec<f64> = remaining.iter().zip(sums).map(|(b, sum)| b - sum).collect();
    found.residual = remaining[count].hypot(norm(&left_out)) / length;
    found.coefficients = coefficients;
    found.coefficients.resize(found.directions.len(), 0.0);
    Some(found)
}

/// Solves a small system of equations, but for directions of a singular value up to `limit`. The singular values of nalgebra
/// are accurate to ten digits only where a triangle is next to the identity.
fn solve_triangle(upper: &Mat<f64>, right: &[f64], limit: f64) -> Option<Vec<f64>> {
    let svd = upper.svd().ok()?;
    let (left, values, directions) = (svd.U(), svd.S().column_vector(), svd.V());
    let count = right.len();
    let mut solution = vec![0.0; count];
    for k in (0..count).filter(|&k| values[k] > limit) {
        let part = (0..count).map(|r| left[(r, k)] * right[r]).sum::<f64>() / values[k];
        for (r, sum) in solution.iter_mut().enumerate() {
            *sum += part * directions[(r, k)];
        }
    }
    Some(solution)
}

impl KrylovSolution {
    /// The sum x; `None` without a direction.
    pub fn solution(&self) -> Option<Vec<f64>> {
        let (first, rest) = self.directions.split_first()?;
        let mut sum: Vec<f64> = first.iter().map(|v| self.coefficients[0] * v).collect();
        for (direction, part) in rest.iter().zip(&self.coefficients[1..]) {
            add(&mut sum, *part, direction);
        }
        Some(sum)
    }
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

fn norm(a: &[f64]) -> f64 {
    dot(a, a).sqrt()
}

fn add(sum: &mut [f64], factor: f64, other: &[f64]) {
    let pairs = sum.iter_mut().zip(other);
    pairs.for_each(|(sum, other)| *sum += factor * other);
}

#[cfg(test)]
mod tests {
    use super::*;

    const LIMITS: KrylovLimits = KrylovLimits {
        accuracy: 1e-12,
        most: 10,
        singular_value_limit: 1e-8,
        stagnation: Some(StagnationLimit {
            directions: 3,
            remainder: 0.99,
        }),
    };

    /// The identity with one outlier of any size takes two directions.
    #[test]
    fn one_outlier_takes_two_directions() {
        for outlier in [1e-6, 0.3, 7.0] {
            let product = &mut |v: &[f64]| {
                let mut image = v.to_vec();
                image[2] *= outlier;
                Some(image)
            };
            let b = [1.0, -2.0, 0.5, 3.0];
            let found = solve_minimal_residual(&b, LIMITS, product).unwrap();
            assert_eq!(found.directions.len(), 2);
            let x = found.solution().unwrap();
            for (k, b) in b.iter().enumerate() {
                let exact = if k == 2 { b / outlier } else { *b };
                assert!((x[k] / exact - 1.0).abs() < 1e-9, "{k}: {} {exact}", x[k]);
            }
        }
    }

    /// A direction in which the matrix is singular is left out; what is missing is told.
    #[test]
    fn a_singular_direction_is_left_out() {
        let product = &mut |v: &[f64]| Some(vec![v[0], 0.0]);
        let found = solve_minimal_residual(&[3.0, 4.0], LIMITS, product).unwrap();
        assert!((found.residual - 0.8).abs() < 1e-12, "{}", found.residual);
        let none = &mut |v: &[f64]| Some(vec![0.0 * v[0]]);
        let found = solve_minimal_residual(&[1.0], LIMITS, none).unwrap();
        assert_eq!((found.residual, found.coefficients), (1.0, vec![0.0]));
    }
}
