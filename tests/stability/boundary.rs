//! The boundary of stability over two numbers: curves known in closed form or by
//! collocation, all along, and the leaves on their sides: equilibria of the index that they
//! tell, or what the stable leaf of the one side comes to rest as beyond.

use leafdyn::study::{BoundaryCurve, BoundaryPoint, LeafBeside, StabilityBoundary};
use leafdyn_testing::branch::{text, weak_veins};
use leafdyn_testing::plane::{follow, followed};
use leafdyn_testing::*;

/// The only curve, which goes from one end of the second range to the other.
#[track_caller]
fn only(found: &StabilityBoundary) -> &BoundaryCurve {
    assert!(found.complete, "{:?}", found.remark);
    assert_eq!(found.curves.len(), 1);
    let curve = &found.curves[0];
    for (point, end) in ends(curve).into_iter().zip(found.ranges[1]) {
        assert_eq!(point.values[1], end, "{:?}", curve.ends);
        assert_eq!(point.errors[1], 0.0);
    }
    curve
}

/// The first point of a curve and the last.
fn ends(curve: &BoundaryCurve) -> [&BoundaryPoint; 2] {
    [curve.points.first(), curve.points.last()].map(Option::unwrap)
}

/// By what part the first number of a point is off.
fn off(point: &BoundaryPoint, wanted: f64) -> f64 {
    (point.values[0] / wanted - 1.0).abs()
}

/// Distance of its tip from the axis.
fn off_axis(tip: DVec3) -> f64 {
    tip.y.hypot(tip.z)
}

/// The tip of the leaf that a relaxation from arcs finds at both numbers.
fn tip_at_rest(text: &str, entries: &str) -> DVec3 {
    tip(&relaxed(base(text, entries).scenario(), &to(1e-8)))
}

/// The leaves on either side of a curve.
#[track_caller]
fn beside(curve: &BoundaryCurve) -> &[LeafBeside; 2] {
    curve.beside.as_slice().try_into().expect("two leaves")
}

/// That along the curve the first number is what it must be at the second, within this part
/// and within what is stated; and the index changes from 0 to 1.
#[track_caller]
fn is(what: &str, curve: &BoundaryCurve, wanted: impl Fn(f64) -> f64, within: f64) {
    assert!(curve.points.len() > 5, "{what}: {}", curve.points.len());
    let mut worst = 0.0_f64;
    for point in &curve.points {
        let wanted = wanted(point.values[1]);
        let off = (point.values[0] - wanted).abs();
        worst = worst.max(off / wanted.abs());
        let stated = point.errors[0] + 1e-11 * wanted.abs();
        assert!(off <= stated, "{what}: off by {off:.1e}: {point:?}");
        assert_eq!([point.index_before, point.index_behind], [0, 1], "{what}");
        assert_eq!(point.kind, "branch-point");
    }
    assert!(worst < within, "{what}: off by {worst:.1e}");
}

/// P = pi^2/4 EI of an inextensible column.
#[test]
fn euler_over_the_bending_stiffness() {
    let strip = format!("{RIGID}; stiffness.bending_2=1000.0");
    let (load, stiffness) = ("load.tip_force[0]=0..-5.5", "stiffness.bending_3=0.5..2");
    let found = follow(ROD, &strip, load, stiffness);
    is("Euler", only(&found), |ei| -0.25 * PI * PI * ei, 1e-8);
}

/// A column is straight on one side of Euler's load, buckled on the other; across the next
/// load straight with one more way to buckle.
#[test]
fn columns_on_both_sides_of_their_loads() {
    let strip = format!("{RIGID}; stiffness.bending_2=1000.0");
    for (number, load) in ["0..-10", "-10..-30"].iter().enumerate() {
        let load = format!("load.tip_force[0]={load}");
        let found = follow(ROD, &strip, &load, "stiffness.bending_3=0.8..1.2");
        assert_eq!(found.curves.len(), 1);
        let [low, high] = beside(&found.curves[0]);
        let critical = |leaf: &LeafBeside| ((0.5 + number as f64) * PI).powi(2) * leaf.values[1];
        assert!(-low.values[0] < critical(low), "{:?}", low.values);
        assert!(-high.values[0] > critical(high), "{:?}", high.values);
        assert_eq!([low.index, high.index], [number, 2 * number]);
        assert!(low.fallen_from.is_none());
        assert_eq!(high.fallen_from.is_some(), number == 0);
        assert!(off_axis(low.tips[0]) < 1e-9);
        let [load, ei] = high.values;
        let set = format!("{strip}; load.tip_force=[{load:?},0,0]; stiffness.bending_3={ei:?}");
        match number {
            0 => {
                let (tip, wanted) = (high.tips[0], tip_at_rest(ROD, &set));
                assert!(off_axis(tip) > 0.1, "{tip}");
                assert!((tip.x - wanted.x).abs() < 2e-3, "{tip} {wanted}");
                assert!((off_axis(tip) - off_axis(wanted)).abs() < 2e-3);
            }
            _ => assert!(off_axis(high.tips[0]) < 1e-9),
        }
    }
}

/// P (1 + P/GA - P/EA) = pi^2/4 EI, over EA and over its logarithm.
#[test]
fn reissner_over_the_axial_stiffness() {
    let strip = "stiffness.bending_2=1000.0; stiffness.axial=1000.0; \
                 stiffness.shear_2=400.0; stiffness.shear_3=400.0";
    let load = |axial: f64| {
        let (a, euler) = (1.0 / 400.0 - 1.0 / axial, 0.25 * PI * PI);
        // The root that is Euler's where a is zero.
        -2.0 * euler / (1.0 + (1.0 + 4.0 * a * euler).sqrt())
    };
    for range in ["50..2000", "50..5000:11log"] {
        let across = format!("stiffness.axial={range}");
        let found = follow(ROD, strip, "load.tip_force[0]=0..-5", &across);
        is(range, only(&found), load, 1e-8);
    }
}

/// Where a function changes its sign between two numbers, to the last digit.
fn bisect(mut low: f64, mut high: f64, f: impl Fn(f64) -> f64) -> f64 {
    let sign = f(low).signum();
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        match f(middle) * sign > 0.0 {
            true => low = middle,
            false => high = middle,
        }
    }
    0.5 * (low + high)
}

/// Greenhill's column of weight q with a load P on its tip, both pushing: theta'' + (P + q t)
/// theta = 0 from the tip, where theta' = 0, to the base, where theta = 0; by power series.
#[test]
fn greenhill_over_the_tip_load() {
    let at_the_base = |q: f64, p: f64| {
        let mut a = vec![1.0, 0.0, -0.5 * p];
        for n in 1..60 {
            a.push(-(p * a[n] + q * a[n - 1]) / ((n + 2) * (n + 1)) as f64);
        }
        a.iter().sum::<f64>()
    };
    let weight = |p: f64| bisect(0.0, 20.0, |q| at_the_base(q, p));
    // 9/4 of the square of the first zero of J_{-1/3}, without a tip load.
    assert!((weight(0.0) - 7.837347438943484).abs() < 1e-13);
    let strip = format!("{RIGID}; stiffness.bending_2=1000.0");
    let (along, across) = ("load.gravity[0]=0..-12", "load.tip_force[0]=-1..1");
    let found = follow(ROD, &strip, along, across);
    is("Greenhill", only(&found), |force| -weight(-force), 1e-8);
}

/// Two directions at once, as long as a column is round: sideways and up and down together.
#[test]
fn a_round_column_buckles_in_two_directions_all_along() {
    let round = "stiffness.axial=1000; stiffness.shear_2=1000; stiffness.shear_3=1000";
    let both = "stiffness.bending_2+stiffness.bending_3=0.5..2";
    let found = follow(ROD, round, "load.tip_force[0]=0..-5.5", both);
    let curve = only(&found);
    assert_eq!(curve.multiplicity, 2);
    for point in &curve.points {
        let wanted = -0.25 * PI * PI * point.values[1];
        assert!(off(point, wanted) < 1e-8, "{point:?}");
        assert_eq!([point.index_before, point.index_behind], [0, 2]);
    }
    // Not if one of the stiffnesses changes alone.
    let (load, one) = ("load.tip_force[0]=0..-5.5", "stiffness.bending_3=0.5..2");
    let found = follow(ROD, round, load, one);
    assert!(!found.complete);
    assert_eq!(
        found.curves[0].ends.each_ref().map(|end| end.word()),
        ["parts"; 2]
    );
}

/// Lateral buckling under a tip load at P/sqrt(EI GJ), prebuckling bend included.
#[test]
fn lateral_buckling_over_the_strong_stiffness() {
    let strip = format!("{RIGID}; stiffness.torsion=0.8; stiffness.bending_2=100");
    let across = "stiffness.bending_2=10..1000:20log";
    let found = follow(ROD, &strip, "load.tip_force[2]=0..-5", across);
    let curve = only(&found);
    let [weakest, strongest] = ends(curve);
    let begun = curve.points.iter().find(|point| point.values[1] == 100.0);
    for (point, wanted) in [
        (weakest, 4.536899035739),
        (begun.unwrap(), 4.054222577948),
        (strongest, 4.016676901240),
    ] {
        assert!(off(point, -wanted * 0.8_f64.sqrt()) < 1e-8, "{point:?}");
    }
}

/// Nearly rigid against bending up and down, P = 4.0126 sqrt(EI GJ) over GJ.
#[test]
fn lateral_buckling_over_the_torsional_stiffness() {
    let strip = format!("{RIGID}; stiffness.bending_2=1e6");
    let across = "stiffness.torsion=0.5..1.2";
    let found = follow(ROD, &strip, "load.tip_force[2]=0..-6", across);
    // What is left of the bend is of the order of EI/EI_strong.
    let wanted = |torsion: f64| -4.012599343578901 * torsion.sqrt();
    for point in &only(&found).points {
        assert!(off(point, wanted(point.values[1])) < 3e-6, "{point:?}");
    }
}

/// A lens with a midrib that is too short.
const LENS: &str = "leaf.length=[1.0, 0.9, 1.0]; stiffness.axial=2500; \
    stiffness.shear_2=1000; stiffness.shear_3=1000";

/// The length of the midrib at which it leaves its plane.
const CRITICAL: f64 = 0.93780575743;

/// A lens whose midrib is too long leaves its plane: over the stiffness of all veins, the angle
/// of the fan (`tests/stability/boundary_random.rs` traces others), and the coupling, which begins at zero.
/// Beyond that there is no leaf: the curve goes on to there.
#[test]
fn a_lens_with_a_midrib_over_its_stiffness_its_fan_and_its_coupling() {
    let lens = text("classic/lens_midrib");
    let short = "leaf.length=[1.0, 0.9, 1.0]; coupling.z=0.5";
    for (entries, along, across, known) in [
        (
            LENS,
            "0.9..0.942",
            "stiffness.axial=2500..3500",
            Some(2500.0),
        ),
        (LENS, "0.9..0.98", "scale:leaf.fan=0.7..1", Some(1.0)),
        (short, "0.88..0.94", "coupling.z=0..1", None),
    ] {
        let found = follow(&lens, entries, &format!("leaf.length[1]={along}"), across);
        assert!(found.complete, "{:?}", found.remark);
        // Over the fan there is another one.
        let curve = match across.contains("fan") {
            true => &found.curves[0],
            false => only(&found),
        };
        if let Some(known) = known {
            let mut points = curve.points.iter();
            let known = points.find(|point| point.values[1] == known).unwrap();
            assert!(off(known, CRITICAL) < 1e-9, "{across}");
        }
    }
}

/// A hanging rod leaves its plane between two weights, if it is curved enough: the curve
/// turns back where they meet.
#[test]
fn a_hanging_curved_rod_over_its_curvature() {
    let across = format!("rest.bend_3=5.0..{:?}", 2.0 * PI);
    let (hanging, weight) = (text("classic/hanging_curved"), "load.gravity[0]=8..20");
    let found = follow(&hanging, "rest.bend_3=6.0", weight, &across);
    assert!(found.complete, "{:?}", found.remark);
    let curve = &found.curves[0];
    for (curvature, wanted) in [(6.0, 11.868750740620), (2.0 * PI, 12.187078750000)] {
        let here = |point: &&BoundaryPoint| (point.values[1] - curvature).abs() < 1e-9;
        let point = curve.points.iter().find(here).unwrap();
        assert!(off(point, wanted) < 1e-8, "{point:?}");
    }
    let curvatures = curve.points.iter().map(|point| point.values[1]);
    let least = curvatures.fold(f64::INFINITY, f64::min);
    assert!((5.55..5.56).contains(&least), "{least}");
    // On the upper part a larger weight makes it stable again.
    let mut ends = ends(curve).into_iter();
    let upper = ends.find(|point| point.values[0] == 20.0).unwrap();
    assert_eq!([upper.index_before, upper.index_behind], [1, 0]);
}

/// A column that is pushed askew folds instead of branching; the folds meet in a cusp where
/// it is straight, and go on at its other side. Between them a column that leans away from the
/// push stays so, beyond them it has snapped to the other side.
#[test]
fn a_column_pushed_askew_snaps_beyond_folds_that_meet_in_a_cusp() {
    let strip = "stiffness.bending_2=1000; stiffness.axial=1000; stiffness.shear_2=1000; \
                 stiffness.shear_3=1000; load.tip_force=[-2.8, 0, 0]";
    let (across, along) = ("load.tip_force[1]=1..-1", "load.tip_force[0]=-4..-2");
    let found = follow(ROD, strip, across, along);
    assert!(found.complete, "{:?}", found.remark);
    assert_eq!(found.curves.len(), 1, "the other fold is on the same curve");
    let points = &found.curves[0].points;
    let (cusps, folds): (Vec<_>, Vec<_>) = points.iter().partition(|point| point.kind == "cusp");
    assert!(folds.iter().all(|point| point.kind == "fold"));
    assert_eq!(cusps.len(), 1);
    let [across, along] = cusps[0].values;
    assert!(across.abs() < 1e-8, "{across}");
    assert!((along / (-0.25 * PI * PI) - 1.0).abs() < 1e-8, "{along}");

    let [low, beyond] = beside(&found.curves[0]);
    assert_eq!([low.index, beyond.index], [0, 0]);
    assert!(low.fallen_from.is_none() && beyond.fallen_from.is_some());
    // The curve is the same on both sides of the axis: how far from it at this load?
    let edge = |load: f64| {
        let pairs = points.windows(2);
        let mut passed = pairs.filter_map(|pair| {
            let [a, b] = [0, 1].map(|k| pair[k].values);
            let part = (load - a[1]) / (b[1] - a[1]);
            let inside = (0.0..=1.0).contains(&part);
            inside.then(|| (a[0] + part * (b[0] - a[0])).abs())
        });
        passed.next().unwrap()
    };
    let [inside, outside] = [low, beyond].map(|leaf| leaf.values);
    assert!(inside[0].abs() < edge(inside[1]), "{inside:?}");
    assert!(outside[0].abs() > edge(outside[1]), "{outside:?}");
    assert!(low.tips[0].y * beyond.tips[0].y < 0.0);
    assert!(beyond.tips[0].y * beyond.values[0] > 0.0);
    let [side, load] = beyond.values;
    let set = format!("{strip}; load.tip_force=[{load:?},{side:?},0]");
    let wanted = tip_at_rest(ROD, &set);
    assert!(beyond.tips[0].distance(wanted) < 2e-3, "{wanted}");
}

/// A column buckles in both directions at once where it is equally stiff in both: at the end
/// of the range, and within it.
#[test]
fn crossings_are_where_their_errors_say() {
    for (stiffness, count) in [(0.55, 2), (0.52, 4)] {
        let more = format!("{RIGID}; stiffness.torsion=10; stiffness.bending_2={stiffness:?}");
        let (along, across) = ("load.tip_force[0]=-1..-30", "stiffness.bending_3=0.5..0.55");
        let found = follow(ROD, &more, along, across);
        let points = found.curves.iter().flat_map(|curve| &curve.points);
        let crossings: Vec<_> = points.filter(|point| point.kind == "crossing").collect();
        assert_eq!(crossings.len(), count);
        for (k, point) in crossings.iter().enumerate() {
            let half_waves = 0.5 + (2 * k / count) as f64;
            let load = -(half_waves * PI).powi(2) * stiffness;
            let ([p, s], [pe, se]) = (point.values, point.errors);
            assert!((p - load).abs() <= pe && pe < 2e-6, "{point:?}");
            assert!((s - stiffness).abs() <= se && se < 1e-9, "{point:?}");
        }
    }
}

/// Two round columns side by side buckle together at the second load of Euler, and against each other at
/// that of a column on a foundation twice as stiff as what couples them: where the loads are one, two curves cross
/// along each of which two modes become neutral. They are followed through it, and say where it is.
#[test]
fn curves_of_two_modes_each_pass_where_they_cross() {
    const COLUMNS: &str = r#"
        name = "columns"
        leaf = { rods = 2, length = 1.0, fan = [0.0, 0.0], joined = false }
        stiffness = { torsion = 10.0, bending_2 = 1.0, bending_3 = 1.0, axial = inf, shear_2 = inf, shear_3 = inf }
        coupling = { y = 1.0, z = 1.0 }
        load = { tip_force = [-1.0, 0.0, 0.0] }
    "#;
    let across = "coupling.y+coupling.z=200..280";
    let along = "load.tip_force[0]=-1..-30";
    let found = followed(1e-6, COLUMNS, "", [along, across]).unwrap();
    assert!(found.complete, "{:?}", found.remark);
    // From the determinant of the fourth-order equation of a clamped column on a foundation.
    let (load, coupling) = (-2.25 * PI * PI, 235.462_426_716);
    let crossing = |curve: &BoundaryCurve| {
        let special = curve.points.iter().filter(|point| point.kind == "crossing");
        let special: Vec<_> = special.collect();
        for point in &special {
            let ([p, c], [pe, ce]) = (point.values, point.errors);
            assert!((p - load).abs() <= pe && pe < 1e-4, "{point:?}");
            assert!((c - coupling).abs() <= ce && ce < 1e-3, "{point:?}");
        }
        special.len()
    };
    let each: Vec<_> = found
        .curves
        .iter()
        .map(|curve| (curve.multiplicity, crossing(curve)))
        .collect();
    // The curve of Euler's first load meets no other.
    let meets: Vec<_> = each.iter().map(|(modes, met)| (*modes, *met > 0)).collect();
    assert_eq!(meets, [(2, false), (2, true), (2, true)]);
    for curve in &found.curves {
        let at: Vec<_> = ends(curve).iter().map(|point| point.values[1]).collect();
        assert_eq!(at, [200.0, 280.0]);
    }
}

/// Following the undulation boundary and verifying its points takes few matrices, 25.8 a point,
/// the first trace among them: work must not grow unnoticed. The leaf waves beyond, however
/// close behind it another mode becomes unstable.
#[test]
fn the_undulation_boundary_takes_few_factorizations_and_leaves_wave_beyond() {
    let (text, across) = (text("study/undulation"), "stiffness.torsion=0.9..1:2log");
    let along = format!("{}=1..0.4:50log", weak_veins());
    let found = follow(&text, "load.gravity=[0,0,0]", &along, across);
    let points: usize = found.curves.iter().map(|curve| curve.points.len()).sum();
    assert!(points >= 6, "{points}");
    let each = found.factorizations as f64 / points as f64;
    assert!(each <= 26.0, "{each}");
    let [flat, waving] = beside(&found.curves[0]);
    let height = |leaf: &LeafBeside| largest(leaf.curves.iter().flatten().map(|x| x.z.abs()));
    assert_eq!([flat.index, waving.index], [0, 0]);
    assert!(flat.values[0] > waving.values[0]);
    assert!(height(flat) < 1e-9, "{:e}", height(flat));
    assert!(height(waving) > 1e-3, "{:e}", height(waving));
}

/// Over ranges so wide that grids move points at a given value of the second number, then of the
/// first, a curve does not go back: from point to point it turns by less than a right angle.
#[test]
fn points_stand_in_order_where_the_given_number_changes() {
    let (text, along) = (text("study/undulation"), "stiffness.torsion=10..0.9:50log");
    let across = format!("{}=0.08..0.016:16log", weak_veins());
    let found = followed(1e-4, &text, "load.gravity=[0,0,0]", [along, &across]).unwrap();
    assert!(!found.curves.is_empty());
    let fraction = |point: &BoundaryPoint| {
        [0, 1].map(|i| {
            let [from, to] = found.ranges[i];
            (point.values[i] / from).ln() / (to / from).ln()
        })
    };
    for curve in &found.curves {
        let places: Vec<[f64; 2]> = curve.points.iter().map(fraction).collect();
        let way = |pair: &[[f64; 2]]| [0, 1].map(|i| pair[1][i] - pair[0][i]);
        let ways: Vec<[f64; 2]> = places.windows(2).map(way).collect();
        for (k, pair) in ways.windows(2).enumerate() {
            let turn = pair[0][0] * pair[1][0] + pair[0][1] * pair[1][1];
            assert!(turn > 0.0, "point {}: {pair:?}", k + 2);
        }
    }
}
