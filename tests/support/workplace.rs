//! What the tests of the command line share: a folder to run the program in.

use std::fs::{self, DirEntry};
use std::io;
use std::path::PathBuf;
use std::process::{Child, Command, Output, Stdio};

use serde_json::{Value, json};
use tempfile::TempDir;

pub use crate::pairs;
use crate::root;

/// The program, which is built with the tests of its package: it stands one folder above them.
pub fn program() -> PathBuf {
    let test = std::env::current_exe().expect("the test has a path");
    let folder = test.ancestors().nth(2).expect("the test is in a folder");
    folder.join(format!("leafdyn{}", std::env::consts::EXE_SUFFIX))
}

/// A folder to run in, with a small leaf in `leaf.toml`.
pub struct Workplace {
    folder: TempDir,
}

/// How a run ended and what it printed.
pub struct Run {
    pub status: Option<i32>,
    pub out: String,
    pub err: String,
}

impl From<Output> for Run {
    fn from(output: Output) -> Run {
        Run {
            status: output.status.code(),
            out: String::from_utf8(output.stdout).unwrap(),
            err: String::from_utf8(output.stderr).unwrap(),
        }
    }
}

impl Run {
    /// Asserts the exit status.
    #[track_caller]
    pub fn ends(self, status: i32) -> Run {
        assert_eq!(self.status, Some(status), "{}{}", self.out, self.err);
        self
    }

    /// Asserts success, without a word on standard error.
    #[track_caller]
    pub fn ok(self) -> Run {
        assert_eq!(self.err, "");
        self.ends(0)
    }

    /// Asserts that the report has all of these parts.
    #[track_caller]
    pub fn says(self, parts: &[&str]) -> Run {
        contains(&self.out, parts);
        self
    }

    /// Standard output as JSON.
    #[track_caller]
    pub fn json(&self) -> Value {
        serde_json::from_str(&self.out).unwrap_or_else(|_| panic!("{}{}", self.out, self.err))
    }
}

impl Default for Workplace {
    fn default() -> Self {
        Workplace::new()
    }
}

impl Workplace {
    pub fn new() -> Self {
        let place = Workplace::empty();
        place.write("leaf.toml", leaf("small", 5));
        place
    }

    /// A folder without that leaf.
    pub fn empty() -> Self {
        let folder = tempfile::tempdir().unwrap();
        Workplace { folder }
    }

    pub fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// The program with arguments between blanks, to be run here; those that
    /// begin with `scenarios/` are files that come with it.
    pub fn command(&self, arguments: &str) -> Command {
        let mut command = Command::new(program());
        for argument in arguments.split_whitespace() {
            match argument.starts_with("scenarios/") {
                true => command.arg(root().join(argument)),
                false => command.arg(argument),
            };
        }
        command.current_dir(self.folder.path());
        command
    }

    pub fn run(&self, arguments: impl AsRef<str>) -> Run {
        self.command(arguments.as_ref()).output().unwrap().into()
    }

    /// A run that succeeds without a word on standard error.
    #[track_caller]
    pub fn ok(&self, arguments: impl AsRef<str>) -> Run {
        self.run(arguments).ok()
    }

    /// What a run that ends so says with `--json`.
    #[track_caller]
    pub fn told(&self, status: i32, arguments: impl AsRef<str>) -> Value {
        let run = self.run(format!("{} --json", arguments.as_ref()));
        run.ends(status).json()
    }

    /// A run on so many threads.
    pub fn run_on(&self, threads: &str, arguments: &str) -> Run {
        let mut command = self.command(arguments);
        let command = command.env("RAYON_NUM_THREADS", threads);
        command.output().unwrap().into()
    }

    /// Starts a run whose output is kept.
    pub fn start(&self, arguments: &str) -> Child {
        let mut command = self.command(arguments);
        let command = command.stdout(Stdio::piped()).stderr(Stdio::piped());
        command.spawn().unwrap()
    }

    /// A run that is refused: status 2, the message, nothing printed but one JSON object
    /// that says the same, and nothing written.
    #[track_caller]
    pub fn refuses(&self, arguments: impl AsRef<str>, message: &str) -> Run {
        let (arguments, before) = (arguments.as_ref(), self.names("."));
        let run = self.run(arguments);
        assert_eq!(run.status, Some(2), "{arguments}: {}", run.err);
        match arguments.contains("--json") {
            true => {
                let refused = run.json();
                let said = format!("error: {}", refused["error"].text());
                assert_eq!(run.err.trim_end(), said);
                let object = json!({ "error": refused["error"], "exit_status": 2 });
                assert_eq!(refused, object, "{arguments}");
            }
            false => assert_eq!(run.out, "", "{arguments}"),
        }
        assert!(run.err.contains(message), "{message} in {}", run.err);
        assert_eq!(self.names("."), before, "{arguments}");
        run
    }

    /// Names in a folder, sorted; hidden ones too.
    pub fn names(&self, folder: &str) -> Vec<String> {
        let entries = fs::read_dir(self.path(folder)).unwrap();
        let name = |entry: io::Result<DirEntry>| entry.unwrap().file_name();
        let mut names: Vec<_> = entries.map(|it| name(it).into_string().unwrap()).collect();
        names.sort();
        names
    }

    /// Asserts that a folder holds these files, names between blanks, and nothing else.
    #[track_caller]
    pub fn holds(&self, folder: &str, names: &str) {
        assert_eq!(self.names(folder).join(" "), names, "{folder}");
    }

    pub fn write(&self, file: &str, text: impl AsRef<[u8]>) {
        fs::write(self.path(file), text).unwrap();
    }

    #[track_caller]
    pub fn read(&self, file: &str) -> String {
        fs::read_to_string(self.path(file)).unwrap_or_else(|error| panic!("{file}: {error}"))
    }

    #[track_caller]
    pub fn json(&self, file: &str) -> Value {
        serde_json::from_str(&self.read(file)).unwrap()
    }

    /// A picture's SVG, which must be whole, as its PNG must be.
    #[track_caller]
    pub fn picture(&self, name: &str) -> String {
        let png = fs::read(self.path(&format!("{name}.png"))).unwrap();
        let (start, end) = (b"\x89PNG\r\n\x1a\n", b"IEND");
        assert!(png.starts_with(start) && png[..png.len() - 4].ends_with(end));
        let svg = self.read(&format!("{name}.svg"));
        assert!(svg.starts_with("<svg ") && svg.ends_with("</svg>\n"));
        svg
    }

    /// Cells of a CSV file that must have these columns.
    #[track_caller]
    pub fn table(&self, file: &str, columns: &str) -> Vec<Vec<String>> {
        let text = self.read(file);
        let mut lines = text.lines();
        assert_eq!(lines.next(), Some(columns));
        let row = |line: &str| line.split(',').map(String::from).collect();
        lines.map(row).collect()
    }

    /// As [`Workplace::table`], of numbers.
    #[track_caller]
    pub fn numbers(&self, file: &str, columns: &str) -> Vec<Vec<f64>> {
        let number = |cell: String| cell.parse().unwrap();
        let row = |row: Vec<String>| row.into_iter().map(number).collect();
        let table = self.table(file, columns);
        table.into_iter().map(row).collect()
    }
}

/// Asserts that a text has all of these parts.
#[track_caller]
pub fn contains(text: &str, parts: &[&str]) {
    for part in parts {
        assert!(text.contains(part), "{part} in {text}");
    }
}

/// Asks for what every line of a table names, `arguments => message`: each is
/// refused in a folder of its own, to people and to scripts.
#[track_caller]
pub fn all_refused(common: &str, table: &str) {
    for (arguments, message) in pairs(table) {
        let place = Workplace::new();
        for json in ["", "--json"] {
            place.refuses(format!("{common} {arguments} {json}"), message);
        }
    }
}

/// What a JSON value must be.
pub trait Json {
    fn list(&self) -> &[Value];
    /// The only one of a list.
    fn only(&self) -> &Value;
    fn number(&self) -> f64;
    fn count(&self) -> usize;
    fn text(&self) -> &str;
}

impl Json for Value {
    #[track_caller]
    fn list(&self) -> &[Value] {
        self.as_array().expect("a list")
    }

    #[track_caller]
    fn only(&self) -> &Value {
        assert_eq!(self.list().len(), 1, "{self:#}");
        &self[0]
    }

    #[track_caller]
    fn number(&self) -> f64 {
        self.as_f64().expect("a number")
    }

    #[track_caller]
    fn count(&self) -> usize {
        self.as_u64().expect("a whole number") as usize
    }

    #[track_caller]
    fn text(&self) -> &str {
        self.as_str().expect("a text")
    }
}

/// Asserts that a JSON object tells this, as in `outcome=converged shooting.stable=true`.
#[track_caller]
pub fn tells(object: &Value, entries: &str) {
    for entry in entries.split(' ') {
        let (key, wanted) = entry.split_once('=').expect("key=value");
        let wanted: Value = serde_json::from_str(wanted).unwrap_or_else(|_| wanted.into());
        let found = object.pointer(&format!("/{}", key.replace('.', "/")));
        assert_eq!(found, Some(&wanted), "{key}");
    }
}

/// Runs what every line of a table names, `arguments => entries; part | part`: the JSON tells the
/// entries, and the report has all parts, with one exit status.
pub fn all_tell(status: i32, table: &str) {
    for (arguments, told) in pairs(table) {
        let place = Workplace::new();
        let (entries, parts) = told.split_once("; ").unwrap_or((told, ""));
        tells(&place.told(status, arguments), entries);
        let parts: Vec<&str> = parts.split(" | ").collect();
        place.run(arguments).ends(status).says(&parts);
    }
}

/// The numbers of a JSON list.
#[track_caller]
pub fn floats(value: &Value) -> Vec<f64> {
    value.list().iter().map(Json::number).collect()
}

/// Asserts that two JSON lists are the same numbers but for so much.
#[track_caller]
pub fn near(a: &Value, b: &Value, within: f64) {
    let (a, b) = (floats(a), floats(b));
    let near = a.len() == b.len() && a.iter().zip(&b).all(|(a, b)| (a - b).abs() < within);
    assert!(near, "{a:?} {b:?}");
}

/// What a JSON object tells, but for times.
pub fn timeless(mut object: Value) -> Value {
    object["wall_seconds"] = Value::Null;
    object
}

/// Interrupts a run as Ctrl-C does.
pub fn interrupt(child: &Child) {
    send(child, "INT");
}

/// Sends a run the signal of this name.
pub fn send(child: &Child, signal: &str) {
    let mut kill = Command::new("kill");
    let kill = kill.arg(format!("-{signal}")).arg(child.id().to_string());
    assert!(kill.status().unwrap().success());
}

/// What makes a small leaf whole: its stiffness, and a motion.
pub fn stiffness(shear_3: &str, duration: &str) -> String {
    format!(
        "
[stiffness]
torsion = 0.7
bending_2 = 0.8
bending_3 = 1.2
axial = 100.0
shear_2 = 80.0
shear_3 = {shear_3}
[dynamics]
density = 1.0
duration = {duration}
internal_damping = 0.01
"
    )
}

/// A leaf of the paper with so many rods.
pub fn leaf(name: &str, rods: usize) -> String {
    format!(
        r#"
name = "{name}"
leaf = {{ rods = {rods}, length = 1.0, fan = "paper", joined = true }}
stiffness = {{ torsion = 1.0, bending_2 = 1.0, bending_3 = 1.0, axial = 100.0, shear_2 = 100.0, shear_3 = 100.0 }}
coupling = {{ x = 0.0, y = 1.0, z = 1.0 }}
load = {{ gravity = [0.0, 0.0, -1.0] }}
solve = {{ tolerance = 1e-6 }}
"#
    )
}
