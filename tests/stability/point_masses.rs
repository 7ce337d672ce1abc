//! Masses on points of veins take part in small vibrations, as they do in motion.

use leafdyn_testing::motion::{BOTH, at, rest};
use leafdyn_testing::*;

/// A slender cantilever of unit stiffness and mass with a mass at a point; `load` on its tip.
fn beam(mass: f64, place: f64, load: f64) -> Scenario {
    beam_of(["inf", "1e-8"], mass, place, load)
}

/// The same of this stiffness in stretch and shear, and rotary inertia.
fn beam_of([stiffness, inertia]: [&str; 2], mass: f64, place: f64, load: f64) -> Scenario {
    parse(&format!(
        r#"
        [leaf]
        rods = 1
        length = 1.0
        fan = [0.0]
        [stiffness]
        torsion = 1.0
        bending_2 = 1.0
        bending_3 = 1.0
        axial = {stiffness}
        shear_2 = {stiffness}
        shear_3 = {stiffness}
        [load]
        tip_force = [0.0, 0.0, {load:?}]
        [[load.point]]
        vein = 1
        at = {place:?}
        mass = {mass:?}
        [dynamics]
        density = 1.0
        rotary_inertia = {inertia}
        external_damping = 0.0
        "#
    ))
}

/// The least b of a clamped beam with a mass of mu times its own at its tip: zero of
/// 1 + cos b cosh b + mu b (cos b sinh b - sin b cosh b).
fn tip_root(mu: f64) -> f64 {
    let value = |b: f64| {
        let (sin, cos) = b.sin_cos();
        1.0 + cos * b.cosh() + mu * b * (cos * b.sinh() - sin * b.cosh())
    };
    let (mut low, mut high) = (1e-3, 1.8751041);
    for _ in 0..100 {
        let middle = 0.5 * (low + high);
        match value(middle) > 0.0 {
            true => low = middle,
            false => high = middle,
        }
    }
    low
}

fn lowest(scenario: &Scenario) -> (f64, f64) {
    let leaf = settled(scenario, &with_modes(1, to_every(1e-8)));
    let mode = &leaf.stability.modes.as_ref().expect("modes are found")[0];
    (mode.frequency().unwrap(), mode.error.unwrap())
}

fn to_every(tolerance: f64) -> Options {
    at_every_node(tolerance)
}

#[test]
fn a_mass_at_the_tip_slows_a_beam() {
    for mu in [0.0, 0.1, 1.0, 5.0, 100.0] {
        let b = tip_root(mu);
        let (found, _) = lowest(&beam(mu, 1.0, 0.0));
        close("frequency", found, b * b, 1e-5 * b * b);
    }
}

/// Two masses on a point are one of their sum, and one in the middle lies between none and the tip.
#[test]
fn masses_on_one_point_add_up() {
    let one = beam(0.7, 0.5, 0.0);
    let mut two = one.clone();
    two.points[0].mass = 0.4;
    let other = leafdyn::scenario::PointLoad {
        follows: false,
        mass: 0.3,
        ..two.points[0].clone()
    };
    two.points.push(other);
    let (found, bar) = lowest(&two);
    let (right, other) = lowest(&one);
    close("frequency", found, right, 1e-9 + bar + other);
    let (free, _) = lowest(&beam(0.0, 1.0, 0.0));
    let (tip, _) = lowest(&beam(0.7, 1.0, 0.0));
    assert!(tip < right && right < free, "{tip} {right} {free}");
}

/// Let go from where a small force on its tip holds it, a beam with a heavy tip is on the other side
/// after half of its period, by both methods: its other modes have next to no part in that.
#[test]
fn both_methods_swing_with_the_period_of_the_mode() {
    let mu = 50.0;
    // Explicit steps need a finite stiffness; it makes the beam softer by 3/4000.
    let stiff = ["4e3", "1e-2"];
    let state = rest(&beam_of(stiff, mu, 1.0, 3e-3), 16);
    let leaf = Leaf::new(&beam_of(stiff, mu, 1.0, 0.0));
    let b = tip_root(mu);
    let half = PI / (b * b);
    let begun = state.tip(0).z;
    assert!(begun > 5e-4, "{begun}");
    for scheme in BOTH {
        let step = if scheme == BOTH[0] {
            2e-4
        } else {
            half / 500.0
        };
        let across = at(scheme, &leaf, &state, step, half).state.tip(0).z;
        close("half a period", across, -begun, 3e-3 * begun);
    }
}
