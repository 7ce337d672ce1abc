//! The shape without the weight, from the shape under it.

use leafdyn::study::{Fit, FitOutcome};
use leafdyn_testing::fit::{self, fitted, gives_back, request, within_bars};
use leafdyn_testing::random::Draw;
use leafdyn_testing::*;

const KNOTS: [f64; 3] = [0.5, -1.5, 1.0];

/// The vein of `scenarios/measured`, which hangs, with noise of a deviation: points on it,
/// seen from the side, what is fitted to them to a tolerance, and that leaf at rest.
fn traced(sd: f64, seed: u64, tolerance: Option<f64>) -> (Vec<DVec3>, Fit, Vec<NodeState>) {
    let hanging = leafdyn_testing::branch::text("measured/hanging");
    let mut noise = Draw(seed);
    let knots = format!("rest.bend_2.value={KNOTS:?}");
    let leaf = settle(base(&hanging, &knots).scenario(), 1e-9);
    let (table, points) = fit::traced(&leaf, [1, 1], "rod,x,z,sd", sd, &mut noise);
    let mut wanted = request(base(&hanging, ""), &[&table], &["rest.bend_2"]);
    wanted.tolerance = tolerance;
    let found = fitted(&wanted);
    assert_eq!(found.outcome, FitOutcome::Converged, "{:?}", found.remarks);
    let leaf = settle(base(&found.fitted, "").scenario(), 1e-8);
    assert_eq!(leaf.stability.negative_eigenvalues, Some(0));
    (points, found, leaf.shape.rods[0].nodes.clone())
}

/// Without noise the knots come back, and relaxing the fitted leaf returns the traced one
/// within its error bar, stable.
#[test]
fn the_rest_shape_comes_back() {
    let (points, found, curve) = traced(0.0, 1, Some(1e-8));
    gives_back(&found, &KNOTS, 6e-4);
    assert_eq!(curve.len(), 1 + points.len());
    for (node, point) in curve[1..].iter().zip(points) {
        let apart = node.position.distance(point);
        // The points were not marked: what is along the vein is not compared.
        assert!(apart < 1e-4, "{apart:e} at {point}");
    }
}

/// With noise the leaf at rest lies within the bars of the points, as the fit says, and
/// the knots within theirs.
#[test]
fn noise_leaves_it_within_its_bars() {
    let sd = 2e-3;
    let (points, found, curve) = traced(sd, 3, None);
    for point in points.into_iter().map(|point| point.with_y(0.0)) {
        let to = |pair: &[NodeState]| {
            let [a, b] = [pair[0].position, pair[1].position];
            let t = ((point - a).dot(b - a) / (b - a).length_squared()).clamp(0.0, 1.0);
            (a + t * (b - a) - point).length()
        };
        let apart = curve.windows(2).map(to).fold(f64::INFINITY, f64::min);
        // Beyond the tip the vein is taken to go on straight.
        assert!(apart < 5.0 * sd, "{apart:e} at {point}");
    }
    within_bars(&found, &KNOTS, 2.0);
}
