//! A map as text, and its rows as CSV.

use crate::report::document::{ReportedResult, map_title};
use crate::report::numbers::{duration_text, format_five_digits, number_in_key_unit};
use crate::report::sweep::varied_lines;
use crate::report::table::{LabelledLines, append_csv_rows, label_first_line, text_cell};
use leafdyn::scenario::Units;
use leafdyn::study::{Map, MapOutcome, MapRemark, ReferenceConfidence};
use std::fmt::Write as _;
use std::io;
use std::io::Write;

/// The columns after those of the varied keys.
const MAP_COLUMNS: &str = "method,outcome,detail,index,tip_x,tip_y,tip_z,energy,error,\
    error_estimate,margin_waves,margin_amplitude,twist,seconds,reference";

const MOST_JUMPS_LISTED: usize = 5;

/// A map, and the work that was done for it.
pub struct ReportedMap<'m> {
    pub map: &'m Map,
    /// Time that the map took.
    pub seconds: f64,
}

impl ReportedResult for ReportedMap<'_> {
    fn heading(&self) -> String {
        let name = &self.map.request.base.scenario().name;
        format!("{name}: {}", map_title(self.map.show))
    }

    fn report_lines(&self, units: &Units) -> LabelledLines {
        let request = &self.map.request;
        let mut lines = varied_lines(&request.axes, units);
        let (known, confirmed) = self.map.known_and_confirmed_cells();
        let cells = request.cells();
        let cells = match self.map.reference_count(ReferenceConfidence::FinerGrids) {
            0 => format!("{known} of {cells}, reference confirmed in {confirmed}"),
            finer if finer == known => {
                format!("{known} of {cells}, compared with the leaf relaxed on finer grids")
            }
            finer => format!(
                "{known} of {cells}, reference confirmed in {confirmed}, from finer grids in {finer}"
            ),
        };
        lines.push(("cells", cells));
        let (count, time) = (self.map.rows.len(), duration_text(self.seconds));
        let rows = format!("{count} computed in {time}");
        lines.push(("rows", rows));
        lines.extend(label_first_line("found", outcome_table_lines(self.map)));
        lines.extend(label_first_line("jumps", jump_lines(self.map, units)));
        lines
    }
}

/// The first few pairs of cells between which the leaf jumps to another equilibrium.
fn jump_lines(map: &Map, units: &Units) -> Vec<String> {
    let all = map.jumps.as_deref().unwrap_or_default();
    let mut lines: Vec<String> = (all.iter().take(MOST_JUMPS_LISTED))
        .map(|jump| {
            let (from, to) = (jump.from.join(", "), jump.to.join(", "));
            let key = &jump.key;
            let between = jump.between.map(format_five_digits).join(" and ");
            let between = number_in_key_unit(between, units, key);
            format!("from cell {from} to {to} to another equilibrium: {key} between {between}")
        })
        .collect();
    if all.len() > MOST_JUMPS_LISTED {
        lines.push(format!(
            "and {} more: map.json has all",
            all.len() - MOST_JUMPS_LISTED
        ));
    }
    lines
}

/// A table with the outcomes that occur.
fn outcome_table_lines(map: &Map) -> Vec<String> {
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
            let count = match map.outcome_count(method, outcome) {
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
pub fn write_map_table(map: &Map, out: &mut dyn Write) -> io::Result<()> {
    let request = &map.request;
    let keys = request.axes.iter().map(|axis| axis.keys.to_string());
    let header: Vec<String> = keys
        .chain(MAP_COLUMNS.split(',').map(String::from))
        .collect();
    append_csv_rows([header], out)?;
    // The columns of the axes, then those of the row.
    let rows = map.rows.iter().map(|row| {
        let mut row = row.clone();
        if let Some(MapRemark::Refused(why)) = &mut row.remark {
            // In words of the user, too.
            *why = text_cell(why.trim_start()).into();
        }
        (request.texts(row.cell), row)
    });
    append_csv_rows(rows, out)
}
