//! Loads that the section holds off the axis, as leaflets beside a rachis: columns and struts with rigid levers against
//! closed forms, leaves against those relaxed.

use super::*;
use leafdyn::posture::Governing;
use leafdyn::posture::points::PosturePoints;
use leafdyn_testing::PI;

#[track_caller]
fn near(found: f64, exact: f64) {
    assert!((found / exact - 1.0).abs() < 1e-6, "{found}, not {exact}");
}

/// A column of length L under P, which a level lever of length a holds at its tip, has grown so that it is straight under
/// the moment a P. Out of the plane of the lever, with the slope phi and the twist zeta, its second variation is
/// the integral of E I phi'^2 + E J zeta'^2 - P phi^2 + 2 a P phi zeta'. The twist that is best for it leaves
/// E I phi'^2 - (P + a^2 P^2/(E J)) phi^2: it buckles at (P + a^2 P^2/(E J)) L^2/(E I) = pi^2/4, in the plane of the lever
/// at P L^2/(E I) = pi^2/4.
#[test]
fn a_column_with_a_level_lever() {
    let (torsion, arm, length): (f64, f64, f64) = (0.3, 0.4, 1.5);
    let euler = PI * PI / (4.0 * length * length);
    let exact = (1.0 + (1.0 + 4.0 * euler * arm * arm / torsion).sqrt()) / (2.0 * euler);
    for (offset, governing) in [
        ("0.0, 0.4", Governing::OutOfPlane),
        ("0.4, 0.0", Governing::Spatial),
    ] {
        let loads = format!(
            "point = [{{ vein = 1, at = 1.0, force = [0.0, 0.0, -1.0], offset = [{offset}] }}]"
        );
        let leaf = scenario(["0.3", "1.0", "1.0"], &loads);
        let column = posture(&leaf, straight(length * DVec3::Z), Some(DVec3::Y));
        near(column.critical_young(), exact);
        assert_eq!(column.critical.governing, governing);
        let ladder = column.ladder();
        assert!(
            ladder.iter().any(|rung| (rung * euler - 1.0).abs() < 1e-6),
            "{ladder:?}"
        );
        // The moment is the same all along, and the shape at rest is an arc.
        let stations = column.stations(false);
        for station in &stations.ends {
            near(station.moment.length(), arm);
        }
    }
}

/// A level strut that holds P on a lever of height h above its tip, an inverted pendulum: E I eta'' = 0, and the moment at
/// the tip is P h eta: E* = P h L/I. In its middle it is as if the strut ended there.
#[test]
fn a_load_above_a_level_strut() {
    for at in ["1.0", "0.5"] {
        let loads = format!(
            "point = [{{ vein = 1, at = {at}, force = [0.0, 0.0, -3.0], offset = [0.0, 0.2] }}]"
        );
        let leaf = scenario(["1e3", "1.0", "1e3"], &loads);
        let strut = posture(&leaf, straight(2.0 * DVec3::X), Some(DVec3::Y));
        near(
            strut.critical_young(),
            3.0 * 0.2 * 2.0 * at.parse::<f64>().unwrap(),
        );
        assert_eq!(strut.critical.governing, Governing::InPlane);
    }
}

const PAIR: &str = "gravity = [0.0, 0.0, -1.0], point = [\
    { vein = 1, at = 0.4, force = [0.0, 0.0, -0.5], offset = [0.3, -0.1] }, \
    { vein = 1, at = 0.4, force = [0.0, 0.0, -0.5], offset = [-0.3, -0.1] }]";
const SINGLE: &str = "gravity = [0.0, 0.0, -1.0], point = [\
    { vein = 1, at = 0.4, force = [0.0, 0.0, -0.3], offset = [0.2, 0.1] }, \
    { vein = 1, at = 1.0, force = [0.0, 0.0, -0.2], offset = [-0.3, 0.0] }]";

/// The index on both sides of each rung is that of the leaf relaxed from the posture.
#[test]
fn the_index_is_that_of_leaves_relaxed_there() {
    let (mut draw, mut compared) = (Draw(81), 0);
    for _ in 0..4 {
        for loads in [PAIR, SINGLE] {
            compared += relaxed::compare(&mut draw, false, ["0.3", "1.0", "2.0"], loads, 2);
            compared += relaxed::compare(&mut draw, true, ["0.7", "1.0", "1.0"], loads, 2);
        }
    }
    assert!(compared >= 56, "{compared} of 64");
}

/// Alike on both sides the leaf keeps its plane, and only then.
#[test]
fn leaflets_alike_on_both_sides() {
    let twin = Twin::draw(&mut Draw(82), false, 1.0);
    let governing = |loads: &str| {
        let leaf = scenario(["0.3", "1.0", "2.0"], loads);
        posture(&leaf, twin.curve(), Some(DVec3::Y))
            .critical
            .governing
    };
    assert_ne!(governing(PAIR), Governing::Spatial);
    assert_eq!(governing(SINGLE), Governing::Spatial);
}

/// Leaves of known modulus and shape at rest with leaflets on one side, relaxed: their posture, with the normals of the
/// blade, is stable at that modulus, the bound is not above it, and the leaf without loads is the one that was given.
#[test]
fn twins_with_leaflets() {
    let mut draw = Draw(83);
    let mut all = 0;
    while all < 20 {
        let [twist, bend_2, bend_3] = [0.4, 0.9, 0.4].map(|size| size * draw.normal());
        let [first, second] = [0.2, 0.15].map(|size| size * draw.normal());
        let heavy = draw.uniform(0.5, 2.0);
        let leaf = parse(&format!(
            r#"
            name = "twin"
            leaf = {{ rods = 1, length = 1.0, fan = [0.0], elevation = {} }}
            stiffness = {{ torsion = 0.6, bending_2 = 1.0, bending_3 = 0.8, axial = inf, shear_2 = inf, shear_3 = inf }}
            rest = {{ twist = {twist}, bend_2 = {bend_2}, bend_3 = {bend_3} }}
            [load]
            gravity = [0.0, 0.0, -{heavy}]
            point = [
                {{ vein = 1, at = 0.35, force = [0.0, 0.0, -0.4], offset = [{first}, 0.05] }},
                {{ vein = 1, at = 0.7, force = [0.0, 0.0, -0.3], offset = [{second}, 0.0] }},
            ]
            "#,
            draw.uniform(0.2, 1.2),
        ));
        let relaxed = leaf.relax().unwrap();
        if relaxed.stable() != Some(true) {
            continue;
        }
        all += 1;
        let relaxed = relaxed.at_stations(&leaf, Some(40));
        let nodes = &relaxed.shape.rods[0].nodes;
        let points = PosturePoints {
            normals: Some(nodes.iter().map(|node| node.rotation * DVec3::Z).collect()),
            ..PosturePoints::in_space(nodes.iter().map(|node| node.position).collect())
        };
        let found = Posture::from_points(hanging(&leaf), &points, None).unwrap();
        assert_eq!(found.index(1.0), 0);
        assert!(found.critical_young() < 1.0, "{}", found.critical_young());
        let natural = leaf.unloaded().relax().unwrap().tips[0];
        let unloaded = found.stations(false).unloaded(1.0, found.base.rotation());
        let off = unloaded.last().unwrap().distance(natural);
        assert!(off < 0.01, "{off}");
    }
}
