//! A branch ends where it was asked to: where it loses its stability, or where its run is stopped,
//! with what is known until then; and branches that cross are entered within the range, however
//! short that is.

use std::f64::consts::PI;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use leafdyn::relax::Limit;
use leafdyn::study::{BranchEnd, Trace, TraceRemark, TraceUntil, trace};
use leafdyn_testing::base;
use leafdyn_testing::branch::{follow, request, text};

/// A strip as thin as a blade of grass, clamped at its base, whose pinned tip is pushed towards it.
const STRIP: &str = r#"
name = "strip"
units = { length = "cm", force = "N" }
leaf = { rods = 1, length = 25.0, fan = [0.0] }
section = { shape = "rectangle", width = 3.0, thickness = 0.03, young = 2e4 }
tip = { held = "pinned", position = [25.0, 0.0, 0.0] }
"#;

const THRUST: &str = "load.tip_force[0]=-1..-60";

fn thrust(until: Option<TraceUntil>, switch: bool) -> Trace {
    let column = base(&text("classic/elastica_buckled"), "");
    let mut request = request(column, THRUST, 1e-6, 2000);
    (request.until, request.switch) = (until, switch);
    trace(&request, &mut |_, _, _| {}).unwrap()
}

/// The straight column under a growing thrust buckles to the side at pi^2/4 and 9 pi^2/4, and at
/// ten times the first up or down, where it is ten times stiffer (closed form). The first of these
/// ends the branch.
#[test]
fn a_branch_ends_where_it_loses_its_stability() {
    let whole = thrust(None, false);
    assert_eq!(whole.branches[0].index_increase_count(), 3);
    let ended = thrust(Some(TraceUntil::Unstable), true);
    let [straight, sides @ ..] = &ended.branches[..] else {
        panic!("no branch")
    };
    assert_eq!(straight.end, BranchEnd::StabilityLost);
    let last = straight.points.last().unwrap();
    let euler = -PI * PI / 4.0;
    assert!((last.value / euler - 1.0).abs() < 1e-6, "{}", last.value);
    let before = &straight.points[..straight.points.len() - 1];
    assert!(last.index == 1 && before.iter().all(|point| point.index == 0));
    // Of the branches that cross the straight one only those are entered at which it ends.
    assert_eq!(sides.len(), 2);
    let stable = |side: &leafdyn::study::TraceBranch| side.points.iter().all(|it| it.index == 0);
    assert!(sides.iter().all(stable) && ended.complete);
}

/// The force of a clamped and pinned strut, k L = 4.4934 with tan k L = k L, and its deflection
/// w = a (sin k x - k x + k L (1 - cos k x)) to leading order, with which half the integral of w'^2
/// is what the tips approach each other beyond buckling. The whole range is 4e-6 of the length, so
/// that the nearest of the usual first points beside the crossing would be far beyond it.
#[test]
fn branches_that_cross_are_entered_within_a_short_range() {
    let found = follow(STRIP, "", "tip.position[0]=25..24.9999", true);
    assert!(found.complete, "{:?}", found.remark);
    let [straight, sides @ ..] = &found.branches[..] else {
        panic!("no branch")
    };
    let (_, crossing) = straight.critical_points().next().unwrap();
    let (length, kl, samples) = (25.0, 4.493409457909064_f64, 4000);
    let k = kl / length;
    let bending = 2e4 * 3.0 * 0.03_f64.powi(3) / 12.0;
    let force = k * k * bending;
    let slope = |x: f64| k * (k * x).cos() - k + k * kl * (k * x).sin();
    let shape = |x: f64| (k * x).sin() - k * x + kl * (1.0 - (k * x).cos());
    let step = length / f64::from(samples);
    let middles = (0..samples).map(|i| step * (f64::from(i) + 0.5));
    let shortening = middles.map(|x| 0.5 * step * slope(x).powi(2)).sum::<f64>();
    assert_eq!(sides.len(), 2);
    let ends = [0, 1].map(|side| sides[side].points.last().unwrap());
    for end in ends {
        assert_eq!((end.value, end.index), (24.9999, 0));
        let pushed = end.reaction.unwrap().x;
        assert!((pushed / force - 1.0).abs() < 1e-4, "{pushed} for {force}");
        let amplitude = ((crossing.value - end.value) / shortening).sqrt();
        let middle = end.curves[0].len() / 2;
        let deflection = end.curves[0][middle].z.abs();
        let wanted = amplitude * shape(end.stations[middle] * length).abs();
        assert!(
            (deflection / wanted - 1.0).abs() < 0.01,
            "{deflection} for {wanted}"
        );
    }
    let [one, other] = ends.map(|end| end.curves[0][end.curves[0].len() / 2].z);
    assert!(one * other < 0.0, "one to either side");
}

/// What is known of branches when the run is stopped is what the whole run has there.
#[test]
fn a_run_that_is_stopped_keeps_what_it_knows() {
    let whole = thrust(None, false);
    let cancel = Arc::new(AtomicBool::new(false));
    let column = base(&text("classic/elastica_buckled"), "");
    let mut asked = request(column, THRUST, 1e-6, 2000);
    asked.limit = Limit {
        cancel: Some(cancel.clone()),
        ..Limit::default()
    };
    let stopped = trace(&asked, &mut |_, points, _| {
        cancel.fetch_or(points == 12, Ordering::Relaxed);
    });
    let stopped = stopped.unwrap();
    let [known, all] = [&stopped, &whole].map(|it| &it.branches[0]);
    assert_eq!(known.end, BranchEnd::RunLimitReached);
    assert!(!stopped.complete);
    let count = known.points.len();
    assert_eq!(stopped.remark, Some(TraceRemark::Stopped));
    assert!(1 < count && count < all.points.len(), "{count}");
    for (known, all) in known.points.iter().zip(&all.points) {
        assert_eq!((known.value, known.index), (all.value, all.index));
        assert_eq!((&known.tips, known.error), (&all.tips, all.error));
    }
}

/// A crossing that was not tried because the run was stopped is not said to have no branches.
#[test]
fn a_run_that_is_stopped_says_nothing_of_what_it_did_not_try() {
    let cancel = Arc::new(AtomicBool::new(false));
    let column = base(&text("classic/elastica_buckled"), "");
    let mut asked = request(column, THRUST, 1e-6, 2000);
    asked.switch = true;
    asked.limit = Limit {
        cancel: Some(cancel.clone()),
        ..Limit::default()
    };
    let stopped = trace(&asked, &mut |_, _, value| {
        cancel.fetch_or(value < -40.0, Ordering::Relaxed);
    });
    let stopped = stopped.unwrap();
    assert_eq!(stopped.branches.len(), 1);
    let straight = &stopped.branches[0];
    assert!(straight.critical_points().next().is_some() && straight.remarks.is_empty());
    let remark = stopped.remark.expect("the run was stopped");
    assert_eq!(remark.code(), "stopped-before-crossings");
    let sentence = "the run was stopped: branches that cross are not all followed";
    assert_eq!(remark.to_string(), sentence);
}
