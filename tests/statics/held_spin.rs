//! Hinges that hold the spin of bases (`leaf.base_spin = "held"`), as constant-velocity joints: against closed forms,
//! shooting, clamps, and differences.

use crate::sensitivities::assert_those_of_relaxations;
use glam::{DQuat, DVec3};
use leafdyn_testing::*;
use std::f64::consts::PI;

/// Three different veins in space, held by these words.
fn text(held: &str) -> String {
    format!(
        r#"
        name = "veins"
        leaf = {{ rods = 3, length = [1.0, 0.9, 1.1], fan = [0.2, 0.0, -0.2], elevation = 0.1, base = [[0.0, -0.2, 0.0], [0.1, 0.0, 0.15], [0.0, 0.2, 0.0]], base_held = {held}, base_spin = "held" }}
        stiffness = {{ torsion = 0.8, bending_2 = 1.0, bending_3 = 2.0, axial = 100.0, shear_2 = 60.0, shear_3 = 80.0 }}
        rest = {{ bend_2 = [0.3, -0.5, 0.4], bend_3 = [0.2, 0.1, -0.3], twist = 0.2 }}
        load.gravity = [0.0, 0.3, -2.0]
        load.tip_force = [0.1, -0.2, 0.1]
        dynamics = {{ density = 1.0, rotary_inertia = 0.01 }}
        "#
    )
}

/// With these entries in place of others, or further tables of veins that do not meet.
fn veins(held: &str, entries: &str) -> Scenario {
    let base = match entries.contains("[[") {
        true => base(
            &(text(held) + entries),
            "leaf.joined=false; load.g=[0.0, 0.0, -1.0]",
        ),
        false => base(&text(held), entries),
    };
    base.scenario().clone()
}

const EACH_WAY: [&str; 2] = [
    r#""pinned""#,
    r#"["clamped", "elastic", "pinned"], base_turn_stiffness = 1.3"#,
];
const TISSUE: &str = "tissue.along=20.0; tissue.across=10.0; tissue.normal=15.0; tissue.fold=0.4";
const COUPLING: &str = "coupling.x=2.0; coupling.y=3.0; coupling.z=4.0";
const FOLLOWERS: &str = "load.follower=[0.2, 0.1, -0.4]; load.couple=[0.1, 0.05, 0.0]";
const FOUNDED: &str = "leaf.joined=false; foundation.stiffness=[1.0, 2.0, 3.0]";
const MASS: &str = "
    [[load.point]]
    vein = 3
    at = 0.7
    mass = 0.05
    offset = [0.02, 0.03]
    [[load.point]]
    vein = 1
    at = 1.0
    force = [0.0, 0.3, 0.2]
    follows = true
";

/// The axis of a joint: half-way between the natural direction of the base and its present one.
fn joint_axis(scenario: &Scenario, j: usize, base: DQuat) -> DVec3 {
    let natural = scenario.rods[j].base_rotation();
    (natural * DVec3::X + base * DVec3::X).normalize()
}

/// The frame is the natural one after the shortest turn of its tangent, but for rounding.
fn is_turned_shortest(scenario: &Scenario, j: usize, root: &NodeState) {
    let natural = scenario.rods[j].base_rotation();
    let [from, to] = [natural, root.rotation].map(|q| q * DVec3::X);
    let wanted = DQuat::from_rotation_arc(from, to) * natural;
    let off = (root.rotation * wanted.conjugate()).xyz().length();
    assert!(off < 1e-12, "{j}: {off:e}");
}

/// Of what was shot: nothing but a moment along the axis of the joint is on the base.
fn is_on_joint(scenario: &Scenario, j: usize, root: &NodeState) {
    is_turned_shortest(scenario, j, root);
    let moment = root.rotation * root.m;
    let across = moment.reject_from_normalized(joint_axis(scenario, j, root.rotation));
    assert!(across.length() < 1e-12, "{j}: {across}");
}

/// Relaxation and shooting, which share neither grids nor elements, find the same leaves and the same forces and moments
/// on their bases.
#[test]
fn shooting_finds_the_same_leaves() {
    let mut largest_moment = 0.0_f64;
    for held in EACH_WAY {
        for entries in [
            "",
            COUPLING,
            TISSUE,
            "leaf.joined=false",
            FOLLOWERS,
            FOUNDED,
            MASS,
        ] {
            let scenario = veins(held, entries);
            let relaxed = settle(&scenario, 1e-10);
            let on_grid = settled(&scenario, &iterated(1e-12, 16));
            let shot = found(&scenario, shoot_near(&scenario, &relaxed));
            let off = apart(&scenario, &relaxed.shape.rods, &shot.rods);
            assert!(off.position < 1e-8, "{held} {entries}: {:e}", off.position);
            for (a, b) in nodes(&relaxed.shape.rods).zip(nodes(&shot.rods)) {
                assert!(a.m.distance(b.m) < 1e-6, "{held} {entries}");
            }
            if entries != FOLLOWERS && !entries.contains("follows") {
                close("energy", relaxed.energy.unwrap(), shot.energy, 1e-8);
            }
            for (j, reaction) in relaxed.base_reactions.iter().enumerate() {
                let root = &shot.rods[j].nodes[0];
                let (force, moment) = (root.rotation * root.n, root.rotation * root.m);
                assert!(reaction.force.distance(force) < 1e-6);
                let own = reaction.moment.unwrap();
                assert!(own.distance(moment) < 1e-6, "{held} {entries}");
                if scenario.base_held[j].word() == "pinned" {
                    is_on_joint(&scenario, j, root);
                    is_turned_shortest(&scenario, j, &on_grid.shape.rods[j].nodes[0]);
                    largest_moment = largest_moment.max(own.length());
                }
            }
        }
    }
    assert!(largest_moment > 0.05, "{largest_moment}");
}

/// A straight round vein whose tip a hinge holds, and a moment T about its axis at the distance s twists: by T s/GJ, as
/// on a clamp, and the joint carries T.
#[test]
fn an_end_couple_twists_a_vein() {
    for held in ["clamped", "pinned"] {
        let spin = if held == "pinned" { "held" } else { "free" };
        let text = format!(
            r#"
            name = "shaft"
            leaf = {{ rods = 1, length = 1.0, fan = [0.0], base_held = "{held}", base_spin = "{spin}" }}
            stiffness = {{ torsion = 0.7, bending_2 = 1.0, bending_3 = 1.0, axial = 100.0, shear_2 = 80.0, shear_3 = 80.0 }}
            tip = {{ held = "pinned", position = [1.0, 0.0, 0.0] }}
            [[load.point]]
            vein = 1
            at = 0.75
            moment = [0.4, 0.0, 0.0]
            "#
        );
        let leaf = settle(&parse(&text), 1e-10);
        let rod = &leaf.shape.rods[0];
        let ends = [0, rod.nodes.len() - 1].map(|i| rod.nodes[i].rotation);
        let twist = ends[1].mul_quat(ends[0].conjugate()).to_scaled_axis();
        let wanted = 0.75 * 0.4 / 0.7;
        assert!(twist.distance(wanted * DVec3::X) < 1e-9, "{twist}");
        let moment = leaf.base_reactions[0].moment.unwrap();
        assert!(moment.distance(0.4 * DVec3::X) < 1e-9, "{held}: {moment}");
    }
}

/// A vein that bends in a plane does not spin: it rests as on a hinge on which it may, without a moment.
#[test]
fn nothing_is_held_where_nothing_twists() {
    let of = |spin: &str| {
        let text = format!(
            r#"
            name = "plane"
            leaf = {{ rods = 1, length = 1.0, fan = [0.0], elevation = 0.4, base_held = "pinned", base_spin = "{spin}" }}
            stiffness = {{ torsion = 0.7, bending_2 = 1.0, bending_3 = 1.5, axial = 100.0, shear_2 = 80.0, shear_3 = 80.0 }}
            rest.bend_2 = 1.0
            load.gravity = [0.8, 0.0, -1.0]
            "#
        );
        settle(&parse(&text), 1e-10)
    };
    let (free, held) = (of("free"), of("held"));
    assert!(free.tips[0].distance(held.tips[0]) < 1e-9);
    assert_eq!(free.base_reactions[0].moment, None);
    let moment = held.base_reactions[0].moment.unwrap();
    assert!(moment.length() < 1e-9, "{moment}");
}

/// A base that turns by more than a right angle, about an axis that is in no plane of the frame.
#[test]
fn a_base_turns_far() {
    let text = r#"
        name = "pendulum"
        leaf = { rods = 1, length = 1.0, fan = [0.3], elevation = 0.9, base_held = "pinned", base_spin = "held" }
        stiffness = { torsion = 0.7, bending_2 = 1.0, bending_3 = 1.5, axial = 100.0, shear_2 = 80.0, shear_3 = 80.0 }
        rest = { bend_2 = 0.8, bend_3 = 0.5, twist = 0.4 }
        load.gravity = [0.2, 0.5, -2.0]
        "#;
    let scenario = parse(text);
    let relaxed = settle(&scenario, 1e-10);
    let on_grid = settled(&scenario, &iterated(1e-12, 16));
    let root = &on_grid.shape.rods[0].nodes[0];
    is_turned_shortest(&scenario, 0, root);
    let turned = root
        .rotation
        .angle_between(scenario.rods[0].base_rotation());
    assert!(turned > 0.6 * PI, "{turned}");
    let shot = found(&scenario, shoot_near(&scenario, &relaxed));
    is_on_joint(&scenario, 0, &shot.rods[0].nodes[0]);
    let off = apart(&scenario, &relaxed.shape.rods, &shot.rods);
    assert!(off.position < 1e-8, "{:e}", off.position);
}

/// Errors go with the square of the length of segments.
#[test]
fn the_order_is_two() {
    for held in EACH_WAY {
        for entries in ["", TISSUE] {
            let scenario = veins(held, entries);
            let tip = |segments: usize| settled(&scenario, &iterated(1e-12, segments)).tips[0];
            let coarsest = if entries.is_empty() { 8 } else { 16 };
            let [a, b, c, d] = [1, 2, 4, 8].map(|times| tip(times * coarsest));
            for ratio in [a.distance(b) / b.distance(c), b.distance(c) / c.distance(d)] {
                assert!((3.7..4.3).contains(&ratio), "{held} {entries}: {ratio}");
            }
        }
    }
}

/// Derivatives, also by the places and directions of bases, are those of whole relaxations.
#[test]
fn derivatives_are_those_of_whole_relaxations() {
    for held in EACH_WAY {
        for entries in ["", TISSUE, "leaf.joined=false"] {
            let base = base(&text(held), entries);
            let wanted = [
                "leaf.base[0][1]",
                "leaf.base[2][0]",
                "leaf.fan[0]",
                "leaf.fan[2]",
                "leaf.elevation",
                "leaf.length[1]",
                "load.gravity[2]",
                "rest.bend_2[1]",
                "rest.twist",
                "stiffness.torsion",
            ];
            assert_those_of_relaxations(&base, &wanted, &format!("{held} {entries}"));
        }
    }
}

/// A couple along a vein makes it spin on a hinge on which it may, which the remark on the missing equilibrium says; where
/// the spin is held, the vein rests.
#[test]
fn what_spins_without_end_is_told() {
    let text = |spin: &str| {
        format!(
            r#"
            name = "spin"
            leaf = {{ rods = 1, length = 1.0, fan = [0.0], elevation = -1.0, base_held = "pinned", base_spin = "{spin}" }}
            stiffness = {{ torsion = 0.7, bending_2 = 1.0, bending_3 = 1.5, axial = 100.0, shear_2 = 80.0, shear_3 = 80.0 }}
            rest.bend_2 = 0.3
            load = {{ gravity = [0.0, 0.0, -1.0], couple = [0.1, 0.0, 0.0], couple_follows = true }}
            "#
        )
    };
    let free = relaxed(&parse(&text("free")), &Options::default());
    assert!(!free.outcome.is_success());
    let remark = free.remark.unwrap().to_string();
    assert!(remark.contains("leaf.base_spin = \"held\""), "{remark}");
    let scenario = parse(&text("held"));
    let held = settle(&scenario, 1e-9);
    let shot = found(&scenario, shoot_near(&scenario, &held));
    let off = apart(&scenario, &held.shape.rods, &shot.rods);
    assert!(off.position < 1e-8, "{:e}", off.position);
}

#[test]
fn what_makes_no_sense_is_refused() {
    for (held, why) in [
        (r#""clamped""#, "add leaf.base_held = \"pinned\""),
        (
            r#""elastic", base_turn_stiffness = 1.0"#,
            "add leaf.base_held = \"pinned\"",
        ),
    ] {
        let refused = Scenario::from_toml(&text(held)).unwrap_err().to_string();
        assert!(refused.contains(why), "{held}: {refused}");
    }
    let loose = text(r#""pinned""#).replace("base_spin = \"held\"", "base_spin = \"loose\"");
    let refused = Scenario::from_toml(&loose).unwrap_err().to_string();
    assert!(refused.contains("\"free\" or \"held\""), "{refused}");
}

/// The word is in a scenario that is written.
#[test]
fn the_word_is_written() {
    let held = veins(EACH_WAY[1], "");
    let written = serde_json::to_string(&held).unwrap();
    assert!(written.contains(r#""base_spin":"held""#), "{written}");
    assert_eq!(Scenario::from_toml(&written).unwrap(), held);
}
