//! Decimal points and decimal commas.

use super::decoded::refuse;
use crate::study::fit::FitError;

/// How the numbers of a file are written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Decimals {
    pub mark: Mark,
    /// Whether thousands are divided by the other mark.
    pub grouped: bool,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mark {
    Point,
    Comma,
}

impl Mark {
    fn character(self) -> char {
        match self {
            Mark::Point => '.',
            Mark::Comma => ',',
        }
    }

    fn other(self) -> Mark {
        match self {
            Mark::Point => Mark::Comma,
            Mark::Comma => Mark::Point,
        }
    }
}

/// The number in a cell with this decimal mark; the other mark may divide thousands.
fn read(cell: &str, mark: Mark) -> Option<f64> {
    let group = mark.other().character();
    // U+2212 is the minus sign of typeset numbers.
    let mut plain = cell.replacen('\u{2212}', "-", 2);
    if plain.contains(group) {
        let whole = plain.split(mark.character()).next()?;
        let mut groups = whole.trim_start_matches(['+', '-']).split(group);
        let first = groups.next()?;
        let leads = (1..=3).contains(&first.len()) && !first.starts_with('0');
        if !leads || !groups.all(|group| group.len() == 3) {
            return None;
        }
        let fraction = plain.split_once(mark.character());
        let fraction = fraction.map_or("", |(_, fraction)| fraction);
        let digits = |text: &str| text.chars().all(|digit| digit.is_ascii_digit());
        if !digits(fraction) {
            return None;
        }
        let whole = whole.replace(group, "");
        if !digits(whole.trim_start_matches(['+', '-'])) {
            return None;
        }
        plain = format!("{whole}.{fraction}");
    } else if mark == Mark::Comma {
        plain = plain.replace(',', ".");
    }
    let number = plain.parse::<f64>().ok();
    number.filter(|number| number.is_finite())
}

/// Whether a cell is a number, with either mark.
pub fn is_number(cell: &str) -> bool {
    [Mark::Point, Mark::Comma]
        .iter()
        .any(|mark| read(cell, *mark).is_some())
}

/// Whether a number has four digits or more before its decimal mark, which nothing divides.
fn is_long(cell: &str, mark: Mark) -> bool {
    let end = [mark.character(), 'e', 'E'];
    let whole = cell.split(end).next().unwrap_or(cell);
    let digits = whole.trim_start_matches(['+', '-', '\u{2212}']);
    digits.len() > 3 && !digits.contains(mark.other().character())
}

impl Decimals {
    /// The marks of these cells, each with its line. A cell that is a number with one of the
    /// marks only decides for all.
    pub fn of<'c>(
        cells: impl Iterator<Item = (usize, &'c str)> + Clone,
        file: &str,
    ) -> Result<Self, FitError> {
        let marked = cells.filter(|(_, cell)| cell.contains(['.', ',']));
        let reads = |cell: &str, mark| read(cell, mark).is_some();
        let proof = |mark: Mark| {
            let mut cells = marked.clone();
            cells.find(|(_, cell)| reads(cell, mark) && !reads(cell, mark.other()))
        };
        let mark = match (proof(Mark::Point), proof(Mark::Comma)) {
            (Some((line, point)), Some((other, comma))) => {
                let why = format!(
                    "{point} has a decimal point, and {comma} in line {other} a decimal comma: \
                     write all numbers of a file with one of them"
                );
                return Err(refuse(file, line, why));
            }
            (_, Some(_)) => Mark::Comma,
            (Some(_), None) => Mark::Point,
            (None, None) => {
                let mut either = marked.clone();
                let unclear =
                    either.find(|(_, cell)| cell.contains(',') && reads(cell, Mark::Comma));
                if let Some((line, cell)) = unclear {
                    let point = cell.replace(',', ".");
                    let why = format!(
                        "{cell} may be {point} or {}, and no other number of the file tells which: \
                         write numbers with a decimal point, and thousands undivided",
                        cell.replace(',', "")
                    );
                    return Err(refuse(file, line, why));
                }
                Mark::Point
            }
        };
        let group = mark.other().character();
        let mut grouped = marked.clone();
        let grouped = grouped.find(|(_, cell)| cell.contains(group) && reads(cell, mark));
        let mut long = marked.clone();
        let long = long.find(|(_, cell)| reads(cell, mark) && is_long(cell, mark));
        if let (Some((line, grouped)), Some((other, long))) = (grouped, long) {
            let why = format!(
                "{grouped} has its thousands divided, or another decimal mark, and {long} in line \
                 {other} has not: write all numbers of a file alike"
            );
            return Err(refuse(file, line, why));
        }
        Ok(Decimals {
            mark,
            grouped: grouped.is_some(),
        })
    }

    /// The finite number in a cell.
    pub fn number(self, cell: &str) -> Option<f64> {
        read(cell, self.mark)
    }
}
