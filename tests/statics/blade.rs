//! Leaves from an outline: narrow blades as beams, blades as they grow, and how
//! many veins they need.

use leafdyn::relax::Method;
use leafdyn::study::{BaseScenario, ParameterKeys, relax_with_sensitivities};
use leafdyn_testing::*;

/// A blade of constant width, straight, whose tip is free. Small loads.
fn strip(rods: usize, edges: bool, more: &str) -> String {
    format!(
        r#"
        name = "strip"
        leaf = {{ rods = {rods} }}
        blade = {{ length = {LENGTH}, width = {WIDTH}, thickness = {THICKNESS}, young = {YOUNG}, edges = {edges}, {more} }}
    "#
    )
}

const LENGTH: f64 = 25.0;
const WIDTH: f64 = 2.0;
const THICKNESS: f64 = 0.03;
const YOUNG: f64 = 3e4;
const POISSON: f64 = 0.3;
const SHEAR: f64 = YOUNG / (2.0 * (1.0 + POISSON));

/// However many veins it has, a plate that does not narrow bends as E W t^3/12.
#[test]
fn a_blade_bends_as_a_plate() {
    let load = 1e-9;
    for rods in [1, 5, 9, 17] {
        let more = format!("poisson = 0.0, shear_modulus = {SHEAR}");
        let text = strip(rods, true, &more) + &format!("load = {{ gravity = [0.0, 0.0, {load}] }}");
        let leaf = settle(&parse(&text), 1e-11);
        let bending = YOUNG * WIDTH * THICKNESS.powi(3) / 12.0;
        let shear = 5.0 / 6.0 * SHEAR * WIDTH * THICKNESS;
        let per_length = rods as f64 * load;
        let deflection =
            per_length * (LENGTH.powi(4) / (8.0 * bending) + LENGTH.powi(2) / (2.0 * shear));
        for tip in &leaf.tips {
            close("tip", tip.z / deflection, 1.0, 1e-6);
        }
    }
}

/// A long strip under a force at its tip in its plane buckles sideways at 4.0126 sqrt(E I G J)/L^2
/// (S. P. Timoshenko and J. M. Gere, Theory of Elastic Stability, sec. 6.3).
#[test]
fn a_narrow_blade_buckles_sideways() {
    let bending = YOUNG * WIDTH * THICKNESS.powi(3) / 12.0;
    let torsion = SHEAR * WIDTH * THICKNESS.powi(3) / 3.0;
    let load = 4.0126 * (bending * torsion).sqrt() / LENGTH.powi(2);
    let more = format!("shear_modulus = {SHEAR}");
    for (part, index) in [(0.98, 0), (1.06, 1)] {
        let each = part * load / 3.0;
        let text = strip(3, false, &more) + &format!("load = {{ tip_force = [0.0, {each}, 0.0] }}");
        let leaf = kept(&parse(&text), 1e-6);
        assert_eq!(leaf.stability.negative_eigenvalues, Some(index), "{part}");
    }
}

/// A pointed blade with a curved outline.
const BLADE: &str = r#"
    name = "blade"
    leaf = { rods = 9 }
    blade = { length = 25.0, width = { at = [0.0, 0.15, 0.4, 0.7, 1.0], value = [0.9, 1.4, 1.6, 1.0, 0.0] }, thickness = 0.03, young = 5e4, young_across = 2e4, mass_density = 8e-6 }
"#;

fn blade(change: &str) -> Scenario {
    let entries = entries(change);
    Scenario::from_toml_with(BLADE, "blade", &entries).unwrap()
}

/// Unloaded it lies as it has grown: the margins along the outline, in a plane however it rises,
/// without energy; its tip is where it ends.
#[test]
fn an_unloaded_blade_lies_within_its_outline() {
    for elevation in [0.0, 0.9, -1.3] {
        let scenario = blade(&format!("leaf.elevation={elevation}"));
        let leaf = settle(&scenario, 1e-9);
        assert_eq!(leaf.stable(), Some(true));
        close("energy", leaf.energy.unwrap(), 0.0, 1e-12);
        let along = DVec3::new(f64::cos(elevation), 0.0, f64::sin(elevation));
        let normal = along.cross(DVec3::Y);
        close("tip", leaf.tips[0].distance(25.0 * along), 0.0, 1e-9);
        let made = scenario.blade.as_ref().unwrap();
        for (j, rod) in leaf.shape.rods.iter().enumerate() {
            for node in &rod.nodes {
                let x = node.position.dot(along) / 25.0;
                let eta = (j as f64 - 4.0) / 4.0;
                close("place", node.position.y, 0.5 * eta * made.width(x), 1e-9);
                close("plane", node.position.dot(normal), 0.0, 1e-9);
                // The section lies in the plane, too.
                close(
                    "section",
                    (node.rotation * DVec3::Z).dot(normal).abs(),
                    1.0,
                    1e-9,
                );
            }
        }
    }
}

const WEIGHT: &str = "load.g=[0, 0, -981]";

/// Half of a blade is the whole, and its own image.
#[test]
fn a_blade_under_its_weight_is_its_own_image() {
    let [half, full] = [
        settle(&blade(WEIGHT), 1e-6),
        settled(&blade(WEIGHT), &in_full(to(1e-6))),
    ];
    assert!(distance(&half, &full) < 2e-6 * 25.0);
    close("tip", half.tips[0].y, 0.0, 1e-9);
    // All that weighs is the blade.
    let weight = 981.0 * 8e-6 * 0.03 * 25.0;
    let reaction = blade(WEIGHT).total_load().z;
    let mean = (0..1000)
        .map(|k| blade("").blade.unwrap().width((k as f64 + 0.5) / 1000.0))
        .sum::<f64>()
        / 1000.0;
    close("weight", reaction / (-weight * mean), 1.0, 1e-6);
}

/// Twice as many veins, the same blade: the differences of the tip become small, in second order with veins in the
/// middle of equal strips.
#[test]
fn few_veins_are_enough() {
    for (edges, ratio, last) in [(false, 3.5, 1e-3), (true, 1.2, 1.2e-2)] {
        let tip = |rods: usize| {
            let change = format!("{WEIGHT}; leaf.rods={rods}; blade.edges={edges}");
            settle(&blade(&change), 1e-7).tips[0]
        };
        let tips = [3, 5, 9, 17].map(tip);
        let changes: Vec<f64> = tips
            .windows(2)
            .map(|pair| pair[0].distance(pair[1]))
            .collect();
        let shrink = changes.windows(2).all(|pair| ratio * pair[1] < pair[0]);
        assert!(shrink && changes[2] < last, "{edges}: {changes:?}");
    }
}

/// The width below which stiffnesses are those of a wider blade hardly matters.
#[test]
fn the_least_width_hardly_matters() {
    let tip = |least: f64| {
        settle(
            &blade(&format!("{WEIGHT}; blade.least_width={least}")),
            1e-7,
        )
        .tips[0]
    };
    let [wide, narrow] = [0.1, 0.03].map(tip);
    assert!(wide.distance(narrow) < 5e-3, "{}", wide.distance(narrow));
}

/// By multiple shooting, which knows the energy of the tissue alone.
#[test]
fn a_blade_by_shooting() {
    let scenario = blade(&format!(
        "{WEIGHT}; leaf.rods=3; blade.length=3; blade.thickness=0.01; blade.width={{at=[0,0.5,1],value=[0.9,1.6,0.8]}}"
    ));
    let leaf = settle(&scenario, 1e-8);
    let shot = settled(
        &scenario,
        &by(Method::ShootingFromRest { intervals: None }, to(1e-8)),
    );
    let bars = [&leaf, &shot].map(|it| it.accuracy.error_estimate.unwrap());
    let apart = distance(&leaf, &shot);
    // Rounding in shooting, where perturbations grow along thin strips: with 16 to 100 intervals it differs by so
    // much.
    let rounding = 1e-8;
    assert!(apart < bars[0] + bars[1] + rounding, "{apart:.1e} {bars:?}");
}

/// Two veins with tissue that keeps their distance and resists shear, of which one has grown by a
/// small strain: with the height h of square veins that touch each other, S. Timoshenko's bimetal,
/// J. Opt. Soc. Am. 11 (1925), 233.
#[test]
fn veins_of_unequal_growth_curve_as_a_bimetal() {
    let (apart, axial, growth) = (0.02, 2e4, 1e-6);
    let text = format!(
        r#"
        name = "bimetal"
        leaf = {{ rods = 2, length = 1.0, fan = [0.0, 0.0], joined = false, base = [[0.0, -0.01, 0.0], [0.0, 0.01, 0.0]] }}
        stiffness = {{ torsion = 1.0, bending_2 = 1.0, bending_3 = 1.0, axial = {axial}, shear_2 = inf, shear_3 = inf }}
        tissue = {{ along = 1e9, across = 1e9, grown = false }}
        rest = {{ stretch = [1.0, {}] }}
    "#,
        1.0 + growth
    );
    let leaf = settle(&parse(&text), 1e-11);
    let curvature = growth * apart / (apart * apart + 4.0 / axial);
    for rod in &leaf.shape.rods {
        let middle = &rod.nodes[rod.nodes.len() / 2];
        close("curvature", middle.u.z / -curvature, 1.0, 1e-4);
    }
    // Tissue that has grown with them is without force.
    let grown = settle(&parse(&text.replace(", grown = false", "")), 1e-11);
    assert!(grown.energy.unwrap().abs() < 1e-16);
}

/// Numbers of a blade have derivatives: those of whole relaxations.
#[test]
fn derivatives_by_the_outline_and_the_material() {
    let keys = [
        ("blade.width.value[2]", 1.6),
        ("blade.length", 25.0),
        ("blade.young", 5e4),
        ("blade.young_across", 2e4),
        ("blade.poisson", 0.3),
        ("blade.thickness", 0.03),
        ("leaf.elevation", 0.4),
    ];
    let given = entries(&format!("{WEIGHT}; leaf.rods=5; leaf.elevation=0.4"));
    let base = BaseScenario::from_text(BLADE.into(), "blade".into(), &given).unwrap();
    let names: Vec<ParameterKeys> = keys.iter().map(|(key, _)| key.parse().unwrap()).collect();
    let leaf = relax_with_sensitivities(&base, &names, &to(1e-5), &mut |_| {}).unwrap();
    let found = leaf.sensitivities.unwrap();
    assert_eq!(found.len(), keys.len());
    for ((key, value), found) in keys.into_iter().zip(found) {
        let step = 1e-2 * value;
        let tip = |value: f64| {
            let change = format!("{WEIGHT}; leaf.rods=5; leaf.elevation=0.4; {key}={value}");
            settle(&blade(&change), 1e-7).tips[0]
        };
        let slope = |h: f64| (tip(value + h) - tip(value - h)) / (2.0 * h);
        let expected = (4.0 * slope(step) - slope(2.0 * step)) / 3.0;
        let off = found.tips[0].distance(expected);
        assert!(
            off < 1e-4 * expected.length(),
            "{key}: {} {expected}",
            found.tips[0]
        );
    }
}
