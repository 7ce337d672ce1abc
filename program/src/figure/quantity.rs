//! The numbers of a scenario in words, with their units: for pictures.

use super::setting::with_unit;
use leafdyn::scenario::{Key, Units};

/// What the entries of a list belong to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Entries {
    /// Nothing that has a name.
    Plain,
    /// The three axes, along or about which the quantity is; before them, the veins.
    Along,
    About,
    Veins,
    /// Gaps between neighbouring veins.
    Gaps,
}

use Entries::*;

/// Keys with their words and what the entries of their lists belong to.
const WORDS: &[(&str, &str, Entries)] = &[
    ("leaf.rods", "number of veins", Plain),
    ("leaf.length", "length", Veins),
    ("leaf.fan", "angle at the base", Veins),
    ("leaf.base", "position of the base", Along),
    ("leaf.elevation", "elevation at the base", Veins),
    ("stiffness.torsion", "torsional stiffness A1", Veins),
    ("stiffness.bending_2", "bending stiffness A2", Veins),
    ("stiffness.bending_3", "bending stiffness A3", Veins),
    ("stiffness.axial", "axial stiffness H1", Veins),
    ("stiffness.shear_2", "shear stiffness H2", Veins),
    ("stiffness.shear_3", "shear stiffness H3", Veins),
    ("section.diameter", "diameter", Veins),
    ("section.width", "width of the section", Veins),
    ("section.thickness", "thickness of the section", Veins),
    ("section.inner_diameter", "diameter of the bore", Veins),
    ("section.wall", "thickness of the wall", Veins),
    ("section.young", "Young's modulus", Veins),
    ("section.poisson", "Poisson's ratio", Veins),
    ("section.mass_density", "mass per volume", Veins),
    ("blade.length", "length of the blade", Plain),
    ("blade.width", "width of the blade", Plain),
    ("blade.thickness", "thickness of the blade", Veins),
    ("blade.young", "Young's modulus along", Veins),
    ("blade.young_across", "Young's modulus across", Veins),
    ("blade.shear_modulus", "shear modulus", Veins),
    ("blade.poisson", "Poisson's ratio", Veins),
    ("blade.mass_density", "mass per volume", Veins),
    ("blade.least_width", "least width of the blade", Plain),
    ("rest.twist", "twist at rest", Veins),
    ("rest.bend_2", "curvature at rest about d2", Veins),
    ("rest.bend_3", "curvature at rest about d3", Veins),
    ("rest.stretch", "growth", Veins),
    ("coupling.x", "coupling along x", Gaps),
    ("coupling.y", "coupling along y", Gaps),
    ("coupling.z", "coupling along z", Gaps),
    ("tissue.along", "tissue along the veins", Gaps),
    ("tissue.across", "tissue across the veins", Gaps),
    ("tissue.normal", "tissue normal to the leaf", Gaps),
    ("tissue.fold", "tissue in folds", Gaps),
    ("load.gravity", "gravity", Along),
    ("load.g", "acceleration of gravity", Along),
    ("load.distributed", "force per length", Along),
    ("load.tip_force", "force on the tip", Along),
    ("load.tip_moment", "moment on the tip", About),
    ("load.point.at", "place of point", Plain),
    ("load.point.force", "force on point", Along),
    ("load.point.moment", "moment on point", About),
    ("load.point.mass", "mass of point", Plain),
    ("tip.position", "position of the tip", Along),
    ("tip.angles", "angle at the tip", Veins),
    ("tip.twist", "twist at the tip", Veins),
    ("grip.at", "place of grip", Plain),
    ("grip.move", "displacement of grip", Along),
    ("dynamics.density", "mass per length", Veins),
    ("dynamics.rotary_inertia", "rotary inertia", Veins),
    ("dynamics.section_radius", "radius of the section", Veins),
    ("dynamics.external_damping", "external damping", Plain),
    ("dynamics.internal_damping", "internal damping", Plain),
    ("dynamics.duration", "duration", Plain),
    ("wind.velocity", "velocity of the air", Along),
    ("wind.density", "density of the air", Plain),
    ("wind.drag", "drag coefficient", Plain),
    ("wind.width", "width in the wind", Veins),
    ("photo.scale", "length of a pixel", Plain),
    ("photo.x", "pixel of the origin, to the right", Plain),
    ("photo.y", "pixel of the origin, down", Plain),
    ("photo.rotation", "rotation of the photograph", Plain),
    ("method.step", "time step", Plain),
    ("method.segments", "segments a vein", Plain),
];

/// Of more keys than this only the first and the last are named.
const NAMED: usize = 3;

/// A number of a scenario.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Quantity {
    pub words: String,
    /// The unit, if the scenario names those of which it consists.
    pub unit: Option<String>,
}

impl Quantity {
    /// The number of these keys, which are joined by `+` where several have one value.
    pub fn of(keys: &str, units: &Units) -> Quantity {
        let parts: Vec<KeyPart> = keys.split('+').map(KeyPart::parse).collect();
        let words = match alike_veins(&parts) {
            Some(words) => words,
            None => {
                let words: Vec<String> = parts.iter().map(KeyPart::words).collect();
                match words.as_slice() {
                    [first, .., last] if words.len() > NAMED => format!("{first} = … = {last}"),
                    few => few.join(" = "),
                }
            }
        };
        let unit = parts.first().and_then(|part| part.unit(units));
        Quantity { words, unit }
    }

    /// The same as the name of an axis.
    pub fn axis(&self) -> String {
        with_unit(&self.words, self.unit.as_deref())
    }
}

/// A key as it is written: `scale:load.point[0].force[2]`, `rest.bend_2.value[1]`.
struct KeyPart<'t> {
    text: &'t str,
    scale: bool,
    path: String,
    row: Option<usize>,
    list: Option<&'t str>,
    indices: Vec<usize>,
    named: Option<(&'static str, Entries)>,
}

impl<'t> KeyPart<'t> {
    fn parse(text: &'t str) -> Self {
        let text = text.trim();
        let (scale, rest) = match text.strip_prefix("scale:") {
            Some(rest) => (true, rest),
            None => (false, text),
        };
        let mut pieces: Vec<(&str, Vec<usize>)> = (rest.split('.'))
            .map(|piece| {
                let mut parts = piece.split('[');
                let name = parts.next().unwrap_or_default();
                let indices = parts.filter_map(|it| it.trim_end_matches(']').parse().ok());
                (name, indices.collect())
            })
            .collect();
        let joined = |pieces: &[(&str, Vec<usize>)]| {
            let names: Vec<&str> = pieces.iter().map(|piece| piece.0).collect();
            names.join(".")
        };
        let named = |path: &str| {
            let found = WORDS.iter().find(|row| row.0 == path);
            found.map(|row| (row.1, row.2))
        };
        let last = pieces.len().saturating_sub(1);
        let list = match named(&joined(&pieces)) {
            None if last > 0 => Some(pieces[last].0),
            _ => None,
        };
        let indices = pieces[last].1.clone();
        pieces.truncate(if list.is_some() { last } else { last + 1 });
        let path = joined(&pieces);
        // The row of a repeated table is an index of its name, before that of the key.
        let row = pieces.iter().rev().skip(1);
        let row = row.flat_map(|piece| &piece.1).next().copied();
        KeyPart {
            named: named(&path).filter(|_| list.is_none_or(|it| ["value", "at"].contains(&it))),
            text,
            scale,
            path,
            row,
            list,
            indices,
        }
    }

    fn words(&self) -> String {
        let Some((words, entries)) = self.named else {
            return self.text.into();
        };
        let mut words = words.to_string();
        words.extend(self.row.map(|row| format!(" {}", row + 1)));
        let (knot, mut indices) = match (self.list, self.indices.split_first()) {
            (Some(_), Some((knot, rest))) => (Some(knot + 1), rest),
            _ => (None, &self.indices[..]),
        };
        if let (Along | About, Some((&axis, veins))) = (entries, indices.split_last()) {
            let by = if entries == Along { "along" } else { "about" };
            words += &format!(" {by} {}", ["x", "y", "z"].get(axis).unwrap_or(&"?"));
            indices = veins;
        }
        match (entries, indices) {
            (Gaps, [gap, ..]) => words += &format!(", veins {} and {}", gap + 1, gap + 2),
            (Plain, [entry, ..]) => words += &format!(", entry {}", entry + 1),
            (_, [vein, ..]) => words += &format!(", vein {}", vein + 1),
            (_, []) => (),
        }
        match (self.list, knot) {
            (Some("at"), Some(knot)) => words = format!("place of knot {knot}, {words}"),
            (_, Some(knot)) => words += &format!(", knot {knot}"),
            _ => (),
        }
        match self.scale {
            true => format!("factor of {words}"),
            false => words,
        }
    }

    fn unit(&self, units: &Units) -> Option<String> {
        if self.scale || self.list == Some("at") {
            return None;
        }
        units.of(Key::from_path(&self.path)?.dimension())
    }
}

/// One number of several veins, as in `bending stiffness A2, veins 1–5, 7–11`.
fn alike_veins(parts: &[KeyPart]) -> Option<String> {
    let first = parts.first().filter(|_| parts.len() > 1)?;
    let (words, entries) = first.named?;
    let alike = |part: &KeyPart| {
        let plain = part.list.is_none() && part.indices.len() == 1;
        plain && part.path == first.path && part.scale == first.scale
    };
    if entries != Veins || !parts.iter().all(alike) {
        return None;
    }
    let mut runs: Vec<[usize; 2]> = Vec::new();
    for vein in parts.iter().map(|part| part.indices[0] + 1) {
        match runs.last_mut() {
            Some([_, last]) if *last + 1 == vein => *last = vein,
            _ => runs.push([vein; 2]),
        }
    }
    let runs = runs.into_iter().map(|[from, to]| match to - from {
        0 => from.to_string(),
        1 => format!("{from}, {to}"),
        _ => format!("{from}–{to}"),
    });
    let factor = if first.scale { "factor of " } else { "" };
    let runs: Vec<String> = runs.collect();
    Some(format!("{factor}{words}, veins {}", runs.join(", ")))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cm() -> Units {
        Units {
            length: Some("cm".into()),
            force: Some("N".into()),
            time: None,
        }
    }

    #[test]
    fn every_key_with_words_is_one_of_the_format() {
        for (path, ..) in WORDS {
            let known = Key::from_path(path).is_some() || path.starts_with("method.");
            assert!(known, "{path}");
        }
    }

    #[test]
    fn keys_are_told_in_words_and_units() {
        for (keys, axis) in [
            ("stiffness.bending_2", "bending stiffness A2 / N cm²"),
            ("stiffness.axial[2]", "axial stiffness H1, vein 3 / N"),
            ("load.gravity[2]", "gravity along z / (N/cm)"),
            ("load.gravity[4][2]", "gravity along z, vein 5 / (N/cm)"),
            ("load.tip_moment[1]", "moment on the tip about y / N cm"),
            ("load.point[0].force[2]", "force on point 1 along z / N"),
            ("grip[1].move[0]", "displacement of grip 2 along x / cm"),
            (
                "rest.bend_2.value[1]",
                "curvature at rest about d2, knot 2 / (1/cm)",
            ),
            (
                "rest.bend_2.at[1]",
                "place of knot 2, curvature at rest about d2",
            ),
            (
                "tissue.along[0]",
                "tissue along the veins, veins 1 and 2 / (N/cm²)",
            ),
            (
                "scale:stiffness.torsion",
                "factor of torsional stiffness A1",
            ),
            ("leaf.rods", "number of veins"),
            ("method.step", "time step"),
            (
                "dynamics.gravity.value[0][2]",
                "dynamics.gravity.value[0][2] / (N/cm)",
            ),
        ] {
            assert_eq!(Quantity::of(keys, &cm()).axis(), axis, "{keys}");
        }
        let without = Quantity::of("stiffness.bending_2", &Units::default());
        assert_eq!(without.axis(), "bending stiffness A2");
        // A density has a unit of time, which is not named.
        assert_eq!(Quantity::of("dynamics.density", &cm()).unit, None);
    }

    #[test]
    fn keys_with_one_value_share_their_words() {
        let words = |keys: &str| Quantity::of(keys, &cm()).words;
        let veins = [0, 1, 2, 4, 6, 7].map(|vein| format!("stiffness.bending_2[{vein}]"));
        let told = "bending stiffness A2, veins 1–3, 5, 7, 8";
        assert_eq!(words(&veins.join("+")), told);
        let rigid = "axial stiffness H1 = shear stiffness H2";
        assert_eq!(words("stiffness.axial+stiffness.shear_2"), rigid);
        let four = "leaf.length+coupling.x+coupling.y+coupling.z";
        assert_eq!(words(four), "length = … = coupling along z");
    }
}
