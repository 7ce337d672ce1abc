//! Gradient and Hessian of the midpoint element equal those of automatic
//! differentiation, applied to the element's functional written out again.

use glam::{DMat3, DQuat};
use leafdyn::internals::rod::{NodePair, Section, Segment};
use leafdyn::internals::rotation;
use leafdyn_testing::*;
use nalgebra::{SMatrix, SVector};
use num_dual::{DualNum, hessian};
use proptest::prelude::*;

type Quaternion<D> = [D; 4]; // w, x, y, z

/// A number with its derivatives.
trait Number: DualNum<Primitive = f64> + Copy {}

impl<D: DualNum<Primitive = f64> + Copy> Number for D {}

fn multiply<D: Number>(a: Quaternion<D>, b: Quaternion<D>) -> Quaternion<D> {
    [
        a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3],
        a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2],
        a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1],
        a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0],
    ]
}

fn conjugate<D: Number>(q: Quaternion<D>) -> Quaternion<D> {
    [q[0], -q[1], -q[2], -q[3]]
}

/// Components of R(q)^T a.
fn to_directors<D: Number>(q: Quaternion<D>, a: [D; 3]) -> [D; 3] {
    let zero = a[0] * 0.0;
    let r = multiply(multiply(conjugate(q), [zero, a[0], a[1], a[2]]), q);
    [r[1], r[2], r[3]]
}

/// Pi of the element. Variables: x0, a, x1, b, n, with rotation increments a, b
/// applied as exp(a) q0, exp(b) q1 to second order about zero.
fn functional<D: Number>(
    z: SVector<D, 15>,
    section: &Section,
    ends: &NodePair,
    x: &[DVec3; 2],
    n0: DVec3,
) -> D {
    let vector = |at: usize, base: DVec3| [0, 1, 2].map(|k| z[at + k] + base[k]);
    let rotated = |offset: usize, q: DQuat| -> Quaternion<D> {
        let t = [z[offset], z[offset + 1], z[offset + 2]];
        let square = t[0] * t[0] + t[1] * t[1] + t[2] * t[2];
        let one = square * 0.0 + 1.0;
        let increment = [one - square / 8.0, t[0] * 0.5, t[1] * 0.5, t[2] * 0.5];
        multiply(increment, [one * q.w, one * q.x, one * q.y, one * q.z])
    };
    let (x0, x1, n) = (vector(0, x[0]), vector(6, x[1]), vector(12, n0));
    let (q0, mut q1) = (rotated(3, ends.q[0]), rotated(9, ends.q[1]));
    if ends.q[0].dot(ends.q[1]) < 0.0 {
        q1 = q1.map(|c| -c);
    }
    let sum = [0, 1, 2, 3].map(|k| q0[k] + q1[k]);
    let length = (sum[0] * sum[0] + sum[1] * sum[1] + sum[2] * sum[2] + sum[3] * sum[3]).sqrt();
    let middle = sum.map(|c| c / length);
    let p = multiply(conjugate(q0), q1);
    let sin = (p[1] * p[1] + p[2] * p[2] + p[3] * p[3]).sqrt();
    let factor = sin.atan2(p[0]) * 2.0 / sin;
    let dx = [0, 1, 2].map(|k| x1[k] - x0[k]);
    let (xi, nu) = (to_directors(middle, dx), to_directors(middle, n));
    let mut pi = nu[0] * 0.0;
    for k in 0..3 {
        let strain = factor * p[k + 1] / section.ds - section.rest_curvature[k];
        pi = pi + nu[k] * (xi[k] - section.ds * section.rest_strain[k])
            - nu[k] * nu[k] * (0.5 * section.ds * section.compliance[k])
            + strain * strain * (0.5 * section.ds * section.couple_stiffness[k]);
    }
    pi
}

fn vector(range: f64) -> impl Strategy<Value = DVec3> {
    prop::array::uniform3(-range..range).prop_map(DVec3::from_array)
}

prop_compose! {
    fn state()(
        ds in 0.05..0.5_f64,
        stiffness in prop::array::uniform3(0.1..5.0_f64),
        u0 in vector(2.0),
        v0 in vector(0.3),
        compliance in prop::array::uniform3(0.001..0.5_f64),
        x0 in vector(1.0),
        dx in vector(0.5),
        start in vector(2.0),
        axis in vector(1.0),
        angle in prop_oneof![1e-6..0.3_f64, 0.1..3.0_f64, 3.1..std::f64::consts::PI - 9e-5],
        n in vector(5.0),
        flip in any::<bool>(),
    ) -> (Section, NodePair, DVec3) {
        let section = Section {
            ds,
            couple_stiffness: DVec3::from_array(stiffness),
            rest_curvature: u0,
            rest_strain: DVec3::X + v0,
            compliance: DVec3::from_array(compliance),
            // Exact: the element's own matrix, nothing softened.
            condensing: DVec3::from_array(compliance).recip(),
        };
        let q0 = rotation::exp(start);
        let q1 = q0 * rotation::exp(angle * (axis + DVec3::splat(1e-3)).normalize());
        (section, NodePair { x: [x0, x0 + dx], q: [q0, if flip { -q1 } else { q1 }] }, n)
    }
}

fn block(matrix: &mut SMatrix<f64, 12, 12>, row: usize, column: usize, k: DMat3, sign: f64) {
    for i in 0..3 {
        for j in 0..3 {
            matrix[(row + i, column + j)] = sign * k.col(j)[i];
        }
    }
}

proptest! {
    #![proptest_config(leafdyn_testing::random::cases(400))]
    #[test]
    fn element_matches_automatic_differentiation((section, ends, n) in state()) {
        let (value, gradient, hessian) = hessian(
            |z: SVector<_, 15>| functional(z, &section, &ends, &ends.x, n),
            &SVector::<f64, 15>::zeros(),
        );
        let segment = Segment::new(&section, &ends, n);

        // Value: with the law met, Pi is the elastic energy; else the gap works on n.
        let nu_gap = segment.nu.dot(segment.gap);
        prop_assert!((section.elastic_energy(&segment) + nu_gap - value).abs() < 1e-11 * (1.0 + value.abs()));

        // Gradient.
        let g = segment.gradient(&section);
        let ours: Vec<f64> = [-g.x, g.a, g.x, g.b, segment.frame * segment.gap]
            .iter().flat_map(|g| g.to_array()).collect();
        let scale = 1.0 + gradient.amax();
        for (k, ours) in ours.iter().enumerate() {
            prop_assert!((ours - gradient[k]).abs() < 1e-10 * scale, "gradient {k}: {ours} {}", gradient[k]);
        }

        // Hessian, the force condensed out here by plain linear algebra.
        let k_zz = hessian.fixed_view::<12, 12>(0, 0).into_owned();
        let k_zn = hessian.fixed_view::<12, 3>(0, 12).into_owned();
        let k_nn = hessian.fixed_view::<3, 3>(12, 12).into_owned();
        let inverse = k_nn.try_inverse().unwrap();
        let condensed = k_zz - k_zn * inverse * k_zn.transpose();
        let b = segment.hessian(&section);
        let mut ours = SMatrix::<f64, 12, 12>::zeros();
        for (row, column, k, sign) in [
            (0, 0, b.xx, 1.0), (0, 6, b.xx, -1.0), (6, 6, b.xx, 1.0),
            (0, 3, b.xa, -1.0), (0, 9, b.xb, -1.0), (6, 3, b.xa, 1.0), (6, 9, b.xb, 1.0),
            (3, 3, b.aa, 1.0), (3, 9, b.ab, 1.0), (9, 9, b.bb, 1.0),
        ] {
            block(&mut ours, row, column, k, sign);
            block(&mut ours, column, row, k.transpose(), sign);
        }
        let scale = 1.0 + condensed.amax();
        prop_assert!((ours - condensed).amax() < 1e-9 * scale, "hessian off by {}", (ours - condensed).amax() / scale);

        // Condensed gradient and the force that goes with a nodal increment.
        let reduced = gradient.fixed_rows::<12>(0) - k_zn * inverse * gradient.fixed_rows::<3>(12);
        let g = segment.condensed_gradient(&section);
        let ours: Vec<f64> = [-g.x, g.a, g.x, g.b].iter().flat_map(|g| g.to_array()).collect();
        for (k, ours) in ours.iter().enumerate() {
            prop_assert!((ours - reduced[k]).abs() < 1e-9 * (1.0 + reduced.amax()));
        }
        let z = SVector::<f64, 12>::from_fn(|k, _| 0.1 * (k as f64 + 1.0).sin());
        let expected = -inverse * (gradient.fixed_rows::<3>(12) + k_zn.transpose() * z);
        let part = |k: usize| DVec3::new(z[k], z[k + 1], z[k + 2]);
        let ours = segment.force_increment(&section, part(6) - part(0), part(3), part(9));
        prop_assert!((0..3).all(|k| (ours[k] - expected[k]).abs() < 1e-9 * (1.0 + expected.amax())));
    }
}
