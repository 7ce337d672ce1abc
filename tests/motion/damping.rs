//! Small vibrations die away as fast as they should. With the rate c of
//! external damping and the retardation time eta of internal damping, a mode
//! of frequency omega is a damped oscillator,
//!
//! ```text
//! q'' + (c + eta omega^2) q' + omega^2 q = 0,
//! ```
//!
//! whatever c and eta: in external damping all velocities decay alike, and the
//! friction of a material is in proportion to its stiffness. Dead loads on a
//! straight unstressed rod change nothing.

use leafdyn::internals::leaf::State;
use leafdyn::internals::motion::Physics;
use leafdyn::internals::rotation;
use leafdyn_testing::motion::{BOTH, Scheme, explicit, method, released};
use leafdyn_testing::*;

/// Amplitude: small enough to be linear, large beside rounding.
const SIZE: f64 = 1e-6;

fn rod() -> Scenario {
    let mut rod = paper_leaf(1, [0.8, 1.1, 0.9], [90.0, 60.0, 40.0], 0.0);
    rod.dynamics.rotary_inertia = vec![[0.01; 2].map(Profile::Constant)];
    rod.dynamics.external_damping = 0.0;
    rod
}

/// An oscillator let go at 1, at a time.
fn oscillator(omega: f64, drag: f64, time: f64) -> f64 {
    let (rate, squared) = (0.5 * drag, omega * omega - 0.25 * drag * drag);
    let root = squared.abs().sqrt();
    let angle = root * time;
    let (c, s) = match squared > 0.0 {
        true => (angle.cos(), angle.sin()),
        false => (angle.cosh(), angle.sinh()),
    };
    (-rate * time).exp() * (c + rate / root * s)
}

/// Largest distance between the motion in a mode and the oscillator, over the
/// amplitude, with so many steps until `until`.
fn error(
    scheme: Scheme,
    leaf: &Leaf,
    (rest, start): (&State, &State),
    (until, steps): (f64, usize),
    expected: impl Fn(f64) -> f64,
) -> f64 {
    let h = until / steps as f64;
    let mut method = method(scheme, leaf, start, h);
    let mut worst = 0.0_f64;
    for k in 1..=50 {
        let time = until * k as f64 / 50.0;
        method.advance(time).unwrap();
        let now = method.snapshot().state;
        for k in 0..rest.x.len() {
            let moved = |state: &State| {
                let turn = rotation::log(state.q[k] * rest.q[k].conjugate());
                [state.x[k] - rest.x[k], turn]
            };
            let (now, start) = (moved(&now), moved(start));
            for c in 0..2 {
                worst = worst.max((now[c] - expected(time) * start[c]).length() / SIZE);
            }
        }
    }
    assert_eq!(method.steps(), steps);
    worst
}

/// Modes of a rod under this damping, over about three periods, converge to
/// what they should do with the square of the step.
fn assert_decays(name: &str, external: f64, internal: f64, modes: &[usize]) {
    let mut scenario = rod();
    scenario.dynamics.external_damping = external;
    scenario.dynamics.internal_damping = internal;
    let leaf = Leaf::new(&scenario);
    let rest = released(&leaf, 6);
    let physics = Physics::new(&leaf);
    let all = vibration::modes(&leaf, &rest, 21, &[]);
    let stable = explicit(&leaf, &rest, None).stable_step().step;
    for &mode in modes {
        let omega = all[mode].eigenvalue.sqrt();
        let drag = physics.damping + physics.retardation * omega * omega;
        let start = vibration::displaced(&rest, &all[mode], SIZE);
        let until = 20.0 / omega;
        for scheme in BOTH {
            let of = |steps| {
                let expected = |time| oscillator(omega, drag, time);
                error(scheme, &leaf, (&rest, &start), (until, steps), expected)
            };
            let few = match scheme {
                Scheme::Explicit => 50 * f64::max(20.0, until / stable / 25.0).ceil() as usize,
                Scheme::SemiImplicit if drag > 4.0 * omega => 2000,
                Scheme::SemiImplicit => 500,
            };
            let errors = [of(few), of(2 * few)];
            let order = order(errors[0], errors[1]);
            let ratio = drag / (2.0 * omega);
            let what = format!("{name}, {scheme:?}, mode {mode}, damping ratio {ratio:.2}");
            let what = format!("{what}: order {order:.3}, errors {errors:?}");
            // Beside nonlinear terms, an error this small has no order.
            assert!(errors[1] < 1e-3, "{what}");
            assert!((order - 2.0).abs() < 0.05 || errors[1] < 1e-6, "{what}");
        }
    }
}

#[test]
fn external_and_internal_damping_and_both() {
    for c in [0.5, 3.0, 8.0] {
        assert_decays(&format!("external {c}"), c, 0.0, &[0, 1, 4, 20]);
    }
    for eta in [1e-3, 0.02, 0.2] {
        assert_decays(&format!("internal {eta}"), 0.0, eta, &[0, 1, 4, 20]);
    }
    assert_decays("both", 1.0, 0.01, &[0, 4]);
}
