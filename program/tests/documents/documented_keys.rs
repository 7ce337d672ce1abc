//! The page on formats lists every key of a scenario, once, and none that there is not.

use leafdyn::scenario::Key;
use leafdyn_testing::root;
use std::fs;

/// Paths of the keys in the lists under the names of their tables.
fn documented(page: &str) -> Vec<String> {
    let (_, section) = page.split_once("\n## The scenario\n").unwrap();
    let (section, _) = section.split_once("\n### ").unwrap();
    let (mut table, mut paths) = (String::new(), Vec::new());
    for line in section.lines() {
        if let Some(name) = line.strip_prefix("**`[") {
            let name = name.split(']').next().unwrap().trim_start_matches('[');
            table = format!("{name}.");
        }
        let entry = line.strip_prefix("- ").and_then(|it| it.split_once(" ("));
        let names = entry.map_or("", |(names, _)| names);
        let names = names.split('`').skip(1).step_by(2);
        paths.extend(names.map(|name| format!("{table}{name}")));
    }
    paths.sort();
    paths
}

#[test]
fn every_key_stands_once_on_the_page_of_formats() {
    let page = fs::read_to_string(root().join("docs/formats.md")).unwrap();
    let mut keys: Vec<String> = Key::all().map(|key| key.path().to_owned()).collect();
    keys.sort();
    assert_eq!(documented(&page), keys);
}
