//! Reports print the digits of results that are known, and no more.

use leafdyn_testing::workplace::Workplace;

/// A closed ring of a straight rod, twisted: what holds its tip is a small force between large
/// moments.
const RING: &str = r#"
name = "ring"
leaf = { rods = 1, length = 1.0, fan = [0.0] }
stiffness = { torsion = 0.7, bending_2 = 1.0, bending_3 = 1.0, axial = inf, shear_2 = inf, shear_3 = inf }
tip = { held = "clamped", position = [0.0, 0.0, 0.0], angles = 6.283185307179586 }
"#;

/// The three numbers of a report's line, with the place of the last digit of each.
fn numbers(report: &str, line: &str) -> Vec<(f64, f64)> {
    let line = report.lines().find(|it| it.trim_start().starts_with(line));
    let inside = line.unwrap().split(['(', ')']).nth(1).unwrap();
    let number = |text: &str| {
        let (digits, power) = text.split_once('e').unwrap_or((text, "0"));
        let decimals = digits.split_once('.').map_or(0, |(_, it)| it.len() as i32);
        let power: i32 = power.parse().unwrap();
        (text.parse().unwrap(), 10_f64.powi(power - decimals))
    };
    inside.split(", ").map(number).collect()
}

#[test]
fn the_force_on_a_holder_has_known_digits() {
    let place = Workplace::new();
    place.write("ring.toml", RING);
    for (twist, bending) in [(0.0, 1.0), (0.487, 1.63), (1.701, 0.708), (0.403, 0.4)] {
        let given = format!(
            "relax ring.toml --write none --modes 0 --set tip.twist={twist} --set stiffness.bending_2={bending}"
        );
        let sharp = place.ok(format!("{given} --tolerance 1e-11 --json")).json();
        let sharp = leafdyn_testing::workplace::floats(&sharp["tip_reaction"]);
        for tolerance in ["1e-4", "1e-6"] {
            let report = place.ok(format!("{given} --tolerance {tolerance}")).out;
            let printed = numbers(&report, "reaction ");
            for ((printed, place), exact) in printed.iter().zip(&sharp) {
                // What is printed as zero is not known at all.
                let off = (printed - exact).abs();
                let allowed = if *printed == 0.0 { 1e-4 } else { 1.01 * place };
                assert!(
                    off <= allowed,
                    "{twist}, {bending}, {tolerance}: {report} {sharp:?}"
                );
            }
        }
    }
    // A ring without twist needs moments alone.
    let report = place
        .ok("relax ring.toml --write none --set tip.twist=0.0")
        .out;
    assert_eq!(numbers(&report, "reaction ").len(), 3);
    assert!(
        report.contains("  reaction (0, 0, 0) on the holder"),
        "{report}"
    );
}

/// Rounding leaves no fifteen decimals.
#[test]
fn an_exact_tip_has_the_digits_that_rounding_leaves() {
    let place = Workplace::new();
    let column = "trace leaf.toml --write none --set leaf.rods=1 --set leaf.fan=[0] --set coupling.y=0 \
                  --set coupling.z=0 --set load.gravity=[0,0,0] --vary load.tip_force[0]=0..-1";
    let report = place.ok(column).out;
    for line in report.lines().filter(|line| line.contains(", tip (")) {
        for (_, place) in numbers(line.split(", tip").nth(1).unwrap(), "(") {
            assert!(place > 5e-15, "{report}");
        }
    }
}
