//! Scenarios: a text or a dictionary, its overrides, and the checked result.

use std::path::PathBuf;
use std::sync::{Arc, OnceLock};

use leafdyn::scenario::{self, Entries};
use leafdyn::study::BaseScenario;
use pyo3::prelude::*;

use crate::dictionary::Document;
use crate::errors::{TEXT, scenario_error, vary_error};

/// A checked scenario, with what it is from.
#[pyclass(frozen, module = "leafdyn._leafdyn")]
pub struct Scenario {
    source: Arc<Source>,
    #[pyo3(get)]
    overrides: Vec<String>,
    pub checked: Arc<scenario::Scenario>,
}

/// The source of a scenario, before overrides.
struct Source {
    /// The dictionary, if it is one.
    document: Option<Document>,
    /// The text; that of a dictionary is made on demand.
    text: OnceLock<String>,
    file: String,
    /// Its entries, made when some are replaced; `None` if they cannot be read.
    entries: OnceLock<Option<Entries>>,
}

impl Source {
    fn of_text(text: String, file: String) -> Self {
        Source {
            document: None,
            text: text.into(),
            file,
            entries: OnceLock::new(),
        }
    }

    fn text(&self) -> &str {
        self.text.get_or_init(|| {
            let text = self.document.as_ref().map(Document::text);
            text.unwrap_or_default()
        })
    }

    /// The checked scenario. A dictionary becomes a text where it is refused, so that the reason has
    /// a line.
    fn checked(&self, py: Python, overrides: &[String]) -> PyResult<scenario::Scenario> {
        // Settings of methods are not entries of the scenario, but are kept with it.
        let of_method = |entry: &String| entry.trim_start().starts_with("method.");
        if overrides.iter().any(of_method) {
            let base = BaseScenario::from_text(self.text().into(), self.file.clone(), overrides);
            let base = base.map_err(|error| vary_error(py, error))?;
            return Ok(base.scenario().clone());
        }
        let check = |entries: &Entries| entries.replaced(overrides)?.check();
        let read = || match &self.document {
            Some(document) => document.entries(),
            None => Entries::from_text(self.text(), &self.file).ok(),
        };
        let direct = match overrides {
            [] => read().as_ref().map(check),
            // They are kept for more replacements.
            _ => self.entries.get_or_init(read).as_ref().map(check),
        };
        if let Some(Ok(found)) = direct {
            return Ok(found);
        }
        let found = Entries::from_text(self.text(), &self.file).and_then(|all| check(&all));
        found.map_err(|error| scenario_error(py, &error))
    }
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
        Scenario::of(py, Source::of_text(text, file).into(), overrides)
    }

    /// A scenario from a file.
    #[staticmethod]
    fn read(py: Python, path: PathBuf, overrides: Vec<String>) -> PyResult<Self> {
        let text = scenario::text(&path).map_err(|error| scenario_error(py, &error))?;
        Scenario::new(py, text, overrides, Some(path.display().to_string()))
    }

    /// A scenario from a dictionary of the form of the file.
    #[staticmethod]
    fn from_dict(py: Python, entries: &Bound<PyAny>, overrides: Vec<String>) -> PyResult<Self> {
        let source = Source {
            document: Some(Document::read(entries)?),
            text: OnceLock::new(),
            file: TEXT.into(),
            entries: OnceLock::new(),
        };
        Scenario::of(py, source.into(), overrides)
    }

    /// The same with more entries replaced.
    fn replaced(&self, py: Python, overrides: Vec<String>) -> PyResult<Self> {
        let overrides = [self.overrides.clone(), overrides].concat();
        Scenario::of(py, self.source.clone(), overrides)
    }

    #[getter]
    fn text(&self) -> &str {
        self.source.text()
    }

    #[getter]
    fn file(&self) -> &str {
        &self.source.file
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
    fn units(&self) -> [Option<&str>; 3] {
        let units = &self.checked.units;
        [&units.length, &units.force, &units.time].map(Option::as_deref)
    }

    #[getter]
    fn tolerance(&self) -> f64 {
        self.checked.tolerance
    }
}

impl Scenario {
    fn of(py: Python, source: Arc<Source>, overrides: Vec<String>) -> PyResult<Self> {
        let checked = source.checked(py, &overrides)?;
        Ok(Scenario {
            source,
            overrides,
            checked: checked.into(),
        })
    }

    /// The scenario as a base for varied numbers.
    pub fn base(&self, py: Python) -> PyResult<BaseScenario> {
        let (text, file) = (self.source.text().to_string(), self.source.file.clone());
        let base = BaseScenario::from_text(text, file, &self.overrides);
        base.map_err(|error| vary_error(py, error))
    }
}
