//! Studies built on the solvers.

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
pub use crate::run::UnknownWord;
pub use crate::shooting::{Neutral, Solution as ShootingSolution};
pub use crate::study::boundary::{
    Boundary, BoundaryCurve, BoundaryMap, BoundaryPoint, BoundaryRequest, LeafBeside, MOST_CURVES,
    boundary,
};
pub use crate::study::chart::{
    Chart, ChartError, ChartOptions, Contender, Decade, Ending, Peer, PeerRow, Reference, Row,
    Scaling, ScalingRow, Setting, Spread, Turn, chart, scaling,
};
pub use crate::study::check::{Check, CheckOptions, Place, Quantity, Shot, Verdict, check};
pub use crate::study::equilibria::{Equilibria, Found, IN_VAIN, equilibria};
pub use crate::study::fit::{
    Comparison, Data, DataFile, Experiment, Fit, FitAlternative, FitBudget, FitCandidate, FitError,
    FitExperiment, FitLeaf, FitOutcome, FitParameter, FitRequest, FitResidual, FitStep,
    FitSystematic, FitWork, Free, FreeNumber, Measured, MeasuredColumn, MeasuredQuantity,
    OffsetColumn, Origin, Reading, RowChoice, RowCondition, Traced, fit,
};
pub use crate::study::map::{
    CELL_SECONDS, Confidence, Map, MapJump, MapMethod, MapOutcome, MapRefused, MapRequest, MapRow,
    MapShow, map,
};
pub use crate::study::margin::{MarginError, MarginProgress, relax_with_margin};
pub use crate::study::sensitivity::{
    SensitivityError, relax_blade, relax_with_sensitivities, sensitivities_of,
};
pub use crate::study::trace::{
    Law, MOST_BRANCHES, MOST_POINTS, PointKind, Trace, TraceBranch, TraceError, TracePoint,
    TraceRequest, TraceShow, TraceUntil, trace, trace_through,
};
pub use crate::study::vary::{Base, Keys, Knob, Knobs, Number, Target, Varied, Vary, VaryError};
