//! Not-a-number in a solution, a state or a matrix: it is no small number, and has no sign.

use crate::leaf::system::IncrementSize;
use crate::leaf::*;
use crate::rod::Wrench;
use crate::scenario::Scenario;
use glam::{DMat3, DVec3};

const PAIR: &str = r#"
    name = "pair"
    leaf = { rods = 2, length = 1.0, fan = [-0.5, 0.4], joined = false }
    stiffness = { torsion = 1.0, bending_2 = 1.0, bending_3 = 1.0, axial = 100.0, shear_2 = 100.0, shear_3 = 100.0 }
    coupling = { y = 1.0 }
"#;

fn discretize_pair(segments: usize) -> (DiscreteLeaf, State) {
    let leaf = Leaf::new(&Scenario::from_toml(PAIR).unwrap());
    let leaf = DiscreteLeaf::new(&leaf, Grid::new(segments, &[]));
    let state = leaf.stress_free_state();
    (leaf, state)
}

#[test]
fn in_a_solution_it_is_the_largest() {
    let (leaf, _) = discretize_pair(4);
    let mut system = System::new(&leaf);
    let size = |rotation, displacement| IncrementSize {
        rotation,
        displacement,
    };
    for (c, found) in [(1, size(f64::INFINITY, 3.0)), (4, size(2.0, f64::INFINITY))] {
        let mut solution: NodalField = vec![vec![[2.0, 2.0, 2.0, 3.0, 3.0, 3.0]; 4]; 2];
        solution[1][2][c] = f64::NAN;
        system.set_solution(&solution);
        assert_eq!(system.largest_increment(), found);
    }
}

#[test]
fn in_a_state_it_is_no_balance_and_no_short_way() {
    let (leaf, mut state) = discretize_pair(4);
    assert!(leaf.residual(&state).is_finite());
    let before = state.clone();
    let middle = state.base(1) + 2;
    state.x[middle].y = f64::NAN;
    assert_eq!(leaf.residual(&state), f64::INFINITY);
    assert_eq!(before.largest_displacement_to(&state), f64::INFINITY);
    let sums = leaf.assemble(&state, &mut System::new(&leaf));
    assert!(sums.energy.is_nan());
    state.clone_from(&before);
    state.n[3].z = f64::NAN;
    assert_eq!(leaf.residual(&state), f64::INFINITY);
    assert_eq!(before.force_change(&state), f64::INFINITY);
    state.clone_from(&before);
    state.q[middle].x = f64::NAN;
    let sums = leaf.assemble(&state, &mut System::new(&leaf));
    assert_eq!(sums.largest_turn, f64::INFINITY);
}

#[test]
fn in_a_matrix_it_makes_pivots_without_sign() {
    let (leaf, state) = discretize_pair(4);
    let mut system = System::new(&leaf);
    leaf.assemble(&state, &mut system);
    let pattern = DirectSolver::new(&system).unwrap();
    assert_eq!(
        pattern
            .factorize(&system, 0.0)
            .unwrap()
            .negative_eigenvalue_count(),
        0
    );
    let stiffness = DiagonalBlocks {
        rotary: DMat3::ZERO,
        translational: f64::NAN,
    };
    system.add_to_node(1, 2, stiffness, Wrench::default());
    let failed = pattern.factorize(&system, 0.0).err();
    assert_eq!(failed, Some(DirectError::NotFinite));
}

/// One segment of unit stiffness in twist and bending, but for -1 about one axis, and a moment of
/// 2 along another: the matrix with the moment is singular.
#[test]
fn a_singular_matrix_under_a_dead_moment_is_not_solved() {
    let rod = PAIR
        .replace("rods = 2", "rods = 1")
        .replace("[-0.5, 0.4]", "[0.0]")
        .replace("coupling = { y = 1.0 }", "");
    let leaf = Leaf::new(&Scenario::from_toml(&rod).unwrap());
    let leaf = DiscreteLeaf::new(&leaf, Grid::new(1, &[]));
    let solved = |about_z: f64| {
        let mut system = System::new(&leaf);
        let less = DiagonalBlocks {
            rotary: DMat3::from_diagonal(DVec3::new(0.0, 0.0, about_z - 1.0)),
            translational: 0.0,
        };
        let load = Wrench {
            moment: DVec3::Y,
            force: DVec3::ZERO,
        };
        system.add_to_node(0, 1, less, load);
        let dead = NodalMoment {
            node: 0,
            moment: 2.0 * DVec3::X,
        };
        system.moments.replace_moments([dead].into_iter());
        assert!(system.factorize_indefinite());
        system.solve(None, 0.0)
    };
    assert_eq!(solved(1.0), LinearSolveOutcome::Converged(1));
    assert_eq!(solved(-1.0), LinearSolveOutcome::Singular);
}
