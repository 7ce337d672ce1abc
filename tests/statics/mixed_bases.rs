//! Leaves of which every base is held in its own way (`leaf.base_held` as a list): against shooting, leaves of one
//! vein, the limits of springs, and differences.

use crate::sensitivities::assert_those_of_relaxations;
use leafdyn_testing::*;

/// Three different veins in space, held by these words.
fn veins(held: &str, entries: &str) -> Scenario {
    base(&text(held), entries).scenario().clone()
}

fn text(held: &str) -> String {
    format!(
        r#"
        name = "veins"
        leaf = {{ rods = 3, length = [1.0, 0.9, 1.1], fan = [0.2, 0.0, -0.2], elevation = 0.1, base = [[0.0, -0.2, 0.0], [0.1, 0.0, 0.15], [0.0, 0.2, 0.0]], base_held = {held} }}
        stiffness = {{ torsion = 0.8, bending_2 = 1.0, bending_3 = 2.0, axial = 100.0, shear_2 = 60.0, shear_3 = 80.0 }}
        rest = {{ bend_2 = [0.3, -0.5, 0.4], bend_3 = [0.2, 0.1, -0.3], twist = 0.2 }}
        load.gravity = [0.0, 0.3, -2.0]
        load.tip_force = [0.1, -0.2, 0.1]
        dynamics = {{ density = 1.0, rotary_inertia = 0.01 }}
        "#
    )
}

const EACH_WAY: [&str; 3] = [
    r#"["clamped", "elastic", "pinned"], base_turn_stiffness = 1.3"#,
    r#"["pinned", "clamped", "clamped"]"#,
    r#"["elastic", "clamped", "elastic"], base_turn_stiffness = [0.5, 1.0, 3.0]"#,
];
const TISSUE: &str = "tissue.along=20.0; tissue.across=10.0; tissue.normal=15.0; tissue.fold=0.4";
const COUPLING: &str = "coupling.x=2.0; coupling.y=3.0; coupling.z=4.0";

/// Relaxation and shooting, which share neither grids nor elements, find the same leaves and the same forces
/// and moments on their bases; a hinge has no moment, and a clamp does not turn.
#[test]
fn shooting_finds_the_same_leaves() {
    for held in EACH_WAY {
        for entries in ["", COUPLING, TISSUE, "leaf.joined=false"] {
            let scenario = veins(held, entries);
            let relaxed = settle(&scenario, 1e-10);
            let shot = found(&scenario, shoot_near(&scenario, &relaxed));
            let off = apart(&scenario, &relaxed.shape.rods, &shot.rods);
            assert!(off.position < 1e-8, "{held} {entries}: {:e}", off.position);
            for (a, b) in nodes(&relaxed.shape.rods).zip(nodes(&shot.rods)) {
                assert!(a.m.distance(b.m) < 1e-6, "{held} {entries}");
            }
            close("energy", relaxed.energy.unwrap(), shot.energy, 1e-8);
            for (j, reaction) in relaxed.base_reactions.iter().enumerate() {
                let word = scenario.base_held[j].word();
                let root = &shot.rods[j].nodes[0];
                let (force, moment) = (root.rotation * root.n, root.rotation * root.m);
                assert!(reaction.force.distance(force) < 1e-6);
                assert_eq!(reaction.moment.is_none(), word == "pinned");
                if let Some(own) = reaction.moment {
                    assert!(own.distance(moment) < 1e-6, "{held} {entries}");
                }
                let turn = relaxed.shape.rods[j].nodes[0]
                    .rotation
                    .angle_between(scenario.rods[j].base_rotation());
                assert_eq!(turn < 1e-12, word == "clamped", "{held}: {turn:e}");
            }
        }
    }
}

/// A spring beside clamps and hinges has both as limits, each to first order.
#[test]
fn clamps_and_hinges_are_limits() {
    let tips = |word: &str| {
        let held = format!(r#"["clamped", "{word}", "pinned"]"#);
        settle(&veins(&held, "leaf.joined=false"), 1e-11).tips
    };
    let on_spring = |spring: f64| {
        let held = format!(r#"["clamped", "elastic", "pinned"], base_turn_stiffness = {spring:?}"#);
        settle(&veins(&held, "leaf.joined=false"), 1e-11).tips
    };
    for (limit, springs) in [("clamped", [1e4, 1e5]), ("pinned", [1e-4, 1e-5])] {
        let limit = tips(limit);
        let off = springs.map(|spring| {
            let tips = on_spring(spring);
            largest(tips.iter().zip(&limit).map(|(a, b)| a.distance(*b)))
        });
        let found = off[0] / off[1];
        assert!(
            (found / 10.0 - 1.0).abs() < 0.01 && off[1] < 1e-3,
            "{off:?}"
        );
    }
}

/// Veins that nothing ties are so many leaves of one vein.
#[test]
fn veins_apart_are_leaves_of_one_vein() {
    let all = veins(EACH_WAY[0], "leaf.joined=false");
    let options = iterated(1e-12, 16);
    let together = settled(&all, &options);
    for j in 0..3 {
        let mut one = all.clone();
        one.rods = vec![all.rods[j].clone()];
        one.base_held = vec![all.base_held[j]];
        one.base_turn_stiffness = vec![1.3];
        one.coupling.clear();
        one.dynamics.density.truncate(1);
        one.dynamics.rotary_inertia.truncate(1);
        let alone = settled(&one, &options);
        let (a, b) = (&together.shape.rods[j], &alone.shape.rods[0]);
        for (a, b) in a.nodes.iter().zip(&b.nodes) {
            let off = a.position.distance(b.position);
            assert!(off < 1e-12, "{j}: {off:e}");
        }
        let [a, b] = [&together.base_reactions[j], &alone.base_reactions[0]];
        assert!(a.force.distance(b.force) < 1e-11);
        assert_eq!(a.moment.is_some(), b.moment.is_some());
    }
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
        for entries in ["", TISSUE, COUPLING] {
            let base = base(&text(held), entries);
            let mut wanted = vec![
                "leaf.base[0][1]",
                "leaf.base[1][2]",
                "leaf.base[2][0]",
                "leaf.fan[0]",
                "leaf.fan[1]",
                "leaf.fan[2]",
                "leaf.elevation",
                "leaf.length[1]",
                "load.gravity[2]",
                "rest.bend_2[1]",
                "stiffness.torsion",
            ];
            match (held.contains("elastic"), held.contains("stiffness = [")) {
                (true, true) => wanted.push("leaf.base_turn_stiffness[2]"),
                (true, false) => wanted.push("leaf.base_turn_stiffness"),
                (false, _) => {}
            }
            assert_those_of_relaxations(&base, &wanted, &format!("{held} {entries}"));
        }
    }
}

/// One word for all is a list of this word, in a scenario that is written, too.
#[test]
fn a_list_of_one_word_is_the_word() {
    for word in ["clamped", "pinned"] {
        let list = veins(&format!("[{word:?}, {word:?}, {word:?}]"), "");
        let one = veins(&format!("{word:?}"), "");
        assert_eq!(list, one);
    }
    let mixed = veins(EACH_WAY[0], "");
    let written = serde_json::to_string(&mixed).unwrap();
    assert!(
        written.contains(r#""base_held":["clamped","elastic","pinned"]"#),
        "{written}"
    );
    assert_eq!(Scenario::from_toml(&written).unwrap(), mixed);
}

#[test]
fn what_makes_no_sense_is_refused() {
    for (held, why) in [
        (r#"["clamped", "pinned"]"#, "must have 3, one per rod"),
        (r#"["clamped", "pinned", "soft"]"#, "entry 3"),
        (r#"["clamped", "pinned", 1]"#, "\"elastic\""),
        (
            r#"["clamped", "pinned", "elastic"]"#,
            "leaf.base_turn_stiffness",
        ),
        (
            r#"["clamped", "pinned", "pinned"], base_turn_stiffness = 1.0"#,
            "add leaf.base_held = \"elastic\"",
        ),
    ] {
        let refused = Scenario::from_toml(&text(held)).unwrap_err().to_string();
        assert!(refused.contains(why), "{held}: {refused}");
    }
}
