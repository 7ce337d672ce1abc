//! Figures: a leaf from above, from the side, from the front and in space; of a
//! check also how far both solutions are apart; of a motion the energies in
//! time, and the leaf at some instants; of a chart speed against accuracy, and
//! cost against the number of veins; and the modes of a leaf at rest.
//!
//! One drawing code fills a [`drawing::Drawing`]; `svg` writes it down and
//! `png` paints it, so that both files are the same picture.

mod all;
mod chart;
mod check;
mod colors;
mod curves;
mod differences;
mod drawing;
mod energy;
mod filmstrip;
mod flat;
mod font;
mod header;
mod leaf;
mod logaxis;
mod loglog;
mod map;
mod markers;
mod modes;
mod motion;
mod page;
mod png;
mod series;
mod small;
mod space;
mod strip;
mod svg;
mod ticks;
mod trace;
mod veins;

pub use modes::ModesFigure;
pub use motion::MotionFigure;
pub use png::FigurePng;
pub use svg::FigureSvg;

/// A result with a figure.
pub trait Pictured {
    /// Name of the SVG file.
    const SVG: &'static str;
    /// Name of the PNG file.
    const PNG: &'static str;

    /// Draws the whole page.
    fn draw(&self) -> drawing::Drawing;
}
