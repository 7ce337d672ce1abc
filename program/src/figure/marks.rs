//! What loads and holds a leaf, by veins and fractions of their lengths: figures place these marks on
//! the shapes that they draw, and pages have them as data.

use glam::DVec3;
use leafdyn::scenario::{Hold, Scenario};
use serde::Serialize;

/// Length of the arrow of the largest force or moment, as a part of the leaf's largest extent, and the
/// shortest arrow, as a part of that.
const LONGEST: f64 = 0.16;
const SHORTEST: f64 = 0.35;
/// Length of the arrow of the largest force along a vein, likewise, and how many there are.
const ALONG: f64 = 0.07;
const COUNT: usize = 9;

/// What acts at a point of a vein.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Action {
    /// A dead force on a point or a tip.
    Force,
    /// A dead force per length.
    Distributed,
    /// A dead moment.
    Moment,
}

/// A dead load at a point of a vein, which is drawn as an arrow.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct LoadMark {
    pub action: Action,
    /// The number of the vein, from 1.
    pub vein: usize,
    /// Fraction of its length.
    pub at: f64,
    /// Of length one; of a moment: its axis.
    pub direction: DVec3,
    /// In the scenario's units.
    pub size: f64,
    /// Length of the arrow of a force, as a part of the leaf's largest extent.
    pub length: f64,
}

/// What is held.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Part {
    Base,
    Tip,
    Grip,
}

/// A point or a stretch of a vein that is held.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct HoldMark {
    pub part: Part,
    /// The number of the vein, from 1.
    pub vein: usize,
    /// Fractions of its length.
    pub at: [f64; 2],
    #[serde(serialize_with = "word")]
    pub held: Hold,
}

fn word<S: serde::Serializer>(held: &Hold, to: S) -> Result<S::Ok, S::Error> {
    to.serialize_str(match held {
        Hold::Clamped => "clamped",
        Hold::Pinned => "pinned",
    })
}

/// The dead loads on a leaf at rest, or on one in motion at this time. Gravity and wind, which act on
/// all veins alike, are directions of the whole figure.
pub fn load_marks(scenario: &Scenario, time: Option<f64>) -> Vec<LoadMark> {
    let motion = &scenario.dynamics;
    let [tip_force, tip_moment] = match time {
        Some(time) => [motion.tip_force.at(time), motion.tip_moment.at(time)],
        None => [scenario.tip_force, scenario.tip_moment],
    }
    .map(DVec3::from_array);
    let veins = scenario.rods.len();
    let g = DVec3::from_array(scenario.g);
    let points = scenario.points.iter();
    let on_points = points.clone().map(|it| {
        let force = DVec3::from_array(it.force) + it.mass * g;
        (it.vein + 1, it.at, force)
    });
    // Tips at one point have one arrow.
    let tips = if scenario.joined { 1 } else { veins };
    let on_tips = (1..=tips).map(|vein| (vein, 1.0, tip_force));
    let single: Vec<_> = on_points.chain(on_tips).collect();
    let moments = points.map(|it| (it.vein + 1, it.at, DVec3::from_array(it.moment)));
    let moments: Vec<_> = moments.chain([(1, 1.0, tip_moment)]).collect();
    let along = scenario.distributed.iter().flatten().zip(1..);
    let along: Vec<_> = along
        .flat_map(|(force, vein)| {
            let at = (0..COUNT).map(|k| k as f64 / (COUNT - 1) as f64);
            let of = |s: f64| DVec3::from_array(force.each_ref().map(|profile| profile.at(s)));
            at.map(move |s| (vein, s, of(s)))
        })
        .collect();
    let kinds = [
        (Action::Distributed, along, ALONG, 0.0),
        (Action::Force, single, LONGEST, SHORTEST),
        (Action::Moment, moments, LONGEST, SHORTEST),
    ];
    let marks = kinds
        .into_iter()
        .flat_map(|(action, loads, longest, shortest)| {
            let largest = loads.iter().map(|(.., load)| load.length());
            let largest = largest.fold(0.0, f64::max);
            loads.into_iter().filter_map(move |(vein, at, load)| {
                Some(LoadMark {
                    action,
                    vein,
                    at,
                    direction: load.try_normalize()?,
                    size: load.length(),
                    length: longest * (load.length() / largest).max(shortest),
                })
            })
        });
    marks.collect()
}

/// What holds a leaf: bases, of which those at one place are one, a tip, and grips.
pub fn hold_marks(scenario: &Scenario) -> Vec<HoldMark> {
    let mut bases: Vec<[f64; 3]> = Vec::new();
    let mut marks = Vec::new();
    for (rod, vein) in scenario.rods.iter().zip(1..) {
        if !bases.contains(&rod.base) {
            bases.push(rod.base);
            marks.push(HoldMark {
                part: Part::Base,
                vein,
                at: [0.0; 2],
                held: scenario.base_held,
            });
        }
    }
    marks.extend(scenario.held_tip.iter().map(|tip| HoldMark {
        part: Part::Tip,
        vein: 1,
        at: [1.0; 2],
        held: match tip.clamps {
            Some(_) => Hold::Clamped,
            None => Hold::Pinned,
        },
    }));
    marks.extend(scenario.grips.iter().map(|grip| HoldMark {
        part: Part::Grip,
        vein: grip.vein + 1,
        at: grip.at,
        held: grip.held,
    }));
    marks
}
