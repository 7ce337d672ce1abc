//! Leaves on hinges, and on bases that springs hold, in motion.

use glam::DQuat;
use leafdyn::relax::relax;
use leafdyn::scenario::{BaseSpin, PolarInertia};
use leafdyn::study::BaseScenario;
use leafdyn_testing::motion::{BOTH, Scheme, at, energy_imbalance, rest};
use leafdyn_testing::vibration::{displaced, modes};
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

/// Undamped veins with tissue on hinges that hold their spin, in space.
fn spinless() -> Scenario {
    let mut scenario = veins(HELD[0]);
    scenario.base_spin = BaseSpin::Held;
    scenario
}

/// Let go under more weight than before, the frames of bases are turned by the shortest turns of their tangents all the
/// time; both methods are of second order in the step, as is what is missing of the energy, and lead to the same motion.
#[test]
fn a_held_spin_is_held_in_motion() {
    let mut scenario = spinless();
    // Of three different moments of inertia.
    scenario.dynamics.rotary_inertia = vec![[0.01, 0.025].map(Profile::Constant); 3];
    scenario.dynamics.polar_inertia = PolarInertia::Sum;
    let leaf = Leaf::new(&scenario);
    let mut before = scenario.clone();
    before.dynamics.gravity = Schedule::constant([0.0, 2.0, -1.0]);
    let start = rest(&before, 8);
    let positions = |scheme: Scheme, h: f64| -> Vec<f64> {
        let now = at(scheme, &leaf, &start, h, 1.0);
        for (j, rod) in scenario.rods.iter().enumerate() {
            let natural = rod.base_rotation();
            let base = now.state.base(j);
            let q = now.state.q[base];
            let [from, to] = [natural, q].map(|q| q * DVec3::X);
            let wanted = DQuat::from_rotation_arc(from, to) * natural;
            assert!(q.angle_between(wanted) < 1e-7);
            assert!(q.angle_between(start.q[base]) > 0.05);
            let spin = now.velocity[base].angular.dot((from + to).normalize());
            assert!(spin.abs() < 1e-12, "{spin:e}");
        }
        now.state.x.iter().flat_map(|x| x.to_array()).collect()
    };
    let apart = |a: &[f64], b: &[f64]| largest(a.iter().zip(b).map(|(a, b)| (a - b).abs()));
    let mut limits = Vec::new();
    for scheme in BOTH {
        let [coarse, middle, fine] = [1e-3, 5e-4, 2.5e-4].map(|h| positions(scheme, h));
        let (one, two) = (apart(&coarse, &middle), apart(&middle, &fine));
        close(&format!("{scheme:?}"), order(one, two), 2.0, 0.1);
        let limit = fine.iter().zip(&middle).map(|(f, m)| f + (f - m) / 3.0);
        limits.push(limit.collect::<Vec<_>>());
        let off = |h: f64| energy_imbalance(scheme, &leaf, &start, h, (20, 0.1));
        let [coarse, fine] = [1e-3, 5e-4].map(off);
        assert!(coarse < 1e-3, "{scheme:?}: {coarse:e}");
        close("order of the energy", order(coarse, fine), 2.0, 0.3);
    }
    let off = apart(&limits[0], &limits[1]);
    assert!(off < 1e-6, "{off:e}");
}

/// A leaf at rest on hinges that hold its spin stays there.
#[test]
fn what_rests_with_held_spins_does_not_move() {
    let scenario = spinless();
    let leaf = Leaf::new(&scenario);
    let state = rest(&scenario, 8);
    for scheme in BOTH {
        let now = at(scheme, &leaf, &state, 1e-3, 0.5).state;
        let moved = largest(now.x.iter().zip(&state.x).map(|(a, b)| a.distance(*b)));
        assert!(moved < 1e-9, "{scheme:?}: {moved:e}");
    }
}

/// A hinge that holds the spin does not turn with moving bases, nor do explicit steps relax on it.
#[test]
fn what_is_left_out_is_refused() {
    let mut scenario = spinless();
    let explicit = Options {
        method: Method::Explicit { segments: Some(8) },
        ..Options::default()
    };
    let refused = relax(&scenario, &explicit, &mut |_| {})
        .unwrap_err()
        .to_string();
    assert!(refused.contains("leaf.base_spin"), "{refused}");
    scenario.joined = false;
    let text = serde_json::to_string(&scenario).unwrap();
    let turned = "dynamics.base={at=[0, 1], turn=[[0, 0, 0], [0, 0, 1]]}";
    let entries = [String::from(turned)];
    let refused = BaseScenario::from_text(text, "spin.toml".into(), &entries);
    let refused = refused.err().unwrap().to_string();
    assert!(refused.contains("leaf.base_spin"), "{refused}");
}

/// Small motions have the frequencies that modes tell: of a vein that swings, bends and twists at once.
#[test]
fn small_motions_with_held_spins_are_modes() {
    let scenario = spinless();
    let leaf = Leaf::new(&scenario);
    let state = rest(&scenario, 8);
    for mode in modes(&leaf, &state, 3, &[]) {
        let omega = mode.eigenvalue.sqrt();
        let start = displaced(&state, &mode, 1e-5);
        let node = (0..state.x.len())
            .max_by(|a, b| {
                let far = |k: usize| start.x[k].distance(state.x[k]);
                far(*a).total_cmp(&far(*b))
            })
            .unwrap();
        let way = start.x[node] - state.x[node];
        for part in [0.25, 0.5, 1.0] {
            let time = part * 2.0 * PI / omega;
            let now = at(Scheme::SemiImplicit, &leaf, &start, time / 2000.0, time);
            let found = (now.state.x[node] - state.x[node]).dot(way) / way.length_squared();
            close("part of the amplitude", found, (omega * time).cos(), 1e-3);
        }
    }
}
