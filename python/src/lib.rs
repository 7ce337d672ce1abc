//! `leafdyn._leafdyn`: the native module of the Python package `leafdyn`. It has computations, arrays
//! and the contents of files; their presentation and documentation are in the package.

use pyo3::prelude::*;

mod arrays;
mod dictionary;
mod errors;
mod examples;
mod fit;
mod live;
mod motion;
mod posture;
mod range;
mod relax;
mod result;
mod run;
mod scenario;
mod start;
mod verbs;

/// As in the program: a leaf needs many small arrays for a short time, and a list of scenarios,
/// each of many parts, has to be freed quickly after Ctrl-C.
#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

/// What `leafdyn` for Python computes with.
#[pymodule]
mod _leafdyn {
    use super::{Bound, PyModule, PyResult};

    #[pymodule_export]
    use super::dictionary::overrides;
    #[pymodule_export]
    use super::examples::{dimensions, examples, schema, templates};
    #[pymodule_export]
    use super::fit::fit;
    #[pymodule_export]
    use super::live::live_page;
    #[pymodule_export]
    use super::motion::Motion;
    #[pymodule_export]
    use super::posture::{Posture, unbend, unbend_many};
    #[pymodule_export]
    use super::relax::{library_seconds, relax_many, relax_one};
    #[pymodule_export]
    use super::result::{Files, Leaf, kind, leaf_column};
    #[pymodule_export]
    use super::run::{panic_on_purpose, set_threads, threads};
    #[pymodule_export]
    use super::scenario::Scenario;
    #[pymodule_export]
    use super::verbs::{boundary, chart, check, equilibria, map, program, trace};

    #[expect(non_upper_case_globals, reason = "it is the name that Python knows")]
    #[pymodule_export]
    const __version__: &str = env!("CARGO_PKG_VERSION");

    #[pymodule_init]
    fn init(_module: &Bound<PyModule>) -> PyResult<()> {
        super::run::remember_first_thread();
        Ok(())
    }
}
