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
