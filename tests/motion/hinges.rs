//! Leaves on hinges, and on bases that springs hold, in motion.

use leafdyn_testing::motion::{BOTH, at, rest};
use leafdyn_testing::*;

/// How bases are held.
const HELD: [&str; 3] = [
    "\"pinned\"",
    "\"elastic\", base_turn_stiffness = [0.8, 2.0, 0.3]",
    "[\"pinned\", \"clamped\", \"elastic\"], base_turn_stiffness = 0.3",
];

/// Undamped veins with tissue on bases that are not in line and so held.
fn veins(held: &str) -> Scenario {
    let text = r#"
        name = "veins"
        leaf = { rods = 3, length = [1.0, 0.9, 1.1], fan = [0.2, 0.0, -0.2], base = [[0.0, -0.2, 0.0], [0.1, 0.0, 0.15], [0.0, 0.2, 0.0]], base_held = HELD }
        stiffness = { torsion = 0.8, bending_2 = 1.0, bending_3 = 2.0, axial = 100.0, shear_2 = 60.0, shear_3 = 80.0 }
        tissue = { along = 20.0, across = 10.0, normal = 15.0, fold = 0.4 }
        load.gravity = [0.0, 0.3, -2.0]
        dynamics = { density = 1.0, rotary_inertia = 0.01, external_damping = 0.0 }
    "#;
    base(&text.replace("HELD", held), "").scenario().clone()
}

/// Let go under more weight than before, both methods are of second order, and lead to the same motion;
/// bases stay, and turn where nothing clamps them.
#[test]
fn both_methods_tell_the_same_motion() {
    HELD.into_iter().for_each(is_told_by_both_methods);
}

fn is_told_by_both_methods(held: &str) {
    let scenario = veins(held);
    let leaf = Leaf::new(&scenario);
    let mut before = scenario.clone();
    before.dynamics.gravity = Schedule::constant([0.0, 0.3, -1.0]);
    let start = rest(&before, 8);
    let positions = |k: usize, h: f64| -> Vec<f64> {
        let state = at(BOTH[k], &leaf, &start, h, 1.0).state;
        for j in 0..3 {
            let base = start.base(j);
            assert_eq!(state.x[base], start.x[base]);
            let turned = state.q[base].angle_between(start.q[base]);
            match scenario.base_held[j].word() {
                "clamped" => assert_eq!(turned, 0.0),
                _ => assert!(turned > 0.01, "{held}: {turned}"),
            }
        }
        state.x.iter().flat_map(|x| x.to_array()).collect()
    };
    let apart = |a: &[f64], b: &[f64]| largest(a.iter().zip(b).map(|(a, b)| (a - b).abs()));
    let mut limits = Vec::new();
    for k in 0..2 {
        let [coarse, middle, fine] = [1e-3, 5e-4, 2.5e-4].map(|h| positions(k, h));
        let (one, two) = (apart(&coarse, &middle), apart(&middle, &fine));
        close(&format!("{:?}", BOTH[k]), order(one, two), 2.0, 0.1);
        let limit = fine.iter().zip(&middle).map(|(f, m)| f + (f - m) / 3.0);
        limits.push(limit.collect::<Vec<_>>());
    }
    let off = apart(&limits[0], &limits[1]);
    assert!(off < 1e-6, "{off:e}");
}

/// A leaf at rest stays there.
#[test]
fn what_rests_on_hinges_and_springs_does_not_move() {
    for (held, scheme) in HELD.into_iter().flat_map(|held| BOTH.map(|it| (held, it))) {
        let leaf = Leaf::new(&veins(held));
        let state = rest(&veins(held), 8);
        let now = at(scheme, &leaf, &state, 1e-3, 0.5).state;
        let moved = largest(now.x.iter().zip(&state.x).map(|(a, b)| a.distance(*b)));
        assert!(moved < 1e-9, "{scheme:?}: {moved:e}");
    }
}
