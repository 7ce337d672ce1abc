//! The shape without the weight, from the shape under it.

mod common;

use common::fit::{Noise, base, fitted, request};
use leafdyn::study::FitOutcome;

const KNOTS: [f64; 3] = [0.5, -1.5, 1.0];

/// The vein of `scenarios/measured`, which hangs.
fn hanging() -> String {
    std::fs::read_to_string(common::path("measured/hanging")).unwrap()
}

/// Points on it, seen from the side, with noise.
fn traced(sd: f64, noise: &mut Noise) -> String {
    let value = format!("rest.bend_2.value={KNOTS:?}");
    let leaf = common::settle(base(&hanging(), &[&value]).scenario(), 1e-9);
    let mut table = String::from("rod,x,z,sd\n");
    for node in leaf.shape.rods[0].nodes.iter().skip(1) {
        let [x, _, z] = node.position.to_array();
        let [x, z] = [x, z].map(|it| it + sd * noise.normal());
        table += &format!("1,{x:?},{z:?},{:?}\n", sd.max(1e-4));
    }
    table
}

/// Without noise the knots come back, and relaxing the fitted leaf returns the traced one
/// within its error bar, stable.
#[test]
fn the_rest_shape_comes_back() {
    let data = traced(0.0, &mut Noise(1));
    let mut wanted = request(base(&hanging(), &[]), &[&data], &["rest.bend_2"]);
    wanted.tolerance = Some(1e-8);
    let found = fitted(&wanted);
    assert_eq!(found.outcome, FitOutcome::Converged, "{:?}", found.remarks);
    for (parameter, value) in found.parameters.iter().zip(KNOTS) {
        let error = (parameter.value - value).abs();
        assert!(
            error < 1e-3,
            "{}: {} {value}",
            parameter.key,
            parameter.value
        );
    }
    let leaf = common::settle(base(&found.fitted, &[]).scenario(), 1e-8);
    assert_eq!(leaf.stability.negative_eigenvalues, Some(0));
    for (node, line) in leaf.shape.rods[0]
        .nodes
        .iter()
        .skip(1)
        .zip(data.lines().skip(1))
    {
        let cells: Vec<f64> = line.split(',').map(|cell| cell.parse().unwrap()).collect();
        let [x, _, z] = node.position.to_array();
        let apart = (x - cells[1]).hypot(z - cells[2]);
        // The points were not marked: what is along the vein is not compared.
        assert!(apart < 1e-4, "{apart:e} at {}", cells[1]);
    }
}

/// With noise the leaf at rest lies within the bars of the points, as the fit says, and
/// the knots within theirs.
#[test]
fn noise_leaves_it_within_its_bars() {
    let data = traced(2e-3, &mut Noise(3));
    let found = fitted(&request(base(&hanging(), &[]), &[&data], &["rest.bend_2"]));
    assert_eq!(found.outcome, FitOutcome::Converged, "{:?}", found.remarks);
    let leaf = common::settle(base(&found.fitted, &[]).scenario(), 1e-8);
    assert_eq!(leaf.stability.negative_eigenvalues, Some(0));
    let curve = &leaf.shape.rods[0].nodes;
    for line in data.lines().skip(1) {
        let cells: Vec<f64> = line.split(',').map(|cell| cell.parse().unwrap()).collect();
        let to = |pair: &[leafdyn::relax::NodeState]| {
            let [a, b] = [pair[0].position, pair[1].position];
            let point = glam::DVec3::new(cells[1], 0.0, cells[2]);
            let t = ((point - a).dot(b - a) / (b - a).length_squared()).clamp(0.0, 1.0);
            (a + t * (b - a) - point).length()
        };
        let apart = curve.windows(2).map(to).fold(f64::INFINITY, f64::min);
        // Beyond the tip the vein is taken to go on straight.
        assert!(apart < 5.0 * cells[3], "{apart:e} at {}", cells[1]);
    }
    for (parameter, value) in found.parameters.iter().zip(KNOTS) {
        let half = 0.5 * (parameter.high.unwrap() - parameter.low.unwrap());
        assert!(
            (parameter.value - value).abs() < 2.0 * half,
            "{parameter:?} {value}"
        );
    }
}
