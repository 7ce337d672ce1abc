//! The rest shape of curved veins at the nodes of a grid.
//!
//! Veins that tissue ties, or that meet at a tip, must fit together at rest: what their rest shapes
//! miss by their discretisation, stiff tissue would turn into forces. So the rest strain and the rest
//! curvature of their segments are those of a segment between two nodes of the natural leaf,
//!
//! v0 = R^T (x1 - x0)/ds,   u0 = log(q0^* q1)/ds,
//!
//! which differ from those at its middle by a series in ds^2.

use super::dimensionless::Leaf;
use super::grid::Grid;
use crate::natural::Natural;
use crate::rod::Section;
use crate::rotation;
use crate::scenario::Profile;

impl Leaf {
    /// Gives the segments of all rods, rod after rod, the rest shape between their nodes, if tissue
    /// ties the rods.
    pub(super) fn fit_rest_shapes(&self, grid: &Grid, sections: &mut [Section]) {
        if !self.has_tissue() {
            return;
        }
        let natural = Natural::new(self.scenario(), true);
        for (j, sections) in sections.chunks_mut(grid.segments()).enumerate() {
            if self.is_straight_at_rest(j) {
                continue;
            }
            let mut before = natural.at(j, 0.0);
            for (section, sigma) in sections.iter_mut().zip(&grid.sigma()[1..]) {
                let next = natural.at(j, *sigma);
                let ((x0, q0), (x1, q1)) = (before, next);
                let chord = (x1 - x0) / (self.scale.length * section.ds);
                section.rest_strain = rotation::midpoint(q0, q1).inverse() * chord;
                section.rest_curvature = rotation::log(q0.conjugate() * q1) / section.ds;
                before = next;
            }
        }
    }

    /// Whether a rod at rest is straight and stretched alike everywhere.
    fn is_straight_at_rest(&self, j: usize) -> bool {
        let rod = &self.scenario().rods[j];
        let [_, bends @ ..] = &rod.rest_curvature;
        let even = matches!(rod.rest_stretch, Profile::Constant(_));
        even && bends.iter().all(|of| of.max_abs() == 0.0)
    }
}
