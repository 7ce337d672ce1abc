//! How a leaf comes to rest: the start, the semi-implicit motion on one grid,
//! the nested grids with their extrapolation, saddles, modes, and the result.

pub(crate) mod accuracy;
mod follow;
mod follower;
mod from_shape;
mod grids;
mod loading;
mod nested;
mod path;
mod preference;
mod relaxation;
mod request;
mod rest;
mod result;
mod saddle;
mod sensitivity;
pub(crate) mod settle;
mod shooting;
mod solve;
pub(crate) mod stability;
pub(crate) mod transfer;

pub use crate::limit::Limit;
pub use crate::newton::Work;
pub use crate::refusal::{RefusedOption, Unmodelled};
pub use crate::relax::relaxation::Relaxation;
pub use crate::relax::request::method::{Method, SemiImplicit, Settings, Unfit};
pub use crate::relax::request::options::{
    LARGEST_TOLERANCE, MAX_NODES, MOST_MODES, Options, Progress, RelaxError, SMALLEST_TOLERANCE,
    check_tolerance, without_wind,
};
pub use crate::relax::result::blade::{BladeReport, FewerVeins};
pub(crate) use crate::relax::result::equilibrium::serialize_index;
pub use crate::relax::result::equilibrium::{
    Accuracy, Equilibrium, Mode, Model, Outcome, Sensitivity, Shape, Stability,
};
pub use crate::relax::result::margin::{Barrier, Direction, Fate, Loss, Margin, Neighbour, Push};
pub use crate::relax::result::reaction::{GripReaction, Reaction};
pub use crate::relax::result::stress::Stresses;
pub(crate) use crate::relax::sensitivity::parameter::Parameter;
pub(crate) use crate::relax::settle::segments::check_segments;
pub(crate) use crate::relax::settle::start::start;
pub(crate) use crate::relax::shooting::{START as SHOOTING_START, check_intervals};
pub(crate) use crate::relax::stability::index::{index_near, project};
pub(crate) use crate::relax::transfer::level::Level;
pub(crate) use crate::relax::transfer::stencil::Stencil;
pub(crate) use crate::relax::transfer::strains::rods as shape_of;
pub use crate::shape::{NodeState, RodShape};
pub use crate::shooting::Correction;
pub use crate::words::UnknownWord as UnknownMethod;
pub(crate) use follow::{Grids, Lost};
pub use follower::{Followed, Follower};
pub use from_shape::relax_from;
pub(crate) use nested::NestedEquilibrium;
pub use path::{Event, Happening, Path, Route, Stage};
pub(crate) use rest::relax_on_grids;
pub use saddle::Saddle;
pub(crate) use saddle::{ANY_SIGN, NOISY, polish};
pub(crate) use sensitivity::{Linearized, Nearby, sensitivities, unit_forces};
pub use solve::relax;
