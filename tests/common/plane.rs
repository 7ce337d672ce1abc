//! Boundaries of stability in the plane of two numbers.

use leafdyn::study::{Base, Boundary, BoundaryRequest, TraceRequest, boundary};

use super::entries;

/// The boundary of the scenario of a text with entries replaced, along the first number
/// and across it.
pub fn follow(text: &str, overrides: &str, along: &str, across: &str) -> Boundary {
    follow_to(1e-7, text, overrides, [along, across])
}

/// The same to a tolerance.
pub fn follow_to(
    tolerance: f64,
    text: &str,
    overrides: &str,
    [along, across]: [&str; 2],
) -> Boundary {
    let base = Base::of_text(text.into(), "test.toml".into(), &entries(overrides));
    let request = BoundaryRequest {
        trace: TraceRequest {
            base: base.unwrap(),
            vary: along.parse().unwrap(),
            switch: false,
            keep_unstable: true,
            segments: None,
            tolerance: Some(tolerance),
            most_points: 200,
            cross_section: None,
        },
        across: across.parse().unwrap(),
        map: None,
    };
    boundary(&request, &mut |_, _, _| {}).unwrap()
}
