//! Reduction by symmetry: half of a mirror-symmetric leaf, and a planar leaf. The equations of
//! both are assembled in `assembly`.
//!
//! A leaf without loads or rest curvatures out of its plane z = 0 has an equilibrium in the
//! plane, for which a node has three unknowns: its rotation about z and its displacements along
//! x and y. Whether it is stable against leaving the plane is decided with the full matrix.
//! Coupling along z, torsion, and bending about d2 have no effect within the plane.

mod mirror;

pub use mirror::{half_of, whole_fields, whole_of};

use super::dimensionless::Leaf;
use crate::scenario::Scenario;

impl Leaf {
    /// The leaf reduced by its symmetries, if it has any: half of it if it is
    /// mirror-symmetric, restricted to its plane if nothing acts out of it.
    pub fn reduced(&self) -> Option<Leaf> {
        if self.held.is_some() {
            return None;
        }
        let mut reduced = self.clone();
        reduced.mirrored = mirror::is_mirrored(self.scenario());
        reduced.planar = is_planar(self.scenario());
        (reduced.mirrored || reduced.planar).then_some(reduced)
    }
}

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
    use crate::scenario::Scenario;

    const LEAF: &str = r#"
        name = "leaf"
        leaf = { rods = 5, length = [0.9, 1.0, 1.1, 1.0, 0.9], fan = "symmetric" }
        stiffness = { torsion = 1.0, bending_2 = 1.0, bending_3 = 1.0, axial = 100.0, shear_2 = 100.0, shear_3 = 100.0 }
        rest = { twist = [0.1, 0.2, 0.0, -0.2, -0.1], bend_2 = 0.3 }
        coupling = { y = [1.0, 2.0, 2.0, 1.0] }
        load = { gravity = [0.1, 0.0, -1.0] }
    "#;

    fn reduced(entries: &[&str]) -> (bool, bool) {
        let entries: Vec<_> = entries.iter().map(|&entry| entry.into()).collect();
        let scenario = Scenario::from_toml_with(LEAF, "leaf", &entries).unwrap();
        let leaf = Leaf::new(&scenario).reduced();
        leaf.map_or((false, false), |leaf| (leaf.mirrored, leaf.planar))
    }

    #[test]
    fn mirrored_leaves_are_known() {
        for entry in [
            "name='same'",
            "rest.stretch=[1.2, 1.1, 1.0, 1.1, 1.2]",
            "rest.bend_3=[1.0, 0.0, 0.0, 0.0, -1.0]",
        ] {
            assert_eq!(reduced(&[entry]), (true, false), "{entry}");
        }
        let others = "leaf.fan='paper'; leaf.length=[0.9, 1.0, 1.1, 1.0, 0.8]; rest.twist=0.1; \
            stiffness.axial=[1, 2, 3, 2, 2]; rest.stretch=[1.2, 1.1, 1.0, 1.1, 1.0]; \
            rest.bend_3=[1.0, 0.0, 0.0, 0.0, 1.0]; rest.bend_3=[1.0, 0.0, 0.5, 0.0, -1.0]; \
            coupling.z=[1.0, 2.0, 2.0, 3.0]; load.gravity=[0.0, 1e-9, -1.0]; \
            load.tip_force=[0.0, 1.0, 0.0]";
        for entry in others.split("; ") {
            assert_eq!(reduced(&[entry]), (false, false), "{entry}");
        }
    }

    #[test]
    fn planar_leaves_are_known() {
        for entry in [
            "load.tip_force=[1.0, -2.0, 0.0]",
            "rest.bend_3=[1.0, 2.0, -3.0, 0.0, 1.0]",
            "rest.stretch=[1.0, 1.1, 1.0, 1.0, 1.2]",
        ] {
            let load = "load.gravity=[1.0, -2.0, 0.0]";
            let flat = reduced(&["rest.twist=0", "rest.bend_2=0", load, entry]);
            assert_eq!(flat, (false, true), "{entry}");
        }
    }
}
