//! Postures of leaves: the least stiffness that they prove.

use std::ops::RangeInclusive;
use std::path::PathBuf;
use std::sync::Arc;

use leafdyn::posture::points::PosturePoints;
use leafdyn::scenario::{self, Scenario as Checked};
use leafdyn::study::{
    self, MeasuredColumn, SecondPosture, ShapeFormat, ShapeTableOptions, UnbendError, UnbendRemark,
    UnbendRequest, Unbending, read_postures,
};
use leafdyn_program::files::{self, FileKind, ResultDocument};
use pyo3::exceptions::{PyKeyError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyBytes;

use crate::errors::value_error;
use crate::result::{chosen, write_error};
use crate::run::{on_pool, run};
use crate::scenario::Scenario;

/// A table of points: its name in messages and its text, or a file.
#[derive(FromPyObject)]
pub enum Points {
    Text(String, String),
    File(PathBuf),
}

/// The points of the only leaf of a table.
pub struct ReadPoints {
    pub points: PosturePoints,
    taken: Option<String>,
    is_unit_known: bool,
    /// The scenario with what the table has besides points, if it has.
    scenario: Option<Box<Checked>>,
    name: String,
}

impl Points {
    /// Reads the points of a leaf of this scenario.
    pub fn read(&self, scenario: &Checked) -> PyResult<ReadPoints> {
        self.read_with(scenario, &ShapeTableOptions::default())
    }

    /// Reads the points of a leaf of this scenario from a table of another program.
    pub fn read_with(
        &self,
        scenario: &Checked,
        options: &ShapeTableOptions,
    ) -> PyResult<ReadPoints> {
        let (name, bytes) = match self {
            Points::Text(name, text) => (name.clone(), text.clone().into_bytes()),
            Points::File(path) => {
                let bytes = scenario::bytes(path).map_err(value_error)?;
                (path.display().to_string(), bytes)
            }
        };
        let read = read_postures(&bytes, &name, options, scenario).map_err(value_error)?;
        let first = read.into_iter().next();
        let first = first.ok_or_else(|| PyValueError::new_err(format!("{name}: has no points")))?;
        Ok(ReadPoints {
            points: first.points,
            taken: first.taken,
            is_unit_known: first.is_unit_known,
            scenario: first.scenario,
            name,
        })
    }
}

/// What a posture proves.
#[pyclass(frozen, module = "leafdyn._leafdyn")]
pub struct Posture {
    found: Unbending,
    input: Arc<Checked>,
}

#[pymethods]
impl Posture {
    /// The names of the files.
    fn names(&self) -> Vec<&'static str> {
        files::result_file_names(&self.found)
    }

    /// What stands in the file of this name.
    fn contents<'py>(&self, py: Python<'py>, name: &str) -> PyResult<Bound<'py, PyBytes>> {
        let document = ResultDocument::new(&self.found, &self.input, None);
        let found = py.detach(|| files::result_file_contents(&document, name));
        let bytes = found.ok_or_else(|| PyKeyError::new_err(name.to_string()))?;
        Ok(PyBytes::new(py, &bytes))
    }

    /// Writes those of these kinds into a folder, and returns their paths.
    fn save(&self, py: Python, folder: PathBuf, kinds: Vec<String>) -> PyResult<Vec<PathBuf>> {
        let kinds: Vec<FileKind> = chosen(&kinds);
        let document = ResultDocument::new(&self.found, &self.input, None);
        let saved = on_pool(py, || files::write_result_files(&folder, &document, &kinds))?;
        saved.map_err(write_error)
    }

    /// The index at a modulus.
    fn index(&self, young: f64) -> usize {
        self.found.index(young)
    }

    /// The scenario that rests in the posture at a modulus, as TOML.
    fn rest(&self, young: f64) -> PyResult<String> {
        let rest = self
            .found
            .rest_at(&self.input, young)
            .map_err(value_error)?;
        Ok(rest.to_toml())
    }
}

/// The range of a modulus.
fn range(young: Option<[f64; 2]>) -> Option<RangeInclusive<f64>> {
    young.map(|[low, high]| low..=high)
}

fn posture_error(name: &str, second: Option<&str>, error: UnbendError) -> PyErr {
    match (error, second) {
        (UnbendError::Second(error), Some(second)) => {
            PyValueError::new_err(format!("{second}: {error}"))
        }
        (error @ UnbendError::Young { .. }, _) => value_error(error),
        (error, _) => PyValueError::new_err(format!("{name}: {error}")),
    }
}

/// The least modulus at which a posture is stable.
#[pyfunction]
#[expect(clippy::too_many_arguments, reason = "they are those of the verb")]
pub fn unbend(
    py: Python,
    scenario: &Scenario,
    points: Points,
    young: Option<[f64; 2]>,
    second: Option<Points>,
    roll: f64,
    slow_loading: bool,
    format: Option<String>,
    columns: Vec<String>,
    progress: Option<&Bound<PyAny>>,
) -> PyResult<Posture> {
    let mut input = scenario.checked.clone();
    let format = format.as_deref().map(str::parse::<ShapeFormat>).transpose();
    let columns = columns
        .iter()
        .map(|column| column.parse::<MeasuredColumn>());
    let options = ShapeTableOptions {
        format: format.map_err(value_error)?,
        columns: columns.collect::<Result<_, _>>().map_err(value_error)?,
        ..ShapeTableOptions::default()
    };
    let mut read = points.read_with(&input, &options)?;
    let other = second
        .map(|second| second.read_with(&input, &options))
        .transpose()?;
    if let Some(with_sheet) = read.scenario.take() {
        input = Arc::new(*with_sheet);
    }
    let second_name = other.as_ref().map(|other| other.name.clone());
    let mut request = UnbendRequest {
        young: range(young),
        second: other.map(|other| SecondPosture {
            points: other.points,
            roll: roll.to_radians(),
        }),
        slow_loading,
        is_unit_known: read.is_unit_known,
        ..UnbendRequest::new((*input).clone(), read.points)
    };
    let found = run(py, progress, move |monitor| {
        request.limit = monitor.limit();
        study::unbend(&request)
    })?;
    let mut found =
        found.map_err(|error| posture_error(&read.name, second_name.as_deref(), error))?;
    if let Some(taken) = read.taken {
        found.remarks.insert(0, UnbendRemark::Coordinates(taken));
    }
    Ok(Posture { found, input })
}

/// The outcome of one of several postures: what it proves, or why it cannot be used.
#[derive(IntoPyObject)]
pub enum PostureOrRefusal {
    Posture(Py<Posture>),
    Refusal(String),
}

/// Several postures, side by side. They are neither relaxed nor loaded slowly.
#[pyfunction]
pub fn unbend_many(
    py: Python,
    leaves: Vec<(PyRef<Scenario>, Points)>,
    young: Option<[f64; 2]>,
) -> PyResult<Vec<PostureOrRefusal>> {
    let read: Vec<(Arc<Checked>, Result<ReadPoints, String>)> = leaves
        .into_iter()
        .map(|(scenario, points)| {
            let input = scenario.checked.clone();
            let read = points
                .read(&input)
                .map_err(|error| error.value(py).to_string());
            (input, read)
        })
        .collect();
    let mut requests = Vec::new();
    for (input, read) in &read {
        if let Ok(read) = read {
            requests.push(UnbendRequest {
                young: range(young),
                check: false,
                slow_loading: false,
                is_unit_known: read.is_unit_known,
                ..UnbendRequest::new((**input).clone(), read.points.clone())
            });
        }
    }
    let mut found = on_pool(py, || study::unbend_many(&requests))?.into_iter();
    let each = read.into_iter().map(|(input, read)| {
        let read = match read {
            Ok(read) => read,
            Err(why) => return Ok(PostureOrRefusal::Refusal(why)),
        };
        Ok(match found.next() {
            Some(Ok(mut found)) => {
                if let Some(taken) = read.taken {
                    found.remarks.insert(0, UnbendRemark::Coordinates(taken));
                }
                PostureOrRefusal::Posture(Py::new(py, Posture { found, input })?)
            }
            Some(Err(error @ UnbendError::Young { .. })) => return Err(value_error(error)),
            Some(Err(error)) => PostureOrRefusal::Refusal(format!("{}: {error}", read.name)),
            None => PostureOrRefusal::Refusal(format!("{}: was not solved", read.name)),
        })
    });
    each.collect()
}
