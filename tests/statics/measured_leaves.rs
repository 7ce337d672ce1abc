//! The leaves of `scenarios/measured` that are given as one would measure them:
//! their numbers fit each other, and they hang and swing as such leaves do.

use leafdyn_testing::*;

const NAMES: [&str; 3] = ["grass", "lily", "orchid"];

/// cm/s^2.
const GRAVITY: f64 = 981.0;

fn leaf(name: &str) -> Scenario {
    scenario(&format!("measured/{name}"), "")
}

/// Simpson's rule is exact: the area is quadratic along a vein that tapers evenly.
#[test]
fn each_weighs_what_its_mass_does() {
    for name in NAMES {
        let leaf = leaf(name);
        let weight = DVec3::from(leaf.gravity).length();
        for density in &leaf.dynamics.density {
            let [base, middle, tip] = [0.0, 0.5, 1.0].map(|at| density.at(at));
            let mass = (base + 4.0 * middle + tip) / 6.0;
            close(name, GRAVITY * mass, weight, 0.005 * weight);
        }
    }
}

/// Height of the tip over the base, relative to the longest vein, and the lowest
/// frequency in hertz.
#[test]
fn each_hangs_and_swings() {
    let options = Options {
        modes: 1,
        ..Options::default()
    };
    let expected = [
        ("grass", -0.012, 1.226),
        ("lily", -0.478, 4.162),
        ("orchid", -0.491, 2.938),
    ];
    for (name, height, frequency) in expected {
        let leaf = leaf(name);
        let found = relaxed(&leaf, &options);
        assert_eq!(found.outcome, Outcome::Converged, "{name}");
        assert_eq!(found.stable(), Some(true), "{name}");
        assert!(found.remark.is_none() && found.doubts.is_empty(), "{name}");
        let up = -DVec3::from(leaf.gravity).normalize();
        close(
            name,
            up.dot(tip(&found)) / leaf.scale().length,
            height,
            0.01,
        );
        let lowest = &found.stability.modes.as_ref().unwrap()[0];
        let lowest = lowest.frequency().unwrap() / (2.0 * PI);
        close(name, lowest, frequency, 1e-3);
    }
}
