//! Leaves whose solution was computed apart from this program: `data/` holds
//! the extrapolated midpoint solution of each, confirmed by collocation on the
//! paper's boundary-value problem (scipy's `solve_bvp`).

use leafdyn_testing::*;
use serde_json::Value;

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap()
}

fn vector(value: &Value) -> [f64; 3] {
    [0, 1, 2].map(|k| number(&value[k]))
}

/// The leaves and what is known of them.
fn references() -> Vec<(Scenario, Value)> {
    let text = include_str!("../data/reference_leaves.json");
    let leaves: Vec<Value> = serde_json::from_str(text).unwrap();
    assert_eq!(leaves.len(), 7);
    let with = |leaf| (scenario_of(&leaf), leaf);
    leaves.into_iter().map(with).collect()
}

fn scenario_of(reference: &Value) -> Scenario {
    let count = number(&reference["rods"]) as usize;
    let of = |key: &str| vector(&reference[key]);
    let (couple, force) = (of("couple_stiffness"), of("force_stiffness"));
    let mut scenario = paper_leaf(count, couple, force, number(&reference["weight"]));
    scenario.name = reference["name"].as_str().unwrap().to_string();
    scenario.coupling = vec![of("coupling"); count - 1];
    scenario.tip_force = of("tip_force");
    for (j, rod) in scenario.rods.iter_mut().enumerate() {
        rod.rest_curvature = of("rest_curvature").map(Profile::Constant);
        if let Some(angles) = reference["angles"].as_array() {
            rod.angle = number(&angles[j]);
        }
    }
    scenario
}

/// Asserts that energy, tip and stations are those of the reference.
#[track_caller]
fn is(reference: &Value, energy: f64, stations: &[f64], rods: &[RodShape], within: f64) {
    let name = reference["name"].as_str().unwrap();
    // Where u0 is not zero the reference itself is only known to 3e-9 in
    // positions, and its energy to ten times that.
    let curved = vector(&reference["rest_curvature"]) != [0.0; 3];
    let within = if curved { within.max(5e-9) } else { within };
    let of_energy = if name == "fig6_N5" { 3e-8 } else { 1e-8 };
    close(name, energy, number(&reference["energy"]), of_energy);
    let station = |sigma: f64| stations.iter().position(|s| *s == sigma).unwrap();
    let tip = DVec3::from_array(vector(&reference["tip"]));
    let found = rods[0].nodes[station(1.0)].position;
    assert!((found - tip).length() < within, "{name}: tip {found}");
    for (key, sigma) in [("quarter", 0.25), ("mid", 0.5), ("threequarter", 0.75)] {
        let points = reference[key].as_array().unwrap();
        assert_eq!(points.len(), rods.len());
        for (j, (point, rod)) in points.iter().zip(rods).enumerate() {
            let error = rod.nodes[station(sigma)].position - DVec3::from_array(vector(point));
            assert!(error.length() < within, "{name}: rod {j} at {key}: {error}");
        }
    }
}

#[test]
fn every_station_is_where_the_reference_says() {
    for (scenario, reference) in references() {
        let leaf = settle(&scenario, TIGHT);
        let (energy, shape) = (leaf.energy.unwrap(), &leaf.shape);
        is(&reference, energy, &shape.stations, &shape.rods, 1e-8);
        assert_eq!(leaf.stable(), Some(true), "{}", scenario.name);
    }
}

#[test]
fn so_it_is_by_shooting_without_a_start() {
    let stations = [0.0, 0.25, 0.5, 0.75, 1.0];
    for (scenario, reference) in references() {
        let leaf = shot_alone(&scenario, &stations);
        is(&reference, leaf.energy, &stations, &leaf.rods, 1e-9);
    }
}
