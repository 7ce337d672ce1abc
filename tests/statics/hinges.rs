//! Leaves whose bases are held by hinges.

use leafdyn::relax::Method;
use leafdyn::scenario::PointLoad;
use leafdyn::study::{CheckOptions, CheckVerdict, check};
use leafdyn_testing::*;

/// Three different veins from hinges that are not in line, joined, loaded across.
const VEINS: &str = r#"
    name = "veins"
    leaf = { rods = 3, length = [1.0, 0.9, 1.1], fan = [0.2, 0.0, -0.2], base = [[0.0, -0.2, 0.0], [0.1, 0.0, 0.15], [0.0, 0.2, 0.0]], base_held = "pinned" }
    stiffness = { torsion = 0.8, bending_2 = 1.0, bending_3 = 2.0, axial = 100.0, shear_2 = 60.0, shear_3 = 80.0 }
    rest = { bend_2 = [0.3, -0.5, 0.4], bend_3 = [0.2, 0.1, -0.3] }
    load.gravity = [0.0, 0.3, -2.0]
"#;
const TISSUE: &str = "tissue.along=20.0; tissue.across=10.0; tissue.normal=15.0; tissue.fold=0.4";
const COUPLING: &str = "coupling.x=2.0; coupling.y=3.0; coupling.z=4.0";

/// A rod from the origin to where its tip is pinned, whose bending stiffness is one.
fn column(entries: &str) -> Scenario {
    let held = "leaf.base_held=pinned; tip.held=pinned; tip.position=[0.98, 0.0, 0.0]";
    rod(&format!("{}; {held}; {entries}", set_stiffness(1e3, 400.0)))
}

fn veins(entries: &str) -> Scenario {
    base(VEINS, entries).scenario().clone()
}

/// The column with a dead moment on a point.
fn moment_at(at: f64, entries: &str) -> Scenario {
    let mut scenario = column(entries);
    scenario.points.push(PointLoad {
        vein: 0,
        at,
        force: [0.0; 3],
        moment: [0.3, 0.8, -0.4],
        follows: false,
        mass: 0.0,
        offset: [0.0; 2],
        in_time: None,
        landing: None,
    });
    scenario
}

/// The rods at the ends of eight equal parts, whatever the grid.
fn eighths(leaf: &Equilibrium) -> Vec<RodShape> {
    let rod = |rod: &RodShape| {
        let stride = (rod.nodes.len() - 1) / 8;
        let nodes = rod.nodes.iter().step_by(stride).copied().collect();
        RodShape {
            nodes,
            ..rod.clone()
        }
    };
    leaf.shape.rods.iter().map(rod).collect()
}

/// Relaxation and shooting, which share neither grids nor elements, find the same leaves, circles
/// and families of them too.
#[test]
fn shooting_finds_the_same_leaves() {
    let uneven = "leaf.length=1.0; leaf.joined=false";
    for (leaf, neutral) in [
        (veins(""), 0),
        (veins(COUPLING), 0),
        (veins(TISSUE), 0),
        (veins(&format!("{TISSUE}; leaf.joined=false")), 0),
        (veins(uneven), 3),
        (
            veins(
                "stiffness.bending_3=1.0; stiffness.shear_2=80.0; rest.bend_2=0.0; rest.bend_3=0.0",
            ),
            3,
        ),
        (
            veins("tip.held=clamped; tip.position=[0.7, 0.1, -0.3]; tip.angles=0.4; tip.twist=0.5"),
            0,
        ),
        (column(""), 2),
        (column("stiffness.bending_3=3.0"), 1),
        (column("load.gravity=[0.0, 1.0, -4.0]"), 1),
        (
            column("stiffness.bending_3=3.0; load.gravity=[0.0, 1.0, -4.0]"),
            0,
        ),
        (column("tip.position=[0.999, 0.0, 0.0]"), 1),
        (column("tip.held=clamped; tip.twist=1.5"), 1),
        (
            moment_at(0.3, "tip.held=clamped; tip.position=[1.0, 0.0, 0.0]"),
            0,
        ),
        (
            moment_at(0.37, "tip.held=clamped; stiffness.bending_3=3.0"),
            0,
        ),
        (column("tip.held=clamped; stiffness.bending_3=2.0"), 0),
    ] {
        let options = CheckOptions {
            tolerance: Some(1e-9),
            ..CheckOptions::default()
        };
        let found = check(&leaf, &options, &mut |_| {}).unwrap();
        let what = format!("{}: {:?}, {:?}", leaf.name, found.verdict, found.difference);
        assert_eq!(found.verdict, CheckVerdict::Agree, "{what}");
        let difference = found.difference.unwrap();
        assert!(
            difference.position < 1e-9 && difference.moment < 1e-8,
            "{what}"
        );
        assert_eq!(
            found.relaxed.stability.neutral_directions, neutral,
            "{what}"
        );
        // A hinge carries no moment.
        for rod in &found.relaxed.shape.rods {
            let moment = rod.nodes[0].m.length();
            assert!(moment < 1e-8, "{what}: {moment:e}");
        }
    }
}

/// The shapes of one grid converge in second order to those of shooting.
#[test]
fn positions_converge_in_second_order() {
    for leaf in [
        veins(TISSUE),
        veins(""),
        column("load.gravity=[0.0, 1.0, -4.0]; stiffness.bending_3=3.0"),
    ] {
        let errors = [8, 16, 32].map(|segments| {
            let found = settled(&leaf, &iterated(1e-12, segments));
            let exact = shot_near(&leaf, &found);
            largest(
                nodes(&found.shape.rods)
                    .zip(nodes(&exact.rods))
                    .map(|(a, b)| a.position.distance(b.position)),
            )
        });
        for pair in errors.windows(2) {
            close(&leaf.name, order(pair[0], pair[1]), 2.0, 0.1);
        }
    }
}

/// By every method and from every start.
#[test]
fn every_method_leads_to_the_same_rest() {
    for leaf in [
        veins(""),
        veins(TISSUE),
        column("load.gravity=[0.0, 1.0, -4.0]"),
    ] {
        let own = settle(&leaf, 1e-8);
        for method in [
            Method::Explicit { segments: None },
            Method::ShootingFromRest { intervals: None },
        ] {
            let other = settled(&leaf, &by(method, to(1e-8)));
            let apart = apart(&leaf, &eighths(&own), &eighths(&other));
            assert!(
                apart.position < 2e-8,
                "{}, {method:?}: {apart:?}",
                leaf.name
            );
        }
    }
}

/// A rod on a hinge hangs; longer by half of its weight over its stiffness. Upright it falls.
#[test]
fn a_pendulum_hangs() {
    for other in [1.0, 2.0] {
        let hanging = format!(
            "leaf.base_held=pinned; leaf.fan=[0.3]; load.gravity=[0.0, 0.0, -2.0]; stiffness.bending_3={other}"
        );
        let found = settle(&rod(&hanging), 1e-10);
        let tip = only(&found.tips);
        assert!(tip.distance(-1.01 * DVec3::Z) < 1e-10, "{tip}");
        close(
            "energy",
            found.energy.unwrap(),
            -1.0 - 2.0 * 2.0 / 600.0,
            1e-10,
        );
        assert_eq!(found.stability.negative_eigenvalues, Some(0));
        assert_eq!(found.stability.neutral_directions, 1);
        let upright = format!("{hanging}; leaf.fan=[0.0]; leaf.elevation=1.5707963267948966");
        let kept = kept(&rod(&upright), 1e-8);
        assert_eq!(kept.stability.negative_eigenvalues, Some(2));
        assert!(only(&kept.tips).distance(0.99 * DVec3::Z) < 1e-8);
        let fallen = settle(&rod(&upright), 1e-10);
        assert!(only(&fallen.tips).distance(-1.01 * DVec3::Z) < 1e-10);
    }
}

/// Joined veins on one hinge hang as one, however many; without loads they point anywhere.
#[test]
fn a_fan_on_one_hinge_hangs() {
    let fan = "leaf.base=[0.0, 0.0, 0.0]; leaf.length=1.0; rest.bend_2=0.0; rest.bend_3=0.0";
    let hanging = settle(
        &veins(&format!("{fan}; load.gravity=[0.0, 0.0, -2.0]")),
        1e-9,
    );
    assert!(only(&hanging.tips).distance(-1.01 * DVec3::Z) < 1e-8);
    assert_eq!(hanging.stability.neutral_directions, 3);
    assert_eq!(hanging.stability.negative_eigenvalues, Some(0));
    let unloaded = veins(&format!("{fan}; load.gravity=[0.0, 0.0, 0.0]"));
    let refused = leafdyn::relax::relax(&unloaded, &to(1e-6), &mut |_| {});
    let said = refused.unwrap_err().to_string();
    assert!(
        said.contains("without a load nothing holds the leaf"),
        "{said}"
    );
}

/// What leads a leaf from arcs to rest has nothing to begin with on hinges.
#[test]
fn shooting_from_arcs_is_refused() {
    let options = by(Method::Shooting { intervals: None }, to(1e-6));
    let refused = leafdyn::relax::relax(&veins("leaf.base=[0.0, 0.0, 0.0]"), &options, &mut |_| {});
    let said = refused.unwrap_err().to_string();
    assert!(said.contains("leaf.base_held"), "{said}");
}
