//! Excerpts of user input for messages.

use std::borrow::Cow;

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
pub(super) fn line_of(text: &[u8], at: usize) -> usize {
    let before = text[..at.min(text.len())].iter();
    1 + before.filter(|byte| **byte == b'\n').count()
}

/// The offending line with a caret below, to be put after a message; empty
/// where the line is too long to be read.
pub(super) fn snippet(text: &str, span: std::ops::Range<usize>) -> String {
    const WIDEST: usize = 120;
    let at = span.start.min(text.len());
    let (Some(before), Some(after)) = (text.get(..at), text.get(at..)) else {
        return String::new();
    };
    let start = before.rfind('\n').map_or(0, |newline| newline + 1);
    let line = text[start..at + after.find('\n').unwrap_or(after.len())].trim_end();
    let length = line.chars().count();
    if length > WIDEST {
        return String::new();
    }
    let number = line_of(text.as_bytes(), at).to_string();
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

/// `text` on one line and not too long.
pub(super) fn shorten(text: &str) -> String {
    const LONGEST: usize = 60;
    let mut short = String::new();
    for word in text.split_whitespace() {
        if !short.is_empty() {
            short.push(' ');
        }
        short.push_str(word);
        if let Some((cut, _)) = short.char_indices().nth(LONGEST) {
            short.truncate(cut);
            short.push_str(" ...");
            break;
        }
    }
    short
}
