//! The error of a refused scenario: one message for people, with its place; and excerpts of what was
//! written, for messages.

use crate::scenario::format::Key;
use std::borrow::Cow;
use std::fmt;
use std::ops::Range;

/// What reading a scenario, or a part of it, gives.
pub(in crate::scenario) type ScenarioResult<T> = std::result::Result<T, ScenarioError>;

/// Why a scenario was refused. The error's text is the whole message: the place, the key, the
/// value found, and what to change.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{}", self.message_with_option("set"))]
pub struct ScenarioError {
    /// Where the refused value was written.
    pub place: SourceLocation,
    /// The key, if it is one of the format.
    pub key: Option<Key>,
    /// The message without the place.
    pub problem: String,
    /// Errors about other entries that do not follow from this one, in the order of the format, as far
    /// as they can be told; the message has unknown keys first, and all others in the order of their lines.
    pub others: Vec<ScenarioError>,
}

/// What messages about keys that there are not begin with.
pub(super) const UNKNOWN_KEY: &str = "unknown key";

impl ScenarioError {
    /// An error at a place, alone and of no key.
    pub(super) fn at_place(place: SourceLocation, problem: String) -> Self {
        ScenarioError {
            place,
            key: None,
            problem,
            others: Vec::new(),
        }
    }

    /// An error about a file, or a line of it, rather than the value of a key.
    pub(in crate::scenario) fn in_file(file: &str, line: Option<usize>, problem: String) -> Self {
        let file = file.to_string();
        ScenarioError::at_place(SourceLocation::File { file, line }, problem)
    }

    /// The whole message, where overrides are given by this option.
    pub fn message_with_option(&self, option: &str) -> String {
        let mut all: Vec<&ScenarioError> = [self].into_iter().chain(&self.others).collect();
        // Unknown keys first, as others may follow from them; then in the order of the lines of the file, then what it
        // lacks, then what is set.
        all.sort_by_key(|error| {
            let line = match error.place {
                SourceLocation::File { line, .. } => line.unwrap_or(usize::MAX - 1),
                SourceLocation::Set { .. } => usize::MAX,
            };
            (!error.problem.starts_with(UNKNOWN_KEY), line)
        });
        let all = all.into_iter().map(|error| match &error.place {
            SourceLocation::Set { given } => format!("{option} {given}: {}", error.problem),
            place => format!("{place}: {}", error.problem),
        });
        let all: Vec<String> = all.collect();
        printable(&all.join("\n")).into_owned()
    }
}

/// Where a value was written, or is missing.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum SourceLocation {
    /// In a file.
    File {
        /// The file.
        file: String,
        /// The line, counted from 1; `None` for the whole file.
        line: Option<usize>,
    },
    /// In an override.
    Set {
        /// The whole `KEY=VALUE`.
        given: String,
    },
}

impl fmt::Display for SourceLocation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            SourceLocation::File { file, line } => {
                f.write_str(file)?;
                line.map_or(Ok(()), |line| write!(f, ":{line}"))
            }
            SourceLocation::Set { given } => write!(f, "set {given}"),
        }
    }
}

/// Characters of what is shown in messages of what was written.
struct ExcerptSizes {
    /// Longest line that is shown with a caret below.
    line_width: usize,
    /// Longest value or key; the rest is left out.
    shortened_length: usize,
}

const EXCERPTS: ExcerptSizes = ExcerptSizes {
    line_width: 120,
    shortened_length: 60,
};

/// Escapes characters that a terminal would interpret: control characters other than
/// line ends and tabs, and marks of the writing direction.
pub fn printable(message: &str) -> Cow<'_, str> {
    let interpreted = |c: char| {
        c.is_control() && !matches!(c, '\n' | '\t')
            || matches!(c, '\u{200e}' | '\u{200f}' | '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}')
    };
    if !message.contains(interpreted) {
        return message.into();
    }
    let mut shown = String::new();
    for c in message.chars() {
        match interpreted(c) {
            true => shown.extend(c.escape_default()),
            false => shown.push(c),
        }
    }
    shown.into()
}

/// The line of `text` that holds byte `at`, counted from 1.
pub(in crate::scenario) fn line_number_at(text: &[u8], at: usize) -> usize {
    let before = text[..at.min(text.len())].iter();
    1 + before.filter(|byte| **byte == b'\n').count()
}

/// The offending line with a caret below, to be put after a message; empty
/// where the line is too long to be read.
pub(super) fn line_with_caret(text: &str, span: Range<usize>) -> String {
    let at = span.start.min(text.len());
    let (Some(before), Some(after)) = (text.get(..at), text.get(at..)) else {
        return String::new();
    };
    let start = before.rfind('\n').map_or(0, |newline| newline + 1);
    let line = text[start..at + after.find('\n').unwrap_or(after.len())].trim_end();
    let length = line.chars().count();
    if length > EXCERPTS.line_width {
        return String::new();
    }
    let number = line_number_at(text.as_bytes(), at).to_string();
    let gap = " ".repeat(number.len());
    // Tabs stay tabs, so that the caret stands below its character.
    let indent = text[start..at].replace(|c| c != '\t', " ");
    let width = text
        .get(span.start..span.end.max(span.start))
        .map_or(1, |s| s.trim_end().chars().count());
    let room = length.saturating_sub(indent.chars().count()).max(1);
    let carets = "^".repeat(width.clamp(1, room));
    format!("\n{gap} |\n{number} | {line}\n{gap} | {indent}{carets}")
}

/// `text` on one line, cut off where it is long.
pub(super) fn shorten_excerpt(text: &str) -> String {
    let mut short = String::new();
    for word in text.split_whitespace() {
        if !short.is_empty() {
            short.push(' ');
        }
        short.push_str(word);
        if let Some((cut, _)) = short.char_indices().nth(EXCERPTS.shortened_length) {
            short.truncate(cut);
            short.push_str(" ...");
            break;
        }
    }
    short
}
