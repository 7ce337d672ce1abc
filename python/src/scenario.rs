//! Scenarios: a text, what is replaced in it, and the checked leaf.

use std::path::PathBuf;
use std::sync::Arc;

use leafdyn::scenario;
use leafdyn::study::Base;
use pyo3::prelude::*;

use crate::errors::{TEXT, cannot_vary, refused};
use crate::toml_text;

/// A checked scenario, with the text it is from.
#[pyclass(frozen, module = "leafdyn._leafdyn")]
pub struct Scenario {
    #[pyo3(get)]
    text: String,
    #[pyo3(get)]
    file: String,
    #[pyo3(get)]
    overrides: Vec<String>,
    pub checked: Arc<scenario::Scenario>,
}

#[pymethods]
impl Scenario {
    /// A scenario from its text, which messages call `file`.
    #[new]
    #[pyo3(signature = (text, overrides, file = None))]
    fn new(
        py: Python,
        text: String,
        overrides: Vec<String>,
        file: Option<String>,
    ) -> PyResult<Self> {
        let file = file.unwrap_or_else(|| TEXT.into());
        // Settings of methods are no entries of the leaf, but are kept with it.
        let of_method = |entry: &&String| entry.trim_start().starts_with("method.");
        let checked = match overrides.iter().any(|entry| of_method(&entry)) {
            true => {
                let base = Base::of_text(text.clone(), file.clone(), &overrides);
                base.map_err(|error| cannot_vary(py, error))?
                    .scenario()
                    .clone()
            }
            false => scenario::Scenario::from_toml_with(&text, &file, &overrides)
                .map_err(|error| refused(py, &error))?,
        };
        Ok(Scenario {
            text,
            file,
            overrides,
            checked: Arc::new(checked),
        })
    }

    /// A scenario from a file.
    #[staticmethod]
    fn read(py: Python, path: PathBuf, overrides: Vec<String>) -> PyResult<Self> {
        let text = scenario::text(&path).map_err(|error| refused(py, &error))?;
        Scenario::new(py, text, overrides, Some(path.display().to_string()))
    }

    /// A scenario from a dictionary of the form of the file.
    #[staticmethod]
    fn from_dict(py: Python, entries: &Bound<PyAny>, overrides: Vec<String>) -> PyResult<Self> {
        Scenario::new(py, toml_text::document(entries)?, overrides, None)
    }

    #[getter]
    fn name(&self) -> &str {
        &self.checked.name
    }

    #[getter]
    fn rods(&self) -> usize {
        self.checked.rods.len()
    }

    #[getter]
    fn joined(&self) -> bool {
        self.checked.joined
    }

    #[getter]
    fn lengths(&self) -> Vec<f64> {
        self.checked.rods.iter().map(|rod| rod.length).collect()
    }

    #[getter]
    fn units(&self) -> (Option<&str>, Option<&str>) {
        let units = &self.checked.units;
        (units.length.as_deref(), units.force.as_deref())
    }

    #[getter]
    fn tolerance(&self) -> f64 {
        self.checked.tolerance
    }
}

impl Scenario {
    /// The same, for numbers that vary.
    pub fn base(&self, py: Python) -> PyResult<Base> {
        let base = Base::of_text(self.text.clone(), self.file.clone(), &self.overrides);
        base.map_err(|error| cannot_vary(py, error))
    }
}
