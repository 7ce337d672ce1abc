use super::*;
use crate::leaf::{Grid, Leaf};
use crate::modes::motion_pairs::{NodalMotion, lowest_shapes};
use crate::relax::initial_state;
use crate::relax::small_motions::LEAST_ROOTS;
use crate::relax::solve_on_grid::follower_loads::WithoutPotential;
use crate::relax::{MotionInstability, Options, RelaxedLeaf, relax_on_grids};
use crate::scenario::Scenario;
use leafdyn_testing::random::Draw;
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

/// The shapes of small motions satisfy the equations, with damping, in wind and where motions grow.
#[test]
fn shapes_satisfy_the_equations() {
    for text in [
        random_leaf(3, &["follower", "grows"]),
        random_leaf(4, &["follower", "external"]),
        random_leaf(5, &["follower", "couple", "internal"]),
        random_leaf(6, &["wind", "external"]),
    ] {
        let scenario = Scenario::from_toml(&text).unwrap();
        let leaf = DiscreteLeaf::new(&Leaf::new(&scenario), Grid::new(4, &[]));
        let state = initial_state(&leaf);
        let (physics, _) = Physics::for_small_motions(&leaf.leaf);
        let forces = WithoutPotential::in_motion(&leaf, &physics);
        let (motion, _) = LinearizedMotion::new(&leaf, &physics, &state, &forces, 0.0).unwrap();
        let limit = Limit::default();
        let found = lowest_shapes(&leaf, &physics, &state, &forces, 10, &limit).unwrap();
        assert!(found.len() >= 10, "{text}");
        for NodalMotion { root, shape } in &found {
            let mut vector = vec![c64::new(0.0, 0.0); motion.solver.size()];
            for (j, i) in leaf.rod_index_pairs(leaf.moving_nodes()) {
                let node = shape[state.base(j) + i];
                for (at, part) in motion.solver.unknowns(j, i).into_iter().zip(node) {
                    vector[at] = part;
                }
            }
            let lambda = c64::new(root.growth, root.frequency);
            let norm = |v: &[c64]| v.iter().map(|it| it.norm_sqr()).sum::<f64>().sqrt();
            let product = motion.polynomial(lambda, &vector);
            // Of the forces of inertia and damping, which are those of stiffness.
            let moving = lambda.norm() * norm(&product.slope);
            let left = norm(&product.value);
            assert!(
                left < 1e-5 * moving,
                "{text}\n{lambda}: {left:e} of {moving:e}"
            );
        }
    }
}

/// A list of random numbers between two bounds, as TOML writes it.
fn list(draw: &mut Draw, count: usize, low: f64, high: f64) -> String {
    format!("{:?}", draw.list(count, low, high))
}

/// A leaf of two to five veins, joined or with free tips, with these loads, supports and damping.
fn random_leaf(seed: u64, with: &[&str]) -> String {
    let mut draw = Draw(seed);
    let rods = 2 + (4.0 * draw.even()) as usize;
    let joined = draw.even() < 0.5;
    let (length, fan) = match joined {
        true => (list(&mut draw, rods, 0.9, 1.0), "\"symmetric\"".to_owned()),
        false => (
            list(&mut draw, rods, 0.6, 1.0),
            list(&mut draw, rods, -0.5, 0.5),
        ),
    };
    let mut text = format!(
        "name = \"leaf {seed}\"
         leaf = {{ rods = {rods}, length = {length}, fan = {fan}, joined = {joined} }}
         stiffness = {{ torsion = {}, bending_2 = {}, bending_3 = {}, axial = {}, shear_2 = {}, shear_3 = {} }}\n",
        list(&mut draw, rods, 0.5, 1.5),
        list(&mut draw, rods, 0.5, 1.5),
        list(&mut draw, rods, 0.7, 2.0),
        list(&mut draw, rods, 50.0, 90.0),
        list(&mut draw, rods, 50.0, 90.0),
        list(&mut draw, rods, 50.0, 90.0),
    );
    let has = |what: &str| with.contains(&what);
    let strength = if has("grows") { 12.0 } else { 1.0 };
    let mut load = format!("[load]\ngravity = {}\n", list(&mut draw, 3, -0.4, 0.4));
    if has("follower") {
        let [along, beside] = [(-1.0, 0.0), (-0.3, 0.3)].map(|(low, high)| {
            let of = draw.uniform(low, high);
            strength * of
        });
        load += &format!("follower = [{along:?}, {beside:?}, 0.2]\n");
    }
    if has("couple") {
        load += &format!(
            "couple = {}\ncouple_follows = {}\n",
            list(&mut draw, 3, -0.3, 0.3),
            draw.even() < 0.5
        );
    }
    let external = if has("external") {
        draw.uniform(0.1, 1.0)
    } else {
        0.0
    };
    let internal = if has("internal") {
        draw.uniform(0.002, 0.02)
    } else {
        0.0
    };
    text += &format!(
        "dynamics = {{ density = {}, rotary_inertia = {}, external_damping = {external:?}, internal_damping = {internal:?} }}\n",
        list(&mut draw, rods, 0.8, 1.4),
        list(&mut draw, rods, 0.005, 0.02),
    );
    if has("wind") {
        text += &format!(
            "wind = {{ velocity = {}, density = 1.2, drag = 1.5, width = 0.2 }}\n",
            list(&mut draw, 3, -2.0, 2.0)
        );
    }
    if has("foundation") {
        text += &format!(
            "foundation = {{ stiffness = {} }}\n",
            list(&mut draw, 3, 0.5, 8.0)
        );
    }
    text += &load;
    if has("point") {
        text += &format!(
            "[[load.point]]\nvein = 1\nat = 1.0\nforce = {}\nmoment = {}\nfollows = true\n",
            list(&mut draw, 3, -strength, strength),
            list(&mut draw, 3, -0.5, 0.5)
        );
    }
    if has("mass") {
        text += &format!(
            "[[load.point]]\nvein = {rods}\nat = 0.5\nmass = {:?}\n",
            draw.uniform(0.05, 0.5)
        );
    }
    text
}

/// The loads, supports and damping of a random leaf: some without a potential, others with.
fn random_traits(seed: u64) -> Vec<&'static str> {
    let mut draw = Draw(seed + 77);
    let without = ["follower", "couple", "point", "wind"];
    let first = (4.0 * draw.even()) as usize;
    let mut with = vec![without[first]];
    let others = without
        .into_iter()
        .chain(["foundation", "mass", "external", "internal", "grows"]);
    with.extend(others.filter(|_| draw.even() < 0.35));
    with
}

/// Random leaves of all kinds at rest on one grid: the roots that are told are the lowest of all of a dense matrix and
/// further ones that grow, and so are the number that grow, the verdict and the one that grows fastest.
#[test]
fn told_motions_of_random_leaves_are_those_of_a_dense_matrix() {
    let (mut compared, mut unstable, mut at_rest) = (0, 0, 0);
    for seed in 0..60 {
        let with = random_traits(seed);
        let text = random_leaf(seed, &with);
        let scenario = Scenario::from_toml(&text).unwrap();
        let options = Options {
            method: Options::default().method.on_grid(Some(4)),
            modes: LEAST_ROOTS,
            ..Options::default()
        };
        let relaxed = relax_on_grids(&scenario, &options, false, &mut |_| {}).unwrap();
        if !relaxed.result.outcome.is_at_rest() || scenario_has_potential(&relaxed) {
            continue;
        }
        at_rest += 1;
        let level = relaxed.on_grids.levels.last().unwrap();
        let (physics, _) = Physics::for_small_motions(&level.leaf.leaf);
        let forces = WithoutPotential::in_motion(&level.leaf, &physics);
        let what = format!("{seed} {with:?}");
        assert!(
            all_roots(&level.leaf, &physics, &level.state, &forces).is_some(),
            "no dense matrix: {what}"
        );
        let motions = relaxed
            .result
            .stability
            .small_motions
            .unwrap_or_else(|| panic!("{what}"));
        // The upper ones of conjugate pairs, the nearest to zero first.
        let rate = 1.0 / physics.time_unit;
        let mut roots = reference_roots(&level.leaf, &physics, &level.state, &forces);
        roots.iter_mut().for_each(|root| *root *= rate);
        roots.retain(|root| root.im >= -1e-9 * root.norm());
        roots.sort_by(|a, b| a.norm().total_cmp(&b.norm()));
        let growth = |root: &c64| root.re / root.norm();
        // Without damping a pair of roots that part from each other on the imaginary axis is within rounding of it.
        let doubtful = roots.iter().any(|root| {
            let least = if roots[0].norm() == root.norm() {
                1e-6
            } else {
                1e-3
            };
            (0.02 * least..1.2 * least).contains(&growth(root))
        });
        // Motions that grow are found among the slowest sixty.
        let far = roots.iter().skip(50).any(|root| growth(root) > 1e-5);
        if doubtful || far {
            continue;
        }
        compared += 1;
        let grows = |root: &&c64| growth(root) > 1e-5;
        let growing: Vec<&c64> = roots.iter().filter(grows).collect();
        let pairs: usize = growing
            .iter()
            .map(|it| 1 + usize::from(it.im > 1e-9 * it.norm()))
            .sum();
        assert_eq!(
            motions.unstable_roots,
            Some(pairs),
            "{what}: {motions:?} {growing:?}"
        );
        assert_eq!(motions.stable, Some(pairs == 0), "{what}");
        unstable += usize::from(pairs > 0);
        let of_states = with.contains(&"internal") || with.contains(&"wind");
        let half = 0.5 * physics.damping * rate;
        let told = motions.growth_rates.iter().zip(&motions.frequencies);
        for (k, (growth, frequency)) in told.enumerate() {
            let apart = |it: &c64| (it.re - growth).hypot(it.im - frequency) / it.norm();
            let nearest = roots.iter().map(apart).fold(f64::INFINITY, f64::min);
            assert!(nearest < 1e-5, "{what}: {growth} {frequency} {nearest:e}");
            let size = growth.hypot(*frequency);
            if k < LEAST_ROOTS {
                let lower = roots.iter().filter(|it| it.norm() < (1.0 - 1e-6) * size);
                // Of squares the root of two is told that grows faster.
                let lower = lower.filter(|it| of_states || it.re > -half - 1e-6 * it.norm());
                assert!(lower.count() <= k, "{what}: {k} {size} {roots:?}");
            }
        }
        let fastest = growing.iter().max_by(|a, b| a.re.total_cmp(&b.re));
        if let Some(fastest) = fastest {
            let dominant = motions.dominant.unwrap();
            let apart = (dominant.growth_rate - fastest.re).hypot(dominant.frequency - fastest.im);
            assert!(
                apart < 1e-5 * fastest.norm(),
                "{what}: {dominant:?} {fastest}"
            );
            let flutters = motions.instability == Some(MotionInstability::Flutter);
            assert_eq!(flutters, fastest.im > 1e-9 * fastest.norm(), "{what}");
        }
    }
    assert!(at_rest >= 40 && compared >= 30, "{at_rest} {compared}");
    assert!(
        unstable >= 3 && unstable + 3 <= compared,
        "{unstable} of {compared}"
    );
}

/// Whether there is nothing without a potential on a leaf at rest.
fn scenario_has_potential(relaxed: &RelaxedLeaf) -> bool {
    let level = relaxed.on_grids.levels.last();
    level.is_none_or(|level| level.leaf.leaf.has_potential())
}
