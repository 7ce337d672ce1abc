//! The semi-implicit method takes any stiffness, infinite too, at any step:
//! far beyond what the explicit method is stable at it neither diverges nor
//! loses its order, and what it damps vanishes with the step.

use leafdyn::internals::leaf::State;
use leafdyn::internals::motion::{Snapshot, StepControl, TimeIntegrator};
use leafdyn::scenario::PolarInertia;
use leafdyn_testing::motion::{
    distance, explicit, numbers, ramp, released, rest, semi_implicit, three_veins, twisted_rod,
};
use leafdyn_testing::*;

fn stiff(mut leaf: Scenario, stiffness: f64) -> Scenario {
    for rod in &mut leaf.rods {
        rod.force_stiffness = [stiffness; 3].map(Profile::Constant);
    }
    leaf
}

/// Pulled and blown about, from rest.
fn pulled(mut leaf: Scenario) -> Scenario {
    leaf.dynamics.tip_force = ramp(4.0, [-6.0, 8.0, 10.0]);
    leaf.dynamics.gravity = ramp(4.0, [2.0, -6.0, 4.0]);
    leaf
}

fn moved(scenario: &Scenario, state: &State, steps: StepControl, until: f64) -> (Snapshot, usize) {
    let leaf = Leaf::new(scenario);
    let mut method = semi_implicit(&leaf, state, steps);
    if let Err(broken) = method.advance(until) {
        panic!("{steps:?}: {broken:?}");
    }
    (method.snapshot(), method.steps())
}

/// The largest distance between positions.
fn apart(a: &State, b: &State) -> f64 {
    largest(a.x.iter().zip(&b.x).map(|(a, b)| a.distance(*b)))
}

/// As rods get stiffer their motion becomes that of rigid ones, by as much as
/// they are stiffer, at one and the same step.
#[test]
fn stiffer_and_stiffer_is_rigid_in_the_end() {
    for leaf in [pulled(twisted_rod()), pulled(three_veins())] {
        let of = |stiffness: f64| {
            let leaf = stiff(leaf.clone(), stiffness);
            let (end, _) = moved(&leaf, &rest(&leaf, 8), StepControl::Fixed(0.05), 2.0);
            end.state
        };
        let rigid = of(f64::INFINITY);
        let differences = [1e4, 1e6, 1e8].map(|stiffness| apart(&of(stiffness), &rigid));
        assert!(differences[0] > 1e-5, "they do differ");
        for pair in differences.windows(2) {
            let ratio = pair[1] * 100.0 / pair[0];
            assert!((ratio - 1.0).abs() < 0.1, "{differences:?}");
        }
        assert!(apart(&of(1e10), &rigid) < 1e-8);
    }
}

#[test]
fn far_beyond_the_explicit_step() {
    let scenario = stiff(pulled(three_veins()), 1e8);
    let leaf = Leaf::new(&scenario);
    let state = rest(&scenario, 8);
    let stable = explicit(&leaf, &state, None).stable_step().step;
    let on = |h: f64| numbers(&moved(&scenario, &state, StepControl::Fixed(h), 2.0).0);
    let fine = on(0.002);
    for (h, within) in [(0.25, 0.2), (0.1, 0.04), (0.02, 4e-3)] {
        let off = distance(&on(h), &fine);
        assert!(h > 100.0 * stable && off < within, "{h}: {off}");
    }
}

/// In positions and rotations; velocities of rigid rods, whose forces are not
/// smooth at first, are not looked at.
#[test]
fn of_second_order_at_any_stiffness() {
    for leaf in [pulled(twisted_rod()), pulled(three_veins())] {
        for stiffness in [1e5, 1e8, f64::INFINITY] {
            let leaf = stiff(leaf.clone(), stiffness);
            let state = rest(&leaf, 4);
            let on = |h: f64| moved(&leaf, &state, StepControl::Fixed(h), 1.0).0.state;
            let found = [0.004, 0.002, 0.001].map(|h| {
                let state = on(h);
                let q = state.q.iter().flat_map(|q| q.to_array());
                let x = state.x.iter().flat_map(|x| x.to_array());
                x.chain(q).collect::<Vec<f64>>()
            });
            let changes = [0, 1].map(|k| distance(&found[k], &found[k + 1]));
            let order = order(changes[0], changes[1]);
            close(&format!("order at {stiffness}"), order, 2.0, 0.1);
        }
    }
}

/// Energy that an undamped motion loses to the method falls with the third
/// power of the step, where steps resolve the motion.
#[test]
fn what_it_damps_vanishes_with_the_step() {
    for stiffness in [1e4, f64::INFINITY] {
        let mut rod = stiff(twisted_rod(), stiffness);
        // Sections that turn alike about all axes: of others the orders of single steps scatter more.
        rod.dynamics.rotary_inertia = vec![[0.01; 2].map(Profile::Constant)];
        rod.dynamics.polar_inertia = PolarInertia::Same;
        rod.dynamics.gravity = Schedule::constant([0.5, -1.5, 1.0]);
        let state = rest(&twisted_rod(), 4);
        let lost = [0.04, 0.02, 0.01, 0.005, 0.0025].map(|h| {
            let leaf = Leaf::new(&rod);
            let mut method = semi_implicit(&leaf, &state, StepControl::Fixed(h));
            let start = method.snapshot().energy.balance();
            method.advance(20.0).unwrap();
            method.snapshot().energy.balance() - start
        });
        let damped = lost.iter().all(|lost| *lost < 0.0);
        assert!(damped, "not fed: {lost:?}");
        assert!(lost.is_sorted(), "less with every step: {lost:?}");
        if stiffness.is_infinite() {
            // What is left of a rigid rod's motion is resolved by these steps.
            for k in [3, 4] {
                let order = order(lost[k - 1], lost[k]);
                assert!((2.5..3.2).contains(&order), "{order}");
            }
        }
    }
}

/// Rigid rods at steps of any length: the shorter, the heavier inertia is
/// beside what holds segments together.
#[test]
fn rigid_rods_at_very_short_steps() {
    let leaf = stiff(pulled(three_veins()), f64::INFINITY);
    let state = rest(&leaf, 16);
    let long = moved(&leaf, &state, StepControl::Fixed(0.01), 0.05).0.state;
    for h in [1e-3, 1e-4, 1e-5] {
        let steps = 0.05_f64.min(200.0 * h) / h;
        let (now, made) = moved(&leaf, &state, StepControl::Fixed(h), steps.round() * h);
        assert_eq!(made, steps.round() as usize, "no step fails");
        let off = apart(&now.state, &long);
        assert!(h < 1e-3 || off < 1e-5, "{h}: {off:e}");
        assert!(now.energy.kinetic < 1e-3);
    }
}

/// Let go from arcs that strain it, with steps by their error, undamped and
/// damped.
#[test]
fn let_go_with_steps_by_their_error() {
    for damping in [0.0, 7.0] {
        let mut leaf = fig04(3);
        leaf.dynamics.external_damping = damping;
        let model = Leaf::new(&leaf);
        let state = released(&model, 8);
        let (now, _) = moved(&leaf, &state, StepControl::LocalError(1e-4), 5.0);
        if damping > 0.0 {
            let rest = settle_on(&leaf, 8, false).tips[0];
            let off = now.state.tip(0).distance(rest);
            assert!(off < 1e-3, "{off}");
        }
    }
}

/// A step factorizes one matrix, which its further iterations keep, rigid rods or not.
#[test]
fn a_step_factorizes_one_matrix() {
    for stiffness in [1e3, f64::INFINITY] {
        let scenario = stiff(pulled(three_veins()), stiffness);
        let start = rest(&scenario, 8);
        let leaf = Leaf::new(&scenario);
        let mut method = semi_implicit(&leaf, &start, StepControl::LocalError(1e-6));
        method.advance(2.0).unwrap();
        let (steps, matrices) = (method.steps(), method.factorizations);
        assert!(
            steps > 20 && 4 * matrices < 5 * steps,
            "{matrices} in {steps} steps"
        );
    }
}
