//! Masses and forces off the axes of moving leaves.

use leafdyn::internals::motion::{Physics, Snapshot, StepControl, TimeIntegrator};
use leafdyn::scenario::{Landing, PointLoad, VaryingPointLoad};
use leafdyn::simulate::{self, ExplicitRefusal, SchemeReason, Simulation, SimulationError};
use leafdyn_testing::motion::*;
use leafdyn_testing::vibration::{displaced, modes};
use leafdyn_testing::{DVec3, Leaf, Scenario, Schedule, close, largest, order, parse};

const STEADY: Scheme = Scheme::SemiImplicit;

/// A mass on a point off the axis.
fn beside(vein: usize, at: f64, mass: f64, offset: [f64; 2]) -> PointLoad {
    PointLoad {
        vein,
        at,
        force: [0.0; 3],
        moment: [0.0; 3],
        follows: false,
        mass,
        offset,
        in_time: None,
        landing: None,
    }
}

/// Three joined veins with masses off their axes, two at the joint tip, under their weights.
fn loaded_veins() -> Scenario {
    let mut veins = three_veins();
    veins.g = [0.3, 0.2, -2.0];
    veins.points = vec![
        beside(0, 0.5, 0.4, [0.2, -0.1]),
        beside(1, 1.0, 0.3, [-0.1, 0.2]),
        beside(2, 1.0, 0.2, [0.3, 0.1]),
    ];
    veins
}

/// A rod that only twists with a mass on an arm is a pendulum on a torsion spring:
/// m o^2 p'' = -C p/L - m g o cos p, where the rod is light enough to be left out.
#[test]
fn a_mass_on_an_arm_is_a_pendulum() {
    let scenario = parse(
        r#"
        name = "arm"
        leaf = { rods = 1, length = 1.0, fan = [0.0] }
        stiffness = { torsion = 0.5, bending_2 = 1e7, bending_3 = 1e7, axial = inf, shear_2 = inf, shear_3 = inf }
        load.g = [0.0, 0.0, -3.0]
        load.point = [{ vein = 1, at = 1.0, mass = 0.8, offset = [0.5, 0.0] }]
        dynamics = { density = 1e-4, rotary_inertia = 1e-7, external_damping = 0.0 }
        "#,
    );
    let leaf = Leaf::new(&scenario);
    let unit = Physics::new(&leaf).time_unit;
    let (inertia, lever) = (0.8 * 0.25, 0.8 * 3.0 * 0.5);
    // By the classical method of Runge and Kutta.
    let twist = |until: f64| {
        let (mut p, mut v, steps) = (0.0_f64, 0.0_f64, 20_000);
        let h = until / f64::from(steps);
        let rate = |p: f64| (-0.5 * p - lever * p.cos()) / inertia;
        for _ in 0..steps {
            let (k1, l1) = (v, rate(p));
            let (k2, l2) = (v + 0.5 * h * l1, rate(p + 0.5 * h * k1));
            let (k3, l3) = (v + 0.5 * h * l2, rate(p + 0.5 * h * k2));
            let (k4, l4) = (v + h * l3, rate(p + h * k3));
            p += h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4);
            v += h / 6.0 * (l1 + 2.0 * l2 + 2.0 * l3 + l4);
        }
        p
    };
    for until in [0.4, 1.1, 2.6] {
        let at = |h: f64| {
            let start = released(&leaf, 4);
            let now = at(STEADY, &leaf, &start, h / unit, until / unit);
            leafdyn::internals::rotation::log(now.state.q[4]).x
        };
        let (coarse, fine) = (at(2e-3), at(1e-3));
        let found = fine + (fine - coarse) / 3.0;
        close("twist", found, twist(until), 1e-4);
    }
    assert!(twist(1.1).abs() > 0.5, "{}", twist(1.1));
}

/// Let go in the shape of a mode a leaf vibrates with its frequency, up to what the method shifts it: of second order
/// in the step.
#[test]
fn a_leaf_let_go_in_a_mode_keeps_its_frequency() {
    let size = 1e-6;
    let mut veins = loaded_veins();
    veins.dynamics.external_damping = 0.0;
    let resting = rest(&veins, 6);
    let leaf = Leaf::new(&veins);
    for (number, mode) in modes(&leaf, &resting, 4, &[]).iter().enumerate() {
        let omega = mode.eigenvalue.sqrt();
        let start = displaced(&resting, mode, size);
        let off = |h: f64| {
            let until = 5.0 / omega;
            let now = at(STEADY, &leaf, &start, h / omega, until);
            let each = now.state.x.iter().zip(&resting.x).zip(&start.x);
            let wanted = (omega * until).cos();
            largest(each.map(|((now, rest), start)| {
                ((*now - *rest) - wanted * (*start - *rest)).length() / size
            }))
        };
        let [coarse, fine] = [0.02, 0.01].map(off);
        println!("{number}: {coarse:e} {fine:e}");
        assert!(
            fine < 3e-4 && order(coarse, fine) > 1.8,
            "{number}: {coarse:e} {fine:e}"
        );
    }
}

/// Steps are of second order, with all dampings, and the energy is balanced to second order, too.
#[test]
fn steps_are_of_second_order_and_balance_the_energy() {
    for (external, internal) in DAMPINGS {
        let mut veins = loaded_veins();
        veins.dynamics.external_damping = external;
        veins.dynamics.internal_damping = internal;
        veins.dynamics.tip_force = ramp(2.0, [-8.0, 16.0, 26.0]);
        let leaf = Leaf::new(&veins);
        let start = rest(&veins, 4);
        let [a, b, c] = [1, 2, 4].map(|times| {
            let h = 1e-3 / f64::from(times);
            numbers(&at(STEADY, &leaf, &start, h, 1.0))
        });
        let order = order(distance(&a, &b), distance(&b, &c));
        close(&format!("order, {external} {internal}"), order, 2.0, 0.15);
        let off = [2e-3, 1e-3].map(|h| energy_imbalance(STEADY, &leaf, &start, h, (5, 0.2)));
        let moved = at(STEADY, &leaf, &start, 2e-3, 1.0).energy.work;
        println!("{off:?} of {moved}");
        assert!(off[1] < 2e-4 * moved.abs().max(1.0), "{off:?} of {moved}");
    }
}

/// Nothing turns a leaf that hangs on a hinge about the line of its weight: the moment of momentum about it is kept.
#[test]
fn a_leaf_on_a_hinge_keeps_its_moment_of_momentum() {
    let mut scenario = parse(
        r#"
        name = "hanging"
        leaf = { rods = 1, length = 1.0, fan = [0.0], base_held = "pinned" }
        rest = { bend_2 = 0.5, bend_3 = 0.7 }
        stiffness = { torsion = 0.7, bending_2 = 1.0, bending_3 = 1.4, axial = 40.0, shear_2 = 50.0, shear_3 = 60.0 }
        load.g = [0.0, 0.0, -2.0]
        load.point = [{ vein = 1, at = 0.6, mass = 0.8, offset = [0.3, -0.2] }]
        dynamics = { density = 1.0, rotary_inertia = 0.01, external_damping = 0.0 }
        "#,
    );
    scenario.points[0].landing = Some(Landing {
        mass: 0.8,
        from: 0.05,
        velocity: [0.3, -1.5, -0.4],
    });
    scenario.points[0].mass = 0.0;
    let leaf = Leaf::new(&scenario);
    let unit = Physics::new(&leaf).time_unit;
    let momentum = |now: &Snapshot, landed: bool| {
        let (grid, physics) = (discrete(&leaf, 5), Physics::new(&leaf));
        let mut sum = DVec3::ZERO;
        for (i, (x, q)) in now.state.x.iter().zip(&now.state.q).enumerate() {
            // Without the mass that lands, which is added by itself.
            let inertia = physics.inertia(&grid, 0, i);
            let v = now.velocity[i];
            sum += x.cross(inertia.mass * v.linear) + inertia.tensor(*q) * v.angular;
        }
        if landed {
            let k = grid.grid.nearest_node(0.6);
            let arm = now.state.q[k] * DVec3::new(0.0, 0.3, -0.2);
            let v = now.velocity[k].linear + now.velocity[k].angular.cross(arm);
            sum += 0.8 * (now.state.x[k] + arm).cross(v);
        }
        sum.z
    };
    let start = released(&leaf, 5);
    let begun = at(STEADY, &leaf, &start, 1e-3 / unit, 0.0499 / unit);
    assert!(momentum(&begun, false).abs() < 1e-6);
    let off = |h: f64| {
        let landed = at(STEADY, &leaf, &start, h / unit, 0.05 / unit);
        let k = discrete(&leaf, 5).grid.nearest_node(0.6);
        let point = landed.state.x[k] + landed.state.q[k] * DVec3::new(0.0, 0.3, -0.2);
        let wanted = 0.8 * point.cross(DVec3::new(0.3, -1.5, -0.4)).z;
        let jump = momentum(&landed, true) - wanted * unit;
        let later = at(STEADY, &leaf, &start, h / unit, 0.8 / unit);
        [jump, momentum(&later, true) - wanted * unit].map(|it| it.abs() / (wanted * unit).abs())
    };
    let [coarse, fine] = [2e-3, 1e-3].map(off);
    println!("{coarse:?} {fine:?}");
    assert!(fine[0] < 1e-6 && fine[1] < 1e-4, "{coarse:?} {fine:?}");
}

/// A mass that lands off the axis: momentum and moment of momentum of mass and node are kept, what is lost vanishes
/// with the segments, and the energy stays balanced. Afterwards the leaf is in the modes that it has with the mass:
/// q' = m v . (shape at the mass).
#[test]
fn a_leaf_with_a_mass_moves_in_its_modes() {
    let text = |mass: &str| {
        parse(&format!(
            r#"
            name = "arm"
            leaf = {{ rods = 1, length = 1.0, fan = [0.0] }}
            stiffness = {{ torsion = 0.7, bending_2 = 1.0, bending_3 = 1.4, axial = 400.0, shear_2 = 500.0, shear_3 = 600.0 }}
            load.point = [{{ vein = 1, at = 0.75, mass = 0.5, offset = [0.3, -0.2]{mass} }}]
            dynamics = {{ density = 1.0, rotary_inertia = 0.01, external_damping = 0.0 }}
            "#
        ))
    };
    let velocity = DVec3::new(0.0, 4e-4, -1e-3);
    let landing = text(", from = 0.05, velocity = [0.0, 4e-4, -1e-3]");
    let (leaf, with) = (Leaf::new(&landing), Leaf::new(&text("")));
    let start = released(&leaf, 8);
    let unit = Physics::new(&with).time_unit;
    let all = modes(&with, &start, 48, &[]);
    let arm = DVec3::new(0.0, 0.3, -0.2);
    let at_mass = |shape: &[[f64; 6]]| {
        let [a, b, c, x, y, z] = shape[6];
        DVec3::new(x, y, z) + DVec3::new(a, b, c).cross(arm)
    };
    let mass = 0.5 / with.scale.length;
    let found = at(STEADY, &leaf, &start, 2e-4 / unit, 0.45 / unit);
    let fine = at(STEADY, &leaf, &start, 1e-4 / unit, 0.45 / unit);
    let mut moved = vec![DVec3::ZERO; start.x.len()];
    for mode in &all {
        let omega = mode.eigenvalue.sqrt();
        // Shapes are normalised by mass.
        let rate = mass * (velocity * unit).dot(at_mass(&mode.shape));
        let part = rate / omega * (omega * 0.4 / unit).sin();
        for (moved, node) in moved.iter_mut().zip(&mode.shape) {
            *moved += part * DVec3::new(node[3], node[4], node[5]);
        }
    }
    let far = largest(moved.iter().map(|it| it.length()));
    for (i, moved) in moved.iter().enumerate() {
        let extrapolated = fine.state.x[i] + (fine.state.x[i] - found.state.x[i]) / 3.0;
        let off = (extrapolated - start.x[i]).distance(*moved) / far;
        assert!(off < 2e-3, "{i}: {off:e}");
    }
    // What is lost, and the balance.
    let lost = [4, 16, 64].map(|segments| {
        let start = released(&leaf, segments);
        let mut moving = semi_implicit(&leaf, &start, StepControl::Fixed(1e-3 / unit));
        let before = moving.snapshot().energy.balance();
        let now = moving.advance(0.05 / unit).unwrap();
        let whole = 0.5 * mass * (velocity * unit).length_squared();
        let off = (now.energy.balance() - before).abs() / whole;
        assert!(off < 1e-12, "{off:e}");
        moving.impacts()[0].lost_energy / whole
    });
    assert!(
        lost[0] > 2.0 * lost[2] && lost[2] > 0.0 && lost[0] < 1.0,
        "{lost:?}"
    );
}

/// A force off the axis with a factor in time, without a mass: both methods move alike, and balance the energy.
#[test]
fn both_methods_move_under_forces_off_the_axis_that_vary() {
    let mut rod = twisted_rod();
    let [force, offset] = [[0.3, -0.5, 0.7], [0.2, -0.3, 0.0]];
    let load = PointLoad {
        force,
        in_time: Some(Box::new(VaryingPointLoad {
            factor: Schedule::smooth(vec![0.0, 0.2, 0.4, 0.6], vec![0.0, 1.0, -0.5, 0.8]),
            force,
            moment: [0.0; 3],
        })),
        ..beside(0, 0.5, 0.0, [offset[0], offset[1]])
    };
    rod.points = vec![load.at_time(0.0)];
    let leaf = Leaf::new(&rod);
    let start = rest(&rod, 4);
    let limits = BOTH.map(|scheme| {
        let [a, b, c] = [2e-3, 1e-3, 5e-4].map(|h| numbers(&at(scheme, &leaf, &start, h, 0.9)));
        let order = order(distance(&a, &b), distance(&b, &c));
        close(&format!("order, {scheme:?}"), order, 2.0, 0.2);
        let [coarse, fine] =
            [2e-3, 1e-3].map(|h| energy_imbalance(scheme, &leaf, &start, h, (6, 0.15)));
        println!("{scheme:?}: {coarse:e} {fine:e}");
        assert!(
            fine < 1e-5 && fine < 0.6 * coarse,
            "{scheme:?}: {coarse:e} {fine:e}"
        );
        limit(&b, &c)
    });
    let off = apart(&limits[0], &limits[1]);
    assert!(off < 2e-5, "{off:e}");
}

/// The explicit method, in which nodes turn freely between kicks, leaves masses off the axis to the other one.
#[test]
fn explicit_steps_do_not_move_masses_off_the_axis() {
    let mut veins = loaded_veins();
    let own = Simulation::new(&veins, &simulate::Options::default()).unwrap();
    assert_eq!(own.choice().reason, SchemeReason::MassesOffAxis);
    let refused = |scenario: &Scenario, scheme| {
        Simulation::new(scenario, &moving(scheme, None))
            .err()
            .unwrap()
    };
    let told = refused(&veins, Scheme::Explicit);
    assert_eq!(told, SimulationError::MassOffAxis);
    assert!(told.to_string().contains("use the semi-implicit method"));
    veins.points.iter_mut().for_each(|it| it.offset = [0.0; 2]);
    assert!(Simulation::new(&veins, &moving(Scheme::Explicit, None)).is_ok());
    let mut free = twisted_rod();
    free.dynamics.clamped = false;
    free.points = vec![beside(0, 1.0, 0.2, [0.1, 0.0])];
    let held = SimulationError::Held {
        obstacle: Some(ExplicitRefusal::MassOffAxis),
    };
    assert_eq!(refused(&free, Scheme::SemiImplicit), held);
}
