//! What the page is told.

use crate::motion::Instant;
use base64::prelude::{BASE64_STANDARD, Engine};
use leafdyn::relax::Equilibrium;
use leafdyn::scenario::{Scenario, Units};
use leafdyn::shape::{LEAST_HEIGHT, Undulation};
use leafdyn::study::{PointKind, ScenarioNumber, Trace, TraceBranch};
use leafdyn_program::page::{self, PageData, QuantityLabel};
use serde::Serialize;

/// An answer.
#[derive(Serialize)]
#[serde(tag = "answer", rename_all = "lowercase")]
pub enum Answer {
    /// No answer, and why.
    Refused {
        error: String,
    },
    Opened {
        known: Known,
        sliders: Vec<Slider>,
        #[serde(skip_serializing_if = "Option::is_none")]
        growth: Option<Growth>,
    },
    /// The leaf in the equilibrium into which the one before has changed.
    Followed(Known),
    /// The leaf in an equilibrium that was found anew.
    Found(Known),
    /// The stable equilibria end at these values, and the leaf must move on.
    Left {
        values: Vec<(String, f64)>,
    },
    Moving(Instant),
    Branch(Branch),
    #[serde(serialize_with = "list")]
    Equilibria(Vec<Known>),
    #[serde(serialize_with = "list")]
    Sensitivity(Vec<Told>),
    Unloaded(Known),
    /// Where the leaf is, as [`place`](mod@crate::place) writes it.
    Place {
        at: String,
    },
    Version {
        version: &'static str,
    },
    /// A file, in base64.
    File {
        name: String,
        content: String,
    },
}

/// Lists are named, as all answers are objects.
fn list<T: Serialize, S: serde::Serializer>(list: &[T], serializer: S) -> Result<S::Ok, S::Error> {
    #[derive(Serialize)]
    struct Named<'l, T> {
        list: &'l [T],
    }
    Named { list }.serialize(serializer)
}

impl Answer {
    /// A file with this content.
    pub fn file(name: &str, content: &[u8]) -> Answer {
        Answer::File {
            name: name.into(),
            content: BASE64_STANDARD.encode(content),
        }
    }
}

/// What is said of a leaf in wind.
const CALM: &str = "blows when the leaf is let go: here it rests without wind";

/// A leaf at rest: as the page of a result shows it, and in numbers.
#[derive(Serialize)]
pub struct Known {
    pub view: PageData,
    pub tips: Vec<[f64; 3]>,
    pub energy: Option<f64>,
    pub error: Option<f64>,
    pub tolerance: f64,
    pub stable: Option<bool>,
    pub index: Option<usize>,
    /// Squares of the angular frequencies.
    pub eigenvalues: Vec<f64>,
    pub reaction: Option<[f64; 3]>,
    /// Height of the waves along its margins, which is continuous; 0 where it is too low to count.
    pub waves: Option<f64>,
}

impl Known {
    /// Of a leaf.
    pub fn new(leaf: &Equilibrium, scenario: &Scenario) -> Known {
        let modes = leaf.stability.modes.iter().flatten();
        let mut view = page::page_data(leaf, scenario);
        if scenario.wind.is_some() {
            view.summary.push(("wind", CALM.into()));
        }
        Known {
            view,
            tips: leaf.tips.iter().map(|tip| tip.to_array()).collect(),
            energy: leaf.energy,
            error: leaf.accuracy.error_estimate,
            tolerance: leaf.accuracy.tolerance,
            stable: leaf.stable(),
            index: leaf.stability.negative_eigenvalues,
            eigenvalues: modes.map(|mode| mode.eigenvalue).collect(),
            reaction: (leaf.reaction.as_ref()).map(|reaction| reaction.force.to_array()),
            waves: Some(waves_of(&leaf.undulation, scenario)),
        }
    }
}

/// The height of waves, or 0 of those that are too low to count.
fn waves_of(undulation: &Undulation, scenario: &Scenario) -> f64 {
    let least = LEAST_HEIGHT * leafdyn::scenario::longest(&scenario.rods);
    Some(undulation.height())
        .filter(|height| *height >= least)
        .unwrap_or(0.0)
}

/// A number that a slider can move, with a range around its value.
#[derive(Serialize)]
pub struct Slider {
    key: String,
    value: f64,
    low: f64,
    high: f64,
    log: bool,
    whole: bool,
    description: &'static str,
    /// What it is, for who does not know the keys, and its unit.
    words: String,
    unit: Option<String>,
    /// How far any point of the leaf moves, in lengths, by a change of the number by its own size: to
    /// first order.
    effect: Option<f64>,
}

/// Veins that have grown by different parts, the outermost most: each number of its list, from one margin
/// to the other.
#[derive(Serialize)]
pub struct Growth {
    pub keys: Vec<String>,
    pub stretches: Vec<f64>,
}

/// What figures call a number by its symbol, and what it does to a leaf.
const PLAIN_WORDS: [(&str, &str); 9] = [
    ("bending stiffness A2", "bending stiffness, up and down"),
    ("bending stiffness A3", "bending stiffness, sideways"),
    ("torsional stiffness A1", "stiffness against twisting"),
    ("axial stiffness H1", "stiffness against stretching"),
    ("shear stiffness H2", "stiffness against shear, sideways"),
    ("shear stiffness H3", "stiffness against shear, up and down"),
    (
        "curvature at rest about d2",
        "natural curvature, up and down",
    ),
    ("curvature at rest about d3", "natural curvature, sideways"),
    ("twist at rest", "natural twist"),
];

/// The number of a key in words.
fn plain_words(key: &str, label: String) -> String {
    let words = PLAIN_WORDS.iter();
    let mut words = words.fold(label, |words, (symbol, plain)| words.replace(symbol, plain));
    if key.trim_start_matches("scale:").starts_with("load.gravity") {
        words = words.replacen("gravity", "weight of the veins", 1);
    }
    match words.strip_prefix("factor of ") {
        Some(words) => format!("{words}, times"),
        None => words,
    }
}

/// How far a range goes from the value, as a factor or as a part of its size.
const RANGE: f64 = 4.0;

impl Slider {
    /// Of a number of a scenario with these units, and its effect.
    pub fn new(number: ScenarioNumber, units: &Units, effect: Option<f64>) -> Slider {
        let key = number.keys.to_string();
        let QuantityLabel { words, unit } = QuantityLabel::from_keys(&key, units);
        let ScenarioNumber { value, .. } = number;
        let log = number.positive && !number.whole && value > 0.0;
        let size = if value == 0.0 {
            number.unit
        } else {
            value.abs()
        };
        let (low, high) = match (number.whole, log) {
            (true, _) => (1.0, (RANGE * value).max(9.0)),
            (_, true) => (value / RANGE, value * RANGE),
            _ if number.positive => (0.0, RANGE * size),
            _ => (value - 2.0 * size, value + 2.0 * size),
        };
        Slider {
            words: plain_words(&key, words),
            unit,
            effect,
            key,
            value,
            low,
            high,
            log,
            whole: number.whole,
            description: number.description,
        }
    }
}

/// Derivatives with respect to a number.
#[derive(Serialize)]
pub struct Told {
    pub key: String,
    pub tips: Vec<[f64; 3]>,
    pub energy: f64,
}

/// A branch of equilibria: of each point the value, the tip, the energy, the waves and the index.
#[derive(Serialize)]
pub struct Branch {
    key: String,
    log: bool,
    complete: bool,
    remark: Option<String>,
    points: Vec<BranchPoint>,
}

#[derive(Serialize)]
struct BranchPoint {
    value: f64,
    tip: [f64; 3],
    energy: f64,
    waves: Option<f64>,
    /// The larger of both sides, at a fold or a branch point.
    index: usize,
    /// `fold` or `branch-point`, if it is one.
    #[serde(skip_serializing_if = "Option::is_none")]
    kind: Option<&'static str>,
}

/// The branches of a trace that goes both ways from one point, as one.
pub fn branch(trace: &Trace) -> Branch {
    let ways = &trace.branches;
    let back = ways.get(1).map(points).unwrap_or_default();
    let on = ways.first().map(points).unwrap_or_default();
    let remark = ways.iter().find_map(TraceBranch::remark);
    Branch {
        key: trace.keys.to_string(),
        log: trace.log,
        complete: trace.complete,
        remark: trace.remark.as_ref().map(ToString::to_string).or(remark),
        // The first point is on both.
        points: back.into_iter().skip(1).rev().chain(on).collect(),
    }
}

fn points(branch: &TraceBranch) -> Vec<BranchPoint> {
    let mut before = 0;
    let each = branch.points.iter().map(|point| {
        let tip = point.tips.first();
        let special = point.kind != PointKind::Regular;
        let index = if special {
            point.index.max(before)
        } else {
            point.index
        };
        before = point.index;
        BranchPoint {
            value: point.value,
            tip: tip.map_or([f64::NAN; 3], |tip| tip.to_array()),
            energy: point.energy,
            waves: Some(point.undulation.height()),
            index,
            kind: special.then(|| point.kind.word()),
        }
    });
    each.collect()
}
