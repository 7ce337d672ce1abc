//! Every scenario of this repository, relaxed to every tolerance, with modes: it ends as
//! documented, and each mode is that of the leaf it is told with.

use std::path::Path;

use leafdyn_testing::*;
use rayon::prelude::*;

/// What is documented.
const DOCUMENTED: &str = include_str!("../../docs/how-to-read.md");

/// Relaxes with so many modes; what is told must fit together.
#[track_caller]
fn ends_as_documented(file: &Path, tolerance: f64, (modes, mode_shapes): (usize, bool)) {
    let scenario = read(file, "");
    let options = Options {
        mode_shapes,
        every_node: true,
        ..with_modes(modes, to(tolerance))
    };
    let found = relaxed(&scenario, &options);
    let (word, name) = (found.outcome.word(), &scenario.name);
    let what = format!("{name} to {tolerance:e} with {modes} modes: {word}");
    let section = DOCUMENTED.split("\n## Outcomes\n").nth(1).unwrap();
    let table = section.split("\n## ").next().unwrap();
    assert!(table.contains(&format!("| `{word}` |")), "{what}");
    assert!(found.outcome.is_at_rest(), "{what}: {:?}", found.remark);
    if found.outcome.is_success() {
        let allowed = tolerance * found.shape.longest();
        assert!(estimate(&found) <= allowed, "{what}");
    }
    let listed = found.stability.modes.unwrap_or_default();
    assert!(listed.len() <= modes, "{what}");
    assert!(listed.is_sorted_by_key(|mode| mode.eigenvalue), "{what}");
    let nodes = |rods: &[Vec<DVec3>]| rods.iter().map(Vec::len).collect::<Vec<_>>();
    let wanted = match mode_shapes {
        true => nodes(&found.shape.curves),
        false => Vec::new(),
    };
    for mode in &listed {
        assert!(mode.error.is_some_and(f64::is_finite), "{what}");
        assert_eq!(nodes(&mode.displacement), wanted, "{what}");
        assert_eq!(nodes(&mode.rotation), wanted, "{what}");
    }
}

#[test]
fn every_scenario_ends_as_documented_at_every_tolerance() {
    let files = resting_files();
    let tolerances: Vec<f64> = (1..=10).map(|k| 0.1_f64.powi(k)).collect();
    let all: Vec<_> = (files
        .iter()
        .flat_map(|file| tolerances.iter().map(move |t| (file, *t))))
    .collect();
    assert!(all.len() >= 340, "{}", all.len());
    all.into_par_iter().for_each(|(file, tolerance)| {
        ends_as_documented(file, tolerance, (3, false));
    });
}

/// Grids have no more modes than unknowns, and finer ones have more.
#[test]
fn more_modes_than_a_grid_has() {
    for name in ["bend45_300", "princeton", "rollup", "cantilever_tip"] {
        for tolerance in [1e-1, 1e-3, 1e-5] {
            ends_as_documented(&path(&format!("classic/{name}")), tolerance, (60, true));
        }
    }
    let one = path("classic/lens_60");
    ends_as_documented(&one, 1e-6, (100, true));
}
