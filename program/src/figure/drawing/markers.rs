//! Markers of points, supports and tips, and arrows: directions of gravity and wind in a corner of a
//! panel, dead forces on a rod, and dead moments as curved arrows about their axes by the right-hand
//! rule.

use crate::figure::drawing::formats::Font;
use crate::figure::drawing::{
    Color, Drawing, FONT_SIZE, NOTE_COLOR, PageRectangle, SECOND_SOLUTION_COLOR, Stroke,
    TEXT_COLOR, TextAnchor, WHITE, circle_path, polygon_path, polyline_path, rectangle_path,
};
use crate::figure::scenario::{LoadKind, LoadMark, SupportForm};
use crate::report::numbers::format_four_digits;
use glam::{DVec2, DVec3};
use leafdyn::scenario::Units;
use std::f64::consts::PI;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Marker {
    /// A small disc, for points close to each other.
    Dot,
    Circle,
    Square,
    Triangle,
    Wedge,
    Diamond,
    Ring,
    Cross,
}

impl Marker {
    pub fn draw(self, page: &mut Drawing, at: DVec2, color: Color) {
        let shape = |corners: &[[f64; 2]]| {
            let corners = corners.iter().map(|&corner| at + DVec2::from_array(corner));
            polygon_path(&corners.collect::<Vec<_>>())
        };
        let path = match self {
            Marker::Dot => circle_path(at, 2.4),
            Marker::Circle => circle_path(at, 3.4),
            Marker::Square => shape(&[[-3.1, -3.1], [3.1, -3.1], [3.1, 3.1], [-3.1, 3.1]]),
            Marker::Triangle => shape(&[[0.0, -4.2], [4.0, 3.0], [-4.0, 3.0]]),
            Marker::Wedge => shape(&[[0.0, 4.2], [4.0, -3.0], [-4.0, -3.0]]),
            Marker::Diamond => shape(&[[0.0, -4.4], [4.4, 0.0], [0.0, 4.4], [-4.4, 0.0]]),
            Marker::Ring => {
                return page.draw_shape(circle_path(at, 3.4), WHITE, Some(Stroke::new(color, 1.4)));
            }
            Marker::Cross => return draw_cross(page, at, 3.6, Stroke::new(color, 1.7)),
        };
        page.draw_shape(path, color, Some(Stroke::new(WHITE, 0.8)));
    }
}

fn draw_cross(page: &mut Drawing, at: DVec2, half: f64, stroke: Stroke) {
    for arm in [DVec2::new(half, half), DVec2::new(half, -half)] {
        page.draw_line(at - arm, at + arm, stroke);
    }
}

/// Half the side of the square that marks a clamp, and its white rim, in pixels.
const CLAMP_HALF: f64 = 4.2;
const CLAMP_RIM: f64 = 1.0;

/// Marks where the rods are clamped; larger than the tip's marker, which may cover it.
fn draw_clamp_marker(page: &mut Drawing, at: DVec2) {
    let half = DVec2::splat(CLAMP_HALF);
    let rim = Some(Stroke::new(WHITE, CLAMP_RIM));
    page.draw_shape(rectangle_path(at - half, 2.0 * half), TEXT_COLOR, rim);
}

/// Marks the clamp of several bases, which are points of one line or of several: a bar without gaps.
pub fn draw_clamp_bar(page: &mut Drawing, bases: &[DVec2]) {
    bases.iter().for_each(|&at| draw_clamp_marker(page, at));
    let width = 2.0 * CLAMP_HALF - CLAMP_RIM;
    page.draw_stroke(polyline_path(bases), Stroke::new(TEXT_COLOR, width));
}

/// Marks the joint tip, or the tip of a single rod.
pub fn draw_tip_marker(page: &mut Drawing, at: DVec2) {
    Marker::Ring.draw(page, at, TEXT_COLOR);
}

/// Marks what is held of a vein's end.
pub fn draw_support_marker(page: &mut Drawing, at: DVec2, held: SupportForm) {
    match held {
        SupportForm::Clamped => draw_clamp_marker(page, at),
        SupportForm::Pinned => Marker::Triangle.draw(page, at, TEXT_COLOR),
        SupportForm::Sliding => Marker::Circle.draw(page, at, TEXT_COLOR),
        SupportForm::Elastic => Marker::Diamond.draw(page, at, TEXT_COLOR),
    }
}

/// Radius of the ball that marks a mass, in pixels.
const MASS_RADIUS: f64 = 5.0;

/// Marks a mass that has landed on a vein: a ball.
pub fn draw_mass_marker(page: &mut Drawing, at: DVec2) {
    let rim = Some(Stroke::new(WHITE, 0.8));
    page.draw_shape(circle_path(at, MASS_RADIUS), SECOND_SOLUTION_COLOR, rim);
}

/// Marks a point of a second solution, in a color that no vein has.
pub fn draw_second_solution_dot(page: &mut Drawing, at: DVec2, radius: f64) {
    page.draw_shape(circle_path(at, radius), SECOND_SOLUTION_COLOR, None);
}

/// The arrow of a direction in a corner of a panel, in pixels.
struct CornerArrow {
    /// Length of the arrow of a direction in the plane of the page.
    length: f64,
    /// A projection that is a shorter part of its direction is drawn end-on.
    end_on: f64,
    /// From the sides of the panel to the middle of the arrow.
    inset: DVec2,
}

const CORNER_ARROW: CornerArrow = CornerArrow {
    length: 30.0,
    end_on: 0.2,
    inset: DVec2::new(28.0, 32.0),
};

/// A direction as a panel shows it.
#[derive(Clone, Copy)]
pub struct ProjectedDirection {
    /// Projection of its unit vector onto the page.
    pub on_page: DVec2,
    pub is_toward_viewer: bool,
}

/// Draws a direction with its name in the corner of a panel that is farthest from the points
/// `taken`; returns where.
pub fn draw_direction_arrow(
    page: &mut Drawing,
    cell: PageRectangle,
    taken: &[DVec2],
    direction: ProjectedDirection,
    name: &str,
) -> DVec2 {
    let at = cell.emptiest_corner(CORNER_ARROW.inset, taken.iter().copied());
    let stroke = Stroke::new(TEXT_COLOR, 1.3);
    let ProjectedDirection {
        on_page: direction,
        is_toward_viewer,
    } = direction;
    if direction.length() < CORNER_ARROW.end_on {
        page.draw_stroke(circle_path(at, 6.0), stroke);
        match is_toward_viewer {
            true => page.draw_shape(circle_path(at, 1.8), TEXT_COLOR, None),
            false => draw_cross(page, at, 4.2, stroke),
        }
    } else {
        let (half, along) = (0.5 * CORNER_ARROW.length * direction, direction.normalize());
        let (end, across) = (at + half, 3.4 * along.perp());
        let neck = end - 8.0 * along;
        page.draw_line(at - half, neck, stroke);
        page.draw_shape(
            polygon_path(&[end, neck + across, neck - across]),
            TEXT_COLOR,
            None,
        );
    }
    let below = 0.5 * CORNER_ARROW.length * direction.y.abs().max(0.4) + 11.0;
    let foot = at + DVec2::new(0.0, below);
    page.draw_label(foot, name, FONT_SIZE.tick, TextAnchor::Middle, NOTE_COLOR);
    at
}

/// Sizes of the arrow of a force, in pixels.
struct ForceArrowSizes {
    /// Length and half the width of the head, and of those along a rod.
    head: [f64; 2],
    small_head: [f64; 2],
    /// From the arrow to its label.
    label_gap: f64,
    /// A shorter arrow is seen end-on.
    end_on: f64,
}

const FORCE_ARROW: ForceArrowSizes = ForceArrowSizes {
    head: [10.0, 4.2],
    small_head: [6.0, 2.6],
    label_gap: 9.0,
    end_on: 6.0,
};

/// The arrow of a force on a vein.
pub struct ForceArrow {
    /// From its tail to its head.
    pub ends: [DVec3; 2],
    /// Of a force off the axis: from the axis to its point.
    arm: Option<[DVec3; 2]>,
    head: [f64; 2],
    /// Empty of those along the vein.
    label: String,
}

/// A point of a vein, with the unit tangent there.
pub struct RodPoint {
    pub position: DVec3,
    /// From the axis to the point.
    pub arm: DVec3,
    pub tangent: DVec3,
}

/// The forces on a leaf whose largest extent is `extent`, of those that load it; `at` gives the point at a
/// fraction of the length of a vein, or off its axis there.
pub fn force_arrows(
    marks: &[LoadMark],
    units: &Units,
    extent: f64,
    at: impl Fn(usize, f64, [f64; 2]) -> Option<RodPoint>,
) -> Vec<ForceArrow> {
    let unit = units.force.as_deref();
    let unit = unit.map_or(String::new(), |unit| format!(" {unit}"));
    let arrow = |mark: &LoadMark| {
        let RodPoint {
            position,
            arm,
            tangent,
        } = at(mark.vein, mark.at, mark.offset)?;
        let along = mark.action == LoadKind::Distributed;
        // One that pushes against the rod ends at the point, any other begins there.
        let pushes = mark.direction.dot(tangent) < -0.5;
        let start = if pushes || along { -1.0 } else { 0.0 };
        let reach = mark.length * extent * mark.direction;
        Some(ForceArrow {
            ends: [start, start + 1.0].map(|part| position + part * reach),
            arm: (arm != DVec3::ZERO).then_some([position - arm, position]),
            head: if along {
                FORCE_ARROW.small_head
            } else {
                FORCE_ARROW.head
            },
            label: match along {
                true => String::new(),
                false => format!("force {}{unit}", format_four_digits(mark.size)),
            },
        })
    };
    let kinds = [LoadKind::Force, LoadKind::Distributed];
    let forces = marks.iter().filter(|mark| kinds.contains(&mark.action));
    forces.filter_map(arrow).collect()
}

impl ForceArrow {
    /// What it says of its force; empty of those along a vein.
    pub fn label(&self) -> &str {
        &self.label
    }

    /// Draws it without its label.
    pub fn draw(&self, page: &mut Drawing, place: impl Fn(DVec3) -> DVec2) {
        if let Some([axis, point]) = self.arm.map(|ends| ends.map(&place)) {
            page.draw_line(axis, point, Stroke::new(TEXT_COLOR, 1.0).with_dashes(true));
        }
        let [tail, tip] = self.ends.map(place);
        let [length, half] = self.head;
        let along = (tip - tail).normalize_or_zero();
        if (tip - tail).length() > FORCE_ARROW.end_on {
            let (neck, side) = (tip - length * along, half * along.perp());
            page.draw_line(tail, neck, Stroke::new(TEXT_COLOR, 1.5));
            page.draw_shape(
                polygon_path(&[tip, neck + side, neck - side]),
                TEXT_COLOR,
                None,
            );
        }
    }

    /// Draws its label, which stays inside the panel.
    pub fn draw_label(
        &self,
        page: &mut Drawing,
        cell: PageRectangle,
        place: impl Fn(DVec3) -> DVec2,
    ) {
        let [tail, tip] = self.ends.map(place);
        let along = (tip - tail).normalize_or_zero();
        // Beside the middle of the arrow, or below it where it lies flat.
        let size = DVec2::new(
            Font::embedded().text_width(&self.label, FONT_SIZE.tick),
            FONT_SIZE.tick,
        );
        let side = if along.x.abs() < 0.7 {
            DVec2::X
        } else {
            DVec2::Y
        };
        let reach = FORCE_ARROW.label_gap + 0.5 * (size * side).element_sum();
        let middle = 0.5 * (tail + tip) + reach * side;
        let (low, high) = (
            cell.corner + 0.5 * size + 3.0,
            cell.opposite_corner() - 0.5 * size - 3.0,
        );
        let middle = middle.max(low).min(high);
        page.draw_centered_label(
            middle,
            &self.label,
            FONT_SIZE.tick,
            TextAnchor::Middle,
            NOTE_COLOR,
        );
    }
}

/// The curved arrow of a moment.
struct MomentArc {
    /// Radius of the arc, as a part of the leaf's largest extent.
    radius: f64,
    /// Along the arrow, and pieces of which it is drawn.
    angle: f64,
    pieces: usize,
    /// Length and half the width of its head, in pixels.
    head: [f64; 2],
}

const MOMENT_ARC: MomentArc = MomentArc {
    radius: 0.06,
    angle: 1.5 * PI,
    pieces: 24,
    head: [8.0, 3.4],
};

/// A dead moment, or one per length.
pub struct MomentArrow {
    pub position: DVec3,
    /// Unit vector about which the moment turns.
    pub axis: DVec3,
    pub size: f64,
    pub is_per_length: bool,
}

/// The moments on a leaf, of those that load it; `at` gives the point at a fraction of the length of a
/// vein.
pub fn moment_arrows(
    marks: &[LoadMark],
    at: impl Fn(usize, f64) -> Option<DVec3>,
) -> Vec<MomentArrow> {
    let kinds = [LoadKind::Moment, LoadKind::Couple];
    let moments = marks.iter().filter(|mark| kinds.contains(&mark.action));
    let moment = |mark: &LoadMark| {
        Some(MomentArrow {
            axis: mark.direction,
            size: mark.size,
            is_per_length: mark.action == LoadKind::Couple,
            position: at(mark.vein, mark.at)?,
        })
    };
    moments.filter_map(moment).collect()
}

impl MomentArrow {
    /// Draws it on a leaf of this extent.
    pub fn draw(&self, page: &mut Drawing, extent: f64, place: impl Fn(DVec3) -> DVec2) {
        let across = self.axis.any_orthonormal_vector();
        let other = self.axis.cross(across);
        let point = |k: usize| {
            let (sin, cos) = (MOMENT_ARC.angle * k as f64 / MOMENT_ARC.pieces as f64).sin_cos();
            place(self.position + MOMENT_ARC.radius * extent * (cos * across + sin * other))
        };
        let points: Vec<DVec2> = (0..=MOMENT_ARC.pieces).map(point).collect();
        page.draw_stroke(polyline_path(&points), Stroke::new(TEXT_COLOR, 1.3));
        let end = points[MOMENT_ARC.pieces];
        if let Some(along) = (end - points[MOMENT_ARC.pieces - 1]).try_normalize() {
            let [length, half] = MOMENT_ARC.head;
            let (tip, side) = (end + 0.5 * length * along, half * along.perp());
            let back = tip - length * along;
            page.draw_shape(
                polygon_path(&[tip, back + side, back - side]),
                TEXT_COLOR,
                None,
            );
        }
    }
}
