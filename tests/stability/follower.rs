//! A leaf that follows its scenario: along its branch, to the fold and no further, and from there in
//! motion to where a relaxation leads.

use leafdyn::relax::{EquilibriumTracker, RelaxError, RodShape, TrackOutcome};
use leafdyn::simulate::{self, Simulation};
use leafdyn::study::{BaseScenario, ParameterKeys, PointKind, trace, trace_through};
use leafdyn_testing::*;

const TOLERANCE: f64 = 1e-6;

fn options() -> Options {
    Options {
        tolerance: Some(TOLERANCE),
        ..Options::default()
    }
}

/// Stiff sideways, so that it falls in its plane.
const COLUMN: &str = "stiffness.bending_3=10.0";

/// A column beyond its Euler load, and a force across that keeps it on one side.
fn column(across: f64) -> Scenario {
    rod(&format!("{COLUMN}; load.tip_force=[-2.8, 0.0, {across:?}]"))
}

fn begin(scenario: &Scenario) -> EquilibriumTracker {
    let (_, follower) = EquilibriumTracker::begin(scenario, &options()).unwrap();
    follower.expect("the leaf is at rest")
}

fn follow(follower: &mut EquilibriumTracker, ends: [f64; 2]) -> TrackOutcome {
    let at = |part: f64| Ok::<_, RelaxError>(column(ends[0] + part * (ends[1] - ends[0])));
    follower.follow(&at).unwrap()
}

fn there(followed: TrackOutcome) -> Equilibrium {
    match followed {
        TrackOutcome::Arrived(leaf) => *leaf,
        TrackOutcome::BranchEnded { part } => panic!("left at {part}"),
    }
}

/// Where it ends is where a trace finds the fold; there it snaps, and it takes another fold to
/// come back.
#[test]
fn a_column_snaps_at_its_fold_and_comes_back_at_another() {
    let request = branch::request(
        base(ROD, &format!("{COLUMN}; load.tip_force=[-2.8, 0.0, 0.5]")),
        "load.tip_force[2]=0.5..-0.5",
        TOLERANCE,
        2000,
    );
    let trace = trace(&request, &mut |_, _, _| {}).unwrap();
    let mut critical = trace.branches[0].critical_points();
    let (_, fold) = critical.find(|(_, it)| it.kind == PointKind::Fold).unwrap();
    assert!((-0.5..0.0).contains(&fold.value), "{}", fold.value);

    let mut follower = begin(&column(0.5));
    let up = there(follow(&mut follower, [0.5, 0.5 * fold.value]));
    assert!(up.tips[0].z > 0.3, "{}", up.tips[0]);
    let TrackOutcome::BranchEnded { part } = follow(&mut follower, [0.5 * fold.value, -0.5]) else {
        panic!("it stays up beyond the fold")
    };
    let left = 0.5 * fold.value + part * (-0.5 - 0.5 * fold.value);
    // On the finest of the grids that are tried, 128 segments.
    assert!((left - fold.value).abs() < 2e-4, "{left}, {}", fold.value);

    let below = column(-0.5);
    let mut motion =
        Simulation::from_tracker(&follower, &below, &simulate::Options::default()).unwrap();
    let first = motion.frame().tips(true)[0];
    assert!(first.z > 0.3, "it begins where it was: {first}");
    while !motion.done() {
        motion.next_frame().unwrap();
    }
    let down = motion.relax_into_tracker(&mut follower, &below).unwrap();
    let relaxed = below.relaxation().tolerance(TOLERANCE).run().unwrap();
    let error = 2.0 * TOLERANCE * relaxed.shape.longest();
    assert!(down.tips[0].distance(relaxed.tips[0]) < error);
    assert_eq!(down.stable(), Some(true));

    let still = there(follow(&mut follower, [-0.5, -0.5 * fold.value]));
    assert!(still.tips[0].z < -0.3, "{}", still.tips[0]);
}

/// In one step or in several, each leaf is where a relaxation finds it, within the bars of both.
#[test]
fn leaves_of_all_kinds_follow_to_where_they_rest() {
    let cases = [
        ("paper/fig04", "", "scale:load.gravity", [1.0, 0.3]),
        ("paper/fig04", "", "leaf.length", [1.0, 1.1]),
        (
            "paper/fig08",
            "leaf.rods=5",
            "stiffness.torsion",
            [1.0, 0.5],
        ),
        ("measured/grass", "", "section.young", [1.0, 0.5]),
        (
            "measured/across",
            "grip[0].move=[0, 0, 0]; grip[1].move=[0, 0, 0]",
            "grip[1].move[1]",
            [0.0, 0.05],
        ),
        ("measured/blade", "", "load.g[2]", [1.0, 0.2]),
        ("measured/clip", "", "load.point[0].at", [1.0, 0.8]),
        ("study/saddle", "", "blade.thickness", [1.0, 2.0]),
    ];
    for (name, overrides, key, [from, to]) in cases {
        let base = base_of(name, overrides);
        let keys: ParameterKeys = key.parse().unwrap();
        let given = base.number(&keys).unwrap_or(1.0);
        let unit = if given == 0.0 { 1.0 } else { given };
        let at = |value: f64| {
            base.scenario_with_values(&[(&keys, unit * value)])
                .unwrap()
                .scenario
        };
        let relaxed = at(to).relaxation().tolerance(TOLERANCE).run().unwrap();
        for steps in [1, 5] {
            let mut follower = begin(&at(from));
            let mut found = None;
            for k in 0..steps {
                let along = |t: f64| {
                    let part = (k as f64 + t) / steps as f64;
                    Ok::<_, RelaxError>(at(from + part * (to - from)))
                };
                found = Some(there(follower.follow(&along).unwrap()));
            }
            let found = found.unwrap();
            // Their grids may differ.
            let off = distance(&found, &relaxed);
            let bars = [&found, &relaxed].map(|leaf| leaf.accuracy.error_estimate.unwrap());
            println!(
                "{name} {key} in {steps}: {off:.1e} of {:.1e}",
                bars[0] + bars[1]
            );
            assert!(off <= bars[0] + bars[1], "{name} {key}");
            let wanted = (TOLERANCE * found.shape.longest()).max(1.5 * bars[1]);
            assert!(bars[0] <= wanted, "{name} {key}: {:e}", bars[0]);
            assert_eq!(found.stable(), Some(true));
        }
    }
}

fn base_of(name: &str, overrides: &str) -> BaseScenario {
    let base = BaseScenario::read(&path(name), &entries(overrides));
    base.unwrap_or_else(|error| panic!("{error}"))
}

/// Of two equilibria under one force it begins with that near which it is placed, and goes on from
/// there; placed nowhere, or by another leaf, it begins as a relaxation does.
#[test]
fn it_begins_with_the_equilibrium_near_a_shape() {
    let mut follower = begin(&column(0.05));
    let up = there(follow(&mut follower, [0.05, -0.05]));
    let below = leafdyn::relax::relax(&column(-0.05), &options(), &mut |_| {}).unwrap();
    assert!(up.tips[0].z > 0.3 && below.tips[0].z < -0.3);
    let near = |shape: (&[f64], &[RodShape])| {
        let begun = EquilibriumTracker::begin_near(&column(-0.05), &options(), shape);
        let (leaf, follower) = begun.unwrap();
        (leaf, follower.expect("the leaf is at rest"))
    };
    let (leaf, mut follower) = near((&up.shape.stations, &up.shape.rods));
    let apart = leaf.tips[0].distance(up.tips[0]);
    assert!(apart <= 2.0 * TOLERANCE, "{apart}");
    let back = there(follow(&mut follower, [-0.05, 0.05]));
    assert!(back.tips[0].z > 0.3);
    let mut turned = up.shape.stations.clone();
    turned.reverse();
    let none = (&up.shape.stations[..], &[][..]);
    for shape in [none, (&[], &up.shape.rods), (&turned, &up.shape.rods)] {
        assert!(near(shape).0.tips[0].z < -0.3);
    }
}

/// A branch through a given leaf goes both ways from it, and is that to which a relaxation at
/// the one end leads; beyond a snap it is not the one on which a relaxation at that end lies.
#[test]
fn a_branch_goes_both_ways_from_the_leaf_that_follows() {
    let mut follower = begin(&column(0.05));
    let up = there(follow(&mut follower, [0.05, -0.05]));
    let request = branch::request(
        base(ROD, &format!("{COLUMN}; load.tip_force=[-2.8, 0.0, 0.5]")),
        "load.tip_force[2]=-0.08..0.5",
        TOLERANCE,
        2000,
    );
    let through = trace_through(&request, (&up, -0.05), &mut |_, _, _| {}).unwrap();
    assert!(through.complete, "{:?}", through.remark);
    let [on, back] = &through.branches[..] else {
        panic!("{} ways", through.branches.len());
    };
    let [first, other] = [on, back].map(|way| &way.points[0]);
    // It is verified in the plane across the branch, in which finer grids have it at another value.
    let near = there(follow(&mut follower, [-0.05, first.value]));
    let apart = near.tips[0].distance(first.tips[0]);
    assert!(
        (first.value + 0.05).abs() < 0.01 && apart <= 2.0 * TOLERANCE,
        "{apart:e}"
    );
    let apart = first.tips[0].distance(other.tips[0]);
    assert!(apart <= TOLERANCE, "{apart}");
    let end =
        |way: &leafdyn::study::TraceBranch| way.points.last().map(|it| (it.value, it.tips[0]));
    let [(high, up), (low, down)] = [end(on).unwrap(), end(back).unwrap()];
    assert!((high - 0.5).abs() < 1e-9 && (low + 0.08).abs() < 1e-9 && down.z > 0.3);
    let relaxed = leafdyn::relax::relax(&column(-0.08), &options(), &mut |_| {}).unwrap();
    assert!(relaxed.tips[0].z < -0.3);
    let there = leafdyn::relax::relax(&column(0.5), &options(), &mut |_| {}).unwrap();
    assert!(there.tips[0].distance(up) <= 2.0 * TOLERANCE);
}

/// On a fixed grid it follows on the coarsest of its grids alone, with an error that falls with the square of its
/// spacing, for a part of the work; without one it is as accurate again as a leaf that is relaxed there.
#[test]
fn a_leaf_follows_on_its_coarsest_grid_and_is_refined_again() {
    let leaf = |weight: f64| fig04_under(weight);
    let (first, follower) = EquilibriumTracker::begin(&leaf(1.0), &options()).unwrap();
    let mut follower = follower.expect("the leaf is at rest");
    let coarse = Options {
        method: Options::default().method.on_grid(Some(16)),
        ..options()
    };
    let to = |follower: &mut EquilibriumTracker, ends: [f64; 2]| {
        let at = |part: f64| Ok::<_, RelaxError>(leaf(ends[0] + part * (ends[1] - ends[0])));
        there(follower.follow(&at).unwrap())
    };
    follower.options(&coarse);
    let rough = to(&mut follower, [1.0, 1.2]);
    let accuracy = &rough.accuracy;
    assert_eq!(accuracy.segments, first.accuracy.segments[..1]);
    assert_eq!(
        (accuracy.error_estimate, rough.stable()),
        (None, Some(true))
    );
    follower.options(&options());
    let fine = to(&mut follower, [1.2, 1.3]);
    let relaxed = |weight: f64| settle(&leaf(weight), TOLERANCE);
    let error = fine.tips[0].distance(relaxed(1.3).tips[0]);
    assert!(error < 2.0 * TOLERANCE, "{error}");
    let error = rough.tips[0].distance(relaxed(1.2).tips[0]);
    assert!(error < 1e-2 && error > TOLERANCE, "{error}");
    let work = [&rough, &fine].map(|leaf| leaf.work.factorizations);
    assert!(2 * work[0] <= work[1], "{work:?}");
}

/// The leaf of Fig. 4 with 5 veins and so many times its weight.
fn fig04_under(weight: f64) -> Scenario {
    let mut leaf = fig04(5);
    leaf.gravity = leaf.gravity.map(|force| weight * force);
    leaf
}
