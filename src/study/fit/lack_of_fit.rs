//! Whether residuals are systematic: smooth along a column of the data, or along a vein, in place of
//! scattered, as where a machine has slack or the shape at rest is another; and whether the data
//! contradict the model.
//!
//! Residuals are tested for lack of fit against the first cosines along each series of data, less
//! what the free numbers could explain of them: the sum of squares along these over that of all other
//! residuals has Fisher's distribution if errors are independent and normal (Neill and Johnson 1984, Testing
//! for lack of fit in regression, a review). All series together have one level.

use crate::scenario::longest;
use crate::study::fit::columns::{DatumDimension, MeasuredQuantity};
use crate::study::fit::free::FreeParameterTarget;
use crate::study::fit::prediction::{DatumQuantity, ScalarDatum};
use crate::study::fit::result::{FitParameter, SystematicResiduals};
use crate::study::fit::statistics::FitStatistics;
use nalgebra::DVector;
use std::collections::BTreeMap;

/// Levels of the test for lack of fit, and its cosines.
struct LackOfFitTest {
    /// So often residuals of a true model are called systematic.
    level: f64,
    /// Where deviations are given, the p-value below which residuals are smooth beside the others.
    smooth_p_value: f64,
    /// Below this p-value the rest of the residuals is too large for the standard deviations that
    /// are given, and takes their place.
    large_p_value: f64,
    /// The least standard deviation of data, in assumed ones: below it errors of the equilibria
    /// decide.
    least_deviation: f64,
    /// The part of a cosine that free numbers and the cosines before it must leave unexplained.
    least_independent_part: f64,
    /// Largest number of cosines of all series.
    most_cosines: usize,
}

const LACK_OF_FIT: LackOfFitTest = LackOfFitTest {
    level: 5e-3,
    smooth_p_value: 0.05,
    large_p_value: 0.01,
    least_deviation: 1e-2,
    least_independent_part: 0.1,
    most_cosines: 48,
};

/// The number of cosines of a series of so many data.
fn cosine_count(data: usize) -> usize {
    match data {
        0..=3 => 0,
        4..=5 => 1,
        6..=7 => 2,
        8..=11 => 3,
        12..=19 => 4,
        _ => 5,
    }
}

/// The systematic part of the residuals of a minimum, if there is one that is significant.
pub(super) fn systematic_residuals(stats: &FitStatistics) -> Option<SystematicResiduals> {
    let series = data_series(stats);
    let roots = stats.weighting.weight_roots(&stats.residuals);
    let residuals = stats.residuals.component_mul(&roots);
    let mut basis: Vec<DVector<f64>> = (stats.insensitive_count..stats.singular_values.len())
        .map(|k| (&stats.jacobian * stats.singular_directions.column(k)) / stats.singular_values[k])
        .collect();
    let explained = basis.len();
    let most = LACK_OF_FIT.most_cosines.min(stats.degrees_of_freedom / 2);
    // By ascending frequency, so that a limit leaves out the highest.
    let mut energies = vec![0.0; series.len()];
    for frequency in 0..cosine_count(usize::MAX) {
        for (energy, ResidualSeries { places, .. }) in energies.iter_mut().zip(&series) {
            if frequency >= cosine_count(places.len()) || basis.len() - explained >= most {
                continue;
            }
            let mut wave = DVector::zeros(residuals.len());
            let step = std::f64::consts::PI * frequency as f64 / places.len() as f64;
            for (k, place) in places.iter().enumerate() {
                wave[*place] = (step * (k as f64 + 0.5)).cos();
            }
            wave /= wave.norm();
            // Twice is enough (Giraud et al. 2005).
            for _ in 0..2 {
                for known in &basis {
                    let part = known.dot(&wave);
                    wave.axpy(-part, known, 1.0);
                }
            }
            let left = wave.norm();
            if left > LACK_OF_FIT.least_independent_part {
                wave /= left;
                *energy += wave.dot(&residuals).powi(2);
                basis.push(wave);
            }
        }
    }
    let count = basis.len() - explained;
    let rest = stats
        .degrees_of_freedom
        .checked_sub(count)
        .filter(|rest| *rest > 0)?;
    if count == 0 {
        return None;
    }
    let smooth: f64 = energies.iter().sum();
    let scattered = (residuals.norm_squared() - smooth).max(0.0) / rest as f64;
    let is_as_given = stats.has_known_deviations
        && f_distribution_tail(scattered, rest, None) > LACK_OF_FIT.large_p_value;
    // Deviations that are given too small make all residuals too large, and none of them smooth.
    let among_residuals = f_distribution_tail(smooth / count as f64 / scattered, count, Some(rest));
    let p_value = match is_as_given {
        true if among_residuals > LACK_OF_FIT.smooth_p_value => return None,
        true => f_distribution_tail(smooth / count as f64, count, None),
        false => {
            let least = if stats.has_known_deviations {
                1.0
            } else {
                LACK_OF_FIT.least_deviation.powi(2)
            };
            let ratio = smooth / count as f64 / scattered.max(least);
            f_distribution_tail(ratio, count, Some(rest))
        }
    };
    if p_value >= LACK_OF_FIT.level {
        return None;
    }
    let mut along: Vec<String> = Vec::new();
    let largest = energies
        .iter()
        .fold(0.0_f64, |most, energy| most.max(*energy));
    let named = energies.iter().zip(&series);
    for (_, ResidualSeries { name, .. }) in named.filter(|(energy, _)| **energy > 0.25 * largest) {
        if !along.contains(name) {
            along.push(name.clone());
        }
    }
    Some(SystematicResiduals {
        p_value,
        along,
        // As if all of it were one error.
        widened: (smooth.sqrt() / stats.residual_deviation).max(1.0),
    })
}

/// A series of data along which residuals may be smooth.
struct ResidualSeries {
    name: String,
    /// Places among all data, in the order of the series.
    places: Vec<usize>,
}

/// The data in series: results in the order of the experiments and in that of their predictions, points
/// of a vein from its base to its tip.
fn data_series(stats: &FitStatistics) -> Vec<ResidualSeries> {
    let components: Vec<_> = stats.point.components().collect();
    let mut all: BTreeMap<(String, usize, usize), Vec<usize>> = BTreeMap::new();
    for (place, component) in components.iter().enumerate() {
        // Normal to a vein a point has one residual, along it none.
        if component.is_uninformative {
            continue;
        }
        let column = component.quantity.column();
        let key = match component.quantity {
            DatumQuantity::Result(_) => (column, 0, 0),
            DatumQuantity::Vein { rod, .. } => (column, component.experiment + 1, rod + 1),
        };
        all.entry(key).or_default().push(place);
    }
    let mut found = Vec::new();
    for ((column, experiment, rod), mut places) in all {
        if experiment > 0 {
            let sigma = |place: &usize| match components[*place].quantity {
                DatumQuantity::Vein { sigma, .. } => sigma,
                DatumQuantity::Result(_) => 0.0,
            };
            places.sort_by(|a, b| sigma(a).total_cmp(&sigma(b)));
            found.push(ResidualSeries {
                name: format!("{column} of vein {rod}"),
                places,
            });
            continue;
        }
        places.sort_by_key(|place| components[*place].experiment);
        let mut by_size = places.clone();
        by_size.sort_by(|a, b| components[*a].model.total_cmp(&components[*b].model));
        let same = by_size == places || by_size.iter().rev().eq(&places);
        found.push(ResidualSeries {
            name: column.clone(),
            places,
        });
        if !same {
            found.push(ResidualSeries {
                name: column,
                places: by_size,
            });
        }
    }
    found
}

/// Widens the intervals of numbers, none of which is then determined. Standard errors stay those of
/// independent errors, as covariances and bands are.
pub(super) fn widen_intervals(stats: &FitStatistics, parameters: &mut [FitParameter], by: f64) {
    let all = parameters.iter_mut().zip(stats.model.coordinates);
    for ((parameter, free), theta) in all.zip(&stats.point.theta) {
        let [low, high] = free.bounds;
        let end = |end: f64| {
            let wider = theta + by * (free.transform(end) - theta);
            free.inverse_transform(wider.clamp(low, high))
        };
        parameter.low = parameter.low.map(end);
        parameter.high = parameter.high.map(end);
        parameter.determined = false;
    }
}

/// What the model may lack, in words.
pub(super) fn systematic_residuals_sentence(
    stats: &FitStatistics,
    found: &SystematicResiduals,
) -> String {
    let along = found.along.join(", ");
    let cases = stats.model.cases.iter();
    let mut settings = cases.flat_map(|case| case.settings());
    // Where a holder was moved, it may have moved some way before it pulled.
    let moved = settings.find(|(keys, _)| {
        let name = keys.to_string();
        let free = stats.model.coordinates.iter();
        let mut free = free.map(|free| &free.number);
        let is_free = free.any(|free: &FreeParameterTarget| free.is_offset_of(keys));
        (name.starts_with("tip.position") || name.contains(".move")) && !is_free
    });
    let slack = match moved {
        Some((keys, _)) => format!("slack (offset:{keys} is not free)"),
        None => "a zero that is off".into(),
    };
    format!(
        "systematic: residuals of {along} are smooth, not scattered (by chance with p = {:.1e}): {slack}, rest \
         shape, taper, direction of a load? Intervals are {:.1} times those of independent errors",
        found.p_value, found.widened
    )
}

/// The probability that a mean square with some degrees of freedom is at least `ratio` times that of others,
/// or of their known expectation (Abramowitz and Stegun, 26.6.2 and 26.5.8).
fn f_distribution_tail(ratio: f64, freedom: usize, of: Option<usize>) -> f64 {
    /// So many degrees of freedom have no uncertainty.
    const INFINITE_DEGREES_OF_FREEDOM: f64 = 1e6;
    let [one, other] = [
        freedom as f64,
        of.map_or(INFINITE_DEGREES_OF_FREEDOM, |of| of as f64),
    ];
    if !ratio.is_finite() {
        return if ratio > 0.0 { 0.0 } else { 1.0 };
    }
    let x = other / (other + one * ratio);
    incomplete_beta(x, 1.0 - x, 0.5 * other, 0.5 * one)
}

/// The regularized incomplete beta function at `x`, of which `y` is the complement.
fn incomplete_beta(x: f64, y: f64, a: f64, b: f64) -> f64 {
    if x <= 0.0 || y <= 0.0 {
        return if x <= 0.0 { 0.0 } else { 1.0 };
    }
    if x > (a + 1.0) / (a + b + 2.0) {
        return 1.0 - incomplete_beta(y, x, b, a);
    }
    let log = log_gamma(a + b) - log_gamma(a) - log_gamma(b) + a * x.ln() + b * y.ln();
    // The continued fraction by the method of Lentz.
    let tiny = f64::MIN_POSITIVE.sqrt();
    let clear = |value: f64| if value.abs() < tiny { tiny } else { value };
    let (mut c, mut d) = (1.0, 1.0 / clear(1.0 - (a + b) * x / (a + 1.0)));
    let mut fraction = d;
    for step in 1..10_000 {
        let m = f64::from(step);
        let even = m * (b - m) * x / ((a + 2.0 * m - 1.0) * (a + 2.0 * m));
        let odd = -(a + m) * (a + b + m) * x / ((a + 2.0 * m) * (a + 2.0 * m + 1.0));
        let mut change = 1.0;
        for term in [even, odd] {
            d = 1.0 / clear(1.0 + term * d);
            c = clear(1.0 + term / c);
            change = c * d;
            fraction *= change;
        }
        if (change - 1.0).abs() < 1e-12 {
            break;
        }
    }
    (log.exp() * fraction / a).clamp(0.0, 1.0)
}

/// The logarithm of the gamma function of a positive number (Stirling's series; Abramowitz and Stegun,
/// 6.1.41).
fn log_gamma(z: f64) -> f64 {
    let (mut z, mut shift) = (z, 0.0);
    while z < 10.0 {
        shift -= z.ln();
        z += 1.0;
    }
    let inverse = 1.0 / (z * z);
    let series = 1.0 / 12.0 - inverse * (1.0 / 360.0 - inverse * (1.0 / 1260.0 - inverse / 1680.0));
    shift + (z - 0.5) * z.ln() - z + 0.5 * std::f64::consts::TAU.ln() + series / z
}

/// Coordinates this far from the fitted leaf, in lengths of the longest rod, are hardly those of
/// this leaf under these loads; and this far from the base, not of any leaf of this length.
const FAR_FROM_MODEL: f64 = 0.5;

pub(super) const FAR_FROM_BASE: f64 = 3.0;

/// Data that are far from the model: coordinates by a part of the leaf's length, and frequencies by
/// that part of the larger one.
pub(super) fn data_far_from_model<'s>(
    stats: &'s FitStatistics,
) -> impl Iterator<Item = &'s ScalarDatum> {
    let longest = longest(&stats.model.base.scenario().rods);
    let pixel = stats.model.initial_pixel_length();
    stats.point.components().filter(move |component| {
        let (data, model) = (component.observed.abs(), component.model.abs());
        let size = match component.quantity {
            DatumQuantity::Vein { .. }
                if component.quantity.dimension() == DatumDimension::Pixel =>
            {
                longest / pixel
            }
            DatumQuantity::Vein { .. } | DatumQuantity::Result(MeasuredQuantity::Tip(_)) => longest,
            DatumQuantity::Result(MeasuredQuantity::Frequency(_)) => data.max(model),
            DatumQuantity::Result(MeasuredQuantity::Reaction(_) | MeasuredQuantity::Grip(..)) => {
                f64::INFINITY
            }
        };
        let beyond = component.quantity.dimension() == DatumDimension::Length
            && data > FAR_FROM_BASE * longest;
        beyond || (component.observed - component.model).abs() > FAR_FROM_MODEL * size
    })
}

/// Whether the residuals are those of a model that does not describe the data: beyond what their
/// standard deviations allow, or, without these, as large as the leaf.
pub(super) fn data_contradict_model(stats: &FitStatistics) -> bool {
    let robust = stats.weighting.is_robust;
    if stats.has_known_deviations && !robust {
        return stats.has_excessive_residuals();
    }
    // A robust fit has outliers.
    let permitted = match robust {
        true => stats.residuals.len() / 2,
        false => 0,
    };
    data_far_from_model(stats).count() > permitted
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Quantiles of tables of Fisher's distribution and of chi squared.
    #[test]
    fn tails_are_those_of_tables() {
        for (ratio, freedom, of, wanted) in [
            (6.5914, 3, Some(4), 0.05),
            (2.7109, 5, Some(20), 0.05),
            (12.06, 3, Some(5), 0.01),
            (11.345 / 3.0, 3, None, 0.01),
            (2.706, 1, None, 0.1),
            (124.342 / 100.0, 100, None, 0.05),
        ] {
            let found = f_distribution_tail(ratio, freedom, of);
            assert!((found / wanted - 1.0).abs() < 2e-2, "{ratio}: {found}");
        }
    }
}
