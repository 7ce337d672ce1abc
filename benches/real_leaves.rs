//! Time to relax leaves as people measure them to 1e-6, without eigenvalues and
//! on one thread; beside them single leaves, Fig. 4's among them, in the same
//! run. `cargo bench --bench real_leaves -- [COUNT [FIRST]]`: so many leaves, of
//! the seeds from the first one on.
//! `cargo bench --bench real_leaves -- write FOLDER COUNT [FIRST]` writes them
//! as scenarios instead.

use std::fs;
use std::path::Path;
use std::time::{Duration, Instant};

use leafdyn::relax::{Equilibrium, Options, relax};
use leafdyn::scenario::Scenario;
use leafdyn_testing::bench::{figure, on_one_thread, print_head, to};
use leafdyn_testing::real;

/// A leaf is relaxed again and again for so long; its fastest run counts.
const LEAST: Duration = Duration::from_millis(20);

const LEAVES: u64 = 100;

fn main() {
    let arguments = std::env::args()
        .skip(1)
        .filter(|argument| argument != "--bench");
    let arguments: Vec<String> = arguments.collect();
    let words: Vec<&str> = arguments.iter().map(String::as_str).collect();
    match words[..] {
        [] => measure(LEAVES, 0),
        ["write", folder, count] => write(Path::new(folder), number(count), 0),
        ["write", folder, count, first] => write(Path::new(folder), number(count), number(first)),
        [count] => measure(number(count), 0),
        [count, first] => measure(number(count), number(first)),
        _ => panic!("expected: [COUNT [FIRST]], or write FOLDER COUNT [FIRST]"),
    }
}

fn number(text: &str) -> u64 {
    text.parse().expect("a whole number")
}

fn write(folder: &Path, count: u64, first: u64) {
    fs::create_dir_all(folder).expect("the folder can be made");
    for seed in first..first + count {
        let file = folder.join(format!("real-{seed}.toml"));
        fs::write(file, real::leaf(seed)).expect("the file can be written");
    }
}

fn measure(count: u64, first: u64) {
    on_one_thread();
    println!("Milliseconds and matrices factorised of leaves to 1e-6, without eigenvalues, and");
    println!("how many have a remark or a doubt, are not at rest, or unstable:\n");
    print_head(
        "leaf | median | 90 % | 99 % | most | factorisations, median | most | remark | not at rest | unstable",
    );
    let parse = |text: &str| Scenario::from_toml(text).expect("the scenario is valid");
    let seeds = first..first + count;
    let leaves: Vec<Scenario> = seeds.map(|seed| parse(&real::leaf(seed))).collect();
    print_row(&format!("{count} real ones"), &leaves);
    let measured = |name: &str| {
        let file = format!(
            "{}/scenarios/measured/{name}.toml",
            env!("CARGO_MANIFEST_DIR")
        );
        Scenario::read(Path::new(&file)).expect("the scenario is valid")
    };
    let singles = [
        ("the lily of README", measured("lily")),
        ("`measured/grass`", measured("grass")),
        ("`measured/orchid`", measured("orchid")),
        (
            "`my-leaf`",
            parse(include_str!("../tests/data/my-leaf.toml")),
        ),
        (
            "`leafdyn new leaf`",
            parse(include_str!("../program/src/verbs/examples/leaf.toml")),
        ),
        ("Fig. 4, N = 5", figure("fig04", 5)),
        ("Fig. 4, N = 21", figure("fig04", 21)),
    ];
    for (name, leaf) in singles {
        print_row(name, &[leaf]);
    }
}

/// The fastest of the runs that take [`LEAST`] together.
fn relaxed(leaf: &Scenario) -> Equilibrium {
    let clock = Instant::now();
    let options: Options = to(1e-6);
    let run = || relax(leaf, &options, &mut |_| {}).expect("a valid request");
    let mut best = run();
    while clock.elapsed() < LEAST {
        let next = run();
        if next.wall_seconds < best.wall_seconds {
            best = next;
        }
    }
    best
}

fn print_row(name: &str, leaves: &[Scenario]) {
    let found: Vec<Equilibrium> = leaves.iter().map(relaxed).collect();
    let sorted = |value: fn(&Equilibrium) -> f64| {
        let mut values: Vec<f64> = found.iter().map(value).collect();
        values.sort_by(f64::total_cmp);
        values
    };
    let milliseconds = sorted(|leaf| 1e3 * leaf.wall_seconds);
    let factorisations = sorted(|leaf| leaf.work.factorizations as f64);
    let times = [0.5, 0.9, 0.99, 1.0].map(|part| digits(quantile(&milliseconds, part)));
    let work = [0.5, 1.0].map(|part| format!("{:.0}", quantile(&factorisations, part)));
    let count = |which: fn(&Equilibrium) -> bool| {
        found.iter().filter(|leaf| which(leaf)).count().to_string()
    };
    let remarks = count(|leaf| leaf.remark.is_some() || !leaf.doubts.is_empty());
    let moving = count(|leaf| !leaf.outcome.is_success());
    let unstable = count(|leaf| leaf.stable() == Some(false));
    let cells = [&times[..], &work, &[remarks, moving, unstable]].concat();
    println!("| {name} | {} |", cells.join(" | "));
}

/// The smallest of some ascending values that is not exceeded by this part of them.
fn quantile(ascending: &[f64], part: f64) -> f64 {
    let count = (part * ascending.len() as f64).ceil() as usize;
    ascending.get(count.max(1) - 1).copied().unwrap_or(f64::NAN)
}

/// Three significant digits of a time.
fn digits(milliseconds: f64) -> String {
    let places = (2.0 - milliseconds.log10().floor()).clamp(0.0, 3.0) as usize;
    format!("{milliseconds:.places$}")
}
