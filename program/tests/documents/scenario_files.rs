//! The scenarios that come with the program, and files that are none.

use std::fs;
use std::path::Path;

use leafdyn_testing::workplace::{Json, Workplace};
use leafdyn_testing::*;

#[test]
fn every_file_is_accepted_named_after_itself_and_explained() {
    let folders = fs::read_dir(path("").parent().unwrap()).unwrap();
    let folders = folders.filter(|entry| entry.as_ref().unwrap().path().is_dir());
    assert_eq!(folders.count(), 6, "all folders are known");
    for path in scenario_files() {
        assert_eq!(path.extension().unwrap(), "toml", "{}", path.display());
        let name = path.file_stem().unwrap().to_str().unwrap();
        assert_eq!(read(&path, "").name, name);
        let text = fs::read_to_string(&path).unwrap();
        let header = text.lines().take_while(|line| line.starts_with('#'));
        assert!(header.count() >= 3, "{name}: no header comment");
    }
}

/// Editors complete and check them by it.
#[test]
fn every_file_names_the_schema_which_is_todays() {
    let folder = root().join("scenarios");
    let kept = fs::read_to_string(folder.join("scenario.schema.json")).unwrap();
    let kept: serde_json::Value = serde_json::from_str(&kept).unwrap();
    let why = "leafdyn schema > scenarios/scenario.schema.json";
    assert_eq!(kept, leafdyn::scenario::schema(), "{why}");
    for path in scenario_files() {
        let text = fs::read_to_string(&path).unwrap();
        let (first, _) = text.split_once('\n').unwrap();
        let schema = first.strip_prefix("#:schema ").unwrap();
        let schema = path.parent().unwrap().join(schema).canonicalize();
        let wanted = folder.join("scenario.schema.json").canonicalize();
        assert_eq!(schema.unwrap(), wanted.unwrap(), "{}", path.display());
    }
}

/// The table of times on the page on speed has a row for each of them, and tells what takes long.
#[test]
fn every_file_has_a_row_of_times() {
    let page = fs::read_to_string(root().join("docs/speed.md")).unwrap();
    let (_, table) = page.split_once("<!-- verbs: benches/verbs.py -->").unwrap();
    let (table, _) = table.split_once("<!-- end of verbs -->").unwrap();
    let rows = table
        .lines()
        .filter(|line| line.starts_with("| `") && line.contains('/'));
    let rows: Vec<&str> = rows.filter(|row| !row.starts_with("| scenario")).collect();
    let named: Vec<String> = (scenario_files().iter())
        .map(|file| {
            let folder = file.parent().unwrap().file_name().unwrap().display();
            format!("| `{folder}/{}` |", file.file_stem().unwrap().display())
        })
        .collect();
    for name in &named {
        let row = rows.iter().find(|row| row.starts_with(name));
        let row = row.unwrap_or_else(|| panic!("{name}: benches/verbs.py BINARY {name}"));
        let relaxed = row.split('|').nth(2).unwrap().trim().trim_matches('*');
        assert!(relaxed == "–" || relaxed.parse::<f64>().is_ok(), "{row}");
        if row.contains("**") {
            let name = name.trim_matches(['|', ' ']);
            assert!(table.contains(&format!("of {name}")), "{name} is not told");
        }
    }
    assert_eq!(rows.len(), named.len(), "rows of scenarios that are gone");
}

/// In short time, and stable where stability can be told.
#[test]
fn every_scenario_file_ends_at_rest_within_its_tolerance() {
    let place = Workplace::new();
    let mut files = scenario_files();
    files.retain(|file| !file.parent().unwrap().ends_with("motion"));
    assert!(files.len() >= 34);
    for file in files {
        let name = file.file_stem().unwrap().to_str().unwrap();
        let folder = file.parent().unwrap().file_name().unwrap().display();
        let run = place.run(format!("relax scenarios/{folder}/{name}.toml --json"));
        let run = run.ends(0);
        let summary = run.json();
        let outcome = summary["outcome"].text();
        assert!(outcome.starts_with("converged"), "{name}: {outcome}");
        // Under a dead moment small motions tell stability, and that is said: a ring flutters without damping.
        let moment = matches!(name, "rollup" | "helical_rollup");
        assert_eq!(summary["stable"], name != "rollup", "{name}");
        assert_eq!(run.err.is_empty(), !moment, "{name}: {}", run.err);

        let number = |key: &str| summary[key].number();
        let longest = largest(read(&file, "").rods.iter().map(|rod| rod.length));
        let allowed = number("tolerance") * longest;
        assert!(number("error_estimate") <= allowed, "{name}");
        assert!(number("residual") < 1e-5, "{name}: {}", number("residual"));
        let work = &summary["work"];
        // Slow loading of the softest leaf snaps several times.
        assert!(work["force_evaluations"].count() < 4000, "{name}: {work}");
        for file in "summary.json centerlines.csv figure.svg figure.png".split(' ') {
            let file = place.path("out").join(name).join(file);
            assert!(fs::metadata(&file).unwrap().len() > 500, "{file:?}");
        }
    }
}

#[test]
fn the_papers_figures_share_what_the_paper_says_of_all() {
    let paper = files("paper");
    assert_eq!(paper.len(), 9);
    for path in paper {
        let scenario = read(&path, "");
        let rods = if scenario.name == "fig06" { 15 } else { 21 };
        assert_eq!(scenario.rods.len(), rods);
        assert!(scenario.joined);
        // Fig. 7's leaves are not coupled.
        let gap = f64::from(!scenario.name.starts_with("fig07"));
        assert_eq!(scenario.coupling, vec![[0.0, gap, gap]; rods - 1]);
        let third = PI / 3.0;
        let step = 2.0 * third / rods as f64;
        let [first, last] = [0, rods - 1].map(|j| scenario.rods[j].angle);
        assert!((first - (step - third)).abs() < 1e-15);
        assert!((last - third).abs() < 1e-15);
    }
}

/// Every `--set ...` that a header comment offers is accepted.
#[test]
fn what_the_comments_offer_works() {
    let mut offered = 0;
    for path in scenario_files() {
        let text = fs::read_to_string(&path).unwrap();
        for line in text.lines().filter(|line| line.starts_with('#')) {
            for given in line.split("--set ").skip(1) {
                let given = given.split_whitespace().next().unwrap();
                let given = given.trim_end_matches([':', ',', '.', ';', ')']);
                let leaf = Scenario::read_with(&path, &[given.to_string()]);
                leaf.unwrap_or_else(|error| panic!("{}: {error}", path.display()));
                offered += 1;
            }
        }
    }
    assert!(offered >= 15, "found {offered}");
}

#[test]
fn files_that_cannot_be_read() {
    let folder = tempfile::tempdir().unwrap();
    let message = |path: &Path| {
        let message = Scenario::read(path).unwrap_err().to_string();
        let rest = message.strip_prefix(path.to_str().unwrap());
        rest.unwrap_or_else(|| panic!("{message}")).to_string()
    };
    let absent = folder.path().join("absent.toml");
    assert!(message(&absent).starts_with(": cannot be read: "));
    let expected = ": is a folder: give the file itself";
    assert_eq!(message(folder.path()), expected);
    let latin = folder.path().join("latin.toml");
    fs::write(&latin, b"name = \"a\"\n# Bl\xe4tter\n").unwrap();
    let expected = ":2: is not text in UTF-8: byte 15 is 0xe4: save the file as UTF-8";
    assert_eq!(message(&latin), expected);
    let empty = folder.path().join("empty.toml");
    fs::write(&empty, "").unwrap();
    assert!(message(&empty).starts_with(": leaf.rods is missing"));
}

#[test]
fn ten_thousand_rods_are_read() {
    let rods = 10_000;
    let list = |count: usize| vec!["1.25"; count].join(", ");
    let text = format!(
        "name = \"many\"\n[leaf]\nrods = {rods}\nlength = [{0}]\nfan = \"symmetric\"\n[stiffness]\ntorsion = [{0}]\n\
         bending_2 = [{0}]\nbending_3 = 1.0\naxial = [{0}]\nshear_2 = inf\nshear_3 = inf\n[coupling]\nx = [{1}]\n",
        list(rods),
        list(rods - 1)
    );
    assert_eq!(Scenario::from_toml(&text).unwrap().rods.len(), rods);
}
