//! The results in words.

use std::collections::BTreeMap;

use super::free::Coordinate;
use super::result::FitParameter;
use crate::numbers::two_digits;

/// An undetermined combination: coordinates and their coefficients.
pub(super) struct Undetermined {
    /// Index of the free number, and its coefficient; the largest is one.
    pub parts: Vec<(usize, f64)>,
    /// Whether the data are completely insensitive to it, or only weakly sensitive.
    pub exactly: bool,
}

/// The combination in the form of the result.
pub(super) fn map(open: &Undetermined, free: &[Coordinate]) -> BTreeMap<String, f64> {
    let part =
        |&(k, part): &(usize, f64)| (free[k].number.to_string(), rounded(part * free[k].unit));
    open.parts.iter().map(part).collect()
}

/// Removes rounding errors from a simple number.
fn rounded(value: f64) -> f64 {
    let digits = (value * 1e4).round() / 1e4;
    if (digits - value).abs() < 1e-4 * value.abs().max(1e-3) {
        digits
    } else {
        value
    }
}

/// Smaller coefficients would be written as zero.
const UNWRITTEN: f64 = 5e-3;

/// A sentence for each number and each undetermined combination.
pub(super) fn sentences(
    parameters: &[FitParameter],
    open: &[Undetermined],
    free: &[Coordinate],
) -> Vec<String> {
    let mut said = Vec::new();
    for (k, parameter) in parameters.iter().enumerate() {
        let (low, high) = match (parameter.low, parameter.high) {
            (Some(low), Some(high)) if parameter.determined => (low, high),
            _ => continue,
        };
        let half = 0.5 * (high - low);
        let key = &parameter.key;
        said.push(match free[k].log {
            true => format!("{key}: to {}", percent(half / parameter.value.abs())),
            false => format!("{key}: to {}", two_digits(half)),
        });
    }
    said.extend(parameters.iter().flat_map(lost));
    for open in open {
        said.push(sentence(open, parameters, free));
    }
    said
}

fn percent(part: f64) -> String {
    match 100.0 * part {
        percent if percent >= 10.0 => format!("{percent:.0} %"),
        percent if percent >= 0.1 => format!("{percent:.1} %"),
        percent => format!("{percent:.3} %"),
    }
}

fn sentence(open: &Undetermined, parameters: &[FitParameter], free: &[Coordinate]) -> String {
    let key = |k: usize| parameters[k].key.as_str();
    let parts = open.parts.iter().copied();
    let parts: Vec<_> = parts.filter(|(_, part)| part.abs() >= UNWRITTEN).collect();
    let all_logs = parts.iter().all(|(k, _)| free[*k].log);
    match parts.as_slice() {
        [(k, _)] if open.exactly => format!("{}: not at all", key(*k)),
        [(k, _)] if is_at_bound(&parameters[*k], &free[*k]) => format!(
            "{}: not, as it stands at its bound {}",
            key(*k),
            digits(parameters[*k].value)
        ),
        [(k, _)] => match (parameters[*k].low, parameters[*k].high) {
            _ if parameters[*k].lost.iter().any(Option::is_some) => {
                format!("{}: not known, as an end of its interval is not", key(*k))
            }
            (Some(low), None) => format!("{}: only that it is above {}", key(*k), two_digits(low)),
            (None, Some(high)) => {
                format!("{}: only that it is below {}", key(*k), two_digits(high))
            }
            _ => format!("{}: hardly, to no better than a factor of ten", key(*k)),
        },
        [(a, one), (b, two)] if all_logs && (one.abs() - two.abs()).abs() < 1e-3 => {
            let only = if one * two > 0.0 { "ratio" } else { "product" };
            let how = if open.exactly { "" } else { "nearly " };
            format!("{} and {}: {how}only as their {only}", key(*a), key(*b))
        }
        parts => {
            // Of numbers that are not logarithms the combination is the tangent.
            let change = |(k, part): &(usize, f64)| match free[*k].log {
                true => format!("{} in proportion to t^{}", key(*k), short(*part)),
                false => format!("{} by {} ln t", key(*k), digits(part * free[*k].unit)),
            };
            let changes: Vec<String> = parts.iter().map(change).collect();
            let unseen = if open.exactly {
                "unseen"
            } else {
                "hardly seen"
            };
            let which = if all_logs { "any t" } else { "t near 1" };
            format!("{unseen}: {} together, for {which}", changes.join(", "))
        }
    }
}

/// Which ends of an interval are not known.
fn lost(parameter: &FitParameter) -> Vec<String> {
    let sides = parameter.lost.iter().zip(["below", "above"]);
    let lost = sides.filter_map(|(lost, side)| Some((digits((*lost)?), side)));
    lost.map(|(lost, side)| {
        format!(
            "{}: where its interval ends {side} is not known: held beyond {lost}, the other numbers \
             could not be fitted",
            parameter.key
        )
    })
    .collect()
}

/// Whether a number stands at a bound that was given.
fn is_at_bound(parameter: &FitParameter, free: &Coordinate) -> bool {
    let bounds = free.bounds.map(|bound| free.value(bound));
    free.bounded && bounds.contains(&parameter.value)
}

/// Three significant digits.
pub(super) fn digits(value: f64) -> f64 {
    format!("{value:.2e}").parse().unwrap_or(value)
}

fn short(value: f64) -> String {
    let text = format!("{value:.2}");
    text.trim_end_matches('0').trim_end_matches('.').into()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What is said of a combination of logarithms.
    fn said(parts: &[(&str, f64)]) -> String {
        let coordinate = |(key, _): &(&str, f64)| Coordinate {
            number: key.parse().unwrap(),
            log: true,
            unit: 1.0,
            bounds: [f64::NEG_INFINITY, f64::INFINITY],
            bounded: false,
            start: 0.0,
        };
        let parameter = |(key, _): &(&str, f64)| FitParameter {
            key: (*key).into(),
            value: 1.0,
            low: None,
            high: None,
            standard_error: None,
            determined: false,
            profiled: false,
            lost: [None; 2],
        };
        let free: Vec<Coordinate> = parts.iter().map(coordinate).collect();
        let parameters: Vec<FitParameter> = parts.iter().map(parameter).collect();
        let coefficients = parts.iter().map(|part| part.1).enumerate();
        let open = Undetermined {
            parts: coefficients.collect(),
            exactly: true,
        };
        sentence(&open, &parameters, &free)
    }

    #[test]
    fn what_does_not_change_is_left_out() {
        let [a, b, c] = ["stiffness.torsion", "stiffness.axial", "coupling.y"];
        let together = said(&[(a, 1.0), (b, 0.002), (c, 0.5)]);
        assert!(together.contains("torsion") && together.contains("t^0.5"));
        assert!(!together.contains("axial"), "{together}");
        assert_eq!(said(&[(a, 1.0), (b, -0.002)]), format!("{a}: not at all"));
        let ratio = said(&[(a, 1.0), (b, 1.0), (c, 0.001)]);
        assert_eq!(ratio, format!("{a} and {b}: only as their ratio"));
    }
}
