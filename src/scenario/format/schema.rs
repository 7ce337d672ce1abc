//! The JSON schema of scenarios, generated from the table of keys.

use crate::scenario::format::{
    Key, MissingKeyRule, NumberRange, TablePath, ValueSchema, is_repeated_table,
};
use serde_json::{Map, Value, json};

/// The schema of scenarios (JSON Schema, draft 7), for editors that complete and check
/// them. Rules between entries are checked only by the program.
pub fn schema() -> Value {
    let mut schema = table("");
    schema["$schema"] = json!("http://json-schema.org/draft-07/schema#");
    schema["title"] = json!("a leaf, as leafdyn reads it");
    schema
}

/// The schema of a table, which has no name at the top, with those in it.
fn table(name: &str) -> Value {
    let (mut properties, mut required) = (Map::new(), Vec::new());
    for key in Key::all().filter(|key| key.table() == name) {
        let within = key.table_path().name;
        properties.insert(within.into(), entry(key));
        // Alternatives, such as stiffnesses, sections and blades, are not required here.
        let alone = matches!(name, "" | "leaf") && !key.follows_from_blade() || key.is_repeated();
        if alone && matches!(key.missing_key_rule(), MissingKeyRule::Required(_)) {
            required.push(within);
        }
    }
    for inner in Key::tables() {
        let TablePath {
            table: outer,
            name: within,
        } = TablePath::split(inner);
        if outer != name {
            continue;
        }
        let one = table(inner);
        let repeated = is_repeated_table(inner);
        if !repeated && !one["required"].is_null() {
            required.push(within);
        }
        properties.insert(within.into(), if repeated { list(one) } else { one });
    }
    let mut object = json!({
        "type": "object", "properties": properties, "additionalProperties": false,
    });
    if !required.is_empty() {
        object["required"] = json!(required);
    }
    object
}

/// The schema of a key's value, with its description.
fn entry(key: Key) -> Value {
    let mut entry = match key.form() {
        ValueSchema::Text => json!({ "type": "string" }),
        ValueSchema::Switch => json!({ "type": "boolean" }),
        ValueSchema::Whole => json!({ "type": "integer", "minimum": 1 }),
        ValueSchema::Number(range) => number(range),
        ValueSchema::PerRod(range) | ValueSchema::PerGap(range) => {
            json!({ "anyOf": [number(range), list(number(range))] })
        }
        ValueSchema::Quantity(range) => {
            let values = list(number(range));
            let profile = knots(
                "value",
                json!({ "anyOf": [values, list(list(number(range)))] }),
            );
            json!({ "anyOf": [number(range), list(number(range)), profile] })
        }
        ValueSchema::Outline(range) => {
            json!({ "anyOf": [number(range), knots("value", list(number(range)))] })
        }
        ValueSchema::Vector => vector(),
        ValueSchema::VectorPerRod => json!({ "anyOf": [vector(), list(vector())] }),
        ValueSchema::VectorQuantity => {
            let vectors = list(vector());
            let profile = knots("value", json!({ "anyOf": [vectors, list(list(vector()))] }));
            json!({ "anyOf": [vector(), list(vector()), profile] })
        }
        ValueSchema::Stretch => {
            let ends =
                json!({ "type": "array", "items": fraction(), "minItems": 2, "maxItems": 2 });
            json!({ "anyOf": [fraction(), ends] })
        }
        ValueSchema::Pixel => {
            json!({ "type": "array", "items": number(NumberRange::Finite), "minItems": 2, "maxItems": 2 })
        }
        ValueSchema::Fan => json!({ "anyOf": [
            { "enum": ["paper", "symmetric"] }, list(number(NumberRange::Finite)),
        ] }),
        ValueSchema::VectorInTime => knots("value", list(vector())),
        ValueSchema::VectorOrInTime => {
            json!({ "anyOf": [vector(), knots("value", list(vector()))] })
        }
        ValueSchema::FactorInTime => knots("factor", list(number(NumberRange::Finite))),
    };
    entry["description"] = json!(key.description());
    // Defaults are TOML; those that are also JSON are included.
    if let MissingKeyRule::Default(text) = key.missing_key_rule()
        && let Ok(value) = serde_json::from_str::<Value>(text)
    {
        entry["default"] = value;
    }
    entry
}

/// A number. JSON has no infinity; editors accept TOML's `inf` as a number.
fn number(range: NumberRange) -> Value {
    match range {
        NumberRange::Finite => json!({ "type": "number" }),
        NumberRange::NotNegative => json!({ "type": "number", "minimum": 0 }),
        NumberRange::Positive | NumberRange::PositiveOrInfinite => {
            json!({ "type": "number", "exclusiveMinimum": 0 })
        }
    }
}

fn fraction() -> Value {
    json!({ "type": "number", "minimum": 0, "maximum": 1 })
}

fn list(of: Value) -> Value {
    json!({ "type": "array", "items": of })
}

fn vector() -> Value {
    json!({ "type": "array", "items": { "type": "number" }, "minItems": 3, "maxItems": 3 })
}

/// Knots or times, and the values there.
fn knots(name: &str, values: Value) -> Value {
    json!({
        "type": "object",
        "properties": { "at": list(number(NumberRange::Finite)), name: values },
        "required": ["at", name],
        "additionalProperties": false,
    })
}
