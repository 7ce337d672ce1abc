//! Modes of one grid: their shapes are orthonormal and satisfy the equations, a leaf
//! vibrates so, but for the known dispersion of leapfrog, and where their search begins does
//! not matter.

use leafdyn::internals::motion::Physics;
use leafdyn_testing::motion::{beam, discrete, off_cosine, released, rest, three_veins};
use leafdyn_testing::vibration::{Linear, displaced, modes};
use leafdyn_testing::*;

/// Of a mode in whose shape a leaf is let go.
const SIZE: f64 = 1e-6;

/// Leapfrog with steps of `h` vibrates at 2/h asin(omega h/2) where the leaf has a mode of
/// frequency omega: let go in its shape, every number follows the cosine of that frequency. A
/// beam, and a leaf that is bent, twisted, coupled and joined, under a load.
#[test]
fn a_beam_and_a_leaf_let_go_in_a_mode_keep_its_frequency() {
    let beam = beam(0.0016, [1.0 / 0.0016, 1.0 / 0.00416]);
    let mut veins = three_veins();
    veins.dynamics.gravity = Schedule::constant([1.0, -2.0, -3.0]);
    veins.gravity = veins.dynamics.gravity.at(0.0);
    let straight = released(&Leaf::new(&beam), 12);
    for (scenario, state, wanted) in [
        (&beam, straight, &[0, 3, 20, 40][..]),
        (&veins, rest(&veins, 6), &[0, 1, 2, 3, 5, 30, 60, 90]),
    ] {
        let leaf = Leaf::new(scenario);
        let all = modes(&leaf, &state, 200, &[]);
        let frequency = |mode: usize| all[mode].eigenvalue.sqrt();
        let h = 1.5 / frequency(all.len() - 1);
        for &mode in wanted {
            let start = displaced(&state, &all[mode], SIZE);
            let worst = off_cosine(&leaf, (&state, &start), (frequency(mode), h), (SIZE, 100));
            assert!(worst < 1e-5, "{}, mode {mode}: {worst:.1e}", scenario.name);
        }
    }
}

/// The list does not depend on the shapes from which the search goes, be they those of
/// other modes, or all the same one.
#[test]
fn where_the_search_begins_does_not_matter() {
    let veins = fig04(4);
    let (leaf, state) = (Leaf::new(&veins), rest(&veins, 8));
    let many = modes(&leaf, &state, 12, &[]);
    let shapes: Vec<_> = many.iter().map(|pair| pair.shape.clone()).collect();
    let alike = vec![shapes[1].clone(); 4];
    for near in [&shapes[..4], &shapes[2..4], &shapes[8..], &alike] {
        for (found, plain) in modes(&leaf, &state, 4, near).iter().zip(&many) {
            let off = found.eigenvalue / plain.eigenvalue - 1.0;
            assert!(off.abs() < 1e-10, "{off:e}");
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
    let pairs = modes(&leaf, &state, 8, &[]);
    let linear = Linear::new(&grid, &physics, &state);
    let matrix = linear.scaled();
    let root_mass = linear.per_root_mass.clone().try_inverse().unwrap();
    let numbered = |shape: &[[f64; 6]]| linear.numbered(|j, i| shape[j * 9 + i]);
    let scaled = pairs.iter().map(|pair| &root_mass * numbered(&pair.shape));
    let shapes: Vec<_> = scaled.collect();
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
