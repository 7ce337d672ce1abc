//! How bases and grips are held.

use crate::words;

words! {
    /// What is held.
    pub enum Hold {
        /// The position; directions are free, as on a hinge.
        Pinned = "pinned",
        /// The position and the directions.
        Clamped = "clamped",
    }
}
