//! Grips that move in time and hold their nodes along some axes only, or by springs: against the transfer function of a
//! beam on a moved roller, both methods alike, with their energies.

use crate::driven::Complex;
use leafdyn_testing::motion::*;
use leafdyn_testing::{Leaf, PI, Scenario, close, largest, order, parse};

/// Where the roller is.
const AT: f64 = 0.5;

fn real(value: f64) -> Complex {
    Complex(value, 0.0)
}

/// cosh, sinh, cos and sin of a complex number.
fn functions(of: Complex) -> [Complex; 4] {
    let [up, down] = [of.exp(), (-of).exp()];
    let turned = Complex(-of.1, of.0);
    let [one, other] = [turned.exp(), (-turned).exp()];
    let half = real(0.5);
    [
        half * (up + down),
        half * (up - down),
        half * (one + other),
        Complex(0.0, -0.5) * (one - other),
    ]
}

/// The solution of linear equations, by elimination with pivots.
fn solve<const N: usize>(mut rows: [[Complex; N]; N], mut right: [Complex; N]) -> [Complex; N] {
    let size = |of: Complex| of.0.hypot(of.1);
    for k in 0..N {
        let pivot = (k..N).max_by(|a, b| size(rows[*a][k]).total_cmp(&size(rows[*b][k])));
        let pivot = pivot.unwrap();
        rows.swap(k, pivot);
        right.swap(k, pivot);
        for i in (0..N).filter(|i| *i != k) {
            let factor = rows[i][k] / rows[k][k];
            for c in 0..N {
                rows[i][c] = rows[i][c] - factor * rows[k][c];
            }
            right[i] = right[i] - factor * right[k];
        }
    }
    std::array::from_fn(|k| right[k] / rows[k][k])
}

/// The displacement of the tip of a cantilever of unit length, stiffness and mass, per displacement of a roller at
/// [`AT`] that oscillates with the angular frequency omega and holds the beam by a spring, damped in space:
/// w'''' = (omega^2 - i omega c) w with w(0) = w'(0) = 0, w''(1) = w'''(1) = 0, and the force K (1 - w) at the roller;
/// a rigid one has w = 1 there.
fn tip_response(omega: f64, damping: f64, spring: f64) -> Complex {
    let k = Complex(omega * omega, -omega * damping).sqrt().sqrt();
    let [ch, sh, co, si] = functions(k * real(AT));
    // w = a (cosh kx - cos kx) + b (sinh kx - sin kx) before the roller, and from the tip, with y = 1 - x,
    // w = c (cosh ky + cos ky) + d (sinh ky + sin ky).
    let [ch2, sh2, co2, si2] = functions(k * real(1.0 - AT));
    let before = [ch - co, sh - si];
    let beyond = [ch2 + co2, sh2 + si2];
    let none = real(0.0);
    let equal = [before[0], before[1], -beyond[0], -beyond[1]];
    let slopes = [sh + si, ch - co, sh2 - si2, ch2 + co2];
    let moments = [ch + co, sh + si, -(ch2 - co2), -(sh2 - si2)];
    let last = match spring.is_infinite() {
        true => [before[0], before[1], none, none],
        false => {
            // K w - w1''' - w2''' = K, divided by K.
            let cubed = k * k * k / real(spring);
            let shears = [sh - si, ch + co, sh2 + si2, ch2 - co2].map(|it| cubed * it);
            [
                before[0] - shears[0],
                before[1] - shears[1],
                -shears[2],
                -shears[3],
            ]
        }
    };
    let right = [none, none, none, real(1.0)];
    let [_, _, c, _] = solve([equal, slopes, moments, last], right);
    // At y = 0.
    c * real(2.0)
}

/// Slowly, the tip goes along as that of a beam whose middle is moved by one: by 5/2; a weak spring moves it by a
/// force, w(1) = 5 F/48 and w(1/2) = F/24.
#[test]
fn the_transfer_function_of_a_roller_has_its_limits() {
    let still = tip_response(1e-3, 1e-3, f64::INFINITY);
    assert!(
        (still.0 - 2.5).abs() < 1e-6 && still.1.abs() < 1e-6,
        "{still:?}"
    );
    for spring in [0.1, 30.0] {
        let still = tip_response(1e-3, 1e-3, spring);
        let force = spring / (1.0 + spring / 24.0);
        assert!((still.0 - 5.0 * force / 48.0).abs() < 1e-6, "{still:?}");
    }
}

/// A beam on a roller that moves up and down from time 0 on.
fn on_roller(frequency: f64, spring: &str) -> Scenario {
    parse(&format!(
        r#"
        name = "beam"
        leaf = {{ rods = 1, length = 1.0, fan = [0.0] }}
        stiffness = {{ torsion = 1.0, bending_2 = 1.0, bending_3 = 1.0, axial = 1e6, shear_2 = 1e6, shear_3 = 1e6 }}
        dynamics = {{ density = 1.0, rotary_inertia = 1e-7, external_damping = 2.0, duration = 40.0 }}
        grip = [{{ vein = 1, at = {AT}, stiffness = [0.0, inf, {spring}], move = {{ amplitude = [0.0, 0.0, 1e-3], frequency = {frequency:?} }} }}]
        "#
    ))
}

/// Amplitude and phase of the tip, of second order in step and segments, and extrapolated exact.
#[test]
fn a_moved_roller_moves_the_tip_as_its_transfer_function_says() {
    for (spring, word) in [(f64::INFINITY, "inf"), (20.0, "20.0")] {
        for frequency in [0.3, 0.9, 1.9] {
            let rod = on_roller(frequency, word);
            let leaf = Leaf::new(&rod);
            let omega = 2.0 * PI * frequency;
            let Complex(real, imaginary) = tip_response(omega, 2.0, spring);
            let amplitude = 1e-3 * real.hypot(imaginary);
            for time in [18.0, 18.37] {
                let angle = omega * time;
                let exact = 1e-3 * (real * angle.sin() + imaginary * angle.cos());
                let on = |segments: usize, h: f64| {
                    let start = released(&leaf, segments);
                    at(Scheme::SemiImplicit, &leaf, &start, h, time)
                        .state
                        .tip(0)
                        .z
                };
                let off = |found: f64| (found - exact).abs() / amplitude;
                let (long, short, coarse) = (on(32, 0.01), on(32, 0.005), on(16, 0.005));
                let found = short + (short - long) / 3.0 + (short - coarse) / 3.0;
                assert!(off(short) < 0.02, "{word} {frequency}: {:e}", off(short));
                assert!(off(found) < 5e-4, "{word} {frequency}: {:e}", off(found));
            }
        }
    }
}

/// Veins in grips that move in time, slide and give, on a foundation.
const VEINS: &str = r#"
    name = "veins"
    leaf = { rods = 2, length = [1.0, 0.9], fan = "symmetric" }
    stiffness = { torsion = 0.8, bending_2 = 1.0, bending_3 = 1.2, axial = 90.0, shear_2 = 60.0, shear_3 = 40.0 }
    coupling = { x = 1.0, y = 2.0, z = 1.5 }
    load.gravity = [0.1, 0.2, -0.8]
    foundation.stiffness = [1.0, 0.5, 2.0]
    dynamics = { density = 1.0, rotary_inertia = 0.01, external_damping = DAMPING }
    [[grip]]
    vein = 1
    at = [0.25, 0.5]
    stiffness = [0.0, inf, 8.0]
    move = { at = [0.0, 0.3, 0.5, 0.8], value = [[0.0, 0.0, 0.0], [0.05, -0.1, 0.15], [0.1, 0.05, -0.05], [0.0, 0.1, 0.05]], smooth = true }
    [[grip]]
    vein = 2
    at = 0.75
    held = "clamped"
    stiffness = [6.0, 0.0, inf]
    turn_stiffness = 2.0
    move = { at = [0.0, 0.4, 0.8], value = [[0.0, 0.0, 0.0], [0.1, 0.2, -0.1], [0.0, 0.0, 0.1]], smooth = true }
"#;

fn veins(damping: f64) -> Scenario {
    parse(&VEINS.replace("DAMPING", &format!("{damping:?}")))
}

/// Both methods are of second order, and lead to the same motion; held axes are where the grip is.
#[test]
fn both_methods_tell_the_same_motion() {
    let scenario = veins(0.7);
    let leaf = Leaf::new(&scenario);
    let start = rest(&scenario, 8);
    let natural = discrete(&leaf, 8).stress_free_state();
    let moves = &scenario.support_motion.as_ref().unwrap().grips;
    let length = leaf.scale.length;
    let positions = |scheme: Scheme, h: f64| -> Vec<f64> {
        let state = at(scheme, &leaf, &start, h, 0.7).state;
        let until = 0.7 * leafdyn::internals::motion::Physics::new(&leaf).time_unit;
        for (vein, node, grip, axis) in [(0, 2, 0, 1), (0, 4, 0, 1), (1, 6, 1, 2)] {
            let k = state.base(vein) + node;
            let held = natural.x[k][axis] + moves[grip].at(until)[axis] / length;
            assert!((state.x[k][axis] - held).abs() < 1e-12);
        }
        state.x.iter().flat_map(|x| x.to_array()).collect()
    };
    let mut limits = Vec::new();
    for scheme in BOTH {
        let [coarse, middle, fine] = [2e-3, 1e-3, 5e-4].map(|h| positions(scheme, h));
        let (one, two) = (apart(&coarse, &middle), apart(&middle, &fine));
        close(&format!("{scheme:?}"), order(one, two), 2.0, 0.15);
        limits.push(limit(&middle, &fine));
    }
    let off = apart(&limits[0], &limits[1]);
    assert!(off < 1e-6, "{off:e}");
}

/// The work of the grips, and what damping dissipates, are in the balance of energy, of second order in the step.
#[test]
fn their_work_is_in_the_balance_of_energy() {
    for damping in [0.0, 0.7] {
        let scenario = veins(damping);
        let leaf = Leaf::new(&scenario);
        let start = rest(&scenario, 4);
        for scheme in BOTH {
            let [long, short] =
                [2e-3, 1e-3].map(|h| energy_imbalance(scheme, &leaf, &start, h, (40, 0.02)));
            let what = format!("{scheme:?} {damping}");
            close(&what, order(long, short), 2.0, 0.25);
            assert!(short < 1e-3, "{what}: {short:e}");
        }
    }
}

/// Where a grip lets its node slide it does not move it.
#[test]
fn a_roller_that_moves_along_its_way_moves_nothing() {
    let made = |moved: &str| {
        parse(&format!(
            r#"
            name = "beam"
            leaf = {{ rods = 1, length = 1.0, fan = [0.0] }}
            stiffness = {{ torsion = 1.0, bending_2 = 1.0, bending_3 = 1.0, axial = 1e2, shear_2 = 1e2, shear_3 = 1e2 }}
            load.gravity = [0.1, 0.0, -1.0]
            dynamics = {{ density = 1.0, rotary_inertia = 0.01, external_damping = 0.5 }}
            grip = [{{ vein = 1, at = 0.5, stiffness = [0.0, inf, inf], move = {moved} }}]
            "#
        ))
    };
    // Steps end alike where both move.
    let along = made("{ amplitude = [0.1, 0.0, 0.0], frequency = 3.0 }");
    let farther = made("{ amplitude = [0.2, 0.0, 0.0], frequency = 3.0 }");
    for scheme in BOTH {
        let motions = [&along, &farther].map(|scenario| {
            let leaf = Leaf::new(scenario);
            numbers(&at(scheme, &leaf, &released(&leaf, 8), 2e-3, 0.6))
        });
        let off = apart(&motions[0], &motions[1]);
        assert!(off < 1e-10, "{scheme:?}: {off:e}");
        assert!(largest(motions[0].iter().map(|it| it.abs())) > 0.1);
    }
}
