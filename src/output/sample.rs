//! Results to test the formats with: arcs that fan out and meet in a tip.

use std::f64::consts::PI;

use glam::{DQuat, DVec3};

use crate::bvp::{self, Neutral, Solution};
use crate::relax::{Equilibrium, Model, NodeState, Outcome, RodShape, Work};
use crate::shape::Difference;
use crate::study::{Check, Shot, Verdict};

/// A fan of `rods` arcs of length 1, given at `segments` + 1 stations.
pub fn fan(rods: usize, segments: usize) -> Equilibrium {
    let stations: Vec<f64> = (0..=segments).map(|i| i as f64 / segments as f64).collect();
    let angle = |rod: usize| (2.0 * (rod as f64 + 0.5) / rods as f64 - 1.0) * PI / 3.0;
    let point = |rod: usize, sigma: f64| {
        let angle = angle(rod);
        let side = if angle.abs() < 1e-9 {
            0.0
        } else {
            ((angle * (1.0 - 2.0 * sigma)).cos() - angle.cos()) / (2.0 * angle)
        };
        DVec3::new(0.95 * sigma, side, -0.15 * sigma * sigma)
    };
    let node = |rod: usize, sigma: f64| NodeState {
        position: point(rod, sigma),
        rotation: DQuat::from_rotation_z(angle(rod) * (1.0 - 2.0 * sigma)),
        v: DVec3::X,
        u: DVec3::new(0.0, 0.0, -2.0 * angle(rod)),
        n: DVec3::new(0.1, 0.2, 0.3),
        m: DVec3::new(0.4, 0.5, 0.6),
    };
    let shape = |rod: usize| RodShape {
        length: 1.0,
        nodes: stations.iter().map(|&sigma| node(rod, sigma)).collect(),
    };
    let shapes: Vec<RodShape> = (0..rods).map(shape).collect();
    let curves = shapes
        .iter()
        .map(|shape| shape.nodes.iter().map(|node| node.position).collect())
        .collect();
    Equilibrium {
        scenario: "fan".into(),
        method: "semi-implicit",
        outcome: Outcome::Converged,
        remark: None,
        model: Model::default(),
        segments: vec![segments],
        intervals: None,
        tolerance: 1e-6,
        residual: 1e-13,
        error_estimate: Some(3e-9),
        energy: 11.07,
        joined: true,
        tips: vec![point(0, 1.0)],
        tip_force_sum: DVec3::ZERO,
        negative_eigenvalues: Some(0),
        saddle: None,
        work: Work {
            steps: 8,
            factorizations: 9,
            force_evaluations: 9,
            cg_iterations: 40,
        },
        wall_seconds: 0.01,
        stations,
        rods: shapes,
        curves,
    }
}

/// A check of that fan whose boundary-value solution is turned about x by
/// `angle`.
pub fn check(rods: usize, segments: usize, angle: f64) -> Check {
    let relaxed = fan(rods, segments);
    let turn = DQuat::from_rotation_x(angle);
    let mut shapes = relaxed.rods.clone();
    for node in shapes.iter_mut().flat_map(|rod| &mut rod.nodes) {
        node.position = turn * node.position;
        node.rotation = turn * node.rotation;
    }
    let at = |i: usize| {
        let pairs = relaxed.rods.iter().zip(&shapes);
        pairs
            .map(|(a, b)| Difference::of(&a.nodes[i], &b.nodes[i]))
            .fold(Difference::default(), Difference::max)
    };
    let along: Vec<Difference> = (0..=segments).map(at).collect();
    let difference = along.iter().copied().reduce(Difference::max);
    let still = vec![DVec3::ZERO; segments + 1];
    let solution = Solution {
        stations: relaxed.stations.clone(),
        rods: shapes,
        energy: 11.08,
        error: Difference {
            position: 1e-10,
            rotation: 2e-10,
            force: 3e-9,
            moment: 4e-9,
        },
        defect: 1e-14,
        intervals: vec![0.0, 0.5, 1.0],
        growth: 4.2,
        condition: 1e-10,
        neutral: Some(Neutral {
            ratio: 1e-10,
            displacement: vec![still; rods],
        }),
        work: bvp::Work::default(),
    };
    Check {
        relaxed,
        shot: Some(Ok(Shot {
            solution,
            negative_eigenvalues: Some(2),
        })),
        shot_seconds: Some(0.02),
        along,
        difference,
        verdict: if angle == 0.0 {
            Verdict::Agree
        } else {
            Verdict::Differ
        },
    }
}
