//! A scenario with something of everything, to be spoiled.

use leafdyn::scenario::{Scenario, ScenarioError};

use crate::pairs;

pub const VALID: &str = r#"# line 1
name = "leaf"
[leaf]
rods = 3
length = 2.0
fan = "symmetric"
joined = true
[stiffness]
torsion = 1.0
bending_2 = [1.0, 1.0, 1.0]
bending_3 = { at = [0.0, 0.5, 1.0], value = [1.0, 0.5, 0.1] }
axial = inf
shear_2 = 100.0
shear_3 = 100.0
[rest]
twist = 0.0
bend_2 = { at = [0.0, 1.0], value = [[0.0, 1.0], [0.0, 2.0], [0.0, 3.0]] }
bend_3 = 0.0
[coupling]
x = 0.0
y = 1.0
z = [1.0, 2.0]
[load]
gravity = [0.0, 0.0, -1.0]
tip_force = [0.0, 0.0, 0.0]
tip_moment = [0.0, 0.0, 0.0]
[solve]
tolerance = 1e-6
[dynamics]
density = { at = [0.0, 1.0], value = [2.0, 1.0] }
section_radius = 0.1
external_damping = 0.5
duration = 5.0
clamped = true
gravity = { at = [0.0, 1.0], value = [[0.0, 0.0, 0.0], [0.0, 0.0, -2.0]] }
rest = { at = [0.0, 1.0], factor = [1.0, 3.0] }
"#;

pub fn with(overrides: &[&str]) -> Result<Scenario, ScenarioError> {
    let overrides: Vec<String> = overrides.iter().map(|text| text.to_string()).collect();
    Scenario::from_toml_with(VALID, "leaf.toml", &overrides)
}

/// Tries what every line of a table gives, `given => part & part` of the message, with `\\n` for
/// the ends of lines.
pub fn all_refused(table: &str, by: impl Fn(&str, &[&str])) {
    for (given, said) in pairs(table) {
        let [given, said] = [given, said].map(|text| text.replace("\\n", "\n"));
        by(&given, &said.split(" & ").collect::<Vec<_>>());
    }
}

#[track_caller]
pub fn holds(scenario: Result<Scenario, ScenarioError>, parts: &[&str]) {
    let message = scenario.unwrap_err().to_string();
    for part in parts {
        assert!(message.contains(part), "no '{part}' in: {message}");
    }
}
