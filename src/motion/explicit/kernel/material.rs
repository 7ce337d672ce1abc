//! Material data of rods, for the loops over their nodes.

use super::BLOCK;
use std::sync::Arc;

/// A node, and the segment from it to the next.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Node {
    /// H/ds.
    pub stretch: [f64; 3],
    /// ds v0.
    pub rest_length: [f64; 3],
    /// A/ds.
    pub bend: [f64; 3],
    /// ds u0, times its factor if that is constant.
    pub rest_turn: [f64; 3],
    /// Mass; zero for a held node and for a shared tip.
    pub mass: f64,
    /// 1/mass; zero for a held node, and for a shared tip.
    pub per_mass: f64,
    /// 1/J of a node about d2 and d3; zero for a held node.
    pub per_inertia: f64,
    /// 1/J1 - 1/J.
    pub per_spin: f64,
    /// Length of rod whose loads act on the node.
    pub weight: f64,
    /// Fraction of the length whose coupling to the rods before and after acts on the node.
    pub coupled: [f64; 2],
}

/// The nodes of a block, one array for each number of a [`Node`], and derived
/// quantities.
#[derive(Clone, Debug, PartialEq)]
#[repr(align(64))]
pub struct Material {
    /// Whether all segments are as stiff along d3 as along d2, and straight at rest.
    pub round: bool,
    /// H2/ds, and the excess of H1/ds and H3/ds over it.
    pub shear: [f64; BLOCK],
    pub stretch_excess: [[f64; BLOCK]; 2],
    /// H v0: minus the force where the segment has no length.
    pub rest_force: [[f64; BLOCK]; 3],
    /// A2/ds, and the excess of A1/ds and A3/ds over it.
    pub bend: [f64; BLOCK],
    pub bend_excess: [[f64; BLOCK]; 2],
    pub rest_turn: [[f64; BLOCK]; 3],
    /// A u0: minus the moment where the segment is straight.
    pub rest_moment: [[f64; BLOCK]; 3],
    pub mass: [f64; BLOCK],
    pub per_mass: [f64; BLOCK],
    pub per_inertia: [f64; BLOCK],
    pub per_spin: [f64; BLOCK],
    pub weight: [f64; BLOCK],
    pub coupled: [[f64; BLOCK]; 2],
}

impl Material {
    fn new(nodes: &[Node]) -> Self {
        let gather = |number: &dyn Fn(&Node) -> f64| {
            let mut array = [0.0; BLOCK];
            for (slot, node) in array.iter_mut().zip(nodes) {
                *slot = number(node);
            }
            array
        };
        let round = |node: &Node| {
            let [_, bend_2, bend_3] = node.bend;
            let [_, shear_2, shear_3] = node.stretch;
            let straight = [&node.rest_turn, &node.rest_length].map(|rest| rest[1..] == [0.0, 0.0]);
            bend_2 == bend_3 && shear_2 == shear_3 && straight == [true; 2]
        };
        Material {
            round: nodes.iter().all(round),
            shear: gather(&|node| node.stretch[1]),
            stretch_excess: [0, 2].map(|c| gather(&|node| node.stretch[c] - node.stretch[1])),
            rest_force: [0, 1, 2].map(|c| gather(&|node| node.stretch[c] * node.rest_length[c])),
            bend: gather(&|node| node.bend[1]),
            bend_excess: [0, 2].map(|c| gather(&|node| node.bend[c] - node.bend[1])),
            rest_turn: [0, 1, 2].map(|c| gather(&|node| node.rest_turn[c])),
            rest_moment: [0, 1, 2].map(|c| gather(&|node| node.bend[c] * node.rest_turn[c])),
            mass: gather(&|node| node.mass),
            per_mass: gather(&|node| node.per_mass),
            per_inertia: gather(&|node| node.per_inertia),
            per_spin: gather(&|node| node.per_spin),
            weight: gather(&|node| node.weight),
            coupled: [0, 1].map(|side| gather(&|node| node.coupled[side])),
        }
    }
}

/// The nodes of a pack in blocks. Blocks that equal the previous one, or the one
/// at the same position in the pack before, are shared: they stay in the innermost
/// cache, and most leaves have few that differ.
pub fn blocks(nodes: &[Node], before: Option<&[Arc<Material>]>) -> Vec<Arc<Material>> {
    let mut blocks: Vec<Arc<Material>> = Vec::with_capacity(nodes.len().div_ceil(BLOCK));
    for nodes in nodes.chunks(BLOCK) {
        let material = Material::new(nodes);
        let above = before.and_then(|pack| pack.get(blocks.len()));
        let near = [blocks.last(), above].into_iter().flatten();
        let same = { near }.find(|other| ***other == material).cloned();
        blocks.push(same.unwrap_or_else(|| Arc::new(material)));
    }
    blocks
}
