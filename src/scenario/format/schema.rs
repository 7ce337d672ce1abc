//! The JSON schema of scenarios, generated from the table of keys.

use crate::scenario::format::{
    Key, MissingKeyRule, NumberRange, TablePath, ValueSchema, is_repeated_table,
};
use serde_json::{Map, Value, json};

/// The schema of scenarios (JSON Schema, draft 7), for editors that complete and check
/// them. Rules between entries are checked only by the program.
pub fn schema() -> Value {
    let mut schema = table_schema("");
    schema["$schema"] = json!("http://json-schema.org/draft-07/schema#");
    schema["title"] = json!("a leaf, as leafdyn reads it");
    schema
}

/// The schema of a table, which has no name at the top, with those in it.
fn table_schema(name: &str) -> Value {
    let (mut properties, mut required) = (Map::new(), Vec::new());
    for key in Key::all().filter(|key| key.table() == name) {
        let within = key.table_path().name;
        properties.insert(within.into(), entry_schema(key));
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
        let one = table_schema(inner);
        let repeated = is_repeated_table(inner);
        if !repeated && !one["required"].is_null() {
            required.push(within);
        }
        properties.insert(within.into(), if repeated { list_schema(one) } else { one });
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
fn entry_schema(key: Key) -> Value {
    let mut entry = match key.form() {
        ValueSchema::Text => json!({ "type": "string" }),
        ValueSchema::TextPerRod => {
            let text = json!({ "type": "string" });
            json!({ "anyOf": [text, list_schema(text.clone())] })
        }
        ValueSchema::Switch => json!({ "type": "boolean" }),
        ValueSchema::Whole => json!({ "type": "integer", "minimum": 1 }),
        ValueSchema::WholeOrList => {
            let whole = json!({ "type": "integer", "minimum": 1 });
            json!({ "anyOf": [whole, list_schema(whole.clone())] })
        }
        ValueSchema::Number(range) => number_schema(range),
        ValueSchema::PerRod(range) | ValueSchema::PerGap(range) => {
            json!({ "anyOf": [number_schema(range), list_schema(number_schema(range))] })
        }
        ValueSchema::Quantity(range) => {
            let values = list_schema(number_schema(range));
            let profile = profile_schema(
                "value",
                json!({ "anyOf": [values, list_schema(list_schema(number_schema(range)))] }),
            );
            json!({ "anyOf": [number_schema(range), list_schema(number_schema(range)), profile] })
        }
        ValueSchema::Outline(range) => {
            json!({ "anyOf": [number_schema(range), profile_schema("value", list_schema(number_schema(range)))] })
        }
        ValueSchema::Vector => vector_schema(NumberRange::Finite),
        ValueSchema::AxisStiffness => vector_schema(key.form().range()),
        ValueSchema::VectorPerRod => {
            let vector = vector_schema(NumberRange::Finite);
            json!({ "anyOf": [vector, list_schema(vector.clone())] })
        }
        ValueSchema::VectorQuantity(range) => {
            let vector = vector_schema(range);
            let vectors = list_schema(vector.clone());
            let profile = profile_schema(
                "value",
                json!({ "anyOf": [vectors, list_schema(vectors.clone())] }),
            );
            json!({ "anyOf": [vector, vectors, profile] })
        }
        ValueSchema::Stretch => {
            let ends = json!({ "type": "array", "items": fraction_schema(), "minItems": 2, "maxItems": 2 });
            json!({ "anyOf": [fraction_schema(), ends] })
        }
        ValueSchema::Pixel | ValueSchema::AcrossSection => {
            json!({ "type": "array", "items": number_schema(NumberRange::Finite), "minItems": 2, "maxItems": 2 })
        }
        ValueSchema::Fan => json!({ "anyOf": [
            { "enum": ["paper", "symmetric"] }, list_schema(number_schema(NumberRange::Finite)),
        ] }),
        ValueSchema::VectorInTime => {
            schedule_schema(&["value"], vector_schema(NumberRange::Finite))
        }
        ValueSchema::VectorOrInTime => {
            let vector = vector_schema(NumberRange::Finite);
            json!({ "anyOf": [vector, schedule_schema(&["value"], vector.clone())] })
        }
        ValueSchema::FactorInTime => {
            schedule_schema(&["factor", "value"], number_schema(NumberRange::Finite))
        }
        ValueSchema::BaseMotion => {
            let vector = vector_schema(NumberRange::Finite);
            let vectors = list_schema(vector.clone());
            let common = json!({
                "type": "object",
                "properties": {
                    "at": list_schema(number_schema(NumberRange::Finite)),
                    "move": vectors, "turn": vectors, "smooth": { "type": "boolean" },
                },
                "required": ["at"],
                "additionalProperties": false,
            });
            let own = schedule_schema(&["value"], vector);
            let each = json!({
                "type": "object",
                "properties": { "move": own, "turn": own },
                "additionalProperties": false,
            });
            json!({ "anyOf": [common, each] })
        }
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
fn number_schema(range: NumberRange) -> Value {
    match range {
        NumberRange::Finite => json!({ "type": "number" }),
        NumberRange::NotNegative | NumberRange::NotNegativeOrInfinite => {
            json!({ "type": "number", "minimum": 0 })
        }
        NumberRange::Positive | NumberRange::PositiveOrInfinite => {
            json!({ "type": "number", "exclusiveMinimum": 0 })
        }
    }
}

fn fraction_schema() -> Value {
    json!({ "type": "number", "minimum": 0, "maximum": 1 })
}

fn list_schema(of: Value) -> Value {
    json!({ "type": "array", "items": of })
}

fn vector_schema(range: NumberRange) -> Value {
    json!({ "type": "array", "items": number_schema(range), "minItems": 3, "maxItems": 3 })
}

/// A quantity in time: times and the values there, under one of these names, or a sine.
fn schedule_schema(names: &[&str], value: Value) -> Value {
    let through = names.iter().map(|name| {
        let mut knots = profile_schema(name, list_schema(value.clone()));
        knots["properties"]["smooth"] = json!({ "type": "boolean" });
        knots
    });
    let sine = json!({
        "type": "object",
        "properties": {
            "mean": value,
            "amplitude": value,
            "frequency": number_schema(NumberRange::Positive),
            "phase": number_schema(NumberRange::Finite),
        },
        "required": ["amplitude", "frequency"],
        "additionalProperties": false,
    });
    json!({ "anyOf": through.chain([sine]).collect::<Vec<_>>() })
}

/// Knots or times, and the values there.
fn profile_schema(name: &str, values: Value) -> Value {
    json!({
        "type": "object",
        "properties": { "at": list_schema(number_schema(NumberRange::Finite)), name: values },
        "required": ["at", name],
        "additionalProperties": false,
    })
}
