//! The lines of a table, divided into cells, and which of them is the header.

use super::decimals::is_number;

/// What divides cells, the most usual first.
const SEPARATORS: [(u8, &str); 3] = [(b',', "commas"), (b';', "semicolons"), (b'\t', "tabs")];

/// A line that is not empty, and its cells.
#[derive(Clone, Debug)]
pub struct Line {
    /// Counted from 1.
    pub number: usize,
    cells: csv::StringRecord,
}

impl Line {
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
    fn is_header(&self) -> bool {
        !self.is_blank() && !self.cells().any(is_number)
    }
}

/// Lines, one of which is the header.
pub struct Lines {
    pub lines: Vec<Line>,
    /// Index of the header.
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
fn divided(text: &str, separator: u8, up_to: usize) -> Vec<Line> {
    // Lines left out stay as empty ones, so that lines keep their numbers.
    let kept = text.lines().enumerate();
    let kept = kept.map(|(i, line)| {
        if i < up_to && is_comment(line) {
            ""
        } else {
            line
        }
    });
    let kept: String = kept.flat_map(|line| [line, "\n"]).collect();
    let mut reader = csv::ReaderBuilder::new()
        .delimiter(separator)
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
        lines.push(Line { number, cells });
    }
    lines
}

/// The line with most columns that are known, and how many these are.
fn header(lines: &[Line], known: &dyn Fn(&str) -> bool) -> Option<(usize, usize)> {
    let count = |line: &Line| line.cells().filter(|name| known(name)).count();
    let counts = lines
        .iter()
        .enumerate()
        .filter(|(_, line)| line.is_header());
    let counts = counts.map(|(at, line)| (at, count(line)));
    let counts = counts.filter(|(_, count)| *count > 0);
    counts.rev().max_by_key(|(_, count)| *count)
}

/// Of the lines of words above a number the one with most of them; without such lines, the first.
fn unknown_header(lines: &[Line]) -> usize {
    let last = lines.iter().rposition(|line| line.cells().any(is_number));
    let above = lines[..last.unwrap_or(0)].iter().enumerate();
    let words = above.filter(|(_, line)| line.is_header());
    let count = |line: &Line| line.cells().filter(|cell| !cell.is_empty()).count();
    let most = words.rev().max_by_key(|(_, line)| count(line));
    most.map_or(0, |(at, _)| at)
}

impl Lines {
    /// Divides a text by the separator with which a line has most names that are `known`, and of
    /// such separators by one with which all rows have as many cells as that line. The names in
    /// the first column may begin with # if `named` is that column's.
    pub fn of(
        text: &str,
        known: &dyn Fn(&str) -> bool,
        named: &dyn Fn(&str) -> bool,
    ) -> Option<Self> {
        let mut best: Option<((usize, bool, usize), Lines, u8)> = None;
        for (separator, word) in SEPARATORS {
            let lines = divided(text, separator, usize::MAX);
            let Some(first) = lines.iter().find(|line| !line.is_blank()) else {
                continue;
            };
            let (at, count) = header(&lines, known).unwrap_or((unknown_header(&lines), 0));
            let width = lines[at].len();
            let fits = lines[at..].iter().all(|line| line.len() == width);
            // Where no name is known, the most cells.
            let cells = if count == 0 {
                width.max(first.len())
            } else {
                0
            };
            let rank = (count, fits && (count > 0 || width > 1), cells);
            if best.as_ref().is_none_or(|(best, ..)| rank > *best) {
                let found = Lines {
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
            found.lines = divided(text, separator, above);
            let left_out =
                |line: &Line| line.number > above && line.begins_with_hash() && line.len() != width;
            let among = found.lines.iter().filter(|line| left_out(line)).count();
            found.lines.retain(|line| !left_out(line));
            found.comments = [comments(before) + among, among];
        }
        Some(found)
    }
}
