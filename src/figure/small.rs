//! Several leaves in small panels, seen by one camera, to one scale.

use super::kit::*;

const COLUMNS: usize = 4;
/// Margin to the left and right of the panels.
pub const SIDE: f64 = 22.0;
const GAP: f64 = 12.0;
const LOWEST: f64 = 110.0;
const HIGHEST: f64 = 330.0;
const BOTTOM: f64 = 10.0;
/// Least pixels between grid lines.
const GRID: f64 = 17.0;
/// Factor of the line width of veins in small panels.
const THINNER: f64 = 0.75;

const MARGINS: Margins = Margins {
    left: 14.0,
    right: 14.0,
    below: 14.0,
};

/// Where the panels are, and the box that all of them show.
pub struct SmallPanels {
    bounds: [DVec3; 2],
    setting: Setting,
    /// Displayed width of a square of the grid.
    step: f64,
    size: DVec2,
    top: f64,
    count: usize,
}

impl SmallPanels {
    /// `count` panels from `top` on that can hold any of these shapes.
    pub fn holding<'a>(
        shapes: impl Iterator<Item = &'a Veins>,
        count: usize,
        setting: &Setting,
        top: f64,
    ) -> Self {
        let bounds = common_box(shapes);
        let width = (WIDTH - 2.0 * SIDE - (COLUMNS - 1) as f64 * GAP) / COLUMNS as f64;
        let size = DVec2::new(width, height(bounds, width));
        let any = Cell::new(DVec2::ZERO, size);
        let scale = Camera::facing(bounds, View::Oblique, any, MARGINS).scale;
        SmallPanels {
            bounds,
            step: round_step(setting.scale() * GRID / scale),
            setting: setting.clone(),
            size,
            top,
            count,
        }
    }

    /// Formats the width of a square of the grid.
    pub fn grid_width(&self) -> String {
        self.setting.format_length(self.step / self.setting.scale())
    }

    pub fn cell(&self, index: usize) -> Cell {
        let place = DVec2::new((index % COLUMNS) as f64, (index / COLUMNS) as f64);
        let pitch = self.size + DVec2::new(GAP, PANEL_TITLE + GAP);
        Cell::new(
            DVec2::new(SIDE, self.top + PANEL_TITLE) + place * pitch,
            self.size,
        )
    }

    pub fn end(&self) -> f64 {
        let rows = self.count.div_ceil(COLUMNS).max(1);
        let row = PANEL_TITLE + self.size.y + GAP;
        (self.top + rows as f64 * row + BOTTOM).ceil()
    }

    /// Draws a leaf with its letter and title in its panel. The first panel also shows the
    /// names of the axes and gravity.
    pub fn draw(&self, page: &mut Drawing, index: usize, veins: &Veins, caption: [&str; 2]) {
        let [letter, text] = caption;
        let caption = (letter, text, NOTE);
        self.draw_over(page, index, veins, View::Oblique, caption, |_, _, _| ());
    }

    /// The same in any view, with a title in a colour, and above what `under` draws with
    /// lines of a given width.
    pub fn draw_over(
        &self,
        page: &mut Drawing,
        index: usize,
        veins: &Veins,
        view: View,
        (letter, text, color): (&str, &str, Color),
        under: impl FnOnce(&mut Drawing, &Scene, f64),
    ) {
        let cell = self.cell(index);
        title_in(page, cell.corner, letter, text, color);
        let (bounds, setting, step) = (self.bounds, &self.setting, Some(self.step));
        let scene = Scene::new(bounds, setting, view, cell, MARGINS, step);
        scene.draw_box(page);
        if index == 0 {
            scene.draw_names(page, 9.0, false);
            scene.draw_gravity(page);
        }
        let width = THINNER * veins.line_width();
        under(page, &scene, width);
        scene.draw_leaf(page, veins, width);
    }
}

/// The height that the box needs in a panel of this width.
fn height(bounds: [DVec3; 2], width: f64) -> f64 {
    let any = Cell::new(
        DVec2::ZERO,
        DVec2::ONE * (MARGINS.left + MARGINS.right + 1.0),
    );
    let (first, last) = Camera::facing(bounds, View::Oblique, any, MARGINS).outline(bounds);
    let needed = (last - first).y / (last - first).x * (width - MARGINS.left - MARGINS.right);
    (needed + MARGINS.below).clamp(LOWEST, HIGHEST)
}
