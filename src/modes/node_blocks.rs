//! A matrix that ties neighbouring nodes of each rod alone, as the derivatives of loads on sections and of the
//! drag on segments do: its blocks from few products, and its transpose.

use crate::leaf::NodalField;

/// Six rows and columns: rotation, then displacement.
type Block = [[f64; 6]; 6];

/// Nodes that are this far apart have no block in common, so that one product tells the blocks of all of them.
const STRIDE: usize = 3;

/// The blocks of every node of every rod: with the node before it, itself and the next one.
pub struct NodeBlocks(Vec<Vec<[Block; STRIDE]>>);

impl NodeBlocks {
    /// The blocks of the matrix that `product` adds the products of; `zeros` has the nodes.
    pub fn probe(zeros: &NodalField, product: &dyn Fn(&NodalField, &mut NodalField)) -> Self {
        let rod = |nodes: &Vec<[f64; 6]>| vec![[[[0.0; 6]; 6]; STRIDE]; nodes.len()];
        let mut blocks: Vec<Vec<[Block; STRIDE]>> = zeros.iter().map(rod).collect();
        for color in 0..STRIDE {
            for column in 0..6 {
                let mut unit = zeros.clone();
                for rod in &mut unit {
                    let nodes = rod.iter_mut().skip(color).step_by(STRIDE);
                    nodes.for_each(|node| node[column] = 1.0);
                }
                let mut image = zeros.clone();
                product(&unit, &mut image);
                for (own, image) in blocks.iter_mut().zip(&image) {
                    for (i, (own, image)) in own.iter_mut().zip(image).enumerate() {
                        // The neighbour of this color: i - 1, i or i + 1.
                        let beside = (color + STRIDE + 1 - i % STRIDE) % STRIDE;
                        for row in 0..6 {
                            own[beside][row][column] = image[row];
                        }
                    }
                }
            }
        }
        NodeBlocks(blocks)
    }

    /// Adds the transpose times a field.
    pub fn add_transposed_product(&self, field: &NodalField, sum: &mut NodalField) {
        for ((rod, field), sum) in self.0.iter().zip(field).zip(sum) {
            for (i, (blocks, node)) in rod.iter().zip(field).enumerate() {
                for (beside, block) in blocks.iter().enumerate() {
                    let Some(on) = (i + beside).checked_sub(1).and_then(|k| sum.get_mut(k)) else {
                        continue;
                    };
                    for (row, value) in block.iter().zip(node) {
                        let parts = on.iter_mut().zip(row);
                        parts.for_each(|(on, entry)| *on += entry * value);
                    }
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Products of a matrix with its neighbours, and of its transpose: v . A w = w . A^T v.
    #[test]
    fn the_transpose_is_that_of_the_matrix() {
        let golden = |k: usize| (k as f64 * 0.618_033_988_749_895).fract() - 0.5;
        let entry = |j: usize, i: usize, k: usize, r: usize, c: usize| {
            golden(1 + c + 6 * (r + 6 * (k + 20 * (i + 20 * j))))
        };
        let zeros: NodalField = vec![vec![[0.0; 6]; 7], vec![[0.0; 6]; 5]];
        let product = |field: &NodalField, sum: &mut NodalField| {
            for (j, rod) in field.iter().enumerate() {
                for i in 0..rod.len() {
                    for k in i.saturating_sub(1)..(i + 2).min(rod.len()) {
                        for r in 0..6 {
                            for c in 0..6 {
                                sum[j][i][r] += entry(j, i, k, r, c) * rod[k][c];
                            }
                        }
                    }
                }
            }
        };
        let filled = |shift: usize| -> NodalField {
            let mut field = zeros.clone();
            let numbers = field.iter_mut().flatten().flatten().enumerate();
            numbers.for_each(|(k, value)| *value = golden(k + shift));
            field
        };
        let dot = |a: &NodalField, b: &NodalField| -> f64 {
            let both = a
                .iter()
                .flatten()
                .flatten()
                .zip(b.iter().flatten().flatten());
            both.map(|(a, b)| a * b).sum()
        };
        let (v, w) = (filled(3), filled(1000));
        let (mut of_w, mut of_v) = (zeros.clone(), zeros.clone());
        product(&w, &mut of_w);
        NodeBlocks::probe(&zeros, &product).add_transposed_product(&v, &mut of_v);
        let [one, other] = [dot(&v, &of_w), dot(&w, &of_v)];
        assert!(
            (one - other).abs() < 1e-13 && one.abs() > 1e-3,
            "{one} {other}"
        );
    }
}
