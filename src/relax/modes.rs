//! The modes of the settled leaf, extrapolated over nested grids, in the units of the
//! scenario.

use crate::leaf::{DiscreteLeaf, Grid, Increment, Leaf, System, shift, turn};
use crate::modes::{self, Eigenpair, Wanted};
use crate::motion::Physics;
use crate::newton::{Newton, Work};
use crate::relax::equilibrium::Mode;
use crate::relax::level::Level;
use crate::relax::predict::predict;
use crate::relax::prolong::prolong;
use crate::relax::run::Run;
use crate::relax::saddle::ANY_SIGN;
use crate::relax::series::{Extrapolated, GRIDS, Series};
use crate::relax::stencil::Stencil;
use glam::DVec3;

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

/// To a tolerance of this or more the grids are so coarse that two of them do not tell how
/// eigenvalues converge: so many are compared.
const LOW_TOLERANCE: f64 = 1e-3;
const COMPARED: usize = 3;

/// Newton iterations on a further grid, and the largest displacement of a node, in lengths:
/// farther away is another equilibrium.
const ITERATIONS: usize = 12;
const SAME_PLACE: f64 = 0.02;

/// A mode with smaller displacements than this, in lengths per radian of its rotation, is one
/// of rotation alone.
const NO_DISPLACEMENT: f64 = 1e-6;

/// The lowest modes of a settled leaf.
pub struct Lowest {
    pub modes: Vec<Mode>,
    /// The smallest size, or error, of eigenvalues whose signs may contradict the Morse index.
    /// An eigenvalue that is zero to the accuracy required does not count: the leaf may have a
    /// free motion.
    pub undecided: Option<f64>,
    /// How many eigenvalues are negative, if all of these are larger than their errors.
    pub negative: Option<usize>,
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
}

impl List {
    /// The modes that are requested.
    pub fn requested(run: &Run) -> Self {
        List {
            count: run.options.modes,
            above: None,
            decides: false,
        }
    }
}

/// The lowest modes, or some next to zero. `None` if they cannot be computed: the leaf is too
/// large, or there are several equal ones that cannot be told apart.
/// Of those that are not requested only the signs of the eigenvalues are needed.
pub fn lowest(run: &Run, list: List) -> Option<Lowest> {
    let List { count, above, .. } = list;
    let options = run.options;
    let finest = run.levels.last()?;
    let large = unknowns(&finest.leaf) > FEW_UNKNOWNS && !options.mode_shapes && !list.decides;
    if count == 0 || finest.leaf.tip_moment() != DVec3::ZERO || large {
        return None;
    }
    let physics = Physics::new(run.leaf);
    let requested = count <= options.modes && above.is_none();
    let tolerance = if requested {
        run.tolerance
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
    let mut series = Series {
        index: run.index.unwrap_or(0).saturating_sub(left_out),
        single: run.clearly_stable || run.segments().is_some(),
        grids: Vec::new(),
        tolerance,
        rounding: 0.0,
    };
    let mut before: Option<(&Level, Vec<Eigenpair>)> = None;
    let sufficient_grids = sufficient_grids(run);
    let skipped = sufficient_grids.saturating_sub(GRIDS);
    for (k, level) in run.levels.iter().enumerate().skip(skipped) {
        if k >= sufficient_grids && !series.grids.is_empty() && series.undecided().is_none() {
            break;
        }
        let near = |(coarse, pairs): (&Level, Vec<Eigenpair>)| {
            interpolated(&coarse.leaf, &pairs, &level.leaf)
        };
        let near = before.map(near).unwrap_or_default();
        let found = on(level, &near);
        series.rounding = modes::rounding(&level.leaf);
        match &found {
            Some(pairs) => series.push(pairs),
            // The series needs consecutive grids.
            None => series.grids.clear(),
        }
        before = found.map(|pairs| (level, pairs));
    }
    let (finest, pairs) = before?;
    let shapes = shapes(finest, &pairs);
    if options.method.segments().is_none() {
        let sharp = requested && options.mode_shapes;
        let low = run.tolerance >= LOW_TOLERANCE && 2 * unknowns(&finest.leaf) <= FEW_UNKNOWNS;
        let enough = |series: &Series| {
            (!sharp || series.accurate()) && (!low || series.grids.len() >= COMPARED)
        };
        refine(run, &mut series, pairs, (on, enough));
    }
    let unit = physics.time.powi(-2);
    let mode = |it: Extrapolated| {
        let (displacement, rotation) = shapes[it.number].clone();
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
    })
}

/// Number of grids that suffice if they determine the signs of the eigenvalues.
fn sufficient_grids(run: &Run) -> usize {
    if run.options.mode_shapes || run.index != Some(0) {
        return run.levels.len();
    }
    let few = |level: &&Level| unknowns(&level.leaf) < QUICK_UNKNOWNS;
    let few = run.levels.iter().take_while(few).count();
    few.max(2).min(run.levels.len())
}

/// Whether the cost of modes on this grid is acceptable.
fn is_affordable(leaf: &Leaf, grid: &Grid) -> bool {
    6 * leaf.rods() * grid.segments() <= MANY_MORE_UNKNOWNS
}

/// The next grid, if it may decide the signs of eigenvalues, that is if its rounding error is
/// small enough for an undecided one of this `size`.
pub fn deciding_grid(run: &Run, size: f64) -> Option<Grid> {
    let noise = run.levels.last()?.leaf.neutral_shift();
    let finer = run.finer().filter(|grid| is_affordable(run.leaf, grid))?;
    (size > FINER_NOISE * noise && !run.out_of_time()).then_some(finer)
}

/// The next grid, if it has few unknowns.
pub fn small_grid(run: &Run) -> Option<Grid> {
    let few = |grid: &Grid| 6 * run.leaf.rods() * grid.segments() <= FEW_UNKNOWNS;
    run.finer().filter(|grid| few(grid) && !run.out_of_time())
}

fn unknowns(leaf: &DiscreteLeaf) -> usize {
    6 * leaf.rods() * leaf.segments()
}

/// Adds finer grids until the eigenvalues are accurate enough, or the limits are reached.
fn refine(
    run: &Run,
    series: &mut Series,
    mut pairs: Vec<Eigenpair>,
    (on, enough): (
        impl Fn(&Level, &[Vec<Increment>]) -> Option<Vec<Eigenpair>>,
        impl Fn(&Series) -> bool,
    ),
) -> Option<()> {
    let mut finer: Vec<Level> = Vec::new();
    while finer.len() < MORE_GRIDS && !enough(series) && !run.out_of_time() {
        let levels: Vec<&Level> = run.levels.iter().chain(&finer).collect();
        let last = levels.last()?;
        if !is_affordable(run.leaf, &last.leaf.grid.refined()) {
            break;
        }
        let next = settle(&levels[levels.len().saturating_sub(2)..], run.tolerance)?;
        let near = interpolated(&levels.last()?.leaf, &pairs, &next.leaf);
        pairs = on(&next, &near)?;
        series.push(&pairs);
        finer.push(next);
    }
    Some(())
}

/// Shapes of modes interpolated to a finer grid.
fn interpolated(
    coarse: &DiscreteLeaf,
    pairs: &[Eigenpair],
    fine: &DiscreteLeaf,
) -> Vec<Vec<Increment>> {
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
    pairs.iter().map(on_grid).collect()
}

/// The same equilibrium on the next finer grid.
fn settle(levels: &[&Level], tolerance: f64) -> Option<Level> {
    let last = levels.last()?;
    let mut state = prolong(&last.leaf, &last.state);
    if levels.len() > 1 {
        predict(levels, &mut state);
    }
    let leaf = DiscreteLeaf::new(&last.leaf.leaf, last.leaf.grid.refined());
    let mut system = System::new(&leaf);
    let guess = state.clone();
    let newton = Newton {
        accuracy: 1e-3 * tolerance,
        iterations: ITERATIONS,
        work: &mut Work::default(),
        progress: &mut |_, _| {},
    };
    (newton.solve(&leaf, &mut state, &mut system, ANY_SIGN)).ok()?;
    (guess.shift_to(&state) < SAME_PLACE).then_some(Level { leaf, state })
}

/// Displacements and rotations of all nodes, rod by rod.
type Shape = (Vec<Vec<DVec3>>, Vec<Vec<DVec3>>);

/// Normalised shapes: the largest displacement is the longest rod's length, and the last of
/// the largest components is positive.
fn shapes(level: &Level, pairs: &[Eigenpair]) -> Vec<Shape> {
    let length = level.leaf.leaf.scale.length;
    let nodes = level.leaf.segments() + 1;
    let shape = |pair: &Eigenpair| {
        let largest = |part: fn(&[f64; 6]) -> DVec3| {
            let lengths = pair.shape.iter().map(|node| part(node).length());
            lengths.fold(0.0, f64::max)
        };
        let (far, turned) = (largest(shift), largest(turn));
        let (size, part): (f64, fn(&[f64; 6]) -> DVec3) = match far > NO_DISPLACEMENT * turned {
            true => (far, shift),
            false => (turned, turn),
        };
        let components = || pair.shape.iter().flat_map(|node| part(node).to_array());
        let most = components().fold(0.0_f64, |m, c| m.max(c.abs()));
        // The last of those that are equal up to rounding: a tip's.
        let sign = components()
            .rfind(|c| c.abs() > 0.99 * most)
            .map_or(1.0, f64::signum);
        let rods = |part: fn(&[f64; 6]) -> DVec3, unit: f64| {
            let rod = |rod: &[[f64; 6]]| rod.iter().map(|node| part(node) * unit).collect();
            pair.shape.chunks(nodes).map(rod).collect()
        };
        let unit = sign / size;
        (rods(shift, unit * length), rods(turn, unit))
    };
    pairs.iter().map(shape).collect()
}
