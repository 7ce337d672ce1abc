//! How far a stable leaf is from losing its stability: pushes and the energy of the lowest
//! pass against columns and the elastica, and against relaxations under such forces. Next to
//! symmetric bifurcations, where coarse grids bear more, the energy vanishes like the square
//! of the distance.

use leafdyn::relax::{
    Barrier, CriticalTipForce, InstabilityKind, Margin, MarginRemark, PostcriticalBehavior,
};
use leafdyn::study::relax_with_margin;
use leafdyn_testing::branch::follow;
use leafdyn_testing::workplace::{Json, Workplace, timeless};
use leafdyn_testing::*;

/// Euler's load of a clamped column.
const EULER: f64 = 0.25 * PI * PI;

/// That leaves its plane and twists only under much more.
const STIFF: &str = "stiffness.torsion=50; stiffness.bending_2=50";

/// A leaf to 1e-8, and its margin.
fn found(scenario: &Scenario) -> (Equilibrium, Margin) {
    let leaf = relax_with_margin(scenario, &at_every_node(1e-8), &mut |_| {}).unwrap();
    let margin = leaf.margin.clone().unwrap();
    (leaf, margin)
}

fn margin(scenario: &Scenario) -> Margin {
    found(scenario).1
}

fn push<'m>(margin: &'m Margin, direction: &str) -> &'m CriticalTipForce {
    let mut pushes = margin.pushes.iter();
    let found = pushes.find(|push| push.direction.to_string() == direction);
    found.unwrap_or_else(|| panic!("{direction}: {margin:?}"))
}

/// The force of a push, which must be right within its error bar.
#[track_caller]
fn is_at(push: &CriticalTipForce, right: f64) {
    let (force, error) = (push.force.unwrap(), push.error.unwrap());
    close(&format!("{push:?}"), force, right, error.max(1e-11));
    assert!(error < 1e-5 * right, "{push:?}");
}

/// The lowest pass, whose energy must be known to this part of itself.
#[track_caller]
fn pass(margin: &Margin, within: f64) -> &Barrier {
    let pass = margin.barrier.as_ref().expect("a pass");
    let (energy, error) = (pass.energy, pass.error.unwrap());
    assert!(error < within * energy, "{energy} within {error}");
    pass
}

/// Weight of a standing column, and the largest load that its tip bears: of Euler, and of
/// theta'' + (load + weight (1 - s)) theta = 0 with theta(0) = theta'(1) = 0, by 2000 steps of
/// Runge and Kutta.
const STANDING: &str = "
    0  2.467401100272340
    2  1.864171738605644
    5  0.926102637229740
";

#[test]
fn a_column_gives_way_at_the_loads_of_euler_and_greenhill() {
    for [weight, right] in table(STANDING) {
        let load = format!("load.gravity=[{:?}, 0, 0]", -weight);
        let column = rod(&format!("{RIGID}; stiffness.bending_2=2.0; {load}"));
        let margin = margin(&column);
        let down = push(&margin, "-x");
        is_at(down, right);
        let lost = (down.kind, down.then);
        assert_eq!(
            lost,
            (
                InstabilityKind::BranchPoint,
                Some(PostcriticalBehavior::BendsAside)
            )
        );
        // The least comes first.
        assert_eq!(margin.pushes[0].direction, down.direction);
    }
}

/// Compressed by its load P, of axial stiffness H, Reissner's column has buckled where
/// P (1 - P/H) is Euler's load.
#[test]
fn an_extensible_column_gives_way_at_the_load_of_reissner() {
    let stiffness = set_stiffness(50.0, f64::INFINITY);
    let column = rod(&format!("{stiffness}; stiffness.bending_2=2"));
    let right = 25.0 * (1.0 - (1.0 - 4.0 * EULER / 50.0).sqrt());
    is_at(push(&margin(&column), "-x"), right);
}

/// Load of a column beyond Euler's.
const LOAD: f64 = 3.0;

/// The largest force across that the elastica under it bears from the side to which it is
/// bent: 1000 steps of Runge and Kutta from its tip.
const MOST: f64 = 0.23558551433243685;

/// The way back over the pass at these [`PARTS`] from there, by the same.
const BACK: [f64; 4] = [
    2.924392144028065e-3,
    1.0299093969763362e-3,
    2.599393771078873e-4,
    9.18306720296691e-5,
];

/// A buckled column, pushed back to the other side, snaps where the force across that
/// holds it is largest; the pass is the straight one.
#[test]
fn a_buckled_column_snaps_as_the_elastica() {
    let strip = format!("{RIGID}; {STIFF}");
    let column = rod(&format!("{strip}; load.tip_force=[{:?}, 0, 0]", -LOAD));
    let (leaf, margin) = found(&column);
    let least = &margin.pushes[0];
    is_at(least, MOST);
    assert_eq!(
        (least.kind, least.then),
        (InstabilityKind::Fold, Some(PostcriticalBehavior::Snaps))
    );
    let back = if leaf.tips[0].y > 0.0 { "-y" } else { "+y" };
    assert_eq!(least.direction.to_string(), back);

    let barrier = pass(&margin, 1e-5);
    let error = barrier.error.unwrap().max(1e-11);
    close("barrier", barrier.energy, 0.09911404507833144, error);
    assert!((barrier.saddle.tip.x - 1.0).abs() < 1e-9);
    assert!((barrier.neighbour.tip.y + leaf.tips[0].y).abs() < 1e-2);
    assert_eq!((margin.weight, barrier.height), (0.0, None));
}

/// Distances from a fold, as parts of its load.
const PARTS: [f64; 4] = [0.1, 0.05, 0.02, 0.01];

/// That energies at these distances vanish with the power 3/2, and the more so the nearer, by
/// a term of the next order.
#[track_caller]
fn vanish_as_at_a_fold(energies: [f64; 4]) {
    let beyond = [0, 1, 2].map(|k| {
        let (part, next) = (PARTS[k], PARTS[k + 1]);
        let exponent = (energies[k] / energies[k + 1]).ln() / (part / next).ln();
        (exponent - 1.5) / (part * next).sqrt()
    });
    for pair in beyond.windows(2) {
        assert!((pair[1] / pair[0] - 1.0).abs() < 0.2, "{beyond:?}");
    }
    assert!(beyond[2].abs() * 0.0141 < 0.02, "{beyond:?}");
}

/// Under a force across, the pass and the equilibrium behind it are those of the elastica
/// bent against the force; near the fold they meet, and the way back over the pass vanishes
/// with the power 3/2. The leaf itself snaps under as large a force the other way, to where
/// it bends with that.
#[test]
fn the_barrier_vanishes_at_the_fold_with_the_power_three_halves() {
    let strip = format!("{RIGID}; {STIFF}");
    let load = |force: f64| format!("load.tip_force=[-{LOAD:?}, {force:?}, 0]");
    let bent = |force: f64| rod(&format!("{strip}; {}", load(force)));
    let beyond = relaxed(&bent(-1.000001 * MOST), &Options::default());
    vanish_as_at_a_fold([0, 1, 2, 3].map(|k| {
        let (part, right) = (PARTS[k], BACK[k]);
        let force = (1.0 - part) * MOST;
        let (leaf, margin) = found(&bent(force));
        let barrier = margin.barrier.as_ref().unwrap_or_else(|| panic!("{part}"));
        let back = barrier.saddle.energy - barrier.neighbour.energy;
        close("the way back", back, right, 1e-8);
        assert!(leaf.tips[0].y > 0.0 && barrier.neighbour.tip.y < 0.0);
        let back_over = push(&margin, "-y");
        is_at(back_over, force + MOST);
        let lands = back_over.neighbour.unwrap();
        assert!(lands.tip.distance(beyond.tips[0]) < 1e-4, "{lands:?}");
        back
    }));
}

/// A shallow arch, clamped at both ends, under a load along it: next to its fold the pass is
/// found, though on coarse grids the fold is elsewhere.
#[test]
fn the_barrier_of_a_clamped_arch_vanishes_at_its_fold() {
    let span = 0.3_f64.sin() / 0.3;
    let arch = format!(
        "leaf.fan=[0.3]; {STIFF}; {}; rest.bend_3=-0.6; \
         tip.held='clamped'; tip.position=[{span:?}, 0, 0]; tip.angles=-0.3; load.gravity=[0, 0, 0]",
        set_stiffness(1e4, f64::INFINITY)
    );
    let trace = follow(ROD, &arch, "load.gravity[1]=0..-40", false);
    let fold = -trace.branches[0].critical_points().next().unwrap().1.value;
    vanish_as_at_a_fold(PARTS.map(|part| {
        let load = format!("load.gravity=[0, {:?}, 0]", (part - 1.0) * fold);
        let (leaf, margin) = found(&rod(&format!("{arch}; {load}")));
        assert_eq!(leaf.stable(), Some(true));
        pass(&margin, 1e-3).energy
    }));
}

/// An elastica of natural curvature 1/2 that a force across would push back, beyond the
/// force from which on its other shape is the lower one: near the fold of the other one
/// the pass to it is found.
#[test]
fn passes_next_to_a_fold_are_not_overstepped() {
    let strip = format!("{RIGID}; {STIFF}; rest.bend_3=0.5");
    let energies = [1.1, 1.2, 1.269, 1.34, 1.382, 1.3964, 1.4035].map(|force| {
        let column = rod(&format!("{strip}; load.tip_force=[-3, {:?}, 0]", -force));
        let (leaf, margin) = found(&column);
        assert!(leaf.tips[0].y < 0.0, "{force}");
        let barrier = pass(&margin, 1e-6);
        // By the theorem of Castigliano it changes with the way between both tips.
        let way = barrier.saddle.tip.y - leaf.tips[0].y;
        [force, barrier.energy, way]
    });
    for pair in energies.windows(2) {
        let [[f, e, w], [g, h, v]] = [pair[0], pair[1]];
        let trapezium = 0.5 * (g - f) * (w + v);
        close("change", h - e, trapezium, 0.01 * (h - e));
    }
}

/// A clamped strip, or a round column, under a load along it.
fn column(load: f64, round: bool) -> Scenario {
    let other = if round { 1.0 } else { 50.0 };
    let load = format!("load.tip_force=[{:?}, 0, 0]", -load);
    rod(&format!("{RIGID}; stiffness.bending_2={other:?}; {load}"))
}

#[test]
fn below_its_load_a_column_gives_way_at_what_is_left_of_it() {
    for (round, part) in [(true, 0.1), (false, 0.02), (true, 0.01)] {
        let found = margin(&column((1.0 - part) * EULER, round));
        let least = &found.pushes[0];
        let (force, error) = (least.force.unwrap(), least.error.unwrap());
        assert_eq!(least.direction.to_string(), "-x");
        assert_eq!(least.kind, InstabilityKind::BranchPoint);
        close(&format!("{part}"), force, part * EULER, error);
        assert!(error < 1e-4 * force, "{part}: {force} within {error}");
        assert!(found.barrier.is_none(), "{found:?}");
    }
}

/// Part by which a load P is beyond Euler's, and the energy of the straight column above that
/// of the elastica: with the sine k of half of its tip's angle K(k) = sqrt P, its tip is at
/// 2 E/K - 1, and the first integral theta'^2 = 2 P (cos theta - cos alpha) makes the
/// difference P (4 - 2 k^2 - 4 E/K).
const BEYOND: &str = "
    0.1    0.022962110933447594
    0.05   0.0059462001948246725
    0.02   0.0009723926034537966
    0.01   0.0002449044687979627
    0.005  0.00006145464442651825
";

#[test]
fn beyond_its_load_the_barrier_of_a_strip_is_that_of_the_elastica() {
    for [part, right] in table(BEYOND) {
        let load = (1.0 + part) * EULER;
        let margin = margin(&column(load, false));
        let found = pass(&margin, 1e-6);
        // The closed form is a difference of numbers of the order of the load.
        let within = found.error.unwrap() + 1e-14 * load;
        close(&format!("{part}"), found.energy, right, within);
        assert!((found.saddle.tip.x - 1.0).abs() < 1e-9);
    }
}

/// A round one turns towards any push across its axis, without a force.
#[test]
fn a_buckled_round_column_is_pushed_along_its_axis_alone() {
    let found = margin(&column(1.02 * EULER, true));
    assert!(
        found.barrier.is_none(),
        "its other shapes are on the same circle"
    );
    let axes = found.pushes.iter().map(|push| push.direction.axis);
    assert!(found.pushes.len() == 2 && axes.eq([0, 0]));
    let remark = found.remark.unwrap().to_string();
    assert!(remark.starts_with("the leaf turns about its base without resistance, "));
}

/// Axial stiffness, and the load under which a column that is clamped at both ends buckles:
/// P (1 - P/H) = 4 pi^2.
const AXIAL: f64 = 1000.0;

fn shortened(beyond: f64) -> Scenario {
    let load = 0.5 * AXIAL * (1.0 - (1.0 - 16.0 * PI * PI / AXIAL).sqrt());
    let tip = 1.0 - (1.0 + beyond) * load / AXIAL;
    let stiffness = set_stiffness(AXIAL, f64::INFINITY);
    let held = format!("tip.held='clamped'; tip.position=[{tip:?}, 0, 0]");
    rod(&format!("{STIFF}; {stiffness}; {held}"))
}

/// Held at both ends, from 10 to 0.5 % beyond: H/2 times the square of the strain beyond, but
/// for terms of the next order.
#[test]
fn a_column_that_is_shortened_has_a_barrier() {
    for beyond in [-0.02, -0.005] {
        let found = margin(&shortened(beyond));
        assert!(found.barrier.is_none(), "{beyond}: {found:?}");
        assert_eq!(found.remark, Some(MarginRemark::TipHeld));
    }
    let relative = [0.1, 0.05, 0.02, 0.01, 0.005].map(|beyond| {
        let found = margin(&shortened(beyond)).barrier;
        found.unwrap_or_else(|| panic!("{beyond}")).energy / (beyond * beyond)
    });
    for pair in relative.windows(2) {
        assert!((pair[0] / pair[1] - 1.0).abs() < 0.01, "{relative:?}");
    }
}

#[test]
fn what_has_no_margin_is_said() {
    let place = Workplace::new();
    let run = |more: &str| place.run(format!("relax leaf.toml --margin --write none {more}"));
    let held = run("--set tip.held=\"pinned\" --set tip.position=[0.8,0,0]").ends(0);
    held.says(&["the tip is held: a force on it moves nothing"]);
    let free = run("--set leaf.joined=false").ends(0);
    assert!(!free.out.contains(" at the tip"), "{}", free.out);
}

#[test]
fn margins_do_not_depend_on_threads() {
    let place = Workplace::new();
    let [one, two] = ["1", "2"].map(|threads| {
        let pushed = "--set load.tip_force=[-3,0,0] --set leaf.rods=1";
        let run = place.run_on(
            threads,
            &format!("relax leaf.toml --margin --json {pushed}"),
        );
        timeless(run.ends(0).json()["margin"].clone())
    });
    assert_eq!(one, two);
    assert_eq!(one["pushes"].list().len(), 6);
}

/// Just below the load of a strip that stands on its edge, pushes to either side are mirror images:
/// they have one number; and no number that is told is below its error.
#[test]
fn pushes_that_are_mirror_images_have_one_number() {
    for load in [-7.8, -7.8373, -7.83733] {
        let entries = format!("{RIGID}; stiffness.bending_3=3; load.gravity=[{load}, 0, 0]");
        let leaf = relax_with_margin(&rod(&entries), &to(1e-6), &mut |_| {}).unwrap();
        let margin = leaf.margin.unwrap();
        let sides = ["+y", "-y"].map(|side| push(&margin, side));
        assert_eq!(sides[0].force, sides[1].force, "{load}");
        assert_eq!(sides[0].error, sides[1].error, "{load}");
        for push in &margin.pushes {
            if let (Some(force), Some(error)) = (push.force, push.error) {
                assert!(error < force, "{load}: {push:?}");
            }
        }
    }
}

/// The load at the tip of a standing round column within 1e-6 of that of its own weight: from the
/// equation of [`STANDING`], with 4000 steps.
const NEARLY_GREENHILL: [f64; 2] = [7.8373396, 2.6129806572622154e-6];

/// There coarse grids bear hundreds of times as much; what is extrapolated over them is known.
#[test]
fn a_column_within_a_millionth_of_its_load_has_a_margin() {
    let [weight, right] = NEARLY_GREENHILL;
    let column = rod(&format!("{RIGID}; load.gravity=[{:?}, 0, 0]", -weight));
    let margin = margin(&column);
    let down = push(&margin, "-x");
    let (force, error) = (down.force.unwrap(), down.error.unwrap());
    close(&format!("{down:?}"), force, right, error);
    assert!(error < 0.5 * right, "{down:?}");
    for direction in ["+y", "-y", "+z", "-z"] {
        let across = push(&margin, direction);
        assert_eq!(across.kind, InstabilityKind::NoneUpTo, "{across:?}");
    }
}
