//! Where a branch of equilibria without a potential loses its stability, or regains it: flutter and
//! divergence, by the roots of the linearised motion ([`crate::modes`]).
//!
//! On a grid the parameter is bracketed: between its ends the number of roots with growth changes. A
//! function of the roots that is smooth where growth begins (without damping the square of the distance of
//! two frequencies that have met, Bolotin, Nonconservative Problems of the Theory of Elastic Stability,
//! 1963) is known on the side with growth, from which inverse interpolation tells its zero to rounding.
//! The parameter on a grid has an error whose series is in ds^2, as the elements have: it is extrapolated
//! over grids, and so is the frequency.

use crate::branch::family::LeafFamily;
use crate::leaf::{DiscreteLeaf, Grid};
use crate::relax::MotionInstability;
use crate::relax::accuracy::richardson::Richardson;
use crate::relax::accuracy::transfer::transfer;
use crate::relax::balanced::{
    GrowingMotion, GrowingMotions, balance_on_grid, growing_motions, has_quick_small_motions,
    has_small_motions, is_softened, rounding_of_squares, state_on_line,
};
use crate::relax::{GridLevel, StateOnGrid};

/// How a critical parameter is located on a grid.
struct Search {
    /// Segments of the coarsest grid, at least.
    coarsest: usize,
    /// Largest number of grids, and the least if they are not too fine.
    grids: usize,
    least_grids: usize,
    /// Widenings of a bracket in which nothing changes on a grid.
    widenings: usize,
    /// Largest number of balances on a grid.
    probes: usize,
    /// Width of the narrowest bracket, as a part of the range.
    accuracy: f64,
    /// Uncertainty of the zero that is sought, and the largest that is accepted, as parts of the range: the
    /// interpolation of highest order is some 100 times as accurate.
    uncertainty: f64,
    largest_uncertainty: f64,
    /// Balances in a row that make the zero no more certain, after which there is only rounding.
    worse: usize,
    /// Distance of the nearest balance without the growth from the zero, as a part of the range: two motions that
    /// begin to grow within it are taken for one.
    confirmed: f64,
    /// Distance of the next balance from the zero, as a part of that of the last one.
    approach: f64,
    /// Width of a bracket, as a part of the range, below which interpolation is trusted.
    trusted: f64,
}

const SEARCH: Search = Search {
    coarsest: 16,
    grids: 5,
    least_grids: 3,
    widenings: 2,
    probes: 60,
    accuracy: 1e-12,
    uncertainty: 1e-8,
    largest_uncertainty: 1e-5,
    worse: 2,
    confirmed: 1e-4,
    approach: 0.2,
    trusted: 0.05,
};

/// Factor on the error that the extrapolation of a single number tells, and the accuracy of the parameter,
/// as a part of its range, that rounding leaves.
const SAFETY: f64 = 2.0;
const ROUNDING: f64 = 1e-9;

/// The error of the interpolation as a part of its difference from that of one order less.
const UNCERTAINTY_PART: f64 = 0.03;

/// A point of a branch on which the number of roots with growth is known.
pub(crate) struct KnownStability {
    /// The parameter, as a fraction of its range.
    pub fraction: f64,
    /// Roots with growth, both of a conjugate pair.
    pub unstable_roots: usize,
    /// So many roots next to zero have those with growth among them.
    pub searched_roots: usize,
    /// The leaf there, on any grid.
    pub level: GridLevel,
}

/// A critical point extrapolated over grids.
#[derive(Clone, Copy, Debug)]
pub(crate) struct MotionCriticalPoint {
    /// How growth begins or, towards larger fractions, ends.
    pub kind: MotionInstability,
    /// The parameter, as a fraction of its range, with a bound on its error.
    pub fraction: f64,
    pub fraction_error: Option<f64>,
    /// Angular frequency in the scenario's unit of time, zero in divergence, with a bound on its error.
    pub frequency: f64,
    pub frequency_error: Option<f64>,
    /// Roots with growth before it and after it.
    pub unstable_roots: [usize; 2],
}

/// The critical point on one grid.
struct OnGrid {
    fraction: f64,
    frequency: f64,
    /// Error of the fraction by interpolation and rounding.
    uncertainty: f64,
    unstable_roots: [usize; 2],
}

/// The critical point next to the first of two points between which the number of roots with growth changes;
/// `None` if it is found on no grid.
pub(crate) fn locate_critical_point(
    family: &LeafFamily,
    ends: [KnownStability; 2],
    tolerance: f64,
) -> Option<MotionCriticalPoint> {
    let leaf = &ends[0].level.leaf;
    let mut grid = Grid::new(SEARCH.coarsest, leaf.leaf.kinks());
    while grid.segments() < SEARCH.coarsest {
        grid = grid.refined();
    }
    let mut series: Vec<(usize, OnGrid)> = Vec::new();
    let mut best = None;
    for _ in 0..SEARCH.grids {
        let mut search = GridSearch::new(family, grid.clone(), &ends);
        let quick = search.is_quick()?;
        if family.limit.reached() || !quick && series.len() >= SEARCH.least_grids {
            break;
        }
        grid = grid.refined();
        let Some(found) = search.locate() else {
            match series.is_empty() {
                true => continue,
                false => break,
            }
        };
        series.push((search.grid.segments(), found));
        let point = extrapolated(&series);
        let bound = |it: &MotionCriticalPoint| it.fraction_error.unwrap_or(f64::INFINITY);
        let error = bound(&point);
        // Rounding grows on finer grids.
        best = match best {
            Some(best) if bound(&best) < error => Some(best),
            _ => Some(point),
        };
        if series.len() >= SEARCH.least_grids && error <= tolerance {
            break;
        }
    }
    best
}

/// Extrapolates the critical point over grids.
fn extrapolated(series: &[(usize, OnGrid)]) -> MotionCriticalPoint {
    let uncertainty = series.iter().map(|(_, it)| it.uncertainty);
    let uncertainty = uncertainty.fold(ROUNDING, f64::max);
    let number = |of: fn(&OnGrid) -> f64, noise: f64| {
        let grids = series.iter().map(|(n, it)| (*n, vec![of(it)]));
        let table = grids.collect::<Richardson>().with_noise(noise);
        let error = table.few_values_error().map(|it| SAFETY * it.error + noise);
        (table.extrapolated()[0], error)
    };
    let (_, last) = &series[series.len() - 1];
    let (fraction, fraction_error) = number(|it| it.fraction, uncertainty);
    let (frequency, frequency_error) = number(|it| it.frequency, uncertainty * last.frequency);
    MotionCriticalPoint {
        kind: match last.frequency > 0.0 {
            true => MotionInstability::Flutter,
            false => MotionInstability::Divergence,
        },
        fraction,
        fraction_error,
        frequency,
        frequency_error,
        unstable_roots: last.unstable_roots,
    }
}

/// A balance on the side with growth.
#[derive(Clone, Copy)]
struct GrowingProbe {
    fraction: f64,
    measure: f64,
    square: Option<f64>,
    frequency: f64,
}

impl GrowingProbe {
    fn new(fraction: f64, motion: GrowingMotion) -> Self {
        GrowingProbe {
            fraction,
            measure: motion.measure,
            square: motion.square,
            frequency: motion.frequency,
        }
    }
}

/// Balances of a family on one grid.
struct GridSearch<'f> {
    family: &'f LeafFamily<'f>,
    grid: Grid,
    /// Balances so far, and states elsewhere to begin with, by their fractions.
    known: Vec<(f64, GridLevel)>,
    ends: [(f64, usize); 2],
    /// So many roots next to zero are computed: the one whose growth begins may be farther off than many others.
    searched_roots: usize,
}

impl<'f> GridSearch<'f> {
    fn new(family: &'f LeafFamily<'f>, grid: Grid, ends: &[KnownStability; 2]) -> Self {
        let known = ends.each_ref().map(|end| {
            let state = transfer(&end.level.leaf, &end.level.state, &grid);
            let leaf = DiscreteLeaf::new(&end.level.leaf.leaf, grid.clone());
            (end.fraction, GridLevel { leaf, state })
        });
        GridSearch {
            family,
            grid,
            known: known.into(),
            ends: ends
                .each_ref()
                .map(|end| (end.fraction, end.unstable_roots)),
            searched_roots: ends[0].searched_roots.max(ends[1].searched_roots),
        }
    }

    /// Whether small motions on this grid take little time; `None` if they are not computed.
    fn is_quick(&self) -> Option<bool> {
        let (_, level) = self.known.first()?;
        has_small_motions(&level.leaf).then(|| has_quick_small_motions(&level.leaf))
    }

    /// The motions that grow about the balance at a fraction.
    fn motions_at(&mut self, fraction: f64) -> Option<GrowingMotions> {
        let leaf = self.family.leaf([fraction]).ok()?;
        if leaf.kinks() != self.known[0].1.leaf.leaf.kinks() {
            return None;
        }
        let mut near: Vec<&(f64, GridLevel)> = self.known.iter().collect();
        near.sort_by(|a, b| (a.0 - fraction).abs().total_cmp(&(b.0 - fraction).abs()));
        let state = match near[..] {
            [one, other, ..] if one.0 != other.0 && one.0 != fraction => {
                let at = (fraction - other.0) / (one.0 - other.0);
                state_on_line(&other.1.state, &one.1.state, at)
            }
            _ => near[0].1.state.clone(),
        };
        let grid = self.grid.clone();
        let level = balance_on_grid(&leaf, StateOnGrid { grid, state }, &self.family.limit)?;
        let motions = growing_motions(&level, 1.0, self.searched_roots, &self.family.limit)?;
        self.known.retain(|(at, _)| *at != fraction);
        self.known.push((fraction, level));
        Some(motions)
    }

    /// Locates the critical point on this grid.
    fn locate(&mut self) -> Option<OnGrid> {
        let [mut from, mut to] = self.ends.map(|end| end.0);
        let width = to - from;
        let mut counts = [self.motions_at(from)?, self.motions_at(to)?];
        let [before, after] = self.ends.map(|end| end.1);
        let (quiet_count, begins) = (before.min(after), before < after);
        for _ in 0..=SEARCH.widenings {
            let [grows_before, grows_after] =
                (counts.each_ref()).map(|it| it.unstable_roots > quiet_count);
            if grows_before != begins && grows_after == begins {
                break;
            }
            // What lies between the ends on finer grids may lie beside them on this one.
            match grows_after == begins {
                false => {
                    to += width;
                    counts[1] = self.motions_at(to)?;
                }
                true => {
                    from -= width;
                    counts[0] = self.motions_at(from)?;
                }
            }
        }
        let [at_start, at_end] = &counts;
        let (mut quiet, mut loud, [still, motions]) = match begins {
            true => (from, to, [at_start, at_end]),
            false => (to, from, [at_end, at_start]),
        };
        if still.unstable_roots > quiet_count || motions.unstable_roots <= quiet_count {
            return None;
        }
        let probe = |fraction: f64, motions: &GrowingMotions| {
            let slowest = motions.slowest()?;
            Some(GrowingProbe::new(fraction, slowest))
        };
        let mut probes = vec![probe(loud, motions)?];
        let mut loud_count = motions.unstable_roots;
        let mut root = Interpolation::of(&probes);
        let (mut best, mut worse) = (None::<Interpolation>, 0);
        for _ in 0..SEARCH.probes {
            if (loud - quiet).abs() <= SEARCH.accuracy {
                break;
            }
            let certain = |it: &Interpolation| {
                let settled = it.uncertainty <= SEARCH.uncertainty || worse >= SEARCH.worse;
                settled && it.lies_between(quiet, loud)
            };
            let found = best.filter(certain);
            let next = match found {
                Some(found) if (found.fraction - quiet).abs() <= SEARCH.confirmed => break,
                // Another motion may begin to grow before the one that was followed.
                Some(found) => found.fraction - 0.5 * SEARCH.confirmed * (loud - quiet).signum(),
                None => {
                    let [low, high] = [quiet.min(loud), quiet.max(loud)];
                    let next = root.fraction + SEARCH.approach * (loud - root.fraction);
                    match next > low && next < high && root.count > 1 && worse < SEARCH.worse {
                        true => next,
                        false => 0.5 * (quiet + loud),
                    }
                }
            };
            let motions = self.motions_at(next)?;
            match motions.unstable_roots > quiet_count {
                true => {
                    loud = next;
                    loud_count = motions.unstable_roots;
                    if found.is_some() {
                        probes.clear();
                        (best, worse) = (None, 0);
                    }
                    probes.push(probe(next, &motions)?);
                    root = Interpolation::of(&probes);
                    match best.is_none_or(|best| root.uncertainty < best.uncertainty) {
                        true => (best, worse) = (Some(root), 0),
                        // Closer to the zero there is only rounding.
                        false => worse += 1,
                    }
                }
                false => quiet = next,
            }
        }
        let best = best.filter(|it| {
            it.uncertainty <= SEARCH.largest_uncertainty && it.lies_between(quiet, loud)
        })?;
        let stiff = self.without_softening(&probes, best);
        Some(OnGrid {
            fraction: stiff.fraction,
            frequency: stiff.frequency,
            uncertainty: UNCERTAINTY_PART * best.uncertainty + self.rounding(&probes, best),
            unstable_roots: match begins {
                true => [quiet_count, loud_count],
                false => [loud_count, quiet_count],
            },
        })
    }
}

impl GridSearch<'_> {
    /// The zero without the compliance by which the matrices of nearly rigid segments are softened: that of
    /// one, two and three times as much of it, extrapolated to none.
    fn without_softening(&self, probes: &[GrowingProbe], root: Interpolation) -> Interpolation {
        let upto = root.last.min(probes.len());
        let nearest = &probes[upto.saturating_sub(Interpolation::MOST)..upto];
        let softer = |times: f64| {
            let softer = |probe: &GrowingProbe| {
                let (_, level) = self.known.iter().find(|(at, _)| *at == probe.fraction)?;
                let motions =
                    growing_motions(level, times, self.searched_roots, &self.family.limit)?;
                Some(GrowingProbe::new(probe.fraction, motions.slowest()?))
            };
            let soft: Option<Vec<GrowingProbe>> = nearest.iter().map(softer).collect();
            soft.map(|probes| Interpolation::of(&probes))
        };
        let rigid = |(_, level): &(f64, GridLevel)| is_softened(level);
        if !self.known.last().is_some_and(rigid) {
            return root;
        }
        match (softer(2.0), softer(3.0)) {
            (Some(twice), Some(thrice)) => {
                let none = |of: fn(&Interpolation) -> f64| {
                    let values = [&root, &twice, &thrice].map(of);
                    let weighted = values.iter().zip(NO_SOFTENING_WEIGHTS);
                    weighted.map(|(value, weight)| weight * value).sum()
                };
                Interpolation {
                    fraction: none(|it| it.fraction),
                    frequency: none(|it| it.frequency),
                    ..root
                }
            }
            _ => root,
        }
    }

    /// The error of the zero by rounding of the matrix.
    fn rounding(&self, probes: &[GrowingProbe], root: Interpolation) -> f64 {
        let rounding = self
            .known
            .last()
            .map_or(0.0, |it| rounding_of_squares(&it.1));
        let amplified = NO_SOFTENING_WEIGHTS.iter().map(|it| it.abs()).sum::<f64>() * rounding;
        let last = root.last.min(probes.len()) - 1;
        let (near, far) = (probes[last], probes[last.saturating_sub(1)]);
        match (near.square, far.square) {
            (Some(one), Some(other)) => {
                amplified * ((near.fraction - far.fraction) / (one - other)).abs()
            }
            _ => {
                amplified
                    * ((near.fraction - root.fraction) / near.measure)
                        .abs()
                        .sqrt()
            }
        }
    }
}

/// Weights of values at softenings of 1, 2 and 3 for extrapolation to none, by a parabola.
const NO_SOFTENING_WEIGHTS: [f64; 3] = [3.0, -3.0, 1.0];

/// The zero of the measure by inverse interpolation through the last probes, and the frequency there.
#[derive(Clone, Copy)]
struct Interpolation {
    /// Number of probes so far, and of those that are used.
    last: usize,
    count: usize,
    fraction: f64,
    frequency: f64,
    /// The difference from the zero through one probe less.
    uncertainty: f64,
}

impl Interpolation {
    /// Largest number of probes that are used.
    const MOST: usize = 4;

    fn of(probes: &[GrowingProbe]) -> Self {
        // Another motion may have been the slowest farther away.
        let last = probes[probes.len() - 1];
        let oscillates = last.frequency > 0.0;
        let alike = |it: &&GrowingProbe| (it.frequency > 0.0) == oscillates;
        let mut near: Vec<GrowingProbe> = (probes.iter().rev())
            .take_while(alike)
            .take(Interpolation::MOST)
            .copied()
            .collect();
        near.dedup_by(|a, b| a.measure <= b.measure);
        let value = |of: fn(&GrowingProbe) -> f64, count: usize| {
            let points: Vec<(f64, f64)> = near
                .iter()
                .take(count)
                .map(|it| (it.measure, of(it)))
                .collect();
            interpolated_at_zero(&points)
        };
        let count = near.len();
        let fraction = value(|it| it.fraction, count);
        let before = value(|it| it.fraction, count - 1);
        Interpolation {
            last: probes.len(),
            count,
            fraction,
            frequency: match oscillates {
                true => value(|it| it.frequency, count).max(f64::MIN_POSITIVE),
                false => 0.0,
            },
            uncertainty: match count {
                1 | 2 => f64::INFINITY,
                _ => (fraction - before).abs(),
            },
        }
    }

    /// Whether the zero lies in a bracket that is narrow enough.
    fn lies_between(&self, quiet: f64, loud: f64) -> bool {
        let width = (loud - quiet).abs();
        let beyond = (self.fraction - loud) * (loud - quiet).signum();
        let within = self.uncertainty.max(SEARCH.accuracy);
        width <= SEARCH.trusted && beyond <= within && beyond >= -width - within
    }
}

/// The value at zero of the polynomial through points (Aitken and Neville); NaN of none.
fn interpolated_at_zero(points: &[(f64, f64)]) -> f64 {
    let mut values: Vec<f64> = points.iter().map(|it| it.1).collect();
    for order in 1..points.len() {
        for k in 0..points.len() - order {
            let (near, far) = (points[k].0, points[k + order].0);
            values[k] = (near * values[k + 1] - far * values[k]) / (near - far);
        }
    }
    values.first().copied().unwrap_or(f64::NAN)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A square root from one side: its square is smooth, and its zero is found to rounding.
    #[test]
    fn zeros_are_interpolated_from_one_side() {
        let probe = |fraction: f64| GrowingProbe {
            fraction,
            measure: (fraction - 0.3) * (2.0 + fraction),
            square: None,
            frequency: 5.0 + fraction * fraction,
        };
        let near = [0.34, 0.308, 0.3016, 0.30032].map(probe);
        let root = Interpolation::of(&near);
        assert!((root.fraction - 0.3).abs() < 1e-9, "{}", root.fraction);
        assert!((root.frequency - 5.09).abs() < 1e-8, "{}", root.frequency);
        assert!(root.uncertainty < 1e-6);
    }
}
