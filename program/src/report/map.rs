//! A map as text, and its rows as CSV.

use crate::report::numbers::{brief, in_unit, in_unit_of_key, seconds};
use crate::report::table::{Lines, append_csv, labelled, text_cell};
use crate::report::{Reported, map_shows};
use leafdyn::scenario::Units;
use leafdyn::study::{Map, MapOutcome, MapRow};
use std::fmt::Write as _;
use std::io;
use std::io::Write;

/// The columns after those of the varied keys.
const COLUMNS: &str = "method,outcome,detail,index,tip_x,tip_y,tip_z,energy,error,\
    error_estimate,margin_waves,margin_amplitude,twist,seconds,reference";

/// Most jumps that are listed.
const JUMPS: usize = 5;

/// A map, and the work that was done for it.
pub struct MapWork<'m> {
    pub map: &'m Map,
    /// Total time.
    pub seconds: f64,
}

impl Reported for MapWork<'_> {
    fn heading(&self) -> String {
        let name = &self.map.request.base.scenario().name;
        format!("{name}: {}", map_shows(self.map.show))
    }

    fn lines(&self, units: &Units) -> Lines {
        let request = &self.map.request;
        let mut lines = Lines::new();
        for axis in &request.axes {
            let ends = [axis.values.first(), axis.values.last()];
            let text = |&value: &f64| axis.keys.text(value);
            let [from, to] = ends.map(|end| end.map_or(String::new(), text));
            let to = in_unit(to, units, axis.keys.dimension());
            let spacing = if axis.log { ", logarithmic" } else { "" };
            let count = axis.values.len();
            let text = format!("{} from {from} to {to}: {count} values{spacing}", axis.keys);
            lines.push(("vary", text));
        }
        let (known, confirmed) = self.map.known_and_confirmed();
        let cells = request.cells();
        let cells = format!("{known} of {cells}, reference confirmed in {confirmed}");
        lines.push(("cells", cells));
        let (count, time) = (self.map.rows.len(), seconds(self.seconds));
        let rows = format!("{count} computed in {time}");
        lines.push(("rows", rows));
        lines.extend(labelled("found", counts(self.map)));
        lines.extend(labelled("jumps", jumps(self.map, units)));
        lines
    }
}

/// The first few pairs of cells between which the leaf jumps to another equilibrium.
fn jumps(map: &Map, units: &Units) -> Vec<String> {
    let all = map.jumps.as_deref().unwrap_or_default();
    let mut lines: Vec<String> = (all.iter().take(JUMPS))
        .map(|jump| {
            let (from, to) = (jump.from.join(", "), jump.to.join(", "));
            let key = &jump.key;
            let between = jump.between.map(brief).join(" and ");
            let between = in_unit_of_key(between, units, key);
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

/// `map.csv`: one row per cell and method.
pub fn map_table(map: &Map, out: &mut dyn Write) -> io::Result<()> {
    let request = &map.request;
    let keys = request.axes.iter().map(|axis| axis.keys.to_string());
    let header: Vec<String> = keys.chain(COLUMNS.split(',').map(String::from)).collect();
    append_csv([header], out)?;
    // The columns of the axes, then those of the row.
    let rows = map.rows.iter().map(|row| {
        let detail = text_cell(&row.detail).into();
        let row = MapRow {
            detail,
            ..row.clone()
        };
        (request.texts(row.cell), row)
    });
    append_csv(rows, out)
}
