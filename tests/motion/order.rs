//! Both methods are of second order in the time step and converge to the same
//! motion: of a rod and of a leaf in space, undamped and with either damping,
//! under loads and with rest shapes that change, in intervals of any lengths.
//!
//! Motions start at rest under loads that rise from zero all the time, so that
//! waves too fast for the coarsest steps are hardly there.

use leafdyn::internals::leaf::State;
use leafdyn::scenario::Tissue;
use leafdyn_testing::motion::{
    BOTH, DAMPINGS, Scheme, apart, at, curling, distance, gripped_veins, limit, method,
    moments_on_points, numbers, ramp, rest, three_veins, twisted_rod,
};
use leafdyn_testing::*;

/// How equal limits can be: internal damping also takes the fast waves, whose
/// error falls with the order but is large.
fn equal(internal: f64) -> f64 {
    if internal > 0.0 { 3e-9 } else { 3e-6 }
}

const UNTIL: f64 = 1.5;
const COARSEST: usize = 1500;

/// The order of both methods, from ever shorter steps; what they converge to
/// must have moved by at least `far` and be the same within `equal`.
fn assert_order(name: &str, scenario: &Scenario, far: f64, equal: f64) {
    let leaf = Leaf::new(scenario);
    let state = rest(scenario, 4);
    let limits = BOTH.map(|scheme| {
        let on = |times| {
            let steps = times * COARSEST;
            at(scheme, &leaf, &state, UNTIL / steps as f64, UNTIL)
        };
        let found = [1, 2, 4].map(|times| numbers(&on(times)));
        let changes = [0, 1].map(|k| distance(&found[k], &found[k + 1]));
        let order = order(changes[0], changes[1]);
        close(&format!("order of {name}, {scheme:?}"), order, 2.0, 0.1);
        limit(&found[1], &found[2])
    });
    let positions = 3 * state.x.len();
    let start: Vec<f64> = state.x.iter().flat_map(|x| x.to_array()).collect();
    let moved = apart(&start, &limits[0][..positions]);
    assert!(moved > far, "{name}: moved by {moved}");
    let between = apart(&limits[0], &limits[1]);
    assert!(between < equal, "{name}: {between:.1e} apart");
}

/// With every damping.
fn in_space(name: &str, mut scenario: Scenario, far: f64) {
    for (external, internal) in DAMPINGS {
        scenario.dynamics.external_damping = external;
        scenario.dynamics.internal_damping = internal;
        let name = format!("{name}, damping {external} {internal}");
        assert_order(&name, &scenario, far, equal(internal));
    }
}

/// A rod that is pulled.
fn pulled() -> Scenario {
    let mut rod = twisted_rod();
    rod.dynamics.tip_force = ramp(2.0, [-5.0, 10.0, 16.0]);
    rod
}

/// A rod, a leaf, and a rod with a moment on the tip and a rest shape that curls up.
#[test]
fn of_a_rod_and_a_leaf_in_space_and_a_rod_that_changes_its_rest_shape() {
    in_space("rod", pulled(), 0.4);
    let mut leaf = three_veins();
    leaf.dynamics.tip_force = ramp(2.0, [-8.0, 16.0, 26.0]);
    leaf.dynamics.gravity = ramp(2.0, [0.7, -0.7, -1.3]);
    in_space("leaf", leaf, 0.6);
    let mut rod = twisted_rod();
    rod.dynamics.rest = curling(5.0);
    rod.dynamics.tip_moment = ramp(2.0, [0.7, -0.8, 0.9]);
    rod.dynamics.external_damping = 1.5;
    rod.dynamics.internal_damping = 0.01;
    assert_order("changing rod", &rod, 0.7, equal(0.01));
}

/// With moments on points that act all the time.
#[test]
fn of_a_rod_under_moments_on_points() {
    let mut rod = moments_on_points();
    rod.dynamics.tip_force = ramp(2.0, [-5.0, 10.0, 16.0]);
    in_space("rod under moments", rod, 0.3);
}

/// With grips along veins that are tied by coupling and tissue.
#[test]
fn of_a_leaf_in_grips() {
    let mut leaf = gripped_veins();
    leaf.dynamics.tip_force = ramp(2.0, [-8.0, 16.0, 26.0]);
    leaf.dynamics.gravity = ramp(2.0, [0.7, -0.7, -1.3]);
    assert_order("gripped leaf", &leaf, 0.05, equal(0.0));
}

/// With tissue between veins that begin apart, and loads of single ones.
#[test]
fn of_a_leaf_with_tissue() {
    let mut leaf = three_veins();
    leaf.dynamics.tip_force = ramp(2.0, [-8.0, 16.0, 26.0]);
    leaf.coupling = vec![[0.0; 3]; 2];
    leaf.tissue = Some(vec![
        Tissue {
            stiffness: [20.0, 40.0, 30.0].map(Profile::Constant),
            fold: Profile::Constant(0.5),
            contraction: Profile::Constant(0.05),
        };
        2
    ]);
    for (rod, y) in leaf.rods.iter_mut().zip([-0.1, 0.0, 0.1]) {
        rod.base = [0.0, y, 0.02];
        rod.elevation = y;
    }
    assert_order("tied leaf", &leaf, 0.3, equal(0.0));
}

/// Where a leaf is after intervals of very different lengths, each of which
/// has steps of its own.
fn in_intervals(scheme: Scheme, leaf: &Leaf, state: &State, h: f64) -> (Vec<f64>, f64) {
    let mut method = method(scheme, leaf, state, h);
    let golden = 0.618_033_988_749_895;
    let (mut time, mut k) = (0.0, 0.0_f64);
    while time < UNTIL {
        k += 1.0;
        let interval = 1e-3 + 0.02 * (k * golden).fract().powi(2);
        time = f64::min(time + interval, UNTIL);
        method.advance(time).unwrap();
        assert_eq!(method.time(), time);
    }
    (numbers(&method.snapshot()), method.steps() as f64)
}

/// Steps that change lose no order, and the motion they lead to is the same;
/// internal friction looks back over steps of different lengths.
#[test]
fn in_intervals_of_any_lengths() {
    let mut rod = pulled();
    rod.dynamics.external_damping = 1.0;
    rod.dynamics.internal_damping = 0.02;
    let leaf = Leaf::new(&rod);
    let state = rest(&rod, 4);
    let on = |steps: usize| {
        let h = UNTIL / steps as f64;
        numbers(&at(Scheme::Explicit, &leaf, &state, h, UNTIL))
    };
    let truth = limit(&on(10_000), &on(20_000));
    for scheme in BOTH {
        let [(coarse, few), (fine, many)] =
            [2e-3, 2.5e-4].map(|h| in_intervals(scheme, &leaf, &state, h));
        let errors = [coarse, fine].map(|found| distance(&found, &truth));
        let order = (errors[0] / errors[1]).ln() / (many / few).ln();
        close(&format!("order of {scheme:?}"), order, 2.0, 0.1);
    }
}
