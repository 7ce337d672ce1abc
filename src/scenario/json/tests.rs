use crate::scenario::json::*;
use leafdyn_testing::pairs;

/// Uses every feature of the format.
const FULL: &str = r#"
    name = "full"
    units = { length = "cm", force = "N" }
    leaf = { rods = 3, length = [1.0, 0.7, 0.1], fan = "paper", joined = false }
    stiffness = { torsion = [1.0, 0.3333333333333333, 3.0], bending_2 = { at = [0.0, 0.3, 1.0], value = [1.0, 0.1, 0.2] }, bending_3 = { at = [0, 1], value = [[1, 2], [1, 3], [1, 4]] }, axial = inf, shear_2 = [inf, 100, inf], shear_3 = 1e2 }
    rest = { twist = -0.1, stretch = 1.1 }
    coupling = { y = [0.1, 0.2], z = 1 }
    load = { gravity = [0, 1e-3, -1.0], tip_force = [0.1, 0, 0] }
    solve = { tolerance = 1e-7 }
    [dynamics]
    density = { at = [0.0, 0.5, 1.0], value = [1.0, 0.7, 0.3] }
    section_radius = { at = [0.0, 0.25, 1.0], value = [0.2, 0.1, 0.05] }
    internal_damping = 0.01
    duration = 3.3
    start = "at-rest"
    gravity = { at = [0.0, 1.0], value = [[0, 0, 0], [0, 0, -1]] }
    rest = { at = [0.0, 0.1], factor = [1.0, 2.0] }
"#;

#[test]
fn a_scenario_read_from_its_json_is_the_same() {
    let paper = include_str!("../../../scenarios/paper/fig04.toml");
    let swing = include_str!("../../../scenarios/motion/swing.toml");
    let buckled = include_str!("../../../scenarios/classic/elastica_buckled.toml");
    let held = include_str!("../../../scenarios/classic/twisted_strip.toml");
    let (head, tail) = FULL.split_at(FULL.find("stiffness").unwrap());
    let tail = &tail[tail.find("rest").unwrap()..];
    let taper =
        "{ at = [0, 0.4, 1], value = [[0.2, 0.1, 0.05], [0.2, 0.2, 0.1], [0.2, 0.1, 0.1]] }";
    let section = format!(
        "section = {{ shape = 'circle', diameter = {taper}, young = [1e3, 2e3, 3e3], mass_density = 2 }}"
    );
    let mass = tail.find("density").unwrap()..tail.find("internal").unwrap();
    let tail = [&tail[..mass.start], &tail[mass.end..]].concat();
    let tapering = format!("{head}{section}\n{tail}");
    let even = tapering.replace(taper, "0.3");
    for text in [FULL, paper, swing, buckled, held, &tapering, &even] {
        let scenario = Scenario::from_toml(text).unwrap();
        let json = serde_json::to_string(&scenario).unwrap();
        let again = Scenario::from_toml(&json);
        assert_eq!(again.unwrap(), scenario, "{json}");
        let section = json.contains("section");
        assert_eq!(section, text.contains("section ="), "{json}");
        assert!(!(section && json.contains("torsion")), "{json}");
        let summary = format!("{{\"outcome\": \"converged\", \"input\": {json}}}");
        assert_eq!(Scenario::from_toml(&summary).unwrap(), scenario);
    }
}

/// What a section gives is not written beside it, but what is given in its place is.
#[test]
fn a_section_is_written_as_it_was_given() {
    let head = "name = 'strip'\nleaf = { rods = 1, length = 0.3, fan = [0.0] }\n";
    let inertia_given = "[dynamics]\nrotary_inertia = 1e-8";
    let table = "
        shape = 'rectangle', width = 0.04, thickness = 4e-4, mass_density = 800 => rotary_inertia
        shape = 'ellipse', width = 0.04, thickness = 0.04, mass_density = 800 =>
        shape = 'circle', diameter = { at = [0, 1], value = [0.02, 0.01] }, mass_density = 800 => rotary_inertia
        shape = 'circle', diameter = 0.02, poisson = 0.4 =>
    ";
    for (sides, beside) in pairs(table) {
        let inertia = beside == "rotary_inertia";
        let dynamics = if inertia { inertia_given } else { "" };
        let text = format!("{head}section = {{ {sides}, young = 2e9 }}\n{dynamics}");
        let scenario = Scenario::from_toml(&text).unwrap();
        let written = serde_json::to_value(&scenario).unwrap();
        let again = Scenario::from_toml(&written.to_string()).unwrap();
        assert_eq!(again, scenario);
        assert_eq!(serde_json::to_value(&again).unwrap(), written);
        assert!(sides.contains(written["section"]["shape"].as_str().unwrap()));
        for key in ["diameter", "width", "thickness"] {
            assert_eq!(written["section"].get(key).is_some(), sides.contains(key));
        }
        assert!(written.get("stiffness").is_none());
        assert!(written["dynamics"].get("density").is_none());
        assert_eq!(written["dynamics"].get("rotary_inertia").is_some(), inertia);
        assert!(written["dynamics"].get("rotary_inertia_3").is_none());
    }
}

/// Rotary inertia is that of sections, of strips of a blade with a mass or with a mass per length, or given about one axis or
/// both.
#[test]
fn rotary_inertia_is_written_as_it_was_given() {
    let strip = "leaf = { rods = 2, length = 0.3, fan = 'symmetric' }\nsection = { shape = 'rectangle', width = { at = [0, 0.5, 1], value = [0.04, 0.03, 0.01] }, thickness = 4e-4, young = 2e9";
    let blade = "leaf.rods = 3\nblade = { length = 10, width = { at = [0, 0.4, 1], value = [1, 1.7, 0.0] }, thickness = 0.04, young = 4e4";
    let stiff = "leaf = { rods = 2, length = 1, fan = 'symmetric' }\nstiffness = { torsion = 1, bending_2 = 1, bending_3 = 4, axial = 90, shear_2 = 90, shear_3 = 90 }\n# {";
    let of_density = "dynamics.density = { at = [0, 0.3, 1], value = [0.1, 0.08, 0.05] }";
    let apart = "dynamics = { rotary_inertia = 1e-8, rotary_inertia_3 = 2e-8 }";
    let both = "dynamics = { density = 1, rotary_inertia = 0.01, rotary_inertia_3 = [0.02, 0.03] }";
    let table = [
        (strip, ", mass_density = 800 }", "", ""),
        (strip, " }", of_density, "density"),
        (strip, " }", "dynamics.density = [1, 2]", "density"),
        (strip, " }", "", ""),
        (
            strip,
            ", mass_density = 800 }",
            "dynamics.rotary_inertia = 1e-8",
            "rotary_inertia",
        ),
        (
            strip,
            ", mass_density = 800 }",
            apart,
            "rotary_inertia, rotary_inertia_3",
        ),
        (blade, ", mass_density = 8e-6 }", "", ""),
        (blade, " }", of_density, "density"),
        (blade, " }", "", ""),
        (
            blade,
            ", mass_density = 8e-6 }",
            "dynamics.rotary_inertia = 1e-3",
            "rotary_inertia",
        ),
        (
            stiff,
            " }",
            "dynamics = { density = 1, rotary_inertia = 0.01 }",
            "density, rotary_inertia",
        ),
        (
            stiff,
            " }",
            both,
            "density, rotary_inertia, rotary_inertia_3",
        ),
        (
            stiff,
            " }",
            "dynamics = { density = 1, section_radius = 0.1 }",
            "density, rotary_inertia",
        ),
    ];
    for (source, mass, dynamics, wanted) in table {
        let text = format!("name = 'leaf'\n{source}{mass}\n{dynamics}");
        let scenario = Scenario::from_toml(&text).unwrap_or_else(|why| panic!("{text}: {why}"));
        let written = serde_json::to_value(&scenario).unwrap();
        let again = Scenario::from_toml(&written.to_string()).unwrap();
        assert_eq!(again, scenario, "{written}");
        let keys = ["density", "rotary_inertia", "rotary_inertia_3"].into_iter();
        let keys: Vec<&str> = keys
            .filter(|key| written["dynamics"].get(key).is_some())
            .collect();
        assert_eq!(keys.join(", "), wanted, "{text}");
    }
}

#[test]
fn what_all_rods_share_is_one_number() {
    let json = serde_json::to_value(Scenario::from_toml(FULL).unwrap()).unwrap();
    assert_eq!(json["stiffness"]["axial"], "inf");
    assert_eq!(json["stiffness"]["shear_3"], 100.0);
    assert_eq!(json["coupling"]["y"], serde_json::json!([0.1, 0.2]));
    assert!(json["dynamics"].get("tip_force").is_none());
}

#[test]
fn errors_in_json_are_refused() {
    let table = r#"
        { => not valid JSON
        {"name": null} => is no scenario
        {"name": "a", "leaf": {"rod": 1}} => did you mean leaf.rods?
    "#;
    for (text, part) in pairs(table) {
        let error = Scenario::from_toml(text).unwrap_err().to_string();
        assert!(error.contains(part), "{error}");
    }
}
