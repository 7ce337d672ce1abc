//! A positive definite matrix that is factorised once and solved with several right-hand sides: rod
//! by rod with conjugate gradients or, where tissue ties the rods, as a whole.

use super::direct::{DirectSolver, Factors};
use super::system::{Solved, System};

/// The factors of the matrix assembled in a [`System`]; those of the rods are in the system itself.
pub struct Factorised(Option<Factors>);

impl Factorised {
    /// Factorises K + `shift` M; `None` if it is not positive definite, or does not fit into memory.
    pub fn new(system: &mut System, shift: f64) -> Option<Self> {
        if !system.tied() {
            return system.factorize(shift).then_some(Factorised(None));
        }
        let solver = DirectSolver::new(system).ok()?;
        let factors = solver.factorize_definite(system, shift).ok()??;
        Some(Factorised(Some(factors)))
    }

    /// Factorises the matrix of a single rod whatever the signs of its pivots; `None` if one of them
    /// is zero.
    pub fn of_single_rod(system: &mut System) -> Option<Self> {
        system.factorize_indefinite().then_some(Factorised(None))
    }

    /// Solves for the right-hand side in `system`, to the relative accuracy `tolerance` in the
    /// energy norm.
    pub fn solve(&mut self, system: &mut System, tolerance: f64) -> Solved {
        match &mut self.0 {
            None => system.solve(None, tolerance),
            Some(factors) => {
                factors.solve(system, None);
                Solved::Yes(1)
            }
        }
    }
}
