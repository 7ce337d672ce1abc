//! A run that is killed leaves files that are whole, or none. `LEAFDYN_KILLS` is
//! how often each verb is killed.
#![cfg(unix)]

use std::fs;
use std::path::Path;
use std::thread;
use std::time::{Duration, Instant};

use leafdyn_testing::workplace::Workplace;

/// Verbs that write while they run, with what makes them write much.
const RUNS: [&str; 5] = [
    "relax leaf.toml --segments 512",
    "check leaf.toml",
    "map leaf.toml --vary load.gravity[2]=-1..0:12 --methods semi-implicit,shooting",
    "trace leaf.toml --vary load.gravity[2]=-1..0",
    "simulate leaf.toml --set dynamics.output_interval=0.01",
];

/// A file that bears its name is whole; what is not yet written bears another.
fn assert_whole(file: &Path) {
    let bytes = fs::read(file).unwrap();
    let ends = |end: &[u8]| bytes.ends_with(end);
    let extension = file.extension().unwrap_or_default().to_str().unwrap();
    let whole = match extension {
        "json" => serde_json::from_slice::<serde_json::Value>(&bytes).is_ok(),
        "svg" => bytes.starts_with(b"<svg ") && ends(b"</svg>\n"),
        "png" => bytes.len() > 16 && bytes[..bytes.len() - 4].ends_with(b"IEND"),
        // Rows of a map are added as they are found: the next run leaves out the last.
        "csv" if file.ends_with("map.csv") => bytes.starts_with(b"load.gravity[2],method,"),
        "csv" => ends(b"\n"),
        _ => true,
    };
    assert!(whole, "{} of {} bytes", file.display(), bytes.len());
}

#[test]
fn killed_at_any_time_no_file_is_half_written() {
    let kills: u32 = std::env::var("LEAFDYN_KILLS").map_or(6, |kills| kills.parse().unwrap());
    for run in RUNS {
        let place = Workplace::new();
        let clock = Instant::now();
        assert!(place.start(run).wait().unwrap().success(), "{run}");
        let takes = clock.elapsed();
        for kill in 0..kills {
            let mut child = place.start(run);
            // Spread over the run, and more often at its end, where it writes.
            let part = (1.0 - (f64::from(kill) / f64::from(kills)).powi(2)) * 1.1;
            thread::sleep(Duration::from_secs_f64(takes.as_secs_f64() * part));
            let _ = child.kill();
            child.wait().unwrap();
            for name in place.names("out/small") {
                assert_whole(&place.path("out/small").join(name));
            }
        }
        // And what they left is in nobody's way.
        place.run(run).ends(0);
    }
}
