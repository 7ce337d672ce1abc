//! Derivatives of leaves under loads without a potential, in wind and under loads that turn with the section: those of
//! whole relaxations, and of a closed form.

use crate::sensitivities::{derivatives, keys};
use leafdyn_testing::*;

const LOADS: &str = r#"
    [load]
    gravity = [0.1, 0.2, -0.5]
    follower = [0.2, -0.4, 0.8]
    couple = [0.3, 0.5, -0.2]
    [[load.point]]
    vein = 1
    at = 0.5
    force = [0.4, 0.3, -0.5]
    moment = [0.2, -0.3, 0.4]
    offset = [0.1, -0.05]
    follows = true
"#;

const VEINS: &str = r#"
    name = "veins"
    leaf = { rods = 2, length = [1.0, 0.9], fan = [0.3, -0.2], base = [[0.0, -0.1, 0.0], [0.0, 0.1, 0.0]], base_held = HELD }
    stiffness = { torsion = 0.8, bending_2 = 1.0, bending_3 = 1.4, axial = 60.0, shear_2 = 70.0, shear_3 = 50.0 }
    coupling = { x = 1.0, y = 2.0, z = 1.5 }
"#;

const WIND: &str = r#"
    [load]
    gravity = [0.0, 0.1, -0.5]
    [wind]
    velocity = [0.5, 0.8, 1.0]
    density = 1.2
    drag = 2.0
    width = 0.3
"#;

const GRIP: &str = r#"
    [[grip]]
    vein = 2
    at = [0.25, 0.5]
    stiffness = [0.0, inf, 4.0]
    move = [0.0, 0.03, 0.05]
"#;

const COMMON: [&str; 8] = [
    "leaf.base[0][1]",
    "leaf.length[0]",
    "leaf.fan[1]",
    "leaf.elevation",
    "load.gravity[2]",
    "stiffness.bending_2",
    "rest.bend_2",
    "rest.stretch",
];
const OF_LOADS: [&str; 6] = [
    "load.follower[2]",
    "load.couple[0]",
    "load.point[0].force[1]",
    "load.point[0].moment[2]",
    "load.point[0].offset[0]",
    "load.couple[2]",
];
const OF_WIND: [&str; 4] = [
    "wind.velocity[1]",
    "wind.density",
    "wind.drag",
    "wind.width",
];

/// Tips, positions and the forces on grips.
fn results(leaf: &Equilibrium) -> Vec<f64> {
    let places = leaf.tips.iter().copied();
    let nodes = nodes(&leaf.shape.rods).map(|node| node.position);
    let grips = leaf.grip_reactions.iter().map(|grip| grip.force);
    (places.chain(nodes).chain(grips))
        .flat_map(|it| it.to_array())
        .collect()
}

/// On one grid, which leaves no doubt about what is differenced.
#[test]
fn they_are_those_of_whole_relaxations() {
    let clamped = r#""clamped""#;
    let mixed = r#"["elastic", "clamped"], base_turn_stiffness = 2.0"#;
    for (held, more, own) in [
        (clamped, LOADS.to_string(), &OF_LOADS[..]),
        (clamped, format!("{LOADS}{GRIP}"), &OF_LOADS[..]),
        (mixed, LOADS.to_string(), &OF_LOADS[..]),
        (clamped, WIND.to_string(), &OF_WIND[..]),
        (clamped, format!("{WIND}{GRIP}"), &OF_WIND[..]),
    ] {
        let text = format!("{}{more}", VEINS.replace("HELD", held));
        let base = base(&text, "");
        let wanted: Vec<&str> = COMMON.iter().chain(own).copied().collect();
        let options = iterated(1e-10, 8);
        let (leaf, found) = derivatives(&base, &wanted, &options);
        assert!(leaf.energy.is_none() && found.len() == wanted.len());
        let units = results(&leaf);
        for (key, found) in keys(&wanted).iter().zip(&found) {
            let value = base.differentiable_value(key).unwrap();
            let size = if value == 0.0 { 1.0 } else { value.abs() };
            let at = |steps: f64| {
                let value = value + 2e-3 * steps * size;
                let scenario = base.scenario_with_values(&[(key, value)]).unwrap().scenario;
                results(&relaxed(&scenario, &options))
            };
            let [a, b, c, d] = [-2.0, -1.0, 1.0, 2.0].map(at);
            let ours: Vec<f64> = (found
                .tips
                .iter()
                .chain(found.positions.iter().flatten())
                .copied())
            .chain(found.grip_reactions.iter().map(|grip| grip.force))
            .flat_map(|it| it.to_array())
            .collect();
            assert_eq!(ours.len(), a.len());
            assert!(found.energy.is_nan() && found.lowest_eigenvalue.is_none());
            for (k, ours) in ours.iter().enumerate() {
                let theirs = (a[k] - d[k] + 8.0 * (c[k] - b[k])) / (12.0 * 2e-3 * size);
                let off = (ours - theirs).abs() * size;
                let unit = units[k].abs().max(1.0) + theirs.abs() * size;
                assert!(
                    off < 3e-7 * unit,
                    "{held} {key} {k}: {ours} {theirs}\n{more}"
                );
            }
        }
    }
}

/// A moment per radian that turns with the tip bends a rod to the angle M L/EI, whose tip is at (sin a, 1 - cos a)/a.
#[test]
fn a_moment_that_turns_bends_a_rod_to_a_circle() {
    let text = r#"
        name = "rod"
        leaf = { rods = 1, length = 1.0, fan = [0.0] }
        stiffness = { torsion = 1.0, bending_2 = 2.0, bending_3 = 2.0, axial = inf, shear_2 = inf, shear_3 = inf }
        load = { point = [{ vein = 1, at = 1.0, moment = [0.0, 0.0, 3.0], follows = true }] }
    "#;
    let base = base(text, "");
    let wanted = ["load.point[0].moment[2]", "stiffness.bending_3"];
    let (_, found) = derivatives(&base, &wanted, &to(1e-8));
    let a = 1.5_f64;
    let rate = [
        (a * a.cos() - a.sin()) / (a * a),
        (a * a.sin() - 1.0 + a.cos()) / (a * a),
    ];
    for (found, angle) in found.iter().zip([0.5, -0.75]) {
        for (k, rate) in rate.iter().enumerate() {
            let (own, exact) = (found.tips[0][k], angle * rate);
            assert!((own - exact).abs() < 1e-7, "{}: {own} {exact}", found.key);
            let told = found.tip_error.unwrap();
            assert!((own - exact).abs() < told + 1e-9, "{}: {told:e}", found.key);
        }
    }
}

/// The drag of a velocity v is |v| v: at rest its derivative is zero, and in a weak wind that across it is |v|, however
/// weak.
#[test]
fn velocities_of_air_at_rest_and_of_a_weak_wind() {
    let across = |velocity: &str| {
        let veins = VEINS.replace("HELD", "\"clamped\"");
        let base = base(
            &format!("{veins}{WIND}"),
            &format!("wind.velocity={velocity}"),
        );
        let options = iterated(1e-11, 12);
        let (_, found) = crate::sensitivities::derivatives(&base, &["wind.velocity[0]"], &options);
        found[0].tips[0].length()
    };
    for at_rest in [
        "[0.0, 0.0, 0.0]",
        "[1e-300, 0.0, 0.0]",
        "[0.0, 0.0, -1e-200]",
    ] {
        assert!(across(at_rest) < 1e-9, "{at_rest}");
    }
    let [weak, weaker] = ["[0.0, 1e-3, 1e-3]", "[0.0, 1e-4, 1e-4]"].map(across);
    assert!((weak / weaker - 10.0).abs() < 1e-3, "{weak} {weaker}");
}
