//! The value of a key, or a part of it, with its place for messages: converted to numbers, for
//! every form that a key can have.

use crate::scenario::format::entries::{Entries, WrittenEntry};
use crate::scenario::format::error::{ScenarioError, ScenarioResult, shorten_excerpt};
use crate::scenario::format::path::EntryPath;
use crate::scenario::format::places::{ON_BASE, SAME_PLACE_DISTANCE};
use crate::scenario::format::source::{intended_number, number_of_value};
use crate::scenario::format::{Key, MissingKeyRule, NumberRange, TablePath, ValueSchema};
use crate::scenario::profile::Profile;
use crate::scenario::schedule::{InTime, Schedule, Sine};
use std::fmt::Display;
use std::str::FromStr;
use toml::Value;

/// Range of lengths and stiffnesses: fourth powers of lengths and quotients of
/// stiffnesses must not overflow.
pub(in crate::scenario) const MAGNITUDES: std::ops::RangeInclusive<f64> = 1e-50..=1e50;

// Sentences and phrases of messages that several forms of values share.

const INFINITE: &str = "must be a finite number; inf (rigid) is allowed for stiffness.axial, \
     shear_2 and shear_3 only, not in a profile";
const LIST_OF_NUMBERS: &str = "a list of numbers";
const ONE_PER_ROD: &str = "one per rod (leaf.rods)";
const ONE_PER_KNOT: &str = "one per entry of at";
const PROFILE: &str = "a profile { at = [0.0, 1.0], value = [1.0, 0.5] }";
const PROFILE_FORM: &str = "a profile is { at = [0.0, 1.0], value = [1.0, 0.5] }";
const FACTOR_SCHEDULE_FORM: &str = "a factor in time is { at = [0.0, 1.0], factor = [1.0, 2.0] }, with smooth = true \
     without kinks, or { mean = 1.0, amplitude = 0.5, frequency = 2.0, phase = 0.0 }";
const VECTOR_PROFILE_FORM: &str = "a load along the rods is a list [x, y, z], one such list per rod, or \
     { at = [0.0, 1.0], value = [[0.0, 0.0, 0.0], [0.0, 0.0, -1.0]] }";
const LOAD_SCHEDULE_FORM: &str = "a load in time is { at = [0.0, 1.0], value = [[0.0, 0.0, 0.0], [0.0, 0.0, -1.0]] }, with smooth = true without \
     kinks, or { mean = [0.0, 0.0, -1.0], amplitude = [0.0, 0.1, 0.0], frequency = 2.0, phase = 0.0 }";
const MOTION_SCHEDULE_FORM: &str = "a motion is { at = [0.0, 1.0], value = [[0.0, 0.0, 0.0], [0.0, 0.0, 0.1]] }, with smooth = true without \
     kinks, or { amplitude = [0.0, 0.0, 0.1], frequency = 2.0 }";
const BASE_MOTION_FORM: &str = "the motion of bases is { at = [0.0, 1.0], move = [[0.0, 0.0, 0.0], [0.0, 0.0, 0.1]], turn = [[0.0, 0.0, 0.0], \
     [0.0, 0.5, 0.0]] }, one of both or both, with smooth = true without kinks, or \
     { move = { amplitude = [0.0, 0.0, 0.1], frequency = 2.0 } }, and likewise turn";
const VECTORS: &str = "a list of lists of three numbers [x, y, z]";

/// The value of a key, or a part of it.
#[derive(Clone, Copy)]
pub(in crate::scenario) struct EntryValue<'e> {
    entries: &'e Entries,
    part: EntryPath,
    pub value: &'e Value,
}

/// What a list of increasing numbers is.
#[derive(Clone, Copy, PartialEq)]
enum KnotKind {
    /// Times, which rise strictly.
    Times,
    /// Fractions of the length from 0 to 1, which rise strictly.
    Fractions,
    /// Fractions of the length from 0 to 1, of which two equal ones inside are a step.
    FractionsWithSteps,
}

/// The knots of a profile: fractions of the length from 0 to 1, and the numbers there.
pub(in crate::scenario) struct Knots {
    pub at: Vec<f64>,
    pub value: Vec<f64>,
}

impl Entries {
    /// The value of a key, if it is given.
    pub(in crate::scenario) fn given_value(&self, key: Key) -> Option<EntryValue<'_>> {
        if self.is_given(key) {
            self.value_or_default(key).ok()
        } else {
            None
        }
    }

    /// The value of a key as given, or its default.
    pub(in crate::scenario) fn value_or_default(&self, key: Key) -> ScenarioResult<EntryValue<'_>> {
        self.value_in_row(key, 0)
    }

    /// The value of a key as given in one of its tables, if there may be several, or its default.
    pub(in crate::scenario) fn value_in_row(
        &self,
        key: Key,
        row: usize,
    ) -> ScenarioResult<EntryValue<'_>> {
        match self.given_or_default(key, row) {
            Some(value) => Ok(EntryValue {
                entries: self,
                part: EntryPath::whole_entry(key, row),
                value,
            }),
            None => Err(self.missing_key_error(key, row)),
        }
    }

    /// An error about a key that has no place.
    fn key_error(&self, key: Key, problem: String) -> ScenarioError {
        ScenarioError {
            key: Some(key),
            ..ScenarioError::in_file(&self.source.file, None, problem)
        }
    }

    /// The error about a key that is required and left out.
    fn missing_key_error(&self, key: Key, row: usize) -> ScenarioError {
        let has = |table: &str| self.source.tables.contains(&table);
        let TablePath { table, name } = key.table_path();
        let example = match key.missing_key_rule() {
            MissingKeyRule::Required(example) => example,
            _ => "...",
        };
        let entry = format!("a line such as `{name} = {example}`");
        let how = match table {
            "" => format!("add {entry} at the top of the file"),
            _ if key.is_repeated() => format!("add {entry} below its [[{table}]]"),
            _ if has(table) => format!("add {entry} below [{table}]"),
            _ => format!("add the table [{table}], and below it {entry}"),
        };
        // Stiffnesses are required unless sections are given.
        let needed = |other: &Key| match other.table() {
            _ if has("blade") && other.follows_from_blade() => false,
            "" | "leaf" => true,
            "stiffness" => !has("section") && !has("blade"),
            _ => false,
        };
        let others = Key::all().filter(|other| *other != key && !self.is_given(*other));
        let others =
            others.filter(|other| matches!(other.missing_key_rule(), MissingKeyRule::Required(_)));
        let others: Vec<&str> = others.filter(needed).map(Key::path).collect();
        let also = match others.is_empty() {
            true => String::new(),
            false => format!("; also missing: {}", others.join(", ")),
        };
        let problem = format!(
            "{} is missing: {how}{also}",
            EntryPath::whole_entry(key, row)
        );
        self.key_error(key, problem)
    }
}

impl<'e> EntryValue<'e> {
    /// The key that the value belongs to.
    pub fn key(&self) -> Key {
        self.part.key
    }

    /// A list of a profile or a schedule, if this value is one and has the list.
    pub fn list(&self, list: &'static str) -> Option<EntryValue<'e>> {
        let value = self.value.get(list)?;
        let list = Some(list);
        let part = EntryPath { list, ..self.part };
        Some(EntryValue {
            part,
            value,
            ..*self
        })
    }

    /// An entry of a list; the value itself if the value is no list, or a shorter one.
    pub fn entry(&self, index: usize) -> EntryValue<'e> {
        let Some(value) = self.value.get(index) else {
            return *self;
        };
        let mut part = self.part;
        if let Some(free) = part.indices.iter_mut().find(|known| known.is_none()) {
            *free = Some(index);
        }
        EntryValue {
            part,
            value,
            ..*self
        }
    }

    /// The two lists, `at` and `other`, of a table that may have no others. `form`
    /// describes such a table.
    fn knots_and_values(
        &self,
        other: &'static str,
        form: &str,
    ) -> ScenarioResult<[EntryValue<'e>; 2]> {
        let Some(table) = self.value.as_table() else {
            return Err(self.value_error(format_args!("must be a table: {form}")));
        };
        if let Some(key) = table.keys().find(|key| *key != "at" && *key != other) {
            let key = shorten_excerpt(key);
            return Err(self.value_error(format_args!("unknown key {key}: {form}")));
        }
        let list = |name| {
            self.list(name)
                .ok_or_else(|| self.value_error(format_args!("{name} is missing: {form}")))
        };
        Ok([list("at")?, list(other)?])
    }

    /// The value as it is written, shortened.
    fn displayed_value(&self) -> String {
        self.entries.written_entry(self.part, self.value).text
    }

    /// Refuses this value unless a condition `holds`.
    pub fn refuse_unless(&self, holds: bool, problem: impl Display) -> ScenarioResult<()> {
        match holds {
            true => Ok(()),
            false => Err(self.value_error(problem)),
        }
    }

    /// The error about this value.
    pub fn value_error(&self, problem: impl Display) -> ScenarioError {
        let list = self.part.list.map(|list| format!(", {list}"));
        let components = matches!(
            self.key().form(),
            ValueSchema::VectorInTime
                | ValueSchema::VectorOrInTime
                | ValueSchema::VectorPerRod
                | ValueSchema::VectorQuantity(_)
        );
        let entry = match self.part.indices.map(|index| index.map(|index| index + 1)) {
            [Some(i), Some(j), Some(k)] => format!(", list {i}, entry {j}, component {k}"),
            [Some(i), Some(j), None] if components => format!(", entry {i}, component {j}"),
            [Some(i), Some(j), None] => format!(", list {i}, entry {j}"),
            [Some(i), None, _] => format!(", entry {i}"),
            [None, ..] => String::new(),
        };
        let path = EntryPath::whole_entry(self.key(), self.part.row);
        let part = list.unwrap_or_default() + &entry;
        let WrittenEntry { place, text } = self.entries.written_entry(self.part, self.value);
        ScenarioError {
            key: Some(self.key()),
            ..ScenarioError::at_place(place, format!("{path}{part} = {text}: {problem}"))
        }
    }

    /// A text.
    pub fn text(&self) -> ScenarioResult<&'e str> {
        (self.value.as_str()).ok_or_else(|| self.value_error("must be text in quotes"))
    }

    /// One of the words that `allowed` names.
    pub fn word<T: FromStr>(&self, allowed: &str) -> ScenarioResult<T> {
        let word = self.value.as_str().and_then(|word| word.parse().ok());
        word.ok_or_else(|| self.value_error(allowed))
    }

    /// One of the words that `allowed` names for each of `rods` rods: one for all, or a list.
    pub fn word_for_each<T: FromStr + Clone>(
        &self,
        rods: usize,
        allowed: &str,
    ) -> ScenarioResult<Vec<T>> {
        if !self.value.is_array() {
            return Ok(vec![self.word(allowed)?; rods]);
        }
        let list = self.list_of_length(rods, ONE_PER_ROD, "a word or a list of words")?;
        list.map(|item| item.word(allowed)).collect()
    }

    /// `true` or `false`.
    pub fn switch(&self) -> ScenarioResult<bool> {
        (self.value.as_bool()).ok_or_else(|| self.value_error("must be true or false"))
    }

    /// A whole number from 1 to `most`.
    pub fn whole_number(&self, most: usize) -> ScenarioResult<usize> {
        let whole = self.value.as_integer();
        let whole = whole.and_then(|whole| usize::try_from(whole).ok());
        let whole = whole.filter(|whole| (1..=most).contains(whole));
        whole.ok_or_else(|| {
            self.value_error(format_args!(
                "must be a whole number from 1 to {most}, without a decimal point"
            ))
        })
    }

    /// How a text is written as the number that it looks like.
    fn intended_number(&self) -> Option<String> {
        self.value.as_str().and_then(intended_number)
    }

    /// A number in the range of its key.
    pub fn number(&self) -> ScenarioResult<f64> {
        self.number_in(self.key().form().range())
    }

    /// A number in a range.
    pub fn number_in(&self, range: NumberRange) -> ScenarioResult<f64> {
        let value = number_of_value(self.value);
        let value = value.ok_or_else(|| match self.intended_number() {
            Some(meant) => self.value_error(format_args!("must be a number: {meant}")),
            None => self.value_error("must be a number"),
        })?;
        let positive = matches!(
            range,
            NumberRange::Positive | NumberRange::PositiveOrInfinite
        );
        let not_negative = matches!(
            range,
            NumberRange::NotNegative | NumberRange::NotNegativeOrInfinite
        );
        let infinite = matches!(
            range,
            NumberRange::PositiveOrInfinite | NumberRange::NotNegativeOrInfinite
        );
        let problem = match value {
            _ if value.is_nan() && !self.displayed_value().contains("nan") => {
                "is not a number a computer can hold (the largest is 1.8e308)"
            }
            _ if value.is_nan() || value == f64::NEG_INFINITY => "must be a finite number",
            _ if positive && value <= 0.0 => "must be greater than 0",
            f64::INFINITY if infinite => return Ok(value),
            f64::INFINITY if positive => INFINITE,
            f64::INFINITY => "must be a finite number",
            _ if positive && !MAGNITUDES.contains(&value) => {
                "must lie between 1e-50 and 1e50: choose other units"
            }
            _ if not_negative && value < 0.0 => "must not be negative",
            _ => return Ok(value),
        };
        Err(self.value_error(problem))
    }

    /// A number for each of `count` rods or gaps: one for all, or a list.
    pub fn number_for_each(&self, count: usize) -> ScenarioResult<Vec<f64>> {
        self.number_for_each_used(&vec![true; count])
    }

    /// A number for each rod or gap: one for all, or a list, in which those that are not used may be 0.
    pub fn number_for_each_used(&self, used: &[bool]) -> ScenarioResult<Vec<f64>> {
        let count = used.len();
        if number_of_value(self.value).is_some() || self.intended_number().is_some() {
            return Ok(vec![self.number()?; count]);
        }
        let (each, counted) = match self.key().form() {
            ValueSchema::PerGap(_) => ("gap between neighbouring rods", "leaf.rods - 1"),
            _ => ("rod", "leaf.rods"),
        };
        let because = format!("one per {each} ({counted})");
        let needed = match self.key().form() {
            ValueSchema::Quantity(_) => {
                format!("a number, a list of {count} (one per rod), or {PROFILE}")
            }
            _ => format!("a number or a list of {count} (one per {each})"),
        };
        let list = self.list_of_length(count, &because, &needed)?;
        let numbers = list.zip(used).map(|(item, used)| match used {
            true => item.number(),
            false => item.number_in(NumberRange::NotNegative),
        });
        numbers.collect()
    }

    /// A profile for each of `rods` rods.
    pub fn profile_per_rod(&self, rods: usize) -> ScenarioResult<Vec<Profile>> {
        if !self.value.is_table() {
            let numbers = self.number_for_each(rods)?;
            return Ok(numbers.into_iter().map(Profile::Constant).collect());
        }
        let [at, value] = self.knots_and_values("value", PROFILE_FORM)?;
        let at = at.profile_knots()?;
        let needed = format!("a list of numbers, or a list of {rods} such lists (one per rod)");
        let mut list = value.list_entries(&needed)?;
        if (list.next()).is_none_or(|first| !first.value.is_array()) {
            return Ok(vec![value.linear_profile(&at)?; rods]);
        }
        let lists = value.list_of_length(rods, ONE_PER_ROD, &needed)?;
        lists.map(|list| list.linear_profile(&at)).collect()
    }

    /// The knots of a profile along the veins, close ones of all that is read here made equal: a ramp as short as that
    /// is a step. Blades, whose veins and tissue follow from one smooth surface, have no steps, and
    /// fractions of their own length.
    fn profile_knots(&self) -> ScenarioResult<Vec<f64>> {
        if self.key().table() == "blade" {
            return self.increasing_numbers(KnotKind::Fractions);
        }
        let at = self.increasing_numbers(KnotKind::FractionsWithSteps)?;
        let common = at.iter().map(|&at| self.entries.common_place(at));
        Ok(common.collect())
    }

    /// The knots of a profile along the leaf, without steps.
    pub fn knots(&self) -> ScenarioResult<Knots> {
        let [at, value] = self.knots_and_values("value", PROFILE_FORM)?;
        let at = at.increasing_numbers(KnotKind::Fractions)?;
        let list = value.list_of_length(at.len(), ONE_PER_KNOT, LIST_OF_NUMBERS)?;
        let value = list
            .map(|item| item.number())
            .collect::<ScenarioResult<_>>()?;
        Ok(Knots { at, value })
    }

    /// A profile that has these values at the knots `at`.
    fn linear_profile(&self, at: &[f64]) -> ScenarioResult<Profile> {
        // Infinity cannot be interpolated between knots.
        let range = match self.key().form().range() {
            NumberRange::PositiveOrInfinite => NumberRange::Positive,
            NumberRange::NotNegativeOrInfinite => NumberRange::NotNegative,
            range => range,
        };
        let values = self.list_of_length(at.len(), ONE_PER_KNOT, LIST_OF_NUMBERS)?;
        let value = values
            .map(|item| item.number_in(range))
            .collect::<ScenarioResult<_>>()?;
        self.profile_through(at, value)
    }

    /// The profile through values at knots, of which those that are equal after the first and before the last
    /// are passed on the way of a step: they lie between the values on both sides of it.
    fn profile_through(&self, at: &[f64], value: Vec<f64>) -> ScenarioResult<Profile> {
        let (mut knots, mut values): (Vec<f64>, Vec<f64>) = (Vec::new(), Vec::new());
        let mut first = 0;
        while first < at.len() {
            let equal = at[first..].iter().take_while(|&&next| next == at[first]);
            let last = first + equal.count() - 1;
            let ends = [value[first], value[last]];
            let between = ends[0].min(ends[1])..=ends[0].max(ends[1]);
            let beyond = (first..=last).find(|&k| !between.contains(&value[k]));
            if let Some(beyond) = beyond {
                return Err(self.entry(beyond).value_error(format_args!(
                    "is reached and left within {SAME_PLACE_DISTANCE:e} of the length, which is one place: give the \
                     stretch that has this value more length"
                )));
            }
            // A step at an end of the vein has one side.
            let sides = match at[first] {
                _ if first == last => first..=first,
                0.0 => last..=last,
                1.0 => first..=first,
                here => {
                    knots.push(here);
                    values.push(value[first]);
                    last..=last
                }
            };
            for k in sides {
                knots.push(at[k]);
                values.push(value[k]);
            }
            first = last + 1;
        }
        Ok(Profile::Linear {
            at: knots,
            value: values,
        })
    }

    /// A factor that may change in time.
    pub fn factors_in_time(&self) -> ScenarioResult<Schedule<f64>> {
        self.schedule(["factor", LIST_OF_NUMBERS], FACTOR_SCHEDULE_FORM, |item| {
            item.number()
        })
    }

    /// A quantity in time: through values, a list of this name and form, or a sine. `form` describes both.
    fn schedule<T: InTime>(
        &self,
        [name, values]: [&'static str; 2],
        form: &str,
        value: impl Fn(&EntryValue<'e>) -> ScenarioResult<T>,
    ) -> ScenarioResult<Schedule<T>> {
        let Some(table) = self.value.as_table() else {
            return Err(self.value_error(format_args!("must be a table: {form}")));
        };
        let is_sine = ["amplitude", "frequency"]
            .iter()
            .any(|key| table.contains_key(*key));
        let named = match name == "factor" && table.contains_key("value") {
            true => "value",
            false => name,
        };
        let allowed: &[&str] = match is_sine {
            true => &["amplitude", "frequency", "phase", "mean"],
            false => &["at", named, "smooth"],
        };
        if let Some(key) = table.keys().find(|key| !allowed.contains(&key.as_str())) {
            let key = shorten_excerpt(key);
            return Err(self.value_error(format_args!("unknown key {key}: {form}")));
        }
        let part = |name| {
            self.list(name)
                .ok_or_else(|| self.value_error(format_args!("{name} is missing: {form}")))
        };
        if is_sine {
            let number = |name| {
                self.list(name)
                    .map_or(Ok(0.0), |item| item.number_in(NumberRange::Finite))
            };
            return Ok(Schedule::Sine(Sine {
                mean: self.list("mean").map_or(Ok(T::ZERO), |item| value(&item))?,
                amplitude: value(&part("amplitude")?)?,
                frequency: part("frequency")?.number_in(NumberRange::Positive)?,
                phase: number("phase")?,
            }));
        }
        let at = part("at")?.increasing_numbers(KnotKind::Times)?;
        let list = part(named)?.list_of_length(at.len(), ONE_PER_KNOT, values)?;
        let values: Vec<T> = list
            .map(|item| value(&item))
            .collect::<ScenarioResult<_>>()?;
        match self
            .list("smooth")
            .map_or(Ok(false), |item| item.switch())?
        {
            true => Ok(Schedule::smooth(at, values)),
            false => Ok(Schedule::linear(at, values)),
        }
    }

    /// Increasing numbers: fractions of the length from 0 to 1, or times.
    fn increasing_numbers(&self, kind: KnotKind) -> ScenarioResult<Vec<f64>> {
        let fractions = kind != KnotKind::Times;
        let (what, least, too_few) = match fractions {
            true => (
                "knots",
                2,
                "at least two knots are needed, the first at 0 and the last at 1",
            ),
            false => ("times", 1, "at least one time is needed"),
        };
        let list = self.list_entries(LIST_OF_NUMBERS)?;
        let count = list.len();
        self.refuse_unless(count >= least, too_few)?;
        let mut at: Vec<f64> = Vec::with_capacity(count);
        for item in list {
            let next = item.number_in(NumberRange::Finite)?;
            let starts = !fractions || !at.is_empty() || next == 0.0;
            item.refuse_unless(starts, "must start at 0 (the base)")?;
            if kind == KnotKind::FractionsWithSteps && at.last() == Some(&next) {
                refuse_misplaced_step(&item, &at)?;
            } else if let Some(before) = at.last() {
                item.refuse_unless(
                    next > *before,
                    format_args!(
                        "must be greater than the entry before it, {before}: {what} rise{}",
                        match kind {
                            KnotKind::FractionsWithSteps => {
                                ", and two equal ones, next to each other, are a step"
                            }
                            _ => " strictly (write a step as a steep ramp)",
                        }
                    ),
                )?;
            }
            at.push(next);
            let ends = !fractions || at.len() < count || next == 1.0;
            item.refuse_unless(ends, "must end at 1 (the tip)")?;
        }
        Ok(at)
    }

    /// The entries of a list; `needed` describes the list in the error about a value that is none.
    fn list_entries(
        &self,
        needed: &str,
    ) -> ScenarioResult<impl ExactSizeIterator<Item = EntryValue<'e>> + use<'e>> {
        let Some(list) = self.value.as_array() else {
            return Err(self.value_error(format_args!("must be {needed}")));
        };
        let whole = *self;
        Ok((0..list.len()).map(move |index| whole.entry(index)))
    }

    /// The entries of a list of length `count`, `because` of what; `needed` describes the list in the
    /// error about a value that is none.
    pub fn list_of_length(
        &self,
        count: usize,
        because: &str,
        needed: &str,
    ) -> ScenarioResult<impl ExactSizeIterator<Item = EntryValue<'e>> + use<'e>> {
        let list = self.list_entries(needed)?;
        let found = list.len();
        self.refuse_unless(
            found == count,
            format_args!("has {found} entries: must have {count}, {because}"),
        )?;
        Ok(list)
    }

    /// Different whole numbers from 1 to `most`: one, or a list of them.
    pub fn whole_numbers(&self, most: usize) -> ScenarioResult<Vec<usize>> {
        if !self.value.is_array() {
            return Ok(vec![self.whole_number(most)?]);
        }
        let mut numbers = Vec::new();
        for item in self.list_entries(LIST_OF_NUMBERS)? {
            let number = item.whole_number(most)?;
            item.refuse_unless(!numbers.contains(&number), "stands in the list twice")?;
            numbers.push(number);
        }
        self.refuse_unless(!numbers.is_empty(), "has no entries")?;
        Ok(numbers)
    }

    /// A vector x, y, z, with components in the range of its key.
    pub fn vector(&self) -> ScenarioResult<[f64; 3]> {
        let needed = "a list of three numbers [x, y, z]";
        let mut vector = [0.0; 3];
        let components = self.list_of_length(3, "one per axis x, y, z", needed)?;
        for (component, item) in vector.iter_mut().zip(components) {
            *component = item.number()?;
        }
        Ok(vector)
    }

    /// A place in a section, along its directors d2 and d3.
    pub fn place_in_section(&self) -> ScenarioResult<[f64; 2]> {
        let needed = "a list of two numbers, along d2 and d3";
        let mut place = [0.0; 2];
        let components = self.list_of_length(2, "along the directors d2 and d3", needed)?;
        for (component, item) in place.iter_mut().zip(components) {
            *component = item.number()?;
        }
        Ok(place)
    }

    /// A vector for each of `rods` rods: one for all, or a list.
    pub fn vector_per_rod(&self, rods: usize) -> ScenarioResult<Vec<[f64; 3]>> {
        if self.value.is_array() && self.value.get(0).is_some_and(|first| first.is_array()) {
            let each = self.list_of_length(rods, ONE_PER_ROD, VECTORS)?;
            return each.map(|item| item.vector()).collect();
        }
        self.refuse_unless(
            self.value.is_array(),
            format_args!(
                "must be a list of three numbers [x, y, z], or a list of {rods} of them (one per rod)"
            ),
        )?;
        Ok(vec![self.vector()?; rods])
    }

    /// A vector along each of `rods` rods, one profile for each component.
    pub fn vector_profile_per_rod(&self, rods: usize) -> ScenarioResult<Vec<[Profile; 3]>> {
        if !self.value.is_table() {
            let each = self.vector_per_rod(rods)?.into_iter();
            return Ok(each.map(|of| of.map(Profile::Constant)).collect());
        }
        let [at, value] = self.knots_and_values("value", VECTOR_PROFILE_FORM)?;
        let at = at.profile_knots()?;
        let profiles = |list: EntryValue| -> ScenarioResult<[Profile; 3]> {
            let each = list.list_of_length(at.len(), ONE_PER_KNOT, VECTORS)?;
            let each: Vec<[f64; 3]> = each
                .map(|item| item.vector())
                .collect::<ScenarioResult<_>>()?;
            let along = |axis: usize| {
                let values = each.iter().map(|vector| vector[axis]).collect();
                list.profile_through(&at, values)
            };
            Ok([along(0)?, along(1)?, along(2)?])
        };
        let vector = value.value.get(0).and_then(|first| first.get(0));
        match vector.is_some_and(|component| component.is_array()) {
            true => {
                let each = value.list_of_length(rods, ONE_PER_ROD, VECTORS)?;
                each.map(profiles).collect()
            }
            false => Ok(vec![profiles(value)?; rods]),
        }
    }

    /// A vector at given times; for some keys also one vector for all times.
    pub fn vectors_in_time(&self) -> ScenarioResult<Schedule<[f64; 3]>> {
        // Where supports are is more often still than in time.
        let still = match self.key().table() {
            "grip" | "tip" => !self.value.is_table(),
            _ => self.key().form() == ValueSchema::VectorOrInTime && self.value.is_array(),
        };
        if still {
            return Ok(Schedule::constant(self.vector()?));
        }
        let form = match self.key().table() {
            "grip" | "tip" => MOTION_SCHEDULE_FORM,
            _ => LOAD_SCHEDULE_FORM,
        };
        self.schedule(["value", VECTORS], form, |item| item.vector())
    }

    /// Displacements and rotation vectors of bases in time: through values at common times, or each a quantity in
    /// time of its own.
    pub fn base_motion(&self) -> ScenarioResult<[Schedule<[f64; 3]>; 2]> {
        let Some(table) = self.value.as_table() else {
            return Err(self.value_error(format_args!("must be a table: {BASE_MOTION_FORM}")));
        };
        let is_common = table.contains_key("at");
        let allowed: &[&str] = match is_common {
            true => &["at", "move", "turn", "smooth"],
            false => &["move", "turn"],
        };
        if let Some(key) = table.keys().find(|key| !allowed.contains(&key.as_str())) {
            let key = shorten_excerpt(key);
            return Err(self.value_error(format_args!("unknown key {key}: {BASE_MOTION_FORM}")));
        }
        let moves = ["move", "turn"].map(|name| self.list(name));
        self.refuse_unless(
            moves.iter().any(Option::is_some),
            format_args!("move or turn is missing: {BASE_MOTION_FORM}"),
        )?;
        let read = |item: Option<EntryValue<'e>>| {
            let Some(item) = item else {
                return Ok(Schedule::constant([0.0; 3]));
            };
            let Some(at) = self.list("at") else {
                let vector = |item: &EntryValue<'e>| item.vector();
                return item.schedule(["value", VECTORS], BASE_MOTION_FORM, vector);
            };
            let at = at.increasing_numbers(KnotKind::Times)?;
            let list = item.list_of_length(at.len(), ONE_PER_KNOT, VECTORS)?;
            let values: Vec<[f64; 3]> = list
                .map(|item| item.vector())
                .collect::<ScenarioResult<_>>()?;
            let smooth = self
                .list("smooth")
                .map_or(Ok(false), |item| item.switch())?;
            Ok(match smooth {
                true => Schedule::smooth(at, values),
                false => Schedule::linear(at, values),
            })
        };
        let [moved, turned] = moves;
        Ok([read(moved)?, read(turned)?])
    }

    /// A place along a rod: a fraction of its length, greater than 0. One that is meant to be the base is read as
    /// [`ON_BASE`]: what acts there acts on the base.
    pub fn fraction(&self) -> ScenarioResult<f64> {
        Ok(self.common_fraction()?.max(ON_BASE))
    }

    /// A place along a rod as it is read: 0 if it is meant to be the base.
    fn common_fraction(&self) -> ScenarioResult<f64> {
        let at = self.number_in(NumberRange::Finite)?;
        self.refuse_unless(
            at > 0.0 && at <= 1.0,
            "must be greater than 0 (the base) and at most 1 (the tip): a fraction of the length",
        )?;
        Ok(self.entries.common_place(at))
    }

    /// A place that is held along a rod, which the base is already.
    fn held_fraction(&self) -> ScenarioResult<f64> {
        let at = self.common_fraction()?;
        self.refuse_unless(
            at > 0.0,
            format_args!(
                "is within {SAME_PLACE_DISTANCE:e} of the base, which is held: leave it out, or move it towards the tip"
            ),
        )?;
        Ok(at)
    }

    /// A stretch of a rod, `[from, to]`, or one point of it.
    pub fn fraction_interval(&self) -> ScenarioResult<[f64; 2]> {
        if number_of_value(self.value).is_some() {
            return Ok([self.held_fraction()?; 2]);
        }
        let needed = "a fraction of the length, or a list [from, to] of two";
        let mut ends = self.list_of_length(2, "where the stretch begins and ends", needed)?;
        let mut next = || ends.next().map_or(Ok(0.0), |item| item.held_fraction());
        let [from, to] = [next()?, next()?];
        let written = [0, 1].map(|k| self.entry(k).number().unwrap_or(f64::NAN));
        self.refuse_unless(
            from < to || written[0] >= written[1],
            format_args!(
                "is shorter than {SAME_PLACE_DISTANCE:e} of the length: give one place, with held = \"clamped\" if the \
                 directions are held, or a longer stretch"
            ),
        )?;
        self.refuse_unless(from < to, "must rise from the base to the tip")?;
        Ok([from, to])
    }
}

/// Refuses an entry that equals the last of those `before` it unless both are a step: two equal
/// fractions between the base and the tip.
fn refuse_misplaced_step(item: &EntryValue, before: &[f64]) -> ScenarioResult<()> {
    let last = before.len() - 1;
    let problem = match before[last] {
        0.0 => "a step at the base has no side before it: leave out the first entry and its value",
        1.0 => "a step at the tip has no side beyond it: leave out this entry and its value",
        here if last > 0 && before[last - 1] == here => {
            "is the third of equal entries: a step is two, the values before it and beyond it"
        }
        _ => return Ok(()),
    };
    Err(item.value_error(problem))
}
