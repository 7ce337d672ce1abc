//! Which files a result has, and their formats.

use std::io::{self, Write};
use std::slice;

use serde::Serialize;

#[cfg(not(target_family = "wasm"))]
use crate::figure::png;
use crate::figure::{self, svg};
use crate::page::{Shape, vtk};
use crate::report::Document;
use leafdyn::scenario::Scenario;
use leafdyn::words;

/// A file of a result: its name, which does not change between releases, and its content.
/// A figure is two files.
pub enum Format<R> {
    /// A table, or another text or array.
    Table(&'static str, fn(&R, &mut dyn Write) -> io::Result<()>),
    /// A figure as a vector image and as a raster image.
    Figure([&'static str; 2], figure::Figure<R>),
    /// The leaf in space, for which its scenario is needed.
    Space(
        &'static str,
        fn(&R, &Scenario, &mut dyn Write) -> io::Result<()>,
    ),
    /// Shapes for ParaView: a list of this name, and a folder with the shapes next to it.
    Shapes(&'static str, fn(&R) -> Vec<Shape<'_>>),
}

impl<R> Format<R> {
    /// Names of the files.
    pub fn names(&self) -> &[&'static str] {
        match self {
            Format::Figure(names, _) => names,
            Format::Table(name, _) | Format::Space(name, _) | Format::Shapes(name, _) => {
                slice::from_ref(name)
            }
        }
    }

    /// Writes the whole file of this name. The only errors are those of `out`.
    pub fn write(&self, name: &str, document: &Document<R>, out: &mut dyn Write) -> io::Result<()> {
        let (result, input) = (document.result, document.input);
        match self {
            Format::Table(_, write) => write(result, out),
            Format::Figure(_, draw) => match Kind::of(name) {
                // A browser makes its own from the vector image.
                #[cfg(not(target_family = "wasm"))]
                Kind::Png => png::write_png(&draw(result, input), out),
                _ => svg::write_svg(&draw(result, input), out),
            },
            Format::Space(_, write) => write(result, input, out),
            Format::Shapes(_, shapes) => vtk::list(name, &shapes(result), out),
        }
    }
}

/// A result that is written to a folder.
pub trait Written: Serialize + Sync + Sized + 'static {
    /// Name of its JSON file, which is also printed on request.
    const JSON: Option<&'static str>;

    /// Every other format, in the order in which files are named.
    const FORMATS: &'static [Format<Self>];

    /// Names of files besides these: those that grow while the result is computed, and those
    /// of a part of it that is written on its own.
    const BESIDES: &'static [&'static str] = &[];

    /// Formats of optional parts of a result, written after the others. Where a result
    /// lacks a part, a file left by an earlier run is removed.
    const MORE: &'static [Format<Self>] = &[];

    /// Whether it has the optional part that a file of this name shows.
    fn has_more(&self, _file: &str) -> bool {
        false
    }

    /// Names of all its files but those of optional parts.
    fn names() -> impl Iterator<Item = &'static str> {
        let names = Self::FORMATS.iter().flat_map(Format::names);
        let names = names.chain(Self::BESIDES).copied();
        Self::JSON.into_iter().chain(names)
    }

    /// Names of the files that are replaced or removed where files of these kinds are written.
    fn replaced(kinds: &[Kind]) -> Vec<&'static str> {
        let names = Self::names().filter(|name| kinds.contains(&Kind::of(name)));
        let more = Self::MORE.iter().flat_map(Format::names);
        names.chain(more.copied()).collect()
    }

    /// Its files of these kinds but JSON: their names and formats.
    fn files(&self, kinds: &[Kind]) -> Vec<(&'static str, &'static Format<Self>)> {
        let more = Self::MORE.iter();
        let more = more.filter(|format| self.has_more(format.names()[0]));
        let formats = Self::FORMATS.iter().chain(more);
        let files = formats.flat_map(|format| format.names().iter().map(move |&it| (it, format)));
        files
            .filter(|(name, _)| kinds.contains(&Kind::of(name)))
            .collect()
    }
}

words! {
    /// A kind of file, as listed by `--write`.
    pub enum Kind {
        /// The result itself.
        Json = "json",
        /// Tables; large ones as NumPy arrays.
        Csv = "csv",
        /// Vector figures.
        Svg = "svg",
        /// Raster figures.
        Png = "png",
        /// A page that shows the leaf in space.
        Html = "html",
        /// A page that solves the scenario anew as its numbers are moved.
        Live = "live",
        /// For ParaView.
        Vtk = "vtk",
        /// For Blender.
        Glb = "glb",
        /// A film.
        Gif = "gif",
    }
}

/// The name of the live page.
pub const LIVE: &str = "live.html";

impl Kind {
    /// The kinds that need a motion as a film.
    pub const FILMS: [Kind; 4] = [Kind::Html, Kind::Vtk, Kind::Glb, Kind::Gif];

    /// The kinds that are written by default.
    pub const USUAL: [Kind; 4] = [Kind::Json, Kind::Csv, Kind::Svg, Kind::Png];

    /// The kind of a file, by the extension of its name.
    pub fn of(file: &str) -> Kind {
        if file == LIVE {
            return Kind::Live;
        }
        let end = file.rsplit('.').next();
        let named = end.and_then(|end| end.parse().ok());
        named.unwrap_or(match end {
            Some("vtp" | "pvd") => Kind::Vtk,
            _ => Kind::Csv,
        })
    }
}
