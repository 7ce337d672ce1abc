//! Results: a leaf at rest, and the contents of the files of any result.

use std::iter;
use std::path::{Path, PathBuf};
use std::sync::{Arc, OnceLock};

use glam::DVec3;
use leafdyn::relax::{
    BaseReaction, Equilibrium, GripReaction, Mode, MotionShape, NodeState, Sensitivity, Stresses,
};
use leafdyn::scenario::units::Dimension;
use leafdyn::scenario::{Scenario, Stress};
use leafdyn::study::{ColumnKind, ColumnValue, LeafColumn};
use leafdyn::surface::{AngleDistribution, TriangleMesh};
use leafdyn_program::files::{self, FileError, FileKind, ResultDocument, WrittenResult};
use pyo3::exceptions::{PyKeyError, PyOSError, PyValueError};
use pyo3::intern;
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict};

use crate::arrays::{Array, ForceAndMoment, array, curves, flat, nodes, vectors};
use crate::errors::value_error;
use crate::run::on_pool;

/// Any result that can be written to files.
trait Contents: Send + Sync {
    fn names(&self) -> Vec<&'static str>;
    fn contents(&self, input: &Scenario, name: &str) -> Option<Vec<u8>>;
    fn save(&self, input: &Scenario, folder: &Path, kinds: &[FileKind]) -> Saved;
}

/// The paths of the files, or why one cannot be written.
type Saved = Result<Vec<PathBuf>, FileError>;

impl<R: WrittenResult + Send> Contents for R {
    fn names(&self) -> Vec<&'static str> {
        files::result_file_names(self)
    }

    fn contents(&self, input: &Scenario, name: &str) -> Option<Vec<u8>> {
        files::result_file_contents(&ResultDocument::new(self, input, None), name)
    }

    fn save(&self, input: &Scenario, folder: &Path, kinds: &[FileKind]) -> Saved {
        files::write_result_files(folder, &ResultDocument::new(self, input, None), kinds)
    }
}

/// Writes the files of these kinds into a folder, as the program does.
fn save(
    py: Python,
    result: &(impl Contents + ?Sized),
    input: &Scenario,
    folder: &Path,
    kinds: &[String],
) -> PyResult<Vec<PathBuf>> {
    let kinds = chosen(kinds);
    let saved = on_pool(py, || result.save(input, folder, &kinds))?;
    saved.map_err(write_error)
}

/// An `OSError`, for a file that cannot be written; its message mentions no options of the
/// program.
pub fn write_error(error: impl ToString) -> PyErr {
    PyOSError::new_err(error.to_string().replace(" with --out DIR", ""))
}

/// Kinds of files by their names.
pub fn chosen(words: &[String]) -> Vec<FileKind> {
    let wanted = |kind: &FileKind| words.iter().any(|word| word == kind.word());
    FileKind::ALL.into_iter().filter(wanted).collect()
}

/// The contents of a file, made without the interpreter's lock, as pictures take long.
fn read<'py>(
    py: Python<'py>,
    result: &(impl Contents + ?Sized),
    input: &Scenario,
    name: &str,
) -> PyResult<Bound<'py, PyBytes>> {
    let found = py.detach(|| result.contents(input, name));
    let bytes = found.ok_or_else(|| PyKeyError::new_err(name.to_string()))?;
    Ok(PyBytes::new(py, &bytes))
}

/// The kind of a file, by its name: a word that `--write` knows.
#[pyfunction]
pub fn kind(file: &str) -> &'static str {
    FileKind::from_file_name(file).word()
}

/// What a column of a table of leaves is: the kind of its cells, the exponents of length, force and time in its
/// unit, how many modes it needs, and whether its numbers have bounds on their errors.
#[pyfunction]
pub fn leaf_column(name: &str) -> PyResult<(&'static str, Dimension, usize, bool)> {
    let column: LeafColumn = name.parse().map_err(value_error)?;
    let kind = match column.kind() {
        ColumnKind::Number => "number",
        ColumnKind::Count => "count",
        ColumnKind::Truth => "truth",
        ColumnKind::Text => "text",
    };
    let quantity = column.quantity;
    let has_error = quantity.has_error() && !column.is_error;
    Ok((kind, quantity.dimension(), quantity.modes(), has_error))
}

/// A cell of a table of leaves.
#[derive(IntoPyObject)]
pub enum Cell {
    Number(f64),
    Count(usize),
    Truth(bool),
    Text(String),
}

impl From<ColumnValue> for Cell {
    fn from(value: ColumnValue) -> Self {
        match value {
            ColumnValue::Number(value) => Cell::Number(value),
            ColumnValue::Count(count) => Cell::Count(count),
            ColumnValue::Truth(is_true) => Cell::Truth(is_true),
            ColumnValue::Text(text) => Cell::Text(text),
        }
    }
}

/// The files of a result.
#[pyclass(frozen, module = "leafdyn._leafdyn")]
pub struct Files {
    result: Box<dyn Contents>,
    input: Arc<Scenario>,
}

impl Files {
    /// The files of a result of the scenario `input`.
    pub fn of(result: impl WrittenResult + Send, input: Arc<Scenario>) -> Self {
        let result = Box::new(result);
        Files { result, input }
    }
}

#[pymethods]
impl Files {
    /// The names of the files.
    fn names(&self) -> Vec<&'static str> {
        self.result.names()
    }

    /// What stands in the file of this name.
    fn contents<'py>(&self, py: Python<'py>, name: &str) -> PyResult<Bound<'py, PyBytes>> {
        read(py, &*self.result, &self.input, name)
    }

    /// Writes those of these kinds into a folder, and returns their paths.
    fn save(&self, py: Python, folder: PathBuf, kinds: Vec<String>) -> PyResult<Vec<PathBuf>> {
        save(py, &*self.result, &self.input, &folder, &kinds)
    }
}

/// The force on a base, or on all, and the moment if there is one.
fn force_and_moment<'py>(py: Python<'py>, on_base: &BaseReaction) -> PyResult<ForceAndMoment<'py>> {
    let force = array(py, flat([on_base.force]), &[3])?;
    let moment = on_base.moment.map(|moment| array(py, flat([moment]), &[3]));
    Ok((force, moment.transpose()?))
}

/// See [`Leaf::position_changes`].
type PositionChange<'py> = (String, Bound<'py, PyAny>, Bound<'py, PyAny>, Option<f64>);

/// A leaf at rest, or as far as it came.
#[pyclass(frozen, module = "leafdyn._leafdyn")]
pub struct Leaf {
    found: Equilibrium,
    input: Arc<Scenario>,
    stations: Option<usize>,
    /// The leaf at the shown stations, interpolated on demand.
    shown: OnceLock<Equilibrium>,
}

impl Leaf {
    /// A leaf shown at stations that divide veins into this number of equal parts, or at the
    /// nodes of the finest grid.
    pub fn new(found: Equilibrium, input: Arc<Scenario>, stations: Option<usize>) -> Self {
        Leaf {
            found,
            input,
            stations,
            shown: OnceLock::new(),
        }
    }

    /// A leaf shown at its own stations.
    pub fn as_found(found: Equilibrium, input: Arc<Scenario>) -> Self {
        Leaf {
            shown: found.clone().into(),
            ..Leaf::new(found, input, None)
        }
    }

    /// The leaf with its final outcome: at requested stations the tolerance may be exceeded.
    fn ended(&self, py: Python) -> &Equilibrium {
        match self.stations {
            Some(_) => self.shown(py),
            None => &self.found,
        }
    }

    fn shown(&self, py: Python) -> &Equilibrium {
        self.shown.get().unwrap_or_else(|| {
            py.detach(|| {
                let shown = || self.found.clone().at_stations(&self.input, self.stations);
                self.shown.get_or_init(shown)
            })
        })
    }
}

#[pymethods]
impl Leaf {
    /// The names of the files.
    fn names(&self) -> Vec<&'static str> {
        files::result_file_names(&self.found)
    }

    /// What stands in the file of this name.
    fn contents<'py>(&self, py: Python<'py>, name: &str) -> PyResult<Bound<'py, PyBytes>> {
        read(py, self.shown(py), &self.input, name)
    }

    /// Writes the files of these kinds into a folder, and returns their paths.
    fn save(&self, py: Python, folder: PathBuf, kinds: Vec<String>) -> PyResult<Vec<PathBuf>> {
        save(py, self.shown(py), &self.input, &folder, &kinds)
    }

    #[getter]
    fn error_estimate(&self, py: Python) -> Option<f64> {
        self.shown(py).accuracy.error_estimate
    }

    /// Its cell in a column of a table of leaves; none where that is not known.
    fn column(&self, py: Python, name: &str) -> PyResult<Option<Cell>> {
        let column: LeafColumn = name.parse().map_err(value_error)?;
        Ok(column.value(self.shown(py)).map(Cell::from))
    }

    /// The surface, with the veins as tubes or as a body of its thickness: vertices, normals, places along and
    /// across, veins and triangles.
    fn mesh<'py>(
        &self,
        py: Python<'py>,
        veins: bool,
        thickness: bool,
    ) -> PyResult<[Bound<'py, PyAny>; 5]> {
        let (shape, input) = (&self.shown(py).shape, &self.input);
        let found = py.detach(|| {
            let sheet = match thickness {
                true => TriangleMesh::body(shape, input),
                false => TriangleMesh::sheet(shape, input),
            };
            match veins {
                true => sheet.map(|sheet| sheet.and(TriangleMesh::vein_tubes(shape, input))),
                false => sheet,
            }
        });
        let mesh = found.map_err(|error| PyValueError::new_err(error.to_string()))?;
        let count = mesh.vertices.len();
        let rods = mesh.veins.iter().map(|vein| f64::from(*vein)).collect();
        let corners = mesh.triangles.as_flattened().iter();
        let corners = corners.map(|corner| f64::from(*corner)).collect();
        Ok([
            vectors(py, &mesh.vertices)?,
            vectors(py, &mesh.normals)?,
            array(py, mesh.uv.as_flattened().to_vec(), &[count, 2])?,
            array(py, rods, &[count])?,
            array(py, corners, &[mesh.triangles.len(), 3])?,
        ])
    }

    /// The classes of inclination and azimuth in degrees, their areas, and area, projected area and mean inclination.
    fn angles<'py>(&self, py: Python<'py>) -> PyResult<([Bound<'py, PyAny>; 3], [f64; 3])> {
        let sheet = TriangleMesh::sheet(&self.shown(py).shape, &self.input);
        let sheet = sheet.map_err(|error| PyValueError::new_err(error.to_string()))?;
        let angles = sheet.angles();
        let [rows, columns] = AngleDistribution::CLASSES;
        let inclinations = angles.classes().step_by(columns);
        let inclinations: Vec<f64> = inclinations.map(|it| it.inclination.to_degrees()).collect();
        let azimuths = angles.classes().take(columns);
        let azimuths: Vec<f64> = azimuths.map(|it| it.azimuth.to_degrees()).collect();
        let areas = angles.classes().map(|it| it.area).collect();
        let classes = [
            array(py, inclinations, &[rows])?,
            array(py, azimuths, &[columns])?,
            array(py, areas, &[rows, columns])?,
        ];
        let mean = angles.mean_inclination.to_degrees();
        Ok((classes, [angles.area, angles.projected_area, mean]))
    }

    /// What is known without any array, by the names of attributes.
    fn scalars<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let (found, ended) = (&self.found, self.ended(py));
        let all = PyDict::new(py);
        all.set_item(intern!(py, "name"), &found.scenario)?;
        all.set_item(intern!(py, "method"), found.method.word())?;
        let path = found.path.as_ref();
        all.set_item(intern!(py, "path"), path.map(|path| path.word()))?;
        let events = path.map_or(&[][..], |path| path.events());
        let events: Vec<String> = events.iter().map(ToString::to_string).collect();
        all.set_item(intern!(py, "path_events"), events)?;
        all.set_item(intern!(py, "outcome"), ended.outcome.word())?;
        all.set_item(intern!(py, "success"), ended.outcome.is_success())?;
        let remark = ended.remark.as_ref();
        all.set_item(intern!(py, "remark"), remark.map(ToString::to_string))?;
        all.set_item(intern!(py, "remark_code"), remark.map(|it| it.code()))?;
        let doubts: Vec<String> = found.doubts.iter().map(ToString::to_string).collect();
        all.set_item(intern!(py, "doubts"), doubts)?;
        all.set_item(intern!(py, "rods"), found.rod_count)?;
        all.set_item(intern!(py, "joined"), found.shape.joined)?;
        all.set_item(intern!(py, "segments"), &found.accuracy.segments)?;
        all.set_item(intern!(py, "tolerance"), found.accuracy.tolerance)?;
        all.set_item(intern!(py, "residual"), found.accuracy.residual)?;
        all.set_item(intern!(py, "energy"), found.energy)?;
        let negative = found.stability.negative_eigenvalues;
        all.set_item(intern!(py, "negative_eigenvalues"), negative)?;
        let motions = found.stability.small_motions.as_ref();
        let motions =
            motions.map(|it| (it.stable, it.growth_rates.clone(), it.frequencies.clone()));
        all.set_item(intern!(py, "_motions"), motions)?;
        let neutral = found.stability.neutral_directions;
        all.set_item(intern!(py, "neutral_directions"), neutral)?;
        let blade = found.blade.as_ref();
        let veins = blade.and_then(|blade| blade.error_in_veins);
        all.set_item(intern!(py, "error_in_veins"), veins)?;
        let veins = blade.and_then(|blade| blade.error_in_veins_remark.as_ref());
        let veins = veins.map(ToString::to_string);
        all.set_item(intern!(py, "error_in_veins_remark"), veins)?;
        all.set_item(intern!(py, "wall_seconds"), found.wall_seconds)?;
        Ok(all)
    }

    /// The joint tip alone, or the tips of all rods.
    fn tips<'py>(&self, py: Python<'py>) -> Array<'py> {
        vectors(py, &self.found.tips)
    }

    fn tip_force_sum<'py>(&self, py: Python<'py>) -> Array<'py> {
        array(py, self.found.tip_force_sum.to_array().to_vec(), &[3])
    }

    /// The force that the holder of a held tip feels, and the moment of each rod if there are any.
    fn tip_reaction<'py>(&self, py: Python<'py>) -> PyResult<Option<[Bound<'py, PyAny>; 2]>> {
        let Some(reaction) = &self.found.reaction else {
            return Ok(None);
        };
        let force = array(py, flat([reaction.force]), &[3])?;
        Ok(Some([
            force,
            vectors(py, reaction.moments.as_deref().unwrap_or_default())?,
        ]))
    }

    /// Of every grip the force that its holder feels, and the moment if it is clamped.
    fn grip_reactions<'py>(&self, py: Python<'py>) -> PyResult<Vec<ForceAndMoment<'py>>> {
        let reaction = |grip: &GripReaction| {
            let force = array(py, flat([grip.force]), &[3])?;
            let moment = grip.moment.map(|moment| array(py, flat([moment]), &[3]));
            Ok((force, moment.transpose()?))
        };
        self.found.grip_reactions.iter().map(reaction).collect()
    }

    /// Of every base the force that its support feels, and the moment unless it is hinged.
    fn base_reactions<'py>(&self, py: Python<'py>) -> PyResult<Vec<ForceAndMoment<'py>>> {
        let bases = self.found.base_reactions.iter();
        bases.map(|base| force_and_moment(py, base)).collect()
    }

    /// The force that the supports of all bases feel, and the moment; none where nothing was found.
    fn base_reaction<'py>(&self, py: Python<'py>) -> PyResult<Option<ForceAndMoment<'py>>> {
        let all = self.found.base_reaction.as_ref();
        all.map(|all| force_and_moment(py, all)).transpose()
    }

    /// Bounds on the errors of force and moment on all bases, then on every base; none where they are not
    /// known.
    fn base_reaction_errors(&self) -> Vec<[Option<f64>; 2]> {
        let bounds = |it: &BaseReaction| [it.error, it.moment_error];
        let all = self.found.base_reaction.as_ref().map_or([None; 2], bounds);
        let bases = self.found.base_reactions.iter();
        iter::once(all).chain(bases.map(bounds)).collect()
    }

    /// Bounds on the errors of the force and of the moments at the tip, then of the force and of the
    /// moment at every grip; none where they are not known.
    fn reaction_errors(&self) -> Vec<[Option<f64>; 2]> {
        let tip = self.found.reaction.as_ref();
        let tip = tip.map_or([None; 2], |it| [it.error, it.moments_error]);
        let grips = self.found.grip_reactions.iter();
        let grips = grips.map(|it| [it.error, it.moment_error]);
        iter::once(tip).chain(grips).collect()
    }

    fn stations<'py>(&self, py: Python<'py>) -> Array<'py> {
        let stations = &self.shown(py).shape.stations;
        array(py, stations.clone(), &[stations.len()])
    }

    fn lengths<'py>(&self, py: Python<'py>) -> Array<'py> {
        let rods = &self.found.shape.rods;
        let lengths = rods.iter().map(|rod| rod.length).collect();
        array(py, lengths, &[rods.len()])
    }

    /// A quantity at all stations of all rods, by its name.
    fn nodes<'py>(&self, py: Python<'py>, quantity: &str) -> Array<'py> {
        nodes(py, &self.shown(py).shape.rods, quantity)
    }

    /// The largest stresses in the sections at all stations of all rods, if these are given.
    fn stresses<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyAny>>> {
        let of = |stresses: &Stresses| {
            let rod = |rod: &Vec<Stress>| rod.iter().map(|it| it.to_array()).collect();
            let rods: Vec<Vec<[f64; 3]>> = stresses.rods.iter().map(rod).collect();
            curves(py, &rods)
        };
        self.shown(py).stress.as_ref().map(of).transpose()
    }

    /// All nodes of the finest grid.
    fn curves<'py>(&self, py: Python<'py>) -> Array<'py> {
        curves(py, &self.found.shape.curves)
    }

    /// Where the nodes of the finest grid are.
    fn curve_stations<'py>(&self, py: Python<'py>) -> Array<'py> {
        let stations = &self.found.shape.curve_stations;
        array(py, stations.clone(), &[stations.len()])
    }

    /// What drawings of the veins go through, whatever the stations shown: stations, positions, and
    /// tangents, the changes of positions with the station.
    fn veins<'py>(&self, py: Python<'py>) -> PyResult<[Bound<'py, PyAny>; 3]> {
        let dense = py.detach(|| self.found.clone().at_stations(&self.input, None));
        let rods = &dense.shape.rods;
        let tangents: Vec<Vec<_>> = (rods.iter())
            .map(|rod| {
                let nodes = rod.nodes.iter();
                let tangent = |node: &NodeState| rod.length * (node.rotation * node.v);
                nodes.map(tangent).collect()
            })
            .collect();
        let stations = &dense.shape.stations;
        Ok([
            array(py, stations.clone(), &[stations.len()])?,
            nodes(py, rods, "positions")?,
            curves(py, &tangents)?,
        ])
    }

    /// Eigenvalues of the modes that were asked for and found, and bounds on their errors.
    fn eigenvalues<'py>(&self, py: Python<'py>) -> PyResult<Option<[Bound<'py, PyAny>; 2]>> {
        let Some(modes) = &self.found.stability.modes else {
            return Ok(None);
        };
        let numbers = |of: fn(&Mode) -> f64| {
            let numbers = modes.iter().map(of).collect();
            array(py, numbers, &[modes.len()])
        };
        let errors = numbers(|mode| mode.error.unwrap_or(f64::INFINITY))?;
        Ok(Some([numbers(|mode| mode.eigenvalue)?, errors]))
    }

    /// Effective masses of the modes along the lab axes; none where shapes were not asked for.
    fn effective_masses<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyAny>>> {
        let modes = self.found.stability.modes.iter().flatten();
        let masses: Option<Vec<[f64; 3]>> = modes.map(|mode| mode.effective_masses).collect();
        let masses = masses.filter(|masses| !masses.is_empty());
        let all = |masses: Vec<[f64; 3]>| {
            let count = masses.len();
            array(py, masses.as_flattened().to_vec(), &[count, 3])
        };
        masses.map(all).transpose()
    }

    /// Displacements and rotations of the modes on the finest grid, and those a quarter of a period later.
    fn mode_shapes<'py>(&self, py: Python<'py>) -> PyResult<[Bound<'py, PyAny>; 4]> {
        let modes = self.found.stability.modes.iter().flatten();
        let in_phase = modes.map(|mode| {
            let still = |shape: &Vec<Vec<DVec3>>| {
                let rods = shape.iter().map(|rod| vec![DVec3::ZERO; rod.len()]);
                rods.collect()
            };
            MotionShape {
                displacement: mode.displacement.clone(),
                rotation: mode.rotation.clone(),
                later_displacement: still(&mode.displacement),
                later_rotation: still(&mode.rotation),
            }
        });
        let motions = self.found.stability.small_motions.as_ref();
        let motions = motions.and_then(|motions| motions.shapes.clone());
        let modes: Vec<MotionShape> = in_phase.chain(motions.into_iter().flatten()).collect();
        let shape = modes.first().map(|mode| &mode.displacement);
        let rods = shape.map_or(self.found.rod_count, Vec::len);
        let nodes = shape.and_then(|rods| rods.first()).map_or(0, Vec::len);
        let of = |shape: fn(&MotionShape) -> &Vec<Vec<DVec3>>| {
            let vectors = modes.iter().flat_map(shape).flatten().copied();
            array(py, flat(vectors), &[modes.len(), rods, nodes, 3])
        };
        Ok([
            of(|mode| &mode.displacement)?,
            of(|mode| &mode.rotation)?,
            of(|mode| &mode.later_displacement)?,
            of(|mode| &mode.later_rotation)?,
        ])
    }

    /// Changes of the positions with each number that was asked for: by its key, where they are
    /// given, the changes, and a bound on their error.
    fn position_changes<'py>(&self, py: Python<'py>) -> PyResult<Vec<PositionChange<'py>>> {
        let found = self.found.sensitivities.as_deref().unwrap_or_default();
        let of = |one: &Sensitivity| {
            let stations = array(py, one.stations.clone(), &[one.stations.len()])?;
            let positions = curves(py, &one.positions)?;
            Ok((one.key.clone(), stations, positions, one.positions_error))
        };
        found.iter().map(of).collect()
    }
}
