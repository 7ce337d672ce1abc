//! Loads of single veins and points, and weights of their masses.

use leafdyn_testing::*;

const ROD: &str = r#"
    name = "rod"
    leaf = { rods = 1, length = 1.0, fan = [0.0] }
    stiffness = { torsion = 0.8, bending_2 = 1.0, bending_3 = 1.4, axial = inf, shear_2 = inf, shear_3 = inf }
"#;

/// A force in the middle bends the half before it as one at the tip of a vein of half the length;
/// the other half stays straight.
#[test]
fn a_force_in_the_middle_bends_the_half_before_it_alone() {
    let force = "force = [0.3, 1.0, -4.0]";
    let loaded = format!("{ROD}\n[[load.point]]\nvein = 1\nat = 0.5\n{force}");
    let whole = settle(&parse(&loaded), 1e-11);
    let half = ROD.replace("length = 1.0", "length = 0.5");
    let half = format!("{half}\nload.tip_{force}");
    let half = settle(&parse(&half), 1e-11);
    let end = half.shape.rods[0].nodes.last().unwrap();
    let tip = end.position + 0.5 * (end.rotation * DVec3::X);
    assert!(whole.tips[0].distance(tip) < 1e-10);
    // The force is that just before the point.
    let shape = &whole.shape;
    let middle = shape
        .stations
        .iter()
        .position(|sigma| *sigma == 0.5)
        .unwrap();
    let (force, _) = in_lab(&shape.rods[0].nodes[middle]);
    assert!(force.distance(DVec3::new(0.3, 1.0, -4.0)) < 1e-8, "{force}");
}

/// The weight of a mass, a list of weights, and a load along the vein are the same load.
#[test]
fn the_same_weight_may_be_stated_in_four_ways() {
    let ways = [
        "load.gravity = [0.2, 0.0, -3.0]",
        "load.gravity = [[0.2, 0.0, -3.0]]",
        "load.g = [0.4, 0.0, -6.0]\ndynamics.density = 0.5",
        "load.distributed = { at = [0.0, 1.0], value = [[0.2, 0.0, -3.0], [0.2, 0.0, -3.0]] }",
    ];
    let leaves = ways.map(|way| settle(&parse(&format!("{ROD}\n{way}")), 1e-10));
    for leaf in &leaves[1..] {
        let bars = [leaf, &leaves[0]].map(|it| it.accuracy.error_estimate.unwrap());
        assert!(distance(leaf, &leaves[0]) <= bars[0] + bars[1]);
        close(
            "energy",
            leaf.energy.unwrap(),
            leaves[0].energy.unwrap(),
            1e-9,
        );
        assert_eq!(leaf.stable(), Some(true));
    }
}

/// Veins that nothing ties together rest as each would alone.
#[test]
fn each_vein_has_its_own_weight() {
    let both = r#"
        name = "both"
        leaf = { rods = 2, length = 1.0, fan = [0.0, 0.0], joined = false, base = [[0.0, 0.0, 0.0], [0.1, 2.0, 0.3]] }
        stiffness = { torsion = 0.8, bending_2 = 1.0, bending_3 = 1.4, axial = inf, shear_2 = inf, shear_3 = inf }
        load.gravity = [[0.0, 0.0, -2.0], [0.0, 1.0, 0.5]]
    "#;
    let both = settle(&parse(both), 1e-10);
    for (vein, weight, base) in [
        (0, "[0.0, 0.0, -2.0]", DVec3::ZERO),
        (1, "[0.0, 1.0, 0.5]", DVec3::new(0.1, 2.0, 0.3)),
    ] {
        let alone = settle(&parse(&format!("{ROD}\nload.gravity = {weight}")), 1e-10);
        assert!(both.tips[vein].distance(alone.tips[0] + base) < 3e-10);
    }
}

/// Wherever it is along the vein, the estimated error is a bound, also where the leaf is integrated
/// across the point.
#[test]
fn forces_on_points_anywhere_are_within_the_bars() {
    for at in [0.07, 0.29, 0.36, 0.58, 0.77, 0.93] {
        let text = format!("{ROD}\n[[load.point]]\nvein = 1\nat = {at}\nforce = [0.3, 1.0, -2.0]");
        let scenario = parse(&text);
        let best = settle(&scenario, 1e-11);
        for tolerance in [1e-3, 1e-5, 1e-7] {
            let leaf = leafdyn_testing::relaxed(&scenario, &with_modes(0, to(tolerance)));
            let bar = leaf.accuracy.error_estimate.unwrap();
            assert!(bar <= tolerance);
            let off = distance(&leaf, &best);
            assert!(
                off <= bar + 1e-11,
                "{at}, {tolerance}: {off:.1e}, {bar:.1e}"
            );
        }
    }
}

/// A tapered column that leans under its own weight, by the fourth-order Runge-Kutta method from its
/// tip: with the weight W(s) above, the force n = -W e3, theta' = -M/A2, and M' = -W r1'.
#[test]
fn a_tapered_column_under_its_own_weight() {
    const LENGTH: f64 = 2.0;
    const YOUNG: f64 = 1e8;
    const WEIGHT: f64 = 9.81 * 800.0;
    const ELEVATION: f64 = 1.4;
    let (thick, thin, poisson) = (0.04, 0.01, 0.3);
    let text = format!(
        r#"
        name = "column"
        leaf = {{ rods = 1, length = {LENGTH}, fan = [0.0], elevation = {ELEVATION} }}
        section = {{ shape = "circle", diameter = {{ at = [0.0, 1.0], value = [{thick}, {thin}] }}, young = {YOUNG}, mass_density = 800.0 }}
        load = {{ g = [0.0, 0.0, -9.81] }}
    "#
    );
    let diameter = |s: f64| thick + s / LENGTH * (thin - thick);
    let above = |s: f64| {
        let cubes = f64::powi(thin, 3) - diameter(s).powi(3);
        WEIGHT * PI / 4.0 * cubes / 3.0 * LENGTH / (thin - thick)
    };
    let slopes = |s: f64, [theta, moment, ..]: [f64; 4]| {
        let (d, weight, (sin, cos)) = (diameter(s), above(s), theta.sin_cos());
        let stretch = YOUNG * PI / 4.0 * d * d;
        let shear =
            6.0 * (1.0 + poisson) / (7.0 + 6.0 * poisson) * stretch / (2.0 * (1.0 + poisson));
        let (along, across) = (1.0 - weight * sin / stretch, -weight * cos / shear);
        let x = along * cos - across * sin;
        let bending = YOUNG * PI / 64.0 * d.powi(4);
        [
            -moment / bending,
            -weight * x,
            x,
            along * sin + across * cos,
        ]
    };
    const STEPS: usize = 4000;
    // From the tip down: theta, M, and the way to the base.
    let down = |tip: f64| {
        let (mut y, h) = ([tip, 0.0, 0.0, 0.0], -LENGTH / STEPS as f64);
        for k in 0..STEPS {
            let s = LENGTH + k as f64 * h;
            let to = |y: [f64; 4], by: f64, k: [f64; 4]| [0, 1, 2, 3].map(|c| y[c] + by * k[c]);
            let a = slopes(s, y);
            let b = slopes(s + 0.5 * h, to(y, 0.5 * h, a));
            let c = slopes(s + 0.5 * h, to(y, 0.5 * h, b));
            let d = slopes(s + h, to(y, h, c));
            y = [0, 1, 2, 3].map(|i| y[i] + h / 6.0 * (a[i] + 2.0 * b[i] + 2.0 * c[i] + d[i]));
        }
        y
    };
    let (mut before, mut tip) = (ELEVATION, ELEVATION - 0.3);
    for _ in 0..30 {
        let [one, other] = [before, tip].map(|tip| down(tip)[0] - ELEVATION);
        if one == other {
            break;
        }
        (before, tip) = (tip, tip - other * (tip - before) / (other - one));
    }
    let [base, moment, x, z] = down(tip);
    close("base", base, ELEVATION, 1e-12);
    let leaf = settle(&parse(&text), 1e-10);
    assert!(
        leaf.stable() == Some(true) && tip < ELEVATION - 0.1,
        "{tip}"
    );
    close("tip x", leaf.tips[0].x, -x, 1e-9);
    close("tip z", leaf.tips[0].z, -z, 1e-9);
    close(
        "moment",
        leaf.shape.rods[0].nodes[0].m.y / moment,
        1.0,
        1e-8,
    );
}

/// At stations between the nodes beside a loaded point, from which a leaf is integrated to them, the force is that of all
/// loads beyond: the load counts once, also where the node of the point is beside it by rounding, as at 0.37.
#[test]
fn stations_beside_a_loaded_point_bear_the_load_once() {
    let (weight, force) = (DVec3::new(0.0, 0.0, -1.0), DVec3::new(0.0, 0.3, 0.5));
    for at in [0.37, 0.23, 0.61, 0.77, 0.93] {
        let text = format!(
            "{ROD}\nload.gravity = {:?}\n[[load.point]]\nvein = 1\nat = {at:?}\nforce = {:?}",
            weight.to_array(),
            force.to_array()
        );
        let scenario = parse(&text);
        let at_tenths = |tolerance: f64| {
            let options = Options {
                stations: Some(10),
                ..to(tolerance)
            };
            settled(&scenario, &options).at_stations(&scenario, Some(10))
        };
        let (leaf, exact) = (at_tenths(1e-6), at_tenths(1e-10));
        assert_eq!(leaf.outcome, Outcome::Converged, "{at}: {:?}", leaf.remark);
        let [nodes, truth] = [&leaf, &exact].map(|it| &it.shape.rods[0].nodes);
        for ((node, truth), &sigma) in nodes.iter().zip(truth).zip(&leaf.shape.stations) {
            let beyond = (1.0 - sigma) * weight + if sigma < at { force } else { DVec3::ZERO };
            let off = (node.rotation * node.n).distance(beyond);
            assert!(off < 1e-6, "{at}, {sigma}: {off:e}");
            let off = node.position.distance(truth.position);
            assert!(off < estimate(&leaf), "{at}, {sigma}: {off:e}");
        }
    }
}
