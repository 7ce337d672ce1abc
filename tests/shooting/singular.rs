//! Where a leaf can move without resistance the equations are singular. That is
//! reported, with the veins that would move and the direction, and does not
//! keep the solution from being found.

use leafdyn::internals::shooting::{NeutralDirection, ShootingFailureReason, ShootingSolution};
use leafdyn_testing::*;

const STATIONS: [f64; 9] = [0.0, 0.125, 0.25, 0.375, 0.5, 0.625, 0.75, 0.875, 1.0];

/// Directions are measured by a small finite motion, whose square is 1e-10 of
/// lengths.
const MOTION: f64 = 1e-4;

/// The column of `classic/elastica_buckled` under a part of Euler's load.
fn column(part: f64) -> Scenario {
    let force = -part * PI * PI / 4.0;
    let entry = format!("load.tip_force=[{force:?}, 0, 0]");
    scenario("classic/elastica_buckled", &entry)
}

#[track_caller]
fn alone(scenario: &Scenario) -> ShootingSolution {
    shot_alone(scenario, &STATIONS)
}

/// What is said of a leaf of which this would move.
fn words(moves: &str) -> String {
    format!("a bifurcation is near, or the leaf can move without resistance; {moves}")
}

#[track_caller]
fn neutral(solution: ShootingSolution) -> NeutralDirection {
    let neutral = solution.neutral.expect("the equations are singular");
    assert_eq!(neutral.ratio, solution.condition);
    assert!(neutral.ratio < 1e-9, "{:.1e}", neutral.ratio);
    neutral
}

/// The mode 1 - cos(pi s/2) to either side, within the plane of buckling.
#[test]
fn a_column_at_eulers_load_would_move_sideways() {
    let column = column(1.0);
    let leaf = kept(&column, 1e-10);
    for shot in [alone(&column), shot_near(&column, &leaf)] {
        for node in &shot.rods[0].nodes {
            assert!(node.position.y.abs() + node.position.z.abs() < 1e-12);
        }
        let stations = shot.stations.clone();
        let neutral = neutral(shot);
        let said = words("vein 1 would move, mostly along y");
        assert_eq!(neutral.to_string(), said);
        let rod = only(&neutral.displacement);
        let side = rod.last().unwrap().y.signum();
        for (moved, sigma) in rod.iter().zip(stations) {
            let mode = DVec3::new(0.0, side * (1.0 - (0.5 * PI * sigma).cos()), 0.0);
            assert!((*moved - mode).length() < MOTION, "{moved} at {sigma}");
        }
    }
}

#[test]
fn off_eulers_load_nothing_is_reported() {
    for part in [0.999, 1.001] {
        let shot = alone(&column(part));
        assert!(shot.neutral.is_none());
        assert!(shot.condition > 1e-5, "{:.1e}", shot.condition);
    }
    // The equations lose one digit per digit that the load approaches it.
    let conditions = [1e-2, 1e-4, 1e-6].map(|off| alone(&column(1.0 - off)).condition / off);
    for condition in conditions {
        close("condition", condition / conditions[0], 1.0, 0.02);
    }
}

/// A round column may buckle to any side: its turn about e1 is no singularity.
#[test]
fn a_round_column_can_turn_about_its_axis() {
    for load in [2.5, 3.0, 5.0, 10.0] {
        let mut column = paper_leaf(1, [1.0; 3], [f64::INFINITY; 3], 0.0);
        column.rods[0].angle = 0.0;
        column.tip_force = [-load, 0.0, 0.0];
        let leaf = settle(&column, 1e-9);
        let bulge = tip(&leaf);
        assert!(bulge.y.hypot(bulge.z) > 0.1);
        let shot = shot_near(&column, &leaf);
        agree(&format!("P = {load}"), &column, &leaf, &shot, 1e-9);
        assert!(shot.neutral.is_none(), "the turn is known and left out");
    }
}

/// Two veins that meet head on: the pair can turn about the line through both
/// clamps and up or down alike.
#[test]
fn all_veins_of_a_pair_would_move() {
    let mut pair = paper_leaf(2, [1.0; 3], [100.0; 3], 0.0);
    pair.coupling = vec![[0.0; 3]];
    pair.rods[0].angle = 0.0;
    pair.rods[1].angle = PI;
    let leaf = settle(&pair, 1e-10);
    let shot = shot_near(&pair, &leaf);
    agree("pair", &pair, &leaf, &shot, 1e-9);
    let text = neutral(shot).to_string();
    assert!(text.contains("all veins would move"), "{text}");
}

/// A critical length of a lens and a critical weight of `tests/stability/bifurcations.rs`, without any eigenvalue being counted.
#[test]
fn published_bifurcations_are_seen() {
    let long = |length: f64| format!("leaf.length=[1.0, {length:?}, 1.0]");
    let lens = |length| scenario("classic/lens_midrib", &long(length));
    let heavy = |weight: f64| format!("load.gravity=[{weight:?}, 0, 0]");
    let hanging = |weight| scenario("classic/hanging_curved", &heavy(weight));
    let (length, weight) = (0.93780575743, 11.868750740620);
    for (leaf, moves) in [(lens(length), "all veins"), (hanging(weight), "vein 1")] {
        let text = neutral(alone(&leaf)).to_string();
        assert_eq!(text, words(&format!("{moves} would move, mostly along z")));
    }
    for off in [1.0 - 1e-3, 1.0 + 1e-3] {
        assert!(alone(&lens(off * length)).neutral.is_none());
        assert!(alone(&hanging(off * weight)).neutral.is_none());
    }
}

fn moving(displacements: &[[f64; 3]]) -> NeutralDirection {
    let rods = displacements.iter().map(|d| DVec3::from_array(*d));
    NeutralDirection {
        ratio: 1.5e-12,
        displacement: rods.map(|d| vec![DVec3::ZERO, 0.5 * d, d]).collect(),
    }
}

#[test]
fn what_moves_and_why_it_failed_is_put_into_words() {
    let all = [[1.0, 0.3, 0.3], [0.9, 0.3, 0.3]];
    let second = [[0.0, 0.1, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, 0.1]];
    let two = [[0.0, 1.0, 0.0], [0.0, 0.0, 0.0], [0.0, -0.5, 0.4]];
    for (displacements, wanted) in [
        (&[[0.0, 0.1, -1.0]][..], "vein 1 would move, mostly along z"),
        (&all, "all veins would move, mostly along x"),
        (&second, "vein 2 would move, mostly along y"),
        (&two, "veins 1, 3 would move, mostly along y"),
    ] {
        let (text, neutral) = (words(wanted), moving(displacements));
        assert_eq!(neutral.to_string(), text);
        let why = ShootingFailureReason::Singular(neutral).to_string();
        let because = "the equations are singular (ratio of singular values 1.5e-12)";
        assert_eq!(why, format!("{because}: {text}"));
    }
    let (sigma, correction, more) = (0.25, 2.5e-3, "use more intervals");
    let unbounded = |fixed, from_leaf| {
        ShootingFailureReason::Unbounded {
            sigma,
            fixed,
            from_leaf,
        }
        .to_string()
    };
    let grows =
        "integrated from the start, the leaf grows out of all bounds at 0.250 of its length";
    assert_eq!(unbounded(true, true), format!("{grows}: {more}"));
    // The program chose the number.
    let other = "lower the load, or start from the relaxed leaf";
    assert!(unbounded(false, false).ends_with(&format!("of its length: {other}")));
    // What began there is not sent there.
    assert!(unbounded(false, true).ends_with("more intervals than are allowed would be needed"));
    let stuck = |growth| {
        let fixed = true;
        ShootingFailureReason::NoConvergence {
            correction,
            growth,
            fixed,
            from_leaf: false,
        }
        .to_string()
    };
    let stops = "Newton's method stops at corrections of 2.5e-3";
    let grow = "perturbations grow 10^12 times over an interval";
    assert_eq!(stuck(12.2), format!("{stops}; {grow}: {more}"));
    assert_eq!(stuck(2.0), format!("{stops}: {other}"));
}
