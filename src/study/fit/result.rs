//! The result of a fit: its numbers with their intervals, its residuals, and what it cost.

use crate::newton::SolverCounts;
use crate::study::ParameterKeys;
use crate::study::fit::data::DataFile;
use crate::study::fit::remark::{FitCandidateRemark, FitRemark};
use crate::words;
use serde::Serialize;
use std::collections::BTreeMap;

words! {
    /// How a fit ended.
    pub enum FitOutcome {
        /// At a minimum, and the data determine every free number.
        Converged = "converged",
        /// Not at a minimum.
        NotConverged = "not-converged",
        /// At a minimum, but some number or combination of numbers is not determined.
        Undetermined = "undetermined",
        /// At a minimum, but the residuals are systematic there: the model lacks something.
        Systematic = "systematic",
        /// At a minimum, but the data contradict the model there.
        Contradicted = "contradicted",
    }
}

/// A free number.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct FitParameter {
    /// Its key.
    pub key: String,
    /// Its value at the minimum: if it is not determined, one of many.
    pub value: f64,
    /// Lower end of the 95 % interval; `None` if there is none.
    pub low: Option<f64>,
    /// Upper end.
    pub high: Option<f64>,
    /// Standard deviation of the value, to first order; `None` if the data are insensitive to it.
    pub standard_error: Option<f64>,
    /// Whether the data determine it within a factor of ten.
    pub determined: bool,
    /// Whether the interval is that of the profile likelihood, since the quadratic approximation at
    /// the minimum is inaccurate.
    pub profiled: bool,
    /// Values below and above beyond which the other numbers could not be fitted, so that an end
    /// there is not known.
    #[serde(skip)]
    pub lost: [Option<f64>; 2],
}

/// Residuals that are smooth along series of data, not scattered.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SystematicResiduals {
    /// The probability that independent errors are as smooth.
    pub p_value: f64,
    /// The columns whose residuals are.
    pub along: Vec<String>,
    /// By how much intervals are longer than those of independent errors.
    pub widened: f64,
}

/// An experiment with data.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ExperimentConditions {
    /// Its name.
    pub experiment: String,
    /// What was set, by keys.
    pub settings: BTreeMap<String, f64>,
}

/// One scalar datum.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct FitResidual {
    /// The experiment.
    pub experiment: String,
    /// Its position in the data, from 1.
    #[serde(skip)]
    pub number: usize,
    /// `tip_x`, `frequency_1`, ..., or `x`, `y`, `z` of a point on a vein.
    pub what: String,
    /// The rod, counted from 1, and the fraction of its length, of a point on a vein.
    pub rod: Option<usize>,
    /// See `rod`.
    pub sigma: Option<f64>,
    /// The datum.
    pub data: f64,
    /// The prediction of the model.
    pub model: f64,
    /// Half the width of the model's 95 % band, due to the uncertainty of the determined
    /// combinations.
    pub band: f64,
    /// Standard deviation of the datum: as given, or as estimated from all residuals.
    pub sd: f64,
    /// (data - model)/sd.
    pub residual: f64,
}

/// A candidate experiment.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct FitCandidate {
    /// Its name.
    pub experiment: String,
    /// The information it would add on the free numbers, in bits: the number of halvings of
    /// their uncertainty, limited to a factor of ten up and down.
    pub bits: f64,
    /// The uncertainty of the least determined combination with it, relative to that without it.
    pub shrinks: f64,
    /// Why it cannot be judged.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub remark: Option<FitCandidateRemark>,
}

/// Other values of the free numbers that fit the data as well.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct FitAlternative {
    /// The value of each number.
    pub values: BTreeMap<String, f64>,
    /// Sum of the squares of residuals there, as that of the fit.
    pub chi_squared: f64,
}

/// Progress of a fit.
#[derive(Clone, Copy, Debug)]
pub struct FitStep {
    /// Number of steps towards the present minimum.
    pub step: usize,
    /// The sum of squares there.
    pub sum: f64,
    /// Once the minimum is found: the number of known intervals, and that of all numbers.
    pub known: Option<(usize, usize)>,
    /// Before the first step: what the fit takes at most.
    pub budget: Option<FitCostLimit>,
}

/// What a fit takes at most.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FitCostLimit {
    /// Number of times that the leaves of all experiments are relaxed or followed.
    pub evaluations: usize,
    /// Number of these leaves.
    pub leaves: usize,
    /// The time that this takes if each takes as long as the first, in seconds.
    pub seconds: f64,
}

/// Work of a fit.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct FitWork {
    /// Number of times the leaves of all experiments were relaxed.
    pub evaluations: usize,
    /// How many of these had the required accuracy; the others were those of the
    /// search, on the coarsest grids that do not affect the fit.
    pub accurate: usize,
    /// Work for the leaves at the minimum.
    #[serde(flatten)]
    pub last: SolverCounts,
}

/// A fit. As JSON it is `fit.json`.
#[derive(Clone, Debug, Serialize)]
pub struct Fit {
    /// Name of the scenario.
    pub scenario: String,
    /// How it ended.
    pub outcome: FitOutcome,
    /// Why it did not converge; other remarks.
    pub remarks: Vec<FitRemark>,
    /// The free numbers.
    pub parameters: Vec<FitParameter>,
    /// Correlations of their coordinates (logarithms of positive numbers); null if
    /// one is not determined.
    pub correlations: Vec<Vec<Option<f64>>>,
    /// Combinations to which the data are insensitive: for each, exponents of
    /// positive numbers and coefficients of others.
    pub undetermined: Vec<BTreeMap<String, f64>>,
    /// Other values that fit the data as well, if such were found.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub alternatives: Vec<FitAlternative>,
    /// Which other values were tried to find out whether they fit as well, if any.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub tried: Vec<String>,
    /// The systematic part of the residuals, if there is one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub systematic: Option<SystematicResiduals>,
    /// The results in words.
    pub says: Vec<String>,
    /// Sum of the squares of residuals over their standard deviations.
    pub chi_squared: f64,
    /// Degrees of freedom: data minus determined combinations.
    pub degrees_of_freedom: usize,
    /// Half the width of a 95 % interval in standard errors: of the normal distribution, or of
    /// Student's if the deviations of the data are estimated.
    pub coverage_factor: f64,
    /// Standard deviation of all data, if none was given.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub standard_deviation: Option<f64>,
    /// The files of data.
    #[serde(skip)]
    pub files: Vec<DataFile>,
    /// The experiments in the order of the data.
    pub experiments: Vec<ExperimentConditions>,
    /// Data, model and residuals.
    pub residuals: Vec<FitResidual>,
    /// Candidate experiments, the most informative first.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub candidates: Vec<FitCandidate>,
    /// Work.
    pub work: FitWork,
    /// Total time, in seconds.
    pub wall_seconds: f64,
    /// The scenario with the fitted values, as TOML.
    #[serde(skip)]
    pub fitted: String,
    /// The leaf of every experiment at the minimum, with its name.
    #[serde(skip)]
    pub leaves: Vec<(String, FitLeaf)>,
}

impl Fit {
    /// Whether the requested numbers are determined (exit status 0).
    pub fn is_success(&self) -> bool {
        self.outcome == FitOutcome::Converged
    }
}

/// A leaf at the minimum, for drawing.
#[derive(Clone, Debug)]
pub struct FitLeaf {
    /// The position of its experiment in the data, from 1.
    pub number: usize,
    /// Numbers of the scenario during that experiment.
    pub settings: Vec<(ParameterKeys, f64)>,
    /// Centerlines, one per rod.
    pub curves: Vec<Vec<glam::DVec3>>,
    /// Traced points: rod, counted from 0, and coordinates seen.
    pub traced: Vec<(usize, [Option<f64>; 3])>,
}
