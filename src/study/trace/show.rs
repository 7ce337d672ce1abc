//! What the figure of a trace shows.

use std::fmt::{Display, Formatter};
use std::str::FromStr;

use crate::study::UnknownWord;

/// What the figure of a trace shows against the number that varies. Axes are 0, 1, 2.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TraceShow {
    /// A coordinate of the tip; of the first one if they are free.
    Tip(usize),
    /// A component of the reaction at held tips.
    Reaction(usize),
    /// A component of the force on a grip.
    Grip {
        /// The grip, counted from 0.
        grip: usize,
        /// The axis.
        axis: usize,
    },
    /// The potential energy.
    Energy,
    /// The mean twist of the veins, in radians.
    Twist,
}

const AXES: [&str; 3] = ["x", "y", "z"];

impl Display for TraceShow {
    fn fmt(&self, f: &mut Formatter) -> std::fmt::Result {
        match self {
            TraceShow::Tip(axis) => f.write_str(AXES[*axis]),
            TraceShow::Reaction(axis) => write!(f, "reaction_{}", AXES[*axis]),
            TraceShow::Grip { grip, axis } => write!(f, "grip_{}_{}", grip + 1, AXES[*axis]),
            TraceShow::Energy => f.write_str("energy"),
            TraceShow::Twist => f.write_str("twist"),
        }
    }
}

impl FromStr for TraceShow {
    type Err = UnknownWord;

    fn from_str(text: &str) -> Result<Self, UnknownWord> {
        let axis = |word: &str| AXES.iter().position(|axis| *axis == word);
        let parts: Vec<&str> = text.split('_').collect();
        let found = match parts.as_slice() {
            ["energy"] => Some(TraceShow::Energy),
            ["twist"] => Some(TraceShow::Twist),
            [word] => axis(word).map(TraceShow::Tip),
            ["reaction", word] => axis(word).map(TraceShow::Reaction),
            ["grip", number, word] => {
                let number = number.parse::<usize>().ok();
                let grip = number.and_then(|number| number.checked_sub(1));
                grip.zip(axis(word))
                    .map(|(grip, axis)| TraceShow::Grip { grip, axis })
            }
            _ => None,
        };
        found.ok_or_else(|| UnknownWord {
            found: text.into(),
            allowed: vec![
                "x",
                "y",
                "z",
                "reaction_x",
                "reaction_y",
                "reaction_z",
                "grip_1_x, ...",
                "energy",
                "twist",
            ],
        })
    }
}
