//! The page on the architecture names files and folders that there are.

use leafdyn_testing::root;
use std::fs;

/// Where a path on the page begins.
const ROOMS: [&str; 6] = ["src/", "program/", "python/", "web/", "tests/", "benches/"];

#[test]
fn every_path_on_the_page_exists() {
    let page = fs::read_to_string(root().join("docs/architecture.md")).unwrap();
    let quoted = page.split('`').skip(1).step_by(2);
    let paths: Vec<&str> = quoted
        .filter(|it| ROOMS.iter().any(|room| it.starts_with(room)))
        .collect();
    assert!(paths.len() > 40, "{paths:?}");
    for path in paths {
        assert!(root().join(path).exists(), "{path} is no file or folder");
    }
}

#[test]
fn ten_questions_are_answered_by_files() {
    let page = fs::read_to_string(root().join("docs/architecture.md")).unwrap();
    let (_, section) = page.split_once("\n## Where is ...?\n").unwrap();
    let (section, _) = section.split_once("\n## ").unwrap();
    let answers: Vec<&str> = section
        .lines()
        .filter(|line| line.starts_with("- "))
        .collect();
    assert!(answers.len() >= 10, "{answers:?}");
    for answer in answers {
        assert!(answer.contains(".rs`"), "{answer}");
    }
}
