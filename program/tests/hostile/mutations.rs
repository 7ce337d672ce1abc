//! Scenarios and tables that are changed at random: each is accepted or refused in one
//! message, none ends in a panic or runs on. `LEAFDYN_MUTATIONS` asks for so many times as many.

#[path = "../../../fuzz/bodies.rs"]
mod bodies;

use std::fs;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::time::{Duration, Instant};

use leafdyn::scenario::Scenario;
use leafdyn_testing::root;
use proptest::prelude::*;
use proptest::strategy::ValueTree;
use proptest::test_runner::{Config, RngSeed, TestRunner};

/// What is put in place of something, or between.
const WORDS: &str = "nan inf -inf 1e308 -1e308 1e-320 0 -1 1e9 1e-9 3 100000 99999999999999999999 \
    -9223372036854775808 true [ ] { } [[]] \" ' \n \r = .. : , . # \0 \u{1b}[2J ä \u{feff} log +";

fn words() -> Vec<&'static str> {
    WORDS.split(' ').collect()
}

/// How a text is changed: where it begins, how much goes, and what comes.
type Change = (f64, usize, Option<usize>);

fn changes() -> impl Strategy<Value = Vec<Change>> {
    let word = prop::option::of(0..words().len());
    prop::collection::vec((0.0..1.0, 0..12_usize, word), 1..5)
}

fn changed(text: &str, changes: &[Change]) -> String {
    let mut text: Vec<char> = text.chars().collect();
    for &(part, length, word) in changes {
        let mut at = (part * text.len() as f64) as usize;
        let mut end = (at + length).min(text.len());
        let numeric = |c: char| c.is_ascii_digit() || "+-.e".contains(c);
        if let (Some(_), Some(first)) = (word, text[at..].iter().position(|c| c.is_ascii_digit())) {
            // Most often a number becomes another.
            if length % 4 != 0 {
                at += first;
                let rest = text[at..].iter();
                end = at + rest.take_while(|c| numeric(**c)).count();
            }
        }
        let word = word.map_or("", |word| words()[word]);
        text.splice(at..end, word.chars());
    }
    text.into_iter().collect()
}

/// So many times as many cases as usual.
fn times() -> u32 {
    let asked = std::env::var("LEAFDYN_MUTATIONS").ok();
    asked.and_then(|asked| asked.parse().ok()).unwrap_or(1)
}

/// Changes a text again and again, always in the same ways or, if more than usual
/// is asked for, in new ones; what panics or takes a minute is shown and kept in
/// the folder for temporary files.
fn each(what: &str, text: &str, cases: u32, check: impl Fn(&[u8])) {
    let seed = match times() {
        1 => RngSeed::Fixed(1),
        _ => RngSeed::Random,
    };
    let mut config = Config::with_cases(1);
    config.rng_seed = seed;
    let mut runner = TestRunner::new(config);
    for _ in 0..cases * times() {
        let drawn = changes().new_tree(&mut runner).unwrap().current();
        let text = changed(text, &drawn);
        let clock = Instant::now();
        let found = catch_unwind(AssertUnwindSafe(|| check(text.as_bytes())));
        if found.is_err() || clock.elapsed() > Duration::from_secs(60) {
            let file = std::env::temp_dir().join(format!("leafdyn-{what}"));
            fs::write(&file, &text).unwrap();
            panic!("{}: {found:?} after {:?}", file.display(), clock.elapsed());
        }
    }
}

#[test]
fn scenarios() {
    each("scenario.toml", bodies::LEAF, 150, bodies::scenario);
}

/// More of them, which are only read.
#[test]
fn scenario_texts() {
    let read = |text: &[u8]| match Scenario::from_toml(std::str::from_utf8(text).unwrap()) {
        Ok(leaf) => assert!(leaf.coupling.len() + 1 == leaf.rods.len()),
        Err(error) => assert!(error.to_string().starts_with("scenario:")),
    };
    each("read.toml", bodies::LEAF, 4000, read);
}

/// Entries replaced, and numbers that vary, as they are typed.
#[test]
fn overrides_and_ranges() {
    let all = "load.gravity=[0,0,-0.5]|leaf.rods=3|method.segments=16|\
        stiffness.bending_2={ at = [0.0, 1.0], value = [1.0, 0.1] }|\
        stiffness.bending_2=1..1e-5:12log|load.gravity[2]=-1..0:3|coupling.z[0]+coupling.y=0..1|\
        leaf.rods=1..40:6log|method.segments=8..64:2log";
    for typed in all.split('|') {
        each("typed", typed, 100, bodies::typed);
    }
}

#[test]
fn tables_of_peers() {
    let table = "program,scenario,rods,knob,seconds,error,outcome\n\
                 solve_bvp,small,5,tol=0.001,0.2671,5.487e-06,converged\n\
                 \"exudyn, static\",small,5,n=20,0.06,,failed\n";
    each("peers.csv", table, 300, bodies::peers);
}

#[test]
fn measured_data() {
    let loads = "experiment,load.tip_force[2],tip_z,sd_tip_z\n1,0.0,-0.12,0.01\n2,0.2,-0.1,0.02\n";
    let traced = "rod,x,y,z,sigma,sd\n1,0.5,0.1,-0.2,0.5,0.01\n2,0.9,-0.1,0.0,,0.01\n";
    for text in [loads, traced] {
        each("data.csv", text, 300, bodies::measurements);
    }
}

/// Seeds and finds of the fuzz targets.
#[test]
fn points_that_are_changed_at_random() {
    for (_, seed) in bodies::contents(&root().join("fuzz/corpus/points")) {
        let text = String::from_utf8(seed).unwrap();
        each("points.csv", &text, 100, bodies::points);
    }
}

#[test]
fn the_corpus_of_the_fuzz_targets() {
    let corpus = root().join("fuzz/corpus");
    type Body = fn(&[u8]);
    let bodies: [(&str, Body); 5] = [
        ("scenario", bodies::scenario),
        ("typed", bodies::typed),
        ("peers", bodies::peers),
        ("measurements", bodies::measurements),
        ("points", bodies::points),
    ];
    for (target, body) in bodies {
        let inputs = bodies::contents(&corpus.join(target));
        assert!(!inputs.is_empty(), "{target}");
        inputs.iter().for_each(|(_, data)| body(data));
    }
}
