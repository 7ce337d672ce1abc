use crate::study::vary::*;
use leafdyn_testing::pairs;

fn parse_sweep(given: &str) -> ParameterSweep {
    let vary = given.parse();
    vary.unwrap_or_else(|error| panic!("{given}: {error}"))
}

fn refusal_text(given: &str) -> String {
    given.parse::<ParameterSweep>().unwrap_err().to_string()
}

#[test]
fn spacing_and_counts() {
    let linear = parse_sweep("stiffness.torsion=0..1");
    assert_eq!(linear.values.len(), 11);
    assert_eq!(linear.values[3], 0.3, "not 0.30000000000000004");
    let decades = parse_sweep("stiffness.bending_2=1..1e-5:6log");
    assert_eq!(decades.values, [1.0, 0.1, 1e-2, 1e-3, 1e-4, 1e-5]);
    assert!(decades.log);
    assert_eq!(
        parse_sweep("rest.twist=-2 .. 2 : 3").values,
        [-2.0, 0.0, 2.0]
    );
    assert_eq!(parse_sweep("rest.twist=5..7:1").values, [5.0]);
    assert_eq!(parse_sweep("rest.twist=5..5").values, [5.0]);
    assert_eq!(parse_sweep("method.step=1e-5..1e-1log").values.len(), 11);
    let colon = parse_sweep("method.step=1e-5..1e-1:5:log");
    assert_eq!(parse_sweep("method.step=1e-5..1e-1:5log"), colon);
}

#[test]
fn a_log_keeps_the_sign() {
    let load = parse_sweep("load.gravity[2]=-1e-3..-10:5log");
    assert_eq!(load.values, [-1e-3, -1e-2, -0.1, -1.0, -10.0]);
    for through_zero in ["-1..1", "0..1", "1..0", "1..-1"] {
        let message = refusal_text(&format!("load.gravity[2]={through_zero}log"));
        assert!(message.contains("one sign"), "{message}");
    }
}

#[test]
fn whole_numbers_are_rounded_and_told_once() {
    assert_eq!(
        parse_sweep("leaf.rods=1..5:9").values,
        [1.0, 2.0, 3.0, 4.0, 5.0]
    );
    let counts = parse_sweep("leaf.rods=1..100:7log");
    assert_eq!(counts.values, [1.0, 2.0, 5.0, 10.0, 22.0, 46.0, 100.0]);
    assert_eq!(counts.keys.text(22.0), "22");
    assert_eq!(
        parse_sweep("method.segments=8..10").values,
        [8.0, 9.0, 10.0]
    );
}

#[test]
fn keys_and_values_are_written_as_they_were_given() {
    for keys in [
        "stiffness.axial+stiffness.shear_2",
        "method.step",
        "leaf.fan[0]",
        "scale:stiffness.bending_3+load.gravity[2]",
    ] {
        assert_eq!(parse_sweep(&format!("{keys}=1..2")).keys.to_string(), keys);
    }
    let keys = parse_sweep("stiffness.torsion=0..1").keys;
    let texts = [1e-5, -0.25, 1e10].map(|value| keys.text(value));
    assert_eq!(texts, ["1e-5", "-0.25", "10000000000.0"]);
}

#[test]
fn slips_are_explained() {
    for (given, part) in [
        ("stiffness.torsion", "has no ="),
        ("stiffness.torsion=1", "has no .."),
        ("stiffness.torsion=1..x", "must be numbers"),
        ("stiffness.torsion=1..inf", "must be numbers"),
        ("stiffness.torsion=1..2:0", "COUNT"),
        ("stiffness.torsion=1..2:1e3", "COUNT"),
        ("stiffness.torsion=1..2:20000", "COUNT"),
        ("stiffness.bending2=1..2", "mean stiffness.bending_2?"),
        ("method.steps=1..2", "unknown key"),
        ("load.gravity=1..2", "give an index, as in load.gravity[0]"),
        ("load.gravity[3]=1..2", "0, 1, 2"),
        ("load.gravity[z]=1..2", "whole number from 0"),
        ("leaf.rods[0]=1..2", "leave the index out"),
        ("leaf.fan=1..2", "give an index"),
        ("leaf.joined=0..1", "no number"),
        ("dynamics.gravity=0..1", "no number"),
        ("dynamics.gravity.value=0..1", "give an index"),
        ("stiffness.torsion.value=0..1", "give an index"),
        ("scale:leaf.rods=1..2", "no numbers"),
        ("name=0..1", "no number"),
        ("=0..1", "unknown key"),
        ("stiffness.axial+=0..1", "unknown key"),
    ] {
        let message = refusal_text(given);
        assert!(message.contains(part), "{given}: {message}");
    }
}

const THREE_ROD_SCENARIO: &str = r#"
name = "three"
leaf = { rods = 3, length = 1.0, fan = [-0.5, 0.0, 0.5] }
coupling = { y = 1 }
load = { gravity = [0, 0.5, -1] }

[stiffness]
torsion = 1.0
bending_2 = [1.0, 2, 3.0]
bending_3 = { at = [0.0, 1.0], value = [1.0, 0.5] }
axial = inf
shear_2 = 100.0
shear_3 = 100.0
"#;

fn base_with_overrides(overrides: &[&str]) -> Result<BaseScenario, VaryError> {
    let overrides: Vec<String> = overrides.iter().map(|given| given.to_string()).collect();
    BaseScenario::from_text(THREE_ROD_SCENARIO.into(), "three.toml".into(), &overrides)
}

fn scenario_with_values(
    base: &BaseScenario,
    values: &[(&str, f64)],
) -> Result<VariedScenario, VaryError> {
    let parse = |(keys, value): &(&str, f64)| (keys.parse().unwrap(), *value);
    let values: Vec<(ParameterKeys, f64)> = values.iter().map(parse).collect();
    let values: Vec<(&ParameterKeys, f64)> =
        values.iter().map(|(keys, value)| (keys, *value)).collect();
    base.scenario_with_values(&values)
}

#[test]
fn settings_of_methods_are_not_the_scenarios() {
    let set = base_with_overrides(&["method.segments=16", "load.gravity=[0,0,-2]"]).unwrap();
    assert_eq!(set.solver_settings().segments, Some(16));
    assert_eq!(set.overrides(), ["load.gravity=[0,0,-2]"]);
    let varied =
        scenario_with_values(&set, &[("method.step", 1e-3), ("load.gravity[0]", 1.0)]).unwrap();
    assert_eq!(varied.solver_settings.step, Some(1e-3));
    assert_eq!(varied.solver_settings.segments, Some(16));
    assert_eq!(varied.scenario.gravity, [1.0, 0.0, -2.0]);
}

#[test]
fn refusals_name_key_and_reason() {
    let table = "
        method.step=-1 => method.step = -1.0: must be greater than 0
        method.step=fast => method.step = fast: must be a number
        method.segments=2.5 => whole number
        method.grid=5 => methods have method.step and method.segments
        leaf.rods=0 => leaf.rods
    ";
    for (given, part) in pairs(table) {
        let message = base_with_overrides(&[given]).unwrap_err().to_string();
        assert!(message.contains(part), "{message}");
    }
    let base = base_with_overrides(&[]).unwrap();
    for (values, part) in [
        (("stiffness.torsion", -1.0), "stiffness.torsion"),
        (("stiffness.bending_2", 1e-30), "limit"),
        (("stiffness.bending_2[3]", 1.0), "3 entries"),
        (("stiffness.bending_3[0]", 1.0), "no list"),
        (("coupling.z[2]", 1.0), "2 entries"),
        (("dynamics.density[0]", 1.0), "write it first"),
        (("leaf.rods", 4.0), "leaf.fan"),
        (("method.step", 0.0), "greater than 0"),
    ] {
        let message = scenario_with_values(&base, &[values])
            .unwrap_err()
            .to_string();
        assert!(message.contains(part), "{values:?}: {message}");
    }
}

#[test]
fn a_factor_of_nothing_is_refused() {
    let base = base_with_overrides(&["load.gravity=[0,0,0]", "stiffness.axial=inf"]).unwrap();
    for keys in "load.gravity rest.twist coupling.x stiffness.axial".split(' ') {
        let keys = format!("scale:{keys}");
        let refused = scenario_with_values(&base, &[(&keys, 2.0)])
            .unwrap_err()
            .to_string();
        assert!(refused.contains("which no factor changes"), "{refused}");
    }
    // Joined to one that changes, it takes part.
    let both = "scale:load.gravity+scale:leaf.length";
    assert!(scenario_with_values(&base, &[(both, 2.0)]).is_ok());
}

/// Several numbers substituted one after the other, also into a base that has some already.
#[test]
fn numbers_put_into_the_entries_add_up() {
    let base = base_with_overrides(&["load.gravity[0]=3", "stiffness.bending_2[1]=2.5"]).unwrap();
    let values = [
        ("scale:stiffness.bending_2", 2.0),
        ("stiffness.bending_2[1]+stiffness.torsion[1]", 0.7),
        ("load.gravity[1]", 1e-9),
    ];
    let given = "load.gravity[0]=3; stiffness.bending_2[1]=2.5; scale:stiffness.bending_2=2.0; \
        stiffness.bending_2[1]=0.7; stiffness.torsion[1]=0.7; load.gravity[1]=1e-9";
    let given: Vec<String> = given.split("; ").map(String::from).collect();
    let text = Scenario::from_toml_with(THREE_ROD_SCENARIO, "three.toml", &given).unwrap();
    assert_eq!(scenario_with_values(&base, &values).unwrap().scenario, text);
    let keys: ParameterKeys = "load.gravity[1]".parse().unwrap();
    let with = base.with_value(&keys, 5.0).unwrap();
    assert_eq!(with.number(&keys), Some(5.0));
    let changed = scenario_with_values(&with, &[("load.gravity[2]", 1.0)]).unwrap();
    assert_eq!(changed.scenario.gravity, [3.0, 5.0, 1.0]);
}
