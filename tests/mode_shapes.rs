//! Modes of one grid: their shapes are orthonormal and satisfy the equations, a leaf
//! vibrates so, but for the known dispersion of leapfrog, and where their search begins does
//! not matter.

mod common;

use common::motion::{beam, discrete, off_cosine, released, rest, three_veins};
use common::vibration::Linear;
use common::*;
use leafdyn::internals::leaf::{DiscreteLeaf, State};
use leafdyn::internals::modes;
use leafdyn::internals::motion::Physics;

/// Of a mode in whose shape a leaf is let go.
const SIZE: f64 = 1e-6;

/// The stable leaf does vibrate with the frequency of a mode if it is let go in
/// its shape: by leapfrog with steps of h at 2/h asin(omega h/2).
#[test]
fn a_leaf_let_go_in_a_mode_keeps_its_frequency() {
    let mut veins = pulled_veins();
    veins.gravity = veins.dynamics.gravity.at(0.0);
    let state = rest(&veins, 6);
    let leaf = Leaf::new(&veins);
    let (grid, physics) = (discrete(&leaf, 6), Physics::new(&leaf));
    let mut exact = state.clone();
    settle_forces(&grid, &mut exact);
    for pair in modes::lowest(&grid, &physics, &exact, wanted(5, &Limit::default(), &[])).unwrap() {
        let omega = pair.eigenvalue.sqrt();
        let mut start = state.clone();
        for (node, increment) in pair.shape.iter().enumerate() {
            start.advance(node, increment, SIZE);
        }
        let worst = off_cosine(&leaf, (&state, &start), (omega, 1e-3), (SIZE, 40));
        assert!(worst < 1e-4, "omega {omega}: {worst:.1e}");
    }
}

fn wanted<'a>(count: usize, time: &'a Limit, near: &'a [Vec<[f64; 6]>]) -> modes::Wanted<'a> {
    modes::Wanted {
        count,
        accuracy: 1e-7,
        near,
        time,
    }
}

/// The list does not depend on the shapes from which the search goes, be they those of
/// other modes, or all the same one.
#[test]
fn where_the_search_begins_does_not_matter() {
    let veins = fig04(4);
    let state = rest(&veins, 8);
    let leaf = Leaf::new(&veins);
    let (grid, physics) = (discrete(&leaf, 8), Physics::new(&leaf));
    let time = Limit::default();
    let lowest = |count, near: &[Vec<[f64; 6]>]| {
        modes::lowest(&grid, &physics, &state, wanted(count, &time, near)).unwrap()
    };
    let many = lowest(12, &[]);
    let shapes: Vec<_> = many.iter().map(|pair| pair.shape.clone()).collect();
    let alike = vec![shapes[1].clone(); 4];
    for near in [&shapes[..4], &shapes[2..4], &shapes[8..], &alike] {
        for (found, plain) in lowest(4, near).iter().zip(&many) {
            let off = found.eigenvalue / plain.eigenvalue - 1.0;
            assert!(off.abs() < 1e-10, "{off:e}");
        }
    }
}

/// Lets the segments carry what their strains tell.
fn settle_forces(grid: &DiscreteLeaf, state: &mut State) {
    let n = grid.segments();
    for j in 0..grid.rods() {
        for i in 0..n {
            let section = *grid.section(j, i);
            let idle = grid.segment(state, j, i, glam::DVec3::ZERO);
            let strain = idle.v(&section) - section.rest_strain;
            state.n[j * n + i] = idle.frame * (strain / section.compliance);
        }
    }
}

/// Shapes are orthonormal with the masses, and satisfy the equations: in units of the roots of
/// the masses they are eigenvectors of the stiffness over the mass.
#[test]
fn shapes_are_orthonormal_and_satisfy_the_equations() {
    let veins = fig04(4);
    let state = rest(&veins, 8);
    let leaf = Leaf::new(&veins);
    let (grid, physics) = (discrete(&leaf, 8), Physics::new(&leaf));
    let mut exact = state.clone();
    settle_forces(&grid, &mut exact);
    let pairs = modes::lowest(&grid, &physics, &exact, wanted(8, &Limit::default(), &[])).unwrap();
    let linear = Linear::new(&grid, &physics, &exact);
    let matrix = linear.scaled(&(&linear.strains + &linear.coupling));
    let root_mass = linear.per_root_mass.clone().try_inverse().unwrap();
    let scaled = |pair: &modes::Eigenpair| &root_mass * linear.numbered(&pair.shape);
    let shapes: Vec<_> = pairs.iter().map(scaled).collect();
    for (a, (pair, first)) in pairs.iter().zip(&shapes).enumerate() {
        for (b, second) in shapes.iter().enumerate() {
            let wanted = f64::from(u8::from(a == b));
            close("product", first.dot(second), wanted, 1e-9);
        }
        let (carried, eigenvalue) = (&matrix * first, pair.eigenvalue);
        close("quotient", first.dot(&carried) / eigenvalue, 1.0, 1e-10);
        let off = (carried - eigenvalue * first).norm() / eigenvalue;
        assert!(off < 1e-5, "mode {a}: {off:.1e}");
    }
}

/// Leapfrog with steps of `h` vibrates at 2/h asin(omega h/2) where the
/// semi-discrete equations have the frequency omega: let go in the shape of a
/// mode, every number follows the cosine of that frequency.
fn assert_vibrates(name: &str, scenario: &Scenario, state: &State, wanted: &[usize]) {
    let leaf = Leaf::new(scenario);
    let grid = discrete(&leaf, state.segments());
    let linear = Linear::new(&grid, &Physics::new(&leaf), state);
    let modes = linear.modes();
    let fastest = modes.frequencies[modes.frequencies.len() - 1];
    for &mode in wanted {
        let omega = modes.frequencies[mode];
        let h = 1.5 / fastest;
        let start = linear.displaced(state, modes.modes.column(mode).into(), SIZE);
        let worst = off_cosine(&leaf, (state, &start), (omega, h), (SIZE, 100));
        assert!(worst < 1e-5, "{name}, mode {mode}: {worst:.1e}");
    }
}

/// Bent, twisted, coupled and joined, under a load.
fn pulled_veins() -> Scenario {
    let mut veins = three_veins();
    veins.dynamics.gravity = Schedule::constant([1.0, -2.0, -3.0]);
    veins
}

#[test]
fn a_beam_and_a_leaf_in_motion() {
    let beam = beam(0.0016, [1.0 / 0.0016, 1.0 / 0.00416]);
    let leaf = Leaf::new(&beam);
    assert_vibrates("beam", &beam, &released(&leaf, 12), &[0, 3, 20, 40]);
    let leaf = pulled_veins();
    assert_vibrates("leaf", &leaf, &rest(&leaf, 6), &[0, 5, 30, 60, 90]);
}
