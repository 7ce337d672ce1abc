//! Boundaries of stability in the plane of two numbers.

use leafdyn::study::{BoundaryRequest, StabilityBoundary, trace_stability_boundary};

use super::base;
use super::branch::request;

/// The boundary of the scenario of a text with entries replaced, along the first number
/// and across it.
pub fn follow(text: &str, overrides: &str, along: &str, across: &str) -> StabilityBoundary {
    followed(1e-7, text, overrides, [along, across]).unwrap()
}

/// The same to a tolerance; why not, if it cannot be followed.
pub fn followed(
    tolerance: f64,
    text: &str,
    overrides: &str,
    [along, across]: [&str; 2],
) -> Result<StabilityBoundary, String> {
    let request = BoundaryRequest {
        trace: request(base(text, overrides), along, tolerance, 200),
        across: across.parse().unwrap(),
        map: None,
    };
    trace_stability_boundary(&request, &mut |_, _, _| {}).map_err(|error| error.to_string())
}
