//! What is asked of a relaxation: the method and the options.

pub mod method;
pub mod options;
