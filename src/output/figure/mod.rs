//! Figures: a leaf from above, from the side, from the front and in space; of a
//! check also how far both solutions are apart; of a motion the energies in
//! time, and the leaf at some instants.
//!
//! One drawing code fills a [`drawing::Drawing`]; `svg` writes it down and
//! `png` paints it, so that both files are the same picture.

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
mod map;
mod markers;
mod motion;
mod page;
mod png;
mod space;
mod svg;
mod ticks;
mod trace;
mod veins;

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
