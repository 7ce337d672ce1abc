//! How accurate a leaf at rest is: extrapolation, defects, and the leaf between its nodes.

pub mod defect;
pub mod dense_output;
pub mod jump_response;
pub mod nodal_fields;
pub mod richardson;
pub mod steps;
