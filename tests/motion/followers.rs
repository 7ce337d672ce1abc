//! Loads that turn with the section, and moments along veins, while a leaf moves.

use leafdyn::simulate;
use leafdyn_testing::motion::apart;
use leafdyn_testing::motion::*;
use leafdyn_testing::*;

const LOADS: &str = r#"
    [load]
    gravity = [0.0, 0.0, -0.5]
    follower = [0.3, 0.6, 0.9]
    couple = [0.4, -0.3, 0.5]
    [[load.point]]
    vein = 1
    at = 1.0
    force = [0.5, 0.4, -0.7]
    moment = [0.3, -0.2, 0.4]
    mass = 0.2
    follows = true
"#;

const ROD: &str = r#"
    name = "rod"
    leaf = { rods = 1, length = 1.0, fan = [0.1] }
    stiffness = { torsion = 0.9, bending_2 = 1.2, bending_3 = 0.8, axial = 90.0, shear_2 = 60.0, shear_3 = 70.0 }
"#;

const VEINS: &str = r#"
    name = "veins"
    leaf = { rods = 2, length = 1.0, fan = "symmetric" }
    stiffness = { torsion = 0.9, bending_2 = 1.2, bending_3 = 0.8, axial = 90.0, shear_2 = 60.0, shear_3 = 70.0 }
    coupling = { x = 1.0, y = 2.0, z = 1.5 }
"#;

fn loaded(leaf: &str, damping: f64, duration: f64) -> Scenario {
    parse(&format!(
        "{leaf}\ndynamics = {{ density = 1.0, rotary_inertia = 0.01, external_damping = {damping:?}, duration = {duration:?} }}\n{LOADS}"
    ))
}

/// A damped leaf that is let go comes to the rest that relaxation finds.
#[test]
fn damped_motions_end_where_relaxation_does() {
    for leaf in [ROD, VEINS] {
        let scenario = loaded(leaf, 4.0, 24.0);
        let rest = settled(&scenario, &iterated(1e-12, 8));
        for scheme in BOTH {
            let options = simulate::Options {
                step: Some(2e-3),
                ..moving(scheme, Some(8))
            };
            let end = run(&scenario, &options).positions;
            for (found, node) in end.iter().zip(nodes(&rest.shape.rods)) {
                let off = found.distance(node.position);
                assert!(off < 1e-8, "{scheme:?}: {off:e}");
            }
        }
    }
}

/// The work of the loads is told: without damping the balance of energy deviates by an error of second
/// order in the step.
#[test]
fn their_work_is_in_the_balance_of_energy() {
    for text in [ROD, VEINS] {
        let scenario = loaded(text, 0.0, 1.0);
        let leaf = Leaf::new(&scenario);
        let state = rest(&scenario.unloaded(), 4);
        for scheme in BOTH {
            let deviations = [1e-3, 5e-4].map(|h| {
                let mut method = method(scheme, &leaf, &state, h);
                let start = method.snapshot().energy.balance();
                let mut at = |k: usize| {
                    method.advance(0.02 * k as f64).unwrap();
                    let energy = method.snapshot().energy;
                    assert!(k < 40 || energy.work.abs() > 0.1, "{}", energy.work);
                    (energy.balance() - start).abs()
                };
                largest((1..=50).map(&mut at))
            });
            let order = order(deviations[0], deviations[1]);
            close(&format!("order, {scheme:?}"), order, 2.0, 0.1);
        }
    }
}

/// Also the work on a base that moves, whose support carries these loads.
#[test]
fn their_work_on_a_base_that_moves_is_in_the_balance_of_energy() {
    for load in [
        "follower = [0.3, 0.5, -1.0]",
        "couple = [0.2, -1.0, 0.3]",
        "couple = [0.2, -1.0, 0.3], couple_follows = true",
    ] {
        let scenario = parse(&format!(
            "name = 'carried'\nleaf = {{ rods = 1, length = 1.0, fan = [0.0] }}\n\
             stiffness = {{ torsion = 1.0, bending_2 = 1.0, bending_3 = 1.0, axial = 1000.0, shear_2 = 1000.0, shear_3 = 1000.0 }}\n\
             load = {{ {load} }}\n\
             [dynamics]\ndensity = 1.0\nexternal_damping = 0.0\nduration = 0.5\n\
             base = {{ at = [0.0, 0.25, 0.5], move = [[0, 0, 0], [0.1, 0, 0.05], [0.1, 0, 0.2]], \
             turn = [[0, 0, 0], [0, -0.25, 0], [0.2, -0.5, 0]], smooth = true }}"
        ));
        let leaf = Leaf::new(&scenario);
        for scheme in BOTH {
            let mut method = method(scheme, &leaf, &released(&leaf, 8), 2e-4);
            let start = method.snapshot().energy.balance();
            method.advance(0.5).unwrap();
            let energy = method.snapshot().energy;
            let off = (energy.balance() - start).abs();
            assert!(energy.work.abs() > 0.1, "{load}, {scheme:?}: {energy:?}");
            assert!(
                off < 1e-4 * energy.work.abs(),
                "{load}, {scheme:?}: {off:.1e}"
            );
        }
    }
}

const ONE: &str = "{ at = [0.0, 1.0], factor = [1.0, 1.0] }";
const PULSE: &str = "{ at = [0.0, 0.3, 0.6, 1.0], factor = [0.0, 1.0, -0.4, 0.7] }";

/// A leaf under loads with factors in time: that of all loads, and that of those on points.
fn factored(leaf: &str, of_all: &str, of_points: &str) -> Scenario {
    let loads = LOADS.replace("[load]", &format!("[load]\nfactor = {of_all}"));
    parse(&format!(
        "{leaf}\ndynamics = {{ density = 1.0, rotary_inertia = 0.01, external_damping = 0.0, duration = 1.0 }}\n\
         {loads}factor = {of_points}\n"
    ))
}

/// A factor of one is none; it is read again as it is written.
#[test]
fn a_factor_of_one_is_none() {
    for text in [ROD, VEINS] {
        let (plain, of_one) = (loaded(text, 0.0, 1.0), factored(text, ONE, ONE));
        for written in [&of_one, &factored(text, PULSE, PULSE)] {
            let again = Scenario::from_toml(&serde_json::to_string(written).unwrap()).unwrap();
            assert_eq!(again, *written);
        }
        for scheme in BOTH {
            let motions = [&plain, &of_one].map(|scenario| {
                let leaf = Leaf::new(scenario);
                let start = rest(&plain.unloaded(), 8);
                at(scheme, &leaf, &start, 1e-3, 0.7)
            });
            let [a, b] = &motions;
            let off = apart(&numbers(a), &numbers(b));
            assert!(off < 1e-11, "{scheme:?}: {off:e}");
            close("work", a.energy.work, b.energy.work, 1e-11);
        }
    }
}

/// With factors that begin with nothing, both methods are of second order and lead to the same motion, with the work of
/// the loads in the balance of energy.
#[test]
fn factors_in_time_are_those_of_both_methods() {
    for text in [ROD, VEINS] {
        let scenario = factored(text, PULSE, PULSE);
        let leaf = Leaf::new(&scenario);
        let start = rest(&scenario.unloaded(), 4);
        let mut limits = Vec::new();
        for scheme in BOTH {
            let positions = |h: f64| numbers(&at(scheme, &leaf, &start, h, 0.9));
            let [coarse, middle, fine] = [2e-3, 1e-3, 5e-4].map(positions);
            let (one, two) = (apart(&coarse, &middle), apart(&middle, &fine));
            close(&format!("{scheme:?}"), order(one, two), 2.0, 0.15);
            limits.push(limit(&middle, &fine));
            let [long, short] =
                [1e-3, 5e-4].map(|h| energy_imbalance(scheme, &leaf, &start, h, (45, 0.02)));
            close(&format!("energy, {scheme:?}"), order(long, short), 2.0, 0.2);
        }
        let moved = apart(
            &limits[0],
            &numbers(&at(BOTH[0], &leaf, &start, 1e-3, 1e-9)),
        );
        let off = apart(&limits[0], &limits[1]);
        assert!(off < 1e-5 * moved && moved > 1.0, "{off:e} {moved}");
    }
}

/// In a plane a moment that turns with the section is a dead one.
#[test]
fn in_a_plane_moments_that_turn_are_dead_ones() {
    let made = |load: &str| {
        parse(&format!(
            "{ROD}\ndynamics = {{ density = 1.0, rotary_inertia = 0.01, external_damping = 0.2 }}\n\
             load.gravity = [0.2, -0.5, 0.0]\n[[load.point]]\nvein = 1\nat = 0.75\nmoment = [0.0, 0.0, 0.9]\n\
             factor = {PULSE}\n{load}\n"
        ))
    };
    for scheme in BOTH {
        let motions = ["", "follows = true"].map(|load| {
            let scenario = made(load);
            let leaf = Leaf::new(&scenario);
            at(scheme, &leaf, &released(&leaf, 8), 2e-3, 0.8)
        });
        let [a, b] = &motions;
        let off = apart(&numbers(a), &numbers(b));
        assert!(off < 1e-10, "{scheme:?}: {off:e}");
        close("work", a.energy.work, b.energy.work, 1e-9);
    }
}

/// A rod on a hinge under a force along d2 that grows with the distance from the hinge, and a moment along it, is turned
/// without being bent: theta'' = f(t) for a force f(t) rho s and a moment f(t) rho I per length.
#[test]
fn a_rod_that_is_driven_all_along_turns_rigidly() {
    let scenario = parse(
        r#"
        name = "blade"
        leaf = { rods = 1, length = 1.0, fan = [0.0], base_held = "pinned" }
        stiffness = { torsion = 1.0, bending_2 = 1.0, bending_3 = 1.0, axial = inf, shear_2 = inf, shear_3 = inf }
        dynamics = { density = 1.3, rotary_inertia = 0.02, external_damping = 0.0 }
        [load]
        follower = { at = [0.0, 1.0], value = [[0.0, 0.0, 0.0], [0.0, 1.3, 0.0]] }
        couple = [0.0, 0.0, 0.02]
        couple_follows = true
        factor = { at = [0.0, 0.5, 1.0], factor = [0.0, 3.0, -1.0] }
        "#,
    );
    let leaf = Leaf::new(&scenario);
    let unit = leafdyn::internals::motion::Physics::new(&leaf).time_unit;
    // The integrals of 6 t up to 0.5, and of 3 - 8 (t - 0.5) from there.
    let angle = |time: f64| match time < 0.5 {
        true => time.powi(3),
        false => {
            let t = time - 0.5;
            0.125 + 0.75 * t + 1.5 * t * t - 8.0 * t.powi(3) / 6.0
        }
    };
    for until in [0.4, 0.9] {
        let found = |h: f64| {
            let start = released(&leaf, 8);
            let end = at(Scheme::SemiImplicit, &leaf, &start, h, until / unit)
                .state
                .tip(0);
            assert!((end.length() - 1.0).abs() < 1e-9 && end.z.abs() < 1e-12);
            end.y.atan2(end.x)
        };
        let [long, short] = [4e-3, 2e-3].map(found);
        let exact = angle(until);
        let limit = short + (short - long) / 3.0;
        assert!((short - exact).abs() < 1e-4, "{until}: {short} {exact}");
        assert!((limit - exact).abs() < 1e-7, "{until}: {limit} {exact}");
    }
}

/// A nearly rigid rod on a hinge is turned by a force at its tip that follows it as a rigid one, the better the stiffer it
/// is: theta'' = F f(t) L/(rho L^3/3).
#[test]
fn a_force_on_the_tip_of_a_stiff_rod_turns_it() {
    let angle = |bending: f64| {
        let scenario = parse(&format!(
            r#"
            name = "pendulum"
            leaf = {{ rods = 1, length = 1.0, fan = [0.0], base_held = "pinned" }}
            stiffness = {{ torsion = {bending}, bending_2 = {bending}, bending_3 = {bending}, axial = inf, shear_2 = inf, shear_3 = inf }}
            dynamics = {{ density = 3.0, rotary_inertia = 1e-9, external_damping = 0.0 }}
            [[load.point]]
            vein = 1
            at = 1.0
            force = [0.0, 1.0, 0.0]
            follows = true
            factor = {{ at = [0.0, 1.0], factor = [0.0, 1.0] }}
            "#
        ));
        let leaf = Leaf::new(&scenario);
        let unit = leafdyn::internals::motion::Physics::new(&leaf).time_unit;
        let on = |segments: usize| {
            let start = released(&leaf, segments);
            let end = at(Scheme::SemiImplicit, &leaf, &start, 2e-3 / unit, 1.0 / unit)
                .state
                .tip(0);
            end.y.atan2(end.x)
        };
        let [coarse, fine] = [8, 16].map(on);
        fine + (fine - coarse) / 3.0
    };
    // The integral of t over twice, of t^2/2.
    let off = [1e2, 1e3].map(|bending| (angle(bending) - 1.0 / 6.0).abs());
    assert!(off[1] < 1e-3 && off[1] < 0.2 * off[0], "{off:?}");
}
