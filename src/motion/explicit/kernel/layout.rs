//! Where the nodes of a leaf lie in arrays.

use super::{BLOCK, WIDTH};

/// Rods lie end to end. Short ones are processed several at a time, as a pack: the segments
/// from one to the next have no stiffness. Measured: leaves of 35 rods of 50 segments take 0.9
/// times as long as rod by rod.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Layout {
    pub rods: usize,
    pub segments: usize,
    /// Entries from a rod to the next: at least one is not a node.
    pub stride: usize,
    /// Rods of a pack; the last pack may have fewer.
    pub pack: usize,
}

impl Layout {
    /// `alike`: whether all neighbours are coupled in the same way, as in a pack they must be.
    pub fn new(rods: usize, segments: usize, alike: bool) -> Self {
        let stride = (segments + 2).next_multiple_of(WIDTH / 2);
        // An even number, so that packs begin at multiples of the width.
        let pack = BLOCK / (2 * stride) * 2;
        let (stride, pack) = match alike && rods > 1 && pack > 0 {
            true => (stride, pack),
            false => ((segments + 2).next_multiple_of(WIDTH), 1),
        };
        Layout {
            rods,
            segments,
            stride,
            pack,
        }
    }

    /// Number of packs.
    pub fn packs(&self) -> usize {
        self.rods.div_ceil(self.pack)
    }

    /// Rods of pack `p`.
    pub fn rods_of(&self, p: usize) -> std::ops::Range<usize> {
        p * self.pack..((p + 1) * self.pack).min(self.rods)
    }

    /// Entries of a full pack.
    pub fn entries(&self) -> usize {
        self.pack * self.stride
    }

    /// The pack of node `i` of rod `j`, and its index there.
    pub fn place(&self, j: usize, i: usize) -> (usize, usize) {
        (j / self.pack, j % self.pack * self.stride + i)
    }

    /// Index of node `i` of rod `j` in arrays of the whole leaf.
    pub fn at(&self, j: usize, i: usize) -> usize {
        self.front() + j * self.stride + i
    }

    /// Entries before the first node: the first rod reads those of a neighbour there.
    pub fn front(&self) -> usize {
        self.stride.next_multiple_of(WIDTH)
    }

    /// Length of arrays of the whole leaf, and of a pack: loops read up to a node beyond.
    pub fn lengths(&self) -> [usize; 2] {
        let pack = self.entries() + WIDTH;
        [self.front() + self.packs() * self.entries() + pack, pack]
    }
}
