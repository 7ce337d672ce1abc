//! Quantities that can be measured on a leaf.

use std::str::FromStr;

/// A quantity that can be measured on a leaf.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Quantity {
    /// A coordinate of the shared tip, or of the only rod's: 0, 1, 2.
    Tip(usize),
    /// A component of the reaction at a held tip: 0, 1, 2.
    Reaction(usize),
    /// A component of the force on a grip, which is counted from 0: 0, 1, 2.
    Grip(usize, usize),
    /// The frequency of a mode in cycles per time; modes are numbered from 1.
    Frequency(usize),
}

impl Quantity {
    /// The quantities as words that can be followed by a plural.
    pub(super) const ALL: &str = "tip_x, tip_y, tip_z, reaction_x, reaction_y, reaction_z, grip_1_x, ..., frequency_1, \
         frequency_2, ...";

    pub(super) fn kind(self) -> Kind {
        match self {
            Quantity::Tip(_) => Kind::Length,
            Quantity::Reaction(_) | Quantity::Grip(..) => Kind::Force,
            Quantity::Frequency(_) => Kind::Frequency,
        }
    }
}

/// Kinds of data, which can only be weighted relative to each other by their deviations.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    Length,
    /// Of photographs.
    Pixel,
    Force,
    Frequency,
}

const AXES: [&str; 3] = ["x", "y", "z"];

impl FromStr for Quantity {
    type Err = ();

    fn from_str(text: &str) -> Result<Self, ()> {
        let axis = |axis: &str| AXES.iter().position(|name| *name == axis).ok_or(());
        match text.split_once('_') {
            Some(("tip", at)) => Ok(Quantity::Tip(axis(at)?)),
            Some(("reaction", at)) => Ok(Quantity::Reaction(axis(at)?)),
            Some(("grip", rest)) => {
                let (number, at) = rest.split_once('_').ok_or(())?;
                let number: usize = number.parse().map_err(|_| ())?;
                Ok(Quantity::Grip(number.checked_sub(1).ok_or(())?, axis(at)?))
            }
            Some(("frequency", mode)) => match mode.parse() {
                Ok(mode @ 1..=crate::relax::MOST_MODES) => Ok(Quantity::Frequency(mode)),
                _ => Err(()),
            },
            _ => Err(()),
        }
    }
}

impl std::fmt::Display for Quantity {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        match self {
            Quantity::Tip(axis) => write!(f, "tip_{}", AXES[*axis]),
            Quantity::Reaction(axis) => write!(f, "reaction_{}", AXES[*axis]),
            Quantity::Grip(grip, axis) => write!(f, "grip_{}_{}", grip + 1, AXES[*axis]),
            Quantity::Frequency(mode) => write!(f, "frequency_{mode}"),
        }
    }
}
