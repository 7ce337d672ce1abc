//! What a leaf exerts on what holds it.

use crate::relax::accuracy::richardson::Richardson;
use crate::relax::transfer::level::Level;
use crate::scenario::{Grip, Hold};
use glam::DVec3;
use serde::Serialize;

/// The reaction at a held tip: what the leaf exerts on its holder.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Reaction {
    /// The force.
    #[serde(rename = "tip_reaction")]
    pub force: DVec3,
    /// For a clamp, the moments of the rods about the tip.
    #[serde(
        rename = "tip_reaction_moments",
        skip_serializing_if = "Option::is_none"
    )]
    pub moments: Option<Vec<DVec3>>,
}

/// What the leaf exerts on a grip.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct GripReaction {
    /// The force.
    pub force: DVec3,
    /// For a clamp, the moment about the middle of what it holds.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub moment: Option<DVec3>,
}

/// The reaction at a held tip, after `columns` extrapolations.
pub fn reaction(levels: &[Level], columns: usize) -> Option<Reaction> {
    let leaf = &levels[0].leaf.leaf;
    let held = leaf.held.as_ref()?;
    let on = |level: &Level| {
        let (force, moments) = level.leaf.reaction(&level.state);
        let all = [force].into_iter().chain(moments);
        let values = all.flat_map(|it| it.to_array()).collect();
        (level.leaf.segments(), values)
    };
    let table: Richardson = levels.iter().map(on).collect();
    let mut vectors = table.column(columns).chunks(3).map(DVec3::from_slice);
    let force = vectors.next()? * leaf.scale.force();
    let moments = vectors.map(|moment| moment * leaf.scale.moment()).collect();
    Some(Reaction {
        force,
        moments: held.clamps.is_some().then_some(moments),
    })
}

/// What the leaf exerts on its grips, after `columns` extrapolations.
pub fn grip_reactions(levels: &[Level], columns: usize) -> Vec<GripReaction> {
    let leaf = &levels[0].leaf;
    if !leaf.has_grips() {
        return Vec::new();
    }
    let on = |level: &Level| {
        let reactions = level.leaf.grip_reactions(&level.state);
        let numbers = reactions.as_flattened().iter();
        let values = numbers.flat_map(|it| it.to_array()).collect();
        (level.leaf.segments(), values)
    };
    let table: Richardson = levels.iter().map(on).collect();
    let (scenario, scale) = (leaf.leaf.scenario(), leaf.leaf.scale);
    let reactions = table.column(columns).chunks(6).zip(&scenario.grips);
    let reaction = |(numbers, grip): (&[f64], &Grip)| GripReaction {
        force: DVec3::from_slice(numbers) * scale.force(),
        moment: (grip.held == Hold::Clamped)
            .then(|| DVec3::from_slice(&numbers[3..]) * scale.moment()),
    };
    reactions.map(reaction).collect()
}
