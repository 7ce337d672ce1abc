//! Several leaves in small panels, seen by one camera, to one scale.

use crate::figure::drawing::{Color, Drawing, NOTE};
use crate::figure::layout::{Cell, PANEL_TITLE, WIDTH, title_in};
use crate::figure::round::round_step;
use crate::figure::setting::Setting;
use crate::figure::space::{Camera, Margins, OBLIQUE, Scene, View, common_box};
use crate::figure::veins::Veins;
use crate::report::numbers::short;
use glam::{DVec2, DVec3};

const COLUMNS: usize = 4;
/// Margin to the left and right of the panels.
pub const SIDE: f64 = 22.0;
const PANEL_GAP: f64 = 12.0;
const LOWEST: f64 = 110.0;
const HIGHEST: f64 = 330.0;
const BOTTOM: f64 = 10.0;
/// Least pixels between grid lines.
const GRID: f64 = 17.0;
/// Factor of the line width of veins in small panels.
pub const THINNER: f64 = 0.75;

const MARGINS: Margins = Margins {
    left: 14.0,
    right: 14.0,
    below: 14.0,
};

/// Where the panels are, and the box that all of them show.
pub struct SmallPanels<'s> {
    bounds: [DVec3; 2],
    setting: &'s Setting,
    /// Displayed width of a square of the grid.
    step: f64,
    size: DVec2,
    top: f64,
    count: usize,
}

impl<'s> SmallPanels<'s> {
    /// `count` panels from `top` on that can hold any of these shapes.
    pub fn holding<'a>(
        shapes: impl Iterator<Item = &'a Veins>,
        count: usize,
        setting: &'s Setting,
        top: f64,
    ) -> Self {
        let bounds = common_box(shapes);
        let width = (WIDTH - 2.0 * SIDE - (COLUMNS - 1) as f64 * PANEL_GAP) / COLUMNS as f64;
        let extent = Camera::facing(OBLIQUE).extent(bounds);
        let height = (width - MARGINS.left - MARGINS.right) * extent.y / extent.x + MARGINS.below;
        let size = DVec2::new(width, height.clamp(LOWEST, HIGHEST));
        let scale = (MARGINS.inside(size) / extent).min_element();
        SmallPanels {
            bounds,
            step: round_step(setting.scale() * GRID / scale),
            setting,
            size,
            top,
            count,
        }
    }

    /// Formats the width of a square of the grid.
    pub fn grid_width(&self) -> String {
        format!("{} {}", short(self.step), self.setting.unit())
    }

    fn cell(&self, index: usize) -> Cell {
        let place = DVec2::new((index % COLUMNS) as f64, (index / COLUMNS) as f64);
        let pitch = self.size + DVec2::new(PANEL_GAP, PANEL_TITLE + PANEL_GAP);
        Cell::new(
            DVec2::new(SIDE, self.top + PANEL_TITLE) + place * pitch,
            self.size,
        )
    }

    pub fn end(&self) -> f64 {
        let rows = self.count.div_ceil(COLUMNS).max(1);
        let row = PANEL_TITLE + self.size.y + PANEL_GAP;
        (self.top + rows as f64 * row + BOTTOM).ceil()
    }

    /// Draws a leaf with its letter and title in its panel.
    pub fn draw(&self, page: &mut Drawing, index: usize, veins: &Veins, caption: [&str; 2]) {
        let [letter, text] = caption;
        let scene = self.begin(page, (index, 0.0), OBLIQUE, (letter, text, NOTE));
        scene.draw_leaf(page, veins, THINNER * veins.line_width());
    }

    /// Draws a panel in which a leaf can be drawn, by its number and time, with its letter and a
    /// title in a colour. The first also shows the names of the axes and gravity, and each the wind
    /// if that changes.
    pub fn begin(
        &self,
        page: &mut Drawing,
        (index, time): (usize, f64),
        view: View,
        (letter, text, color): (&str, &str, Color),
    ) -> Scene<'s> {
        let cell = self.cell(index);
        title_in(page, cell.corner, letter, text, color);
        let (bounds, setting, step) = (self.bounds, self.setting, Some(self.step));
        let scene = Scene::new(bounds, setting, view, cell, MARGINS, step);
        scene.draw_box(page);
        if index == 0 {
            scene.draw_names(page, 9.0, false);
        }
        scene.draw_arrows(page, index == 0, time);
        scene
    }
}
