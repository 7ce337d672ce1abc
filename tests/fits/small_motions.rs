//! Frequencies under loads without a potential, of damped small motions, as data.

use leafdyn::study::{FitOutcome, fit};
use leafdyn_testing::fit::{fitted, gives_back, request};
use leafdyn_testing::*;

/// Beck's column, inextensible and of unit length and density, which hardly bends about its other axis.
const COLUMN: &str = r#"
    name = "column"
    leaf = { rods = 1, length = 1.0, fan = [0.0] }
    stiffness = { torsion = 100.0, bending_2 = 100.0, bending_3 = 1.0, axial = inf, shear_2 = inf, shear_3 = inf }
    dynamics = { density = 1.0, external_damping = 0.0 }
    [[load.point]]
    vein = 1
    at = 1.0
    force = [-1.0, 0.0, 0.0]
    follows = true
"#;

/// The characteristic function of a column of unit length, stiffness and density under the load p along the tangent
/// of its tip (M. Beck, ZAMP 3, 1952): zero at its angular frequencies.
fn beck(p: f64, frequency: f64) -> f64 {
    let root = (0.25 * p * p + frequency * frequency).sqrt();
    let [a, b] = [root - 0.5 * p, root + 0.5 * p].map(f64::sqrt);
    p * p
        + 2.0 * frequency * frequency * (1.0 + a.cosh() * b.cos())
        + p * frequency * a.sinh() * b.sin()
}

/// The two lowest frequencies in cycles per time of a column of this stiffness.
fn frequencies(stiffness: f64, load: f64) -> [f64; 2] {
    let p = load / stiffness;
    let (mut zeros, step) = (Vec::new(), 0.01);
    let mut low = step;
    while zeros.len() < 2 {
        if beck(p, low) * beck(p, low + step) < 0.0 {
            let (mut from, mut to) = (low, low + step);
            while to - from > 1e-13 {
                let middle = 0.5 * (from + to);
                match beck(p, from) * beck(p, middle) < 0.0 {
                    true => to = middle,
                    false => from = middle,
                }
            }
            zeros.push(from);
        }
        low += step;
    }
    [zeros[0], zeros[1]].map(|zero| zero * stiffness.sqrt() / (2.0 * PI))
}

/// The frequencies of Beck's equation give the stiffness back, up to loads near that of flutter, 20.05: on as many grids
/// as they need, where the straight column itself is exact on any.
#[test]
fn the_stiffness_of_a_column_comes_back_from_its_frequencies() {
    let stiffness = 0.83;
    let mut table = String::from(
        "load.point[0].force[0],frequency_1,frequency_2,sd_frequency_1,sd_frequency_2\n",
    );
    for load in [2.0, 8.0, 14.0] {
        let [one, two] = frequencies(stiffness, load);
        table += &format!("{:?},{one:?},{two:?},1e-4,1e-4\n", -load);
    }
    let free = ["stiffness.bending_3"];
    let mut asked = request(base(COLUMN, ""), &[&table], &free);
    asked.tolerance = Some(1e-7);
    let found = fitted(&asked);
    assert_eq!(found.outcome, FitOutcome::Converged, "{:?}", found.remarks);
    gives_back(&found, &[stiffness], 1e-5);
    // By a datum the stiffness is known within its deviation over the derivative, as Beck's equation has it.
    let step = 1e-5;
    let rate = |load: f64, mode: usize| {
        let [low, high] = [-step, step].map(|by| frequencies(stiffness + by, load)[mode]);
        (high - low) / (2.0 * step)
    };
    let rates = [2.0, 8.0, 14.0].map(|load| [0, 1].map(|mode| rate(load, mode)));
    let squares: f64 = rates
        .as_flattened()
        .iter()
        .map(|it| (it / 1e-4).powi(2))
        .sum();
    let error = found.parameters[0].standard_error.unwrap();
    close("standard error", error * squares.sqrt(), 1.0, 1e-4);
}

/// The frequencies of a straight cantilever give its stiffness back within its bar, as accurately as the deviations of the
/// data ask for: the leaf is exact on any grid, its frequencies are not.
#[test]
fn frequencies_of_a_straight_cantilever_are_as_accurate_as_the_data() {
    let cantilever = COLUMN.split("[[load.point]]").next().unwrap();
    // Left out it is that of the section.
    let slender = "external_damping = 0.0, rotary_inertia = 1e-9";
    let cantilever = &cantilever.replace("external_damping = 0.0", slender);
    for deviation in [1e-3, 1e-5, 1e-6] {
        let roots = [1.875_104_068_711_961_1_f64, 4.694_091_132_974_175];
        let [one, two] = roots.map(|root| root * root / (2.0 * PI));
        let table = format!(
            "frequency_1,frequency_2,sd_frequency_1,sd_frequency_2\n{one:?},{two:?},{deviation:?},{deviation:?}\n"
        );
        let mut asked = request(base(cantilever, ""), &[&table], &["stiffness.bending_3"]);
        asked.tolerance = Some(1e-8);
        let found = fitted(&asked);
        assert_eq!(found.outcome, FitOutcome::Converged, "{:?}", found.remarks);
        let parameter = &found.parameters[0];
        let apart = (parameter.value - 1.0).abs();
        let bar = parameter.standard_error.unwrap();
        assert!(apart < 0.5 * bar, "{deviation}: {apart:e} {bar:e}");
        assert!(apart < 4e-5, "{deviation}: {apart:e}");
    }
}

/// A vein in wind, whose drag damps it, with loads that turn with it and damping of its own.
const BLOWN: &str = r#"
    name = "vein"
    leaf = { rods = 1, length = 1.0, fan = [0.2] }
    stiffness = { torsion = 0.8, bending_2 = 1.0, bending_3 = 1.4, axial = 60.0, shear_2 = 70.0, shear_3 = 50.0 }
    load = { gravity = [0.1, 0.2, -0.5], follower = [0.2, -0.4, 0.8] }
    wind = { velocity = [0.5, 0.8, 1.0], density = 1.2, drag = 2.0, width = 0.3 }
    dynamics = { density = 1.3, rotary_inertia = 0.01, rotary_inertia_3 = 0.03, external_damping = 0.2, internal_damping = 0.01 }
"#;

/// Frequencies of damped motions give numbers back, and the derivatives by which their bars are told are differences
/// of whole relaxations.
#[test]
fn damped_frequencies_are_differentiated() {
    let told = |scenario: &Scenario| {
        let leaf = relaxed(scenario, &with_modes(3, to(1e-9)));
        let motions = leaf.stability.small_motions.unwrap();
        [0, 1, 2].map(|k| motions.frequencies[k] / (2.0 * PI))
    };
    let calm = BLOWN.lines().filter(|line| !line.contains("wind"));
    let calm = calm.collect::<Vec<_>>().join("\n");
    for (text, free, truth) in [
        (BLOWN, "stiffness.bending_3", 1.6),
        (BLOWN, "wind.drag", 2.2),
        (BLOWN, "dynamics.density", 1.4),
        (BLOWN, "dynamics.rotary_inertia_3", 0.035),
        (calm.as_str(), "dynamics.rotary_inertia", 0.012),
        (calm.as_str(), "stiffness.bending_2", 1.15),
        (calm.as_str(), "load.follower[2]", 0.9),
    ] {
        let at = |value: f64| told(base(text, &format!("{free}={value:?}")).scenario());
        let measured = at(truth).map(|it| format!("{it:?}")).join(",");
        let table = format!(
            "frequency_1,frequency_2,frequency_3,sd_frequency_1,sd_frequency_2,sd_frequency_3\n{measured},1e-4,1e-4,1e-4\n"
        );
        let mut asked = request(base(text, ""), &[&table], &[free]);
        asked.tolerance = Some(1e-7);
        let found = fitted(&asked);
        gives_back(&found, &[truth], 1e-4);
        let step = 1e-3 * truth;
        let [low, high] = [-step, step].map(|by| at(truth + by));
        let rates = [0, 1, 2].map(|k| (high[k] - low[k]) / (2.0 * step));
        let squares: f64 = rates.iter().map(|rate| (rate / 1e-4).powi(2)).sum();
        let error = found.parameters[0].standard_error.unwrap();
        close(free, error * squares.sqrt(), 1.0, 1e-3);
    }
}

/// What has no derivative, or does not oscillate, is refused, where no number that is free changes that.
#[test]
fn motions_that_merge_or_do_not_oscillate_are_refused() {
    let said = |text: &str| {
        let table = "frequency_1,sd_frequency_1\n0.5,0.01\n";
        let asked = request(base(text, ""), &[table], &["stiffness.torsion"]);
        fit(&asked, &mut |_| {}).unwrap_err().to_string()
    };
    let beside_flutter = COLUMN.replace("[-1.0, 0.0, 0.0]", "[-20.04, 0.0, 0.0]");
    let found = said(&beside_flutter);
    assert!(
        found.contains("small motion 1 is about to merge with another one"),
        "{found}"
    );
    let damped = COLUMN.replace("external_damping = 0.0", "external_damping = 30.0");
    let found = said(&damped);
    assert!(
        found.contains("small motion 1 does not oscillate"),
        "{found}"
    );
}
