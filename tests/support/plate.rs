//! A thin plate that is clamped at one end, by Ritz's method with polynomials: it shares nothing with rods and tissue.

use nalgebra::{DMatrix, DVector, SymmetricEigen};

/// A plate in the x-y plane, symmetric about the x axis, clamped at x = 0.
pub struct RitzPlate<W: Fn(f64) -> f64> {
    pub length: f64,
    /// The width at a fraction of the length.
    pub width: W,
    pub thickness: f64,
    /// Young's moduli along and across.
    pub young: [f64; 2],
    pub poisson: f64,
    pub shear: f64,
}

/// Degrees of the polynomials along and across.
const DEGREES: [usize; 2] = [11, 9];

const QUADRATURE_POINTS: usize = 28;

/// The values of a function and its first two derivatives.
type Jet = [f64; 3];

impl<W: Fn(f64) -> f64> RitzPlate<W> {
    /// The deflection of the middle of the free end under a force per area, in linear theory.
    pub fn tip_deflection(&self, load: f64) -> f64 {
        let Sums {
            stiffness, ones, ..
        } = self.sums();
        let found = stiffness
            .cholesky()
            .expect("positive definite")
            .solve(&(load * ones));
        let tip = self.shapes(1.0, 0.0);
        tip.iter()
            .zip(found.iter())
            .map(|(shape, c)| shape[0][0] * shape[1][0] * c)
            .sum()
    }

    /// The lowest frequencies as omega L^2 sqrt(rho t/D), D = E t^3/(12 (1 - nu^2)), in increasing order.
    pub fn frequencies(&self) -> Vec<f64> {
        let Sums {
            stiffness, mass, ..
        } = self.sums();
        let lower = mass.cholesky().expect("positive definite").l();
        let half = lower.solve_lower_triangular(&stiffness).expect("regular");
        let reduced = lower
            .solve_lower_triangular(&half.transpose())
            .expect("regular");
        let symmetric = 0.5 * (&reduced + reduced.transpose());
        let mut all: Vec<f64> = SymmetricEigen::new(symmetric)
            .eigenvalues
            .iter()
            .copied()
            .collect();
        all.sort_by(f64::total_cmp);
        let rigidity = self.rigidities()[0];
        let unit = self.length.powi(2) / rigidity.sqrt();
        all.into_iter().map(|value| value.sqrt() * unit).collect()
    }

    /// D11, D22, D12 and D66.
    fn rigidities(&self) -> [f64; 4] {
        let [along, across] = self.young;
        let flat = self.thickness.powi(3) / 12.0;
        let kept = 1.0 - self.poisson.powi(2) * across / along;
        let d22 = across * flat / kept;
        [
            along * flat / kept,
            d22,
            self.poisson * d22,
            self.shear * flat,
        ]
    }

    /// Every shape function: its factors along and across with their derivatives.
    fn shapes(&self, x: f64, y: f64) -> Vec<[Jet; 2]> {
        let half = 0.5
            * (0..=50)
                .map(|k| (self.width)(f64::from(k) / 50.0))
                .fold(0.0, f64::max);
        let along = legendre(2.0 * x - 1.0, DEGREES[0]).map(|[p, d, dd]| {
            // x^2 P(2 x - 1), by x in units of the length.
            let (d, dd) = (2.0 * d, 4.0 * dd);
            let l = self.length;
            [
                x * x * p,
                (2.0 * x * p + x * x * d) / l,
                (2.0 * p + 4.0 * x * d + x * x * dd) / (l * l),
            ]
        });
        let across: Vec<Jet> = legendre(y / half, DEGREES[1])
            .map(|[p, d, dd]| [p, d / half, dd / (half * half)])
            .collect();
        along
            .flat_map(|a| across.iter().map(move |b| [a, *b]).collect::<Vec<_>>())
            .collect()
    }

    fn sums(&self) -> Sums {
        let count = (DEGREES[0] + 1) * (DEGREES[1] + 1);
        let mut sums = Sums {
            stiffness: DMatrix::zeros(count, count),
            mass: DMatrix::zeros(count, count),
            ones: DVector::zeros(count),
        };
        let rule = gauss(QUADRATURE_POINTS);
        let [d11, d22, d12, d66] = self.rigidities();
        for &(x, wx) in &rule {
            let (x, width) = (0.5 * (x + 1.0), (self.width)(0.5 * (x + 1.0)));
            for &(eta, wy) in &rule {
                let area = 0.25 * wx * wy * self.length * width;
                let shapes = self.shapes(x, 0.5 * eta * width);
                let column =
                    |of: fn(&[Jet; 2]) -> f64| DVector::from_iterator(count, shapes.iter().map(of));
                let value = column(|[a, b]| a[0] * b[0]);
                let along = column(|[a, b]| a[2] * b[0]);
                let across = column(|[a, b]| a[0] * b[2]);
                let twist = column(|[a, b]| a[1] * b[1]);
                sums.stiffness
                    .ger(area, &along, &(d11 * &along + d12 * &across), 1.0);
                sums.stiffness
                    .ger(area, &across, &(d22 * &across + d12 * &along), 1.0);
                sums.stiffness.ger(4.0 * area * d66, &twist, &twist, 1.0);
                sums.mass.ger(area, &value, &value, 1.0);
                sums.ones.axpy(area, &value, 1.0);
            }
        }
        sums
    }
}

/// Integrals over the plate: of products of curvatures with their stiffness, of products, and of the functions.
struct Sums {
    stiffness: DMatrix<f64>,
    mass: DMatrix<f64>,
    ones: DVector<f64>,
}

/// Legendre's polynomials up to a degree.
fn legendre(x: f64, degree: usize) -> impl Iterator<Item = Jet> {
    let mut all: Vec<Jet> = vec![[1.0, 0.0, 0.0], [x, 1.0, 0.0]];
    for n in 2..=degree {
        let (k, before, last) = (n as f64, all[n - 2], all[n - 1]);
        let value = ((2.0 * k - 1.0) * x * last[0] - (k - 1.0) * before[0]) / k;
        let slope = before[1] + (2.0 * k - 1.0) * last[0];
        all.push([value, slope, before[2] + (2.0 * k - 1.0) * last[1]]);
    }
    all.into_iter()
}

/// Points and weights of Gauss' rule on [-1, 1], by G. H. Golub and J. H. Welsch (Math. Comp. 23, 1969).
fn gauss(count: usize) -> Vec<(f64, f64)> {
    let beside = |k: usize| {
        let k = k as f64;
        k / (4.0 * k * k - 1.0).sqrt()
    };
    let matrix = DMatrix::from_fn(count, count, |i, j| match i.abs_diff(j) {
        1 => beside(i.max(j)),
        _ => 0.0,
    });
    let eigen = SymmetricEigen::new(matrix);
    let each = eigen.eigenvalues.iter().enumerate();
    each.map(|(k, x)| (*x, 2.0 * eigen.eigenvectors[(0, k)].powi(2)))
        .collect()
}
