//! Serialisation of both solutions for `check.json`.

use glam::DVec3;
use serde::{Serialize, Serializer};

use crate::relax::{Equilibrium, serialize_index};
use crate::shape::{Difference, serialize_tips};
use crate::shooting;
use crate::shooting::{Failure, Reason, Solution};

/// The boundary-value solution with its verdict, or why there is none.
#[derive(Clone, Debug)]
pub struct Shot {
    /// What the shooting found.
    pub found: Result<Solution, Failure>,
    /// The shared tip alone, or one tip per rod; empty without a solution.
    pub tips: Vec<DVec3>,
    /// Its Morse index, counted on the energy's Hessian at this shape.
    pub negative_eigenvalues: Option<usize>,
    /// Time of the shooting alone, in seconds.
    pub wall_seconds: f64,
}

/// The part of `check.json` on the relaxed leaf.
pub fn relaxation<S: Serializer>(leaf: &Equilibrium, serializer: S) -> Result<S::Ok, S::Error> {
    #[derive(Serialize)]
    struct Keys<'a> {
        outcome: &'static str,
        #[serde(skip_serializing_if = "Option::is_none")]
        remark: Option<&'a str>,
        segments: &'a [usize],
        error_estimate: Option<f64>,
        residual: Option<f64>,
        energy: Option<f64>,
        #[serde(flatten, serialize_with = "serialize_tips")]
        tips: &'a [DVec3],
        #[serde(flatten, serialize_with = "serialize_index")]
        index: Option<usize>,
        wall_seconds: f64,
    }
    Keys {
        outcome: leaf.outcome.word(),
        remark: leaf.remark.as_deref(),
        segments: &leaf.accuracy.segments,
        error_estimate: leaf.accuracy.error_estimate,
        residual: leaf.accuracy.residual,
        energy: leaf.energy,
        tips: &leaf.tips,
        index: leaf.stability.negative_eigenvalues,
        wall_seconds: leaf.wall_seconds,
    }
    .serialize(serializer)
}

/// All keys; those of a solution are null if there is none.
impl Serialize for Shot {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        #[derive(Serialize)]
        struct Keys<'a> {
            outcome: &'static str,
            intervals: Option<usize>,
            growth_log10: Option<f64>,
            defect: Option<f64>,
            condition: Option<f64>,
            error_estimate: Option<Difference>,
            energy: Option<f64>,
            #[serde(flatten, serialize_with = "serialize_tips")]
            tips: &'a [DVec3],
            #[serde(flatten, serialize_with = "serialize_index")]
            index: Option<usize>,
            neutral: Option<NeutralKeys<'a>>,
            work: shooting::Work,
            wall_seconds: f64,
        }
        #[derive(Serialize)]
        struct NeutralKeys<'a> {
            ratio: f64,
            meaning: String,
            displacement: &'a [Vec<DVec3>],
        }
        let solution = self.found.as_ref().ok();
        let (outcome, neutral, work) = match &self.found {
            Ok(solution) => ("converged", solution.neutral.as_ref(), solution.work),
            Err(Failure { reason, work, .. }) => match reason {
                Reason::Singular(neutral) => ("singular", Some(neutral), *work),
                Reason::NoConvergence { .. } => ("no-convergence", None, *work),
                Reason::Rounding { .. } => ("rounding", None, *work),
                Reason::Unbounded { .. } => ("unbounded", None, *work),
                Reason::TooMuch(_) => ("too-much-memory", None, *work),
                Reason::OutOfTime => ("out-of-time", None, *work),
                Reason::Unmodelled(_) => ("not-modelled", None, *work),
            },
        };
        Keys {
            outcome,
            intervals: solution.map(|solution| solution.intervals.len() - 1),
            growth_log10: solution.map(|solution| solution.growth),
            defect: solution.map(|solution| solution.defect),
            condition: solution.map(|solution| solution.condition),
            error_estimate: solution.map(|solution| solution.error),
            energy: solution.map(|solution| solution.energy),
            tips: &self.tips,
            index: self.negative_eigenvalues,
            neutral: neutral.map(|neutral| NeutralKeys {
                ratio: neutral.ratio,
                meaning: neutral.to_string(),
                displacement: &neutral.displacement,
            }),
            work,
            wall_seconds: self.wall_seconds,
        }
        .serialize(serializer)
    }
}
