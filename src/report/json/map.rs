//! `map.json`: which map the rows beside it are of, and how often each method
//! had each outcome.

use std::io::{self, Write};

use serde::Serialize;
use serde_json::Value;

use super::write;
use crate::report::Format;
use crate::study::{Confidence, Map, MapOutcome, MapRequest};

/// `map.json`, which is also what `--json` prints.
pub struct MapSummary;

impl Format<Map> for MapSummary {
    fn file_name(&self) -> &'static str {
        "map.json"
    }

    fn write(&self, map: &Map, out: &mut dyn Write) -> io::Result<()> {
        write(&Object::from(map), out)
    }
}

impl MapSummary {
    /// What tells one map from another.
    pub fn request(request: &MapRequest) -> Value {
        serde_json::to_value(Request::from(request)).unwrap_or_default()
    }
}

/// The keys, in the order in which they are written.
#[derive(Serialize)]
struct Object {
    scenario: String,
    request: Request,
    cells: usize,
    confirmed: usize,
    outcomes: Vec<Counts>,
}

/// Values are texts, as in the table: they must be the same to the last digit.
#[derive(Serialize)]
struct Request {
    scenario_digest: String,
    set: Vec<String>,
    vary: Vec<Axis>,
    step: Option<String>,
    segments: Option<usize>,
    tolerance: Option<String>,
    cell_seconds: String,
}

#[derive(Serialize)]
struct Axis {
    keys: String,
    log: bool,
    values: Vec<String>,
}

/// How often a method had each outcome; those it never had are left out.
#[derive(Serialize)]
struct Counts {
    method: &'static str,
    counts: serde_json::Map<String, Value>,
}

impl From<&MapRequest> for Request {
    fn from(request: &MapRequest) -> Self {
        let knobs = request.base.knobs();
        let text = |value: f64| format!("{value:?}");
        Request {
            scenario_digest: format!("{:016x}", digest(request.base.text().as_bytes())),
            set: request.base.overrides().to_vec(),
            vary: (request.axes.iter())
                .map(|axis| Axis {
                    keys: axis.keys.to_string(),
                    log: axis.log,
                    values: axis.values.iter().map(|&v| axis.keys.text(v)).collect(),
                })
                .collect(),
            step: knobs.step.map(text),
            segments: knobs.segments,
            tolerance: request.tolerance.map(text),
            cell_seconds: text(request.cell_seconds),
        }
    }
}

impl From<&Map> for Object {
    fn from(map: &Map) -> Self {
        let request = &map.request;
        let mut known: Vec<_> = (map.rows.iter())
            .map(|row| (row.cell, row.reference))
            .collect();
        known.dedup_by_key(|(cell, _)| *cell);
        let confirmed = |(_, reference): &&(usize, Confidence)| *reference == Confidence::Confirmed;
        Object {
            scenario: request.base.scenario().name.clone(),
            request: Request::from(request),
            cells: request.cells(),
            confirmed: known.iter().filter(confirmed).count(),
            outcomes: (request.methods.iter())
                .map(|&method| Counts {
                    method: method.word(),
                    counts: (MapOutcome::ALL.into_iter())
                        .map(|outcome| (outcome, map.count(method, outcome)))
                        .filter(|(_, count)| *count > 0)
                        .map(|(outcome, count)| (outcome.to_string(), count.into()))
                        .collect(),
                })
                .collect(),
        }
    }
}

/// FNV-1a: tells whether a text has changed, from release to release the same.
fn digest(bytes: &[u8]) -> u64 {
    bytes.iter().fold(0xcbf2_9ce4_8422_2325, |hash, &byte| {
        (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3)
    })
}

#[cfg(test)]
mod tests {
    use super::super::tests::{keys, text};
    use super::*;
    use crate::report::sample;

    #[test]
    fn the_keys_are_those_of_the_readme() {
        let text = text(&MapSummary, &sample::map());
        assert_eq!(
            keys(&text),
            ["scenario", "request", "cells", "confirmed", "outcomes"]
        );
        let object: Value = serde_json::from_str(&text).unwrap();
        assert_eq!(object["request"]["vary"][1]["keys"], "load.gravity[2]");
        assert_eq!(object["request"]["vary"][1]["values"][0], "-0.1");
        assert_eq!(object["outcomes"][0]["method"], "semi-implicit");
        assert_eq!(object["outcomes"][0]["counts"]["right"], 5);
    }

    #[test]
    fn a_digest_is_the_published_one() {
        assert_eq!(digest(b""), 0xcbf2_9ce4_8422_2325);
        assert_eq!(digest(b"foobar"), 0x8594_4171_f739_67e8);
    }
}
