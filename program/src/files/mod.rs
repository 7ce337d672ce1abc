//! Output files: each complete or absent, never half written; and recordings, which grow
//! during a run.
//!
//! Which files a result has, and their formats.

mod atomic;
mod peers;
mod recording;
mod source;

use crate::figure::drawing::formats;
pub use crate::files::atomic::{abandon_unfinished, check_writable, write_new};
pub use crate::files::peers::read_peers;
pub use crate::files::recording::Recording;
pub use crate::files::source::{check_inputs, check_source, check_table, source};
use crate::page::{Shape, glb, vtk};
pub use crate::report::{Document, FileError};
use crate::{figure, page, report};
use leafdyn::relax::Equilibrium;
use leafdyn::scenario::{Radii, Scenario};
use leafdyn::simulate::Record;
use leafdyn::study::{Boundary, Chart, Check, Equilibria, Fit, Map, Scaling, Trace};
use leafdyn::words;
use rayon::prelude::*;
use serde::Serialize;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::{fs, io, slice};

impl Written for Equilibrium {
    const JSON: Option<&'static str> = Some("summary.json");
    const FORMATS: &'static [Format<Self>] = &[
        Format::Table("centerlines.csv", report::centerlines),
        Format::Figure(["figure.svg", "figure.png"], figure::leaf),
        Format::Space("view.html", page::write),
        Format::Space("leaf.vtp", |it, input, out| {
            vtk::leaf(it, &input.radii, out)
        }),
        Format::Table("leaf.glb", glb::leaf),
    ];
    const BESIDES: &'static [&'static str] = &[LIVE];

    const MORE: &'static [Format<Self>] = &[
        Format::Table("modes.csv", report::modes_table),
        Format::Figure(["modes.svg", "modes.png"], figure::modes),
        Format::Table("sensitivity.csv", report::sensitivity_table),
        Format::Figure(["sensitivity.svg", "sensitivity.png"], figure::sensitivity),
    ];

    fn has_more(&self, file: &str) -> bool {
        if file.starts_with("sensitivity.") {
            return (self.sensitivities.as_ref()).is_some_and(|found| !found.is_empty());
        }
        let modes = self.stability.modes.as_deref();
        self.stability.mode_shapes && modes.is_some_and(|modes| !modes.is_empty())
    }
}

impl Written for Check {
    const JSON: Option<&'static str> = Some("check.json");
    const FORMATS: &'static [Format<Self>] =
        &[Format::Figure(["check.svg", "check.png"], figure::check)];
}

impl Written for Fit {
    const JSON: Option<&'static str> = Some("fit.json");
    const FORMATS: &'static [Format<Self>] = &[
        Format::Table("fitted.toml", report::fitted),
        Format::Table("fit.csv", report::fit_table),
        Format::Figure(["fit.svg", "fit.png"], figure::fit),
    ];
}

impl Written for Map {
    const JSON: Option<&'static str> = Some("map.json");
    const FORMATS: &'static [Format<Self>] = &[
        Format::Table("map.csv", report::map_table),
        Format::Figure(["map.svg", "map.png"], |it, _| figure::map(it)),
    ];
}

impl Written for Equilibria {
    const JSON: Option<&'static str> = Some("equilibria.json");
    const FORMATS: &'static [Format<Self>] = &[
        Format::Figure(["equilibria.svg", "equilibria.png"], figure::equilibria),
        Format::Space("equilibria.html", page::write),
    ];
}

impl Written for Trace {
    const JSON: Option<&'static str> = Some("trace.json");
    const FORMATS: &'static [Format<Self>] = &[
        Format::Table("trace.csv", report::trace_table),
        Format::Figure(["trace.svg", "trace.png"], figure::trace),
        Format::Space("trace.html", page::write),
        Format::Shapes("trace.pvd", page::points),
    ];
}

impl Written for Boundary {
    const JSON: Option<&'static str> = Some("boundary.json");
    const FORMATS: &'static [Format<Self>] = &[
        Format::Table("boundary.csv", report::boundary_table),
        Format::Figure(["boundary.svg", "boundary.png"], figure::boundary),
        Format::Space("boundary.html", page::write),
    ];
}

impl Written for Record {
    const JSON: Option<&'static str> = Some("motion.json");
    const BESIDES: &'static [&'static str] = &["motion.csv", "motion.npy", "energy.csv"];
    const FORMATS: &'static [Format<Self>] = &[
        Format::Figure(["energy.svg", "energy.png"], figure::energy),
        Format::Figure(["filmstrip.svg", "filmstrip.png"], figure::filmstrip),
        Format::Space("motion.html", page::write),
        Format::Shapes("motion.pvd", page::instants),
        Format::Table("motion.glb", glb::motion),
        Format::Space("motion.gif", figure::film),
    ];
}

impl Written for Chart {
    const JSON: Option<&'static str> = Some("chart.json");
    const BESIDES: &'static [&'static str] =
        &["chart_rods.csv", "chart_rods.svg", "chart_rods.png"];
    const FORMATS: &'static [Format<Self>] = &[
        Format::Table("chart.csv", report::chart_table),
        Format::Figure(["chart.svg", "chart.png"], |it, _| figure::chart(it)),
    ];
}

/// The JSON of the chart includes its numbers.
impl Written for Scaling {
    const JSON: Option<&'static str> = None;
    const FORMATS: &'static [Format<Self>] = &[
        Format::Table("chart_rods.csv", report::scaling_table),
        Format::Figure(["chart_rods.svg", "chart_rods.png"], |it, _| {
            figure::scaling(it)
        }),
    ];
}

/// Which files of a result are written.
#[derive(Clone, Debug)]
pub struct Selection {
    /// Kinds of files.
    pub kinds: Vec<Kind>,
    /// The number of equal parts into which stations divide every vein; left out: the nodes
    /// of the grid.
    pub stations: Option<usize>,
}

impl Default for Selection {
    fn default() -> Self {
        Selection {
            kinds: Kind::USUAL.to_vec(),
            stations: None,
        }
    }
}

/// Names of the files of a result, of every kind.
pub fn names<R: Written>(result: &R) -> Vec<&'static str> {
    let files = result.files(&Kind::ALL).into_iter();
    let others = files.map(|(name, _)| name);
    R::JSON.into_iter().chain(others).collect()
}

/// The content of a result's file of this name, if it has such a file.
///
/// ```
/// # use leafdyn::scenario::Scenario;
/// use leafdyn_program::files::{self, Document};
/// let scenario = Scenario::read("../scenarios/paper/fig04.toml")?;
/// let leaf = scenario.relax()?;
/// let document = Document::new(&leaf, &scenario, None);
/// let picture = files::contents(&document, "figure.svg").unwrap_or_default();
/// assert!(picture.starts_with(b"<svg"));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn contents<R: Written>(document: &Document<R>, name: &str) -> Option<Vec<u8>> {
    let mut bytes = Vec::new();
    if R::JSON == Some(name) {
        report::write_json(document, &mut bytes).ok()?;
        return Some(bytes);
    }
    let mut files = document.result.files(&Kind::ALL).into_iter();
    let (_, format) = files.find(|(file, _)| *file == name)?;
    format.write(name, document, &mut bytes).ok()?;
    Some(bytes)
}

/// Writes a result into `folder`, which is created if missing, as files of these kinds,
/// and returns their paths. Files of other kinds are not changed.
pub fn write_all<R: Written>(
    folder: &Path,
    document: &Document<R>,
    kinds: &[Kind],
) -> Result<Vec<PathBuf>, FileError> {
    if kinds.is_empty() {
        return Ok(Vec::new());
    }
    atomic::make_folder(folder)?;
    let result = document.result;
    let files = result.files(kinds);
    let (json, others) = rayon::join(
        || {
            let name = R::JSON.filter(|_| kinds.contains(&Kind::Json))?;
            Some(write_named(folder, name, |out| {
                report::write_json(document, out)
            }))
        },
        || -> Vec<_> {
            let files = files.par_iter();
            files
                .map(|(name, format)| {
                    if let Format::Shapes(list, shapes) = format {
                        write_shapes(folder, list, &shapes(result), &document.input.radii)?;
                    }
                    write_named(folder, name, |out| format.write(name, document, out))
                })
                .collect()
        },
    );
    for name in R::MORE.iter().flat_map(Format::names) {
        if !result.has_more(name) {
            // Left by another result; usually there is none.
            let _ = fs::remove_file(folder.join(name));
        }
    }
    json.into_iter().chain(others).collect()
}

/// Writes the shapes of a list, which is written after them.
fn write_shapes(
    folder: &Path,
    list: &str,
    shapes: &[Shape],
    radii: &Radii,
) -> Result<(), FileError> {
    for (number, shape) in shapes.iter().enumerate() {
        let part = vtk::part(list, number);
        if number == 0 {
            atomic::make_folder(folder.join(&part).parent().unwrap_or(folder))?;
        }
        write_named(folder, &part, |out| {
            vtk::curves(shape.curves, shape.stations, radii, out)
        })?;
    }
    Ok(())
}

/// Writes a complete table into `folder`, which is created if missing.
pub fn write_table(folder: &Path, name: &str, rows: &[u8]) -> Result<PathBuf, FileError> {
    atomic::make_folder(folder)?;
    write_named(folder, name, |out| out.write_all(rows))
}

/// Writes a complete file into `folder`, and returns its path.
fn write_named(
    folder: &Path,
    name: &str,
    fill: impl FnOnce(&mut dyn Write) -> io::Result<()>,
) -> Result<PathBuf, FileError> {
    let file = folder.join(name);
    let written = atomic::write_file(&file, fill);
    written.map_err(|reason| FileError::write(&file, reason))?;
    Ok(file)
}

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
                Kind::Png => formats::write_png(&draw(result, input), out),
                _ => formats::write_svg(&draw(result, input), out),
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
