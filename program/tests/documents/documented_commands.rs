//! The pages say what is so: every command on them runs and prints what stands there, every file and
//! folder that the page on the architecture names is there, and the page on formats lists every key of a
//! scenario once.

use leafdyn::scenario::Key;
use leafdyn_testing::root;
use leafdyn_testing::workplace::program;
use std::collections::HashSet;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::{env, fs};
use tempfile::TempDir;

/// Scripts that run what takes long or needs other programs.
const SCRIPTS: [&str; 3] = ["docs/draw.sh", "benches/measure.sh", "python/test.sh"];

/// The command of which this test is a part.
const TESTS: &str = "cargo test --release";

/// Lines of a report that hold nothing but times and counts of work.
const TIMES: [&str; 2] = ["speed", "work"];

/// A fenced block: its language and its lines.
struct Block {
    language: String,
    lines: Vec<String>,
}

struct Page {
    path: PathBuf,
    blocks: Vec<Block>,
    /// What stands outside the blocks.
    prose: Vec<String>,
}

fn top() -> &'static Path {
    root()
}

fn read(path: &Path) -> Page {
    let (mut blocks, mut prose) = (Vec::<Block>::new(), Vec::new());
    let mut inside = false;
    for line in fs::read_to_string(path).unwrap().lines() {
        match line.strip_prefix("```") {
            Some(language) if !inside => {
                inside = true;
                let (language, lines) = (language.to_owned(), Vec::new());
                blocks.push(Block { language, lines });
            }
            Some(_) => inside = false,
            None if inside => blocks.last_mut().unwrap().lines.push(line.to_owned()),
            None => prose.push(line.to_owned()),
        }
    }
    let path = path.to_owned();
    Page {
        path,
        blocks,
        prose,
    }
}

fn entries(folder: &Path) -> impl Iterator<Item = PathBuf> {
    let entries = fs::read_dir(folder).unwrap();
    entries.map(|entry| entry.unwrap().path())
}

fn pages() -> Vec<Page> {
    let mut paths: Vec<_> = entries(&top().join("docs")).collect();
    paths.retain(|path| path.extension().is_some_and(|extension| extension == "md"));
    paths.push(top().join("README.md"));
    paths.sort();
    paths.iter().map(|path| read(path)).collect()
}

/// Commands of a script or a block: lines joined where they end in a backslash,
/// single spaces, without comments.
fn commands<'a>(lines: impl Iterator<Item = &'a str>) -> Vec<String> {
    let joined = lines.collect::<Vec<_>>().join("\n").replace("\\\n", " ");
    let spaced = |line: &str| line.split_whitespace().collect::<Vec<_>>().join(" ");
    let mut lines: Vec<String> = joined.lines().map(spaced).collect();
    lines.retain(|line| !line.is_empty() && !line.starts_with('#'));
    lines
}

fn of_block(block: &Block) -> Vec<String> {
    commands(block.lines.iter().map(String::as_str))
}

fn of_scripts() -> HashSet<String> {
    let texts = SCRIPTS.map(|script| fs::read_to_string(top().join(script)).unwrap());
    let all = texts.iter().flat_map(|text| commands(text.lines()));
    all.collect()
}

/// What a shell is given to run a command with the program that was built.
fn with_program(command: &str) -> Option<String> {
    let command = command.replace("cargo run --release -- ", "leafdyn ");
    let piped = command.starts_with("cat ") && command.contains(" | leafdyn ");
    (piped || command.starts_with("leafdyn ")).then_some(command)
}

/// A folder with the scenarios that come with the program and those of a page.
fn workplace(page: &Page) -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    let scenarios = folder.path().join("scenarios");
    for kind in entries(&top().join("scenarios")).filter(|kind| kind.is_dir()) {
        let copies = scenarios.join(kind.file_name().unwrap());
        fs::create_dir_all(&copies).unwrap();
        for file in entries(&kind) {
            fs::copy(&file, copies.join(file.file_name().unwrap())).unwrap();
        }
    }
    for block in page.blocks.iter().filter(|block| block.language == "toml") {
        if let Some(name) = block.lines[0].strip_prefix("# ") {
            fs::write(folder.path().join(name), block.lines.join("\n")).unwrap();
        }
    }
    folder
}

/// What a command prints; it must succeed.
fn run(command: &str, folder: &Path) -> String {
    let program = &program();
    let mut path = vec![program.parent().unwrap().to_owned()];
    path.extend(env::split_paths(&env::var_os("PATH").unwrap()));
    let output = Command::new("sh")
        .args(["-c", command])
        .env("PATH", env::join_paths(path).unwrap())
        .current_dir(folder)
        .output()
        .unwrap();
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{command}\n{errors}");
    String::from_utf8(output.stdout).unwrap()
}

/// Whether two words of a report say the same: bounds on errors and the last
/// digits of numbers depend on the processor.
fn agree(shown: &str, printed: &str) -> bool {
    let number = |word: &str| word.trim_matches(['(', ')', ',', ';', ':']).parse::<f64>();
    let bound = |word: &str| word.contains("×10");
    match (number(shown), number(printed)) {
        (Ok(a), Ok(b)) => (a - b).abs() <= 1e-5 * a.abs() + 1e-6,
        _ => shown == printed || bound(shown) && bound(printed),
    }
}

/// Its words, with times left out.
fn words(line: &str) -> Vec<&str> {
    let mut words = Vec::new();
    for word in line.split_whitespace() {
        match word {
            "s" | "ms" | "µs" => drop(words.pop()),
            word => words.push(word),
        }
    }
    words
}

fn assert_same_report(shown: &[String], printed: &str, command: &str) {
    assert_eq!(shown.len(), printed.lines().count(), "{command}\n{printed}");
    for (shown, printed) in shown.iter().zip(printed.lines()) {
        let (a, b) = (words(shown), words(printed));
        let timed = TIMES.contains(&a[0]) && a[0] == b[0];
        let same = a.len() == b.len() && a.iter().zip(&b).all(|(a, b)| agree(a, b));
        let both = format!("shown   {shown}\nprinted {printed}");
        assert!(timed || same, "{command}\n{both}");
    }
}

#[test]
fn every_command_runs_here_or_in_a_script() {
    let scripts = of_scripts();
    for page in pages() {
        let place = page.path.display();
        for block in &page.blocks {
            let known = ["sh", "text", "toml", "python", "rust"];
            let language = block.language.as_str();
            assert!(known.contains(&language), "{place}: {}", block.lines[0]);
            for command in of_block(block) {
                let here = command == TESTS || with_program(&command).is_some();
                let runs = here || scripts.contains(&command);
                assert!(runs || language != "sh", "{place}: {command} runs nowhere");
            }
        }
        let mut prose = page.prose.iter();
        let hidden = prose.find(|line| line.contains("`leafdyn") && line.contains(".toml"));
        let alone = format!("{place}: a command without a block of its own");
        assert_eq!(hidden, None, "{alone}");
    }
}

#[test]
fn quick_commands_print_what_the_pages_show() {
    let scripts = of_scripts();
    let mut compared = 0;
    for page in pages() {
        let folder = workplace(&page);
        for (i, block) in page.blocks.iter().enumerate() {
            if block.language != "sh" {
                continue;
            }
            let commands = of_block(block);
            let next = page.blocks.get(i + 1);
            let shown = next.filter(|next| next.language == "text" && commands.len() == 1);
            for command in &commands {
                let elsewhere = shown.is_none() && scripts.contains(command);
                let Some(runnable) = with_program(command).filter(|_| !elsewhere) else {
                    continue;
                };
                let printed = run(&runnable, folder.path());
                if let Some(shown) = shown {
                    assert_same_report(&shown.lines, &printed, command);
                    compared += 1;
                }
            }
        }
    }
    assert!(compared >= 8, "only {compared} reports were compared");
}

/// The name by which a heading is linked to.
fn anchor(heading: &str) -> String {
    let kept = heading.trim_start_matches('#').trim().to_lowercase();
    kept.chars()
        .filter(|c| c.is_alphanumeric() || "-_ ".contains(*c))
        .map(|c| if c == ' ' { '-' } else { c })
        .collect()
}

#[test]
fn links_lead_to_files_and_headings() {
    for page in pages() {
        let text = page.prose.join("\n");
        for link in text.split("](").skip(1) {
            let link = link.split(')').next().unwrap();
            if link.starts_with("http") {
                continue;
            }
            let (file, heading) = link.split_once('#').unwrap_or((link, ""));
            let target = match file {
                "" => page.path.clone(),
                file => page.path.parent().unwrap().join(file),
            };
            let place = page.path.display();
            assert!(target.exists(), "{place}: {link}");
            if !heading.is_empty() {
                let mut lines = read(&target).prose.into_iter();
                let found = lines.any(|line| line.starts_with('#') && anchor(&line) == heading);
                assert!(found, "{place}: {link}");
            }
        }
    }
}

/// Where a path on the page begins.
const ROOMS: [&str; 6] = ["src/", "program/", "python/", "web/", "tests/", "benches/"];

#[test]
fn every_path_on_the_page_exists() {
    let page = fs::read_to_string(root().join("docs/architecture.md")).unwrap();
    let quoted = page.split('`').skip(1).step_by(2);
    let paths: Vec<&str> = quoted
        .filter(|it| ROOMS.iter().any(|room| it.starts_with(room)))
        .collect();
    assert!(paths.len() > 40, "{paths:?}");
    for path in paths {
        assert!(root().join(path).exists(), "{path} is no file or folder");
    }
}

#[test]
fn ten_questions_are_answered_by_files() {
    let page = fs::read_to_string(root().join("docs/architecture.md")).unwrap();
    let (_, section) = page.split_once("\n## Where is ...?\n").unwrap();
    let (section, _) = section.split_once("\n## ").unwrap();
    let answers: Vec<&str> = section
        .lines()
        .filter(|line| line.starts_with("- "))
        .collect();
    assert!(answers.len() >= 10, "{answers:?}");
    for answer in answers {
        assert!(answer.contains(".rs`"), "{answer}");
    }
}

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
