//! The table of the keys that a scenario may have, one row per key.
//!
//! A new key needs a row here, a field of the checked scenario, a line in `check` that reads
//! it, and one in `json` that writes it.

use super::excerpt::shorten;
use Form::*;
use LeftOut::*;
use Range::*;

/// The form of a key's value.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Form {
    Text,
    /// `true` or `false`.
    Switch,
    /// A whole number from 1.
    Whole,
    Number(Range),
    /// A number for all rods, or a list with one for each.
    PerRod(Range),
    /// A number for all rods, a list with one for each, or a profile along the rods.
    Quantity(Range),
    /// A number for all gaps between neighbouring rods, or a list.
    PerGap(Range),
    /// x, y, z.
    Vector,
    /// Base angles: a list, or a word.
    Fan,
    /// Vectors at given times.
    VectorInTime,
    /// Factors at given times.
    FactorInTime,
}

/// Which numbers a key allows; never NaN.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Range {
    Finite,
    NotNegative,
    Positive,
    PositiveOrInfinite,
}

/// What applies if a key is left out.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum LeftOut {
    /// It is required; the message gives this example of a value.
    Required(&'static str),
    /// This default value.
    Default(&'static str),
    /// A value that follows from others, or none.
    Derived,
}

impl Form {
    /// The range of its numbers.
    pub(super) fn range(self) -> Range {
        match self {
            Number(range) | PerRod(range) | Quantity(range) | PerGap(range) => range,
            _ => Finite,
        }
    }
}

struct Row {
    key: Key,
    path: &'static str,
    description: &'static str,
    form: Form,
    dimension: [i32; 3],
    left_out: LeftOut,
}

/// Rows of the form `Key "path": form, [exponents of length, force, time], left out;`,
/// each below the description of the key.
macro_rules! keys {
    ($($(#[doc = $doc:literal])+ $key:ident $path:literal: $form:expr, $dimension:expr, $left_out:expr;)+) => {
        /// A key of the scenario format.
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        pub enum Key {
            $(#[doc = concat!("`", $path, "`:", $($doc),+)] $key,)+
        }

        const FORMAT: &[Row] = &[$(Row {
            key: Key::$key,
            path: $path,
            description: concat!($($doc),+),
            form: $form,
            dimension: $dimension,
            left_out: $left_out,
        },)+];
    };
}

keys! {
    /// the leaf's name.
    Name "name": Text, [0, 0, 0], Required("\"my-leaf\"");
    /// name of the unit of length.
    UnitLength "units.length": Text, [0, 0, 0], Derived;
    /// name of the unit of force.
    UnitForce "units.force": Text, [0, 0, 0], Derived;
    /// number of rods.
    Rods "leaf.rods": Whole, [0, 0, 0], Required("5");
    /// lengths L of the rods.
    Length "leaf.length": PerRod(Positive), [1, 0, 0], Required("1.0");
    /// angles of the rods at the base, in radians.
    Fan "leaf.fan": Fan, [0, 0, 0], Required("\"symmetric\"");
    /// whether the tips share one point.
    Joined "leaf.joined": Switch, [0, 0, 0], Default("true");
    /// A1, against torsion.
    Torsion "stiffness.torsion": Quantity(Positive), [2, 1, 0], Required("1.0");
    /// A2, against bending about d2: up and down, out of the leaf's surface.
    Bending2 "stiffness.bending_2": Quantity(Positive), [2, 1, 0], Required("1.0");
    /// A3, against bending about d3: sideways, within the leaf's surface.
    Bending3 "stiffness.bending_3": Quantity(Positive), [2, 1, 0], Required("1.0");
    /// H1, against stretch; `inf`: inextensible.
    Axial "stiffness.axial": Quantity(PositiveOrInfinite), [0, 1, 0], Required("100.0");
    /// H2, against shear along d2; `inf`: unshearable.
    Shear2 "stiffness.shear_2": Quantity(PositiveOrInfinite), [0, 1, 0], Required("100.0");
    /// H3, against shear along d3; `inf`: unshearable.
    Shear3 "stiffness.shear_3": Quantity(PositiveOrInfinite), [0, 1, 0], Required("100.0");
    /// form of the rods' section, from which their stiffnesses follow.
    SectionShape "section.shape": Text, [0, 0, 0], Required("\"circle\"");
    /// diameter of a circle.
    Diameter "section.diameter": Quantity(Positive), [1, 0, 0], Required("0.1");
    /// width of an ellipse or a rectangle, along d2.
    Width "section.width": Quantity(Positive), [1, 0, 0], Required("0.4");
    /// thickness of an ellipse or a rectangle, along d3.
    Thickness "section.thickness": Quantity(Positive), [1, 0, 0], Required("0.1");
    /// E, Young's modulus.
    Young "section.young": Quantity(Positive), [-2, 1, 0], Required("0.3");
    /// nu, Poisson's ratio.
    Poisson "section.poisson": Quantity(Finite), [0, 0, 0], Default("0.3");
    /// mass per volume.
    MassDensity "section.mass_density": Quantity(Positive), [-4, 1, 2], Derived;
    /// u0_1, twist at rest; positive turns d2 towards d3 on the way to the tip.
    RestTwist "rest.twist": Quantity(Finite), [-1, 0, 0], Default("0.0");
    /// u0_2, curvature at rest about d2; positive bends the rod down, towards -d3.
    RestBend2 "rest.bend_2": Quantity(Finite), [-1, 0, 0], Default("0.0");
    /// u0_3, curvature at rest about d3; positive bends the rod sideways, towards +d2.
    RestBend3 "rest.bend_3": Quantity(Finite), [-1, 0, 0], Default("0.0");
    /// growth of the rest length, a factor.
    RestStretch "rest.stretch": Quantity(Positive), [0, 0, 0], Default("1.0");
    /// coupling along e1: force per displacement and length of leaf.
    CouplingX "coupling.x": PerGap(NotNegative), [-2, 1, 0], Default("0.0");
    /// coupling along e2.
    CouplingY "coupling.y": PerGap(NotNegative), [-2, 1, 0], Default("0.0");
    /// coupling along e3.
    CouplingZ "coupling.z": PerGap(NotNegative), [-2, 1, 0], Default("0.0");
    /// force per length of rod.
    Gravity "load.gravity": Vector, [-1, 1, 0], Default("[0.0, 0.0, 0.0]");
    /// dead force on the joint tip, or on every tip.
    TipForce "load.tip_force": Vector, [0, 1, 0], Default("[0.0, 0.0, 0.0]");
    /// dead moment on the tip, one rod only.
    TipMoment "load.tip_moment": Vector, [1, 1, 0], Default("[0.0, 0.0, 0.0]");
    /// how the tips are held.
    TipHeld "tip.held": Text, [0, 0, 0], Default("\"free\"");
    /// where the joint tip, or the only rod's, is held.
    TipPosition "tip.position": Vector, [1, 0, 0], Derived;
    /// of a clamped tip, the angles of the rods there, in radians.
    TipAngles "tip.angles": PerRod(Finite), [0, 0, 0], Default("0.0");
    /// of a clamped tip, the turn of the sections about d1, in radians.
    TipTwist "tip.twist": PerRod(Finite), [0, 0, 0], Default("0.0");
    /// wanted accuracy, relative to the longest rod.
    Tolerance "solve.tolerance": Number(Finite), [0, 0, 0], Default("1e-6");
    /// rho, mass per length of rod.
    Density "dynamics.density": Quantity(Positive), [-2, 1, 2], Derived;
    /// rho I, moment of inertia per length about d2 and d3.
    RotaryInertia "dynamics.rotary_inertia": Quantity(Positive), [0, 1, 2], Derived;
    /// radius of the section, in place of rho I.
    SectionRadius "dynamics.section_radius": Quantity(Positive), [1, 0, 0], Derived;
    /// viscous force per length and velocity.
    ExternalDamping "dynamics.external_damping": Number(NotNegative), [-2, 1, 1], Derived;
    /// retardation time of the material.
    InternalDamping "dynamics.internal_damping": Number(NotNegative), [0, 0, 1], Default("0.0");
    /// how long the leaf is followed.
    Duration "dynamics.duration": Number(Positive), [0, 0, 1], Derived;
    /// time between two outputs.
    OutputInterval "dynamics.output_interval": Number(Positive), [0, 0, 1], Derived;
    /// whether the base is held.
    Clamped "dynamics.clamped": Switch, [0, 0, 0], Default("true");
    /// where the motion begins.
    Start "dynamics.start": Text, [0, 0, 0], Default("\"released\"");
    /// gravity in time.
    GravityInTime "dynamics.gravity": VectorInTime, [-1, 1, 0], Derived;
    /// dead force in time.
    TipForceInTime "dynamics.tip_force": VectorInTime, [0, 1, 0], Derived;
    /// dead moment in time, one rod only.
    TipMomentInTime "dynamics.tip_moment": VectorInTime, [1, 1, 0], Derived;
    /// factor of the rest curvatures in time.
    RestInTime "dynamics.rest": FactorInTime, [0, 0, 0], Derived;
}

impl Key {
    pub(super) const COUNT: usize = FORMAT.len();
    /// Stiffnesses in torsion and bending, in the order of the directors.
    pub(super) const COUPLE: [Key; 3] = [Key::Torsion, Key::Bending2, Key::Bending3];
    /// Stiffnesses in stretch and shear.
    pub(super) const FORCE: [Key; 3] = [Key::Axial, Key::Shear2, Key::Shear3];
    pub(super) const REST: [Key; 3] = [Key::RestTwist, Key::RestBend2, Key::RestBend3];
    pub(super) const COUPLING: [Key; 3] = [Key::CouplingX, Key::CouplingY, Key::CouplingZ];

    fn row(self) -> &'static Row {
        &FORMAT[self as usize]
    }

    /// As in `--set`: `table.key`, or `name`.
    pub fn path(self) -> &'static str {
        self.row().path
    }

    /// A short description.
    pub fn description(self) -> &'static str {
        self.row().description.trim()
    }

    /// The form of its value.
    pub(crate) fn form(self) -> Form {
        self.row().form
    }

    /// Exponents of length, force and time in its unit.
    pub(crate) fn dimension(self) -> [i32; 3] {
        self.row().dimension
    }

    /// What applies if it is left out.
    pub(crate) fn left_out(self) -> LeftOut {
        self.row().left_out
    }

    /// Whether its numbers are positive, or not negative.
    pub(crate) fn is_positive(self) -> bool {
        self.form().range() != Finite
    }

    /// Whether the quantities of the leaf are proportional to its numbers.
    pub(crate) fn is_linear(self) -> bool {
        self.parts().0 != "section"
    }

    /// Its table, empty at the top, and its name within that.
    pub(super) fn parts(self) -> (&'static str, &'static str) {
        self.path().rsplit_once('.').unwrap_or(("", self.path()))
    }

    pub(crate) fn all() -> impl Iterator<Item = Key> {
        FORMAT.iter().map(|row| row.key)
    }

    /// The key with this path, if any.
    pub fn from_path(path: &str) -> Option<Key> {
        Key::all().find(|key| key.path() == path)
    }

    /// The key with this table, empty at the top, and this name within it.
    pub(super) fn from_parts(table: &str, name: &str) -> Option<Key> {
        let length = name.len() + if table.is_empty() { 0 } else { table.len() + 1 };
        let mut long = FORMAT.iter().filter(|row| row.path.len() == length);
        let row = long.find(|row| row.key.parts() == (table, name))?;
        Some(row.key)
    }

    /// The table of this name, if any.
    pub(super) fn table(name: &str) -> Option<&'static str> {
        let mut paths = Key::all().map(Key::path);
        paths.find_map(|path| {
            let (table, rest) = path.split_at_checked(name.len())?;
            (table == name && rest.starts_with('.')).then_some(table)
        })
    }

    /// The tables of the format, in its order.
    pub(super) fn tables() -> Vec<&'static str> {
        let mut tables: Vec<_> = Key::all().map(|key| key.parts().0).collect();
        tables.dedup();
        tables.retain(|table| !table.is_empty());
        tables
    }

    /// The names allowed in `table`; at the top ("") also those of the tables.
    pub(super) fn allowed_in(table: &str) -> Vec<&'static str> {
        let keys = Key::all().map(Key::parts).filter(|parts| parts.0 == table);
        let mut allowed: Vec<_> = keys.map(|parts| parts.1).collect();
        if table.is_empty() {
            allowed.extend(Key::tables());
        }
        allowed
    }
}

/// The key or table that was probably meant by `path`: the same name in
/// another table, or the nearest spelling.
pub(crate) fn nearest(path: &str) -> Option<&'static str> {
    let name = path.rsplit('.').next().unwrap_or(path);
    if let Some(key) = Key::all().find(|key| key.parts().1 == name) {
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
    let table = path.split('.').next().unwrap_or("");
    let tables = Key::tables();
    match tables.iter().find(|known| **known == table) {
        Some(table) => {
            let allowed = Key::allowed_in(table).join(", ");
            format!("unknown key {found}: [{table}] has {allowed}")
        }
        None => {
            let tables = tables.join(", ");
            format!("unknown key {found}: keys are name and those of {tables}, as in leaf.rods")
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_key_is_found_by_its_path() {
        for key in Key::all() {
            assert_eq!(Key::from_path(key.path()), Some(key));
            let (table, name) = key.parts();
            assert_eq!(Key::from_parts(table, name), Some(key));
            assert_eq!([table, name].join(".").trim_start_matches('.'), key.path());
            assert_eq!(key.row().key, key);
        }
        assert_eq!(Key::tables().len(), 10);
    }

    #[test]
    fn misspelt_keys_are_recognized() {
        for (misspelt, key) in [
            ("stiffness.bending2", Some("stiffness.bending_2")),
            ("gravity", Some("load.gravity")),
            ("dynamics.gravty", Some("dynamics.gravity")),
            ("leaf.rod", Some("leaf.rods")),
            ("monsoon", None),
        ] {
            assert_eq!(nearest(misspelt), key);
        }
    }
}
