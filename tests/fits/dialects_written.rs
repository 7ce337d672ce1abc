//! Whatever the dialect in which a table is written, it is read as the same numbers, or refused where
//! that dialect does not tell which they are.

use proptest::prelude::*;

use super::dialects::{numbers, read, utf16};

/// The lines of a table between which others may stand.
#[derive(Clone, Debug)]
struct Dialect {
    separator: &'static str,
    comma: bool,
    minus: bool,
    end: &'static str,
    quoted: bool,
    before: usize,
    units: bool,
    blank: bool,
    behind: bool,
    encoding: usize,
}

fn dialect() -> impl Strategy<Value = Dialect> {
    let separator = prop::sample::select(vec![",", ";", "\t"]);
    let end = prop::sample::select(vec!["\n", "\r\n"]);
    let flags = prop::array::uniform6(any::<bool>());
    (separator, end, flags, 0..3_usize, 0..4_usize).prop_map(
        |(separator, end, [comma, minus, quoted, units, blank, behind], before, encoding)| {
            Dialect {
                separator,
                comma: comma && separator != ",",
                minus,
                end,
                quoted,
                before,
                units,
                blank,
                behind,
                encoding,
            }
        },
    )
}

impl Dialect {
    fn write(&self, rows: &[[f64; 2]]) -> Vec<u8> {
        let number = |x: f64| {
            let text = format!("{x:?}");
            let text = if self.comma {
                text.replace('.', ",")
            } else {
                text
            };
            if self.minus {
                text.replace('-', "\u{2212}")
            } else {
                text
            }
        };
        let quoted = |cell: String| {
            if self.quoted {
                format!("\"{cell}\"")
            } else {
                cell
            }
        };
        let behind = if self.behind { self.separator } else { "" };
        let line = |cells: [String; 2]| cells.map(quoted).join(self.separator) + behind;
        let mut lines = vec![format!("Specimen{}leaf", self.separator); self.before];
        lines.push(line(["load.tip_force[2]", "tip_z"].map(String::from)));
        if self.units {
            lines.push(line(["[N]", ""].map(String::from)));
        }
        for row in rows {
            lines.push(line(row.map(number)));
            if self.blank {
                lines.push(self.separator.into());
                lines.push(String::new());
            }
        }
        let text: String = lines
            .iter()
            .map(|line| format!("{line}{}", self.end))
            .collect();
        match self.encoding {
            0 => text.into(),
            1 => format!("\u{feff}{text}").into(),
            2 => utf16(&text, u16::to_le_bytes),
            _ => utf16(&text, u16::to_be_bytes),
        }
    }
}

proptest! {
    /// A table is read as the numbers that were written, to the last bit, whatever the dialect.
    /// A number whose mark cannot be told is refused, not read as another.
    #[test]
    fn what_is_written_is_read(
        rows in prop::collection::vec([-1e6..1e6, -1.0..1.0], 1..6),
        dialect in dialect(),
    ) {
        match read(dialect.write(&rows)) {
            Ok(data) => {
                let wanted: Vec<Vec<f64>> = rows.iter().map(|row| row.to_vec()).collect();
                prop_assert_eq!(numbers(&data), wanted);
            }
            Err(refused) => prop_assert!(
                refused.contains("may be") || refused.contains("thousands divided"), "{}", refused
            ),
        }
    }

    /// The same of numbers with three decimals at most, as balances write them: those that could
    /// be thousands.
    #[test]
    fn thousandths_are_never_thousands(
        thousandths in prop::collection::vec([-2_000_000..2_000_000_i32, -9999..9999_i32], 1..5),
        dialect in dialect(),
    ) {
        let rows: Vec<[f64; 2]> = thousandths.iter().map(|row| row.map(|x| f64::from(x) / 1000.0)).collect();
        match read(dialect.write(&rows)) {
            Ok(data) => {
                let wanted: Vec<Vec<f64>> = rows.iter().map(|row| row.to_vec()).collect();
                prop_assert_eq!(numbers(&data), wanted);
            }
            Err(refused) => prop_assert!(
                refused.contains("may be") || refused.contains("thousands divided"), "{}", refused
            ),
        }
    }
}
