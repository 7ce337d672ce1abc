//! A leaf on the page: opened, changed, let go, asked for what comes.

use crate::answer::{Answer, Growth, Known, Slider, Told, branch};
use crate::motion::Motion;
use crate::place;
use crate::question::{Pull, Question, Values};
use leafdyn::relax::{
    Equilibrium, EquilibriumTracker, Limit, Options, RelaxError, SemiImplicit, TrackOutcome, relax,
};
use leafdyn::scenario::Scenario;
use leafdyn::study::{
    BaseScenario, ParameterKeys, ParameterSweep, ScenarioNumber, SensitivityError, TraceRequest,
    VaryError, equilibria, sensitivities_of_tracker, trace_through,
};
use leafdyn_program::files::{self, ResultDocument};
use std::collections::HashMap;
use std::time::Duration;

/// What a leaf on a screen needs.
const TOLERANCE: f64 = 1e-4;

/// Seconds after which a leaf that does not come to rest is given up.
const PATIENCE: u64 = 8;

/// Seconds after which the rest in wind is given up, of which only effects are wanted.
const PATIENCE_IN_WIND: u64 = 2;

/// Points of a branch that are drawn, and seconds for all that is asked in the background.
const MOST_POINTS: usize = 400;
const SECONDS: u64 = 20;

/// Derivatives by more numbers at once are those of the tip alone.
const KEYS_AT_ONCE: usize = 100;

/// Why there is no answer.
#[derive(Debug, thiserror::Error)]
pub enum Refusal {
    /// The scenario, a value, or a range.
    #[error("{0}")]
    Vary(#[from] VaryError),
    /// A relaxation that cannot be run.
    #[error("{0}")]
    Relax(#[from] RelaxError),
    /// A derivative that does not exist.
    #[error("{0}")]
    Sensitivity(#[from] SensitivityError),
    /// Anything else, in words.
    #[error("{0}")]
    Words(String),
}

fn refuse<T>(why: impl ToString) -> Result<T, Refusal> {
    Err(Refusal::Words(why.to_string()))
}

/// The leaf that is open.
struct Open {
    base: BaseScenario,
    values: Vec<(ParameterKeys, f64)>,
    /// With these values, but without what pulls it, and with its wind.
    scenario: Scenario,
    leaf: Equilibrium,
    /// None where the leaf is not at rest, or has no energy.
    follower: Option<EquilibriumTracker>,
    /// Whether that is on a coarse grid.
    coarse: bool,
    /// Segments of the coarsest grid on which the leaf was relaxed to its tolerance, if it was on one.
    relaxed_on: Option<usize>,
}

/// What a page has open.
#[derive(Default)]
pub struct Session {
    open: Option<Open>,
    motion: Option<Motion>,
}

impl Session {
    /// Answers a question, both as JSON.
    pub fn answer(&mut self, question: &[u8]) -> Vec<u8> {
        let answer = match serde_json::from_slice(question) {
            Ok(question) => self
                .ask(question)
                .unwrap_or_else(|refusal| Answer::Refused {
                    error: refusal.to_string(),
                }),
            Err(error) => Answer::Refused {
                error: format!("no such question: {error}"),
            },
        };
        serde_json::to_vec(&answer).unwrap_or_default()
    }

    fn ask(&mut self, question: Question) -> Result<Answer, Refusal> {
        match question {
            Question::Open {
                text,
                name,
                values,
                at,
            } => {
                let open = Open::new(BaseScenario::from_text(text, name, &[])?, values, at)?;
                let (sliders, growth) = (open.sliders(), open.growth());
                let known = open.known();
                (self.open, self.motion) = (Some(open), None);
                return Ok(Answer::Opened {
                    known,
                    sliders,
                    growth,
                });
            }
            Question::Go { damped, released } => {
                let open = self.opened()?;
                let motion = Motion::begin(
                    &open.scenario,
                    open.follower.as_ref().filter(|_| !released),
                    damped,
                );
                let mut motion = motion.or_else(refuse)?;
                let answer = Answer::Moving(motion.first());
                self.motion = Some(motion);
                return Ok(answer);
            }
            Question::Frame { count } => {
                let Some(motion) = &mut self.motion else {
                    return refuse("nothing moves");
                };
                return Ok(Answer::Moving(motion.next(count).or_else(refuse)?));
            }
            Question::Version => {
                let version = env!("CARGO_PKG_VERSION");
                return Ok(Answer::Version { version });
            }
            _ => {}
        }
        // What only asks leaves a motion as it is.
        let motion = match question {
            Question::Set { .. } | Question::Settle | Question::Land => self.motion.take(),
            _ => None,
        };
        let open = self.opened()?;
        match question {
            Question::Set {
                values,
                modes,
                coarse,
                pull,
            } => open.set(values, How { modes, coarse }, pull),
            Question::Place => Ok(Answer::Place {
                at: place::write(&open.leaf.shape),
            }),
            Question::Settle => open.settle(None),
            Question::Land => open.settle(motion),
            Question::Trace { key, from, to, log } => open.trace(&key, [from, to], log),
            Question::Equilibria => open.equilibria(),
            Question::Sensitivity { keys } => open.sensitivity(&keys),
            Question::Unloaded => open.unloaded(),
            Question::Write { file } => open.write(&file),
            Question::Open { .. }
            | Question::Go { .. }
            | Question::Frame { .. }
            | Question::Version => refuse("answered"),
        }
    }

    fn opened(&mut self) -> Result<&mut Open, Refusal> {
        match &mut self.open {
            Some(open) => Ok(open),
            None => refuse("no scenario is open"),
        }
    }
}

/// The scenario in which a leaf rests: without wind, in which it moves when it is let go.
fn calm(scenario: Scenario) -> Scenario {
    Scenario {
        wind: None,
        ..scenario
    }
}

/// So many seconds from now.
fn within(seconds: u64) -> Limit {
    Limit::with_deadline(leafdyn::run::Instant::now() + Duration::from_secs(seconds))
}

/// How a leaf is wanted.
#[derive(Clone, Copy, Default)]
struct How {
    /// How many modes.
    modes: usize,
    /// On the coarsest grid alone.
    coarse: bool,
}

/// Segments that are stated of the coarsest grid of a tracker, which has its own.
const ANY_SEGMENTS: usize = 16;

/// How leaves follow: as they are relaxed, or on the coarsest grid.
fn follow_options(scenario: &Scenario, how: How) -> Options {
    let relaxed = options(scenario, how.modes);
    let segments = Some(ANY_SEGMENTS).filter(|_| how.coarse);
    Options {
        method: relaxed.method.on_grid(segments),
        ..relaxed
    }
}

/// Segments of the one grid for a leaf that cannot be followed, while a number is dragged: half of those that its tolerance
/// asked for, and no fewer. (The ten coils of classic/helical_rollup.toml on 64 segments: the tip is off by 1e-3 of the length.)
const LEAST_SEGMENTS: usize = 8;

/// How far the tips of a leaf on a coarse grid are from those on finer ones at most, in lengths.
const COARSE_DISTANCE: f64 = 0.05;

/// Whether two leaves can be the same equilibrium on different grids.
fn is_near(one: &Equilibrium, other: &Equilibrium) -> bool {
    let mut tips = one.tips.iter().zip(&other.tips);
    let most = COARSE_DISTANCE * one.shape.longest();
    tips.all(|(a, b)| a.distance(*b) <= most)
}

/// How leaves are relaxed.
fn options(scenario: &Scenario, modes: usize) -> Options {
    Options {
        tolerance: Some(TOLERANCE.max(scenario.tolerance)),
        limit: within(PATIENCE),
        modes,
        mode_shapes: modes > 0,
        ..Options::default()
    }
}

fn keyed(values: Values) -> Result<Vec<(ParameterKeys, f64)>, Refusal> {
    let each = values.into_iter();
    each.map(|(key, value)| Ok((key.parse()?, value))).collect()
}

impl Open {
    fn new(base: BaseScenario, values: Values, at: Option<String>) -> Result<Self, Refusal> {
        let values = keyed(values)?;
        let scenario = scenario_of(&base, &values)?;
        let (calm, how) = (calm(scenario.clone()), options(&scenario, 0));
        let (leaf, follower) = match at.as_deref().and_then(place::read) {
            // Without an energy there is no branch to be on.
            Some((stations, rods)) if !calm.has_moments() => {
                EquilibriumTracker::begin_near(&calm, &how, (&stations, &rods))?
            }
            _ => EquilibriumTracker::begin(&calm, &how)?,
        };
        Ok(Open {
            base,
            values,
            scenario,
            relaxed_on: leaf.accuracy.segments.first().copied(),
            leaf,
            follower,
            coarse: false,
        })
    }

    fn known(&self) -> Known {
        Known::new(&self.leaf, &self.scenario)
    }

    fn sliders(&self) -> Vec<Slider> {
        let numbers = self.base.numbers();
        let effects = self.effects(&numbers);
        let slider = |number: ScenarioNumber| {
            let effect = effects.get(&number.keys.to_string()).copied();
            Slider::new(number, &self.scenario.units, effect)
        };
        numbers.into_iter().map(slider).collect()
    }

    /// The leaf at rest in its steady wind, in which its numbers have other effects than without it; none
    /// without wind, in one that changes, and where it does not come to rest soon.
    fn blown(&self) -> Option<EquilibriumTracker> {
        let wind = self.scenario.wind.as_ref()?;
        let how = Options {
            limit: within(PATIENCE_IN_WIND),
            ..options(&self.scenario, 0)
        };
        let steady = wind.velocity.is_constant();
        let (_, found) = steady.then(|| EquilibriumTracker::begin(&self.scenario, &how).ok())??;
        found
    }

    /// How far any point of the leaf moves, in lengths, by a change of each number by its own size: of
    /// those that can be differentiated. In a steady wind of the leaf at rest in it.
    fn effects(&self, numbers: &[ScenarioNumber]) -> HashMap<String, f64> {
        let blown = self.blown();
        let (Some(follower), Ok(base)) =
            (blown.as_ref().or(self.follower.as_ref()), self.fixed(None))
        else {
            return HashMap::new();
        };
        let sized = numbers.iter().filter(|number| number.value != 0.0);
        let keys: Vec<ParameterKeys> = sized
            .map(|number| number.keys.clone())
            .filter(|keys| base.differentiable_value(keys).is_ok())
            .collect();
        let longest = leafdyn::scenario::longest(&self.scenario.rods);
        let mut effects = HashMap::new();
        for keys in keys.chunks(KEYS_AT_ONCE) {
            let found = sensitivities_of_tracker(follower, &base, keys).unwrap_or_default();
            effects.extend(found.into_iter().map(|it| {
                let moved = it.positions.iter().flatten().chain(&it.tips);
                let largest = moved.map(|by| by.length()).fold(0.0, f64::max);
                (it.key, largest * it.value.abs() / longest)
            }));
        }
        effects
    }

    /// The growth of the veins, if the margins have grown more than the midrib.
    fn growth(&self) -> Option<Growth> {
        let keys = (0..self.scenario.rods.len()).map(|vein| format!("rest.stretch[{vein}]"));
        let keys: Vec<String> = keys.collect();
        let number = |key: &String| self.base.number(&key.parse().ok()?);
        let stretches = keys.iter().map(number).collect::<Option<Vec<f64>>>()?;
        let middle = stretches.get(stretches.len() / 2)?;
        (stretches.first()? > middle).then_some(Growth { keys, stretches })
    }

    /// The leaf with other values: followed there if it can, or found anew.
    fn set(&mut self, values: Values, how: How, pull: Option<Pull>) -> Result<Answer, Refusal> {
        let values = keyed(values)?;
        let bare = scenario_of(&self.base, &values)?;
        let pulled = |scenario| match pull {
            Some(pull) => pull.on(calm(scenario)),
            None => calm(scenario),
        };
        let scenario = pulled(bare.clone());
        let alike = scenario.rods.len() == self.scenario.rods.len()
            && scenario.joined == self.scenario.joined
            // These have no energy, and no branch of stable equilibria.
            && !scenario.has_moments();
        let Some(follower) = self.follower.as_mut().filter(|_| alike) else {
            let exact = options(&scenario, how.modes);
            let half = |segments: usize| (segments / 2).max(LEAST_SEGMENTS);
            let coarse = (how.coarse && scenario.has_moments()).then_some(self.relaxed_on);
            let relaxed = match coarse.flatten().map(half) {
                Some(segments) => Options {
                    method: exact.method.on_grid(Some(segments)),
                    ..exact
                },
                None => exact,
            };
            let (leaf, follower) = EquilibriumTracker::begin(&scenario, &relaxed)?;
            if coarse.is_none() {
                self.relaxed_on = leaf.accuracy.segments.first().copied();
            }
            (self.leaf, self.follower) = (leaf, follower);
            (self.values, self.scenario) = (values, bare);
            return Ok(Answer::Found(self.known()));
        };
        follower.options(&follow_options(&scenario, how));
        let (base, before) = (&self.base, &self.values);
        let along = |part: f64| match part == 1.0 {
            true => Ok(scenario.clone()),
            false => scenario_of(base, &between(base, before, &values, part)).map(pulled),
        };
        let mut followed = follower.follow::<Refusal>(&along)?;
        let was_coarse = std::mem::replace(&mut self.coarse, how.coarse);
        if (how.coarse || was_coarse) && matches!(followed, TrackOutcome::BranchEnded { .. }) {
            // On a coarse grid it ends elsewhere: the finer ones decide, from the leaf that is shown.
            let exact = options(&scenario, how.modes);
            let shape = &self.leaf.shape;
            let here = (&shape.stations[..], &shape.rods[..]);
            let (leaf, again) =
                EquilibriumTracker::begin_near(&calm(scenario_of(base, before)?), &exact, here)?;
            let is_same = is_near(&leaf, &self.leaf);
            self.coarse = false;
            followed = match again.filter(|_| is_same) {
                Some(again) => {
                    *follower = again;
                    follower.follow::<Refusal>(&along)?
                }
                None => TrackOutcome::BranchEnded { part: 0.0 },
            };
        }
        let answer = match followed {
            TrackOutcome::Arrived(leaf) => {
                self.leaf = *leaf;
                Answer::Followed(Known::new(&self.leaf, &bare))
            }
            TrackOutcome::BranchEnded { part } => Answer::Left {
                values: told(&between(base, before, &values, part)),
            },
        };
        (self.values, self.scenario) = (values, bare);
        Ok(answer)
    }

    /// The leaf at rest from where it is, or from where a motion has brought it.
    fn settle(&mut self, motion: Option<Motion>) -> Result<Answer, Refusal> {
        let scenario = &calm(self.scenario.clone());
        if let Some(follower) = &mut self.follower {
            follower.options(&options(scenario, 0));
        }
        match (&mut self.follower, motion) {
            (Some(follower), Some(mut motion)) => {
                self.leaf = motion.land(follower, scenario)?;
            }
            (Some(follower), None) => self.leaf = follower.settle(scenario)?,
            (None, _) => {
                let (leaf, follower) = EquilibriumTracker::begin(scenario, &options(scenario, 0))?;
                (self.leaf, self.follower) = (leaf, follower);
            }
        }
        Ok(Answer::Found(self.known()))
    }

    /// The branch of the leaf between two values of a number.
    fn trace(&self, key: &str, [from, to]: [f64; 2], log: bool) -> Result<Answer, Refusal> {
        let mark = if log { "log" } else { "" };
        let vary: ParameterSweep = format!("{key}={from:?}..{to:?}{mark}").parse()?;
        let request = TraceRequest {
            base: self.fixed(Some(&vary.keys))?,
            vary,
            switch: false,
            until: None,
            keep_unstable: false,
            segments: None,
            tolerance: Some(TOLERANCE),
            most_points: MOST_POINTS,
            limit: Limit::default(),
        };
        let given = self
            .values
            .iter()
            .find(|(keys, _)| *keys == request.vary.keys);
        let value = given.map(|(_, value)| *value);
        let Some(value) = value.or_else(|| self.base.number(&request.vary.keys)) else {
            return refuse(format!("{key} has no value"));
        };
        match trace_through(&request, (&self.leaf, value), &mut |_, _, _| {}) {
            Ok(trace) => Ok(Answer::Branch(branch(&trace))),
            Err(why) => refuse(why),
        }
    }

    /// The base with all present values but those of these keys.
    fn fixed(&self, but: Option<&ParameterKeys>) -> Result<BaseScenario, Refusal> {
        let others = self.values.iter().filter(|(keys, _)| Some(keys) != but);
        let mut base = self.base.clone();
        for (keys, value) in others {
            base = base.with_value(keys, *value)?;
        }
        Ok(base)
    }

    fn equilibria(&self) -> Result<Answer, Refusal> {
        let how = SemiImplicit::default();
        let limit = within(SECONDS);
        let found = equilibria(
            &calm(self.scenario.clone()),
            how,
            Some(TOLERANCE),
            &limit,
            &mut |_, _| {},
        )?;
        let all = found.found.iter();
        let known = all.map(|it| Known::new(&it.equilibrium, &self.scenario));
        Ok(Answer::Equilibria(known.collect()))
    }

    fn sensitivity(&self, keys: &[String]) -> Result<Answer, Refusal> {
        let blown = self.blown();
        let Some(follower) = blown.as_ref().or(self.follower.as_ref()) else {
            return refuse("the leaf is not at rest");
        };
        let keys = keys.iter().map(|key| key.parse());
        let keys = keys.collect::<Result<Vec<ParameterKeys>, VaryError>>()?;
        let base = self.fixed(None)?;
        let found = sensitivities_of_tracker(follower, &base, &keys)?;
        let told = found.into_iter();
        let told = told.map(|it| Told {
            key: it.key,
            tips: it.tips.iter().map(|tip| tip.to_array()).collect(),
            energy: it.energy,
        });
        Ok(Answer::Sensitivity(told.collect()))
    }

    fn unloaded(&self) -> Result<Answer, Refusal> {
        let scenario = self.scenario.unloaded();
        let leaf = relax(&scenario, &options(&scenario, 0), &mut |_| {})?;
        Ok(Answer::Unloaded(Known::new(&leaf, &scenario)))
    }

    fn write(&self, file: &str) -> Result<Answer, Refusal> {
        let values: Vec<(&ParameterKeys, f64)> = self.values.iter().map(|(k, v)| (k, *v)).collect();
        let content = match file {
            "scenario.toml" => match values.is_empty() {
                true => Some(self.base.text().to_owned().into_bytes()),
                false => self.base.toml(&values).map(String::into_bytes),
            },
            _ => {
                let document = ResultDocument::new(&self.leaf, &self.scenario, None);
                files::result_file_contents(&document, file)
            }
        };
        match content {
            Some(content) => Ok(Answer::file(file, &content)),
            None => refuse(format!("there is no file {file} of a leaf at rest")),
        }
    }
}

fn scenario_of(base: &BaseScenario, values: &[(ParameterKeys, f64)]) -> Result<Scenario, Refusal> {
    let values: Vec<(&ParameterKeys, f64)> = values.iter().map(|(k, v)| (k, *v)).collect();
    Ok(base.scenario_with_values(&values)?.scenario)
}

fn told(values: &[(ParameterKeys, f64)]) -> Values {
    let each = values.iter();
    each.map(|(keys, value)| (keys.to_string(), *value))
        .collect()
}

/// Values on the way from some to others: one that is in neither is that of the scenario.
fn between(
    base: &BaseScenario,
    from: &[(ParameterKeys, f64)],
    to: &[(ParameterKeys, f64)],
    part: f64,
) -> Vec<(ParameterKeys, f64)> {
    let of = |values: &[(ParameterKeys, f64)], keys: &ParameterKeys| {
        let given = values.iter().find(|(known, _)| known == keys);
        given.map(|(_, value)| *value).or_else(|| base.number(keys))
    };
    let gone = from
        .iter()
        .filter(|(keys, _)| !to.iter().any(|(known, _)| known == keys));
    let all = to.iter().chain(gone).map(|(keys, _)| keys);
    let way = all.filter_map(|keys| {
        let (a, b) = (of(from, keys)?, of(to, keys)?);
        Some((keys.clone(), a + part * (b - a)))
    });
    way.collect()
}
