//! The live page with a scenario in it.

use leafdyn::study::ParameterKeys;
use leafdyn_program::live::{self, LiveSlider};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use crate::errors::vary_error;
use crate::scenario::Scenario;

/// What is told where the package was built without the page.
const HOW_TO_BUILD: &str = "this package was built without the live page: in the checkout, \
    `web/build.sh && MATURIN_PEP517_ARGS=\"--features live\" pip install ./python` builds it with the page";

/// The page on which a scenario is open, with these sliders: the path of a number, the ends of its
/// range, and whether it is logarithmic.
#[pyfunction]
pub fn live_page(
    py: Python,
    scenario: &Scenario,
    sliders: Vec<(String, f64, f64, bool)>,
) -> PyResult<String> {
    let base = scenario.base(py)?;
    for (key, ..) in &sliders {
        let keys: ParameterKeys = key.parse().map_err(|error| vary_error(py, error))?;
        base.differentiable_value(&keys)
            .map_err(|error| vary_error(py, error))?;
    }
    let sliders = sliders.into_iter();
    let sliders: Vec<LiveSlider> = sliders
        .map(|(key, low, high, log)| LiveSlider {
            key,
            low,
            high,
            log,
        })
        .collect();
    let text = match base.overrides().is_empty() {
        true => base.text().to_owned(),
        false => base.toml(&[]).unwrap_or_default(),
    };
    let name = format!("{}.toml", base.scenario().name);
    live::live_page(&text, &name, &sliders).map_err(|_| PyValueError::new_err(HOW_TO_BUILD))
}
