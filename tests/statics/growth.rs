//! Growth of the rest length: a vein rests at v0 = (stretch, 0, 0). By
//! definition a leaf that has grown by g, of length L and the stiffnesses A and
//! H, is a leaf of length g L with g A and g H that has not.

use leafdyn_testing::motion::{BOTH, moving, run};
use leafdyn_testing::*;

/// A rod of length two.
fn rod(overrides: &str) -> Scenario {
    leafdyn_testing::rod(&format!("leaf.length=2.0; {overrides}"))
}

/// What is said of a leaf, written for a growth of `g` that is either a factor
/// of the rest length or already in the reference length.
fn leaf(g: f64, in_stretch: bool) -> Scenario {
    let (long, stretch) = if in_stretch { (1.0, g) } else { (g, 1.0) };
    let (per, times) = (1.0 / long, long);
    let list = |values: &[f64], factor: f64| {
        let values: Vec<f64> = values.iter().map(|v| v * factor).collect();
        format!("{values:?}")
    };
    parse(&format!(
        r#"
        name = "leaf"
        leaf = {{ rods = 3, length = {}, fan = "paper" }}
        stiffness = {{ torsion = {:?}, bending_2 = {}, bending_3 = {:?}, axial = {:?}, shear_2 = {:?}, shear_3 = {:?} }}
        rest = {{ stretch = {stretch:?}, twist = {:?}, bend_2 = {} }}
        coupling = {{ y = {:?}, z = {} }}
        load = {{ gravity = {}, tip_force = [0.3, 0.1, -0.2] }}
        dynamics = {{ density = {:?}, rotary_inertia = {:?}, external_damping = {:?}, internal_damping = 0.01, duration = 1.0 }}
        "#,
        list(&[1.0, 1.1, 0.9], long),
        0.8 * times,
        list(&[1.0, 0.5, 1.5], times),
        1.2 * times,
        60.0 * times,
        40.0 * times,
        50.0 * times,
        0.3 * per,
        list(&[0.5, -0.4, 0.2], per),
        2.0 * per,
        list(&[1.0, 3.0], per),
        list(&[0.1, 0.2, -1.5], per),
        1.3 * per,
        0.02 * per,
        0.8 * per,
    ))
}

#[test]
fn a_vein_without_loads_is_as_long_as_it_has_grown() {
    for (stretch, length) in [
        ("1.3", 2.6),
        ("0.5", 1.0),
        ("[1.25]", 2.5),
        ("{ at = [0.0, 0.3, 1.0], value = [1.0, 1.5, 2.0] }", 3.2),
    ] {
        let leaf = settle(&rod(&format!("rest.stretch={stretch}")), TIGHT);
        let tip = leaf.tips[0];
        assert!((tip.x - length).abs() < 1e-14, "{stretch}: {tip}");
        assert!(tip.y.hypot(tip.z) < 1e-14 && leaf.energy.unwrap().abs() < 1e-14);
    }
}

#[test]
fn a_rigid_vein_keeps_its_stretch_under_load() {
    let rigid = "rest.stretch=1.4; stiffness.axial=inf; load.tip_force=[3.0, 1.0, 2.0]";
    let leaf = settle(&rod(rigid), 1e-9);
    for node in &leaf.shape.rods[0].nodes {
        assert_eq!(node.v.x, 1.4);
        assert!((node.v.y - node.n.y / 100.0).abs() < 1e-15);
    }
}

#[test]
fn tension_adds_to_growth() {
    let pulled = rod("rest.stretch=1.4; load.tip_force=[5.0, 0.0, 0.0]");
    let leaf = settle(&pulled, TIGHT);
    assert!((leaf.tips[0].x - 2.0 * (1.4 + 0.05)).abs() < 1e-13);
    let mut nodes = leaf.shape.rods[0].nodes.iter();
    assert!(nodes.all(|node| (node.n.x - 5.0).abs() < 1e-12));
    // Elastic energy less the work of the load, both from the grown length on.
    let energy = 0.5 * 5.0 * 5.0 / 100.0 * 2.0 - 5.0 * leaf.tips[0].x;
    assert!((leaf.energy.unwrap() - energy).abs() < 1e-12);
}

#[test]
fn it_is_a_longer_and_stiffer_leaf() {
    for g in [0.7, 1.2] {
        let (grown, long) = (leaf(g, true), leaf(g, false));
        let [a, b] = [&grown, &long].map(|scenario| settle(scenario, 1e-10));
        let tips = a.tips[0] - b.tips[0];
        assert!(tips.length() < 1e-9, "{g}: {tips}");
        assert!((a.energy.unwrap() - b.energy.unwrap()).abs() < 1e-9, "{g}");
        let [one, other] = [&a, &b].map(|leaf| leaf.stability.negative_eigenvalues);
        assert_eq!(one, other);
        for (a, b) in a.shape.rods.iter().zip(&b.shape.rods) {
            for (a, b) in a.nodes.iter().zip(&b.nodes) {
                assert!((a.position - b.position).length() < 1e-9);
                assert!((a.v - g * b.v).length() < 1e-9);
                assert!((a.u - g * b.u).length() < 1e-8);
                assert!((a.n - b.n).length() < 1e-7 && (a.m - b.m).length() < 1e-7);
            }
        }
    }
}

/// The same while it moves, with friction inside and out.
#[test]
fn and_moves_like_it() {
    for scheme in BOTH {
        let [a, b] = [true, false].map(|in_stretch| {
            let scenario = leaf(1.2, in_stretch);
            let mut options = moving(scheme, Some(12));
            options.step = Some(1e-3);
            let frame = run(&scenario, &options);
            (frame.positions, frame.energy)
        });
        let off = a.0.iter().zip(&b.0).map(|(a, b)| (*a - *b).length());
        let off = off.fold(0.0, f64::max);
        assert!(off < 1e-9, "{scheme:?}: {off:.1e}");
        assert!((a.1.elastic - b.1.elastic).abs() < 1e-8);
        assert!((a.1.dissipated - b.1.dissipated).abs() < 1e-8);
    }
}

const GROWN: [&str; 3] = [
    "rest.stretch=[1.2, 1.0, 0.95]",
    "rest.stretch={ at = [0.0, 0.4, 1.0], value = [1.0, 1.3, 1.1] }",
    "rest.stretch={ at = [0.0, 0.5, 1.0], value = [[1.0, 1.2, 1.0], [1.0, 1.0, 1.0], [1.1, 1.3, 0.8]] }",
];

fn fan(entry: &str) -> Scenario {
    let text = r#"
        name = "fan"
        leaf = { rods = 3, length = 1.0, fan = "symmetric" }
        stiffness = { torsion = 0.8, bending_2 = 1.0, bending_3 = 1.2, axial = 60.0, shear_2 = 40.0, shear_3 = 50.0 }
        coupling = { y = 1.0, z = 2.0 }
        load = { gravity = [0.0, 0.0, -1.0] }
    "#;
    Scenario::from_toml_with(text, "fan", &[entry.into()]).unwrap()
}

#[test]
fn relaxation_and_shooting_agree_on_lists_and_profiles() {
    for entry in GROWN {
        all_agree(entry, &fan(entry));
    }
}

#[test]
fn explicit_motion_agrees() {
    for entry in GROWN {
        let scenario = fan(entry);
        let explicit = Method::Explicit { segments: Some(16) };
        let explicit = by(explicit, Options::default());
        let [explicit, implicit] =
            [explicit, on(16)].map(|how| relaxed(&scenario, &how).shape.rods);
        let apart = apart(&scenario, &explicit, &implicit).position;
        assert!(apart < 1e-8, "{entry}: {apart:.1e}");
    }
}

/// Half of a leaf whose margins have grown alike is solved, and it is the whole.
#[test]
fn a_mirrored_leaf_is_solved_by_half() {
    let scenario = fan("rest.stretch=[1.2, 1.0, 1.2]");
    let half = settle(&scenario, 1e-9);
    assert_eq!(half.model.rods, 2);
    let whole = relaxed(&scenario, &in_full(to(1e-9)));
    assert!(apart(&scenario, &half.shape.rods, &whole.shape.rods).position < 2e-9);
}

#[test]
fn impossible_growth_is_refused() {
    let table = "
        0.0 => must be greater than 0
        -1.0 => must be greater than 0
        inf => rest.stretch
        2e3 => v0 = 2.000e3, the limit is 1e3
        1e-4 => v0 = 1.000e-4, the limit is 1e-3
        [1.0, 1.0] => rest.stretch
        'long' => rest.stretch
        { at = [0.0, 1.0], value = [1.0, 0.0] } => must be greater than 0
    ";
    for (value, part) in pairs(table) {
        let entry = format!("rest.stretch={value}");
        let refused = Scenario::from_toml_with(ROD, "rod", &[entry]).unwrap_err();
        let message = refused.to_string();
        assert!(message.contains(part), "{value}: {message}");
        assert!(message.contains("rest.stretch"), "{value}: {message}");
    }
}
