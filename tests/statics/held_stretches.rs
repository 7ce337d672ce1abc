//! Stretches of veins whose places are held while their directions are free.

use leafdyn_testing::*;

/// A rod of length one along x with gravity, bent at rest by `bend_2` up and `bend_3` aside.
fn rod(shear: &str, bends: [f64; 2], grip: &str) -> String {
    format!(
        r#"
        name = "held"
        leaf = {{ rods = 1, length = 1.0, fan = [0.0] }}
        stiffness = {{ torsion = 0.5, bending_2 = 1.0, bending_3 = 3.0, axial = 1e3, shear_2 = {shear}, shear_3 = {shear} }}
        rest = {{ bend_2 = {:?}, bend_3 = {:?} }}
        load.gravity = [0.0, 0.0, -3.0]
        {grip}
        "#,
        bends[0], bends[1]
    )
}

fn pinned(at: [f64; 2], way: [f64; 3]) -> String {
    format!("[[grip]]\nvein = 1\nat = {at:?}\nheld = \"pinned\"\nmove = {way:?}")
}

/// Beyond a held stretch an unshearable vein without twist is a cantilever that is clamped there; before it,
/// one whose other end is clamped.
#[test]
fn holders_of_places_clamp_an_unshearable_vein() {
    let way = [-0.01, 0.0, 0.03];
    let [from, to] = [0.25, 0.5];
    let whole = settle(
        &parse(&rod("inf", [0.0, 0.0], &pinned([from, to], way))),
        1e-8,
    );
    let clamped = pinned([from, to], way).replace("pinned", "clamped");
    let clamped = settle(&parse(&rod("inf", [0.0, 0.0], &clamped)), 1e-8);
    let bars = [&whole, &clamped].map(|leaf| leaf.accuracy.error_estimate.unwrap());
    assert!(distance(&whole, &clamped) <= bars[0] + bars[1]);
    let beyond = rod("inf", [0.0, 0.0], "").replace("length = 1.0", "length = 0.5");
    let beyond = settle(&parse(&beyond), 1e-9);
    let tip = beyond.tips[0] + DVec3::new(0.5 + way[0], 0.0, way[2]);
    let off = whole.tips[0].distance(tip);
    assert!(off <= bars[0] + 1e-9, "{off:.1e}");
}

/// The rest of an unshearable vein that is bent in space, and twists, is the limit of that of ever stiffer ones: the
/// section at the end of the stretch turns by m / sqrt(A H).
#[test]
fn an_unshearable_vein_is_the_limit_of_stiff_ones() {
    let grip = pinned([0.35, 0.6], [0.02, -0.01, 0.03]);
    let tip = |shear: &str| settle(&parse(&rod(shear, [1.4, -0.8], &grip)), 1e-8).tips[0];
    let limit = tip("inf");
    let off = ["1e6", "1e8", "1e10"].map(|shear| tip(shear).distance(limit));
    for pair in off.windows(2) {
        let ratio = pair[0] / pair[1];
        assert!((ratio - 10.0).abs() < 0.2, "{off:?}");
    }
}

/// However fine the grid, Newton's method closes the law of the held segments in as many steps.
#[test]
fn steps_do_not_depend_on_the_grid() {
    let leaf = parse(&rod(
        "inf",
        [1.4, -0.8],
        &pinned([0.3, 0.65], [0.02, -0.01, 0.03]),
    ));
    let steps = [64, 256, 1024].map(|segments| settle_on(&leaf, segments, false).work.steps);
    assert!(
        steps.iter().all(|count| *count <= steps[0] + 3),
        "{steps:?}"
    );
}

/// The stated errors are bounds where a layer of shear at the end of the stretch, which is thinner than the segments,
/// turns all that is beyond.
#[test]
fn bars_know_of_layers_of_shear() {
    let mut compared = 0;
    for (case, at) in [[0.452, 0.625], [0.418, 0.635], [0.3, 0.36]]
        .into_iter()
        .enumerate()
    {
        for shear in ["1e4", "1e5", "1e7"] {
            let sign = [1.0, -1.0][case % 2];
            let leaf = rod(shear, [-1.9, 1.8 * sign], &pinned(at, [0.03, -0.03, -0.04]));
            let leaf = parse(&leaf);
            let exact = settle(&leaf, 1e-9);
            for tolerance in [1e-3, 1e-4, 1e-5] {
                let rough = settle(&leaf, tolerance);
                let bar = rough.accuracy.error_estimate.unwrap();
                let off = distance(&rough, &exact);
                assert!(
                    off <= bar + 1e-9,
                    "{at:?} {shear} {tolerance}: {off:.1e} > {bar:.1e}"
                );
                compared += 1;
            }
        }
    }
    assert_eq!(compared, 27);
}

/// Stations between the nodes of the solution are as accurate as these, within stretches and beside their ends.
#[test]
fn stations_beside_held_stretches_are_accurate() {
    for held in ["pinned", "clamped"] {
        for (at, shear) in [
            ([0.513, 0.658], "1e4"),
            ([0.323, 0.44], "1e3"),
            ([0.565, 0.643], "inf"),
        ] {
            let grip = pinned(at, [0.03, 0.012, -0.007]).replace("pinned", held);
            let leaf = parse(&rod(shear, [1.2, 0.7], &grip));
            let [rough, exact] = [1e-7, 1e-10]
                .map(|tolerance| settle(&leaf, tolerance).at_stations(&leaf, Some(90)));
            for found in [&rough, &exact] {
                assert!(
                    found.outcome.is_success(),
                    "{held} {at:?}: {:?}",
                    found.remark
                );
            }
            let bar = rough.accuracy.error_estimate.unwrap();
            let off = distance(&rough, &exact);
            assert!(off <= bar + 1e-10, "{held} {at:?}: {off:.1e} > {bar:.1e}");
            // Within the stretch the places are those of the natural leaf, moved.
            let within = rough
                .shape
                .stations
                .iter()
                .filter(|it| at[0] < **it && **it < at[1]);
            assert!(within.count() > 5);
        }
    }
}

/// A clamped stretch of an unshearable vein is brought to its place from anywhere: on the way its sections need not
/// have their distances.
#[test]
fn unshearable_veins_come_to_clamps() {
    let mut compared = 0;
    for at in [[0.394, 0.642], [0.471, 0.72], [0.25, 0.3]] {
        for bends in [[-2.2, -1.0], [1.3, 0.0], [2.5, 2.0]] {
            let grip = pinned(at, [0.043, 0.048, -0.048]).replace("pinned", "clamped");
            let [rigid, stiff] =
                ["inf", "1e10"].map(|shear| settle(&parse(&rod(shear, bends, &grip)), 1e-7));
            let bars = [&rigid, &stiff].map(|leaf| leaf.accuracy.error_estimate.unwrap());
            let off = distance(&rigid, &stiff);
            assert!(
                off <= bars[0] + bars[1] + 1e-8,
                "{at:?} {bends:?}: {off:.1e}"
            );
            compared += 1;
        }
    }
    assert_eq!(compared, 9);
}

/// A vein that is clamped at both ends of a span and moved across bends antisymmetrically: in its middle all grids agree.
/// The shape beyond the clamp is that of the natural leaf, and that of the span a cubic that tension flattens.
#[test]
fn antisymmetric_spans_are_seen() {
    for (at, tolerance) in [
        ("[0.25, 0.5]", 1e-6),
        ("0.25", 1e-8),
        ("[0.125, 0.5]", 1e-6),
    ] {
        let leaf = |axial: &str| {
            parse(&format!(
                r#"
                name = "span"
                leaf = {{ rods = 1, length = 1.0, fan = [0.0] }}
                stiffness = {{ torsion = 1.0, bending_2 = 1.0, bending_3 = 1.0, axial = {axial}, shear_2 = inf, shear_3 = inf }}
                [[grip]]
                vein = 1
                at = {at}
                held = "clamped"
                move = [0.0, 0.02, 0.0]
                "#
            ))
        };
        for axial in ["1e3", "5e5"] {
            let leaf = leaf(axial);
            let found = settle(&leaf, tolerance).at_stations(&leaf, Some(32));
            let exact = settle_on(&leaf, 2048, false).at_stations(&leaf, Some(32));
            let bar = found.accuracy.error_estimate.unwrap();
            let off = distance(&found, &exact);
            assert!(off <= bar + 1e-6, "{at} {axial}: {off:.1e} > {bar:.1e}");
        }
    }
}
