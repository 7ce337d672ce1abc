//! What a fit found.

use std::collections::BTreeMap;

use serde::Serialize;

use crate::newton::Work;

/// How a fit ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum FitOutcome {
    /// At a minimum, and the data determine every free number.
    Converged,
    /// Not at a minimum.
    NotConverged,
    /// At a minimum, but some number or combination of them could be another.
    Undetermined,
}

impl FitOutcome {
    /// The word in files.
    pub fn word(self) -> &'static str {
        match self {
            FitOutcome::Converged => "converged",
            FitOutcome::NotConverged => "not-converged",
            FitOutcome::Undetermined => "undetermined",
        }
    }
}

/// A free number.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct FitParameter {
    /// Its key.
    pub key: String,
    /// Its value at the minimum: of one that is not determined, one of many.
    pub value: f64,
    /// Lower end of the 95 % interval; `None` if there is none.
    pub low: Option<f64>,
    /// Upper end.
    pub high: Option<f64>,
    /// Whether the data determine it: within a factor of ten.
    pub determined: bool,
    /// Whether the interval is that of the profile likelihood: where the curvature at
    /// the minimum is not to be trusted.
    pub profiled: bool,
}

/// One number that was compared.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct FitResidual {
    /// The experiment.
    pub experiment: String,
    /// `tip_x`, `frequency_1`, ..., or `x`, `y`, `z` of a point on a vein.
    pub what: String,
    /// The rod, counted from 1, and the fraction of its length, of a point on a vein.
    pub rod: Option<usize>,
    /// See `rod`.
    pub sigma: Option<f64>,
    /// The datum.
    pub data: f64,
    /// The model's.
    pub model: f64,
    /// Half the width of the model's 95 % band: what the determined combinations
    /// leave open.
    pub band: f64,
    /// Standard deviation of the datum: as given, or as all residuals tell it.
    pub sd: f64,
    /// (data - model)/sd.
    pub residual: f64,
}

/// An experiment that could be made.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct FitCandidate {
    /// Its name.
    pub experiment: String,
    /// What it would say about the free numbers, in bits: by how many halvings it
    /// shrinks what is open between them, a factor of ten each way being all.
    pub bits: f64,
    /// The least determined combination with it, as a factor of its uncertainty
    /// without it.
    pub shrinks: f64,
    /// Why it cannot be judged.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub remark: Option<String>,
}

/// How far a fit has come.
#[derive(Clone, Copy, Debug)]
pub struct FitStep {
    /// Steps made towards the present minimum.
    pub step: usize,
    /// The sum of squares there.
    pub sum: f64,
    /// Once the minimum is found: of how many numbers the interval is known, and of how
    /// many there are.
    pub known: Option<(usize, usize)>,
}

/// Work of a fit.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct FitWork {
    /// Times the leaves of all experiments were brought to rest.
    pub evaluations: usize,
    /// How many of these were as accurate as is wanted; the others were those of the
    /// search, on the coarsest grids of which the data notice nothing.
    pub accurate: usize,
    /// Of the leaves at the minimum.
    #[serde(flatten)]
    pub last: Work,
}

/// A fit. As JSON it is `fit.json`.
#[derive(Clone, Debug, Serialize)]
pub struct Fit {
    /// Name of the scenario.
    pub scenario: String,
    /// How it ended.
    pub outcome: FitOutcome,
    /// Why, if it did not converge; what else is to be known.
    pub remarks: Vec<String>,
    /// The free numbers.
    pub parameters: Vec<FitParameter>,
    /// Correlations of their coordinates (logarithms of positive numbers); null where
    /// one is not determined.
    pub correlations: Vec<Vec<Option<f64>>>,
    /// Combinations about which the data say nothing: along each, exponents of
    /// positive numbers and coefficients of others.
    pub undetermined: Vec<BTreeMap<String, f64>>,
    /// What the data say, in words.
    pub says: Vec<String>,
    /// Sum of the squares of residuals over their standard deviations.
    pub chi_squared: f64,
    /// Data less determined combinations.
    pub degrees_of_freedom: usize,
    /// Standard deviation of all data, where none was given.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub standard_deviation: Option<f64>,
    /// Data, model and residuals.
    pub residuals: Vec<FitResidual>,
    /// Experiments that could be made, the one that says most first.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub candidates: Vec<FitCandidate>,
    /// Work.
    pub work: FitWork,
    /// Time of all, in seconds.
    pub wall_seconds: f64,
    /// The scenario with the values in place, as TOML.
    #[serde(skip)]
    pub fitted: String,
    /// The leaf of every experiment at the minimum, with its name.
    #[serde(skip)]
    pub leaves: Vec<(String, FitLeaf)>,
}

/// A leaf at the minimum, for drawing.
#[derive(Clone, Debug)]
pub struct FitLeaf {
    /// Centerlines, one per rod.
    pub curves: Vec<Vec<glam::DVec3>>,
    /// Traced points: rod, counted from 0, and coordinates seen.
    pub traced: Vec<(usize, [Option<f64>; 3])>,
}

impl Fit {
    /// Whether the numbers that were asked for are known (exit status 0).
    pub fn is_success(&self) -> bool {
        self.outcome == FitOutcome::Converged
    }
}
