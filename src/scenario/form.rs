//! What the values of keys look like.

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
    /// A number, or a profile along the leaf.
    Outline(Range),
    /// A number for all gaps between neighbouring rods, or a list.
    PerGap(Range),
    /// x, y, z.
    Vector,
    /// x, y, z for all rods, or a list with one such vector for each.
    VectorPerRod,
    /// The same, or a profile of vectors along the rods.
    VectorQuantity,
    /// A place along a rod, or the two ends of a stretch: fractions of the length.
    Stretch,
    /// A pixel of a photograph, to the right and down.
    Pixel,
    /// Base angles: a list, or a word.
    Fan,
    /// Vectors at given times.
    VectorInTime,
    /// The same, or one vector for all times.
    VectorOrInTime,
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
            Form::Number(range)
            | Form::PerRod(range)
            | Form::Quantity(range)
            | Form::Outline(range)
            | Form::PerGap(range) => range,
            _ => Range::Finite,
        }
    }
}
