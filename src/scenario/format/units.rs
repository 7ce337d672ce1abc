//! Names of units, and those that follow from them.

use crate::numbers::superscript;

/// Exponents of length, force and time in the unit of a quantity.
pub type Dimension = [i32; 3];

/// The dimension of fractions, angles and numbers.
pub const DIMENSIONLESS: Dimension = [0, 0, 0];

/// The dimension of positions and displacements.
pub const LENGTH: Dimension = [1, 0, 0];

/// The dimension of areas.
pub const AREA: Dimension = [2, 0, 0];

/// The dimension of forces.
pub const FORCE: Dimension = [0, 1, 0];

/// The dimension of energies and moments.
pub const ENERGY: Dimension = [1, 1, 0];

/// The dimension of stresses and moduli.
pub const STRESS: Dimension = [-2, 1, 0];

/// The dimension of forces per length and of spring constants.
pub const FORCE_PER_LENGTH: Dimension = [-1, 1, 0];

/// The dimension of the stiffness of tissue along, across and out of the surface: force per
/// displacement and length.
pub const FORCE_PER_AREA: Dimension = STRESS;

/// The dimension of bending and torsional stiffnesses.
pub const COUPLE_STIFFNESS: Dimension = [2, 1, 0];

/// The dimension of times.
pub const TIME: Dimension = [0, 0, 1];

/// The dimension of frequencies and rates.
pub const RATE: Dimension = [0, 0, -1];

/// That of velocities.
pub const VELOCITY: Dimension = [1, 0, -1];

/// The dimension of masses.
pub const MASS: Dimension = [-1, 1, 2];

/// The dimension of external damping: force per length and velocity.
pub const DAMPING: Dimension = [-2, 1, 1];

/// Names of the units a scenario is written in.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Units {
    /// The unit of lengths.
    pub length: Option<String>,
    /// The unit of forces.
    pub force: Option<String>,
    /// The unit of times.
    pub time: Option<String>,
}

impl Units {
    /// The unit of a quantity, as in `N cm²` and `cm/s²`; `None` if it has none, or if a unit that
    /// it follows from has no name.
    pub fn unit_name(&self, dimension: Dimension) -> Option<String> {
        let names = [&self.force, &self.length, &self.time];
        let [length, force, time] = dimension;
        if self.is_si() && (force, time) == (1, 2) {
            return Some(match length + 1 {
                0 => "kg".into(),
                1 => "kg m".into(),
                -1 => "kg/m".into(),
                power @ 1.. => format!("kg m{}", superscript(power)),
                power => format!("kg/m{}", superscript(-power)),
            });
        }
        let powers = [force, length, time];
        let mut factors = [Vec::new(), Vec::new()];
        for (name, power) in names.into_iter().zip(powers) {
            if power != 0 {
                let name = name.as_ref()?;
                let factor = match power.abs() {
                    1 => name.clone(),
                    power => format!("{name}{}", superscript(power)),
                };
                factors[usize::from(power < 0)].push(factor);
            }
        }
        let [above, below] = factors;
        let above = match above.is_empty() {
            true => "1".into(),
            false => above.join(" "),
        };
        match below.len() {
            _ if dimension == DIMENSIONLESS => None,
            0 => Some(above),
            1 => Some(format!("{above}/{}", below[0])),
            _ => Some(format!("{above}/({})", below.join(" "))),
        }
    }

    /// Whether lengths are in metres, forces in newtons and times in seconds.
    fn is_si(&self) -> bool {
        self.meters() == Some(1.0) && self.newtons() == Some(1.0) && self.is_in_seconds()
    }

    /// The unit of energies and moments, if those of forces and lengths are named.
    pub fn energy(&self) -> Option<String> {
        self.unit_name(ENERGY)
    }

    /// The unit of cycles per time: `Hz` if times are in seconds.
    pub fn frequency(&self) -> Option<String> {
        match self.is_in_seconds() {
            true => Some("Hz".into()),
            false => self.unit_name(RATE),
        }
    }

    /// How many grams the unit of mass is, if it follows from a known unit of length, newtons and
    /// seconds.
    pub fn grams(&self) -> Option<f64> {
        let newtons = self.force.as_deref() == Some("N");
        let metre = match self.length.as_deref()? {
            "m" => 1.0,
            "cm" => 1e2,
            "mm" => 1e3,
            _ => return None,
        };
        (newtons && self.is_in_seconds()).then_some(1e3 * metre)
    }

    /// How many meters the unit of length is, if it has a known name.
    pub fn meters(&self) -> Option<f64> {
        match self.length.as_deref()? {
            "m" => Some(1.0),
            "dm" => Some(0.1),
            "cm" => Some(0.01),
            "mm" => Some(1e-3),
            "in" => Some(0.0254),
            "ft" => Some(0.3048),
            _ => None,
        }
    }

    /// How many newtons the unit of force is, if it has a known name.
    pub fn newtons(&self) -> Option<f64> {
        match self.force.as_deref()? {
            "N" => Some(1.0),
            "mN" => Some(1e-3),
            "kN" => Some(1e3),
            "lbf" => Some(4.448_221_615_260_5),
            _ => None,
        }
    }

    /// Whether the unit of time is called that of a second.
    pub fn is_in_seconds(&self) -> bool {
        self.time.as_deref() == Some("s")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn units_follow_from_three_names() {
        let units = Units {
            length: Some("cm".into()),
            force: Some("N".into()),
            time: Some("s".into()),
        };
        let all = [LENGTH, ENERGY, STRESS, RATE, MASS, [-4, 1, 2], [-2, 1, 1]];
        let names = all.map(|dimension| units.unit_name(dimension).unwrap());
        let wanted = [
            "cm",
            "N cm",
            "N/cm²",
            "1/s",
            "N s²/cm",
            "N s²/cm⁴",
            "N s/cm²",
        ];
        assert_eq!(names, wanted);
        assert_eq!(units.unit_name(DIMENSIONLESS), None);
        assert_eq!(units.unit_name([-1, -1, 0]).unwrap(), "1/(N cm)");
        assert_eq!(units.frequency().unwrap(), "Hz");
        assert_eq!(units.grams(), Some(1e5));
        let si = Units {
            length: Some("m".into()),
            ..units.clone()
        };
        // Mass, its moment of inertia, and mass per length, area and volume.
        let masses = [-1, 1, -2, -3, -4].map(|length| si.unit_name([length, 1, 2]).unwrap());
        assert_eq!(masses, ["kg", "kg m²", "kg/m", "kg/m²", "kg/m³"]);
        let without = Units {
            time: None,
            ..units
        };
        assert_eq!(
            (without.unit_name(MASS), without.unit_name(FORCE)),
            (None, Some("N".into()))
        );
        assert_eq!(without.grams(), None);
    }
}
