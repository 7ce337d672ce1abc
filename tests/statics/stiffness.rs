//! How stiff the veins are in stretch and shear, the solver does not feel, up
//! to rigid ones.

use leafdyn_testing::*;

const STIFFNESSES: [f64; 5] = [1e2, 1e4, 1e6, 1e8, f64::INFINITY];

#[test]
fn a_few_steps_on_the_first_grid_whose_work_is_pinned() {
    let mut work = Vec::new();
    for stiffness in STIFFNESSES {
        for rods in [5, 21] {
            let leaf = paper_leaf(rods, [1.0; 3], [stiffness; 3], 1.0);
            let leaf = settled(&leaf, &iterated(1e-6, 8));
            let steps = leaf.work.steps;
            // Of stiff leaves the path is walked.
            let most = if stiffness < 1e4 { 12 } else { 60 };
            assert!(steps <= most, "h = {stiffness}, N = {rods}: {steps} steps");
            if rods == 5 {
                work.push((steps, leaf.work.factorizations, leaf.work.cg_iterations));
            }
        }
    }
    // Steps, factorisations, iterations of the conjugate gradients.
    assert_eq!(work, PINNED);
}

/// A change for the better is welcome here; one for the worse is a slowdown.
const PINNED: [(usize, usize, usize); 5] = [
    (5, 6, 13),
    (28, 43, 52),
    (27, 40, 39),
    (27, 40, 36),
    (27, 40, 36),
];

/// Leaves that are ever stiffer approach the rigid one in proportion to 1/h.
#[test]
fn the_rigid_leaf_is_the_limit_of_stiff_ones() {
    let leaf = |stiffness: f64| paper_leaf(5, [1.0; 3], [stiffness; 3], 1.0);
    let at = |stiffness| tip(&settle(&leaf(stiffness), 1e-11));
    let rigid = at(f64::INFINITY);
    let apart = |stiffness| (at(stiffness) - rigid).length() * stiffness;
    let slope = apart(1e6);
    assert!(slope > 0.1, "{slope}");
    close("1e4", apart(1e4) / slope, 1.0, 0.02);
    close("1e5", apart(1e5) / slope, 1.0, 0.002);
}
