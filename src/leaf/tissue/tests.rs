use crate::leaf::discrete::DiscreteLeaf;
use crate::leaf::state::{Increment, State};
use crate::leaf::system::System;
use crate::leaf::tissue::cells::TissueForces;
use crate::leaf::{DirectSolver, Grid, Leaf};
use crate::numbers::largest;
use crate::rod::Wrench;
use crate::rotation;
use crate::scenario::Entries;
use glam::DVec3;

/// Veins of different sections, with tissue that contracts.
const LEAF: &str = r#"
    name = "leaf"
    leaf = { rods = 3, length = [0.9, 1.0, 1.1], fan = [-0.2, 0.0, 0.3], joined = false, base = [[0.0, -0.2, 0.0], [0.0, 0.0, 0.0], [0.0, 0.3, 0.1]] }
    stiffness = { torsion = 1.0, bending_2 = 0.7, bending_3 = 1.3, axial = 100.0, shear_2 = 50.0, shear_3 = 40.0 }
    rest = { bend_2 = 0.4, stretch = 1.1 }
    tissue = { along = 3.0, across = 20.0, normal = 5.0, fold = 0.3, contraction = [0.2, -0.1] }
"#;

/// Multiples of the golden ratio are equidistributed.
fn number(k: usize) -> f64 {
    (k as f64 * 0.618_033_988_749_895).fract() - 0.5
}

/// The leaf on a coarse grid, and a state far from rest.
fn strained() -> (DiscreteLeaf, State) {
    let scenario = Entries::from_text(LEAF, "leaf").unwrap().check().unwrap();
    let leaf = DiscreteLeaf::new(&Leaf::new(&scenario), Grid::new(2, &[]));
    let mut state = leaf.stress_free_state();
    for k in 0..state.x.len() {
        let vector = |first: usize| {
            DVec3::new(
                number(9 * k + first),
                number(9 * k + first + 1),
                number(9 * k + first + 2),
            )
        };
        state.x[k] += 0.2 * vector(0);
        state.q[k] = rotation::exp(0.6 * vector(3)) * state.q[k];
    }
    (leaf, state)
}

fn moved(state: &State, node: usize, c: usize, by: f64) -> State {
    let (mut state, change) = (state.clone(), by * DVec3::AXES[c % 3]);
    match c < 3 {
        true => state.q[node] = rotation::exp(change) * state.q[node],
        false => state.x[node] += change,
    }
    state
}

/// The derivative of a function of a number by central differences of order 4.
fn slope(f: impl Fn(f64) -> f64) -> f64 {
    let central = |h: f64| (f(h) - f(-h)) / (2.0 * h);
    (4.0 * central(1e-3) - central(2e-3)) / 3.0
}

/// Moments and forces on all nodes.
fn loads(leaf: &DiscreteLeaf, state: &State) -> Vec<f64> {
    let mut loads = vec![Wrench::default(); state.x.len()];
    leaf.add_tissue_loads(state, &mut loads);
    let vectors = loads.iter().flat_map(|it| [it.moment, it.force]);
    vectors.flat_map(|v| v.to_array()).collect()
}

#[test]
fn loads_are_the_derivatives_of_the_energy() {
    let (leaf, state) = strained();
    let found = loads(&leaf, &state);
    let energy = |state: &State| leaf.for_each_tissue_load(state, |_, _, _| {});
    for (k, found) in found.iter().enumerate() {
        let slope = slope(|h| energy(&moved(&state, k / 6, k % 6, h)));
        assert!((found + slope).abs() < 1e-8, "{k}: {found} {slope}");
    }
    let at_rest = loads(&leaf, &leaf.stress_free_state());
    assert!(at_rest.iter().all(|load| load.abs() < 1e-13));
    // One by one they are the same.
    for (j, i) in leaf.rod_index_pairs(0..leaf.segments() + 1) {
        let load = leaf.tissue_load(&state, j, i);
        let all = &found[6 * (state.base(j) + i)..];
        assert!(load.moment.distance(DVec3::from_slice(all)) < 1e-12);
        assert!(load.force.distance(DVec3::from_slice(&all[3..])) < 1e-12);
    }
}

/// In spatial increments the derivatives of moments are unsymmetric by half of their moment.
#[test]
fn second_derivatives_are_those_of_the_loads() {
    let (leaf, state) = strained();
    let count = 6 * state.x.len();
    let slopes: Vec<Vec<f64>> = (0..count)
        .map(|k| {
            let at = |h: f64| loads(&leaf, &moved(&state, k / 6, k % 6, h));
            let [a, b, c, d] = [1e-3, -1e-3, 2e-3, -2e-3].map(at);
            let central = |r: usize| (8.0 * (a[r] - b[r]) - (c[r] - d[r])) / 12e-3;
            (0..count).map(|r| -central(r)).collect()
        })
        .collect();
    let wanted = |r: usize, c: usize| 0.5 * (slopes[c][r] + slopes[r][c]);
    for r in 0..count {
        let mut shape = vec![[0.0; 6]; state.x.len()];
        for c in 0..=r {
            let at = |k: usize| (k / 6, k % 6);
            shape.iter_mut().for_each(|node| *node = [0.0; 6]);
            let ((a, b), (d, e)) = (at(r), at(c));
            let value =
                |shape: &[Increment]| leaf.tissue_curvature(&state, shape, TissueForces::Strained);
            if [a, d].iter().any(|node| node % 3 == 0) {
                continue;
            }
            shape[a][b] = 1.0;
            let own = value(&shape);
            let found = match r == c {
                true => own,
                false => {
                    shape[d][e] = 1.0;
                    let both = value(&shape);
                    shape[a][b] = 0.0;
                    0.5 * (both - own - value(&shape))
                }
            };
            assert!(
                (found - wanted(r, c)).abs() < 1e-7,
                "{r} {c}: {found} {}",
                wanted(r, c)
            );
        }
    }
}

/// The matrix and the forces that are assembled, of segments and tissue that carry the forces of
/// their strains.
#[test]
fn the_assembled_matrix_has_the_derivatives_of_the_forces() {
    let (leaf, mut state) = strained();
    let mut system = System::new(&leaf);
    let mut balanced = |mut state: State| {
        leaf.strain_forces(&mut state);
        leaf.assemble_forces(&state, &mut system);
        system.rhs()
    };
    leaf.strain_forces(&mut state);
    let mut whole = System::new(&leaf);
    leaf.assemble(&state, &mut whole);
    let solver = DirectSolver::new(&whole).unwrap();
    let count = leaf.segments();
    for (j, i) in leaf.rod_index_pairs(1..count + 1) {
        for c in 0..6 {
            let mut shape = vec![vec![[0.0; 6]; count]; leaf.rods()];
            shape[j][i - 1][c] = 1.0;
            let found = solver.product(&whole, &shape);
            let h = 1e-4;
            let [a, b] = [h, -h].map(|h| balanced(moved(&state, state.base(j) + i, c, h)));
            // Forces: those of moments are unsymmetric.
            for ((r, k), d) in leaf
                .rod_index_pairs(0..count)
                .flat_map(|at| [(at, 3), (at, 4), (at, 5)])
            {
                let slope = -(a[r][k][d] - b[r][k][d]) / (2.0 * h);
                let off = (found[r][k][d] - slope).abs();
                assert!(
                    off < 1e-5,
                    "{j} {i} {c}: {r} {k} {d}: {} {slope}",
                    found[r][k][d]
                );
            }
        }
    }
}

/// After a step that is small the tissue carries the forces of its strains, up to the square of the step.
#[test]
fn carried_forces_follow_the_strains() {
    let (leaf, mut state) = strained();
    leaf.set_tissue_forces(&mut state);
    let mut system = System::new(&leaf);
    let mut shape = vec![vec![[0.0; 6]; leaf.segments()]; leaf.rods()];
    for (k, value) in shape.iter_mut().flatten().flatten().enumerate() {
        *value = number(k);
    }
    system.set_solution(&shape);
    let missed = |step: f64| {
        let mut next = state.clone();
        leaf.advance(&state, &system, step, &mut next);
        let mut strained = next.clone();
        leaf.set_tissue_forces(&mut strained);
        let pairs = next.tissue.iter().zip(&strained.tissue);
        // Where there is no strip both have the force of the next.
        let present = pairs
            .zip(&leaf.strips)
            .filter(|(_, strip)| strip.has_stiffness());
        largest(present.map(|((a, b), _)| a.distance(*b)))
    };
    let [short, long] = [1e-4, 2e-4].map(missed);
    assert!(
        long < 1e-4 && (long / short - 4.0).abs() < 0.1,
        "{short} {long}"
    );
}
