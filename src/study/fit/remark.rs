//! What is said of a fit: why it did not converge, and what else is to be known of its minimum; and
//! why a candidate experiment cannot be judged.

use crate::numbers::format_two_digits;
use crate::run::remarks;
use crate::study::fit::data::DataFile;

remarks! {
    /// What is to be said of a fit. Free numbers have the names by which they are freed.
    pub enum FitRemark {
        /// A budget that was used up.
        #[error(
            "the budget of {evaluations} evaluations was used up: this is the best that was found so far; allow more, \
             free fewer numbers, or begin nearer"
        )]
        BudgetUsedUp {
            /// How often leaves may be relaxed.
            evaluations: usize,
        } = "budget-used-up",
        /// A limit of the run that was reached.
        #[error("stopped before its end: this is the best that was found so far")]
        Stopped = "stopped",
        /// A search that began elsewhere than with the numbers of the scenario.
        #[error(
            "{}; the search began with {values}",
            .refusal.as_deref().unwrap_or("with the numbers of the scenario the leaf is far from the data")
        )]
        BeganElsewhere {
            /// Why no leaf rests with these; none if the data are far from where it rests.
            refusal: Option<String>,
            /// Where the search began, in words.
            values: String,
        } = "began-elsewhere",
        /// Data far from the leaf with the numbers of the scenario and in all decades around them.
        #[error(
            "with the numbers of the scenario the leaf is far from the data, and no other decade of them is nearer"
        )]
        NoDecadeNearer = "no-decade-nearer",
        /// As many steps as are allowed.
        #[error("the step limit came before the minimum: start from values nearer to it")]
        StepLimit = "step-limit",
        /// A way that ends at a jump.
        #[error(
            "the way to smaller residuals ends where a leaf jumps to another equilibrium, and is not \
             followed there: start from other values, or leave out experiments beyond the jump"
        )]
        EndsAtJump = "ends-at-jump",
        /// A way that ends where a leaf does not come to rest, as these words say.
        #[error("the way to smaller residuals ends: {0}")]
        EndsWithoutEquilibrium(String) = "ends-without-equilibrium",
        /// No smaller residuals nearby.
        #[error("no step makes the residuals smaller")]
        NoSmallerResiduals = "no-smaller-residuals",
        /// A number at a bound that was given for it.
        #[error("{number} is at its bound {bound}")]
        AtBound {
            /// The number.
            number: String,
            /// The bound.
            bound: f64,
        } = "at-bound",
        /// A number that went as far as it was let.
        #[error("{number} went as far as {value:.3e}, and was let no farther")]
        WentFar {
            /// The number.
            number: String,
            /// Its value.
            value: f64,
        } = "went-far",
        /// Coordinates that no leaf of this length has.
        #[error(
            "{count} of the coordinates {} far from any leaf of this length ({length}): are the data in the \
             scenario's unit of length?", is_or_are(*.count)
        )]
        FarFromAnyLeaf {
            /// How many.
            count: usize,
            /// The length of the longest vein.
            length: f64,
        } = "far-from-any-leaf",
        /// Coordinates that the fitted leaf does not have.
        #[error(
            "{count} of the coordinates {} more than half of the leaf's length ({length}) from the fitted leaf: \
             are lengths and forces in the scenario's units?", is_or_are(*.count)
        )]
        FarFromFittedLeaf {
            /// How many.
            count: usize,
            /// The length of the longest vein.
            length: f64,
        } = "far-from-fitted-leaf",
        /// Frequencies of a leaf without mass.
        #[error(
            "frequencies are compared, but the scenario has no dynamics.density: its unit of time is then \
             sqrt(rho L^4/A), which changes with the bending stiffness A: give the density"
        )]
        NoDensity = "no-density",
        /// As many free numbers as data.
        #[error("there are as many numbers as data: nothing is left to judge the fit by")]
        NoFreedom = "no-freedom",
        /// Residuals that are larger than their standard deviations say.
        #[error(
            "chi squared is {chi_squared:.3e} for {degrees_of_freedom} degrees of freedom: the standard deviations are not \
             those of these data, or the model is not that of this leaf, or this minimum is not the lowest"
        )]
        ExcessiveResiduals {
            /// Sum of the squares of residuals over their standard deviations.
            chi_squared: f64,
            /// Number of data less that of free numbers.
            degrees_of_freedom: usize,
        } = "excessive-residuals",
        /// Data without standard deviations, of which the residuals of one column are much larger than those of another.
        #[error(
            "one standard deviation is assumed for all data, but the residuals of {scattered} are {} times those of \
             {smooth}, which then tell too little: give standard deviations (columns sd_{scattered}, sd_{smooth}, or \
             sd of points)", format_two_digits(*.ratio)
        )]
        UnequalScatter {
            /// The column with the largest residuals.
            scattered: String,
            /// The column with the smallest.
            smooth: String,
            /// The ratio of their root mean squares.
            ratio: f64,
        } = "unequal-scatter",
        /// A leaf that jumped to another equilibrium on the way.
        #[error(
            "on the way a leaf jumped to another equilibrium, that to which it relaxes from the start: compare with a \
             fit that starts from the values found"
        )]
        JumpedOnTheWay = "jumped-on-the-way",
        /// Candidates that cannot be judged, as these words say.
        #[error("candidates: {0}")]
        Candidates(String) = "candidates",
        /// Lines among the rows of files that were left out as comments.
        #[error(
            "lines among the rows that begin with # were left out as comments: {}",
            comment_lines_text(.files)
        )]
        CommentLines {
            /// The files, with the numbers of these lines.
            files: Vec<DataFile>,
        } = "comment-lines",
    }

    /// Why a candidate experiment cannot be judged.
    pub enum FitCandidateRemark {
        /// A leaf that does not come to rest, or data that cannot be used, as these words say.
        #[error("{0}")]
        Refused(String) = "refused",
        /// A leaf at a bifurcation.
        #[error("its equilibrium is singular")]
        Singular = "singular",
        /// Data of unknown accuracy.
        #[error("its standard deviation must be given (sd_frequency_1, sd_tip_x, ...)")]
        NoDeviation = "no-deviation",
    }
}

fn is_or_are(count: usize) -> &'static str {
    if count == 1 { "is" } else { "are" }
}

fn comment_lines_text(files: &[DataFile]) -> String {
    let lines = files
        .iter()
        .map(|file| format!("{} of {}", file.comments_among_rows, file.file));
    lines.collect::<Vec<_>>().join(", ")
}
