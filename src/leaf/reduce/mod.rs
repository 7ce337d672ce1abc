//! Reduction by symmetry: half of a mirror-symmetric leaf, and a planar leaf. The equations of
//! both are assembled in `assembly`.

mod mirror;
mod planar;

pub use mirror::{half_of, whole_fields, whole_of};

use super::dimensionless::Leaf;

impl Leaf {
    /// The leaf reduced by its symmetries, if it has any: half of it if it is
    /// mirror-symmetric, restricted to its plane if nothing acts out of it.
    pub fn reduced(&self) -> Option<Leaf> {
        if self.held.is_some() {
            return None;
        }
        let mut reduced = self.clone();
        reduced.mirrored = mirror::is_mirrored(self.scenario());
        reduced.planar = planar::is_planar(self.scenario());
        (reduced.mirrored || reduced.planar).then_some(reduced)
    }
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
        for entry in [
            "leaf.fan='paper'",
            "leaf.length=[0.9, 1.0, 1.1, 1.0, 0.8]",
            "stiffness.axial=[1, 2, 3, 2, 2]",
            "rest.twist=0.1",
            "rest.stretch=[1.2, 1.1, 1.0, 1.1, 1.0]",
            "rest.bend_3=[1.0, 0.0, 0.0, 0.0, 1.0]",
            "rest.bend_3=[1.0, 0.0, 0.5, 0.0, -1.0]",
            "coupling.z=[1.0, 2.0, 2.0, 3.0]",
            "load.gravity=[0.0, 1e-9, -1.0]",
            "load.tip_force=[0.0, 1.0, 0.0]",
        ] {
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
            let flat = [
                "rest.twist=0",
                "rest.bend_2=0",
                "load.gravity=[1.0, -2.0, 0.0]",
                entry,
            ];
            assert_eq!(reduced(&flat), (false, true), "{entry}");
        }
    }
}
