//! What was found, in the units of the scenario.

pub mod blade;
pub mod equilibrium;
pub mod margin;
pub mod plausible;
pub mod reaction;
pub mod report;
pub mod stations;
pub mod stress;
