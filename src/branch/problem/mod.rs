//! The equations of branches: leaves that differ in parameters, linearised and solved.

pub mod bordered;
pub mod cache;
pub mod correct;
pub mod equations;
pub mod family;
pub mod field;
pub mod states;
pub mod step;
pub mod stuck;
