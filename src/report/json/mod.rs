//! JSON, for scripts: compact, numbers that are not finite as null.

#[cfg(test)]
mod summary;

use std::io::{self, Write};

use serde::Serialize;
use serde_json::ser::Formatter;

use super::Format;

/// A result as it serializes, in a file of this name: also what `--json` prints.
pub struct Json(pub &'static str);

impl<R: Serialize> Format<R> for Json {
    fn file_name(&self) -> &'static str {
        self.0
    }

    fn write(&self, result: &R, out: &mut dyn Write) -> io::Result<()> {
        write(result, out)
    }
}

/// Writes the whole file. Numbers that are not finite are null.
pub fn write(object: &impl Serialize, out: &mut dyn Write) -> io::Result<()> {
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
    use crate::report::Format;

    pub fn text<R>(format: &dyn Format<R>, result: &R) -> String {
        let mut bytes = Vec::new();
        format.write(result, &mut bytes).unwrap();
        String::from_utf8(bytes).unwrap()
    }

    /// Keys of the outermost object, in the order written.
    pub fn keys(text: &str) -> Vec<&str> {
        text.lines()
            .filter_map(|line| line.strip_prefix("  \""))
            .map(|line| line.split('"').next().unwrap())
            .collect()
    }
}
