//! The leaves on either side of a boundary: equilibria of the index that it tells, or what the
//! stable leaf of the one side comes to rest as beyond.

mod common;

use std::f64::consts::PI;

use common::branch::{text, weak_veins};
use common::plane::{follow, followed};
use common::*;
use leafdyn::study::LeafBeside;

/// Distance of its tip from the axis.
fn off_axis(tip: DVec3) -> f64 {
    tip.y.hypot(tip.z)
}

/// The tip of the leaf that a relaxation from arcs finds at both numbers.
fn tip_at_rest(text: &str, entries: &str) -> DVec3 {
    tip(&relaxed(base(text, entries).scenario(), &to(1e-8)))
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
        let [low, high] = found.curves[0].beside.as_slice() else {
            panic!("no leaves beside curve {number}");
        };
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

/// A column that is pushed askew to the side to which it does not lean: between the folds it
/// stays, beyond them it has snapped to the other side.
#[test]
fn a_column_pushed_askew_snaps_beyond_its_fold() {
    let strip = "stiffness.bending_2=1000; stiffness.axial=1000; stiffness.shear_2=1000; \
                 stiffness.shear_3=1000; load.tip_force=[-2.8, 0, 0]";
    let (along, across) = ("load.tip_force[1]=1..-1", "load.tip_force[0]=-4..-2");
    let found = follow(ROD, strip, along, across);
    let curve = &found.curves[0];
    let [low, beyond] = curve.beside.as_slice() else {
        panic!("no leaves");
    };
    assert_eq!([low.index, beyond.index], [0, 0]);
    assert!(low.fallen_from.is_none() && beyond.fallen_from.is_some());
    // The curve is the same on both sides of the axis: how far from it at this load?
    let edge = |load: f64| {
        let pairs = curve.points.windows(2);
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

/// The leaf waves beyond the boundary of undulation, however close behind it another mode
/// becomes unstable.
#[test]
fn a_flat_leaf_waves_beyond_the_undulation_boundary() {
    let (text, across) = (text("study/undulation"), "stiffness.torsion=0.9..1:2log");
    let along = format!("{}=1..0.4:50log", weak_veins());
    let found = followed(1e-4, &text, "load.gravity=[0,0,0]", [&along, across]).unwrap();
    let curve = &found.curves[0];
    let [flat, waving] = curve.beside.as_slice() else {
        panic!("no leaves");
    };
    let height = |leaf: &LeafBeside| largest(leaf.curves.iter().flatten().map(|x| x.z.abs()));
    assert_eq!([flat.index, waving.index], [0, 0]);
    assert!(flat.values[0] > waving.values[0]);
    assert!(height(flat) < 1e-9, "{:e}", height(flat));
    assert!(height(waving) > 1e-3, "{:e}", height(waving));
}
