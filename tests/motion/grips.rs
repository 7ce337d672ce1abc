//! Grips hold veins while they move.

use leafdyn::relax::Route;
use leafdyn::simulate;
use leafdyn_testing::motion::{BOTH, Scheme, at, gripped_veins, moving, rest, run};
use leafdyn_testing::*;

/// Where a rod of this length, with `more` in its scenario, is after it was shaken by its weight: its
/// nodes.
fn shaken(scheme: Scheme, length: f64, segments: usize, more: &str) -> Vec<DVec3> {
    let text = format!(
        r#"
        {ROD}
        {more}
        dynamics = {{ density = 1.0, rotary_inertia = 0.01, external_damping = 0.5, duration = 1.5, start = "released" }}
        "#
    );
    let gravity = "dynamics.gravity={ at = [0.0, 0.4, 1.5], value = [[0.0, 0.0, 0.0], [0.5, 1.0, -3.0], [0.0, -1.0, 2.0]] }";
    let made = base(&text, &format!("leaf.length={length:?}; {gravity}"));
    let options = simulate::Options {
        step: Some(1e-3),
        ..moving(scheme, Some(segments))
    };
    run(made.scenario(), &options).positions
}

/// What is beyond a clamp in the middle of a vein moves as a cantilever that begins there, and what
/// is before it as one whose tip is clamped.
#[test]
fn a_clamp_in_the_middle_divides_a_motion() {
    for scheme in BOTH {
        let grip = "grip = [{ vein = 1, at = 0.5, held = \"clamped\" }]";
        let whole = shaken(scheme, 2.0, 16, grip);
        let beyond = shaken(scheme, 1.0, 8, "");
        let tip = "tip = { held = \"clamped\", position = [1.0, 0.0, 0.0] }";
        let before = shaken(scheme, 1.0, 8, tip);
        assert!(beyond[8].distance(DVec3::X) > 0.03, "{:?}", beyond[8]);
        for i in 0..=8 {
            let off = whole[i].distance(before[i]);
            assert!(off < 1e-9, "{scheme:?}, before, {i}: {off:e}");
            let off = (whole[8 + i] - DVec3::X).distance(beyond[i]);
            assert!(off < 1e-9, "{scheme:?}, beyond, {i}: {off:e}");
        }
    }
}

/// Held nodes stay where they are, and a leaf at rest in its grips stays at rest.
#[test]
fn nothing_moves_in_grips_at_rest() {
    let leaf = Leaf::new(&gripped_veins());
    let state = rest(&gripped_veins(), 8);
    for scheme in BOTH {
        let now = at(scheme, &leaf, &state, 1e-3, 0.5).state;
        let moved = largest(now.x.iter().zip(&state.x).map(|(a, b)| a.distance(*b)));
        assert!(moved < 1e-10, "{scheme:?}: {moved:e}");
        for (j, i) in [(0, 2), (0, 3), (0, 4), (2, 6)] {
            let k = state.base(j) + i;
            let off = now.x[k].distance(state.x[k]);
            assert!(off < 1e-12, "{scheme:?}, vein {j}, node {i}: {off:e}");
        }
    }
}

/// A wind that comes and turns.
const GUST: &str = "wind = { velocity = { at = [0.0, 0.3, 1.0], value = [[0.0, 0.0, 0.0], [0.5, 2.0, -2.0], [0.0, -1.0, 2.0]] }, density = 1.2, drag = 2.0, width = 0.5 }";

/// Wind moves what is beyond a clamp as a cantilever that begins there, and in a steady wind it comes
/// to rest as that.
#[test]
fn a_clamp_in_the_middle_divides_a_rod_in_wind() {
    let grip = "grip = [{ vein = 1, at = 0.5, held = \"clamped\" }]";
    for scheme in BOTH {
        let whole = shaken(scheme, 2.0, 16, &format!("{GUST}\n{grip}"));
        let beyond = shaken(scheme, 1.0, 8, GUST);
        assert!(beyond[8].distance(DVec3::X) > 0.03, "{:?}", beyond[8]);
        for i in 0..=8 {
            let off = (whole[8 + i] - DVec3::X).distance(beyond[i]);
            assert!(off < 1e-9, "{scheme:?}, {i}: {off:e}");
        }
    }
    let steady = "wind = { velocity = [0.5, 0.8, -1.0], density = 1.2, drag = 2.0, width = 2.0 }";
    let at_rest = |length: f64, grip: &str| {
        let rod = base(
            &format!("{ROD}\n{steady}\n{grip}"),
            &format!("leaf.length={length:?}"),
        );
        let options = Options {
            route: Route::Release,
            ..to(1e-8)
        };
        tip(&settled(rod.scenario(), &options))
    };
    let (whole, beyond) = (at_rest(2.0, grip), at_rest(1.0, ""));
    assert!(beyond.distance(DVec3::X) > 0.1, "{beyond}");
    let off = (whole - DVec3::X).distance(beyond);
    assert!(off < 2e-8, "{off:e}");
}
