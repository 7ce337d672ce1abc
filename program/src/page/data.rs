//! The data of the page: results, thinned to what is visible, with large arrays as
//! base64 of little-endian numbers.

use crate::figure::drawing::veins::{node_stride, replace_undrawable_points};
use crate::figure::scenario::{DirectionArrow, LoadMark, SupportMark};
use base64::prelude::{BASE64_STANDARD as STANDARD, Engine};
use glam::DVec3;
use leafdyn::relax::{Equilibrium, Shape};
use serde::Serialize;

/// Numbers of a [`Leaf`]'s state per node: rotation w, x, y, z, then v, u, n, m.
const STATE_NUMBERS_PER_NODE: usize = 16;

/// Everything on a page.
#[derive(Serialize)]
pub struct PageData {
    /// `leaf`, `motion`, `trace` or `equilibria`.
    pub kind: &'static str,
    /// The name of the scenario.
    pub title: String,
    /// The result in a phrase.
    pub verdict: String,
    /// Whether it is a success.
    pub success: bool,
    /// Names and texts of its numbers.
    pub summary: Vec<(&'static str, String)>,
    /// Names of the units of length, force and time, if there are any.
    pub units: [Option<String>; 3],
    /// Directions of the weight of all veins and of the wind at time 0, as figures draw them.
    pub directions: Vec<DirectionArrow>,
    /// The dead loads on its leaves that do not have some of their own.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub loads: Vec<LoadMark>,
    /// What is held: bases, a tip, and what grips hold.
    pub holds: Vec<SupportMark>,
    /// The unit vector toward the viewer in the view with which the page begins.
    pub toward: Option<DVec3>,
    /// The length of the longest vein.
    pub longest: f64,
    /// Whether the tips share one point.
    pub joined: bool,
    /// The number of veins.
    pub rods: usize,
    /// The numbers, from 1, of those that are drawn.
    pub drawn: Vec<usize>,
    /// Lengths of the drawn veins.
    pub lengths: Vec<f64>,
    /// Colors of the drawn veins.
    pub colors: Vec<String>,
    /// The leaves: one, or all equilibria, points of a trace, instants of a motion.
    pub leaves: Vec<PageLeaf>,
    /// The modes of the leaf at rest, if their shapes were requested.
    pub modes: Vec<ModeShape>,
    /// The chart next to the leaf of a motion or trace.
    pub chart: Option<PageChart>,
}

/// A shape of the leaf.
#[derive(Default, Serialize)]
pub struct PageLeaf {
    /// A short description.
    pub label: String,
    /// The numbers of this leaf alone.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub summary: Vec<(&'static str, String)>,
    /// Its time, in a motion.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub time: Option<f64>,
    /// The dead loads on this leaf, where they are others: at its time of a motion, or as loads that turn
    /// with the section act on it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub loads: Option<Vec<LoadMark>>,
    /// The directions of weight and wind at its time of a motion, where they are others.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub directions: Option<Vec<DirectionArrow>>,
    /// From the mean of the bases to that of the tips.
    #[serde(skip)]
    pub tip_from_base: DVec3,
    /// Fractions of the length, where they are known.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub stations: Option<Vec<f64>>,
    /// Nodes per vein.
    pub nodes: usize,
    /// Positions, vein by vein.
    pub points: EncodedPoints,
    /// Sixteen numbers per node: rotation w, x, y, z, then v, u, n, m.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub state: Option<String>,
    /// The equivalent stress at each node, if sections are given.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub stress: Option<String>,
}

/// Positions: in full, or rounded to 65,536 steps over their bounding box.
#[derive(Serialize)]
#[serde(untagged)]
pub enum EncodedPoints {
    Full { f32: String },
    Coarse { u16: String, low: DVec3, size: f64 },
}

impl Default for EncodedPoints {
    fn default() -> Self {
        EncodedPoints::Full { f32: String::new() }
    }
}

/// A mode of the leaf at rest.
#[derive(Serialize)]
pub struct ModeShape {
    pub label: String,
    /// Nodes per vein, their positions at rest, and their displacements.
    pub nodes: usize,
    pub rest: String,
    pub displacement: String,
    /// Their displacements a quarter of a period later, where nodes move out of phase.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub later: Option<String>,
}

/// Curves of quantities, one of which is chosen.
#[derive(Serialize)]
pub struct PageChart {
    pub across: String,
    pub log: bool,
    /// Names of the quantities that can be drawn upwards.
    pub choices: Vec<String>,
    pub curves: Vec<PageCurve>,
}

#[derive(Default, Serialize)]
pub struct PageCurve {
    /// The choice among quantities with which the curve is shown.
    pub choice: usize,
    pub name: String,
    pub color: usize,
    pub x: Vec<f64>,
    pub y: Vec<f64>,
    /// The leaf that belongs to each point; empty: the nearest in time.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub leaves: Vec<usize>,
    /// Which points are unstable, and the indices and kinds of special ones.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub unstable: Vec<bool>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub special: Vec<(usize, &'static str)>,
}

impl PageLeaf {
    /// A leaf in full, with strains and forces.
    pub fn with_node_states(label: String, leaf: &Equilibrium, view: &PageData) -> Self {
        let Shape { stations, rods, .. } = &leaf.shape;
        let shown = || view.drawn.iter().map(|&number| &rods[number - 1].nodes);
        let stress = leaf.stress.as_ref().map(|of| {
            let shown = view.drawn.iter().flat_map(|&number| &of.rods[number - 1]);
            encode_floats(shown.map(|stress| stress.equivalent))
        });
        let points = shown().flat_map(|nodes| {
            let points = nodes.iter().map(|node| node.position);
            replace_undrawable_points(points, view.longest)
        });
        let mut state =
            Vec::with_capacity(STATE_NUMBERS_PER_NODE * stations.len() * view.drawn.len());
        for node in shown().flatten() {
            let q = node.rotation;
            state.extend([q.w, q.x, q.y, q.z]);
            let vectors = [node.v, node.u, node.n, node.m].map(|v| v.to_array());
            state.extend(vectors.as_flattened());
        }
        PageLeaf {
            label,
            tip_from_base: tip_from_base(&leaf.shape.curves),
            nodes: stations.len(),
            stations: Some(stations.clone()),
            points: EncodedPoints::Full {
                f32: encode_vectors(points),
            },
            state: Some(encode_floats(state)),
            stress,
            ..PageLeaf::default()
        }
    }

    /// A leaf as coarse centerlines, for one of many.
    pub fn from_centerlines(
        label: String,
        stations: &[f64],
        curves: &[Vec<DVec3>],
        view: &PageData,
        most: usize,
    ) -> Self {
        let all_curves = curves;
        let nodes = curves.first().map_or(0, Vec::len);
        let stride = node_stride(nodes, most);
        let curves = view.drawn.iter().map(|&number| &curves[number - 1]);
        let shown = curves.flat_map(|it| {
            replace_undrawable_points(it.iter().step_by(stride).copied(), view.longest)
        });
        let shown: Vec<DVec3> = shown.collect();
        let all = || shown.iter().copied();
        let low = all().reduce(DVec3::min).unwrap_or_default();
        let high = all().reduce(DVec3::max).unwrap_or_default();
        let size = (high - low).max_element().max(f64::MIN_POSITIVE);
        let step = |point: DVec3| ((point - low) / size * 65535.0).round().to_array();
        let steps = all().flat_map(step);
        let steps = steps.flat_map(|x| (x as u16).to_le_bytes());
        PageLeaf {
            label,
            tip_from_base: tip_from_base(all_curves),
            nodes: nodes.saturating_sub(1) / stride + 1,
            stations: are_unequally_spaced(stations)
                .then(|| stations.iter().step_by(stride).copied().collect()),
            points: EncodedPoints::Coarse {
                u16: STANDARD.encode(steps.collect::<Vec<u8>>()),
                low,
                size,
            },
            ..PageLeaf::default()
        }
    }
}

/// From the mean of the first points of these curves to that of their last points.
fn tip_from_base(curves: &[Vec<DVec3>]) -> DVec3 {
    let ends = curves
        .iter()
        .filter_map(|it| Some(*it.last()? - *it.first()?));
    ends.sum::<DVec3>() / curves.len().max(1) as f64
}

/// Whether these are not equally spaced, which the page assumes by default.
fn are_unequally_spaced(stations: &[f64]) -> bool {
    let last = stations.len().saturating_sub(1).max(1) as f64;
    let mut stations = stations.iter().enumerate();
    stations.any(|(k, station)| (station - k as f64 / last).abs() > 1e-9)
}

/// Encodes vectors as 32-bit numbers in base64.
pub fn encode_vectors(vectors: impl Iterator<Item = DVec3>) -> String {
    encode_floats(vectors.flat_map(|vector| vector.to_array()))
}

fn encode_floats(numbers: impl IntoIterator<Item = f64>) -> String {
    let bytes = numbers.into_iter();
    let bytes = bytes.flat_map(|number| (number as f32).to_le_bytes());
    STANDARD.encode(bytes.collect::<Vec<u8>>())
}
