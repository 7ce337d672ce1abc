//! All mistakes in the entries of a scenario, though reading it ends at the first.

use super::entries::Entries;
use super::error::ScenarioError;
use super::form::{Form, LeftOut};
use super::key::Key;

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
        let mut others: Vec<ScenarioError> = Vec::new();
        while others.len() + 1 < MOST && entries.mend(others.last().unwrap_or(&error)) {
            let Err(next) = entries.read() else {
                break;
            };
            let follows = |told: &ScenarioError| told.key == next.key || depends(&next, told);
            if others.iter().chain([&error]).any(follows) {
                break;
            }
            others.push(next);
        }
        ScenarioError { others, ..error }
    }

    /// Replaces the entry that is refused by one that is allowed; false if none is known, or if others
    /// are right or wrong by what it says.
    fn mend(&mut self, error: &ScenarioError) -> bool {
        let Some(key) = error.key.filter(|key| !decides(*key)) else {
            return false;
        };
        let value = match key.left_out() {
            LeftOut::Required(example) => Some(example),
            _ => None,
        };
        self.replace(key, value);
        true
    }
}

/// Whether other entries are right or wrong by what this one says.
fn decides(key: Key) -> bool {
    matches!(key.form(), Form::Text | Form::Whole) && key.parts().0 != "units"
}

/// Whether an error may follow from the value that replaced that of another: a wall is compared with
/// its diameter.
fn depends(error: &ScenarioError, on: &ScenarioError) -> bool {
    let table = |error: &ScenarioError| error.key.map(|key| key.parts().0);
    matches!(table(error), Some("section" | "blade")) && table(error) == table(on)
}
