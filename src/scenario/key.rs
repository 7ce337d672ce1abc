//! The keys of the format, in one table: what may be written, and an example
//! of each for messages.

/// A key of the scenario format.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Key {
    /// `name`: the leaf's name.
    Name,
    /// `units.length`: name of the unit of length.
    UnitLength,
    /// `units.force`: name of the unit of force.
    UnitForce,
    /// `leaf.rods`: number of rods.
    Rods,
    /// `leaf.length`: lengths.
    Length,
    /// `leaf.fan`: base angles.
    Fan,
    /// `leaf.joined`: whether the tips share one point.
    Joined,
    /// `stiffness.torsion`: A1.
    Torsion,
    /// `stiffness.bending_2`: A2.
    Bending2,
    /// `stiffness.bending_3`: A3.
    Bending3,
    /// `stiffness.axial`: H1.
    Axial,
    /// `stiffness.shear_2`: H2.
    Shear2,
    /// `stiffness.shear_3`: H3.
    Shear3,
    /// `rest.twist`: u0 about d1.
    RestTwist,
    /// `rest.bend_2`: u0 about d2.
    RestBend2,
    /// `rest.bend_3`: u0 about d3.
    RestBend3,
    /// `rest.stretch`: growth of the rest length, a factor.
    RestStretch,
    /// `coupling.x`: coupling along e1.
    CouplingX,
    /// `coupling.y`: coupling along e2.
    CouplingY,
    /// `coupling.z`: coupling along e3.
    CouplingZ,
    /// `load.gravity`: force per unit length.
    Gravity,
    /// `load.tip_force`: dead force.
    TipForce,
    /// `load.tip_moment`: dead moment, one rod only.
    TipMoment,
    /// `solve.tolerance`: wanted accuracy.
    Tolerance,
    /// `dynamics.density`: mass per unit length.
    Density,
    /// `dynamics.rotary_inertia`: rho I.
    RotaryInertia,
    /// `dynamics.section_radius`: radius of the section, instead of rho I.
    SectionRadius,
    /// `dynamics.external_damping`: viscous force per unit length and velocity.
    ExternalDamping,
    /// `dynamics.internal_damping`: retardation time of the material.
    InternalDamping,
    /// `dynamics.duration`: how long the leaf is followed.
    Duration,
    /// `dynamics.output_interval`: time between two outputs.
    OutputInterval,
    /// `dynamics.clamped`: whether the base is held.
    Clamped,
    /// `dynamics.start`: where the motion begins.
    Start,
    /// `dynamics.gravity`: gravity in time.
    GravityInTime,
    /// `dynamics.tip_force`: dead force in time.
    TipForceInTime,
    /// `dynamics.tip_moment`: dead moment in time, one rod only.
    TipMomentInTime,
    /// `dynamics.rest`: factor of the rest curvatures in time.
    RestInTime,
}

const LOAD_IN_TIME: &str = "{ at = [0.0, 1.0], value = [[0.0, 0.0, 0.0], [0.0, 0.0, 0.0]] }";

/// Key, full path, and an example of its value; in the order of [`Key`].
const FORMAT: [(Key, &str, &str); 37] = [
    (Key::Name, "name", "\"my-leaf\""),
    (Key::UnitLength, "units.length", "\"cm\""),
    (Key::UnitForce, "units.force", "\"N\""),
    (Key::Rods, "leaf.rods", "5"),
    (Key::Length, "leaf.length", "1.0"),
    (Key::Fan, "leaf.fan", "\"symmetric\""),
    (Key::Joined, "leaf.joined", "true"),
    (Key::Torsion, "stiffness.torsion", "1.0"),
    (Key::Bending2, "stiffness.bending_2", "1.0"),
    (Key::Bending3, "stiffness.bending_3", "1.0"),
    (Key::Axial, "stiffness.axial", "100.0"),
    (Key::Shear2, "stiffness.shear_2", "100.0"),
    (Key::Shear3, "stiffness.shear_3", "100.0"),
    (Key::RestTwist, "rest.twist", "0.0"),
    (Key::RestBend2, "rest.bend_2", "0.0"),
    (Key::RestBend3, "rest.bend_3", "0.0"),
    (Key::RestStretch, "rest.stretch", "1.0"),
    (Key::CouplingX, "coupling.x", "0.0"),
    (Key::CouplingY, "coupling.y", "1.0"),
    (Key::CouplingZ, "coupling.z", "1.0"),
    (Key::Gravity, "load.gravity", "[0.0, 0.0, -1.0]"),
    (Key::TipForce, "load.tip_force", "[0.0, 0.0, 0.0]"),
    (Key::TipMoment, "load.tip_moment", "[0.0, 0.0, 0.0]"),
    (Key::Tolerance, "solve.tolerance", "1e-6"),
    (Key::Density, "dynamics.density", "1.0"),
    (Key::RotaryInertia, "dynamics.rotary_inertia", "0.01"),
    (Key::SectionRadius, "dynamics.section_radius", "0.2"),
    (Key::ExternalDamping, "dynamics.external_damping", "1.0"),
    (Key::InternalDamping, "dynamics.internal_damping", "0.0"),
    (Key::Duration, "dynamics.duration", "10.0"),
    (Key::OutputInterval, "dynamics.output_interval", "0.1"),
    (Key::Clamped, "dynamics.clamped", "true"),
    (Key::Start, "dynamics.start", "\"at-rest\""),
    (Key::GravityInTime, "dynamics.gravity", LOAD_IN_TIME),
    (Key::TipForceInTime, "dynamics.tip_force", LOAD_IN_TIME),
    (Key::TipMomentInTime, "dynamics.tip_moment", LOAD_IN_TIME),
    (
        Key::RestInTime,
        "dynamics.rest",
        "{ at = [0.0, 1.0], factor = [1.0, 2.0] }",
    ),
];

/// The tables of the format.
pub(super) const TABLES: [&str; 8] = [
    "units",
    "leaf",
    "stiffness",
    "rest",
    "coupling",
    "load",
    "solve",
    "dynamics",
];

impl Key {
    pub(super) const COUNT: usize = FORMAT.len();

    /// As `--set` takes it: `table.key`, or `name`.
    pub fn path(self) -> &'static str {
        FORMAT[self as usize].1
    }

    /// The table it stands in; empty at the top.
    pub(super) fn table(self) -> &'static str {
        self.path().split_once('.').map_or("", |(table, _)| table)
    }

    /// Its name within its table.
    pub(super) fn short_name(self) -> &'static str {
        self.path()
            .split_once('.')
            .map_or(self.path(), |(_, name)| name)
    }

    /// A value that would be accepted.
    pub(super) fn example(self) -> &'static str {
        FORMAT[self as usize].2
    }

    pub(crate) fn all() -> impl Iterator<Item = Key> {
        FORMAT.iter().map(|row| row.0)
    }

    pub(crate) fn from_path(path: &str) -> Option<Key> {
        Key::all().find(|key| key.path() == path)
    }

    /// What may be written in `table`; at the top ("") the tables as well.
    pub(super) fn allowed_in(table: &str) -> Vec<&'static str> {
        let tables = if table.is_empty() { &TABLES[..] } else { &[] };
        Key::all()
            .filter(|key| key.table() == table)
            .map(Key::short_name)
            .chain(tables.iter().copied())
            .collect()
    }
}

/// The key or table that was probably meant by `path`: the same name in
/// another table, or the nearest spelling.
pub(crate) fn nearest(path: &str) -> Option<&'static str> {
    let name = path.rsplit('.').next().unwrap_or(path);
    if let Some(key) = Key::all().find(|key| key.short_name() == name) {
        return Some(key.path());
    }
    let most = 1 + path.chars().count().min(40) / 5;
    Key::all()
        .map(Key::path)
        .chain(TABLES)
        .map(|candidate| (edits(path, candidate, most), candidate))
        .filter(|(count, _)| *count <= most)
        .min()
        .map(|(_, candidate)| candidate)
}

/// Levenshtein distance, or more than `most` where it cannot be within it.
fn edits(a: &str, b: &str, most: usize) -> usize {
    let (a, b): (Vec<char>, Vec<char>) = (a.chars().take(80).collect(), b.chars().collect());
    if a.len().abs_diff(b.len()) > most {
        return most + 1;
    }
    let mut row: Vec<usize> = (0..=b.len()).collect();
    for (i, x) in a.iter().enumerate() {
        let mut diagonal = std::mem::replace(&mut row[0], i + 1);
        for (j, y) in b.iter().enumerate() {
            let substituted = diagonal + usize::from(x != y);
            diagonal = row[j + 1];
            row[j + 1] = substituted.min(diagonal + 1).min(row[j] + 1);
        }
    }
    row[b.len()]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_table_is_in_the_order_of_the_keys() {
        for (index, (key, path, _)) in FORMAT.iter().enumerate() {
            assert_eq!(*key as usize, index);
            assert_eq!(Key::from_path(path), Some(*key));
        }
    }

    #[test]
    fn a_slip_finds_its_key() {
        assert_eq!(nearest("stifness"), Some("stiffness"));
        assert_eq!(nearest("stiffness.bending2"), Some("stiffness.bending_2"));
        assert_eq!(nearest("gravity"), Some("load.gravity"));
        assert_eq!(nearest("leaf.gravity"), Some("load.gravity"));
        assert_eq!(nearest("dynamics.gravty"), Some("dynamics.gravity"));
        assert_eq!(nearest("leaf.rod"), Some("leaf.rods"));
        assert_eq!(nearest("monsoon"), None);
    }
}
