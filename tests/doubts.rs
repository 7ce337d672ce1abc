//! What can hardly be meant about a leaf is said where it is so, and nowhere else.

mod common;

use common::*;

/// What is said about the rod with these entries.
fn said(entries: &str) -> Vec<String> {
    settle(&rod(entries), 1e-6).doubts
}

fn only(entries: &str, part: &str) {
    let said = said(entries);
    let named = said.len() == 1 && said[0].contains(part);
    assert!(named, "{entries}: {said:?}");
}

#[test]
fn a_vein_that_is_stretched_far_is_named() {
    // n = H (v - 1).
    only("load.tip_force=[21.0, 0.0, 0.0]", "stretched by 21 %");
    assert!(said("load.tip_force=[19.0, 0.0, 0.0]").is_empty());
    // What has grown is not stretched.
    assert!(said("rest.stretch=1.5").is_empty());
}

#[test]
fn a_fan_in_degrees_is_named() {
    only("leaf.fan=[-60.0]", "leaf.fan is in radians, and -60 is");
    assert!(said("leaf.fan=[-6.28]").is_empty());
}

/// A pull beyond the axial stiffness from behind pushes a short soft rod through its base.
#[test]
fn a_vein_turned_through_itself_is_named() {
    let soft =
        "stiffness.axial=1; stiffness.bending_2=50; stiffness.bending_3=50; stiffness.torsion=50";
    let pushed = format!("{soft}; load.tip_force=[-1.2, 0, 0]");
    only(&pushed, "turned through itself");
}

/// A leaf of a tenth of a metre, of 1e-4 N m^2, with the acceleration in place of its weight.
#[test]
fn an_acceleration_in_place_of_a_weight_is_named() {
    let stiff = "stiffness.torsion=1e-6; stiffness.bending_2=1e-6; stiffness.bending_3=1e-6; leaf.length=0.1; \
                 stiffness.axial=1e3; stiffness.shear_2=1e3; stiffness.shear_3=1e3";
    let weight = |weight: &str| format!("{stiff}; load.gravity=[0, 0, -{weight}]");
    only(&weight("9.81"), "not the acceleration");
    assert!(said(&weight("9.81e-3")).is_empty());
    // Another weight that no leaf of this length can carry.
    only(&weight("30.0"), "check it");
    assert!(said(&weight("20.0")).is_empty());
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
        settle(base(&strip, "").scenario(), 1e-6).doubts
    };
    assert!(strip(-9.81).concat().contains("not the acceleration"));
    assert!(strip(-800.0 * 0.008 * 4e-4 * 9.81).is_empty());
}

/// Nothing is said about the leaves that come with the program, whose numbers are meant.
#[test]
fn nothing_is_said_about_other_leaves() {
    for folder in ["paper", "classic", "motion", "study", "measured"] {
        let all = files(folder).into_iter();
        for file in all.filter(|file| file.extension().is_some_and(|it| it == "toml")) {
            let doubts = settle(&read(&file, ""), 1e-4).doubts;
            assert!(doubts.is_empty(), "{}: {doubts:?}", file.display());
        }
    }
}
