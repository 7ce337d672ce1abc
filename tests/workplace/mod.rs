//! What the tests of the command line share: a folder to run the program in.
#![allow(dead_code)]

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use tempfile::TempDir;

/// A folder to run in, with a small leaf in `leaf.toml`.
pub struct Workplace {
    folder: TempDir,
}

impl Workplace {
    pub fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        fs::write(folder.path().join("leaf.toml"), leaf("small", 5)).unwrap();
        Workplace { folder }
    }

    pub fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    pub fn command(&self, arguments: &[&str]) -> Command {
        let mut command = Command::new(assert_cmd::cargo::cargo_bin!("leafdyn"));
        command.current_dir(self.folder.path()).args(arguments);
        command
    }

    pub fn run(&self, arguments: &[&str]) -> Output {
        self.command(arguments).output().unwrap()
    }

    /// Names in a folder, sorted; hidden ones too.
    pub fn names(&self, folder: &str) -> Vec<String> {
        let entries = fs::read_dir(self.path(folder)).unwrap();
        let mut names: Vec<String> = entries
            .map(|entry| entry.unwrap().file_name().into_string().unwrap())
            .collect();
        names.sort();
        names
    }
}

/// A leaf of the paper with so many rods.
pub fn leaf(name: &str, rods: usize) -> String {
    format!(
        r#"
name = "{name}"

[leaf]
rods = {rods}
length = 1.0
fan = "paper"
joined = true

[stiffness]
torsion = 1.0
bending_2 = 1.0
bending_3 = 1.0
axial = 100.0
shear_2 = 100.0
shear_3 = 100.0

[coupling]
x = 0.0
y = 1.0
z = 1.0

[load]
gravity = [0.0, 0.0, -1.0]

[solve]
tolerance = 1e-6
"#
    )
}

pub fn text(bytes: &[u8]) -> &str {
    std::str::from_utf8(bytes).unwrap()
}

pub fn is_whole_png(file: &Path) -> bool {
    let bytes = fs::read(file).unwrap();
    bytes.starts_with(b"\x89PNG\r\n\x1a\n") && bytes[..bytes.len() - 4].ends_with(b"IEND")
}
