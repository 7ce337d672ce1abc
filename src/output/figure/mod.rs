//! The figure: a leaf from above, from the side, from the front and in space.
//!
//! One drawing code fills a [`drawing::Drawing`]; `svg` writes it down and
//! `png` paints it, so that both files are the same picture.

mod colors;
mod drawing;
mod flat;
mod font;
mod page;
mod png;
mod space;
mod svg;
mod ticks;
mod veins;

pub use png::FigurePng;
pub use svg::FigureSvg;
