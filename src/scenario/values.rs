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

/// The number that a value is. As JSON has no infinity, that may be a text.
pub(super) fn number(value: &Value) -> Option<f64> {
    match value {
        Value::Float(float) => Some(*float),
        Value::Integer(integer) => Some(*integer as f64),
        Value::String(text) if text == "inf" => Some(f64::INFINITY),
        _ => None,
    }
}

/// What people and word processors write for a minus sign: hyphens, dashes and the sign itself.
const MINUS_SIGNS: [char; 7] = [
    '\u{2010}', '\u{2011}', '\u{2012}', '\u{2013}', '\u{2014}', '\u{2015}', '\u{2212}',
];

/// How a text that a person would read as a number is written as one.
pub(crate) fn number_meant(text: &str) -> Option<String> {
    let meant = text.trim().replace(MINUS_SIGNS, "-").replacen(',', ".", 1);
    meant
        .parse::<f64>()
        .ok()
        .filter(|number| number.is_finite())?;
    let how = [
        (text.contains(','), "with a decimal point"),
        (text.contains(MINUS_SIGNS), "with a hyphen as minus sign"),
    ];
    let how: Vec<&str> = how
        .into_iter()
        .filter_map(|(is, how)| is.then_some(how))
        .collect();
    Some(match how.as_slice() {
        [] => format!("write {meant}, without quotes"),
        how => format!("write {meant}, {}", how.join(" and ")),
    })
}

/// The same of a number in a line that is no TOML.
pub(super) fn number_meant_in(line: &str) -> Option<String> {
    let value = line.split_once('=').map_or(line, |(_, value)| value);
    let value = value.split('#').next().unwrap_or(value);
    // In a list a comma divides numbers.
    let marks = ['[', ']', '{', '}', '=', ' ', '\t', ','];
    let in_list = value.split(marks).find(|part| part.contains(MINUS_SIGNS));
    let alone = (value.contains(',') || value.contains(MINUS_SIGNS)).then(|| number_meant(value));
    alone.flatten().or_else(|| number_meant(in_list?))
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

#[cfg(test)]
mod tests {
    use crate::scenario::{Entries, Scenario};
    use leafdyn_testing::pairs;

    /// A rod with this length, axial stiffness and load.
    fn rod(length: &str, axial: &str, load: &str) -> Result<Scenario, String> {
        let text = format!(
            "name = 'rod'\n[leaf]\nrods = 1\nlength = {length}\nfan = [0.0]\n[stiffness]\n\
             torsion = 1\nbending_2 = 1\nbending_3 = 1\naxial = {axial}\nshear_2 = [\"inf\"]\n\
             shear_3 = inf\n[load]\ngravity = {load} # down, -1\n"
        );
        Scenario::from_toml(&text).map_err(|refused| refused.to_string())
    }

    const LOAD: &str = "[0.0, 0.0, -1.0]";

    #[test]
    fn infinity_may_be_a_text() {
        let scenario = rod("1.5", "\"inf\"", LOAD).unwrap();
        assert_eq!(scenario, rod("1.5", "inf", LOAD).unwrap());
        let refused = rod("\"inf\"", "inf", LOAD).unwrap_err();
        assert!(refused.contains("must be a finite number"), "{refused}");
    }

    #[test]
    fn numbers_in_other_notation_are_explained() {
        let lengths = "
            1,5 => not valid TOML
            1,5 => : write 1.5, with a decimal point
            −1,5 => : write -1.5, with a decimal point and with a hyphen as minus sign
            ‐1.5 => : write -1.5, with a hyphen as minus sign
            –1.5 => : write -1.5, with a hyphen as minus sign
            '1,5' => leaf.length = '1,5': must be a number: write 1.5, with a decimal point
            '1.5' => must be a number: write 1.5, without quotes
            'long' => must be a number or a list of 1
        ";
        for (length, said) in pairs(lengths) {
            let refused = rod(length, "inf", LOAD).unwrap_err();
            assert!(refused.contains(said), "{length}: {refused}");
        }
        for load in ["[0, 0, −1.5]", "[0, 0, '−1.5']"] {
            let refused = rod("1.0", "inf", load).unwrap_err();
            let said = "write -1.5, with a hyphen as minus sign";
            assert!(refused.contains(said), "{refused}");
        }
        let text = "name = 'rod'\nleaf = { rods = 1, length = 1.0, fan = [0.0] }";
        let entries = Entries::of_text(text, "rod.toml").unwrap();
        let refused = entries.replaced(&["load.gravity=[0, 0, −2]".into()]);
        let refused = refused.unwrap_err().to_string();
        assert!(refused.contains("write -2, with a hyphen"), "{refused}");
    }
}
