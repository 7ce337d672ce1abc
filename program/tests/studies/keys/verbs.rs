//! What the verbs answer, as numbers that can be compared.

use std::fs;
use std::path::Path;

use leafdyn_testing::workplace::{Json, Run, Workplace};
use serde_json::Value;

use crate::keys::leaves::TestLeaf;
use crate::keys::rows::Acts;

macro_rules! verbs {
    ($($verb:ident = $word:literal,)*) => {
        /// What is asked.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
        pub enum Verb {
            $($verb,)*
        }

        impl Verb {
            pub const ALL: &[Verb] = &[$(Verb::$verb,)*];

            pub fn word(self) -> &'static str {
                match self {
                    $(Verb::$verb => $word,)*
                }
            }
        }
    };
}

verbs! {
    Relax = "relax",
    Release = "release",
    Explicit = "explicit",
    SingleShooting = "single-shooting",
    Shooting = "shooting",
    ShootingFromRest = "shooting-from-rest",
    KeepUnstable = "keep-unstable",
    Modes = "modes",
    All = "all",
    Margin = "margin",
    Trace = "trace",
    Boundary = "boundary",
    Map = "map",
    Chart = "chart",
    Check = "check",
    Fit = "fit",
    Unbend = "unbend",
    SimulateExplicit = "simulate-explicit",
    SimulateSemiImplicit = "simulate-semi-implicit",
    Page = "page",
    Figures = "figures",
    MotionPage = "motion-page",
    MotionFigures = "motion-figures",
}

use Verb::*;

impl Verb {
    /// Whether it answers with a leaf in motion.
    pub fn moves(self) -> bool {
        matches!(
            self,
            SimulateExplicit | SimulateSemiImplicit | MotionPage | MotionFigures
        )
    }

    /// Whether what a key acts on is in the answer. A chart has times and errors, and no
    /// leaf, and a margin is long to find: its
    /// methods must agree with each other.
    pub fn shows(self, acts: Acts) -> bool {
        match acts {
            _ if matches!(self, Chart | Margin) => false,
            Acts::Always => true,
            Acts::Inertia => self.moves() || matches!(self, Modes | Fit),
            Acts::Motions => self.moves(),
            Acts::Photographs => self == Fit,
            Acts::Nowhere(_) => false,
        }
    }

    /// The arguments after the scenario; `None`: the leaf has no such question. `key` is the path of
    /// the key that was changed, if any.
    fn arguments(self, leaf: &TestLeaf, key: &str) -> Option<String> {
        if leaf.name == "blade" && !matches!(self, Relax | Release) {
            // Slender veins take seconds to minutes in most others.
            return None;
        }
        let other = |two: [&'static str; 2]| two[usize::from(two[0].starts_with(key))];
        Some(match self {
            Relax => "--modes 0".into(),
            Release => "--path release --modes 0".into(),
            Explicit => "--method explicit --path release --modes 0".into(),
            SingleShooting | Shooting | ShootingFromRest => format!("--method {}", self.word()),
            KeepUnstable => "--keep-unstable --modes 0".into(),
            Modes => "--modes 2 --write csv".into(),
            All => "--all".into(),
            Margin => "--margin --tolerance 1e-4".into(),
            Trace => format!("--vary {}", other(leaf.vary)),
            Boundary => {
                let [set, one, two] = leaf.boundary?;
                // Of the number that is changed the other one varies.
                let two = match two.starts_with(key) {
                    true => "stiffness.bending_3=1.2..1.21",
                    false => two,
                };
                let set = match key == "load.distributed" {
                    true => String::new(),
                    false => format!("--set {set} "),
                };
                format!("{set}--vary {one} --vary {two}")
            }
            Map => "--vary solve.tolerance=1e-6..1e-6:1 --write csv".into(),
            Chart => "--methods semi-implicit,shooting-from-rest --seconds 0.01".into(),
            Check => String::new(),
            Unbend => format!("--shape {}-shape.csv", leaf.name),
            Fit => format!("--data {}.csv --free {}", leaf.name, other(leaf.free)),
            SimulateExplicit => "--method explicit".into(),
            SimulateSemiImplicit => "--method semi-implicit".into(),
            Page => "--write html --modes 0".into(),
            Figures => "--write svg".into(),
            MotionPage => "--write html".into(),
            MotionFigures => "--write svg".into(),
        })
    }

    fn program(self) -> &'static str {
        match self {
            Trace | Boundary => "trace",
            Map | Chart | Check | Fit | Unbend => self.word(),
            _ if self.moves() => "simulate",
            _ => "relax",
        }
    }
}

/// An answer: how the run ended, and its numbers.
pub struct Answer {
    pub status: i32,
    /// All that was printed.
    pub said: String,
    /// Numbers that the answer consists of.
    pub numbers: Vec<f64>,
    /// What they are known within.
    pub error: f64,
    /// The tips of the leaf at rest, or of a motion at its end.
    pub tips: Vec<f64>,
    /// A page's data or figures.
    pub shown: String,
    /// What contradicts the answer, if anything does.
    pub contradiction: Option<String>,
}

/// What a verb answers for a leaf, with another value of a key or as it is.
pub fn ask(place: &Workplace, verb: Verb, leaf: &TestLeaf, change: Option<&str>) -> Option<Answer> {
    let path = change.and_then(|set| set.split_once('='));
    let key = path.map_or("no key", |(path, _)| path.split('[').next().unwrap_or(path));
    let mut arguments = verb.arguments(leaf, key)?;
    if let Some(change) = change {
        let set = match (verb, key) {
            // What presses the leaf and the change of the key are one entry.
            (Boundary, "load.distributed") => "load.distributed=[-14.0,0.1,0.3]",
            _ => change,
        };
        arguments += &format!(" --set {set}");
    }
    if !arguments.contains("--write") {
        arguments += " --write none";
    }
    let number = place.names(".").len();
    let out = format!(
        "{}-{}-{}-{number}",
        leaf.name,
        verb.word(),
        change.map_or(0, hash)
    );
    let asked = format!(
        "{} {}.toml {arguments} --json --out {out}",
        verb.program(),
        leaf.name
    );
    let run = place.run_on("1", &asked);
    Some(Answer::read(verb, &run, &place.path(&out)))
}

/// A number that tells changes apart.
fn hash(text: &str) -> usize {
    let bytes = text.bytes().map(usize::from);
    bytes.fold(7, |sum, byte| (31 * sum + byte) % 1_000_003)
}

impl Answer {
    fn read(verb: Verb, run: &Run, out: &Path) -> Answer {
        let mut answer = Answer {
            status: run.status.unwrap_or(-1),
            said: format!("{}{}", run.out, run.err),
            numbers: Vec::new(),
            error: 1e-9,
            tips: Vec::new(),
            shown: String::new(),
            contradiction: None,
        };
        let Ok(told) = serde_json::from_str::<Value>(&run.out) else {
            return answer;
        };
        if told.get("error").is_some_and(Value::is_string) {
            return answer;
        }
        match verb {
            Modes => {
                answer.at_rest(&told);
                let modes = table(&out.join("modes.csv"));
                let frequencies = modes.iter().filter(|row| row[5] == "0.0");
                answer.numbers = frequencies.flat_map(|row| number(&row[3])).collect();
                answer.error = 1e-6;
            }
            All => {
                let leaves = told["equilibria"].as_array().into_iter().flatten();
                if let Some(first) = leaves.into_iter().find(|leaf| leaf["stable"] != false) {
                    answer.at_rest(first);
                }
            }
            Margin => {
                answer.at_rest(&told);
                let pushes = told["margin"]["pushes"].as_array().into_iter().flatten();
                answer
                    .numbers
                    .extend(pushes.filter_map(|push| push["force"].as_f64()));
            }
            Trace => {
                let branch = &told["branches"][0];
                answer.at_rest(&branch["first"]);
                answer.numbers.extend(tips(&branch["last"]));
            }
            Boundary => {
                let point = &told["curves"][0]["points"][0];
                answer.numbers.extend(point["values"][0].as_f64());
                answer.error = point["errors"][0].as_f64().unwrap_or(1e-6);
            }
            Map => {
                for row in table(&out.join("map.csv")) {
                    let here: Vec<f64> = row[5..8].iter().filter_map(|cell| number(cell)).collect();
                    match &row[2][..] {
                        "right" => {
                            answer.error = answer.error.max(number(&row[10]).unwrap_or(1.0));
                            answer.apart_from(&row[1], &here);
                            answer.numbers = here;
                        }
                        "refused" => answer.said += &row[3],
                        other => answer.contradicted(format!("{}: {other}, {}", row[1], row[3])),
                    }
                }
                answer.tips = answer.numbers.clone();
                let energies = table(&out.join("map.csv"));
                answer
                    .numbers
                    .extend(energies.iter().find_map(|row| number(&row[8])));
            }
            Chart => {
                for run in told["runs"].as_array().into_iter().flatten() {
                    if run["outcome"] == "other-equilibrium" {
                        answer.contradicted(run.to_string());
                    }
                }
            }
            Check => {
                answer.at_rest(&told["relaxation"]);
                if told["verdict"] == "differ" {
                    answer.contradicted(told["difference"].to_string());
                }
            }
            Fit => {
                answer
                    .numbers
                    .extend(told["parameters"][0]["value"].as_f64());
                answer.numbers.extend(told["chi_squared"].as_f64());
                answer.error = 1e-4;
            }
            Unbend => {
                let least = told["critical_young"]["value"].number();
                answer.numbers = vec![least, told["length"].number()];
                // The points, hence their smoothing, do not change with the key.
                answer.error = 1e-6 * least;
            }
            SimulateExplicit | SimulateSemiImplicit => {
                answer.tips = tips(&told);
                answer.numbers = answer.tips.clone();
                let energies = ["elastic", "coupling", "potential"];
                answer
                    .numbers
                    .extend(energies.map(|name| told["energy"][name].number()));
                answer
                    .numbers
                    .extend(["duration", "frames"].map(|key| told[key].number()));
                answer.error = 1e-6;
            }
            Page | MotionPage | Figures | MotionFigures => {
                let end = if matches!(verb, Page | MotionPage) {
                    "html"
                } else {
                    "svg"
                };
                answer.shown = shown(out, end);
            }
            _ => answer.at_rest(&told),
        }
        answer
    }

    /// Takes over the tips of a leaf at rest and their error.
    fn at_rest(&mut self, leaf: &Value) {
        self.tips = tips(leaf);
        self.numbers = self.tips.clone();
        self.numbers.extend(leaf["energy"].as_f64());
        let error = leaf["error_estimate"].as_f64().or(leaf["error"].as_f64());
        self.error = error.unwrap_or(1e-4);
    }

    /// Notes that a method found a tip elsewhere than another one.
    fn apart_from(&mut self, method: &str, tip: &[f64]) {
        if !self.numbers.is_empty()
            && largest_difference(&self.numbers, tip) > 2.0 * self.error + 1e-5
        {
            let found = self.numbers.clone();
            self.contradicted(format!("{method}: {tip:?} for {found:?}"));
        }
    }

    fn contradicted(&mut self, why: String) {
        self.contradiction.get_or_insert(why);
    }

    /// Whether it differs from another one by more than both are known within.
    pub fn differs_from(&self, other: &Answer) -> bool {
        let scale = self
            .numbers
            .iter()
            .fold(1.0, |most: f64, number| most.max(number.abs()));
        let within = 2.0 * (self.error + other.error) + 1e-9 * scale;
        self.shown != other.shown || largest_difference(&self.numbers, &other.numbers) > within
    }
}

/// Largest difference of two lists; infinite if they are not equally long.
pub fn largest_difference(a: &[f64], b: &[f64]) -> f64 {
    if a.len() != b.len() {
        return f64::INFINITY;
    }
    let apart = a.iter().zip(b).map(|(a, b)| (a - b).abs());
    leafdyn_testing::largest(apart)
}

/// The joint tip, or all tips.
pub fn tips(leaf: &Value) -> Vec<f64> {
    let all = match &leaf["tip"] {
        Value::Array(tip) => tip.clone(),
        _ => leaf["tips"]
            .as_array()
            .into_iter()
            .flatten()
            .flat_map(|tip| tip.as_array().cloned())
            .flatten()
            .collect(),
    };
    all.iter().filter_map(Value::as_f64).collect()
}

fn number(cell: &str) -> Option<f64> {
    cell.parse().ok()
}

/// The rows of a table, without its header; none if it is not there.
fn table(file: &Path) -> Vec<Vec<String>> {
    let Ok(mut table) = csv::Reader::from_path(file) else {
        return Vec::new();
    };
    let rows = table.records().filter_map(Result::ok);
    rows.map(|row| row.iter().map(String::from).collect())
        .collect()
}

/// What the pages of a folder have as data, or its figures draw, without names of files.
fn shown(folder: &Path, end: &str) -> String {
    let entries = fs::read_dir(folder)
        .into_iter()
        .flatten()
        .filter_map(Result::ok);
    let mut files: Vec<_> = entries.map(|entry| entry.path()).collect();
    files.retain(|file| file.extension().is_some_and(|it| it == end));
    files.sort();
    let mut all = String::new();
    for file in files {
        let text = fs::read_to_string(file).unwrap_or_default();
        match text.split_once("<script id=\"data\" type=\"application/json\">") {
            Some((_, data)) => all += data.split("</script>").next().unwrap_or_default(),
            None => all += &text,
        }
    }
    all
}
