//! The format of scenarios: the table of its keys, one row per key, and what the values of a key look
//! like.
//!
//! A new key needs a row here, a field of the checked scenario, a line in `read` that reads
//! it, and one in `json` that writes it.

pub(super) mod entries;
pub(super) mod error;
pub(super) mod item;
pub(super) mod path;
pub(super) mod places;
pub(super) mod schema;
pub(super) mod source;
pub mod units;

use crate::scenario::format::units::Dimension;
use MissingKeyRule::*;
use NumberRange::*;
use ValueSchema::*;

struct KeyRow {
    key: Key,
    path: &'static str,
    description: &'static str,
    form: ValueSchema,
    dimension: Dimension,
    left_out: MissingKeyRule,
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

        const FORMAT: &[KeyRow] = &[$(KeyRow {
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
    /// the leaf's name; left out: that of its file.
    Name "name": Text, [0, 0, 0], Derived;
    /// name of the unit of length.
    UnitLength "units.length": Text, [0, 0, 0], Derived;
    /// name of the unit of force.
    UnitForce "units.force": Text, [0, 0, 0], Derived;
    /// name of the unit of time.
    UnitTime "units.time": Text, [0, 0, 0], Derived;
    /// number of rods.
    Rods "leaf.rods": Whole, [0, 0, 0], Required("5");
    /// lengths L of the rods.
    Length "leaf.length": PerRod(Positive), [1, 0, 0], Required("1.0");
    /// angles of the rods at the base, in radians.
    Fan "leaf.fan": Fan, [0, 0, 0], Required("\"symmetric\"");
    /// whether the tips share one point.
    Joined "leaf.joined": Switch, [0, 0, 0], Default("true");
    /// where the rods begin, one place for all or one each.
    Base "leaf.base": VectorPerRod, [1, 0, 0], Default("[0.0, 0.0, 0.0]");
    /// angles of the rods at the base above the x-y plane, in radians.
    Elevation "leaf.elevation": PerRod(Finite), [0, 0, 0], Default("0.0");
    /// how the bases are held, one word for all or one each: "clamped"; "pinned", by hinges that leave their directions free; or "elastic", their directions by springs.
    BaseHeld "leaf.base_held": TextPerRod, [0, 0, 0], Default("\"clamped\"");
    /// of elastic bases, the moment per angle by which a base has turned from its natural direction.
    BaseTurnStiffness "leaf.base_turn_stiffness": PerRod(Positive), [1, 1, 0], Derived;
    /// of pinned bases: "free", a base may spin about its own tangent; or "held", its frame is turned from its natural one by the shortest turn of its tangent, as by a constant-velocity joint.
    BaseSpin "leaf.base_spin": Text, [0, 0, 0], Default("\"free\"");
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
    /// width of the section, along d2; of a hexagon across flats.
    Width "section.width": Quantity(Positive), [1, 0, 0], Required("0.4");
    /// thickness of the section, along d3.
    Thickness "section.thickness": Quantity(Positive), [1, 0, 0], Required("0.1");
    /// diameter of the bore of a tube.
    InnerDiameter "section.inner_diameter": Quantity(NotNegative), [1, 0, 0], Derived;
    /// thickness of the wall of a hollow section or of a channel.
    Wall "section.wall": Quantity(Positive), [1, 0, 0], Derived;
    /// E, Young's modulus.
    Young "section.young": Quantity(Positive), [-2, 1, 0], Required("0.3");
    /// nu, Poisson's ratio.
    Poisson "section.poisson": Quantity(Finite), [0, 0, 0], Default("0.3");
    /// G, shear modulus, in place of Poisson's ratio.
    SectionShearModulus "section.shear_modulus": Quantity(Positive), [-2, 1, 0], Derived;
    /// mass per volume.
    MassDensity "section.mass_density": Quantity(Positive), [-4, 1, 2], Derived;
    /// length of a blade, from its base to its tip.
    BladeLength "blade.length": Number(Positive), [1, 0, 0], Required("25.0");
    /// width of a blade at fractions of its length.
    BladeWidth "blade.width": Outline(NotNegative), [1, 0, 0], Required("{ at = [0.0, 0.3, 1.0], value = [1.2, 2.0, 0.0] }");
    /// thickness of a blade.
    BladeThickness "blade.thickness": Quantity(Positive), [1, 0, 0], Required("0.03");
    /// E, Young's modulus along the veins of a blade.
    BladeYoung "blade.young": Quantity(Positive), [-2, 1, 0], Required("3000.0");
    /// E', Young's modulus across them; left out: the same.
    YoungAcross "blade.young_across": Quantity(Positive), [-2, 1, 0], Derived;
    /// G, shear modulus of a blade; left out: E/(2 (1 + nu)).
    ShearModulus "blade.shear_modulus": Quantity(Positive), [-2, 1, 0], Derived;
    /// nu, Poisson's ratio of a blade.
    BladePoisson "blade.poisson": Quantity(Finite), [0, 0, 0], Default("0.3");
    /// mass per volume of a blade.
    BladeMassDensity "blade.mass_density": Quantity(Positive), [-4, 1, 2], Derived;
    /// whether the outermost veins of a blade are its margins.
    Edges "blade.edges": Switch, [0, 0, 0], Default("true");
    /// least width of a blade from which stiffnesses follow, a fraction of the largest.
    LeastWidth "blade.least_width": Number(Positive), [0, 0, 0], Default("0.1");
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
    /// tissue between neighbours that slide along each other: force per displacement and length of leaf; `inf`: they do not.
    TissueAlong "tissue.along": PerGap(NotNegativeOrInfinite), [-2, 1, 0], Default("0.0");
    /// tissue whose width changes, likewise.
    TissueAcross "tissue.across": PerGap(NotNegative), [-2, 1, 0], Default("0.0");
    /// tissue of which one side rises above the other, likewise; `inf`: neither does.
    TissueNormal "tissue.normal": PerGap(NotNegativeOrInfinite), [-2, 1, 0], Default("0.0");
    /// tissue that folds along the rods: moment per angle and length of leaf.
    TissueFold "tissue.fold": PerGap(NotNegative), [0, 1, 0], Default("0.0");
    /// length by which a gap narrows, at rest, per stretch of its veins, and by which it folds per curvature: Poisson's ratio times the width.
    TissueContraction "tissue.contraction": PerGap(Finite), [1, 0, 0], Default("0.0");
    /// whether tissue grows with the rods: else `rest.stretch` strains it.
    TissueGrown "tissue.grown": Switch, [0, 0, 0], Default("true");
    /// force per length of rod, one for all or one each.
    Gravity "load.gravity": VectorPerRod, [-1, 1, 0], Default("[0.0, 0.0, 0.0]");
    /// acceleration of gravity, which pulls the mass of the rods and of points.
    G "load.g": Vector, [1, 0, -2], Default("[0.0, 0.0, 0.0]");
    /// dead force per length of rod, which may vary along it.
    Distributed "load.distributed": VectorQuantity(Finite), [-1, 1, 0], Derived;
    /// force per length of rod that turns with the section: along d1, d2, d3.
    Follower "load.follower": VectorQuantity(Finite), [-1, 1, 0], Derived;
    /// moment per length of rod, about x, y, z.
    Couple "load.couple": VectorQuantity(Finite), [0, 1, 0], Derived;
    /// whether the moment per length turns with the section: about d1, d2, d3.
    CoupleFollows "load.couple_follows": Switch, [0, 0, 0], Default("false");
    /// dead force on the joint tip, or on every tip.
    TipForce "load.tip_force": Vector, [0, 1, 0], Default("[0.0, 0.0, 0.0]");
    /// dead moment on the tip, one rod only.
    TipMoment "load.tip_moment": Vector, [1, 1, 0], Default("[0.0, 0.0, 0.0]");
    /// factor in time of gravity, of `load.g`, and of loads and moments along the rods; at rest that of time 0.
    LoadFactor "load.factor": FactorInTime, [0, 0, 0], Derived;
    /// the rod that is loaded at a point, counted from 1.
    PointVein "load.point.vein": Whole, [0, 0, 0], Required("1");
    /// where the point is, a fraction of the length.
    PointAt "load.point.at": Number(Finite), [0, 0, 0], Required("0.5");
    /// dead force on the point.
    PointForce "load.point.force": Vector, [0, 1, 0], Default("[0.0, 0.0, 0.0]");
    /// dead moment on the point, one rod only.
    PointMoment "load.point.moment": Vector, [1, 1, 0], Default("[0.0, 0.0, 0.0]");
    /// whether the force and the moment on the point turn with the section: along d1, d2, d3.
    PointFollows "load.point.follows": Switch, [0, 0, 0], Default("false");
    /// mass of the point, which `load.g` pulls.
    PointMass "load.point.mass": Number(NotNegative), [-1, 1, 2], Default("0.0");
    /// where the force and the mass are off the axis: along d2 and d3.
    PointOffset "load.point.offset": AcrossSection, [1, 0, 0], Default("[0.0, 0.0]");
    /// time at which the mass lands on the leaf; before that it is absent.
    PointFrom "load.point.from": Number(NotNegative), [0, 0, 1], Default("0.0");
    /// velocity with which it lands.
    PointVelocity "load.point.velocity": Vector, [1, 0, -1], Default("[0.0, 0.0, 0.0]");
    /// factor in time of the force and the moment on the point; at rest that of time 0.
    PointFactor "load.point.factor": FactorInTime, [0, 0, 0], Derived;
    /// how the tips are held.
    TipHeld "tip.held": Text, [0, 0, 0], Default("\"free\"");
    /// where the joint tip, or the only rod's, is held.
    TipPosition "tip.position": VectorOrInTime, [1, 0, 0], Derived;
    /// of a clamped tip, the angles of the rods there, in radians.
    TipAngles "tip.angles": PerRod(Finite), [0, 0, 0], Default("0.0");
    /// of a clamped tip, the turn of the sections about d1, in radians.
    TipTwist "tip.twist": PerRod(Finite), [0, 0, 0], Default("0.0");
    /// of springs along the veins, force per length and displacement from the natural place, by lab axis.
    FoundationStiffness "foundation.stiffness": VectorQuantity(NotNegative), [-2, 1, 0], Required("[0.0, 0.0, 2.0]");
    /// the rod that is gripped, counted from 1, or a list of them: a grip on each.
    GripVein "grip.vein": WholeOrList, [0, 0, 0], Required("1");
    /// where, a fraction of the length, or the two ends of a stretch.
    GripAt "grip.at": Stretch, [0, 0, 0], Required("[0.3, 0.7]");
    /// whether the directions are held, too.
    GripHeld "grip.held": Text, [0, 0, 0], Default("\"pinned\"");
    /// by how much the grip has moved from its place in the natural leaf.
    GripMove "grip.move": VectorOrInTime, [1, 0, 0], Default("[0.0, 0.0, 0.0]");
    /// how the position is held, by lab axis: rigidly (inf), not (0), or by a spring, force per displacement.
    GripStiffness "grip.stiffness": AxisStiffness, [-1, 1, 0], Default("[inf, inf, inf]");
    /// of a clamped grip, how directions are held: rigidly (inf), or by a spring, moment per radian.
    GripTurnStiffness "grip.turn_stiffness": Number(PositiveOrInfinite), [1, 1, 0], Default("inf");
    /// wanted accuracy, relative to the longest rod.
    Tolerance "solve.tolerance": Number(Finite), [0, 0, 0], Default("1e-6");
    /// rho, mass per length of rod.
    Density "dynamics.density": Quantity(Positive), [-2, 1, 2], Derived;
    /// rho I2, moment of inertia per length about d2, and about d3 unless that is given.
    RotaryInertia "dynamics.rotary_inertia": Quantity(Positive), [0, 1, 2], Derived;
    /// rho I3, moment of inertia per length about d3.
    RotaryInertia3 "dynamics.rotary_inertia_3": Quantity(Positive), [0, 1, 2], Derived;
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
    /// how all bases move in time: displacements, and rotation vectors about their mean.
    BaseInTime "dynamics.base": BaseMotion, [1, 0, 0], Derived;
    /// velocity of the air, steady or in time.
    WindVelocity "wind.velocity": VectorOrInTime, [1, 0, -1], Required("[2.0, 0.0, 0.0]");
    /// mass per volume of the air.
    WindDensity "wind.density": Number(Positive), [-4, 1, 2], Required("1.2");
    /// C_D, the drag coefficient of the rods.
    WindDrag "wind.drag": Number(NotNegative), [0, 0, 0], Required("2.0");
    /// width that a vein turns to the wind; left out: that of its section, or of its strip of a blade.
    WindWidth "wind.width": Quantity(NotNegative), [1, 0, 0], Derived;
    /// length that a pixel of a photograph shows.
    PhotoScale "photo.scale": Number(Positive), [1, 0, 0], Required("0.01");
    /// pixels from the left edge of a photograph to the origin of the scenario.
    PhotoX "photo.x": Number(Finite), [0, 0, 0], Required("300.0");
    /// pixels from its upper edge down to the origin.
    PhotoY "photo.y": Number(Finite), [0, 0, 0], Required("1200.0");
    /// angle by which a photograph is turned counterclockwise, in radians.
    PhotoRotation "photo.rotation": Number(Finite), [0, 0, 0], Default("0.0");
    /// the axis to the right in a photograph that is not turned: "x", "-x", "y", ...
    PhotoRight "photo.right": Text, [0, 0, 0], Default("\"x\"");
    /// the axis upwards.
    PhotoUp "photo.up": Text, [0, 0, 0], Default("\"z\"");
    /// in place of the scale, the pixel of a point on a ruler.
    RulerFrom "photo.ruler_from": Pixel, [0, 0, 0], Required("[120.0, 80.0]");
    /// that of another point on it.
    RulerTo "photo.ruler_to": Pixel, [0, 0, 0], Required("[1120.0, 80.0]");
    /// the length between the two.
    RulerLength "photo.ruler_length": Number(Positive), [1, 0, 0], Required("10.0");
}

impl Key {
    pub(super) const COUNT: usize = FORMAT.len();
    /// Stiffnesses in torsion and bending, in the order of the directors.
    pub(super) const COUPLE: [Key; 3] = [Key::Torsion, Key::Bending2, Key::Bending3];
    /// Stiffnesses in stretch and shear.
    pub(super) const FORCE: [Key; 3] = [Key::Axial, Key::Shear2, Key::Shear3];
    /// Curvatures at rest, u0: twist, and bends about d2 and d3.
    pub(super) const REST_CURVATURE: [Key; 3] = [Key::RestTwist, Key::RestBend2, Key::RestBend3];
    /// Stiffnesses of the coupling along e1, e2 and e3.
    pub(super) const COUPLING: [Key; 3] = [Key::CouplingX, Key::CouplingY, Key::CouplingZ];
    /// k1, k2 and k3 of the tissue, and its c1.
    pub(super) const TISSUE: [Key; 4] = [
        Key::TissueAlong,
        Key::TissueAcross,
        Key::TissueNormal,
        Key::TissueFold,
    ];
    /// Tables that a scenario may have several times.
    pub(super) const REPEATED_TABLES: [&str; 2] = ["load.point", "grip"];

    fn row(self) -> &'static KeyRow {
        &FORMAT[self as usize]
    }

    /// Its path in the scenario: `table.key`, or `name`.
    pub fn path(self) -> &'static str {
        self.row().path
    }

    /// A short description.
    pub fn description(self) -> &'static str {
        self.row().description.trim()
    }

    /// The form of the key's value.
    pub(crate) fn form(self) -> ValueSchema {
        self.row().form
    }

    /// Exponents of length, force and time in the unit of the key's value.
    pub fn dimension(self) -> Dimension {
        self.row().dimension
    }

    /// What applies if the key is left out.
    pub(super) fn missing_key_rule(self) -> MissingKeyRule {
        self.row().left_out
    }

    /// Whether the numbers of the key are positive, or not negative.
    pub(crate) fn is_positive(self) -> bool {
        self.form().range() != Finite
    }

    /// Whether the key takes whole numbers.
    pub(crate) fn is_whole_number(self) -> bool {
        matches!(self.form(), ValueSchema::Whole | ValueSchema::WholeOrList)
    }

    /// Whether the quantities of the leaf are proportional to the numbers of the key.
    pub(crate) fn is_linear(self) -> bool {
        !matches!(self.table(), "section" | "blade" | "photo")
    }

    /// Whether a blade determines the value of the key.
    pub(super) fn follows_from_blade(self) -> bool {
        match self {
            Key::Length | Key::Fan | Key::Base | Key::RestBend3 => true,
            Key::TissueContraction => true,
            _ if Key::TISSUE.contains(&self) => true,
            _ => matches!(self.table(), "stiffness" | "section"),
        }
    }

    /// The table of the key, empty at the top, and its name within that.
    pub(super) fn table_path(self) -> TablePath<'static> {
        TablePath::split(self.path())
    }

    /// The table of the key; empty at the top.
    pub(super) fn table(self) -> &'static str {
        self.table_path().table
    }

    /// Whether there may be several tables with this key.
    pub(super) fn is_repeated(self) -> bool {
        is_repeated_table(self.table())
    }

    /// All keys of the format, by tables.
    pub fn all() -> impl Iterator<Item = Key> {
        FORMAT.iter().map(|row| row.key)
    }

    /// The key with this path, if any.
    pub fn from_path(path: &str) -> Option<Key> {
        Key::all().find(|key| key.path() == path)
    }

    /// The key with this table and name.
    pub(super) fn from_table_path(path: TablePath) -> Option<Key> {
        let TablePath { table, name } = path;
        let length = name.len() + if table.is_empty() { 0 } else { table.len() + 1 };
        let mut long = FORMAT.iter().filter(|row| row.path.len() == length);
        let row = long.find(|row| row.key.table_path() == path)?;
        Some(row.key)
    }

    /// The table of the format with this name, if any.
    pub(super) fn table_named(name: &str) -> Option<&'static str> {
        let mut paths = Key::all().map(Key::path);
        paths.find_map(|path| {
            let (table, rest) = path.split_at_checked(name.len())?;
            (table == name && rest.starts_with('.')).then_some(table)
        })
    }

    /// The tables of the format, in its order.
    pub(super) fn tables() -> Vec<&'static str> {
        let mut tables: Vec<_> = Key::all().map(Key::table).collect();
        tables.dedup();
        tables.retain(|table| !table.is_empty());
        tables
    }

    /// The names allowed in `table`, which is empty at the top, also those of tables in it.
    pub(super) fn allowed_in(table: &str) -> Vec<&'static str> {
        let keys = Key::all().map(Key::table_path);
        let tables = Key::tables().into_iter().map(TablePath::split);
        let all = keys.chain(tables).filter(|path| path.table == table);
        all.map(|path| path.name).collect()
    }
}

/// The name of a key or a table, and the table that it is in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct TablePath<'p> {
    /// Empty at the top.
    pub table: &'p str,
    pub name: &'p str,
}

impl TablePath<'_> {
    /// Splits a path such as `load.gravity` or `load.point.vein` before its last name.
    pub fn split(path: &str) -> TablePath<'_> {
        let (table, name) = path.rsplit_once('.').unwrap_or(("", path));
        TablePath { table, name }
    }
}

/// Whether a scenario may have several tables of this name.
pub(super) fn is_repeated_table(table: &str) -> bool {
    Key::REPEATED_TABLES.contains(&table)
}

/// The name of a table as it stands at the head of the table.
pub(super) fn table_header(table: &str) -> String {
    match is_repeated_table(table) {
        true => format!("[[{table}]]"),
        false => format!("[{table}]"),
    }
}

/// The form of a key's value.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum ValueSchema {
    Text,
    /// A word for all rods, or a list with one for each.
    TextPerRod,
    /// `true` or `false`.
    Switch,
    /// A whole number from 1.
    Whole,
    /// A whole number from 1, or a list of them.
    WholeOrList,
    Number(NumberRange),
    /// A number for all rods, or a list with one for each.
    PerRod(NumberRange),
    /// A number for all rods, a list with one for each, or a profile along the rods.
    Quantity(NumberRange),
    /// A number, or a profile along the leaf.
    Outline(NumberRange),
    /// A number for all gaps between neighbouring rods, or a list.
    PerGap(NumberRange),
    /// x, y, z.
    Vector,
    /// x, y, z for all rods, or a list with one such vector for each.
    VectorPerRod,
    /// x, y, z for all rods, a list with one such vector for each, or a profile of vectors along them.
    VectorQuantity(NumberRange),
    /// A stiffness, not negative or infinite, along each of x, y, z.
    AxisStiffness,
    /// A place along a rod, or the two ends of a stretch: fractions of the length.
    Stretch,
    /// A pixel of a photograph, to the right and down.
    Pixel,
    /// A place in a section, along its directors d2 and d3.
    AcrossSection,
    /// Base angles: a list, or a word.
    Fan,
    /// Vectors at given times.
    VectorInTime,
    /// Vectors at given times, or one vector for all times.
    VectorOrInTime,
    /// Factors at given times.
    FactorInTime,
    /// Displacements and rotation vectors at given times.
    BaseMotion,
}

/// Which numbers a key allows; never NaN.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum NumberRange {
    Finite,
    NotNegative,
    NotNegativeOrInfinite,
    Positive,
    PositiveOrInfinite,
}

/// What applies if a key is left out.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum MissingKeyRule {
    /// The key is required; the message gives this example of a value.
    Required(&'static str),
    /// This default value.
    Default(&'static str),
    /// A value that follows from others, or none.
    Derived,
}

impl ValueSchema {
    /// The range of the numbers in a value.
    pub fn range(self) -> NumberRange {
        match self {
            ValueSchema::Number(range)
            | ValueSchema::PerRod(range)
            | ValueSchema::Quantity(range)
            | ValueSchema::Outline(range)
            | ValueSchema::VectorQuantity(range)
            | ValueSchema::PerGap(range) => range,
            ValueSchema::AxisStiffness => NumberRange::NotNegativeOrInfinite,
            _ => NumberRange::Finite,
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
            let TablePath { table, name } = key.table_path();
            assert_eq!(Key::from_table_path(key.table_path()), Some(key));
            assert_eq!([table, name].join(".").trim_start_matches('.'), key.path());
            assert_eq!(key.row().key, key);
        }
        assert_eq!(Key::tables().len(), 17);
        assert_eq!(Key::allowed_in("load")[..2], ["gravity", "g"]);
        assert!(Key::allowed_in("load").contains(&"point"));
        assert!(!Key::allowed_in("").contains(&"load.point"));
    }
}
