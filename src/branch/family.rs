//! A family of leaves that differ in one parameter, or in two.
//!
//! Its leaves, these on a grid, and the sparsity patterns of their matrices are cached, as making them
//! costs more than solving the equations of a small leaf. What a leaf on a grid has in common with
//! another one of the family is made once for each grid. Forces on a state are differenced over
//! the parameter, and a state is displaced by increments, with the supports where the leaf at
//! the new value of the parameter has them.

use crate::branch::points::{scale_field, scaled_sum};
use crate::leaf::{
    DirectSolver, DiscreteLeaf, Grid, Leaf, NodalField, Scale, State, System, displacement_part,
};
use crate::run::Limit;
use crate::scenario::Scenario;
use glam::DVec3;
use std::collections::VecDeque;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// Up to this stiffness in stretch and shear, in units of A/L^2, the matrix is that of the leaf:
/// tangents and signs of eigenvalues are exact. The forces of stiffer, nearly rigid segments are
/// condensed out with a lower one, `RIGID_CONDENSING_STIFFNESS`: near singular points a larger one loses digits.
pub(super) const STIFFEST: f64 = 1e7;

const RIGID_CONDENSING_STIFFNESS: f64 = 1e5;

/// The value at a fraction of a range, or of that of its logarithm.
pub fn value_at_fraction([from, to]: [f64; 2], log: bool, fraction: f64) -> f64 {
    match log {
        true => from * (to / from).powf(fraction),
        false => from + (to - from) * fraction,
    }
}

/// Values of a parameter, as fractions of its range, that differ by less are the same but for
/// rounding: such as the end of the range and a value beyond it.
pub(super) const PARAMETER_ROUNDING: f64 = 1e-12;

/// Makes the scenario at values of the parameters.
type MakeScenario<'a, const N: usize> = &'a (dyn Fn([f64; N]) -> Result<Scenario, String> + Sync);

/// A leaf for all values of N parameters.
#[derive(Clone)]
pub struct LeafFamily<'a, const N: usize = 1> {
    make_scenario: MakeScenario<'a, N>,
    ranges: [ParameterRange; N],
    /// The first leaf, in whose units all are.
    first: Leaf,
    /// A leaf with coupled veins, if there is one at an end of a range.
    coupled: Leaf,
    /// Sparsity patterns of the matrices of the leaves.
    pub patterns: Arc<SparsityPatternCache>,
    /// Leaves that were needed last.
    leaves: Arc<Mutex<LruCache<[f64; N], Leaf, SHARED_LEAVES>>>,
    /// The leaf of `coupled` on the grids that were needed last.
    discretized: Arc<Mutex<VecDeque<Arc<DiscreteLeaf>>>>,
    /// When branches of these leaves are followed no further: every Newton iteration checks it.
    pub limit: Limit,
}

/// The range of a parameter, linear or logarithmic.
#[derive(Clone, Copy)]
pub struct ParameterRange {
    /// Values at the fractions 0 and 1.
    pub ends: [f64; 2],
    /// Whether fractions are those of the logarithm of the value.
    pub log: bool,
}

impl ParameterRange {
    /// The value at a fraction of the range.
    fn value(self, fraction: f64) -> f64 {
        // At an end, rounding must not lead beyond: there may be no leaf.
        match fraction {
            part if part.abs() < PARAMETER_ROUNDING => self.ends[0],
            part if (part - 1.0).abs() < PARAMETER_ROUNDING => self.ends[1],
            part => value_at_fraction(self.ends, self.log, part),
        }
    }

    /// The fraction of the range at a value of the parameter.
    pub fn fraction(self, value: f64) -> f64 {
        let [from, to] = self.ends;
        match self.log {
            true => (value / from).ln() / (to / from).ln(),
            false => (value - from) / (to - from),
        }
    }
}

/// A value of the parameter that no leaf can have, with the message of the scenario.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{0}")]
pub struct OutOfRange(pub String);

impl<'a> LeafFamily<'a> {
    /// The leaves given by `make`, for values of the parameter in this range, in the units of the
    /// first.
    pub fn new(make: MakeScenario<'a, 1>, ends: [f64; 2], log: bool) -> Result<Self, OutOfRange> {
        let scale = make([ends[0]]).map_err(OutOfRange)?.scale();
        LeafFamily::over_ranges(
            make,
            [ParameterRange { ends, log }],
            scale,
            ends.map(|end| [end]),
        )
    }

    /// The parameter at a fraction of its range.
    pub fn value(&self, fraction: f64) -> f64 {
        self.values([fraction])[0]
    }
}

impl<'a> LeafFamily<'a, 2> {
    /// The leaves given by `make`, for values of two parameters in these ranges, in the units of
    /// that at the start of the first and at `start` of the second.
    pub fn over_two_parameters(
        make: MakeScenario<'a, 2>,
        ranges: [ParameterRange; 2],
        start: f64,
    ) -> Result<Self, OutOfRange> {
        let [[from, to], [low, high]] = ranges.map(|range| range.ends);
        let scale = make([from, start]).map_err(OutOfRange)?.scale();
        let ends = [[from, start], [to, start], [from, low], [from, high]];
        LeafFamily::over_ranges(make, ranges, scale, ends)
    }

    /// Leaves of the same kind, in the same units, along a path with the parameter 0 to 1.
    pub fn along_path<'b>(&self, make: MakeScenario<'b, 1>) -> Result<LeafFamily<'b>, OutOfRange> {
        let (ends, log) = ([0.0, 1.0], false);
        let family = LeafFamily::over_ranges(
            make,
            [ParameterRange { ends, log }],
            self.scale(),
            [[0.0], [1.0]],
        )?;
        Ok(LeafFamily {
            patterns: self.patterns.clone(),
            limit: self.limit.clone(),
            ..family
        })
    }
}

impl<'a, const N: usize> LeafFamily<'a, N> {
    /// In these units, with leaves at these values of the parameters.
    fn over_ranges<const ENDS: usize>(
        make: MakeScenario<'a, N>,
        ranges: [ParameterRange; N],
        scale: Scale,
        ends: [[f64; N]; ENDS],
    ) -> Result<Self, OutOfRange> {
        let leaf = |values| {
            let scenario = make(values).map_err(OutOfRange)?;
            Ok(Leaf::with_scale(Arc::new(scenario), scale))
        };
        let ends: Vec<Leaf> = ends.into_iter().map(leaf).collect::<Result<_, _>>()?;
        let is_coupled =
            |leaf: &&Leaf| (1..leaf.rods()).any(|g| leaf.coupling(g - 1) != DVec3::ZERO);
        let coupled = ends.iter().find(is_coupled);
        Ok(LeafFamily {
            make_scenario: make,
            ranges,
            coupled: coupled.unwrap_or(&ends[1]).clone(),
            first: ends[0].clone(),
            patterns: Arc::default(),
            leaves: Arc::default(),
            discretized: Arc::default(),
            limit: Limit::default(),
        })
    }

    /// The family of the same leaves, whose branches are followed until this limit is reached.
    pub fn with_limit(self, limit: Limit) -> Self {
        LeafFamily { limit, ..self }
    }

    /// The units of all its leaves.
    pub fn scale(&self) -> Scale {
        self.first.scale
    }

    /// Tips of all rods in the scenario's units: the shared one alone, or each.
    pub fn tips(&self, tips: &[DVec3]) -> Vec<DVec3> {
        let count = if self.first.joined() { 1 } else { tips.len() };
        let tips = tips.iter().take(count);
        tips.map(|tip| *tip * self.scale().length).collect()
    }

    /// Centerlines of a state in the scenario's units, one per rod.
    pub fn curves(&self, state: &State) -> Vec<Vec<DVec3>> {
        let length = self.scale().length;
        let rods = state.x.chunks(state.segments() + 1);
        rods.map(|rod| rod.iter().map(|x| *x * length).collect())
            .collect()
    }

    /// The leaf at the start of the ranges.
    pub fn first_leaf(&self) -> &Leaf {
        &self.first
    }

    /// Values of the parameters at fractions of their ranges.
    pub fn values(&self, params: [f64; N]) -> [f64; N] {
        std::array::from_fn(|i| self.ranges[i].value(params[i]))
    }

    /// The scenario at fractions of the ranges.
    pub fn scenario(&self, params: [f64; N]) -> Result<Scenario, OutOfRange> {
        Ok(self.leaf(params)?.scenario().clone())
    }

    /// The leaf at fractions of the ranges.
    pub fn leaf(&self, params: [f64; N]) -> Result<Leaf, OutOfRange> {
        // Another thread need not wait while one makes a leaf.
        let known = locked(&self.leaves).get(params).cloned();
        if let Some(known) = known {
            return Ok(known);
        }
        let scenario = (self.make_scenario)(self.values(params)).map_err(OutOfRange)?;
        let leaf = Leaf::with_scale(Arc::new(scenario), self.scale());
        locked(&self.leaves).insert(params, leaf.clone());
        Ok(leaf)
    }

    /// A system of equations for all its leaves on a grid.
    pub fn system(&self, grid: &Grid) -> System {
        System::new(&self.common_leaf(grid))
    }

    /// A leaf of the family on a grid, from which others take what they have in common with it.
    fn common_leaf(&self, grid: &Grid) -> Arc<DiscreteLeaf> {
        let known = (locked(&self.discretized).iter())
            .find(|known| known.grid == *grid)
            .cloned();
        known.unwrap_or_else(|| {
            let made = DiscreteLeaf::new(&self.coupled, grid.clone());
            let made = Arc::new(with_condensing_limits(made, None));
            let mut all = locked(&self.discretized);
            all.truncate(CACHED_GRIDS - 1);
            all.push_front(made.clone());
            made
        })
    }
}

/// Number of cached leaves of a family: those of differences on all grids of the points that several threads
/// verify.
const SHARED_LEAVES: usize = 24;

/// Number of grids on which one leaf of a family is cached.
const CACHED_GRIDS: usize = 8;

/// The content of a cache. What a thread that panicked has left is complete.
fn locked<T>(cache: &Mutex<T>) -> MutexGuard<'_, T> {
    cache.lock().unwrap_or_else(PoisonError::into_inner)
}

/// A leaf with the stiffnesses with which the forces of its segments are condensed out on branches; if requested
/// softened: see [`Leaves::with_regularization`].
fn with_condensing_limits(mut discrete: DiscreteLeaf, softening: Option<f64>) -> DiscreteLeaf {
    let leaf = &discrete.leaf;
    // A/L^2 of this leaf, in the units of the family.
    let own = leaf.scenario().scale().force() / leaf.scale.force();
    for section in &mut discrete.sections {
        section.condensing = match softening {
            Some(softening) => (section.compliance + DVec3::splat(softening)).recip(),
            None => {
                let exact = (section.compliance).cmpge(DVec3::splat(1.0 / (STIFFEST * own)));
                let least = section
                    .condensing
                    .min(DVec3::splat(RIGID_CONDENSING_STIFFNESS * own));
                DVec3::select(exact, section.condensing, least)
            }
        };
    }
    discrete
}

/// A leaf of a family on a grid, with what it has in common with the `last` one and with another one of the
/// family there.
fn discretize_leaf<const N: usize>(
    family: &LeafFamily<N>,
    last: Option<&DiscreteLeaf>,
    leaf: &Leaf,
    grid: &Grid,
    softening: Option<f64>,
) -> DiscreteLeaf {
    if let Some(copied) = last.and_then(|last| last.with_same_rods(leaf)) {
        return copied;
    }
    let common = family.common_leaf(grid);
    // Its segments are not softened.
    let copied = match softening {
        None => common.with_same_rods(leaf),
        Some(_) => None,
    };
    copied.unwrap_or_else(|| with_condensing_limits(common.with_same_rest_shapes(leaf), softening))
}

/// Leaves of a family on one grid. The last few are cached: iterations
/// return to them, and making a scenario costs more than assembling a small leaf.
pub struct Leaves<'a, const N: usize = 1> {
    pub family: &'a LeafFamily<'a, N>,
    pub grid: Grid,
    regularization: Option<f64>,
    cache: LruCache<[f64; N], DiscreteLeaf, CACHED_LEAVES>,
}

/// Number of cached leaves: those of differences over two parameters, and one more.
const CACHED_LEAVES: usize = 6;

impl<'a, const N: usize> Leaves<'a, N> {
    pub fn new(family: &'a LeafFamily<'a, N>, grid: Grid) -> Self {
        Leaves {
            family,
            grid,
            regularization: None,
            cache: LruCache::default(),
        }
    }

    /// Leaves with the equilibria of the family, but with matrices of leaves with this additional
    /// compliance in stretch and shear (in units of L^2/A). The soft modes of a nearly rigid leaf are lost to rounding in its matrix;
    /// the point at which they become neutral is analytic in the softening, and can be
    /// extrapolated to zero softening.
    pub fn with_regularization(family: &'a LeafFamily<'a, N>, grid: Grid, softening: f64) -> Self {
        Leaves {
            regularization: Some(softening),
            ..Leaves::new(family, grid)
        }
    }

    /// These leaves on the grid with all segments halved.
    pub fn refined(&self) -> Self {
        let (grid, softening) = (self.grid.refined(), self.regularization);
        let finer = |before: Option<&DiscreteLeaf>, coarse: &DiscreteLeaf| {
            discretize_leaf(self.family, before, &coarse.leaf, &grid, softening)
        };
        Leaves {
            cache: self.cache.map(finer),
            family: self.family,
            grid,
            regularization: softening,
        }
    }

    /// The leaf at these parameters, as fractions of their ranges.
    pub fn leaf_at(&mut self, params: [f64; N]) -> Result<&DiscreteLeaf, OutOfRange> {
        let (family, grid, softening) = (self.family, &self.grid, self.regularization);
        self.cache.get_or_make(params, |last| {
            let leaf = family.leaf(params)?;
            Ok(discretize_leaf(family, last, &leaf, grid, softening))
        })
    }
}

/// Puts the bases of all rods where the leaf holds them, and held tips where it holds them.
pub(super) fn place_supports(leaf: &DiscreteLeaf, state: &mut State) {
    leaf.place_held_nodes(state);
    leaf.leaf.place_held_bases(state);
}

/// At most `MOST` values by key, the most recently used first.
struct LruCache<K, V, const MOST: usize>(VecDeque<(K, V)>);

impl<K, V, const MOST: usize> Default for LruCache<K, V, MOST> {
    fn default() -> Self {
        LruCache(VecDeque::new())
    }
}

impl<K: Copy + PartialEq, V, const MOST: usize> LruCache<K, V, MOST> {
    /// The value of a key, computed by `make` if it is not cached; this takes the value that was
    /// used last.
    pub fn get_or_make<E>(
        &mut self,
        key: K,
        make: impl FnOnce(Option<&V>) -> Result<V, E>,
    ) -> Result<&V, E> {
        if self.get(key).is_none() {
            let made = make(self.0.front().map(|(_, value)| value))?;
            self.insert(key, made);
        }
        Ok(&self.0[0].1)
    }

    /// The value of a key, if it is cached.
    fn get(&mut self, key: K) -> Option<&V> {
        let known = self.0.iter().position(|(other, _)| *other == key)?;
        let found = self.0.remove(known)?;
        self.0.push_front(found);
        self.0.front().map(|(_, value)| value)
    }

    /// Caches the value of a key that is not cached.
    fn insert(&mut self, key: K, value: V) {
        self.0.truncate(MOST - 1);
        self.0.push_front((key, value));
    }

    /// Values derived from these, under the same keys; `other` takes the one made before, too.
    pub fn map(&self, other: impl Fn(Option<&V>, &V) -> V) -> Self {
        let mut mapped = VecDeque::with_capacity(self.0.len());
        for (key, value) in &self.0 {
            let made = other(mapped.back().map(|(_, before)| before), value);
            mapped.push_back((*key, made));
        }
        LruCache(mapped)
    }
}

/// Number of cached patterns: five grids, bordered and unbordered.
const CACHED_SYSTEMS: usize = 10;

/// Cache of sparsity patterns. All leaves of a family have the same pattern on grids with
/// equally many segments, and ordering it takes as long as factorizing a matrix.
#[derive(Default)]
pub struct SparsityPatternCache(Mutex<LruCache<PatternKey, Arc<DirectSolver>, CACHED_SYSTEMS>>);

/// What determines the pattern of a system.
#[derive(Clone, Copy, PartialEq)]
struct PatternKey {
    segments: usize,
    /// Whether the rods are coupled.
    coupled: bool,
    border_rows: usize,
}

impl SparsityPatternCache {
    /// The pattern of a system with `border` border rows; `None` if memory is short.
    pub fn pattern_of_system(&self, system: &System, border: usize) -> Option<Arc<DirectSolver>> {
        let shape = PatternKey {
            segments: system.segments(),
            coupled: system.coupled(),
            border_rows: border,
        };
        let mut cache = locked(&self.0);
        let made = |_: Option<&_>| DirectSolver::with_border(system, border).map(Arc::new);
        cache.get_or_make(shape, made).ok().cloned()
    }
}

/// Step of central differences of forces, as a part of the parameter's range: truncation
/// error and rounding error are both about 1e-10.
const DIFFERENCE: f64 = 1e-5;

/// A value after and before the present one of a parameter, for a central difference; `value`
/// takes the distance from it. At an end of the range, where there may be no leaf beyond, the
/// present one takes the place of that.
pub(super) fn values_on_both_sides<T, E>(
    mut value: impl FnMut(f64) -> Result<T, E>,
) -> Result<[T; 2], E> {
    let sides = [DIFFERENCE, -DIFFERENCE];
    let [after, before] = sides.map(|step| value(step).or_else(|_| value(0.0)));
    Ok([after?, before?])
}

/// Derivative of the forces with respect to a parameter, by central differences; `forces` takes
/// the distance from the present value of the parameter.
pub(super) fn force_parameter_derivative<E>(
    mut forces: impl FnMut(f64) -> Result<NodalField, E>,
) -> Result<NodalField, E> {
    let at = |step: f64| Ok((step, forces(step)?));
    let [(after, forces_after), (before, forces_before)] = values_on_both_sides(at)?;
    let rate = scaled_sum(&forces_after, -1.0, &forces_before);
    Ok(scale_field(&rate, 1.0 / (after - before)))
}

/// The largest stiffness in stretch and shear with which segment forces are condensed out.
pub(super) fn stiffest_condensed(leaf: &DiscreteLeaf) -> f64 {
    let stiffnesses = leaf.sections.iter().map(|it| it.condensing.max_element());
    stiffnesses.fold(0.0, f64::max)
}

/// Rounding error of an eigenvalue of the matrix of a leaf of this largest stiffness.
pub(super) fn eigenvalue_rounding(stiffest: f64, segments: usize) -> f64 {
    f64::EPSILON * stiffest * (segments as f64).powi(2)
}

/// The unbalanced forces on a leaf in a state whose clamped nodes are put where it clamps them.
pub(super) fn unbalanced_forces(
    leaf: &DiscreteLeaf,
    state: &State,
    system: &mut System,
) -> NodalField {
    let mut moved = state.clone();
    place_supports(leaf, &mut moved);
    leaf.assemble_forces(&moved, system);
    system.rhs()
}

/// Increments of the nodes with the forces of the segments that complete the law of nearly rigid
/// ones (none if empty).
pub(super) struct CompletedIncrements<'s> {
    pub increments: &'s NodalField,
    pub law_forces: &'s [DVec3],
}

/// A state after `step` times these increments. Clamped nodes are moved first: the forces of the
/// segments at a clamp depend on all of its displacement, however short the step. So do those of all
/// segments on the change of their law, where that differs between the leaf of the state and this one.
pub(super) fn state_after_step(
    leaf: &DiscreteLeaf,
    state: &State,
    system: &mut System,
    CompletedIncrements {
        increments,
        law_forces,
    }: CompletedIncrements,
    step: f64,
) -> State {
    let mut clamped = state.clone();
    place_supports(leaf, &mut clamped);
    let mut next = clamped.clone();
    if clamped.x == state.x && clamped.q == state.q && !leaf.law_differs(state) {
        // The rounding error in the lengths of nearly rigid segments is scaled down
        // with the step.
        system.set_completed(increments, law_forces);
        leaf.advance(state, system, step, &mut next);
        return next;
    }
    let mut increments = scale_field(increments, step);
    let law_forces: Vec<DVec3> = law_forces.iter().map(|force| step * *force).collect();
    for (j, i) in leaf.rod_index_pairs(leaf.moving_nodes()) {
        let free = leaf.node_freedom(j, i);
        let increment = &mut increments[j][i - leaf.first_node()];
        let displacement = free.of_displacement(displacement_part(increment));
        increment[3..].copy_from_slice(&displacement.to_array());
        if !free.rotation {
            increment[..3].fill(0.0);
        }
    }
    system.set_completed(&increments, &law_forces);
    leaf.advance(&clamped, system, 1.0, &mut next);
    next
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_was_needed_last_is_not_made_again() {
        let mut lru_cache = LruCache::<i32, i32, 2>::default();
        let mut made = Vec::new();
        for key in [1, 2, 1, 3, 1, 2] {
            let value = lru_cache.get_or_make(key, |_| {
                made.push(key);
                Ok::<_, ()>(10 * key)
            });
            assert_eq!(value, Ok(&(10 * key)));
        }
        assert_eq!(made, [1, 2, 3, 2]);
        assert_eq!(lru_cache.get_or_make(4, |_| Err("none")), Err("none"));
    }
}
