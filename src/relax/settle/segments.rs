//! Segments of the coarsest grid, as requested or as needed.

use crate::leaf::Leaf;
use crate::memory;
use crate::refusal::RefusedOption;
use crate::relax::nested::FINEST;
use crate::relax::request::method::Method;
use crate::relax::request::options::{MAX_NODES, RelaxError};
use crate::relax::request::problem::COARSEST;
use crate::relax::settle::methods::moment;

/// Segments of the coarsest grid for a loose tolerance: if it is at least [`LOOSE`] or only
/// the shape is requested (forces and eigenvalues have larger errors), and the leaf settles in
/// the valley it starts in.
const COARSEST_OF_LOOSE: usize = 4;
const LOOSE: f64 = 1e-3;

/// Segments of the coarsest grid of a blade, which is narrow at its tip: where it was eight, two bars
/// of 86 were too low by a factor of two.
const COARSEST_OF_BLADES: usize = 16;

/// Rotation per segment (radians) that the coarsest grid must resolve where rest curvature and
/// dead moments alone determine it, and the largest allowed at rest on the coarsest grid of a
/// loose tolerance.
pub const COARSEST_TURN: f64 = 0.8;

/// Whether the method may settle in the valley it starts in: semi-implicit, free to leave
/// saddles, and not disturbed.
fn settles_where_it_starts(method: Method) -> bool {
    matches!(method, Method::SemiImplicit(how) if !how.keep_unstable && how.disturbance.is_none())
}

/// Whether half of a leaf may be solved in place of the whole.
pub fn reducible(method: Method) -> bool {
    settles_where_it_starts(method)
        && matches!(method, Method::SemiImplicit(how) if !how.full_model)
}

/// Segments of the coarsest grid, unless a leaf needs more.
pub fn least(method: Method, tolerance: f64, shape_alone: bool) -> usize {
    let loose = shape_alone || tolerance >= LOOSE;
    match settles_where_it_starts(method) && loose {
        true => COARSEST_OF_LOOSE,
        false => COARSEST,
    }
}

/// Segments of a grid: as requested, or at least `least` and as many as the kinks of the
/// profiles, the rest shape and the dead moments need.
pub fn check_segments(
    leaf: &Leaf,
    requested: Option<usize>,
    least: usize,
) -> Result<usize, RelaxError> {
    let panels = leaf.kinks().len() + 1;
    let found = requested.unwrap_or_else(|| coarsest(leaf, least).max(panels));
    let (rods, segments, least) = (leaf.rods(), found, panels);
    let nodes = rods.saturating_mul(segments);
    if found < least {
        let why = format!(
            "at least {least} are needed, one for every piece between the knots of the profiles"
        );
        return Err(RefusedOption::new("segments", found, why).into());
    }
    if nodes > MAX_NODES {
        return Err(RelaxError::TooManyNodes {
            rods,
            segments,
            nodes,
        });
    }
    memory::grid(rods, segments)?;
    Ok(segments)
}

/// Segments of the coarsest grid.
pub fn coarsest(leaf: &Leaf, least: usize) -> usize {
    let moment = leaf.integral_of_moments();
    let turn = |j: usize| {
        let section = leaf.section(j, 0.5, 1.0);
        let bending = moment / section.couple_stiffness.min_element();
        (section.rest_curvature.length() + bending) * leaf.length(j)
    };
    let turn = match moment::turning(leaf, FINEST) {
        Some(rate) => rate * leaf.length(0),
        None => (0..leaf.rods()).map(turn).fold(0.0, f64::max),
    };
    let mut segments = match leaf.scenario().blade {
        Some(_) => least.max(COARSEST_OF_BLADES),
        None => least,
    };
    while (segments as f64) * COARSEST_TURN < turn && segments < FINEST {
        segments *= 2;
    }
    segments
}
