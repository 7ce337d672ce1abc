//! Settings of figures from the scenario: units of length, gravity and wind.

use glam::DVec3;

use crate::report::numbers::short;
use leafdyn::scenario::{Scenario, Schedule, Units};
use serde::Serialize;

/// Lengths are drawn in units of the longest rod L, and shown in the scenario's unit
/// if it names one.
#[derive(Clone, Debug)]
pub struct Setting {
    units: Units,
    /// The longest rod, in the scenario's unit.
    length: f64,
    /// Direction of gravity, if there is any.
    gravity: Option<DVec3>,
    /// Velocity of the air, if there is wind.
    wind: Option<Schedule<[f64; 3]>>,
}

/// A direction that is drawn as an arrow with its name.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Arrow {
    pub name: &'static str,
    /// Of length one.
    pub direction: DVec3,
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
            wind: scenario.wind.as_ref().map(|wind| wind.velocity.clone()),
        }
    }

    /// The arrows of the first panel, or of a later one, which shows what may differ from the first:
    /// the wind at this time.
    pub fn arrows(&self, first: bool, time: f64) -> Vec<Arrow> {
        let gravity = self.gravity.filter(|_| first).map(|direction| Arrow {
            direction,
            name: "gravity",
        });
        let wind = self.wind.as_ref();
        let wind = wind.filter(|wind| first || !wind.is_constant());
        let direction = wind.and_then(|wind| DVec3::from_array(wind.at(time)).try_normalize());
        let wind = direction.map(|direction| Arrow {
            direction,
            name: "wind",
        });
        gravity.into_iter().chain(wind).collect()
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
            Some(unit) => format!("{} {unit}", short(self.length)),
            None => short(self.length),
        }
    }

    /// A moment of this size, as text.
    pub fn moment(&self, size: f64) -> String {
        let unit = self.units.energy();
        short(size) + &unit.map_or(String::new(), |unit| format!(" {unit}"))
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
        Some(unit) if unit.contains('/') => format!("{name} / ({unit})"),
        Some(unit) => format!("{name} / {unit}"),
        None => name.into(),
    }
}
