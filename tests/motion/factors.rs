//! Loads on points, and weights and loads along veins, whose factor varies in time: the motion of a beam that is
//! struck in its middle, and that by the same loads as they are given otherwise.

use leafdyn::internals::motion::{Physics, Snapshot, StepControl, TimeIntegrator};
use leafdyn::scenario::{PointLoad, Sine, VaryingPointLoad};
use leafdyn_testing::motion::*;
use leafdyn_testing::{DVec3, Leaf, Scenario, Schedule, largest, settled, to};

/// A pulse of height one from time 0 to 0.2.
fn pulse() -> Schedule<f64> {
    Schedule::linear(vec![0.0, 0.1, 0.2], vec![0.0, 1.0, 0.0])
}

fn sine() -> Schedule<f64> {
    Schedule::Sine(Sine {
        mean: 0.3,
        amplitude: 0.8,
        frequency: 1.3,
        phase: 0.4,
    })
}

fn smooth() -> Schedule<f64> {
    Schedule::smooth(vec![0.05, 0.2, 0.3, 0.6], vec![0.2, 1.0, -0.5, 0.4])
}

/// Loads a point of a vein by a force and a moment with this factor.
fn loaded(
    scenario: &mut Scenario,
    (vein, at): (usize, f64),
    [force, moment]: [[f64; 3]; 2],
    factor: &Schedule<f64>,
) {
    let load = PointLoad {
        follows: false,
        vein,
        at,
        force,
        moment,
        mass: 0.0,
        offset: [0.0; 2],
        in_time: Some(Box::new(VaryingPointLoad {
            factor: factor.clone(),
            force,
            moment,
        })),
        landing: None,
    };
    scenario.points.push(load.at_time(0.0));
}

/// The response of an undamped oscillator of unit mass and frequency omega to the [`pulse`].
fn pulse_response(omega: f64, time: f64) -> f64 {
    let ramp = |from: f64| {
        let t = (time - from).max(0.0);
        (t - (omega * t).sin() / omega) / (omega * omega)
    };
    10.0 * (ramp(0.0) - 2.0 * ramp(0.1) + ramp(0.2))
}

/// Mass-normalised modes of a cantilever of unit length, stiffness and mass: the root of the frequency, and the
/// shape.
fn mode(number: usize) -> (f64, impl Fn(f64) -> f64) {
    // Higher roots are those of cos b = 0 to rounding of the response.
    let mut b = (number as f64 + 0.5) * std::f64::consts::PI;
    if number == 0 {
        b = SLENDER[0];
    }
    for _ in 0..20 {
        b -= (b.cos() + 1.0 / b.cosh()) / (-b.sin() - b.tanh() / b.cosh());
    }
    let ratio = (b.cosh() + b.cos()) / (b.sinh() + b.sin());
    (b, move |x: f64| {
        let y = b * x;
        y.cosh() - y.cos() - ratio * (y.sinh() - y.sin())
    })
}

/// A cantilever struck in its middle: the sum over its modes. Of second order in the step and in the segments,
/// by the extrapolated values of both methods.
#[test]
fn a_beam_struck_in_its_middle_moves_in_its_modes() {
    let mut rod = beam(1e-7, [1e6; 2]);
    loaded(&mut rod, (0, 0.5), [[0.0, 0.0, 1e-2], [0.0; 3]], &pulse());
    let leaf = Leaf::new(&rod);
    let exact = |time: f64| {
        let part = |number: usize| {
            let (b, shape) = mode(number);
            shape(0.5) * shape(1.0) * pulse_response(b * b, time)
        };
        1e-2 * (0..10).map(part).sum::<f64>()
    };
    let largest_tip = largest((1..20).map(|k| exact(0.1 * f64::from(k)).abs()));
    for time in [0.15, 0.6, 1.7] {
        let on = |segments: usize, h: f64| {
            at(
                Scheme::SemiImplicit,
                &leaf,
                &released(&leaf, segments),
                h,
                time,
            )
            .state
            .tip(0)
            .z
        };
        let off = |found: f64| (found - exact(time)).abs() / largest_tip;
        let (long, short) = (on(32, 4e-3), on(32, 2e-3));
        let coarse = on(16, 2e-3);
        let found = short + (short - long) / 3.0 + (short - coarse) / 3.0;
        assert!(off(short) < 5e-3, "{time}: {:e}", off(short));
        assert!(
            off(found) < 5e-4,
            "{time}: {:e} {:e}",
            off(found),
            off(short)
        );
    }
}

/// Asserts that two scenarios move alike, with the same energies.
#[track_caller]
fn assert_same_motion(one: &Scenario, other: &Scenario, segments: usize) {
    for scheme in BOTH {
        let found = [one, other].map(|scenario| {
            let leaf = Leaf::new(scenario);
            let start = released(&leaf, segments);
            [0.13, 0.5].map(|until| at(scheme, &leaf, &start, 2e-3, until))
        });
        let [one, other] = &found;
        for (a, b) in one.iter().zip(other) {
            let off = apart(&numbers(a), &numbers(b));
            assert!(off < 1e-9, "{scheme:?}: {off:e}");
            let energies = |of: &Snapshot| {
                let it = of.energy;
                [it.kinetic, it.elastic, it.potential, it.dissipated, it.work]
            };
            let off = apart(&energies(a), &energies(b));
            assert!(off < 1e-9, "{scheme:?}: {:?} {:?}", a.energy, b.energy);
        }
    }
}

/// A force and a moment on the point at the tip are those on the tip.
#[test]
fn a_point_at_the_tip_is_loaded_as_the_tip_is() {
    let [force, moment] = [[0.02, -0.1, 0.3], [0.1, -0.2, 0.3]];
    for factor in [pulse(), sine(), smooth()] {
        let [mut one, mut other] = [twisted_rod(), twisted_rod()];
        one.dynamics.internal_damping = 0.01;
        other.dynamics.internal_damping = 0.01;
        loaded(&mut one, (0, 1.0), [force, moment], &factor);
        other.dynamics.tip_force = factor.times(force);
        other.dynamics.tip_moment = factor.times(moment);
        assert_same_motion(&one, &other, 8);
    }
}

/// A force on the end of any vein is one on the tip that all share.
#[test]
fn a_point_at_a_joint_tip_is_that_tip() {
    let force = [0.3, -0.5, 0.7];
    let [mut one, mut other] = [three_veins(), three_veins()];
    loaded(&mut one, (1, 1.0), [force, [0.0; 3]], &sine());
    other.dynamics.tip_force = sine().times(force);
    assert_same_motion(&one, &other, 8);
}

const VEINS: &str = r#"
    name = "veins"
    leaf = { rods = 2, length = [1.0, 0.9], fan = "symmetric" }
    stiffness = { torsion = 0.8, bending_2 = 1.0, bending_3 = 1.2, axial = 90.0, shear_2 = 60.0, shear_3 = 40.0 }
    coupling = { x = 1.0, y = 2.0, z = 1.5 }
    dynamics = { density = 1.0, external_damping = 0.3 }
"#;

/// The two veins with these loads on points, `load.point` in brackets, and entries parted by semicolons.
fn veins(points: &str, sets: &str) -> Scenario {
    let text = format!("{VEINS}\nload = {{ point = [{points}] }}");
    let sets: Vec<String> = sets.split("; ").map(String::from).collect();
    Scenario::from_toml_with(&text, "veins", &sets).unwrap()
}

const FACTOR: &str = "load.factor={ at = [0.0, 0.1, 0.4], factor = [0.2, 1.5, -0.5] }";

/// Weights, by force, by mass and of a vein's own, and loads along veins have the factor of all loads.
#[test]
fn a_factor_of_all_loads_is_gravity_in_time() {
    let gravity = "dynamics.gravity={ at = [0.0, 0.1, 0.4], \
                   value = [[0.06, 0.0, -0.14], [0.45, 0.0, -1.05], [-0.15, 0.0, 0.35]] }";
    let reference = veins("", gravity);
    for loads in [
        "load.gravity=[0.3,0,-0.7]",
        "load.g=[0.3,0,-0.7]",
        "load.distributed=[0.3,0,-0.7]",
        "load.gravity=[[0.3,0,-0.5],[0.3,0,-0.7]]; load.distributed=[[0,0,-0.2],[0,0,0]]",
    ] {
        assert_same_motion(&veins("", &format!("{loads}; {FACTOR}")), &reference, 8);
    }
}

/// The weight of a point's mass has the factor of all loads, and a force on the point has not.
#[test]
fn a_factor_of_all_loads_is_one_of_weights_of_points() {
    let loads = format!("load.g=[0.3,0,-0.7]; {FACTOR}");
    let heavy = veins(
        "{ vein = 1, at = 0.5, mass = 0.3, force = [0, 0.2, 0] }",
        &loads,
    );
    let light = veins("", &loads);
    let force = |scenario: &Scenario, time: f64| {
        let leaf = Leaf::new(scenario);
        let (mut grid, physics) = (discrete(&leaf, 8), Physics::new(&leaf));
        physics.apply_loads(&mut grid, time / physics.time_unit);
        leaf.scale.force() * grid.load(&grid.stress_free_state(), 0, 4).force
    };
    for (time, factor) in [(0.0, 0.2), (0.1, 1.5), (0.3, 1.0 / 6.0)] {
        let found = force(&heavy, time) - force(&light, time);
        let exact = DVec3::new(0.09 * factor, 0.2, -0.21 * factor);
        assert!(found.distance(exact) < 1e-12, "{time}: {found}");
    }
}

/// At rest, and in modes, loads have their factors at time 0.
#[test]
fn at_rest_loads_are_those_of_time_zero() {
    let varying = veins(
        "{ vein = 2, at = 0.5, mass = 0.1, force = [0, 0, 2], factor = { at = [-1, 1], value = [0, 1] } }",
        "load.gravity=[0,0,-1]; load.g=[0,0.2,0]; load.distributed=[0.4,0,0]; \
         load.factor={mean=0.5,amplitude=1.0,frequency=2.0}",
    );
    let constant = veins(
        "{ vein = 2, at = 0.5, mass = 0.1, force = [0, 0, 1] }",
        "load.gravity=[0,0,-0.5]; load.g=[0,0.1,0]; load.distributed=[0.2,0,0]",
    );
    let rest = |scenario: &Scenario| leafdyn_testing::tip(&settled(scenario, &to(1e-9)));
    let [one, other] = [&varying, &constant].map(rest);
    assert!(one.distance(other) < 1e-13, "{one} {other}");
    let again = Scenario::from_toml(&serde_json::to_string(&varying).unwrap()).unwrap();
    assert_eq!(again, varying);
    // Where loads begin with nothing, the leaf is at rest in its natural shape.
    let unloaded = veins(
        "",
        "load.gravity=[0,0,-1]; load.factor={at=[0,1],factor=[0,1]}",
    );
    assert_eq!(rest(&unloaded), rest(&veins("", "load.gravity=[0,0,0]")));
}

/// What makes no sense is refused, with what would.
#[test]
fn factors_that_make_no_sense_are_refused() {
    for (sets, why) in [
        (
            "load.factor={at=[0],factor=[1]}; dynamics.gravity={at=[0],value=[[0,0,-1]]}",
            "leave one of them out",
        ),
        ("load.factor=2", "a factor in time is"),
        (
            "load.factor={at=[0],factor=[1e9]}",
            "loads are multiplied by it",
        ),
        (
            "load.point[0].factor={at=[0],factor=[1e9]}",
            "loads are multiplied by it",
        ),
        (
            "load.point[0].factor={amplitude=1,frequency=1e9}",
            "a lower frequency or a shorter duration",
        ),
    ] {
        let text = format!("{VEINS}\nload = {{ point = [{{ vein = 1, at = 0.5 }}] }}");
        let sets: Vec<String> = sets.split("; ").map(String::from).collect();
        let refused = Scenario::from_toml_with(&text, "veins", &sets)
            .unwrap_err()
            .to_string();
        assert!(refused.contains(why), "{sets:?}: {refused}");
    }
}

/// The momentum of a free rod is the integral of the force, by the explicit method.
#[test]
fn a_free_rod_has_the_momentum_of_forces_on_points() {
    let mut rod = twisted_rod();
    rod.dynamics.clamped = false;
    let force = [0.02, -0.1, 0.05];
    loaded(&mut rod, (0, 0.5), [force, [0.0; 3]], &pulse());
    let leaf = Leaf::new(&rod);
    let (grid, physics) = (discrete(&leaf, 4), Physics::new(&leaf));
    let snapshot = at(Scheme::Explicit, &leaf, &released(&leaf, 4), 7e-3, 0.31);
    let nodes = grid.rod_index_pairs(0..=4);
    let masses = nodes.map(|(j, i)| physics.inertia(&grid, j, i).mass);
    let sum: DVec3 = masses
        .zip(&snapshot.velocity)
        .map(|(mass, v)| mass * v.linear)
        .sum();
    let gained = sum * leaf.scale.force() * physics.time_unit;
    let off = gained.distance(0.1 * DVec3::from_array(force));
    assert!(off < 1e-12, "{off:e}");
}

/// The work of forces and moments on points is in the balance of the energy, of second order in the step.
#[test]
fn the_work_of_loads_on_points_is_accounted_for() {
    for scheme in BOTH {
        let imbalance = |h: f64| {
            let mut rod = twisted_rod();
            loaded(
                &mut rod,
                (0, 0.5),
                [[0.3, -0.5, 0.9], [0.1, 0.2, -0.2]],
                &sine(),
            );
            loaded(&mut rod, (0, 0.75), [[0.0, 0.4, 0.0], [0.0; 3]], &smooth());
            let leaf = Leaf::new(&rod);
            energy_imbalance(scheme, &leaf, &released(&leaf, 4), h, (40, 0.05))
        };
        let [long, short] = [4e-3, 2e-3].map(imbalance);
        assert!(
            short < 0.35 * long && short < 1e-3,
            "{scheme:?}: {long:e} {short:e}"
        );
    }
}

/// Steps that error control makes see a pulse on a point that is far shorter than they are.
#[test]
fn no_pulse_on_a_point_is_overlooked() {
    let mut rod = beam(1e-2, [300.0; 2]);
    let short = Schedule::linear(vec![0.3, 0.3001, 0.3002], vec![0.0, 1e4, 0.0]);
    loaded(&mut rod, (0, 0.5), [[0.0, 0.0, 0.1], [0.0; 3]], &short);
    let leaf = Leaf::new(&rod);
    let start = released(&leaf, 8);
    let mut found = semi_implicit(&leaf, &start, StepControl::LocalError(1e-7));
    let implicit = found.advance(1.0).unwrap().state.tip(0).z;
    let explicit = at(Scheme::Explicit, &leaf, &start, 5e-4, 1.0)
        .state
        .tip(0)
        .z;
    assert!(
        explicit.abs() > 1e-2 && (explicit - implicit).abs() < 1e-3 * explicit.abs(),
        "{explicit} {implicit}"
    );
}
