//! Reads a scenario from a file or from text.

use std::fs::File;
use std::io::{ErrorKind, Read};
use std::path::Path;

use super::Scenario;
use super::entries::Entries;
use super::error::ScenarioError;
use super::excerpt::line_of;
use crate::memory;

/// Most bytes of a file; 100,000 rods with every quantity listed need fewer.
pub const MOST_BYTES: u64 = 64 << 20;

impl Scenario {
    /// Reads and checks the TOML in `text`, or the JSON of a [`Scenario`] or of a
    /// result with its `input`.
    ///
    /// ```
    /// let scenario = leafdyn::scenario::Scenario::from_toml(
    ///     r#"
    ///     name = "cantilever"
    ///     leaf = { rods = 1, length = 1.0, fan = [0.0] }
    ///     stiffness = { torsion = 1.0, bending_2 = 1.0, bending_3 = 1.0, axial = inf, shear_2 = inf, shear_3 = inf }
    ///     load = { tip_force = [0.0, 0.0, -1.0] }
    ///     "#,
    /// )?;
    /// assert_eq!(scenario.rods.len(), 1);
    /// # Ok::<(), leafdyn::scenario::ScenarioError>(())
    /// ```
    pub fn from_toml(text: &str) -> Result<Scenario, ScenarioError> {
        Scenario::from_toml_with(text, "scenario", &[])
    }

    /// As [`Scenario::from_toml`], with the entries `overrides` replaced
    /// (`KEY=VALUE`, such as `load.gravity=[0,0,-0.5]`; the value is TOML, anything
    /// else is taken as text), or parts of them: one entry of a list
    /// (`load.gravity[2]=-1`, `stiffness.bending_2.value[0]=2`), or every number of
    /// a key multiplied (`scale:load.gravity=2`). Messages call the text `file`.
    pub fn from_toml_with(
        text: &str,
        file: &str,
        overrides: &[String],
    ) -> Result<Scenario, ScenarioError> {
        let entries = Entries::of_text(text, file)?;
        entries.replaced(overrides)?.check()
    }

    /// Reads and checks the file at `path`.
    pub fn read(path: impl AsRef<Path>) -> Result<Scenario, ScenarioError> {
        Scenario::read_with(path.as_ref(), &[])
    }

    /// As [`Scenario::read`], with the entries `overrides` replaced.
    pub fn read_with(path: &Path, overrides: &[String]) -> Result<Scenario, ScenarioError> {
        Scenario::from_toml_with(&text(path)?, &path.display().to_string(), overrides)
    }
}

/// Reads the text of a scenario's file.
///
/// # Errors
/// If it cannot be read, or is not text.
pub fn text(path: &Path) -> Result<String, ScenarioError> {
    utf8(bytes(path)?, &path.display().to_string())
}

/// Reads a file, of at most one byte more than [`MOST_BYTES`].
///
/// # Errors
/// If it cannot be read.
pub fn bytes(path: &Path) -> Result<Vec<u8>, ScenarioError> {
    let file = path.display().to_string();
    let mut bytes = Vec::new();
    // Opening a folder succeeds on some systems, and reading it fails.
    File::open(path)
        .and_then(|file| file.take(MOST_BYTES + 1).read_to_end(&mut bytes))
        .map_err(|reason| match reason.kind() {
            ErrorKind::IsADirectory => {
                ScenarioError::in_file(&file, None, "is a folder: give the file itself".into())
            }
            _ => {
                let problem = format!("cannot be read: {reason}: check its path and permissions");
                ScenarioError::in_file(&file, None, problem)
            }
        })?;
    Ok(bytes)
}

/// Decodes the text of a scenario's `file` from its first bytes.
pub fn utf8(bytes: Vec<u8>, file: &str) -> Result<String, ScenarioError> {
    if bytes.len() as u64 > MOST_BYTES {
        let problem = format!("is larger than {MOST_BYTES} bytes: this is no scenario");
        return Err(ScenarioError::in_file(file, None, problem));
    }
    memory::text(&bytes).map_err(|why| ScenarioError::in_file(file, None, why.to_string()))?;
    String::from_utf8(bytes).map_err(|error| {
        let offset = error.utf8_error().valid_up_to();
        let bytes = error.as_bytes();
        let byte = bytes[offset];
        let problem =
            format!("is not text in UTF-8: byte {offset} is 0x{byte:02x}: save the file as UTF-8");
        ScenarioError::in_file(file, Some(line_of(bytes, offset)), problem)
    })
}
