//! Energy is accounted for: without damping the explicit method keeps it over
//! a million steps, and of what loads, rest shapes and damping put in and take
//! out the books are of second order in the time step, for both methods.

use leafdyn::internals::leaf::State;
use leafdyn::internals::motion::Energy;
use leafdyn::scenario::Dynamics;
use leafdyn_testing::motion::*;
use leafdyn_testing::*;

/// Energies at the start and at so many instants until `until`.
fn energies(
    scheme: Scheme,
    leaf: &Leaf,
    state: &State,
    (h, until): (f64, f64),
    count: usize,
) -> Vec<Energy> {
    let mut method = method(scheme, leaf, state, h);
    let mut at = |k: usize| {
        method.advance(until * k as f64 / count as f64).unwrap();
        method.snapshot().energy
    };
    (0..=count).map(&mut at).collect()
}

fn balances(energies: &[Energy]) -> Vec<f64> {
    energies.iter().map(Energy::balance).collect()
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

/// Largest distance from the first.
fn deviation(values: &[f64]) -> f64 {
    largest(values.iter().map(|value| (value - values[0]).abs()))
}

/// Drift of the balance over so many steps of a rod that is let go under loads
/// and thrown about: its largest deviation, and the change of its mean from
/// the first tenth to the last, both over the largest kinetic energy.
fn drift(loads: f64, steps: f64) -> (f64, f64) {
    let mut rod = twisted_rod();
    rod.dynamics.gravity = Schedule::constant([-loads, 2.0 * loads, -3.0 * loads]);
    rod.dynamics.tip_force = Schedule::constant([-2.0 * loads, loads, 3.0 * loads]);
    let leaf = Leaf::new(&rod);
    let state = released(&leaf, 8);
    let h = explicit(&leaf, &state, None).longest_step();
    let all = energies(Scheme::Explicit, &leaf, &state, (h, steps * h), 4000);
    let most = largest(all.iter().map(|e| e.kinetic));
    let balance = balances(&all);
    let [first, last] = [&balance[..400], &balance[3601..]].map(mean);
    (deviation(&balance) / most, (last - first) / most)
}

/// At nine tenths of the stable step.
#[test]
fn a_million_steps_without_drift() {
    let (deviation, drift) = drift(0.4, 1e6);
    assert!(deviation < 5e-3 && drift.abs() < 1e-4);
}

/// Where energy goes over from slow motions to the fastest waves the balance
/// falls: what the method keeps is E (1 + (h omega)^2/24) of a wave of
/// frequency omega, at most 1.14 E, and not E. It does not rise.
#[test]
fn a_wild_motion_gains_nothing() {
    let (deviation, drift) = drift(1.0, 2e5);
    assert!(deviation < 0.15 && drift < 1e-3);
}

/// The largest deviation of the balance falls with the square of the step.
fn assert_second_order(name: &str, scenario: &Scenario) {
    for scheme in BOTH {
        assert_order_on(name, scenario, scheme, 4, (1e-3, 1.5));
    }
}

/// The same on a grid of `segments`, for steps of `h` and half of that.
fn assert_order_on(
    name: &str,
    scenario: &Scenario,
    scheme: Scheme,
    segments: usize,
    (h, until): (f64, f64),
) {
    let leaf = Leaf::new(scenario);
    let state = rest(scenario, segments);
    let deviations = [h, 0.5 * h].map(|h| {
        let all = energies(scheme, &leaf, &state, (h, until), 50);
        deviation(&balances(&all))
    });
    let order = order(deviations[0], deviations[1]);
    close(&format!("order of {name}, {scheme:?}"), order, 2.0, 0.05);
}

/// Forces that change, at least from zero.
fn shaken(mut scenario: Scenario, (external, internal): (f64, f64)) -> Scenario {
    let dynamics = &mut scenario.dynamics;
    dynamics.tip_force = ramp(2.0, [-4.0, 8.0, 10.0]);
    dynamics.gravity = ramp(2.0, [1.0, -3.0, 2.0]);
    dynamics.external_damping = external;
    dynamics.internal_damping = internal;
    scenario
}

/// With every damping.
fn when_shaken(name: &str, leaf: Scenario, change: impl Fn(&mut Dynamics)) {
    for damping in DAMPINGS {
        let mut leaf = shaken(leaf.clone(), damping);
        change(&mut leaf.dynamics);
        assert_second_order(&format!("{name} {damping:?}"), &leaf);
    }
}

/// A rod and a leaf; a rod that curls and is twisted; and one that rests in half its own
/// curvature under a moment, for which no potential exists, before it is shaken.
#[test]
fn of_what_is_shaken() {
    when_shaken("rod", twisted_rod(), |_| {});
    when_shaken("leaf", three_veins(), |_| {});
    when_shaken("curling rod", twisted_rod(), |dynamics| {
        dynamics.rest = curling(4.0);
        dynamics.tip_moment = ramp(2.0, [0.7, -0.8, 0.9]);
    });
    when_shaken("rod under a moment", twisted_rod(), |dynamics| {
        dynamics.rest = Schedule::constant(0.5);
        dynamics.tip_moment = Schedule::constant([0.7, -0.8, 0.9]);
    });
}

/// Moments on points, inside the rod and on its tip, besides one that changes.
#[test]
fn of_a_rod_under_moments_on_points() {
    when_shaken("rod under moments", moments_on_points(), |dynamics| {
        dynamics.tip_moment = ramp(2.0, [0.7, -0.8, 0.9]);
    });
}

/// Holders that stay where they are do no work.
#[test]
fn of_a_leaf_in_grips() {
    for damping in DAMPINGS {
        let leaf = shaken(gripped_veins(), damping);
        let name = format!("gripped leaf {damping:?}");
        for scheme in BOTH {
            assert_order_on(&name, &leaf, scheme, 4, (5e-4, 1.5));
        }
    }
}

/// The explicit method goes along a rod in blocks of nodes: nothing is lost or
/// counted twice between them.
#[test]
fn of_a_long_row_of_segments() {
    let mut rod = shaken(twisted_rod(), (1.5, 1e-4));
    rod.dynamics.rest = curling(4.0);
    assert_order_on("300 segments", &rod, Scheme::Explicit, 300, (5e-5, 0.2));
}

/// A rod in its rest shape has no energy, whatever the factor of its
/// curvature; a rod that rests gains none before anything happens to it.
#[test]
fn nothing_comes_from_nothing() {
    let mut rod = twisted_rod();
    rod.dynamics.rest = Schedule::constant(0.5);
    let leaf = Leaf::new(&rod);
    let state = rest(&rod, 8);
    for scheme in BOTH {
        for energy in energies(scheme, &leaf, &state, (2e-3, 1.0), 20) {
            let all = [energy.kinetic, energy.elastic, energy.balance()];
            let nothing = all.iter().all(|e| e.abs() < 1e-20);
            assert!(nothing, "{scheme:?}: {energy:?}");
        }
    }
}
