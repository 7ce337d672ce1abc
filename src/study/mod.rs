//! Studies built on the solvers.

mod boundary;
mod chart;
mod check;
mod equilibria;
mod fit;
mod judge;
mod map;
mod margin;
mod remark;
mod sensitivity;
mod trace;
mod vary;

pub use crate::branch::{BranchEnd, CorrectorFailure, CriticalKind, VerificationFailure};
pub use crate::run::UnknownWord;
pub use crate::shooting::{NeutralDirection, ShootingSolution};
pub use crate::study::boundary::{
    BoundaryCurve, BoundaryMap, BoundaryPoint, BoundaryRequest, LeafBeside, MOST_CURVES,
    StabilityBoundary, trace_stability_boundary,
};
pub use crate::study::chart::{
    AccuracySetting, Chart, ChartError, ChartOptions, ChartOutcome, ChartProgress, ChartRemark,
    ChartRow, ChartRowRemark, FastestByAccuracy, PeerMeasurement, PeerProgram, ReferenceSolution,
    ScalingRow, ScalingStudy, SolverConfig, TimingSpread, chart, scaling,
};
pub use crate::study::check::{
    Check, CheckOptions, CheckVerdict, ComparedQuantity, DifferenceLocation, ShootingResult, check,
};
pub use crate::study::equilibria::{
    Equilibria, FoundEquilibrium, MOST_FRUITLESS_STARTS, equilibria,
};
pub use crate::study::fit::{
    ComparisonOperator, Data, DataFile, DataFileOptions, DataOrigin, Experiment,
    ExperimentConditions, Fit, FitAlternative, FitCandidate, FitCandidateRemark, FitCostLimit,
    FitError, FitLeaf, FitOutcome, FitParameter, FitRemark, FitRequest, FitResidual, FitStep,
    FitWork, FreeParameter, FreeParameterTarget, MeasuredColumn, MeasuredQuantity, MeasuredValue,
    OffsetColumn, RowCondition, RowFilter, SystematicResiduals, TracedVeinPoint, fit,
};
pub use crate::study::map::{
    DEFAULT_CELL_SECONDS, Map, MapJump, MapMethod, MapMotionFailure, MapOutcome, MapRefused,
    MapRemark, MapRequest, MapRow, MapShow, ReferenceConfidence, map,
};
pub use crate::study::margin::{MarginError, MarginProgress, relax_with_margin};
pub use crate::study::remark::{
    BoundaryRemark, BranchRemark, CheckReason, EquilibriaRemark, SolutionRemark, TraceRemark,
};
pub use crate::study::sensitivity::{
    SensitivityError, relax_blade, relax_with_sensitivities, sensitivities_of_tracker,
};
pub use crate::study::trace::{
    ForceDisplacementLine, MOST_BRANCHES, MOST_POINTS, PointKind, Trace, TraceBranch, TraceError,
    TracePoint, TraceRequest, TraceShow, TraceUntil, trace, trace_through,
};
pub use crate::study::vary::{
    BaseScenario, ParameterKeys, ParameterSweep, ScenarioNumber, SolverSetting, SolverSettings,
    VariableTarget, VariedScenario, VaryError,
};

/// Names of the lab axes in the words for quantities.
const AXIS_NAMES: [&str; 3] = ["x", "y", "z"];

crate::renamed! {
    Base => BaseScenario,
    Boundary => StabilityBoundary,
    Comparison => ComparisonOperator,
    Confidence => ReferenceConfidence,
    Contender => SolverConfig,
    Decade => FastestByAccuracy,
    Doubt => VerificationFailure,
    Ending => ChartOutcome,
    FitSystematic => SystematicResiduals,
    Found => FoundEquilibrium,
    Free => FreeParameter,
    FreeNumber => FreeParameterTarget,
    Keys => ParameterKeys,
    Knob => SolverSetting,
    Knobs => SolverSettings,
    Law => ForceDisplacementLine,
    Measured => MeasuredValue,
    Neutral => NeutralDirection,
    Number => ScenarioNumber,
    Origin => DataOrigin,
    Peer => PeerProgram,
    PeerRow => PeerMeasurement,
    Place => DifferenceLocation,
    Quantity => ComparedQuantity,
    Reading => DataFileOptions,
    DataReadingOptions => DataFileOptions,
    FitBudget => FitCostLimit,
    FitExperiment => ExperimentConditions,
    Reference => ReferenceSolution,
    Row => ChartRow,
    RowChoice => RowFilter,
    Scaling => ScalingStudy,
    Setting => AccuracySetting,
    Shot => ShootingResult,
    Spread => TimingSpread,
    Stuck => CorrectorFailure,
    Target => VariableTarget,
    Traced => TracedVeinPoint,
    Turn => ChartProgress,
    Varied => VariedScenario,
    Vary => ParameterSweep,
    Verdict => CheckVerdict,
}
