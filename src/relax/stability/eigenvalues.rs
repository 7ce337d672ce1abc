//! The modes of the settled leaf, extrapolated over nested grids, in the units of the
//! scenario.

mod shapes;

use crate::leaf::{DiscreteLeaf, Grid, Increment, Leaf, shift, turn};
use crate::modes;
use crate::modes::{Eigenpair, Wanted};
use crate::motion::Physics;
use crate::relax::grids::on_next_grid;
use crate::relax::nested::NestedEquilibrium;
use crate::relax::request::options::Options;
use crate::relax::request::problem::Problem;
use crate::relax::result::equilibrium::Mode;
use crate::relax::stability::eigenvalue_bars::{Extrapolated, GRIDS, Series};
use crate::relax::transfer::level::Level;
use crate::relax::transfer::stencil::Stencil;
use shapes::{Shape, normalized};
use std::borrow::Cow;

/// Largest number of unknowns of the finest grid for which modes are computed without their
/// shapes: about a second.
const FEW_UNKNOWNS: usize = 20_000;

/// Without their shapes the grids of a stable leaf with fewer unknowns than this suffice, if
/// there are any: about as long as a relaxation.
const QUICK_UNKNOWNS: usize = 4_000;

/// Largest number of unknowns of grids that are added for the accuracy of the eigenvalues.
const MANY_MORE_UNKNOWNS: usize = 200_000;

/// Largest number of grids finer than those of the relaxation.
const MORE_GRIDS: usize = 6;

/// Growth of the rounding error of an eigenvalue from grid to grid.
const FINER_NOISE: f64 = 4.0;

/// The tolerance if only the signs of the eigenvalues are needed.
const SIGN_TOLERANCE: f64 = 1e-2;

/// Accuracy of eigenvectors over the root of the tolerance (that of eigenvalues is its
/// square), and its limits: with less of it close eigenvalues are not told apart.
const ACCURACY: f64 = 5e-3;
const ACCURACIES: (f64, f64) = (1e-7, 1.6e-4);

/// Two grids do not tell how eigenvalues converge, and one may be equal on both by chance: of
/// requested ones so many are compared.
const COMPARED: usize = 3;

/// Largest relative error of frequencies that are listed without their shapes, over the tolerance
/// and in itself, but never asked to be less than the tolerance: by default eigenvalues have four
/// digits.
const LISTED_OVER_TOLERANCE: f64 = 40.0;
const LARGEST_LISTED: f64 = 4e-5;

/// The lowest modes of a settled leaf.
pub struct Lowest {
    pub modes: Vec<Mode>,
    /// The smallest size, or error, of eigenvalues whose signs may contradict the Morse index.
    /// An eigenvalue that is zero to the accuracy required does not count, nor one within rounding of
    /// zero if the leaf can turn.
    pub undecided: Option<f64>,
    /// How many eigenvalues are negative, if all of these are larger than their errors.
    pub negative: Option<usize>,
    /// So many eigenvalues are below those of the list.
    pub left_out: usize,
    /// Whether each of the list is negative, where that is certain.
    pub signs: Vec<Option<bool>>,
    /// The ratio of the softest eigenvalue and that on the grid whose linear equations tell the
    /// error, at least one: beside a bifurcation their response is wrong by so much.
    pub softening: f64,
}

impl Lowest {
    /// How many eigenvalues are negative for certain, whatever is known of the others.
    pub fn certainly_negative(&self) -> usize {
        let negative = self.signs.iter().filter(|sign| **sign == Some(true));
        self.left_out + negative.count()
    }

    /// How many are negative where the first so `many` are known to be, if that is certain.
    pub fn negative_beyond(&self, many: usize) -> Option<usize> {
        let others = self.signs.iter().skip(many.saturating_sub(self.left_out));
        let negative = |sum, sign: &Option<bool>| Some(sum + usize::from((*sign)?));
        others.into_iter().try_fold(many, negative)
    }
}

/// A list of eigenvalues.
#[derive(Clone, Copy)]
pub struct List {
    pub count: usize,
    /// So many lower ones are left out, and the shift by which they are found to be lower: see
    /// [`Wanted::above`].
    pub above: Option<(usize, f64)>,
    /// Whether the stability of the leaf depends on them: then its size does not matter.
    pub decides: bool,
    /// Whether more than their signs is needed: they are as accurate as requested ones.
    pub exact: bool,
}

impl List {
    /// The modes that are requested.
    pub fn requested(problem: &Problem) -> Self {
        List {
            count: problem.options.modes,
            above: None,
            decides: false,
            exact: false,
        }
    }
}

/// The lowest modes, or some next to zero. `None` if they cannot be computed: the leaf is too
/// large, or there are several equal ones that cannot be told apart.
/// Of those that are neither requested nor exact only the signs of the eigenvalues are needed.
pub fn lowest(problem: &Problem, found: &NestedEquilibrium, list: List) -> Option<Lowest> {
    let List { count, above, .. } = list;
    let options = problem.options;
    let finest = found.levels.last()?;
    let large = unknowns(&finest.leaf) > FEW_UNKNOWNS && !options.mode_shapes && !list.decides;
    if count == 0 || !finest.leaf.leaf.has_potential() || large {
        return None;
    }
    let physics = Physics::new(problem.leaf);
    let requested = count <= options.modes && above.is_none();
    let tolerance = if requested || list.exact {
        problem.tolerance
    } else {
        SIGN_TOLERANCE
    };
    let on = |level: &Level, near: &[Vec<Increment>]| {
        let wanted = Wanted {
            count,
            above,
            accuracy: (ACCURACY * tolerance.sqrt()).clamp(ACCURACIES.0, ACCURACIES.1),
            near,
            time: &options.limit,
        };
        modes::lowest(&level.leaf, &physics, &level.state, wanted)
    };
    let left_out = above.map_or(0, |(others, _)| others);
    let (wanted, most_unknowns) = match options.mode_shapes || list.exact {
        true => (tolerance, MANY_MORE_UNKNOWNS),
        false => {
            let listed = (LISTED_OVER_TOLERANCE * tolerance).min(LARGEST_LISTED);
            (tolerance.max(listed), FEW_UNKNOWNS)
        }
    };
    let mut nested = Nested {
        series: Series {
            index: found.index.unwrap_or(0).saturating_sub(left_out),
            single: found.clearly_stable || problem.segments().is_some(),
            grids: Vec::new(),
            tolerance,
            wanted,
            rounding: 0.0,
            turns: !finest.leaf.turns(&finest.state).is_empty(),
        },
        finest: None,
        coarser: None,
        segments: Vec::new(),
    };
    let sharp = requested || list.exact;
    let compares = requested && 2 * unknowns(&finest.leaf) <= FEW_UNKNOWNS;
    let enough = |series: &Series| {
        (!sharp || series.accurate()) && (!compares || series.grids.len() >= COMPARED)
    };
    let sufficient_grids = sufficient_grids(options, found);
    let skipped = sufficient_grids.saturating_sub(GRIDS);
    for (k, level) in found.levels.iter().enumerate().skip(skipped) {
        let series = &nested.series;
        let decided = !series.grids.is_empty() && series.undecided().is_none();
        if k >= sufficient_grids && decided && enough(series) {
            break;
        }
        if !nested.add(Cow::Borrowed(level), on) {
            if k >= sufficient_grids && nested.finest.is_some() {
                break;
            }
            // The series needs consecutive grids.
            nested.clear();
        }
    }
    nested.finest.as_ref()?;
    if options.method.segments().is_none() {
        refine(problem, &mut nested, most_unknowns, (on, enough));
    }
    let on = found.segments_of_estimate();
    let softening = (nested
        .segments
        .iter()
        .position(|segments| Some(*segments) == on))
    .map_or(1.0, |grid| nested.series.softening(grid));
    let Nested { series, finest, .. } = nested;
    let shapes = match options.mode_shapes {
        true => finest?.shapes(&found.levels.last()?.leaf),
        false => Vec::new(),
    };
    let unit = physics.time.powi(-2);
    let mode = |it: Extrapolated| {
        let (displacement, rotation) = shapes.get(it.number).cloned().unwrap_or_default();
        Mode {
            eigenvalue: it.value * unit,
            error: it.error.map(|error| error * unit),
            displacement,
            rotation,
        }
    };
    Some(Lowest {
        modes: series.values().into_iter().map(mode).collect(),
        undecided: series.undecided(),
        negative: series.negative().map(|negative| left_out + negative),
        left_out,
        signs: series.signs(),
        softening,
    })
}

/// Eigenvalues on nested grids, and the modes on the finest of these.
struct Nested<'a> {
    series: Series,
    finest: Option<OnGrid<'a>>,
    /// The grid before that.
    coarser: Option<Cow<'a, Level>>,
    /// Segments of each grid of the series.
    segments: Vec<usize>,
}

/// The lowest modes on one grid: their number and their nodes are those of this grid alone.
struct OnGrid<'a> {
    level: Cow<'a, Level>,
    pairs: Vec<Eigenpair>,
}

impl<'a> Nested<'a> {
    /// Adds the modes on the next finer grid; false if they are not found.
    fn add(
        &mut self,
        level: Cow<'a, Level>,
        on: impl Fn(&Level, &[Vec<Increment>]) -> Option<Vec<Eigenpair>>,
    ) -> bool {
        let coarser = self.finest.as_ref();
        let near = coarser.map_or(Vec::new(), |coarser| coarser.interpolated(&level.leaf));
        let Some(pairs) = on(&level, &near) else {
            return false;
        };
        self.series.push(&pairs);
        self.segments.push(level.leaf.segments());
        self.series.rounding = modes::rounding(&level.leaf);
        let before = self.finest.replace(OnGrid { level, pairs });
        self.coarser = before.map(|before| before.level);
        true
    }

    fn clear(&mut self) {
        self.series.grids.clear();
        self.segments.clear();
        (self.finest, self.coarser) = (None, None);
    }
}

/// Number of grids that suffice if they determine the signs of the eigenvalues.
fn sufficient_grids(options: &Options, found: &NestedEquilibrium) -> usize {
    if options.mode_shapes || found.index != Some(0) {
        return found.levels.len();
    }
    let few = |level: &&Level| unknowns(&level.leaf) < QUICK_UNKNOWNS;
    let few = found.levels.iter().take_while(few).count();
    few.max(2).min(found.levels.len())
}

/// Whether the cost of modes on this grid is acceptable.
fn is_affordable(leaf: &Leaf, grid: &Grid) -> bool {
    6 * leaf.rods() * grid.segments() <= MANY_MORE_UNKNOWNS
}

/// The next grid, if it may decide the signs of eigenvalues, that is if its rounding error is
/// small enough for an undecided one of this `size`.
pub fn deciding_grid(problem: &Problem, found: &NestedEquilibrium, size: f64) -> Option<Grid> {
    let noise = found.levels.last()?.leaf.neutral_shift();
    let finer = (found.finer()).filter(|grid| is_affordable(problem.leaf, grid))?;
    (size > FINER_NOISE * noise && !problem.out_of_time()).then_some(finer)
}

/// The next grid, if it has few unknowns.
pub fn small_grid(problem: &Problem, found: &NestedEquilibrium) -> Option<Grid> {
    let few = |grid: &Grid| 6 * problem.leaf.rods() * grid.segments() <= FEW_UNKNOWNS;
    (found.finer()).filter(|grid| few(grid) && !problem.out_of_time())
}

fn unknowns(leaf: &DiscreteLeaf) -> usize {
    6 * leaf.rods() * leaf.segments()
}

/// Adds finer grids than those of the relaxation until the eigenvalues are accurate enough, or
/// the limits are reached.
fn refine(
    problem: &Problem,
    nested: &mut Nested,
    most_unknowns: usize,
    (on, enough): (
        impl Fn(&Level, &[Vec<Increment>]) -> Option<Vec<Eigenpair>>,
        impl Fn(&Series) -> bool,
    ),
) -> Option<()> {
    for _ in 0..MORE_GRIDS {
        if enough(&nested.series) || problem.out_of_time() {
            break;
        }
        let finest = &*nested.finest.as_ref()?.level;
        if 2 * unknowns(&finest.leaf) > most_unknowns {
            break;
        }
        let next = on_next_grid(nested.coarser.as_deref(), finest, problem.tolerance)?;
        if !nested.add(Cow::Owned(next), &on) {
            break;
        }
    }
    Some(())
}

impl OnGrid<'_> {
    /// The shapes interpolated to a finer grid.
    fn interpolated(&self, fine: &DiscreteLeaf) -> Vec<Vec<Increment>> {
        let coarse = &self.level.leaf;
        let nodes = fine.grid.sigma().iter();
        let stencils: Vec<_> = nodes.map(|&sigma| <Stencil>::at(coarse, sigma)).collect();
        let on_grid = |pair: &Eigenpair| {
            let rods = pair.shape.chunks(coarse.segments() + 1);
            let node = |(rod, [stencil, _]): (&[Increment], &[Stencil; 2])| -> Increment {
                let [turn, shift] = [turn, shift].map(|part| stencil.value(|i| part(&rod[i])));
                let mut both = [0.0; 6];
                turn.write_to_slice(&mut both[..3]);
                shift.write_to_slice(&mut both[3..]);
                both
            };
            rods.flat_map(|rod| stencils.iter().map(move |stencil| node((rod, stencil))))
                .collect()
        };
        self.pairs.iter().map(on_grid).collect()
    }

    /// Normalised shapes at the nodes of the same or a coarser grid: the largest displacement
    /// is the longest rod's length, and the last of the largest components is positive.
    fn shapes(&self, coarse: &DiscreteLeaf) -> Vec<Shape> {
        let length = coarse.leaf.scale.length;
        let (nodes, segments) = (self.level.leaf.segments() + 1, coarse.segments());
        let stride = self.level.leaf.segments().div_ceil(segments);
        let shape = |pair: &Eigenpair| {
            let rods = pair.shape.chunks(nodes);
            let shape = rods.map(|rod| rod.iter().step_by(stride).copied().collect());
            normalized(&shape.collect::<Vec<Vec<Increment>>>(), length)
        };
        self.pairs.iter().map(shape).collect()
    }
}
