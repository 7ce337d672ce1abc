//! Loads off the axes by shooting, which shares neither grid nor element with the relaxation.

use leafdyn_testing::random::{Draw, add_loads_off_axis, drawn, leaves};
use leafdyn_testing::*;

#[test]
fn on_random_leaves() {
    let mut draw = Draw(11);
    let mut agreed = 0;
    for (case, mut scenario) in drawn(leaves(), 40).into_iter().enumerate() {
        add_loads_off_axis(&mut draw, &mut scenario, false);
        let leaf = relaxed(&scenario, &to(TIGHT));
        if leaf.outcome.is_success() {
            match shoot_near(&scenario, &leaf) {
                Ok(shot) => {
                    agree(&format!("leaf {case}"), &scenario, &leaf, &shot, 1e-7);
                    agreed += 1;
                }
                Err(failure) => println!("leaf {case}: shooting, {}", failure.reason),
            }
        }
    }
    assert!(agreed >= 32, "{agreed}");
}

/// A leaf of all that there is: without tip, joined, held at the tip, with tissue, a foundation, bases that turn and
/// loads that follow.
#[test]
fn on_leaves_of_every_kind() {
    let points = "
        load.g = [0.0, 0.2, -1.0]
        load.point = [
            { vein = 2, at = 0.5, force = [0.2, 0.1, -0.4], offset = [0.15, -0.1], mass = 0.3 },
            { vein = 1, at = 1.0, force = [0.1, -0.2, 0.3], offset = [-0.1, 0.2] },
            { vein = 3, at = 1.0, mass = 0.2, offset = [0.2, 0.0] },
        ]";
    for (kind, more) in [
        ("free", "leaf.joined = false"),
        ("joint", "coupling = { x = 1.0, y = 2.0, z = 1.5 }"),
        (
            "pinned",
            "tip = { held = \"pinned\", position = [0.8, 0.1, -0.1] }",
        ),
        (
            "clamped",
            "tip = { held = \"clamped\", position = [0.8, 0.1, -0.1], angles = [0.2, 0.1, -0.1], twist = 0.4 }",
        ),
        (
            "tissue",
            "leaf.base = [[0.0, -0.1, 0.0], [0.0, 0.0, 0.0], [0.0, 0.1, 0.0]]
             leaf.joined = false
             tissue = { along = 20.0, across = 30.0, normal = 15.0, fold = 0.4 }",
        ),
        (
            "rigid tissue",
            "leaf.base = [[0.0, -0.1, 0.0], [0.0, 0.0, 0.0], [0.0, 0.1, 0.0]]
             leaf.joined = false
             tissue = { along = inf, across = 30.0, normal = inf, fold = 0.4 }",
        ),
        (
            "ground",
            "leaf.joined = false\nfoundation.stiffness = [0.0, 2.0, 5.0]",
        ),
        ("hinges", "leaf.base_held = \"pinned\""),
        (
            "springs",
            "leaf.base_held = \"elastic\"\nleaf.base_turn_stiffness = 3.0",
        ),
    ] {
        let scenario = parse(&format!(
            r#"
            name = "{kind}"
            leaf.rods = 3
            leaf.length = [1.0, 0.95, 1.05]
            leaf.fan = "symmetric"
            dynamics.density = 0.3
            rest = {{ bend_2 = 0.3, twist = 0.4 }}
            stiffness = {{ torsion = 0.7, bending_2 = 1.0, bending_3 = 1.4, axial = 40.0, shear_2 = 50.0, shear_3 = 60.0 }}
            load.tip_force = [0.3, 0.1, -0.2]
            {points}
            {more}
            "#
        ));
        let leaf = settle(&scenario, 1e-11);
        let shot = shot_near(&scenario, &leaf);
        if kind == "rigid tissue" {
            // It passes a load on a point to its neighbors at once: the forces in the veins jump there.
            let found = apart(&scenario, &leaf.shape.rods, &shot.rods);
            assert!(found.position < 1e-8 && found.rotation < 1e-8, "{found:?}");
            close(kind, leaf.energy.unwrap(), shot.energy, 1e-8);
            continue;
        }
        agree(kind, &scenario, &leaf, &shot, 1e-8);
    }
}

#[test]
fn with_loads_that_follow() {
    let mut draw = Draw(21);
    let mut agreed = 0;
    for (case, mut scenario) in drawn(leaves(), 16).into_iter().enumerate() {
        add_loads_off_axis(&mut draw, &mut scenario, true);
        let leaf = relaxed(&scenario, &to(1e-10));
        if leaf.outcome.is_success() {
            let Ok(shot) = shoot_near(&scenario, &leaf) else {
                println!("leaf {case}: shooting fails");
                continue;
            };
            let found = apart(&scenario, &leaf.shape.rods, &shot.rods);
            assert!(found.position < 1e-7, "{case}: {found:?}");
            agreed += 1;
        }
    }
    assert!(agreed >= 10, "{agreed}");
}

/// From arcs, along the continuation in the loads.
#[test]
fn without_a_start() {
    let scenario = parse(
        r#"
        name = "leaf"
        leaf = { rods = 3, length = 1.0, fan = "symmetric" }
        stiffness = { torsion = 0.7, bending_2 = 1.0, bending_3 = 1.4, axial = 40.0, shear_2 = 50.0, shear_3 = 60.0 }
        load.tip_force = [0.3, 0.1, -0.2]
        load.point = [
            { vein = 2, at = 0.5, force = [0.2, 0.1, -0.4], offset = [0.15, -0.1] },
            { vein = 1, at = 1.0, force = [0.1, -0.2, 0.3], offset = [-0.1, 0.2] },
        ]
        "#,
    );
    all_agree("from arcs", &scenario);
}
