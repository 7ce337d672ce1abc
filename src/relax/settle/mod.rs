//! How a leaf comes to rest on one grid: the start, held tips that are moved to their places, the
//! methods, and pushes off saddles.

pub mod effort;
pub mod grip;
pub mod iteration;
pub mod methods;
pub mod push;
pub mod segments;
pub mod settle_from;
pub mod start;
