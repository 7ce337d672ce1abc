//! Which veins turn without resistance.

use crate::scenario::Entries;
use crate::scenario::zero_energy::*;

fn turnings(change: &str) -> Vec<ZeroEnergyRotation> {
    turnings_with("", change)
}

fn turnings_with(tables: &str, change: &str) -> Vec<ZeroEnergyRotation> {
    scenario_with_tables(tables, change).zero_energy_rotations()
}

fn scenario_with_tables(tables: &str, change: &str) -> Scenario {
    let text = r#"
        name = "round"
        leaf = { rods = 2, length = [1.0, 0.8], fan = [0.0, 0.0], joined = false }
        stiffness = { torsion = 0.7, bending_2 = 1.0, bending_3 = 1.0, axial = inf, shear_2 = 9.0, shear_3 = 9.0 }
        coupling = { x = 1.0, y = 2.0, z = 2.0 }
        [load]
        gravity = [-3.0, 0.0, 0.0]
        "#;
    let entries = change.split("; ").filter(|entry| !entry.is_empty());
    let entries: Vec<_> = entries.map(|entry| entry.into()).collect();
    let text = format!("{text}\n{tables}");
    let given = Entries::from_text(&text, "round")
        .unwrap()
        .replaced(&entries);
    given.unwrap().check().unwrap()
}

fn rotation_about(axis: DVec3, rods: Range<usize>) -> ZeroEnergyRotation {
    ZeroEnergyRotation {
        rods,
        point: DVec3::ZERO,
        axis,
        section_rate: -1.0,
        includes_bent_veins: true,
        joints: Vec::new(),
    }
}

#[test]
fn only_what_has_no_preferred_direction_turns() {
    let both = [rotation_about(DVec3::X, 0..2)];
    assert_eq!(turnings(""), both);
    assert_eq!(turnings("rest.twist=0.4"), both);
    assert_eq!(turnings("rest.bend_2=0.1"), []);
}

/// A column that stands upright, or a force in its middle: along the axis nothing changes.
#[test]
fn loads_along_the_axis_leave_it_free_to_turn() {
    let upright =
        "leaf.elevation=1.5707963267948966; coupling.x=2; coupling.z=1; load.gravity=[0, 0, -3]";
    let axis = turnings(upright);
    assert!(axis.len() == 1 && axis[0].axis.distance(DVec3::Z) < 1e-15);
    assert_eq!(
        turnings(&upright.replace("coupling.z=1", "coupling.z=2.5; coupling.y=1")),
        []
    );
    let both = [rotation_about(DVec3::X, 0..2)];
    for (entry, turns) in [
        ("leaf.base=[-0.3, 0, 0]", true),
        ("leaf.base=[[0, 0, 0], [0, 0.1, 0]]", false),
        ("load.gravity=[[1, 0, 0], [-2, 0, 0]]", true),
        ("load.gravity=[[1, 0, 0], [-2, 0, 1]]", false),
        ("load.g=[-1, 0, 0]; dynamics.density=1", true),
        ("load.g=[0, 0, -1]; dynamics.density=1", false),
        (
            "load.distributed={at=[0, 1], value=[[0, 0, 0], [1, 0, 0]]}",
            true,
        ),
        (
            "load.distributed={at=[0, 1], value=[[0, 0, 0], [1, 1, 0]]}",
            false,
        ),
        ("tissue.normal=1", false),
    ] {
        assert_eq!(turnings(entry) == both, turns, "{entry}");
    }
    let held = |tables: &str, along: &str, across: &str| {
        for (vector, turns) in [(along, true), (across, false)] {
            let found = turnings_with(&tables.replace("VECTOR", vector), "");
            assert_eq!(found == both, turns, "{tables} {vector}");
        }
    };
    held(
        "[[load.point]]\nvein = 2\nat = 0.4\nforce = VECTOR",
        "[2, 0, 0]",
        "[0, 1, 0]",
    );
    held(
        "[[grip]]\nvein = 2\nat = 0.4\nheld = 'clamped'\nmove = VECTOR",
        "[-0.1, 0, 0]",
        "[0, 0, 1]",
    );
}

/// Veins that nothing ties together turn each for itself, and only those that are round.
#[test]
fn untied_veins_turn_each_for_itself() {
    let untied = "coupling.x=0; coupling.y=0; coupling.z=0";
    let each = [
        rotation_about(DVec3::X, 0..1),
        rotation_about(DVec3::X, 1..2),
    ];
    assert_eq!(turnings(untied), each);
    let strip = format!("{untied}; stiffness.bending_3=[3.0, 1.0]");
    assert_eq!(turnings(&strip), each[1..]);
    let aside = format!("{untied}; leaf.fan=[0.3, 0.0]");
    assert_eq!(turnings(&aside), each[1..]);
    assert_eq!(turnings(&format!("{aside}; leaf.joined=true")), []);
}

/// On hinges that hold the spin veins turn as on clamps, and round ones about the line of their loads.
#[test]
fn hinges_that_hold_the_spin_turn_as_clamps_do() {
    let held = "leaf.base_held=pinned; leaf.base_spin=held";
    assert_eq!(turnings_with("", held), turnings(""));
    let across = turnings_with(
        "",
        &format!("{held}; coupling.x=2; load.gravity=[0, 0, -1]"),
    );
    let [whole] = &across[..] else {
        panic!("{across:?}");
    };
    assert_eq!((whole.axis, whole.joints.len()), (-DVec3::Z, 2));
    let strip = format!("{held}; stiffness.bending_3=[3.0, 1.0]");
    assert_eq!(turnings_with("", &strip), []);
    let untied = format!("{held}; coupling.x=0; coupling.y=0; coupling.z=0; leaf.fan=[0.3, 0.0]");
    let found = turnings_with("", &untied);
    let [aside, along] = &found[..] else {
        panic!("{found:?}");
    };
    assert_eq!(*along, rotation_about(DVec3::X, 1..2));
    let joint = aside.joints[0];
    assert_eq!((aside.axis, aside.rods.clone()), (-DVec3::X, 0..1));
    // What turns so stays on its joint, to any angle.
    let base =
        joint.settled(joint.natural * DQuat::from_euler(glam::EulerRot::XYZ, 0.2, 0.7, -0.4));
    for angle in [0.3, 2.0] {
        let [turn, back] = aside.rotations(angle, 0, base);
        let turned = turn * base * back;
        assert!(joint.settled(turned).angle_between(turned) < 1e-7);
    }
    let root = Pose {
        position: DVec3::ZERO,
        rotation: base,
    };
    let [spin, _] = aside.node_velocity(root, 0, base, 1.0);
    let slope = |angle: f64| {
        let [turn, back] = aside.rotations(angle, 0, base);
        let turned = turn * base * back * base.conjugate();
        turned.to_scaled_axis() / angle
    };
    assert!(spin.distance(0.5 * (slope(1e-4) + slope(-1e-4))) < 1e-6);
    assert!(spin.dot(joint.axis(base)).abs() < 1e-14);
}

/// The turns of the two veins on hinges: as what, and about which axis.
fn on_hinges(tables: &str, change: &str) -> Vec<(Range<usize>, DVec3, f64, bool)> {
    let found = turnings_with(tables, &format!("leaf.base_held=pinned; {change}"));
    let parts = |it: &ZeroEnergyRotation| {
        (
            it.rods.clone(),
            it.axis,
            it.section_rate,
            it.includes_bent_veins,
        )
    };
    found.iter().map(parts).collect()
}

/// As a rigid body about the axis of the loads or the line through the hinges, and each vein about its
/// own tangents, for which only round ones need not be straight.
#[test]
fn on_hinges_veins_turn_as_a_whole_and_spin() {
    let spin = |j: usize, round: bool| (j..j + 1, DVec3::ZERO, 1.0, round);
    let whole = |axis: DVec3| (0..2, axis, 0.0, true);
    let (one, other) = (spin(0, true), spin(1, true));
    let spins = [one.clone(), other.clone()];
    let both = |axis: DVec3| [&[whole(axis)], &spins[..]].concat();
    assert_eq!(on_hinges("", ""), both(-DVec3::X));
    // Whatever the sections are.
    let oval = on_hinges("", "stiffness.bending_3=[3.0, 1.0]; rest.bend_2=[0.1, 0.0]");
    assert_eq!(oval, [whole(-DVec3::X), spin(0, false), other.clone()]);
    // The coupling along y and z differs from that along x.
    assert_eq!(on_hinges("", "load.gravity=[0, 0, -1]"), spins);
    let alike = "coupling.x=2; load.gravity=[0, 0, -1]";
    assert_eq!(on_hinges("", alike), both(-DVec3::Z));
    assert_eq!(
        on_hinges("", &format!("{alike}; load.tip_force=[0, 1, 0]")),
        spins
    );
    // Two hinges are an axis; one without loads has none.
    let apart = "leaf.base=[[0, 0, 0], [0, 0.1, 0]]; coupling.x=2; load.gravity=[0, 0, 0]";
    assert_eq!(on_hinges("", apart), both(DVec3::Y));
    assert_eq!(
        on_hinges("", &format!("{apart}; load.gravity=[0, 0, -1]")),
        spins
    );
    let unloaded = "leaf.base_held=pinned; coupling.x=2; load.gravity=[0, 0, 0]";
    assert!(scenario_with_tables("", unloaded).has_undetermined_orientation());
    for held in [
        "leaf.base=[[0, 0, 0], [0, 0.1, 0]]",
        "load.tip_force=[0, 1, 0]",
        "leaf.base_held=clamped",
    ] {
        assert!(
            !scenario_with_tables("", &format!("{unloaded}; {held}"))
                .has_undetermined_orientation(),
            "{held}"
        );
    }
    // Tissue holds sections, and turns with the leaf; a clamp holds all.
    assert_eq!(on_hinges("", "tissue.normal=1"), [whole(-DVec3::X)]);
    let grip = "[[grip]]\nvein = 2\nat = 0.4\nheld = 'clamped'";
    let between_clamps = (0..2, DVec3::X, -1.0, true);
    assert_eq!(on_hinges(grip, ""), [between_clamps.clone(), one]);
    let held = "[tip]\nheld = 'pinned'\nposition = [0.5, 0, 0]";
    let held = on_hinges(held, "leaf.joined=true; leaf.length=1");
    assert_eq!(held, both(DVec3::X));
    let clamped = "[tip]\nheld = 'clamped'\nposition = [0.5, 0, 0]";
    let clamped = on_hinges(
        clamped,
        "leaf.joined=true; leaf.length=1; leaf.fan=[0.1, -0.1]",
    );
    assert_eq!(clamped, [between_clamps]);
    let wind = "[wind]\nvelocity = [1, 0, 0]\ndensity = 1\ndrag = 1\nwidth = 0.1";
    assert_eq!(on_hinges(wind, ""), spins);
}
