//! The format of scenarios, and scenarios that are compiled in: what `leafdyn new` writes, and those
//! of the repository.

use leafdyn::scenario::{self, Key};
use pyo3::prelude::*;

/// Names, and texts in TOML.
type Texts = Vec<(&'static str, &'static str)>;

/// The texts of the files of a folder, by their names without `.toml`.
macro_rules! texts {
    ($folder:literal: $($name:literal)+) => {
        [$(($name, include_str!(concat!("../../", $folder, "/", $name, ".toml")))),+]
    };
}

/// The JSON schema of scenarios.
#[pyfunction]
pub fn schema() -> String {
    scenario::schema().to_string()
}

/// Exponents of length, force and time of the numbers of all keys, by their paths.
#[pyfunction]
pub fn dimensions() -> Vec<(&'static str, (i32, i32, i32))> {
    let keys = Key::all();
    let dimension = |key: Key| {
        let [length, force, time] = key.dimension();
        (key.path(), (length, force, time))
    };
    keys.map(dimension).collect()
}

/// What `leafdyn new` writes, by the words it knows.
#[pyfunction]
pub fn templates() -> Texts {
    texts!("program/src/verbs/examples": "leaf" "blade" "rod" "pull-test" "motion").to_vec()
}

/// The scenarios of the repository.
#[pyfunction]
pub fn examples() -> Texts {
    [
        &texts!("scenarios/paper":
            "fig04" "fig05" "fig06" "fig07a" "fig07b" "fig08" "fig09" "fig10" "fig13")[..],
        &texts!("scenarios/classic":
            "bend45_300" "bend45_600" "cantilever_heavy" "cantilever_heavy_cosserat"
            "cantilever_tip" "cantilever_tip_cosserat" "elastica_buckled" "fan_2" "fan_3" "fan_5"
            "hanging_curved" "helical_rollup" "lens_30" "lens_60" "lens_coupled" "lens_midrib"
            "princeton" "rollup" "three_point_bending" "twisted_strip"),
        &texts!("scenarios/measured":
            "across" "blade" "clip" "grass" "hanging" "lily" "orchid" "posture" "pull"),
        &texts!("scenarios/field": "bamboo" "palm" "pazy" "wheat"),
        &texts!("scenarios/motion": "curl" "drop" "gust" "snap" "strike" "swing"),
        &texts!("scenarios/study": "plate" "saddle" "undulation"),
    ]
    .concat()
}
