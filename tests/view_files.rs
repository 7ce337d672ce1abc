//! Files that show a leaf in space: written where they are asked for, whole, and
//! each with what belongs to it.

use std::fs;
use std::path::Path;
use std::process::Command;

use assert_cmd::cargo::cargo_bin;
use tempfile::TempDir;

fn run(folder: &Path, arguments: &str) {
    let mut command = Command::new(cargo_bin!("leafdyn"));
    let done = command
        .current_dir(folder)
        .args(arguments.split(' '))
        .output();
    let done = done.unwrap();
    let said = String::from_utf8_lossy(&done.stderr);
    assert!(done.status.success(), "{arguments}: {said}");
}

fn names(folder: &Path) -> Vec<String> {
    let entries = fs::read_dir(folder).unwrap();
    let name = |entry: std::io::Result<fs::DirEntry>| entry.unwrap().file_name();
    let mut names: Vec<String> = entries
        .map(|entry| name(entry).to_string_lossy().into_owned())
        .collect();
    names.sort();
    names
}

/// The document of a binary glTF, whose chunks fill the file.
fn document(path: &Path) -> serde_json::Value {
    let bytes = fs::read(path).unwrap();
    let word = |at: usize| u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap()) as usize;
    assert_eq!(
        (&bytes[..4], word(4), word(8)),
        (&b"glTF"[..], 2, bytes.len())
    );
    let text = 20 + word(12);
    assert_eq!(text + 8 + word(text), bytes.len());
    serde_json::from_slice(&bytes[20..text]).unwrap()
}

#[test]
fn a_leaf_at_rest() {
    let place = TempDir::new().unwrap();
    let place = place.path();
    run(place, "new leaf");
    run(place, "relax leaf.toml --write html,vtk,glb");
    let out = place.join("out/leaf");
    assert_eq!(names(&out), ["leaf.glb", "leaf.vtp", "view.html"]);
    let page = fs::read_to_string(out.join("view.html")).unwrap();
    assert!(page.starts_with("<!DOCTYPE html>") && page.ends_with("</html>\n"));
    assert!(page.contains("\"units\": [\"cm\",\"N\"]"));
    let tubes = document(&out.join("leaf.glb"));
    assert!(tubes.get("animations").is_none());
    let lines = fs::read_to_string(out.join("leaf.vtp")).unwrap();
    assert!(lines.contains("NumberOfLines=\"9\""));
}

#[test]
fn a_motion_and_what_it_lists() {
    let place = TempDir::new().unwrap();
    let place = place.path();
    run(place, "new motion");
    let short = "--set dynamics.duration=1 --segments 8";
    run(
        place,
        &format!("simulate motion.toml {short} --write vtk,glb,gif,html"),
    );
    let out = place.join("out/motion");
    let wanted = [
        "motion.gif",
        "motion.glb",
        "motion.html",
        "motion.pvd",
        "motion_vtp",
    ];
    assert_eq!(names(&out), wanted);
    let list = fs::read_to_string(out.join("motion.pvd")).unwrap();
    let listed: Vec<&str> = (list.split("file=\"").skip(1))
        .map(|rest| rest.split('"').next().unwrap())
        .collect();
    assert_eq!(listed.len(), 21);
    assert!(listed.iter().all(|file| out.join(file).is_file()));
    let film = fs::read(out.join("motion.gif")).unwrap();
    assert!(film.starts_with(b"GIF89a") && film.ends_with(b";"));
    let tubes = document(&out.join("motion.glb"));
    let targets = &tubes["meshes"][0]["primitives"][0]["targets"];
    assert_eq!(targets.as_array().unwrap().len(), 20);
}

#[test]
fn nothing_of_it_unasked() {
    let place = TempDir::new().unwrap();
    let place = place.path();
    run(place, "new motion");
    run(place, "simulate motion.toml --set dynamics.duration=0.2");
    run(place, "relax motion.toml");
    for name in names(&place.join("out/motion")) {
        let end = name.rsplit('.').next().unwrap();
        assert!(["json", "csv", "svg", "png"].contains(&end), "{name}");
    }
}
