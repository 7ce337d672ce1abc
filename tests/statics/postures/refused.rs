//! What a posture does not follow from is refused with what to do.

use super::*;
use leafdyn::posture::points::{PostureError, PosturePoints};
use leafdyn::study::{SecondPosture, UnbendRequest, unbend};
use leafdyn_testing::{ROD, parse};

fn points() -> PosturePoints {
    let twin = Twin::draw(&mut Draw(71), false, 1.0);
    let positions = (0..20).map(|k| twin.position(f64::from(k) / 19.0));
    PosturePoints::in_plane(positions.collect(), DVec3::Y)
}

fn refusal(scenario: &Scenario, points: PosturePoints) -> String {
    let request = UnbendRequest::new(scenario.clone(), points);
    unbend(&request).unwrap_err().to_string()
}

#[test]
fn loads_and_supports_without_known_forces() {
    let weight = "load = { gravity = [0.0, 0.0, -1.0] }";
    let fan = ROD
        .replace("rods = 1", "rods = 3")
        .replace("[0.0]", "\"symmetric\"");
    for (text, key, advice) in [
        (format!("{fan}{weight}"), "leaf.rods", "one vein"),
        (
            format!("{ROD}{weight}\ntip = {{ held = \"pinned\", position = [0.9, 0.0, 0.0] }}"),
            "tip.held",
            "leave the tip free",
        ),
        (
            format!("{ROD}{weight}\ngrip = [{{ vein = 1, at = 0.5 }}]"),
            "grip",
            "[[load.point]]",
        ),
        (
            format!("{ROD}{weight}\nfoundation = {{ stiffness = [0.0, 0.0, 1.0] }}"),
            "foundation",
            "leave it out",
        ),
        (
            format!(
                "{ROD}{weight}\nwind = {{ velocity = [1.0, 0.0, 0.0], density = 1.0, drag = 1.0, width = 0.1 }}"
            ),
            "wind",
            "still air",
        ),
        (
            format!("{ROD}load = {{ gravity = [0.0, 0.0, -1.0], tip_moment = [0.0, 1.0, 0.0] }}"),
            "load.tip_moment",
            "give forces",
        ),
        (
            format!("{ROD}load = {{ follower = [0.0, 0.0, -1.0] }}"),
            "load.follower",
            "dead forces",
        ),
        (
            format!("{ROD}load = {{ couple = [0.0, 1.0, 0.0] }}"),
            "load.follower, load.couple",
            "dead forces",
        ),
        (
            format!(
                "{}{weight}",
                ROD.replace("rods = 1,", "rods = 1, base_held = \"pinned\",")
            ),
            "leaf.base_held",
            "clamp it",
        ),
        (
            format!("{ROD}{weight}\nrest = {{ stretch = 1.1 }}"),
            "rest.stretch",
            "leave this out",
        ),
        (ROD.to_string(), "load.gravity", "give the weight"),
    ] {
        let why = refusal(&parse(&text), points());
        assert!(why.starts_with(key) && why.contains(advice), "{why}");
    }
}

#[test]
fn points_that_are_no_posture() {
    let leaf = scenario(["1.0"; 3], "gravity = [0.0, 0.0, -1.0]");
    let changed = |change: &dyn Fn(&mut Vec<DVec3>)| {
        let mut points = points();
        change(&mut points.positions);
        refusal(&leaf, points)
    };
    let why = changed(&|points| points.truncate(4));
    assert!(
        why.contains("4 points") && why.contains("at least 6"),
        "{why}"
    );
    let why = changed(&|points| points.reverse());
    assert!(
        why.contains("tip to base") && why.contains("turn their order"),
        "{why}"
    );
    let why = changed(&|points| {
        for k in 0..5 {
            points.swap(2 * k, 19 - 2 * k);
        }
    });
    assert!(why.contains("sort them from base to tip"), "{why}");
    let why = changed(&|points| points.iter_mut().for_each(|point| *point = DVec3::X));
    assert!(why.contains("in one place"), "{why}");
    let why = changed(&|points| points[3].x = f64::NAN);
    assert!(why.contains("point 4") && why.contains("finite"), "{why}");
}

/// Points in another unit than the scenario's, whose name is told if the scenario's is known.
#[test]
fn points_in_another_unit() {
    let weight = "load = { gravity = [0.0, 0.0, -1.0] }";
    let named = |unit: &str| parse(&format!("{ROD}{weight}\nunits = {{ length = \"{unit}\" }}"));
    let scaled = |factor: f64| {
        let mut points = points();
        points.positions.iter_mut().for_each(|it| *it *= factor);
        points
    };
    for (unit, factor, guess) in [
        ("cm", 10.0, "in mm?"),
        ("m", 100.0, "in cm?"),
        ("cm", 0.01, "in m?"),
        ("furlong", 10.0, "in another unit?"),
    ] {
        let why = refusal(&named(unit), scaled(factor));
        assert!(
            why.contains(guess) && why.contains("x=x:0.1") && why.contains("leaf.length"),
            "{why}"
        );
    }
    for factor in [7.9, 1.0 / 7.9] {
        assert!(unbend(&UnbendRequest::new(named("cm"), scaled(factor))).is_ok());
    }
    let second = UnbendRequest {
        second: Some(SecondPosture {
            points: scaled(10.0),
            roll: 0.0,
        }),
        ..UnbendRequest::new(named("cm"), points())
    };
    let why = unbend(&second).unwrap_err().to_string();
    assert!(
        why.starts_with("second posture") && why.contains("in mm?"),
        "{why}"
    );
    // A format that has a unit may have leaves of any length.
    let known = UnbendRequest {
        is_unit_known: true,
        ..UnbendRequest::new(named("cm"), scaled(10.0))
    };
    assert!(unbend(&known).is_ok());
}

/// A flat section on a line in space needs its normals; what is nearly in an upright plane is put there.
#[test]
fn the_directors_of_a_flat_section() {
    let flat = scenario(["0.1", "1.0", "5.0"], "gravity = [0.0, 0.0, -1.0]");
    let twin = Twin::draw(&mut Draw(3), true, 1.0);
    let positions: Vec<DVec3> = (0..30)
        .map(|k| twin.position(f64::from(k) / 29.0))
        .collect();
    let spatial = PosturePoints::in_space(positions.clone());
    let why = refusal(&flat, spatial);
    assert!(
        why.contains("normal_x") && why.contains("round section"),
        "{why}"
    );
    let along: Vec<DVec3> = (0..30)
        .map(|k| twin.tangent(f64::from(k) / 29.0)[0])
        .collect();
    let wrong = PosturePoints {
        normals: Some(along),
        ..PosturePoints::in_space(positions)
    };
    let refused = Posture::from_points(hanging(&flat), &wrong, None).unwrap_err();
    assert!(
        matches!(refused, PostureError::NormalAlong { .. }),
        "{refused}"
    );
    let mut draw = Draw(4);
    let twin = Twin::draw(&mut draw, false, 1.0);
    let noisy = measured(&|s| twin.position(s), 30, 2e-3, false, &mut draw);
    let put = Posture::from_points(hanging(&flat), &PosturePoints::in_space(noisy), None).unwrap();
    assert!(put.off_plane.is_some_and(|off| off > 1e-3 && off < 1e-2));
    let exact = posture(&flat, twin.curve(), Some(DVec3::Y));
    assert!((put.critical_young() / exact.critical_young() - 1.0).abs() < 0.05);
}
