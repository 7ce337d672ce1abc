//! Experiments with the points traced on their veins; those under the same conditions share a
//! leaf.

use std::collections::HashMap;

use super::FitError;
use super::data::{Data, Experiment, Measured, Origin, Traced};
use crate::study::Keys;

/// Numbers of the scenario during an experiment.
type Settings = Vec<(Keys, f64)>;

/// An experiment with the points traced on its veins.
pub(super) struct Observed {
    /// Its position among all.
    pub number: usize,
    pub name: String,
    pub origin: Option<Origin>,
    pub measured: Vec<Measured>,
    pub traced: Vec<Traced>,
}

/// The conditions of one experiment or of several, and what was observed under them.
pub(super) struct Case {
    pub settings: Settings,
    /// At least one.
    pub observed: Vec<Observed>,
    /// Whether it differs from the other cases by loads only: it then has the same
    /// derivatives with respect to the free numbers.
    pub loaded_only: bool,
}

impl Case {
    fn new(settings: Settings) -> Case {
        let mut targets = settings.iter().flat_map(|it| it.0.targets());
        let loaded_only = targets.all(|target| {
            let key = target.key();
            key.is_some_and(|key| key.path().starts_with("load."))
        });
        Case {
            loaded_only,
            settings,
            observed: Vec::new(),
        }
    }

    pub fn measured(&self) -> impl Iterator<Item = &Measured> + Clone {
        self.observed.iter().flat_map(|it| &it.measured)
    }

    pub fn traced(&self) -> impl Iterator<Item = &Traced> {
        self.observed.iter().flat_map(|it| &it.traced)
    }

    /// The name of its first experiment.
    pub fn name(&self) -> &str {
        self.observed.first().map_or("", |it| &it.name)
    }

    /// The position of its first experiment in the data as the beginning of a message, if it
    /// has one.
    pub fn place(&self) -> String {
        let origin = self.observed.first().and_then(|it| it.origin.as_ref());
        origin.map_or_else(String::new, |origin| format!("{origin}: "))
    }
}

/// The conditions under which there are data. A leaf is relaxed for each of these, however many
/// experiments there are.
pub(super) fn cases(data: Data) -> Result<Vec<Case>, FitError> {
    let mut cases: Vec<Case> = Vec::new();
    let mut known = HashMap::new();
    for (observed, settings) in observed(data)? {
        let bits = settings.iter().map(|(keys, value)| {
            // Names identify keys.
            (keys.to_string(), value.to_bits())
        });
        let case = *known.entry(bits.collect::<Vec<_>>()).or_insert(cases.len());
        if case == cases.len() {
            cases.push(Case::new(settings));
        }
        cases[case].observed.push(observed);
    }
    Ok(cases)
}

/// The experiments with data, and their settings.
fn observed(data: Data) -> Result<Vec<(Observed, Settings)>, FitError> {
    let observed = |experiment: Experiment| {
        let observed = Observed {
            number: 0,
            name: experiment.name,
            origin: experiment.origin,
            measured: experiment.measured,
            traced: Vec::new(),
        };
        (observed, experiment.settings)
    };
    let mut all: Vec<_> = data.experiments.into_iter().map(observed).collect();
    let mut named = HashMap::new();
    for (place, (observed, _)) in all.iter().enumerate() {
        named.entry(observed.name.clone()).or_insert(place);
    }
    let mut plain = None;
    for traced in data.traced {
        let place = match &traced.experiment {
            Some(name) => *named.get(name).ok_or_else(|| {
                let origin = &traced.origin;
                FitError::Data(format!(
                    "{origin}: experiment {name}: no row of an experiments file has that name"
                ))
            })?,
            None => *plain.get_or_insert_with(|| {
                all.push(observed(Experiment {
                    name: "as it is".into(),
                    settings: Vec::new(),
                    measured: Vec::new(),
                    origin: None,
                }));
                all.len() - 1
            }),
        };
        all[place].0.traced.push(traced);
    }
    all.retain(|(it, _)| !it.measured.is_empty() || !it.traced.is_empty());
    for (number, (observed, _)) in all.iter_mut().enumerate() {
        observed.number = number;
    }
    Ok(all)
}
