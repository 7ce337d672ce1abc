//! How accurate a leaf at rest is: the leaf on nested grids, their extrapolation, and the error bar from
//! the extrapolation and from the defect of the equations.
//!
//! An equilibrium on nested grids is a value: on a finer grid another one takes its place. Whoever
//! needs the leaf more accurately, or is not sure of its index, asks
//! [`nested_grids`](crate::relax::nested_grids) for that.

pub(crate) mod defect;
pub(crate) mod fields;
pub(crate) mod richardson;
pub(crate) mod transfer;

use crate::leaf::{
    DiscreteLeaf, EquationWorkspace, Grid, Leaf, whole_leaf_changes, whole_leaf_fields,
};
use crate::memory;
use crate::newton::{Contraction, EquilibriumFailure, SolverCounts};
use crate::numbers::larger;
use crate::relax::accuracy::defect::{CorrectionGoal, DefectEstimate, FactorizedLevel};
use crate::relax::accuracy::fields::{FieldsAtNodes, finer_nodes};
use crate::relax::accuracy::richardson::{EXTRAPOLATED_GRIDS, Extrapolated, Richardson};
use crate::relax::accuracy::transfer::{
    GridLevel, NodalResultants, Stencil, mirror_level, positions, weights,
};
use crate::relax::path::Path;
use crate::relax::plan::{GRIDS, RelaxationProblem, WayFromStart};
use crate::relax::request::MAX_NODES;
use crate::relax::saddle::Saddle;
use crate::scenario::Grip;
use glam::DVec3;

/// Changes of the energy from grid to grid below this part of it, or of A/L, are rounding.
const ENERGY_NOISE: f64 = 1e-11;

/// A leaf at rest on nested grids.
pub struct NestedEquilibrium {
    /// The leaf on each grid, from coarse to fine. Where it failed the last is that of the failure.
    pub levels: Vec<GridLevel>,
    /// The positions on all grids, extrapolated to a segment length of zero.
    pub convergence_table: Richardson,
    /// Weight of each grid in the extrapolated values.
    pub weights: Vec<f64>,
    /// The error of the table's best column where the energy converges otherwise than its order
    /// indicates: then layers are thinner than the segments, and what they change in positions,
    /// which is the same on all grids that miss them, is not seen in these.
    unresolved: f64,
    /// The error estimated from the defect of the extrapolated values, if it is known.
    pub estimate: Option<DefectEstimate>,
    /// The factorized linear equations of that estimate.
    pub factorized_level: Option<FactorizedLevel>,
    /// Whether the error of positions is within the tolerance; always on a fixed grid.
    pub keeps_tolerance: bool,
    /// Negative eigenvalues, as counted on the finest grid.
    pub index: Option<usize>,
    /// Whether the lowest eigenvalue is clearly positive.
    pub clearly_stable: bool,
    /// Factor on the error estimate of a leaf that is beside a bifurcation: see
    /// [`LowestModes::bifurcation_error_factor`](crate::relax::eigenvalues::LowestModes::bifurcation_error_factor).
    pub bifurcation_error_factor: f64,
    /// Veins solved for; the others are mirror images.
    pub solved_rods: usize,
    /// Whether a grid was added for the nodes of the finest one.
    pub added_for_nodes: bool,
    /// Whether the leaf moved far from its start, and to no equilibrium on two grids.
    pub unconfirmed: bool,
    /// How the leaf came to where it is, if that is known.
    pub path: Option<Path>,
    /// How the iterations on its grids went.
    pub history: History,
    /// The work on all grids.
    pub work: SolverCounts,
    /// The requested error of positions, in lengths of the leaf.
    tolerance: f64,
    /// Whether its only grid is a requested one.
    has_fixed_grid: bool,
}

/// How the iterations that brought a leaf to rest on its grids went.
#[derive(Clone, Copy, Debug, Default)]
pub struct History {
    /// The last saddle that the leaf left.
    pub saddle: Option<Saddle>,
    /// What neglecting strains of the veins would change.
    pub strain_effects: StrainEffects,
    /// Largest remaining iteration error on any grid.
    pub iteration_error: f64,
    /// Convergence of Newton's method on the grids so far.
    pub contraction: Contraction,
    /// Number of pushes off saddles at which the iteration had converged (found by their Morse
    /// index).
    pub saddle_escapes: i32,
    /// How far the first equilibrium is from the start, if the leaf began there.
    pub from_start: Option<WayFromStart>,
    /// Segments of the coarsest grid on which the leaf rests, if there is one.
    pub coarsest: Option<usize>,
}

/// Largest displacements (lengths), to first order, if a strain of the veins were suppressed;
/// `None` where that was not computed.
#[derive(Clone, Copy, Debug, Default)]
pub struct StrainEffects {
    pub shear: Option<f64>,
    pub stretch: Option<f64>,
}

impl StrainEffects {
    /// The effects with displacements in another unit, of which a length has so many.
    pub fn scaled(self, length: f64) -> Self {
        let scaled = |effect: Option<f64>| effect.map(|effect| effect * length);
        StrainEffects {
            shear: scaled(self.shear),
            stretch: scaled(self.stretch),
        }
    }
}

/// Why a leaf failed to come to rest.
pub struct RelaxationFailure {
    /// The leaf on its grids when that happened.
    pub at: NestedEquilibrium,
    pub stop: EquilibriumFailure,
}

/// An equilibrium, or why none was found.
pub type RelaxationResult = Result<NestedEquilibrium, Box<RelaxationFailure>>;

impl RelaxationFailure {
    /// The failure of a leaf that came there on this path.
    pub fn with_path(self, path: Option<Path>) -> Self {
        let at = self.at.with_path(path);
        RelaxationFailure { at, ..self }
    }
}

/// What was found on this path, or, without one, on its own.
pub fn result_with_path(found: RelaxationResult, path: Option<Path>) -> RelaxationResult {
    match found {
        found if path.is_none() => found,
        Ok(found) => Ok(found.with_path(path)),
        Err(failure) => Err(Box::new(failure.with_path(path))),
    }
}

impl NestedEquilibrium {
    /// The leaf of a problem before it is at rest on any grid.
    pub fn without_grids(problem: &RelaxationProblem) -> Self {
        NestedEquilibrium {
            levels: Vec::new(),
            convergence_table: Richardson::default(),
            weights: Vec::new(),
            unresolved: 0.0,
            estimate: None,
            factorized_level: None,
            keeps_tolerance: true,
            index: None,
            clearly_stable: false,
            bifurcation_error_factor: 1.0,
            solved_rods: problem.leaf.rods(),
            added_for_nodes: false,
            unconfirmed: false,
            path: None,
            history: History::default(),
            work: SolverCounts::default(),
            tolerance: problem.tolerance,
            has_fixed_grid: problem.segments().is_some(),
        }
    }

    /// The leaf with its state on the next finer grid, without estimates so far.
    pub fn with_finer_level(mut self, finest: GridLevel) -> Self {
        self.levels.push(finest);
        self.with_convergence_table()
    }

    /// The leaf on these grids in place of its own, without estimates so far.
    pub fn with_levels(self, levels: Vec<GridLevel>) -> Self {
        NestedEquilibrium { levels, ..self }.with_convergence_table()
    }

    /// Takes the leaf on its finest grid out of the list.
    pub fn take_finest(&mut self) -> GridLevel {
        let finest = self.levels.pop().expect("the leaf is at rest on a grid");
        self.history.coarsest = (self.levels.first()).map(|level| level.leaf.segments());
        finest
    }

    /// The leaf with its finest grid again, which [`take_finest`](Self::take_finest) took.
    pub fn rejoin_finest(mut self, finest: GridLevel) -> Self {
        self.levels.push(finest);
        self.history.coarsest = (self.levels.first()).map(|level| level.leaf.segments());
        self
    }

    /// The leaf with this number of negative eigenvalues.
    pub fn with_index(self, clearly_stable: bool, index: Option<usize>) -> Self {
        NestedEquilibrium {
            clearly_stable,
            index,
            ..self
        }
    }

    /// Tabulates the positions on all grids, and discards earlier estimates.
    fn with_convergence_table(mut self) -> Self {
        let segments: Vec<usize> = (self.levels.iter())
            .map(|level| level.leaf.segments())
            .collect();
        let on = |level: &GridLevel| {
            let own = level.leaf.segments();
            (own, positions(level, own / segments[0]))
        };
        self.convergence_table = self.levels.iter().map(on).collect();
        let ordered = energies(&self.levels).proven_columns();
        self.unresolved = self.convergence_table.change_beyond(ordered);
        // Few grids show no order of the column before the best one.
        let part = match self.levels.as_slice() {
            [_, finest] if finest.leaf.has_tissue_cells() => BAR.tissue_part_of_two_grids,
            [_, _, finest] if finest.leaf.has_tissue_cells() => BAR.tissue_part_of_three_grids,
            _ => 0.0,
        };
        let before = part * self.convergence_table.change_of_column_before_best();
        self.unresolved = larger(self.unresolved, before);
        let first = segments
            .len()
            .saturating_sub(1 + self.convergence_table.best_column_number());
        self.weights = vec![0.0; first];
        self.weights
            .extend(weights(&segments[first..], f64::INFINITY));
        let in_held_stretches = unresolved_shear_layers(&self.levels, &self.weights);
        self.unresolved = larger(self.unresolved, in_held_stretches);
        self.estimate = None;
        if self.levels.len() < 2 {
            self.factorized_level = None;
        }
        self.history.coarsest = segments.first().copied();
        self
    }

    /// A copy of the leaf on its grids, without error estimates and their equations.
    pub fn without_estimates(&self) -> Self {
        NestedEquilibrium {
            levels: self.levels.clone(),
            convergence_table: self.convergence_table.clone(),
            weights: self.weights.clone(),
            estimate: None,
            factorized_level: None,
            bifurcation_error_factor: 1.0,
            path: self.path.clone(),
            ..*self
        }
    }

    /// A copy of the leaf on its coarsest `count` grids alone; `None` unless each of them halves the
    /// segments of the one before.
    pub fn on_coarsest_grids(&self, count: usize) -> Option<Self> {
        let levels = self.levels.get(..count)?;
        let halved = |pair: &[GridLevel]| pair[1].leaf.segments() == 2 * pair[0].leaf.segments();
        let nested = levels.windows(2).all(halved);
        nested.then(|| self.without_estimates().with_levels(levels.to_vec()))
    }

    /// The whole leaf, if the problem was one of its half.
    pub fn mirrored_to_whole(mut self, problem: &RelaxationProblem) -> Self {
        let Some(whole) = problem.whole_leaf else {
            return self;
        };
        let reduced = problem.leaf;
        let complete = |level: &GridLevel| mirror_level(reduced, whole, level);
        let levels = self.levels.iter().map(complete).collect();
        let estimate = self
            .estimate
            .take()
            .map(|half| mirror_estimate(half, reduced));
        // The equations are those of the reduced leaf.
        self.factorized_level = None;
        NestedEquilibrium {
            estimate,
            ..self.with_levels(levels)
        }
    }

    /// The leaf with an error bar that is larger by this factor, as it is beside a bifurcation.
    pub fn with_bifurcation_factor(self, bifurcation_error_factor: f64) -> Self {
        NestedEquilibrium {
            bifurcation_error_factor,
            ..self
        }
    }

    /// The leaf at the end of refinement, within the tolerance or not.
    pub fn with_tolerance_kept(self, keeps_tolerance: bool) -> Self {
        NestedEquilibrium {
            keeps_tolerance,
            ..self
        }
    }

    /// The leaf that came to rest on this path.
    pub fn with_path(self, path: Option<Path>) -> Self {
        NestedEquilibrium { path, ..self }
    }

    /// The leaf as a result: after this work, and without the equations of its estimate.
    pub fn with_work(self, work: SolverCounts) -> Self {
        NestedEquilibrium {
            work,
            factorized_level: None,
            ..self
        }
    }

    /// The failure of an iteration that stopped with this leaf.
    pub fn into_failure<T>(self, stop: EquilibriumFailure) -> Result<T, Box<RelaxationFailure>> {
        Err(Box::new(RelaxationFailure { at: self, stop }))
    }

    /// Whether no eigenvalue is negative.
    pub fn is_stable(&self) -> bool {
        self.index == Some(0)
    }

    /// The requested error of positions, in lengths of the leaf.
    pub fn requested_tolerance(&self) -> f64 {
        self.tolerance
    }

    /// The next finer grid, if the limits on its size allow it and rounding leaves something
    /// to gain.
    pub fn next_finer_grid(&self) -> Option<Grid> {
        let leaf = &self.levels.last()?.leaf;
        let grid = leaf.grid.refined();
        let (rods, segments) = (leaf.rods(), grid.segments());
        let allowed = !self.has_fixed_grid
            && segments <= GRIDS.finest
            && rods * segments <= MAX_NODES
            && memory::check_grid_memory(rods, segments).is_ok()
            && !self.beyond_rounding(segments);
        allowed.then_some(grid)
    }

    /// The leaf at the nodes of the finest of the first `wanted` grids at which it keeps the
    /// tolerance, as far as it does at the nodes of the coarsest.
    pub fn finer_nodes(&self, wanted: usize) -> FieldsAtNodes {
        let error = self.error().unwrap_or(0.0);
        let allowed = match error <= self.tolerance {
            true => self.tolerance - error,
            false => f64::INFINITY,
        };
        let columns = self.convergence_table.best_column_number();
        finer_nodes(&self.levels, columns, wanted, error, allowed)
    }

    /// The levels from which the next one is predicted: those of the extrapolation, but at
    /// least the finest two where there are two.
    pub fn levels_for_prediction(&self) -> Vec<&GridLevel> {
        let count = (self.convergence_table.best_column_number() + 1)
            .max(2)
            .min(self.levels.len());
        self.levels[self.levels.len() - count..].iter().collect()
    }

    /// The extrapolated value of a quantity given by `on` on each grid.
    pub fn extrapolated_value(&self, on: impl Fn(usize, &GridLevel) -> DVec3) -> DVec3 {
        let levels = self.levels.iter().zip(&self.weights).enumerate();
        let known = levels.filter(|(_, (_, weight))| **weight != 0.0);
        known
            .map(|(k, (level, weight))| *weight * on(k, level))
            .sum()
    }

    /// Interpolation stencils of each grid at the fraction `sigma`, of values and of their
    /// derivatives; extrapolation beyond the ends is linear.
    pub fn stencils(&self, sigma: f64) -> Vec<[Stencil; 2]> {
        let on = |level: &GridLevel| Stencil::value_and_derivative_stencils(&level.leaf, sigma);
        self.levels.iter().map(on).collect()
    }

    /// The potential energy: integrated along the leaf, with an error of second order in the
    /// defect, or extrapolated as far as it converges as that assumes.
    pub fn energy(&self) -> Extrapolated<f64> {
        if let Some(estimate) = &self.estimate {
            return Extrapolated {
                value: estimate.energy,
                error: Some(self.energy_error(estimate)),
            };
        }
        let finest = &self.levels[self.levels.len().saturating_sub(EXTRAPOLATED_GRIDS)..];
        let (table, columns) = (
            energies(finest),
            self.convergence_table.best_column_number(),
        );
        let Some(best) = table.few_values_error() else {
            return Extrapolated {
                value: table.column(columns)[0],
                error: None,
            };
        };
        let energy = table.column(columns.min(best.columns))[0];
        let further = (energy - table.column(best.columns)[0]).abs();
        Extrapolated {
            value: energy,
            error: Some(best.error + further),
        }
    }
}

/// The errors of the fields of a leaf that was integrated along its rods.
#[derive(Clone, Copy)]
pub struct FieldErrors<'e> {
    /// The leaf, with its estimated errors along the lab axes at equally many places of each rod.
    pub estimate: &'e DefectEstimate,
    /// By which factor they bound the errors.
    pub safety: f64,
}

/// A leaf that was integrated along its rods.
pub struct IntegratedLeaf<'e> {
    pub estimate: &'e DefectEstimate,
    /// Bound on the error of its positions, relative to the leaf's length.
    pub error: f64,
}

/// The estimate of a whole leaf from that of its half.
fn mirror_estimate(half: DefectEstimate, reduced: &Leaf) -> DefectEstimate {
    let both = if reduced.is_mirror_half() { 2.0 } else { 1.0 };
    DefectEstimate {
        rods: whole_leaf_fields(reduced, half.rods),
        energy: half.energy * both,
        energy_error: half.energy_error * both,
        errors: whole_leaf_changes(reduced, half.errors),
        ..half
    }
}

/// The potential energies on all grids.
fn energies(levels: &[GridLevel]) -> Richardson {
    let on = |level: &GridLevel| (level.leaf.segments(), vec![level.leaf.energy(&level.state)]);
    let largest = (levels.iter()).map(|level| level.leaf.energy(&level.state).abs());
    let noise = ENERGY_NOISE * largest.fold(1.0, larger);
    levels
        .iter()
        .map(on)
        .collect::<Richardson>()
        .with_noise(noise)
}

/// What the error bar of positions and energy is made from.
struct ErrorBar {
    /// Part of the last change of the column before the best one that the error of this one may be on two and on
    /// three grids of a leaf whose tissue has layers as thin as its gaps, or an outline that the first grid
    /// hardly resolves: of 70 random blades none of 268 bars is then too small.
    tissue_part_of_two_grids: f64,
    tissue_part_of_three_grids: f64,
    /// Amplification of errors on single grids by extrapolation: bound on the sum of the weights'
    /// absolute values.
    amplification: f64,
    /// Safety factor on the error estimated from the defect of the extrapolated leaf.
    safety: f64,
    /// Safety factor on the error of the energy: the linear equations of a coarse grid tell less of
    /// what is of second order.
    energy_safety: f64,
    /// The least part of the largest error between the nodes of the coarsest grid that is taken
    /// for the error at these nodes: where layers are thinner than its segments the linear
    /// equations of a coarse grid are wrong by so much.
    layer_fraction: f64,
    /// Upper bound of the error by the defect in units of that estimated from the last extrapolation:
    /// the response of a neutral mode to rounding is not an error.
    largest_ratio: f64,
    /// Rounding error per segment, in lengths of the leaf.
    rounding: f64,
    /// If the error estimated by extrapolation exceeds the tolerance by this factor, the defect is
    /// not computed: it would hardly be small enough.
    unreachable: f64,
    /// The part of the error that each correction by the defect leaves at best.
    correction_remainder: f64,
}

const BAR: ErrorBar = ErrorBar {
    tissue_part_of_two_grids: 1.0,
    tissue_part_of_three_grids: 0.3,
    amplification: 2.0,
    safety: 2.0,
    energy_safety: 3.0,
    layer_fraction: 0.1,
    largest_ratio: 10.0,
    rounding: 4e-15,
    unreachable: 3e3,
    correction_remainder: 1e-2,
};

/// Safety factor on what is missed of the shear in held stretches, whose moments are those on the same
/// grid.
const LAYER_SAFETY: f64 = 2.0;

/// The displacement, in lengths of the leaf, that grids with these weights in the extrapolated values miss of
/// what shear does in stretches whose places grips hold and whose directions are free.
///
/// Beyond the end of such a stretch acts a moment m. The section there turns by m l/A with the layer
/// l = sqrt(A/H), and within l the turn decays. On segments of length ds > l the turn alternates from
/// segment to segment, and decays over ds^2/(4 l): a stretch much longer than that ends as one of any
/// segments would, and with x = 2 s l/ds^2 one of length s turns by up to coth(x) times as much. That is no
/// series in ds^2, and where x is small on all grids these know nothing of the shear.
fn unresolved_shear_layers(levels: &[GridLevel], weights: &[f64]) -> f64 {
    let Some(finest) = levels.last() else {
        return 0.0;
    };
    let (leaf, resultants) = (&finest.leaf, NodalResultants::on_level(finest));
    let (n, grips) = (leaf.segments(), &leaf.leaf.scenario().grips);
    let is_directed = |grip: &&Grip| {
        grip.rigid_axes() == [true; 3] && !grip.holds_directions() && grip.at[0] < grip.at[1]
    };
    let mut missed = 0.0;
    for grip in grips.iter().filter(is_directed) {
        let [from, to] = grip.at.map(|sigma| leaf.grid.nearest_node(sigma));
        let length = leaf.leaf.length(grip.vein) * (grip.at[1] - grip.at[0]);
        // Of the moments at a node those before it are known.
        let ends = [(from, from), ((to + 1).min(n), to.saturating_sub(1))];
        for (node, segment) in ends.into_iter().filter(|(node, _)| *node > 0) {
            let [_, moment] = resultants.at(grip.vein, node);
            let section = leaf.section(grip.vein, segment);
            for (bending, shear) in [(2, 1), (1, 2)] {
                let stiffness = section.couple_stiffness[bending];
                let layer = (stiffness * section.compliance[shear]).sqrt();
                if layer == 0.0 {
                    continue;
                }
                let turn = |level: &GridLevel| {
                    let ds = section.ds * n as f64 / level.leaf.segments() as f64;
                    (2.0 * length * layer / ds.powi(2)).tanh().recip()
                };
                let turns = levels.iter().zip(weights);
                let extrapolated: f64 = turns.map(|(level, weight)| weight * turn(level)).sum();
                let part = (extrapolated - 1.0).abs();
                missed += LAYER_SAFETY * part * (moment[bending] / stiffness).abs() * layer;
            }
        }
    }
    missed
}

/// For leaves with more nodes than this no equations are kept while others are solved, which
/// saves memory at the cost of another factorization on a coarse grid.
const MANY_NODES: usize = 50_000;

/// Whether the equations of a leaf need much memory.
pub fn is_large(leaf: &DiscreteLeaf) -> bool {
    leaf.rods() * leaf.segments() > MANY_NODES
}

impl NestedEquilibrium {
    /// Segments of the grid whose linear equations tell the error; of the finest if none do.
    pub fn segments_of_estimate(&self) -> Option<usize> {
        let level = match (&self.estimate, &self.factorized_level) {
            (Some(_), Some(linear)) => self.levels.get(linear.grid()),
            _ => self.levels.last(),
        };
        level.map(|level| level.leaf.segments())
    }

    /// Error estimate relative to the leaf's length: grids, unfinished iterations and rounding.
    pub fn error(&self) -> Option<f64> {
        self.linearized_error_bound()
            .map(|error| self.bifurcation_error_factor * error)
    }

    /// The error estimate as the linear equations of a grid tell it.
    fn linearized_error_bound(&self) -> Option<f64> {
        let segments = [self.levels.first()?, self.levels.last()?].map(|it| it.leaf.segments());
        let best = self.convergence_table.best();
        let best = best.map(|best| larger(best.error, self.unresolved));
        let most = best.map_or(f64::INFINITY, |best| BAR.largest_ratio * best);
        let too_coarse = !self.has_fixed_grid && segments[0] < GRIDS.coarsest;
        let extrapolation = match &self.estimate {
            // The errors of unfinished iterations are corrected with the others.
            Some(estimate) if estimate.corrections > 0 => {
                return Some(
                    BAR.safety * estimate.position_errors.largest()
                        + BAR.rounding * segments[0] as f64,
                );
            }
            // If nodes are few the midpoints are stations, too.
            Some(estimate) if too_coarse || best.is_none() => {
                (BAR.safety * estimate.position_errors.largest()).min(most)
            }
            Some(estimate) => {
                let errors = estimate.position_errors;
                let at_nodes = (errors.at_nodes).max(BAR.layer_fraction * errors.between);
                (BAR.safety * at_nodes).min(most)
            }
            None => best?,
        };
        Some(extrapolation + self.iteration_rounding_error(segments[1]))
    }

    /// Error by unfinished iterations and rounding on a grid of `segments` segments.
    fn iteration_rounding_error(&self, segments: usize) -> f64 {
        BAR.amplification * self.history.iteration_error + BAR.rounding * segments as f64
    }

    /// Error of the energy of an integrated leaf: that of grids, and rounding of what is summed along
    /// the rods.
    pub(super) fn energy_error(&self, estimate: &DefectEstimate) -> f64 {
        let segments = estimate.grid.segments() * estimate.rods.len();
        let rounding = BAR.rounding * segments as f64 * larger(1.0, estimate.energy.abs());
        self.bifurcation_error_factor * BAR.energy_safety * estimate.energy_error + rounding
    }

    /// The estimated errors of the fields of the leaf integrated along its rods.
    pub fn field_errors(&self) -> Option<FieldErrors<'_>> {
        Some(FieldErrors {
            estimate: self.estimate.as_ref()?,
            safety: self.bifurcation_error_factor * BAR.safety,
        })
    }

    /// Whether the error is within the tolerance; always true on a fixed grid.
    pub fn is_accurate(&self) -> bool {
        self.has_fixed_grid || self.error().is_some_and(|error| error <= self.tolerance)
    }

    /// The leaf integrated to the nodes of the finest grid, or of a finer one if it was
    /// corrected; `None` where its error exceeds the tolerance and was not corrected.
    pub fn integrated_leaf(&self) -> Option<IntegratedLeaf<'_>> {
        let (estimate, segments) = (self.estimate.as_ref()?, self.levels.last()?.leaf.segments());
        let error = match estimate.corrections {
            0 => {
                BAR.safety * estimate.position_errors.largest()
                    + self.iteration_rounding_error(segments)
            }
            _ => self.error()?,
        };
        (error <= self.tolerance || estimate.corrections > 0)
            .then_some(IntegratedLeaf { estimate, error })
    }

    /// The leaf integrated along its rods, if its error was corrected.
    pub fn corrected_estimate(&self) -> Option<&DefectEstimate> {
        self.estimate
            .as_ref()
            .filter(|estimate| estimate.corrections > 0)
    }

    /// The leaf with the error of the values on its only grid, or of the extrapolated values,
    /// estimated from their defect, and corrected if that makes them accurate enough. The
    /// equations are set up in the memory of the `workspace`.
    pub fn with_error_estimate(
        mut self,
        problem: &RelaxationProblem,
        workspace: &mut EquationWorkspace,
        work: &mut SolverCounts,
    ) -> Self {
        let most = problem.corrections();
        let farthest =
            BAR.unreachable * BAR.correction_remainder.powi(-(most as i32)) * self.tolerance;
        // A leaf that can turn is the same one of its circle on every grid: the response to a defect
        // leaves where on the circle it is as it was, with the error of that.
        let turns = |level: &GridLevel| !level.leaf.zero_energy_fields(&level.state).is_empty();
        // The defect is that of dead loads.
        let columns = match self.convergence_table.best() {
            _ if problem.leaf.in_wind()
                || problem.leaf.loads.has_followers()
                || self.levels.last().is_some_and(turns) =>
            {
                None
            }
            Some(best) => (best.error <= farthest).then_some(best.columns),
            // What has left a saddle may be close to another on the next grid.
            None => {
                (problem.may_use_single_grid() && self.history.saddle_escapes == 0).then_some(0)
            }
        };
        let goal = CorrectionGoal {
            error: self.tolerance / BAR.safety - BAR.rounding * GRIDS.coarsest as f64,
            most_corrections: most,
        };
        let (levels, linear) = (&self.levels, &mut self.factorized_level);
        self.estimate = columns
            .and_then(|columns| defect::estimate(levels, columns, goal, linear, workspace, work));
        if (self.levels.last()).is_some_and(|level| is_large(&level.leaf)) {
            self.factorized_level = None;
        }
        self
    }

    /// Whether errors by unfinished iterations and rounding alone exceed the tolerance on a
    /// grid of `segments` segments and are already at least half of the present error:
    /// refinement does not help then.
    pub fn beyond_rounding(&self, segments: usize) -> bool {
        let floor = self.iteration_rounding_error(segments);
        floor > self.tolerance && self.error().is_some_and(|error| error <= 2.0 * floor)
    }
}
