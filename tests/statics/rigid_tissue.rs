//! Tissue that is rigid along and normal to the veins, and contracts across them, in relaxations: strips as a
//! plate, shooting, the explicit method, halves, and derivatives.

use leafdyn::relax::Method;
use leafdyn::study::{
    BaseScenario, CheckOptions, CheckVerdict, ParameterKeys, check, relax_with_sensitivities, trace,
};
use leafdyn_testing::branch::request;
use leafdyn_testing::*;

/// Three veins in space, with loads; no two alike.
const LEAF: &str = r#"
    name = "three veins"
    leaf = { rods = 3, length = [1.0, 1.1, 0.9], fan = [-0.1, 0.0, 0.15], joined = false, base = [[0.0, -0.12, 0.01], [0.0, 0.0, 0.0], [0.0, 0.1, 0.0]] }
    stiffness = { torsion = 0.5, bending_2 = { at = [0.0, 1.0], value = [1.0, 0.5] }, bending_3 = 3.0, axial = 300.0, shear_2 = 200.0, shear_3 = 200.0 }
    tissue = { along = inf, across = 50.0, normal = inf, fold = 0.3, contraction = 0.03 }
    [load]
    gravity = [0.0, 0.3, -1.5]
    [[load.point]]
    vein = 1
    at = 0.6
    force = [0.1, 0.2, -0.6]
    [[load.point]]
    vein = 3
    at = 1.0
    force = [0.0, 0.1, 0.3]
"#;

/// A strip of an isotropic plate, 4 wide and 0.5 long, in N equal strips: clamped at both ends, of which one
/// is moved sideways in the plane.
fn sheared_strip(rods: usize, contracts: bool) -> Scenario {
    let (length, width, t, young, poisson) = (0.5, 4.0, 0.01, 1e4, 0.3);
    let n = rods as f64;
    let (h, shear) = (width / n, young / (2.0 * (1.0 + poisson)));
    let part = 1.0 - 5.0 / (6.0 * n * n) + 2.0 / (3.0 * n.powi(4));
    let (across, contraction) = match contracts {
        true => (young / (1.0 - poisson * poisson) * t / h, poisson * h),
        false => (young * t / h, 0.0),
    };
    let bases: Vec<String> = (0..rods)
        .map(|j| format!("[0.0, {:?}, 0.0]", 0.5 * h * (2.0 * j as f64 + 1.0 - n)))
        .collect();
    let grips: String = (1..=rods)
        .map(|vein| {
            format!(
                "[[grip]]\nvein = {vein}\nat = 1.0\nheld = 'clamped'\nmove = [0.0, {MOVE}, 0.0]\n"
            )
        })
        .collect();
    parse(&format!(
        r#"
        name = "sheared strip"
        [leaf]
        rods = {rods}
        length = {length}
        fan = {:?}
        joined = false
        base = [{}]
        [stiffness]
        torsion = {}
        bending_2 = {}
        bending_3 = {}
        axial = {}
        shear_2 = {}
        shear_3 = {}
        [tissue]
        along = inf
        across = {across}
        normal = inf
        fold = {}
        contraction = {contraction}
        {grips}
        "#,
        vec![0.0; rods],
        bases.join(", "),
        shear * h * t.powi(3) / 3.0,
        young * h * t.powi(3) / 12.0,
        young * t * h.powi(3) / 12.0,
        young * h * t,
        part * shear * h * t,
        5.0 / 6.0 * shear * h * t,
        across * t * t / 12.0,
    ))
}

const MOVE: f64 = 1e-4;

/// The force over the motion: without contraction that of a linear lattice of the same rules, computed
/// elsewhere; with it, of nine strips, within 1 % of plane stress, 294.65.
#[test]
fn strips_shear_in_their_plane_as_a_plate() {
    let stiffness = |rods: usize, contracts: bool| {
        let leaf = settle(&sheared_strip(rods, contracts), 1e-8);
        2.0 * leaf.energy.unwrap() / (MOVE * MOVE)
    };
    for (rods, known, digits) in [(3, 279.0, 0.05), (5, 293.09, 0.005), (9, 296.847656, 5e-5)] {
        close("stiffness", stiffness(rods, false), known, digits);
    }
    close("plate", stiffness(9, true) / 294.65, 1.0, 0.01);
}

/// By shooting, whose unknowns are others, at all tolerances within the errors that are told.
#[test]
fn relaxation_and_shooting_find_the_same_leaf() {
    for change in [
        "",
        "tissue.contraction=0",
        "tissue.along=20; tissue.normal=30",
        "tissue.normal=0",
    ] {
        let scenario = Scenario::from_toml_with(LEAF, "leaf", &entries(change)).unwrap();
        let shot = settled(
            &scenario,
            &by(Method::ShootingFromRest { intervals: None }, to(1e-10)),
        );
        for tolerance in [1e-3, 1e-6, 1e-8] {
            let leaf = settle(&scenario, tolerance);
            assert_eq!(leaf.stable(), Some(true));
            let bars = [&leaf, &shot].map(|it| it.accuracy.error_estimate.unwrap());
            let off = distance(&leaf, &shot);
            assert!(
                off <= bars[0] + bars[1],
                "{change} {tolerance}: {off:.1e} {bars:?}"
            );
            // Between its nodes, too.
            let [leaf, shot] = [leaf, shot.clone()].map(|it| it.at_stations(&scenario, Some(40)));
            let bars = [&leaf, &shot].map(|it| it.accuracy.error_estimate.unwrap());
            let off = distance(&leaf, &shot);
            assert!(
                off <= bars[0] + bars[1],
                "{change} {tolerance}: {off:.1e} {bars:?}"
            );
        }
        // Shooting has the strains from the forces of veins and tissue together.
        let leaf = settle(&scenario, 1e-8);
        let stations = &leaf.shape.stations;
        let same = |sigma: f64| stations.iter().position(|at| (at - sigma).abs() < 1e-12);
        // Not where the force jumps.
        let places = shot.shape.stations.iter().enumerate();
        let places = places.filter(|(_, sigma)| **sigma > 0.0 && (*sigma - 0.6).abs() > 1e-12);
        let both: Vec<_> = places
            .filter_map(|(there, sigma)| Some((same(*sigma)?, there)))
            .collect();
        assert!(both.len() > 1, "{:?}", shot.shape.stations);
        for (rod, other) in leaf.shape.rods.iter().zip(&shot.shape.rods) {
            for &(here, there) in &both {
                let (a, b) = (&rod.nodes[here], &other.nodes[there]);
                let apart = [a.v.distance(b.v), a.u.distance(b.u), a.n.distance(b.n)];
                assert!(
                    apart[0] < 1e-6 && apart[1] < 1e-4 && apart[2] < 1e-4,
                    "{change}: {apart:?}"
                );
            }
        }
        let checked = check(&scenario, &CheckOptions::default(), &mut |_| {}).unwrap();
        assert_eq!(checked.verdict, CheckVerdict::Agree, "{change}");
    }
}

/// The explicit method, to which rigid tissue is stiff.
#[test]
fn the_explicit_method_comes_to_the_same_rest() {
    let scenario = parse(LEAF);
    let explicit = Method::Explicit { segments: None };
    let leaf = settled(&scenario, &by(explicit, to(1e-4)));
    let exact = settle(&scenario, 1e-8);
    let bar = leaf.accuracy.error_estimate.unwrap();
    let off = distance(&leaf, &exact);
    assert!(off <= bar + 1e-8, "{off:.1e} {bar:.1e}");
}

/// A leaf that is its own mirror image is found from its half.
#[test]
fn half_a_leaf_is_the_whole() {
    let scenario = parse(
        r#"
        name = "mirrored"
        leaf = { rods = 5, fan = [-0.2, -0.1, 0.0, 0.1, 0.2], length = 1.0, joined = false, base = [[0.0, -0.2, 0.0], [0.0, -0.1, 0.0], [0.0, 0.0, 0.0], [0.0, 0.1, 0.0], [0.0, 0.2, 0.0]] }
        stiffness = { torsion = 0.5, bending_2 = 1.0, bending_3 = 3.0, axial = 300.0, shear_2 = 200.0, shear_3 = 200.0 }
        rest = { bend_2 = 0.5 }
        tissue = { along = inf, across = 50.0, normal = inf, fold = 0.3, contraction = 0.03 }
        load = { gravity = [0.1, 0.0, -1.5] }
        "#,
    );
    let [half, whole] = [
        settle(&scenario, 1e-8),
        settled(&scenario, &in_full(to(1e-8))),
    ];
    assert!(half.model.rods < 5 && whole.model.rods == 5);
    assert!(distance(&half, &whole) < 2e-8);
    close("energy", half.energy.unwrap(), whole.energy.unwrap(), 1e-8);
}

/// Derivatives are those of whole relaxations, also by what moves the natural leaf of rigid tissue.
#[test]
fn derivatives_are_those_of_whole_relaxations() {
    let keys = [
        ("tissue.contraction", 0.03),
        ("tissue.across", 50.0),
        ("tissue.fold", 0.3),
        ("stiffness.axial", 300.0),
        ("stiffness.torsion", 0.5),
        ("leaf.length[1]", 1.1),
        ("leaf.fan[0]", -0.1),
        ("load.gravity[2]", -1.5),
    ];
    let base = BaseScenario::from_text(LEAF.into(), "leaf".into(), &[]).unwrap();
    let names: Vec<ParameterKeys> = keys.iter().map(|(key, _)| key.parse().unwrap()).collect();
    let found = relax_with_sensitivities(&base, &names, &to(1e-9), &mut |_| {}).unwrap();
    for ((key, value), found) in keys.into_iter().zip(found.sensitivities.unwrap()) {
        let tips = |value: f64| {
            let changed = entries(&format!("{key}={value}"));
            let scenario = Scenario::from_toml_with(LEAF, "leaf", &changed).unwrap();
            settle(&scenario, 1e-9).tips
        };
        let step = 1e-2 * f64::abs(value);
        let [a, b, c, d] = [1.0, -1.0, 2.0, -2.0].map(|k| tips(value + k * step));
        for (j, found) in found.tips.iter().enumerate() {
            let expected = (8.0 * (a[j] - b[j]) - (c[j] - d[j])) / (12.0 * step);
            let off = found.distance(expected);
            assert!(
                off < 1e-5 * (1.0 + expected.length()),
                "{key}, vein {}: {found} {expected}",
                j + 1
            );
        }
    }
}

/// By a contraction that is none so far there is a derivative, too.
#[test]
fn no_contraction_has_a_derivative() {
    let text = LEAF.replace(", contraction = 0.03", ", contraction = 0.0");
    let base = BaseScenario::from_text(text.clone(), "leaf".into(), &[]).unwrap();
    let names = ["tissue.contraction".parse::<ParameterKeys>().unwrap()];
    let found = relax_with_sensitivities(&base, &names, &to(1e-8), &mut |_| {}).unwrap();
    let tip = |value: f64| {
        let changed = entries(&format!("tissue.contraction={value}"));
        let scenario = Scenario::from_toml_with(&text, "leaf", &changed).unwrap();
        settle(&scenario, 1e-9).tips[0]
    };
    let step = 1e-3;
    let expected = (tip(step) - tip(-step)) / (2.0 * step);
    let found = found.sensitivities.unwrap()[0].tips[0];
    assert!(
        found.distance(expected) < 1e-3 * expected.length(),
        "{found} {expected}"
    );
}

/// Veins whose tips share a place, and would be apart at rest, cannot be tied by rigid tissue.
#[test]
fn tips_that_rigid_tissue_keeps_apart_are_refused() {
    let joined = entries("leaf.joined=true");
    let scenario = Scenario::from_toml_with(LEAF, "leaf", &joined).unwrap();
    let refused = scenario.relaxation().run().unwrap_err().to_string();
    assert!(
        refused.contains("leaf.joined = false") && refused.contains("apart"),
        "{refused}"
    );
}

/// Two straight veins whose tips meet.
const MEETING: &str = r#"
    name = "two veins"
    leaf = { rods = 2, length = 1.0, fan = [0.1001674211615598, -0.1001674211615598], joined = true, base = [[0.0, -0.1, 0.0], [0.0, 0.1, 0.0]] }
    stiffness = { torsion = 1.0, bending_2 = 1.0, bending_3 = 2.0, axial = 300.0, shear_2 = 200.0, shear_3 = 200.0 }
    tissue = { along = inf, across = 50.0, normal = inf }
    rest = { stretch = [1.0, 1.0] }
    load = { gravity = [0.0, 0.0, -0.5] }
"#;

/// A trace refuses an end of its range at which growth keeps such tips apart, before it follows anything.
#[test]
fn a_trace_to_tips_that_growth_keeps_apart_is_refused() {
    assert!(base(MEETING, "").scenario().relaxation().run().is_ok());
    for range in ["1..1.05", "1.05..1"] {
        let vary = format!("rest.stretch[0]={range}");
        let request = request(base(MEETING, ""), &vary, 1e-6, 100);
        let refused = trace(&request, &mut |_, _, _| panic!("it is not followed"));
        let refused = refused.unwrap_err().to_string();
        let says = ["rest.stretch[0] = 1.05: ", "apart", "tissue.grown = false"];
        assert!(says.iter().all(|it| refused.contains(it)), "{refused}");
    }
}

/// Veins that neither stretch sideways nor shear between tissue that is rigid along and normal to them bear forces against
/// each other that converge slowly: the leaf is at rest all the same, as accurately as is asked.
#[test]
fn forces_between_rigid_parts_converge() {
    let scenario = Scenario::from_toml(
        r#"
        name = "foundation"
        [leaf]
        rods = 3
        length = [1.1, 1.0, 1.05]
        fan = [-0.18, 0.0, 0.12]
        joined = false
        base = [-0.4, 0.2, -0.1]
        [stiffness]
        torsion = 1.8
        bending_2 = [1.4, 1.3, 2.8]
        bending_3 = 1.7
        axial = [230.0, 100.0, 60.0]
        shear_2 = inf
        shear_3 = inf
        [rest]
        bend_3 = -0.64
        [tissue]
        along = inf
        across = 2.5
        normal = inf
        fold = 0.08
        [load]
        couple = [0.17, 0.12, 0.2]
        couple_follows = true
        [foundation]
        stiffness = [4.9, 0.3, 2.1]
        "#,
    )
    .unwrap();
    let [coarse, fine] = [1e-5, 1e-7].map(|tolerance| settle(&scenario, tolerance));
    for (a, b) in coarse.tips.iter().zip(&fine.tips) {
        let bar = coarse.accuracy.error_estimate.unwrap() + fine.accuracy.error_estimate.unwrap();
        assert!(a.distance(*b) <= bar, "{a} {b} {bar:e}");
    }
}
