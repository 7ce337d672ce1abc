//! Settings of figures from the scenario: units of length, and gravity.

use glam::DVec3;

use leafdyn::scenario::{Scenario, Units};

/// Lengths are drawn in units of the longest rod L, and shown in the scenario's unit
/// if it names one.
#[derive(Clone, Debug)]
pub struct Setting {
    units: Units,
    /// The longest rod, in the scenario's unit.
    length: f64,
    /// Direction of gravity, if there is any.
    pub gravity: Option<DVec3>,
}

/// Names of the axes as fractions of L, with what they mean.
const FRACTIONS: [(&str, &str); 3] = [("ξ", "x/L"), ("η", "y/L"), ("ζ", "z/L")];
const COORDINATES: [&str; 3] = ["x", "y", "z"];

impl Setting {
    pub fn of(scenario: &Scenario) -> Self {
        Setting {
            units: scenario.units.clone(),
            length: leafdyn::scenario::longest(&scenario.rods),
            gravity: weight(scenario).try_normalize(),
        }
    }

    /// The value shown for a drawn length of 1.
    pub fn scale(&self) -> f64 {
        match self.units.length {
            Some(_) if self.length.is_normal() => self.length,
            _ => 1.0,
        }
    }

    /// The name of an axis whose values are shown.
    pub fn axis(&self, axis: usize) -> String {
        match (&self.units.length, FRACTIONS[axis]) {
            (Some(unit), _) => with_unit(COORDINATES[axis], Some(unit)),
            (None, (name, meaning)) => format!("{name} = {meaning}"),
        }
    }

    /// A shorter name, with the unit only if values are shown.
    pub fn brief_axis(&self, axis: usize, values: bool) -> String {
        match (&self.units.length, values) {
            (Some(_), true) => self.axis(axis),
            (Some(_), false) => COORDINATES[axis].into(),
            (None, _) => FRACTIONS[axis].0.into(),
        }
    }

    /// The length of the longest rod, as text.
    pub fn length(&self) -> String {
        match &self.units.length {
            Some(unit) => format!("{} {unit}", self.length),
            None => self.length.to_string(),
        }
    }

    /// The unit of the values shown.
    pub fn unit(&self) -> &str {
        self.units.length.as_deref().unwrap_or("L")
    }
}

/// The direction of the weight of all veins.
fn weight(scenario: &Scenario) -> DVec3 {
    if scenario.g == [0.0; 3] && scenario.own_gravity.is_empty() {
        return DVec3::from_array(scenario.gravity);
    }
    let of_vein = |vein: usize| {
        let weight = scenario.weight(vein);
        let pulled = (weight.of_mass).map_or(DVec3::ZERO, |(g, mass)| {
            DVec3::from_array(g) * mass.integral(1.0)
        });
        scenario.rods[vein].length * (DVec3::from_array(weight.even) + pulled)
    };
    (0..scenario.rods.len()).map(of_vein).sum()
}

/// A name with its unit, if that is known.
pub fn with_unit(name: &str, unit: Option<&str>) -> String {
    match unit {
        Some(unit) => format!("{name} / {unit}"),
        None => name.into(),
    }
}
