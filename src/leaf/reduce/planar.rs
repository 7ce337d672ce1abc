//! Leaves that nothing pulls or bends out of their plane z = 0.
//!
//! Such a leaf has an equilibrium in the plane, for which a node has three
//! unknowns: its turn about z and its shifts along x and y. Whether it stays
//! there is for the full matrix to say. Coupling along z, torsion, and bending
//! about d2 do nothing as long as it does.

use crate::scenario::Scenario;

/// Whether no load, rest curvature or coupling acts out of the plane.
pub fn is_planar(scenario: &Scenario) -> bool {
    let in_plane = |load: &[f64; 3]| load[2] == 0.0;
    in_plane(&scenario.gravity)
        && in_plane(&scenario.tip_force)
        && scenario.tip_moment == [0.0; 3]
        && (scenario.rods.iter())
            .flat_map(|rod| &rod.rest_curvature[..2])
            .all(|curvature| curvature.max_abs() == 0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    const LEAF: &str = r#"
        name = "leaf"
        leaf = { rods = 3, length = 1.0, fan = "paper" }
        stiffness = { torsion = 1.0, bending_2 = 1.0, bending_3 = 1.0, axial = 100.0, shear_2 = 100.0, shear_3 = 100.0 }
        coupling = { x = 1.0, y = 1.0, z = 1.0 }
    "#;

    #[test]
    fn planar_leaves_are_known() {
        let planar = |entry: &str| {
            let scenario = Scenario::from_toml_with(LEAF, "leaf", &[entry.into()]).unwrap();
            is_planar(&scenario)
        };
        for entry in [
            "load.gravity=[1.0, -2.0, 0.0]",
            "load.tip_force=[1.0, -2.0, 0.0]",
            "rest.bend_3=[1.0, 2.0, -3.0]",
            "rest.stretch=[1.0, 1.1, 1.0]",
        ] {
            assert!(planar(entry), "{entry}");
        }
        for entry in [
            "load.gravity=[0.0, 0.0, 1e-9]",
            "load.tip_force=[0.0, 0.0, 1e-9]",
            "rest.twist=[0.0, 0.0, 1e-9]",
            "rest.bend_2=[0.0, 1e-9, 0.0]",
        ] {
            assert!(!planar(entry), "{entry}");
        }
    }
}
