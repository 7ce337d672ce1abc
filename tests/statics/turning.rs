//! Veins that turn about the axis of their base without resistance: circles of equilibria, whose
//! one eigenvalue is zero, and no bifurcations.

use std::f64::consts::{PI, TAU};

use leafdyn::internals::leaf::Leaf;
use leafdyn::internals::motion::Physics;
use leafdyn::relax::{EquilibriumDoubt, SemiImplicit};
use leafdyn::study::{
    CheckOptions, CheckVerdict, check, equilibria, relax_with_sensitivities, trace,
};
use leafdyn_testing::branch::{changes_at, request};
use leafdyn_testing::motion::{discrete, state_of};
use leafdyn_testing::random::Draw;
use leafdyn_testing::vibration::Linear;
use leafdyn_testing::*;
use nalgebra::SymmetricEigen;

/// The entries of a rod that is clamped in line at both ends.
fn clamped(place: f64, twist: f64) -> String {
    format!("tip.held='clamped'; tip.position=[{place}, 0, 0]; tip.twist={twist}")
}

/// Energies of a rod with A1 = A2 = A3 = 1 whose ends are 0.3 apart, by minimisation on 60
/// segments, extrapolated, and of a ring.
#[test]
fn round_arches_and_rings_come_to_rest() {
    for (place, twist, least, most) in [
        (0.3, 0.0, 34.19, 34.20),
        (0.3, TAU, 23.5555, 23.5565),
        (0.0, TAU, 2.0 * PI * PI - 1e-4, 2.0 * PI * PI + 1e-4),
    ] {
        let leaf = settle(&rod(&format!("{RIGID}; {}", clamped(place, twist))), 1e-6);
        let energy = leaf.energy.unwrap();
        assert!(
            least < energy && energy < most,
            "{place}, {twist}: {energy}"
        );
        assert_eq!(leaf.stability.neutral_directions, 1);
        assert_eq!(leaf.stable(), Some(true));
    }
}

/// A random round rod: clamped in line and twisted, pinned, or a column, of finite stiffness.
fn random(draw: &mut Draw) -> String {
    let stiffness = format!(
        "stiffness.torsion={}; {}",
        draw.uniform(0.6, 1.2),
        set_stiffness(draw.log(100.0, 1e4), draw.log(100.0, 1e4))
    );
    let held = match (3.0 * draw.even()) as usize {
        0 => clamped(draw.uniform(0.0, 0.95), draw.uniform(-6.0, 6.0)),
        1 => format!(
            "tip.held='pinned'; tip.position=[{}, 0, 0]",
            draw.uniform(0.1, 0.9)
        ),
        _ => format!("load.gravity=[{}, 0, 0]", draw.uniform(-30.0, -8.5)),
    };
    format!("{stiffness}; {held}")
}

/// Of rods at rest on one grid the dense matrix, without a phase condition, has as many negative
/// eigenvalues as are counted, and one that is zero for the turn.
#[test]
fn counts_are_those_of_the_dense_matrix() {
    let (mut draw, mut turning) = (Draw(11), 0);
    let rods = asked("ROUND_RODS", 500);
    for _ in 0..rods {
        let entries = random(&mut draw);
        let scenario = rod(&entries);
        for options in [iterated(1e-12, 16), keeping(iterated(1e-12, 16))] {
            let leaf = settled(&scenario, &options);
            let own = Leaf::new(&scenario);
            let grid = discrete(&own, 16);
            let linear = Linear::new(&grid, &Physics::new(&own), &state_of(&scenario, &leaf));
            let values = SymmetricEigen::new(linear.scaled()).eigenvalues;
            let count = |of: &dyn Fn(f64) -> bool| values.iter().filter(|it| of(**it)).count();
            let zero = count(&|value| value.abs() < 1e-5);
            assert_eq!(zero, leaf.stability.neutral_directions, "{entries}");
            let negative = count(&|value| value <= -1e-5);
            assert_eq!(
                leaf.stability.negative_eigenvalues,
                Some(negative),
                "{entries}"
            );
            turning += zero;
        }
    }
    assert!(turning > 2 * rods / 3, "{turning} of {rods}");
}

/// The relaxation and shooting tell the same member of a circle, and the same index.
#[test]
fn both_methods_tell_the_same_member() {
    let mut draw = Draw(5);
    for _ in 0..asked("ROUND_RODS", 20) {
        let entries = random(&mut draw);
        let scenario = rod(&entries);
        let found = check(&scenario, &CheckOptions::default(), &mut |_| {}).unwrap();
        assert_eq!(found.verdict, CheckVerdict::Agree, "{entries}");
        assert_eq!(found.relaxed.stability.neutral_directions, 1, "{entries}");
    }
}

/// The eigenvalue of the turn is zero exactly, and the next one that of the buckled column.
#[test]
fn the_turn_is_the_first_mode() {
    let column = rod(&format!("{RIGID}; load.gravity=[-9, 0, 0]"));
    let leaf = settled(&column, &with_modes(3, to(1e-6)));
    let modes = leaf.stability.modes.as_ref().unwrap();
    assert_eq!((modes[0].eigenvalue, modes[0].error), (0.0, Some(0.0)));
    assert!(modes[1].eigenvalue > 1.0);
    assert!(
        tip(&leaf).z < -0.6 && tip(&leaf).y.abs() < 1e-9,
        "{}",
        tip(&leaf)
    );
}

/// Of a circle of equilibria one is listed.
#[test]
fn a_circle_is_one_family() {
    let (how, limit) = (SemiImplicit::default(), Limit::default());
    for (entries, count) in [
        (clamped(0.0, TAU), 1),
        ("load.gravity=[-9, 0, 0]".into(), 2),
        (clamped(0.9, 6.0), 1),
    ] {
        let scenario = rod(&format!("{RIGID}; {entries}"));
        let all = equilibria(&scenario, how, Some(1e-5), &limit, &mut |_, _| {}).unwrap();
        assert_eq!(all.found.len(), count, "{entries}");
    }
}

/// A trace over the twist passes where nothing is singular but the turn, also where the stiffness is
/// beyond that with which forces are condensed out.
#[test]
fn traces_meet_no_false_bifurcation() {
    let round = format!("{RIGID}; {}; stiffness.torsion=0.7", clamped(0.9, 2.0));
    let stiff = format!("{}; {}", set_stiffness(1.1e5, 1.1e5), clamped(0.9, 2.0));
    for entries in [round, stiff] {
        let mut request = request(base(ROD, &entries), "tip.twist=2..3", 1e-7, 500);
        request.keep_unstable = false;
        let trace = trace(&request, &mut |_, _, _| {}).unwrap();
        assert!(trace.complete, "{entries}: {:?}", trace.remark);
        assert_eq!(trace.branches[0].points[0].index, 0);
        changes_at(&entries, &trace, &[], 0.0);
    }
}

/// What decides where the leaf turns to has no derivative; what it turns with has.
#[test]
fn numbers_that_break_the_symmetry_have_no_derivative() {
    let column = base(ROD, "load.gravity=[-9, 0, 0]");
    let keys = [
        "stiffness.bending_2",
        "stiffness.bending_2+stiffness.bending_3",
        "load.gravity[1]",
    ];
    let keys: Vec<_> = keys.iter().map(|key| key.parse().unwrap()).collect();
    let leaf = relax_with_sensitivities(&column, &keys, &to(1e-6), &mut |_| {}).unwrap();
    let known = only(leaf.sensitivities.as_ref().unwrap());
    assert_eq!(known.key, "stiffness.bending_2+stiffness.bending_3");
    let doubts = leaf.doubts.iter().map(EquilibriumDoubt::code);
    assert!(doubts.eq(["no-derivative"; 2]), "{:?}", leaf.doubts);
    let tip_at = |stiffness: f64| {
        let both = format!("stiffness.bending_2={stiffness}; stiffness.bending_3={stiffness}");
        tip(&settle(
            &rod(&format!("load.gravity=[-9, 0, 0]; {both}")),
            1e-9,
        ))
    };
    let difference = (tip_at(1.0 + 1e-4) - tip_at(1.0 - 1e-4)) / 2e-4;
    let off = (known.tips[0] - difference).length();
    assert!(
        off < 1e-4 * difference.length(),
        "{} for {difference}",
        known.tips[0]
    );
}

/// Arches and columns are the same in whichever direction they are laid.
#[test]
fn rods_along_any_direction_are_alike() {
    let laid = |angle: f64, twist: f64| {
        let (x, y) = (angle.cos(), angle.sin());
        let arch = format!(
            "tip.held='clamped'; tip.position=[{}, {}, 0]; tip.angles={angle}; tip.twist={twist}",
            0.3 * x,
            0.3 * y
        );
        let column = format!("load.gravity=[{}, {}, 0]", -9.0 * x, -9.0 * y);
        [arch, column].map(|entries| {
            let entries = format!("{RIGID}; leaf.fan=[{angle}]; {entries}");
            settled(&rod(&entries), &with_modes(3, to(1e-6)))
        })
    };
    for twist in [0.0, 2.0] {
        let along_x = laid(0.0, twist);
        for angle in [0.5, 1.0, -0.5, 0.2].map(|part| part * PI) {
            for (found, wanted) in laid(angle, twist).iter().zip(&along_x) {
                let [index, same] = [found, wanted].map(|leaf| leaf.stability.negative_eigenvalues);
                assert_eq!(index, same);
                assert_eq!(found.stability.neutral_directions, 1);
                let [energy, same] = [found, wanted].map(|leaf| leaf.energy.unwrap());
                let what = format!("{angle}, {twist}");
                close(&what, energy, same, 1e-7 * same.abs());
            }
        }
    }
}

/// Two columns that nothing ties together: what turns is each of the round ones, whatever the
/// other is, and they come to rest as alone.
#[test]
fn untied_veins_turn_each_for_itself() {
    let text = r#"
        name = "two"
        leaf = { rods = 2, length = 1.0, fan = [0.0, 0.0], joined = false }
        stiffness = { torsion = 1.0, bending_2 = 1.0, bending_3 = 1.0, axial = inf, shear_2 = inf, shear_3 = inf }
        load = { gravity = [-9.0, 0.0, 0.0] }
    "#;
    let column = |entries: &str| {
        let entries = format!("{RIGID}; load.gravity=[-9, 0, 0]; {entries}");
        settled(&rod(&entries), &with_modes(3, to(1e-8)))
    };
    let round = column("");
    let strip = column("stiffness.bending_3=3");
    for (stiffness, other, turning) in [("[3.0, 1.0]", &strip, 1), ("[1.0, 1.0]", &round, 2)] {
        let scenario = base(text, &format!("stiffness.bending_3={stiffness}"));
        let leaf = settled(scenario.scenario(), &with_modes(4, to(1e-8)));
        assert_eq!(leaf.stable(), Some(true));
        assert_eq!(leaf.stability.neutral_directions, turning, "{stiffness}");
        assert_eq!(leaf.doubts, []);
        assert_eq!(leaf.remark, None);
        let energy = round.energy.unwrap() + other.energy.unwrap();
        close(stiffness, leaf.energy.unwrap(), energy, 1e-7);
        let modes = leaf.stability.modes.as_ref().unwrap();
        let zero = modes.iter().filter(|mode| mode.eigenvalue == 0.0).count();
        assert_eq!(zero, turning, "{stiffness}");
        assert!(modes[turning].eigenvalue > 1.0, "{stiffness}");
        let found = check(scenario.scenario(), &CheckOptions::default(), &mut |_| {}).unwrap();
        assert_eq!(found.verdict, CheckVerdict::Agree, "{stiffness}");
    }
}

/// A leaf that can turn is the same of its circle at every tolerance, without modes as with them: its
/// bar holds against a finer one.
#[test]
fn bars_of_leaves_that_can_turn_hold() {
    let golden = |k: usize| (k as f64 * 0.618_033_988_749_895).fract();
    for seed in 0..8 {
        let number = |k: usize, low: f64, high: f64| low + (high - low) * golden(9 * seed + k);
        let more = match seed % 2 {
            0 => format!(
                "leaf.base_held = \"pinned\"\nrest.bend_2 = {:?}\nrest.bend_3 = {:?}\nload.tip_force = [{:?}, {:?}, 0.0]\nstiffness.bending_2 = 2.0",
                number(1, -3.0, 3.0),
                number(2, -1.0, 1.0),
                number(3, 2.0, 5.0),
                number(4, 2.0, 5.0),
            ),
            _ => format!(
                "rest.twist = {:?}\nload.tip_force = [{:?}, 0.0, 0.0]\nstiffness.bending_2 = 1.0",
                number(1, 1.0, 4.0),
                number(2, -6.0, -3.5),
            ),
        };
        let rod = parse(&format!(
            r#"
            leaf.rods = 1
            leaf.length = 1.0
            leaf.fan = [0.0]
            stiffness.torsion = 0.6
            stiffness.bending_3 = 1.0
            stiffness.axial = inf
            stiffness.shear_2 = inf
            stiffness.shear_3 = inf
            {more}
            "#
        ));
        let fine = settle(&rod, 1e-10);
        for tolerance in [1e-4, 1e-6, 1e-8] {
            let leaf = settle(&rod, tolerance);
            let bar = estimate(&leaf) + estimate(&fine);
            let off = distance(&leaf, &fine);
            assert!(off <= bar, "{seed}, {tolerance:e}: {off:e} beyond {bar:e}");
        }
    }
}
