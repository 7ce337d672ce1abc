//! Shooting confirms leaves under loads that turn with the section, moments along veins, and wind: their
//! equations ask for no potential. Closed forms, and random leaves, by `check`.

use leafdyn::scenario::{PointLoad, Wind};
use leafdyn::study::{Check, CheckOptions, CheckVerdict, check};
use leafdyn_testing::random::{drawn, leaves};
use leafdyn_testing::*;

const ROD: &str = r#"
    name = "rod"
    leaf = { rods = 1, length = 1.0, fan = [0.0] }
    stiffness = { torsion = 0.8, bending_2 = 1.0, bending_3 = 1.4, axial = inf, shear_2 = inf, shear_3 = inf }
"#;

/// A check to this tolerance, which must agree.
#[track_caller]
fn confirmed(what: &str, scenario: &Scenario, tolerance: f64) -> Check {
    let options = CheckOptions {
        tolerance: Some(tolerance),
        ..CheckOptions::default()
    };
    let found =
        check(scenario, &options, &mut |_| {}).unwrap_or_else(|error| panic!("{what}: {error}"));
    println!("{what}: {:?}, {:?}", found.verdict, found.difference);
    assert_eq!(
        found.verdict,
        CheckVerdict::Agree,
        "{what}: {:?}",
        found.difference
    );
    assert_eq!(found.indices(), None, "there is no index");
    found
}

fn rod_with(more: &str) -> Scenario {
    parse(&format!("{ROD}\n{more}"))
}

fn tip_load(force: [f64; 3], moment: [f64; 3]) -> String {
    format!(
        "[[load.point]]\nvein = 1\nat = 1.0\nforce = {force:?}\nmoment = {moment:?}\nfollows = true\n"
    )
}

/// A column that is bent at rest below the load at which it flutters, a moment per length and one at a point,
/// tangential loads along it, and all of them with a jump in the middle.
#[test]
fn rods_under_loads_that_follow_are_confirmed() {
    let none = [0.0; 3];
    let cases = [
        (
            "bent column",
            format!(
                "rest = {{ bend_2 = 0.4, bend_3 = -0.2 }}\n{}",
                tip_load([-15.0, 0.0, 0.0], none)
            ),
        ),
        ("across", tip_load([0.0, 9.0, 0.0], none)),
        (
            "tangential",
            "rest = { bend_2 = 0.5 }\nload = { follower = [-20.0, 0.0, 0.0] }".into(),
        ),
        (
            "couple",
            "load = { couple = [1.0, 2.0, 3.0], couple_follows = true }".into(),
        ),
        (
            "dead couple",
            "load = { couple = [0.4, 0.8, 1.0], follower = [0.0, 0.5, 0.2] }".into(),
        ),
        (
            "all",
            format!(
                "[load]\nfollower = [0.6, 1.0, 1.5]\ncouple = [0.3, -0.5, 0.7]\ncouple_follows = true\n{}\
                 [[load.point]]\nvein = 1\nat = 0.5\nforce = [0.4, 1.0, -2.0]\nmoment = [-0.4, 0.6, 0.2]\nfollows = true\n",
                tip_load([1.0, -2.0, 0.5], [0.5, 0.3, -0.6])
            ),
        ),
    ];
    for (what, more) in cases {
        confirmed(what, &rod_with(&more), 1e-9);
    }
}

/// A round vein, whose energy does not tell how it is turned about its base: each of these loads has one equilibrium, as an
/// initial value problem from the free tip shows.
#[test]
fn round_rods_under_loads_that_follow_come_to_rest() {
    for size in [1.5, 1.6, 1.65, 1.7, 1.75, 1.8, 2.0] {
        let [x, y, z] = [0.1, 0.3, -1.0].map(|part| size * part);
        let scenario = parse(&format!(
            r#"
            name = "round"
            leaf = {{ rods = 1, length = 1.0, fan = [0.0] }}
            stiffness = {{ torsion = 1.0, bending_2 = 1.0, bending_3 = 1.0, axial = 1000.0, shear_2 = 1000.0, shear_3 = 1000.0 }}
            load = {{ follower = [{x}, {y}, {z}] }}"#
        ));
        confirmed(&format!("round, {size}"), &scenario, 1e-8);
    }
}

/// A moment that turns with the tip bends a rod to an arc: by shooting to its digits.
#[test]
fn a_moment_that_follows_bends_to_a_circle() {
    let curvature = 5.0_f64;
    let found = confirmed(
        "circle",
        &rod_with(&tip_load([0.0; 3], [0.0, 0.0, 1.4 * curvature])),
        1e-10,
    );
    let end = found.solution().unwrap().rods[0]
        .nodes
        .last()
        .unwrap()
        .position;
    let circle = DVec3::new(curvature.sin(), 1.0 - curvature.cos(), 0.0) / curvature;
    assert!(end.distance(circle) < 1e-11, "{:e}", end.distance(circle));
}

/// An inextensible cantilever across the wind: the force at its base over that of a rigid one.
#[test]
fn the_drag_of_a_cantilever_is_that_of_its_equation() {
    let wanted = [
        (1.0, 0.9748331360),
        (10.0, 0.5236122824),
        (100.0, 0.1917895283),
        (1000.0, 0.0890046689),
    ];
    for (cauchy, wanted) in wanted {
        let speed = f64::sqrt(cauchy);
        let wind = format!(
            "wind = {{ velocity = [0.0, 0.0, {speed:?}], density = 2.0, drag = 1.0, width = 1.0 }}"
        );
        let found = confirmed("wind", &rod_with(&wind), 1e-9);
        let base = &found.solution().unwrap().rods[0].nodes[0];
        let (force, _) = in_lab(base);
        close(&format!("C = {cauchy}"), force.z / cauchy, wanted, 2e-10);
    }
}

/// Random leaves, joined and free, coupled, tapered and curved, with loads on points, along veins, and in wind.
#[test]
fn random_leaves_are_confirmed() {
    for (k, mut scenario) in drawn(leaves(), 20).into_iter().enumerate() {
        // Multiples of the golden ratio are equidistributed.
        let golden = |i: usize| 2.0 * ((7 * k + i) as f64 * 0.618_033_988_749_895).fract() - 1.0;
        let vector = |i: usize| [golden(i), golden(i + 1), golden(i + 2)];
        let rods = scenario.rods.len();
        if k % 3 != 2 {
            let along = |i: usize| vector(i).map(|value| Profile::Constant(0.5 * value));
            scenario.follower = Some((0..rods).map(|j| along(3 * j)).collect());
            scenario.couple = Some((0..rods).map(|j| along(3 * j + 20)).collect());
            scenario.couple_follows = k % 2 == 0;
            scenario.points.push(PointLoad {
                vein: k % rods,
                at: if k % 4 == 0 { 1.0 } else { 0.6 },
                force: vector(40),
                moment: vector(50).map(|value| 0.3 * value),
                follows: true,
                mass: 0.0,
                offset: [0.0; 2],
                in_time: None,
                landing: None,
            });
        }
        if k % 3 != 0 {
            scenario.wind = Some(Wind {
                velocity: Schedule::constant(vector(60)),
                density: 1.0,
                drag: 1.2,
                width: vec![Profile::Constant(0.5); rods],
            });
        }
        confirmed(&format!("leaf {k} of {rods} veins"), &scenario, 1e-7);
    }
}

/// From arcs no continuation leads to such a leaf.
#[test]
fn shooting_from_arcs_is_refused() {
    let scenario = rod_with(&tip_load([1.0, 0.0, 0.0], [0.0; 3]));
    let shot = shoot_alone(&scenario, &[0.0, 1.0]);
    let told = shot.err().unwrap().reason.to_string();
    assert!(told.contains("shooting-from-rest"), "{told}");
}
