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
use crate::relax::richardson::{Best, Richardson};
use crate::relax::run::Run;
use crate::relax::saddle::ANY_SIGN;
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

/// Largest number of grids that are extrapolated, and of grids finer than those of the
/// relaxation.
const GRIDS: usize = 4;
const MORE_GRIDS: usize = 6;

/// Eigenvalues below this part of the largest have errors relative to that part.
const SMALL: f64 = 1e-3;

/// Safety factor on the errors of eigenvalues, and lower bound of the last change of an
/// eigenvalue as a part of the change before: that of a single number may be small by chance,
/// and is also combined with those of the other eigenvalues. Of 12,600 eigenvalues of 600
/// random leaves none had a larger error.
const SAFETY: f64 = 2.0;
const LEAST_CHANGE: f64 = 0.1;

/// Growth of the rounding error of an eigenvalue from grid to grid.
const FINER_NOISE: f64 = 4.0;

/// An error of up to this many times that of rounding does not decrease on finer grids.
const NOISE: f64 = 4.0;

/// Relative error of an eigenvalue by unfinished iterations, as a part of the tolerance.
const UNFINISHED: f64 = 2e-3;

/// The tolerance if only the signs of the eigenvalues are needed.
const SIGN_TOLERANCE: f64 = 1e-2;

/// Accuracy of eigenvectors over the root of the tolerance (that of eigenvalues is its
/// square), and its lower limit.
const ACCURACY: f64 = 5e-3;
const LEAST_ACCURACY: f64 = 1e-7;

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
    /// How many of the eigenvalues are negative, if all are larger than their errors.
    pub negative: Option<usize>,
}

/// The lowest modes. `None` if they cannot be computed: the leaf is too large, unless they are
/// `required`, or more modes are requested than a coarse grid has.
/// Of more modes than the run's options request only the signs of the eigenvalues are needed.
pub fn lowest(run: &Run, count: usize, required: bool) -> Option<Lowest> {
    let options = run.options;
    let finest = run.levels.last()?;
    let large = unknowns(&finest.leaf) > FEW_UNKNOWNS && !options.mode_shapes && !required;
    if count == 0 || finest.leaf.tip_moment() != DVec3::ZERO || large {
        return None;
    }
    let physics = Physics::new(run.leaf);
    let requested = count <= options.modes;
    let tolerance = if requested {
        run.tolerance
    } else {
        SIGN_TOLERANCE
    };
    let on = |level: &Level, near: &[Vec<Increment>]| {
        let wanted = Wanted {
            count,
            accuracy: (ACCURACY * tolerance.sqrt()).max(LEAST_ACCURACY),
            near,
            time: &options.limit,
        };
        modes::lowest(&level.leaf, &physics, &level.state, wanted)
    };
    let mut series = Series {
        index: run.index.unwrap_or(0),
        grids: Vec::new(),
        tolerance,
        rounding: 0.0,
    };
    let mut before: Option<(&Level, Vec<Eigenpair>)> = None;
    let sufficient_grids = sufficient_grids(run);
    for (k, level) in run
        .levels
        .iter()
        .enumerate()
        .skip(sufficient_grids.saturating_sub(GRIDS))
    {
        if k >= sufficient_grids && series.undecided().is_none() {
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
    if requested && options.method.segments().is_none() && options.mode_shapes {
        refine(run, &mut series, pairs, on);
    }
    let unit = physics.time.powi(-2);
    let mode =
        |((eigenvalue, error), (displacement, rotation)): ((f64, Option<f64>), Shape)| Mode {
            eigenvalue: eigenvalue * unit,
            error: error.map(|error| error * unit),
            displacement,
            rotation,
        };
    Some(Lowest {
        modes: series.values().into_iter().zip(shapes).map(mode).collect(),
        undecided: series.undecided(),
        negative: series.negative(),
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

/// The next grid, if it may decide the signs of the lowest eigenvalues that are still
/// undecided, that is if its rounding error is small enough.
pub fn deciding_grid(run: &Run, lowest: Option<&Lowest>) -> Option<Grid> {
    let size = lowest?.undecided?;
    let noise = run.levels.last()?.leaf.neutral_shift();
    let finer = run.finer().filter(|grid| is_affordable(run.leaf, grid))?;
    (size > FINER_NOISE * noise && !run.out_of_time()).then_some(finer)
}

fn unknowns(leaf: &DiscreteLeaf) -> usize {
    6 * leaf.rods() * leaf.segments()
}

/// Adds finer grids until the eigenvalues are as accurate as the shape, or the limits are
/// reached.
fn refine(
    run: &Run,
    series: &mut Series,
    mut pairs: Vec<Eigenpair>,
    on: impl Fn(&Level, &[Vec<Increment>]) -> Option<Vec<Eigenpair>>,
) -> Option<()> {
    let mut finer: Vec<Level> = Vec::new();
    while finer.len() < MORE_GRIDS && !series.accurate() && !run.out_of_time() {
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

/// Eigenvalues on nested grids, each extrapolated on its own.
struct Series {
    /// Number of negative eigenvalues on the finest grid.
    index: usize,
    grids: Vec<Vec<f64>>,
    tolerance: f64,
    /// Rounding error of an eigenvalue on the finest grid.
    rounding: f64,
}

impl Series {
    fn push(&mut self, pairs: &[Eigenpair]) {
        let values = pairs.iter().map(|pair| pair.eigenvalue);
        self.grids.push(values.collect());
    }

    /// The unit of an eigenvalue's error.
    fn unit(&self, k: usize) -> f64 {
        let finest = &self.grids[self.grids.len() - 1];
        let largest = finest.iter().fold(0.0_f64, |m, value| m.max(value.abs()));
        let unit = finest[k].abs().max(SMALL * largest);
        if unit > 0.0 { unit } else { 1.0 }
    }

    /// Extrapolated values, and their errors if there are at least two grids.
    fn values(&self) -> Vec<(f64, Option<f64>)> {
        let judge = |k: usize| {
            // A coarse grid may have fewer modes.
            let values = self.grids.iter().filter_map(|grid| grid.get(k));
            let last = values.clone().count().saturating_sub(GRIDS);
            let values = values.skip(last).enumerate();
            let table: Richardson = values
                .map(|(grid, value)| (1 << grid, vec![value / self.unit(k)]))
                .collect();
            let error = |best: Best| {
                best.error
                    .max(LEAST_CHANGE * table.change_before(best.columns))
            };
            (table.extrapolated()[0], table.best().map(error))
        };
        let found: Vec<_> = (0..self.grids.last().map_or(0, Vec::len))
            .map(judge)
            .collect();
        let largest = found.iter().filter_map(|(_, error)| *error);
        let largest = largest.fold(0.0, f64::max);
        let bound = |error: f64| SAFETY * (error * largest).sqrt() + UNFINISHED * self.tolerance;
        let in_units = |(k, (value, error)): (usize, &(f64, Option<f64>))| {
            let unit = self.unit(k);
            (
                value * unit,
                error.map(|error| bound(error) * unit + self.rounding),
            )
        };
        found.iter().enumerate().map(in_units).collect()
    }

    /// Whether the relative error of all frequencies is within the tolerance.
    fn accurate(&self) -> bool {
        let known = |(k, (_, error)): (usize, (f64, Option<f64>))| {
            let wanted = 2.0 * self.tolerance * self.unit(k);
            error.is_some_and(|error| error <= wanted + self.rounding)
        };
        self.values().into_iter().enumerate().all(known)
    }

    /// Number of negative eigenvalues, if their signs are certain; on a single grid those of that
    /// grid.
    fn negative(&self) -> Option<usize> {
        let values = self.values();
        let alone = |k: usize| NOISE * self.rounding + UNFINISHED * self.tolerance * self.unit(k);
        let certain = |(k, (value, error)): (usize, &(f64, Option<f64>))| {
            value.abs() > error.unwrap_or_else(|| alone(k))
        };
        let all = values.iter().enumerate().all(certain);
        all.then(|| values.iter().filter(|(value, _)| *value < 0.0).count())
    }

    /// The smallest size, or error, of eigenvalues whose sign may differ from that on the
    /// finest grid. One that is zero to the tolerance may have either sign.
    fn undecided(&self) -> Option<f64> {
        let unknown = |(k, (value, error)): (usize, (f64, Option<f64>))| {
            let (size, error) = (value.abs(), error?);
            let zero = 2.0 * self.tolerance * self.unit(k).max(SMALL) + NOISE * self.rounding;
            let decided = match size > error {
                true => (value < 0.0) == (k < self.index),
                false => error <= zero,
            };
            (!decided).then_some(size.max(error))
        };
        let unknown = self.values().into_iter().enumerate().filter_map(unknown);
        unknown.reduce(f64::min)
    }
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
