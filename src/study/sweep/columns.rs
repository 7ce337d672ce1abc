//! What a leaf at rest has as columns of a table: their names, dimensions and values, with a bound on the
//! error of every number that has one. Tables of the program and of Python are made from this list.

use crate::leaf::Leaf;
use crate::numbers::larger;
use crate::relax::{Equilibrium, Mode};
use crate::scenario::Scenario;
use crate::scenario::units::{DIMENSIONLESS, Dimension, ENERGY, FORCE, LENGTH, RATE, STRESS};
use crate::study::vary::AXIS_NAMES;
use glam::DVec3;
use serde::{Serialize, Serializer};
use std::f64::consts::TAU;
use std::fmt;
use std::str::FromStr;

/// The dimension of squared frequencies.
const SQUARED_RATE: Dimension = [0, 0, -2];

/// Largest number of a mode, a motion or a grip in the name of a column.
const LARGEST_NUMBER: usize = 999_999;

/// A quantity of a leaf at rest. Axes are 0, 1 and 2; modes, motions and grips count from 0.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LeafQuantity {
    /// How the run ended.
    Outcome,
    /// Whether the leaf is at rest within the tolerance.
    Success,
    /// A coordinate of the joint tip, or of the first rod's.
    Tip(usize),
    /// The force on the supports of all bases, along a lab axis.
    BaseForce(usize),
    /// The moment on the supports of all bases about the mean of these, about a lab axis.
    BaseMoment(usize),
    /// The force on the holder of a held tip, along a lab axis.
    Reaction(usize),
    /// The force on the holder of a grip, along a lab axis.
    Grip {
        /// Which grip.
        grip: usize,
        /// Along which axis.
        axis: usize,
    },
    /// The largest equivalent (von Mises) stress in the sections.
    PeakStress,
    /// The potential energy.
    Energy,
    /// The lowest eigenvalue of the energy's Hessian with respect to the masses.
    LowestEigenvalue,
    /// The frequency of a mode or, without a potential, of a small motion, in cycles per time.
    Frequency(usize),
    /// Without a potential: how fast a small motion grows.
    GrowthRate(usize),
    /// Whether the equilibrium is stable.
    Stable,
    /// The Morse index.
    NegativeEigenvalues,
    /// Directions in which the leaf moves without resistance.
    NeutralDirections,
    /// Waves along the margin that has more of them.
    MarginWaves,
    /// Their amplitude.
    MarginAmplitude,
    /// Mean twist of the veins from base to tip, in radians.
    Twist,
    /// Bound on the error of the positions.
    ErrorEstimate,
    /// Of a blade: about how far some point would move with many more veins.
    ErrorInVeins,
    /// Largest unbalanced force or moment, without units.
    Residual,
    /// How the leaf came to this equilibrium.
    Path,
    /// Seconds of the solution.
    WallSeconds,
    /// What would help, or what else is to be said of the result.
    Remark,
}

/// What the cells of a column are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ColumnKind {
    /// Real numbers.
    Number,
    /// Whole numbers.
    Count,
    /// True or false.
    Truth,
    /// Words and sentences.
    Text,
}

/// A cell of a table that is known.
#[derive(Clone, Debug, PartialEq)]
pub enum ColumnValue {
    /// A real number.
    Number(f64),
    /// A whole number.
    Count(usize),
    /// True or false.
    Truth(bool),
    /// A word or a sentence.
    Text(String),
}

impl ColumnValue {
    /// The number, if it is one.
    pub fn number(&self) -> Option<f64> {
        match self {
            ColumnValue::Number(value) => Some(*value),
            ColumnValue::Count(count) => Some(*count as f64),
            ColumnValue::Truth(_) | ColumnValue::Text(_) => None,
        }
    }
}

/// Numbers are written as Rust does, from which every bit can be read.
impl fmt::Display for ColumnValue {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        match self {
            ColumnValue::Number(value) => write!(f, "{value:?}"),
            ColumnValue::Count(count) => count.fmt(f),
            ColumnValue::Truth(is_true) => is_true.fmt(f),
            ColumnValue::Text(text) => f.write_str(text),
        }
    }
}

impl Serialize for ColumnValue {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            ColumnValue::Number(value) => serializer.serialize_f64(*value),
            ColumnValue::Count(count) => serializer.serialize_u64(*count as u64),
            ColumnValue::Truth(is_true) => serializer.serialize_bool(*is_true),
            ColumnValue::Text(text) => serializer.serialize_str(text),
        }
    }
}

/// A value, and a bound on its error.
struct Measured {
    value: f64,
    error: Option<f64>,
}

impl LeafQuantity {
    /// Quantities without an axis and without a number, by their names.
    const NAMED: [(&'static str, LeafQuantity); 17] = [
        ("outcome", LeafQuantity::Outcome),
        ("success", LeafQuantity::Success),
        ("peak_stress", LeafQuantity::PeakStress),
        ("energy", LeafQuantity::Energy),
        ("lowest_eigenvalue", LeafQuantity::LowestEigenvalue),
        ("stable", LeafQuantity::Stable),
        ("negative_eigenvalues", LeafQuantity::NegativeEigenvalues),
        ("neutral_directions", LeafQuantity::NeutralDirections),
        ("margin_waves", LeafQuantity::MarginWaves),
        ("margin_amplitude", LeafQuantity::MarginAmplitude),
        ("twist", LeafQuantity::Twist),
        ("error_estimate", LeafQuantity::ErrorEstimate),
        ("error_in_veins", LeafQuantity::ErrorInVeins),
        ("residual", LeafQuantity::Residual),
        ("path", LeafQuantity::Path),
        ("wall_seconds", LeafQuantity::WallSeconds),
        ("remark", LeafQuantity::Remark),
    ];

    /// What the cells of its column are.
    pub fn kind(self) -> ColumnKind {
        match self {
            LeafQuantity::Outcome | LeafQuantity::Path | LeafQuantity::Remark => ColumnKind::Text,
            LeafQuantity::Success | LeafQuantity::Stable => ColumnKind::Truth,
            LeafQuantity::NegativeEigenvalues | LeafQuantity::NeutralDirections => {
                ColumnKind::Count
            }
            _ => ColumnKind::Number,
        }
    }

    /// Exponents of length, force and time in its unit.
    pub fn dimension(self) -> Dimension {
        match self {
            LeafQuantity::Tip(_)
            | LeafQuantity::MarginAmplitude
            | LeafQuantity::ErrorEstimate
            | LeafQuantity::ErrorInVeins => LENGTH,
            LeafQuantity::BaseForce(_) | LeafQuantity::Reaction(_) | LeafQuantity::Grip { .. } => {
                FORCE
            }
            LeafQuantity::BaseMoment(_) | LeafQuantity::Energy => ENERGY,
            LeafQuantity::PeakStress => STRESS,
            LeafQuantity::LowestEigenvalue => SQUARED_RATE,
            LeafQuantity::Frequency(_) | LeafQuantity::GrowthRate(_) => RATE,
            _ => DIMENSIONLESS,
        }
    }

    /// Whether bounds on its error are known.
    pub fn has_error(self) -> bool {
        matches!(
            self,
            LeafQuantity::Tip(_)
                | LeafQuantity::BaseForce(_)
                | LeafQuantity::BaseMoment(_)
                | LeafQuantity::Reaction(_)
                | LeafQuantity::Grip { .. }
                | LeafQuantity::PeakStress
                | LeafQuantity::Energy
                | LeafQuantity::LowestEigenvalue
                | LeafQuantity::Frequency(_)
                | LeafQuantity::GrowthRate(_)
        )
    }

    /// How many of the lowest modes its value needs.
    pub fn modes(self) -> usize {
        match self {
            LeafQuantity::LowestEigenvalue => 1,
            LeafQuantity::Frequency(mode) | LeafQuantity::GrowthRate(mode) => mode + 1,
            _ => 0,
        }
    }

    /// Its value in a leaf; `None` where that is not known.
    pub fn value(self, leaf: &Equilibrium) -> Option<ColumnValue> {
        let truth = |is_true| Some(ColumnValue::Truth(is_true));
        let count = |count| Some(ColumnValue::Count(count));
        let number = |value: f64| Some(ColumnValue::Number(value));
        let margin = || leaf.undulation.margin();
        match self {
            LeafQuantity::Outcome => Some(ColumnValue::Text(leaf.outcome.word().into())),
            LeafQuantity::Success => truth(leaf.outcome.is_success()),
            LeafQuantity::Stable => truth(leaf.stable()?),
            LeafQuantity::NegativeEigenvalues => count(leaf.stability.negative_eigenvalues?),
            LeafQuantity::NeutralDirections => count(leaf.stability.neutral_directions),
            LeafQuantity::MarginWaves => number(margin()?.waves()),
            LeafQuantity::MarginAmplitude => number(margin()?.amplitude),
            LeafQuantity::Twist => number(leaf.undulation.twist()),
            LeafQuantity::ErrorEstimate => number(leaf.accuracy.error_estimate?),
            LeafQuantity::ErrorInVeins => number(leaf.blade.as_ref()?.error_in_veins?),
            LeafQuantity::Residual => number(leaf.accuracy.residual?),
            LeafQuantity::WallSeconds => number(leaf.wall_seconds),
            LeafQuantity::Path => {
                let path = leaf.path.as_ref()?;
                Some(ColumnValue::Text(path.word().into()))
            }
            LeafQuantity::Remark => {
                let remark = leaf.remark.as_ref()?;
                Some(ColumnValue::Text(remark.to_string()))
            }
            _ => number(self.measured(leaf)?.value),
        }
    }

    /// A bound on the error of its value in a leaf; `None` where none is known.
    pub fn error(self, leaf: &Equilibrium) -> Option<f64> {
        self.measured(leaf)?.error
    }

    /// The value of a quantity that has an error, with the bound on that.
    fn measured(self, leaf: &Equilibrium) -> Option<Measured> {
        let component = |vector: DVec3, axis: usize, error| {
            // Adding zero turns -0 into 0.
            Some(Measured {
                value: vector.to_array()[axis] + 0.0,
                error,
            })
        };
        let at_rest = || Some(leaf).filter(|leaf| leaf.outcome.is_at_rest());
        match self {
            LeafQuantity::Tip(axis) => {
                component(*leaf.tips.first()?, axis, leaf.accuracy.error_estimate)
            }
            LeafQuantity::BaseForce(axis) => {
                let base = at_rest()?.base_reaction?;
                component(base.force, axis, base.error)
            }
            LeafQuantity::BaseMoment(axis) => {
                let base = at_rest()?.base_reaction?;
                component(base.moment?, axis, base.moment_error)
            }
            LeafQuantity::Reaction(axis) => {
                let reaction = leaf.reaction.as_ref()?;
                component(reaction.force, axis, reaction.error)
            }
            LeafQuantity::Grip { grip, axis } => {
                let reaction = leaf.grip_reactions.get(grip)?;
                component(reaction.force, axis, reaction.error)
            }
            LeafQuantity::PeakStress => {
                let stress = at_rest()?.stress.as_ref()?;
                Some(Measured {
                    value: stress.largest.equivalent,
                    error: stress.error,
                })
            }
            LeafQuantity::Energy => Some(Measured {
                value: leaf.energy?,
                error: leaf.accuracy.energy_error,
            }),
            LeafQuantity::LowestEigenvalue => {
                let mode = leaf.stability.modes.as_ref()?.first()?;
                Some(Measured {
                    value: mode.eigenvalue,
                    error: mode.error,
                })
            }
            LeafQuantity::Frequency(k) => match &leaf.stability.small_motions {
                None => frequency_of_mode(leaf.stability.modes.as_ref()?.get(k)?),
                Some(motions) => Some(Measured {
                    value: motions.frequencies.get(k)? / TAU,
                    error: motions
                        .errors
                        .as_ref()
                        .and_then(|all| all.get(k))
                        .map(|error| error / TAU),
                }),
            },
            LeafQuantity::GrowthRate(k) => {
                let motions = leaf.stability.small_motions.as_ref()?;
                Some(Measured {
                    value: *motions.growth_rates.get(k)?,
                    error: motions.errors.as_ref().and_then(|all| all.get(k)).copied(),
                })
            }
            _ => None,
        }
    }
}

/// The frequency of a mode in cycles per time, none of an unstable one. With an error `e` the eigenvalue is
/// within `w² ± e`: the bound is that on its root.
fn frequency_of_mode(mode: &Mode) -> Option<Measured> {
    let frequency = mode.frequency()?;
    let error = mode.error.map(|error| {
        let [low, high] = [-error, error].map(|by| (mode.eigenvalue + by).max(0.0).sqrt());
        larger(frequency - low, high - frequency) / TAU
    });
    Some(Measured {
        value: frequency / TAU,
        error,
    })
}

/// As in `tip_x`, `grip_1_z`, `frequency_1`.
impl fmt::Display for LeafQuantity {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let component = |axis: &usize| AXIS_NAMES[*axis];
        match self {
            LeafQuantity::Tip(axis) => write!(f, "tip_{}", component(axis)),
            LeafQuantity::BaseForce(axis) => write!(f, "base_reaction_{}", component(axis)),
            LeafQuantity::BaseMoment(axis) => write!(f, "base_moment_{}", component(axis)),
            LeafQuantity::Reaction(axis) => write!(f, "reaction_{}", component(axis)),
            LeafQuantity::Grip { grip, axis } => {
                write!(f, "grip_{}_{}", grip + 1, component(axis))
            }
            LeafQuantity::Frequency(mode) => write!(f, "frequency_{}", mode + 1),
            LeafQuantity::GrowthRate(mode) => write!(f, "growth_rate_{}", mode + 1),
            named => {
                let mut all = LeafQuantity::NAMED.iter();
                let name = all.find(|(_, quantity)| quantity == named);
                f.write_str(name.map_or("", |(name, _)| name))
            }
        }
    }
}

impl FromStr for LeafQuantity {
    type Err = UnknownColumn;

    fn from_str(text: &str) -> Result<Self, UnknownColumn> {
        let text = text.trim();
        let named = LeafQuantity::NAMED.iter().find(|(name, _)| *name == text);
        let found = named.map(|(_, quantity)| *quantity);
        let found = found.or_else(|| {
            let (stem, last) = text.rsplit_once('_')?;
            let axis = || AXIS_NAMES.iter().position(|name| *name == last);
            let number = |digits: &str| {
                let plain = digits.bytes().all(|digit| digit.is_ascii_digit());
                let number: usize = digits.parse().ok().filter(|_| plain)?;
                (1..=LARGEST_NUMBER).contains(&number).then_some(number - 1)
            };
            match stem {
                "tip" => Some(LeafQuantity::Tip(axis()?)),
                "base_reaction" => Some(LeafQuantity::BaseForce(axis()?)),
                "base_moment" => Some(LeafQuantity::BaseMoment(axis()?)),
                "reaction" => Some(LeafQuantity::Reaction(axis()?)),
                "frequency" => Some(LeafQuantity::Frequency(number(last)?)),
                "growth_rate" => Some(LeafQuantity::GrowthRate(number(last)?)),
                grip => Some(LeafQuantity::Grip {
                    grip: number(grip.strip_prefix("grip_")?)?,
                    axis: axis()?,
                }),
            }
        });
        found.ok_or_else(|| UnknownColumn { name: text.into() })
    }
}

/// A column of a table of leaves: a quantity, or the bound on its error, `tip_x_error`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LeafColumn {
    /// The quantity.
    pub quantity: LeafQuantity,
    /// Whether the column has the bound on its error.
    pub is_error: bool,
}

/// What the name of a column of errors ends with.
const ERROR_SUFFIX: &str = "_error";

impl LeafColumn {
    /// The columns of these quantities, each number followed by its error if it has one.
    pub fn with_errors(quantities: &[LeafQuantity]) -> Vec<LeafColumn> {
        let columns = |&quantity: &LeafQuantity| {
            let values = LeafColumn {
                quantity,
                is_error: false,
            };
            let errors = LeafColumn {
                quantity,
                is_error: true,
            };
            [Some(values), quantity.has_error().then_some(errors)]
        };
        quantities.iter().flat_map(columns).flatten().collect()
    }

    /// What its cells are.
    pub fn kind(self) -> ColumnKind {
        match self.is_error {
            true => ColumnKind::Number,
            false => self.quantity.kind(),
        }
    }

    /// Its cell in the row of a leaf; `None` where that is not known.
    pub fn value(self, leaf: &Equilibrium) -> Option<ColumnValue> {
        match self.is_error {
            true => self.quantity.error(leaf).map(ColumnValue::Number),
            false => self.quantity.value(leaf),
        }
    }

    /// Its cell in the row of a leaf that was refused with a message.
    pub fn refused_value(self, message: &str) -> Option<ColumnValue> {
        match self.quantity {
            _ if self.is_error => None,
            LeafQuantity::Outcome => Some(ColumnValue::Text(REFUSED_OUTCOME.into())),
            LeafQuantity::Success => Some(ColumnValue::Truth(false)),
            LeafQuantity::Remark => Some(ColumnValue::Text(message.into())),
            _ => None,
        }
    }
}

/// The outcome of a leaf that is refused, besides the words of [`crate::relax::Outcome`].
pub const REFUSED_OUTCOME: &str = "refused";

impl fmt::Display for LeafColumn {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let suffix = if self.is_error { ERROR_SUFFIX } else { "" };
        write!(f, "{}{suffix}", self.quantity)
    }
}

impl FromStr for LeafColumn {
    type Err = UnknownColumn;

    fn from_str(text: &str) -> Result<Self, UnknownColumn> {
        if let Ok(quantity) = text.parse() {
            return Ok(LeafColumn {
                quantity,
                is_error: false,
            });
        }
        let of: Option<LeafQuantity> = (text.trim().strip_suffix(ERROR_SUFFIX))
            .and_then(|stem| stem.parse().ok())
            .filter(|quantity: &LeafQuantity| quantity.has_error());
        of.map(|quantity| LeafColumn {
            quantity,
            is_error: true,
        })
        .ok_or_else(|| UnknownColumn {
            name: text.trim().into(),
        })
    }
}

impl Serialize for LeafColumn {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

/// A name that no column of a leaf has.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "{name}: must be tip_x, base_reaction_x, base_moment_x, reaction_x, grip_1_x, frequency_1, growth_rate_1 or the like, {}, or the error of a number, as in tip_x_error",
    LeafQuantity::NAMED.map(|(name, _)| name).join(", ")
)]
pub struct UnknownColumn {
    /// The name.
    pub name: String,
}

/// The quantities in a table of leaves like that of a scenario, with so many modes.
pub fn quantities_of_leaf(scenario: &Scenario, modes: usize) -> Vec<LeafQuantity> {
    let has_potential = Leaf::new(scenario).has_potential();
    let vector = |of: fn(usize) -> LeafQuantity| (0..3).map(of);
    let mut all = vec![LeafQuantity::Outcome];
    all.extend(vector(LeafQuantity::Tip));
    all.extend(vector(LeafQuantity::BaseForce));
    all.extend(vector(LeafQuantity::BaseMoment));
    if scenario.held_tip.is_some() {
        all.extend(vector(LeafQuantity::Reaction));
    }
    for grip in 0..scenario.grips.len() {
        all.extend((0..3).map(|axis| LeafQuantity::Grip { grip, axis }));
    }
    if !scenario.moduli(0, 0.0).is_empty() {
        all.push(LeafQuantity::PeakStress);
    }
    if has_potential {
        all.push(LeafQuantity::Energy);
    }
    for mode in 0..modes {
        if !has_potential {
            all.push(LeafQuantity::GrowthRate(mode));
        }
        all.push(LeafQuantity::Frequency(mode));
    }
    if has_potential {
        all.push(LeafQuantity::NegativeEigenvalues);
    }
    all.push(LeafQuantity::Stable);
    if scenario.rods.len() > 1 {
        all.extend([LeafQuantity::MarginWaves, LeafQuantity::MarginAmplitude]);
    }
    all.push(LeafQuantity::Twist);
    all.push(LeafQuantity::ErrorEstimate);
    if scenario.blade.is_some() {
        all.push(LeafQuantity::ErrorInVeins);
    }
    all.push(LeafQuantity::Remark);
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Every name is read back, and errors have one only where there are any.
    #[test]
    fn names_are_read_back() {
        let numbered = [
            LeafQuantity::Tip(2),
            LeafQuantity::BaseForce(0),
            LeafQuantity::BaseMoment(1),
            LeafQuantity::Reaction(2),
            LeafQuantity::Grip { grip: 11, axis: 1 },
            LeafQuantity::Frequency(0),
            LeafQuantity::GrowthRate(9),
        ];
        let named = LeafQuantity::NAMED.iter().map(|(_, quantity)| *quantity);
        for quantity in named.chain(numbered) {
            let name = quantity.to_string();
            assert_eq!(name.parse(), Ok(quantity), "{name}");
            let error = format!("{name}_error").parse::<LeafColumn>();
            assert_eq!(error.is_ok(), quantity.has_error(), "{name}");
        }
        for wrong in [
            "tip",
            "tip_w",
            "frequency_0",
            "frequency_+1",
            "grip_x",
            "grip_0_x",
            "grip__x",
            "error",
            "",
            "tip_x_error_error",
            "frequency_99999999999999999999",
        ] {
            assert!(wrong.parse::<LeafColumn>().is_err(), "{wrong}");
        }
    }

    /// A frequency is within its bound wherever its eigenvalue may be.
    #[test]
    fn bounds_of_frequencies_are_those_of_eigenvalues() {
        let mode = |eigenvalue, error| Mode {
            eigenvalue,
            error: Some(error),
            effective_masses: None,
            displacement: Vec::new(),
            rotation: Vec::new(),
        };
        for (eigenvalue, error) in [(4.0, 1e-6), (4.0, 3.9), (1e-3, 2e-3), (0.0, 0.0)] {
            let found = frequency_of_mode(&mode(eigenvalue, error)).unwrap();
            let bound = found.error.unwrap();
            for k in 0..=20 {
                let exact = eigenvalue + error * (f64::from(k) / 10.0 - 1.0);
                let exact = exact.max(0.0).sqrt() / TAU;
                let away = (found.value - exact).abs();
                assert!(
                    away <= bound * (1.0 + 1e-12) + 1e-300,
                    "{eigenvalue} {away} {bound}"
                );
            }
        }
        assert!(frequency_of_mode(&mode(-1.0, 1e-3)).is_none());
    }
}
