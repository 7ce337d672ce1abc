//! Dead forces off the axis: closed forms, the balance of moments, derivatives, bars, and what comes to the same.

use glam::DQuat;
use leafdyn::internals::leaf::{DiscreteLeaf, Grid};
use leafdyn::internals::rotation;
use leafdyn_testing::random::{Draw, add_loads_off_axis, drawn, leaves};
use leafdyn_testing::*;
use nalgebra::SVector;
use num_dual::{DualNum, hessian};

/// A rod along e1 of torsion 0.7 that hardly bends, with a force down off the axis at a fraction of its length.
fn arm(at: f64, force: f64, offset: [f64; 2]) -> Scenario {
    parse(&format!(
        r#"
        name = "arm"
        leaf = {{ rods = 1, length = 1.3, fan = [0.0] }}
        stiffness = {{ torsion = 0.7, bending_2 = 1e8, bending_3 = 1e8, axial = inf, shear_2 = inf, shear_3 = inf }}
        load.point = [{{ vein = 1, at = {at:?}, force = [0.0, 0.0, {:?}], offset = {offset:?} }}]
        "#,
        -force
    ))
}

/// The twist p of a rod of the torsion C by a weight F at the offset o beside it: C p/l = F o cos p, a pendulum on a
/// torsion spring that begins at the angle b below the level.
fn pendulum(per_length: f64, lever: f64, begin: f64) -> f64 {
    let (mut low, mut high) = (0.0, 0.5 * PI - begin);
    for _ in 0..200 {
        let middle = 0.5 * (low + high);
        match per_length * middle < lever * (middle + begin).cos() {
            true => low = middle,
            false => high = middle,
        }
    }
    low
}

#[test]
fn a_weight_beside_a_rod_twists_it() {
    for (at, force, offset) in [
        (1.0_f64, 2.0_f64, [0.3_f64, 0.0_f64]),
        (1.0, 20.0, [0.3, 0.0]),
        (0.6, 9.0, [0.2, 0.0]),
        (0.6, 9.0, [0.2, -0.1]),
    ] {
        let leaf = settle(&arm(at, force, offset), 1e-10);
        let lever = force * offset[0].hypot(offset[1]);
        let begin = (-offset[1]).atan2(offset[0]);
        let twist = pendulum(0.7 / (1.3 * at), lever, begin);
        assert!(twist > 0.05, "{twist}");
        // The sections beyond the weight turn with the one at it.
        let nodes = leaf.shape.stations.iter().zip(&leaf.shape.rods[0].nodes);
        for (_, node) in nodes.filter(|(sigma, _)| **sigma > at - 1e-12) {
            let found = rotation::log(node.rotation);
            close("twist", found.x, -twist, 1e-7);
        }
        assert_eq!(leaf.stability.negative_eigenvalues, Some(0));
        let moment = leaf.base_reaction.unwrap().moment.unwrap();
        close("moment", moment.x, -0.7 / (1.3 * at) * twist, 1e-7);
        let twisted = 0.5 * 0.7 / (1.3 * at) * twist * twist - lever * (twist + begin).sin();
        // The rod bends a little, too.
        let bent = -(force * force) * (1.3 * at).powi(3) / 6e8;
        close("energy", leaf.energy.unwrap(), twisted + bent, 1e-8);
    }
}

/// Small loads: the tip of a cantilever goes down by F L^3/(3 EI), and twists by F o L/GJ.
#[test]
fn small_loads_bend_and_twist() {
    let scenario = parse(
        r#"
        name = "cantilever"
        leaf = { rods = 1, length = 1.3, fan = [0.0] }
        stiffness = { torsion = 0.7, bending_2 = 1.0, bending_3 = 2.0, axial = inf, shear_2 = inf, shear_3 = inf }
        load.point = [{ vein = 1, at = 1.0, force = [0.0, 0.0, -1e-5], offset = [0.3, 0.0] }]
        "#,
    );
    let leaf = settle(&scenario, 1e-12);
    close(
        "deflection",
        tip(&leaf).z / -1e-5,
        1.3_f64.powi(3) / 3.0,
        1e-6,
    );
    let turned = rotation::log(leaf.shape.rods[0].nodes.last().unwrap().rotation);
    close("twist", turned.x / -1e-5, 0.3 * 1.3 / 0.7, 1e-6);
}

/// A force off the axis is one on it with the moment of its lever, as long as the section does not turn: on a rod, and
/// on one that grips hold, which slides and gives.
#[test]
fn a_force_off_the_axis_has_the_moment_of_its_lever() {
    for grips in [
        "",
        "grip = [{ vein = 1, at = 0.8, stiffness = [0.0, inf, 4.0], move = [0.0, 0.02, 0.03] }]",
    ] {
        let rod = |points: &str| {
            parse(&format!(
                r#"
                name = "rod"
                leaf = {{ rods = 1, length = 1.0, fan = [0.3] }}
                rest = {{ bend_2 = 0.5, twist = 0.4, bend_3 = -0.3 }}
                stiffness = {{ torsion = 0.7, bending_2 = 1.0, bending_3 = 1.4, axial = 40.0, shear_2 = 50.0, shear_3 = 60.0 }}
                load.gravity = [0.2, 0.1, -0.9]
                load.point = [{points}]
                {grips}
                "#
            ))
        };
        let (force, offset) = (DVec3::new(0.4, -0.3, -0.8), [0.2, -0.15]);
        let own = force.to_array();
        let beside = rod(&format!(
            "{{ vein = 1, at = 0.6, force = {own:?}, offset = {offset:?} }}"
        ));
        let beside = settle(&beside, 1e-10);
        let after = |sigma: &f64| *sigma > 0.6 - 1e-12;
        let k = beside.shape.stations.iter().position(after).unwrap();
        let q = beside.shape.rods[0].nodes[k].rotation;
        let moment = (q * DVec3::new(0.0, offset[0], offset[1])).cross(force);
        let moment = moment.to_array();
        let other = rod(&format!(
            "{{ vein = 1, at = 0.6, force = {own:?}, moment = {moment:?} }}"
        ));
        let other = settle(&other, 1e-10);
        let off = tip(&beside).distance(tip(&other));
        let bar = estimate(&beside) + estimate(&other);
        assert!(off <= 1e-8 + bar, "{off:e}, {bar:e}");
    }
}

/// Of a load that follows, force and lever turn together: it is the force on the axis with the moment o x f along the
/// directors.
#[test]
fn a_force_that_follows_has_the_moment_of_its_lever_in_its_section() {
    let leaf = |load: &str| {
        parse(&format!(
            r#"
            name = "leaf"
            leaf = {{ rods = 2, length = 1.0, fan = "symmetric" }}
            stiffness = {{ torsion = 0.7, bending_2 = 1.0, bending_3 = 1.4, axial = 40.0, shear_2 = 50.0, shear_3 = 60.0 }}
            load.gravity = [0.2, 0.1, -0.9]
            load.point = [{{ vein = 2, at = 0.5, follows = true, {load} }}]
            "#
        ))
    };
    let (force, offset) = (DVec3::new(0.5, -0.25, -0.75), DVec3::new(0.0, 0.25, -0.125));
    let moment = DVec3::new(0.25, -0.5, 0.125);
    let [f, m, sum] = [force, moment, moment + offset.cross(force)].map(|it| it.to_array());
    let beside = leaf(&format!(
        "force = {f:?}, moment = {m:?}, offset = [0.25, -0.125]"
    ));
    let on_axis = leaf(&format!("force = {f:?}, moment = {sum:?}"));
    let [beside, on_axis] = [beside, on_axis].map(|it| settle(&it, 1e-8));
    let off = distance(&beside, &on_axis);
    assert!(off < 1e-12, "{off:e}");
}

/// What the bases feel balances forces at r + R o: bundles that meet in a tip and veins apart, under forces on points
/// alone. (A coupling that differs along the axes would exert a moment of its own.)
#[test]
fn bases_balance_forces_off_the_axes() {
    let mut draw = Draw(5);
    for joined in [true, false] {
        for _ in 0..6 {
            let mut points = Vec::new();
            for _ in 0..4 {
                points.push(format!(
                    "{{ vein = {}, at = {:?}, force = {:?}, offset = {:?} }}",
                    1 + (draw.even() * 3.0) as usize,
                    [0.3, 0.5, 0.8, 1.0][(draw.even() * 4.0) as usize],
                    draw.list(3, -0.5, 0.5),
                    draw.list(2, -0.2, 0.2),
                ));
            }
            let scenario = parse(&format!(
                r#"
                name = "bundle"
                leaf = {{ rods = 3, length = [1.0, 0.95, 1.05], fan = "symmetric", joined = {joined} }}
                rest = {{ bend_2 = 0.3, twist = 0.4 }}
                stiffness = {{ torsion = 0.7, bending_2 = 1.0, bending_3 = 1.4, axial = 40.0, shear_2 = 50.0, shear_3 = 60.0 }}
                coupling = {{ x = 1.5, y = 1.5, z = 1.5 }}
                load.point = [{}]
                "#,
                points.join(", ")
            ));
            let leaf = settle(&scenario, 1e-9);
            let (mut force, mut moment) = (DVec3::ZERO, DVec3::ZERO);
            for point in &scenario.points {
                let there = |sigma: &f64| (sigma - point.at).abs() < 1e-12;
                let k = leaf.shape.stations.iter().position(there).unwrap();
                let node = &leaf.shape.rods[point.vein].nodes[k];
                let own = DVec3::from_array(point.force);
                force += own;
                moment += (node.position + node.rotation * point.arm()).cross(own);
            }
            let base = leaf.base_reaction.unwrap();
            let [off_force, off_moment] = [
                base.force.distance(force),
                base.moment.unwrap().distance(moment),
            ];
            assert!(off_force <= base.error.unwrap() + 1e-12, "{off_force:e}");
            let bar = base.moment_error.unwrap();
            assert!(
                off_moment <= bar + 1e-8 && bar < 1e-5,
                "{off_moment:e}, {bar:e}"
            );
        }
    }
}

type Quaternion<D> = [D; 4]; // w, x, y, z

/// The energy -F . (exp(t) q o) to second order in t.
fn lever_energy<D: DualNum<Primitive = f64> + Copy>(
    t: SVector<D, 3>,
    q: DQuat,
    offset: DVec3,
    force: DVec3,
) -> D {
    let a = q * offset;
    let square = t[0] * t[0] + t[1] * t[1] + t[2] * t[2];
    let one = square * 0.0 + 1.0;
    let p: Quaternion<D> = [one - square / 8.0, t[0] * 0.5, t[1] * 0.5, t[2] * 0.5];
    let multiply = |a: Quaternion<D>, b: Quaternion<D>| -> Quaternion<D> {
        [
            a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3],
            a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2],
            a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1],
            a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0],
        ]
    };
    let zero = one * 0.0;
    let turned = multiply(
        multiply(p, [zero, one * a.x, one * a.y, one * a.z]),
        [p[0], -p[1], -p[2], -p[3]],
    );
    -(turned[1] * force.x + turned[2] * force.y + turned[3] * force.z)
}

/// Moment and second derivatives are those of automatic differentiation, on a grid with the factors of loads.
#[test]
fn levers_match_automatic_differentiation() {
    let mut draw = Draw(9);
    for _ in 0..20 {
        let mut number = || draw.uniform(-1.0, 1.0);
        let mut vector = || DVec3::new(number(), number(), number());
        let (force, offset, turn) = (vector(), vector(), 3.0 * vector());
        let mut scenario = arm(1.0, 1.0, [offset.y, offset.z]);
        scenario.points[0].force = force.to_array();
        let leaf = Leaf::new(&scenario);
        let mut grid = DiscreteLeaf::new(&leaf, Grid::new(2, leaf.kinks()));
        grid.load_factor = 0.7;
        let mut state = grid.stress_free_state();
        state.q[2] = rotation::exp(turn);
        let scale = leaf.scale;
        let offset = DVec3::new(0.0, offset.y, offset.z) / scale.length;
        let force = 0.7 * force / scale.force();
        let (value, gradient, hessian) = hessian(
            |t: SVector<_, 3>| lever_energy(t, state.q[2], offset, force),
            &SVector::<f64, 3>::zeros(),
        );
        let load = grid.load(&state, 0, 2);
        close(
            "energy",
            load.energy + load.force.dot(state.x[2]),
            value,
            1e-13,
        );
        for c in 0..3 {
            close("moment", -load.moment[c], gradient[c], 1e-13);
            for r in 0..3 {
                let mut shape = vec![[0.0; 6]; 3];
                let curvature = |shape: &mut Vec<[f64; 6]>, one: [f64; 2]| {
                    shape[2] = [0.0; 6];
                    shape[2][r] += one[0];
                    shape[2][c] += one[1];
                    grid.lever_curvature(&state, shape)
                };
                let sum = curvature(&mut shape, [1.0, 1.0]);
                let difference = curvature(&mut shape, [1.0, -1.0]);
                close(
                    "curvature",
                    0.25 * (sum - difference),
                    hessian[(r, c)],
                    1e-13,
                );
            }
        }
    }
}

/// Random leaves with forces and weights off the axes: bars cover the errors, by leaves at rest to many more digits.
#[test]
fn bars_cover_the_errors_of_random_leaves() {
    let mut draw = Draw(3);
    let mut checked = 0;
    for (case, mut scenario) in drawn(leaves(), 24).into_iter().enumerate() {
        add_loads_off_axis(&mut draw, &mut scenario, false);
        let fine = relaxed(&scenario, &to(1e-11));
        let rough = relaxed(&scenario, &to(1e-5));
        if !fine.outcome.is_success() || !rough.outcome.is_success() {
            continue;
        }
        let off = distance(&fine, &rough);
        if off > 0.05 {
            println!("{case}: another equilibrium");
            continue;
        }
        checked += 1;
        let told = estimate(&rough) + estimate(&fine);
        assert!(off <= told, "{case}: {off:e}, told {told:e}");
    }
    assert!(checked >= 16, "{checked}");
}
