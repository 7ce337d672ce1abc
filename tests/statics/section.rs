//! Stiffnesses and masses from a section: `[section]` in place of `[stiffness]`.

use leafdyn_testing::*;

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
    leafdyn_testing::close("E I", bending, 0.2 * PI * 1e-4 / 64.0, 1e-20);
    assert!((bending / 1e-6 - 1.0).abs() < 0.05);
}

/// A leaf with a section is the leaf with its stiffnesses, to the last bit.
#[test]
fn the_same_leaf_with_its_stiffnesses_written_out() {
    let section = r#"section = { shape = "rectangle", width = [0.2, 0.3], thickness = 0.05, young = 3.0, poisson = 0.25, mass_density = 2.0 }"#;
    let leaf = with(section).unwrap();
    let list = |key: &str, profiles: Vec<&Profile>| {
        let values: Vec<f64> = profiles.iter().map(|profile| profile.at(0.5)).collect();
        format!("{key} = {values:?}\n")
    };
    let keys = "torsion bending_2 bending_3 axial shear_2 shear_3".split(' ');
    let mut text = String::from("[stiffness]\n");
    for (k, key) in keys.enumerate() {
        let profiles = leaf.rods.iter().map(|rod| match k {
            0..3 => &rod.couple_stiffness[k],
            _ => &rod.force_stiffness[k - 3],
        });
        text += &list(key, profiles.collect());
    }
    text += "[dynamics]\n";
    let dynamics = &leaf.dynamics;
    text += &list("density", dynamics.density.iter().collect());
    for (axis, key) in ["rotary_inertia", "rotary_inertia_3"]
        .into_iter()
        .enumerate()
    {
        let about_axis = dynamics.rotary_inertia.iter().map(|both| &both[axis]);
        text += &list(key, about_axis.collect());
    }
    assert_eq!(with(&text).unwrap(), leaf);
    // Mass of the first vein per length: 2 times 0.2 times 0.05.
    leafdyn_testing::close("density", leaf.dynamics.density[0].at(0.1), 0.02, 1e-16);
}

/// Along a tapering vein stiffnesses follow the diameter to the fourth power, not
/// the line between their values at the ends; two methods agree on the leaf.
#[test]
fn a_taper_is_followed_exactly() {
    let taper = r#"section = { shape = "circle", diameter = { at = [0.0, 0.4, 1.0], value = [0.1, 0.08, 0.02] }, young = 0.3 }"#;
    let leaf = with(taper).unwrap();
    let bending = &leaf.rods[0].couple_stiffness[1];
    let second = PI / 64.0 * 0.05_f64.powi(4);
    leafdyn_testing::close("in the middle", bending.at(0.7), 0.3 * second, 1e-20);
    let cubed = |d: f64| d.powi(5) / 5.0;
    let integral = (cubed(0.1) - cubed(0.08)) / 0.05 + (cubed(0.08) - cubed(0.02)) / 0.1;
    let integral = 0.3 * PI / 64.0 * integral;
    leafdyn_testing::close("integral", bending.integral(1.0) / integral, 1.0, 1e-13);
    let relaxed = settle(&leaf, 1e-9);
    let shooting = Method::Shooting { intervals: None };
    let shot = leafdyn_testing::relaxed(&leaf, &by(shooting, to(1e-9)));
    let apart = (tip(&relaxed) - tip(&shot)).length();
    assert!(apart < 2e-9 && tip(&relaxed).z < -0.01, "{apart:e}");
}

#[test]
fn what_cannot_be_a_section_is_refused() {
    let table = r#"
        shape = "circle", young = 1 => section.diameter is missing
        diameter = 0.1, young = 1 => section.shape is missing
        shape = "oval", diameter = 0.1, young = 1 => must be "circle", "ellipse", "rectangle", "triangle", "hexagon" or "u"
        shape = "circle", diameter = 0.1, width = 1, young = 1 => a circle has a diameter
        shape = "ellipse", diameter = 0.1, young = 1 => width (along d2)
        shape = "triangle", width = 0.1, young = 1 => section.thickness is missing
        shape = "triangle", width = 0.1, thickness = 0.1, wall = 0.01, young = 1 => triangles and hexagons are full
        shape = "hexagon", width = 0.1, thickness = 0.1, young = 1 => a hexagon has a width (across flats)
        shape = "hexagon", width = 0.1, inner_diameter = 0.05, young = 1 => belongs to a circle
        shape = "u", width = 0.1, thickness = 0.1, young = 1 => section.shape = "u": has a wall
        shape = "u", width = 0.1, thickness = 0.1, wall = 0.04, young = 1 => at most a third of section.width
        shape = "u", width = 0.4, thickness = [0.1, 0.05], wall = 0.04, young = 1 => half of section.thickness
        shape = "circle", diameter = -0.1, young = 1 => must be greater than 0
        shape = "circle", diameter = 0.1, young = 1, poisson = 0.6 => at most 0.5
        shape = "circle", diameter = 0.1, young = 1, poisson = -1 => greater than -1
        shape = "ellipse", width = 0.4, thickness = 0.1, poisson = -0.44, young = 1 => section.poisson = -0.44: gives a shear factor
        shape = "circle", diameter = 0.1, young = 1, poisson = 0.3, shear_modulus = 0.4 => section.shear_modulus = 0.4: section.poisson is given, too
        shape = "circle", diameter = 0.1, young = 1, shear_modulus = 0 => must be greater than 0
        shape = "circle", diameter = 0.1, young = 1, shear_modulus = [0.4] => must have 2
        shape = "circle", diameter = 0.1, young = 1, shear_modulus = [0.4, -1] => section.shear_modulus, entry 2 = -1: must be greater than 0
        shape = "ellipse", width = 0.4, thickness = 0.1, shear_modulus = 0.9, young = 1 => section.shear_modulus = 0.9: gives a shear factor
        shape = "circle", diameter = 1e-20, young = 1e-10 => choose other units
        shape = "circle", diameter = [0.1], young = 1 => must have 2
        shape = "circle", diameter = [0.1, 1e5], young = 1 => A_max/A
    "#;
    for (section, said) in pairs(table) {
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

/// Sections of straight sides are written and read back, with their stiffnesses: I2 and I3 by hand, J of an equilateral
/// triangle, of a hexagon (0.1151 d^4) and of thin walls.
#[test]
fn triangles_hexagons_and_channels() {
    let height = 0.1 * 3_f64.sqrt() / 2.0;
    let shear = 1.0 / 2.6;
    for (section, constants) in [
        (
            format!(r#"shape = "triangle", width = 0.1, thickness = {height}"#),
            [
                3_f64.sqrt() / 80.0 * 1e-4,
                0.1 * height.powi(3) / 36.0,
                height * 1e-3 / 48.0,
            ],
        ),
        (
            r#"shape = "hexagon", width = 0.1"#.into(),
            [0.115_050_994_4e-4, 0.060_140_653_04e-4, 0.060_140_653_04e-4],
        ),
        (
            // Thin walls: web and flanges by themselves, and moved to the centroid at 1/3 of the height.
            r#"shape = "u", width = 0.10001, thickness = 0.100005, wall = 0.00001"#.into(),
            [
                0.3 * 1e-15 / 3.0,
                1e-5 * 1e-3 / 3.0,
                1e-5 * 1e-3 * 7.0 / 12.0,
            ],
        ),
    ] {
        let text = format!("section = {{ {section}, young = 1.0, mass_density = 2.0 }}");
        let leaf = with(&text).unwrap();
        let again = Scenario::from_toml(&serde_json::to_string(&leaf).unwrap()).unwrap();
        assert_eq!(again, leaf, "{section}");
        let rod = &leaf.rods[0];
        let factors = [shear, 1.0, 1.0];
        for ((stiffness, constant), factor) in
            rod.couple_stiffness.iter().zip(constants).zip(factors)
        {
            let ratio = stiffness.at(0.5) / (factor * constant);
            assert!((ratio - 1.0).abs() < 2e-4, "{section}: {ratio}");
        }
    }
}

/// A triangular cantilever bent a little up or down by P at its tip has its largest stress at the apex, P L (2 t/3)/I2,
/// at the clamp.
#[test]
fn the_apex_of_a_triangle_is_stressed_most() {
    for force in [1e-11, -1e-11] {
        let text = format!(
            r#"
            name = "ridge"
            leaf = {{ rods = 1, length = 1.0, fan = [0.0] }}
            section = {{ shape = "triangle", width = 0.04, thickness = 0.03, young = 1.0 }}
            load = {{ tip_force = [0.0, 0.0, {force:e}] }}
            "#
        );
        let leaf = settle(&Scenario::from_toml(&text).unwrap(), 1e-9);
        let stress = leaf.stress.as_ref().expect("a section has stresses");
        let wanted = 1e-11 * 0.02 / (0.04 * 0.03_f64.powi(3) / 36.0);
        leafdyn_testing::close("normal", stress.largest.normal / wanted, 1.0, 1e-4);
    }
}
