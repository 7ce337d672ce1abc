//! The table `[dynamics]`: what it may say, what holds where it says nothing,
//! and every way to get it wrong.

use leafdyn::scenario::{Dynamics, PolarInertia, ScenarioError};
use leafdyn_testing::valid::{all_refused, holds};
use leafdyn_testing::*;
use proptest::prelude::*;

/// L = 2 and A = 2, so that rho = 8 gives T = 8; the longest rod is 2.
const STILL: &str = r#"name = "leaf"
[leaf]
rods = 2
length = [2.0, 1.0]
fan = "symmetric"
joined = false
[stiffness]
torsion = 1.0
bending_2 = 1.0
bending_3 = 4.0
axial = inf
shear_2 = 100.0
shear_3 = 100.0
[rest]
bend_2 = [0.0, 1.0]
[load]
gravity = [0.0, 0.0, -1.0]
tip_force = [0.5, 0.0, 0.0]
"#;

/// `STILL` with these lines below `[dynamics]`; the first is line 20.
fn with(lines: &str) -> Result<Scenario, ScenarioError> {
    let text = format!("{STILL}[dynamics]\n{lines}\n");
    Scenario::from_toml_with(&text, "leaf.toml", &[])
}

#[track_caller]
fn accepted(lines: &str) -> Dynamics {
    with(lines)
        .unwrap_or_else(|error| panic!("{error}"))
        .dynamics
}

/// The message for these lines.
#[track_caller]
fn with_lines(lines: &str, parts: &[&str]) {
    holds(with(lines), parts);
}

#[track_caller]
fn close(found: f64, expected: f64) {
    let close = (found / expected - 1.0).abs() < 1e-14;
    assert!(close, "{found} instead of {expected}");
}

#[test]
fn what_holds_without_the_table() {
    let scenario = Scenario::from_toml(STILL).unwrap();
    let dynamics = &scenario.dynamics;
    close(dynamics.mean_density(), 2.0 / 16.0);
    assert_eq!(dynamics.density[0], dynamics.density[1]);
    close(dynamics.rotary_inertia[1][0].at(0.3), 0.125 * 0.16 / 4.0);
    close(dynamics.external_damping, 2.0 * 3.516 * 0.125);
    assert_eq!(dynamics.internal_damping, 0.0);
    assert_eq!(dynamics.duration, 10.0);
    assert_eq!(dynamics.output_interval, 0.1);
    assert!(dynamics.clamped);
    assert_eq!(dynamics.gravity, Schedule::constant([0.0, 0.0, -1.0]));
    assert_eq!(dynamics.tip_force, Schedule::constant([0.5, 0.0, 0.0]));
    assert_eq!(dynamics.tip_moment, Schedule::constant([0.0; 3]));
    assert_eq!(dynamics.rest, Schedule::constant(1.0));
    let loads = (scenario.gravity, scenario.tip_force, scenario.tip_moment);
    let by_hand = Dynamics::default_for(&scenario.rods).with_loads(loads.0, loads.1, loads.2);
    assert_eq!(*dynamics, by_hand);
    assert_eq!(*dynamics, accepted(""));
}

#[test]
fn what_is_left_out_follows_from_the_density() {
    let dynamics = accepted("density = [6.0, 10.0]");
    assert_eq!(dynamics.mean_density(), 8.0);
    close(dynamics.duration, 80.0);
    close(dynamics.output_interval, 0.8);
    close(dynamics.external_damping, 2.0 * 3.516);
    close(dynamics.rotary_inertia[0][0].at(0.0), 0.24);
    close(dynamics.rotary_inertia[1][0].at(0.0), 0.4);
    let dynamics = accepted("duration = 3");
    close(dynamics.output_interval, 0.03);
}

#[test]
fn what_is_given_is_taken() {
    let dynamics = accepted(
        "density = 2.0\nrotary_inertia = { at = [0, 1], value = [[1, 2], [3, 4]] }\nexternal_damping = 0\n\
         internal_damping = 1e-3\nduration = 4\noutput_interval = 4\nclamped = true\n\
         gravity = { at = [-1, 1], value = [[0, 0, 0], [0, 0, -2]] }\n\
         tip_force = { at = [7], value = [[1, 2, 3]] }\ntip_moment = { at = [0], value = [[0, 0, 0]] }\n\
         rest = { at = [0, 1, 2], factor = [1, -1, 0.5] }",
    );
    assert_eq!(dynamics.density, vec![Profile::Constant(2.0); 2]);
    assert_eq!(dynamics.rotary_inertia[1][0].at(0.5), 3.5);
    // About both axes of bending, unless that about d3 is given.
    let both = |dynamics: &Dynamics| dynamics.rotary_inertia[1].each_ref().map(|it| it.at(0.5));
    assert_eq!(both(&dynamics), [3.5; 2]);
    let apart = accepted("rotary_inertia = 0.2\nrotary_inertia_3 = [0.3, 0.4]");
    assert_eq!(
        (both(&apart), apart.polar_inertia),
        ([0.2, 0.4], PolarInertia::Sum)
    );
    assert_eq!(dynamics.external_damping, 0.0);
    assert_eq!(dynamics.internal_damping, 1e-3);
    assert_eq!((dynamics.duration, dynamics.output_interval), (4.0, 4.0));
    assert_eq!(dynamics.gravity.at(0.0), [0.0, 0.0, -1.0]);
    assert!(dynamics.tip_force.is_constant());
    assert_eq!(dynamics.tip_force.at(0.0), [1.0, 2.0, 3.0]);
    assert_eq!(dynamics.rest.at(1.5), -0.25);
    // What is at rest does not see it.
    let scenario = with("gravity = { at = [0], value = [[1, 0, 0]] }").unwrap();
    assert_eq!(scenario.gravity, [0.0, 0.0, -1.0]);
    assert_eq!(scenario.dynamics.gravity.at(0.0), [1.0, 0.0, 0.0]);
}

#[test]
fn a_radius_gives_the_moment_of_inertia() {
    let dynamics = accepted("density = [2.0, 3.0]\nsection_radius = [0.2, 0.4]");
    close(dynamics.rotary_inertia[0][0].at(0.0), 0.02);
    close(dynamics.rotary_inertia[1][0].at(1.0), 0.12);
    let dynamics = accepted(
        "density = { at = [0, 0.5, 1], value = [4, 4, 2] }\nsection_radius = { at = [0, 1], value = [0.4, 0.2] }",
    );
    let expected = [(0.0, 0.16), (0.5, 0.09), (1.0, 0.02), (0.25, 0.125)];
    for (sigma, inertia) in expected {
        close(dynamics.rotary_inertia[0][0].at(sigma), inertia);
    }
    // The product at the knots of both.
    let dynamics = accepted(
        "density = { at = [0, 0.5, 1], value = [4, 2, 2] }\nsection_radius = { at = [0, 0.25, 1], value = [2, 2, 1] }",
    );
    let both = linear(
        &[0.0, 0.25, 0.5, 1.0],
        &[4.0, 3.0, 0.5 * (5.0_f64 / 3.0).powi(2), 0.5],
    );
    assert_eq!(dynamics.rotary_inertia[0][0], both);
    // With one radius it is exact.
    let dynamics = accepted("density = { at = [0, 1], value = [4, 2] }\nsection_radius = 2");
    assert_eq!(
        dynamics.rotary_inertia[0][0],
        linear(&[0.0, 1.0], &[4.0, 2.0])
    );
}

#[test]
fn a_single_rod_may_be_free() {
    let single = STILL
        .replace("rods = 2", "rods = 1")
        .replace("[2.0, 1.0]", "2.0")
        .replace("[0.0, 1.0]", "1.0");
    let text = format!(
        "{single}[dynamics]\nclamped = false\ntip_moment = {{ at = [0, 1], value = [[0, 0, 0], [0, 0, 5]] }}"
    );
    let dynamics = Scenario::from_toml(&text).unwrap().dynamics;
    assert!(!dynamics.clamped);
    assert_eq!(dynamics.tip_moment.at(0.5), [0.0, 0.0, 2.5]);
    let text = text.replace("[0, 0, 5]", "[0, 0, 5e8]");
    let moment = "dynamics.tip_moment, value, entry 2 = [0, 0, 5e8]: gives |M| L/A = 1.000e9, the limit is 1e8";
    holds(Scenario::from_toml(&text), &[moment]);
}

#[test]
fn overrides() {
    let with = |given: &str| Scenario::from_toml_with(STILL, "leaf.toml", &[given.to_string()]);
    let dynamics = |given: &str| with(given).unwrap().dynamics;
    assert_eq!(dynamics("dynamics.duration=3").duration, 3.0);
    let rest = "dynamics.rest={at=[0,1],factor=[1,2]}";
    assert_eq!(dynamics(rest).rest.at(0.5), 1.5);
    assert!(dynamics("dynamics.clamped=true").clamped);
    let negative = "dynamics.duration=-3";
    let part = "dynamics.duration = -3: must be greater than 0";
    holds(with(negative), &[&format!("set {negative}: {part}")]);
    let vector = "dynamics.gravity=[0,0,-1]";
    let part = "dynamics.gravity = [0,0,-1]: must be a table: a load in time is {";
    holds(with(vector), &[&format!("set {vector}: {part}")]);
    let part = "unknown key dynamics.durration (did you mean dynamics.duration?)";
    holds(with("dynamics.durration=3"), &[part]);
}

#[test]
fn unknown_keys() {
    let table = r#"
        denisty = 1.0 => leaf.toml:20: unknown key dynamics.denisty (did you mean dynamics.density?) & density, rotary_inertia, rotary_inertia_3, section_radius, external_damping, internal_damping, duration, output_interval, clamped, start, gravity, tip_force, tip_moment, rest
        [dynamics.load] => unknown key dynamics.load
    "#;
    all_refused(table, with_lines);
    let text = format!("dynamics = 3\n{STILL}");
    let table = "scenario:1: dynamics = 3: must be a table: write [dynamics]";
    holds(Scenario::from_toml(&text), &[table]);
}

#[test]
fn wrong_types_and_ranges() {
    let table = r#"
        density = 0 => leaf.toml:20: dynamics.density = 0: must be greater than 0
        density = [1.0, -1.0] => leaf.toml:20: dynamics.density, entry 2 = -1.0: must be greater than 0
        density = [1.0] => dynamics.density = [1.0]: has 1 entries: must have 2, one per rod
        density = 1e99 => dynamics.density = 1e99: must lie between 1e-50 and 1e50
        density = inf => dynamics.density = inf: must be a finite number
        density = true => dynamics.density = true: must be a number, a list of 2 (one per rod), or a profile
        \nrotary_inertia = { at = [0, 1], value = [1, 0] } => leaf.toml:21: dynamics.rotary_inertia, value, entry 2 = 0: must be greater than 0
        section_radius = -1 => dynamics.section_radius = -1: must be greater than 0
        rotary_inertia_3 = 0.1 => leaf.toml:20: dynamics.rotary_inertia_3 = 0.1: is the inertia about d3 alone: give dynamics.rotary_inertia, that about d2, too
        section_radius = 0.1\nrotary_inertia_3 = 0.1 => is the inertia about d3 alone
        section_radius = 0.1\nrotary_inertia = 0.1 => leaf.toml:20: dynamics.section_radius = 0.1: dynamics.rotary_inertia is given, too & leave one of them out
        external_damping = -1 => leaf.toml:20: dynamics.external_damping = -1: must not be negative
        external_damping = [1.0, 1.0] => dynamics.external_damping = [1.0, 1.0]: must be a number
        internal_damping = inf => dynamics.internal_damping = inf: must be a finite number
        duration = 0 => dynamics.duration = 0: must be greater than 0
        duration = "long" => dynamics.duration = "long": must be a number
        output_interval = 0 => dynamics.output_interval = 0: must be greater than 0
        output_interval = 11 => leaf.toml:20: dynamics.output_interval = 11: must be at most dynamics.duration, 10
        clamped = 1 => dynamics.clamped = 1: must be true or false
        clamped = false => leaf.toml:20: dynamics.clamped = false: a free base needs leaf.rods = 1 (here 2)
        tip_moment = { at = [0, 1], value = [[0, 0, 0], [0, 0, 1]] } => leaf.toml:20: dynamics.tip_moment = { & a moment at the tip needs leaf.rods = 1 (here 2)
    "#;
    all_refused(table, with_lines);
}

#[test]
fn loads_and_factors_in_time() {
    let table = r#"
        gravity = 1.0 => leaf.toml:20: dynamics.gravity = 1.0: must be a table: a load in time is { at = [0.0, 1.0], value = [[
        gravity = {} => dynamics.gravity = {}: at is missing: a load in time is
        gravity = { at = [0.0] } => value is missing: a load in time is
        gravity = { at = [0.0], factor = [1.0] } => unknown key factor: a load in time is
        gravity = { at = 0.0, value = [[0, 0, 1]] } => dynamics.gravity, at = 0.0: must be a list of numbers
        gravity = { at = [], value = [] } => dynamics.gravity, at = []: at least one time is needed
        gravity = { at = [0, 1, 1], value = [[0, 0, 1]] } => dynamics.gravity, at, entry 3 = 1: must be greater than the entry before it, 1: times rise strictly
        gravity = { at = [0, inf], value = [[0, 0, 1]] } => dynamics.gravity, at, entry 2 = inf: must be a finite number
        gravity = { at = [0, 1], value = [[0, 0, 1]] } => dynamics.gravity, value = [[0, 0, 1]]: has 1 entries: must have 2, one per entry of at
        gravity = { at = [0], value = 1 } => dynamics.gravity, value = 1: must be a list of lists of three numbers
        gravity = { at = [0], value = [1] } => dynamics.gravity, value, entry 1 = 1: must be a list of three numbers [x, y, z]
        gravity = { at = [0], value = [[0, 1]] } => dynamics.gravity, value, entry 1 = [0, 1]: has 2 entries: must have 3, one per axis
        tip_force = { at = [0,\n 1], value = [[0, 0, 1],\n [0, nan, 1]] } => leaf.toml:22: dynamics.tip_force, value, entry 2, component 2 = nan: must be a finite number
        rest = 2.0 => dynamics.rest = 2.0: must be a table: a factor in time is { at = [0.0, 1.0], factor = [1.0, 2.0] }
        rest = { at = [0], values = [1] } => unknown key values: a factor in time is
        rest = { at = [0], value = [1, 2] } => dynamics.rest, value = [1, 2]: has 2 entries: must have 1, one per entry of at
        rest = { amplitude = [1], frequency = 1 } => dynamics.rest, amplitude = [1]: must be a number
        gravity = { amplitude = 1, frequency = 1 } => dynamics.gravity, amplitude = 1: must be a list of three numbers [x, y, z]
        gravity = { amplitude = [0, 0, 1], frequency = inf } => dynamics.gravity, frequency = inf: must be a finite number
        rest = { at = [0], factor = 1 } => dynamics.rest, factor = 1: must be a list of numbers
        rest = { at = [0, 1], factor = [1, true] } => dynamics.rest, factor, entry 2 = true: must be a number
        [dynamics.rest]\nat = [0, 1] => leaf.toml:20: dynamics.rest = & factor is missing
    "#;
    all_refused(table, with_lines);
}

/// A = 2, L = 2, but the smallest bending stiffness is 1.
#[test]
fn limits_that_values_set_together() {
    let table = r#"
        density = [1.0, 1e-13] => leaf.toml:20: dynamics.density, entry 2 = 1e-13: gives rho/rho_mean = 2.000e-13, the limit is 1e-12
        density = { at = [0, 0.5, 1], value = [1e13, 1, 1] } => rho/rho_mean = 1.000e13, the limit is 1e12
        density = 1.0\nrotary_inertia = 1e13 => leaf.toml:21: dynamics.rotary_inertia = 1e13: gives rho I/(rho_mean L^2) = 2.500e12, the limit is 1e12
        rotary_inertia = 1.0\nrotary_inertia_3 = 1e13 => leaf.toml:21: dynamics.rotary_inertia_3 = 1e13: gives rho I/(rho_mean L^2)
        density = 1.0\nrotary_inertia = [1.0, 1e-13] => dynamics.rotary_inertia, entry 2 = 1e-13: gives rho I/(rho_mean L^2) = 2.500e-14
        section_radius = [0.1, 1e-6] => dynamics.section_radius, entry 2 = 1e-6: gives r/L = 5.000e-7, the limit is 1e-6
        density = 8\nexternal_damping = 1e13 => leaf.toml:21: dynamics.external_damping = 1e13: gives c T/rho_mean = 1.000e13, the limit is 1e12
        external_damping = 1e308 => dynamics.external_damping = 1e308: gives c T/rho_mean
        density = 8\ninternal_damping = 1e13 => dynamics.internal_damping = 1e13: gives t/T = 1.250e12, the limit is 1e12
        density = 8\nduration = 1e13 => dynamics.duration = 1e13: gives t/T = 1.250e12, the limit is 1e12
        duration = 1e-13 => dynamics.duration = 1e-13: gives t/T = 1.000e-13, the limit is 1e-12
        output_interval = 9.9e-6 => leaf.toml:20: dynamics.output_interval = 9.9e-6: gives duration/output_interval = 1.010e6, the limit is 1e6
        rest = { at = [0, 1e13], factor = [1, 1] } => dynamics.rest, at, entry 2 = 1e13: gives |t|/T = 1.000e13, the limit is 1e12
        tip_force = { at = [-1.7e308, 1.7e308], value = [[0, 0, 0], [0, 0, 0]] } => dynamics.tip_force, at, entry 1 = -1.7e308: gives |t|/T
        gravity = { at = [0, 1], value = [[0, 0, 0], [0, 0, 1e8]] } => dynamics.gravity, value, entry 2 = [0, 0, 1e8]: gives |g| L^3/A = 8.000e8, the limit is 1e8
        tip_force = { at = [0], value = [[1.7e308, 1.7e308, 0]] } => dynamics.tip_force, value, entry 1 = [1.7e308, 1.7e308, 0]: gives |F| L^2/A
        rest = { at = [0, 1], factor = [1, -10010] } => dynamics.rest, factor, entry 2 = -10010: gives |factor u0| L = 1.001e4, the limit is 1e4
        rest = { at = [0], factor = [1e307] } => dynamics.rest, factor, entry 1 = 1e307: gives |factor| = 1.000e307, the limit is 1e6
    "#;
    all_refused(table, with_lines);
    // At the limits.
    accepted("output_interval = 1e-5");
    accepted("duration = 0.3\noutput_interval = 3e-7");
    accepted("rest = { at = [0], factor = [1e3] }");
    // A small density alone is enough for a small moment of inertia.
    accepted("density = [1.0, 1e-12]");
    accepted("density = [1.0, 1e-12]\nsection_radius = 0.01");
}

fn positive_and_finite(dynamics: &Dynamics) -> bool {
    let profiles = dynamics
        .density
        .iter()
        .chain(dynamics.rotary_inertia.iter().flatten());
    let values = profiles.flat_map(|it| [0.0, 0.3, 0.5, 1.0].map(|s| it.at(s)));
    let times = [dynamics.duration, dynamics.output_interval];
    let mut values = values.chain(times).chain([dynamics.external_damping]);
    let fine = |value: f64| value > 0.0 && value.is_finite();
    values.all(fine) && dynamics.output_interval <= dynamics.duration
}

proptest! {
    #![proptest_config(leafdyn_testing::random::cases(2000))]

    /// In any units.
    #[test]
    fn what_is_accepted_is_positive_and_finite(
        [length, bending, density, radius] in prop::array::uniform4(-50.0..50.0_f64),
        steep in -12.0..12.0_f64,
        given in 0..3,
    ) {
        let [length, bending, density, radius] = [length, bending, density, radius].map(|x| 10_f64.powf(x));
        let dynamics = match given {
            0 => String::new(),
            1 => format!("density = {density:e}"),
            _ => format!("density = {{ at = [0, 0.5, 1], value = [{0:e}, {density:e}, {0:e}] }}", density * 10_f64.powf(steep)),
        };
        // A radius near the length, or far from it.
        let radius = if given == 1 { format!("section_radius = {:e}", length * radius.powf(0.1)) } else { String::new() };
        let text = format!(
            "name = \"leaf\"\nleaf = {{ rods = 1, length = {length:e}, fan = [0.0] }}\n\
             stiffness = {{ torsion = {bending:e}, bending_2 = {bending:e}, bending_3 = {bending:e}, axial = inf, shear_2 = inf, shear_3 = inf }}\n\
             [dynamics]\n{dynamics}\n{radius}\n",
        );
        match Scenario::from_toml(&text) {
            Ok(scenario) => prop_assert!(positive_and_finite(&scenario.dynamics), "{:?}", scenario.dynamics),
            Err(error) => {
                prop_assert!(given > 0);
                let message = error.to_string();
                prop_assert!(message.contains("choose"), "{}", message);
            }
        }
    }
}
