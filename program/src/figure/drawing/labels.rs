//! The header of a page, keys beside and above panels, and labels of points that cover neither curves
//! nor each other.

use crate::figure::drawing::axes::PanelAxes;
use crate::figure::drawing::formats::Font;
use crate::figure::drawing::markers::{Marker, draw_support_marker, draw_tip_marker};
use crate::figure::drawing::veins::DrawnVeins;
use crate::figure::drawing::{
    CURVE_COLORS, Color, Drawing, FONT_SIZE, NOTE_COLOR, PAGE, PageRectangle, Stroke, TEXT_COLOR,
    TextAnchor, rectangle_path, vein_color,
};
use crate::figure::scenario::SupportForm;
use glam::DVec2;

/// Where labels are tried around a point, in pixels.
struct LabelRules {
    /// Between the points on curves that labels keep clear of, and how many there are at most.
    curve_spacing: f64,
    most_curve_points: usize,
    /// From the point to the middle of its label, and in how many directions.
    distances: [f64; 3],
    directions: usize,
    /// A clearance with which the search ends.
    sufficient_clearance: f64,
    /// Points closer than this share a label.
    shared_distance: f64,
}

const LABEL: LabelRules = LabelRules {
    curve_spacing: 4.0,
    most_curve_points: 20_000,
    distances: [11.0, 16.0, 24.0],
    directions: 16,
    sufficient_clearance: 5.0,
    shared_distance: 10.0,
};

/// A text that is to stand next to a point.
struct RequestedLabel {
    at: DVec2,
    text: String,
}

pub struct LabelPlacement {
    cell: PageRectangle,
    /// Points on curves that labels keep clear of.
    curve_points: Vec<DVec2>,
    drawn_labels: Vec<PageRectangle>,
    /// Points that are still to be labelled.
    requested_labels: Vec<RequestedLabel>,
}

impl LabelPlacement {
    pub fn in_rectangle(cell: PageRectangle) -> Self {
        LabelPlacement {
            cell,
            curve_points: Vec::new(),
            drawn_labels: Vec::new(),
            requested_labels: Vec::new(),
        }
    }

    /// Makes labels keep clear of a curve through these points.
    pub fn avoid_curve(&mut self, axes: &PanelAxes, points: &[(f64, f64)]) {
        let places: Vec<DVec2> = points
            .iter()
            .filter_map(|&point| axes.page_position(point))
            .collect();
        self.curve_points.extend(places.first());
        for pair in places.windows(2) {
            let parts = (pair[0].distance(pair[1]) / LABEL.curve_spacing)
                .ceil()
                .max(1.0);
            let room = LABEL
                .most_curve_points
                .saturating_sub(self.curve_points.len());
            let parts = (parts as usize).min(room);
            let place = |k: usize| pair[0].lerp(pair[1], k as f64 / parts as f64);
            self.curve_points.extend((1..=parts).map(place));
        }
    }

    /// Requests a label next to a point; points close to each other share one.
    pub fn request_label(&mut self, at: DVec2, text: &str) {
        let mut wanted = self.requested_labels.iter_mut();
        match wanted.find(|label| label.at.distance(at) < LABEL.shared_distance) {
            Some(label) => label.text += &format!(", {text}"),
            None => self.requested_labels.push(RequestedLabel {
                at,
                text: text.into(),
            }),
        }
    }

    pub fn draw_requested(&mut self, page: &mut Drawing) {
        self.curve_points
            .extend(self.requested_labels.iter().map(|label| label.at));
        for RequestedLabel { at, text } in std::mem::take(&mut self.requested_labels) {
            let size = label_size(&text);
            let places = LABEL.distances.into_iter().flat_map(|distance| {
                (0..LABEL.directions).map(move |k| {
                    let angle = -0.25 * std::f64::consts::PI
                        + std::f64::consts::TAU * k as f64 / LABEL.directions as f64;
                    distance * DVec2::from_angle(angle)
                })
            });
            let cells = places.map(|offset| {
                // Wide labels are placed farther to the side.
                let side = DVec2::new(0.5 * (size.x - size.y).max(0.0) * offset.normalize().x, 0.0);
                PageRectangle::new(at + offset + side - 0.5 * size, size)
            });
            if let Some(best) = clearest_label(cells, |cell| self.clearance(cell)) {
                self.draw_label_at(page, best.label, &text, TEXT_COLOR);
            }
        }
    }

    pub fn draw_label_at(
        &mut self,
        page: &mut Drawing,
        cell: PageRectangle,
        text: &str,
        color: Color,
    ) {
        page.draw_centered_label(
            cell.middle(),
            text,
            FONT_SIZE.tick,
            TextAnchor::Middle,
            color,
        );
        self.drawn_labels.push(cell);
    }

    /// The distance of a label from curves, at most `LABEL.sufficient_clearance`; negative where it leaves
    /// the panel or covers another label.
    pub fn clearance(&self, label: &PageRectangle) -> f64 {
        let inside = label.corner.cmpge(self.cell.corner + 2.0).all()
            && label
                .opposite_corner()
                .cmple(self.cell.opposite_corner() - 2.0)
                .all();
        let apart = |other: &PageRectangle| {
            label.corner.cmpgt(other.opposite_corner() + 1.0).any()
                || label.opposite_corner().cmplt(other.corner - 1.0).any()
        };
        if !inside || !self.drawn_labels.iter().all(apart) {
            return -1.0;
        }
        let (middle, half) = (label.middle(), 0.5 * label.size);
        let far = |place: &DVec2| ((*place - middle).abs() - half).max(DVec2::ZERO).length();
        self.curve_points
            .iter()
            .map(far)
            .fold(LABEL.sufficient_clearance, f64::min)
    }
}

/// A label, or several that are placed together, with the least of their clearances.
pub struct ClearLabel<T> {
    pub label: T,
    pub clearance: f64,
}

/// The first of these labels that is clear enough, or the clearest of all.
pub fn clearest_label<T>(
    labels: impl Iterator<Item = T>,
    clearance: impl Fn(&T) -> f64,
) -> Option<ClearLabel<T>> {
    let mut best: Option<ClearLabel<T>> = None;
    for label in labels {
        let clearance = clearance(&label);
        if best.as_ref().is_none_or(|best| clearance > best.clearance) {
            best = Some(ClearLabel { label, clearance });
        }
        if clearance >= LABEL.sufficient_clearance {
            break;
        }
    }
    best
}

pub fn label_size(text: &str) -> DVec2 {
    DVec2::new(
        Font::embedded().text_width(text, FONT_SIZE.tick),
        FONT_SIZE.tick,
    )
}

/// A page of the default width with a header whose text begins at `left`.
pub fn new_page(left: f64, title: &str, notes: &[String], leaf: Option<&DrawnVeins>) -> Drawing {
    let mut drawing = Drawing::new(PAGE.width, title);
    drawing.draw_group("header", |page| draw_header(page, left, title, notes, leaf));
    drawing
}

/// Draws the title, cut off where it does not fit, the notes and, given a leaf, the key
/// to its veins. The text begins at `left`.
pub fn draw_header(
    page: &mut Drawing,
    left: f64,
    title: &str,
    notes: &[String],
    leaf: Option<&DrawnVeins>,
) {
    let font = Font::embedded();
    let right = match leaf {
        Some(veins) => draw_vein_legend(page, veins, &font) - 20.0,
        None => page.width - PAGE.right_margin,
    };
    let title = font.shorten_text(title, FONT_SIZE.title, right - left);
    let base = DVec2::new(left, PAGE.title_base_line);
    page.draw_label(base, &title, FONT_SIZE.title, TextAnchor::Start, TEXT_COLOR);
    // Spaces that SVG does not collapse.
    let notes = notes.join("\u{a0}\u{a0}·\u{a0}\u{a0}");
    let base = DVec2::new(left, PAGE.notes_base_line);
    page.draw_label(base, &notes, FONT_SIZE.text, TextAnchor::Start, NOTE_COLOR);
}

/// What keys call supports.
pub const SUPPORT_NAMES: [(SupportForm, &str); 4] = [
    (SupportForm::Clamped, "clamp"),
    (SupportForm::Pinned, "pinned"),
    (SupportForm::Sliding, "slides"),
    (SupportForm::Elastic, "spring"),
];

/// Draws the key at the right end of the header; returns where it starts.
fn draw_vein_legend(page: &mut Drawing, veins: &DrawnVeins, font: &Font) -> f64 {
    const LEGEND_MIDDLE: f64 = 32.0;
    const COLOR_BAR_SIZE: DVec2 = DVec2::new(120.0, 9.0);
    const COLOR_BAR_STEPS: u32 = 60;
    let mut x = page.width - PAGE.right_margin;
    let text_before = |page: &mut Drawing, x: &mut f64, text: &str| {
        page.draw_centered_label(
            DVec2::new(*x, LEGEND_MIDDLE),
            text,
            FONT_SIZE.text,
            TextAnchor::End,
            NOTE_COLOR,
        );
        *x -= font.text_width(text, FONT_SIZE.text) + 6.0;
    };
    if veins.count > 1 {
        text_before(page, &mut x, &veins.count.to_string());
        x -= COLOR_BAR_SIZE.x;
        let corner = DVec2::new(x, LEGEND_MIDDLE - 0.5 * COLOR_BAR_SIZE.y);
        let part = DVec2::new(
            COLOR_BAR_SIZE.x / f64::from(COLOR_BAR_STEPS),
            COLOR_BAR_SIZE.y,
        );
        for i in 0..COLOR_BAR_STEPS {
            let color = vein_color(f64::from(i) / f64::from(COLOR_BAR_STEPS - 1));
            // Each part extends below the next, so that there are no gaps.
            let overlap = if i + 1 < COLOR_BAR_STEPS { 0.5 } else { 0.0 };
            let start = corner + f64::from(i) * DVec2::new(part.x, 0.0);
            let size = part + DVec2::new(overlap, 0.0);
            page.draw_shape(rectangle_path(start, size), color, None);
        }
        x -= 6.0;
        text_before(page, &mut x, "vein 1");
        x -= 16.0;
    }
    let tips = if veins.tips.len() > 1 { "tips" } else { "tip" };
    let mut entry = |page: &mut Drawing, name: &str, marker: &dyn Fn(&mut Drawing, DVec2)| {
        text_before(page, &mut x, name);
        marker(page, DVec2::new(x - 3.0, LEGEND_MIDDLE));
        x -= 26.0;
    };
    if veins.tip_support.is_none() {
        entry(page, tips, &draw_tip_marker);
    }
    for (how, name) in SUPPORT_NAMES {
        if veins.has_held_ends(how) || veins.has_grips(how) {
            entry(page, name, &|page, at| draw_support_marker(page, at, how));
        }
    }
    x + 16.0
}

/// Sizes of keys, in pixels.
struct LegendSizes {
    sample_height: f64,
    /// Between a sample and its name.
    name_gap: f64,
    /// Height of a line of text in a column of entries, and the gap below an entry.
    line: f64,
    entry_gap: f64,
    /// Height of a row of entries, and the gap between its entries.
    row: f64,
    row_entry_gap: f64,
}

const LEGEND: LegendSizes = LegendSizes {
    sample_height: 12.0,
    name_gap: 7.0,
    line: 15.0,
    entry_gap: 7.0,
    row: 20.0,
    row_entry_gap: 20.0,
};

/// Most of many curves that a key names.
pub const MOST_CURVES_NAMED: usize = 7;

/// What a key says of a curve.
pub struct LegendText {
    pub name: String,
    pub note: String,
}

/// The key of a panel: a column of samples with their names.
pub struct Legend {
    /// Left end and middle of the next entry's first line.
    at: DVec2,
}

impl Legend {
    const SAMPLE_WIDTH: f64 = 26.0;

    pub fn right_of(panel: PageRectangle) -> Self {
        Legend {
            at: DVec2::new(panel.opposite_corner().x + 14.0, panel.corner.y + 8.0),
        }
    }

    /// Adds a sample with a name and a note, in as many lines as they need.
    pub fn add_entry(
        &mut self,
        page: &mut Drawing,
        name: &str,
        note: &str,
        sample: impl FnOnce(&mut Drawing, PageRectangle),
    ) {
        let font = Font::embedded();
        sample(page, sample_rectangle(self.at, Self::SAMPLE_WIDTH));
        let left = self.at.x + Self::SAMPLE_WIDTH + LEGEND.name_gap;
        let room = page.width - 6.0 - left;
        for (text, color) in [(name, TEXT_COLOR), (note, NOTE_COLOR)] {
            for line in font.wrap_text(text, FONT_SIZE.tick, room) {
                let line = font.shorten_text(&line, FONT_SIZE.tick, room);
                let at = DVec2::new(left, self.at.y);
                page.draw_centered_label(at, &line, FONT_SIZE.tick, TextAnchor::Start, color);
                self.at.y += LEGEND.line;
            }
        }
        self.at.y += LEGEND.entry_gap;
    }

    pub fn add_line(&mut self, page: &mut Drawing, name: &str, note: &str, stroke: Stroke) {
        self.add_entry(page, name, note, |page, cell| {
            cell.draw_midline(page, stroke)
        });
    }

    /// Adds the first of numbered curves with their names and notes.
    pub fn add_curves(
        &mut self,
        page: &mut Drawing,
        curves: impl ExactSizeIterator<Item = LegendText>,
    ) {
        let more = curves.len().saturating_sub(MOST_CURVES_NAMED);
        for (LegendText { name, note }, color) in curves.take(MOST_CURVES_NAMED).zip(CURVE_COLORS) {
            self.add_line(page, &name, &note, Stroke::new(color, 1.8));
        }
        if more > 0 {
            self.add_entry(page, "", &format!("and {more} more"), |_, _| ());
        }
    }

    /// Adds a line with marked points.
    pub fn add_marked_line(&mut self, page: &mut Drawing, name: &str, note: &str, color: Color) {
        self.add_entry(page, name, note, |page, cell| {
            cell.draw_midline(page, Stroke::new(color, 1.6));
            Marker::Dot.draw(page, cell.middle(), color);
        });
    }

    pub fn add_marker(
        &mut self,
        page: &mut Drawing,
        name: &str,
        note: &str,
        marker: Marker,
        color: Color,
    ) {
        self.add_entry(page, name, note, |page, cell| {
            marker.draw(page, cell.middle(), color)
        });
    }
}

/// A key above the panels: rows of samples with their names.
pub struct LegendRows {
    left: f64,
    at: DVec2,
    sample: f64,
}

impl LegendRows {
    /// Rows that begin at `left`, the first with its base line at `base`, with samples of
    /// this width.
    pub fn starting_at(left: f64, base: f64, sample: f64) -> Self {
        LegendRows {
            left,
            at: DVec2::new(left, base - 0.36 * FONT_SIZE.text),
            sample,
        }
    }

    pub fn add_entry(
        &mut self,
        page: &mut Drawing,
        name: &str,
        sample: impl FnOnce(&mut Drawing, PageRectangle),
    ) {
        let width =
            self.sample + LEGEND.name_gap + Font::embedded().text_width(name, FONT_SIZE.text);
        if self.at.x > self.left && self.at.x + width > page.width - PAGE.right_margin {
            self.at = DVec2::new(self.left, self.at.y + LEGEND.row);
        }
        sample(page, sample_rectangle(self.at, self.sample));
        let text = self.at + DVec2::new(self.sample + LEGEND.name_gap, 0.0);
        page.draw_centered_label(text, name, FONT_SIZE.text, TextAnchor::Start, TEXT_COLOR);
        self.at.x += width + LEGEND.row_entry_gap;
    }

    pub fn bottom(&self) -> f64 {
        self.at.y + 18.0
    }
}

fn sample_rectangle(at: DVec2, width: f64) -> PageRectangle {
    PageRectangle::new(
        at - DVec2::new(0.0, 0.5 * LEGEND.sample_height),
        DVec2::new(width, LEGEND.sample_height),
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::figure::drawing::DrawingElement;
    use crate::figure::drawing::axes::Axis;

    #[test]
    fn labels_cover_neither_curves_nor_each_other() {
        let cell = PageRectangle::new(DVec2::ZERO, DVec2::new(300.0, 200.0));
        let axes = PanelAxes {
            cell,
            across: Axis::linear("", 0.0, 1.0),
            up: Axis::linear("", 0.0, 1.0),
        };
        let curves = [0.3, 0.5].map(|slope| [(0.0, 0.2), (1.0, 0.2 + slope)]);
        let mut labels = LabelPlacement::in_rectangle(cell);
        let mut points = Vec::new();
        for curve in &curves {
            labels.avoid_curve(&axes, curve);
            let at = |x: f64| (x, curve[0].1 + x * (curve[1].1 - curve[0].1));
            points.extend([0.0, 0.1, 0.5, 1.0].map(at));
        }
        for (k, &point) in points.iter().enumerate() {
            labels.request_label(axes.page_position(point).unwrap(), &(k + 1).to_string());
        }
        let taken = labels.curve_points.clone();
        let mut page = Drawing::new(300.0, "");
        labels.draw_requested(&mut page);
        let label = |mark| match mark {
            DrawingElement::Label(label) => Some(label),
            _ => None,
        };
        let texts: Vec<_> = page.elements.into_iter().filter_map(label).collect();
        // Both curves begin at one point: labels there are shared.
        assert_eq!(texts[0].text, "1, 5");
        assert_eq!(texts.len(), 6);
        let font = Font::embedded();
        let boxes = texts.iter().map(|label| {
            let size = DVec2::new(font.text_width(&label.text, label.size), 0.7 * label.size);
            let corner = label.position - DVec2::new(0.5 * size.x, size.y);
            PageRectangle { corner, size }
        });
        let boxes: Vec<PageRectangle> = boxes.collect();
        for (k, one) in boxes.iter().enumerate() {
            let covers = |place: &DVec2| {
                place.cmpgt(one.corner).all() && place.cmplt(one.opposite_corner()).all()
            };
            assert!(!taken.iter().any(covers), "{}", texts[k].text);
            assert!(
                one.corner.cmpge(cell.corner).all()
                    && one.opposite_corner().cmple(cell.opposite_corner()).all()
            );
            for other in &boxes[..k] {
                let apart = one.corner.cmpgt(other.opposite_corner()).any()
                    || one.opposite_corner().cmplt(other.corner).any();
                assert!(apart, "{}", texts[k].text);
            }
        }
    }
}
