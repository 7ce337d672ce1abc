//! The discretisation is of second order, and its error is a series in ds^2
//! so clean that every extrapolation gains two orders: 4, 6, 8.

use leafdyn_testing::*;

/// Positions at the stations of the coarsest grid, solved on one grid.
fn positions(scenario: &Scenario, coarsest: usize, times: usize) -> Vec<DVec3> {
    // To rounding.
    let leaf = settled(scenario, &iterated(1e-12, coarsest * times));
    // Every grid halves the one before, kinks or not.
    for (i, sigma) in leaf.shape.stations.iter().step_by(times).enumerate() {
        assert!((sigma - i as f64 / coarsest as f64).abs() < 1e-15);
    }
    let rods = leaf.shape.rods.iter();
    let nodes = rods.flat_map(|rod| rod.nodes.iter().step_by(times));
    nodes.map(|node| node.position).collect()
}

fn distance(a: &[DVec3], b: &[DVec3]) -> f64 {
    largest(a.iter().zip(b).map(|(a, b)| a.distance(*b)))
}

/// Column m of the extrapolation table, on seven grids each half as fine as
/// the next, changes from one grid to the next by as much less each time as
/// its order says.
fn assert_orders(name: &str, scenario: &Scenario, coarsest: usize) {
    let grids = [1, 2, 4, 8, 16, 32, 64];
    let on = |times| positions(scenario, coarsest, times);
    let mut column = grids.map(on).to_vec();
    let orders = [(2.0, 0.01), (4.0, 0.05), (6.0, 0.1), (8.0, 0.6)];
    for (m, (order, slack)) in orders.into_iter().enumerate() {
        let changes: Vec<f64> = column.windows(2).map(|w| distance(&w[0], &w[1])).collect();
        // Two successive changes above rounding, as fine as possible.
        let rounding = if m < 3 { 1e-12 } else { 3e-14 };
        let above = changes.iter().take_while(|change| **change > rounding);
        let seen = above.count();
        assert!(seen >= 2, "{name}: column {m} changes by {changes:?}");
        let observed = leafdyn_testing::order(changes[seen - 2], changes[seen - 1]);
        let what = format!("order of {name}, {changes:?}");
        close(&what, observed, order, slack);
        let power = 4f64.powi(m as i32 + 1);
        let next = |w: &[Vec<DVec3>]| {
            let pairs = w[0].iter().zip(&w[1]);
            pairs.map(|(c, f)| *f + (*f - *c) / (power - 1.0)).collect()
        };
        column = column.windows(2).map(next).collect();
    }
}

/// Of a twisted anisotropic rod in space, of the leaf of Fig. 4, and of one whose stiffness has
/// a kink: the grid puts a node there, so that the midpoint rule never sees it.
#[test]
fn every_extrapolation_gains_two_orders() {
    let mut rod = paper_leaf(1, [0.9, 1.2, 0.7], [80.0, 60.0, 40.0], 0.3);
    rod.rods[0].rest_curvature = [1.0, 2.0, 0.5].map(Profile::Constant);
    rod.tip_force = [1.5, -2.1, 3.0];
    assert_orders("rod", &rod, 6);
    assert_orders("fig. 4", &fig04(5), 4);
    let mut leaf = fig04(5);
    for rod in &mut leaf.rods {
        for k in [1, 2] {
            rod.couple_stiffness[k] = linear(&[0.0, 0.3, 1.0], &[2.0, 0.5, 0.8]);
        }
        rod.rest_curvature[2] = linear(&[0.0, 0.3, 1.0], &[0.0, 1.0, -0.5]);
    }
    assert_orders("kink", &leaf, 10);
}
