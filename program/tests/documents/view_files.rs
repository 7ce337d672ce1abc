//! Files that show a leaf in space: written where they are asked for, whole, and
//! each with what belongs to it.

use std::fs;
use std::path::Path;

use leafdyn_testing::workplace::{Json, Workplace, contains};

/// A folder in which a new scenario was written, and what was done with it since.
fn done(example: &str, runs: &[&str]) -> Workplace {
    let place = Workplace::empty();
    place.run(format!("new {example}")).ends(0);
    for run in runs {
        place.run(run).ends(0);
    }
    place
}

/// The document of a binary glTF, whose chunks fill the file.
fn document(path: &Path) -> serde_json::Value {
    let bytes = fs::read(path).unwrap();
    let word = |at: usize| u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap()) as usize;
    assert!(bytes.starts_with(b"glTF"));
    assert_eq!((word(4), word(8)), (2, bytes.len()));
    let text = 20 + word(12);
    assert_eq!(text + 8 + word(text), bytes.len());
    serde_json::from_slice(&bytes[20..text]).unwrap()
}

#[test]
fn a_leaf_at_rest() {
    let place = done("leaf", &["relax leaf.toml --write html,vtk,glb"]);
    place.holds("out/leaf", "leaf.glb leaf.vtp view.html");
    let page = place.read("out/leaf/view.html");
    assert!(page.starts_with("<!DOCTYPE html>") && page.ends_with("</html>\n"));
    contains(&page, &["\"units\": [\"cm\",\"N\",null]"]);
    let tubes = document(&place.path("out/leaf/leaf.glb"));
    assert!(tubes.get("animations").is_none());
    contains(&place.read("out/leaf/leaf.vtp"), &["NumberOfLines=\"9\""]);
}

/// The page shows where the weight pulls, by whatever key it is given, and where the wind blows.
#[test]
fn a_page_knows_the_directions_of_weight_and_wind() {
    let place = Workplace::empty();
    let leaf = r#"
leaf = { rods = 1, length = 1.0, fan = [0.0] }
section = { shape = "circle", diameter = 0.01, young = 1e5, mass_density = 12.0 }
load = { g = [0.0, -9.0, 0.0] }
wind = { velocity = [0.0, 0.0, 2.0], density = 1e-3, drag = 1.0, width = 0.01 }
"#;
    fs::write(place.path("leaf.toml"), leaf).unwrap();
    place
        .run("relax leaf.toml --path release --write html")
        .ends(0);
    let page = place.read("out/leaf/view.html");
    let directions = [
        r#"{"name": "gravity", "direction": [0.0,-1.0,0.0]}"#,
        r#"{"name": "wind", "direction": [0.0,0.0,1.0]}"#,
    ];
    contains(&page, &directions);
}

/// A leaf whose bases are apart, with loads on its veins and tips and a grip.
const LOADED: &str = r#"
leaf = { rods = 2, length = 1.0, fan = "symmetric", joined = false, base = [[0.0, -0.1, 0.0], [0.0, 0.1, 0.0]] }
stiffness = { torsion = 1.0, bending_2 = 1.0, bending_3 = 1.0, axial = 100.0, shear_2 = 100.0, shear_3 = 100.0 }
grip = [{ vein = 2, at = [0.25, 0.5], held = "clamped" }]
[load]
tip_force = [0.0, 0.0, -0.5]
g = [0.0, 0.0, -1.0]
distributed = [0.0, 0.1, 0.0]
point = [{ vein = 1, at = 0.5, force = [0.0, 0.2, 0.0], mass = 0.2 }]
[dynamics]
density = 0.1
duration = 0.02
tip_force = { at = [0.0, 0.02], value = [[0.0, 0.0, 0.0], [0.0, 0.3, 0.0]] }
"#;

/// The data of a page.
fn data(page: &str) -> serde_json::Value {
    let mark = "<script id=\"data\" type=\"application/json\">";
    let (_, data) = page.split_once(mark).unwrap();
    serde_json::from_str(data.split("</script>").next().unwrap()).unwrap()
}

/// What is told of each mark.
fn words(marks: &serde_json::Value, names: &[&str]) -> Vec<String> {
    let told = |mark: &serde_json::Value| {
        let told: Vec<String> = names.iter().map(|name| mark[name].to_string()).collect();
        told.join(" ").replace('"', "")
    };
    marks.list().iter().map(told).collect()
}

/// Forces, moments and all that is held are marks of a page: those of a motion as they are at its times.
#[test]
fn a_page_knows_what_loads_and_holds_the_leaf() {
    let place = Workplace::empty();
    place.write("leaf.toml", LOADED);
    place.ok("relax leaf.toml --write html");
    let page = data(&place.read("out/leaf/view.html"));
    let held = words(&page["holds"], &["part", "vein", "at", "held"]);
    let clamped = "base 1 [0.0,0.0] clamped, base 2 [0.0,0.0] clamped, grip 2 [0.25,0.5] clamped";
    assert_eq!(held.join(", "), clamped);
    let loads = words(&page["loads"], &["action", "vein", "at"]);
    let along = loads.iter().filter(|it| it.starts_with("distributed"));
    assert_eq!(along.count(), 18);
    let single = "force 1 0.5, force 1 1.0, force 2 1.0";
    assert_eq!(loads[18..].join(", "), single);
    // The weight of the point is part of its force.
    let force = page["loads"].list()[18].clone();
    assert!(
        (force["size"].number() - 0.2 * 2.0_f64.sqrt()).abs() < 1e-12,
        "{force}"
    );
    let largest = page["loads"].list()[19].clone();
    assert_eq!(largest["direction"], serde_json::json!([0.0, 0.0, -1.0]));
    assert!(largest["length"].number() > force["length"].number());

    place.ok("simulate leaf.toml --segments 8 --write html");
    let page = data(&place.read("out/leaf/motion.html"));
    let last = page["leaves"].list().last().unwrap();
    let tip = last["loads"].list().last().unwrap();
    assert_eq!(tip["direction"], serde_json::json!([0.0, 1.0, 0.0]));
    assert!((tip["size"].number() - 0.3).abs() < 1e-9, "{tip}");

    place.ok("trace leaf.toml --vary load.tip_force[2]=-0.5..-0.55 --write html");
    let page = data(&place.read("out/leaf/trace.html"));
    assert!(page["loads"].is_null());

    // A moment, and a tip that is held.
    let one = LOADED
        .replace("rods = 2", "rods = 1")
        .replace(
            "joined = false, base = [[0.0, -0.1, 0.0], [0.0, 0.1, 0.0]]",
            "base_held = \"pinned\"",
        )
        .replace("vein = 2", "vein = 1")
        .replace("mass = 0.2", "moment = [0.3, 0.0, 0.0]")
        + "[tip]\nheld = \"pinned\"\nposition = [0.9, 0.0, 0.0]\n";
    place.write("one.toml", one);
    place.run("relax one.toml --write html");
    let page = data(&place.read("out/one/view.html"));
    let held = words(&page["holds"], &["part", "at", "held"]);
    let pinned = "base [0.0,0.0] pinned, tip [1.0,1.0] pinned, grip [0.25,0.5] clamped";
    assert_eq!(held.join(", "), pinned);
    let moment = words(&page["loads"], &["action", "at", "direction", "size"]);
    assert!(
        moment.contains(&"moment 0.5 [1.0,0.0,0.0] 0.3".into()),
        "{moment:?}"
    );
}

#[test]
fn a_motion_and_what_it_lists() {
    let short =
        "simulate motion.toml --set dynamics.duration=1 --segments 8 --write vtk,glb,gif,html";
    let place = done("motion", &[short]);
    let out = place.path("out/motion");
    let files = "motion.gif motion.glb motion.html motion.pvd motion_vtp";
    place.holds("out/motion", files);
    let list = place.read("out/motion/motion.pvd");
    let listed = list.split("file=\"").skip(1);
    let listed: Vec<&str> = listed.flat_map(|rest| rest.split('"').next()).collect();
    assert_eq!(listed.len(), 21);
    assert!(listed.iter().all(|file| out.join(file).is_file()));
    let film = fs::read(out.join("motion.gif")).unwrap();
    assert!(film.starts_with(b"GIF89a") && film.ends_with(b";"));
    let tubes = document(&out.join("motion.glb"));
    let targets = &tubes["meshes"][0]["primitives"][0]["targets"];
    assert_eq!(targets.list().len(), 20);
}

#[test]
fn nothing_of_it_unasked() {
    let short = "simulate motion.toml --set dynamics.duration=0.2";
    let place = done("motion", &[short, "relax motion.toml"]);
    for name in place.names("out/motion") {
        let end = name.rsplit('.').next().unwrap();
        assert!(["json", "csv", "svg", "png"].contains(&end), "{name}");
    }
}

/// The wind of a gust is on the page of its motion from when it blows: its instants have the directions of their times.
#[test]
fn a_page_of_a_motion_knows_the_wind_at_its_times() {
    let place = Workplace::new();
    let short = "--set dynamics.duration=1 --segments 8 --write html --out out/gust";
    place.ok(format!("simulate scenarios/motion/gust.toml {short}"));
    let page = data(&place.read("out/gust/motion.html"));
    let blows = |leaf: &serde_json::Value| leaf["directions"].to_string().contains("wind");
    let leaves = page["leaves"].list();
    assert!(!page["directions"].to_string().contains("wind"));
    assert!(!blows(&leaves[0]) && leaves.iter().any(blows));
}
