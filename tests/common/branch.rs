//! Branches of equilibria, and the critical values along them.

use leafdyn::study::{Base, Trace, TraceRequest, trace};

use crate::common::{entries, path};

/// The text of a scenario that comes with the program.
pub fn text(name: &str) -> String {
    std::fs::read_to_string(path(name)).unwrap()
}

/// Follows the scenario of a text with [`entries`] replaced.
pub fn follow(text: &str, overrides: &str, vary: &str, switch: bool) -> Trace {
    let base = Base::of_text(text.into(), "test.toml".into(), &entries(overrides));
    let request = TraceRequest {
        base: base.unwrap(),
        vary: vary.parse().unwrap(),
        switch,
        keep_unstable: true,
        segments: None,
        tolerance: Some(1e-8),
        most_points: 2000,
        cross_section: None,
    };
    trace(&request, &mut |_, _, _| {}).unwrap()
}

/// Asserts that along the first branch the index changes at these values, by so
/// much, and nowhere else.
#[track_caller]
pub fn changes_at(what: &str, trace: &Trace, wanted: &[(f64, i64)], within: f64) {
    let branch = &trace.branches[0];
    let mut before = branch.points[0].index as i64;
    let mut found = Vec::new();
    for (_, point) in branch.critical() {
        found.push((point.value, point.index as i64 - before));
        before = point.index as i64;
        assert!(point.value_error.is_some(), "{what}: a bound is told");
    }
    println!("{what}: {found:?}, {:?}", trace.remark);
    assert_eq!(found.len(), wanted.len(), "{what}: {found:?}");
    for ((value, change), (wanted, wanted_change)) in found.iter().zip(wanted) {
        assert_eq!(change, wanted_change, "{what} at {value}");
        let off = (value / wanted - 1.0).abs();
        assert!(off < within, "{what}: {value} is {off:.1e} off {wanted}");
    }
}
