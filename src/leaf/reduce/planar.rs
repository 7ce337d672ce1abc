//! Leaves without loads or rest curvatures out of their plane z = 0.
//!
//! Such a leaf has an equilibrium in the plane, for which a node has three unknowns: its
//! rotation about z and its displacements along x and y. Whether it is stable against leaving
//! the plane is decided with the full matrix. Coupling along z, torsion, and bending about d2
//! have no effect within the plane.

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
