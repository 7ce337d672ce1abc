//! All mistakes in the entries of a scenario, though reading it ends at the first.

use super::entries::Entries;
use super::error::ScenarioError;
use super::form::{Form, LeftOut};
use super::key::Key;
use toml::Value;

/// Most mistakes that are told at once.
const MOST: usize = 8;

impl Entries {
    /// The errors about the values of keys that are there.
    pub(super) fn mistakes(&self) -> Vec<ScenarioError> {
        let Err(error) = self.read() else {
            return Vec::new();
        };
        let ScenarioError { others, .. } = self.with_others(error.clone());
        let all = [error].into_iter().chain(others);
        let given = |error: &ScenarioError| error.key.is_some_and(|key| self.is_given(key));
        all.filter(given).collect()
    }

    /// An error, with those about other entries that do not follow from it: the refused entry gives
    /// way to one that is allowed, and all are read again.
    pub(super) fn with_others(&self, error: ScenarioError) -> ScenarioError {
        let mut entries = self.clone();
        let mut found = vec![error.clone()];
        while found.len() < Key::COUNT && found.last().is_some_and(|last| entries.mend(last)) {
            let Err(next) = entries.read() else {
                break;
            };
            let follows = |told: &ScenarioError| told.key == next.key || depends(&next, told);
            if found.iter().any(follows) {
                break;
            }
            found.push(next);
        }
        // The first that is missing names all others.
        let is_missing = |error: &ScenarioError| error.key.is_some_and(|key| !self.is_given(key));
        let first = found.iter().position(is_missing);
        let others = found.into_iter().enumerate().skip(1);
        let others = others.filter(|(k, error)| first == Some(*k) || !is_missing(error));
        let others = others.map(|(_, error)| error).take(MOST - 1).collect();
        ScenarioError { others, ..error }
    }

    /// Replaces the entry that is refused by one that is allowed; false if none is known, or if others
    /// are right or wrong by what it says.
    fn mend(&mut self, error: &ScenarioError) -> bool {
        let Some(key) = error.key.filter(|key| !self.decides(*key)) else {
            return false;
        };
        let value = match key.left_out() {
            LeftOut::Required(example) => Some(example),
            _ => None,
        };
        self.replace(key, value);
        true
    }

    /// Whether other entries are right or wrong by what this one says: lists are as long as
    /// `leaf.rods`, if there are any.
    fn decides(&self, key: Key) -> bool {
        match key.form() {
            Form::Whole if key == Key::Rods => Key::all().any(|key| self.is_list_of_rods(key)),
            Form::Text | Form::Whole => key.parts().0 != "units",
            _ => false,
        }
    }

    /// Whether a list is given, with as many entries as there are rods or gaps between them.
    fn is_list_of_rods(&self, key: Key) -> bool {
        let single = match key.form() {
            Form::PerRod(_) | Form::Quantity(_) | Form::PerGap(_) | Form::Fan => 0,
            Form::VectorPerRod | Form::VectorQuantity => 1,
            _ => return false,
        };
        self.given(key)
            .is_some_and(|item| depth(item.value) > single)
    }
}

/// How deep lists stand within each other; of a profile in those at each knot.
fn depth(value: &Value) -> usize {
    match value {
        Value::Array(list) => 1 + list.first().map_or(0, depth),
        Value::Table(profile) => profile
            .get("value")
            .map_or(0, |value| depth(value).saturating_sub(1)),
        _ => 0,
    }
}

/// Whether an error may follow from the value that replaced that of another: a wall is compared with
/// its diameter.
fn depends(error: &ScenarioError, on: &ScenarioError) -> bool {
    let in_section = on.key.is_some_and(|key| key.parts().0 == "section");
    in_section && matches!(error.key, Some(Key::Wall | Key::InnerDiameter))
}

#[cfg(test)]
mod tests {
    use crate::scenario::{Scenario, ScenarioError};

    fn refused(leaf: &str, stiffness: &str) -> ScenarioError {
        let text = format!(
            "[leaf]\nrods = 3\n{leaf}\n[stiffness]\nbending_2 = 1.0\nbending_3 = 1.0\n{stiffness}\n\
             axial = inf\nshear_2 = inf\nshear_3 = inf\n[solve]\ntolerance = 3"
        );
        Scenario::from_toml(&text).unwrap_err()
    }

    fn lines(error: &ScenarioError) -> Vec<String> {
        let text = error.to_string();
        let begin = |line: &str| line.strip_prefix("scenario:").map(String::from);
        text.lines().filter_map(begin).collect()
    }

    /// Errors are told in the order of their lines, whatever that of the format is, and then what
    /// is missing.
    #[test]
    fn mistakes_are_in_the_order_of_lines() {
        let text = "[solve]\ntolerance = 3\n[stiffness]\nbending_2 = -1.0\n[leaf]\nrods = 3\nlength = -1.0\n";
        let lines = lines(&Scenario::from_toml(text).unwrap_err());
        let numbers: Vec<_> = lines
            .iter()
            .map(|line| {
                line.split(':')
                    .next()
                    .unwrap()
                    .parse()
                    .unwrap_or(usize::MAX)
            })
            .collect();
        assert!(
            numbers.starts_with(&[2, 4, 7]) && numbers.is_sorted(),
            "{lines:?}"
        );
    }

    /// Asserts that there is one line about each of these keys, and no other.
    #[track_caller]
    fn are_about(told: &[String], keys: &[&str]) {
        assert_eq!(told.len(), keys.len(), "{told:?}");
        for key in keys {
            let found = told.iter().any(|line| line.contains(key));
            assert!(found, "{key}: {told:?}");
        }
    }

    /// Every mistake is told once, and what a wrong entry decides is not judged.
    #[test]
    fn all_mistakes_are_told_at_once() {
        let told = lines(&refused(
            "length = 1\nfan = [0.0]\njoined = 1",
            "torsion = -1",
        ));
        let keys = [
            "leaf.fan",
            "stiffness.torsion",
            "leaf.joined",
            "solve.tolerance",
        ];
        are_about(&told, &keys);
        let rods = refused("length = [1, 1, 1]\nfan = [0, 0, 0]", "torsion = 1");
        let rods = rods.to_string().lines().count();
        assert_eq!(rods, 1, "only the tolerance is wrong");
        let text = "[leaf]\nrods = 0\nlength = [1, 1, 1]\nfan = [0, 0, 0]";
        let error = Scenario::from_toml(text).unwrap_err();
        assert!(
            error.others.is_empty(),
            "lists are as long as rods says: {error}"
        );
    }

    /// A number of rods that is refused hides nothing where no list is as long as it says.
    #[test]
    fn a_wrong_number_of_rods_hides_only_lists() {
        let text = "leaf = { rods = 7.5 }\nblade = { length = -30, width = [0.8, 1.0], thickness = \"0,025\", \
                    young = 6e4 }\nload = { g = -981 }";
        let error = Scenario::from_toml(text).unwrap_err();
        let told = lines(&error);
        let keys = [
            "leaf.rods",
            "blade.length",
            "blade.width",
            "blade.thickness",
            "load.g",
        ];
        are_about(&told, &keys);
        let listed = text.replace("\"0,025\"", "[0.1, 0.2]");
        let listed = Scenario::from_toml(&listed).unwrap_err();
        assert!(listed.others.is_empty(), "{listed}");
    }

    /// A name that is none does not hide wrong values, and is not called missing as well.
    #[test]
    fn unknown_names_are_told_with_the_rest() {
        let told = lines(&refused(
            "lenght = 1\nfan = 'paper'",
            "torsion = -1\nbending = 2",
        ));
        let keys = [
            "leaf.lenght",
            "stiffness.bending ",
            "stiffness.torsion",
            "solve.tolerance",
        ];
        are_about(&told, &keys);
    }

    /// What follows from a wrong entry alone is not told.
    #[test]
    fn what_is_missing_is_told_once() {
        let error = Scenario::from_toml("[leaf]\nrods = 2\n[solve]\ntolerance = 3").unwrap_err();
        let told = lines(&error);
        assert_eq!(told.len(), 2, "{told:?}");
        assert!(told[1].contains("also missing: leaf.length"), "{told:?}");
    }
}
