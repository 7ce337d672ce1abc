//! A value as written, wherever it is from: read from a text, or a value alone.

use std::ops::Range;

use toml::de::DeValue;
use toml::{Spanned, Value};

use super::excerpt::shorten;

/// A value, or a part of one.
#[derive(Clone, Copy)]
pub(super) enum Node<'e> {
    /// As it stands in a text.
    Read(&'e Spanned<DeValue<'e>>),
    /// Of no text.
    Alone(&'e Value),
}

/// A number is larger than numbers can be.
pub(super) struct TooLarge;

impl<'e> Node<'e> {
    pub(super) fn text(self) -> Option<&'e str> {
        match self {
            Node::Read(value) => value.get_ref().as_str(),
            Node::Alone(value) => value.as_str(),
        }
    }

    pub(super) fn switch(self) -> Option<bool> {
        match self {
            Node::Read(value) => value.get_ref().as_bool(),
            Node::Alone(value) => value.as_bool(),
        }
    }

    /// A whole number that is not negative.
    pub(super) fn whole(self) -> Option<usize> {
        match self {
            Node::Read(value) => {
                let integer = value.get_ref().as_integer()?;
                usize::from_str_radix(integer.as_str(), integer.radix()).ok()
            }
            Node::Alone(value) => value.as_integer()?.try_into().ok(),
        }
    }

    /// A number.
    pub(super) fn number(self) -> Option<Result<f64, TooLarge>> {
        let value = match self {
            Node::Alone(value) => return number(value).map(Ok),
            Node::Read(value) => value.get_ref(),
        };
        // 1e999 parses to infinity, which nobody wrote.
        let (value, says_infinite) = match value {
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
        let value = value.filter(|value| says_infinite || !f64::is_infinite(*value));
        Some(value.ok_or(TooLarge))
    }

    /// How many entries a list has.
    pub(super) fn length(self) -> Option<usize> {
        match self {
            Node::Read(value) => value.get_ref().as_array().map(|list| list.len()),
            Node::Alone(value) => value.as_array().map(Vec::len),
        }
    }

    /// An entry of a list.
    pub(super) fn entry(self, index: usize) -> Option<Node<'e>> {
        match self {
            Node::Read(value) => value.get_ref().get(index).map(Node::Read),
            Node::Alone(value) => value.get(index).map(Node::Alone),
        }
    }

    /// The names of the entries of a table.
    pub(super) fn names(self) -> Option<Vec<&'e str>> {
        match self {
            Node::Read(value) => {
                let table = value.get_ref().as_table()?;
                Some(table.keys().map(|name| name.get_ref().as_ref()).collect())
            }
            Node::Alone(value) => Some(value.as_table()?.keys().map(String::as_str).collect()),
        }
    }

    /// An entry of a table.
    pub(super) fn named(self, name: &str) -> Option<Node<'e>> {
        match self {
            Node::Read(value) => value.get_ref().get(name).map(Node::Read),
            Node::Alone(value) => value.get(name).map(Node::Alone),
        }
    }

    /// Where it stands in its text.
    pub(super) fn span(self) -> Range<usize> {
        match self {
            Node::Read(value) => value.span(),
            Node::Alone(_) => 0..0,
        }
    }

    /// As it is written in `text`, or would be, in short.
    pub(super) fn shown(self, text: &str) -> String {
        match self {
            Node::Read(value) => shorten(text.get(value.span()).unwrap_or("")),
            Node::Alone(value) => shorten(&value.to_string()),
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
