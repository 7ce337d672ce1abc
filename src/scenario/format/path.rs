//! Paths of entries, as overrides and ranges name them: `load.gravity[2]`,
//! `stiffness.bending_2.value[1]`, `load.point[0].force[2]`, or all numbers of an entry together,
//! `scale:stiffness.bending_2`; and what was meant by a path that the format does not have.

use crate::scenario::format::error::shorten_excerpt;
use crate::scenario::format::{Key, TablePath, ValueSchema, table_header};
use std::fmt;
use toml::Value;

/// Lists that the table of a profile or a schedule can have.
const LIST_NAMES: [&str; 9] = [
    "at",
    "move",
    "turn",
    "value",
    "factor",
    "amplitude",
    "mean",
    "frequency",
    "phase",
];

const COMPONENT_INDICES_HINT: &str = "x, y, z have the indices 0, 1, 2";

/// The target of an override: an entry of a scenario, one of its lists, one entry of
/// that, or all numbers of one of these, which are then multiplied.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct EntryPath {
    /// The key of the entry.
    pub key: Key,
    /// Which of the tables with this key, counted from 0, if there may be several; else 0.
    pub(crate) row: usize,
    /// Which list of a profile or schedule.
    pub(crate) list: Option<&'static str>,
    /// Indices within the value or its list, the outermost first, counted from 0.
    pub(crate) indices: [Option<usize>; 3],
    /// Whether all numbers of the target are multiplied instead of replaced.
    pub(crate) scale: bool,
}

impl EntryPath {
    /// The whole value of a key in one of its tables.
    pub(super) fn whole_entry(key: Key, row: usize) -> EntryPath {
        EntryPath {
            key,
            row,
            list: None,
            indices: [None; 3],
            scale: false,
        }
    }

    /// Parses the path of an entry or a part of it; an error says what is wrong.
    pub(crate) fn parse(text: &str) -> Result<EntryPath, String> {
        let (scale, rest) = match text.trim().strip_prefix("scale:") {
            Some(rest) => (true, rest.trim()),
            None => (false, text.trim()),
        };
        let SplitPath {
            row,
            path,
            brackets,
        } = split_row(rest)?;
        let (key, list) = match Key::from_path(&path) {
            Some(key) => (key, None),
            None => {
                let list = path.rsplit_once('.').and_then(|(path, name)| {
                    let list = LIST_NAMES.into_iter().find(|list| *list == name)?;
                    Some((Key::from_path(path)?, Some(list)))
                });
                list.ok_or_else(|| unknown_key_message(&path))?
            }
        };
        let mut indices = [None; 3];
        for (place, index) in brackets.split_terminator(']').enumerate() {
            let index = index.trim().strip_prefix('[').ok_or_else(invalid_index)?;
            *indices.get_mut(place).ok_or_else(invalid_index)? = Some(parse_index(index)?);
        }
        if indices[2].is_some() && !matches!(key.form(), ValueSchema::VectorQuantity(_)) {
            return Err(invalid_index());
        }
        if !brackets.is_empty() && !brackets.ends_with(']') {
            return Err(invalid_index());
        }
        let part = EntryPath {
            key,
            row: row.unwrap_or(0),
            list,
            indices,
            scale,
        };
        if row.is_none() && key.is_repeated() {
            let TablePath { table, name } = key.table_path();
            return Err(format!("say which one, counted from 0: {table}[0].{name}"));
        }
        part.check_form()?;
        Ok(part)
    }

    /// Refuses a list, an index or a factor that values of this key do not have.
    fn check_form(&self) -> Result<(), String> {
        let (form, path, index) = (self.key.form(), self.key.path(), self.indices[0]);
        let single = matches!(
            form,
            ValueSchema::Text
                | ValueSchema::TextPerRod
                | ValueSchema::Switch
                | ValueSchema::Whole
                | ValueSchema::WholeOrList
        );
        match form {
            _ if single && self.scale => Err("has no numbers that could be scaled".into()),
            ValueSchema::Whole | ValueSchema::Number(_) if index.is_some() => {
                Err("is one number: leave the index out".into())
            }
            ValueSchema::Text | ValueSchema::Switch if index.is_some() => {
                Err("has no entries".into())
            }
            ValueSchema::AxisStiffness if index > Some(2) => Err(COMPONENT_INDICES_HINT.into()),
            ValueSchema::Vector | ValueSchema::VectorOrInTime
                if self.list.is_none() && index > Some(2) =>
            {
                Err(COMPONENT_INDICES_HINT.into())
            }
            ValueSchema::VectorPerRod if self.indices[1] > Some(2) => {
                Err(COMPONENT_INDICES_HINT.into())
            }
            ValueSchema::AcrossSection if index > Some(1) => {
                Err("has the components 0 and 1, along d2 and d3".into())
            }
            ValueSchema::Quantity(_) | ValueSchema::Outline(_) | ValueSchema::VectorQuantity(_) => {
                Ok(())
            }
            ValueSchema::VectorInTime
            | ValueSchema::VectorOrInTime
            | ValueSchema::FactorInTime
            | ValueSchema::BaseMotion => Ok(()),
            _ if self.list.is_some() => Err(format!("{path} has no lists within")),
            _ => Ok(()),
        }
    }

    /// Refuses what is not a single number, or one for all rods, that can vary.
    pub(crate) fn check_is_number(&self) -> Result<(), String> {
        let path = self.key.path();
        let within = self
            .list
            .map_or(path.to_string(), |list| format!("{path}.{list}"));
        let list = || Err(format!("is a list: give an index, as in {within}[0]"));
        match self.key.form() {
            _ if self.scale => Ok(()),
            ValueSchema::Text | ValueSchema::TextPerRod | ValueSchema::Switch => {
                Err("takes no number that could vary".into())
            }
            ValueSchema::VectorInTime | ValueSchema::FactorInTime | ValueSchema::BaseMotion
                if self.list.is_none() =>
            {
                Err(format!(
                    "takes no number that could vary; its entries do: {path}.at[0]"
                ))
            }
            ValueSchema::Vector
            | ValueSchema::AxisStiffness
            | ValueSchema::VectorOrInTime
            | ValueSchema::Fan
            | ValueSchema::Pixel
            | ValueSchema::AcrossSection
                if self.indices[0].is_none() =>
            {
                list()
            }
            ValueSchema::VectorPerRod | ValueSchema::VectorQuantity(_)
                if self.indices[0].is_none() =>
            {
                list()
            }
            // One index is that of a component, two are those of a rod and a component.
            ValueSchema::VectorPerRod | ValueSchema::VectorQuantity(_)
                if self.list.is_none() && self.indices[1].or(self.indices[0]) > Some(2) =>
            {
                Err(COMPONENT_INDICES_HINT.into())
            }
            _ if matches!(self.list, Some("frequency" | "phase")) => Ok(()),
            ValueSchema::FactorInTime if matches!(self.list, Some("amplitude" | "mean")) => Ok(()),
            _ if self.list.is_some() && self.indices[0].is_none() => list(),
            _ => Ok(()),
        }
    }

    /// Whether the path names the whole value of its key.
    pub(super) fn is_whole(&self) -> bool {
        self.list.is_none() && self.indices[0].is_none() && !self.scale
    }

    /// Whether the path names a vector or another list that is always one, and none of its entries.
    pub(crate) fn is_whole_list(&self) -> bool {
        let list = matches!(
            self.key.form(),
            ValueSchema::Vector
                | ValueSchema::VectorOrInTime
                | ValueSchema::VectorPerRod
                | ValueSchema::VectorQuantity(_)
                | ValueSchema::Fan
                | ValueSchema::AxisStiffness
                | ValueSchema::AcrossSection
                | ValueSchema::Pixel
        );
        list && self.is_whole()
    }

    /// Whether the path names a place where nodes must be, on the way from the base to the tip.
    pub(crate) fn is_node_position(&self) -> bool {
        self.list == Some("at") || matches!(self.key, Key::PointAt | Key::GripAt)
    }

    /// How many of the indices of a vector for each rod are in vain where one `value` holds for all.
    pub(super) fn shared_indices(&self, value: &Value) -> usize {
        let is_vector = matches!(
            self.key.form(),
            ValueSchema::VectorPerRod | ValueSchema::VectorQuantity(_)
        );
        if !is_vector || value.is_table() || self.list == Some("at") {
            return 0;
        }
        let wanted = self.indices.iter().flatten().count();
        let depth = std::iter::successors(Some(value), |value| value.get(0)).count() - 1;
        wanted.saturating_sub(depth)
    }

    /// The paths of all numbers in the value of this path: every entry of a list or a profile.
    pub(crate) fn number_paths(self, value: &Value) -> Vec<EntryPath> {
        let depth = self.indices.iter().flatten().count();
        match value {
            _ if self.scale => vec![self],
            Value::Array(list) if depth < self.indices.len() => {
                let entry = |(index, value): (usize, &Value)| {
                    let mut part = self;
                    part.indices[depth] = Some(index);
                    part.number_paths(value)
                };
                list.iter().enumerate().flat_map(entry).collect()
            }
            Value::Table(table) if self.list.is_none() => match table.get("value") {
                Some(value) => {
                    let list = Some("value");
                    EntryPath { list, ..self }.number_paths(value)
                }
                None => vec![self],
            },
            _ => vec![self],
        }
    }

    /// Whether some number belongs to both paths.
    pub(crate) fn overlaps(&self, other: &EntryPath) -> bool {
        let same =
            |one: Option<usize>, two: Option<usize>| one.is_none() || two.is_none() || one == two;
        let lists = self.list.is_none() || other.list.is_none() || self.list == other.list;
        let mut pairs = self.indices.iter().zip(other.indices);
        (self.key, self.row) == (other.key, other.row)
            && lists
            && pairs.all(|(one, two)| same(*one, two))
    }
}

impl fmt::Display for EntryPath {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let scale = if self.scale { "scale:" } else { "" };
        match self.key.table_path() {
            TablePath { table, name } if self.key.is_repeated() => {
                write!(f, "{scale}{table}[{}].{name}", self.row)?;
            }
            _ => write!(f, "{scale}{}", self.key.path())?,
        }
        self.list.map_or(Ok(()), |list| write!(f, ".{list}"))?;
        let mut indices = self.indices.iter().flatten();
        indices.try_for_each(|index| write!(f, "[{index}]"))
    }
}

/// The text of a path, split up.
struct SplitPath<'p> {
    /// Which one of several tables is meant, counted from 0.
    row: Option<usize>,
    /// The path of the key.
    path: String,
    /// The indices within the value, as they are written.
    brackets: &'p str,
}

fn split_row(text: &str) -> Result<SplitPath<'_>, String> {
    let within = |table: &&str| {
        let rest = text.strip_prefix(table)?.trim_start().strip_prefix('[')?;
        rest.split_once(']')
    };
    let named = Key::REPEATED_TABLES
        .iter()
        .find_map(|table| Some((table, within(table)?)));
    let (row, outer, rest) = match named {
        Some((table, (row, rest))) => {
            let row = parse_index(row)?;
            let Some(rest) = rest.trim_start().strip_prefix('.') else {
                let names = Key::allowed_in(table).join(", ");
                return Err(format!(
                    "name an entry of it: {names}, as in {table}[0].vein"
                ));
            };
            (Some(row), format!("{table}."), rest)
        }
        None => (None, String::new(), text),
    };
    let (path, brackets) = rest.split_at(rest.find('[').unwrap_or(rest.len()));
    Ok(SplitPath {
        row,
        path: outer + path.trim(),
        brackets,
    })
}

fn parse_index(index: &str) -> Result<usize, String> {
    index.trim().parse().map_err(|_| invalid_index())
}

fn invalid_index() -> String {
    "an index is a whole number from 0, as in load.gravity[2]".into()
}

/// How far the spelling of a name may be from a key that was probably meant. Lengths are in characters.
struct SpellingLimits {
    /// No key is longer; what follows is not compared.
    longest_key: usize,
    /// One edit is allowed, and one more for so many letters ...
    letters_per_edit: usize,
    /// ... up to this length.
    longest_with_more_edits: usize,
}

const SPELLING: SpellingLimits = SpellingLimits {
    longest_key: 80,
    letters_per_edit: 5,
    longest_with_more_edits: 40,
};

/// What the numbers of a table are called elsewhere, and here.
const OTHER_NAMES: [(&str, &str); 15] = [
    ("nu", "poisson"),
    ("E", "young"),
    ("G", "shear_modulus"),
    ("rho", "mass_density"),
    ("rho", "density"),
    ("density", "mass_density"),
    ("mass", "density"),
    ("EI", "bending_2"),
    ("GJ", "torsion"),
    ("EA", "axial"),
    ("radius", "diameter"),
    ("height", "thickness"),
    ("veins", "rods"),
    ("angle", "elevation"),
    ("angles", "fan"),
];

/// The key of the table of `path` that has another name elsewhere.
fn key_by_another_name(path: &str) -> Option<&'static str> {
    let (table, name) = path.rsplit_once('.')?;
    let named = |(other, ours): &(&str, &str)| {
        let key = Key::all().find(|key| key.path() == format!("{table}.{ours}"));
        key.filter(|_| *other == name)
    };
    OTHER_NAMES.iter().find_map(named).map(Key::path)
}

/// The key or table that was probably meant by `path`: what has another name elsewhere, the same name in
/// another table, or the nearest spelling.
pub(super) fn nearest_key(path: &str) -> Option<&'static str> {
    if let Some(meant) = key_by_another_name(path) {
        return Some(meant);
    }
    let name = path.rsplit('.').next().unwrap_or(path);
    // `units.mass` does not mean `load.point.mass`.
    let of_numbers = |key: &Key| key.table_path().name == name && !path.starts_with("units.");
    if let Some(key) = Key::all().find(of_numbers) {
        return Some(key.path());
    }
    let path: String = path.chars().take(SPELLING.longest_key).collect();
    let counted = path.chars().count().min(SPELLING.longest_with_more_edits);
    let most = 1 + counted / SPELLING.letters_per_edit;
    let candidates = Key::all().map(Key::path).chain(Key::tables());
    let near = candidates.map(|candidate| (strsim::levenshtein(&path, candidate), candidate));
    let (edits, candidate) = near.min()?;
    // `dynamics.dampng` is a word of `dynamics.external_damping`.
    let of_words = nearest_by_word(&path).filter(|by_word| by_word.0 < edits);
    let (edits, candidate) = of_words.unwrap_or((edits, candidate));
    (edits <= most).then_some(candidate)
}

/// The first key of the table of a path of which a word is nearest to the name, and by how many edits; a shorter word
/// than of four letters is like many.
fn nearest_by_word(path: &str) -> Option<(usize, &'static str)> {
    let (table, name) = path.rsplit_once('.')?;
    let most = 1 + name.chars().count() / SPELLING.letters_per_edit;
    let of_table = Key::all().filter(|key| key.table_path().table == table);
    let by_word = |key: Key| {
        let words = key
            .table_path()
            .name
            .split('_')
            .filter(|word| word.len() > 3);
        let edits = words.map(|word| strsim::levenshtein(name, word)).min()?;
        (edits < most).then_some((edits, key.path()))
    };
    of_table.filter_map(by_word).min_by_key(|(edits, _)| *edits)
}

/// The message for an unknown key, with what was probably meant.
fn unknown_key_message(path: &str) -> String {
    let found = shorten_excerpt(path);
    match nearest_key(path) {
        // The name of its table says less than what is in it.
        Some(meant) if path != meant && !path.starts_with(&format!("{meant}.")) => {
            return format!("unknown key {found} (did you mean {meant}?)");
        }
        _ => (),
    }
    let tables = Key::tables();
    let inside = |table: &str| {
        let rest = path.strip_prefix(table);
        rest.is_some_and(|rest| rest.is_empty() || rest.starts_with('.'))
    };
    match tables.iter().rfind(|known| inside(known)) {
        Some(table) => {
            let allowed = Key::allowed_in(table).join(", ");
            let header = table_header(table);
            format!("unknown key {found}: {header} has {allowed}")
        }
        None => {
            let tables = Key::allowed_in("")
                .into_iter()
                .filter(|name| *name != "name");
            let tables = tables.collect::<Vec<_>>().join(", ");
            format!("unknown key {found}: keys are name and those of {tables}, as in leaf.rods")
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn misspelt_keys_are_recognized() {
        for (misspelt, key) in [
            ("stiffness.bending2", Some("stiffness.bending_2")),
            ("gravity", Some("load.gravity")),
            ("dynamics.gravty", Some("dynamics.gravity")),
            ("leaf.rod", Some("leaf.rods")),
            ("units.lenght", Some("units.length")),
            ("units.mass", None),
            ("monsoon", None),
            ("dynamics.dampng", Some("dynamics.external_damping")),
        ] {
            assert_eq!(nearest_key(misspelt), key);
        }
    }
}
