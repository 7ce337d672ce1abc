//! Tables of numbers, as instruments, spreadsheets and people write them.
//!
//! Encoding, separator of cells, header, decimal mark and a row of units are recognized from the text
//! itself; where it can be read in two ways, the file is refused with what to change. Columns of a table
//! without a header have their numbers as names, from 1.

use crate::study::fit::cells::{
    DecimalMark, DecodedText, NumberFormat, decode, is_number, is_unit_row, line_error,
};
use crate::study::fit::columns::{
    DataFileOptions, EXPERIMENT_NAME_COLUMN, FitError, RowFilter, is_known_column,
};

pub(in crate::study) struct DataTable<'t> {
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
    pub left_out: Vec<String>,
    sources: Vec<ColumnSource>,
    rows: Vec<TableLine>,
    decimals: NumberFormat,
}

/// The columns of a table that mean something.
pub(in crate::study) struct KnownColumns<'c> {
    /// Whether a column of this name does.
    pub is_known: &'c dyn Fn(&str) -> bool,
    /// Whether others are left out and told, in place of being kept for a message.
    pub leaves_out_others: bool,
}

/// Where a column stands, and what makes its numbers those of the scenario.
struct ColumnSource {
    at: usize,
    factor: f64,
    offset: f64,
}

impl ColumnSource {
    fn unscaled(at: usize) -> Self {
        ColumnSource {
            at,
            factor: 1.0,
            offset: 0.0,
        }
    }
}

fn count_in_words(count: usize, one: &str, many: &str) -> Option<String> {
    (count > 0).then(|| format!("{count} {}", if count == 1 { one } else { many }))
}

/// Whether a name stands there twice.
fn has_repeated_name(header: &TableLine) -> bool {
    let names: Vec<&str> = header.cells().filter(|name| !name.is_empty()).collect();
    (1..names.len()).any(|k| names[..k].contains(&names[k]))
}

/// The names of columns, each behind that of its group if there are groups, as in `Vein X`. A
/// group's name stands above its first column.
fn column_names(header: &TableLine, groups: Option<&TableLine>) -> Vec<String> {
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

impl<'t> DataTable<'t> {
    pub fn parse(bytes: &[u8], file: &'t str, reading: &DataFileOptions) -> Result<Self, FitError> {
        let columns = KnownColumns {
            is_known: &is_known_column,
            leaves_out_others: false,
        };
        DataTable::parse_text(&decode(bytes, file)?, file, reading, &columns)
    }

    /// The table of a text, with other columns.
    pub fn parse_text(
        decoded: &DecodedText,
        file: &'t str,
        reading: &DataFileOptions,
        columns: &KnownColumns,
    ) -> Result<Self, FitError> {
        let is_known = columns.is_known;
        let mapped = |name: &str| reading.columns.iter().find(|map| map.name == name);
        let known = |name: &str| is_known(name) || mapped(name).is_some();
        let named = |name: &str| match mapped(name) {
            Some(map) => map.quantity == EXPERIMENT_NAME_COLUMN,
            None => name == EXPERIMENT_NAME_COLUMN,
        };
        let numbered = TableLines::split_numbered(&decoded.text, reading);
        let is_numbered = numbered.is_some();
        let lines = numbered.or_else(|| TableLines::split_text(&decoded.text, &known, &named));
        let Some(lines) = lines else {
            let why = "is empty: give a header, and a row for each datum";
            return Err(line_error(file, 1, why));
        };
        let (above, below) = lines.lines.split_at(lines.header);
        let (header, below) = (&below[0], &below[1..]);
        let names_columns = |line: &&TableLine| {
            let mut names = line.cells().filter(|name| !name.is_empty());
            !line.is_blank() && names.all(known)
        };
        if let Some(other) = above.iter().find(names_columns) {
            let why = format!(
                "names columns, and so does line {}: write each table to a file of its own",
                header.number
            );
            return Err(line_error(file, other.number, why));
        }
        let groups = above
            .last()
            .filter(|line| !line.is_blank() && has_repeated_name(header));
        let names = column_names(header, groups);
        let mut table = DataTable {
            file,
            header_line: header.number,
            header: Vec::new(),
            names,
            comments: lines.comments,
            taken: Vec::new(),
            left_out: Vec::new(),
            sources: Vec::new(),
            rows: Vec::new(),
            decimals: NumberFormat::detect(std::iter::empty(), file)?,
        };
        if !is_numbered {
            table.check_header(header)?;
        }
        let above = above.iter().filter(|line| !line.is_blank()).count();
        let above = above - usize::from(groups.is_some());
        table.rows = below
            .iter()
            .filter(|line| !line.is_blank())
            .cloned()
            .collect();
        let units = table.remove_unit_row();
        table.check_cells()?;
        if is_numbered {
            table.check_numbered_cells(reading, lines.separator)?;
        }
        let unused = table.select_columns(reading, columns)?;
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
        table.taken = table.notation_remarks(lines.separator, decoded.encoding);
        let before = table.rows.len();
        table.filter_rows(&reading.rows)?;
        let not_chosen = before - table.rows.len();
        if every > 1 {
            let [second, third] = [1, 2].map(|k| every.saturating_mul(k).saturating_add(1));
            let thinned = format!("rows 1, {second}, {third} and so on of {all}");
            table.taken.push(thinned);
        }
        let comments = table.comments[0];
        table.left_out = [
            count_in_words(
                comments,
                "line that is a comment",
                "lines that are comments",
            ),
            count_in_words(above, "line before the header", "lines before the header"),
            units.map(|units| format!("a row of units ({units}; nothing is converted)")),
            count_in_words(blank, "blank row", "blank rows"),
            count_in_words(
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
    fn read_decimals(&self) -> Result<NumberFormat, FitError> {
        let columns = self.sources.iter().zip(&self.header);
        let numbers = columns.filter(|(_, name)| *name != EXPERIMENT_NAME_COLUMN);
        let numbers: Vec<usize> = numbers.map(|(source, _)| source.at).collect();
        let rows = self.rows.iter();
        let cells = rows.flat_map(|row| numbers.iter().map(|at| (row.number, row.cell(*at))));
        NumberFormat::detect(cells, self.file)
    }

    /// What the file was taken for, where that is not the usual CSV.
    fn notation_remarks(&self, separator: &str, encoding: Option<&str>) -> Vec<String> {
        let divided = separator != "commas" && self.names.len() > 1;
        let group = match self.decimals.mark {
            DecimalMark::Point => "thousands divided by commas",
            DecimalMark::Comma => "thousands divided by points",
        };
        let said = [
            divided.then(|| format!("cells divided by {separator}")),
            (self.decimals.mark == DecimalMark::Comma).then(|| "decimal commas".into()),
            self.decimals.grouped.then(|| group.into()),
            encoding.map(|encoding| format!("text in {encoding}")),
        ];
        said.into_iter().flatten().collect()
    }

    fn check_header(&self, header: &TableLine) -> Result<(), FitError> {
        if header.cells().any(is_number) {
            let why = "has no header: the first line names the columns, such as \
                       load.tip_force[0],tip_x,sd_tip_x, or rod,sigma,x,y,z; or say what columns are by their \
                       numbers, as in 1=x and 2=z";
            return Err(line_error(self.file, self.header_line, why));
        }
        if let [name] = self.names.as_slice()
            && name
                .split_whitespace()
                .filter(|word| is_known_column(word))
                .count()
                > 1
        {
            let why = "columns are divided by blanks: divide them by commas, semicolons or tabs";
            return Err(line_error(self.file, self.header_line, why));
        }
        Ok(())
    }

    /// Removes the row of units below the header, and returns it.
    fn remove_unit_row(&mut self) -> Option<String> {
        let first = self.rows.first().filter(|row| is_unit_row(row.cells()))?;
        let units: Vec<&str> = first.cells().filter(|cell| !cell.is_empty()).collect();
        let units = units.join(", ");
        self.rows.remove(0);
        Some(units)
    }

    /// Rows are on one line. They may have more cells than the header, or fewer, where these are
    /// empty and have no names.
    fn check_cells(&self) -> Result<(), FitError> {
        let broken = |row: &&TableLine| row.cells().any(|cell| cell.contains('\n'));
        if let Some(row) = self.rows.iter().find(broken) {
            let why = "a quotation mark is not closed in this line: close it, and write a name \
                       on one line";
            return Err(line_error(self.file, row.number, why));
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
                return Err(line_error(self.file, row.number, why));
            }
        }
        Ok(())
    }

    /// Refuses rows without a header that can be read in two ways: a first row that counts the columns, and whole numbers
    /// that are numbers with decimal commas, each divided in two.
    fn check_numbered_cells(
        &self,
        reading: &DataFileOptions,
        separator: &str,
    ) -> Result<(), FitError> {
        let width = self.names.len();
        let Some((first, others)) = self.rows.split_first() else {
            return Ok(());
        };
        let counts_from = |start: usize| {
            let mut cells = first.cells().enumerate();
            cells.all(|(k, cell)| cell == (start + k).to_string())
        };
        let is_fraction = |cell: &str| cell.contains(['.', ',']);
        let fractions = others.iter().any(|row| row.cells().any(is_fraction));
        if width > 1 && fractions && (counts_from(0) || counts_from(1)) {
            let why = "counts the columns, or is a row of numbers: leave the line out, or write it as the others, \
                       with decimals";
            return Err(line_error(self.file, first.number, why));
        }
        let is_digits =
            |cell: &str| !cell.is_empty() && cell.bytes().all(|byte| byte.is_ascii_digit());
        let is_divided = |row: &TableLine| {
            let mut cells = row.cells().enumerate();
            cells.all(|(k, cell)| match k % 2 {
                0 => is_digits(cell.strip_prefix(['-', '+']).unwrap_or(cell)),
                _ => is_digits(cell),
            })
        };
        let numbers = reading
            .columns
            .iter()
            .filter_map(|map| map.name.parse().ok());
        let last: usize = numbers.max().unwrap_or(0);
        let half = width / 2;
        let may_be_divided = separator == "commas" && 2 * half == width && last <= half;
        if may_be_divided && self.rows.iter().all(is_divided) {
            let why = format!(
                "has {width} whole numbers in a row, or {half} with decimal commas: divide cells with decimal commas by \
                 semicolons or tabs, and of whole numbers leave out the columns that are not used"
            );
            return Err(line_error(self.file, first.number, why));
        }
        Ok(())
    }

    /// Chooses the columns that are used, and returns words for others.
    fn select_columns(
        &mut self,
        reading: &DataFileOptions,
        columns: &KnownColumns,
    ) -> Result<Vec<String>, FitError> {
        let (mut unnamed, mut unused) = (None, Vec::new());
        let maps_of = |name: &str| {
            let maps = reading.columns.iter();
            maps.filter(|map| map.name == name).collect::<Vec<_>>()
        };
        // With names given for columns of a file, others that mean nothing here are not meant.
        let some_given =
            columns.leaves_out_others || self.names.iter().any(|name| !maps_of(name).is_empty());
        let means_nothing = |name: &&String| !name.is_empty() && !(columns.is_known)(name);
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
            return Err(line_error(self.file, self.header_line, why));
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
                    return Err(line_error(self.file, self.header_line, why));
                }
                unnamed = unnamed.or(is_used.then(|| "the first column, without a name".into()));
            } else if maps.is_empty() && some_given && !(columns.is_known)(name) {
                unused.push(name.as_str());
            } else if maps.is_empty() {
                self.header.push(name.clone());
                self.sources.push(ColumnSource::unscaled(at));
            }
            for map in maps {
                self.header.push(map.quantity.clone());
                self.sources.push(ColumnSource {
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
                return Err(line_error(self.file, self.header_line, why));
            }
        }
        if columns.leaves_out_others && self.header.is_empty() {
            let why = format!(
                "has none of the columns that mean something here: its columns are {}; name coordinates x, y, z",
                self.names.join(", ")
            );
            return Err(line_error(self.file, self.header_line, why));
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
    fn filter_rows(&mut self, choices: &[RowFilter]) -> Result<(), FitError> {
        let mut kept = vec![true; self.rows.len()];
        let mut chosen = false;
        for condition in choices.iter().flat_map(|choice| &choice.conditions) {
            let Some(column) = self.column_index(&condition.column) else {
                continue;
            };
            chosen = true;
            for (row, kept) in kept.iter_mut().enumerate() {
                let value = self.number(row, column)?;
                *kept &= value.is_some_and(|value| condition.is_met_by(value));
            }
        }
        let mut kept = kept.into_iter();
        self.rows.retain(|_| kept.next().unwrap_or(true));
        if chosen && self.rows.is_empty() {
            let why = "has no row that meets the conditions on rows: choose others".to_string();
            return Err(line_error(self.file, self.header_line, why));
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
            return Err(line_error(self.file, self.header_line, why));
        }
        Ok(())
    }

    pub fn row_count(&self) -> usize {
        self.rows.len()
    }

    /// Line of a row, counted from 1.
    pub fn line_number(&self, row: usize) -> usize {
        self.rows[row].number
    }

    pub fn column_index(&self, name: &str) -> Option<usize> {
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
        let value = self.decimals.parse_finite(cell);
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
        Err(line_error(self.file, self.line_number(row), why))
    }

    pub fn positive_number(&self, row: usize, column: usize) -> Result<Option<f64>, FitError> {
        let number = self.number(row, column)?;
        if let Some(value) = number.filter(|value| *value <= 0.0) {
            let name = &self.header[column];
            let why = format!("{name} = {value}: a standard deviation is greater than 0");
            return Err(line_error(self.file, self.line_number(row), why));
        }
        Ok(number)
    }
}

/// What divides cells, the most usual first. Any number of blanks and tabs divides cells that nothing else divides.
const CELL_SEPARATORS: [(u8, &str); 4] = [
    (b',', "commas"),
    (b';', "semicolons"),
    (b'\t', "tabs"),
    (b' ', "blanks"),
];

/// A line that is not empty, and its cells.
#[derive(Clone, Debug)]
pub struct TableLine {
    /// Counted from 1.
    pub number: usize,
    cells: csv::StringRecord,
}

impl TableLine {
    /// A cell, without blanks and quotes around it; empty beyond the last.
    pub fn cell(&self, at: usize) -> &str {
        let cell = self.cells.get(at).unwrap_or_default().trim();
        let inner = cell.strip_prefix('"').and_then(|c| c.strip_suffix('"'));
        inner.unwrap_or(cell).trim()
    }

    pub fn cells(&self) -> impl Iterator<Item = &str> {
        (0..self.cells.len()).map(|at| self.cell(at))
    }

    pub fn len(&self) -> usize {
        self.cells.len()
    }

    pub fn is_blank(&self) -> bool {
        self.cells().all(str::is_empty)
    }

    /// Whether it may be a comment.
    pub fn begins_with_hash(&self) -> bool {
        self.cell(0).starts_with('#')
    }

    /// Whether it may name columns.
    fn may_be_header(&self) -> bool {
        !self.is_blank() && !self.cells().any(is_number)
    }
}

/// Lines, one of which is the header.
pub struct TableLines {
    pub lines: Vec<TableLine>,
    pub header: usize,
    /// What divides cells, in words.
    pub separator: &'static str,
    /// Lines that are comments, of all and of those below the header.
    pub comments: [usize; 2],
}

fn is_comment(line: &str) -> bool {
    line.trim_start().starts_with('#')
}

/// Divides lines into cells. Lines that begin with # are left out up to a line, counted from 1.
fn split_cells(text: &str, separator: u8, up_to: usize) -> Vec<TableLine> {
    // Lines left out stay as empty ones, so that lines keep their numbers.
    let kept = text.lines().enumerate();
    let kept = kept.map(|(i, line)| {
        if i < up_to && is_comment(line) {
            ""
        } else {
            line
        }
    });
    let kept: String = match separator {
        b' ' => (kept.map(|line| line.split_whitespace().collect::<Vec<_>>().join("\t") + "\n"))
            .collect(),
        _ => kept.flat_map(|line| [line, "\n"]).collect(),
    };
    let mut reader = csv::ReaderBuilder::new()
        .delimiter(if separator == b' ' { b'\t' } else { separator })
        .has_headers(false)
        .flexible(true)
        .from_reader(kept.as_bytes());
    let (mut lines, mut number, mut counted) = (Vec::new(), 1, 0);
    for cells in reader.records().map_while(Result::ok) {
        // A record begins with the empty lines before it.
        let begin = cells.position().map_or(counted, |at| at.byte() as usize);
        let empty = kept[begin..].len() - kept[begin..].trim_start_matches('\n').len();
        let begin = begin + empty;
        number += kept[counted..begin].matches('\n').count();
        counted = begin;
        lines.push(TableLine { number, cells });
    }
    lines
}

/// A line that may be the header.
struct HeaderCandidate {
    line: usize,
    known_columns: usize,
}

/// The line with most columns that are known, or else the one that looks most like a header.
fn header_candidate(lines: &[TableLine], known: &dyn Fn(&str) -> bool) -> HeaderCandidate {
    let count = |line: &TableLine| line.cells().filter(|name| known(name)).count();
    let counts = lines
        .iter()
        .enumerate()
        .filter(|(_, line)| line.may_be_header());
    let counts = counts.map(|(at, line)| (at, count(line)));
    let counts = counts.filter(|(_, count)| *count > 0);
    let (line, known_columns) = (counts.rev().max_by_key(|(_, count)| *count))
        .unwrap_or_else(|| (guess_header_line(lines), 0));
    HeaderCandidate {
        line,
        known_columns,
    }
}

/// Of the lines of words above a number the one with most of them; without such lines, the first.
fn guess_header_line(lines: &[TableLine]) -> usize {
    let last = lines.iter().rposition(|line| line.cells().any(is_number));
    let above = lines[..last.unwrap_or(0)].iter().enumerate();
    let words = above.filter(|(_, line)| line.may_be_header());
    let count = |line: &TableLine| line.cells().filter(|cell| !cell.is_empty()).count();
    let most = words.rev().max_by_key(|(_, line)| count(line));
    most.map_or(0, |(at, _)| at)
}

impl TableLines {
    /// The lines of a text without a header, of which columns are given by their numbers, below a header of numbers.
    fn split_numbered(text: &str, reading: &DataFileOptions) -> Option<Self> {
        let is_number_of_column = |name: &str| name.parse::<usize>().is_ok_and(|it| it > 0);
        if !(reading.columns.iter()).any(|map| is_number_of_column(&map.name)) {
            return None;
        }
        let splits = CELL_SEPARATORS.into_iter().filter_map(|(separator, word)| {
            let lines = split_cells(text, separator, usize::MAX);
            let first = lines.iter().find(|line| !line.is_blank())?;
            let (width, numbers) = (
                first.len(),
                first.cells().filter(|cell| is_number(cell)).count(),
            );
            (numbers > 0).then_some(((1000 * numbers / width, width), lines, word))
        });
        let splits: Vec<_> = splits.collect();
        // The separator with most cells that are numbers, then with most cells, then the most usual one.
        let ((_, width), mut lines, separator) =
            (splits.into_iter().rev()).max_by_key(|(rank, ..)| *rank)?;
        let names: Vec<String> = (1..=width).map(|number| number.to_string()).collect();
        let header = TableLine {
            number: 1,
            cells: names.into(),
        };
        lines.insert(0, header);
        let comments = text.lines().filter(|line| is_comment(line)).count();
        Some(TableLines {
            lines,
            header: 0,
            separator,
            comments: [comments; 2],
        })
    }

    /// Divides a text by the separator with which a line has most names that are `known`, and of
    /// such separators by one with which all rows have as many cells as that line. The names in
    /// the first column may begin with # if `named` is that column's.
    pub fn split_text(
        text: &str,
        known: &dyn Fn(&str) -> bool,
        named: &dyn Fn(&str) -> bool,
    ) -> Option<Self> {
        let mut best: Option<((usize, bool, usize), TableLines, u8)> = None;
        // The most cells of a line that other separators than blanks find.
        let mut best_width = 0;
        for (separator, word) in CELL_SEPARATORS {
            let lines = split_cells(text, separator, usize::MAX);
            let Some(first) = lines.iter().find(|line| !line.is_blank()) else {
                continue;
            };
            if separator != b' ' {
                best_width = best_width.max(lines.iter().map(TableLine::len).max().unwrap_or(0));
            }
            let HeaderCandidate {
                line: at,
                known_columns: count,
            } = header_candidate(&lines, known);
            let width = lines[at].len();
            let fits = lines[at..].iter().all(|line| line.len() == width);
            if separator == b' ' && (best_width > 1 || width == 1 || !fits) {
                continue;
            }
            // Where no name is known, the most cells.
            let cells = if count == 0 {
                width.max(first.len())
            } else {
                0
            };
            let rank = (count, fits && (count > 0 || width > 1), cells);
            if best.as_ref().is_none_or(|(best, ..)| rank > *best) {
                let found = TableLines {
                    lines,
                    header: at,
                    separator: word,
                    comments: [0; 2],
                };
                best = Some((rank, found, separator));
            }
        }
        let (_, mut found, separator) = best?;
        let (line, width) = (&found.lines[found.header], found.lines[found.header].len());
        let above = line.number;
        let comments = |lines: &[&str]| lines.iter().filter(|line| is_comment(line)).count();
        let all: Vec<&str> = text.lines().collect();
        let (before, below) = all.split_at(above);
        found.comments = [comments(&all), comments(below)];
        if named(line.cell(0)) {
            found.lines = split_cells(text, separator, above);
            let left_out = |line: &TableLine| {
                line.number > above && line.begins_with_hash() && line.len() != width
            };
            let among = found.lines.iter().filter(|line| left_out(line)).count();
            found.lines.retain(|line| !left_out(line));
            found.comments = [comments(before) + among, among];
        }
        Some(found)
    }
}
