use super::*;
use crate::leaf::{Grid, Leaf};
use crate::relax::initial_state;
use crate::relax::solve_on_grid::follower_loads::WithoutPotential;
use crate::scenario::Scenario;
use nalgebra::DMatrix;

/// All roots from the companion matrix of M^-1 (K - W) and M^-1 C, in which every unknown that is not held has mass: it shares
/// neither the inverse nor the eigenvalue solver with [`all_roots`].
fn reference_roots(
    leaf: &DiscreteLeaf,
    physics: &Physics,
    state: &State,
    forces: &dyn FollowerForces,
) -> Vec<c64> {
    let shift = leaf.neutral_shift();
    let (motion, _) = LinearizedMotion::new(leaf, physics, state, forces, shift).unwrap();
    let size = motion.solver.size();
    let matrix = |product: &dyn Fn(&[f64]) -> Vec<f64>| {
        let mut all = DMatrix::zeros(size, size);
        for c in 0..size {
            let mut unit = vec![0.0; size];
            unit[c] = 1.0;
            all.set_column(c, &nalgebra::DVector::from_vec(product(&unit)));
        }
        all
    };
    let masses = matrix(&|v| motion.masses.times(v));
    let damping = matrix(&|v| motion.damping(v));
    let stiffness = matrix(&|v| {
        let stiff = motion.vector(&motion.solver.product(&motion.system, &motion.field(v)));
        let without = motion.force_derivative(v);
        stiff.iter().zip(without).map(|(k, w)| k - w).collect()
    });
    // What supports hold has no mass.
    let moving: Vec<usize> = (0..size).filter(|at| masses[(*at, *at)] > 0.0).collect();
    let of_moving = |all: DMatrix<f64>| all.select_rows(&moving).select_columns(&moving);
    let [masses, damping, stiffness] = [masses, damping, stiffness].map(of_moving);
    let size = moving.len();
    let masses = masses.lu();
    let (stiffness, damping) = (
        masses.solve(&stiffness).unwrap(),
        masses.solve(&damping).unwrap(),
    );
    let mut companion = DMatrix::zeros(2 * size, 2 * size);
    companion
        .view_mut((0, size), (size, size))
        .fill_with_identity();
    companion
        .view_mut((size, 0), (size, size))
        .copy_from(&-stiffness);
    companion
        .view_mut((size, size), (size, size))
        .copy_from(&-damping);
    let roots = companion.complex_eigenvalues();
    roots.iter().map(|it| c64::new(it.re, it.im)).collect()
}

/// Under loads that turn with the sections without damping, with external and internal damping, and in wind the
/// dense matrix has the roots of the companion matrix.
#[test]
fn a_dense_matrix_has_all_roots() {
    let leaf = |more: &str, dynamics: &str| {
        format!(
            r#"
            name = "leaf"
            leaf = {{ rods = 2, length = [1.0, 0.9], fan = "symmetric" }}
            stiffness = {{ torsion = 0.8, bending_2 = 1.0, bending_3 = 1.4, axial = 60.0, shear_2 = 70.0, shear_3 = 50.0 }}
            coupling = {{ x = 1.0, y = 2.0, z = 1.5 }}
            dynamics = {{ density = 1.0, rotary_inertia = 0.01, rotary_inertia_3 = [0.03, 0.02], {dynamics} }}
            {more}"#
        )
    };
    let follows = "load = { follower = [-3.0, -0.4, 0.8], couple = [0.3, 0.5, -0.2] }";
    let blows = "wind = { velocity = [0.5, 0.8, 1.0], density = 1.2, drag = 2.0, width = 0.3 }";
    for (more, dynamics) in [
        (follows, "external_damping = 0.0"),
        (follows, "external_damping = 0.7"),
        (follows, "external_damping = 0.0, internal_damping = 0.01"),
        (blows, "external_damping = 0.2"),
    ] {
        let scenario = Scenario::from_toml(&leaf(more, dynamics)).unwrap();
        let leaf = DiscreteLeaf::new(&Leaf::new(&scenario), Grid::new(4, &[]));
        let state = initial_state(&leaf);
        let (physics, _) = Physics::for_small_motions(&leaf.leaf);
        let forces = WithoutPotential::in_motion(&leaf, &physics);
        let wanted = reference_roots(&leaf, &physics, &state, &forces);
        let found = all_roots(&leaf, &physics, &state, &forces).unwrap();
        let found: Vec<MotionRoot> = match found {
            MotionRoots::Squares(all) => all
                .iter()
                .map(|it| MotionRoot::from_square(it.value))
                .collect(),
            MotionRoots::Damped(roots) => roots,
        };
        let grows = |growth: f64, size: f64| growth > 1e-6 * size;
        let known = wanted.iter().filter(|it| grows(it.re, it.norm())).count();
        let counted = |it: &MotionRoot| match (grows(it.growth, it.size()), it.frequency > 0.0) {
            (true, true) if physics.damping == 0.0 && !leaf.leaf.in_wind() => {
                // Both conjugate squares are listed, each with the root that grows.
                1 + usize::from(physics.retardation > 0.0)
            }
            (true, true) => 2,
            (grows, _) => usize::from(grows),
        };
        assert_eq!(
            found.iter().map(counted).sum::<usize>(),
            known,
            "{more} {dynamics}"
        );
        for root in found.iter().take(60) {
            let apart =
                |it: &&c64| (it.re - root.growth).hypot(it.im.abs() - root.frequency) / root.size();
            let nearest = wanted
                .iter()
                .map(|it| apart(&it))
                .fold(f64::INFINITY, f64::min);
            assert!(nearest < 1e-6, "{more} {dynamics}: {root:?} {nearest:e}");
        }
    }
}
