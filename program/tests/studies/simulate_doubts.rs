//! A motion that starts at an unstable equilibrium, and stays there as nothing displaces the leaf the
//! way it would leave, is told so.

use leafdyn::simulate::{MotionDoubt, Options, Scheme, Simulation};
use leafdyn_testing::motion::{moving, run};
use leafdyn_testing::workplace::{Json, Workplace};
use leafdyn_testing::*;

/// A column along e1 under a load along it, over the Euler load if above pi^2/4.
fn column(load: f64, how: &str) -> Scenario {
    rod(&format!("load.tip_force=[{}, 0, 0]; {how}", -load))
}

fn doubts(leaf: &Scenario) -> Vec<MotionDoubt> {
    let simulation = Simulation::new(leaf, &Options::default()).unwrap();
    simulation.doubts().to_vec()
}

#[test]
fn columns_over_their_buckling_load() {
    for (how, load, index) in [
        ("", 2.3, 0),
        ("", 2.6, 2),
        ("", 8.0, 2),
        ("stiffness.axial=inf", 2.3, 0),
        ("stiffness.axial=inf", 2.6, 2),
        (RIGID, 2.46, 0),
        (RIGID, 2.48, 2),
        (RIGID, 30.0, 4),
    ] {
        let found = doubts(&column(load, how));
        let indices = found.iter().map(|doubt| match doubt {
            MotionDoubt::UnstableStart { index, .. } => *index,
            other => panic!("{other}"),
        });
        let wanted = Some(index).filter(|index| *index > 0);
        assert!(indices.eq(wanted), "{how}, {load}: {found:?}");
    }
}

/// The smallest deviation that is one leads away in time.
#[test]
fn a_push_is_no_doubt() {
    for (push, told) in [(0.0, 1), (1e-9, 1), (1e-3, 0)] {
        let mut leaf = column(4.0, "");
        leaf.dynamics.gravity = Schedule::constant([0.0, 0.0, -push]);
        assert_eq!(doubts(&leaf).len(), told, "{push}");
    }
}

/// A leaf that starts far from any equilibrium, one at rest, and one under no load at all.
#[test]
fn others_are_not_doubted() {
    for (name, overrides) in [
        ("motion/swing", ""),
        ("motion/curl", ""),
        ("motion/strike", ""),
        ("paper/fig10", "leaf.rods=5; dynamics.start='at-rest'"),
        ("paper/fig08", "leaf.rods=5"),
    ] {
        let leaf = scenario(name, overrides);
        assert_eq!(doubts(&leaf), [], "{name}");
    }
    for seed in 0..10 {
        assert_eq!(doubts(&parse(&real::leaf(seed))), [], "{seed}");
    }
}

/// What it says is true: both methods stay where they start, and leave after a push.
#[test]
fn nothing_moves_there() {
    for scheme in [Scheme::Explicit, Scheme::SemiImplicit] {
        let mut leaf = column(4.0, "dynamics.external_damping=0; dynamics.duration=1");
        let tip = |leaf: &Scenario| run(leaf, &moving(scheme, None)).tips(true)[0];
        assert_eq!(tip(&leaf).z, 0.0);
        leaf.dynamics.gravity = Schedule::constant([0.0, 0.0, -1e-3]);
        assert!(tip(&leaf).z < -2e-4);
    }
}

#[test]
fn it_is_told_everywhere() {
    let place = Workplace::new();
    let straight = "simulate leaf.toml --set leaf.rods=1 --set leaf.fan=[0] --set coupling.y=0 --set coupling.z=0 \
                    --set load.gravity=[-15,0,0] --set dynamics.duration=0.2";
    let run = place.ok(straight);
    run.says(&["\n  doubtful the motion starts at an unstable equilibrium ("]);
    let told = place.run(format!("{straight} --json"));
    assert!(
        told.err
            .starts_with("small: the motion starts at an unstable equilibrium (")
    );
    let doubts = told.ends(0).json()["doubts"].clone();
    assert_eq!(doubts.list().len(), 1);
    let quiet = place
        .ok("simulate leaf.toml --json --set dynamics.duration=0.2")
        .json();
    assert_eq!(quiet.get("doubts"), None);
}
