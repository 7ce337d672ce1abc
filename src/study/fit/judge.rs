//! What the data determine: intervals, correlations, and combinations that stay open.

use nalgebra::{DMatrix, DVector};

use super::candidates;
use super::data::Experiment;
use super::free::Coordinate;
use super::least_squares::{End, Iteration, Weighing};
use super::model::{Model, Point, What};
use super::result::{Fit, FitLeaf, FitOutcome, FitParameter, FitResidual, FitWork};
use super::words::{self, Open};
use crate::relax::Lost;

/// Singular values below this part of the largest are those of combinations that the
/// data do not feel at all; derivatives are known better than that.
const NULL: f64 = 1e-7;

/// A number whose component in such combinations is larger than this is not
/// determined.
const TAKES_PART: f64 = 1e-3;

/// Components of a combination smaller than this part of its largest are left out.
const NEGLIGIBLE: f64 = 1e-3;
const NEGLIGIBLE_ROUGHLY: f64 = 0.1;

/// Half of a 95 % interval, in standard deviations of a normal number.
pub(super) const NORMAL: f64 = 1.959_963_984_540_054;

/// A number that may be this far off, in logarithms or units, is not determined: a
/// factor of ten.
const OPEN: f64 = std::f64::consts::LN_10;

/// The sum of squares at the ends of an interval may be off by this part before the
/// interval is taken from the profile of the sum.
const STRAIGHT: f64 = 0.15;

/// Steps to an end of a profile, iterations at each, and how exactly it is found.
const PROFILE_STEPS: usize = 12;
const PROFILE_ITERATIONS: usize = 12;
const PROFILE_ACCURACY: f64 = 0.01;

/// How often leaves may be lost on the way to an end of a profile.
const MOST_LOST: usize = 3;

/// The minimum and what surrounds it.
pub(super) struct Judge<'m, 'a> {
    pub model: &'m Model<'a>,
    weighing: Weighing,
    known: bool,
    pub point: &'m Point,
    evaluations: usize,
    residuals: DVector<f64>,
    pub jacobian: DMatrix<f64>,
    /// Directions of the coordinates, ascending in what the data say about them, and
    /// the singular values.
    pub directions: DMatrix<f64>,
    pub values: Vec<f64>,
    /// Directions that are not felt: the first so many.
    pub unfelt: usize,
    /// Data less determined combinations.
    freedom: usize,
    /// Standard deviation of residuals.
    pub spread: f64,
    /// Half of a 95 % interval in standard deviations.
    quantile: f64,
}

impl<'m, 'a> Judge<'m, 'a> {
    pub fn new(
        model: &'m Model<'a>,
        weighing: Weighing,
        known: bool,
        point: &'m Point,
        evaluations: usize,
    ) -> Self {
        let residuals = weighing.residuals(point);
        let roots = weighing.roots(&residuals);
        let mut jacobian = match point.gradients().next() {
            Some(_) => weighing.jacobian(point),
            None => DMatrix::zeros(residuals.len(), point.theta.len()),
        };
        for (mut row, root) in jacobian.row_iter_mut().zip(roots.iter()) {
            row *= *root;
        }
        let (values, directions) = singular(&jacobian);
        let largest = values.last().copied().unwrap_or(0.0);
        let unfelt = values
            .iter()
            .filter(|value| **value <= NULL * largest)
            .count();
        let count = point
            .components()
            .filter(|component| !component.free)
            .count();
        let freedom = count.saturating_sub(values.len() - unfelt);
        let weighed = residuals.component_mul(&roots);
        let (spread, quantile) = match known || freedom == 0 {
            true => (1.0, NORMAL),
            false => {
                let mean = weighed.norm_squared() / freedom as f64;
                (mean.sqrt(), student(freedom))
            }
        };
        Judge {
            model,
            weighing,
            known,
            point,
            evaluations,
            residuals,
            jacobian,
            directions,
            values,
            unfelt,
            freedom,
            spread,
            quantile,
        }
    }

    /// The result.
    pub fn fit(
        mut self,
        end: &End,
        wanted: &[Experiment],
        progress: &mut dyn FnMut(usize, f64),
    ) -> Fit {
        let base = self.model.base;
        let coordinates = self.model.coordinates;
        let mut remarks = self.remarks(end);
        let parameters: Vec<FitParameter> = (0..coordinates.len())
            .map(|k| self.parameter(k, *end == End::Converged, progress))
            .collect();
        let open = self.open(&parameters);
        let keys: Vec<String> = coordinates
            .iter()
            .map(|free| free.keys.to_string())
            .collect();
        let logs: Vec<bool> = coordinates.iter().map(|free| free.log).collect();
        let units: Vec<f64> = coordinates.iter().map(unit).collect();
        let outcome = match end {
            End::Converged if open.is_empty() && parameters.iter().all(|p| p.determined) => {
                FitOutcome::Converged
            }
            End::Converged => FitOutcome::Undetermined,
            _ => FitOutcome::NotConverged,
        };
        let candidates = match candidates::judge(&self, wanted) {
            Ok(candidates) => candidates,
            Err(refused) => {
                remarks.push(format!("candidates: {refused}"));
                Vec::new()
            }
        };
        let values: Vec<(&crate::study::Keys, f64)> = (coordinates.iter().zip(&self.point.theta))
            .map(|(free, theta)| (&free.keys, free.value(*theta)))
            .collect();
        Fit {
            scenario: base.scenario().name.clone(),
            outcome,
            remarks,
            correlations: self.correlations(&parameters),
            undetermined: open
                .iter()
                .map(|open| words::map(open, &keys, &units))
                .collect(),
            says: words::says(&parameters, &open, &logs),
            parameters,
            chi_squared: match self.known {
                true => self.residuals.norm_squared(),
                // In units of the deviation that they tell themselves.
                false => self.residuals.norm_squared() / self.spread.powi(2).max(f64::MIN_POSITIVE),
            },
            degrees_of_freedom: self.freedom,
            standard_deviation: (!self.known).then_some(self.spread * self.weighing.assumed),
            residuals: self.compared(),
            candidates,
            work: FitWork {
                evaluations: self.evaluations,
                last: Model::work(self.point),
            },
            wall_seconds: 0.0,
            fitted: base.toml(&values).unwrap_or_default(),
            leaves: self.leaves(),
        }
    }

    fn remarks(&self, end: &End) -> Vec<String> {
        let mut remarks = Vec::new();
        match end {
            End::Converged => {}
            End::MostSteps => remarks.push(
                "the step limit came before the minimum: start from values nearer to it".into(),
            ),
            End::Stuck(Some(Lost::Elsewhere)) => remarks.push(
                "the way to smaller residuals ends where a leaf jumps to another equilibrium, and is not \
                 followed there: start from other values, or leave out experiments beyond the jump"
                    .into(),
            ),
            End::Stuck(Some(Lost::NotAtRest(why))) => {
                remarks.push(format!("the way to smaller residuals ends: {why}"));
            }
            End::Stuck(None) => remarks.push("no step makes the residuals smaller".into()),
        }
        for (free, theta) in self.model.coordinates.iter().zip(&self.point.theta) {
            let bound = free.bounds.iter().find(|bound| *bound == theta);
            if let Some(bound) = bound {
                let (keys, bound) = (&free.keys, free.value(*bound));
                remarks.push(match free.bounded {
                    true => format!("{keys} is at its bound {bound}"),
                    false => format!("{keys} went as far as {bound:.3e}, and was let no farther"),
                });
            }
        }
        if self.freedom == 0 {
            remarks.push(
                "there are as many numbers as data: nothing is left to judge the fit by".into(),
            );
        }
        remarks
    }

    /// Standard deviation of a coordinate, and what goes with its change in the others.
    fn deviation(&self, k: usize) -> (f64, DVector<f64>) {
        let felt = self.unfelt..self.values.len();
        let mut along = DVector::zeros(self.values.len());
        for direction in felt {
            let v = self.directions.column(direction);
            along += v * (v[k] * (self.spread / self.values[direction]).powi(2));
        }
        let variance = along[k];
        match variance > 0.0 {
            true => (variance.sqrt(), along / variance),
            false => (0.0, along),
        }
    }

    /// The component of a coordinate in combinations that are not felt.
    fn takes_part(&self, k: usize) -> f64 {
        let unfelt = (0..self.unfelt).map(|direction| self.directions[(k, direction)].powi(2));
        unfelt.sum::<f64>().sqrt()
    }

    fn parameter(
        &mut self,
        k: usize,
        converged: bool,
        progress: &mut dyn FnMut(usize, f64),
    ) -> FitParameter {
        let free = &self.model.coordinates[k];
        let theta = self.point.theta[k];
        let mut parameter = FitParameter {
            key: free.keys.to_string(),
            value: free.value(theta),
            low: None,
            high: None,
            determined: false,
            profiled: false,
        };
        let bound = |bound: f64| free.bounded.then(|| free.value(bound));
        if self.takes_part(k) > TAKES_PART {
            [parameter.low, parameter.high] = free.bounds.map(bound);
            return parameter;
        }
        let (deviation, along) = self.deviation(k);
        let half = self.quantile * deviation;
        let mut ends = [Some(theta - half), Some(theta + half)];
        if converged && half < OPEN && !self.straight(&along, half) {
            let found = [-1.0, 1.0].map(|sign| self.profile(k, (sign * half, &along), progress));
            // Where the profile cannot be followed the curvature is all that is known.
            if let [Some(low), Some(high)] = found {
                parameter.profiled = true;
                ends = [low, high];
            }
        }
        let [low, high] = ends.map(|end| end.map(|end| end.clamp(free.bounds[0], free.bounds[1])));
        let reach = |end: Option<f64>| end.map_or(f64::INFINITY, |end| (end - theta).abs());
        parameter.determined = reach(ends[0]).max(reach(ends[1])) <= OPEN;
        parameter.low = low.map(|low| free.value(low));
        parameter.high = high.map(|high| free.value(high));
        // It would go on beyond where it was let.
        let [ran_down, ran_up] = free.bounds.map(|bound| !free.bounded && bound == theta);
        if ran_down || ran_up {
            parameter.determined = false;
            parameter.low = parameter.low.filter(|_| !ran_down);
            parameter.high = parameter.high.filter(|_| !ran_up);
        }
        parameter
    }

    /// The standard deviation of a candidate's datum: of lengths, or of frequencies, as
    /// those of the fit.
    pub fn assumed(&self, length: bool) -> Option<f64> {
        let alike = |component: &&super::model::Component| match component.what {
            What::Result(quantity) => quantity.is_length() == length,
            What::Vein { .. } => length,
        };
        let alike = self.point.components().filter(alike);
        let mut sds: Vec<f64> = alike
            .map(|c| c.sd.unwrap_or(self.spread * self.weighing.assumed))
            .collect();
        sds.sort_by(f64::total_cmp);
        sds.get(sds.len() / 2).copied()
    }

    /// How far the sum of squares is above the minimum, in squared spreads.
    fn above(&self, point: &Point) -> f64 {
        let residuals = self.weighing.residuals(point);
        let bound = self.weighing.bound(&self.residuals);
        let sum = |residuals: &DVector<f64>| self.weighing.sum(residuals, bound);
        (sum(&residuals) - sum(&self.residuals)) / self.spread.powi(2)
    }

    /// Whether the sum of squares is, at the ends of an interval, what the curvature at
    /// the minimum makes of it.
    fn straight(&self, along: &DVector<f64>, half: f64) -> bool {
        let expected = self.quantile.powi(2);
        [-half, half].into_iter().all(|step| {
            let theta = self.moved(along, step);
            let above = self
                .model
                .follow(self.point, &theta)
                .map(|point| self.above(&point));
            above.is_ok_and(|above| (above / expected - 1.0).abs() < STRAIGHT)
        })
    }

    fn moved(&self, along: &DVector<f64>, step: f64) -> Vec<f64> {
        let coordinates = self.model.coordinates.iter().enumerate();
        coordinates
            .map(|(k, free)| {
                let moved = self.point.theta[k] + step * along[k];
                moved.clamp(free.bounds[0], free.bounds[1])
            })
            .collect()
    }

    /// The end of an interval: where the least sum of squares over all others is as far
    /// above the minimum as at the end of a normal one; none within if that is farther
    /// than [`OPEN`]. `None` if the leaves cannot be followed there.
    fn profile(
        &self,
        k: usize,
        (first, along): (f64, &DVector<f64>),
        progress: &mut dyn FnMut(usize, f64),
    ) -> Option<Option<f64>> {
        let sign = first.signum();
        let (mut inside, mut outside): ((f64, f64), Option<(f64, f64)>) = ((0.0, 0.0), None);
        let mut reach = first.abs();
        let most = OPEN + 0.1;
        let mut lost = 0;
        for _ in 0..PROFILE_STEPS {
            let start = self.moved(along, sign * reach);
            let start = self.model.follow(self.point, &start);
            let least = start.ok().map(|start| {
                let mut iteration = Iteration::new(self.model, self.weighing, progress);
                iteration.held[k] = true;
                iteration.most_steps = PROFILE_ITERATIONS;
                iteration.run(start)
            });
            let Some((least, End::Converged | End::MostSteps, _)) = least else {
                lost += 1;
                if lost > MOST_LOST {
                    return None;
                }
                reach = 0.5 * (inside.0 + reach);
                continue;
            };
            let root = self.above(&least).max(0.0).sqrt();
            if (root / self.quantile - 1.0).abs() < PROFILE_ACCURACY {
                return Some(Some(self.point.theta[k] + sign * reach));
            }
            match root < self.quantile {
                true => inside = (reach, root),
                false => outside = Some((reach, root)),
            }
            reach = match outside {
                None if reach >= most => return Some(None),
                None => (reach * (self.quantile / root.max(0.3 * self.quantile)) * 1.05).min(most),
                // The root of the sum is nearly linear.
                Some(outside) => {
                    let part = (self.quantile - inside.1) / (outside.1 - inside.1);
                    inside.0 + part.clamp(0.1, 0.9) * (outside.0 - inside.0)
                }
            };
        }
        let (end, _) = outside?;
        Some(Some(self.point.theta[k] + sign * end))
    }

    /// Combinations that stay open: those that are not felt, in their sparsest form, and
    /// those that may be off by more than a factor of ten.
    fn open(&self, parameters: &[FitParameter]) -> Vec<Open> {
        let mut open: Vec<Open> = sparse(&self.directions.columns(0, self.unfelt).into_owned())
            .into_iter()
            .map(|parts| Open {
                parts,
                exactly: true,
            })
            .collect();
        for direction in self.unfelt..self.values.len() {
            if self.quantile * self.spread / self.values[direction] > OPEN {
                let v = self.directions.column(direction);
                let largest = v.amax();
                let sign = v
                    .iter()
                    .find(|part| part.abs() == largest)
                    .map_or(1.0, |p| p.signum());
                let parts = v.iter().map(|part| sign * part / largest).enumerate();
                let parts = parts.filter(|(_, part)| part.abs() > NEGLIGIBLE_ROUGHLY);
                open.push(Open {
                    parts: parts.collect(),
                    exactly: false,
                });
            }
        }
        // A number of which only the profile has no end.
        for (k, parameter) in parameters.iter().enumerate() {
            let named = |open: &Open| open.parts.iter().any(|(part, _)| *part == k);
            if !parameter.determined && !open.iter().any(named) {
                open.push(Open {
                    parts: vec![(k, 1.0)],
                    exactly: false,
                });
            }
        }
        open
    }

    fn correlations(&self, parameters: &[FitParameter]) -> Vec<Vec<Option<f64>>> {
        let count = parameters.len();
        let deviations: Vec<_> = (0..count).map(|k| self.deviation(k)).collect();
        let entry = |a: usize, b: usize| {
            let felt = |k: usize| self.takes_part(k) <= TAKES_PART;
            let ((own, along), (other, _)) = (&deviations[a], &deviations[b]);
            let known = felt(a) && felt(b) && *own > 0.0 && *other > 0.0;
            // along is the covariance with a over its variance.
            known.then(|| (along[b] * own / other).clamp(-1.0, 1.0))
        };
        let row = |a: usize| (0..count).map(|b| entry(a, b)).collect();
        (0..count).map(row).collect()
    }

    /// Half of the model's 95 % band at each datum.
    fn bands(&self) -> Vec<f64> {
        let roots = self.weighing.roots(&self.residuals);
        let components = self.point.components().enumerate();
        components
            .map(|(i, component)| {
                let row = self.jacobian.row(i);
                let felt = self.unfelt..self.values.len();
                let variance: f64 = felt
                    .map(|direction| {
                        let v = self.directions.column(direction);
                        ((row * v)[(0, 0)] / self.values[direction]).powi(2)
                    })
                    .sum();
                let sd = component.sd.unwrap_or(self.weighing.assumed);
                self.quantile * self.spread * variance.sqrt() * sd / roots[i]
            })
            .collect()
    }

    fn compared(&self) -> Vec<FitResidual> {
        let bands = self.bands();
        (self.point.components().zip(bands))
            .map(|(component, band)| {
                let sd = component.sd.unwrap_or(self.spread * self.weighing.assumed);
                let (what, rod, sigma) = match component.what {
                    What::Result(quantity) => (quantity.to_string(), None, None),
                    What::Vein { rod, axis, sigma } => {
                        (["x", "y", "z"][axis].into(), Some(rod + 1), Some(sigma))
                    }
                };
                FitResidual {
                    experiment: self.model.cases[component.case].name.clone(),
                    what,
                    rod,
                    sigma,
                    data: component.observed,
                    model: component.model,
                    band,
                    sd,
                    residual: (component.observed - component.model) / sd,
                }
            })
            .collect()
    }

    fn leaves(&self) -> Vec<(String, FitLeaf)> {
        let cases = self.model.cases.iter().zip(&self.point.cases);
        cases
            .filter_map(|(case, at)| {
                let finest = at.at.levels.last()?;
                let length = finest.leaf.leaf.scale.length;
                let nodes = finest.leaf.segments() + 1;
                let curves = finest.state.x.chunks(nodes);
                let curves = curves.map(|rod| rod.iter().map(|x| *x * length).collect());
                let leaf = FitLeaf {
                    curves: curves.collect(),
                    traced: case
                        .traced
                        .iter()
                        .map(|traced| (traced.rod, traced.at))
                        .collect(),
                };
                Some((case.name.clone(), leaf))
            })
            .collect()
    }
}

/// By what a coefficient of a coordinate's combination is one of its number.
fn unit(free: &Coordinate) -> f64 {
    1.0 / free.unit
}

/// Singular values, ascending, and their right singular vectors as columns.
pub(super) fn singular(jacobian: &DMatrix<f64>) -> (Vec<f64>, DMatrix<f64>) {
    let count = jacobian.ncols();
    // With rows of zeros there are as many values as columns.
    let rows = jacobian.nrows().max(count);
    let square = jacobian.clone().resize_vertically(rows, 0.0);
    let svd = square.svd(false, true);
    let rows = svd.v_t.unwrap_or_else(|| DMatrix::identity(count, count));
    let mut order: Vec<usize> = (0..count).collect();
    order.sort_by(|a, b| svd.singular_values[*a].total_cmp(&svd.singular_values[*b]));
    let values = order.iter().map(|&k| svd.singular_values[k]).collect();
    let directions = DMatrix::from_fn(count, count, |r, c| rows[(order[c], r)]);
    (values, directions)
}

/// A basis of a space of directions in which as many components as possible are
/// zero: its reduced echelon form.
fn sparse(space: &DMatrix<f64>) -> Vec<Vec<(usize, f64)>> {
    let mut rows = space.transpose();
    let (count, width) = rows.shape();
    let mut pivots: Vec<usize> = Vec::new();
    for row in 0..count {
        let free = (0..width).filter(|k| !pivots.contains(k));
        let largest = free
            .flat_map(|k| (row..count).map(move |r| (r, k)))
            .max_by(|a, b| rows[*a].abs().total_cmp(&rows[*b].abs()));
        let Some((from, column)) = largest else { break };
        rows.swap_rows(row, from);
        pivots.push(column);
        let pivot = rows[(row, column)];
        rows.row_mut(row).scale_mut(1.0 / pivot);
        let own = rows.row(row).into_owned();
        for other in (0..count).filter(|other| *other != row) {
            let part = rows[(other, column)];
            let mut target = rows.row_mut(other);
            target -= &own * part;
        }
    }
    let parts = |row: usize| {
        let largest = rows.row(row).amax();
        let all = (0..width).map(|k| (k, rows[(row, k)] / largest));
        all.filter(|(_, part)| part.abs() > NEGLIGIBLE).collect()
    };
    let mut all: Vec<Vec<(usize, f64)>> = (0..count).map(parts).collect();
    all.sort_by_key(|parts| parts.first().map_or(0, |part| part.0));
    all
}

/// Half of a 95 % interval in standard deviations, if these are estimated from so many
/// degrees of freedom (Student's distribution; Cornish and Fisher's expansion).
fn student(freedom: usize) -> f64 {
    const FEW: [f64; 4] = [12.706_2, 4.302_7, 3.182_4, 2.776_4];
    if let Some(quantile) = FEW.get(freedom.wrapping_sub(1)) {
        return *quantile;
    }
    let (z, n) = (NORMAL, freedom as f64);
    let z2 = z * z;
    z + z * (z2 + 1.0) / (4.0 * n)
        + z * (5.0 * z2 * z2 + 16.0 * z2 + 3.0) / (96.0 * n * n)
        + z * (3.0 * z2.powi(3) + 19.0 * z2 * z2 + 17.0 * z2 - 15.0) / (384.0 * n.powi(3))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Quantiles of tables of Student's distribution.
    #[test]
    fn quantiles_of_students_distribution() {
        for (freedom, quantile) in [
            (1, 12.706),
            (4, 2.776),
            (5, 2.571),
            (10, 2.228),
            (30, 2.042),
            (1_000_000, 1.960),
        ] {
            assert!((student(freedom) - quantile).abs() < 2e-3, "{freedom}");
        }
    }

    #[test]
    fn a_space_of_directions_has_a_sparse_basis() {
        // Spanned by (1, 1, 0, 0) and (0, 0, 1, -2), mixed.
        let space = DMatrix::from_column_slice(4, 2, &[1.0, 1.0, 1.0, -2.0, 2.0, 2.0, -1.0, 2.0]);
        let basis = sparse(&space);
        assert_eq!(
            basis[0].iter().map(|part| part.0).collect::<Vec<_>>(),
            [0, 1]
        );
        assert!((basis[0][0].1 - basis[0][1].1).abs() < 1e-12);
        assert!((basis[1][0].1 + 0.5).abs() < 1e-12 && basis[1][1].1 == 1.0);
    }

    #[test]
    fn rows_fewer_than_columns_leave_directions_unfelt() {
        let (values, directions) = singular(&DMatrix::from_row_slice(1, 2, &[3.0, 4.0]));
        assert!(values[0] < 1e-12 && (values[1] - 5.0).abs() < 1e-12);
        let unfelt = directions.column(0);
        assert!((3.0 * unfelt[0] + 4.0 * unfelt[1]).abs() < 1e-12);
    }
}
