//! How the cells of a table are written: encoding of the text, decimal marks, units.

use crate::scenario::MOST_BYTES;
use crate::study::fit::columns::FitError;

/// How the numbers of a file are written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct NumberFormat {
    pub mark: DecimalMark,
    /// Whether thousands are divided by the other mark.
    pub grouped: bool,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DecimalMark {
    Point,
    Comma,
}

impl DecimalMark {
    fn character(self) -> char {
        match self {
            DecimalMark::Point => '.',
            DecimalMark::Comma => ',',
        }
    }

    fn thousands_mark(self) -> DecimalMark {
        match self {
            DecimalMark::Point => DecimalMark::Comma,
            DecimalMark::Comma => DecimalMark::Point,
        }
    }
}

/// The number in a cell with this decimal mark; the other mark may divide thousands.
fn parse_number(cell: &str, mark: DecimalMark) -> Option<f64> {
    let group = mark.thousands_mark().character();
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
    } else if mark == DecimalMark::Comma {
        plain = plain.replace(',', ".");
    }
    let number = plain.parse::<f64>().ok();
    number.filter(|number| number.is_finite())
}

/// Whether a cell is a number, with either mark.
pub fn is_number(cell: &str) -> bool {
    [DecimalMark::Point, DecimalMark::Comma]
        .iter()
        .any(|mark| parse_number(cell, *mark).is_some())
}

/// Whether a number has four digits or more before its decimal mark, which nothing divides.
fn is_ungrouped_long(cell: &str, mark: DecimalMark) -> bool {
    let end = [mark.character(), 'e', 'E'];
    let whole = cell.split(end).next().unwrap_or(cell);
    let digits = whole.trim_start_matches(['+', '-', '\u{2212}']);
    digits.len() > 3 && !digits.contains(mark.thousands_mark().character())
}

impl NumberFormat {
    /// The marks of these cells, each with its line. A cell that is a number with one of the
    /// marks only decides for all.
    pub fn detect<'c>(
        cells: impl Iterator<Item = (usize, &'c str)> + Clone,
        file: &str,
    ) -> Result<Self, FitError> {
        let marked = cells.filter(|(_, cell)| cell.contains(['.', ',']));
        let reads = |cell: &str, mark| parse_number(cell, mark).is_some();
        let proof = |mark: DecimalMark| {
            let mut cells = marked.clone();
            cells.find(|(_, cell)| reads(cell, mark) && !reads(cell, mark.thousands_mark()))
        };
        let mark = match (proof(DecimalMark::Point), proof(DecimalMark::Comma)) {
            (Some((line, point)), Some((other, comma))) => {
                let why = format!(
                    "{point} has a decimal point, and {comma} in line {other} a decimal comma: \
                     write all numbers of a file with one of them"
                );
                return Err(line_error(file, line, why));
            }
            (_, Some(_)) => DecimalMark::Comma,
            (Some(_), None) => DecimalMark::Point,
            (None, None) => {
                let mut either = marked.clone();
                let unclear =
                    either.find(|(_, cell)| cell.contains(',') && reads(cell, DecimalMark::Comma));
                if let Some((line, cell)) = unclear {
                    let point = cell.replace(',', ".");
                    let why = format!(
                        "{cell} may be {point} or {}, and no other number of the file tells which: \
                         write numbers with a decimal point, and thousands undivided",
                        cell.replace(',', "")
                    );
                    return Err(line_error(file, line, why));
                }
                DecimalMark::Point
            }
        };
        let group = mark.thousands_mark().character();
        let mut grouped = marked.clone();
        let grouped = grouped.find(|(_, cell)| cell.contains(group) && reads(cell, mark));
        let mut long = marked.clone();
        let long = long.find(|(_, cell)| reads(cell, mark) && is_ungrouped_long(cell, mark));
        if let (Some((line, grouped)), Some((other, long))) = (grouped, long) {
            let why = format!(
                "{grouped} has its thousands divided, or another decimal mark, and {long} in line \
                 {other} has not: write all numbers of a file alike"
            );
            return Err(line_error(file, line, why));
        }
        Ok(NumberFormat {
            mark,
            grouped: grouped.is_some(),
        })
    }

    /// The finite number in a cell.
    pub fn parse_finite(self, cell: &str) -> Option<f64> {
        parse_number(cell, self.mark)
    }
}

/// The refusal of a line of a file.
pub fn line_error(file: &str, line: usize, why: impl std::fmt::Display) -> FitError {
    FitError::Data(format!("{file}:{line}: {why}"))
}

/// A text, and its encoding if that is not UTF-8.
pub struct DecodedText {
    pub text: String,
    pub encoding: Option<&'static str>,
}

/// First bytes of archives, among them spreadsheets, and of older spreadsheets.
const SPREADSHEET_SIGNATURES: [&[u8]; 2] = [b"PK\x03\x04", b"\xd0\xcf\x11\xe0"];

/// Decodes UTF-8, UTF-16 with a byte order mark, and Latin-1.
pub fn decode(bytes: &[u8], file: &str) -> Result<DecodedText, FitError> {
    if bytes.len() as u64 > MOST_BYTES {
        let why = format!("is larger than {MOST_BYTES} bytes: keep every tenth row, or fewer");
        return Err(line_error(file, 1, why));
    }
    if SPREADSHEET_SIGNATURES
        .iter()
        .any(|first| bytes.starts_with(first))
    {
        let why = "is a spreadsheet or another archive: export the table as CSV, or give it in Python, which reads it by pandas";
        return Err(line_error(file, 1, why));
    }
    let (text, encoding) = match bytes {
        [0xff, 0xfe, rest @ ..] => (decode_utf16(rest, u16::from_le_bytes), Some("UTF-16")),
        [0xfe, 0xff, rest @ ..] => (decode_utf16(rest, u16::from_be_bytes), Some("UTF-16")),
        _ => match std::str::from_utf8(bytes) {
            Ok(text) => (Some(text.into()), None),
            Err(_) => (decode_latin_1(bytes), Some("Latin-1")),
        },
    };
    let Some(text) = text.filter(|text| !text.contains('\0')) else {
        return Err(line_error(
            file,
            1,
            "is not text in UTF-8: save the file as UTF-8",
        ));
    };
    let text = text.strip_prefix('\u{feff}').unwrap_or(&text);
    if text.contains('\r') && !text.contains('\n') {
        let why = "has line ends of CR alone: save it with line ends LF or CR LF";
        return Err(line_error(file, 1, why));
    }
    Ok(DecodedText {
        text: text.into(),
        encoding,
    })
}

fn decode_utf16(bytes: &[u8], unit: fn([u8; 2]) -> u16) -> Option<String> {
    let (pairs, rest) = bytes.as_chunks::<2>();
    let units: Vec<u16> = pairs.iter().map(|pair| unit(*pair)).collect();
    String::from_utf16(&units).ok().filter(|_| rest.is_empty())
}

/// The bytes from 0x80 to 0x9f have no characters in Latin-1, and different ones in its kin.
fn decode_latin_1(bytes: &[u8]) -> Option<String> {
    let known = bytes.iter().all(|byte| !(0x80..0xa0).contains(byte));
    known.then(|| bytes.iter().copied().map(char::from).collect())
}

/// Units that stand without brackets, in small letters: programs write them in either case.
const UNIT_NAMES: [&str; 61] = [
    "n", "mn", "un", "µn", "μn", "kn", "m", "dm", "cm", "mm", "um", "µm", "μm", "nm", "in", "inch",
    "ft", "px", "pixel", "s", "sec", "ms", "min", "h", "hz", "khz", "rad", "deg", "°", "%", "g",
    "mg", "kg", "gf", "kgf", "lbf", "pa", "kpa", "mpa", "gpa", "psi", "v", "mv", "j", "us", "µs",
    "μs", "second", "seconds", "minute", "minutes", "lb", "oz", "dyn", "bar", "°c", "°f", "a",
    "ma", "w", "count",
];

fn is_unit(cell: &str) -> bool {
    let pairs = [('(', ')'), ('[', ']')];
    let bracketed = |(open, close)| cell.starts_with(open) && cell.ends_with(close);
    cell.len() > 1 && pairs.into_iter().any(bracketed) || is_product_of_units(cell)
}

/// Whether a cell is a product or a quotient of units, which may have exponents, as `N/mm2`.
fn is_product_of_units(cell: &str) -> bool {
    let small = cell.to_lowercase();
    let base = |factor: &str| -> String {
        let factor = factor.trim();
        let exponent = |it: char| it.is_ascii_digit() || matches!(it, '^' | '-' | '²' | '³');
        factor.trim_end_matches(exponent).into()
    };
    let mut factors = small.split(['/', '*', '·']).enumerate();
    factors.all(|(at, factor)| match factor.trim() {
        "1" => at == 0 && small.contains('/'),
        factor => UNIT_NAMES.contains(&base(factor).as_str()),
    })
}

/// Whether a row has units: no number, and a unit in at least half of what else it has besides dashes.
pub fn is_unit_row<'c>(cells: impl Iterator<Item = &'c str>) -> bool {
    let cells = cells.filter(|cell| !matches!(*cell, "" | "-"));
    let cells: Vec<&str> = cells.collect();
    let units = cells.iter().filter(|cell| is_unit(cell)).count();
    units > 0 && 2 * units >= cells.len() && !cells.into_iter().any(is_number)
}
