//! Sections with three different moments of inertia in motion: a stiff rod on a hinge turns as Euler's top.

use glam::DQuat;
use leafdyn::internals::leaf::DiscreteLeaf;
use leafdyn::internals::motion::{Physics, Snapshot, TimeIntegrator};
use leafdyn_testing::motion::{BOTH, Scheme, discrete, explicit, method, released, twisted_rod};
use leafdyn_testing::*;

/// On a hinge at its base, without loads but for a moment on its tip, which rises and falls until t = 4/SPIN and lets it
/// turn at about the rate SPIN, mostly about the axis of its intermediate moment of inertia.
const TOP: &str = r#"
    name = "top"
    leaf = { rods = 1, length = 1.0, fan = [0.0], base_held = "pinned" }
    stiffness = { torsion = 1.0, bending_2 = 1.0, bending_3 = 1.0, axial = 100.0, shear_2 = 100.0, shear_3 = 100.0 }
    dynamics = { density = 1.0, rotary_inertia = 0.15, rotary_inertia_3 = 0.5, external_damping = 0.0 }
"#;

const SEGMENTS: usize = 3;

/// The top, which its moment lets turn at about this rate.
fn top(spin: f64) -> Scenario {
    let mut top = parse(TOP);
    let until = 4.0 / spin;
    // Half of the largest moment times the time is 0.65 times the rate about d1.
    let moment = [0.65, 0.02, 0.02].map(|part| part * spin * 2.0 / until);
    let at = vec![0.0, 0.5 * until, until];
    top.dynamics.tip_moment = Schedule::linear(at, vec![[0.0; 3], moment, [0.0; 3]]);
    top
}

/// The moments of inertia of the straight rod about its hinge.
fn principal_moments(leaf: &DiscreteLeaf, physics: &Physics) -> DVec3 {
    let node = |i: usize| {
        let (inertia, x) = (physics.inertia(leaf, 0, i), leaf.grid.sigma()[i]);
        inertia.principal + inertia.mass * DVec3::new(0.0, x * x, x * x)
    };
    (0..=leaf.segments()).map(node).sum()
}

/// The angular momentum about the hinge.
fn angular_momentum(leaf: &DiscreteLeaf, physics: &Physics, now: &Snapshot) -> DVec3 {
    let node = |i: usize| {
        let (inertia, v, q) = (
            physics.inertia(leaf, 0, i),
            &now.velocity[i],
            now.state.q[i],
        );
        let spin = q * (inertia.principal * (q.conjugate() * v.angular));
        spin + now.state.x[i].cross(inertia.mass * v.linear)
    };
    (0..=leaf.segments()).map(node).sum()
}

/// Euler's top of these moments of inertia and this angular momentum, which stays: its rotation after a time.
fn turned(start: DQuat, principal: DVec3, momentum: DVec3, time: f64) -> DQuat {
    let rate = |q: DQuat| {
        let spin = q * ((q.conjugate() * momentum) / principal);
        DQuat::from_xyzw(0.5 * spin.x, 0.5 * spin.y, 0.5 * spin.z, 0.0) * q
    };
    let (mut q, steps) = (start, 20_000);
    let h = time / f64::from(steps);
    for _ in 0..steps {
        let a = rate(q);
        let b = rate(q + a * (0.5 * h));
        let c = rate(q + b * (0.5 * h));
        let d = rate(q + c * h);
        q = (q + (a + (b + c) * 2.0 + d) * (h / 6.0)).normalize();
    }
    q
}

/// About the axis of the intermediate moment of inertia it tumbles. A rod of finite stiffness bends and twists by the square
/// of its rate of rotation, and differs by that from Euler's rigid top.
#[test]
fn a_stiff_rod_on_a_hinge_is_a_top() {
    for (scheme, step) in BOTH.into_iter().zip([0.02, 0.4]) {
        let off = [0.04, 0.02].map(|spin| {
            let scenario = top(spin);
            let leaf = Leaf::new(&scenario);
            let (grid, physics) = (discrete(&leaf, SEGMENTS), Physics::new(&leaf));
            let principal = principal_moments(&grid, &physics);
            assert!(principal.y < principal.x && principal.x < principal.z);
            let mut moving = method(scheme, &leaf, &released(&leaf, SEGMENTS), step);
            let begun = moving.advance(4.0 / spin).unwrap();
            let momentum = angular_momentum(&grid, &physics, &begun);
            let (mut off, mut tumbled) = (0.0_f64, 0.0_f64);
            for k in 1..=4 {
                let time = f64::from(k) * 5.0 / spin;
                let now = moving.advance(4.0 / spin + time).unwrap();
                let lost = angular_momentum(&grid, &physics, &now) - momentum;
                let kept = match scheme {
                    Scheme::Explicit => 1e-11,
                    Scheme::SemiImplicit => 1e-4,
                };
                assert!(
                    lost.length() < kept * momentum.length(),
                    "{scheme:?}: {lost}"
                );
                let wanted = turned(begun.state.q[0], principal, momentum, time);
                off = off.max(now.state.q[0].angle_between(wanted));
                tumbled = tumbled.max((wanted * DVec3::X).angle_between(momentum));
                let along = wanted.conjugate() * momentum;
                let kinetic = 0.5 * along.dot(along / principal);
                close(
                    "kinetic energy",
                    now.energy.kinetic / kinetic,
                    1.0,
                    4.0 * spin * spin,
                );
            }
            assert!(tumbled > 1.5, "{tumbled}");
            off
        });
        assert!(off[1] < 0.02, "{scheme:?}: {off:?}");
        close("order", order(off[0], off[1]), 2.0, 0.3);
    }
}

/// Sections that turn about d2 much faster than about d3, and the other way round: stable up to the step that is said, and
/// hardly beyond.
#[test]
fn steps_of_flat_sections_are_stable_up_to_what_is_said() {
    for inertia in [[1e-4, 0.02], [0.02, 1e-4]] {
        let mut rod = twisted_rod();
        rod.dynamics.rotary_inertia = vec![inertia.map(Profile::Constant)];
        rod.dynamics.gravity = Schedule::constant([0.0, 0.1, -0.1]);
        let leaf = Leaf::new(&rod);
        let state = released(&leaf, 5);
        let said = explicit(&leaf, &state, None).stable_step();
        let steps = |part: f64, count: f64| {
            let h = part * said.step;
            let mut moving = explicit(&leaf, &state, Some(h));
            let before = moving.snapshot().energy.balance();
            moving
                .advance(count * h)
                .map(|now| now.energy.balance() - before)
        };
        let gained = steps(0.99, 2e4).unwrap();
        assert!(gained.abs() < 1e-3, "{gained:e}");
        assert!(steps(1.5, 2e3).is_err());
    }
}
