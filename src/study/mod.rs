//! Studies built on the solvers.

mod blade;
mod boundary;
mod chart;
mod check;
mod equilibria;
mod fit;
mod judge;
mod map;
mod margin;
mod parameter_grid;
mod remark;
mod sensitivity;
mod sweep;
mod trace;
mod unbend;
pub(crate) mod vary;

pub use crate::branch::BranchingKind;
pub use crate::branch::{BranchEnd, CorrectorFailure, CriticalKind, VerificationFailure};
pub use crate::run::UnknownWord;
pub use crate::shooting::{NeutralDirection, ShootingSolution};
pub use crate::study::blade::{
    DEFAULT_VEINS_TOLERANCE, MOST_REFINED_VEINS, RefinedBlade, VeinsError, estimate_error_in_veins,
    refine_veins, relax_blade,
};
pub use crate::study::boundary::map::BoundaryMap;
pub use crate::study::boundary::{
    BoundaryCurve, BoundaryPoint, BoundaryRequest, LeafBeside, MOST_CURVES, StabilityBoundary,
    trace_stability_boundary,
};
pub use crate::study::chart::contender::{
    AccuracySetting, ChartProgress, SolverConfig, TimingSpread,
};
pub use crate::study::chart::result::{ScalingRow, ScalingStudy};
pub use crate::study::chart::{
    Chart, ChartError, ChartOptions, ChartOutcome, ChartRemark, ChartRow, ChartRowRemark,
    FastestByAccuracy, PeerMeasurement, PeerProgram, ReferenceSolution, chart, scaling,
};
pub use crate::study::check::{
    Check, CheckOptions, CheckVerdict, ComparedQuantity, DifferenceLocation, ShootingResult, check,
};
pub use crate::study::equilibria::{
    Equilibria, FoundEquilibrium, MOST_FRUITLESS_STARTS, equilibria,
};
pub use crate::study::fit::columns::FitError;
pub use crate::study::fit::free::{FreeParameter, FreeParameterTarget, OffsetColumn};
pub use crate::study::fit::result::{
    ExperimentConditions, Fit, FitAlternative, FitCandidate, FitCostLimit, FitLeaf, FitOutcome,
    FitParameter, FitResidual, FitStep, FitWork, SystematicResiduals,
};
pub use crate::study::fit::{
    ComparisonOperator, Data, DataFile, DataFileOptions, DataOrigin, Experiment,
    FitCandidateRemark, FitRemark, FitRequest, MeasuredColumn, MeasuredQuantity, MeasuredValue,
    RowCondition, RowFilter, TracedVeinPoint, fit,
};
pub use crate::study::map::result::{
    Map, MapMethod, MapOutcome, MapRequest, MapRow, MapShow, ReferenceConfidence,
};
pub use crate::study::map::{
    DEFAULT_CELL_SECONDS, MapJump, MapMotionFailure, MapRefused, MapRemark, map,
};
pub use crate::study::margin::barrier::MarginProgress;
pub use crate::study::margin::{MarginError, relax_with_margin};
pub use crate::study::remark::{
    BoundaryRemark, BranchRemark, CheckReason, EquilibriaRemark, SolutionRemark, TraceRemark,
};
pub use crate::study::sensitivity::{
    SensitivityError, relax_with_sensitivities, sensitivities_of_tracker,
};
pub use crate::study::sweep::columns::{
    ColumnKind, ColumnValue, LeafColumn, LeafQuantity, UnknownColumn, quantities_of_leaf,
};
pub use crate::study::sweep::{Sweep, SweepRefused, SweepRequest, SweepRow, sweep};
pub use crate::study::trace::result::{ForceDisplacementLine, PointMotion, TraceShow, TraceUntil};
pub use crate::study::trace::{
    MOST_BRANCHES, MOST_POINTS, PointKind, Trace, TraceBranch, TraceError, TracePoint,
    TraceRequest, trace, trace_through,
};
pub use crate::study::unbend::{
    BladeOutline, CriticalYoung, ModulusInterval, NamedPosture, PostureIndex, PostureOutcome,
    PostureRow, Postures, RestCheck, SecondPosture, ShapeFormat, ShapeTableOptions, SlowLoading,
    SmoothingReport, UnbendError, UnbendRemark, UnbendRequest, Unbending, read_postures,
    relax_from_points, unbend, unbend_groups, unbend_many,
};
pub use crate::study::vary::{
    BaseScenario, ParameterKeys, ParameterSweep, ScenarioNumber, SolverSetting, SolverSettings,
    VariableTarget, VariedScenario, VaryError,
};

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
