//! How a leaf comes to rest: the start, the semi-implicit motion on one grid,
//! the nested grids with their extrapolation, saddles, modes, and the result.

mod between;
mod correction;
mod decision;
mod defect;
mod equilibrium;
pub(crate) mod fall;
mod follow;
mod found;
mod grids;
mod grip;
pub(crate) mod index;
pub(crate) mod level;
mod margin;
mod method;
mod methods;
mod modes;
mod nodes;
mod number;
mod options;
mod path;
mod plausible;
pub(crate) mod predict;
pub(crate) mod prolong;
mod request;
mod result;
pub(crate) mod richardson;
mod run;
mod saddle;
mod segments;
mod sensitivity;
mod series;
mod settle;
mod shape;
mod solve;
mod stability;
pub(crate) mod start;
mod stations;
mod stencil;

pub use crate::bvp::Correction;
pub use crate::limit::Limit;
pub use crate::newton::Work;
pub use crate::refusal::RefusedOption;
pub use crate::shape::{NodeState, RodShape};
pub use crate::words::UnknownWord as UnknownMethod;
pub(crate) use equilibrium::serialize_index;
pub use equilibrium::{
    Accuracy, Equilibrium, Mode, Model, Outcome, Reaction, Sensitivity, Shape, Stability,
};
pub(crate) use follow::{AtRest, Grids, Lost};
pub(crate) use index::{index_near, project};
pub(crate) use level::Level;
pub use margin::{Barrier, Direction, Fate, Loss, Margin, Neighbour, Push};
pub use method::{Method, SemiImplicit, Settings, Unfit};
pub(crate) use methods::shooting::{START as SHOOTING_START, check_intervals};
pub(crate) use number::Number;
pub use options::{
    LARGEST_TOLERANCE, MAX_NODES, MOST_MODES, Options, Progress, RelaxError, SMALLEST_TOLERANCE,
    check_tolerance,
};
pub use path::{Event, Happening, Path, Route, Stage};
pub use request::Relaxation;
pub use saddle::Saddle;
pub(crate) use saddle::{ANY_SIGN, NOISY, polish};
pub(crate) use segments::check_segments;
pub(crate) use sensitivity::{Linearized, Nearby, sensitivities, unit_forces};
pub(crate) use shape::rods as shape_of;
pub use solve::relax;
pub(crate) use solve::relax_on_grids;
pub(crate) use start::start;
pub(crate) use stencil::Stencil;
