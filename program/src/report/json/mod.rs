//! JSON, for scripts: compact, numbers that are not finite as null.

use std::io::{self, Write};

use serde::Serialize;
use serde_json::ser::Formatter;

/// Writes the whole file. Numbers that are not finite are null.
pub fn write_json(object: &impl Serialize, out: &mut dyn Write) -> io::Result<()> {
    let mut serializer = serde_json::Serializer::with_formatter(&mut *out, Layout::default());
    object.serialize(&mut serializer)?;
    out.write_all(b"\n")
}

/// Compact JSON with each key of the outermost object on its own line.
#[derive(Default)]
struct Layout {
    depth: usize,
}

impl Formatter for Layout {
    fn begin_object<W: ?Sized + Write>(&mut self, out: &mut W) -> io::Result<()> {
        self.depth += 1;
        out.write_all(b"{")
    }

    fn end_object<W: ?Sized + Write>(&mut self, out: &mut W) -> io::Result<()> {
        self.depth -= 1;
        out.write_all(if self.depth == 0 { b"\n}" } else { b"}" })
    }

    fn begin_object_key<W: ?Sized + Write>(&mut self, out: &mut W, first: bool) -> io::Result<()> {
        if !first {
            out.write_all(b",")?;
        }
        out.write_all(match (self.depth, first) {
            (1, _) => b"\n  ",
            (_, true) => b"",
            (_, false) => b" ",
        })
    }

    fn begin_object_value<W: ?Sized + Write>(&mut self, out: &mut W) -> io::Result<()> {
        out.write_all(b": ")
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::sample;

    #[test]
    fn numbers_keep_every_digit_or_are_null() {
        let mut leaf = sample::fan(5, 8);
        leaf.energy = Some(0.1 + 0.2);
        leaf.accuracy.residual = Some(f64::INFINITY);
        let mut bytes = Vec::new();
        write_json(&leaf, &mut bytes).unwrap();
        let text = String::from_utf8(bytes).unwrap();
        for line in ["\"energy\": 0.30000000000000004", "\"residual\": null"] {
            assert!(text.contains(&format!("\n  {line},\n")), "{text}");
        }
    }
}
