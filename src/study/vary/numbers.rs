//! The numbers of a scenario that can vary, one by one.

use super::{Base, Keys, Target};
use crate::scenario::{Key, Part};

/// Entries of a list that are told one by one; of longer ones only their common factor.
const MOST_ENTRIES: usize = 9;

/// What is displaced from zero is by so much of the length.
const DISPLACED: f64 = 0.1;

/// A number of a scenario.
#[derive(Clone, Debug)]
pub struct Number {
    /// Its path.
    pub keys: Keys,
    /// Its value; 1 for a common factor of several.
    pub value: f64,
    /// The size of such a number, where its own is zero, in the scenario's units.
    pub unit: f64,
    /// Whether it must be positive, or not negative.
    pub positive: bool,
    /// Whether it is a whole number.
    pub whole: bool,
    /// What it is.
    pub description: &'static str,
}

impl Base {
    /// All numbers that the scenario has, given or by default: of vectors each component, of lists
    /// and profiles their common factor, and each entry of short ones.
    pub fn numbers(&self) -> Vec<Number> {
        let mut numbers = Vec::new();
        for part in Key::all().flat_map(|key| self.entries.parts(key)) {
            let Some(value) = self.entries.value_at(part) else {
                continue;
            };
            let each = match self.entries.number_at(part) {
                Some(_) => vec![part],
                None => part.numbers(value),
            };
            let factor = Part {
                scale: true,
                ..part
            };
            if each.len() > 1 && self.entries.is_scalable(factor) {
                numbers.extend(self.number_of(factor));
            }
            if each.len() <= MOST_ENTRIES {
                numbers.extend(each.into_iter().filter_map(|part| self.number_of(part)));
            }
        }
        numbers
    }

    fn number_of(&self, part: Part) -> Option<Number> {
        let keys = Keys(vec![Target::Entry(part)]);
        let value = self.entries.number_at(part)?;
        // Some defaults are those of tables that would stand beside what is given in their place.
        let allowed = || self.at(&[(&keys, value)]).is_ok();
        let can_vary = part.is_number().is_ok() && part.key != Key::Tolerance && allowed();
        let is_length = part.key.dimension() == [1, 0, 0];
        can_vary.then(|| Number {
            value,
            unit: keys.unit(self.scenario()) * if is_length { DISPLACED } else { 1.0 },
            positive: keys.is_positive(),
            whole: keys.is_whole(),
            description: part.key.description(),
            keys,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Each of them can be set to its own value, and the scenario is the same.
    #[test]
    fn every_number_can_be_set_by_its_path() {
        let text = include_str!("../../../scenarios/measured/clip.toml");
        let base = Base::of_text(text.into(), "clip.toml".into(), &[]).unwrap();
        let numbers = base.numbers();
        let paths: Vec<String> = (numbers.iter()).map(|it| it.keys.to_string()).collect();
        for path in [
            "leaf.length",
            "section.young",
            "load.g[2]",
            "load.point[0].mass",
            "tissue.along",
        ] {
            assert!(paths.iter().any(|it| it == path), "{path} of {paths:?}");
        }
        for Number { keys, value, .. } in &numbers {
            let parsed: Keys = keys.to_string().parse().unwrap();
            assert_eq!(parsed, *keys);
            let same = base.at(&[(keys, *value)]);
            let same = same.unwrap_or_else(|refused| panic!("{keys}={value}: {refused}"));
            assert_eq!(same.scenario.rods, base.scenario().rods, "{keys}");
        }
    }
}
