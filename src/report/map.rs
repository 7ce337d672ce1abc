//! The text report of a map.

use std::fmt::Write;

use crate::study::{Map, MapOutcome};

use super::numbers::{brief, seconds};
use super::table::{labelled, lay_out};
use super::words::map_shows;

/// Most jumps that are listed.
const JUMPS: usize = 5;

/// The work done for a map.
#[derive(Clone, Copy)]
pub struct Work {
    /// Rows that were known before.
    pub known: usize,
    /// Rows that were computed.
    pub computed: usize,
    /// Total time.
    pub seconds: f64,
}

/// The varied numbers, the work, and how often each method had each outcome.
pub fn report(map: &Map, work: Work, files: Option<String>) -> String {
    let request = &map.request;
    let mut lines: Vec<(&str, String)> = Vec::new();
    for axis in &request.axes {
        let ends = [axis.values.first(), axis.values.last()];
        let [from, to] = ends.map(|end| end.map_or(String::new(), |&v| axis.keys.text(v)));
        let spacing = if axis.log { ", logarithmic" } else { "" };
        let count = axis.values.len();
        let text = format!("{} from {from} to {to}: {count} values{spacing}", axis.keys);
        lines.push(("vary", text));
    }
    let (known, confirmed) = map.known_and_confirmed();
    let cells = request.cells();
    let cells = format!("{known} of {cells}, reference confirmed in {confirmed}");
    lines.push(("cells", cells));
    let (known, computed, time) = (work.known, work.computed, seconds(work.seconds));
    let rows = format!("{known} were there, {computed} computed in {time}");
    lines.push(("rows", rows));
    lines.extend(labelled("found", counts(map)));
    lines.extend(labelled("jumps", jumps(map)));
    lines.extend(files.map(|files| ("written", files)));
    let (name, what) = (&request.base.scenario().name, map_shows(map.show));
    lay_out(&format!("{name}: {what}"), &lines)
}

/// The first few pairs of cells between which the leaf jumps to another equilibrium.
fn jumps(map: &Map) -> Vec<String> {
    let all = map.jumps.as_deref().unwrap_or_default();
    let mut lines: Vec<String> = (all.iter().take(JUMPS))
        .map(|jump| {
            let (from, to) = (jump.from.join(", "), jump.to.join(", "));
            let key = &jump.key;
            let between = jump.between.map(brief).join(" and ");
            format!("from cell {from} to {to} to another equilibrium: {key} between {between}")
        })
        .collect();
    if all.len() > JUMPS {
        lines.push(format!("and {} more: map.json has all", all.len() - JUMPS));
    }
    lines
}

/// A table with the outcomes that occur.
fn counts(map: &Map) -> Vec<String> {
    let outcomes: Vec<MapOutcome> = (MapOutcome::ALL.into_iter())
        .filter(|&outcome| map.rows.iter().any(|row| row.outcome == outcome))
        .collect();
    let mut lines = vec![format!("{:<18}", "")];
    for outcome in &outcomes {
        // Writing to a string cannot fail.
        let _ = write!(lines[0], "  {outcome}");
    }
    for &method in &map.request.methods {
        let mut line = format!("{:<18}", method.word());
        for &outcome in &outcomes {
            let count = match map.count(method, outcome) {
                0 => "-".into(),
                count => count.to_string(),
            };
            let _ = write!(line, "  {count:>0$}", outcome.word().len());
        }
        lines.push(line);
    }
    lines
}
