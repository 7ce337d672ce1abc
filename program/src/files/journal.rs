//! The rows of a map while it is computed: finished rows are on disk, and a later
//! run continues from there.

use std::fs::{self, File, OpenOptions};
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use serde_json::Value;

use crate::files::{atomic, write_named};
use crate::report::{Document, FileError, json, lines, table};
use leafdyn::study::{Map, MapRequest, MapRow};

/// The file that identifies the map of the rows in its folder.
const JSON: &str = "map.json";

/// Whether `map.json` in a folder is of this map; `false` if the folder has no map yet.
///
/// # Errors
/// If the folder has another map.
pub fn belongs(folder: &Path, request: &MapRequest) -> Result<bool, FileError> {
    let file = folder.join(JSON);
    let other = |file: &Path, what: &str| {
        let change = "name another folder with --out DIR, or remove the map there";
        let why = format!("is of another map: its {what} is not the same; {change}");
        Err(FileError::unfit(file, &why))
    };
    match fs::read(&file) {
        Ok(bytes) => {
            let theirs: Value = serde_json::from_slice(&bytes).unwrap_or_default();
            let ours = serde_json::to_value(request).unwrap_or_default();
            match difference(&theirs["request"], &ours) {
                None => Ok(true),
                Some(what) => other(&file, &what),
            }
        }
        Err(error) if error.kind() == io::ErrorKind::NotFound => {
            let rows = folder.join("map.csv");
            match rows.exists() {
                true => other(&rows, "request, without map.json,"),
                false => Ok(false),
            }
        }
        Err(reason) => Err(FileError::read(&file, reason)),
    }
}

/// Claims a folder for this map before there are rows in it. Jobs that share a map write
/// the same claim.
///
/// # Errors
/// If the folder has another map, or cannot be written to.
pub fn claim(folder: &Path, map: &Document<Map>) -> Result<(), FileError> {
    if belongs(folder, &map.result.request)? {
        return Ok(());
    }
    atomic::make_folder(folder)?;
    write_named(folder, JSON, |out| json::write(map, out)).map(drop)
}

/// The first key whose values differ.
fn difference(theirs: &Value, ours: &Value) -> Option<String> {
    if theirs == ours {
        return None;
    }
    let mut keys = ours.as_object().into_iter().flat_map(|it| it.keys());
    let other = keys.find(|key| theirs[*key] != ours[*key]);
    Some(other.map_or("request", |key| key.as_str()).to_string())
}

/// A file to which rows are added.
pub struct Journal {
    path: PathBuf,
    file: File,
}

impl Journal {
    /// Begins or continues a file: writes it with the known rows and opens it for more.
    pub fn open(
        folder: &Path,
        name: &str,
        request: &MapRequest,
        known: &[MapRow],
    ) -> Result<Self, FileError> {
        let path = write_rows(folder, name, request, known)?;
        let file = OpenOptions::new().append(true).open(&path);
        let file = file.map_err(|reason| FileError::write(&path, reason))?;
        Ok(Journal { path, file })
    }

    /// Appends rows with a single write.
    pub fn append(&mut self, request: &MapRequest, rows: &[MapRow]) -> Result<(), FileError> {
        let mut bytes = Vec::new();
        let written = lines(request, rows, &mut bytes);
        let written = written.and_then(|()| self.file.write_all(&bytes));
        written.map_err(|reason| FileError::write(&self.path, reason))
    }
}

/// Writes a complete file of rows.
pub fn write_rows(
    folder: &Path,
    name: &str,
    request: &MapRequest,
    rows: &[MapRow],
) -> Result<PathBuf, FileError> {
    atomic::make_folder(folder)?;
    write_named(folder, name, |out| table(request, rows, out))
}
