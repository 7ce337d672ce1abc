//! The text report of all equilibria of a leaf.

use crate::report::numbers::power_of_ten;
use crate::study::{All, Found};

use super::numbers::{seconds, veins};
use super::table::{Lines, lay_out};
use super::words::stable_or_index;

/// The equilibria, lowest energy first.
pub fn report(all: &All, files: Option<String>) -> String {
    let leaf = all.found.first();
    let veins = leaf.map_or("a leaf".into(), |found| veins(&found.equilibrium));
    let heading = format!("{}: {veins}, all shapes", all.scenario);
    lay_out(&heading, &lines(all, files))
}

/// The lines of the report.
pub fn lines(all: &All, files: Option<String>) -> Lines {
    let mut lines = Lines::new();
    for (number, found) in all.found.iter().enumerate() {
        let name = if number == 0 { "found" } else { "" };
        lines.push((name, line(number, found)));
    }
    let stable = |found: &&Found| found.equilibrium.stable() == Some(true);
    let stable = all.found.iter().filter(stable).count();
    let others = all.found.len() - stable;
    let failed = match all.failed {
        0 => String::new(),
        failed => format!(", {failed} of them without coming to rest"),
    };
    let (starts, time) = (all.starts, seconds(all.wall_seconds));
    let work = format!(
        "{stable} stable and {others} other equilibria from {starts} starts{failed}, in {time}"
    );
    lines.push(("work", work));
    lines.extend(files.map(|files| ("written", files)));
    lines.extend(all.remark.clone().map(|remark| ("remark", remark)));
    let more = "there may be more: no number of starts proves that these are all";
    lines.push(("remark", more.into()));
    lines
}

fn line(number: usize, found: &Found) -> String {
    let leaf = &found.equilibrium;
    let index = leaf.stability.negative_eigenvalues;
    let stability = index.map_or("of unknown stability".into(), stable_or_index);
    let tip = match &leaf.tips[..] {
        [tip] => format!(", tip ({:.6}, {:.6}, {:.6})", tip.x, tip.y, tip.z),
        _ => String::new(),
    };
    let within = match leaf.accuracy.error_estimate {
        Some(error) => format!(", within {}", power_of_ten(error)),
        None => String::new(),
    };
    let plain = if found.plain {
        ", the plain one among them"
    } else {
        ""
    };
    let starts = match found.starts {
        1 => "1 start".into(),
        starts => format!("{starts} starts"),
    };
    let (number, energy) = (number + 1, leaf.energy.unwrap_or(f64::NAN));
    format!("{number:>2}. energy {energy:.10}: {stability}{tip}{within} ({starts}{plain})")
}
