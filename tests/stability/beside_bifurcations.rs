//! Beside a bifurcation a coarse grid may call stable what is not: finer grids are asked
//! until the signs of the lowest eigenvalues are those of the leaf, and not of a grid. From
//! what is unstable a leaf falls.

use leafdyn::internals::branch::{BranchEquations, LeafFamily};
use leafdyn::internals::leaf::{DiscreteLeaf, Grid};
use leafdyn::internals::relax::{initial_state, relax_from_state};
use leafdyn::relax::{EquilibriumDoubt, Event, StabilityLoss};
use leafdyn_testing::branch::{self, text, weightless};
use leafdyn_testing::*;

/// Euler's load of the clamped-free column, EI = L = 1.
const EULER: f64 = PI * PI / 4.0;

fn column(load: f64, stiffness: f64, other: f64) -> Scenario {
    let (stiffness, load) = (set_stiffness(stiffness, stiffness), -load);
    let pushed = format!("load.tip_force=[{load}, 0, 0]");
    rod(&format!(
        "{stiffness}; stiffness.bending_2={other:?}; {pushed}"
    ))
}

/// Part by which a load P is beyond Euler's, and how far the tip of the elastica is aside then:
/// 2 k/sqrt(P) with the sine k of half of its angle (closed form, elliptic integrals).
const ELASTICA: &str = "
    -1e-2  0
    -1e-3  0
    -2e-4  0
     2e-4  0.025458744341491136
     1e-3  0.05687346057602799
     1e-2  0.17794836085642246
";

/// Eight segments bear 0.65 % more than the column, sixteen 0.16 %.
#[test]
fn a_column_is_straight_below_its_load_and_bent_above() {
    let rigid = f64::INFINITY;
    for (stiffness, other) in [(1e3, 1.0), (1e3, 1000.0), (rigid, 1.0), (rigid, 1000.0)] {
        for tolerance in [1e-3, 1e-6] {
            for [beyond, expected] in table(ELASTICA) {
                let leaf = settle(&column(EULER * (1.0 + beyond), stiffness, other), tolerance);
                let aside = tip(&leaf).y.hypot(tip(&leaf).z);
                assert_eq!(leaf.stability.negative_eigenvalues, Some(0));
                if stiffness.is_infinite() {
                    close("tip", aside, expected, tolerance);
                }
                assert_eq!(aside > 1e-12, beyond > 0.0, "{stiffness} {other} {beyond}");
            }
        }
    }
}

/// The index of the straight round column is 2 k between its k-th and its next load, (k - 1/2)^2
/// pi^2, whatever modes are requested. Grids are stiffer: up to 0.8 % beyond the third load the
/// three coarsest have the index before it.
#[test]
fn the_index_of_a_straight_column_that_is_kept_is_right_beside_every_load() {
    for (k, of_euler) in [(1, 9.0), (2, 25.0), (3, 49.0)] {
        for (beyond, index) in [(-1e-3, 2 * k), (1e-3, 2 * (k + 1))] {
            for modes in [0, 3] {
                let options = Options {
                    modes,
                    ..keeping(Options::default())
                };
                let scenario = column(EULER * of_euler * (1.0 + beyond), 1e3, 1.0);
                let found = relaxed(&scenario, &options).stability;
                let what = format!("load {k}, {beyond}, {modes} modes");
                assert_eq!(found.negative_eigenvalues, Some(index), "{what}");
                let listed = found.modes.map_or(0, |modes| modes.len());
                assert_eq!(listed, modes, "{what}");
            }
        }
    }
}

/// A column held at its tip, and the tip's travel at which it buckles: with P/EA = e the
/// load of Euler is P (1 - e).
fn held(how: &str, other: f64, beyond: f64) -> Scenario {
    const AXIAL: f64 = 1e3;
    let euler = match how {
        "clamped" => 4.0 * PI * PI,
        _ => 20.190_728_556_426_63,
    };
    let critical = 0.5 * (1.0 - (1.0 - 4.0 * euler / AXIAL).sqrt());
    rod(&format!(
        "{}; stiffness.bending_2={other:?}; tip.held={how:?}; tip.position=[{:?}, 0, 0]",
        set_stiffness(AXIAL, f64::INFINITY),
        1.0 - critical * (1.0 + beyond)
    ))
}

/// A strip that a force at its tip turns out of its plane, TIP sqrt(EI GJ) being the least:
/// see the test of lateral buckling.
fn strip(beyond: f64) -> Scenario {
    const TIP: f64 = 4.536899035739;
    pushed_up(0.8, 10.0, -TIP * 0.8_f64.sqrt() * (1.0 + beyond))
}

/// A strip with these stiffnesses, and a force at its tip.
fn pushed_up(torsion: f64, strong: f64, force: f64) -> Scenario {
    let section = format!("stiffness.torsion={torsion}; stiffness.bending_2={strong}");
    rod(&format!(
        "{RIGID}; {section}; load.tip_force=[0, 0, {force:?}]"
    ))
}

/// Up to its load a leaf stays in its plane, beyond it does not.
fn assert_leaves_its_plane_beyond(what: &str, leaf: impl Fn(f64) -> Scenario) {
    for tolerance in [1e-3, 1e-6] {
        for beyond in [-1e-2, -1e-3, 1e-3, 3e-3, 1e-2, 2e-2, 6e-2] {
            let leaf = settle(&leaf(beyond), tolerance);
            assert_eq!(leaf.stability.negative_eigenvalues, Some(0));
            let aside = largest(nodes(&leaf.shape.rods).map(|node| node.position.y.abs()));
            let what = format!("{what} {tolerance} {beyond}: {aside}");
            assert_eq!(aside > 1e-9, beyond > 0.0, "{what}");
        }
    }
}

/// Eight segments bear 11 % more than a column clamped at both ends, 5 % more than one that
/// is pinned at its tip. No modes are asked for.
#[test]
fn short_waves_are_not_taken_for_stable_columns() {
    for how in ["clamped", "pinned"] {
        for other in [3.0, 1e3] {
            let column = |beyond| held(how, other, beyond);
            assert_leaves_its_plane_beyond(&format!("{how} {other}"), column);
        }
    }
    assert_leaves_its_plane_beyond("strip", strip);
}

/// To a low tolerance four and eight segments suffice for a straight column, and call it stable
/// 5 % and more beyond its load.
#[test]
fn a_low_tolerance_does_not_hide_that_a_column_buckles() {
    let pinned = |tip: f64| {
        rod(&format!(
            "stiffness.torsion=1; stiffness.bending_2=0.2; stiffness.bending_3=0.5; {}; \
             tip.held=\"pinned\"; tip.position=[{tip:?}, 0, 0]",
            set_stiffness(5e3, f64::INFINITY)
        ))
    };
    for tip in [0.999_151_304_5, 0.998_9] {
        for tolerance in [1e-1, 1e-2, 3e-3, 1e-4] {
            for modes in [0, 3] {
                let leaf = settled(&pinned(tip), &with_modes(modes, to(tolerance)));
                assert_eq!(leaf.stability.negative_eigenvalues, Some(0));
                let aside = largest(nodes(&leaf.shape.rods).map(|it| it.position.z.abs()));
                assert!(aside > 1e-3, "{tip} {tolerance}: {aside}");
            }
        }
    }
}

/// Shooting ends at the straight column, and has the index that the relaxation has there.
#[test]
fn shooting_tells_the_index_beside_every_load() {
    for (k, of_euler) in [(1, 1.0), (2, 9.0), (3, 25.0)] {
        for (beyond, index) in [(-1e-3, 2 * (k - 1)), (1e-4, 2 * k), (1e-3, 2 * k)] {
            let column = column(EULER * of_euler * (1.0 + beyond), f64::INFINITY, 1.0);
            let shot = relaxed(&column, &by(Method::Shooting { intervals: None }, to(1e-6)));
            let found = shot.stability.negative_eigenvalues;
            assert_eq!(found, Some(index), "load {k}, {beyond}");
        }
    }
}

/// Whether a saddle is one is told by counts; eigenvalues are computed only for what is close
/// to zero.
#[test]
fn the_index_of_a_saddle_takes_few_factorizations() {
    let leaf = parse(
        r#"
        name = "pushed-back"
        [leaf]
        rods = 3
        length = 1.0
        fan = "symmetric"
        [stiffness]
        torsion = 0.5379
        bending_2 = 0.0340
        bending_3 = 0.5699
        axial = 30000.0
        shear_2 = 30000.0
        shear_3 = 30000.0
        [coupling]
        y = 0.0
        z = 17.45
        [load]
        gravity = [-5.61, 0.0, 0.0]
        "#,
    );
    let found = relaxed(&leaf, &keeping(to(1e-3)));
    assert_eq!(found.stability.negative_eigenvalues, Some(29));
    assert!(found.stability.modes.is_none());
    assert!(found.work.factorizations < 100, "{:?}", found.work);
}

/// A leaf far from any bifurcation is proved stable by one factorisation; another one tells
/// its error.
#[test]
fn clearly_stable_leaves_cost_one_factorization() {
    for rods in [5, 35] {
        let leaf = settle(&scenario("paper/fig04", &format!("leaf.rods={rods}")), 1e-6);
        let work = leaf.work;
        assert_eq!(work.factorizations, work.steps + 2, "{work:?}");
        assert_eq!(work.force_evaluations, work.steps + 2, "{work:?}");
    }
}

/// The flat leaf that waves beyond a2/a3 = 0.087 at a1 = 2.42, and 0.0694 at 4.76.
fn flat(bending: f64, torsion: f64, modes: usize) -> Equilibrium {
    let flat = scenario("study/undulation", &weightless(bending, torsion));
    settled(&flat, &with_modes(modes, to(1e-4)))
}

/// Short waves, which 32 segments make stiffer by more than the lowest eigenvalue is: it
/// takes the eigenvalues to see that.
#[test]
fn a_flat_leaf_waves_where_its_eigenvalues_say_so() {
    for (bending, torsion) in [(0.0864, 2.42), (0.069, 4.76)] {
        for modes in [0, 2] {
            let leaf = flat(bending, torsion, modes);
            assert_eq!(leaf.stability.negative_eigenvalues, Some(0));
            assert!(leaf.stability.saddle.is_some());
            assert!(leaf.doubts.is_empty(), "{:?}", leaf.doubts);
            assert!(leaf.tips[0].z.abs() > 1e-4, "{}", leaf.tips[0]);
        }
    }
    let leaf = flat(0.0872, 2.42, 2);
    let lowest = &leaf.stability.modes.as_ref().unwrap()[0];
    assert!(leaf.tips[0].z.abs() < 1e-12 && leaf.doubts.is_empty());
    assert!(lowest.eigenvalue > 10.0 * lowest.error.unwrap());
}

/// A round column that has buckled may turn about its axis: an eigenvalue that is zero
/// asks for no finer grids.
#[test]
fn a_neutral_mode_is_no_doubt() {
    let column = column(1.3 * EULER, 1e3, 1.0);
    for modes in [0, 1, 3] {
        let leaf = settled(&column, &with_modes(modes, to(1e-6)));
        assert!(leaf.doubts.is_empty());
        assert!(*leaf.accuracy.segments.last().unwrap() <= 256);
    }
}

/// Where rounding forbids finer grids, the extrapolated eigenvalues decide: 10^-5 beyond its
/// load a rigid column is at a saddle, though stable on every grid. Where these do not tell
/// either, that is said.
#[test]
fn what_no_grid_can_tell_the_eigenvalues_do() {
    for (other, index) in [(1.0, 2), (1000.0, 1)] {
        for (tolerance, modes) in [(1e-3, 0), (1e-6, 0), (1e-6, 1), (1e-6, 3)] {
            for beyond in [1e-5, 2e-5, -1e-5] {
                let column = column(EULER * (1.0 + beyond), f64::INFINITY, other);
                let leaf = settled(&column, &with_modes(modes, to(tolerance)));
                let (outcome, index) = match beyond > 0.0 {
                    true => (Outcome::Saddle, index),
                    false => (Outcome::Converged, 0),
                };
                let what = format!("{other} {tolerance} {modes} {beyond}");
                assert_eq!(leaf.outcome, outcome, "{what}");
                assert_eq!(leaf.stability.negative_eigenvalues, Some(index));
            }
        }
    }
    let leaf = settled(&flat_strip(1e-5), &with_modes(3, to(1e-6)));
    assert!((leaf.doubts).contains(&EquilibriumDoubt::UndecidedStability));
}

/// A strip of 10^8 times the stiffness in its plane, loaded by so much more than what it bears.
fn flat_strip(beyond: f64) -> Scenario {
    pushed_up(0.5, 1e8, 4.0126 * 0.5_f64.sqrt() * (1.0 + beyond))
}

/// The first grid finer than those of its shape is stuck where these are: the strip starts again
/// there, and buckles, or it is said to be unstable. It is not called stable while it is flat.
#[test]
fn a_leaf_starts_again_on_the_grid_that_decides() {
    let leaf = settled(&flat_strip(3e-3), &with_modes(3, to(1e-6)));
    let buckled = tip(&leaf).y.abs() > 0.04;
    let index = leaf.stability.negative_eigenvalues;
    assert_eq!(index, Some(usize::from(!buckled)), "{}", tip(&leaf));
    assert!(buckled || leaf.outcome == Outcome::Saddle);
}

/// On 30,000 segments rounding is larger than the eigenvalue of a column 15 % beyond its load.
#[test]
fn what_rounding_hides_is_not_stable() {
    let column = scenario("classic/elastica_buckled", "");
    for segments in [10_000, 30_000] {
        let leaf = settled(&column, &on(segments));
        let upright = tip(&leaf).y.abs() < 1e-3;
        let index = leaf.stability.negative_eigenvalues;
        assert!(
            index.is_none() || (!upright && index == Some(0)),
            "{index:?}"
        );
    }
}

/// The flat leaf of the study of undulation, far beyond its boundary, to rounding.
#[test]
fn a_leaf_falls_off_a_saddle_that_it_stands_on_exactly() {
    let base = base(&text("study/undulation"), &weightless(0.146, 1.59));
    let scenario = base.scenario();
    let make = |_: [f64; 1]| Ok(scenario.clone());
    let family = LeafFamily::new(&make, [0.0, 1.0], false).unwrap();
    let leaf = Leaf::new(scenario);
    let grid = Grid::new(32, leaf.kinks());
    let from = initial_state(&DiscreteLeaf::new(&leaf, grid.clone()));
    let mut equations = BranchEquations::new(&family, grid.clone());
    let flat = equations.correct(&from, 0.0, None).ok().unwrap();
    assert!(flat.index > 1, "{}", flat.index);
    assert!(flat.state.x.iter().all(|x| x.z.abs() < 1e-12));
    let rest = relax_from_state(&leaf, &grid, flat.state.clone(), &Limit::default()).unwrap();
    let rest = equations.correct(&rest, 0.0, None).ok().unwrap();
    assert_eq!(rest.index, 0);
    assert!(rest.state.largest_displacement_to(&flat.state) > 1e-2);
}

/// A column a little beyond the loads of both of its planes, straight to the last digit: how many
/// modes are requested does not change that both are unstable.
#[test]
fn the_index_does_not_depend_on_how_many_modes_are_requested() {
    let column = rod(
        "stiffness.torsion=1.2496011635341304; stiffness.bending_2=2.065310299737473; \
         stiffness.bending_3=2.0655168307674465; stiffness.axial=1e5; stiffness.shear_2=inf; \
         stiffness.shear_3=inf; load.tip_force=[-5.096954363457133, 0, 0]",
    );
    for modes in [0, 1, 2, 3] {
        let leaf = relaxed(&column, &with_modes(modes, to(1e-10)));
        let index = leaf.stability.negative_eigenvalues;
        let straight = tip(&leaf).z.hypot(tip(&leaf).y) < 1e-6;
        assert_eq!(index, Some(if straight { 2 } else { 0 }), "{modes} modes");
        assert!(leaf.outcome != Outcome::Converged, "{modes} modes");
    }
}

/// A column beyond the weight under which a perfect one buckles, 7.84, and a little out of plumb.
fn leaning_column(push: f64) -> String {
    format!(
        r#"
        name = "column"
        leaf = {{ rods = 1, length = 1.0, fan = [0.0] }}
        stiffness = {{ torsion = 1.0, bending_2 = 1.0, bending_3 = 1.3, axial = inf, shear_2 = inf, shear_3 = inf }}
        load = {{ gravity = [-9.0, 0.0, {push:?}] }}
        "#
    )
}

/// Slow loading bends a nearly perfect column sharply, and to the side to which it leans: no stability is lost, and so
/// says the trace, which ends in the same shape. A perfect one turns to either side.
#[test]
fn a_column_out_of_plumb_bends_to_its_side() {
    for push in [4e-6, -4e-6, 4e-4, -2e-2] {
        let leaf = settle(&parse(&leaning_column(push)), 1e-7);
        let path = leaf.path.as_ref().unwrap();
        assert_eq!(path.word(), "stable-throughout", "{push}: {path:?}");
        let sharp = |event: &Event| event.happening == StabilityLoss::BentSharply;
        assert!(path.events().iter().all(sharp), "{push}");
        if push.abs() < 1e-3 {
            let part = path.events()[0].part;
            assert!((part - 7.8373 / 9.0).abs() < 0.05, "{push}: {part}");
        }
        let tip = leaf.tips[0];
        assert!(tip.z * push > 0.0 && tip.z.abs() > 0.5, "{push}: {tip}");
        let base = base(&leaning_column(push), "");
        let mut request = branch::request(base, "load.gravity[0]=-1..-9", 1e-7, 400);
        request.keep_unstable = false;
        let trace = leafdyn::study::trace(&request, &mut |_, _, _| {}).unwrap();
        let followed = &trace.branches[0];
        assert!(
            trace.complete && followed.critical_points().next().is_none(),
            "{push}"
        );
        let apart = followed.points.last().unwrap().tips[0].distance(tip);
        assert!(apart < 1e-5, "{push}: {apart:e}");
    }
    let perfect = settle(&parse(&leaning_column(0.0)), 1e-7);
    assert_eq!(perfect.path.unwrap().word(), "branched");
}
