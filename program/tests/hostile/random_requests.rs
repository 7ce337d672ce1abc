//! Requests drawn at random from what the program itself tells: every verb and option of its help,
//! every key of its schema, scenarios that come with it. Each ends with an exit status that the help
//! of its verb documents, in one message or a result of numbers, without a panic or an unfinished
//! file. Each request has a number, from which it is drawn: `LEAFDYN_REQUESTS` is how many are made,
//! and `LEAFDYN_REQUESTS_FROM` the first one.

use std::fs;
use std::path::Path;
use std::process::{Child, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};

use leafdyn::scenario::{Scenario, schema};
use leafdyn_testing::random::Draw;
use leafdyn_testing::workplace::{Run, Workplace, stiffness};
use leafdyn_testing::{asked, root};
use rayon::prelude::*;
use serde_json::Value;

/// Requests of an ordinary test run.
const REQUESTS: usize = 120;

/// Longest run, after which a request is given up: some leaves take longer, which is no fault here.
/// Where more than usual is asked for, it may take longer.
const LONGEST: [Duration; 2] = [Duration::from_millis(250), Duration::from_secs(2)];

/// Small leaves, beside the scenarios that come with the program.
const SMALL: &[&str] = &[
    "leaf = { rods = 1, length = 1.0, fan = [0.2] }
load = { gravity = [0.0, 0.3, -0.6], tip_moment = [0.1, 0.0, 0.2] }",
    "leaf = { rods = 1, length = 1.0, fan = [0.0] }
load = { tip_force = [-4.0, 0.0, 0.0], g = [0.0, 0.0, -1.0], point = [{ vein = 1, at = 0.5, mass = 0.3 }] }
rest = { bend_2 = 0.5, twist = 0.3 }",
    "leaf = { rods = 2, length = 1.0, fan = \"symmetric\" }
load = { gravity = [0.0, 0.0, -3.0] }
tissue = { along = 2.0, across = 3.0, normal = 2.0, fold = 0.3 }
rest = { stretch = 1.1 }",
    "leaf = { rods = 3, length = [1.0, 0.9, 1.0], fan = \"paper\" }
load = { gravity = [0.1, 0.0, -1.0], tip_force = [0.0, 0.1, -1.0] }
coupling = { y = 1.0, z = [1.0, 2.0] }",
    "leaf = { rods = 2, length = 1.0, fan = \"symmetric\", joined = false, base = [[0.0, -0.1, 0.0], [0.0, 0.1, 0.0]] }
load = { distributed = { at = [0.0, 1.0], value = [[0.0, 0.0, -1.0], [0.0, 0.5, 0.0]] } }
coupling = { z = 3.0 }",
    "leaf = { rods = 1, length = 1.0, fan = [0.2] }
tip = { held = \"pinned\", position = [0.9, 0.1, -0.1] }
load = { gravity = [0.0, 0.0, -0.6] }",
    "leaf = { rods = 1, length = 1.0, fan = [0.2], base_held = \"pinned\" }
load = { tip_force = [1.0, 0.5, -1.0] }
grip = [{ vein = 1, at = [0.4, 0.6], move = [0.0, 0.03, 0.05], held = \"clamped\" }]",
    "leaf = { rods = 2, length = 1.0, fan = \"symmetric\" }
load = { gravity = [0.0, 0.0, -0.6] }
wind = { velocity = [0.5, 0.8, 1.0], density = 1.2, drag = 2.0, width = 0.2 }",
];

/// A small leaf of this name.
fn small_leaf(name: &str, leaf: &str) -> String {
    // Rigid in one shear.
    format!("name = \"{name}\"\n{leaf}{}", stiffness("inf", "0.03"))
}

/// Numbers that hardly anyone means.
const WILD: &str = "0 0.0 -0.0 -1 -1.0 1e-320 1e-300 1e-12 -1e-9 1e-6 1e6 -1e9 1e12 1e50 -1e300 1e308 inf -inf \
    nan 3 100000 99999999999999999999 9223372036854775807";

/// Values of other types than a key has.
const OTHER_TYPES: &str =
    "true|\"text\"|[]|{}|[[1.0]]|[1,\"a\"]|2020-01-01|[[],[]]|{at=[0,1],value=[1,2]}|'|[";

/// Texts that keys have: the words that their descriptions quote are drawn besides.
const TEXTS: &str = "free pinned clamped circle ellipse rectangle released at-rest x -y z mm N ä";

/// A verb as its help tells it.
struct Verb {
    name: String,
    options: Vec<VerbOption>,
    statuses: Vec<i32>,
}

struct VerbOption {
    name: String,
    /// What its value is called; empty: it has none.
    value: String,
    /// Words that its value may be.
    words: Vec<String>,
    is_required: bool,
}

/// The words of a list in a sentence: what stands alone between commas and the like.
fn listed(prose: &str) -> impl Iterator<Item = String> {
    let told = prose.split("[default").next().unwrap_or_default();
    let items = told
        .split([',', ':', ';', '(', ')', '[', ']'])
        .map(str::trim);
    let items = items.map(|item| item.trim_start_matches("or "));
    let is_word = |item: &&str| {
        !item.is_empty()
            && !item.contains(|c: char| !(c.is_ascii_alphanumeric() || "_-".contains(c)))
    };
    items.filter(is_word).map(String::from)
}

impl Verb {
    /// The verbs that take a scenario.
    fn all(place: &Workplace) -> Vec<Verb> {
        let help = place.ok("--help").out;
        let (_, commands) = help.split_once("Commands:").unwrap();
        let names = commands.lines().skip(1).take_while(|line| !line.is_empty());
        let names = names.filter_map(|line| line.split_whitespace().next());
        let verbs = names.filter(|name| *name != "help").map(|name| {
            let help = place.ok(format!("{name} --help")).out;
            help.contains("<SCENARIO>").then(|| Verb::read(name, &help))
        });
        verbs.flatten().collect()
    }

    fn read(name: &str, help: &str) -> Verb {
        let (told, options) = help.split_once("Options:").unwrap();
        let usage = told
            .lines()
            .find(|line| line.starts_with("Usage:"))
            .unwrap();
        let (_, statuses) = told.split_once("Exit status:").unwrap();
        let statuses = statuses.split(';');
        let statuses = statuses.filter_map(|part| part.split_whitespace().next()?.parse().ok());
        let mut verb = Verb {
            name: name.into(),
            options: Vec::new(),
            statuses: statuses.collect(),
        };
        for line in options.lines().map(str::trim) {
            let long = line.strip_prefix("-v, ").unwrap_or(line).strip_prefix("--");
            match (long, verb.options.last_mut()) {
                (Some(long), _) => {
                    let (name, value) = long.split_once(' ').unwrap_or((long, ""));
                    verb.options.push(VerbOption {
                        name: name.into(),
                        value: value.trim_matches(['<', '>']).into(),
                        words: Vec::new(),
                        is_required: usage.contains(&format!("--{name} ")),
                    });
                }
                (None, Some(option)) => option.words.extend(listed(line)),
                _ => {}
            }
        }
        let ours = ["set", "out", "json"];
        verb.options.retain(|option| !ours.contains(&&*option.name));
        assert!(
            verb.options.len() > 5 && verb.statuses.contains(&2),
            "{help}"
        );
        verb
    }
}

/// A request: arguments after the program's name, without the folder of files.
struct Request {
    scenario: String,
    arguments: Vec<String>,
}

impl Request {
    /// As it is typed.
    fn shown(&self) -> String {
        let quoted: Vec<String> = self.arguments.iter().map(|it| format!("'{it}'")).collect();
        format!("{}\nleafdyn {}\n", self.scenario, quoted.join(" "))
    }
}

/// What draws the parts of a request.
struct Generator<'s> {
    draw: Draw,
    schema: &'s Value,
    /// Numbers of the scenario: paths as in `--set`, and values.
    numbers: Vec<(String, f64)>,
    rods: usize,
    /// Share of numbers that are wild, and thrice that of values of other types.
    wild: f64,
}

impl<'s> Generator<'s> {
    fn below(&mut self, count: usize) -> usize {
        (self.draw.even() * count as f64) as usize
    }

    fn one<'t, T: ?Sized>(&mut self, of: &[&'t T]) -> &'t T {
        of[self.below(of.len())]
    }

    fn word(&mut self, words: &str) -> String {
        let words: Vec<&str> = words.split_whitespace().collect();
        self.one(&words).into()
    }

    fn request(number: usize, verbs: &[Verb], scenarios: &[String], schema: &'s Value) -> Request {
        let mut generator = Generator {
            draw: Draw(0xa11 + 7919 * number as u64),
            schema,
            numbers: Vec::new(),
            rods: 1,
            wild: 0.0,
        };
        generator.wild = [0.0, 0.0, 0.02, 0.15][generator.below(4)];
        let mut scenario = match generator.draw.chance(0.7) {
            true => small_leaf("leaf", generator.one(SMALL)),
            false => scenarios[generator.below(scenarios.len())].clone(),
        };
        let read = Scenario::from_toml(&scenario).unwrap();
        generator.rods = read.rods.len();
        let mut leaf = serde_json::to_value(&read).unwrap();
        collect_numbers(&leaf, String::new(), &mut generator.numbers);
        let mut set = Vec::new();
        let mut as_read = generator.draw.chance(0.5);
        for _ in 0..(6.0 * generator.draw.even().powi(2)) as usize {
            match generator.below(4) {
                0 => {
                    generator.put_table(&mut leaf);
                    as_read = true;
                }
                1 => set.push(generator.entry(&leaf)),
                _ => set.push(generator.other_number()),
            }
        }
        if as_read {
            scenario = String::new();
            for (name, value) in leaf.as_object().unwrap() {
                scenario += &format!("{name} = {}\n", toml(value));
            }
        }
        // Of three requests one relaxes.
        let verb = match generator.draw.chance(0.25) {
            true => &verbs[0],
            false => &verbs[generator.below(verbs.len())],
        };
        let mut arguments = vec![verb.name.clone(), "leaf.toml".into()];
        if generator.draw.chance(0.03) {
            arguments.push("other.toml".into());
        }
        for option in &verb.options {
            // Searches from many starts take long, and what limits time or accuracy saves it.
            let chance = match &*option.name {
                "all" | "margin" => 0.04,
                "tolerance" if verb.name == "chart" => 0.1,
                "tolerance" | "seconds" | "cell-seconds" | "write" => 0.95,
                _ => 0.06,
            };
            if !option.is_required && !generator.draw.chance(chance) {
                continue;
            }
            let again = option.is_required && generator.draw.chance(0.25);
            for _ in 0..1 + usize::from(again) {
                arguments.push(match &*option.value {
                    "" => format!("--{}", option.name),
                    _ => format!("--{}={}", option.name, generator.option_value(option)),
                });
            }
        }
        arguments.extend(set.into_iter().map(|entry| format!("--set={entry}")));
        if generator.draw.chance(0.5) {
            arguments.push("--json".into());
        }
        Request {
            scenario,
            arguments,
        }
    }

    /// A value of an option. What its value is called tells what it means; a name that is new here
    /// has wild ones.
    fn option_value(&mut self, option: &VerbOption) -> String {
        if self.draw.chance(self.wild / 3.0) {
            return self.word(WILD);
        }
        match &*option.value {
            "T" => self.word("0.1 1e-2 1e-2 1e-3 1e-4 1e-6"),
            "S" => self.word("0.05 0.01 1e-3"),
            "H" => self.word("1e-2 1e-3 1e-5 1"),
            "N" | "K" => self.word("0 1 2 3 4 5 8 16 33"),
            "SIZE" => self.word("500MB 500MB 20MB 1MB 1kB"),
            "I/K" => self.word("1/1 1/2 2/2 3/2 0/0"),
            "COLUMNSxROWS" => self.word("2x2 3x1 1x1 0x2 2x"),
            "FILE.csv" => self.word("data.csv data.csv points.csv leaf.toml missing.csv"),
            "COLUMN>VALUE" => self.word("tip_z>-1 tip_z<0 load.tip_force[2]>=0.2 sigma=1 x>nan"),
            "NAME=QUANTITY[:FACTOR[+OFFSET]]" => self.word(
                "tip_z=tip_z tip_z=tip_x:2+0.1 experiment=load.tip_force[0] x=y sd_tip_z=sd_tip_x",
            ),
            "KEY,..." => {
                let count = 1 + self.below(2);
                let keys: Vec<String> = (0..count).map(|_| self.number_path()).collect();
                keys.join(",")
            }
            "KEY=FROM..TO[:COUNT][log]" => self.range(),
            "KEY[=LOW..HIGH]" => {
                let (path, value) = self.path_and_value();
                match self.below(6) {
                    0 => format!("{path}={}..{}", 0.5 * value - 0.1, 2.0 * value + 0.1),
                    1 => self.word("offset:tip_z offset:load.tip_force[2] offset:x"),
                    _ => path,
                }
            }
            _ if option.name == "write" && self.draw.chance(0.75) => "none".into(),
            _ if !option.words.is_empty() => {
                let is_list = option.value == "LIST" && self.draw.chance(0.3);
                let words: Vec<&str> = option.words.iter().map(String::as_str).collect();
                let drawn = (0..1 + usize::from(is_list)).map(|_| self.one(&words));
                drawn.collect::<Vec<_>>().join(",")
            }
            "LIST" => self.word("1 2 1,2 5 0 0,1"),
            _ => self.word(WILD),
        }
    }

    fn path_and_value(&mut self) -> (String, f64) {
        let at = self.below(self.numbers.len());
        self.numbers[at].clone()
    }

    /// A number of the scenario or, seldom, any key.
    fn number_path(&mut self) -> String {
        match self.draw.chance(0.1) {
            true => self.key().0,
            false => self.path_and_value().0,
        }
    }

    /// A range of a number, as in `--vary`, most often about the number that it is.
    fn range(&mut self) -> String {
        let (path, value) = match self.draw.chance(0.1) {
            true => (self.word("method.segments method.step leaf.rods"), 2.0),
            false => self.path_and_value(),
        };
        let joined = match self.draw.chance(0.05) {
            true => format!("+{}", self.path_and_value().0),
            false => String::new(),
        };
        let end = match value != 0.0 && self.draw.chance(0.6) {
            true => value * self.draw.uniform(0.7, 1.5),
            false => value + self.draw.uniform(-2.0, 2.0),
        };
        let mut ends = [value.to_string(), end.to_string()];
        if self.draw.chance(self.wild) {
            ends[self.below(2)] = self.word(WILD);
        }
        let mut count = self.word(": :1 :2 :3");
        if count == ":" {
            count.clear();
        }
        if self
            .draw
            .chance(if value * end > 0.0 { 0.2 } else { self.wild })
        {
            count += "log";
        }
        format!("{path}{joined}={}..{}{count}", ends[0], ends[1])
    }

    /// The path of any key or table of the format, and its schema.
    fn key(&mut self) -> (String, &'s Value) {
        let (mut path, mut schema) = (String::new(), self.schema);
        // Knots of a profile are part of a value; a whole table is drawn now and then.
        while schema["type"] == "object" && schema["properties"]["at"]["type"] != "array" {
            if !path.is_empty() && self.draw.chance(0.1) {
                break;
            }
            let inner = schema["properties"].as_object().unwrap();
            let (name, found) = inner.iter().nth(self.below(inner.len())).unwrap();
            let dot = if path.is_empty() { "" } else { "." };
            path = format!("{path}{dot}{name}");
            schema = found;
        }
        (path, schema)
    }

    /// An entry as in `--set`: any value of a key, most often of one in a table that is there.
    fn entry(&mut self, leaf: &Value) -> String {
        let (path, schema) = loop {
            let (path, schema) = self.key();
            let table = path.split('.').next().unwrap_or_default();
            if !leaf[table].is_null() || self.draw.chance(0.1) {
                break (path, schema);
            }
        };
        format!("{path}={}", self.value(schema, None))
    }

    /// Another value of a number of the scenario, as in `--set`.
    fn other_number(&mut self) -> String {
        let (path, value) = self.path_and_value();
        if self.draw.chance(self.wild) {
            return format!("{path}={}", self.word(WILD));
        }
        let other = match value == 0.0 {
            true => self.draw.uniform(-1.0, 1.0),
            false => value * self.draw.log(0.2, 5.0),
        };
        let rounded = other.round();
        match value.fract() == 0.0 && rounded != 0.0 && self.draw.chance(0.5) {
            true => format!("{path}={rounded}"),
            false => format!("{path}={other}"),
        }
    }

    /// Replaces a table of the scenario or a repeated one, or adds it.
    fn put_table(&mut self, leaf: &mut Value) {
        let is_table = |of: &Value| of["type"] == "object" || of["items"]["type"] == "object";
        let tables = self.schema["properties"].as_object().unwrap().iter();
        let tables: Vec<_> = tables.filter(|(_, of)| is_table(of)).collect();
        let (name, of) = tables[self.below(tables.len())];
        let inner = of["properties"].as_object().into_iter().flatten();
        let repeated: Vec<_> = inner
            .filter(|(_, of)| of["items"]["type"] == "object")
            .collect();
        if name == "section" && self.draw.chance(0.8) {
            // Stiffnesses follow from it.
            leaf.as_object_mut().unwrap().remove("stiffness");
        }
        match repeated.first() {
            // What was replaced already is text.
            Some((within, of)) if self.draw.chance(0.7) && !leaf[name].is_string() => {
                let text = self.value(of, None);
                leaf[name][*within] = format!("{RAW}{text}").into();
            }
            _ => leaf[name] = format!("{RAW}{}", self.value(of, None)).into(),
        }
    }

    /// A value as TOML, of so many knots within a profile.
    fn value(&mut self, schema: &Value, knots: Option<usize>) -> String {
        if self.draw.chance(self.wild / 3.0) {
            let others: Vec<&str> = OTHER_TYPES.split('|').collect();
            return self.one(&others).into();
        }
        if let Some(forms) = schema["anyOf"].as_array() {
            let form = &forms[self.below(forms.len())];
            return self.value(form, knots);
        }
        if let Some(words) = schema["enum"].as_array() {
            return words[self.below(words.len())].to_string();
        }
        match schema["type"].as_str() {
            Some("boolean") => self.word("true false"),
            Some("string") => {
                let description = schema["description"].as_str().unwrap_or_default();
                let quoted: Vec<&str> = description.split('"').skip(1).step_by(2).collect();
                match !quoted.is_empty() && self.draw.chance(0.7) {
                    true => format!("\"{}\"", self.one(&quoted)),
                    false => format!("\"{}\"", self.word(TEXTS)),
                }
            }
            Some("array") => {
                let inner = &schema["items"];
                let count = match (schema["minItems"].as_u64(), knots) {
                    (Some(count), _) => count as usize,
                    (None, Some(knots))
                        if inner["type"] != "array" || !inner["minItems"].is_null() =>
                    {
                        knots
                    }
                    (None, _) if inner["type"] == "object" => 1 + self.below(2),
                    (None, _) => self.rods - usize::from(self.rods > 1 && self.draw.chance(0.3)),
                };
                let count = match self.draw.chance(self.wild) {
                    true => self.below(5),
                    false => count,
                };
                let values: Vec<String> = (0..count).map(|_| self.value(inner, knots)).collect();
                format!("[{}]", values.join(", "))
            }
            Some("object") => self.table(schema, knots),
            Some("integer") => match self.draw.chance(self.wild) {
                true => self.word(WILD),
                false => (1 + self.below(3)).to_string(),
            },
            _ => self.number(schema),
        }
    }

    /// A table: all that it must have, and some of what it may have.
    fn table(&mut self, schema: &Value, knots: Option<usize>) -> String {
        let is_profile = schema["properties"]["at"]["type"] == "array";
        let count = 2 + self.below(3);
        let knots = if is_profile { Some(count) } else { knots };
        let required = schema["required"].as_array();
        let mut entries = Vec::new();
        for (name, of) in schema["properties"].as_object().unwrap() {
            let must = required.is_some_and(|all| all.iter().any(|it| it == name));
            if must || self.draw.chance(0.4) {
                let is_knots = is_profile && name == "at" && !self.draw.chance(self.wild);
                let value = match is_knots {
                    true => {
                        let at = (0..count).map(|at| at as f64 / (count - 1) as f64);
                        format!("{:?}", at.collect::<Vec<_>>())
                    }
                    false => self.value(of, knots),
                };
                entries.push(format!("{name} = {value}"));
            }
        }
        format!("{{ {} }}", entries.join(", "))
    }

    fn number(&mut self, schema: &Value) -> String {
        if self.draw.chance(self.wild) {
            return self.word(WILD);
        }
        let most = schema["maximum"].as_f64().unwrap_or(10.0);
        let size = match self.draw.chance(0.1) && schema["exclusiveMinimum"].is_null() {
            true => 0.0,
            false => self.draw.log(1e-2 * most, most),
        };
        let signed = schema["minimum"].is_null() && schema["exclusiveMinimum"].is_null();
        let sign = if signed && self.draw.chance(0.5) {
            -1.0
        } else {
            1.0
        };
        format!("{:?}", sign * size)
    }
}

/// Before text within a scenario that is TOML already.
const RAW: char = '\u{1}';

/// A value as TOML.
fn toml(value: &Value) -> String {
    match value {
        Value::Object(entries) => {
            let entries = entries
                .iter()
                .map(|(name, it)| format!("{name} = {}", toml(it)));
            format!("{{ {} }}", entries.collect::<Vec<_>>().join(", "))
        }
        Value::Array(values) => {
            let values: Vec<String> = values.iter().map(toml).collect();
            format!("[{}]", values.join(", "))
        }
        Value::String(text) if text == "inf" => text.clone(),
        Value::String(text) => match text.strip_prefix(RAW) {
            Some(raw) => raw.into(),
            None => value.to_string(),
        },
        _ => value.to_string(),
    }
}

/// All numbers within a value, with their paths.
fn collect_numbers(value: &Value, path: String, into: &mut Vec<(String, f64)>) {
    match value {
        Value::Object(entries) => {
            for (name, inner) in entries {
                let dot = if path.is_empty() { "" } else { "." };
                collect_numbers(inner, format!("{path}{dot}{name}"), into);
            }
        }
        Value::Array(values) => {
            for (at, inner) in values.iter().enumerate() {
                collect_numbers(inner, format!("{path}[{at}]"), into);
            }
        }
        Value::Number(number) => into.extend(number.as_f64().map(|number| (path, number))),
        _ => {}
    }
}

/// Waits for a run, and gives it up if it takes too long.
fn status_of(child: &mut Child, longest: Duration) -> Option<i32> {
    let clock = Instant::now();
    loop {
        match child.try_wait().unwrap() {
            // A process that a signal ended has no status: -1 is documented nowhere.
            Some(status) => return Some(status.code().unwrap_or(-1)),
            None if clock.elapsed() > longest => {
                child.kill().unwrap();
                child.wait().unwrap();
                return None;
            }
            None => sleep(Duration::from_millis(2)),
        }
    }
}

/// How a request ended; `None`: it took too long.
fn run(request: &Request, longest: Duration) -> Option<(Workplace, Run)> {
    let place = Workplace::new();
    place.write("leaf.toml", &request.scenario);
    place.write("other.toml", small_leaf("other", SMALL[0]));
    place.write(
        "data.csv",
        "experiment,load.tip_force[2],tip_z,sd_tip_z\n1,0.1,-0.12,0.01\n2,0.2,-0.1,0.02\n",
    );
    place.write(
        "points.csv",
        "rod,x,y,z,sigma,sd\n1,0.5,0.1,-0.2,0.5,0.01\n1,0.9,-0.1,0.0,1.0,0.01\n",
    );
    let mut command = place.command("");
    let command = command
        .args(&request.arguments)
        .env("RAYON_NUM_THREADS", "1");
    let [out, err] = ["out.txt", "err.txt"].map(|name| fs::File::create(place.path(name)).unwrap());
    let command = command.stdin(Stdio::null()).stdout(out).stderr(err);
    let status = status_of(&mut command.spawn().unwrap(), longest)?;
    let run = Run {
        status: Some(status),
        out: place.read("out.txt"),
        err: place.read("err.txt"),
    };
    Some((place, run))
}

/// The first null or missing number where a leaf is told to be at rest.
fn missing_number(value: &Value) -> Option<String> {
    match value {
        Value::Object(entries) => {
            if value["outcome"] == "converged" {
                // A leaf has one tip or several, and under loads without a potential no energy.
                for name in ["tip", "tips"] {
                    if entries
                        .get(name)
                        .is_some_and(|told| told.is_array() && has_null(told))
                    {
                        return Some(format!("{name} = {}", entries[name]));
                    }
                }
                let energy = entries.get("energy");
                if energy.is_some_and(Value::is_null) && value["negative_eigenvalues"].is_number() {
                    return Some("no energy".into());
                }
            }
            entries.values().find_map(missing_number)
        }
        Value::Array(values) => values.iter().find_map(missing_number),
        _ => None,
    }
}

fn has_null(value: &Value) -> bool {
    match value {
        Value::Null => true,
        Value::Array(values) => values.iter().any(has_null),
        _ => false,
    }
}

/// Files below a folder that are not finished.
fn unfinished(folder: &Path) -> Vec<String> {
    let mut found = Vec::new();
    for entry in fs::read_dir(folder).unwrap().flatten() {
        let name = entry.file_name().into_string().unwrap();
        match entry.path().is_dir() {
            true => found.extend(unfinished(&entry.path())),
            false if name.ends_with(".part") => found.push(name),
            false => {}
        }
    }
    found
}

/// What is wrong with the end of a request.
fn fault(request: &Request, statuses: &[i32], place: &Workplace, run: &Run) -> Option<String> {
    let status = run.status.unwrap_or(-1);
    let said = format!("{}{}", run.out, run.err);
    if said.contains("panicked") {
        return Some("a panic".into());
    }
    if !statuses.contains(&status) {
        return Some(format!("status {status}"));
    }
    if status == 2 && !run.err.lines().any(|line| line.starts_with("error: ")) {
        return Some("refused without a message".into());
    }
    // A refusal repeats what was asked.
    if status != 2 && said.contains("NaN") {
        return Some("no number".into());
    }
    if request.arguments.last().is_some_and(|it| it == "--json") {
        match serde_json::from_str::<Value>(&run.out) {
            Ok(told) => {
                if let Some(missing) = missing_number(&told) {
                    return Some(missing);
                }
            }
            Err(error) => return Some(format!("not JSON: {error}")),
        }
    }
    let unfinished = unfinished(&place.path(""));
    (!unfinished.is_empty()).then(|| format!("unfinished: {}", unfinished.join(" ")))
}

#[test]
fn every_request_ends_as_documented() {
    let verbs = Verb::all(&Workplace::new());
    assert!(verbs.len() >= 7);
    let schema = schema();
    let mut scenarios = Vec::new();
    for folder in fs::read_dir(root().join("scenarios")).unwrap().flatten() {
        for file in fs::read_dir(folder.path()).into_iter().flatten().flatten() {
            if file.path().extension().is_some_and(|end| end == "toml") {
                scenarios.push((file.path(), fs::read_to_string(file.path()).unwrap()));
            }
        }
    }
    scenarios.sort();
    let scenarios: Vec<String> = scenarios.into_iter().map(|(_, text)| text).collect();
    let (count, first) = (
        asked("LEAFDYN_REQUESTS", REQUESTS),
        asked("LEAFDYN_REQUESTS_FROM", 0),
    );
    let longest = LONGEST[usize::from(count > REQUESTS)];
    let ends = (first..first + count).into_par_iter().map(|number| {
        let request = Generator::request(number, &verbs, &scenarios, &schema);
        let Some((place, run)) = run(&request, longest) else {
            return (None, None);
        };
        let verb = verbs
            .iter()
            .find(|verb| verb.name == request.arguments[0])
            .unwrap();
        let fault = fault(&request, &verb.statuses, &place, &run);
        let told = fault.map(|fault| {
            let said: String = format!("{}{}", run.out, run.err)
                .chars()
                .take(1500)
                .collect();
            format!("request {number}: {fault}\n{}{said}", request.shown())
        });
        (run.status, told)
    });
    let ends: Vec<(Option<i32>, Option<String>)> = ends.collect();
    let ended = |status| ends.iter().filter(|(end, _)| *end == status).count();
    let ended = [Some(0), Some(1), Some(2), None].map(ended);
    println!("{ended:?} ended with 0, 1, 2 or not in time");
    let faults: Vec<&String> = ends
        .iter()
        .filter_map(|(_, fault)| fault.as_ref())
        .collect();
    assert!(
        faults.is_empty(),
        "{} faults\n{}",
        faults.len(),
        faults
            .iter()
            .map(|it| it.as_str())
            .collect::<Vec<_>>()
            .join("\n\n")
    );
    // Requests that are all refused would prove little.
    assert!(6 * (ended[0] + ended[1]) >= ended[2], "{ended:?}");
}
