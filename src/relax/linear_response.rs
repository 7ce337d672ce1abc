//! The linearized equations of a leaf at rest, and its responses to small changes of forces and of where it is
//! held.

use crate::leaf::{
    DenseParameterForces, DirectSolver, DiscreteLeaf, ForceCarriers, Increment,
    LeafParameterDerivative, LinearResponse, LinearSolveOutcome, MatrixFactors, NodalField,
    ParameterForces, System, Weighted, add_to_increment,
};
use crate::newton::{FollowerForces, solve_with_follower_forces};
use crate::relax::accuracy::transfer::GridLevel;
use crate::relax::solve_on_grid::follower_loads::WithoutPotential;
use glam::DVec3;

/// Relative accuracy of the conjugate gradients, as a part of the tolerance, and its lower
/// limit.
const CONJUGATE_GRADIENT_ACCURACY: f64 = 3e-3;

const BEST_CONJUGATE_GRADIENT_ACCURACY: f64 = 1e-11;

/// A leaf at rest (all rods, in space) with its equations linearized and factorized once for
/// all right-hand sides.
pub(crate) struct Linearized {
    system: System,
    carriers: ForceCarriers,
    /// Relative accuracy of the conjugate gradients.
    accuracy: f64,
    /// Whether the matrix is factorized rod by rod; otherwise a sparse direct factorization is
    /// used.
    factorized: bool,
    /// Right-hand sides for which the equations were solved so far.
    pub solves: usize,
    /// How often the matrix was factorized so far.
    pub factorizations: usize,
}

impl Linearized {
    /// Linearizes about the state of a level.
    pub fn new(level: &GridLevel, tolerance: f64) -> Linearized {
        let (leaf, state) = (&level.leaf, &level.state);
        let mut system = System::new(leaf);
        leaf.assemble(state, &mut system);
        leaf.add_phase_conditions(state, &mut system);
        let factorized = match leaf.has_moments() {
            // Where K is unsymmetric by these loads it is factorized as a whole.
            _ if has_unsymmetric_matrix(leaf) => false,
            false => system.factorize(0.0),
            true => system.factorize_indefinite(),
        };
        Linearized {
            system,
            carriers: leaf.force_carriers(state),
            accuracy: (CONJUGATE_GRADIENT_ACCURACY * tolerance)
                .clamp(BEST_CONJUGATE_GRADIENT_ACCURACY, 1e-4),
            factorized,
            solves: 0,
            factorizations: 1,
        }
    }

    /// The forces by which parameter changes of the leaf unbalance that state.
    pub fn forces(
        &self,
        level: &GridLevel,
        rates: &[LeafParameterDerivative],
    ) -> Vec<ParameterForces> {
        let GridLevel { leaf, state } = level;
        let force = |rate: &LeafParameterDerivative| {
            let mut forces = leaf.parameter_forces(state, &self.carriers, rate);
            if has_unsymmetric_matrix(leaf) {
                add_wind_changes(level, rate, &mut forces);
                add_changes_by_supports(level, rate, &mut forces);
            }
            forces
        };
        rates.iter().map(force).collect()
    }

    /// The responses to forces. `None` if the matrix is singular.
    pub fn responses(
        &mut self,
        level: &GridLevel,
        loads: &[ParameterForces],
    ) -> Option<Vec<LinearResponse>> {
        self.responses_to(level, loads, self.accuracy)
    }

    /// The responses to forces, to another relative accuracy.
    pub fn responses_to(
        &mut self,
        level: &GridLevel,
        loads: &[ParameterForces],
        accuracy: f64,
    ) -> Option<Vec<LinearResponse>> {
        let (leaf, carriers, solves) = (&level.leaf, &self.carriers, &mut self.solves);
        if self.factorized {
            let system = &mut self.system;
            let mut by_rods = |rhs: &NodalField| {
                *solves += 1;
                system.set_rhs(rhs);
                match system.solve(None, accuracy) {
                    LinearSolveOutcome::Converged(_) => Some(system.solution()),
                    _ => None,
                }
            };
            let found: Option<Vec<_>> = (loads.iter())
                .map(|load| response(leaf, carriers, load, &mut by_rods))
                .collect();
            if found.is_some() {
                return found;
            }
            self.factorized = false;
        }
        leaf.assemble(&level.state, &mut self.system);
        leaf.add_phase_conditions(&level.state, &mut self.system);
        self.factorizations += 1;
        let pattern = DirectSolver::new(&self.system).ok()?;
        let mut factor: MatrixFactors = pattern.factorize(&self.system, 0.0).ok()?;
        let following = has_unsymmetric_matrix(leaf).then(|| WithoutPotential::new(leaf));
        let mut direct = |rhs: &NodalField| {
            *solves += 1;
            match &following {
                Some(forces) => solve_with_follower_forces(&mut factor, rhs, forces, &level.state),
                None => Some(factor.solve_bordered(rhs, &[]).increments),
            }
        };
        (loads.iter())
            .map(|load| response(leaf, carriers, load, &mut direct))
            .collect()
    }

    /// The work of forces on the response to others: by symmetry also that of the others on
    /// the response to these.
    pub fn work(
        &self,
        level: &GridLevel,
        forces: &ParameterForces,
        response: &LinearResponse,
    ) -> f64 {
        level.leaf.mutual_work(&self.carriers, forces, response)
    }
}

/// Whether the derivative of the forces on a leaf has no symmetry: of wind, and of loads that turn with the sections. A
/// system of equations takes account of dead moments on a single rod itself.
fn has_unsymmetric_matrix(leaf: &DiscreteLeaf) -> bool {
    leaf.leaf.in_wind() || leaf.has_followers()
}

/// Adds the changes of the drag on the nodes of a leaf in wind.
fn add_wind_changes(
    level: &GridLevel,
    rate: &LeafParameterDerivative,
    forces: &mut ParameterForces,
) {
    let GridLevel { leaf, state } = level;
    let nodes = leaf.moving_nodes();
    for Weighted { weight, term } in rate.weighted_leaves().iter().filter(|it| it.term.in_wind()) {
        let there = DiscreteLeaf::new(term, leaf.grid.clone());
        let drag = WithoutPotential::new(&there).wind_forces(state);
        for (j, i) in leaf.rod_index_pairs(nodes.clone()) {
            let on = &mut forces.rod_forces_mut(j, nodes.len())[i - nodes.start];
            add_to_increment(on, DVec3::ZERO, *weight * drag[state.base(j) + i]);
        }
    }
}

/// Adds the changes of the forces without a potential as supports and clamped bases move.
fn add_changes_by_supports(
    level: &GridLevel,
    rate: &LeafParameterDerivative,
    forces: &mut ParameterForces,
) {
    let GridLevel { leaf, state } = level;
    let following = WithoutPotential::new(leaf);
    let nodes = leaf.moving_nodes().len();
    let rod = |moved: &Vec<Increment>| {
        let mut all = moved.clone();
        all.resize(nodes, [0.0; 6]);
        all
    };
    let moved: NodalField = forces.support_increments.iter().map(rod).collect();
    let mut change: NodalField = vec![vec![[0.0; 6]; nodes]; leaf.rods()];
    following.add_derivative(state, &moved, &mut change);
    following.add_base_motion(
        state,
        |j| rate.base_motion_rate(j).displacement,
        &mut change,
    );
    for (j, change) in change.iter().enumerate() {
        let on_rod = forces.rod_forces_mut(j, nodes).iter_mut().zip(change);
        for (on, change) in on_rod {
            on.iter_mut()
                .zip(change)
                .for_each(|(sum, more)| *sum += more);
        }
    }
}

fn response(
    leaf: &DiscreteLeaf,
    carriers: &ForceCarriers,
    load: &ParameterForces,
    solve: &mut dyn FnMut(&NodalField) -> Option<NodalField>,
) -> Option<LinearResponse> {
    let DenseParameterForces {
        nodes: mut rhs,
        mut gaps,
    } = load.dense(leaf);
    let mut response = LinearResponse {
        nodes: NodalField::new(),
        force_changes: vec![DVec3::ZERO; gaps.len()],
    };
    leaf.condense_gaps(carriers, &gaps, &mut rhs);
    // In the matrix held components have a large stiffness, and a neighbor's coupling moves them a little.
    let solve = &mut |forces: &NodalField| {
        let mut nodes = solve(forces)?;
        leaf.zero_held_components(&carriers.spin_axes, &mut nodes);
        Some(nodes)
    };
    response.nodes = solve(&rhs)?;
    leaf.carried_force_changes(
        carriers,
        &response.nodes,
        &mut gaps,
        &mut response.force_changes,
    );
    leaf.complete_law(carriers, &mut response, &mut gaps, true, solve);
    // Held nodes move with their holders.
    for (rod, moved) in response.nodes.iter_mut().zip(&load.support_increments) {
        let nodes = rod.iter_mut().flatten().zip(moved.iter().flatten());
        nodes.for_each(|(sum, value)| *sum += value);
    }
    let mut numbers = response.nodes.iter().flatten().flatten();
    let finite = numbers.all(|value| value.is_finite());
    finite.then_some(response)
}
