//! Bases that springs hold in their directions: against closed forms, the limits of clamps and hinges,
//! shooting, and what a turn of the whole leaf must not change.

use glam::{DQuat, DVec3};
use leafdyn_testing::*;

/// A vein of bending stiffness one that a force of this size bends a little upwards.
fn rooted(spring: f64, force: f64) -> String {
    format!(
        r#"
        name = "rooted"
        leaf = {{ rods = 1, length = 1.0, fan = [0.0], base_held = "elastic", base_turn_stiffness = {spring:?} }}
        stiffness = {{ torsion = 1.0, bending_2 = 1.0, bending_3 = 2.0, axial = inf, shear_2 = inf, shear_3 = inf }}
        load = {{ tip_force = [0.0, 0.0, {force:?}] }}
        "#
    )
}

/// The tip moves by F L^3/(3 EI) + F L^2/c.
#[test]
fn the_deflection_of_a_beam_on_a_spring() {
    for spring in [0.1, 1.0, 30.0] {
        let force = 1e-5;
        let leaf = settle(&parse(&rooted(spring, force)), 1e-12);
        let exact = force * (1.0 / 3.0 + 1.0 / spring);
        close("tip", leaf.tips[0].z, exact, 2e-6 * exact);
        let energy = -0.5 * force * exact;
        close("energy", leaf.energy.unwrap(), energy, 1e-6 * energy.abs());
    }
}

/// A leaf in space, on springs of this stiffness or held otherwise.
fn leaf(held: &str) -> String {
    format!(
        r#"
        name = "leaf"
        leaf = {{ rods = 3, length = [1.0, 0.9, 1.1], fan = [0.3, 0.0, -0.2], joined = false, elevation = 0.2, {held} }}
        stiffness = {{ torsion = 0.8, bending_2 = 1.0, bending_3 = 1.5, axial = 200.0, shear_2 = 100.0, shear_3 = 100.0 }}
        rest = {{ bend_2 = 0.5, twist = 0.3, bend_3 = -0.4 }}
        coupling = {{ x = 1.0, y = 2.0, z = 1.5 }}
        load = {{ gravity = [0.3, 0.2, -1.2], tip_force = [0.1, -0.2, 0.1] }}
        "#
    )
}

/// Of stiff springs it is that on clamps, of weak ones that on hinges, each to first order.
#[test]
fn clamps_and_hinges_are_limits() {
    let tips = |held: &str| settle(&parse(&leaf(held)), 1e-10).tips;
    for (limit, springs, ratio) in [
        ("base_held = \"clamped\"", [1e4, 1e5], 10.0),
        ("base_held = \"pinned\"", [1e-4, 1e-5], 10.0),
    ] {
        let limit = tips(limit);
        let off = springs.map(|spring| {
            let held = format!("base_held = \"elastic\", base_turn_stiffness = {spring:?}");
            let tips = tips(&held);
            largest(tips.iter().zip(&limit).map(|(a, b)| a.distance(*b)))
        });
        let found = off[0] / off[1];
        assert!(
            (found / ratio - 1.0).abs() < 0.01 && off[1] < 1e-3,
            "{off:?}"
        );
    }
}

/// Relaxation and shooting are independent of each other, also with as many springs as veins; the moment at
/// each base is that of its spring.
#[test]
fn shooting_finds_the_same() {
    for springs in ["2.0", "[0.5, 3.0, 0.02]"] {
        let scenario = parse(&leaf(&format!(
            "base_held = \"elastic\", base_turn_stiffness = {springs}"
        )));
        let relaxed = settle(&scenario, 1e-11);
        let shot = found(&scenario, shoot_near(&scenario, &relaxed));
        for (a, b) in nodes(&relaxed.shape.rods).zip(nodes(&shot.rods)) {
            assert!(a.position.distance(b.position) < 1e-9);
            assert!(a.m.distance(b.m) < 1e-7);
        }
        close("energy", relaxed.energy.unwrap(), shot.energy, 1e-9);
        for (j, rod) in relaxed.shape.rods.iter().enumerate() {
            let base = &rod.nodes[0];
            let natural = scenario.rods[j].base_rotation();
            let turn = (base.rotation * natural.conjugate()).to_scaled_axis();
            let moment = base.rotation * base.m;
            let spring = scenario.base_turn_stiffness[j];
            assert!(moment.distance(spring * turn) < 1e-6 * (1.0 + moment.length()));
        }
    }
}

/// Errors go with the square of the length of segments, and joined veins rest on springs, too.
#[test]
fn the_order_is_two() {
    for joined in ["false", "true"] {
        let text = leaf("base_held = \"elastic\", base_turn_stiffness = 1.3")
            .replace("joined = false", &format!("joined = {joined}"));
        let scenario = parse(&text);
        let tip = |segments: usize| settled(&scenario, &iterated(1e-12, segments)).tips[0];
        let [a, b, c, d] = [8, 16, 32, 64].map(tip);
        for ratio in [a.distance(b) / b.distance(c), b.distance(c) / c.distance(d)] {
            assert!((3.7..4.3).contains(&ratio), "{joined}: {ratio}");
        }
    }
}

/// What is turned as a whole, with its loads and natural directions, turns.
#[test]
fn a_turned_leaf_is_the_same_leaf() {
    let of = |angle: f64| {
        let turn = DQuat::from_rotation_z(angle);
        let mut scenario = parse(&leaf("base_held = \"elastic\", base_turn_stiffness = 0.7"));
        for rod in &mut scenario.rods {
            rod.angle += angle;
        }
        scenario.coupling.iter_mut().for_each(|gap| *gap = [1.0; 3]);
        let turned = |force: [f64; 3]| (turn * DVec3::from_array(force)).to_array();
        scenario.gravity = turned(scenario.gravity);
        scenario.tip_force = turned(scenario.tip_force);
        let found = settle(&scenario, 1e-10);
        let tips: Vec<DVec3> = found.tips.iter().map(|tip| turn.inverse() * *tip).collect();
        (tips, found.energy.unwrap())
    };
    let ((tips, energy), (turned, other)) = (of(0.0), of(1.1));
    close("energy", energy, other, 1e-9);
    assert!(tips.iter().zip(&turned).all(|(a, b)| a.distance(*b) < 1e-9));
}

#[test]
fn what_makes_no_sense_is_refused() {
    for (held, why) in [
        ("base_held = \"elastic\"", "leaf.base_turn_stiffness"),
        (
            "base_turn_stiffness = 1.0",
            "add leaf.base_held = \"elastic\"",
        ),
        (
            "base_held = \"elastic\", base_turn_stiffness = 0.0",
            "must be greater than 0",
        ),
        ("base_held = \"soft\"", "\"elastic\""),
    ] {
        let refused = Scenario::from_toml(&leaf(held)).unwrap_err().to_string();
        assert!(refused.contains(why), "{held}: {refused}");
    }
}
