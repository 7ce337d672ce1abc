//! Speed against accuracy of motions: what is charted is what the methods promise.

use leafdyn::study::{Chart, ChartOptions, ChartOutcome, ChartRow, PeerMeasurement, chart};
use leafdyn_testing::*;

/// A rod that is let go and swings, with a little friction.
const SWINGING: &str = r#"
    name = "swinging"
    leaf = { rods = 1, length = 1.0, fan = [0.0] }
    stiffness = { torsion = 1.0, bending_2 = 1.0, bending_3 = 1.5, axial = 60.0, shear_2 = 40.0, shear_3 = 40.0 }
    load = { gravity = [0.0, 0.2, -1.5] }
    dynamics = { density = 1.0, rotary_inertia = 0.01, external_damping = 0.3, duration = 1.0, output_interval = 0.1, start = "released" }
"#;

/// Seconds of a chart whose rows are compared: the runs for its reference end by the clock, on a machine
/// that does other work, too, long after three grids.
const AMPLE: f64 = 6.0;

/// Seconds of a chart of which only the outcomes matter.
const SHORT: f64 = 0.5;

fn charted(text: &str, seconds: f64, more: ChartOptions) -> Chart {
    let options = ChartOptions {
        seconds,
        motion: true,
        ..more
    };
    chart(&parse(text), &options, &mut |_| {}).unwrap()
}

fn errors(found: &Chart, word: &str) -> Vec<f64> {
    let rows = found.rows.iter().filter(|row| row.contender.word() == word);
    rows.filter_map(|row| row.true_error).collect()
}

/// Both methods find the same motion, and on single grids their errors go with the square of the length of
/// segments; where motions are refined, their bars cover the true errors.
#[test]
fn both_methods_are_charted_against_what_they_agree_on() {
    let found = charted(SWINGING, AMPLE, ChartOptions::default());
    let reference = found.reference.as_ref().unwrap();
    assert!(found.motion && reference.confirmed, "{}", reference.told);
    assert!(reference.known_within < 1e-4, "{reference:?}");
    for word in ["semi-implicit-grid", "explicit-grid"] {
        let errors = errors(&found, word);
        let clear: Vec<f64> = errors
            .into_iter()
            .filter(|error| *error > 20.0 * reference.known_within)
            .collect();
        assert!(clear.len() >= 3, "{word}: {clear:?}");
        for pair in clear.windows(2).skip(1) {
            assert!(
                (2.5..6.5).contains(&(pair[0] / pair[1])),
                "{word}: {clear:?}"
            );
        }
    }
    let covered = |row: &&ChartRow| {
        let bar = row.error_estimate.unwrap() + reference.known_within;
        assert!(row.true_error.unwrap() <= bar, "{row:?}");
    };
    let refined = ["semi-implicit", "explicit"];
    let rows = found
        .rows
        .iter()
        .filter(|row| refined.contains(&row.contender.word()));
    let moved = rows.filter(|row| row.ending == ChartOutcome::Moved(None));
    assert!(moved.inspect(covered).count() >= 4);
}

/// A rigid rod is moved by the semi-implicit method alone, and nothing confirms it.
#[test]
fn a_method_that_cannot_move_the_leaf_is_told() {
    let rigid = SWINGING.replace("axial = 60.0", "axial = inf");
    let found = charted(&rigid, SHORT, ChartOptions::default());
    assert!(!found.is_reference_confirmed());
    assert_eq!(found.default.word(), "semi-implicit");
    let told: Vec<String> = found.remarks.iter().map(ToString::to_string).collect();
    let told = told
        .iter()
        .filter(|it| it.contains("no stable time step for rigid rods"));
    assert_eq!(told.count(), 2);
}

/// Of other programs motions count here, and searches for equilibria there.
#[test]
fn peers_are_asked_the_same_question() {
    let peer = |outcome: &str| PeerMeasurement {
        program: "other".into(),
        scenario: "swinging".into(),
        rods: 1,
        knob: "n=10".into(),
        seconds: 1.0,
        error: Some(1e-3),
        outcome: outcome.into(),
    };
    let options = ChartOptions {
        peers: vec![peer("completed"), peer("at-rest")],
        ..ChartOptions::default()
    };
    let found = charted(SWINGING, SHORT, options);
    let outcomes: Vec<&str> = found.peers.iter().map(|peer| &peer.outcome[..]).collect();
    assert_eq!(outcomes, ["completed"]);
    assert!(found.peers[0].ratio.unwrap() > 1.0);
}
