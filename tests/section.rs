//! Stiffnesses and masses from a section: `[section]` in place of `[stiffness]`.

mod common;

use std::f64::consts::PI;

use leafdyn::relax::Method;
use leafdyn::scenario::Scenario;

fn with(section: &str) -> Result<Scenario, String> {
    let text = format!(
        r#"
        name = "vein"
        leaf = {{ rods = 2, length = [1.0, 0.9], fan = "symmetric" }}
        coupling = {{ z = 1e-3 }}
        load = {{ gravity = [0.0, 0.0, -1e-5] }}
        {section}
        "#
    );
    Scenario::from_toml(&text).map_err(|refused| refused.to_string())
}

/// The paper, section 2.2: veins of 0.1 mm and a Young's modulus of a few tenths of
/// N/mm^2 have E I of the order of 1e-6 N mm^2.
#[test]
fn the_papers_estimate() {
    let section = r#"section = { shape = "circle", diameter = 0.1, young = 0.2 }"#;
    let scenario = with(section).unwrap();
    let bending = scenario.rods[1].couple_stiffness[1].at(0.3);
    common::close("E I", bending, 0.2 * PI * 1e-4 / 64.0, 1e-20);
    assert!((bending / 1e-6 - 1.0).abs() < 0.05);
}

/// A leaf with a section is the leaf with its stiffnesses, to the last bit.
#[test]
fn the_same_leaf_with_its_stiffnesses_written_out() {
    let leaf = with(
        r#"section = { shape = "rectangle", width = [0.2, 0.3], thickness = 0.05, young = 3.0, poisson = 0.25, mass_density = 2.0 }"#,
    )
    .unwrap();
    let mut text = String::from("[stiffness]\n");
    for (key, axis) in [("torsion", 0), ("bending_2", 1), ("bending_3", 2)] {
        let values = leaf
            .rods
            .iter()
            .map(|rod| rod.couple_stiffness[axis].at(0.5));
        text += &format!("{key} = {:?}\n", values.collect::<Vec<_>>());
    }
    for (key, axis) in [("axial", 0), ("shear_2", 1), ("shear_3", 2)] {
        let values = leaf
            .rods
            .iter()
            .map(|rod| rod.force_stiffness[axis].at(0.5));
        text += &format!("{key} = {:?}\n", values.collect::<Vec<_>>());
    }
    let of = |profiles: &[leafdyn::scenario::Profile]| -> Vec<f64> {
        profiles.iter().map(|profile| profile.at(0.5)).collect()
    };
    text += &format!("[dynamics]\ndensity = {:?}\n", of(&leaf.dynamics.density));
    text += &format!("rotary_inertia = {:?}\n", of(&leaf.dynamics.rotary_inertia));
    assert_eq!(with(&text).unwrap(), leaf);
    // Mass of the first vein per length: 2 times 0.2 times 0.05.
    common::close("density", leaf.dynamics.density[0].at(0.1), 0.02, 1e-16);
}

/// Along a tapering vein stiffnesses follow the diameter to the fourth power, not
/// the line between their values at the ends; two methods agree on the leaf.
#[test]
fn a_taper_is_followed_exactly() {
    let taper = r#"section = { shape = "circle", diameter = { at = [0.0, 0.4, 1.0], value = [0.1, 0.08, 0.02] }, young = 0.3 }"#;
    let leaf = with(taper).unwrap();
    let bending = &leaf.rods[0].couple_stiffness[1];
    let second = PI / 64.0 * 0.05_f64.powi(4);
    common::close("in the middle", bending.at(0.7), 0.3 * second, 1e-20);
    let cubed = |d: f64| d.powi(5) / 5.0;
    let integral = (cubed(0.1) - cubed(0.08)) / 0.05 + (cubed(0.08) - cubed(0.02)) / 0.1;
    let integral = 0.3 * PI / 64.0 * integral;
    common::close("integral", bending.integral(1.0) / integral, 1.0, 1e-13);
    let relaxed = leaf.relaxation().tolerance(1e-9).run().unwrap();
    assert!(relaxed.outcome.is_success(), "{:?}", relaxed.remark);
    let shooting = Method::Shooting { intervals: None };
    let shot = leaf
        .relaxation()
        .method(shooting)
        .tolerance(1e-9)
        .run()
        .unwrap();
    let apart = (relaxed.tips[0] - shot.tips[0]).length();
    assert!(apart < 2e-9 && relaxed.tips[0].z < -0.01, "{apart:e}");
}

#[test]
fn what_cannot_be_a_section_is_refused() {
    for (section, said) in [
        (
            r#"shape = "circle", young = 1"#,
            "section.diameter is missing",
        ),
        (r#"diameter = 0.1, young = 1"#, "section.shape is missing"),
        (
            r#"shape = "oval", diameter = 0.1, young = 1"#,
            r#"must be "circle", "ellipse" or "rectangle""#,
        ),
        (
            r#"shape = "circle", diameter = 0.1, width = 1, young = 1"#,
            "a circle has a diameter",
        ),
        (
            r#"shape = "ellipse", diameter = 0.1, young = 1"#,
            "width (along d2)",
        ),
        (
            r#"shape = "circle", diameter = -0.1, young = 1"#,
            "must be greater than 0",
        ),
        (
            r#"shape = "circle", diameter = 0.1, young = 1, poisson = 0.6"#,
            "at most 0.5",
        ),
        (
            r#"shape = "circle", diameter = 0.1, young = 1, poisson = -1"#,
            "greater than -1",
        ),
        (
            r#"shape = "circle", diameter = 1e-20, young = 1e-10"#,
            "choose other units",
        ),
        (
            r#"shape = "circle", diameter = [0.1], young = 1"#,
            "must have 2",
        ),
        (
            r#"shape = "circle", diameter = [0.1, 1e5], young = 1"#,
            "A_max/A",
        ),
    ] {
        let refused = with(&format!("section = {{ {section} }}")).unwrap_err();
        assert!(refused.contains(said), "{section}: {refused}");
    }
    let both = r#"
        section = { shape = "circle", diameter = 0.1, young = 1, mass_density = 1 }
        stiffness = { torsion = 1.0 }"#;
    assert!(with(both).unwrap_err().contains("leave out either"));
    let masses = both.replace("stiffness = { torsion", "dynamics = { density");
    assert!(with(&masses).unwrap_err().contains("section.mass_density"));
}
