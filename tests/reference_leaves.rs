//! Leaves whose solution was computed apart from this program: `data/` holds
//! the extrapolated midpoint solution of each, confirmed by collocation on the
//! paper's boundary-value problem (scipy's `solve_bvp`).

mod common;

use common::{TIGHT, close, paper_leaf, settle, tip};
use glam::DVec3;
use leafdyn::scenario::Profile;
use serde_json::Value;

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap()
}

fn vector(value: &Value) -> [f64; 3] {
    [0, 1, 2].map(|k| number(&value[k]))
}

#[test]
fn every_station_is_where_the_reference_says() {
    let leaves: Vec<Value> =
        serde_json::from_str(include_str!("data/reference_leaves.json")).unwrap();
    assert_eq!(leaves.len(), 7);
    for reference in leaves {
        let name = reference["name"].as_str().unwrap();
        let count = reference["rods"].as_u64().unwrap() as usize;
        let mut scenario = paper_leaf(
            count,
            vector(&reference["couple_stiffness"]),
            vector(&reference["force_stiffness"]),
            number(&reference["weight"]),
        );
        scenario.coupling = vec![vector(&reference["coupling"]); count - 1];
        scenario.tip_force = vector(&reference["tip_force"]);
        for (j, rod) in scenario.rods.iter_mut().enumerate() {
            rod.rest_curvature = vector(&reference["rest_curvature"]).map(Profile::Constant);
            if let Some(angles) = reference["angles"].as_array() {
                rod.angle = number(&angles[j]);
            }
        }

        let leaf = settle(&scenario, TIGHT);
        // Where u0 is not zero the reference itself is only known to 3e-9 in
        // positions, and its energy to ten times that.
        let energy = if name == "fig6_N5" { 3e-8 } else { 1e-8 };
        close(name, leaf.energy, number(&reference["energy"]), energy);
        let error = tip(&leaf) - DVec3::from_array(vector(&reference["tip"]));
        assert!(error.length() < 1e-8, "{name}: tip off by {error}");
        for (key, sigma) in [("quarter", 0.25), ("mid", 0.5), ("threequarter", 0.75)] {
            let station = leaf.stations.iter().position(|s| *s == sigma).unwrap();
            let points = reference[key].as_array().unwrap();
            assert_eq!(points.len(), leaf.rods.len());
            for (j, (point, rod)) in points.iter().zip(&leaf.rods).enumerate() {
                let error = rod.nodes[station].position - DVec3::from_array(vector(point));
                assert!(
                    error.length() < 1e-8,
                    "{name}: rod {j} at {key} off by {error}"
                );
            }
        }
        assert_eq!(leaf.negative_eigenvalues, Some(0), "{name}");
    }
}
