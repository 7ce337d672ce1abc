//! Places of several tables that are meant to be one and differ by rounding, or by the digits that were written, are
//! read as one: steps and kinks of profiles, points that are loaded, and grips. Closed forms, and shooting.

use leafdyn::relax::EquilibriumDoubt;
use leafdyn_testing::*;

/// How far apart what is meant to be one place is, in fractions of the length.
const APART: [f64; 7] = [1e-15, 3e-12, 1e-11, 1e-10, 1e-9, 3.3e-8, 4e-7];

/// A rod of two pieces, of which other tables say that they meet `by` later: stretched by a force F on the joint and T
/// on the tip, its tip is at 1 + (F + T) a/H + T (1 - a)/H', within what the places leave open.
#[test]
fn pieces_of_a_stretched_rod_that_meet_nearly() {
    let (joint, at_joint, at_tip) = (0.3, 2.0, 3.0);
    let [first, second] = [100.0, 50.0];
    let wanted = 1.0 + (at_joint + at_tip) * joint / first + at_tip * (1.0 - joint) / second;
    for by in APART {
        let [a, b, c] = [joint, joint + by, joint + 0.6 * by];
        let text = format!(
            "name = 'pieces'\nleaf = {{ rods = 1, length = 1.0, fan = [0.0] }}\n[stiffness]\ntorsion = 1.0\n\
             bending_2 = {{ at = [0.0, {c:?}, {c:?}, 1.0], value = [1.0, 1.0, 0.5, 0.5] }}\nbending_3 = 1.0\n\
             axial = {{ at = [0.0, {a:?}, {a:?}, 1.0], value = [100.0, 100.0, 50.0, 50.0] }}\n\
             shear_2 = {{ at = [0.0, {b:?}, 1.0], value = [90.0, 70.0, 60.0] }}\nshear_3 = 80.0\n\
             [load]\ntip_force = [{at_tip:?}, 0.0, 0.0]\n[[load.point]]\nvein = 1\nat = {b:?}\nforce = [{at_joint:?}, 0.0, 0.0]"
        );
        let found = settle(&parse(&text), 1e-8);
        let open = by * (at_joint + at_tip) / second;
        let off = (tip(&found) - wanted * DVec3::X).length();
        assert!(off <= open + 1e-9, "{by:e}: {off:.1e}");
        assert!(*found.accuracy.segments.last().unwrap() <= 64, "{by:e}");
    }
}

/// A leaf of everything that has places: shooting, which has neither a grid nor its rounding, reads the same ones.
fn crowded(by: f64) -> String {
    let [a, b, c] = [1.0 / 3.0, 1.0 / 3.0 + by, 1.0 / 3.0 - 0.5 * by];
    format!(
        "name = 'crowded'\nleaf = {{ rods = 1, length = 1.0, fan = [0.2] }}\n[stiffness]\ntorsion = 0.7\n\
         bending_2 = {{ at = [0.0, {a:?}, 0.6, 1.0], value = [1.5, 1.2, 0.6, 0.3] }}\n\
         bending_3 = {{ at = [0.0, {b:?}, {:?}, 1.0], value = [1.4, 1.0, 0.7, 0.3] }}\n\
         axial = 500.0\nshear_2 = inf\nshear_3 = inf\n\
         [rest]\nbend_2 = {{ at = [0.0, {c:?}, {c:?}, 1.0], value = [0.0, 0.5, -1.0, 1.0] }}\n\
         [dynamics]\ndensity = {{ at = [0.0, {b:?}, 1.0], value = [1.0, 0.9, 0.2] }}\n\
         [load]\ng = [0.3, 0.4, -2.0]\n[[load.point]]\nvein = 1\nat = {:?}\nforce = [0.0, 0.3, -0.5]",
        0.6 - 0.7 * by,
        0.6 + 0.3 * by,
    )
}

#[test]
fn nearly_equal_places_rest_as_equal_ones() {
    let exact = settle(&parse(&crowded(0.0)), TIGHT);
    for by in APART {
        let leaf = parse(&crowded(by));
        let (relaxed, _) = all_agree("crowded", &leaf);
        let off = tip(&relaxed).distance(tip(&exact));
        assert!(off <= 0.3 * by + 1e-10, "{by:e}: {off:.1e}");
        let [fine, usual] = [&relaxed, &exact].map(|it| *it.accuracy.segments.last().unwrap());
        assert!(fine <= 2 * usual, "{by:e}: {fine} {usual}");
    }
}

/// Where the places of a held rod differ by less than they are told apart, so does what the holder bears.
#[test]
fn a_grip_beside_a_knot_is_at_the_knot() {
    let gripped = |by: f64| {
        let grip = format!(
            "\n[[grip]]\nvein = 1\nat = {:?}\nmove = [0.0, 0.01, 0.0]",
            1.0 / 3.0 + 0.2 * by
        );
        settle(&parse(&(crowded(by) + &grip)), 1e-8)
    };
    let exact = gripped(0.0);
    for by in APART {
        let found = gripped(by);
        let off = tip(&found).distance(tip(&exact));
        assert!(off <= by + 1e-8, "{by:e}: {off:.1e}");
    }
}

/// Where the shift may be more than the error that is told, a doubt says so.
#[test]
fn shifts_beyond_the_error_are_told() {
    let moved = |by: f64, tolerance: f64| {
        let found = settle(&parse(&crowded(by)), tolerance);
        let mut doubts = found.doubts.into_iter();
        doubts.find_map(|doubt| match doubt {
            EquilibriumDoubt::MovedPlaces { shift } => Some(shift),
            _ => None,
        })
    };
    let told = moved(4e-7, 1e-9).unwrap();
    assert!((4e-7..=6e-7 + 1e-15).contains(&told), "{told:e}");
    assert_eq!(
        [(0.0, 1e-9), (1e-13, 1e-9)].map(|(by, within)| moved(by, within)),
        [None; 2]
    );
    assert_eq!(moved(1e-8, 1e-5), None);
}

/// A ramp too short for a segment is a step, a value that is reached on it and left again is refused, and so is a
/// stretch that is none.
#[test]
fn what_is_too_short_for_a_segment() {
    let with = |profile: &str, more: &str| {
        Scenario::from_toml(&format!(
            "leaf = {{ rods = 1, length = 1.0, fan = [0.0] }}\nstiffness = {{ torsion = 1.0, bending_2 = {profile}, \
             bending_3 = 1.0, axial = inf, shear_2 = inf, shear_3 = inf }}\n{more}"
        ))
    };
    let ramp = "{ at = [0.0, 0.4, 0.4000002, 0.4000005, 1.0], value = [2.0, 2.0, 1.5, 0.5, 0.5] }";
    let step = "{ at = [0.0, 0.4, 0.4, 1.0], value = [2.0, 2.0, 0.5, 0.5] }";
    let profile = |text: &str| with(text, "").unwrap().rods[0].couple_stiffness[1].clone();
    assert_eq!(profile(ramp), profile(step));
    let at_ends = "{ at = [0.0, 1e-8, 0.9999999, 1.0], value = [3.0, 2.0, 1.0, 0.5] }";
    let plain = "{ at = [0.0, 1.0], value = [2.0, 1.0] }";
    assert_eq!(profile(at_ends), profile(plain));
    let hinge =
        "{ at = [0.0, 0.4, 0.4000002, 0.4000005, 1.0], value = [2.0, 2.0, 1e-6, 2.0, 2.0] }";
    let refused = |found: Result<Scenario, leafdyn::scenario::ScenarioError>, why: &str| {
        let error = found.unwrap_err().to_string();
        assert!(error.contains(why), "{error}");
    };
    refused(with(hinge, ""), "within 1e-6 of the length");
    let grip = |at: &str| format!("[[grip]]\nvein = 1\nat = {at}");
    refused(with("1.0", &grip("[0.5, 0.5000003]")), "shorter than 1e-6");
    refused(with("1.0", &grip("[0.5, 0.4]")), "must rise");
    refused(with("1.0", &grip("1e-8")), "within 1e-6 of the base");
    let touching = format!(
        "{}\n{}",
        grip("[0.2, 0.3333333]"),
        grip("[0.33333334, 0.5]")
    );
    refused(with("1.0", &touching), "is held by grip[0], too");
}
