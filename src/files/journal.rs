//! The rows of a map on the way: what is finished is on the disk, and a later
//! run goes on from there.

use std::fs::{self, File, OpenOptions};
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use serde_json::Value;

use crate::files::atomic;
use crate::report::{Format, Json, MapFileError, OutputError, lines, table};
use crate::study::{Map, MapRequest, MapRow};

/// What says which map the rows beside it are of.
const JSON: &str = "map.json";

/// Whether a folder can be this map's: `map.json` there says which map it has,
/// and another one's is refused. `false`: it has none yet.
///
/// # Errors
/// If the folder has another map.
pub fn belongs(folder: &Path, request: &MapRequest) -> Result<bool, MapFileError> {
    let file = folder.join(JSON);
    match fs::read(&file) {
        Ok(bytes) => {
            let there: Value = serde_json::from_slice(&bytes).unwrap_or_default();
            let ours = serde_json::to_value(request).unwrap_or_default();
            match difference(&there["request"], &ours) {
                None => Ok(true),
                Some(what) => Err(MapFileError::OtherMap { file, what }),
            }
        }
        Err(error) if error.kind() == io::ErrorKind::NotFound => {
            let rows = folder.join("map.csv");
            match rows.exists() {
                true => Err(MapFileError::OtherMap {
                    file: rows,
                    what: "request, without map.json,".into(),
                }),
                false => Ok(false),
            }
        }
        Err(reason) => Err(MapFileError::Unreadable { file, reason }),
    }
}

/// Claims a folder for this map before there are rows in it. Jobs that share a
/// map write the same.
///
/// # Errors
/// If the folder has another map, or cannot be written to.
pub fn claim(folder: &Path, map: &Map) -> Result<(), MapFileError> {
    if belongs(folder, &map.request)? {
        return Ok(());
    }
    let file = folder.join(JSON);
    atomic::make_folder(folder)?;
    atomic::write_file(&file, |out| Json(JSON).write(map, out))
        .map_err(|reason| OutputError::File { file, reason }.into())
}

/// The first key whose values are not the same.
fn difference(there: &Value, ours: &Value) -> Option<String> {
    if there == ours {
        return None;
    }
    let keys = ours
        .as_object()
        .into_iter()
        .flat_map(|object| object.keys());
    let other = keys.into_iter().find(|key| there[*key] != ours[*key]);
    Some(other.map_or("request", |key| key.as_str()).to_string())
}

/// A file to which rows are added.
pub struct Journal {
    path: PathBuf,
    file: File,
}

impl Journal {
    /// Begins or goes on: the file is written whole with what is known, and
    /// open for more.
    ///
    /// # Errors
    /// If it cannot be written.
    pub fn open(
        folder: &Path,
        name: &str,
        request: &MapRequest,
        known: &[MapRow],
    ) -> Result<Self, OutputError> {
        write_rows(folder, name, request, known)?;
        let path = folder.join(name);
        match OpenOptions::new().append(true).open(&path) {
            Ok(file) => Ok(Journal { path, file }),
            Err(reason) => Err(OutputError::File { file: path, reason }),
        }
    }

    /// Adds rows, in one piece.
    ///
    /// # Errors
    /// If they cannot be written.
    pub fn append(&mut self, request: &MapRequest, rows: &[MapRow]) -> Result<(), OutputError> {
        let written = lines(request, rows).and_then(|bytes| self.file.write_all(&bytes));
        written.map_err(|reason| OutputError::File {
            file: self.path.clone(),
            reason,
        })
    }
}

/// Writes a file of rows whole.
///
/// # Errors
/// If it cannot be written.
pub fn write_rows(
    folder: &Path,
    name: &str,
    request: &MapRequest,
    rows: &[MapRow],
) -> Result<(), OutputError> {
    atomic::make_folder(folder)?;
    let file = folder.join(name);
    atomic::write_file(&file, |out| out.write_all(&table(request, rows)?))
        .map_err(|reason| OutputError::File { file, reason })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::{read_rows, sample};

    #[test]
    fn rows_are_added_to_what_is_known() {
        let map = sample::map();
        let folder = tempfile::tempdir().unwrap();
        let (known, new) = map.rows.split_at(4);
        let mut journal = Journal::open(folder.path(), "map.csv", &map.request, known).unwrap();
        let file = folder.path().join("map.csv");
        assert_eq!(read_rows(&file, &map.request).unwrap(), known);
        journal.append(&map.request, new).unwrap();
        assert_eq!(read_rows(&file, &map.request).unwrap(), map.rows);
    }

    #[test]
    fn more_methods_are_more_rows_of_the_same_map() {
        let map = sample::map();
        let folder = tempfile::tempdir().unwrap();
        claim(folder.path(), &map).unwrap();
        let mut other = map.clone();
        other.request.methods.pop();
        claim(folder.path(), &other).unwrap();
        other.request.axes.pop();
        let refused = claim(folder.path(), &other).unwrap_err().to_string();
        assert!(refused.contains("vary"), "{refused}");
    }

    #[test]
    fn rows_whose_map_is_not_told_are_left_alone() {
        let folder = tempfile::tempdir().unwrap();
        fs::write(folder.path().join("map.csv"), "mine").unwrap();
        let refused = claim(folder.path(), &sample::map()).unwrap_err();
        assert!(refused.to_string().contains("without map.json"));
    }
}
