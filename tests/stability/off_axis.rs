//! Loads and masses off the axis: where they tip over, and how they vibrate.

use leafdyn::study::trace;
use leafdyn_testing::branch::{changes_at, request};
use leafdyn_testing::*;

/// A rod along e1 of torsion 0.7 that hardly bends, with a force down at its tip off the axis.
const ARM: &str = r#"
    name = "arm"
    leaf = { rods = 1, length = 1.3, fan = [0.0] }
    stiffness = { torsion = 0.7, bending_2 = 1e4, bending_3 = 1e4, axial = inf, shear_2 = inf, shear_3 = inf }
    load.point = [{ vein = 1, at = 1.0, force = [0.0, 0.0, -1.0], offset = [0.0, 0.25] }]
"#;

/// A weight above a rod tips over at F o = GJ/L, in a pitchfork: the new shapes are those of F o sin p = GJ p/L. A
/// weight below it never does.
#[test]
fn a_weight_above_a_rod_tips_over() {
    let critical = 0.7 / 1.3 / 0.25;
    let mut above = request(base(ARM, ""), "load.point[0].force[2]=-1..-3", 1e-9, 2000);
    above.switch = true;
    let found = trace(&above, &mut |_, _, _| {}).unwrap();
    changes_at("above", &found, &[(-critical, 1)], 1e-5);
    assert!(found.branches.len() >= 2, "{}", found.branches.len());
    let mut compared = 0;
    for point in found.branches[1..].iter().flat_map(|branch| &branch.points) {
        assert_eq!(point.index, 0);
        // The energy tells the twist.
        let lever = -point.value * 0.25;
        let twist = (1..=60).fold(2.0_f64, |p, _| lever * p.sin() * 1.3 / 0.7);
        if lever > 1.05 * 0.7 / 1.3 {
            let energy = 0.5 * 0.7 / 1.3 * twist * twist + lever * twist.cos();
            compared += 1;
            close("energy", point.energy, energy, 1e-3);
        }
    }
    assert!(compared >= 2, "{compared}");
    let below = request(
        base(ARM, "load.point[0].offset=[0.0, -0.25]"),
        "load.point[0].force[2]=-1..-3",
        1e-9,
        2000,
    );
    changes_at(
        "below",
        &trace(&below, &mut |_, _, _| {}).unwrap(),
        &[],
        1e-7,
    );
    // The index on either side.
    for (load, index) in [(0.99, 0), (1.01, 1)] {
        let force = format!("load.point[0].force[2]={:?}", -load * critical);
        let leaf = kept(
            &Scenario::from_toml_with(ARM, "arm", &entries(&force)).unwrap(),
            1e-8,
        );
        assert_eq!(leaf.stability.negative_eigenvalues, Some(index), "{load}");
    }
}

/// The lowest squared frequencies of a light cantilever of bending and torsion stiffness with a mass beside its tip,
/// extrapolated to one without mass of its own.
fn squared_frequencies(offset: [f64; 2], count: usize) -> Vec<f64> {
    let of = |density: f64| -> Vec<f64> {
        let scenario = parse(&format!(
            r#"
            name = "arm"
            leaf = {{ rods = 1, length = 1.3, fan = [0.0] }}
            stiffness = {{ torsion = 0.7, bending_2 = 1.1, bending_3 = 1.9, axial = inf, shear_2 = inf, shear_3 = inf }}
            load.point = [{{ vein = 1, at = 1.0, mass = 0.8, offset = {offset:?} }}]
            dynamics = {{ density = {density:?}, rotary_inertia = {:?} }}
            "#,
            1e-3 * density
        ));
        let leaf = settled(&scenario, &with_modes(count, at_every_node(1e-8)));
        let modes = leaf.stability.modes.as_ref().expect("modes are found");
        modes.iter().map(|mode| mode.eigenvalue).collect()
    };
    let light = [4e-3, 2e-3, 1e-3].map(of);
    (0..count)
        .map(|k| {
            let [a, b, c] = [0, 1, 2].map(|of| light[of][k]);
            let [first, second] = [2.0 * b - a, 2.0 * c - b];
            (4.0 * second - first) / 3.0
        })
        .collect()
}

/// Out of the plane of the arm the mass m at o moves by w + o p: 1/omega^2 = m (L^3/3A2 + o^2 L/A1). In its plane the
/// tip moves and turns, with the masses m and m o^2: two modes.
#[test]
fn a_mass_beside_a_light_rod_swings() {
    let (mass, offset, length) = (0.8, 0.4, 1.3_f64);
    let flexible = |bending: f64| {
        let [moved, turned, both] = [length.powi(3) / 3.0, length, 0.5 * length * length];
        [moved, turned, both].map(|it| it / bending)
    };
    let [moved, _, _] = flexible(1.1);
    let across = 1.0 / (mass * (moved + offset * offset * length / 0.7));
    // The eigenvalues of flexibility times mass.
    let [a, b, c] = flexible(1.9);
    let (a, b, c) = (mass * a, mass * offset * offset * b, mass * offset * c);
    let root = ((0.5 * (a - b)).powi(2) + c * c).sqrt();
    let mut wanted = vec![
        across,
        1.0 / (0.5 * (a + b) + root),
        1.0 / (0.5 * (a + b) - root),
    ];
    wanted.sort_by(f64::total_cmp);
    let found = squared_frequencies([offset, 0.0], 3);
    for (found, wanted) in found.iter().zip(&wanted) {
        let off = (found / wanted - 1.0).abs();
        println!("{found} {wanted} {off:e}");
        assert!(off < 1e-5, "{found} for {wanted}");
    }
}

/// Small motions without a potential have the same frequencies: here the load that follows is too small to matter.
#[test]
fn small_motions_have_the_same_masses() {
    let text = r#"
        name = "leaf"
        leaf = { rods = 2, length = 1.0, fan = "symmetric" }
        stiffness = { torsion = 0.7, bending_2 = 1.0, bending_3 = 1.4, axial = 40.0, shear_2 = 50.0, shear_3 = 60.0 }
        load.g = [0.1, 0.0, -0.5]
        load.point = [
            { vein = 1, at = 1.0, mass = 0.5, offset = [0.3, 0.1] },
            { vein = 2, at = 0.5, mass = 0.4, offset = [-0.2, 0.2] },
        ]
        dynamics = { density = 1.0, rotary_inertia = 0.01, external_damping = 0.0 }
    "#;
    let modes = settled(&parse(text), &with_modes(4, at_every_node(1e-8)));
    let follower = format!("{text}\nload.follower = [0.0, 1e-12, 0.0]");
    let motions = settled(&parse(&follower), &with_modes(4, at_every_node(1e-8)));
    let small = motions.stability.small_motions.as_ref().unwrap();
    let modes = modes.stability.modes.as_ref().unwrap();
    for (frequency, mode) in small.frequencies.iter().zip(modes) {
        let off = (frequency * frequency / mode.eigenvalue - 1.0).abs();
        assert!(off < 1e-5, "{frequency} {}", mode.eigenvalue);
    }
}
