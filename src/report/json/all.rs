//! `equilibria.json`: all shapes of a leaf that were found.

use std::io::{self, Write};

use serde::Serialize;

use super::{Point, points, tips, write};
use crate::report::Format;
use crate::study::{All, Found};

/// `equilibria.json`, which is also what `--json` prints.
pub struct AllSummary;

impl Format<All> for AllSummary {
    fn file_name(&self) -> &'static str {
        "equilibria.json"
    }

    fn write(&self, all: &All, out: &mut dyn Write) -> io::Result<()> {
        write(&Object::from(all), out)
    }
}

/// The keys, in the order in which they are written.
#[derive(Serialize)]
struct Object {
    scenario: String,
    starts: usize,
    failed: usize,
    equilibria: Vec<One>,
    wall_seconds: f64,
}

#[derive(Serialize)]
struct One {
    energy: f64,
    stable: Option<bool>,
    negative_eigenvalues: Option<usize>,
    tip: Option<Point>,
    #[serde(skip_serializing_if = "Option::is_none")]
    tips: Option<Vec<Point>>,
    error_estimate: Option<f64>,
    segments: Vec<usize>,
    starts: usize,
    plain: bool,
    stations: Vec<f64>,
    positions: Vec<Vec<Point>>,
}

impl From<&All> for Object {
    fn from(all: &All) -> Self {
        Object {
            scenario: all.scenario.clone(),
            starts: all.starts,
            failed: all.failed,
            equilibria: all.found.iter().map(One::from).collect(),
            wall_seconds: all.wall_seconds,
        }
    }
}

impl From<&Found> for One {
    fn from(found: &Found) -> Self {
        let leaf = &found.equilibrium;
        let (tip, tips) = tips(&leaf.tips);
        let rods = leaf.rods.iter();
        One {
            energy: leaf.energy,
            stable: leaf.stable(),
            negative_eigenvalues: leaf.negative_eigenvalues,
            tip,
            tips,
            error_estimate: leaf.error_estimate,
            segments: leaf.segments.clone(),
            starts: found.starts,
            plain: found.plain,
            stations: leaf.stations.clone(),
            positions: rods
                .map(|rod| points(rod.nodes.iter().map(|node| node.position)))
                .collect(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::{keys, text};
    use super::*;
    use crate::report::sample;

    #[test]
    fn the_keys_are_those_of_the_readme() {
        let text = text(&AllSummary, &sample::all());
        let wanted = ["scenario", "starts", "failed", "equilibria", "wall_seconds"];
        assert_eq!(keys(&text), wanted);
        let object: serde_json::Value = serde_json::from_str(&text).unwrap();
        assert_eq!(object["equilibria"][0]["starts"], 3);
        assert_eq!(object["equilibria"][1]["plain"], false);
    }
}
