//! The first minute with the program: examples, help, the schema, and what shells and manuals know.

use leafdyn::scenario::{Scenario, Value as Toml, schema};
use leafdyn_testing::root;
use leafdyn_testing::workplace::{Workplace, contains, pairs};
use serde_json::Value;
use std::fs;
use std::path::Path;
use std::process::Command;

#[test]
fn every_example_does_what_its_last_line_says() {
    let place = Workplace::empty();
    for example in ["leaf", "rod", "pull-test", "motion"] {
        let said = place.run(format!("new {example}")).ends(0).out;
        let next = said.lines().last().unwrap().trim();
        place.run(next.strip_prefix("leafdyn ").unwrap()).ends(0);
    }
}

/// From a clone to a leaf that turns in a browser, as the README says it.
#[test]
fn the_way_of_a_newcomer_is_short_and_leads_to_a_page() {
    let readme = root().join("README.md");
    let readme = fs::read_to_string(readme).unwrap();
    let (_, way) = readme.split_once("## A leaf of your own").unwrap();
    let (way, _) = way.split_once("Or write it yourself").unwrap();
    let blocks = way.split("```sh\n").skip(1);
    let commands: Vec<&str> = (blocks.flat_map(|block| block.split("```").next()))
        .flat_map(str::lines)
        .collect();
    // With those that clone the repository and enter it.
    assert!(2 + commands.len() <= 5, "{commands:?}");
    let (install, own) = commands.split_first().unwrap();
    assert_eq!(*install, "cargo install --path program");
    let place = Workplace::empty();
    for command in own {
        place.run(command.strip_prefix("leafdyn ").unwrap()).ends(0);
    }
    contains(way, &["Open `out/leaf/view.html` in a browser"]);
    let page = place.read("out/leaf/view.html");
    assert!(page.contains("<canvas id=\"space\"") && page.ends_with("</html>\n"));
}

#[test]
fn what_is_there_is_not_replaced() {
    let place = Workplace::empty();
    place.write("mine.toml", "mine");
    place.refuses("new rod mine.toml", "mine.toml: is there already");
    assert_eq!(place.read("mine.toml"), "mine");
    // On a full disk there is no part of it.
    if cfg!(unix) {
        let full = place.command("new rod part.toml");
        let script = "trap '' XFSZ; ulimit -f 0; exec \"$0\" new rod part.toml";
        let mut shell = Command::new("sh");
        let shell = shell.args(["-c", script]).arg(full.get_program());
        let run = shell.current_dir(place.path(".")).output().unwrap();
        assert_eq!(run.status.code(), Some(2));
        assert_eq!(place.names("."), ["mine.toml"]);
    }
}

/// Whatever its name contains, nothing of it reaches the terminal as a command.
#[test]
fn a_name_is_only_shown() {
    let run = Workplace::empty().run("new rod \u{1b}[31mred.toml").ends(0);
    assert!(!run.out.contains('\u{1b}'), "{:?}", run.out);
    run.says(&["[31mred.toml: written"]);
}

#[test]
fn without_a_scenario_one_is_offered() {
    for verb in ["relax", "simulate", "check"] {
        let run = Workplace::empty().run(verb).ends(2);
        contains(&run.err, &["<SCENARIO>", "leafdyn new leaf"]);
    }
    // Not where another argument is missing, though the usage names the scenario.
    let run = Workplace::empty().run("fit leaf.toml --data a.csv").ends(2);
    contains(&run.err, &["--free"]);
    assert!(!run.err.contains("leafdyn new leaf"), "{}", run.err);
}

#[test]
fn shells_and_manuals_know_every_verb() {
    let place = Workplace::empty();
    for shell in ["bash", "zsh", "fish"] {
        let run = place.run(format!("completions {shell}")).ends(0);
        run.says(&["relax", "keep-unstable"]);
    }
    place.run("man").ends(0).says(&["simulate"]);
    let manual = place.run("man relax").ends(0).out;
    contains(&manual.replace("\\-", "-"), &[".TH leafdyn-relax"]);
    place.run("man dance").ends(2);
}

/// What the schema refuses of a scenario: unknown keys and wrong types.
fn refused(schema: &Value, value: &Value, path: &str) -> Vec<String> {
    let unless = |fits: bool, what: String| Vec::from_iter((!fits).then_some(what));
    if let Some(alternatives) = schema["anyOf"].as_array() {
        let fits = |one: &Value| refused(one, value, path).is_empty();
        return unless(
            alternatives.iter().any(fits),
            format!("{path}: fits nothing"),
        );
    }
    if let Some(words) = schema["enum"].as_array() {
        return unless(words.contains(value), format!("{path}: no such word"));
    }
    let fits = match schema["type"].as_str() {
        Some("object") => value.is_object(),
        Some("array") => value.is_array(),
        Some("string") => value.is_string(),
        Some("boolean") => value.is_boolean(),
        Some("integer") => value.is_u64(),
        Some("number") => value.is_number(),
        _ => false,
    };
    let mut wrong = unless(fits, format!("{path}: {value} is no {}", schema["type"]));
    for (key, value) in value.as_object().into_iter().flatten() {
        match schema["properties"].get(key) {
            Some(schema) => wrong.extend(refused(schema, value, &format!("{path}.{key}"))),
            None => wrong.push(format!("{path}.{key}: unknown")),
        }
    }
    for value in value.as_array().into_iter().flatten() {
        wrong.extend(refused(&schema["items"], value, path));
    }
    for required in schema["required"].as_array().into_iter().flatten() {
        if value.get(required.as_str().unwrap()).is_none() {
            wrong.push(format!("{path}: {required} is missing"));
        }
    }
    wrong
}

/// TOML as JSON, in which `inf` is a number.
fn json(value: Toml) -> Value {
    match value {
        Toml::Float(number) => Value::from(if number.is_finite() { number } else { 1e300 }),
        Toml::Array(list) => list.into_iter().map(json).collect(),
        Toml::Table(table) => {
            let entries = table.into_iter().map(|(key, value)| (key, json(value)));
            Value::Object(entries.collect())
        }
        other => serde_json::to_value(other).unwrap(),
    }
}

fn scenarios(folder: &Path) -> Vec<String> {
    let entries = fs::read_dir(folder).unwrap();
    let all = entries.map(|entry| entry.unwrap().path());
    let texts = all.flat_map(|path| match path.extension() {
        _ if path.is_dir() => scenarios(&path),
        Some(kind) if kind == "toml" => vec![fs::read_to_string(&path).unwrap()],
        _ => Vec::new(),
    });
    texts.collect()
}

#[test]
fn the_schema_fits_every_scenario_and_no_slip() {
    let schema = schema();
    let top = root();
    let texts = ["scenarios", "program/src/verbs/examples"].map(|it| scenarios(&top.join(it)));
    let texts = texts.concat();
    assert!(texts.len() > 30);
    let judge = |text: &str| {
        let scenario = json(Toml::Table(text.parse().unwrap()));
        refused(&schema, &scenario, "")
    };
    for text in &texts {
        assert_eq!(judge(text), Vec::<String>::new(), "{text}");
    }
    let good = include_str!("../../src/verbs/examples/rod.toml");
    for (from, to) in [
        ("rods = 1", "rod = 1"),
        ("rods = 1", "rods = 1.5"),
        ("[load]", "[loads]"),
        ("fan = [0.0]", "fan = \"round\""),
        ("torsion = 1.0", "torsion = \"stiff\""),
        ("gravity = [0.0, 0.0, 0.0]", "gravity = 1.0"),
    ] {
        let slip = good.replacen(from, to, 1);
        assert!(slip != good && Scenario::from_toml(&slip).is_err());
        assert!(!judge(&slip).is_empty(), "{to}");
    }
}

const OPTIONS: &str = "
    relax => --method --segments --tolerance --set --out --json --keep-unstable --modes semi-implicit
    check => --tolerance --set --out --json --intervals --keep-unstable
    simulate => --tolerance --set --out --json --method explicit semi-implicit --segments --step
    chart => --seconds --methods --peers --rods --tolerance --set --out --json shooting-from-rest
    map => --vary --methods --cell-seconds --show --tolerance --set --out --json
    trace => --vary --switch --until --keep-unstable --segments --points --tolerance --set --out --json
";

const STATUSES: &str = "
    check => 0 both methods agree; 1 they differ or could not be compared; 2 the request was refused
    simulate => 0 followed to its end; 1 ended early; 2 the request was refused; 130 stopped by Ctrl-C
    chart => 0 charted; do not confirm the reference; 2 the request was refused
    map => 0 the map is made; 2 the request was refused
    trace => 0 all branches; 2 the request
";

#[test]
fn names_every_option_and_exit_status() {
    for (table, between) in [(OPTIONS, " "), (STATUSES, "; ")] {
        for (verb, parts) in pairs(table) {
            let run = Workplace::new().ok(format!("{verb} --help"));
            let help: Vec<&str> = run.out.split_whitespace().collect();
            let parts: Vec<&str> = parts.split(between).collect();
            contains(&help.join(" "), &parts);
        }
    }
}
