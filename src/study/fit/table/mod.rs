//! Tables of numbers, as instruments, spreadsheets and people write them.

mod decimals;
mod decoded;
mod lines;
mod units;

pub(super) use decoded::refuse;

use super::FitError;
use super::columns::{NAME, Reading, RowChoice, is_known};
use decimals::{Decimals, Mark, is_number};
use decoded::decode;
use lines::{Line, Lines};

/// A parsed table.
pub(super) struct Table<'t> {
    pub file: &'t str,
    /// Line of the header, counted from 1.
    pub header_line: usize,
    /// Names of the columns here.
    pub header: Vec<String>,
    /// Names of all columns in the file.
    pub names: Vec<String>,
    /// Number of lines that are comments, and of those among them below the header.
    pub comments: [usize; 2],
    /// What the file was taken for, where that is not the usual CSV.
    pub taken: Vec<String>,
    /// What was left out.
    pub left_out: Vec<String>,
    sources: Vec<Source>,
    rows: Vec<Line>,
    decimals: Decimals,
}

/// Where a column stands, and what makes its numbers those of the scenario.
struct Source {
    at: usize,
    factor: f64,
    offset: f64,
}

impl Source {
    fn plain(at: usize) -> Self {
        Source {
            at,
            factor: 1.0,
            offset: 0.0,
        }
    }
}

fn counted(count: usize, one: &str, many: &str) -> Option<String> {
    (count > 0).then(|| format!("{count} {}", if count == 1 { one } else { many }))
}

/// Whether a name stands there twice.
fn has_repeated(header: &Line) -> bool {
    let names: Vec<&str> = header.cells().filter(|name| !name.is_empty()).collect();
    (1..names.len()).any(|k| names[..k].contains(&names[k]))
}

/// The names of columns, each behind that of its group if there are groups, as in `Vein X`. A
/// group's name stands above its first column.
fn names_of(header: &Line, groups: Option<&Line>) -> Vec<String> {
    let mut group = "";
    let names = header.cells().enumerate().map(|(at, name)| {
        let above = groups.map_or("", |groups| groups.cell(at));
        group = if above.is_empty() { group } else { above };
        let words = if name.is_empty() { "" } else { group }.split_whitespace();
        words
            .chain(name.split_whitespace())
            .collect::<Vec<_>>()
            .join(" ")
    });
    names.collect()
}

impl<'t> Table<'t> {
    pub fn of(bytes: &[u8], file: &'t str, reading: &Reading) -> Result<Self, FitError> {
        let decoded = decode(bytes, file)?;
        let mapped = |name: &str| reading.columns.iter().find(|map| map.name == name);
        let known = |name: &str| is_known(name) || mapped(name).is_some();
        let named = |name: &str| match mapped(name) {
            Some(map) => map.quantity == NAME,
            None => name == NAME,
        };
        let Some(lines) = Lines::of(&decoded.text, &known, &named) else {
            let why = "is empty: give a header, and a row for each datum";
            return Err(refuse(file, 1, why));
        };
        let (above, below) = lines.lines.split_at(lines.header);
        let (header, below) = (&below[0], &below[1..]);
        let names_columns = |line: &&Line| {
            let mut names = line.cells().filter(|name| !name.is_empty());
            !line.is_blank() && names.all(known)
        };
        if let Some(other) = above.iter().find(names_columns) {
            let why = format!(
                "names columns, and so does line {}: write each table to a file of its own",
                header.number
            );
            return Err(refuse(file, other.number, why));
        }
        let groups = above
            .last()
            .filter(|line| !line.is_blank() && has_repeated(header));
        let names = names_of(header, groups);
        let mut table = Table {
            file,
            header_line: header.number,
            header: Vec::new(),
            names,
            comments: lines.comments,
            taken: Vec::new(),
            left_out: Vec::new(),
            sources: Vec::new(),
            rows: Vec::new(),
            decimals: Decimals::of(std::iter::empty(), file)?,
        };
        table.check_header(header)?;
        let above = above.iter().filter(|line| !line.is_blank()).count();
        let above = above - usize::from(groups.is_some());
        table.rows = below
            .iter()
            .filter(|line| !line.is_blank())
            .cloned()
            .collect();
        let units = table.take_units();
        table.check_cells()?;
        let unused = table.choose_columns(reading)?;
        let ats: Vec<usize> = table.sources.iter().map(|source| source.at).collect();
        table
            .rows
            .retain(|row| ats.iter().any(|at| !row.cell(*at).is_empty()));
        let blank = below.len() - table.rows.len() - usize::from(units.is_some());
        table.check_rows()?;
        table.decimals = table.read_decimals()?;
        let all = table.rows.len();
        let every = reading.every.get();
        table.rows = std::mem::take(&mut table.rows)
            .into_iter()
            .step_by(every)
            .collect();
        table.taken = table.notation(lines.separator, decoded.encoding);
        let before = table.rows.len();
        table.choose_rows(&reading.rows)?;
        let not_chosen = before - table.rows.len();
        if every > 1 {
            let [second, third] = [1, 2].map(|k| every.saturating_mul(k).saturating_add(1));
            let thinned = format!("rows 1, {second}, {third} and so on of {all}");
            table.taken.push(thinned);
        }
        let comments = table.comments[0];
        table.left_out = [
            counted(
                comments,
                "line that is a comment",
                "lines that are comments",
            ),
            counted(above, "line before the header", "lines before the header"),
            units.map(|units| format!("a row of units ({units}; nothing is converted)")),
            counted(blank, "blank row", "blank rows"),
            counted(
                not_chosen,
                "row that was not chosen",
                "rows that were not chosen",
            ),
        ]
        .into_iter()
        .flatten()
        .chain(unused)
        .collect();
        Ok(table)
    }

    /// How the numbers of all columns that are used are written.
    fn read_decimals(&self) -> Result<Decimals, FitError> {
        let columns = self.sources.iter().zip(&self.header);
        let numbers = columns.filter(|(_, name)| *name != NAME);
        let numbers: Vec<usize> = numbers.map(|(source, _)| source.at).collect();
        let rows = self.rows.iter();
        let cells = rows.flat_map(|row| numbers.iter().map(|at| (row.number, row.cell(*at))));
        Decimals::of(cells, self.file)
    }

    /// What the file was taken for, where that is not the usual CSV.
    fn notation(&self, separator: &str, encoding: Option<&str>) -> Vec<String> {
        let divided = separator != "commas" && self.names.len() > 1;
        let group = match self.decimals.mark {
            Mark::Point => "thousands divided by commas",
            Mark::Comma => "thousands divided by points",
        };
        let said = [
            divided.then(|| format!("cells divided by {separator}")),
            (self.decimals.mark == Mark::Comma).then(|| "decimal commas".into()),
            self.decimals.grouped.then(|| group.into()),
            encoding.map(|encoding| format!("text in {encoding}")),
        ];
        said.into_iter().flatten().collect()
    }

    fn check_header(&self, header: &Line) -> Result<(), FitError> {
        if header.cells().any(is_number) {
            let why = "has no header: the first line names the columns, such as \
                       load.tip_force[0],tip_x,sd_tip_x, or rod,sigma,x,y,z";
            return Err(refuse(self.file, self.header_line, why));
        }
        if let [name] = self.names.as_slice()
            && name
                .split_whitespace()
                .filter(|word| is_known(word))
                .count()
                > 1
        {
            let why = "columns are divided by blanks: divide them by commas, semicolons or tabs";
            return Err(refuse(self.file, self.header_line, why));
        }
        Ok(())
    }

    /// Removes the row of units below the header, and returns it.
    fn take_units(&mut self) -> Option<String> {
        let first = self
            .rows
            .first()
            .filter(|row| units::are_units(row.cells()))?;
        let units: Vec<&str> = first.cells().filter(|cell| !cell.is_empty()).collect();
        let units = units.join(", ");
        self.rows.remove(0);
        Some(units)
    }

    /// Rows are on one line. They may have more cells than the header, or fewer, where these are
    /// empty and have no names.
    fn check_cells(&self) -> Result<(), FitError> {
        let broken = |row: &&Line| row.cells().any(|cell| cell.contains('\n'));
        if let Some(row) = self.rows.iter().find(broken) {
            let why = "a quotation mark is not closed in this line: close it, and write a name \
                       on one line";
            return Err(refuse(self.file, row.number, why));
        }
        let wanted = self.names.len();
        let last = self.names.iter().rposition(|name| !name.is_empty());
        let least = last.map_or(0, |last| last + 1);
        for row in &self.rows {
            let found = row.len();
            if found < least || row.cells().skip(wanted).any(|cell| !cell.is_empty()) {
                let why = format!(
                    "has {found} cells, and the header {wanted}: cells that are divided by commas \
                     have numbers with a decimal point; with decimal commas divide them by \
                     semicolons or tabs"
                );
                return Err(refuse(self.file, row.number, why));
            }
        }
        Ok(())
    }

    /// Chooses the columns that are used, and returns words for others.
    fn choose_columns(&mut self, reading: &Reading) -> Result<Vec<String>, FitError> {
        let (mut unnamed, mut unused) = (None, Vec::new());
        let maps_of = |name: &str| {
            let maps = reading.columns.iter();
            maps.filter(|map| map.name == name).collect::<Vec<_>>()
        };
        // With names given for columns of a file, others that mean nothing here are not meant.
        let some_given = self.names.iter().any(|name| !maps_of(name).is_empty());
        let means_nothing = |name: &&String| !name.is_empty() && !is_known(name);
        if !some_given
            && !reading.columns.is_empty()
            && self.names.iter().any(|name| means_nothing(&name))
        {
            let given = reading.columns.iter().map(|map| map.name.as_str());
            let given = given.collect::<Vec<_>>().join(", ");
            let why = format!(
                "has none of the columns that were said to be quantities ({given}): its columns are {}",
                self.names.join(", ")
            );
            return Err(refuse(self.file, self.header_line, why));
        }
        for (at, name) in self.names.iter().enumerate() {
            let maps = maps_of(name);
            if name.is_empty() {
                let is_used = self.rows.iter().any(|row| !row.cell(at).is_empty());
                if is_used && at > 0 {
                    let why = format!(
                        "column {} has no name, and cells below: name it, or leave it out",
                        at + 1
                    );
                    return Err(refuse(self.file, self.header_line, why));
                }
                unnamed = unnamed.or(is_used.then(|| "the first column, without a name".into()));
            } else if maps.is_empty() && some_given && !is_known(name) {
                unused.push(name.as_str());
            } else if maps.is_empty() {
                self.header.push(name.clone());
                self.sources.push(Source::plain(at));
            }
            for map in maps {
                self.header.push(map.quantity.clone());
                self.sources.push(Source {
                    at,
                    factor: map.factor,
                    offset: map.offset,
                });
            }
        }
        for (k, name) in self.header.iter().enumerate() {
            if let Some(first) = self.header[..k].iter().position(|other| other == name) {
                let [first, second] = [first, k].map(|k| self.sources[k].at);
                let [one, other] = [first, second].map(|at| &self.names[at]);
                let why = match one == other {
                    true => format!(
                        "the column {one} stands there twice (columns {} and {}): rename one, or \
                         leave it out",
                        first + 1,
                        second + 1
                    ),
                    false => {
                        format!("the columns {one} and {other} both are {name}: leave one out")
                    }
                };
                return Err(refuse(self.file, self.header_line, why));
            }
        }
        let columns = if unused.len() == 1 {
            "column"
        } else {
            "columns"
        };
        let unused = (!unused.is_empty()).then(|| format!("the {columns} {}", unused.join(", ")));
        Ok(unnamed.into_iter().chain(unused).collect())
    }

    /// Leaves out rows that do not meet a condition on a column of this table.
    fn choose_rows(&mut self, choices: &[RowChoice]) -> Result<(), FitError> {
        let mut kept = vec![true; self.rows.len()];
        let mut chosen = false;
        for condition in choices.iter().flat_map(|choice| &choice.conditions) {
            let Some(column) = self.column(&condition.column) else {
                continue;
            };
            chosen = true;
            for (row, kept) in kept.iter_mut().enumerate() {
                let value = self.number(row, column)?;
                *kept &= value.is_some_and(|value| condition.admits(value));
            }
        }
        let mut kept = kept.into_iter();
        self.rows.retain(|_| kept.next().unwrap_or(true));
        if chosen && self.rows.is_empty() {
            let why = "has no row that meets the conditions on rows: choose others".to_string();
            return Err(refuse(self.file, self.header_line, why));
        }
        Ok(())
    }

    fn check_rows(&self) -> Result<(), FitError> {
        if self.rows.is_empty() {
            let why = match self.comments[0] {
                0 => "has no row below the header".into(),
                comments => format!(
                    "has no row below the header ({comments} lines that begin with # are comments)"
                ),
            };
            return Err(refuse(self.file, self.header_line, why));
        }
        Ok(())
    }

    /// Number of rows.
    pub fn rows(&self) -> usize {
        self.rows.len()
    }

    /// Line of a row, counted from 1.
    pub fn line(&self, row: usize) -> usize {
        self.rows[row].number
    }

    /// Where a column is.
    pub fn column(&self, name: &str) -> Option<usize> {
        self.header.iter().position(|known| known == name)
    }

    pub fn cell(&self, row: usize, column: usize) -> &str {
        self.rows[row].cell(self.sources[column].at)
    }

    /// The number in a cell; `None` if it is empty.
    pub fn number(&self, row: usize, column: usize) -> Result<Option<f64>, FitError> {
        let cell = self.cell(row, column);
        if cell.is_empty() {
            return Ok(None);
        }
        let source = &self.sources[column];
        let value = self.decimals.number(cell);
        let value = value.map(|value| match (source.factor, source.offset) {
            (1.0, 0.0) => value,
            (factor, offset) => value * factor + offset,
        });
        if let Some(value) = value.filter(|value| value.is_finite()) {
            return Ok(Some(value));
        }
        let name = &self.header[column];
        let why = format!(
            "{name} = {cell}: must be a finite number, or empty where nothing was measured"
        );
        Err(refuse(self.file, self.line(row), why))
    }

    pub fn positive(&self, row: usize, column: usize) -> Result<Option<f64>, FitError> {
        let number = self.number(row, column)?;
        if let Some(value) = number.filter(|value| *value <= 0.0) {
            let name = &self.header[column];
            let why = format!("{name} = {value}: a standard deviation is greater than 0");
            return Err(refuse(self.file, self.line(row), why));
        }
        Ok(number)
    }
}
