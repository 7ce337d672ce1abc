//! Experiments with the points traced on their veins; those under the same conditions share a
//! leaf.

use std::collections::{BTreeMap, HashMap};

use super::FitError;
use super::data::{Data, Experiment, Measured, Origin, Traced};
use crate::study::Keys;

/// An experiment with the points traced on its veins.
pub(super) struct Observed {
    /// Its position in the data.
    pub number: usize,
    pub experiment: Experiment,
    pub traced: Vec<Traced>,
}

/// One experiment or several under the same conditions.
pub(super) struct Case {
    /// At least one.
    pub observed: Vec<Observed>,
    /// Whether it differs from the other cases by loads only: it then has the same
    /// derivatives with respect to the free numbers.
    pub loaded_only: bool,
}

impl Case {
    fn new(first: Observed) -> Case {
        let settings = first.experiment.settings.iter();
        let mut targets = settings.flat_map(|it| it.0.targets());
        let loaded_only = targets.all(|target| {
            let key = target.key();
            key.is_some_and(|key| key.path().starts_with("load."))
        });
        Case {
            observed: vec![first],
            loaded_only,
        }
    }

    fn first(&self) -> &Experiment {
        &self.observed[0].experiment
    }

    /// Numbers of the scenario under its conditions.
    pub fn settings(&self) -> &[(Keys, f64)] {
        &self.first().settings
    }

    pub fn measured(&self) -> impl Iterator<Item = &Measured> + Clone {
        self.observed.iter().flat_map(|it| &it.experiment.measured)
    }

    pub fn traced(&self) -> impl Iterator<Item = &Traced> + Clone {
        self.observed.iter().flat_map(|it| &it.traced)
    }

    /// The name of its first experiment.
    pub fn name(&self) -> &str {
        &self.first().name
    }

    /// The position of its first experiment in the data as the beginning of a message, if it
    /// has one.
    pub fn place(&self) -> String {
        let origin = self.first().origin.as_ref();
        origin.map_or_else(String::new, |origin| format!("{origin}: "))
    }
}

/// The conditions under which there are data. A leaf is relaxed for each of these, however many
/// experiments there are.
pub(super) fn cases(data: Data) -> Result<Vec<Case>, FitError> {
    let mut cases: Vec<Case> = Vec::new();
    let mut known = HashMap::new();
    for observed in observed(data)? {
        let bits = observed.experiment.settings.iter().map(|(keys, value)| {
            // Names identify keys.
            (keys.to_string(), value.to_bits())
        });
        let case = *known.entry(bits.collect::<Vec<_>>()).or_insert(cases.len());
        match cases.get_mut(case) {
            Some(case) => case.observed.push(observed),
            None => cases.push(Case::new(observed)),
        }
    }
    Ok(cases)
}

/// The experiments with data.
fn observed(data: Data) -> Result<Vec<Observed>, FitError> {
    let observed = |experiment: Experiment| Observed {
        number: 0,
        experiment,
        traced: Vec::new(),
    };
    let mut all: Vec<_> = data.experiments.into_iter().map(observed).collect();
    let mut named: HashMap<String, usize> = HashMap::new();
    for (place, observed) in all.iter().enumerate() {
        let experiment = &observed.experiment;
        let first = *named.entry(experiment.name.clone()).or_insert(place);
        check_alike(&all[first].experiment, experiment)?;
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
        all[place].traced.push(traced);
    }
    for (number, observed) in all.iter_mut().enumerate() {
        observed.number = number;
    }
    all.retain(|it| !it.experiment.measured.is_empty() || !it.traced.is_empty());
    Ok(all)
}

/// Checks that two experiments of one name have the same settings: points on veins could
/// belong to either.
fn check_alike(one: &Experiment, other: &Experiment) -> Result<(), FitError> {
    let settings = |of: &Experiment| {
        let settings = of.settings.iter();
        let named = settings.map(|(keys, value)| (keys.to_string(), *value));
        named.collect::<BTreeMap<_, _>>()
    };
    if settings(one) == settings(other) {
        return Ok(());
    }
    let place = |of: &Experiment| of.origin.as_ref().map(Origin::to_string);
    let [first, second] = [one, other].map(|of| place(of).unwrap_or_default());
    Err(FitError::Data(format!(
        "{second}: experiment {}: has that name from {first}, which has other settings: give each a \
         name of its own",
        other.name
    )))
}
