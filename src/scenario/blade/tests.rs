//! What is read of a blade, refused, and written again; and the veins that follow from it.

use crate::natural::Natural;
use crate::scenario::{Entries, PolarInertia, Profile, Rod, Scenario};
use glam::DVec3;
use leafdyn_testing::pairs;
use serde_json::json;

const BLADE: &str = r#"
    name = "blade"
    leaf = { rods = 5 }
    blade = { length = 20.0, width = { at = [0.0, 0.2, 0.5, 1.0], value = [0.8, 1.5, 1.7, 0.0] }, thickness = 0.04, young = 4e4, mass_density = 8e-6 }
"#;

fn blade_with_overrides(overrides: &str) -> Result<Scenario, String> {
    let overrides = overrides.split("; ").filter(|it| !it.is_empty());
    let overrides: Vec<String> = overrides.map(str::to_string).collect();
    let read = Scenario::from_toml_with(BLADE, "blade.toml", &overrides);
    read.map_err(|refused| refused.to_string())
}

#[test]
fn contradictions_and_impossible_outlines_are_refused() {
    let table = "
        leaf.length=3 => leaf.length = 3: follows from [blade], which is given, too
        leaf.fan=symmetric => follows from [blade]
        leaf.base=[0, 0, 0] => follows from [blade]
        rest.bend_3=0.1 => follows from [blade]
        stiffness.axial=1 => follows from [blade]
        section.young=1 => follows from [blade]
        tissue.across=1 => follows from [blade]
        blade.width=0 => blade.width = 0: must be greater than 0
        blade.width=-1 => must not be negative
        blade.width.value[1]=-1 => must not be negative
        blade.width.value[1]=0 => entry 2 = 0: must be greater than 0, and may be 0 at the base and at the tip
        blade.width={at=[0, 1], value=[0, 0]} => must be greater than 0 somewhere
        blade.width={at=[0, 0.5, 0.55, 1], value=[1, 0.01, 1, 0]} => crosses itself at
        blade.width={at=[0, 0.5, 0.5, 1], value=[1, 2, 1, 0]} => must be greater than the entry before it
        blade.width={at=[0, 0.9], value=[1, 2]} => must end at 1 (the tip)
        blade.width={at=[0, 1], value=[1]} => has 1 entries: must have 2
        blade.width={value=[1, 2]} => at is missing
        blade.width=wide => must be a number
        blade.thickness=0 => must be greater than 0
        blade.thickness=[0.1, 0.2] => must have 5
        blade.poisson=0.7 => at most 0.5
        blade.least_width=0.9 => must be between 0.001 and 0.5
        blade.length=1e-3 => gives L_max/L
        blade.thickness=1e-30 => choose other units
        leaf.joined=true; blade.width.value[3]=0.2 => the blade has a width at its tip
        leaf.elevation=[0, 0, 0, 0, 0] => a blade rises as a whole: give one number
        rest.bend_2=[0, 0, 0, 0, 0] => a blade bends as a whole
        rest.bend_2=0.1; rest.twist=0.1 => twist as its surface does
        dynamics.density=1 => blade.mass_density is given, too
        blade.edge=true => did you mean blade.edges?
        leaf.rods=2; blade.edges=true => three times too stiff
        blade.young_across=1e6 => must be less than young/poisson^2 = 4.4444e5
    ";
    for (overrides, said) in pairs(table) {
        let refused = blade_with_overrides(overrides).expect_err(overrides);
        assert!(refused.contains(said), "{overrides}: {refused}");
    }
    let bare = BLADE.replace(", thickness = 0.04", "");
    let refused = Scenario::from_toml(&bare).unwrap_err().to_string();
    assert!(
        refused.contains("blade.thickness is missing") && !refused.contains("stiffness"),
        "{refused}"
    );
    let weight = BLADE.replace(", mass_density = 8e-6", "") + "load = { g = [0, 0, -981] }";
    let refused = Scenario::from_toml(&weight).unwrap_err().to_string();
    assert!(
        refused.contains("mass_density in [section] or [blade]"),
        "{refused}"
    );
}

#[test]
fn what_is_written_is_read_again_as_the_same() {
    for overrides in [
        "",
        "blade.width=2",
        "blade.thickness=[0.1, 0.2, 0.1, 0.2, 0.1]; blade.young_across=3e4; blade.edges=false",
        "blade.thickness={at=[0, 0.4, 1], value=[0.05, 0.04, 0.02]}; blade.shear_modulus=1e4",
        "leaf.elevation=0.4; rest.bend_2=0.1; load.g=[0, 0, -981]; blade.least_width=0.05",
        "leaf.rods=1; rest.bend_2={at=[0, 0.5, 1], value=[0.1, 0.2, -0.1]}",
        "rest.bend_2=0; rest.twist=0.3",
    ] {
        let leaf = blade_with_overrides(overrides).unwrap();
        let written = serde_json::to_value(&leaf).unwrap();
        assert_eq!(
            Scenario::from_toml(&written.to_string()).unwrap(),
            leaf,
            "{overrides}"
        );
        assert!(
            written.get("stiffness").is_none()
                && written
                    .get("tissue")
                    .is_none_or(|it| it.get("along").is_none())
        );
    }
    let written = serde_json::to_value(blade_with_overrides("").unwrap()).unwrap();
    assert_eq!(
        written["blade"]["width"]["value"],
        json!([0.8, 1.5, 1.7, 0.0])
    );
    assert!(written["leaf"].get("length").is_none());
}

/// In the natural leaf vein j lies along y = eta_j W/2, in the plane of the leaf, and all are as long
/// as they are.
#[test]
fn veins_lie_within_the_outline() {
    for (edges, outermost) in [(true, 1.0), (false, 0.8)] {
        let scenario = blade_with_overrides(&format!("blade.edges={edges}")).unwrap();
        let (blade, natural) = (
            scenario.blade.as_ref().unwrap(),
            Natural::new(&scenario, true),
        );
        assert!(scenario.joined && blade.vein_position(4) == outermost);
        for j in 0..5 {
            for k in 0..=10 {
                let pose = natural.vein_pose(j, k as f64 / 10.0);
                let (x, q) = (pose.position, pose.rotation);
                let y = 0.5 * blade.vein_position(j) * blade.width((x.x / 20.0).clamp(0.0, 1.0));
                assert!((x.y - y).abs() < 1e-11 && x.z == 0.0, "{j} {k}: {x} {y}");
                assert!((q * DVec3::Z).distance(DVec3::Z) < 1e-14);
            }
            let tip = natural.vein_pose(j, 1.0).position;
            assert!(tip.distance(20.0 * DVec3::X) < 1e-11, "{tip}");
        }
    }
}

/// A blade that is curved at rest is a part of a cylinder: its veins still fit together.
#[test]
fn veins_of_a_curved_blade_lie_on_a_cylinder() {
    for (curvature, bend) in [
        (0.08, "0.08"),
        (0.0, "{at=[0, 0.4, 0.7, 1], value=[0.1, 0.05, -0.1, 0.2]}"),
    ] {
        let scenario = blade_with_overrides(&format!("rest.bend_2={bend}")).unwrap();
        let (blade, natural) = (
            scenario.blade.as_ref().unwrap(),
            Natural::new(&scenario, true),
        );
        let middle = natural.vein_pose(2, 1.0).position;
        for j in 0..5 {
            let tip = natural.vein_pose(j, 1.0).position;
            assert!(tip.distance(middle) < 1e-10, "{}", tip.distance(middle));
            for k in (0..=10).filter(|_| curvature > 0.0) {
                let pose = natural.vein_pose(j, k as f64 / 10.0);
                let (x, q) = (pose.position, pose.rotation);
                let angle = (x.x).atan2(x.z + 1.0 / curvature);
                let radius = x.x.hypot(x.z + 1.0 / curvature);
                assert!((radius * curvature - 1.0).abs() < 1e-11, "{radius}");
                let y = 0.5
                    * blade.vein_position(j)
                    * blade.width((angle / curvature / 20.0).clamp(0.0, 1.0));
                assert!((x.y - y).abs() < 1e-10, "{j} {k}: {x} {y}");
                let normal = DVec3::new(angle.sin(), 0.0, angle.cos());
                assert!((q * DVec3::Z).distance(normal) < 1e-11);
            }
        }
    }
}

/// Strips add up to the blade, and tissue fills the gaps.
#[test]
fn stiffnesses_are_those_of_strips_of_the_plate() {
    let leaf = blade_with_overrides(
        "blade.width=1.5; leaf.rods=4; blade.young_across=2e4; blade.shear_modulus=1e4",
    )
    .unwrap();
    let (e, across, g, nu, t, w) = (4e4, 2e4, 1e4, 0.3, 0.04_f64, 1.5 / 3.0);
    // Margins have 5/48 of the width; the lever is the gap.
    let (h, f) = (1.5 * (1.0 - 10.0 / 48.0) / 2.0, 0.8360407190816548);
    let constant = |wanted: f64, found: &Profile| {
        let Profile::Constant(found) = found else {
            panic!("{found:?}");
        };
        assert!((found / wanted - 1.0).abs() < 1e-14, "{found} {wanted}");
    };
    let rod = &leaf.rods[1];
    let couple = [
        g * h * t.powi(3) / 3.0,
        e * h * t.powi(3) / 12.0,
        e * t * h * w * w / 12.0,
    ];
    let force = [e * h * t, f * g * h * t, 5.0 / 6.0 * g * h * t];
    let all = rod.couple_stiffness.iter().chain(&rod.force_stiffness);
    couple
        .into_iter()
        .chain(force)
        .zip(all)
        .for_each(|(wanted, found)| constant(wanted, found));
    let stiffer = across / (1.0 - nu * nu * across / e);
    let tissue = [stiffer * t / w, stiffer * t.powi(3) / (12.0 * w), nu * w];
    let gap = &leaf.tissue.as_ref().unwrap()[2];
    tissue
        .into_iter()
        .zip([&gap.stiffness[1], &gap.fold, &gap.contraction])
        .for_each(|(wanted, found)| constant(wanted, found));
    let rigid = Profile::Constant(f64::INFINITY);
    assert!(gap.stiffness[0] == rigid && gap.stiffness[2] == rigid);
    constant(8e-6 * h * t, &leaf.dynamics.density[1]);
    constant(8e-6 * 1.5 * 5.0 / 48.0 * t, &leaf.dynamics.density[0]);
    let inertia = 8e-6 * h * t / 12.0;
    let [face, plane] = &leaf.dynamics.rotary_inertia[1];
    constant(inertia * t * t, face);
    constant(inertia * w * w, plane);
    assert_eq!(leaf.dynamics.polar_inertia, PolarInertia::Sum);
    // Turned in its plane as a whole it has the inertia of its width: rho t W^3/12.
    let turned = |(rod, j): (&Rod, usize)| {
        let inertia = leaf.dynamics.rotary_inertia[j][1].at(0.0);
        inertia + leaf.dynamics.density[j].at(0.0) * rod.base[1].powi(2)
    };
    let whole: f64 = leaf.rods.iter().zip(0..).map(turned).sum();
    assert!((whole / (8e-6 * t * 1.5_f64.powi(3) / 12.0) - 1.0).abs() < 1e-14);
    // The mass is that of the outline, the stiffness that of at least a tenth of its width.
    let leaf = blade_with_overrides("").unwrap();
    let blade = leaf.blade.as_ref().unwrap();
    let veins = leaf.rods.iter().zip(&leaf.dynamics.density);
    let mass: f64 = veins
        .map(|(rod, density)| rod.length * density.integral(1.0))
        .sum();
    assert!((mass / (8e-6 * 0.04 * blade.area()) - 1.0).abs() < 1e-9);
    assert!(leaf.dynamics.density[0].at(1.0) == 0.0 && blade.bearing_width(1.0) > 0.17);
}

/// A profile that a blade determines is its own image on the other side, but for the curvature.
#[test]
fn veins_are_images_of_each_other() {
    let leaf = blade_with_overrides("").unwrap();
    for (j, image) in [(0, 4), (1, 3)] {
        let [one, other] = [&leaf.rods[j], &leaf.rods[image]];
        assert_eq!(one.couple_stiffness, other.couple_stiffness);
        assert_eq!(one.rest_curvature[2], other.rest_curvature[2].scaled(-1.0));
        assert_eq!((one.angle, one.base[1]), (-other.angle, -other.base[1]));
    }
    let tissue = leaf.tissue.as_ref().unwrap();
    assert!(tissue[0] == tissue[3] && tissue[1] == tissue[2] && tissue[0] != tissue[1]);
}

/// Entries are replaced and scaled as those of other tables.
#[test]
fn numbers_of_a_blade_vary() {
    let twice = blade_with_overrides("scale:blade.width=2").unwrap();
    assert!((twice.blade.as_ref().unwrap().width(0.5) - 3.4).abs() < 1e-14);
    let entries = Entries::from_text(BLADE, "blade").unwrap();
    for (part, problem) in [
        ("blade.width.value=2", "must be a list"),
        ("blade.width[0]=2", ""),
    ] {
        let refused = entries
            .replaced(&[part.to_string()])
            .and_then(|it| it.check());
        assert!(refused.unwrap_err().to_string().contains(problem));
    }
}
