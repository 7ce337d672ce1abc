//! What can hardly be meant about a leaf is said where it is so, and nowhere else.

use leafdyn::relax::{EquilibriumDoubt, EquilibriumRemark, RestObstacle};
use leafdyn::scenario::PlausibilityWarning;
use leafdyn::simulate::MotionDoubt;
use leafdyn_testing::*;

/// The codes of doubts, one after the other.
fn codes(doubts: &[EquilibriumDoubt]) -> String {
    let codes: Vec<&str> = doubts.iter().map(EquilibriumDoubt::code).collect();
    codes.join(" ")
}

/// What in its scenario is named of a leaf, at rest or not.
fn slips(leaf: &Equilibrium) -> Vec<PlausibilityWarning> {
    let doubted = leaf.doubts.iter().filter_map(|doubt| match doubt {
        EquilibriumDoubt::Implausible(slip) => Some(slip.clone()),
        _ => None,
    });
    let obstacle = leaf.remark.as_ref().and_then(EquilibriumRemark::obstacle);
    let blamed = obstacle.and_then(|obstacle| match obstacle {
        RestObstacle::Implausible(slip) => Some(slip.clone()),
        _ => None,
    });
    blamed.into_iter().chain(doubted).collect()
}

/// Pulled beyond the axial stiffness from behind, a short rod as soft as this is pushed through
/// its base; and a leaf of a tenth of a metre, of 1e-6 N m^2.
const SOFT: &str =
    "stiffness.axial=1; stiffness.bending_2=50; stiffness.bending_3=50; stiffness.torsion=50";
const SHORT: &str = "stiffness.torsion=1e-6; stiffness.bending_2=1e-6; stiffness.bending_3=1e-6; leaf.length=0.1; \
     stiffness.axial=1e3; stiffness.shear_2=1e3; stiffness.shear_3=1e3";

/// A vein that is stretched far, but not one that has grown; a fan in degrees; a vein that is
/// turned through itself; an acceleration in place of a weight, and another weight that no leaf
/// of this length can carry. Nothing is said of those with no words.
#[test]
fn what_can_hardly_be_meant_is_named() {
    let table = "
        load.tip_force=[21.0, 0.0, 0.0] => stretched by 21 %
        load.tip_force=[19.0, 0.0, 0.0] =>
        rest.stretch=1.5 =>
        leaf.fan=[-60.0] => leaf.fan is in radians, and -60 is more than a turn
        leaf.fan=[2.0] => leaf.fan is in radians, and 2 is more than a right angle
        leaf.fan=[-1.57] =>
        SOFT; load.tip_force=[-1.2, 0, 0] => turned through itself
        SHORT; load.gravity=[0, 0, -9.81] => not the acceleration
        SHORT; load.gravity=[0, 0, -9.81e-3] =>
        SHORT; load.gravity=[0, 0, -30.0] => check it
        SHORT; load.gravity=[0, 0, -20.0] =>
    ";
    for (entries, part) in pairs(table) {
        let rod = rod(&entries.replace("SOFT", SOFT).replace("SHORT", SHORT));
        let mut doubts = settle(&rod, 1e-6).doubts;
        // So heavy a vein snaps on its way, to other places on other grids.
        doubts.retain(|doubt| *doubt != EquilibriumDoubt::UnconfirmedPath);
        let said: Vec<String> = doubts.iter().map(ToString::to_string).collect();
        assert_eq!(said.is_empty(), part.is_empty(), "{entries}: {said:?}");
        let named = said.len() <= 1 && said.iter().all(|it| it.contains(part));
        assert!(named, "{entries}: {said:?}");
    }
}

/// A rod of a section, in cm, N and s, or in units without names.
fn of_section(named: bool, entries: &str) -> Vec<EquilibriumDoubt> {
    let text = r#"
        name = "leaf"
        units = { length = "cm", force = "N" }
        leaf = { rods = 1, length = 15.0, fan = [0.0] }
        section = { shape = "circle", diameter = { at = [0.0, 1.0], value = [0.12, 0.06] }, young = 2e4, mass_density = 1e-5 }
        load = { gravity = [0.0, 0.0, -1e-4] }"#;
    let text = match named {
        true => text.to_owned(),
        false => text.replace("units = { length = \"cm\", force = \"N\" }", ""),
    };
    settle(base(&text, entries).scenario(), 1e-5).doubts
}

/// A weight of which the mass is another, by a slip of units of the density, and a section in
/// other units than the length. Nothing is said of a leaf in water, or without weight.
#[test]
fn sections_in_other_units_are_named() {
    let table = "
        => 
        section.mass_density=1e-8 => weight-of-another-mass
        section.mass_density=1e-3 => weight-of-another-mass
        load.gravity=[0.0, 0.0, -2e-5] =>
        load.gravity=[0.0, 0.0, 0.0]; section.mass_density=1e-8 =>
    ";
    for (entries, code) in pairs(table) {
        assert_eq!(codes(&of_section(true, entries)), code, "{entries}");
    }
    let unnamed = |entries: &str| codes(&of_section(false, entries));
    assert_eq!(
        unnamed("section.mass_density=1e-8"),
        "weight-of-another-mass"
    );
    assert_eq!(unnamed("section.mass_density=1e-4"), "");
    let thick = of_section(true, "section.diameter=20.0; load.gravity=[0, 0, 0]");
    let wanted = PlausibilityWarning::ThickerThanLong {
        vein: 0,
        side: 20.0,
        length: 15.0,
    };
    assert_eq!(thick, [EquilibriumDoubt::Implausible(wanted)]);
    assert!(of_section(true, "section.diameter=14.0; load.gravity=[0, 0, 0]").is_empty());
}

/// Materials that no material is: denser than osmium (22,600 kg/m³), lighter than air (1.225), stiffer than
/// diamond (1,220 GPa). In cm, N and s the unit of density is 1e8 kg/m³, that of a modulus 10 kPa.
#[test]
fn impossible_materials_are_named() {
    const STRIP: &str = r#"
        name = "strip"
        units = { length = "cm", force = "N", time = "s" }
        leaf = { rods = 1, length = 15.0, fan = [0.0] }
        section = { shape = "rectangle", width = 1.0, thickness = 0.03, young = 2e4, mass_density = 1e-5 }
    "#;
    let table = "
        =>
        section.mass_density=2.25e-4 =>
        section.mass_density=2.27e-4 => denser-than-anything
        section.mass_density=1.24e-8 =>
        section.mass_density=1.21e-8 => lighter-than-air
        section.young=1.21e8 =>
        section.young=1.23e8 => stiffer-than-diamond
    ";
    let doubts = |text: &str, entries: &str| settle(base(text, entries).scenario(), 1e-5).doubts;
    for (entries, code) in pairs(table) {
        assert_eq!(codes(&doubts(STRIP, entries)), code, "{entries}");
    }
}

/// A weight per length and an acceleration add up: both state the same weight, or contradict each
/// other by a factor or in direction. Nothing is said where only one is given.
#[test]
fn weights_that_are_given_twice_are_named() {
    // The mean of the squares of the diameters is 0.0084, the weight 6.472e-5 per length.
    let table = "
        load.g=[0, 0, -981] => contradict each other: they state the weights 0.0001 and 0.00006472 per length of vein 1
        load.g=[0, 0, -981]; load.gravity=[0, 0, -6.46e-5] => state the same weight, 0.00006472 per length of vein 1, which then counts twice
        load.g=[0, 0, -981]; load.gravity=[6.47e-5, 0, 0] => they are 90 degrees apart
        load.g=[0, 0, -981]; load.gravity=[0, 0, 6.47e-5] => they are 180 degrees apart
        load.g=[0, 0, -981]; load.gravity=[0, 0, 0] =>
        load.g=[0, 0, 0] =>
    ";
    for (entries, part) in pairs(table) {
        let doubts = of_section(true, entries);
        assert_eq!(doubts.is_empty(), part.is_empty(), "{entries}: {doubts:?}");
        let said: String = doubts.iter().map(ToString::to_string).collect();
        assert!(said.contains(part), "{entries}: {said}");
    }
}

/// Angles of a clamped tip in degrees; rings and twists in radians are meant.
#[test]
fn angles_of_a_held_tip_in_degrees_are_named() {
    let held = |entries: &str| {
        let text = held("clamped").replace("[1.0, 0.0, 0.0]", "[0.6, 0.0, 0.0]");
        let leaf =
            Scenario::from_toml_with(&text, "rod", &leafdyn_testing::entries(entries)).unwrap();
        slips(&relaxed(&leaf, &to(1e-4)))
    };
    for (key, angle) in [("tip.angles", 30.0), ("tip.twist", 90.0)] {
        let wanted = PlausibilityWarning::AngleInDegrees { key, angle };
        let found = held(&format!("{key}={angle:?}"));
        assert!(found.contains(&wanted), "{key}: {found:?}");
    }
    for meant in [
        "tip.angles=3.141592653589793",
        "tip.twist=6.0",
        "tip.twist=7.0",
        "tip.angles=1.0",
    ] {
        let found = held(meant);
        let degrees = |slip: &PlausibilityWarning| slip.code() == "angle-in-degrees";
        assert!(!found.iter().any(degrees), "{meant}: {found:?}");
    }
}

/// A strip whose edge carries what its face does not.
#[test]
fn an_acceleration_of_a_flat_strip_is_named() {
    let strip = |gravity: f64| {
        let strip = format!(
            r#"
            name = "strip"
            leaf = {{ rods = 1, length = 0.3, fan = [0.0] }}
            section = {{ shape = "rectangle", width = 0.008, thickness = 4e-4, young = 1e9, mass_density = 800 }}
            load = {{ gravity = [0.0, 0.0, {gravity:?}] }}"#
        );
        codes(&settle(base(&strip, "").scenario(), 1e-6).doubts)
    };
    // So heavy a strip snaps on its way, to other places on other grids.
    assert!(strip(-9.81).starts_with("acceleration-as-weight"));
    assert_eq!(strip(-800.0 * 0.008 * 4e-4 * 9.81), "");
}

/// Flat veins that turn their edge to the wind, or half of their face, are told; those that face it, and round ones, are
/// not. A width that every vein of a blade has and that is the blade's is told, too.
#[test]
fn faces_that_turn_away_from_the_wind_are_named() {
    let air =
        |velocity: &str| format!("[wind]\nvelocity = {velocity}\ndensity = 1.2e-8\ndrag = 1.2\n");
    let rod = |section: &str, velocity: &str| {
        let text = format!(
            "name = 'rod'\nleaf = {{ rods = 1, length = 10, fan = [0] }}\nsection = {{ {section}, young = 2e5 }}\n{}",
            air(velocity)
        );
        Scenario::from_toml(&text).unwrap()
    };
    let flat = "shape = 'rectangle', width = 0.6, thickness = 0.06";
    let round = "shape = 'circle', diameter = 0.1";
    // The face is normal to z: an edge of a tenth, and at 60 degrees from the face nearly a half.
    for (section, velocity, part) in [
        (flat, "[0, 0, 50]", None),
        (flat, "[0, 50, 0]", Some(0.1)),
        (flat, "[0, 8.66, 5]", Some((0.75_f64 * 0.01 + 0.25).sqrt())),
        (round, "[0, 8.66, 5]", None),
    ] {
        let doubts = settle(&rod(section, velocity), 1e-6).doubts;
        let told = doubts.iter().find_map(|doubt| match doubt {
            EquilibriumDoubt::TurnedFromWind { part } => Some(*part),
            _ => None,
        });
        assert_eq!(
            told.is_some(),
            part.is_some(),
            "{section} {velocity}: {told:?}"
        );
        if let (Some(told), Some(part)) = (told, part) {
            close("part", told, part, 0.01 * part);
        }
    }
    let blade = |width: &str| {
        let text = format!(
            "name = 'blade'\nleaf = {{ rods = 3, elevation = 0.9 }}\nblade = {{ length = 25, thickness = 0.03, \
             young = 5e4, width = {{ at = [0, 0.4, 1], value = [0.9, 1.6, 0.5] }} }}\n{}{width}",
            air("[0, 0, 1]")
        );
        codes(&settle(&Scenario::from_toml(&text).unwrap(), 1e-4).doubts)
    };
    assert!(!blade("").contains("wider-than-blade"));
    assert!(blade("width = 1.6").contains("wider-than-blade"));
}

/// Nothing is said about the leaves that come with the program, whose numbers are meant.
#[test]
fn nothing_is_said_about_other_leaves() {
    for file in resting_files() {
        let doubts = settle(&read(&file, ""), 1e-4).doubts;
        assert!(doubts.is_empty(), "{}: {doubts:?}", file.display());
    }
}

/// A tip held out of reach, by a slip of units; a vein that has grown reaches farther.
#[test]
fn a_tip_held_out_of_reach_is_named() {
    let held = |place: f64, entries: &str| {
        let text = held("pinned").replace("[1.0, 0.0, 0.0]", &format!("[{place:?}, 0.0, 0.0]"));
        let leaf =
            Scenario::from_toml_with(&text, "rod", &leafdyn_testing::entries(entries)).unwrap();
        relaxed(&leaf, &to(1e-6))
    };
    let far = held(1.3, "");
    assert!(far.outcome.is_success());
    assert_eq!(codes(&far.doubts), "out-of-reach");
    assert!(held(1.15, "").doubts.is_empty());
    assert!(held(1.5, "rest.stretch=1.4").doubts.is_empty());
    // A leaf in centimetres, the tip in millimetres.
    let blades = Scenario::from_toml(
        r#"
        name = "blades"
        leaf = { rods = 5, length = 18.0, fan = [-0.25, -0.125, 0.0, 0.125, 0.25] }
        section = { shape = "ellipse", width = { at = [0.0, 0.5, 1.0], value = [0.12, 0.1, 0.03] }, thickness = 0.04, young = 30000.0, mass_density = 1e-8 }
        coupling = { y = 1e-3, z = 1e-3 }
        rest = { bend_2 = { at = [0.0, 1.0], value = [0.0, 0.02] } }
        load = { gravity = [0.0, 0.0, -4e-5] }
        tip = { held = "pinned", position = [40.0, 0.0, 0.0] }
        "#,
    );
    let lost = relaxed(&blades.unwrap(), &to(1e-6));
    assert_eq!(lost.outcome, Outcome::Diverged);
    let slips = slips(&lost);
    let away = |slip: &PlausibilityWarning| matches!(slip, PlausibilityWarning::OutOfReach { distance, .. } if *distance == 40.0);
    assert!(slips.iter().any(away), "{slips:?}");
}

/// A rod whose scenario has slips: an angle in degrees, and a weight of another mass.
const SLIPPED: &str = r#"
    name = "slipped"
    units = { length = "m", force = "N" }
    leaf = { rods = 1, length = 0.3, fan = [45.0] }
    section = { shape = "rectangle", width = 0.008, thickness = 0.001, young = 1e9, mass_density = 1e-3 }
    load = { gravity = [0.0, 0.0, -0.01] }
    dynamics = { duration = 0.01 }"#;

/// What a scenario says is doubted whatever is done with it.
#[test]
fn slips_are_named_of_motions_traces_and_boundaries() {
    let slips = ["angle-in-degrees", "weight-of-another-mass"];
    let slipped = Scenario::from_toml(SLIPPED).unwrap();
    assert_eq!(
        codes(&settle(&slipped, 1e-3).doubts),
        slips.join(" "),
        "rest"
    );
    let motion = leafdyn::simulate::Simulation::new(&slipped, &Default::default()).unwrap();
    let doubts = motion.doubts().iter().map(MotionDoubt::code);
    assert!(doubts.eq(slips), "motion: {:?}", motion.doubts());
    let request = || {
        leafdyn_testing::branch::request(base(SLIPPED, ""), "load.tip_force[2]=0..0.01", 1e-3, 20)
    };
    let traced = leafdyn::study::trace(&request(), &mut |_, _, _| {}).unwrap();
    let doubts = traced.doubts.iter().map(PlausibilityWarning::code);
    assert!(doubts.eq(slips), "trace: {:?}", traced.doubts);
    let request = leafdyn::study::BoundaryRequest {
        trace: request(),
        across: "section.young=1e9..2e9".parse().unwrap(),
        map: None,
    };
    let bound = leafdyn::study::trace_stability_boundary(&request, &mut |_, _, _| {}).unwrap();
    assert_eq!(bound.doubts, traced.doubts, "boundary");
}
