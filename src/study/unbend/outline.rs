//! Outlines of blades as the field has them: relative widths r at fractions s of the length, from base to tip.

use crate::scenario::Scenario;
use crate::study::fit::cells::{decode, line_error};
use crate::study::fit::columns::{DataFileOptions, FitError};
use crate::study::fit::table::{DataTable, KnownColumns};
use serde_json::Value;

/// The fraction of the length, and the relative width there.
const COLUMNS: [&str; 2] = ["s", "r"];

/// What tells outlines of a table apart.
const OUTLINE_NUMBER: &str = "rankclass";

/// s may end this far from 0 and 1.
const END_TOLERANCE: f64 = 0.01;

/// A blade is pointed where its width is below the first part of its largest one, and not where it is above the second.
const POINTED: [f64; 2] = [0.05, 0.25];

/// Least width of a section, as a part of its largest one: a section has a stiffness at its tip, too.
const LEAST_WIDTH: f64 = 0.01;

/// Relative widths along a blade.
#[derive(Clone, Debug, PartialEq)]
pub struct BladeOutline {
    /// Fractions of the length, from 0 to 1.
    at: Vec<f64>,
    /// Widths there in largest ones.
    width: Vec<f64>,
}

/// The table with the width of a scenario's leaf, and the width there.
struct LeafWidth {
    table: &'static str,
    largest: f64,
}

impl BladeOutline {
    /// Reads a table with the columns s and r.
    ///
    /// # Errors
    /// What is no outline of one blade from its base to its tip.
    pub fn read(bytes: &[u8], file: &str) -> Result<BladeOutline, FitError> {
        let decoded = decode(bytes, file)?;
        let is_known = |name: &str| COLUMNS.contains(&name) || name == OUTLINE_NUMBER;
        let columns = KnownColumns {
            is_known: &is_known,
            leaves_out_others: true,
        };
        let table = DataTable::parse_text(&decoded, file, &DataFileOptions::default(), &columns)?;
        let refuse = |why: &str| line_error(file, table.header_line, why);
        let [Some(s), Some(r)] = COLUMNS.map(|name| table.column_index(name)) else {
            let why = "has no columns s and r: an outline is the width r at fractions s of the length, from the base, 0, \
                       to the tip, 1";
            return Err(refuse(why));
        };
        if let Some(number) = table.column_index(OUTLINE_NUMBER) {
            let own = |row| table.cell(row, number);
            if (1..table.row_count()).any(|row| own(row) != own(0)) {
                let why = format!("has several outlines ({OUTLINE_NUMBER}): keep the rows of one");
                return Err(refuse(&why));
            }
        }
        let mut rows = Vec::new();
        for row in 0..table.row_count() {
            let [s, r] = [table.number(row, s)?, table.number(row, r)?];
            let (Some(s), Some(r)) = (s, r) else {
                let why = "s or r is empty: leave the row out";
                return Err(line_error(file, table.line_number(row), why));
            };
            rows.push([s, r]);
        }
        BladeOutline::new(&rows).map_err(|why| refuse(&why))
    }

    /// The outline through pairs of s and r.
    pub(super) fn new(rows: &[[f64; 2]]) -> Result<BladeOutline, String> {
        let ([first, .., last], true) = (rows, rows.iter().flatten().all(|it| it.is_finite()))
        else {
            return Err("an outline needs s and r at two places at least".into());
        };
        if rows.windows(2).any(|pair| pair[1][0] <= pair[0][0]) {
            return Err("s must increase from row to row, from 0, the base, to 1, the tip".into());
        }
        if first[0].abs() > END_TOLERANCE || (last[0] - 1.0).abs() > END_TOLERANCE {
            return Err(format!(
                "s runs from {} to {}: it is the fraction of the length, 0 at the base and 1 at the tip",
                first[0], last[0]
            ));
        }
        let largest = rows.iter().fold(0.0_f64, |most, [_, r]| most.max(*r));
        if rows.iter().any(|[_, r]| *r < 0.0) || largest == 0.0 {
            return Err("r is a width: it must not be negative, and not be 0 everywhere".into());
        }
        let mut at: Vec<f64> = rows.iter().map(|[s, _]| *s).collect();
        let end = at.len() - 1;
        (at[0], at[end]) = (0.0, 1.0);
        let width: Vec<f64> = rows.iter().map(|[_, r]| r / largest).collect();
        let [pointed, wide] = POINTED;
        if width[0] < pointed && width[end] > wide {
            return Err(format!(
                "r is {:.2} of its largest value at s = 0 and {:.2} at s = 1: a blade is pointed at its tip; where s runs from \
                 tip to base, give 1 - s in its place",
                width[0], width[end]
            ));
        }
        Ok(BladeOutline { at, width })
    }

    /// The entry, as KEY=VALUE, that gives a scenario's section or blade this outline, with its largest width as it is or
    /// this one.
    ///
    /// # Errors
    /// A scenario without a width.
    pub fn entry(&self, scenario: &Scenario, largest: Option<f64>) -> Result<String, String> {
        let Some(own) = leaf_width(scenario) else {
            return Err(
                "an outline needs a leaf whose width counts: give [section] with a width, or [blade]".into(),
            );
        };
        let least = if own.table == "section" {
            LEAST_WIDTH
        } else {
            0.0
        };
        let unit = largest.unwrap_or(own.largest);
        let width = self.width.iter().map(|width| unit * width.max(least));
        let width: Vec<f64> = width.collect();
        Ok(format!(
            "{}.width={{ at = {:?}, value = {width:?} }}",
            own.table, self.at
        ))
    }

    /// A scenario with this outline; none if its width does not count.
    pub(super) fn outlined(&self, scenario: &Scenario) -> Option<Result<Scenario, String>> {
        leaf_width(scenario)?;
        let read = |entry: String| {
            let text = serde_json::to_string(scenario).map_err(|error| error.to_string())?;
            Scenario::from_toml_with(&text, "scenario", &[entry]).map_err(|error| error.to_string())
        };
        Some(self.entry(scenario, None).and_then(read))
    }
}

/// The largest width of a scenario's section or blade; none if it has none, or a round one.
fn leaf_width(scenario: &Scenario) -> Option<LeafWidth> {
    let form = serde_json::to_value(scenario).ok()?;
    ["blade", "section"].into_iter().find_map(|table| {
        let width = form.get(table)?.get("width")?;
        let values = width.get("value").unwrap_or(width);
        let largest = match values {
            Value::Array(all) => {
                let numbers = all.iter().filter_map(Value::as_f64);
                numbers.fold(0.0, f64::max)
            }
            single => single.as_f64()?,
        };
        (largest > 0.0).then_some(LeafWidth { table, largest })
    })
}
