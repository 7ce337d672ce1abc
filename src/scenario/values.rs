//! Values as they are written, before anything is known of their meaning.

use toml::de::DeValue;
use toml::{Spanned, Value};

use super::excerpt::shorten;

/// Parses a value. What is no TOML is a text.
pub(super) fn parse(text: &str) -> std::result::Result<Spanned<DeValue<'_>>, toml::de::Error> {
    match DeValue::parse(text) {
        Err(_) if !text.is_empty() && !text.starts_with(['[', '{', '"', '\'']) => {
            Ok(Spanned::new(0..text.len(), DeValue::String(text.into())))
        }
        parsed => parsed,
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

/// Multiplies every number; knots and times stay where they are.
pub(super) fn multiply(value: &mut Value, factor: f64) -> std::result::Result<(), String> {
    if let Some(number) = number(value) {
        *value = Value::Float(number * factor);
        return Ok(());
    }
    match value {
        Value::Array(list) => list
            .iter_mut()
            .try_for_each(|entry| multiply(entry, factor)),
        Value::Table(table) => {
            let lists = table.iter_mut().filter(|(name, _)| *name != "at");
            lists
                .map(|(_, list)| list)
                .try_for_each(|list| multiply(list, factor))
        }
        other => Err(format!(
            "{} is no number to be scaled: write numbers first",
            shorten(&other.to_string())
        )),
    }
}
