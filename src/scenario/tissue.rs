//! Tissue between neighbouring veins: the table `[tissue]`.

use super::Profile;
use super::entries::Entries;
use super::error::ScenarioResult;
use super::key::Key;

/// Tissue that fills the gap between two neighbouring veins and turns with them. It is without
/// force in the natural leaf: every vein in its rest shape from its base, each for itself.
#[derive(Clone, Debug, PartialEq)]
pub struct Tissue {
    /// k1, k2 and k3, force per displacement and length of leaf, along the directors between both
    /// veins: against neighbours that slide along each other, against a change of the width, and
    /// against one vein that rises above the other.
    pub stiffness: [Profile; 3],
    /// c1, moment per angle and length of leaf, against a fold along the veins.
    pub fold: Profile,
}

impl Default for Tissue {
    fn default() -> Self {
        Tissue {
            stiffness: [0.0; 3].map(Profile::Constant),
            fold: Profile::Constant(0.0),
        }
    }
}

impl Tissue {
    /// k1, k2, k3 and c1.
    pub(crate) fn profiles(&self) -> [&Profile; 4] {
        let [along, across, normal] = &self.stiffness;
        [along, across, normal, &self.fold]
    }
}

/// Reads `[tissue]` of a leaf with so many gaps; `None` if no gap has any.
pub(super) fn tissue(entries: &Entries, gaps: usize) -> ScenarioResult<Option<Vec<Tissue>>> {
    let mut tissue = vec![Tissue::default(); gaps];
    for (which, key) in Key::TISSUE.into_iter().enumerate() {
        let Some(item) = entries.given(key) else {
            continue;
        };
        let why = "tissue lies between veins: it needs leaf.rods = 2 or more";
        item.ensure(gaps > 0, why)?;
        for (gap, stiffness) in tissue.iter_mut().zip(item.one_each(gaps)?) {
            match which {
                3 => gap.fold = Profile::Constant(stiffness),
                axis => gap.stiffness[axis] = Profile::Constant(stiffness),
            }
        }
    }
    let some = tissue.iter().any(|gap| *gap != Tissue::default());
    Ok(some.then_some(tissue))
}
