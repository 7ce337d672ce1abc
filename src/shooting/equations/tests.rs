//! The equations compared with those of the paper, differentiated automatically.

use crate::shooting::equations::*;
use nalgebra::{SMatrix, SVector};
use num_dual::{DualNum, jacobian};

const TEXT: &str = r#"
    name = "rod"
    leaf = { rods = 1, length = 1.4, fan = [0.3] }
    stiffness = { torsion = 0.8, bending_2 = { at = [0.0, 1.0], value = [1.0, 2.0] }, bending_3 = 1.5, axial = 20.0, shear_2 = inf, shear_3 = 10.0 }
    rest = { stretch = { at = [0.0, 1.0], value = [1.1, 1.5] }, twist = 0.5, bend_2 = 1.0, bend_3 = -0.8 }
    load = { gravity = [0.2, -0.3, -2.0] }
"#;

fn cross_product<D: DualNum<Primitive = f64> + Copy>(a: [D; 3], b: [D; 3]) -> [D; 3] {
    [0, 1, 2].map(|i| {
        let (j, k) = ((i + 1) % 3, (i + 2) % 3);
        a[j] * b[k] - a[k] * b[j]
    })
}

/// R a or R^T a, where R = (1 + \[t\]) R0 to first order.
fn turned<D: DualNum<Primitive = f64> + Copy>(frame: &[[D; 3]; 3], a: [D; 3]) -> [D; 3] {
    [0, 1, 2].map(|i| frame[i][0] * a[0] + frame[i][1] * a[1] + frame[i][2] * a[2])
}

/// r', spatial rate of rotation, n', m' of the paper's equations (1) to (6), in the state
/// perturbed by (dr, t, dn, dm).
fn paper<D: DualNum<Primitive = f64> + Copy>(
    z: SVector<D, 12>,
    rod: &RodState,
    law: &SectionLaw,
    length: f64,
    load: DVec3,
) -> SVector<D, 12> {
    let zero = z[0] * 0.0;
    let part = |k: usize, base: DVec3| [0, 1, 2].map(|i| z[3 * k + i] + base[i]);
    let t = part(1, DVec3::ZERO);
    let frame = DMat3::from_quat(rod.q);
    let columns = [0, 1, 2].map(|c| {
        let director = [0, 1, 2].map(|i| zero + frame.col(c)[i]);
        let turn = cross_product(t, director);
        [0, 1, 2].map(|i| director[i] + turn[i])
    });
    let in_lab = [0, 1, 2].map(|i| [0, 1, 2].map(|c| columns[c][i]));
    let (n, m) = (part(2, rod.n), part(3, rod.m));
    let (n_d, m_d) = (turned(&columns, n), turned(&columns, m));
    let v = [0, 1, 2].map(|i| n_d[i] * law.compliance[i] + law.rest_strain[i]);
    let u = [0, 1, 2].map(|i| m_d[i] * law.flexibility[i] + law.rest_curvature[i]);
    let tangent = turned(&in_lab, v).map(|x| x * length);
    let bend = turned(&in_lab, u).map(|x| x * length);
    let moment = cross_product(n, tangent);
    SVector::from_fn(|k, _| match k / 3 {
        0 => tangent[k % 3],
        1 => bend[k % 3],
        2 => zero - load[k % 3],
        _ => moment[k % 3],
    })
}

/// The equations written out again, by components along the directors, and
/// differentiated automatically.
#[test]
fn slopes_and_derivatives_are_those_of_the_papers_equations() {
    let scenario = Scenario::from_toml(TEXT).unwrap();
    let equations = BoundaryValueProblem::new(&scenario);
    let rod = RodState {
        r: DVec3::new(0.3, -0.2, 0.1),
        q: DQuat::from_scaled_axis(DVec3::new(0.5, -0.7, 1.0)),
        n: DVec3::new(2.0, -1.0, 3.0),
        m: DVec3::new(0.5, 1.5, -2.0),
    };
    let mut y = vec![0.0; equations.state_size()];
    rod.write_flat_state(&mut y, 0);
    let (sigma, length) = (0.3, equations.lengths[0]);
    let law = equations.material(0, sigma.into());
    let load = length * equations.gravity;
    let (value, slope): (SVector<f64, 12>, SMatrix<f64, 12, 12>) = jacobian(
        |z: SVector<_, 12>| paper(z, &rod, &law, length, load),
        &SVector::<f64, 12>::zeros(),
    );

    let mut slopes = vec![0.0; equations.state_size()];
    let mut tissue = TissueState::default();
    equations.write_slopes(sigma.into(), &y, &mut tissue, &mut slopes);
    let part = |k: usize| DVec3::new(value[3 * k], value[3 * k + 1], value[3 * k + 2]);
    let found = |k: usize| DVec3::from_slice(&slopes[k..]);
    assert!((found(0) - part(0)).length() < 1e-14);
    // q' = w q/2 for the spatial rate w.
    let rate = DQuat::from_slice(&slopes[3..]) * rod.q.conjugate();
    assert!((2.0 * DVec3::new(rate.x, rate.y, rate.z) - part(1)).length() < 1e-14);
    assert!(rate.w.abs() < 1e-14);
    assert!((found(7) - part(2)).length() < 1e-14);
    assert!((found(10) - part(3)).length() < 1e-14);

    let d = equations.derivatives(0, sigma.into(), &y, &tissue);
    let none = DMat3::ZERO;
    // Of R turned further by theta and of its rate w: theta' = dw + w x theta.
    let blocks = [
        [none, d.r_theta, d.r_n, none],
        [none, d.theta_theta, none, d.theta_m],
        [none; 4],
        [none, d.m_theta, d.m_n, none],
    ];
    let spin = cross_matrix(part(1));
    for (i, row) in blocks.iter().enumerate() {
        for (k, block) in row.iter().enumerate() {
            for c in 0..3 {
                let wanted = slope.fixed_view::<3, 1>(3 * i, 3 * k + c);
                let mut wanted = DVec3::new(wanted[0], wanted[1], wanted[2]);
                if (i, k) == (1, 1) {
                    wanted += spin.col(c);
                }
                let off = block.col(c) - wanted;
                assert!(off.length() < 1e-13, "block {i}, {k}: {off}");
            }
        }
    }
}
