//! How a leaf comes to rest on one grid: the start, held tips that are moved to their places, and the methods.

pub mod found;
pub mod grip;
pub mod iteration;
pub mod methods;
pub mod run;
pub mod segments;
pub mod settle_from;
pub mod start;
