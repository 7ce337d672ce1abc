//! Where a relaxation begins.

use crate::leaf::{DiscreteLeaf, State};
use crate::rotation;
use glam::{DQuat, DVec3};
use std::f64::consts::PI;

/// The start of a relaxation: circular arcs that leave the base as the fan
/// says and meet in a common tip; free rods start from their rest shapes.
pub fn start(leaf: &DiscreteLeaf) -> State {
    if leaf.leaf.joined() && leaf.rods() > 1 {
        arcs(leaf)
    } else {
        rest_shapes(leaf)
    }
}

/// Arcs in the plane of the fan, symmetric about the mean base direction. Their
/// chords differ: what is missing to the mean chord is made up by stretching.
fn arcs(leaf: &DiscreteLeaf) -> State {
    let model = leaf.leaf;
    let angles: Vec<f64> = (0..leaf.rods())
        .map(|j| model.scenario().rods[j].angle)
        .collect();
    let sum: DVec3 = angles
        .iter()
        .map(|phi| DVec3::new(phi.cos(), phi.sin(), 0.0))
        .sum();
    let mean = if sum.length() > 1e-9 * angles.len() as f64 {
        sum.y.atan2(sum.x)
    } else {
        angles[0]
    };
    let opening = |phi: f64| {
        let delta = (phi - mean).rem_euclid(2.0 * PI);
        if delta > PI { delta - 2.0 * PI } else { delta }
    };
    let sinc = |x: f64| if x.abs() < 1e-8 { 1.0 } else { x.sin() / x };
    let chords: f64 = (0..leaf.rods())
        .map(|j| model.grown(j, 1.0) * sinc(opening(angles[j])))
        .sum();
    let direction = DVec3::new(mean.cos(), mean.sin(), 0.0);
    let tip = direction * (chords / leaf.rods() as f64);
    let (mut x, mut q) = (Vec::new(), Vec::new());
    for (j, &phi) in angles.iter().enumerate() {
        let (delta, length) = (opening(phi), model.grown(j, 1.0));
        // The turn is spread evenly over the length the vein has grown to.
        let part = |sigma: f64| model.grown(j, sigma) / length;
        let arc = |sigma: f64| {
            // A chord leaves half-way between the tangents at its ends.
            let turned = phi - delta * sigma;
            DVec3::new(turned.cos(), turned.sin(), 0.0) * (length * sigma * sinc(delta * sigma))
        };
        let missing = tip - arc(1.0);
        for &sigma in leaf.grid.sigma() {
            let sigma = part(sigma);
            x.push(arc(sigma) + sigma * missing);
            q.push(rotation::exp((phi - 2.0 * delta * sigma) * DVec3::Z));
        }
        *x.last_mut().expect("a rod has nodes") = tip;
    }
    State::new(leaf.segments(), x, q)
}

/// Unstrained rods: v = v0, u = u0.
fn rest_shapes(leaf: &DiscreteLeaf) -> State {
    let (mut xs, mut qs) = (Vec::new(), Vec::new());
    for j in 0..leaf.rods() {
        let (mut x, mut q): (DVec3, DQuat) = (DVec3::ZERO, leaf.leaf.base(j));
        xs.push(x);
        qs.push(q);
        for i in 0..leaf.segments() {
            let section = leaf.section(j, i);
            let next = (q * rotation::exp(section.rest_curvature * section.ds)).normalize();
            x += section.ds * (rotation::midpoint(q, next) * section.rest_strain);
            q = next;
            xs.push(x);
            qs.push(q);
        }
    }
    State::new(leaf.segments(), xs, qs)
}
