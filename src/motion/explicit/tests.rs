use crate::leaf::{Grid, Leaf};
use crate::motion::explicit::*;
use crate::relax::initial_state;
use crate::scenario::Scenario;
use std::collections::HashSet;

const LEAF: &str = r#"
    name = "leaf"
    leaf = { rods = 3, length = [1.0, 1.1, 0.9], fan = "paper" }
    stiffness = { torsion = 1.2, bending_2 = 0.7, bending_3 = [1.0, 2.0, 0.5], axial = 90.0, shear_2 = 50.0, shear_3 = 70.0 }
    rest = { twist = 0.3, bend_2 = [0.5, 1.0, 0.0], bend_3 = 0.7, stretch = 1.05 }
    coupling = { x = 3.0, y = 1.0, z = 2.0 }
    load = { gravity = [0.1, -0.3, -1.0], tip_force = [0.3, 0.2, 0.1] }
"#;

fn discrete(toml: &str, segments: usize) -> DiscreteLeaf {
    let leaf = Leaf::new(&Scenario::from_toml(toml).unwrap());
    DiscreteLeaf::new(&leaf, Grid::new(segments, &[]))
}

fn explicit(leaf: DiscreteLeaf, state: &State) -> Explicit {
    let physics = Physics::new(&leaf.leaf);
    Explicit::new(leaf, physics, state, None).unwrap()
}

/// Several rods in a block, one, up to its end, and beyond: with one node, and with many.
const SEGMENTS: [usize; 9] = [1, 2, 3, 4, 100, 222, 223, 224, 250];

/// Curved and twisted, and strained by some percent.
fn bent(leaf: &DiscreteLeaf) -> State {
    let (mut state, n) = (initial_state(leaf), leaf.segments());
    for (j, i) in leaf.rod_index_pairs(1..=n) {
        let s = i as f64 / n as f64;
        let tip = if i == n { 0 } else { j };
        let phase = 5.0 * s + tip as f64;
        let turn = DVec3::new(phase.sin(), s, phase.cos()) * s;
        let shift = DVec3::new(phase.cos(), phase.sin(), s) * (0.02 * s * (1.5 - s));
        // No segment is bent by more than a grid resolves.
        let turn = turn * (n as f64 / 8.0).min(1.0);
        let increment = [turn.x, turn.y, turn.z, shift.x, shift.y, shift.z];
        state.advance_node(state.base(j) + i, &increment, 1.0);
    }
    state
}

/// Force and moment on every node from the gradient of the element's energy.
fn element_node_loads(leaf: &DiscreteLeaf, state: &State) -> Vec<(DVec3, DVec3)> {
    let mut all = vec![(DVec3::ZERO, DVec3::ZERO); state.x.len()];
    for (j, i) in leaf.rod_index_pairs(0..=leaf.segments()) {
        let k = state.base(j) + i;
        let load = leaf.load(state, j, i);
        all[k] = (all[k].0 + load.force, all[k].1 + load.moment);
        if i < leaf.segments() {
            let section = leaf.section(j, i);
            let segment = leaf.strained_segment(state, j, i);
            let slopes = segment.gradient(section);
            all[k] = (all[k].0 + slopes.x, all[k].1 - slopes.a);
            all[k + 1] = (all[k + 1].0 - slopes.x, all[k + 1].1 - slopes.b);
        }
    }
    all
}

/// The forces of the loops are the gradient of the energy that the relaxation
/// minimizes, with all instruction sets of the processor.
#[test]
fn forces_are_those_of_the_element() {
    // Several rods at a time, and their sections round and straight at rest.
    let alike = LEAF.replace("[1.0, 1.1, 0.9]", "1.0");
    let alike = alike.replace("[1.0, 2.0, 0.5], axial", "2.0, axial");
    let bend_2 = "bend_2 = { at = [0.0, 1.0], value = [0.5, 1.0] }";
    let alike = alike.replace("bend_2 = [0.5, 1.0, 0.0]", bend_2);
    let round = alike.replace("2.0, axial", "0.7, axial");
    let round = round.replace("shear_3 = 70.0", "shear_3 = 50.0");
    let round = round.replace(&format!("{bend_2}, bend_3 = 0.7, "), "");
    // Veins that tissue ties have rest strains in all directions.
    let tissue = "tissue = { along = 3.0, across = 2.0, normal = 1.0, fold = 0.2 }";
    let tied = LEAF.replace("coupling = { x = 3.0, y = 1.0, z = 2.0 }", tissue);
    for n in SEGMENTS {
        for toml in [LEAF, &alike, &round, &tied] {
            forces_are_those(&discrete(toml, n));
        }
    }
    let explicit = |toml: &str| {
        let leaf = discrete(toml, 100);
        let state = initial_state(&leaf);
        explicit(leaf, &state)
    };
    assert_eq!(
        [LEAF, &alike].map(|toml| explicit(toml).layout.rods_per_pack),
        [1, 2]
    );
    let is_round = |toml: &str| explicit(toml).packs[0].material[0].round;
    assert_eq!([&alike, &round].map(|toml| is_round(toml)), [false, true]);
}

fn forces_are_those(leaf: &DiscreteLeaf) {
    let (n, state) = (leaf.segments(), bent(leaf));
    let expected = element_node_loads(leaf, &state);
    let largest = expected.iter().map(|(f, m)| f.length().max(m.length()));
    // Of many segments, differences of larger forces are left.
    let rounding = 1e-14 * n.max(100) as f64;
    let allowed = rounding * largest.fold(0.0, f64::max);
    let narrower = match widest_arch() {
        #[cfg(target_arch = "x86_64")]
        Arch::V4(simd) => Arch::V3(*simd),
        arch => arch,
    };
    for arch in [widest_arch(), narrower, Arch::Scalar] {
        let mut explicit = explicit(leaf.clone(), &state);
        explicit.arch = arch;
        explicit.set_damping(0.0);
        let h = 1e-6;
        explicit.kick_and_drift(h);
        let mut tip = DVec3::ZERO;
        for (j, i) in leaf.rod_index_pairs(1..=n) {
            let momentum = explicit.momentum(j, i);
            let (v, p) = (momentum.velocity, momentum.angular);
            let (force, moment) = expected[state.base(j) + i];
            let moment_error = (p / (0.5 * h) - moment).length();
            assert!(moment_error < allowed, "{j} {i}: {moment_error}");
            if i == n {
                tip += force;
            } else {
                let PackPosition { pack, entry } = explicit.layout.pack_position(j, i);
                let material = explicit.packs[pack].node_material(entry);
                let mass = material.block.mass[material.node];
                let error = (v * (mass / (0.5 * h)) - force).length();
                assert!(error < allowed, "{j} {i}: {error}");
            }
        }
        let v = explicit.momentum(2, n).velocity;
        let error = (v * (explicit.tip_mass.unwrap() / (0.5 * h)) - tip).length();
        assert!(error < allowed, "tip: {error}");
        // Clamped ends do not move.
        assert_eq!(explicit.state().x[0], DVec3::ZERO);
    }
}

/// Blocks common to rods are stored once.
#[test]
fn like_blocks_are_shared() {
    let distinct = |rods: &str, segments: usize| {
        let toml = LEAF.lines().map(|line| match line.trim() {
            line if line.starts_with("leaf =") => format!("leaf = {{ {rods}, fan = \"paper\" }}\n"),
            line if line.starts_with("rest =") => "rest = { bend_2 = 1.0 }\n".to_string(),
            line => format!("{}\n", line.replace("[1.0, 2.0, 0.5]", "1.0")),
        });
        let leaf = discrete(&toml.collect::<String>(), segments);
        let state = initial_state(&leaf);
        let explicit = explicit(leaf, &state);
        let blocks = explicit.packs.iter().flat_map(|pack| &pack.material);
        let places: Vec<_> = blocks.map(std::sync::Arc::as_ptr).collect();
        (places.iter().collect::<HashSet<_>>().len(), places.len())
    };
    // The clamped end, the middle and the tip.
    assert_eq!(distinct("rods = 1, length = 1.0", 1000), (3, 5));
    // Four rods at a time: the first and the last have one neighbor.
    assert_eq!(distinct("rods = 13, length = 1.0", 50), (3, 4));
    assert_eq!(distinct("rods = 3, length = [1.0, 1.0, 1.1]", 50), (3, 3));
}

/// A constant factor of the rest curvature is equivalent to other curvatures.
#[test]
fn a_constant_factor_of_the_rest_curvature_counts() {
    let after = |toml: &str| {
        let leaf = discrete(toml, 20);
        let state = bent(&leaf);
        let mut explicit = explicit(leaf, &state);
        for _ in 0..100 {
            explicit.step(1e-4);
        }
        explicit.present_state()
    };
    let half = LEAF.replace(
        "rest = {",
        "dynamics.rest = { at = [0.0], factor = [0.5] }\nrest = {",
    );
    let halved = LEAF.replace(
        "twist = 0.3, bend_2 = [0.5, 1.0, 0.0], bend_3 = 0.7",
        "twist = 0.15, bend_2 = [0.25, 0.5, 0.0], bend_3 = 0.35",
    );
    let (half, halved) = (after(&half), after(&halved));
    assert_eq!(half.x, halved.x);
    assert_eq!(half.n, halved.n);
    assert_ne!(half.x, after(LEAF).x);
}

/// A rotation that cannot be computed is none that the grid resolves.
#[test]
fn what_is_not_a_number_is_not_trusted() {
    let leaf = discrete(LEAF, 8);
    let trusted = |state: &State| {
        let physics = Physics::new(&leaf.leaf);
        let explicit = Explicit::new(leaf.clone(), physics, state, Some(1e-3));
        explicit.unwrap().is_reliable()
    };
    let mut state = initial_state(&leaf);
    assert!(trusted(&state));
    state.q[3] = DQuat::from_xyzw(f64::NAN, 0.0, 0.0, 1.0);
    assert!(!trusted(&state));
    assert!(check_resolution(&leaf, 0.0, 0.1).is_ok());
    assert!(check_resolution(&leaf, 0.0, f64::NAN).is_err());
}
