//! From the values of a varied number to a page: cells, ticks, names.

use super::super::ticks::{round_step, ticks};
use crate::report::numbers::superscript;
use crate::study::Vary;

/// One axis, its first value at the part 0 of a length and its last at 1.
pub struct Axis {
    /// Ends of the cells, one more than there are.
    edges: Vec<f64>,
    /// Of a logarithmic axis: that of all its values.
    sign: Option<f64>,
    /// The values, if they are whole numbers.
    whole: Option<Vec<f64>>,
    /// What varies.
    pub name: String,
}

impl Axis {
    pub fn of(vary: &Vary) -> Self {
        let sign = vary.log.then(|| vary.values[0].signum());
        let scale = |value: &f64| match sign {
            Some(sign) => (sign * value).log10(),
            None => *value,
        };
        let places: Vec<f64> = vary.values.iter().map(scale).collect();
        let middle: Vec<f64> = places.windows(2).map(|p| 0.5 * (p[0] + p[1])).collect();
        let (first, last) = (places[0], places[places.len() - 1]);
        let edges = match (middle.first(), middle.last()) {
            (Some(low), Some(high)) => {
                let ends = (2.0 * first - low, 2.0 * last - high);
                [vec![ends.0], middle, vec![ends.1]].concat()
            }
            _ => vec![first - 0.5, first + 0.5],
        };
        Axis {
            edges,
            sign,
            whole: vary.keys.is_whole().then(|| vary.values.clone()),
            name: name(&vary.keys.to_string()),
        }
    }

    pub fn cells(&self) -> usize {
        self.edges.len() - 1
    }

    fn ends(&self) -> (f64, f64) {
        (self.edges[0], self.edges[self.edges.len() - 1])
    }

    fn part_of(&self, place: f64) -> f64 {
        let (start, end) = self.ends();
        (place - start) / (end - start)
    }

    /// Where a cell begins and ends.
    pub fn cell(&self, cell: usize) -> (f64, f64) {
        (
            self.part_of(self.edges[cell]),
            self.part_of(self.edges[cell + 1]),
        )
    }

    /// Where a value is, if it is inside.
    pub fn part(&self, value: f64) -> Option<f64> {
        let place = match self.sign {
            Some(sign) => (sign * value).log10(),
            None => value,
        };
        let part = self.part_of(place);
        (0.0..=1.0).contains(&part).then_some(part)
    }

    /// At most about so many ticks, and how each is written.
    pub fn ticks(&self, most: usize) -> Vec<(f64, String)> {
        let (start, end) = self.ends();
        let (low, high) = (start.min(end), start.max(end));
        let most = most.max(2);
        let found = match (&self.whole, self.sign) {
            (Some(values), _) => {
                let every = values.len().div_ceil(most);
                let kept = values.iter().step_by(every);
                return kept
                    .filter_map(|&value| Some((self.part(value)?, format!("{value:.0}"))))
                    .collect();
            }
            (None, Some(sign)) => decades(low, high, sign, most),
            (None, None) => {
                let step = round_step((high - low) / most as f64);
                ticks(low, high, step)
            }
        };
        let parts = found.into_iter();
        parts.map(|(at, text)| (self.part_of(at), text)).collect()
    }
}

/// Powers of ten, or 1, 2 and 5 times these where there are few.
fn decades(low: f64, high: f64, sign: f64, most: usize) -> Vec<(f64, String)> {
    let minus = if sign < 0.0 { "\u{2212}" } else { "" };
    let (first, last) = (low.ceil() as i32, high.floor() as i32);
    let count = (last - first + 1).max(0) as usize;
    let inside = |at: &f64| (low..=high).contains(at);
    if count >= 2 {
        let every = count.div_ceil(most) as i32;
        return (first..=last)
            .filter(|decade| decade % every == 0)
            .map(|decade| {
                (
                    f64::from(decade),
                    format!("{minus}10{}", superscript(decade)),
                )
            })
            .collect();
    }
    (first - 1..=last + 1)
        .flat_map(|decade| [1.0, 2.0, 5.0].map(|digit| (digit, decade)))
        .map(|(digit, decade)| {
            let text = match decade {
                -3..=3 => format!("{minus}{}", digit * 10f64.powi(decade)),
                _ => format!("{minus}{digit}×10{}", superscript(decade)),
            };
            (f64::from(decade) + f64::log10(digit), text)
        })
        .filter(|(at, _)| inside(at))
        .collect()
}

/// Of more keys than these the first and the last are named.
const NAMED: usize = 4;

/// Keys of one table are told with its name once: `stiffness: axial = shear_2`.
fn name(keys: &str) -> String {
    let keys: Vec<&str> = keys.split('+').collect();
    let table = |key: &str| key.split('.').next().unwrap_or_default().to_string();
    let first = table(keys[0]);
    let joined = |keys: &[&str]| match keys {
        [first, .., last] if keys.len() > NAMED => format!("{first} = … = {last}"),
        few => few.join(" = "),
    };
    if keys.len() == 1 || keys.iter().any(|key| table(key) != first) {
        return joined(&keys);
    }
    let short: Vec<&str> = (keys.iter())
        .map(|key| key.split_once('.').map_or(*key, |(_, name)| name))
        .collect();
    format!("{first}: {}", joined(&short))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn axis(given: &str) -> Axis {
        Axis::of(&given.parse().unwrap())
    }

    #[test]
    fn cells_fill_the_axis_in_the_order_given() {
        for given in [
            "stiffness.torsion=1..1e-5:6log",
            "load.gravity[2]=-1e-3..-10:5log",
            "rest.twist=3..-3:4",
            "leaf.rods=1..40:6log",
            "rest.twist=3..4:1",
        ] {
            let axis = axis(given);
            let cells: Vec<_> = (0..axis.cells()).map(|cell| axis.cell(cell)).collect();
            assert_eq!(cells[0].0, 0.0, "{given}");
            assert!((cells[cells.len() - 1].1 - 1.0).abs() < 1e-12, "{given}");
            assert!(
                cells
                    .windows(2)
                    .all(|c| c[0].1 == c[1].0 && c[0].0 < c[0].1)
            );
        }
    }

    #[test]
    fn ticks_are_readable() {
        let texts = |given: &str, most: usize| -> Vec<String> {
            let ticks = axis(given).ticks(most);
            ticks.into_iter().map(|(_, text)| text).collect()
        };
        let decades = texts("load.gravity[2]=-1e-3..-10:5log", 6);
        assert_eq!(decades.len(), 5);
        assert_eq!(decades[0], "\u{2212}10⁻³");
        assert!(texts("stiffness.axial=1..1e10:11log", 6).len() <= 6);
        assert_eq!(texts("stiffness.axial=2..5:4log", 6), ["2", "5"]);
        assert_eq!(texts("leaf.rods=1..5:5", 9), ["1", "2", "3", "4", "5"]);
        assert_eq!(texts("rest.twist=0..1:3", 5), ["0.0", "0.5", "1.0"]);
    }

    #[test]
    fn a_table_is_told_once() {
        let h = "stiffness.axial+stiffness.shear_2";
        assert_eq!(name(h), "stiffness: axial = shear_2");
        let many: Vec<String> = (0..6).map(|i| format!("rest.twist[{i}]")).collect();
        assert_eq!(name(&many.join("+")), "rest: twist[0] = … = twist[5]");
        assert_eq!(name("load.gravity[2]"), "load.gravity[2]");
        assert_eq!(name("method.step+leaf.length"), "method.step = leaf.length");
    }
}
