//! The scenario whose results a folder holds: the JSON files in it name its file; and files that
//! results must not replace.

use crate::files::result_files::WrittenResult;
use crate::report::FileError;
use leafdyn::relax::Equilibrium;
use leafdyn::simulate::Record;
use leafdyn::study::{Chart, Check, Equilibria, Fit, Map, StabilityBoundary, Trace};
use std::ffi::OsStr;
use std::fs;
use std::fs::File;
use std::io::{BufRead, BufReader, Read};
use std::path::{Component, Path, PathBuf, absolute};

/// The JSON files of all verbs.
const RESULT_FILES: [Option<&str>; 9] = [
    Equilibrium::JSON,
    Equilibria::JSON,
    Check::JSON,
    Record::JSON,
    Trace::JSON,
    StabilityBoundary::JSON,
    Map::JSON,
    Chart::JSON,
    Fit::JSON,
];

/// Most scenarios that a message names.
const MOST_SCENARIOS_NAMED: usize = 3;

/// How a result in `folder` names the file of its scenario: by the relative path, so
/// that both can be moved together.
pub fn relative_source_path(folder: &Path, file: &Path) -> String {
    let [Ok(folder), Ok(file)] =
        [folder, file].map(|path| absolute(path).map(resolve_parent_components))
    else {
        return file.display().to_string();
    };
    let [from, to] = [&folder, &file].map(|path| path.components().collect::<Vec<_>>());
    let shared = from.iter().zip(&to).take_while(|(a, b)| a == b).count();
    let up = from[shared..].iter().map(|_| OsStr::new(".."));
    let relative: PathBuf = up
        .chain(to[shared..].iter().map(|c| c.as_os_str()))
        .collect();
    relative.display().to_string()
}

/// Resolves `..` in a path by its text alone.
fn resolve_parent_components(path: PathBuf) -> PathBuf {
    let mut plain = PathBuf::new();
    for component in path.components() {
        match component {
            Component::ParentDir => _ = plain.pop(),
            other => plain.push(other),
        }
    }
    plain
}

/// Refuses a folder that holds results of another scenario than that of `source`, or files of the
/// same names that are no results.
pub fn check_source(folder: &Path, source: &str) -> Result<(), FileError> {
    let refuse = |file: &Path, why: &str| {
        let change = "name a folder with --out DIR, or give this scenario another name";
        Err(FileError::mismatched_file(
            file,
            &format!("{why}: {change}"),
        ))
    };
    for name in RESULT_FILES.into_iter().flatten() {
        let file = folder.join(name);
        if !file.exists() {
            continue;
        }
        match source_named_in_file(&file).as_deref() {
            None => return refuse(&file, "does not say of which scenario it is"),
            Some(other) if other == source => (),
            Some(other) => return refuse(&file, &other_scenario_message(folder, other)),
        }
    }
    Ok(())
}

/// Refuses to replace files of these names in a folder if one of them is an input of the same
/// request.
pub fn check_inputs<'p>(
    folder: &Path,
    names: &[&str],
    inputs: impl IntoIterator<Item = &'p PathBuf>,
) -> Result<(), FileError> {
    for input in inputs {
        let Ok(input) = input.canonicalize() else {
            // It does not exist, or is standard input.
            continue;
        };
        let files = names.iter().map(|name| folder.join(name));
        let same = |file: &PathBuf| file.canonicalize().is_ok_and(|file| file == input);
        if let Some(file) = files.into_iter().find(same) {
            let why = "is read by this request, and its results would replace it: \
                       name another folder with --out DIR";
            return Err(FileError::mismatched_file(&file, why));
        }
    }
    Ok(())
}

/// Refuses to replace a table that has results of other scenarios than these, or is no table of
/// results.
pub fn check_table(file: &Path, scenarios: &[PathBuf]) -> Result<(), FileError> {
    let Ok(bytes) = fs::read(file) else {
        return Ok(());
    };
    let plain = |path: &Path| {
        let plain = path.canonicalize().or_else(|_| absolute(path));
        plain.map_or_else(|_| path.into(), resolve_parent_components)
    };
    let ours: Vec<PathBuf> = scenarios.iter().map(|path| plain(path)).collect();
    let Some(mut others) = scenarios_in(&bytes) else {
        let why = "is no table of results: name a folder with --out DIR, or remove it";
        return Err(FileError::mismatched_file(file, why));
    };
    others.retain(|other| !ours.contains(&plain(Path::new(other))));
    if others.is_empty() {
        return Ok(());
    }
    let more = others.len().saturating_sub(MOST_SCENARIOS_NAMED);
    others.truncate(MOST_SCENARIOS_NAMED);
    let mut names = others.join(", ");
    if more > 0 {
        names += &format!(" and {more} more");
    }
    let why = format!(
        "has results of {names}, which are not among these scenarios: name a folder with --out DIR, \
         or remove the table"
    );
    Err(FileError::mismatched_file(file, &why))
}

/// The files of the scenarios whose results a table has; `None` if it is no such table.
fn scenarios_in(table: &[u8]) -> Option<Vec<String>> {
    let mut table = csv::Reader::from_reader(table);
    let header = table.headers().ok()?.clone();
    let column = |name: &str| header.iter().position(|it| it == name);
    let (file, name) = (column("file")?, column("scenario"));
    column("exit_status")?;
    let mut found = Vec::new();
    for row in table.records() {
        let row = row.ok()?;
        // Where a scenario was refused there is no result.
        let has_result = name.is_some_and(|name| !row[name].is_empty());
        if has_result {
            found.push(row[file].to_string());
        }
    }
    Some(found)
}

fn other_scenario_message(folder: &Path, source: &str) -> String {
    if source == "-" {
        return "is of another scenario, from standard input".into();
    }
    let other = folder.join(source);
    let other = resolve_parent_components(absolute(&other).unwrap_or(other));
    format!("is of another scenario, in {}", other.display())
}

/// The source that a JSON file names, if any.
fn source_named_in_file(file: &Path) -> Option<String> {
    // It is among the first lines; later ones can be very long.
    let lines = BufReader::new(File::open(file).ok()?.take(1 << 12)).lines();
    let mut lines = lines.map_while(Result::ok);
    let line = lines.find_map(|line| Some(line.strip_prefix("  \"source\": ")?.to_string()))?;
    serde_json::from_str(line.trim_end_matches(',')).ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sources_are_relative_to_the_folder() {
        for (folder, file, relative) in [
            ("/a/out/b", "/a/b.toml", "../../b.toml"),
            ("/a/out", "/a/out/c/d.json", "c/d.json"),
            ("/a/x/../out", "/a/./b.toml", "../b.toml"),
            ("/", "/b.toml", "b.toml"),
            ("out", "s/a.toml", "../s/a.toml"),
        ] {
            assert_eq!(
                relative_source_path(Path::new(folder), Path::new(file)),
                relative
            );
        }
    }
}
