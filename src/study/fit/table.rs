//! Tables of numbers, as read from CSV.

use super::FitError;

/// The column of the names of experiments.
pub(super) const NAME: &str = "experiment";

/// A parsed table.
pub(super) struct Table<'t> {
    pub file: &'t str,
    pub header: Vec<&'t str>,
    /// Lines, counted from 1, and their cells.
    pub rows: Vec<(usize, Vec<&'t str>)>,
    /// Number of lines that are comments.
    pub comments: usize,
    /// How many of these are below the header.
    pub comments_among_rows: usize,
}

pub(super) fn refuse(file: &str, line: usize, why: impl std::fmt::Display) -> FitError {
    FitError::Data(format!("{file}:{line}: {why}"))
}

/// Whether a line may be a comment.
fn begins_with_hash(line: &str) -> bool {
    line.trim_start().starts_with('#')
}

fn unquoted(cell: &str) -> &str {
    let cell = cell.trim();
    let inner = cell.strip_prefix('"').and_then(|c| c.strip_suffix('"'));
    inner.unwrap_or(cell).trim()
}

impl<'t> Table<'t> {
    pub fn of(text: &'t str, file: &'t str) -> Result<Self, FitError> {
        let text = text.strip_prefix('\u{feff}').unwrap_or(text);
        if text.contains('\r') && !text.contains('\n') {
            let why = "has line ends of CR alone: save it with line ends LF or CR LF";
            return Err(refuse(file, 1, why));
        }
        let lines = text.lines().enumerate().map(|(i, line)| (i + 1, line));
        let mut lines = lines.filter(|(_, line)| !line.trim().is_empty());
        let mut comments = 0;
        let header = lines.by_ref().find(|(_, line)| {
            let comment = begins_with_hash(line);
            comments += usize::from(comment);
            !comment
        });
        let Some((first, header)) = header else {
            return Err(refuse(
                file,
                1,
                "is empty: give a header, and a row for each datum",
            ));
        };
        if !header.contains(',') && header.contains([';', '\t']) {
            let why = "columns are divided by commas, and numbers have a decimal point";
            return Err(refuse(file, first, why));
        }
        let header: Vec<&str> = header.split(',').map(unquoted).collect();
        if header.iter().any(|name| name.parse::<f64>().is_ok()) {
            let why = "has no header: the first line names the columns, such as \
                       load.tip_force[0],tip_x,sd_tip_x, or rod,sigma,x,y,z";
            return Err(refuse(file, first, why));
        }
        for (k, name) in header.iter().enumerate() {
            if header[..k].contains(name) {
                let why = format!("the column {name} stands there twice: leave one out");
                return Err(refuse(file, first, why));
            }
        }
        let above = comments;
        // Names may begin with #, and numbers do not.
        let named = header[0] == NAME;
        let mut rows = Vec::new();
        for (line, text) in lines {
            let cells: Vec<&str> = text.split(',').map(unquoted).collect();
            if begins_with_hash(text) && !(named && cells.len() == header.len()) {
                comments += 1;
                continue;
            }
            if cells.len() != header.len() {
                let (found, wanted) = (cells.len(), header.len());
                let why = format!(
                    "has {found} cells, and the header {wanted}: cells are divided by commas, \
                     numbers have a decimal point"
                );
                return Err(refuse(file, line, why));
            }
            rows.push((line, cells));
        }
        if rows.is_empty() {
            let why = match comments {
                0 => "has no row below the header".into(),
                _ => format!(
                    "has no row below the header ({comments} lines that begin with # are comments)"
                ),
            };
            return Err(refuse(file, first, why));
        }
        Ok(Table {
            file,
            header,
            rows,
            comments,
            comments_among_rows: comments - above,
        })
    }

    /// The number in a cell; `None` if it is empty.
    pub fn number(&self, row: usize, column: usize) -> Result<Option<f64>, FitError> {
        let (line, cells) = &self.rows[row];
        let cell = cells[column];
        if cell.is_empty() {
            return Ok(None);
        }
        match cell.parse::<f64>() {
            Ok(value) if value.is_finite() => Ok(Some(value)),
            _ => {
                let name = self.header[column];
                let why = format!(
                    "{name} = {cell}: must be a finite number, or empty where nothing was measured"
                );
                Err(refuse(self.file, *line, why))
            }
        }
    }

    pub fn positive(&self, row: usize, column: usize) -> Result<Option<f64>, FitError> {
        let number = self.number(row, column)?;
        if let Some(value) = number.filter(|value| *value <= 0.0) {
            let name = self.header[column];
            let why = format!("{name} = {value}: a standard deviation is greater than 0");
            return Err(refuse(self.file, self.rows[row].0, why));
        }
        Ok(number)
    }
}
