//! How a leaf comes to rest, how accurate that is, and whether it is stable; the builder of a relaxation
//! for users of the library.
//!
//! A reader's way: `request` is what is asked for; `plan` is which equilibrium is meant, and by which
//! attempts it is looked for; `rest` makes them and puts the result together. `loading` follows the
//! path of slow loading, `solve_on_grid` brings the leaf to rest on one grid by any method,
//! `accuracy` extrapolates over grids and estimates the error, `stability` decides by
//! `eigenvalues` where the grids disagree, and `result` is what was found.

pub(crate) mod accuracy;
pub(crate) mod balanced;
pub(crate) mod eigenvalues;
mod follow;
mod linear_response;
mod loading;
mod log;
pub(crate) mod motion_shapes;
mod nested_grids;
mod path;
pub(crate) mod plan;
mod remark;
mod request;
pub(crate) mod rest;
mod result;
mod saddle;
mod same_equilibrium;
mod sensitivity;
mod shooting;
pub(crate) mod small_motions;
pub(crate) mod solve_on_grid;
pub(crate) mod stability;

pub use crate::leaf::{BucklingMode, BucklingMotion};
use crate::memory;
pub use crate::motion::AssumedMotion;
pub use crate::newton::{EquilibriumFailure, SolverCounts};
pub(crate) use crate::relax::accuracy::NestedEquilibrium;
pub(crate) use crate::relax::accuracy::transfer::{GridLevel, StateOnGrid, Stencil, rod_shapes};
pub(crate) use crate::relax::follow::{ContinuationFailure, GridPolicy};
pub use crate::relax::follow::{EquilibriumTracker, TrackOutcome};
pub(crate) use crate::relax::linear_response::Linearized;
pub use crate::relax::log::{Attempt, AttemptEnd, Extent, Strategy};
pub use crate::relax::motion_shapes::MotionShape;
pub use crate::relax::path::{Event, Path, PathPosition, Route, StabilityLoss, Stage};
pub(crate) use crate::relax::remark::serialize_remark;
pub use crate::relax::remark::{
    CriticalTipForceRemark, EquilibriumDoubt, EquilibriumRemark, MarginRemark, MotionVerdict,
    RestObstacle, SpanHolder, VeinsRemark,
};
pub(crate) use crate::relax::request::check_natural_tips;
pub use crate::relax::request::{
    LARGEST_TOLERANCE, MAX_NODES, MOST_MODES, Method, Options, Progress, RelaxError,
    SMALLEST_TOLERANCE, SemiImplicit, Settings, ShootingVariant, UnsupportedSetting,
    check_tolerance, without_wind_or_followers,
};
pub use crate::relax::rest::relax_from;
pub(crate) use crate::relax::rest::{RelaxedLeaf, relax_on_grids};
pub use crate::relax::result::forces::{BaseReaction, GripReaction, Reaction, Stresses};
pub(crate) use crate::relax::result::serialize_index;
pub use crate::relax::result::{
    Accuracy, AxisDirection, Barrier, BladeReport, CriticalTipForce, Equilibrium, FewerVeins,
    InstabilityKind, Margin, Mode, Model, Neighbour, Outcome, PostcriticalBehavior, Sensitivity,
    Shape, Stability, TriedVeins,
};
pub use crate::relax::saddle::Saddle;
pub(crate) use crate::relax::saddle::{
    INDEFINITE_NEWTON_EQUATIONS, NOISY_EIGENVALUE_THRESHOLD, converge_saddle,
};
pub(crate) use crate::relax::sensitivity::{
    NeighbouringEquilibria, NeighbouringScenario, Parameter, sensitivities, unit_forces,
};
pub(crate) use crate::relax::shooting::{START_TOLERANCE, check_intervals};
pub(crate) use crate::relax::small_motions::small_motion_pairs;
pub use crate::relax::small_motions::{DominantMotion, MotionInstability, SmallMotions};
pub(crate) use crate::relax::solve_on_grid::check_segments;
pub(crate) use crate::relax::solve_on_grid::start::initial_state;
pub(crate) use crate::relax::stability::{index_near, state_from_rod_shapes};
use crate::run::Instant;
pub use crate::run::{Limit, RefusedOption, UnknownWord as UnknownMethod, UnmodelledFeature};
use crate::scenario::Scenario;
pub use crate::shape::{NodeState, RodShape};
pub use crate::shooting::{CorrectionProgress, NeutralDirection, ShootingFailureReason};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::Duration;

/// A relaxation to be run, with the defaults of scenario and program for what is not set. Made
/// by [`Scenario::relaxation`].
#[must_use = "nothing is solved before `run`"]
pub struct Relaxation<'a> {
    scenario: &'a Scenario,
    options: Options,
    progress: Box<dyn FnMut(&Progress) + 'a>,
}

impl Scenario {
    /// Brings the leaf to rest, to the scenario's tolerance.
    ///
    /// # Errors
    /// Requests that cannot be met; the end of the run itself is the result's
    /// [`Outcome`].
    pub fn relax(&self) -> Result<Equilibrium, RelaxError> {
        self.relaxation().run()
    }

    /// A relaxation of the scenario's leaf with options:
    ///
    /// ```
    /// use leafdyn::relax::Method;
    /// # let scenario = leafdyn::scenario::Scenario::from_toml(
    /// #     r#"
    /// #     name = "cantilever"
    /// #     leaf = { rods = 1, length = 1.0, fan = [0.0] }
    /// #     stiffness = { torsion = 1, bending_2 = 1, bending_3 = 1, axial = 100, shear_2 = 100, shear_3 = 100 }
    /// #     load = { tip_force = [0.0, 0.0, -1.0] }
    /// #     "#,
    /// # )?;
    /// let leaf = scenario.relaxation().tolerance(1e-8).modes(3).run()?;
    /// assert!(leaf.accuracy.error_estimate < Some(1e-8));
    ///
    /// let shooting = Method::Shooting { intervals: None };
    /// let same = scenario.relaxation().method(shooting).tolerance(1e-8).run()?;
    /// assert!((leaf.tips[0] - same.tips[0]).length() < 1e-8);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn relaxation(&self) -> Relaxation<'_> {
        Relaxation {
            scenario: self,
            options: Options::default(),
            progress: Box::new(|_| {}),
        }
    }
}

impl<'a> Relaxation<'a> {
    /// Sets the method, with its options.
    pub fn method(mut self, method: Method) -> Self {
        self.options.method = method;
        self
    }

    /// Uses one grid of `segments` segments a rod, without extrapolation and hence without an
    /// error estimate.
    pub fn grid(mut self, segments: usize) -> Self {
        self.options.method = self.options.method.on_grid(Some(segments));
        self
    }

    /// Sets the accuracy of the centerlines, relative to the longest rod.
    pub fn tolerance(mut self, tolerance: f64) -> Self {
        self.options.tolerance = Some(tolerance);
        self
    }

    /// Requests the `count` lowest modes of vibration.
    pub fn modes(mut self, count: usize) -> Self {
        self.options.modes = count;
        self.options.mode_shapes = count > 0;
        self
    }

    /// Requests the leaf at the nodes of the finest grid, not only at those of the coarsest.
    pub fn every_node(mut self) -> Self {
        self.options.every_node = true;
        self
    }

    /// Stops the run, not at rest, after this time.
    pub fn time_limit(mut self, time: Duration) -> Self {
        self.options.limit.deadline = Some(Instant::now() + time);
        self
    }

    /// Stops the run, not at rest, as soon as `cancel` is `true`; another thread may set it.
    pub fn cancel(mut self, cancel: Arc<AtomicBool>) -> Self {
        self.options.limit.cancel = Some(cancel);
        self
    }

    /// Calls `progress` in every step.
    pub fn progress(mut self, progress: impl FnMut(&Progress) + 'a) -> Self {
        self.progress = Box::new(progress);
        self
    }

    /// Runs the relaxation.
    pub fn run(mut self) -> Result<Equilibrium, RelaxError> {
        relax(self.scenario, &self.options, &mut self.progress)
    }
}

/// Factor on the tolerance of a leaf that does not keep it between the stations of its
/// solution, in layers thinner than the distance of these.
const STATION_TOLERANCE_FACTOR: f64 = 1e-2;

/// Brings a scenario's leaf to rest.
///
/// # Errors
/// Requests that cannot be met; everything that happens while solving is an
/// [`Outcome`] instead.
pub fn relax(
    scenario: &Scenario,
    options: &Options,
    progress: &mut dyn FnMut(&Progress),
) -> Result<Equilibrium, RelaxError> {
    if let Some(stations) = options.stations {
        memory::check_station_memory(scenario.rods.len(), stations)?;
    }
    let found = relax_once(scenario, options, progress)?;
    let Some(parts) = options.stations else {
        return Ok(found);
    };
    if found.keeps_tolerance_at(scenario, parts) {
        return Ok(found);
    }
    let tolerance = found.accuracy.tolerance;
    let sharper = Options {
        tolerance: Some((STATION_TOLERANCE_FACTOR * tolerance).max(SMALLEST_TOLERANCE)),
        ..options.clone()
    };
    let mut sharp = relax_once(scenario, &sharper, progress)?;
    sharp.accuracy.tolerance = tolerance;
    let mut tips = sharp.tips.iter().zip(&found.tips);
    let apart = 2.0 * tolerance * found.shape.longest();
    let same = sharp.stability.negative_eigenvalues == found.stability.negative_eigenvalues
        && tips.all(|(one, other)| one.distance(*other) <= apart);
    if !same || !sharp.keeps_tolerance() || !sharp.keeps_tolerance_at(scenario, parts) {
        return Ok(found);
    }
    sharp.wall_seconds += found.wall_seconds;
    Ok(Equilibrium {
        outcome: found.outcome,
        remark: found.remark,
        work: found.work + sharp.work,
        ..sharp
    })
}

/// Relaxes once, whatever the stations.
fn relax_once(
    scenario: &Scenario,
    options: &Options,
    progress: &mut dyn FnMut(&Progress),
) -> Result<Equilibrium, RelaxError> {
    let tolerance = options.tolerance.unwrap_or(scenario.tolerance);
    check_tolerance(tolerance)?;
    if options.modes > MOST_MODES {
        let allowed = format!("allowed are 0 to {MOST_MODES}");
        return Err(RefusedOption::new("modes", options.modes, allowed).into());
    }
    if options.mode_shapes && options.method.is_shooting() {
        // Shooting has no grids on which eigenvalues are computed.
        let why = "modes are those of a relaxed leaf: use the method semi-implicit";
        return Err(RefusedOption::new("modes", options.modes, why).into());
    }
    if options.method.is_shooting() {
        return shooting::relax(scenario, options, tolerance, progress);
    }
    let shape_alone = options.modes == 0;
    relax_on_grids(scenario, options, shape_alone, progress).map(|leaf| leaf.result)
}

crate::renamed! {
    Correction => CorrectionProgress,
    Direction => AxisDirection,
    Fate => PostcriticalBehavior,
    Followed => TrackOutcome,
    Follower => EquilibriumTracker,
    Happening => StabilityLoss,
    Loss => InstabilityKind,
    Push => CriticalTipForce,
    Unfit => UnsupportedSetting,
    Unmodelled => UnmodelledFeature,
    Work => SolverCounts,
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::relax::Outcome;

    #[test]
    fn a_cancelled_run_says_that_it_is_not_at_rest() {
        let scenario = Scenario::from_toml(
            r#"
            name = "fan"
            leaf = { rods = 3, length = 1.0, fan = "symmetric" }
            stiffness = { torsion = 1, bending_2 = 1, bending_3 = 1, axial = 100, shear_2 = 100, shear_3 = 100 }
            load = { gravity = [0.0, 0.0, -1.0] }
            "#,
        )
        .unwrap();
        let cancel = Arc::new(AtomicBool::new(true));
        let steps = std::cell::Cell::new(0);
        for method in [Method::default(), Method::Explicit { segments: None }] {
            let leaf = (scenario.relaxation().method(method))
                .cancel(cancel.clone())
                .progress(|_| steps.set(steps.get() + 1))
                .run()
                .unwrap();
            assert_eq!(leaf.outcome, Outcome::OutOfTime, "{method:?}");
        }
        assert!(steps.get() < 10);
    }
}
