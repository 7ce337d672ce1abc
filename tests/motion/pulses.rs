//! Pulses of loads and rest curvatures, however much shorter than a step, have their impulse
//! and their work by both methods.

use leafdyn::internals::motion::{Physics, Snapshot, StepControl, TimeIntegrator};
use leafdyn_testing::motion::*;
use leafdyn_testing::{DVec3, Leaf, Schedule, table};

/// A pulse that rises from nothing at time `at`, to a peak after a quarter of its `width`.
fn pulse(at: f64, width: f64, impulse: [f64; 3]) -> Schedule<[f64; 3]> {
    Schedule::linear(
        vec![at, at + 0.25 * width, at + width],
        vec![[0.0; 3], impulse.map(|part| 2.0 * part / width), [0.0; 3]],
    )
}

fn momentum(leaf: &Leaf, segments: usize, snapshot: &Snapshot) -> DVec3 {
    let (physics, grid) = (Physics::new(leaf), discrete(leaf, segments));
    let nodes = grid.rod_index_pairs(0..=segments);
    let masses = nodes.map(|(j, i)| physics.inertia(&grid, j, i).mass);
    let momenta = masses.zip(&snapshot.velocity);
    let sum: DVec3 = momenta.map(|(mass, v)| mass * v.linear).sum();
    sum * leaf.scale.force() * physics.time_unit
}

const IMPULSE: [f64; 3] = [0.02, -0.1, 0.05];

/// Within a step, over the end of one, over the middle of one, and over two and a half.
#[test]
fn a_free_rod_has_the_momentum_of_the_pulse() {
    for [at, width] in table("0.1 1e-5\n 0.49999 2e-5\n 0.5049999 3e-7\n 0.51 0.025") {
        for gravity in [true, false] {
            let mut rod = twisted_rod();
            rod.dynamics.clamped = false;
            let load = pulse(at, width, IMPULSE);
            match gravity {
                true => rod.dynamics.gravity = load,
                false => rod.dynamics.tip_force = load,
            }
            let leaf = Leaf::new(&rod);
            let state = released(&leaf, 2);
            let off = |until: f64| {
                let mut found = method(Scheme::Explicit, &leaf, &state, 0.01);
                found.advance(until).unwrap();
                let gained = momentum(&leaf, 2, &found.snapshot());
                (gained - DVec3::from_array(IMPULSE)).length()
            };
            for until in [at + width, 0.6] {
                assert!(off(until) < 1e-7, "{at} {width}: {}", off(until));
            }
        }
    }
}

/// Of the semi-implicit method, before the clamped base takes any of it, whatever steps
/// came before.
#[test]
fn a_clamped_rod_has_it_as_well() {
    for width in [8e-6, 1e-5, 1e-4] {
        let mut rod = twisted_rod();
        rod.dynamics.tip_force = pulse(0.1, width, IMPULSE);
        let leaf = Leaf::new(&rod);
        for steps in [StepControl::LocalError(1e-6), StepControl::Fixed(0.01)] {
            let mut found = semi_implicit(&leaf, &released(&leaf, 8), steps);
            found.advance(0.1 + width).unwrap();
            let gained = momentum(&leaf, 8, &found.snapshot());
            let off = (gained - DVec3::from_array(IMPULSE)).length();
            assert!(off < 1e-3 * gained.length(), "{width} {steps:?}: {off}");
        }
    }
}

/// Work, balance and tip after pulses of all kinds, in steps that are
/// too long for them and in steps that resolve them.
#[test]
fn short_and_long_steps_agree() {
    let width = 4e-4;
    let mut loaded = [three_veins(), twisted_rod(), twisted_rod(), twisted_rod()];
    loaded[0].dynamics.gravity = pulse(0.1007, width, [0.1, -0.3, 0.4]);
    loaded[1].dynamics.tip_force = pulse(0.1007, width, [0.02, -0.03, 0.03]);
    loaded[2].dynamics.tip_moment = pulse(0.1007, width, [0.001, -0.002, 0.003]);
    loaded[3].dynamics.rest = Schedule::linear(vec![0.1007, 0.1008, 0.1011], vec![1.0, 60.0, 1.0]);
    for scenario in loaded {
        // Impulses of rest curvatures are exact by the explicit method only.
        let fixed = match scenario.dynamics.rest.is_constant() {
            true => 2e-3,
            false => 1e-4,
        };
        let leaf = Leaf::new(&scenario);
        let state = rest(&scenario, 4);
        let after = |mut method: Box<dyn TimeIntegrator>| {
            let start = method.snapshot().energy.balance();
            method.advance(0.4).unwrap();
            let now = method.snapshot();
            (tip(&now), now.energy.work, now.energy.balance() - start)
        };
        let fine = after(method(Scheme::Explicit, &leaf, &state, 1e-5));
        let longest = explicit(&leaf, &state, None).longest_step();
        let coarse = [
            method(Scheme::Explicit, &leaf, &state, 0.5 * longest),
            method(Scheme::SemiImplicit, &leaf, &state, fixed),
            Box::new(semi_implicit(&leaf, &state, StepControl::LocalError(1e-6))),
        ];
        assert!(longest > 10.0 * width, "{longest}");
        assert!(fine.1 > 1e-4, "{}", fine.1);
        for (k, method) in coarse.into_iter().enumerate() {
            let found = after(method);
            let off = (found.0 - fine.0).length();
            let ([work, right], balance) = ([found.1, fine.1], found.2);
            assert!(off < 5e-3, "{k}: {off}");
            assert!((work / right - 1.0).abs() < 0.03, "{k}: {work} {right}");
            assert!(balance.abs() < 0.1 * right, "{k}: {balance}");
        }
    }
}

/// A jump within nearly nothing takes the time of the shortest step: its leaf moves as under one
/// of that length. A pulse as short is refused.
#[test]
fn jumps_are_as_short_as_steps_can_be() {
    let mut scenario = twisted_rod();
    let force = [0.01, 0.02, -0.01];
    let jump = |width: f64| Schedule::linear(vec![0.1037, 0.1037 + width], vec![[0.0; 3], force]);
    let mut tip = |width: f64| {
        scenario.dynamics.tip_force = jump(width);
        let leaf = Leaf::new(&scenario);
        let mut found = semi_implicit(&leaf, &released(&leaf, 8), StepControl::LocalError(1e-6));
        found.advance(0.5).unwrap();
        found.snapshot().state.tip(0)
    };
    let wanted = tip(1e-5);
    for width in [1e-7, 1e-9, 3e-10] {
        assert!(tip(width).distance(wanted) < 2e-5, "{width}");
    }
    let load = pulse(0.1, 1e-9, force);
    assert!(load.pulse_within(1e-6).is_some() && jump(1e-9).pulse_within(1e-6).is_none());
}
