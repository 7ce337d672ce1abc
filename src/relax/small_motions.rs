//! Stability without a potential: the growth rates and frequencies of the linearised motion of a leaf at rest
//! ([`crate::modes`]), on its grids and extrapolated.

use crate::leaf::{DiscreteLeaf, State};
use crate::modes::linearized::{
    MOST_DENSE_STATES, MotionRoot, MotionRoots, ROOT_ACCURACY, Square, all_roots, lowest_roots,
    states_per_node,
};
use crate::modes::motion_pairs::{MotionPair, lowest_pairs, lowest_shapes};
use crate::motion::{AssumedMotion, Physics};
use crate::newton::FollowerForces;
use crate::relax::accuracy::NestedEquilibrium;
use crate::relax::accuracy::richardson::{EXTRAPOLATED_GRIDS, Richardson};
use crate::relax::accuracy::transfer::GridLevel;
use crate::relax::motion_shapes::{MotionShape, shapes_of_roots};
use crate::relax::plan::{RelaxationProblem, UNKNOWNS};
use crate::relax::solve_on_grid::follower_loads::{
    WithoutPotential, balance_on_coarse_grid, balance_on_next_grid,
};
use crate::run::Limit;
use crate::words;
use faer::c64;
use serde::{Serialize, Serializer};
use std::borrow::Cow;
use std::cell::Cell;

words! {
    /// How a leaf leaves an unstable equilibrium.
    pub enum MotionInstability {
        /// In oscillations that grow.
        Flutter = "flutter",
        /// Without oscillations.
        Divergence = "divergence",
    }
}

/// Roots that are computed even if fewer are requested: mostly one of the lowest modes is the first that grows.
pub const LEAST_ROOTS: usize = 8;

/// How growing motions are looked for among all of a coarse grid.
struct GrowthSurvey {
    /// Segments of the coarsest and of the finest grid on which all roots are computed.
    segments: [usize; 2],
    /// Segments of the next grid, as a part of those of one on which the leaf is not balanced, or whose dense matrix is
    /// too large or singular.
    coarser: f64,
    /// Growth, as a part of the size of a root, that counts.
    growth: f64,
    /// Growth besides that rounding makes of two equal frequencies: of a root as small as the smallest, of others times
    /// the square of their ratio.
    rounding: f64,
    /// Roots beyond the last one that grows, which may have another place on finer grids.
    further: usize,
    /// Largest number of roots that are then computed on all grids.
    most_roots: usize,
}

const SURVEY: GrowthSurvey = GrowthSurvey {
    segments: [4, 16],
    coarser: 0.75,
    growth: 1e-3,
    rounding: 1e-9,
    further: 4,
    most_roots: 60,
};

/// Growth rates and frequencies of the small motions about an equilibrium, in the scenario's unit of time.
#[derive(Clone, Debug, PartialEq)]
pub struct SmallMotions {
    /// Rates of growth, negative where a motion decays: of the lowest modes, and of all further ones that
    /// were found to grow; the slowest motions first.
    pub growth_rates: Vec<f64>,
    /// Their angular frequencies, radians per time; zero of what does not oscillate.
    pub frequencies: Vec<f64>,
    /// Bounds on the errors of either, if there are grids to compare.
    pub errors: Option<Vec<f64>>,
    /// Whether no motion grows; `None` where grids tell otherwise, or growth is within its error.
    pub stable: Option<bool>,
    /// How the motion that grows fastest does, if one does.
    pub instability: Option<MotionInstability>,
    /// Roots with growth, both of a conjugate pair; `None` where it is not certain of all that were
    /// computed.
    pub unstable_roots: Option<usize>,
    /// The motion that grows fastest or, if none grows, decays slowest.
    pub dominant: Option<DominantMotion>,
    /// Whether growing motions were looked for among all of a coarse grid. Otherwise only the slowest are known; of a
    /// leaf too large for such a grid `stable` is `None` if none of these grows.
    pub complete: bool,
    /// So many of the roots next to zero were computed on each grid, among which is the first that grows on a coarse
    /// one.
    pub searched_roots: usize,
    /// What is assumed of masses and damping.
    pub assumed: AssumedMotion,
    /// The shapes of the motions of `growth_rates`, on the finest grid, if they were requested and found.
    pub shapes: Option<Vec<MotionShape>>,
}

/// Growth and frequency of a small motion, in the scenario's unit of time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DominantMotion {
    /// Rate of growth, negative where it decays.
    pub growth_rate: f64,
    /// Angular frequency, radians per time; zero if it does not oscillate.
    pub frequency: f64,
    /// A bound on the error of either, if there are grids to compare.
    pub error: Option<f64>,
}

/// Segments of the finest grid from which on, and number of grids with which, roots may be accurate enough.
const LEAST_SEGMENTS: usize = 32;
const LEAST_GRIDS: usize = 3;

/// Largest error of a root, as a part of it.
const LARGEST_ERROR: f64 = 1e-4;

/// Factor on the error of a root by the extrapolation of a single number: of roots of random leaves on several grids the
/// largest error was 10 times that of the extrapolation on two grids, and 2.8 times on four.
const ROOT_SAFETY: f64 = 5.0;

/// The bound on the error of a root that is told.
fn told_error(it: &ExtrapolatedRoot) -> Option<f64> {
    Some(ROOT_SAFETY * it.error? + ROOT_ACCURACY * it.root.size() + it.softening)
}

/// Unknowns of a leaf on a grid.
pub fn unknowns(leaf: &DiscreteLeaf) -> usize {
    6 * leaf.rods() * leaf.segments()
}

/// Roots on nested grids.
#[derive(Default)]
struct RootSeries {
    squares: Vec<(usize, Vec<Square>)>,
    damped: Vec<(usize, Vec<MotionRoot>)>,
}

impl RootSeries {
    fn is_empty(&self) -> bool {
        self.squares.is_empty() && self.damped.is_empty()
    }

    /// Adds the roots on the next grid; the finest few are kept.
    fn push(&mut self, segments: usize, roots: MotionRoots) {
        match roots {
            MotionRoots::Squares(roots) => self.squares.push((segments, roots)),
            MotionRoots::Damped(roots) => self.damped.push((segments, roots)),
        }
        let excess = |count: usize| count.saturating_sub(EXTRAPOLATED_GRIDS);
        self.squares.drain(..excess(self.squares.len()));
        self.damped.drain(..excess(self.damped.len()));
    }

    /// So many motions on the finest grid have those of the series among them: of squares there are two for each that is
    /// asked for.
    fn shapes_to_compute(&self) -> usize {
        let squares = self.squares.last().map_or(0, |it| it.1.len().div_ceil(2));
        squares.max(self.damped.last().map_or(0, |it| it.1.len()))
    }

    fn extrapolated(&self) -> Option<Vec<ExtrapolatedRoot>> {
        match self.squares.is_empty() {
            true => extrapolate_damped(&self.damped),
            false => extrapolate_squares(&self.squares),
        }
    }

    /// Whether there are grids enough for these roots: so many of the lowest are accurate, and it is certain of all
    /// whether they grow.
    fn suffices(&self, roots: &[ExtrapolatedRoot], lowest: usize) -> bool {
        let squares = self.squares.iter().map(|it| it.0);
        let segments: Vec<usize> = squares.chain(self.damped.iter().map(|it| it.0)).collect();
        let accurate = |it: &ExtrapolatedRoot| {
            let error = it.error.unwrap_or(f64::INFINITY);
            error <= LARGEST_ERROR * it.root.size()
        };
        segments.len() >= LEAST_GRIDS
            && segments
                .last()
                .is_some_and(|finest| *finest >= LEAST_SEGMENTS)
            && roots.iter().take(lowest).all(accurate)
            && roots.iter().all(|it| it.grows.is_some())
    }
}

/// Imaginary part of the square of a difference, as a part of it, that is rounding.
const COMPLEX_ROUNDING: f64 = 1e-6;

/// Difference of two squares, as a part of their mean, that is rounding of equal ones, as of a round rod.
const EQUAL_SQUARES: f64 = 1e-6;

/// Cosine of the angle between the modes of two real squares from which on they are about to meet.
const MEETING_ALIGNMENT: f64 = 0.98;

/// A root extrapolated over grids.
#[derive(Clone, Copy)]
struct ExtrapolatedRoot {
    root: MotionRoot,
    /// The root on the finest grid.
    on_finest: MotionRoot,
    error: Option<f64>,
    /// What the compliance of the matrices of nearly rigid segments changes.
    softening: f64,
    /// Whether it grows, if that is certain.
    grows: Option<bool>,
}

/// A number extrapolated over grids.
#[derive(Clone, Copy)]
struct ExtrapolatedNumber {
    value: f64,
    error: Option<f64>,
}

impl ExtrapolatedNumber {
    /// Extrapolates the numbers on the finest grids in a row that have one.
    fn new(grids: impl DoubleEndedIterator<Item = (usize, Option<f64>)>) -> Option<Self> {
        let finest = grids
            .rev()
            .map_while(|(segments, value)| Some((segments, vec![value?])));
        let mut series: Vec<_> = finest.collect();
        series.reverse();
        if series.is_empty() {
            return None;
        }
        let table: Richardson = series.into_iter().collect();
        Some(ExtrapolatedNumber {
            value: *table.extrapolated().first()?,
            error: table.best().map(|best| best.error),
        })
    }

    /// Whether it is positive, if that is certain; on a single grid, if it is there.
    fn is_positive(self) -> Option<bool> {
        (self.value.abs() > self.error.unwrap_or(0.0)).then_some(self.value > 0.0)
    }
}

/// The small motions of a leaf at rest; `None` if they cannot be computed: the leaf is too large, or roots do
/// not converge.
pub fn small_motions(
    problem: &RelaxationProblem,
    found: &NestedEquilibrium,
) -> Option<SmallMotions> {
    let (physics, assumed) = Physics::for_small_motions(problem.leaf);
    let usual = LEAST_ROOTS.max(problem.options.modes);
    let reach = growth_reach(problem, found, &physics);
    let wanted = match reach {
        GrowthReach::Within(count) if count <= SURVEY.most_roots => count.max(usual),
        _ => usual,
    };
    // Roots on which the verdict depends: more that are requested may not converge.
    let needed = match reach {
        GrowthReach::Within(count) if count <= SURVEY.most_roots => count.max(LEAST_ROOTS),
        _ => LEAST_ROOTS,
    };
    let found_all = Cell::new(true);
    let limit = &problem.options.limit;
    let asked = match problem.options.mode_shapes {
        true => problem.options.modes,
        false => 0,
    };
    let on = |level: &GridLevel| {
        if unknowns(&level.leaf) > UNKNOWNS.without_shapes {
            return None;
        }
        let lowest = |count| lowest_on_grid(lowest_roots, level, &physics, count, limit);
        let mut count = wanted;
        loop {
            match lowest(count) {
                None if count > needed => count = (count / 2).max(needed),
                None if needed > LEAST_ROOTS => {
                    found_all.set(false);
                    return lowest(LEAST_ROOTS);
                }
                found => return found,
            }
        }
    };
    let skipped = found.levels.len().saturating_sub(EXTRAPOLATED_GRIDS);
    let mut series = RootSeries::default();
    let mut finest_of_series = None;
    for level in found.levels.iter().skip(skipped) {
        match on(level) {
            Some(roots) => {
                series.push(level.leaf.segments(), roots);
                finest_of_series = Some(Cow::Borrowed(level));
            }
            // The series needs consecutive grids.
            None if series.is_empty() => {}
            None => break,
        }
    }
    let mut roots = series.extrapolated()?;
    let mut finest = Cow::Borrowed(found.levels.last()?);
    let fixed = problem.segments().is_some();
    while !fixed && !series.suffices(&roots, asked.max(LEAST_ROOTS / 2)) && !problem.out_of_time() {
        if 2 * unknowns(&finest.leaf) > UNKNOWNS.quick {
            break;
        }
        let Some(next) = balance_on_next_grid(&finest, &problem.options.limit) else {
            break;
        };
        let Some(further) = on(&next) else {
            break;
        };
        series.push(next.leaf.segments(), further);
        roots = series.extrapolated()?;
        finest = Cow::Owned(next);
        finest_of_series = Some(finest.clone());
    }
    let softening = SofteningShifts::new(problem, found, &physics, wanted);
    for root in &mut roots {
        root.softening = softening.as_ref().map_or(0.0, |it| it.of_root(root.root));
    }
    let grow: Vec<Option<bool>> = roots.iter().map(|it| it.grows).collect();
    let (certain, complete) = match reach {
        GrowthReach::Within(reach) => {
            let reached = reach <= wanted && found_all.get();
            (reached, reached)
        }
        GrowthReach::NotComputed => (true, false),
        GrowthReach::TooLarge => (false, false),
    };
    let stable = match grow.contains(&Some(true)) {
        true => Some(false),
        false => (certain && !grow.contains(&None)).then_some(true),
    };
    let fastest = (roots.iter().zip(&grow)).filter(|(_, grows)| **grows == Some(true));
    let fastest = fastest.max_by(|(a, _), (b, _)| a.root.growth.total_cmp(&b.root.growth));
    let instability = fastest.map(|(it, _)| match it.root.frequency > 0.0 {
        true => MotionInstability::Flutter,
        false => MotionInstability::Divergence,
    });
    let listed: Vec<ExtrapolatedRoot> = (roots.iter().zip(&grow).enumerate())
        .filter(|(k, (_, grows))| *k < problem.options.modes || **grows == Some(true))
        .map(|(_, (root, _))| *root)
        .collect();
    let shapes = || {
        let level = finest_of_series.as_deref()?;
        let count = series.shapes_to_compute();
        let motions = lowest_on_grid(lowest_shapes, level, &physics, count, limit)?;
        let on_finest: Vec<MotionRoot> = listed.iter().map(|it| it.on_finest).collect();
        let curves = &found.levels.last()?.leaf;
        shapes_of_roots(&on_finest, &motions, &level.leaf, curves)
    };
    let shapes = (asked > 0).then(shapes).flatten();
    let rate = 1.0 / physics.time_unit;
    let conjugate = |it: &ExtrapolatedRoot| match (it.grows, it.root.frequency > 0.0) {
        (Some(true), true) => Some(2),
        (grows, _) => grows.map(usize::from),
    };
    // Of equal growth, as without damping, the first: the slowest motion.
    let dominant = roots
        .iter()
        .reduce(|most, it| match most.root.growth < it.root.growth {
            true => it,
            false => most,
        });
    let dominant = dominant.map(|it| DominantMotion {
        growth_rate: it.root.growth * rate,
        frequency: it.root.frequency * rate,
        error: told_error(it).map(|error| error * rate),
    });
    Some(SmallMotions {
        unstable_roots: roots.iter().map(conjugate).sum(),
        dominant,
        growth_rates: listed.iter().map(|it| it.root.growth * rate).collect(),
        frequencies: listed.iter().map(|it| it.root.frequency * rate).collect(),
        errors: listed
            .iter()
            .map(|it| Some(told_error(it)? * rate))
            .collect(),
        stable,
        instability,
        complete,
        searched_roots: if found_all.get() { needed } else { LEAST_ROOTS },
        assumed,
        shapes,
    })
}

/// So many small motions of a leaf at rest on a grid next to zero, which can be differentiated; `None` if they are
/// not found.
pub(crate) fn small_motion_pairs(level: &GridLevel, count: usize) -> Option<Vec<MotionPair>> {
    let (physics, _) = Physics::for_small_motions(&level.leaf.leaf);
    lowest_on_grid(lowest_pairs, level, &physics, count, &Limit::default())
}

/// Computes so many of the lowest roots of a linearised motion, or what goes with them.
type LowestMotions<T> =
    fn(&DiscreteLeaf, &Physics, &State, &dyn FollowerForces, usize, &Limit) -> Option<T>;

/// What is computed of the lowest small motions of a leaf at rest on a grid, under all of its loads.
fn lowest_on_grid<T>(
    lowest: LowestMotions<T>,
    GridLevel { leaf, state }: &GridLevel,
    physics: &Physics,
    count: usize,
    limit: &Limit,
) -> Option<T> {
    let forces = WithoutPotential::in_motion(leaf, physics);
    lowest(leaf, physics, state, &forces, count, limit)
}

/// How many of the roots nearest to zero have one that grows among them.
#[derive(Clone, Copy, Debug, PartialEq)]
enum GrowthReach {
    /// So many, by all roots of a coarse grid; none if none grows.
    Within(usize),
    /// The leaf is balanced on no coarse grid, or the dense matrix is singular on all of them: the slowest motions
    /// decide.
    NotComputed,
    /// The leaf has too many unknowns on any grid.
    TooLarge,
}

/// Where among all roots on a coarse grid those are that grow: the last that can be reached or, if none can, the first.
fn growth_reach(
    problem: &RelaxationProblem,
    found: &NestedEquilibrium,
    physics: &Physics,
) -> GrowthReach {
    let (Some(first), Some(finest)) = (found.levels.first(), found.levels.last()) else {
        return GrowthReach::NotComputed;
    };
    let [least, most] = SURVEY.segments;
    let states = states_per_node(&first.leaf, physics) * first.leaf.rods();
    let mut segments = most.min(MOST_DENSE_STATES / states);
    let roots_on = |level: &GridLevel| {
        let forces = WithoutPotential::in_motion(&level.leaf, physics);
        all_roots(&level.leaf, physics, &level.state, &forces)
    };
    let fixed = problem.segments().is_some() && first.leaf.segments() <= segments;
    if segments < least && !fixed {
        return GrowthReach::TooLarge;
    }
    // On coarser grids flutter begins under larger loads.
    let own = found.levels.iter().rev().find(|it| {
        let own = it.leaf.segments();
        own <= segments && (fixed || own as f64 >= SURVEY.coarser * segments as f64)
    });
    let mut roots = own.and_then(roots_on);
    // Kinks and hinges add nodes to those that are allowed for, and a leaf need not balance on every grid.
    while roots.is_none() && segments >= least && !problem.out_of_time() {
        let level = balance_on_coarse_grid(finest, segments, &problem.options.limit);
        roots = level.as_ref().and_then(roots_on);
        segments = (SURVEY.coarser * segments as f64) as usize;
    }
    let Some(roots) = roots else {
        return GrowthReach::NotComputed;
    };
    let roots = roots.into_roots();
    let smallest = roots.first().map_or(0.0, |it| it.size());
    let grows = |it: &MotionRoot| {
        let rounding = SURVEY.rounding * (it.size() / smallest).powi(2);
        it.growth > (SURVEY.growth + rounding) * it.size()
    };
    let growing = roots.iter().enumerate().filter(|(_, it)| grows(it));
    let reaches: Vec<usize> = growing.map(|(k, _)| k + 1 + SURVEY.further).collect();
    let within = reaches.iter().rfind(|reach| **reach <= SURVEY.most_roots);
    GrowthReach::Within(within.or(reaches.first()).copied().unwrap_or(0))
}

/// How the roots on the coarsest grid change with the compliance by which the matrices of nearly rigid segments are
/// softened: by as much as they are changed by it.
struct SofteningShifts(Vec<(MotionRoot, f64)>);

/// Compliance that is added to a matrix, as a part of the sum, that is rounding.
const LEAST_SOFTENING: f64 = 1e-6;

impl SofteningShifts {
    /// `None` of a leaf without such segments, or if roots are not found.
    fn new(
        problem: &RelaxationProblem,
        found: &NestedEquilibrium,
        physics: &Physics,
        count: usize,
    ) -> Option<Self> {
        let GridLevel { leaf, state } = found.levels.first()?;
        let mut softer = leaf.clone();
        let mut softened = false;
        for section in &mut softer.sections {
            let (own, all) = (section.compliance, section.condensing.recip());
            let added = all - own;
            softened |= added.cmpgt(LEAST_SOFTENING * all).any();
            section.condensing = (all + added).recip();
        }
        if !softened || unknowns(leaf) > UNKNOWNS.without_shapes {
            return None;
        }
        let limit = &problem.options.limit;
        let roots = |leaf: &DiscreteLeaf| {
            let forces = WithoutPotential::in_motion(leaf, physics);
            lowest_roots(leaf, physics, state, &forces, count, limit).map(MotionRoots::into_roots)
        };
        let both = roots(leaf)?.into_iter().zip(roots(&softer)?);
        let shift = |(own, soft): (MotionRoot, MotionRoot)| (own, own.distance(soft));
        Some(SofteningShifts(both.map(shift).collect()))
    }

    /// The change of a root: that of the root next to it on the coarsest grid.
    fn of_root(&self, root: MotionRoot) -> f64 {
        let distance = |it: &&(MotionRoot, f64)| it.0.distance(root);
        let nearest = self
            .0
            .iter()
            .min_by(|a, b| distance(a).total_cmp(&distance(b)));
        nearest.map_or(0.0, |it| it.1)
    }
}

/// Roots with damping, of which real and imaginary part are extrapolated. They pass zero growth without
/// meeting another.
fn extrapolate_damped(grids: &[(usize, Vec<MotionRoot>)]) -> Option<Vec<ExtrapolatedRoot>> {
    let (_, finest) = grids.last()?;
    let root = |(k, own): (usize, &MotionRoot)| {
        let part = |of: fn(&MotionRoot) -> f64| {
            let oscillates = own.frequency > 0.0;
            let alike = |it: &&MotionRoot| (it.frequency > 0.0) == oscillates;
            let values = grids
                .iter()
                .map(|(segments, roots)| (*segments, roots.get(k).filter(alike).map(of)));
            ExtrapolatedNumber::new(values)
        };
        let (growth, frequency) = (part(|it| it.growth)?, part(|it| it.frequency)?);
        let rounding = growth.value.abs() <= ROOT_ACCURACY * own.size();
        Some(ExtrapolatedRoot {
            root: MotionRoot {
                growth: growth.value,
                frequency: frequency.value,
            },
            on_finest: *own,
            error: growth.error.zip(frequency.error).map(|(a, b)| a.max(b)),
            softening: 0.0,
            grows: match rounding {
                true => Some(false),
                false => growth.is_positive(),
            },
        })
    };
    finest.iter().enumerate().map(root).collect()
}

/// Roots without damping by their squares. Where two real ones meet, and become complex, their mean and the
/// square of half of their difference are extrapolated: flutter begins where that becomes negative.
fn extrapolate_squares(grids: &[(usize, Vec<Square>)]) -> Option<Vec<ExtrapolatedRoot>> {
    let (_, finest) = grids.last()?;
    let number = |of: &dyn Fn(&[Square]) -> Option<f64>| {
        let values = grids.iter().map(|(segments, roots)| (*segments, of(roots)));
        ExtrapolatedNumber::new(values)
    };
    let (mut roots, mut k) = (Vec::new(), 0);
    while k < finest.len() {
        let pair = |roots: &[Square]| Some([roots.get(k)?.value, roots.get(k + 1)?.value]);
        let mean = number(&|roots| pair(roots).map(|[a, b]| 0.5 * (a.re + b.re)));
        // Of squares of two different pairs there is none.
        let difference = number(&|roots| {
            let half = pair(roots).map(|[a, b]| 0.5 * (a - b))?;
            let square = half * half;
            (square.im.abs() <= COMPLEX_ROUNDING * square.norm()).then_some(square.re)
        });
        let meets = finest[k].value.im != 0.0 || finest[k].alignment > MEETING_ALIGNMENT;
        if let Some((mean, it)) = mean.zip(difference).filter(|_| meets) {
            // Two equal real ones, but for rounding.
            let equal = it.value.abs().sqrt() <= EQUAL_SQUARES * mean.value.abs();
            let half = it.value.abs().sqrt();
            let error = mean.error.zip(it.error);
            let error = error.map(|(mean, square)| match equal {
                true => mean + square.sqrt(),
                false => mean + square / (2.0 * half),
            });
            // Real ones may be zero, or positive.
            let certain = if equal { Some(true) } else { it.is_positive() };
            let squares = match it.value < 0.0 && !equal {
                true => vec![c64::new(mean.value, half)],
                false => [-half, half]
                    .map(|by| c64::new(mean.value + by, 0.0))
                    .into(),
            };
            let on_finest = [k, k + 1].map(|k| on_upper_half(finest[k].value));
            roots.extend(
                squares
                    .into_iter()
                    .zip(on_finest)
                    .map(|(square, on_finest)| {
                        let root = MotionRoot::from_square(square);
                        ExtrapolatedRoot {
                            root,
                            on_finest,
                            error: error.map(|error| error / (2.0 * root.size())),
                            softening: 0.0,
                            grows: certain.map(|_| square.im != 0.0 || square.re > 0.0),
                        }
                    }),
            );
            k += 2;
            continue;
        }
        let mut real = number(&|roots| roots.get(k).map(|it| it.value.re))?;
        let own = finest[k].value.re;
        let mut signs = grids.iter().filter_map(|(_, roots)| roots.get(k));
        let same = signs.all(|it| (it.value.re > 0.0) == (own > 0.0));
        if same && (real.value > 0.0) != (own > 0.0) {
            // What coarse grids hardly resolve is not extrapolated.
            real.error = Some((real.value - own).abs());
            real.value = own;
        }
        let root = MotionRoot::from_square(c64::new(real.value, 0.0));
        roots.push(ExtrapolatedRoot {
            root,
            on_finest: on_upper_half(finest[k].value),
            error: real.error.map(|error| error / (2.0 * root.size())),
            softening: 0.0,
            grows: match same {
                true => Some(real.value > 0.0),
                false => real.is_positive(),
            },
        });
        k += 1;
    }
    Some(roots)
}

/// The root of a square, of conjugate ones the same.
fn on_upper_half(square: c64) -> MotionRoot {
    MotionRoot::from_square(c64::new(square.re, square.im.abs()))
}

impl SmallMotions {
    /// As the keys `growth_rates`, `frequencies`, `motion_errors`, `instability` and `assumed`.
    pub(crate) fn serialize_keys<M: serde::ser::SerializeMap>(
        motions: Option<&SmallMotions>,
        map: &mut M,
    ) -> Result<(), M::Error> {
        let Some(motions) = motions else {
            return Ok(());
        };
        map.serialize_entry("growth_rates", &motions.growth_rates)?;
        map.serialize_entry("frequencies", &motions.frequencies)?;
        map.serialize_entry("motion_errors", &motions.errors)?;
        map.serialize_entry("instability", &motions.instability)?;
        map.serialize_entry("assumed", &Assumptions(motions.assumed))
    }
}

/// What is assumed, as a list of words.
struct Assumptions(AssumedMotion);

impl Serialize for Assumptions {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_seq(self.0.words())
    }
}
