//! A value of a scenario from either source: parsed from a text, or given as a value.

use toml::de::DeValue;
use toml::{Spanned, Value};

use super::excerpt::shorten;

/// A value, or a part of one.
#[derive(Clone, Copy)]
pub(super) enum Node<'e> {
    /// Parsed from a text.
    Parsed(&'e Spanned<DeValue<'e>>),
    /// Not from a text.
    Bare(&'e Value),
}

/// The error that a number is too large for a floating-point number.
pub(super) struct TooLarge;

impl<'e> Node<'e> {
    pub(super) fn text(self) -> Option<&'e str> {
        match self {
            Node::Parsed(value) => value.get_ref().as_str(),
            Node::Bare(value) => value.as_str(),
        }
    }

    pub(super) fn switch(self) -> Option<bool> {
        match self {
            Node::Parsed(value) => value.get_ref().as_bool(),
            Node::Bare(value) => value.as_bool(),
        }
    }

    /// A whole number that is not negative.
    pub(super) fn whole(self) -> Option<usize> {
        match self {
            Node::Parsed(value) => {
                let integer = value.get_ref().as_integer()?;
                usize::from_str_radix(integer.as_str(), integer.radix()).ok()
            }
            Node::Bare(value) => value.as_integer()?.try_into().ok(),
        }
    }

    pub(super) fn number(self) -> Option<std::result::Result<f64, TooLarge>> {
        let value = match self {
            Node::Bare(value) => return number(value).map(Ok),
            Node::Parsed(value) => value.get_ref(),
        };
        // 1e999 parses to infinity, but only `inf` means it.
        let (value, is_inf) = match value {
            DeValue::Integer(integer) if integer.radix() == 10 => {
                (integer.as_str().parse().ok(), false)
            }
            DeValue::Integer(integer) => {
                let value = u128::from_str_radix(integer.as_str(), integer.radix());
                (value.ok().map(|value| value as f64), false)
            }
            DeValue::Float(float) => (float.as_str().parse().ok(), float.as_str().contains("inf")),
            _ => return None,
        };
        let value = value.filter(|value| is_inf || !f64::is_infinite(*value));
        Some(value.ok_or(TooLarge))
    }

    /// The length of a list.
    pub(super) fn length(self) -> Option<usize> {
        match self {
            Node::Parsed(value) => value.get_ref().as_array().map(|list| list.len()),
            Node::Bare(value) => value.as_array().map(Vec::len),
        }
    }

    /// An entry of a list.
    pub(super) fn entry(self, index: usize) -> Option<Node<'e>> {
        match self {
            Node::Parsed(value) => value.get_ref().get(index).map(Node::Parsed),
            Node::Bare(value) => value.get(index).map(Node::Bare),
        }
    }

    /// The names of the entries of a table.
    pub(super) fn names(self) -> Option<Vec<&'e str>> {
        match self {
            Node::Parsed(value) => {
                let table = value.get_ref().as_table()?;
                Some(table.keys().map(|name| name.get_ref().as_ref()).collect())
            }
            Node::Bare(value) => Some(value.as_table()?.keys().map(String::as_str).collect()),
        }
    }

    /// An entry of a table.
    pub(super) fn named(self, name: &str) -> Option<Node<'e>> {
        match self {
            Node::Parsed(value) => value.get_ref().get(name).map(Node::Parsed),
            Node::Bare(value) => value.get(name).map(Node::Bare),
        }
    }

    pub(super) fn span(self) -> std::ops::Range<usize> {
        match self {
            Node::Parsed(value) => value.span(),
            Node::Bare(_) => 0..0,
        }
    }

    /// Its text, from `text` or as it would be written, shortened.
    pub(super) fn shown(self, text: &str) -> String {
        match self {
            Node::Parsed(value) => shorten(text.get(value.span()).unwrap_or("")),
            Node::Bare(value) => shorten(&value.to_string()),
        }
    }
}

/// The number that a value is.
pub(super) fn number(value: &Value) -> Option<f64> {
    match value {
        Value::Float(float) => Some(*float),
        Value::Integer(integer) => Some(*integer as f64),
        _ => None,
    }
}
