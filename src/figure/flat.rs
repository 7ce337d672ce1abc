//! A panel that looks along one of the axes.

use glam::{DVec2, DVec3};

use super::colors::{FRAME, GRID, INK, NOTE};
use super::drawing::{Anchor, Drawing, HALF_CAPITAL, Path, Step, Stroke, rectangle};
use super::font::Font;
use super::markers::{clamp_marker, dots, tip_markers};
use super::page::{Cell, TEXT_SIZE, TICK_SIZE};
use super::ticks::ticks;
use super::veins::{Vein, Veins};

/// Which way a panel looks.
pub struct View {
    /// Name of its group in the SVG.
    pub name: &'static str,
    letter: &'static str,
    title: &'static str,
    across: Axis,
    up: Axis,
    /// Points towards the viewer.
    toward: DVec3,
}

struct Axis {
    label: &'static str,
    direction: DVec3,
}

const XI: Axis = Axis {
    label: "ξ = x/L",
    direction: DVec3::X,
};
const ETA: Axis = Axis {
    label: "η = y/L",
    direction: DVec3::Y,
};
const ZETA: Axis = Axis {
    label: "ζ = z/L",
    direction: DVec3::Z,
};

pub const TOP: View = View {
    name: "top",
    letter: "(a)",
    title: "from above",
    across: XI,
    up: ETA,
    toward: DVec3::Z,
};

pub const SIDE: View = View {
    name: "side",
    letter: "(b)",
    title: "from the side",
    across: XI,
    up: ZETA,
    toward: DVec3::NEG_Y,
};

pub const FRONT: View = View {
    name: "front",
    letter: "(c)",
    title: "from the front",
    across: ETA,
    up: ZETA,
    toward: DVec3::X,
};

impl View {
    fn flatten(&self, point: DVec3) -> DVec2 {
        DVec2::new(
            self.across.direction.dot(point),
            self.up.direction.dot(point),
        )
    }
}

/// A panel's title, above its frame.
pub fn title(page: &mut Drawing, corner: DVec2, letter: &str, text: &str) {
    let base = corner - DVec2::new(0.0, 8.0);
    page.label(base, letter, TEXT_SIZE, Anchor::Start, INK);
    page.label(
        base + DVec2::new(24.0, 0.0),
        text,
        TEXT_SIZE,
        Anchor::Start,
        NOTE,
    );
}

/// Draws the panel into `cell` with `scale` pixels per length, the leaf in its middle.
pub fn draw(page: &mut Drawing, view: &View, veins: &Veins, cell: Cell, scale: f64, step: f64) {
    let middle = view.flatten(0.5 * (veins.low + veins.high));
    let half = 0.5 * cell.size / scale;
    let frame = Frame {
        cell,
        low: middle - half,
        high: middle + half,
        scale,
    };
    title(page, cell.corner, view.letter, view.title);
    draw_axes(page, view, &frame, step);
    draw_veins(page, view, veins, &frame);
    dots(page, veins, |point| frame.place(view.flatten(point)));
    clamp_marker(page, frame.place(DVec2::ZERO));
    tip_markers(page, veins, |tip| frame.place(view.flatten(tip)));
}

/// From lengths to the page.
struct Frame {
    cell: Cell,
    low: DVec2,
    high: DVec2,
    scale: f64,
}

impl Frame {
    fn place(&self, point: DVec2) -> DVec2 {
        let from_corner = self.scale * (point - self.low);
        let Cell { corner, size } = self.cell;
        DVec2::new(corner.x + from_corner.x, corner.y + size.y - from_corner.y)
    }
}

fn draw_axes(page: &mut Drawing, view: &View, frame: &Frame, step: f64) {
    const TICK_LENGTH: f64 = 4.0;
    let Cell { corner, size } = frame.cell;
    let end = corner + size;
    let across = ticks(frame.low.x, frame.high.x, step);
    let up = ticks(frame.low.y, frame.high.y, step);
    let (grid, rim) = (Stroke::new(GRID, 0.7), Stroke::new(FRAME, 0.8));
    for (value, _) in &across {
        let x = frame.place(DVec2::new(*value, 0.0)).x;
        page.line(DVec2::new(x, corner.y), DVec2::new(x, end.y), grid);
    }
    for (value, _) in &up {
        let y = frame.place(DVec2::new(0.0, *value)).y;
        page.line(DVec2::new(corner.x, y), DVec2::new(end.x, y), grid);
    }
    page.stroke(rectangle(corner, size), rim);
    for (value, text) in &across {
        let foot = DVec2::new(frame.place(DVec2::new(*value, 0.0)).x, end.y);
        page.line(foot, foot + DVec2::new(0.0, TICK_LENGTH), rim);
        let base = foot + DVec2::new(0.0, TICK_LENGTH + 1.2 * TICK_SIZE);
        page.label(base, text, TICK_SIZE, Anchor::Middle, NOTE);
    }
    for (value, text) in &up {
        let foot = DVec2::new(corner.x, frame.place(DVec2::new(0.0, *value)).y);
        page.line(foot, foot - DVec2::new(TICK_LENGTH, 0.0), rim);
        let base = foot + DVec2::new(-TICK_LENGTH - 3.0, HALF_CAPITAL * TICK_SIZE);
        page.label(base, text, TICK_SIZE, Anchor::End, NOTE);
    }
    let below = DVec2::new(0.5 * (corner.x + end.x), end.y + 34.0);
    page.label(below, view.across.label, TEXT_SIZE, Anchor::Middle, INK);
    let font = Font::embedded();
    let widths = up.iter().map(|(_, text)| font.width(text, TICK_SIZE));
    let away = widths.fold(29.0, f64::max) + 13.0;
    let beside = DVec2::new(corner.x - away, 0.5 * (corner.y + end.y));
    page.upright_label(beside, view.up.label, TEXT_SIZE, INK);
}

/// Veins farther from the viewer first.
fn draw_veins(page: &mut Drawing, view: &View, veins: &Veins, frame: &Frame) {
    let nearness = |vein: &Vein| {
        let sum: f64 = vein
            .pieces
            .iter()
            .map(|piece| view.toward.dot(piece[3]))
            .sum();
        sum / vein.pieces.len().max(1) as f64
    };
    let mut order: Vec<&Vein> = veins.veins.iter().collect();
    order.sort_by(|a, b| nearness(a).total_cmp(&nearness(b)));
    for vein in order {
        let path = curve(vein, |point| frame.place(view.flatten(point)));
        page.stroke(path, Stroke::new(vein.color, veins.line_width()));
    }
}

/// The whole vein as one path.
pub fn curve(vein: &Vein, place: impl Fn(DVec3) -> DVec2) -> Path {
    let start = vein.pieces.first().map(|piece| Step::Move(place(piece[0])));
    let rest = vein
        .pieces
        .iter()
        .map(|&[_, a, b, end]| Step::Cubic(place(a), place(b), place(end)));
    start.into_iter().chain(rest).collect()
}
