//! Converts numbers of results to numpy arrays.

use leafdyn::relax::{NodeState, RodShape};
use pyo3::exceptions::PyKeyError;
use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use pyo3::types::{PyBytes, PyTuple};

/// A force, and the moment beside it if there is one.
pub type ForceAndMoment<'py> = (Bound<'py, PyAny>, Option<Bound<'py, PyAny>>);

/// A numpy array, or the exception that prevented it.
pub type Array<'py> = PyResult<Bound<'py, PyAny>>;

static FROM_BUFFER: PyOnceLock<Py<PyAny>> = PyOnceLock::new();

/// An array of this shape that owns these numbers and is read-only, as are the bytes below it.
pub fn array<'py>(py: Python<'py>, numbers: Vec<f64>, shape: &[usize]) -> Array<'py> {
    const BYTES: usize = size_of::<f64>();
    let bytes = PyBytes::new_with(py, BYTES * numbers.len(), |bytes| {
        for (bytes, number) in bytes.chunks_exact_mut(BYTES).zip(&numbers) {
            bytes.copy_from_slice(&number.to_ne_bytes());
        }
        Ok(())
    })?;
    let numbers = match numbers.is_empty() {
        // `frombuffer` refuses empty buffers.
        true => py.import("numpy")?.call_method1("empty", (0,))?,
        false => FROM_BUFFER
            .import(py, "numpy", "frombuffer")?
            .call1((bytes,))?,
    };
    numbers.call_method1("reshape", (PyTuple::new(py, shape)?,))
}

/// Vectors as rows.
pub fn vectors<'py, V: Copy + Into<[f64; 3]>>(py: Python<'py>, vectors: &[V]) -> Array<'py> {
    let numbers = flat(vectors.iter().copied());
    array(py, numbers, &[vectors.len(), 3])
}

/// The components of vectors, one after the other. Adding zero turns -0 into 0, as in the
/// files.
pub fn flat<V: Into<[f64; 3]>>(vectors: impl IntoIterator<Item = V>) -> Vec<f64> {
    let vectors = vectors.into_iter().flat_map(Into::into);
    vectors.map(|value| value + 0.0).collect()
}

/// Lists of vectors, all as long as the first, as an array of rods, nodes and components.
pub fn curves<'py, V: Copy + Into<[f64; 3]>>(py: Python<'py>, curves: &[Vec<V>]) -> Array<'py> {
    let nodes = curves.first().map_or(0, Vec::len);
    let numbers = flat(curves.iter().flatten().copied());
    array(py, numbers, &[curves.len(), nodes, 3])
}

/// A quantity at all nodes, by its name.
pub fn nodes<'py>(py: Python<'py>, rods: &[RodShape], quantity: &str) -> Array<'py> {
    let vector = |of: fn(&NodeState) -> [f64; 3]| {
        let nodes = rods.iter().flat_map(|rod| &rod.nodes);
        flat(nodes.map(of))
    };
    let numbers = match quantity {
        "positions" => vector(|node| node.position.into()),
        "strains" => vector(|node| node.v.into()),
        "curvatures" => vector(|node| node.u.into()),
        "forces" => vector(|node| node.n.into()),
        "moments" => vector(|node| node.m.into()),
        "rotations" => {
            let nodes = rods.iter().flat_map(|rod| &rod.nodes);
            let rotations = nodes.map(|node| node.rotation);
            let numbers = rotations.flat_map(|q| [q.w, q.x, q.y, q.z]);
            numbers.map(|value| value + 0.0).collect()
        }
        _ => return Err(PyKeyError::new_err(quantity.to_string())),
    };
    let stations = rods.first().map_or(0, |rod| rod.nodes.len());
    let components = if quantity == "rotations" { 4 } else { 3 };
    array(py, numbers, &[rods.len(), stations, components])
}
