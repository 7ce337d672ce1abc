//! `leafdyn unbend` reads points as they were measured, tells what their posture proves, and writes what rests there.

use leafdyn::scenario::Scenario;
use leafdyn_testing::root;
use leafdyn_testing::workplace::Workplace;
use serde_json::Value;
use std::fs;

fn example(name: &str) -> String {
    fs::read_to_string(root().join("scenarios/measured").join(name)).unwrap()
}

/// A place with the example and its points.
fn place() -> Workplace {
    let place = Workplace::new();
    place.write("leaf.toml", example("posture.toml"));
    place.write("points.csv", example("posture.csv"));
    place
}

fn least(told: &Value) -> f64 {
    told["critical_young"]["value"].as_f64().unwrap()
}

/// The points with another header, and each row changed.
fn rewritten(header: &str, row: impl Fn(usize, f64, f64) -> String) -> String {
    let text = example("posture.csv");
    let rows = text
        .lines()
        .filter(|line| !line.starts_with('#'))
        .skip(1)
        .enumerate();
    let rows = rows.map(|(k, line)| {
        let (x, z) = line.split_once(',').unwrap();
        row(k, x.parse().unwrap(), z.parse().unwrap())
    });
    let rows: Vec<String> = rows.collect();
    format!("{header}\n{}\n", rows.join("\n"))
}

#[test]
fn the_scenario_that_rests_there_is_stable_at_larger_moduli_alone() {
    let place = place();
    let told = place
        .run("unbend leaf.toml --shape points.csv --json")
        .ok()
        .json();
    let young = least(&told);
    let [low, high] = ["low", "high"].map(|end| told["critical_young"][end].as_f64().unwrap());
    assert!(
        low < young && young < high && high < 1.2 * low,
        "{low} {young} {high}"
    );
    assert_eq!(told["governing"], "in-plane");
    assert_eq!(told["modulus"], "young");
    assert!(told["rest_check"]["distance"].as_f64().unwrap() < 1e-4);
    assert_eq!(told["rest_check"]["index"], 0);
    assert!(told["reached_from"].as_f64().unwrap() > young);
    for (factor, index, status) in [(1.1, 0, 0), (0.9, 1, 1)] {
        let run = format!(
            "unbend leaf.toml --shape points.csv --json --young {}",
            factor * young
        );
        let told = place.run(run).ends(status).json();
        assert_eq!(told["index"], index);
        assert_eq!(told["rest_check"]["index"], index, "{factor}");
    }
    let range = format!(
        "unbend leaf.toml --shape points.csv --json --young {}..{}",
        0.9 * young,
        9.0 * young
    );
    let told = place.run(range).ends(1).json();
    assert_eq!(told["index"][0]["index"], 1);
    assert_eq!(told["index"][1]["index"], 0);
}

#[test]
fn its_files_are_those_of_one_modulus() {
    let place = place();
    place
        .run("unbend leaf.toml --shape points.csv --young 6e4 --out out")
        .says(&[
            "posture: posture of 24 points",
            "bends on in its plane",
            "0 at 60000 N/cm²: stable",
            "slow loading leads here from",
        ]);
    let rest = Scenario::from_toml(&place.read("out/rest.toml")).unwrap();
    // The section is that of the scenario, with this modulus.
    let text = place.read("out/rest.toml");
    for part in [
        "[section]",
        "young = 60000",
        "mass_density = ",
        "thickness = 0.035",
    ] {
        assert!(text.contains(part), "{part}: {text}");
    }
    assert!(!text.contains("[stiffness]"), "{text}");
    // A2 at the base: E w t^3/12.
    let bending = 6e4 * 0.9 * 0.035_f64.powi(3) / 12.0;
    assert!((rest.rods[0].couple_stiffness[1].at(0.0) / bending - 1.0).abs() < 1e-9);
    let table = place.read("out/rest.csv");
    let mut rows = table.lines();
    assert!(
        rows.next()
            .unwrap()
            .starts_with("sigma,s,x,y,z,u1,u2,u3,m1,m2,m3,u0_1,u0_2,u0_3,x0,y0,z0,sd_u1")
    );
    let last: Vec<f64> = rows
        .last()
        .unwrap()
        .split(',')
        .map(|cell| cell.parse().unwrap())
        .collect();
    // The tip bears no moment, and the rest shape is that of the posture there.
    assert!(last[9].abs() < 1e-12 && (last[6] - last[12]).abs() < 1e-9);
    let leaf = rest.relax().unwrap();
    let off = (leaf.tips[0].x - last[2]).hypot(leaf.tips[0].z - last[4]);
    assert!(off < 1e-3 * 24.0, "{off}");
    let svg = place.read("out/unbend.svg");
    for text in [
        "the leaf as measured",
        "with 95 % bands",
        "the critical mode",
        "the index at every E",
        "slow loading leads here",
        "bend about d2 / (1/cm)",
    ] {
        assert!(svg.contains(text), "{text}");
    }
}

#[test]
fn points_are_read_as_they_are_written() {
    let place = place();
    let told = place
        .run("unbend leaf.toml --shape points.csv --json --write none")
        .ok()
        .json();
    let same = |name: &str, table: &str| {
        place.write(name, table);
        let run = place.run(format!(
            "unbend leaf.toml --shape {name} --json --write none"
        ));
        let found = run.ends(0).json();
        // The weight of the penalty is found to some digits.
        let off = least(&found) / least(&told) - 1.0;
        assert!(off.abs() < 1e-4, "{name}: {off}");
        found
    };
    same(
        "space.csv",
        &rewritten("x,y,z", |_, x, z| format!("{x},0.0,{z}")),
    );
    same(
        "comma.csv",
        &rewritten("x;z;note", |_, x, z| {
            format!("{x};{z};seen").replace('.', ",")
        }),
    );
    let flat = same("flat.csv", &rewritten("x,y", |_, x, z| format!("{x},{z}")));
    assert!(flat["remarks"][0].as_str().unwrap().contains("upwards"));
    // Turned about the vertical.
    same(
        "turned.csv",
        &rewritten("x,y,z", |_, x, z| format!("{},{},{z}", 0.6 * x, -0.8 * x)),
    );
    let photo = format!(
        "{}\n[photo]\nscale = 0.01\nx = 300.0\ny = 2000.0\n",
        example("posture.toml")
    );
    place.write("leaf.toml", &photo);
    same(
        "pixels.csv",
        &rewritten("pixel_x,pixel_y", |_, x, z| {
            format!("{},{}", 300.0 + 100.0 * x, 2000.0 - 100.0 * z)
        }),
    );
    // Standard deviations that are given are believed.
    place.write(
        "sd.csv",
        rewritten("x,z,sd", |_, x, z| format!("{x},{z},0.2")),
    );
    let found = place
        .run("unbend leaf.toml --shape sd.csv --json --write none")
        .ends(0)
        .json();
    assert_eq!(found["smoothing"]["sd_given"], true);
    let width = |it: &Value| {
        it["critical_young"]["high"].as_f64().unwrap()
            / it["critical_young"]["low"].as_f64().unwrap()
    };
    assert!(width(&found) > width(&told));
}

#[test]
fn what_cannot_be_used_is_refused_with_what_to_do() {
    let place = place();
    let refused = |run: &str, parts: &[&str]| {
        let run = place.run(format!("unbend {run} --write none")).ends(2);
        for part in parts {
            assert!(run.err.contains(part), "{part}: {}", run.err);
        }
    };
    let backwards = {
        let text = rewritten("x,z", |_, x, z| format!("{x},{z}"));
        let mut rows: Vec<&str> = text.lines().skip(1).collect();
        rows.reverse();
        format!("x,z\n{}\n", rows.join("\n"))
    };
    place.write("backwards.csv", &backwards);
    refused(
        "leaf.toml --shape backwards.csv",
        &["backwards.csv", "tip to base", "turn their order around"],
    );
    place.write(
        "pixels.csv",
        rewritten("pixel_x,pixel_y", |_, x, z| format!("{x},{z}")),
    );
    refused("leaf.toml --shape pixels.csv", &["[photo]", "give x, y, z"]);
    place.write(
        "hole.csv",
        rewritten("x,z", |k, x, z| {
            if k == 3 {
                format!("{x},")
            } else {
                format!("{x},{z}")
            }
        }),
    );
    refused(
        "leaf.toml --shape hole.csv",
        &["hole.csv:5", "z is empty", "leave the row out"],
    );
    place.write(
        "mm.csv",
        rewritten("x,z", |_, x, z| format!("{},{}", 10.0 * x, 10.0 * z)),
    );
    refused(
        "leaf.toml --shape mm.csv",
        &["mm.csv", "leaf.length is 24", "are they in mm?", "x=x:0.1"],
    );
    let run =
        "unbend leaf.toml --shape mm.csv --column x=x:0.1 --column z=z:0.1 --json --write none";
    assert!(least(&place.run(run).ends(0).json()) > 0.0);
    place.write("short.csv", "x,z\n0,0\n8,8\n16,16\n");
    refused("leaf.toml --shape short.csv", &["3 points", "at least 6"]);
    place.write("words.csv", "a,b\n0,0\n");
    refused(
        "leaf.toml --shape words.csv",
        &["none of the columns", "a, b", "x, y, z"],
    );
    refused(
        "leaf.toml --shape points.csv --young 0",
        &["--young", "greater than 0"],
    );
    refused(
        "leaf.toml --shape points.csv --young 9..1",
        &["--young", "the smaller one first"],
    );
    refused(
        "leaf.toml --shape points.csv --set leaf.rods=3 --set leaf.fan=\"symmetric\"",
        &["leaf.rods", "one vein"],
    );
    refused("leaf.toml --shape none.csv", &["none.csv"]);
    refused(
        "leaf.toml --shape points.csv --second short.csv",
        &["short.csv", "at least 6"],
    );
}

/// The leaf at rest and turned over, from relaxations, gives its modulus back.
#[test]
fn a_leaf_that_is_turned_over_tells_its_modulus() {
    let place = place();
    place
        .run("unbend leaf.toml --shape points.csv --young 6e4 --out out")
        .ends(0);
    let rest = Scenario::from_toml(&place.read("out/rest.toml")).unwrap();
    let points = |scenario: &Scenario| {
        let leaf = scenario.relax().unwrap().at_stations(scenario, Some(40));
        let rows = leaf.shape.rods[0]
            .nodes
            .iter()
            .map(|node| format!("{},{}", node.position.x, node.position.z));
        format!("x,z\n{}\n", rows.collect::<Vec<_>>().join("\n"))
    };
    place.write("as-hung.csv", points(&rest));
    let mut over = rest.clone();
    over.rods[0].roll = std::f64::consts::PI;
    place.write("over.csv", points(&over));
    for angle in ["", ":180", ":-180"] {
        let run = format!(
            "unbend leaf.toml --shape as-hung.csv --second over.csv{angle} --json --write none"
        );
        let told = place.run(run).ends(0).json();
        let young = told["young"]["value"].as_f64().unwrap();
        assert!((young / 6e4 - 1.0).abs() < 0.02, "{young}");
        assert!(told["young"]["low"].as_f64().unwrap() < young);
        assert!(told["young"]["turn"].as_f64().unwrap() > 0.2);
    }
    // The same posture twice, not turned, is no leaf that moves.
    let told = place
        .run("unbend leaf.toml --shape as-hung.csv --second as-hung.csv:0 --json --write none");
    let told = told.ends(0).json();
    assert!(told["young"].is_null(), "{told}");
}

/// The equilibrium nearest to a posture, and its index; none where there is no equilibrium nearby.
#[test]
fn a_leaf_begins_from_a_shape() {
    let place = place();
    let told = place
        .run("unbend leaf.toml --shape points.csv --json --write none")
        .ok()
        .json();
    let young = least(&told);
    for (factor, index) in [(1.1, 0), (0.9, 1)] {
        let run = format!(
            "unbend leaf.toml --shape points.csv --young {} --out out",
            factor * young
        );
        place.run(run);
        let run = "relax out/rest.toml --start out/rest.csv --keep-unstable --json --write none";
        let leaf = place.run(run).ends(0).json();
        assert_eq!(leaf["negative_eigenvalues"], index, "{factor}");
        let table = place.read("out/rest.csv");
        let tip: Vec<f64> = table
            .lines()
            .last()
            .unwrap()
            .split(',')
            .map(|cell| cell.parse().unwrap())
            .collect();
        for (axis, at) in [(0, 2), (1, 3), (2, 4)] {
            let off = leaf["tip"][axis].as_f64().unwrap() - tip[at];
            assert!(off.abs() < 0.01, "{off}");
        }
    }
    let refused = |run: &str, part: &str| {
        let run = place.run(format!("relax {run} --write none")).ends(2);
        assert!(
            run.err.contains("--start") && run.err.contains(part),
            "{}",
            run.err
        );
    };
    // Straight up is far from where the leaf hangs.
    let upright: Vec<String> = (0..20)
        .map(|k| format!("0,{}", 24.0 * f64::from(k) / 19.0))
        .collect();
    place.write("upright.csv", format!("x,z\n{}\n", upright.join("\n")));
    refused("leaf.toml --start upright.csv", "no equilibrium is near");
    place.write(
        "short.csv",
        rewritten("x,z", |_, x, z| format!("{},{}", 0.1 * x, 0.1 * z)),
    );
    refused("leaf.toml --start short.csv", "unit of the scenario");
    place.write(
        "away.csv",
        rewritten("x,z", |_, x, z| format!("{},{z}", x + 9.0)),
    );
    refused("leaf.toml --start away.csv", "leaf.base");
    refused(
        "leaf.toml --start points.csv --set leaf.rods=3 --set leaf.fan=\"symmetric\"",
        "leaf.rods = 1",
    );
}
