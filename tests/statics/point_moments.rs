//! Dead moments on points of a single rod: closed forms, and shooting.

use leafdyn::relax::{EquilibriumRemark, relax};
use leafdyn::study::relax_with_margin;
use leafdyn_testing::*;

const ROD: &str = r#"
    name = "rod"
    leaf = { rods = 1, length = 1.0, fan = [0.0] }
    stiffness = { torsion = 0.8, bending_2 = 1.0, bending_3 = 1.4, axial = 90.0, shear_2 = inf, shear_3 = 60.0 }
"#;

/// The rod under moments on points, with more.
fn under(moments: &[(f64, [f64; 3])], more: &str) -> Scenario {
    let point = |(at, moment): &(f64, [f64; 3])| {
        format!("\n[[load.point]]\nvein = 1\nat = {at:?}\nmoment = {moment:?}")
    };
    let points: String = moments.iter().map(point).collect();
    parse(&format!("{ROD}\n{more}{points}"))
}

/// Plane arcs of these lengths and curvatures, one after the other: the end of each, and the angle.
fn arcs(pieces: &[(f64, f64)]) -> Vec<(DVec3, f64)> {
    let (mut x, mut angle) = (DVec3::ZERO, 0.0_f64);
    let mut ends = Vec::new();
    for (length, curvature) in pieces {
        let next = angle + length * curvature;
        let half = 0.5 * length * curvature;
        let chord = if half == 0.0 { 1.0 } else { half.sin() / half };
        let mean = angle + half;
        x += length * chord * DVec3::new(mean.cos(), mean.sin(), 0.0);
        angle = next;
        ends.push((x, angle));
    }
    ends
}

/// A moment in the middle bends the part before it to an arc of the curvature M/EI; the other stays
/// straight, and carries nothing.
#[test]
fn an_arc_to_the_middle_and_straight_from_there() {
    for moment in [0.7, -3.0, 2.0 * PI, 9.0 * PI] {
        for at in [0.5, 0.37] {
            let leaf = Both::of(&under(&[(at, [0.0, 0.0, moment])], ""));
            let curvature = moment / 1.4;
            let wanted = arcs(&[(at, curvature), (1.0 - at, 0.0)]);
            leaf.tip_is("tip", wanted[1].0, 1e-9, 1e-9);
            for rods in leaf.shapes() {
                for (&sigma, node) in leaf.relaxed.shape.stations.iter().zip(&rods[0].nodes) {
                    let angle = curvature * sigma.min(at);
                    let tangent = node.rotation * DVec3::X;
                    let exact = DVec3::new(angle.cos(), angle.sin(), 0.0);
                    assert!((tangent - exact).length() < 1e-9, "{moment} at {sigma}");
                    // At the point it is the moment just before it.
                    let carried = if sigma <= at { moment } else { 0.0 };
                    assert!((node.m - carried * DVec3::Z).length() < 1e-9, "{sigma}");
                    assert!(node.n.length() < 1e-9, "{sigma}");
                }
            }
            let strain = 0.5 * moment * curvature * at;
            for energy in [leaf.relaxed.energy.unwrap(), leaf.shot.energy] {
                close("energy", energy, strain, 1e-9);
            }
            assert_eq!(leaf.relaxed.stability.negative_eigenvalues, None);
        }
    }
}

/// Each part carries the moments beyond it, that on the tip among them, in whichever way it is
/// written.
#[test]
fn every_part_carries_the_moments_beyond_it() {
    let about = |z: f64| [0.0, 0.0, z];
    let (first, second, last) = (1.5, -4.0, 2.2);
    let wanted = arcs(&[
        (0.3, (first + second + last) / 1.4),
        (0.25, (second + last) / 1.4),
        (0.45, last / 1.4),
    ]);
    let points = [(0.3, about(first)), (0.55, about(second))];
    let tip = under(&points, &format!("load.tip_moment = [0.0, 0.0, {last}]"));
    let three = under(&[points[0], points[1], (1.0, about(last))], "");
    let halves = [points[0], (0.3, about(0.0)), points[1], (1.0, about(1.0))];
    let halves = under(&halves, "load.tip_moment = [0.0, 0.0, 1.2]");
    for leaf in [tip, three, halves] {
        let leaf = Both::of(&leaf);
        leaf.tip_is("tip", wanted[2].0, 1e-9, 1e-9);
        let angle = wanted[2].1;
        for rods in leaf.shapes() {
            let tangent = tip_node(rods, 0).rotation * DVec3::X;
            assert!(tangent.distance(DVec3::new(angle.cos(), angle.sin(), 0.0)) < 1e-9);
        }
    }
}

/// More turns than are applied by steps.
#[test]
fn hundreds_of_turns_are_found() {
    let moment = 1400.0;
    let leaf = settle(&under(&[(0.5, [0.0, 0.0, moment])], ""), 1e-6);
    let off = tip(&leaf).distance(arcs(&[(0.5, moment / 1.4), (0.5, 0.0)])[1].0);
    assert!(off <= estimate(&leaf), "{off:.1e}");
}

/// In space, with forces and weight.
#[test]
fn relaxation_and_shooting_agree() {
    let more =
        "load.gravity = [0.1, -0.2, -0.6]\nrest = { twist = 0.4, bend_2 = 0.3, bend_3 = -0.5 }";
    for (moments, more) in [
        (vec![(0.5, [0.4, 0.5, -0.6])], more),
        (
            vec![(0.31, [-0.9, 0.7, 0.3]), (0.72, [0.2, -0.8, 0.9])],
            more,
        ),
        (
            vec![(0.4, [0.5, 0.6, 0.3]), (1.0, [0.3, -0.2, 0.5])],
            "load.tip_moment = [0.2, 0.3, 0.1]\nload.tip_force = [0.4, -0.3, 0.5]",
        ),
        (
            vec![(0.45, [0.5, 0.6, 0.3])],
            "tip = { held = \"pinned\", position = [0.8, 0.1, 0.2] }",
        ),
        (
            vec![(0.45, [0.5, 0.6, 0.3]), (0.7, [0.1, -0.5, 0.2])],
            "tip = { held = \"clamped\", position = [0.8, 0.1, 0.2], angles = 0.3, twist = 0.4 }\nload.gravity = [0.0, 0.0, -1.0]",
        ),
    ] {
        all_agree(more, &under(&moments, more));
    }
}

/// Clamped in line at both ends, a twist moment in the middle is borne by both halves alike; beyond
/// it, by the shorter part more, in inverse proportion to their lengths.
#[test]
fn two_clamps_share_a_twist_moment() {
    let held = "tip = { held = \"clamped\", position = [1.0, 0.0, 0.0] }";
    for (at, moment) in [(0.5, 0.6), (0.25, -0.6), (0.5, 3.0)] {
        let leaf = Both::of(&under(&[(at, [moment, 0.0, 0.0])], held));
        let (before, after) = (moment * (1.0 - at), -moment * at);
        for rods in leaf.shapes() {
            for (&sigma, node) in leaf.relaxed.shape.stations.iter().zip(&rods[0].nodes) {
                assert!(node.position.distance(sigma * DVec3::X) < 1e-9, "{sigma}");
                let carried = if sigma <= at { before } else { after };
                assert!((node.m - carried * DVec3::X).length() < 1e-9, "{sigma}");
                let beyond = (sigma - at).max(0.0);
                let turned = (before * sigma.min(at) + after * beyond) / 0.8;
                let angle = 2.0 * node.rotation.x.atan2(node.rotation.w);
                close("angle", angle, turned, 1e-9);
            }
        }
        let felt = leaf.relaxed.reaction.as_ref().unwrap();
        let felt = only(felt.moments.as_ref().unwrap());
        assert!(
            felt.distance(DVec3::new(moment * at, 0.0, 0.0)) < 1e-8,
            "{felt}"
        );
    }
}

/// What acts on a clamp bends nothing: its holder feels it.
#[test]
fn a_clamp_takes_the_moment_on_it() {
    let moment = [0.3, -0.4, 0.5];
    let grip = "grip = [{ vein = 1, at = 0.5, held = \"clamped\", move = [-0.02, 0.1, 0.1] }]";
    let tip = "tip = { held = \"clamped\", position = [0.9, 0.1, 0.1] }";
    for (how, at) in [(grip, 0.5), (tip, 1.0)] {
        let [bare, loaded] =
            [vec![], vec![(at, moment)]].map(|moments| settle(&under(&moments, how), 1e-9));
        assert!(distance(&bare, &loaded) < 2e-9, "{how}");
        let felt = |leaf: &Equilibrium| match leaf.reaction.as_ref() {
            Some(tip) => *only(tip.moments.as_ref().unwrap()),
            None => only(&leaf.grip_reactions).moment.unwrap(),
        };
        let off = (felt(&loaded) - felt(&bare)).distance(DVec3::from_array(moment));
        assert!(off < 1e-7, "{how}: {off:.1e}");
    }
}

/// What acts within rounding of the base is left to its clamp.
#[test]
fn a_moment_on_the_base_bends_nothing() {
    let pulled = "load.tip_force = [0.2, 0.1, -0.3]";
    let bare = settle(&under(&[], pulled), 1e-9);
    let loaded = settle(&under(&[(1e-13, [0.3, -0.4, 0.5])], pulled), 1e-9);
    assert!(distance(&bare, &loaded) < 2e-9);
}

/// Between grips the rod comes to rest as between two clamped ends.
#[test]
fn a_part_between_grips_is_a_rod_with_two_clamped_ends() {
    let half = ROD.replace("length = 1.0", "length = 0.5");
    let tip = "tip = { held = \"clamped\", position = [0.45, 0.1, 0.05] }";
    let point = "[[load.point]]\nvein = 1\nat = 0.5\nmoment = [0.5, 0.9, -0.7]";
    let alone = settle(&parse(&format!("{half}\n{tip}\n{point}")), 1e-9);
    let grip = "grip = [{ vein = 1, at = 0.5, held = \"clamped\", move = [-0.05, 0.1, 0.05] }]";
    let whole = settle(&under(&[(0.25, [0.5, 0.9, -0.7])], grip), 1e-9);
    let bars = estimate(&alone) + estimate(&whole);
    let mut compared = 0;
    for (sigma, node) in alone.shape.stations.iter().zip(&alone.shape.rods[0].nodes) {
        let stations = &whole.shape.stations;
        if let Some(k) = stations.iter().position(|at| *at == 0.5 * sigma) {
            let off = node
                .position
                .distance(whole.shape.rods[0].nodes[k].position);
            assert!(off <= bars, "{sigma}: {off:.1e}, {bars:.1e}");
            compared += 1;
        }
    }
    assert!(compared > 4);
}

/// Wherever it is along the vein, the estimated error is a bound, also where the leaf is integrated
/// across the point.
#[test]
fn moments_anywhere_are_within_the_bars() {
    let more = "load.gravity = [0.2, 0.1, -0.7]";
    for at in [0.07, 0.29, 0.36, 0.5, 0.77, 0.93] {
        let scenario = under(&[(at, [0.6, -0.9, 1.4])], more);
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

#[test]
fn the_order_on_grids_is_the_second() {
    for at in [0.25, 0.5, 0.875] {
        let scenario = under(&[(at, [0.6, -0.9, 1.4])], "load.gravity = [0.2, 0.1, -0.7]");
        let best = tip(&settle(&scenario, 1e-11));
        let off = [32, 64, 128].map(|n| tip(&settle_on(&scenario, n, false)).distance(best));
        for pair in off.windows(2) {
            close("order", order(pair[0], pair[1]), 2.0, 0.02);
        }
    }
}

/// All forces and moments on the rod are in balance.
#[test]
fn the_clamp_bears_the_sum_of_the_moments() {
    let points = [(0.3, [0.4, 0.5, -0.6]), (0.8, [-0.2, 0.9, 0.1])];
    let leaf = settle(&under(&points, "load.tip_force = [0.2, 0.1, -0.3]"), 1e-10);
    let (force, moment) = in_lab(&leaf.shape.rods[0].nodes[0]);
    let sum: DVec3 = points.iter().map(|(_, it)| DVec3::from_array(*it)).sum();
    let arm = tip(&leaf).cross(DVec3::new(0.2, 0.1, -0.3));
    assert!(force.distance(DVec3::new(0.2, 0.1, -0.3)) < 1e-8);
    assert!(moment.distance(sum + arm) < 1e-8, "{moment}");
}

/// Without a potential there is no energy to descend, and no barrier; nor is a count of eigenvalues
/// stated.
#[test]
fn what_needs_an_energy_is_refused() {
    let mut scenario = under(&[(0.5, [0.0, 0.0, 0.3])], "");
    scenario.rods[0].force_stiffness[1] = Profile::Constant(80.0);
    let named = |message: String| assert!(message.contains("load.point.moment"), "{message}");
    let explicit = Options {
        method: Method::Explicit { segments: None },
        ..Options::default()
    };
    named(
        relax(&scenario, &explicit, &mut |_| {})
            .unwrap_err()
            .to_string(),
    );
    let margin = relax_with_margin(&scenario, &Options::default(), &mut |_| {});
    named(margin.unwrap_err().to_string());
    let leaf = settle(&scenario, 1e-6);
    assert_eq!(leaf.stability.negative_eigenvalues, None);
    assert!(matches!(
        leaf.remark,
        Some(EquilibriumRemark::MomentWithoutPotential { verdict: Some(_) })
    ));
}
