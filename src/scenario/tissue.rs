//! Tissue between neighbouring veins: the table `[tissue]`.

use super::entries::Entries;
use super::error::Result;
use super::key::Key;

/// Tissue that fills the gap between two neighbouring veins and turns with them. It is without
/// force in the natural leaf: every vein in its rest shape from its base, each for itself.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Tissue {
    /// k1, k2 and k3, force per displacement and length of leaf, along the directors between both
    /// veins: against neighbours that slide along each other, against a change of the width, and
    /// against one vein that rises above the other.
    pub stiffness: [f64; 3],
    /// c1, moment per angle and length of leaf, against a fold along the veins.
    pub fold: f64,
}

/// Reads `[tissue]` of a leaf with so many gaps; `None` if no gap has any.
pub(super) fn tissue(entries: &Entries, gaps: usize) -> Result<Option<Vec<Tissue>>> {
    let mut tissue = vec![Tissue::default(); gaps];
    for (which, key) in Key::TISSUE.into_iter().enumerate() {
        let Some(item) = entries.given(key) else {
            continue;
        };
        let why = "tissue lies between veins: it needs leaf.rods = 2 or more";
        item.ensure(gaps > 0, why)?;
        for (gap, stiffness) in tissue.iter_mut().zip(item.one_each(gaps)?) {
            match which {
                3 => gap.fold = stiffness,
                axis => gap.stiffness[axis] = stiffness,
            }
        }
    }
    let some = tissue.iter().any(|gap| *gap != Tissue::default());
    Ok(some.then_some(tissue))
}
