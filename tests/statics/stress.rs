//! The largest stresses in the sections of a leaf.

use leafdyn::relax::Stresses;
use leafdyn_testing::*;

const RECTANGLE: &str = "shape = 'rectangle', width = 0.05, thickness = 0.02";
const CIRCLE: &str = "shape = 'circle', diameter = 0.04";
const TUBE: &str = "shape = 'circle', diameter = 0.04, wall = 0.01";

/// Stresses in a rod of the length 1 with this section under this load.
fn stress(section: &str, load: &str) -> Stresses {
    let text = format!(
        "name = 'rod'\nleaf = {{ rods = 1, length = 1, fan = [0] }}\n\
         section = {{ {section}, young = 1e9, poisson = 0.25 }}\nload = {{ {load} }}"
    );
    let leaf = settle(&Scenario::from_toml(&text).unwrap(), 1e-9);
    leaf.stress.unwrap()
}

#[track_caller]
fn relative(found: f64, wanted: f64, within: f64) {
    assert!((found / wanted - 1.0).abs() < within, "{found} {wanted}");
}

/// Cantilevers with a load F on the tip: at the base 6 F L/(w t^2) of a rectangle, 32 F L/(pi d^3) of a
/// circle, over 1 - (d/D)^4 of a tube; by the load itself 3/2 and 4/3 of F/S, 4/3 7/5 of it for this
/// tube.
#[test]
fn a_cantilever() {
    let force = 1e-3;
    let [square, round] = [6.0 / (0.05 * 0.0004), 32.0 / (PI * 6.4e-5)];
    let [area, disc] = [0.001, PI / 4.0 * 0.0016];
    for (section, normal, shear) in [
        (RECTANGLE, square, 1.5 / area),
        (CIRCLE, round, 4.0 / 3.0 / disc),
        (TUBE, round * 16.0 / 15.0, 28.0 / 15.0 / (0.75 * disc)),
    ] {
        let found = stress(section, &format!("tip_force = [0, 0, {force}]"));
        assert_eq!((found.vein, found.sigma), (1, 0.0));
        relative(found.largest.normal, force * normal, 1e-7);
        relative(found.largest.shear, force * shear, 1e-6);
        let both = (normal * normal + 3.0 * shear * shear).sqrt();
        relative(found.largest.equivalent, force * both, 1e-7);
        // It falls to nothing at the tip, where the force alone is left.
        let tip = found.rods[0].last().unwrap();
        assert!(tip.normal < 1e-6 * found.largest.normal);
        relative(tip.shear, force * shear, 1e-6);
    }
}

/// Twisted rods: 16 M/(pi d^3); M/(0.258 w t^2), as the tables of Timoshenko and Goodier interpolate.
#[test]
fn a_twisted_rod() {
    let moment = 1.5;
    for (section, wanted, within) in [
        (CIRCLE, 16.0 / (PI * 6.4e-5), 1e-9),
        (TUBE, 16.0 / (PI * 6.4e-5) * 16.0 / 15.0, 1e-9),
        (RECTANGLE, 1.0 / (0.258 * 0.05 * 0.0004), 3e-3),
    ] {
        let found = stress(section, &format!("tip_moment = [{moment}, 0, 0]"));
        for station in &found.rods[0] {
            relative(station.shear, moment * wanted, within);
            relative(station.equivalent, 3_f64.sqrt() * station.shear, 1e-9);
        }
    }
}

/// Pulled rods: F/S everywhere.
#[test]
fn a_pulled_rod() {
    let disc = PI / 4.0 * 0.0016;
    for (section, area) in [(RECTANGLE, 0.001), (CIRCLE, disc), (TUBE, 0.75 * disc)] {
        let found = stress(section, "tip_force = [100, 0, 0]");
        for station in &found.rods[0] {
            relative(station.normal, 100.0 / area, 1e-9);
            assert!(station.shear < 1e-6 * station.normal);
        }
    }
}

/// A blade that hangs over by its weight q per length: its strips carry 6 q L^2/2/(W t^2) together; other
/// stations show the same, and where stiffnesses are given there is none.
#[test]
fn a_blade() {
    let text = "
        name = 'blade'
        leaf = { rods = 5 }
        blade = { length = 1.0, width = 0.05, thickness = 0.002, young = 1e9, poisson = 0.0, edges = false }
        load = { gravity = [0.0, 0.0, -1e-6] }
    ";
    let scenario = Scenario::from_toml(text).unwrap();
    let leaf = settle(&scenario, 1e-8);
    let found = leaf.stress.clone().unwrap();
    assert_eq!(found.sigma, 0.0);
    relative(found.largest.normal, 6.0 * 5e-6 / 2.0 / (0.05 * 4e-6), 1e-3);
    let there = leaf.at_stations(&scenario, Some(10)).stress.unwrap();
    assert_eq!(there.rods[4].len(), 11);
    assert_eq!(there.largest, found.largest);
    // A strip that is twisted as a part of a plate: 3 M/(w t^2).
    let twisted = text.replace("rods = 5", "rods = 1").replace(
        "gravity = [0.0, 0.0, -1e-6]",
        "tip_moment = [1e-3, 0.0, 0.0]",
    );
    let twisted = settle(&Scenario::from_toml(&twisted).unwrap(), 1e-8);
    relative(
        twisted.stress.unwrap().largest.shear,
        3e-3 / (0.05 * 4e-6),
        1e-9,
    );
    let stiff = settle(&leafdyn_testing::scenario("paper/fig04", ""), 1e-3);
    assert_eq!(stiff.stress, None);
}
