//! Results: a leaf at rest, and what stands in the files of any result.

use leafdyn::files::{self, Written};
use leafdyn::relax::{Equilibrium, Mode};
use pyo3::exceptions::PyKeyError;
use pyo3::prelude::*;
use pyo3::types::PyBytes;

use crate::arrays::{Array, array, curves, flat, nodes, vectors};

/// A result that files are written of, whatever it is.
trait Contents: Send + Sync {
    fn names(&self) -> Vec<&'static str>;
    fn contents(&self, name: &str) -> Option<Vec<u8>>;
}

impl<R: Written + Send + Sync> Contents for R {
    fn names(&self) -> Vec<&'static str> {
        self.file_names()
    }

    fn contents(&self, name: &str) -> Option<Vec<u8>> {
        files::contents(self, name)
    }
}

/// What the interpreter need not wait for: a picture takes its time.
fn read<'py>(
    py: Python<'py>,
    result: &(impl Contents + ?Sized),
    name: &str,
) -> PyResult<Bound<'py, PyBytes>> {
    let found = py.detach(|| result.contents(name));
    let bytes = found.ok_or_else(|| PyKeyError::new_err(name.to_string()))?;
    Ok(PyBytes::new(py, &bytes))
}

/// The files of a result.
#[pyclass(frozen, module = "leafdyn._leafdyn")]
pub struct Files(Box<dyn Contents>);

impl Files {
    pub fn of(result: impl Written + Send + Sync) -> Self {
        Files(Box::new(result))
    }
}

#[pymethods]
impl Files {
    /// The names of the files.
    fn names(&self) -> Vec<&'static str> {
        self.0.names()
    }

    /// What stands in the file of this name.
    fn contents<'py>(&self, py: Python<'py>, name: &str) -> PyResult<Bound<'py, PyBytes>> {
        read(py, &*self.0, name)
    }
}

/// A leaf at rest, or as far as it came.
#[pyclass(frozen, module = "leafdyn._leafdyn")]
pub struct Leaf(pub Equilibrium);

#[pymethods]
impl Leaf {
    /// The names of the files.
    fn names(&self) -> Vec<&'static str> {
        self.0.file_names()
    }

    /// What stands in the file of this name.
    fn contents<'py>(&self, py: Python<'py>, name: &str) -> PyResult<Bound<'py, PyBytes>> {
        read(py, &self.0, name)
    }

    #[getter]
    fn name(&self) -> &str {
        &self.0.scenario
    }

    #[getter]
    fn method(&self) -> &'static str {
        self.0.method.word()
    }

    #[getter]
    fn outcome(&self) -> &'static str {
        self.0.outcome.word()
    }

    #[getter]
    fn success(&self) -> bool {
        self.0.outcome.is_success()
    }

    #[getter]
    fn remark(&self) -> Option<&str> {
        self.0.remark.as_deref()
    }

    #[getter]
    fn rods(&self) -> usize {
        self.0.rod_count
    }

    #[getter]
    fn segments(&self) -> Vec<usize> {
        self.0.accuracy.segments.clone()
    }

    #[getter]
    fn tolerance(&self) -> f64 {
        self.0.accuracy.tolerance
    }

    #[getter]
    fn residual(&self) -> Option<f64> {
        self.0.accuracy.residual
    }

    #[getter]
    fn error_estimate(&self) -> Option<f64> {
        self.0.accuracy.error_estimate
    }

    #[getter]
    fn energy(&self) -> Option<f64> {
        self.0.energy
    }

    #[getter]
    fn negative_eigenvalues(&self) -> Option<usize> {
        self.0.stability.negative_eigenvalues
    }

    #[getter]
    fn wall_seconds(&self) -> f64 {
        self.0.wall_seconds
    }

    #[getter]
    fn joined(&self) -> bool {
        self.0.shape.joined
    }

    /// The joint tip alone, or the tips of all rods.
    fn tips<'py>(&self, py: Python<'py>) -> Array<'py> {
        vectors(py, &self.0.tips)
    }

    fn tip_force_sum<'py>(&self, py: Python<'py>) -> Array<'py> {
        array(py, self.0.tip_force_sum.to_array().to_vec(), &[3])
    }

    fn stations<'py>(&self, py: Python<'py>) -> Array<'py> {
        let stations = &self.0.shape.stations;
        array(py, stations.clone(), &[stations.len()])
    }

    fn lengths<'py>(&self, py: Python<'py>) -> Array<'py> {
        let rods = &self.0.shape.rods;
        let lengths = rods.iter().map(|rod| rod.length).collect();
        array(py, lengths, &[rods.len()])
    }

    /// A quantity at all stations of all rods, by its name.
    fn nodes<'py>(&self, py: Python<'py>, quantity: &str) -> Array<'py> {
        nodes(py, &self.0.shape.rods, quantity)
    }

    /// All nodes of the finest grid.
    fn curves<'py>(&self, py: Python<'py>) -> Array<'py> {
        curves(py, &self.0.shape.curves)
    }

    /// Eigenvalues of the modes that were asked for and found, and bounds on their errors.
    fn eigenvalues<'py>(&self, py: Python<'py>) -> PyResult<Option<[Bound<'py, PyAny>; 2]>> {
        let Some(modes) = &self.0.stability.modes else {
            return Ok(None);
        };
        let numbers = |of: fn(&Mode) -> f64| {
            let numbers = modes.iter().map(of).collect();
            array(py, numbers, &[modes.len()])
        };
        let errors = numbers(|mode| mode.error.unwrap_or(f64::NAN))?;
        Ok(Some([numbers(|mode| mode.eigenvalue)?, errors]))
    }

    /// Displacements and rotations of the modes on the finest grid.
    fn mode_shapes<'py>(&self, py: Python<'py>) -> PyResult<[Bound<'py, PyAny>; 2]> {
        let modes = self.0.stability.modes.as_deref().unwrap_or_default();
        let (rods, nodes) = match modes.first() {
            Some(mode) => (mode.displacement.len(), mode.displacement[0].len()),
            None => (self.0.rod_count, 0),
        };
        let of = |shape: fn(&Mode) -> &Vec<Vec<_>>| {
            let vectors = modes.iter().flat_map(shape).flatten().copied();
            array(py, flat(vectors), &[modes.len(), rods, nodes, 3])
        };
        Ok([of(|mode| &mode.displacement)?, of(|mode| &mode.rotation)?])
    }
}
