//! Every message a person can get about a scenario, as values.

use std::fmt;
use std::path::PathBuf;

use super::key::Key;

/// Why a scenario was refused. Its text is the whole message: where, which
/// key, what was found, and what to change.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ScenarioError {
    /// The file cannot be read.
    #[error("{}: cannot be read: {reason}", path.display())]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// What the system says.
        reason: std::io::Error,
    },

    /// A folder was named where a file is needed.
    #[error("{}: is a folder: give the TOML file itself", path.display())]
    Folder {
        /// The folder.
        path: PathBuf,
    },

    /// The file is too large to be a scenario.
    #[error("{}: is larger than {limit} bytes: this is no scenario", path.display())]
    TooLarge {
        /// The file.
        path: PathBuf,
        /// Most bytes that are read.
        limit: u64,
    },

    /// The file is not text.
    #[error(
        "{file}:{line}: is not text in UTF-8: byte {offset} is 0x{byte:02x}: save the file as UTF-8"
    )]
    NotUtf8 {
        /// The file.
        file: String,
        /// Line of the first byte that is wrong, counted from 1.
        line: usize,
        /// Its place in the file.
        offset: usize,
        /// The byte.
        byte: u8,
    },

    /// The text is not TOML.
    #[error("{place}: not valid TOML: {message}{snippet}")]
    Syntax {
        /// Where.
        place: Place,
        /// What the TOML parser says.
        message: String,
        /// The line with a caret below, or nothing.
        snippet: String,
    },

    /// A key the format does not have.
    #[error("{place}: unknown key {key}{}: allowed here: {}{snippet}", did_you_mean(*meant), allowed.join(", "))]
    UnknownKey {
        /// Where.
        place: Place,
        /// The key as written, with its table.
        key: String,
        /// The key that was probably meant.
        meant: Option<&'static str>,
        /// Every key allowed there.
        allowed: Vec<&'static str>,
        /// The line with a caret below, or nothing.
        snippet: String,
    },

    /// A value where the format has a table.
    #[error(
        "{place}: {table} = {found}: must be a table: write [{table}] on a line of its own, below it {}",
        allowed.join(", ")
    )]
    NotATable {
        /// Where.
        place: Place,
        /// Name of the table.
        table: &'static str,
        /// The value as written.
        found: String,
        /// The keys of that table.
        allowed: Vec<&'static str>,
    },

    /// An override without an equals sign.
    #[error("--set {given}: must be KEY=VALUE, e.g. --set load.gravity=[0,0,-0.5]")]
    NotAnOverride {
        /// The override as given.
        given: String,
    },

    /// A key that must be there is not.
    #[error("{file}: {} is missing: {}", key.path(), how_to_add(*key, *has_table))]
    Missing {
        /// The file.
        file: String,
        /// The key.
        key: Key,
        /// Whether the file has the key's table.
        has_table: bool,
    },

    /// A value that is not allowed.
    #[error("{place}: {}{spot} = {found}: {problem}", key.path())]
    Value {
        /// Where.
        place: Place,
        /// The key.
        key: Key,
        /// Which part of its value.
        spot: Spot,
        /// That part as written.
        found: String,
        /// What is wrong with it.
        problem: Box<Problem>,
    },
}

/// Where a value was written.
#[derive(Clone, Debug, PartialEq)]
pub enum Place {
    /// In a file; lines count from 1.
    Line {
        /// The file.
        file: String,
        /// The line.
        line: usize,
    },
    /// On the command line.
    Set {
        /// The whole `KEY=VALUE`.
        given: String,
    },
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Place::Line { file, line } => write!(f, "{file}:{line}"),
            Place::Set { given } => write!(f, "--set {given}"),
        }
    }
}

/// Which part of a value; indices count from 0 here and from 1 in the text.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Spot {
    /// All of it.
    Whole,
    /// Entry of a list.
    Entry(usize),
    /// `at`, or one of its entries.
    At(Option<usize>),
    /// `value`, or one of its entries.
    Value(Option<usize>),
    /// Entry of one rod's list inside `value`.
    RodValue(usize, usize),
    /// Component of one of the vectors inside `value`.
    Component(usize, usize),
    /// `factor`, or one of its entries.
    Factor(Option<usize>),
}

impl fmt::Display for Spot {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Spot::Whole => Ok(()),
            Spot::Entry(i) => write!(f, ", entry {}", i + 1),
            Spot::At(None) => write!(f, ", at"),
            Spot::At(Some(i)) => write!(f, ", at, entry {}", i + 1),
            Spot::Value(None) => write!(f, ", value"),
            Spot::Value(Some(i)) => write!(f, ", value, entry {}", i + 1),
            Spot::RodValue(rod, i) => write!(f, ", value, list {}, entry {}", rod + 1, i + 1),
            Spot::Component(i, axis) => {
                write!(f, ", value, entry {}, component {}", i + 1, axis + 1)
            }
            Spot::Factor(None) => write!(f, ", factor"),
            Spot::Factor(Some(i)) => write!(f, ", factor, entry {}", i + 1),
        }
    }
}

/// What is wrong with a value, and what is allowed.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Problem {
    /// Another kind of value is needed.
    #[error("must be {needed}")]
    WrongType {
        /// The kind needed.
        needed: Needed,
    },
    /// NaN, or infinite where no key is.
    #[error("must be a finite number")]
    NotFinite,
    /// Infinite where only some stiffnesses may be.
    #[error(
        "must be a finite number; inf (rigid) is allowed for stiffness.axial, shear_2 and shear_3 only, not in a profile"
    )]
    Infinite,
    /// Beyond double precision.
    #[error("is not a number a computer can hold (the largest is 1.8e308)")]
    Overflow,
    /// Zero or negative.
    #[error("must be greater than 0")]
    NotPositive,
    /// Negative.
    #[error("must not be negative")]
    Negative,
    /// So large or small that products of it would overflow.
    #[error("must lie between {least:e} and {most:e}: choose other units", least = super::check::MAGNITUDES.0, most = super::check::MAGNITUDES.1)]
    Magnitude,
    /// Not a number of rods.
    #[error("must be a whole number from 1 to {most}, without a decimal point")]
    Rods {
        /// Most rods allowed.
        most: usize,
    },
    /// A list of the wrong length.
    #[error("has {found} entries: must have {needed}, {because}")]
    Entries {
        /// Entries it has.
        found: usize,
        /// Entries it must have.
        needed: usize,
        /// Why so many.
        because: Because,
    },
    /// A profile with fewer than two knots.
    #[error("at least two knots are needed, the first at 0 and the last at 1")]
    TooFewKnots,
    /// A profile that does not start at 0.
    #[error("must start at 0 (the base)")]
    FirstKnot,
    /// A profile that does not end at 1.
    #[error("must end at 1 (the tip)")]
    LastKnot,
    /// A knot that is not beyond the one before.
    #[error(
        "must be greater than the entry before it, {before}: knots rise strictly (write a step as a steep ramp)"
    )]
    KnotsNotRising {
        /// The knot before.
        before: f64,
    },
    /// A list of times without any.
    #[error("at least one time is needed")]
    NoTimes,
    /// A time that is not after the one before.
    #[error(
        "must be greater than the entry before it, {before}: times rise strictly (write a step as a steep ramp)"
    )]
    TimesNotRising {
        /// The time before.
        before: f64,
    },
    /// A key that profiles, or loads and factors in time, do not have.
    #[error("unknown key {key}: {form}")]
    UnknownPart {
        /// The key as written.
        key: String,
        /// What was read.
        form: Form,
    },
    /// A profile, or a load or factor in time, without one of its two keys.
    #[error("{key} is missing: {form}")]
    MissingPart {
        /// The key that is missing.
        key: &'static str,
        /// What was read.
        form: Form,
    },
    /// Not a fan.
    #[error(
        "must be \"paper\" or \"symmetric\", or a list of {rods} angles in radians, one per rod"
    )]
    Fan {
        /// Number of rods.
        rods: usize,
    },
    /// A name that cannot be a folder.
    #[error(
        "must be usable as a folder name: 1 to {most} letters, digits and the signs _ - . + with a letter, digit or _ first"
    )]
    Name {
        /// Most bytes allowed.
        most: usize,
    },
    /// A name of a unit that is too long for an axis.
    #[error("must be 1 to {most} characters that can be printed")]
    Unit {
        /// Most characters allowed.
        most: usize,
    },
    /// A tip moment on more than one rod.
    #[error("a moment at the tip needs leaf.rods = 1 (here {rods}): joined tips pass on no moment")]
    MomentOnManyRods {
        /// Number of rods.
        rods: usize,
    },
    /// More than one rod without a clamped base.
    #[error("a free base needs leaf.rods = 1 (here {rods}): the rods of a leaf grow from one base")]
    FreeBase {
        /// Number of rods.
        rods: usize,
    },
    /// Not a start of the motion.
    #[error(
        "must be \"released\" (from the shape where a relaxation starts) or \"at-rest\" (in equilibrium under the loads at time 0)"
    )]
    Start,
    /// A start at rest of a rod that nothing holds.
    #[error("a rod with a free base has no equilibrium to start from: use \"released\"")]
    FreeAtRest,
    /// Both the radius of the section and its moment of inertia.
    #[error(
        "dynamics.rotary_inertia is given, too, and is density section_radius^2/4: leave one of them out"
    )]
    TwoSections,
    /// An output interval beyond the end of the motion.
    #[error(
        "must be at most dynamics.duration, {duration} (left out: a hundredth of the duration)"
    )]
    IntervalTooLong {
        /// The duration.
        duration: f64,
    },
    /// A tolerance that is no accuracy.
    #[error(
        "must be greater than 0 and at most {most}: it is the error of the centerlines relative to the length of a rod"
    )]
    Tolerance {
        /// Largest tolerance allowed.
        most: f64,
    },
    /// A tolerance below what double precision carries.
    #[error(
        "must be at least {least:e}: double precision carries 16 digits, and rounding in the solve takes about four of them"
    )]
    ToleranceTooSmall {
        /// Smallest tolerance allowed.
        least: f64,
    },
    /// Beyond what several values together allow.
    #[error("gives {formula} = {value:.3e}, the limit is {limit:e}: {because}")]
    Limit {
        /// The number that is limited, free of units.
        formula: &'static str,
        /// Its value.
        value: f64,
        /// Its limit.
        limit: f64,
        /// What the symbols mean, why there is a limit, and what to change.
        because: &'static str,
    },
}

/// Kinds of value.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Needed {
    /// A number.
    Number,
    /// Text.
    Text,
    /// True or false.
    TrueOrFalse,
    /// Three numbers.
    Vector,
    /// Number, list or profile, for this many rods.
    Quantity(usize),
    /// Number or list, for this many rods.
    LengthOf(usize),
    /// Number or list, for this many gaps.
    PerGap(usize),
    /// Any list of numbers.
    ListOfNumbers,
    /// Any list of triples of numbers.
    ListOfVectors,
    /// A table of two lists.
    Table(Form),
    /// The `value` of a profile: numbers, or one list per rod.
    ProfileValue(usize),
}

impl fmt::Display for Needed {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Needed::Number => write!(f, "a number"),
            Needed::Text => write!(f, "text in quotes"),
            Needed::TrueOrFalse => write!(f, "true or false"),
            Needed::Vector => write!(f, "a list of three numbers [x, y, z]"),
            Needed::Quantity(rods) => write!(
                f,
                "a number, a list of {rods} (one per rod), or a profile {{ at = [0.0, 1.0], value = [1.0, 0.5] }}"
            ),
            Needed::LengthOf(rods) => write!(f, "a number or a list of {rods} (one per rod)"),
            Needed::PerGap(gaps) => write!(
                f,
                "a number or a list of {gaps} (one per gap between neighbouring rods)"
            ),
            Needed::ListOfNumbers => write!(f, "a list of numbers"),
            Needed::ListOfVectors => write!(f, "a list of lists of three numbers [x, y, z]"),
            Needed::Table(form) => write!(f, "a table: {form}"),
            Needed::ProfileValue(rods) => {
                write!(
                    f,
                    "a list of numbers, or a list of {rods} such lists (one per rod)"
                )
            }
        }
    }
}

/// Tables of two lists that belong together.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Form {
    /// A quantity along the rods.
    Profile,
    /// A load in time.
    LoadInTime,
    /// A factor in time.
    FactorInTime,
}

impl fmt::Display for Form {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Form::Profile => "a profile is { at = [0.0, 1.0], value = [1.0, 0.5] }",
            Form::LoadInTime => {
                "a load in time is { at = [0.0, 1.0], value = [[0.0, 0.0, 0.0], [0.0, 0.0, -1.0]] }"
            }
            Form::FactorInTime => "a factor in time is { at = [0.0, 1.0], factor = [1.0, 2.0] }",
        })
    }
}

/// Why a list must have so many entries.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Because {
    /// One entry per rod.
    OnePerRod,
    /// One entry per gap between neighbouring rods.
    OnePerGap,
    /// One value per knot of a profile.
    OnePerKnot,
    /// One entry per lab axis.
    Axes,
}

impl fmt::Display for Because {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Because::OnePerRod => "one per rod (leaf.rods)",
            Because::OnePerGap => "one per gap between neighbouring rods (leaf.rods - 1)",
            Because::OnePerKnot => "one per entry of at",
            Because::Axes => "one per axis x, y, z",
        })
    }
}

fn did_you_mean(meant: Option<&str>) -> String {
    meant.map_or(String::new(), |key| format!(" (did you mean {key}?)"))
}

fn how_to_add(key: Key, has_table: bool) -> String {
    let line = format!("`{} = {}`", key.short_name(), key.example());
    match (key.table(), has_table) {
        ("", _) => format!("add a line such as {line} at the top of the file"),
        (table, true) => format!("add a line such as {line} below [{table}]"),
        (table, false) => format!("add the table [{table}], and below it a line such as {line}"),
    }
}

/// The line of `text` that holds byte `at`, counted from 1.
pub(super) fn line_of(text: &[u8], at: usize) -> usize {
    1 + text[..at.min(text.len())]
        .iter()
        .filter(|byte| **byte == b'\n')
        .count()
}

/// The offending line with a caret below, to be put after a message; empty
/// where the line is too long to be read.
pub(super) fn snippet(text: &str, span: std::ops::Range<usize>) -> String {
    const WIDEST: usize = 120;
    let at = span.start.min(text.len());
    let (Some(before), Some(after)) = (text.get(..at), text.get(at..)) else {
        return String::new();
    };
    let start = before.rfind('\n').map_or(0, |newline| newline + 1);
    let line = text[start..at + after.find('\n').unwrap_or(after.len())].trim_end();
    if line.chars().count() > WIDEST {
        return String::new();
    }
    let number = line_of(text.as_bytes(), at).to_string();
    let gap = " ".repeat(number.len());
    // Tabs stay tabs, so that the caret stands below its character.
    let indent: String = text[start..at]
        .chars()
        .map(|c| if c == '\t' { '\t' } else { ' ' })
        .collect();
    let width = text
        .get(span.start..span.end.max(span.start))
        .map_or(1, |s| s.trim_end().chars().count());
    let room = line
        .chars()
        .count()
        .saturating_sub(indent.chars().count())
        .max(1);
    let carets = "^".repeat(width.clamp(1, room));
    format!("\n{gap} |\n{number} | {line}\n{gap} | {indent}{carets}")
}

/// `text` on one line and not too long.
pub(super) fn shorten(text: &str) -> String {
    const LONGEST: usize = 60;
    let mut short = String::new();
    for word in text.split_whitespace() {
        if !short.is_empty() {
            short.push(' ');
        }
        short.push_str(word);
        if let Some((cut, _)) = short.char_indices().nth(LONGEST) {
            short.truncate(cut);
            short.push_str(" ...");
            break;
        }
    }
    short
}
