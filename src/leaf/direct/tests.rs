//! Factors vein after vein against those of the sparse factorization, which pivots by blocks.

use crate::leaf::direct::*;
use crate::leaf::{DiscreteLeaf, Grid, Leaf, State};
use crate::scenario::Scenario;
use glam::{DQuat, DVec3};

const LEAF: &str = r#"
    name = "leaf"
    leaf = { rods = 5, length = [0.9, 1.0, 1.1, 1.0, 0.9], fan = "symmetric" }
    stiffness = { torsion = 0.8, bending_2 = 1.0, bending_3 = 2.0, axial = 1e4, shear_2 = 1e3, shear_3 = 2e3 }
    rest = { bend_2 = 0.6, twist = [0.1, 0.2, 0.3, 0.4, 0.5] }
    coupling = { y = 20.0, z = 5.0 }
    load = { gravity = [0.1, 0.2, -3.0] }
"#;

/// The leaf with some entries replaced, in the state it starts in, its nodes displaced by a few
/// hundredths, so that segments carry forces of both signs.
fn assembled_system(segments: usize, entries: &[&str]) -> System {
    let entries: Vec<String> = entries.iter().map(|&entry| entry.into()).collect();
    let leaf = Leaf::new(&Scenario::from_toml_with(LEAF, "leaf", &entries).unwrap());
    let leaf = DiscreteLeaf::new(&leaf, Grid::new(segments, &[]));
    let mut state = match leaf.leaf.joined() {
        true => arcs_to_one_tip(&leaf),
        false => leaf.stress_free_state(),
    };
    for j in 0..state.rods() {
        let base = state.base(j);
        let last = segments - usize::from(leaf.leaf.joined() || leaf.leaf.tip_support.is_some());
        for i in 1..=last {
            let wave = 0.01 * (3.0 * (i + 2 * j) as f64).sin();
            state.x[base + i] += wave * DVec3::new(0.2, 1.0, -0.7);
        }
    }
    let mut system = System::new(&leaf);
    leaf.assemble(&state, &mut system);
    system
}

/// Circular arcs that leave the bases in the directions of the fan and end on the axis e1, stretched to
/// the same chord.
fn arcs_to_one_tip(leaf: &DiscreteLeaf) -> State {
    let rods = &leaf.leaf.scenario().rods;
    let arc = |j: usize, sigma: f64| {
        let (sin, cos) = (rods[j].angle * (1.0 - sigma)).sin_cos();
        let turn = rods[j].angle * sigma;
        let sinc = if turn == 0.0 { 1.0 } else { turn.sin() / turn };
        leaf.leaf.length(j) * sigma * sinc * DVec3::new(cos, sin, 0.0)
    };
    let tip = (0..rods.len()).map(|j| arc(j, 1.0)).sum::<DVec3>() / rods.len() as f64;
    let (mut x, mut q) = (Vec::new(), Vec::new());
    for (j, rod) in rods.iter().enumerate() {
        for &sigma in leaf.grid.sigma() {
            x.push(arc(j, sigma) + sigma * (tip - arc(j, 1.0)));
            q.push(DQuat::from_rotation_z(rod.angle * (1.0 - 2.0 * sigma)));
        }
    }
    let mut state = State::new(leaf.segments(), x, q);
    state.join_tips();
    state
}

/// A vector without symmetry.
fn load(size: usize) -> Vec<f64> {
    (0..size)
        .map(|k| ((k * 7919) % 101) as f64 - 50.0)
        .collect()
}

#[test]
fn veins_one_by_one_have_the_solutions_and_signs_of_the_sparse_factors() {
    let mut condensed_ones = 0;
    let leaves: [&[&str]; 6] = [
        &[],
        &["leaf.joined=false"],
        &[
            "leaf.rods=2",
            "leaf.length=1.0",
            "rest.twist=0.3",
            "leaf.fan=[-0.3, 0.5]",
        ],
        &["coupling.x=3.0", "coupling.y=0.0", "coupling.z=0.0"],
        &[
            "coupling.x=[1, 0, 2, 3]",
            "coupling.y=[0, 4, 5, 6]",
            "coupling.z=1e4",
        ],
        &["stiffness.axial=1e7", "load.tip_force=[-40, 3, 2]"],
    ];
    for entries in leaves {
        for segments in [1, 2, 8, 15, 32] {
            let system = assembled_system(segments, entries);
            let condensed = DirectSolver::for_coupling_pattern(&system).unwrap();
            for shift in [0.0, 5.0, -10.0, -300.0, -4e3] {
                let what = format!("{entries:?}, {segments} segments, shift {shift}");
                let mut here = condensed.factorize(&system, shift).unwrap();
                condensed_ones += usize::from(matches!(here.kind, FactorizationKind::Condensed(_)));
                let mut there = condensed.factorize_sparse(&system, shift).unwrap();
                assert_eq!(
                    here.negative_eigenvalue_count(),
                    there.negative_eigenvalue_count(),
                    "{what}"
                );
                let count = condensed.count_negative(&system, shift);
                assert_eq!(count, Ok(there.negative_eigenvalue_count()), "{what}");
                let mut solutions = [load(condensed.size()), load(condensed.size())];
                here.solve_vector(&mut solutions[0]);
                there.solve_vector(&mut solutions[1]);
                let [a, b] = &solutions;
                let most = b.iter().fold(0.0_f64, |most, value| most.max(value.abs()));
                for (a, b) in a.iter().zip(b) {
                    assert!((a - b).abs() < 1e-7 * most, "{what}: {a} for {b}");
                }
            }
        }
    }
    // Elsewhere a pivot is too small.
    assert!(condensed_ones > 135, "{condensed_ones} of 150");
}

/// Where a pivot is too small for what it divides, the sparse factorization takes over.
#[test]
fn small_pivots_are_left_to_the_sparse_factorization() {
    let system = assembled_system(8, &[]);
    let solver = DirectSolver::for_coupling_pattern(&system).unwrap();
    // The shift at which the first pivot vanishes: at a rotation about an axis of its own.
    let group = &system.groups[0].matrix;
    let own = group.node_blocks(0, 0).own;
    let turns = nalgebra::Matrix3::from_fn(|r, c| own[r.min(c)][r.max(c)]);
    let shift = -turns.symmetric_eigenvalues()[1] / system.mass(0, 0).rotary;
    assert!(CondensedFactors::new(&system, shift).is_none());
    let there = solver
        .factorize_sparse(&system, shift)
        .unwrap()
        .negative_eigenvalue_count();
    assert_eq!(
        solver
            .factorize(&system, shift)
            .unwrap()
            .negative_eigenvalue_count(),
        there
    );
    assert_eq!(solver.count_negative(&system, shift), Ok(there));
}

/// Axes along which veins are not coupled separate them: on finer grids, where the factors are
/// sparse ones, these stay small.
#[test]
fn sparse_factors_are_as_small_as_the_coupling_allows() {
    let system = assembled_system(64, &[]);
    let fill = |solver: DirectSolver| solver.symbolic(&system).unwrap().factor_entry_count();
    let any = fill(DirectSolver::new(&system).unwrap());
    let own = fill(DirectSolver::for_coupling_pattern(&system).unwrap());
    assert!(own <= any * 9 / 10, "{own} for {any}");
}

/// The shifts at which the count of negative eigenvalues changes, which are eigenvalues, are those of
/// the sparse factorization to rounding, also of leaves that are far from definite there.
#[test]
fn counts_change_at_the_eigenvalues() {
    let leaves: [&[&str]; 3] = [
        &[],
        &[
            "leaf.joined=false",
            "stiffness.axial=1e5",
            "stiffness.shear_2=3e4",
        ],
        &[
            "stiffness.axial=1e6",
            "stiffness.shear_2=1e6",
            "stiffness.shear_3=1e6",
            "coupling.z=300",
        ],
    ];
    for entries in leaves {
        let system = assembled_system(12, entries);
        let solver = DirectSolver::for_coupling_pattern(&system).unwrap();
        for number in [1, 5, 12, 40] {
            let found = [true, false].map(|condensed| {
                let mut between = [-1e6, 1e6];
                for _ in 0..100 {
                    let middle = 0.5 * (between[0] + between[1]);
                    let count = match condensed {
                        true => solver.count_negative(&system, middle).unwrap(),
                        false => solver
                            .factorize_sparse(&system, middle)
                            .unwrap()
                            .negative_eigenvalue_count(),
                    };
                    let enough = count >= number;
                    between[usize::from(!enough)] = middle;
                }
                between[0]
            });
            let apart = (found[0] - found[1]).abs();
            assert!(apart < 1e-9 * 1e6, "{entries:?}, {number}: {found:?}");
        }
    }
}

/// Factors in memory that others left behind are those in new memory, and all equations of a leaf have one pattern.
#[test]
fn memory_of_factors_is_taken_by_the_next_and_patterns_are_shared() {
    let system = assembled_system(MAX_CONDENSED_SEGMENTS + 8, &[]);
    let solver = DirectSolver::new(&system).unwrap();
    let solve = || {
        let mut factors = solver.factorize(&system, 0.0).unwrap();
        let mut b = load(solver.size());
        factors.solve_vector(&mut b);
        b
    };
    let spare = &solver.symbolic(&system).unwrap().spare;
    let count = solver.symbolic(&system).unwrap().factor_entry_count();
    let first = solve();
    let kept = spare.take(count);
    assert!(
        kept.iter().any(|value| value.abs() > 0.0),
        "that of the first factors"
    );
    spare.keep(vec![f64::NAN; count]);
    assert_eq!(first, solve(), "what was left behind does not count");
    let other = DirectSolver::new(&system.clone()).unwrap();
    assert!(Arc::ptr_eq(&solver.pattern, &other.pattern));
    let bordered = DirectSolver::with_border(&system, 1).unwrap();
    assert!(!Arc::ptr_eq(&solver.pattern, &bordered.pattern));
    // Tips are not coupled along x: indices are counted with fewer coupled unknowns.
    let counted = [0; 2].map(|_| DirectSolver::for_coupling_pattern(&system).unwrap());
    assert!(Arc::ptr_eq(&counted[0].pattern, &counted[1].pattern));
    assert!(!Arc::ptr_eq(&counted[0].pattern, &solver.pattern));
}
