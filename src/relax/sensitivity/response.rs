//! The linear response of a settled leaf to forces, and to changes of its parameters.

use crate::leaf::{
    DirectSolver, DiscreteLeaf, Factors, Field, Forces, LeafRate, Response, Solved, State, System,
};
use crate::relax::transfer::level::Level;
use crate::rod::Segment;
use crate::rotation;
use glam::DVec3;

/// Relative accuracy of the conjugate gradients, as a part of the tolerance, and its lower
/// limit.
const SOLUTION: f64 = 3e-3;
const BEST_SOLUTION: f64 = 1e-11;

/// A settled leaf (all rods, in space) with its equations linearised and factorised once for
/// all right-hand sides.
pub(crate) struct Linearized {
    system: System,
    segments: Vec<Segment>,
    /// Relative accuracy of the conjugate gradients.
    accuracy: f64,
    /// Whether the matrix is factorised rod by rod; otherwise a sparse direct factorisation is
    /// used.
    factorized: bool,
    /// Linear solutions so far.
    pub solves: usize,
    /// Factorisations so far.
    pub factorizations: usize,
}

impl Linearized {
    /// Linearises about the state of a level.
    pub fn new(level: &Level, tolerance: f64) -> Linearized {
        let (leaf, state) = (&level.leaf, &level.state);
        let mut system = System::new(leaf);
        leaf.assemble(state, &mut system);
        leaf.hold_turn(state, &mut system);
        let factorized = match leaf.has_moments() {
            false => system.factorize(0.0),
            true => system.factorize_indefinite(),
        };
        Linearized {
            system,
            segments: leaf.all_segments(state),
            accuracy: (SOLUTION * tolerance).clamp(BEST_SOLUTION, 1e-4),
            factorized,
            solves: 0,
            factorizations: 1,
        }
    }

    /// The forces by which parameter changes of the leaf unbalance that state.
    pub fn forces(&self, level: &Level, rates: &[LeafRate]) -> Vec<Forces> {
        let force = |rate| level.leaf.rate(&level.state, &self.segments, rate);
        rates.iter().map(force).collect()
    }

    /// The responses to forces. `None` if the matrix is singular.
    pub fn responses(&mut self, level: &Level, loads: &[Forces]) -> Option<Vec<Response>> {
        self.responses_to(level, loads, self.accuracy)
    }

    /// The same to another relative accuracy.
    pub fn responses_to(
        &mut self,
        level: &Level,
        loads: &[Forces],
        accuracy: f64,
    ) -> Option<Vec<Response>> {
        let (leaf, segments, solves) = (&level.leaf, &self.segments, &mut self.solves);
        if self.factorized {
            let system = &mut self.system;
            let mut by_rods = |rhs: &Field| {
                *solves += 1;
                system.set_rhs(rhs);
                match system.solve(None, accuracy) {
                    Solved::Yes(_) => Some(system.solution()),
                    _ => None,
                }
            };
            let found: Option<Vec<_>> = (loads.iter())
                .map(|load| response(leaf, segments, load, &mut by_rods))
                .collect();
            if found.is_some() {
                return found;
            }
            self.factorized = false;
        }
        leaf.assemble(&level.state, &mut self.system);
        leaf.hold_turn(&level.state, &mut self.system);
        self.factorizations += 1;
        let pattern = DirectSolver::new(&self.system).ok()?;
        let mut factor: Factors = pattern.factorize(&self.system, 0.0).ok()?;
        let mut direct = |rhs: &Field| {
            *solves += 1;
            Some(factor.solve_bordered(rhs, &[]).increments)
        };
        (loads.iter())
            .map(|load| response(leaf, segments, load, &mut direct))
            .collect()
    }

    /// The work of forces on the response to others: by symmetry also that of the others on
    /// the response to these.
    pub fn work(&self, level: &Level, forces: &Forces, response: &Response) -> f64 {
        level.leaf.work(&self.segments, forces, response)
    }
}

fn response(
    leaf: &DiscreteLeaf,
    segments: &[Segment],
    load: &Forces,
    solve: &mut dyn FnMut(&Field) -> Option<Field>,
) -> Option<Response> {
    let (mut rhs, mut gaps) = load.dense(leaf);
    let mut response = Response {
        nodes: Field::new(),
        carried: vec![DVec3::ZERO; gaps.len()],
    };
    leaf.condense_gaps(segments, &gaps, &mut rhs);
    response.nodes = solve(&rhs)?;
    leaf.carried(segments, &response.nodes, &mut gaps, &mut response.carried);
    leaf.complete_law(segments, &mut response, &mut gaps, true, solve);
    // Held nodes move with their holders.
    for (rod, moved) in response.nodes.iter_mut().zip(&load.moved) {
        let nodes = rod.iter_mut().flatten().zip(moved.iter().flatten());
        nodes.for_each(|(sum, value)| *sum += value);
    }
    let mut numbers = response.nodes.iter().flatten().flatten();
    let finite = numbers.all(|value| value.is_finite());
    finite.then_some(response)
}

/// The state, moved along a response.
pub(crate) fn moved(level: &Level, rate: &LeafRate, response: &Response, step: f64) -> State {
    let mut state = level.state.clone();
    for j in 0..state.rods() {
        let base = state.base(j);
        let [shift, turn] = rate.of_base(j);
        state.x[base] += step * shift;
        state.q[base] = (rotation::exp(step * turn) * state.q[base]).normalize();
    }
    response.advance(&mut state, step);
    state
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::relax::{Options, relax_on_grids};
    use crate::scenario::Scenario;

    /// A derivative costs one solution on each grid, and no factorisation of its own.
    #[test]
    fn a_number_costs_one_solution_on_a_grid() {
        let text = include_str!("../../../scenarios/paper/fig04.toml");
        let scenario = Scenario::from_toml(text).unwrap();
        let options = Options::default();
        let (_, found) = relax_on_grids(&scenario, &options, false, &mut |_| {}).unwrap();
        for level in &found.levels {
            let mut linear = Linearized::new(level, 1e-6);
            let units = super::super::unit_forces(&level.leaf, 1);
            let loads: Vec<Forces> = units.iter().cycle().take(10).cloned().collect();
            assert_eq!(linear.responses(level, &loads).unwrap().len(), 10);
            assert_eq!((linear.solves, linear.factorizations), (10, 1));
        }
    }
}
