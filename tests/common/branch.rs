//! Branches of equilibria, and the critical values along them.

use leafdyn::study::{Base, Trace, TraceRequest, trace};

use crate::common::{base, extrapolate, path};

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
pub fn request(base: Base, vary: &str, tolerance: f64, most_points: usize) -> TraceRequest {
    TraceRequest {
        base,
        vary: vary.parse().unwrap(),
        switch: false,
        keep_unstable: true,
        segments: None,
        tolerance: Some(tolerance),
        most_points,
        cross_section: None,
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

/// By how much, relatively, critical loads may be off: see [`critical`].
pub const NEUTRAL: f64 = 1e-6;

/// The critical value between `low` and `high` of a load that `unstable`
/// judges on a grid of so many segments: bisected on four nested grids, each
/// to the last digit, and extrapolated.
///
/// An eigenvalue counts as negative only where it can be told from zero, so
/// that critical loads come out too high by the part [`NEUTRAL`] at most.
#[track_caller]
pub fn critical(
    low: f64,
    high: f64,
    coarsest: usize,
    unstable: impl Fn(f64, usize) -> bool,
) -> f64 {
    let on_grid = |segments| {
        let (mut low, mut high) = (low, high);
        assert!(!unstable(low, segments), "unstable at {low} already");
        assert!(unstable(high, segments), "stable at {high} still");
        for _ in 0..45 {
            let middle = 0.5 * (low + high);
            match unstable(middle, segments) {
                true => high = middle,
                false => low = middle,
            }
        }
        0.5 * (low + high)
    };
    let values = [1, 2, 4, 8].map(|times| on_grid(coarsest * times));
    extrapolate(&values, 0.25)
}

/// As [`critical`], for an inextensible and unshearable leaf: the limit of
/// leaves of ever larger stretch and shear stiffness, which is passed on.
#[track_caller]
pub fn critical_of_rigid(
    low: f64,
    high: f64,
    coarsest: usize,
    unstable: impl Fn(f64, usize, f64) -> bool,
) -> f64 {
    let values = [1e4, 2e4, 4e4].map(|stiffness| {
        let unstable = |load, segments| unstable(load, segments, stiffness);
        critical(low, high, coarsest, unstable)
    });
    extrapolate(&values, 0.5)
}
