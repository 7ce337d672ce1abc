//! The scenarios that come with the program.

use std::fs;
use std::path::{Path, PathBuf};

use leafdyn::scenario::Scenario;

/// Every scenario file in the folders of `scenarios/`.
fn files() -> Vec<PathBuf> {
    let top = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenarios");
    let list = |folder: &Path| -> Vec<PathBuf> {
        fs::read_dir(folder)
            .unwrap()
            .map(|entry| entry.unwrap().path())
            .collect()
    };
    let mut files: Vec<_> = list(&top)
        .iter()
        .filter(|path| path.is_dir())
        .flat_map(|folder| list(folder))
        .collect();
    files.sort();
    files
}

fn read(path: &Path) -> Scenario {
    Scenario::read(path, &[]).unwrap_or_else(|error| panic!("{error}"))
}

#[test]
fn every_file_is_accepted_named_after_itself_and_explained() {
    let files = files();
    assert!(files.len() >= 24, "found {} files", files.len());
    for path in files {
        assert_eq!(path.extension().unwrap(), "toml", "{}", path.display());
        assert_eq!(
            read(&path).name,
            path.file_stem().unwrap().to_str().unwrap()
        );
        let header = fs::read_to_string(&path).unwrap();
        let comments = header
            .lines()
            .take_while(|line| line.starts_with('#'))
            .count();
        assert!(comments >= 3, "{}: no header comment", path.display());
    }
}

#[test]
fn the_papers_figures_share_what_the_paper_says_of_all() {
    let paper: Vec<_> = files()
        .into_iter()
        .filter(|path| path.parent().unwrap().ends_with("paper"))
        .collect();
    assert_eq!(paper.len(), 9);
    for path in paper {
        let scenario = read(&path);
        assert_eq!(
            scenario.rods.len(),
            if scenario.name == "fig06" { 15 } else { 21 }
        );
        assert!(scenario.joined);
        // Fig. 7's leaves are not coupled.
        let gap = if scenario.name.starts_with("fig07") {
            0.0
        } else {
            1.0
        };
        assert!(
            scenario
                .coupling
                .iter()
                .all(|found| *found == [0.0, gap, gap])
        );
        let first_and_last =
            [&scenario.rods[0], scenario.rods.last().unwrap()].map(|rod| rod.angle);
        let third = std::f64::consts::PI / 3.0;
        let step = 2.0 * third / scenario.rods.len() as f64;
        assert!((first_and_last[0] - (step - third)).abs() < 1e-15);
        assert!((first_and_last[1] - third).abs() < 1e-15);
    }
}

/// Every `--set ...` that a header comment offers is accepted.
#[test]
fn what_the_comments_offer_works() {
    let mut offered = 0;
    for path in files() {
        let text = fs::read_to_string(&path).unwrap();
        for line in text.lines().filter(|line| line.starts_with('#')) {
            for given in line.split("--set ").skip(1) {
                let given = given.split_whitespace().next().unwrap();
                let given = given
                    .trim_end_matches([':', ',', '.', ';', ')'])
                    .to_string();
                Scenario::read(&path, &[given])
                    .unwrap_or_else(|error| panic!("{}: {error}", path.display()));
                offered += 1;
            }
        }
    }
    assert!(offered >= 15, "found {offered}");
}
