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
mod sensitivity;
mod trace;
mod vary;

pub use crate::branch::{Doubt, End as BranchEnd, Kind as CriticalKind, Stuck};
pub use crate::shooting::{Neutral, Solution as ShootingSolution};
pub use crate::words::UnknownWord;
pub use blade::relax_blade;
pub use boundary::{
    Boundary, BoundaryCurve, BoundaryMap, BoundaryPoint, BoundaryRequest, LeafBeside, MOST_CURVES,
    boundary,
};
pub use chart::{
    Chart, ChartError, ChartOptions, Contender, Decade, Ending, Peer, PeerRow, Reference, Row,
    Scaling, ScalingRow, Setting, Spread, Turn, chart, scaling,
};
pub use check::{Check, CheckOptions, Place, Quantity, Shot, Verdict, check};
pub use equilibria::{Equilibria, Found, IN_VAIN, equilibria};
pub use fit::{
    Comparison, Data, DataFile, Experiment, Fit, FitAlternative, FitBudget, FitCandidate, FitError,
    FitExperiment, FitLeaf, FitOutcome, FitParameter, FitRequest, FitResidual, FitStep,
    FitSystematic, FitWork, Free, FreeNumber, Measured, MeasuredColumn, MeasuredQuantity,
    OffsetColumn, Origin, Reading, RowChoice, RowCondition, Traced, fit,
};
pub use map::{
    CELL_SECONDS, Confidence, Map, MapJump, MapMethod, MapOutcome, MapRefused, MapRequest, MapRow,
    MapShow, map,
};
pub use margin::{MarginError, MarginProgress, relax_with_margin};
pub use sensitivity::{SensitivityError, relax_with_sensitivities, sensitivities_of};
pub use trace::{
    Law, MOST_BRANCHES, MOST_POINTS, PointKind, Trace, TraceBranch, TraceError, TracePoint,
    TraceRequest, TraceShow, TraceUntil, trace, trace_through,
};
pub use vary::{Base, Keys, Knob, Knobs, Number, Target, Varied, Vary, VaryError};
