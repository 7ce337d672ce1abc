//! The matrix times increments.

use super::System;
use crate::leaf::chain::place;
use crate::leaf::state::{Field, Increment};

impl System {
    /// K times increments, coupling included, as of the last assembly, of a leaf in space.
    /// The last displacement slots hold the rods' shares of a joint tip's.
    pub fn product(&self, increments: &Field) -> Field {
        let mut forces: Field = increments.iter().map(|rod| none(rod.len())).collect();
        for (j, rod) in increments.iter().enumerate() {
            let (group, lane) = place(j);
            let chain = self.groups[group].matrix.spatial();
            for (i, own) in rod.iter().enumerate() {
                let (here, beyond) = chain.blocks(i, lane);
                for r in 0..6 {
                    forces[j][i][r] += here[r][r] * own[r];
                    for c in r + 1..6 {
                        forces[j][i][r] += here[r][c] * own[c];
                        forces[j][i][c] += here[r][c] * own[r];
                    }
                }
                if let Some(next) = rod.get(i + 1) {
                    for r in 0..6 {
                        for c in 0..6 {
                            forces[j][i][r] += beyond[r][c] * next[c];
                            forces[j][i + 1][c] += beyond[r][c] * own[r];
                        }
                    }
                }
                if let Some(spring) = self.spring(j, i) {
                    for c in 0..3 {
                        forces[j][i][3 + c] -= spring[c] * increments[j + 1][i][3 + c];
                        forces[j + 1][i][3 + c] -= spring[c] * own[3 + c];
                    }
                }
            }
        }
        forces
    }
}

fn none(nodes: usize) -> Vec<Increment> {
    vec![[0.0; 6]; nodes]
}
