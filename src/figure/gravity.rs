//! The direction of gravity, drawn in a corner of a view.

use glam::DVec2;

use super::drawing::{Anchor, Drawing, INK, NOTE, Stroke, circle, polygon};
use super::page::{Cell, TICK_SIZE};

/// Length in pixels of an arrow that lies in the plane of the page.
const ARROW: f64 = 30.0;
/// A shorter arrow is drawn end-on.
const END_ON: f64 = 0.2;
/// From the sides of a panel to the middle of the arrow.
const INSET: DVec2 = DVec2::new(28.0, 32.0);

/// Draws it with its name in the corner of a panel that is farthest from the points
/// `taken`. `direction` is the projection of its unit vector onto the page, `toward`
/// whether it points towards the viewer.
pub fn draw(
    page: &mut Drawing,
    cell: Cell,
    taken: impl Iterator<Item = DVec2>,
    direction: DVec2,
    toward: bool,
) {
    let at = cell.free_corner(INSET, taken);
    let stroke = Stroke::new(INK, 1.3);
    if direction.length() < END_ON {
        page.stroke(circle(at, 6.0), stroke);
        match toward {
            true => page.shape(circle(at, 1.8), INK, None),
            false => {
                for arm in [DVec2::new(4.2, 4.2), DVec2::new(4.2, -4.2)] {
                    page.line(at - arm, at + arm, stroke);
                }
            }
        }
    } else {
        let (half, along) = (0.5 * ARROW * direction, direction.normalize());
        let (end, across) = (at + half, 3.4 * along.perp());
        let neck = end - 8.0 * along;
        page.line(at - half, neck, stroke);
        page.shape(polygon(&[end, neck + across, neck - across]), INK, None);
    }
    let below = 0.5 * ARROW * direction.y.abs().max(0.4) + 11.0;
    let name = at + DVec2::new(0.0, below);
    page.label(name, "gravity", TICK_SIZE, Anchor::Middle, NOTE);
}
