//! The builder of a relaxation for users of the library.

use crate::clock::Instant;
use crate::relax::request::method::Method;
use crate::relax::request::options::{Options, Progress, RelaxError};
use crate::relax::result::equilibrium::Equilibrium;
use crate::relax::solve::relax;
use crate::scenario::Scenario;
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
    /// [`Outcome`](crate::relax::Outcome).
    pub fn relax(&self) -> Result<Equilibrium, RelaxError> {
        self.relaxation().run()
    }

    /// The same with options:
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
            assert_eq!(leaf.outcome, Outcome::NotAtRest, "{method:?}");
        }
        assert!(steps.get() < 10);
    }
}
