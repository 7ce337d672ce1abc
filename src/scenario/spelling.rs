//! What was probably meant by a key that is none of the format.

use super::excerpt::shorten;
use super::key::Key;

/// The key or table that was probably meant by `path`: the same name in
/// another table, or the nearest spelling.
pub(crate) fn nearest(path: &str) -> Option<&'static str> {
    let name = path.rsplit('.').next().unwrap_or(path);
    // The name of a unit is none of a number.
    let of_numbers = |key: &Key| key.parts().1 == name && !path.starts_with("units.");
    if let Some(key) = Key::all().find(of_numbers) {
        return Some(key.path());
    }
    // No key is longer than this.
    let path: String = path.chars().take(80).collect();
    let most = 1 + path.chars().count().min(40) / 5;
    let candidates = Key::all().map(Key::path).chain(Key::tables());
    let near = candidates.map(|candidate| (strsim::levenshtein(&path, candidate), candidate));
    let (edits, candidate) = near.min()?;
    (edits <= most).then_some(candidate)
}

/// The message for an unknown key, with what was probably meant.
pub(super) fn unknown(path: &str) -> String {
    let found = shorten(path);
    match nearest(path) {
        Some(meant) if meant != path => {
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
            let (open, close) = brackets(table);
            format!("unknown key {found}: {open}{table}{close} has {allowed}")
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

/// What stands around the name of a table.
pub(super) fn brackets(table: &str) -> (&'static str, &'static str) {
    match Key::REPEATED.contains(&table) {
        true => ("[[", "]]"),
        false => ("[", "]"),
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
        ] {
            assert_eq!(nearest(misspelt), key);
        }
    }
}
