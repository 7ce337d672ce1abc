//! Branches of equilibria, and the critical values along them.

use leafdyn::relax::Limit;
use leafdyn::study::{BaseScenario, Trace, TraceRequest, trace};

use crate::{base, path};

/// The text of a scenario that comes with the program.
pub fn text(name: &str) -> String {
    std::fs::read_to_string(path(name)).unwrap()
}

/// The keys, as one, by which all veins of `study/undulation` but the midrib bend up and down.
pub fn weak_veins() -> String {
    let weak = (0..11).filter(|vein| *vein != 5);
    let keys = weak.map(|vein| format!("stiffness.bending_2[{vein}]"));
    keys.collect::<Vec<_>>().join("+")
}

/// The entries of `study/undulation` without weight, in which the other veins bend so easily.
pub fn weightless(bending: f64, torsion: f64) -> String {
    let weak = [bending; 5].map(|it| it.to_string()).join(", ");
    format!(
        "load.gravity=[0, 0, 0]; stiffness.torsion={torsion}; \
         stiffness.bending_2=[{weak}, 1000, {weak}]"
    )
}

/// To follow the equilibria of a leaf, unstable ones too.
pub fn request(base: BaseScenario, vary: &str, tolerance: f64, most_points: usize) -> TraceRequest {
    TraceRequest {
        base,
        vary: vary.parse().unwrap(),
        switch: false,
        until: None,
        keep_unstable: true,
        segments: None,
        tolerance: Some(tolerance),
        most_points,
        limit: Limit::default(),
    }
}

/// Follows the scenario of a text with entries replaced.
pub fn follow(text: &str, overrides: &str, vary: &str, switch: bool) -> Trace {
    let mut request = request(base(text, overrides), vary, 1e-8, 2000);
    request.switch = switch;
    trace(&request, &mut |_, _, _| {}).unwrap()
}

/// Asserts that along the first branch the index changes at these values, by so
/// much, and nowhere else.
#[track_caller]
pub fn changes_at(what: &str, trace: &Trace, wanted: &[(f64, i64)], within: f64) {
    let branch = &trace.branches[0];
    let mut before = branch.points[0].index as i64;
    let mut found = Vec::new();
    for (_, point) in branch.critical_points() {
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
