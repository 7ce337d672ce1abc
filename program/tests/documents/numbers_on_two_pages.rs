//! A number that stands on two pages, or on a page and in the code, is the same in both,
//! to the digits of the one with fewer.

use leafdyn_testing::root;
use std::fs;

/// Two places of one number: each a file, and the words around the number, which is `{}`.
type Places = [(&'static str, &'static str); 2];

const SAME: [Places; 29] = [
    // What it takes.
    [
        ("README.md", "10,000 veins, which takes {} s"),
        ("docs/speed.md", "| 10,000 | {} |"),
    ],
    [
        ("README.md", "each vein takes {} times as long"),
        ("docs/speed.md", "| 0.5700 | 2.38 | {} |"),
    ],
    [
        ("docs/methods.md", "take {} factorisations in the median"),
        (
            "docs/speed.md",
            "| 100 real ones | 1.90 | 5.03 | 33.8 | 87.7 | {} |",
        ),
    ],
    [
        ("Cargo.toml", "rust-version = \"{}\""),
        ("README.md", "[Rust](https://rustup.rs) {} or newer"),
    ],
    [
        ("Cargo.toml", "rust-version = \"{}\""),
        ("docs/python.md", "[Rust](https://rustup.rs) {} or newer"),
    ],
    // What other programs take.
    [
        ("README.md", "N = 5 | 5.5e-6 | {} ms | 0.09 ms |"),
        ("docs/speed.md", "`tol=1e-3` | 5.5e-6 | {} ms |"),
    ],
    [
        ("README.md", "N = 5 | 5.5e-6 | 198 ms | 0.09 ms | {} |"),
        (
            "docs/speed.md",
            "| 5.0e-6 | 0.09 ms | {} | | 5 | `solve_bvp` | `tol=1e-4`",
        ),
    ],
    [
        ("README.md", "N = 5 | 1.9e-12 | {} s | 0.61 ms |"),
        ("docs/speed.md", "`tol=1e-8` | 1.9e-12 | {} s |"),
    ],
    [
        ("README.md", "N = 35 | 1.3e-6 | {} s | 0.60 ms |"),
        ("docs/speed.md", "`tol=1e-3` | 1.3e-6 | {} s |"),
    ],
    [
        (
            "README.md",
            "40 elements a rod | 3.7e-5 | {} ms | 0.09 ms |",
        ),
        ("docs/speed.md", "`n=40` | 3.7e-5 | {} ms |"),
    ],
    [
        (
            "README.md",
            "50 elements a rod | 3.1e-5 | {} ms | 0.50 ms |",
        ),
        ("docs/speed.md", "`n=50` | 3.1e-5 | {} ms |"),
    ],
    [
        (
            "README.md",
            "40 elements a rod | 6.7e-3 | {} ms | 0.06 ms |",
        ),
        ("docs/speed.md", "`n=40` | 6.7e-3 | {} ms |"),
    ],
    // Limits of the program.
    [
        (
            "src/motion/explicit/mod.rs",
            "PARALLEL_SEGMENTS: usize = {};",
        ),
        ("docs/command-line.md", "in leaves of {} segments and more"),
    ],
    [
        (
            "src/motion/explicit/mod.rs",
            "PARALLEL_SEGMENTS: usize = {};",
        ),
        ("docs/speed.md", "From {} segments on, rods are shared"),
    ],
    [
        ("src/leaf/system/mod.rs", "PARALLEL_NODES: usize = {};"),
        ("docs/command-line.md", "in leaves of {} nodes"),
    ],
    [
        ("src/study/trace/mod.rs", "MOST_POINTS: usize = {};"),
        (
            "docs/command-line.md",
            "number of points of a branch; default {} |",
        ),
    ],
    [
        ("src/study/trace/mod.rs", "MOST_BRANCHES: usize = {};"),
        (
            "docs/command-line.md",
            "that cross these, at most {} in all",
        ),
    ],
    [
        ("src/study/equilibria.rs", "IN_VAIN: usize = {};"),
        ("docs/command-line.md", "ends when {} consecutive starts"),
    ],
    [
        ("docs/command-line.md", "at most {} instants of a motion"),
        (
            "docs/formats.md",
            "instants of a motion, at most {} of them",
        ),
    ],
    // What was found.
    [
        ("docs/command-line.md", "equilibria from {} starts"),
        ("docs/tried.md", "[{} starts](command-line.md"),
    ],
    [
        ("README.md", "saddle with {} unstable directions"),
        ("docs/undulation.md", "| Fig. 10, N = 5 | {} |"),
    ],
    [
        (
            "docs/methods.md",
            "with 5 veins is a saddle with {} negative",
        ),
        ("docs/undulation.md", "| Fig. 10, N = 5 | {} |"),
    ],
    [
        ("docs/methods.md", "instead of rising to [{}]"),
        ("docs/undulation.md", "folded up: z = {},"),
    ],
    [
        ("docs/methods.md", "snaps at 16 % of joining; {},"),
        ("docs/undulation.md", "1 wave 0.046 high | z = {},"),
    ],
    [
        ("docs/methods.md", "snaps four times; {},"),
        ("docs/undulation.md", "1 wave 0.044 high | z = {},"),
    ],
    [
        ("docs/methods.md", "stable throughout; {}, 5.778"),
        (
            "docs/undulation.md",
            "droops: z = -0.231, 1 wave 0.007 high | z = {},",
        ),
    ],
    [
        ("docs/methods.md", "loads first {} of them are stable"),
        ("docs/tried.md", "loads first, then tips along arcs | {} |"),
    ],
    [
        ("docs/how-to-read.md", "[one of {}](tried.md"),
        ("docs/tried.md", "softest vein | {} | 1:"),
    ],
    [
        ("docs/methods.md", "(a plate of nine strips takes {})"),
        ("docs/tried.md", "where the mixed form takes {}."),
    ],
];

/// A text with single spaces, as lines may break anywhere.
fn spaced(file: &str) -> String {
    let text = fs::read_to_string(root().join(file)).unwrap();
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}

fn is_numeral(c: char) -> bool {
    c.is_ascii_digit() || ".,-_".contains(c)
}

/// The numeral between the words, which stand once in the file.
fn numeral((file, words): (&str, &str)) -> String {
    let (before, after) = words.split_once("{}").unwrap();
    let text = spaced(file);
    let rests = text
        .match_indices(before)
        .map(|(at, _)| &text[at + before.len()..]);
    let found = rests.filter_map(|rest| {
        let end = rest.find(|c| !is_numeral(c)).unwrap_or(rest.len());
        // What follows may begin with a comma or a point.
        let numeral = rest[..end].trim_end_matches(['.', ',']);
        let stands = !numeral.is_empty() && rest[numeral.len()..].starts_with(after);
        stands.then(|| numeral.replace([',', '_'], ""))
    });
    let found: Vec<String> = found.collect();
    assert_eq!(
        found.len(),
        1,
        "{file}: “{words}” stands {} times",
        found.len()
    );
    found[0].clone()
}

/// A unit of the last digit.
fn unit(numeral: &str) -> f64 {
    let decimals = numeral
        .split_once('.')
        .map_or(0, |(_, decimals)| decimals.len());
    0.1_f64.powi(decimals as i32)
}

fn agree(a: &str, b: &str) -> bool {
    let value = |numeral: &str| numeral.parse::<f64>().unwrap();
    (value(a) - value(b)).abs() <= 0.5 * unit(a).max(unit(b)) * (1.0 + 1e-9)
}

#[test]
fn they_are_the_same() {
    for [one, other] in SAME {
        let (a, b) = (numeral(one), numeral(other));
        assert!(agree(&a, &b), "{}: {a}; {}: {b}", one.0, other.0);
    }
}

#[test]
fn fewer_digits_agree_and_others_do_not() {
    assert!(agree("0.57", "0.5700") && agree("2.3", "2.33") && agree("-0.833", "-0.833"));
    assert!(!agree("0.64", "0.5700") && !agree("2.4", "2.33") && !agree("1000", "3000"));
}
