//! Leaves as people measure them. `cargo bench --bench real_leaves -- write
//! FOLDER COUNT [FIRST]` writes them as scenarios.

#[path = "../tests/common/real.rs"]
#[allow(dead_code)]
mod real;

use std::fs;
use std::path::Path;

fn main() {
    let arguments: Vec<String> = std::env::args()
        .skip(1)
        .filter(|a| a != "--bench")
        .collect();
    let words: Vec<&str> = arguments.iter().map(String::as_str).collect();
    match words[..] {
        ["write", folder, count] => write(Path::new(folder), number(count), 0),
        ["write", folder, count, first] => write(Path::new(folder), number(count), number(first)),
        _ => panic!("expected: write FOLDER COUNT [FIRST]"),
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
