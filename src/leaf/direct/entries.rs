//! The entries of a leaf's matrix, in the numbering of its unknowns.

use crate::leaf::block_tridiagonal::{NodeBlocks, RodLane, rod_lane};
use crate::leaf::direct::unknowns::UnknownNumbering;
use crate::leaf::state::NodalField;
use crate::leaf::system::System;

/// Calls `add` with row, column and value of the entries of one triangle of K and its border. Some
/// entries come in several parts; positions and order are the same for all systems of a pattern.
pub fn for_each_matrix_entry(
    system: &System,
    unknowns: &UnknownNumbering,
    border: &[NodalField],
    first_border: usize,
    shift: f64,
    mut add: impl FnMut(usize, usize, f64),
) {
    let n = system.nodes();
    for j in 0..system.rods() {
        let RodLane { group, lane } = rod_lane(j);
        let chain = &system.groups[group].matrix;
        for i in 0..n {
            let NodeBlocks { own, next } = chain.node_blocks(i, lane);
            let mass = system.mass(j, i);
            let (here, ahead) = (
                unknowns.node_numbers(j, i),
                unknowns.node_numbers(j, (i + 1).min(n - 1)),
            );
            for r in 0..6 {
                add(here[r], here[r], shift * mass.of_component(r));
                for c in r..6 {
                    add(here[r], here[c], own[r][c]);
                }
                for c in 0..if i + 1 < n { 6 } else { 0 } {
                    add(here[r], ahead[c], next[r][c]);
                }
            }
            if let Some(spring) = system.node_coupling(j, i)
                && (unknowns.first_tip_unknown.is_none() || i + 1 < n)
            {
                let other = unknowns.node_numbers(j + 1, i);
                for c in (0..3).filter(|&c| unknowns.coupled[3 + c]) {
                    add(here[3 + c], other[3 + c], -spring[c]);
                }
            }
            if let Some(across) = system.gap_block(j, i) {
                let other = unknowns.node_numbers(j + 1, i);
                for (r, row) in across.iter().enumerate() {
                    for (c, value) in row.iter().enumerate() {
                        // The displacement of a joint tip meets itself, in either order.
                        let both = if here[r] == other[c] { 2.0 } else { 1.0 };
                        add(here[r], other[c], both * value);
                    }
                }
            }
        }
        for i in 0..n - 1 {
            let Some([ahead, crossing]) = system.cell_blocks(j, i) else {
                break;
            };
            let [here, next] = [i, i + 1].map(|i| unknowns.node_numbers(j, i));
            let [other, beyond] = [i, i + 1].map(|i| unknowns.node_numbers(j + 1, i));
            for (from, block, to) in [(here, ahead, beyond), (next, crossing, other)] {
                for (r, row) in block.iter().enumerate() {
                    for (c, value) in row.iter().enumerate() {
                        add(from[r], to[c], *value);
                    }
                }
            }
        }
        for (k, row) in border.iter().enumerate() {
            for (i, forces) in row[j].iter().enumerate() {
                for (at, force) in unknowns.node_numbers(j, i).into_iter().zip(forces) {
                    add(at, first_border + k, *force);
                }
            }
        }
    }
    for k in 0..border.len() {
        add(first_border + k, first_border + k, 0.0);
    }
}
