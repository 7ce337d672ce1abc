//! The paper's linear theory (section 5.1) is the limit of the full model:
//!
//! A3 Y'''' = f2 + T Y'',   A2 Z'''' = f3 + T Z''                   eqs (12) (13)
//!
//! for a single rod that neither stretches nor shears, under a small transverse
//! load f and the axial force T at its tip (Landau and Lifshitz, eqs (20.14)).

use leafdyn_testing::*;

const LENGTH: f64 = 1.5;
const A2: f64 = 0.8;
const A3: f64 = 1.3;

/// Load along y or z, tension along x.
fn solve(axis: usize, load: f64, tension: f64) -> Equilibrium {
    let mut gravity = [0.0; 3];
    gravity[axis] = load;
    pulled(gravity, [tension, 0.0, 0.0], 1e-11)
}

fn pulled(gravity: [f64; 3], tip_force: [f64; 3], tolerance: f64) -> Equilibrium {
    let scenario = rod(&format!(
        "{RIGID}; leaf.length={LENGTH:?}; stiffness.bending_2={A2:?}; stiffness.bending_3={A3:?}; \
         load.gravity={gravity:?}; load.tip_force={tip_force:?}"
    ));
    // Above its buckling load the rod has no stable equilibrium near the axis.
    kept(&scenario, tolerance)
}

/// Deflection at s: clamped at 0, without moment and transverse force at L.
fn deflection(s: f64, load: f64, tension: f64, bending: f64) -> f64 {
    let k = (tension.abs() / bending).sqrt();
    // cosh and sinh in tension, cos and sin in compression; c'' = sign k^2 c.
    let (c, d) = match tension > 0.0 {
        true => (f64::cosh as fn(f64) -> f64, f64::sinh as fn(f64) -> f64),
        false => (f64::cos as _, f64::sin as _),
    };
    let curved = -load / tension;
    let slope = load * LENGTH / tension;
    let odd = -slope / k;
    let bent = -curved / (tension.signum() * k * k);
    let even = (bent - odd * d(k * LENGTH)) / c(k * LENGTH);
    even * (c(k * s) - 1.0) + slope * s + odd * d(k * s) + 0.5 * curved * s * s
}

/// Largest distance from the linear solution over the largest deflection.
fn relative_error(axis: usize, load: f64, tension: f64) -> f64 {
    let bending = [f64::NAN, A3, A2][axis];
    let leaf = solve(axis, load, tension);
    let (mut error, mut most) = (0.0_f64, 0.0_f64);
    for (sigma, node) in leaf.shape.stations.iter().zip(&leaf.shape.rods[0].nodes) {
        let linear = deflection(sigma * LENGTH, load, tension, bending);
        error = error.max((node.position[axis] - linear).abs());
        most = most.max(linear.abs());
    }
    error / most
}

#[test]
fn the_full_model_tends_to_it_with_the_square_of_the_load() {
    for axis in [1, 2] {
        for tension in [-30.0, -6.0, -0.7, 0.5, 4.0, 40.0] {
            // What is bent less is known less well.
            let most = if tension > 10.0 { 4e-2 } else { 2e-2 };
            let errors = [1.0, 0.5, 0.25].map(|part| relative_error(axis, part * most, tension));
            assert!(errors[0] < 0.02, "{tension}: {errors:?}");
            for pair in errors.windows(2) {
                let order = order(pair[0], pair[1]);
                assert!((order - 2.0).abs() < 0.05, "{axis}, {tension}: {errors:?}");
            }
        }
    }
}

#[test]
fn its_wavenumber_is_the_one_that_is_reported() {
    for tension in [-30.0, -6.0, 4.0] {
        let leaf = solve(2, 1e-2, tension);
        let vein = leaf.undulation.veins[0];
        assert!((vein.tension / tension - 1.0).abs() < 1e-3, "{vein:?}");
        let number = tension.abs() * LENGTH * LENGTH / A2;
        assert!((vein.load_number / number - 1.0).abs() < 1e-3);
        let waves = match tension < 0.0 {
            true => number.sqrt() / (2.0 * PI),
            false => 0.0,
        };
        assert!((vein.predicted_waves() - waves).abs() < 1e-3);
    }
}

/// A column far above its buckling load, kept near its axis, waves as often as
/// linear theory says.
#[test]
fn a_compressed_rod_waves_as_predicted() {
    for tension in [-60.0, -140.0, -260.0] {
        let leaf = pulled([0.0; 3], [tension, 0.0, 0.1 * tension], 1e-7);
        let vein = leaf.undulation.veins[0];
        let apart = vein.waves() - vein.predicted_waves();
        assert!(apart.abs() <= 0.5, "{tension}: {vein:?}");
        assert!(vein.waves() >= 1.0, "{tension}: {vein:?}");
    }
}
