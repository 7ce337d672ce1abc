//! Several leaves in small panels, seen by one camera, to one scale.

use glam::{DVec2, DVec3};

use super::drawing::{Color, Drawing};
use super::page::{Cell, HEADER, PANEL_TITLE, WIDTH, title_in};
use super::round::round_step;
use super::setting::Setting;
use super::space::{Camera, Room, Scene, View, surrounding_box};
use super::veins::Veins;

const COLUMNS: usize = 4;
/// Beside the panels.
pub const SIDE: f64 = 22.0;
const GAP: f64 = 12.0;
const LOWEST: f64 = 110.0;
const HIGHEST: f64 = 330.0;
const BOTTOM: f64 = 10.0;
/// Pixels between grid lines at least.
const GRID: f64 = 17.0;
/// Veins are thinner in small panels.
const THINNER: f64 = 0.75;

const ROOM: Room = Room {
    left: 14.0,
    right: 14.0,
    below: 14.0,
};

/// Where the panels are, and the box that all of them show.
pub struct SmallPanels {
    bounds: [DVec3; 2],
    setting: Setting,
    /// Width of a square of the grid, as it is shown.
    step: f64,
    size: DVec2,
    top: f64,
    count: usize,
}

impl SmallPanels {
    /// So many panels that hold all of these shapes.
    pub fn holding<'a>(
        shapes: impl Iterator<Item = &'a Veins>,
        count: usize,
        setting: &Setting,
    ) -> Self {
        let boxes = shapes.map(|veins| (veins.low, veins.high));
        let all = boxes.reduce(|a, b| (a.0.min(b.0), a.1.max(b.1)));
        let (low, high) = all.unwrap_or_default();
        let bounds = surrounding_box(low, high);
        let width = (WIDTH - 2.0 * SIDE - (COLUMNS - 1) as f64 * GAP) / COLUMNS as f64;
        let size = DVec2::new(width, height(bounds, width));
        let any = Cell {
            corner: DVec2::ZERO,
            size,
        };
        let scale = Camera::facing(bounds, View::Oblique, any, ROOM).scale;
        SmallPanels {
            bounds,
            step: round_step(setting.scale() * GRID / scale),
            setting: setting.clone(),
            size,
            top: HEADER,
            count,
        }
    }

    /// How wide a square of the grid is.
    pub fn square(&self) -> String {
        self.setting.told(self.step / self.setting.scale())
    }

    pub fn below(self, top: f64) -> Self {
        SmallPanels { top, ..self }
    }

    pub fn cell(&self, index: usize) -> Cell {
        let place = DVec2::new((index % COLUMNS) as f64, (index / COLUMNS) as f64);
        let pitch = self.size + DVec2::new(GAP, PANEL_TITLE + GAP);
        Cell {
            corner: DVec2::new(SIDE, self.top + PANEL_TITLE) + place * pitch,
            size: self.size,
        }
    }

    pub fn end(&self) -> f64 {
        let rows = self.count.div_ceil(COLUMNS).max(1);
        let row = PANEL_TITLE + self.size.y + GAP;
        (self.top + rows as f64 * row + BOTTOM).ceil()
    }

    /// Draws a leaf with its letter and title into its panel, over what `under`
    /// draws there with lines of this width. The first panel's axes are named, and
    /// gravity is drawn in it.
    pub fn draw(
        &self,
        page: &mut Drawing,
        index: usize,
        veins: &Veins,
        (letter, text, color): (&str, &str, Color),
        under: impl FnOnce(&mut Drawing, &Scene, f64),
    ) {
        self.draw_from(
            View::Oblique,
            page,
            index,
            veins,
            (letter, text, color),
            under,
        );
    }

    /// The same, seen from elsewhere.
    pub fn draw_from(
        &self,
        view: View,
        page: &mut Drawing,
        index: usize,
        veins: &Veins,
        (letter, text, color): (&str, &str, Color),
        under: impl FnOnce(&mut Drawing, &Scene, f64),
    ) {
        let cell = self.cell(index);
        title_in(page, cell.corner, letter, text, color);
        let scene = Scene::new(
            self.bounds,
            &self.setting,
            view,
            cell,
            ROOM,
            Some(self.step),
        );
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

/// As high as the box needs in a panel of this width.
fn height(bounds: [DVec3; 2], width: f64) -> f64 {
    let any = Cell {
        corner: DVec2::ZERO,
        size: DVec2::ONE * (ROOM.left + ROOM.right + 1.0),
    };
    let (first, last) = Camera::facing(bounds, View::Oblique, any, ROOM).outline(bounds);
    let needed = (last - first).y / (last - first).x * (width - ROOM.left - ROOM.right);
    (needed + ROOM.below).clamp(LOWEST, HIGHEST)
}
