//! Postures of many leaves: a row each.

use crate::posture::Governing;
use crate::run::Instant;
use crate::scenario::Scenario;
use crate::study::unbend::request::UnbendRequest;
use crate::study::unbend::result::Unbending;
use crate::study::unbend::solve::unbend_many;
use crate::study::unbend::table::NamedPosture;
use crate::words;
use serde::Serialize;
use std::ops::RangeInclusive;

words! {
    /// What came of a posture among many.
    pub enum PostureOutcome {
        /// A bound on the modulus.
        Bound = "bound",
        /// The posture is stable at any modulus.
        NoBound = "no-bound",
        /// The points could not be used.
        Refused = "refused",
    }
}

/// A posture among many: a row of `postures.csv`.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct PostureRow {
    /// The cell by which its points are grouped.
    pub leaf: String,
    /// What came of it.
    pub outcome: PostureOutcome,
    /// Number of its points.
    pub points: usize,
    /// The least modulus.
    pub critical_young: Option<f64>,
    /// Lower end of its 95 % interval.
    pub low: Option<f64>,
    /// Upper end.
    pub high: Option<f64>,
    /// The direction in which the posture would be left.
    pub governing: Option<Governing>,
    /// Fraction of the length where the critical mode bends most.
    pub critical_at: Option<f64>,
    /// The length.
    pub length: Option<f64>,
    /// Estimated or given standard deviation of a coordinate.
    pub sd: Option<f64>,
    /// The index at the modulus, or at the largest, that was asked for.
    pub index: Option<usize>,
    /// Why it was refused, or what is to be known.
    pub remark: Option<String>,
}

/// Postures of many leaves.
#[derive(Clone, Debug, Serialize)]
pub struct Postures {
    /// Name of the scenario.
    pub scenario: String,
    /// A row for each leaf, in the order of the table.
    pub postures: Vec<PostureRow>,
    /// Time taken.
    pub wall_seconds: f64,
}

/// The least moduli that many postures prove, on all threads. Nothing is relaxed.
pub fn unbend_groups(
    scenario: &Scenario,
    leaves: Vec<NamedPosture>,
    young: Option<RangeInclusive<f64>>,
) -> Postures {
    let clock = Instant::now();
    let requests: Vec<UnbendRequest> = (leaves.iter())
        .map(|leaf| UnbendRequest {
            young: young.clone(),
            check: false,
            slow_loading: false,
            is_unit_known: leaf.is_unit_known,
            ..UnbendRequest::new(
                leaf.scenario.as_deref().unwrap_or(scenario).clone(),
                leaf.points.clone(),
            )
        })
        .collect();
    let found = unbend_many(&requests);
    let rows = leaves
        .into_iter()
        .zip(found)
        .map(|(leaf, found)| match found {
            Ok(found) => PostureRow::new(&leaf, &found),
            Err(why) => PostureRow {
                leaf: leaf.name,
                outcome: PostureOutcome::Refused,
                points: leaf.points.positions.len(),
                critical_young: None,
                low: None,
                high: None,
                governing: None,
                critical_at: None,
                length: None,
                sd: None,
                index: None,
                remark: Some(why.to_string()),
            },
        });
    Postures {
        scenario: scenario.name.clone(),
        postures: rows.collect(),
        wall_seconds: clock.elapsed().as_secs_f64(),
    }
}

impl PostureRow {
    fn new(leaf: &NamedPosture, found: &Unbending) -> PostureRow {
        let bound = found.critical_young;
        PostureRow {
            leaf: leaf.name.clone(),
            outcome: match bound.value > 0.0 {
                true => PostureOutcome::Bound,
                false => PostureOutcome::NoBound,
            },
            points: leaf.points.positions.len(),
            critical_young: Some(bound.value),
            low: Some(bound.low),
            high: Some(bound.high),
            governing: Some(found.governing()),
            critical_at: Some(found.posture.critical.at),
            length: Some(found.stations.length),
            sd: found.smoothing().map(|smoothing| smoothing.sd),
            index: found.indices.last().map(|it| it.index),
            remark: found.remarks.first().map(ToString::to_string),
        }
    }
}
