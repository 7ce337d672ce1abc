//! The lowest pass from a stable leaf to another equilibrium.

use crate::branch::{
    BranchEquations, EquilibriumPoint, LeafFamily, increments_between, on_finer, prolong_field,
    scale_field,
};
use crate::leaf::{Grid, NodalField, State};
use crate::relax::accuracy::richardson::Richardson;
use crate::relax::accuracy::transfer::prolong;
use crate::relax::solve_on_grid::relax_from_state;
use crate::relax::{AxisDirection, Barrier, Equilibrium, Neighbour, Progress, Saddle};
use crate::run::Limit;
use crate::scenario::Scenario;
use rayon::prelude::*;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Number of modes along which saddles are sought, in both directions.
const SOFTEST_MODE_COUNT: usize = 3;

pub(super) const MODE_SADDLE_SEARCHES: usize = 2 * SOFTEST_MODE_COUNT;

/// The search for the lowest pass.
struct BarrierSearch {
    /// Largest number of grids for the extrapolated energy of a pass.
    most_grids: usize,
    /// Largest number of nodes of the finest of these grids.
    most_nodes: usize,
    /// The relative error at which this energy is accurate enough.
    accuracy: f64,
    /// Within this distance, in lengths, the leaf has returned to its equilibrium.
    return_distance: f64,
    /// Within this part of the distance to the pass it has returned, too.
    return_part: f64,
    /// How often the grid of the search is refined: near a fold a coarse one may have no pass, or
    /// another one.
    most_refinements: usize,
    /// Largest number of nodes of the grid of the search.
    most_search_nodes: usize,
    /// Passes whose heights differ by less than this, relatively, are examined once.
    same_height: f64,
    /// Rounding error of the difference of two energies, relative to these: for a column 0.5 %
    /// beyond its Euler load it was 3.1e-13.
    rounding: f64,
}

const BARRIER: BarrierSearch = BarrierSearch {
    most_grids: 7,
    most_nodes: 20_000,
    accuracy: 1e-7,
    return_distance: 1e-3,
    return_part: 0.1,
    most_refinements: 3,
    most_search_nodes: 800,
    same_height: 1e-6,
    rounding: 5e-13,
};

/// A saddle on the grid on which it was found, with the stable leaf there.
struct MountainPass {
    grid: Grid,
    saddle: EquilibriumPoint,
    leaf: EquilibriumPoint,
    /// Energy of the saddle above the leaf's, dimensionless.
    height: f64,
}

/// The lowest pass, if there is one, and from how many points it was sought.
pub(super) struct LowestBarrier {
    pub barrier: Option<Barrier>,
    pub searches: usize,
}

/// The lowest pass found from these start points and along the softest modes.
pub(super) fn lowest_energy_barrier(
    stable: &StableLeaf,
    mut starts: Vec<SaddleSearchStart>,
    weight: f64,
) -> LowestBarrier {
    starts.extend(starts_along_modes(stable).unwrap_or_default());
    let all = &stable.searches.total_count;
    let counted = all.load(std::sync::atomic::Ordering::Relaxed);
    let pushes = counted.saturating_sub(MODE_SADDLE_SEARCHES);
    all.store(pushes + starts.len(), std::sync::atomic::Ordering::Relaxed);
    let searches = starts.len();
    for refinement in 0..=BARRIER.most_refinements {
        let found = search_passes(stable, &starts, refinement > 0);
        let barrier = lowest_barrier_of_passes(stable, found.passes, weight);
        if barrier.is_some() || refinement == BARRIER.most_refinements || stable.limit.reached() {
            return LowestBarrier { barrier, searches };
        }
        // What left its valley on this grid does so on finer ones.
        let finer: Option<Vec<SaddleSearchStart>> = (starts.iter().zip(&found.left_valley))
            .filter(|(_, left)| !**left)
            .map(|(start, _)| start_on_halved_grid(stable, start))
            .collect();
        match finer {
            Some(finer) if !finer.is_empty() => starts = finer,
            _ => break,
        }
        all.fetch_add(starts.len(), std::sync::atomic::Ordering::Relaxed);
    }
    LowestBarrier {
        barrier: None,
        searches,
    }
}

/// What searches from several start points found.
struct PassSearches {
    passes: Vec<MountainPass>,
    /// Of every start point, whether the search left its valley.
    left_valley: Vec<bool>,
}

/// The passes found from these start points on their grids.
fn search_passes(
    stable: &StableLeaf,
    starts: &[SaddleSearchStart],
    stays_in_valley: bool,
) -> PassSearches {
    let searched: Vec<PassSearch> = (starts.par_iter())
        .map(|start| {
            let search = search_pass(stable, start, stays_in_valley);
            stable.searches.finish_one();
            search
        })
        .collect();
    PassSearches {
        left_valley: searched.iter().map(|search| search.left_valley).collect(),
        passes: (searched.into_iter())
            .filter_map(|search| search.pass)
            .collect(),
    }
}

/// The barrier of the lowest of these passes that leads from the leaf to another equilibrium.
fn lowest_barrier_of_passes(
    stable: &StableLeaf,
    mut passes: Vec<MountainPass>,
    weight: f64,
) -> Option<Barrier> {
    passes.sort_by(|a, b| a.height.total_cmp(&b.height));
    passes.dedup_by(|a, b| (a.height - b.height).abs() < BARRIER.same_height * b.height);
    let (pass, neighbour) = passes.iter().find_map(|pass| {
        let neighbour = equilibrium_beyond_pass(stable, pass)?;
        Some((pass, neighbour))
    })?;
    barrier_in_scenario_units(stable, pass, &neighbour, weight)
}

/// The same start point on the grid with all segments halved; none if it has too many nodes.
fn start_on_halved_grid(
    stable: &StableLeaf,
    start: &SaddleSearchStart,
) -> Option<SaddleSearchStart> {
    let mut equations = BranchEquations::new(stable.family, start.grid.clone());
    let leaf = equations.leaves.leaf_at([0.0]).ok()?;
    (2 * leaf.rods() * leaf.segments() <= BARRIER.most_search_nodes).then(|| SaddleSearchStart {
        grid: start.grid.refined(),
        state: prolong(leaf, &start.state),
        direction: prolong_field(&start.direction, leaf.first_node()),
    })
}

/// Start points at the leaf in both directions along its softest modes.
fn starts_along_modes(stable: &StableLeaf) -> Option<Vec<SaddleSearchStart>> {
    let mut equations = BranchEquations::new(stable.family, stable.grid.clone());
    let point = equations.correct(&stable.state, 0.0, None).ok()?;
    let modes = equations.soft_modes(&point, SOFTEST_MODE_COUNT).ok()?;
    let start = |mode: &NodalField, sign: f64| SaddleSearchStart {
        grid: stable.grid.clone(),
        state: point.state.clone(),
        direction: scale_field(mode, sign),
    };
    let both = |mode: &NodalField| [1.0, -1.0].map(|sign| start(mode, sign));
    Some(modes.iter().flat_map(both).collect())
}

/// What a search from one start point found.
struct PassSearch {
    pass: Option<MountainPass>,
    left_valley: bool,
}

/// Climbs to a saddle, and finds the stable leaf on the same grid.
fn search_pass(
    stable: &StableLeaf,
    start: &SaddleSearchStart,
    stays_in_valley: bool,
) -> PassSearch {
    let mut equations = BranchEquations::new(stable.family, start.grid.clone());
    let stop = || stable.limit.reached();
    let (state, direction) = (&start.state, &start.direction);
    let search = equations.search_saddle(state, 0.0, direction, stays_in_valley, &stop);
    PassSearch {
        left_valley: search.left_valley,
        pass: (search.saddle)
            .and_then(|saddle| pass_over_saddle(stable, start, &mut equations, saddle)),
    }
}

/// The pass over a saddle that was reached from a start point.
fn pass_over_saddle(
    stable: &StableLeaf,
    start: &SaddleSearchStart,
    equations: &mut BranchEquations,
    saddle: EquilibriumPoint,
) -> Option<MountainPass> {
    let mut own = BranchEquations::new(stable.family, stable.grid.clone());
    let mut leaf = own.correct(&stable.state, 0.0, None).ok()?;
    while own.grid().segments() < start.grid.segments() {
        (own, leaf) = on_finer(&mut own, &leaf).ok()?;
    }
    let discrete = equations.leaves.leaf_at([0.0]).ok()?;
    let height = discrete.energy(&saddle.state) - discrete.energy(&leaf.state);
    (height > 0.0).then(|| MountainPass {
        grid: start.grid.clone(),
        saddle,
        leaf,
        height,
    })
}

/// The equilibrium beyond a pass, if the one on this side is the leaf.
fn equilibrium_beyond_pass(stable: &StableLeaf, pass: &MountainPass) -> Option<State> {
    let distance = pass.saddle.state.largest_displacement_to(&pass.leaf.state);
    let same = |state: &State| {
        state.largest_displacement_to(&pass.leaf.state)
            < BARRIER.return_distance.min(BARRIER.return_part * distance)
    };
    let mut equations = BranchEquations::new(stable.family, pass.grid.clone());
    let towards = increments_between(&pass.saddle.state, &pass.leaf.state, equations.first_node());
    let stop = || stable.limit.reached();
    let both = equations
        .descend_both_sides(&pass.saddle, &towards, &stop)
        .ok()?;
    let rest = |fallen: Result<EquilibriumPoint, State>| match fallen {
        Ok(point) => Some(point.state),
        // Not reached by the descent: relax from its last state.
        Err(state) => relax_from_state(stable.family.first_leaf(), &pass.grid, state, stable.limit),
    };
    let both = both.map(rest);
    match both {
        [Some(one), Some(other)] if same(&one) && !same(&other) => Some(other),
        [Some(one), Some(other)] if same(&other) && !same(&one) => Some(one),
        _ => None,
    }
}

/// A pass in the scenario's units, its energy extrapolated over grids.
fn barrier_in_scenario_units(
    stable: &StableLeaf,
    pass: &MountainPass,
    neighbour: &State,
    weight: f64,
) -> Option<Barrier> {
    let mut equations = BranchEquations::new(stable.family, pass.grid.clone());
    let neighbour = equations.correct(neighbour, 0.0, None).ok()?;
    let mut three = [pass.saddle.clone(), neighbour, pass.leaf.clone()];
    let rounding = BARRIER.rounding
        * equations
            .leaves
            .leaf_at([0.0])
            .ok()?
            .energy(&three[0].state)
            .abs();
    let mut table = Richardson::default();
    table.push(
        pass.grid.segments(),
        energies_above_leaf(&mut equations, &three, pass.height)?,
    );
    for _ in 1..BARRIER.most_grids {
        let (rods, segments) = (three[0].state.rods(), 2 * equations.grid().segments());
        let known = table
            .best()
            .is_some_and(|best| best.error < BARRIER.accuracy);
        if known || rods * segments > BARRIER.most_nodes || stable.limit.reached() {
            break;
        }
        let finer: Result<Vec<_>, _> = (three.iter())
            .map(|point| on_finer(&mut equations, point))
            .collect();
        let [(finer, saddle), (_, neighbour), (_, leaf)] = <[_; 3]>::try_from(finer.ok()?).ok()?;
        (equations, three) = (finer, [saddle, neighbour, leaf]);
        // Otherwise a finer grid has no such pass.
        if three.each_ref().map(|point| point.index) != [1, 0, 0] {
            return None;
        }
        table.push(
            segments,
            energies_above_leaf(&mut equations, &three, pass.height)?,
        );
    }
    let [saddle, neighbour, _] = three;
    let scale = stable.family.scale();
    let (best, values) = (table.best(), table.extrapolated());
    let [energy, above] = [values[0], values[3]].map(|it| it * pass.height * scale.moment());
    let own = stable.rest.energy?;
    Some(Barrier {
        energy,
        error: best.map(|best| (best.error * pass.height + rounding) * scale.moment()),
        height: (weight > 0.0).then(|| energy / weight),
        relative: (weight > 0.0).then(|| energy / (weight * scale.length)),
        saddle: Saddle {
            energy: own + energy,
            negative_eigenvalues: saddle.index,
            tip: saddle.state.tip(0) * scale.length,
        },
        neighbour: Neighbour {
            energy: own + above,
            tip: neighbour.state.tip(0) * scale.length,
        },
    })
}

/// Energies of a saddle and of the equilibrium beyond it above that of the leaf, divided by
/// `unit`, so that tolerances are relative.
fn energies_above_leaf(
    equations: &mut BranchEquations,
    three: &[EquilibriumPoint; 3],
    unit: f64,
) -> Option<Vec<f64>> {
    let leaf = equations.leaves.leaf_at([0.0]).ok()?;
    let [saddle, neighbour, own] = [0, 1, 2].map(|k| leaf.energy(&three[k].state));
    Some(vec![
        (saddle - own) / unit,
        0.0,
        0.0,
        (neighbour - own) / unit,
        0.0,
        0.0,
    ])
}

/// A stable leaf on the grid on which it is pushed, with the options.
pub(super) struct StableLeaf<'a> {
    pub(super) scenario: &'a Scenario,
    /// The scenario's leaf alone, at any value of the parameter.
    pub(super) family: &'a LeafFamily<'a>,
    pub(super) rest: &'a Equilibrium,
    pub(super) grid: Grid,
    pub(super) state: State,
    pub(super) accuracy: f64,
    pub(super) largest_force: f64,
    pub(super) limit: &'a Limit,
    pub(super) searches: SearchProgress<'a>,
}

/// Counts searches and reports their progress.
pub(super) struct SearchProgress<'a> {
    pub(super) finished_count: AtomicUsize,
    pub(super) total_count: AtomicUsize,
    pub(super) progress: Mutex<&'a mut (dyn FnMut(&MarginProgress) + Send)>,
}

impl SearchProgress<'_> {
    pub(super) fn report(&self, push: Option<(AxisDirection, f64)>) {
        // If another thread is reporting, this report is skipped.
        if let Ok(mut progress) = self.progress.try_lock() {
            progress(&MarginProgress::Searching {
                done: self.finished_count.load(Ordering::Relaxed),
                all: self.total_count.load(Ordering::Relaxed),
                push,
            });
        }
    }

    pub(super) fn finish_one(&self) {
        self.finished_count.fetch_add(1, Ordering::Relaxed);
        self.report(None);
    }
}

/// A start point for a saddle search, on its grid, with a direction.
pub(super) struct SaddleSearchStart {
    pub(super) grid: Grid,
    pub(super) state: State,
    pub(super) direction: NodalField,
}

/// Progress of the computation of a margin.
#[derive(Clone, Copy, Debug)]
pub enum MarginProgress {
    /// The leaf comes to rest.
    Relaxing(Progress),
    /// Number of searches done and in all; and the direction and force of one that is running.
    Searching {
        /// Searches done.
        done: usize,
        /// Number of all searches.
        all: usize,
        /// Direction and force of a running one.
        push: Option<(AxisDirection, f64)>,
    },
}
