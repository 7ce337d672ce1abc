//! Which files a result has, their formats, which of them a request asks for, and how they are written.

use crate::figure::drawing::formats;
use crate::files::atomic;
use crate::page::{ShapeInSeries, glb, surface, vtk};
use crate::report::{FileError, ResultDocument};
use crate::{figure, page, report};
use leafdyn::relax::Equilibrium;
use leafdyn::scenario::{Radii, Scenario};
use leafdyn::simulate::Record;
use leafdyn::study::{
    Chart, Check, Equilibria, Fit, Map, Postures, ScalingStudy, StabilityBoundary, Sweep, Trace,
    Unbending,
};
use leafdyn::words;
use rayon::prelude::*;
use serde::Serialize;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::{fs, io, slice};

impl WrittenResult for Equilibrium {
    const JSON: Option<&'static str> = Some("summary.json");
    const FORMATS: &'static [FileFormat<Self>] = &[
        FileFormat::Table("centerlines.csv", report::write_centerlines),
        FileFormat::Figure(["figure.svg", "figure.png"], figure::leaf),
        FileFormat::Space("view.html", page::write_page),
        FileFormat::Space("leaf.vtp", |it, input, out| {
            vtk::write_leaf(it, &input.radii, out)
        }),
        FileFormat::Table("leaf.glb", glb::write_leaf),
        FileFormat::Space("surface.obj", surface::write_obj),
        FileFormat::Space("surface.ply", surface::write_ply),
        FileFormat::Space("surface.glb", surface::write_glb),
        FileFormat::Space("surface.vtp", surface::write_vtp),
        FileFormat::Space("angles.csv", surface::write_angles),
        #[cfg(not(target_family = "wasm"))]
        FileFormat::Space("surface.png", figure::write_surface_picture),
    ];
    const BESIDES: &'static [&'static str] = &[LIVE_PAGE_FILE];

    const MORE: &'static [FileFormat<Self>] = &[
        FileFormat::Table("modes.csv", report::write_modes_table),
        FileFormat::Figure(["modes.svg", "modes.png"], figure::modes),
        FileFormat::Table("sensitivity.csv", report::write_sensitivity_table),
        FileFormat::Figure(["sensitivity.svg", "sensitivity.png"], figure::sensitivity),
    ];

    fn has_more(&self, file: &str) -> bool {
        if file.starts_with("sensitivity.") {
            return (self.sensitivities.as_ref()).is_some_and(|found| !found.is_empty());
        }
        let modes = self.stability.modes.as_deref();
        let motions = self.stability.small_motions.as_ref();
        let shapes = motions.and_then(|motions| motions.shapes.as_deref());
        self.stability.mode_shapes
            && (modes.is_some_and(|modes| !modes.is_empty())
                || shapes.is_some_and(|shapes| !shapes.is_empty()))
    }
}

/// Leaves over a grid of numbers.
impl WrittenResult for Sweep {
    const JSON: Option<&'static str> = Some("table.json");
    const FORMATS: &'static [FileFormat<Self>] = &[
        FileFormat::Table("table.csv", report::write_sweep_table),
        FileFormat::Figure(["table.svg", "table.png"], figure::sweep),
    ];
}

impl WrittenResult for Check {
    const JSON: Option<&'static str> = Some("check.json");
    const FORMATS: &'static [FileFormat<Self>] = &[FileFormat::Figure(
        ["check.svg", "check.png"],
        figure::check,
    )];
}

impl WrittenResult for Fit {
    const JSON: Option<&'static str> = Some("fit.json");
    const FORMATS: &'static [FileFormat<Self>] = &[
        FileFormat::Table("fitted.toml", report::write_fitted_scenario),
        FileFormat::Table("fit.csv", report::write_fit_table),
        FileFormat::Figure(["fit.svg", "fit.png"], figure::fit),
    ];
}

impl WrittenResult for Unbending {
    const JSON: Option<&'static str> = Some("unbend.json");
    const FORMATS: &'static [FileFormat<Self>] = &[
        FileFormat::Table("rest.toml", report::write_rest_scenario),
        FileFormat::Table("rest.csv", report::write_rest_table),
        FileFormat::Figure(["unbend.svg", "unbend.png"], figure::unbend),
    ];
}

/// Postures of many leaves.
impl WrittenResult for Postures {
    const JSON: Option<&'static str> = Some("postures.json");
    const FORMATS: &'static [FileFormat<Self>] = &[FileFormat::Table(
        "postures.csv",
        report::write_postures_table,
    )];
}

impl WrittenResult for Map {
    const JSON: Option<&'static str> = Some("map.json");
    const FORMATS: &'static [FileFormat<Self>] = &[
        FileFormat::Table("map.csv", report::write_map_table),
        FileFormat::Figure(["map.svg", "map.png"], |it, _| figure::map(it)),
    ];
}

impl WrittenResult for Equilibria {
    const JSON: Option<&'static str> = Some("equilibria.json");
    const FORMATS: &'static [FileFormat<Self>] = &[
        FileFormat::Figure(["equilibria.svg", "equilibria.png"], figure::equilibria),
        FileFormat::Space("equilibria.html", page::write_page),
    ];
}

impl WrittenResult for Trace {
    const JSON: Option<&'static str> = Some("trace.json");
    const FORMATS: &'static [FileFormat<Self>] = &[
        FileFormat::Table("trace.csv", report::write_trace_table),
        FileFormat::Figure(["trace.svg", "trace.png"], figure::trace),
        FileFormat::Space("trace.html", page::write_page),
        FileFormat::Shapes("trace.pvd", page::shapes_of_trace),
    ];
}

impl WrittenResult for StabilityBoundary {
    const JSON: Option<&'static str> = Some("boundary.json");
    const FORMATS: &'static [FileFormat<Self>] = &[
        FileFormat::Table("boundary.csv", report::write_boundary_table),
        FileFormat::Figure(["boundary.svg", "boundary.png"], figure::boundary),
        FileFormat::Space("boundary.html", page::write_page),
    ];
}

impl WrittenResult for Record {
    const JSON: Option<&'static str> = Some("motion.json");
    const BESIDES: &'static [&'static str] = &["motion.csv", "motion.npy", "energy.csv"];
    const FORMATS: &'static [FileFormat<Self>] = &[
        FileFormat::Figure(["energy.svg", "energy.png"], figure::energy),
        FileFormat::Figure(["filmstrip.svg", "filmstrip.png"], figure::filmstrip),
        FileFormat::Space("motion.html", page::write_page),
        FileFormat::Shapes("motion.pvd", page::shapes_of_motion),
        FileFormat::Table("motion.glb", glb::write_motion),
        FileFormat::Space("motion.gif", figure::write_film),
    ];
}

impl WrittenResult for Chart {
    const JSON: Option<&'static str> = Some("chart.json");
    const BESIDES: &'static [&'static str] =
        &["chart_rods.csv", "chart_rods.svg", "chart_rods.png"];
    const FORMATS: &'static [FileFormat<Self>] = &[
        FileFormat::Table("chart.csv", report::write_chart_table),
        FileFormat::Figure(["chart.svg", "chart.png"], |it, _| figure::chart(it)),
    ];
}

/// The JSON of the chart includes its numbers.
impl WrittenResult for ScalingStudy {
    const JSON: Option<&'static str> = None;
    const FORMATS: &'static [FileFormat<Self>] = &[
        FileFormat::Table("chart_rods.csv", report::write_scaling_table),
        FileFormat::Figure(["chart_rods.svg", "chart_rods.png"], |it, _| {
            figure::scaling(it)
        }),
    ];
}

/// Which files of a result are written.
#[derive(Clone, Debug)]
pub struct FileSelection {
    /// Kinds of files.
    pub kinds: Vec<FileKind>,
    /// The number of equal parts into which stations divide every vein; left out: the nodes
    /// of the grid.
    pub stations: Option<usize>,
}

impl Default for FileSelection {
    fn default() -> Self {
        FileSelection {
            kinds: FileKind::DEFAULT_KINDS.to_vec(),
            stations: None,
        }
    }
}

/// Names of the files of a result, of every kind.
pub fn result_file_names<R: WrittenResult>(result: &R) -> Vec<&'static str> {
    let files = result.files_of_kinds(&FileKind::ALL).into_iter();
    let others = files.map(|file| file.name);
    R::JSON.into_iter().chain(others).collect()
}

/// The content of a result's file of this name, if it has such a file.
///
/// ```
/// # use leafdyn::scenario::Scenario;
/// use leafdyn_program::files::{self, ResultDocument};
/// let scenario = Scenario::read("../scenarios/paper/fig04.toml")?;
/// let leaf = scenario.relax()?;
/// let document = ResultDocument::new(&leaf, &scenario, None);
/// let picture = files::result_file_contents(&document, "figure.svg").unwrap_or_default();
/// assert!(picture.starts_with(b"<svg"));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn result_file_contents<R: WrittenResult>(
    document: &ResultDocument<R>,
    name: &str,
) -> Option<Vec<u8>> {
    let mut bytes = Vec::new();
    if R::JSON == Some(name) {
        report::write_json(document, &mut bytes).ok()?;
        return Some(bytes);
    }
    let mut files = document.result.files_of_kinds(&FileKind::ALL).into_iter();
    let file = files.find(|file| file.name == name)?;
    file.format.write_file(name, document, &mut bytes).ok()?;
    Some(bytes)
}

/// Writes a result into `folder`, which is created if missing, as files of these kinds,
/// and returns their paths. Files of other kinds are not changed.
pub fn write_result_files<R: WrittenResult>(
    folder: &Path,
    document: &ResultDocument<R>,
    kinds: &[FileKind],
) -> Result<Vec<PathBuf>, FileError> {
    if kinds.is_empty() {
        return Ok(Vec::new());
    }
    atomic::make_folder(folder)?;
    let result = document.result;
    let files = result.files_of_kinds(kinds);
    let (json, others) = rayon::join(
        || {
            let name = R::JSON.filter(|_| kinds.contains(&FileKind::Json))?;
            Some(write_file_in_folder(folder, name, |out| {
                report::write_json(document, out)
            }))
        },
        || -> Vec<_> {
            let files = files.par_iter();
            files
                .map(|ResultFile { name, format }| {
                    if let FileFormat::Shapes(list, shapes) = format {
                        write_shapes(folder, list, &shapes(result), &document.input.radii)?;
                    }
                    write_file_in_folder(folder, name, |out| format.write_file(name, document, out))
                })
                .collect()
        },
    );
    for name in R::MORE.iter().flat_map(FileFormat::file_names) {
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
    shapes: &[ShapeInSeries],
    radii: &Radii,
) -> Result<(), FileError> {
    for (number, shape) in shapes.iter().enumerate() {
        let part = vtk::shape_file_name(list, number);
        if number == 0 {
            atomic::make_folder(folder.join(&part).parent().unwrap_or(folder))?;
        }
        write_file_in_folder(folder, &part, |out| {
            vtk::write_curves(shape.curves, shape.stations, radii, out)
        })?;
    }
    Ok(())
}

/// Writes a complete table into `folder`, which is created if missing.
pub fn write_table(folder: &Path, name: &str, rows: &[u8]) -> Result<PathBuf, FileError> {
    atomic::make_folder(folder)?;
    write_file_in_folder(folder, name, |out| out.write_all(rows))
}

/// Writes a complete file into `folder`, and returns its path.
fn write_file_in_folder(
    folder: &Path,
    name: &str,
    fill: impl FnOnce(&mut dyn Write) -> io::Result<()>,
) -> Result<PathBuf, FileError> {
    let file = folder.join(name);
    let written = atomic::write_file(&file, fill);
    written.map_err(|reason| FileError::cannot_write(&file, reason))?;
    Ok(file)
}

/// A file of a result: its name, which does not change between releases, and its content.
/// A figure is two files.
pub enum FileFormat<R> {
    /// A table, or another text or array.
    Table(&'static str, fn(&R, &mut dyn Write) -> io::Result<()>),
    /// A figure as a vector image and as a raster image.
    Figure([&'static str; 2], figure::FigureFunction<R>),
    /// The leaf in space, for which its scenario is needed.
    Space(
        &'static str,
        fn(&R, &Scenario, &mut dyn Write) -> io::Result<()>,
    ),
    /// Shapes for ParaView: a list of this name, and a folder with the shapes next to it.
    Shapes(&'static str, fn(&R) -> Vec<ShapeInSeries<'_>>),
}

impl<R> FileFormat<R> {
    /// Names of the files.
    pub fn file_names(&self) -> &[&'static str] {
        match self {
            FileFormat::Figure(names, _) => names,
            FileFormat::Table(name, _)
            | FileFormat::Space(name, _)
            | FileFormat::Shapes(name, _) => slice::from_ref(name),
        }
    }

    /// Writes the whole file of this name. The only errors are those of `out`.
    pub fn write_file(
        &self,
        name: &str,
        document: &ResultDocument<R>,
        out: &mut dyn Write,
    ) -> io::Result<()> {
        let (result, input) = (document.result, document.input);
        match self {
            FileFormat::Table(_, write) => write(result, out),
            FileFormat::Figure(_, draw) => match FileKind::from_file_name(name) {
                // A browser makes its own from the vector image.
                #[cfg(not(target_family = "wasm"))]
                FileKind::Png => formats::write_png(&draw(result, input), out),
                _ => formats::write_svg(&draw(result, input), out),
            },
            FileFormat::Space(_, write) => write(result, input, out),
            FileFormat::Shapes(_, shapes) => vtk::write_shape_list(name, &shapes(result), out),
        }
    }
}

/// A file of a result. A figure is two files of one format.
pub struct ResultFile<R: 'static> {
    /// Its name in the folder of the result.
    pub name: &'static str,
    /// How its content is made.
    pub format: &'static FileFormat<R>,
}

/// A result that is written to a folder.
pub trait WrittenResult: Serialize + Sync + Sized + 'static {
    /// Name of its JSON file, which is also printed on request.
    const JSON: Option<&'static str>;

    /// Every other format, in the order in which files are named.
    const FORMATS: &'static [FileFormat<Self>];

    /// Names of files besides these: those that grow while the result is computed, and those
    /// of a part of it that is written on its own.
    const BESIDES: &'static [&'static str] = &[];

    /// Formats of optional parts of a result, written after the others. Where a result
    /// lacks a part, a file left by an earlier run is removed.
    const MORE: &'static [FileFormat<Self>] = &[];

    /// Whether the result has the optional part that a file of this name shows.
    fn has_more(&self, _file: &str) -> bool {
        false
    }

    /// Names of all its files but those of optional parts.
    fn file_names() -> impl Iterator<Item = &'static str> {
        let names = Self::FORMATS.iter().flat_map(FileFormat::file_names);
        let names = names.chain(Self::BESIDES).copied();
        Self::JSON.into_iter().chain(names)
    }

    /// Names of the files that are replaced or removed where files of these kinds are written.
    fn replaced_files(kinds: &[FileKind]) -> Vec<&'static str> {
        let names =
            Self::file_names().filter(|name| kinds.contains(&FileKind::from_file_name(name)));
        let more = Self::MORE.iter().flat_map(FileFormat::file_names);
        names.chain(more.copied()).collect()
    }

    /// The files of the result of these kinds, without its JSON.
    fn files_of_kinds(&self, kinds: &[FileKind]) -> Vec<ResultFile<Self>> {
        let more = Self::MORE.iter();
        let more = more.filter(|format| self.has_more(format.file_names()[0]));
        let formats = Self::FORMATS.iter().chain(more);
        let files = formats.flat_map(|format| {
            let names = format.file_names().iter();
            names.map(move |&name| ResultFile { name, format })
        });
        files
            .filter(|file| kinds.contains(&FileKind::from_file_name(file.name)))
            .collect()
    }
}

words! {
    /// A kind of file, as listed by `--write`.
    pub enum FileKind {
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
        /// The leaf as a surface, in several formats, and its angles.
        Surface = "surface",
        /// A film.
        Gif = "gif",
    }
}

/// The name of the live page.
pub const LIVE_PAGE_FILE: &str = "live.html";

impl FileKind {
    /// The kinds that need a motion as a film.
    pub const FILM_KINDS: [FileKind; 4] =
        [FileKind::Html, FileKind::Vtk, FileKind::Glb, FileKind::Gif];

    /// The kinds that are written by default.
    pub const DEFAULT_KINDS: [FileKind; 4] =
        [FileKind::Json, FileKind::Csv, FileKind::Svg, FileKind::Png];

    /// The kind of a file, by the extension of its name.
    pub fn from_file_name(file: &str) -> FileKind {
        if file == LIVE_PAGE_FILE {
            return FileKind::Live;
        }
        if file.starts_with("surface.") || file.starts_with("angles.") {
            return FileKind::Surface;
        }
        let end = file.rsplit('.').next();
        let named = end.and_then(|end| end.parse().ok());
        named.unwrap_or(match end {
            Some("vtp" | "pvd") => FileKind::Vtk,
            _ => FileKind::Csv,
        })
    }
}
