//! Whether the data contradict the model at a minimum.

use super::case::{Compared, Component};
use super::quantity::{Kind, Quantity};
use super::statistics::Statistics;
use crate::scenario::longest;

/// Coordinates this far from the fitted leaf, in lengths of the longest rod, are hardly those of
/// this leaf under these loads; and this far from the base, not of any leaf of this length.
const MISSED: f64 = 0.5;
pub(super) const BEYOND: f64 = 3.0;

/// Data that are far from the model: coordinates by a part of the leaf's length, and frequencies by
/// that part of the larger one.
pub(super) fn misses<'s>(stats: &'s Statistics) -> impl Iterator<Item = &'s Component> {
    let longest = longest(&stats.model.base.scenario().rods);
    let pixel = stats.model.pixel();
    stats.point.components().filter(move |component| {
        let (data, model) = (component.observed.abs(), component.model.abs());
        let size = match component.what {
            Compared::Vein { .. } if component.what.kind() == Kind::Pixel => longest / pixel,
            Compared::Vein { .. } | Compared::Result(Quantity::Tip(_)) => longest,
            Compared::Result(Quantity::Frequency(_)) => data.max(model),
            Compared::Result(Quantity::Reaction(_) | Quantity::Grip(..)) => f64::INFINITY,
        };
        let beyond = component.what.kind() == Kind::Length && data > BEYOND * longest;
        beyond || (component.observed - component.model).abs() > MISSED * size
    })
}

/// Whether the residuals are those of a model that does not describe the data: beyond what their
/// standard deviations allow, or, without these, as large as the leaf.
pub(super) fn contradicts(stats: &Statistics) -> bool {
    let robust = stats.weighting.robust;
    if stats.known && !robust {
        return stats.suspicious();
    }
    // A robust fit has outliers.
    let permitted = match robust {
        true => stats.residuals.len() / 2,
        false => 0,
    };
    misses(stats).count() > permitted
}
